//! Lie algebroids in a local frame, with coefficients that are expressions on the base.

use std::collections::BTreeMap;

use crate::error::Error;
use crate::expr::{ExprId, Graph, Style, SymbolId};

/// A Lie algebroid in coordinates `x^i` and a frame `e_alpha`:
/// `rho(e_alpha) = rho^i_alpha d/dx^i`, `[e_alpha, e_beta] = C^gamma_{alpha beta} e_gamma`.
///
/// # Shapes
/// anchor: `[n_base][rank]`; bracket: sparse, pairs `alpha < beta`.
///
/// # Source
/// Cortes, de Leon, Marrero, Martinez 2009, section 2.1.
#[derive(Clone, Debug)]
pub struct Algebroid {
    base: Vec<SymbolId>,
    frame: Vec<String>,
    anchor: Vec<Vec<ExprId>>,
    bracket: BTreeMap<(usize, usize), Vec<(usize, ExprId)>>,
}

impl Algebroid {
    /// An algebroid with zero anchor and bracket, to be filled in by a front end.
    pub fn new(g: &Graph, base: Vec<SymbolId>, frame: Vec<String>) -> Algebroid {
        let anchor = vec![vec![g.zero(); frame.len()]; base.len()];
        Algebroid { base, frame, anchor, bracket: BTreeMap::new() }
    }

    /// Number of base coordinates.
    pub fn n_base(&self) -> usize {
        self.base.len()
    }

    /// Rank, the number of frame sections.
    pub fn rank(&self) -> usize {
        self.frame.len()
    }

    /// The base coordinates.
    pub fn base(&self) -> &[SymbolId] {
        &self.base
    }

    /// Names of the frame sections.
    pub fn frame(&self) -> &[String] {
        &self.frame
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

    /// The derivative of a function along a section: `rho^i_alpha df/dx^i`.
    pub fn derivative_along(&self, g: &mut Graph, alpha: usize, f: ExprId) -> ExprId {
        if g.as_rational(f).is_some() {
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

    /// Verifies the anchor condition and Jacobi identity on the symbolic data:
    /// `rho^j_a d_j rho^i_b - rho^j_b d_j rho^i_a = rho^i_c C^c_ab` and
    /// `sum over cyclic (a, b, c) of (rho^i_a d_i C^d_bc + C^e_bc C^d_ae) = 0`.
    ///
    /// # Errors
    /// [`Error::AnchorViolated`] or [`Error::JacobiViolated`], every offender.
    pub fn verify(&self, g: &mut Graph) -> Result<(), Vec<Error>> {
        let mut errors = Vec::new();
        let m = self.rank();
        let mut commutes = vec![true; m * m];
        for (a, b) in self.bracket.keys() {
            commutes[a * m + b] = false;
        }
        for a in 0..m {
            for b in a + 1..m {
                g.charge(self.n_base() + (m - b) / 16);
                if g.within_budget().is_err() {
                    // The caller finds it in the graph.
                    return Ok(());
                }
                let bracket = self.bracket(g, a, b);
                for i in 0..self.n_base() {
                    let forward = self.derivative_along(g, a, self.anchor[i][b]);
                    let backward = self.derivative_along(g, b, self.anchor[i][a]);
                    let mut residual = g.sub(forward, backward);
                    for (c, coefficient) in &bracket {
                        let term = g.mul(self.anchor[i][*c], *coefficient);
                        residual = g.sub(residual, term);
                    }
                    if !g.is_zero(residual) {
                        errors.push(Error::AnchorViolated {
                            pair: [a, b].map(|k| self.frame[k].clone()),
                            component: g.name(self.base[i]).to_owned(),
                            residual: g.display(residual, Style::Plain),
                        });
                    }
                }
                for c in b + 1..m {
                    if commutes[a * m + b] && commutes[b * m + c] && commutes[a * m + c] {
                        continue;
                    }
                    errors.extend(self.jacobi_violation(g, [a, b, c]));
                }
            }
        }
        if errors.is_empty() { Ok(()) } else { Err(errors) }
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
        let offending: Vec<(usize, ExprId)> = residual.into_iter().filter(|(_, e)| !g.is_zero(*e)).collect();
        if offending.is_empty() {
            return None;
        }
        let spelled: Vec<String> = offending
            .iter()
            .map(|(d, e)| format!("({}) {}", g.display(*e, Style::Plain), self.frame[*d]))
            .collect();
        Some(Error::JacobiViolated {
            triple: triple.map(|k| self.frame[k].clone()),
            residual: spelled.join(" + "),
        })
    }
}
