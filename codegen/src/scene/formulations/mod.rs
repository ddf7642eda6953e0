//! The formulations of a scene: a bounded set of candidates, each proved to be the same motion as the scene's own,
//! with what it costs and loses to rounding.
//!
//! `axes` lists what can be chosen otherwise, `accuracy` bounds rounding errors. Every single choice is tried; then the
//! best of each axis are combined, the most promising first; the best few of all are lowered again with the whole
//! budget of the search for cheap forms. Candidates come in an order that depends on nothing but the model, and no
//! clock is read: the same model gives the same list on every machine.
//!
//! Does not know: how a formulation is carried out, how a form is searched for, who asks.

mod accuracy;
mod axes;

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use num_traits::Signed as _;

use hamel_expr::parallel::side_by_side;
use hamel_expr::{Budget, DivisionByZero, ExprId, Node, Style, SymbolId, sign_of};
use hamel_lang::spec::{CarriedBy, Diagnostics, FormulationSearch, Model, Want, Wanted};
use hamel_mechanics::mechanics::{ChangeOfState, Equations, OutputKind, Unrelated, derive};
use hamel_mechanics::reduction::{Formulation, KinematicConstraint, ReducedSystem, StateKind, reduce};
use hamel_program::lower::SearchBudget;
use hamel_program::program::{Counts, Instruction, Op, Operand, Program, Role};

use super::build::build_derived;
use super::built::BuiltScene;
use super::plan::{Drops, Outputs, Plan};
use accuracy::Points;
use axes::{Choice, axes, go_together, neighbours};

/// Choices of each axis that are combined with those of others.
const BEST_OF_AN_AXIS: usize = 2;
/// Combinations that are tried.
const MAX_COMBINATIONS: usize = 32;
/// Combinations that promise to cost more than so many times the scene's own are not tried.
const MAX_PROMISE: f64 = 1.5;
/// Times that the cheapest choice of an axis is changed slot by slot.
const MAX_ROUNDS: usize = 3;
/// Candidates that are lowered with the whole budget.
const MAX_FINALISTS: usize = 6;
/// A bound of rounding errors is worse than another one beyond this factor; less is not told apart.
const TOLD_APART: f64 = 1.5;
/// Bounds of so few roundings are not told apart at all: a sum of thirty terms has them, none of which cancel.
const FEW: f64 = 32.0;
/// The part of the model's budget, and of the search for cheap forms, that a candidate may take at first.
const PART: u64 = 16;

/// How far a search is: candidates done, of those known by now.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// The formulations of a scene, the cheapest right-hand side first.
#[derive(Clone, Debug)]
pub struct Formulations {
    /// All that are proved to be the same motion, the scene's own among them.
    pub candidates: Vec<Candidate>,
    /// What was tried in vain.
    pub left_out: Vec<LeftOut>,
}

/// A formulation that is proved to be the motion of the scene.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The formulation.
    pub formulation: Formulation,
    /// What it chooses otherwise than the scene, in words; nothing for the scene's own.
    pub choices: Vec<String>,
    /// Names of the state variables.
    pub state: Vec<String>,
    /// Those that are not in the scene's own state, or mean something else there.
    pub changed: Vec<String>,
    /// Whether all of these are points of the scene's angles, momenta of its velocities, and what is carried along
    /// levels of stages: then a state of either can be told by one of the other.
    pub is_converted: bool,
    /// State variables that the model has no name for: momenta, and variables along levels.
    pub n_unnamed: usize,
    /// Operations of the right-hand side.
    pub counts: Counts,
    /// The longest chain of operations of the right-hand side, in cycles.
    pub latency: u32,
    /// Numbers that are prepared once per set of parameters.
    pub n_prepared: usize,
    /// Bound of the rounding error of the right-hand side, in units of the roundoff times what rounding the inputs
    /// does.
    pub rounding: f64,
    program: Program,
    /// Names of the outputs.
    outputs: Vec<String>,
}

impl Candidate {
    /// Whether every state variable is one of the scene's own.
    pub fn keeps_state(&self) -> bool {
        self.changed.is_empty()
    }

    /// Whether it is the scene's own formulation.
    pub fn is_own(&self) -> bool {
        self.choices.is_empty()
    }

    /// What it chooses otherwise, in one line.
    pub fn title(&self) -> String {
        if self.is_own() { "as the scene says".into() } else { self.choices.join("; ") }
    }

    /// Whether the operations on the state and the prepared numbers are those of another one.
    fn computes_the_same_as(&self, other: &Candidate) -> bool {
        let operations = |candidate: &Candidate| {
            let ops = |list: &[Instruction]| list.iter().map(|i| i.op).collect::<Vec<Op>>();
            let (rate, prepare) = (candidate.program.function(&Role::Rate)?, &candidate.program.prepare);
            let results: Vec<Operand> = rate.results.iter().map(|(_, operand)| *operand).collect();
            let slots: Vec<u32> = prepare.slots.iter().map(|slot| slot.value).collect();
            Some((ops(&rate.instructions), results, ops(&prepare.instructions), slots))
        };
        let is_one_state = self.state == other.state && self.changed == other.changed;
        let constants = self.program.constants == other.program.constants;
        is_one_state && constants && operations(self) == operations(other)
    }

    fn rank(&self) -> (u64, u32, usize, usize, usize) {
        (self.counts.cost(), self.latency, self.n_unnamed, self.n_prepared, self.choices.len())
    }

    /// Whether it loses no more digits than another one, as far as bounds are told apart.
    fn is_as_accurate_as(&self, other: &Candidate) -> bool {
        self.rounding <= FEW.max(TOLD_APART * other.rounding)
    }
}

/// A formulation that was tried in vain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// What it chooses otherwise than the scene, in words.
    pub title: String,
    /// Why it is no candidate.
    pub reason: String,
}

impl Formulations {
    /// The scene's own formulation.
    ///
    /// # Panics
    /// Never: a search without it is an error.
    pub fn own(&self) -> &Candidate {
        self.candidates.iter().find(|c| c.is_own()).expect("the scene's own formulation is a candidate")
    }

    /// The cheapest formulation that is as accurate as the scene's own, the own one where none costs less. Its state is
    /// the scene's own, or else one with which the scene's initial states can be told.
    pub fn best(&self, keeps_state: bool) -> &Candidate {
        let own = self.own();
        let fits = |c: &&Candidate| if keeps_state { c.keeps_state() } else { c.is_converted };
        let fitting = self.candidates.iter().filter(fits);
        let better = fitting.filter(|c| c.is_as_accurate_as(own) && c.counts.cost() < own.counts.cost());
        better.min_by_key(|c| c.rank()).unwrap_or(own)
    }
}

/// Choices that were made, in the order of their axes.
type Choices = Vec<Choice>;

struct Search<'a> {
    model: &'a Model,
    plan: Plan,
    keeps_state: bool,
    own: Arc<Equations>,
    /// The formulation that all are compared with: the scene's own in velocities, angles on the line.
    hub: Arc<Equations>,
    /// From the state of the hub to the scene's own.
    points: Points,
    done: AtomicUsize,
    progress: Progress<'a>,
}

/// State variables that are not the scene's own.
struct Changed {
    names: Vec<String>,
    /// See [`Candidate::is_converted`].
    is_converted: bool,
    /// See [`Candidate::n_unnamed`].
    n_unnamed: usize,
}

impl Changed {
    /// As it is for the scene's own state.
    fn nothing() -> Changed {
        Changed { names: Vec::new(), is_converted: true, n_unnamed: 0 }
    }
}

/// A candidate on its way.
#[derive(Clone)]
struct Found {
    choices: Choices,
    candidate: Candidate,
    /// Elements along levels of stages that the state has a variable for, with their levels.
    elements: Vec<(String, String)>,
}

/// Searches the formulations of a scene by its plan; with `keeps_state`, only those whose state variables are the
/// scene's own.
///
/// # Errors
/// What is wrong with the scene as it is.
pub(super) fn search(
    model: &Model,
    plan: &Plan,
    keeps_state: bool,
    progress: Progress<'_>,
) -> Result<Formulations, Diagnostics> {
    let bare = Plan {
        drops: plan.drops.clone(),
        reconstructs: plan.reconstructs,
        ..Plan::bare(plan.name.clone(), plan.formulation.clone())
    };
    let own = derived(model, &bare.formulation)?;
    let mut plain = Formulation { circles: Vec::new(), ..bare.formulation.clone() };
    if model.hamiltonian.is_none() {
        plain.momenta.retain(|carried| matches!(carried.by, CarriedBy::Parameter(_)));
    }
    let hub = if plain == bare.formulation { None } else { derived(model, &plain).ok() };
    let hub = hub.unwrap_or_else(|| Arc::clone(&own));
    let built = build_derived(model, Arc::clone(&own), &bare)?;
    let (drops, dropped) = match &bare.drops {
        Drops::Components(names) => (names.clone(), None),
        Drops::Nothing => (Vec::new(), None),
        Drops::Ignorable => (Vec::new(), Some(built.state_names())),
    };
    let axes = axes(model, &bare.formulation, &own.system, (&drops, keeps_state));
    // What a scene leaves out by itself, every candidate has to leave out.
    let bare = match dropped {
        None => bare,
        Some(kept) => {
            let all = own.state.iter().map(|s| s.name.clone());
            Plan { drops: Drops::Components(all.filter(|name| !kept.contains(name)).collect()), ..bare }
        }
    };
    let change = ChangeOfState::between(&hub, &own.system).ok();
    let mut points = Points::new(model, &hub, &built);
    change.iter().for_each(|change| points.keep_those_of(&built, change));
    let rounding = change.map_or(0.0, |change| points.bound(&built, &change));
    let scene = Candidate::of(&built, Vec::new(), Changed::nothing(), rounding);
    let done = AtomicUsize::new(0);
    let search = Search { model, plan: bare, keeps_state, own, hub, points, done, progress };
    Ok(search.run(&axes, scene))
}

/// The plan in the formulation that a search chooses; as it is where the scene as it is written is wrong, so that
/// whoever builds it says so.
pub(super) fn chosen(model: &Model, plan: Plan, wanted: FormulationSearch) -> Plan {
    let keeps_state = wanted == FormulationSearch::KeepingState;
    let Ok(found) = search(model, &plan, keeps_state, &|_, _| {}) else { return plan };
    let (own, best) = (found.own(), found.best(keeps_state));
    let words = if keeps_state { "auto" } else { "auto(state)" };
    let [cost, own_cost] = [best, own].map(|candidate| candidate.counts.cost());
    let title = best.title();
    let chosen = match best.is_own() {
        true => format!("{title}, by `{words}`; its right-hand side costs {cost}, and none found costs less"),
        false => {
            format!("{title}, by `{words}`; its right-hand side costs {cost}, as the scene says {own_cost}")
        }
    };
    let mut outputs = plan.outputs.clone();
    if let Outputs::Named(wanted) = &mut outputs {
        // The angles that the scene's own state has, where they are functions of the points.
        let angles =
            best.formulation.circles.iter().filter(|angle| !plan.formulation.circles.contains(angle));
        let angles = angles.filter(|angle| best.outputs.contains(angle)).cloned().map(Wanted::Own);
        let velocities = best.outputs.iter().any(|name| name == Want::Velocities.name());
        let velocities = velocities.then_some(Wanted::Want(Want::Velocities));
        let conversions: Vec<Wanted> =
            angles.chain(velocities).filter(|want| !wanted.contains(want)).collect();
        wanted.extend(conversions);
    }
    Plan { formulation: best.formulation.clone(), outputs, chosen: Some(chosen), ..plan }
}

fn derived(model: &Model, formulation: &Formulation) -> Result<Arc<Equations>, Diagnostics> {
    let system = reduce(model, formulation)?;
    derive(&system).map(Arc::new).map_err(|e| model.diagnostics(vec![model.diagnose(&e)]))
}

impl Candidate {
    fn of(built: &BuiltScene, choices: Vec<String>, changed: Changed, rounding: f64) -> Candidate {
        let rate = built.program.function(&Role::Rate);
        // Copies of a number are computed once.
        let prepared: BTreeSet<u32> = built.program.prepare.slots.iter().map(|slot| slot.value).collect();
        Candidate {
            formulation: built.equations.system.formulation.clone(),
            choices,
            state: built.state_names(),
            changed: changed.names,
            is_converted: changed.is_converted,
            n_unnamed: changed.n_unnamed,
            counts: rate.map(|f| f.counts()).unwrap_or_default(),
            latency: rate.map(|f| f.latency()).unwrap_or_default(),
            n_prepared: prepared.len(),
            rounding,
            outputs: built.equations.outputs.iter().map(|output| output.name.clone()).collect(),
            program: built.program.clone(),
        }
    }
}

impl Search<'_> {
    fn run(&self, axes: &[Vec<Choice>], scene: Candidate) -> Formulations {
        let mut left_out = Vec::new();
        let mut found: Vec<Found> = Vec::new();
        let singles: Vec<Choices> = axes.iter().flatten().map(|choice| vec![choice.clone()]).collect();
        self.try_all(&singles, &mut found, &mut left_out);
        let axes = self.with_neighbours(axes, &mut found, &mut left_out);
        let n_base = self.model.n_shape();
        let algebra = n_base..n_base + self.model.velocities.len();
        let combined = combinations(&axes, &found, (&scene, &algebra));
        self.try_all(&combined, &mut found, &mut left_out);
        let mut distinct: Vec<&Found> = Vec::new();
        for one in &found {
            let computes_the_same = |other: &Candidate| one.candidate.computes_the_same_as(other);
            if !computes_the_same(&scene) && !distinct.iter().any(|other| computes_the_same(&other.candidate))
            {
                distinct.push(one);
            }
        }
        distinct.sort_by_key(|one| one.candidate.rank());
        let finalists: Vec<&Found> = distinct.iter().take(MAX_FINALISTS).copied().collect();
        let total = self.done.load(Ordering::Relaxed) + finalists.len();
        let finished = side_by_side(&finalists, |one| {
            let result = derived(self.model, &one.candidate.formulation)
                .ok()
                .and_then(|equations| self.lowered(&one.choices, &equations, SearchBudget::default()).ok());
            self.tell(total);
            result
        });
        let mut candidates = vec![scene];
        for (one, finished) in
            distinct.iter().zip(finished.into_iter().map(Some).chain(std::iter::repeat(None)))
        {
            candidates.push(match finished {
                Some(Some(candidate)) => candidate,
                _ => one.candidate.clone(),
            });
        }
        candidates.sort_by_key(Candidate::rank);
        Formulations { candidates, left_out }
    }

    /// The axes with the choices that come when, from the cheapest one of an axis, the variables are changed slot by
    /// slot, as long as that costs less.
    fn with_neighbours(
        &self,
        axes: &[Vec<Choice>],
        found: &mut Vec<Found>,
        left_out: &mut Vec<LeftOut>,
    ) -> Vec<Vec<Choice>> {
        let mut longer = axes.to_vec();
        for axis in longer.iter_mut().filter(|_| !self.keeps_state) {
            for _ in 0..MAX_ROUNDS {
                let of_axis =
                    found.iter().filter(|one| matches!(&*one.choices, [choice] if axis.contains(choice)));
                let Some(best) = of_axis.min_by_key(|one| one.candidate.rank()).cloned() else { break };
                let new = neighbours(&best.choices[0], axis, &best.elements);
                let new: Vec<Choice> = new.into_iter().filter(|choice| !axis.contains(choice)).collect();
                let singles: Vec<Choices> = new.iter().map(|choice| vec![choice.clone()]).collect();
                let n = found.len();
                self.try_all(&singles, found, left_out);
                axis.extend(new);
                if !found[n..].iter().any(|one| one.candidate.rank() < best.candidate.rank()) {
                    break;
                }
            }
        }
        longer
    }

    fn tell(&self, total: usize) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.progress)(done, total);
    }

    fn try_all(&self, list: &[Choices], found: &mut Vec<Found>, left_out: &mut Vec<LeftOut>) {
        let total = self.done.load(Ordering::Relaxed) + list.len();
        let tried = side_by_side(list, |choices| {
            let result = self.tried(choices);
            self.tell(total);
            result
        });
        for (choices, result) in list.iter().zip(tried) {
            match result {
                Ok(Some(one)) => found.push(one),
                Ok(None) => {}
                Err(reason) => left_out.push(LeftOut { title: self.texts(choices).join("; "), reason }),
            }
        }
    }

    fn texts(&self, choices: &[Choice]) -> Vec<String> {
        choices.iter().map(|choice| choice.text(self.model)).collect()
    }

    /// A candidate, proved and lowered at little cost; none where its state is not wanted.
    fn tried(&self, choices: &Choices) -> Result<Option<Found>, String> {
        let mut formulation = self.plan.formulation.clone();
        choices.iter().for_each(|choice| choice.apply(&mut formulation));
        let mut model = self.model.clone();
        let Budget { expressions, bytes, work } = model.graph.budget();
        model.graph.set_budget(Budget {
            expressions: expressions / PART,
            bytes: bytes / PART,
            work: work / PART,
        });
        let first = |problems: &Diagnostics| {
            problems.iter().next().map(|problem| problem.message.clone()).unwrap_or_default()
        };
        let system = reduce(&model, &formulation).map_err(|problems| first(&problems))?;
        if self.keeps_state && !self.changed(&system).names.is_empty() {
            return Ok(None);
        }
        self.refuse_divisors(&system)?;
        let equations = derive(&system).map(Arc::new).map_err(|e| e.message_and_help().0)?;
        let whole = SearchBudget::default();
        let part = PART as usize;
        let budget = SearchBudget {
            divisors: whole.divisors / part,
            steps: whole.steps / part,
            terms: whole.terms / part,
            numbers: whole.numbers / part,
            units: whole.units / part,
            products: whole.products,
            measurements: whole.measurements / part,
        };
        self.relation(&equations.system)?.relates(&self.hub, &equations).map_err(|why| match why {
            Unrelated::NoFunction { component } => format!("{component} is no function of the scene's state"),
            Unrelated::Differs { component } => format!("{component} moves otherwise"),
            Unrelated::Unknown { component } => {
                format!("that {component} moves as in the scene could not be proved")
            }
        })?;
        let candidate = self.lowered(choices, &equations, budget)?;
        let elements = elements(&equations.system);
        Ok(Some(Found { choices: choices.clone(), candidate, elements }))
    }

    fn relation(&self, system: &ReducedSystem) -> Result<ChangeOfState, String> {
        ChangeOfState::between(&self.hub, system)
            .map_err(|DivisionByZero| "its connection has no value in the scene's coordinates".to_owned())
    }

    /// State variables that the scene does not have, or that mean something else there.
    fn changed(&self, system: &ReducedSystem) -> Changed {
        let change = ChangeOfState::between(&self.own, system).ok();
        let keeps = |s| change.as_ref().is_some_and(|change| change.keeps(system, s));
        let points: Vec<SymbolId> = system.circles.iter().flat_map(|c| [c.cosine, c.sine]).collect();
        let mut changed = Changed::nothing();
        // Variables along levels follow from the velocities of the model, if these are the scene's.
        let [theirs, own] = [&system.formulation, &self.own.system.formulation];
        let has_velocities = theirs.connection == own.connection && theirs.independent == own.independent;
        let is_of_level =
            |symbol: SymbolId| has_velocities && system.changes.iter().any(|c| c.symbol == symbol);
        for (kind, _) in &system.state {
            let symbol = system.state_symbol(*kind);
            if keeps(symbol) {
                continue;
            }
            let name = system.graph.name(symbol);
            let mut named = self.model.momenta.iter().flat_map(|m| &m.components);
            let has_name = matches!(kind, StateKind::Base(_)) || named.any(|(own, ..)| own == name);
            changed.n_unnamed += usize::from(!has_name);
            changed.names.push(name.to_owned());
            changed.is_converted &= match kind {
                StateKind::Base(_) => points.contains(&symbol),
                StateKind::Unknown(_) => is_of_level(symbol),
                StateKind::Momentum { place, .. } => {
                    let velocity = system.unknowns[system.momenta[*place].unknown].symbol;
                    keeps(velocity) || is_of_level(velocity)
                }
            };
        }
        changed
    }

    fn lowered(
        &self,
        choices: &Choices,
        equations: &Arc<Equations>,
        budget: SearchBudget,
    ) -> Result<Candidate, String> {
        let mut plan =
            Plan { formulation: equations.system.formulation.clone(), search: budget, ..self.plan.clone() };
        // The velocities that the state is told by must not need a coordinate that the scene leaves out.
        let has_velocities = equations.outputs.iter().any(|o| o.kind == OutputKind::Group(Want::Velocities));
        if has_velocities && !matches!(plan.drops, Drops::Nothing) {
            plan.outputs = Outputs::Named(vec![Wanted::Want(Want::Velocities)]);
        }
        let built = build_derived(self.model, Arc::clone(equations), &plan)
            .map_err(|problems| problems.iter().next().map(|p| p.message.clone()).unwrap_or_default())?;
        let rounding = self.points.bound(&built, &self.relation(&equations.system)?);
        Ok(Candidate::of(&built, self.texts(choices), self.changed(&equations.system), rounding))
    }

    /// Refuses a formulation that divides by something that may vanish and that the scene's own does not divide by.
    fn refuse_divisors(&self, system: &ReducedSystem) -> Result<(), String> {
        if let (KinematicConstraint::Solved(solved), KinematicConstraint::Solved(own)) =
            (&system.constraint, &self.own.system.constraint)
            && let Some((name, _)) =
                solved.pivots.iter().find(|(name, _)| own.pivots.iter().all(|(known, _)| known != name))
        {
            return Err(format!("divides by the {name}, which may vanish"));
        }
        let entries: Vec<_> = system.connection.iter().flatten().flatten().copied().collect();
        if self.own.hessian_is_a_sum_of_squares() {
            return Ok(());
        }
        let known: Vec<_> = self.own.system.connection.iter().flatten().flatten().copied().collect();
        let known = divisors(&self.own.system, &known);
        let base: BTreeSet<_> = system.algebroid.base().iter().copied().collect();
        let g = &system.graph;
        for e in divisors(system, &entries) {
            let is_fixed = !g.depends_on(e, &base);
            let text = g.display(e, Style::Plain);
            let is_known = known.iter().any(|own| self.own.system.graph.display(*own, Style::Plain) == text);
            if !is_fixed && !is_known && !sign_of(g, e, &system.signs).is_definite() {
                return Err(format!("its connection divides by {text}, which may vanish"));
            }
        }
        Ok(())
    }
}

/// The elements along levels that variables of the state stand for, with the names of their levels.
fn elements(system: &ReducedSystem) -> Vec<(String, String)> {
    let Some(stages) = &system.stages else { return Vec::new() };
    let names = stages.velocity_names().into_iter().enumerate();
    let is_carried = |name: &String| system.changes.iter().any(|c| c.name == *name);
    let of_level = |(k, name): (usize, String)| (name, stages.levels[stages.level_of(k)].name.clone());
    names.map(of_level).filter(|(name, _)| is_carried(name)).collect()
}

/// What expressions divide by.
fn divisors(system: &ReducedSystem, roots: &[ExprId]) -> Vec<ExprId> {
    let mut list = Vec::new();
    for e in system.graph.reachable(roots) {
        if let Node::Product { factors, .. } = system.graph.node(e) {
            list.extend(factors.iter().filter(|(_, q)| q.is_negative()).map(|(base, _)| *base));
        }
    }
    list.sort_unstable();
    list.dedup();
    list
}

/// Choices of several axes together, the most promising first: by the product of what each of them alone makes of the
/// cost.
fn combinations(
    axes: &[Vec<Choice>],
    found: &[Found],
    (scene, algebra): (&Candidate, &Range<usize>),
) -> Vec<Choices> {
    let own = scene.counts.cost().max(1) as f64;
    let mut sums: Vec<(f64, Choices)> = vec![(1.0, Vec::new())];
    for axis in axes {
        let alone = |choice: &Choice| {
            let one = found.iter().find(|one| one.choices == [choice.clone()])?;
            // What changes nothing by itself is not tried with others.
            (!one.candidate.computes_the_same_as(scene)).then_some(one)
        };
        let mut best: Vec<&Found> = axis.iter().filter_map(alone).collect();
        best.sort_by_key(|one| one.candidate.rank());
        let mut longer = Vec::new();
        for one in best.into_iter().take(BEST_OF_AN_AXIS) {
            let factor = one.candidate.counts.cost() as f64 / own;
            longer.extend(sums.iter().map(|(cost, choices)| {
                (cost * factor, choices.iter().chain(&one.choices).cloned().collect::<Vec<_>>())
            }));
        }
        sums.extend(longer);
    }
    sums.retain(|(promise, choices)| {
        choices.len() > 1 && *promise <= MAX_PROMISE && go_together(choices, algebra)
    });
    sums.sort_by(|a, b| a.0.total_cmp(&b.0));
    sums.into_iter().take(MAX_COMBINATIONS).map(|(_, choices)| choices).collect()
}
