//! Scenes as formulas of CasADi, JAX, SymPy, Julia and MATLAB: their texts, read token by token and evaluated here,
//! against the interpreter, bit for bit.
//!
//! Deliberately does not know: how these languages are written. `tests/peers/formulas.py` runs them where they are.

use std::collections::{BTreeMap, BTreeSet};

use hamel_codegen::scene::{self, BuiltScene, Writing};
use hamel_codegen::spec;
use hamel_expr::{parse_decimal, rational_to_f64};
use hamel_program::emit::ScriptLanguage;
use hamel_program::lower::SearchBudget;
use hamel_program::program::{Op, Point, Role};
use hamel_runtime::{Products, Real as _};
use hamel_tests::at_length;
use hamel_tests::models::{build, derived, generated};
use hamel_tests::random::Random;

/// Points of each scene.
const N_ROUNDS: usize = 3;
/// Operations of a scene that is read unless all are.
const LONGEST: usize = 1500;

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(f64),
    Word(String),
    Sign(char),
    Power,
}

/// The tokens of an expression; every character belongs to one.
fn tokens(text: &str) -> Vec<Token> {
    let chars: Vec<char> = text.chars().collect();
    let (mut at, mut tokens) = (0, Vec::new());
    while let Some(&c) = chars.get(at) {
        let start = at;
        at += 1;
        if c.is_ascii_digit() {
            while chars.get(at).is_some_and(|c| {
                c.is_ascii_alphanumeric() || *c == '.' || (*c == '-' || *c == '+') && chars[at - 1] == 'e'
            }) {
                at += 1;
            }
            let number: String = chars[start..at].iter().collect();
            // Numerators and denominators of exact numbers have more digits than a double.
            let exact = parse_decimal(&number).map(|q| rational_to_f64(&q));
            tokens.push(Token::Number(exact.unwrap_or_else(|| number.parse().expect("a number"))));
        } else if c.is_ascii_alphabetic() || c == '_' {
            while chars.get(at).is_some_and(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '.')) {
                at += 1;
            }
            tokens.push(Token::Word(chars[start..at].iter().collect()));
        } else if c == '*' && chars.get(at) == Some(&'*') {
            at += 1;
            tokens.push(Token::Power);
        } else if c == '^' {
            tokens.push(Token::Power);
        } else if !c.is_whitespace() {
            assert!("+-*/(),;[]".contains(c), "{c:?} in {text}");
            tokens.push(Token::Sign(c));
        }
    }
    tokens
}

/// What an expression is.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    Number(f64),
    Vector(Vec<f64>),
}

impl Value {
    fn number(self) -> f64 {
        match self {
            Value::Number(x) => x,
            Value::Vector(v) => panic!("{v:?} is no number"),
        }
    }

    fn vector(self) -> Vec<f64> {
        match self {
            Value::Vector(v) => v,
            Value::Number(x) => panic!("{x} is no vector"),
        }
    }
}

/// Sums over a table of the file, by its name.
type Sums<'a> = dyn Fn(&str, &[f64], &[f64]) -> Vec<f64> + 'a;

/// What names mean, and where arrays begin.
struct Meaning<'a> {
    names: BTreeMap<String, Value>,
    products: &'a Sums<'a>,
    first: usize,
}

struct Reader<'a> {
    tokens: &'a [Token],
    at: usize,
    meaning: &'a Meaning<'a>,
}

impl Reader<'_> {
    fn next_is(&mut self, token: &Token) -> bool {
        let found = self.tokens.get(self.at) == Some(token);
        self.at += usize::from(found);
        found
    }

    fn sum(&mut self) -> Value {
        let mut value = self.product();
        loop {
            let sign = if self.next_is(&Token::Sign('+')) {
                1.0
            } else if self.next_is(&Token::Sign('-')) {
                -1.0
            } else {
                return value;
            };
            value = match (value, self.product()) {
                (Value::Number(a), Value::Number(b)) => Value::Number(if sign > 0.0 { a + b } else { a - b }),
                (Value::Vector(a), Value::Vector(b)) => {
                    Value::Vector(a.iter().zip(&b).map(|(a, b)| a + sign * b).collect())
                }
                (a, b) => panic!("{a:?} and {b:?} are added"),
            };
        }
    }

    fn product(&mut self) -> Value {
        let mut value = self.signed();
        loop {
            value = if self.next_is(&Token::Sign('*')) {
                Value::Number(value.number() * self.signed().number())
            } else if self.next_is(&Token::Sign('/')) {
                Value::Number(value.number() / self.signed().number())
            } else {
                return value;
            };
        }
    }

    fn signed(&mut self) -> Value {
        if self.next_is(&Token::Sign('-')) {
            return Value::Number(-self.signed().number());
        }
        let base = self.atom();
        if self.next_is(&Token::Power) {
            let exponent = self.signed().number();
            return Value::Number((exponent * base.number().ln()).exp());
        }
        base
    }

    /// Values up to a closing bracket.
    fn list(&mut self, close: char) -> Vec<Value> {
        let mut values = Vec::new();
        while !self.next_is(&Token::Sign(close)) {
            values.push(self.sum());
            let _ = self.next_is(&Token::Sign(',')) || self.next_is(&Token::Sign(';'));
        }
        values
    }

    fn atom(&mut self) -> Value {
        let token = self.tokens.get(self.at).cloned().unwrap_or_else(|| panic!("{:?} ends", self.tokens));
        self.at += 1;
        match token {
            Token::Number(x) => Value::Number(x),
            Token::Sign('(') => {
                let mut values = self.list(')');
                if values.len() == 1 && self.tokens[self.at - 2] != Token::Sign(',') {
                    return values.remove(0);
                }
                Value::Vector(values.into_iter().map(Value::number).collect())
            }
            Token::Sign('[') => Value::Vector(self.list(']').into_iter().map(Value::number).collect()),
            Token::Word(name) if self.next_is(&Token::Sign('[')) => {
                let place = self.list(']').remove(0).number() as usize;
                Value::Number(self.array(&name)[place - self.meaning.first])
            }
            Token::Word(name) if self.next_is(&Token::Sign('(')) => self.call(&name),
            Token::Word(name) => match name.as_str() {
                "sympy.S.Zero" => Value::Number(0.0),
                "sympy.S.One" => Value::Number(1.0),
                "sympy.pi" => Value::Number(std::f64::consts::PI),
                _ => self.meaning.names.get(&name).cloned().unwrap_or_else(|| panic!("{name} is not bound")),
            },
            other => panic!("{other:?} begins nothing in {:?}", self.tokens),
        }
    }

    fn array(&self, name: &str) -> Vec<f64> {
        self.meaning.names.get(name).cloned().unwrap_or_else(|| panic!("{name} is not bound")).vector()
    }

    /// A call, or an element of an array in round brackets.
    fn call(&mut self, name: &str) -> Value {
        if let Some(Value::Vector(array)) = self.meaning.names.get(name) {
            let place = self.list(')').remove(0).number() as usize;
            return Value::Number(array[place - self.meaning.first]);
        }
        let own = name.trim_start_matches('_');
        if own == "sum_products" {
            let end = self.tokens[self.at..].iter().position(|t| *t == Token::Sign(')')).expect("a bracket");
            let words: Vec<&str> = self.tokens[self.at..self.at + end]
                .iter()
                .filter_map(|token| if let Token::Word(word) = token { Some(word.as_str()) } else { None })
                .collect();
            self.at += end + 1;
            let [left, right, table] = words[..] else { panic!("{words:?}") };
            return Value::Vector((self.meaning.products)(table, &self.array(left), &self.array(right)));
        }
        if own == "let" {
            // The name in quotes was taken away.
            assert!(self.next_is(&Token::Sign(',')));
            return self.list(')').remove(0);
        }
        let values = self.list(')');
        if own == "vector" {
            return values.into_iter().next().expect("one list");
        }
        let x: Vec<f64> = values.into_iter().map(Value::number).collect();
        let function = own.rsplit('.').next().unwrap_or_default();
        Value::Number(match (function, x.as_slice()) {
            ("sqrt", [x]) => x.sqrt(),
            ("sin", [x]) => hamel_runtime::Real::sin(*x),
            ("cos", [x]) => hamel_runtime::Real::cos(*x),
            ("tan", [x]) => x.tan(),
            ("asin" | "arcsin", [x]) => x.asin(),
            ("acos" | "arccos", [x]) => x.acos(),
            ("atan" | "arctan", [x]) => x.atan(),
            ("exp", [x]) => x.exp(),
            ("log", [x]) => x.ln(),
            ("sinh", [x]) => x.sinh(),
            ("cosh", [x]) => x.cosh(),
            ("tanh", [x]) => x.tanh(),
            ("abs" | "fabs" | "Abs", [x]) => x.abs(),
            ("atan2" | "arctan2" | "atan", [y, x]) => y.atan2(*x),
            ("Rational", [p, q]) => p / q,
            ("stumpff", [k, z]) => z.stumpff(*k as u32),
            ("turn", [k, w]) => hamel_runtime::Real::turn(*w, *k as u32),
            ("muladd", [a, b, c]) => hamel_runtime::Real::mul_add(*a, *b, *c),
            ("sum_error", [a, b]) => a.sum_error(*b),
            ("product_error", [a, b]) => a.product_error(*b),
            ("circle_error", [a, b]) => a.circle_error(*b),
            _ => panic!("{name} of {} numbers", x.len()),
        })
    }
}

/// An expression whose every token is read.
fn evaluate(text: &str, meaning: &Meaning<'_>) -> Value {
    let tokens = tokens(text);
    let mut reader = Reader { tokens: &tokens, at: 0, meaning };
    let value = reader.sum();
    assert_eq!(reader.at, tokens.len(), "{text}");
    value
}

/// The lines of a function, without documentation.
fn function(language: ScriptLanguage, text: &str, name: &str) -> Vec<String> {
    let (heads, end) = match language {
        ScriptLanguage::Julia => (vec![format!("function {name}("), format!("function {name}!(")], "\nend\n"),
        ScriptLanguage::Matlab => (vec![format!(" = {name}(")], "\nend\n"),
        _ => (vec![format!("def {name}(")], "\n\n\n"),
    };
    let head = heads.iter().find_map(|head| Some(text.find(head.as_str())? + head.len()));
    let body = &text[head.unwrap_or_else(|| panic!("no function {name} in\n{text}"))..];
    let body = &body[body.find('\n').expect("a line")..];
    let body = &body[..body.find(end).unwrap_or(body.len())];
    let is_python = !matches!(language, ScriptLanguage::Julia | ScriptLanguage::Matlab);
    let parts: Vec<&str> = body.split("\"\"\"").collect();
    let body = if let ([_, _, code], true) = (parts.as_slice(), is_python) { code } else { body };
    let comment = if language == ScriptLanguage::Matlab { '%' } else { '#' };
    let lines = body.lines().map(|line| line.split(comment).next().unwrap_or_default().trim().to_owned());
    lines.filter(|line| !line.is_empty()).collect()
}

/// What the statements of a function bind; its results in order, under the names of fields where it makes them.
fn run(lines: &[String], meaning: &mut Meaning<'_>) -> (Vec<f64>, BTreeMap<String, Value>) {
    let (mut results, mut fields) = (Vec::new(), BTreeMap::new());
    let mut in_list = false;
    for line in lines {
        let line = line.trim_end_matches([';', ',']);
        if line == "])" || line == ")" || line == "]" {
            in_list = false;
        } else if ["return _vector([", "dy = [", "out = [", "return Prepared(", "return (", "p = struct()"]
            .contains(&line)
        {
            in_list = line != "p = struct()";
        } else if in_list {
            match line.split_once('=') {
                Some((field, value)) => {
                    fields.insert(field.trim().to_owned(), evaluate(value, meaning));
                }
                None => results.push(evaluate(line, meaning).number()),
            }
        } else if let Some(value) = line.strip_prefix("return ") {
            let is_done = value.starts_with("_matrix(") || value == "nothing";
            results.extend((!is_done).then(|| evaluate(value, meaning).number()));
        } else if is_check(line) {
            // Checks of parameters, sizes of matrices.
        } else {
            let (to, value) = line.split_once(" = ").unwrap_or_else(|| panic!("{line:?} is not read"));
            assign(to, value, &mut results, &mut fields, meaning);
        }
    }
    (results, fields)
}

/// Whether a line checks parameters, or sizes a matrix.
fn is_check(line: &str) -> bool {
    let known = ["_require(", "isfinite(", "fill!(", "if ", "for ", "raise ", "keys("];
    line.contains("|| throw(ArgumentError(") || known.iter().any(|known| line.starts_with(known))
}

/// Binds the left side of a statement.
fn assign(
    to: &str,
    value: &str,
    results: &mut Vec<f64>,
    fields: &mut BTreeMap<String, Value>,
    meaning: &mut Meaning<'_>,
) {
    // Of a value with names in quotes, the quotes are taken away with what they hold.
    let quoted: Vec<&str> = value.split('"').collect();
    let plain: String = quoted.iter().step_by(2).copied().collect();
    if to == "params" || plain.starts_with("zeros(") || plain.starts_with("[[0.0] *") {
        return;
    }
    if let Some(name) = value.strip_prefix("params.").or_else(|| value.strip_prefix("params[")) {
        let name = name.trim_matches(['"', ']']);
        let value = meaning.names.get(&format!("params.{name}")).unwrap_or_else(|| panic!("no {name}"));
        meaning.names.insert(to.to_owned(), value.clone());
        return;
    }
    let is_element = to.starts_with("out") || to.starts_with("dy");
    if let (Some((sine, cosine)), false) = (to.trim_matches(['[', ']']).split_once(", "), is_element) {
        let angle = plain.split_once("sin_cos(").or_else(|| plain.split_once("sincos(")).expect("a pair").1;
        let angle = angle.strip_suffix(if plain.starts_with("map(") { "))" } else { ")" }).expect("brackets");
        let (s, c) = hamel_runtime::Real::sin_cos(evaluate(angle, meaning).number());
        meaning.names.insert(sine.to_owned(), Value::Number(s));
        meaning.names.insert(cosine.to_owned(), Value::Number(c));
        return;
    }
    if let Some(field) = to.strip_prefix("p.") {
        fields.insert(field.to_owned(), evaluate(&plain, meaning));
        return;
    }
    if is_element && to.ends_with([')', ']']) {
        // Entries below the diagonal are minus the ones above.
        let is_mirrored = plain.starts_with("-out[") || plain.starts_with("-out(");
        results.extend((!is_mirrored).then(|| evaluate(&plain, meaning).number()));
        return;
    }
    if to == "out" {
        results.push(evaluate(&plain, meaning).number());
        return;
    }
    let value = evaluate(&plain, meaning);
    meaning.names.insert(to.to_owned(), value);
}

/// The file of a scene, and what it is compared with.
struct Case<'a> {
    language: ScriptLanguage,
    text: &'a str,
    built: &'a BuiltScene,
}

impl Case<'_> {
    /// The name of the function of a role in the file, where files have one.
    fn name(&self, role: &Role) -> Option<String> {
        let name = match role {
            Role::Rate => "rhs".to_owned(),
            Role::Energy | Role::Signature | Role::Pivots | Role::Domain => role.name().to_owned(),
            Role::Output(name) | Role::Product(name) | Role::Flow(name) | Role::OfVariables(name) => {
                name.clone()
            }
            Role::Points | Role::SeriesStart | Role::SeriesStep => return None,
        };
        Some(if *role == Role::Pivots { "pivots".to_owned() } else { name })
    }

    /// The first number that is another one than that of the interpreter, and how many were compared.
    fn compare(&self) -> Result<usize, String> {
        let program = self.built.program();
        let mut random = Random(20_261_126);
        let params: Vec<f64> = self
            .built
            .params()
            .iter()
            .map(|p| rational_to_f64(&p.default) * (1.0 + 0.05 * random.number()))
            .collect();
        let prepared = program.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
        let products = |table: &str, left: &[f64], right: &[f64]| {
            let k: usize = table.rsplit('_').next().and_then(|k| k.parse().ok()).expect("a table");
            sums_of(self.language, self.text, table, &program.tables[k].ends, left, right)
        };
        let first = usize::from(matches!(self.language, ScriptLanguage::Julia | ScriptLanguage::Matlab));
        let mut meaning = Meaning { names: BTreeMap::new(), products: &products, first };
        for (name, value) in program.params.iter().zip(&params) {
            for name in [name.clone(), format!("{name}_")] {
                meaning.names.insert(format!("params.{name}"), Value::Number(*value));
            }
        }
        let (_, fields) = run(&function(self.language, self.text, "prepare"), &mut meaning);
        let fields: BTreeMap<String, Value> =
            fields.into_iter().map(|(field, value)| (format!("p.{field}"), value)).collect();
        let n_vector = program.functions.iter().map(|f| f.argument.len()).max().unwrap_or(0);
        let is_error = |op: Op| matches!(op, Op::SumError(..) | Op::ProductError(..) | Op::CircleError(..));
        let prepares_errors = program.prepare.instructions.iter().any(|instruction| is_error(instruction.op));
        let mut compared = 0;
        for _ in 0..N_ROUNDS {
            let mut numbers = |n: usize| (0..n).map(|_| random.number()).collect::<Vec<f64>>();
            let (t, state, vector, inputs) = (
                numbers(1)[0],
                numbers(program.state.len()),
                numbers(n_vector),
                numbers(program.inputs.len()),
            );
            let slots = [&prepared[..program.prepare.slots.len()], &inputs].concat();
            for (k, of) in program.functions.iter().enumerate() {
                let Some(name) = self.name(&of.role) else { continue };
                let exact = !matches!(self.language, ScriptLanguage::Julia | ScriptLanguage::Matlab);
                if of.results.is_empty() || exact && of.carries_errors() {
                    continue;
                }
                // Where nothing carries errors, prepared numbers that do elsewhere differ in their last bit, and
                // results by a few: 45 units of the machine epsilon.
                let nearly = if exact && prepares_errors { 1e-14 } else { 0.0 };
                let argument = &vector[..of.argument.len()];
                let mut expected = vec![0.0; of.results.len()];
                let point = Point { t, state: &state, argument };
                program.run_at(k, &params, &slots, point, &mut expected);
                meaning.names = fields.clone();
                let arrays = [("y", &state), ("u", &inputs), ("vector", &argument.to_vec())];
                meaning
                    .names
                    .extend(arrays.map(|(name, array)| (name.to_owned(), Value::Vector(array.clone()))));
                let value = argument.first().copied().unwrap_or_default();
                meaning
                    .names
                    .extend([("t", t), ("value", value)].map(|(n, x)| (n.to_owned(), Value::Number(x))));
                let (found, _) = run(&function(self.language, self.text, &name), &mut meaning);
                if found.len() != expected.len() {
                    return Err(format!("{name} has {} results, not {}", found.len(), expected.len()));
                }
                for (at, (found, expected)) in found.iter().zip(&expected).enumerate() {
                    let agrees = found == expected
                        || found.is_nan() && expected.is_nan()
                        || (found - expected).abs() <= nearly * expected.abs();
                    if !agrees {
                        return Err(format!("{:?}, {name}, {at}: {found}, not {expected}", self.language));
                    }
                    compared += 1;
                }
            }
        }
        Ok(compared)
    }
}

/// The sums of products of a table of the file, in the order of the runtime.
fn sums_of(
    language: ScriptLanguage,
    text: &str,
    table: &str,
    ends: &[u32],
    left: &[f64],
    right: &[f64],
) -> Vec<f64> {
    let head = match language {
        ScriptLanguage::Julia => format!("const {table} = ("),
        ScriptLanguage::Matlab => format!("function table = {table}()"),
        _ => format!("{table} = ("),
    };
    let body = &text[text.find(&head).unwrap_or_else(|| panic!("no {head}")) + head.len()..];
    let lists: Vec<Vec<f64>> = body
        .split('[')
        .skip(1)
        .take(4)
        .map(|list| {
            let list = list.split(']').next().unwrap_or_default();
            let numbers = list.split([',', ';']).map(|x| x.trim().trim_matches(['(', ')']).to_owned());
            numbers.filter(|x| !x.is_empty()).map(|x| x.parse().expect("a number")).collect()
        })
        .collect();
    let first = usize::from(matches!(language, ScriptLanguage::Julia | ScriptLanguage::Matlab));
    let mut places = Vec::new();
    for (k, (left, right)) in lists[0].iter().zip(&lists[1]).enumerate() {
        for place in [*left as usize - first, *right as usize - first, k] {
            places.extend(u16::try_from(place).expect("a small table").to_le_bytes());
        }
    }
    // Each product has a number of its own, and results ascend.
    let of_results: Vec<u32> = (0..ends.len())
        .map(|k| lists[3].iter().filter(|result| **result as usize - first <= k).count() as u32)
        .collect();
    assert_eq!(of_results, ends, "{table}");
    let numbers: Vec<[f64; 2]> = lists[2].iter().map(|x| [*x, 0.0]).collect();
    let mut out = vec![0.0; ends.len()];
    Products::new(&places, ends, &numbers).add_to(left, right, &mut out);
    out
}

/// Compares a scene in every language.
fn compare(built: &BuiltScene) {
    let mut compared = 0;
    for language in ScriptLanguage::ALL {
        let script = built.emit_script(language, &Writing::default(), None).unwrap_or_else(|e| panic!("{e}"));
        let case = Case { language, text: &script.text, built };
        compared += case.compare().unwrap_or_else(|e| panic!("{}: {e}", script.file));
    }
    println!("{}: {compared} numbers", built.module_name());
    assert!(compared > 0);
}

/// Scenes with a function or an operation that none before them has; every scene at length.
#[test]
fn formulas_equal_the_interpreter_bit_for_bit() {
    let mut seen = BTreeSet::new();
    let mut n_scenes = 0;
    for (name, scene) in generated() {
        let n_seen = seen.len();
        let derived = derived(name, scene);
        let n_operations = derived.program.functions.iter().map(|f| f.instructions.len()).sum::<usize>();
        if n_operations > LONGEST && !at_length() {
            continue;
        }
        seen.extend(derived.kinds());
        if at_length() || seen.len() > n_seen {
            compare(&build(name, scene));
            n_scenes += 1;
        }
    }
    assert!(n_scenes >= 10, "{n_scenes}");
}

fn parsed(text: &str) -> BuiltScene {
    let model = spec::parse("model", text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, "default").unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn formulas_have_inputs_stumpffs_functions_logarithms_powers_and_rounding_errors() {
    compare(&parsed(
        "model soft {
            param k = 3; input u = 1/4;
            coordinate q in (0, 9); coordinate v: vector(3) in real;
            state pressure in real by pressure_dot = u - pressure*sinc(q);
            let p = [sinc(q), q*cosc(q)]; let w = spin(rot(v));
            lagrangian = dot(rate(p), rate(p)) + q_dot^2/2 + dot(w, w)/2 - k*q^(2/3) - p[2]*pressure;
            output lead = dot(log(rot(v)*rot([1, 0, 0], q)), [1, 2, 3]);
            output tip = atan2(q, k) + tan(v1) + abs(q) + tanh(q) + 123456789/1000000007*q;
            event stop = q - u falling { then q_dot = -u*q_dot; }
            scene default { input u; want energy, outputs, linearization, jvp, vjp, digits; }
        }",
    ));
}

#[test]
fn formulas_have_sums_over_tables() {
    let text = "model fluid {
        algebra g = zeitlin(5);
        momentum omega in g as *;
        action right;
        hamiltonian = -dot(omega, laplacian(g)^-1*omega);
        scene default { want energy, jvp, vjp; }
    }";
    let model = spec::parse("fluid", text).unwrap_or_else(|e| panic!("{e}"));
    let search = SearchBudget { products: 1, ..SearchBudget::default() };
    let built = scene::build_within(&model, "default", search).unwrap_or_else(|e| panic!("{e}"));
    assert!(!built.program().tables.is_empty());
    compare(&built);
}

/// Names that languages take, and names that are longer than MATLAB's.
#[test]
fn formulas_rename_what_a_language_has() {
    let long = "a".repeat(70);
    let text = format!(
        "model words {{
            param lambda = 2 where lambda > 0; param end = 3; param jnp = 5; param sqrt = 1/3; param zeros = 7/4;
            param PARAMS = 2; param Prepared = 3; param TypeError = 4; param published = 5; param numel = 6;
            param {long}1 = 2; param {long}2 = 3;
            coordinate y in real; coordinate function in (0, 4); coordinate let in angle; coordinate p in real;
            lagrangian = lambda*(y_dot^2 + function_dot^2)/2 + let_dot^2*(1 + y^2)/2 + p_dot^2*exp(sin(y))
                - end*y*function^2 - jnp*sqrt(lambda + function^2) - zeros*cos(let)*sin(sqrt*y) - {long}1*y^2
                - {long}2*y^4*PARAMS*Prepared*TypeError*published*numel;
            scene default {{ want energy, jacobian; }}
        }}"
    );
    let built = parsed(&text);
    for language in ScriptLanguage::ALL {
        let script = built.emit_script(language, &Writing::default(), None).unwrap_or_else(|e| panic!("{e}"));
        let words = tokens_of_names(&script.text);
        let longest = words.iter().map(String::len).max().unwrap_or_default();
        assert!(language != ScriptLanguage::Matlab || longest <= 63, "{longest}");
        let reserved: &[&str] = match language {
            ScriptLanguage::Matlab => &["end =", "function =", "sqrt =", "zeros ="],
            ScriptLanguage::Julia => &["end =", "function =", "let =", "sqrt =", "zeros ="],
            _ => &["lambda =", "jnp ="],
        };
        for word in reserved {
            assert!(
                !script.text.lines().any(|line| line.trim().starts_with(word)),
                "{word} in {}",
                script.text
            );
        }
        // What `prepare` calls keeps its name there.
        let called: &[&str] = match language {
            ScriptLanguage::Matlab => &["published", "numel"],
            ScriptLanguage::Julia => &["PARAMS"],
            _ => &["PARAMS", "Prepared", "TypeError"],
        };
        for name in called {
            assert!(!script.text.contains(&format!("\n    {name} = ")), "{name} in {}", script.text);
        }
    }
}

/// Words outside of comments and quotes.
fn tokens_of_names(text: &str) -> BTreeSet<String> {
    let code = text.lines().filter_map(|line| line.split('%').next()).filter(|line| !line.contains('\''));
    code.flat_map(|line| line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_'))
        .map(str::to_owned)
        .collect()
}

/// Every sign of the right-hand side that is turned around, and every number that is another, is found.
#[test]
fn a_turned_sign_is_found() {
    let built = build("euler_disk", "default");
    for language in ScriptLanguage::ALL {
        let script = built.emit_script(language, &Writing::default(), None).unwrap_or_else(|e| panic!("{e}"));
        let lines = function(language, &script.text, "rhs").join("\n");
        let mut n_faults = 0;
        for (sign, other) in
            [(" + ", " - "), (" - ", " + "), ("muladd(", "muladd(-"), ("_sin_cos(", "_sin_cos(-")]
        {
            for line in lines.lines().filter(|line| line.contains(sign)) {
                let turned = script.text.replace(line, &line.replacen(sign, other, 1));
                assert_ne!(turned, script.text);
                let found = Case { language, text: &turned, built: &built }.compare();
                assert!(found.is_err(), "{language:?}: {line}");
                n_faults += 1;
            }
        }
        assert!(n_faults > 3, "{language:?}: {n_faults}");
    }
}
