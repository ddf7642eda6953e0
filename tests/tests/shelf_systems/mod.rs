//! The systems of the shelf in redundant coordinates.

pub(crate) mod rolling;
pub(crate) mod vehicles;
