//! A Hamiltonian motion as a sum of motions with flows in closed form.
//!
//! Where the bracket is affine in the state, a function `h` of linear forms that commute, `a_1 = v_1 . y, ..`, moves
//! the state by
//!
//! ```text
//! y' = Pi dh = sum_a omega_a B_a y,   omega_a = dh/da_a,   B_a y = Pi v_a
//! ```
//!
//! Along this motion the forms, hence the `omega_a`, are constant, and the matrices `B_a` commute:
//!
//! ```text
//! Phi(tau) = exp(tau omega_1 B_1) exp(tau omega_2 B_2) ..
//! ```
//!
//! is linear with coefficients in closed form, a motion along coadjoint orbits that keeps all Casimirs. Quadratic
//! Hamiltonians are sums of squares of linear forms, and of quadratic forms of commuting components; functions of
//! commuting components may be any. A Casimir moves nothing: a multiple of one is left out where fewer pieces remain.
//!
//! What is found is proved: the forms of a piece commute, as do their matrices; the exponentials are those of the
//! matrices; the motions add up to that of the equations.
//!
//! Deliberately does not know: how flows are composed, which scene wants them.
//!
//! # Source
//! McLachlan 1993, Explicit Lie-Poisson integration and the Euler equations; Reich 1994, Momentum conserving
//! symplectic integrators.

mod exponential;
mod pieces;
mod poisson;

use std::collections::{BTreeMap, BTreeSet};

use crate::reduction::KinematicConstraint;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Section, SectionWriter, Style, SymbolId, needed_sections};
use hamel_lang::spec::Want;

use super::bracket::Bracket;
use super::chart::Chart;
use super::equations::{Equations, OutputKind};
use exponential::{Exponential, product, vanishes};
use pieces::{Frequency, Hamiltonian, Piece};
use poisson::AffineBracket;

/// States of more components are not looked into.
const MAX_COMPONENTS: usize = 64;

/// A part of the motion with a flow in closed form.
#[derive(Clone, Debug)]
pub struct SplitFlow {
    /// The forms `v_a . y` that the part of the Hamiltonian is a function of, with its derivatives `omega_a` by them.
    pub forms: Vec<(ExprId, ExprId)>,
    /// `Phi(tau, y) - y`, a component for each of the state.
    pub increment: Vec<ExprId>,
}

/// The motion of [`Equations`] as a sum of motions with flows in closed form.
#[derive(Clone, Debug)]
pub struct Splitting {
    /// The time of the flows.
    pub tau: SymbolId,
    /// The flows, in the order in which they are composed.
    pub flows: Vec<SplitFlow>,
    /// Casimirs of which a multiple has been left out of the Hamiltonian, with the factor.
    pub casimirs: Vec<(String, ExprId)>,
    /// Definitions that the increments use, to come after those of the equations.
    pub sections: Vec<Section>,
}

impl Splitting {
    /// Finds a splitting.
    ///
    /// # Errors
    /// [`Error::NoSplitting`] with what stands in the way; as [`Bracket::new`]; [`Error::OverBudget`].
    pub fn new(g: &mut Graph, equations: &Equations) -> Result<Splitting, Error> {
        let refused = |reason: String| Error::NoSplitting { reason };
        let n = equations.state.len();
        if n > MAX_COMPONENTS {
            return Err(refused(format!("it is not looked for with more than {MAX_COMPONENTS} components")));
        }
        if let KinematicConstraint::Multipliers { rows, .. } = &equations.system.constraint
            && !rows.is_empty()
        {
            return Err(refused("multipliers keep a constraint".into()));
        }
        let bracket = Bracket::new(g, equations).map_err(|error| match error {
            Error::NoBracket { reason } => refused(reason),
            other => other,
        })?;
        if bracket.has_remainder(g) {
            return Err(refused("an affine constraint, explicit time or a force acts".into()));
        }
        // Flows take no time but their own, so that a Hamiltonian that depends on time would stand still.
        let clock = BTreeSet::from([equations.system.time]);
        let sections = needed_sections(g, &equations.sections, &[equations.energy]);
        let values = sections.iter().flat_map(|s| &s.definitions).map(|d| d.expr).chain([equations.energy]);
        if values.into_iter().any(|e| g.depends_on(e, &clock)) {
            return Err(refused("the Hamiltonian depends on time".into()));
        }
        let chart = Chart::new(g, equations)?;
        let symbols: Vec<SymbolId> = equations.state.iter().map(|s| s.symbol).collect();
        let name = |i: usize| equations.state[i].name.as_str();
        let matrix: Vec<ExprId> = bracket.matrix(g).into_iter().flatten().collect();
        let matrix = chart.whole(g, &bracket.sections, &matrix)?;
        let matrix: Vec<Vec<ExprId>> =
            matrix.chunks(n.max(1)).map(|row| row.iter().map(|e| g.cancel_zero(*e)).collect()).collect();
        let poisson = AffineBracket::new(g, &symbols, matrix).map_err(|(i, j)| {
            refused(format!("the bracket of {} and {} is not affine in the state", name(i), name(j)))
        })?;
        g.within_budget()?;
        let slopes = slopes(g, equations, &chart, &symbols)?;
        let hamiltonian = Hamiltonian::new(g, &poisson, &symbols, slopes).map_err(|(i, j)| {
            refused(format!(
                "the Hamiltonian is no polynomial of second degree in {} and {}, which do not commute",
                name(i),
                name(j)
            ))
        })?;
        g.within_budget()?;
        let casimirs = quadratic_casimirs(g, equations, &chart, &poisson, &symbols)?;
        let second: Vec<Vec<Vec<ExprId>>> = casimirs.iter().map(|c| c.second.clone()).collect();
        let singular = || refused("the Hamiltonian has no value where the state is zero".into());
        let (pieces, factors) = hamiltonian.pieces(g, &second).ok_or_else(singular)?;
        g.within_budget()?;
        if pieces.is_empty() {
            return Err(refused("the Hamiltonian is a Casimir, and nothing moves".into()));
        }
        let tau = g.symbol("tau");
        let varying: BTreeSet<SymbolId> = symbols.iter().copied().chain([tau]).collect();
        let mut writer = SectionWriter::new(g, varying, &[]);
        let pieces = named(g, &mut writer, equations, pieces);
        let pieces = ordered(g, &poisson, pieces, equations)?;
        let mut flows = Vec::new();
        for (k, (piece, exponentials)) in pieces.iter().enumerate() {
            let flow = flow(g, &mut writer, k + 1, (&symbols, tau), piece, exponentials);
            flows.push(flow.ok_or_else(singular)?);
        }
        let casimirs = casimirs.into_iter().zip(factors);
        let casimirs = casimirs.filter(|(_, factor)| *factor != g.zero());
        let casimirs = casimirs.map(|(casimir, factor)| (casimir.name, factor)).collect();
        let splitting = Splitting { tau, flows, casimirs, sections: writer.finish().0 };
        let pieces: Vec<&Piece> = pieces.iter().map(|(piece, _)| piece).collect();
        prove(g, equations, &chart, &poisson, &symbols, &pieces)?;
        g.within_budget()?;
        Ok(splitting)
    }
}

/// The derivatives of the energy by the state: velocities where they are such, which are shorter.
fn slopes(
    g: &mut Graph,
    equations: &Equations,
    chart: &Chart,
    symbols: &[SymbolId],
) -> Result<Vec<ExprId>, Error> {
    let energy = chart.whole(g, &[], &[equations.energy])?[0];
    let velocities = chart.whole(g, &[], &equations.velocities)?;
    let mut slopes = Vec::new();
    for x in symbols {
        let slope = g.diff(energy, *x);
        let slope = g.cancel_zero(slope);
        let known = velocities.iter().find(|y| g.fingerprints_agree(**y, slope));
        slopes.push(known.copied().unwrap_or(slope));
    }
    Ok(slopes)
}

/// A Casimir that is a quadratic form.
struct QuadraticCasimir {
    name: String,
    /// Its second derivatives.
    second: Vec<Vec<ExprId>>,
}

/// The Casimirs of the bracket among those of the model that are quadratic.
fn quadratic_casimirs(
    g: &mut Graph,
    equations: &Equations,
    chart: &Chart,
    poisson: &AffineBracket,
    symbols: &[SymbolId],
) -> Result<Vec<QuadraticCasimir>, Error> {
    let groups = equations.outputs.iter().filter(|o| o.kind == OutputKind::Group(Want::Casimirs));
    let mut found = Vec::new();
    for (name, e) in groups.flat_map(|o| &o.components) {
        let value = chart.whole(g, &[], &[*e])?[0];
        let gradient: Vec<ExprId> = symbols.iter().map(|x| g.diff(value, *x)).collect();
        let mut rows = Vec::new();
        for slope in &gradient {
            match g.affine_parts(*slope, symbols) {
                Some((row, offset)) if offset == g.zero() => rows.push(row),
                _ => break,
            }
        }
        let field = poisson.times(g, &gradient);
        if rows.len() == symbols.len() && field.iter().all(|e| g.is_zero(*e)) {
            found.push(QuadraticCasimir { name: name.clone(), second: rows });
        }
    }
    Ok(found)
}

/// The pieces with names for the coefficients of their forms, and for the weights of squares: what is computed of them
/// then says that these are numbers.
fn named(
    g: &mut Graph,
    writer: &mut SectionWriter,
    equations: &Equations,
    mut pieces: Vec<Piece>,
) -> Vec<Piece> {
    writer.begin("linear forms of which the Hamiltonian is a sum of functions");
    for (k, term) in pieces.iter_mut().flat_map(|piece| &mut piece.terms).enumerate() {
        for (e, component) in term.form.iter_mut().zip(&equations.state) {
            *e = writer.define(g, &format!("form{}_{}", k + 1, component.name), *e);
        }
        if let Frequency::OfSquare(weight) = &mut term.frequency {
            *weight = writer.define(g, &format!("weight{}", k + 1), *weight);
        }
    }
    pieces
}

/// The pieces with the exponentials of their matrices, in the order in which least is computed: a composition applies
/// the first and the last flow half as often as the others.
fn ordered(
    g: &mut Graph,
    poisson: &AffineBracket,
    pieces: Vec<Piece>,
    equations: &Equations,
) -> Result<Vec<(Piece, Vec<Exponential>)>, Error> {
    let mut priced = Vec::new();
    for piece in pieces {
        let (mut exponentials, mut price) = (Vec::new(), 0);
        for term in &piece.terms {
            let matrix = poisson.generator(g, &term.form);
            let exponential = Exponential::new(g, &matrix, &equations.system.signs);
            let exponential = exponential.ok_or_else(|| {
                let form = value_of(g, equations, &term.form);
                let form = g.display(form, Style::Plain);
                Error::NoSplitting { reason: format!("the flow of functions of {form} has no closed form") }
            })?;
            let n_entries = matrix.iter().flatten().filter(|e| **e != g.zero()).count();
            price += n_entries + if exponential.has_functions() { 20 } else { 0 };
            exponentials.push(exponential);
        }
        priced.push((price, piece, exponentials));
    }
    priced.sort_by_key(|(price, ..)| std::cmp::Reverse(*price));
    let mut pieces: Vec<_> =
        priced.into_iter().map(|(_, piece, exponentials)| (piece, exponentials)).collect();
    if pieces.len() > 2 {
        let second = pieces.remove(1);
        pieces.push(second);
    }
    Ok(pieces)
}

/// `v . y`.
fn value_of(g: &mut Graph, equations: &Equations, form: &[ExprId]) -> ExprId {
    let y: Vec<ExprId> = equations.state.iter().map(|s| g.sym(s.symbol)).collect();
    g.dot(form, &y)
}

/// The flow of a piece: the product of the exponentials of its terms.
fn flow(
    g: &mut Graph,
    writer: &mut SectionWriter,
    number: usize,
    (symbols, tau): (&[SymbolId], SymbolId),
    piece: &Piece,
    exponentials: &[Exponential],
) -> Option<SplitFlow> {
    writer.begin(&format!("flow {number}"));
    let mut start: Vec<ExprId> = symbols.iter().map(|s| g.sym(*s)).collect();
    start.push(g.one());
    let tau = g.sym(tau);
    let mut moved = start.clone();
    let mut steps: Vec<Vec<ExprId>> = Vec::new();
    let mut forms = Vec::new();
    for (k, (term, exponential)) in piece.terms.iter().zip(exponentials).enumerate() {
        let stem = match piece.terms.len() {
            1 => format!("flow{number}"),
            _ => format!("flow{number}_{}", k + 1),
        };
        let rate = term.rate(g, symbols);
        let named = writer.define(g, &format!("{stem}_rate"), rate);
        let s = g.mul(tau, named);
        let step = exponential.increment(g, writer, &stem, s, &moved)?;
        for (place, e) in step.iter().enumerate() {
            let sum = g.add(moved[place], *e);
            moved[place] = writer.define(g, &format!("{stem}_y{place}"), sum);
        }
        steps.push(step);
        let value = g.dot(&term.form, &start[..symbols.len()]);
        forms.push((value, rate));
    }
    let increment = (0..symbols.len()).map(|i| {
        let parts: Vec<ExprId> = steps.iter().map(|step| step[i]).collect();
        g.sum(&parts)
    });
    Some(SplitFlow { increment: increment.collect(), forms })
}

/// The forms of a piece commute, their matrices too, frequencies are constant along its motion, and the motions add up.
fn prove(
    g: &mut Graph,
    equations: &Equations,
    chart: &Chart,
    poisson: &AffineBracket,
    symbols: &[SymbolId],
    pieces: &[&Piece],
) -> Result<(), Error> {
    let unverified = |claim: &str| Error::Unverified {
        claim: claim.to_owned(),
        residual: "the difference of both sides".into(),
        component: None,
    };
    let mut whole: Vec<Vec<ExprId>> = vec![Vec::new(); symbols.len()];
    for piece in pieces {
        for a in &piece.terms {
            let field = poisson.times(g, &a.form);
            let along: BTreeMap<SymbolId, ExprId> =
                symbols.iter().copied().zip(field.iter().copied()).collect();
            let matrix = poisson.generator(g, &a.form);
            for b in &piece.terms {
                let rate = b.rate(g, symbols);
                let change = g.derivative_along(rate, &along);
                if !g.is_zero(change) || !poisson.commute(g, &b.form, &a.form) {
                    return Err(unverified("frequencies and forms are constant along a piece of the motion"));
                }
                let other = poisson.generator(g, &b.form);
                let (ab, ba) = (product(g, &matrix, &other), product(g, &other, &matrix));
                let pairs = ab.iter().zip(&ba);
                let difference: Vec<Vec<ExprId>> =
                    pairs.map(|(a, b)| a.iter().zip(b).map(|(a, b)| g.sub(*a, *b)).collect()).collect();
                if !vanishes(g, &difference) {
                    return Err(unverified("the flows of a piece of the motion commute"));
                }
            }
            let rate = a.rate(g, symbols);
            for (sum, e) in whole.iter_mut().zip(field) {
                sum.push(g.mul(rate, e));
            }
        }
    }
    let rates: Vec<ExprId> = equations.state.iter().map(|s| s.derivative).collect();
    let rates = chart.whole(g, &[], &rates)?;
    for (rate, terms) in rates.into_iter().zip(whole) {
        let sum = g.sum(&terms);
        if !g.is_equal(rate, sum) {
            return Err(unverified("the pieces of the motion add up to the motion"));
        }
    }
    Ok(())
}
