//! Discrete equations of motion on `X x X x G`: the reduced principle of Hamilton, or of Lagrange and d'Alembert, with
//! the midpoint quadrature of the action.
//!
//! With `v = (x_1 - x_0)/h`, `g_1 = g_0 tau(h xi)` (for a right action `g_1 = tau(h xi) g_0`), and everything at the
//! middle `m = ((x_0 + x_1)/2, v, xi, (a_0 + a_1)/2, t + h/2)`, one step has the action `h l(m)`. Along displacements
//! `(dx, g^-1 dg) = (dx, eta)` of its ends it has the momenta
//!
//! ```text
//! start   P_x = l_v - h/2 l_x,   P_xi = (dtau^-1_{h xi})^T l_xi  - h/2 rho(a_0)^T l_a
//! end     P_x = l_v + h/2 l_x,   P_xi = (dtau^-1_{-h xi})^T l_xi + h/2 rho(a_1)^T l_a
//! ```
//!
//! where `a' = rho(a) xi` moves advected parameters. A force adds `-h/2 F` and `h/2 F`. In the frame
//! `y = (v, xi + A v)` of a system with a connection `A` these are `(P_x - A^T P_xi, P_xi)`, with `A` at the end
//! concerned. Displacements are the columns of `W` at the ends, and velocities are `y = Psi u + psi0` in the middle, by
//! the same quadrature. The state at an end stands for the momentum there by the Legendre transformation,
//! `W^T L_y(Psi u + psi0)`, so that a step is
//!
//! ```text
//! W_0^T (L_y(y_0) - P_start) = 0,   W_1^T (P_end - L_y(y_1)) = 0,   y = Psi u + psi0,   x_1 = x_0 + h v,
//! a_1 = a_0 + h rho((a_0 + a_1)/2) xi  for `cay`,   a_1 = exp(h rho(.) xi) a_0  for `exp`
//! ```
//!
//! The midpoint rule for `a` is exact: it moves by the group element `cay(h xi)`. The mean of both ends in the
//! potential is what makes the momentum of every symmetry that leaves `a` one that stays to rounding: its variation
//! along `g` is `rho(a) eta` at both ends.
//!
//! Deliberately does not know: how steps are solved, programs.
//!
//! # Source
//! Bou-Rabee and Marsden, Hamilton-Pontryagin integrators on Lie groups, part I (2009); Cortes and Martinez,
//! Non-holonomic integrators (2001); Iglesias, Marrero, Martin de Diego and Martinez, Discrete nonholonomic Lagrangian
//! systems on Lie groupoids (2008); Fernandez, Tori and Zuccalli, Lagrangian reduction of nonholonomic discrete
//! mechanical systems (2010).

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::differentiate::Linearisation;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Rational, SectionWriter, SymbolId};
use hamel_lang::algebra::Matrix;
use hamel_lang::spec::Retraction;

use super::equations::{Equations, StateEquation};
use super::retraction::GroupMap;
use crate::reduction::{KinematicConstraint, ReducedSystem, SolvedConstraint};

/// What a model says about its group, which a system on an algebroid no longer does.
#[derive(Clone, Debug)]
pub struct DiscreteSetting<'a> {
    /// Number of coordinates with a velocity of their own, the first ones.
    pub n_shape: usize,
    /// The matrices that the algebra is known by, one for each element.
    pub standard: Option<&'a [Matrix]>,
    /// The retraction, where the algebra does not choose.
    pub retraction: Option<Retraction>,
}

/// An unknown of a step, with the row of its place.
#[derive(Clone, Debug)]
pub struct DiscreteUnknown {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: SymbolId,
    /// What vanishes.
    pub residual: ExprId,
    /// Its value for a step of no length.
    pub guess: ExprId,
}

/// The equations of one step.
#[derive(Clone, Debug)]
pub struct DiscreteEquations {
    /// The step `h`.
    pub step: SymbolId,
    /// Components of the state at the start, in the order of the state.
    pub start: Vec<SymbolId>,
    /// Unknowns: coordinates at the end, velocities in the middle, velocities of the state at the end.
    pub unknowns: Vec<DiscreteUnknown>,
    /// The place among the unknowns of each component of the state at the end.
    pub state: Vec<usize>,
    /// How the group moves.
    pub map: GroupMap,
}

/// What stands in the way of discrete equations.
fn refused(reason: impl Into<String>) -> Error {
    Error::NoDiscrete { reason: reason.into() }
}

/// The discrete equations of the motion of `state`.
///
/// # Errors
/// [`Error::NoDiscrete`] with what does not fit, [`Error::OverBudget`].
pub fn discrete_equations(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    setting: &DiscreteSetting<'_>,
) -> Result<DiscreteEquations, Error> {
    let system = &equations.system;
    let solved = fitting(g, system, setting)?;
    if let Some(other) = state.iter().find(|s| !equations.state.iter().any(|own| own.symbol == s.symbol)) {
        return Err(refused(format!(
            "{} is a coordinate of the group that is reconstructed beside the motion; `configuration R in SO(3) velocity \
             Omega;` makes the entries of a matrix advected parameters, which a step moves",
            other.name
        )));
    }
    if let Some(missing) = equations.state.iter().find(|s| !state.iter().any(|own| own.symbol == s.symbol)) {
        return Err(refused(format!("the scene leaves {} out", missing.name)));
    }
    let map = group_map(g, system, setting)?;
    let mut draft = Draft::new(g, system, solved, setting.n_shape, map);
    let unknowns = draft.unknowns()?;
    let Draft { h, start, map, .. } = draft;
    g.within_budget()?;
    let mut found = Vec::with_capacity(state.len());
    let mut begin = Vec::with_capacity(state.len());
    for s in state {
        let end = unknowns.iter().position(|u| u.name == s.name);
        let own = start.get(&s.symbol).copied();
        let (Some(end), Some(own)) = (end, own) else {
            return Err(refused(format!("{} is neither a coordinate nor a velocity", s.name)));
        };
        found.push(end);
        begin.push(own);
    }
    Ok(DiscreteEquations { step: h, start: begin, unknowns, state: found, map })
}

impl DiscreteEquations {
    /// Row and column of the derivatives of residuals by unknowns that do not vanish identically, with their names and
    /// values.
    pub fn jacobian(&self, g: &mut Graph) -> Vec<((usize, usize), String, ExprId)> {
        let residuals: Vec<ExprId> = self.unknowns.iter().map(|u| u.residual).collect();
        let symbols: Vec<SymbolId> = self.unknowns.iter().map(|u| u.symbol).collect();
        let mut writer = SectionWriter::new(g, BTreeSet::new(), &[]);
        let linear = Linearisation::new(g, &[], &residuals, &symbols);
        let name = |value: &str, input: &str| format!("d_{value}_d_{input}");
        let rows = linear.jacobian(g, &mut writer, name, str::to_owned);
        let mut entries = Vec::new();
        for (i, row) in rows.into_iter().enumerate() {
            for (j, e) in row.into_iter().enumerate().filter(|(_, e)| *e != g.zero()) {
                let own = name(&row_name(&self.unknowns[i].name), &self.unknowns[j].name);
                entries.push(((i, j), own, e));
            }
        }
        entries
    }
}

/// The name of the row at the place of an unknown.
pub fn row_name(unknown: &str) -> String {
    format!("row_{unknown}")
}

/// The solved constraint of a system that discrete equations fit.
fn fitting<'a>(
    g: &Graph,
    system: &'a ReducedSystem,
    setting: &DiscreteSetting<'_>,
) -> Result<&'a SolvedConstraint, Error> {
    let KinematicConstraint::Solved(solved) = &system.constraint else {
        return Err(refused(
            "multipliers keep its constraints; constraints that are solved for some velocities fit",
        ));
    };
    let is_shape = |i: usize| {
        (0..system.algebroid.rank()).all(|alpha| {
            let expected = if i == alpha { g.one() } else { g.zero() };
            system.algebroid.anchor(i, alpha) == expected
        })
    };
    let moved_otherwise = (0..setting.n_shape).find(|i| !is_shape(*i));
    let reason = if system.hamiltonian.is_some() || system.accelerations.is_some() {
        "the motion follows from no Lagrangian"
    } else if !system.noises.is_empty() || !system.noise_rates.is_empty() {
        "the scene has noise"
    } else if !system.own_rates.is_empty() || !system.higher.carried.is_empty() {
        "the model has states of first order"
    } else if system.degeneracy.is_some() {
        "the Lagrangian is degenerate: some velocities have no inertia"
    } else if !system.momenta.is_empty() {
        "the state carries momenta in the place of velocities"
    } else if !system.circles.is_empty() {
        "angles are carried as points of the circle"
    } else if system.frame.is_some() || system.quasi_frame.is_some() || !system.changes.is_empty() {
        "velocities are those of a frame"
    } else if system.lift.is_some() {
        "velocities are those of a mechanical connection"
    } else if system.algebroid.is_almost() || moved_otherwise.is_some() {
        "some coordinates or velocities are moved by a bracket or an anchor that is not that of a group"
    } else if !system.positions.is_empty() {
        "equations between coordinates are among the constraints"
    } else if !system.events.is_empty() {
        "the model has events, and a step has no state inside of it"
    } else {
        return depends_on_places_alone(g, system, solved).map(|()| solved);
    };
    Err(refused(reason))
}

/// Whether constraints and displacements depend on coordinates and the time alone.
fn depends_on_places_alone(
    g: &Graph,
    system: &ReducedSystem,
    solved: &SolvedConstraint,
) -> Result<(), Error> {
    let mut moving: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
    moving.extend(solved.unknowns.iter().map(|u| u.symbol));
    moving.extend(system.inputs.iter().map(|input| input.symbol));
    let coefficients = solved.psi.iter().chain(&solved.virtual_displacements).flatten().chain(&solved.psi0);
    if coefficients.copied().any(|e| g.depends_on(e, &moving)) {
        return Err(refused("constraints have coefficients that depend on velocities or inputs"));
    }
    Ok(())
}

/// Brackets of the algebra, and matrices of the vector fields that move advected parameters, with one more coordinate,
/// one, for affine fields.
type GroupData = (Vec<Vec<Vec<(usize, Rational)>>>, Vec<Matrix>);

fn group_data(g: &mut Graph, system: &ReducedSystem, n_shape: usize) -> Result<GroupData, Error> {
    let algebroid = &system.algebroid;
    let dim = algebroid.rank() - n_shape;
    let mut brackets = vec![vec![Vec::new(); dim]; dim];
    for a in 0..dim {
        for b in 0..dim {
            for (c, e) in algebroid.bracket(g, n_shape + a, n_shape + b) {
                let value = g.as_rational(e).cloned().filter(|_| c >= n_shape);
                let value = value.ok_or_else(|| refused("structure constants are not rational numbers"))?;
                brackets[a][b].push((c - n_shape, value));
            }
        }
    }
    let carried = algebroid.base()[n_shape..].to_vec();
    let n = carried.len();
    let mut moved = Vec::with_capacity(dim);
    for a in 0..dim {
        let mut matrix = Matrix::zeros(n + 1, n + 1);
        for i in 0..n {
            let rate = algebroid.anchor(n_shape + i, n_shape + a);
            let parts = g.affine_parts(rate, &carried);
            let numbers = parts.and_then(|(slopes, rest)| {
                slopes.iter().chain([&rest]).map(|e| g.as_rational(*e).cloned()).collect::<Option<Vec<_>>>()
            });
            let Some(numbers) = numbers else {
                let name = g.name(carried[i]).to_owned();
                return Err(refused(format!(
                    "the group moves {name} by a rate that is not linear in numbers"
                )));
            };
            numbers.into_iter().enumerate().for_each(|(j, q)| matrix.set(i, j, q));
        }
        moved.push(matrix);
    }
    Ok((brackets, moved))
}

fn group_map(
    g: &mut Graph,
    system: &ReducedSystem,
    setting: &DiscreteSetting<'_>,
) -> Result<GroupMap, Error> {
    let (brackets, moved) = group_data(g, system, setting.n_shape)?;
    let names: Vec<String> =
        system.velocities[setting.n_shape..].iter().map(|s| g.name(*s).to_owned()).collect();
    let cayley = |brackets| GroupMap::cayley(brackets, &moved, setting.standard, &names);
    let found = match setting.retraction {
        Some(Retraction::Cayley) => cayley(brackets),
        Some(Retraction::Exp) => GroupMap::exponential(brackets, &moved),
        None => cayley(brackets.clone()).or_else(|reason| {
            GroupMap::exponential(brackets, &moved).map_err(|other| format!("{reason}; {other}"))
        }),
    };
    found.map_err(refused)
}

/// Where expressions are taken: symbols of coordinates, velocities and the time, with their values.
type Place = BTreeMap<SymbolId, ExprId>;

/// Equations that are being written.
struct Draft<'a> {
    g: &'a mut Graph,
    system: &'a ReducedSystem,
    solved: &'a SolvedConstraint,
    n_shape: usize,
    map: GroupMap,
    h: SymbolId,
    /// Coordinates and velocities of the state at the start, by symbols of the system.
    start: BTreeMap<SymbolId, SymbolId>,
    /// The same at the end.
    end: BTreeMap<SymbolId, SymbolId>,
    /// Velocities in the middle.
    middle: BTreeMap<SymbolId, SymbolId>,
}

/// Symbols for a copy of each variable.
fn copies(g: &mut Graph, of: &[SymbolId], suffix: &str) -> BTreeMap<SymbolId, SymbolId> {
    let copy = |s: &SymbolId| {
        let name = format!("{}{suffix}", g.name(*s));
        (*s, g.symbol(&name))
    };
    of.iter().map(copy).collect()
}

impl<'a> Draft<'a> {
    fn new(
        g: &'a mut Graph,
        system: &'a ReducedSystem,
        solved: &'a SolvedConstraint,
        n_shape: usize,
        map: GroupMap,
    ) -> Draft<'a> {
        let of_state: Vec<SymbolId> =
            system.algebroid.base().iter().copied().chain(solved.unknowns.iter().map(|u| u.symbol)).collect();
        let quasi = solved.unknowns.iter().filter(|u| u.frame_idx.is_none()).map(|u| u.symbol);
        let velocities: Vec<SymbolId> = system.velocities.iter().copied().chain(quasi).collect();
        Draft {
            h: g.symbol("step"),
            start: copies(g, &of_state, "_start"),
            end: copies(g, &of_state, "_end"),
            middle: copies(g, &velocities, "_mid"),
            g,
            system,
            solved,
            n_shape,
            map,
        }
    }

    fn at(&mut self, e: ExprId, place: &Place) -> Result<ExprId, Error> {
        let found = self.g.subs(e, place);
        found.map_err(|_| Error::DivisionByZero { place: "the discrete equations".into() })
    }

    fn all_at(&mut self, list: &[ExprId], place: &Place) -> Result<Vec<ExprId>, Error> {
        let found = self.g.subs_all(list, place);
        found.map_err(|_| Error::DivisionByZero { place: "the discrete equations".into() })
    }

    /// An end of the step: coordinates there, and velocities by the state's.
    fn node(&mut self, own: &BTreeMap<SymbolId, SymbolId>, fraction: i64) -> Result<Place, Error> {
        let mut place: Place = own.iter().map(|(s, own)| (*s, self.g.sym(*own))).collect();
        let (t, h) = (self.g.sym(self.system.time), self.g.sym(self.h));
        let passed = self.g.scale(h, &Rational::from_integer(fraction.into()));
        place.insert(self.system.time, self.g.add(t, passed));
        for &alpha in &self.solved.dependent {
            let velocity = self.solved.velocity(self.g, alpha);
            let value = self.at(velocity, &place)?;
            place.insert(self.system.velocities[alpha], value);
        }
        Ok(place)
    }

    /// The middle of the step.
    fn middle(&mut self) -> Place {
        let half = Rational::new(1.into(), 2.into());
        let mut place: Place = self.middle.iter().map(|(s, own)| (*s, self.g.sym(*own))).collect();
        for x in self.system.algebroid.base() {
            let ends = [self.start[x], self.end[x]].map(|s| (self.g.sym(s), half.clone()));
            place.insert(*x, self.g.linear_combination(&ends));
        }
        let (t, h) = (self.g.sym(self.system.time), self.g.sym(self.h));
        place.insert(
            self.system.time,
            self.g.linear_combination(&[(t, Rational::from_integer(1.into())), (h, half)]),
        );
        place
    }

    /// The group velocity in the middle times the step.
    fn displacement(&mut self, middle: &Place) -> Result<Vec<ExprId>, Error> {
        let xi = self.system.group_velocity(self.g, self.n_shape);
        let xi = self.all_at(&xi, middle)?;
        let h = self.g.sym(self.h);
        Ok(xi.into_iter().map(|e| self.g.mul(h, e)).collect())
    }

    /// The unknowns with their rows.
    fn unknowns(&mut self) -> Result<Vec<DiscreteUnknown>, Error> {
        let (start, end) = (self.start.clone(), self.end.clone());
        let [from, to] = [self.node(&start, 0)?, self.node(&end, 1)?];
        let middle = self.middle();
        let zeta = self.displacement(&middle)?;
        let mut rows = self.kinematics(&middle, &zeta)?;
        rows.extend(self.constraint(&middle)?);
        for (place, sign) in [(&from, -1), (&to, 1)] {
            rows.extend(self.momenta(place, &middle, &zeta, sign)?);
        }
        let (system, solved) = (self.system, self.solved);
        let quasi = solved.unknowns.iter().filter(|u| u.frame_idx.is_none()).map(|u| u.symbol);
        let velocities = system.velocities.iter().copied().chain(quasi);
        let base = system.algebroid.base().iter().copied();
        let carried = solved.unknowns.iter().map(|u| u.symbol);
        let at_end = |s: SymbolId| (self.end[&s], s, false);
        let order: Vec<(SymbolId, SymbolId, bool)> = base
            .map(at_end)
            .chain(velocities.map(|s| (self.middle[&s], s, true)))
            .chain(carried.map(at_end))
            .collect();
        let mut unknowns = Vec::with_capacity(order.len());
        for ((symbol, of, is_middle), residual) in order.into_iter().zip(rows) {
            let name = self.g.name(if is_middle { symbol } else { of }).to_owned();
            let residual = self.g.cancel_zero(residual);
            let guess = from.get(&of).copied().unwrap_or(self.g.zero());
            unknowns.push(DiscreteUnknown { name, symbol, residual, guess });
        }
        Ok(unknowns)
    }

    /// Coordinates at the end.
    fn kinematics(&mut self, middle: &Place, zeta: &[ExprId]) -> Result<Vec<ExprId>, Error> {
        let (system, n_shape) = (self.system, self.n_shape);
        let h = self.g.sym(self.h);
        let (mut rows, base) = (Vec::new(), system.algebroid.base());
        let moved = match self.map.retraction {
            Retraction::Cayley => self.moved_by_midpoint(middle, zeta)?,
            Retraction::Exp => self.moved_by_series(zeta)?,
        };
        for (i, x) in base.iter().enumerate() {
            let change = match i.checked_sub(n_shape) {
                None => self.g.mul(h, middle[&system.velocities[i]]),
                Some(carried) => moved[carried],
            };
            let [from, to] = [self.start[x], self.end[x]].map(|s| self.g.sym(s));
            let difference = self.g.sub(to, from);
            rows.push(self.g.sub(difference, change));
        }
        Ok(rows)
    }

    /// `h rho(a) xi` in the middle.
    fn moved_by_midpoint(&mut self, middle: &Place, zeta: &[ExprId]) -> Result<Vec<ExprId>, Error> {
        let (system, n_shape) = (self.system, self.n_shape);
        let mut changes = Vec::new();
        for i in n_shape..system.algebroid.n_base() {
            let row: Vec<ExprId> = (0..zeta.len()).map(|a| system.algebroid.anchor(i, n_shape + a)).collect();
            let row = self.all_at(&row, middle)?;
            changes.push(self.g.dot(&row, zeta));
        }
        Ok(changes)
    }

    /// `sum_k (h rho(.) xi)^k a_0 / k!` without the first term, a polynomial.
    fn moved_by_series(&mut self, zeta: &[ExprId]) -> Result<Vec<ExprId>, Error> {
        let (system, n_shape) = (self.system, self.n_shape);
        let carried = system.algebroid.base()[n_shape..].to_vec();
        let start: Place = carried.iter().map(|a| (*a, self.g.sym(self.start[a]))).collect();
        let mut rates = Vec::new();
        for i in n_shape..system.algebroid.n_base() {
            let row: Vec<ExprId> = (0..zeta.len()).map(|a| system.algebroid.anchor(i, n_shape + a)).collect();
            rates.push(self.g.dot(&row, zeta));
        }
        let mut sums = vec![Vec::new(); carried.len()];
        // The k-th derivative along the linear field.
        let (mut powers, mut factor) = (rates.clone(), Rational::from_integer(1.into()));
        for k in 1..=GroupMap::max_power() as i64 {
            if powers.iter().all(|e| *e == self.g.zero()) {
                break;
            }
            factor /= Rational::from_integer(k.into());
            for (sum, e) in sums.iter_mut().zip(self.all_at(&powers, &start)?) {
                sum.push((e, factor.clone()));
            }
            let along: BTreeMap<SymbolId, ExprId> =
                carried.iter().copied().zip(rates.iter().copied()).collect();
            powers = powers.iter().map(|e| self.g.derivative_along(*e, &along)).collect();
            powers = powers.into_iter().map(|e| self.g.cancel_zero(e)).collect();
        }
        Ok(sums.iter().map(|terms| self.g.linear_combination(terms)).collect())
    }

    /// `y - Psi u - psi0` of dependent velocities in the middle.
    fn constraint(&mut self, middle: &Place) -> Result<Vec<ExprId>, Error> {
        let mut rows = Vec::new();
        for &alpha in &self.solved.dependent {
            let velocity = self.solved.velocity(self.g, alpha);
            let value = self.at(velocity, middle)?;
            rows.push(self.g.sub(middle[&self.system.velocities[alpha]], value));
        }
        Ok(rows)
    }

    /// `W^T (L_y - P)` at the start, `W^T (P - L_y)` at the end, whose `sign` is one.
    fn momenta(
        &mut self,
        node: &Place,
        middle: &Place,
        zeta: &[ExprId],
        sign: i64,
    ) -> Result<Vec<ExprId>, Error> {
        let (system, solved) = (self.system, self.solved);
        let momenta: Vec<ExprId> =
            system.velocities.iter().map(|y| self.g.diff(system.lagrangian, *y)).collect();
        let own = self.all_at(&momenta, node)?;
        let of_step = self.momenta_of_step(&momenta, node, (middle, zeta), sign)?;
        let mut rows = Vec::new();
        let differences: Vec<ExprId> = own
            .iter()
            .zip(of_step)
            .map(|(own, step)| if sign < 0 { self.g.sub(*own, step) } else { self.g.sub(step, *own) })
            .collect();
        for b in 0..solved.unknowns.len() {
            let column: Vec<ExprId> = solved.virtual_displacements.iter().map(|row| row[b]).collect();
            let column = self.all_at(&column, node)?;
            rows.push(self.g.dot(&column, &differences));
        }
        Ok(rows)
    }

    /// The momentum of a step at one of its ends, in the frame there.
    fn momenta_of_step(
        &mut self,
        momenta: &[ExprId],
        node: &Place,
        (middle, zeta): (&Place, &[ExprId]),
        sign: i64,
    ) -> Result<Vec<ExprId>, Error> {
        let (system, n_shape) = (self.system, self.n_shape);
        let base = system.algebroid.base();
        let h = self.g.sym(self.h);
        let half = self.g.scale(h, &Rational::new(sign.into(), 2.into()));
        let l_y = self.all_at(momenta, middle)?;
        let slopes: Vec<ExprId> = base.iter().map(|x| self.g.diff(system.lagrangian, *x)).collect();
        let slopes = self.all_at(&slopes, middle)?;
        let forces = self.all_at(&system.forces, middle)?;
        // Along the group.
        let backwards: Vec<ExprId> =
            zeta.iter().map(|e| self.g.scale(*e, &Rational::from_integer((-sign).into()))).collect();
        let turned = self.map.trivialised(self.g, &backwards, &l_y[n_shape..]);
        let mut along_group = Vec::with_capacity(turned.len());
        for (a, p) in turned.into_iter().enumerate() {
            let mut terms = Vec::new();
            for i in n_shape..base.len() {
                let rate = self.at(system.algebroid.anchor(i, n_shape + a), node)?;
                terms.push(self.g.mul(rate, slopes[i]));
            }
            let torque = self.g.sum(&terms);
            let change = self.g.mul(half, torque);
            along_group.push(self.g.add(p, change));
        }
        // Along the coordinates, with the connection in the middle; then in the frame at the end.
        let mut found = Vec::with_capacity(l_y.len());
        for i in 0..n_shape {
            let [mut p, mut slope] = [l_y[i], slopes[i]];
            let mut at_node = Vec::new();
            for (a, row) in system.connection.iter().flatten().enumerate() {
                let value = self.at(row[i], middle)?;
                let term = self.g.mul(value, l_y[n_shape + a]);
                p = self.g.add(p, term);
                let mut rates = Vec::new();
                for (j, entry) in row.iter().enumerate() {
                    let rate = self.g.diff(*entry, base[i]);
                    let rate = self.at(rate, middle)?;
                    rates.push(self.g.mul(rate, middle[&system.velocities[j]]));
                }
                let rate = self.g.sum(&rates);
                let term = self.g.mul(rate, l_y[n_shape + a]);
                slope = self.g.add(slope, term);
                at_node.push(self.at(row[i], node)?);
            }
            let change = self.g.mul(half, slope);
            let p = self.g.add(p, change);
            let lifted = match at_node.is_empty() {
                true => self.g.zero(),
                false => self.g.dot(&at_node, &along_group),
            };
            found.push(self.g.sub(p, lifted));
        }
        found.extend(along_group);
        for (p, force) in found.iter_mut().zip(forces) {
            let change = self.g.mul(half, force);
            *p = self.g.add(*p, change);
        }
        Ok(found)
    }
}
