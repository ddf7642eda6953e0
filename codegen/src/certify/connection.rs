//! A connection and its curvature beside constraints, kinetic energy and bracket of the model.
//!
//! Horizontal vectors `(xdot, -A xdot)` satisfy the constraints and are orthogonal to vertical vectors that satisfy
//! them; the curvature is `dA - [A, A]`, with the derivatives of the function that has been held so. Does not know:
//! how a connection was derived.
//!
//! # Source
//! Bloch, Krishnaprasad, Marsden, Murray 1996, sections 2 and 6.

use hamel_runtime::{Dual, Real};

use hamel_lang::spec::ConnectionKind;
use hamel_mechanics::mechanics::{Output, OutputKind};
use hamel_program::program::Role;

use super::definition::{Missing, Place};
use super::linear::Reduced;
use super::motion::constants;
use super::random::Random;
use super::results::{Open, Outcome, Results};
use super::runner::At;
use super::sheet::Sheet;
use super::tape::Tape;
use super::wide::Wide;

/// Coefficients below this part of the others are zero.
const NOTHING: f64 = 1e-20;

fn dot(a: &[Wide], b: &[Wide]) -> Wide {
    a.iter().zip(b).fold(Wide::ZERO, |sum, (a, b)| sum + *a * *b)
}

fn size(v: &[Wide]) -> f64 {
    v.iter().map(|x| x.size()).fold(0.0, f64::max)
}

/// The values of a function `connection`: `A` by rows, then `B` by pairs.
struct Found<'f> {
    n: usize,
    dim: usize,
    coefficients: &'f [Wide],
    curvature: &'f [Wide],
}

impl Found<'_> {
    /// `(xdot, -A xdot)`.
    fn horizontal(&self, along: &[Wide]) -> Vec<Wide> {
        let vertical = self.coefficients.chunks(self.n).map(|row| -dot(row, along));
        along.iter().copied().chain(vertical).collect()
    }
}

impl Results<'_, '_> {
    pub(super) fn connection(
        &self,
        output: &Output,
        found: &[Wide],
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Outcome {
        if output.kind == OutputKind::Component {
            return Err(Open::Because("a connection is held as a whole, and the scene has one component"));
        }
        let definition = &self.setting.definition;
        let n = definition.n_shape;
        let dim = definition.m - n;
        if found.len() != n * dim + dim * n * (n - 1) / 2 {
            return Err(Open::Because("a coordinate of the model is a state of first order"));
        }
        let (coefficients, curvature) = found.split_at(n * dim);
        let found = Found { n, dim, coefficients, curvature };
        let function = output.name.as_str();
        match self.setting.claim.equations.system.formulation.connection {
            None | Some(ConnectionKind::Trivial) => self.as_written(function, &found, sheet)?,
            Some(ConnectionKind::Mechanical) => {
                let along = found.horizontal(&random.vector(n));
                self.orthogonal(function, (&along, &random.vector(dim)), sheet)?;
            }
            Some(ConnectionKind::Nonholonomic) => self.nonholonomic(function, &found, sheet, random)?,
        }
        self.curvature(function, &found, sheet)
    }

    /// What the model gives, or nothing.
    fn as_written(&self, function: &str, found: &Found<'_>, sheet: &mut Sheet) -> Outcome {
        let model = self.setting.definition.model;
        let is_trivial = self.setting.claim.equations.system.formulation.connection.is_some();
        let defined = match model.connection.as_ref().filter(|_| !is_trivial) {
            Some(rows) => {
                let roots: Vec<_> = rows.iter().flatten().copied().collect();
                Tape::new(&model.graph, &roots).eval(&self.motion.at.env)?.roots
            }
            None => vec![Wide::ZERO; found.coefficients.len()],
        };
        for (found, defined) in found.coefficients.iter().zip(defined) {
            sheet.equal(function, "a coefficient of the connection", *found, defined);
        }
        Ok(())
    }

    /// `L''(h, v) = 0` for a vector `h` and a vertical one.
    fn orthogonal(&self, function: &str, (h, vertical): (&[Wide], &[Wide]), sheet: &mut Sheet) -> Outcome {
        let definition = &self.setting.definition;
        let at = &self.motion.at;
        let still = vec![Wide::ZERO; h.len() - vertical.len()];
        let vertical: Vec<Wide> = still.into_iter().chain(vertical.iter().copied()).collect();
        let env = at.env.map(Dual::constant);
        let group: Vec<Dual<Wide>> = at.group.iter().zip(h).map(|(y, h)| Dual::new(*y, *h)).collect();
        let of_model = definition.model_velocities(&env, &group)?;
        let shifted = Place { env, of_system: constants(&at.of_system), group, of_model };
        let along = |w: &[Wide]| definition.lagrangian(&shifted, &constants(w), &Vec::new());
        let paired = along(&vertical)?.derivative.derivative;
        let terms = along(h)?.derivative.derivative.size();
        sheet.vanishes(function, "horizontal vectors are orthogonal to vertical ones", paired, terms);
        Ok(())
    }

    /// The forms that vanish on displacements, by vectors `(xdot, xi)`.
    fn forms(&self) -> Result<Vec<(String, Vec<Wide>)>, Missing> {
        let definition = &self.setting.definition;
        let at = &self.motion.at;
        let unit = |k: usize| -> Vec<Wide> {
            (0..definition.m).map(|j| if j == k { Wide::ONE } else { Wide::ZERO }).collect()
        };
        // One-forms are along velocities of the system: `xdot` and `xi` plus its connection times `xdot`.
        let own = definition.one_forms(at)?;
        let mut columns = Vec::new();
        for k in 0..definition.m {
            columns.push(definition.group_velocities(&at.env, &unit(k))?);
        }
        let n = definition.n_shape;
        let mut forms = Vec::new();
        for (name, form) in own {
            let mut lowered = form[..definition.m].to_vec();
            for i in 0..n {
                // `e_i` of the system is `(e_i, -A_i)`.
                let along = dot(&columns[i][n..], &form[n..definition.m]);
                lowered[i] = form[i] - along;
            }
            forms.push((name, lowered));
        }
        Ok(forms)
    }

    fn nonholonomic(
        &self,
        function: &str,
        found: &Found<'_>,
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Outcome {
        let (n, dim) = (found.n, found.dim);
        let forms = self.forms()?;
        let with_zero = |form: &[Wide]| form.iter().copied().chain([Wide::ZERO]).collect::<Vec<Wide>>();
        let is_along = |form: &[Wide]| size(&form[n..]) > NOTHING * size(form);
        let of_group: Vec<&(String, Vec<Wide>)> = forms.iter().filter(|(_, form)| is_along(form)).collect();
        let vertical =
            Reduced::new(of_group.iter().map(|(_, form)| with_zero(&form[n..])).collect::<Vec<_>>(), dim);
        let all = Reduced::new(forms.iter().map(|(_, form)| with_zero(form)).collect(), n + dim);
        // Where the constraints say what the group does, those that are about it; where they leave the base free, all.
        let mut along = all.solution(&random.vector(n + dim))[..n].to_vec();
        let is_determined = vertical.rank() == dim && of_group.len() == dim;
        let is_fixed = size(&along) < NOTHING;
        if is_determined || is_fixed {
            along = random.vector(n);
        }
        let h = found.horizontal(&along);
        if is_determined || !is_fixed {
            for (name, form) in of_group {
                let terms: Vec<Wide> = form.iter().zip(&h).map(|(w, h)| *w * *h).collect();
                sheet.zero(function, format!("horizontal vectors satisfy the constraint {name}"), &terms);
            }
        }
        if vertical.rank() < dim {
            // A base that constraints move alone lifts orthogonally to the whole group.
            let free = random.vector(dim);
            let own = if is_fixed { free } else { vertical.solution(&free) };
            self.orthogonal(function, (&h, &own), sheet)?;
        }
        Ok(())
    }

    /// `d_i A_j - d_j A_i - [A_i, A_j]`, by derivatives of the function itself.
    fn curvature(&self, function: &str, found: &Found<'_>, sheet: &mut Sheet) -> Outcome {
        let Found { n, dim, coefficients, curvature } = *found;
        let definition = &self.setting.definition;
        let Some(k) = self.setting.claim.program.function_idx(&Role::Output(function.to_owned())) else {
            return Ok(());
        };
        let (params, slots) = (constants(&self.point.params), constants(&self.point.slots));
        let (inputs, t) = (constants(&self.point.inputs), Dual::constant(self.point.t));
        let mut slopes = Vec::new();
        for coordinate in &definition.model.base[..n] {
            let seeded = self.setting.seeded(&self.point.env, &[(coordinate.symbol, Wide::ONE)]);
            let state: Result<Vec<Dual<Wide>>, Missing> =
                self.setting.state.iter().map(|s| seeded.get(*s).ok_or(*s)).collect();
            let at = At { params: &params, slots: &slots, inputs: &inputs, t, state: &state? };
            slopes.push(self.setting.runner.call(k, &at, &[]));
        }
        let column = |i: usize| -> Vec<Wide> {
            let own = coefficients.chunks(n).map(|row| row[i]);
            std::iter::repeat_n(Wide::ZERO, n).chain(own).collect()
        };
        let mut values = curvature.iter();
        for i in 0..n {
            for j in i + 1..n {
                let bracket = definition.bracket(&self.motion.at.env, &column(i), &column(j))?;
                for a in 0..dim {
                    let Some(found) = values.next() else { return Ok(()) };
                    let [forward, backward] = [slopes[i][a * n + j], slopes[j][a * n + i]];
                    let terms = [*found, -forward.derivative, backward.derivative, bracket[n + a]];
                    sheet.zero(function, "the curvature dA - [A, A]", &terms);
                }
            }
        }
        Ok(())
    }
}
