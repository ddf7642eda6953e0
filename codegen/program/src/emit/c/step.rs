//! A step in time.
//!
//! Deliberately does not know: what the right-hand side is, who makes steps of other lengths.

use super::writer::Writer;

impl Writer<'_> {
    /// The function that makes a step of fixed length.
    pub(super) fn step(&mut self) {
        let n = self.module.state.len();
        if n == 0 {
            return;
        }
        let (name, rhs, check, domain, signature) = (
            self.name("step"),
            self.name("rhs"),
            self.name("check"),
            self.name("domain"),
            self.name("signature"),
        );
        let lost =
            self.code("the state is not finite at the end of the step: a shorter step may go on".to_owned());
        let passes = self.module.signature.is_some().then(|| {
            let code = self.code("a pivot passes through zero on the step: the equations are singular there".to_owned());
            // Single divisors, which may have a value there, count for less than one.
            format!(
                "    if (!(fabs({signature}(p, t + h, end) - {signature}(p, t, y)) < 1.0)) {{\n        return {code};\n    }}\n"
            )
        });
        let doc = [
            "Makes a step of length h by the method of Runge and Kutta of order four: the state at t + h, which may be \
             written over that at t."
                .to_owned(),
            String::new(),
            format!(
                "Returns 0, or the code of what ends the motion there (see {}), and writes nothing then.{}{}",
                self.name("message"),
                if self.module.text.inputs.is_empty() { "" } else { " Inputs are held over the step." },
                if self.module.text.events.is_empty() { "" } else { " Events are left to the caller." },
            ),
        ];
        let stage = |k: usize, by: &str| {
            format!("    for (int i = 0; i < {n}; i++) {{\n        end[i] = y[i] + {by} * k{k}[i];\n    }}\n")
        };
        let body = format!(
            "    double k1[{n}], k2[{n}], k3[{n}], k4[{n}], end[{n}];\n    const double half = 0.5 * h;\n    int code;\n    \
                 {rhs}(p, t, y, k1);\n{first}    {rhs}(p, t + half, end, k2);\n{second}    {rhs}(p, t + half, end, k3);\n\
             {third}    {rhs}(p, t + h, end, k4);\n    \
                 for (int i = 0; i < {n}; i++) {{\n        \
                     end[i] = y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);\n        \
                     if (!isfinite(end[i])) {{\n            code = {check}(p, t, y);\n            \
                         return code != 0 ? code : {lost};\n        }}\n    }}\n    \
                 code = {domain}(p, t + h, end);\n    if (code != 0) {{\n        return code;\n    }}\n    \
                 code = {check}(p, t + h, end);\n    if (code != 0) {{\n        return code;\n    }}\n\
             {passes}    memcpy(next, end, sizeof end);\n    return 0;\n",
            first = stage(1, "half"),
            second = stage(2, "half"),
            third = stage(3, "h"),
            passes = passes.unwrap_or_default(),
        );
        let arguments = format!(
            "const {} *p, double t, double h, const double y[{n}], double next[{n}]",
            self.name("prepared")
        );
        self.function(&doc, &format!("int {name}({arguments})"), &body);
    }
}
