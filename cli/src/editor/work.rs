//! What takes longer than a key stroke: texts are checked, and equations derived, beside the conversation.
//!
//! Of several texts of one file only the newest is worked on. Does not know: which questions there are.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use hamel_mechanics::mechanics::Equations;

use super::document::{Checked, check, derive};

/// What is known of a file's texts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    /// What came of the last text that was checked.
    pub(crate) checked: Option<Checked>,
    /// The last text that was a model, with it.
    pub(crate) last_model: Option<Checked>,
    /// The equations of a text; none where they cannot be derived.
    pub(crate) equations: Option<(Arc<str>, Option<Arc<Equations>>)>,
}

/// A text of a file.
#[derive(Clone, Debug)]
struct Job {
    file: String,
    version: i32,
    text: Arc<str>,
}

/// What is known of every file, by its address.
#[derive(Clone, Debug, Default)]
pub(crate) struct Board(Arc<Mutex<BTreeMap<String, Known>>>);

impl Board {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Known>> {
        // What a thread that failed has written is whole: entries are replaced, not changed.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn of(&self, file: &str) -> Known {
        self.lock().get(file).cloned().unwrap_or_default()
    }

    pub(crate) fn forget(&self, file: &str) {
        self.lock().remove(file);
    }

    fn note(&self, file: &str, change: impl FnOnce(&mut Known)) {
        change(self.lock().entry(file.to_owned()).or_default());
    }
}

/// The threads that work.
#[derive(Debug)]
pub(crate) struct Workers {
    checks: Sender<Job>,
    derivations: Sender<Job>,
}

impl Workers {
    /// Starts them. `on_checked` is called with the file, the version and what was found, `on_derived` with a file
    /// whose equations are on the board now, or will not be.
    pub(crate) fn start(
        board: &Board,
        on_checked: impl Fn(&str, i32, &Checked) + Send + 'static,
        on_derived: impl Fn(&str) + Send + 'static,
    ) -> Workers {
        let (checks, jobs) = channel();
        let of_checks = board.clone();
        thread::spawn(move || {
            each_newest(&jobs, |job| {
                let checked = checked(&of_checks, job);
                on_checked(&job.file, job.version, &checked);
            });
        });
        let (derivations, jobs) = channel();
        let of_derivations = board.clone();
        thread::spawn(move || {
            each_newest(&jobs, |job| {
                let known = of_derivations.of(&job.file).equations;
                if known.is_none_or(|(text, _)| text != job.text) {
                    let model = checked(&of_derivations, job).model;
                    let equations = model.as_deref().and_then(derive).map(Arc::new);
                    let text = Arc::clone(&job.text);
                    of_derivations.note(&job.file, |known| known.equations = Some((text, equations)));
                }
                on_derived(&job.file);
            });
        });
        Workers { checks, derivations }
    }

    /// Has a text checked.
    pub(crate) fn check(&self, file: &str, version: i32, text: &Arc<str>) {
        // Without the thread there is nobody to tell.
        let _ = self.checks.send(Job { file: file.to_owned(), version, text: Arc::clone(text) });
    }

    /// Has the equations of a text derived.
    pub(crate) fn derive(&self, file: &str, version: i32, text: &Arc<str>) {
        let _ = self.derivations.send(Job { file: file.to_owned(), version, text: Arc::clone(text) });
    }
}

/// What comes of a text, which is checked once.
fn checked(board: &Board, job: &Job) -> Checked {
    if let Some(known) = board.of(&job.file).checked.filter(|known| known.text == job.text) {
        return known;
    }
    let checked = check(&job.file, Arc::clone(&job.text));
    board.note(&job.file, |known| {
        known.checked = Some(checked.clone());
        if checked.model.is_some() {
            known.last_model = Some(checked.clone());
        }
    });
    checked
}

/// Does the newest job of each file, until nobody can send any more.
fn each_newest(jobs: &Receiver<Job>, work: impl Fn(&Job)) {
    while let Ok(first) = jobs.recv() {
        let mut newest = vec![first];
        while let Ok(job) = jobs.try_recv() {
            newest.retain(|other| other.file != job.file);
            newest.push(job);
        }
        newest.iter().for_each(&work);
    }
}
