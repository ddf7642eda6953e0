//! All bodies together beside their places, rotations, masses and inertias, and what a wrench on a frame does.
//!
//! Velocities are derivatives of places and rotations along a motion; a row of a Jacobian is the difference of two
//! motions, as momenta are affine in velocities. The inertia that answers a wrench is the second derivative of the
//! Lagrangian.
//! Does not know: how mass centre, momenta and their Jacobians are written, how a mass matrix is factored.
//!
//! # Source
//! Goldstein 1980, Classical Mechanics, sections 1.2 and 5.1; Khatib 1987, equation 11.

use hamel_runtime::{Dual, Real};

use hamel_expr::SymbolId;
use hamel_lang::spec::{OutputPart, Want};
use hamel_mechanics::mechanics::{Output, OutputKind};
use hamel_mechanics::reduction::KinematicConstraint;

use super::claim::MatrixClaim;
use super::definition::Place;
use super::linear::Reduced;
use super::motion::{Motion, constants};
use super::random::Random;
use super::results::{Open, Results};
use super::sheet::Sheet;
use super::tape::Tape;
use super::wide::Wide;

/// Numbers of a body: place, mass, rotation by rows, inertia by rows.
const BODY: usize = 22;
const TWIST: usize = 6;

type D = Dual<Wide>;

/// Place and velocity of the mass centre, angular momentum about it and linear momentum.
struct Centroid {
    centre: Vec<Wide>,
    momentum: Vec<Wide>,
}

impl Results<'_, '_> {
    /// The bodies along the motion: `l = (sum m p)'`, and about the origin `L = sum p x m p' + S w` with the inertia
    /// `S = R I R^T` and `hat(w) = R' R^T`, so that it is `L - c x l` about the mass centre.
    fn centroid(&self, random: &mut Random) -> Result<Centroid, Open> {
        let env = self.moving_group(random)?;
        let graph = &self.setting.definition.model.graph;
        let bodies = Tape::new(graph, &self.of_frames(OutputPart::Bodies)).eval(&env)?.roots;
        let mut mass = D::ZERO;
        let mut moment = [D::ZERO; 3];
        let mut about_origin = [Wide::ZERO; 3];
        for body in bodies.chunks(BODY) {
            let (p, m, r, inertia) = (&body[..3], body[3], &body[4..13], &body[13..]);
            mass += m;
            (0..3).for_each(|k| moment[k] += m * p[k]);
            let across = |i: usize, j: usize| {
                (0..3).fold(Wide::ZERO, |sum, k| sum + r[3 * i + k].derivative * r[3 * j + k].value)
            };
            let spin = [across(2, 1), across(0, 2), across(1, 0)];
            for (k, sum) in about_origin.iter_mut().enumerate() {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                *sum += m.value * (p[i].value * p[j].derivative - p[j].value * p[i].derivative);
                for (l, spin) in spin.iter().enumerate() {
                    for a in 0..3 {
                        for b in 0..3 {
                            let turned = r[3 * k + a].value * inertia[3 * a + b].value * r[3 * l + b].value;
                            *sum += turned * *spin;
                        }
                    }
                }
            }
        }
        let c = moment.map(|moment| moment / mass);
        let l = moment.map(|moment| moment.derivative);
        let k = [0, 1, 2].map(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            about_origin[k] - (c[i].value * l[j] - c[j].value * l[i])
        });
        let centre = c.iter().map(|c| c.value).chain(c.iter().map(|c| c.derivative)).collect();
        Ok(Centroid { centre, momentum: k.into_iter().chain(l).collect() })
    }

    /// Mass centre or momentum of all bodies.
    pub(super) fn of_bodies(
        &self,
        want: Want,
        output: &Output,
        found: &[Wide],
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Result<(), Open> {
        if output.kind == OutputKind::Component {
            return Err(Open::Because(
                "a part of the mass centre or momentum, which are compared as a whole",
            ));
        }
        let centroid = self.centroid(random)?;
        let defined = if want == Want::CenterOfMass { centroid.centre } else { centroid.momentum };
        for (((name, _), found), defined) in output.components.iter().zip(found).zip(defined) {
            sheet.equal(&output.name, format!("{name} of the bodies"), *found, defined);
        }
        Ok(())
    }

    /// What a change of the velocities of the state adds to the velocity of the mass centre, or to the momentum.
    pub(super) fn centroid_by(
        &self,
        want: Want,
        changes: &[(SymbolId, Wide)],
        random: &mut Random,
    ) -> Result<Vec<Wide>, Open> {
        let mut point = self.point.clone();
        for (symbol, change) in changes {
            let own = point.env.get(*symbol).ok_or(*symbol)?;
            point.env.set(*symbol, own + *change);
        }
        let motion = Motion::new(self.setting, &point)?;
        let after = Results { setting: self.setting, point: &point, motion: &motion }.centroid(random)?;
        let before = self.centroid(random)?;
        let of = |centroid: Centroid| match want {
            Want::CenterOfMassJacobian => centroid.centre[3..].to_vec(),
            _ => centroid.momentum,
        };
        Ok(of(after).into_iter().zip(of(before)).map(|(after, before)| after - before).collect())
    }

    /// `J x` of the rates `x` that a random wrench on each frame adds: `M x - C^T mu = J^T F`, `C x = 0` with
    /// `M = d^2 L/dy dy` along the velocities of the state, and the one-forms `C` that multipliers act along.
    pub(super) fn operational_space(
        &self,
        matrix: &MatrixClaim<'_>,
        entries: &[Wide],
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Result<(), Open> {
        let unknowns = &self.setting.claim.equations.system.unknowns;
        let n = unknowns.len();
        let mut columns = Vec::with_capacity(n);
        for unknown in unknowns {
            columns.push(self.slopes_of_twists(&[(unknown.symbol, Wide::ONE)])?);
        }
        let (inertia, forms) = (self.inertia()?, self.forms_of_multipliers()?);
        for (k, frame) in (0..matrix.shape.0).step_by(TWIST).enumerate() {
            let wrench = random.vector(TWIST);
            let mut answer = [Wide::ZERO; TWIST];
            let own = matrix.pattern.iter().zip(entries).filter(|((i, _), _)| i / TWIST == k);
            for ((i, j), e) in own {
                answer[i - frame] += *e * wrench[*j];
            }
            let force = columns
                .iter()
                .map(|column| (0..TWIST).fold(Wide::ZERO, |sum, i| sum + column[frame + i] * wrench[i]));
            let mut rows: Vec<Vec<Wide>> = Vec::new();
            for (i, force) in force.enumerate() {
                let mut row = inertia[i].clone();
                row.extend(forms.iter().map(|form| -form[i]));
                row.push(force);
                rows.push(row);
            }
            for form in &forms {
                let mut row = form.clone();
                row.resize(n + forms.len() + 1, Wide::ZERO);
                rows.push(row);
            }
            let width = n + forms.len();
            let rates = Reduced::new(rows, width).solution(&vec![Wide::ZERO; width]);
            for (i, found) in answer.iter().enumerate() {
                let terms = columns.iter().zip(&rates).map(|(column, x)| column[frame + i] * *x);
                let terms: Vec<Wide> = terms.chain([-*found]).collect();
                sheet.zero(matrix.name, format!("row {}", frame + i + 1), &terms);
            }
        }
        Ok(())
    }

    /// The displacement of each velocity of the state, in the frame of the group.
    pub(super) fn displacements(&self, motion: &Motion) -> Result<Vec<Vec<Wide>>, Open> {
        let definition = &self.setting.definition;
        let mut found = Vec::new();
        for k in 0..self.setting.claim.equations.system.unknowns.len() {
            let w = Motion::displacement_of(self.setting, &motion.at, k)?;
            found.push(definition.group_velocities(&motion.at.env, &w[..definition.m])?);
        }
        Ok(found)
    }

    /// `d^2 L/dy dy` along the velocities of the state.
    fn inertia(&self) -> Result<Vec<Vec<Wide>>, Open> {
        let definition = &self.setting.definition;
        let displacements = self.displacements(self.motion)?;
        let mut rows = Vec::new();
        for one in &displacements {
            let at = &self.motion.at;
            let group: Vec<D> = at.group.iter().zip(one).map(|(y, d)| Dual::new(*y, *d)).collect();
            let env = at.env.map(Dual::constant);
            let of_model = definition.model_velocities(&env, &group)?;
            let shifted = Place { env, of_system: constants(&at.of_system), group, of_model };
            let mut row = Vec::new();
            for other in &displacements {
                let along = definition.lagrangian(&shifted, &constants(other), &Vec::new())?;
                row.push(along.derivative.derivative);
            }
            rows.push(row);
        }
        Ok(rows)
    }

    /// The one-forms of reactions along the velocities of the state, where multipliers keep constraints.
    fn forms_of_multipliers(&self) -> Result<Vec<Vec<Wide>>, Open> {
        let setting = self.setting;
        if !matches!(setting.claim.equations.system.constraint, KinematicConstraint::Multipliers { .. }) {
            return Ok(Vec::new());
        }
        let forms = setting.definition.one_forms(&self.motion.at)?;
        let n = setting.claim.equations.system.unknowns.len();
        let mut displacements = Vec::new();
        for k in 0..n {
            displacements.push(Motion::displacement_of(setting, &self.motion.at, k)?);
        }
        let along = |form: &[Wide]| -> Vec<Wide> {
            let dot = |w: &Vec<Wide>| form.iter().zip(w).fold(Wide::ZERO, |sum, (a, b)| sum + *a * *b);
            displacements.iter().map(dot).collect()
        };
        Ok(forms.iter().map(|(_, form)| along(form)).collect())
    }
}
