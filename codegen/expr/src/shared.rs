//! A list that grows at its end, and whose copies share what they have in common.
//!
//! A graph is copied for every trial, and most of its copies add little. Deliberately does not know: expressions.

use std::sync::Arc;

/// Items in one piece: a copy holds at most so many of its own that were there before.
const PIECE: usize = 256;

/// Full pieces are never changed again.
#[derive(Clone, Debug)]
pub(super) struct SharedVec<T> {
    full: Vec<Arc<[T]>>,
    last: Vec<T>,
}

impl<T> SharedVec<T> {
    pub(super) fn new() -> SharedVec<T> {
        SharedVec { full: Vec::new(), last: Vec::new() }
    }

    pub(super) fn len(&self) -> usize {
        PIECE * self.full.len() + self.last.len()
    }

    pub(super) fn push(&mut self, item: T) {
        self.last.push(item);
        if self.last.len() == PIECE {
            self.full.push(std::mem::take(&mut self.last).into());
        }
    }

    /// # Panics
    /// When there is no such item.
    pub(super) fn at(&self, k: usize) -> &T {
        match self.full.get(k / PIECE) {
            Some(piece) => &piece[k % PIECE],
            None => &self.last[k - PIECE * self.full.len()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_share_full_pieces_and_grow_apart() {
        let mut list = SharedVec::new();
        let n = 2 * PIECE + 3;
        (0..n).for_each(|k| list.push(k));
        let mut copy = list.clone();
        assert!(list.full.iter().zip(&copy.full).all(|(a, b)| Arc::ptr_eq(a, b)));
        (0..PIECE).for_each(|k| copy.push(10 * k));
        list.push(7);
        assert_eq!((list.len(), copy.len()), (n + 1, n + PIECE));
        assert!((0..n).all(|k| *list.at(k) == k && *copy.at(k) == k));
        assert_eq!((*list.at(n), *copy.at(n), *copy.at(n + PIECE - 1)), (7, 0, 10 * (PIECE - 1)));
    }
}
