//! The algebras one knows by name, each from its defining matrices or its textbook brackets.
//!
//! Deliberately does not know: which of the names a model file may use.

use std::collections::BTreeMap;

use num_traits::{One, Zero};

use super::families::{
    MAX_SIZE, galilei_matrices, gl_matrices, sim_matrices, sl_matrices, so_matrices, sp_matrices,
    su_matrices, u_matrices, unit,
};
use super::lie::{Block, LieAlgebra};
use super::matrix::Matrix;
use super::representation::Representation;
use hamel_expr::Rational;
use hamel_expr::error::Error;

/// The entries of a matrix that are not zero.
type Entries = BTreeMap<(usize, usize), Rational>;

fn entries(m: &Matrix) -> Entries {
    let row = |i: usize| m.row(i).iter().enumerate().map(move |(j, x)| ((i, j), x));
    (0..m.n_rows()).flat_map(row).filter(|(_, x)| !x.is_zero()).map(|(at, x)| (at, x.clone())).collect()
}

/// `to += scale * m`.
fn add_scaled(to: &mut Entries, scale: &Rational, m: &Entries) {
    for (at, x) in m {
        let entry = to.entry(*at).or_insert_with(Rational::zero);
        *entry += scale * x;
        if entry.is_zero() {
            to.remove(at);
        }
    }
}

/// `a b - b a`.
fn commutator(a: &Entries, b: &Entries) -> Entries {
    let mut value = Entries::new();
    for ((i, j), x) in a {
        for ((_, k), y) in b.range((*j, 0)..(*j + 1, 0)) {
            *value.entry((*i, *k)).or_insert_with(Rational::zero) += x * y;
        }
    }
    for ((i, j), x) in b {
        for ((_, k), y) in a.range((*j, 0)..(*j + 1, 0)) {
            *value.entry((*i, *k)).or_insert_with(Rational::zero) -= x * y;
        }
    }
    value.retain(|_, x| !x.is_zero());
    value
}

/// The algebra spanned by linearly independent matrices that are closed under commutators.
///
/// Coordinates of a commutator come from the Gram matrix of the basis in the Frobenius inner product.
fn from_matrices(name: &str, matrices: &[Matrix]) -> Result<LieAlgebra, Error> {
    let n = matrices.len();
    let matrices: Vec<Entries> = matrices.iter().map(entries).collect();
    // Who has something where.
    let mut owners: BTreeMap<(usize, usize), Vec<(usize, &Rational)>> = BTreeMap::new();
    for (c, m) in matrices.iter().enumerate() {
        m.iter().for_each(|(at, x)| owners.entry(*at).or_default().push((c, x)));
    }
    // Inner products with the basis that are not zero.
    let products = |m: &Entries| -> BTreeMap<usize, Rational> {
        let mut products: BTreeMap<usize, Rational> = BTreeMap::new();
        for (at, x) in m {
            for (c, y) in owners.get(at).into_iter().flatten() {
                *products.entry(*c).or_insert_with(Rational::zero) += x * *y;
            }
        }
        products
    };
    let mut gram = Matrix::zeros(n, n);
    for (a, m) in matrices.iter().enumerate() {
        products(m).into_iter().for_each(|(b, product)| gram.set(a, b, product));
    }
    let unusable = || Error::Unsupported {
        what: format!("an algebra {name} of matrices that are dependent or not closed under commutators"),
        possible: "independent matrices whose commutators they span".into(),
    };
    let dual = entries(&gram.inverse().ok_or_else(unusable)?);
    let mut brackets = Vec::new();
    for a in 0..n {
        for b in a + 1..n {
            let mut rest = commutator(&matrices[a], &matrices[b]);
            let mut coordinates: BTreeMap<usize, Rational> = BTreeMap::new();
            for (d, product) in products(&rest) {
                // The dual basis has a symmetric Gram matrix.
                for ((_, c), x) in dual.range((d, 0)..(d + 1, 0)) {
                    *coordinates.entry(*c).or_insert_with(Rational::zero) += x * &product;
                }
            }
            coordinates.retain(|_, q| !q.is_zero());
            coordinates.iter().for_each(|(c, q)| add_scaled(&mut rest, &-q, &matrices[*c]));
            if !rest.is_empty() {
                return Err(unusable());
            }
            brackets.push((a, b, coordinates.into_iter().collect()));
        }
    }
    let basis = (1..=n).map(|k| format!("e{k}")).collect();
    LieAlgebra::from_brackets(name, basis, &brackets).map_err(|mut e| e.remove(0))
}

fn sized(family: &str, n: usize, least: usize) -> Result<(), Error> {
    if (least..=MAX_SIZE).contains(&n) {
        return Ok(());
    }
    Err(Error::Unsupported {
        what: format!("{family}({n})"),
        possible: format!("{family}(n) with n from {least} to {MAX_SIZE}"),
    })
}

impl LieAlgebra {
    /// so(n). For `n = 3` the basis is that of R^3 with `[a, b] = a x b`; otherwise `E_ij - E_ji`, `i < j`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 2` or too large.
    pub fn so(n: usize) -> Result<LieAlgebra, Error> {
        sized("so", n, 2)?;
        from_matrices(&format!("so({n})"), &so_matrices(n))
    }

    /// gl(n) in the basis `E_ij`, row-major.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 1` or too large.
    pub fn gl(n: usize) -> Result<LieAlgebra, Error> {
        sized("gl", n, 1)?;
        from_matrices(&format!("gl({n})"), &gl_matrices(n))
    }

    /// sl(n) in the basis `E_ij` (`i != j`, row-major), `E_kk - E_{k+1,k+1}`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 2` or too large.
    pub fn sl(n: usize) -> Result<LieAlgebra, Error> {
        sized("sl", n, 2)?;
        from_matrices(&format!("sl({n})"), &sl_matrices(n))
    }

    /// su(n) in the basis `E_jk - E_kj`, `i(E_jk + E_kj)` (`j < k`), `i(E_kk - E_{k+1,k+1})`: integer constants.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 2` or too large.
    pub fn su(n: usize) -> Result<LieAlgebra, Error> {
        sized("su", n, 2)?;
        from_matrices(&format!("su({n})"), &su_matrices(n))
    }

    /// u(n) in the basis `E_jk - E_kj`, `i(E_jk + E_kj)` (`j < k`), `i E_kk`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 1` or too large.
    pub fn u(n: usize) -> Result<LieAlgebra, Error> {
        sized("u", n, 1)?;
        from_matrices(&format!("u({n})"), &u_matrices(n))
    }

    /// sp(n) for even `n = 2 m`, the matrices `[[A, B], [C, -A^T]]` with symmetric `B` and `C`: entries of `A`
    /// row-major, then upper triangles of `B` and `C` row by row.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for an odd `n`, for `n < 2` or too large.
    pub fn sp(n: usize) -> Result<LieAlgebra, Error> {
        sized("sp", n, 2)?;
        if !n.is_multiple_of(2) {
            let possible = format!("sp(n) with even n from 2 to {MAX_SIZE}");
            return Err(Error::Unsupported { what: format!("sp({n})"), possible });
        }
        from_matrices(&format!("sp({n})"), &sp_matrices(n))
    }

    /// sim(n), similarities of R^n: blocks of rotations, the dilation and translations.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 2` or too large.
    pub fn sim(n: usize) -> Result<LieAlgebra, Error> {
        sized("sim", n, 2)?;
        let name = format!("sim({n})");
        let blocks = [
            Block::new(&format!("so({n})"), n * (n - 1) / 2),
            Block::new("R", 1),
            Block::new(&format!("R^{n}"), n),
        ];
        Ok(LieAlgebra { blocks: blocks.to_vec(), ..from_matrices(&name, &sim_matrices(n))? })
    }

    /// The Galilei algebra of R^n: blocks of rotations, boosts, translations and the translation of time, with
    /// `[boost, time] = translation`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 2` or too large.
    pub fn galilei(n: usize) -> Result<LieAlgebra, Error> {
        sized("galilei", n, 2)?;
        let name = format!("galilei({n})");
        let space = Block::new(&format!("R^{n}"), n);
        let blocks =
            [Block::new(&format!("so({n})"), n * (n - 1) / 2), space.clone(), space, Block::new("R", 1)];
        Ok(LieAlgebra { blocks: blocks.to_vec(), ..from_matrices(&name, &galilei_matrices(n))? })
    }

    /// se(n) = so(n) |x R^n; se(2) has blocks `omega` and `v`, se(3) rotation and translation.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 2` or too large.
    pub fn se(n: usize) -> Result<LieAlgebra, Error> {
        sized("se", n, 2)?;
        let so = LieAlgebra::so(n)?;
        // The generator of so(2) turns counter-clockwise, so that theta_dot = omega: E_21 - E_12.
        let space = if n == 2 {
            let turn = unit(2, 1, 0).minus(&unit(2, 0, 1));
            Representation::from_matrices("standard", &so, vec![turn])?
        } else {
            Representation::from_matrices("standard", &so, so_matrices(n))?
        };
        Ok(LieAlgebra::semidirect(&so, &[space])?.renamed(&format!("se({n})")))
    }

    /// The abelian algebra R^n.
    pub fn abelian(n: usize) -> LieAlgebra {
        let basis = (1..=n).map(|k| format!("e{k}")).collect();
        LieAlgebra::from_brackets(&format!("R^{n}"), basis, &[]).expect("an abelian algebra satisfies Jacobi")
    }

    /// The Heisenberg algebra of dimension `2n + 1`: blocks `q`, `p`, `z` with `[q_k, p_k] = z`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for `n < 1` or too large.
    pub fn heisenberg(n: usize) -> Result<LieAlgebra, Error> {
        sized("heisenberg", n, 1)?;
        let brackets: Vec<_> = (0..n).map(|k| (k, n + k, vec![(2 * n, Rational::one())])).collect();
        let basis = (1..=2 * n + 1).map(|k| format!("e{k}")).collect();
        let blocks = vec![Block::new("q", n), Block::new("p", n), Block::new("z", 1)];
        LieAlgebra::with_blocks(&format!("heisenberg({n})"), blocks, basis, &brackets)
            .map_err(|mut e| e.remove(0))
    }
}
