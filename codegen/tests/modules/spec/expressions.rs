//! The list of all expressions of a model.

use std::collections::{BTreeMap, BTreeSet};

use hamel_codegen::spec::{ExpressionRole, Model, parse};

/// A model in which the parameter `k` occurs in an expression of every role.
fn model_of_everything() -> Model {
    let items = "
        param k = 2 where k > 0;
        velocity Omega, V in se(3);
        coordinate theta in (0, k);
        coordinate x in real;
        connection V1 = k*theta_dot;
        stage whole;
        stage translations = ideal(V);
        inner_product = diag([k, k, k, 1, 1, 1]);
        advected Gamma in R^3 by k*cross(Omega, Gamma);
        lagrangian = k*dot(Omega, Omega) + dot(V, V) + theta_dot^2 + x_dot^2 + z_dot^2;
        constraint k*Omega3 = x_dot;
        coordinate z in real by z = k*x;
        constraint k*ddt(Omega1) = Omega2;
        virtual delta(Omega1) = 0;
        virtual k*delta(Omega3) = delta(x_dot);
        virtual delta(z_dot) = 0;
        force Omega = -k*Omega;
        casimir length = k*dot(Gamma, Gamma);
        output speed = k*norm(V);
        reconstruct s by k*Omega1;
        initial x = k;
    ";
    parse("m.hamel", &format!("model m {{ {items} }}")).unwrap_or_else(|problems| panic!("{problems}"))
}

fn name(role: ExpressionRole) -> String {
    format!("{role:?}").chars().take_while(char::is_ascii_alphabetic).collect()
}

#[test]
fn every_role_occurs_and_can_be_replaced() {
    let mut model = model_of_everything();
    let symbol = model.params[0].symbol;
    let mentions = |model: &Model| -> BTreeSet<String> {
        let with = model.expressions().into_iter();
        with.filter(|(_, e)| model.graph.free_symbols(*e).contains(&symbol))
            .map(|(role, _)| name(role))
            .collect()
    };
    let all = [
        "AdvectedAction",
        "Casimir",
        "Condition",
        "Connection",
        "ConstraintAcceleration",
        "ConstraintPosition",
        "ConstraintResidual",
        "DomainEnd",
        "Force",
        "Initial",
        "InnerProduct",
        "Lagrangian",
        "Output",
        "Reconstruction",
        "VirtualConstraint",
    ];
    assert_eq!(mentions(&model), all.map(str::to_owned).into());
    let before: Vec<ExpressionRole> = model.expressions().into_iter().map(|(role, _)| role).collect();
    let (graph, expressions) = model.expressions_mut();
    assert_eq!(expressions.iter().map(|(role, _)| *role).collect::<Vec<_>>(), before);
    let three = BTreeMap::from([(symbol, graph.int(3))]);
    for (_, e) in expressions {
        *e = graph.subs(*e, &three).expect("no denominators");
    }
    assert_eq!(mentions(&model), BTreeSet::new());
}
