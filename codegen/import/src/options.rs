//! Choices that a file leaves open.
//!
//! Deliberately does not know: formats, the model language.

/// What becomes of the limits of joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Limits {
    /// The interval of the coordinate: a motion that leaves it ends.
    #[default]
    Interval,
    /// Smooth springs of one stiffness behind each limit.
    Spring,
    /// Nothing.
    None,
}

/// What the file does not say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Options {
    /// The root moves freely, and does not rest.
    pub floating: bool,
    /// What becomes of the limits of joints.
    pub limits: Limits,
    /// Joints that are taken as fixed where their coordinates are zero.
    pub locked: Vec<String>,
    /// Links that have a named frame, the one of the file.
    pub frames: Vec<String>,
    /// Whether bodies are items of the model, for their mass centre and momentum.
    pub bodies: bool,
}
