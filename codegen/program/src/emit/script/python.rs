//! Modules of Python: for CasADi, for JAX, for SymPy.
//!
//! Deliberately does not know: what the functions compute.

use std::fmt::Write as _;

use super::form::{Entry, Form, Preparation, Rows, Summary, body, indented, one_line, results, wrapped};
use super::item::{Gives, Item, Pattern};
use super::spelling::{PRODUCTS, SIN_COS, STUMPFF, ScriptLanguage, Spelling, TURN};

/// Python with a library.
pub(super) struct Python(pub(super) ScriptLanguage);

/// A string literal.
fn string(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', " "))
}

/// Lines of a docstring.
fn docstring(lines: &[String], indent: &str) -> String {
    let lines: Vec<String> = lines.iter().map(|l| l.replace('\\', "\\\\").replace("\"\"\"", "'''")).collect();
    let lines: Vec<String> = lines.iter().map(|line| line.trim_end().to_owned()).collect();
    // A quote before the closing ones would be one of them.
    let ends_well = |line: &str| line.replace('"', "'");
    match lines.as_slice() {
        [line] => format!("{indent}\"\"\"{}\"\"\"\n", ends_well(line)),
        [first, rest @ ..] => {
            format!("{indent}\"\"\"{first}\n{}{indent}\"\"\"\n", indented(rest, indent))
        }
        [] => String::new(),
    }
}

impl Python {
    /// What every module of a library begins with.
    fn beginning(&self) -> &'static str {
        match self.0 {
            ScriptLanguage::Casadi => CASADI,
            ScriptLanguage::Jax => JAX,
            _ => SYMPY,
        }
    }

    /// How the module is used.
    fn usage(&self, name: &str) -> Vec<String> {
        let lines: &[&str] = match self.0 {
            ScriptLanguage::Casadi => &[
                "Expressions of CasADi: functions take and give numbers, SX and MX, and have derivatives of every order.",
                "",
                "    p = prepare(NAME=value)          # a parameter may be an expression",
                "    dy = rhs(t, y, p)",
                "    f = function()                   # casadi.Function (t, y, p) -> dy, p in the order of PARAMS",
            ],
            ScriptLanguage::Jax => &[
                "Functions of JAX, which may be compiled, differentiated and mapped. They compute in double precision with",
                "",
                "    jax.config.update(\"jax_enable_x64\", True)",
                "    p = prepare(NAME=value)          # a parameter may be traced; conditions are checked where it is not",
                "    dy = rhs(t, y, p)",
            ],
            _ => &[
                "Expressions of SymPy with exact numbers.",
                "",
                "    t, y, params = symbols()",
                "    dy = rhs(t, y, prepare(**params))           # a Matrix of expressions",
                "    steps = Definitions()",
                "    dy = rhs(t, y, prepare(**params), let=steps)  # short ones, with definitions in `steps`",
                "    f = sympy.lambdify([t, y, list(params.values())], dy, cse=lambda _: (steps, [dy]))",
            ],
        };
        let _ = name;
        std::iter::once(String::new()).chain(lines.iter().map(|line| (*line).to_owned())).collect()
    }

    /// What a function gives.
    fn given(&self, item: &Item<'_>) -> Vec<String> {
        let results = results(item);
        match item.gives {
            Gives::Scalar => vec![format!("return {}", results.first().map_or("0.0", |r| r.as_str()))],
            Gives::Vector => {
                let mut lines = vec!["return _vector([".to_owned()];
                lines.extend(results.iter().map(|result| format!("    {result},")));
                lines.push("])".to_owned());
                lines
            }
            Gives::Matrix(Pattern { shape: (rows, columns), places, is_antisymmetric }) => {
                let mut lines = vec![format!("out = [[0.0] * {columns} for _ in range({rows})]")];
                for ((i, j), value) in places.iter().zip(&results) {
                    lines.push(format!("out[{i}][{j}] = {value}"));
                    if is_antisymmetric {
                        lines.push(format!("out[{j}][{i}] = -out[{i}][{j}]"));
                    }
                }
                lines.push(format!("return _matrix({rows}, {columns}, out)"));
                lines
            }
        }
    }
}

impl Form for Python {
    fn spelling(&self) -> Spelling {
        Spelling(self.0)
    }

    fn comment(&self) -> &'static str {
        "#"
    }

    fn head(&self, name: &str, doc: &[String]) -> String {
        let doc: Vec<String> = doc.iter().cloned().chain(self.usage(name)).collect();
        format!("{}\n{}\n", docstring(&doc, ""), self.beginning())
    }

    fn helpers(&self, calls: &dyn Fn(&str) -> bool) -> String {
        let filled = |[library, absolute, arcsine, select]: [&str; 4]| {
            [STUMPFF_OF_NUMBERS, TURN_OF_NUMBERS].map(|text| {
                let text = text.replace("LIBRARY", library).replace("WHERE", select);
                text.replace("ABS", absolute).replace("ARCSINE", arcsine)
            })
        };
        let ([stumpff, turn], sum) = match self.0 {
            ScriptLanguage::Casadi => (filled(["casadi", "fabs", "asin", "if_else"]), SUM_BY_CASADI),
            ScriptLanguage::Jax => (filled(["jnp", "abs", "arcsin", "where"]), SUM_BY_JAX),
            _ => ([STUMPFF_OF_SYMPY, TURN_OF_SYMPY].map(str::to_owned), SUM_BY_SYMPY),
        };
        let all = [(STUMPFF, stumpff), (TURN, turn), (PRODUCTS, sum.to_owned())];
        all.into_iter().filter(|(name, _)| calls(name)).map(|(_, text)| text).collect()
    }

    fn tail(&self, name: &str, module: &Summary) -> String {
        let n = module.n_state;
        let (taken, named) = match module.has_inputs {
            true => (", u", ", \"u\""),
            false => ("", ""),
        };
        match self.0 {
            ScriptLanguage::Casadi => {
                let inputs = match module.has_inputs {
                    true => "    u = kind.sym(\"u\", len(INPUTS))\n",
                    false => "",
                };
                format!(
                    "def function(kind=casadi.SX, name={name}):\n    \
                         \"\"\"The right-hand side as a casadi.Function, with p in the order of PARAMS.\"\"\"\n    \
                         t, y, p = kind.sym(\"t\"), kind.sym(\"y\", {n}), kind.sym(\"p\", len(PARAMS))\n{inputs}    \
                         params = {{key: p[k] for k, key in enumerate(PARAMS)}}\n    \
                         dy = rhs(t, y, prepare(**params){taken})\n    \
                         return casadi.Function(name, [t, y, p{taken}], [dy], [\"t\", \"y\", \"p\"{named}], [\"dy\"])\n",
                    name = string(&format!("{name}_ode")),
                )
            }
            ScriptLanguage::Sympy => {
                let (inputs, of_inputs) = match module.has_inputs {
                    true => (", inputs", ", [sympy.Symbol(name, real=True) for name in INPUTS]"),
                    false => ("", ""),
                };
                format!(
                    "def symbols():\n    \
                         \"\"\"The time, the state, the parameters by name{}.\"\"\"\n    \
                         state = [sympy.Symbol(name, real=True) for name in STATE]\n    \
                         params = {{name: sympy.Symbol(name, real=True) for name in PARAMS}}\n    \
                         return sympy.Symbol(\"t\", real=True), state, params{of_inputs}\n",
                    if inputs.is_empty() { "" } else { ", the inputs" },
                )
            }
            _ => String::new(),
        }
    }

    fn list(&self, name: &str, doc: &str, entries: &[Entry]) -> String {
        let has_values =
            entries.iter().any(|entry| entry.value.is_some()) || matches!(name, "PARAMS" | "INPUTS");
        let (open, close) = if has_values { ("{", "}") } else { ("(", ")") };
        let mut text = format!("# {doc}\n{name} = {open}\n");
        for Entry { name, value, doc, .. } in entries {
            let value = value.as_ref().map_or_else(String::new, |value| format!(": {value}"));
            let doc = if doc.is_empty() { String::new() } else { format!("  # {doc}") };
            let _ = writeln!(text, "    {}{value},{doc}", string(name));
        }
        text + close + "\n\n"
    }

    fn values(&self, name: &str, doc: &str, values: &[String]) -> String {
        format!("# {}\n{name} = (\n{})\n\n", one_line(doc), indented(&wrapped(values, ","), "    "))
    }

    fn rows(&self, name: &str, rows: &Rows) -> String {
        let texts = |list: &[usize]| list.iter().map(usize::to_string).collect::<Vec<_>>();
        let lists = [texts(&rows.lefts), texts(&rows.rights), rows.numbers.clone(), texts(&rows.results)];
        let lists =
            lists.map(|list| format!("    [\n{}    ],\n", indented(&wrapped(&list, ","), "        ")));
        format!(
            "# Products: left factors, right factors, numbers, results.\n{name} = (\n{})\n\n",
            lists.concat()
        )
    }

    fn prepare(&self, preparation: &Preparation) -> String {
        let Preparation { params, lines, conditions, fields } = preparation;
        let names: Vec<String> = fields.iter().map(|(field, _)| string(field)).collect();
        let mut body = vec![
            "params = {**PARAMS, **changes}".to_owned(),
            "if len(params) != len(PARAMS):".to_owned(),
            "    raise TypeError(f\"no parameter is called {', '.join(params.keys() - PARAMS.keys())}\")"
                .to_owned(),
            "for name, value in params.items():".to_owned(),
            "    _require(value - value == 0, f\"{name} is not finite\")".to_owned(),
        ];
        body.extend(params.iter().map(|[name, _, local]| format!("{local} = params[{}]", string(name))));
        body.extend(lines.iter().cloned());
        body.extend(
            conditions
                .iter()
                .map(|(condition, message)| format!("_require({condition}, {})", string(message))),
        );
        body.push("return Prepared(".to_owned());
        body.extend(fields.iter().map(|(field, value)| format!("    {field}={value},")));
        body.push(")".to_owned());
        format!(
            "# What depends on parameters alone.\nPrepared = namedtuple(\"Prepared\", [\n{}])\n\n\n\
             def prepare({}**changes):\n    \
                 \"\"\"Checks the parameters, as in PARAMS unless given by name, and computes what depends on them alone.\"\"\"\n{}\n\n",
            indented(&wrapped(&names, ","), "    "),
            if self.0 == ScriptLanguage::Sympy { "let=_whole, /, " } else { "" },
            indented(&body, "    ")
        )
    }

    fn bind(&self, name: &str, value: &str) -> String {
        match self.0 {
            ScriptLanguage::Sympy if !is_read_off(value) => format!("{name} = let(\"{name}\", {value})"),
            _ => format!("{name} = {value}"),
        }
    }

    fn pair(&self, sine: &str, cosine: &str, angle: &str) -> String {
        let function = self.spelling().own(SIN_COS);
        match self.0 {
            ScriptLanguage::Sympy => {
                let value = format!("{function}({angle})");
                format!("{sine}, {cosine} = map(let, (\"{sine}\", \"{cosine}\"), {value})")
            }
            _ => format!("{sine}, {cosine} = {function}({angle})"),
        }
    }

    fn vector(&self, values: &[String]) -> String {
        format!("_vector([{}])", values.join(", "))
    }

    fn function(&self, item: &Item<'_>, has_inputs: bool) -> String {
        let arguments: Vec<&str> = item
            .arguments(has_inputs)
            .into_iter()
            .map(|argument| if argument == "u" { "u=tuple(INPUTS.values())" } else { argument })
            .chain((self.0 == ScriptLanguage::Sympy).then_some("let=_whole"))
            .collect();
        let lines = [body(self, item), self.given(item)].concat();
        format!(
            "def {}({}):\n{}{}\n\n",
            item.name,
            arguments.join(", "),
            docstring(&item.doc, "    "),
            indented(&lines, "    ")
        )
    }
}

/// Whether a value is an element of an argument.
fn is_read_off(value: &str) -> bool {
    ["y[", "vector[", "u["].iter().any(|array| value.starts_with(array))
        && value.ends_with(']')
        && value.matches('[').count() == 1
        || value == "value"
}

const CASADI: &str = "\
from collections import namedtuple

import casadi


def _require(condition, message):
    \"\"\"Raises where a condition is known not to hold.\"\"\"
    if not isinstance(condition, (casadi.SX, casadi.MX)) and not condition:
        raise ValueError(message)


def _vector(values):
    return casadi.vertcat(*values) if values else casadi.DM(0, 1)


def _matrix(n_rows, n_columns, rows):
    return casadi.vertcat(*(casadi.horzcat(*row) for row in rows)) if rows else casadi.DM(0, n_columns)


def _sin_cos(angle):
    return casadi.sin(angle), casadi.cos(angle)

";

const JAX: &str = "\
from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy


def _require(condition, message):
    \"\"\"Raises where a condition is known not to hold.\"\"\"
    if not isinstance(condition, jax.core.Tracer) and not numpy.all(condition):
        raise ValueError(message)


def _vector(values):
    return jnp.stack([jnp.asarray(value, dtype=float) for value in values]) if values else jnp.zeros(0)


def _matrix(n_rows, n_columns, rows):
    return jnp.stack([_vector(row) for row in rows]) if rows else jnp.zeros((0, n_columns))


def _sin_cos(angle):
    return jnp.sin(angle), jnp.cos(angle)

";

const SYMPY: &str = "\
from collections import namedtuple

import sympy


class Definitions(list):
    \"\"\"Definitions in their order, as pairs of a symbol and its value: `let` of a function.\"\"\"

    def __call__(self, name, value):
        symbol = sympy.Dummy(name, real=True)
        self.append((symbol, value))
        return symbol


def _whole(name, value):
    return value


def _require(condition, message):
    \"\"\"Raises where a condition is known not to hold.\"\"\"
    if condition in (False, sympy.false):
        raise ValueError(message)


def _vector(values):
    return sympy.Matrix(len(values), 1, values)


def _matrix(n_rows, n_columns, rows):
    return sympy.Matrix(n_rows, n_columns, [value for row in rows for value in row])


def _sin_cos(angle):
    return sympy.sin(angle), sympy.cos(angle)

";

/// Stumpff's functions, with the names of a library to be filled in.
const STUMPFF_OF_NUMBERS: &str = "\
def _stumpff(k, z):
    \"\"\"c_k(z) = sum_j (-z)**j/(2 j + k)!, the series where it converges fast.\"\"\"
    bound = 0.5 * (k + 1) * (k + 2)
    near = LIBRARY.ABS(z) <= bound
    # Each branch has arguments that it can have derivatives at.
    here, there = LIBRARY.WHERE(near, z, 0.0), LIBRARY.WHERE(near, bound + 1.0, z)
    total, factorial = 1.0, 1.0
    for j in reversed(range(24 + k // 2)):
        first = k + 2 * j + 1
        total = 1.0 - here * total / (first * (first + 1))
    for m in range(2, k + 1):
        factorial *= m
    x = LIBRARY.sqrt(LIBRARY.ABS(there))
    turns = there > 0
    if k == 0:
        beyond = LIBRARY.WHERE(turns, LIBRARY.cos(x), LIBRARY.cosh(x))
    else:
        m = 1 if k % 2 else 2
        half = x if k % 2 else 0.5 * x
        beyond = LIBRARY.WHERE(turns, LIBRARY.sin(half), LIBRARY.sinh(half)) / x
        beyond = beyond if k % 2 else 2.0 * beyond * beyond
        inverse = 1.0 / m
        while m < k:
            beyond = (inverse - beyond) / there
            inverse /= (m + 1) * (m + 2)
            m += 2
    return LIBRARY.WHERE(near, total / factorial, beyond)


";

/// The factor of logarithms of rotations and its derivatives, with the names of a library to be filled in.
const TURN_OF_NUMBERS: &str = "\
def _turn(k, w):
    \"\"\"The derivative k, over k!, of asin(sqrt(w))/sqrt(w (1 - w)): the series up to a right angle.\"\"\"
    near = w <= 0.5
    # Each branch has arguments that it can have derivatives at.
    here, there = LIBRARY.WHERE(near, w, 0.0), LIBRARY.WHERE(near, 0.75, w)
    total = 1.0
    for j in reversed(range(56 + 4 * k)):
        m = j + k + 1
        total = 1.0 + here * total * (2 * m * m) / ((j + 1) * (2 * m + 1))
    for m in range(1, k + 1):
        total = total * (2 * m) / (2 * m + 1)
    before = LIBRARY.ARCSINE(LIBRARY.sqrt(there)) / LIBRARY.sqrt(there * (1.0 - there))
    if k == 0:
        return LIBRARY.WHERE(near, total, before)
    divisor, slope = 2.0 * there * (1.0 - there), 2.0 * there - 1.0
    beyond = (1.0 + slope * before) / divisor
    for m in range(1, k):
        ahead = (2 * m * before + (2 * m + 1) * slope * beyond) / ((m + 1) * divisor)
        before, beyond = beyond, ahead
    return LIBRARY.WHERE(near, total, beyond)


";

/// The same as functions that SymPy keeps.
const TURN_OF_SYMPY: &str = "\
class Turn(sympy.Function):
    \"\"\"The derivative k, over k!, of asin(sqrt(w))/sqrt(w (1 - w)), which is 2F1(1, 1; 3/2; w).\"\"\"

    nargs = 2

    @classmethod
    def eval(cls, k, w):
        if w.is_zero:
            return sympy.factorial(k) / sympy.rf(sympy.Rational(3, 2), k)
        return cls._value(k, w, w._prec) if w.is_Float else None

    @staticmethod
    def _value(k, w, prec):
        series = sympy.hyper([k + 1, k + 1], [k + sympy.Rational(3, 2)], w)
        return (series * sympy.factorial(k) / sympy.rf(sympy.Rational(3, 2), k))._eval_evalf(prec)

    def fdiff(self, argindex=2):
        k, w = self.args
        return (k + 1) * Turn(k + 1, w)

    def _eval_evalf(self, prec):
        k, w = self.args
        return Turn._value(k, w._eval_evalf(prec), prec)

    @staticmethod
    def _imp_(k, w):
        \"\"\"The value that `lambdify` calls.\"\"\"
        return float(Turn(k, sympy.Float(float(w), 17)))


def _turn(k, w):
    return Turn(k, sympy.sympify(w))


";

/// Stumpff's functions as functions that SymPy keeps.
const STUMPFF_OF_SYMPY: &str = "\
class Stumpff(sympy.Function):
    \"\"\"c_k(z) = sum_j (-z)**j/(2 j + k)!, which is 1F2(1; (k+1)/2, (k+2)/2; -z/4)/k!.\"\"\"

    nargs = 2

    @classmethod
    def eval(cls, k, z):
        if z.is_zero:
            return 1 / sympy.factorial(k)
        return cls._value(k, z, z._prec) if z.is_Float else None

    @staticmethod
    def _value(k, z, prec):
        series = sympy.hyper([1], [(k + 1) / sympy.S(2), (k + 2) / sympy.S(2)], -z / 4)
        return (series / sympy.factorial(k))._eval_evalf(prec)

    def fdiff(self, argindex=2):
        k, z = self.args
        return (k * Stumpff(k + 2, z) - Stumpff(k + 1, z)) / 2

    def _eval_evalf(self, prec):
        k, z = self.args
        return Stumpff._value(k, z._eval_evalf(prec), prec)

    @staticmethod
    def _imp_(k, z):
        \"\"\"The value that `lambdify` calls.\"\"\"
        return float(Stumpff(k, sympy.Float(float(z), 17)))


def _stumpff(k, z):
    return Stumpff(k, sympy.sympify(z))


";

/// Sums over tables.
const SUM_BY_CASADI: &str = "\
def _sum_products(n, left, right, table):
    \"\"\"For each of n results the sum of its products number * left_i * right_j.\"\"\"
    lefts, rights, numbers, results = table
    left, right = (x if hasattr(x, \"sparsity\") else _vector(list(x)) for x in (left, right))
    sums = casadi.DM.triplet(results, list(range(len(numbers))), numbers, n, len(numbers))
    return casadi.mtimes(sums, left[lefts] * right[rights])


";

/// The same.
const SUM_BY_JAX: &str = "\
def _sum_products(n, left, right, table):
    \"\"\"For each of n results the sum of its products number * left_i * right_j.\"\"\"
    lefts, rights, numbers, results = (jnp.asarray(column) for column in table)
    left, right = jnp.asarray(left), jnp.asarray(right)
    return jnp.zeros(n).at[results].add(numbers * left[lefts] * right[rights])


";

/// The same.
const SUM_BY_SYMPY: &str = "\
def _sum_products(n, left, right, table):
    \"\"\"For each of n results the sum of its products number * left_i * right_j.\"\"\"
    sums = [sympy.S.Zero] * n
    for i, j, number, k in zip(*table):
        sums[k] += number * left[i] * right[j]
    return _vector(sums)


";
