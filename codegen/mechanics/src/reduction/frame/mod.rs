//! A system in other velocities: `y = T eta` with the columns of `T` for a frame.
//!
//! [`in_quasi_frame`] writes the algebroid of a model in the frame of its quasi-velocities; the model itself is written
//! in these already. [`with_stages`] writes a system in the frame that its chain of stages is adapted to, as a rewrite
//! of everything that has velocities or components in the frame. `algebroid` builds anchor and bracket from the stage
//! forms and holds them to the change of frame, `constraint` carries the constraints over. Does not know: how the frame
//! came about, equations of motion.

mod algebroid;
mod constraint;

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{DivisionByZero, ExprId, Graph, Rational, SymbolId};
use hamel_lang::algebra::Algebroid;
use hamel_lang::spec::{QuasiFrame, Side};

use super::change::{Change, Frame, contract};
use super::constraint::{KinematicConstraint, Unknown};
use super::formulation::StageUse;
use super::momenta::CarriedMomentum;
use super::stages::Stages;
use super::system::{Block, BlockKind, ReducedSystem, StateKind};

/// The system in the frame that is adapted to its stages, as far as its formulation asks for it.
///
/// Internally the state stays what it is and its velocities are independent ones `u` with
/// `eta = T^-1 Psi u + T^-1 psi0`; the equations are the components along the adapted frame. Carried, the state has
/// velocities and momenta along the levels, and [`ReducedSystem::changes`] has the velocities.
/// Constraints with multipliers keep all velocities in the state, so that an internal frame changes nothing for them.
///
/// # Errors
/// [`Error::RebuiltBracketDiffers`], constraints that cannot be solved in the new velocities,
/// [`Error::DivisionByZero`].
pub(super) fn with_stages(system: ReducedSystem) -> Result<ReducedSystem, Error> {
    let keeps_all = matches!(system.constraint, KinematicConstraint::Multipliers { .. });
    match &system.formulation.stages {
        StageUse::Unused | StageUse::Shown => Ok(system),
        // Frames of quasi-velocities and given rates have velocities of their own.
        _ if system.quasi_frame.is_some() || system.accelerations.is_some() => Ok(system),
        StageUse::Carried(_) if taken_name(&system).is_some() => Err(Error::Unsupported {
            what: format!(
                "variables along stages that are called `{}`",
                taken_name(&system).unwrap_or_default()
            ),
            possible: "other names of the stages".into(),
        }),
        StageUse::Internal if keeps_all || system.hamiltonian.is_some() || system.degeneracy.is_some() => {
            Ok(system)
        }
        StageUse::Carried(_) if system.degeneracy.is_some() => Err(Error::Unsupported {
            what: "variables along stages of a system with a degenerate lagrangian".into(),
            possible: "the velocities of the model; remove `carry stages`".into(),
        }),
        StageUse::Carried(_) if system.hamiltonian.is_some() => Err(Error::Unsupported {
            what: "variables along stages of a system with a hamiltonian".into(),
            possible: "the momenta that it is a function of; remove `carry stages`".into(),
        }),
        StageUse::Internal | StageUse::Carried(_) => match system.stages.clone() {
            Some(stages) => in_frame(system, &stages),
            None => Ok(system),
        },
    }
}

/// A name of a variable along the levels that something else has.
fn taken_name(system: &ReducedSystem) -> Option<String> {
    let stages = system.stages.as_ref()?;
    let g = &system.graph;
    let symbols = system.params.iter().map(|p| p.symbol).chain(system.algebroid.base().iter().copied());
    let symbols = symbols.chain(system.velocities.iter().copied()).chain([system.time]);
    let symbols = symbols.chain(system.momenta.iter().filter_map(|m| m.symbol));
    let symbols = symbols.chain(system.inputs.iter().map(|input| input.symbol));
    let symbols = symbols.chain(system.reconstruction.iter().map(|c| c.symbol));
    let outputs = system.outputs.iter().flat_map(|o| &o.components).map(|(name, _)| name.as_str());
    let casimirs = system.casimirs.iter().map(|c| c.name.as_str());
    let taken: BTreeSet<&str> = symbols.map(|s| g.name(s)).chain(outputs).chain(casimirs).collect();
    let along = stages.velocity_names();
    let momenta = along.iter().map(|name| format!("{}_{name}", stages.momentum)).collect::<Vec<String>>();
    along.into_iter().chain(momenta).find(|name| taken.contains(name.as_str()))
}

impl ReducedSystem {
    /// The algebroid in the frame `(D_i, e_a)` of the horizontal lifts of the connection.
    pub fn with_lifts(&self, g: &mut Graph) -> Algebroid {
        let (Some(frame), Some(_)) = (&self.frame, &self.lift) else { return self.algebroid.clone() };
        let lifts = Frame {
            original: frame.original.clone(),
            matrix: frame.inverse.clone(),
            inverse: frame.matrix.clone(),
        };
        let names: Vec<String> = frame.original.iter().map(|u| u.name.clone()).collect();
        algebroid::transformed(g, &self.algebroid, &lifts, &names)
    }
}

/// The algebroid in the frame of quasi-velocities that a model declares, and that frame.
pub(super) fn in_quasi_frame(
    g: &mut Graph,
    algebroid: &Algebroid,
    own: &QuasiFrame,
    names: &[String],
) -> (Algebroid, Frame) {
    let original = own.original.iter().enumerate();
    let original = original.map(|(k, (name, symbol))| Unknown {
        name: name.clone(),
        symbol: *symbol,
        frame_idx: Some(k),
    });
    let frame =
        Frame { original: original.collect(), matrix: own.matrix.clone(), inverse: own.inverse.clone() };
    (algebroid::transformed(g, algebroid, &frame, names), frame)
}

fn in_frame(system: ReducedSystem, stages: &Stages) -> Result<ReducedSystem, Error> {
    let ReducedSystem {
        formulation,
        mut graph,
        name,
        doc,
        sources,
        units,
        time,
        params,
        param_arrays,
        inputs,
        noises,
        conditions,
        algebroid,
        velocities,
        side,
        connection,
        lagrangian,
        hamiltonian,
        accelerations,
        forces,
        constraint,
        higher,
        mut own_rates,
        mut noise_rates,
        positions,
        degeneracy,
        unknowns,
        momenta,
        gauge,
        state,
        casimirs,
        mut outputs,
        events,
        multipliers,
        mut feedback,
        mut sections,
        reconstruction,
        momenta_in_space,
        group_equations,
        blocks,
        stages: _,
        signs,
        domains,
        circles,
        frame: _,
        lift,
        quasi_frame,
        pivots,
        changes: _,
    } = system;
    let g = &mut graph;
    let is_carried = formulation.stages.is_carried();
    let n = velocities.len() - stages.basis.len();
    let own = velocities.iter().zip(algebroid.frame()).enumerate();
    let own =
        own.map(|(k, (symbol, name))| Unknown { name: name.clone(), symbol: *symbol, frame_idx: Some(k) });
    let frame = Frame::adapted(g, stages, own.collect());
    let eta: Vec<Unknown> = frame.original[..n].to_vec();
    let eta: Vec<Unknown> = eta.into_iter().chain(level_velocities(g, stages, n)).collect();
    let names: Vec<String> = eta.iter().map(|u| u.name.clone()).collect();
    let algebroid =
        algebroid::adapted(g, &algebroid, stages, (&frame, &names), (side == Side::Right, &connection))?;
    let symbols: Vec<ExprId> = eta.iter().map(|u| g.sym(u.symbol)).collect();
    let values = frame.velocities(g, &symbols);
    let all: BTreeMap<SymbolId, ExprId> = velocities.iter().copied().zip(values).skip(n).collect();
    let divided = |_: DivisionByZero| Error::DivisionByZero { place: "the change of frame".into() };
    let old = (lagrangian, velocities.as_slice());
    let lagrangian = g.subs(lagrangian, &all).map_err(divided)?;
    let along: Vec<SymbolId> = eta.iter().map(|u| u.symbol).collect();
    let lagrangian = gathered(g, lagrangian, &along, (&algebroid, &frame, old));
    let turned = turned_by_noise(g, &frame, old, &noise_rates);
    let forces = g.subs_all(&forces, &all).map_err(divided)?;
    let forces = frame.one_form(g, &forces);
    let turned = g.subs_all(&turned, &all).map_err(divided)?;
    let forces: Vec<ExprId> = forces.into_iter().zip(turned).map(|(f, e)| g.add(f, e)).collect();
    let beside = constraint::Setting { time, params: &params, signs: &signs, algebroid: &algebroid };
    let before = constraint.clone();
    let higher = match is_carried {
        true => constraint::rates_in(g, &beside, &eta, (&velocities, &all), higher)?,
        // With multipliers an internal frame changes nothing.
        false => higher,
    };
    let constraint = match is_carried {
        true => constraint::solved_again(g, &beside, &frame, &eta, constraint, &all)?,
        // What a momentum is depends on the displacements.
        false => {
            let has_momenta = !momenta.is_empty();
            constraint::with_old_unknowns(g, &beside, (&frame, n), (&names, has_momenta), constraint, &all)?
        }
    };
    // What stays in the state stays in expressions.
    let kept: Vec<SymbolId> =
        if is_carried { Vec::new() } else { unknowns.iter().map(|u| u.symbol).collect() };
    let replaced: BTreeMap<SymbolId, ExprId> = all.into_iter().filter(|(y, _)| !kept.contains(y)).collect();
    let replace = |g: &mut Graph, e: &mut ExprId| -> Result<(), Error> {
        *e = g.subs(*e, &replaced).map_err(divided)?;
        Ok(())
    };
    let (mut casimirs, mut reconstruction) = (casimirs, reconstruction);
    for e in casimirs.iter_mut().map(|c| &mut c.expr) {
        replace(g, e)?;
    }
    for (_, e) in outputs.iter_mut().flat_map(|o| &mut o.components) {
        replace(g, e)?;
    }
    let rates = reconstruction.iter_mut().map(|c| &mut c.rate);
    let own = own_rates.iter_mut().map(|own| &mut own.rate);
    let own = own.chain(feedback.iter_mut().map(|feedback| &mut feedback.rate));
    for e in rates.chain(own).chain(noise_rates.iter_mut().map(|(_, rate)| rate)) {
        replace(g, e)?;
    }
    for section in &mut sections {
        section.coefficients = frame.components(g, &section.coefficients);
    }
    let mut system = ReducedSystem {
        formulation,
        graph: Graph::new(),
        name,
        doc,
        sources,
        units,
        time,
        params,
        param_arrays,
        inputs,
        noises,
        conditions,
        algebroid,
        velocities: eta.iter().map(|u| u.symbol).collect(),
        side,
        connection,
        lagrangian,
        hamiltonian,
        accelerations,
        forces,
        constraint,
        higher,
        own_rates,
        noise_rates,
        positions,
        degeneracy,
        unknowns,
        momenta,
        gauge,
        state,
        casimirs,
        outputs,
        events,
        multipliers,
        feedback,
        sections,
        reconstruction,
        momenta_in_space,
        group_equations,
        blocks,
        stages: Some(stages.clone()),
        signs,
        domains,
        circles,
        frame: None,
        lift,
        quasi_frame,
        pivots,
        changes: Vec::new(),
    };
    if is_carried {
        let unknowns = carry(g, &mut system, stages, &frame, (&before, &eta));
        constraint::keeps_momenta(g, &mut system, &frame, (&before, &unknowns))?;
        carry_momenta(g, &mut system, stages, n)?;
    }
    system.graph = graph;
    system.frame = Some(frame);
    Ok(system)
}

/// The rates `p_alpha dT^alpha_a/dx xi` of the momenta in a frame that are left where noise moves base coordinates by
/// `xi`, and with them the frame: the bracket in the frame has the rates along velocities alone.
///
/// `old`: the Lagrangian, a function of the velocities of the model.
fn turned_by_noise(
    g: &mut Graph,
    frame: &Frame,
    (lagrangian, velocities): (ExprId, &[SymbolId]),
    noise_rates: &[(SymbolId, ExprId)],
) -> Vec<ExprId> {
    let p: Vec<ExprId> = velocities.iter().map(|y| g.diff(lagrangian, *y)).collect();
    let mut forces = vec![g.zero(); p.len()];
    for (x, rate) in noise_rates {
        for (a, force) in forces.iter_mut().enumerate() {
            let column: Vec<ExprId> = frame.matrix.iter().map(|row| g.diff(row[a], *x)).collect();
            let along = contract(g, &p, &column);
            let along = g.mul(along, *rate);
            *force = g.add(*force, along);
        }
    }
    forces
}

/// The same function of the velocities, a sum over their products where the metric depends on parameters alone: the
/// products that couple levels are not there then, and the others have one coefficient each.
///
/// `old`: the function of the velocities of the model.
fn gathered(
    g: &mut Graph,
    lagrangian: ExprId,
    velocities: &[SymbolId],
    (algebroid, frame, old): (&Algebroid, &Frame, (ExprId, &[SymbolId])),
) -> ExprId {
    let moving = velocities.iter().chain(algebroid.base()).copied().chain([algebroid.time()]);
    let moving: BTreeSet<SymbolId> = moving.collect();
    let zeros: BTreeMap<SymbolId, ExprId> = velocities.iter().map(|s| (*s, g.zero())).collect();
    let p: Vec<ExprId> = velocities.iter().map(|s| g.diff(lagrangian, *s)).collect();
    let (Ok(at_rest), Ok(slopes)) = (g.subs(lagrangian, &zeros), g.subs_all(&p, &zeros)) else {
        return lagrangian;
    };
    let mut terms = vec![at_rest];
    for (slope, s) in slopes.into_iter().zip(velocities) {
        let velocity = g.sym(*s);
        let slope = g.cancel_zero(slope);
        terms.push(g.mul(slope, velocity));
    }
    let lowered = lowered(g, frame, old);
    let half = Rational::new(1.into(), 2.into());
    for (a, p) in p.into_iter().enumerate() {
        for (b, s) in velocities.iter().enumerate().skip(a) {
            let entry = g.diff(p, *s);
            let entry = g.cancel_zero(entry);
            if g.depends_on(entry, &moving) {
                return lagrangian;
            }
            let entry = paired(g, entry, frame, (&lowered[a], b));
            let pair = [velocities[a], *s].map(|s| g.sym(s));
            let product = g.product(&[entry, pair[0], pair[1]]);
            terms.push(if a == b { g.scale(product, &half) } else { product });
        }
    }
    g.sum(&terms)
}

/// The metric of a function of the velocities of the model, contracted with each section of a frame.
fn lowered(
    g: &mut Graph,
    frame: &Frame,
    (lagrangian, velocities): (ExprId, &[SymbolId]),
) -> Vec<Vec<ExprId>> {
    let p: Vec<ExprId> = velocities.iter().map(|s| g.diff(lagrangian, *s)).collect();
    let metric: Vec<Vec<ExprId>> =
        p.iter().map(|p| velocities.iter().map(|s| g.diff(*p, *s)).collect()).collect();
    let column = |a: usize| -> Vec<ExprId> { frame.matrix.iter().map(|row| row[a]).collect() };
    (0..velocities.len()).map(|a| metric.iter().map(|row| contract(g, row, &column(a))).collect()).collect()
}

/// An entry of the metric in a frame, `<f_a, f_b>`, as the product of `f_a` with the representative of `f_b` modulo the
/// levels below, where these are orthogonal to `f_a` and that is shorter.
fn paired(g: &mut Graph, entry: ExprId, frame: &Frame, (lowered, b): (&[ExprId], usize)) -> ExprId {
    let numbers: Vec<ExprId> = (frame.matrix.iter())
        .map(|row| if g.as_rational(row[b]).is_some() { row[b] } else { g.zero() })
        .collect();
    let product = contract(g, lowered, &numbers);
    let size = |g: &Graph, e: ExprId| g.reachable(&[e]).len();
    let is_shorter = size(g, product) < size(g, entry);
    if is_shorter && g.is_equal(product, entry) { product } else { entry }
}

/// The state of velocities along the levels, and what tells of it; the unknowns before.
///
/// `constraint`: in the frame of the model.
fn carry(
    g: &mut Graph,
    system: &mut ReducedSystem,
    stages: &Stages,
    frame: &Frame,
    (constraint, eta): (&KinematicConstraint, &[Unknown]),
) -> Vec<Unknown> {
    let n = eta.len() - stages.basis.len();
    let unknowns = match &system.constraint {
        KinematicConstraint::Solved(solved) => solved.unknowns.clone(),
        KinematicConstraint::Multipliers { .. } => eta.to_vec(),
    };
    let before = std::mem::replace(&mut system.unknowns, unknowns);
    let doc_of = |u: &Unknown| {
        let level = u.frame_idx.filter(|k| *k >= n).map(|k| &stages.levels[stages.level_of(k - n)]);
        if let Some(level) = level {
            return format!("velocity along the level of stage `{}`", level.name);
        }
        let same = before.iter().position(|old| old.symbol == u.symbol);
        let entry = same.and_then(|a| system.state.iter().find(|(kind, _)| *kind == StateKind::Unknown(a)));
        entry.map(|(_, doc)| doc.clone()).unwrap_or_default()
    };
    let has_momentum = |u: &Unknown| system.momenta.iter().any(|m| before[m.unknown].symbol == u.symbol);
    let own = system.unknowns.iter().enumerate().filter(|(_, u)| !has_momentum(u));
    let own: Vec<(StateKind, String)> = own.map(|(a, u)| (StateKind::Unknown(a), doc_of(u))).collect();
    let is_base = |kind: &StateKind| matches!(kind, StateKind::Base(_));
    let is_unknown = |kind: &StateKind| matches!(kind, StateKind::Unknown(_));
    let at = system.state.iter().take_while(|(kind, _)| is_base(kind)).count();
    system.state.retain(|(kind, _)| !is_unknown(kind));
    system.state.splice(at..at, own);
    // By the velocities that were independent before, so that whoever gives these gives a state.
    let mut own: Vec<ExprId> = frame.original.iter().map(|u| g.sym(u.symbol)).collect();
    if let KinematicConstraint::Solved(solved) = constraint {
        for &alpha in &solved.dependent {
            own[alpha] = solved.velocity(g, alpha);
        }
    }
    for u in &system.unknowns {
        let is_new = before.iter().all(|old| old.symbol != u.symbol);
        let Some(k) = u.frame_idx.filter(|_| is_new) else { continue };
        let value = contract(g, &frame.inverse[k], &own);
        system.changes.push(Change { name: u.name.clone(), symbol: u.symbol, value });
    }
    let mut blocks: Vec<Block> = (stages.levels.iter())
        .map(|level| Block {
            name: level.name.clone(),
            components: level.range.clone().map(|k| eta[n + k].symbol).collect(),
            kind: BlockKind::Velocity,
        })
        .collect();
    // Positions of places in the list count what comes before.
    let is_velocity = |block: &&Block| block.kind == BlockKind::Velocity;
    let shift = |at: usize, new: usize, old: usize| at + new - old;
    let (new, old) = (blocks.len(), system.blocks.iter().filter(is_velocity).count());
    for block in system.blocks.drain(..).filter(|block| block.kind != BlockKind::Velocity) {
        let kind = match block.kind {
            BlockKind::Position { attitude } => BlockKind::Position { attitude: shift(attitude, new, old) },
            other => other,
        };
        blocks.push(Block { kind, ..block });
    }
    system.blocks = blocks;
    before
}

/// Momenta `<p, f>` along the adapted elements `f` that the formulation names, or whose levels it names, in the place
/// of the velocities along them; `n` base velocities are before these. A momentum along an element that the constraints
/// determine is left out.
///
/// # Errors
/// [`Error::Unsupported`] for an element that the constraints determine and that is named by itself, and for a name of
/// neither an element nor a level.
///
/// # Source
/// Cendra, Diaz, equations (18) and (19), whose state these momenta are.
fn carry_momenta(g: &mut Graph, system: &mut ReducedSystem, stages: &Stages, n: usize) -> Result<(), Error> {
    let StageUse::Carried(names) = system.formulation.stages.clone() else { return Ok(()) };
    let elements = stages.velocity_names();
    let is_all = stages.levels.iter().all(|level| names.contains(&level.name));
    for name in names.iter().filter(|_| !is_all) {
        let along = elements.iter().position(|element| element == name);
        let what = match along.map(|k| system.unknown_along(n + k)) {
            Some(Some(_)) => continue,
            _ if stages.levels.iter().any(|level| level.name == *name && level.range.len() > 1) => continue,
            Some(None) => format!("the momentum along `{name}`, which the constraints determine,"),
            None => format!("a stage with the element `{name}`"),
        };
        let free = (0..elements.len()).filter(|k| system.unknown_along(n + k).is_some());
        let free: Vec<&str> = free.map(|k| elements[k].as_str()).collect();
        let possible = format!("momenta along {}", free.join(", "));
        return Err(Error::Unsupported { what, possible });
    }
    for (k, element) in elements.iter().enumerate() {
        let level = &stages.levels[stages.level_of(k)];
        let Some(unknown) = system.unknown_along(n + k) else { continue };
        if !names.contains(element) && !names.contains(&level.name) {
            continue;
        }
        let name = format!("{}_{element}", stages.momentum);
        let symbol = g.symbol(&name);
        let (place, value) = (system.momenta.len(), g.sym(symbol));
        let doc = format!("momentum along the level of stage `{}`", level.name);
        let own = system.state.iter_mut().find(|(kind, _)| *kind == StateKind::Unknown(unknown));
        own.into_iter().for_each(|own| *own = (StateKind::Momentum { place, symbol }, doc.clone()));
        let symbol = Some(symbol);
        system.momenta.push(CarriedMomentum { unknown, name, value, symbol, doc, cyclic: None });
    }
    Ok(())
}

/// Velocities along the adapted elements: `stage_1`, `stage_2`, .. for a stage of several dimensions, its name for one.
fn level_velocities(g: &mut Graph, stages: &Stages, n: usize) -> Vec<Unknown> {
    let names = stages.velocity_names();
    let mut unknowns = Vec::new();
    for (k, name) in names.into_iter().enumerate() {
        let symbol = g.symbol(&name);
        unknowns.push(Unknown { name, symbol, frame_idx: Some(n + k) });
    }
    unknowns
}
