//! Operations of every right-hand side, bounded from above.
//!
//! A change of derivation or lowering that costs operations fails here. One that saves some may lower the bounds: the test
//! prints the table as it would be now with `cargo test -p hamel-tests --test operations -- --nocapture`.

use std::fmt::Write as _;

use hamel_codegen::lower::Counts;
use hamel_codegen::scene;
use hamel_tests::models::{build, model, names};

/// The most operations of the default and the minimal scene of every model.
#[rustfmt::skip]
const BOUNDS: &[Bound] = &[
    //    model, scene                            add, mul, div, functions, all
];

/// The most operations of a right-hand side.
struct Bound {
    model: &'static str,
    scene: &'static str,
    most: [usize; 5],
}

const fn most(model: &'static str, scene: &'static str, most: [usize; 5]) -> Bound {
    Bound { model, scene, most }
}

/// Additions and subtractions; multiplications; divisions; square roots and elementary functions; all, with sign changes.
fn numbers(c: &Counts) -> [usize; 5] {
    [c.add, c.mul, c.div, c.sqrt + c.transcendental, c.total()]
}

const COLUMNS: [&str; 5] =
    ["additions", "multiplications", "divisions", "roots and functions", "operations in all"];

/// A line of the table.
fn line(model: &str, scene: &str, [add, mul, div, functions, all]: [usize; 5]) -> String {
    let names = format!("most(\"{model}\", \"{scene}\",");
    format!("    {names:<42} [{add:>3}, {mul:>3}, {div:>2}, {functions:>2}, {all:>3}]),\n")
}

#[test]
fn no_right_hand_side_takes_more_operations_than_the_table_says() {
    let (mut table, mut problems) = (String::new(), String::new());
    let mut found = Vec::new();
    for name in names() {
        for scene in scene::names(&model(&name)).into_iter().filter(|s| s != scene::RECONSTRUCTION) {
            let program = build(&name, &scene).program;
            let k = program.function_idx("rhs").unwrap_or_else(|| panic!("{name} {scene} has no rhs"));
            let numbers = numbers(&program.functions[k].counts());
            let own = line(&name, &scene, numbers);
            match BOUNDS.iter().find(|b| b.model == name && b.scene == scene) {
                None => drop(write!(problems, "{name} {scene} is not in the table; add\n{own}")),
                Some(bound) => {
                    for ((what, now), most) in COLUMNS.iter().zip(numbers).zip(bound.most) {
                        if now > most {
                            let _ =
                                write!(problems, "{name} {scene}: {now} {what}, at most {most}; now\n{own}");
                        }
                    }
                }
            }
            table.push_str(&own);
            found.push((name.clone(), scene));
        }
    }
    for Bound { model, scene, .. } in BOUNDS {
        if !found.iter().any(|(m, s)| m == model && s == scene) {
            let _ = writeln!(problems, "{model} {scene} is in the table, but there is no such scene");
        }
    }
    println!("{table}");
    assert!(problems.is_empty(), "\n{problems}");
}
