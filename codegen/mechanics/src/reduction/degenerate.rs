//! Degenerate Lagrangians: equations without accelerations become conditions on the velocities.
//!
//! Where `A = W^T L_yy Psi` is singular, the combinations `n^T W^T E` with `n^T A = 0` contain no acceleration. Those
//! that are affine in the velocities join the kinematic constraint; one that restricts positions alone is
//! differentiated first. The motion satisfies them because `E = 0` does, not because a force keeps it there: virtual
//! displacements stay those of the model, as many of them as there are accelerations left to find.
//!
//! Does not know: factorisation of matrices, what becomes of the constraint.
//!
//! # Source
//! Gotay, Nester 1979 (Presymplectic Lagrangian systems I); Gay-Balmaz, Yoshimura 2015 for constraints beside.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Sign, Style, SymbolId, Vanishing, independent_rows};
use hamel_lang::algebra::{Algebroid, solve_symbolic};
use hamel_lang::spec::Model;

use super::connection::hessian;
use super::constraint::{
    ConstraintRow, KinematicConstraint, SolvedConstraint, Solver, Unknown, frame_unknowns,
};

/// How often conditions are looked for, and one of them is differentiated.
const MAX_STEPS: usize = 8;
/// Characters of an equation that are shown in an error.
const MAX_SHOWN: usize = 120;

/// What the equations without accelerations say.
#[derive(Clone, Debug, Default)]
pub struct Degeneracy {
    /// The conditions in the order in which they were found.
    pub steps: Vec<DegenerateStep>,
    /// Conditions on positions alone, which an initial state has to satisfy: names and residuals.
    pub positions: Vec<(String, ExprId)>,
}

/// A condition, and what was done with it.
#[derive(Clone, Debug)]
pub struct DegenerateStep {
    /// The coefficients of the equations of motion that were added up, by name of the velocity that each is along;
    /// nothing for the time derivative of the condition before.
    pub combination: Vec<(String, ExprId)>,
    /// What vanishes.
    pub condition: ExprId,
    /// What was done with it.
    pub outcome: DegenerateOutcome,
    /// How many time derivatives of `p = dL/dy` are in it.
    pub n_derivatives: usize,
}

/// What was done with a condition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DegenerateOutcome {
    /// It is solved for this velocity, after the others.
    Solved(String),
    /// It restricts positions alone: its time derivative comes next.
    Differentiated,
}

impl Degeneracy {
    /// Every expression.
    pub(super) fn expressions_mut(&mut self) -> impl Iterator<Item = &mut ExprId> {
        let Degeneracy { steps, positions } = self;
        let steps = steps.iter_mut().flat_map(|step| {
            let DegenerateStep { combination, condition, outcome: _, n_derivatives: _ } = step;
            combination.iter_mut().map(|(_, e)| e).chain([condition])
        });
        steps.chain(positions.iter_mut().map(|(_, e)| e))
    }

    /// Coordinates as functions of the others where the conditions on positions hold: each condition, on those before
    /// it, is solved for the first coordinate that it is affine in. None where a condition is affine in no coordinate.
    pub fn places(&self, g: &mut Graph, base: &[SymbolId]) -> Option<BTreeMap<SymbolId, ExprId>> {
        let mut places: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
        for (_, condition) in &self.positions {
            let condition = g.subs(*condition, &places).ok()?;
            let affine = base.iter().find_map(|x| {
                let (slopes, rest) = g.affine_parts(condition, &[*x])?;
                (g.vanishing(slopes[0]) == Vanishing::NonZero).then_some((*x, slopes[0], rest))
            });
            let (x, slope, rest) = affine?;
            let minus_rest = g.neg(rest);
            let value = g.div(minus_rest, slope).ok()?;
            let by_others = BTreeMap::from([(x, value)]);
            for place in places.values_mut() {
                *place = g.subs(*place, &by_others).ok()?;
            }
            places.insert(x, value);
        }
        Some(places)
    }
}

/// The constraint with the conditions that the equations without accelerations are; none where the Lagrangian is
/// regular, where no condition determines anything, and for constraints that are kept by multipliers.
///
/// # Errors
/// [`Error::EquationLeft`] for a condition that is of no use, [`Error::Undetermined`] where velocities are left that no
/// equation determines.
pub(super) fn completed(
    model: &mut Model,
    algebroid: &Algebroid,
    constraint: &KinematicConstraint,
    signs: &BTreeMap<ExprId, Sign>,
) -> Result<Option<(KinematicConstraint, Degeneracy)>, Error> {
    let KinematicConstraint::Solved(solved) = constraint else { return Ok(None) };
    if model.hamiltonian.is_some() || !model.quasi_velocities.is_empty() {
        return Ok(None);
    }
    if is_seen_to_be_regular(model, solved) {
        return Ok(None);
    }
    // What a regular Lagrangian is does not change for having been looked at.
    let mut looked_at = model.clone();
    let hessian = hessian(&mut looked_at);
    let mut graph = std::mem::take(&mut looked_at.graph);
    let unknowns = frame_unknowns(model);
    let mut search = Search {
        params: model.params.iter().map(|p| p.symbol).collect(),
        moving: algebroid.base().iter().copied().chain([model.time]).collect(),
        symbols: unknowns.iter().map(|u| u.symbol).collect(),
        model: &looked_at,
        algebroid,
        signs,
        names: unknowns.iter().map(|u| u.name.clone()).collect(),
        unknowns,
        hessian,
        displacements: solved.virtual_displacements.clone(),
        is_own: solved.virtual_displacements != solved.psi,
        form: solved.clone(),
        used: Vec::new(),
        found: Degeneracy::default(),
    };
    let matrix = search.mass_matrix(&mut graph)?;
    if independent_rows(&graph, &matrix).len() == search.form.unknowns.len() {
        return Ok(None);
    }
    let matrix = search.run(&mut graph)?;
    if search.found.steps.is_empty() {
        return Ok(None);
    }
    let constraint = search.constraint(&mut graph, &matrix)?;
    let found = search.found;
    model.graph = graph;
    Ok(Some((KinematicConstraint::Solved(constraint), found)))
}

/// Whether values prove that `W^T L_yy Psi` has an inverse: of a Lagrangian of degree two in the velocities, whose
/// Hessian is the same on the conditions.
fn is_seen_to_be_regular(model: &mut Model, solved: &SolvedConstraint) -> bool {
    let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
    let sides = (solved.virtual_displacements.as_slice(), solved.psi.as_slice());
    let matrix = model.graph.second_derivatives(model.lagrangian, &velocities, sides, &BTreeMap::new());
    matrix.is_some_and(|matrix| matrix.rank() == solved.unknowns.len())
}

struct Search<'a> {
    model: &'a Model,
    algebroid: &'a Algebroid,
    signs: &'a BTreeMap<ExprId, Sign>,
    params: BTreeSet<SymbolId>,
    /// Base coordinates and time.
    moving: BTreeSet<SymbolId>,
    names: Vec<String>,
    unknowns: Vec<Unknown>,
    symbols: Vec<SymbolId>,
    /// `L_yy`.
    hessian: Vec<Vec<ExprId>>,
    /// `W`, of the model.
    displacements: Vec<Vec<ExprId>>,
    /// Whether the model has virtual displacements of their own, that are not those of the motion.
    is_own: bool,
    /// All conditions on velocities by now, solved; reactions are those of the model.
    form: SolvedConstraint,
    /// Combinations of equations along displacements whose conditions are known to hold.
    used: Vec<Vec<ExprId>>,
    found: Degeneracy,
}

impl Search<'_> {
    /// Expressions on the conditions found by now.
    fn on_conditions(&self, g: &mut Graph, list: &[ExprId]) -> Result<Vec<ExprId>, Error> {
        let dependent = self.form.dependent.iter();
        let values: BTreeMap<SymbolId, ExprId> =
            dependent.map(|k| (self.symbols[*k], self.form.velocity(g, *k))).collect();
        let place = || Error::DivisionByZero { place: "the equations without accelerations".into() };
        let replaced = g.subs_all(list, &values).map_err(|_| place())?;
        Ok(replaced.into_iter().map(|e| g.cancel_zero(e)).collect())
    }

    /// `W^T L_yy Psi`: a row for each virtual displacement.
    fn mass_matrix(&self, g: &mut Graph) -> Result<Vec<Vec<ExprId>>, Error> {
        let n_displacements = self.displacements.first().map_or(0, Vec::len);
        let mut rows = Vec::new();
        for b in 0..n_displacements {
            let column: Vec<ExprId> = self.displacements.iter().map(|row| row[b]).collect();
            rows.push(self.mass_row(g, &column)?);
        }
        Ok(rows)
    }

    /// `w^T L_yy Psi`.
    fn mass_row(&self, g: &mut Graph, w: &[ExprId]) -> Result<Vec<ExprId>, Error> {
        // Of a chain of bodies most displacements are along one velocity.
        let zero = g.zero();
        let displaced: Vec<usize> = (0..w.len()).filter(|alpha| w[*alpha] != zero).collect();
        let mut row = Vec::new();
        for a in 0..self.form.unknowns.len() {
            let moved: Vec<usize> =
                (0..self.form.psi.len()).filter(|beta| self.form.psi[*beta][a] != zero).collect();
            let mut terms = Vec::new();
            for alpha in &displaced {
                for beta in &moved {
                    let h = self.hessian[*alpha][*beta];
                    terms.push(g.product(&[w[*alpha], h, self.form.psi[*beta][a]]));
                }
            }
            row.push(g.sum(&terms));
        }
        self.on_conditions(g, &row)
    }

    /// Derivative along the motion at fixed velocities.
    fn drift(&self, g: &mut Graph, e: ExprId) -> ExprId {
        let mut terms = vec![g.diff(e, self.model.time)];
        for (alpha, y) in self.symbols.iter().enumerate() {
            let slope = self.algebroid.derivative_along(g, alpha, e);
            let y = g.sym(*y);
            terms.push(g.mul(slope, y));
        }
        for state in &self.model.first_order {
            for ((_, symbol), rate) in state.components.iter().zip(&state.rates) {
                let slope = g.diff(e, *symbol);
                terms.push(g.mul(slope, *rate));
            }
        }
        g.sum(&terms)
    }

    /// `-E` without accelerations: what changes the momenta, less `dp/dx xdot + dp/dt`.
    fn drives(&self, g: &mut Graph) -> Vec<ExprId> {
        let l = self.model.lagrangian;
        let y: Vec<ExprId> = self.symbols.iter().map(|s| g.sym(*s)).collect();
        let p: Vec<ExprId> = self.symbols.iter().map(|s| g.diff(l, *s)).collect();
        let slopes: Vec<ExprId> = self.algebroid.base().iter().map(|x| g.diff(l, *x)).collect();
        let mut drives = Vec::new();
        for (alpha, force) in self.model.forces.iter().enumerate() {
            let net = self.algebroid.net_force(g, (alpha, *force), &y, &p, &slopes);
            let drift = self.drift(g, p[alpha]);
            drives.push(g.sub(net, drift));
        }
        drives
    }

    /// Adds conditions until there are none left; `A` at the end.
    fn run(&mut self, g: &mut Graph) -> Result<Vec<Vec<ExprId>>, Error> {
        let drives = self.drives(g);
        for _ in 0..MAX_STEPS {
            g.within_budget()?;
            let matrix = self.mass_matrix(g)?;
            let mut is_done = true;
            let n_before = self.found.steps.iter().map(|step| step.n_derivatives).max().unwrap_or(0);
            for combination in left_null_vectors(g, &matrix)? {
                self.used.push(combination.clone());
                if independent_rows(g, &self.used).len() < self.used.len() {
                    self.used.pop();
                    continue;
                }
                is_done &= !self.look_at(g, &drives, &combination, n_before)?;
            }
            if is_done {
                return Ok(matrix);
            }
        }
        // Every round adds a condition, and there are no more than velocities and coordinates.
        let last = self.found.steps.last().map_or(g.zero(), |step| step.condition);
        Err(left(g, self.names.join(", "), last, "is one of too many"))
    }

    /// Looks at the combination of equations of motion along displacements; whether anything new was found. The
    /// conditions of former rounds have up to `n_before` time derivatives of `p = dL/dy` in them.
    fn look_at(
        &mut self,
        g: &mut Graph,
        drives: &[ExprId],
        combination: &[ExprId],
        n_before: usize,
    ) -> Result<bool, Error> {
        let m = self.names.len();
        let mut along = Vec::new();
        for row in &self.displacements {
            let sum = g.dot(row, combination);
            along.push(g.cancel_zero(sum));
        }
        let mut lag = vec![g.zero(); m];
        for &alpha in &self.form.dependent {
            let value = self.form.velocity(g, alpha);
            lag[alpha] = self.drift(g, value);
        }
        let mut terms = Vec::new();
        for alpha in 0..m {
            terms.push(g.mul(along[alpha], drives[alpha]));
            for (beta, lag) in lag.iter().enumerate() {
                let term = g.product(&[along[alpha], self.hessian[alpha][beta], *lag]);
                terms.push(g.neg(term));
            }
        }
        let sum = g.sum(&terms);
        let mut condition = self.on_conditions(g, &[sum])?[0];
        // Accelerations of velocities that are solved for differentiate what they were solved from.
        let direction = self.spelled(g, &along);
        let named = self.names.iter().cloned().zip(along);
        let mut combination: Vec<(String, ExprId)> = named.filter(|(_, e)| *e != g.zero()).collect();
        for n_derivatives in n_before + 1..=n_before + MAX_STEPS {
            match g.vanishing(condition) {
                Vanishing::Zero => return Ok(false),
                Vanishing::NonZero => {}
                Vanishing::Unknown => return Err(left(g, direction, condition, "may hold always")),
            }
            let inputs: BTreeSet<SymbolId> = self.model.inputs.iter().map(|input| input.symbol).collect();
            if g.depends_on(condition, &inputs) {
                return Err(left(g, direction, condition, "contains an input, whose rate is not known"));
            }
            let states = self.model.first_order.iter().flat_map(|s| s.components.iter().map(|(_, x)| *x));
            if g.depends_on(condition, &states.collect()) {
                return Err(left(g, direction, condition, "contains a state of first order"));
            }
            let velocities: BTreeSet<SymbolId> = self.symbols.iter().copied().collect();
            if g.depends_on(condition, &velocities) {
                let Some((one_form, offset)) = g.affine_parts(condition, &self.symbols) else {
                    return Err(left(g, direction, condition, "is not linear in the velocities"));
                };
                if one_form.iter().any(|e| *e != g.zero()) {
                    self.solve(g, (combination, n_derivatives), (condition, one_form, offset))?;
                    return Ok(true);
                }
                condition = offset;
            }
            if !g.depends_on(condition, &self.moving) {
                return Err(left(g, direction, condition, "holds for special parameters at most"));
            }
            let outcome = DegenerateOutcome::Differentiated;
            self.found.steps.push(DegenerateStep {
                combination: std::mem::take(&mut combination),
                condition,
                outcome,
                n_derivatives,
            });
            self.found.positions.push((format!("residual_{}", self.found.positions.len() + 1), condition));
            let rate = self.drift(g, condition);
            condition = self.on_conditions(g, &[rate])?[0];
        }
        Err(left(g, direction, condition, "restricts positions however often it is differentiated"))
    }

    /// Solves a condition together with those before it.
    fn solve(
        &mut self,
        g: &mut Graph,
        (combination, n_derivatives): (Vec<(String, ExprId)>, usize),
        (condition, one_form, offset): (ExprId, Vec<ExprId>, ExprId),
    ) -> Result<(), Error> {
        let text = format!("{} = 0", g.display(condition, Style::Plain));
        let name = format!("equation{}", self.found.steps.len() + 1);
        let before = self.form.dependent.clone();
        self.form.rows.push(ConstraintRow { name, text, one_form, offset, written: None });
        self.solve_rows(g)?;
        let new = self.form.dependent.iter().find(|k| !before.contains(k));
        let solved_for = new.map(|k| self.names[*k].clone()).unwrap_or_default();
        let outcome = DegenerateOutcome::Solved(solved_for);
        self.found.steps.push(DegenerateStep { combination, condition, outcome, n_derivatives });
        Ok(())
    }

    /// All conditions on velocities solved, for those without inertia where it is as good to divide by what they are
    /// multiplied with.
    fn solve_rows(&mut self, g: &mut Graph) -> Result<(), Error> {
        let m = self.names.len();
        let has_inertia = |k: &usize| self.hessian[*k].iter().any(|e| *e != g.zero());
        // Later velocities are eliminated first.
        let (heavy, massless): (Vec<usize>, Vec<usize>) = (0..m).partition(has_inertia);
        let order = [heavy, massless].concat();
        let names: Vec<String> = order.iter().map(|k| self.names[*k].clone()).collect();
        let rows = self.form.rows.iter().map(|row| ConstraintRow {
            one_form: order.iter().map(|k| row.one_form[*k]).collect(),
            ..row.clone()
        });
        let rows: Vec<ConstraintRow> = rows.collect();
        let mut solver = Solver {
            graph: g,
            names: &names,
            quasi: &[],
            params: &self.params,
            facts: self.signs,
            is_by_rows: false,
        };
        let found = solver.solve_somewhere(&rows)?;
        // Back in the order of the frame.
        let free: Vec<usize> = (0..m).filter(|k| !found.dependent.contains(k)).map(|k| order[k]).collect();
        let mut ascending: Vec<usize> = (0..free.len()).collect();
        ascending.sort_by_key(|a| free[*a]);
        let form = &mut self.form;
        form.response = None;
        form.dependent = found.dependent.iter().map(|k| order[*k]).collect();
        form.dependent.sort_unstable();
        form.unknowns = ascending.iter().map(|a| self.unknowns[free[*a]].clone()).collect();
        form.pivots = found.pivots;
        for (k, &alpha) in order.iter().enumerate() {
            form.psi[alpha] = ascending.iter().map(|a| found.psi[k][*a]).collect();
            form.psi0[alpha] = found.psi0[k];
        }
        Ok(())
    }

    /// `sum w_alpha y^alpha` for people.
    fn spelled(&self, g: &mut Graph, along: &[ExprId]) -> String {
        let mut terms = Vec::new();
        for (weight, y) in along.iter().zip(&self.symbols) {
            let y = g.sym(*y);
            terms.push(g.mul(*weight, y));
        }
        let sum = g.sum(&terms);
        g.display(sum, Style::Plain)
    }

    /// The constraint with all conditions, and as many virtual displacements as there are accelerations.
    fn constraint(&self, g: &mut Graph, matrix: &[Vec<ExprId>]) -> Result<SolvedConstraint, Error> {
        let n = self.form.unknowns.len();
        let independent = independent_rows(g, matrix);
        if independent.len() < n {
            let null = left_null_vectors(g, &transposed(matrix, n))?.into_iter().next().unwrap_or_default();
            let mut along = vec![g.zero(); self.names.len()];
            for (weight, k) in null.into_iter().zip(self.form.independent()) {
                along[k] = weight;
            }
            return Err(Error::Undetermined { velocity: self.spelled(g, &along) });
        }
        // Along the motion's own directions the mass matrix is symmetric.
        let mut symmetric = Vec::new();
        for a in (0..n).filter(|_| !self.is_own) {
            let column: Vec<ExprId> = self.form.psi.iter().map(|row| row[a]).collect();
            symmetric.push(self.mass_row(g, &column)?);
        }
        let virtual_displacements = if !self.is_own && independent_rows(g, &symmetric).len() == n {
            self.form.psi.clone()
        } else {
            let rows = self.displacements.iter();
            rows.map(|row| independent.iter().map(|b| row[*b]).collect()).collect()
        };
        Ok(SolvedConstraint { virtual_displacements, ..self.form.clone() })
    }
}

fn transposed(matrix: &[Vec<ExprId>], width: usize) -> Vec<Vec<ExprId>> {
    (0..width).map(|a| matrix.iter().map(|row| row[a]).collect()).collect()
}

/// A basis of `n^T A = 0`.
fn left_null_vectors(g: &mut Graph, matrix: &[Vec<ExprId>]) -> Result<Vec<Vec<ExprId>>, Error> {
    let rows = independent_rows(g, matrix);
    let width = matrix.first().map_or(0, Vec::len);
    let kept: Vec<Vec<ExprId>> = rows.iter().map(|k| matrix[*k].clone()).collect();
    let columns = transposed(&kept, width);
    let chosen = independent_rows(g, &columns);
    // A[rows][chosen]^T c = A[other][chosen]^T.
    let square: Vec<Vec<ExprId>> = chosen.iter().map(|a| columns[*a].clone()).collect();
    let mut basis = Vec::new();
    for (other, entries) in matrix.iter().enumerate().filter(|(k, _)| !rows.contains(k)) {
        let right: Vec<Vec<ExprId>> = chosen.iter().map(|a| vec![entries[*a]]).collect();
        let place = |_| Error::DivisionByZero { place: "the equations without accelerations".into() };
        let solution = solve_symbolic(g, &square, &right).map_err(place)?;
        let mut vector = vec![g.zero(); matrix.len()];
        vector[other] = g.one();
        for (k, c) in rows.iter().zip(solution) {
            let minus = g.neg(c[0]);
            vector[*k] = g.cancel_zero(minus);
        }
        basis.push(vector);
    }
    Ok(basis)
}

fn left(g: &Graph, direction: String, condition: ExprId, reason: &'static str) -> Error {
    let text = g.display(condition, Style::Plain);
    let equation = match text.char_indices().nth(MAX_SHOWN) {
        Some((at, _)) => format!("{} .. = 0", &text[..at]),
        None => format!("{text} = 0"),
    };
    Error::EquationLeft { direction, equation, reason }
}
