//! What the tests of the generator have of chains: models as text, and the algorithm of the arm in space.

#[path = "../../../../codegen/tests/linkages/articulated.rs"]
pub(super) mod articulated;
#[path = "../../../../codegen/tests/linkages/families.rs"]
pub(super) mod families;
