//! Forces by accelerations and mass matrices, as the machine interface has them.

use std::sync::Arc;

use hamel::commands::eval::eval_text;
use hamel_codegen::spec::{self, Want};
use hamel_run::cache::Cache;
use hamel_run::dynamics::Factory as _;
use hamel_run::error::Error;
use hamel_run::interpreted::{self, Built};
use hamel_run::model::Checked;
use serde_json::{Value, json};

/// A rigid body, whose forces are known by heart: `I a + Omega x I Omega`.
const TOP: &str = "model top {
    param I: diagonal(3) = [2, 1.5, 0.8] where I1 > 0, I2 > 0, I3 > 0;
    velocity Omega in so(3);
    lagrangian = 1/2*dot(Omega, I*Omega);
    /// Angular momentum.
    momentum Pi of Omega;
    scene dynamics { want rhs, mass_matrix, inverse_dynamics; }
    scene hamilton { carry Pi; want rhs; }
}";

fn scene(name: &str) -> Built {
    let model = spec::parse("test.hamel", TOP).unwrap_or_else(|e| panic!("{e}"));
    let model = Arc::new(Checked::new(model, Cache::none()));
    interpreted::build(&model, name).unwrap_or_else(|e| panic!("{e}"))
}

fn of_three([x, y, z]: [f64; 3]) -> Value {
    json!({"Omega1": x, "Omega2": y, "Omega3": z})
}

fn refused(scene_name: &str, request: &Value) -> String {
    match eval_text(&scene(scene_name), &request.to_string()) {
        Err(error @ Error::Request { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn eval_answers_with_the_forces_of_accelerations() {
    let states = [of_three([1.0, 2.0, 3.0]), of_three([0.0, 0.0, 1.0])];
    let request = json!({"states": states, "accelerations": [of_three([0.0; 3]), of_three([1.0, 0.0, 0.5])]});
    let answer = eval_text(&scene("dynamics").in_memory(), &request.to_string()).expect("forces");
    let answer: Value = serde_json::from_str(&answer).expect("JSON");
    let gyroscopic = [2.0 * 3.0 * (0.8 - 1.5), 3.0 * 1.0 * (2.0 - 0.8), 1.0 * 2.0 * (1.5 - 2.0)];
    assert_eq!(answer["inverse_dynamics"], json!([of_three(gyroscopic), of_three([2.0, 0.0, 0.4])]));
    // Without accelerations there are no forces.
    let request = json!({"states": [of_three([1.0, 2.0, 3.0])]});
    let answer = eval_text(&scene("dynamics"), &request.to_string()).expect("values");
    let answer: Value = serde_json::from_str(&answer).expect("JSON");
    assert_eq!(answer.get("inverse_dynamics"), None);
    assert_eq!(answer["outputs"]["mass_matrix"][0]["A_Omega2_Omega2"], 1.5);
}

#[test]
fn the_mass_matrix_is_whole() {
    let built = scene("dynamics");
    let prepared = built.prepare(&built.info().defaults()).expect("default parameters");
    let matrix = prepared.matrix(Want::MassMatrix, 0.0, &[1.0, 2.0, 3.0]).expect("wanted");
    assert_eq!(matrix, [[2.0, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 0.8]]);
    let others = scene("default");
    let prepared = others.prepare(&others.info().defaults()).expect("default parameters");
    assert_eq!(prepared.matrix(Want::MassMatrix, 0.0, &[1.0, 2.0, 3.0]), None);
}

#[test]
fn wrong_accelerations_are_told() {
    let states = [of_three([1.0, 2.0, 3.0]), of_three([0.0, 0.0, 1.0])];
    let found = refused("dynamics", &json!({"states": states, "accelerations": [of_three([0.0; 3])]}));
    assert!(found.contains("accelerations are 1 for 2 states"), "{found}");
    let accelerations = json!([of_three([0.0; 3]), {"Omega1": 1, "Omega2": "2", "omega3": 0}]);
    let found = refused("dynamics", &json!({"states": states, "accelerations": accelerations}));
    assert!(
        found.contains("accelerations[1] has no acceleration `omega3`; did you mean `Omega3`?"),
        "{found}"
    );
    assert!(found.contains("accelerations[1] lacks Omega3"), "{found}");
    assert!(found.contains("accelerations[1].Omega2"), "{found}");
    let request = json!({"states": [of_three([1.0, 2.0, 3.0])], "accelerations": [of_three([0.0; 3])]});
    let found = refused("default", &request);
    assert!(found.contains("`scene dynamics { want rhs, inverse_dynamics; }`"), "{found}");
    let states = json!([{"Pi1": 1, "Pi2": 2, "Pi3": 3}]);
    let found = refused("hamilton", &json!({"states": states, "accelerations": [of_three([0.0; 3])]}));
    assert!(found.contains("the state of scene hamilton of top has none"), "{found}");
}
