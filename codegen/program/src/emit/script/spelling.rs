//! Expressions and names of the languages of formulas.
//!
//! Deliberately does not know: programs, how functions and modules are laid out.

use super::super::dialect::Dialect;
use super::super::expression::{Binding, Notation, Text};
use super::super::literal::number;
use crate::program::{Constant, Literal, Signs};
use hamel_expr::Func;

/// A language of formulas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ScriptLanguage {
    /// Python with CasADi: expressions `SX` and `MX`.
    Casadi,
    /// Python with JAX.
    Jax,
    /// Python with SymPy: exact numbers.
    Sympy,
    /// Julia.
    Julia,
    /// MATLAB and Octave.
    Matlab,
}

use ScriptLanguage::{Casadi, Jax, Julia, Matlab, Sympy};

impl ScriptLanguage {
    /// All of them.
    pub const ALL: [ScriptLanguage; 5] = [Casadi, Jax, Sympy, Julia, Matlab];

    /// What names of files end in.
    pub(super) fn extension(self) -> &'static str {
        match self {
            Casadi | Jax | Sympy => "py",
            Julia => "jl",
            Matlab => "m",
        }
    }

    /// Whether the language is Python.
    pub(super) fn is_python(self) -> bool {
        matches!(self, Casadi | Jax | Sympy)
    }

    /// Whether rounding errors can be computed: expressions are exact there, and JAX hands its own to a compiler that
    /// orders operations anew.
    fn rounds_as_written(self) -> bool {
        matches!(self, Julia | Matlab)
    }
}

/// How a language of formulas spells expressions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spelling(pub(super) ScriptLanguage);

/// Names of functions that modules bring with them.
pub(super) const STUMPFF: &str = "stumpff";
pub(super) const TURN: &str = "turn";
pub(super) const SIN_COS: &str = "sin_cos";
pub(super) const PRODUCTS: &str = "sum_products";
const SUM_ERROR: &str = "sum_error";
const PRODUCT_ERROR: &str = "product_error";
const CIRCLE_ERROR: &str = "circle_error";

impl Spelling {
    /// The name of a function that the module brings with it.
    pub(super) fn own(self, name: &str) -> String {
        if self.0.is_python() { format!("_{name}") } else { name.to_owned() }
    }

    /// Names of functions that every module has.
    pub(super) fn own_functions(self) -> impl Iterator<Item = String> {
        self.functions().iter().map(|name| (*name).to_owned())
    }

    /// The name of a function of the library.
    fn of_library(self, name: &str) -> String {
        match self.0 {
            Casadi => format!("casadi.{name}"),
            Jax => format!("jnp.{name}"),
            Sympy => format!("sympy.{name}"),
            Julia | Matlab => name.to_owned(),
        }
    }

    /// A call with these arguments.
    fn call_of(name: &str, arguments: &[Text]) -> Text {
        let depth = arguments.iter().map(|a| a.depth).max().unwrap_or_default() + 1;
        let texts: Vec<&str> = arguments.iter().map(|a| a.text.as_str()).collect();
        Text { text: format!("{name}({})", texts.join(", ")), binding: Binding::Atom, depth }
    }

    /// A rounding error, which vanishes as a formula.
    fn error(self, name: &str, arguments: &[Text]) -> Text {
        match self.0.rounds_as_written() {
            true => Spelling::call_of(&self.own(name), arguments),
            false => Text::atom(self.literal(Literal::Zero)),
        }
    }
}

impl Notation for Spelling {
    fn literal(&self, literal: Literal) -> String {
        match (literal, self.0) {
            (Literal::Zero, Sympy) => "sympy.S.Zero".to_owned(),
            (Literal::One, Sympy) => "sympy.S.One".to_owned(),
            (Literal::Pi, Sympy) => "sympy.pi".to_owned(),
            (Literal::Zero, _) => number(0.0),
            (Literal::One, _) => number(1.0),
            (Literal::Number(x), _) => number(x),
            (Literal::Ratio(p, q), _) => format!("({} / {})", number(p), number(q)),
            (Literal::Pi, _) => number(std::f64::consts::PI),
        }
    }

    fn constant(&self, constant: &Constant) -> String {
        match (constant, self.0) {
            (Constant::Rational(q), Sympy) if !matches!(constant.literal(), Literal::Zero | Literal::One) => {
                format!("sympy.Rational({}, {})", q.numer(), q.denom())
            }
            _ => self.literal(constant.literal()),
        }
    }

    fn square_root(&self, of: Text) -> Text {
        Spelling::call_of(&self.of_library("sqrt"), &[of])
    }

    fn call(&self, function: Func, argument: Text) -> Text {
        let name = match (function, self.0) {
            (Func::Sin, _) => "sin",
            (Func::Cos, _) => "cos",
            (Func::Tan, _) => "tan",
            (Func::Asin, Jax) => "arcsin",
            (Func::Asin, _) => "asin",
            (Func::Acos, Jax) => "arccos",
            (Func::Acos, _) => "acos",
            (Func::Atan, Jax) => "arctan",
            (Func::Atan, _) => "atan",
            (Func::Exp, _) => "exp",
            (Func::Ln, _) => "log",
            (Func::Sinh, _) => "sinh",
            (Func::Cosh, _) => "cosh",
            (Func::Tanh, _) => "tanh",
            (Func::Abs, Casadi) => "fabs",
            (Func::Abs, Sympy) => "Abs",
            (Func::Abs, _) => "abs",
            (Func::Stumpff(k), _) => {
                return Spelling::call_of(&self.own(STUMPFF), &[Text::atom(k.to_string()), argument]);
            }
            (Func::Turn(k), _) => {
                return Spelling::call_of(&self.own(TURN), &[Text::atom(k.to_string()), argument]);
            }
        };
        Spelling::call_of(&self.of_library(name), &[argument])
    }

    fn reciprocal(&self, of: Text) -> Text {
        let of = of.at_least(Binding::Sign);
        let one = if self.0 == Sympy { "1" } else { "1.0" };
        Text { text: format!("{one} / {}", of.text), binding: Binding::Product, depth: of.depth }
    }

    fn power(&self, base: Text, exponent: Text) -> Text {
        let sign = if self.0.is_python() { "**" } else { "^" };
        let base = base.at_least(Binding::Atom);
        // Languages raise powers of powers in different orders.
        let text = format!("({} {sign} {})", base.text, exponent.text);
        Text { text, binding: Binding::Atom, depth: base.depth + 1 }
    }

    fn angle(&self, y: Text, x: Text) -> Text {
        let name = match self.0 {
            Jax => "arctan2",
            Julia => "atan",
            Casadi | Sympy | Matlab => "atan2",
        };
        Spelling::call_of(&self.of_library(name), &[y, x])
    }

    fn sum_error(&self, a: Text, b: Text) -> Text {
        self.error(SUM_ERROR, &[a, b])
    }

    fn product_error(&self, a: Text, b: Text) -> Text {
        self.error(PRODUCT_ERROR, &[a, b])
    }

    fn circle_error(&self, sine: Text, cosine: Text) -> Text {
        self.error(CIRCLE_ERROR, &[sine, cosine])
    }

    fn fused(&self, signs: Signs, a: Text, b: Text, c: Text) -> Text {
        let a = a.signed(signs.product);
        if self.0 == Julia {
            return Spelling::call_of("muladd", &[a, b, c.signed(signs.addend)]);
        }
        let sign = if signs.addend { "-" } else { "+" };
        let (a, b) = (a.at_least(Binding::Product), b.at_least(Binding::Sign));
        let c = c.at_least(Binding::Product);
        Text {
            text: format!("{} * {} {sign} {}", a.text, b.text, c.text),
            binding: Binding::Sum,
            depth: a.depth.max(b.depth).max(c.depth),
        }
    }
}

/// Words of Python, and names that modules call.
const PYTHON: &[&str] = &[
    "False",
    "None",
    "PARAMS",
    "Prepared",
    "True",
    "TypeError",
    "_",
    "and",
    "as",
    "assert",
    "async",
    "await",
    "break",
    "casadi",
    "class",
    "continue",
    "def",
    "del",
    "dict",
    "elif",
    "else",
    "enumerate",
    "except",
    "finally",
    "float",
    "for",
    "from",
    "global",
    "if",
    "import",
    "in",
    "is",
    "jax",
    "jnp",
    "lambda",
    "len",
    "list",
    "match",
    "namedtuple",
    "nonlocal",
    "not",
    "numpy",
    "or",
    "pass",
    "print",
    "raise",
    "range",
    "return",
    "sympy",
    "try",
    "tuple",
    "while",
    "with",
    "yield",
    "zip",
    "self",
];

/// Words of Julia, and names that modules call.
const JULIA: &[&str] = &[
    "_",
    "abs",
    "abstract",
    "acos",
    "asin",
    "atan",
    "baremodule",
    "begin",
    "break",
    "catch",
    "circle_error",
    "const",
    "continue",
    "cos",
    "cosh",
    "do",
    "else",
    "elseif",
    "end",
    "error",
    "eval",
    "exp",
    "export",
    "false",
    "finally",
    "fill",
    "fma",
    "for",
    "function",
    "global",
    "if",
    "import",
    "in",
    "include",
    "isa",
    "isfinite",
    "isodd",
    "keys",
    "let",
    "local",
    "log",
    "macro",
    "merge",
    "missing",
    "module",
    "muladd",
    "mutable",
    "nothing",
    "one",
    "primitive",
    "product_error",
    "promote_type",
    "public",
    "quote",
    "return",
    "sin",
    "sin_cos",
    "sincos",
    "sinh",
    "sqrt",
    "struct",
    "stumpff",
    "sum_error",
    "sum_products",
    "tan",
    "tanh",
    "true",
    "try",
    "turn",
    "typeof",
    "using",
    "values",
    "where",
    "while",
    "zero",
    "zeros",
    "NaN",
    "Inf",
    "Base",
    "Core",
    "Main",
    "PARAMS",
    "ArgumentError",
    "throw",
    "string",
    "factorial",
    "float",
];

/// Words of MATLAB and Octave, and names that modules call.
const MATLAB: &[&str] = &[
    "_",
    "abs",
    "accumarray",
    "acos",
    "ans",
    "asin",
    "atan",
    "atan2",
    "break",
    "case",
    "catch",
    "circle_error",
    "classdef",
    "continue",
    "cos",
    "cosh",
    "do",
    "else",
    "elseif",
    "end",
    "end_try_catch",
    "end_unwind_protect",
    "endclassdef",
    "endenumeration",
    "endevents",
    "endfor",
    "endfunction",
    "endif",
    "endmethods",
    "endparfor",
    "endproperties",
    "endswitch",
    "endwhile",
    "enumeration",
    "error",
    "exp",
    "factorial",
    "fieldnames",
    "for",
    "function",
    "global",
    "if",
    "isequal",
    "isfinite",
    "log",
    "mod",
    "nargin",
    "numel",
    "otherwise",
    "parfor",
    "persistent",
    "product_error",
    "published",
    "return",
    "sin",
    "sin_cos",
    "sinh",
    "spmd",
    "sqrt",
    "struct",
    "stumpff",
    "sum_error",
    "sum_products",
    "switch",
    "tan",
    "tanh",
    "true",
    "false",
    "try",
    "turn",
    "until",
    "unwind_protect",
    "unwind_protect_cleanup",
    "while",
    "zeros",
    "__FILE__",
    "__LINE__",
];

impl Dialect for Spelling {
    fn reserved(&self) -> &'static [&'static str] {
        match self.0 {
            Casadi | Jax | Sympy => PYTHON,
            Julia => JULIA,
            Matlab => MATLAB,
        }
    }

    fn longest_name(&self) -> usize {
        // MATLAB cuts names after `namelengthmax` characters.
        if self.0 == Matlab { 63 } else { usize::MAX }
    }

    fn arguments(&self) -> &'static [&'static str] {
        &["t", "y", "p", "u", "dy", "out", "params", "changes", "vector", "value", "let", "name"]
    }

    fn functions(&self) -> &'static [&'static str] {
        match self.0 {
            Casadi | Jax | Sympy => &[
                "PARAMS",
                "STATE",
                "INPUTS",
                "INITIAL",
                "OUTPUTS",
                "PIVOTS",
                "DOMAIN",
                "EVENTS",
                "IMPLICIT",
                "IMPLICIT_DIFFERENTIAL",
                "IMPLICIT_INDEX",
                "DISCRETE",
                "DISCRETE_STATE",
                "DISCRETE_ENTRIES",
                "Prepared",
                "Definitions",
                "prepare",
                "rhs",
                "energy",
                "pivots",
                "signature",
                "domain",
                "function",
                "symbols",
            ],
            Julia => &[
                "PARAMS",
                "STATE",
                "INPUTS",
                "INITIAL",
                "OUTPUTS",
                "PIVOTS",
                "DOMAIN",
                "EVENTS",
                "IMPLICIT",
                "IMPLICIT_DIFFERENTIAL",
                "IMPLICIT_INDEX",
                "DISCRETE",
                "DISCRETE_STATE",
                "DISCRETE_ENTRIES",
                "prepare",
                "rhs",
                "energy",
                "pivots",
                "signature",
                "domain",
                "eval",
                "include",
            ],
            Matlab => &[
                "published",
                "state_names",
                "inputs",
                "initial",
                "output_names",
                "pivot_names",
                "domain_conditions",
                "event_names",
                "implicit_names",
                "discrete_names",
                "discrete_state",
                "discrete_entries",
                "prepare",
                "rhs",
                "energy",
                "pivots",
                "signature",
                "domain",
                "model",
            ],
        }
    }

    fn places(&self, matrix: &str) -> String {
        format!("{}_PLACES", matrix.to_ascii_uppercase())
    }

    fn table(&self, k: usize) -> String {
        match self.0 {
            Casadi | Jax | Sympy => format!("_PRODUCTS_{k}"),
            Julia => format!("PRODUCTS_{k}"),
            Matlab => format!("products_{k}"),
        }
    }

    fn element(&self, array: &str, k: usize) -> String {
        match self.0 {
            Casadi | Jax | Sympy => format!("{array}[{k}]"),
            Julia => format!("{array}[{}]", k + 1),
            Matlab => format!("{array}({})", k + 1),
        }
    }

    fn field(&self, name: &str) -> String {
        format!("p.{name}")
    }
}
