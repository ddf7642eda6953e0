//! Taylor coefficients of the solutions of a scene.
//!
//! Does not know: the recurrence, step sizes.

use hamel_program::program::{Jet, Run, SeriesRoom};

use super::Interpreter;

impl Interpreter<'_> {
    /// Taylor coefficients of the solution through a state, by the recurrence of
    /// [`BuiltScene::jet`](crate::scene::BuiltScene::jet).
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series(&self, jet: &Jet, t: f64, y: &[f64], out: &mut [&mut [f64]]) {
        jet.series(&self.params, &self.prepared, t, y, out);
    }

    /// The same where the inputs are polynomials in time, as [`Jet::series_with`] takes them, whatever they are held
    /// at.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series_with(&self, jet: &Jet, (t, y): (f64, &[f64]), u: &[Vec<f64>], out: &mut [&mut [f64]]) {
        jet.series_with((&self.params, &self.prepared), (t, y), u, out);
    }

    /// The same by whoever runs the program of the recurrence, as [`Jet::series_by`].
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series_by(
        &self,
        (jet, run): (&Jet, &dyn Run<f64>),
        room: &mut SeriesRoom,
        point: (f64, &[f64]),
        u: Option<&[Vec<f64>]>,
        out: &mut [&mut [f64]],
    ) {
        jet.series_by(run, room, (&self.params, &self.prepared), point, u, out);
    }
}
