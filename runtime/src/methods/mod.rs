//! The methods, each a tableau of constants and a way to compute its stages; the one stepping loop drives them.
//!
//! The module deliberately does not know how steps are chosen. Tableaux have 32 digits, in two parts: `f64` uses the
//! first part alone, [`DoubleDouble`](crate::DoubleDouble) both. Digits beyond those of the sources are the solution of
//! the order conditions next to the printed numbers (Newton's iteration, least correction); the tests below check all
//! conditions to the last of these digits.

mod dop853;
mod dopri5;
mod explicit;
mod gauss;
mod projected;
mod rk4;
mod taylor;
mod tsit5;
mod vern9;

pub use dop853::Dop853;
pub use dopri5::Dopri5;
pub use gauss::{FixedPoint, Gauss, Gauss4, Gauss6, Gauss8, Newton};
pub use projected::{Invariants, Projected, Projection};
pub use rk4::Rk4;
pub use taylor::Taylor;
pub(crate) use taylor::increments;
pub use tsit5::Tsit5;
pub use vern9::Vern9;

use crate::error::Error;
use crate::options::{Norm, Options};
use crate::real::Real;
use crate::system::{StateVector, System};

/// A one-step method with continuous output for a system `S`: of Runge and Kutta, or of the series of the solution.
///
/// A method computes the stages or coefficients and the new state of one step. Everything else, such as time, step
/// sizes, errors, dense output, events and counts, is the work of the [`Integrator`](crate::Integrator), which is the
/// same for all methods.
pub trait Method<R: Real, S: System<R>>: Copy {
    /// Coefficients of the method; without stages for a series.
    const TABLEAU: &'static Tableau;

    /// What the method keeps from one step to the next.
    type Storage;

    /// Says whether the method can integrate with these options.
    ///
    /// # Errors
    ///
    /// [`Error::Order`] of methods of any order.
    fn validate(&self, _options: &Options<R>) -> Result<(), Error> {
        Ok(())
    }

    /// Storage for an integration with valid options that starts at the state `y0` at time `t0`.
    fn storage(&self, system: &S, t0: R, y0: &S::State, options: &Options<R>) -> Self::Storage;

    /// The stage derivatives: `k_1` to `k_(s-1)`, then those for dense output alone; of a series its coefficients, from
    /// the state at the start of the step to the last order.
    ///
    /// # Shapes
    ///
    /// \[[`Tableau::n_stored`]\], \[order + 1\] of a series; `k_0` and `k_s` are the [`Point::slope`] of the two ends
    /// of the step.
    fn stages(storage: &Self::Storage) -> &[S::State];

    /// [`stages`](Self::stages) for writing.
    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State];

    /// The longest step from a point that is accurate, as far as the method knows before it takes the step; asked once
    /// before each adaptive step.
    ///
    /// Most methods know none, which is infinity, and are judged by their error after the step.
    #[inline]
    fn longest_step(&self, _storage: &mut Self::Storage, _start: Start<'_, R, S>) -> f64 {
        f64::INFINITY
    }

    /// Computes the stages `k_1` to `k_(s-1)`, or the series, the new state and what it lacks.
    ///
    /// Values that are not finite are passed on: the integrator looks for them.
    ///
    /// # Errors
    ///
    /// [`Error::NotConverged`] of implicit methods.
    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error>;
}

/// An end of a step.
#[derive(Clone, Debug)]
pub struct Point<V> {
    /// The state, rounded.
    pub state: V,
    /// What the sum `state` lacks.
    pub residue: V,
    /// The derivative there; methods by series do without, beyond the first point.
    pub slope: V,
}

/// The start of a step whose size is to be chosen, as a method sees it.
#[derive(Debug)]
pub struct Start<'a, R: Real, S: System<R>> {
    /// The system that is integrated.
    pub system: &'a S,
    /// Time at the start.
    pub t: R,
    /// The start; its slope is complete for methods with stages.
    pub point: &'a Point<S::State>,
    /// The tolerances of the components there.
    pub tolerances: Tolerances<'a, S::State>,
    /// The norm of scaled components that is to be at most one.
    pub norm: Norm,
    /// Space for one state.
    pub work: &'a mut S::State,
    /// Count of evaluations of the right-hand side, to be kept up to date.
    pub rhs_evals: &'a mut u64,
}

/// The tolerances of the components over a step, or at a point, in which their errors are measured.
///
/// ```text
/// tolerance_i = atol_i + rtol_i max(|a_i|, |b_i|)
/// ```
///
/// Errors are multiplied by the reciprocals of the tolerances. Where one of them leaves the range of the scalar, as with
/// states around 1e-300, state and error are brought into the middle of the range by a power of two first: results do
/// not depend on the scale of the state.
#[derive(Clone, Copy, Debug)]
pub struct Tolerances<'a, V> {
    pub(crate) rtol: &'a V,
    pub(crate) atol: &'a V,
    /// The states at both ends of the step.
    pub(crate) ends: [&'a V; 2],
    /// Reciprocals of the tolerances, as far as they are finite.
    pub(crate) reciprocals: &'a V,
}

impl<V> Tolerances<'_, V> {
    /// A value of the component `c` in units of its tolerance.
    #[inline(always)]
    pub fn scaled<R: Real>(&self, c: usize, value: R) -> R
    where
        V: StateVector<R>,
    {
        let scaled = value * self.reciprocals.as_slice()[c];
        if scaled.all_finite() { scaled } else { self.scaled_within_range(c, value) }
    }

    #[cold]
    #[inline(never)]
    pub(crate) fn scaled_within_range<R: Real>(&self, c: usize, value: R) -> R
    where
        V: StateVector<R>,
    {
        let larger = larger(self.ends[0].as_slice()[c], self.ends[1].as_slice()[c]);
        let unit = R::from_f64(middle_of_range::<R>(larger.magnitude()));
        // A component may be zero where its absolute tolerance is; its error is to be zero then.
        let least = R::from_f64(R::MIN_POSITIVE);
        let tolerance =
            self.rtol.as_slice()[c].mul_add(larger * unit, self.atol.as_slice()[c] * unit) + least;
        value * unit / tolerance
    }
}

/// The larger absolute value, on every lane.
#[inline(always)]
pub(crate) fn larger<R: Real>(a: R, b: R) -> R {
    let (half, a, b) = (R::from_f64(0.5), a.abs(), b.abs());
    // Halves are summed, as the sum of two large numbers may not exist.
    half * a + half * b + half * (a - b).abs()
}

/// The power of two that brings numbers of a size into the middle of the range of a scalar; one for most.
fn middle_of_range<R: Real>(size: f64) -> f64 {
    // An even power of two in every scalar, or twice one: its root is within a factor two of a power of two.
    let root = f64::from_bits(crate::math::sqrt(R::MIN_POSITIVE).to_bits() & (0x7ff << 52));
    if size < root {
        1.0 / root
    } else if size > 1.0 / root {
        root
    } else {
        1.0
    }
}

/// One trial step, as a method sees it.
#[derive(Debug)]
pub struct Step<'a, R: Real, S: System<R>> {
    /// The system that is integrated.
    pub system: &'a S,
    /// Time at the start.
    pub t: R,
    /// Size, signed.
    pub h: R,
    /// The start, complete.
    pub from: &'a Point<S::State>,
    /// The end: `state` and `residue` are to be computed. Before, it is the start of the last step if `last_h` says
    /// so.
    pub to: &'a mut Point<S::State>,
    /// Space for one state.
    pub work: &'a mut S::State,
    /// Size of the last step, if `to` and the stored stages are still those of the step that led to `from`.
    pub last_h: Option<R>,
    /// Count of evaluations of the right-hand side, to be kept up to date.
    pub rhs_evals: &'a mut u64,
    /// Count of evaluations of the Jacobian, to be kept up to date.
    pub jacobian_evals: &'a mut u64,
}

/// A coefficient of a method with 32 digits: `hi + lo`.
#[derive(Clone, Copy, Debug, PartialEq)]
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

    /// The rows of weights of the error estimate.
    pub(crate) const fn error_weights(&self) -> [Row; 2] {
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
    /// The last terms of the series of the solution, known before the step: [`Method::longest_step`].
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

/// The stage derivatives of a step by index: of both ends, and those stored between.
pub(crate) struct Derivatives<'a, V> {
    pub(crate) n_stages: usize,
    pub(crate) first: &'a V,
    pub(crate) stored: &'a [V],
    pub(crate) last: &'a V,
}

impl<'a, V> Derivatives<'a, V> {
    /// `k_index`, by a choice that vanishes where the index is a constant.
    #[inline(always)]
    pub(crate) fn get(&self, index: usize) -> &'a V {
        if index == 0 {
            self.first
        } else if index < self.n_stages {
            &self.stored[index - 1]
        } else if index == self.n_stages {
            self.last
        } else {
            &self.stored[index - 2]
        }
    }

    /// Calls `put(c, sum_j row_j k_j[c])` for the components `c < n` in order.
    ///
    /// Sums of several components are formed side by side, so that they are vectorised without knowing where `put`
    /// writes; straight-line code where the row and `n` are constants.
    #[inline(always)]
    pub(crate) fn for_each_sum<R: Real>(
        &self,
        row: &[(usize, Constant)],
        n: usize,
        mut put: impl FnMut(usize, R),
    ) where
        V: StateVector<R>,
    {
        let mut c = 0;
        self.sum_blocks::<R, 8>(row, n, &mut c, &mut put);
        self.sum_blocks::<R, 4>(row, n, &mut c, &mut put);
        self.sum_blocks::<R, 2>(row, n, &mut c, &mut put);
        self.sum_blocks::<R, 1>(row, n, &mut c, &mut put);
    }

    #[inline(always)]
    fn sum_blocks<R: Real, const WIDTH: usize>(
        &self,
        row: &[(usize, Constant)],
        n: usize,
        start: &mut usize,
        put: &mut impl FnMut(usize, R),
    ) where
        V: StateVector<R>,
    {
        while n - *start >= WIDTH {
            let mut sums = [R::ZERO; WIDTH];
            for (term, &(index, weight)) in row.iter().enumerate() {
                let k = &self.get(index).as_slice()[*start..*start + WIDTH];
                let weight: R = weight.get();
                for (sum, &k) in sums.iter_mut().zip(k) {
                    *sum = if term == 0 { weight * k } else { weight.mul_add(k, *sum) };
                }
            }
            for (lane, sum) in sums.into_iter().enumerate() {
                put(*start + lane, sum);
            }
            *start += WIDTH;
        }
    }
}

/// The rounded sum and its rounding error: `a + b = sum + residue` exactly.
#[inline(always)]
pub(crate) fn two_sum<R: Real>(a: R, b: R) -> (R, R) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

/// `to + its residue = from + its residue + h sum_j b_j k_j`.
#[inline(always)]
pub(crate) fn compensated_advance<R: Real, V: StateVector<R>>(
    (from, to): (&Point<V>, &mut Point<V>),
    h: R,
    weights: &[(usize, Constant)],
    k: &Derivatives<'_, V>,
) {
    let (y, residue) = (from.state.as_slice(), from.residue.as_slice());
    let (out, out_residue) = (to.state.as_mut_slice(), to.residue.as_mut_slice());
    k.for_each_sum(weights, y.len(), |c, slope| {
        (out[c], out_residue[c]) = two_sum(y[c], h.mul_add(slope, residue[c]));
    });
}

/// Square of the norm of scaled components; NaN if one is.
#[inline(always)]
pub(crate) fn square_of_norm<R: Real>(norm: Norm, components: &[R]) -> f64 {
    match norm {
        Norm::Rms => {
            // Two sums side by side wait half as long for their additions.
            let square = |x: R| x.magnitude() * x.magnitude();
            let mut pairs = components.chunks_exact(2);
            let mut sums = [0.0, 0.0];
            for pair in &mut pairs {
                sums[0] += square(pair[0]);
                sums[1] += square(pair[1]);
            }
            let last: f64 = pairs.remainder().iter().map(|&x| square(x)).sum();
            (sums[0] + sums[1] + last) / components.len().max(1) as f64
        }
        Norm::Max => {
            let sizes = components.iter().map(|x| x.magnitude());
            let max = sizes.fold(0.0, |max: f64, x| if x.is_nan() || x > max { x } else { max });
            max * max
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::{
        Constant, Dop853, Dopri5, Estimate, FixedPoint, Gauss4, Gauss6, Gauss8, Method, Rk4, Row, Tableau,
        Tsit5, Vern9, c,
    };
    use crate::system::System;
    use crate::{DoubleDouble, Real};

    struct Nothing;

    impl System<f64> for Nothing {
        type State = [f64; 0];
        fn rhs(&self, _t: f64, _y: &[f64; 0], _dy: &mut [f64; 0]) {}
    }

    const fn tableau<M: Method<f64, Nothing>>() -> &'static Tableau {
        M::TABLEAU
    }

    const TABLEAUX: [&Tableau; 8] = [
        tableau::<Rk4>(),
        tableau::<Dopri5>(),
        tableau::<Tsit5>(),
        tableau::<Dop853>(),
        tableau::<Vern9>(),
        tableau::<Gauss4<FixedPoint>>(),
        tableau::<Gauss6<FixedPoint>>(),
        tableau::<Gauss8<FixedPoint>>(),
    ];
    const N_EXPLICIT: usize = 5;

    /// A rooted tree: the index of each of its root's children in the list of all trees.
    struct Tree {
        order: usize,
        density: f64,
        children: Vec<usize>,
    }

    /// All rooted trees up to an order, smaller ones first.
    fn rooted_trees(max_order: usize) -> Vec<Tree> {
        let mut trees = vec![Tree { order: 1, density: 1.0, children: vec![] }];
        for order in 2..=max_order {
            let mut forests = vec![];
            let mut partial = vec![(vec![], order - 1)];
            // Forests are sorted by tree, so that each is met once.
            while let Some((children, left)) = partial.pop() {
                if left == 0 {
                    forests.push(children);
                    continue;
                }
                let smallest = children.last().copied().unwrap_or(0);
                for (next, tree) in trees.iter().enumerate().skip(smallest) {
                    if tree.order <= left {
                        let mut children = children.clone();
                        children.push(next);
                        partial.push((children, left - tree.order));
                    }
                }
            }
            for children in forests {
                let density =
                    order as f64 * children.iter().map(|&child| trees[child].density).product::<f64>();
                trees.push(Tree { order, density, children });
            }
        }
        trees
    }

    #[test]
    fn numbers_of_rooted_trees_are_known() {
        let trees = rooted_trees(10);
        let counts: Vec<_> = (1..=10).map(|n| trees.iter().filter(|tree| tree.order == n).count()).collect();
        assert_eq!(counts, [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]);
    }

    /// The rows of all stored stages, the one shared with the next step included.
    fn rows(tableau: &Tableau) -> Vec<(Constant, Row)> {
        let stages = tableau.nodes.iter().copied().zip(tableau.stages.iter().copied());
        let extra = tableau.dense_nodes.iter().copied().zip(tableau.dense_stages.iter().copied());
        stages.chain([(c(1.0, 0.0), tableau.weights)]).chain(extra).collect()
    }

    fn sum<R: Real>(terms: impl Iterator<Item = R>) -> R {
        terms.fold(R::ZERO, |sum, term| sum + term)
    }

    /// Elementary weights `Phi_i` of every tree at every stage.
    fn elementary_weights<R: Real>(tableau: &Tableau, trees: &[Tree]) -> Vec<Vec<R>> {
        let rows = rows(tableau);
        let mut all: Vec<Vec<R>> = vec![];
        for tree in trees {
            let weight = |row: Row| {
                let child = |&child: &usize| sum(row.iter().map(|&(j, a)| a.get::<R>() * all[child][j]));
                tree.children.iter().map(child).fold(R::ONE, |product, factor| product * factor)
            };
            let weights = rows.iter().map(|(_, row)| weight(row)).collect();
            all.push(weights);
        }
        all
    }

    /// The largest defect of the conditions `sum_i w_i Phi_i(tree) = x^order / density` of an order.
    fn defect<R: Real>(
        tableau: &Tableau,
        weights: &[(usize, R)],
        orders: core::ops::RangeInclusive<usize>,
        target: impl Fn(usize, f64) -> R,
    ) -> f64 {
        let trees = rooted_trees(*orders.end());
        let elementary = elementary_weights::<R>(tableau, &trees);
        let defects = trees.iter().zip(&elementary).filter(|(tree, _)| orders.contains(&tree.order)).map(
            |(tree, elementary)| {
                let sum = sum(weights.iter().map(|&(i, w)| w * elementary[i]));
                (sum - target(tree.order, tree.density)).magnitude()
            },
        );
        defects.fold(0.0, f64::max)
    }

    fn values<R: Real>(row: Row) -> Vec<(usize, R)> {
        row.iter().map(|&(i, w)| (i, w.get())).collect()
    }

    #[test]
    fn rows_sum_to_nodes() {
        fn check<R: Real>() {
            for (position, tableau) in TABLEAUX.into_iter().enumerate() {
                assert_eq!(tableau.nodes.len(), tableau.stages.len());
                assert_eq!(tableau.dense_nodes.len(), tableau.dense_stages.len());
                for (index, (node, row)) in rows(tableau).into_iter().enumerate() {
                    let sum = sum(row.iter().map(|&(_, a)| a.get::<R>()));
                    let size: f64 = row.iter().map(|&(_, a)| a.hi.abs()).sum();
                    let bound = 4.0 * R::EPSILON * size.max(1.0);
                    let defect = (sum - node.get()).magnitude();
                    assert!(defect <= bound, "{} stage {index}: {defect:e}", tableau.name);
                    let explicit = row.iter().all(|&(j, _)| j < index);
                    let collocated = 0 < index && index < tableau.n_stages() && position >= N_EXPLICIT;
                    assert_eq!(explicit, !collocated, "{} stage {index}", tableau.name);
                }
            }
        }
        check::<f64>();
        check::<DoubleDouble>();
    }

    /// Bounds on defects: sums over products of up to nine coefficients, of a size up to 12 (Tsit5), 43 (Dop853), 36 (Vern9);
    /// dense coefficients are up to 530 (Dop853) and 1340 (Vern9).
    const ROUND_OFF: f64 = 2e-14;
    const DENSE_ROUND_OFF: f64 = 1e-13;
    /// The same with all digits.
    const FULL_ROUND_OFF: f64 = 1e-30;

    #[test]
    fn weights_satisfy_order_conditions() {
        fn check<R: Real>(bound: f64) {
            for tableau in TABLEAUX {
                let order = tableau.order as usize;
                let exact = |_, density| R::ratio(1.0, density);
                let weights = values::<R>(tableau.weights);
                let met = defect(tableau, &weights, 1..=order, exact);
                assert!(met < bound, "{}: {met:e}", tableau.name);
                let missed = defect(tableau, &weights, order + 1..=order + 1, exact);
                assert!(missed > 1e-9, "{}: order higher than stated, {missed:e}", tableau.name);
            }
        }
        check::<f64>(ROUND_OFF);
        check::<DoubleDouble>(FULL_ROUND_OFF);
    }

    #[test]
    fn first_parts_of_coefficients_do_not_satisfy_order_conditions_to_all_digits() {
        // What the second parts are for: a tableau of `f64` is wrong by round-off of `f64`, whatever the scalar.
        for tableau in TABLEAUX.into_iter().filter(|tableau| tableau.name != "rk4") {
            let first = |&(i, w): &(usize, Constant)| (i, DoubleDouble::from(w.hi));
            let weights: Vec<_> = tableau.weights.iter().map(first).collect();
            let exact = |_, density| DoubleDouble::ratio(1.0, density);
            let order = tableau.order as usize;
            let missed = defect(tableau, &weights, 1..=order, exact);
            assert!(missed > 1e-18 || tableau.name == "gauss4", "{}: {missed:e}", tableau.name);
        }
    }

    #[test]
    fn parts_of_coefficients_do_not_overlap() {
        for tableau in TABLEAUX {
            let mut all: Vec<Constant> =
                rows(tableau).iter().flat_map(|(_, row)| row.iter().map(|x| x.1)).collect();
            all.extend(tableau.nodes.iter().chain(tableau.dense_nodes));
            all.extend(tableau.dense.iter().flat_map(|(_, row)| row.iter()));
            all.extend(tableau.error_weights().iter().flat_map(|row| row.iter().map(|x| x.1)));
            for Constant { hi, lo } in all {
                // Half a place, and a little where the first part is another author's rounding.
                assert!(lo.abs() <= 0.75 * f64::EPSILON * hi.abs(), "{}: {hi:e} {lo:e}", tableau.name);
            }
        }
    }

    #[test]
    fn estimates_have_their_order() {
        // An estimate O(h^q) vanishes on all trees of an order below q, and not on all of the order q.
        fn check<R: Real>(tableau: &Tableau, weights: Row, q: usize, bound: f64) {
            let (zero, weights) = (|_, _| R::ZERO, values::<R>(weights));
            let met = defect(tableau, &weights, 1..=q - 1, zero);
            assert!(met < bound, "{} estimate of order {q}: {met:e}", tableau.name);
            let missed = defect(tableau, &weights, q..=q, zero);
            assert!(missed > 1e-6, "{} estimate of order {q}: {missed:e}", tableau.name);
        }
        fn check_both(tableau: &Tableau, weights: Row, q: usize) {
            check::<f64>(tableau, weights, q, ROUND_OFF);
            check::<DoubleDouble>(tableau, weights, q, FULL_ROUND_OFF);
        }
        for tableau in TABLEAUX {
            match tableau.estimate {
                Estimate::Series => panic!("{} has no stages", tableau.name),
                Estimate::None => assert!(tableau.name == "rk4" || tableau.name.starts_with("gauss")),
                Estimate::Embedded { order, weights } => check_both(tableau, weights, order as usize),
                Estimate::Combined { order, fifth, third } => {
                    // |e5|^2 / |e3| with e5 = O(h^6) and e3 = O(h^4).
                    assert_eq!(order, 2 * 6 - 4);
                    check_both(tableau, fifth, 6);
                    check_both(tableau, third, 4);
                }
            }
        }
    }

    /// Weights of the stages in the dense output at `x`, by the formula of [`Tableau`].
    fn dense_weights<R: Real>(tableau: &Tableau, x: R) -> Vec<(usize, R)> {
        let rest = R::ONE - x;
        let mut weights = vec![R::ZERO; tableau.n_stored() + 2];
        let difference = x * (R::ONE - rest + (rest + rest) * x);
        for &(i, b) in tableau.weights {
            weights[i] += difference * b.get();
        }
        weights[0] += x * rest * (R::ONE - x);
        weights[tableau.n_stages()] -= x * rest * x;
        for &(i, coefficients) in tableau.dense {
            let factors = [x, rest].into_iter().cycle();
            let (mut power, mut sum) = (R::ONE, R::ZERO);
            for (d, factor) in coefficients.iter().zip(factors) {
                sum += d.get::<R>() * power;
                power *= factor;
            }
            weights[i] += x * rest * x * rest * sum;
        }
        weights.into_iter().enumerate().collect()
    }

    #[test]
    fn dense_output_satisfies_order_conditions() {
        fn check<R: Real>(bound: f64) {
            for (tableau, order) in TABLEAUX.into_iter().zip([3, 4, 4, 7, 9, 4, 5, 6]) {
                for x in [0.1, 0.35, 0.55, 0.8, 0.95_f64] {
                    let x = R::from_f64(x);
                    let exact = |order: usize, density| {
                        (0..order).fold(R::ratio(1.0, density), |product, _| product * x)
                    };
                    let weights = dense_weights(tableau, x);
                    let met = defect(tableau, &weights, 1..=order, exact);
                    assert!(met < bound, "{} at {x:?}: {met:e}", tableau.name);
                    let missed = defect(tableau, &weights, order + 1..=order + 1, exact);
                    assert!(missed > 1e-9, "{} at {x:?}: {missed:e}", tableau.name);
                }
            }
        }
        check::<f64>(DENSE_ROUND_OFF);
        check::<DoubleDouble>(FULL_ROUND_OFF);
    }

    #[test]
    fn dense_output_of_tsit5_is_the_published_interpolant() {
        // Coefficients of x^2 and x^3 of the weights; those of x^4 are in the tableau.
        let published = [
            (-2.763_706_197_274_826, 2.913_255_461_821_912_6),
            (0.1317, -0.2234),
            (3.930_296_236_894_751_6, -5.941_033_872_131_505),
            (-12.411_077_166_933_676, 30.338_188_630_282_32),
            (37.509_313_416_511_04, -88.178_904_894_766_4),
            (-27.896_526_289_197_286, 65.091_894_674_793_66),
            (1.5, -4.0),
        ];
        let tableau = tableau::<Tsit5>();
        for x in [0.2, 0.5, 0.9_f64] {
            for ((i, weight), (square, cube)) in dense_weights(tableau, x).into_iter().zip(published) {
                let fourth = tableau.dense[i].1[0].hi;
                let linear = if i == 0 { 1.0 } else { 0.0 };
                let expected = x * (linear + x * (square + x * (cube + x * fourth)));
                assert!((weight - expected).abs() < 1e-14, "weight {i} at {x}: {weight} and {expected}");
            }
        }
    }
}
