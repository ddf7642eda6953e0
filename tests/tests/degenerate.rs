//! Degenerate Lagrangians: the motion satisfies the Euler-Lagrange equations that it was found from, exactly, and is
//! the one that is known by other means.

use std::collections::BTreeMap;

use hamel_codegen::scene;
use hamel_codegen::spec::{self, Model, Want};
use hamel_expr::{ExprId, Graph, Rational, SymbolId, inlined, rational_to_f64};
use hamel_mechanics::mechanics::{Equations, derive};
use hamel_mechanics::reduction::{DegenerateOutcome, Formulation, KinematicConstraint, reduce};
use hamel_tests::draws::{Draws, for_all};
use hamel_tests::models;

fn parsed(text: &str) -> Model {
    spec::parse("m", text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn derived(text: &str) -> Equations {
    let model = parsed(text);
    let system = reduce(&model, &Formulation::of(&model)).unwrap_or_else(|e| panic!("{e}\n{text}"));
    derive(&system).unwrap_or_else(|e| panic!("{e:?}\n{text}"))
}

/// The motion of a system without symmetry: velocities and rates by the state.
struct Motion {
    g: Graph,
    /// Velocities by the state.
    velocities: BTreeMap<SymbolId, ExprId>,
    /// State variables and their rates.
    rates: Vec<(SymbolId, ExprId)>,
}

impl Motion {
    fn new(equations: &Equations) -> Motion {
        let mut g = equations.system.graph.clone();
        let values = inlined(&mut g, equations.sections.iter().flat_map(|s| &s.definitions));
        let mut rates = Vec::new();
        for state in &equations.state {
            rates.push((state.symbol, g.subs(state.derivative, &values).expect("it has a value")));
        }
        let KinematicConstraint::Solved(solved) = &equations.system.constraint else { panic!("solved") };
        let mut velocities = BTreeMap::new();
        for &alpha in &solved.dependent {
            velocities.insert(equations.system.velocities[alpha], solved.velocity(&mut g, alpha));
        }
        Motion { g, velocities, rates }
    }

    fn rate_of(&mut self, e: ExprId) -> ExprId {
        let mut terms = Vec::new();
        for (symbol, rate) in self.rates.clone() {
            let slope = self.g.diff(e, symbol);
            terms.push(self.g.mul(slope, rate));
        }
        self.g.sum(&terms)
    }
}

/// Holds a system without algebra and force to `d/dt L_xdot = L_x`, with velocities that are the rates of coordinates.
fn assert_euler_lagrange(equations: &Equations, what: &str) {
    let system = &equations.system;
    let mut motion = Motion::new(equations);
    let base = system.algebroid.base().to_vec();
    for (x, y) in base.iter().zip(&system.velocities) {
        let rate = motion.rates.iter().find(|(symbol, _)| symbol == x).expect("a state variable").1;
        let velocity = motion.velocities.get(y).copied().unwrap_or_else(|| motion.g.sym(*y));
        assert!(motion.g.is_equal(rate, velocity), "{} moves otherwise\n{what}", system.graph.name(*x));
    }
    for (x, y) in base.iter().zip(&system.velocities) {
        let velocities = motion.velocities.clone();
        let [momentum, slope] = [*y, *x].map(|s| {
            let e = motion.g.diff(system.lagrangian, s);
            motion.g.subs(e, &velocities).expect("it has a value")
        });
        let rate = motion.rate_of(momentum);
        assert!(
            on_conditions(equations, &mut motion, rate, slope),
            "the equation of {}\n{what}",
            system.graph.name(*x)
        );
    }
}

/// Whether two expressions agree where the conditions on positions hold, each of which is solved for a coordinate that
/// it is affine in.
fn on_conditions(equations: &Equations, motion: &mut Motion, a: ExprId, b: ExprId) -> bool {
    let mut difference = motion.g.sub(a, b);
    let found = equations.system.degeneracy.as_ref().expect("a degenerate Lagrangian");
    for (_, condition) in found.positions.iter().rev() {
        let base = equations.system.algebroid.base();
        let solved = base.iter().rev().find_map(|x| {
            let (slopes, rest) = motion.g.affine_parts(*condition, &[*x])?;
            let minus = motion.g.neg(rest);
            (!motion.g.is_zero(slopes[0])).then(|| (*x, motion.g.div(minus, slopes[0]).expect("not zero")))
        });
        let (x, value) = solved.expect("a coordinate");
        difference = motion.g.subs(difference, &BTreeMap::from([(x, value)])).expect("it has a value");
    }
    motion.g.is_zero(difference)
}

/// A polynomial of second degree.
fn polynomial(draws: &mut Draws, n: usize) -> String {
    let mut terms = vec![draws.rational().to_string()];
    for i in 1..=n {
        terms.push(format!("({})*x{i}", draws.rational()));
        for j in i..=n {
            terms.push(format!("({})*x{i}*x{j}", draws.rational()));
        }
    }
    terms.join(" + ")
}

/// `L = 1/2 sum of squares of r combinations of velocities + A(x) . xdot - V(x)` in `n` coordinates.
fn lagrangian(draws: &mut Draws, n: usize, r: usize) -> String {
    let mut terms = Vec::new();
    for _ in 0..r {
        let weights = draws.generic_vector(n);
        let sum: Vec<String> = (1..).zip(&weights).map(|(i, w)| format!("({w})*x{i}_dot")).collect();
        terms.push(format!("1/2*({})^2", sum.join(" + ")));
    }
    for i in 1..=n {
        terms.push(format!("({})*x{i}_dot", polynomial(draws, n)));
    }
    format!("{} - ({})", terms.join(" + "), polynomial(draws, n))
}

#[test]
fn random_lagrangians_of_any_rank_give_their_euler_lagrange_equations() {
    // Of null directions there have to be evenly many for the two-form on them to be regular.
    for (n, r) in [(2, 0), (3, 1), (4, 0), (4, 2)] {
        for_all(&format!("{r} of {n}"), 3, 200, |mut draws| {
            let l = lagrangian(&mut draws, n, r);
            let text = format!("model m {{ coordinate x: vector({n}) in real; lagrangian = {l}; }}");
            let equations = derived(&text);
            let found = equations.system.degeneracy.as_ref().expect("a degenerate Lagrangian");
            assert_eq!(found.steps.len(), n - r, "{text}");
            assert_eq!(equations.state.len(), n + r, "{text}");
            assert!(equations.facts.energy_is_conserved, "{text}");
            assert_euler_lagrange(&equations, &text);
            Ok(())
        });
    }
}

/// A multiplier that somebody wrote as a coordinate: its equation restricts positions, and so does what follows.
#[test]
fn conditions_on_positions_are_differentiated() {
    let text = "model m {
        coordinate x, z, lambda in real;
        lagrangian = x_dot^2/2 + z_dot^2 + lambda*(x - 2*z) - x^2*z;
    }";
    let equations = derived(text);
    assert_euler_lagrange(&equations, text);
    let found = equations.system.degeneracy.as_ref().unwrap();
    let outcomes: Vec<&DegenerateOutcome> = found.steps.iter().map(|step| &step.outcome).collect();
    let solved = |name: &str| DegenerateOutcome::Solved(name.to_owned());
    let expected = [
        &DegenerateOutcome::Differentiated,
        &solved("z_dot"),
        &DegenerateOutcome::Differentiated,
        &solved("lambda_dot"),
    ];
    assert_eq!(outcomes, expected);
    // On x = 2 z: 3 z'^2 and the potential 4 z^3.
    let rate = equations.state.iter().find(|s| s.name == "x_dot").expect("a state variable");
    let mut motion = Motion::new(&equations);
    let acceleration = motion.rates.iter().find(|(symbol, _)| *symbol == rate.symbol).unwrap().1;
    let symbol = |name: &str| equations.state.iter().find(|s| s.name == name).unwrap().symbol;
    let half = motion.g.sym(symbol("x"));
    let half = motion.g.scale(half, &Rational::new(1.into(), 2.into()));
    let on_line = BTreeMap::from([(symbol("z"), half)]);
    let acceleration = motion.g.subs(acceleration, &on_line).unwrap();
    // z'' = -12 z^2 / 6, x'' = 2 z''.
    let square = motion.g.powi(half, 2);
    let expected = motion.g.scale(square, &Rational::from_integer((-4).into()));
    assert!(on_conditions(&equations, &mut motion, acceleration, expected));
    // The residuals are there for whoever starts.
    let built = scene::build(&parsed(text), scene::DEFAULT).unwrap();
    assert!(built.outputs().iter().any(|o| o.name == Want::Constraint.name()));
}

/// A charge in a strong field: with its mass the velocity is part of its state, without it the place is.
#[test]
fn a_scene_without_mass_is_the_limit() {
    let text = "model m {
        param m = 1; param k = 1/3;
        coordinate x, y in real;
        lagrangian = m/2*(x_dot^2 + y_dot^2) + (x + k*x^3/3)*y_dot - (x^2 + 2*y^2)/2;
        scene limit { fix m = 0; }
    }";
    let model = parsed(text);
    let limit = scene::build(&model, "limit").unwrap();
    assert_eq!(limit.state_names(), ["x", "y"]);
    let (x, y, k) = (0.4, -0.3, 1.0 / 3.0);
    let mut drift = [0.0; 2];
    limit.prepare(&[k]).unwrap().rhs(0.0, &[x, y], &mut drift);
    let field = 1.0 + k * x * x;
    assert!((drift[0] + 2.0 * y / field).abs() < 1e-15 && (drift[1] - x / field).abs() < 1e-15, "{drift:?}");
    // The massive particle with that velocity is accelerated little: its force is of the order of the mass.
    let massive = scene::build(&model, scene::DEFAULT).unwrap();
    let mut rates = [0.0; 4];
    massive.prepare(&[1e-3, k]).unwrap().rhs(0.0, &[x, y, drift[0], drift[1]], &mut rates);
    assert!(rates[2].abs() < 1e-12 && rates[3].abs() < 1e-12, "{rates:?}");
}

/// Rigid body beside massless coordinates, on both sides: the body feels a torque by a pair that are each other's
/// momenta.
#[test]
fn velocities_of_an_algebra_go_on_beside_massless_coordinates() {
    for action in ["left", "right"] {
        let common = format!("action {action}; velocity Omega in so(3); param I: diagonal(3) = [1, 2, 3];");
        let kinetic = "dot(Omega, I*Omega)/2";
        let massless = derived(&format!(
            "model m {{ {common} coordinate q, r in real;
             lagrangian = {kinetic} + r*q_dot - (q^2 + 2*r^2)/2 + q*Omega3; }}"
        ));
        // With r = q_dot/2 by its own equation.
        let massive = derived(&format!(
            "model m {{ {common} coordinate q in real;
             lagrangian = {kinetic} + q_dot^2/4 - q^2/2 + q*Omega3; }}"
        ));
        let (mut one, other) = (Motion::new(&massless), Motion::new(&massive));
        assert_eq!(massless.state.len(), 5);
        let symbol = |e: &Equations, name: &str| e.state.iter().find(|s| s.name == name).map(|s| s.symbol);
        for name in ["Omega1", "Omega2", "Omega3"] {
            let of = |m: &Motion, e: &Equations| {
                let symbol = symbol(e, name);
                m.rates
                    .iter()
                    .find(|(s, _)| Some(*s) == symbol)
                    .map(|(_, rate)| *rate)
                    .expect("a state variable")
            };
            let (a, b) = (of(&one, &massless), of(&other, &massive));
            // q_dot is 2 r.
            let mut values = BTreeMap::new();
            for s in other.g.free_symbols(b) {
                let value = match other.g.name(s) {
                    "q_dot" => {
                        let r = one.g.sym(symbol(&massless, "r").expect("a state variable"));
                        one.g.scale(r, &Rational::from_integer(2.into()))
                    }
                    same => {
                        let params = massless.system.params.iter().map(|p| (&p.name, p.symbol));
                        let mut all = params.chain(massless.state.iter().map(|s| (&s.name, s.symbol)));
                        one.g.sym(all.find(|(name, _)| *name == same).expect("a name of both").1)
                    }
                };
                values.insert(s, value);
            }
            let imported = one.g.import_with(&other.g, &[b], &values).expect("it has a value")[0];
            assert!(one.g.is_equal(a, imported), "{action}: {name}");
        }
        assert!(massless.facts.energy_is_conserved);
    }
}

/// The shipped models, by what is in print about them.
#[test]
fn shipped_models_move_as_their_sources_say() {
    let rates_in = |model: &str, scene: &str, state: &[f64]| {
        let built = models::build(model, scene);
        let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
        let mut rates = vec![0.0; state.len()];
        built.prepare(&params).unwrap().rhs(0.0, state, &mut rates);
        rates
    };
    let rates = |model: &str, state: &[f64]| rates_in(model, scene::DEFAULT, state);
    let close = |found: Vec<f64>, expected: &[f64]| {
        let is_close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-15 * (1.0 + b.abs()) * 4.0;
        assert!(found.iter().zip(expected).all(is_close), "{found:?} {expected:?}");
    };
    // Prey N and predators P: N' = a N - b N P, P' = c N P - d P.
    let (q, p) = (0.4f64, -0.7f64);
    close(rates("lotka_volterra", &[q, p]), &[1.0 - 0.5 * p.exp(), 0.4 * q.exp() - 0.8]);
    // E x B and the drift along the gradient: e b x' = dV/dy, e b y' = -dV/dx for V = mu b - e e2 y.
    let (x, y) = (0.3f64, 0.8f64);
    let b = 1.2 + 0.3 * x + 0.2 * x.cos() * y.cos();
    let (bx, by) = (0.3 - 0.2 * x.sin() * y.cos(), -0.2 * x.cos() * y.sin());
    close(rates("guiding_centre", &[x, y]), &[-(0.2 * by - 0.1) / b, 0.2 * bx / b]);
    // Newton: m r'' = b (1 + k x^2) (y', -x') - (c1 x, c2 y), and without the left side.
    let (vx, vy) = (0.5f64, -0.2f64);
    let (m, b) = (0.05, 1.5 * (1.0 + 0.3 * x * x));
    close(rates("charged_particle", &[x, y, vx, vy]), &[vx, vy, (b * vy - x) / m, (-b * vx - 2.0 * y) / m]);
    close(rates_in("charged_particle", "drift", &[x, y]), &[-2.0 * y / b, x / b]);
    // Velocities of vortices: Gamma/(2 pi r) about each other.
    let z = [0.2, -1.0, 0.9, 0.4, 0.7, -0.3, 1.1, -0.8];
    let gamma = [1.0, 0.8, 1.2, -0.6];
    let mut expected = [0.0; 8];
    for i in 0..4 {
        for j in (0..4).filter(|j| *j != i) {
            let (dx, dy) = (z[i] - z[j], z[4 + i] - z[4 + j]);
            let weight = gamma[j] / (2.0 * std::f64::consts::PI * (dx * dx + dy * dy));
            expected[i] -= weight * dy;
            expected[4 + i] += weight * dx;
        }
    }
    close(rates("point_vortices", &z), &expected);
}
