//! Every option of `simulate` with every kind of system and with every other option: each pair of their values comes
//! about in some motion, which agrees with that of the default method, or is refused with a reason.
//!
//! Deliberately does not know: which pairs are refused.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::Parser as _;
use hamel::commands::simulate;
use hamel_run::cache::Cache;
use hamel_run::error::Error;
use hamel_run::method::MethodName;
use hamel_run::session::Session;

/// A kind of system: its model, its scene, a component of its initial state that its motion is differentiated by, and a
/// function that is watched.
struct System {
    name: &'static str,
    text: &'static str,
    scene: &'static str,
    component: &'static str,
    section: &'static str,
}

/// All of them have a parameter `c` and an input `u`.
const SYSTEMS: [System; 7] = [
    System {
        name: "loop",
        text: "model crank {
            param c = 0.3; param l = 0.9;
            input u = 0;
            coordinate theta in angle;
            coordinate phi in angle by c*sin(theta) + l*sin(phi) = 0;
            coordinate x in real by x = c*cos(theta) + l*cos(phi);
            lagrangian = theta_dot^2*(1 + sin(theta)^2) + phi_dot^2/3 + x_dot^2 - 2*x;
            force theta_dot = u;
            initial theta = 0.4; initial theta_dot = 1;
        }",
        scene: "default",
        component: "theta",
        section: "theta - 0.8 rising",
    },
    System {
        name: "multipliers",
        text: "model pendulum {
            param c = 1;
            input u = 0;
            coordinate x, z in real;
            constraint rod: x^2 + z^2 = c^2;
            lagrangian = (x_dot^2 + z_dot^2)/2 - 9.81*z;
            multipliers;
            force x_dot = u;
            initial x = 0.6; initial z = -0.8; initial x_dot = 0.5;
        }",
        scene: "default",
        component: "x",
        section: "x falling",
    },
    System {
        name: "momenta",
        text: "model top {
            param c = 2;
            input u = 0;
            coordinate q in real;
            coordinate s in angle;
            momentum p of q_dot;
            carry p;
            lagrangian = (1 + q^2)*q_dot^2/2 + c*s_dot^2/2 + q_dot*s_dot/2 - q^2 + cos(s);
            force q_dot = u;
            initial q = 0.3; initial s = 0.2; initial q_dot = 0.4; initial s_dot = 1;
        }",
        scene: "default",
        component: "s",
        section: "q falling",
    },
    System {
        name: "circles",
        text: "model bead {
            param c = 2;
            input u = 0;
            coordinate theta in angle;
            lagrangian = theta_dot^2/2 + c*cos(theta);
            force theta_dot = u;
            initial theta = 0.5; initial theta_dot = 1;
            scene turned { circle theta; input u; want rhs, energy; }
        }",
        scene: "turned",
        component: "theta_dot",
        section: "sin(theta) - 0.7 rising",
    },
    System {
        name: "time",
        text: "model driven {
            param c = 3;
            input u = 0;
            coordinate x in real;
            lagrangian = x_dot^2/2 - x^2/2 + x*cos(c*t);
            force x_dot = u;
            initial x = 0.3; initial x_dot = -0.2;
        }",
        scene: "default",
        component: "x",
        section: "x - 0.35",
    },
    System {
        name: "heights",
        text: "model floor {
            param c = 4;
            input u = 0;
            velocity w, v in product(R, R);
            advected z in R by -v;
            advected s in R by -w;
            lagrangian = (w^2 + v^2)/2;
            constraint floor: z = s^2/c + 1;
            multipliers;
            force w = u;
            initial z = 1; initial s = 0; initial w = 1; initial v = 0;
        }",
        scene: "default",
        component: "w",
        section: "s - 0.5 rising",
    },
    System {
        name: "events",
        text: "model ball {
            param c = 0.7;
            input u = 0;
            coordinate z in real;
            lagrangian = z_dot^2/2 - 9.81*z;
            force z_dot = u;
            event impact = z falling { then z_dot = -c*z_dot; }
            initial z = 1; initial z_dot = 0;
        }",
        scene: "default",
        component: "z",
        section: "z - 0.5",
    },
];

/// What is chosen for each factor, by its place among the values of the factor.
type Row = [usize; 7];

/// Values of the factors but for systems and methods.
const STEPS: [&[&str]; 2] = [&[], &["--step", "0.002"]];
const ALONG: usize = 3;
const SECTIONS: usize = 2;
const INPUTS: usize = 3;
const SAMPLES: usize = 2;

#[derive(clap::Parser)]
struct Call {
    #[command(flatten)]
    arguments: simulate::Arguments,
}

/// Rows in which every pair of values of different factors comes about: one after the other is completed by the values
/// that make the most new pairs.
fn rows(sizes: Row) -> Vec<Row> {
    type Pair = ((usize, usize), (usize, usize));
    let mut open: BTreeSet<Pair> = BTreeSet::new();
    for (i, n) in sizes.iter().enumerate() {
        for (j, m) in sizes.iter().enumerate().skip(i + 1) {
            open.extend((0..*n).flat_map(|a| (0..*m).map(move |b| ((i, a), (j, b)))));
        }
    }
    let pair = |a: (usize, usize), b: (usize, usize)| if a < b { (a, b) } else { (b, a) };
    let mut rows = Vec::new();
    while let Some(&(first, second)) = open.iter().next() {
        let mut chosen: BTreeMap<usize, usize> = BTreeMap::from([first, second]);
        for (factor, n) in sizes.iter().enumerate() {
            if chosen.contains_key(&factor) {
                continue;
            }
            let made = |value: usize| {
                let own = (factor, value);
                chosen.iter().filter(|(i, a)| open.contains(&pair((**i, **a), own))).count()
            };
            // The first of the best, another one in each row, so that ties do not always end at one value.
            let best =
                (0..*n).map(|k| (k + rows.len()) % n).max_by_key(|value| made(*value)).unwrap_or_default();
            chosen.insert(factor, best);
        }
        let row: Row = std::array::from_fn(|factor| chosen[&factor]);
        for i in 0..row.len() {
            for j in i + 1..row.len() {
                open.remove(&((i, row[i]), (j, row[j])));
            }
        }
        rows.push(row);
    }
    rows
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("pairs")
}

/// A motion by the entry of the command.
fn simulated(session: &Session, words: &[String]) -> Result<String, Error> {
    let call = Call::try_parse_from(std::iter::once("simulate".to_owned()).chain(words.iter().cloned()));
    let call = call.unwrap_or_else(|e| panic!("{words:?}: {e}"));
    simulate::run(session, &call.arguments)
}

/// The final state by name, and behind it the derivatives.
fn ends(text: &str) -> BTreeMap<String, Vec<f64>> {
    let mut found: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    // The table begins behind the line with its headings.
    let table = text.lines().skip_while(|line| !line.trim_start().starts_with("initial"));
    for line in table {
        let words: Vec<&str> = line.split_whitespace().collect();
        let Some((name, numbers)) = words.split_first() else { continue };
        let numbers: Option<Vec<f64>> = numbers.iter().map(|x| x.parse().ok()).collect();
        if let Some(last) = numbers.as_ref().and_then(|numbers| numbers.last()) {
            found.entry((*name).to_owned()).or_default().push(*last);
        }
    }
    found
}

/// The words of a row, but for its method and its steps.
fn asked(row: &Row) -> Vec<String> {
    let [system, _, _, along, section, input, _] = *row;
    let system = &SYSTEMS[system];
    let model = folder().join(format!("{}.hamel", system.name));
    let mut words = vec![model.display().to_string(), "--scene".into(), system.scene.into()];
    words.extend(["--t-final".to_owned(), "0.7".to_owned()]);
    match along {
        0 => {}
        1 => words.extend(["--sensitivity".to_owned(), "c".to_owned()]),
        _ => words.extend(["--sensitivity".to_owned(), system.component.to_owned()]),
    }
    if section == 1 {
        words.extend(["--section".to_owned(), system.section.to_owned()]);
    }
    match input {
        0 => {}
        1 => words.extend(["--input".to_owned(), "u=0.2*t".to_owned()]),
        _ => words.extend(["--input".to_owned(), folder().join("u.csv").display().to_string()]),
    }
    words
}

/// All words of a row.
fn call(row: &Row, methods: &[MethodName]) -> Vec<String> {
    let mut call = asked(row);
    call.extend(["--method".to_owned(), methods[row[1]].name().to_owned()]);
    call.extend(STEPS[row[2]].iter().map(|word| (*word).to_owned()));
    if row[6] == 1 {
        let file = folder().join("samples.csv").display().to_string();
        call.extend(["--samples".to_owned(), "5".to_owned(), "-o".to_owned(), file]);
    }
    call
}

#[test]
fn every_pair_of_options_is_right_or_refused() {
    std::fs::create_dir_all(folder()).unwrap();
    for system in &SYSTEMS {
        std::fs::write(folder().join(format!("{}.hamel", system.name)), system.text).unwrap();
    }
    // The same input as the expression.
    std::fs::write(folder().join("u.csv"), "t,u\n0,0\n10,2\n").unwrap();
    let session = Session::of_shipped(&[]).with_cache(Cache::at(folder().join("cache")));
    let methods: Vec<MethodName> = MethodName::all().collect();
    let sizes = [SYSTEMS.len(), methods.len(), STEPS.len(), ALONG, SECTIONS, INPUTS, SAMPLES];
    let exact = ["--rtol", "1e-12", "--atol", "1e-13"].map(str::to_owned);
    let mut references: BTreeMap<Vec<String>, BTreeMap<String, Vec<f64>>> = BTreeMap::new();
    for mut row in rows(sizes) {
        // What is refused is asked for again without the option that is in the way, so that the others meet as well.
        let (call, text) = loop {
            let call = call(&row, &methods);
            let error = match simulated(&session, &call) {
                Ok(text) => break (call, text),
                Err(error) => error,
            };
            let (message, method) = (error.to_string(), methods[row[1]].name());
            assert_eq!(error.exit_code(), 2, "{call:?} is no right answer and not refused: {message}");
            let before = row;
            match () {
                () if message.contains("--step is missing") => row[2] = 1,
                () if message.contains("--step is given") => row[2] = 0,
                () if message.contains("sensitivity") => row[3] = 0,
                () if message.contains(method) => row[1] = 1,
                () => panic!("{call:?}: says not why: {message}"),
            }
            assert_ne!(row, before, "{call:?}: another reason than the one that is told: {message}");
        };
        let words = asked(&row);
        let expected = references.entry(words.clone()).or_insert_with(|| {
            // Tolerances far below those of the comparison.
            let found = simulated(&session, &[&words[..], &exact[..]].concat());
            ends(&found.unwrap_or_else(|e| panic!("{words:?}: the default method refuses this: {e}")))
        });
        let found = ends(&text);
        assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "{text}");
        assert!(!found.is_empty(), "{text}");
        // Of order two with steps of 0.002; derivatives are as exact as states.
        let of_second_order = [MethodName::Splitting2, MethodName::Midpoint, MethodName::MidpointNewton]
            .contains(&methods[row[1]]);
        let bound = if of_second_order { 1e-3 } else { 1e-6 };
        for (name, values) in &found {
            assert_eq!(values.len(), expected[name].len(), "{call:?}: {text}");
            for (x, y) in values.iter().zip(&expected[name]) {
                let is_near = (x - y).abs() <= bound * y.abs().max(1.0);
                assert!(is_near, "{call:?}: {name} = {x} instead of {y}");
            }
        }
    }
}

#[test]
fn rows_have_every_pair() {
    let sizes = [7, 21, 2, 3, 2, 3, 2];
    let rows = rows(sizes);
    for i in 0..sizes.len() {
        for j in i + 1..sizes.len() {
            let pairs: BTreeSet<(usize, usize)> = rows.iter().map(|row| (row[i], row[j])).collect();
            assert_eq!(pairs.len(), sizes[i] * sizes[j], "factors {i} and {j}");
        }
    }
    // Not many more than the two longest factors ask for.
    assert!(rows.len() < 200, "{}", rows.len());
}
