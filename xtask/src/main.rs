//! Parses the arguments of `cargo xtask` and runs the command.

use std::io::{IsTerminal as _, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, CommandFactory as _, Parser, Subcommand};
use clap_complete::Shell;
use xtask::bench::{self, TargetCpu};
use xtask::codegen_bridge;
use xtask::commands::{self, Aspect, Choice, Report, Simulation, Via};
use xtask::ensemble::{self, Spread, Sweep, Width};
use xtask::error::Error;
use xtask::package;
use xtask::simulate::MethodName;
use xtask::stress;
use xtask::workspace::Workspace;

/// Generates, lists, explains, evaluates and simulates models of mechanics with symmetry.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version, propagate_version = false, after_help = TOP)]
struct Cli {
    #[command(subcommand)]
    command: Task,
    /// What generating a scene may take, as a multiple of the default limits of expressions, memory and work
    #[arg(long, global = true, value_name = "N", default_value_t = 1, hide_default_value = true, value_parser = clap::value_parser!(u64).range(1..))]
    budget: u64,
}

const TOP: &str = "\
Models are files in models/specs; wherever a model is named, a path that ends in .hamel may stand as well.
Exit status: 0 done, 1 failed, 2 bad input.

Examples:
  cargo xtask list
  cargo xtask explain heavy_top
  cargo xtask simulate heavy_top -o heavy_top.svg
  cargo xtask new my_model
  cargo xtask generate";

#[derive(Subcommand)]
enum Task {
    /// Write a commented model to start from
    ///
    /// The model can be explained, simulated and generated as it is. A name is written to models/specs; a file that is
    /// there already is never touched.
    #[command(
        arg_required_else_help = true,
        after_help = "\
Examples:
  cargo xtask new my_model              models/specs/my_model.hamel
  cargo xtask new ../robot/arm.hamel    a file of another crate, for its build script"
    )]
    New {
        /// Name of the model, or a path that ends in .hamel
        model: String,
    },
    /// Write models/src/generated from models/specs, or check that it is up to date
    ///
    /// All scenes of the models are parsed, derived and emitted first; when any model has a problem, nothing is
    /// written. Files are written only when they change, and files of scenes that no longer exist are removed.
    #[command(after_help = "\
Examples:
  cargo xtask generate                  all models
  cargo xtask generate heavy_top        one model; the index still covers all
  cargo xtask generate --check          write nothing, fail when something would be written")]
    Generate {
        /// Write nothing; fail and name the files that are not up to date
        #[arg(long)]
        check: bool,
        /// Names of models; all when none is given
        models: Vec<String>,
    },
    /// Show models by kind, with their scenes, state variables, parameters and sources
    #[command(after_help = "\
Examples:
  cargo xtask list
  cargo xtask list heavy_top
  cargo xtask list --json")]
    List {
        /// Print JSON: an array with one object per model
        #[arg(long)]
        json: bool,
        /// Names of models; all when none is given
        models: Vec<String>,
    },
    /// Show algebra, stage forms, connection, equations and operation counts of a model
    #[command(
        arg_required_else_help = true,
        after_help = "\
Examples:
  cargo xtask explain kirchhoff_body
  cargo xtask explain heavy_top --scene lagrange
  cargo xtask explain two_arm_satellite --ops
  cargo xtask explain euler_disk --latex > euler_disk.tex"
    )]
    Explain {
        /// Name of a model, or a path that ends in .hamel
        model: String,
        /// Name of the scene
        #[arg(long, default_value = "default")]
        scene: String,
        /// Print a LaTeX fragment that needs amsmath
        #[arg(long)]
        latex: bool,
        /// Print a table of operation counts by function and section instead
        #[arg(long, conflicts_with = "latex")]
        ops: bool,
        /// Write the system with another connection first: the velocity becomes v = xi + A(x) xdot
        #[arg(long, value_parser = ["trivial", "mechanical", "nonholonomic"])]
        connection: Option<String>,
    },
    /// Evaluate derivatives, energy and outputs at given states, JSON in and out
    ///
    /// Reads a request from standard input:
    ///
    /// {"params": {name: number, ..}, "states": [{name: number, ..}, ..], "t": number}
    ///
    /// Missing parameters take the model's defaults, a missing t is 0, and every state names all state variables.
    ///
    /// Prints one line, with one entry per state throughout:
    ///
    /// {"model", "state": [names], "derivatives": [[..], ..], "energy": [..] or null, "outputs": {group: [{..}, ..], ..}}
    ///
    /// docs/command-line.md says more about both.
    #[command(
        arg_required_else_help = true,
        after_help = "\
Examples:
  echo '{\"states\": [{\"Omega1\": 1, \"Omega2\": 0.2, \"Omega3\": 0.1}]}' | cargo xtask eval free_rigid_body
  cargo xtask eval heavy_top --scene lagrange --via interpreter < request.json"
    )]
    Eval(SceneArgs),
    /// Integrate a model from an initial state; print a summary and write files
    ///
    /// Integration starts at t = 0, from the model's own initial state where it has one and otherwise from a moderate one on
    /// the constraint; --initial changes components of it.
    ///
    /// With --reconstruct, position and attitude are integrated as well, and a figure shows the path.
    ///
    /// With --json, a request is read from standard input instead:
    ///
    /// {"params": {..}, "initial": {..}, "t_final": number, "method": "dop853", "rtol": .., "atol": .., "samples": n,
    /// "max_steps": n}
    ///
    /// and one line is printed:
    ///
    /// {"t", "final": {..}, "samples": [[t, {..}], ..], "steps", "rejected", "rhs_evals", "energy_drift",
    /// "constraint_residual", "initial_residual", "warnings"}
    ///
    /// A request with "reconstruct" gives the coordinates of the group, all of them or none for the defaults, and the answer
    /// has their final values in "reconstruction". `cargo xtask list` shows their names: what scene reconstruction adds to
    /// the state. docs/command-line.md says more about both.
    #[command(
        arg_required_else_help = true,
        after_help = "\
Examples:
  cargo xtask simulate heavy_top -o heavy_top.svg
  cargo xtask simulate heavy_top --set m=2 l=0.1 --initial Omega3=20 --t-final 5 -o top.csv -o top.svg
  cargo xtask simulate mobile_robot --reconstruct --initial x=1 y=-2 -o robot.svg
  cargo xtask simulate suslov --method rk4 --step 0.001
  cargo xtask simulate ./my_model.hamel --t-final 3
  echo '{\"initial\": {\"Omega1\": 1, \"Omega2\": 0.2, \"Omega3\": 0.1}, \"t_final\": 10, \"samples\": 5}' \\
    | cargo xtask simulate free_rigid_body --json
  echo '{\"initial\": {\"omega\": 1, \"v1\": 0.5}, \"t_final\": 5, \"reconstruct\": {\"theta\": 0, \"x\": 1, \"y\": 2}}' \\
    | cargo xtask simulate chaplygin_sleigh --json"
    )]
    Simulate(SimulateArgs),
    /// Integrate a model many times, with parameters and initial states that vary; write a table
    ///
    /// What varies takes every value of a grid (--sweep), is drawn at random (--spread), or is read from a table (--table).
    /// Several of these are combined: every line of the table, with every point of the grid, --count times. What is drawn
    /// depends on the seed, the name and the number of the trajectory alone. The rest of a state is chosen as by simulate,
    /// for each trajectory anew, so that constraints hold.
    ///
    /// Four trajectories are integrated side by side in the registers of a core, and the cores share the work; results
    /// depend on neither the number of threads nor --via. A trajectory that stops keeps its last state, the reason is in
    /// the column `error`, and the others go on; when none reaches the end, the exit status is 1. Integration starts at t = 0.
    #[command(
        arg_required_else_help = true,
        after_help = "\
Examples:
  cargo xtask ensemble heavy_top --sweep Omega3=0..20:101 --t-final 5 -o tops.csv
  cargo xtask ensemble heavy_top --spread m=0.05 Omega1=-0.1..0.1 --count 1000 --seed 7 --samples 101 -o tops.npz
  cargo xtask ensemble heavy_top --sweep m=log:0.1..10:5 l=0.1..1:5 --method tsit5 --rtol 1e-6 --atol 1e-8 -o grid.csv
  cargo xtask ensemble euler_disk --table starts.csv --set m=2 -o disks.csv"
    )]
    Ensemble(EnsembleArgs),
    /// Measure the generated code beside other ways to the same numbers
    Bench {
        #[command(subcommand)]
        what: Bench,
    },
    /// Write one HTML page about a model: definition, equations, operations, code, a motion and how accurate it is
    ///
    /// The page loads nothing and opens from disk. A model that says what to draw (`view`) gets a figure in space that
    /// plays the motion. Everything is computed by the interpreter.
    #[command(
        arg_required_else_help = true,
        after_help = "\
Examples:
  cargo xtask report heavy_top
  cargo xtask report euler_disk --t-final 4 -o disk.html
  cargo xtask report ./my_model.hamel --no-run"
    )]
    Report {
        /// Name of a model, or a path that ends in .hamel
        model: String,
        /// Name of the scene
        #[arg(long, default_value = "default")]
        scene: String,
        /// File to write [default: the model's name with .html]
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Leave the motion out
        #[arg(long)]
        no_run: bool,
        /// Time of the motion, from 0
        #[arg(long, value_name = "T", default_value_t = 10.0, value_parser = duration, conflicts_with = "no_run")]
        t_final: f64,
    },
    /// Run the whole test suite: the workspace, then crates that use hamel as others do
    #[command(after_help = "Example:\n  cargo xtask test")]
    Test,
    /// Check that the crates can be published: metadata, files, and a build of what was packaged
    #[command(after_help = "\
Examples:
  cargo xtask package
  cargo xtask package --no-verify       metadata and files only")]
    Package {
        /// Do not build what was packaged
        #[arg(long)]
        no_verify: bool,
    },
    /// Measure rounding errors of all right-hand sides and drifts of long runs
    ///
    /// Every scene is evaluated in f64 and in double-double numbers at random states, at extreme parameters and next to
    /// singularities; selected models are integrated for long. A run of all models that is not short writes
    /// docs/stress.md, docs/stress.csv and docs/stress_runs.csv. A short run compares the errors with pinned bounds and
    /// fails above them.
    #[command(after_help = "\
Examples:
  cargo xtask stress --short            what continuous integration runs
  cargo xtask stress euler_disk         one model; writes nothing
  cargo xtask stress                    all models; takes half an hour")]
    Stress {
        /// Few states and short runs, against pinned bounds
        #[arg(long)]
        short: bool,
        /// Number of random states per scene [default: 20000, short: 2000]
        #[arg(long, value_name = "N")]
        samples: Option<u64>,
        /// Number of steps per run [default: 10000000, short: 100000]
        #[arg(long, value_name = "N")]
        steps: Option<u64>,
        /// Names of models; all when none is given
        models: Vec<String>,
    },
    /// Print completions for a shell
    ///
    /// They complete a command `xtask`, such as the shell function `xtask() { cargo xtask "$@"; }`, because cargo's own
    /// completions do not ask its aliases.
    #[command(
        arg_required_else_help = true,
        after_help = "\
Examples:
  source <(cargo xtask completions bash)
  cargo xtask completions fish > ~/.config/fish/completions/xtask.fish"
    )]
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Print the manual page of the program, or of a command
    #[command(after_help = "\
Examples:
  cargo xtask man | man -l -
  cargo xtask man simulate | man -l -
  cargo xtask man bench rhs | man -l -")]
    Man {
        /// Name of a command, and of its part
        command: Vec<String>,
    },
}

#[derive(Subcommand)]
enum Bench {
    /// Right-hand sides: time, executed instructions and operations of one call
    ///
    /// Measures every generated right-hand side and, for eight systems, the same equations written by an expert, by vector
    /// algebra with nalgebra, and without reduction with multipliers; prints a table, with the best other generators
    /// beside it, measured in the same run with --peers and otherwise elsewhere. Times are those of the fastest and the median of all rounds, in each of
    /// which all right-hand sides are called in turn. Instructions are counted by valgrind's callgrind where that is
    /// installed. When all models are measured, docs/benchmarks/rhs.md, rhs.csv and rhs.svg are written.
    ///
    /// The measuring program is built in target/bench, which takes a minute or two the first time.
    #[command(after_help = "\
Examples:
  cargo xtask bench rhs                                  everything; writes docs/benchmarks
  cargo xtask bench rhs heavy_top euler_disk             two models; writes nothing
  cargo xtask bench rhs --target-cpu native --rounds 500 the instructions of this machine, and a longer measurement
  cargo xtask bench rhs --peers                          other generators as well; see tests/peers/README.md")]
    Rhs {
        /// Names of models; all when none is given
        models: Vec<String>,
        /// Rounds of measurement, each about 0.4 ms a right-hand side
        #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
        rounds: u32,
        /// Instruction set to compile for [default: x86-64-v3 where this machine has it, otherwise baseline]
        #[arg(long, value_enum)]
        target_cpu: Option<TargetCpu>,
        /// Generate, compile and measure the same right-hand sides by other tools, too; PYTHON names the interpreter
        #[arg(long)]
        peers: bool,
    },
    /// Whole integrations: time against the error at the end
    ///
    /// Integrates the first trajectory of the reference files by every method of the runtime and by those of the crates
    /// ode_solvers and differential-equations, over tolerances from 1e-3 to 1e-15, and prints the time to errors of 1e-6,
    /// 1e-9 and 1e-12. When no models are named, docs/benchmarks/wp.md, wp.html, wp_<model>.csv and wp_<model>.svg are
    /// written.
    ///
    /// The measuring program is built in target/bench, which takes some minutes the first time.
    #[command(after_help = "\
Examples:
  cargo xtask bench wp                       five models; writes docs/benchmarks
  cargo xtask bench wp heavy_top             one model; writes nothing
  cargo xtask bench wp --peers               integrators in Python as well; see tests/peers/README.md")]
    Wp {
        /// Names of models; heavy_top, euler_disk, chaplygin_ball, two_arm_satellite and snakeboard when none is given
        models: Vec<String>,
        /// Rounds of measurement, each about 0.1 ms a method and tolerance
        #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
        rounds: u32,
        /// Instruction set to compile for [default: x86-64-v3 where this machine has it, otherwise baseline]
        #[arg(long, value_enum)]
        target_cpu: Option<TargetCpu>,
        /// Measure integrators in Python, too, where they are installed; PYTHON names the interpreter
        #[arg(long)]
        peers: bool,
    },
    /// Growing systems: time of generation and of rustc, lines, and time of one call
    ///
    /// Generates free motions on so(n), su(n) and nilpotent groups of dimension 6 to 78, compiles each with one call of
    /// rustc and times its right-hand side; prints a table and how times grow with the number of operations, and writes
    /// docs/benchmarks/scaling.md, scaling.csv and scaling.svg.
    #[command(after_help = "\
Examples:
  cargo xtask bench scaling                          everything; writes docs/benchmarks
  cargo xtask bench scaling --short                  small systems; writes nothing
  cargo xtask bench scaling --target-cpu baseline    compares results with the interpreter, bit for bit, as well")]
    Scaling {
        /// Small systems only, and write nothing
        #[arg(long)]
        short: bool,
        /// How often each system is generated and compiled; the fastest time of each counts
        #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
        rounds: u32,
        /// Instruction set to compile for [default: x86-64-v3 where this machine has it, otherwise baseline]
        #[arg(long, value_enum)]
        target_cpu: Option<TargetCpu>,
    },
}

#[derive(Args)]
struct SceneArgs {
    /// Name of a model, or a path that ends in .hamel
    model: String,
    /// Name of the scene
    #[arg(long, default_value = "default")]
    scene: String,
    /// Who evaluates: the compiled module, or the interpreter of the generator
    #[arg(long, value_enum, default_value_t)]
    via: Via,
}

impl SceneArgs {
    fn choice(self) -> Choice {
        Choice { model: self.model, scene: self.scene, via: self.via }
    }
}

/// From where to where, and how.
#[derive(Args)]
struct MotionArgs {
    /// Parameters that differ from the model's defaults
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    set: Vec<(String, f64)>,
    /// Components of the initial state; the others keep their default
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    initial: Vec<(String, f64)>,
    /// Time to integrate to, from 0; negative for backward
    #[arg(long, value_name = "T", default_value_t = 10.0, allow_negative_numbers = true, value_parser = finite)]
    t_final: f64,
    /// Integration method
    #[arg(long, value_enum, default_value_t)]
    method: MethodName,
    /// Relative tolerance [default: 1e-10]
    #[arg(long, value_parser = finite)]
    rtol: Option<f64>,
    /// Absolute tolerance [default: 1e-12]: errors below it do not count, so take less, or 0, for motions of less than atol/rtol
    #[arg(long, value_parser = finite)]
    atol: Option<f64>,
    /// Fixed step size instead of tolerances
    #[arg(long, value_name = "H", value_parser = finite)]
    step: Option<f64>,
    /// Largest number of steps, rejected ones included [default: 50000000, with fixed steps 1000000000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    max_steps: Option<u64>,
}

#[derive(Args)]
struct EnsembleArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Parameter or component of the initial state that takes N values from A to B, or with equal ratios from log:A to B
    #[arg(long, value_name = "NAME=[log:]A..B:N", num_args = 1.., value_parser = Sweep::parse)]
    sweep: Vec<Sweep>,
    /// Parameter or component to draw: normally distributed around its value with standard deviation SIGMA, or
    /// uniformly from A..B, or with a uniform logarithm from log:A..B
    #[arg(long, value_name = "NAME=SIGMA|[log:]A..B", num_args = 1.., requires = "count", value_parser = Spread::parse)]
    spread: Vec<Spread>,
    /// Number of draws, for each line of the table and point of the grid
    #[arg(long, value_name = "N", requires = "spread")]
    count: Option<usize>,
    /// Seed of what is drawn
    #[arg(long, default_value_t = 0, requires = "spread")]
    seed: u64,
    /// File (CSV) of parameters and components of initial states: a line of names, then a line for each trajectory
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    #[command(flatten)]
    motion: MotionArgs,
    /// Number of samples of each trajectory at equal distances, both ends included; a single one is the end
    #[arg(long, value_name = "N", default_value_t = 1)]
    samples: usize,
    /// Trajectories side by side in a core, with common steps; explicit methods only, the others take one at a time
    #[arg(long, value_enum, default_value_t)]
    lanes: Width,
    /// Number of threads, at most 1024; results do not depend on it [default: that of the cores]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// File to write: .csv or .npz; may be repeated
    #[arg(short, long = "output", value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
}

#[derive(Args)]
struct SimulateArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    motion: MotionArgs,
    /// Integrate position and attitude (the coordinates of the group) as well; --initial takes them then
    #[arg(long)]
    reconstruct: bool,
    /// Number of samples in files, at equal distances, both ends included [default: 1001]
    #[arg(long, value_name = "N")]
    samples: Option<usize>,
    /// File to write: .csv, .svg or .json; may be repeated
    #[arg(short, long = "output", value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Read a JSON request from standard input and print a JSON answer
    #[arg(long, conflicts_with_all =
        ["set", "initial", "reconstruct", "t_final", "method", "rtol", "atol", "step", "max_steps", "samples", "output"])]
    json: bool,
}

fn assignment(text: &str) -> Result<(String, f64), String> {
    let Some((name, value)) = text.split_once('=') else {
        return Err("write it as name=value, such as m=1.5".into());
    };
    Ok((name.trim().to_owned(), finite(value)?))
}

fn finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("{text:?} is not a finite number")),
    }
}

fn duration(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(t) if t.is_finite() && t > 0.0 => Ok(t),
        _ => Err("give a time above zero".into()),
    }
}

fn completions(shell: Shell) -> String {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "xtask", &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

/// # Errors
/// [`Error::UnknownCommand`].
fn manual(names: &[String]) -> Result<String, Error> {
    let mut command = Cli::command();
    // Makes usage lines start with `cargo xtask`.
    command.build();
    for name in names {
        let found = command.find_subcommand(name).cloned();
        command = found.ok_or_else(|| Error::UnknownCommand {
            name: name.clone(),
            known: command.get_subcommands().map(|c| c.get_name().to_owned()).collect(),
        })?;
    }
    let mut text = Vec::new();
    clap_mangen::Man::new(command).render(&mut text).map_err(|e| Error::io("manual page", e))?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}

fn run(task: Task) -> Result<String, Error> {
    let workspace = Workspace::find()?;
    match task {
        Task::New { model } => commands::new(&workspace, &model),
        Task::Generate { check, models } => commands::generate(&workspace, &models, check),
        Task::List { json, models } => commands::list(&workspace, &models, json),
        Task::Explain { model, scene, latex, ops, connection } => {
            let aspect = match (ops, latex) {
                (true, _) => Aspect::Operations,
                (false, true) => Aspect::Latex,
                (false, false) => Aspect::Text,
            };
            commands::explain(&workspace, &model, &scene, aspect, connection.as_deref())
        }
        Task::Eval(scene) => commands::eval(&workspace, &scene.choice()),
        Task::Simulate(args) if args.json => commands::simulate_json(&workspace, &args.scene.choice()),
        Task::Simulate(args) => {
            let simulation = Simulation {
                set: args.motion.set,
                initial: args.motion.initial,
                reconstruct: args.reconstruct,
                t_final: args.motion.t_final,
                method: args.motion.method,
                rtol: args.motion.rtol,
                atol: args.motion.atol,
                step: args.motion.step,
                max_steps: args.motion.max_steps,
                samples: args.samples,
                outputs: args.output,
            };
            commands::simulate(&workspace, &args.scene.choice(), &simulation)
        }
        Task::Ensemble(args) => {
            let arguments = ensemble::Arguments {
                sweep: args.sweep,
                spread: args.spread,
                count: args.count,
                seed: args.seed,
                table: args.table,
                set: args.motion.set,
                initial: args.motion.initial,
                t_final: args.motion.t_final,
                method: args.motion.method,
                rtol: args.motion.rtol,
                atol: args.motion.atol,
                step: args.motion.step,
                max_steps: args.motion.max_steps,
                samples: args.samples,
                width: args.lanes,
                threads: args.threads,
                outputs: args.output,
            };
            ensemble::ensemble(&workspace, &args.scene.choice(), &arguments)
        }
        Task::Bench { what: Bench::Rhs { models, rounds, target_cpu, peers } } => {
            let target_cpu = target_cpu.unwrap_or_else(TargetCpu::of_host);
            bench::rhs(&workspace, &bench::Options { models, rounds, target_cpu, peers })
        }
        Task::Bench { what: Bench::Wp { models, rounds, target_cpu, peers } } => {
            let target_cpu = target_cpu.unwrap_or_else(TargetCpu::of_host);
            bench::wp::wp(&workspace, &bench::wp::Options { models, rounds, target_cpu, peers })
        }
        Task::Bench { what: Bench::Scaling { short, rounds, target_cpu } } => {
            let target_cpu = target_cpu.unwrap_or_else(TargetCpu::of_host);
            bench::scaling::scaling(&workspace, &bench::scaling::Options { short, rounds, target_cpu })
        }
        Task::Report { model, scene, output, no_run, t_final } => {
            commands::report(&workspace, &Report { model, scene, output, run: !no_run, t_final })
        }
        Task::Test => commands::test(&workspace),
        Task::Package { no_verify } => package::package(&workspace, !no_verify),
        Task::Stress { short, samples, steps, models } => {
            stress::stress(&workspace, &models, short, samples, steps)
        }
        Task::Completions { shell } => Ok(completions(shell)),
        Task::Man { command } => manual(&command),
    }
}

fn main() -> ExitCode {
    let Cli { command, budget } = Cli::parse();
    codegen_bridge::set_budget(budget);
    match run(command) {
        Ok(text) => {
            // A reader that has seen enough, such as `head`, is no failure.
            let _ = writeln!(std::io::stdout(), "{}", text.trim_end_matches('\n'));
            ExitCode::SUCCESS
        }
        Err(error) => {
            let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
            eprintln!("{}", error.render(color));
            ExitCode::from(error.exit_code())
        }
    }
}

#[cfg(test)]
#[path = "../tests/common/pages.rs"]
mod pages;

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::{Cli, pages};

    /// Every `cargo xtask` in a shell block of the documentation has arguments that the program takes.
    #[test]
    fn documented_commands_parse() {
        let mut n = 0;
        for page in pages::pages() {
            for block in
                pages::blocks(&page.text).into_iter().filter(|b| ["sh", "console"].contains(&b.language))
            {
                for words in pages::commands(block.text) {
                    // `xtask() { cargo xtask "$@"; }`
                    if words.iter().any(|word| word.starts_with("$@")) {
                        continue;
                    }
                    let arguments = ["cargo xtask".to_owned()].into_iter().chain(words.clone());
                    if let Err(error) = Cli::try_parse_from(arguments) {
                        panic!("{}: {words:?}\n{error}", page.path.display());
                    }
                    n += 1;
                }
            }
        }
        assert!(n > 20, "only {n} commands found");
    }
}
