//! Algebras of functions: Zeitlin's truncations on the torus and on the sphere, the Galerkin truncations of the torus
//! and of the circle, and their action on functions.
//!
//! Deliberately does not know: velocities, energies, dissipation.

use super::circle::{CircleModes, Combination};
use super::functions::Functions;
use super::harmonics::Harmonics;
use super::lie::{Block, LieAlgebra};
use super::matrix::Matrix;
use super::modes::{Modes, Normal, Wave};
use super::representation::Representation;
use hamel_expr::error::Error;
use hamel_expr::{Number, Scalar};

/// The algebra whose basis functions are.
fn algebra_of(functions: Functions, name: &str) -> Result<LieAlgebra<Number>, Error> {
    let (basis, brackets) = (functions.labels(), functions.brackets());
    let block = Block { labels: basis.clone(), ..Block::new(name, basis.len()) };
    let algebra = if functions.is_truncated() {
        LieAlgebra::almost(name, basis, &brackets)
            .map(|algebra| LieAlgebra { blocks: vec![block], ..algebra })
    } else {
        LieAlgebra::with_blocks(name, vec![block], basis, &brackets)
    };
    let algebra = algebra.map_err(|mut errors| errors.remove(0))?;
    Ok(LieAlgebra { functions: Some(functions), ..algebra })
}

impl LieAlgebra<Number> {
    /// Sizes `N` of [`zeitlin`](LieAlgebra::zeitlin): those whose sines have exact zeros.
    pub const TORUS_SIZES: [usize; 8] = [3, 5, 7, 9, 11, 13, 15, 21];

    /// Largest `N` of [`zeitlin_sphere`](LieAlgebra::zeitlin_sphere): a scene of it, 22,000 lines with its table, is
    /// generated in half a minute, one of the next size but one in minutes.
    pub const MAX_SPHERE: usize = 12;

    /// su(N) in the sine basis, Zeitlin's truncation of the functions on the torus, for odd `N`:
    /// `[L_a, L_b] = (N/2 pi) sin(2 pi (a x b)/N) L_{a+b}`, sums of waves modulo `N`.
    ///
    /// Momenta are the real and imaginary parts of the coefficients of vorticity.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for even `N`, for those too small or too large, and for those whose sines have no exact
    /// zeros.
    ///
    /// # Source
    /// Zeitlin 1991, Finite-mode analogs of 2D ideal hydrodynamics
    pub fn zeitlin(n: usize) -> Result<LieAlgebra<Number>, Error> {
        let name = format!("zeitlin({n})");
        let modulus = i64::try_from(n).unwrap_or(i64::MAX);
        if !Self::TORUS_SIZES.contains(&n) {
            return Err(Error::Unsupported {
                what: name,
                possible: "zeitlin(N) with N = 3, 5, 7, 9, 11, 13, 15 or 21".into(),
            });
        }
        algebra_of(Functions::Torus(Modes::new(modulus / 2, Some(modulus))), &name)
    }

    /// su(N) in a basis of spherical harmonics, Zeitlin's truncation of the functions on the sphere, `N` from 2 to 12.
    ///
    /// Functions become Hermitian matrices, coordinates the spin matrices times `2/sqrt(N^2 - 1)`, brackets
    /// `{f, g} = -i sqrt(N^2 - 1)/2 (F G - G F)`. The basis are the real [`Harmonics`], degree by degree; it is
    /// orthonormal in the mean over the sphere, so that momenta are the coefficients of vorticity.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for an `N` too small or too large.
    ///
    /// # Source
    /// Hoppe and Yau 1998, Some properties of matrix harmonics on S^2; Modin and Viviani 2020, A Casimir preserving
    /// scheme for long-time simulation of spherical ideal hydrodynamics
    pub fn zeitlin_sphere(n: usize) -> Result<LieAlgebra<Number>, Error> {
        let name = format!("zeitlin_sphere({n})");
        if !(2..=Self::MAX_SPHERE).contains(&n) {
            let possible = format!("zeitlin_sphere(N) with N from 2 to {}", Self::MAX_SPHERE);
            return Err(Error::Unsupported { what: name, possible });
        }
        algebra_of(Functions::Sphere(Harmonics::new(n)), &name)
    }

    /// The Galerkin truncation to waves of components up to `k` of the functions on the torus with their bracket
    /// `[f, g] = f_x g_y - f_y g_x`: an almost algebra.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a `k` of zero or too large.
    pub fn torus(k: usize) -> Result<LieAlgebra<Number>, Error> {
        let name = format!("torus({k})");
        let largest = i64::try_from(k).unwrap_or(i64::MAX);
        if !(1..=4).contains(&k) {
            return Err(Error::Unsupported { what: name, possible: "torus(K) with K from 1 to 4".into() });
        }
        algebra_of(Functions::Torus(Modes::new(largest, None)), &name)
    }

    /// An algebra of modes in the basis in which components of velocities are the coefficients of vorticity: those of
    /// minus the Laplacian of the stream function.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for other algebras.
    pub fn vorticity(&self) -> Result<LieAlgebra<Number>, Error> {
        let functions = self.functions.clone().and_then(|f| f.normalised(Normal::Vorticity));
        let functions = functions.ok_or_else(|| Error::Unsupported {
            what: format!("vorticity({})", self.name),
            possible: "an algebra of functions, zeitlin(N), zeitlin_sphere(N) or torus(K)".into(),
        })?;
        algebra_of(functions, &format!("vorticity({})", self.name))
    }
}

/// Largest wave of a field on the circle.
const MAX_CIRCLE_WAVE: usize = 12;

impl LieAlgebra<Number> {
    /// Vector fields on the circle up to the wave `k`, with the bracket `[u, v] = u' v - u v'` of the group of its
    /// diffeomorphisms: an almost algebra of dimension `2 k + 1`, the Galerkin truncation.
    ///
    /// Components are the coefficients of `u(x) = c_0 + sum of c_k cos(k x) + s_k sin(k x)`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a `k` of zero or too large.
    ///
    /// # Source
    /// Holm, Marsden 2005, Momentum maps and measure-valued solutions for the EPDiff equation (the bracket)
    pub fn witt(k: usize) -> Result<LieAlgebra<Number>, Error> {
        let name = format!("witt({k})");
        if !(1..=MAX_CIRCLE_WAVE).contains(&k) {
            let possible = format!("witt(K) with K from 1 to {MAX_CIRCLE_WAVE}");
            return Err(Error::Unsupported { what: name, possible });
        }
        let modes = CircleModes { largest: k };
        algebra_of(Functions::Circle(modes), &name)
    }
}

/// Matrices of an action on functions on the circle, `value(a, b)` being what mode `a` makes of mode `b`.
fn on_circle(
    modes: CircleModes,
    name: &str,
    value: impl Fn(usize, usize) -> Combination,
) -> Representation<Number> {
    let n = modes.len();
    let matrix = |a: usize| {
        let mut m = Matrix::zeros(n, n);
        for b in 0..n {
            value(a, b).into_iter().for_each(|(c, q)| m.set(c, b, q.into()));
        }
        m
    };
    Representation::unverified(name, n, (0..n).map(matrix).collect(), modes.labels())
}

/// The action of functions on the sphere on others, by their bracket.
fn on_sphere(harmonics: &Harmonics) -> Representation<Number> {
    let labels = harmonics.labels();
    let n = labels.len();
    let mut matrices = vec![Matrix::zeros(n, n); n];
    let scales: Vec<Number> = harmonics.elements().iter().map(|(l, ..)| harmonics.scale(*l).into()).collect();
    for (a, b, value) in harmonics.of_functions() {
        for (c, q) in value {
            matrices[a].set(c, b, q.times(&scales[a]));
            matrices[b].set(c, a, q.times(&scales[b]).negated());
        }
    }
    Representation::unverified("functions", n, matrices, labels)
}

impl Representation<Number> {
    /// The action of an algebra of modes on functions: by its bracket, on real and imaginary parts of their
    /// coefficients, for functions on the torus, and on those in the basis of harmonics on the sphere; `-u f'` of a
    /// field `u` on the circle. `None` for other algebras.
    pub fn functions(algebra: &LieAlgebra<Number>) -> Option<Representation<Number>> {
        let modes = match algebra.functions.as_ref()? {
            Functions::Circle(modes) => {
                return Some(on_circle(*modes, "functions", |u, f| modes.carried(u, f)));
            }
            Functions::Sphere(harmonics) => return Some(on_sphere(harmonics)),
            Functions::Torus(modes) => modes,
        };
        let elements = modes.elements();
        let matrix = |x: &(Wave, bool)| {
            let scale = Number::from(modes.scale(x.0));
            let mut m = Matrix::zeros(elements.len(), elements.len());
            for (column, y) in elements.iter().enumerate() {
                for ((wave, part), q) in modes.bracket(*x, *y) {
                    m.set(modes.place(wave, part), column, q.times(&scale));
                }
            }
            m
        };
        let matrices = elements.iter().map(matrix).collect();
        Some(Representation::unverified("functions", elements.len(), matrices, modes.labels()))
    }

    /// The action of vector fields on the circle on densities, `-(u rho)'`; `None` for other algebras.
    pub fn densities(algebra: &LieAlgebra<Number>) -> Option<Representation<Number>> {
        let Functions::Circle(modes) = algebra.functions.as_ref()? else { return None };
        Some(on_circle(*modes, "densities", |u, rho| modes.dragged(u, rho)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::skew::Bracket;
    use super::*;
    use hamel_expr::{Graph, Rational};

    #[test]
    fn sines_satisfy_jacobi_and_truncated_products_do_not() {
        for n in [3, 5, 7, 9, 11] {
            let algebra = LieAlgebra::zeitlin(n).unwrap();
            assert_eq!(algebra.dim(), n * n - 1);
            assert!(!algebra.is_almost() && algebra.brackets().count() > n * n);
            let vorticity = algebra.vorticity().unwrap();
            assert!(vorticity.bracket.jacobi_violations().is_empty());
        }
        assert!(LieAlgebra::zeitlin(4).is_err() && LieAlgebra::zeitlin(17).is_err());
        let torus = LieAlgebra::torus(2).unwrap();
        assert!(torus.is_almost() && torus.rational().is_some());
        assert!(!torus.bracket.jacobi_violations().is_empty());
    }

    #[test]
    fn fields_on_the_circle_satisfy_jacobi_as_far_as_they_stay_within_the_truncation() {
        let algebra = LieAlgebra::witt(3).unwrap();
        assert!(algebra.is_almost() && algebra.dim() == 7);
        assert!(!algebra.bracket.jacobi_violations().is_empty());
        // Constant fields and any others have no product beyond them.
        let (turn, cosine) = (algebra.structure_constant(6, 0, 5), algebra.structure_constant(5, 0, 6));
        assert_eq!(
            (turn, cosine),
            (Rational::from_integer(3.into()).into(), Rational::from_integer((-3).into()).into())
        );
        assert!(LieAlgebra::witt(0).is_err() && LieAlgebra::witt(13).is_err());
    }

    #[test]
    fn one_sine_that_is_off_is_found() {
        let algebra = LieAlgebra::zeitlin(5).unwrap();
        let mut brackets: Vec<Bracket<Number>> =
            algebra.brackets().map(|(a, b, value)| (a, b, value.to_vec())).collect();
        let constant = brackets[0].2[0].1.clone();
        brackets[0].2[0].1 = constant.plus(&Rational::new(1.into(), 10_000_000_000_i64.into()).into());
        assert!(LieAlgebra::from_brackets("bent", algebra.basis().to_vec(), &brackets).is_err());
    }

    #[test]
    fn waves_are_named_and_ordered_as_in_the_catalogue() {
        let algebra = LieAlgebra::zeitlin(3).unwrap();
        let names = ["re_0_1", "im_0_1", "re_1_m1", "im_1_m1", "re_1_0", "im_1_0", "re_1_1", "im_1_1"];
        assert_eq!(algebra.basis(), names);
        assert_eq!(algebra.functions().unwrap().squares(), [1, 1, 2, 2, 1, 1, 2, 2]);
    }

    /// `rho([x, y]) = rho(x) rho(y) - rho(y) rho(x)`.
    #[test]
    fn functions_are_a_representation_of_what_has_jacobi() {
        let algebra = LieAlgebra::zeitlin(3).unwrap();
        let r = Representation::functions(&algebra).unwrap();
        let matrices = (0..algebra.dim()).map(|a| r.matrix(a).clone()).collect();
        assert!(Representation::from_matrices("functions", &algebra, matrices).is_ok());
    }

    #[test]
    fn powers_of_a_matrix_are_those_of_its_waves() {
        // W = J_(0,1) + J_(0,-1), the circulant matrix with eigenvalues 2 cos(2 pi j/N): tr W^k/N is a binomial.
        for (n, k, expected) in [(5, 2, 2), (5, 4, 6), (7, 4, 6), (7, 6, 20), (3, 3, 2)] {
            let algebra = LieAlgebra::zeitlin(n).unwrap();
            let mut g = Graph::new();
            let mut x = vec![g.zero(); algebra.dim()];
            x[0] = g.one();
            let trace = algebra.functions().unwrap().trace_power(&mut g, &x, k).unwrap();
            let expected = g.int(expected);
            let difference = g.sub(trace, expected);
            assert!(g.is_zero(difference), "{n}, {k}");
        }
    }
}
