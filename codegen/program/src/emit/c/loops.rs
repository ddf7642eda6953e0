//! Sums of products over tables: the tables as constants, and what runs through them.
//!
//! Deliberately does not know: what the products are of.

use std::fmt::Write as _;

use super::kernel::ADD_PRODUCTS;
use super::text::{elements, length};
use super::writer::Writer;
use crate::emit::literal::number;
use crate::emit::module::{Loops, Routine};
use crate::program::Factors;

impl Writer<'_> {
    /// The tables of the program, for the source alone.
    pub(super) fn tables(&mut self) {
        let module = self.module;
        for (table, name) in module.program.tables.iter().zip(&module.tables) {
            let places: Vec<String> =
                table.all().map(|p| format!("{{{}, {}, {}}}", p.left, p.right, p.number)).collect();
            let ends: Vec<String> = table.ends.iter().map(u32::to_string).collect();
            let numbers: Vec<String> = table.parts().iter().map(|[hi, _]| number(*hi)).collect();
            let _ = write!(
                self.source,
                "static const uint16_t {name}[{}][3] = {};\n\nstatic const uint32_t {name}_ends[{}] = {};\n\n\
                 static const double {name}_numbers[{}] = {};\n\n",
                length(places.len()),
                if places.is_empty() { "{{0}}".to_owned() } else { elements(&places) },
                length(ends.len()),
                elements(&ends),
                length(numbers.len()),
                elements(&numbers)
            );
        }
    }

    /// The contractions of a function, after its straight-line code.
    pub(super) fn loops(&self, routine: &Routine<'_>) -> String {
        let Some(loops) = &routine.loops else { return String::new() };
        let mut text = String::new();
        if !loops.values.is_empty() {
            let values: Vec<&str> = loops.values.iter().map(|value| value.text.as_str()).collect();
            let _ = writeln!(
                text,
                "    const double {}[{}] = {{{}}};",
                loops.scalars,
                values.len(),
                values.join(", ")
            );
        }
        for (contraction, sums) in routine.function.contractions.iter().zip(&loops.sums) {
            let _ = writeln!(text, "    double {sums}[{}] = {{0.0}};", length(contraction.n_results));
            for products in &contraction.terms {
                let table = &self.module.tables[products.table as usize];
                let [left, right] = [products.left, products.right].map(|factors| values_of(loops, factors));
                let n =
                    self.module.program.tables[products.table as usize].ends.len().min(contraction.n_results);
                let _ = writeln!(
                    text,
                    "    {ADD_PRODUCTS}({table}, {table}_ends, {n}, {table}_numbers, {left}, {right}, {sums});"
                );
            }
        }
        text
    }
}

/// The array of factors.
fn values_of(loops: &Loops, factors: Factors) -> &str {
    match factors {
        Factors::State => "y",
        Factors::Argument => "vector",
        Factors::Scalars => &loops.scalars,
        Factors::Contraction(k) => &loops.sums[k as usize],
    }
}
