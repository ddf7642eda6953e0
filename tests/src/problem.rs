//! Random mechanical systems on Lie algebras as model text, and the equations of motion they must have.

use std::collections::BTreeMap;

use hamel_codegen::spec;
use hamel_expr::{ExprId, Graph, Rational, SymbolId};
use hamel_lang::algebra::{LieAlgebra, Representation};
use hamel_mechanics::mechanics::{Equations, derive};
use hamel_mechanics::reduction::{Formulation, KinematicConstraint, reduce};
use num_traits::Zero;

use crate::algebras::{Family, Transported, ad_star, transported_representation};
use crate::draws::Draws;
use crate::linear::{Rows, Vector, add_scaled, dot, int, product, rank, solve, times, transposed};

/// Parameters `a` that the group moves by `rho`, in the potential `V(a) = slope . a + 1/2 a . stiffness a`.
#[derive(Clone, Debug)]
pub struct Advection {
    /// `rho(e_b)`.
    pub generators: Vec<Rows>,
    /// Basis of the space, to find invariants with.
    pub frame: Rows,
    /// Linear part of the potential.
    pub slope: Vector,
    /// Symmetric matrix of the quadratic part.
    pub stiffness: Rows,
    /// Expressions to claim as casimirs.
    pub casimirs: Vec<String>,
}

/// The constraint `(form + tilt a) . y = offset + rate t^2`.
#[derive(Clone, Debug)]
pub struct Row {
    /// Constant one-form.
    pub form: Vector,
    /// Its dependence on the advected parameters, `[dim][dim a]`; empty when there is none.
    pub tilt: Rows,
    /// Constant part of the right side.
    pub offset: Rational,
    /// Part that grows with time.
    pub rate: Rational,
}

/// `L = 1/2 (1 + growth t^2) y . G y + t drift . y - V(a)` with constraints and the force `damping y + push`.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The algebra.
    pub algebra: LieAlgebra,
    /// Whether the action is from the right.
    pub right: bool,
    /// `G`.
    pub metric: Rows,
    /// Growth of the inertia with time.
    pub growth: Rational,
    /// Linear term of the Lagrangian.
    pub drift: Vector,
    /// Advected parameters.
    pub advection: Option<Advection>,
    /// Constraints.
    pub rows: Vec<Row>,
    /// Linear part of the external force.
    pub damping: Rows,
    /// Constant part of the external force.
    pub push: Vector,
    /// Velocities asked to be independent.
    pub independent: Option<Vec<usize>>,
    /// Whether the multiplier form is asked for.
    pub multipliers: bool,
    /// Whether the entries of `G` are parameters instead of numbers.
    pub symbolic_metric: bool,
}

/// A state: velocities, advected parameters, time.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// All velocities, those that a constraint determines included.
    pub y: Vector,
    /// Advected parameters.
    pub a: Vector,
    /// Time.
    pub t: Rational,
}

/// What the equations say at a state.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Accelerations of all velocities.
    pub ydot: Vector,
    /// Rates of the advected parameters.
    pub adot: Vector,
    /// Multipliers.
    pub lambda: Vector,
    /// `p = dL/dy`.
    pub momentum: Vector,
    /// Energy.
    pub energy: Rational,
    /// Its rate.
    pub energy_rate: Rational,
}

fn list(v: &[Rational]) -> String {
    let entries: Vec<String> = v.iter().map(Rational::to_string).collect();
    format!("[{}]", entries.join(", "))
}

fn table(rows: &[Vector]) -> String {
    let rows: Vec<String> = rows.iter().map(|r| list(r)).collect();
    format!("[{}]", rows.join(", "))
}

fn zeros(n: usize) -> Vector {
    vec![int(0); n]
}

/// `algebra <name> { basis e1, ..; [e1, e2] = ..; .. }`.
pub fn algebra_text(name: &str, algebra: &LieAlgebra) -> String {
    let e: Vec<String> = (1..=algebra.dim()).map(|k| format!("e{k}")).collect();
    let mut text = format!("algebra {name} {{\n    basis {};\n", e.join(", "));
    for (a, b, value) in algebra.brackets() {
        let terms: Vec<String> = value.iter().map(|(c, q)| format!("{q}*{}", e[*c])).collect();
        text.push_str(&format!("    [{}, {}] = {};\n", e[a], e[b], terms.join(" + ")));
    }
    text + "}\n"
}

impl Problem {
    /// A free system on a family in a random basis, with a random metric and a random side of the action.
    pub fn random(family: &Family, draws: &mut Draws) -> (Problem, Transported) {
        let transported = Transported::new(family, draws);
        let n = transported.algebra.dim();
        let problem = Problem {
            algebra: transported.algebra.clone(),
            right: draws.integer() < 0,
            metric: transported.metric.clone(),
            growth: int(0),
            drift: zeros(n),
            advection: None,
            rows: Vec::new(),
            damping: vec![zeros(n); n],
            push: zeros(n),
            independent: None,
            multipliers: false,
            symbolic_metric: false,
        };
        (problem, transported)
    }

    /// Adds advected parameters under a representation, in a random basis of its space.
    pub fn advect(&mut self, representation: &Representation, transported: &Transported, draws: &mut Draws) {
        let (generators, frame) = transported_representation(representation, transported, draws);
        let k = representation.dim();
        let stiffness = draws.positive_definite(k);
        self.advection = Some(Advection {
            generators,
            frame,
            slope: draws.generic_vector(k),
            stiffness,
            casimirs: Vec::new(),
        });
    }

    /// Adds `k` independent linear constraints.
    pub fn constrain(&mut self, k: usize, draws: &mut Draws) {
        let n = self.algebra.dim();
        // Rows of an invertible matrix are independent; the last ones are the dense ones.
        for form in draws.invertible(n).into_iter().rev().take(k) {
            self.rows.push(Row { form, tilt: Vec::new(), offset: int(0), rate: int(0) });
        }
    }

    /// Number of advected parameters.
    pub fn n_advected(&self) -> usize {
        self.advection.as_ref().map_or(0, |a| a.slope.len())
    }

    fn side(&self) -> Rational {
        int(if self.right { -1 } else { 1 })
    }

    /// The model in the model language.
    pub fn text(&self) -> String {
        let n = self.algebra.dim();
        let mut text = String::from("model random_system {\n");
        text.push_str(&algebra_text("h", &self.algebra));
        text.push_str(&format!("velocity y in h;\naction {};\n", if self.right { "right" } else { "left" }));
        if self.symbolic_metric {
            let upper: Vector = (0..n).flat_map(|i| self.metric[i][i..].to_vec()).collect();
            text.push_str(&format!("param G: symmetric({n}) = {};\n", list(&upper)));
        } else {
            text.push_str(&format!("let G = {};\n", table(&self.metric)));
        }
        let mut potential = String::new();
        if let Some(advection) = &self.advection {
            let k = advection.slope.len();
            let components: Vec<String> = (0..k)
                .map(|i| {
                    let terms = advection
                        .generators
                        .iter()
                        .enumerate()
                        .map(|(b, m)| format!("y{}*dot({}, a)", b + 1, list(&m[i])));
                    terms.collect::<Vec<_>>().join(" + ")
                })
                .collect();
            text.push_str(&format!("advected a in R^{k} by [{}];\n", components.join(", ")));
            let (slope, stiffness) = (list(&advection.slope), table(&advection.stiffness));
            potential = format!(" - dot({slope}, a) - 1/2*dot(a, {stiffness}*a)");
            for (k, casimir) in advection.casimirs.iter().enumerate() {
                text.push_str(&format!("casimir C{} = {casimir};\n", k + 1));
            }
        }
        text.push_str(&format!(
            "lagrangian = 1/2*(1 + {}*t^2)*dot(y, G*y) + t*dot({}, y){potential};\n",
            self.growth,
            list(&self.drift)
        ));
        for row in &self.rows {
            let tilt = if row.tilt.is_empty() { String::new() } else { format!(" + {}*a", table(&row.tilt)) };
            text.push_str(&format!(
                "constraint dot({}{tilt}, y) = {} + {}*t^2;\n",
                list(&row.form),
                row.offset,
                row.rate
            ));
        }
        text.push_str(&format!("force y = {}*y + {};\n", table(&self.damping), list(&self.push)));
        if let Some(independent) = &self.independent {
            let names: Vec<String> = independent.iter().map(|k| format!("y{}", k + 1)).collect();
            text.push_str(&format!("independent {};\n", names.join(", ")));
        }
        if self.multipliers {
            text.push_str("multipliers;\n");
        }
        text + "}\n"
    }

    /// The equations that the generator derives, or the message it fails with.
    ///
    /// # Errors
    /// The text of the error, of whichever phase.
    pub fn equations(&self) -> Result<Equations, String> {
        equations_of(&self.text())
    }

    /// The constraint one-forms at a state, `form + tilt a`.
    pub fn forms(&self, a: &[Rational]) -> Rows {
        let at = |row: &Row| match row.tilt.as_slice() {
            [] => row.form.clone(),
            tilt => add_scaled(&row.form, &int(1), &times(tilt, a)),
        };
        self.rows.iter().map(at).collect()
    }

    /// Right sides `offset + rate t^2` of the constraints.
    pub fn offsets(&self, t: &Rational) -> Vector {
        self.rows.iter().map(|row| &row.offset + &row.rate * t * t).collect()
    }

    /// A random state on the constraint.
    ///
    /// # Panics
    /// When the constraints contradict each other.
    pub fn state(&self, draws: &mut Draws) -> State {
        let free = draws.generic_vector(self.algebra.dim());
        let a = draws.generic_vector(self.n_advected());
        let t = draws.non_zero();
        let y = solve(&self.forms(&a), &self.offsets(&t), &free).expect("the constraints can be satisfied");
        State { y, a, t }
    }

    /// `adot = -xi . a` for a left action, `xi . a` for a right one.
    pub fn advected_rate(&self, state: &State) -> Vector {
        let Some(advection) = &self.advection else { return Vec::new() };
        let mut rate = zeros(state.a.len());
        for (y, m) in state.y.iter().zip(&advection.generators) {
            rate = add_scaled(&rate, &(-self.side() * y), &times(m, &state.a));
        }
        rate
    }

    /// `p = (1 + growth t^2) G y + t drift`.
    pub fn momentum(&self, state: &State) -> Vector {
        let scale = int(1) + &self.growth * &state.t * &state.t;
        let p: Vector = times(&self.metric, &state.y).iter().map(|x| x * &scale).collect();
        add_scaled(&p, &state.t, &self.drift)
    }

    /// `F = damping y + push`.
    pub fn force(&self, state: &State) -> Vector {
        add_scaled(&self.push, &int(1), &times(&self.damping, &state.y))
    }

    /// `dL/dt` at fixed state.
    pub fn explicit_rate(&self, state: &State) -> Rational {
        &self.growth * &state.t * dot(&state.y, &times(&self.metric, &state.y)) + dot(&self.drift, &state.y)
    }

    /// `E = p . y - L`.
    pub fn energy(&self, state: &State) -> Rational {
        let half = Rational::new(1.into(), 2.into());
        let scale = (int(1) + &self.growth * &state.t * &state.t) * &half;
        let kinetic = scale * dot(&state.y, &times(&self.metric, &state.y));
        let Some(advection) = &self.advection else { return kinetic };
        let quadratic = dot(&state.a, &times(&advection.stiffness, &state.a));
        kinetic + dot(&advection.slope, &state.a) + half * quadratic
    }

    /// `E_b = d/dt p_b - <p, [y, e_b]> - rho^i_b dL/da^i - F_b`, brackets with the sign of the action.
    pub fn residual(&self, state: &State, ydot: &[Rational]) -> Vector {
        let scale = int(1) + &self.growth * &state.t * &state.t;
        let mut total: Vector = times(&self.metric, ydot).iter().map(|x| x * &scale).collect();
        let explicit = int(2) * &self.growth * &state.t;
        total = add_scaled(&total, &explicit, &times(&self.metric, &state.y));
        total = add_scaled(&total, &int(1), &self.drift);
        let turning = ad_star(&self.algebra, &state.y, &self.momentum(state));
        total = add_scaled(&total, &-self.side(), &turning);
        total = add_scaled(&total, &int(-1), &self.force(state));
        if let Some(advection) = &self.advection {
            // dL/da = -dV/da.
            let gradient = add_scaled(&advection.slope, &int(1), &times(&advection.stiffness, &state.a));
            for (component, m) in total.iter_mut().zip(&advection.generators) {
                // rho(e_b) = -side e_b . a, so -rho dL/da = -side (e_b . a) . dV/da.
                *component -= self.side() * dot(&times(m, &state.a), &gradient);
            }
        }
        total
    }

    /// What `equations` say at a state, accelerations of dependent velocities from the constraint itself; `None` where
    /// a pivot of the equations vanishes.
    ///
    /// # Panics
    /// When the equations lack an output they have to have.
    pub fn motion(&self, equations: &Equations, state: &State) -> Option<Motion> {
        let n = self.algebra.dim();
        let mut at = Evaluation::new(equations, |name| {
            let index = |prefix: char| name.strip_prefix(prefix)?.parse::<usize>().ok();
            match (index('y'), index('a')) {
                (Some(k), _) => Some(state.y[k - 1].clone()),
                (_, Some(k)) => Some(state.a[k - 1].clone()),
                _ if name == "a" => Some(state.a[0].clone()),
                _ if name == "t" => Some(state.t.clone()),
                _ => None,
            }
        })?;
        let mut known: Vec<Option<Rational>> = vec![None; n];
        let mut adot = Vec::new();
        for variable in &equations.state {
            let rate = at.value(variable.derivative)?;
            match variable.name.strip_prefix('y') {
                Some(k) => known[k.parse::<usize>().expect("velocities are y1, y2, ..") - 1] = Some(rate),
                None => adot.push(rate),
            }
        }
        let output = |name: &str| equations.outputs.iter().find(|o| o.name == name);
        let lambda = match output("multipliers") {
            Some(output) => {
                output.components.iter().map(|(_, e)| at.value(*e)).collect::<Option<Vector>>()?
            }
            None => Vec::new(),
        };
        let momentum = &output("momentum").expect("every system has momenta").components;
        let momentum = momentum.iter().map(|(_, e)| at.value(*e)).collect::<Option<Vector>>()?;
        let energy = at.value(equations.energy)?;
        let energy_rate = at.value(equations.energy_rate)?;
        let ydot = self.complete(state, &known)?;
        Some(Motion { ydot, adot, lambda, momentum, energy, energy_rate })
    }

    /// Accelerations that the differentiated constraint determines:
    /// `(form + tilt a) . ydot = 2 rate t - (tilt adot) . y`.
    fn complete(&self, state: &State, known: &[Option<Rational>]) -> Option<Vector> {
        let open: Vec<usize> = (0..known.len()).filter(|k| known[*k].is_none()).collect();
        let mut ydot: Vector = known.iter().map(|q| q.clone().unwrap_or_else(Rational::zero)).collect();
        if open.is_empty() {
            return Some(ydot);
        }
        let right: Vector = self.constraint_rates(state, &ydot).iter().map(|q| -q).collect();
        let forms = self.forms(&state.a);
        let columns: Rows = forms.iter().map(|row| open.iter().map(|k| row[*k].clone()).collect()).collect();
        for (k, value) in open.iter().zip(solve(&columns, &right, &zeros(open.len()))?) {
            ydot[*k] = value;
        }
        Some(ydot)
    }

    /// `d/dt` of `(form + tilt a) . y - offset - rate t^2`.
    pub fn constraint_rates(&self, state: &State, ydot: &[Rational]) -> Vector {
        let adot = self.advected_rate(state);
        let forms = self.forms(&state.a);
        let rate = |(row, form): (&Row, &Vector)| {
            let turning = if row.tilt.is_empty() { int(0) } else { dot(&times(&row.tilt, &adot), &state.y) };
            dot(form, ydot) + turning - int(2) * &row.rate * &state.t
        };
        self.rows.iter().zip(&forms).map(rate).collect()
    }

    /// Holds `equations` to every formula at a state on the constraint and returns the motion: kinematics, constraint,
    /// `E = lambda a`, momenta, energy and `dE/dt = F . y - dL/dt - lambda b` for the constraint `a . y + b = 0`.
    ///
    /// # Panics
    /// When any of them fails.
    pub fn verify(&self, equations: &Equations, state: &State) -> Option<Motion> {
        let motion = self.motion(equations, state)?;
        let text = self.text();
        assert_eq!(motion.adot, self.advected_rate(state), "kinematics of\n{text}");
        assert!(
            self.constraint_rates(state, &motion.ydot).iter().all(Zero::is_zero),
            "constraint of\n{text}"
        );
        assert_eq!(motion.lambda.len(), self.rows.len(), "a multiplier for each constraint of\n{text}");
        let mut reaction = zeros(self.algebra.dim());
        for (lambda, form) in motion.lambda.iter().zip(self.forms(&state.a)) {
            reaction = add_scaled(&reaction, lambda, &form);
        }
        assert_eq!(self.residual(state, &motion.ydot), reaction, "equations of motion of\n{text}");
        assert_eq!(motion.momentum, self.momentum(state), "momenta of\n{text}");
        assert_eq!(motion.energy, self.energy(state), "energy of\n{text}");
        // b_A = -(offset + rate t^2).
        let power = dot(&motion.lambda, &self.offsets(&state.t));
        let expected = dot(&self.force(state), &state.y) - self.explicit_rate(state) + power;
        assert_eq!(motion.energy_rate, expected, "energy rate of\n{text}");
        if let KinematicConstraint::Solved(solved) = &equations.system.constraint {
            let mut both = solved.independent();
            both.extend(&solved.dependent);
            both.sort_unstable();
            assert_eq!(both, (0..self.algebra.dim()).collect::<Vec<_>>());
        }
        Some(motion)
    }

    /// All choices of independent velocities, with whether the constraints (without tilt) determine the others.
    pub fn choices(&self) -> Vec<(Vec<usize>, bool)> {
        let n = self.algebra.dim();
        let forms: Rows = self.rows.iter().map(|r| r.form.clone()).collect();
        (0..1usize << n)
            .map(|mask| (0..n).filter(|k| mask >> k & 1 == 1).collect::<Vec<_>>())
            .filter(|chosen| chosen.len() + forms.len() == n)
            .map(|chosen| {
                let dependent: Rows = forms
                    .iter()
                    .map(|row| (0..n).filter(|k| !chosen.contains(k)).map(|k| row[k].clone()).collect())
                    .collect();
                let solvable = rank(&dependent) == forms.len();
                (chosen, solvable)
            })
            .collect()
    }

    /// The invariant `a . Q^T Q a` of an orthogonal representation seen in the basis `Q`.
    pub fn invariant(&self) -> Option<String> {
        let advection = self.advection.as_ref()?;
        let frame = product(&transposed(&advection.frame), &advection.frame);
        Some(format!("dot(a, {}*a)", table(&frame)))
    }
}

/// Parses, reduces and derives a model.
///
/// # Errors
/// The text of the error, of whichever phase.
pub fn equations_of(text: &str) -> Result<Equations, String> {
    let model = spec::parse("test.hamel", text).map_err(|e| e.to_string())?;
    let system = reduce(&model, &Formulation::of(&model)).map_err(|e| e.to_string())?;
    derive(&system).map_err(|e| e.to_string())
}

/// The equations of a text that has some.
///
/// # Panics
/// With the error of any phase, and the text.
pub fn derived(text: &str) -> Equations {
    equations_of(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Exact values of definitions in order, at numbers for all inputs.
#[derive(Clone, Debug)]
pub struct Evaluation {
    graph: Graph,
    values: BTreeMap<SymbolId, ExprId>,
}

impl Evaluation {
    /// Evaluates all definitions; parameters have their defaults, everything else comes from `input`.
    ///
    /// `None` where a denominator vanishes.
    ///
    /// # Panics
    /// When `input` does not know a state variable.
    pub fn new(equations: &Equations, input: impl Fn(&str) -> Option<Rational>) -> Option<Evaluation> {
        let mut graph = equations.system.graph.clone();
        let mut values = BTreeMap::new();
        for p in &equations.system.params {
            values.insert(p.symbol, graph.rational(p.default.clone()));
        }
        for s in &equations.state {
            let value = input(&s.name).expect("every state variable has a value");
            values.insert(s.symbol, graph.rational(value));
        }
        if let Some(t) = input("t") {
            values.insert(equations.system.time, graph.rational(t));
        }
        let mut evaluation = Evaluation { graph, values };
        for definition in equations.sections.iter().flat_map(|s| &s.definitions) {
            let value = evaluation.value(definition.expr)?;
            let value = evaluation.graph.rational(value);
            evaluation.values.insert(definition.symbol, value);
        }
        Some(evaluation)
    }

    /// The value of an expression, or `None` where a denominator vanishes.
    ///
    /// # Panics
    /// When the expression mentions something that is neither an input nor an earlier definition.
    pub fn value(&mut self, e: ExprId) -> Option<Rational> {
        let value = self.graph.subs(e, &self.values).ok()?;
        match self.graph.as_rational(value) {
            Some(q) => Some(q.clone()),
            None => panic!("not a number: {}", self.graph.display(value, hamel_expr::Style::Plain)),
        }
    }
}
