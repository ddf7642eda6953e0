//! Statistics of chunks in a folder that many processes share: the tree along which they are merged, a file each node.
//!
//! A node of level `l` and number `i` is what the chunks from `i 2^l` to `(i + 1) 2^l` have together, as far as there
//! are so many. A process that has gathered a chunk writes its leaf and merges what has both halves; the halves are
//! removed. What nobody has merged, because a process was killed or a half came late, is merged at the end. A node is a
//! function of its place alone, so that no more than work is lost where two processes make the same.
//!
//! Does not know: what statistics are of, arrays and documents of a store.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::chunk::Heading;
use super::gathered::Gathered;
use super::zarr::{opened, sealed};

/// How often a node is looked for while another process merges it, and the time in between.
const LOOKS: u32 = 200;
const PAUSE: Duration = Duration::from_millis(50);

/// The tree of one ensemble.
#[derive(Debug)]
pub(super) struct Tree<'t, 'a> {
    pub(super) folder: &'t Path,
    pub(super) heading: &'t Heading<'a>,
}

impl Tree<'_, '_> {
    fn path(&self, level: u32, at: usize) -> PathBuf {
        self.folder.join(format!("sum-{level}-{at}"))
    }

    /// Whether anything was gathered that is not told yet.
    pub(super) fn has_nodes(&self) -> bool {
        let is_node = |file: std::fs::DirEntry| file.file_name().to_string_lossy().starts_with("sum-");
        std::fs::read_dir(self.folder).is_ok_and(|files| files.flatten().any(is_node))
    }

    /// Whether a node has any chunks.
    fn has_chunks(&self, level: u32, at: usize) -> bool {
        at.checked_shl(level).is_some_and(|first| first < self.heading.n_chunks())
    }

    fn read(&self, level: u32, at: usize) -> io::Result<Gathered> {
        let path = self.path(level, at);
        let wrong = || {
            let reason = format!("{} is damaged: remove the store and make it anew", path.display());
            io::Error::new(io::ErrorKind::InvalidData, reason)
        };
        let file = std::fs::read(&path)?;
        opened(&file).and_then(|bytes| Gathered::from_bytes(self.heading, bytes)).ok_or_else(wrong)
    }

    /// Writes the leaf of a chunk and merges as far up as both halves are there. `put` writes a file whole or not at
    /// all.
    ///
    /// # Errors
    /// Those of the file system.
    pub(super) fn add(
        &self,
        chunk: usize,
        gathered: &Gathered,
        put: &dyn Fn(&Path, &[u8]) -> io::Result<()>,
    ) -> io::Result<()> {
        put(&self.path(0, chunk), &sealed(gathered.to_bytes()))?;
        let (mut level, mut at) = (0, chunk);
        loop {
            let (left, right, parent) = (at & !1, at | 1, self.path(level + 1, at / 2));
            let are_there = [left, right].iter().all(|half| self.path(level, *half).is_file());
            if !are_there || parent.is_file() {
                return Ok(());
            }
            let lock = File::options()
                .create(true)
                .append(true)
                .open(self.path(level + 1, at / 2).with_extension("lock"))?;
            // Another process is at it; on a file system without locks both are.
            if let Err(std::fs::TryLockError::WouldBlock) = lock.try_lock() {
                return Ok(());
            }
            let (first, second) = match (self.read(level, left), self.read(level, right)) {
                (Ok(first), Ok(second)) => (first, second),
                // Merged and removed between the first look and the lock.
                _ if parent.is_file() => return Ok(()),
                (Err(error), _) | (_, Err(error)) => return Err(error),
            };
            let mut both = first;
            both.merge(second);
            put(&parent, &sealed(both.to_bytes()))?;
            for half in [left, right] {
                // One that stays takes room and does no harm.
                let _ = std::fs::remove_file(self.path(level, half));
            }
            (level, at) = (level + 1, at / 2);
        }
    }

    /// What all chunks have together, once all of them have been added.
    ///
    /// # Errors
    /// Those of the file system; a leaf that is not there.
    pub(super) fn all(&self) -> io::Result<Gathered> {
        let levels = usize::BITS - (self.heading.n_chunks().max(1) - 1).leading_zeros();
        let mut missing = io::Error::from(io::ErrorKind::NotFound);
        for _ in 0..LOOKS {
            match self.node(levels, 0) {
                // A process may be between two files.
                Err(error) if error.kind() == io::ErrorKind::NotFound => missing = error,
                done => return done,
            }
            std::thread::sleep(PAUSE);
        }
        Err(missing)
    }

    fn node(&self, level: u32, at: usize) -> io::Result<Gathered> {
        match self.read(level, at) {
            Err(error) if error.kind() == io::ErrorKind::NotFound && level > 0 => {}
            there => return there,
        }
        let mut both = self.node(level - 1, 2 * at)?;
        if self.has_chunks(level - 1, 2 * at + 1) {
            both.merge(self.node(level - 1, 2 * at + 1)?);
        }
        Ok(both)
    }
}
