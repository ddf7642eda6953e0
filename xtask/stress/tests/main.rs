//! What the short stress run says of models.

mod bounds;
