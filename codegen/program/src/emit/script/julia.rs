//! Modules of Julia, whose right-hand side is one that DifferentialEquations.jl takes.
//!
//! Deliberately does not know: what the functions compute.

use std::fmt::Write as _;

use super::form::{Entry, Form, Preparation, Rows, Summary, body, indented, one_line, results, wrapped};
use super::item::{Gives, Item, Pattern, Takes};
use super::spelling::{PRODUCTS, STUMPFF, ScriptLanguage, Spelling, TURN};

/// Julia.
pub(super) struct Julia;

/// A text between quotes.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"").replace('$', "\\$")
}

/// A string literal.
fn string(text: &str) -> String {
    format!("\"{}\"", escaped(text).replace('\n', " "))
}

/// Lines as a docstring.
fn docstring(lines: &[String]) -> String {
    let lines: Vec<String> = lines.iter().map(|line| escaped(line.trim_end())).collect();
    format!("\"\"\"\n{}\"\"\"\n", indented(&lines, ""))
}

/// The arguments of a function, with the array of the results first.
fn arguments(item: &Item<'_>, has_inputs: bool) -> Vec<&'static str> {
    let mut names = match item.gives {
        Gives::Scalar => vec![],
        Gives::Vector | Gives::Matrix(_) => vec![if item.name == "rhs" { "dy" } else { "out" }],
    };
    names.extend(match item.takes {
        Takes::Point => ["y", "p", "t"],
        Takes::Vector => ["y", "p", "t"],
        Takes::Variables => ["vector", "p", "t"],
        Takes::Flow => ["y", "p", "value"],
    });
    names.extend((item.takes == Takes::Vector).then_some("vector"));
    names.extend(has_inputs.then_some("u = values(INPUTS)"));
    names
}

impl Form for Julia {
    fn spelling(&self) -> Spelling {
        Spelling(ScriptLanguage::Julia)
    }

    fn comment(&self) -> &'static str {
        "#"
    }

    fn head(&self, name: &str, doc: &[String]) -> String {
        let usage = [
            "",
            "    p = prepare(NAME = value)             # checks the parameters",
            "    problem = ODEProblem(rhs!, copy(INITIAL), (0.0, 1.0), p)",
            "",
            "Functions that write to their first argument allocate nothing, unless sums over tables are among their",
            "operations. Numbers may be of any type: states and parameters with derivatives, for instance.",
        ];
        let doc: Vec<String> = doc.iter().cloned().chain(usage.iter().map(|l| (*l).to_owned())).collect();
        format!("{}module {name}\n\n", docstring(&doc))
    }

    fn helpers(&self, calls: &dyn Fn(&str) -> bool) -> String {
        let all = [
            ("sum_error", ERROR_OF_SUM),
            ("product_error", ERROR_OF_PRODUCT),
            ("circle_error", ERROR_OF_CIRCLE),
            (STUMPFF, STUMPFF_FUNCTION),
            (TURN, TURN_FUNCTION),
            (PRODUCTS, SUM),
        ];
        let circle = calls("circle_error");
        let is_called = |name: &str| calls(name) || circle && matches!(name, "sum_error" | "product_error");
        all.into_iter().filter(|(name, _)| is_called(name)).map(|(_, text)| format!("{text}\n")).collect()
    }

    fn tail(&self, name: &str, _: &Summary) -> String {
        format!("end # module {name}\n")
    }

    fn list(&self, name: &str, doc: &str, entries: &[Entry]) -> String {
        let has_values = matches!(name, "PARAMS" | "INPUTS");
        let mut text = format!("# {doc}\nconst {name} = {}\n", if has_values { "(;" } else { "(" });
        for Entry { name, field, value, doc } in entries {
            let doc = if doc.is_empty() { String::new() } else { format!("  # {doc}") };
            let _ = match value {
                Some(value) => writeln!(text, "    {field} = {value},{doc}"),
                None => writeln!(text, "    {},{doc}", string(name)),
            };
        }
        text + ")\n\n"
    }

    fn values(&self, name: &str, doc: &str, values: &[String]) -> String {
        let lines = indented(&wrapped(values, ","), "    ");
        format!("# {}\nconst {name} = Float64[\n{lines}]\n\n", one_line(doc))
    }

    fn rows(&self, name: &str, rows: &Rows) -> String {
        let from_one = |list: &[usize]| list.iter().map(|k| (k + 1).to_string()).collect::<Vec<_>>();
        let lists =
            [from_one(&rows.lefts), from_one(&rows.rights), rows.numbers.clone(), from_one(&rows.results)];
        let lists =
            lists.map(|list| format!("    [\n{}    ],\n", indented(&wrapped(&list, ","), "        ")));
        format!(
            "# Products: left factors, right factors, numbers, results.\nconst {name} = (\n{})\n\n",
            lists.concat()
        )
    }

    fn prepare(&self, preparation: &Preparation) -> String {
        let Preparation { params, lines, conditions, fields } = preparation;
        let mut body = vec![
            "params = merge(PARAMS, values(changes))".to_owned(),
            "keys(params) == keys(PARAMS) || throw(ArgumentError(\"the parameters are $(keys(PARAMS))\"))"
                .to_owned(),
        ];
        for [name, field, local] in params {
            body.push(format!("{local} = params.{field}"));
            body.push(format!("isfinite({local}) || throw(ArgumentError(\"{name} is not finite\"))"));
        }
        body.extend(lines.iter().cloned());
        body.extend(
            conditions.iter().map(|(condition, message)| {
                format!("{condition} || throw(ArgumentError({}))", string(message))
            }),
        );
        body.push("return (;".to_owned());
        body.extend(fields.iter().map(|(field, value)| format!("    {field} = {value},")));
        body.push(")".to_owned());
        let doc = [
            "    prepare(; changes...)".to_owned(),
            String::new(),
            "Check the parameters, as in `PARAMS` unless given by name, and compute what depends on them alone.".to_owned(),
        ];
        format!("{}function prepare(; changes...)\n{}end\n\n", docstring(&doc), indented(&body, "    "))
    }

    fn bind(&self, name: &str, value: &str) -> String {
        format!("{name} = {value}")
    }

    fn pair(&self, sine: &str, cosine: &str, angle: &str) -> String {
        format!("{sine}, {cosine} = sincos({angle})")
    }

    fn vector(&self, values: &[String]) -> String {
        format!("({},)", values.join(", "))
    }

    fn function(&self, item: &Item<'_>, has_inputs: bool) -> String {
        let arguments = arguments(item, has_inputs);
        let to = if item.name == "rhs" { "dy" } else { "out" };
        let results = results(item);
        let (mark, given) = match item.gives {
            Gives::Scalar => ("", vec![format!("return {}", results.first().map_or("0.0", |r| r.as_str()))]),
            Gives::Vector => {
                let lines = results.iter().enumerate();
                let lines = lines.map(|(k, result)| format!("{to}[{}] = {result}", k + 1));
                ("!", lines.chain(["return nothing".to_owned()]).collect())
            }
            Gives::Matrix(Pattern { places, is_antisymmetric, .. }) => {
                let mut lines = vec![format!("fill!({to}, 0)")];
                for ((i, j), value) in places.iter().zip(&results) {
                    let (i, j) = (i + 1, j + 1);
                    lines.push(format!("{to}[{i}, {j}] = {value}"));
                    if is_antisymmetric {
                        lines.push(format!("{to}[{j}, {i}] = -{to}[{i}, {j}]"));
                    }
                }
                lines.push("return nothing".to_owned());
                ("!", lines)
            }
        };
        let signature = format!("{}{mark}({})", item.name, arguments.join(", "));
        let doc: Vec<String> =
            [format!("    {signature}"), String::new()].into_iter().chain(item.doc.iter().cloned()).collect();
        let lines = [body(self, item), given].concat();
        format!("{}function {signature}\n{}end\n\n", docstring(&doc), indented(&lines, "    "))
    }
}

const ERROR_OF_SUM: &str = "\
# x + y less its rounded value.
@inline function sum_error(x, y)
    sum = x + y
    part = sum - x
    return (x - (sum - part)) + (y - part)
end
";

const ERROR_OF_PRODUCT: &str = "\
# x * y less its rounded value.
@inline product_error(x, y) = fma(x, y, -(x * y))
";

const ERROR_OF_CIRCLE: &str = "\
# (1 - sine^2 - cosine^2)/2.
@inline function circle_error(sine, cosine)
    p, q = sine * sine, cosine * cosine
    first = 1.0 - q
    rest = sum_error(1.0, -q) + sum_error(first, -p)
    errors = product_error(sine, sine) + product_error(cosine, cosine)
    return ((first - p) + (rest - errors)) * 0.5
end
";

const STUMPFF_FUNCTION: &str = "\
# c_k(z) = sum_j (-z)^j/(2 j + k)!, the series where it converges fast.
function stumpff(k, z)
    if !(abs(z) > 0.5 * (k + 1) * (k + 2))
        total = one(z)
        for j in (23 + k ÷ 2):-1:0
            first = k + 2 * j + 1
            total = 1.0 - z * total / (first * (first + 1))
        end
        return total / prod(1.0:k)
    end
    turns = z > 0
    x = sqrt(abs(z))
    k == 0 && return turns ? cos(x) : cosh(x)
    m = isodd(k) ? 1 : 2
    half = isodd(k) ? x : 0.5 * x
    beyond = (turns ? sin(half) : sinh(half)) / x
    beyond = isodd(k) ? beyond : 2.0 * beyond * beyond
    inverse = 1.0 / m
    while m < k
        beyond = (inverse - beyond) / z
        inverse /= (m + 1) * (m + 2)
        m += 2
    end
    return beyond
end
";

const TURN_FUNCTION: &str = "\
# The derivative k, over k!, of asin(sqrt(w))/sqrt(w (1 - w)): the series up to a right angle.
function turn(k, w)
    if !(w > 0.5)
        total = one(w)
        for j in (55 + 4 * k):-1:0
            m = j + k + 1
            total = 1.0 + w * total * (2 * m * m) / ((j + 1) * (2 * m + 1))
        end
        for m in 1:k
            total = total * (2 * m) / (2 * m + 1)
        end
        return total
    end
    before = asin(sqrt(w)) / sqrt(w * (1.0 - w))
    k == 0 && return before
    divisor, slope = 2.0 * w * (1.0 - w), 2.0 * w - 1.0
    beyond = (1.0 + slope * before) / divisor
    for m in 1:(k - 1)
        ahead = (2 * m * before + (2 * m + 1) * slope * beyond) / ((m + 1) * divisor)
        before, beyond = beyond, ahead
    end
    return beyond
end
";

const SUM: &str = "\
# For each of n results the sum of its products number * left_i * right_j.
function sum_products(n, left, right, table)
    lefts, rights, numbers, results = table
    sums = zeros(promote_type(eltype(left), eltype(right)), n)
    for k in eachindex(numbers)
        sums[results[k]] += numbers[k] * left[lefts[k]] * right[rights[k]]
    end
    return sums
end
";
