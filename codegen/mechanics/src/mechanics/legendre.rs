//! Momenta as state: velocities from momenta (the Legendre transform of a Lagrangian that is quadratic in the
//! velocities), and the momentum equation.
//!
//! Does not know: which velocities have momenta in their place, and why.

use std::collections::{BTreeMap, BTreeSet};

use crate::reduction::{CarriedMomentum, KinematicConstraint};
use hamel_expr::error::Error;
use hamel_expr::{Definition, ExprId, Graph, Style, SymbolId, inlined, needed_sections, primitive};
use hamel_lang::spec::Want;

use super::derive::{Derivation, Motion, Transform};
use super::equations::{Equations, Legendre, Output};
use super::limits::MAX_LENGTH;
use super::solve::Factorisation;

/// Longest functions that help shows.
const MAX_FUNCTION: usize = 80;

impl Derivation<'_> {
    /// The velocities whose momenta are carried: of the unknowns `u = (u_M, u_V)` those of `u_M` solve
    /// `A_MM u_M = pi_M - A_MV u_V - W_M^T dL/dy(psi0)`, `A = W^T L_yy Psi`.
    ///
    /// # Errors
    /// [`Error::NotQuadratic`], [`Error::Unsupported`] for virtual displacements that depend on velocities.
    pub(super) fn legendre(&mut self) -> Result<Option<Transform>, Error> {
        let system = self.system;
        if system.momenta.is_empty() {
            return Ok(None);
        }
        let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
        self.hessian()?;
        let free = self.hessian.iter().flatten().flat_map(|e| self.g.free_symbols(*e));
        if let Some(velocity) = free.into_iter().find(|symbol| velocities.contains(symbol)) {
            return Err(Error::NotQuadratic { velocity: self.g.name(velocity).to_owned() });
        }
        let carried: Vec<usize> = system.momenta.iter().map(|m| m.unknown).collect();
        let unknowns: Vec<String> = system.unknowns.iter().map(|u| u.name.clone()).collect();
        let (matrix, name) = match &system.constraint {
            KinematicConstraint::Multipliers { .. } => (self.hessian.clone(), "M"),
            KinematicConstraint::Solved(solved) => {
                let displacements = solved.virtual_displacements.iter().flatten();
                if displacements.into_iter().any(|e| self.g.depends_on(*e, &velocities)) {
                    return Err(Error::Unsupported {
                        what: "momenta along virtual displacements that depend on velocities".into(),
                        possible: "velocities as state; remove `carry`".into(),
                    });
                }
                (self.mass_matrix(solved)?, "A")
            }
        };
        self.writer.begin(&format!("factors of {name}"));
        let (g, writer, signs) = (&mut self.g, &mut self.writer, &system.signs);
        let factors = Factorisation::new(g, writer, name, &matrix, &unknowns, signs, &carried)?;
        self.writer.begin("velocities of the momenta pi = W^T dL/dy");
        let mut right = vec![self.g.zero(); unknowns.len()];
        for (momentum, b) in system.momenta.iter().zip(&carried) {
            let mut terms = vec![momentum.value];
            for (a, unknown) in system.unknowns.iter().enumerate() {
                if !carried.contains(&a) {
                    let u = self.g.sym(unknown.symbol);
                    let product = self.g.mul(matrix[*b][a], u);
                    terms.push(self.g.neg(product));
                }
            }
            let at_rest = self.momentum_at_rest(*b)?;
            terms.push(self.g.neg(at_rest));
            let sum = self.g.sum(&terms);
            right[*b] = self.define(&format!("q_{}", unknowns[*b]), sum);
        }
        let (g, writer) = (&mut self.g, &mut self.writer);
        let u = factors.solve_leading(g, writer, carried.len(), &unknowns, &right);
        for b in carried {
            let unknown = &system.unknowns[b];
            self.replacement.insert(unknown.symbol, u[b]);
            if let Some(alpha) = unknown.frame_idx {
                self.y[alpha] = u[b];
            }
        }
        Ok(Some(Transform { matrix, factors, n_known: self.writer.definitions().count() }))
    }

    /// `W^a_b dL/dy^a` at `y = psi0`.
    fn momentum_at_rest(&mut self, b: usize) -> Result<ExprId, Error> {
        let system = self.system;
        let mut at_rest = BTreeMap::new();
        for (alpha, velocity) in system.velocities.iter().enumerate() {
            let value = match &system.constraint {
                KinematicConstraint::Multipliers { .. } => self.g.zero(),
                KinematicConstraint::Solved(solved) => solved.psi0[alpha],
            };
            at_rest.insert(*velocity, value);
        }
        let place = || Error::DivisionByZero { place: "the momenta at rest".into() };
        let momentum = self.raw_momentum(b);
        let value = self.g.subs(momentum, &at_rest).map_err(|_| place())?;
        Ok(self.g.cancel_zero(value))
    }

    /// `W^a_b dL/dy^a` in the velocities of the frame.
    fn raw_momentum(&mut self, b: usize) -> ExprId {
        let system = self.system;
        crate::reduction::momentum_of(
            &mut self.g,
            system.lagrangian,
            &system.velocities,
            &system.constraint,
            b,
        )
    }

    /// The carried momentum, by its place, that tells `dL/dy^alpha`: that of an unknown which is this velocity of the
    /// frame, where all others that `W_b` moves with it are not carried.
    pub(super) fn carried_along(&self, alpha: usize) -> Option<usize> {
        let system = self.system;
        let is_carried =
            |beta: usize| system.momenta.iter().any(|m| system.unknowns[m.unknown].frame_idx == Some(beta));
        system.momenta.iter().position(|m| {
            system.unknowns[m.unknown].frame_idx == Some(alpha)
                && match &system.constraint {
                    KinematicConstraint::Multipliers { .. } => true,
                    KinematicConstraint::Solved(solved) => {
                        let column = solved.virtual_displacements.iter().map(|row| row[m.unknown]);
                        column.enumerate().all(|(beta, e)| match beta == alpha {
                            true => e == self.g.one(),
                            false => e == self.g.zero() || !is_carried(beta),
                        })
                    }
                }
        })
    }

    /// `p_alpha = pi_b - sum W^beta_b p_beta` over the others, where the momentum at `place` is carried.
    pub(super) fn momentum_along(&mut self, alpha: usize, place: usize) -> ExprId {
        let carried = &self.system.momenta[place];
        let mut terms = vec![carried.value];
        if let KinematicConstraint::Solved(solved) = &self.system.constraint {
            for (beta, row) in solved.virtual_displacements.iter().enumerate() {
                if beta != alpha && row[carried.unknown] != self.g.zero() {
                    let product = self.g.mul(row[carried.unknown], self.momentum[beta]);
                    terms.push(self.g.neg(product));
                }
            }
        }
        self.g.sum(&terms)
    }

    /// Both ways between what the state carries and the velocities that it stands for: these as an output, the momenta
    /// by them.
    pub(super) fn conversions(&mut self) -> Result<(Legendre, Option<Output>), Error> {
        let system = self.system;
        let solved = match &system.constraint {
            KinematicConstraint::Solved(solved) => Some(solved),
            KinematicConstraint::Multipliers { .. } => None,
        };
        let mut dependent = BTreeMap::new();
        for &alpha in solved.iter().flat_map(|solved| &solved.dependent) {
            let value = solved.map_or(self.g.zero(), |solved| solved.velocity(&mut self.g, alpha));
            dependent.insert(system.velocities[alpha], value);
        }
        let mut legendre = Legendre::default();
        let has_lagrangian = system.hamiltonian.is_none();
        let mut velocities = Vec::new();
        let of_state = system.momenta.iter().filter(|m| m.symbol.is_some() && has_lagrangian);
        let at_level = if of_state.clone().next().is_some() {
            self.velocities_at_level(&dependent)?
        } else {
            BTreeMap::new()
        };
        // Velocities along the levels of stages, by the velocities of the model.
        let along_levels: BTreeMap<SymbolId, ExprId> =
            system.changes.iter().map(|c| (c.symbol, c.value)).collect();
        let mut of_levels: BTreeMap<SymbolId, (String, ExprId)> =
            system.changes.iter().map(|c| (c.symbol, (c.name.clone(), c.value))).collect();
        for carried in of_state {
            let unknown = &system.unknowns[carried.unknown];
            let momentum = self.momentum_by(carried.unknown, &dependent)?;
            let momentum = self.g.subs(momentum, &at_level).map_err(|_| by_velocities())?;
            let momentum = self.g.subs(momentum, &along_levels).map_err(|_| by_velocities())?;
            let momentum = self.g.cancel_zero(momentum);
            if let Some(of_level) = of_levels.get_mut(&unknown.symbol) {
                *of_level = (carried.name.clone(), momentum);
                continue;
            }
            legendre.velocities.push((unknown.name.clone(), unknown.symbol));
            legendre.momenta.push((carried.name.clone(), momentum));
            let velocity = self.g.sym(unknown.symbol);
            velocities.push((unknown.name.clone(), self.replace(velocity)?));
        }
        // The momenta at a level are numbers: a velocity that stands for one is no argument. A Hamiltonian may have no
        // inverse Legendre transform that can be written.
        for carried in system.momenta.iter().filter(|m| m.symbol.is_none() || !has_lagrangian) {
            let unknown = &system.unknowns[carried.unknown];
            let velocity = self.g.sym(unknown.symbol);
            velocities.push((unknown.name.clone(), self.replace(velocity)?));
        }
        // What the state has along the levels of stages, for which the independent velocities of the model are the
        // arguments.
        if let Some(frame) = system.frame.as_ref().filter(|_| !system.changes.is_empty()) {
            let in_order = system.changes.iter().filter_map(|c| of_levels.get(&c.symbol).cloned());
            legendre.momenta.extend(in_order);
            let values = frame.velocities(&mut self.g, &self.y);
            let is_carried = |symbol: SymbolId| system.unknowns.iter().any(|u| u.symbol == symbol);
            for (own, value) in frame.original.iter().zip(values).filter(|(own, _)| !is_carried(own.symbol)) {
                if system.changes.iter().any(|c| self.g.free_symbols(c.value).contains(&own.symbol)) {
                    legendre.velocities.push((own.name.clone(), own.symbol));
                }
                velocities.push((own.name.clone(), value));
            }
        }
        let doc = match system.changes.is_empty() {
            true => {
                "velocities in the place of which the state carries momenta, or that cyclic coordinates have"
            }
            false => "velocities of the model",
        };
        let output = (!velocities.is_empty()).then(|| Output::group(Want::Velocities, velocities, doc));
        Ok((legendre, output))
    }

    /// `dL/dx` at fixed velocities, which is `-dh/dx` at fixed momenta.
    pub(super) fn slopes_by_base(&mut self) -> Result<Vec<ExprId>, Error> {
        let system = self.system;
        let mut slopes = Vec::new();
        for x in system.algebroid.base() {
            let slope = match &system.hamiltonian {
                Some(hamiltonian) => {
                    let slope = self.g.diff(hamiltonian.h, *x);
                    self.g.neg(slope)
                }
                None => self.g.diff(system.lagrangian, *x),
            };
            slopes.push(self.replace(slope)?);
        }
        Ok(slopes)
    }

    /// `W^a_b dL/dy^a` with the velocities that the constraints determine by the others.
    fn momentum_by(&mut self, b: usize, dependent: &BTreeMap<SymbolId, ExprId>) -> Result<ExprId, Error> {
        let raw = self.raw_momentum(b);
        self.g.subs(raw, dependent).map_err(|_| by_velocities())
    }

    /// The velocities whose momenta are parameters, by the other velocities: they solve
    /// `A_LL u_L = pi_L - A_LR u_R - ..`, which is written out, because nothing but the momenta by velocities needs it.
    fn velocities_at_level(
        &mut self,
        dependent: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<BTreeMap<SymbolId, ExprId>, Error> {
        let system = self.system;
        let levels: Vec<_> = system.momenta.iter().filter(|m| m.symbol.is_none()).collect();
        let symbols: Vec<SymbolId> = levels.iter().map(|m| system.unknowns[m.unknown].symbol).collect();
        let at_rest: BTreeMap<SymbolId, ExprId> = symbols.iter().map(|s| (*s, self.g.zero())).collect();
        let (mut matrix, mut right) = (Vec::new(), Vec::new());
        for level in &levels {
            let momentum = self.momentum_by(level.unknown, dependent)?;
            matrix.push(symbols.iter().map(|s| self.g.diff(momentum, *s)).collect::<Vec<ExprId>>());
            let rest = self.g.subs(momentum, &at_rest).map_err(|_| by_velocities())?;
            let difference = self.g.sub(level.value, rest);
            right.push(vec![self.g.cancel_zero(difference)]);
        }
        let solution = hamel_lang::algebra::solve_symmetric(&mut self.g, &matrix, &right)
            .map_err(|_| by_velocities())?;
        Ok(symbols.into_iter().zip(solution.into_iter().map(|row| row[0])).collect())
    }

    /// The momentum equation of everything that is carried:
    /// `d/dt pi_b = W^a_b ((N - C y) p + rho dL/dx + F + sum_A lambda_A form_A)_a + (dW^a_b/dt) p_a`.
    ///
    /// # Errors
    /// [`Error::NotCyclic`] for a momentum that is a parameter and moves.
    ///
    /// # Source
    /// Cortes, de Leon, Marrero, Martinez 2009, equation (5.6); Bloch, Krishnaprasad, Marsden, Murray 1996.
    pub(super) fn momentum_rates(&mut self, motion: &Motion) -> Result<Vec<ExprId>, Error> {
        let system = self.system;
        if system.momenta.is_empty() {
            return Ok(Vec::new());
        }
        self.writer.begin("momentum equation");
        let slopes = self.slopes_by_base()?;
        let momentum = self.momentum.clone();
        let mut net: Vec<Option<ExprId>> = vec![None; self.y.len()];
        let mut rates = Vec::new();
        for carried in &system.momenta {
            let mut terms = Vec::new();
            for alpha in 0..self.y.len() {
                let w = match &system.constraint {
                    KinematicConstraint::Multipliers { .. } if alpha == carried.unknown => self.g.one(),
                    KinematicConstraint::Multipliers { .. } => continue,
                    KinematicConstraint::Solved(solved) => {
                        solved.virtual_displacements[alpha][carried.unknown]
                    }
                };
                if w == self.g.zero() {
                    continue;
                }
                let force = match net[alpha] {
                    Some(known) => known,
                    None => {
                        let applied = self.applied_force(alpha, &momentum, &slopes)?;
                        let name = format!("net_{}", self.names[alpha]);
                        let named = self.define(&name, applied);
                        net[alpha] = Some(named);
                        named
                    }
                };
                terms.push(self.g.mul(w, force));
                let turning = self.drift(w)?;
                terms.push(self.g.mul(turning, momentum[alpha]));
                if let KinematicConstraint::Multipliers { .. } = &system.constraint {
                    for (form, (_, lambda)) in motion.reactions.iter().zip(&motion.multipliers) {
                        terms.push(self.g.mul(form[alpha], *lambda));
                    }
                }
            }
            let sum = self.g.sum(&terms);
            let rate = self.g.cancel_zero(sum);
            if carried.symbol.is_none() {
                self.check_conserved(carried, rate)?;
            }
            rates.push(rate);
        }
        if let KinematicConstraint::Solved(_) = &system.constraint
            && let Some(shorter) = self.multiplied_out(&rates)
        {
            rates = shorter;
        }
        let named = system.momenta.iter().zip(rates);
        Ok(named.map(|(carried, rate)| self.define(&format!("dot_{}", carried.name), rate)).collect())
    }

    /// `d/dt dL/dy = df/dt` for a momentum that is a parameter up to `f`.
    ///
    /// # Errors
    /// [`Error::NotCyclic`], with a function that it is a parameter up to where one is found.
    fn check_conserved(&mut self, carried: &CarriedMomentum, rate: ExprId) -> Result<(), Error> {
        let drift = self.drift(carried.value)?;
        let excess = self.g.sub(rate, drift);
        if self.g.is_zero(excess) {
            return Ok(());
        }
        let system = self.system;
        let velocity = system.unknowns[carried.unknown].name.clone();
        let excess = self.spelled_out(excess);
        let reason = format!("its rate is {excess}");
        let named = carried.cyclic.map(|u| self.g.name(u).to_owned()).unwrap_or_else(|| velocity.clone());
        let up_to = self.up_to(rate).map(|f| format!("routh {named} = {} up to {f};", carried.name));
        Err(Error::NotCyclic { velocity, parameter: carried.name.clone(), reason, up_to })
    }

    /// A function of the base with a rate, as text.
    fn up_to(&mut self, rate: ExprId) -> Option<String> {
        let system = self.system;
        let definitions: Vec<Definition> = self.writer.definitions().copied().collect();
        let values = inlined(&mut self.g, &definitions);
        let base = system.algebroid.base().iter().copied();
        let spelled: Vec<ExprId> = [rate].into_iter().chain(self.rates.iter().copied()).collect();
        let whole = self.g.subs_all(&spelled, &values).ok()?;
        let moving: BTreeMap<SymbolId, ExprId> = base.zip(whole[1..].iter().copied()).collect();
        let f = primitive(&mut self.g, whole[0], &moving)?;
        let text = self.g.display(f, Style::Plain);
        (text.len() <= MAX_FUNCTION).then_some(text)
    }

    /// Rates as polynomials in momenta and the velocities that these determine, where the terms that cancel then make
    /// them shorter: `p_b = pi_b - W^a_b p_a` brings back much of what `C y p` and `dW/dt` take away.
    fn multiplied_out(&mut self, rates: &[ExprId]) -> Option<Vec<ExprId>> {
        let known = self.transform.as_ref().map_or(0, |transform| transform.n_known);
        let later: Vec<Definition> = self.writer.definitions().skip(known).copied().collect();
        let varying: Vec<Definition> =
            later.into_iter().filter(|d| self.writer.varies(&self.g, d.expr)).collect();
        let values = inlined(&mut self.g, &varying);
        let whole = self.g.subs_all(rates, &values).ok()?;
        let length = |g: &Graph, list: &[ExprId]| -> usize {
            let mut n = 0;
            for e in g.reachable(list) {
                g.node(e).for_each_operand(|_| n += 1);
            }
            n
        };
        let before = length(&self.g, &whole);
        if before > MAX_LENGTH {
            return None;
        }
        let expanded: Vec<ExprId> = whole.iter().map(|e| self.g.expand(*e)).collect();
        if self.g.within_budget().is_err() || length(&self.g, &expanded) >= before {
            return None;
        }
        rates.iter().zip(&expanded).all(|(a, b)| self.g.fingerprints_agree(*a, *b)).then_some(expanded)
    }
}

/// Refuses a cyclic coordinate on which a rate of the state depends.
///
/// # Errors
/// [`Error::NotCyclic`].
pub(super) fn check_cyclic(equations: &Equations) -> Result<(), Error> {
    let system = &equations.system;
    for carried in &system.momenta {
        let Some(coordinate) = carried.cyclic else { continue };
        for state in &equations.state {
            let sections = needed_sections(&system.graph, &equations.sections, &[state.derivative]);
            let definitions = sections.iter().flat_map(|s| &s.definitions).map(|d| d.expr);
            let mut values = definitions.chain([state.derivative]);
            if values.any(|e| system.graph.free_symbols(e).contains(&coordinate)) {
                return Err(Error::NotCyclic {
                    velocity: system.unknowns[carried.unknown].name.clone(),
                    parameter: carried.name.clone(),
                    reason: format!(
                        "the rate of {} depends on {}",
                        state.name,
                        system.graph.name(coordinate)
                    ),
                    up_to: None,
                });
            }
        }
    }
    Ok(())
}

fn by_velocities() -> Error {
    Error::DivisionByZero { place: "the momenta by velocities".into() }
}
