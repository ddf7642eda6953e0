//! Files that include others as one text, with the way back to the places of each.
//!
//! Deliberately does not know: what elements mean, where files are.

use std::io;
use std::ops::Range;

use hamel_lang::spec::{Diagnostic, Diagnostics, Origin, Span};
use roxmltree::{Document, Node};

use crate::xml::head;

/// A part of the whole text that one file has.
#[derive(Debug)]
struct Segment {
    /// Where it is in the whole text.
    whole: Range<usize>,
    /// The place of the file among the files, and where the part begins in that.
    file: usize,
    start: usize,
}

#[derive(Debug)]
struct File {
    name: String,
    text: String,
    /// The element of the first file that brings it.
    included_at: Option<Range<usize>>,
}

/// The whole text, and where its parts are from.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) text: String,
    files: Vec<File>,
    segments: Vec<Segment>,
}

impl Source {
    /// A file without others.
    pub(crate) fn of(name: &str, text: &str) -> Source {
        let file = File { name: name.to_owned(), text: text.to_owned(), included_at: None };
        let segments = vec![Segment { whole: 0..text.len(), file: 0, start: 0 }];
        Source { text: text.to_owned(), files: vec![file], segments }
    }

    /// Problems of the whole text at their places in the first file. Problems of an included file are at the element
    /// that includes it, and say where they are.
    pub(crate) fn diagnostics(&self, list: Vec<Diagnostic>) -> Diagnostics {
        let first = &self.files[0];
        let origin = Origin { file: first.name.clone(), text: first.text.clone() };
        let told = list.into_iter().map(|mut problem| {
            let Some(span) = problem.span else { return problem };
            let found = self.segments.iter().rfind(|segment| segment.whole.start <= span.start);
            let Some(segment) = found else { return problem };
            let file = &self.files[segment.file];
            let move_by = |at: usize| (at - segment.whole.start + segment.start).min(file.text.len());
            match &file.included_at {
                None => {
                    problem.span = Some(Span::new(move_by(span.start), move_by(span.end.max(span.start))))
                }
                Some(element) => {
                    let line = file.text[..move_by(span.start)].matches('\n').count() + 1;
                    problem.message = format!("{}:{line}: {}", file.name, problem.message);
                    problem.span = Some(Span::new(element.start, element.end));
                }
            }
            problem
        });
        Diagnostics::new(Some(origin), told.collect())
    }
}

/// Puts the contents of included files in the place of the elements `include`.
///
/// # Errors
/// A file that cannot be read, is no XML, or is included twice.
pub(crate) fn splice(
    name: &str,
    text: &str,
    files: &dyn Fn(&str) -> io::Result<String>,
) -> Result<Source, Diagnostics> {
    let mut source = Source { text: String::new(), files: Vec::new(), segments: Vec::new() };
    source.files.push(File { name: name.to_owned(), text: text.to_owned(), included_at: None });
    match add(&mut source, 0, 0..text.len(), files) {
        Ok(()) => Ok(source),
        Err(problem) => {
            let origin = Origin { file: name.to_owned(), text: text.to_owned() };
            Err(Diagnostics::new(Some(origin), vec![*problem]))
        }
    }
}

/// Adds a part of a file with everything that it includes.
fn add(
    source: &mut Source,
    file: usize,
    part: Range<usize>,
    files: &dyn Fn(&str) -> io::Result<String>,
) -> Result<(), Box<Diagnostic>> {
    let text = source.files[file].text.clone();
    let at = |place: &Range<usize>, source: &Source| {
        source.files[file].included_at.clone().unwrap_or_else(|| place.clone())
    };
    let refuse = |place: Range<usize>, message: String, help: &str| {
        Box::new(Diagnostic::new(Some(Span::new(place.start, place.end)), message).with_help(help))
    };
    let document = Document::parse(&text).map_err(|e| {
        let message = format!("`{}` is no XML: {e}", source.files[file].name);
        refuse(at(&(0..0), source), message, "correct it, or export it anew")
    })?;
    let mut next = part.start;
    let includes = document.descendants().filter(|node| node.tag_name().name() == "include");
    for element in includes.filter(Node::is_element) {
        let place = at(&head(element), source);
        let Some(name) = element.attribute("file") else {
            return Err(refuse(place, "`include` has no `file`".to_owned(), "write `file=\"..\"`"));
        };
        if source.files.iter().skip(1).any(|other| other.name == name) {
            let message = format!("`{name}` is included twice");
            let help = "include each file once, and none from itself";
            return Err(refuse(place, message, help));
        }
        let included = files(name).map_err(|e| {
            let message = format!("`{name}`, which is included, cannot be read: {e}");
            refuse(place.clone(), message, "names of included files are relative to the first file")
        })?;
        push(source, file, next..element.range().start, &text);
        next = element.range().end;
        let parsed = Document::parse(&included).map_err(|e| {
            let message = format!("`{name}` is no XML: {e}");
            refuse(place.clone(), message, "correct it, or export it anew")
        })?;
        let root = parsed.root_element();
        let inner = root.first_child().map_or(0, |node| node.range().start)
            ..root.last_child().map_or(0, |node| node.range().end);
        source.files.push(File { name: name.to_owned(), text: included.clone(), included_at: Some(place) });
        add(source, source.files.len() - 1, inner, files)?;
    }
    push(source, file, next..part.end, &text);
    Ok(())
}

fn push(source: &mut Source, file: usize, part: Range<usize>, text: &str) {
    if part.start < part.end {
        let start = source.text.len();
        source.text.push_str(&text[part.clone()]);
        source.segments.push(Segment { whole: start..source.text.len(), file, start: part.start });
    }
}
