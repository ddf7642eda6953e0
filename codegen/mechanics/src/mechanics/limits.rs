//! Numbers that steer which way equations are derived, each with what set it.
//!
//! A number without a command is a guess: no measurement has told it from its neighbours.
//!
//! Deliberately does not know: how ways are tried.

/// Most operations of multiplied-out equations as they are written, as a multiple of those by recursion: where there
/// are more, they do not cost less. Of a snake of three links they are 307 and 152, of five links 1148 and 328, and
/// recursion costs less in both (`LINKAGES="snake:5:auto" cargo test -p hamel-codegen --test main linkages::measured`).
pub const EXPANDED: u64 = 2;

/// Most work of a derivation of multiplied-out equations, as a multiple of that by recursion: where there is more, they
/// are not tried. Of chains of five bodies, where they still cost less, it is 0.7 (pendulums in the plane), 0.8 (arms)
/// and 0.9 (pendulums in space), of snakes 1.3 before they are solved (`HAMEL_TRACE=derive`, "derivation of momenta and
/// forces" and "solution for the accelerations", models of `codegen/tests/linkages/families.rs`); the rest is room for
/// others.
pub const LABORIOUS: u64 = 2;

/// Most rates along which partial velocities are tried: their number grows with the square of the bodies. Arms in the
/// plane take more operations that way from four rates on (`LINKAGES="arm:4" cargo test -p hamel-codegen --test
/// main linkages::measured`), and systems of more rates than this are taken for such.
pub(super) const MAX_PARTIAL: usize = 6;

/// Another way than partial velocities has to take fewer operations by more than this part of them: lowering, which
/// finds common divisors, changes what is written by more than that. Of the ways of a snake of five links, which are
/// 342, 343 and 341 operations as written and 205, 197 and 209 lowered, the first is kept
/// (`LINKAGES="snake:5" cargo test -p hamel-codegen --test main linkages::measured`).
pub(super) const CLOSE: u64 = 50;

/// Parts on parts from which on recursion is tried: three bodies. With fewer there is nothing to share that a
/// search for common sums does not find.
pub(super) const MIN_DEPTH: usize = 3;

/// Sums that are tried as parts of a further one in a recursion, the latest first. A guess.
pub(super) const MAX_SUMS: usize = 100;

/// Forces along rates of more terms are not multiplied out before parts are eliminated. A guess.
pub(super) const MAX_EXPANDED: usize = 1000;

/// Operands up to which rates of momenta are multiplied out. A guess.
pub(super) const MAX_LENGTH: usize = 2000;

/// Most frames that are tried for one square of velocities and do not fit. A guess.
pub(super) const MAX_TRIALS: usize = 500;

/// Components of one weight that are tried together as a square of velocities. A guess.
pub(super) const MAX_SINGLES: usize = 8;

/// In larger systems that are multiplied out, which are algebras rather than bodies, no frames are looked for: the work
/// grows with the square of the rank. A guess.
pub(super) const MAX_RANK: usize = 24;
