//! Function files of MATLAB and Octave, whose right-hand side is one that `ode45` takes.
//!
//! Deliberately does not know: what the functions compute.

use std::fmt::Write as _;

use super::form::{Entry, Form, Preparation, Rows, Summary, body, indented, one_line, results, wrapped};
use super::item::{Gives, Item, Pattern};
use super::spelling::{PRODUCTS, SIN_COS, STUMPFF, ScriptLanguage, Spelling, TURN};

/// MATLAB, with what inputs are held at.
pub(super) struct Matlab {
    pub(super) inputs: Vec<String>,
}

/// A string literal.
fn string(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''").replace('\n', " "))
}

/// Lines of a comment.
fn comment(lines: &[String]) -> String {
    lines.iter().map(|line| format!("% {line}").trim_end().to_owned() + "\n").collect()
}

/// A local function that gives a value.
fn local(name: &str, given: &str, doc: &[String], lines: &[String]) -> String {
    format!("function {given} = {name}\n{}{}end\n\n", comment(doc), indented(lines, "    "))
}

/// What a list is called, which no function of a point is.
fn list_name(name: &str) -> &'static str {
    match name {
        "PARAMS" => "published",
        "STATE" => "state_names",
        "INPUTS" => "inputs",
        "INITIAL" => "initial",
        "OUTPUTS" => "output_names",
        "PIVOTS" => "pivot_names",
        "DOMAIN" => "domain_conditions",
        "EVENTS" => "event_names",
        "DISCRETE" => "discrete_names",
        "DISCRETE_STATE" => "discrete_state",
        "DISCRETE_ENTRIES" => "discrete_entries",
        "TOTAL_STATE" => "total_state_names",
        "TOTAL_PARAMS" => "total_param_names",
        _ => "implicit_names",
    }
}

impl Form for Matlab {
    fn spelling(&self) -> Spelling {
        Spelling(ScriptLanguage::Matlab)
    }

    fn unequal(&self) -> &'static str {
        "~="
    }

    fn comment(&self) -> &'static str {
        "%"
    }

    fn head(&self, name: &str, doc: &[String]) -> String {
        let usage = [
            String::new(),
            format!("    m = {name}();"),
            "    params = m.params;  params.NAME = value;".to_owned(),
            "    p = m.prepare(params);                  % checks the parameters".to_owned(),
            "    [t, y] = ode45(@(t, y) m.rhs(t, y, p), [0, 1], m.initial);".to_owned(),
        ];
        let doc: Vec<String> = doc.iter().cloned().chain(usage).collect();
        // The lists and functions follow, which the tail knows: the first function is written by it.
        comment(&doc)
    }

    fn first(&self, name: &str, module: &Summary) -> String {
        let mut lines: Vec<String> = Vec::new();
        for constant in &module.constants {
            let list = list_name(constant);
            let field = if constant == "PARAMS" { "params" } else { list };
            lines.push(format!("model.{field} = {list}();"));
        }
        for function in std::iter::once("prepare").chain(module.functions.iter().map(String::as_str)) {
            lines.push(format!("model.{function} = @{function};"));
        }
        format!("function model = {name}()\n{}end\n\n", indented(&lines, "    "))
    }

    fn helpers(&self, calls: &dyn Fn(&str) -> bool) -> String {
        let all = [
            (SIN_COS, SINE_AND_COSINE),
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

    fn tail(&self, _: &str, _: &Summary) -> String {
        String::new()
    }

    fn list(&self, name: &str, doc: &str, entries: &[Entry]) -> String {
        let has_values = matches!(name, "PARAMS" | "INPUTS");
        let mut lines = vec![if has_values { "list = struct();".to_owned() } else { "list = {".to_owned() }];
        for Entry { name, field, value, doc } in entries {
            let mut line = match value {
                Some(value) => format!("list.{field} = {value};"),
                None => format!("    {}", string(name)),
            };
            if !doc.is_empty() {
                let _ = write!(line, "  % {doc}");
            }
            lines.push(line);
        }
        lines.extend((!has_values).then(|| "};".to_owned()));
        local(&format!("{}()", list_name(name)), "list", &[doc.to_owned()], &lines)
    }

    fn values(&self, name: &str, doc: &str, values: &[String]) -> String {
        let lines: Vec<String> = ["list = [".to_owned()]
            .into_iter()
            .chain(values.iter().map(|value| format!("    {value}")))
            .chain(["];".to_owned()])
            .collect();
        local(&format!("{}()", list_name(name)), "list", &[one_line(doc)], &lines)
    }

    fn rows(&self, name: &str, rows: &Rows) -> String {
        let from_one = |list: &[usize]| list.iter().map(|k| (k + 1).to_string()).collect::<Vec<_>>();
        let mut lines = vec![
            "persistent kept".to_owned(),
            "if isempty(kept)".to_owned(),
            "    kept = struct();".to_owned(),
        ];
        for (field, list) in [
            ("lefts", from_one(&rows.lefts)),
            ("rights", from_one(&rows.rights)),
            ("numbers", rows.numbers.clone()),
            ("results", from_one(&rows.results)),
        ] {
            lines.push(format!("    kept.{field} = ["));
            lines.extend(wrapped(&list, ";").into_iter().map(|line| format!("        {line}")));
            lines.push("    ];".to_owned());
        }
        lines.extend(["end".to_owned(), "table = kept;".to_owned()]);
        let doc = "Products: left factors, right factors, numbers, results.";
        local(&format!("{name}()"), "table", &[doc.to_owned()], &lines)
    }

    fn prepare(&self, preparation: &Preparation) -> String {
        let Preparation { params, lines, conditions, fields } = preparation;
        let fail = |condition: &str, message: &str| {
            // The message is an argument, and no template.
            format!("if ~({condition}), error('hamel:params', '%s', {}); end", string(message))
        };
        let mut body = vec![
            "if nargin < 1, params = published(); end".to_owned(),
            fail(
                &format!("numel(fieldnames(params)) == {}", params.len()),
                "a parameter is unknown or missing",
            ),
        ];
        for [name, field, local] in params {
            if local != &format!("params.{field}") {
                body.push(format!("{local} = params.{field};"));
            }
            body.push(fail(&format!("isfinite({local})"), &format!("{name} is not finite")));
        }
        body.extend(lines.iter().cloned());
        body.extend(conditions.iter().map(|(condition, message)| fail(condition, message)));
        body.push("p = struct();".to_owned());
        body.extend(fields.iter().map(|(field, value)| format!("p.{field} = {value};")));
        let doc = "Checks the parameters and computes what depends on them alone.";
        local("prepare(params)", "p", &[doc.to_owned()], &body)
    }

    fn bind(&self, name: &str, value: &str) -> String {
        format!("{name} = {value};")
    }

    fn pair(&self, sine: &str, cosine: &str, angle: &str) -> String {
        format!("[{sine}, {cosine}] = {SIN_COS}({angle});")
    }

    fn vector(&self, values: &[String]) -> String {
        format!("[{}]", values.join("; "))
    }

    fn function(&self, item: &Item<'_>, has_inputs: bool) -> String {
        let arguments = item.arguments(has_inputs);
        let mut lines = Vec::new();
        if has_inputs {
            lines.push(format!("if nargin < {}, u = [{}]; end", arguments.len(), self.inputs.join("; ")));
        }
        lines.extend(body(self, item));
        let results = results(item);
        let given = if item.name == "rhs" { "dy" } else { "out" };
        match item.gives {
            Gives::Scalar => {
                lines.push(format!("{given} = {};", results.first().map_or("0.0", |r| r.as_str())));
            }
            Gives::Vector if results.is_empty() => lines.push(format!("{given} = zeros(0, 1);")),
            Gives::Vector => {
                lines.push(format!("{given} = ["));
                lines.extend(results.iter().map(|result| format!("    {result}")));
                lines.push("];".to_owned());
            }
            Gives::Matrix(Pattern { shape: (rows, columns), places, is_antisymmetric }) => {
                lines.push(format!("{given} = zeros({rows}, {columns});"));
                for ((i, j), value) in places.iter().zip(&results) {
                    let (i, j) = (i + 1, j + 1);
                    lines.push(format!("{given}({i}, {j}) = {value};"));
                    if is_antisymmetric {
                        lines.push(format!("{given}({j}, {i}) = -{given}({i}, {j});"));
                    }
                }
            }
        }
        local(&format!("{}({})", item.name, arguments.join(", ")), given, &item.doc, &lines)
    }
}

const SINE_AND_COSINE: &str = "\
function [sine, cosine] = sin_cos(angle)
    sine = sin(angle);
    cosine = cos(angle);
end
";

const ERROR_OF_SUM: &str = "\
function out = sum_error(x, y)
% x + y less its rounded value.
    total = x + y;
    part = total - x;
    out = (x - (total - part)) + (y - part);
end
";

const ERROR_OF_PRODUCT: &str = "\
function out = product_error(x, y)
% x * y less its rounded value (Dekker 1971).
    product = x * y;
    a = 134217729 * x;
    a = a - (a - x);
    c = 134217729 * y;
    c = c - (c - y);
    b = x - a;
    d = y - c;
    out = ((a * c - product) + a * d + b * c) + b * d;
end
";

const ERROR_OF_CIRCLE: &str = "\
function out = circle_error(sine, cosine)
% (1 - sine^2 - cosine^2)/2.
    p = sine * sine;
    q = cosine * cosine;
    first = 1 - q;
    rest = sum_error(1, -q) + sum_error(first, -p);
    errors = product_error(sine, sine) + product_error(cosine, cosine);
    out = ((first - p) + (rest - errors)) * 0.5;
end
";

const STUMPFF_FUNCTION: &str = "\
function c = stumpff(k, z)
% c_k(z) = sum_j (-z)^j/(2 j + k)!, the series where it converges fast.
    if ~(abs(z) > 0.5 * (k + 1) * (k + 2))
        c = 1;
        for j = (23 + floor(k / 2)):-1:0
            first = k + 2 * j + 1;
            c = 1 - z * c / (first * (first + 1));
        end
        c = c / factorial(k);
        return
    end
    x = sqrt(abs(z));
    turns = z > 0;
    if k == 0
        if turns, c = cos(x); else, c = cosh(x); end
        return
    end
    is_odd = mod(k, 2) == 1;
    m = 2 - is_odd;
    half = x / m;
    if turns, c = sin(half) / x; else, c = sinh(half) / x; end
    if ~is_odd, c = 2 * c * c; end
    inverse = 1 / m;
    while m < k
        c = (inverse - c) / z;
        inverse = inverse / ((m + 1) * (m + 2));
        m = m + 2;
    end
end
";

const TURN_FUNCTION: &str = "\
function c = turn(k, w)
% The derivative k, over k!, of asin(sqrt(w))/sqrt(w (1 - w)): the series up to a right angle.
    if ~(w > 0.5)
        c = 1;
        for j = (55 + 4 * k):-1:0
            m = j + k + 1;
            c = 1 + w * c * (2 * m * m) / ((j + 1) * (2 * m + 1));
        end
        for m = 1:k
            c = c * (2 * m) / (2 * m + 1);
        end
        return
    end
    before = asin(sqrt(w)) / sqrt(w * (1 - w));
    c = before;
    if k == 0, return, end
    divisor = 2 * w * (1 - w);
    slope = 2 * w - 1;
    c = (1 + slope * before) / divisor;
    for m = 1:(k - 1)
        ahead = (2 * m * before + (2 * m + 1) * slope * c) / ((m + 1) * divisor);
        before = c;
        c = ahead;
    end
end
";

const SUM: &str = "\
function sums = sum_products(n, left, right, table)
% For each of n results the sum of its products number * left_i * right_j.
    left = left(:);
    right = right(:);
    sums = accumarray(table.results, table.numbers .* left(table.lefts) .* right(table.rights), [n, 1]);
end
";
