//! The nonholonomic leapfrog on the contact oscillator, whose implicit form is written by hand here.
//!
//! Deliberately does not know: generated code.

use hamel_runtime::{
    Dla, Error, Implicit, ImplicitInfo, ImplicitVariable, Integrator, Method, Options, System, Vern9,
};

/// Unit mass in a quadratic potential of the given stiffness, with `x' + y z' = 0`.
struct Contact {
    stiffness: f64,
}

const HARMONIC: Contact = Contact { stiffness: 1.0 };
/// Obeys the constraint.
const START: [f64; 6] = [0.9, 0.7, -0.4, -0.35, 0.3, 0.5];

impl Contact {
    fn accelerations(&self, [x, y, z, _, vy, vz]: [f64; 6]) -> ([f64; 3], f64) {
        let k = self.stiffness;
        let lambda = (k * (x + y * z) - vy * vz) / (1.0 + y * y);
        ([lambda - k * x, -k * y, y * lambda - k * z], lambda)
    }

    fn energy(&self, [x, y, z, vx, vy, vz]: [f64; 6]) -> f64 {
        0.5 * (vx * vx + vy * vy + vz * vz + self.stiffness * (x * x + y * y + z * z))
    }
}

impl System<f64> for Contact {
    type State = [f64; 6];

    fn rhs(&self, _t: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (a, _) = self.accelerations(*y);
        *dy = [y[3], y[4], y[5], a[0], a[1], a[2]];
    }
}

impl Implicit<f64> for Contact {
    type Variables = [f64; 10];

    const IMPLICIT: ImplicitInfo = ImplicitInfo::new(
        &[
            ImplicitVariable::new("x", "", true),
            ImplicitVariable::new("y", "", true),
            ImplicitVariable::new("z", "", true),
            ImplicitVariable::new("vx", "", true),
            ImplicitVariable::new("vy", "", true),
            ImplicitVariable::new("vz", "", true),
            ImplicitVariable::new("ax", "", false),
            ImplicitVariable::new("ay", "", false),
            ImplicitVariable::new("az", "", false),
            ImplicitVariable::new("lambda", "", false),
        ],
        1,
        &[0, 1, 2, 3, 4, 5],
    );

    fn consistent(&self, _t: f64, s: &[f64; 6]) -> [f64; 10] {
        let (a, lambda) = self.accelerations(*s);
        [s[0], s[1], s[2], s[3], s[4], s[5], a[0], a[1], a[2], lambda]
    }

    fn implicit_rhs(&self, _t: f64, v: &[f64; 10], f: &mut [f64; 10]) {
        let [x, y, z, vx, vy, vz, ax, ay, az, lambda] = *v;
        let k = self.stiffness;
        *f = [
            vx,
            vy,
            vz,
            ax,
            ay,
            az,
            lambda - k * x - ax,
            -k * y - ay,
            y * lambda - k * z - az,
            ax + y * az + vy * vz,
        ];
    }

    fn implicit_jacobian(&self, _t: f64, v: &[f64; 10], rows: &mut [[f64; 10]]) {
        let [_, y, _, _, vy, vz, _, _, az, lambda] = *v;
        let k = self.stiffness;
        for (i, row) in rows.iter_mut().enumerate() {
            *row = [0.0; 10];
            match i {
                0..6 => row[i + 3] = 1.0,
                6..9 => {
                    row[i - 6] = -k;
                    row[i] = -1.0;
                    row[9] = [1.0, 0.0, y][i - 6];
                    row[1] += [0.0, 0.0, lambda][i - 6];
                }
                _ => (row[1], row[4], row[5], row[6], row[8]) = (az, vz, vy, 1.0, y),
            }
        }
    }
}

fn moved<M: Method<f64, Contact>>(
    system: &Contact,
    method: M,
    start: [f64; 6],
    options: Options<f64>,
    t: f64,
) -> [f64; 6] {
    let mut solver = Integrator::new(system, method, 0.0, start, options).unwrap();
    solver.integrate_to(t).unwrap();
    *solver.state()
}

fn distance(a: [f64; 6], b: [f64; 6]) -> f64 {
    a.iter().zip(b).fold(0.0, |max, (a, b)| (a - b).abs().max(max))
}

fn constraint([_, y, _, vx, _, vz]: [f64; 6]) -> f64 {
    vx + y * vz
}

#[test]
fn both_are_of_order_two() {
    let end = moved(&HARMONIC, Vern9, START, Options::adaptive(1e-13, 1e-13), 4.0);
    for method in [Dla::new(), Dla::reflecting()] {
        let error = |h: f64| distance(moved(&HARMONIC, method, START, Options::fixed(h), 4.0), end);
        let ratio = error(1.0 / 32.0) / error(1.0 / 64.0);
        assert!((ratio - 4.0).abs() < 0.2, "{method:?}: {ratio}");
    }
}

#[test]
fn reversed_velocities_lead_back() {
    let reversed = |[x, y, z, vx, vy, vz]: [f64; 6]| [x, y, z, -vx, -vy, -vz];
    for method in [Dla::new(), Dla::reflecting()] {
        // Long steps: nothing but symmetry leads back.
        let there = moved(&HARMONIC, method, START, Options::fixed(0.25), 5.0);
        // The mean of velocities obeys the constraint, not each: the method is asked to go on from its own states.
        let mut solver = Integrator::new(&HARMONIC, method, 0.0, START, Options::fixed(0.25)).unwrap();
        solver.integrate_to(5.0).unwrap();
        if method == Dla::new() {
            let back = moved(&HARMONIC, method, reversed(there), Options::fixed(0.25), 5.0);
            assert!(distance(reversed(back), START) < 1e-13, "{:e}", distance(reversed(back), START));
        } else {
            solver.integrate_to(0.0).unwrap();
            assert!(distance(*solver.state(), START) < 1e-13, "{:e}", distance(*solver.state(), START));
        }
    }
}

#[test]
fn the_constraint_is_kept_at_the_ends_or_by_the_means() {
    let mut at_ends = Integrator::new(&HARMONIC, Dla::new(), 0.0, START, Options::fixed(0.25)).unwrap();
    let mut worst: f64 = 0.0;
    while !at_ends.step_towards(100.0).unwrap().reached() {
        worst = worst.max(constraint(*at_ends.state()).abs());
    }
    assert!(worst < 1e-14, "{worst:e}");

    let largest = |h: f64| {
        let mut solver =
            Integrator::new(&HARMONIC, Dla::reflecting(), 0.0, START, Options::fixed(h)).unwrap();
        let mut largest: f64 = 0.0;
        while !solver.step_towards(20.0).unwrap().reached() {
            largest = largest.max(constraint(*solver.state()).abs());
        }
        largest
    };
    let ratio = largest(1.0 / 32.0) / largest(1.0 / 64.0);
    assert!((ratio - 4.0).abs() < 0.4, "{ratio}");
}

#[test]
fn reflection_keeps_the_energy_of_free_motion() {
    let free = Contact { stiffness: 0.0 };
    let energy = free.energy(START);
    let drift = |method: Dla| {
        let end = moved(&free, method, START, Options::fixed(0.25), 100.0);
        (free.energy(end) / energy - 1.0).abs()
    };
    assert!(drift(Dla::reflecting()) < 1e-13, "{:e}", drift(Dla::reflecting()));
    assert!(drift(Dla::new()) > 1e-6, "{:e}", drift(Dla::new()));
}

#[test]
fn the_energy_stays_near_over_many_steps() {
    let energy = HARMONIC.energy(START);
    let mut solver = Integrator::new(&HARMONIC, Dla::new(), 0.0, START, Options::fixed(0.1)).unwrap();
    let mut worst = |steps: u32| {
        let mut worst: f64 = 0.0;
        for _ in 0..steps {
            let _ = solver.step_towards(1e9).unwrap();
            worst = worst.max((HARMONIC.energy(*solver.state()) / energy - 1.0).abs());
        }
        worst
    };
    let early = worst(5_000);
    let late = worst(95_000);
    // A drift would make it twenty times as much.
    assert!(late < 1.5 * early, "{early:e}, {late:e}");
}

#[test]
fn a_state_that_violates_the_constraint_is_refused() {
    let start = [0.9, 0.7, -0.4, 0.0, 0.3, 0.5];
    let mut solver = Integrator::new(&HARMONIC, Dla::new(), 0.0, start, Options::fixed(0.1)).unwrap();
    let error = solver.integrate_to(1.0).unwrap_err();
    assert!(matches!(error, Error::Form { method: "dla", .. }), "{error}");
    assert!(error.to_string().contains("an initial state that obeys them"), "{error}");
}
