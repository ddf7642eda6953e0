//! Virtual displacements of their own: the connection whose horizontal space they are, and the equations of motion with
//! multipliers beside those along the displacements, as expressions that can be shown and that the motion is held to.
//!
//! Does not know: how the motion was derived, how anything is printed.

use std::collections::{BTreeMap, BTreeSet};

use crate::reduction::{KinematicConstraint, ReducedSystem};
use hamel_expr::{Definition, ExprId, Graph, SymbolId, Vanishing, sign_of};
use hamel_lang::algebra::solve_symbolic;
use hamel_lang::spec::Want;

use super::equations::{Equations, OutputKind};
use super::integrable::bracket_of_sections;
use super::rates::rates;

/// Both forms of the equations of a generalised nonholonomic system, whose virtual displacements
/// `C_V = { delta : f_A(delta) = 0 }` are not the velocities that its constraints allow.
///
/// With a complement `R` of `C_V`, spanned by sections `e_c` of the frame, `C_V` is the kernel of the projection to `R`
/// along it, the connection `A = f_R^-1 f`, and has the sections `W_b = e_b - A^c_b e_c` for the other `b`. With
///
/// `E_a = d/dt p_a + C^c_ab y^b p_c - N^c_a p_c - rho^i_a dL/dx^i - F_a`
///
/// the equations of motion are `E = lambda_A f_A` with multipliers and `E_b - A^c_b E_c = 0` along the displacements.
/// The brackets have the side of the action in their signs.
///
/// # Source
/// Grillo, Zuccalli 2012, sections 2 and 3, with the signs for a right action (remarks 5 and 8 there).
#[derive(Clone, Debug)]
pub struct DisplacementForms {
    /// Owner of the expressions here.
    pub graph: Graph,
    /// Symbols of a displacement, in frame order.
    pub displacement: Vec<SymbolId>,
    /// `f_A(delta)`, which vanish.
    pub conditions: Vec<ExprId>,
    /// Sections of the frame that span `R`, ascending.
    pub complement: Vec<usize>,
    /// The components `A^c(delta)` of the connection, in the order of the complement.
    pub connection: Vec<ExprId>,
    /// `B^c(W_a, W_b) = -A^c([W_a, W_b])` as `(a, b, c, value)` for `a < b` where it does not vanish; none where
    /// displacements depend on velocities or accelerations, so that they span no distribution on the base.
    pub curvature: Option<Vec<(usize, usize, usize, ExprId)>>,
    /// The equations; none where the state has no velocities that they are written in, or where the motion is not seen
    /// to satisfy one.
    pub equations: Option<BothEquations>,
}

/// The equations with multipliers, and their projection on the displacements.
#[derive(Clone, Debug)]
pub struct BothEquations {
    /// `E_a` in frame order, by momenta `p_a` and their rates.
    pub residuals: Vec<Definition>,
    /// `E_a` and what it is equal to, in frame order.
    pub with_multipliers: Vec<(ExprId, ExprId)>,
    /// What vanishes, one for each section that spans `C_V`.
    pub projected: Vec<ExprId>,
}

impl DisplacementForms {
    /// The forms of a system; none without conditions, and where their independence is not seen.
    ///
    /// Every symbol of a momentum, a rate or a multiplier stands for its value along the motion.
    ///
    /// `n_shape`: the number of base velocities, which come first.
    pub fn new(equations: &Equations, n_shape: usize) -> Option<DisplacementForms> {
        let system = &equations.system;
        let forms = match &system.constraint {
            KinematicConstraint::Solved(solved) => &solved.reactions.one_forms,
            KinematicConstraint::Multipliers { reactions, .. } => reactions,
        };
        let mut g = system.graph.clone();
        let m = system.velocities.len();
        let complement = complement_of(&mut g, system, (forms, n_shape)).filter(|list| !list.is_empty())?;
        let restricted: Vec<Vec<ExprId>> =
            forms.iter().map(|form| complement.iter().map(|c| form[*c]).collect()).collect();
        let rows = solve_symbolic(&mut g, &restricted, forms).ok()?;
        let rows: Vec<Vec<ExprId>> =
            rows.into_iter().map(|row| row.into_iter().map(|e| g.cancel_zero(e)).collect()).collect();
        let names: Vec<String> = system.algebroid.frame().iter().map(|n| format!("delta_{n}")).collect();
        let displacement: Vec<SymbolId> = names.iter().map(|name| g.symbol(name)).collect();
        let symbols: Vec<ExprId> = displacement.iter().map(|s| g.sym(*s)).collect();
        let conditions = forms.iter().map(|form| g.dot(form, &symbols)).collect();
        let connection = rows.iter().map(|row| g.dot(row, &symbols)).collect();
        let sections: Vec<(usize, Vec<ExprId>)> = (0..m)
            .filter(|b| !complement.contains(b))
            .map(|b| {
                let mut section = vec![g.zero(); m];
                section[b] = g.one();
                for (c, row) in complement.iter().zip(&rows) {
                    section[*c] = g.neg(row[b]);
                }
                (b, section)
            })
            .collect();
        let curvature = curvature(&mut g, system, (&complement, &rows), &sections);
        let equations = both(&mut g, equations, forms, &sections);
        Some(DisplacementForms {
            graph: g,
            displacement,
            conditions,
            complement,
            connection,
            curvature,
            equations,
        })
    }
}

/// Columns on which the forms are inverted, ascending: at each step the entry that is best to divide by, a number or
/// one of a definite sign first, along the algebra first.
fn complement_of(
    g: &mut Graph,
    system: &ReducedSystem,
    (forms, n_shape): (&[Vec<ExprId>], usize),
) -> Option<Vec<usize>> {
    let mut rows = forms.to_vec();
    let mut columns = Vec::new();
    while !rows.is_empty() {
        let mut best: Option<([bool; 3], usize, usize)> = None;
        for (r, row) in rows.iter().enumerate() {
            for (k, e) in row.iter().enumerate() {
                if columns.contains(&k) || g.vanishing(*e) != Vanishing::NonZero {
                    continue;
                }
                let is_number = g.as_rational(*e).is_some();
                let is_safe = is_number || sign_of(g, *e, &system.signs).is_definite();
                let grade = [!is_safe, k < n_shape, !is_number];
                if best.is_none_or(|(known, ..)| grade < known) {
                    best = Some((grade, r, k));
                }
            }
        }
        let (_, r, column) = best?;
        let pivot = rows.remove(r);
        for row in &mut rows {
            let (p, entry) = (pivot[column], row[column]);
            for (e, of_pivot) in row.iter_mut().zip(&pivot) {
                let (kept, taken) = (g.mul(*e, p), g.mul(*of_pivot, entry));
                let difference = g.sub(kept, taken);
                *e = g.cancel_zero(difference);
            }
        }
        columns.push(column);
    }
    columns.sort_unstable();
    Some(columns)
}

fn curvature(
    g: &mut Graph,
    system: &ReducedSystem,
    (complement, rows): (&[usize], &[Vec<ExprId>]),
    sections: &[(usize, Vec<ExprId>)],
) -> Option<Vec<(usize, usize, usize, ExprId)>> {
    let carried = system.higher.carried.iter().map(|c| c.symbol);
    let carried = carried.chain(system.own_rates.iter().map(|own| own.symbol));
    let moving: BTreeSet<SymbolId> = system.velocities.iter().copied().chain(carried).collect();
    if rows.iter().flatten().any(|e| g.depends_on(*e, &moving)) {
        return None;
    }
    let mut found = Vec::new();
    for (k, (a, x)) in sections.iter().enumerate() {
        for (b, y) in &sections[k + 1..] {
            let bracket = bracket_of_sections(g, &system.algebroid, x, y);
            for (c, row) in complement.iter().zip(rows) {
                let along = g.dot(row, &bracket);
                let value = g.neg(along);
                let value = g.cancel_zero(value);
                if value != g.zero() {
                    found.push((*a, *b, *c, value));
                }
            }
        }
    }
    Some(found)
}

fn both(
    g: &mut Graph,
    equations: &Equations,
    forms: &[Vec<ExprId>],
    sections: &[(usize, Vec<ExprId>)],
) -> Option<BothEquations> {
    let system = &equations.system;
    let is_written_otherwise = system.hamiltonian.is_some()
        || !system.momenta.is_empty()
        || system.frame.is_some()
        || system.degeneracy.is_some();
    if is_written_otherwise {
        return None;
    }
    let frame = system.algebroid.frame();
    // Velocities that the constraint determines, under their names.
    let mut y = Vec::new();
    let mut named = BTreeMap::new();
    for ((symbol, name), value) in system.velocities.iter().zip(frame).zip(&equations.velocities) {
        let own = g.sym(*symbol);
        let along = if *value == own {
            own
        } else {
            let s = g.define(name, *value);
            g.sym(s)
        };
        named.insert(*symbol, along);
        y.push(along);
    }
    let raw: Vec<ExprId> = system.velocities.iter().map(|s| g.diff(system.lagrangian, *s)).collect();
    let known: BTreeMap<SymbolId, ExprId> =
        system.velocities.iter().copied().zip(equations.velocities.iter().copied()).collect();
    let values = g.subs_all(&raw, &known).ok()?;
    let slopes = rates(g, equations, &equations.state, &values);
    let (mut p, mut residuals) = (Vec::new(), Vec::new());
    let mut p_dot = Vec::new();
    for ((name, value), slope) in frame.iter().zip(values).zip(slopes) {
        let [momentum, rate] = [(format!("p_{name}"), value), (format!("dot_p_{name}"), slope)]
            .map(|(name, e)| g.define(&name, e));
        p.push(g.sym(momentum));
        p_dot.push(g.sym(rate));
    }
    let mut by_base = Vec::new();
    for x in system.algebroid.base() {
        let slope = g.diff(system.lagrangian, *x);
        by_base.push(g.subs(slope, &named).ok()?);
    }
    for (alpha, name) in frame.iter().enumerate() {
        let force = g.subs(system.forces[alpha], &named).ok()?;
        let net = system.algebroid.net_force(g, (alpha, force), &y, &p, &by_base);
        let expr = g.sub(p_dot[alpha], net);
        let symbol = g.define(&format!("E_{name}"), expr);
        residuals.push(Definition { symbol, expr });
    }
    let outputs = equations.outputs.iter().find(|o| o.kind == OutputKind::Group(Want::Multipliers))?;
    if outputs.components.len() != forms.len() {
        return None;
    }
    let lambda: Vec<ExprId> = (outputs.components.iter())
        .map(|(name, value)| {
            let symbol = g.define(name, *value);
            g.sym(symbol)
        })
        .collect();
    let e: Vec<ExprId> = residuals.iter().map(|d| g.sym(d.symbol)).collect();
    let (mut with_multipliers, mut projected) = (Vec::new(), Vec::new());
    for (alpha, left) in e.iter().enumerate() {
        let column: Vec<ExprId> = forms.iter().map(|form| form[alpha]).collect();
        let column = g.subs_all(&column, &named).ok()?;
        let right = g.dot(&column, &lambda);
        if !g.is_equal(*left, right) {
            return None;
        }
        with_multipliers.push((*left, right));
    }
    for (_, section) in sections {
        let section = g.subs_all(section, &named).ok()?;
        let left = g.dot(&section, &e);
        if g.vanishing(left) != Vanishing::Zero {
            return None;
        }
        projected.push(left);
    }
    Some(BothEquations { residuals, with_multipliers, projected })
}
