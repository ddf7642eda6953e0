//! Sums of products over constant tables, as data: what loops run through in the place of straight-line code.
//!
//! Does not know: where the factors come from, which sums are worth a loop.

use std::ops::Range;

use hamel_expr::Number;

/// Bytes of a product in [`Table::places`].
const WIDTH: usize = 6;

/// A constant table of products: `z_k = sum of number * left_i * right_j` over the products of `k`.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(from = "Stored", into = "Stored"))]
pub struct Table {
    /// For each product the places of its left factor, its right factor and its number, two bytes each, the lower one
    /// first: as `hamel_runtime::Products` reads them.
    pub places: Vec<u8>,
    /// For each result the number of products up to and with its own.
    pub ends: Vec<u32>,
    /// Distinct numbers.
    numbers: Vec<Number>,
    /// The same to 31 digits.
    parts: Vec<[f64; 2]>,
}

/// A table as it is stored, without what is computed from the rest.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
struct Stored {
    places: Vec<u8>,
    ends: Vec<u32>,
    numbers: Vec<Number>,
}

#[cfg(feature = "serde")]
impl From<Stored> for Table {
    fn from(Stored { places, ends, numbers }: Stored) -> Table {
        Table::new(places, ends, numbers)
    }
}

#[cfg(feature = "serde")]
impl From<Table> for Stored {
    fn from(Table { places, ends, numbers, .. }: Table) -> Stored {
        Stored { places, ends, numbers }
    }
}

impl PartialEq for Table {
    /// The parts follow from the numbers.
    fn eq(&self, other: &Table) -> bool {
        (&self.places, &self.ends, &self.numbers) == (&other.places, &other.ends, &other.numbers)
    }
}

impl Eq for Table {}

/// A product of a table: places of the factors and of the number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Of the factor on the left, in its vector.
    pub left: usize,
    /// Of the factor on the right, in its vector.
    pub right: usize,
    /// Of the number, among the numbers of the table.
    pub number: usize,
}

impl Table {
    /// A table; see the fields.
    pub fn new(places: Vec<u8>, ends: Vec<u32>, numbers: Vec<Number>) -> Table {
        let parts = numbers.iter().map(Number::parts).collect();
        Table { places, ends, numbers, parts }
    }

    /// The distinct numbers.
    pub fn numbers(&self) -> &[Number] {
        &self.numbers
    }

    /// The numbers to 31 digits.
    pub fn parts(&self) -> &[[f64; 2]] {
        &self.parts
    }

    /// Number of products.
    pub fn n_products(&self) -> usize {
        self.places.len() / WIDTH
    }

    /// What runs through the table.
    pub fn products(&self) -> hamel_runtime::Products<'_> {
        hamel_runtime::Products::new(&self.places, &self.ends, &self.parts)
    }

    /// All products in order.
    pub fn all(&self) -> impl Iterator<Item = Place> + '_ {
        let at = |place: &[u8], k: usize| usize::from(u16::from_le_bytes([place[k], place[k + 1]]));
        let product = move |p: &[u8]| Place { left: at(p, 0), right: at(p, 2), number: at(p, 4) };
        self.places.chunks_exact(WIDTH).map(product)
    }

    /// The products of each result.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| start as usize..*end as usize)
    }

    /// Places of left factors.
    pub(super) fn lefts(&self) -> Vec<usize> {
        self.all().map(|p| p.left).collect()
    }

    /// Places of right factors.
    pub(super) fn rights(&self) -> Vec<usize> {
        self.all().map(|p| p.right).collect()
    }

    /// What is wrong with it in itself.
    pub(super) fn check(&self) -> Result<(), String> {
        let n = self.n_products();
        if self.places.len() != WIDTH * n {
            return Err(format!("a table of {} bytes", self.places.len()));
        }
        if !self.ends.is_sorted() || self.ends.last().is_some_and(|end| *end as usize != n) {
            return Err(format!("the sums of a table do not end with its {n} products"));
        }
        if let Some(place) = self.all().find(|p| p.number >= self.numbers.len()) {
            return Err(format!("number {} of a table does not exist", place.number));
        }
        match self.parts.iter().position(|[hi, lo]| !hi.is_finite() || !lo.is_finite() || *hi == 0.0) {
            Some(k) => Err(format!("number {k} of a table is zero or does not fit an f64")),
            None => Ok(()),
        }
    }

    /// Adds a product to a list of places; none where a place does not fit two bytes.
    pub fn push(places: &mut Vec<u8>, place: Place) -> Option<()> {
        for k in [place.left, place.right, place.number] {
            places.extend(u16::try_from(k).ok()?.to_le_bytes());
        }
        Some(())
    }
}

/// The factors on one side of the products of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Factors {
    /// Components of the state.
    State,
    /// Components of the function's own vector.
    Argument,
    /// The scalars of the function.
    Scalars,
    /// Results of an earlier contraction of the function.
    Contraction(u32),
}

/// A table with the factors of its products.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Products {
    /// Position in the tables of the program.
    pub table: u32,
    /// Left factors.
    pub left: Factors,
    /// Right factors.
    pub right: Factors,
}

/// Several sums of products: the sums of all of its tables, result by result.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Contraction {
    /// Number of results.
    pub n_results: usize,
    /// Number of products of all of its tables.
    pub n_products: usize,
    /// Tables in the order in which they are added.
    pub terms: Vec<Products>,
}
