//! The group that a model is reduced by: fields that keep the kinetic energy, each with a coordinate of its own that it
//! moves, so that the group acts freely and one value of these coordinates is a cross-section.
//!
//! A configuration comes with all translations from its side where one of them keeps everything: the others are broken
//! by forces or constraints, which then move as advected parameters. Angles and coordinates of a line come where
//! nothing breaks them, or where the bracket of others needs them.
//!
//! Does not know: which functions are broken, how a model is written.

use hamel_expr::{ExprId, Rational};
use hamel_lang::spec::Side;
use num_traits::{One, Zero};

use super::angles::AngleGroup;
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
    /// From which side it acts on configurations: left, with velocities of the body, or right, with velocities in
    /// space.
    pub(super) side: Side,
    /// Its turns of a body in angles.
    pub(super) angles: Option<AngleGroup>,
}

/// Which group is looked for.
#[derive(Clone)]
pub(super) struct Way {
    /// From which side it acts on configurations.
    pub(super) side: Side,
    /// Whether configurations and coordinates come of which no translation keeps everything.
    pub(super) is_broken: bool,
    /// Turns of a body in angles that come.
    pub(super) angles: Option<AngleGroup>,
}

impl SymmetryGroup {
    /// The value of a coordinate of its angles at the section.
    pub(super) fn value_of(&self, i: usize) -> Option<ExprId> {
        let angles = self.angles.as_ref()?;
        angles.coordinates.iter().position(|of| *of == i).map(|d| angles.values[d])
    }

    /// The group without fields.
    pub(super) fn none(side: Side) -> SymmetryGroup {
        SymmetryGroup { fields: Vec::new(), brackets: Vec::new(), side, angles: None }
    }
}

impl SymmetryGroup {
    /// The structure constant that the velocities of the group obey for a bracket of fields.
    ///
    /// Velocities of the body have the opposite of the fields', those in space what the action from the right makes of
    /// it.
    pub(super) fn constant(&self, of_fields: &Rational) -> Rational {
        match self.side {
            Side::Left => -of_fields.clone(),
            Side::Right => of_fields.clone(),
        }
    }
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
    /// The group of that kind; without fields where there is none.
    ///
    /// From the right it takes all configurations or none: one that stays has velocities of the body.
    pub(super) fn group(&mut self, way: &Way) -> SymmetryGroup {
        let (side, is_broken) = (way.side, way.is_broken);
        let everything = self.everything();
        let mut fields: Vec<GroupField> = way.angles.iter().flat_map(|g| g.fields.clone()).collect();
        let mut is_turned = vec![false; self.model.configurations.len()];
        for k in 0..self.model.configurations.len() {
            if is_turned[k] {
                continue;
            }
            let Some((own, turned)) = self.fields_of_configuration((k, side, is_broken), &everything) else {
                if side == Side::Right {
                    return SymmetryGroup::none(side);
                }
                continue;
            };
            fields.extend(own);
            for t in turned {
                if let Turned::Configuration(j) = t {
                    is_turned[j] = true;
                }
            }
        }
        let kinetic = Kept { functions: vec![self.kinetic], equations: Vec::new() };
        let known = self.symmetries(if is_broken { &kinetic } else { &everything });
        let mut translations: Vec<Coefficients> = known
            .iter()
            .filter(|c| {
                let is_turned = self
                    .generators
                    .iter()
                    .zip(*c)
                    .any(|(g, q)| matches!(g, Generator::Turned(_)) && !q.is_zero());
                let Some(Generator::Translation(i)) = last_of(c).map(|j| self.generators[j]) else {
                    return false;
                };
                let is_taken = way.angles.as_ref().is_some_and(|g| g.coordinates.contains(&i));
                !is_turned && !is_taken
            })
            .cloned()
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
        self.closed((fields, side, way.angles.clone()), most)
    }

    /// Translations of a configuration from its side, with what turns with it: where they keep the kinetic energy, and
    /// one of them at least keeps everything.
    fn fields_of_configuration(
        &mut self,
        (k, side, is_broken): (usize, Side, bool),
        everything: &Kept,
    ) -> Option<(Vec<GroupField>, Vec<Turned>)> {
        let kinetic = Kept { functions: vec![self.kinetic], equations: Vec::new() };
        // Nothing turns in the body with what moves it there.
        let factors = if side == Side::Left { self.turned_by(k) } else { Vec::new() };
        let mut best: Option<(usize, Vec<GroupField>, Vec<Turned>)> = None;
        let mut subsets: Vec<usize> = (0..1usize << factors.len()).collect();
        subsets.sort_by_key(|s| s.count_ones());
        for subset in subsets {
            let turned: Vec<Turned> =
                (0..factors.len()).filter(|f| subset >> f & 1 == 1).map(|f| factors[f]).collect();
            let mut fields = self.turning_fields((k, side), &turned);
            if !fields.iter().all(|field| self.keeps(&field.images, &kinetic)) {
                continue;
            }
            let n_kept = fields.iter_mut().filter(|field| self.keeps(&field.images, everything)).count();
            let is_better = best.as_ref().is_none_or(|(n, _, _)| n_kept > *n);
            if is_better && (is_broken || n_kept > 0) {
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

    /// The translations of a configuration from its side; rotations take along what turns.
    fn turning_fields(&mut self, (k, side): (usize, Side), turned: &[Turned]) -> Vec<GroupField> {
        let configuration = &self.model.configurations[k];
        let matrices = configuration.group.matrices().to_vec();
        let mut fields = Vec::new();
        for a in 0..configuration.velocities.len() {
            let mut coefficients = vec![Rational::zero(); self.generators.len()];
            let own = if side == Side::Left { Generator::Left(k, a) } else { Generator::Right(k, a) };
            let Some(pivot) = self.position(own) else { return Vec::new() };
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
        let mut angles = group.angles;
        self.remove((&mut fields, &mut angles), a);
        self.closed((fields, group.side, angles), 0)
    }

    /// The configuration that a field of the group moves as its own coordinate, and along which element.
    pub(super) fn configuration_of(&self, field: &GroupField) -> Option<(usize, usize)> {
        match self.generators[field.pivot] {
            Generator::Left(k, a) | Generator::Right(k, a) => Some((k, a)),
            _ => None,
        }
    }

    /// Takes a field out; configurations, and turns of a body in angles, stay or go as a whole.
    fn remove(&self, (fields, angles): (&mut Vec<GroupField>, &mut Option<AngleGroup>), a: usize) {
        let of_angles = |g: &&mut AngleGroup| g.fields.iter().any(|f| f.pivot == fields[a].pivot);
        if angles.as_mut().filter(of_angles).is_some() {
            let gone = angles.take().map_or_else(Vec::new, |g| g.fields);
            fields.retain(|f| gone.iter().all(|g| g.pivot != f.pivot));
            return;
        }
        match self.configuration_of(&fields[a]) {
            Some((k, _)) => {
                fields.retain(|f| self.configuration_of(f).is_none_or(|(of, _)| of != k));
            }
            None => _ = fields.remove(a),
        }
    }

    /// Fields whose brackets are among them: a missing one is added where it keeps the kinetic energy, and a field that
    /// leads out is left.
    ///
    /// `may_add`: how many may be added, zero where one has just been taken out.
    fn closed(
        &mut self,
        (mut fields, side, mut angles): (Vec<GroupField>, Side, Option<AngleGroup>),
        mut may_add: usize,
    ) -> SymmetryGroup {
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
                        // Translations stand behind configurations.
                        None => self.remove((&mut fields, &mut angles), b),
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
            return SymmetryGroup { fields, brackets, side, angles };
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
