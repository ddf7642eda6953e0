//! hamel
