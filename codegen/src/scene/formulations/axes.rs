//! What a formulation can choose in the place of what a scene has: one axis for each kind of choice.
//!
//! Does not know: how choices are combined, what they cost, whether they are the same motion.

use crate::expr::{ExprId, independent_rows};
use crate::reduction::{Formulation, KinematicConstraint, ReducedSystem};
use crate::spec::{ConnectionKind, Domain, Model, circle_names};

/// Choices of independent velocities that are tried, those first that exchange the fewest velocities.
const MAX_INDEPENDENT: usize = 32;
/// Angles that are tried as points of the circle, in the order of the model.
const MAX_ANGLES: usize = 4;

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
        }
    }
}

/// The axes along which the formulation of a scene can be changed, each with the choices that are not the scene's own.
pub(super) fn axes(
    model: &Model,
    own: &Formulation,
    system: &ReducedSystem,
    drops: &[String],
) -> Vec<Vec<Choice>> {
    let mut axes = vec![connections(model, own), independent(system), vec![Choice::Squares(!own.squares)]];
    axes.extend(circles(model, own, drops).into_iter().map(|choice| vec![choice]));
    axes.retain(|axis| !axis.is_empty());
    axes
}

fn connections(model: &Model, own: &Formulation) -> Vec<Choice> {
    if model.base.is_empty() || model.algebra.dim() == 0 {
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
    let KinematicConstraint::Solved(solved) = &system.constraint else { return Vec::new() };
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

/// Angles on the line as points, and the other way round, where the names of points are free.
fn circles(model: &Model, own: &Formulation, drops: &[String]) -> Vec<Choice> {
    let is_free = |name: &String| {
        !model.places.declared.contains_key(name)
            && model.params.iter().all(|p| p.name != *name)
            && model.all_velocities().iter().all(|(other, _)| other != name)
            && model.outputs.iter().all(|output| output.name != *name)
    };
    let angles = model.base.iter().filter(|c| c.domain != Domain::Real && !drops.contains(&c.name));
    let choices = angles.filter_map(|c| {
        let angle = c.name.clone();
        if own.circles.contains(&angle) {
            return Some(Choice::Circle(angle, false));
        }
        let is_output = model.outputs.iter().any(|output| output.name == angle);
        (!is_output && circle_names(&angle).iter().all(is_free)).then_some(Choice::Circle(angle, true))
    });
    choices.take(MAX_ANGLES).collect()
}
