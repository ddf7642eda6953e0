//! A right-hand side that is measured, and what was measured of it.
//!
//! Does not know: how it is measured or shown.

use hamel_program::program::Counts;

/// A right-hand side of the measuring program.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Kernel {
    /// Name of the model; `-` for the copy that is the floor of every measurement.
    pub(crate) model: String,
    /// Name of the scene.
    pub(crate) scene: String,
    /// By what means it is written; that of a peer names the compiler after a comma.
    pub(crate) kind: String,
    /// States of one call.
    pub(crate) lanes: u32,
}

impl Kernel {
    /// The copy kernel.
    pub(crate) fn is_copy(&self) -> bool {
        self.kind == "copy"
    }

    /// Its name in the measuring program.
    pub(super) fn name(&self) -> String {
        let lanes = if self.lanes > 1 { format!("-{}", self.lanes) } else { String::new() };
        format!("{}/{}/{}{lanes}", self.model, self.scene, self.kind)
    }

    /// The kernel of a line of `hamel-bench list`.
    pub(super) fn parse(line: &str) -> Option<Kernel> {
        let (name, lanes) = line.rsplit_once(' ')?;
        let lanes: u32 = lanes.parse().ok()?;
        let mut parts = name.split('/').map(str::to_owned);
        let (model, scene, kind) = (parts.next()?, parts.next()?, parts.next()?);
        let kind = kind.strip_suffix(&format!("-{lanes}")).unwrap_or(&kind).to_owned();
        Some(Kernel { model, scene, kind, lanes })
    }
}

/// What was measured of a kernel; times and instructions are those of one lane of one call.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    /// The kernel.
    pub(crate) kernel: Kernel,
    /// Operations of the generated program.
    pub(crate) counts: Option<Counts>,
    /// Executed instructions, functions of the mathematical library and the loop around the call included.
    pub(crate) instructions: Option<f64>,
    /// Nanoseconds in the fastest round.
    pub(crate) min: f64,
    /// Nanoseconds in the median round.
    pub(crate) median: f64,
    /// Nanoseconds in the fastest round of calls each of which waits for the one before.
    pub(crate) chain: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::Kernel;

    #[test]
    fn kernels_are_read_as_they_are_named() {
        let peer = "heavy_top/default/wrenfold C++, gcc-8 8";
        for line in ["heavy_top/default/hamel 1", "heavy_top/default/hamel-8 8", "-/-/copy 1", peer] {
            let kernel = Kernel::parse(line).unwrap_or_else(|| panic!("{line}"));
            assert_eq!(format!("{} {}", kernel.name(), kernel.lanes), line);
        }
        assert_eq!(Kernel::parse("heavy_top/default/hamel-8 8").map(|k| k.kind), Some("hamel".to_owned()));
        assert_eq!(Kernel::parse("heavy_top 1"), None);
    }
}
