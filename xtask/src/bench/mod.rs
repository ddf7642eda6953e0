//! `bench`: generated code beside other ways to the same numbers.
//!
//! Does not know: how anything is measured or shown.

mod chains;
mod chosen;
mod drift;
mod drift_report;
mod family;
mod fluids;
mod fluids_report;
mod formulations;
mod instructions;
mod kernel;
mod nonholonomic;
mod nonholonomic_report;
mod peers;
mod point;
mod program;
mod rhs;
mod rhs_report;
mod scaling;
mod scaling_report;
mod source;
mod table;
mod toolchain;
mod trajectory;
mod wp;
mod wp_report;

use std::path::PathBuf;
use std::process::Command;

use clap::Subcommand;
use hamel_run::Error;
use hamel_run::repository::Repository;
use hamel_run::session::Session;

use chosen::Chosen;
use program::TargetCpu;

/// What is measured.
#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// Right-hand sides: time, executed instructions and operations of one call
    ///
    /// Measures every generated right-hand side and, for eight systems, the same equations written by an expert, by
    /// vector algebra with nalgebra, and without reduction with multipliers; prints a table, with the best other
    /// generators beside it, measured in the same run with --peers and otherwise elsewhere. Times are those of the
    /// fastest and the median of all rounds, in each of which all right-hand sides are called in turn. Instructions are
    /// counted by valgrind's callgrind where that is installed. When all models are measured, docs/benchmarks/rhs.md,
    /// rhs.csv and rhs.svg are written.
    ///
    /// The measuring program is built in target/bench, which takes a minute or two the first time.
    #[command(after_help = "\
Examples:
  cargo xtask bench rhs                                  everything; writes docs/benchmarks
  cargo xtask bench rhs heavy_top euler_disk             two models; writes nothing
  cargo xtask bench rhs --target-cpu native --rounds 500 the instructions of this machine, and a longer measurement
  cargo xtask bench rhs --peers                          other generators as well; see tests/peers/README.md")]
    Rhs {
        #[command(flatten)]
        chosen: Chosen,
        /// Rounds of measurement, each about 0.4 ms a right-hand side
        #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
        rounds: u32,
        /// Generate, compile and measure the same right-hand sides by other tools, too; PYTHON names the interpreter
        #[arg(long)]
        peers: bool,
    },
    /// Formulations: what the best of each model costs beside the one that it is written in
    ///
    /// Searches the formulations of the default scene as `explain --formulations` does and prints a table. When no
    /// models are named, docs/benchmarks/formulations.md is written.
    #[command(after_help = "\
Examples:
  cargo xtask bench formulations                 all models, some minutes; writes docs/benchmarks
  cargo xtask bench formulations heavy_top       one model; writes nothing")]
    Formulations {
        /// Names of models; all when none is given
        models: Vec<String>,
    },
    /// Whole integrations: time against the error at the end
    ///
    /// Integrates the trajectories of the reference files by every method of the runtime and by those of the crates
    /// ode_solvers and differential-equations, over tolerances from 1e-3 to 1e-15, and prints the time to errors of
    /// 1e-6, 1e-9 and 1e-12. When no models are named, docs/benchmarks/wp.md, wp.html, `wp_<model>.csv` and
    /// `wp_<model>.svg` are written, of further trajectories `wp_<model>_2.csv` and so on.
    ///
    /// The measuring program is built in target/bench, which takes some minutes the first time; where this machine has
    /// AVX-512 it is built for x86-64-v4 as well, in target/bench-wide, for several trajectories side by side.
    #[command(after_help = "\
Examples:
  cargo xtask bench wp                       five models; writes docs/benchmarks
  cargo xtask bench wp heavy_top             one model; writes nothing
  cargo xtask bench wp --peers               integrators in Python as well; see tests/peers/README.md")]
    Wp {
        #[command(flatten)]
        chosen: Chosen,
        /// Rounds of measurement, each about 0.1 ms a method and tolerance
        #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
        rounds: u32,
        /// Measure integrators in Python, too, where they are installed; PYTHON names the interpreter
        #[arg(long)]
        peers: bool,
    },
    /// Fluids as matrices: time of a step that keeps the spectrum, against the size
    ///
    /// Moves flows on the sphere and on the torus by the isospectral midpoint rule, for N from 5 to 256, and prints
    /// time, iterations, error and drift of Casimirs; beside the same method with numpy, and quflow where it is
    /// installed, with --peers. Writes docs/benchmarks/fluids.md, fluids.csv and fluids.svg.
    #[command(after_help = "\
Examples:
  cargo xtask bench fluids             a minute or two; writes docs/benchmarks
  cargo xtask bench fluids --peers     programs in Python as well; see tests/peers/README.md")]
    Fluids {
        /// Rounds of measurement, each at least 2 ms a size
        #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
        rounds: u32,
        /// Instruction set to compile for [default: x86-64-v3 where this machine has it, otherwise baseline]
        #[arg(long, value_enum)]
        target_cpu: Option<TargetCpu>,
        /// Measure programs in Python, too, where they are installed; PYTHON names the interpreter
        #[arg(long)]
        peers: bool,
    },
    /// Long runs: the error of the energy against the number of steps
    ///
    /// Makes 1e7 short steps with gauss16, and a tenth with longer ones and with the other methods that come near
    /// round-off, on ten systems from four points of a motion each; prints errors after 1e3, 1e4, .. steps, how they
    /// grow, and the time of a unit of time. When no models are named, docs/benchmarks/drift.md, drift.csv and
    /// drift.svg are written.
    ///
    /// The measuring program is built in target/bench, which takes some minutes the first time.
    #[command(after_help = "\
Examples:
  cargo xtask bench drift                            ten systems, some minutes; writes docs/benchmarks
  cargo xtask bench drift heavy_top --steps 100000   one of them, shorter; writes nothing
  cargo xtask bench drift --peers                    heyoka as well; see tests/peers/README.md")]
    Drift {
        #[command(flatten)]
        chosen: Chosen,
        /// Steps of the longest runs
        #[arg(long, value_name = "N", default_value_t = 10_000_000)]
        #[arg(value_parser = clap::value_parser!(u64).range(10_000..))]
        steps: u64,
        /// Measure heyoka, too: needs Python with the package of tests/peers/README.md
        #[arg(long)]
        peers: bool,
    },
    /// Nonholonomic systems: errors of energy and constraint over many steps against the cost
    ///
    /// Moves the systems of xtask/bench/models, in each of the cases that their scenes are, and two bodies of the
    /// repository by all methods of the runtime with several sizes of steps or tolerances; the leapfrogs of the
    /// discrete Lagrange-d'Alembert principle are among the methods. Prints what evaluations of the right-hand side a
    /// unit of time takes to keep the energy, how the energy drifts and the constraint is violated. When neither models
    /// nor methods are named, docs/benchmarks/nonholonomic.md and nonholonomic.csv are written, with a figure a case.
    ///
    /// The measuring program is built in target/bench, which takes some minutes the first time.
    #[command(after_help = "\
Examples:
  cargo xtask bench nonholonomic                                    all of it; writes docs/benchmarks
  cargo xtask bench nonholonomic contact_oscillator --steps 100000  one system, shorter; writes nothing
  cargo xtask bench nonholonomic --methods dla --methods gauss8     two methods; writes nothing")]
    Nonholonomic {
        #[command(flatten)]
        chosen: Chosen,
        /// Steps of each run
        #[arg(long, value_name = "N", default_value_t = 1_000_000)]
        #[arg(value_parser = clap::value_parser!(u64).range(100..))]
        steps: u64,
        /// Name of a method, as the table has it; all methods when none is given
        #[arg(long, value_name = "NAME")]
        methods: Vec<String>,
    },
    /// Growing systems: time of generation and of rustc, lines, and time of one call
    ///
    /// Generates free motions on so(n), su(n) and nilpotent groups of dimension 6 to 78, and chains of 2 to 20 bodies,
    /// compiles each with one call of rustc and times its right-hand side, that of a chain beside a recursion written
    /// by hand; prints tables and how times grow, and writes docs/benchmarks/scaling.md, scaling.csv and scaling.svg,
    /// of the chains scaling_chains.csv and scaling_chains.svg.
    #[command(after_help = "\
Examples:
  cargo xtask bench scaling                          everything; writes docs/benchmarks
  cargo xtask bench scaling --short                  small systems; writes nothing
  cargo xtask bench scaling --peers                  Pinocchio as well; see tests/peers/README.md
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
        /// Measure Pinocchio on the chains, too, where it is installed; PYTHON names the interpreter
        #[arg(long)]
        peers: bool,
        /// Generate one model and tell what that takes, for the measurement itself
        #[arg(long, value_name = "FILE", hide = true)]
        generate: Option<PathBuf>,
    },
}

/// Runs this program again with the same arguments, compiled as what is measured has to be.
fn restart_optimised(repository: &Repository) -> Result<String, Error> {
    let mut cargo = Command::new(Repository::cargo());
    cargo.args(["run", "--release", "--package", "xtask", "--manifest-path"]).arg(repository.manifest());
    let status = cargo.arg("--").args(std::env::args_os().skip(1)).status();
    let status = status.map_err(|e| Error::io("cargo could not be started", e))?;
    if status.success() {
        Ok(String::new())
    } else {
        Err(Error::Failed { step: "bench".into(), status: status.to_string() })
    }
}

impl Bench {
    /// Measures; the tables.
    ///
    /// # Errors
    /// Those of the part.
    pub(crate) fn run(self, repository: &Repository, session: &Session) -> Result<String, Error> {
        // Times of generating, compiling in memory and interpreting are those of this program. `formulations` counts.
        if cfg!(debug_assertions) && !matches!(self, Bench::Formulations { .. }) {
            return restart_optimised(repository);
        }
        let or_host = |cpu: Option<TargetCpu>| cpu.unwrap_or_else(TargetCpu::of_host);
        match self {
            Bench::Rhs { chosen, rounds, peers } => {
                rhs::rhs(repository, session, &rhs::Options { chosen, rounds, peers })
            }
            Bench::Formulations { models } => formulations::formulations(repository, session, &models),
            Bench::Wp { chosen, rounds, peers } => wp::wp(repository, &wp::Options { chosen, rounds, peers }),
            Bench::Fluids { rounds, target_cpu, peers } => {
                let target_cpu = or_host(target_cpu);
                fluids::fluids(repository, fluids::Options { rounds, target_cpu, peers })
            }
            Bench::Drift { chosen, steps, peers } => {
                drift::drift(repository, &drift::Options { chosen, steps, peers })
            }
            Bench::Nonholonomic { chosen, steps, methods } => {
                let options = nonholonomic::Options { chosen, steps, methods };
                nonholonomic::nonholonomic(repository, session, &options)
            }
            Bench::Scaling { generate: Some(file), .. } => chains::generate(&file),
            Bench::Scaling { short, rounds, target_cpu, peers, generate: None } => {
                let target_cpu = or_host(target_cpu);
                let options = toolchain::Options { short, rounds, target_cpu, peers };
                scaling::scaling(repository, &options)
            }
        }
    }
}
