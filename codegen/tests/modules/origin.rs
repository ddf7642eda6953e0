//! Results of a derivation, as they are looked at and as they are replaced.

use hamel_codegen::spec::parse;
use hamel_expr::ExprId;
use hamel_mechanics::mechanics::derive;
use hamel_mechanics::reduction::{Formulation, reduce};

#[test]
fn what_is_replaced_is_what_was_looked_at() {
    // Matrices of parameters, whose pivots have origins, and one that depends on the state.
    let text = "model m { param a = 2; param b = 1; param c = 3; coordinate x, z in real; velocity w in R;
        lagrangian = a/2*x_dot^2 + b*x_dot*z_dot + c/2*z_dot^2 + (2 + sin(x))/2*w^2; }";
    let model = parse("m.hamel", text).unwrap();
    let mut equations = derive(&reduce(&model, &Formulation::of(&model)).unwrap()).unwrap();
    assert!(equations.pivots.iter().any(|p| p.origin.as_ref().is_some_and(|o| !o.updates.is_empty())));
    let looked_at: Vec<ExprId> = equations.results();
    let replaced: Vec<ExprId> = equations.results_mut().into_iter().map(|root| *root).collect();
    assert_eq!(looked_at, replaced);
}
