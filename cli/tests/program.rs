//! The program itself: exit status, where output goes, help.

use std::path::PathBuf;
use std::process::Output;

use crate::common::program;

fn hamel(arguments: &[&str], input: &str) -> Output {
    program::output(&mut program::command(arguments), input)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A directory of its own for a test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("hamel-program-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn answers_go_to_standard_output_alone() {
    let request = r#"{"states": [{"Omega1": 1, "Omega2": 0.2, "Omega3": 0.1}]}"#;
    let out = hamel(&["eval", "free_rigid_body", "--via", "interpreter"], request);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(text(&out.stderr), "");
    let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(answer["model"], "free_rigid_body");
    assert_eq!(text(&out.stdout).lines().count(), 1);
}

#[test]
fn bad_input_has_status_two_and_a_hint() {
    let cases: [(&[&str], &str); 8] = [
        (&["eval", "free_rigid_bdy"], "did you mean `free_rigid_body`?"),
        (&["eval", "heavy_top", "--scene", "lagrang", "--via", "interpreter"], "did you mean `lagrange`?"),
        (&["eval", "heavy_top", "--via", "interpreter"], "standard input is empty"),
        (&["simulate", "heavy_top", "--set", "m"], "name=value"),
        (&["simulate", "heavy_top", "--via", "interpreter", "--initial", "Omega9=1"], "no state `Omega9`"),
        (&["simulate", "heavy_top", "--via", "interpreter", "--initial", "qw=1"], "with --reconstruct only"),
        (&["simulate", "heavy_top", "--scene", "lagrange", "--reconstruct"], "leave out --scene lagrange"),
        (&["simulate", "heavy_top", "-o", "top.gif"], ".csv, .json, .npz, .svg, .png or .pdf"),
    ];
    for (arguments, hint) in cases {
        let out = hamel(arguments, "");
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        assert_eq!(text(&out.stdout), "", "{arguments:?}");
        assert!(text(&out.stderr).contains(hint), "{arguments:?}: {}", text(&out.stderr));
    }
}

#[test]
fn a_file_of_ones_own_is_compiled_in_memory() {
    let folder = Folder::new("own");
    let path = folder.file("mine.hamel");
    std::fs::write(&path, "model mine { coordinate x in real; lagrangian = 1/2*x_dot^2 - 2*x^2; }").unwrap();
    let request = r#"{"states": [{"x": 1, "x_dot": 3}]}"#;
    let out = hamel(&["eval", &path], request);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(text(&out.stderr), "");
    for gone in ["compiled", "rustc"] {
        let asked = hamel(&["eval", &path, "--via", gone], request);
        assert_eq!(asked.status.code(), Some(2));
        assert!(
            text(&asked.stderr).contains("[possible values: jit, interpreter]"),
            "{}",
            text(&asked.stderr)
        );
    }
    assert_eq!(hamel(&["eval", &path, "--via", "interpreter"], request).stdout, out.stdout);
    let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(answer["derivatives"], serde_json::json!([[3.0, -4.0]]));
    std::fs::write(&path, "model mine { coordinate x in real; lagrangian = 1/2*x_dt^2; }").unwrap();
    let out = hamel(&["explain", &path], "");
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("mine.hamel:1:"), "{}", text(&out.stderr));
}

#[test]
fn a_simulation_writes_all_formats() {
    let folder = Folder::new("formats");
    let files = ["top.csv", "top.svg", "top.json"].map(|name| folder.file(name));
    let arguments = ["simulate", "heavy_top", "--via", "interpreter", "--t-final", "1", "--samples", "11"];
    let outputs = files.iter().flat_map(|file| ["-o", file.as_str()]);
    let out = hamel(&arguments.into_iter().chain(outputs).collect::<Vec<_>>(), "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    let summary = text(&out.stdout);
    assert!(summary.contains("drift") && summary.contains("Gamma3"), "{summary}");
    let csv = std::fs::read_to_string(&files[0]).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 12);
    assert!(lines[0].starts_with("t,Omega1,Omega2,Omega3,Gamma1,Gamma2,Gamma3,energy,"), "{}", lines[0]);
    let columns = lines[0].split(',').count();
    for line in &lines[1..] {
        let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        assert_eq!(numbers.len(), columns);
    }
    let svg = std::fs::read_to_string(&files[1]).unwrap();
    assert!(svg.starts_with("<svg ") && svg.contains("Ω₁") && svg.contains("[rad/s]"));
    let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&files[2]).unwrap()).unwrap();
    assert_eq!(json["samples"].as_array().unwrap().len(), 11);
}

#[test]
fn a_reconstructed_simulation_draws_the_path() {
    let folder = Folder::new("path");
    let files = ["robot.svg", "robot.json", "robot.csv"].map(|name| folder.file(name));
    let arguments = ["simulate", "mobile_robot", "--reconstruct", "--via", "interpreter", "--initial", "x=1"];
    let outputs = files.iter().flat_map(|file| ["-o", file.as_str()]);
    let out = hamel(&arguments.into_iter().chain(outputs).collect::<Vec<_>>(), "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    let svg = std::fs::read_to_string(&files[0]).unwrap();
    assert!(svg.contains("Heading [rad]") && svg.contains("Position of P [m]"));
    assert!(svg.contains("Path: position of P") && svg.contains("y [m]"));
    let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&files[1]).unwrap()).unwrap();
    assert_eq!(json["reconstruction"].as_object().unwrap().len(), 3);
    assert!(json["final"].get("x").is_none());
    let csv = std::fs::read_to_string(&files[2]).unwrap();
    assert!(csv.starts_with("t,psi1,psi2,psi1_dot,psi2_dot,theta,x,y,energy"));
    assert!(csv.lines().nth(1).unwrap().starts_with("0.0,0.0,0.0,-4.0,-6.0,0.0,1.0,0.0,"));
}

#[test]
fn every_command_has_help_with_an_example() {
    let commands = [
        "new",
        "generate",
        "list",
        "explain",
        "eval",
        "simulate",
        "ensemble",
        "report",
        "completions",
        "man",
    ];
    for command in commands {
        let out = hamel(&[command, "--help"], "");
        assert!(out.status.success());
        assert!(text(&out.stdout).contains(&format!("hamel {command}")), "{command}");
    }
}

#[test]
fn a_command_without_arguments_explains_itself() {
    for command in ["new", "explain", "eval", "simulate", "ensemble"] {
        let out = hamel(&[command], "");
        assert_eq!(out.status.code(), Some(2));
        assert_eq!(text(&out.stdout), "");
        let help = text(&out.stderr);
        assert!(help.contains("Examples:\n") && help.contains(&format!("hamel {command} ")), "{help}");
    }
}

#[test]
fn a_new_model_can_be_explained_and_simulated_and_is_never_overwritten() {
    let folder = Folder::new("new");
    let path = folder.file("my_sled.hamel");
    let out = hamel(&["new", &path], "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains(&format!("hamel explain {path}")), "{}", text(&out.stdout));

    let out = hamel(&["explain", &path], "");
    assert!(text(&out.stdout).contains("my_sled"), "{}", text(&out.stderr));
    let figure = folder.file("sled.svg");
    let out = hamel(&["simulate", &path, "--reconstruct", "-o", &figure], "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(std::fs::read_to_string(&figure).unwrap().contains("Path: position of the contact"));

    std::fs::write(&path, "mine").unwrap();
    let out = hamel(&["new", &path], "");
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("exists and is left as it is"), "{}", text(&out.stderr));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");

    // A name that no model can have, and a folder that is not there.
    let out = hamel(&["new", &folder.file("my-sled.hamel")], "");
    assert_eq!(out.status.code(), Some(2), "{}", text(&out.stdout));
    assert!(!std::path::Path::new(&folder.file("my-sled.hamel")).exists());
    let out = hamel(&["new", &folder.file("nowhere/sled.hamel")], "");
    assert_eq!(out.status.code(), Some(1));
    let told = text(&out.stderr);
    assert!(
        told.contains(&format!("there is no folder {}, make it first", folder.file("nowhere"))),
        "{told}"
    );
    assert!(!std::path::Path::new(&folder.file("nowhere")).exists());
    assert_eq!(hamel(&["new", "heavy_top"], "").status.code(), Some(2));
}

/// The name is what is wrong, not a place in a file that nobody has written.
#[test]
fn a_name_that_no_model_can_have_is_told_with_one_that_it_can() {
    let cases = [
        ("foo-bar", "`foo-bar` cannot name a model: names are ASCII letters", "; `foo_bar` can"),
        ("robot/arm", "`robot/arm` cannot name a model", "; `robot_arm` can"),
        ("2d", "`2d` cannot name a model", ""),
        ("", "`` cannot name a model", ""),
        (".hamel", "`.hamel` cannot name a model", ""),
        ("energy", "`energy` cannot name a model: scenes have an output of that name", ""),
        ("if", "`if` cannot name a model: the language has no conditions", ""),
    ];
    for (name, message, advice) in cases {
        let out = hamel(&["new", name], "");
        assert_eq!(out.status.code(), Some(2), "{name}");
        let told = text(&out.stderr);
        assert!(told.contains(message) && told.contains(advice), "{told}");
        assert_eq!(told.trim().lines().count(), 1, "{told}");
    }
}

/// The option is named.
#[test]
fn numbers_that_are_not_finite_are_refused_by_every_option() {
    for via in ["jit", "interpreter"] {
        for option in ["--t-final", "--rtol", "--atol", "--step"] {
            for value in ["inf", "-inf", "nan", "1e999"] {
                let argument = format!("{option}={value}");
                for command in [&["simulate"][..], &["ensemble", "--sweep", "m=1..2:2", "-o", "never.csv"]] {
                    let arguments = [command, &["heavy_top", "--via", via, &argument]].concat();
                    let out = hamel(&arguments, "");
                    assert_eq!(out.status.code(), Some(2), "{arguments:?}");
                    let told = text(&out.stderr);
                    assert!(told.contains(option) && told.contains("not a finite number"), "{told}");
                }
            }
        }
    }
}

#[test]
fn too_much_is_refused_before_it_is_begun() {
    let folder = Folder::new("much");
    let file = folder.file("top.csv");
    let cases: [(&[&str], &str); 4] = [
        (
            &["simulate", "heavy_top", "--samples", "20000000", "-o", &file],
            "--samples is 20000000, which would take about",
        ),
        (
            &["simulate", "heavy_top", "--samples", "18446744073709551615"],
            "--samples is 18446744073709551615",
        ),
        (
            &["simulate", "heavy_top", "--step", "1e-3", "--method", "rk4", "--t-final", "1e15"],
            "it needs 1.0e18 steps, and at most 1000000000 are taken",
        ),
        (&["simulate", "heavy_top", "--max-steps", "0"], "--max-steps"),
    ];
    for (arguments, message) in cases {
        for via in ["jit", "interpreter"] {
            let out = hamel(&[arguments, &["--via", via]].concat(), "");
            let told = text(&out.stderr);
            assert_eq!(out.status.code(), Some(2), "{arguments:?}: {told}");
            assert!(told.contains(message), "{arguments:?}: {told}");
        }
    }
    assert!(!std::path::Path::new(&file).exists());
    // With as many steps as allowed, it stops there.
    for via in ["jit", "interpreter"] {
        let out =
            hamel(&["simulate", "heavy_top", "--t-final", "1e15", "--max-steps", "500", "--via", via], "");
        assert_eq!(out.status.code(), Some(1));
        let told = text(&out.stderr);
        assert!(told.contains("stopped at t = ") && told.contains("500 steps were not enough"), "{told}");
    }
}

/// Scenes that leave out residuals and momenta are judged all the same, by name and as JSON.
#[test]
fn an_inadmissible_start_is_refused_in_every_scene() {
    let start = |omega2: f64| {
        format!(
            r#"{{"initial": {{"Omega1": 1.2, "Omega2": {omega2}, "Omega3": -0.4, "gamma1": 0, "gamma2": 0.8, "gamma3": 0.6}},
            "t_final": 1}}"#
        )
    };
    for scene in ["default", "invariants", "derivatives"] {
        let arguments = ["simulate", "veselova", "--scene", scene, "--via", "interpreter", "--json"];
        let out = hamel(&arguments, &start(0.3));
        assert!(out.status.success(), "{}", text(&out.stderr));
        let out = hamel(&arguments, &start(0.4));
        assert_eq!(out.status.code(), Some(2), "{scene}: {}", text(&out.stdout));
        let told = text(&out.stderr);
        assert!(told.contains("residual_c1 = 0.08") && told.contains("Omega2 = 0.3"), "{scene}: {told}");
    }
    let given = ["Omega1=1.2", "Omega2=0.4", "Omega3=-0.4", "gamma1=0", "gamma2=0.8", "gamma3=0.6"];
    for scene in ["default", "invariants"] {
        let named = ["simulate", "veselova", "--scene", scene, "--via", "interpreter", "--initial"];
        let out = hamel(&[&named[..], &given].concat(), "");
        assert_eq!(out.status.code(), Some(2), "{scene}: {}", text(&out.stdout));
        assert!(text(&out.stderr).contains("the nearest state that does"), "{}", text(&out.stderr));
    }
    // What is left to choose is chosen.
    let named = ["simulate", "veselova", "--via", "interpreter", "--t-final", "1", "--initial"];
    assert!(hamel(&[&named[..], &given[..2]].concat(), "").status.success());
}

#[test]
fn models_are_listed_by_kind() {
    let out = hamel(&["list", "suslov", "heavy_top", "free_rigid_body", "veselova"], "");
    let list = text(&out.stdout);
    let at = |part: &str| list.find(part).unwrap_or_else(|| panic!("{part} in {list}"));
    let order = ["[Euler-Poincaré]", "free_rigid_body", "[Euler-Poincaré, advected parameters]", "heavy_top"];
    assert!(order.windows(2).all(|pair| at(pair[0]) < at(pair[1])), "{list}");
    assert!(at("[Euler-Poincaré-Suslov]") < at("suslov  "), "{list}");

    // Programs read this; a key may be added, none goes, and the order is the one that was asked for.
    let out = hamel(&["list", "--json", "suslov", "free_rigid_body"], "");
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let keys = |value: &serde_json::Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!((&json[0]["model"], &json[1]["model"]), (&"suslov".into(), &"free_rigid_body".into()));
    assert_eq!(keys(&json[0]), ["model", "title", "topic", "sources", "scenes"]);
    assert_eq!(keys(&json[0]["scenes"][0]), ["scene", "state", "params", "inputs", "outputs", "has_energy"]);
}

#[test]
fn all_models_are_listed_by_topic_and_every_one_has_a_topic() {
    let list = text(&hamel(&["list"], "").stdout);
    let at = |part: &str| list.find(part).unwrap_or_else(|| panic!("{part} in {list}"));
    let order = ["[Rigid bodies]", "heavy_top ", "[Rolling and sliding bodies]", "rattleback ", "[Vehicles"];
    assert!(order.windows(2).all(|pair| at(pair[0]) < at(pair[1])), "{list}");
    assert!(!list.contains("[Others]"), "{list}");
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let out = hamel(&["completions", shell], "");
        let script = text(&out.stdout);
        assert!(out.status.success() && script.contains("hamel") && script.contains("simulate"), "{shell}");
        assert!(script.contains("reconstruct"), "{shell}");
    }
    let page = text(&hamel(&["man"], "").stdout);
    assert!(page.contains(".TH") && page.contains("generate") && page.contains("completions"), "{page}");
    let page = text(&hamel(&["man", "ensemble"], "").stdout);
    assert!(page.contains("sweep"), "{page}");
    let page = text(&hamel(&["man", "simulate"], "").stdout);
    assert!(page.contains("reconstruct") && page.contains("hamel simulate heavy_top"), "{page}");
    let out = hamel(&["man", "simulat"], "");
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("did you mean `simulate`?"));
}

/// Errors of the energy add up with `gbs14`, to 7e-9 here.
#[test]
fn auto_keeps_the_energy_of_long_motions_and_takes_continuous_output_through_events() {
    let by = |t_final: &str, more: &[&str]| {
        let mut arguments = vec!["simulate", "free_rigid_body", "--method", "auto", "--t-final", t_final];
        arguments.extend(more);
        let out = hamel(&arguments, "");
        assert!(out.status.success(), "{}", text(&out.stderr));
        text(&out.stdout)
    };
    assert!(by("10", &[]).contains(" by gbs14,"), "{}", by("10", &[]));
    assert!(!by("10", &["--section", "Omega2"]).contains(" by gbs14,"));
    let long = by("10000", &[]);
    assert!(long.contains(" by projected,"), "{long}");
    let drift = long.split("drift ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    assert!(drift.parse::<f64>().unwrap() < 1e-14, "{long}");
}

/// The columns of a table, as figures of every format and as arrays.
#[test]
fn motions_become_figures_of_chosen_columns_and_arrays() {
    let folder = Folder::new("figures");
    let names = ["top.svg", "top.png", "top.pdf", "top.npz", "top.csv"].map(|name| folder.file(name));
    let [svg, png, pdf, npz, csv] = &names;
    let all = ["-o", svg, "-o", png, "-o", pdf, "-o", npz, "-o", csv];
    let base = ["simulate", "heavy_top", "--via", "interpreter", "--t-final", "1", "--samples", "5"];
    let chosen = ["--plot", "Omega1,Gamma3", "--plot", "energy", "--log"];
    let out = hamel(&[&base[..], &all, &["--plot", "energy,p_Omega3", "--log"]].concat(), "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    let figure = std::fs::read_to_string(svg).unwrap();
    assert!(figure.contains("energy, momentum.p_Omega3") && !figure.contains("angular velocity"), "{figure}");
    assert_eq!(&std::fs::read(png).unwrap()[1..4], b"PNG");
    assert_eq!(&std::fs::read(pdf).unwrap()[..5], b"%PDF-");
    // Arrays have the names and the numbers of the table.
    let table = std::fs::read_to_string(csv).unwrap();
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(std::fs::read(npz).unwrap())).unwrap();
    for (k, name) in table.lines().next().unwrap().split(',').enumerate() {
        let mut bytes = Vec::new();
        let mut entry = archive.by_name(&format!("{name}.npy")).unwrap();
        std::io::Read::read_to_end(&mut entry, &mut bytes).unwrap();
        let numbers = bytes[bytes.len() - 40..].chunks(8).map(|x| f64::from_le_bytes(x.try_into().unwrap()));
        let expected =
            table.lines().skip(1).map(|line| line.split(',').nth(k).unwrap().parse::<f64>().unwrap());
        assert!(numbers.eq(expected), "{name}");
    }
    // Derivatives have names of their own.
    let along = ["-o", svg, "--sensitivity", "l", "--plot", "d_Omega1_d_l"];
    let out = hamel(&[&base[..], &along].concat(), "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(std::fs::read_to_string(svg).unwrap().contains("d_Omega1_d_l"));
    // A velocity that changes its sign has no logarithm.
    let out = hamel(&[&base[..], &["-o", svg], &chosen].concat(), "");
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("which has no logarithm"), "{}", text(&out.stderr));
    let out = hamel(&[&base[..], &["-o", svg, "--plot", "Omega4"]].concat(), "");
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("--plot has no column `Omega4`"), "{}", text(&out.stderr));
    let out = hamel(&["simulate", "heavy_top", "--plot", "Omega1"], "");
    assert_eq!(out.status.code(), Some(2));
}
