//! Explicit equations of motion as data.
//!
//! Does not know: how they were derived.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::ToPrimitive;

use crate::reduction::{CarriedMomentum, ReducedSystem};
use hamel_expr::{ExprId, Graph, Node, Section, Sign, Style, SymbolId, Vanishing, sign_of};
use hamel_lang::spec::Want;

use super::balance::Balance;
use super::solve::Pivot;

/// A state variable and its time derivative.
#[derive(Clone, Debug)]
pub struct StateEquation {
    /// Its symbol.
    pub symbol: SymbolId,
    /// Its name.
    pub name: String,
    /// What it is.
    pub doc: String,
    /// Its derivative, in terms of inputs and definitions; literally zero when the variable is constant.
    pub derivative: ExprId,
}

/// What an [`Output`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// What a scene wants by a word of the language.
    Group(Want),
    /// An output of the model, or an angle that is carried as a point of the circle.
    OfModel,
    /// A component of another output, which a scene wants by its own name.
    Component,
    /// What an event sets.
    After,
    /// The gradients of other outputs.
    Gradients,
    /// What the motion has besides the nonholonomic bracket with the energy.
    Remainder,
}

/// A group of numbers that a scene may ask for.
#[derive(Clone, Debug)]
pub struct Output {
    /// What it is.
    pub kind: OutputKind,
    /// Name of the group.
    pub name: String,
    /// Names and values of the components.
    pub components: Vec<(String, ExprId)>,
    /// What it is, with its formula.
    pub doc: String,
}

impl Output {
    /// The output that is wanted by a word of the language, which is its name.
    pub fn group(want: Want, components: Vec<(String, ExprId)>, doc: &str) -> Output {
        Output { kind: OutputKind::Group(want), name: want.name().into(), components, doc: doc.into() }
    }
}

/// What the derivation found out exactly.
#[derive(Clone, Debug, Default)]
pub struct Facts {
    /// State variables whose derivative vanishes identically.
    pub constants: Vec<String>,
    /// Whether the energy rate vanishes identically.
    pub energy_is_conserved: bool,
    /// Whether the rate of the energy could not be shown to vanish, nor not to.
    pub energy_is_unverified: bool,
    /// Base coordinates that the derivation mentions and no rate depends on: the state equations are taken where they
    /// are zero (a point of the circle: at the angle zero).
    pub taken_at_origin: Vec<String>,
    /// In the multiplier form: whether it vanishes once the constraint holds.
    pub energy_is_conserved_on_constraint: bool,
    /// For constraints that are affine in the velocities: whether they are integrable in space and time. Linear ones
    /// are where the allowed velocities form a subalgebroid at all times, and the same one.
    pub holonomic: Option<bool>,
    /// Casimirs, all verified to be conserved.
    pub casimirs: Vec<String>,
    /// In the multiplier form: Casimirs that are conserved where the constraints hold, verified.
    pub casimirs_on_constraint: Vec<String>,
    /// Whether a Lyapunov function is seen not to increase, where there is one.
    pub decrease: Option<Decrease>,
    /// Entropies that `virtual thermo` gives, and their sum where there are several.
    pub entropies: Vec<Production>,
    /// Whether the frame's bracket is that of an almost algebra or almost algebroid, of which the Jacobi identity is
    /// not claimed: energy is conserved nevertheless, Casimirs of the bracket need not exist.
    pub bracket_is_almost: bool,
    /// Whether the matrix `A` of `A udot = f` depends on parameters alone.
    pub mass_matrix_is_constant: bool,
    /// Whether `A` (the Hessian `L_yy` in the multiplier form) is symmetric.
    pub mass_matrix_is_symmetric: bool,
}

impl Facts {
    /// Whether the energy stays along every motion that satisfies the constraints.
    pub fn conserves_energy(&self) -> bool {
        self.energy_is_conserved || self.energy_is_conserved_on_constraint
    }
}

/// Whether a Lyapunov function is seen not to increase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decrease {
    /// Its rate is zero.
    Conserved,
    /// Its rate is never positive.
    Proved,
    /// Nothing is seen of the sign of its rate.
    Unseen,
}

/// Whether an entropy, or a sum of entropies, is seen to grow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Production {
    /// The entropies.
    pub names: Vec<String>,
    /// Whether the rate is proved not to be negative.
    pub is_produced: bool,
}

/// What became of the momentum along a section.
#[derive(Clone, Debug)]
pub struct SectionMomentum {
    /// Name of the section.
    pub name: String,
    /// Its rate along the motion, zero where it is seen to vanish.
    pub rate: ExprId,
    /// Whether the rate vanishes identically.
    pub verdict: Vanishing,
    /// Whether the section is one of virtual displacements, so that no reaction acts along it; none where that could
    /// not be found out.
    pub is_displacement: Option<bool>,
}

/// The form of the equations of motion that was solved for the rates.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Form {
    /// `A udot = f` for the accelerations of the velocities that the state carries.
    Accelerations(LinearSystem),
    /// Accelerations of linked bodies, found body by body: no `A udot = f`, and no energy, momenta or multipliers,
    /// which nobody asked for.
    Rates {
        /// Names of the unknowns `u`.
        unknowns: Vec<String>,
    },
    /// The momentum equation of all momenta that the state carries: nothing is solved for accelerations.
    Momenta,
    /// Rates that the model gives: nothing is derived from a Lagrangian.
    Given,
}

/// `A udot = f`.
#[derive(Clone, Debug)]
pub struct LinearSystem {
    /// `A`.
    pub mass_matrix: Vec<Vec<ExprId>>,
    /// `f`.
    pub force: Vec<ExprId>,
    /// Names of the unknowns `u`.
    pub unknowns: Vec<String>,
    /// How the accelerations are differentiated. The state has momenta, or velocities along stages, where there is
    /// none.
    pub balance: Option<Box<Balance>>,
}

/// The momenta that the state carries as functions of the velocities that they stand for:
/// `pi_b = W^a_b dL/dy^a` at `y = Psi u + psi0`; and velocities along the levels of stages by those of the model.
#[derive(Clone, Debug, Default)]
pub struct Legendre {
    /// Names and symbols of the velocities, which are no part of the state.
    pub velocities: Vec<(String, SymbolId)>,
    /// Names and values of the momenta, in the same order, and of velocities along levels.
    pub momenta: Vec<(String, ExprId)>,
}

/// Explicit equations of motion: definitions in order, and what they are for.
#[derive(Clone, Debug)]
pub struct Equations {
    /// The system they belong to; its graph owns all expressions here.
    pub system: ReducedSystem,
    /// Definitions in order.
    pub sections: Vec<Section>,
    /// All velocities `y`, in frame order, by the state and the definitions.
    pub velocities: Vec<ExprId>,
    /// State equations in state order.
    pub state: Vec<StateEquation>,
    /// Equations of the reconstructed coordinates.
    pub reconstruction: Vec<StateEquation>,
    /// Definitions that differ from the one of the same name, being its value at a place such as `phi=0`, the origin of
    /// an ignorable coordinate.
    pub taken_at: BTreeMap<SymbolId, String>,
    /// The form that was solved for the rates of the velocities.
    pub form: Form,
    /// `E = p.y - L`; zero where the motion has none, see [`Equations::has_energy`], and where it was not asked for,
    /// see [`Equations::is_whole`].
    pub energy: ExprId,
    /// `dE/dt` along the motion.
    pub energy_rate: ExprId,
    /// The momenta of the state by velocities; empty where the state carries none.
    pub legendre: Legendre,
    /// Momenta, multipliers, casimirs, constraint residuals, outputs of the model.
    pub outputs: Vec<Output>,
    /// What became of the momenta along the sections of the model, which are outputs.
    pub along_sections: Vec<SectionMomentum>,
    /// Everything that is divided by in a linear solve, and what to call it.
    pub pivots: Vec<Pivot>,
    /// What was found.
    pub facts: Facts,
    /// Every symbol that changes along a motion: inputs and definitions.
    pub(super) varying: BTreeSet<SymbolId>,
}

impl Equations {
    /// The velocities in the place of which the state, or a parameter, has momenta, by the state and the definitions.
    pub fn velocities_of_momenta(&self) -> Vec<(SymbolId, ExprId)> {
        let given = self.outputs.iter().find(|o| o.kind == OutputKind::Group(Want::Velocities));
        let given = |name: &str| given?.components.iter().find(|(own, _)| own == name).map(|(_, e)| *e);
        let of_momentum = |momentum: &CarriedMomentum| {
            let unknown = &self.system.unknowns[momentum.unknown];
            let along = unknown.frame_idx.filter(|k| self.system.velocities[*k] == unknown.symbol);
            let value = along.map(|k| self.velocities[k]).or_else(|| given(&unknown.name));
            Some((unknown.symbol, value?))
        };
        self.system.momenta.iter().filter_map(of_momentum).collect()
    }

    /// The system `A udot = f`, where the equations have that form.
    pub fn linear_system(&self) -> Option<&LinearSystem> {
        match &self.form {
            Form::Accelerations(system) => Some(system),
            Form::Rates { .. } | Form::Momenta | Form::Given => None,
        }
    }

    /// Whether everything was made, and not the rates alone: see [`Extent`](super::Extent).
    pub fn is_whole(&self) -> bool {
        !matches!(self.form, Form::Rates { .. })
    }

    /// Names of the velocities along which forces are told, where all velocities of the state are the model's own.
    pub fn names_of_velocities(&self) -> &[String] {
        match (&self.form, self.balanced_system()) {
            (Form::Rates { unknowns }, _) => unknowns,
            (_, Some((system, _))) => &system.unknowns,
            (_, None) => &[],
        }
    }

    /// The linear system with its balance, where all velocities of the state are the model's own: none where the
    /// state has momenta, velocities along stages, or nothing is solved for accelerations.
    pub fn balanced_system(&self) -> Option<(&LinearSystem, &Balance)> {
        let system = self.linear_system()?;
        let balance = system.balance.as_deref().filter(|balance| !balance.forces.is_empty())?;
        Some((system, balance))
    }

    /// The graph, with definitions that are values at a place called so: `X1|phi=0`.
    pub fn labelled(&self) -> Graph {
        let mut g = self.system.graph.clone();
        for (symbol, place) in &self.taken_at {
            let name = format!("{}|{place}", g.name(*symbol));
            g.rename(*symbol, name);
        }
        g
    }

    /// Definitions that expressions need, one through another.
    pub fn needed(&self, roots: impl IntoIterator<Item = ExprId>) -> BTreeSet<SymbolId> {
        let g = &self.system.graph;
        let definitions: BTreeMap<SymbolId, ExprId> = (self.sections.iter())
            .flat_map(|section| section.definitions.iter().map(|d| (d.symbol, d.expr)))
            .collect();
        let mut pending: Vec<ExprId> = roots.into_iter().collect();
        let mut needed = BTreeSet::new();
        while let Some(e) = pending.pop() {
            for symbol in g.free_symbols(e) {
                if let Some(value) = definitions.get(&symbol)
                    && needed.insert(symbol)
                {
                    pending.push(*value);
                }
            }
        }
        needed
    }

    /// Definitions of the motion and its results; derivatives and inverse dynamics need further ones.
    pub fn of_motion(&self) -> BTreeSet<SymbolId> {
        let state = self.state.iter().chain(&self.reconstruction).map(|s| s.derivative);
        let outputs = self.outputs.iter().flat_map(|o| o.components.iter().map(|(_, e)| *e));
        let system = self.linear_system().into_iter();
        let matrix = system.flat_map(|s| s.mass_matrix.iter().flatten().chain(&s.force).copied());
        let along = self.along_sections.iter().map(|section| section.rate);
        let momenta = self.legendre.momenta.iter().map(|(_, e)| *e);
        let pivots = self.pivots.iter().map(|pivot| pivot.expr);
        let velocities = self.velocities.iter().copied();
        let results = state.chain(outputs).chain(matrix).chain(along).chain(momenta).chain(pivots);
        self.needed(results.chain(velocities).chain([self.energy, self.energy_rate]))
    }

    /// Whether the motion follows from a Lagrangian or a Hamiltonian, and has an energy.
    pub fn has_energy(&self) -> bool {
        !matches!(self.form, Form::Given)
    }

    /// Every result in order, what a scene can ask for and what `explain` shows, to be replaced by equal ones.
    pub fn results_mut(&mut self) -> Vec<&mut ExprId> {
        let Equations {
            system: _,
            sections: _,
            velocities: _,
            state,
            reconstruction,
            taken_at: _,
            form,
            energy,
            energy_rate,
            legendre,
            outputs,
            along_sections,
            pivots,
            facts: _,
            varying: _,
        } = self;
        let state = state.iter_mut().chain(reconstruction).map(|s| &mut s.derivative);
        let outputs = outputs.iter_mut().flat_map(|o| o.components.iter_mut().map(|(_, e)| e));
        let linear = match form {
            Form::Accelerations(system) => Some(system),
            Form::Rates { .. } | Form::Momenta | Form::Given => None,
        };
        let matrix =
            linear.into_iter().flat_map(|LinearSystem { mass_matrix, force, unknowns: _, balance }| {
                let balance = balance.iter_mut().flat_map(|balance| balance.values_mut());
                mass_matrix.iter_mut().flatten().chain(force).chain(balance)
            });
        let pivots = pivots.iter_mut().flat_map(|p| {
            let origin = p
                .origin
                .iter_mut()
                .flat_map(|o| o.updates.iter_mut().flatten().chain(&mut o.entries).chain([&mut o.entry]));
            [&mut p.expr].into_iter().chain(origin)
        });
        let along = along_sections.iter_mut().map(|section| &mut section.rate);
        let Legendre { velocities: _, momenta } = legendre;
        let momenta = momenta.iter_mut().map(|(_, e)| e);
        state
            .chain(outputs)
            .chain(momenta)
            .chain(matrix)
            .chain(pivots)
            .chain(along)
            .chain([energy, energy_rate])
            .collect()
    }

    /// Every result in the order of [`Equations::results_mut`].
    pub fn results(&mut self) -> Vec<ExprId> {
        self.results_mut().into_iter().map(|e| *e).collect()
    }

    /// Whether the Hessian `L_yy` is seen to have no negative eigenvalue at any state: the terms of the Lagrangian that
    /// are not linear in the velocities are quadratic polynomials in them that are never negative, such as squares.
    pub fn hessian_is_a_sum_of_squares(&self) -> bool {
        let system = &self.system;
        // Nodes made for the proof are no part of the equations.
        let mut g = system.graph.clone();
        let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
        g.summands(system.lagrangian).into_iter().all(|(term, weight)| {
            let degree = degree_in(&g, &velocities, term);
            if degree.is_some_and(|n| n < 2) {
                return true;
            }
            let is_quadratic = degree == Some(2) || {
                let mut second = Vec::new();
                for y in &velocities {
                    let slope = g.diff(term, *y);
                    second.extend(velocities.range(y..).map(|z| g.diff(slope, *z)));
                }
                if second.iter().all(|e| *e == g.zero()) {
                    return true;
                }
                second.iter().all(|e| !g.depends_on(*e, &velocities))
            };
            let term = g.scale(term, &weight);
            is_quadratic && matches!(sign_of(&g, term, &system.signs), Sign::Positive | Sign::NonNegative)
        })
    }

    /// Whether an expression depends on parameters alone, also through definitions.
    pub fn is_parameter_only(&self, e: ExprId) -> bool {
        self.is_parameter_only_in(&self.system.graph, e)
    }

    /// The same for an expression of a graph that has grown from that of the equations.
    pub(super) fn is_parameter_only_in(&self, g: &Graph, e: ExprId) -> bool {
        !g.depends_on(e, &self.varying)
    }

    /// An expression of these equations as text.
    pub fn display(&self, e: ExprId, style: Style) -> String {
        self.system.graph.display(e, style)
    }
}

/// The degree of a polynomial in the `symbols`, as it is written; none where it is no polynomial in them.
pub(super) fn degree_in(g: &Graph, symbols: &BTreeSet<SymbolId>, e: ExprId) -> Option<usize> {
    let mut degrees: BTreeMap<ExprId, Option<usize>> = BTreeMap::new();
    for e in g.reachable(&[e]) {
        let degree = match g.node(e) {
            Node::Symbol(s) => Some(usize::from(symbols.contains(s))),
            Node::Sum { terms, .. } => {
                terms.iter().try_fold(0, |most, (term, _)| Some(degrees[term]?.max(most)))
            }
            Node::Product { factors, .. } => {
                factors.iter().try_fold(0, |total, (base, q)| match degrees[base]? {
                    0 => Some(total),
                    n => Some(total + n * q.is_integer().then(|| q.to_integer().to_usize())??),
                })
            }
            node => {
                let mut is_free = true;
                node.for_each_operand(|operand| is_free &= degrees[&operand] == Some(0));
                is_free.then_some(0)
            }
        };
        degrees.insert(e, degree);
    }
    degrees[&e]
}
