//! Symmetries of the equations that are left in a scene, and found by numbers: affine point symmetries.
//!
//! A field `Z(y) = S y + b` moves coordinates and advected parameters by functions of themselves, and velocities or
//! momenta among themselves. It is a symmetry where
//!
//! ```text
//! [Z, f] = Df Z - DZ f = 0   and   dI Z = 0
//! ```
//!
//! for whatever depends on positions alone and is kept, `I`, and for the energy unless events change it. Where events
//! act along a motion, it keeps their functions `F` as well, and goes through what they set, `g`:
//!
//! ```text
//! dF Z = 0,   Dg Z(y) = Z(g(y))
//! ```
//!
//! All are linear in the entries of `S` and `b`: the null space of their values at random states. Translations of
//! cyclic coordinates, rotations of a plane with the heading in it, turns of a symmetric body about its axis are such
//! fields.
//!
//! Does not know: what a symmetry is used for.

use hamel_expr::uniform;
use nalgebra::{DMatrix, DVector};

use super::field::{Acting, Field, Part, Point, Values, Variable};

/// Most entries of `S` and `b` that are looked for; beyond, translations alone are.
const MAX_ENTRIES: usize = 400;
/// States beyond the number that determines the entries.
const SPARE_STATES: usize = 6;
/// States tried for each that has values.
const TRIES: usize = 20;
/// Singular values below this part of the largest are zeros: rounding leaves some 1e-14 of it.
const RANK: f64 = 1e-9;

/// A symmetry `Z(y) = S y + b`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Symmetry {
    pub(super) slope: DMatrix<f64>,
    pub(super) shift: DVector<f64>,
}

impl Symmetry {
    pub(super) fn at(&self, y: &DVector<f64>) -> DVector<f64> {
        &self.slope * y + &self.shift
    }

    /// The field in words, such as `x d/dy - y d/dx + d/dtheta`.
    pub(super) fn to_text(&self, names: &[String]) -> String {
        let mut terms: Vec<(f64, String)> = Vec::new();
        for (i, name) in names.iter().enumerate() {
            terms.push((self.shift[i], format!("d/d{name}")));
            for (j, by) in names.iter().enumerate() {
                terms.push((self.slope[(i, j)], format!("{by} d/d{name}")));
            }
        }
        terms.retain(|(factor, _)| *factor != 0.0);
        terms.sort_by_key(|(factor, _)| *factor < 0.0);
        let mut text = String::new();
        for (k, (factor, term)) in terms.iter().enumerate() {
            let sign = match (k, *factor < 0.0) {
                (0, true) => "-",
                (0, false) => "",
                (_, true) => " - ",
                (_, false) => " + ",
            };
            text.push_str(sign);
            if factor.abs() != 1.0 {
                text.push_str(&format!("{:.6} ", factor.abs()));
            }
            text.push_str(term);
        }
        text
    }
}

/// Which entries of `S` and `b` are looked for.
struct Entries {
    n: usize,
    shifts: Vec<usize>,
    slopes: Vec<(usize, usize)>,
}

impl Entries {
    /// Modes are moved by nothing.
    fn new(parts: &[Part]) -> Entries {
        let n = parts.len();
        let moved = || (0..n).filter(|i| parts[*i] != Part::Mode);
        let is_velocity = |i: usize| parts[i] == Part::Velocity;
        let shifts: Vec<usize> = moved().filter(|i| !is_velocity(*i)).collect();
        let all = moved().flat_map(|i| moved().map(move |j| (i, j)));
        let mut slopes: Vec<(usize, usize)> =
            all.filter(|(i, j)| is_velocity(*i) == is_velocity(*j)).collect();
        // A rotation is `x d/dy - y d/dx`.
        slopes.sort_by_key(|(i, j)| i < j);
        let slopes = if shifts.len() + slopes.len() > MAX_ENTRIES { Vec::new() } else { slopes };
        Entries { n, shifts, slopes }
    }

    fn len(&self) -> usize {
        self.shifts.len() + self.slopes.len()
    }

    /// `Z(y)` and `DZ f` where the entry is one and all others are zero: component, `Z`, `DZ f`.
    fn unit(&self, entry: usize, y: &[f64], rates: &[f64]) -> (usize, f64, f64) {
        match entry.checked_sub(self.shifts.len()) {
            None => (self.shifts[entry], 1.0, 0.0),
            Some(k) => {
                let (i, j) = self.slopes[k];
                (i, y[j], rates[j])
            }
        }
    }

    fn symmetry(&self, entries: &[f64]) -> Symmetry {
        let mut found = Symmetry { slope: DMatrix::zeros(self.n, self.n), shift: DVector::zeros(self.n) };
        for (i, entry) in self.shifts.iter().zip(entries) {
            found.shift[*i] = *entry;
        }
        for ((i, j), entry) in self.slopes.iter().zip(&entries[self.shifts.len()..]) {
            found.slope[(*i, *j)] = *entry;
        }
        found
    }
}

/// What a symmetry has to keep.
#[derive(Clone, Debug, Default)]
pub(super) struct Kept {
    /// Invariants by their places.
    pub(super) invariants: Vec<usize>,
    /// Whether there is an energy that is kept.
    pub(super) energy: bool,
}

/// The symmetries at the parameters and inputs of a point, a basis with as few entries as elimination leaves; `kept`
/// says what they have to keep.
pub(super) fn find(field: &Field<'_>, at: &Point, parts: &[Part], kept: &Kept) -> Vec<Symmetry> {
    let entries = Entries::new(parts);
    let (n, n_entries) = (at.y.len(), entries.len());
    if n_entries == 0 {
        return Vec::new();
    }
    let mut states = States { field, at, parts, seed: 1 };
    let mut rows: Vec<Vec<f64>> = Vec::new();
    // Without an energy that says what a symmetry is, only rotations and translations are; in equations of first order
    // for places, products of translations with the momenta, which are affine there, are none.
    if !kept.energy || !parts.contains(&Part::Velocity) {
        rows.extend(rotations_alone(&entries));
    }
    for _ in 0..n_entries / n + SPARE_STATES {
        let Some((point, values, slopes)) = states.next_state() else { return Vec::new() };
        rows.extend(conditions(&entries, kept, &point.y, &values, &slopes));
        rows.extend(conditions_of_events(&entries, field.acting(), &point.y, &values, &slopes));
    }
    let matrix = DMatrix::from_fn(rows.len(), n_entries, |i, j| rows[i][j]);
    // As many rows as columns, with the same singular values.
    let square = if matrix.nrows() > n_entries { matrix.qr().r() } else { matrix };
    let n_rows = n_entries.max(square.nrows());
    let found = square.resize_vertically(n_rows, 0.0).svd(false, true);
    let (sizes, Some(v)) = (found.singular_values, found.v_t) else { return Vec::new() };
    let largest = sizes.max();
    let null: Vec<Vec<f64>> = (0..sizes.len())
        .filter(|k| sizes[*k] <= RANK * largest)
        .map(|k| v.row(k).iter().copied().collect())
        .collect();
    echelon(null).iter().map(|row| entries.symmetry(row)).collect()
}

/// A state, what it has, and the derivatives of that by the state.
type State = (Point, Values<f64>, Vec<Values<f64>>);

/// Some states near a point.
pub(super) fn around(field: &Field<'_>, at: &Point, parts: &[Part]) -> Vec<State> {
    let mut states = States { field, at, parts, seed: 2 };
    (0..SPARE_STATES).filter_map(|_| states.next_state()).collect()
}

/// States near a point at which everything has a value.
struct States<'a, 'b> {
    field: &'a Field<'b>,
    at: &'a Point,
    parts: &'a [Part],
    seed: u64,
}

impl States<'_, '_> {
    fn next_state(&mut self) -> Option<State> {
        let by: Vec<Variable> = (0..self.at.y.len()).map(Variable::State).collect();
        for _ in 0..TRIES {
            let mut point = self.at.clone();
            for (x, part) in point.y.iter_mut().zip(self.parts) {
                let drawn = uniform(&mut self.seed) - 0.5;
                match part {
                    Part::Mode => *x = f64::from(u8::from(drawn > 0.0)),
                    _ => *x += drawn * x.abs().max(1.0),
                }
            }
            let Some(values) = self.field.values(&point).filter(Values::are_finite) else { continue };
            let Some(slopes) = self.field.derivatives(&point, &by) else { continue };
            if slopes.iter().all(Values::are_finite) {
                return Some((point, values, slopes));
            }
        }
        None
    }
}

/// The conditions at a state, a row of coefficients for each, of size one.
fn conditions(
    entries: &Entries,
    kept: &Kept,
    y: &[f64],
    values: &Values<f64>,
    slopes: &[Values<f64>],
) -> Vec<Vec<f64>> {
    let rates = &values.rates;
    let units: Vec<(usize, f64, f64)> = (0..entries.len()).map(|k| entries.unit(k, y, rates)).collect();
    let bracket = |row: usize| -> Vec<f64> {
        let entry = |(i, z, turned): &(usize, f64, f64)| {
            slopes[*i].rates[row] * z - if *i == row { *turned } else { 0.0 }
        };
        units.iter().map(entry).collect()
    };
    let gradient = |of: &dyn Fn(&Values<f64>) -> f64| -> Vec<f64> {
        units.iter().map(|(i, z, _)| of(&slopes[*i]) * z).collect()
    };
    let mut rows: Vec<Vec<f64>> = (0..y.len()).map(bracket).collect();
    rows.extend(kept.invariants.iter().map(|k| gradient(&|by| by.invariants[*k])));
    if kept.energy {
        rows.push(gradient(&|by| by.energy[0]));
    }
    of_size_one(rows)
}

/// The same for events: their functions are kept, and so is what they do.
fn conditions_of_events(
    entries: &Entries,
    acting: &[Acting],
    y: &[f64],
    values: &Values<f64>,
    slopes: &[Values<f64>],
) -> Vec<Vec<f64>> {
    let mut rows = Vec::new();
    for event in acting {
        let units: Vec<(usize, f64, f64)> =
            (0..entries.len()).map(|k| entries.unit(k, y, &values.rates)).collect();
        rows.push(units.iter().map(|(i, z, _)| slopes[*i].events[event.function] * z).collect());
        let (sets, first) = &event.sets;
        if sets.is_empty() {
            continue;
        }
        let mut after = y.to_vec();
        sets.iter().enumerate().for_each(|(k, place)| after[*place] = values.events[first + k]);
        for row in 0..y.len() {
            let set = sets.iter().position(|place| *place == row);
            let entry = |(k, (i, z, _)): (usize, &(usize, f64, f64))| {
                let own = if *i == row { entries.unit(k, &after, &values.rates).1 } else { 0.0 };
                let moved = match set {
                    Some(at) => slopes[*i].events[first + at] * z,
                    None if *i == row => *z,
                    None => 0.0,
                };
                moved - own
            };
            rows.push(units.iter().enumerate().map(entry).collect());
        }
    }
    of_size_one(rows)
}

fn of_size_one(mut rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    for row in &mut rows {
        let size = row.iter().fold(0.0, |max: f64, x| max.max(x.abs()));
        if size > 0.0 {
            row.iter_mut().for_each(|x| *x /= size);
        }
    }
    rows
}

/// That `S` is antisymmetric.
fn rotations_alone(entries: &Entries) -> Vec<Vec<f64>> {
    let first = entries.shifts.len();
    let place = |pair: (usize, usize)| entries.slopes.iter().position(|own| *own == pair);
    let row = |(k, (i, j)): (usize, &(usize, usize))| {
        let mut row = vec![0.0; entries.len()];
        row[first + k] += 1.0;
        row[first + place((*j, *i))?] += 1.0;
        Some(row)
    };
    entries.slopes.iter().enumerate().filter_map(row).collect()
}

/// A basis of the same space in reduced echelon form: translations first, entries of size one.
fn echelon(mut rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n_columns = rows.first().map_or(0, Vec::len);
    let mut done = 0;
    for column in 0..n_columns {
        let Some(best) = (done..rows.len())
            .max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()))
            .filter(|k| rows[*k][column].abs() > 1e-6)
        else {
            continue;
        };
        rows.swap(done, best);
        let pivot = rows[done][column];
        rows[done].iter_mut().for_each(|x| *x /= pivot);
        let own = rows[done].clone();
        for (k, row) in rows.iter_mut().enumerate() {
            let factor = row[column];
            if k != done && factor != 0.0 {
                row.iter_mut().zip(&own).for_each(|(x, y)| *x -= factor * y);
            }
        }
        done += 1;
    }
    for x in rows.iter_mut().flatten() {
        // Small whole numbers are what elimination left of them.
        if (*x - x.round()).abs() < 1e-9 {
            *x = x.round() + 0.0;
        }
    }
    rows
}
