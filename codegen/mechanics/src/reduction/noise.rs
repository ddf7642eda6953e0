//! White noise: what it adds to forces, and to the rates of base coordinates and of the group.
//!
//! ```text
//! xdot = rho (y + sum_k W_k v_k)
//! pdot_a = .. - sum_k W_k (C^c_ab v_k^b p_c + rho^i_a dh_k/dx^i),    v_k = dh_k/dp
//! ```
//!
//! which is the motion of `L`, or `h`, along the Hamiltonian vector fields of the `h_k`, in the sense of Stratonovich:
//! with `W_k` in the place of `dW_k/dt` everything is as for a smooth function of time. Where a constraint is solved,
//! `h_k` is a function of the momenta `p_b = W^a_b p_a` along virtual displacements, and `v_k` is one of these.
//!
//! Does not know: equations of motion, increments.
//!
//! # Source
//! Bismut 1981, Mecanique aleatoire; Lazaro-Cami and Ortega 2008, Stochastic Hamiltonian dynamical systems; Holm 2015,
//! Variational principles for stochastic fluid dynamics.

use std::collections::BTreeMap;

use hamel_expr::{DivisionByZero, ExprId, Graph, SymbolId};
use hamel_lang::algebra::Algebroid;
use hamel_lang::spec::{self, Diagnostic, ExpressionRole, Model, Noise};

use super::constraint::{KinematicConstraint, Unknown};
use super::momenta::{Hamiltonian, place_of};
use super::reconstruction::ReconstructedCoordinate;

/// What the noises of a model move.
pub(super) struct Setting<'a> {
    pub(super) algebroid: &'a Algebroid,
    pub(super) constraint: &'a KinematicConstraint,
    pub(super) unknowns: &'a [Unknown],
    pub(super) hamiltonian: Option<&'a Hamiltonian>,
}

/// What noises add, beside the forces.
#[derive(Default)]
pub(super) struct Transport {
    /// To the rates of base coordinates, `rho v`.
    pub(super) of_base: Vec<(SymbolId, ExprId)>,
    /// To the velocities, `v`.
    velocities: BTreeMap<SymbolId, ExprId>,
}

impl Transport {
    /// The coordinates of the group move with all velocities.
    ///
    /// # Errors
    /// [`DivisionByZero`].
    pub(super) fn moves(
        &self,
        g: &mut Graph,
        list: &mut [ReconstructedCoordinate],
    ) -> Result<(), DivisionByZero> {
        for coordinate in list.iter_mut().filter(|_| !self.velocities.is_empty()) {
            coordinate.rate = g.subs(coordinate.rate, &self.velocities)?;
        }
        Ok(())
    }
}

/// The noises that are not held.
pub(super) fn taken(model: &Model) -> impl Iterator<Item = &Noise> {
    model.noises.iter().filter(|noise| model.inputs.iter().any(|input| input.symbol == noise.symbol))
}

/// Adds the forces of all noises that are not held, and tells what else they add.
///
/// # Errors
/// A Hamiltonian with momenta that constraints determine or multipliers change, and of a model whose motion is given.
pub(super) fn add_forces(model: &mut Model, setting: &Setting<'_>) -> Result<Transport, Box<Diagnostic>> {
    let noises: Vec<Noise> = taken(model).cloned().collect();
    let m = setting.algebroid.frame().len();
    let zero = model.graph.zero();
    let mut velocities = vec![Vec::new(); m];
    for noise in &noises {
        let Some((h, span)) = noise.hamiltonian else { continue };
        let field = Field::of(model, noise, (h, span), setting)?;
        let g = &mut model.graph;
        let w = g.sym(noise.symbol);
        for alpha in 0..m {
            let force = field.force(g, setting.algebroid, alpha);
            let force = g.mul(w, force);
            model.forces[alpha] = g.add(model.forces[alpha], force);
            if field.v[alpha] != zero {
                velocities[alpha].push(g.mul(w, field.v[alpha]));
            }
        }
    }
    refuse_products(model, &noises)?;
    let mut transport = Transport::default();
    if velocities.iter().all(Vec::is_empty) {
        return Ok(transport);
    }
    let symbols: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, symbol)| symbol).collect();
    let g = &mut model.graph;
    let velocities: Vec<ExprId> = velocities.iter().map(|terms| g.sum(terms)).collect();
    for (i, x) in setting.algebroid.base().iter().enumerate() {
        let row: Vec<ExprId> = (0..m).map(|alpha| setting.algebroid.anchor(i, alpha)).collect();
        let rate = g.dot(&row, &velocities);
        if rate != zero {
            transport.of_base.push((*x, rate));
        }
    }
    for (symbol, v) in symbols.into_iter().zip(velocities).filter(|(_, v)| *v != zero) {
        let y = g.sym(symbol);
        transport.velocities.insert(symbol, g.add(y, v));
    }
    Ok(transport)
}

/// The Hamiltonian vector field of a function on the dual of the algebroid, at the momenta of the motion.
struct Field {
    /// `v = dh/dp`.
    v: Vec<ExprId>,
    /// `dh/dx`.
    slopes: Vec<ExprId>,
    /// `p`.
    momenta: Vec<ExprId>,
}

impl Field {
    fn of(
        model: &mut Model,
        noise: &Noise,
        (h, span): (ExprId, Option<spec::Span>),
        setting: &Setting<'_>,
    ) -> Result<Field, Box<Diagnostic>> {
        let m = setting.algebroid.frame().len();
        let refused = |model: &Model, message: String, help: &str| {
            Box::new(spec::diagnose(model, span.or(noise.span), message, help.to_owned()))
        };
        let what = noise.function();
        if model.given.is_some() {
            let message = format!("{what} moves nothing: the model gives its motion");
            return Err(refused(model, message, "mention the noise in `field` or `acceleration`"));
        }
        let free = model.graph.free_symbols(h);
        let components: Vec<(String, SymbolId, usize)> =
            model.momenta.iter().flat_map(|momentum| momentum.components.iter().cloned()).collect();
        let named: Vec<_> = components.into_iter().filter(|(_, symbol, _)| free.contains(symbol)).collect();
        let velocities: Vec<SymbolId> =
            model.all_velocities().into_iter().map(|(_, symbol)| symbol).collect();
        // `p_a` by symbols that stand for all of them while `h` is differentiated.
        let p: Vec<SymbolId> = match setting.hamiltonian {
            Some(hamiltonian) => hamiltonian.momenta.clone(),
            None => (0..m).map(|alpha| model.graph.symbol(&format!("p_{}_{alpha}", noise.name))).collect(),
        };
        let along: Vec<ExprId> = p.iter().map(|symbol| model.graph.sym(*symbol)).collect();
        let mut by_frame: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
        for (name, symbol, velocity) in named {
            let Some(unknown) = place_of(model, setting.unknowns, velocity) else {
                let message =
                    format!("{what} contains the momentum `{name}`, which the constraints determine");
                return Err(refused(
                    model,
                    message,
                    "write it by other momenta, or choose others with `independent`",
                ));
            };
            let value = match setting.constraint {
                KinematicConstraint::Solved(solved) => {
                    let column: Vec<ExprId> =
                        solved.virtual_displacements.iter().map(|row| row[unknown]).collect();
                    let allowed = solved.psi.iter().map(|row| row[unknown]);
                    if !column.iter().copied().eq(allowed) {
                        let message = format!(
                            "{what} contains the momentum `{name}`, whose displacements are no velocities that the \
                             constraints allow"
                        );
                        return Err(refused(
                            model,
                            message,
                            "noise there is for functions of the position alone",
                        ));
                    }
                    model.graph.dot(&column, &along)
                }
                KinematicConstraint::Multipliers { rows, .. } if rows.is_empty() => along[unknown],
                KinematicConstraint::Multipliers { .. } => {
                    let message =
                        format!("{what} contains the momentum `{name}`, and multipliers keep a constraint");
                    let help = "solve the constraint, with `independent`, or let the noise depend on the position alone";
                    return Err(refused(model, message, help));
                }
            };
            by_frame.insert(symbol, value);
        }
        let g = &mut model.graph;
        let divided = |model: &Model| {
            refused(model, format!("{what} divides by zero"), "divide by something that does not vanish")
        };
        let Ok(h) = g.subs(h, &by_frame) else { return Err(divided(model)) };
        let v: Vec<ExprId> = p.iter().map(|symbol| g.diff(h, *symbol)).collect();
        let slopes: Vec<ExprId> = setting.algebroid.base().iter().map(|x| g.diff(h, *x)).collect();
        let momenta: Vec<ExprId> = match setting.hamiltonian {
            Some(_) => along,
            None => velocities.iter().map(|y| g.diff(model.lagrangian, *y)).collect(),
        };
        let values: BTreeMap<SymbolId, ExprId> = p.into_iter().zip(momenta.iter().copied()).collect();
        let mut at = |list: Vec<ExprId>| g.subs_all(&list, &values);
        match (at(v), at(slopes)) {
            (Ok(v), Ok(slopes)) => Ok(Field { v, slopes, momenta }),
            _ => Err(divided(model)),
        }
    }

    /// `-C^c_ab v^b p_c - rho^i_a dh/dx^i`.
    fn force(&self, g: &mut Graph, algebroid: &Algebroid, alpha: usize) -> ExprId {
        let mut terms = Vec::new();
        for (i, slope) in self.slopes.iter().enumerate() {
            terms.push(g.mul(algebroid.anchor(i, alpha), *slope));
        }
        for (beta, v) in self.v.iter().enumerate() {
            if *v == g.zero() {
                continue;
            }
            for (gamma, c) in algebroid.bracket(g, alpha, beta) {
                terms.push(g.product(&[c, *v, self.momenta[gamma]]));
            }
        }
        let sum = g.sum(&terms);
        g.neg(sum)
    }
}

fn told(model: &Model, role: ExpressionRole) -> String {
    match role {
        ExpressionRole::Force(k) => format!("the force on `{}`", model.all_velocities()[k].0),
        ExpressionRole::Given(k) => format!("the motion of `{}`", model.all_velocities()[k].0),
        ExpressionRole::FirstOrderRate(k) => format!("the rate of `{}`", model.first_order[k].name),
        ExpressionRole::Reconstruction(k) => format!("the rate of `{}`", model.reconstruction[k].names[0]),
        _ => "a constraint".to_owned(),
    }
}

/// A product of noises is no noise, and has no value.
fn refuse_products(model: &mut Model, noises: &[Noise]) -> Result<(), Box<Diagnostic>> {
    let expressions = model.expressions();
    for (role, e) in expressions {
        let free = model.graph.free_symbols(e);
        for a in noises.iter().filter(|a| free.contains(&a.symbol)) {
            let slope = model.graph.diff(e, a.symbol);
            for b in noises {
                let second = model.graph.diff(slope, b.symbol);
                if !model.graph.is_zero(second) {
                    let message = format!("{} is not linear in the noise `{}`", told(model, role), a.name);
                    let help = "what a noise moves is proportional to it: its square has no value";
                    return Err(Box::new(spec::diagnose(model, a.span, message, help.to_owned())));
                }
            }
        }
    }
    Ok(())
}
