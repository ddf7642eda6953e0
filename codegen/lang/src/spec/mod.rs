//! The model language: text or Rust calls to a checked [`Model`].
//!
//! [`parse`] reads a file; [`ModelBuilder`] is the same front end for Rust, and the parser uses it. All problems of a
//! file are reported at once, each with its place, the offending tokens underlined and a hint. What a model declares
//! without using it is a warning, which the checked model carries. No input makes this module panic: nesting, sizes,
//! numbers and work are limited, and every limit has a message.
//!
//! The language is described in `docs/model-language.md`.
//!
//! Deliberately does not know: equations of motion, stage forms, Rust code.

mod ast;
mod builder;
mod compose;
mod configuration;
mod constraint;
mod context;
mod decisive;
mod diagnostic;
mod discrete;
mod displaced;
mod elaborate;
mod eval;
mod eval_algebra;
mod eval_logarithm;
mod eval_motion;
mod eval_orthonormal;
mod eval_rotation;
mod event;
mod expressions;
mod family;
mod first_order;
mod fluid;
mod format;
mod group;
pub mod group_motion;
mod images;
mod kind;
mod layout;
mod limits;
mod matrix_group;
mod mode;
mod model;
mod motions;
mod names;
mod noise;
mod outline;
mod parser;
mod parts;
mod quasi_invariance;
mod rates;
mod redundant;
mod shape;
mod size;
mod structure;
mod tokens;
mod total;
mod unit;
mod units;
mod unused;
mod value;
mod view;
mod vocabulary;
mod want;
mod written;

pub use ast::Compare;
pub use builder::{ModelBuilder, Placement};
pub use compose::compose;
pub use configuration::Configuration;
pub use constraint::{
    CarriedAcceleration, Constraint, ConstraintKind, Implied, Lyapunov, PositionEquation, VirtualConstraint,
};
pub use context::Context;
pub use decisive::{Made, decisive};
pub use diagnostic::{Diagnostic, Diagnostics, Help, Origin, Replacement, Severity, Span};
pub use discrete::{Discrete, Retraction};
pub use event::{Event, EventDirection, OutputPart};
pub use expressions::ExpressionRole;
pub use family::with_sizes;
pub use first_order::FirstOrderState;
pub use fluid::{
    CarriedField, FluidCasimir, FluidField, FluidMode, FluidParam, FluidSurface, FluidTerm, FluidTrace,
    FluidWave, MAX_CARRIED, MAX_FRICTION, MatrixFluid, Meaning,
};
pub use format::format;
pub use group::Group;
pub use images::{ImageProblems, with_items};
pub use kind::{Kind, Restriction, Setting};
pub use layout::Layout;
pub use matrix_group::{KeptForm, MatrixFamily, MatrixGroup, MatrixSpace};
pub use mode::{Impact, Mode};
pub use model::{
    Advected, Carried, CarriedBy, Condition, ConnectionKind, Coordinate, Domain, FormulationSearch, Given,
    IdealChain, InnerProduct, Model, Momentum, Named, NamedVector, OwnAlgebroid, OwnBracket, Param,
    ParamArray, Places, QuasiFrame, Reconstruction, ReconstructionKind, Scene, Side, Velocity,
    VelocitySection, circle_names, diagnose,
};
pub use names::LEVEL_MOMENTUM;
pub use noise::Noise;
pub use outline::{Declaration, DeclarationKind, Mention, Outline};
pub use quasi_invariance::QuasiInvariance;
pub use shape::{Expected, Operation, Shape, ValueError};
pub use size::FamilySize;
pub use structure::{Call, Fold, call_at, folds};
pub use total::{Image, Total};
pub use unit::{Unit, Units};
pub use value::Value;
pub use view::{View, ViewShape, Views};
pub use vocabulary::{Word, WordKind, vocabulary};
pub use want::{Want, Wanted};

/// Algebras and representations, for [`ModelBuilder`].
pub use crate::algebra::{Block, Bracket, LieAlgebra, Matrix, Representation};
/// Expressions and exact numbers, for [`ModelBuilder`] and those who look at a [`Model`].
pub use hamel_expr::{Budget, DivisionByZero, ExprId, Func, Graph, Rational, Relation, SymbolId, Vanishing};

/// The words that begin items and their parts, for those who show the text of a model.
pub fn keywords() -> Vec<&'static str> {
    let parts = [
        "model",
        "part",
        "in",
        "by",
        "of",
        "on",
        "where",
        "from",
        "relative",
        "around",
        "at",
        "attitude",
        "fix",
        "want",
        "drop",
        "circle",
        "basis",
        "as",
        "discrete",
        "retraction",
    ];
    names::ITEMS.iter().map(|(item, _)| *item).chain(parts).collect()
}

/// Why a name cannot be declared in a model or be that of one, or nothing.
///
/// ```
/// use hamel_lang::spec::name_refusal;
///
/// assert_eq!(name_refusal("heavy_top"), None);
/// assert!(name_refusal("heavy-top").unwrap().contains("ASCII letters"));
/// ```
pub fn name_refusal(name: &str) -> Option<&'static str> {
    names::refusal(name)
}

/// Reads and checks a model.
///
/// `file_name` is only shown in messages.
///
/// ```
/// let text = "model top { param I: diagonal(3) = [1, 2, 3]; velocity Omega in so(3); \
///             lagrangian = dot(Omega, I*Omega)/2; }";
/// let model = hamel_lang::spec::parse("top.hamel", text).unwrap();
/// assert_eq!(model.params[1].name, "I2");
///
/// let wrong = text.replace("I*Omega", "I*Omgea");
/// let problems = hamel_lang::spec::parse("top.hamel", &wrong).unwrap_err();
/// assert!(problems.to_string().contains("did you mean `Omega`?"));
/// ```
///
/// # Errors
/// All problems of the text, in its order.
pub fn parse(file_name: &str, text: &str) -> Result<Model, Diagnostics> {
    parse_within(Budget::default(), file_name, text)
}

/// As [`parse`], with other limits for the model, from its values to the programs of its scenes.
///
/// ```
/// use hamel_lang::spec::Budget;
/// use hamel_lang::spec;
/// let text = "model m { velocity v in R; lagrangian = v^2; }";
/// assert!(spec::parse_within(Budget::default().times(10), "m.hamel", text).is_ok());
/// let tiny = Budget { expressions: 4, ..Budget::default() };
/// let problems = spec::parse_within(tiny, "m.hamel", text).unwrap_err();
/// assert!(problems.to_string().contains("makes more than 4 expressions"));
/// ```
///
/// # Errors
/// As [`parse`].
pub fn parse_within(budget: Budget, file_name: &str, text: &str) -> Result<Model, Diagnostics> {
    // Editors on Windows may write a byte order mark; spans count without it.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let outcome = parser::parse_file(text);
    let origin = Origin { file: file_name.to_owned(), text: text.to_owned() };
    if let Some(span) = outcome.file.as_ref().and_then(fluid::requested) {
        let problems = [outcome.problems, vec![fluid::refusal(span)]].concat();
        return Err(Diagnostics::new(Some(origin), problems));
    }
    elaborate::elaborate(outcome, origin, budget)
}

/// Reads a model, and functions of it as its last outputs, one for each image in their order; also how many outputs it
/// has of its own.
///
/// # Errors
/// All problems of the model, and of the functions.
pub fn parse_with_images(
    budget: Budget,
    origin: &Origin,
    images: &[Image],
) -> Result<(Model, usize), ImageProblems> {
    let extended =
        images::Extended::new(origin.text.strip_prefix('\u{feff}').unwrap_or(&origin.text), images);
    let model = parse_within(budget, &origin.file, &extended.text);
    let model = model.map_err(|list| extended.problems(&list, origin))?;
    let n_own =
        model.outputs.iter().position(|output| extended.has(&output.name)).unwrap_or(model.outputs.len());
    Ok((model, n_own))
}

/// Reads a fluid that is moved as products of matrices; none for a model with equations, which [`parse`] reads.
///
/// What it takes does not depend on `N`.
///
/// ```
/// let text = "model flow {
///     algebra fluid = zeitlin(255);
///     momentum omega in fluid as *;
///     action right;
///     hamiltonian = -dot(omega, laplacian(fluid)^-1*omega);
///     initial re_1_0 = 0.5;
///     initial im_2_m3 = -0.25;
/// }";
/// let fluid = hamel_lang::spec::matrix_fluid("flow.hamel", text).unwrap().unwrap();
/// assert_eq!((fluid.n, fluid.modes[1].wave.wave), (255, (2, -3)));
/// let refused = hamel_lang::spec::parse("flow.hamel", text).unwrap_err();
/// assert!(refused.to_string().contains("products of matrices"));
/// ```
///
/// # Errors
/// Everything in such a model that is no part of the fluid, in the order of the text.
pub fn matrix_fluid(file_name: &str, text: &str) -> Result<Option<MatrixFluid>, Diagnostics> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let outcome = parser::parse_file(text);
    let Some(file) = outcome.file.filter(|file| fluid::requested(file).is_some()) else { return Ok(None) };
    let mut problems = outcome.problems;
    let origin = Origin { file: file_name.to_owned(), text: text.to_owned() };
    match fluid::read(&file, &origin) {
        Ok(fluid) if problems.is_empty() => return Ok(Some(fluid)),
        Ok(_) => {}
        Err(list) => problems.extend(list),
    }
    Err(Diagnostics::new(Some(origin), problems))
}
