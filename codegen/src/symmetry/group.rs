//! The group that a model is reduced by: fields that keep the kinetic energy, each with a coordinate of its own that it
//! moves, so that the group acts freely and one value of these coordinates is a cross-section.
//!
//! A configuration comes with all translations from its side where one of them keeps everything: the others are broken
//! by forces or constraints, which then move as advected parameters. Angles and coordinates of a line come where
//! nothing breaks them, or where the bracket of others needs them.
//!
//! Does not know: which functions are broken, how a model is written.

use hamel_expr::{ExprId, Rational};
use num_traits::{One, Zero};

use super::search::{Coefficients, Kept};
use super::setting::{Generator, Images, Setting};

/// A field of the group.
#[derive(Clone)]
pub(super) struct GroupField {
    pub(super) coefficients: Coefficients,
    pub(super) images: Images,
    /// The position in the ansatz of what it alone moves at the cross-section.
    pub(super) pivot: usize,
}

/// The group by its fields, with the brackets of these.
pub(super) struct SymmetryGroup {
    pub(super) fields: Vec<GroupField>,
    /// `[X_a, X_b] = sum_c F^c_ab X_c` for `a < b`.
    pub(super) brackets: Vec<(usize, usize, Vec<Rational>)>,
}

/// Subsets of more factors are not tried.
const MAX_FACTORS: usize = 6;

/// What turns with a configuration of rotations of space.
#[derive(Clone, Copy)]
enum Turned {
    /// Three coordinates, from this one on.
    Vector(usize),
    /// Another configuration in SO(3).
    Configuration(usize),
}

impl Setting<'_> {
    /// The group; without fields where there is none.
    pub(super) fn group(&mut self) -> SymmetryGroup {
        let everything = self.everything();
        let mut fields: Vec<GroupField> = Vec::new();
        let mut is_turned = vec![false; self.model.configurations.len()];
        for k in 0..self.model.configurations.len() {
            if is_turned[k] {
                continue;
            }
            let Some((own, turned)) = self.fields_of_configuration(k, &everything) else { continue };
            fields.extend(own);
            for t in turned {
                if let Turned::Configuration(j) = t {
                    is_turned[j] = true;
                }
            }
        }
        let known = self.symmetries(&everything);
        let mut translations: Vec<Coefficients> = known
            .into_iter()
            .filter(|c| matches!(last_of(c).map(|j| self.generators[j]), Some(Generator::Translation(_))))
            .collect();
        // Angles before lengths, as SE(2) has them.
        translations.sort_by_key(|c| {
            let is_angle = |i| self.is_angle(i);
            matches!(last_of(c).map(|j| self.generators[j]), Some(Generator::Translation(i)) if !is_angle(i))
        });
        for coefficients in translations {
            let pivot = last_of(&coefficients).unwrap_or_default();
            let images = self.field(&coefficients);
            fields.push(GroupField { coefficients, images, pivot });
        }
        let most = self.generators.len();
        self.closed(fields, most)
    }

    /// Translations of a configuration from its side, with what turns with it: where they keep the kinetic energy, and
    /// one of them at least keeps everything.
    fn fields_of_configuration(
        &mut self,
        k: usize,
        everything: &Kept,
    ) -> Option<(Vec<GroupField>, Vec<Turned>)> {
        let kinetic = Kept { functions: vec![self.kinetic], equations: Vec::new() };
        let factors = self.turned_by(k);
        let mut best: Option<(usize, Vec<GroupField>, Vec<Turned>)> = None;
        let mut subsets: Vec<usize> = (0..1usize << factors.len()).collect();
        subsets.sort_by_key(|s| s.count_ones());
        for subset in subsets {
            let turned: Vec<Turned> =
                (0..factors.len()).filter(|f| subset >> f & 1 == 1).map(|f| factors[f]).collect();
            let mut fields = self.turning_fields(k, &turned);
            if !fields.iter().all(|field| self.keeps(&field.images, &kinetic)) {
                continue;
            }
            let n_kept = fields.iter_mut().filter(|field| self.keeps(&field.images, everything)).count();
            if n_kept > best.as_ref().map_or(0, |(n, _, _)| *n) {
                best = Some((n_kept, fields, turned));
            }
        }
        best.map(|(_, fields, turned)| (fields, turned))
    }

    fn turned_by(&self, k: usize) -> Vec<Turned> {
        let of_space = |j: usize| {
            let group = &self.model.configurations[j].group;
            group.is_of_rotations() && group.n() == 3
        };
        if !of_space(k) {
            return Vec::new();
        }
        let base = &self.model.base;
        let is_vector = |i: usize| {
            let stem = base[i].name.strip_suffix('1').unwrap_or_default();
            !stem.is_empty()
                && (0..3).all(|d| {
                    base.get(i + d).is_some_and(|c| {
                        c.name == format!("{stem}{}", d + 1) && c.domain == hamel_lang::spec::Domain::Real
                    })
                })
                && base.get(i + 3).is_none_or(|c| c.name != format!("{stem}4"))
        };
        let vectors = (0..base.len()).filter(|i| is_vector(*i)).map(Turned::Vector);
        let others = (0..self.model.configurations.len())
            .filter(|j| *j != k && of_space(*j) && self.model.configurations[*j].group.spaces().is_empty());
        vectors.chain(others.map(Turned::Configuration)).take(MAX_FACTORS).collect()
    }

    /// The fields `Left(k, a)`; rotations take along what turns.
    fn turning_fields(&mut self, k: usize, turned: &[Turned]) -> Vec<GroupField> {
        let configuration = &self.model.configurations[k];
        let matrices = configuration.group.matrices().to_vec();
        let mut fields = Vec::new();
        for a in 0..configuration.velocities.len() {
            let mut coefficients = vec![Rational::zero(); self.generators.len()];
            let Some(pivot) = self.position(Generator::Left(k, a)) else { return Vec::new() };
            coefficients[pivot] = Rational::one();
            for t in turned.iter().filter(|_| a < matrices.len()) {
                match t {
                    Turned::Configuration(j) => {
                        if let Some(at) = self.position(Generator::Left(*j, a)) {
                            coefficients[at] = Rational::one();
                        }
                    }
                    Turned::Vector(i) => {
                        for row in 0..3 {
                            for column in 0..3 {
                                let q = matrices[a].get(row, column).clone();
                                match self.position(Generator::Linear(i + column, i + row)) {
                                    Some(at) => coefficients[at] = q,
                                    None if q.is_zero() => {}
                                    // The ansatz is too small: this subset keeps nothing.
                                    None => return Vec::new(),
                                }
                            }
                        }
                    }
                }
            }
            let images = self.field(&coefficients);
            fields.push(GroupField { coefficients, images, pivot });
        }
        fields
    }

    pub(super) fn position(&self, generator: Generator) -> Option<usize> {
        self.generators.iter().position(|g| *g == generator)
    }

    /// The group without a field, and without what its brackets then lack.
    pub(super) fn without(&mut self, group: SymmetryGroup, a: usize) -> SymmetryGroup {
        let mut fields = group.fields;
        match self.generators[fields[a].pivot] {
            // A configuration is one coordinate: it stays or goes as a whole.
            Generator::Left(k, _) => {
                let generators = self.generators.clone();
                fields.retain(|f| !matches!(generators[f.pivot], Generator::Left(of, _) if of == k));
            }
            _ => _ = fields.remove(a),
        }
        self.closed(fields, 0)
    }

    /// Fields whose brackets are among them: a missing one is added where it keeps the kinetic energy, and a field that
    /// leads out is left.
    ///
    /// `may_add`: how many may be added, zero where one has just been taken out.
    fn closed(&mut self, mut fields: Vec<GroupField>, mut may_add: usize) -> SymmetryGroup {
        let kinetic = Kept { functions: vec![self.kinetic], equations: Vec::new() };
        'again: loop {
            let mut brackets = Vec::new();
            for a in 0..fields.len() {
                for b in a + 1..fields.len() {
                    let value = self.bracket(&fields[a].images.clone(), &fields[b].images.clone());
                    let basis: Vec<_> = fields.iter().map(|f| self.on_coordinates(&f.images)).collect();
                    if let Some(constants) = self.combination_of_rows(&basis, &value) {
                        if constants.iter().any(|q| !q.is_zero()) {
                            brackets.push((a, b, constants));
                        }
                        continue;
                    }
                    let missing = match may_add {
                        0 => None,
                        _ => self.completed(&fields, &value, &kinetic),
                    };
                    may_add = may_add.saturating_sub(1);
                    match missing {
                        Some(field) => fields.push(field),
                        // Translations stand behind configurations, which stay or go as a whole.
                        None => match self.generators[fields[b].pivot] {
                            Generator::Left(k, _) => {
                                let generators = self.generators.clone();
                                fields.retain(
                                    |f| !matches!(generators[f.pivot], Generator::Left(of, _) if of == k),
                                );
                            }
                            _ => _ = fields.remove(b),
                        },
                    }
                    continue 'again;
                }
            }
            // What commutes with everything comes last, so that the algebra is a product that has a name.
            let is_central =
                |a: usize| brackets.iter().all(|(x, y, c)| ![*x, *y].contains(&a) && c[a].is_zero());
            let (mut order, central): (Vec<usize>, Vec<usize>) =
                (0..fields.len()).partition(|a| !is_central(*a));
            order.extend(central);
            let place = |a: usize| order.iter().position(|o| *o == a).unwrap_or_default();
            let brackets = brackets
                .iter()
                .map(|(a, b, c)| (place(*a), place(*b), order.iter().map(|o| c[*o].clone()).collect()))
                .collect();
            let fields = order.iter().map(|a| fields[*a].clone()).collect();
            return SymmetryGroup { fields, brackets };
        }
    }

    /// The field of these images, less its parts along others, where it moves a coordinate of its own.
    fn completed(&mut self, fields: &[GroupField], value: &[ExprId], kinetic: &Kept) -> Option<GroupField> {
        let ansatz: Vec<_> =
            (0..self.generators.len()).map(|j| self.on_coordinates(&self.generator(j).clone())).collect();
        let mut coefficients = self.combination_of_rows(&ansatz, value)?;
        for field in fields {
            let q = coefficients[field.pivot].clone();
            for (c, of_field) in coefficients.iter_mut().zip(&field.coefficients) {
                *c -= &q * of_field;
            }
        }
        let pivot = last_of(&coefficients)?;
        if !matches!(self.generators[pivot], Generator::Translation(_)) {
            return None;
        }
        let scale = coefficients[pivot].clone();
        coefficients.iter_mut().for_each(|c| *c /= &scale);
        let images = self.field(&coefficients);
        let is_free = fields.iter().all(|f| f.coefficients[pivot].is_zero());
        (is_free && self.keeps(&images, kinetic)).then_some(GroupField { coefficients, images, pivot })
    }
}

/// The last coefficient that is not zero.
pub(super) fn last_of(coefficients: &[Rational]) -> Option<usize> {
    coefficients.iter().rposition(|q| !q.is_zero())
}
