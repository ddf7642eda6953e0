//! Operations of definitions as they are written, before lowering looks for common parts.
//!
//! Deliberately does not know: what lowering does, what is computed.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use num_traits::{One, Signed, Zero};

use crate::reduction::{KinematicConstraint, ReducedSystem};
use hamel_expr::error::Error;
use hamel_expr::{
    ExprId, Graph, Node, Rational, Section, SectionWriter, SymbolId, ValueMatrix, Workspace, needed_sections,
};

use super::derive::Derivation;
use super::equations::Equations;
use super::order::work_by_values;

/// Operations behind `roots` on what is `varying`.
pub(super) fn n_operations(
    g: &Graph,
    sections: &[Section],
    varying: &BTreeSet<SymbolId>,
    roots: &[ExprId],
) -> u64 {
    let needed = needed_sections(g, sections, roots);
    let mut all: Vec<ExprId> = needed.iter().flat_map(|s| &s.definitions).map(|d| d.expr).collect();
    all.extend(roots);
    let mut moving: HashSet<ExprId> = HashSet::new();
    let mut n = 0;
    for e in g.reachable(&all) {
        let node = g.node(e);
        let mut moves = matches!(node, Node::Symbol(s) if varying.contains(s));
        node.for_each_operand(|operand| moves |= moving.contains(&operand));
        if !moves {
            continue;
        }
        moving.insert(e);
        let count = |operands: &mut dyn Iterator<Item = (&ExprId, &Rational)>| {
            let moving = operands.filter(|(e, _)| moving.contains(e));
            let (n, n_weighed) =
                moving.fold((0, 0), |(n, weighed), (_, q)| (n + 1, weighed + usize::from(!q.abs().is_one())));
            (n, n + n_weighed)
        };
        // Operands that do not change are one operand.
        n += match node {
            Node::Constant(_) | Node::Pi | Node::Symbol(_) => 0,
            Node::Function(..) | Node::Atan2(..) => 1,
            Node::Sum { constant, terms } => {
                let (n, with_weights) = count(&mut terms.iter().map(|(e, q)| (e, q)));
                with_weights - usize::from(n == terms.len() && constant.is_zero())
            }
            Node::Product { coefficient, factors } => {
                let (n, with_powers) = count(&mut factors.iter().map(|(e, q)| (e, q)));
                with_powers - usize::from(n == factors.len() && coefficient.abs().is_one())
            }
        };
    }
    n as u64
}

/// Operations behind the rates of a system's state, which is derived so far and no further.
///
/// # Errors
/// As [`derive`](super::derive).
pub fn operations_of_motion(system: &ReducedSystem) -> Result<u64, Error> {
    let mut d = Derivation::new(system);
    let motion = d.motion()?;
    d.g.within_budget()?;
    let rates: Vec<ExprId> =
        motion.acceleration.iter().chain(&motion.unknown_rates).chain(&d.rates).copied().collect();
    Ok(d.n_operations(&rates))
}

/// Operations behind the rates of a system that is multiplied out, as far as its mass matrix `W^T L_yy Psi` shows them
/// before anything is derived: the operations of its factors, from the last row to the first. Zero where values of the
/// matrix say nothing.
pub fn operations_of_factors(system: &ReducedSystem) -> u64 {
    let KinematicConstraint::Solved(solved) = &system.constraint else { return 0 };
    let sides = (solved.virtual_displacements.as_slice(), solved.psi.as_slice());
    let matrix = mass_matrix_by_values(&mut system.graph.clone(), system, sides);
    matrix.map_or(0, |matrix| work_by_values(&matrix))
}

/// `left^T L_yy right` by values, with what changes along the motion of the coordinates.
pub(super) fn mass_matrix_by_values(
    g: &mut Graph,
    system: &ReducedSystem,
    sides: (&[Vec<ExprId>], &[Vec<ExprId>]),
) -> Option<ValueMatrix> {
    let algebroid = &system.algebroid;
    let mut rates = BTreeMap::from([(system.time, g.one())]);
    for (i, x) in algebroid.base().iter().enumerate() {
        let moving = (0..algebroid.rank()).filter(|alpha| algebroid.anchor(i, *alpha) != g.zero());
        let terms: Vec<(usize, SymbolId)> = moving.map(|alpha| (alpha, system.velocities[alpha])).collect();
        let terms: Vec<ExprId> = (terms.into_iter())
            .map(|(alpha, y)| {
                let y = g.sym(y);
                g.mul(algebroid.anchor(i, alpha), y)
            })
            .collect();
        rates.insert(*x, g.sum(&terms));
    }
    g.second_derivatives(system.lagrangian, &system.velocities, sides, &rates)
}

/// Ways of deriving are told apart by the definitions that they write.
impl Workspace for Derivation<'_> {
    type State = (Graph, SectionWriter);

    fn state(&self) -> (Graph, SectionWriter) {
        (self.g.clone(), self.writer.clone())
    }

    fn put_back(&mut self, (graph, writer): (Graph, SectionWriter)) {
        let spent = std::mem::replace(&mut self.g, graph);
        self.g.take_over(&spent);
        self.writer = writer;
    }
}

impl Derivation<'_> {
    /// Operations behind these values.
    pub(super) fn n_operations(&self, roots: &[ExprId]) -> u64 {
        let (sections, varying) = self.writer.clone().finish();
        n_operations(&self.g, &sections, &varying, roots)
    }
}

impl Equations {
    /// Operations behind `roots`, which are written with definitions of the equations and `further` ones.
    pub fn n_operations_with(&self, g: &Graph, further: &[Section], roots: &[ExprId]) -> u64 {
        let mut varying = self.varying.clone();
        for definition in further.iter().flat_map(|section| &section.definitions) {
            if g.depends_on(definition.expr, &varying) {
                varying.insert(definition.symbol);
            }
        }
        let sections = [self.sections.as_slice(), further].concat();
        n_operations(g, &sections, &varying, roots)
    }

    /// Operations behind the rates of the state.
    pub fn n_operations(&self) -> u64 {
        let rates: Vec<ExprId> = self.state.iter().map(|s| s.derivative).collect();
        n_operations(&self.system.graph, &self.sections, &self.varying, &rates)
    }
}
