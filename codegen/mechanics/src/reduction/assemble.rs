//! A model on its Lie algebroid.
//!
//! Does not know: fixed parameters, derived connections, points of circles; those are rewrites before and after it.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Sign, Stage, SymbolId, sign_of};
use hamel_lang::spec::{self, Coordinate, Diagnostics, InnerProduct, Model, ReconstructionKind};

use super::algebroid::algebroid_of;
use super::constraint::{
    HigherOrder, KinematicConstraint, Unknown, constrain, frame_unknowns, refused, settled,
};
use super::degenerate;
use super::domain::{domains, signs};
use super::formulation::Formulation;
use super::frame::in_quasi_frame;
use super::given;
use super::momenta::{self, CarriedMomentum};
use super::noise;
use super::reconstruction;
use super::stages::Stages;
use super::system::{Block, BlockKind, Feedback, OwnRate, PositionResidual, ReducedSystem, StateKind};

/// A model that says everything itself on its Lie algebroid: no connection is left to derive.
///
/// # Errors
/// Conditions of the algebroid and of the chain of stages that do not hold, constraints that cannot be carried; all of
/// them together.
pub(super) fn on_algebroid(
    mut model: Model,
    formulation: &Formulation,
) -> Result<ReducedSystem, Diagnostics> {
    model.graph.enter(Stage::Reduction);
    let mut problems = Vec::new();
    let algebroid = algebroid_of(&mut model).map_err(|errors| {
        let mut found: Vec<spec::Diagnostic> = errors.iter().map(|error| model.diagnose(error)).collect();
        // One wrong sign breaks most pairs: the first says it all.
        let mut seen = BTreeSet::new();
        found.retain(|problem| problem.span.is_none() || seen.insert(problem.span));
        problems.extend(found);
    });
    let stages = stages(&mut model)
        .map_err(|errors| problems.extend(errors.iter().map(|error| model.diagnose(error))));
    let signs = signs(&mut model);
    let domains = domains(&mut model);
    let higher = match &algebroid {
        Ok(algebroid) => {
            settled(&mut model, algebroid).map_err(|error| problems.push(refused(&model, &error)))
        }
        Err(()) => Ok((HigherOrder::default(), Vec::new())),
    };
    let constraint = match model.given.clone() {
        Some(given) => given::as_constraint(&mut model, &given, &signs),
        None => constrain(&mut model, &signs),
    };
    let constraint = constraint.map_err(|error| problems.push(refused(&model, &error)));
    if let Err(exhausted) = model.graph.within_budget() {
        return Err(model.diagnostics(vec![model.diagnose(&exhausted.into())]));
    }
    let (Ok(mut algebroid), Ok(stages), Ok(constraint), Ok((higher, mut pivots))) =
        (algebroid, stages, constraint, higher)
    else {
        return Err(model.diagnostics(problems));
    };
    let mut quasi_frame = None;
    if let Some(own) = model.frame.clone() {
        let names: Vec<String> = model.all_velocities().into_iter().map(|(n, _)| n.to_owned()).collect();
        let (changed, frame) = in_quasi_frame(&mut model.graph, &algebroid, &own, &names);
        (algebroid, quasi_frame) = (changed, Some(frame));
        let known = |e: ExprId| matches!(sign_of(&model.graph, e, &signs), Sign::Positive | Sign::Negative);
        let divisor = own.determinant.filter(|e| !known(*e));
        pivots.extend(divisor.map(|e| ("determinant of the frame".to_owned(), e)));
    }
    let completed = match model.given {
        // There is no mass matrix.
        Some(_) => None,
        None => degenerate::completed(&mut model, &algebroid, &constraint, &signs)
            .map_err(|error| model.diagnostics(vec![model.diagnose(&error)]))?,
    };
    let (constraint, degeneracy) = match completed {
        Some((constraint, found)) => (constraint, Some(found)),
        None => (constraint, None),
    };
    let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
    let unknowns = match &constraint {
        KinematicConstraint::Solved(solved) => solved.unknowns.clone(),
        KinematicConstraint::Multipliers { .. } => frame_unknowns(&model),
    };
    let momenta = momenta::carried(&mut model, formulation, &unknowns)
        .map_err(|problem| model.diagnostics(vec![*problem]))?;
    momenta::spell_out(&mut model, &constraint, &unknowns, &momenta)
        .map_err(|problems| model.diagnostics(problems))?;
    let hamiltonian =
        momenta::hamiltonian(&model, &momenta).map_err(|problem| model.diagnostics(vec![*problem]))?;
    let setting = noise::Setting {
        algebroid: &algebroid,
        constraint: &constraint,
        unknowns: &unknowns,
        hamiltonian: hamiltonian.as_ref(),
    };
    let transport =
        noise::add_forces(&mut model, &setting).map_err(|problem| model.diagnostics(vec![*problem]))?;
    let mut state = state_order(&model, &unknowns, &momenta);
    let mut own_rates = Vec::new();
    for of_first_order in &model.first_order {
        for ((_, symbol), rate) in of_first_order.components.iter().zip(&of_first_order.rates) {
            let spec::FirstOrderState { is_entropy, is_mode, .. } = *of_first_order;
            own_rates.push(OwnRate { symbol: *symbol, rate: *rate, is_entropy, is_mode });
            state.push((StateKind::Base(algebroid.n_base()), of_first_order.doc.clone()));
            algebroid.extend_base(&model.graph, [*symbol]);
        }
    }
    for carried in &higher.carried {
        state.push((StateKind::Base(algebroid.n_base()), carried.doc.clone()));
        algebroid.extend_base(&model.graph, [carried.symbol]);
    }
    let blocks = blocks(&model);
    let algebra = model.n_shape()..velocities.len();
    let accelerations = model.given.as_deref().map(given::accelerations);
    let positions = model.constraints.iter();
    let positions = positions.filter_map(|c| {
        let position = c.position?;
        let determines = position.determines.map(|k| model.base[k].symbol).into_iter().collect();
        let name = format!("position_{}", c.name);
        Some(PositionResidual { name, residual: position.residual, determines })
    });
    let positions = positions.collect();
    let (graph, side) = (&mut model.graph, model.action);
    let items = &model.reconstruction;
    let mut reconstruction: Vec<_> =
        items.iter().flat_map(|item| reconstruction::rates(graph, item, side)).collect();
    // Momenta along quasi-velocities are not those along the algebra.
    let is_turned = quasi_frame.as_ref().is_none_or(|frame| frame.keeps(graph, algebra.clone()));
    let turned = |item| reconstruction::momenta_in_space(graph, item, side, algebra.clone());
    let momenta_in_space = items.iter().filter(|_| is_turned).flat_map(turned).collect();
    let kept = |item| reconstruction::group_equations(graph, item, side);
    let mut group_equations: Vec<(String, ExprId)> = items.iter().flat_map(kept).collect();
    for configuration in &model.configurations {
        group_equations.extend(reconstruction::configuration_equations(graph, configuration, side));
    }
    reconstruction.extend(momenta::cyclic_coordinates(&mut model, &momenta));
    if transport.moves(&mut model.graph, &mut reconstruction).is_err() {
        let error = Error::DivisionByZero { place: "the noise".into() };
        return Err(model.diagnostics(vec![model.diagnose(&error)]));
    }
    if let Err(exhausted) = model.graph.within_budget() {
        return Err(model.diagnostics(vec![model.diagnose(&exhausted.into())]));
    }
    let feedback = model.lyapunov.take().map(|own| {
        let spec::Lyapunov { name: function, rate, response, actuator, value: _, span: _ } = own;
        let slope = model.graph.sym(response);
        Feedback { function, actuator, response, slope, rate }
    });
    let noises = noise::taken(&model).map(|noise| noise.symbol).collect();
    Ok(ReducedSystem {
        formulation: formulation.clone(),
        graph: model.graph,
        name: model.name,
        doc: model.doc,
        sources: model.sources,
        units: model.units,
        time: model.time,
        params: model.params,
        param_arrays: model.param_arrays,
        noises,
        inputs: model.inputs,
        conditions: model.conditions,
        algebroid,
        velocities,
        side,
        connection: model.connection,
        lagrangian: model.lagrangian,
        hamiltonian,
        accelerations,
        forces: model.forces,
        constraint,
        higher,
        own_rates,
        noise_rates: transport.of_base,
        positions,
        degeneracy,
        unknowns,
        momenta,
        gauge: Vec::new(),
        state,
        casimirs: model.casimirs,
        outputs: model.outputs,
        events: model.events,
        multipliers: model.multipliers,
        feedback,
        sections: model.sections,
        reconstruction,
        momenta_in_space,
        group_equations,
        blocks,
        stages,
        signs,
        domains,
        circles: Vec::new(),
        frame: None,
        lift: None,
        quasi_frame,
        pivots,
        changes: Vec::new(),
    })
}

/// The vectors that the model declares, by kind in the order of declaration.
fn blocks(model: &Model) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for velocity in &model.velocities {
        match blocks.last_mut() {
            Some(block) if block.name == velocity.block => block.components.push(velocity.symbol),
            _ => blocks.push(Block {
                name: velocity.block.clone(),
                components: vec![velocity.symbol],
                kind: BlockKind::Velocity,
            }),
        }
    }
    blocks.extend(model.momenta.iter().map(|m| Block {
        name: m.name.clone(),
        components: m.components.iter().map(|(_, symbol, _)| *symbol).collect(),
        kind: BlockKind::Momentum,
    }));
    blocks.extend(model.advected.iter().map(|a| Block {
        name: a.name.clone(),
        components: a.components.iter().map(|(_, s)| *s).collect(),
        kind: BlockKind::Advected,
    }));
    blocks.extend(model.first_order.iter().filter(|s| s.components.len() > 1).map(|s| Block {
        name: s.name.clone(),
        components: s.components.iter().map(|(_, symbol)| *symbol).collect(),
        kind: BlockKind::FirstOrder,
    }));
    for item in &model.reconstruction {
        let mut start = 0;
        for (k, (name, n)) in item.blocks.iter().enumerate() {
            let kind = match (&item.kind, k) {
                (ReconstructionKind::Quaternion { .. } | ReconstructionKind::Pose { .. }, 0) => {
                    BlockKind::Attitude
                }
                (ReconstructionKind::Pose { .. }, _) => BlockKind::Position { attitude: blocks.len() - 1 },
                (ReconstructionKind::Matrix { group, .. }, k) if k < group.n_blocks() => {
                    BlockKind::Matrix(group.n())
                }
                (ReconstructionKind::PlanarPose { .. }, 0) => BlockKind::Heading,
                (ReconstructionKind::PlanarPose { .. }, _) => {
                    BlockKind::Position { attitude: blocks.len() - k }
                }
                _ => BlockKind::Reconstructed,
            };
            let components = item.symbols[start..start + n].to_vec();
            blocks.push(Block { name: name.clone(), components, kind });
            start += n;
        }
    }
    blocks
}

fn stages(model: &mut Model) -> Result<Option<Stages>, Vec<Error>> {
    let Some(chain) = model.stages.clone() else { return Ok(None) };
    let inner = match chain.inner_product {
        None => None,
        Some(InnerProduct::Matrix(rows)) => Some(rows),
        Some(InnerProduct::Lagrangian) => Some(metric_of_lagrangian(model).map_err(|error| vec![error])?),
    };
    let g = &mut model.graph;
    let mut stages = Stages::split(g, &model.algebra, &chain.names, &chain.ideals, inner.as_deref())?;
    stages.connection = chain.connection.map(|rows| stages.components(g, &rows));
    stages.momentum = chain.momentum;
    Ok(Some(stages))
}

/// The Hessian of the Lagrangian in the velocities of the algebra, a function of shape and time.
fn metric_of_lagrangian(model: &mut Model) -> Result<Vec<Vec<ExprId>>, Error> {
    let velocities = model.all_velocities().into_iter().map(|(name, s)| ("velocity", name.to_owned(), s));
    let advected = (model.advected.iter())
        .flat_map(|a| a.components.iter().map(|(name, s)| ("advected parameter", name.clone(), *s)));
    let first_order = model.first_order.iter();
    let first_order =
        first_order.flat_map(|s| s.components.iter().map(|(name, x)| ("state", name.clone(), *x)));
    let moving: Vec<(&str, String, SymbolId)> = velocities.chain(advected).chain(first_order).collect();
    let g = &mut model.graph;
    let mut rows = Vec::new();
    for a in &model.velocities {
        let p = g.diff(model.lagrangian, a.symbol);
        let mut row = Vec::new();
        for b in &model.velocities {
            let mut entry = g.diff(p, b.symbol);
            entry = g.cancel_zero(entry);
            for (kind, name, symbol) in &moving {
                if !g.free_symbols(entry).contains(symbol) {
                    continue;
                }
                // It may stand there without any effect.
                let slope = g.diff(entry, *symbol);
                let at_zero = g.subs(entry, &BTreeMap::from([(*symbol, g.zero())]));
                match at_zero {
                    Ok(constant) if g.is_zero(slope) => entry = constant,
                    _ => return Err(Error::InnerProductDependsOn { kind, name: name.clone() }),
                }
            }
            row.push(entry);
        }
        rows.push(row);
    }
    Ok(rows)
}

fn state_order(model: &Model, unknowns: &[Unknown], momenta: &[CarriedMomentum]) -> Vec<(StateKind, String)> {
    let (n_shape, n_coordinates) = (model.n_shape(), model.base.len());
    let doc_of_frame = |k: usize| model.frame.as_ref().and_then(|frame| frame.docs[k].clone());
    let velocity_doc = |u: &Unknown| match u.frame_idx {
        Some(k) if k < n_shape && doc_of_frame(k).is_some() => doc_of_frame(k).unwrap_or_default(),
        Some(k) if k < n_shape => format!("velocity of {}", model.base[k].name),
        Some(k) => model.velocities[k - n_shape].doc.clone(),
        None => {
            let own = model.quasi_velocities.iter().find(|v| v.symbol == u.symbol);
            own.map(|v| v.doc.clone()).unwrap_or_default()
        }
    };
    let is_cyclic = |c: &Coordinate| momenta.iter().any(|m| m.cyclic == Some(c.symbol));
    let shape = model.base.iter().enumerate().filter(|(_, c)| !is_cyclic(c));
    let shape = shape.map(|(i, c)| (StateKind::Base(i), c.doc.clone()));
    let velocities = unknowns.iter().enumerate().filter_map(|(a, u)| {
        let Some(k) = momenta.iter().position(|m| m.unknown == a) else {
            return Some((StateKind::Unknown(a), velocity_doc(u)));
        };
        let momentum = &momenta[k];
        momentum.symbol.map(|symbol| (StateKind::Momentum { place: k, symbol }, momentum.doc.clone()))
    });
    let advected = model
        .advected
        .iter()
        .flat_map(|a| std::iter::repeat_n(a.doc.clone(), a.components.len()))
        .enumerate()
        .map(|(i, doc)| (StateKind::Base(n_coordinates + i), doc));
    shape.chain(velocities).chain(advected).collect()
}
