//! Whipple's bicycle against its published benchmarks: the linearised equations of Meijaard, Papadopoulos, Ruina and
//! Schwab 2007 by the formulas of their appendix A, and the nonlinear accelerations of Basu-Mandal, Chatterjee and
//! Papadopoulos 2007, table 1.
//!
//! Deliberately does not know: how the equations are derived.

use hamel_codegen::expr::rational_to_f64;
use hamel_codegen::program::Role;
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_runtime::Dual;

const LAMBDA: f64 = std::f64::consts::PI / 10.0;
const W: f64 = 1.02;
const C: f64 = 0.08;
const G: f64 = 9.81;
const RR: f64 = 0.3;

type Matrix = [[f64; 2]; 2];

fn built(name: &str) -> BuiltScene {
    let text = include_str!("bicycle/whipple_bicycle.hamel");
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
            ("sR", Dual::new(-v / RR, 0.0)),
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
        assert!(rate("sR").derivative.abs() < 1e-12 && rate("sR").value.abs() < 1e-12);
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

/// The state of table 1, and a bound on operations, a fused pair counting as two, lean `pi/2 - psi`, pitch `phi - pi`,
/// steer `-psi_f`: their vertical is upwards.
#[test]
fn the_accelerations_are_those_of_basu_mandal() {
    let scene = built("moving");
    let counts = scene.program.function(&Role::Rate).unwrap().counts();
    assert!(counts.total() <= 965, "{} operations\n{}", counts.total(), scene.operation_columns());
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
        ("sR", value(-8.9129896614890)),
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
    close("rear wheel", rate("sR").value, -1.8472554144217);
    close("steer", rate("steer_dot").value, 4.6198904039403);
    close("Omega1", rate("Omega1").value, omega[0].derivative);
}
