//! The right-hand side as CasADi calls functions of other sources (`casadi.external`), with its Jacobian.
//!
//! The function `<prefix>_ode` takes time, state, parameters and, where there are any, inputs. Deliberately
//! does not know: what it computes.
//!
//! Source: J. A. E. Andersson, J. Gillis, G. Horn, J. B. Rawlings, M. Diehl, CasADi, Math. Prog. Comp. 11 (2019), and
//! the user guide, section 5.3, for the names and the format of sparsity patterns.

use std::fmt::Write as _;

use super::text::length;
use super::writer::Writer;

/// A matrix by its columns, as CasADi keeps one: its shape, and row and place in the row order of each entry.
struct Columns {
    shape: (usize, usize),
    /// Column, row, and place among the entries as the module computes them; ascending.
    entries: Vec<(usize, usize, usize)>,
}

impl Columns {
    fn of(shape: (usize, usize), pattern: &[(usize, usize)]) -> Columns {
        let mut entries: Vec<_> = pattern.iter().enumerate().map(|(k, (i, j))| (*j, *i, k)).collect();
        entries.sort_unstable();
        Columns { shape, entries }
    }

    fn dense(n_rows: usize, n_columns: usize) -> Columns {
        let all: Vec<_> = (0..n_columns).flat_map(|j| (0..n_rows).map(move |i| (i, j))).collect();
        Columns::of((n_rows, n_columns), &all)
    }

    /// Numbers of rows and columns, where columns begin, and rows.
    fn sparsity(&self) -> String {
        let (n_rows, n_columns) = self.shape;
        let starts = (0..=n_columns).map(|column| self.entries.partition_point(|(j, ..)| *j < column));
        let numbers = [n_rows, n_columns].into_iter().chain(starts).chain(self.entries.iter().map(|e| e.1));
        let texts: Vec<String> = numbers.map(|n| n.to_string()).collect();
        format!("{{{}}}", texts.join(", "))
    }

    /// Statements that put entries in the order of rows into that of columns.
    fn copies(&self, from: &str, to: &str) -> String {
        let lines = self.entries.iter().enumerate();
        lines.map(|(at, (.., k))| format!("        {to}[{at}] = {from}[{k}];\n")).collect()
    }
}

impl Writer<'_> {
    /// The source for CasADi. The Jacobian is there where the scene has all derivatives of the right-hand side.
    pub(super) fn casadi(&self) -> String {
        let (module, prefix) = (self.module, &self.prefix);
        let (n, n_params) = (module.state.len(), module.params.len());
        let m = self.inputs().len();
        let mut inputs = vec![
            ("t", Columns::dense(1, 1)),
            ("y", Columns::dense(n, 1)),
            ("p", Columns::dense(n_params, 1)),
        ];
        inputs.extend((m > 0).then(|| ("u", Columns::dense(m, 1))));
        let outputs = [("dy", Columns::dense(n, 1))];
        // Like the others, inputs that are not given vanish.
        let held = match m {
            0 => String::new(),
            m => format!(
                "    if (arg[3]) {{\n        {prefix}_hold_inputs(&prepared, arg[3]);\n    }} else {{\n        \
                     memset(prepared.inputs, 0, {m} * sizeof(double));\n    }}\n"
            ),
        };
        let take = format!(
            "    const double t = arg[0] ? arg[0][0] : 0.0;\n    double y[{n_y}] = {{0.0}}, values[{n_p}] = {{0.0}};\n    \
                 {prefix}_params params;\n    {prefix}_prepared prepared;\n    (void)iw;\n    (void)w;\n    (void)mem;\n    \
                 if (arg[1]) {{\n        memcpy(y, arg[1], {n} * sizeof(double));\n    }}\n    \
                 if (arg[2]) {{\n        memcpy(values, arg[2], {n_params} * sizeof(double));\n    }}\n    \
                 {prefix}_params_from_array(values, &params);\n    \
                 if ({prefix}_prepare(&params, &prepared) != 0) {{\n        return 1;\n    }}\n{held}",
            n_y = length(n),
            n_p = length(n_params),
        );
        let body = format!(
            "{take}    if (res[0]) {{\n        {prefix}_rhs(&prepared, t, y, res[0]);\n    }}\n    return 0;\n"
        );
        let mut functions = function(&format!("{prefix}_ode"), &inputs, &outputs, &body);
        let matrix = |name: &str| {
            module.outputs.iter().find_map(|o| {
                let (matrix, _) = o.matrix.as_ref().filter(|(matrix, _)| matrix.name == name)?;
                Some((format!("{prefix}_{}", o.name), Columns::of(matrix.shape, &matrix.pattern)))
            })
        };
        let by_time = module.output("time_derivative").map(|name| format!("{prefix}_{name}"));
        let by_inputs = matrix("input_jacobian").filter(|_| m > 0);
        if let (Some((by_state, of_state)), Some((by_params, of_params)), Some(by_time), true) =
            (matrix("jacobian"), matrix("sensitivity"), by_time, by_inputs.is_some() == (m > 0))
        {
            let mut wanted = vec![("jac_dy_y", by_state, of_state), ("jac_dy_p", by_params, of_params)];
            wanted.extend(by_inputs.map(|(function, columns)| ("jac_dy_u", function, columns)));
            let mut body = take;
            let is_scalar = module.outputs.iter().any(|o| o.text.name == "time_derivative" && o.is_scalar());
            let _ = match is_scalar {
                true => writeln!(
                    body,
                    "    if (res[0]) {{\n        res[0][0] = {by_time}(&prepared, t, y);\n    }}"
                ),
                false => {
                    writeln!(body, "    if (res[0]) {{\n        {by_time}(&prepared, t, y, res[0]);\n    }}")
                }
            };
            for (k, (_, name, columns)) in (1..).zip(&wanted) {
                let _ = write!(
                    body,
                    "    if (res[{k}]) {{\n        double entries[{}];\n        {name}(&prepared, t, y, entries);\n{}    }}\n",
                    length(columns.entries.len()),
                    columns.copies("entries", &format!("res[{k}]"))
                );
            }
            body.push_str("    return 0;\n");
            inputs.push(("out_dy", Columns::dense(n, 1)));
            let mut outputs = vec![("jac_dy_t", Columns::dense(n, 1))];
            outputs.extend(wanted.into_iter().map(|(name, _, columns)| (name, columns)));
            functions.push_str(&function(&format!("jac_{prefix}_ode"), &inputs, &outputs, &body));
        }
        format!(
            "{}#include \"{prefix}.h\"\n\n#include <string.h>\n\n#ifndef casadi_real\n#define casadi_real double\n#endif\n\
             #ifndef casadi_int\n#define casadi_int long long int\n#endif\n\
             #if defined(_WIN32)\n#define EXPORT __declspec(dllexport)\n#else\n#define EXPORT\n#endif\n\n{functions}",
            self.first_line()
        )
    }
}

/// A function of CasADi's with its description.
fn function(name: &str, inputs: &[(&str, Columns)], outputs: &[(&str, Columns)], body: &str) -> String {
    let mut text = format!(
        "EXPORT int {name}(const casadi_real **arg, casadi_real **res, casadi_int *iw, casadi_real *w, int mem);\n\
         EXPORT int {name}(const casadi_real **arg, casadi_real **res, casadi_int *iw, casadi_real *w, int mem) {{\n\
         {body}}}\n\n"
    );
    for (which, list) in [("in", inputs), ("out", outputs)] {
        let names: String = list
            .iter()
            .enumerate()
            .map(|(k, (name, _))| format!("    case {k}:\n        return \"{name}\";\n"))
            .collect();
        let mut sparsities = String::new();
        for (k, (_, columns)) in list.iter().enumerate() {
            let _ = write!(
                sparsities,
                "    case {k}: {{\n        static const casadi_int sparsity[] = {};\n        return sparsity;\n    }}\n",
                columns.sparsity()
            );
        }
        let _ = write!(
            text,
            "EXPORT casadi_int {name}_n_{which}(void);\nEXPORT casadi_int {name}_n_{which}(void) {{\n    return {};\n}}\n\n\
             EXPORT const char *{name}_name_{which}(casadi_int i);\n\
             EXPORT const char *{name}_name_{which}(casadi_int i) {{\n    switch (i) {{\n{names}    default:\n        \
                 return 0;\n    }}\n}}\n\n\
             EXPORT const casadi_int *{name}_sparsity_{which}(casadi_int i);\n\
             EXPORT const casadi_int *{name}_sparsity_{which}(casadi_int i) {{\n    switch (i) {{\n{sparsities}    \
                 default:\n        return 0;\n    }}\n}}\n\n",
            list.len()
        );
    }
    let _ = write!(
        text,
        "EXPORT int {name}_work(casadi_int *sz_arg, casadi_int *sz_res, casadi_int *sz_iw, casadi_int *sz_w);\n\
         EXPORT int {name}_work(casadi_int *sz_arg, casadi_int *sz_res, casadi_int *sz_iw, casadi_int *sz_w) {{\n    \
             if (sz_arg) {{\n        *sz_arg = {};\n    }}\n    if (sz_res) {{\n        *sz_res = {};\n    }}\n    \
             if (sz_iw) {{\n        *sz_iw = 0;\n    }}\n    if (sz_w) {{\n        *sz_w = 0;\n    }}\n    return 0;\n}}\n\n",
        inputs.len(),
        outputs.len()
    );
    text
}
