//! The table of the formulations of a scene.
//!
//! Does not know: how formulations are found.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use hamel_codegen::scene::{Candidate, Formulations};
use hamel_codegen::spec::Model;

/// What the columns are, below the table.
const COLUMNS: &str = "\
cost      additions, multiplications, fused pairs and signs 1, divisions 5, roots 6, elementary functions 20
chain     cycles of the longest chain of operations, each on the result of the one before
prepared  numbers computed once per set of parameters
error     bound of the rounding error of a rate: the largest at 16 points, in units of the roundoff times what rounding
          the inputs does to that rate; measured with double-double numbers where rates carry their errors along
state     `=`: every variable is one of the scene's own; otherwise those that are not, or mean something else there
";

/// A line for each formulation, the cheapest first and the scene's own marked, what the columns are, and what was left
/// out.
pub fn table(model: &Model, scene: &str, found: &Formulations) -> String {
    let mut text = format!(
        "Formulations of scene {scene} of {}, each proved to be the same motion; `*` is as the scene says, `>` what \
         `formulation auto` takes,\n`}}` what `formulation auto(state)` takes:\n\n",
        model.name
    );
    let heads = ["cost", "add", "mul", "fused", "div", "sqrt", "calls", "chain", "prepared", "error"];
    let widths = heads.map(|head| head.len().max(5));
    let state_width = found.candidates.iter().map(|c| state(c).chars().count()).max().unwrap_or(0).max(5);
    let heads: Vec<String> =
        heads.iter().zip(widths).map(|(head, width)| format!("{head:>width$}")).collect();
    let _ = writeln!(text, "    {}  {:state_width$}  formulation", heads.join(" "), "state");
    let [kept, any] = [true, false].map(|keeps_state| std::ptr::from_ref(found.best(keeps_state)));
    for candidate in &found.candidates {
        let c = candidate.counts;
        let numbers = [c.add, c.mul, c.fma, c.div, c.sqrt, c.transcendental].map(|n| n.to_string());
        let cells = [c.cost().to_string()].into_iter().chain(numbers).chain([
            candidate.latency.to_string(),
            candidate.n_prepared.to_string(),
            format!("{:.1}", candidate.rounding),
        ]);
        let cells: Vec<String> = cells.zip(widths).map(|(cell, width)| format!("{cell:>width$}")).collect();
        let is = |is: bool, mark| if is { mark } else { ' ' };
        let this = std::ptr::from_ref(candidate);
        let marks = [is(candidate.is_own(), '*'), is(this == kept, '>'), is(this == any, '}')];
        let marks: String = marks.iter().collect();
        let (state, title) = (state(candidate), candidate.title());
        let _ = writeln!(text, "{marks} {}  {state:state_width$}  {title}", cells.join(" "));
    }
    let _ = write!(text, "\n{COLUMNS}");
    let mut left_out: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for one in &found.left_out {
        left_out.entry(&one.reason).or_default().push(&one.title);
    }
    if !left_out.is_empty() {
        text.push_str("\nleft out:\n");
    }
    for (reason, titles) in left_out {
        let more = if titles.len() > 1 { format!(" (and {} more)", titles.len() - 1) } else { String::new() };
        let _ = writeln!(text, "  {}{more}: {reason}", titles[0]);
    }
    text
}

fn state(candidate: &Candidate) -> String {
    if candidate.keeps_state() { "=".into() } else { in_runs(&candidate.changed) }
}

/// Names with spaces between, three and more that are numbered one after the other as `name1..3`.
fn in_runs(names: &[String]) -> String {
    let numbered = |name: &String| {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
        name[stem.len()..].parse::<u64>().ok().map(|number| (stem.to_owned(), number))
    };
    let mut parts: Vec<String> = Vec::new();
    let mut at = 0;
    while at < names.len() {
        let run = numbered(&names[at]).map_or(1, |(stem, first)| {
            let follows = |(k, name): (u64, &String)| numbered(name) == Some((stem.clone(), first + k));
            (0..).zip(&names[at..]).take_while(|pair| follows(*pair)).count()
        });
        match numbered(&names[at + run - 1]) {
            Some((_, last)) if run > 2 => parts.push(format!("{}..{last}", names[at])),
            _ => parts.extend(names[at..at + run].iter().cloned()),
        }
        at += run;
    }
    parts.join(" ")
}

#[cfg(test)]
mod tests {
    use super::in_runs;

    #[test]
    fn numbered_names_are_shortened() {
        let names = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<String>>();
        assert_eq!(in_runs(&names("b_1 b_2 b_3 c_1 c_2 p9 p10 p11 x")), "b_1..3 c_1 c_2 p9..11 x");
        assert_eq!(in_runs(&names("a1 a3 a4")), "a1 a3 a4");
    }
}
