//! Lie algebroids in a local frame, with coefficients that are expressions on the base.

use std::collections::BTreeMap;

use super::skew::{Bracket, SkewBracket};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Number, Style, SymbolId, Vanishing};

/// A Lie algebroid in coordinates `x^i` and a frame `e_alpha` that may move with time:
/// `rho(e_alpha) = rho^i_alpha d/dx^i`, `[e_alpha, e_beta] = C^gamma_{alpha beta} e_gamma`,
/// `[d/dt, e_alpha] = N^gamma_alpha e_gamma`.
///
/// The drift `N` of the frame is the bracket with one more section, `d/dt`, along which every motion has the velocity
/// one. It vanishes where the frame does not depend on time.
///
/// # Shapes
/// anchor: `[n_base][rank]`; bracket: sparse, pairs `alpha < beta`; drift: sparse, by `alpha`.
///
/// # Source
/// Cortes, de Leon, Marrero, Martinez 2009, section 2.1.
#[derive(Clone, Debug)]
pub struct Algebroid {
    time: SymbolId,
    base: Vec<SymbolId>,
    frame: Vec<String>,
    anchor: Vec<Vec<ExprId>>,
    bracket: BTreeMap<(usize, usize), Vec<(usize, ExprId)>>,
    drift: BTreeMap<usize, Vec<(usize, ExprId)>>,
    is_almost: bool,
}

impl Algebroid {
    /// An algebroid with zero anchor, bracket and drift, to be filled in by a front end.
    pub fn new(g: &Graph, time: SymbolId, base: Vec<SymbolId>, frame: Vec<String>) -> Algebroid {
        let anchor = vec![vec![g.zero(); frame.len()]; base.len()];
        Algebroid {
            time,
            base,
            frame,
            anchor,
            bracket: BTreeMap::new(),
            drift: BTreeMap::new(),
            is_almost: false,
        }
    }

    /// Says that the bracket is not claimed to be that of a Lie algebroid: nothing is asked of it but antisymmetry.
    pub fn set_almost(&mut self, is_almost: bool) {
        self.is_almost = is_almost;
    }

    /// Whether the bracket is not claimed to be that of a Lie algebroid.
    pub fn is_almost(&self) -> bool {
        self.is_almost
    }

    /// Number of base coordinates.
    pub fn n_base(&self) -> usize {
        self.base.len()
    }

    /// Rank, the number of frame sections.
    pub fn rank(&self) -> usize {
        self.frame.len()
    }

    /// The time.
    pub fn time(&self) -> SymbolId {
        self.time
    }

    /// The base coordinates.
    pub fn base(&self) -> &[SymbolId] {
        &self.base
    }

    /// Adds base coordinates that no section moves.
    pub fn extend_base(&mut self, g: &Graph, symbols: impl IntoIterator<Item = SymbolId>) {
        let before = self.base.len();
        self.base.extend(symbols);
        let row = vec![g.zero(); self.frame.len()];
        self.anchor.extend(vec![row; self.base.len() - before]);
    }

    /// Names of the frame sections.
    pub fn frame(&self) -> &[String] {
        &self.frame
    }

    /// Gives the frame sections other names, one each.
    pub fn rename_frame(&mut self, frame: Vec<String>) {
        self.frame = frame;
    }

    /// `rho^i_alpha`.
    pub fn anchor(&self, i: usize, alpha: usize) -> ExprId {
        self.anchor[i][alpha]
    }

    /// Sets `rho^i_alpha`.
    pub fn set_anchor(&mut self, i: usize, alpha: usize, value: ExprId) {
        self.anchor[i][alpha] = value;
    }

    /// `[e_alpha, e_beta]` as a sparse vector.
    pub fn bracket(&self, g: &mut Graph, alpha: usize, beta: usize) -> Vec<(usize, ExprId)> {
        if alpha <= beta {
            self.bracket.get(&(alpha, beta)).cloned().unwrap_or_default()
        } else {
            let reversed = self.bracket(g, beta, alpha);
            reversed.into_iter().map(|(c, e)| (c, g.neg(e))).collect()
        }
    }

    /// Sets `[e_alpha, e_beta]` for `alpha < beta`.
    ///
    /// # Panics
    /// When `alpha >= beta`.
    pub fn set_bracket(&mut self, alpha: usize, beta: usize, value: Vec<(usize, ExprId)>) {
        assert!(alpha < beta, "brackets are stored for ordered pairs");
        self.bracket.insert((alpha, beta), value);
    }

    /// Every coefficient of anchor, bracket and drift.
    pub fn coefficients_mut(&mut self) -> Vec<&mut ExprId> {
        let Algebroid { time: _, base: _, frame: _, anchor, bracket, drift, is_almost: _ } = self;
        let brackets = bracket.values_mut().chain(drift.values_mut()).flatten().map(|(_, e)| e);
        anchor.iter_mut().flatten().chain(brackets).collect()
    }

    /// `[d/dt, e_alpha]` as a sparse vector; empty when the section does not depend on time.
    pub fn drift(&self, alpha: usize) -> &[(usize, ExprId)] {
        self.drift.get(&alpha).map_or(&[], Vec::as_slice)
    }

    /// Sets `[d/dt, e_alpha]`.
    pub fn set_drift(&mut self, alpha: usize, value: Vec<(usize, ExprId)>) {
        self.drift.insert(alpha, value);
    }

    /// Whether a section of the frame depends on time.
    pub fn has_drift(&self) -> bool {
        self.drift.values().any(|value| !value.is_empty())
    }

    /// What changes a momentum, along the section `alpha`: `rho^i_alpha dL/dx^i + F_alpha + (N^gamma_alpha -
    /// C^gamma_{alpha beta} y^beta)
    /// p_gamma`, by the force `F_alpha`, the velocities `y`, the momenta `p` and the slopes `dL/dx`.
    ///
    /// # Shapes
    /// `y`, `momentum`: one per section, `slopes`: one per base coordinate.
    ///
    /// # Source
    /// Cortes, de Leon, Marrero, Martinez 2009, equation (3.5).
    pub fn net_force(
        &self,
        g: &mut Graph,
        (alpha, force): (usize, ExprId),
        y: &[ExprId],
        momentum: &[ExprId],
        slopes: &[ExprId],
    ) -> ExprId {
        let mut terms = vec![force];
        for (i, slope) in slopes.iter().enumerate() {
            terms.push(g.mul(self.anchor(i, alpha), *slope));
        }
        for (beta, y) in y.iter().enumerate() {
            for (gamma, c) in self.bracket(g, alpha, beta) {
                let term = g.product(&[c, *y, momentum[gamma]]);
                terms.push(g.neg(term));
            }
        }
        for (gamma, n) in self.drift(alpha) {
            terms.push(g.mul(*n, momentum[*gamma]));
        }
        g.sum(&terms)
    }

    /// The derivative of a function along a section: `rho^i_alpha df/dx^i`.
    pub fn derivative_along(&self, g: &mut Graph, alpha: usize, f: ExprId) -> ExprId {
        if g.as_number(f).is_some() {
            return g.zero();
        }
        let mut terms = Vec::new();
        for i in 0..self.n_base() {
            if self.anchor[i][alpha] == g.zero() {
                continue;
            }
            let d = g.diff(f, self.base[i]);
            terms.push(g.mul(self.anchor[i][alpha], d));
        }
        g.sum(&terms)
    }

    /// The rates of the base coordinates along a section, those that move: all terms of a derivative along it at once,
    /// where nobody reads the result.
    fn rates_along(&self, g: &Graph, alpha: usize) -> BTreeMap<SymbolId, ExprId> {
        let rates = self.base.iter().zip(&self.anchor).map(|(x, row)| (*x, row[alpha]));
        rates.filter(|(_, rate)| *rate != g.zero()).collect()
    }

    /// Verifies the anchor condition and Jacobi identity on the symbolic data:
    /// `rho^j_a d_j rho^i_b - rho^j_b d_j rho^i_a = rho^i_c C^c_ab` and
    /// `sum over cyclic (a, b, c) of (rho^i_a d_i C^d_bc + C^e_bc C^d_ae) = 0`, both also with `d/dt` for one of the
    /// sections. An almost algebroid is not asked for them.
    ///
    /// # Errors
    /// [`Error::AnchorViolated`] or [`Error::JacobiViolated`], every offender; [`Error::Unverified`] of what is not
    /// proved.
    pub fn verify(&self, g: &mut Graph) -> Result<(), Vec<Error>> {
        if self.is_almost {
            return Ok(());
        }
        let mut errors = Vec::new();
        let m = self.rank();
        let mut commutes = vec![true; m * m];
        for (a, b) in self.bracket.keys() {
            commutes[a * m + b] = false;
        }
        let is_lie = self.is_of_a_lie_algebra(g);
        let rates: Vec<BTreeMap<SymbolId, ExprId>> = (0..m).map(|a| self.rates_along(g, a)).collect();
        let is_constant: Vec<bool> =
            (0..m).map(|a| self.anchor.iter().all(|row| g.as_number(row[a]).is_some())).collect();
        for a in 0..m {
            self.verify_drift_of_anchor(g, a, &mut errors);
            for b in a + 1..m {
                g.charge(self.n_base() + (m - b) / 16);
                if g.within_budget().is_err() {
                    // The caller finds it in the graph.
                    return Ok(());
                }
                errors.extend(self.drift_violation(g, a, b));
                let bracket = self.bracket(g, a, b);
                // Numbers have no derivative: all terms of the condition are zero.
                let is_trivial = is_constant[a] && is_constant[b] && bracket.is_empty();
                let components = if is_trivial { 0 } else { self.n_base() };
                for i in 0..components {
                    let forward = g.derivative_along(self.anchor[i][b], &rates[a]);
                    let backward = g.derivative_along(self.anchor[i][a], &rates[b]);
                    let mut residual = g.sub(forward, backward);
                    for (c, coefficient) in &bracket {
                        let term = g.mul(self.anchor[i][*c], *coefficient);
                        residual = g.sub(residual, term);
                    }
                    let component = g.name(self.base[i]).to_owned();
                    let pair = [a, b].map(|k| self.frame[k].clone());
                    match g.vanishing(residual) {
                        Vanishing::Zero => {}
                        Vanishing::NonZero => {
                            let residual = g.display(residual, Style::Plain);
                            errors.push(Error::AnchorViolated { pair, component, residual });
                        }
                        Vanishing::Unknown => errors.push(Error::Unverified {
                            claim: format!(
                                "that the action of [{0}, {1}] is the commutator of their actions",
                                pair[0], pair[1]
                            ),
                            residual: g.display(residual, Style::Plain),
                            component: Some(component),
                        }),
                    }
                }
                for c in b + 1..m {
                    if is_lie {
                        break;
                    }
                    if commutes[a * m + b] && commutes[b * m + c] && commutes[a * m + c] {
                        continue;
                    }
                    errors.extend(self.jacobi_violation(g, [a, b, c]));
                }
            }
        }
        if errors.is_empty() { Ok(()) } else { Err(errors) }
    }

    /// Whether the brackets are known to be those of a Lie algebra: numbers in closed form that satisfy the Jacobi
    /// identity, which says the same of an algebroid where no coefficient has a derivative.
    fn is_of_a_lie_algebra(&self, g: &mut Graph) -> bool {
        let mut brackets: Vec<Bracket<Number>> = Vec::with_capacity(self.bracket.len());
        for ((a, b), value) in &self.bracket {
            let numbers: Option<Vec<(usize, Number)>> =
                value.iter().map(|(c, e)| Some((*c, g.as_number(*e)?))).collect();
            let Some(numbers) = numbers else { return false };
            brackets.push((*a, *b, numbers));
        }
        g.charge(self.rank() * brackets.len());
        let bracket = SkewBracket::new(self.frame.clone(), &brackets);
        bracket.is_ok_and(|bracket| bracket.jacobi_violations().is_empty())
    }

    fn jacobi_violation(&self, g: &mut Graph, triple: [usize; 3]) -> Option<Error> {
        let mut residual: BTreeMap<usize, ExprId> = BTreeMap::new();
        let [a, b, c] = triple;
        for (x, y, z) in [(a, b, c), (b, c, a), (c, a, b)] {
            for (e, inner) in self.bracket(g, y, z) {
                let derivative = self.derivative_along(g, x, inner);
                let mut contributions = vec![(e, derivative)];
                for (d, outer) in self.bracket(g, x, e) {
                    contributions.push((d, g.mul(inner, outer)));
                }
                for (d, term) in contributions {
                    let before = residual.get(&d).copied().unwrap_or(g.zero());
                    residual.insert(d, g.add(before, term));
                }
            }
        }
        let names = triple.map(|k| self.frame[k].clone());
        self.violation(g, names, residual)
    }

    /// `d_t rho^i_a = rho^i_c N^c_a`.
    fn verify_drift_of_anchor(&self, g: &mut Graph, a: usize, errors: &mut Vec<Error>) {
        for i in 0..self.n_base() {
            let mut residual = g.diff(self.anchor[i][a], self.time);
            for (c, coefficient) in self.drift(a) {
                let term = g.mul(self.anchor[i][*c], *coefficient);
                residual = g.sub(residual, term);
            }
            if !g.is_zero(residual) {
                errors.push(Error::AnchorViolated {
                    pair: ["d/dt".to_owned(), self.frame[a].clone()],
                    component: g.name(self.base[i]).to_owned(),
                    residual: g.display(residual, Style::Plain),
                });
            }
        }
    }

    /// `[d/dt, [e_a, e_b]] = [[d/dt, e_a], e_b] + [e_a, [d/dt, e_b]]`:
    /// `d_t C^d_ab + C^c_ab N^d_c = N^c_a C^d_cb - rho_b(N^d_a) + N^c_b C^d_ac + rho_a(N^d_b)`.
    fn drift_violation(&self, g: &mut Graph, a: usize, b: usize) -> Option<Error> {
        let mut residual: BTreeMap<usize, ExprId> = BTreeMap::new();
        let mut add = |g: &mut Graph, d: usize, term: ExprId| {
            let before = residual.get(&d).copied().unwrap_or(g.zero());
            residual.insert(d, g.add(before, term));
        };
        for (c, coefficient) in self.bracket(g, a, b) {
            let rate = g.diff(coefficient, self.time);
            add(g, c, rate);
            for (d, drift) in self.drift(c) {
                let term = g.mul(coefficient, *drift);
                add(g, *d, term);
            }
        }
        // The second section stands still while the first one drifts, and the other way round with the opposite sign.
        for (drifting, other, is_second) in [(a, b, false), (b, a, true)] {
            for (c, drift) in self.drift(drifting) {
                let along = self.derivative_along(g, other, *drift);
                let along = if is_second { g.neg(along) } else { along };
                add(g, *c, along);
                for (d, coefficient) in self.bracket(g, *c, other) {
                    let term = g.mul(*drift, coefficient);
                    let term = if is_second { term } else { g.neg(term) };
                    add(g, d, term);
                }
            }
        }
        self.violation(g, ["d/dt".to_owned(), self.frame[a].clone(), self.frame[b].clone()], residual)
    }

    fn violation(
        &self,
        g: &mut Graph,
        triple: [String; 3],
        residual: BTreeMap<usize, ExprId>,
    ) -> Option<Error> {
        let verdicts: Vec<(usize, ExprId, Vanishing)> =
            residual.into_iter().map(|(d, e)| (d, e, g.vanishing(e))).collect();
        let is_violated = verdicts.iter().any(|(.., verdict)| *verdict == Vanishing::NonZero);
        let offending: Vec<(usize, ExprId)> = verdicts
            .into_iter()
            .filter(|(.., verdict)| *verdict != Vanishing::Zero)
            .map(|(d, e, _)| (d, e))
            .collect();
        if offending.is_empty() {
            return None;
        }
        let spelled: Vec<String> = offending
            .iter()
            .map(|(d, e)| format!("({}) {}", g.display(*e, Style::Plain), self.frame[*d]))
            .collect();
        let residual = spelled.join(" + ");
        if is_violated {
            return Some(Error::JacobiViolated { triple, residual });
        }
        let claim = format!("the Jacobi identity of {}, {} and {}", triple[0], triple[1], triple[2]);
        Some(Error::Unverified { claim, residual, component: None })
    }
}
