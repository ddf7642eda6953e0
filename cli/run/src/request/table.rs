//! Tables of numbers: a line of names, then lines of numbers, separated by commas.
//!
//! Does not know: what the numbers are.

use std::path::{Path, PathBuf};

use crate::error::{Error, Problem};

/// A table as its file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    path: PathBuf,
    /// The names of its columns.
    pub names: Vec<String>,
    rows: Vec<Row>,
}

/// A line of numbers, as many as there are names.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    /// Number of the line in the file, from one on.
    line: usize,
    /// Cells; none where one is empty.
    cells: Vec<Option<f64>>,
}

/// More bad lines than this are not told.
const MAX_PROBLEMS: usize = 20;

impl Table {
    /// Reads a file; cells may be empty.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Request`] with every bad cell.
    pub fn read(path: &Path) -> Result<Table, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path.display().to_string(), e))?;
        Table::parse(path, &text)
    }

    pub(super) fn parse(path: &Path, text: &str) -> Result<Table, Error> {
        let text = text.trim_start_matches('\u{feff}');
        let mut reader = csv::ReaderBuilder::new();
        let mut reader =
            reader.has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(text.as_bytes());
        let mut table = Table { path: path.to_owned(), names: Vec::new(), rows: Vec::new() };
        let mut problems = Vec::new();
        let (mut line, mut counted) = (1, 0);
        for texts in reader.records() {
            let texts = texts.map_err(|e| Error::io(path.display().to_string(), e.into()))?;
            if texts.iter().eq([""]) {
                continue;
            }
            // A record begins where the one before ends, with the empty lines between them.
            let before = texts.position().map_or(counted, |position| position.byte() as usize);
            let start = text.len() - text[before..].trim_start().len();
            line += text[counted..start].matches('\n').count();
            counted = start;
            if table.names.is_empty() {
                table.names = texts.iter().map(str::to_owned).collect();
                continue;
            }
            let mut complain = |reason: String| problems.push(table.problem(line, reason));
            if texts.len() != table.names.len() {
                let (found, wanted) = (texts.len(), table.names.len());
                complain(format!("has {found} values for {wanted} names: give one for each"));
            }
            let mut cells = Vec::with_capacity(texts.len());
            for text in &texts {
                match number(text) {
                    _ if text.is_empty() => cells.push(None),
                    Ok(x) => cells.push(Some(x)),
                    Err(reason) => complain(reason),
                }
            }
            table.rows.push(Row { line, cells });
        }
        problems.truncate(MAX_PROBLEMS);
        if problems.is_empty() { Ok(table) } else { Err(Error::Request { problems }) }
    }

    /// What is wrong with a line of the file.
    fn problem(&self, line: usize, reason: String) -> Problem {
        Problem::Unusable { path: format!("{}:{line}", self.path.display()), reason }
    }

    /// What is wrong with a row, counted from zero.
    pub fn problem_in_row(&self, row: usize, reason: String) -> Problem {
        self.problem(self.rows[row].line, reason)
    }

    /// The cells of all rows.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[Option<f64>]> {
        self.rows.iter().map(|row| row.cells.as_slice())
    }

    /// Names and rows of a table without empty cells.
    ///
    /// # Errors
    /// [`Error::Request`] with the rows that have some.
    pub fn full(self) -> Result<(Vec<String>, Vec<Vec<f64>>), Error> {
        let mut problems = Vec::new();
        let mut rows = Vec::with_capacity(self.rows.len());
        for (row, cells) in self.rows().enumerate() {
            match cells.iter().copied().collect::<Option<Vec<f64>>>() {
                Some(numbers) => rows.push(numbers),
                None => problems.push(self.problem_in_row(row, "has an empty cell: give a number".into())),
            }
        }
        problems.truncate(MAX_PROBLEMS);
        if problems.is_empty() { Ok((self.names, rows)) } else { Err(Error::Request { problems }) }
    }
}

/// A finite number.
///
/// # Errors
/// That it is none.
pub(super) fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("{text:?} is not a finite number")),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::Table;

    fn parse(text: &str) -> Result<Table, String> {
        Table::parse(Path::new("starts.csv"), text).map_err(|e| e.to_string())
    }

    #[test]
    fn tables_name_every_bad_cell() {
        let (names, rows) = parse("\u{feff}m, Omega1\n1,2\n\n3.5,-4e-1\n").unwrap().full().unwrap();
        assert_eq!((names, rows), (vec!["m".into(), "Omega1".into()], vec![vec![1.0, 2.0], vec![3.5, -0.4]]));
        let message = parse("m,l\n1\nx,2\n1,nan\n").unwrap_err();
        for line in ["starts.csv:2 has 1 values for 2 names", "starts.csv:3 \"x\"", "starts.csv:4 \"nan\""] {
            assert!(message.contains(line), "{message}");
        }
    }

    #[test]
    fn empty_cells_are_told_apart_from_numbers() {
        let table = parse("t,x,y\n0, ,2\n\n1,3,\n").unwrap();
        let rows: Vec<&[Option<f64>]> = table.rows().collect();
        assert_eq!(rows, [[Some(0.0), None, Some(2.0)], [Some(1.0), Some(3.0), None]]);
        let message = table.full().unwrap_err().to_string();
        assert!(
            message.contains("starts.csv:2 has an empty cell") && message.contains("starts.csv:4"),
            "{message}"
        );
    }
}
