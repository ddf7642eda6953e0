//! The chunks of an ensemble that a process integrates: all, those of its share, or those that no other process has.
//!
//! Does not know: what a chunk is.

use std::collections::VecDeque;
use std::time::Duration;

use crate::output::trajectories::store::{Claim, Hold, Store};
use hamel_run::error::Error;
use hamel_run::request::share::Share;

/// How long a process waits before it looks again for what others have finished or left.
const PAUSE: Duration = Duration::from_millis(100);

/// A chunk to integrate, and the right to do so.
#[derive(Debug)]
pub(super) struct Item {
    pub(super) chunk: usize,
    _hold: Option<Hold>,
}

/// Chunks in their order, then those that others had taken and have left.
#[derive(Debug)]
pub(super) struct Work<'a> {
    n_chunks: usize,
    share: Option<Share>,
    store: Option<&'a Store<'a>>,
    next: usize,
    /// Chunks on which others worked when they were looked at.
    taken: VecDeque<usize>,
}

impl<'a> Work<'a> {
    pub(super) fn new(n_chunks: usize, share: Option<Share>, store: Option<&'a Store<'a>>) -> Work<'a> {
        Work { n_chunks, share, store, next: 0, taken: VecDeque::new() }
    }

    fn is_mine(&self, chunk: usize) -> bool {
        self.share.is_none_or(|share| share.has(chunk))
    }

    /// Takes back chunks of this process that are damaged; how many.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn take_back_damaged(&self) -> Result<usize, Error> {
        self.store.map_or(Ok(0), |store| store.take_back_damaged(|chunk| self.is_mine(chunk)))
    }

    /// Chunks of this process that are finished.
    pub(super) fn finished(&self) -> impl Iterator<Item = usize> {
        let is_finished = |chunk: &usize| self.store.is_some_and(|store| store.is_finished(*chunk));
        (0..self.n_chunks).filter(|chunk| self.is_mine(*chunk)).filter(is_finished)
    }

    /// The next chunk; none when all are finished, which may take others some time.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn next(&mut self) -> Result<Option<Item>, Error> {
        while self.next < self.n_chunks {
            let chunk = self.next;
            self.next += 1;
            if !self.is_mine(chunk) {
                continue;
            }
            let Some(store) = self.store else { return Ok(Some(Item { chunk, _hold: None })) };
            match store.claim(chunk)? {
                Claim::Finished => {}
                Claim::Taken => self.taken.push_back(chunk),
                Claim::Mine(hold) => return Ok(Some(Item { chunk, _hold: Some(hold) })),
            }
        }
        let mut looked_at = 0;
        while let (Some(chunk), Some(store)) = (self.taken.pop_front(), self.store) {
            match store.claim(chunk)? {
                Claim::Finished => looked_at = 0,
                Claim::Mine(hold) => return Ok(Some(Item { chunk, _hold: Some(hold) })),
                Claim::Taken => {
                    self.taken.push_back(chunk);
                    looked_at += 1;
                    if looked_at >= self.taken.len() {
                        std::thread::sleep(PAUSE);
                        looked_at = 0;
                    }
                }
            }
        }
        Ok(None)
    }
}
