//! A scene for C++17: a header of inline functions over that of C, in the types of the standard library.
//!
//! Deliberately does not know: what the functions compute.

use std::fmt::Write as _;

use super::notation::C;
use super::text::{length, plain};
use super::writer::{Call, Takes, Writer};
use crate::emit::dialect::Dialect as _;
use crate::emit::names::{Scope, legal};

impl Writer<'_> {
    /// The header for C++.
    pub(super) fn cpp(&self) -> String {
        let (prefix, upper) = (&self.prefix, &self.upper);
        let mut scope =
            Scope::with(&C, ["System", "State", "Params", "prepare", "make", "message", "step", "p_"]);
        let mut methods = String::new();
        for Call { title, name, takes, n_results } in &self.calls {
            let method = scope.add(name);
            let _ = writeln!(methods, "\n    /// {}", plain(&title.replace('\n', " ")));
            let (declared, passed) = match takes {
                Takes::Point => ("double t, const State &y".to_owned(), "t, y.data()"),
                Takes::PointAndInputs(n) => {
                    let inputs = format!("const std::array<double, {n}> &u");
                    (format!("double t, const State &y, {inputs}"), "t, y.data(), u.data()")
                }
                Takes::PointAndVector(n) => {
                    let vector = format!("const std::array<double, {}> &v", length(*n));
                    (format!("double t, const State &y, {vector}"), "t, y.data(), v.data()")
                }
                Takes::Variables(n) => {
                    (format!("double t, const std::array<double, {}> &z", length(*n)), "t, z.data()")
                }
                Takes::Flow => ("double tau, const State &y".to_owned(), "tau, y.data()"),
            };
            let _ = match n_results {
                None => writeln!(
                    methods,
                    "    [[nodiscard]] double {method}({declared}) const noexcept {{\n        \
                         return {prefix}_{name}(&p_, {passed});\n    }}"
                ),
                Some(n) => writeln!(
                    methods,
                    "    [[nodiscard]] std::array<double, {n}> {method}({declared}) const noexcept {{\n        \
                         std::array<double, {n}> out;\n        \
                         {prefix}_{name}(&p_, {passed}, out.data());\n        return out;\n    }}",
                    n = length(*n)
                ),
            };
        }
        methods.push_str(&self.holder(&scope.add("hold_inputs")));
        let initial = self.module.text.initial.as_ref().map_or_else(String::new, |_| {
            format!(
                "/// The initial state of the model.\ninline State initial() noexcept {{\n    State y;\n    \
                     {prefix}_initial(y.data());\n    return y;\n}}\n\n"
            )
        });
        format!(
            "{first}#ifndef {upper}_HPP\n#define {upper}_HPP\n\n#include <array>\n#include <optional>\n#include <utility>\n\n\
             #include \"{prefix}.h\"\n\nnamespace {namespace} {{\n\n\
             using Params = {prefix}_params;\nusing State = std::array<double, {n}>;\n\n\
             /// The parameters as published.\ninline Params params_default() noexcept {{\n    \
                 return {prefix}_params_default();\n}}\n\n\
             {initial}\
             /// What a code means that is not 0.\ninline const char *message(int code) noexcept {{\n    \
                 return {prefix}_message(code);\n}}\n\n\
             /// The equations with everything computed that depends on parameters alone: a value, which owns nothing.\n\
             class System {{\npublic:\n    \
                 /// Checks the parameters: the system where the code is 0, else the code for `message`.\n    \
                 [[nodiscard]] static std::pair<std::optional<System>, int> make(const Params &params) noexcept {{\n        \
                     System system;\n        const int code = {prefix}_prepare(&params, &system.p_);\n        \
                     return {{code == 0 ? std::optional<System>(system) : std::nullopt, code}};\n    }}\n\n    \
                 /// Writes the derivative of the state, as solvers of Boost.Numeric.Odeint ask for it.\n    \
                 void operator()(const State &y, State &dy, double t) const noexcept {{\n        \
                     {prefix}_rhs(&p_, t, y.data(), dy.data());\n    }}\n\n    \
                 /// 0, or the code of what vanishes that is divided by.\n    \
                 [[nodiscard]] int check(double t, const State &y) const noexcept {{\n        \
                     return {prefix}_check(&p_, t, y.data());\n    }}\n\n    \
                 /// 0, or the code of the end of a coordinate's domain that was passed.\n    \
                 [[nodiscard]] int domain(double t, const State &y) const noexcept {{\n        \
                     return {prefix}_domain(&p_, t, y.data());\n    }}\n\
             {step}{methods}\n    /// What the functions of C take.\n    \
                 [[nodiscard]] const {prefix}_prepared *get() const noexcept {{\n        return &p_;\n    }}\n\n\
             private:\n    System() noexcept = default;\n\n    {prefix}_prepared p_;\n}};\n\n}}  // namespace {namespace}\n\n#endif\n",
            first = self.first_line(),
            step = match self.module.state.len() {
                0 => String::new(),
                _ => format!(
                    "\n    /// Makes a step of length h, as `{prefix}_step` does: 0, or a code, with `next` as it was.\n    \
                     [[nodiscard]] int step(double t, double h, const State &y, State &next) const noexcept {{\n        \
                         return {prefix}_step(&p_, t, h, y.data(), next.data());\n    }}\n"
                ),
            },
            namespace = legal(C.reserved(), prefix),
            n = length(self.module.state.len()),
        )
    }
}
