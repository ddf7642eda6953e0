//! Named frames beside the model: twists are the derivatives of poses along the motion, Jacobians and drifts the
//! derivatives of twists; and forces at rest.
//!
//! Does not know: how twists are composed or differentiated.

use hamel_runtime::{Dual, Real};

use hamel_expr::{ExprId, SymbolId};
use hamel_lang::spec::{OutputPart, ReconstructionKind, Want};
use hamel_mechanics::mechanics::{Output, OutputKind};

use super::group;
use super::motion::{Motion, constants};
use super::random::Random;
use super::results::{Open, Results};
use super::sheet::Sheet;
use super::tape::{Env, Tape};
use super::wide::Wide;

/// Numbers of a pose: the place, then the rotation by rows; and of a twist: angular velocity, then velocity.
const POSE: usize = 12;
const TWIST: usize = 6;

impl Results<'_, '_> {
    pub(super) fn of_frames(&self, part: OutputPart) -> Vec<ExprId> {
        let outputs = self.setting.definition.model.outputs.iter().filter(|o| o.part == part);
        outputs.flat_map(|o| o.components.iter().map(|(_, e)| *e)).collect()
    }

    /// `R^T R = 1`, `hat(w) = R^T R'` and `v = R^T p'` along the motion, of the poses that the model defines.
    pub(super) fn twists(
        &self,
        output: &Output,
        found: &[Wide],
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Result<(), Open> {
        if output.kind == OutputKind::Component {
            return Ok(());
        }
        let env = self.moving_group(random)?;
        let graph = &self.setting.definition.model.graph;
        let poses = Tape::new(graph, &self.of_frames(OutputPart::Poses)).eval(&env)?.roots;
        let names = output.components.chunks(TWIST);
        for ((pose, twist), names) in poses.chunks(POSE).zip(found.chunks(TWIST)).zip(names) {
            let (place, rotation) = pose.split_at(3);
            let entry = |i: usize, j: usize| rotation[3 * i + j];
            for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
                let mut terms: Vec<Wide> = (0..3).map(|k| entry(k, i).value * entry(k, j).value).collect();
                terms.extend((i == j).then_some(-Wide::ONE));
                sheet.zero(&output.name, format!("the rotation of {}", names[0].0), &terms);
            }
            for (k, (found, (name, _))) in twist.iter().zip(names).enumerate() {
                let mut terms: Vec<Wide> = match k {
                    0..3 => {
                        let (i, j) = ((k + 2) % 3, (k + 1) % 3);
                        (0..3).map(|l| entry(l, i).value * entry(l, j).derivative).collect()
                    }
                    _ => (0..3).map(|l| entry(l, k - 3).value * place[l].derivative).collect(),
                };
                terms.push(-*found);
                sheet.zero(&output.name, format!("{name} by the rate of the pose"), &terms);
            }
        }
        Ok(())
    }

    /// The symbols of the model along the motion, with an element of the group where the state has none.
    pub(super) fn moving_group(&self, random: &mut Random) -> Result<Env<Dual<Wide>>, Open> {
        let model = self.setting.definition.model;
        let mut env = self.motion.moving.env.clone();
        for item in &model.reconstruction {
            if item.symbols.iter().all(|symbol| self.setting.state.contains(symbol)) {
                continue;
            }
            let number = |list: &[ExprId]| -> Result<Vec<Wide>, Open> {
                Ok(Tape::new(&model.graph, list).eval(&self.motion.at.env)?.roots)
            };
            let values = random.vector(item.symbols.len());
            let moving = match &item.kind {
                ReconstructionKind::Angle { omega } => along(&values, &number(&[*omega])?),
                ReconstructionKind::Translation { v } => along(&values, &number(v)?),
                ReconstructionKind::PlanarPose { omega, v } => {
                    let xi = number(&[*omega, v[0], v[1]])?;
                    let (s, c) = values[0].sin_cos();
                    along(&values, &[xi[0], c * xi[1] - s * xi[2], s * xi[1] + c * xi[2]])
                }
                ReconstructionKind::Quaternion { omega } => attitude(&values, &number(omega)?),
                ReconstructionKind::Pose { omega, v } => {
                    let mut moving = attitude(&values[..4], &number(omega)?);
                    let q: Vec<Wide> = moving.iter().map(|q| q.value).collect();
                    moving.extend(along(&values[4..], &group::rotated(&group::rotation(&q), &number(v)?)));
                    moving
                }
                // No frame contains the coordinates of another group.
                ReconstructionKind::Rate { .. } | ReconstructionKind::Matrix { .. } => constants(&values),
            };
            env.set_all(&item.symbols, &moving);
        }
        Ok(env)
    }

    /// Derivatives of the twists that the model defines, along changes of symbols.
    pub(super) fn slopes_of_twists(&self, changes: &[(SymbolId, Wide)]) -> Result<Vec<Wide>, Open> {
        let seeded = self.setting.seeded(&self.point.env, changes);
        let place = self.setting.place(&seeded)?;
        self.rates_of_twists(&place.env)
    }

    fn rates_of_twists(&self, env: &Env<Dual<Wide>>) -> Result<Vec<Wide>, Open> {
        let graph = &self.setting.definition.model.graph;
        let twists = Tape::new(graph, &self.of_frames(OutputPart::Twists)).eval(env)?.roots;
        Ok(twists.into_iter().map(|twist| twist.derivative).collect())
    }

    /// The rates of the twists of the model in a motion without accelerations.
    pub(super) fn drifts(&self, output: &Output, found: &[Wide], sheet: &mut Sheet) -> Result<(), Open> {
        if output.kind == OutputKind::Component {
            return Err(Open::Because("a part of the drifts, which are compared as a whole"));
        }
        let none = vec![Wide::ZERO; self.setting.claim.equations.system.unknowns.len()];
        let motion = Motion::with_rates(self.setting, self.point, self.rates_with(&none)?)?;
        for (k, (defined, found)) in self.rates_of_twists(&motion.moving.env)?.iter().zip(found).enumerate() {
            sheet.equal(&output.name, output.components[k].0.clone(), *found, *defined);
        }
        Ok(())
    }

    /// The equation of motion at zero accelerations, and at zero velocities as well for `gravity`.
    pub(super) fn forces_at_rest(&self, want: Want, found: &[Wide], sheet: &mut Sheet) -> Result<(), Open> {
        let unknowns = &self.setting.claim.equations.system.unknowns;
        let none = vec![Wide::ZERO; unknowns.len()];
        let forces = match want {
            Want::Gravity => {
                let mut point = self.point.clone();
                unknowns.iter().for_each(|unknown| point.env.set(unknown.symbol, Wide::ZERO));
                let motion = Motion::new(self.setting, &point)?;
                Results { setting: self.setting, point: &point, motion: &motion }.forces(&none)?
            }
            _ => self.forces(&none)?,
        };
        for (k, (terms, found)) in forces.iter().zip(found).enumerate() {
            let terms: Vec<Wide> = terms.iter().copied().chain([-*found]).collect();
            sheet.zero(want.name(), format!("row {}", k + 1), &terms);
        }
        Ok(())
    }
}

fn along(values: &[Wide], rates: &[Wide]) -> Vec<Dual<Wide>> {
    values.iter().zip(rates).map(|(x, rate)| Dual::new(*x, *rate)).collect()
}

/// A unit quaternion that turns with an angular velocity in the turned axes, `q' = q (0, w)/2`.
fn attitude(values: &[Wide], omega: &[Wide]) -> Vec<Dual<Wide>> {
    let square = values.iter().fold(Wide::ZERO, |sum, x| sum + *x * *x);
    let q: Vec<Wide> = values.iter().map(|x| *x / square.sqrt()).collect();
    let half = Wide::exact(0.5);
    let [a, b, c] = [omega[0], omega[1], omega[2]];
    let rates = [
        -(q[1] * a + q[2] * b + q[3] * c),
        q[0] * a + q[2] * c - q[3] * b,
        q[0] * b + q[3] * a - q[1] * c,
        q[0] * c + q[1] * b - q[2] * a,
    ];
    along(&q, &rates.map(|rate| half * rate))
}
