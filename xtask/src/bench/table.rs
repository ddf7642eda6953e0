//! Tables of text, what they say of growth, and the files that reports are.
//!
//! Does not know: what is in a table.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use hamel_run::Error;

/// A table of text; the first line is its head.
pub(super) struct Table {
    pub(super) lines: Vec<Vec<String>>,
    /// How many columns from the left hold words.
    pub(super) n_words: usize,
}

impl Table {
    /// Columns aligned with spaces: words to the left, numbers to the right.
    pub(super) fn text(&self) -> String {
        self.joined("  ", "")
    }

    pub(super) fn markdown(&self) -> String {
        let mut lines: Vec<String> = self.joined(" | ", "|").lines().map(str::to_owned).collect();
        let rule = |k| if k < self.n_words { "---|" } else { "--:|" };
        let rule = (0..self.lines[0].len()).map(rule).collect::<String>();
        lines.insert(1, format!("|{rule}"));
        lines.join("\n") + "\n"
    }

    fn joined(&self, separator: &str, edge: &str) -> String {
        let width = |k: usize| self.lines.iter().map(|l| l[k].chars().count()).max().unwrap_or(0);
        let mut text = String::new();
        for line in &self.lines {
            let cells = line.iter().enumerate().map(|(k, cell)| {
                let width = width(k);
                if k < self.n_words { format!("{cell:width$}") } else { format!("{cell:>width$}") }
            });
            let cells = cells.collect::<Vec<_>>().join(separator);
            let line = if edge.is_empty() { cells } else { format!("{edge} {cells} {edge}") };
            let _ = writeln!(text, "{}", line.trim_end());
        }
        text
    }
}

/// A line of a table.
pub(super) fn cells<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).to_vec()
}

/// A number, or an empty cell.
pub(super) fn number(x: Option<f64>, digits: usize) -> String {
    x.filter(|x| x.is_finite()).map_or_else(String::new, |x| format!("{x:.digits$}"))
}

/// The `p` of `y = c x^p` through the largest half of the points, at least two, by least squares of logarithms.
pub(super) fn exponent(points: impl ExactSizeIterator<Item = [f64; 2]>) -> Option<f64> {
    let skipped = (points.len() / 2).min(points.len().saturating_sub(2));
    let logs: Vec<[f64; 2]> = points.skip(skipped).map(|p| p.map(f64::ln)).collect();
    let n = logs.len() as f64;
    let mean = |k: usize| logs.iter().map(|p| p[k]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    let (mut above, mut below) = (0.0, 0.0);
    for p in &logs {
        above += (p[0] - x) * (p[1] - y);
        below += (p[0] - x).powi(2);
    }
    (below > 0.0).then_some(above / below)
}

/// Writes files into a folder and returns their paths.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn write_files(
    folder: &Path,
    files: impl IntoIterator<Item = (String, String)>,
) -> Result<Vec<PathBuf>, Error> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display().to_string(), e))?;
    let write = |(name, text): (String, String)| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| Error::io(path.display().to_string(), e))?;
        Ok(path)
    };
    files.into_iter().map(write).collect()
}
