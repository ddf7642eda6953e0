//! A generated scene over two scalars: what is moved, and what its energy is to 31 digits.
//!
//! Deliberately does not know: which scenes there are, what is measured of a motion.

use hamel_runtime::{DoubleDouble, Integrator, Method, Options, Real, Scene, System};

/// Numbers by name.
pub type Numbers = std::collections::BTreeMap<String, f64>;

/// A scene over two scalars, with the energy of a state.
pub(crate) struct Body<S, W> {
    pub(crate) scene: S,
    pub(crate) wide: W,
}

impl<S, W, const N: usize> Body<S, W>
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    W: Scene<DoubleDouble> + System<DoubleDouble, State = [DoubleDouble; N]>,
{
    /// The scene with the values of its parameters.
    ///
    /// # Errors
    /// A parameter without a value, or with one that the model does not allow.
    pub(crate) fn new(params: &Numbers) -> Result<Self, String> {
        let of = |name: &str| params.get(name).copied().ok_or_else(|| format!("no value for {name}"));
        let values = S::INFO.params.iter().map(|p| of(p.name)).collect::<Result<Vec<f64>, _>>()?;
        let wide: Vec<DoubleDouble> = values.iter().copied().map(DoubleDouble::from).collect();
        let scene = S::prepare(&values).map_err(|e| e.to_string())?;
        Ok(Body { scene, wide: W::prepare(&wide).map_err(|e| e.to_string())? })
    }

    /// The state of a motion; an attitude that it does not have is none.
    pub(crate) fn state(&self, initial: &Numbers) -> [f64; N] {
        let value =
            |name: &&str| initial.get(*name).copied().unwrap_or(if *name == "qw" { 1.0 } else { 0.0 });
        let values: Vec<f64> = S::INFO.state.iter().map(value).collect();
        std::array::from_fn(|k| values[k])
    }

    /// The energy; zero of a scene that has none.
    pub(crate) fn energy(&self, y: &[f64; N]) -> DoubleDouble {
        // The scenes have an energy that does not depend on time.
        self.wide.energy_of(DoubleDouble::ZERO, &y.map(DoubleDouble::from)).unwrap_or(DoubleDouble::ZERO)
    }

    /// The state at a time; nothing where the method does not get there.
    pub(crate) fn advanced<M: Method<f64, S>>(
        &self,
        method: M,
        start: [f64; N],
        t: f64,
        options: Options<f64>,
    ) -> Option<[f64; N]> {
        let mut solver = Integrator::new(&self.scene, method, 0.0, start, options).ok()?;
        solver.integrate_to(t).ok()?;
        Some(*solver.state())
    }
}
