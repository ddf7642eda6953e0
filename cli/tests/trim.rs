//! Relative equilibria against formulas and motions: where they are, how they drift, whether they are stable.

use std::collections::BTreeMap;
use std::process::Command;
use std::sync::Arc;

use hamel_codegen::spec;
use hamel_run::bars::simulate_with_bar;
use hamel_run::cache::Cache;
use hamel_run::equilibria::{Along, Answer, Asked, Change, End, Equilibrium, Verdict, find};
use hamel_run::error::Error;
use hamel_run::interpreted;
use hamel_run::method::{MethodName, Steps};
use hamel_run::model::Checked;
use hamel_run::noise::Noise;
use hamel_run::simulation::{MAX_EVENTS, SimulateRequest};
use serde_json::Value;

/// A symmetric top on its tip; `c` is weight times distance.
const TOP: &str = "model top {
    param I: diagonal(3) = [1.3, 1.3, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    param c = 3.5;
    velocity Omega in so(3);
    momentum Pi of Omega;
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = 1/2*dot(Omega, I*Omega) - c*Gamma3;
    casimir C1 = dot(Gamma, Gamma);
    casimir C2 = dot(Pi, Gamma);
    scene momenta { carry Pi; want rhs, energy; }
}";

/// The axis of the top upright, nothing else turning.
const AXIS: [(&str, f64); 5] =
    [("Omega1", 0.0), ("Omega2", 0.0), ("Gamma1", 0.0), ("Gamma2", 0.0), ("Gamma3", 1.0)];

const BODY: &str = "model body {
    param I: diagonal(3) = [1, 2, 3] where I1 > 0, I2 > 0, I3 > 0;
    velocity Omega in so(3);
    momentum Pi of Omega;
    lagrangian = 1/2*dot(Omega, I*Omega);
    casimir C = dot(Pi, Pi);
}";

/// A pendulum on a cart with a motor, and friction in the joint.
const CART: &str = "model cart {
    param k = 0 where k >= 0;
    input push = 0;
    coordinate x in real;
    coordinate phi in angle;
    lagrangian = x_dot^2 + phi_dot^2/2 + x_dot*phi_dot*cos(phi) + cos(phi);
    force x_dot = push;
    force phi_dot = -k*phi_dot;
}";

/// A pendulum by an equation between coordinates.
const LOOP: &str = "model loop {
    coordinate x, y in real;
    lagrangian = (x_dot^2 + y_dot^2)/2 - y;
    constraint x^2 + y^2 = 4;
    initial x = 1.2; initial y = -1.6;
}";

/// Two equilibria at `x = +-sqrt(a)`.
const FOLD: &str = "model folding {
    param a = 1;
    coordinate x in real;
    lagrangian = x_dot^2/2 - x^3/3 + a*x;
    initial x = 0.8;
}";

/// A bead in a bowl that turns: a plane oscillator without a preferred direction.
const BOWL: &str = "model bowl {
    coordinate x, y in real;
    lagrangian = (x_dot^2 + y_dot^2)/2 - (x^2 + y^2)/2 - (x^2 + y^2)^2/8;
    initial x = 1; initial y = 0.1; initial x_dot = 0.1; initial y_dot = 1.3;
}";

fn model(text: &str) -> Arc<Checked> {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    Arc::new(Checked::new(model, Cache::none()))
}

fn named(values: &[(&str, f64)]) -> BTreeMap<String, f64> {
    values.iter().map(|(name, x)| ((*name).to_owned(), *x)).collect()
}

fn at(values: &[(&str, f64)]) -> Asked {
    Asked { at: named(values), ..Asked::default() }
}

fn along(name: &str, from: f64, to: f64) -> Option<Along> {
    Some(Along { name: name.to_owned(), from, to, n_points: 30 })
}

fn found(text: &str, scene: &str, asked: &Asked) -> Answer {
    find(&model(text), scene, asked).unwrap_or_else(|e| panic!("{e}"))
}

fn one(text: &str, scene: &str, asked: &Asked) -> Equilibrium {
    found(text, scene, asked).equilibria.remove(0)
}

/// The largest real part, and the largest imaginary part, of the eigenvalues.
fn largest(of: &Equilibrium) -> [f64; 2] {
    let part = |k: usize| of.stability.eigenvalues.iter().fold(f64::NEG_INFINITY, |max, z| max.max(z[k]));
    [part(0), part(1)]
}

/// The state that a motion of a scene reaches.
fn moved(text: &str, scene: &str, start: &Equilibrium, t_final: f64) -> Vec<f64> {
    let built = interpreted::build(&model(text), scene).unwrap();
    let steps = Steps::new(MethodName::default(), Some(1e-12), Some(1e-14), None).unwrap();
    let request = SimulateRequest {
        params: start.params.clone(),
        initial: start.state.clone(),
        t_final,
        method: MethodName::default(),
        steps,
        samples: 2,
        with_outputs: false,
        n_group: 0,
        max_steps: 1_000_000,
        max_events: MAX_EVENTS,
        watched: None,
        noise: Noise::default(),
        along: Vec::new(),
        tangents: Vec::new(),
    };
    simulate_with_bar(&built, &request).unwrap().last
}

#[test]
fn a_top_sleeps_above_the_speed_of_the_textbook() {
    // Arnold and Maddocks: I3^2 w^2 > 4 I1 c, by energy and Casimirs; below, deviations grow.
    let threshold = (4.0 * 1.3 * 3.5_f64).sqrt() / 0.6;
    for (scene, name, unit) in [("default", "Omega3", 1.0), ("momenta", "Pi3", 0.6)] {
        let turning = [if unit == 1.0 { "Omega" } else { "Pi" }, "Gamma"];
        let zeros = turning.iter().flat_map(|v| [1, 2].map(|k| (format!("{v}{k}"), 0.0)));
        let asked = Asked {
            at: zeros.chain([("Gamma3".to_owned(), 1.0)]).collect(),
            along: along(name, 20.0 * unit, unit),
            ..Asked::default()
        };
        let answer = found(TOP, scene, &asked);
        assert_eq!(answer.end, Some(End::Reached));
        let [(_, change, place)] = &answer.changes[..] else { panic!("{:?}", answer.changes) };
        assert_eq!(*change, Change::Flutter);
        let speed = place.along.unwrap() / unit;
        assert!((speed / threshold - 1.0).abs() < 1e-9, "{speed} {threshold}");
        assert_eq!(answer.equilibria[0].stability.verdict, Verdict::Stable);
        // The last: deviations z = Gamma1 + i Gamma2 have I1 s^2 - i I3 w s - c = 0 in space.
        let growth = (4.0 * 1.3 * 3.5 - 0.36_f64).sqrt() / 2.6;
        let end = answer.equilibria.last().unwrap();
        assert!((largest(end)[0] - growth).abs() < 1e-9, "{:?}", end.stability);
    }
}

#[test]
fn multipliers_that_dependent_gradients_leave_free_are_searched() {
    // A little above the threshold: with the shortest multipliers the second variation is indefinite.
    let threshold = (4.0 * 1.3 * 3.5_f64).sqrt() / 0.6;
    let at_speed = |speed: f64| at(&[&AXIS[..], &[("Omega3", speed)]].concat());
    let near = at_speed(1.0001 * threshold);
    assert_eq!(one(TOP, "default", &near).stability.verdict, Verdict::Stable);
    let below = at_speed(0.9999 * threshold);
    assert!(matches!(one(TOP, "default", &below).stability.verdict, Verdict::Unstable { .. }));
}

#[test]
fn a_free_body_turns_about_its_axes() {
    for (axis, name) in ["Omega1", "Omega2", "Omega3"].into_iter().enumerate() {
        // Beside the axis, on its own sphere of momentum.
        let mut guess = vec![("Omega1", 0.05), ("Omega2", -0.04), ("Omega3", 0.03)];
        guess[axis].1 = 2.0;
        let body = one(BODY, "default", &at(&guess));
        let momentum: f64 = guess.iter().zip([1.0, 2.0, 3.0]).map(|((_, w), i)| (w * i).powi(2)).sum();
        let moments = [1.0, 2.0, 3.0];
        let speed = body.state[axis];
        assert!((speed * moments[axis] - momentum.sqrt()).abs() < 1e-9, "{name}: {:?}", body.state);
        match axis {
            1 => {
                let growth = speed * (1.0_f64 / 3.0).sqrt();
                assert!((largest(&body)[0] - growth).abs() < 1e-9, "{:?}", body.stability);
            }
            _ => assert_eq!(body.stability.verdict, Verdict::Stable),
        }
    }
}

#[test]
fn a_drift_is_the_motion_along_a_symmetry() {
    let answer = found(BOWL, "default", &Asked::default());
    assert_eq!(answer.symmetries, ["x d/dy + x_dot d/dy_dot - y d/dx - y_dot d/dx_dot"]);
    let start = &answer.equilibria[0];
    // A circle of radius r is run with the square of the rate 1 + r^2/2.
    let [x, y] = [start.state[0], start.state[1]];
    let rate = start.drifts[0];
    assert!((rate * rate - 1.0 - (x * x + y * y) / 2.0).abs() < 1e-12, "{start:?}");
    assert_eq!(start.stability.verdict, Verdict::Stable);
    let t = 3.0;
    let last = moved(BOWL, "default", start, t);
    let (sin, cos) = (rate * t).sin_cos();
    for pair in [0, 2] {
        let [x, y] = [start.state[pair], start.state[pair + 1]];
        let turned = [cos * x - sin * y, sin * x + cos * y];
        for (found, wanted) in last[pair..].iter().zip(turned) {
            assert!((found - wanted).abs() < 1e-9, "{last:?} {start:?}");
        }
    }
    // Without the drift only the middle is left.
    let rest = one(BOWL, "default", &Asked { at_rest: true, ..Asked::default() });
    assert!(rest.state.iter().all(|x| x.abs() < 1e-9), "{rest:?}");
}

#[test]
fn a_scaling_is_no_symmetry() {
    // Every ray of a linear oscillator is mapped to itself by the scaling of place and velocity.
    let oscillator = "model o { coordinate q in real; lagrangian = q_dot^2/2 - q^2/2; }";
    assert!(found(oscillator, "default", &Asked::default()).symmetries.is_empty());
    let damped = "model d { coordinate q in real; lagrangian = q_dot^2/2 - q^2/2; force q_dot = -3*q_dot;
        initial q = 1; }";
    let answer = found(damped, "default", &Asked::default());
    assert!(answer.symmetries.is_empty() && answer.equilibria[0].state.iter().all(|x| x.abs() < 1e-12));
    // The smallest imbalance leaves none.
    let broken = TOP.replace("c*Gamma3", "c*(Gamma3 + Gamma1/1000)");
    assert!(found(&broken, "default", &at(&[("Gamma3", 1.0), ("Omega3", 9.0)])).symmetries.is_empty());
    assert_eq!(found(TOP, "default", &at(&[("Gamma3", 1.0)])).symmetries.len(), 1);
}

#[test]
fn inputs_and_parameters_are_solved_for() {
    // At phi = pi/6 the cart and the pendulum accelerate together by tan(phi): no equilibrium, whatever pushes.
    let asked = Asked {
        keep: vec![("phi".to_owned(), Some(0.5))],
        free: vec!["push".to_owned()],
        ..Asked::default()
    };
    let text = find(&model(CART), "controlled", &asked).unwrap_err().to_string();
    assert!(text.contains("has no equilibrium near it"), "{text}");
    // Upright, with friction: unstable; hanging: asymptotically stable up to the cart's place and speed.
    let upright = Asked { set: named(&[("k", 0.5)]), ..at(&[("phi", 3.0), ("x_dot", 0.7)]) };
    let found_upright = one(CART, "controlled", &upright);
    assert!((found_upright.state[1] - std::f64::consts::PI).abs() < 1e-12, "{found_upright:?}");
    assert!(matches!(found_upright.stability.verdict, Verdict::Unstable { .. }));
    let hanging = one(CART, "controlled", &Asked { set: named(&[("k", 0.5)]), ..at(&[("phi", 0.3)]) });
    assert!(hanging.stability.eigenvalues.iter().all(|z| z[0] < -1e-3), "{hanging:?}");
    // A parameter: the speed at which a height is kept.
    let balance =
        "model balance { param a = 1; coordinate x in real; lagrangian = x_dot^2/2 - a*x + x^2/2; }";
    let asked =
        Asked { keep: vec![("x".to_owned(), Some(3.0))], free: vec!["a".to_owned()], ..Asked::default() };
    assert!((one(balance, "default", &asked).params[0] - 3.0).abs() < 1e-12);
}

#[test]
fn equations_between_coordinates_are_kept() {
    let bottom = one(LOOP, "default", &Asked::default());
    for (name, value) in bottom.state.iter().zip([0.0, -2.0]) {
        assert!((name - value).abs() < 1e-9, "{bottom:?}");
    }
    assert_eq!(bottom.stability.verdict, Verdict::Stable);
    // The frequency of a pendulum of length 2.
    assert!((largest(&bottom)[1] - 0.5_f64.sqrt()).abs() < 1e-8, "{:?}", bottom.stability);
}

#[test]
fn a_family_turns_back_at_a_fold() {
    let answer = found(FOLD, "default", &Asked { along: along("a", 1.0, -0.5), ..Asked::default() });
    assert_eq!(answer.end, Some(End::Returned));
    let (_, change, place) = &answer.changes[0];
    assert_eq!(*change, Change::Fold);
    assert!(place.along.unwrap().abs() < 1e-8 && place.state[0].abs() < 1e-4, "{place:?}");
    let [first, last] = [answer.equilibria.first(), answer.equilibria.last()].map(Option::unwrap);
    assert!((first.state[0] - 1.0).abs() < 1e-12 && (last.state[0] + 1.0).abs() < 1e-9, "{first:?} {last:?}");
    assert_eq!(first.stability.verdict, Verdict::Stable);
    assert!(matches!(last.stability.verdict, Verdict::Unstable { .. }));
    // Every point of the family is an equilibrium.
    for at in &answer.equilibria {
        assert!((at.state[0] * at.state[0] - at.params[0]).abs() < 1e-9, "{at:?}");
    }
}

#[test]
fn what_cannot_be_found_is_said() {
    let refused = |text: &str, asked: &Asked| match find(&model(text), "default", asked) {
        Ok(answer) => panic!("{answer:?}"),
        Err(error) => error.to_string(),
    };
    let falling = "model falling { coordinate x in real; lagrangian = x_dot^2/2 - x; }";
    let text = refused(falling, &Asked::default());
    assert!(text.contains("the smallest rates there are") && text.contains("give another one"), "{text}");
    let driven = "model driven { coordinate x in real; lagrangian = x_dot^2/2 - x^2/2 + x*cos(t); }";
    assert!(refused(driven, &Asked::default()).contains("depends on time"));
    assert!(
        (one(driven, "default", &Asked { t: Some(0.0), ..Asked::default() }).state[0] - 1.0).abs() < 1e-12
    );
    assert!(refused(driven, &around(6.0, Asked::default())).contains("without time"));
    let asked = Asked {
        set: named(&[("q", 1.0)]),
        keep: vec![("Omega4".to_owned(), None)],
        free: vec!["Omega1".to_owned()],
        along: along("d", 0.0, 1.0),
        ..at(&[("Gama1", 1.0)])
    };
    let text = match find(&model(TOP), "default", &asked) {
        Err(Error::Request { problems }) => {
            problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
        }
        other => panic!("{other:?}"),
    };
    for part in ["set has no parameter `q`", "`Omega4`", "`Omega1`", "along has no value `d`", "`Gama1`"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn the_command_prints_answers_and_writes_families() {
    let folder = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("trim");
    std::fs::create_dir_all(&folder).unwrap();
    let hamel = |arguments: &[&str]| {
        let out = Command::new(env!("CARGO_BIN_EXE_hamel"))
            .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
            .args(arguments)
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (out.status.code(), text(out.stdout), text(out.stderr))
    };
    let sleeping = [
        "trim",
        "heavy_top",
        "--scene",
        "symmetric",
        "--at",
        "Omega1=0",
        "Omega2=0",
        "Gamma1=0",
        "Gamma2=0",
        "Gamma3=1",
    ];
    let (code, text, _) = hamel(&[&sleeping[..], &["Omega3=10"]].concat());
    assert_eq!(code, Some(0));
    assert!(text.contains("stable: the second variation of the energy is definite"), "{text}");
    let (_, json, _) = hamel(&[&sleeping[..], &["Omega3=10", "--json"]].concat());
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["equilibria"][0]["verdict"], "stable");
    assert_eq!(json["equilibria"][0]["state"]["Omega3"], 10.0);
    for name in ["family.csv", "family.svg"] {
        let path = folder.join(name);
        let path = path.to_str().unwrap();
        let (code, text, error) = hamel(&[&sleeping[..], &["--along", "Omega3=20..1", "-o", path]].concat());
        assert_eq!(code, Some(0), "{error}");
        assert!(text.contains("flutter") && text.contains("7.386102"), "{text}");
        let written = std::fs::read_to_string(path).unwrap();
        match name {
            "family.csv" => {
                assert_eq!(
                    written.lines().next().unwrap(),
                    "Omega3,Omega1,Omega2,Gamma1,Gamma2,Gamma3,drift_1,largest_real_part"
                );
                assert!(written.lines().count() > 40);
            }
            _ => assert!(written.starts_with("<svg") && written.contains("largest real part")),
        }
    }
    let (code, _, error) = hamel(&[&sleeping[..], &["--along", "Omega3=1"]].concat());
    assert!(code == Some(2) && error.contains("from..to"), "{code:?} {error}");
    let (code, _, error) = hamel(&["trim", "heavy_top", "--at", "Omega1=0", "-o", "x.svg"]);
    assert!(code == Some(2) && error.contains("--along"), "{code:?} {error}");
}

/// A bead on a circle in gravity.
const PENDULUM: &str = "model pendulum {
    coordinate q in angle;
    lagrangian = q_dot^2/2 + cos(q);
    initial q = 1; initial q_dot = 0;
}";

/// A rimless wheel: spokes at the angle `2 alpha` hit the slope one after the other.
const WHEEL: &str = "model wheel {
    param gamma = 0.08;
    param alpha = 0.2;
    coordinate q in real;
    lagrangian = q_dot^2/2 - cos(q + gamma);
    event step = q - alpha rising { then q = -alpha; then q_dot = q_dot*cos(2*alpha); }
    initial q = -0.1; initial q_dot = 0.4;
}";

fn around(period: f64, asked: Asked) -> Asked {
    Asked { period: Some(period), ..asked }
}

/// `4 K(sin(a/2))` by the arithmetic-geometric mean.
fn period_of_a_pendulum(amplitude: f64) -> f64 {
    let (mut a, mut b) = (1.0, (amplitude / 2.0).cos());
    for _ in 0..8 {
        (a, b) = (f64::midpoint(a, b), (a * b).sqrt());
    }
    std::f64::consts::TAU / a
}

#[test]
fn an_orbit_of_a_pendulum_has_its_period() {
    let keep = vec![("energy".to_owned(), None)];
    let asked = around(6.3, Asked { keep, ..Asked::default() });
    let orbit = one(PENDULUM, "default", &asked);
    let wanted = period_of_a_pendulum(1.0);
    assert!((orbit.period.unwrap() - wanted).abs() < 1e-10, "{orbit:?} {wanted}");
    // Energy and phase leave nothing.
    assert_eq!(orbit.stability.verdict, Verdict::Rigid);
    // At rest it comes back after any time, which is no orbit.
    let text = find(&model(PENDULUM), "default", &around(6.3, at(&[("q", 0.0)]))).unwrap_err().to_string();
    assert!(text.contains("leads to an equilibrium"), "{text}");
    // Beyond the upright position it goes round: the angle comes back with a full turn.
    let round = around(3.0, Asked { keep: vec![("energy".to_owned(), None)], ..at(&[("q_dot", 2.5)]) });
    let orbit = one(PENDULUM, "default", &round);
    let last = moved(PENDULUM, "default", &orbit, orbit.period.unwrap());
    assert!((last[0] - orbit.state[0] - std::f64::consts::TAU).abs() < 1e-9, "{last:?} {orbit:?}");
}

/// States on the way of Newton's method break equations and constraints, and have a motion all the same.
#[test]
fn orbits_keep_equations_between_coordinates() {
    let wanted = period_of_a_pendulum(1.0);
    let at_places = "coordinate q in angle;
        coordinate x, z in real by [x, z] = [sin(q), -cos(q)];
        lagrangian = (q_dot^2 + x_dot^2 + z_dot^2)/4 - z;
        initial q = 1;";
    let keep = [("q".to_owned(), None)];
    for multipliers in ["", "multipliers;"] {
        let text = format!("model m {{ {at_places} {multipliers} }}");
        let asked = Asked { keep: keep.to_vec(), ..at(&[("q_dot", 0.0)]) };
        let orbit = one(&text, "default", &around(6.5, asked));
        assert!((orbit.period.unwrap() - wanted).abs() < 1e-9, "{orbit:?} {wanted}");
    }
}

#[test]
fn a_limit_cycle_has_the_multiplier_of_its_divergence() {
    let text = "model vdp { param mu = 1; coordinate q in real; lagrangian = q_dot^2/2 - q^2/2;
        force q_dot = mu*(1 - q^2)*q_dot; initial q = 2; initial q_dot = 0; }";
    let orbit = one(text, "default", &around(6.5, Asked::default()));
    // Known to many digits; the multiplier by Liouville's formula from the same orbit, integrated apart.
    assert!((orbit.period.unwrap() - 6.663_286_859_323).abs() < 1e-9, "{orbit:?}");
    let with_area =
        text.replace("initial q = 2;", "state area in real by area_dot = mu*(1 - q^2); initial q = 2;");
    let start = Equilibrium { state: [&orbit.state[..], &[0.0]].concat(), ..orbit.clone() };
    let built = interpreted::build(&model(&with_area), "default").unwrap();
    let names = hamel_run::dynamics::Factory::info(&built).state.clone();
    let place = names.iter().position(|name| name == "area").unwrap();
    let mut state = orbit.state.clone();
    state.insert(place, 0.0);
    let last = moved(&with_area, "default", &Equilibrium { state, ..start }, orbit.period.unwrap());
    let [multiplier] = orbit.stability.multipliers[..] else { panic!("{:?}", orbit.stability) };
    assert!((multiplier[0] - last[place].exp()).abs() < 1e-10, "{multiplier:?} {last:?}");
    assert!(matches!(orbit.stability.verdict, Verdict::Asymptotic { .. }));
}

#[test]
fn a_drift_closes_an_orbit() {
    let off = at(&[("y_dot", 0.6)]);
    let orbit = one(BOWL, "default", &around(4.0, Asked { keep: vec![("energy".to_owned(), None)], ..off }));
    let period = orbit.period.unwrap();
    let last = moved(BOWL, "default", &orbit, period);
    let (sin, cos) = (orbit.drifts[0] * period).sin_cos();
    for pair in [0, 2] {
        let [x, y] = [orbit.state[pair], orbit.state[pair + 1]];
        assert!((last[pair] - (cos * x - sin * y)).abs() < 1e-9, "{last:?} {orbit:?}");
        assert!((last[pair + 1] - (sin * x + cos * y)).abs() < 1e-9, "{last:?} {orbit:?}");
    }
    assert!(orbit.drifts[0].abs() > 1e-3 && orbit.stability.verdict == Verdict::Spectral);
}

#[test]
fn an_impact_is_part_of_an_orbit() {
    let gait = one(WHEEL, "default", &around(0.8, Asked::default()));
    // Just before the impact w^2 = w0^2 + 2 (cos(gamma - alpha) - cos(gamma + alpha)), and w0 = w cos(2 alpha).
    let (gamma, alpha) = (0.08_f64, 0.2_f64);
    let gained = 2.0 * ((gamma - alpha).cos() - (gamma + alpha).cos());
    let kept = (2.0 * alpha).cos().powi(2);
    let speed = gained / (1.0 - kept);
    let energy = speed / 2.0 + (gamma + alpha).cos();
    let [q, w] = gait.state[..] else { panic!("{gait:?}") };
    // On the way the energy is that before the impact.
    assert!((w * w / 2.0 + (q + gamma).cos() - energy).abs() < 1e-10, "{gait:?} {energy}");
    // Deviations of the energy shrink by the square of the restitution.
    let [multiplier] = gait.stability.multipliers[..] else { panic!("{:?}", gait.stability) };
    assert!((multiplier[0] - kept).abs() < 1e-8, "{multiplier:?} {kept}");
    assert!(matches!(gait.stability.verdict, Verdict::Asymptotic { .. }));
}

/// Two steps of the compass gait, with modes and impacts, up to the way down the slope that they take.
#[test]
fn a_gait_of_modes_is_an_orbit() {
    let text = include_str!("../../docs/book/compass.hamel");
    let gait = one(text, "default", &around(1.47, Asked::default()));
    // By the two equations of a swing and impulses about the new foot, integrated apart; multipliers by differences.
    assert!((gait.period.unwrap() - 2.0 * 0.734_346_391_159).abs() < 1e-9, "{gait:?}");
    let wanted = [[-0.256_563_7, 0.217_492_2], [-0.256_563_7, -0.217_492_2], [0.017_311_35, 0.0]];
    assert_eq!(gait.stability.multipliers.len(), wanted.len(), "{:?}", gait.stability);
    for (found, wanted) in gait.stability.multipliers.iter().zip(wanted) {
        assert!((found[0] - wanted[0]).hypot(found[1] - wanted[1]) < 1e-6, "{:?}", gait.stability);
    }
    assert!(matches!(gait.stability.verdict, Verdict::Asymptotic { .. }));
    // Along the slope, by two lengths of a step.
    let drift = gait.drifts.iter().map(|drift| drift * gait.period.unwrap()).fold(0.0, f64::max);
    assert!((drift - 4.0 * 0.271_028_68_f64.sin()).abs() < 1e-6, "{gait:?}");
}

/// Rössler's system: its cycle doubles its period.
#[test]
fn a_family_of_orbits_doubles_its_period() {
    let text = "model roessler { param a = 0.2; param b = 0.2; param c = 2.5;
        coordinate x, v, z in real;
        field x_dot = -v - z; field v_dot = x + a*v; field z_dot = b + z*(x - c);
        initial x = 4.4; initial v = -2.36; initial z = 0.42; }";
    let along = Some(Along { name: "c".into(), from: 2.5, to: 3.0, n_points: 6 });
    let family = find(&model(text), "default", &around(5.75, Asked { along, ..Asked::default() })).unwrap();
    assert_eq!(family.end, Some(End::Reached));
    let [(_, change, at)] = &family.changes[..] else { panic!("{:?}", family.changes) };
    // By shooting with a variational equation of its own.
    assert_eq!(*change, Change::Doubling);
    assert!((at.along.unwrap() - 2.832_445_028).abs() < 1e-6, "{at:?}");
    assert!((at.period.unwrap() - 5.769_820_02).abs() < 1e-6, "{at:?}");
    let first = &family.equilibria[0];
    assert!((first.period.unwrap() - 5.748_991_183_28).abs() < 1e-9, "{first:?}");
    // The last member is the orbit of its parameter.
    let last = family.equilibria.last().unwrap();
    let guess: Vec<(&str, f64)> = ["x", "v", "z"].into_iter().zip(last.state.iter().copied()).collect();
    let own = one(&text.replace("c = 2.5", "c = 3"), "default", &around(5.8, self::at(&guess)));
    assert!((own.period.unwrap() - last.period.unwrap()).abs() < 1e-9, "{own:?} {last:?}");
    let (names, rows) = family.table("c");
    assert_eq!(names, ["c", "x", "v", "z", "period", "largest_real_part"]);
    assert!(rows.iter().all(|row| row.len() == names.len()));
}

#[test]
fn fields_have_no_momenta_in_space() {
    // Fields for the group and accelerations: nothing has a momentum, and nothing is looked for.
    let text = "model walker {
        coordinate s in angle;
        velocity omega, v in se(2);
        field s_dot = sin(s);
        field omega = sin(s);
        acceleration v = [cos(s) - v1, -v2];
        initial s = 3;
    }";
    let found = one(text, "default", &Asked::default());
    assert!((found.state[0] - std::f64::consts::PI).abs() < 1e-9, "{found:?}");
    assert!(matches!(found.stability.verdict, Verdict::Asymptotic { .. }), "{:?}", found.stability);
}

/// A ball on a table that shakes, with the phase as a coordinate, as a state, and as the time.
#[test]
fn events_restrict_the_symmetries_of_an_orbit() {
    let table = |phase: &str, kinetic: &str, angle: &str| {
        format!(
            "model table {{
                param a = 0.06; param e = 0.8; param w = 8;
                coordinate z in real;
                {phase}
                lagrangian = z_dot^2/2 - 9.81*z{kinetic};
                event hit = z - a*sin({angle}) falling {{ then z_dot = -e*z_dot + (1 + e)*a*w*cos({angle}); }}
                initial z = 0.1; initial z_dot = 3.66;
            }}"
        )
    };
    let coordinate = table("coordinate ph in angle; constraint ph_dot = w;", " + ph_dot^2/2", "ph");
    let state = table("state ph in angle by ph_dot = w;", "", "ph");
    // The multipliers of the map from one impact to the next at its fixed point, `v = pi g/w`, by differences.
    let multiplier = [0.533_044_09, 0.596_543_38];
    for text in [coordinate, state] {
        let orbit = one(&text, "default", &around(0.785, at(&[("ph", 0.625)])));
        let period = orbit.period.unwrap();
        assert!((period - std::f64::consts::TAU / 8.0).abs() < 1e-9, "{orbit:?}");
        assert!(orbit.drifts.is_empty(), "{orbit:?}");
        let found = orbit.stability.multipliers.first().unwrap();
        assert!((found[0] - multiplier[0]).abs() < 1e-6, "{orbit:?}");
        assert!((found[1].abs() - multiplier[1]).abs() < 1e-6, "{orbit:?}");
    }
    let driven = table("", "", "w*t");
    let told = find(&model(&driven), "default", &around(0.785, Asked::default())).unwrap_err().to_string();
    assert!(told.contains("depends on time"), "{told}");
}

/// Along the wall a drift is a symmetry still, and one that events only tell of is none of their business.
#[test]
fn symmetries_that_events_keep_are_left() {
    let text = "model wall {
        coordinate x, y in real;
        lagrangian = (x_dot^2 + y_dot^2 - x^2)/2;
        event wall = x falling { then x_dot = -x_dot; }
        event told = y - 3;
        initial x = 0.5; initial x_dot = 0.2; initial y_dot = 0.3;
    }";
    let orbit = one(text, "default", &around(3.0, Asked::default()));
    assert!((orbit.period.unwrap() - std::f64::consts::PI).abs() < 1e-9, "{orbit:?}");
    assert!(orbit.drifts.iter().any(|drift| (drift - orbit.state[3]).abs() < 1e-9), "{orbit:?}");
    assert!(orbit.state[3].abs() > 0.1, "{orbit:?}");
}
