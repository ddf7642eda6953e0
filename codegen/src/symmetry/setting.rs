//! An unreduced model as functions of coordinates `z`, velocities `y` and displacements `w`, and the fields that may be
//! symmetries of it.
//!
//! Does not know: which fields are symmetries, how a model is written.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Graph, Rational, SymbolId};
use hamel_lang::spec::group_motion::{group_rates, rational_element};
use hamel_lang::spec::{CarriedBy, ConstraintKind, Domain, Model, Side};
use num_traits::Zero;

use super::angles::TurnedField;
use super::marked::Marked;

/// A field of the ansatz, with rational coefficients in front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Generator {
    /// A field of angles.
    Turned(TurnedField),
    /// `g' = g e_a` of a configuration.
    Right(usize, usize),
    /// `q_j' = q_i` of base coordinates `i`, `j`.
    Linear(usize, usize),
    /// `q_i' = 1`.
    Translation(usize),
    /// `g' = e_a g`.
    Left(usize, usize),
}

/// The images of symbols under a field: `z`, `y` and `w`.
pub(super) type Images = BTreeMap<SymbolId, ExprId>;

/// An unreduced system.
pub(super) struct Setting<'a> {
    pub(super) model: &'a Model,
    pub(super) graph: Graph,
    /// Velocities of the base coordinates, then of the algebra.
    pub(super) velocities: Vec<SymbolId>,
    /// Displacements along them, which forces are paired with.
    pub(super) displacements: Vec<SymbolId>,
    /// The ansatz, what can be a coordinate of the group last.
    pub(super) generators: Vec<Generator>,
    images: Vec<Images>,
    /// Elements of the groups by free symbols, for the coordinates of configurations.
    elements: BTreeMap<SymbolId, ExprId>,
    /// What depends on velocities.
    pub(super) kinetic: ExprId,
    /// `-L` at rest.
    pub(super) potential: ExprId,
    /// The power of the forces along the displacements.
    pub(super) power: ExprId,
    /// Residuals of constraints.
    pub(super) constraints: Vec<ExprId>,
    /// The row of an attitude that advects.
    pub(super) marked: Option<Marked>,
}

/// Why a model cannot be reduced here: what it has, and what to do.
pub(super) struct Refusal(pub(super) String, pub(super) String);

/// More base coordinates have too many linear fields to be looked at.
pub(super) const MAX_LINEAR: usize = 7;

/// The place of the first constraint in [`Setting::brought`].
pub(super) const FIRST_CONSTRAINT: usize = 2;

fn refused(model: &Model) -> Option<Refusal> {
    let velocities_of_groups: usize = model.configurations.iter().map(|c| c.velocities.len()).sum();
    let has = |what: &str, help: &str| Some(Refusal(what.to_owned(), help.to_owned()));
    if model.action == Side::Right {
        return has(
            "an action from the right",
            "write the configuration with velocities of the body: leave `action right` out",
        );
    }
    if velocities_of_groups != model.velocities.len() || model.algebroid.is_some() {
        let help = "write the Lagrangian by coordinates and `configuration` items alone";
        return has("velocities of an algebra that no configuration has", help);
    }
    if model.advected.len() != model.configurations.len() {
        return has("advected parameters", "it is reduced by what moves them: write them by a configuration");
    }
    if model.configurations.iter().any(|c| !c.relative.is_empty()) {
        return has("a configuration relative to another", "write the attitude in space");
    }
    if model.hamiltonian.is_some() || model.given.is_some() {
        return has("no Lagrangian", "give a Lagrangian in coordinates");
    }
    if model.frame.is_some() || !model.quasi_velocities.is_empty() {
        return has("quasi-velocities", "write the constraints by velocities of coordinates");
    }
    if !model.modes.is_empty() {
        return has("modes", "leave them out, with the events that enter and leave them");
    }
    if model.lyapunov.is_some() {
        return has("an actuator", "leave `actuate` and `lyapunov` out: they are added to the reduced model");
    }
    if model.carries.iter().any(|carried| carried.by != CarriedBy::Velocity) {
        return has(
            "momenta in the state",
            "leave `carry` and `routh` out: the reduced model has the momenta of its own velocities",
        );
    }
    if !model.first_order.is_empty() {
        return has("states of first order", "leave them out: what they move is added to the reduced model");
    }
    if !model.noises.is_empty() {
        return has("noise", "leave it out: it is added to the reduced model");
    }
    if !model.virtual_constraints.is_empty() {
        return has("conditions on displacements", "they are added to the reduced model");
    }
    if model.constraints.iter().any(|c| c.kind != ConstraintKind::Linear || c.position.is_some()) {
        return has(
            "a constraint that is not linear in the velocities",
            "equations between positions are solved by coordinates that keep them",
        );
    }
    None
}

impl Setting<'_> {
    pub(super) fn new(model: &Model) -> Result<Setting<'_>, Refusal> {
        if let Some(refusal) = refused(model) {
            return Err(refusal);
        }
        let mut graph = model.graph.clone();
        let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
        let displacements: Vec<SymbolId> =
            (0..velocities.len()).map(|k| graph.symbol(&format!("'delta{k}"))).collect();
        let rest: Images = velocities.iter().map(|y| (*y, graph.zero())).collect();
        let no_value = |_| {
            Refusal(
                "a Lagrangian without a value at rest".into(),
                "write it without quotients of velocities".into(),
            )
        };
        let at_rest = graph.subs(model.lagrangian, &rest).map_err(no_value)?;
        let kinetic = graph.sub(model.lagrangian, at_rest);
        let potential = graph.neg(at_rest);
        let pairs: Vec<ExprId> = displacements.iter().map(|w| graph.sym(*w)).collect();
        let power = graph.dot(&model.forces, &pairs);
        let constraints = model.constraints.iter().map(|c| c.residual).collect();
        let mut setting = Setting {
            model,
            graph,
            velocities,
            displacements,
            generators: Vec::new(),
            images: Vec::new(),
            elements: BTreeMap::new(),
            kinetic,
            potential,
            power,
            constraints,
            marked: None,
        };
        setting.add_elements()?;
        setting.add_generators();
        Ok(setting)
    }

    fn add_elements(&mut self) -> Result<(), Refusal> {
        for (k, configuration) in self.model.configurations.iter().enumerate() {
            let dim = configuration.group.algebra().dim();
            let free: Vec<ExprId> = (0..dim)
                .map(|a| {
                    let symbol = self.graph.symbol(&format!("'element{k}_{a}"));
                    self.graph.sym(symbol)
                })
                .collect();
            let Some(entries) = rational_element(&mut self.graph, &configuration.group, &free) else {
                let what = format!("a configuration in {}", configuration.group.of_configuration());
                return Err(Refusal(what, "SO(3), SE(2), SE(3) and SU(2) are looked into".into()));
            };
            self.elements.extend(configuration.symbols.iter().copied().zip(entries));
        }
        Ok(())
    }

    fn add_generators(&mut self) {
        let mut list: Vec<Generator> = self.turned_fields().into_iter().map(Generator::Turned).collect();
        for (k, configuration) in self.model.configurations.iter().enumerate() {
            list.extend((0..configuration.velocities.len()).map(|a| Generator::Right(k, a)));
        }
        let of_domain = |domain: Domain| -> Vec<usize> {
            (0..self.model.base.len()).filter(|i| self.model.base[*i].domain == domain).collect()
        };
        let (real, angles) = (of_domain(Domain::Real), of_domain(Domain::Angle));
        if real.len() <= MAX_LINEAR {
            list.extend(real.iter().flat_map(|i| real.iter().map(move |j| Generator::Linear(*i, *j))));
        }
        list.extend(real.iter().map(|i| Generator::Translation(*i)));
        list.extend(angles.into_iter().map(Generator::Translation));
        for (k, configuration) in self.model.configurations.iter().enumerate() {
            list.extend((0..configuration.velocities.len()).map(|a| Generator::Left(k, a)));
        }
        self.images = list.iter().map(|generator| self.images_of(*generator)).collect();
        self.generators = list;
    }

    fn images_of(&mut self, generator: Generator) -> Images {
        let (model, n_base) = (self.model, self.model.base.len());
        if let Generator::Turned(field) = generator {
            return self.images_of_turned(&field);
        }
        let g = &mut self.graph;
        match generator {
            Generator::Turned(_) => Images::new(),
            Generator::Translation(i) => Images::from([(model.base[i].symbol, g.one())]),
            Generator::Linear(i, j) => {
                let pairs = [
                    (model.base[i].symbol, model.base[j].symbol),
                    (self.velocities[i], self.velocities[j]),
                    (self.displacements[i], self.displacements[j]),
                ];
                pairs.into_iter().map(|(from, to)| (to, g.sym(from))).collect()
            }
            Generator::Left(k, a) | Generator::Right(k, a) => {
                let configuration = &model.configurations[k];
                let coordinates: Vec<ExprId> = configuration.symbols.iter().map(|s| g.sym(*s)).collect();
                let unit: Vec<ExprId> = (0..configuration.velocities.len())
                    .map(|b| if a == b { g.one() } else { g.zero() })
                    .collect();
                let is_left = matches!(generator, Generator::Left(..));
                // A field from the left turns as a right action moves.
                let side = if is_left { Side::Right } else { Side::Left };
                let rates = group_rates(g, &configuration.group, &coordinates, &unit, side);
                let mut images: Images = configuration.symbols.iter().copied().zip(rates).collect();
                if is_left {
                    return images;
                }
                // xi' = [xi, e_a].
                let algebra = configuration.group.algebra();
                for all in [&self.velocities, &self.displacements] {
                    let own: Vec<SymbolId> =
                        configuration.velocities.iter().map(|b| all[n_base + b]).collect();
                    let mut rates: Vec<Vec<(ExprId, Rational)>> = vec![Vec::new(); own.len()];
                    for (b, symbol) in own.iter().enumerate() {
                        let xi = g.sym(*symbol);
                        for (c, q) in algebra.bracket(b, a) {
                            rates[c].push((xi, q));
                        }
                    }
                    let rates = rates.into_iter().map(|terms| g.linear_combination(&terms));
                    images.extend(own.iter().copied().zip(rates.collect::<Vec<_>>()));
                }
                images
            }
        }
    }

    /// The images under `sum_j c_j X_j`.
    pub(super) fn field(&mut self, c: &[Rational]) -> Images {
        let mut sums: BTreeMap<SymbolId, Vec<(ExprId, Rational)>> = BTreeMap::new();
        for (images, q) in self.images.iter().zip(c).filter(|(_, q)| !q.is_zero()) {
            for (symbol, e) in images {
                sums.entry(*symbol).or_default().push((*e, q.clone()));
            }
        }
        sums.into_iter().map(|(symbol, terms)| (symbol, self.graph.linear_combination(&terms))).collect()
    }

    /// One more image under a generator.
    pub(super) fn add_image(&mut self, j: usize, symbol: SymbolId, image: ExprId) {
        self.images[j].insert(symbol, image);
    }

    /// The images under a generator.
    pub(super) fn generator(&self, j: usize) -> &Images {
        &self.images[j]
    }

    /// A function on the groups, by free symbols.
    pub(super) fn on_groups(&mut self, e: ExprId) -> ExprId {
        // Entries of matrices stand in no denominator of a model that has a value near the identity.
        self.graph.subs(e, &self.elements).unwrap_or(e)
    }

    /// Whether a function vanishes on the groups: proved.
    pub(super) fn vanishes(&mut self, e: ExprId) -> bool {
        let e = self.on_groups(e);
        self.graph.is_zero(e)
    }

    /// A coordinate of a configuration by free symbols.
    pub(super) fn element(&self, symbol: SymbolId) -> Option<ExprId> {
        self.elements.get(&symbol).copied()
    }

    /// Functions that are brought to the cross-section: the potential energy, the power of the forces, and from
    /// [`FIRST_CONSTRAINT`] on residuals of constraints.
    pub(super) fn brought(&self) -> Vec<ExprId> {
        [vec![self.potential, self.power], self.constraints.clone()].concat()
    }

    /// Whether one base coordinate is an angle.
    pub(super) fn is_angle(&self, i: usize) -> bool {
        self.model.base[i].domain == Domain::Angle
    }
}
