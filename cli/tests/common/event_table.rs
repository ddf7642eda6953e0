//! Motions with events, and what has to come out: by closed forms of the motion between events, on a fine grid with
//! bisection. Nothing of hamel is used.

/// A motion from time zero.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    /// What stands in the braces of the model.
    pub(crate) model: &'static str,
    pub(crate) initial: Vec<(&'static str, f64)>,
    pub(crate) t_final: f64,
    /// Names and times of the events.
    pub(crate) events: Vec<(&'static str, f64)>,
    pub(crate) end: End,
}

/// How it ends.
pub(crate) enum End {
    /// At the final time, with this state.
    Reached(Vec<f64>),
    /// By an event.
    By(&'static str),
    /// In an error: events accumulate at this time.
    Accumulates(f64),
}

/// The motion without events, from a state over a time, in closed form.
type Flow<const N: usize> = fn(f64, [f64; N]) -> [f64; N];

/// An event of an own loop.
struct Own<const N: usize> {
    name: &'static str,
    function: fn(f64, &[f64; N]) -> f64,
    /// 1 where it rises, -1 where it falls, 0 both.
    direction: i32,
    /// What it does.
    then: fn(&mut [f64; N]),
}

/// Parts of the grid in a unit of time: short beside every flight and period of the cases.
const GRID: f64 = 2000.0;

/// Events within this time are at one time.
const TOGETHER: f64 = 1e-11;

/// Moves from time zero: the events, and the last state. Functions of one direction that are zero at the start have
/// their events there where they are beyond zero right after.
fn moved<const N: usize>(
    flow: Flow<N>,
    events: &[Own<N>],
    start: [f64; N],
    t_final: f64,
) -> (Vec<(&'static str, f64)>, [f64; N]) {
    let (sign, mut told) = (t_final.signum(), Vec::new());
    let (mut t, mut y) = (0.0, start);
    let is_change = |own: &Own<N>, a: f64, b: f64| {
        own.direction >= 0 && a < 0.0 && b >= 0.0 || own.direction <= 0 && a > 0.0 && b <= 0.0
    };
    // Which functions start a stretch at zero, up to rounding.
    let mut at_zero: Vec<bool> = events.iter().map(|own| (own.function)(0.0, &y) == 0.0).collect();
    let beyond = |own: &Own<N>, y: &[f64; N]| {
        let soon = 1e-7 * sign;
        f64::from(own.direction) * (own.function)(soon, &flow(soon, *y)) > 0.0
    };
    let first: Vec<usize> = (0..events.len()).filter(|k| at_zero[*k] && beyond(&events[*k], &y)).collect();
    for k in first {
        told.push((events[k].name, 0.0));
        (events[k].then)(&mut y);
    }
    'stretch: loop {
        let mut n = 0.0;
        loop {
            let s = |n: f64| {
                let s = sign * n / GRID;
                if (t + s).abs() >= t_final.abs() { t_final - t } else { s }
            };
            let (a, b) = (s(n), s(n + 1.0));
            if a == b {
                return (told, flow(a, y));
            }
            let value = |own: &Own<N>, s: f64| (own.function)(t + s, &flow(s, y));
            let mut found: Vec<(usize, f64)> = Vec::new();
            for (k, own) in events.iter().enumerate() {
                // A function that starts at zero has its first value a little later.
                let from = if n == 0.0 && at_zero[k] { 1e-3 * b } else { a };
                let (before, after) = (value(own, from), value(own, b));
                if is_change(own, before, after) {
                    let (mut low, mut high) = (from, b);
                    for _ in 0..60 {
                        let middle = 0.5 * (low + high);
                        if is_change(own, before, value(own, middle)) { high = middle } else { low = middle }
                    }
                    found.push((k, high));
                }
            }
            let Some(earliest) = found.iter().map(|(_, s)| s.abs()).reduce(f64::min) else {
                n += 1.0;
                continue;
            };
            let there = flow(sign * earliest, y);
            t += sign * earliest;
            y = there;
            at_zero = vec![false; events.len()];
            for (k, own) in events.iter().enumerate() {
                let is_due = found.iter().any(|(other, s)| *other == k && s.abs() - earliest < TOGETHER);
                if is_due && (own.function)(t, &y).abs() < 1e-9 {
                    told.push((own.name, t));
                    (own.then)(&mut y);
                    at_zero[k] = true;
                }
            }
            continue 'stretch;
        }
    }
}

fn reached<const N: usize>(last: [f64; N]) -> End {
    End::Reached(last.to_vec())
}

const G: f64 = 9.81;
/// Square of the frequency in the corner.
const W2: f64 = 0.3;

fn falls(t: f64, [z, v]: [f64; 2]) -> [f64; 2] {
    [z + v * t - 0.5 * G * t * t, v - G * t]
}

fn drifts(t: f64, [x, v]: [f64; 2]) -> [f64; 2] {
    [x + v * t, v]
}

fn swings(t: f64, [x, y, v, w]: [f64; 4]) -> [f64; 4] {
    let w1 = W2.sqrt();
    let (s, c) = (w1 * t).sin_cos();
    [c * x + s * v / w1, c * y + s * w / w1, c * v - s * w1 * x, c * w - s * w1 * y]
}

const BALL: &str = "param e = 1; param g = 9.81; coordinate z in real; lagrangian = z_dot^2/2 - g*z;
    event impact = z falling { then z_dot = -e*z_dot; }";

const CORNER: &str = "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2 - 0.3*(x^2 + y^2)/2;
    event right = x - 1 rising { then x_dot = -x_dot; } event up = y - 3 rising { then y_dot = -y_dot; }";

/// All cases.
pub(crate) fn cases() -> Vec<Case> {
    let bounce = Own::<2> { name: "impact", function: |_, y| y[0], direction: -1, then: |y| y[1] = -y[1] };
    let bounces = [bounce];
    let mut cases = Vec::new();
    let mut add = |name, model, initial: &[(&'static str, f64)], t_final, (events, end)| {
        cases.push(Case { name, model, initial: initial.to_vec(), t_final, events, end });
    };
    let walls = [
        Own::<4> { name: "right", function: |_, y| y[0] - 1.0, direction: 1, then: |y| y[2] = -y[2] },
        Own::<4> { name: "up", function: |_, y| y[1] - 3.0, direction: 1, then: |y| y[3] = -y[3] },
    ];
    let corner = |x: f64| [("x", 0.1), ("y", 0.3), ("x_dot", x), ("y_dot", 3.0 * x)];
    // Several speeds into the corner, each with other roundings.
    for (name, speed) in [("corner", 1.08), ("corner, faster", 1.37), ("corner, fastest", 2.2)] {
        let (events, last) = moved(swings, &walls, [0.1, 0.3, speed, 3.0 * speed], 3.0);
        add(name, CORNER, &corner(speed), 3.0, (events, reached(last)));
    }
    let (events, _) = moved(swings, &walls, [0.1, 0.3, 1.08, 3.24], 1.0);
    let (events, by) = (vec![("up", events[0].1), ("right", events[0].1)], End::By("up"));
    let stops = "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2 - 0.3*(x^2 + y^2)/2;
        event up = y - 3 rising { stop; } event right = x - 1 rising { then x_dot = -x_dot; }";
    add("corner, where one wall stops", stops, &corner(1.08), 3.0, (events, by));

    // The first event takes the place away from where the second one is, and leaves that of the third.
    let moves = "coordinate x, y in real; lagrangian = (x_dot^2 + y_dot^2)/2;
        event one = x - 1 rising { then y = -5; } event two = y - 1 rising { then y_dot = 9; }
        event three = x - 1 rising;";
    let start = [("x", 0.0), ("y", 0.0), ("x_dot", 1.0), ("y_dot", 1.0)];
    let end = End::Reached(vec![2.0, -4.0, 1.0, 1.0]);
    add("an event moved away by another", moves, &start, 2.0, (vec![("one", 1.0), ("three", 1.0)], end));

    let oscillating = "coordinate x in real; lagrangian = x_dot^2/2; event e = sin(pi*x);";
    let function: fn(f64, &[f64; 2]) -> f64 = |_, y| (std::f64::consts::PI * y[0]).sin();
    let own = [Own::<2> { name: "e", function, direction: 0, then: |_| {} }];
    let (events, last) = moved(drifts, &own, [0.5, 17.0], 9.99);
    assert_eq!(events.len(), 170);
    add("170 crossings", oscillating, &[("x", 0.5), ("x_dot", 17.0)], 9.99, (events, reached(last)));
    let (events, last) = moved(drifts, &own, [0.5, 17.0], -9.99);
    add(
        "170 crossings backward",
        oscillating,
        &[("x", 0.5), ("x_dot", 17.0)],
        -9.99,
        (events, reached(last)),
    );

    let clock = "coordinate x in real; lagrangian = x_dot^2/2 - x^2/2;
        event tick = sin(10*pi*t) rising { then x_dot = x_dot + 0.1; }";
    let swing = |t: f64, [x, v]: [f64; 2]| [t.cos() * x + t.sin() * v, t.cos() * v - t.sin() * x];
    let ticks = Own::<2> {
        name: "tick",
        function: |t, _| (10.0 * std::f64::consts::PI * t).sin(),
        direction: 1,
        then: |y| y[1] += 0.1,
    };
    let (events, last) = moved(swing, &[ticks], [1.0, 0.0], 4.9);
    // At the start, and 24 later on.
    assert_eq!(events.len(), 25);
    add("clock", clock, &[("x", 1.0), ("x_dot", 0.0)], 4.9, (events, reached(last)));

    let (events, last) = moved(falls, &bounces, [1.0, 0.0], 10.0);
    add("elastic ball", BALL, &[("z", 1.0), ("z_dot", 0.0)], 10.0, (events, reached(last)));
    let (events, last) = moved(falls, &bounces, [1.0, 0.0], -10.0);
    add("elastic ball backward", BALL, &[("z", 1.0), ("z_dot", 0.0)], -10.0, (events, reached(last)));
    let (events, last) = moved(falls, &bounces, [0.0, -3.0], 2.0);
    assert_eq!(events[0].1, 0.0);
    add("zero and falling at the start", BALL, &[("z", 0.0), ("z_dot", -3.0)], 2.0, (events, reached(last)));
    let (events, last) = moved(falls, &bounces, [0.0, 3.0], 2.0);
    assert!(events[0].1 > 0.5);
    add("zero and rising at the start", BALL, &[("z", 0.0), ("z_dot", 3.0)], 2.0, (events, reached(last)));
    let fall = (2.0 / G).sqrt();
    let part = |e: f64| fall * (1.0 + 2.0 * e / (1.0 - e));
    let lossy = "param g = 9.81; coordinate z in real; lagrangian = z_dot^2/2 - g*z;
        event impact = z falling { then z_dot = -0.8*z_dot; }";
    let start = [("z", 1.0), ("z_dot", 0.0)];
    add("accumulation", lossy, &start, 10.0, (Vec::new(), End::Accumulates(part(0.8))));
    let lossy = "param g = 9.81; coordinate z in real; lagrangian = z_dot^2/2 - g*z;
        event impact = z falling { then z_dot = -0.001*z_dot; }";
    add("fast accumulation", lossy, &start, 10.0, (Vec::new(), End::Accumulates(part(0.001))));
    let resting = "param g = 9.81; coordinate z in real; lagrangian = z_dot^2/2 - g*z;
        event impact = z falling { then z_dot = 0; }";
    add("rest", resting, &start, 10.0, (Vec::new(), End::Accumulates(fall)));
    let at_rest = [("z", 0.0), ("z_dot", 0.0)];
    add("rest from the start", BALL, &at_rest, 10.0, (Vec::new(), End::Accumulates(0.0)));
    let touching = [("z", 1e-300), ("z_dot", 0.0)];
    add("rest but for nothing", BALL, &touching, 10.0, (Vec::new(), End::Accumulates(0.0)));

    let held = "coordinate x in real; lagrangian = x_dot^2/2; event wall = x - 1 rising { then x_dot = 0; }";
    let end = End::Reached(vec![1.0, 0.0]);
    add("rest without a force", held, &[("x", 0.0), ("x_dot", 0.5)], 10.0, (vec![("wall", 2.0)], end));
    let passed = "coordinate x in real; lagrangian = x_dot^2/2;
        event line = x - 1 rising { then x_dot = 2*x_dot; }";
    let end = End::Reached(vec![9.0, 1.0]);
    add("a line that is passed", passed, &[("x", 0.0), ("x_dot", 0.5)], 10.0, (vec![("line", 2.0)], end));

    // A ground that holds until a force pulls stronger, and one that gives way as soon as it is met.
    let pulled = "coordinate z in real; lagrangian = z_dot^2/2 - 2*z; force z_dot = t;
        mode ground { constraint hold: z = 0; event lift when lambda_hold < 0 { leave ground; } }
        event touch = z falling { enter ground; }";
    let (start, end) =
        ([("z", 0.0), ("z_dot", 0.0), ("ground", 1.0)], End::Reached(vec![4.0 / 3.0, 2.0, 0.0]));
    add("a ground that lets go", pulled, &start, 4.0, (vec![("lift", 2.0)], end));
    let weak = "coordinate z in real; lagrangian = z_dot^2/2 - 2*z;
        mode ground {
            constraint hold: z = 0;
            event sink when lambda_hold < 3 { leave ground; enter mud; }
        }
        mode mud { constraint slow: z_dot = -0.5; }
        event touch = z falling { enter ground; }";
    let start = [("z", 1.0), ("z_dot", 0.0), ("ground", 0.0), ("mud", 0.0)];
    let (events, end) = (vec![("touch", 1.0), ("sink", 1.0)], End::Reached(vec![-1.0, -0.5, 0.0, 1.0]));
    add("a ground that gives way", weak, &start, 3.0, (events, end));
    // The ground gives half of the speed back: two impacts of one mode.
    let ball = "coordinate z in real; lagrangian = z_dot^2/2 - 2*z;
        mode ground { constraint hold: z_dot = 0; }
        event bounce = z falling { impact ground with 1/2; }";
    let start = [("z", 1.0), ("z_dot", 0.0), ("ground", 0.0)];
    // Down in one second, at a speed of two; up again with one, for a second.
    let (events, end) = (vec![("bounce", 1.0), ("bounce", 2.0)], End::Reached(vec![0.0625, 0.0, 0.0]));
    add("an impact that gives back half", ball, &start, 2.25, (events, end));

    // A disk of mass and radius one that is thrown along the ground, slides until it rolls, and rolls until a moment
    // that grows spins it: accelerations -1, 0.2 t, 1 of the mass centre, 2(0.3 t + 1), 0.2 t, 2(0.3 t - 1) of the
    // angle.
    let disk = "param mu = 0.5; param k = 0.3;
        coordinate x in real; coordinate phi in real;
        lagrangian = x_dot^2/2 + phi_dot^2/4;
        state side in real by side_dot = 0;
        mode rolling {
            constraint roll: x_dot = phi_dot;
            event spins when 2*mu < lambda_roll { then side = -1; leave rolling; }
        }
        force x_dot = -2*mu*side*(1 - rolling);
        force phi_dot = k*t + 2*mu*side*(1 - rolling);
        event rolls = side*(x_dot - phi_dot) falling { enter rolling; }";
    let start = [("x", 0.0), ("phi", 0.0), ("x_dot", 3.0), ("phi_dot", 0.0), ("side", 1.0), ("rolling", 0.0)];
    let (t1, t2, t3) = ((12.6_f64.sqrt() - 3.0) / 0.6, 5.0, 6.0);
    let (x, phi, v) = (3.0 * t1 - t1 * t1 / 2.0, 0.1 * t1.powi(3) + t1 * t1, 3.0 - t1);
    let rolled = v * (t2 - t1) + (t2.powi(3) - t1.powi(3)) / 30.0 - 0.1 * t1 * t1 * (t2 - t1);
    let (x, phi, v) = (x + rolled, phi + rolled, v + 0.1 * (t2 * t2 - t1 * t1));
    let (d, cube) = (t3 - t2, t3.powi(3) - t2.powi(3));
    let last = [
        x + v * d + d * d / 2.0,
        phi + v * d + 0.1 * cube - 7.5 * d - d * d,
        v + d,
        v + 0.3 * (t3 * t3 - t2 * t2) - 2.0 * d,
        -1.0,
        0.0,
    ];
    let events = vec![("rolls", t1), ("spins", t2)];
    add("a disk that rolls and slides", disk, &start, t3, (events, End::Reached(last.to_vec())));

    // A ball just above a height, for a ten thousandth of its flight on both sides of the top.
    let thrown = "param g = 9.81; coordinate z in real; lagrangian = z_dot^2/2 - g*z;
        event high = z - 4.90499995095;";
    // The grid is too coarse for it.
    let half = (2.0 * (0.5 * G - 4.904_999_950_95) / G).sqrt();
    let events = vec![("high", 1.0 - half), ("high", 1.0 + half)];
    add("a grazed height", thrown, &[("z", 0.0), ("z_dot", G)], 1.7, (events, reached(falls(1.7, [0.0, G]))));
    cases
}
