//! Cells of a table's text: which character separates them, which line has the names, which lines have numbers.
//!
//! Does not know: what the numbers are, files.

use hamel_codegen::spec::Unit;

/// What stands between two cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    Comma,
    Semicolon,
    Tab,
    /// Any number of blanks.
    Blanks,
}

impl Separator {
    const ALL: [Separator; 4] = [Separator::Comma, Separator::Semicolon, Separator::Tab, Separator::Blanks];
}

/// The cells of a text.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    separator: Separator,
    /// Lines with cells, with their numbers from one on.
    lines: Vec<(usize, Vec<String>)>,
    /// Cells of the line of names.
    names: Vec<String>,
    /// Cells of the line of units, where there is one.
    units: Vec<String>,
    /// The first line of numbers.
    first: usize,
}

impl Sheet {
    /// With the first separator for which the text is a table of several columns; else of one.
    pub(super) fn of(text: &str) -> Sheet {
        let text = text.trim_start_matches('\u{feff}');
        let mut narrow = None;
        for separator in Separator::ALL {
            match Sheet::new(text, separator) {
                Some(sheet) if sheet.names.len() > 1 && sheet.is_full() => return sheet,
                found => narrow = narrow.or(found),
            }
        }
        narrow.unwrap_or_else(|| Sheet::with_words(text))
    }

    /// Where no line has numbers alone: under the first of the lines with as many cells as most lines have, more than
    /// one, with the separator for which there are most of these.
    fn with_words(text: &str) -> Sheet {
        let mut best: Option<(usize, Sheet)> = None;
        for separator in Separator::ALL {
            let lines = cells(text, separator);
            let alike = |n: usize| lines.iter().filter(|(_, cells)| cells.len() == n).count();
            let width = lines.iter().map(|(_, cells)| cells.len()).max_by_key(|n| (*n > 1, alike(*n)));
            let Some(width) = width else { continue };
            let n_alike = if width > 1 { alike(width) } else { 0 };
            if best.as_ref().is_some_and(|(n, _)| *n >= n_alike) {
                continue;
            }
            let head = lines.iter().position(|(_, cells)| cells.len() == width).unwrap_or_default();
            let (names, first) = (lines[head].1.clone(), head + 1);
            best = Some((n_alike, Sheet { separator, lines, names, units: Vec::new(), first }));
        }
        let nothing = Sheet {
            separator: Separator::Comma,
            lines: Vec::new(),
            names: Vec::new(),
            units: Vec::new(),
            first: 0,
        };
        best.map_or(nothing, |(_, sheet)| sheet)
    }

    /// None where no line has numbers alone.
    fn new(text: &str, separator: Separator) -> Option<Sheet> {
        let lines = cells(text, separator);
        let is_number = |cell: &String| value(cell, separator).is_ok_and(|value| value.is_some());
        let is_data = |cells: &[String]| {
            cells.iter().any(is_number) && cells.iter().all(|cell| value(cell, separator).is_ok())
        };
        let data = lines.iter().position(|(_, cells)| is_data(cells))?;
        let has_words = |cells: &[String]| {
            !cells.iter().any(is_number) && cells.iter().any(|c| value(c, separator).is_err())
        };
        let mut heads = (0..data).rev().filter(|k| has_words(&lines[*k].1));
        let mut head = heads.next();
        let mut units = Vec::new();
        if let (Some(k), Some(before)) = (head, heads.next())
            && let Some(found) = units_of(&lines[k].1)
            && lines[before].1.len() == lines[k].1.len()
        {
            (head, units) = (Some(before), found);
        }
        let (names, first) = match head {
            Some(k) => (lines[k].1.clone(), k + 1 + usize::from(!units.is_empty())),
            None => (commented(text, separator, lines[data].1.len())?, data),
        };
        let mut sheet = Sheet { separator, lines, names, units, first };
        sheet.drop_last_column();
        Some(sheet)
    }

    /// Whether the first line of numbers has as many as there are names.
    fn is_full(&self) -> bool {
        self.lines[self.first..].first().is_some_and(|(_, cells)| cells.len() == self.names.len())
    }

    /// A separator behind the last cell of a line makes no column.
    fn drop_last_column(&mut self) {
        let n = self.names.len();
        let data = &mut self.lines[self.first..];
        let ends_empty =
            |cells: &[String], n: usize| cells.len() == n && cells.last().is_some_and(String::is_empty);
        if n > 1
            && ends_empty(&self.names, n)
            && data.iter().all(|(_, cells)| cells.len() < n || ends_empty(cells, n))
        {
            self.names.pop();
            self.units.truncate(n - 1);
        }
        let n = self.names.len();
        for (_, cells) in data.iter_mut().filter(|(_, cells)| ends_empty(cells, n + 1)) {
            cells.pop();
        }
    }

    /// Names and units of the columns.
    pub(super) fn headers(&self) -> (Vec<String>, Vec<Option<Unit>>) {
        let units = (0..self.names.len()).map(|k| unit(bare(self.units.get(k)?)));
        (self.names.clone(), units.collect())
    }

    /// The lines below the names.
    pub(super) fn data(&self) -> impl Iterator<Item = (usize, &[String])> {
        self.lines[self.first..].iter().map(|(line, cells)| (*line, cells.as_slice()))
    }

    /// The value of a cell, if it has one.
    ///
    /// # Errors
    /// That it is no number.
    pub(super) fn number(&self, cell: &str) -> Result<Option<f64>, String> {
        value(cell, self.separator)
    }
}

/// Cells that stand for a value that is missing, in lower case.
const MISSING: [&str; 10] = ["", "na", "n/a", "#n/a", "nan", "null", "none", "-", "--", "?"];

fn value(cell: &str, separator: Separator) -> Result<Option<f64>, String> {
    if MISSING.contains(&cell.to_lowercase().as_str()) {
        return Ok(None);
    }
    if separator != Separator::Comma && cell.matches(',').count() == 1 && !cell.contains('.') {
        return number(&cell.replace(',', ".")).map(Some).map_err(|_| not_a_number(cell));
    }
    number(cell).map(Some)
}

/// What stands behind the sign of a comment.
fn comment(line: &str) -> Option<&str> {
    let line = line.trim_start();
    ["#", "%", "//"].iter().find_map(|sign| line.strip_prefix(sign))
}

/// Lines with cells; lines without, and comments, are left out.
fn cells(text: &str, separator: Separator) -> Vec<(usize, Vec<String>)> {
    // As many lines as before: errors tell the numbers of the file's lines.
    let lines = text.lines().map(|line| match (comment(line), separator) {
        (Some(_), _) => String::new(),
        (None, Separator::Blanks) => line.split_whitespace().collect::<Vec<_>>().join("\t"),
        (None, _) => line.to_owned(),
    });
    let text = lines.collect::<Vec<String>>().join("\n");
    let delimiter = match separator {
        Separator::Comma => b',',
        Separator::Semicolon => b';',
        Separator::Tab | Separator::Blanks => b'\t',
    };
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.has_headers(false).flexible(true).trim(csv::Trim::All).delimiter(delimiter);
    let mut all = Vec::new();
    let (mut line, mut counted, mut before) = (1, 0, 0);
    // A text in memory has no errors of reading.
    for record in reader.from_reader(text.as_bytes()).records().filter_map(Result::ok) {
        // A record begins where the one before ends, with the empty lines between them.
        before = record.position().map_or(before, |position| position.byte() as usize);
        let start = text.len() - text[before..].trim_start_matches(['\n', '\r', ' ']).len();
        line += text[counted..start.max(counted)].matches('\n').count();
        counted = start.max(counted);
        if record.iter().any(|cell| !cell.is_empty()) {
            all.push((line, record.iter().map(str::to_owned).collect()));
        }
    }
    all
}

/// The names in the last comment before the numbers that has as many as there are columns.
fn commented(text: &str, separator: Separator, n: usize) -> Option<Vec<String>> {
    let comments = text.lines().take_while(|line| line.trim().is_empty() || comment(line).is_some());
    let comments: Vec<&str> = comments.filter_map(comment).collect();
    comments.iter().rev().find_map(|line| {
        let (_, names) = cells(line, separator).into_iter().next()?;
        (names.len() == n && names.iter().all(|name| value(name, separator).is_err())).then_some(names)
    })
}

/// A unit without brackets.
fn bare(cell: &str) -> &str {
    let inner = |open, close| cell.strip_prefix(open)?.strip_suffix(close);
    inner('[', ']').or_else(|| inner('(', ')')).unwrap_or(cell)
}

/// The cells of a line of units, unless another word is among them.
fn units_of(cells: &[String]) -> Option<Vec<String>> {
    let is_unit = |cell: &String| cell.is_empty() || unit(bare(cell)).is_some();
    cells.iter().all(is_unit).then(|| cells.to_vec())
}

/// The unit of a text: that of doc comments, with raised exponents and revolutions per minute.
pub(super) fn unit(text: &str) -> Option<Unit> {
    const RAISED: [(char, &str); 6] = [
        ('\u{207b}', "-"),
        ('\u{b9}', "1"),
        ('\u{b2}', "2"),
        ('\u{b3}', "3"),
        ('\u{2074}', "4"),
        ('\u{b7}', " "),
    ];
    let mut plain = String::new();
    let mut is_raised = false;
    for c in text.trim().chars() {
        match RAISED.iter().find(|(raised, _)| *raised == c) {
            Some((_, " ")) | None => {
                is_raised = false;
                plain.push(if c == '\u{b7}' { ' ' } else { c });
            }
            Some((_, exponent)) => {
                if !std::mem::replace(&mut is_raised, true) {
                    plain.push('^');
                }
                plain.push_str(exponent);
            }
        }
    }
    Unit::declared(if plain == "rpm" { "turn/min" } else { &plain })
}

/// A finite number.
///
/// # Errors
/// That it is none.
pub(super) fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(not_a_number(text)),
    }
}

/// The message about a text in the place of a number.
pub(super) fn not_a_number(text: &str) -> String {
    format!("{text:?} is not a finite number")
}
