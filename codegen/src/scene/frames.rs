//! Jacobians and drifts of named frames: derivatives of their twists.
//!
//! Does not know: how twists are written, lowered or emitted.

use std::collections::BTreeSet;

use hamel_expr::differentiate::Linearisation;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Section, SectionWriter, SymbolId, needed_sections};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{Equations, Output, OutputKind, StateEquation};

use super::dependence::needs;
use super::derivatives::Matrix;

/// Derivatives of the twists of all frames, with the definitions that they need.
#[derive(Default)]
pub(super) struct OfFrames {
    pub(super) outputs: Vec<Output>,
    pub(super) matrices: Vec<Matrix>,
    /// To come after the sections of the equations.
    pub(super) sections: Vec<Section>,
}

/// The derivatives that are wanted of twists `V(t, x, u)`: by the velocities `u` of the state, `J = dV/du`, and along
/// the motion at zero accelerations, `dV/dt + dV/dx xdot`.
///
/// # Errors
/// [`Error::Unsupported`] where the state has momenta, or the model gives the motion.
pub(super) fn find(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    wanted: &BTreeSet<Want>,
) -> Result<OfFrames, Error> {
    let mut found = OfFrames::default();
    let Some(first) = wanted.first() else { return Ok(found) };
    let Some((linear, _)) = equations.balanced_system() else {
        return Err(Error::Unsupported {
            what: format!("{} of equations that are not solved for the rates of velocities", first.name()),
            possible: "velocities of the model as state; remove `carry`".into(),
        });
    };
    let is_twist = |o: &&Output| o.kind == OutputKind::Group(Want::FrameTwists);
    let twists = equations.outputs.iter().find(is_twist).map(|o| o.components.clone()).unwrap_or_default();
    let values: Vec<ExprId> = twists.iter().map(|(_, e)| *e).collect();
    let sections = needed_sections(g, &equations.sections, &values);
    let mut writer = SectionWriter::new(g, BTreeSet::new(), &[]);
    let unknowns: Vec<SymbolId> = equations.system.unknowns.iter().map(|unknown| unknown.symbol).collect();
    if wanted.contains(&Want::FrameJacobians) {
        let linear_in = Linearisation::new(g, &sections, &values, &unknowns);
        let name = |value: &str, input: &str| format!("d_{value}_d_{input}");
        let rows =
            linear_in.jacobian(g, &mut writer, name, |section| format!("Jacobians of frames: {section}"));
        let (mut pattern, mut entries) = (Vec::new(), Vec::new());
        for (i, row) in rows.iter().enumerate() {
            for (j, e) in row.iter().enumerate().filter(|(_, e)| **e != g.zero()) {
                pattern.push((i, j));
                entries.push((name(&twists[i].0, &linear.unknowns[j]), *e));
            }
        }
        let want = Want::FrameJacobians;
        let doc = "entries of the Jacobians of the frames that do not vanish identically, row by row";
        found.outputs.push(Output::group(want, entries, doc));
        found.matrices.push(Matrix {
            name: want.name(),
            shape: (values.len(), unknowns.len()),
            pattern,
            is_antisymmetric: false,
            doc: "derivatives of the twists of the frames by the velocities of the state: six rows for each frame, those of \
                  its angular velocity first, in its own axes",
        });
    }
    if wanted.contains(&Want::FrameDrifts) {
        let moving = state.iter().filter(|s| !unknowns.contains(&s.symbol));
        let (mut by, mut direction): (Vec<SymbolId>, Vec<ExprId>) =
            moving.map(|s| (s.symbol, s.derivative)).unzip();
        by.push(equations.system.time);
        direction.push(g.one());
        let along = Linearisation::new(g, &sections, &values, &by);
        let name = |value: &str, _: usize| format!("drift_{value}");
        let title = |section: &str| format!("drifts of frames: {section}");
        let rows = along.forward(g, &mut writer, &[direction], name, title);
        let drifts = rows.into_iter().flatten();
        let components =
            twists.iter().zip(drifts).map(|((name, _), e)| (format!("drift_{name}"), e)).collect();
        let doc = "rates of the twists of the frames at zero accelerations, `J' u`, in their own axes";
        found.outputs.push(Output::group(Want::FrameDrifts, components, doc));
    }
    found.sections = writer.finish().0;
    Ok(found)
}

/// Names of the frames of the model.
pub(super) fn names(equations: &Equations) -> Vec<String> {
    let is_twist = |o: &&Output| o.kind == OutputKind::Group(Want::FrameTwists);
    let twists = equations.outputs.iter().filter(is_twist).flat_map(|o| &o.components);
    twists.filter_map(|(name, _)| Some(name.strip_suffix("_w1")?.to_owned())).collect()
}

/// Whether poses among some outputs contain coordinates of the group, and the state has none.
pub(super) fn needs_group(equations: &Equations, outputs: &[Output], reconstructs: bool) -> bool {
    let group: BTreeSet<SymbolId> = equations.reconstruction.iter().map(|c| c.symbol).collect();
    let is_pose = |o: &&Output| o.kind == OutputKind::Group(Want::FramePoses);
    let mut components = outputs.iter().filter(is_pose).flat_map(|o| &o.components);
    !reconstructs && components.any(|(_, e)| needs(&equations.system.graph, equations, *e, &group))
}
