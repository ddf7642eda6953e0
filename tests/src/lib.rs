//! hamel tests
