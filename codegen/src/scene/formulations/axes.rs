//! What a formulation can choose in the place of what a scene has: one axis for each kind of choice.
//!
//! Does not know: how choices are combined, what they cost, whether they are the same motion.

use std::ops::Range;

use hamel_expr::{ExprId, Rational, independent_rows};
use hamel_lang::algebra::{independent_vectors, series::chains};
use hamel_lang::spec::{Carried, CarriedBy, ConnectionKind, Domain, IdealChain, Model, circle_names};
use hamel_mechanics::reduction::{
    Formulation, FoundChain, KinematicConstraint, ReducedSystem, StageUse, beside_connection,
};

/// Choices of independent velocities that are tried, those first that exchange the fewest velocities.
const MAX_INDEPENDENT: usize = 32;
/// Angles that are tried as points of the circle, in the order of the model.
const MAX_ANGLES: usize = 4;
/// Slots of which every selection is tried; of more, each alone and all of them.
const MAX_SLOTS: usize = 4;
/// Chains of ideals that are found and tried.
const MAX_CHAINS: usize = 2;

/// A choice that differs from the scene's own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Choice {
    /// The connection; none for the one that the model writes down.
    Connection(Option<ConnectionKind>),
    /// The independent velocities.
    Independent(Vec<usize>),
    /// Whether squares of velocities are differentiated in a frame of their own.
    Squares(bool),
    /// An angle, and whether it is carried as a point of the circle.
    Circle(String, bool),
    /// The frame in which the equations are derived: adapted to a chain of ideals, that of the model unless one is
    /// given, of which the text says what it is.
    Stages(Option<FoundChain>, String),
    /// The same frame, with the momenta along these levels, or elements of levels, in the state, and the velocities
    /// along the others.
    Levels(Option<FoundChain>, Vec<String>, String),
    /// Slots, by name, whose velocities are carried by themselves or by their momenta.
    Momenta(Vec<(String, Vec<Carried>)>),
}

impl Choice {
    /// Makes the choice in a formulation.
    pub(super) fn apply(&self, formulation: &mut Formulation) {
        match self {
            Choice::Connection(kind) => formulation.connection = *kind,
            Choice::Independent(columns) => formulation.independent = Some(columns.clone()),
            Choice::Squares(squares) => formulation.squares = *squares,
            Choice::Circle(angle, true) => formulation.circles.push(angle.clone()),
            Choice::Circle(angle, false) => formulation.circles.retain(|other| other != angle),
            Choice::Stages(chain, _) => {
                formulation.stages = StageUse::Internal;
                formulation.chain.clone_from(chain);
            }
            Choice::Levels(chain, momenta, _) => {
                formulation.stages = StageUse::Carried(momenta.clone());
                formulation.chain.clone_from(chain);
            }
            Choice::Momenta(slots) => {
                let carried: Vec<&Carried> = slots.iter().flat_map(|(_, carried)| carried).collect();
                let momenta = &mut formulation.momenta;
                momenta.retain(|own| carried.iter().all(|new| new.velocity != own.velocity));
                let by_momenta = carried.into_iter().filter(|new| new.by != CarriedBy::Velocity);
                momenta.extend(by_momenta.cloned());
                momenta.sort_by_key(|own| own.velocity);
            }
        }
    }

    /// The choice in words of the model.
    pub(super) fn text(&self, model: &Model) -> String {
        match self {
            Choice::Connection(Some(kind)) => format!("connection {}", kind.name()),
            Choice::Connection(None) => "connection of the model".into(),
            Choice::Independent(columns) => {
                let names: Vec<&str> = model.all_velocities().into_iter().map(|(name, _)| name).collect();
                let quasi = model.quasi_velocities.iter().map(|v| v.name.as_str());
                let names: Vec<&str> = names.into_iter().chain(quasi).collect();
                let chosen: Vec<&str> = columns.iter().map(|k| names[*k]).collect();
                format!("independent {}", chosen.join(", "))
            }
            Choice::Squares(true) => "squares in their own frame".into(),
            Choice::Squares(false) => "no squares".into(),
            Choice::Circle(angle, true) => format!("circle {angle}"),
            Choice::Circle(angle, false) => format!("angle {angle}"),
            Choice::Stages(_, text) => text.clone(),
            Choice::Levels(_, momenta, text) if momenta.is_empty() => {
                format!("{text}, velocities along the levels")
            }
            Choice::Levels(_, momenta, text) => format!("{text}, momenta along {}", momenta.join(", ")),
            Choice::Momenta(slots) => {
                let text = |(name, carried): &(String, Vec<Carried>)| match carried.first().map(|c| &c.by) {
                    Some(CarriedBy::Momentum(_)) => format!("momenta of {name}"),
                    _ => format!("velocities {name}"),
                };
                slots.iter().map(text).collect::<Vec<String>>().join("; ")
            }
        }
    }
}

/// The axes along which the formulation of a scene can be changed, each with the choices that are not the scene's own.
///
/// With `keeps_state`, none that changes the state to variables along levels.
pub(super) fn axes(
    model: &Model,
    own: &Formulation,
    system: &ReducedSystem,
    (drops, keeps_state): (&[String], bool),
) -> Vec<Vec<Choice>> {
    let mut axes = Vec::new();
    // A Hamiltonian is a function of momenta in the model's own frame.
    if model.hamiltonian.is_none() && model.given.is_none() {
        axes.extend([connections(model, own), independent(system), vec![Choice::Squares(!own.squares)]]);
        if model.frame.is_none() && model.algebroid.is_none() {
            axes.push(stages(model, own, keeps_state));
        }
        axes.push(momenta(model, own, system));
    }
    axes.extend(circles(model, own, drops).into_iter().map(|choice| vec![choice]));
    axes.retain(|axis| !axis.is_empty());
    axes
}

fn connections(model: &Model, own: &Formulation) -> Vec<Choice> {
    if model.n_shape() == 0 || model.algebra.dim() == 0 || beside_connection(model).is_some() {
        return Vec::new();
    }
    let is_written = model.connection.is_some();
    // Without a connection of its own the model's is the trivial one.
    let plain = (!is_written).then_some(Some(ConnectionKind::Trivial));
    let written = is_written.then_some([None, Some(ConnectionKind::Trivial)]);
    let is_constrained = !model.constraints.is_empty() || !model.virtual_constraints.is_empty();
    let nonholonomic = is_constrained.then_some(Some(ConnectionKind::Nonholonomic));
    let kinds = written.into_iter().flatten().chain(plain).chain([Some(ConnectionKind::Mechanical)]);
    let own = if is_written { own.connection } else { own.connection.or(Some(ConnectionKind::Trivial)) };
    kinds.chain(nonholonomic).filter(|kind| *kind != own).map(Choice::Connection).collect()
}

/// Other velocities for the constraint to determine, those that it does determine: one of them exchanged for an
/// independent one, then two.
fn independent(system: &ReducedSystem) -> Vec<Choice> {
    // Of a state with velocities along levels the independent ones are others.
    let solved = match &system.constraint {
        // Velocities beside a connection that is solved for are none that a constraint determines.
        KinematicConstraint::Solved(solved) if system.changes.is_empty() && system.lift.is_none() => solved,
        _ => return Vec::new(),
    };
    let kept = solved.independent();
    let n_quasi = solved.unknowns.len() - kept.len();
    let width = system.velocities.len() + n_quasi;
    let dependent = &solved.dependent;
    let mut exchanges: Vec<Vec<(usize, usize)>> = Vec::new();
    let pairs: Vec<(usize, usize)> =
        dependent.iter().flat_map(|out| kept.iter().map(|into| (*out, *into))).collect();
    exchanges.extend(pairs.iter().map(|pair| vec![*pair]));
    for (k, first) in pairs.iter().enumerate() {
        let others = pairs[k + 1..].iter().filter(|other| other.0 != first.0 && other.1 != first.1);
        exchanges.extend(others.map(|other| vec![*first, *other]));
        if exchanges.len() > 4 * MAX_INDEPENDENT {
            break;
        }
    }
    let mut found: Vec<Vec<usize>> = Vec::new();
    for exchange in exchanges {
        let is_dependent = |k: &usize| {
            let swapped = exchange.iter().any(|(_, into)| into == k);
            swapped || (dependent.contains(k) && !exchange.iter().any(|(out, _)| out == k))
        };
        let columns: Vec<usize> = (0..width).filter(|k| !is_dependent(k)).collect();
        let solved_for =
            |form: &[ExprId]| (0..system.velocities.len()).filter(is_dependent).map(|k| form[k]).collect();
        let square: Vec<Vec<ExprId>> = solved.rows.iter().map(|row| solved_for(&row.one_form)).collect();
        if independent_rows(&system.graph, &square).len() < square.len() {
            continue;
        }
        if !found.contains(&columns) && found.len() < MAX_INDEPENDENT {
            found.push(columns);
        }
    }
    found.into_iter().map(Choice::Independent).collect()
}

/// Frames that are adapted to chains of ideals: that of the model, and those found by themselves; the complements are
/// those of the basis of the algebra, or of the kinetic energy. The state stays what it is, or has velocities and
/// momenta along the levels; a state that has such variables keeps the frame.
fn stages(model: &Model, own: &Formulation, keeps_state: bool) -> Vec<Choice> {
    let mut choices = Vec::new();
    if model.algebra.dim() < 2 || own.stages.is_carried() && keeps_state {
        return choices;
    }
    let mut add = |ideals: Option<Vec<Vec<Vec<Rational>>>>, (names, of_levels): (&str, &[String])| {
        for (by_energy, by) in [(false, ""), (true, " by energy")] {
            let chain = Some(FoundChain { ideals: ideals.clone(), by_energy });
            if !own.stages.is_carried() {
                choices.push(Choice::Stages(chain.clone(), format!("stages {names}{by}")));
            }
            // Without the complements of the kinetic energy levels are coupled as the velocities of the model are.
            if by_energy && !keeps_state {
                levels(&mut choices, (chain, of_levels), &format!("stages {names}{by}"));
            }
        }
    };
    if let Some(chain) = &model.stages {
        add(None, (&format!("of the model ({})", chain.names.join(" > ")), &chain.names));
    }
    // Chains are searched over the rationals.
    let found = model.algebra.rational().map_or_else(Vec::new, |algebra| chains(&algebra, MAX_CHAINS));
    for chain in found {
        let names: Vec<&str> = chain.iter().map(|ideal| ideal.name.as_str()).collect();
        let ideals: Vec<Vec<Vec<Rational>>> = chain.iter().map(|ideal| ideal.basis.clone()).collect();
        if model.stages.as_ref().is_none_or(|own| !are_those_of(model, own, &ideals)) {
            add(Some(ideals), (&names.join(" > "), &FoundChain::names(chain.len() + 1)));
        }
    }
    let as_written = |chain: &IdealChain| chain.inner_product.is_some() || chain.connection.is_some();
    if let Some(chain) = model.stages.as_ref().filter(|chain| as_written(chain)) {
        let text = "stages of the model as they are written";
        if !own.stages.is_carried() {
            choices.push(Choice::Stages(None, text.into()));
        }
        if !keeps_state {
            levels(&mut choices, (None, &chain.names), text);
        }
    }
    choices.retain(|choice| match choice {
        Choice::Levels(chain, momenta, _) => {
            *chain != own.chain || own.stages != StageUse::Carried(momenta.clone())
        }
        _ => true,
    });
    choices
}

/// Velocities along all levels, momenta along all, and along each.
fn levels(choices: &mut Vec<Choice>, (chain, names): (Option<FoundChain>, &[String]), text: &str) {
    let mut all = names.to_vec();
    all.sort();
    let each = names.iter().map(|name| vec![name.clone()]);
    for momenta in [Vec::new(), all].into_iter().chain(each.filter(|_| names.len() > 1)) {
        choices.push(Choice::Levels(chain.clone(), momenta, text.to_owned()));
    }
}

/// Whether ideals, found over the rationals, span the ideals of a chain.
fn are_those_of(model: &Model, chain: &IdealChain, ideals: &[Vec<Vec<Rational>>]) -> bool {
    let mut g = model.graph.clone();
    chain.ideals.len() == ideals.len()
        && chain.ideals.iter().zip(ideals).all(|(own, found)| {
            let mut vectors = own.clone();
            let rank = independent_vectors(&mut g, &vectors).len();
            vectors.extend(found.iter().map(|v| v.iter().map(|q| g.rational(q.clone())).collect()));
            rank == found.len() && independent_vectors(&mut g, &vectors).len() == rank
        })
}

/// Whether choices can be made together: along levels no velocity of the algebra is left to have a momentum of its own.
/// `algebra`: the places of these velocities.
pub(super) fn go_together(choices: &[Choice], algebra: &Range<usize>) -> bool {
    let has_levels = choices.iter().any(|choice| matches!(choice, Choice::Levels(..)));
    let slots = choices.iter().filter_map(|choice| match choice {
        Choice::Momenta(slots) => Some(slots),
        _ => None,
    });
    let mut carried = slots.flatten().flat_map(|(_, carried)| carried);
    !has_levels || carried.all(|c| c.by == CarriedBy::Velocity || !algebra.contains(&c.velocity))
}

/// Choices that differ from one in the variable for one slot, or along one element of the levels, of which
/// `elements` are the names.
pub(super) fn neighbours(choice: &Choice, axis: &[Choice], elements: &[(String, String)]) -> Vec<Choice> {
    match choice {
        Choice::Levels(chain, momenta, text) => {
            let is_carried =
                |(element, level): &&(String, String)| momenta.contains(element) || momenta.contains(level);
            let flipped = |other: &(String, String)| {
                let is_kept = |own: &(String, String)| is_carried(&own) != (own == other);
                let is_whole = |level: &String| elements.iter().all(|own| own.1 != *level || is_kept(own));
                let kept = elements.iter().filter(|own| is_kept(own));
                let kept = kept.map(|(element, level)| if is_whole(level) { level } else { element });
                let mut momenta: Vec<String> = kept.cloned().collect();
                momenta.sort();
                momenta.dedup();
                Choice::Levels(chain.clone(), momenta, text.clone())
            };
            elements.iter().map(flipped).collect()
        }
        Choice::Momenta(slots) => {
            let of_all = |choice: &Choice| match choice {
                Choice::Momenta(slots) => slots.clone(),
                _ => Vec::new(),
            };
            let all = axis.iter().map(of_all).max_by_key(Vec::len).unwrap_or_default();
            let flipped = |other: &(String, Vec<Carried>)| {
                let kept = all.iter().filter(|slot| slots.contains(slot) != (*slot == other));
                Choice::Momenta(kept.cloned().collect())
            };
            let others = all.iter().map(flipped);
            others.filter(|choice| *choice != Choice::Momenta(Vec::new())).collect()
        }
        _ => Vec::new(),
    }
}

/// Whether nothing in a model has that name.
fn is_free(model: &Model, name: &String) -> bool {
    !model.places.declared.contains_key(name)
        && model.params.iter().all(|p| p.name != *name)
        && model.all_velocities().iter().all(|(other, _)| other != name)
        && model.outputs.iter().all(|output| output.name != *name)
}

/// Momenta in the place of velocities, and the other way round. Slots are the velocities of the base, each vector of
/// the algebra, the quasi-velocities; every selection of the first ones is tried, each other slot by itself, and all.
/// What one slot costs tells nothing of several: momenta of all may spare the mass matrix that momenta of one still
/// need. Momenta have the names that the model gives them, or that of the velocity with `p_` before it.
fn momenta(model: &Model, own: &Formulation, system: &ReducedSystem) -> Vec<Choice> {
    let n_frame = model.all_velocities().len();
    let quasi = model.quasi_velocities.iter();
    let mut slots: Vec<(String, Vec<(usize, String)>)> = Vec::new();
    let base = model.base.iter().map(|c| ("the base".to_owned(), c.velocity_name.clone()));
    let fibre = model.velocities.iter().map(|v| (v.block.clone(), v.name.clone()));
    let quasi = quasi.map(|v| (v.block.clone(), v.name.clone()));
    for (k, (slot, name)) in base.chain(fibre).chain(quasi).enumerate() {
        let symbol = match k.checked_sub(n_frame) {
            None => system.velocities[k],
            Some(q) => model.quasi_velocities[q].symbol,
        };
        if system.unknowns.iter().all(|u| u.symbol != symbol) {
            continue;
        }
        match slots.last_mut().filter(|(last, _)| *last == slot) {
            Some((_, list)) => list.push((k, name)),
            None => slots.push((slot, vec![(k, name)])),
        }
    }
    let by_now = |k: usize| own.momenta.iter().find(|c| c.velocity == k).map(|c| &c.by);
    let declared = |k: usize| {
        let all = model.momenta.iter().flat_map(|m| &m.components);
        all.clone().find(|(.., velocity)| *velocity == k).map(|(name, ..)| name.clone())
    };
    let mut exchanged: Vec<(String, Vec<Carried>)> = Vec::new();
    for (slot, list) in slots {
        let free = list.iter().filter(|(k, _)| !matches!(by_now(*k), Some(CarriedBy::Parameter(_))));
        let is_carried = free.clone().any(|(k, _)| by_now(*k).is_some());
        let carried = free.map(|(velocity, name)| {
            let by = match (is_carried, declared(*velocity)) {
                (true, _) => CarriedBy::Velocity,
                (false, Some(name)) => CarriedBy::Momentum(name),
                (false, None) => CarriedBy::Momentum(format!("p_{name}")),
            };
            Carried { velocity: *velocity, by }
        });
        let carried: Vec<Carried> = carried.collect();
        let is_named = |c: &Carried| match &c.by {
            CarriedBy::Momentum(name) => declared(c.velocity).is_some() || is_free(model, name),
            _ => true,
        };
        if !carried.is_empty() && carried.iter().all(is_named) {
            exchanged.push((slot, carried));
        }
    }
    let all = exchanged.clone();
    let mut selections: Vec<Vec<(String, Vec<Carried>)>> = vec![Vec::new()];
    for slot in exchanged.into_iter().take(MAX_SLOTS) {
        let longer: Vec<_> = selections
            .iter()
            .map(|chosen| [chosen.as_slice(), std::slice::from_ref(&slot)].concat())
            .collect();
        selections.extend(longer);
    }
    selections.retain(|chosen| !chosen.is_empty());
    if all.len() > MAX_SLOTS {
        selections.extend(all[MAX_SLOTS..].iter().map(|slot| vec![slot.clone()]));
        selections.push(all);
    }
    selections.into_iter().map(Choice::Momenta).collect()
}

/// Angles on the line as points, and the other way round, where the names of points are free.
fn circles(model: &Model, own: &Formulation, drops: &[String]) -> Vec<Choice> {
    let angles = model.base.iter().filter(|c| c.domain != Domain::Real && !drops.contains(&c.name));
    let choices = angles.filter_map(|c| {
        let angle = c.name.clone();
        if own.circles.contains(&angle) {
            return Some(Choice::Circle(angle, false));
        }
        let is_output = model.outputs.iter().any(|output| output.name == angle);
        (!is_output && circle_names(&angle).iter().all(|name| is_free(model, name)))
            .then_some(Choice::Circle(angle, true))
    });
    choices.take(MAX_ANGLES).collect()
}
