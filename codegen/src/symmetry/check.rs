//! Holds a reduced model to the model that it was made from: rates of both at random points, by their own programs.
//!
//! At the cross-section energies are equal. A motion of the model is `g(t) w(t)` with a motion `w` of the reduced
//! model, so that each velocity of the model has the rate `sum_a xi^a X_a y + d/dt y(w)`; and of each function that
//! advects, `sum_k a_k' v_k = sum_a xi^a X_a f`, less what mixes constraints.
//!
//! Does not know: how the group was found, how the text was written.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{ExprId, SymbolId, rational_to_f64, uniform};
use hamel_lang::spec::{self, Domain, Model};

use super::group::SymmetryGroup;
use super::modules::Module;
use super::section::Section;
use super::setting::Setting;
use super::total::Told;
use super::write::Written;
use crate::scene;

type Values = BTreeMap<SymbolId, f64>;

/// A state by the names of it, with what the steps to it may have lost.
type End = BTreeMap<String, (f64, f64)>;

/// Points at which both are compared, and the most draws for them.
const N_POINTS: usize = 3;
const MAX_DRAWS: usize = 40;

/// The largest difference beside the size of the terms: rates are computed in doubles from random states of size
/// one, through eliminations that lose a few digits.
const MAX_DIFFERENCE: f64 = 1e-7;

/// Times and steps of the motions that are compared: the group leaves the identity in the first one, and the error of a
/// step is far below [`MAX_DIFFERENCE`] for rates of size one. A model with faster rates is compared after the first
/// time whose steps are accurate; a motion of the last one is still far above rounding.
const TIMES: [f64; 6] = [1e-1, 6e-3, 4e-4, 2.5e-5, 1.5e-6, 1e-7];
const N_STEPS: u32 = 16;

/// A motion whose steps are less accurate beside its time says nothing.
const MAX_STEP_ERROR: f64 = 1e-4;

/// A scene at the defaults of the parameters.
struct Running {
    model: Model,
    scene: scene::BuiltScene,
    params: Vec<f64>,
}

impl Running {
    /// The scene that is wanted, if the model has it, or the first one. Scenes of the model itself may have another
    /// state: they are not looked at.
    fn new(model: &Model, wanted: &str) -> Result<Running, String> {
        let plain = Model { scenes: Vec::new(), ..model.clone() };
        let names = scene::names(&plain);
        let name = names.iter().find(|name| *name == wanted).or(names.first()).ok_or("there is no scene")?;
        let scene = scene::build(&plain, name).map_err(|e| e.to_string())?;
        let defaults: BTreeMap<&str, f64> =
            model.params.iter().map(|p| (p.name.as_str(), rational_to_f64(&p.default))).collect();
        let params = scene
            .params()
            .iter()
            .map(|p| defaults.get(p.name.as_str()).copied().unwrap_or(f64::NAN))
            .collect();
        Ok(Running { model: plain, scene, params })
    }

    /// The state after a time, by the names of it, in steps of Runge and Kutta's method; and how far half as many
    /// steps lead elsewhere.
    fn carried(&self, (t, time): (f64, f64), of: impl Fn(&str) -> Option<f64>) -> Option<End> {
        let names = self.scene.state_names();
        let start: Vec<f64> = names.iter().map(|name| of(name)).collect::<Option<_>>()?;
        let interpreter = self.scene.prepare(&self.params).ok()?;
        let rate = |t: f64, y: &[f64], by: f64, k: &[f64]| {
            let moved: Vec<f64> = y.iter().zip(k).map(|(y, k)| y + by * k).collect();
            let mut rates = vec![0.0; y.len()];
            interpreter.rhs(t + by, &moved, &mut rates);
            rates
        };
        let end = |n: u32| {
            let h = time / f64::from(n);
            let (mut t, mut y) = (t, start.clone());
            for _ in 0..n {
                let a = rate(t, &y, 0.0, &y);
                let b = rate(t, &y, h / 2.0, &a);
                let c = rate(t, &y, h / 2.0, &b);
                let d = rate(t, &y, h, &c);
                for k in 0..y.len() {
                    y[k] += h / 6.0 * (a[k] + 2.0 * (b[k] + c[k]) + d[k]);
                }
                t += h;
            }
            y
        };
        let (fine, coarse) = (end(N_STEPS), end(N_STEPS / 2));
        let pairs = fine.into_iter().zip(coarse).map(|(x, other)| (x, (x - other).abs()));
        Some(names.into_iter().zip(pairs).collect())
    }

    /// Rates by the names of the state, and the energy, where there are rates.
    fn rates(
        &self,
        t: f64,
        of: impl Fn(&str) -> Option<f64>,
    ) -> Option<(BTreeMap<String, f64>, Option<f64>)> {
        let names = self.scene.state_names();
        let state: Vec<f64> = names.iter().map(|name| of(name)).collect::<Option<_>>()?;
        let interpreter = self.scene.prepare(&self.params).ok()?;
        let mut rates = vec![0.0; state.len()];
        interpreter.rhs(t, &state, &mut rates);
        let energy = interpreter.energy(t, &state);
        rates.iter().all(|r| r.is_finite()).then(|| (names.into_iter().zip(rates).collect(), energy))
    }
}

/// Operations of the right-hand side of a model, if it can be derived.
pub(super) fn cost(text: &str) -> Option<u64> {
    let model = spec::parse("reduced", text).ok()?;
    let names = scene::names(&model);
    let scene = scene::build(&model, names.first()?).ok()?;
    let rows = scene.operation_counts();
    rows.iter().find(|(name, _)| name == "rhs").map(|(_, counts)| counts.cost())
}

impl Setting<'_> {
    /// Holds momenta to the rates of the model; without rates they are not told.
    ///
    /// # Errors
    /// The momentum that is not constant.
    pub(super) fn hold_to_motion(&mut self, told: &mut [Told]) -> Result<(), String> {
        if told.iter().all(|t| t.momentum.is_none()) {
            return Ok(());
        }
        let Ok(own) = Running::new(self.model, scene::DEFAULT) else {
            told.iter_mut().for_each(|t| t.momentum = None);
            return Ok(());
        };
        let (everything, mut random) = (Section::of_all(self), 1);
        for one in told {
            let Some(momentum) = one.momentum else { continue };
            let mut n_points = 0;
            for _ in 0..MAX_DRAWS {
                let Some(is_constant) = self.is_constant(&own, &everything, momentum, &mut random) else {
                    continue;
                };
                if !is_constant {
                    return Err(format!("`{}` is not constant", self.spelled(momentum)));
                }
                n_points += 1;
                if n_points == N_POINTS {
                    break;
                }
            }
            if n_points < N_POINTS {
                one.momentum = None;
            }
        }
        Ok(())
    }

    /// Whether `dJ/dt = 0` at a random point by the rates of the model, where these have values.
    fn is_constant(
        &mut self,
        own: &Running,
        everything: &Section,
        momentum: ExprId,
        random: &mut u64,
    ) -> Option<bool> {
        let t = 0.3 + 0.2 * uniform(random);
        let (values, _) = self.drawn(everything, None, t, random)?;
        let by_name: BTreeMap<&str, f64> = values.iter().map(|(s, x)| (self.graph.name(*s), *x)).collect();
        let (rates, _) = own.rates(t, |name| by_name.get(name).copied())?;
        let slope = self.graph.diff(momentum, self.model.time);
        let mut sum = self.graph.eval_f64(slope, &values)?;
        let mut size = 1.0 + sum.abs();
        for symbol in self.graph.free_symbols(momentum) {
            let Some(rate) = rates.get(self.graph.name(symbol)) else { continue };
            let slope = self.graph.diff(momentum, symbol);
            let term = rate * self.graph.eval_f64(slope, &values)?;
            sum += term;
            size += term.abs();
        }
        size.is_finite().then(|| is_near(sum, 0.0, size))
    }

    /// Compares the reduced model of the text with the model.
    ///
    /// # Errors
    /// What differs, or why nothing could be compared.
    pub(super) fn compared(
        &mut self,
        (group, section): (&SymmetryGroup, &Section),
        written: &Written,
        text: &str,
    ) -> Result<(), String> {
        let reduced = spec::parse("reduced", text).map_err(|problems| problems.to_string())?;
        let (own, other) =
            (Running::new(self.model, scene::DEFAULT)?, Running::new(&reduced, scene::RECONSTRUCTION)?);
        let mut random = 1;
        let mut n_points = 0;
        for _ in 0..MAX_DRAWS {
            let Some(differs) = self.difference((group, section), written, (&own, &other), &mut random)
            else {
                continue;
            };
            if let Some(what) = differs {
                return Err(what);
            }
            n_points += 1;
            if n_points == N_POINTS {
                return Ok(());
            }
        }
        Err("at no point both have rates".to_owned())
    }

    /// The difference at a random point, if there is one; `None` where nothing can be compared at the point.
    fn difference(
        &mut self,
        (group, section): (&SymmetryGroup, &Section),
        written: &Written,
        (own, other): (&Running, &Running),
        random: &mut u64,
    ) -> Option<Option<String>> {
        let t = 0.3 + 0.2 * uniform(random);
        let (mut small, mut variables) = self.drawn(section, Some(written), t, random)?;
        self.onto_constraints(section, written, &mut small)?;
        let large = self.at_values(section, &small);
        let by_name = |g: &hamel_expr::Graph, values: &Values| -> BTreeMap<String, f64> {
            values.iter().map(|(s, x)| (g.name(*s).to_owned(), *x)).collect()
        };
        let mut named = by_name(&self.graph, &small);
        // Coordinates that leave are reconstructed from the identity.
        for (name, symbol) in self.named_coordinates() {
            if section.at.contains_key(&symbol) {
                named.insert(name, *large.get(&symbol)?);
            }
        }
        let reduced = named.clone();
        let (slow, energy) = other.rates(t, |name| named.get(name).copied())?;
        let named = by_name(&self.graph, &large);
        let (fast, of_model) = own.rates(t, |name| named.get(name).copied())?;
        if let (Some(energy), Some(of_model)) = (energy, of_model)
            && energy.is_finite()
            && of_model.is_finite()
            && !is_near(energy, of_model, 1.0 + energy.abs() + of_model.abs())
        {
            return Some(Some(format!("the energy is {of_model}, and {energy} by the reduced model")));
        }
        // Rates of the variables of the reduced model: by its program, and by constraints.
        let shape: Vec<SymbolId> = section.shape.iter().map(|i| self.model.base[*i].symbol).collect();
        variables.extend(shape.iter().copied());
        let rate_symbols: BTreeMap<SymbolId, SymbolId> =
            variables.iter().map(|s| (*s, self.graph.symbol(&format!("'rate{}", s.index())))).collect();
        let rates: BTreeMap<SymbolId, ExprId> =
            rate_symbols.iter().map(|(s, r)| (*s, self.graph.sym(*r))).collect();
        let mut with_rates = small.clone();
        let mut unknown = Vec::new();
        for (symbol, rate) in &rate_symbols {
            match slow.get(self.graph.name(*symbol)) {
                Some(value) => _ = with_rates.insert(*rate, *value),
                None => {
                    with_rates.insert(*rate, 0.0);
                    unknown.push((*symbol, *rate));
                }
            }
        }
        let of_time = BTreeMap::from([(self.model.time, self.graph.one())]);
        let mut rows = Vec::new();
        for residual in &written.constraints {
            let along = self.graph.derivative_along(*residual, &rates);
            let by_time = self.graph.derivative_along(*residual, &of_time);
            let mut row: Vec<f64> = Vec::new();
            for (symbol, _) in &unknown {
                let slope = self.graph.diff(*residual, *symbol);
                row.push(self.graph.eval_f64(slope, &small)?);
            }
            let offset = self.graph.eval_f64(along, &with_rates)? + self.graph.eval_f64(by_time, &small)?;
            row.push(-offset);
            rows.push(row);
        }
        let solution = least_squares(&rows, unknown.len())?;
        for ((_, rate), value) in unknown.iter().zip(solution) {
            with_rates.insert(*rate, value);
        }
        let xi: Vec<f64> = section.symbols.iter().map(|s| small[s]).collect();
        for k in 0..self.velocities.len() {
            let symbol = self.velocities[k];
            let name = self.graph.name(symbol).to_owned();
            let Some(found) = fast.get(&name) else { continue };
            let value = section.at[&symbol];
            let along = self.graph.derivative_along(value, &rates);
            let mut sum = self.graph.eval_f64(along, &with_rates)?;
            let mut size = 1.0 + found.abs() + sum.abs();
            for (field, xi) in group.fields.iter().zip(&xi) {
                let Some(image) = field.images.get(&symbol) else { continue };
                let term = xi * self.graph.eval_f64(*image, &large)?;
                sum += term;
                size += term.abs();
            }
            // A point at a singularity says nothing.
            if !size.is_finite() {
                return None;
            }
            if !is_near(sum, *found, size) {
                return Some(Some(format!(
                    "the rate of `{name}` is {found}, and {sum} by the reduced model"
                )));
            }
        }
        if let Some((functions, module, symbols)) = &written.module {
            for r in 0..functions.len() {
                let differs =
                    self.module_difference(group, (r, functions, module, symbols), (&xi, &slow), &large)?;
                if differs.is_some() {
                    return Some(differs);
                }
            }
        }
        if let Some(marked) = self.marked.clone() {
            // A row of the attitude.
            let row = &self.model.configurations[marked.configuration].symbols[3 * marked.axis..];
            for (entry, symbol) in row.iter().zip(marked.advected) {
                let [found, wanted] = [(&slow, symbol), (&fast, *entry)]
                    .map(|(rates, s)| rates.get(self.graph.name(s)).copied());
                let (found, wanted) = (found?, wanted?);
                if !is_near(found, wanted, 1.0 + wanted.abs()) {
                    let name = self.graph.name(symbol);
                    return Some(Some(format!("the rate of `{name}` is {found}, in the model {wanted}")));
                }
            }
        }
        for time in TIMES {
            let end = own.carried((t, time), |name| named.get(name).copied())?;
            let of_reduced = other.carried((t, time), |name| reduced.get(name).copied())?;
            let names = self.leaving(section);
            if let Some(differs) = motion_difference(&names, (&named, time), (&end, &of_reduced)) {
                return Some(differs);
            }
        }
        None
    }

    /// Coordinates of the model that the group takes away.
    fn leaving(&self, section: &Section) -> Vec<String> {
        let all = self.named_coordinates().into_iter();
        all.filter(|(_, symbol)| section.at.contains_key(symbol)).map(|(name, _)| name).collect()
    }

    /// Holds the start of the reduced model to the one of the model: energies are equal, and so are coordinates that
    /// both have, then and after a short motion.
    ///
    /// `others`: coordinates of the reduced model that differ from the one of the same name.
    ///
    /// # Errors
    /// What differs, or why nothing could be compared.
    pub(super) fn starts_alike(&self, others: &BTreeSet<&str>, text: &str) -> Result<(), String> {
        let unread = |_| "the text cannot say the values of the model".to_owned();
        let reduced = spec::parse("reduced", text).map_err(unread)?;
        let both =
            [Running::new(self.model, scene::DEFAULT)?, Running::new(&reduced, scene::RECONSTRUCTION)?];
        let mut starts = Vec::new();
        let mut energies = Vec::new();
        for one in &both {
            let no_start = || format!("`{}` does not move where it starts", one.model.name);
            let state = scene::start(&one.model, &one.scene).ok().flatten().ok_or_else(no_start)?.state;
            let interpreter = one.scene.prepare(&one.params).map_err(|_| no_start())?;
            energies.push(interpreter.energy(0.0, &state));
            let named = one.scene.state_names().into_iter().zip(state);
            starts.push(named.collect::<BTreeMap<String, f64>>());
        }
        if let [Some(of_model), Some(energy)] = energies[..]
            && !is_near(energy, of_model, 1.0 + energy.abs() + of_model.abs())
        {
            return Err(format!("the energy starts at {of_model}, and at {energy} by the reduced model"));
        }
        let names: Vec<String> = (self.named_coordinates().into_iter().map(|(name, _)| name))
            .filter(|name| !others.contains(name.as_str()) && starts.iter().all(|s| s.contains_key(name)))
            .collect();
        for name in &names {
            let [x, y] = [starts[0][name], starts[1][name]];
            if !is_near(x, y, 1.0 + x.abs()) {
                return Err(format!("`{name}` starts at {x}, and at {y} by the reduced model"));
            }
        }
        for time in TIMES {
            let carried = |k: usize| both[k].carried((0.0, time), |name| starts[k].get(name).copied());
            let (Some(end), Some(of_reduced)) = (carried(0), carried(1)) else { continue };
            match motion_difference(&names, (&starts[0], time), (&end, &of_reduced)) {
                Some(Some(differs)) => return Err(differs),
                Some(None) => return Ok(()),
                None => {}
            }
        }
        Err("the motions are too fast to be compared".to_owned())
    }

    /// `sum_k a_k' v_k = sum_a xi^a (X_a f - lambda_a f)` at the start of the module, for one of its functions.
    fn module_difference(
        &mut self,
        group: &SymmetryGroup,
        (r, functions, module, symbols): (usize, &[ExprId], &Module, &[SymbolId]),
        (xi, slow): (&[f64], &BTreeMap<String, f64>),
        large: &Values,
    ) -> Option<Option<String>> {
        let (mut left, mut right, mut size) = (0.0, 0.0, 1.0);
        for (symbol, v) in symbols.iter().zip(&module.basis) {
            let term = slow.get(self.graph.name(*symbol))? * self.graph.eval_f64(v[r], large)?;
            left += term;
            size += term.abs();
        }
        for ((field, twist), xi) in group.fields.iter().zip(&module.twist).zip(xi) {
            let slope = self.twisted_slope(&field.images, functions[r], (functions, &twist[r]));
            right += xi * self.graph.eval_f64(slope, large)?;
        }
        if !(size + right.abs()).is_finite() {
            return None;
        }
        let is_equal = is_near(left, right, size);
        let name = symbols.first().map_or("", |s| self.graph.name(*s));
        Some((!is_equal).then(|| format!("what `{name}` advects changes by {left}, in the model by {right}")))
    }

    /// Values of parameters, inputs, time and variables of the reduced model, with the symbols that have rates.
    fn drawn(
        &mut self,
        section: &Section,
        written: Option<&Written>,
        t: f64,
        random: &mut u64,
    ) -> Option<(Values, Vec<SymbolId>)> {
        let model = self.model;
        let mut values: Values = model
            .params
            .iter()
            .chain(&model.inputs)
            .map(|p| (p.symbol, rational_to_f64(&p.default)))
            .collect();
        values.insert(model.time, t);
        let mut variables = Vec::new();
        for i in &section.shape {
            let coordinate = &model.base[*i];
            let x = uniform(random);
            let value = match coordinate.domain {
                Domain::Interval(low, high) => {
                    let [low, high] = [low, high].map(|e| self.graph.eval_f64(e, &values));
                    let (low, high) = (low?, high?);
                    let high = if high.is_finite() { high } else { low + 2.0 };
                    low + (0.3 + 0.4 * x) * (high - low)
                }
                _ => 2.0 * x - 1.0,
            };
            values.insert(coordinate.symbol, value);
        }
        for (k, _) in &section.kept {
            let configuration = &model.configurations[*k];
            let elements: Vec<ExprId> =
                configuration.symbols.iter().map(|s| self.element(*s)).collect::<Option<_>>()?;
            let mut free = Values::new();
            for e in &elements {
                for s in self.graph.free_symbols(*e) {
                    free.entry(s).or_insert_with(|| 2.0 * uniform(random) - 1.0);
                }
            }
            for (symbol, e) in configuration.symbols.iter().zip(&elements) {
                values.insert(*symbol, self.graph.eval_f64(*e, &free)?);
            }
            variables.extend(configuration.symbols.iter().copied());
        }
        for symbol in section.velocities() {
            values.insert(*symbol, 2.0 * uniform(random) - 1.0);
            variables.push(*symbol);
        }
        if let Some(marked) = self.marked.as_ref().filter(|_| written.is_some()) {
            for (l, symbol) in marked.advected.iter().enumerate() {
                values.insert(*symbol, if l == marked.axis { 1.0 } else { 0.0 });
                variables.push(*symbol);
            }
        }
        // Displacements are any: forces are compared by their power.
        for pair in &section.pairs {
            values.insert(*pair, 2.0 * uniform(random) - 1.0);
        }
        for symbol in written.iter().flat_map(|written| &written.along) {
            values.insert(*symbol, 2.0 * uniform(random) - 1.0);
            variables.push(*symbol);
        }
        if let Some((_, module, symbols)) = written.and_then(|written| written.module.as_ref()) {
            for (symbol, start) in symbols.iter().zip(&module.start) {
                values.insert(*symbol, rational_to_f64(start));
                variables.push(*symbol);
            }
        }
        Some((values, variables))
    }

    /// Moves the velocities of the reduced model onto its constraints, by the least change.
    fn onto_constraints(&mut self, section: &Section, written: &Written, values: &mut Values) -> Option<()> {
        let velocities = section.velocities().to_vec();
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for residual in &written.constraints {
            let mut row = Vec::new();
            for v in &velocities {
                let slope = self.graph.diff(*residual, *v);
                row.push(self.graph.eval_f64(slope, values)?);
            }
            row.push(-self.graph.eval_f64(*residual, values)?);
            rows.push(row);
        }
        for (v, change) in velocities.iter().zip(least_norm(&rows, velocities.len())?) {
            *values.get_mut(v)? += change;
        }
        Some(())
    }

    /// Values of the coordinates and velocities of the model at the section.
    fn at_values(&mut self, section: &Section, small: &Values) -> Values {
        let mut large = small.clone();
        for (symbol, e) in &section.at {
            if let Some(value) = self.graph.eval_f64(*e, small) {
                large.insert(*symbol, value);
            }
        }
        large
    }
}

/// The difference of coordinates after a time, if there is one; `None` where the steps were too long.
fn motion_difference(
    names: &[String],
    (start, time): (&BTreeMap<String, f64>, f64),
    (end, of_reduced): (&End, &End),
) -> Option<Option<String>> {
    let moved = |name: &String| Some((start.get(name)?, end.get(name)?, of_reduced.get(name)?));
    let way = names.iter().filter_map(moved).fold(time, |way, (at, (x, _), _)| way + (x - at).abs());
    for name in names {
        let Some((_, (x, e), (y, f))) = moved(name) else { continue };
        let error = e + f;
        // Also where it is no number.
        if error.is_nan() || error > MAX_STEP_ERROR * time {
            return None;
        }
        if !is_near(*x, *y, way + error / MAX_DIFFERENCE) {
            let what = format!("`{name}` is {x} after {time}, and {y} as the reduced model reconstructs it");
            return Some(Some(what));
        }
    }
    Some(None)
}

/// Whether two sums of terms of this size are equal up to rounding.
fn is_near(a: f64, b: f64, size: f64) -> bool {
    (a - b).abs() <= MAX_DIFFERENCE * size
}

/// The solution of `A x = b` of least squares, `A` with independent columns, rows `[A | b]`: by normal equations.
fn least_squares(rows: &[Vec<f64>], n: usize) -> Option<Vec<f64>> {
    let entry = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
    let normal = (0..n).map(|i| (0..=n).map(|j| entry(i, j)).collect()).collect();
    solved(normal, false)
}

/// The least solution of `A x = b`, rows `[A | b]` that may depend on each other.
fn least_norm(rows: &[Vec<f64>], n: usize) -> Option<Vec<f64>> {
    let entry = |p: &Vec<f64>, q: &Vec<f64>| p[..n].iter().zip(q).map(|(x, y)| x * y).sum::<f64>();
    let normal = rows.iter().map(|p| rows.iter().map(|q| entry(p, q)).chain([p[n]]).collect()).collect();
    let lambda = solved(normal, true)?;
    Some((0..n).map(|j| rows.iter().zip(&lambda).map(|(row, l)| row[j] * l).sum()).collect())
}

/// Gauss with pivots for `[A | b]`; unknowns without a pivot are zero, or there is no solution.
fn solved(mut rows: Vec<Vec<f64>>, may_be_singular: bool) -> Option<Vec<f64>> {
    let n = rows.len();
    let size = rows.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut pivots = Vec::new();
    let mut top = 0;
    for column in 0..n {
        let best = (top..n).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()))?;
        // Smaller ones are rounding.
        if rows[best][column].abs() <= 1e-9 * size {
            if may_be_singular {
                continue;
            }
            return None;
        }
        rows.swap(top, best);
        for r in 0..n {
            if r != top {
                let factor = rows[r][column] / rows[top][column];
                for k in column..=n {
                    rows[r][k] -= factor * rows[top][k];
                }
            }
        }
        pivots.push(column);
        top += 1;
    }
    let mut x = vec![0.0; n];
    for (r, column) in pivots.into_iter().enumerate() {
        x[column] = rows[r][n] / rows[r][column];
    }
    Some(x)
}
