//! The state within the last step, by the continuous output of the method.
//!
//! Does not know which times are asked for.

use super::Integrator;
use super::norms::{copy, stage_point};
use crate::error::Error;
use crate::methods::{Constant, Derivatives, Method, Step, increments};
use crate::options::signed;
use crate::real::Real;
use crate::system::{StateVector, System};

/// What dense output needs before it can be evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dense {
    /// No step was taken yet.
    NoStep,
    /// The stages of dense output alone have not been computed.
    StagesMissing,
    /// Everything is there.
    Ready,
    /// A failed step has overwritten the stages.
    Lost,
}

impl<R: Real, S: System<R>, M: Method<R, S>> Integrator<'_, R, S, M> {
    /// Writes the state at a time within the last step to `out`.
    ///
    /// The first call in a step computes the stages which the method needs for dense output alone.
    ///
    /// # Errors
    ///
    /// [`Error::OutsideInterval`] unless `t` lies between [`previous_t`](Self::previous_t) and
    /// [`t`](Self::t); [`Error::NoDenseOutput`] after a failed step or a stop at an event; [`Error::Failure`] if a
    /// stage for dense output has no value.
    pub fn interpolate(&mut self, t: R, out: &mut S::State) -> Result<(), Error> {
        self.evaluate_dense(t)?;
        copy(&self.work, out);
        Ok(())
    }

    /// Writes the state at a time within the last step to `work`, which is free between steps.
    pub(super) fn evaluate_dense(&mut self, t: R) -> Result<(), Error> {
        let (here, other) = (usize::from(self.current), usize::from(!self.current));
        if t == self.t {
            copy(&self.points[here].state, &mut self.work);
            return Ok(());
        }
        let (from, to) = (self.t_previous, self.t);
        let inside = (t.all_ge(from) && to.all_ge(t)) || (from.all_ge(t) && t.all_ge(to));
        if !inside {
            return Err(Error::OutsideInterval { t: signed(t), from: signed(from), to: signed(to) });
        }
        match self.dense {
            Dense::Ready | Dense::StagesMissing => {}
            Dense::NoStep | Dense::Lost => return Err(Error::NoDenseOutput { t: signed(self.t) }),
        }
        if t == from {
            copy(&self.points[other].state, &mut self.work);
            return Ok(());
        }
        if self.method.dense_by_steps() {
            return self.step_inside(t);
        }
        if self.dense == Dense::StagesMissing {
            self.complete_dense_stages()?;
        }
        let tableau = self.method.tableau();
        let (start, end) = (&self.points[other], &self.points[here]);
        let stored = M::stages(&self.storage);
        if tableau.is_series() {
            let (out, y) = (self.work.as_mut_slice(), start.state.as_slice());
            let terms = stored.get(1..).unwrap_or_default();
            increments(terms, t - from, y.len(), |c, increment| out[c] = y[c] + increment);
            return Ok(());
        }
        let k = Derivatives { n_stages: tableau.n_stages(), first: &start.slope, stored, last: &end.slope };
        let x = (t - from) / (to - from);
        let rest = R::ONE - x;
        let out = self.work.as_mut_slice();
        out.fill(R::ZERO);
        for &(index, coefficients) in tableau.dense {
            let weight = alternating(coefficients, x, rest);
            for (out, &derivative) in out.iter_mut().zip(k.get(index).as_slice()) {
                *out += weight * derivative;
            }
        }
        let ends = start.state.as_slice().iter().zip(end.state.as_slice());
        let slopes = start.slope.as_slice().iter().zip(end.slope.as_slice());
        for ((out, (&start, &end)), (&first, &last)) in out.iter_mut().zip(ends).zip(slopes) {
            let difference = end - start;
            let (first, last) = (self.h * first, self.h * last);
            let cubic = difference + difference - first - last + rest * (self.h * *out);
            *out = start + x * (difference + rest * (first - difference + x * cubic));
        }
        Ok(())
    }

    /// The end of a shorter step from the start of the last one.
    fn step_inside(&mut self, t: R) -> Result<(), Error> {
        let from = &self.points[usize::from(!self.current)];
        let mut to = self.points[usize::from(self.current)].clone();
        let mut step = Step {
            system: self.system,
            t: self.t_previous,
            h: t - self.t_previous,
            from,
            to: &mut to,
            work: &mut self.work,
            last_h: Some(self.h),
            is_inside: true,
            rhs_evals: &mut self.stats.rhs_evals,
            jacobian_evals: &mut self.stats.jacobian_evals,
        };
        self.method.advance(&mut self.storage, &mut step)?;
        copy(&to.state, &mut self.work);
        self.point_failure(t, &self.work, None).map_or(Ok(()), |failure| Err(failure.into()))
    }

    fn complete_dense_stages(&mut self) -> Result<(), Error> {
        let tableau = self.method.tableau();
        let (end, start) =
            (&self.points[usize::from(self.current)], &self.points[usize::from(!self.current)]);
        let offset = tableau.n_stages() - 1;
        for (index, (row, node)) in tableau.dense_stages.iter().zip(tableau.dense_nodes).enumerate() {
            let (stored, next) = M::stages_mut(&mut self.storage).split_at_mut(offset + index);
            let k = Derivatives { n_stages: offset + 1, first: &start.slope, stored, last: &end.slope };
            stage_point(&k, row, &start.state, self.h, &mut self.work);
            let t = self.t_previous + node.get::<R>() * self.h;
            self.system.rhs(t, &self.work, &mut next[0]);
            self.stats.rhs_evals += 1;
            let stage = &M::stages(&self.storage)[offset + index];
            if let Some(failure) = self.point_failure(t, &self.work, Some(stage)) {
                return Err(failure.into());
            }
        }
        self.dense = Dense::Ready;
        Ok(())
    }
}

/// `d_0 + x (d_1 + rest (d_2 + x (d_3 + ...)))`.
fn alternating<R: Real>(coefficients: &[Constant], x: R, rest: R) -> R {
    let terms = coefficients.iter().enumerate().rev();
    terms.fold(R::ZERO, |sum, (index, d)| sum.mul_add(if index % 2 == 0 { x } else { rest }, d.get()))
}
