//! Equations as scenes share them: their rates in the form that costs least, searched once for each state.
//!
//! Does not know: which scenes there are, what a scene wants besides rates.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Stage, SymbolId, needed_sections};
use hamel_mechanics::mechanics::{Equations, StateEquation};
use hamel_program::lower::{self, Inputs, KnownRates, ParamCondition, Request, SearchBudget};
use hamel_program::program::Role;

use super::built::legendre_role;
use super::domain::domain;
use super::pivots::sorted_pivots;

/// Equations, with their rates in the forms that were searched, for all scenes that are made from them.
#[derive(Clone, Debug)]
pub(super) struct Derived {
    pub(super) equations: Arc<Equations>,
    /// Whether the forms decided how the equations are written: all scenes take them then.
    pub(super) by_cost: bool,
    searched: Arc<Mutex<Vec<(Request, Cell)>>>,
}

/// The outcome of one search, once somebody has asked for it.
type Cell = Arc<OnceLock<Result<Arc<Searched>, Error>>>;

/// Rates in the form that costs least.
#[derive(Debug)]
pub(super) struct Searched {
    /// The graph of the equations and more: that of the form.
    pub(super) graph: Graph,
    pub(super) rates: KnownRates,
    pub(super) guards: Guards,
}

/// What rates divide by, and where they have values.
#[derive(Clone, Debug)]
pub(super) struct Guards {
    /// Of parameters alone.
    pub(super) conditions: Vec<ParamCondition>,
    pub(super) divisors: lower::Divisors,
    /// Of what changes along a motion.
    pub(super) pivots: Vec<(String, ExprId)>,
    pub(super) domain: Vec<(String, ExprId)>,
}

impl Guards {
    pub(super) fn of(
        graph: &mut Graph,
        equations: &Equations,
        rates: &Request,
        state: &[SymbolId],
    ) -> Guards {
        let system = &equations.system;
        let of_model = system.conditions.iter().map(|c| ParamCondition {
            text: c.text.clone(),
            meaning: String::new(),
            greater: c.greater,
            less: c.less,
            relation: c.relation,
            is_rounded: false,
        });
        let mut conditions: Vec<ParamCondition> = of_model.collect();
        let pivots = sorted_pivots(graph, equations);
        conditions.extend(pivots.conditions);
        let left_out: BTreeSet<SymbolId> =
            system.algebroid.base().iter().filter(|x| !state.contains(x)).copied().collect();
        let rates: Vec<ExprId> = rates.results.iter().map(|(_, rate)| *rate).collect();
        let domain = domain(graph, equations, &rates, &left_out);
        conditions.extend(domain.conditions);
        Guards { conditions, divisors: pivots.divisors, pivots: pivots.moving, domain: domain.moving }
    }
}

/// The rates of a state, as a function.
pub(super) fn rates_of(state: &[StateEquation]) -> Request {
    let results = state.iter().map(|s| (s.name.clone(), s.derivative)).collect();
    Request { role: Role::Rate, results }
}

/// What a scene with this state gets from outside, before it asks for more than rates.
pub(super) fn inputs_of(equations: &Equations, state: &[StateEquation]) -> Inputs {
    let system = &equations.system;
    let mut arguments = BTreeMap::new();
    if !equations.legendre.momenta.is_empty() {
        let velocities = equations.legendre.velocities.iter().map(|(_, symbol)| *symbol).collect();
        arguments.insert(legendre_role(), velocities);
    }
    Inputs {
        params: system.params.iter().map(|p| p.symbol).collect(),
        time: system.time,
        held: system.inputs.iter().map(|input| (input.symbol, input.default.clone())).collect(),
        state: state.iter().map(|s| s.symbol).collect(),
        signs: system.signs.clone(),
        arguments,
        divisors: lower::Divisors::default(),
        circles: system.circles.iter().map(|c| [c.cosine, c.sine]).collect(),
        sampling: None,
    }
}

impl From<Arc<Equations>> for Derived {
    fn from(equations: Arc<Equations>) -> Derived {
        Derived { equations, by_cost: false, searched: Arc::default() }
    }
}

impl Derived {
    /// The rates of a state in the form that costs least, searched in the graph of the equations by whoever asks first.
    pub(super) fn searched(&self, state: &[StateEquation]) -> Result<Arc<Searched>, Error> {
        let asked = rates_of(state);
        let cell = {
            let mut searched = self.searched.lock().unwrap_or_else(PoisonError::into_inner);
            match searched.iter().find(|(known, _)| *known == asked) {
                Some((_, cell)) => Arc::clone(cell),
                None => {
                    let cell = Arc::default();
                    searched.push((asked.clone(), Arc::clone(&cell)));
                    cell
                }
            }
        };
        cell.get_or_init(|| self.search(state, asked).map(Arc::new)).clone()
    }

    fn search(&self, state: &[StateEquation], asked: Request) -> Result<Searched, Error> {
        let equations = &*self.equations;
        let mut graph = equations.system.graph.clone();
        graph.enter(Stage::Lowering);
        let mut inputs = inputs_of(equations, state);
        let guards = Guards::of(&mut graph, equations, &asked, &inputs.state);
        inputs.divisors = guards.divisors.clone();
        let conditions = &guards.conditions;
        let results = asked.results.iter().map(|(_, e)| *e);
        let roots: Vec<ExprId> = results.chain(conditions.iter().flat_map(|c| [c.greater, c.less])).collect();
        let sections = needed_sections(&graph, &equations.sections, &roots);
        let budget = SearchBudget::default();
        let rates = lower::search_rates(&mut graph, &inputs, &sections, conditions, asked, &budget)?;
        Ok(Searched { graph, rates, guards })
    }
}
