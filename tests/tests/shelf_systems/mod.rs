//! The systems of the shelf in redundant coordinates.

pub(crate) mod actuated;
pub(crate) mod balls;
pub(crate) mod bicycles;
pub(crate) mod flying;
pub(crate) mod linkages;
pub(crate) mod matrices;
pub(crate) mod particles;
pub(crate) mod rolling;
pub(crate) mod spinning;
pub(crate) mod vehicles;
