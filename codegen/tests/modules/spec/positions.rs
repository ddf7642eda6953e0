//! Equations between positions.

use hamel_codegen::spec::parse;

#[test]
fn rates_contain_connection_and_advection() {
    let items = "
        coordinate x in real;
        velocity Omega in so(3);
        connection Omega1 = 2*x_dot;
        advected Gamma in R^3 by cross(Omega, Gamma);
        lagrangian = x_dot^2 + dot(Omega, Omega);
        constraint touching: x = Gamma3;
    ";
    let mut model = parse("m.hamel", &format!("model m {{ {items} }}")).unwrap_or_else(|p| panic!("{p}"));
    let constraint = model.constraints[0].clone();
    assert!(constraint.position.is_some_and(|p| p.determines.is_none()));
    // Gamma' = Gamma x (Omega - A xdot): Gamma3' = Gamma1 Omega2 - Gamma2 (Omega1 - 2 xdot).
    let symbol = |name: &str, model: &hamel_codegen::spec::Model| {
        let velocities = model.all_velocities();
        let advected = model.advected[0].components.iter().map(|(n, s)| (n.as_str(), *s));
        let found = velocities.into_iter().chain(advected).find(|(n, _)| *n == name);
        found.unwrap_or_else(|| panic!("{name}")).1
    };
    let [v, o1, o2, g1, g2] = ["x_dot", "Omega1", "Omega2", "Gamma1", "Gamma2"].map(|n| symbol(n, &model));
    let g = &mut model.graph;
    let [v, o1, o2, g1, g2] = [v, o1, o2, g1, g2].map(|s| g.sym(s));
    let two = g.int(2);
    let turned = g.mul(two, v);
    let turned = g.sub(o1, turned);
    let (first, second) = (g.mul(g1, o2), g.mul(g2, turned));
    let rate = g.sub(first, second);
    let expected = g.sub(v, rate);
    assert!(g.is_equal(constraint.residual, expected));
}
