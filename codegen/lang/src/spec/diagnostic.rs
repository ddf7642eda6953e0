//! Problems of a model: a message, the place in the text, a hint, and their rendering.

use std::fmt;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// Longest list of problems that is rendered.
const MAX_SHOWN: usize = 100;
/// Longest source line that is shown with its surroundings; longer ones are cut around the underlined tokens.
const MAX_WIDTH: usize = 400;

/// A byte range of the model's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl Span {
    /// The range `start..end`.
    pub fn new(start: usize, end: usize) -> Span {
        Span { start, end: end.max(start) }
    }

    /// The smallest span that contains both.
    pub fn to(self, other: Span) -> Span {
        Span { start: self.start.min(other.start), end: self.end.max(other.end) }
    }
}

/// The file a model was read from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Name as given to [`parse`](super::parse), shown in messages.
    pub file: String,
    /// The whole text.
    pub text: String,
}

impl Origin {
    /// Line and column of a byte offset, both counted from one, columns in characters.
    pub fn line_column(&self, offset: usize) -> (usize, usize) {
        let offset = floor_boundary(&self.text, offset);
        let before = &self.text[..offset];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// How much a [`Diagnostic`] matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The text is no model.
    Error,
    /// The model means something, but probably not all that was meant.
    Warning,
}

/// A word that stands where another one was probably meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Replacement {
    /// The word of the text, within the span of the problem.
    pub wrong: String,
    /// What was probably meant.
    pub right: String,
}

/// What to change: a sentence, and the replacement that it proposes where it proposes one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Help {
    text: String,
    replacement: Option<Replacement>,
}

impl Help {
    /// A sentence that proposes to write `right` in the place of `wrong`.
    pub(super) fn replacing(wrong: &str, right: &str, text: impl Into<String>) -> Help {
        let replacement = Some(Replacement { wrong: wrong.to_owned(), right: right.to_owned() });
        Help { text: text.into(), replacement }
    }

    /// Whether it says nothing.
    pub(super) fn is_empty(&self) -> bool {
        self.text.is_empty()
    }
}

impl From<String> for Help {
    fn from(text: String) -> Help {
        Help { text, replacement: None }
    }
}

impl From<&str> for Help {
    fn from(text: &str) -> Help {
        text.to_owned().into()
    }
}

/// One problem: what is wrong, where, and what to change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Whether there is a model all the same.
    pub severity: Severity,
    /// Lower case, no full stop, the offending name first.
    pub message: String,
    /// The offending tokens; absent for a model built without text.
    pub span: Option<Span>,
    /// Short remark under the offending tokens, often empty.
    pub label: String,
    /// Further places with a remark each.
    pub labels: Vec<(Span, String)>,
    /// What to change.
    pub help: Option<String>,
    /// What the help proposes to write, for editors.
    pub replacement: Option<Replacement>,
}

impl Diagnostic {
    /// An error without hint and further places.
    pub fn new(span: Option<Span>, message: impl Into<String>) -> Diagnostic {
        let (label, labels) = (String::new(), Vec::new());
        let (help, replacement) = (None, None);
        Diagnostic {
            severity: Severity::Error,
            message: message.into(),
            span,
            label,
            labels,
            help,
            replacement,
        }
    }

    /// A warning without hint and further places.
    pub fn warning(span: Option<Span>, message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::new(span, message) }
    }

    /// Adds the remark under the offending tokens.
    #[must_use]
    pub fn with_label(mut self, label: impl Into<String>) -> Diagnostic {
        self.label = label.into();
        self
    }

    /// Adds a further place.
    #[must_use]
    pub fn with_place(mut self, span: Option<Span>, text: impl Into<String>) -> Diagnostic {
        if let Some(span) = span {
            self.labels.push((span, text.into()));
        }
        self
    }

    /// Sets the hint; an empty hint is none.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<Help>) -> Diagnostic {
        let Help { text, replacement } = help.into();
        self.help = (!text.is_empty()).then_some(text);
        self.replacement = replacement;
        self
    }
}

/// All problems of one model, in the order of the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostics {
    origin: Option<Origin>,
    list: Vec<Diagnostic>,
}

impl Diagnostics {
    /// Collects problems of one text (or of a model without text); equal ones are kept once.
    pub fn new(origin: Option<Origin>, mut list: Vec<Diagnostic>) -> Diagnostics {
        list.sort_by_key(|d| d.span.map_or((usize::MAX, usize::MAX), |s| (s.start, s.end)));
        list.dedup();
        Diagnostics { origin, list }
    }

    /// One problem for each place within some parts of the text, which are read several times.
    pub(super) fn once_for(mut self, parts: &[Span]) -> Diagnostics {
        let is_inside =
            |span: &Span| parts.iter().any(|part| part.start <= span.start && span.end <= part.end);
        self.list.dedup_by(|a, b| a.span == b.span && a.span.as_ref().is_some_and(is_inside));
        self
    }

    /// The problems, in the order of the text.
    pub fn iter(&self) -> std::slice::Iter<'_, Diagnostic> {
        self.list.iter()
    }

    /// Number of problems.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// True when nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The text the spans refer to.
    pub fn origin(&self) -> Option<&Origin> {
        self.origin.as_ref()
    }

    /// All problems as text for a terminal; escape sequences only when `color` is set.
    pub fn render(&self, color: bool) -> String {
        let renderer = if color { Renderer::styled() } else { Renderer::plain() };
        let mut out = String::new();
        for diagnostic in self.list.iter().take(MAX_SHOWN) {
            out.push_str(&self.render_one(diagnostic, &renderer));
            out.push_str("\n\n");
        }
        if self.list.len() > MAX_SHOWN {
            out.push_str(&format!("note: {} more are not shown\n", self.list.len() - MAX_SHOWN));
        }
        while out.ends_with("\n\n") {
            out.pop();
        }
        out
    }

    /// Each problem on a line of its own, `file:line:column: message; what to change`, for those who show lines only.
    pub fn lines(&self) -> impl Iterator<Item = String> + '_ {
        self.list.iter().map(|diagnostic| {
            let place = self.origin.as_ref().zip(diagnostic.span).map(|(origin, span)| {
                let (line, column) = origin.line_column(span.start);
                format!("{}:{line}:{column}: ", printable(&origin.file))
            });
            let help = diagnostic.help.as_ref().map(|help| format!("; {}", printable(help)));
            let message = printable(&diagnostic.message);
            format!("{}{message}{}", place.unwrap_or_default(), help.unwrap_or_default())
        })
    }

    fn render_one(&self, diagnostic: &Diagnostic, renderer: &Renderer) -> String {
        let level = match diagnostic.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let mut group = Group::with_title(level.primary_title(printable(&diagnostic.message)));
        if let (Some(origin), Some(span)) = (&self.origin, diagnostic.span) {
            group = group.element(self.snippet(origin, span, diagnostic));
        }
        if let Some(help) = &diagnostic.help {
            group = group.element(Level::HELP.message(printable(help)));
        }
        renderer.render(&[group])
    }

    /// The lines around every marked place. Only these lines are handed to the renderer, so that a large file stays
    /// cheap; where a line is very long it is replaced by the part around the primary span.
    fn snippet<'a>(
        &self,
        origin: &'a Origin,
        span: Span,
        diagnostic: &'a Diagnostic,
    ) -> Snippet<'a, annotate_snippets::Annotation<'a>> {
        let text = origin.text.as_str();
        let (line, _) = origin.line_column(span.start);
        let primary = clamp(text, span);
        let mut window = lines_around(text, primary.clone());
        if window.len() > MAX_WIDTH && !text[window.clone()].trim_end().contains('\n') {
            // The column would be wrong in a cut line, so it is cut at the end only.
            let end = floor_boundary(
                text,
                (primary.end.min(primary.start + MAX_WIDTH) + MAX_WIDTH).min(window.end),
            );
            window = window.start..end;
        }
        let mut first_line = line;
        let near: Vec<(Range<usize>, &str)> = diagnostic
            .labels
            .iter()
            .map(|(span, label)| (clamp(text, *span), label.as_str()))
            .filter(|(range, _)| lines_around(text, range.clone()).len() < 1 << 14)
            .collect();
        for (range, _) in &near {
            let lines = lines_around(text, range.clone());
            if lines.start < window.start {
                first_line = first_line.min(origin.line_column(lines.start).0);
            }
            window = window.start.min(lines.start)..window.end.max(lines.end);
        }
        let inside = |range: Range<usize>| {
            let start = range.start.clamp(window.start, window.end) - window.start;
            let end = range.end.clamp(window.start, window.end) - window.start;
            start..end
        };
        let mut mark = AnnotationKind::Primary.span(inside(primary));
        if !diagnostic.label.is_empty() {
            mark = mark.label(printable(&diagnostic.label));
        }
        let mut snippet = Snippet::source(&text[window.clone()])
            .path(printable(&origin.file))
            .line_start(first_line)
            .annotation(mark);
        for (range, label) in near {
            snippet = snippet.annotation(AnnotationKind::Context.span(inside(range)).label(printable(label)));
        }
        snippet
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for Diagnostics {}

impl<'a> IntoIterator for &'a Diagnostics {
    type Item = &'a Diagnostic;
    type IntoIter = std::slice::Iter<'a, Diagnostic>;

    fn into_iter(self) -> Self::IntoIter {
        self.list.iter()
    }
}

/// Control characters would let a file write escape sequences to the terminal.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

fn floor_boundary(text: &str, offset: usize) -> usize {
    let mut at = offset.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

fn clamp(text: &str, span: Span) -> Range<usize> {
    let start = floor_boundary(text, span.start);
    start..floor_boundary(text, span.end).max(start)
}

fn lines_around(text: &str, range: Range<usize>) -> Range<usize> {
    let start = text[..range.start].rfind('\n').map_or(0, |at| at + 1);
    let end = text[range.end..].find('\n').map_or(text.len(), |at| range.end + at);
    start..end
}
