//! Fluids that are moved as products of matrices, by the program: beside their equations, of any size, and what is
//! refused.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::Output;

use serde_json::Value;

use crate::common::program;

/// A folder with model files, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, files: &[(&str, String)]) -> Folder {
        let path = std::env::temp_dir().join(format!("hamel-matrices-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        for (file, text) in files {
            std::fs::write(path.join(file), text).unwrap();
        }
        Folder(path)
    }

    fn run(&self, arguments: &[&str], input: &str) -> Output {
        let mut command = program::command(arguments);
        program::output(command.current_dir(&self.0).env_remove("CARGO_MANIFEST_DIR"), input)
    }

    fn done(&self, arguments: &[&str], input: &str) -> String {
        let out = self.run(arguments, input);
        assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
        String::from_utf8(out.stdout).unwrap()
    }

    fn refused(&self, arguments: &[&str], input: &str) -> String {
        let out = self.run(arguments, input);
        assert!(!out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stdout));
        String::from_utf8(out.stderr).unwrap()
    }

    fn json(&self, model: &str, request: &str) -> Value {
        serde_json::from_str(&self.done(&["simulate", model, "--json"], request)).unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn fluid(name: &str, algebra: &str, factor: &str, modes: &[(String, f64)], scene: &str) -> (String, String) {
    let initial: String = modes.iter().map(|(mode, value)| format!("initial {mode} = {value};\n")).collect();
    let text = format!(
        "model {name} {{
            algebra fluid = {algebra};
            /// Vorticity [1/s].
            momentum omega in fluid as *;
            action right;
            hamiltonian = {factor}*dot(omega, laplacian(fluid)^-1*omega);
            casimir C2 = trace_power(fluid, omega, 2);
            casimir C3 = trace_power(fluid, omega, 3);
            {initial}
            {scene}
        }}"
    );
    (format!("{name}.hamel"), text)
}

const PRODUCTS: &str = "scene default { want matrices, energy, casimirs; }";

/// All modes of both algebras with `N = 3`.
fn all_modes(labels: [&str; 8]) -> Vec<(String, f64)> {
    labels.iter().enumerate().map(|(k, name)| ((*name).to_owned(), ((k * k + 1) as f64).sin())).collect()
}

#[test]
fn matrices_move_as_the_equations_of_the_same_model() {
    let torus = ["re_0_1", "im_0_1", "re_1_m1", "im_1_m1", "re_1_0", "im_1_0", "re_1_1", "im_1_1"];
    let sphere = ["c_1_0", "c_1_1", "s_1_1", "c_2_0", "c_2_1", "s_2_1", "c_2_2", "s_2_2"];
    for (algebra, factor, labels) in [("zeitlin(3)", "-1", torus), ("zeitlin_sphere(3)", "-1/2", sphere)] {
        let modes = all_modes(labels);
        let equations = fluid("equations", algebra, factor, &modes, "");
        let products = fluid("products", algebra, factor, &modes, PRODUCTS);
        let files = [(equations.0.as_str(), equations.1), (products.0.as_str(), products.1)];
        let folder = Folder::new(&algebra[..8], &files);
        let initial: Vec<String> = modes.iter().map(|(mode, value)| format!("\"{mode}\": {value}")).collect();
        let initial = initial.join(", ");
        let request =
            |more: &str| format!("{{\"initial\": {{{initial}}}, \"t_final\": 1, \"samples\": 3{more}}}");
        let expected = folder.json("equations.hamel", &request(""));
        // Of second order: the error of half of the step is a quarter of it.
        let found = |step: f64| {
            let answer = folder.json("products.hamel", &request(&format!(", \"step\": {step}")));
            let off = |name: &str| {
                let at = |answer: &Value| answer["final"][name].as_f64().unwrap();
                (at(&answer) - at(&expected)).abs()
            };
            let error = labels.iter().map(|name| off(name)).fold(0.0, f64::max);
            (error, answer)
        };
        let ((coarse, _), (fine, answer)) = (found(0.02), found(0.01));
        assert!(fine < 2e-4 && (3.5..4.5).contains(&(coarse / fine)), "{algebra}: {coarse:e}, {fine:e}");
        assert_eq!(answer["steps"], 100);
        assert_eq!(answer["samples"].as_array().unwrap().len(), 3);
        assert!(answer["energy_drift"].as_f64().unwrap() < 1e-3);
        for name in ["C2", "C3"] {
            let ends = answer["casimirs"][name].as_array().unwrap();
            assert!(
                (ends[0].as_f64().unwrap() - ends[1].as_f64().unwrap()).abs() < 1e-13,
                "{name}: {ends:?}"
            );
        }
    }
}

/// Everything that a fluid of matrices may have beside the energy of an ideal one, on both surfaces: the equations of
/// the same text.
#[test]
fn rotation_radius_friction_and_forces_are_those_of_the_equations() {
    let torus = (
        "hamiltonian = -dot(q, (L - F*identity(24))^-1*q) - b*q_re_0_1 + q_im_1_m2/3;
         force dh_dq = nu*L*q - q/20 - L^2*q/1000;
         force along dh_dq_re_2_0: 0.4; force along dh_dq_im_1_m1: b/10;",
        ["q_re_1_0", "q_im_1_2", "q_re_0_2", "q_re_2_m1"],
        "zeitlin(5)",
    );
    let sphere = (
        "hamiltonian = -1/2*dot(q, (L - F*identity(24))^-1*q) - b*q_c_1_0 + q_s_2_1/3;
         force dh_dq_c_2_0 = 0.4; force along dh_dq_s_3_2: b/10;",
        ["q_c_1_0", "q_s_2_1", "q_c_3_2", "q_s_4_4"],
        "zeitlin_sphere(5)",
    );
    for (terms, modes, algebra) in [torus, sphere] {
        let initial: String =
            modes.iter().enumerate().map(|(k, m)| format!("initial {m} = {}*b;", k + 1)).collect();
        let model = |name: &str, scene: &str| {
            format!(
                "model {name} {{ param b = 0.3; param F = 0.7 where F >= 0; param nu = 0.1;
                 algebra fluid = {algebra}; momentum q in fluid as q_*; action right; let L = laplacian(fluid);
                 {terms} {initial} {scene} }}"
            )
        };
        let (equations, products) = (model("equations", ""), model("products", PRODUCTS));
        let folder = Folder::new("terms", &[("equations.hamel", equations), ("products.hamel", products)]);
        let table = |file: &str, options: &[&str]| {
            let arguments = ["simulate", file, "--t-final", "1", "--samples", "3", "-o", "a.csv"];
            folder.done(&[&arguments, options].concat(), "");
            let text = std::fs::read_to_string(folder.0.join("a.csv")).unwrap();
            let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
            let names = lines.next().unwrap();
            let last = lines.next_back().unwrap();
            let at = |name: &str| last[names.iter().position(|n| n == name).unwrap()].parse::<f64>().unwrap();
            let values: Vec<f64> = modes.iter().chain(&["energy"]).map(|name| at(name)).collect();
            values
        };
        // As published, and with other parameters, which initial values follow.
        for set in [&[][..], &["--set", "b=0.5", "--set", "nu=0.02", "--set", "F=0"]] {
            let expected = table("equations.hamel", set);
            let off = |step: &str| {
                let found = table("products.hamel", &[&["--step", step], set].concat());
                found.iter().zip(&expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
            };
            let (coarse, fine) = (off("0.02"), off("0.01"));
            // Modes have the size 2.
            assert!(fine < 1e-3 && (3.5..4.5).contains(&(coarse / fine)), "{algebra}: {coarse:e}, {fine:e}");
        }
        let said = folder.refused(&["simulate", "products.hamel", "--step", "0.1", "--set", "F=-1"], "");
        assert!(said.contains("the parameters violate `F >= 0`"), "{said}");
        let request = "{\"params\": {\"b\": 0.1}, \"initial\": {}, \"t_final\": 1, \"step\": 0.1}";
        let filled = modes.iter().map(|m| format!("\"{m}\": 0.5")).collect::<Vec<_>>().join(", ");
        let answer = folder.json("products.hamel", &request.replace("{}", &format!("{{{filled}}}")));
        assert_eq!(answer["steps"], 10);
        let page = folder.done(&["report", "products.hamel", "--step", "0.05", "-o", "a.html"], "");
        assert!(page.contains("a.html"), "{page}");
        let page = std::fs::read_to_string(folder.0.join("a.html")).unwrap();
        assert!(page.contains("fluid with friction or force"));
    }
}

/// A magnetic field, a buoyancy and a tracer on both surfaces: the equations of the same text, Casimirs, tables,
/// figures.
#[test]
fn carried_fields_are_those_of_the_equations() {
    let torus = (
        "hamiltonian = -dot(w, L^-1*w) - k*dot(a, L*a) + dot(a, a)/10 + k*b_re_0_1/2;",
        ["w_re_1_0", "w_im_1_1", "a_re_0_1", "a_im_1_m1", "b_re_1_1", "c_im_1_0"],
        "zeitlin(3)",
        "2*",
    );
    let sphere = (
        "hamiltonian = -1/2*dot(w, L^-1*w) - k/2*dot(a, L*a) + dot(a, L^2*a)/50 + k*b_c_1_0/2;",
        ["w_c_1_0", "w_s_2_1", "a_c_2_2", "a_s_1_1", "b_c_2_1", "c_s_2_2"],
        "zeitlin_sphere(3)",
        "",
    );
    for (terms, modes, algebra, factor) in [torus, sphere] {
        // Equations begin anywhere unless they are told.
        let labels = match factor {
            "" => ["c_1_0", "c_1_1", "s_1_1", "c_2_0", "c_2_1", "s_2_1", "c_2_2", "s_2_2"],
            _ => ["re_0_1", "im_0_1", "re_1_m1", "im_1_m1", "re_1_0", "im_1_0", "re_1_1", "im_1_1"],
        };
        let all = ["w", "a", "b", "c"].into_iter().flat_map(|f| labels.map(|label| format!("{f}_{label}")));
        let value = |name: &str| modes.iter().position(|m| *m == name).map_or(0, |at| at + 1);
        let initial: String = all.map(|name| format!("initial {name} = {}/5;", value(&name))).collect();
        let model = |name: &str, scene: &str| {
            format!(
                "model {name} {{ param k = 0.7; algebra fluid = {algebra}; /// Vorticity [1/s].
                 momentum w in fluid as w_*; action right; /// Potential.
                 advected a in fluid as a_* by ad; /// Buoyancy [m/s^2].
                 advected b in fluid as b_* by ad; advected c in fluid as c_* by functions; let L = laplacian(fluid);
                 {terms} casimir A3 = trace_power(fluid, a, 3); output D2 = {factor}dot(w, star_power(fluid, a, 2));
                 {initial} {scene} }}"
            )
        };
        let (equations, products) = (model("equations", ""), model("products", PRODUCTS));
        let products = products.replace("want matrices", "want matrices, A3, D2");
        let files = [("equations.hamel", equations), ("products.hamel", products)];
        let folder = Folder::new(&format!("carried-{}", &algebra[..8]), &files);
        let table = |file: &str, options: &[&str]| {
            let arguments = ["simulate", file, "--t-final", "1", "--samples", "3", "-o", "a.csv"];
            folder.done(&[&arguments, options].concat(), "");
            let text = std::fs::read_to_string(folder.0.join("a.csv")).unwrap();
            let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
            let names = lines.next().unwrap();
            let last = lines.next_back().unwrap();
            let at = |name: &str| last[names.iter().position(|n| n == name).unwrap()].parse::<f64>().unwrap();
            modes.iter().chain(&["energy"]).map(|name| at(name)).collect::<Vec<f64>>()
        };
        for set in [&[][..], &["--set", "k=0.3"]] {
            let expected = table("equations.hamel", set);
            let off = |step: &str| {
                let found = table("products.hamel", &[&["--step", step], set].concat());
                found.iter().zip(&expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
            };
            let (coarse, fine) = (off("0.02"), off("0.01"));
            assert!(fine < 1e-3 && (3.5..4.5).contains(&(coarse / fine)), "{algebra}: {coarse:e}, {fine:e}");
        }
        let fields = ["w", "a", "b", "c"].into_iter();
        let names = fields.flat_map(|f| labels.map(|label| format!("{f}_{label}"))).enumerate();
        let filled = names.map(|(at, name)| format!("\"{name}\": 0.{}", (7 * at + at * at / 8) % 10));
        let filled = filled.collect::<Vec<_>>().join(", ");
        let request = format!("{{\"initial\": {{{filled}}}, \"t_final\": 1, \"step\": 0.05}}");
        let answer = folder.json("products.hamel", &request);
        let ends = |name: &str| {
            let ends = answer["casimirs"][name].as_array().unwrap();
            (ends[0].as_f64().unwrap() - ends[1].as_f64().unwrap()).abs()
        };
        // The buoyancy changes the product with the vorticity.
        assert!(ends("A3") < 1e-13 && ends("D2") > 1e-6, "{answer}");
        // A row of pictures for each field.
        folder.done(&["simulate", "products.hamel", "--step", "0.05", "--t-final", "1", "-o", "a.svg"], "");
        let figure = std::fs::read_to_string(folder.0.join("a.svg")).unwrap();
        assert_eq!(figure.split("<image ").count() - 1, 4 * 6);
        for title in ["Vorticity [1/s]", "Potential", "Buoyancy [m/s²]"] {
            assert!(figure.contains(title), "{algebra}: {title}");
        }
        folder.done(&["report", "products.hamel", "--step", "0.05", "-o", "a.html"], "");
        let page = std::fs::read_to_string(folder.0.join("a.html")).unwrap();
        assert!(page.contains("ideal fluid that carries a, b, c"));
        folder.done(&["generate", "products.hamel", "--out-dir", "out"], "");
        assert!(
            std::fs::read_to_string(folder.0.join("out/products.rs")).unwrap().contains(".with_carried(3)")
        );
    }
}

#[test]
fn any_size_is_simulated_and_generated() {
    let modes = [("re_1_0".to_owned(), 0.5), ("im_1_2".to_owned(), 0.3)];
    let (name, text) = fluid("large", "zeitlin(127)", "-1", &modes, "");
    let folder = Folder::new("large", &[(name.as_str(), text)]);
    let summary = folder.done(
        &[
            "simulate",
            "large.hamel",
            "--step",
            "0.1",
            "--t-final",
            "0.5",
            "--samples",
            "6",
            "-o",
            "a.csv",
            "-o",
            "a.svg",
        ],
        "",
    );
    assert!(summary.contains("by isospectral, step 0.1: 5 steps") && summary.contains("C3"), "{summary}");
    let table = std::fs::read_to_string(folder.0.join("a.csv")).unwrap();
    assert_eq!(table.lines().next(), Some("t,re_1_0,im_1_2,energy,casimirs.C2,casimirs.C3"));
    assert_eq!(table.lines().count(), 7);
    assert!(std::fs::read_to_string(folder.0.join("a.svg")).unwrap().contains("isospectral"));
    folder.done(&["generate", "large.hamel", "--out-dir", "out"], "");
    let module = std::fs::read_to_string(folder.0.join("out/large.rs")).unwrap();
    assert!(module.lines().count() < 150 && module.contains("pub const N: usize = 127;"), "{module}");
    assert!(
        folder.done(&["generate", "large.hamel", "--out-dir", "out", "--check"], "").contains("up to date")
    );
}

/// A figure has a picture for each of six times, a page the same figure; both surfaces.
#[test]
fn fluids_are_drawn() {
    for (algebra, factor, mode) in [("zeitlin(31)", "-1", "re_1_2"), ("zeitlin_sphere(16)", "-1/2", "c_3_2")]
    {
        let (name, text) = fluid("drawn", algebra, factor, &[(mode.to_owned(), 0.5)], "");
        let folder = Folder::new(mode, &[(name.as_str(), text)]);
        let pictures = |file: &str| {
            let text = std::fs::read_to_string(folder.0.join(file)).unwrap();
            let pictures: Vec<String> = text
                .split("<image ")
                .skip(1)
                .map(|rest| rest[..rest.find("/>").unwrap()].to_owned())
                .collect();
            assert!(text.contains("Vorticity [1/s]"), "{algebra}");
            pictures
        };
        let options = ["--t-final", "1", "--step", "0.1"];
        let simulate = ["simulate", "drawn.hamel", "-o", "flow.svg", "--samples", "21"];
        folder.done(&[&simulate[..], &options].concat(), "");
        let drawn = pictures("flow.svg");
        assert_eq!(drawn.len(), 6);
        assert!(drawn.iter().all(|picture| picture.contains("data:image/png;base64,iVBOR")));
        // One wave is a steady flow: pictures in other places, which differ where rounding decides a colour.
        let places: BTreeSet<&str> = drawn.iter().map(|p| &p[..p.find("width").unwrap()]).collect();
        let sizes = drawn.iter().map(String::len);
        let (least, most) = (sizes.clone().min().unwrap(), sizes.max().unwrap());
        assert!(places.len() == 6 && most - least < most / 50, "{algebra}: from {least} to {most} bytes");
        // Two samples have no times between them.
        folder.done(&[&simulate[..5], &["2"][..], &options].concat(), "");
        assert_eq!(pictures("flow.svg").len(), 2);
        folder.done(&[&["report", "drawn.hamel", "-o", "flow.html"][..], &options].concat(), "");
        assert_eq!(pictures("flow.html").len(), 6);
        folder.done(&["report", "drawn.hamel", "-o", "still.html", "--no-run"], "");
        assert!(!std::fs::read_to_string(folder.0.join("still.html")).unwrap().contains("<image"));
    }
}

#[test]
fn what_matrices_cannot_do_is_said() {
    let modes = [("re_1_0".to_owned(), 0.5)];
    let (name, text) = fluid("large", "zeitlin(127)", "-1", &modes, "");
    let folder = Folder::new("refused", &[(name.as_str(), text)]);
    let said = folder.refused(&["explain", "large.hamel"], "");
    assert!(said.contains("moved as products of matrices") && said.contains("hamel simulate"), "{said}");
    let said = folder.refused(&["report", "large.hamel"], "");
    assert!(said.contains("--step is what a fluid of matrices is moved by"), "{said}");
    let said = folder.refused(&["report", "zeitlin_euler_3", "--step", "0.1"], "");
    assert!(said.contains("--step is for fluids of matrices"), "{said}");
    let cases: [(&[&str], &str); 8] = [
        (&[], "--step is what a fluid of matrices is moved by"),
        (&["--step", "0.1", "--method", "rk4"], "method rk4: matrices are moved by isospectral alone"),
        (&["--step", "0.1", "--method", "dop853"], "method dop853: matrices are moved by isospectral alone"),
        (&["--step", "0.1", "--reconstruct"], "--reconstruct is not possible"),
        (&["--step", "0.1", "--sensitivity", "re_1_0"], "--sensitivity is not possible"),
        (&["--step", "0.1", "--scene", "minimal"], "no scene `minimal`"),
        (&["--step", "0.1", "--initial", "re_9_9=1"], "re_9_9"),
        (&["--step", "0.1", "--set", "mu=1"], "mu"),
    ];
    for (options, expected) in cases {
        let said = folder.refused(&[&["simulate", "large.hamel"], options].concat(), "");
        assert!(said.contains(expected), "{options:?}: {said}");
    }
    let adaptive = "{\"initial\": {\"re_1_0\": 1}, \"t_final\": 1}";
    let said = folder.refused(&["simulate", "large.hamel", "--json"], adaptive);
    assert!(said.contains("moved in fixed steps: give the step"), "{said}");
    let differentiated =
        "{\"initial\": {\"re_1_0\": 1}, \"t_final\": 1, \"step\": 0.1, \"sensitivity\": [\"re_1_0\"]}";
    let said = folder.refused(&["simulate", "large.hamel", "--json"], differentiated);
    assert!(said.contains("no derivatives of its motion"), "{said}");
    let said = folder.refused(&["generate", "large.hamel", "--out-dir", "out", "--mod-file", "mod.rs"], "");
    assert!(said.contains("is a fluid of matrices"), "{said}");
    // And what has equations is not moved as matrices.
    let said =
        folder.refused(&["simulate", "zeitlin_euler_3", "--method", "isospectral", "--step", "0.1"], "");
    assert!(said.contains("has equations"), "{said}");
}

/// Modes that a request leaves out begin as the model says, with the parameters of the request.
#[test]
fn requests_may_leave_out_modes_that_the_model_gives() {
    let text = "/// Waves
        model waves {
            param b = 0.3;
            algebra fluid = zeitlin(9);
            momentum omega in fluid as *;
            action right;
            hamiltonian = -dot(omega, laplacian(fluid)^-1*omega);
            initial re_1_0 = b;
            initial im_1_2 = 0.25;
            scene default { want matrices, energy; }
        }";
    let folder = Folder::new("left-out", &[("waves.hamel", text.to_owned())]);
    let request =
        |rest: &str| folder.json("waves.hamel", &format!("{{\"t_final\": 0.1, \"step\": 0.05{rest}}}"));
    let short = request(", \"params\": {\"b\": 0.5}");
    let whole = request(", \"initial\": {\"re_1_0\": 0.5, \"im_1_2\": 0.25}");
    assert_eq!(short["final"], whole["final"]);
    assert_eq!(short["initial"], serde_json::json!({"re_1_0": 0.5, "im_1_2": 0.25}));
    assert!(whole.get("initial").is_none());
    let one = request(", \"initial\": {\"re_1_0\": 0.5}");
    assert_eq!(one["final"], whole["final"]);
}
