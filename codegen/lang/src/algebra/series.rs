//! Ideals that every Lie algebra has: derived and central series, centre, radical, and a Levi factor beside it.
//!
//! All is exact over the rationals. A subspace is given by a basis, in reduced echelon form so that equal subspaces
//! have equal bases. Does not know: ideals that somebody chose, inner products, what a chain is used for.

use num_traits::{One, Zero};

use hamel_expr::Rational;

use super::lie::LieAlgebra;
use super::matrix::{Matrix, Subspace};

/// A basis of a subspace, in reduced echelon form.
pub type Basis = Vec<Vec<Rational>>;

/// An ideal, and what it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ideal {
    /// Such as `centre` or `derived 2`.
    pub name: String,
    /// Its basis.
    pub basis: Basis,
}

/// The basis in reduced echelon form of what vectors span.
pub fn span(vectors: &[Vec<Rational>]) -> Basis {
    let Some((rows, pivots)) = Matrix::from_rows(vectors).map(|m| m.echelon()) else { return Vec::new() };
    (0..pivots.len()).map(|k| rows.row(k).to_vec()).collect()
}

/// A basis of all `x` with `m x = 0`.
fn kernel(m: &Matrix) -> Basis {
    let (rows, pivots) = m.echelon();
    let free = (0..m.n_columns()).filter(|k| !pivots.contains(k));
    let vectors = free.map(|k| {
        let mut x = vec![Rational::zero(); m.n_columns()];
        x[k] = Rational::one();
        pivots.iter().enumerate().for_each(|(row, pivot)| x[*pivot] = -rows.get(row, k).clone());
        x
    });
    span(&vectors.collect::<Vec<_>>())
}

/// `[a, b]` of two subspaces.
pub fn bracket_of_subspaces(algebra: &LieAlgebra, a: &[Vec<Rational>], b: &[Vec<Rational>]) -> Basis {
    let pairs = a.iter().flat_map(|x| b.iter().map(|y| algebra.bracket_of(x, y)));
    span(&pairs.collect::<Vec<_>>())
}

/// The whole algebra.
fn whole(algebra: &LieAlgebra) -> Basis {
    let n = algebra.dim();
    (0..n)
        .map(|k| (0..n).map(|i| if i == k { Rational::one() } else { Rational::zero() }).collect())
        .collect()
}

/// `a, next(a), next(next(a)), ..` until nothing is left or nothing changes; zero is no part of it.
fn descending(a: Basis, next: impl Fn(&Basis) -> Basis) -> Vec<Basis> {
    let mut series = vec![a];
    loop {
        let last = &series[series.len() - 1];
        let below = next(last);
        if below.is_empty() || below.len() == last.len() {
            return series;
        }
        series.push(below);
    }
}

/// `g > [g, g] > [[g, g], [g, g]] > ..`, down to the last that is not zero.
pub fn derived_series(algebra: &LieAlgebra) -> Vec<Basis> {
    descending(whole(algebra), |a| bracket_of_subspaces(algebra, a, a))
}

/// `g > [g, g] > [g, [g, g]] > ..`, down to the last that is not zero.
pub fn lower_central_series(algebra: &LieAlgebra) -> Vec<Basis> {
    let g = whole(algebra);
    descending(g.clone(), |a| bracket_of_subspaces(algebra, &g, a))
}

/// All elements that commute with all others.
pub fn centre(algebra: &LieAlgebra) -> Basis {
    let n = algebra.dim();
    let mut rows = Vec::with_capacity(n * n);
    for a in 0..n {
        let ad = algebra.ad(a);
        rows.extend((0..n).map(|i| ad.row(i).to_vec()));
    }
    Matrix::from_rows(&rows).map_or_else(Vec::new, |m| kernel(&m))
}

/// The Killing form `tr(ad_x ad_y)`.
pub fn killing_form(algebra: &LieAlgebra) -> Matrix {
    let n = algebra.dim();
    let ads: Vec<Matrix> = (0..n).map(|a| algebra.ad(a)).collect();
    let mut form = Matrix::zeros(n, n);
    for a in 0..n {
        for b in a..n {
            let mut trace = Rational::zero();
            for i in 0..n {
                for j in 0..n {
                    trace += ads[a].get(i, j) * ads[b].get(j, i);
                }
            }
            form.set(a, b, trace.clone());
            form.set(b, a, trace);
        }
    }
    form
}

/// The largest solvable ideal: everything that the Killing form pairs to zero with `[g, g]`.
///
/// # Source
/// Jacobson 1962, Lie algebras, chapter III, theorem 5
pub fn radical(algebra: &LieAlgebra) -> Basis {
    let g = whole(algebra);
    let derived = bracket_of_subspaces(algebra, &g, &g);
    match Matrix::from_rows(&derived).filter(|m| m.n_rows() > 0) {
        Some(derived) => kernel(&derived.times(&killing_form(algebra))),
        None => g,
    }
}

/// A semisimple subalgebra that is a complement of the radical.
///
/// It exists over the rationals (Levi). Elements of any complement are corrected step by step along the derived series
/// of the radical, by linear equations; its basis is that of this way, not of echelon form.
///
/// # Source
/// de Graaf 2000, Lie algebras: theory and algorithms, section 4.13
pub fn levi_factor(algebra: &LieAlgebra) -> Basis {
    let n = algebra.dim();
    let radical = radical(algebra);
    let mut series = descending(radical.clone(), |a| bracket_of_subspaces(algebra, a, a));
    series.push(Vec::new());
    let mut factor = complement(&whole(algebra), &radical);
    let s = factor.len();
    if s == 0 || radical.is_empty() {
        return factor;
    }
    // [x_i, x_j] = c^k_ij x_k modulo the radical.
    let constants: Vec<Vec<Vec<Rational>>> = (0..s)
        .map(|i| {
            let along =
                |j: usize| coordinates(&factor, &radical, &algebra.bracket_of(&factor[i], &factor[j]));
            (0..s).map(along).collect()
        })
        .collect();
    for step in series.windows(2) {
        let (upper, lower) = (complement(&step[0], &step[1]), &step[1]);
        let t = upper.len();
        // Unknowns: y_i = z_ia upper_a. Equations: for i < j, modulo the lower term of the series,
        // [x_i, y_j] - [x_j, y_i] - c^k_ij y_k = c^k_ij x_k - [x_i, x_j].
        let mut rows: Vec<Vec<Rational>> = Vec::new();
        for i in 0..s {
            for j in i + 1..s {
                let mut columns = vec![vec![Rational::zero(); t]; s * t + 1];
                let component = |v: &[Rational]| coordinates(&upper, lower, v);
                for (a, u) in upper.iter().enumerate() {
                    add(
                        &mut columns[j * t + a],
                        &component(&algebra.bracket_of(&factor[i], u)),
                        &Rational::one(),
                    );
                    add(
                        &mut columns[i * t + a],
                        &component(&algebra.bracket_of(&factor[j], u)),
                        &-Rational::one(),
                    );
                    for k in 0..s {
                        let mut unit = vec![Rational::zero(); t];
                        unit[a] = Rational::one();
                        add(&mut columns[k * t + a], &unit, &-constants[i][j][k].clone());
                    }
                }
                let mut defect: Vec<Rational> =
                    algebra.bracket_of(&factor[i], &factor[j]).iter().map(|q| -q).collect();
                for k in 0..s {
                    let scaled: Vec<Rational> = factor[k].clone();
                    add(&mut defect, &scaled, &constants[i][j][k]);
                }
                columns[s * t] = component(&defect);
                rows.extend((0..t).map(|row| columns.iter().map(|column| column[row].clone()).collect()));
            }
        }
        let Some((reduced, pivots)) = Matrix::from_rows(&rows).map(|m| m.echelon()) else { continue };
        let mut z = vec![Rational::zero(); s * t];
        for (row, pivot) in pivots.iter().enumerate().filter(|(_, pivot)| **pivot < s * t) {
            z[*pivot] = reduced.get(row, s * t).clone();
        }
        for i in 0..s {
            for (a, u) in upper.iter().enumerate() {
                add(&mut factor[i], u, &z[i * t + a]);
            }
        }
    }
    debug_assert!(factor.iter().all(|x| x.len() == n));
    factor
}

/// `x += q y`.
fn add(x: &mut [Rational], y: &[Rational], q: &Rational) {
    x.iter_mut().zip(y).for_each(|(x, y)| *x += q * y);
}

/// Vectors of `whole` that span a complement of `part` in it.
fn complement(whole: &[Vec<Rational>], part: &[Vec<Rational>]) -> Basis {
    let mut list = part.to_vec();
    list.extend_from_slice(whole);
    let Some(columns) = Matrix::from_rows(&list).map(|m| m.transposed()) else { return Vec::new() };
    columns.echelon().1.into_iter().filter(|k| *k >= part.len()).map(|k| list[k].clone()).collect()
}

/// Coordinates along `basis` of a vector in the span of `basis` and `rest`.
fn coordinates(basis: &[Vec<Rational>], rest: &[Vec<Rational>], vector: &[Rational]) -> Vec<Rational> {
    let mut list = basis.to_vec();
    list.extend_from_slice(rest);
    list.push(vector.to_vec());
    let mut along = vec![Rational::zero(); basis.len()];
    let Some(columns) = Matrix::from_rows(&list).map(|m| m.transposed()) else { return along };
    let (reduced, pivots) = columns.echelon();
    for (row, pivot) in pivots.iter().enumerate().filter(|(_, pivot)| **pivot < basis.len()) {
        along[*pivot] = reduced.get(row, list.len() - 1).clone();
    }
    along
}

/// Whether `[g, a]` lies in `a`.
pub fn is_ideal(algebra: &LieAlgebra, a: &[Vec<Rational>]) -> bool {
    let Some(inside) = Subspace::new(a) else { return false };
    whole(algebra).iter().all(|x| a.iter().all(|y| inside.contains(&algebra.bracket_of(x, y))))
}

/// Proper ideals, none twice, the larger ones first: terms of both series, of the derived series of the radical, the
/// centre, the radical, and the blocks of the basis that are ideals.
pub fn ideals(algebra: &LieAlgebra) -> Vec<Ideal> {
    let mut found: Vec<Ideal> = Vec::new();
    let mut add = |name: String, basis: Basis| {
        let is_proper = !basis.is_empty() && basis.len() < algebra.dim();
        if is_proper && found.iter().all(|ideal| ideal.basis != basis) {
            found.push(Ideal { name, basis });
        }
    };
    let solvable = radical(algebra);
    add("radical".into(), solvable.clone());
    add("centre".into(), centre(algebra));
    let within = descending(solvable, |a| bracket_of_subspaces(algebra, a, a));
    for (name, series) in [
        ("derived", derived_series(algebra)),
        ("lower central", lower_central_series(algebra)),
        ("derived radical", within),
    ] {
        for (k, term) in series.into_iter().enumerate().skip(1) {
            add(format!("{name} {k}"), term);
        }
    }
    let mut start = 0;
    for block in algebra.blocks() {
        let basis = whole(algebra)[start..start + block.dim].to_vec();
        start += block.dim;
        if is_ideal(algebra, &basis) {
            add(block.name.clone(), basis);
        }
    }
    found.sort_by_key(|ideal| std::cmp::Reverse(ideal.basis.len()));
    found
}

/// Chains `g > n_1 > n_2 > ..` of these [`ideals`], the whole algebra left out: each that is not part of a longer one,
/// at most `limit` of them.
pub fn chains(algebra: &LieAlgebra, limit: usize) -> Vec<Vec<Ideal>> {
    let ideals = ideals(algebra);
    let lies_in = |a: &Ideal, b: &Ideal| {
        let outer = Subspace::new(&b.basis);
        a.basis.len() < b.basis.len() && outer.is_some_and(|outer| a.basis.iter().all(|v| outer.contains(v)))
    };
    // Ideals come with the larger ones first: below each, those that lie in it and in no other one that does.
    let below = |top: Option<usize>| -> Vec<usize> {
        let inside: Vec<usize> =
            (0..ideals.len()).filter(|k| top.is_none_or(|top| lies_in(&ideals[*k], &ideals[top]))).collect();
        let is_largest = |k: &usize| !inside.iter().any(|other| lies_in(&ideals[*k], &ideals[*other]));
        inside.iter().copied().filter(is_largest).collect()
    };
    let mut open: Vec<Vec<usize>> = below(None).into_iter().map(|k| vec![k]).rev().collect();
    let mut list = Vec::new();
    while let Some(chain) = open.pop() {
        let next = below(chain.last().copied());
        if next.is_empty() {
            list.push(chain.into_iter().map(|k| ideals[k].clone()).collect());
        } else {
            open.extend(next.into_iter().rev().map(|k| chain.iter().copied().chain([k]).collect()));
        }
        if list.len() == limit {
            break;
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    fn q(n: i64) -> Rational {
        Rational::from_integer(n.into())
    }

    fn dims(series: &[Basis]) -> Vec<usize> {
        series.iter().map(Vec::len).collect()
    }

    /// Brackets of upper triangular matrices of two rows: `[a, n] = n`, and a multiple of the identity.
    fn triangular() -> LieAlgebra {
        let basis = ["a", "n", "one"].map(str::to_owned).to_vec();
        LieAlgebra::from_brackets("triangular", basis, &[(0, 1, vec![(1, q(1))])]).unwrap()
    }

    /// A basis change with small entries from a seed, invertible.
    fn mixed(algebra: &LieAlgebra, seed: u64) -> LieAlgebra {
        let n = algebra.dim();
        let mut state = seed;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            i64::try_from(state >> 33).unwrap() % 5 - 2
        };
        loop {
            let mut p = Matrix::zeros(n, n);
            for i in 0..n {
                for j in 0..n {
                    p.set(i, j, q(number()));
                }
            }
            if p.rank() == n {
                return algebra.change_basis(&p).unwrap();
            }
        }
    }

    fn is_subalgebra(algebra: &LieAlgebra, a: &[Vec<Rational>]) -> bool {
        let inside = Subspace::new(a).unwrap();
        a.iter().all(|x| a.iter().all(|y| inside.contains(&algebra.bracket_of(x, y))))
    }

    fn known() -> Vec<(LieAlgebra, [Vec<usize>; 2], usize, usize)> {
        let so3 = LieAlgebra::so(3).unwrap();
        let plane = LieAlgebra::abelian(2);
        vec![
            // Dimensions: derived series, lower central series, centre, radical.
            (so3.clone(), [vec![3], vec![3]], 0, 0),
            (LieAlgebra::se(3).unwrap(), [vec![6], vec![6]], 0, 3),
            (LieAlgebra::se(2).unwrap(), [vec![3, 2], vec![3, 2]], 0, 3),
            (LieAlgebra::heisenberg(1).unwrap(), [vec![3, 1], vec![3, 1]], 1, 3),
            (triangular(), [vec![3, 1], vec![3, 1]], 1, 3),
            (LieAlgebra::product(&[so3, plane]), [vec![5, 3], vec![5, 3]], 2, 2),
            (LieAlgebra::gl(2).unwrap(), [vec![4, 3], vec![4, 3]], 1, 1),
        ]
    }

    #[test]
    fn of_known_algebras() {
        for (algebra, [derived, central], n_centre, n_radical) in known() {
            let name = algebra.name();
            for algebra in [algebra.clone(), mixed(&algebra, 7), mixed(&algebra, 8)] {
                assert_eq!(dims(&derived_series(&algebra)), derived, "{name}");
                assert_eq!(dims(&lower_central_series(&algebra)), central, "{name}");
                assert_eq!(centre(&algebra).len(), n_centre, "{name}");
                assert_eq!(radical(&algebra).len(), n_radical, "{name}");
            }
        }
    }

    #[test]
    fn what_is_found_is_an_ideal_and_a_levi_factor_is_a_complement() {
        for (algebra, ..) in known() {
            let name = algebra.name();
            for algebra in [algebra.clone(), mixed(&algebra, 1), mixed(&algebra, 2), mixed(&algebra, 3)] {
                let all = ideals(&algebra);
                assert!(all.iter().all(|ideal| is_ideal(&algebra, &ideal.basis)), "{name}: {all:?}");
                let (solvable, factor) = (radical(&algebra), levi_factor(&algebra));
                assert!(is_subalgebra(&algebra, &factor), "{name}: {factor:?}");
                let both: Vec<_> = solvable.iter().chain(&factor).cloned().collect();
                assert_eq!(span(&both).len(), algebra.dim(), "{name}");
                assert_eq!(solvable.len() + factor.len(), algebra.dim(), "{name}");
            }
        }
    }

    #[test]
    fn chains_go_down_step_by_step() {
        let names = |algebra: &LieAlgebra| -> Vec<Vec<String>> {
            let chains = chains(algebra, 8);
            chains.iter().map(|chain| chain.iter().map(|ideal| ideal.name.clone()).collect()).collect()
        };
        assert_eq!(names(&LieAlgebra::so(3).unwrap()), Vec::<Vec<String>>::new());
        assert_eq!(names(&LieAlgebra::se(3).unwrap()), [["radical"]]);
        assert_eq!(names(&LieAlgebra::heisenberg(1).unwrap()), [["centre"]]);
        let both = LieAlgebra::product(&[LieAlgebra::se(2).unwrap(), LieAlgebra::so(3).unwrap()]);
        for algebra in [both.clone(), mixed(&both, 5)] {
            let all = chains(&algebra, 8);
            assert!(!all.is_empty());
            for chain in &all {
                for pair in chain.windows(2) {
                    let outer = Subspace::new(&pair[0].basis).unwrap();
                    assert!(pair[1].basis.len() < pair[0].basis.len());
                    assert!(pair[1].basis.iter().all(|v| outer.contains(v)));
                }
            }
        }
        assert_eq!(chains(&both, 1).len(), 1);
    }
}
