//! The store of an ensemble that any number of processes write, now or later.
//!
//! A chunk of trajectories is a function of the request and of its number. A process claims a chunk by a lock of the
//! operating system on a file, which ends with the process; files take their places by a change of name, and that of
//! `status` is the last of its chunk. A chunk is finished when this file is there. Who writes a chunk does not matter,
//! and a chunk that two processes write has the same bytes twice: locks save work and nothing else.
//!
//! Every file of a chunk ends with a checksum. A process that goes on with a store looks at the chunks that it would
//! have made, and makes those anew of which a file is missing, has another size or another checksum.
//!
//! A store of statistics keeps no trajectories: what is gathered of each chunk is merged in the working folder, and
//! told once the last chunk is finished.
//!
//! Does not know: how trajectories were computed, how statistics are merged.

use std::fs::{File, TryLockError};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use serde_json::{Map, Value, json};

use super::chunk::{Chunk, Heading, Tally};
use super::gathered::{Gathered, Statistic, Table, Wanted, quantities};
use super::tree::Tree;
use super::zarr::{self, Array, DOCUMENT, Kind};
use hamel_run::error::Error;
use hamel_run::members::Member;
use hamel_run::temporary::Temporary;

/// Folder for locks, for files that have not taken their places, and for what is merged; gone when the store is
/// complete.
const WORK: &str = ".hamel";
/// Within it, the lock of the process that tells statistics.
const TELLING: &str = "telling.lock";

/// Status of a trajectory that reached the end.
const ARRIVED: u8 = 0;
/// Status of one that stopped on the way.
const STOPPED: u8 = 1;
/// Status of one that never started.
const NOT_STARTED: u8 = 2;

/// A store and what belongs into it.
#[derive(Debug)]
pub(crate) struct Store<'a> {
    folder: PathBuf,
    heading: Heading<'a>,
    /// Tells this process from all others that write the store.
    writer: String,
    arrays: Arrays<'a>,
}

/// The arrays that are written with chunks, or after all of them.
#[derive(Debug)]
struct Arrays<'a> {
    kept: Kept<'a>,
    steps: Array<'a>,
    error: Array<'a>,
    status: Array<'a>,
}

/// What is kept of trajectories besides what became of them.
#[derive(Debug)]
enum Kept<'a> {
    /// All, in arrays that have a chunk for each chunk of trajectories.
    Trajectories(Box<Trajectories<'a>>),
    /// Statistics, each table in an array of one chunk.
    Statistics(Wanted, Vec<(Table, Array<'a>)>),
}

#[derive(Debug)]
struct Trajectories<'a> {
    inputs: Option<Array<'a>>,
    y: Array<'a>,
    energy: Option<Array<'a>>,
    stopped_t: Array<'a>,
    stopped_y: Array<'a>,
}

/// What a process may do with a chunk.
#[derive(Debug)]
pub(crate) enum Claim {
    /// It is finished.
    Finished,
    /// Another process works on it.
    Taken,
    /// Nobody else works on it as long as this value lives.
    Mine(Hold),
}

/// A chunk that nobody else works on.
#[derive(Debug)]
pub(crate) struct Hold {
    // The lock ends with the file.
    _lock: Option<File>,
}

/// The folder of a store that has a file for each finished chunk.
pub(super) fn finished_chunks(store: &Path) -> PathBuf {
    store.join("status").join("c")
}

impl<'a> Store<'a> {
    /// Makes a store, or goes on with one whose documents are those of this request when `resume` is set.
    ///
    /// `wanted` are the statistics that are kept in the place of trajectories; `request` is everything that results
    /// depend on; `of_state` has the attributes of the names.
    ///
    /// # Errors
    /// [`Error::Request`] for a folder that is there and must not be, or is the store of another request, with what
    /// differs; [`Error::Io`].
    pub(crate) fn open(
        folder: &Path,
        heading: &Heading<'a>,
        wanted: Option<&Wanted>,
        request: &Value,
        of_state: Map<String, Value>,
        resume: bool,
    ) -> Result<Store<'a>, Error> {
        let arrays = Arrays::of(heading, wanted);
        let documents = arrays.documents(heading, request, of_state);
        let fail = |e| Error::io(folder.display().to_string(), e);
        if !folder.exists() {
            let temporary = Temporary::beside(folder);
            for (path, bytes) in &documents {
                write_new(&temporary.path().join(path), bytes).map_err(fail)?;
            }
            // Another process that has made the store in the meantime is as good, for one that goes on with any.
            if let Err(error) = temporary.rename_to(folder)
                && !(resume && folder.join(DOCUMENT).is_file())
            {
                return Err(fail(error));
            }
        } else if !resume {
            let reason = "is there already: give --resume to go on with it, or another name";
            return Err(Error::unusable(folder.display().to_string(), reason));
        }
        for (path, bytes) in &documents {
            same(folder, path, bytes)?;
        }
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos());
        let writer = format!("{:x}-{now:x}", std::process::id());
        Ok(Store { folder: folder.to_owned(), heading: heading.clone(), writer, arrays })
    }

    /// Where it is.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Takes back finished chunks that are damaged and that `is_mine` names, and told statistics that are damaged: both
    /// are made anew then. Where statistics are lost with what was gathered, all chunks are. Returns how many chunks
    /// were taken back.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn take_back_damaged(&self, is_mine: impl Fn(usize) -> bool + Sync) -> Result<usize, Error> {
        // The tree goes after statistics were told, so that it is looked for first.
        let has_tree = self.tree(&self.folder.join(WORK)).has_nodes();
        let is_lost = !self.take_back_statistics()? && !has_tree;
        let is_damaged = |chunk: usize| is_lost || (is_mine(chunk) && self.is_damaged(chunk));
        let all = (0..self.heading.n_chunks()).into_par_iter();
        let damaged: Vec<usize> =
            all.filter(|chunk| self.is_finished(*chunk) && is_damaged(*chunk)).collect();
        let mut n = 0;
        for chunk in damaged {
            // Another process that has the lock makes the chunk now.
            let Claim::Mine(_hold) = self.lock(chunk)? else { continue };
            if is_damaged(chunk) {
                self.remove(&self.arrays.status, chunk)?;
                n += 1;
            }
        }
        Ok(n)
    }

    /// Removes told statistics that are damaged; whether all are told, or the store keeps none.
    fn take_back_statistics(&self) -> Result<bool, Error> {
        let Kept::Statistics(_, tables) = &self.arrays.kept else { return Ok(true) };
        let mut are_told = true;
        for (_, array) in tables {
            if !self.is_whole(array, 0) {
                are_told = false;
                self.remove(array, 0)?;
            }
        }
        Ok(are_told)
    }

    fn remove(&self, array: &Array<'_>, at: usize) -> Result<(), Error> {
        let path = self.folder.join(array.chunk(at));
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(Error::io(path.display().to_string(), error))
            }
            _ => Ok(()),
        }
    }

    /// The bytes of a chunk of an array.
    ///
    /// # Errors
    /// Those of the file system, [`io::ErrorKind::InvalidData`] for another size or checksum than the chunk has.
    fn read(&self, array: &Array<'_>, at: usize) -> io::Result<Vec<u8>> {
        let file = std::fs::read(self.folder.join(array.chunk(at)))?;
        let is_complete = array.n_bytes().is_none_or(|n| n == file.len());
        match zarr::opened(&file).filter(|_| is_complete) {
            Some(bytes) => Ok(bytes.to_vec()),
            None => Err(io::Error::new(
                io::ErrorKind::InvalidData,
                "the file is damaged: the same command with --resume makes its chunk anew",
            )),
        }
    }

    fn is_whole(&self, array: &Array<'_>, at: usize) -> bool {
        self.read(array, at).is_ok()
    }

    /// Whether a finished chunk lacks a file, or has one that is damaged.
    fn is_damaged(&self, chunk: usize) -> bool {
        let Arrays { kept, steps, error, status } = &self.arrays;
        let Ok(codes) = self.read(status, chunk) else { return true };
        let n = self.heading.range(chunk).len();
        // What follows is absent where no trajectory of the chunk has stopped.
        let has_stopped = codes.iter().take(n).any(|code| *code != ARRIVED);
        let mut arrays = vec![steps];
        arrays.extend(has_stopped.then_some(error));
        if let Kept::Trajectories(kept) = kept {
            let Trajectories { inputs, y, energy, stopped_t, stopped_y } = &**kept;
            arrays.extend(inputs.iter().chain(energy).chain([y]));
            arrays.extend(has_stopped.then_some([stopped_t, stopped_y]).into_iter().flatten());
        }
        !arrays.iter().all(|array| self.is_whole(array, chunk))
    }

    /// Whether a chunk is finished.
    pub(crate) fn is_finished(&self, chunk: usize) -> bool {
        self.folder.join(self.arrays.status.chunk(chunk)).is_file()
    }

    /// Claims a chunk. On a file system without locks every claim is granted.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn claim(&self, chunk: usize) -> Result<Claim, Error> {
        if self.is_finished(chunk) {
            return Ok(Claim::Finished);
        }
        let claim = self.lock(chunk)?;
        // Finished between the first look and the lock.
        Ok(if self.is_finished(chunk) { Claim::Finished } else { claim })
    }

    /// The lock of a chunk, finished or not.
    fn lock(&self, chunk: usize) -> Result<Claim, Error> {
        let path = self.folder.join(WORK).join(format!("{chunk}.lock"));
        let opened = create_folder_of(&path)
            .and_then(|()| File::options().create(true).append(true).open(&path))
            .map(|file| (file.try_lock(), file));
        match opened {
            Ok((Ok(()), file)) => Ok(Claim::Mine(Hold { _lock: Some(file) })),
            Ok((Err(TryLockError::WouldBlock), _)) => Ok(Claim::Taken),
            Ok((Err(TryLockError::Error(_)), _)) => Ok(Claim::Mine(Hold { _lock: None })),
            // The process that has finished the store has removed the folder.
            Err(_) if self.is_finished(chunk) => Ok(Claim::Finished),
            Err(error) => Err(Error::io(path.display().to_string(), error)),
        }
    }

    /// Writes a chunk.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn add(&self, chunk: &Chunk) -> Result<(), Error> {
        let Arrays { kept, steps, error, status } = &self.arrays;
        let results = &chunk.results;
        let put = |array: &Array<'_>, bytes: Vec<u8>| self.put_chunk(array, chunk.at, bytes);
        match kept {
            Kept::Trajectories(arrays) => self.add_trajectories(arrays, chunk)?,
            Kept::Statistics(..) => {
                let fail = |e| Error::io(self.folder.join(WORK).display().to_string(), e);
                let gathered = Gathered::of(chunk, &self.heading);
                let put = |path: &Path, bytes: &[u8]| {
                    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or("node");
                    self.put(path, name, bytes)
                };
                self.tree(&self.folder.join(WORK)).add(chunk.at, &gathered, &put).map_err(fail)?;
            }
        }
        put(steps, zarr::counts(results.steps(), steps.n_chunk()))?;
        // Chunks of nothing but what stands for absent values are absent themselves.
        if !results.have_arrived() {
            let reasons = results.iter().map(|r| r.error().unwrap_or_default());
            put(error, zarr::texts(reasons, error.n_chunk()))?;
        }
        let codes: Vec<u8> = results
            .iter()
            .map(|r| match (r.error(), r.last()) {
                (None, _) => ARRIVED,
                (Some(_), Some(_)) => STOPPED,
                (Some(_), None) => NOT_STARTED,
            })
            .collect();
        put(status, zarr::codes(&codes, status.n_chunk()))
    }

    /// Writes the trajectories of a chunk.
    fn add_trajectories(&self, arrays: &Trajectories<'_>, chunk: &Chunk) -> Result<(), Error> {
        let Trajectories { inputs, y, energy, stopped_t, stopped_y } = arrays;
        let (heading, results) = (&self.heading, &chunk.results);
        let n_state = heading.info.state.len();
        let floats = |array: &Array<'_>, values: &[f64]| {
            self.put_chunk(array, chunk.at, zarr::floats(values, array.n_chunk()))
        };
        if let Some(inputs) = inputs {
            floats(inputs, &chunk.inputs)?;
        }
        floats(y, &results.states())?;
        if let Some(energy) = energy {
            floats(energy, &results.energies())?;
        }
        if !results.have_arrived() {
            let last = |r: Member<'_>| match (r.error(), r.last()) {
                (Some(_), Some(last)) => (last.t, last.state.to_vec()),
                _ => (f64::NAN, vec![f64::NAN; n_state]),
            };
            let (times, states): (Vec<f64>, Vec<Vec<f64>>) = results.iter().map(last).unzip();
            floats(stopped_t, &times)?;
            floats(stopped_y, &states.concat())?;
        }
        Ok(())
    }

    /// Tells statistics, once all chunks are finished; nothing for a store of trajectories.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn tell(&self) -> Result<(), Error> {
        let Kept::Statistics(wanted, tables) = &self.arrays.kept else { return Ok(()) };
        let is_told = || tables.iter().all(|(_, array)| self.folder.join(array.chunk(0)).is_file());
        if is_told() {
            return Ok(());
        }
        let work = self.folder.join(WORK);
        let path = work.join(TELLING);
        let lock =
            create_folder_of(&path).and_then(|()| File::options().create(true).append(true).open(&path));
        let told = lock.and_then(|lock| {
            // One after the other, as the first one ends with the removal of what the others would read.
            let _ = lock.lock();
            if is_told() { Ok(None) } else { self.tree(&work).all().map(Some) }
        });
        let gathered = match told {
            Ok(Some(gathered)) => gathered,
            Ok(None) => return Ok(()),
            Err(_) if is_told() => return Ok(()),
            Err(error) => return Err(Error::io(work.display().to_string(), error)),
        };
        tables.iter().try_for_each(|(table, array)| {
            let values = gathered.table(*table, wanted);
            let bytes = match array.kind {
                // A number of trajectories is a whole number.
                Kind::Count => {
                    zarr::counts(&values.iter().map(|x| *x as u64).collect::<Vec<u64>>(), array.n_chunk())
                }
                Kind::Float | Kind::Code | Kind::Text => zarr::floats(&values, array.n_chunk()),
            };
            self.put_chunk(array, 0, bytes)
        })
    }

    fn tree<'t>(&'t self, folder: &'t Path) -> Tree<'t, 'a> {
        Tree { folder, heading: &self.heading }
    }

    /// Writes a chunk of an array, which may be there already.
    fn put_chunk(&self, array: &Array<'_>, at: usize, bytes: Vec<u8>) -> Result<(), Error> {
        let path = self.folder.join(array.chunk(at));
        let put = self.put(&path, &format!("{}-{at}", array.name), &zarr::sealed(bytes));
        put.or_else(|e| if path.is_file() { Ok(()) } else { Err(Error::io(path.display().to_string(), e)) })
    }

    /// Counts all trajectories that are there, whoever integrated them.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn tally(&self) -> Result<Tally, Error> {
        let mut tally = Tally::default();
        for at in (0..self.heading.n_chunks()).filter(|at| self.is_finished(*at)) {
            let range = self.heading.range(at);
            let read = |array: &Array<'_>| {
                let path = self.folder.join(array.chunk(at));
                self.read(array, at).map_err(|e| Error::io(path.display().to_string(), e))
            };
            let (status, steps) = (read(&self.arrays.status)?, read(&self.arrays.steps)?);
            let steps = steps.as_chunks::<8>().0.iter().map(|bytes| u64::from_le_bytes(*bytes));
            tally.n += range.len();
            tally.steps += steps.take(range.len()).sum::<u64>();
            let stopped = |(_, code): &(usize, &u8)| **code != ARRIVED;
            let mut stopped = status.iter().enumerate().take(range.len()).filter(stopped);
            let first = stopped.next();
            tally.n_stopped += usize::from(first.is_some()) + stopped.count();
            if let (Some((k, _)), None) = (first, &tally.first_stopped) {
                let reason = zarr::text_at(&read(&self.arrays.error)?, k).unwrap_or_default();
                tally.first_stopped = Some((range.start + k, reason));
            }
        }
        Ok(tally)
    }

    /// Removes what was needed to make a store that is complete.
    pub(crate) fn clean(&self) {
        let _ = std::fs::remove_dir_all(self.folder.join(WORK));
    }

    /// Writes a file such that it is there whole or not at all, also when the machine stops.
    fn put(&self, path: &Path, name: &str, bytes: &[u8]) -> io::Result<()> {
        let temporary = Temporary::at(self.folder.join(WORK).join(format!("{}-{name}", self.writer)));
        create_folder_of(temporary.path())?;
        create_folder_of(path)?;
        let mut file = File::create(temporary.path())?;
        file.write_all(bytes)?;
        file.sync_data()?;
        drop(file);
        temporary.rename_to(path)
    }
}

impl<'a> Arrays<'a> {
    fn of(heading: &Heading<'a>, wanted: Option<&Wanted>) -> Arrays<'a> {
        let (n_state, n_inputs, n_samples) =
            (heading.info.state.len(), heading.input_names.len(), heading.times.len());
        let trajectory = ("trajectory", heading.n, heading.n_chunk);
        let (t, state) = (("t", n_samples, n_samples), ("state", n_state, n_state));
        let array = |name, kind, axes: &[(&'a str, usize, usize)], doc: &str| Array {
            name,
            kind,
            axes: axes.to_vec(),
            attributes: attributes([("description", json!(doc))]),
        };
        use Kind::{Code, Count, Float, Text};
        let trajectories = || Trajectories {
            inputs: (n_inputs > 0).then(|| {
                let axes = [trajectory, ("input", n_inputs, n_inputs)];
                array("inputs", Float, &axes, "what varies: parameters and components of the initial state")
            }),
            y: array("y", Float, &[trajectory, t, state], "states; NaN where a trajectory has not come"),
            energy: heading.info.has_energy.then(|| array("energy", Float, &[trajectory, t], "energy")),
            stopped_t: array("stopped_t", Float, &[trajectory], "time of a stop; NaN where there was none"),
            stopped_y: array(
                "stopped_y",
                Float,
                &[trajectory, state],
                "state at a stop; NaN where there was none",
            ),
        };
        let quantity = ("quantity", quantities(heading).len(), quantities(heading).len());
        let told = |wanted: &Wanted, table: Table| {
            let last = table.axis(wanted).map(|(name, n)| (name, n, n));
            let axes: Vec<(&'a str, usize, usize)> = [t, quantity].into_iter().chain(last).collect();
            let kind = if table == Table::Number { Count } else { Float };
            (table, array(table.name(), kind, &axes, table.doc()))
        };
        Arrays {
            kept: match wanted {
                None => Kept::Trajectories(Box::new(trajectories())),
                Some(wanted) => {
                    let tables = wanted.tables().into_iter().map(|table| told(wanted, table)).collect();
                    Kept::Statistics(wanted.clone(), tables)
                }
            },
            steps: array(
                "steps",
                Count,
                &[trajectory],
                "accepted steps, with those of the trajectories beside it",
            ),
            error: array("error", Text, &[trajectory], "why a trajectory stopped; empty where it did not"),
            status: array(
                "status",
                Code,
                &[trajectory],
                "0 arrived, 1 stopped on the way, 2 never started, 255 not integrated yet",
            ),
        }
    }

    /// Every file that is there before the first chunk.
    fn documents(
        &self,
        heading: &Heading<'_>,
        request: &Value,
        of_state: Map<String, Value>,
    ) -> Vec<(String, Vec<u8>)> {
        let Arrays { kept, steps, error, status } = self;
        let (mut documents, mut of_arrays) = (Vec::new(), Map::new());
        let mut add = |array: &Array<'_>, bytes: Option<Vec<u8>>| {
            let document = array.document();
            documents.push((format!("{}/{DOCUMENT}", array.name), zarr::text(&document)));
            documents.extend(bytes.map(|bytes| (array.chunk(0), zarr::sealed(bytes))));
            of_arrays.insert(array.name.to_owned(), document);
        };
        let n = heading.times.len();
        let of_time = attributes([("units", json!("s")), ("description", json!("time"))]);
        let t = Array { name: "t", kind: Kind::Float, axes: vec![("t", n, n)], attributes: of_time };
        add(&t, Some(zarr::floats(&heading.times, n)));
        let mut names = |name: &'static str, names: &[String], attributes| {
            let n = names.len();
            let array = Array { name, kind: Kind::Text, axes: vec![(name, n, n)], attributes };
            add(&array, Some(zarr::texts(names.iter().map(String::as_str), n)));
        };
        match kept {
            Kept::Trajectories(arrays) => {
                let Trajectories { inputs, y, energy, stopped_t, stopped_y } = &**arrays;
                names("state", &heading.info.state, of_state);
                if inputs.is_some() {
                    names("input", &heading.input_names, Map::new());
                }
                let optional = inputs.iter().chain(energy);
                let arrays = optional.chain([y, steps, stopped_t, stopped_y, error, status]);
                arrays.for_each(|array| add(array, None));
            }
            Kept::Statistics(wanted, tables) => {
                names("quantity", &quantities(heading), of_quantities(of_state, heading));
                if wanted.has(Statistic::Quantiles) {
                    let n = wanted.levels.len();
                    let doc = attributes([("description", json!("levels of the quantiles"))]);
                    let level = Array {
                        name: "level",
                        kind: Kind::Float,
                        axes: vec![("level", n, n)],
                        attributes: doc,
                    };
                    add(&level, Some(zarr::floats(&wanted.levels, n)));
                }
                tables.iter().for_each(|(_, array)| add(array, None));
                [steps, error, status].into_iter().for_each(|array| add(array, None));
            }
        }
        let group = zarr::group(&attributes([("hamel", request.clone())]), &of_arrays);
        // First, so that what differs between two requests is told by the document that says it best.
        documents.insert(0, (DOCUMENT.to_owned(), zarr::text(&group)));
        documents
    }
}

/// Attributes of the names of a state, for those of the quantities: the energy has no unit and meaning of the model.
fn of_quantities(mut of_state: Map<String, Value>, heading: &Heading<'_>) -> Map<String, Value> {
    let mut append = |key: &str, value: &str| {
        if let Some(Value::Array(values)) = of_state.get_mut(key) {
            values.push(value.into());
        }
    };
    if heading.info.has_energy {
        append("units", "");
        append("descriptions", "energy");
    }
    of_state
}

fn attributes<const N: usize>(entries: [(&str, Value); N]) -> Map<String, Value> {
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

fn create_folder_of(path: &Path) -> io::Result<()> {
    path.parent().map_or(Ok(()), std::fs::create_dir_all)
}

fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    create_folder_of(path)?;
    std::fs::write(path, bytes)
}

/// Whether a file of the store is what this request would write.
fn same(folder: &Path, path: &str, bytes: &[u8]) -> Result<(), Error> {
    let shown = folder.display().to_string();
    let there = match std::fs::read(folder.join(path)) {
        Ok(there) => there,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let reason = format!("is no store of this ensemble, as it has no {path}: give another name");
            return Err(Error::unusable(shown, reason));
        }
        Err(error) => return Err(Error::io(folder.join(path).display().to_string(), error)),
    };
    if there == bytes {
        return Ok(());
    }
    let parsed = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).unwrap_or_default();
    let told: Vec<String> = zarr::differences(&parsed(&there), &parsed(bytes))
        .into_iter()
        .map(|(key, there, asked)| {
            let key = key.strip_prefix("attributes.hamel.").unwrap_or(&key);
            format!("{key} is {there} there and {asked} here")
        })
        .collect();
    let told = if told.is_empty() { format!("{path} differs") } else { told.join("; ") };
    Err(Error::unusable(
        shown,
        format!("is the store of another ensemble: {told}; repeat its command, or give another name"),
    ))
}
