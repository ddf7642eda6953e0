//! Other code generators: what `tests/peers` measures of them in the same run, and otherwise numbers measured
//! elsewhere.
//!
//! Measured elsewhere: all eight systems were given to each peer, derived by hand in the best frame and from a
//! Lagrangian, and every result was checked against the reference data of this repository. Each number is the best of
//! all of them, for one call with independent inputs: heyoka 7.13.2, SymForce 0.12.0, CasADi 3.8.2, wrenfold 0.5.3,
//! sympy 1.14.0, symplex 0.57.0, parameters at run time, with gcc 12.2, clang 22.1.8 (`-O3 -march=native`) and rustc
//! 1.95 on an Intel Xeon (Emerald Rapids); instructions by callgrind on x86-64-v3 builds, the mathematical library and
//! about 10 of the harness included.
//!
//! Does not know: hamel's own numbers, the packages, how a kernel is timed.

use std::path::PathBuf;
use std::process::Command;

use hamel_run::Error;
use hamel_run::repository::Repository;

use super::kernel::Row;
use super::program::{TargetCpu, converse, progress, target_dir};

/// What `tests/peers` needs; its readme says the same.
pub(crate) const PIP: &str =
    "pip install wrenfold==0.5.3 sympy==1.14.0 casadi==3.8.2 heyoka==7.13.2 symforce==0.12.0 numba scipy";

/// Other generators that were measured in the same run.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Peers {
    /// Their kernels, and the copy kernel called in the same way.
    pub(crate) rows: Vec<Row>,
    /// Packages and compilers with their versions.
    pub(crate) using: Vec<String>,
}

/// The program with the kernels of other generators.
pub(super) struct Generated {
    pub(super) program: PathBuf,
    pub(super) using: Vec<String>,
    pub(super) notes: Vec<String>,
}

/// The command that runs a script of `tests/peers` with the interpreter that `PYTHON` names.
pub(super) fn script(repository: &Repository, name: &str) -> Command {
    let mut command = Command::new(std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into()));
    // Without files of compiled modules beside the scripts.
    command.arg("-B").arg(repository.root().join("tests/peers").join(name));
    command
}

/// Has `tests/peers/rhs.py` generate, compile and check the kernels of some models; the error is a note that says what
/// to do.
pub(super) fn generate(
    repository: &Repository,
    cpu: TargetCpu,
    models: &[&str],
) -> Result<Generated, String> {
    if models.is_empty() {
        let known = PEERS.map(|p| p.model).join(", ");
        return Err(format!("other generators are not measured: they are given {known} alone"));
    }
    let folder = target_dir(repository).join("peers");
    let mut command = script(repository, "rhs.py");
    command.arg(&folder).arg(cpu.name()).args(models);
    let said = listen(command, "other generators", |_| None)?;
    Ok(Generated { program: folder.join("peers"), using: said.using, notes: said.notes })
}

/// What a script said besides its results.
#[derive(Default)]
pub(super) struct Said {
    pub(super) using: Vec<String>,
    pub(super) notes: Vec<String>,
}

/// Runs a script with a bar, and hands lines that are not about its work to `take`; the error is a note that says what
/// to do.
pub(super) fn listen(
    command: Command,
    who: &str,
    mut take: impl FnMut(&str) -> Option<()>,
) -> Result<Said, String> {
    let bar = progress(1);
    let mut said = Said::default();
    let outcome =
        converse(command, "python3, or what PYTHON names", &bar, |line| match line.split_once(' ') {
            Some(("work", rest)) => {
                let (n, what) = rest.split_once(' ')?;
                bar.set_length(n.parse().ok()?);
                bar.set_position(0);
                bar.set_message(format!("{what} peers"));
                Some(())
            }
            Some(("using", rest)) => {
                said.using.push(rest.to_owned());
                Some(())
            }
            Some(("note", rest)) => {
                said.notes.push(rest.to_owned());
                Some(())
            }
            _ => take(line),
        });
    bar.finish_and_clear();
    match outcome {
        Ok(()) => Ok(said),
        Err(e) => Err(format!(
            "{who} are not measured: {} (tests/peers/README.md; `{PIP}`)",
            reason(&e).lines().next_back().unwrap_or("the script said nothing")
        )),
    }
}

/// What a failed script said.
fn reason(error: &Error) -> String {
    match error {
        Error::Failed { status, .. } => status.clone(),
        other => other.to_string(),
    }
}

/// One sentence that says where the numbers come from.
pub(crate) const CITATION: &str = "best of heyoka 7.13.2, SymForce 0.12.0, CasADi 3.8.2, wrenfold 0.5.3, sympy 1.14.0 and symplex \
0.57.0, each fed by hand with the equations in their best form, parameters at run time; gcc 12.2, clang 22.1.8, rustc 1.95 \
on an Intel Xeon (Emerald Rapids)";

/// Nanoseconds of the peers' copy kernel.
pub(crate) const COPY: f64 = 3.1;

/// The best peer for a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Peer {
    /// Name of the model.
    pub(crate) model: &'static str,
    /// Fewest executed instructions of a call.
    pub(crate) instructions: f64,
    /// Nanoseconds of the fastest call, that of the copy kernel included.
    pub(crate) ns: f64,
    /// Nanoseconds of a lane in the fastest call with 8 lanes.
    pub(crate) ns_of_8_lanes: f64,
}

const fn peer(model: &'static str, instructions: f64, ns: f64, ns_of_8_lanes: f64) -> Peer {
    Peer { model, instructions, ns, ns_of_8_lanes }
}

/// The best peers.
pub(crate) const PEERS: [Peer; 8] = [
    peer("heavy_top", 60.0, 4.0, 0.7),
    peer("kirchhoff_body", 222.0, 17.5, 3.7),
    peer("euler_disk", 248.0, 16.3, 3.9),
    peer("euler_disk_advected", 123.0, 12.2, 3.2),
    peer("chaplygin_ball", 116.0, 10.3, 2.6),
    peer("snakeboard", 174.0, 10.1, 2.5),
    peer("mobile_robot", 49.0, 3.9, 0.6),
    peer("two_arm_satellite", 536.0, 38.0, 9.8),
];

#[cfg(test)]
mod tests {
    #[test]
    fn the_readme_says_what_to_install() {
        let readme = include_str!("../../../tests/peers/README.md");
        assert!(readme.contains(super::PIP), "tests/peers/README.md lacks `{}`", super::PIP);
    }
}
