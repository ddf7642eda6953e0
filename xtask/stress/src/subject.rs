//! Scenes behind objects, evaluated with numbers that know their error: compiled ones, and others operation by
//! operation.
//!
//! Deliberately does not know: how states are chosen.

use std::marker::PhantomData;

use hamel_codegen::scene::Interpreter;
use hamel_run::dynamics::Factory;
use hamel_run::info::Info;
use hamel_run::interpreted::Built;
use hamel_runtime::{Scene, System};

use hamel_measure::both::Both;

/// A scene.
pub trait Subject: Sync {
    /// Names, defaults and meanings.
    fn info(&self) -> &Info;

    /// Fixes the parameters; none where a condition on them does not hold.
    fn prepare(&self, params: &[Both]) -> Option<Box<dyn Prepared + '_>>;
}

/// A scene with parameters.
pub trait Prepared {
    /// The derivative of the state at `y`.
    fn rhs(&self, t: Both, y: &[Both]) -> Vec<Both>;

    /// All outputs, one after the other, and the energy at the end where the scene has one.
    fn outputs(&self, t: Both, y: &[Both]) -> Vec<Both>;

    /// Whether the scene knows a reason why the right-hand side has no value at a point.
    fn is_refused(&self, t: Both, y: &[Both]) -> bool;

    /// Whether a point is outside of the domain of the equations, where they may have no value.
    fn is_outside(&self, t: Both, y: &[Both]) -> bool;
}

/// The compiled scene `S`, whose state has `N` components.
#[derive(Debug)]
pub struct Typed<S, const N: usize> {
    info: Info,
    scene: PhantomData<fn() -> S>,
}

impl<S: Scene<Both>, const N: usize> Typed<S, N> {
    /// The scene `S`.
    #[expect(clippy::new_without_default, reason = "nobody asks for a default scene")]
    pub fn new() -> Self {
        Typed { info: Info::of::<Both, S>(), scene: PhantomData }
    }
}

impl<S: Scene<Both> + System<Both, State = [Both; N]> + 'static, const N: usize> Subject for Typed<S, N> {
    fn info(&self) -> &Info {
        &self.info
    }

    fn prepare(&self, params: &[Both]) -> Option<Box<dyn Prepared + '_>> {
        let scene = S::prepare(params).ok()?;
        Some(Box::new(Fixed::<S, N>(scene)))
    }
}

struct Fixed<S, const N: usize>(S);

fn array<const N: usize>(y: &[Both]) -> &[Both; N] {
    y.try_into().expect("state of the scene's dimension")
}

impl<S: Scene<Both> + System<Both, State = [Both; N]>, const N: usize> Prepared for Fixed<S, N> {
    fn rhs(&self, t: Both, y: &[Both]) -> Vec<Both> {
        let mut dy = [Both::default(); N];
        System::rhs(&self.0, t, array(y), &mut dy);
        dy.to_vec()
    }

    fn outputs(&self, t: Both, y: &[Both]) -> Vec<Both> {
        let mut out = vec![Both::default(); S::INFO.n_outputs()];
        self.0.outputs_of(t, array(y), &mut out);
        out.extend(self.0.energy_of(t, array(y)));
        out
    }

    fn is_refused(&self, t: Both, y: &[Both]) -> bool {
        System::check(&self.0, t, array(y)).is_err()
    }

    fn is_outside(&self, t: Both, y: &[Both]) -> bool {
        System::domain(&self.0, t, array(y)).is_err()
    }
}

/// A scene that this process derived.
impl Subject for Built {
    fn info(&self) -> &Info {
        Factory::info(self)
    }

    fn prepare(&self, params: &[Both]) -> Option<Box<dyn Prepared + '_>> {
        let interpreter = self.executable().prepare_over(params).ok()?;
        Some(Box::new(interpreter))
    }
}

impl Prepared for Interpreter<'_, Both> {
    fn rhs(&self, t: Both, y: &[Both]) -> Vec<Both> {
        let mut dy = vec![Both::default(); y.len()];
        Interpreter::rhs(self, t, y, &mut dy);
        dy
    }

    fn outputs(&self, t: Both, y: &[Both]) -> Vec<Both> {
        let mut out = Interpreter::outputs(self, t, y);
        out.extend(self.energy(t, y));
        out
    }

    fn is_refused(&self, t: Both, y: &[Both]) -> bool {
        self.check(t, y).is_err()
    }

    fn is_outside(&self, t: Both, y: &[Both]) -> bool {
        self.domain(t, y).is_err()
    }
}
