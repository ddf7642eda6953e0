//! Groups of matrices whose motion can be reconstructed, and their semidirect products with the spaces they act on.
//!
//! Does not know: how a group is written in a model, its equations.

use std::fmt;

use super::layout::{GroupBlock, Layout};
use crate::algebra::{LieAlgebra, Matrix, Representation};
use hamel_expr::Rational;
use hamel_expr::error::Error;

/// A family of matrix groups, one for each number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatrixFamily {
    /// Rotations of R^n.
    SpecialOrthogonal,
    /// Rotations and translations of R^n.
    Euclidean,
    /// Unitary matrices with determinant one.
    SpecialUnitary,
    /// Unitary matrices.
    Unitary,
    /// Matrices that have an inverse.
    GeneralLinear,
    /// Matrices with determinant one.
    SpecialLinear,
    /// Matrices that keep the symplectic form of R^n, n even.
    Symplectic,
}

impl MatrixFamily {
    /// All, by the way they are written.
    pub const NAMED: [(&'static str, MatrixFamily); 7] = [
        ("SO", MatrixFamily::SpecialOrthogonal),
        ("SE", MatrixFamily::Euclidean),
        ("SU", MatrixFamily::SpecialUnitary),
        ("U", MatrixFamily::Unitary),
        ("GL", MatrixFamily::GeneralLinear),
        ("SL", MatrixFamily::SpecialLinear),
        ("Sp", MatrixFamily::Symplectic),
    ];

    /// As it is written.
    pub fn name(self) -> &'static str {
        MatrixFamily::NAMED.iter().find(|(_, family)| *family == self).map_or("", |(name, _)| name)
    }

    /// Whether the entries are complex numbers.
    pub fn is_complex(self) -> bool {
        matches!(self, MatrixFamily::SpecialUnitary | MatrixFamily::Unitary)
    }
}

/// A space that a group acts on, in a semidirect product with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatrixSpace {
    /// That of its matrices, real and imaginary parts in turn where these are complex.
    Standard,
    /// R^n, which it leaves alone.
    Trivial(usize),
}

/// A matrix group in its standard representation, with the spaces of a semidirect product.
///
/// Coordinates are the entries of the matrix row by row, those of the real part and then those of the imaginary one
/// where they are complex, and the vectors of the spaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MatrixGroup {
    family: MatrixFamily,
    n: usize,
    /// Those that the model writes, without that of a Euclidean group.
    spaces: Vec<MatrixSpace>,
    algebra: LieAlgebra,
    matrices: Vec<Matrix>,
}

/// What the matrices `g` of a group keep.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum KeptForm {
    /// `g M g^T = M`, by its matrix; of complex matrices, as real ones of twice the size.
    Bilinear(Matrix),
    /// `det g`.
    Volume,
}

impl MatrixGroup {
    /// A group of `n x n` matrices, or its semidirect product with spaces.
    ///
    /// # Errors
    /// [`Error::Unsupported`] where there is none of that size.
    pub fn new(family: MatrixFamily, n: usize, spaces: &[MatrixSpace]) -> Result<MatrixGroup, Error> {
        let base = match family {
            MatrixFamily::SpecialOrthogonal | MatrixFamily::Euclidean => LieAlgebra::so(n),
            MatrixFamily::SpecialUnitary => LieAlgebra::su(n),
            MatrixFamily::Unitary => LieAlgebra::u(n),
            MatrixFamily::GeneralLinear => LieAlgebra::gl(n),
            MatrixFamily::SpecialLinear => LieAlgebra::sl(n),
            MatrixFamily::Symplectic => LieAlgebra::sp(n),
        }?;
        let is_euclidean = family == MatrixFamily::Euclidean;
        let standard = Representation::standard(&base).ok_or_else(|| Error::Unsupported {
            what: format!("matrices of {}", base.name()),
            possible: "those of so, su, u, gl, sl and sp".into(),
        })?;
        // The algebra se(2) turns counter-clockwise.
        let standard = match is_euclidean && n == 2 {
            true => standard.reversed(&base)?,
            false => standard,
        };
        let all = is_euclidean.then_some(MatrixSpace::Standard).into_iter().chain(spaces.iter().copied());
        let representations: Vec<Representation> = all
            .map(|space| match space {
                MatrixSpace::Standard => standard.clone(),
                MatrixSpace::Trivial(dim) => Representation::trivial(&base, dim),
            })
            .collect();
        let algebra = match representations.is_empty() {
            true => base.clone(),
            false => LieAlgebra::semidirect(&base, &representations)?,
        };
        let matrices = (0..base.dim()).map(|a| standard.matrix(a).clone()).collect();
        Ok(MatrixGroup { family, n, spaces: spaces.to_vec(), algebra, matrices })
    }

    /// The family of its matrices.
    pub fn family(&self) -> MatrixFamily {
        self.family
    }

    /// Number of rows of its matrices.
    pub fn n(&self) -> usize {
        self.n
    }

    /// How many blocks of coordinates are matrices: one, or those of real and imaginary parts.
    pub fn n_blocks(&self) -> usize {
        if self.family.is_complex() { 2 } else { 1 }
    }

    /// As a configuration has it: `SO(3)`, where `reconstruct` says `matrices(SO(3))`.
    pub fn of_configuration(&self) -> String {
        let written = self.to_string();
        let inner = written.strip_prefix("matrices(").and_then(|inner| inner.strip_suffix(')'));
        inner.unwrap_or(&written).to_owned()
    }

    /// Whether its matrices are rotations.
    pub fn is_of_rotations(&self) -> bool {
        matches!(self.family, MatrixFamily::SpecialOrthogonal | MatrixFamily::Euclidean)
    }

    /// Its algebra.
    pub fn algebra(&self) -> &LieAlgebra {
        &self.algebra
    }

    /// The matrices of the elements of the algebra that no space belongs to, as real ones: a complex number `a + ib` is
    /// the block `[[a, -b], [b, a]]`.
    pub fn matrices(&self) -> &[Matrix] {
        &self.matrices
    }

    /// The spaces in order, with their dimensions.
    pub fn spaces(&self) -> Vec<(MatrixSpace, usize)> {
        let own = (self.family == MatrixFamily::Euclidean).then_some(MatrixSpace::Standard);
        let all = own.into_iter().chain(self.spaces.iter().copied());
        let size = self.matrices.first().map_or(0, Matrix::n_rows);
        all.map(|space| match space {
            MatrixSpace::Standard => (space, size),
            MatrixSpace::Trivial(dim) => (space, dim),
        })
        .collect()
    }

    /// What its matrices keep beside having an inverse; none where that is all.
    pub fn kept_form(&self) -> Option<KeptForm> {
        let size = self.matrices.first().map_or(0, Matrix::n_rows);
        match self.family {
            MatrixFamily::SpecialOrthogonal
            | MatrixFamily::Euclidean
            | MatrixFamily::SpecialUnitary
            | MatrixFamily::Unitary => Some(KeptForm::Bilinear(Matrix::identity(size))),
            MatrixFamily::Symplectic => {
                let mut form = Matrix::zeros(size, size);
                let one = Rational::from_integer(1.into());
                for i in 0..size / 2 {
                    form.set(i, size / 2 + i, one.clone());
                    form.set(size / 2 + i, i, -one.clone());
                }
                Some(KeptForm::Bilinear(form))
            }
            MatrixFamily::SpecialLinear => Some(KeptForm::Volume),
            MatrixFamily::GeneralLinear => None,
        }
    }

    /// Names of the coordinates by block: one name for the matrix and one for each space; nothing when there are too
    /// many or too few.
    pub(super) fn coordinates(&self, names: &[&str]) -> Option<Vec<GroupBlock>> {
        let (matrix, vectors) = names.split_first()?;
        let spaces = self.spaces();
        if vectors.len() != spaces.len() {
            return None;
        }
        let square = |name: String| GroupBlock {
            of: 0,
            components: Layout::Matrix(self.n, self.n).names(&name),
            name,
            n_columns: Some(self.n),
        };
        let mut blocks = match self.family.is_complex() {
            true => ["re", "im"].map(|part| square(format!("{matrix}_{part}"))).to_vec(),
            false => vec![square((*matrix).to_owned())],
        };
        for (k, (name, (_, dim))) in vectors.iter().zip(spaces).enumerate() {
            let components = match dim {
                1 => vec![(*name).to_owned()],
                _ => Layout::Vector(dim).names(name),
            };
            blocks.push(GroupBlock { of: k + 1, name: (*name).to_owned(), components, n_columns: None });
        }
        Some(blocks)
    }

    pub(super) fn example(&self) -> String {
        let vectors: Vec<String> = match self.spaces().len() {
            1 => vec![", r".into()],
            several => (1..=several).map(|k| format!(", r{k}")).collect(),
        };
        format!("for example `reconstruct R{} in {self};`", vectors.concat())
    }
}

impl fmt::Display for MatrixGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let base = format!("{}({})", self.family.name(), self.n);
        let is_rigid = matches!(self.family, MatrixFamily::SpecialOrthogonal | MatrixFamily::Euclidean);
        match self.spaces.is_empty() {
            // Smaller ones have other coordinates by that name.
            true if is_rigid && self.n <= 3 => return write!(f, "matrices({base})"),
            true => return f.write_str(&base),
            false => {}
        }
        let spaces: Vec<String> = self
            .spaces
            .iter()
            .map(|space| match space {
                MatrixSpace::Standard => "standard".to_owned(),
                MatrixSpace::Trivial(dim) => format!("trivial({dim})"),
            })
            .collect();
        write!(f, "semidirect({base}, {})", spaces.join(", "))
    }
}
