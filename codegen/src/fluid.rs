//! Fluids of matrices as the runtime moves them: the numbers of a model in its words, and the names of modes.
//!
//! Does not know: who asks for a motion, texts of models.

use hamel_expr::{Rational, rational_to_f64};
use hamel_lang::spec::{CarriedField, FluidField, FluidTrace, FluidWave, MatrixFluid};
use hamel_runtime::Error;
use hamel_runtime::matrices::{
    Current, Damped, Friction, IsospectralMidpoint, Laplacian, MatrixMut, MatrixRef, Options, Sphere, Stream,
    Torus,
};

/// The stream function of a fluid, without its constant part.
pub fn stream(fluid: &MatrixFluid) -> Stream {
    let [scale, shift] = [&fluid.scale, &fluid.shift].map(rational_to_f64);
    Stream::ideal().with_scale(scale).with_shift(shift)
}

/// The friction of a fluid.
pub fn friction(fluid: &MatrixFluid) -> Friction {
    let coefficients = fluid.friction.iter().map(rational_to_f64).enumerate();
    coefficients.fold(Friction::none(), |friction, (k, c)| friction.with(k, c))
}

/// The current of a carried field without its constant part, where the field has an energy.
pub fn current(field: &CarriedField) -> Option<Current> {
    let coefficients = field.current.iter().map(rational_to_f64).enumerate();
    field.is_active().then(|| coefficients.fold(Current::none(), |current, (k, c)| current.with(k, c)))
}

/// A surface whose modes have the names of the model language.
pub trait Modes: Laplacian + Sized {
    /// The energy of the runtime by that of the model.
    const ENERGY: f64;

    /// The surface with matrices of the size `n`.
    ///
    /// # Errors
    /// Sizes and numbers that the runtime refuses.
    fn surface(n: usize, stream: Stream) -> Result<Self, Error>;

    /// Adds to a mode.
    fn add(&self, wave: FluidWave, value: f64, matrix: MatrixMut<'_>);

    /// The value of a mode.
    fn value(&self, wave: FluidWave, matrix: MatrixRef<'_>) -> f64;

    /// All coefficients, in the order of the algebra.
    fn all(&self, matrix: MatrixRef<'_>) -> Vec<f64>;
}

/// A value as one of two, real and imaginary part or cosine and sine.
fn parts(wave: FluidWave, value: f64) -> [f64; 2] {
    if wave.is_second { [0.0, value] } else { [value, 0.0] }
}

impl Modes for Torus<Vec<f64>> {
    const ENERGY: f64 = 1.0;

    fn surface(n: usize, stream: Stream) -> Result<Self, Error> {
        Torus::with_stream(n, stream, vec![0.0; Self::storage(n)])
    }

    fn add(&self, wave: FluidWave, value: f64, matrix: MatrixMut<'_>) {
        let (m1, m2) = wave.wave;
        self.add_mode((m1 as isize, m2 as isize), parts(wave, value), matrix);
    }

    fn value(&self, wave: FluidWave, matrix: MatrixRef<'_>) -> f64 {
        let (m1, m2) = wave.wave;
        self.mode((m1 as isize, m2 as isize), matrix)[usize::from(wave.is_second)]
    }

    fn all(&self, matrix: MatrixRef<'_>) -> Vec<f64> {
        let mut modes = vec![0.0; self.n_modes()];
        self.modes(matrix, &mut modes);
        modes
    }
}

impl Modes for Sphere<Vec<f64>> {
    // The integral over the sphere by the mean.
    const ENERGY: f64 = 4.0 * std::f64::consts::PI;

    fn surface(n: usize, stream: Stream) -> Result<Self, Error> {
        Sphere::with_stream(n, stream, vec![0.0; Self::storage(n)])
    }

    fn add(&self, wave: FluidWave, value: f64, matrix: MatrixMut<'_>) {
        let (l, m) = wave.wave;
        self.add_real_mode((l as usize, m as usize), parts(wave, value), matrix);
    }

    fn value(&self, wave: FluidWave, matrix: MatrixRef<'_>) -> f64 {
        let (l, m) = wave.wave;
        self.real_mode((l as usize, m as usize), matrix)[usize::from(wave.is_second)]
    }

    fn all(&self, matrix: MatrixRef<'_>) -> Vec<f64> {
        let mut modes = vec![0.0; self.n_modes()];
        self.modes(matrix, &mut modes);
        modes
    }
}

/// The solver of a fluid.
#[derive(Debug)]
pub enum Solver<'s, S> {
    /// Without friction and force.
    Ideal(IsospectralMidpoint<'s, S, Vec<f64>>),
    /// With friction or a force.
    Damped(Damped<'s, S, Vec<f64>>),
}

impl<'s, S: Modes> Solver<'s, S> {
    /// Places the fluid at rest, with its background, its carried fields, its friction and its force; `surface` may
    /// have another size.
    ///
    /// # Errors
    /// Options and numbers that the runtime refuses.
    pub fn new(fluid: &MatrixFluid, surface: &'s S, options: Options) -> Result<Self, Error> {
        let options = options.with_carried(fluid.carried.len());
        let options = if fluid.has_background() { options.with_background() } else { options };
        let room = IsospectralMidpoint::<S, Vec<f64>>::storage(surface.n(), &options);
        let mut ideal = IsospectralMidpoint::new(surface, vec![0.0; room], 0.0, options)?;
        for term in &fluid.background {
            surface.add(term.wave, rational_to_f64(&term.value), ideal.background_mut());
        }
        for (k, field) in fluid.carried.iter().enumerate() {
            if let Some(current) = current(field) {
                ideal.set_current(k, current)?;
            }
            for term in &field.constant {
                surface.add(term.wave, rational_to_f64(&term.value), ideal.constant_current_mut(k));
            }
        }
        if !fluid.is_damped() {
            return Ok(Solver::Ideal(ideal));
        }
        let room = vec![0.0; Damped::<S, Vec<f64>>::storage(surface.n())];
        let mut damped = Damped::new(ideal, friction(fluid), room)?;
        for term in &fluid.force {
            surface.add(term.wave, rational_to_f64(&term.value), damped.force_mut());
        }
        Ok(Solver::Damped(damped))
    }

    /// The fluid, whatever else moves it.
    pub const fn fluid(&self) -> &IsospectralMidpoint<'s, S, Vec<f64>> {
        match self {
            Solver::Ideal(ideal) => ideal,
            Solver::Damped(damped) => damped.fluid(),
        }
    }

    /// The fluid to write its vorticity, and to ask for energy and Casimirs.
    pub const fn fluid_mut(&mut self) -> &mut IsospectralMidpoint<'s, S, Vec<f64>> {
        match self {
            Solver::Ideal(ideal) => ideal,
            Solver::Damped(damped) => damped.fluid_mut(),
        }
    }

    /// The matrix of a field.
    pub fn field(&self, field: FluidField) -> MatrixRef<'_> {
        match field {
            FluidField::Vorticity => self.fluid().vorticity(),
            FluidField::Carried(k) => self.fluid().carried(k),
        }
    }

    /// The matrix of a field to write.
    pub fn field_mut(&mut self, field: FluidField) -> MatrixMut<'_> {
        match field {
            FluidField::Vorticity => self.fluid_mut().vorticity_mut(),
            FluidField::Carried(k) => self.fluid_mut().carried_mut(k),
        }
    }

    /// The Casimirs of the model, and its outputs.
    pub fn casimirs(&mut self, fluid: &MatrixFluid) -> Vec<f64> {
        let mut values = vec![0.0; fluid.casimirs.len()];
        let fields = (0..fluid.carried.len()).map(FluidField::Carried);
        let powers =
            std::iter::once(FluidField::Vorticity).chain(fields).map(|field| FluidTrace::Power(field, 0));
        let crosses = (0..fluid.carried.len()).map(|k| FluidTrace::Cross(k, 0));
        for family in powers.chain(crosses) {
            let of_family = |trace: &FluidTrace| trace.with_power(0) == family;
            let all = fluid.casimirs.iter().map(|casimir| &casimir.trace);
            let most = all.filter(|trace| of_family(trace)).map(FluidTrace::power).max().unwrap_or(0);
            let mut traces = vec![0.0; most];
            match family {
                _ if most == 0 => continue,
                FluidTrace::Power(FluidField::Vorticity, _) => self.fluid_mut().casimirs(&mut traces),
                FluidTrace::Power(FluidField::Carried(k), _) => {
                    self.fluid_mut().carried_casimirs(k, &mut traces)
                }
                FluidTrace::Cross(k, _) => self.fluid_mut().cross_casimirs(k, &mut traces),
            }
            for (value, casimir) in values.iter_mut().zip(&fluid.casimirs) {
                if of_family(&casimir.trace) {
                    *value = rational_to_f64(&casimir.factor) * traces[casimir.trace.power() - 1];
                }
            }
        }
        values
    }

    /// The energy of the model.
    pub fn energy(&mut self) -> f64 {
        self.fluid_mut().energy() / S::ENERGY
    }

    /// The derivative of the vorticity.
    pub fn derivative(&mut self) -> MatrixRef<'_> {
        match self {
            Solver::Ideal(ideal) => ideal.derivative(),
            Solver::Damped(damped) => damped.derivative(),
        }
    }

    /// The derivative of a carried field.
    pub fn carried_derivative(&mut self, k: usize) -> MatrixRef<'_> {
        self.fluid_mut().carried_derivative(k)
    }

    /// Moves the fluid to a time.
    ///
    /// # Errors
    /// A step that does not converge.
    pub fn integrate_to(&mut self, t_end: f64) -> Result<(), Error> {
        match self {
            Solver::Ideal(ideal) => ideal.integrate_to(t_end),
            Solver::Damped(damped) => damped.integrate_to(t_end),
        }
    }
}

/// The exact value of a finite double.
pub fn rational(value: f64) -> Option<Rational> {
    Rational::from_float(value)
}
