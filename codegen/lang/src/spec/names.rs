//! Legal names, reserved names and "did you mean".

use super::diagnostic::Help;
use super::want::Want;

/// Momenta along the levels of stages are called by it and the names of these, where the model says nothing else.
pub const LEVEL_MOMENTUM: &str = "p";

/// First words of the items of a model, each with the form of the item.
pub(super) const ITEMS: &[(&str, &str)] = &[
    ("source", "source \"Author, year\";"),
    ("topic", "topic \"Rolling bodies\";"),
    ("size", "size n = 5 where n >= 2;"),
    ("for", "for k in 1..n { let s[k] = k*r; }"),
    ("param", "param m = 1 where m > 0;` or `param chi: vector(3) = [0, 0, 1];"),
    ("input", "input u = 0;` or `input tau: vector(2) = [0, 0];"),
    ("noise", "noise W: h;` or `noise W;"),
    ("drive", "drive u = -k*x;"),
    ("require", "require a > b, c != 0;"),
    ("let", "let name = expression;"),
    ("algebra", "algebra g = so(3);` or `algebra g { basis a, b; [a, b] = a; }"),
    ("almost", "almost algebra g { basis a, b, c; [a, b] = c; }"),
    ("algebroid", "algebroid { basis e1, e2; velocities u, v; anchor x_dot = u; [e1, e2] = x*e2; }"),
    ("representation", "representation r of so(3) on R^3 { e1 = [[..], ..]; .. }"),
    ("velocity", "velocity Omega, V in se(3);"),
    ("momentum", "momentum Pi of Omega;` or `momentum Pi in so(3);"),
    ("carry", "carry Pi;"),
    ("routh", "routh phi = p;` or `routh Omega -> Pi;"),
    ("quasi_velocity", "quasi_velocity s;"),
    ("frame", "frame { u = r*phi_dot; }` or `frame tool at p attitude R;"),
    ("connection", "connection Omega = A*x_dot;` or `connection mechanical;"),
    ("action", "action left;"),
    ("stage", "stage whole;` or `stage translation = ideal(V);"),
    ("inner_product", "inner_product = diag([1, 1, 2]);"),
    ("coordinate", "coordinate theta in angle;` or `coordinate x: vector(2) in (0, 1);"),
    ("advected", "advected Gamma in R^3 by cross(Omega, Gamma);"),
    ("configuration", "configuration R in SO(3) velocity Omega;"),
    ("state", "state i in real by i_dot = (V - R*i)/L;"),
    ("lagrangian", "lagrangian = expression;"),
    ("hamiltonian", "hamiltonian = expression;"),
    ("acceleration", "acceleration v = -k*x;"),
    ("field", "field x_dot = -k*x;"),
    (
        "constraint",
        "constraint name: dot(Omega, Gamma) = 0;` or `constraint name for v3: v = cross(r, Omega);",
    ),
    ("virtual", "virtual delta(v1) + delta(v2) = 0;` or `virtual thermo;"),
    ("independent", "independent Omega, x_dot;"),
    ("multipliers", "multipliers;"),
    ("actuate", "actuate u along x_dot;"),
    ("lyapunov", "lyapunov V = x_dot^2/2 + x^2/2 rate -k*dV_du^2;"),
    ("force", "force Omega = -c*Omega;` or `force at p: F;"),
    ("moment", "moment on B: M;"),
    ("body", "body B { mass m; place p; inertia I; attitude R; }"),
    ("use", "use \"motor.hamel\" as motor;` or `use \"motor.hamel\" as motor { k = 2; }"),
    ("reduces", "reduces \"full.hamel\" { Gamma = transpose(R)*[0, 0, 1]; }"),
    ("casimir", "casimir name = expression;"),
    ("output", "output name = expression;"),
    ("section", "section s = [1, 0, x];` or `section s in so(3) = Gamma;"),
    ("mode", "mode stance { constraint foot: v = 0; }` or `mode flight;"),
    (
        "event",
        "event impact = z falling { then v = -e*v; }` or `event lift when lambda_foot < 0 { leave stance; }",
    ),
    ("reconstruct", "reconstruct q in SO(3) from Omega;` or `reconstruct x by v;"),
    ("initial", "initial Omega = [0, 0, 1];"),
    ("view", "view name = ball(r) at [x, y, r] attitude q;"),
    ("want", "want digits;"),
    ("scene", "scene name { fix m = 1; want energy; drop x; }"),
];

/// Whether a word begins an item.
pub(super) fn is_item(word: &str) -> bool {
    ITEMS.iter().any(|(item, _)| *item == word)
}

/// What an item looks like, as a hint; nothing for other words.
pub(super) fn item_form(word: &str) -> Option<String> {
    ITEMS.iter().find(|(item, _)| *item == word).map(|(_, form)| format!("written as `{form}`"))
}

/// The item that a word of another language or of the literature stands for.
pub(super) fn item_meant_by(word: &str) -> Help {
    let advice = match word {
        "parameter" | "parameters" | "const" | "constant" => "write `param name = value;`",
        "control" | "controls" | "inputs" | "actuator" => "write `input u = 0;` and use it in `force`",
        "kinetic" | "potential" => {
            "name it with `let`; the system is given by `lagrangian = ..;` or `hamiltonian = ..;`"
        }
        "variable" | "var" => {
            "write `coordinate` for the base, `velocity` for the algebra, `advected` for what the group moves, \
             `state` for what has a rate of its own"
        }
        "group" => {
            "write `configuration R in SO(3) velocity Omega;`; or reduced by it, `velocity Omega in so(3);` and `reconstruct`"
        }
        "constraints" | "nonholonomic" | "holonomic" => "write `constraint dot(Omega, Gamma) = 0;`",
        "equation" | "equations" => "equations of motion are derived, not written",
        "if" | "else" | "match" => "the language has no conditions besides `where` and `require`",
        _ => return suggest(word, ITEMS.iter().map(|(item, _)| *item)),
    };
    advice.into()
}

/// Functions that take an algebra by its name before their other arguments.
pub(super) const ALGEBRA_FUNCTIONS: &[&str] =
    &["ad", "coad", "laplacian", "poisson", "pointwise", "star_power", "trace_power"];

/// Functions of the expression language. Their names may be declared as well: parentheses tell functions from values.
pub(super) const FUNCTIONS: &[&str] = &[
    "dot",
    "cross",
    "ad",
    "coad",
    "laplacian",
    "poisson",
    "pointwise",
    "star_power",
    "trace_power",
    "norm",
    "unit",
    "rot",
    "log",
    "orthonormal",
    "rate",
    "spin",
    "transpose",
    "diag",
    "identity",
    "hat",
    "det",
    "trace",
    "sum",
    "sqrt",
    "pow",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "exp",
    "ln",
    "sinh",
    "cosh",
    "tanh",
    "abs",
    "sinc",
    "cosc",
];

/// What to write instead of a function that has jumps or kinks, for expressions are differentiated; nothing for other
/// words.
pub(super) fn not_smooth(word: &str) -> Option<String> {
    let advice = match word {
        "sign" | "sgn" | "signum" | "copysign" => {
            "`x/sqrt(x^2 + eps^2)` or `tanh(x/eps)` with a small parameter `eps`"
        }
        "max" | "fmax" => {
            "`(a + b + abs(a - b))/2`, or `(a + b + sqrt((a - b)^2 + eps^2))/2` without the kink"
        }
        "min" | "fmin" => {
            "`(a + b - abs(a - b))/2`, or `(a + b - sqrt((a - b)^2 + eps^2))/2` without the kink"
        }
        "if" | "else" | "match" | "ifelse" | "piecewise" | "where" | "select" => {
            "a blend such as `(1 + tanh(x/eps))/2*a + (1 - tanh(x/eps))/2*b`, or one model for each case"
        }
        "heaviside" | "step" | "theta_function" => "`(1 + tanh(x/eps))/2` with a small parameter `eps`",
        "clamp" | "saturate" | "sat" => "`tanh(x)`",
        "floor" | "ceil" | "round" | "mod" | "fmod" | "rem" => "periodic functions with `sin` and `cos`",
        _ => return None,
    };
    Some(format!("the language is smooth, as equations of motion are derivatives: write {advice}"))
}

/// Functions with a meaning in one item each: displacements in `virtual`, accelerations in `constraint`.
pub(super) const OPERATORS: &[(&str, &str)] = &[
    ("delta", "displacements belong in `virtual`, as in `virtual delta(v1) + delta(v2) = 0;`"),
    ("ddt", "accelerations belong in `constraint`, as in `constraint ddt(v1) + v1 = 0;`"),
];

/// Words that would begin a condition; expressions that begin so are met with what to write instead, [`not_smooth`].
pub(super) const CONDITIONS: &[&str] = &["if", "else", "match"];

/// Why a name cannot be declared, or nothing.
pub(super) fn refusal(name: &str) -> Option<&'static str> {
    let mut chars = name.chars();
    let first = chars.next().unwrap_or('_');
    if !first.is_ascii_alphabetic() || !chars.all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return Some("names are ASCII letters, digits and underscores and begin with a letter");
    }
    if name == "t" {
        return Some("it is the time");
    }
    if name == "pi" {
        return Some("it is the number pi");
    }
    if CONDITIONS.contains(&name) {
        return Some("the language has no conditions, so nothing can begin like one");
    }
    // Tables have it beside the state.
    if Want::from_name(name).is_some_and(Want::is_in_tables) {
        return Some("scenes have an output of that name");
    }
    None
}

/// The nearest of `known` within an edit distance of a third of the length, as a sentence, or a list when short.
pub(super) fn suggest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Help {
    let known: Vec<&str> = known.into_iter().collect();
    // Of one or two letters, a changed letter is another name.
    let limit = if wrong.chars().count() < 3 { 0 } else { (wrong.chars().count() / 3).min(3) };
    let near = known
        .iter()
        .filter(|name| name.len().abs_diff(wrong.len()) <= limit)
        .map(|name| (if name.eq_ignore_ascii_case(wrong) { 0 } else { distance(wrong, name) }, *name))
        .filter(|(d, _)| *d <= limit)
        .min();
    if let Some((_, name)) = near {
        return Help::replacing(wrong, name, format!("did you mean `{name}`?"));
    }
    if known.is_empty() || known.len() > 60 {
        return Help::default();
    }
    format!("legal here: {}", list(&known)).into()
}

/// `a, b, c` in backquotes.
pub(super) fn list(names: &[&str]) -> String {
    names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}

/// Edit distance of the lower-case names with transpositions (restricted Damerau-Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let lower: (Vec<char>, Vec<char>) = (
        a.chars().map(|c| c.to_ascii_lowercase()).collect(),
        b.chars().map(|c| c.to_ascii_lowercase()).collect(),
    );
    let (x, y) = (&lower.0, &lower.1);
    if x.len().max(y.len()) > 64 {
        return usize::MAX;
    }
    let mut rows = vec![vec![0_usize; y.len() + 1]; x.len() + 1];
    for (i, row) in rows.iter_mut().enumerate() {
        row[0] = i;
    }
    for (j, cell) in rows[0].iter_mut().enumerate() {
        *cell = j;
    }
    for i in 1..=x.len() {
        for j in 1..=y.len() {
            let replace = rows[i - 1][j - 1] + usize::from(x[i - 1] != y[j - 1]);
            let mut best = replace.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
            if i > 1 && j > 1 && x[i - 1] == y[j - 2] && x[i - 2] == y[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            rows[i][j] = best;
        }
    }
    rows[x.len()][y.len()]
}
