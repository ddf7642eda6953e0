//! Operations of a scene's functions, for people.
//!
//! Does not know: what the functions compute.

use hamel_program::program::{Circles, Counts, Role};

use super::built::BuiltScene;

impl BuiltScene {
    /// Operations of every function, per section of the right-hand side, and of the part that runs once.
    pub fn operation_table(&self) -> String {
        let cells = |counts: Counts| vec![counts.to_string()];
        table(self.operations(|role| *role == Role::Rate).into_iter().map(|(name, c)| (name, cells(c))))
    }

    /// Operations of every function and its sections in columns: additions and multiplications include the fused ones.
    /// After them a line for every search for a cheaper form that stopped early, and every function that is computed as
    /// it was derived.
    pub fn operation_columns(&self) -> String {
        let heads = ["add", "mul", "fused", "div", "sqrt", "neg", "calls", "cost"];
        let cells = |c: Counts| {
            let numbers = [c.add, c.mul, c.fma, c.div, c.sqrt, c.neg, c.transcendental];
            let numbers = numbers.into_iter().map(|n| n as u64).chain([c.cost()]);
            numbers.map(|n| format!("{n:>5}")).collect::<Vec<_>>()
        };
        let rows = self.operation_counts();
        let head = (String::new(), heads.map(|head| format!("{head:>5}")).to_vec());
        let rows = rows.into_iter().map(|(name, c)| (name, cells(c)));
        format!("{}{}", table(std::iter::once(head).chain(rows)), self.program.report)
    }

    /// Operations of the part that runs once, of all functions together, and of every function, followed by those of
    /// its sections, whose names begin with spaces; last the right-hand side on circles, where there is one.
    pub fn operation_counts(&self) -> Vec<(String, Counts)> {
        let mut total = Counts::default();
        self.program.functions.iter().for_each(|f| total += f.counts());
        let mut rows = self.operations(|_| true);
        rows.insert(1, ("all functions, once each".into(), total));
        if let Some(circles) = Circles::of(&self.program) {
            rows.push(("rhs_on_circles".into(), circles.program.functions[Circles::RATE].counts()));
        }
        rows
    }

    /// Operations of the part that runs once and of every function, and of the sections of some.
    fn operations(&self, by_section: impl Fn(&Role) -> bool) -> Vec<(String, Counts)> {
        let mut rows = vec![("prepare (once per parameter set)".into(), self.program.prepare.counts())];
        for function in self.program.functions.iter().filter(|f| !f.results.is_empty()) {
            rows.push((function.role.name().to_owned(), function.counts()));
            if by_section(&function.role) {
                for (k, title) in self.program.sections.iter().enumerate() {
                    let counts = function.counts_of_section(k);
                    if counts.total() > 0 {
                        rows.push((format!("  {title}"), counts));
                    }
                }
            }
        }
        rows
    }
}

/// Rows of a name and cells as lines.
fn table(rows: impl Iterator<Item = (String, Vec<String>)>) -> String {
    let rows: Vec<_> = rows.collect();
    let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    let line = |(name, cells): &(String, Vec<String>)| {
        let pad = " ".repeat(width - name.chars().count());
        format!("  {name}{pad}  {}\n", cells.join("  "))
    };
    rows.iter().map(line).collect()
}
