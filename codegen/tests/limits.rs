//! No text runs away: what is within the budget ends with a program, everything else with an error that says what grew.
//!
//! Budgets count expressions, bytes and steps, so these tests see the same on every machine. The limits of the language
//! itself are in `tests/bad` and beside the modules that have them.

use hamel_codegen::config::Config;
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::Budget;
use hamel_program::program::Role;

/// The default scene of a model of these items, or the report.
fn built(budget: Budget, items: &str) -> Result<BuiltScene, String> {
    let text = format!("model big {{\n{items}\n}}");
    let model = spec::parse_within(budget, "big.hamel", &text);
    let scene = model.and_then(|model| scene::build(&model, scene::DEFAULT));
    scene.map_err(|problems| problems.to_string())
}

/// Asserts that a model ends within a budget: with a program, or with a report of what was not enough; whether with a
/// program.
fn ends(budget: Budget, items: &str) -> bool {
    let start: String = items.chars().take(300).collect();
    match built(budget, items) {
        Ok(scene) => {
            let spent = scene.spent();
            assert!(spent.expressions <= budget.expressions, "{spent:?}\n{start}");
            assert!(spent.bytes <= budget.bytes && spent.work <= budget.work, "{spent:?}\n{start}");
            true
        }
        Err(report) => {
            let is_about_size = ["more than", "too large", "the limit is", "out of the range of f64"];
            assert!(is_about_size.iter().any(|part| report.contains(part)), "{report}");
            assert!(!report.contains("please report"), "{report}");
            false
        }
    }
}

fn list(n: usize, name: impl Fn(usize) -> String) -> Vec<String> {
    (1..=n).map(name).collect()
}

/// `1/2 |x_dot|^2 + sum_{i<j} sin(x_i - x_j)^2 x_i_dot x_j_dot`.
fn dense_mass_matrix(n: usize) -> String {
    let x = list(n, |i| format!("x{i}")).join(", ");
    let mut terms = list(n, |i| format!("{n}*x{i}_dot^2"));
    for i in 1..=n {
        terms.extend((i + 1..=n).map(|j| format!("sin(x{i} - x{j})^2*x{i}_dot*x{j}_dot")));
    }
    format!("coordinate {x} in real;\nlagrangian = {};", terms.join(" + "))
}

fn determinant(n: usize) -> String {
    let entry = |i: usize, j: usize| format!("q{}", (i - 1) * n + j);
    let rows = list(n, |i| format!("[{}]", list(n, |j| entry(i, j)).join(", ")));
    let q = list(n * n, |k| format!("q{k}"));
    let rates: Vec<String> = q.iter().map(|q| format!("{q}_dot^2")).collect();
    format!(
        "coordinate {} in real;\nlagrangian = ({})/2 - det([{}]);",
        q.join(", "),
        rates.join(" + "),
        rows.join(", ")
    )
}

/// `|x_dot|^2 (1 + prod_{i<j} (1 + sin x_i cos x_j))`.
fn product_of_sums(n: usize) -> String {
    let x = list(n, |i| format!("x{i}"));
    let rates: Vec<String> = x.iter().map(|x| format!("{x}_dot^2")).collect();
    let mut factors = Vec::new();
    for i in 1..=n {
        factors.extend((i + 1..=n).map(|j| format!("(1 + sin(x{i})*cos(x{j}))")));
    }
    let (x, rates, factors) = (x.join(", "), rates.join(" + "), factors.join("*"));
    format!("coordinate {x} in real;\nlagrangian = ({rates})*(1 + {factors});")
}

#[test]
fn a_dense_mass_matrix_of_thirty_coordinates_ends() {
    ends(Budget::default(), &dense_mass_matrix(30));
}

#[test]
fn two_hundred_advected_components_are_a_multiplication_each() {
    for lagrangian in ["v^2/2", "v^2/2 + G1", "v^2/2 - dot(G, G)/2"] {
        let items = format!("velocity v in R; advected G in R^200 by v*G; lagrangian = {lagrangian};");
        let scene = built(Budget::default(), &items).unwrap();
        let rhs = &scene.program().functions[scene.program().function_idx(&Role::Rate).unwrap()];
        assert!(rhs.counts().mul <= 402 && rhs.counts().total() <= 805, "{lagrangian}: {}", rhs.counts());
        // A thousandth of a budget that is about a minute.
        assert!(scene.spent().work < Budget::default().work / 50, "{lagrangian}: {:?}", scene.spent());
        assert!(scene.spent().expressions < 20_000, "{lagrangian}: {:?}", scene.spent());
    }
}

#[test]
fn the_determinant_of_an_eight_by_eight_matrix_of_coordinates_ends() {
    assert!(ends(Budget::default(), &determinant(5)));
    ends(Budget::default(), &determinant(8));
}

#[test]
fn a_product_of_sixty_six_sums_ends() {
    ends(Budget::default(), &product_of_sums(12));
}

/// Families of models that grow with a number: each ends within whatever budget it is given.
#[test]
fn growing_families_end_within_their_budget() {
    let budget = Budget { expressions: 60_000, bytes: 24 << 20, work: 8_000_000 };
    let repeated = |n: usize, what: &dyn Fn(usize) -> String| -> String { (1..=n).map(what).collect() };
    type Family = (&'static str, Box<dyn Fn(usize) -> String>, &'static [usize]);
    let families: Vec<Family> = vec![
        ("dense mass matrices", Box::new(dense_mass_matrix), &[2, 6, 16, 60]),
        ("determinants", Box::new(determinant), &[2, 4, 6, 8]),
        ("products of sums", Box::new(product_of_sums), &[2, 6, 14]),
        (
            "powers of sums",
            Box::new(|n| {
                format!(
                    "param a = 1; param b = 2; velocity v in R^3; lagrangian = dot(v, v)*(a + b*v1 + v2 + v3^2)^{n};"
                )
            }),
            &[2, 16, 1000],
        ),
        (
            "definitions that double",
            Box::new(move |n| {
                let lets = repeated(n, &|k| format!("let z{k} = z{0}*z{0} + 1/3*z{0}*v1;\n", k - 1));
                format!("velocity v in R^2; let z0 = v2;\n{lets}lagrangian = dot(v, v) + sin(z{n});")
            }),
            &[2, 8, 40, 300],
        ),
        (
            "sums that double",
            Box::new(move |n| {
                let lets = repeated(n, &|k| format!("let z{k} = (z{0} + v1)*(z{0} - q);\n", k - 1));
                format!(
                    "coordinate q in real; velocity v in R^2; let z0 = v2;\n{lets}lagrangian = dot(v, v) + q_dot^2 + z{n};"
                )
            }),
            &[2, 5, 20, 200],
        ),
        (
            "long products",
            Box::new(|n| {
                let factors = list(n, |k| format!("(q + {k})"));
                format!("coordinate q in real; lagrangian = q_dot^2*{};", factors.join("*"))
            }),
            &[2, 40, 2000],
        ),
        (
            "deep functions",
            Box::new(move |n| {
                let lets = (1..=n).map(|k| format!("let f{k} = sin(f{} + {k}/7);\n", k - 1));
                let lets: String = lets.collect();
                format!("coordinate q in real; let f0 = q;\n{lets}lagrangian = q_dot^2*(2 + f{n});")
            }),
            &[2, 30, 1000],
        ),
        (
            "large numbers",
            Box::new(move |n| {
                let lets = (1..=n).map(|k| format!("let n{k} = n{0}*n{0};\n", k - 1));
                let lets: String = lets.collect();
                format!("let n0 = 10;\n{lets}coordinate q in real; lagrangian = q_dot^2 + q*n{n}/(n{n} + 1);")
            }),
            &[2, 8, 16, 40],
        ),
        (
            "small numbers",
            Box::new(|n| {
                let terms = list(n, |k| format!("q^2/(3^{} + {k})", k % 900));
                format!("coordinate q in real; lagrangian = q_dot^2 + {};", terms.join(" + "))
            }),
            &[2, 50, 900],
        ),
        (
            "a parameter that is fixed to a long number",
            Box::new(|n| {
                format!(
                    "param a = 2; coordinate q in real; lagrangian = q_dot^2 + q/(a + (1/3)^{n} + q*a^{n});
                     output h = ((a + 1)^{n} + 1/7)^{n};"
                )
            }),
            &[2, 60, 1000],
        ),
        (
            "many parameters",
            Box::new(|n| {
                let params: String = (1..=n).map(|k| format!("param p{k} = {k};\n")).collect();
                let terms = list(n, |k| format!("p{k}*(v1 + p{}*v2)^2", n + 1 - k));
                format!("{params}velocity v in R^2; lagrangian = {};", terms.join(" + "))
            }),
            &[2, 40, 400],
        ),
        (
            "constraints",
            Box::new(|n| {
                let x = list(n, |i| format!("x{i}"));
                let rates: Vec<String> = x.iter().map(|x| format!("{x}_dot^2")).collect();
                let constraints = list(n / 2, |k| {
                    let terms = list(n, |i| format!("(2 + sin({k}*x{i}))*x{i}_dot"));
                    format!("constraint {} = 0;", terms.join(" + "))
                });
                format!(
                    "coordinate {} in real; lagrangian = {};\n{}",
                    x.join(", "),
                    rates.join(" + "),
                    constraints.join("\n")
                )
            }),
            &[2, 6, 12],
        ),
    ];
    for (name, family, sizes) in families {
        for n in sizes {
            eprintln!("{name} {n}");
            ends(budget, &family(*n));
        }
        assert!(ends(Budget::default(), &family(sizes[0])), "{name} {}", sizes[0]);
    }
}

#[test]
fn the_report_says_where_what_grew_and_what_to_do() {
    let items = dense_mass_matrix(12);
    let few = Budget { expressions: 2_000, ..Budget::default() };
    let report = built(few, &items).unwrap_err();
    assert!(report.contains("makes more than 2000 expressions"), "{report}");
    assert!(report.contains("big.hamel:3:"), "{report}");
    assert!(report.contains("`--budget 4`") && report.contains("`Config::budget`"), "{report}");
    let little = Budget { bytes: 1 << 20, ..Budget::default() };
    assert!(built(little, &items).unwrap_err().contains("takes more than 1 MiB of memory"));
    let short = Budget { work: 100_000, ..Budget::default() };
    let report = built(short, &items).unwrap_err();
    assert!(report.contains("takes more than 100000 steps of work"), "{report}");
    // What was not made is never taken for what was asked for.
    for work in (1..40).map(|k| 25_000 * k) {
        let short = Budget { work, ..Budget::default() };
        let items = "param a = 2; coordinate x, y in real; velocity v in R^2; constraint v1 = sin(x)*v2;
                     lagrangian = dot(v, v) + x_dot^2 + y_dot^2*(2 + cos(x)) + a*x*y*v1; casimir c = 1;";
        match built(short, items) {
            Ok(scene) => {
                // A search that was cut short gives another form of the same function.
                let whole = built(Budget::UNLIMITED, items).unwrap();
                let [a, b] = [&scene, &whole].map(|scene| {
                    let mut rate = vec![0.0; scene.state().len()];
                    let state: Vec<f64> = (0..rate.len()).map(|k| 0.3 + 0.1 * k as f64).collect();
                    scene.prepare(&[2.0]).unwrap().rhs(0.0, &state, &mut rate);
                    rate
                });
                // Rates of size one, some hundred operations.
                assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-13), "{work}: {a:?} {b:?}");
            }
            Err(report) => assert!(report.contains("steps of work"), "{report}"),
        }
    }
}

#[test]
fn a_build_script_sets_the_budget() {
    let model = spec::parse("m.hamel", &format!("model m {{ {} }}", dense_mass_matrix(4))).unwrap();
    let few = Budget { expressions: 300, ..Budget::default() };
    let problems = Config::new().budget(few).generate(std::slice::from_ref(&model)).unwrap_err();
    assert!(problems.to_string().contains("makes more than 300 expressions"), "{problems}");
    assert!(Config::new().budget(Budget::default().times(2)).generate(&[model]).is_ok());
}

#[test]
fn a_derivation_that_grows_too_large_is_refused() {
    let report = built(
        Budget::default(),
        "velocity x in R^90;
         let A = x*transpose(x);
         lagrangian = dot(x, A*A*x);",
    )
    .unwrap_err();
    assert!(report.contains("more than"), "{report}");
    assert!(report.contains("big.hamel:4:"), "{report}");
}

#[test]
fn powers_of_sums_are_not_expanded() {
    for energy in [
        "v1^2*(a + b + c*v2)^200 + dot(v, v)",
        "dot(v, v) + (v1 + v2)^(1/1000)",
        // Too few points of the zero test have all these roots, so that it falls back to multiplying out.
        "dot(v, v) + 1/(sqrt(v1 + 1) + sqrt(v2 + 2) + sqrt(v3 + 3) + sqrt(a + 5))^16 - ((v1 + v2 + v3)^16 + sqrt(v1 + 7))^16",
    ] {
        let items =
            format!("param a = 1; param b = 2; param c = 3; velocity v in R^3; lagrangian = {energy};");
        let report = built(Budget::default(), &items).err().unwrap_or_default();
        assert_eq!(report, "", "{energy}");
    }
}

#[test]
fn expressions_that_share_their_parts_have_texts_of_moderate_length() {
    let lets: String = (1..=60).map(|k| format!("let z{k} = sin(z{0}) + cos(z{0});\n", k - 1)).collect();
    let items = format!("velocity v in R^2; let z0 = v2;\n{lets}lagrangian = dot(v, v); output h = z60;");
    let text = format!("model big {{\n{items}\n}}");
    let model = spec::parse("big.hamel", &text).unwrap();
    let (_, e) = &model.outputs[0].components[0];
    let shown = model.graph.display(*e, hamel_expr::Style::Plain);
    assert!(shown.len() < 1 << 22, "{} bytes", shown.len());
}
