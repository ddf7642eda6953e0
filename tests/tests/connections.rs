//! Derived connections: other coordinates, the same motion.

use std::collections::BTreeMap;

use hamel_codegen::scene;
use hamel_codegen::spec::{self, ConnectionKind, Diagnostics, Model};
use hamel_expr::{ExprId, Graph, SymbolId, rational_to_f64};
use hamel_mechanics::mechanics::derive;
use hamel_mechanics::reduction::{Formulation, KinematicConstraint, ReducedSystem, reduce, with_connection};
use hamel_runtime::{Dop853, Integrator, Options};
use hamel_tests::models::{Interpreted, State, model};

fn rewritten(model: &Model, kind: ConnectionKind) -> Model {
    with_connection(model, kind).unwrap_or_else(|e| panic!("{e}"))
}

/// In the formulation that the model's own items choose.
fn reduced(model: &Model) -> Result<ReducedSystem, Diagnostics> {
    reduce(model, &Formulation::of(model))
}

fn flow(model: &Model, initial: &[f64], t_final: f64) -> Vec<f64> {
    let built = scene::build(model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let system = Interpreted(built.prepare(&params).unwrap_or_else(|e| panic!("{e}")));
    let options = Options::adaptive(1e-13, 1e-13);
    let mut integrator = Integrator::new(&system, Dop853, 0.0, State(initial.to_vec()), options).unwrap();
    integrator.integrate_to(t_final).unwrap();
    integrator.state().0.clone()
}

/// `v + A(x) xdot` at a state `[x, xdot, v]`, parameters at their defaults.
fn shifted(model: &Model, state: &[f64]) -> Vec<f64> {
    let n = model.base.len();
    let mut values: BTreeMap<SymbolId, f64> =
        model.params.iter().map(|p| (p.symbol, rational_to_f64(&p.default))).collect();
    values.extend(model.base.iter().zip(state).map(|(c, x)| (c.symbol, *x)));
    let connection = model.connection.as_ref().expect("the model has a connection");
    let mut result = state.to_vec();
    for (a, row) in connection.iter().enumerate() {
        for (i, e) in row.iter().enumerate() {
            let coefficient = model.graph.eval_f64(*e, &values).expect("A depends on x and parameters");
            result[2 * n + a] += coefficient * state[n + i];
        }
    }
    result
}

/// Both runs are accurate to about 1e-12; the shape motion must agree to that, with room for the conversion.
const CLOSE: f64 = 1e-10;

/// A rigid body with one hinged arm: three unequal moments of inertia, so its momentum map is not abelian.
const ONE_ARM: &str = "model one_arm {
    param m = 0.4;
    coordinate alpha in angle;
    velocity Omega in so(3);
    let r = [3/5 + cos(alpha)/2, sin(alpha)/2, 0];
    let v = cross(Omega, r) + alpha_dot*[-sin(alpha)/2, cos(alpha)/2, 0];
    lagrangian = (1.2*Omega1^2 + 1.5*Omega2^2 + 1.8*Omega3^2)/2 + m/2*dot(v, v) - alpha^2/5;
}";

#[test]
fn the_mechanical_connection_of_a_satellite_decouples_the_metric_and_keeps_the_motion() {
    let trivial = spec::parse("one_arm.hamel", ONE_ARM).unwrap_or_else(|e| panic!("{e}"));
    let mechanical = rewritten(&trivial, ConnectionKind::Mechanical);
    let mut g: Graph = mechanical.graph.clone();
    let mut coupled_before = false;
    for c in &mechanical.base {
        for v in &mechanical.velocities {
            let mixed = |g: &mut Graph, l| {
                let p = g.diff(l, c.velocity);
                g.diff(p, v.symbol)
            };
            let after = mixed(&mut g, mechanical.lagrangian);
            assert!(g.is_zero(after), "{} and {} are coupled", c.velocity_name, v.name);
            let before = mixed(&mut g, trivial.lagrangian);
            coupled_before |= !g.is_zero(before);
        }
    }
    assert!(coupled_before, "the trivial connection couples shape and group");
    let initial = [0.3, 0.5, 0.6, -0.8, 1.1];
    let converted = shifted(&mechanical, &initial);
    assert!(converted.iter().zip(&initial).any(|(a, b)| (a - b).abs() > 1e-2), "the coordinates differ");
    let (one, other) = (flow(&trivial, &initial, 3.0), flow(&mechanical, &converted, 3.0));
    let one = shifted(&mechanical, &one);
    for (a, b) in one.iter().zip(&other) {
        assert!((a - b).abs() < CLOSE, "{one:?} {other:?}");
    }
}

#[test]
fn a_given_connection_can_be_made_trivial() {
    let given = model("wong_particle");
    let trivial = rewritten(&given, ConnectionKind::Trivial);
    assert!(given.connection.is_some() && trivial.connection.is_none());
    let xi = [1.0, 0.2, -0.3, 0.1, 0.9, 0.4, 0.5, -0.6, 0.8];
    let v = shifted(&given, &xi);
    let (one, other) = (flow(&trivial, &xi, 2.0), flow(&given, &v, 2.0));
    for (a, b) in shifted(&given, &one).iter().zip(&other) {
        assert!((a - b).abs() < CLOSE, "{one:?} {other:?}");
    }
    let mechanical = rewritten(&trivial, ConnectionKind::Mechanical);
    let mut g = mechanical.graph.clone();
    let given = given.connection.unwrap();
    let again = mechanical.connection.expect("the metric couples them");
    for (row, expected) in again.iter().zip(&given) {
        for (e, f) in row.iter().zip(expected) {
            assert!(g.is_equal(*e, *f), "the connection of Wong's Lagrangian is its mechanical one");
        }
    }
}

#[test]
fn the_nonholonomic_connection_of_the_rolling_ball_leaves_only_spin_vertical() {
    let ball = rewritten(&model("rolling_ball"), ConnectionKind::Nonholonomic);
    let system = reduced(&ball).unwrap_or_else(|e| panic!("{e}"));
    let KinematicConstraint::Solved(solved) = &system.constraint else {
        panic!("linear constraints are solved")
    };
    // v1 = v2 = 0: the constraint has become v in span(E3), whatever the base velocities are.
    for k in [2, 3] {
        assert!(solved.dependent.contains(&k));
        assert!(solved.psi[k].iter().all(|e| *e == system.graph.zero()), "v{} vanishes", k - 1);
    }
    let connection = ball.connection.as_ref().expect("rolling is a connection");
    assert!(connection.iter().flatten().any(|e| *e != ball.graph.zero()));
    let equations = derive(&system).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(equations.facts.constants, ["a1_dot", "a2_dot", "xi3"]);
}

#[test]
fn a_model_can_ask_for_its_mechanical_connection() {
    let text = "model bead {
        coordinate x in real;
        velocity omega in R;
        lagrangian = x_dot^2/2 + (2 + x^2)*omega^2/2 + x*omega*x_dot/2;
        connection mechanical;
    }";
    let model = spec::parse("bead.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(model.derived_connection, Some(ConnectionKind::Mechanical));
    let system = reduced(&model).unwrap_or_else(|e| panic!("{e}"));
    // The horizontal lift d_x - A is orthogonal to the group.
    let mut g = system.graph.clone();
    let lift: Vec<ExprId> = system.frame.iter().flat_map(|f| &f.inverse).map(|row| row[0]).collect();
    let p = g.diff(system.lagrangian, system.velocities[1]);
    let slopes: Vec<ExprId> = system.velocities.iter().map(|y| g.diff(p, *y)).collect();
    let mixed = g.dot(&slopes, &lift);
    assert_ne!(slopes[0], g.zero());
    assert!(g.is_zero(mixed));
    assert!(derive(&system).unwrap_or_else(|e| panic!("{e}")).facts.energy_is_conserved);
}

/// A particle over a plane with one more velocity, and what is added to its kinetic energy; `items` come last.
fn particle(added: &str, items: &str) -> String {
    format!(
        "model particle {{
            coordinate x, y in real;
            velocity w in R;
            lagrangian = (x_dot^2 + y_dot^2 + w^2)/2{added};
            {items}
        }}"
    )
}

fn parsed(text: &str) -> Model {
    spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"))
}

/// `x(1)` of a particle from `x = 0, y = 0.5, y_dot = 0.7` and the velocities given, `xi` for the one of the group.
fn x_at_one(text: &str, x_dot: f64, xi: f64) -> f64 {
    let model = parsed(text);
    let start = [("x", 0.0), ("y", 0.5), ("x_dot", x_dot), ("y_dot", 0.7)];
    let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    // At t = 0: v = xi + A xdot.
    let connection = match model.derived_connection {
        Some(kind) => rewritten(&model, kind).connection,
        None => model.connection.clone(),
    };
    let mut values: BTreeMap<SymbolId, f64> = BTreeMap::from([(model.time, 0.0)]);
    for c in &model.base {
        values.insert(c.symbol, start.iter().find(|(name, _)| *name == c.name).expect("a coordinate").1);
    }
    let graph = match model.derived_connection {
        Some(kind) => rewritten(&model, kind).graph,
        None => model.graph.clone(),
    };
    let lift = connection.map_or(0.0, |a| {
        let at = |e| graph.eval_f64(e, &values).expect("A depends on x, y and t");
        at(a[0][0]) * x_dot + at(a[0][1]) * 0.7
    });
    let initial: Vec<f64> = (built.state_names().iter())
        .map(|name| start.iter().find(|(n, _)| n == name).map_or(xi + lift, |(_, value)| *value))
        .collect();
    flow(&model, &initial, 1.0)[0]
}

const ALL_KINDS: [&str; 4] =
    ["", "connection trivial;", "connection mechanical;", "connection nonholonomic;"];

#[test]
fn a_connection_that_moves_with_time_does_not_change_the_motion() {
    // Without the drift of the frame, this ended at -0.104.
    let text = |item| particle(" + sin(t)*y*x_dot*w/2 + cos(t)*x_dot*w/3", item);
    for item in ALL_KINDS.into_iter().chain(["connection w = (1 + x)*sin(t)*x_dot + t^2*x*y_dot;"]) {
        let text = match item.split_once("connection w = ") {
            Some((_, lift)) => text(item).replace("*w", &format!("*(w - ({}))", lift.trim_end_matches(';'))),
            None => text(item),
        };
        let text = match item.contains("connection w") {
            true => text.replace("w^2", "(w - ((1 + x)*sin(t)*x_dot + t^2*x*y_dot))^2"),
            false => text,
        };
        let end = x_at_one(&text, 0.0, 1.2);
        assert!((end + 0.298_012).abs() < 1e-6, "{end} in {text}");
    }
}

#[test]
fn a_constraint_that_moves_with_time_does_not_change_the_motion_of_its_connection() {
    // Without the drift of the frame, this ended at 0.2448.
    for item in ALL_KINDS {
        let end = x_at_one(&particle("", &format!("constraint w = t*y*x_dot; {item}")), 0.3, 0.0);
        assert!((end - 0.264_888).abs() < 1e-6, "{end} with {item}");
    }
}

#[test]
fn a_derived_connection_does_not_depend_on_velocities() {
    let quartic = " + y*x_dot*w/2 + (w^2 + x_dot^2 + y_dot^2)^2/8";
    let end = x_at_one(&particle(quartic, ""), 0.0, 1.2);
    assert!((end + 0.108_357).abs() < 1e-6, "{end}");
    let refused = |added: &str, items: &str| {
        let text = particle(added, items);
        let model = parsed(&text);
        let problems = reduced(&model).expect_err("a connection of velocities");
        let spans: Vec<_> = problems.iter().map(|p| p.span).collect();
        assert_eq!(spans, [model.places.connection], "at the item\n{problems}");
        assert!(model.places.connection.is_some());
        problems.to_string()
    };
    for kind in ["mechanical", "nonholonomic"] {
        let said = refused(quartic, &format!("connection {kind};"));
        assert!(said.contains(&format!("connection {kind} depends on the velocity x_dot")), "{said}");
        assert!(said.contains("connection w = ..;"), "{said}");
    }
    // Through what displacements are: given so, or by Chetaev's rule.
    for conditions in [
        "constraint w = y*x_dot; virtual delta(w) = w*delta(x_dot);",
        "constraint x_dot^2 + w^2*(2 + y) = 3;",
        "constraint w*ddt(w) + x_dot*ddt(x_dot) = 0;",
    ] {
        let said = refused("", &format!("{conditions} connection nonholonomic;"));
        assert!(said.contains("connection nonholonomic depends on the velocity"), "{said}");
        assert!(said.contains("through the virtual displacements"), "{said}");
    }
    // A Lagrangian that is not quadratic in velocities that do not matter has one.
    for (added, kind) in [(" + x*x_dot*w/2 + y_dot^4", "mechanical"), (" + exp(x_dot)", "nonholonomic")] {
        reduced(&parsed(&particle(added, &format!("connection {kind};")))).unwrap_or_else(|e| panic!("{e}"));
    }
}

#[test]
fn a_derived_connection_does_not_depend_on_advected_parameters() {
    let text = |items: &str| {
        format!(
            "model m {{
                coordinate x in real;
                velocity O in so(3);
                advected G in R^3 by cross(O, G);
                lagrangian = dot(O, O)/2 + x_dot^2/2 + {items}
            }}"
        )
    };
    for (items, through) in [
        ("x_dot*dot(O, G)/3; connection mechanical;", "the kinetic energy"),
        ("x_dot*O1/3; constraint dot(O, G) = x_dot; connection nonholonomic;", "the virtual displacements"),
    ] {
        let model = parsed(&text(items));
        let problems = reduced(&model).expect_err("a connection of advected parameters");
        let spans: Vec<_> = problems.iter().map(|p| p.span).collect();
        assert_eq!(spans, [model.places.connection], "{problems}");
        let said = problems.to_string();
        assert!(said.contains("depends on the advected parameter G1") && said.contains(through), "{said}");
        assert!(!said.contains("commutator"), "{said}");
    }
    // The potential may depend on them.
    reduced(&parsed(&text("x_dot*O1/3 - G3; connection mechanical;"))).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn a_nonholonomic_connection_is_made_of_virtual_displacements_alone() {
    // The constraint on velocities, linear, affine, of second order or nonlinear, plays no part in it.
    for constraint in [
        "constraint v2 = (1 + x)*x_dot + omega;",
        "constraint v2 = (1 + x)*x_dot + 2;",
        "constraint ddt(v2) + x*ddt(omega) = v1*v2;",
        "constraint v2*omega = (2 + x)*x_dot;",
        "constraint v2 = x*x_dot; multipliers;",
    ] {
        let text = format!(
            "model m {{
                coordinate x in real;
                velocity omega, v in se(2);
                lagrangian = x_dot^2/2 + 2*omega^2 + dot(v, v) + x_dot*(omega + v1)/2 + x*omega*v1/3;
                {constraint}
                virtual delta(v2) = 3*delta(x_dot) + sin(x)*delta(v1) + t*delta(omega);
            }}"
        );
        let mut model = rewritten(&parsed(&text), ConnectionKind::Nonholonomic);
        let lift = model.connection.clone().expect("displacements move the fibre");
        let g = &mut model.graph;
        let frame: Vec<SymbolId> =
            [model.base[0].velocity].into_iter().chain(model.velocities.iter().map(|v| v.symbol)).collect();
        let forms: Vec<_> = model.virtual_constraints.iter().map(|v| v.one_form.clone()).collect();
        assert!(forms.iter().all(|form| g.is_zero(form[0])), "D_x is a displacement in {text}");
        // Vertical displacements: a basis of the kernel of the form (., -t, -sin x, 1).
        let (one, zero) = (g.one(), g.zero());
        for s in [[one, zero, g.neg(forms[0][1])], [zero, one, g.neg(forms[0][2])]] {
            let mut terms = Vec::new();
            for (k, part) in s.iter().enumerate() {
                let momentum = g.diff(model.lagrangian, frame[1 + k]);
                let mixed = g.diff(momentum, frame[0]);
                terms.push(g.mul(*part, mixed));
            }
            let product = g.sum(&terms);
            assert!(g.is_zero(product), "D_x is orthogonal to them in {text}");
        }
        assert!(lift.iter().flatten().any(|e| !g.is_zero(*e)));
    }
}

#[test]
fn a_derived_connection_has_a_value_wherever_its_metric_is_definite() {
    // An entry beside the diagonal, or a coefficient of a form, vanishes at x = 0, and is not divided by.
    let mass = "lagrangian = x_dot^2 + (2 + x^2)*v1^2/2 + sin(x)*v1*v2 + v2^2 + x_dot*v1 + x_dot*v2/2;";
    let turning = "constraint sin(x)*v1 + cos(x)*v2 = x_dot;";
    for items in [
        format!("{mass} connection mechanical;"),
        format!("{mass} {turning} connection nonholonomic;"),
        format!("{mass} {turning} constraint v1*cos(x) - v2*sin(x) = x*x_dot; connection nonholonomic;"),
    ] {
        let text = format!("model m {{ coordinate x in real; velocity v in R^2; {items} }}");
        let model = parsed(&text);
        let model = rewritten(&model, model.derived_connection.expect("it is asked for"));
        for x in [0.0, std::f64::consts::FRAC_PI_2] {
            let values = BTreeMap::from([(model.base[0].symbol, x)]);
            for e in model.connection.clone().expect("the metric couples them").iter().flatten() {
                let value = model.graph.eval_f64(*e, &values);
                assert!(value.is_some_and(f64::is_finite), "{value:?} at x = {x} in {text}");
            }
        }
    }
}

#[test]
fn connections_that_do_not_exist_are_refused_with_the_reason() {
    let servo = with_connection(&model("servo_ball"), ConnectionKind::Nonholonomic).unwrap_err();
    assert!(servo.to_string().contains("a2_dot through the virtual displacements"), "{servo}");
    let text = "model free { coordinate x in real; velocity w in R; lagrangian = x_dot^2/2; connection mechanical; }";
    let massless = spec::parse("free.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let refused = reduced(&massless).unwrap_err();
    assert!(refused.to_string().contains("no inertia along w"), "{refused}");
}

/// `G x = b` by elimination with the largest pivot.
fn solved<const N: usize>(mut rows: [[f64; N]; N], mut b: [f64; N]) -> [f64; N] {
    for k in 0..N {
        let best = (k..N).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs())).unwrap();
        rows.swap(k, best);
        b.swap(k, best);
        for i in 0..N {
            let factor = if i == k { 0.0 } else { rows[i][k] / rows[k][k] };
            let pivot = rows[k];
            rows[i].iter_mut().zip(pivot).for_each(|(x, p)| *x -= factor * p);
            b[i] -= factor * b[k];
        }
    }
    std::array::from_fn(|k| b[k] / rows[k][k])
}

/// A constraint on base velocities alone, `y' = x x'`, leaves horizontal virtual displacements over one direction. The
/// connection has in addition the vectors that are orthogonal to virtual displacements and to vertical vectors, `G^-1
/// beta` for the form `beta = dy - x dx`, in the metric `G` of the kinetic energy.
#[test]
fn a_nonholonomic_connection_has_the_complement_of_displacements_and_orbits() {
    let text = |item: &str| {
        format!(
            "model complement {{
                coordinate x, y in real;
                velocity u, v in R^2;
                lagrangian = (2*x_dot^2 + 3*y_dot^2 + u^2 + 2*v^2)/2 + x_dot*u/2 + y_dot*v/3 + u*v/4 + x_dot*y_dot/5;
                constraint y_dot = x*x_dot;
                constraint u = y*x_dot;
                {item}
            }}"
        )
    };
    // The same constraints by combinations, which restrict base velocities together.
    let mixed = |item: &str| {
        let text =
            text(item).replace("constraint y_dot = x*x_dot;", "constraint y_dot + u = x*x_dot + y*x_dot;");
        text.replace("constraint u = y*x_dot;", "constraint 2*u + x*y_dot = 2*y*x_dot + x^2*x_dot;")
    };
    let [plain, other] =
        [text(""), mixed("")].map(|text| rewritten(&parsed(&text), ConnectionKind::Nonholonomic));
    for values in [[0.3, -0.7], [-1.1, 0.4]] {
        let at = |model: &Model| -> Vec<f64> {
            let values = model.base.iter().map(|c| c.symbol).zip(values).collect();
            let entries = model.connection.as_ref().expect("a connection").iter().flatten();
            entries.map(|e| model.graph.eval_f64(*e, &values).expect("A depends on x and y")).collect()
        };
        assert!(at(&plain).iter().zip(at(&other)).all(|(a, b)| (a - b).abs() < 1e-13), "{values:?}");
    }
    let model = rewritten(&parsed(&text("")), ConnectionKind::Nonholonomic);
    let connection = model.connection.as_ref().expect("a connection");
    let metric = [
        [2.0, 0.2, 0.5, 0.0],
        [0.2, 3.0, 0.0, 1.0 / 3.0],
        [0.5, 0.0, 1.0, 0.25],
        [0.0, 1.0 / 3.0, 0.25, 2.0],
    ];
    for (x, y) in [(0.3, -0.7), (-1.1, 0.4)] {
        let values = BTreeMap::from([(model.base[0].symbol, x), (model.base[1].symbol, y)]);
        let at = |e: ExprId| model.graph.eval_f64(e, &values).expect("A depends on x and y");
        // Horizontal vectors have v = xi + A x' = 0.
        let lift = |base: [f64; 2]| {
            [0, 1].map(|a| -(at(connection[a][0]) * base[0] + at(connection[a][1]) * base[1]))
        };
        let across = solved(metric, [-x, 1.0, 0.0, 0.0]);
        let found = lift([across[0], across[1]]);
        assert!((found[0] - across[2]).abs() < 1e-14 && (found[1] - across[3]).abs() < 1e-14, "{found:?}");
        // Over the other direction: a virtual displacement, orthogonal to the vertical one, along v.
        let along = lift([1.0, x]);
        let product = metric[3][0] + metric[3][1] * x + metric[3][2] * along[0] + metric[3][3] * along[1];
        assert!((along[0] - y).abs() < 1e-14 && product.abs() < 1e-14, "{along:?}");
    }
    // Other velocities, one motion.
    let ends = ALL_KINDS.map(|item| {
        let model = parsed(&text(item));
        let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{item}: {e}"));
        let mut initial = vec![0.0; built.state_names().len()];
        for (name, value) in [("x", 0.3), ("y", -0.2), ("x_dot", 0.8)] {
            initial[built.state_names().iter().position(|own| own == name).unwrap()] = value;
        }
        // The velocity along the free vertical direction, `v = xi_v + A x'`, starts at the same motion.
        if let Some(k) = built.state_names().iter().position(|own| own == "v") {
            let kind = model.derived_connection.filter(|kind| *kind != ConnectionKind::Trivial);
            initial[k] = kind.map_or(0.5, |kind| {
                let model = rewritten(&model, kind);
                let values = BTreeMap::from([(model.base[0].symbol, 0.3), (model.base[1].symbol, -0.2)]);
                let row = &model.connection.as_ref().unwrap()[1];
                let at = |e: ExprId| model.graph.eval_f64(e, &values).unwrap();
                0.5 + at(row[0]) * 0.8 + at(row[1]) * 0.3 * 0.8
            });
        }
        let end = flow(&model, &initial, 1.0);
        [0, 1].map(|k| end[k])
    });
    for (item, end) in ALL_KINDS.iter().zip(&ends) {
        assert!((0..2).all(|k| (end[k] - ends[0][k]).abs() < CLOSE), "{item}: {end:?} {:?}", ends[0]);
    }
}
