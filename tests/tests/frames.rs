//! Frames of quasi-velocities, and algebroids of the user's own: the motion of the coordinates is that of the model
//! without them, exactly, at random rational points of random systems.

use std::collections::BTreeMap;

use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_expr::{ExprId, Graph, Rational, Style, inlined};
use hamel_lang::algebra::LieAlgebra;
use hamel_mechanics::mechanics::{Equations, connection_coefficients};
use hamel_tests::algebras::{FAMILIES, Transported};
use hamel_tests::bundle::{Bundle, Polynomial};
use hamel_tests::draws::{Draws, for_all, one};
use hamel_tests::linear::{dot, int, rank};
use hamel_tests::models::{close, follow, times};
use hamel_tests::problem::{Evaluation, derived, equations_of};
use hamel_tests::stages::with_items;

const NUMBERS: usize = 2400;

/// Numbers by name.
type Values = BTreeMap<String, Rational>;

/// Everything that equations say at a point, by name.
fn said(equations: &Equations, at: &Values) -> Option<Values> {
    let mut point = Evaluation::new(equations, |name| at.get(name).cloned())?;
    let mut found = Values::new();
    for s in &equations.state {
        found.insert(format!("dot {}", s.name), point.value(s.derivative)?);
    }
    found.insert("energy".into(), point.value(equations.energy)?);
    found.insert("energy rate".into(), point.value(equations.energy_rate)?);
    for output in equations.outputs.iter().filter(|o| o.name == "multipliers" || o.name == "seen") {
        for (name, e) in &output.components {
            found.insert(name.clone(), point.value(*e)?);
        }
    }
    Some(found)
}

/// A coefficient of a frame, a polynomial on the base that grows with time.
struct Coefficient(Polynomial, Rational);

impl Coefficient {
    fn text(&self) -> String {
        format!("({} + {}*t)", self.0.text(), self.1)
    }

    fn at(&self, x: &[Rational], t: &Rational) -> Rational {
        self.0.at(x) + &self.1 * t
    }

    fn rate(&self, x: &[Rational], x_dot: &[Rational]) -> Rational {
        dot(&self.0.slopes(x), x_dot) + &self.1
    }
}

/// A random frame of as many quasi-velocities `q1`, `q2`, .. as there are velocities in it.
struct RandomFrame {
    velocities: Vec<String>,
    rows: Vec<Vec<Coefficient>>,
}

impl RandomFrame {
    fn new(velocities: &[&str], draws: &mut Draws) -> RandomFrame {
        let n = velocities.len();
        let mut entry = || {
            let t = draws.rational();
            Coefficient(Polynomial::random(draws), t)
        };
        let rows = (0..n).map(|_| (0..n).map(|_| entry()).collect()).collect();
        RandomFrame { velocities: velocities.iter().map(|v| (*v).to_owned()).collect(), rows }
    }

    fn text(&self) -> String {
        let rows = self.rows.iter().enumerate().map(|(k, row)| {
            let terms: Vec<String> =
                row.iter().zip(&self.velocities).map(|(c, v)| format!("{}*{v}", c.text())).collect();
            format!("q{} = {};", k + 1, terms.join(" + "))
        });
        format!("frame {{ {} }}", rows.collect::<Vec<_>>().join(" "))
    }

    fn matrix(&self, x: &[Rational], t: &Rational) -> Vec<Vec<Rational>> {
        self.rows.iter().map(|row| row.iter().map(|c| c.at(x, t)).collect()).collect()
    }

    /// Quasi-velocities, and their rates by those of the velocities.
    fn values(&self, at: &Values, rates: &Values, x: &[Rational], x_dot: &[Rational]) -> (Values, Values) {
        let y: Vec<Rational> = self.velocities.iter().map(|v| at[v].clone()).collect();
        let y_dot: Vec<Rational> =
            self.velocities.iter().map(|v| rates[&format!("dot {v}")].clone()).collect();
        let (mut values, mut moved) = (Values::new(), Values::new());
        for (k, (row, of_rates)) in self.matrix(x, &at["t"]).iter().zip(&self.rows).enumerate() {
            let turning: Vec<Rational> = of_rates.iter().map(|c| c.rate(x, x_dot)).collect();
            values.insert(format!("q{}", k + 1), dot(row, &y));
            moved.insert(format!("dot q{}", k + 1), dot(row, &y_dot) + dot(&turning, &y));
        }
        (values, moved)
    }
}

/// What is added to both models: forces and an output on velocities that the frame may replace.
const BESIDE: &str = "force x_dot = [x2 - x1_dot/3, 2*x2_dot]; force v1 = x1*v2 - v1/2;
    output seen = [x1_dot*v1, x2_dot + x1, v2];";

fn text_of(bundle: &Bundle) -> String {
    // The constraint is solved for the last velocity, whatever the velocities are called.
    let text = bundle.text(true);
    let kept = text.lines().filter(|line| !line.starts_with("independent"));
    with_items(&kept.collect::<Vec<_>>().join("\n"), BESIDE)
}

/// A random state of a bundle with its connection, by name; `v = xi + A xdot`.
fn state(bundle: &Bundle, draws: &mut Draws) -> (Values, Vec<Rational>, Vec<Rational>) {
    let state = bundle.state(draws);
    let lift = bundle.lift(&state.x, &state.x_dot);
    let mut at = Values::from([("t".to_owned(), draws.non_zero())]);
    for k in 0..2 {
        at.insert(format!("x{}", k + 1), state.x[k].clone());
        at.insert(format!("x{}_dot", k + 1), state.x_dot[k].clone());
    }
    for (k, (xi, a)) in state.xi.iter().zip(lift).enumerate() {
        at.insert(format!("v{}", k + 1), xi + a);
    }
    for (k, a) in state.a.iter().enumerate() {
        at.insert(if state.a.len() == 1 { "a".into() } else { format!("a{}", k + 1) }, a.clone());
    }
    (at, state.x, state.x_dot)
}

fn random_bundle(family: usize, right: bool, draws: &mut Draws) -> Bundle {
    let algebra = Transported::new(&FAMILIES[family](draws), draws).algebra;
    Bundle::random(&algebra, right, draws)
}

/// Holds a bundle in a frame to the bundle without; whether there was something to compare.
fn compare(bundle: &Bundle, frame: &RandomFrame, draws: &mut Draws) -> bool {
    let (at, x, x_dot) = state(bundle, draws);
    if rank(&frame.matrix(&x, &at["t"])) < frame.rows.len() {
        return false;
    }
    let text = text_of(bundle);
    let framed = with_items(&text, &frame.text());
    let (plain, framed_equations) = match (equations_of(&text), equations_of(&framed)) {
        (Ok(plain), Ok(framed)) => (plain, framed),
        // A frame that is singular everywhere.
        (_, Err(e)) if e.to_string().contains("depend on each other") => return false,
        (plain, framed) => panic!("{:?} {:?}\n{framed:?}", plain.err(), framed.as_ref().err()),
    };
    let Some(expected) = said(&plain, &at) else { return false };
    let (values, moved) = frame.values(&at, &expected, &x, &x_dot);
    let mut there = at.clone();
    there.extend(values);
    let Some(found) = said(&framed_equations, &there) else { return false };
    for (name, value) in &found {
        let wanted = moved.get(name).or_else(|| expected.get(name));
        let wanted = wanted.unwrap_or_else(|| panic!("{name} is nothing of\n{framed}"));
        assert_eq!(value, wanted, "{name} of\n{framed}");
    }
    assert!(found.len() >= expected.len(), "{found:?}\n{expected:?}\n{framed}");
    true
}

#[test]
fn random_frames_on_the_base_leave_the_motion_of_random_bundles() {
    for_all("frames of base velocities", 24, NUMBERS, |mut draws| {
        let (family, kind) = (draws.index(6), draws.index(4));
        let mut bundle = random_bundle(family, kind % 2 == 1, &mut draws);
        match kind {
            1 => bundle.constrain(false, &mut draws),
            2 => bundle.constrain(true, &mut draws),
            3 => bundle.advect(&mut draws),
            _ => {}
        }
        let frame = RandomFrame::new(&["x1_dot", "x2_dot"], &mut draws);
        compare(&bundle, &frame, &mut draws);
        Ok(())
    });
}

#[test]
fn frames_may_mix_base_and_group() {
    let mut compared = 0;
    for seed in 0..4 {
        let draws = &mut one(seed, NUMBERS);
        // The algebra of Heisenberg: small, and not abelian.
        let mut bundle = random_bundle(3, seed % 2 == 0, draws);
        match seed % 3 {
            0 => bundle.constrain(seed % 2 == 0, draws),
            1 => bundle.advect(draws),
            _ => {}
        }
        let frame = RandomFrame::new(&["x1_dot", "x2_dot", "v1"], draws);
        compared += usize::from(compare(&bundle, &frame, draws));
    }
    assert!(compared > 1, "{compared}");
}

#[test]
fn polar_coordinates_have_the_frame_of_the_literature() {
    let polar = "model polar { coordinate r in (0, 10); coordinate phi in angle;
        lagrangian = (r_dot^2 + r^2*phi_dot^2)/2 + 1/r; }";
    let framed = "model polar { coordinate r in (0, 10); coordinate phi in angle;
        frame { u = r_dot; v = r*phi_dot; }
        lagrangian = (u^2 + v^2)/2 + 1/r; }";
    let (mut plain, mut framed) = (derived(polar), derived(framed));
    // [e_u, e_v] = -(1/r) e_v.
    let mut g = framed.system.graph.clone();
    let bracket = framed.system.algebroid.bracket(&mut g, 0, 1);
    assert_eq!(bracket.len(), 1);
    assert_eq!(g.display(bracket[0].1, Style::Plain), "-1/r");
    // u' = v^2/r - 1/r^2, v' = -u v/r, as fingerprints see it.
    assert!(framed.facts.energy_is_conserved && plain.facts.energy_is_conserved);
    let inlined = |e: &mut Equations, k: usize| {
        let values = inlined(&mut e.system.graph, e.sections.iter().flat_map(|s| &s.definitions));
        e.system.graph.subs(e.state[k].derivative, &values).expect("no division by zero")
    };
    let (u_dot, v_dot) = (inlined(&mut framed, 2), inlined(&mut framed, 3));
    let symbols = [0, 2, 3].map(|k| framed.state[k].symbol);
    let g = &mut framed.system.graph;
    let [r, u, v] = symbols.map(|s| g.sym(s));
    let of = |g: &mut Graph, num: [ExprId; 2]| {
        let product = g.mul(num[0], num[1]);
        g.div(product, r).expect("r is not zero")
    };
    let centrifugal = of(g, [v, v]);
    let square = g.powi(r, -2);
    let expected = g.sub(centrifugal, square);
    assert!(g.is_equal(u_dot, expected));
    let coriolis = of(g, [u, v]);
    let expected = g.neg(coriolis);
    assert!(g.is_equal(v_dot, expected));
    assert!(inlined(&mut plain, 2) != plain.system.graph.zero());
}

const SLEIGH: &str = "coordinate x, y in real; coordinate theta in angle;";

#[test]
fn a_sleigh_in_its_own_frame_moves_as_in_coordinates() {
    let lagrangian = "lagrangian = (x_dot^2 + y_dot^2)/2 + theta_dot^2 + 0.3*theta_dot*(cos(theta)*y_dot - sin(theta)*x_dot);
        constraint cos(theta)*y_dot - sin(theta)*x_dot = 0;
        force theta_dot = -0.1*theta_dot; force x_dot = 0.05;";
    let frame = "frame {
            /// Speed along the blade [m/s].
            u = cos(theta)*x_dot + sin(theta)*y_dot;
            w = cos(theta)*y_dot - sin(theta)*x_dot;
        }";
    let plain = format!("model sleigh {{ {SLEIGH} {lagrangian} multipliers; }}");
    let framed = format!("model sleigh {{ {SLEIGH} {frame} {lagrangian} output speed = x_dot; }}");
    let framed = spec::parse("sleigh.hamel", &framed).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(derived_names(&framed), ["x", "y", "theta", "u", "theta_dot"]);
    let plain = spec::parse("sleigh.hamel", &plain).unwrap_or_else(|e| panic!("{e}"));
    let plain = scene::build(&plain, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&framed, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let on_the_way = times(4.0, 8);
    let (theta, u) = (0.4_f64, 1.5);
    let initial = [
        ("x", 0.1),
        ("y", 0.2),
        ("theta", theta),
        ("x_dot", u * theta.cos()),
        ("y_dot", u * theta.sin()),
        ("theta_dot", 0.7),
    ];
    let mut expected = Vec::new();
    follow(&plain, &[], &initial, &on_the_way, |at| {
        expected.push([at.get("x"), at.get("y"), at.get("theta"), at.get("theta_dot")]);
    });
    let initial = [("x", 0.1), ("y", 0.2), ("theta", theta), ("u", u), ("theta_dot", 0.7)];
    let mut next = expected.iter();
    follow(&built, &[], &initial, &on_the_way, |at| {
        let found = [at.get("x"), at.get("y"), at.get("theta"), at.get("theta_dot")];
        close("sleigh", &found, next.next().expect("as many states as times"), 1e-10);
    });
}

fn derived_names(model: &spec::Model) -> Vec<String> {
    let built = scene::build(model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    built.equations().state.iter().map(|s| s.name.clone()).collect()
}

#[test]
fn displacements_and_accelerations_of_replaced_velocities_are_those_of_the_frame() {
    let items = "coordinate x1, x2 in real; coordinate x3 in (0, 9);
        lagrangian = (x1_dot^2 + 2*x2_dot^2 + x3_dot^2)/2 + x1*x2_dot - x3^2/2;
        constraint ddt(x1_dot) + x3*ddt(x2_dot) + x1_dot*x2 = 0;
        virtual delta(x1_dot) + x1*delta(x2_dot) + delta(x3_dot) = 0;";
    let frame = "frame { u = x3*x1_dot; v = x1*x1_dot + x2_dot*(1 + x3^2); }";
    let plain = format!("model servo {{ {items} }}");
    let framed = format!("model servo {{ {items} {frame} }}");
    let [x1, x2, x3, a, b, c] = [2, -1, 3, 5, 4, -2].map(int);
    let names = ["x1", "x2", "x3", "x1_dot", "x2_dot", "x3_dot", "t"];
    let point = [&x1, &x2, &x3, &a, &b, &c, &int(0)].map(Clone::clone);
    let at: Values = names.iter().map(|n| (*n).to_owned()).zip(point).collect();
    let expected = said(&derived(&plain), &at).expect("no pivot vanishes");
    let mut there = at.clone();
    let s = int(1) + &x3 * &x3;
    there.insert("u".into(), &x3 * &a);
    there.insert("v".into(), &x1 * &a + &b * &s);
    let found = said(&derived(&framed), &there).expect("no pivot vanishes");
    let (a_dot, b_dot) = (&expected["dot x1_dot"], &expected["dot x2_dot"]);
    assert_eq!(found["dot u"], &c * &a + &x3 * a_dot);
    assert_eq!(found["dot v"], &a * &a + &x1 * a_dot + &s * b_dot + int(2) * &x3 * &c * &b);
    assert_eq!(found["dot x3_dot"], expected["dot x3_dot"]);
    assert_eq!(found["energy"], expected["energy"]);
}

#[test]
fn momenta_along_quasi_velocities_can_be_carried() {
    let items = "coordinate r in (0, 10); coordinate phi in angle; frame { u = r_dot; v = r*phi_dot; }
        momentum p of v; momentum s of u; lagrangian = (2*u^2 + 3*v^2 + u*v)/2 + 1/r;";
    let plain = derived(&format!("model polar {{ {items} }}"));
    let carried = derived(&format!("model polar {{ {items} carry p, s; }}"));
    let at: Values = [("r", 2), ("phi", 1), ("u", 3), ("v", -1), ("t", 0)]
        .iter()
        .map(|(n, k)| ((*n).to_owned(), int(*k)))
        .collect();
    let expected = said(&plain, &at).expect("no pivot vanishes");
    let half = Rational::new(1.into(), 2.into());
    let momenta = |u: &Rational, v: &Rational| (int(2) * u + &half * v, int(3) * v + &half * u);
    let (s, p) = momenta(&at["u"], &at["v"]);
    let mut there = at.clone();
    there.extend([("p".to_owned(), p), ("s".to_owned(), s)]);
    let found = said(&carried, &there).expect("no pivot vanishes");
    let (s_dot, p_dot) = momenta(&expected["dot u"], &expected["dot v"]);
    assert_eq!((&found["dot s"], &found["dot p"]), (&s_dot, &p_dot));
    assert_eq!(found["dot phi"], expected["dot phi"]);
}

/// The algebroid of a model as the text of an algebroid over the same coordinates.
fn algebroid_text(equations: &Equations) -> String {
    let algebroid = &equations.system.algebroid;
    let mut g = equations.system.graph.clone();
    let m = algebroid.rank();
    let e: Vec<String> = (1..=m).map(|k| format!("s{k}")).collect();
    let velocities: Vec<String> =
        (0..m).map(|k| if k < 2 { format!("q{}", k + 1) } else { format!("v{}", k - 1) }).collect();
    let mut text = format!("algebroid {{ basis {}; velocities {};\n", e.join(", "), velocities.join(", "));
    text.push_str("anchor x_dot = [q1, q2];\n");
    for a in 0..m {
        for b in a + 1..m {
            let value = algebroid.bracket(&mut g, a, b);
            if value.is_empty() {
                continue;
            }
            let terms: Vec<String> =
                value.iter().map(|(c, x)| format!("({})*{}", g.display(*x, Style::Plain), e[*c])).collect();
            text.push_str(&format!("[{}, {}] = {};\n", e[a], e[b], terms.join(" + ")));
        }
    }
    text + "}\n"
}

#[test]
fn an_algebroid_by_hand_is_the_one_of_algebra_and_connection() {
    for seed in 0..6 {
        let draws = &mut one(100 + seed, NUMBERS);
        let mut bundle = random_bundle(usize::try_from(seed).unwrap(), seed % 2 == 1, draws);
        if seed % 3 == 1 {
            bundle.constrain(seed % 2 == 0, draws);
        }
        let text = text_of(&bundle).replace("force v1 = x1*v2 - v1/2;", "").replace("x1_dot*v1, ", "");
        let text = text.replace(", v2];", "];");
        let plain = derived(&text);
        let mut own = String::new();
        let mut is_in_algebra = false;
        for line in text.lines() {
            is_in_algebra |= line.starts_with("algebra");
            let left_out = ["velocity", "action", "connection"].iter().any(|word| line.starts_with(word));
            if !is_in_algebra && !left_out {
                own.push_str(line);
                own.push('\n');
            }
            is_in_algebra &= !line.starts_with('}');
        }
        let own = with_items(&own, &algebroid_text(&plain));
        let (mut at, ..) = state(&bundle, draws);
        let Some(expected) = said(&plain, &at) else { continue };
        for k in 1..=2 {
            let rate = at[&format!("x{k}_dot")].clone();
            at.insert(format!("q{k}"), rate);
        }
        let found = said(&derived(&own), &at).expect("the same pivots");
        for (name, value) in &expected {
            let name = ["x1", "x2"].iter().enumerate().fold(name.clone(), |name, (k, x)| {
                if name == format!("dot {x}_dot") { format!("dot q{}", k + 1) } else { name }
            });
            assert_eq!(&found[&name], value, "{name} of\n{own}");
        }
    }
}

#[test]
fn an_action_algebroid_is_an_algebra_with_advected_parameters() {
    let lagrangian = "lagrangian = (a^2 + 2*b^2 + 3*c^2)/2 - z + x*y/3; casimir n = x^2 + y^2 + z^2;";
    let own = format!(
        "model top {{ coordinate x, y, z in real;
            algebroid {{ basis e1, e2, e3; velocities a, b, c;
                anchor x_dot = c*y - b*z; anchor y_dot = a*z - c*x; anchor z_dot = b*x - a*y;
                [e1, e2] = e3; [e2, e3] = e1; [e3, e1] = e2; }}
            {lagrangian} }}"
    );
    let advected = format!(
        "model top {{ velocity a, b, c in so(3); advected x_ in R^3 by cross([a, b, c], x_);
            let x = x_1; let y = x_2; let z = x_3; {lagrangian} }}"
    );
    let (own, advected) = (derived(&own), derived(&advected));
    assert!(own.facts.energy_is_conserved);
    let numbers = [2, -3, 5, 1, 4, -2];
    let at = |names: [&str; 6]| -> Values {
        let named = names.iter().map(|n| (*n).to_owned()).zip(numbers.map(int));
        named.chain([("t".to_owned(), int(0))]).collect()
    };
    let one = said(&own, &at(["x", "y", "z", "a", "b", "c"])).expect("regular");
    let other = said(&advected, &at(["x_1", "x_2", "x_3", "a", "b", "c"])).expect("regular");
    for (name, theirs) in [("x", "x_1"), ("y", "x_2"), ("z", "x_3"), ("a", "a"), ("b", "b"), ("c", "c")] {
        assert_eq!(one[&format!("dot {name}")], other[&format!("dot {theirs}")], "{name}");
    }
}

/// The message of a model that is wrong.
fn wrong(items: &str) -> String {
    let text = format!("model wrong {{ {items} }}");
    equations_of(&text).map(|_| ()).expect_err(items).to_string()
}

#[test]
fn a_bracket_that_is_no_algebroid_is_refused_by_name() {
    let algebroid = |rest: &str| {
        wrong(&format!(
            "coordinate x in real; algebroid {{ basis e1, e2, e3; velocities u, v, w; {rest} }}
             lagrangian = (u^2 + v^2 + w^2)/2;"
        ))
    };
    let anchor = algebroid("anchor x_dot = u + x*v; [e1, e2] = 2*e1;");
    assert!(anchor.contains("[e1, e2]"), "{anchor}");
    let jacobi = algebroid("anchor x_dot = 0; [e1, e2] = e3; [e1, e3] = x*e1;");
    assert!(jacobi.contains("Jacobi"), "{jacobi}");
    let almost =
        "coordinate x in real; almost algebroid { basis e1, e2; velocities u, v; anchor x_dot = u + x*v;
        [e1, e2] = 2*e1; } lagrangian = (u^2 + v^2)/2;";
    assert!(derived(&format!("model fine {{ {almost} }}")).facts.energy_is_conserved);
}

#[test]
fn connection_coefficients_are_those_of_the_literature() {
    // Polar coordinates: Gamma^r_phiphi = -r, Gamma^phi_rphi = Gamma^phi_phir = 1/r (S2, B1).
    let polar = derived(
        "model polar { coordinate r in (0, 10); coordinate phi in angle; lagrangian = (r_dot^2 + r^2*phi_dot^2)/2; }",
    );
    let found = connection_coefficients(&polar.system).unwrap_or_else(|e| panic!("{e}"));
    let shown = |c: usize, a: usize, b: usize| found.graph.display(found.levi_civita[c][a][b], Style::Plain);
    assert_eq!([shown(0, 1, 1), shown(1, 0, 1), shown(1, 1, 0)], ["-r", "1/r", "1/r"]);
    assert_eq!([shown(0, 0, 0), shown(0, 0, 1), shown(1, 1, 1)], ["0", "0", "0"]);
    // In an orthonormal frame the connection turns it: nabla_v e_u = e_v/r, nabla_v e_v = -e_u/r.
    let framed = derived(
        "model polar { coordinate r in (0, 10); coordinate phi in angle; frame { u = r_dot; v = r*phi_dot; }
            lagrangian = (u^2 + v^2)/2; }",
    );
    let found = connection_coefficients(&framed.system).unwrap_or_else(|e| panic!("{e}"));
    let shown = |c: usize, a: usize, b: usize| found.graph.display(found.levi_civita[c][a][b], Style::Plain);
    assert_eq!([shown(1, 1, 0), shown(0, 1, 1), shown(1, 0, 1)], ["1/r", "-1/r", "0"]);
}

#[test]
fn geodesic_accelerations_are_minus_the_coefficients() {
    // ydot^c = -Gamma^c_ab y^a y^b without potential and force, unconstrained and constrained.
    let algebra = LieAlgebra::so(3).unwrap();
    for seed in 0..4 {
        let draws = &mut one(40 + seed, NUMBERS);
        let mut metric = draws.positive_definite(3);
        metric[0][0] += int(1);
        let entries: Vec<String> = metric
            .iter()
            .map(|row| {
                let row: Vec<String> = row.iter().map(Rational::to_string).collect();
                format!("[{}]", row.join(", "))
            })
            .collect();
        let constraint = if seed % 2 == 0 { "" } else { "constraint w3 = x*w1 + x_dot*w2*0 + 2*x_dot;" };
        let text = format!(
            "model geodesic {{ coordinate x in real; velocity w in so({}); connection w1 = x^2*x_dot;
                lagrangian = (1 + x^2)*x_dot^2 + dot(w, [{}]*w)/2 + x_dot*w2/8; {constraint} }}",
            algebra.dim(),
            entries.join(", ")
        );
        let equations = derived(&text);
        let coefficients = connection_coefficients(&equations.system).unwrap_or_else(|e| panic!("{e}"));
        let (names, values) = match &coefficients.constrained {
            Some(found) => (&found.velocities, &found.values),
            None => (&coefficients.frame, &coefficients.levi_civita),
        };
        let mut at = Values::from([("x".to_owned(), draws.non_zero()), ("t".to_owned(), int(0))]);
        at.extend(names.iter().map(|n| (n.clone(), draws.non_zero())));
        let Some(said) = said(&equations, &at) else { continue };
        let mut g = coefficients.graph.clone();
        let x = equations.system.algebroid.base()[0];
        let point = BTreeMap::from([(x, g.rational(at["x"].clone()))]);
        for (c, name) in names.iter().enumerate() {
            let mut sum = int(0);
            for (a, row) in values[c].iter().enumerate() {
                for (b, e) in row.iter().enumerate() {
                    let value = g.subs(*e, &point).expect("regular");
                    sum -= g.as_rational(value).expect("a number").clone() * &at[&names[a]] * &at[&names[b]];
                }
            }
            assert_eq!(said[&format!("dot {name}")], sum, "{name} of\n{text}");
        }
    }
}
