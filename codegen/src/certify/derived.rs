//! Functions that are made of the rates: derivatives, gradients, brackets, exact flows, implicit forms, momenta by
//! velocities, Taylor coefficients, rates with angles on circles.
//!
//! Derivatives are those of the program's own rates, by dual numbers, along random directions, which see every column.
//! Does not know: models, but for what outputs are.

use hamel_runtime::{Dual, Real};

use hamel_expr::SymbolId;
use hamel_lang::spec::Want;
use hamel_program::program::{Circles, Jet, Role};

use super::claim::MatrixClaim;
use super::lyapunov;
use super::motion::{Motion, constants};
use super::random::Random;
use super::results::{Open, Results};
use super::runner::{At, Runner};
use super::sheet::Sheet;
use super::tape::Tape;
use super::wide::Wide;

type D = Dual<Wide>;

/// A change of everything that a function depends on.
struct Direction {
    state: Vec<Wide>,
    params: Vec<Wide>,
    inputs: Vec<Wide>,
    t: Wide,
}

fn dot(a: &[Wide], b: &[Wide]) -> Wide {
    a.iter().zip(b).fold(Wide::ZERO, |sum, (a, b)| sum + *a * *b)
}

fn total(terms: &[Wide]) -> Wide {
    terms.iter().fold(Wide::ZERO, |sum, term| sum + *term)
}

fn along(x: &[Wide], d: &[Wide]) -> Vec<D> {
    x.iter().zip(d).map(|(x, d)| Dual::new(*x, *d)).collect()
}

impl Results<'_, '_> {
    fn still(&self) -> Direction {
        let zeros = |n: usize| vec![Wide::ZERO; n];
        Direction {
            state: zeros(self.motion.state.len()),
            params: zeros(self.point.params.len()),
            inputs: zeros(self.point.inputs.len()),
            t: Wide::ZERO,
        }
    }

    /// The derivative of a function of the program along a direction.
    fn slope(&self, role: &Role, direction: &Direction) -> Option<Vec<Wide>> {
        let k = self.setting.claim.program.function_idx(role)?;
        let params = along(&self.point.params, &direction.params);
        let slots = match direction.params.iter().all(|d| d.size() == 0.0) {
            true => constants(&self.point.slots),
            false => self.setting.runner.slots(&params),
        };
        let (inputs, state) =
            (along(&self.point.inputs, &direction.inputs), along(&self.motion.state, &direction.state));
        let t = Dual::new(self.point.t, direction.t);
        let at = At { params: &params, slots: &slots, inputs: &inputs, t, state: &state };
        Some(self.setting.runner.call(k, &at, &[]).iter().map(|d| d.derivative).collect())
    }

    /// A function of the program that takes a vector besides.
    fn product(&self, role: &Role, argument: &[Wide]) -> Option<Vec<Wide>> {
        let k = self.setting.claim.program.function_idx(role)?;
        Some(self.setting.runner.call(k, &self.point.at(&self.motion.state), argument))
    }

    pub(super) fn check_derived(
        &self,
        sheet: &mut Sheet,
        random: &mut Random,
        open: &mut dyn FnMut(&str, Open),
    ) {
        for matrix in &self.setting.claim.matrices {
            if let Err(why) = self.matrix(matrix, sheet, random) {
                open(matrix.name, why);
            }
        }
        self.products(sheet, random);
        let time = Role::Output(Want::TimeDerivative.name().to_owned());
        if let Some(found) = self.call(&time) {
            let direction = Direction { t: Wide::ONE, ..self.still() };
            let defined = self.slope(&Role::Rate, &direction).unwrap_or_default();
            rows(time.name(), &found, &defined, sheet);
        }
        if let Err(why) = self.legendre(sheet) {
            open("legendre", why);
        }
        if let Err(why) = self.inverse_dynamics(sheet, random) {
            open(Want::InverseDynamics.name(), why);
        }
        self.flows(sheet, random);
        self.implicit(sheet, random);
        self.series(sheet);
        self.on_circles(sheet);
    }

    /// The entries of a matrix times a random vector.
    fn matrix(&self, matrix: &MatrixClaim<'_>, sheet: &mut Sheet, random: &mut Random) -> Result<(), Open> {
        let Some(entries) = self.call(&Role::Output(matrix.name.to_owned())) else { return Ok(()) };
        if matrix.name == Want::Bracket.name() {
            return self.bracket(matrix, &entries, sheet);
        }
        if matrix.name == Want::OperationalSpace.name() {
            return self.operational_space(matrix, &entries, sheet, random);
        }
        let is_gradient = matrix.name.ends_with("_gradients");
        let mut v = random.vector(matrix.shape.1);
        if is_gradient {
            // What never moves is a parameter of invariants.
            let moving = v.iter_mut().zip(&self.motion.rates);
            moving.filter(|(_, rate)| rate.size() == 0.0).for_each(|(v, _)| *v = Wide::ZERO);
        }
        if matrix.name == "constraint_gradients" {
            // By velocities alone, whose rates may vanish.
            let system = &self.setting.claim.equations.system;
            let is_velocity = |s: &SymbolId| {
                system.unknowns.iter().any(|unknown| unknown.symbol == *s)
                    || system.momenta.iter().any(|momentum| momentum.symbol == Some(*s))
            };
            v = random.vector(matrix.shape.1);
            let others = v.iter_mut().zip(&self.setting.state).filter(|(_, s)| !is_velocity(s));
            others.for_each(|(v, _)| *v = Wide::ZERO);
        }
        let mut found = vec![Wide::ZERO; matrix.shape.0];
        for ((i, j), e) in matrix.pattern.iter().zip(&entries) {
            found[*i] += *e * v[*j];
        }
        let name = |want: Want| want.name() == matrix.name;
        let defined = if name(Want::Jacobian) {
            self.slope(&Role::Rate, &Direction { state: v, ..self.still() })
        } else if name(Want::Sensitivity) {
            self.slope(&Role::Rate, &Direction { params: v, ..self.still() })
        } else if name(Want::InputJacobian) {
            self.slope(&Role::Rate, &Direction { inputs: v, ..self.still() })
        } else if name(Want::MassMatrix) {
            let still = self.forces(&vec![Wide::ZERO; v.len()])?;
            let forces = self.forces(&v)?;
            Some(forces.iter().zip(&still).map(|(a, b)| total(a) - total(b)).collect())
        } else if name(Want::FrameJacobians) {
            let unknowns = self.setting.claim.equations.system.unknowns.iter().map(|unknown| unknown.symbol);
            let changes: Vec<(SymbolId, Wide)> = unknowns.zip(v).collect();
            Some(self.slopes_of_twists(&changes)?)
        } else if name(Want::CenterOfMassJacobian) || name(Want::CentroidalMomentumMatrix) {
            let want = Want::from_name(matrix.name).unwrap_or(Want::CentroidalMomentumMatrix);
            let unknowns = self.setting.claim.equations.system.unknowns.iter().map(|unknown| unknown.symbol);
            let changes: Vec<(SymbolId, Wide)> = unknowns.zip(v).collect();
            Some(self.centroid_by(want, &changes, random)?)
        } else if name(Want::OutputJacobian) {
            let changes: Vec<(SymbolId, Wide)> =
                self.setting.state.iter().copied().zip(v.iter().copied()).collect();
            Some(self.slopes_of_outputs(&changes, &Direction { state: v, ..self.still() })?)
        } else if name(Want::Feedthrough) {
            let inputs = self.setting.claim.equations.system.inputs.iter().map(|input| input.symbol);
            let changes: Vec<(SymbolId, Wide)> = inputs.zip(v.iter().copied()).collect();
            Some(self.slopes_of_outputs(&changes, &Direction { inputs: v, ..self.still() })?)
        } else {
            let values = match matrix.name {
                "invariant_gradients" => Want::Invariants,
                "position_gradients" => Want::Positions,
                "constraint_gradients" => Want::Constraint,
                _ => return Err(Open::Because("a matrix of no known function")),
            };
            self.slope(&Role::Output(values.name().to_owned()), &Direction { state: v, ..self.still() })
        };
        rows(matrix.name, &found, &defined.unwrap_or_default(), sheet);
        Ok(())
    }

    /// What the equations of motion leave over at accelerations, term by term along every velocity of the state.
    pub(super) fn forces(&self, accelerations: &[Wide]) -> Result<Vec<[Wide; 4]>, Open> {
        let setting = self.setting;
        let motion = Motion::with_rates(setting, self.point, self.rates_with(accelerations)?)?;
        let mut forces = Vec::new();
        for w in self.displacements(&motion)? {
            forces.push(motion.unbalanced(setting, &w)?);
        }
        Ok(forces)
    }

    /// The rates of the state with other accelerations.
    pub(super) fn rates_with(&self, accelerations: &[Wide]) -> Result<Vec<Wide>, Open> {
        let setting = self.setting;
        let mut rates = self.motion.rates.clone();
        for (unknown, a) in setting.claim.equations.system.unknowns.iter().zip(accelerations) {
            let place = setting.state.iter().position(|s| *s == unknown.symbol).ok_or(unknown.symbol)?;
            rates[place] = *a;
        }
        Ok(rates)
    }

    /// `tau = W^T (d/dt dL/dy + C y p - rho dL/dx - F)` at random accelerations.
    fn inverse_dynamics(&self, sheet: &mut Sheet, random: &mut Random) -> Result<(), Open> {
        let role = Role::Product(Want::InverseDynamics.name().to_owned());
        if self.setting.claim.program.function_idx(&role).is_none() {
            return Ok(());
        }
        let accelerations = random.vector(self.setting.claim.equations.system.unknowns.len());
        let found = self.product(&role, &accelerations).unwrap_or_default();
        for (k, (terms, found)) in self.forces(&accelerations)?.iter().zip(&found).enumerate() {
            let terms: Vec<Wide> = terms.iter().copied().chain([-*found]).collect();
            sheet.zero(role.name(), format!("row {}", k + 1), &terms);
        }
        Ok(())
    }

    /// Derivatives of the outputs of the model, as it defines them.
    fn slopes_of_outputs(
        &self,
        changes: &[(SymbolId, Wide)],
        direction: &Direction,
    ) -> Result<Vec<Wide>, Open> {
        let model = self.setting.definition.model;
        let seeded = self.setting.seeded(&self.point.env, changes);
        let mut place = self.setting.place(&seeded)?;
        if let Some(own) = &model.lyapunov {
            let slope = self.slope(&Role::Rate, direction).unwrap_or_default();
            let force = lyapunov::force(self.setting, &seeded, &along(&self.motion.rates, &slope))?;
            let symbol = model.multipliers.iter().find(|(name, _)| *name == own.name);
            symbol.into_iter().for_each(|(_, symbol)| place.env.set(*symbol, force));
        }
        if !self.setting.definition.has_hamiltonian() {
            for momentum in Motion::named_momenta(self.setting, &place)? {
                let value = Motion::momentum(self.setting, &place, &momentum.along)?;
                place.env.set(momentum.symbol, value);
            }
        }
        let mut slopes = Vec::new();
        for name in &self.setting.claim.observed {
            let mut components = model.outputs.iter().flat_map(|o| &o.components);
            let value = match components.find(|(own, _)| own == name) {
                Some((_, e)) => Tape::new(&model.graph, &[*e]).eval(&place.env)?.roots[0],
                None => {
                    let angle = model.base.iter().find(|c| c.name == *name);
                    let angle = angle.ok_or(Open::Because("an output that the model does not have"))?;
                    place.env.get(angle.symbol).ok_or(angle.symbol)?
                }
            };
            slopes.push(value.derivative);
        }
        Ok(slopes)
    }

    fn products(&self, sheet: &mut Sheet, random: &mut Random) {
        let n = self.motion.state.len();
        let by = [
            (Want::Jvp, Want::Vjp, n),
            (Want::SensitivityJvp, Want::SensitivityVjp, self.point.params.len()),
        ];
        for (forward, reverse, n_by) in by {
            let v = random.vector(n_by);
            let direction = match forward {
                Want::Jvp => Direction { state: v.clone(), ..self.still() },
                _ => Direction { params: v.clone(), ..self.still() },
            };
            let [forward, reverse] = [forward, reverse].map(|want| Role::Product(want.name().to_owned()));
            let has = |role: &Role| self.setting.claim.program.function_idx(role).is_some();
            if !has(&forward) && !has(&reverse) {
                continue;
            }
            let slope = self.slope(&Role::Rate, &direction).unwrap_or_default();
            if let Some(found) = self.product(&forward, &v) {
                rows(forward.name(), &found, &slope, sheet);
            }
            let w = random.vector(n);
            if let Some(found) = self.product(&reverse, &w) {
                sheet.zero(reverse.name(), "w.(J v) = (J^T w).v", &[dot(&found, &v), -dot(&w, &slope)]);
            }
        }
    }

    /// `y' = Pi dE + R`.
    fn bracket(&self, matrix: &MatrixClaim<'_>, entries: &[Wide], sheet: &mut Sheet) -> Result<(), Open> {
        let carried = &matrix.columns;
        let mut gradient = Vec::new();
        for k in carried {
            let seeded = self.setting.seeded(&self.point.env, &[(self.setting.state[*k], Wide::ONE)]);
            let place = self.setting.place(&seeded)?;
            gradient.push(self.setting.definition.energy(&place)?.derivative);
        }
        let place = |k: &usize| carried.iter().position(|own| own == k);
        let mut terms: Vec<Vec<Wide>> = vec![Vec::new(); carried.len()];
        for ((i, j), e) in matrix.pattern.iter().zip(entries) {
            if let (Some(a), Some(b)) = (place(i), place(j)) {
                terms[a].push(*e * gradient[b]);
                terms[b].push(-(*e * gradient[a]));
            }
        }
        let remainder = self.call(&Role::Output("bracket_remainder".to_owned()));
        // In the scene's own time.
        let rates = self.call(&Role::Rate).unwrap_or_default();
        for (a, k) in carried.iter().enumerate() {
            let own = remainder.as_ref().map_or(Wide::ZERO, |r| r[a]);
            terms[a].extend([own, -rates[*k]]);
            sheet.zero(
                matrix.name,
                format!("{} by the bracket", self.setting.claim.program.state[*k]),
                &terms[a],
            );
        }
        Ok(())
    }

    /// Momenta of the state by velocities: the inverse of velocities by the state.
    fn legendre(&self, sheet: &mut Sheet) -> Result<(), Open> {
        let role = Role::Product("legendre".to_owned());
        if self.setting.claim.program.function_idx(&role).is_none() {
            return Ok(());
        }
        let legendre = &self.setting.claim.equations.legendre;
        let velocities =
            self.setting.velocities_of(&self.point.env, legendre.velocities.iter().map(|(_, s)| *s))?;
        let found = self.product(&role, &velocities).unwrap_or_default();
        for ((name, _), found) in legendre.momenta.iter().zip(found) {
            let Some(k) = self.setting.claim.program.state.iter().position(|own| own == name) else {
                continue;
            };
            sheet.equal("legendre", name.clone(), found, self.motion.state[k]);
        }
        Ok(())
    }

    /// `sum_k d/ds flow_k = rates` at `s = 0` and any time, and `d/ds flow_k(s, y) = piece_k(y + flow_k(s, y))`.
    fn flows(&self, sheet: &mut Sheet, random: &mut Random) {
        let program = self.setting.claim.program;
        let flows: Vec<usize> = (0..program.functions.len())
            .filter(|k| matches!(program.functions[*k].role, Role::Flow(_)))
            .collect();
        if flows.is_empty() {
            return;
        }
        let call = |k: usize, t: D, state: &[D], s: D| {
            let (params, slots) = (constants(&self.point.params), constants(&self.point.slots));
            let inputs = constants(&self.point.inputs);
            let at = At { params: &params, slots: &slots, inputs: &inputs, t, state };
            self.setting.runner.call(k, &at, &[s])
        };
        let state = constants(&self.motion.state);
        let t = D::constant(self.point.t);
        let mut terms: Vec<Vec<Wide>> = self.motion.rates.iter().map(|r| vec![-*r]).collect();
        let step = Wide::exact(0.3 * random.signed());
        for k in flows {
            let name = program.functions[k].role.name();
            let at_zero = call(k, t, &state, D::variable(Wide::ZERO));
            for ((terms, value), own) in terms.iter_mut().zip(&at_zero).zip(&program.state) {
                terms.push(value.derivative);
                sheet.vanishes(name, format!("{own} in no time"), value.value, 1.0);
            }
            let later = call(k, t, &state, D::variable(step));
            let moved: Vec<D> =
                self.motion.state.iter().zip(&later).map(|(x, d)| D::constant(*x + d.value)).collect();
            let piece = call(k, t, &moved, D::variable(Wide::ZERO));
            for ((later, piece), own) in later.iter().zip(&piece).zip(&program.state) {
                sheet.equal(name, format!("the rate of {own}"), later.derivative, piece.derivative);
            }
            // Flows are composed at whatever time a step begins.
            for (value, own) in
                call(k, D::variable(self.point.t), &state, D::constant(step)).iter().zip(&program.state)
            {
                sheet.vanishes(
                    name,
                    format!("{own} at another time"),
                    value.derivative,
                    value.value.size().max(1.0),
                );
            }
        }
        let direction = Direction { t: Wide::ONE, ..self.still() };
        let explicit = self.slope(&Role::Rate, &direction).unwrap_or_default();
        for ((terms, own), explicit) in terms.iter().zip(&program.state).zip(explicit) {
            sheet.zero("splitting", format!("the sum of the flows of {own}"), terms);
            sheet.vanishes("splitting", format!("{own} at another time"), explicit, 1.0);
        }
    }

    /// `M z' = f(t, z)` along the motion, and the derivative of `f` by `z`.
    fn implicit(&self, sheet: &mut Sheet, random: &mut Random) {
        let program = self.setting.claim.program;
        let function = "implicit";
        let Some(z) = self.call_along(&Role::Output(function.to_owned())) else { return };
        let Some(k) = program.function_idx(&Role::OfVariables("implicit_rhs".to_owned())) else { return };
        let values: Vec<Wide> = z.iter().map(|z| z.value).collect();
        let at = self.point.at(&self.motion.state);
        let f = self.setting.runner.call(k, &at, &values);
        for (((is_differential, z), f), (name, _)) in
            self.setting.claim.differential.iter().zip(&z).zip(&f).zip(&program.functions[k].results)
        {
            match is_differential {
                true => sheet.equal(function, name.clone(), *f, z.derivative),
                false => sheet.vanishes(function, name.clone(), *f, 1.0),
            }
        }
        let Some(jacobian) = program.function_idx(&Role::OfVariables("implicit_jacobian".to_owned())) else {
            return;
        };
        let entries = self.setting.runner.call(jacobian, &at, &values);
        let v = random.vector(values.len());
        let mut found = vec![Wide::ZERO; f.len()];
        for ((i, j), e) in self.setting.claim.implicit_pattern.iter().zip(entries) {
            found[*i] += e * v[*j];
        }
        let (params, slots) = (constants(&self.point.params), constants(&self.point.slots));
        let (inputs, state) = (constants(&self.point.inputs), constants(&self.motion.state));
        let at = At {
            params: &params,
            slots: &slots,
            inputs: &inputs,
            t: D::constant(self.point.t),
            state: &state,
        };
        let defined = self.setting.runner.call(k, &at, &along(&values, &v));
        let defined: Vec<Wide> = defined.iter().map(|d| d.derivative).collect();
        rows("implicit_jacobian", &found, &defined, sheet);
    }

    /// Taylor coefficients of the solution, to third order, by the rates along the series: `(k + 1) c_{k+1}` is
    /// coefficient `k` of `f(t + s, sum_j c_j s^j)`.
    fn series(&self, sheet: &mut Sheet) {
        let program = self.setting.claim.program;
        let Some(rate) = program.function_idx(&Role::Rate) else { return };
        // A rate that has no recurrence is refused where series are asked for.
        let jet = self.setting.jet.get_or_init(|| Jet::new(program, rate).ok());
        let Some(jet) = jet else { return };
        const ORDER: usize = 3;
        let n = self.motion.state.len();
        let mut out = vec![vec![Wide::ZERO; n]; ORDER + 1];
        let prepared: Vec<Wide> = match rounded_slots(program, &self.point.params) {
            Some(slots) => slots.into_iter().chain(self.point.inputs.iter().copied()).collect(),
            None => return,
        };
        let mut coefficients: Vec<&mut [Wide]> = out.iter_mut().map(Vec::as_mut_slice).collect();
        jet.series(&self.point.params, &prepared, self.point.t, &self.motion.state, &mut coefficients);
        type D3 = Dual<Dual<Dual<Wide>>>;
        let lift = |x: Wide| D3::constant(Dual::constant(Dual::constant(x)));
        // `s = e1 + e2 + e3` with `e_k^2 = 0`: the product of all three has the factor `3!` of `s^3`.
        let s = D3::new(
            Dual::new(Dual::new(Wide::ZERO, Wide::ONE), Dual::constant(Wide::ONE)),
            Dual::constant(Dual::constant(Wide::ONE)),
        );
        let state: Vec<D3> =
            (0..n).map(|i| (0..=ORDER).rev().fold(D3::ZERO, |sum, k| sum * s + lift(out[k][i]))).collect();
        let params: Vec<D3> = self.point.params.iter().map(|x| lift(*x)).collect();
        let prepared: Vec<D3> = prepared.iter().map(|x| lift(*x)).collect();
        let mut f = vec![D3::ZERO; program.functions[rate].results.len()];
        program.run(rate, &params, &prepared, lift(self.point.t) + s, &state, &mut f);
        for (i, f) in f.iter().enumerate() {
            let number = |k: u32| Wide::exact(f64::from(k));
            // Derivatives of order 0, 1 and 2 by `s`.
            let orders = [f.value.value.value, f.value.value.derivative, f.value.derivative.derivative];
            let name = &program.state[i];
            for (k, (order, factorial)) in orders.into_iter().zip([1, 1, 2]).enumerate() {
                let defined = order / number(factorial) / number(k as u32 + 1);
                let size = out[k + 1].iter().map(|x| x.size()).fold(1.0, f64::max);
                sheet.vanishes("taylor", format!("order {} of {name}", k + 1), out[k + 1][i] - defined, size);
            }
        }
    }

    /// Rates with cosines and sines of angles behind the state: those of the state, and those of the points.
    fn on_circles(&self, sheet: &mut Sheet) {
        let program = self.setting.claim.program;
        let Some(circles) = self.setting.on_circles.get_or_init(|| Circles::of(program)) else { return };
        let runner = Runner::new(&circles.program);
        let function = "rhs on circles";
        let slots = runner.slots(&self.point.params);
        let whole = self.whole_state(circles, &runner, &slots, &constants(&self.motion.state));
        let values: Vec<Wide> = whole.iter().map(|z| z.value).collect();
        let at = At {
            params: &self.point.params,
            slots: &slots,
            inputs: &self.point.inputs,
            t: self.point.t,
            state: &values,
        };
        let rates = runner.call(Circles::RATE, &at, &[]);
        let own = self.call(&Role::Rate).unwrap_or_default();
        rows(function, &rates[..circles.n_state], &own, sheet);
        let moving = along(&self.motion.state, &own);
        let moving = self.whole_state(circles, &runner, &slots, &moving);
        let slopes: Vec<Wide> = moving.iter().map(|z| z.derivative).collect();
        rows(function, &rates[circles.n_state..], &slopes[circles.n_state..], sheet);
    }

    /// The state with its points of circles.
    fn whole_state(&self, circles: &Circles, runner: &Runner<'_>, slots: &[Wide], state: &[D]) -> Vec<D> {
        let mut whole = state.to_vec();
        whole.resize(circles.program.state.len(), D::ZERO);
        let (params, slots, inputs) =
            (constants(&self.point.params), constants(slots), constants(&self.point.inputs));
        let t = D::constant(self.point.t);
        let points = runner.call(
            Circles::POINTS,
            &At { params: &params, slots: &slots, inputs: &inputs, t, state: &whole },
            &[],
        );
        whole.truncate(circles.n_state);
        whole.extend(points);
        whole
    }
}

/// Slots with constants as the program rounds them: a recurrence has the same ones, so that both agree to all digits.
fn rounded_slots(program: &hamel_program::program::Program, params: &[Wide]) -> Option<Vec<Wide>> {
    let mut prepared = program.prepare(params).ok()?;
    prepared.truncate(program.prepare.slots.len());
    Some(prepared)
}

fn rows(function: &str, found: &[Wide], defined: &[Wide], sheet: &mut Sheet) {
    // Entries that vanish identically are computed as nothing on one side and as a sum on the other.
    let size = defined.iter().chain(found).map(|x| x.size()).fold(0.0, f64::max);
    if found.len() != defined.len() {
        sheet.vanishes(function, "the number of rows", Wide::ONE, 1.0);
    }
    for (k, (found, defined)) in found.iter().zip(defined).enumerate() {
        sheet.vanishes(function, format!("row {}", k + 1), *found - *defined, size);
    }
}
