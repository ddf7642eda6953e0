//! Random Lie algebras with chains of ideals: named ones, semidirect products, and random changes of basis.

use hamel_expr::Rational;
use hamel_lang::algebra::{LieAlgebra, Matrix, Representation};
use num_traits::Zero;

use crate::draws::Draws;
use crate::linear::{Rows, Vector, dot, identity, int, inverse, product, times, transposed, unit};

/// An algebra and chains `n_1 > n_2 > ..`, each stage an ideal of the one above, by spanning vectors.
#[derive(Clone, Debug)]
pub struct Family {
    /// What it is.
    pub name: &'static str,
    /// The algebra in its own basis.
    pub algebra: LieAlgebra,
    /// Chains of ideals.
    pub chains: Vec<Vec<Rows>>,
}

/// Makes a family, drawing what is random in it.
pub type MakeFamily = fn(&mut Draws) -> Family;

fn family(name: &'static str, algebra: LieAlgebra, chains: &[&[&[usize]]]) -> Family {
    let n = algebra.dim();
    let chains = chains
        .iter()
        .map(|chain| chain.iter().map(|stage| stage.iter().map(|&k| unit(n, k)).collect()).collect());
    let chains = chains.collect();
    Family { name, algebra, chains }
}

fn so3() -> LieAlgebra {
    LieAlgebra::so(3).expect("so(3) exists")
}

fn standard(algebra: &LieAlgebra) -> Representation {
    Representation::standard(algebra).expect("the algebra is given by its defining matrices")
}

fn semidirect(base: &LieAlgebra, spaces: &[Representation]) -> LieAlgebra {
    LieAlgebra::semidirect(base, spaces).expect("the representations are those of the base")
}

/// Representation of the one-dimensional algebra by a matrix.
fn generated_by(d: &[Vector]) -> Representation {
    let matrix = Matrix::from_rows(d).expect("rows have equal lengths");
    Representation::from_matrices("flow", &LieAlgebra::abelian(1), vec![matrix])
        .expect("one matrix commutes with itself")
}

fn se3(_: &mut Draws) -> Family {
    family("se(3)", LieAlgebra::se(3).expect("se(3) exists"), &[&[&[3, 4, 5]]])
}

fn se_2_3(_: &mut Draws) -> Family {
    let space = standard(&so3());
    let algebra = semidirect(&so3(), &[space.clone(), space]);
    family("se_2(3)", algebra, &[&[&[3, 4, 5, 6, 7, 8], &[6, 7, 8]], &[&[3, 4, 5, 6, 7, 8]], &[&[6, 7, 8]]])
}

fn so3_x_plane(_: &mut Draws) -> Family {
    let algebra = LieAlgebra::product(&[so3(), LieAlgebra::abelian(2)]);
    family("so(3) x R^2", algebra, &[&[&[3, 4]], &[&[0, 1, 2]], &[&[3, 4], &[4]], &[&[0, 1, 2, 4], &[4]]])
}

fn heisenberg_1(_: &mut Draws) -> Family {
    family("heisenberg(1)", LieAlgebra::heisenberg(1).expect("it exists"), &[&[&[2]], &[&[1, 2], &[2]]])
}

fn heisenberg_2(_: &mut Draws) -> Family {
    let algebra = LieAlgebra::heisenberg(2).expect("it exists");
    family("heisenberg(2)", algebra, &[&[&[4]], &[&[2, 3, 4], &[4]]])
}

/// Strictly upper triangular 4x4 matrices with the lower central series, from `[E_ij, E_jk] = E_ik`.
fn upper_4(_: &mut Draws) -> Family {
    let basis = ["E12", "E23", "E34", "E13", "E24", "E14"].map(str::to_owned).to_vec();
    let e = |k: usize| vec![(k, int(1))];
    let brackets = [(0, 1, e(3)), (1, 2, e(4)), (0, 4, e(5)), (3, 2, e(5))];
    let algebra = LieAlgebra::from_brackets("upper_4", basis, &brackets).expect("matrices satisfy Jacobi");
    family("upper triangular 4x4", algebra, &[&[&[3, 4, 5], &[5]]])
}

/// `R D |x R^4` with a random block triangular `D`, so that a plane is invariant.
fn flow_4(draws: &mut Draws) -> Family {
    let mut d = draws.matrix(4, 4);
    for row in &mut d[2..] {
        row[0] = int(0);
        row[1] = int(0);
    }
    d[0][1] = draws.non_zero();
    let algebra = semidirect(&LieAlgebra::abelian(1), &[generated_by(&d)]);
    family("R D |x R^4", algebra, &[&[&[1, 2, 3, 4]], &[&[1, 2, 3, 4], &[1, 2]]])
}

/// se(2) with SO(2), R, R: the last stage is an ideal of the one above and not of the algebra.
fn se2_subnormal(_: &mut Draws) -> Family {
    family("se(2)", LieAlgebra::se(2).expect("se(2) exists"), &[&[&[1, 2], &[2]], &[&[1, 2]]])
}

fn sl2_x_vectors(_: &mut Draws) -> Family {
    let sl2 = LieAlgebra::sl(2).expect("sl(2) exists");
    let space = standard(&sl2);
    let algebra = semidirect(&sl2, &[space.clone(), space.dual()]);
    family("sl(2) |x (R^2 + R^2*)", algebra, &[&[&[3, 4, 5, 6], &[5, 6]], &[&[3, 4, 5, 6]]])
}

/// gl(2) is the direct sum of its centre and sl(2), in either order.
fn gl2(_: &mut Draws) -> Family {
    let algebra = LieAlgebra::gl(2).expect("gl(2) exists");
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| unit(4, k));
    let centre = a.iter().zip(&d).map(|(x, y)| x + y).collect::<Vector>();
    let traceless = a.iter().zip(&d).map(|(x, y)| x - y).collect::<Vector>();
    Family { name: "gl(2)", algebra, chains: vec![vec![vec![centre]], vec![vec![traceless, b, c]]] }
}

fn su2_adjoint_coadjoint(_: &mut Draws) -> Family {
    let su2 = LieAlgebra::su(2).expect("su(2) exists");
    let spaces = [Representation::adjoint(&su2), Representation::coadjoint(&su2)];
    let algebra = semidirect(&su2, &spaces);
    family("su(2) |x (adjoint + coadjoint)", algebra, &[&[&[3, 4, 5, 6, 7, 8], &[3, 4, 5]]])
}

fn su2_spinors(draws: &mut Draws) -> Family {
    let su2 = LieAlgebra::su(2).expect("su(2) exists");
    let space = standard(&su2);
    let space = if draws.integer() < 0 { space.dual() } else { space };
    family("su(2) |x spinors", semidirect(&su2, &[space]), &[&[&[3, 4, 5, 6]]])
}

/// All families.
pub const FAMILIES: [MakeFamily; 13] = [
    se3,
    se_2_3,
    so3_x_plane,
    heisenberg_1,
    heisenberg_2,
    upper_4,
    flow_4,
    se2_subnormal,
    sl2_x_vectors,
    gl2,
    su2_adjoint_coadjoint,
    su2_spinors,
    free_so3,
];

/// so(3) has no ideals; it takes part in the tests of equations of motion.
fn free_so3(_: &mut Draws) -> Family {
    family("so(3)", so3(), &[])
}

/// A family in a random basis, with a random inner product that couples everything.
#[derive(Clone, Debug)]
pub struct Transported {
    /// The algebra before, for an independent bracket.
    pub original: LieAlgebra,
    /// Columns are the new basis elements in the old basis.
    pub change: Rows,
    /// Its inverse.
    pub back: Rows,
    /// The algebra in the new basis.
    pub algebra: LieAlgebra,
    /// The chains in the new basis, spanned by random vectors.
    pub chains: Vec<Vec<Rows>>,
    /// Inner product in the new basis.
    pub metric: Rows,
}

impl Transported {
    /// Draws basis and inner product.
    ///
    /// # Panics
    /// When the algebra refuses an invertible change of basis.
    pub fn new(family: &Family, draws: &mut Draws) -> Transported {
        let n = family.algebra.dim();
        let change = draws.invertible(n);
        let back = inverse(&change).expect("L D U is invertible");
        let matrix = Matrix::from_rows(&change).expect("rows have equal lengths");
        let algebra = family.algebra.change_basis(&matrix).expect("the change of basis is invertible");
        let metric = draws.positive_definite(n);
        let metric = product(&transposed(&change), &product(&metric, &change));
        let stage = |rows: &Rows, draws: &mut Draws| {
            let mixed = product(&draws.invertible(rows.len()), rows);
            mixed.iter().map(|v| times(&back, v)).collect::<Rows>()
        };
        let chains = family.chains.iter().map(|chain| chain.iter().map(|rows| stage(rows, draws)).collect());
        let chains = chains.collect();
        Transported { original: family.algebra.clone(), change, back: back.clone(), algebra, chains, metric }
    }

    /// `[x, y]` in the new basis, computed in the old one.
    pub fn bracket(&self, x: &[Rational], y: &[Rational]) -> Vector {
        let old = self.original.bracket_of(&times(&self.change, x), &times(&self.change, y));
        times(&self.back, &old)
    }

    /// Names `n_0, n_1, ..` for a chain.
    pub fn stage_names(chain: &[Rows]) -> Vec<String> {
        (0..=chain.len()).map(|j| format!("n_{j}")).collect()
    }

    /// The inner product of two vectors.
    pub fn inner(&self, x: &[Rational], y: &[Rational]) -> Rational {
        dot(x, &times(&self.metric, y))
    }
}

/// `ad*_xi mu`: component `b` is `<mu, [xi, e_b]> = mu_c C^c_ab xi^a`.
pub fn ad_star(algebra: &LieAlgebra, xi: &[Rational], mu: &[Rational]) -> Vector {
    let n = algebra.dim();
    let component = |b: usize| {
        let mut sum = Rational::zero();
        for (a, x) in xi.iter().enumerate() {
            for (c, q) in algebra.bracket(a, b) {
                sum += x * q * &mu[c];
            }
        }
        sum
    };
    (0..n).map(component).collect()
}

/// A representation of a transported algebra in a random basis of its space: `rho'(e'_a) = Q^-1 P_ba rho(e_b) Q`,
/// with `Q`.
///
/// # Panics
/// Never: `Q` is invertible by construction.
pub fn transported_representation(
    representation: &Representation,
    transported: &Transported,
    draws: &mut Draws,
) -> (Vec<Rows>, Rows) {
    let k = representation.dim();
    let q = draws.invertible(k);
    let q_inverse = inverse(&q).expect("L D U is invertible");
    let generators: Vec<Rows> = (0..representation.n_generators())
        .map(|b| {
            let m = representation.matrix(b);
            (0..k).map(|i| m.row(i).to_vec()).collect()
        })
        .collect();
    let image = |a: usize| {
        let mut sum = vec![vec![Rational::zero(); k]; k];
        for (b, m) in generators.iter().enumerate() {
            for (row, other) in sum.iter_mut().zip(m) {
                for (x, y) in row.iter_mut().zip(other) {
                    *x += &transported.change[b][a] * y;
                }
            }
        }
        product(&q_inverse, &product(&sum, &q))
    };
    ((0..representation.n_generators()).map(image).collect(), q)
}

/// The identity as inner product: the product metric of the named algebras.
pub fn product_metric(algebra: &LieAlgebra) -> Rows {
    identity(algebra.dim())
}
