//! What says where the equations end: pivots and their check, the domain of the coordinates.
//!
//! Deliberately does not know: how rounding errors of pivots are bounded.

use std::fmt::Write as _;

use super::functions::Arguments;
use super::writer::Writer;

impl Writer<'_> {
    /// What is divided by, and the function that finds the first of it that cannot be divided by.
    pub(super) fn pivots(&mut self) {
        let (module, arguments) = (self.module, self.arguments());
        let signature = format!("int {}({arguments})", self.name("check"));
        let n = module.pivots.as_ref().map_or(0, |routine| routine.function.results.len() / 2);
        self.constant("Number of pivots.", "N_PIVOTS", n);
        let Some(routine) = module.pivots.as_ref().filter(|_| n > 0) else {
            let doc = ["Returns 0: nothing is divided by that may vanish.".to_owned()];
            return self.function(
                &doc,
                &signature,
                "    (void)p;\n    (void)t;\n    (void)y;\n    return 0;\n",
            );
        };
        let names: Vec<String> = routine.function.results[..n].iter().map(|(name, _)| name.clone()).collect();
        self.array_of_names("What the right-hand side divides by that may vanish.", "pivot_names", &names);
        let mut body = self.body(routine, Arguments::Point);
        let (values, scales) = routine.code.results.split_at(n);
        for (to, texts) in [("out", values), ("scales", scales)] {
            for (k, text) in texts.iter().enumerate() {
                let _ = writeln!(body, "    {to}[{k}] = {};", text.text);
            }
        }
        let pivots = self.name("pivots");
        let doc = ["The pivots, each with the scale of its rounding errors.".to_owned()];
        self.function(
            &doc,
            &format!("void {pivots}({arguments}, double out[{n}], double scales[{n}])"),
            &body,
        );
        let first = self.messages.len();
        for name in &names {
            self.code(format!("pivot {name} vanishes: the equations are singular there"));
            self.code(format!("pivot {name} is not finite: the numbers of the state are too large for it"));
        }
        let body = format!(
            "    double values[{n}], scales[{n}];\n    {pivots}(p, t, y, values, scales);\n    \
                 for (int k = 0; k < {n}; k++) {{\n        \
                     if (!isfinite(values[k])) {{\n            return {first} + 2 * k + 1;\n        }}\n        \
                     if (!(scales[k] + fabs(values[k]) > scales[k]) || !isfinite(1.0 / values[k])) {{\n            \
                         return {first} + 2 * k;\n        }}\n    }}\n    return 0;\n"
        );
        let doc = ["Returns 0, or the code of the first pivot that vanishes or is not finite.".to_owned()];
        self.function(&doc, &signature, &body);
    }

    /// The function that finds the first end of a coordinate's interval that does not hold.
    pub(super) fn domain(&mut self) {
        let module = self.module;
        let signature = format!("int {}({})", self.name("domain"), self.arguments());
        let Some(routine) = &module.domain else {
            let doc = ["Returns 0: the coordinates have no domain.".to_owned()];
            return self.function(
                &doc,
                &signature,
                "    (void)p;\n    (void)t;\n    (void)y;\n    return 0;\n",
            );
        };
        let mut body = self.body(routine, Arguments::Point);
        for ((condition, _), value) in routine.function.results.iter().zip(&routine.code.results) {
            let code = self.code(format!("{condition} does not hold: the equations are not defined there"));
            let _ = write!(body, "    if (!({} > 0.0)) {{\n        return {code};\n    }}\n", value.text);
        }
        body.push_str("    return 0;\n");
        let doc =
            ["Returns 0, or the code of the first condition of the coordinates' domain that does not hold."
                .to_owned()];
        self.function(&doc, &signature, &body);
    }
}
