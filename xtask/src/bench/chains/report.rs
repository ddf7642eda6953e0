//! The chains as tables, a CSV file and a figure.
//!
//! Does not know: how anything was measured.

use std::fmt::Write as _;

use hamel::output::plot::loglog::{Curve, LogLog};

use super::{Chain, ChainRow, Chains, Speed};
use crate::bench::source::Source;
use crate::bench::table::{Table, cells, exponent, number};

/// Picks the speed of somebody.
type Of = fn(&ChainRow) -> Option<Speed>;

/// Who is timed.
const WHO: [(&str, Of); 3] =
    [("hamel", |r| Some(r.own)), ("by hand", |r| r.by_hand), ("Pinocchio", |r| r.pinocchio)];

impl Chains {
    /// The section of the page.
    pub(in crate::bench) fn markdown(&self) -> String {
        let mut text = format!(
            "## Chains\n\n{INTRODUCTION}\n\n![Time of a call against the number of bodies](scaling_chains.svg)\n\n{}\n\
             {CALLS}\n\n{}\n{GROWTH}:\n\n{}",
            self.generated().markdown(),
            self.calls().markdown(),
            self.growth().markdown()
        );
        if !self.using.is_empty() {
            let _ = write!(text, "\n{PINOCCHIO} {}.\n", self.using.join("; "));
        }
        for note in &self.notes {
            let _ = write!(text, "\nNote: {note}\n");
        }
        text
    }

    /// For a terminal.
    pub(in crate::bench) fn text(&self) -> String {
        let mut text = format!(
            "{}\n{}\n{GROWTH}:\n\n{}",
            self.generated().text(),
            self.calls().text(),
            self.growth().text()
        );
        for note in &self.notes {
            let _ = write!(text, "\nnote: {note}\n");
        }
        text
    }

    fn generated(&self) -> Table {
        let mut lines = vec![cells([
            "chain",
            "bodies",
            "additions",
            "multiplications",
            "fused",
            "operations",
            "generation ms",
            "peak MiB",
            "lines",
            "rustc ms",
        ])];
        for r in &self.rows {
            let g = &r.generated;
            let counts = [r.n, g.adds, g.muls, g.fused, g.operations].map(|n| n.to_string());
            let mut line = vec![r.chain.name().to_owned()];
            line.extend(counts);
            line.extend([
                number(Some(1e3 * g.seconds), 0),
                number(g.peak, 0),
                g.lines.to_string(),
                number(Some(1e3 * r.rustc.as_secs_f64()), 0),
            ]);
            lines.push(line);
        }
        Table { lines, n_words: 1 }
    }

    fn calls(&self) -> Table {
        let mut head = cells(["chain", "bodies"]);
        head.extend(WHO.iter().map(|(who, _)| format!("{who}, ns")));
        head.extend(WHO.iter().map(|(who, _)| format!("{who}, instructions")));
        head.push("distance".to_owned());
        let mut lines = vec![head];
        for r in &self.rows {
            let mut line = vec![r.chain.name().to_owned(), r.n.to_string()];
            line.extend(WHO.iter().map(|(_, of)| number(of(r).map(|s| s.ns), 1)));
            line.extend(WHO.iter().map(|(_, of)| number(of(r).and_then(|s| s.instructions), 0)));
            line.push(format!("{:.0e}", r.distance));
            lines.push(line);
        }
        Table { lines, n_words: 1 }
    }

    fn growth(&self) -> Table {
        let mut head = cells(["chain", "operations", "generation", "peak", "rustc"]);
        head.extend(WHO.iter().map(|(who, _)| format!("{who}, ns")));
        let mut lines = vec![head];
        for chain in Chain::ALL {
            let rows = self.of(chain);
            let grows = |value: &dyn Fn(&ChainRow) -> Option<f64>| {
                let points: Vec<[f64; 2]> =
                    rows.iter().filter_map(|r| Some([r.n as f64, value(r)?])).collect();
                number(exponent(points.into_iter()), 2)
            };
            let mut line = vec![
                chain.name().to_owned(),
                grows(&|r| Some(r.generated.operations as f64)),
                grows(&|r| Some(r.generated.seconds)),
                grows(&|r| r.generated.peak),
                grows(&|r| Some(r.rustc.as_secs_f64())),
            ];
            line.extend(WHO.iter().map(|(_, of)| grows(&|r| of(r).map(|s| s.ns))));
            lines.push(line);
        }
        Table { lines, n_words: 1 }
    }

    fn of(&self, chain: Chain) -> Vec<&ChainRow> {
        self.rows.iter().filter(|r| r.chain == chain).collect()
    }

    /// One line a chain.
    pub(in crate::bench) fn csv(&self, source: &Source) -> String {
        let mut text = format!(
            "{}chain,bodies,additions,multiplications,fused,operations,all_operations,generation_ms,peak_mib,lines,rustc_ms",
            source.csv()
        );
        for (who, _) in WHO {
            let who = who.replace(' ', "_");
            let _ = write!(text, ",{who}_ns,{who}_instructions");
        }
        text.push_str(",distance\n");
        for r in &self.rows {
            let g = &r.generated;
            let _ = write!(
                text,
                "{},{},{},{},{},{},{},{:.1},{},{},{:.1}",
                r.chain.name(),
                r.n,
                g.adds,
                g.muls,
                g.fused,
                g.operations,
                g.all_operations,
                1e3 * g.seconds,
                number(g.peak, 1),
                g.lines,
                1e3 * r.rustc.as_secs_f64()
            );
            for (_, of) in WHO {
                let (ns, instructions) = (of(r).map(|s| s.ns), of(r).and_then(|s| s.instructions));
                let _ = write!(text, ",{},{}", number(ns, 2), number(instructions, 1));
            }
            let _ = writeln!(text, ",{:.1e}", r.distance);
        }
        text
    }

    /// Time of a call against the number of bodies.
    pub(in crate::bench) fn chart(&self, source: &Source) -> LogLog {
        let curve = |(chain, (who, of)): (Chain, (&str, Of))| Curve {
            name: format!("{}, {who}", chain.name()),
            broken: who != "hamel",
            points: self.of(chain).iter().filter_map(|r| Some([r.n as f64, of(r)?.ns])).collect(),
        };
        let all = WHO.iter().flat_map(|who| Chain::ALL.map(|chain| (chain, *who)));
        LogLog {
            title: "Time of a call against the number of bodies".into(),
            subtitle: source.machine(),
            labels: ["bodies".into(), "nanoseconds".into()],
            curves: all.map(curve).filter(|curve| !curve.points.is_empty()).collect(),
        }
    }
}

const INTRODUCTION: &str = "\
The models are those of `codegen/tests/linkages/families.rs`, with the right-hand side and nothing else. A snake has a wheel
without sideslip on each link; bodies of arms have masses and moments of inertia, those of pendulums are points; the arm in
space is the LBR iiwa 14. Pairs of an addition and a multiplication that are fused are counted in both columns before them,
and the operations have divisions, roots, sines and cosines, too. Each model is generated in a process of its own, whose
largest memory is shown.";

const CALLS: &str = "\
*By hand* are recursions written for each chain alone (`xtask/src/bench/chains`): the snake by products of reflections, the
pendulums by the forces along their rods, which are a tridiagonal system, the planar arm as articulated bodies in the plane,
all of them loops; the arm in space as articulated bodies, without loops and without the operations that its zeros and ones
save. Lengths and masses of that one are numbers in the code, those of all others are data. Sines and cosines are those of the
runtime for hamel and by hand. The distance is the largest one of a rate from those of the others, relative to the largest
rate: more than 1e-10 ends the measurement.";

const GROWTH: &str = "Exponents p of c n^p in the number n of bodies, over the larger half of each chain";

const PINOCCHIO: &str = "\
Pinocchio's articulated-body algorithm (`pinocchio::aba`) is called from C++ and compiled from the headers of its wheel with
`-O3 -DNDEBUG -ffp-contract=fast -fno-math-errno -fno-trapping-math` for the same instruction set; the wheel has no code
generator for CasADi. Its pendulums have joints with relative angles, those in space universal ones, and it reads its model
from memory, whatever the chain is. Wheels of the snake are no joints:";

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Chain, ChainRow, Chains, Speed};
    use crate::bench::chains::Generated;
    use crate::bench::source::Source;

    fn chains() -> Chains {
        let row = |n: usize| {
            let generated = Generated {
                state: Vec::new(),
                adds: n,
                muls: n,
                fused: n,
                operations: n * n,
                all_operations: n * n,
                lines: n,
                seconds: n as f64,
                peak: None,
            };
            let own = Speed { ns: n as f64, instructions: None };
            let (rustc, by_hand) = (Duration::from_millis(n as u64), Some(own));
            ChainRow {
                chain: Chain::Snake,
                n,
                generated,
                rustc,
                own,
                by_hand,
                pinocchio: None,
                distance: 1e-15,
            }
        };
        Chains { rows: [2, 4, 8, 16].map(row).to_vec(), ..Chains::default() }
    }

    #[test]
    fn growth_is_that_of_the_bodies() {
        let text = chains().growth().text();
        let line = text.lines().find(|l| l.starts_with("snake")).unwrap_or_default();
        assert_eq!(
            line.split_whitespace().collect::<Vec<_>>(),
            ["snake", "2.00", "1.00", "1.00", "1.00", "1.00"]
        );
    }

    #[test]
    fn every_csv_line_has_all_columns() {
        let text = chains().csv(&Source::of_test("bench scaling"));
        let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
        assert_eq!(lines.len(), 5);
        assert!(lines.iter().all(|l| l.split(',').count() == 18), "{text}");
    }

    #[test]
    fn who_was_not_measured_has_no_curve() {
        let chart = chains().chart(&Source::of_test("bench scaling"));
        let names: Vec<&str> = chart.curves.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["snake, hamel", "snake, by hand"]);
    }
}
