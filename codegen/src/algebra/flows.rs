//! Algebras of Fourier modes: Zeitlin's truncation, the Galerkin truncation of the torus, and their action on
//! functions.
//!
//! Deliberately does not know: velocities, energies, dissipation.

use super::lie::{Block, LieAlgebra};
use super::matrix::Matrix;
use super::modes::{Modes, Normal, Wave};
use super::representation::Representation;
use crate::error::Error;
use crate::expr::{Number, Scalar};

/// The algebra whose basis modes are.
fn algebra_of(modes: Modes, name: &str) -> Result<LieAlgebra<Number>, Error> {
    let (basis, brackets) = (modes.labels(), modes.brackets());
    let block = Block { labels: basis.clone(), ..Block::new(name, basis.len()) };
    let algebra = match modes.modulus() {
        Some(_) => LieAlgebra::with_blocks(name, vec![block], basis, &brackets),
        None => LieAlgebra::almost(name, basis, &brackets)
            .map(|algebra| LieAlgebra { blocks: vec![block], ..algebra }),
    };
    let algebra = algebra.map_err(|mut errors| errors.remove(0))?;
    Ok(LieAlgebra { modes: Some(modes), ..algebra })
}

impl LieAlgebra<Number> {
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
        if !(3..=9).contains(&n) || n.is_multiple_of(2) {
            return Err(Error::Unsupported {
                what: name,
                possible: "zeitlin(N) with N = 3, 5, 7 or 9".into(),
            });
        }
        algebra_of(Modes::new(modulus / 2, Some(modulus)), &name)
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
        algebra_of(Modes::new(largest, None), &name)
    }

    /// An algebra of modes in the basis in which components of velocities are the coefficients of vorticity: those of
    /// minus the Laplacian of the stream function.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for other algebras.
    pub fn vorticity(&self) -> Result<LieAlgebra<Number>, Error> {
        let modes = self.modes.clone().ok_or_else(|| Error::Unsupported {
            what: format!("vorticity({})", self.name),
            possible: "an algebra of Fourier modes, zeitlin(N) or torus(K)".into(),
        })?;
        algebra_of(modes.normalised(Normal::Vorticity), &format!("vorticity({})", self.name))
    }
}

impl Representation<Number> {
    /// The action of an algebra of modes on functions: by its bracket, on real and imaginary parts of their
    /// coefficients, for functions on the torus; `-u f'` of a field `u` on the circle. `None` for other algebras.
    pub fn functions(algebra: &LieAlgebra<Number>) -> Option<Representation<Number>> {
        if let Some(modes) = algebra.circle {
            return Some(modes.functions());
        }
        let modes = algebra.modes.as_ref()?;
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
        Some(algebra.circle?.densities())
    }
}

#[cfg(test)]
mod tests {
    use super::super::skew::Bracket;
    use super::*;
    use crate::expr::{Graph, Rational};

    #[test]
    fn sines_satisfy_jacobi_and_truncated_products_do_not() {
        for n in [3, 5, 7, 9] {
            let algebra = LieAlgebra::zeitlin(n).unwrap();
            assert_eq!(algebra.dim(), n * n - 1);
            assert!(!algebra.is_almost() && algebra.brackets().count() > n * n);
            let vorticity = algebra.vorticity().unwrap();
            assert!(vorticity.bracket.jacobi_violations().is_empty());
        }
        assert!(LieAlgebra::zeitlin(4).is_err() && LieAlgebra::zeitlin(11).is_err());
        let torus = LieAlgebra::torus(2).unwrap();
        assert!(torus.is_almost() && torus.rational().is_some());
        assert!(!torus.bracket.jacobi_violations().is_empty());
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
        assert_eq!(algebra.modes().unwrap().squares(), [1, 1, 2, 2, 1, 1, 2, 2]);
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
            let trace = algebra.modes().unwrap().trace_power(&mut g, &x, k).unwrap();
            let expected = g.int(expected);
            let difference = g.sub(trace, expected);
            assert!(g.is_zero(difference), "{n}, {k}");
        }
    }
}
