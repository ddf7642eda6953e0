//! What a scene can ask for by a name that is not the model's own.
//!
//! Deliberately does not know: how any of it is derived or computed.

/// A function, a group of outputs or a way to carry the state that a scene can want; the names of single casimirs and
/// outputs come on top.
///
/// This is the only list of them: the parser accepts these names, no output can have one, and whoever derives or
/// emits one takes its name from here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Want {
    /// The right-hand side, which every scene has.
    Rhs,
    /// The energy.
    Energy,
    /// Its rate along the motion, of systems that do not conserve it.
    EnergyRate,
    /// The momenta `dL/dy`.
    Momentum,
    /// The velocities of the model that momenta, or velocities along the levels of stages, stand for in the state.
    Velocities,
    /// Multipliers of constraints, where they are computed.
    Multipliers,
    /// Residuals of constraints, where the state can violate them.
    Constraint,
    /// The momenta along virtual displacements, where a constraint has been solved.
    NonholonomicMomentum,
    /// Their rates by the nonholonomic momentum equation.
    MomentumEquation,
    /// The derivative of the right-hand side by the state.
    Jacobian,
    /// Its product with a direction of the state.
    Jvp,
    /// The product of its transpose with a covector.
    Vjp,
    /// The derivative by time at a fixed state.
    TimeDerivative,
    /// The derivative by the parameters.
    Sensitivity,
    /// Its product with a direction of the parameters.
    SensitivityJvp,
    /// The product of its transpose with a covector.
    SensitivityVjp,
    /// The derivative by the inputs.
    InputJacobian,
    /// The matrices of the linear system near a point: derivatives of rates and outputs by state and inputs.
    Linearization,
    /// The derivative of the outputs of the model by the state.
    OutputJacobian,
    /// The derivative of the outputs of the model by the inputs.
    Feedthrough,
    /// The matrix `A` of `A udot = f`, with the velocities `u` of the state.
    MassMatrix,
    /// The forces that have to act beside the model's for given accelerations.
    InverseDynamics,
    /// The forces at zero accelerations.
    Bias,
    /// The forces at zero velocities and accelerations.
    Gravity,
    /// Everything about the named frames of the model.
    Frames,
    /// Places and rotations of the named frames.
    FramePoses,
    /// Their angular velocities and velocities, in their own axes.
    FrameTwists,
    /// The derivatives of the twists by the velocities of the state.
    FrameJacobians,
    /// The rates of the twists at zero accelerations.
    FrameDrifts,
    /// The inverses of the inertias at the named frames, `J A^-1 J^T`.
    OperationalSpace,
    /// Place and velocity of the mass centre of all bodies.
    CenterOfMass,
    /// The derivatives of its velocity by the velocities of the state.
    CenterOfMassJacobian,
    /// The momentum of all bodies, the angular one about the mass centre.
    CentroidalMomentum,
    /// The derivatives of this momentum by the velocities of the state.
    CentroidalMomentumMatrix,
    /// The coordinates of the group as part of the state.
    Reconstruction,
    /// All casimirs of the model.
    Casimirs,
    /// `c^2 + s^2` of the angles that the scene carries as points of the circle.
    Circles,
    /// All outputs of the model.
    Outputs,
    /// The momenta along the sections of the model.
    Sections,
    /// The rates of these momenta by the momentum equation, without conserved ones.
    SectionRates,
    /// The functions whose changes of sign are events, and what the events set.
    Events,
    /// Rates of geometric and dynamic phases.
    Phases,
    /// The local form of the connection, and its curvature.
    Connection,
    /// The matrices of the reduced Dirac structure.
    Dirac,
    /// The Taylor coefficients of solutions.
    Taylor,
    /// What the motion conserves, with gradients.
    Invariants,
    /// Residuals of the equations between coordinates, with gradients.
    Positions,
    /// The nonholonomic bracket of the components of the state.
    Bracket,
    /// The time in which the motion is Hamiltonian.
    HamiltonianTime,
    /// Exact flows whose generators add up to the motion.
    Splitting,
    /// The equations with a mass matrix, `M z' = f(t, z)`, and their variables at a state.
    Implicit,
    /// The map of the model that this one is the quotient of: the state and the parameters by that model's.
    Quotient,
    /// All digits that the inputs have: functions that lose some carry their rounding errors along.
    Digits,
    /// Products of matrices in the place of equations, for ideal fluids: a [`MatrixFluid`](super::MatrixFluid).
    Matrices,
}

impl Want {
    /// All of them, in the order in which messages list them.
    pub const ALL: [Want; 54] = [
        Want::Rhs,
        Want::Energy,
        Want::EnergyRate,
        Want::Momentum,
        Want::Velocities,
        Want::Multipliers,
        Want::Constraint,
        Want::NonholonomicMomentum,
        Want::MomentumEquation,
        Want::Jacobian,
        Want::Jvp,
        Want::Vjp,
        Want::TimeDerivative,
        Want::Sensitivity,
        Want::SensitivityJvp,
        Want::SensitivityVjp,
        Want::InputJacobian,
        Want::Linearization,
        Want::OutputJacobian,
        Want::Feedthrough,
        Want::MassMatrix,
        Want::InverseDynamics,
        Want::Bias,
        Want::Gravity,
        Want::Frames,
        Want::FramePoses,
        Want::FrameTwists,
        Want::FrameJacobians,
        Want::FrameDrifts,
        Want::OperationalSpace,
        Want::CenterOfMass,
        Want::CenterOfMassJacobian,
        Want::CentroidalMomentum,
        Want::CentroidalMomentumMatrix,
        Want::Reconstruction,
        Want::Casimirs,
        Want::Circles,
        Want::Outputs,
        Want::Sections,
        Want::SectionRates,
        Want::Events,
        Want::Phases,
        Want::Connection,
        Want::Dirac,
        Want::Taylor,
        Want::Invariants,
        Want::Positions,
        Want::Bracket,
        Want::HamiltonianTime,
        Want::Splitting,
        Want::Implicit,
        Want::Quotient,
        Want::Digits,
        Want::Matrices,
    ];

    /// What the scene says, and the name of the function or output where there is one.
    pub const fn name(self) -> &'static str {
        match self {
            Want::Rhs => "rhs",
            Want::Energy => "energy",
            Want::EnergyRate => "energy_rate",
            Want::Momentum => "momentum",
            Want::Velocities => "velocities",
            Want::Multipliers => "multipliers",
            Want::Constraint => "constraint",
            Want::NonholonomicMomentum => "nonholonomic_momentum",
            Want::MomentumEquation => "momentum_equation",
            Want::Jacobian => "jacobian",
            Want::Jvp => "jvp",
            Want::Vjp => "vjp",
            Want::TimeDerivative => "time_derivative",
            Want::Sensitivity => "sensitivity",
            Want::SensitivityJvp => "sensitivity_jvp",
            Want::SensitivityVjp => "sensitivity_vjp",
            Want::InputJacobian => "input_jacobian",
            Want::Linearization => "linearization",
            Want::OutputJacobian => "output_jacobian",
            Want::Feedthrough => "feedthrough",
            Want::MassMatrix => "mass_matrix",
            Want::InverseDynamics => "inverse_dynamics",
            Want::Bias => "bias",
            Want::Gravity => "gravity",
            Want::Frames => "frames",
            Want::FramePoses => "frame_poses",
            Want::FrameTwists => "frame_twists",
            Want::FrameJacobians => "frame_jacobians",
            Want::FrameDrifts => "frame_drifts",
            Want::OperationalSpace => "operational_space",
            Want::CenterOfMass => "center_of_mass",
            Want::CenterOfMassJacobian => "center_of_mass_jacobian",
            Want::CentroidalMomentum => "centroidal_momentum",
            Want::CentroidalMomentumMatrix => "centroidal_momentum_matrix",
            Want::Reconstruction => "reconstruction",
            Want::Casimirs => "casimirs",
            Want::Circles => "circles",
            Want::Outputs => "outputs",
            Want::Sections => "sections",
            Want::SectionRates => "section_rates",
            Want::Events => "events",
            Want::Phases => "phases",
            Want::Connection => "connection",
            Want::Dirac => "dirac",
            Want::Taylor => "taylor",
            Want::Invariants => "invariants",
            Want::Positions => "positions",
            Want::Bracket => "bracket",
            Want::HamiltonianTime => "hamiltonian_time",
            Want::Splitting => "splitting",
            Want::Implicit => "implicit",
            Want::Quotient => "quotient",
            Want::Digits => "digits",
            Want::Matrices => "matrices",
        }
    }

    /// What has that name.
    pub fn from_name(name: &str) -> Option<Want> {
        Want::ALL.into_iter().find(|want| want.name() == name)
    }

    /// Whether it is made of all bodies of the model.
    pub const fn is_of_bodies(self) -> bool {
        matches!(
            self,
            Want::CenterOfMass
                | Want::CenterOfMassJacobian
                | Want::CentroidalMomentum
                | Want::CentroidalMomentumMatrix
        )
    }

    /// Whether it may stand beside the state in a table, so that nothing in a model can be called so. The others can
    /// name anything but an output.
    pub(super) fn is_in_tables(self) -> bool {
        use Want::{
            Bias, Bracket, Casimirs, CenterOfMass, CenterOfMassJacobian, CentroidalMomentum,
            CentroidalMomentumMatrix, Circles, Connection, Constraint, Digits, Dirac, Events, Feedthrough,
            FrameDrifts, FrameJacobians, FramePoses, FrameTwists, Frames, Gravity, HamiltonianTime, Implicit,
            InputJacobian, Invariants, InverseDynamics, Linearization, MassMatrix, Matrices,
            MomentumEquation, NonholonomicMomentum, OperationalSpace, OutputJacobian, Outputs, Phases,
            Positions, Quotient, SectionRates, Sections, Splitting, Taylor, Velocities,
        };
        !matches!(
            self,
            Constraint
                | NonholonomicMomentum
                | MomentumEquation
                | Casimirs
                | Circles
                | Outputs
                | Events
                | Phases
                | Connection
                | Dirac
                | Sections
                | SectionRates
                | Taylor
                | Velocities
                | Invariants
                | Positions
                | Bracket
                | HamiltonianTime
                | Splitting
                | Implicit
                | Quotient
                | Digits
                | Matrices
                | InputJacobian
                | Linearization
                | OutputJacobian
                | Feedthrough
                | MassMatrix
                | InverseDynamics
                | Bias
                | Gravity
                | Frames
                | FramePoses
                | FrameTwists
                | FrameJacobians
                | FrameDrifts
                | OperationalSpace
                | CenterOfMass
                | CenterOfMassJacobian
                | CentroidalMomentum
                | CentroidalMomentumMatrix
        )
    }
}

/// What a scene asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// By a word of the language.
    Want(Want),
    /// A casimir, an output of the model or a component of one, by its own name.
    Own(String),
}

impl Wanted {
    /// What a name in a scene stands for.
    pub(super) fn from_name(name: &str) -> Wanted {
        Want::from_name(name).map_or_else(|| Wanted::Own(name.to_owned()), Wanted::Want)
    }

    /// As the scene says it.
    pub fn name(&self) -> &str {
        match self {
            Wanted::Want(want) => want.name(),
            Wanted::Own(name) => name,
        }
    }
}
