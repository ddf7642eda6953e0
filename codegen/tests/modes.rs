//! Modes: constraints that hold at some times, impacts and conditions, beside computations of their own that know the
//! motions between events in the coordinates that each has.
//!
//! `modes/module.rs` is the module of a rod that is dropped. Write it again with
//! `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main modes`.

use std::ops::ControlFlow;

use expect_test::expect_file;
use hamel_codegen::scene::{self, BuiltScene, Writing};
use hamel_codegen::spec;
use hamel_runtime::{Action, Dop853, Events, Integrator, Options, Scene, System};

/// The module, as a crate has it.
mod module {
    include!("modes/module.rs");
}

const ROD: &str = include_str!("../../docs/book/falling_rod.hamel");
const COMPASS: &str = include_str!("../../docs/book/compass.hamel");

fn build(text: &str) -> BuiltScene {
    let model = spec::parse("modes.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, "default").unwrap_or_else(|e| panic!("{e}"))
}

/// A fixed step of fourth order.
fn rk4<const N: usize>(f: &impl Fn(&[f64; N]) -> [f64; N], y: &[f64; N], h: f64) -> [f64; N] {
    let moved = |k: &[f64; N], by: f64| std::array::from_fn(|i| y[i] + by * k[i]);
    let k1 = f(y);
    let k2 = f(&moved(&k1, h / 2.0));
    let k3 = f(&moved(&k2, h / 2.0));
    let k4 = f(&moved(&k3, h));
    std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
}

/// Goes on until `g` changes its sign to positive, or for a time: the time that has passed.
fn until<const N: usize>(
    f: impl Fn(&[f64; N]) -> [f64; N],
    y: &mut [f64; N],
    g: impl Fn(&[f64; N]) -> f64,
    longest: f64,
) -> f64 {
    let (h, mut t) = (2e-4, 0.0);
    while t < longest {
        let step = f64::min(h, longest - t);
        let next = rk4(&f, y, step);
        if g(&next) <= 0.0 || g(y) > 0.0 {
            (*y, t) = (next, t + step);
            continue;
        }
        let (mut before, mut after) = (0.0, step);
        for _ in 0..60 {
            let middle = 0.5 * (before + after);
            if g(&rk4(&f, y, middle)) > 0.0 {
                after = middle;
            } else {
                before = middle;
            }
        }
        *y = rk4(&f, y, after);
        return t + after;
    }
    t
}

#[test]
fn the_module_is_the_one_that_was_compiled() {
    let command = "UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main modes #".to_owned();
    let writing = Writing { command: Some(command), ..Writing::default() };
    expect_file!["modes/module.rs"].assert_eq(&build(ROD).emit_as(&writing).unwrap());
}

#[test]
fn emitted_modes_have_the_bits_of_the_interpreter() {
    let built = build(ROD);
    let names: Vec<&str> = built.events().iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["lift", "slip_left", "slip_right", "touch", "stops", "flat"]);
    let params = [1.3, 0.9, 9.7, 0.27];
    let (interpreter, compiled) =
        (built.prepare(&params).unwrap(), module::Prepared::prepare(&params).unwrap());
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let mut followed = 0;
    for seed in 0..200 {
        let x = f64::from(seed);
        let on = |k: i32| f64::from(seed >> k & 1);
        let wave = |a: f64| (a * x + a).sin();
        let y = [
            wave(0.7),
            wave(1.1),
            wave(0.3),
            2.0 * wave(1.7),
            wave(2.3),
            3.0 * wave(1.3),
            2.0 * on(3) - 1.0,
            on(0),
            on(1),
        ];
        let t = 0.1 * x;
        let (mut dy, mut other) = ([0.0; 9], [0.0; 9]);
        System::rhs(&compiled, t, &y, &mut dy);
        interpreter.rhs(t, &y, &mut other);
        assert_eq!(bits(&dy), bits(&other));
        assert_eq!(bits(&compiled.event_values(t, &y)), bits(&interpreter.events(t, &y).unwrap()));
        for k in 0..built.events().len() {
            let (mut own, mut other) = (y, y);
            let action = compiled.event_apply(k, t, &mut own);
            let done = interpreter.apply(built.events(), k, t, &mut other);
            assert_eq!(bits(&own), bits(&other), "{} and {done:?}", names[k]);
            assert_eq!(done[0], k);
            let stops = done.iter().any(|k| built.events()[*k].stops);
            let expected = match (names[k], stops) {
                ("flat", _) => Action::Stop,
                (_, false) => Action::Restart,
                (_, true) => Action::ChangeAndStop,
            };
            assert_eq!(action, expected);
            // A condition follows where the event before has made it true, each once.
            for (place, follower) in done.iter().enumerate().skip(1) {
                assert!(["lift", "slip_left", "slip_right"].contains(&names[*follower]));
                assert!(!done[..place].contains(follower));
                followed += 1;
            }
        }
    }
    assert!(followed > 50, "{followed} conditions followed");
}

/// The rod in the coordinates of each phase: falling, turning about its end, sliding with Coulomb's friction.
#[test]
fn a_rod_that_is_dropped_grips_and_slides_as_its_phases_by_hand() {
    let (l, g, mu) = (1.0_f64, 9.81_f64, 0.3_f64);
    let inertia = l * l / 12.0;
    // Free fall until the end meets the ground.
    let (w0, a0) = (-1.0_f64, 0.3_f64);
    let mut fall = [1.0, 0.0, a0];
    let t_touch = until(|y| [y[1], -g, w0], &mut fall, |y| -(y[0] - 0.5 * l * y[2].cos()), 1.0);
    // Angular momentum about the end is kept.
    let (z, vz, a) = (fall[0], fall[1], fall[2]);
    let foot = -0.5 * l * a.sin();
    let lever = -foot;
    let moment = inertia * w0 - lever * vz;
    let w = moment / (inertia + 0.25 * l * l);
    assert!((z - 0.5 * l * a.cos()).abs() < 1e-12);
    // Turning about the end: the forces that hold it, per mass.
    let turning = |y: &[f64; 2]| 1.5 * g / l * y[0].sin();
    let forces = |y: &[f64; 2]| {
        let (s, c, e) = (y[0].sin(), y[0].cos(), turning(y));
        let along = 0.5 * l * (c * e - s * y[1] * y[1]);
        (along, g - 0.5 * l * (s * e + c * y[1] * y[1]))
    };
    let mut grip = [a, w];
    let slips = |y: &[f64; 2]| forces(y).0.abs() - mu * forces(y).1;
    let t_slip = t_touch + until(|y| [y[1], turning(y)], &mut grip, slips, 1.0);
    let pushes_right = forces(&grip).0 > 0.0;
    assert!(!pushes_right);
    // Sliding: place of the end, angle, and their rates; friction `side mu N` along the ground.
    let sliding = |side: f64| {
        move |y: &[f64; 4]| {
            let (s, c) = (y[1].sin(), y[1].cos());
            // N = g - l/2 (s e + c w^2), inertia e = N l/2 s - side mu N l/2 c.
            let arm = 0.5 * l * (s - side * mu * c);
            let normal = (g - 0.5 * l * c * y[3] * y[3]) / (1.0 + 0.5 * l * s * arm / inertia);
            let e = normal * arm / inertia;
            let centre = side * mu * normal;
            [y[2], y[3], centre - 0.5 * l * (c * e - s * y[3] * y[3]), e]
        }
    };
    let mut slide = [foot, grip[0], 0.0, grip[1]];
    // It begins to move with the first step.
    let t_stop = t_slip + until(sliding(-1.0), &mut slide, |y| if y[2] < 0.0 { 1.0 } else { -1.0 }, 1.0);
    let t_end = 1.2;
    let _ = until(sliding(1.0), &mut slide, |_| -1.0, t_end - t_stop);

    let rod = module::Prepared::prepare(&[1.0, l, g, mu]).unwrap();
    let start = [0.0, 1.0, a0, 0.0, 0.0, w0, 0.0, 0.0, 0.0];
    let mut solver = Integrator::new(&rod, Dop853, 0.0, start, Options::adaptive(1e-12, 1e-12)).unwrap();
    let _ = solver.integrate_through_events(t_end, |_| ControlFlow::Continue(())).unwrap();
    let y = solver.state();
    let (s, c) = (y[2].sin(), y[2].cos());
    let own = [y[0] - 0.5 * l * s, y[2], y[3] - 0.5 * l * c * y[5], y[5]];
    assert_eq!(y[6..], [1.0, 1.0, 0.0], "it slides to the left at the end");
    for (own, by_hand) in own.iter().zip(slide) {
        assert!((own - by_hand).abs() < 2e-9, "{own:?} beside {by_hand:?}");
    }
    assert!((y[1] - 0.5 * l * c).abs() < 1e-10, "the end stays on the ground");
}

/// Rates of both legs of the compass gait, the first of which stands, in angles from the normal of the slope.
fn swing(y: &[f64; 4]) -> [f64; 4] {
    let (m, big, a, b, g, slope) = (5.0, 10.0, 0.5, 0.5, 9.81, 0.05235987755982988);
    let l = a + b;
    let [s, n, ds, dn] = *y;
    let (mass, cross) = ((big + m) * l * l + m * a * a, -m * l * b * (s - n).cos());
    let own = m * b * b;
    let turn = m * l * b * (s - n).sin();
    let force_s = turn * dn * dn + g * (big * l + m * a + m * l) * (s + slope).sin();
    let force_n = -turn * ds * ds - g * m * b * (n + slope).sin();
    let det = mass * own - cross * cross;
    [ds, dn, (own * force_s - cross * force_n) / det, (mass * force_n - cross * force_s) / det]
}

/// One step of the compass gait in the angles of both legs, by angular momenta about the new foot and of the leg that
/// leaves the ground about the hip; rates in, rates out, with the time that it took.
fn step(y: &mut [f64; 4]) -> f64 {
    let (m, big, a, b) = (5.0, 10.0, 0.5, 0.5);
    let (l, f) = (a + b, swing);
    // The swinging leg passes the other one, then its foot meets the ground.
    let t = until(f, y, |y| y[0] - y[1], 2.0) + until(f, y, |y| y[0] + y[1], 2.0);
    let [s, n, ds, dn] = *y;
    let (rot, turned) = (|x: f64| [x.sin(), x.cos()], |x: f64| [x.cos(), -x.sin()]);
    let cross = |u: [f64; 2], v: [f64; 2]| u[0] * v[1] - u[1] * v[0];
    let sum = |u: [f64; 2], k: f64, v: [f64; 2]| [u[0] + k * v[0], u[1] + k * v[1]];
    // Places from the new foot.
    let hip = sum([0.0; 2], l, rot(n));
    let (old, new) = (sum(hip, -b, rot(s)), sum([0.0; 2], a, rot(n)));
    let momenta = |hip_v: [f64; 2], old_v: [f64; 2], new_v: [f64; 2]| {
        let all = big * cross(hip, hip_v) + m * (cross(old, old_v) + cross(new, new_v));
        let leg = m * cross(sum(old, -1.0, hip), old_v);
        [all, leg]
    };
    let hip_v = sum([0.0; 2], l * ds, turned(s));
    let before = momenta(hip_v, sum(hip_v, -b * ds, turned(s)), sum(hip_v, -b * dn, turned(n)));
    let after = |x: f64, w: f64| {
        let hip_v = sum([0.0; 2], l * x, turned(n));
        momenta(hip_v, sum(hip_v, -b * w, turned(s)), sum([0.0; 2], a * x, turned(n)))
    };
    let (e1, e2) = (after(1.0, 0.0), after(0.0, 1.0));
    let det = e1[0] * e2[1] - e1[1] * e2[0];
    let x = (before[0] * e2[1] - before[1] * e2[0]) / det;
    let w = (e1[0] * before[1] - e1[1] * before[0]) / det;
    *y = [n, s, x, w];
    t
}

#[test]
fn a_compass_walks_as_its_legs_by_hand() {
    let built = build(COMPASS);
    let model = spec::parse("compass.hamel", COMPASS).unwrap();
    let params: Vec<f64> = [5.0, 10.0, 0.5, 0.5, 0.05235987755982988, 9.81].to_vec();
    let interpreter = built.prepare(&params).unwrap();
    let start = scene::initial_state(&model, &built).unwrap().unwrap();
    // Steps by hand until they repeat.
    let (mut legs, mut period) = ([-0.271, 0.271, 1.0918, 0.3772], 0.0);
    for _ in 0..60 {
        period = step(&mut legs);
    }
    // Two independent computations, this one and scipy's with the moments of momentum solved by Newton, give this.
    assert!((period - 0.734346391).abs() < 2e-9, "{period}");
    // The same four steps, and a part of the fifth.
    let mut legs = [start[2], start[3], start[6], start[7]];
    let mut t: f64 = (0..4).map(|_| step(&mut legs)).sum();
    let _ = until(swing, &mut legs, |_| -1.0, 0.3);
    t += 0.3;
    let mut y = start.clone();
    let mut time = 0.0;
    // A fixed step and the events by bisection, with the interpreter alone.
    let h = 1e-4;
    let rates = |y: &[f64]| {
        let mut dy = vec![0.0; y.len()];
        interpreter.rhs(0.0, y, &mut dy);
        dy
    };
    let moved = |y: &[f64], h: f64| {
        let add = |k: &[f64], by: f64| -> Vec<f64> { y.iter().zip(k).map(|(y, k)| y + by * k).collect() };
        let k1 = rates(y);
        let k2 = rates(&add(&k1, h / 2.0));
        let k3 = rates(&add(&k2, h / 2.0));
        let k4 = rates(&add(&k3, h));
        let sum: Vec<f64> = (0..y.len()).map(|i| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0).collect();
        add(&sum, h)
    };
    let mut n_steps = 0;
    while time < t {
        let step = f64::min(h, t - time);
        let (before, next) = (interpreter.events(0.0, &y).unwrap(), moved(&y, step));
        let after = interpreter.events(0.0, &next).unwrap();
        let found = (0..before.len()).find(|k| before[*k] < 0.0 && after[*k] >= 0.0);
        let Some(event) = found else {
            (y, time) = (next, time + step);
            continue;
        };
        let (mut low, mut high) = (0.0, step);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let value = interpreter.events(0.0, &moved(&y, middle)).unwrap()[event];
            if value >= 0.0 { high = middle } else { low = middle }
        }
        (y, time) = (moved(&y, high), time + high);
        let _ = interpreter.apply(built.events(), event, 0.0, &mut y);
        n_steps += usize::from(built.events()[event].name.starts_with("step"));
    }
    assert_eq!(n_steps, 4);
    for (k, by_hand) in [2, 3, 6, 7].into_iter().zip(legs) {
        assert!((y[k] - by_hand).abs() < 1e-9, "{} beside {by_hand}", y[k]);
    }
}

/// A disk that bounces, and a hoop that is caught: what comes back of the velocity along a constraint, and what does
/// not along it.
#[test]
fn impacts_give_back_what_they_say_and_keep_the_rest() {
    let built = build(
        "model disk {
            param m = 2 where m > 0; param r = 0.5 where r > 0; param e = 0.6;
            coordinate x, z in real; coordinate phi in angle;
            lagrangian = m*(x_dot^2 + z_dot^2)/2 + m*r^2*phi_dot^2/4 - m*9.81*z;
            mode rolling { constraint roll: x_dot = r*phi_dot; }
            mode ground { constraint hold: z = r; }
            event bounce = z - r falling { impact ground with e; enter rolling; }
        }",
    );
    let (m, r, e) = (1.7, 0.4, 0.35);
    let interpreter = built.prepare(&[m, r, e]).unwrap();
    // x, z, phi, their rates, rolling, ground.
    let mut y = [0.3, r, 0.1, 2.0, -3.0, 1.5, 0.0, 0.0];
    assert_eq!(interpreter.apply(built.events(), 0, 0.0, &mut y), [0]);
    // The moment of momentum about the contact is kept: m r x' + m r^2 phi'/2.
    let spin = (2.0 + r * 1.5 / 2.0) / (1.5 * r);
    assert!((y[5] - spin).abs() < 1e-14 && (y[3] - r * spin).abs() < 1e-14, "{y:?}");
    assert!((y[4] - 3.0 * e).abs() < 1e-14);
    assert_eq!(y[6..], [1.0, 0.0], "it rolls, and the ground does not hold it");
}

#[test]
fn loops_declare_modes_with_their_multipliers() {
    let built = build(
        "model feet {
            size n = 2;
            coordinate z: vector(n) in real;
            lagrangian = sum(k*z_dot[k]^2/2 - 9*k*z[k] for k in 1..n);
            for k in 1..n {
                mode down[k] { constraint hold[k]: z[k] = 0; event lift[k] when lambda_hold[k] < 1; }
                event touch[k] = z[k] falling { enter down[k]; }
            }
        }",
    );
    let interpreter = built.prepare(&[]).unwrap();
    // Both hold what lies on them; an event in a mode that is off has the value one.
    assert_eq!(interpreter.events(0.0, &[0.0, 0.5, 0.0, 0.0, 1.0, 0.0]).unwrap(), [8.0, 1.0, 1.0, 0.5]);
    assert_eq!(interpreter.events(0.0, &[0.2, 0.0, 0.0, 0.0, 0.0, 1.0]).unwrap(), [1.0, 0.2, 17.0, 1.0]);
}

/// A Chaplygin sleigh whose blade holds a force at most: it goes on straight from there, and turns as it did.
#[test]
fn a_sleigh_lets_go_at_its_largest_force() {
    let text = "model sleigh {
        param m = 1 where m > 0; param I = 0.2 where I > 0; param a = 0.3; param F = 0.5;
        velocity omega, v in se(2);
        reconstruct phi, x, y in SE(2);
        lagrangian = m*((v1 - 0)^2 + (v2 + a*omega)^2)/2 + I*omega^2/2;
        mode blade {
            constraint hold: v2 = 0;
            event gives_way when F < lambda_hold { leave blade; }
            event gives_way_too when F < -lambda_hold { leave blade; }
        }
        initial omega = 2; initial v1 = 0.05; initial blade = 1;
        scene free { want rhs, events, multipliers, energy; }
    }";
    let model = spec::parse("sleigh.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "free").unwrap_or_else(|e| panic!("{e}"));
    let (m, inertia, a, force) = (1.0, 0.2, 0.3, 0.5);
    let interpreter = built.prepare(&[m, inertia, a, force]).unwrap();
    for seed in 1..20 {
        let (w, v) = ((1.3 * f64::from(seed)).sin() * 2.0, (0.7 * f64::from(seed)).cos());
        let y = [w, v, 0.0, 1.0];
        // (I + m a^2) w' = -m a w v, v' = a w^2: the blade pushes along what its motion asks for.
        let turning = -m * a * w * v / (inertia + m * a * a);
        let push = m * (w * v + a * turning);
        let mut dy = [0.0; 4];
        interpreter.rhs(0.0, &y, &mut dy);
        assert!((dy[0] - turning).abs() < 1e-14 && (dy[1] - a * w * w).abs() < 1e-14, "{dy:?}");
        let values = interpreter.events(0.0, &y).unwrap();
        assert!((values[0] - (force - push)).abs() < 1e-13, "{values:?} at a push of {push}");
        assert!((values[1] - (force + push)).abs() < 1e-13, "{values:?} at a push of {push}");
        // Free: nothing acts on the mass centre, which sees v1 and v2 + a w turn.
        let free = [w, v, 0.4, 0.0];
        interpreter.rhs(0.0, &free, &mut dy);
        assert!(
            dy[0].abs() < 1e-14 && (dy[1] - w * (0.4 + a * w)).abs() < 1e-14 && (dy[2] + w * v).abs() < 1e-14
        );
        // Conditions of a mode that is off are not watched for.
        assert_eq!(interpreter.events(0.0, &free).unwrap(), [1.0, 1.0]);
    }
}
