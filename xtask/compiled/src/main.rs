//! compiled
fn main() {}
