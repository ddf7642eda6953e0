//! Fields that change the Lagrangian by the rate of a function, `X L = dF/dt`, and the momenta that fields keep.
//!
//! `X L` is such a rate where it is affine in the velocities, `alpha . y + beta`, with `d alpha = 0` and `d alpha/dt =
//! grad beta`: linear conditions on the coefficients of the ansatz, which has the Galilean boosts `t d/dq` beside. The
//! momentum `dL/dy . X - F` is constant (Noether).
//!
//! The part `A . y` of a Lagrangian moves as a gyroscopic force `F_k = dA(e_k, y) - dA_k/dt`, which does no work. The
//! force is kept where `A` changes by a gradient.
//!
//! Source: Marsden and Ratiu 1999, sections 6.7 and 11.5; Olver 1993, section 4.4 for symmetries up to a divergence.
//!
//! Does not know: how a model is reduced.

use hamel_expr::{ExprId, Rational};
use hamel_lang::spec::Domain;
use num_traits::{One, Zero};

use super::group::last_of;
use super::search::Coefficients;
use super::setting::{Generator, Images, MAX_LINEAR, Setting};

/// A field that keeps the Lagrangian up to the rate of a function.
pub(super) struct Told {
    /// The field in words.
    pub(super) words: String,
    /// `F`; zero for a symmetry, none where no formula for it was found.
    pub(super) function: Option<ExprId>,
    /// Whether the Lagrangian itself is kept.
    pub(super) is_strict: bool,
    /// Why the motion is not reduced by it, where that is seen.
    pub(super) unused: Option<&'static str>,
    /// The momentum that is constant, where constraints and forces leave it so.
    pub(super) momentum: Option<ExprId>,
}

/// A function that is affine in the velocities, `alpha . y + beta`, and the rest of it.
struct Affine {
    alpha: Vec<ExprId>,
    beta: ExprId,
    rest: ExprId,
}

impl Setting<'_> {
    /// Fields of the ansatz and boosts that keep the Lagrangian up to the rate of a function, forces and constraints.
    pub(super) fn told(&mut self) -> Vec<Told> {
        let everything = self.everything();
        let strict = self.symmetries(&everything);
        let frames = self.frames();
        let lagrangian = self.graph.sub(self.kinetic, self.potential);
        let mut list = Vec::new();
        for coefficients in &strict {
            let (images, words) = (self.field(coefficients), self.described(coefficients));
            list.push(self.told_of((lagrangian, &frames), (coefficients, &images), (words, true, false)));
        }
        let strict: Vec<usize> = strict.iter().filter_map(|c| last_of(c)).collect();
        let real: Vec<usize> =
            (0..self.model.base.len()).filter(|i| self.model.base[*i].domain == Domain::Real).collect();
        let boosts = if real.len() <= MAX_LINEAR { real } else { Vec::new() };
        let mut columns = Vec::new();
        let n_generators = self.generators.len();
        let equations = self.constraints.clone();
        let n = self.velocities.len();
        let n_conditions = 1 + n * (n - 1) / 2 + n + 1;
        for c in 0..equations.len() {
            for phi in &equations {
                let mut column = vec![self.graph.zero(); n_conditions + equations.len()];
                column[n_conditions + c] = self.on_groups(*phi);
                columns.push(column);
            }
        }
        let n_equations = columns.len();
        for j in 0..boosts.len() + n_generators {
            let images = match j.checked_sub(boosts.len()) {
                Some(j) => self.generator(j).clone(),
                None => self.boost(boosts[j]),
            };
            let mut column = self.conditions(lagrangian, &images, &frames);
            for f in [self.power].into_iter().chain(equations.iter().copied()) {
                column.push(self.graph.derivative_along(f, &images));
            }
            columns.push(column.into_iter().map(|e| self.on_groups(e)).collect());
        }
        for relation in self.null_space(&columns) {
            let (of_boosts, of_generators) = relation[n_equations..].split_at(boosts.len());
            let Some(last) = relation[n_equations..].iter().rposition(|q| !q.is_zero()) else { continue };
            if last.checked_sub(boosts.len()).is_some_and(|j| strict.contains(&j)) {
                continue;
            }
            let mut images = self.field(of_generators);
            let mut words = self.described(of_generators);
            for (i, q) in boosts.iter().zip(of_boosts).filter(|(_, q)| !q.is_zero()) {
                for (symbol, e) in self.boost(*i) {
                    let before = images.get(&symbol).copied().unwrap_or(self.graph.zero());
                    let sum = self.graph.linear_combination(&[(before, Rational::one()), (e, q.clone())]);
                    images.insert(symbol, sum);
                }
                words = super::joined(words, q, &format!("t d/d{}", self.model.base[*i].name));
            }
            list.push(self.told_of(
                (lagrangian, &frames),
                (&of_generators.to_vec(), &images),
                (words, false, of_boosts.iter().any(|q| !q.is_zero())),
            ));
        }
        list
    }

    fn told_of(
        &mut self,
        (lagrangian, frames): (ExprId, &[Images]),
        (coefficients, images): (&Coefficients, &Images),
        (words, is_strict, is_boost): (String, bool, bool),
    ) -> Told {
        let slope = self.graph.derivative_along(lagrangian, images);
        let slope = self.affine(slope);
        let changes_potential = !self.vanishes(slope.beta);
        let unused = match (is_strict, is_boost, changes_potential) {
            (true, ..) => None,
            (_, true, _) => Some("it moves with the time"),
            (_, _, true) => Some("the potential energy depends on where it leads"),
            _ => None,
        };
        let along = self.along_field(coefficients, images);
        let function = match is_strict {
            true => Some(self.graph.zero()),
            false => self.primitive(&slope, along.as_deref(), frames),
        };
        let momentum = match (along, function) {
            (Some(along), Some(function)) if self.model.constraints.is_empty() => {
                self.momentum(lagrangian, &along, function)
            }
            _ => None,
        };
        Told { words, function, is_strict, unused, momentum }
    }

    /// Moves the part of the Lagrangian that is linear in the velocities into the forces.
    pub(super) fn make_gyroscopic(&mut self) {
        let frames = self.frames();
        let parts = self.affine(self.kinetic);
        let n = self.velocities.len();
        let of_time = Images::from([(self.model.time, self.graph.one())]);
        let mut terms = vec![self.power];
        for k in 0..n {
            let w = self.graph.sym(self.displacements[k]);
            let by_time = self.graph.derivative_along(parts.alpha[k], &of_time);
            let mut force = vec![self.graph.neg(by_time)];
            for l in 0..n {
                let y = self.graph.sym(self.velocities[l]);
                let field = self.exterior(&parts.alpha, (k, l), &frames);
                force.push(self.graph.mul(field, y));
            }
            let force = self.graph.sum(&force);
            terms.push(self.graph.mul(w, force));
        }
        self.power = self.graph.sum(&terms);
        self.kinetic = self.graph.cancel_zero(parts.rest);
    }

    /// `t d/dq_i`, with `q_i' -> q_i' + 1`.
    fn boost(&mut self, i: usize) -> Images {
        let t = self.graph.sym(self.model.time);
        Images::from([(self.model.base[i].symbol, t), (self.velocities[i], self.graph.one())])
    }

    /// Rates of the coordinates along each velocity.
    fn frames(&mut self) -> Vec<Images> {
        let n_base = self.model.base.len();
        let mut frames = vec![Images::new(); self.velocities.len()];
        for (i, coordinate) in self.model.base.iter().enumerate() {
            frames[i].insert(coordinate.symbol, self.graph.one());
        }
        for (j, generator) in self.generators.iter().enumerate() {
            let Generator::Right(k, a) = *generator else { continue };
            let configuration = &self.model.configurations[k];
            let images = self.generator(j);
            let own = configuration.symbols.iter().filter_map(|s| Some((*s, *images.get(s)?)));
            frames[n_base + configuration.velocities[a]] = own.collect();
        }
        frames
    }

    fn affine(&mut self, e: ExprId) -> Affine {
        let rest: Images = self.velocities.iter().map(|y| (*y, self.graph.zero())).collect();
        let mut alpha = Vec::with_capacity(self.velocities.len());
        let beta = self.graph.subs(e, &rest).unwrap_or(e);
        let mut left = vec![(e, Rational::one()), (beta, -Rational::one())];
        for y in self.velocities.clone() {
            let slope = self.graph.diff(e, y);
            let a = self.graph.subs(slope, &rest).unwrap_or(slope);
            let y = self.graph.sym(y);
            left.push((self.graph.mul(a, y), -Rational::one()));
            alpha.push(a);
        }
        let rest = self.graph.linear_combination(&left);
        Affine { alpha, beta, rest }
    }

    /// What vanishes where `X L` is the rate of a function: the part that is not affine, `d alpha`, and
    /// `d alpha/dt - grad beta`.
    fn conditions(&mut self, lagrangian: ExprId, field: &Images, frames: &[Images]) -> Vec<ExprId> {
        let slope = self.graph.derivative_along(lagrangian, field);
        let parts = self.affine(slope);
        let n = self.velocities.len();
        let mut list = vec![parts.rest];
        for k in 0..n {
            for l in k + 1..n {
                list.push(self.exterior(&parts.alpha, (k, l), frames));
            }
        }
        let of_time = Images::from([(self.model.time, self.graph.one())]);
        for k in 0..n {
            let by_time = self.graph.derivative_along(parts.alpha[k], &of_time);
            let gradient = self.graph.derivative_along(parts.beta, &frames[k]);
            list.push(self.graph.sub(by_time, gradient));
        }
        list
    }

    /// `d alpha (e_k, e_l) = e_k alpha_l - e_l alpha_k - alpha([e_k, e_l])`.
    fn exterior(&mut self, alpha: &[ExprId], (k, l): (usize, usize), frames: &[Images]) -> ExprId {
        let forward = self.graph.derivative_along(alpha[l], &frames[k]);
        let backward = self.graph.derivative_along(alpha[k], &frames[l]);
        let mut terms = vec![(forward, Rational::one()), (backward, -Rational::one())];
        let n_base = self.model.base.len();
        for configuration in &self.model.configurations {
            let place = |j: usize| configuration.velocities.iter().position(|b| n_base + b == j);
            let (Some(a), Some(b)) = (place(k), place(l)) else { continue };
            for (c, q) in configuration.group.algebra().bracket(a, b) {
                terms.push((alpha[n_base + configuration.velocities[c]], -q));
            }
        }
        self.graph.linear_combination(&terms)
    }

    /// The velocities along a field; turns in space of more than an attitude have no formula here.
    fn along_field(&mut self, coefficients: &Coefficients, images: &Images) -> Option<Vec<ExprId>> {
        let (model, zero) = (self.model, self.graph.zero());
        let mut along: Vec<ExprId> =
            model.base.iter().map(|c| images.get(&c.symbol).copied().unwrap_or(zero)).collect();
        let mut of_groups: Vec<Vec<(ExprId, Rational)>> = vec![Vec::new(); model.velocities.len()];
        for (generator, q) in
            self.generators.clone().into_iter().zip(coefficients).filter(|(_, q)| !q.is_zero())
        {
            match generator {
                Generator::Right(k, a) => {
                    of_groups[model.configurations[k].velocities[a]].push((self.graph.one(), q.clone()));
                }
                Generator::Left(k, a) => {
                    // `g^-1 e_a g` is a row of the rotation.
                    let configuration = &model.configurations[k];
                    let group = &configuration.group;
                    if !group.is_of_rotations() || group.n() != 3 || !group.spaces().is_empty() {
                        return None;
                    }
                    for b in 0..3 {
                        let entry = self.graph.sym(configuration.symbols[3 * a + b]);
                        of_groups[configuration.velocities[b]].push((entry, q.clone()));
                    }
                }
                _ => {}
            }
        }
        for terms in of_groups {
            along.push(self.graph.linear_combination(&terms));
        }
        Some(along)
    }

    /// `F` with `dF = alpha` and `dF/dt = beta`: a combination of products of coordinates with terms of `alpha`, of
    /// their derivatives and of the vector potential along the field; proved.
    fn primitive(&mut self, of: &Affine, along: Option<&[ExprId]>, frames: &[Images]) -> Option<ExprId> {
        let mut candidates = Vec::new();
        for (k, frame) in frames.iter().enumerate() {
            let expanded = self.graph.expand(of.alpha[k]);
            if let Some(coordinate) = self.model.base.get(k) {
                let q = self.graph.sym(coordinate.symbol);
                for (term, _) in self.graph.summands(expanded) {
                    candidates.push(self.graph.mul(q, term));
                }
            }
            candidates.push(self.graph.derivative_along(expanded, frame));
        }
        if let Some(along) = along {
            let alpha = self.affine(self.kinetic).alpha;
            candidates.push(self.graph.dot(&alpha, along));
        }
        let t = self.graph.sym(self.model.time);
        let expanded = self.graph.expand(of.beta);
        for (term, _) in self.graph.summands(expanded) {
            candidates.push(self.graph.mul(t, term));
        }
        candidates.retain(|e| *e != self.graph.zero());
        candidates.sort_unstable();
        candidates.dedup();
        let of_time = Images::from([(self.model.time, self.graph.one())]);
        let rows: Vec<Vec<ExprId>> = candidates
            .iter()
            .map(|f| {
                let mut row: Vec<ExprId> =
                    frames.iter().map(|frame| self.graph.derivative_along(*f, frame)).collect();
                row.push(self.graph.derivative_along(*f, &of_time));
                row
            })
            .collect();
        let wanted: Vec<ExprId> = of.alpha.iter().copied().chain([of.beta]).collect();
        let numbers = self.combination_of_rows(&rows, &wanted)?;
        let terms: Vec<(ExprId, Rational)> = candidates.into_iter().zip(numbers).collect();
        Some(self.graph.linear_combination(&terms))
    }

    /// `dL/dy . X - F`, where the forces do no work along the field.
    fn momentum(&mut self, lagrangian: ExprId, along: &[ExprId], function: ExprId) -> Option<ExprId> {
        let displaced: Images = self.displacements.iter().copied().zip(along.iter().copied()).collect();
        let power = self.graph.subs(self.power, &displaced).ok()?;
        if !self.vanishes(power) {
            return None;
        }
        let mut terms = vec![self.graph.neg(function)];
        for (y, x) in self.velocities.clone().into_iter().zip(along) {
            let p = self.graph.diff(lagrangian, y);
            terms.push(self.graph.mul(p, *x));
        }
        Some(self.graph.sum(&terms))
    }
}

/// Functions and momenta of more characters are not written out.
const MAX_LENGTH: usize = 120;

impl Told {
    /// A line of the report.
    pub(super) fn line(&self, setting: &Setting<'_>) -> String {
        let spelled =
            |e: Option<ExprId>| e.map(|e| setting.spelled(e)).filter(|text| text.len() <= MAX_LENGTH);
        let up_to = match (self.is_strict, spelled(self.function)) {
            (true, _) => String::new(),
            (_, Some(f)) => format!(" up to the rate of `{f}`"),
            (_, None) => " up to the rate of a function".to_owned(),
        };
        let unused = self.unused.map_or_else(String::new, |why| format!("; not used, since {why}"));
        let kept = spelled(self.momentum).map_or_else(String::new, |text| format!("; it keeps `{text}`"));
        format!("Symmetry{up_to}: {}{unused}{kept}.", self.words)
    }
}
