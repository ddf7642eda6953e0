//! Random text never makes the front end panic, and its messages always render.

use super::SPECS;
use hamel_codegen::spec::parse;

const SEED: u64 = 0x5eed_0000_2024_0817;

struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        hamel_expr::split_mix(&mut self.0)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

fn run(text: &str) {
    if let Err(problems) = parse("fuzz.hamel", text) {
        assert!(!problems.is_empty(), "failed without a problem");
        for problem in problems.iter() {
            if let Some(span) = problem.span {
                assert!(
                    span.start <= text.len() && span.end <= text.len() + 1,
                    "{problem:?} outside of {text:?}"
                );
            }
        }
        assert!(problems.render(true).len() >= problems.render(false).len());
    }
}

fn boundary(text: &str, mut at: usize) -> usize {
    while !text.is_char_boundary(at) {
        at += 1;
    }
    at
}

#[test]
fn truncated_specs_do_not_panic() {
    for (_, text) in SPECS {
        for at in (0..text.len()).step_by(37) {
            run(&text[..boundary(text, at)]);
        }
    }
}

#[test]
fn mutated_specs_do_not_panic() {
    eprintln!("seed {SEED:#x}");
    let mut random = Random(SEED);
    const PIECES: &[&str] = &[
        "(",
        ")",
        "[",
        "]",
        "{",
        "}",
        ";",
        ",",
        "=",
        "^",
        "*",
        "/",
        "+",
        "-",
        "0",
        "1e400",
        "9999999999",
        "Omega",
        "I",
        "Gamma1",
        "in",
        "R",
        "so(3)",
        "'",
        "\"",
        "#",
        "///",
        "//",
        "/*",
        "é",
        "∞",
        "\u{0}",
        "1/0",
        "[[1], 2]",
        "where",
        "param",
        "let",
        "stage s = ideal(",
        "model",
        "^^",
        "..",
        "->",
        "0.5.5",
        "2^1000",
        "t",
        "pi",
        "norm(0)",
        ":",
        "R^0",
        "delta(Omega)",
        "ddt(Omega1)",
        "ddt(ddt(Omega1))",
        "; virtual delta(Omega1) = 0;",
        "; quasi_velocity s;",
        "; reconstruct q in SO(3) from Omega;",
        "; initial Omega1 = 1/0;",
    ];
    for _ in 0..1500 {
        let (_, text) = SPECS[random.below(SPECS.len())];
        let mut text = text.to_owned();
        for _ in 0..=random.below(4) {
            let at = boundary(&text, random.below(text.len()));
            let end = boundary(&text, (at + random.below(12)).min(text.len()));
            let piece = match random.below(3) {
                0 => String::new(),
                1 => PIECES[random.below(PIECES.len())].to_owned(),
                _ => {
                    let from = boundary(&text, random.below(text.len()));
                    let to = boundary(&text, (from + random.below(30)).min(text.len()));
                    text[from..to].to_owned()
                }
            };
            text.replace_range(at..end, &piece);
            if text.is_empty() {
                break;
            }
        }
        run(&text);
    }
}

#[test]
fn token_soup_does_not_panic() {
    eprintln!("seed {SEED:#x}");
    let mut random = Random(SEED ^ 1);
    const WORDS: &[&str] = &[
        "model",
        "m",
        "{",
        "}",
        "(",
        ")",
        "[",
        "]",
        ";",
        ";",
        ";",
        ",",
        "=",
        ":",
        "+",
        "-",
        "*",
        "/",
        "^",
        "<",
        ">",
        ">=",
        "!=",
        "param",
        "let",
        "a",
        "b",
        "a1",
        "b1",
        "velocity",
        "Omega",
        "Omega1",
        "V",
        "in",
        "so",
        "se",
        "(3)",
        "R",
        "^3",
        "algebra",
        "g",
        "product",
        "semidirect",
        "standard",
        "adjoint",
        "stage",
        "ideal",
        "inner_product",
        "coordinate",
        "theta",
        "angle",
        "real",
        "advected",
        "Gamma",
        "by",
        "cross",
        "dot",
        "lagrangian",
        "constraint",
        "independent",
        "multipliers",
        "force",
        "casimir",
        "output",
        "section",
        "event",
        "then",
        "falling",
        "stop",
        "connection",
        "virtual",
        "quasi_velocity",
        "reconstruct",
        "initial",
        "delta",
        "ddt",
        "(Omega)",
        "theta_dot",
        "SO",
        "SE",
        "from",
        "scene",
        "drop",
        "fix",
        "want",
        "energy",
        "1",
        "2",
        "0.5",
        "1e-3",
        "vector",
        "matrix",
        "symmetric",
        "diagonal",
        "where",
        "require",
        "source",
        "topic",
        "\"x\"",
        "/// doc\n",
        "\n",
        "basis",
        "identity",
        "norm",
        "sqrt",
        "det",
        "transpose",
        "representation",
        "of",
        "on",
        "e1",
        "[h, e] = h;",
        "t",
        "pi",
        "0",
    ];
    for round in 0..1500 {
        let mut text = String::from(if round % 4 == 0 { "" } else { "model soup {\n" });
        for _ in 0..random.below(60) {
            text.push_str(WORDS[random.below(WORDS.len())]);
            text.push(' ');
        }
        if round % 4 != 0 {
            text.push('}');
        }
        run(&text);
    }
}

#[test]
fn pathological_texts_do_not_panic() {
    let model = |item: &str| format!("model m {{ velocity x in R; {item} }}");
    let repeat = |s: &str, n: usize| s.repeat(n);
    let mut texts = vec![
        String::new(),
        "\u{feff}".into(),
        "\u{feff}model m { lagrangian = é; }".into(),
        repeat("(", 100_000),
        repeat(")", 1000),
        repeat("{", 70) + &repeat("}", 70),
        repeat("'", 1000),
        repeat("model m { }", 1000),
        repeat("/*", 1000),
        repeat("/// doc\n", 1000),
        repeat("x", 2 << 20),
        model(&format!("lagrangian = {}x{};", repeat("(", 5000), repeat(")", 5000))),
        model(&format!("lagrangian = {}x{};", repeat("(", 62), repeat(")", 62))),
        model(&format!("lagrangian = {}x{};", repeat("sin(-1*", 20), repeat(")", 20))),
        model(&format!("lagrangian = {}x{};", repeat("2*sin(1+-[", 30), repeat("][1]^2)", 30))),
        model(&format!("lagrangian = {}x;", repeat("-", 5000))),
        model(&format!("lagrangian = x{};", repeat("^2", 5000))),
        model(&format!("lagrangian = x{};", repeat("+x", 20_000))),
        model(&format!("lagrangian = x{};", repeat("*x", 20_000))),
        model(&format!("lagrangian = x{};", repeat("[1]", 5000))),
        model(&format!("lagrangian = {};", repeat("9", 100_000))),
        model("lagrangian = 2^1000^1000;"),
        model("lagrangian = ((((2^1000)^1000)^1000)^1000)*x;"),
        model("lagrangian = ((((2*x)^1000)^1000)^1000)^1000;"),
        model("lagrangian = 0^-1*x + 0^0 + ln(0) + sqrt(-1) + (-8)^(1/3) + tan(pi/2) + acos(2);"),
        model("lagrangian = norm([0, 0])/norm([0, 0]);"),
        model("lagrangian = abs(x - x)*x + 1/(x - x);"),
        model("param a = 1e400; lagrangian = a*x;"),
        model("param a = 2; let b = a^1000; let c = b^1000; let d = c^1000; require d > 0; lagrangian = x;"),
        model("param a: matrix(200, 200) = [0]; lagrangian = x;"),
        model("algebra a = adjoint; algebra b = product(b, b); lagrangian = x;"),
        "model m { velocity x in product(R^200, R^200); lagrangian = 1; }".into(),
        "model m { velocity x in semidirect(R^200, adjoint); lagrangian = 1; }".into(),
        "model m { velocity x in su(200); lagrangian = 1; }".into(),
        "model m { velocity x in R^200; lagrangian = dot(x, x); constraint x = 0; }".into(),
    ];
    texts.push(model(&repeat("virtual delta(x) = 0;", 20_000)));
    texts.push(model(&repeat("reconstruct q in R^99 from x;", 20_000)));
    texts.push(model(&repeat("quasi_velocity s, u;", 20_000)));
    texts.push(model(&repeat("initial x = 1; initial y = 1;", 10_000)));
    let mut lets = String::new();
    for k in 0..3000 {
        lets.push_str(&format!("let y{k} = y{};", k + 1));
    }
    texts.push(model(&format!("{lets} let y3000 = x; lagrangian = y0;")));
    texts.push(model(&format!("{lets} lagrangian = y0;")));
    texts.push(model(&format!("{lets} let y3000 = y0; lagrangian = y0;")));
    let mut doubling = String::from("let z0 = x;");
    for k in 1..200 {
        doubling.push_str(&format!("let z{k} = z{0}*z{0} + 1/3*z{0};", k - 1));
    }
    texts.push(model(&format!("{doubling} lagrangian = z199;")));
    let mut algebras = String::from("algebra a0 = so(3);");
    for k in 1..200 {
        algebras.push_str(&format!("algebra a{k} = product(a{0}, a{0});", k - 1));
    }
    texts.push(model(&format!("{algebras} lagrangian = x;")));
    for text in &texts {
        let start = std::time::Instant::now();
        run(text);
        let shown: String = text.chars().take(80).collect();
        assert!(start.elapsed().as_secs() < 20, "{shown} takes {:?}", start.elapsed());
    }
}

#[test]
fn too_much_work_is_one_problem() {
    let row = format!("[{}]", vec!["x"; 200].join(", "));
    let items = format!(
        "let r = {row}; let a = r*transpose(r); let b = a*a; let c = b*b; let d = c*c; lagrangian = d[1, 1];"
    );
    let problems = parse("big.hamel", &format!("model m {{ velocity x in R; {items} }}")).unwrap_err();
    let messages: Vec<&str> = problems.iter().map(|p| p.message.as_str()).collect();
    assert_eq!(messages, ["evaluation of the model's values takes more than 200000000 steps of work"]);
}
