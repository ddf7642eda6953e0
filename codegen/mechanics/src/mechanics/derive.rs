//! From a system on a Lie algebroid to explicit equations: the contents.
//!
//! [`derive`] reads as the derivation does: velocities, kinematics, momenta (`momenta`), accelerations (`constrained`
//! or `multipliers`), results (`results`). Does not know: where the algebroid came from.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use crate::reduction::{KinematicConstraint, ReducedSystem};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SectionWriter, Stage, SymbolId};
use hamel_lang::algebra::tableau::Pen;

use super::equations::{Equations, LinearSystem};
use super::lifted::Lifted;
use super::recursion::Recursion;
use super::rows::Answered;
use super::solve::{Factorisation, Pivot};

/// Derives `W^alpha_b E_alpha = 0` with
/// `E_alpha = d/dt p_alpha + C^gamma_{alpha beta} y^beta p_gamma - N^gamma_alpha p_gamma - rho^i_alpha dL/dx^i - F_alpha`,
/// solved for the accelerations; `N` is the drift of the frame, zero unless the frame depends on time.
///
/// # Errors
/// [`Error::SingularMassMatrix`] with the direction, [`Error::NotConserved`] for a claimed Casimir,
/// [`Error::DivisionByZero`], [`Error::OverBudget`].
///
/// # Source
/// Cortes, de Leon, Marrero, Martinez 2009, equations (3.5) and (3.7); Cendra, Marsden, Ratiu 2001.
pub fn derive(system: &ReducedSystem) -> Result<Equations, Error> {
    derive_to(system, Extent::Whole)
}

/// As [`derive()`], as far as somebody asks.
///
/// # Errors
/// As [`derive()`].
pub fn derive_to(system: &ReducedSystem, extent: Extent) -> Result<Equations, Error> {
    system.graph.within_budget()?;
    let mut d = Derivation { extent: extent.of(system), ..Derivation::new(system) };
    let equations = d.run();
    // Beside a graph that is past its budget, whatever else seems wrong says nothing.
    d.g.within_budget()?;
    let equations = equations?;
    equations.system.graph.within_budget()?;
    Ok(equations)
}

/// How much of the equations is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Of linked bodies the rates and what they divide by: for a scene that wants nothing else. Their mass matrix,
    /// momenta and the rate of their energy have terms for each pair of bodies, where the rates have some for each
    /// body.
    Rates,
    /// Everything.
    Whole,
}

impl Extent {
    /// All of a system that names momenta or the values of multipliers, whatever is asked for.
    fn of(self, system: &ReducedSystem) -> Extent {
        let multipliers: BTreeSet<SymbolId> = system.multipliers.iter().map(|(_, symbol)| *symbol).collect();
        let mut outputs = system.outputs.iter().flat_map(|output| &output.components);
        let has_multipliers = outputs.any(|(_, e)| system.graph.depends_on(*e, &multipliers));
        if has_multipliers || !system.sections.is_empty() || !system.casimirs.is_empty() {
            return Extent::Whole;
        }
        self
    }
}

/// The accelerations and what else the solve gives.
pub(super) struct Motion {
    /// `ydot`, one per velocity.
    pub(super) acceleration: Vec<ExprId>,
    /// `udot`, one per unknown.
    pub(super) unknown_rates: Vec<ExprId>,
    /// `lambda_A`, one per constraint.
    pub(super) multipliers: Vec<(String, ExprId)>,
    /// The one-forms that they act along.
    pub(super) reactions: Vec<Vec<ExprId>>,
    /// What was solved for the accelerations; none for a Hamiltonian, and where the rates alone are asked for.
    pub(super) system: Option<LinearSystem>,
    pub(super) pivots: Vec<Pivot>,
    /// The rates of [`ReducedSystem::momenta`].
    pub(super) momentum_rates: Vec<ExprId>,
    /// Velocities after impacts, by the symbols that stand for them.
    pub(super) after: Vec<(SymbolId, ExprId)>,
}

/// The stage of momenta in the state, from which velocities follow.
pub(super) struct Transform {
    /// `A = W^T L_yy Psi`, `L_yy` where multipliers keep the constraint.
    pub(super) matrix: Vec<Vec<ExprId>>,
    pub(super) factors: Factorisation,
    /// Definitions up to the velocities that follow from momenta.
    pub(super) n_known: usize,
}

/// The stage of the velocities: how the dependent ones are written.
pub(super) enum Velocities {
    /// As the constraint is solved for them, if there is one.
    Solved,
    /// By the rows of the constraint.
    ByRows(Rc<Answered>),
    /// By the parts of linked bodies.
    ByRecursion(Rc<Recursion>),
    /// By a mechanical connection.
    ByLift(Rc<Lifted>),
}

impl Velocities {
    pub(super) fn answered(&self) -> Option<Rc<Answered>> {
        match self {
            Velocities::ByRows(answered) => Some(Rc::clone(answered)),
            Velocities::Solved | Velocities::ByRecursion(_) | Velocities::ByLift(_) => None,
        }
    }

    pub(super) fn recursion(&self) -> Option<Rc<Recursion>> {
        match self {
            Velocities::ByRecursion(recursion) => Some(Rc::clone(recursion)),
            Velocities::Solved | Velocities::ByRows(_) | Velocities::ByLift(_) => None,
        }
    }

    pub(super) fn lifted(&self) -> Option<Rc<Lifted>> {
        match self {
            Velocities::ByLift(lifted) => Some(Rc::clone(lifted)),
            Velocities::Solved | Velocities::ByRows(_) | Velocities::ByRecursion(_) => None,
        }
    }
}

/// The stage of the forces, everything in `-E_alpha` except the Hessian times `ydot`.
#[derive(Default)]
pub(super) struct Forces {
    /// `(N^gamma_alpha - C^gamma_{alpha beta} y^beta) p_gamma + rho^i_alpha dL/dx^i + F_alpha - (dp_alpha/dx^i xdot^i + dp_alpha/dt)`.
    pub(super) drive: Vec<ExprId>,
    /// That of the Lagrangian without squares of velocities, where there is a [`Recursion`].
    pub(super) of_rest: Vec<ExprId>,
    /// `lag`, the accelerations of the velocities at `udot = 0`, and `drive - L_yy lag`, where rows give them before
    /// the forces are made.
    pub(super) at_rest: Option<(Vec<ExprId>, Vec<ExprId>)>,
}

/// What every stage writes to, and the stages that are done.
pub(super) struct Derivation<'a> {
    pub(super) system: &'a ReducedSystem,
    extent: Extent,
    pub(super) g: Graph,
    pub(super) writer: SectionWriter,
    pub(super) names: Vec<String>,
    /// Dependent velocities and what replaces them: `y = Psi u + psi0`.
    pub(super) replacement: BTreeMap<SymbolId, ExprId>,
    /// `y^alpha` after replacement.
    pub(super) y: Vec<ExprId>,
    /// `xdot^i`.
    pub(super) rates: Vec<ExprId>,
    /// `p_alpha`.
    pub(super) momentum: Vec<ExprId>,
    /// `d^2 L / dy dy`.
    pub(super) hessian: Vec<Vec<ExprId>>,
    /// None where the state has velocities alone.
    pub(super) transform: Option<Transform>,
    /// Of the velocities.
    pub(super) way: Velocities,
    /// Empty for a Hamiltonian, and for a motion that is given.
    pub(super) forces: Forces,
    /// The value of [`Feedback::response`](crate::reduction::Feedback::response).
    pub(super) response: Option<ExprId>,
}

impl<'a> Derivation<'a> {
    fn run(&mut self) -> Result<Equations, Error> {
        let motion = self.motion()?;
        self.g.enter(Stage::Results);
        self.finish(motion)
    }

    /// Whether more is made than the rates: always, but along a recursion.
    pub(super) fn is_whole(&self) -> bool {
        self.extent == Extent::Whole || self.way.recursion().is_none()
    }

    /// Velocities, their rates and those of the coordinates, before anything is asked about them.
    pub(super) fn motion(&mut self) -> Result<Motion, Error> {
        self.g.enter(Stage::Derivation);
        match &self.system.hamiltonian {
            Some(hamiltonian) => {
                self.velocities_of(hamiltonian)?;
                self.kinematics()?;
            }
            None if self.system.accelerations.is_some() => {
                self.velocities()?;
                self.kinematics()?;
                self.momentum = vec![self.g.zero(); self.y.len()];
            }
            None => {
                self.transform = self.legendre()?;
                self.velocities()?;
                self.kinematics()?;
                self.forces = self.momenta()?;
            }
        }
        self.g.within_budget()?;
        self.g.enter(Stage::Elimination);
        let system = self.system;
        let mut motion = match (&system.hamiltonian, &system.accelerations, &system.constraint) {
            (Some(hamiltonian), ..) => self.solve_on_dual(hamiltonian)?,
            (None, Some(rates), KinematicConstraint::Solved(solved)) => self.given_motion(solved, rates)?,
            (None, None, KinematicConstraint::Solved(solved)) => self.solve_reduced(solved)?,
            (None, _, KinematicConstraint::Multipliers { rows, reactions }) => {
                self.solve_with_multipliers(rows, reactions)?
            }
        };
        self.carried_accelerations(&motion)?;
        motion.momentum_rates = self.momentum_rates(&motion)?;
        self.g.within_budget()?;
        Ok(motion)
    }

    pub(super) fn new(system: &'a ReducedSystem) -> Derivation<'a> {
        let mut g = system.graph.clone();
        let y = system.velocities.iter().map(|s| g.sym(*s)).collect();
        let varying = system.velocities.iter().chain(system.algebroid.base()).chain([&system.time]).copied();
        let varying = varying.chain(system.inputs.iter().map(|input| input.symbol));
        let varying = varying.chain(system.momenta.iter().filter_map(|m| m.symbol)).collect();
        // Functions may divide by the lengths of these vectors: the point at which they are evaluated is not zero.
        let cosines = system.circles.iter().map(|c| c.cosine);
        let first = system.carried_vectors().filter_map(|block| block.components.first().copied());
        let units: Vec<SymbolId> = cosines.chain(first).collect();
        let writer = SectionWriter::new(&g, varying, &units);
        Derivation {
            system,
            extent: Extent::Whole,
            g,
            writer,
            names: system.algebroid.frame().to_vec(),
            replacement: BTreeMap::new(),
            y,
            rates: Vec::new(),
            momentum: Vec::new(),
            hessian: Vec::new(),
            transform: None,
            way: Velocities::Solved,
            forces: Forces::default(),
            response: None,
        }
    }

    pub(super) fn replace(&mut self, e: ExprId) -> Result<ExprId, Error> {
        let replaced = self.g.subs(e, &self.replacement);
        let replaced = replaced
            .map_err(|_| Error::DivisionByZero { place: "the Lagrangian on the constraint".into() })?;
        Ok(self.g.cancel_zero(replaced))
    }

    /// `y = Psi u + psi0` for the dependent velocities.
    fn velocities(&mut self) -> Result<(), Error> {
        let KinematicConstraint::Solved(solved) = &self.system.constraint else { return Ok(()) };
        if let Some(lift) = &self.system.lift {
            self.way = Velocities::ByLift(Rc::new(self.velocities_by_lift(solved, lift)?));
            return Ok(());
        }
        if let Some(recursion) = self.velocities_by_recursion()? {
            self.way = Velocities::ByRecursion(Rc::new(recursion));
            return Ok(());
        }
        if let Some(response) = solved.response.as_ref().filter(|_| self.system.momenta.is_empty()) {
            self.way = Velocities::ByRows(Rc::new(self.velocities_by_rows(solved, response)));
            return Ok(());
        }
        self.writer.begin("velocities y = Psi u + psi0");
        for &k in &solved.dependent {
            let mut value = solved.velocity(&mut self.g, k);
            if !self.system.momenta.is_empty() {
                value = self.replace(value)?;
            }
            let named = self.writer.define(&mut self.g, &self.names[k], value);
            self.replacement.insert(self.system.velocities[k], named);
            self.y[k] = named;
        }
        Ok(())
    }

    pub(super) fn define(&mut self, name: &str, value: ExprId) -> ExprId {
        self.writer.define(&mut self.g, name, value)
    }

    /// What writes entries of a tableau, called after these names.
    pub(super) fn pen<'p>(&'p mut self, names: &'p [String], stems: [&'static str; 2]) -> Pen<'p> {
        Pen { g: &mut self.g, writer: &mut self.writer, names, stems }
    }

    /// `xdot^i = rho^i_alpha y^alpha + r^i`, with `r` of states of first order alone.
    fn kinematics(&mut self) -> Result<(), Error> {
        self.writer.begin("kinematics xdot = rho y");
        let own = self.system.own_rates_of_base();
        for (i, own) in own.into_iter().enumerate() {
            let mut terms = vec![self.replace(own)?];
            for alpha in 0..self.y.len() {
                let anchor = self.system.algebroid.anchor(i, alpha);
                terms.push(self.g.mul(anchor, self.y[alpha]));
            }
            let sum = self.g.sum(&terms);
            let name = format!("dot_{}", self.g.name(self.system.algebroid.base()[i]));
            let rate = self.define(&name, sum);
            self.rates.push(rate);
        }
        Ok(())
    }
}
