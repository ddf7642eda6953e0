//! The one derivation: Lagrange-d'Alembert equations on a Lie algebroid, from a [`ReducedSystem`] to [`Equations`].
//!
//! Deliberately does not know: where the algebroid came from (Euler-Poincare, bundle, advection, stages), parameters
//! fixed or not, programs, Rust.
//!
//! [`ReducedSystem`]: crate::reduction::ReducedSystem

mod answers;
mod balance;
mod bracket;
mod chart;
mod coefficients;
mod components;
mod condensed;
mod constrained;
mod curvature;
mod derive;
mod dirac;
mod dirac_kernel;
mod discrete;
mod displacements;
mod entropies;
mod equations;
mod equivalence;
mod feedback;
mod gauge;
mod gauss;
mod given;
mod hamilton;
mod hamiltonization;
mod impacts;
mod implicit;
mod integrable;
mod inverse;
mod kane;
mod legendre;
mod lift;
mod lifted;
mod limits;
mod linked;
mod local_connection;
mod measure;
mod momenta;
mod multipliers;
mod order;
mod origin;
mod pairings;
mod phases;
mod quotient;
mod rates;
mod recursion;
mod results;
mod retraction;
mod routh;
mod rows;
mod sections;
mod sizes;
mod solve;
mod splitting;
mod squares;
mod turns;
mod variations;
mod vertical;
mod written;

pub use balance::{Balance, Factors, Kept};
pub use bracket::Bracket;
pub use coefficients::{Coefficients, ConstrainedCoefficients, connection_coefficients};
pub use curvature::{ConnectionName, LiftBracket, NamedConnection};
pub use derive::{Extent, derive, derive_to};
pub use dirac::DiracStructure;
pub use dirac_kernel::DiracKernel;
pub use discrete::{DiscreteEquations, DiscreteSetting, DiscreteUnknown, discrete_equations, row_name};
pub use displacements::{BothEquations, DisplacementForms};
pub use equations::{
    Decrease, Equations, Facts, Form, Legendre, LinearSystem, Output, OutputKind, Production,
    SectionMomentum, StateEquation,
};
pub use equivalence::{ChangeOfState, Unrelated, same_motion};
pub use gauge::{ConservedMomenta, ConservedMomentum};
pub use hamiltonization::{BracketFacts, Jacobi};
pub use implicit::{ImplicitForm, ImplicitVariable, implicit_form};
pub use inverse::{AtRest, Forces, Responses};
pub use limits::{EXPANDED, LABORIOUS};
pub use local_connection::LocalConnection;
pub use measure::{Density, Factor};
pub use pairings::{Pairing, PairingKind};
pub use phases::{Phase, phases};
pub use quotient::{NotQuotient, Quotient, quotient_of};
pub use rates::rates;
pub use recursion::is_recursive;
pub use retraction::GroupMap;
pub use routh::Routhian;
pub use solve::{Factorisation, Pivot, PivotMatrix, PivotOrigin};
pub use splitting::{SplitFlow, Splitting};
pub use turns::of_attitudes;
pub use variations::{VariationKind, VariationPart, Variations};
pub use vertical::unused_stem;
pub use vertical::{HorizontalEquation, ShapeConnection, VerticalEquation, VerticalEquations};
pub use written::{operations_of_factors, operations_of_motion};
