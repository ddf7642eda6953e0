//! Whipple's bicycle against its published benchmarks: the linearised equations of Meijaard, Papadopoulos, Ruina and
//! Schwab 2007 by the formulas of their appendix A, and the nonlinear accelerations of Basu-Mandal, Chatterjee and
//! Papadopoulos 2007, table 1; eigenvalues against speed, forces of the ground, energy.
//!
//! Deliberately does not know: how the equations are derived.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;
use hamel_program::program::Role;
use hamel_runtime::Dual;

const LAMBDA: f64 = std::f64::consts::PI / 10.0;
const W: f64 = 1.02;
const C: f64 = 0.08;
const G: f64 = 9.81;
const RR: f64 = 0.3;

type Matrix = [[f64; 2]; 2];

fn built(name: &str) -> BuiltScene {
    let text = include_str!("../../models/shelf/whipple_bicycle.hamel");
    let model = spec::parse("whipple_bicycle.hamel", text).unwrap_or_else(|p| panic!("{p}"));
    scene::build(&model, name).unwrap_or_else(|p| panic!("{p}"))
}

/// `M`, `C1`, `K0`, `K2` of `M q'' + v C1 q' + (g K0 + v^2 K2) q = f`, `q` = (lean, steer): appendix A.
fn benchmark() -> [Matrix; 4] {
    let (r_r, m_r, irxx, iryy) = (RR, 2.0, 0.0603, 0.12);
    let (x_b, z_b, m_b, ibxx, ibxz, ibzz) = (0.3, -0.9, 85.0, 9.2, 2.4, 2.8);
    let (x_h, z_h, m_h, ihxx, ihxz, ihzz) = (0.9, -0.7, 4.0, 0.05892, -0.00756, 0.00708);
    let (r_f, m_f, ifxx, ifyy) = (0.35, 3.0, 0.1405, 0.28);
    let (irzz, ifzz) = (irxx, ifxx);
    let (sin, cos) = LAMBDA.sin_cos();
    let m_t = m_r + m_b + m_h + m_f;
    let x_t = (x_b * m_b + x_h * m_h + W * m_f) / m_t;
    let z_t = (-r_r * m_r + z_b * m_b + z_h * m_h - r_f * m_f) / m_t;
    let itxx =
        irxx + ibxx + ihxx + ifxx + m_r * r_r * r_r + m_b * z_b * z_b + m_h * z_h * z_h + m_f * r_f * r_f;
    let itxz = ibxz + ihxz - m_b * x_b * z_b - m_h * x_h * z_h + m_f * W * r_f;
    let itzz = irzz + ibzz + ihzz + ifzz + m_b * x_b * x_b + m_h * x_h * x_h + m_f * W * W;
    let m_a = m_h + m_f;
    let (x_a, z_a) = ((x_h * m_h + W * m_f) / m_a, (z_h * m_h - r_f * m_f) / m_a);
    let iaxx = ihxx + ifxx + m_h * (z_h - z_a).powi(2) + m_f * (r_f + z_a).powi(2);
    let iaxz = ihxz - m_h * (x_h - x_a) * (z_h - z_a) + m_f * (W - x_a) * (r_f + z_a);
    let iazz = ihzz + ifzz + m_h * (x_h - x_a).powi(2) + m_f * (W - x_a).powi(2);
    let u_a = (x_a - W - C) * cos - z_a * sin;
    let iall = m_a * u_a * u_a + iaxx * sin * sin + 2.0 * iaxz * sin * cos + iazz * cos * cos;
    let ialx = -m_a * u_a * z_a + iaxx * sin + iaxz * cos;
    let ialz = m_a * u_a * x_a + iaxz * sin + iazz * cos;
    let mu = C / W * cos;
    let (s_r, s_f) = (iryy / r_r, ifyy / r_f);
    let (s_t, s_a) = (s_r + s_f, m_a * u_a + mu * m_t * x_t);
    let off = ialx + mu * itxz;
    [
        [[itxx, off], [off, iall + 2.0 * mu * ialz + mu * mu * itzz]],
        [
            [0.0, mu * s_t + s_f * cos + itxz / W * cos - mu * m_t * z_t],
            [-(mu * s_t + s_f * cos), ialz / W * cos + mu * (s_a + itzz / W * cos)],
        ],
        [[m_t * z_t, -s_a], [-s_a, -s_a * sin]],
        [[0.0, (s_t - m_t * z_t) / W * cos], [0.0, (s_a + s_f * sin) / W * cos]],
    ]
}

/// The published digits, table 2 of the paper.
#[test]
fn the_formulas_have_the_published_digits() {
    let published: [Matrix; 4] = [
        [[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]],
        [[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]],
        [[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]],
        [[0.0, 76.59734589573222], [0.0, 2.65431523794604]],
    ];
    for (found, expected) in benchmark().iter().flatten().flatten().zip(published.iter().flatten().flatten())
    {
        assert!((found - expected).abs() <= 1e-14 * expected.abs().max(1.0), "{found} instead of {expected}");
    }
}

/// Values and derivatives of the rates at a state by names; the torques are those of steer and lean.
fn rates(scene: &BuiltScene, state: &[(&str, Dual)], torques: [Dual; 2]) -> impl Fn(&str) -> Dual + use<> {
    let params: Vec<Dual> =
        scene.params().iter().map(|p| Dual::new(rational_to_f64(&p.default), 0.0)).collect();
    let executable = scene.executable();
    let interpreter = executable.prepare_over(&params).unwrap();
    let names = scene.state_names();
    let value = |name: &String| state.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("{name}")).1;
    let y: Vec<Dual> = names.iter().map(value).collect();
    let mut dy = vec![Dual::default(); y.len()];
    interpreter.rhs_with(Dual::default(), &y, &torques[..interpreter.n_inputs()], &mut dy);
    move |name| dy[names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{name} of {names:?}"))]
}

/// The motion near the upright one at speed `v`: derivatives of `(lean'', steer'')` by lean, steer, their rates, and
/// the torques on lean and steer.
fn linearised(scene: &BuiltScene, v: f64) -> [[f64; 6]; 2] {
    let (sin, cos) = LAMBDA.sin_cos();
    let mut columns = [[0.0; 6]; 2];
    for k in 0..6 {
        let unit = |i: usize| f64::from(u8::from(i == k));
        let (lean, steer, lean_rate, steer_rate) = (unit(0), unit(1), unit(2), unit(3));
        // To first order the wheels make the bicycle turn with the yaw rate (v steer + c steer') cos(lambda)/w.
        let yaw_rate = (v * steer + C * steer_rate) * cos / W;
        let state = [
            ("steer", Dual::new(0.0, steer)),
            ("steer_dot", Dual::new(0.0, steer_rate)),
            ("Omega1", Dual::new(0.0, lean_rate * cos - yaw_rate * sin)),
            ("wR", Dual::new(-v / RR, 0.0)),
            ("Gamma1", Dual::new(-sin, 0.0)),
            ("Gamma2", Dual::new(0.0, lean)),
            ("Gamma3", Dual::new(cos, 0.0)),
        ];
        let torques = [Dual::new(0.0, unit(5)), Dual::new(0.0, unit(4))];
        let rate = rates(scene, &state, torques);
        assert!((rate("Gamma2").derivative - lean_rate).abs() < 1e-13, "{:?}", rate("Gamma2"));
        let steer_acceleration = rate("steer_dot").derivative;
        let yaw_acceleration = (v * steer_rate + C * steer_acceleration) * cos / W;
        columns[0][k] = (rate("Omega1").derivative + yaw_acceleration * sin) / cos;
        columns[1][k] = steer_acceleration;
        // Speed and pitch keep their values to first order.
        assert!(rate("wR").derivative.abs() < 1e-12 && rate("wR").value.abs() < 1e-12);
    }
    columns
}

#[test]
fn the_linearised_equations_are_those_of_the_benchmark() {
    let scene = built("ridden");
    let [m, c1, k0, k2] = benchmark();
    for v in [0.0, 1.0, 4.6, 9.0] {
        let found = linearised(&scene, v);
        for i in 0..2 {
            let times_mass = |k: usize| m[i][0] * found[0][k] + m[i][1] * found[1][k];
            for j in 0..2 {
                let stiffness = G * k0[i][j] + v * v * k2[i][j];
                // Sums of three terms of up to 7000 (v = 9), of which M multiplies rounding.
                let close = |what: &str, found: f64, expected: f64, size: f64| {
                    assert!(
                        (found - expected).abs() <= 1e-13 * size,
                        "{what} {i}{j} at {v}: {found}, not {expected}"
                    );
                };
                let size = G * 80.95 + v * v * 76.6;
                close("K", times_mass(j), -stiffness, size);
                close("C", times_mass(2 + j), -v * c1[i][j], (1.0 + v) * 33.9);
                close("M", times_mass(4 + j), f64::from(u8::from(i == j)), 10.0);
            }
        }
    }
}

/// Coefficients of `det(s^2 - s A - B) = s^4 + p s^3 + q s^2 + r s + t` of the motion near the upright one.
fn quartic(scene: &BuiltScene, v: f64) -> [f64; 4] {
    let [[b11, b12, a11, a12, ..], [b21, b22, a21, a22, ..]] = linearised(scene, v);
    [
        -a11 - a22,
        a11 * a22 - a12 * a21 - b11 - b22,
        a11 * b22 + a22 * b11 - a12 * b21 - a21 * b12,
        b11 * b22 - b12 * b21,
    ]
}

/// Real and imaginary part of the step of Newton's method from `s` to the nearest root of a quartic.
fn step_to_root([p, q, r, t]: [f64; 4], s: [f64; 2]) -> f64 {
    let times = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let horner = |coefficients: &[f64]| {
        coefficients.iter().fold([0.0, 0.0], |sum, c| {
            let moved = times(sum, s);
            [moved[0] + c, moved[1]]
        })
    };
    let value = horner(&[1.0, p, q, r, t]);
    let slope = horner(&[4.0, 3.0 * p, 2.0 * q, r]);
    value[0].hypot(value[1]) / slope[0].hypot(slope[1])
}

/// Table 2 of Meijaard et al. 2007: speed, weave (real and imaginary part; two real ones at rest), capsize, castering.
const EIGENVALUES: [[f64; 5]; 11] = [
    [0.0, 3.13164324790656, 0.0, -3.13164324790656, 5.53094371765393],
    [1.0, 3.52696170990070, 0.80774027519930, -3.13423125066578, -7.11008014637441],
    [2.0, 2.68234517512745, 1.68066296590675, -3.07158645641514, -8.67387984831735],
    [3.0, 1.70675605663975, 2.31582447384325, -2.63366137253667, -10.3510146724592],
    [4.0, 0.41325331521125, 3.07910818603206, -1.42944427361326, -12.15861426576447],
    [5.0, -0.77534188219585, 4.46486771378823, -0.32286642900409, -14.07838969279822],
    [6.0, -1.52644486584142, 5.87673060598709, -0.00406690076970, -16.08537123098026],
    [7.0, -2.13875644258362, 7.19525913329805, 0.10268170574766, -18.15788466125262],
    [8.0, -2.69348683581097, 8.46037971396931, 0.14327879765713, -20.27940894394569],
    [9.0, -3.21675402252485, 9.69377351531791, 0.15790184030917, -22.43788559040858],
    [10.0, -3.72016840437287, 10.90681139476287, 0.16105338653172, -24.62459635017404],
];

/// Digits of the table, and rounding of a motion whose coefficients grow with the square of the speed.
#[test]
fn eigenvalues_against_speed_are_those_of_table_2() {
    let scene = built("ridden");
    for [v, weave, frequency, capsize, castering] in EIGENVALUES {
        let quartic = quartic(&scene, v);
        for s in [[weave, frequency], [capsize, 0.0], [castering, 0.0]] {
            let off = step_to_root(quartic, s);
            assert!(off <= 2e-12 * (1.0 + s[0].abs()), "{s:?} at {v} m/s is off by {off:e}");
        }
    }
    // A pair on the imaginary axis, and an eigenvalue that vanishes.
    let hurwitz = |v: f64| {
        let [p, q, r, t] = quartic(&scene, v);
        p * q * r - r * r - p * p * t
    };
    let constant = |v: f64| quartic(&scene, v)[3];
    let changes = |f: &dyn Fn(f64) -> f64, v: f64| f(v - 2e-12).signum() != f(v + 2e-12).signum();
    assert!(changes(&hurwitz, 4.292382536341) && changes(&constant, 6.024262015388));
}

/// Values of a scene by name at a state: its outputs, energy and multipliers.
fn observed(scene: &BuiltScene, state: &[(&str, f64)]) -> impl Fn(&str) -> f64 + use<> {
    let params: Vec<f64> = scene.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let executable = scene.executable();
    let interpreter = executable.prepare(&params).unwrap();
    let value = |name: &String| state.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("{name}")).1;
    let y: Vec<f64> = scene.state_names().iter().map(value).collect();
    let values = interpreter.outputs(0.0, &y);
    let names: Vec<String> =
        scene.outputs().iter().flat_map(|o| &o.components).map(|(name, _)| name.clone()).collect();
    assert_eq!(names.len(), values.len(), "{names:?}");
    move |name| values[names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{name} of {names:?}"))]
}

/// Straight ahead at a constant speed the ground carries the weight, each wheel its share about the other, and nothing
/// acts along the ground or across.
#[test]
fn the_ground_carries_the_weight() {
    let scene = built("held");
    let (sin, cos) = LAMBDA.sin_cos();
    let down = [-sin, 0.0, cos];
    for v in [0.0, 5.0] {
        let state = [
            ("steer", 0.0),
            ("steer_dot", 0.0),
            ("Omega1", 0.0),
            ("wR", -v / RR),
            ("Gamma1", down[0]),
            ("Gamma2", down[1]),
            ("Gamma3", down[2]),
        ];
        let at = observed(&scene, &state);
        let lambda = |name: &str| at(&format!("lambda_{name}"));
        let weight = 94.0 * G;
        let rear = [1, 2, 3].map(|k| lambda(&format!("rear{k}")) - weight * down[k - 1]);
        let front = [("hub1", "rolling1"), ("hub2", "lateral"), ("hub3", "rolling2")];
        let front = front.map(|(hub, ground)| lambda(hub) + lambda(ground));
        let x_t = (0.3 * 85.0 + 0.9 * 4.0 + W * 3.0) / 94.0;
        let on_front = -weight * x_t / W;
        for k in 0..3 {
            let expected = on_front * down[k];
            assert!((front[k] - expected).abs() < 1e-10, "front {k} at {v}: {} not {expected}", front[k]);
            let expected = (-weight - on_front) * down[k];
            assert!((rear[k] - expected).abs() < 1e-10, "rear {k} at {v}: {} not {expected}", rear[k]);
        }
        // From the centre of the rear wheel.
        let below = [1, 2, 3].map(|k| at(&format!("contact_rear{k}")));
        let ahead = [1, 2, 3].map(|k| at(&format!("contact_front{k}")) - below[k - 1]);
        let wheelbase = [W * cos, 0.0, W * sin];
        for k in 0..3 {
            assert!((below[k] - RR * down[k]).abs() < 1e-15 && (ahead[k] - wheelbase[k]).abs() < 1e-15);
        }
        assert!((at("speed") - v).abs() < 1e-14 && at("lean").abs() < 1e-15);
    }
}

/// The rate of the energy along the motion, exactly, at states far from the upright one and at steer angle zero.
#[test]
fn the_energy_is_kept() {
    let scene = built("held");
    let params: Vec<Dual> =
        scene.params().iter().map(|p| Dual::new(rational_to_f64(&p.default), 0.0)).collect();
    let executable = scene.executable();
    let interpreter = executable.prepare_over(&params).unwrap();
    let names = scene.state_names();
    for (steer, lean) in [(0.0_f64, 0.3_f64), (0.0, -0.2), (0.7, 0.4), (-1.1, 0.1)] {
        let gamma = [-0.4 * lean.cos(), lean.sin(), (1.0 - 0.16_f64).sqrt() * lean.cos()];
        let value = |name: &String| match name.as_str() {
            "steer" => steer,
            "steer_dot" => 0.8,
            "Omega1" => -0.6,
            "wR" => -9.0,
            "Gamma1" => gamma[0],
            "Gamma2" => gamma[1],
            _ => gamma[2],
        };
        let y: Vec<Dual> = names.iter().map(|name| Dual::new(value(name), 0.0)).collect();
        let mut dy = vec![Dual::default(); y.len()];
        interpreter.rhs(Dual::default(), &y, &mut dy);
        let along: Vec<Dual> = y.iter().zip(&dy).map(|(y, dy)| Dual::new(y.value, dy.value)).collect();
        let energy = interpreter.energy(Dual::default(), &along).unwrap();
        assert!(energy.value.abs() > 100.0, "{energy:?}");
        assert!(energy.derivative.abs() < 1e-11 * energy.value.abs(), "{steer} {lean}: {energy:?}");
    }
}

/// The state of table 1, and a bound on operations, a fused pair counting as two, lean `pi/2 - psi`, pitch `phi - pi`,
/// steer `-psi_f`: their vertical is upwards.
#[test]
fn the_accelerations_are_those_of_basu_mandal() {
    let scene = built("moving");
    let counts = scene.program().function(&Role::Rate).unwrap().counts();
    assert!(counts.total() <= 579, "{} operations\n{}", counts.total(), scene.operation_columns());
    let lean = Dual::new(std::f64::consts::FRAC_PI_2 - 0.9501292851472, -0.6068425835418);
    let lean_rate = Dual::new(-0.6068425835418, 7.8555281128244);
    let pitch = Dual::new(std::f64::consts::PI - 3.1257073014894, 0.0119185528069);
    let pitch_rate = Dual::new(0.0119185528069, -0.1205543897884);
    let yaw_rate = Dual::new(-0.7830033527065, -0.8353281706379);
    let (sin, cos) = (hamel_runtime::Real::sin, hamel_runtime::Real::cos);
    let down = [-sin(pitch) * cos(lean), sin(lean), cos(pitch) * cos(lean)];
    let omega = [
        lean_rate * cos(pitch) + yaw_rate * down[0],
        pitch_rate + yaw_rate * down[1],
        lean_rate * sin(pitch) + yaw_rate * down[2],
    ];
    let (s, c) = (Dual::new(LAMBDA.sin(), 0.0), Dual::new(LAMBDA.cos(), 0.0));
    let in_frame = |a: [Dual; 3]| [c * a[0] - s * a[2], a[1], s * a[0] + c * a[2]];
    let (gamma, omega) = (in_frame(down), in_frame(omega));
    let value = |x: f64| Dual::new(x, 0.0);
    let state = [
        ("steer", value(-0.2311385135743)),
        ("steer_dot", value(-0.4859824687093)),
        ("Omega1", value(omega[0].value)),
        ("wR", value(-8.9129896614890 + omega[1].value)),
        ("Gamma1", value(gamma[0].value)),
        ("Gamma2", value(gamma[1].value)),
        ("Gamma3", value(gamma[2].value)),
    ];
    let rate = rates(&scene, &state, [Dual::default(); 2]);
    // Thirteen digits of a state, and of accelerations up to 8.
    let close = |what: &str, found: f64, expected: f64| {
        assert!(
            (found - expected).abs() <= 2e-12 * expected.abs().max(1.0),
            "{what}: {found}, not {expected}"
        );
    };
    for (k, name) in ["Gamma1", "Gamma2", "Gamma3"].into_iter().enumerate() {
        close(name, rate(name).value, gamma[k].derivative);
    }
    close("rear wheel", rate("wR").value, -1.8472554144217 + omega[1].derivative);
    close("steer", rate("steer_dot").value, 4.6198904039403);
    close("Omega1", rate("Omega1").value, omega[0].derivative);
}
