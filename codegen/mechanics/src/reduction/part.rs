//! What the expressions of a reduced system are.
//!
//! Does not know: the system.

/// What an expression of a [`ReducedSystem`](super::ReducedSystem) is, see
/// [`ReducedSystem::expressions_mut`](super::ReducedSystem::expressions_mut).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A bound of a condition on parameters.
    Condition,
    /// An entry of anchor, bracket or drift.
    Algebroid,
    /// A coefficient `A^a_i`.
    Connection,
    /// The Lagrangian.
    Lagrangian,
    /// The Hamiltonian.
    Hamiltonian,
    /// The acceleration that a model gives for an unknown, by its place.
    Acceleration(usize),
    /// The force on a velocity of the frame.
    Force(usize),
    /// A coefficient or the remainder of a constraint, by its place.
    Constraint(usize),
    /// A coefficient of constraints that were solved, or what was divided by.
    SolvedConstraint,
    /// A coefficient of virtual displacements, or of a one-form that vanishes on them.
    VirtualDisplacement,
    /// The rate of an acceleration along a constraint of third order.
    CarriedRate,
    /// The rate of a state of first order.
    OwnRate,
    /// What noises add to the rate of a base coordinate.
    NoiseRate,
    /// An equation between coordinates.
    Position,
    /// A condition that equations without accelerations are.
    Degeneracy,
    /// A Casimir, by its place.
    Casimir(usize),
    /// A component of an output, by the output's place.
    Output(usize),
    /// The rate of a function that an actuator gives it.
    Feedback,
    /// A coefficient of a section along which a momentum is wanted, by the section's place.
    Section(usize),
    /// The rate of a coordinate of the group, by its place.
    Rate(usize),
    /// An entry of the rows that turn momenta into space.
    MomentumInSpace,
    /// A function of the coordinates of a matrix group.
    GroupEquation,
    /// A coefficient of the stage forms.
    Stages,
    /// A coefficient of a change of frame, or a variable of the state by those of the model.
    Frame,
    /// A parameter that is a momentum, or the difference of momenta of the model and of the Lagrangian.
    Momentum,
    /// What is positive inside of the domain, by its place.
    Domain(usize),
}
