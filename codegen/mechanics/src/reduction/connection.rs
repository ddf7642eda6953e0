//! The same system written with another connection: other coordinates, the same motion.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::algebra::{solve_by_cofactors, solve_over_determinant};
use hamel_lang::spec::{ConnectionKind, ConstraintKind, Diagnostics, ExpressionRole, Model};

use super::constraint::{self, ConstraintRow, Prolonged, Solver, Unknown, annihilator, constrain, prolonged};
use super::domain::signs;

/// Rewrites a model so that its velocity is `v = xi + A(x, t) xdot` for the connection asked for.
///
/// * trivial: `A = 0`;
/// * mechanical: the horizontal space is orthogonal to the group orbits in the kinetic energy, so that the Hessian of
///   `L` has no block between `v` and `xdot`;
/// * nonholonomic: the horizontal space lies in the space `C_V` of virtual displacements and is orthogonal to its
///   intersection `S` with the orbits. The constraint on velocities plays no part in it where the model gives
///   displacements of their own.
///
/// # Errors
/// [`Error::ConnectionDependsOn`] where the Hessian or the displacements bring velocities or advected parameters into
/// `A`, [`Error::NoHorizontalSpace`] for a degenerate kinetic energy along the orbits, [`Error::Unsupported`] where
/// combinations of forms restrict base velocities alone.
///
/// # Source
/// Marsden, Montgomery, Ratiu 1990 (mechanical); Bloch, Krishnaprasad, Marsden, Murray 1996 (nonholonomic); Grillo,
/// Zuccalli 2012, section 2.2.1 (its dependence on `C_V` alone).
pub fn with_connection(model: &Model, kind: ConnectionKind) -> Result<Model, Diagnostics> {
    if model.n_shape() == 0 || model.algebra.dim() == 0 {
        return Ok(model.clone());
    }
    if let Some(item) = beside_connection(model) {
        if kind == ConnectionKind::Trivial && model.connection.is_none() {
            return Ok(model.clone());
        }
        let what = format!("a {} connection beside `{item}`", kind.name());
        let error = Error::Unsupported { what, possible: "the connection that the model writes down".into() };
        return Err(refused(model, &error));
    }
    let mut rewritten = Model { derived_connection: None, ..model.clone() };
    let (n, dim) = (model.base.len(), model.algebra.dim());
    let zero = model.graph.zero();
    let given = model.connection.clone().unwrap_or_else(|| vec![vec![zero; n]; dim]);
    let derived = match kind {
        ConnectionKind::Trivial => {
            let g = &mut rewritten.graph;
            Ok(given.iter().map(|row| row.iter().map(|e| g.neg(*e)).collect()).collect())
        }
        ConnectionKind::Mechanical => vertical_shift(&mut rewritten, kind, &[]),
        ConnectionKind::Nonholonomic => {
            let forms = annihilator(&mut rewritten);
            let (of_base, others) = forms_on_the_base(&mut rewritten.graph, n, forms);
            // Without kinetic energy every complement is orthogonal: that on which the other forms vanish.
            let massless = !model.is_energetic();
            match of_base.is_empty() || massless {
                true => vertical_shift(&mut rewritten, kind, &others),
                false => complemented_shift(&mut rewritten, &of_base, &others),
            }
        }
    };
    let shift = match derived {
        Ok(shift) => shift,
        Err(error) => {
            // Constraints that contradict each other have no displacements either: their own error says more.
            let mut plain = model.clone();
            let facts = signs(&mut plain);
            if let Err(error) = constrain(&mut plain, &facts) {
                return Err(model.diagnostics(vec![constraint::refused(&plain, &error)]));
            }
            let error = rewritten.graph.within_budget().err().map_or(error, Error::from);
            return Err(refused(model, &error));
        }
    };
    shift_velocities(&mut rewritten, &shift).map_err(|e| refused(model, &e))?;
    let total: Vec<Vec<ExprId>> = given
        .iter()
        .zip(&shift)
        .map(|(old, new)| {
            old.iter()
                .zip(new)
                .map(|(a, b)| {
                    let sum = rewritten.graph.add(*a, *b);
                    rewritten.graph.cancel_zero(sum)
                })
                .collect()
        })
        .collect();
    let flat = total.iter().flatten().all(|e| *e == zero);
    rewritten.graph.within_budget().map_err(|e| refused(model, &e.into()))?;
    rewritten.connection = (!flat).then_some(total);
    Ok(rewritten)
}

/// An item that fixes the velocities of a model, so that no other connection changes them.
pub fn beside_connection(model: &Model) -> Option<&'static str> {
    match (&model.frame, &model.given) {
        (Some(_), _) => Some("frame"),
        (None, Some(_)) if model.is_kinematic() => None,
        (None, Some(_)) => Some("acceleration"),
        (None, None) => None,
    }
}

fn refused(model: &Model, error: &Error) -> Diagnostics {
    let mut problem = model.diagnose(error);
    problem.span = model.places.connection.or(problem.span);
    model.diagnostics(vec![problem])
}

/// Hessian of `L` in all velocities.
pub(super) fn hessian(model: &mut Model) -> Vec<Vec<ExprId>> {
    let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
    let g = &mut model.graph;
    let mut rows = Vec::with_capacity(velocities.len());
    for a in &velocities {
        let p = g.diff(model.lagrangian, *a);
        let row = velocities.iter().map(|b| {
            let second = g.diff(p, *b);
            g.cancel_zero(second)
        });
        rows.push(row.collect());
    }
    rows
}

/// Combinations of forms that restrict base velocities alone, and the forms that are left beside these: of a form the
/// vertical part is taken out by multiples of forms before it, `p form - q other`.
fn forms_on_the_base(
    g: &mut Graph,
    n: usize,
    forms: Vec<ConstraintRow>,
) -> (Vec<ConstraintRow>, Vec<ConstraintRow>) {
    let (mut of_base, mut others) = (Vec::new(), Vec::new());
    let mut taken: Vec<(Vec<ExprId>, usize)> = Vec::new();
    for form in forms {
        let mut left = form.one_form.clone();
        for (other, column) in &taken {
            let (p, q) = (other[*column], left[*column]);
            if g.is_zero(q) {
                continue;
            }
            for (entry, other) in left.iter_mut().zip(other) {
                let (own, taken) = (g.mul(p, *entry), g.mul(q, *other));
                let difference = g.sub(own, taken);
                *entry = g.cancel_zero(difference);
            }
        }
        let entries: Vec<usize> = (n..left.len()).filter(|k| !g.is_zero(left[*k])).collect();
        let number = entries.iter().find(|k| g.as_rational(left[**k]).is_some());
        match number.or(entries.first()) {
            Some(column) => {
                taken.push((left, *column));
                others.push(form);
            }
            None => of_base.push(ConstraintRow { one_form: left, ..form }),
        }
    }
    (of_base, others)
}

/// The same where some forms `B dx` restrict base velocities alone, so that horizontal virtual displacements lift the
/// kernel of `B` alone. The horizontal space then has the complement `R` of the virtual displacements and the vertical
/// vectors that is orthogonal to both: lifts of the mechanical connection, over the complement of the kernel that is
/// orthogonal in the metric `M_ij = L''(H_i, H_j)` of these lifts,
///
/// ```text
/// h = h_nonholonomic (1 - Q) + h_mechanical Q,    Q = M^-1 B^T (B M^-1 B^T)^-1 B
/// ```
///
/// # Shapes
/// of_base, others: as `forms` of [`vertical_shift`] -> `[dim][n]`.
///
/// # Source
/// Grillo, Zuccalli 2012, section 2.2.1, step 3.
fn complemented_shift(
    model: &mut Model,
    of_base: &[ConstraintRow],
    others: &[ConstraintRow],
) -> Result<Vec<Vec<ExprId>>, Error> {
    let kind = ConnectionKind::Nonholonomic;
    let n = model.base.len();
    let along = vertical_shift(model, kind, others)?;
    let across = vertical_shift(model, ConnectionKind::Mechanical, &[])?;
    let hessian = hessian(model);
    let g = &mut model.graph;
    let lift = |g: &mut Graph, i: usize| -> Vec<ExprId> {
        let on_base = (0..n).map(|j| if i == j { g.one() } else { g.zero() }).collect::<Vec<_>>();
        on_base.into_iter().chain(across.iter().map(|row| g.neg(row[i]))).collect()
    };
    let lifts: Vec<Vec<ExprId>> = (0..n).map(|i| lift(g, i)).collect();
    // [[M, B^T], [B, 0]] [Q, mu] = [0, B]
    let padding = vec![g.zero(); of_base.len()];
    let mut matrix: Vec<Vec<ExprId>> = Vec::new();
    let mut right: Vec<Vec<ExprId>> = Vec::new();
    for (i, own) in lifts.iter().enumerate() {
        let metric: Vec<ExprId> = lifts.iter().map(|other| paired(g, &hessian, own, other)).collect();
        matrix.push(metric.into_iter().chain(of_base.iter().map(|form| form.one_form[i])).collect());
        right.push(vec![g.zero(); n]);
    }
    for form in of_base {
        matrix.push(form.one_form[..n].iter().copied().chain(padding.iter().copied()).collect());
        right.push(form.one_form[..n].to_vec());
    }
    let complement = solve_over_determinant(g, &matrix, &right).map_err(|_| restricted())?;
    let mut shift = along.clone();
    for (row, (along, across)) in shift.iter_mut().zip(along.iter().zip(&across)) {
        for (i, entry) in row.iter_mut().enumerate() {
            let mut terms = vec![along[i]];
            for j in 0..n {
                let difference = g.sub(across[j], along[j]);
                terms.push(g.mul(difference, complement[j][i]));
            }
            let sum = g.sum(&terms);
            *entry = g.cancel_zero(sum);
        }
    }
    let forms: Vec<ConstraintRow> = of_base.iter().chain(others).cloned().collect();
    for entry in shift.iter_mut().flatten() {
        *entry = fixed_on_the_base(model, kind, &forms, *entry)?;
    }
    Ok(shift)
}

fn restricted() -> Error {
    Error::Unsupported {
        what: "a nonholonomic connection where constraints depend on each other".into(),
        possible: "independent constraints; `connection trivial;`, which has the same motion".into(),
    }
}

/// `x^T L'' y`.
fn paired(g: &mut Graph, hessian: &[Vec<ExprId>], x: &[ExprId], y: &[ExprId]) -> ExprId {
    let mut terms = Vec::new();
    for (alpha, row) in hessian.iter().enumerate() {
        for (beta, h) in row.iter().enumerate() {
            terms.push(g.product(&[x[alpha], *h, y[beta]]));
        }
    }
    let sum = g.sum(&terms);
    g.cancel_zero(sum)
}

/// Minus the vertical part of the lift `H_i` of `d/dx^i` on which the forms vanish and which is orthogonal to the
/// vertical vectors on which they vanish, `S`. With forms `F_x dx + F_v v` and the Hessian `[[L_xx, L_xv], [L_vx, K]]`
/// that is `h` of
///
/// ```text
/// [[K, F_v^T], [F_v, 0]] [h, mu] = [L_vx, F_x]
/// ```
///
/// in which the forms that can be solved without a division by something that might vanish are eliminated first.
///
/// # Shapes
/// forms: on base velocities, velocities of the algebra, quasi-velocities -> `[dim][n]`.
fn vertical_shift(
    model: &mut Model,
    kind: ConnectionKind,
    forms: &[ConstraintRow],
) -> Result<Vec<Vec<ExprId>>, Error> {
    let (n, dim) = (model.base.len(), model.algebra.dim());
    let hessian = hessian(model);
    let facts = signs(model);
    let params: BTreeSet<SymbolId> = model.params.iter().map(|p| p.symbol).collect();
    // Vertical velocities and quasi-velocities may be eliminated, base velocities may not.
    let fibre = model.velocities.iter().chain(&model.quasi_velocities);
    let names: Vec<String> = fibre.map(|v| v.name.clone()).collect();
    let base: Vec<Unknown> = (model.base.iter())
        .map(|c| Unknown { name: c.velocity_name.clone(), symbol: c.velocity, frame_idx: None })
        .collect();
    let mut rows = forms.to_vec();
    rows.iter_mut().for_each(|row| row.one_form.rotate_left(n));
    let g = &mut model.graph;
    let mut solver =
        Solver { graph: g, names: &names, quasi: &base, params: &params, facts: &facts, is_by_rows: false };
    let (solved, left) = solver.solve_safely(&rows).map_err(|_| restricted())?;
    let free: Vec<usize> = (0..names.len()).filter(|k| !solved.dependent.contains(k)).collect();
    // Vectors on which the solved forms vanish: one for each free column, then lifts of the base velocities.
    let column = |a: usize| -> Vec<ExprId> {
        let on_base = (0..n).map(|i| if a == free.len() + i { g.one() } else { g.zero() });
        on_base.chain((0..dim).map(|k| solved.psi[k][a])).collect()
    };
    let (vertical, lifts): (Vec<_>, Vec<_>) =
        ((0..free.len()).map(column).collect(), (0..n).map(|i| column(free.len() + i)).collect());
    let pairing = |g: &mut Graph, x: &[ExprId], y: &[ExprId]| paired(g, &hessian, x, y);
    let of_base = |form: &[ExprId]| form[names.len()..names.len() + n].to_vec();
    let correction = if !left.is_empty() && left.len() == free.len() {
        // No vertical vector is left to be orthogonal to. An elimination would divide by coefficients that vanish
        // at states where the determinant does not.
        let matrix = left.iter().map(|form| free.iter().map(|k| form[*k]).collect()).collect::<Vec<_>>();
        let right: Vec<Vec<ExprId>> = left.iter().map(|form| of_base(form)).collect();
        solve_by_cofactors(g, &matrix, &right).ok_or_else(restricted)?
    } else {
        let mut matrix: Vec<Vec<ExprId>> = Vec::new();
        let mut right: Vec<Vec<ExprId>> = Vec::new();
        for (s, k) in vertical.iter().zip(&free) {
            let gram = vertical.iter().map(|t| pairing(g, s, t)).collect::<Vec<_>>();
            matrix.push(gram.into_iter().chain(left.iter().map(|form| form[*k])).collect());
            right.push(lifts.iter().map(|lift| pairing(g, s, lift)).collect());
        }
        for form in &left {
            let padding = vec![g.zero(); left.len()];
            matrix.push(free.iter().map(|k| form[*k]).chain(padding).collect());
            right.push(of_base(form));
        }
        solve_over_determinant(g, &matrix, &right).map_err(|k| match free.get(k) {
            Some(k) => Error::NoHorizontalSpace { connection: kind.name(), direction: names[*k].clone() },
            None => restricted(),
        })?
    };
    let mut shift = vec![vec![g.zero(); n]; dim];
    for (a, row) in shift.iter_mut().enumerate() {
        for (i, entry) in row.iter_mut().enumerate() {
            let mut terms = vec![g.neg(lifts[i][n + a])];
            for (s, coefficients) in vertical.iter().zip(&correction) {
                terms.push(g.mul(coefficients[i], s[n + a]));
            }
            let sum = g.sum(&terms);
            *entry = g.cancel_zero(sum);
        }
    }
    for entry in shift.iter_mut().flatten() {
        *entry = fixed_on_the_base(model, kind, forms, *entry)?;
    }
    Ok(shift)
}

/// A coefficient of a derived connection as an expression without velocities and advected parameters.
///
/// # Errors
/// [`Error::ConnectionDependsOn`] when its value depends on one of them.
fn fixed_on_the_base(
    model: &mut Model,
    kind: ConnectionKind,
    forms: &[ConstraintRow],
    e: ExprId,
) -> Result<ExprId, Error> {
    let velocities = model.all_velocities().into_iter().map(|(name, s)| ("velocity", name.to_owned(), s));
    let advected = (model.advected.iter())
        .flat_map(|a| a.components.iter().map(|(name, s)| ("advected parameter", name.clone(), *s)));
    let accelerations = model.accelerations.iter();
    let accelerations = accelerations.map(|s| ("acceleration", model.graph.name(*s).to_owned(), *s));
    let first_order = model.first_order.iter();
    let first_order =
        first_order.flat_map(|s| s.components.iter().map(|(name, x)| ("state", name.clone(), *x)));
    let moving: Vec<(&str, String, SymbolId)> =
        velocities.chain(advected).chain(first_order).chain(accelerations).collect();
    let g = &mut model.graph;
    let mut value = e;
    for (sort, name, symbol) in moving {
        if !g.free_symbols(value).contains(&symbol) {
            continue;
        }
        // It may stand there without any effect.
        let slope = g.diff(value, symbol);
        let at_zero = g.subs(value, &BTreeMap::from([(symbol, g.zero())]));
        match at_zero {
            Ok(constant) if g.is_zero(slope) => value = constant,
            _ => {
                let mut coefficients = forms.iter().flat_map(|form| &form.one_form);
                let through = match coefficients.any(|c| g.free_symbols(*c).contains(&symbol)) {
                    true => "the virtual displacements",
                    false => "the kinetic energy",
                };
                let velocity = model.velocities[0].block.clone();
                return Err(Error::ConnectionDependsOn {
                    connection: kind.name(),
                    kind: sort,
                    name,
                    through,
                    velocity,
                });
            }
        }
    }
    Ok(value)
}

/// Replaces every velocity `v` of the algebra by `w - shift xdot`, in one-forms and forces contragrediently.
fn shift_velocities(model: &mut Model, shift: &[Vec<ExprId>]) -> Result<(), Error> {
    let g = &mut model.graph;
    let n = model.base.len();
    let mut replacement = BTreeMap::new();
    for (velocity, row) in model.velocities.iter().zip(shift) {
        let mut terms = vec![g.sym(velocity.symbol)];
        for (coordinate, a) in model.base.iter().zip(row) {
            let rate = g.sym(coordinate.velocity);
            let product = g.mul(*a, rate);
            terms.push(g.neg(product));
        }
        let value = g.sum(&terms);
        replacement.insert(velocity.symbol, value);
    }
    let prolonged = prolongation(model, &replacement);
    replacement.extend(&prolonged.accelerations);
    let (g, expressions) = model.expressions_mut();
    for (role, e) in expressions {
        let has_velocities = match role {
            ExpressionRole::Lagrangian
            | ExpressionRole::Force(_)
            | ExpressionRole::FirstOrderRate(_)
            | ExpressionRole::ConstraintResidual(_)
            | ExpressionRole::ConstraintAcceleration(_)
            | ExpressionRole::VirtualConstraint(_)
            | ExpressionRole::Reconstruction(_)
            | ExpressionRole::Casimir(_)
            | ExpressionRole::Output(_)
            | ExpressionRole::Lyapunov => true,
            // Linear in a velocity that stands for any element of the algebra.
            ExpressionRole::AdvectedAction(_) => false,
            ExpressionRole::Hamiltonian
            | ExpressionRole::Noise(_)
            | ExpressionRole::Impact(_)
            | ExpressionRole::ConstraintPosition(_)
            | ExpressionRole::Implied(_)
            | ExpressionRole::Algebroid
            | ExpressionRole::Frame
            | ExpressionRole::Given(_)
            | ExpressionRole::Section(_)
            | ExpressionRole::QuasiInvariance(_)
            | ExpressionRole::DomainEnd(_)
            | ExpressionRole::Condition(_)
            | ExpressionRole::Connection
            | ExpressionRole::Ideal
            | ExpressionRole::InnerProduct
            | ExpressionRole::StageConnection
            | ExpressionRole::Initial(_) => false,
        };
        if has_velocities {
            *e = g
                .subs(*e, &replacement)
                .map_err(|_| Error::DivisionByZero { place: "the change of connection".into() })?;
        }
    }
    let g = &mut model.graph;
    // Forces and one-forms on (xdot, v): the component along xdot_i loses shift^a_i times that along v^a.
    let lower = |g: &mut Graph, form: &mut [ExprId]| {
        for i in 0..n {
            let mut terms = vec![form[i]];
            for (a, row) in shift.iter().enumerate() {
                let product = g.mul(form[n + a], row[i]);
                terms.push(g.neg(product));
            }
            form[i] = g.sum(&terms);
        }
    };
    lower(g, &mut model.forces);
    // What moves along the base moves w by as much more.
    for section in &mut model.sections {
        for (a, row) in shift.iter().enumerate() {
            let mut terms = vec![section.coefficients[n + a]];
            terms.extend(row.iter().zip(&section.coefficients).map(|(e, along)| g.mul(*e, *along)));
            section.coefficients[n + a] = g.sum(&terms);
        }
    }
    for condition in &mut model.virtual_constraints {
        lower(g, &mut condition.one_form);
    }
    let along = |g: &mut Graph, jerk: &[ExprId], by: &BTreeMap<SymbolId, ExprId>| {
        let pairs = model.accelerations.iter().zip(jerk).filter_map(|(a, w)| Some((*w, *by.get(a)?)));
        let (weights, values): (Vec<ExprId>, Vec<ExprId>) = pairs.unzip();
        g.dot(&weights, &values)
    };
    for constraint in &mut model.constraints {
        if let ConstraintKind::ThirdOrder { jerk, carried } = &mut constraint.kind {
            let [lag, turning] = [&prolonged.lag, &prolonged.turning].map(|by| along(g, jerk, by));
            constraint.residual = g.add(constraint.residual, lag);
            carried.offset = g.add(carried.offset, turning);
            lower(g, jerk);
        }
        let ConstraintKind::SecondOrder { acceleration } = &mut constraint.kind else { continue };
        // vdot = wdot - shift xddot - (d shift/dx^j xdot^j + d shift/dt) xdot
        let mut turning = vec![constraint.residual];
        for (a, row) in shift.iter().enumerate() {
            for (i, e) in row.iter().enumerate() {
                let (explicit, rate) = (g.diff(*e, model.time), g.sym(model.base[i].velocity));
                let product = g.product(&[acceleration[n + a], explicit, rate]);
                turning.push(g.neg(product));
                for x in &model.base {
                    let slope = g.diff(*e, x.symbol);
                    let (along, rate) = (g.sym(x.velocity), g.sym(model.base[i].velocity));
                    let product = g.product(&[acceleration[n + a], slope, along, rate]);
                    turning.push(g.neg(product));
                }
            }
        }
        constraint.residual = g.sum(&turning);
        lower(g, acceleration);
    }
    Ok(())
}

/// Accelerations that go with the replaced velocities of the algebra.
fn prolongation(model: &mut Model, replacement: &BTreeMap<SymbolId, ExprId>) -> Prolonged {
    let own: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
    let eta: Vec<(SymbolId, SymbolId)> = own.into_iter().zip(model.accelerations.iter().copied()).collect();
    let g = &mut model.graph;
    let mut rates = BTreeMap::from([(model.time, g.one())]);
    rates.extend(model.base.iter().map(|c| (c.symbol, g.sym(c.velocity))));
    let values = eta.iter().filter_map(|(y, a)| Some((*a, *replacement.get(y)?)));
    prolonged(g, &values.collect::<Vec<_>>(), &rates, &eta)
}
