//! How a model is formulated before its equations are derived: everything that a scene or a search may choose.
//!
//! Does not know: how any choice is carried out.

use hamel_expr::{Graph, Rational};
use hamel_lang::spec::{Carried, CarriedBy, ConnectionKind, IdealChain, InnerProduct, LEVEL_MOMENTUM, Model};

/// What a chain of stages is used for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StageUse {
    /// For nothing: the algebra is not split.
    Unused,
    /// The algebra is split for those who read; the equations are those of the model's own frame.
    Shown,
    /// The equations are derived in the frame that is adapted to the stages; the state stays what it is.
    Internal,
    /// The state has the momenta along these levels, or elements of levels, by name in ascending order, and the
    /// velocities along the others.
    Carried(Vec<String>),
}

impl StageUse {
    /// What a model's own items use its stages for, or a scene's with what it carries.
    pub fn of(has_stages: bool, of_model: &[Carried], of_scene: &[Carried]) -> StageUse {
        let levels = carried(of_model, of_scene).find_map(|c| match &c.by {
            CarriedBy::Levels(momenta) => Some(momenta.clone()),
            _ => None,
        });
        match (has_stages, levels) {
            (true, Some(momenta)) => StageUse::Carried(momenta),
            (true, None) => StageUse::Shown,
            (false, _) => StageUse::Unused,
        }
    }

    /// Whether the state has variables along the levels.
    pub fn is_carried(&self) -> bool {
        matches!(self, StageUse::Carried(_))
    }
}

/// A chain of ideals, or an inner product, that the model does not write down.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundChain {
    /// Spanning vectors of `n_1, n_2, ..` in the basis of the algebra; none for the ideals of the model.
    pub ideals: Option<Vec<Vec<Vec<Rational>>>>,
    /// Whether the inner product is the kinetic energy, and not the one in which the basis of the algebra is
    /// orthonormal.
    pub by_energy: bool,
}

impl FoundChain {
    /// What the stages of a chain that the model does not write down are called.
    pub fn names(n: usize) -> Vec<String> {
        (0..n).map(|k| format!("stage{k}")).collect()
    }

    /// The chain, with names for its stages; none where it needs one of the model that is not there.
    pub(super) fn stages(&self, g: &mut Graph, of_model: Option<&IdealChain>) -> Option<IdealChain> {
        let inner_product = self.by_energy.then_some(InnerProduct::Lagrangian);
        let Some(ideals) = &self.ideals else {
            return of_model.map(|chain| IdealChain { inner_product, ..chain.clone() });
        };
        let n = ideals.len() + 1;
        let numbers = |g: &mut Graph, v: &[Rational]| v.iter().map(|q| g.rational(q.clone())).collect();
        Some(IdealChain {
            names: FoundChain::names(n),
            ideals: ideals.iter().map(|basis| basis.iter().map(|v| numbers(g, v)).collect()).collect(),
            inner_product,
            connection: None,
            momentum: of_model.map_or(LEVEL_MOMENTUM, |chain| &chain.momentum).to_owned(),
            spans: vec![None; n],
        })
    }
}

/// The choices that lead from a model to one [`ReducedSystem`](super::ReducedSystem) and its equations.
///
/// All of them describe the same motion, for the fixed parameters; they differ in state variables, in cost and in
/// rounding errors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Formulation {
    /// Parameters that are numbers, by name: folded exactly before anything is derived.
    pub fixed: Vec<(String, Rational)>,
    /// Inputs that stay inputs, by component; the others are held at their defaults, which are folded as `fixed` is.
    pub inputs: Vec<String>,
    /// The connection that is derived, with velocities `v = xi + A xdot`; none for the one that the model writes down.
    pub connection: Option<ConnectionKind>,
    /// Independent velocities, by index into base velocities, velocities in the algebra and quasi-velocities; none for
    /// those that are best to solve for.
    pub independent: Option<Vec<usize>>,
    /// Whether constraints that could be solved are kept with multipliers.
    pub multipliers: bool,
    /// Angles of the base that are carried as points of the circle.
    pub circles: Vec<String>,
    /// Whether squares of velocities in the Lagrangian are differentiated in the frame that turns with their
    /// components.
    pub squares: bool,
    /// Whether squares of velocities are computed along the recursions that the model is written in; none where that is
    /// done if it costs less.
    pub recursive: Option<bool>,
    /// Velocities for which the state carries a momentum, or a parameter is the momentum (Routh); none
    /// [by the velocity](CarriedBy::Velocity).
    pub momenta: Vec<Carried>,
    /// What the chain of ideals is used for.
    pub stages: StageUse,
    /// The chain of ideals; none for the one that the model writes down.
    pub chain: Option<FoundChain>,
}

impl Formulation {
    /// What a model's own items choose: its connection, independent velocities and stages, no parameter fixed, angles
    /// on the line.
    pub fn of(model: &Model) -> Formulation {
        Formulation {
            fixed: Vec::new(),
            inputs: Vec::new(),
            connection: model.derived_connection,
            independent: model.independent.clone(),
            // A Hamiltonian has no need of independent velocities.
            multipliers: model.force_multipliers
                || model.hamiltonian.is_some() && !model.constraints.is_empty(),
            circles: Vec::new(),
            squares: true,
            recursive: None,
            momenta: carried_by_momenta(model, &[]),
            stages: StageUse::of(model.stages.is_some(), &[], &model.carries),
            chain: None,
        }
    }

    /// Base coordinates that only a reconstruction needs, by index: the momenta of their velocities are parameters.
    pub fn cyclic_coordinates(&self, model: &Model) -> Vec<usize> {
        let n_base = model.n_shape();
        let is_cyclic = |c: &&Carried| c.velocity < n_base && matches!(c.by, CarriedBy::Parameter(_));
        self.momenta.iter().filter(is_cyclic).map(|c| c.velocity).collect()
    }

    /// Names of the coordinates that a reconstruction adds to the state, in its order: those of the group, then the
    /// cyclic ones.
    pub fn reconstructed(&self, model: &Model) -> Vec<String> {
        let of_group = model.reconstruction.iter().flat_map(|item| item.names.iter().cloned());
        let cyclic = self.cyclic_coordinates(model).into_iter().map(|k| model.base[k].name.clone());
        of_group.chain(cyclic).collect()
    }
}

/// What is carried by momenta: what a model says, and what a scene says in its place.
///
/// A Hamiltonian is a function of all momenta, which are carried unless something else is said.
pub fn carried_by_momenta(model: &Model, of_scene: &[Carried]) -> Vec<Carried> {
    let mut momenta: Vec<Carried> = carried(&model.carries, of_scene).cloned().collect();
    let of_hamiltonian = model.hamiltonian.map(|_| &model.momenta).into_iter().flatten();
    for (name, _, velocity) in of_hamiltonian.flat_map(|m| &m.components) {
        if momenta.iter().all(|own| own.velocity != *velocity) {
            momenta.push(Carried { velocity: *velocity, by: CarriedBy::Momentum(name.clone()) });
        }
    }
    momenta.retain(|carried| !matches!(carried.by, CarriedBy::Velocity | CarriedBy::Levels(_)));
    momenta.sort_by_key(|carried| carried.velocity);
    momenta
}

/// What a scene says about velocities, and what the model says about the others.
fn carried<'a>(of_model: &'a [Carried], of_scene: &'a [Carried]) -> impl Iterator<Item = &'a Carried> {
    let is_new = |carried: &&Carried| of_scene.iter().all(|own| own.velocity != carried.velocity);
    of_model.iter().filter(is_new).chain(of_scene)
}
