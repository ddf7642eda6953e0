//! Measurements as a table on the terminal, a Markdown page, a CSV file and a bar chart.
//!
//! No dates and no paths are written: the command, the processor and the compiler say where numbers come from.
//!
//! Does not know: how anything was measured.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use hamel::output::plot::bars::{self, Bars};
use hamel_program::program::Counts;
use hamel_run::Error;

use super::kernel::{Kernel, Row};
use super::peers::{self, PEERS, Peer, Peers};
use super::source::Source;
use super::table::{Table, cells, number, write_files};

/// All that was measured, and on what.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Where it comes from.
    pub(crate) source: Source,
    /// The measurements.
    pub(crate) rows: Vec<Row>,
    /// Other generators, when they were measured, too.
    pub(crate) peers: Option<Peers>,
    /// What could not be measured, and why.
    pub(crate) notes: Vec<String>,
}

impl Report {
    /// The report for a terminal.
    pub(crate) fn text(&self) -> String {
        let mut text = format!("{}\n{}", self.source.text(), self.measured().text());
        if let Some((source, tables)) = self.beside_peers() {
            let tables: Vec<String> = tables.iter().map(Table::text).collect();
            let _ = write!(text, "\n{source}\n\n{}", tables.join("\n"));
        }
        for note in &self.notes {
            let _ = write!(text, "\nnote: {note}\n");
        }
        text
    }

    /// Writes `rhs.md`, `rhs.csv` and `rhs.svg`; the files written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let chart = bars::svg(&self.chart()).map_err(|e| Error::io("the chart", std::io::Error::other(e)))?;
        let files = [("rhs.md", self.markdown()), ("rhs.csv", self.csv()), ("rhs.svg", chart)];
        write_files(folder, files.map(|(name, text)| (name.to_owned(), text)))
    }

    /// Nanoseconds above those of the copy kernel; none for several lanes, whose calls the copy kernel does not
    /// resemble.
    fn above_copy(&self, row: &Row) -> Option<f64> {
        above_copy(&self.rows, row)
    }

    fn find(&self, model: &str, scene: &str, kind: &str, lanes: u32) -> Option<&Row> {
        let is = |k: &Kernel| k.model == model && k.scene == scene && k.kind == kind && k.lanes == lanes;
        self.rows.iter().find(|r| is(&r.kernel))
    }

    /// The generated right-hand side that a row is compared with.
    fn generated(&self, row: &Row) -> Option<&Row> {
        self.find(&row.kernel.model, &row.kernel.scene, "hamel", 1).filter(|own| *own != row)
    }

    /// Rows of a model together: the generated ones, then opponents in the order of their kinds.
    fn sorted(&self) -> Vec<&Row> {
        let mut rows: Vec<&Row> = self.rows.iter().collect();
        rows.sort_by(|a, b| a.kernel.model.cmp(&b.kernel.model));
        rows
    }

    fn measured(&self) -> Table {
        let mut lines = vec![cells([
            "model",
            "scene",
            "by",
            "add",
            "mul",
            "fused",
            "div",
            "sqrt",
            "functions",
            "instructions",
            "ns",
            "median",
            "chain",
            "above copy",
            "instructions/hamel",
            "ns/hamel",
        ])];
        for row in self.sorted() {
            let kernel = &row.kernel;
            let count =
                |n: fn(&Counts) -> usize| row.counts.as_ref().map_or_else(String::new, |c| n(c).to_string());
            let own = self.generated(row);
            let ratio =
                |of: &dyn Fn(&Row) -> Option<f64>| number(own.and_then(|o| Some(of(row)? / of(o)?)), 2);
            let above = |r: &Row| self.above_copy(r).filter(|ns| *ns > RESOLUTION);
            lines.push(vec![
                kernel.model.clone(),
                kernel.scene.clone(),
                if kernel.lanes > 1 {
                    format!("{}, {} lanes", kernel.kind, kernel.lanes)
                } else {
                    kernel.kind.clone()
                },
                count(|c| c.add),
                count(|c| c.mul),
                count(|c| c.fma),
                count(|c| c.div),
                count(|c| c.sqrt),
                count(|c| c.transcendental),
                number(row.instructions, 0),
                number(Some(row.min), 2),
                number(Some(row.median), 2),
                number(row.chain, 2),
                number(self.above_copy(row), 2),
                ratio(&|r| r.instructions),
                ratio(&above),
            ]);
        }
        Table { lines, n_words: 3 }
    }

    /// The generated right-hand sides of the default scenes beside the best peers, with where the numbers come from,
    /// and all peers when they were measured in this run; none when no model has a peer.
    fn beside_peers(&self) -> Option<(String, Vec<Table>)> {
        if let Some(peers) = self.peers.as_ref().filter(|p| p.rows.iter().any(|r| !r.kernel.is_copy())) {
            let source = format!(
                "The best peer for each system, measured in this run: {}; {}",
                peers.using.join(", "),
                "each fed by hand with the equations in their best form, parameters at run time."
            );
            return Some((source, vec![self.beside_best(peers), every(peers)]));
        }
        let mut lines = vec![cells([
            "model",
            "instructions",
            "peer",
            "ratio",
            "ns above copy",
            "peer",
            "ratio",
            "ns a lane of 8",
            "peer",
        ])];
        for peer in PEERS {
            let Some(row) = self.find(peer.model, "default", "hamel", 1) else { continue };
            let (ns, theirs) = (self.above_copy(row), peer.ns - peers::COPY);
            let lanes = self.find(peer.model, "default", "hamel", 8).map(|r| r.min);
            lines.push(vec![
                peer.model.to_owned(),
                number(row.instructions, 0),
                number(Some(peer.instructions), 0),
                number(row.instructions.map(|n| n / peer.instructions), 2),
                number(ns, 2),
                number(Some(theirs), 1),
                number(ns.map(|ns| ns / theirs), 2),
                number(lanes, 2),
                number(Some(peer.ns_of_8_lanes), 1),
            ]);
        }
        let source = format!(
            "The best peer for each system, measured elsewhere: {}. Instructions of the same instruction set can be \
             compared; nanoseconds of two machines only roughly, as what a call takes above the copy kernel ({:.2} ns here, \
             {:.1} ns there).",
            peers::CITATION,
            copy(&self.rows),
            peers::COPY
        );
        (lines.len() > 1).then_some((source, vec![Table { lines, n_words: 1 }]))
    }

    /// Beside the best peer of this run, for each measure the one that is best by it.
    fn beside_best(&self, peers: &Peers) -> Table {
        let mut head = vec!["model"];
        for measure in ["instructions", "ns above copy", "ns a lane of 8"] {
            head.extend([measure, "best peer", "by", "ratio"]);
        }
        let mut lines = vec![head.into_iter().map(str::to_owned).collect()];
        for row in self.rows.iter().filter(|r| r.kernel.scene == "default" && r.kernel.kind == "hamel") {
            let model = &row.kernel.model;
            let of_peers = |lanes| {
                peers.rows.iter().filter(move |r| r.kernel.model == *model && r.kernel.lanes == lanes)
            };
            if row.kernel.lanes != 1 || of_peers(1).next().is_none() {
                continue;
            }
            let lanes = self.find(model, "default", "hamel", 8);
            let mut line = vec![model.clone()];
            line.extend(beside(row.instructions, of_peers(1), |r| r.instructions, 0));
            line.extend(beside(self.above_copy(row), of_peers(1), |r| above_copy(&peers.rows, r), 2));
            line.extend(beside(lanes.map(|r| r.min), of_peers(8), |r| Some(r.min), 2));
            lines.push(line);
        }
        Table { lines, n_words: 1 }
    }

    fn markdown(&self) -> String {
        let mut text = format!(
            "# Right-hand sides\n\n{INTRODUCTION}\n\n{}.\n\n![Executed instructions of one call]\
             (rhs.svg)\n\n{}",
            self.source.markdown(),
            self.measured().markdown()
        );
        if let Some((source, tables)) = self.beside_peers() {
            let tables: Vec<String> = tables.iter().map(Table::markdown).collect();
            let how = if tables.len() > 1 { PEERS_OF_THIS_RUN } else { "" };
            let _ = write!(text, "\n## Beside other generators\n\n{source}{how}\n\n{}", tables.join("\n"));
        }
        for note in &self.notes {
            let _ = write!(text, "\nNote: {note}.\n");
        }
        text
    }

    fn csv(&self) -> String {
        let mut text = format!(
            "{}model,scene,by,lanes,add,mul,fused,div,neg,sqrt,functions,instructions,ns_min,ns_median,\
             ns_above_copy,ns_chain\n",
            self.source.csv()
        );
        let rows = self.sorted().into_iter().map(|row| (&self.rows, row));
        let peers = self.peers.iter().flat_map(|p| p.rows.iter().map(|row| (&p.rows, row)));
        for (rows, row) in rows.chain(peers) {
            let (kernel, counts) = (&row.kernel, row.counts.as_ref());
            let counts = counts.map_or_else(
                || ",".repeat(6),
                |Counts { add, mul, fma, div, neg, sqrt, transcendental }| {
                    format!("{add},{mul},{fma},{div},{neg},{sqrt},{transcendental}")
                },
            );
            let _ = writeln!(
                text,
                "{},{},{},{},{counts},{},{},{},{},{}",
                kernel.model,
                kernel.scene,
                if kernel.kind.contains(',') { format!("\"{}\"", kernel.kind) } else { kernel.kind.clone() },
                kernel.lanes,
                number(row.instructions, 1),
                number(Some(row.min), 3),
                number(Some(row.median), 3),
                number(above_copy(rows, row), 3),
                number(row.chain, 3)
            );
        }
        text
    }

    /// Instructions of the models that have peers; nanoseconds where nothing was counted.
    fn chart(&self) -> Bars {
        let counted = self.rows.iter().any(|r| r.instructions.is_some());
        let value = |row: &Row| if counted { row.instructions } else { Some(row.min) };
        let of = |peer: &Peer, kind| self.find(peer.model, "default", kind, 1).and_then(value);
        let best = |peer: &Peer| match &self.peers {
            Some(peers) => {
                let of = peers.rows.iter().filter(|r| r.kernel.model == peer.model && r.kernel.lanes == 1);
                of.filter_map(value).min_by(f64::total_cmp)
            }
            None => counted.then_some(peer.instructions),
        };
        let groups = PEERS.iter().map(|peer| {
            let own = ["hamel", "expert"].map(|kind| of(peer, kind));
            let others = ["naive", "multipliers"].map(|kind| of(peer, kind));
            (peer.model.to_owned(), [own[0], own[1], best(peer), others[0], others[1]].to_vec())
        });
        let best =
            if self.peers.is_some() { "best other generator" } else { "best peer, measured elsewhere" };
        let series = ["hamel", "by hand, expert", best, "vector algebra", "multipliers"];
        Bars {
            title: "One evaluation of a right-hand side".into(),
            subtitle: self.source.machine(),
            x_label: if counted { "executed instructions" } else { "nanoseconds" }.into(),
            series: series.map(str::to_owned).to_vec(),
            groups: groups.collect(),
        }
    }
}

/// Nanoseconds of the copy kernel among rows of one program.
fn copy(rows: &[Row]) -> f64 {
    rows.iter().find(|r| r.kernel.is_copy()).map_or(0.0, |r| r.min)
}

/// What a call takes above the copy kernel of its program.
fn above_copy(rows: &[Row], row: &Row) -> Option<f64> {
    (row.kernel.lanes == 1 && !row.kernel.is_copy()).then(|| row.min - copy(rows))
}

/// A value, the least of others, whose it is, and the ratio.
fn beside<'a>(
    own: Option<f64>,
    others: impl Iterator<Item = &'a Row>,
    value: impl Fn(&Row) -> Option<f64>,
    digits: usize,
) -> [String; 4] {
    let best = others.filter_map(|r| Some((value(r)?, &r.kernel.kind))).min_by(|a, b| a.0.total_cmp(&b.0));
    let theirs = best.map(|(x, _)| x);
    let ratio = own.zip(theirs).filter(|(own, theirs)| own.min(*theirs) > RESOLUTION);
    let ratio = ratio.map(|(own, theirs)| own / theirs);
    let by = best.map_or_else(String::new, |(_, kind)| kind.clone());
    [number(own, digits), number(theirs, digits), by, number(ratio, 2)]
}

/// All peers, each with the better of its compilers by each measure: `instructions / ns above copy / ns a lane of 8`.
fn every(peers: &Peers) -> Table {
    fn name(row: &Row) -> &str {
        row.kernel.kind.rsplit_once(", ").map_or(&row.kernel.kind, |(name, _)| name)
    }
    let rows: Vec<&Row> = peers.rows.iter().filter(|r| !r.kernel.is_copy()).collect();
    let (mut models, mut names) = (Vec::<&str>::new(), Vec::<&str>::new());
    for row in &rows {
        if !models.contains(&row.kernel.model.as_str()) {
            models.push(&row.kernel.model);
        }
        if !names.contains(&name(row)) {
            names.push(name(row));
        }
    }
    let cell = |peer: &str, model: &str| {
        let least = |lanes, value: &dyn Fn(&Row) -> Option<f64>, digits| {
            let of =
                rows.iter().filter(|r| r.kernel.model == model && name(r) == peer && r.kernel.lanes == lanes);
            let least = of.filter_map(|r| value(r)).min_by(f64::total_cmp);
            if least.is_some() { number(least, digits) } else { "-".into() }
        };
        let scalar = least(1, &|r| above_copy(&peers.rows, r), 1);
        format!("{} / {scalar} / {}", least(1, &|r| r.instructions, 0), least(8, &|r| Some(r.min), 1))
    };
    let mut lines = vec![["peer"].iter().chain(&models).map(|s| (*s).to_owned()).collect::<Vec<_>>()];
    for peer in names {
        let cells = models.iter().map(|model| cell(peer, model));
        lines.push([peer.to_owned()].into_iter().chain(cells).collect());
    }
    Table { lines, n_words: 1 }
}

/// Nanoseconds above the copy kernel that cannot be told from nothing: no ratio is made of less.
const RESOLUTION: f64 = 0.2;

const INTRODUCTION: &str = "\
One call of each right-hand side through a pointer, with 64 independent states that stay in the first cache.

* **hamel**: the generated code, monomorphised for `f64`.
* **expert**: the same equations by hand: the best frame, everything that depends on parameters alone computed once, one sine
  and cosine an angle, fused multiply-add.
* **naive**: vector algebra with nalgebra, matrices inverted in every call, parameters read in every call.
* **multipliers**: no reduction: all velocities, the full mass matrix, a multiplier for each constraint, one LU factorisation.

All of them meet the reference data of `tests/reference` (`cargo test -p hamel-bench`). `add` to `functions` are operations of
the generated program; `fused` is how many of the additions are one instruction with a multiplication. `instructions` are
executed by one call, counted by valgrind's callgrind: the mathematical library and the loop around the call are included.
`ns` is the fastest of all rounds, `median` the median one, `chain` the fastest of calls each of which waits for the one
before, as in an integration (`y + h dy` included), `above copy` the fastest less that of the kernel `copy`, which copies six
numbers through the same call. With several lanes all are of one lane. Trust ratios of one run.";

const PEERS_OF_THIS_RUN: &str = " The C, C++ and Rust that they emit is compiled with `-O3`, contraction on, and for lanes put in a
loop over 8 states with `-ffast-math` and vector functions (libmvec); heyoka compiles its batches of 8 for this machine,
whatever `--target-cpu` says. A C program calls them as the Rust one calls hamel's, the two in turn, and `above copy` is above
the copy kernel of each. By each measure the best of all peers and compilers stands beside hamel. The second table has all
peers, the better compiler by each measure: instructions / ns above copy / ns a lane of 8.";

#[cfg(test)]
mod tests {
    use super::{Counts, Peers, Report, Row};
    use crate::bench::kernel::Kernel;
    use crate::bench::source::Source;

    fn row(model: &str, kind: &str, instructions: Option<f64>, min: f64) -> Row {
        let kernel = Kernel { model: model.into(), scene: "default".into(), kind: kind.into(), lanes: 1 };
        let counts = (kind == "hamel").then(|| Counts { add: 10, mul: 12, ..Counts::default() });
        Row { kernel, counts, instructions, min, median: min, chain: Some(2.0 * min) }
    }

    fn report(counted: bool) -> Report {
        let some = |n| counted.then_some(n);
        Report {
            source: Source::of_test("cargo xtask bench rhs"),
            rows: vec![
                row("-", "copy", some(15.0), 1.5),
                row("heavy_top", "hamel", some(40.0), 2.5),
                row("heavy_top", "expert", some(30.0), 2.0),
            ],
            peers: None,
            notes: Vec::new(),
        }
    }

    /// A copy kernel of their own, one generator with two compilers, and one without.
    fn with_peers(counted: bool) -> Report {
        let some = |n| counted.then_some(n);
        let lanes = |mut row: Row| {
            row.kernel.lanes = 8;
            row
        };
        let rows = vec![
            row("-", "copy", some(14.0), 1.0),
            row("heavy_top", "able C, gcc", some(50.0), 4.0),
            row("heavy_top", "able C, clang", some(60.0), 3.0),
            lanes(row("heavy_top", "able C, gcc", None, 0.5)),
            row("heavy_top", "bare", None, 5.0),
        ];
        let mut report = report(counted);
        report.rows.push(lanes(row("heavy_top", "hamel", some(9.0), 0.4)));
        report.peers = Some(Peers { rows, using: vec!["able 1.0".into()] });
        report
    }

    #[test]
    fn peers_of_the_run_stand_beside_above_their_own_copy() {
        let text = with_peers(true).text();
        assert!(text.contains("able 1.0") && !text.contains("elsewhere"), "{text}");
        let line = text.lines().rfind(|l| l.starts_with("heavy_top")).unwrap();
        let words: Vec<&str> = line.split_whitespace().collect();
        let instructions = ["heavy_top", "40", "50", "able", "C,", "gcc", "0.80"];
        let ns = ["1.00", "2.00", "able", "C,", "clang", "0.50"];
        let lanes = ["0.40", "0.50", "able", "C,", "gcc", "0.80"];
        assert_eq!(words, [&instructions[..], &ns, &lanes].concat());
        for every in ["able C  50 / 2.0 / 0.5", "bare       - / 4.0 / -"] {
            assert!(text.contains(every), "{every} in {text}");
        }
        let chart = with_peers(true).chart();
        assert_eq!(chart.groups[0].1, [Some(40.0), Some(30.0), Some(50.0), None, None]);
        assert_eq!(chart.series[2], "best other generator");
    }

    #[test]
    fn ratios_are_to_the_generated_code_and_above_the_copy() {
        let text = report(true).text();
        let of = |name: &str| {
            let line = text
                .lines()
                .find(|l| l.starts_with("heavy_top") && l.contains(name))
                .unwrap_or_else(|| panic!("{name} in {text}"));
            line.split_whitespace().map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(of("expert").last_chunk(), Some(&["0.50", "0.75", "0.50"].map(str::to_owned)));
        assert_eq!(of("hamel  ").last_chunk(), Some(&["2.50", "5.00", "1.00"].map(str::to_owned)));
        let peer = text.lines().rfind(|l| l.starts_with("heavy_top")).unwrap();
        assert!(
            peer.split_whitespace().eq(["heavy_top", "40", "60", "0.67", "1.00", "0.9", "1.11", "0.7"]),
            "{peer}"
        );
    }

    #[test]
    fn every_csv_line_has_all_columns() {
        for (report, n) in [(report(true), 4), (report(false), 4), (with_peers(true), 10)] {
            let text = report.csv();
            let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
            assert_eq!(lines.len(), n);
            let n_columns = |line: &str| line.replace(", ", " ").split(',').count();
            assert!(lines.iter().all(|l| n_columns(l) == n_columns(lines[0])), "{text}");
        }
    }

    #[test]
    fn without_counts_the_chart_shows_times() {
        assert_eq!(report(true).chart().x_label, "executed instructions");
        let chart = report(false).chart();
        assert_eq!(chart.x_label, "nanoseconds");
        assert_eq!(chart.groups[0].1, [Some(2.5), Some(2.0), None, None, None]);
    }
}
