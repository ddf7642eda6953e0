//! Tables of numbers, as people and instruments write them.
//!
//! Does not know: what the numbers are.

use std::path::{Path, PathBuf};

use hamel_codegen::spec::Unit;

use super::sheet::{Sheet, not_a_number, unit};
use crate::error::{Error, Problem};

/// A table as its file has it: a line of names, and lines of numbers.
///
/// Numbers are separated by commas, semicolons, tabs or blanks; the latter three leave the comma for decimals. Lines
/// before that of the names, and lines that begin with `#`, `%` or `//`, are passed over; names that stand behind `#`
/// count. A unit stands behind a name in brackets or parentheses, or in a line below. Cells may lack a value: empty,
/// `NA`, `NaN`, `null`, `-`, `?`. A column of words alone has no values.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Where it comes from.
    source: Source,
    /// The names of its columns, without units.
    pub names: Vec<String>,
    /// The same as the file has them.
    headers: Vec<String>,
    units: Vec<Option<Unit>>,
    /// The first word of a column of words alone, with its line.
    words: Vec<Option<(usize, String)>>,
    rows: Vec<Row>,
}

/// Where a table comes from, for messages.
#[derive(Clone, Debug, PartialEq)]
enum Source {
    /// A file, whose rows are its lines.
    File(PathBuf),
    /// Columns in memory, whose rows have numbers from zero on.
    Columns(&'static str),
}

/// A column of a table in memory.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// Numbers; one that is NaN lacks a value.
    Numbers(Vec<f64>),
    /// Words alone, of which this is the first: the column has no values.
    Words(String),
}

/// A line of numbers, as many as there are names.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    /// Number of the line in the file, from one on; of a column in memory, from zero on.
    line: usize,
    /// Cells; none where one has no value.
    cells: Vec<Option<f64>>,
}

/// More bad lines than this are not told.
const MAX_PROBLEMS: usize = 20;

impl Table {
    /// Reads a file in UTF-8, in UTF-16 with its mark, or else in Latin-1.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Request`] with every bad cell.
    pub fn read(path: &Path) -> Result<Table, Error> {
        let bytes = std::fs::read(path).map_err(|e| Error::io(path.display().to_string(), e))?;
        Table::parse(path, &decoded(bytes))
    }

    pub(super) fn parse(path: &Path, text: &str) -> Result<Table, Error> {
        let sheet = Sheet::of(text);
        let (headers, units) = sheet.headers();
        let mut table = Table::with_headers(Source::File(path.to_owned()), headers, units);
        table.words = (0..table.names.len()).map(|k| words_in(&sheet, k)).collect();
        let mut problems = Vec::new();
        let mut decimal: Option<(char, usize)> = None;
        for (line, texts) in sheet.data() {
            let mut complain = |reason: String| problems.push(table.problem(line, reason));
            if texts.len() != table.names.len() {
                let (found, wanted) = (texts.len(), table.names.len());
                complain(format!("has {found} values for {wanted} names: give one for each"));
            }
            let mut cells = Vec::with_capacity(texts.len());
            for (k, text) in texts.iter().enumerate() {
                if table.words.get(k).is_some_and(Option::is_some) {
                    cells.push(None);
                    continue;
                }
                match sheet.number(text) {
                    Ok(cell) => cells.push(cell),
                    Err(reason) => complain(reason),
                }
                let Some(mark) = text.chars().find(|c| matches!(c, '.' | ',')) else { continue };
                match decimal {
                    Some((other, before)) if other != mark => complain(format!(
                        "has {text:?}, but line {before} has `{other}` for decimals: write all of them in one way"
                    )),
                    _ => decimal = Some((mark, line)),
                }
            }
            table.rows.push(Row { line, cells });
        }
        problems.truncate(MAX_PROBLEMS);
        if problems.is_empty() { Ok(table) } else { Err(Error::Request { problems }) }
    }

    /// A table of columns in memory, which messages call `what`: names, behind which a unit may stand as in files, with
    /// cells.
    ///
    /// # Errors
    /// [`Error::Request`] with columns of other lengths than the first, and with every number that is not finite.
    pub fn of_columns(what: &'static str, columns: Vec<(String, Cells)>) -> Result<Table, Error> {
        let (headers, columns): (Vec<String>, Vec<Cells>) = columns.into_iter().unzip();
        let units = vec![None; headers.len()];
        let mut table = Table::with_headers(Source::Columns(what), headers, units);
        let length = |cells: &Cells| match cells {
            Cells::Numbers(numbers) => Some(numbers.len()),
            Cells::Words(_) => None,
        };
        let n_rows = columns.iter().find_map(length).unwrap_or_default();
        let mut problems = Vec::new();
        for (header, cells) in table.headers.iter().zip(&columns) {
            if let Some(n) = length(cells).filter(|n| *n != n_rows) {
                let reason = format!("has {n} values of {header} for {n_rows} rows: give one for each");
                problems.push(Problem::Unusable { path: what.into(), reason });
            }
        }
        let word = |cells: &Cells| match cells {
            Cells::Numbers(_) => None,
            Cells::Words(word) => Some((0, word.clone())),
        };
        table.words = columns.iter().map(word).collect();
        if problems.is_empty() {
            for line in 0..n_rows {
                let value = |cells: &Cells| match cells {
                    Cells::Numbers(numbers) => Some(numbers[line]).filter(|x| !x.is_nan()),
                    Cells::Words(_) => None,
                };
                let cells: Vec<Option<f64>> = columns.iter().map(value).collect();
                for x in cells.iter().flatten().filter(|x| !x.is_finite()) {
                    problems.push(table.problem(line, not_a_number(&x.to_string())));
                }
                table.rows.push(Row { line, cells });
            }
        }
        problems.truncate(MAX_PROBLEMS);
        if problems.is_empty() { Ok(table) } else { Err(Error::Request { problems }) }
    }

    /// Without rows; units stand behind names.
    fn with_headers(source: Source, headers: Vec<String>, units: Vec<Option<Unit>>) -> Table {
        let names = headers.clone();
        let mut table = Table { source, names, headers, units, words: Vec::new(), rows: Vec::new() };
        for (name, unit) in table.names.iter_mut().zip(&mut table.units) {
            if let Some((own, text)) = unit_behind(name) {
                *unit = Some(text);
                *name = own;
            }
        }
        table
    }

    /// What messages call it.
    pub fn source(&self) -> String {
        match &self.source {
            Source::File(path) => path.display().to_string(),
            Source::Columns(what) => (*what).to_owned(),
        }
    }

    /// What is wrong with a line of the file.
    fn problem(&self, line: usize, reason: String) -> Problem {
        let path = match &self.source {
            Source::File(path) => format!("{}:{line}", path.display()),
            Source::Columns(what) => format!("row {line} of {what}"),
        };
        Problem::Unusable { path, reason }
    }

    /// What is wrong with a row, counted from zero.
    pub fn problem_in_row(&self, row: usize, reason: String) -> Problem {
        self.problem(self.rows[row].line, reason)
    }

    /// The places of the columns with a name, or with a header as the file has it.
    pub fn places(&self, header: &str) -> Vec<usize> {
        let is_named =
            |names: &[String]| -> Vec<usize> { (0..names.len()).filter(|k| names[*k] == header).collect() };
        let places = is_named(&self.names);
        if places.is_empty() { is_named(&self.headers) } else { places }
    }

    /// By how much the numbers of a column are multiplied to be in the unit of a quantity of a model, `own`, and the
    /// unit of the column; nothing where the column says no unit.
    ///
    /// # Errors
    /// A unit that cannot be converted.
    pub fn factor(
        &self,
        column: usize,
        name: &str,
        own: Option<&Unit>,
    ) -> Result<Option<(f64, &str)>, Problem> {
        let Some(unit) = &self.units[column] else { return Ok(None) };
        let text = unit.text();
        let refused = |reason: String| {
            let path = format!("column {} of {}", self.names[column], self.source());
            Err(Problem::Unusable { path, reason })
        };
        match own {
            Some(own) => match unit.in_units_of(own) {
                Some(factor) => Ok(Some((factor, text))),
                None => refused(format!(
                    "is in {text}, which is no multiple of {}, the unit of {name}: convert the column",
                    own.text()
                )),
            },
            None if unit.factor() == 1.0 => Ok(Some((1.0, text))),
            None => refused(format!(
                "is in {text}, and no unit of {name} is known: write one into its doc comment, as in `/// Place [m].`, \
                 or convert the column"
            )),
        }
    }

    /// The cells of all rows.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[Option<f64>]> {
        self.rows.iter().map(|row| row.cells.as_slice())
    }

    /// Names and rows of a table in which every cell has a value; columns with a unit are converted to that of the
    /// quantity of the same name.
    ///
    /// # Errors
    /// [`Error::Request`] with the rows that lack some, and with units that cannot be converted.
    pub fn full<'u>(
        self,
        unit_of: impl Fn(&str) -> Option<&'u Unit>,
    ) -> Result<(Vec<String>, Vec<Vec<f64>>), Error> {
        let mut problems = Vec::new();
        let mut factors = vec![1.0; self.names.len()];
        for (k, name) in self.names.iter().enumerate() {
            match self.factor(k, name, unit_of(name)) {
                Ok(factor) => factors[k] = factor.map_or(1.0, |(factor, _)| factor),
                Err(problem) => problems.push(problem),
            }
        }
        for (line, word) in self.words.iter().flatten() {
            problems.push(self.problem(*line, not_a_number(word)));
        }
        if !problems.is_empty() {
            return Err(Error::Request { problems });
        }
        let mut rows = Vec::with_capacity(self.rows.len());
        for (row, cells) in self.rows().enumerate() {
            let numbers = cells.iter().zip(&factors).map(|(cell, factor)| Some((*cell)? * factor));
            match numbers.collect::<Option<Vec<f64>>>() {
                Some(numbers) => rows.push(numbers),
                None => problems.push(self.problem_in_row(row, "has an empty cell: give a number".into())),
            }
        }
        problems.truncate(MAX_PROBLEMS);
        if problems.is_empty() { Ok((self.names, rows)) } else { Err(Error::Request { problems }) }
    }
}

/// The first word of a column in which no cell has a number.
fn words_in(sheet: &Sheet, column: usize) -> Option<(usize, String)> {
    let cells = || sheet.data().filter_map(|(line, texts)| Some((line, texts.get(column)?)));
    let has_numbers = cells().any(|(_, text)| sheet.number(text).is_ok_and(|value| value.is_some()));
    let word = cells().find(|(_, text)| sheet.number(text).is_err()).filter(|_| !has_numbers);
    word.map(|(line, text)| (line, text.clone()))
}

/// The text of a file: UTF-16 has a mark, and other bytes than UTF-8 are taken as Latin-1, which every byte belongs to.
fn decoded(bytes: Vec<u8>) -> String {
    let wide = |order: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].chunks_exact(2).map(|pair| order([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&units)
    };
    match bytes.get(..2) {
        Some([0xff, 0xfe]) => return wide(u16::from_le_bytes),
        Some([0xfe, 0xff]) => return wide(u16::from_be_bytes),
        _ => {}
    }
    String::from_utf8(bytes).unwrap_or_else(|error| error.into_bytes().into_iter().map(char::from).collect())
}

/// A header without the unit behind it, `Omega1 [rad/s]` or `x (mm)`, and the unit.
fn unit_behind(header: &str) -> Option<(String, Unit)> {
    let (open, inner) = match header.strip_suffix(']') {
        Some(inner) => ('[', inner),
        None => ('(', header.strip_suffix(')')?),
    };
    let (name, text) = inner.rsplit_once(open)?;
    let name = name.trim();
    (!name.is_empty()).then(|| Some((name.to_owned(), unit(text)?)))?
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use hamel_codegen::spec::Unit;

    use super::{Cells, Table, decoded};

    fn parse(text: &str) -> Result<Table, String> {
        Table::parse(Path::new("starts.csv"), text).map_err(|e| e.to_string())
    }

    fn full(text: &str) -> Result<(Vec<String>, Vec<Vec<f64>>), String> {
        parse(text)?.full(|_| None).map_err(|e| e.to_string())
    }

    #[test]
    fn tables_name_every_bad_cell() {
        let (names, rows) = full("\u{feff}m, Omega1\n1,2\n\n3.5,-4e-1\n").unwrap();
        assert_eq!((names, rows), (vec!["m".into(), "Omega1".into()], vec![vec![1.0, 2.0], vec![3.5, -0.4]]));
        let message = parse("m,l\n1\nx,2\n1,inf\n").unwrap_err();
        for line in ["starts.csv:2 has 1 values for 2 names", "starts.csv:3 \"x\"", "starts.csv:4 \"inf\""] {
            assert!(message.contains(line), "{message}");
        }
    }

    #[test]
    fn empty_cells_are_told_apart_from_numbers() {
        let text = "t,x,y\n0, ,2\n\n1,3,NaN\n2,n/a,-\n";
        let table = parse(text).unwrap();
        let rows: Vec<&[Option<f64>]> = table.rows().collect();
        assert_eq!(
            rows,
            [[Some(0.0), None, Some(2.0)], [Some(1.0), Some(3.0), None], [Some(2.0), None, None]]
        );
        // A line without values is no line of names.
        assert_eq!(parse("t,x\nNA,-\n0,1\n").unwrap().rows().len(), 2);
        // A column of words is passed over where nobody asks for it.
        let table = parse("id;t;x\nleft;0;1,5\nright;1;2\n").unwrap();
        let rows: Vec<&[Option<f64>]> = table.rows().collect();
        assert_eq!(rows, [[None, Some(0.0), Some(1.5)], [None, Some(1.0), Some(2.0)]]);
        let message = full("id;t\nleft;0\nright;1\n").unwrap_err();
        assert!(message.contains("starts.csv:2 \"left\" is not a finite number"), "{message}");
        let message = full(text).unwrap_err();
        assert!(
            message.contains("starts.csv:2 has an empty cell") && message.contains("starts.csv:4"),
            "{message}"
        );
    }

    /// The same numbers as instruments and spreadsheets write them.
    #[test]
    fn instruments_write_the_same_table_in_many_ways() {
        let expected = (vec!["t".to_owned(), "x".to_owned()], vec![vec![0.0, 1.5], vec![0.25, -2e-3]]);
        for text in [
            "t,x\n0,1.5\n0.25,-2e-3\n",
            "t;x\r\n0;1,5\r\n0,25;-2e-3\r\n",
            "t\tx\n0\t1.5\n0.25\t-2e-3\n",
            "  t    x\n  0    1.5\n  0.25 -2e-3",
            "# t x\n0 1.5\n0.25 -2e-3\n",
            "# a motion\n# t,x\n0,1.5\n% a note\n0.25,-2e-3\n// the end\n",
            "Device,SN 123\nSampling rate,100\n\nt,x\n0,1.5\n0.25,-2e-3\n",
            "\"t\",\"x\"\n\"0\",\"1.5\"\n\"0.25\",\"-2e-3\"\n",
            "t,x,\n0,1.5,\n0.25,-2e-3,\n",
            "t [s],x (m)\n0,1.5\n0.25,-2e-3\n",
            "t,x\ns,m\n0,1.5\n0.25,-2e-3\n",
            "t,x\n[s],[m]\n0,1.5\n0.25,-2e-3\n",
        ] {
            assert_eq!(full(text).unwrap_or_else(|e| panic!("{text}: {e}")), expected, "{text}");
        }
        let wide: Vec<u8> =
            "\u{feff}t\tx\n0\t1.5\n0.25\t-2e-3\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(full(&decoded(wide)).unwrap(), expected);
        assert_eq!(decoded(b"x [\xb5m]".to_vec()), "x [\u{b5}m]");
    }

    /// Columns in memory are the same table, with numbers of rows in the place of lines.
    #[test]
    fn columns_in_memory_are_a_table() {
        let numbers = |x: &[f64]| Cells::Numbers(x.to_vec());
        let of = |columns: &[(&str, Cells)]| {
            let columns = columns.iter().map(|(name, cells)| ((*name).to_owned(), cells.clone())).collect();
            Table::of_columns("data", columns).map_err(|e| e.to_string())
        };
        let table =
            of(&[("t", numbers(&[0.0, 0.25])), ("x [mm]", numbers(&[1.5, f64::NAN])), ("id", word("left"))])
                .unwrap();
        let file = parse("t,x [mm],id\n0,1.5,left\n0.25,,right\n").unwrap();
        assert!(table.rows().eq(file.rows()) && table.names == file.names && table.units == file.units);
        assert!(table.full(|_| None).unwrap_err().to_string().contains("column x of data is in mm"));
        let message = of(&[("t", numbers(&[0.0, 0.25])), ("x", numbers(&[1.0]))]).unwrap_err();
        assert!(message.contains("data has 1 values of x for 2 rows"), "{message}");
        let message = of(&[("t", numbers(&[0.0, f64::INFINITY]))]).unwrap_err();
        assert!(message.contains("row 1 of data \"inf\" is not a finite number"), "{message}");
        let named = of(&[("t", numbers(&[0.0])), ("id", word("left"))]).unwrap();
        let message = named.full(|_| None).unwrap_err().to_string();
        assert!(message.contains("row 0 of data \"left\" is not a finite number"), "{message}");
    }

    fn word(text: &str) -> Cells {
        Cells::Words(text.to_owned())
    }

    #[test]
    fn commas_and_points_for_decimals_are_not_mixed() {
        let message = parse("t;x\n0;1,5\n0.25;2\n").unwrap_err();
        assert!(message.contains("starts.csv:3 has \"0.25\", but line 2 has `,` for decimals"), "{message}");
        // A point and a comma in one number are thousands to some and nothing to others.
        assert!(parse("t;x\n0;1\n1;1,234.5\n").unwrap_err().contains("starts.csv:3"));
    }

    #[test]
    fn columns_are_converted_to_the_units_of_the_model() {
        let known = |name: &str| Unit::declared(["m", "rad/s"][usize::from(name != "x")]).unwrap();
        let (x, w) = (known("x"), known("w"));
        let unit_of = |name: &str| if name == "x" { Some(&x) } else { Some(&w) };
        let converted = |text: &str| parse(text)?.full(unit_of).map_err(|e| e.to_string());
        let (names, rows) = converted("x [mm],w (rpm)\n500,60\n").unwrap();
        assert_eq!(names, ["x", "w"]);
        assert!(
            (rows[0][0] - 0.5).abs() < 1e-15 && (rows[0][1] - std::f64::consts::TAU).abs() < 1e-15,
            "{rows:?}"
        );
        let (_, rows) = converted("x,w\ncm,\u{b0}\u{b7}s\u{207b}\u{b9}\n5,180\n").unwrap();
        assert!((rows[0][0] - 0.05).abs() < 1e-15 && (rows[0][1] - std::f64::consts::PI).abs() < 1e-15);
        for (text, words) in [
            ("x [s],w\n1,1\n", "column x of starts.csv is in s, which is no multiple of m"),
            // Turns or radians: nobody knows.
            ("x,w [Hz]\n1,1\n", "column w of starts.csv is in Hz, which is no multiple of rad/s"),
        ] {
            let message = converted(text).unwrap_err();
            assert!(message.contains(words), "{message}");
        }
        let message = full("x [mm]\n1\n").unwrap_err();
        assert!(message.contains("no unit of x is known"), "{message}");
        // Another word than a unit is part of the name.
        assert_eq!(full("x (left)\n1\n").unwrap().0, ["x (left)"]);
    }

    #[test]
    fn headers_are_found_with_their_units_and_without() {
        let table = parse("t [s],x [mm]\n0,1\n").unwrap();
        assert_eq!(
            (table.places("x"), table.places("x [mm]"), table.places("y")),
            (vec![1], vec![1], vec![])
        );
    }
}
