//! Tests of the runtime.

#[cfg(feature = "lanes")]
#[path = "common/systems.rs"]
mod systems;

mod digits;
mod dla;
mod double_double;
mod events;
mod gauss16;
mod gbs14;
mod impacts;
mod integrators;
mod lanes;
mod on_circles;
mod on_vectors;
mod pivots;
mod ranks;
mod scale;
mod structure;
mod variational;
