//! Elements and attributes with their places, and a list of all that nobody read.
//!
//! Deliberately does not know: what an element means.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::Range;

use roxmltree::{Document, Node};

use crate::number::Number;
use crate::problems::Problems;

/// A file under reading.
pub(crate) struct Reader<'a> {
    /// Elements and attributes that somebody read.
    elements: RefCell<BTreeSet<usize>>,
    /// Elements of which nothing more is told.
    skipped: RefCell<BTreeSet<usize>>,
    attributes: RefCell<BTreeSet<(usize, &'a str)>>,
    problems: RefCell<Problems>,
}

/// An element of the file.
pub(crate) type Element<'a> = Node<'a, 'a>;

impl<'a> Reader<'a> {
    pub(crate) fn new() -> Reader<'a> {
        Reader {
            elements: RefCell::default(),
            skipped: RefCell::default(),
            attributes: RefCell::default(),
            problems: RefCell::default(),
        }
    }

    pub(crate) fn error(&self, place: &Range<usize>, message: impl Into<String>, help: &str) {
        self.problems.borrow_mut().error(place, message, help);
    }

    /// Whether no problem has been found so far.
    pub(crate) fn is_fine(&self) -> bool {
        self.problems.borrow().errors.is_empty()
    }

    pub(crate) fn note(&self, place: &Range<usize>, message: impl Into<String>) {
        self.problems.borrow_mut().note(place, message);
    }

    pub(crate) fn note_with_help(&self, place: &Range<usize>, message: impl Into<String>, help: &str) {
        self.problems.borrow_mut().note_with_help(place, message, help);
    }

    /// The elements of a name within another one.
    pub(crate) fn children(&self, of: Element<'a>, name: &str) -> Vec<Element<'a>> {
        let children: Vec<_> = of.children().filter(|node| node.tag_name().name() == name).collect();
        self.elements.borrow_mut().extend(children.iter().map(|node| node.id().get_usize()));
        children
    }

    /// The element of a name, which may stand there once.
    pub(crate) fn child(&self, of: Element<'a>, name: &str) -> Option<Element<'a>> {
        let all = self.children(of, name);
        if let [_, second, ..] = all[..] {
            self.error(&head(second), format!("`{name}` is given twice"), "remove one of them");
        }
        all.first().copied()
    }

    /// All elements within another one, which nobody has read by that.
    pub(crate) fn all(&self, of: Element<'a>) -> Vec<Element<'a>> {
        of.children().filter(Node::is_element).collect()
    }

    /// Says that an element is read.
    pub(crate) fn take(&self, element: Element<'a>) {
        self.elements.borrow_mut().insert(element.id().get_usize());
    }

    /// Says that an element was told as a whole.
    pub(crate) fn skip(&self, element: Element<'a>) {
        self.skipped.borrow_mut().insert(element.id().get_usize());
    }

    pub(crate) fn attribute(&self, of: Element<'a>, name: &str) -> Option<&'a str> {
        let attribute = of.attribute_node(name)?;
        self.attributes.borrow_mut().insert((of.id().get_usize(), attribute.name()));
        Some(attribute.value())
    }

    /// An attribute that has to be there.
    pub(crate) fn required(&self, of: Element<'a>, name: &str) -> Option<&'a str> {
        let value = self.attribute(of, name);
        if value.is_none() {
            let message = format!("`{}` has no `{name}`", of.tag_name().name());
            self.error(&head(of), message, &format!("write `{name}=\"..\"`"));
        }
        value
    }

    /// Numbers separated by blanks. Nothing where the attribute is absent, and after a problem.
    pub(crate) fn numbers<const N: usize>(&self, of: Element<'a>, name: &str) -> Option<[Number; N]> {
        let text = self.attribute(of, name)?;
        let numbers: Option<Vec<Number>> = text.split_whitespace().map(Number::decimal).collect();
        let numbers = numbers.and_then(|numbers| <[Number; N]>::try_from(numbers).ok());
        if numbers.is_none() {
            let count = if N == 1 { "a number".to_owned() } else { format!("{N} numbers") };
            let help = "write decimal numbers, separated by blanks";
            self.error(&place(of, name), format!("`{name}` is \"{text}\", not {count}"), help);
        }
        numbers
    }

    /// As many numbers as are written, one at least and `most` at most.
    pub(crate) fn list(&self, of: Element<'a>, name: &str, most: usize) -> Option<Vec<Number>> {
        let text = self.attribute(of, name)?;
        let numbers: Option<Vec<Number>> = text.split_whitespace().map(Number::decimal).collect();
        let numbers = numbers.filter(|numbers| (1..=most).contains(&numbers.len()));
        if numbers.is_none() {
            let message = format!("`{name}` is \"{text}\", not 1 to {most} numbers");
            self.error(&place(of, name), message, "write decimal numbers, separated by blanks");
        }
        numbers
    }

    pub(crate) fn number(&self, of: Element<'a>, name: &str) -> Option<Number> {
        self.numbers::<1>(of, name).map(|[number]| number)
    }

    /// Notes everything that nobody read, the problems and notes.
    pub(crate) fn finish(self, document: &'a Document<'a>) -> Problems {
        let mut problems = self.problems.into_inner();
        let mut note =
            |what: String, place: Range<usize>| problems.note(&place, format!("{what} is not taken"));
        let (elements, attributes) = (self.elements.into_inner(), self.attributes.into_inner());
        let skipped = self.skipped.into_inner();
        let mut open = vec![document.root_element()];
        while let Some(element) = open.pop() {
            if skipped.contains(&element.id().get_usize()) {
                continue;
            }
            let name = element.tag_name().name();
            for attribute in element.attributes() {
                if !attributes.contains(&(element.id().get_usize(), attribute.name())) {
                    note(format!("`{}` of `{name}`", attribute.name()), attribute.range());
                }
            }
            for child in element.children().filter(Node::is_element) {
                match elements.contains(&child.id().get_usize()) {
                    true => open.push(child),
                    false => note(format!("`{}` of `{name}`", child.tag_name().name()), head(child)),
                }
            }
        }
        problems
    }
}

/// The start tag of an element, without its attributes.
pub(crate) fn head(element: Element<'_>) -> Range<usize> {
    let range = element.range();
    let name = element.tag_name().name();
    range.start..(range.start + 1 + name.len()).min(range.end)
}

/// The value of an attribute, or the element where that is absent.
pub(crate) fn place(element: Element<'_>, name: &str) -> Range<usize> {
    element.attribute_node(name).map_or_else(|| head(element), |attribute| attribute.range_value())
}
