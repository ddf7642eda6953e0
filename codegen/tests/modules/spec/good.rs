//! What is legal, and what it means.

use num_traits::Zero;

use super::SPECS;
use hamel_codegen::spec::{
    CarriedBy, Compare, Domain, InnerProduct, Layout, Model, ModelBuilder, Relation, Side, Value, Wanted,
    diagnose, parse,
};
use hamel_expr::{ExprId, Graph, Rational, Style, parse_decimal};
use hamel_lang::algebra::LieAlgebra;

#[track_caller]
fn model(items: &str) -> Model {
    match parse("good.hamel", &format!("model m {{ {items} }}")) {
        Ok(model) => model,
        Err(problems) => panic!("{problems}"),
    }
}

fn q(text: &str) -> Rational {
    match text.strip_prefix('-') {
        Some(rest) => -parse_decimal(rest).unwrap(),
        None => parse_decimal(text).unwrap(),
    }
}

/// The value of an expression without names.
#[track_caller]
fn constant(text: &str) -> Rational {
    let model = model(&format!("velocity x in R; lagrangian = x^2; output y = {text};"));
    let e = model.outputs[0].components[0].1;
    model.graph.as_rational(e).expect("a rational number").clone()
}

/// Whether two expressions over `Omega`, `Gamma` and `a` agree.
#[track_caller]
fn assert_same(left: &str, right: &str) {
    let mut model = model(&format!(
        "param a = 2; velocity Omega in so(3); lagrangian = dot(Omega, Omega); \
         advected Gamma in R^3 by cross(Omega, Gamma); output l = {left}; output r = {right};"
    ));
    let pairs: Vec<(ExprId, ExprId)> = {
        let [l, r] = &model.outputs[..] else { panic!("two outputs") };
        assert_eq!(l.components.len(), r.components.len(), "shapes of {left} and {right}");
        l.components.iter().zip(&r.components).map(|(l, r)| (l.1, r.1)).collect()
    };
    for (l, r) in pairs {
        assert!(model.graph.is_equal(l, r), "{left} differs from {right}");
    }
}

#[test]
fn all_specs_parse() {
    for (name, text) in SPECS {
        match parse(&format!("{name}.hamel"), text) {
            Ok(model) => {
                assert_eq!(model.name, *name);
                assert!(!model.doc.is_empty() && !model.sources.is_empty(), "{name} lacks documentation");
                assert!(
                    model.params.iter().all(|p| !p.doc.is_empty()),
                    "{name} has an undocumented parameter"
                );
            }
            Err(problems) => panic!("{problems}"),
        }
    }
}

/// Names, order and defaults of the parameters are those of the reference data.
#[test]
fn specs_agree_with_the_catalogue() {
    let expected: &[(&str, &str, &str)] = &[
        ("free_rigid_body", "I1=2.0 I2=1.5 I3=0.8", "Omega1 Omega2 Omega3"),
        (
            "heavy_top",
            "I1=1.3 I2=1.7 I3=0.6 m=1.1 g=9.81 l=0.35 chi1=0 chi2=0.6 chi3=0.8",
            "Omega1 Omega2 Omega3 Gamma1 Gamma2 Gamma3",
        ),
        (
            "kirchhoff_body",
            "J1=1.2 J2=1.5 J3=0.9 M1=2.0 M2=2.6 M3=1.7 C11=0.1 C12=-0.05 C13=0.02 C21=0.03 C22=0.08 C23=-0.04 C31=-0.06 \
             C32=0.05 C33=0.12",
            "Omega1 Omega2 Omega3 V1 V2 V3",
        ),
        ("suslov", "I11=2.0 I12=0.1 I13=0.3 I22=1.5 I23=-0.2 I33=1.0", "Omega1 Omega2 Omega3"),
        ("chaplygin_sleigh", "J=1.2 m=2.0 a=0.4 b=0.3", "omega v1 v2"),
        (
            "chaplygin_ball",
            "I1=1.0 I2=1.3 I3=1.6 m=1.5 r=0.8 l=0.2 chi1=0.48 chi2=0.6 chi3=0.64 g=9.81",
            "Omega1 Omega2 Omega3 X1 X2 X3 Gamma1 Gamma2 Gamma3",
        ),
        (
            "euler_disk_advected",
            "I1=0.07 I3=0.125 m=1 r=0.5 g=9.81",
            "Omega1 Omega2 Omega3 X1 X2 X3 Gamma1 Gamma2 Gamma3",
        ),
        (
            "veselova",
            "I1=1.1 I2=1.4 I3=0.7 k=0.9 chi1=0.36 chi2=0.48 chi3=0.8",
            "Omega1 Omega2 Omega3 gamma1 gamma2 gamma3",
        ),
    ];
    for (name, params, variables) in expected {
        let text = SPECS.iter().find(|(n, _)| n == name).unwrap().1;
        let model = parse(name, text).unwrap();
        let wanted: Vec<(String, Rational)> = params
            .split_whitespace()
            .map(|p| {
                let (name, value) = p.split_once('=').unwrap();
                (name.to_owned(), q(value))
            })
            .collect();
        let found: Vec<(String, Rational)> =
            model.params.iter().map(|p| (p.name.clone(), p.default.clone())).collect();
        assert_eq!(found, wanted, "{name}");
        let mut names: Vec<&str> = model.velocities.iter().map(|v| v.name.as_str()).collect();
        names.extend(model.advected.iter().flat_map(|a| a.components.iter().map(|c| c.0.as_str())));
        assert_eq!(names.join(" "), *variables, "{name}");
    }
}

#[test]
fn extended_pose_has_the_metric_of_the_catalogue() {
    let model = parse("extended_pose", SPECS[3].1).unwrap();
    let diagonal = ["2.0", "1.6", "1.2", "1.5", "1.9", "1.1", "1.4", "0.9", "1.7"];
    let mut k = 0;
    for i in 1..=9_usize {
        for j in i..=9 {
            let param = &model.params[k];
            assert_eq!(param.name, format!("G{i}{j}"));
            let value = if i == j {
                q(diagonal[i - 1])
            } else {
                let rounded = (50.0 * ((i + 2 * j) as f64).cos()).round() as i64;
                Rational::new(rounded.into(), 1000.into())
            };
            assert_eq!(param.default, value, "G{i}{j}");
            k += 1;
        }
    }
    assert_eq!(k, model.params.len());
    let stages = model.stages.unwrap();
    assert_eq!(stages.names, ["rotation", "translations", "second_translation"]);
    assert_eq!(stages.ideals.iter().map(Vec::len).collect::<Vec<_>>(), [6, 3]);
}

#[test]
fn builder_and_file_give_one_heavy_top() {
    let file = parse("heavy_top.hamel", SPECS[1].1).unwrap();
    let mut b = ModelBuilder::new("heavy_top");
    let inertia = b.param_array("I", Layout::Diagonal(3), &[q("1.3"), q("1.7"), q("0.6")], "");
    let m = b.param("m", q("1.1"), "");
    let gravity = b.param("g", q("9.81"), "");
    let l = b.param("l", q("0.35"), "");
    let chi = b.param_array("chi", Layout::Vector(3), &[q("0"), q("0.6"), q("0.8")], "");
    let zero = Value::number(b.graph(), q("0"));
    for name in ["I1", "I2", "I3", "m"] {
        let value = b.value(name).unwrap().clone();
        b.condition(&format!("{name} > 0"), &value, Compare::Greater, &zero);
    }
    let omega = b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]).remove(0);
    let momentum = b.momentum("Pi", "Omega", "").unwrap();
    let gamma = b.advected("Gamma", Some(3), "");
    let action = omega.cross(b.graph(), &gamma).unwrap();
    b.advected_action("Gamma", &action);
    let g = b.graph();
    let pi = inertia.mul(g, &omega).unwrap();
    let half = Value::number(g, Rational::new(1.into(), 2.into()));
    let kinetic = omega.dot(g, &pi).unwrap().mul(g, &half).unwrap();
    let weight = m.mul(g, &gravity).unwrap().mul(g, &l).unwrap();
    let potential = gamma.dot(g, &chi).unwrap().mul(g, &weight).unwrap();
    let lagrangian = kinetic.sub(g, &potential).unwrap();
    let (c1, c2) = (gamma.dot(g, &gamma).unwrap(), momentum.dot(g, &gamma).unwrap());
    b.lagrangian(&lagrangian).casimir("C1", &c1, "").casimir("C2", &c2, "");
    b.scene("lagrange", &[("chi1", &[q("0")]), ("chi2", &[q("0")])], &["energy", "momentum"], "");
    let derivatives =
        ["jacobian", "jvp", "vjp", "time_derivative", "sensitivity", "sensitivity_jvp", "sensitivity_vjp"];
    b.scene("derivatives", &[], &[&["energy"], derivatives.as_slice()].concat(), "");
    b.scene("taylor", &[], &["rhs", "energy", "taylor"], "");
    b.scene("invariants", &[], &["rhs", "energy", "invariants"], "");
    let (zero, one, inertia) = ([q("0")], [q("1")], [q("1.3")]);
    let fixed: [(&str, &[Rational]); 5] =
        [("chi1", &zero), ("chi2", &zero), ("chi3", &one), ("I1", &inertia), ("I2", &inertia)];
    b.scene("symmetric", &fixed, &["rhs", "energy"], "");
    b.scene("momenta", &[], &["rhs", "energy", "casimirs"], "").scene_carries("momenta", &["Pi"]);
    let wants = ["rhs", "energy", "casimirs", "invariants", "splitting"];
    b.scene("splitting", &[], &wants, "").scene_carries("splitting", &["Pi"]);
    let built = b.build().unwrap();

    let names = |m: &Model| m.params.iter().map(|p| (p.name.clone(), p.default.clone())).collect::<Vec<_>>();
    assert_eq!(names(&built), names(&file));
    assert_eq!(built.all_velocities().len(), file.all_velocities().len());
    assert_eq!(built.algebra, file.algebra);
    assert_eq!(built.action, file.action);
    let texts =
        |m: &Model| m.conditions.iter().map(|c| (c.text.clone(), c.subject.clone())).collect::<Vec<_>>();
    assert_eq!(texts(&built), texts(&file));
    let scenes = |m: &Model| {
        let parts = |s: &hamel_codegen::spec::Scene| {
            (s.name.clone(), s.fixed.clone(), s.wants.clone(), s.carries.clone())
        };
        m.scenes.iter().map(parts).collect::<Vec<_>>()
    };
    assert_eq!(scenes(&built), scenes(&file));
    // Expressions agree as functions of the named symbols: evaluated at one point, exactly.
    let value = |m: &Model, e: ExprId| {
        let mut g: Graph = m.graph.clone();
        let mut point = std::collections::BTreeMap::new();
        for s in m.graph.free_symbols(e) {
            let weight = m.graph.name(s).bytes().fold(7_i64, |h, b| (h * 31 + i64::from(b)) % 997);
            point.insert(s, g.int(weight + 1));
        }
        let at = g.subs(e, &point).unwrap();
        g.as_rational(at).unwrap().clone()
    };
    assert_eq!(value(&built, built.lagrangian), value(&file, file.lagrangian));
    assert!(!value(&file, file.lagrangian).is_zero());
    for (x, y) in built.casimirs.iter().zip(&file.casimirs) {
        assert_eq!((x.name.as_str(), value(&built, x.expr)), (y.name.as_str(), value(&file, y.expr)));
    }
    for (x, y) in built.advected[0].action.iter().zip(&file.advected[0].action) {
        assert_eq!(value(&built, *x), value(&file, *y));
    }
}

#[test]
fn builder_reports_the_same_problems_without_text() {
    let mut b = ModelBuilder::new("m");
    b.param("a", q("-1"), "");
    b.param("a", q("1"), "");
    let problems = b.build().unwrap_err().to_string();
    assert!(problems.contains("error: `a` is declared twice"), "{problems}");
    assert!(problems.contains("error: model `m` has no velocity"), "{problems}");
    assert!(problems.contains("help: add `lagrangian = ..;`"), "{problems}");
}

#[test]
fn numbers_are_exact() {
    assert_eq!(constant("1e-3"), Rational::new(1.into(), 1000.into()));
    assert_eq!(constant("0.1 + 0.2"), Rational::new(3.into(), 10.into()));
    assert_eq!(constant("1.5e2"), q("150"));
    assert_eq!(constant("1_000"), q("1000"));
}

#[test]
fn precedence_is_that_of_mathematics() {
    assert_eq!(constant("2^3^2"), q("512"));
    assert_eq!(constant("-2^2"), q("-4"));
    assert_eq!(constant("2^-1"), q("0.5"));
    assert_eq!(constant("1 - 2 - 3"), q("-4"));
    assert_eq!(constant("12/2/3"), q("2"));
    assert_eq!(constant("2*-3"), q("-6"));
    assert_eq!(constant("1 + 2*3^2"), q("19"));
    assert_eq!(constant("(1 + 2)*3"), q("9"));
    assert_eq!(constant("4^(1/2)"), q("2"));
    assert_eq!(constant("pow(2, 3)"), q("8"));
}

#[test]
fn vectors_and_matrices() {
    assert_same("dot(Omega, Gamma)", "Omega1*Gamma1 + Omega2*Gamma2 + Omega3*Gamma3");
    assert_same("cross(Omega, Gamma)", "hat(Omega)*Gamma");
    assert_same("cross(Omega, Gamma)[1]", "Omega[2]*Gamma[3] - Omega[3]*Gamma[2]");
    assert_same("norm(Omega)^2", "dot(Omega, Omega)");
    assert_same("transpose(Omega)*hat(Gamma)*Omega", "0*a");
    assert_same("[Omega*2/4, Gamma]", "[1/2*Omega, Gamma]");
    assert_same("transpose(hat(Omega))", "-hat(Omega)");
    assert_same("identity(3)*Omega", "Omega");
    assert_same("diag([a, 1, 1])[1, 1]", "a");
    assert_same("diag(Omega*transpose(Gamma))", "[Omega1*Gamma1, Omega2*Gamma2, Omega3*Gamma3]");
    assert_same("det([[a, 1], [2, 3]])", "3*a - 2");
    assert_same("det(hat(Omega) + a*identity(3))", "a^3 + a*dot(Omega, Omega)");
    assert_same("trace(Omega*transpose(Gamma))", "dot(Omega, Gamma)");
    assert_same("sum(Omega)", "Omega1 + Omega2 + Omega3");
    assert_same("[[1, 2], [3, 4]][2]", "[3, 4]");
    assert_same("sin(a)^2 + cos(a)^2", "1");
    assert_same("sqrt(a)*sqrt(a)", "a");
    assert_same("ln(exp(1*0)) + tan(0) + pi*0", "0");
    assert_same("a^a", "exp(a*ln(a))");
    assert_same("+a", "a");
}

#[test]
fn parameters_of_every_shape() {
    let m = model(
        "param s = 1; param v: vector(2) = [1, 2]; param d: diagonal(2) = [3, 4]; param q: symmetric(2) = [5, 6, 7];
         param c: matrix(2, 3) = [[1, 2, 3], [4, 5, 6]]; param w: matrix(10, 1) = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10];
         velocity x in R; lagrangian = x^2; output y = q*v + d*v;",
    );
    let names: Vec<&str> = m.params.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(
        names.join(" "),
        "s v1 v2 d1 d2 q11 q12 q22 c11 c12 c13 c21 c22 c23 w1_1 w2_1 w3_1 w4_1 w5_1 w6_1 w7_1 w8_1 w9_1 w10_1"
    );
    assert_eq!(m.params[11].default, q("4"));
    let y2 = m.outputs[0].components[1].1;
    assert_eq!(m.outputs[0].components[1].0, "y2");
    assert_eq!(m.graph.free_symbols(y2).len(), 5);
}

#[test]
fn conditions_keep_their_direction() {
    let m = model(
        "param a = 1 where 0 < a <= 2; param b = 3; require a*b != 0, a < b; velocity x in R; lagrangian = x^2;",
    );
    let found: Vec<(&str, Relation, Option<&str>)> =
        m.conditions.iter().map(|c| (c.text.as_str(), c.relation, c.subject.as_deref())).collect();
    assert_eq!(
        found,
        [
            ("0 < a", Relation::Greater, Some("a")),
            ("a <= 2", Relation::GreaterEqual, Some("a")),
            ("a*b != 0", Relation::NotEqual, None),
            ("a < b", Relation::Greater, None),
        ]
    );
    assert_eq!(m.graph.as_rational(m.conditions[1].greater), Some(&q("2")));
}

#[test]
fn definitions_may_come_in_any_order() {
    let m = model("lagrangian = a; let a = b^2; let b = c + 0; let c = x; velocity x in R;");
    assert_eq!(m.graph.free_symbols(m.lagrangian).len(), 1);
}

#[test]
fn algebras() {
    let dim = |items: &str| model(&format!("{items} lagrangian = x1^2;")).algebra.dim();
    assert_eq!(dim("velocity x in so(4);"), 6);
    assert_eq!(dim("algebra g = se(2); velocity x1, v in g;"), 3);
    assert_eq!(dim("velocity x in su(2);"), 3);
    assert_eq!(dim("velocity x in gl(2);"), 4);
    assert_eq!(dim("velocity x in sl(2);"), 3);
    assert_eq!(dim("velocity x in R^5;"), 5);
    assert_eq!(dim("velocity x1, p, z in heisenberg(1);"), 3);
    assert_eq!(dim("velocity x, y in product(so(3), R^2);"), 5);
    assert_eq!(dim("velocity x, y, z, w in semidirect(so(3), dual(standard), trivial(2), coadjoint);"), 11);
    assert_eq!(dim("velocity x1, x2, x3 in so(3);"), 3);
    assert_eq!(dim("velocity x1, v in product(R, R);"), 2);
    let m = model(
        "algebra sl2 { basis h, e, f; [h, e] = 2*e; [h, f] = -2*f; [e, f] = h; } velocity x in sl2; lagrangian = x1^2;",
    );
    assert_eq!(m.algebra.bracket(0, 1), [(1, q("2").into())]);
    let m = model(
        "velocity x, y in semidirect(R, turn); lagrangian = x^2;
         representation turn of R on R^2 { e1 = [[0, -1], [1, 0]]; }",
    );
    assert_eq!(m.algebra.bracket(0, 1), [(2, q("1").into())]);
    assert_eq!(m.velocities[2].name, "y2");
    assert_eq!(m.velocities[2].block, "y");
}

#[test]
fn stages_and_inner_product() {
    let m = model(
        "param k: symmetric(6) = [1,0,0,0,0,0, 1,0,0,0,0, 1,0,0,0, 1,0,0, 1,0, 1]; velocity O, V in se(3);
         lagrangian = dot(O, O); stage rotation; stage translation = ideal(V); stage line = ideal(V1 - 2*V3); inner_product = k;",
    );
    let stages = m.stages.clone().unwrap();
    assert_eq!(stages.names, ["rotation", "translation", "line"]);
    assert_eq!(stages.ideals[0].len(), 3);
    let line: Vec<Rational> = ["0", "0", "0", "1", "0", "-2"].map(q).to_vec();
    let numbers = |v: &Vec<ExprId>| v.iter().map(|e| m.graph.as_rational(*e).unwrap().clone()).collect();
    assert_eq!(stages.ideals[1].iter().map(numbers).collect::<Vec<Vec<Rational>>>(), [line]);
    assert!(matches!(stages.inner_product, Some(InnerProduct::Matrix(rows)) if rows.len() == 6));
}

#[test]
fn coordinates_forces_and_constraints() {
    let m = model(
        "param r = 1; coordinate theta in (0, pi/2); coordinate phi in angle; coordinate x: vector(2) in real;
         velocity omega, v in se(2); action right; lagrangian = theta_dot^2 + dot(x_dot, x_dot) + omega^2 + dot(v, v);
         constraint x_dot = [r*phi_dot*cos(theta), r*phi_dot*sin(theta)]; constraint slip: v2 = t; constraint v1 - omega = 0;
         independent theta_dot, phi_dot, omega; force v = -v; force x_dot = [1, 2]; multipliers;",
    );
    let names: Vec<&str> = m.base.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["theta", "phi", "x1", "x2"]);
    assert_eq!(m.base[3].velocity_name, "x2_dot");
    assert!(matches!(m.base[0].domain, Domain::Interval(..)));
    assert_eq!((m.base[1].domain, m.base[2].domain), (Domain::Angle, Domain::Real));
    assert_eq!(m.action, Side::Right);
    let names: Vec<&str> = m.constraints.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["c1", "c2", "slip", "c3"]);
    assert_eq!(m.constraints[2].text, "v2 = t");
    assert_eq!(m.independent, Some(vec![0, 1, 4]));
    assert!(m.force_multipliers);
    let zero = m.graph.zero();
    let given: Vec<bool> = m.forces.iter().map(|f| *f != zero).collect();
    assert_eq!(given, [false, false, true, true, false, true, true]);
}

#[test]
fn a_model_without_algebra() {
    let m = model("coordinate x in real; lagrangian = x_dot^2/2 - x^2/2;");
    assert_eq!((m.algebra.dim(), m.velocities.len(), m.base.len()), (0, 0, 1));
}

#[test]
fn a_zero_stands_for_a_zero_vector() {
    let m =
        model("velocity v in R^3; lagrangian = dot(v, v); constraint cross(v, [0, 0, 1]) + [0, 0, v3] = 0;");
    assert_eq!(m.constraints.len(), 3);
}

#[test]
fn scenes() {
    let m = model(
        "param chi: vector(2) = [1, 2]; velocity x in R; lagrangian = x^2; output h = [x, x]; casimir c = x;
         scene a { fix chi = [1/2, -1]; want rhs, h, c; } scene b { }",
    );
    assert_eq!(m.scenes[0].fixed, [("chi1".to_owned(), q("0.5")), ("chi2".to_owned(), q("-1"))]);
    let wants: Vec<&str> = m.scenes[0].wants.iter().map(Wanted::name).collect();
    assert_eq!(wants, ["rhs", "h", "c"]);
    assert!(m.scenes[1].fixed.is_empty());
}

#[test]
fn documentation_and_sources_are_kept() {
    let text = "/// Title\n///\n///  formula\nmodel m {\n source \"A\"; source r\"B\"; topic \"T\";\n/// one\n/// two\nparam a = 1;\n velocity x in R; lagrangian = a*x^2; }";
    let m = parse("m.hamel", text).unwrap();
    assert_eq!(m.doc, ["Title", "", " formula"]);
    assert_eq!(m.sources, ["A", "B"]);
    assert_eq!(m.topic.as_deref(), Some("T"));
    assert_eq!(m.params[0].doc, "one\ntwo");
    assert_eq!(m.origin.as_ref().unwrap().text, text);
}

#[test]
fn later_phases_can_point_into_the_text() {
    let m = model("velocity v in R^2; lagrangian = dot(v, v); constraint v2 = 0;");
    let problem = diagnose(&m, m.constraints[0].span, "constraint follows from the others", "remove it");
    let shown = m.diagnostics(vec![problem]).to_string();
    assert!(shown.contains("good.hamel:1:65") && shown.contains("^^^^^^"), "{shown}");
}

#[test]
fn rendering_underlines_and_labels() {
    let text = "model m {\n    velocity Omega in so(3);\n    lagrangian = dot(Omega, Omega) + Omgea1;\n    let s = [1, 2] + Omega;\n}\n";
    let problems = parse("top.hamel", text).unwrap_err();
    let expected = "\
error: unknown name `Omgea1`
 --> top.hamel:3:38
  |
3 |     lagrangian = dot(Omega, Omega) + Omgea1;
  |                                      ^^^^^^
  |
  = help: did you mean `Omega1`?

error: cannot add vector(2) and vector(3)
 --> top.hamel:4:22
  |
4 |     let s = [1, 2] + Omega;
  |             ------   ^^^^^
  |             |        |
  |             |        vector(3)
  |             vector(2)
  |
  = help: both sides must have the same shape
";
    let shown = problems.to_string();
    assert_eq!(shown, expected, "found:\n{shown}");
    assert!(!shown.contains('\u{1b}') && problems.render(true).contains('\u{1b}'));
}

/// Which words the target language takes is no matter of the model language: emission renames what it has to.
#[test]
fn words_of_rust_and_names_of_generated_items_are_names() {
    let text = "model move {
        param type = 1;
        param State: vector(2) = [1, 2];
        param t0 = 3;
        let self = type + t0*State1;
        velocity loop in so(3);
        coordinate in in real;
        lagrangian = self*dot(loop, loop) + where*in_dot^2;
        param where = 4;
        output check = loop[1];
        scene fn { fix type = 2; want check; }
    }";
    let model = parse("move.hamel", text).unwrap_or_else(|problems| panic!("{problems}"));
    let names: Vec<&str> = model.params.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["type", "State1", "State2", "t0", "where"]);
    assert_eq!(model.velocities[0].name, "loop1");
    assert_eq!((model.name.as_str(), model.scenes[0].name.as_str()), ("move", "fn"));
}

#[test]
fn stages_with_parameters_the_metric_of_the_lagrangian_connections_and_their_velocities_as_state() {
    let m = model(
        "param k = 2; coordinate x in real; velocity O, V in se(3); lagrangian = x_dot^2 + dot(O, O) + dot(V, V);
         stage rotation { connection O = [x_dot, 0, k*x*x_dot]; }
         stage translation = ideal(V) { connection V1 = x*x_dot; }
         stage line = ideal(V1 + k*V3); inner_product = lagrangian; carry stages;
         scene own { carry O, V; }",
    );
    let stages = m.stages.as_ref().unwrap();
    assert_eq!(stages.inner_product, Some(InnerProduct::Lagrangian));
    let shown = |e: ExprId| m.graph.display(e, Style::Plain);
    let line: Vec<String> = stages.ideals[1][0].iter().map(|e| shown(*e)).collect();
    assert_eq!(line, ["0", "0", "0", "1", "0", "k"]);
    let connection: Vec<String> = stages.connection.iter().flatten().map(|row| shown(row[0])).collect();
    assert_eq!(connection, ["1", "0", "k*x", "x", "0", "0"]);
    assert!(m.carries.iter().all(|c| matches!(c.by, CarriedBy::Levels(_))));
    assert_eq!(m.carries.len(), 6);
    assert!(m.scenes[0].carries.iter().all(|c| c.by == CarriedBy::Velocity));
}
