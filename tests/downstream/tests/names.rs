//! A model whose names are words of Rust: its modules compile, keep the names for those who read, and compute.

use hamel_downstream::models::{loop_, loop_async};
use hamel_runtime::{Integrator, Options, Taylor};

#[test]
fn words_of_rust_get_an_underscore_and_info_keeps_them() {
    assert_eq!(loop_::INFO.model, "loop");
    assert_eq!(loop_::INFO.state, ["crate", "R", "crate_dot", "R_dot"]);
    let names: Vec<_> = loop_::INFO.params.iter().map(|p| p.name).collect();
    assert_eq!(names, ["type", "Self"]);
    let refused = loop_::Prepared::<f64>::new(&loop_::Params { type_: -1.0, ..Default::default() });
    assert_eq!(refused.unwrap_err().condition, "type > 0");
}

#[test]
fn the_motion_is_an_oscillation() {
    let params = loop_async::Params { type_: 2.0, Self_: 4.0 };
    let system = loop_async::Prepared::new(&params).unwrap();
    let start = loop_async::State { crate_: 1.0, R_: -0.5, crate_dot: 0.0, R_dot: 0.0 };
    let options = Options::adaptive(1e-12, 1e-12);
    let mut solver = Integrator::new(&system, Taylor::default(), 0.0, start.to_array(), options).unwrap();
    solver.integrate_to(3.0).unwrap();
    // The length of the spring swings with the square 2 k/m, the mass centre rests.
    let end = loop_async::State::from_array(*solver.state());
    assert!((end.crate_ - end.R_ - 1.5 * (2.0_f64 * 3.0).cos()).abs() < 1e-10);
    assert!((system.fn_(3.0, &end.to_array()) - 0.5).abs() < 1e-10);
    let length = system.check_2(3.0, &end.to_array());
    assert!((length - (end.crate_ - end.R_)).abs() < 1e-15);
}
