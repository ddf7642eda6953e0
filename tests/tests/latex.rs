//! Explanations of all shipped models in LaTeX: nothing in them that pdflatex refuses.

use hamel_codegen::explain::{self, dirac, explain};
use hamel_codegen::scene;
use hamel_codegen::spec::{self, Model};
use hamel_expr::Style;
use hamel_mechanics::mechanics::connection_coefficients;
use hamel_tests::latex::problems;
use hamel_tests::models;

/// What is wrong with the explanation of a model and with its Dirac structure.
fn of_model(model: &Model) -> Vec<String> {
    let built = scene::build(model, scene::DEFAULT).unwrap_or_else(|e| panic!("{e}"));
    let mut texts = vec![explain(model, &built, Style::Latex), dirac(model, &built, Style::Latex)];
    if let Ok(found) = connection_coefficients(&built.equations().system) {
        texts.push(explain::connection_coefficients(&found, Style::Latex));
    }
    assert!(texts[0].contains("\\begin{align*}"), "{}: nothing is explained", model.name);
    texts.iter().flat_map(|text| problems(text)).take(5).map(|p| format!("{}: {p}", model.name)).collect()
}

/// One of two halves of the models, the second of which takes its time at length alone.
fn half(which: usize) {
    let specs = models::names().into_iter().map(|name| models::model(&name));
    let shelf = models::names_on_shelf().into_iter().map(|name| {
        let text = models::text_from_shelf(&name);
        spec::parse(&name, &text).unwrap_or_else(|e| panic!("{e}"))
    });
    let all: Vec<Model> = specs.chain(shelf).collect();
    assert!(all.len() > 50, "{}", all.len());
    let found: Vec<String> = all.iter().skip(which).step_by(2).flat_map(of_model).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn explanations_of_shipped_models_compile() {
    half(0);
}

#[test]
#[ignore = "takes long: `cargo xtask test --all` runs it"]
fn explanations_of_the_other_shipped_models_compile() {
    half(1);
}

/// Names, texts and documentation with everything that TeX takes for a command.
#[test]
fn what_a_model_says_stands_for_itself() {
    let text = "/// 100 % of {x} & y_1 ~ #2 $ \\alpha ^ | < > \"q\" -- é ω → x² 中
        model m {
            source \"A_B & C: {D} 5 %\";
            /// Mass_1 [kg m^2], 1 % & more.
            param m_1 = 2 where m_1 > 0;
            param power_of_it = 1;
            /// Angle φ [rad].
            coordinate phi in angle;
            coordinate some_place in real;
            velocity w, v_long in se(2);
            lagrangian = (phi_dot^2 + m_1*w^2 + some_place_dot^2 + dot(v_long, v_long))/2 - power_of_it*cos(phi)*sqrt(2);
            constraint no_slip: v_long2 = some_place*w + t;
            casimir c = 0*phi;
        }";
    let text = text.replace("casimir c = 0*phi;", "");
    let model = spec::parse("m", &text).unwrap_or_else(|e| panic!("{e}"));
    let found = of_model(&model);
    assert!(found.is_empty(), "{}", found.join("\n"));
}
