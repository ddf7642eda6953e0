//! Random points at which a scene is compared with its model: parameters within their conditions, states that satisfy
//! the equations between positions and the constraints.
//!
//! Does not know: what is compared.

use std::cell::OnceCell;

use hamel_runtime::{Dual, Real};

use hamel_expr::{ExprId, Relation, SymbolId, needed_sections};
use hamel_lang::spec::{Domain, Model, ReconstructionKind, Want};
use hamel_mechanics::mechanics::Equations;
use hamel_program::program::{Circles, Jet, Role};

use super::claim::Claim;
use super::definition::{Definition, Missing, Place};
use super::linear::Reduced;
use super::modes;
use super::random::Random;
use super::runner::{At, Runner};
use super::tape::{Env, PI, Tape, rational};
use super::wide::Wide;

/// Iterations of Newton's method: doubling 31 digits from one takes five.
const MAX_ITERATIONS: usize = 40;
/// Relative error of what Newton's method has moved.
const SOLVED: f64 = 1.0 / (1u128 << 96) as f64;
/// Part of its default by which a parameter moves at most.
const SPREAD: f64 = 0.4;

/// A scene, its model and its program, ready for evaluation.
pub(super) struct Setting<'a> {
    pub(super) claim: &'a Claim<'a>,
    pub(super) definition: Definition<'a>,
    pub(super) runner: Runner<'a>,
    /// All velocities of the system, and of the model.
    velocities: Tape,
    /// Their symbols.
    pub(super) velocity_symbols: Vec<SymbolId>,
    /// Symbols of the scene's state.
    pub(super) state: Vec<SymbolId>,
    /// Base coordinates of the system that the scene leaves out.
    pub(super) left_out: Vec<SymbolId>,
    /// Cosine, sine, angle.
    pub(super) circles: Vec<[SymbolId; 3]>,
    /// Symbols of the model's quasi-velocities.
    quasi: Vec<SymbolId>,
    /// Residuals of equations between positions, and what a degenerate Lagrangian says about positions.
    pub(super) positions: Tape,
    of_degeneracy: Tape,
    initial: Vec<(SymbolId, Tape)>,
    /// Whether elements of groups are coordinates that are drawn as such elements: most identities hold beside the
    /// groups as well, and are held there.
    pub(super) on_groups: bool,
    /// Which modes are on together; one entry without any in a model that has none.
    pub(super) modes: Vec<modes::On>,
    /// The recurrence of the rates' Taylor coefficients, and the rates with angles on circles, where there are such:
    /// for all points.
    pub(super) jet: OnceCell<Option<Jet>>,
    pub(super) on_circles: OnceCell<Option<Circles>>,
}

/// A point, without what follows from it.
#[derive(Clone)]
pub(super) struct Point {
    /// Parameters of the program.
    pub(super) params: Vec<Wide>,
    pub(super) slots: Vec<Wide>,
    pub(super) inputs: Vec<Wide>,
    pub(super) t: Wide,
    /// All symbols: parameters, inputs, time, the state, coordinates that the scene leaves out.
    pub(super) env: Env<Wide>,
}

impl Point {
    /// Size of the numbers of the state.
    pub(super) fn scale(&self, setting: &Setting<'_>) -> f64 {
        self.state(setting).iter().map(|x| x.size()).fold(0.0, f64::max)
    }

    pub(super) fn state(&self, setting: &Setting<'_>) -> Vec<Wide> {
        setting.state.iter().map(|s| self.env.get(*s).unwrap_or_default()).collect()
    }
}

impl<'a> Setting<'a> {
    pub(super) fn new(claim: &'a Claim<'a>) -> Setting<'a> {
        let (model, equations) = (claim.model, claim.equations);
        let system = &equations.system;
        // A coordinate that reduction has made a state of first order keeps its velocity in the model: its rate.
        let is_whole = system.velocities.len() == model.all_velocities().len();
        let (symbols, roots): (Vec<SymbolId>, Vec<ExprId>) = match is_whole {
            true => (system.velocities.clone(), equations.velocities.clone()),
            false => model
                .all_velocities()
                .iter()
                .enumerate()
                .filter_map(|(k, (_, symbol))| {
                    let place = system.velocities.iter().position(|s| s == symbol);
                    let coordinate = model.base[..model.n_shape()].get(k).map(|c| c.symbol);
                    let rate = || {
                        equations.state.iter().find(|s| Some(s.symbol) == coordinate).map(|s| s.derivative)
                    };
                    Some((*symbol, place.map(|k| equations.velocities[k]).or_else(rate)?))
                })
                .unzip(),
        };
        let sections = needed_sections(&system.graph, &equations.sections, &roots);
        let velocities = Tape::with_definitions(&system.graph, &sections, &roots);
        let is_left_out = |s: &SymbolId| !claim.state.contains(s);
        let angle = |name: &str| model.base.iter().find(|c| c.name == name).map(|c| c.symbol);
        let circles = system.circles.iter().filter_map(|c| Some([c.cosine, c.sine, angle(&c.angle)?]));
        let positions: Vec<ExprId> =
            model.constraints.iter().filter_map(|c| Some(c.position?.residual)).collect();
        let of_degeneracy: Vec<ExprId> =
            system.degeneracy.iter().flat_map(|d| d.positions.iter().map(|(_, e)| *e)).collect();
        let by_name = symbols_by_name(model, equations);
        let initial = model.initial.iter().filter_map(|(name, e)| {
            let (_, symbol) = by_name.iter().find(|(known, _)| known == name)?;
            Some((*symbol, Tape::new(&model.graph, &[*e])))
        });
        let initial: Vec<(SymbolId, Tape)> = initial.collect();
        let is_on = |symbol: SymbolId| {
            let own = initial.iter().find(|(known, _)| *known == symbol);
            own.and_then(|(_, tape)| tape.eval::<Wide>(&Env::new()).ok())
                .is_some_and(|e| e.roots[0].size() > 0.0)
        };
        Setting {
            modes: modes::reachable(model, is_on),
            definition: Definition::new(model, equations),
            runner: Runner::new(claim.program),
            velocities,
            velocity_symbols: symbols,
            state: claim.state.clone(),
            left_out: system.algebroid.base().iter().copied().filter(is_left_out).collect(),
            circles: circles.collect(),
            quasi: model.quasi_velocities.iter().map(|v| v.symbol).collect(),
            positions: Tape::new(&model.graph, &positions),
            of_degeneracy: Tape::new(&system.graph, &of_degeneracy),
            initial,
            claim,
            on_groups: false,
            jet: OnceCell::new(),
            on_circles: OnceCell::new(),
        }
    }

    /// All velocities, from the values of everything that is drawn.
    pub(super) fn place<R: Real>(&self, env: &Env<R>) -> Result<Place<R>, Missing> {
        let mut env = env.clone();
        for [cosine, sine, angle] in &self.circles {
            let [c, s] = [*cosine, *sine].map(|symbol| env.get(symbol).ok_or(symbol));
            let value = s?.atan2(c?);
            // Of all angles of the point the one next to what was drawn, which lies in the domain.
            let drawn = env.get(*angle).unwrap_or(value);
            let turn = |k: f64| value + R::from_parts(2.0 * PI[0], 2.0 * PI[1]) * R::from_f64(k);
            let apart = |a: &R| (drawn - *a).magnitude();
            let all = [-2.0, -1.0, 0.0, 1.0, 2.0].map(turn);
            let next = all.into_iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
            env.set(*angle, next.unwrap_or(value));
        }
        let values = self.velocities.eval(&env)?;
        for symbol in &self.quasi {
            if let Some(value) = values.defined.get(symbol) {
                env.set(*symbol, *value);
            }
        }
        self.definition.place(env, values.roots)
    }

    /// The values of velocities, by symbol: of the system, before stages, or of definitions behind them.
    pub(super) fn velocities_of(
        &self,
        env: &Env<Wide>,
        symbols: impl Iterator<Item = SymbolId>,
    ) -> Result<Vec<Wide>, Missing> {
        let values = self.velocities.eval(env)?;
        let system = &self.claim.equations.system;
        let before = self.definition.before_stages(env, &values.roots)?;
        let value = |symbol: SymbolId| {
            let of_system = self.velocity_symbols.iter().position(|s| *s == symbol).map(|k| values.roots[k]);
            let original = system.frame.as_ref().map(|frame| &frame.original);
            let of_original =
                original.and_then(|o| o.iter().position(|u| u.symbol == symbol)).map(|k| before[k]);
            let found = of_system.or(of_original).or_else(|| values.defined.get(&symbol).copied());
            found.or_else(|| env.get(symbol)).ok_or(symbol)
        };
        symbols.map(value).collect()
    }

    /// What a state has to satisfy: equations between positions, constraints, unit quaternions.
    fn restrictions<R: Real>(&self, env: &Env<R>) -> Result<Vec<R>, Missing> {
        let place = self.place(env)?;
        let mut all = self.positions.eval(&place.env)?.roots;
        all.extend(self.of_degeneracy.eval(&place.env)?.roots);
        let residuals = self.definition.residuals(&place.env)?;
        let highest = self.definition.highest(&place.env)?;
        all.extend(residuals.into_iter().zip(highest).filter(|(_, row)| row.is_none()).map(|(r, _)| r));
        Ok(all)
    }

    /// A point; none where parameters, the domain or Newton's method do not allow it. Points of consecutive turns go
    /// through the modes that may be on together.
    pub(super) fn draw(&self, random: &mut Random, attempt: usize, turn: usize) -> Option<Point> {
        let model = self.claim.model;
        let system = &self.claim.equations.system;
        let mut env: Env<Wide> = Env::new();
        let t = Wide::exact(random.between(0.2, 1.2));
        env.set(model.time, t);
        let fixed = &system.formulation.fixed;
        for input in &model.inputs {
            let held = fixed.iter().find(|(name, _)| *name == input.name).map_or(&input.default, |(_, q)| q);
            env.set(input.symbol, rational(held));
        }
        let inputs: Vec<Wide> = system.inputs.iter().map(|_| Wide::exact(random.signed())).collect();
        system.inputs.iter().zip(&inputs).for_each(|(input, value)| env.set(input.symbol, *value));
        self.draw_params(&mut env, random, attempt)?;
        let params: Vec<Wide> = system.params.iter().filter_map(|p| env.get(p.symbol)).collect();
        let slots = self.runner.slots(&params);
        self.conditions_hold(&params, &slots)?;
        self.draw_state(&mut env, random, turn)?;
        self.satisfy(&mut env)?;
        let point = Point { params, slots, inputs, t, env };
        (self.is_inside(&point) && self.modes_agree(&point)).then_some(point)
    }

    fn draw_params(&self, env: &mut Env<Wide>, random: &mut Random, attempt: usize) -> Option<()> {
        let model = self.claim.model;
        let fixed = &self.claim.equations.system.formulation.fixed;
        let roots: Vec<ExprId> = model.conditions.iter().flat_map(|c| [c.greater, c.less]).collect();
        let conditions = Tape::new(&model.graph, &roots);
        // Closer to the defaults where conditions fail, and the longer the search takes.
        let mut spread = SPREAD / (1 << (attempt / 8).min(8)) as f64;
        for _ in 0..60 {
            for param in &model.params {
                let value = match fixed.iter().find(|(name, _)| *name == param.name) {
                    Some((_, q)) => rational(q),
                    None => {
                        let default: Wide = rational(&param.default);
                        let moved = random.symmetric() * spread;
                        match default.size() == 0.0 {
                            true => Wide::exact(moved),
                            false => default * Wide::exact(1.0 + moved),
                        }
                    }
                };
                env.set(param.symbol, value);
            }
            let values = conditions.eval(env).ok()?.roots;
            let holds =
                |(c, pair): (&hamel_lang::spec::Condition, &[Wide])| compare(c.relation, pair[0], pair[1]);
            if model.conditions.iter().zip(values.chunks(2)).all(holds) {
                return Some(());
            }
            spread /= 1.5;
        }
        None
    }

    fn conditions_hold(&self, params: &[Wide], slots: &[Wide]) -> Option<()> {
        // Values of the prepare part that conditions mention are no slots: they are computed once more.
        let conditions = self.runner.conditions(params);
        let finite = slots.iter().all(|x| x.all_finite());
        (finite && conditions.into_iter().all(|(relation, a, b)| compare(relation, a, b))).then_some(())
    }

    fn draw_state(&self, env: &mut Env<Wide>, random: &mut Random, turn: usize) -> Option<()> {
        let model = self.claim.model;
        let system = &self.claim.equations.system;
        let initial = |symbol: SymbolId, env: &Env<Wide>| {
            let (_, tape) = self.initial.iter().find(|(own, _)| *own == symbol)?;
            Some(tape.eval(env).ok()?.roots[0].to_f64())
        };
        let base = model.base.iter().map(|c| (c.symbol, c.domain));
        let first_order = model.first_order.iter();
        let first_order =
            first_order.flat_map(|s| s.components.iter().map(|(_, symbol)| (*symbol, s.domain)));
        for (symbol, on) in &self.modes[turn % self.modes.len()] {
            env.set(*symbol, if *on { Wide::ONE } else { Wide::ZERO });
        }
        for (symbol, domain) in base.chain(first_order).filter(|(symbol, _)| !self.is_mode(*symbol)) {
            let start = initial(symbol, env);
            let value = match domain {
                Domain::Interval(low, high) => {
                    let ends = Tape::new(&model.graph, &[low, high]).eval(env).ok()?.roots;
                    let [low, high] = [ends[0].to_f64(), ends[1].to_f64()];
                    match start.filter(|x| low < *x && *x < high) {
                        Some(x) => {
                            let reach = 0.5 * (x - low).min(high - x).min(1.0);
                            x + reach * random.symmetric()
                        }
                        None => random.between(low + 0.15 * (high - low), high - 0.15 * (high - low)),
                    }
                }
                Domain::Angle | Domain::Real => start.unwrap_or(0.0) + 0.6 * random.signed(),
            };
            env.set(symbol, Wide::exact(value));
        }
        for advected in &model.advected {
            let symbols: Vec<SymbolId> = advected.components.iter().map(|(_, s)| *s).collect();
            let vector = random.vector(symbols.len());
            let given: Option<Vec<f64>> = symbols.iter().map(|s| initial(*s, env)).collect();
            let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
            let scale = match given {
                Some(start) if start.iter().any(|x| *x != 0.0) => {
                    norm(&mut start.into_iter()) / norm(&mut vector.iter().map(|x| x.to_f64()))
                }
                _ => 1.0,
            };
            let vector: Vec<Wide> = vector.into_iter().map(|x| x * Wide::exact(scale)).collect();
            env.set_all(&symbols, &vector);
        }
        for configuration in model.configurations.iter().filter(|_| self.on_groups) {
            let element = super::group::random_element(&configuration.group, random);
            env.set_all(&configuration.symbols, &element);
        }
        self.set_points(env);
        let drawn = |symbol: &SymbolId, env: &Env<Wide>| env.get(*symbol).is_some();
        let others: Vec<SymbolId> = (self.state.iter().copied())
            .chain(system.algebroid.base().iter().copied())
            .filter(|s| !drawn(s, env))
            .collect();
        for symbol in others {
            env.set(symbol, Wide::exact(random.signed()));
        }
        for item in &model.reconstruction {
            match &item.kind {
                ReconstructionKind::Quaternion { .. } | ReconstructionKind::Pose { .. } => {
                    let q = random.vector(4);
                    let square = q.iter().fold(Wide::ZERO, |sum, x| sum + *x * *x);
                    let unit: Vec<Wide> = q.into_iter().map(|x| x / square.sqrt()).collect();
                    env.set_all(&item.symbols[..4], &unit);
                    let rest = random.vector(item.symbols.len() - 4);
                    env.set_all(&item.symbols[4..], &rest);
                }
                ReconstructionKind::Matrix { group, .. } => {
                    let element = super::group::random_element(group, random);
                    env.set_all(&item.symbols, &element);
                }
                _ => env.set_all(&item.symbols, &random.vector(item.symbols.len())),
            }
        }
        Some(())
    }

    /// The modes that are on at the points of a turn, for people.
    pub(super) fn names_of_modes(&self, turn: usize) -> String {
        let graph = &self.claim.model.graph;
        let on = self.modes[turn % self.modes.len()].iter().filter(|(_, on)| **on);
        let names: Vec<&str> = on.map(|(symbol, _)| graph.name(*symbol)).collect();
        if names.is_empty() { "all modes off".to_owned() } else { format!("{} on", names.join(", ")) }
    }

    /// Whether modes that are on do not contradict each other.
    fn modes_agree(&self, point: &Point) -> bool {
        let agree = || self.definition.modes_agree(&self.place(&point.env).ok()?).ok();
        self.claim.model.modes.is_empty() || agree() == Some(true)
    }

    fn is_mode(&self, symbol: SymbolId) -> bool {
        self.claim.model.modes.iter().any(|mode| mode.symbol == symbol)
    }

    /// A state beside this one, which satisfies no restriction; points stay on their circles.
    pub(super) fn beside(&self, point: &Point, random: &mut Random) -> Point {
        let mut moved = point.clone();
        let is_fixed =
            |s: &SymbolId| self.circles.iter().any(|[c, sine, _]| s == c || s == sine) || self.is_mode(*s);
        let angles = self.circles.iter().map(|[.., angle]| *angle);
        let variables: Vec<SymbolId> =
            self.state.iter().copied().filter(|s| !is_fixed(s)).chain(angles).collect();
        for symbol in variables {
            if let Some(x) = moved.env.get(symbol) {
                moved.env.set(symbol, Wide::of(x * Wide::exact(1.0 + 0.1 * random.symmetric())));
            }
        }
        self.set_points(&mut moved.env);
        moved
    }

    /// Points of circles by their angles.
    fn set_points(&self, env: &mut Env<Wide>) {
        for [cosine, sine, angle] in &self.circles {
            if let Some(x) = env.get(*angle) {
                let (s, c) = x.sin_cos();
                env.set(*cosine, c);
                env.set(*sine, s);
            }
        }
    }

    /// Moves coordinates and velocities until all restrictions hold.
    fn satisfy(&self, env: &mut Env<Wide>) -> Option<()> {
        let on_circles: Vec<SymbolId> = self.circles.iter().flat_map(|[c, s, _]| [*c, *s]).collect();
        let on_groups = self.claim.model.configurations.iter().filter(|_| self.on_groups);
        let on_groups: Vec<SymbolId> = on_groups.flat_map(|c| c.symbols.iter().copied()).collect();
        let is_moved =
            |s: &&SymbolId| !on_circles.contains(s) && !on_groups.contains(s) && !self.is_mode(**s);
        let variables: Vec<SymbolId> =
            self.state.iter().chain(&self.left_out).filter(is_moved).copied().collect();
        let angles: Vec<SymbolId> = self.circles.iter().map(|[.., angle]| *angle).collect();
        let variables: Vec<SymbolId> = variables.into_iter().chain(angles).collect();
        for _ in 0..MAX_ITERATIONS {
            let values = self.restrictions(env).ok()?;
            if values.iter().any(|r| !r.all_finite()) {
                return None;
            }
            if values.iter().all(|r| r.size() <= 4.0 * r.error()) {
                return Some(());
            }
            // Slopes of sixteen digits: each step of Newton's method gains as many, and values have all of theirs.
            let rounded = env.map(Wide::to_f64);
            let mut rows: Vec<Vec<Wide>> = values.iter().map(|_| Vec::new()).collect();
            for symbol in &variables {
                let seeded = self.seeded(&rounded, &[(*symbol, 1.0)]);
                let slopes = self.restrictions(&seeded).ok()?;
                let slopes = slopes.into_iter().map(|slope| Wide::exact(slope.derivative));
                rows.iter_mut().zip(slopes).for_each(|(row, slope)| row.push(slope));
            }
            if rows.iter().flatten().any(|x| !x.all_finite()) {
                return None;
            }
            let step = shortest(&rows, &values);
            for (symbol, d) in variables.iter().zip(step) {
                if d.size() == 0.0 {
                    continue;
                }
                let x = env.get(*symbol)? + d;
                // The value is what it is: only its distance from a solution counts as an error.
                env.set(*symbol, Wide::of(x).uncertain(SOLVED * x.size()));
            }
            self.set_points(env);
        }
        None
    }

    /// The values with derivatives along a change of some symbols; points of circles follow their angles.
    pub(super) fn seeded<R: Real>(&self, env: &Env<R>, along: &[(SymbolId, R)]) -> Env<Dual<R>> {
        let mut seeded = env.map(Dual::constant);
        for (symbol, d) in along {
            if let Some(x) = env.get(*symbol) {
                seeded.set(*symbol, Dual::new(x, *d));
            }
            for [cosine, sine, angle] in self.circles.iter().filter(|[.., angle]| angle == symbol) {
                if let Some(x) = env.get(*angle) {
                    let (s, c) = Dual::new(x, *d).sin_cos();
                    seeded.set(*cosine, c);
                    seeded.set(*sine, s);
                }
            }
        }
        seeded
    }

    /// Whether the functions that say where the domain ends are positive, and pivots do not vanish.
    fn is_inside(&self, point: &Point) -> bool {
        let state = point.state(self);
        let at = point.at(&state);
        let Some(domain) = self.claim.program.function_idx(&Role::Domain) else { return true };
        self.runner.call(domain, &at, &[]).iter().all(|x| x.to_f64() > 0.0)
    }

    /// The rates that the program computes, by the time of the model.
    pub(super) fn rates<R: Real>(&self, at: &At<'_, R>) -> Vec<R> {
        let Some(rate) = self.claim.program.function_idx(&Role::Rate) else { return Vec::new() };
        let mut rates = self.runner.call(rate, at, &[]);
        if self.claim.is_in_hamiltonian_time {
            let role = Role::Output(Want::HamiltonianTime.name().to_owned());
            if let Some(factor) = self.claim.program.function_idx(&role) {
                let factor = self.runner.call(factor, at, &[])[0];
                rates.iter_mut().for_each(|r| *r /= factor);
            }
        }
        rates
    }
}

impl Point {
    pub(super) fn at<'p>(&'p self, state: &'p [Wide]) -> At<'p, Wide> {
        At { params: &self.params, slots: &self.slots, inputs: &self.inputs, t: self.t, state }
    }
}

pub(super) fn compare(relation: Relation, a: Wide, b: Wide) -> bool {
    let difference = (a - b).to_f64();
    match relation {
        Relation::Greater => difference > 0.0,
        Relation::GreaterEqual => difference >= 0.0,
        Relation::NotEqual => difference != 0.0,
    }
}

/// Names that initial values are given for.
fn symbols_by_name(model: &Model, equations: &Equations) -> Vec<(String, SymbolId)> {
    let base = model.base.iter().map(|c| (c.name.clone(), c.symbol));
    let advected = model.advected.iter().flat_map(|a| a.components.iter().cloned());
    let state = equations.state.iter().map(|s| (s.name.clone(), s.symbol));
    base.chain(advected).chain(state).collect()
}

/// The shortest `d` with `G d = -r`, `d = G^T mu` with `G G^T mu = -r`: entries of a rotation stay next to one.
fn shortest(rows: &[Vec<Wide>], values: &[Wide]) -> Vec<Wide> {
    let dot = |a: &[Wide], b: &[Wide]| a.iter().zip(b).fold(Wide::ZERO, |sum, (a, b)| sum + *a * *b);
    let system = rows
        .iter()
        .zip(values)
        .map(|(row, r)| rows.iter().map(|other| dot(row, other)).chain([-*r]).collect());
    let weights = Reduced::new(system.collect(), rows.len()).solution(&vec![Wide::ZERO; rows.len()]);
    let n = rows.first().map_or(0, Vec::len);
    let column = |j: usize| rows.iter().zip(&weights).fold(Wide::ZERO, |sum, (row, mu)| sum + row[j] * *mu);
    (0..n).map(column).collect()
}
