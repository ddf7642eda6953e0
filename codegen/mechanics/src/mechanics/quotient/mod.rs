//! One system as the quotient of another: a map of their algebroids that takes one motion to the other.
//!
//! The base is mapped by `xbar = phi(x, t)`, velocities by `ybar = Phi(x, t) y + Phi_0(x, t)`, displacements by `Phi`.
//! With `d/dt` as one more section of both algebroids, along which every motion has the velocity one,
//!
//! ```text
//! rho_a(phi^I) = Phi^A_a rhobar^I_A(phi)
//! rho_a(Phi^C_b) - rho_b(Phi^C_a) + Phi^A_a Phi^B_b Cbar^C_AB(phi) = C^c_ab Phi^C_c
//! L(x, y, t) = Lbar(phi, Phi y + Phi_0, t) + alpha_a(x, t) y^a
//! Phi(M) in Mbar,   Phi(V) = Vbar,   F_a w^a = Fbar_A Phi^A_a w^a + dalpha(y, w) for w in V
//! ```
//!
//! for the velocities `M` and the displacements `V` that constraints allow. A form `alpha` is the gyroscopic force
//! `-dalpha(y, .)`, which has no power: none where it is closed, as for Lagrangians that differ by a rate. The
//! Lagrange-d'Alembert equation along `w` is the one of the quotient along `Phi w` then: `Phi` takes motions to
//! motions, and where `Phi_0 = 0` energies are equal. Components of the coordinates of a group are rational functions
//! of free symbols where something has to vanish.
//!
//! Source: Cortes, de Leon, Marrero, Martinez 2009, theorems 4.6 and 7.8. Does not know: equations of motion, texts.

mod forms;

use std::collections::BTreeMap;

use crate::reduction::{AccelerationSource, KinematicConstraint, ReducedSystem};
use hamel_expr::{ExprId, Graph, Style, SymbolId, Vanishing, independent_rows};
use hamel_lang::algebra::Algebroid;
use hamel_lang::spec::group_motion::rational_element;
use hamel_lang::spec::{Configuration, Param};

use forms::{Form, allowed, dimension, reactions};

/// The proof that one system is the quotient of another, by numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quotient {
    /// Components of the base, of the total system and of the quotient.
    pub base: (usize, usize),
    /// Velocities of both.
    pub velocities: (usize, usize),
    /// Dimensions of the displacements of both.
    pub displacements: (usize, usize),
    /// Functions that vanish, and ranks that agree: one for each condition.
    pub n_conditions: usize,
}

/// Why a system is not seen to be the quotient of another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotQuotient {
    /// One of both is of a kind that is not looked into.
    Refused {
        /// Whether it is the quotient.
        is_quotient: bool,
        /// What it has.
        has: &'static str,
    },
    /// A variable or a parameter of the quotient without a function of the total system.
    NoImage {
        /// Its name.
        name: String,
    },
    /// A function of the total system that is none of its base, time and parameters; for velocities, affine in them.
    NotOnBase {
        /// The name of the variable that it is given for.
        name: String,
        /// Whether that is a velocity.
        is_velocity: bool,
    },
    /// A function of the quotient without a value on the image.
    NoValue,
    /// A condition that does not hold.
    Violated {
        /// The condition.
        relation: String,
        /// What should vanish; empty for a condition between subspaces.
        residual: String,
        /// Whether it is proved that it does not hold.
        is_proved: bool,
    },
}

/// The map, in the graph of the total system.
struct Map<'a> {
    total: &'a ReducedSystem,
    quotient: &'a ReducedSystem,
    g: Graph,
    /// The graph of the quotient.
    other: Graph,
    /// What stands for coordinates of groups where something has to vanish.
    elements: BTreeMap<SymbolId, ExprId>,
    /// What stands for the symbols of the quotient.
    images: BTreeMap<SymbolId, ExprId>,
    /// `phi`.
    base: Vec<ExprId>,
    /// `Phi`, by velocity of the quotient.
    velocities: Vec<Vec<ExprId>>,
    /// `Phi_0`.
    offsets: Vec<ExprId>,
    /// `alpha`, zero along `d/dt`, which is number 0.
    gyroscopic: Vec<ExprId>,
    /// Dimensions of the displacements of both.
    displacements: (usize, usize),
    violated: Vec<NotQuotient>,
    n_conditions: usize,
}

/// Proves that `quotient` is the quotient of `total` by a map: `images` has functions of the total system, in its
/// graph, by names of variables and parameters of the quotient. One that has none is the one of that name.
///
/// `configurations` are the coordinates of the total system in groups.
///
/// # Errors
/// What does not hold, of the first kind of conditions of which one does not.
pub fn quotient_of(
    total: &ReducedSystem,
    quotient: &ReducedSystem,
    configurations: &[Configuration],
    images: &BTreeMap<String, ExprId>,
) -> Result<Quotient, Vec<NotQuotient>> {
    let refused: Vec<NotQuotient> = [(total, false), (quotient, true)]
        .into_iter()
        .filter_map(|(system, is_quotient)| Some(NotQuotient::Refused { is_quotient, has: refusal(system)? }))
        .collect();
    if !refused.is_empty() {
        return Err(refused);
    }
    let mut map = Map::new(total, quotient, configurations, images)?;
    for kind in Map::CONDITIONS {
        kind(&mut map).map_err(|problem| vec![problem])?;
        if !map.violated.is_empty() {
            return Err(map.violated);
        }
    }
    Ok(Quotient {
        base: (total.algebroid.n_base(), quotient.algebroid.n_base()),
        velocities: (total.velocities.len(), quotient.velocities.len()),
        displacements: map.displacements,
        n_conditions: map.n_conditions,
    })
}

/// What keeps a system from being looked into.
fn refusal(system: &ReducedSystem) -> Option<&'static str> {
    if system.hamiltonian.is_some() {
        return Some("a Hamiltonian in the place of a Lagrangian");
    }
    if system.accelerations.is_some() {
        return Some("a motion that is given");
    }
    if !system.higher.carried.is_empty() || has_servo(system) {
        return Some("constraints on accelerations");
    }
    if !system.positions.is_empty() {
        return Some("equations between positions");
    }
    if system.lift.is_some() {
        return Some("a mechanical connection");
    }
    None
}

fn has_servo(system: &ReducedSystem) -> bool {
    match &system.constraint {
        KinematicConstraint::Solved(_) => false,
        KinematicConstraint::Multipliers { rows, .. } => {
            rows.iter().any(|row| matches!(row.source, AccelerationSource::Servo(_)))
        }
    }
}

/// What a form is evaluated on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Along {
    /// `Phi y + Phi_0`.
    Velocities,
    /// `Phi w`.
    Displacements,
}

/// A kind of conditions, which adds the ones that fail to the list of violated ones.
type Condition<'a> = fn(&mut Map<'a>) -> Result<(), NotQuotient>;

impl<'a> Map<'a> {
    /// The kinds of conditions, in order: each takes for granted that those before it hold.
    const CONDITIONS: [Condition<'a>; 6] = [
        Map::anchors,
        Map::brackets,
        Map::lagrangians,
        Map::velocities_allowed,
        Map::displacements_allowed,
        Map::forces,
    ];

    fn new(
        total: &'a ReducedSystem,
        quotient: &'a ReducedSystem,
        configurations: &[Configuration],
        given: &BTreeMap<String, ExprId>,
    ) -> Result<Map<'a>, Vec<NotQuotient>> {
        let mut g = total.graph.clone();
        let mut elements = BTreeMap::new();
        for (k, configuration) in configurations.iter().enumerate() {
            let dim = configuration.group.algebra().dim();
            let free: Vec<ExprId> = (0..dim)
                .map(|a| {
                    let symbol = g.symbol(&format!("'element{k}_{a}"));
                    g.sym(symbol)
                })
                .collect();
            let entries = rational_element(&mut g, &configuration.group, &free);
            elements.extend(entries.into_iter().flat_map(|e| configuration.symbols.iter().copied().zip(e)));
        }
        let mut map = Map {
            total,
            quotient,
            g,
            other: quotient.graph.clone(),
            elements,
            images: BTreeMap::new(),
            base: Vec::new(),
            velocities: Vec::new(),
            offsets: Vec::new(),
            gyroscopic: Vec::new(),
            displacements: (0, 0),
            violated: Vec::new(),
            n_conditions: 0,
        };
        map.read(given)?;
        Ok(map)
    }

    /// Reads the functions of the total system that stand for the symbols of the quotient.
    fn read(&mut self, given: &BTreeMap<String, ExprId>) -> Result<(), Vec<NotQuotient>> {
        let (total, quotient) = (self.total, self.quotient);
        let params: Vec<SymbolId> = total.params.iter().map(|p| p.symbol).collect();
        let inputs: Vec<SymbolId> = total.inputs.iter().map(|p| p.symbol).collect();
        let base = total.algebroid.base().to_vec();
        let on_base: Vec<SymbolId> = [params.as_slice(), &inputs, &base, &[total.time]].concat();
        let everything = [on_base.as_slice(), &total.velocities].concat();
        let known: BTreeMap<String, SymbolId> =
            everything.iter().map(|s| (self.g.name(*s).to_owned(), *s)).collect();
        let params_of_quotient: Vec<SymbolId> =
            quotient.params.iter().chain(&quotient.inputs).map(|p| p.symbol).collect();
        let mut problems = Vec::new();
        let mut image = |map: &mut Map<'_>, symbol: SymbolId| {
            let name = quotient.graph.name(symbol).to_owned();
            let own = || known.get(&name).copied();
            let e = given.get(&name).copied().or_else(|| own().map(|s| map.g.sym(s)));
            match e {
                Some(e) => _ = map.images.insert(symbol, e),
                // A parameter may stand nowhere.
                None if params_of_quotient.contains(&symbol) => {}
                None => problems.push(NotQuotient::NoImage { name }),
            }
            e
        };
        self.images.insert(quotient.time, self.g.sym(total.time));
        let symbols = |list: &[Param]| list.iter().map(|p| p.symbol).collect::<Vec<_>>();
        let of_params: Vec<_> = symbols(&quotient.params).into_iter().map(|s| (s, image(self, s))).collect();
        let of_inputs: Vec<_> = symbols(&quotient.inputs).into_iter().map(|s| (s, image(self, s))).collect();
        let of_base: Vec<_> = quotient.algebroid.base().iter().map(|s| (*s, image(self, *s))).collect();
        let of_velocities: Vec<_> = quotient.velocities.iter().map(|s| (*s, image(self, *s))).collect();
        let only = |map: &Map<'_>, e: ExprId, allowed: &[SymbolId]| {
            map.g.free_symbols(e).iter().all(|s| allowed.contains(s))
        };
        for (list, allowed) in [(&of_params, &params), (&of_inputs, &inputs), (&of_base, &on_base)] {
            for (symbol, e) in list.iter().filter_map(|(s, e)| Some((s, (*e)?))) {
                if !only(self, e, allowed) {
                    let name = quotient.graph.name(*symbol).to_owned();
                    problems.push(NotQuotient::NotOnBase { name, is_velocity: false });
                }
            }
        }
        self.base = of_base.iter().filter_map(|(_, e)| *e).collect();
        for (symbol, e) in of_velocities.iter().filter_map(|(s, e)| Some((s, (*e)?))) {
            let parts = self.g.affine_parts(e, &total.velocities);
            let is_moved = |map: &Map<'_>, e: ExprId| {
                total.own_rates.iter().any(|own| map.g.free_symbols(e).contains(&own.symbol))
            };
            match parts {
                Some((row, offset))
                    if row
                        .iter()
                        .chain([&offset])
                        .all(|e| only(self, *e, &on_base) && !is_moved(self, *e)) =>
                {
                    self.velocities.push(row);
                    self.offsets.push(offset);
                }
                _ => {
                    let name = quotient.graph.name(*symbol).to_owned();
                    problems.push(NotQuotient::NotOnBase { name, is_velocity: true });
                }
            }
        }
        if problems.is_empty() { Ok(()) } else { Err(problems) }
    }

    /// Functions of the quotient on the image.
    fn pulled(&mut self, list: &[ExprId]) -> Result<Vec<ExprId>, NotQuotient> {
        let unknown =
            |e: &ExprId| self.other.free_symbols(*e).into_iter().find(|s| !self.images.contains_key(s));
        if let Some(symbol) = list.iter().find_map(unknown) {
            return Err(NotQuotient::NoImage { name: self.name(symbol) });
        }
        self.g.import_with(&self.other, list, &self.images).map_err(|_| NotQuotient::NoValue)
    }

    /// A function by free symbols in the place of coordinates of groups.
    fn on_groups(&mut self, e: ExprId) -> ExprId {
        // An entry of a matrix in a denominator has a value near the identity.
        self.g.subs(e, &self.elements).unwrap_or(e)
    }

    /// Demands that a function vanishes.
    fn vanishes(&mut self, residual: ExprId, relation: impl FnOnce() -> String) {
        self.n_conditions += 1;
        let on_groups = self.on_groups(residual);
        let verdict = self.g.vanishing(on_groups);
        if verdict != Vanishing::Zero {
            let residual = self.g.display(residual, Style::Plain);
            let is_proved = verdict == Vanishing::NonZero;
            self.violated.push(NotQuotient::Violated { relation: relation(), residual, is_proved });
        }
    }

    /// The rank over functions of forms of the total system and of pulled ones, whose quasi-velocities are others.
    fn rank(&mut self, total: &[Form], pulled: &[Form]) -> usize {
        let zero = self.g.zero();
        let n_of = |forms: &[Form]| forms.iter().map(|form| form.quasi.len()).max().unwrap_or(0);
        let (n, n_pulled) = (n_of(total), n_of(pulled));
        let padded = |list: &[ExprId], n: usize| {
            let mut list = list.to_vec();
            list.resize(n, zero);
            list
        };
        let own = total.iter().map(|f| [padded(&f.quasi, n), padded(&[], n_pulled)].concat());
        let others = pulled.iter().map(|f| [padded(&[], n), padded(&f.quasi, n_pulled)].concat());
        let quasi: Vec<Vec<ExprId>> = own.chain(others).collect();
        let mut rows = Vec::new();
        for (form, quasi) in total.iter().chain(pulled).zip(quasi) {
            let row = [form.velocities.as_slice(), &quasi, &[form.offset]].concat();
            rows.push(row.into_iter().map(|e| self.on_groups(e)).collect());
        }
        independent_rows(&self.g, &rows).len()
    }

    /// Whether pulled forms hold where forms of the total system do: `rank(T, P) = rank(T) + rank(b_P)`, since the rows
    /// of `P` that are free of quasi-velocities have to be combinations of rows of `T`.
    fn is_implied(&mut self, total: &[Form], pulled: &[Form]) -> bool {
        self.n_conditions += 1;
        let zero = self.g.zero();
        let quasi: Vec<Form> = pulled
            .iter()
            .map(|form| {
                let velocities = vec![zero; self.total.velocities.len()];
                Form { velocities, offset: zero, ..form.clone() }
            })
            .collect();
        self.rank(total, pulled) == self.rank(total, &[]) + self.rank(&[], &quasi)
    }

    fn name(&self, symbol: SymbolId) -> String {
        self.quotient.graph.name(symbol).to_owned()
    }

    /// The derivative of a function along a section of the total system, `d/dt` as number 0.
    fn along(&mut self, section: usize, f: ExprId) -> ExprId {
        match section.checked_sub(1) {
            Some(alpha) => self.total.algebroid.derivative_along(&mut self.g, alpha, f),
            None => self.g.diff(f, self.total.time),
        }
    }

    /// The image of a section of the total system without the one along `d/dt`, that is number 0.
    fn image(&self, section: usize) -> Vec<ExprId> {
        match section.checked_sub(1) {
            Some(alpha) => self.velocities.iter().map(|row| row[alpha]).collect(),
            None => self.offsets.clone(),
        }
    }

    fn section(&self, section: usize) -> String {
        section.checked_sub(1).map_or("d/dt".to_owned(), |alpha| self.total.algebroid.frame()[alpha].clone())
    }

    /// `rho_a(phi^I) = Phi^A_a rhobar^I_A(phi)`, and rates that no velocity gives.
    fn anchors(&mut self) -> Result<(), NotQuotient> {
        let quotient = self.quotient;
        let (n, m) = (quotient.algebroid.n_base(), quotient.algebroid.rank());
        for i in 0..n {
            let row: Vec<ExprId> = (0..m).map(|a| quotient.algebroid.anchor(i, a)).collect();
            let row = self.pulled(&row)?;
            for section in 0..=self.total.algebroid.rank() {
                let along = self.along(section, self.base[i]);
                let image = self.image(section);
                let moved = self.g.dot(&row, &image);
                let residual = self.g.sub(along, moved);
                let (by, name) = (self.section(section), self.name(quotient.algebroid.base()[i]));
                self.vanishes(residual, || format!("the rate of `{name}` along {by}"));
            }
        }
        let own = self.total.own_rates.iter().map(|own| (own.symbol, own.rate)).collect();
        let pulled = self.pulled(&quotient.own_rates_of_base())?;
        for (i, rate) in pulled.into_iter().enumerate() {
            let along = self.g.derivative_along(self.base[i], &own);
            let residual = self.g.sub(along, rate);
            if residual != self.g.zero() {
                let name = self.name(quotient.algebroid.base()[i]);
                self.vanishes(residual, || format!("the rate of `{name}` of its own"));
            }
        }
        Ok(())
    }

    /// `rho_a(Phi^C_b) - rho_b(Phi^C_a) + Phi^A_a Phi^B_b Cbar^C_AB(phi) = C^c_ab Phi^C_c`, also with `d/dt`.
    fn brackets(&mut self) -> Result<(), NotQuotient> {
        let m = self.quotient.algebroid.rank();
        // The coefficients of the quotient on the image, by pairs of its sections.
        let mut coefficients: BTreeMap<(usize, usize), Vec<(usize, ExprId)>> = BTreeMap::new();
        for a in 0..=m {
            for b in a + 1..=m {
                let list = bracket(&self.quotient.algebroid, &mut self.other, (a, b));
                let values: Vec<ExprId> = list.iter().map(|(_, e)| *e).collect();
                let pulled = self.pulled(&values)?;
                if !list.is_empty() {
                    coefficients.insert((a, b), list.iter().map(|(c, _)| *c).zip(pulled).collect());
                }
            }
        }
        let rank = self.total.algebroid.rank();
        for a in 0..=rank {
            for b in a + 1..=rank {
                let (of_a, of_b) = (self.whole_image(a), self.whole_image(b));
                let bracket = bracket(&self.total.algebroid, &mut self.g, (a, b));
                for c in 0..m {
                    let mut terms = vec![self.along(a, of_b[c + 1])];
                    let back = self.along(b, of_a[c + 1]);
                    terms.push(self.g.neg(back));
                    for ((p, q), list) in &coefficients {
                        let Some((_, e)) = list.iter().find(|(k, _)| *k == c) else { continue };
                        let [forward, back] = [(p, q), (q, p)].map(|(p, q)| self.g.mul(of_a[*p], of_b[*q]));
                        let minor = self.g.sub(forward, back);
                        terms.push(self.g.mul(*e, minor));
                    }
                    for (k, e) in &bracket {
                        let term = self.g.mul(*e, self.velocities[c][*k]);
                        terms.push(self.g.neg(term));
                    }
                    let residual = self.g.sum(&terms);
                    let pair = [a, b].map(|s| self.section(s));
                    let name = self.name(self.quotient.velocities[c]);
                    self.vanishes(residual, || {
                        format!("the component along `{name}` of the bracket [{}, {}]", pair[0], pair[1])
                    });
                }
            }
        }
        Ok(())
    }

    /// The image of a section, with its component along `d/dt` first.
    fn whole_image(&self, section: usize) -> Vec<ExprId> {
        let along_time = if section == 0 { self.g.one() } else { self.g.zero() };
        [vec![along_time], self.image(section)].concat()
    }

    /// `L(x, y, t) = Lbar(phi, Phi y + Phi_0, t) + alpha_a(x, t) y^a`.
    fn lagrangians(&mut self) -> Result<(), NotQuotient> {
        let pulled = self.pulled(&[self.quotient.lagrangian])?[0];
        let difference = self.g.sub(self.total.lagrangian, pulled);
        let on_groups = self.on_groups(difference);
        let residual = match self.g.affine_parts(difference, &self.total.velocities) {
            Some((alpha, at_rest)) if !self.g.is_zero(on_groups) => {
                self.gyroscopic = [vec![self.g.zero()], alpha].concat();
                // A difference that is there at rest is told whole.
                let at_rest_on_groups = self.on_groups(at_rest);
                if self.g.is_zero(at_rest_on_groups) { at_rest } else { difference }
            }
            _ => difference,
        };
        self.vanishes(residual, || "the Lagrangian".to_owned());
        Ok(())
    }

    /// `dalpha(y, e_a)` for each section `e_a`: the rate of `alpha_a`, less the derivative of `alpha(y)` along `e_a`
    /// and `alpha([y, e_a])`.
    fn gyroscopic_forces(&mut self) -> Vec<ExprId> {
        let rank = self.total.algebroid.rank();
        if self.gyroscopic.is_empty() {
            return vec![self.g.zero(); rank];
        }
        let alpha = self.gyroscopic.clone();
        let velocities = self.total.velocities.iter().map(|y| self.g.sym(*y)).collect::<Vec<_>>();
        let motion = [vec![self.g.one()], velocities].concat();
        let own: BTreeMap<SymbolId, ExprId> =
            self.total.own_rates.iter().map(|own| (own.symbol, own.rate)).collect();
        let mut forces = Vec::with_capacity(rank);
        for a in 1..=rank {
            let mut terms = vec![self.g.derivative_along(alpha[a], &own)];
            for b in 0..=rank {
                let (forward, back) = (self.along(b, alpha[a]), self.along(a, alpha[b]));
                let mut of_pair = vec![forward, self.g.neg(back)];
                let (pair, is_turned) = if a < b { ((a, b), true) } else { ((b, a), false) };
                for (c, e) in bracket(&self.total.algebroid, &mut self.g, pair) {
                    let term = self.g.mul(e, alpha[c + 1]);
                    of_pair.push(if is_turned { term } else { self.g.neg(term) });
                }
                let sum = self.g.sum(&of_pair);
                terms.push(self.g.mul(motion[b], sum));
            }
            forces.push(self.g.sum(&terms));
        }
        forces
    }

    /// A form of the quotient on velocities of the total system, or on displacements.
    fn pulled_form(&mut self, form: &Form, of: Along) -> Result<Form, NotQuotient> {
        let velocities = self.pulled(&form.velocities)?;
        let quasi = self.pulled(&form.quasi)?;
        let offset = self.pulled(&[form.offset])?[0];
        let offset = match of {
            Along::Velocities => {
                let along = self.g.dot(&velocities, &self.offsets);
                self.g.add(offset, along)
            }
            Along::Displacements => offset,
        };
        let composed = (0..self.total.velocities.len()).map(|alpha| {
            let column: Vec<ExprId> = self.velocities.iter().map(|row| row[alpha]).collect();
            self.g.dot(&velocities, &column)
        });
        let velocities = composed.collect();
        Ok(Form { text: form.text.clone(), velocities, quasi, offset })
    }

    /// Demands that forms of the quotient hold where forms of the total system do: one by one, or all at once where
    /// they have quasi-velocities in common.
    fn holds(
        &mut self,
        (total, quotient): (&[Form], &[Form]),
        of: Along,
        relation: impl Fn(&[Form]) -> String,
    ) -> Result<(), NotQuotient> {
        let pulled: Vec<Form> =
            quotient.iter().map(|form| self.pulled_form(form, of)).collect::<Result<_, _>>()?;
        let has_quasi = pulled.iter().any(|form| !form.quasi.is_empty());
        let size = if has_quasi { pulled.len() } else { 1 };
        for forms in pulled.chunks(size.max(1)) {
            if !self.is_implied(total, forms) {
                self.violate(relation(forms));
            }
        }
        Ok(())
    }

    /// `Phi(M) in Mbar`.
    fn velocities_allowed(&mut self) -> Result<(), NotQuotient> {
        let (of_quotient, functions_of_quotient) = allowed(&mut self.other, self.quotient);
        let (forms, functions) = allowed(&mut self.g, self.total);
        let relation = |texts: &[&str]| {
            let s = if texts.len() == 1 { "" } else { "s" };
            format!("the constraint{s} `{}` on velocities that the total system allows", texts.join("`, `"))
        };
        self.holds((&forms, &of_quotient), Along::Velocities, |forms| {
            let texts: Vec<&str> = forms.iter().map(|form| form.text.as_str()).collect();
            relation(&texts)
        })?;
        for (text, function) in functions_of_quotient {
            self.n_conditions += 1;
            let pulled = self.pulled(&[function])?[0];
            let is_kept = functions.iter().any(|(_, e)| {
                let residuals = [self.g.sub(pulled, *e), self.g.add(pulled, *e)];
                residuals.into_iter().any(|e| {
                    let e = self.on_groups(e);
                    self.g.is_zero(e)
                })
            });
            if !is_kept {
                self.violate(relation(&[&text]));
            }
        }
        Ok(())
    }

    /// A condition between subspaces: values behind functions may tell rows apart that depend on each other.
    fn violate(&mut self, relation: String) {
        self.violated.push(NotQuotient::Violated { relation, residual: String::new(), is_proved: false });
    }

    /// `Phi(V) = Vbar`.
    fn displacements_allowed(&mut self) -> Result<(), NotQuotient> {
        let forms = reactions(&mut self.g, self.total);
        let of_quotient = reactions(&mut self.other, self.quotient);
        self.holds((&forms, &of_quotient), Along::Displacements, |_| {
            "the condition on displacements of the quotient".to_owned()
        })?;
        // The dimension of Phi(V): V is the kernel of the forms.
        self.n_conditions += 1;
        let zero = self.g.zero();
        let map: Vec<Form> = self
            .velocities
            .iter()
            .map(|row| Form { text: String::new(), velocities: row.clone(), quasi: Vec::new(), offset: zero })
            .collect();
        let alone = self.rank(&forms, &[]);
        let found = self.rank(&forms, &map) - alone;
        let wanted = dimension(&self.other, &of_quotient, self.quotient.velocities.len());
        if found != wanted && self.violated.is_empty() {
            self.violate(format!(
                "the condition on displacements, which reach {found} of {wanted} dimensions,"
            ));
        }
        self.displacements = (dimension(&self.g, &forms, self.total.velocities.len()), wanted);
        Ok(())
    }

    /// `F_a w^a = Fbar_A Phi^A_a w^a + dalpha(y, w)` for displacements `w`.
    fn forces(&mut self) -> Result<(), NotQuotient> {
        let zero = self.other.zero();
        let of_quotient = self.quotient.forces.clone();
        let form = Form { text: String::new(), velocities: of_quotient, quasi: Vec::new(), offset: zero };
        let pulled = self.pulled_form(&form, Along::Displacements)?.velocities;
        let gyroscopic = self.gyroscopic_forces();
        let mut power = Vec::with_capacity(pulled.len());
        for ((own, other), of_alpha) in self.total.forces.iter().zip(pulled).zip(gyroscopic) {
            let rest = self.g.sub(*own, other);
            let rest = self.g.sub(rest, of_alpha);
            power.push(self.g.cancel_zero(rest));
        }
        let forms = reactions(&mut self.g, self.total);
        let offset = self.g.zero();
        let power = Form { text: String::new(), velocities: power, quasi: Vec::new(), offset };
        if !self.is_implied(&forms, std::slice::from_ref(&power)) {
            let shown = power.velocities.iter().zip(self.total.algebroid.frame());
            let shown = shown.filter(|(e, _)| **e != self.g.zero());
            let shown: Vec<String> =
                shown.map(|(e, name)| format!("({}) {name}", self.g.display(*e, Style::Plain))).collect();
            let (relation, residual) = ("the power of the forces".to_owned(), shown.join(" + "));
            self.violated.push(NotQuotient::Violated { relation, residual, is_proved: false });
        }
        Ok(())
    }
}

/// The bracket of two sections, `d/dt` as number 0, sparse.
fn bracket(algebroid: &Algebroid, g: &mut Graph, (a, b): (usize, usize)) -> Vec<(usize, ExprId)> {
    match (a.checked_sub(1), b.checked_sub(1)) {
        (Some(a), Some(b)) => algebroid.bracket(g, a, b),
        (None, Some(b)) => algebroid.drift(b).to_vec(),
        _ => Vec::new(),
    }
}
