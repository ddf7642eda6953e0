//! Scenes behind objects, evaluated with numbers that know their error.
//!
//! Deliberately does not know: how states are chosen.

use std::marker::PhantomData;

use hamel_runtime::{Failure, ParamError, Scene, SceneInfo, System};

use hamel_measure::both::Both;

/// A compiled scene.
pub trait Subject: Sync {
    /// Names, defaults and meanings.
    fn info(&self) -> &'static SceneInfo;

    /// Fixes the parameters.
    ///
    /// # Errors
    /// The first condition on the parameters that does not hold.
    fn prepare(&self, params: &[Both]) -> Result<Box<dyn Prepared>, ParamError>;
}

/// A compiled scene with parameters.
pub trait Prepared {
    /// The derivative of the state at `y`.
    fn rhs(&self, t: Both, y: &[Both]) -> Vec<Both>;

    /// All outputs, one after the other, and the energy at the end where the scene has one.
    fn outputs(&self, t: Both, y: &[Both]) -> Vec<Both>;

    /// Says why the right-hand side has no value at a point.
    ///
    /// # Errors
    /// The reason, if the scene knows one.
    fn check(&self, t: Both, y: &[Both]) -> Result<(), Failure>;
}

/// The scene `S`, whose state has `N` components.
#[derive(Debug, Default)]
pub struct Typed<S, const N: usize>(PhantomData<fn() -> S>);

impl<S, const N: usize> Typed<S, N> {
    /// The scene `S`.
    pub fn new() -> Self {
        Typed(PhantomData)
    }
}

impl<S: Scene<Both> + System<Both, State = [Both; N]> + 'static, const N: usize> Subject for Typed<S, N> {
    fn info(&self) -> &'static SceneInfo {
        const { &S::INFO }
    }

    fn prepare(&self, params: &[Both]) -> Result<Box<dyn Prepared>, ParamError> {
        Ok(Box::new(Fixed::<S, N>(S::prepare(params)?)))
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

    fn check(&self, t: Both, y: &[Both]) -> Result<(), Failure> {
        System::check(&self.0, t, array(y))
    }
}
