//! Components of velocities of points and bodies: their slopes, and how they turn with the frame.
//!
//! Deliberately does not know: which components make a square.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::Zero;

use crate::reduction::ReducedSystem;
use hamel_expr::{ExprId, Graph, Node, Partials, SymbolId};

/// A component of a velocity, affine in the velocities of the system.
#[derive(Clone, Debug)]
pub(super) struct Component {
    /// In the raw velocities.
    pub(super) value: ExprId,
    /// `v_alpha`.
    pub(super) slopes: Vec<ExprId>,
    /// Whether there is a `v_0`.
    pub(super) has_offset: bool,
    /// `rho_beta(v_alpha) - rho_alpha(v_beta) + C^gamma_{alpha beta} v_gamma` for `alpha < beta`, by `beta` and
    /// `alpha`.
    pub(super) torsion: Vec<Vec<ExprId>>,
    /// Whether some of the torsion is not zero.
    pub(super) has_torsion: bool,
}

/// Finds the components of a system.
pub(super) struct Components<'a> {
    system: &'a ReducedSystem,
    /// The coordinates that each section of the frame moves, with their rates.
    movers: Vec<Vec<(SymbolId, ExprId)>>,
    partials: Partials,
    /// Whether velocities met as parts of sums have no torsion.
    are_straight: BTreeMap<ExprId, bool>,
}

impl<'a> Components<'a> {
    pub(super) fn new(g: &Graph, system: &'a ReducedSystem) -> Components<'a> {
        let algebroid = &system.algebroid;
        let of_section = |alpha: usize| {
            let rates = algebroid.base().iter().enumerate().map(|(i, x)| (*x, algebroid.anchor(i, alpha)));
            rates.filter(|(_, rate)| *rate != g.zero()).collect()
        };
        let movers = (0..algebroid.rank()).map(of_section).collect();
        Components { system, movers, partials: Partials::default(), are_straight: BTreeMap::new() }
    }

    /// None where the value is not affine in the velocities, or changes with time other than with the frame:
    /// `dv_alpha/dt = N^gamma_alpha v_gamma`, which is the torsion with `d/dt`.
    pub(super) fn find(&mut self, g: &mut Graph, value: ExprId) -> Option<Component> {
        let algebroid = &self.system.algebroid;
        let time = self.system.time;
        let (slopes, offset) = g.affine_parts_by(&mut self.partials, value, &self.system.velocities)?;
        let mut apart = vec![self.partials.diff(g, offset, time)];
        for (alpha, slope) in slopes.iter().enumerate() {
            let mut rate = self.partials.diff(g, *slope, time);
            for (gamma, n) in algebroid.drift(alpha) {
                let carried = g.mul(*n, slopes[*gamma]);
                rate = g.sub(rate, carried);
            }
            apart.push(rate);
        }
        if apart.into_iter().any(|rate| !g.is_zero(rate)) {
            return None;
        }
        for alpha in 0..algebroid.rank() {
            let along = algebroid.derivative_along(g, alpha, offset);
            if !g.is_zero(along) {
                return None;
            }
        }
        let zero = g.zero();
        let mut torsion: Vec<Vec<ExprId>> = (0..algebroid.rank()).map(|beta| vec![zero; beta]).collect();
        let mut has_torsion = false;
        if !self.is_sum_of_straight(g, value) {
            self.torsion(g, &slopes, |beta, alpha, e| {
                torsion[beta][alpha] = e;
                has_torsion |= e != zero;
                true
            });
        }
        Some(Component { value, slopes, has_offset: offset != zero, torsion, has_torsion })
    }

    /// Visits the torsion of a velocity by its slopes, where it is not zero at sight, as long as the visitor goes on.
    fn torsion(
        &mut self,
        g: &mut Graph,
        slopes: &[ExprId],
        mut visit: impl FnMut(usize, usize, ExprId) -> bool,
    ) {
        let algebroid = &self.system.algebroid;
        let (partials, movers) = (&mut self.partials, &self.movers);
        // Of a chain most slopes mention nothing that moves.
        let mentioned: Vec<BTreeSet<SymbolId>> = slopes.iter().map(|e| g.free_symbols(*e)).collect();
        let mut along = |g: &mut Graph, section: usize, of: usize| {
            let mut terms = Vec::new();
            for (x, rate) in movers[section].iter().filter(|(x, _)| mentioned[of].contains(x)) {
                let slope = partials.diff(g, slopes[of], *x);
                terms.push(g.mul(*rate, slope));
            }
            if terms.is_empty() { g.zero() } else { g.sum(&terms) }
        };
        let zero = g.zero();
        for beta in 0..slopes.len() {
            for alpha in 0..beta {
                let forward = along(g, beta, alpha);
                let backward = along(g, alpha, beta);
                let bracket = algebroid.bracket(g, alpha, beta);
                if forward == zero && backward == zero && bracket.is_empty() {
                    continue;
                }
                let mut terms = vec![forward, g.neg(backward)];
                for (gamma, c) in bracket {
                    terms.push(g.mul(c, slopes[gamma]));
                }
                let sum = g.sum(&terms);
                let sum = g.cancel_zero(sum);
                if !visit(beta, alpha, sum) {
                    return;
                }
            }
        }
    }

    /// Whether a velocity is a sum of velocities without torsion: torsion is linear, and the sum has none, either.
    /// Points of a chain in the plane have a part for each body before them, and share these parts.
    fn is_sum_of_straight(&mut self, g: &mut Graph, value: ExprId) -> bool {
        let Node::Sum { constant, terms } = g.node(value) else { return false };
        if !constant.is_zero() {
            return false;
        }
        let parts: Vec<ExprId> = terms.iter().map(|(e, _)| *e).collect();
        parts.into_iter().all(|part| self.is_straight(g, part))
    }

    fn is_straight(&mut self, g: &mut Graph, value: ExprId) -> bool {
        if let Some(known) = self.are_straight.get(&value) {
            return *known;
        }
        let parts = g.affine_parts_by(&mut self.partials, value, &self.system.velocities);
        let is_straight = parts.is_some_and(|(slopes, _)| {
            let zero = g.zero();
            let mut is_straight = true;
            self.torsion(g, &slopes, |_, _, e| {
                is_straight = e == zero;
                is_straight
            });
            is_straight
        });
        self.are_straight.insert(value, is_straight);
        is_straight
    }
}

impl Component {
    pub(super) fn times(&self, g: &mut Graph, factor: ExprId) -> Component {
        Component {
            value: g.mul(factor, self.value),
            slopes: self.slopes.iter().map(|e| g.mul(factor, *e)).collect(),
            torsion: self.torsion.iter().map(|row| row.iter().map(|e| g.mul(factor, *e)).collect()).collect(),
            ..*self
        }
    }
}
