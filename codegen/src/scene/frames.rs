//! Functions of named frames and of all bodies: Jacobians and drifts, derivatives of twists and momenta, and what a
//! wrench on a frame does to it.
//!
//! Does not know: how twists and momenta are written, lowered or emitted.

use std::collections::BTreeSet;

use hamel_expr::differentiate::Linearisation;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Section, SectionWriter, Sign, SymbolId, needed_sections, sign_of};
use hamel_lang::spec::{OutputPart, Want};
use hamel_mechanics::mechanics::{Equations, Output, OutputKind, StateEquation};

use super::dependence::needs;
use super::derivatives::Matrix;
use super::dynamics::unbalanced;

/// Numbers of a twist.
const TWIST: usize = 6;

/// Numbers of a body among all of them, and the place of its mass.
const BODY: usize = 22;
const MASS: usize = 3;

/// Functions of frames and bodies, with the definitions that they need.
#[derive(Default)]
pub(super) struct OfFrames {
    pub(super) outputs: Vec<Output>,
    pub(super) matrices: Vec<Matrix>,
    /// To come after the sections of the equations.
    pub(super) sections: Vec<Section>,
}

/// The wanted functions of values `V(t, x, u)` of the model: derivatives by the velocities `u` of the state,
/// `J = dV/du`, along the motion at zero accelerations, `dV/dt + dV/dx xdot`, and `J A^-1 J^T` with the matrix `A` of
/// `A udot = f`.
///
/// # Errors
/// [`Error::Unsupported`] where the state has momenta, the model gives the motion, reactions do work along
/// displacements, or no mass is seen to be there.
pub(super) fn find(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    wanted: &BTreeSet<Want>,
) -> Result<OfFrames, Error> {
    let mut found = OfFrames::default();
    if wanted.iter().any(|want| want.is_of_bodies()) {
        has_mass(equations)?;
    }
    let beyond_outputs = |want: &&Want| ![Want::CenterOfMass, Want::CentroidalMomentum].contains(want);
    let Some(first) = wanted.iter().find(beyond_outputs) else { return Ok(found) };
    if equations.balanced_system().is_none() {
        return Err(unbalanced(equations, *first));
    }
    let writer = SectionWriter::new(g, BTreeSet::new(), &[]);
    let mut pass = Pass {
        g,
        equations,
        unknowns: equations.system.unknowns.iter().map(|unknown| unknown.symbol).collect(),
        writer,
        after: Vec::new(),
    };
    let twists = components(equations, Want::FrameTwists);
    for want in wanted {
        match want {
            Want::FrameJacobians => {
                let rows = pass.jacobian("Jacobians of frames", &twists);
                let doc = "derivatives of the twists of the frames by the velocities of the state: six rows for each frame, \
                           those of its angular velocity first, in its own axes";
                let entries =
                    "entries of the Jacobians of the frames that do not vanish identically, row by row";
                pass.matrix(*want, &twists, &rows, [doc, entries], &mut found);
            }
            Want::FrameDrifts => found.outputs.push(pass.drifts(state, &twists)),
            Want::CenterOfMassJacobian => {
                let velocity = components(equations, Want::CenterOfMass).split_off(3);
                let rows = pass.jacobian("Jacobian of the mass centre", &velocity);
                let doc =
                    "derivatives of the velocity of the mass centre in space by the velocities of the state";
                let entries =
                    "entries of the Jacobian of the mass centre that do not vanish identically, row by row";
                pass.matrix(*want, &velocity, &rows, [doc, entries], &mut found);
            }
            Want::CentroidalMomentumMatrix => {
                let momentum = components(equations, Want::CentroidalMomentum);
                let rows = pass.jacobian("centroidal momentum matrix", &momentum);
                let doc = "derivatives of the momentum of all bodies by the velocities of the state: three rows of the angular \
                           momentum about the mass centre, then three of the linear momentum, in the axes of space";
                let entries =
                    "entries of the centroidal momentum matrix that do not vanish identically, row by row";
                pass.matrix(*want, &momentum, &rows, [doc, entries], &mut found);
            }
            Want::OperationalSpace => pass.operational_space(&twists, &mut found)?,
            _ => {}
        }
    }
    found.sections = [pass.writer.finish().0, pass.after].concat();
    Ok(found)
}

struct Pass<'a> {
    g: &'a mut Graph,
    equations: &'a Equations,
    unknowns: Vec<SymbolId>,
    writer: SectionWriter,
    /// To come after the definitions of `writer`.
    after: Vec<Section>,
}

impl Pass<'_> {
    /// `dV/du`, a row for each value.
    fn jacobian(&mut self, title: &str, of: &[(String, ExprId)]) -> Vec<Vec<ExprId>> {
        let values: Vec<ExprId> = of.iter().map(|(_, e)| *e).collect();
        let sections = needed_sections(self.g, &self.equations.sections, &values);
        let linear_in = Linearisation::new(self.g, &sections, &values, &self.unknowns);
        let name = |value: &str, input: &str| format!("d_{value}_d_{input}");
        linear_in.jacobian(self.g, &mut self.writer, name, |section| format!("{title}: {section}"))
    }

    /// A matrix with a row for each value and a column for each velocity of the state.
    fn matrix(
        &self,
        want: Want,
        of: &[(String, ExprId)],
        rows: &[Vec<ExprId>],
        [doc, of_entries]: [&'static str; 2],
        found: &mut OfFrames,
    ) {
        let names = &self.equations.system.unknowns;
        let (mut pattern, mut entries) = (Vec::new(), Vec::new());
        for (i, row) in rows.iter().enumerate() {
            for (j, e) in row.iter().enumerate().filter(|(_, e)| **e != self.g.zero()) {
                pattern.push((i, j));
                entries.push((format!("d_{}_d_{}", of[i].0, names[j].name), *e));
            }
        }
        found.outputs.push(Output::group(want, entries, of_entries));
        found.matrices.push(Matrix {
            name: want.name(),
            shape: (of.len(), self.unknowns.len()),
            pattern,
            is_antisymmetric: false,
            doc,
        });
    }

    fn drifts(&mut self, state: &[StateEquation], twists: &[(String, ExprId)]) -> Output {
        let values: Vec<ExprId> = twists.iter().map(|(_, e)| *e).collect();
        let sections = needed_sections(self.g, &self.equations.sections, &values);
        let moving = state.iter().filter(|s| !self.unknowns.contains(&s.symbol));
        let (mut by, mut direction): (Vec<SymbolId>, Vec<ExprId>) =
            moving.map(|s| (s.symbol, s.derivative)).unzip();
        by.push(self.equations.system.time);
        direction.push(self.g.one());
        let along = Linearisation::new(self.g, &sections, &values, &by);
        let name = |value: &str, _: usize| format!("drift_{value}");
        let title = |section: &str| format!("drifts of frames: {section}");
        let rows = along.forward(self.g, &mut self.writer, &[direction], name, title);
        let drifts = rows.into_iter().flatten();
        let components =
            twists.iter().zip(drifts).map(|((name, _), e)| (format!("drift_{name}"), e)).collect();
        let doc = "rates of the twists of the frames at zero accelerations, `J' u`, in their own axes";
        Output::group(Want::FrameDrifts, components, doc)
    }

    /// `J A^-1 J^T` of each frame: what a wrench on it adds to the rate of its twist. Where multipliers keep a
    /// constraint, their answer to the wrench is in it.
    ///
    /// # Source
    /// Khatib 1987, A unified approach for motion and force control of robot manipulators, equations 11 and 51.
    fn operational_space(&mut self, twists: &[(String, ExprId)], found: &mut OfFrames) -> Result<(), Error> {
        let want = Want::OperationalSpace;
        let rows = self.jacobian("Jacobians of frames", twists);
        let names: Vec<String> = twists.iter().map(|(name, _)| name.clone()).collect();
        let before = self.writer.clone().finish().0;
        let Some((responses, after)) = self.equations.responses(self.g, (&names, &before), &rows)? else {
            return Err(Error::Unsupported {
                what: format!("{} where reactions do work along virtual displacements", want.name()),
                possible: "constraints without conditions on displacements of their own".into(),
            });
        };
        self.after.extend(after);
        let (mut pattern, mut entries) = (Vec::new(), Vec::new());
        for frame in (0..twists.len()).step_by(TWIST) {
            let mut block = vec![vec![self.g.zero(); TWIST]; TWIST];
            for i in 0..TWIST {
                for j in 0..=i {
                    block[i][j] = self.g.dot(&rows[frame + i], &responses[frame + j]);
                    block[j][i] = block[i][j];
                }
            }
            for (i, row) in block.into_iter().enumerate() {
                for (j, e) in row.into_iter().enumerate().filter(|(_, e)| *e != self.g.zero()) {
                    pattern.push((frame + i, j));
                    entries.push((format!("response_{}_{}", twists[frame + i].0, twists[frame + j].0), e));
                }
            }
        }
        let doc = "inverses of the inertias at the frames, `J A^-1 J^T`: six rows for each frame, what a moment and a force \
                   on it, in its own axes, add to the rate of its twist";
        let of_entries =
            "entries of the inverse inertias at the frames that do not vanish identically, row by row";
        found.outputs.push(Output::group(want, entries, of_entries));
        let shape = (twists.len(), TWIST);
        found.matrices.push(Matrix { name: want.name(), shape, pattern, is_antisymmetric: false, doc });
        Ok(())
    }
}

/// Names and values of an output of the model.
fn components(equations: &Equations, want: Want) -> Vec<(String, ExprId)> {
    let is_it = |o: &&Output| o.kind == OutputKind::Group(want);
    equations.outputs.iter().find(is_it).map(|o| o.components.clone()).unwrap_or_default()
}

/// Everything about the mass centre is divided by the mass of all bodies.
fn has_mass(equations: &Equations) -> Result<(), Error> {
    let system = &equations.system;
    let bodies = system.outputs.iter().filter(|o| o.part == OutputPart::Bodies).flat_map(|o| &o.components);
    let masses: Vec<ExprId> = bodies.skip(MASS).step_by(BODY).map(|(_, e)| *e).collect();
    let mut g = system.graph.clone();
    let mass = g.sum(&masses);
    if sign_of(&g, mass, &system.signs) == Sign::Positive {
        return Ok(());
    }
    Err(Error::Unsupported {
        what: "the mass centre of bodies whose mass is not seen to be positive".into(),
        possible: "masses that are, such as `param m = 2 where m > 0;`".into(),
    })
}

/// Names of the frames of the model.
pub(super) fn names(equations: &Equations) -> Vec<String> {
    let is_twist = |o: &&Output| o.kind == OutputKind::Group(Want::FrameTwists);
    let twists = equations.outputs.iter().filter(is_twist).flat_map(|o| &o.components);
    twists.filter_map(|(name, _)| Some(name.strip_suffix("_w1")?.to_owned())).collect()
}

/// A wanted function of frames or bodies that the model lacks, the reason, and the fix.
pub(super) fn missing<'w>(
    available: &[Output],
    wanted: &'w BTreeSet<Want>,
) -> Option<(&'w Want, &'static str, &'static str)> {
    let has = |want: Want| available.iter().any(|o| o.kind == OutputKind::Group(want));
    wanted.iter().find_map(|want| match want.is_of_bodies() {
        true if !has(Want::CenterOfMass) => {
            Some((want, "no body with a mass", "declare one, such as `body B { mass m; place p; }`"))
        }
        false if !has(Want::FrameTwists) => {
            Some((want, "no named frame", "declare one, such as `frame tool at p attitude R;`"))
        }
        _ => None,
    })
}

/// Whether scenes have an output only where they ask for it.
pub(super) fn is_asked_for(output: &Output) -> bool {
    let wants = [Want::FramePoses, Want::FrameTwists, Want::CenterOfMass, Want::CentroidalMomentum];
    wants.into_iter().any(|want| output.kind == OutputKind::Group(want))
}

/// What some outputs are that contain coordinates of the group where the state has none, and the fix.
pub(super) fn needs_group(
    equations: &Equations,
    outputs: &[Output],
    wanted: &BTreeSet<Want>,
) -> Option<(Want, &'static str)> {
    let group: BTreeSet<SymbolId> = equations.reconstruction.iter().map(|c| c.symbol).collect();
    let is_there = |want: Want| outputs.iter().any(|o| o.kind == OutputKind::Group(want));
    let contains_group = |want: Want| {
        let components = components(equations, want);
        components.iter().any(|(_, e)| needs(&equations.system.graph, equations, *e, &group))
    };
    if is_there(Want::FramePoses) && contains_group(Want::FramePoses) {
        let help =
            "add `want reconstruction;`, or want `frame_twists`, `frame_jacobians` and `frame_drifts` alone";
        return Some((Want::FramePoses, help));
    }
    let of_bodies = wanted.iter().filter(|want| want.is_of_bodies());
    let want = of_bodies.copied().find(|want| match want {
        Want::CenterOfMass | Want::CenterOfMassJacobian => contains_group(Want::CenterOfMass),
        _ => contains_group(Want::CentroidalMomentum),
    })?;
    Some((want, "add `want reconstruction;`: it is in the axes of space"))
}
