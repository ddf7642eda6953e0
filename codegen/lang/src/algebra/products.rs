//! Direct and semidirect products.
//!
//! Deliberately does not know: algebras by name.

use hamel_expr::Scalar;
use hamel_expr::error::Error;

use super::lie::{Block, LieAlgebra};
use super::representation::Representation;
use super::skew::SkewBracket;

impl<Q: Scalar> LieAlgebra<Q> {
    /// The direct product.
    pub fn product(factors: &[LieAlgebra<Q>]) -> LieAlgebra<Q> {
        let names: Vec<&str> = factors.iter().map(|f| f.name.as_str()).collect();
        let mut product = LieAlgebra {
            name: format!("product({})", names.join(", ")),
            blocks: Vec::new(),
            bracket: SkewBracket::default(),
            is_almost: factors.iter().any(LieAlgebra::is_almost),
            functions: None,
        };
        for factor in factors {
            let offset = product.bracket.basis.len();
            product.blocks.extend(factor.blocks.iter().cloned());
            product.bracket.basis.extend((0..factor.dim()).map(|k| format!("e{}", offset + k + 1)));
            for ((a, b), value) in &factor.bracket.brackets {
                let shifted = value.iter().map(|(c, q)| (c + offset, q.clone())).collect();
                product.bracket.brackets.insert((a + offset, b + offset), shifted);
            }
        }
        product
    }

    /// The semidirect product `g |x (V_1 + V_2 + ..)`, `[(x, u), (y, v)] = ([x, y], rho(x) v - rho(y) u)`.
    ///
    /// # Errors
    /// [`Error::ShapeMismatch`] when a representation belongs to an algebra of another dimension.
    pub fn semidirect(base: &LieAlgebra<Q>, spaces: &[Representation<Q>]) -> Result<LieAlgebra<Q>, Error> {
        let names: Vec<&str> = spaces.iter().map(|r| r.name()).collect();
        let mut algebra = base.clone().renamed(&format!("semidirect({}, {})", base.name, names.join(", ")));
        algebra.functions = None;
        for space in spaces {
            if space.n_generators() != base.dim() {
                let what = format!("representation {}", space.name());
                return Err(Error::ShapeMismatch { what, found: space.n_generators(), expected: base.dim() });
            }
            let offset = algebra.bracket.basis.len();
            let labels = space.labels().to_vec();
            algebra.blocks.push(Block { labels, ..Block::new(&format!("R^{}", space.dim()), space.dim()) });
            algebra.bracket.basis.extend((0..space.dim()).map(|k| format!("e{}", offset + k + 1)));
            for a in 0..base.dim() {
                let m = space.matrix(a);
                for v in 0..space.dim() {
                    let column: Vec<(usize, Q)> = (0..space.dim())
                        .filter(|w| !m.get(*w, v).is_zero())
                        .map(|w| (offset + w, m.get(w, v).clone()))
                        .collect();
                    if !column.is_empty() {
                        algebra.bracket.brackets.insert((a, offset + v), column);
                    }
                }
            }
        }
        Ok(algebra)
    }
}
