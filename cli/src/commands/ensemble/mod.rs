//! `ensemble`: many motions with parameters and initial states that vary, as a table or a store.
//!
//! Does not know: how trajectories are integrated, file formats.

mod arguments;
mod plan;
mod request;
mod work;

use std::fmt::Write as _;
use std::path::Path;
use std::sync::mpsc::sync_channel;
use std::time::Instant;

pub use arguments::Arguments;
pub use plan::Lines;
pub use request::Subject;

use crate::output::trajectories::Target;
use crate::output::trajectories::chunk::{Chunk, Heading, Sink, Tally};
use crate::output::trajectories::gathered::Wanted;
use crate::output::trajectories::store::Store;
use crate::output::trajectories::summary::Summary;
use hamel_run::dynamics::Factory;
use hamel_run::ensemble::{self, Cancel, EnsembleRequest, Progress, pool};
use hamel_run::error::Error;
use hamel_run::forms::Forms;
use hamel_run::integrate::has_state;
use hamel_run::interpreted;
use hamel_run::interrupts;
use hamel_run::members::Beginnings;
use hamel_run::method::MethodName;
use hamel_run::model::{self, units};
use hamel_run::noise::{Noise, method_for};
use hamel_run::ranks::Ranks;
use hamel_run::request::table::Table;
use hamel_run::resources::{self, free_space};
use hamel_run::session::Session;
use hamel_run::simulation::sample_time;
use hamel_run::start::Starts;
use hamel_run::streams::note;
use hamel_run::watched::Watched;
use plan::{Plan, Row};
use work::{Item, Work};

/// Most numbers in memory at once: half a gigabyte.
const MAX_NUMBERS: usize = 50_000_000;
/// Fewest trajectories of a chunk, so that several threads have work.
const MIN_CHUNK: usize = 64;

/// Number of trajectories of a chunk: few numbers, so that memory is small and little is lost with a process, and a
/// multiple of the lanes, so that neighbours in lanes do not depend on it.
pub fn chunk_of(n_numbers: usize) -> usize {
    ((1 << 19) / n_numbers.max(1)).clamp(MIN_CHUNK, 8192) / 8 * 8
}

/// Integrates all, writes files or a store, and returns a summary for people.
///
/// # Errors
/// Everything that can be wrong with names, values and files; not what stops a trajectory, unless it stops all:
/// [`Error::NoneArrived`], after the files have been written.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let file = arguments.scene.find(session)?;
    let mut choice = arguments.scene.choice_of(&file)?;
    let model = file.model()?;
    let lines = match &arguments.table {
        Some(path) => Lines::of(Table::read(path)?.full(|name| units::of_column(model, name))?),
        None => Lines::none(),
    };
    arguments.noise.chooses(&mut choice, model);
    // Chooses initial states, here and on all threads; it agrees bit for bit with the compiled scene.
    let mut built = interpreted::build(model, &choice.scene)?;
    let of_inputs = Plan::varied(arguments, &lines).any(|name| model.inputs.iter().any(|i| i.name == *name));
    if of_inputs && choice.scene == model::DEFAULT_SCENE && built.info().inputs.is_empty() {
        choice.scene = model::CONTROLLED_SCENE.to_owned();
        built = interpreted::build(model, &choice.scene)?;
    }
    if of_inputs && choice.table.is_some() {
        let reason = "is a table, but inputs vary as well: drive the others by expressions, NAME=EXPRESSION";
        return Err(Error::unusable("--input", reason));
    }
    let scene = choice.open(&file)?;
    let text = file.text()?;
    // An interrupt ends the program.
    let cancel = Cancel::default();
    let subject = Subject {
        model,
        text: &text,
        built: &built,
        inputs: request::inputs(&arguments.scene.inputs)?,
        cancel,
    };
    of_scene(&subject, &scene, lines, arguments, tell_interrupts)
}

/// Integrates all trajectories of a scene, as [`run`]; the names of model, scene and table in
/// the arguments do not count. `on_store` is told the folder of the store, if there is one, before the first chunk.
///
/// # Errors
/// As [`run`].
pub fn of_scene(
    subject: &Subject<'_>,
    scene: &dyn Factory,
    lines: Lines,
    arguments: &Arguments,
    on_store: impl FnOnce(Option<&Path>),
) -> Result<String, Error> {
    let clock = Instant::now();
    let motion = &arguments.motion;
    let targets = targets(arguments)?;
    let steps = motion.steps()?;
    let Subject { model, built, .. } = *subject;
    has_state(built.info())?;
    let forms = Forms::of(model, built.info())?;
    let watched = built.watched().filter(Watched::acts);
    let plan = Plan::new(built.info(), &forms, arguments, lines)?;
    let info = scene.info().clone();
    let n_numbers = arguments.samples.saturating_mul(info.state.len() + 2);
    if n_numbers.saturating_mul(MIN_CHUNK) > MAX_NUMBERS {
        let reason = format!(
            "is {}, which makes more than {MAX_NUMBERS} numbers of the {MIN_CHUNK} trajectories that are in memory at \
             once: take fewer",
            arguments.samples
        );
        return Err(Error::unusable("--samples", reason));
    }
    let noise = arguments.noise.path(&info)?;
    if arguments.count.is_some() && arguments.spread.is_empty() && info.noises.is_empty() {
        let reason = "is given, but nothing is drawn: give --spread, or choose a scene with noise";
        return Err(Error::unusable("--count", reason));
    }
    // Without tolerances there is nothing to choose by.
    let fastest = (info.noises.is_empty() && motion.step.is_none()).then_some(MethodName::Auto);
    let starts = Starts::new(model, &info, forms)?;
    let pool = pool(arguments.threads)?;
    let mut asked = EnsembleRequest {
        members: Beginnings::none(0, 0),
        t_final: arguments.end.t_final,
        method: method_for(&info, motion.method.or(fastest)),
        steps,
        samples: arguments.samples,
        width: arguments.lanes,
        max_steps: motion.max_steps,
        threads: arguments.threads,
        watched,
        noise,
        progress: Progress { all: plan.len(), ..Progress::default() },
        cancel: subject.cancel.clone(),
    };
    // What no trajectory can have, such as a method that does not suit the scene, is told before any file is begun.
    let first = pool.install(|| plan.members(0..1, &starts, (built, scene)));
    if let Some((params, y)) = first.members.iter().next()
        && let Some(told) = plan.told(&starts, (params, y))?
    {
        eprintln!("note: trajectories start at values that nobody gives, of the first {told}");
    }
    asked.options()?;
    ensemble::integrate(scene, &EnsembleRequest { members: first.members, t_final: 0.0, ..asked.clone() })?;
    let heading = Heading {
        info: &info,
        input_names: plan.names(),
        times: (0..arguments.samples)
            .map(|k| sample_time(arguments.end.t_final, arguments.samples, k))
            .collect(),
        n: plan.len(),
        n_chunk: chunk_of(n_numbers).min(plan.len()),
    };
    let wanted = (!arguments.statistics.is_empty()).then(|| Wanted {
        statistics: arguments.statistics.clone(),
        levels: arguments.quantiles.clone(),
        bins: usize::from(arguments.bins),
    });
    targets.iter().try_for_each(|target| has_room(target, &heading, wanted.as_ref()))?;
    let resume = arguments.resume || arguments.part.is_some();
    let ranks = Ranks::join(resume)?;
    let store = match targets.iter().find(|target| target.is_store()) {
        Some(target) => {
            let request = request::document(subject, &info, &asked, &plan, arguments, heading.n_chunk);
            let open = |resume| {
                let of_state = request::of_state(model, &info);
                Store::open(target.path(), &heading, wanted.as_ref(), &request, of_state, resume)
            };
            // The first makes the store, the others go on with it.
            let first = ranks.is_first().then(|| open(resume));
            let is_open = ranks.agree(first.as_ref().is_none_or(Result::is_ok));
            match first {
                Some(store) => Some(store?),
                None if is_open => Some(open(true)?),
                None => return Err(Error::Options { reason: "the first process has no store".into() }),
            }
        }
        None if ranks.size > 1 => {
            let reason = format!("{} processes share a store only: let the name end in .zarr", ranks.size);
            return Err(Error::unusable(shown(&targets[0]), reason));
        }
        None => None,
    };
    on_store(store.as_ref().map(Store::folder));
    let mut sinks: Vec<Box<dyn Sink + '_>> = Vec::new();
    match wanted {
        None => {
            for target in &targets {
                sinks.extend(target.sink(&heading)?);
            }
        }
        Some(wanted) if store.is_none() => {
            let (title, blocks) = (model::title(model), model::blocks::blocks(model));
            sinks.push(Box::new(Summary::new(&targets, &heading, wanted, title, blocks)?));
        }
        // The store gathers them, as other processes do.
        Some(_) => {}
    }
    let mut work = Work::new(heading.n_chunks(), arguments.part, store.as_ref());
    let n_damaged = pool.install(|| work.take_back_damaged())?;
    if n_damaged > 0 {
        note(format_args!("warning: {n_damaged} finished chunks were damaged and are made anew"));
    }
    let found: usize = work.finished().map(|chunk| heading.range(chunk).len()).sum();
    asked.progress = Progress { done: found, found, ..asked.progress };

    let (sinks, tally) = std::thread::scope(|scope| {
        // A chunk is integrated while the one before it is written; neither goes ahead of the other.
        let (to_writer, chunks) = sync_channel::<(Chunk, Item)>(0);
        let store = store.as_ref();
        let writer = scope.spawn(move || -> Result<(Vec<Box<dyn Sink + '_>>, Tally), Error> {
            let mut tally = Tally::default();
            for (chunk, item) in chunks {
                sinks.iter_mut().try_for_each(|sink| sink.add(&chunk))?;
                store.map_or(Ok(()), |store| store.add(&chunk))?;
                tally.add(&chunk);
                // Other processes see the chunk finished from now on.
                drop(item);
            }
            Ok((sinks, tally))
        });
        let integrated = (|| -> Result<(), Error> {
            while let Some(item) = work.next()? {
                let range = heading.range(item.chunk);
                let (first, n) = (range.start, range.len());
                let Row { inputs, members } = pool.install(|| plan.members(range, &starts, (built, scene)));
                asked.progress.seconds = clock.elapsed().as_secs_f64();
                asked.members = members;
                if !info.noises.is_empty() {
                    asked.noise = Noise { path: noise.path.saturating_add(path_of(first)?), ..noise };
                }
                let results = ensemble::integrate(scene, &asked)?;
                asked.progress.done += n;
                let chunk = Chunk { at: item.chunk, first, inputs, results };
                if to_writer.send((chunk, item)).is_err() {
                    // The writer has failed, and says why.
                    break;
                }
            }
            Ok(())
        })();
        drop(to_writer);
        // A panic of the writer is one of the program.
        let written = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        integrated.and(written)
    })?;
    // Only now, as files that lack trajectories are no files.
    sinks.into_iter().try_for_each(Sink::finish)?;
    let seconds = clock.elapsed().as_secs_f64();
    let (tally, left) = match &store {
        Some(store) => {
            let left = (0..heading.n_chunks()).filter(|chunk| !store.is_finished(*chunk)).count();
            if left == 0 {
                store.tell()?;
                store.clean();
            }
            (store.tally()?, left)
        }
        None => (tally, 0),
    };
    if let (true, 0, Some((_, reason))) = (tally.n_stopped == tally.n, left, &tally.first_stopped) {
        let files = targets.iter().map(|target| target.path().to_owned()).collect();
        return Err(Error::NoneArrived { n: tally.n, reason: reason.clone(), files });
    }
    let made = asked.progress.done - found;
    if !ranks.is_first() {
        return Ok(format!("rank {} of {}: {made} trajectories, {seconds:.1} s", ranks.rank, ranks.size));
    }
    Ok(summary(&heading, &tally, made, &targets, seconds))
}

/// The number of a trajectory as that of a path.
///
/// # Errors
/// [`Error::Options`] where there are no more paths.
pub fn path_of(trajectory: usize) -> Result<u32, Error> {
    let none = |_| Error::Options { reason: format!("noise has at most {} paths", u32::MAX) };
    trajectory.try_into().map_err(none)
}

/// The files to write, of which a store is the only one.
fn targets(arguments: &Arguments) -> Result<Vec<Target>, Error> {
    let targets: Vec<Target> = arguments.output.iter().map(|p| Target::new(p)).collect::<Result<_, _>>()?;
    let is_alone = targets.len() == 1;
    if let (Some(store), false) = (targets.iter().find(|target| target.is_store()), is_alone) {
        let reason =
            "is a store, which is written alone, as several processes may make it: give it as the only file";
        return Err(Error::unusable(shown(store), reason));
    }
    let statistics = !arguments.statistics.is_empty();
    if let (Some(figure), true) =
        (targets.iter().find(|target| target.is_figure()), !statistics || arguments.samples < 2)
    {
        let reason = "is a figure of statistics over time: give --statistics, and --samples of at least 2";
        return Err(Error::unusable(shown(figure), reason));
    }
    if let (Some(file), true) =
        (targets.iter().find(|target| !target.is_store()), arguments.resume || arguments.part.is_some())
    {
        let option = if arguments.part.is_some() { "--part" } else { "--resume" };
        let reason = format!("needs a store, but {} is none: let the name end in .zarr", shown(file));
        return Err(Error::unusable(option, reason));
    }
    Ok(targets)
}

/// Whether the trajectories that a file or a store lacks can fit onto its disk.
///
/// # Errors
/// [`Error::Request`] where they cannot.
fn has_room(target: &Target, heading: &Heading<'_>, wanted: Option<&Wanted>) -> Result<(), Error> {
    let (Some(free), None) = (free_space(target.path()), wanted) else { return Ok(()) };
    let n_left = heading.n.saturating_sub(target.n_finished(heading)) as u128;
    let bytes = n_left * target.n_bytes(heading);
    if bytes <= u128::from(free) {
        return Ok(());
    }
    let reason = format!(
        "would have at least {} for {n_left} trajectories, and its disk has room for {}: take fewer trajectories or \
         samples, or gather --statistics",
        resources::shown(bytes),
        resources::shown(free.into())
    );
    Err(Error::unusable(shown(target), reason))
}

fn shown(target: &Target) -> String {
    target.path().display().to_string()
}

/// Has an interrupt say how to go on.
fn tell_interrupts(store: Option<&Path>) {
    interrupts::tell_at_end(match store.map(Path::display) {
        Some(store) => {
            format!("finished chunks are in {store}; the same command with --resume goes on with it")
        }
        None => "nothing was written; with -o NAME.zarr the run could go on".to_owned(),
    });
}

/// For people: how many, how many stopped, and why the first did.
fn summary(heading: &Heading<'_>, tally: &Tally, made: usize, targets: &[Target], seconds: f64) -> String {
    let mut text = format!(
        "{}: {} trajectories, {} stopped, {} steps, {seconds:.1} s",
        heading.info.model, tally.n, tally.n_stopped, tally.steps
    );
    if made < tally.n || tally.n < heading.n {
        let _ = write!(text, "\n  {made} of them now, {} of {} are left", heading.n - tally.n, heading.n);
    }
    if let Some((k, reason)) = &tally.first_stopped {
        let _ = write!(text, "\n  the first that stopped is {k}: {}", reason.replace('\n', "\n    "));
    }
    for target in targets {
        let _ = write!(text, "\nwrote {}", target.path().display());
    }
    text
}
