//! What all parsers of a file share: sizes, names with an index, indices of loops.
//!
//! Deliberately does not know: tokens, items.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};

use crate::spec::ast::Name;
use crate::spec::diagnostic::{Diagnostic, Span};

/// How loops are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Loops {
    /// Turn by turn, as the model has them.
    WrittenOut,
    /// Once, with names as they stand in the text: for those who look at the text.
    Once,
}

/// Names with an index: `let w[k] = ..;` declares members of the family `w`.
#[derive(Clone, Debug, Default)]
pub(super) struct Family {
    pub(super) members: BTreeSet<i64>,
    /// Whether they are coordinates, whose rates are a family as well.
    pub(super) are_coordinates: bool,
}

/// What all parsers of a file share.
pub(super) struct Shared {
    pub(super) loops: Loops,
    /// Sizes and their values, in the order of the text.
    pub(super) sizes: Vec<(String, i64)>,
    /// What the file declares with an index, found when it was read before.
    known: BTreeMap<String, Family>,
    /// The same, as far as it has been read.
    pub(super) declared: RefCell<BTreeMap<String, Family>>,
    /// Bytes of text that loops have written out.
    pub(super) written: Cell<usize>,
    /// Indices of loops, with where they are known.
    pub(super) indices: RefCell<Vec<(Name, Span)>>,
    /// What is wrong with sizes.
    pub(super) size_problems: RefCell<Vec<Diagnostic>>,
}

impl Shared {
    pub(super) fn new(loops: Loops, sizes: Vec<(String, i64)>) -> Shared {
        Shared {
            loops,
            sizes,
            known: BTreeMap::new(),
            declared: RefCell::default(),
            written: Cell::new(0),
            indices: RefCell::default(),
            size_problems: RefCell::default(),
        }
    }

    /// For reading the file once more, with all names that it declares with an index.
    pub(super) fn again(&self) -> Option<Shared> {
        let known = self.declared.borrow().clone();
        let again = Shared { known, ..Shared::new(self.loops, self.sizes.clone()) };
        (!again.known.is_empty()).then_some(again)
    }

    /// The names of families.
    pub(super) fn families(&self) -> BTreeSet<String> {
        self.declared.borrow().keys().cloned().collect()
    }

    /// The name of a member of a family, or what its members are.
    pub(super) fn member(&self, name: &str, index: i64) -> Option<Result<String, String>> {
        let of_rate = |name: &str| self.known.get(name).filter(|family| family.are_coordinates);
        let (stem, ending, family) = match (self.known.get(name), name.strip_suffix("_dot")) {
            (Some(family), _) => (name, "", family),
            (None, Some(stem)) => (stem, "_dot", of_rate(stem)?),
            (None, None) => return None,
        };
        Some(match family.members.contains(&index) || self.loops == Loops::Once {
            true => Ok(format!("{stem}{index}{ending}")),
            false => Err(shown(&family.members)),
        })
    }
}

/// Whole numbers, for a message: `1 to 4`, `1, 3`.
fn shown(numbers: &BTreeSet<i64>) -> String {
    let (Some(first), Some(last)) = (numbers.first(), numbers.last()) else { return String::new() };
    if numbers.len() > 2 && (last - first).unsigned_abs() + 1 == numbers.len() as u64 {
        return format!("{first} to {last}");
    }
    let listed: Vec<String> = numbers.iter().take(8).map(i64::to_string).collect();
    format!("{}{}", listed.join(", "), if numbers.len() > 8 { ", .." } else { "" })
}
