//! C's spelling of expressions, and the names that C, C++ and `math.h` take.
//!
//! Deliberately does not know: programs, items of a module.

use super::super::dialect::Dialect;
use super::super::expression::{Binding, Notation, Text};
use super::kernel;
use crate::emit::literal::number;
use crate::program::{Literal, Signs};
use hamel_expr::Func;

/// C99 on `double`.
#[derive(Clone, Copy, Debug)]
pub(super) struct C;

impl C {
    /// A call with these arguments.
    fn function(name: &str, arguments: &[Text]) -> Text {
        let depth = arguments.iter().map(|a| a.depth).max().unwrap_or_default() + 1;
        let texts: Vec<&str> = arguments.iter().map(|a| a.text.as_str()).collect();
        Text { text: format!("{name}({})", texts.join(", ")), binding: Binding::Atom, depth }
    }
}

impl Notation for C {
    fn literal(&self, literal: Literal) -> String {
        match literal {
            Literal::Zero => "0.0".to_owned(),
            Literal::One => "1.0".to_owned(),
            Literal::Number(x) => number(x),
            Literal::Ratio(p, q) => format!("({} / {})", number(p), number(q)),
            Literal::Pi => number(std::f64::consts::PI),
        }
    }

    fn square_root(&self, of: Text) -> Text {
        C::function("sqrt", &[of])
    }

    fn call(&self, function: Func, argument: Text) -> Text {
        let name = match function {
            Func::Sin => kernel::SIN,
            Func::Cos => kernel::COS,
            Func::Tan => "tan",
            Func::Asin => "asin",
            Func::Acos => "acos",
            Func::Atan => "atan",
            Func::Exp => "exp",
            Func::Ln => "log",
            Func::Sinh => "sinh",
            Func::Cosh => "cosh",
            Func::Tanh => "tanh",
            Func::Abs => "fabs",
            Func::Stumpff(k) => {
                return C::function(kernel::STUMPFF, &[Text::atom(k.to_string()), argument]);
            }
            Func::Turn(k) => {
                return C::function(kernel::TURN, &[Text::atom(k.to_string()), argument]);
            }
        };
        C::function(name, &[argument])
    }

    fn reciprocal(&self, of: Text) -> Text {
        let of = of.at_least(Binding::Sign);
        Text { text: format!("1.0 / {}", of.text), binding: Binding::Product, depth: of.depth }
    }

    fn power(&self, base: Text, exponent: Text) -> Text {
        let logarithm = C::function("log", &[base]).text;
        C::function("exp", &[Text::atom(format!("{} * {logarithm}", exponent.text))])
    }

    fn angle(&self, y: Text, x: Text) -> Text {
        C::function("atan2", &[y, x])
    }

    fn sum_error(&self, a: Text, b: Text) -> Text {
        C::function(kernel::SUM_ERROR, &[a, b])
    }

    fn product_error(&self, a: Text, b: Text) -> Text {
        C::function(kernel::PRODUCT_ERROR, &[a, b])
    }

    fn circle_error(&self, sine: Text, cosine: Text) -> Text {
        C::function(kernel::CIRCLE_ERROR, &[sine, cosine])
    }

    fn fused(&self, signs: Signs, a: Text, b: Text, c: Text) -> Text {
        C::function(kernel::MUL_ADD, &[a.signed(signs.product), b, c.signed(signs.addend)])
    }
}

/// Words of C up to C23 and of C++, names of `math.h` that expressions call or that are macros, and macros that
/// compilers define by themselves.
const RESERVED: [&str; 166] = [
    "FP_CONTRACT",
    "FP_FAST_FMA",
    "FP_ILOGB0",
    "FP_INFINITE",
    "FP_NAN",
    "FP_NORMAL",
    "FP_SUBNORMAL",
    "FP_ZERO",
    "HUGE_VAL",
    "INFINITY",
    "MATH_ERREXCEPT",
    "MATH_ERRNO",
    "M_1_PI",
    "M_2_PI",
    "M_2_SQRTPI",
    "M_E",
    "M_LN10",
    "M_LN2",
    "M_LOG10E",
    "M_LOG2E",
    "M_PI",
    "M_PI_2",
    "M_PI_4",
    "M_SQRT1_2",
    "M_SQRT2",
    "NAN",
    "NULL",
    "_Bool",
    "_Complex",
    "_Imaginary",
    "_",
    "acos",
    "acosf",
    "alignas",
    "alignof",
    "and",
    "and_eq",
    "asin",
    "asinf",
    "asm",
    "atan",
    "atan2",
    "atan2f",
    "atanf",
    "auto",
    "bitand",
    "bitor",
    "bool",
    "break",
    "case",
    "catch",
    "char",
    "char16_t",
    "char32_t",
    "char8_t",
    "class",
    "co_await",
    "co_return",
    "co_yield",
    "compl",
    "concept",
    "const",
    "const_cast",
    "consteval",
    "constexpr",
    "constinit",
    "continue",
    "cos",
    "cosf",
    "cosh",
    "coshf",
    "decltype",
    "default",
    "delete",
    "do",
    "double",
    "dynamic_cast",
    "else",
    "enum",
    "exp",
    "expf",
    "explicit",
    "export",
    "extern",
    "fabs",
    "fabsf",
    "false",
    "float",
    "fma",
    "fmaf",
    "for",
    "friend",
    "goto",
    "hamel_add_products",
    "hamel_cos",
    "hamel_fma",
    "hamel_sin",
    "hamel_sin_cos",
    "if",
    "inline",
    "int",
    "isfinite",
    "linux",
    "log",
    "logf",
    "long",
    "memcpy",
    "mutable",
    "namespace",
    "new",
    "noexcept",
    "not",
    "not_eq",
    "nullptr",
    "operator",
    "or",
    "or_eq",
    "private",
    "protected",
    "public",
    "register",
    "reinterpret_cast",
    "requires",
    "restrict",
    "return",
    "short",
    "signed",
    "sin",
    "sinf",
    "sinh",
    "sinhf",
    "size_t",
    "sizeof",
    "sqrt",
    "sqrtf",
    "static",
    "static_assert",
    "static_cast",
    "struct",
    "switch",
    "tan",
    "tanf",
    "tanh",
    "tanhf",
    "template",
    "this",
    "thread_local",
    "throw",
    "true",
    "try",
    "typedef",
    "typeid",
    "typename",
    "typeof",
    "typeof_unqual",
    "union",
    "unix",
    "unsigned",
    "using",
    "virtual",
    "void",
    "volatile",
    "wchar_t",
    "while",
    "xor",
    "xor_eq",
];

impl Dialect for C {
    fn reserved(&self) -> &'static [&'static str] {
        &RESERVED
    }

    fn arguments(&self) -> &'static [&'static str] {
        &["p", "t", "y", "dy", "out", "params", "vector", "scales", "entries", "value", "inputs"]
    }

    fn functions(&self) -> &'static [&'static str] {
        &[
            "params",
            "prepared",
            "params_default",
            "params_from_array",
            "params_to_array",
            "prepare",
            "message",
            "initial",
            "rhs",
            "rhs_with",
            "step",
            "hold_inputs",
            "input_names",
            "input_docs",
            "input_defaults",
            "energy",
            "outputs",
            "pivots",
            "check",
            "signature",
            "domain",
            "event_apply",
            "event_directions",
            "event_effect",
            "event_names",
            "pivot_names",
            "param_names",
            "param_docs",
            "param_defaults",
            "state_names",
            "state_docs",
            "output_names",
            "implicit_names",
            "implicit_differential",
            "discrete_names",
            "discrete_state",
            "discrete_rows",
            "discrete_columns",
        ]
    }

    fn places(&self, matrix: &str) -> String {
        format!("{matrix}_rows")
    }

    fn table(&self, k: usize) -> String {
        format!("products_{k}")
    }

    fn element(&self, array: &str, k: usize) -> String {
        format!("{array}[{k}]")
    }

    fn field(&self, name: &str) -> String {
        format!("p->{name}")
    }
}
