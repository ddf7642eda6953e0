//! Members of a family of models, from the command line and in requests.

use std::process::Output;

use crate::common::program;

fn hamel(arguments: &[&str], input: &str) -> Output {
    program::output(&mut program::command(arguments), input)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A chain of masses on springs in a folder of its own.
fn chain(name: &str) -> (std::path::PathBuf, String) {
    let folder = std::env::temp_dir().join(format!("hamel-sizes-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("chain.hamel");
    let model = "/// Masses on springs
model chain {
    /// Number of masses.
    size n = 2 where 1 <= n <= 50;
    coordinate x: vector(n) in real;
    lagrangian = dot(x_dot, x_dot)/2 - x[1]^2/2 - sum((x[k] - x[k - 1])^2 for k in 2..n)/2;
    for k in 1..n {
        initial x[k] = 1/k;
        initial x_dot[k] = 0;
    }
}";
    std::fs::write(&path, model).unwrap();
    let path = path.display().to_string();
    (folder, path)
}

#[test]
fn every_command_takes_another_member() {
    let (folder, path) = chain("commands");
    let explained = hamel(&["explain", &path, "--size", "n=4"], "");
    let told = text(&explained.stdout);
    assert!(explained.status.success() && told.contains("Read with `n = 4`"), "{told}");
    assert!(told.contains("x₄") && !told.contains("x₅"), "{told}");
    let state = "{\"x1\": 1, \"x2\": 3, \"x3\": 0, \"x1_dot\": 0, \"x2_dot\": 0, \"x3_dot\": 0}";
    // x1'' = -x1 + (x2 - x1), x2'' = -(x2 - x1) + (x3 - x2), x3'' = -(x3 - x2).
    let expected = "[[0.0,0.0,0.0,1.0,-5.0,3.0]]";
    let by_option = hamel(&["eval", &path, "--size", "n=3"], &format!("{{\"states\": [{state}]}}"));
    let request = format!("{{\"sizes\": {{\"n\": 3}}, \"states\": [{state}]}}");
    for answer in [by_option, hamel(&["eval", &path], &request)] {
        let told = text(&answer.stdout);
        assert!(told.contains(expected), "{told}{}", text(&answer.stderr));
    }
    let motion = "{\"sizes\": {\"n\": 1}, \"initial\": {\"x1\": 1, \"x1_dot\": 0}, \"t_final\": 1}";
    let answer = hamel(&["simulate", &path, "--json"], motion);
    let final_x: serde_json::Value = serde_json::from_slice(&answer.stdout).unwrap();
    let found = final_x["final"]["x1"].as_f64().unwrap();
    assert!((found - 1_f64.cos()).abs() < 1e-9, "{found}");
    let out = folder.join("generated");
    let generate = ["generate", &path, "--size", "n=3", "--out-dir", out.to_str().unwrap()];
    assert!(hamel(&generate, "").status.success());
    let module = std::fs::read_to_string(out.join("chain.rs")).unwrap();
    assert!(module.contains("\"x3\"") && module.contains("Read with `n = 3`"), "another member");
    // The member of the file is another one, and the message says how to write that of the option.
    let check = hamel(&[&generate[..], &["--check"]].concat(), "");
    assert!(check.status.success(), "{}", text(&check.stderr));
    let stale = hamel(&["generate", &path, "--out-dir", out.to_str().unwrap(), "--check"], "");
    assert!(!stale.status.success());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn wrong_sizes_are_told() {
    let (folder, path) = chain("wrong");
    let told = |arguments: &[&str], input: &str| {
        let out = hamel(arguments, input);
        assert!(!out.status.success());
        text(&out.stderr)
    };
    assert!(told(&["explain", &path, "--size", "n=0"], "").contains("size `n` is 0, against `1 <= n`"));
    assert!(told(&["explain", &path, "--size", "m=3"], "").contains("the model has no size `m`"));
    assert!(told(&["explain", &path, "--size", "n"], "").contains("such as n=10"));
    assert!(told(&["explain", "heavy_top", "--size", "n=3"], "").contains("it declares none"));
    assert!(told(&["eval", &path], "{\"sizes\": {\"n\": 1.5}}").contains("give a whole number"));
    std::fs::remove_dir_all(folder).unwrap();
}
