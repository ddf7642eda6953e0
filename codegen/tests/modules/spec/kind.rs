//! Kinds of models.

use hamel_codegen::spec::parse;

fn kind(items: &str) -> String {
    let text = format!("model m {{ {items} }}");
    parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}")).kind().to_string()
}

#[test]
fn kinds_have_the_names_of_the_literature() {
    let body = "velocity w in so(3); lagrangian = dot(w, w);";
    let disk = "coordinate s in angle; velocity w in so(3); lagrangian = dot(w, w) + s_dot^2;";
    let free = "coordinate s in real; coordinate r in real; lagrangian = r_dot^2 + s_dot^2 + (s - r);";
    let cases = [
        (body, "", "Euler-Poincaré"),
        (body, "constraint w3 = 0;", "Euler-Poincaré-Suslov"),
        (body, "constraint w3 = 2;", "Euler-Poincaré-Suslov, affine constraints"),
        (body, "constraint w1*w2 = w3^2;", "Euler-Poincaré-Suslov, nonlinear constraints"),
        (
            body,
            "constraint ddt(ddt(w3)) = 0; virtual delta(w1) = 0;",
            "Euler-Poincaré-Suslov, third-order constraints, servo constraints",
        ),
        (body, "constraint w3 = 0; virtual delta(w1) = 0;", "Euler-Poincaré-Suslov, servo constraints"),
        (body, "advected G in R^3 by cross(w, G);", "Euler-Poincaré, advected parameters"),
        (disk, "", "Lagrange-Poincaré"),
        (disk, "constraint w1 = s_dot;", "Lagrange-d'Alembert-Poincaré"),
        (
            disk,
            "constraint w1 = s_dot; constraint w2 = 1;",
            "Lagrange-d'Alembert-Poincaré, affine constraints",
        ),
        ("momentum p in so(3); hamiltonian = dot(p, p);", "", "Lie-Poisson"),
        ("momentum p in so(3); hamiltonian = dot(p, p);", "constraint dh_dp3 = 0;", "Lie-Poisson-Suslov"),
        ("coordinate s in real; momentum p of s_dot; hamiltonian = p^2;", "", "Hamilton"),
        (free, "", "Lagrange"),
        ("coordinate s in real; acceleration s_dot = -s;", "", "vector field"),
        ("velocity w in so(3); acceleration w = cross(w, [1, 0, 0]);", "", "invariant vector field"),
        (
            "coordinate s in real; algebroid { basis e; velocities w; anchor s_dot = w; } lagrangian = w^2;",
            "",
            "Lagrange on a Lie algebroid",
        ),
        (free, "constraint r_dot = s*s_dot;", "Lagrange-d'Alembert"),
    ];
    for (model, items, expected) in cases {
        assert_eq!(kind(&format!("{model} {items}")), expected, "{items}");
    }
    let stages = "velocity v in R^2; stage a; stage b = ideal(v1); lagrangian = dot(v, v);";
    assert_eq!(kind(stages), "Euler-Poincaré, by stages");
}
