//! A scene as C, for C++, for CasADi and as an FMU: the texts, and what they promise that can be seen without a
//! compiler.
//!
//! `c/` has the texts. Write them again with `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main c::`.

use expect_test::expect_file;
use hamel_codegen::config::{Config, Language};
use hamel_codegen::explain;
use hamel_codegen::scene::{self, Scenes, Start, Writing};
use hamel_codegen::spec::{self, Model};
use hamel_expr::Style;

/// A bead on a wire in a wheel: a domain, a sine, an event that changes the state, a division by the mass.
const TEXT: &str = "model bead {
    /// Mass [kg].
    param m = 2 where m > 0;
    /// Gravity [m/s^2].
    param g = 9.81;
    /// Angle from below [rad].
    coordinate theta in (-3, 3);
    lagrangian = 1/2*m*theta_dot^2 + m*g*cos(theta);
    output height = -cos(theta);
    event stop = theta falling { then theta_dot = -theta_dot/2; }
    initial theta = 1;
    initial theta_dot = 1/2;
}";

fn bead() -> Model {
    spec::parse("bead", TEXT).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_texts_are_those_that_were_looked_at() {
    let model = bead();
    let built = Scenes::new(&model)
        .for_language(Language::Casadi)
        .build(scene::DEFAULT)
        .unwrap_or_else(|e| panic!("{e}"));
    let command = Some("UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main c::".to_owned());
    let writing = Writing { command, ..Writing::default() };
    let initial = scene::initial_state(&model, &built).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(initial, Some(vec![1.0, 0.5]));
    let (c, fmu) = built.emit_fmu(&writing, initial.map(Start::from)).unwrap_or_else(|e| panic!("{e}"));
    expect_file!["c/bead.h"].assert_eq(&c.header);
    expect_file!["c/bead.c"].assert_eq(&c.source);
    expect_file!["c/bead.hpp"].assert_eq(&c.cpp);
    expect_file!["c/bead_casadi.c"].assert_eq(&c.casadi);
    expect_file!["c/modelDescription.xml"].assert_eq(&fmu.description);
    let functions = fmu.source.split("/* FMI 3.0 for one scene").next().unwrap_or_default();
    expect_file!["c/bead_fmu.c"].assert_eq(functions);
}

#[test]
fn an_fmu_needs_an_initial_state() {
    let text = TEXT.replace("initial theta_dot = 1/2;", "");
    let model = spec::parse("bead", &text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    // What the model does not give is zero, and said to be so.
    let initial = scene::start(&model, &built).unwrap_or_else(|e| panic!("{e}")).expect("a start");
    assert_eq!(initial.state, [1.0, 0.0]);
    let c = built.emit_c(&Writing::default(), Some(initial)).unwrap_or_else(|e| panic!("{e}"));
    assert!(c.header.contains("Beside the values of the model, chosen: theta_dot = 0.0."), "{}", c.header);
    let error = built.emit_fmu(&Writing::default(), None).unwrap_err();
    assert!(error.to_string().contains("initial x = 1;"), "{error}");
    // C does without.
    let c = built.emit_c(&Writing::default(), None).unwrap_or_else(|e| panic!("{e}"));
    assert!(!c.header.contains("bead_initial("), "{}", c.header);
}

#[test]
fn an_fmu_lists_what_rates_and_outputs_are_computed_from() {
    let model = bead();
    let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let (_, fmu) = built
        .emit_fmu(&Writing::default(), Some(Start::from(vec![1.0, 0.5])))
        .unwrap_or_else(|e| panic!("{e}"));
    // 0 time, 1 theta, 2 theta_dot, 3 and 4 their rates, 5 m, 6 g: theta' = theta_dot, theta_dot' = -g sin(theta).
    for line in [
        "<ContinuousStateDerivative valueReference=\"3\" dependencies=\"2\" dependenciesKind=\"dependent\"/>",
        "<ContinuousStateDerivative valueReference=\"4\" dependencies=\"1\" dependenciesKind=\"dependent\"/>",
        "<InitialUnknown valueReference=\"4\" dependencies=\"1 6\" dependenciesKind=\"dependent dependent\"/>",
        "<EventIndicator valueReference=",
    ] {
        assert!(fmu.description.contains(line), "{line} is not in\n{}", fmu.description);
    }
}

/// Signs of functions of events are followed by `fmi3CompletedIntegratorStep`, which importers call where it is asked
/// for alone: without it no event happens twice.
#[test]
fn an_fmu_with_events_asks_to_be_told_of_steps() {
    for (text, wanted) in [(TEXT.to_owned(), true), (TEXT.replace("event stop", "// event stop"), false)] {
        let model = spec::parse("bead", &text).unwrap_or_else(|e| panic!("{e}"));
        let built = scene::build(&model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
        let (_, fmu) = built
            .emit_fmu(&Writing::default(), Some(Start::from(vec![1.0, 0.5])))
            .unwrap_or_else(|e| panic!("{e}"));
        let exchange = fmu.description.lines().find(|line| line.contains("<ModelExchange "));
        let asked = exchange.is_some_and(|line| line.contains("needsCompletedIntegratorStep=\"true\""));
        assert_eq!(asked, wanted, "{exchange:?}");
    }
}

#[test]
fn an_fmu_defines_the_units_of_its_variables() {
    let text = "model swing {
        /// Mass [kg].
        param m = 2 where m > 0;
        /// Length [m].
        param l = 0.5 where l > 0;
        /// Gravity [m/s^2].
        param g = 9.81;
        /// Torque [N m].
        input tau = 0;
        coordinate theta in angle;
        lagrangian = m*l^2*theta_dot^2/2 + m*g*l*cos(theta);
        force theta_dot = tau;
        output height = -l*cos(theta);
        /// Angle in degrees, whose number this is not [deg].
        output angle = theta;
        initial theta = 1;
        initial theta_dot = 0;
    }";
    let model = spec::parse("swing", text).unwrap_or_else(|e| panic!("{e}"));
    assert!(model.warnings.to_string().is_empty(), "{}", model.warnings);
    let built = scene::build(&model, scene::CONTROLLED).unwrap_or_else(|e| panic!("{e}"));
    let initial = scene::initial_state(&model, &built).unwrap_or_else(|e| panic!("{e}"));
    let (_, fmu) =
        built.emit_fmu(&Writing::default(), initial.map(Start::from)).unwrap_or_else(|e| panic!("{e}"));
    let variables: Vec<&str> = fmu.description.lines().filter(|line| line.contains("<Float64")).collect();
    for (name, unit, base) in [
        ("time", "s", "s=\"1\""),
        ("theta", "rad", "rad=\"1\""),
        ("theta_dot", "rad/s", "s=\"-1\" rad=\"1\""),
        ("der(theta)", "rad/s", "s=\"-1\" rad=\"1\""),
        ("der(theta_dot)", "rad/s^2", "s=\"-2\" rad=\"1\""),
        ("m", "kg", "kg=\"1\""),
        ("l", "m", "m=\"1\""),
        ("g", "m/s^2", "m=\"1\" s=\"-2\""),
        ("tau", "N m", "kg=\"1\" m=\"2\" s=\"-2\""),
        // These follow.
        ("energy", "kg m^2/s^2", "kg=\"1\" m=\"2\" s=\"-2\""),
        ("height", "m", "m=\"1\""),
        ("angle", "deg", "rad=\"1\" factor=\"0.017453292519943295\""),
    ] {
        let own = variables.iter().find(|line| line.contains(&format!("name=\"{name}\"")));
        let own = own.unwrap_or_else(|| panic!("no {name} in\n{}", fmu.description));
        assert!(own.contains(&format!(" unit=\"{unit}\"")), "{own}");
        let definition = format!("<Unit name=\"{unit}\">\n      <BaseUnit {base}/>\n    </Unit>");
        assert_eq!(fmu.description.matches(&definition).count(), 1, "{definition}\n{}", fmu.description);
    }
    let told = explain::explain(&model, &built, Style::Plain);
    for line in [
        "Units: theta [rad]; theta_dot [rad/s]; angle [deg].",
        "Units that follow from the others: height [m]; E [kg m^2/s^2].",
    ] {
        assert!(told.contains(line), "{line} is not in\n{told}");
    }
    // Nothing follows where units contradict each other, are not there, or are not those of one system.
    for wrong in ["Length [s]", "Length", "Length [mm]"] {
        let text = text.replace("Length [m]", wrong);
        let model = spec::parse("swing", &text).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(model.units.energy(), None, "{wrong}");
        assert_eq!(model.units.of("theta_dot").map(|unit| unit.text()), Some("rad/s"));
    }
}

#[test]
fn languages_have_their_files() {
    let files = |language| {
        let bundle = Config::new().language(language).generate(&[bead()]).unwrap_or_else(|e| panic!("{e}"));
        bundle.files.keys().cloned().collect::<Vec<_>>()
    };
    assert_eq!(files(Language::Rust), ["bead.rs"]);
    assert_eq!(files(Language::C), ["bead.c", "bead.h"]);
    assert_eq!(files(Language::Cpp), ["bead.c", "bead.h", "bead.hpp"]);
    assert_eq!(files(Language::Casadi), ["bead.c", "bead.h", "bead_casadi.c"]);
    let refused = Config::new().language(Language::C).include_file("models.rs").generate(&[bead()]);
    assert!(refused.is_err_and(|e| e.to_string().contains("and Rust")));
}
