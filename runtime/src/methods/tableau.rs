//! Coefficients of Runge-Kutta methods with continuous output.
//!
//! Does not know any method, or how stages are computed.

use crate::real::Real;

/// A coefficient of a method with 32 digits: `hi + lo`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Constant {
    /// The coefficient in `f64`.
    pub hi: f64,
    /// What it lacks, for wider scalars.
    pub lo: f64,
}

impl Constant {
    /// The coefficient as a scalar, with the digits that it can hold.
    #[inline(always)]
    #[must_use]
    pub fn get<R: Real>(self) -> R {
        R::from_parts(self.hi, self.lo)
    }
}

/// A [`Constant`], shortly for tables.
pub(crate) const fn c(hi: f64, lo: f64) -> Constant {
    Constant { hi, lo }
}

/// Coefficients `(j, coefficient)` of a sum over stages `j`.
pub type Row = &'static [(usize, Constant)];

/// Coefficients of a Runge-Kutta method of `s` stages with continuous output.
///
/// ```text
/// k_0   = f(t0, y0)
/// k_i   = f(t0 + c_i h, y0 + h sum_j a_ij k_j)     0 < i < s
/// y1    = y0 + h sum_i b_i k_i
/// k_s   = f(t0 + h, y1)                            k_0 of the next step
/// k_i   = f(t0 + c_i h, y0 + h sum_j a_ij k_j)     i > s, for dense output alone
/// error = h sum_i e_i k_i
/// y(x)  = y0 + x (D + (1-x) (h k_0 - D + x (2 D - h k_0 - h k_s + (1-x) h sum_i d_i(x) k_i)))
/// d_i   = d_i0 + x (d_i1 + (1-x) (d_i2 + x (d_i3 + (1-x) (d_i4 + ...))))
/// ```
///
/// with `x = (t - t0)/h` and `D = y1 - y0`: the cubic Hermite interpolant where there is no `d`.
/// Rows list `(j, coefficient)` of the coefficients that are not zero. A method is explicit if `j < i` in every
/// row; collocation methods are written with an explicit first stage of weight zero. A method by series has a name,
/// its least order and no coefficients here; its dense output is the sum of the series.
///
/// # Source
///
/// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), sections II.1, II.6, II.10.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Tableau {
    /// Name of the method in messages.
    pub name: &'static str,
    /// Order of `y1`.
    pub order: u32,
    /// Nodes `c_i`.
    pub nodes: &'static [Constant],
    /// Rows `a_i`; the first is empty.
    pub stages: &'static [Row],
    /// Weights `b_i`.
    pub weights: Row,
    /// Weights of the error estimate.
    pub estimate: Estimate,
    /// Nodes of the stages for dense output.
    pub dense_nodes: &'static [Constant],
    /// Rows of the stages for dense output.
    pub dense_stages: &'static [Row],
    /// Coefficients `d_i0, d_i1, ...` of dense output.
    pub dense: &'static [(usize, &'static [Constant])],
}

impl Tableau {
    /// Takes the place of coefficients in a type whose values are different methods:
    /// [`Method::tableau`](crate::Method::tableau) has the coefficients of each.
    pub const CHOSEN: &'static Tableau = &Tableau {
        name: "chosen",
        order: 0,
        nodes: &[],
        stages: &[],
        weights: &[],
        estimate: Estimate::None,
        dense_nodes: &[],
        dense_stages: &[],
        dense: &[],
    };

    /// Number of stages `s`; `k_s` belongs to the next step.
    #[must_use]
    pub const fn n_stages(&self) -> usize {
        self.stages.len()
    }

    /// Number of stage derivatives to store: `s - 1` and those of dense output.
    #[must_use]
    pub const fn n_stored(&self) -> usize {
        self.stages.len().saturating_sub(1) + self.dense_stages.len()
    }

    /// Whether the method is that of a series instead of stages.
    pub(crate) const fn is_series(&self) -> bool {
        matches!(self.estimate, Estimate::Series)
    }

    /// The rows of weights of the error estimate; empty where there is none.
    #[must_use]
    pub const fn error_weights(&self) -> [Row; 2] {
        match self.estimate {
            Estimate::None | Estimate::Series => [&[], &[]],
            Estimate::Embedded { weights, .. } => [weights, &[]],
            Estimate::Combined { fifth, third, .. } => [fifth, third],
        }
    }

    /// The `q` of the estimate `O(h^q)` of the local error; none without an estimate.
    #[must_use]
    pub const fn estimate_order(&self) -> Option<u32> {
        match self.estimate {
            Estimate::None => None,
            Estimate::Series => Some(self.order),
            Estimate::Embedded { order, .. } | Estimate::Combined { order, .. } => Some(order),
        }
    }
}

/// Estimate of the local error of a step.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Estimate {
    /// None: the method takes fixed steps only.
    None,
    /// The last terms of the series of the solution, known before the step:
    /// [`Method::longest_step`](crate::Method::longest_step).
    Series,
    /// The difference from one embedded method.
    Embedded {
        /// The `q` of an estimate `O(h^q)`.
        order: u32,
        /// Weights `e_i`, the embedded ones subtracted from `b_i` up to a sign.
        weights: Row,
    },
    /// Two estimates combined: `|e5|^2 / sqrt(|e5|^2 + 0.01 |e3|^2)`.
    ///
    /// # Source
    ///
    /// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.10.
    Combined {
        /// The `q` of a combined estimate `O(h^q)`.
        order: u32,
        /// Weights of the estimate of fifth order.
        fifth: Row,
        /// Weights of the estimate of third order.
        third: Row,
    },
}
