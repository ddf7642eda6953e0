//! Turns of a body in angles: fields `cos(a) d/db`, `cos(a) cot(b) d/da`, `cos(a)/sin(b) d/dc` and their like, of which
//! Euler's and Cardan's angles have three that make `so(3)` with a cyclic angle `a`.
//!
//! They move three coordinates freely where the angles are regular. The cross-section is one regular point, and what
//! commutes with them reconstructs the angles: `qdot = sum_c xi^c W_c(q)`, `[Z_a, W_c] = 0`, `W_c = Z_c` at the
//! section.
//!
//! Source: Marsden and Ratiu 1999, section 15.3.
//!
//! Does not know: how a model is reduced.

use std::collections::BTreeSet;

use hamel_expr::{ExprId, Func, Rational};
use hamel_lang::spec::Domain;
use num_traits::{One, Zero};

use super::group::GroupField;
use super::search::{Coefficients, Kept};
use super::setting::{Generator, Images, Setting};

/// `T(a) s d/dq`, by coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TurnedField {
    /// The angle `a`.
    pub(super) by: usize,
    /// Whether `T` is the cosine, or else the sine.
    pub(super) is_cosine: bool,
    /// `s`.
    pub(super) slope: Slope,
    /// The coordinate that moves.
    pub(super) along: usize,
}

/// How fast a coordinate moves, by another angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slope {
    One,
    Cotangent(usize),
    Tangent(usize),
    Cosecant(usize),
    Secant(usize),
}

/// More angles have too many fields to be looked at.
const MAX_ANGLES: usize = 4;

/// `so(3)` on three angles.
#[derive(Clone)]
pub(super) struct AngleGroup {
    /// `Z_c`, which move one of the coordinates each at the section.
    pub(super) fields: Vec<GroupField>,
    /// The coordinates of these.
    pub(super) coordinates: Vec<usize>,
    /// Their values at the section.
    pub(super) values: Vec<ExprId>,
    /// `W_c` on the coordinates, by `c`; empty where they were not found.
    pub(super) body: Vec<Vec<ExprId>>,
}

impl Setting<'_> {
    fn angles(&self) -> Vec<usize> {
        let is_angle = |i: &usize| self.model.base[*i].domain != Domain::Real;
        (0..self.model.base.len()).filter(is_angle).collect()
    }

    /// Fields that turn by an angle, which the kinetic energy does not contain.
    pub(super) fn turned_fields(&mut self) -> Vec<TurnedField> {
        let angles = self.angles();
        if !(2..=MAX_ANGLES).contains(&angles.len()) {
            return Vec::new();
        }
        let mut list = Vec::new();
        for a in angles.iter().copied() {
            if !self.is_angle(a) {
                continue;
            }
            let slope = self.graph.diff(self.kinetic, self.model.base[a].symbol);
            if self.graph.is_zero(slope) {
                list.extend(fields_by(a, &angles));
            }
        }
        list
    }

    /// `T(a) s`.
    fn speed(&mut self, field: &TurnedField) -> ExprId {
        let of = |s: &mut Self, f: Func, i: usize| {
            let q = s.graph.sym(s.model.base[i].symbol);
            s.graph.func(f, q)
        };
        let phase = of(self, if field.is_cosine { Func::Cos } else { Func::Sin }, field.by);
        let (up, down) = match field.slope {
            Slope::One => return phase,
            Slope::Cotangent(b) => (of(self, Func::Cos, b), of(self, Func::Sin, b)),
            Slope::Tangent(b) => (of(self, Func::Sin, b), of(self, Func::Cos, b)),
            Slope::Cosecant(b) => (self.graph.one(), of(self, Func::Sin, b)),
            Slope::Secant(b) => (self.graph.one(), of(self, Func::Cos, b)),
        };
        let product = self.graph.mul(phase, up);
        // A sine of a symbol is no zero.
        self.graph.div(product, down).unwrap_or(phase)
    }

    /// A turned field in words.
    pub(super) fn turned_in_words(&self, field: &TurnedField) -> String {
        let name = |i: usize| &self.model.base[i].name;
        let phase = if field.is_cosine { "cos" } else { "sin" };
        let slope = match field.slope {
            Slope::One => String::new(),
            Slope::Cotangent(b) => format!("/tan({})", name(b)),
            Slope::Tangent(b) => format!("*tan({})", name(b)),
            Slope::Cosecant(b) => format!("/sin({})", name(b)),
            Slope::Secant(b) => format!("/cos({})", name(b)),
        };
        format!("{phase}({}){slope} d/d{}", name(field.by), name(field.along))
    }

    /// The images under a turned field: coordinates, velocities and displacements.
    pub(super) fn images_of_turned(&mut self, field: &TurnedField) -> Images {
        let speed = self.speed(field);
        let mut images = Images::from([(self.model.base[field.along].symbol, speed)]);
        for all in [self.velocities.clone(), self.displacements.clone()] {
            let rates: Images = (self.model.base.iter().zip(&all))
                .map(|(coordinate, y)| (coordinate.symbol, self.graph.sym(*y)))
                .collect();
            let rate = self.graph.derivative_along(speed, &rates);
            images.insert(all[field.along], rate);
        }
        images
    }

    /// `so(3)` on three angles that keeps the kinetic energy, with a turn about an axis of space that keeps everything.
    pub(super) fn angle_group(&mut self) -> Option<AngleGroup> {
        let everything = self.everything();
        let known = self.symmetries(&everything);
        let kinetic = Kept { functions: vec![self.kinetic], equations: Vec::new() };
        for c in known {
            let mut there = (0..c.len()).filter(|j| !c[*j].is_zero());
            let (Some(j), None) = (there.next(), there.next()) else { continue };
            let Generator::Translation(a) = self.generators[j] else { continue };
            let own: Vec<usize> = (0..self.generators.len())
                .filter(|j| matches!(self.generators[*j], Generator::Turned(f) if f.by == a))
                .collect();
            let pair = self.symmetries_among(&own, &kinetic);
            let [first, _] = pair.as_slice() else { continue };
            if let Some(group) = self.turns_of(a, &c, first) {
                return Some(group);
            }
        }
        None
    }

    /// The group of `X_1`, `X_2 = [d/da, X_1]` and `d/da`, where it is `so(3)` and acts freely on three angles.
    fn turns_of(&mut self, a: usize, about: &Coefficients, first: &Coefficients) -> Option<AngleGroup> {
        let second = self.turned_further(first)?;
        let all = [first.clone(), second, about.clone()];
        let mut moved: BTreeSet<usize> = BTreeSet::from([a]);
        for (generator, q) in self.generators.iter().zip(first) {
            if let (Generator::Turned(field), false) = (generator, q.is_zero()) {
                moved.insert(field.along);
            }
        }
        let coordinates: Vec<usize> = moved.into_iter().collect();
        if coordinates.len() != 3 {
            return None;
        }
        let images: Vec<Images> = all.iter().map(|c| self.field(c)).collect();
        let (values, inverse) = self.regular_point(&coordinates, &images)?;
        let mut fields = Vec::new();
        for (row, i) in inverse.iter().zip(&coordinates) {
            let mut coefficients = vec![Rational::zero(); self.generators.len()];
            for (q, c) in row.iter().zip(&all) {
                coefficients.iter_mut().zip(c).for_each(|(sum, c)| *sum += q * c);
            }
            let images = self.field(&coefficients);
            // A coordinate of an interval has no translation.
            let moves = |g: &Generator| match *g {
                Generator::Translation(of) | Generator::Turned(TurnedField { along: of, .. }) => of == *i,
                _ => false,
            };
            let pivot = self.generators.iter().rposition(moves)?;
            fields.push(GroupField { coefficients, images, pivot });
        }
        let mut group = AngleGroup { fields, coordinates, values, body: Vec::new() };
        // [Z_1, Z_2] = -Z_3 in one of both orders.
        if !self.is_of_turns(&group) {
            group.fields.swap(0, 1);
            group.coordinates.swap(0, 1);
            group.values.swap(0, 1);
            if !self.is_of_turns(&group) {
                return None;
            }
        }
        group.body = self.body_fields(&group).unwrap_or_default();
        Some(group)
    }

    fn is_of_turns(&mut self, group: &AngleGroup) -> bool {
        let fields: Vec<Images> = group.fields.iter().map(|f| f.images.clone()).collect();
        (0..3).all(|a| {
            let bracket = self.bracket(&fields[a], &fields[(a + 1) % 3]);
            let third = self.on_coordinates(&fields[(a + 2) % 3]);
            bracket.into_iter().zip(third).all(|(x, y)| {
                let sum = self.graph.add(x, y);
                self.graph.is_zero(sum)
            })
        })
    }

    /// `[d/da, X]`: sines for cosines.
    fn turned_further(&self, c: &Coefficients) -> Option<Coefficients> {
        let mut result = vec![Rational::zero(); c.len()];
        for (generator, q) in self.generators.iter().zip(c).filter(|(_, q)| !q.is_zero()) {
            let Generator::Turned(field) = generator else { return None };
            let other = TurnedField { is_cosine: !field.is_cosine, ..*field };
            let at = self.position(Generator::Turned(other))?;
            result[at] = if field.is_cosine { -q.clone() } else { q.clone() };
        }
        Some(result)
    }

    /// Values of the coordinates, zero or a right angle, where the fields have numbers that make an invertible matrix;
    /// with its inverse, rows by coordinate.
    fn regular_point(
        &mut self,
        coordinates: &[usize],
        fields: &[Images],
    ) -> Option<(Vec<ExprId>, Vec<Vec<Rational>>)> {
        let half = Rational::new(1.into(), 2.into());
        let pi = self.graph.pi();
        let right = self.graph.scale(pi, &half);
        let choices = [self.graph.zero(), right];
        for k in 0..1usize << coordinates.len() {
            let values: Vec<ExprId> = (0..coordinates.len()).map(|d| choices[k >> d & 1]).collect();
            if let Some(inverse) = self.inverse_at(coordinates, &values, fields) {
                return Some((values, inverse));
            }
        }
        None
    }

    fn inverse_at(
        &mut self,
        coordinates: &[usize],
        values: &[ExprId],
        fields: &[Images],
    ) -> Option<Vec<Vec<Rational>>> {
        let at: Images =
            coordinates.iter().zip(values).map(|(i, e)| (self.model.base[*i].symbol, *e)).collect();
        for (i, value) in coordinates.iter().zip(values) {
            let Domain::Interval(low, high) = self.model.base[*i].domain else { continue };
            let numbers = [low, *value, high].map(|e| self.graph.eval_f64(e, &Default::default()));
            let [Some(low), Some(value), Some(high)] = numbers else { return None };
            if !(low < value && value < high) {
                return None;
            }
        }
        // Rows by coordinate, columns by field, beside the unit matrix.
        let n = coordinates.len();
        let mut rows = Vec::with_capacity(n);
        for (d, i) in coordinates.iter().enumerate() {
            let mut row = Vec::with_capacity(2 * n);
            for field in fields {
                let image = field.get(&self.model.base[*i].symbol).copied().unwrap_or(self.graph.zero());
                let value = self.graph.subs(image, &at).ok()?;
                row.push(self.graph.as_rational(value)?.clone());
            }
            row.extend((0..n).map(|k| if k == d { Rational::one() } else { Rational::zero() }));
            rows.push(row);
        }
        for column in 0..n {
            let pivot = (column..n).find(|r| !rows[*r][column].is_zero())?;
            rows.swap(column, pivot);
            let scale = rows[column][column].clone();
            rows[column].iter_mut().for_each(|q| *q /= &scale);
            for r in (0..n).filter(|r| *r != column) {
                let factor = rows[r][column].clone();
                let pivot = rows[column].clone();
                rows[r].iter_mut().zip(&pivot).for_each(|(q, p)| *q -= &factor * p);
            }
        }
        // `sum_a N_ac X_a = d/dc`: rows of the inverse's transpose.
        Some((0..n).map(|c| (0..n).map(|a| rows[a][n + c].clone()).collect()).collect())
    }

    /// Fields on the angles that commute with all of the group, with the same values at the section.
    fn body_fields(&mut self, group: &AngleGroup) -> Option<Vec<Vec<ExprId>>> {
        let mut ansatz: Vec<Images> = Vec::new();
        for i in &group.coordinates {
            ansatz.push(Images::from([(self.model.base[*i].symbol, self.graph.one())]));
        }
        for a in group.coordinates.iter().copied() {
            if !self.is_angle(a) {
                continue;
            }
            for field in fields_by(a, &group.coordinates) {
                let speed = self.speed(&field);
                ansatz.push(Images::from([(self.model.base[field.along].symbol, speed)]));
            }
        }
        let mut columns = Vec::new();
        for field in &ansatz {
            let mut column = Vec::new();
            for z in &group.fields {
                column.extend(self.bracket(&z.images, field));
            }
            columns.push(column);
        }
        let mut found: Vec<Images> = Vec::new();
        for relation in self.null_space(&columns) {
            let mut sum = Images::new();
            for (images, q) in ansatz.iter().zip(&relation).filter(|(_, q)| !q.is_zero()) {
                for (symbol, e) in images {
                    let before = sum.get(symbol).copied().unwrap_or(self.graph.zero());
                    let sum_of_both =
                        self.graph.linear_combination(&[(before, Rational::one()), (*e, q.clone())]);
                    sum.insert(*symbol, sum_of_both);
                }
            }
            found.push(sum);
        }
        if found.len() != 3 {
            return None;
        }
        let inverse = self.inverse_at(&group.coordinates, &group.values, &found)?;
        let mut body = Vec::new();
        for row in inverse {
            let rates = group.coordinates.iter().map(|i| {
                let symbol = self.model.base[*i].symbol;
                let zero = self.graph.zero();
                let terms: Vec<(ExprId, Rational)> = (found.iter().zip(&row))
                    .map(|(w, q)| (w.get(&symbol).copied().unwrap_or(zero), q.clone()))
                    .collect();
                self.graph.linear_combination(&terms)
            });
            body.push(rates.collect());
        }
        Some(body)
    }
}

/// All fields that turn by an angle.
fn fields_by(a: usize, angles: &[usize]) -> Vec<TurnedField> {
    let mut list = Vec::new();
    for is_cosine in [true, false] {
        for b in angles.iter().copied().filter(|b| *b != a) {
            let mut add = |slope, along| list.push(TurnedField { by: a, is_cosine, slope, along });
            add(Slope::One, b);
            add(Slope::Cotangent(b), a);
            add(Slope::Tangent(b), a);
            for c in angles.iter().copied().filter(|c| *c != a && *c != b) {
                add(Slope::Cosecant(b), c);
                add(Slope::Secant(b), c);
            }
        }
    }
    list
}
