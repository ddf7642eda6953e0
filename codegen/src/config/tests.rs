use super::*;

const SPRING: &str = "model spring { coordinate x in real; lagrangian = 1/2*x_dot^2 - 2*x^2; \
                      scene quiet { want rhs; } }";

fn model(text: &str) -> Model {
    spec::parse("spring.hamel", text).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn files_go_where_cargo_says_unless_a_directory_is_given() {
    let mut config = Config::new();
    assert_eq!(config.folder(Some("build/out".into())).unwrap(), Path::new("build/out"));
    let problem = config.folder(None).unwrap_err();
    assert!(matches!(problem, Problem::NoOutDir));
    assert!(problem.to_string().starts_with("OUT_DIR is not set: call this from a build script"));
    config.out_dir("src/generated");
    assert_eq!(config.folder(Some("build/out".into())).unwrap(), Path::new("src/generated"));
}

#[test]
fn warnings_are_for_cargo_only_when_asked_and_never_beside_errors() {
    let idle = SPRING.replace("coordinate", "param m = 2 where m > 0;\n  coordinate");
    let models = [model(SPRING), model(&idle)];
    assert_eq!(Config::new().warnings(&models), Vec::<String>::new());
    let lines = [
        "parameter `m` has no effect",
        " --> spring.hamel:1:22",
        "  |",
        "1 | model spring { param m = 2 where m > 0;",
        "  |                      ^ nothing mentions it",
        "  |",
        "  = help: remove it, or use it in the Lagrangian, a constraint, a force or an output",
    ];
    assert_eq!(Config::new().emit_warnings(true).warnings(&models), lines);
    let wrong = spec::parse("spring.hamel", &idle.replace("2*x^2", "2*y^2")).unwrap_err();
    assert_eq!(wrong.len(), 1, "{wrong}");
}
