//! The Lie algebroid of a model: frame, anchor, bracket and drift.
//!
//! Does not know: Lagrangians, constraints, equations of motion.

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Rational, SymbolId};
use hamel_lang::algebra::Algebroid;
use hamel_lang::spec::{Model, Side};

/// Frame `(D_i, e_a)` over the coordinates `(x^i, advected)`, `D_i` the horizontal lift of `d/dx^i` for the connection
/// `A` (zero unless given): `[D_i, D_j] = -B^a_ij e_a`, `[D_i, e_b] = -[A_i, e_b]`, `[e_a, e_b] = C^c_ab e_c`,
/// `B^a_ij = d_i A^a_j - d_j A^a_i - C^a_bc A^b_i A^c_j`; every `C` changes sign for a right action. A connection that
/// depends on time has `[d/dt, D_i] = -dA^a_i/dt e_a`. The algebra is anchored by its action on the advected parameters
/// and `D_i = d_i - A^a_i e_a` there.
///
/// # Source
/// Cendra, Marsden, Ratiu 2001, section 3; Cortes, de Leon, Marrero, Martinez 2009, section 2.
///
/// # Errors
/// Every condition of a Lie algebroid that does not hold.
pub(super) fn algebroid_of(model: &mut Model) -> Result<Algebroid, Vec<Error>> {
    let n_shape = model.n_shape();
    let coordinates: Vec<SymbolId> = model.base.iter().map(|c| c.symbol).collect();
    let shape = coordinates[..n_shape].to_vec();
    let original: Option<Vec<(String, SymbolId)>> = model.frame.as_ref().map(|f| f.original.clone());
    let before = original.unwrap_or_else(|| {
        model.all_velocities().into_iter().map(|(name, symbol)| (name.to_owned(), symbol)).collect()
    });
    let advected = model.advected.iter().flat_map(|a| a.components.iter().map(|(_, s)| *s));
    let base: Vec<SymbolId> = coordinates.iter().copied().chain(advected).collect();
    let names: Vec<String> = before.iter().map(|(name, _)| name.clone()).collect();
    let frame = match &model.algebroid {
        // Its own elements are what an error is about.
        Some(own) => own.basis.clone(),
        None => names.clone(),
    };
    let g = &mut model.graph;
    let mut algebroid = Algebroid::new(g, model.time, base, frame);
    algebroid.set_almost(model.algebra.is_almost());
    if let Some(own) = &model.algebroid {
        algebroid.set_almost(own.is_almost);
        for (i, row) in own.anchor.iter().enumerate() {
            row.iter().enumerate().for_each(|(a, e)| algebroid.set_anchor(i, a, *e));
        }
        for bracket in &own.brackets {
            let [a, b] = bracket.pair;
            algebroid.set_bracket(a, b, bracket.value.clone());
        }
    }
    for i in 0..n_shape {
        algebroid.set_anchor(i, i, g.one());
    }
    let side = match model.action {
        Side::Left => Rational::from_integer(1.into()),
        Side::Right => Rational::from_integer((-1).into()),
    };
    for (a, b, value) in model.algebra.brackets() {
        let along = value.iter().map(|(c, q)| {
            let constant = g.number(q);
            (n_shape + c, g.scale(constant, &side))
        });
        let value = along.collect();
        algebroid.set_bracket(n_shape + a, n_shape + b, value);
    }
    if let Some(connection) = &model.connection {
        set_connection_brackets(g, &mut algebroid, &shape, connection);
        set_connection_drift(g, &mut algebroid, model.time, connection);
    }
    let mut component = coordinates.len();
    for advected in &model.advected {
        for &action in &advected.action {
            for (a, (_, velocity)) in before[n_shape..].iter().enumerate() {
                let slope = g.diff(action, *velocity);
                let value = g.scale(slope, &-side.clone());
                algebroid.set_anchor(component, n_shape + a, value);
            }
            for i in 0..n_shape {
                let Some(connection) = &model.connection else { break };
                let terms: Vec<ExprId> = (0..model.velocities.len())
                    .map(|a| g.mul(connection[a][i], algebroid.anchor(component, n_shape + a)))
                    .collect();
                let sum = g.sum(&terms);
                let value = g.neg(sum);
                algebroid.set_anchor(component, i, value);
            }
            component += 1;
        }
    }
    algebroid.verify(g)?;
    algebroid.rename_frame(names);
    Ok(algebroid)
}

/// `[D_i, D_j] = -B^a_ij e_a` and `[D_i, e_b] = -[A_i, e_b]`, with the bracket of the `e_a` already in place.
fn set_connection_brackets(
    g: &mut Graph,
    algebroid: &mut Algebroid,
    shape: &[SymbolId],
    connection: &[Vec<ExprId>],
) {
    let n = shape.len();
    let dim = connection.len();
    // [A_i, e_b] as a vector
    let bracket_with = |g: &mut Graph, algebroid: &Algebroid, i: usize, b: usize| -> Vec<ExprId> {
        let mut terms: Vec<Vec<ExprId>> = vec![Vec::new(); dim];
        for (a, row) in connection.iter().enumerate() {
            for (c, value) in algebroid.bracket(g, n + a, n + b) {
                terms[c - n].push(g.mul(row[i], value));
            }
        }
        terms.iter().map(|list| g.sum(list)).collect()
    };
    let sparse = |g: &mut Graph, vector: Vec<ExprId>| -> Vec<(usize, ExprId)> {
        let reduced: Vec<ExprId> = vector.into_iter().map(|e| g.cancel_zero(e)).collect();
        reduced.into_iter().enumerate().filter(|(_, e)| *e != g.zero()).map(|(a, e)| (n + a, e)).collect()
    };
    for i in 0..n {
        for j in i + 1..n {
            // -B = -(d_i A_j - d_j A_i) + [A_i, A_j]
            let mut value = Vec::new();
            for row in connection {
                let (forward, backward) = (g.diff(row[j], shape[i]), g.diff(row[i], shape[j]));
                value.push(g.sub(backward, forward));
            }
            for (b, row) in connection.iter().enumerate() {
                for (a, e) in bracket_with(g, algebroid, i, b).into_iter().enumerate() {
                    let term = g.mul(e, row[j]);
                    value[a] = g.add(value[a], term);
                }
            }
            let value = sparse(g, value);
            algebroid.set_bracket(i, j, value);
        }
        for b in 0..dim {
            let bracket = bracket_with(g, algebroid, i, b);
            let minus = bracket.into_iter().map(|e| g.neg(e)).collect();
            let value = sparse(g, minus);
            algebroid.set_bracket(i, n + b, value);
        }
    }
}

/// `[d/dt, D_i] = -dA^a_i/dt e_a`.
fn set_connection_drift(
    g: &mut Graph,
    algebroid: &mut Algebroid,
    time: SymbolId,
    connection: &[Vec<ExprId>],
) {
    let n = connection.first().map_or(0, Vec::len);
    for i in 0..n {
        let mut drift = Vec::new();
        for (a, row) in connection.iter().enumerate() {
            let rate = g.diff(row[i], time);
            let rate = g.cancel_zero(rate);
            if rate != g.zero() {
                drift.push((n + a, g.neg(rate)));
            }
        }
        if !drift.is_empty() {
            algebroid.set_drift(i, drift);
        }
    }
}
