//! A model at a point: velocities in its own frame and in the one of the group, anchor, bracket, Lagrangian, forces,
//! constraints.
//!
//! The frame in which everything is defined is `(xdot, xi)`, or the sections of a declared algebroid: structure
//! constants there are those of the algebra, and no connection, curvature or drift is needed, since derivatives along
//! the motion are taken by dual numbers. Does not know: equations of motion, points, programs.
//!
//! # Source
//! Hamel, Theoretische Mechanik, 1949; Cortes, de Leon, Marrero, Martinez 2009, section 3.

use hamel_runtime::{Dual, Real};

use hamel_expr::{ExprId, SymbolId};
use hamel_lang::spec::{Constraint, ConstraintKind, Model, Side};
use hamel_mechanics::mechanics::Equations;

use super::linear::Reduced;
use super::tape::{Env, Tape};

/// An evaluation that needs the value of a symbol which the point does not have.
pub(super) type Missing = SymbolId;

/// A displacement of base coordinates, by symbol.
pub(super) type Displacement<R> = Vec<(SymbolId, R)>;

enum Energetic {
    Lagrangian(Tape),
    Hamiltonian { h: Tape, momenta: Vec<SymbolId> },
    None,
}

struct Bracket {
    pair: [usize; 2],
    /// Component and place among the roots of the tape.
    value: Vec<(usize, usize)>,
}

/// `[e_a, e_b] = c^c_ab e_c` of the algebra, for one pair `a < b`.
struct StructureConstants {
    pair: [usize; 2],
    /// `c` and `c^c_ab` to 31 digits, with the sign of the action.
    value: Vec<(usize, [f64; 2])>,
}

/// What the model says, ready for evaluation.
pub(super) struct Definition<'a> {
    pub(super) model: &'a Model,
    pub(super) n_shape: usize,
    /// Number of velocities.
    pub(super) m: usize,
    energetic: Energetic,
    /// `A`, row by row.
    connection: Option<Tape>,
    /// `T`, row by row.
    quasi_matrix: Option<Tape>,
    quasi_inverse: Option<Tape>,
    /// `rho`, row by row, then the values of the brackets of a declared algebroid.
    algebroid: Option<(Tape, Vec<Bracket>)>,
    /// `xi . a` of all advected parameters.
    actions: Tape,
    advected: Vec<SymbolId>,
    /// Velocities before quasi-velocities.
    original: Vec<SymbolId>,
    velocities: Vec<SymbolId>,
    /// Rates of states of first order.
    first_order: Tape,
    forces: Tape,
    /// Residuals of all constraints.
    residuals: Tape,
    /// Coefficients of the highest derivatives, `m` of each constraint of second and third order.
    highest: Tape,
    /// One-forms of conditions on displacements, `m` of each.
    displacements: Tape,
    /// The connection that the velocities of the system have, where another one than the model's was chosen.
    chosen_connection: Option<Option<Tape>>,
    /// The frame of stages.
    stage_frame: Option<Tape>,
    structure: Vec<StructureConstants>,
    /// A function with the rate that an actuator gives it, and what it has from the force.
    lyapunov: Option<(Tape, SymbolId)>,
}

/// All velocities at a point.
#[derive(Clone)]
pub(super) struct Place<R> {
    /// Values of the symbols of the model.
    pub(super) env: Env<R>,
    /// Velocities of the system.
    pub(super) of_system: Vec<R>,
    /// `(xdot, xi)`, or along the sections of the declared algebroid.
    pub(super) group: Vec<R>,
    /// Velocities of the model.
    pub(super) of_model: Vec<R>,
}

fn entries(rows: &[Vec<ExprId>]) -> Vec<ExprId> {
    rows.iter().flatten().copied().collect()
}

fn times<R: Real>(matrix: &[R], x: &[R]) -> Vec<R> {
    let row = |row: &[R]| row.iter().zip(x).fold(R::ZERO, |sum, (a, b)| sum + *a * *b);
    matrix.chunks(x.len().max(1)).map(row).collect()
}

impl<'a> Definition<'a> {
    pub(super) fn new(model: &'a Model, equations: &Equations) -> Definition<'a> {
        let g = &model.graph;
        let system = &equations.system;
        let tape = |roots: &[ExprId]| Tape::new(g, roots);
        let energetic = match (&model.given, model.hamiltonian) {
            (Some(_), _) => Energetic::None,
            (None, Some(h)) => {
                let mut momenta = vec![model.time; model.all_velocities().len()];
                for (_, symbol, velocity) in model.momenta.iter().flat_map(|m| &m.components) {
                    if let Some(place) = momenta.get_mut(*velocity) {
                        *place = *symbol;
                    }
                }
                Energetic::Hamiltonian { h: tape(&[h]), momenta }
            }
            (None, None) => Energetic::Lagrangian(tape(&[model.lagrangian])),
        };
        let algebroid = model.algebroid.as_ref().map(|own| {
            let mut roots = entries(&own.anchor);
            let mut brackets = Vec::new();
            for bracket in &own.brackets {
                let value =
                    bracket.value.iter().enumerate().map(|(k, (c, _))| (*c, roots.len() + k)).collect();
                roots.extend(bracket.value.iter().map(|(_, e)| *e));
                brackets.push(Bracket { pair: bracket.pair, value });
            }
            (tape(&roots), brackets)
        });
        let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
        let original = match &model.frame {
            Some(frame) => frame.original.iter().map(|(_, s)| *s).collect(),
            None => velocities.clone(),
        };
        let highest = model.constraints.iter().flat_map(|c| match &c.kind {
            ConstraintKind::SecondOrder { acceleration: row }
            | ConstraintKind::ThirdOrder { jerk: row, .. } => row.clone(),
            ConstraintKind::Linear | ConstraintKind::Nonlinear => Vec::new(),
        });
        let highest = tape(&highest.collect::<Vec<_>>());
        let offset = model.action == Side::Right;
        let structure = model.algebra.brackets().map(|(a, b, value)| {
            let sign = if offset { -1.0 } else { 1.0 };
            let value = value.iter().map(|(c, q)| (*c, q.parts().map(|x| sign * x)));
            StructureConstants { pair: [a, b], value: value.collect() }
        });
        let of_system = |rows: &[Vec<ExprId>]| Tape::new(&system.graph, &entries(rows));
        let residuals: Vec<ExprId> = model.constraints.iter().map(|c| c.residual).collect();
        Definition {
            model,
            n_shape: model.n_shape(),
            m: velocities.len(),
            energetic,
            connection: model.connection.as_ref().map(|rows| tape(&entries(rows))),
            quasi_matrix: model.frame.as_ref().map(|f| tape(&entries(&f.matrix))),
            quasi_inverse: model.frame.as_ref().map(|f| tape(&entries(&f.inverse))),
            algebroid,
            actions: tape(&model.advected.iter().flat_map(|a| a.action.iter().copied()).collect::<Vec<_>>()),
            advected: model.advected.iter().flat_map(|a| a.components.iter().map(|(_, s)| *s)).collect(),
            original,
            velocities,
            first_order: tape(
                &model.first_order.iter().flat_map(|s| s.rates.iter().copied()).collect::<Vec<_>>(),
            ),
            forces: tape(&model.forces),
            residuals: tape(&residuals),
            highest,
            displacements: tape(
                &model
                    .virtual_constraints
                    .iter()
                    .flat_map(|v| v.one_form.iter().copied())
                    .collect::<Vec<_>>(),
            ),
            chosen_connection: system
                .formulation
                .connection
                .map(|_| system.connection.as_ref().map(|rows| of_system(rows))),
            stage_frame: system.frame.as_ref().map(|frame| of_system(&frame.matrix)),
            structure: structure.collect(),
            lyapunov: model.lyapunov.as_ref().map(|own| (tape(&[own.value]), own.response)),
        }
    }

    pub(super) fn has_hamiltonian(&self) -> bool {
        matches!(self.energetic, Energetic::Hamiltonian { .. })
    }

    /// The velocities `(xdot, xi)` of velocities of the system; `env` has the symbols of the system and of the model.
    pub(super) fn group_velocities<R: Real>(&self, env: &Env<R>, of_system: &[R]) -> Result<Vec<R>, Missing> {
        let y = self.before_stages(env, of_system)?;
        self.group_velocities_before_stages(env, &y)
    }

    /// Velocities of the system without the change of frame that stages make.
    pub(super) fn before_stages<R: Real>(&self, env: &Env<R>, of_system: &[R]) -> Result<Vec<R>, Missing> {
        match &self.stage_frame {
            Some(frame) => Ok(times(&frame.eval(env)?.roots, of_system)),
            None => Ok(of_system.to_vec()),
        }
    }

    /// The velocities `(xdot, xi)` of velocities before stages.
    pub(super) fn group_velocities_before_stages<R: Real>(
        &self,
        env: &Env<R>,
        y: &[R],
    ) -> Result<Vec<R>, Missing> {
        let mut y = y.to_vec();
        if let Some(matrix) = &self.quasi_matrix {
            y = times(&matrix.eval(env)?.roots, &y);
        }
        let connection = match &self.chosen_connection {
            Some(chosen) => chosen.as_ref(),
            None => self.connection.as_ref(),
        };
        self.shift(env, connection, &mut y, R::ONE)?;
        Ok(y)
    }

    /// `v -= sign A xdot`.
    fn shift<R: Real>(
        &self,
        env: &Env<R>,
        connection: Option<&Tape>,
        y: &mut [R],
        sign: R,
    ) -> Result<(), Missing> {
        let Some(connection) = connection.filter(|_| self.n_shape > 0) else { return Ok(()) };
        let coefficients = connection.eval(env)?.roots;
        let (shape, fibre) = y.split_at_mut(self.n_shape);
        for (v, along) in fibre.iter_mut().zip(times(&coefficients, shape)) {
            *v -= sign * along;
        }
        Ok(())
    }

    /// The velocities that the model is written in: `T^-1 (xdot, xi + A xdot)`.
    pub(super) fn model_velocities<R: Real>(&self, env: &Env<R>, group: &[R]) -> Result<Vec<R>, Missing> {
        let mut y = group.to_vec();
        self.shift(env, self.connection.as_ref(), &mut y, -R::ONE)?;
        match &self.quasi_inverse {
            Some(inverse) => Ok(times(&inverse.eval(env)?.roots, &y)),
            None => Ok(y),
        }
    }

    /// A place from the values of all symbols but velocities.
    pub(super) fn place<R: Real>(&self, mut env: Env<R>, of_system: Vec<R>) -> Result<Place<R>, Missing> {
        let group = self.group_velocities(&env, &of_system)?;
        let of_model = self.model_velocities(&env, &group)?;
        env.set_all(&self.velocities, &of_model);
        if let Some((value, symbol)) = &self.lyapunov {
            let response = self.response(value, &env)?;
            env.set(*symbol, response);
        }
        Ok(Place { env, of_system, group, of_model })
    }

    /// `dV/dy a` with the accelerations `a` that a unit of the force of the actuator gives, `L_yy a = f`.
    fn response<R: Real>(&self, value: &Tape, env: &Env<R>) -> Result<R, Missing> {
        let Energetic::Lagrangian(lagrangian) = &self.energetic else { return Ok(R::ZERO) };
        let unit = |is_own: bool| if is_own { R::ONE } else { R::ZERO };
        let mut form = self.displacements.eval(env)?.roots;
        form.truncate(self.m);
        let y: Vec<R> = self.velocities.iter().map(|s| env.get(*s).ok_or(*s)).collect::<Result<_, _>>()?;
        let mut rows = Vec::new();
        for (a, f) in form.into_iter().enumerate() {
            let mut row = Vec::new();
            for b in 0..self.m {
                let mut twice = env.map(|x| Dual::constant(Dual::constant(x)));
                for (k, (symbol, y)) in self.velocities.iter().zip(&y).enumerate() {
                    let along = Dual::new(Dual::new(*y, unit(k == b)), Dual::constant(unit(k == a)));
                    twice.set(*symbol, along);
                }
                row.push(lagrangian.eval(&twice)?.roots[0].derivative.derivative);
            }
            row.push(f);
            rows.push(row);
        }
        let acceleration = Reduced::new(rows, self.m).solution(&vec![R::ZERO; self.m]);
        let mut along = env.map(Dual::constant);
        for (symbol, (y, a)) in self.velocities.iter().zip(y.iter().zip(acceleration)) {
            along.set(*symbol, Dual::new(*y, a));
        }
        Ok(value.eval(&along)?.roots[0].derivative)
    }

    /// The symbols of the model with other velocities, by the velocities of the group.
    pub(super) fn moved_by<R: Real>(&self, env: &Env<R>, group: &[R]) -> Result<Env<R>, Missing> {
        let mut moved = env.clone();
        moved.set_all(&self.velocities, &self.model_velocities(env, group)?);
        Ok(moved)
    }

    /// `rho w`: what base coordinates and advected parameters do along `w`, in the frame of the group.
    pub(super) fn anchored<R: Real>(&self, env: &Env<R>, w: &[R]) -> Result<Displacement<R>, Missing> {
        let mut rates = Vec::new();
        match &self.algebroid {
            None => rates.extend(self.model.base.iter().map(|c| c.symbol).zip(w.iter().copied())),
            Some((tape, _)) => {
                let anchor = tape.eval(env)?.roots;
                let rows = times(&anchor[..self.model.base.len() * self.m], w);
                rates.extend(self.model.base.iter().map(|c| c.symbol).zip(rows));
            }
        }
        let mut moving = env.clone();
        moving.set_all(&self.original, w);
        let sign = if self.model.action == Side::Left { -R::ONE } else { R::ONE };
        let actions = self.actions.eval(&moving)?.roots;
        rates.extend(self.advected.iter().copied().zip(actions.into_iter().map(|a| sign * a)));
        Ok(rates)
    }

    /// The rates of states of first order.
    pub(super) fn first_order<R: Real>(&self, env: &Env<R>) -> Result<Displacement<R>, Missing> {
        let symbols =
            self.model.first_order.iter().flat_map(|s| s.components.iter().map(|(_, symbol)| *symbol));
        Ok(symbols.zip(self.first_order.eval(env)?.roots).collect())
    }

    /// `[w, y]` in the frame of the group.
    pub(super) fn bracket<R: Real>(&self, env: &Env<R>, w: &[R], y: &[R]) -> Result<Vec<R>, Missing> {
        let mut z = vec![R::ZERO; self.m];
        let area = |a: usize, b: usize| w[a] * y[b] - w[b] * y[a];
        if let Some((tape, brackets)) = &self.algebroid {
            let values = tape.eval(env)?.roots;
            for Bracket { pair: [a, b], value } in brackets {
                value.iter().for_each(|(c, place)| z[*c] += values[*place] * area(*a, *b));
            }
        }
        let n = self.n_shape;
        for StructureConstants { pair: [a, b], value } in &self.structure {
            value.iter().for_each(|(c, [hi, lo])| z[n + c] += R::from_parts(*hi, *lo) * area(n + a, n + b));
        }
        Ok(z)
    }

    /// `L` and its derivative along a change of velocities, in the frame of the group, and of the base.
    pub(super) fn lagrangian<R: Real>(
        &self,
        at: &Place<R>,
        dy: &[R],
        dx: &Displacement<R>,
    ) -> Result<Dual<R>, Missing> {
        let Energetic::Lagrangian(tape) = &self.energetic else { return Ok(Dual::ZERO) };
        let mut env = at.env.map(Dual::constant);
        displace(&mut env, dx);
        let moving: Vec<Dual<R>> = at.group.iter().zip(dy).map(|(y, d)| Dual::new(*y, *d)).collect();
        let of_model = self.model_velocities(&env, &moving)?;
        env.set_all(&self.velocities, &of_model);
        Ok(tape.eval(&env)?.roots[0])
    }

    /// `s^a dL/dy^a` for components along the velocities of the model.
    pub(super) fn momentum_along<R: Real>(&self, at: &Place<R>, s: &[R]) -> Result<R, Missing> {
        match &self.energetic {
            Energetic::Lagrangian(tape) => {
                let mut env = at.env.map(Dual::constant);
                for ((symbol, y), d) in self.velocities.iter().zip(&at.of_model).zip(s) {
                    env.set(*symbol, Dual::new(*y, *d));
                }
                Ok(tape.eval(&env)?.roots[0].derivative)
            }
            Energetic::Hamiltonian { momenta, .. } => momenta
                .iter()
                .zip(s)
                .try_fold(R::ZERO, |sum, (p, s)| Ok(sum + at.env.get(*p).ok_or(*p)? * *s)),
            Energetic::None => Ok(R::ZERO),
        }
    }

    /// `h` and its derivative along a change of the base at fixed momenta of the model.
    pub(super) fn hamiltonian<R: Real>(
        &self,
        at: &Place<R>,
        dx: &Displacement<R>,
    ) -> Result<Dual<R>, Missing> {
        let Energetic::Hamiltonian { h, .. } = &self.energetic else { return Ok(Dual::ZERO) };
        let mut env = at.env.map(Dual::constant);
        displace(&mut env, dx);
        Ok(h.eval(&env)?.roots[0])
    }

    /// `dh/dp`, the velocities of the model.
    pub(super) fn hamiltonian_velocities<R: Real>(&self, at: &Place<R>) -> Result<Vec<R>, Missing> {
        let Energetic::Hamiltonian { h, momenta } = &self.energetic else { return Ok(Vec::new()) };
        let mut env = at.env.map(Dual::constant);
        let mut slope = |p: &SymbolId| {
            let value = env.get(*p).ok_or(*p)?;
            env.set(*p, Dual::variable(value.value));
            let slope = h.eval(&env)?.roots[0].derivative;
            env.set(*p, value);
            Ok(slope)
        };
        momenta.iter().map(&mut slope).collect()
    }

    /// `E = p.y - L`, or `h`.
    pub(super) fn energy<R: Real>(&self, at: &Place<R>) -> Result<R, Missing> {
        if self.has_hamiltonian() {
            return Ok(self.hamiltonian(at, &Vec::new())?.value);
        }
        let along = self.lagrangian(at, &at.group, &Vec::new())?;
        Ok(along.derivative - along.value)
    }

    /// Forces along the velocities of the model.
    pub(super) fn forces<R: Real>(&self, at: &Place<R>) -> Result<Vec<R>, Missing> {
        Ok(self.forces.eval(&at.env)?.roots)
    }

    /// Residuals of all constraints.
    pub(super) fn residuals<R: Real>(&self, env: &Env<R>) -> Result<Vec<R>, Missing> {
        Ok(self.residuals.eval(env)?.roots)
    }

    /// Coefficients of accelerations or their rates, by constraint; none of those that restrict velocities.
    pub(super) fn highest<R: Real>(&self, env: &Env<R>) -> Result<Vec<Option<Vec<R>>>, Missing> {
        let all = self.highest.eval(env)?.roots;
        let mut rows = all.chunks(self.m.max(1)).map(<[R]>::to_vec);
        let row = |kind: &ConstraintKind| match kind {
            ConstraintKind::Linear | ConstraintKind::Nonlinear => None,
            ConstraintKind::SecondOrder { .. } | ConstraintKind::ThirdOrder { .. } => rows.next(),
        };
        Ok(self.model.constraints.iter().map(|c| &c.kind).map(row).collect())
    }

    /// The linear map from velocities of the system to those of the model, by columns, and to those of the group.
    fn columns<R: Real>(&self, env: &Env<R>) -> Result<Vec<[Vec<R>; 2]>, Missing> {
        let unit = |k: usize| (0..self.m).map(|j| if j == k { R::ONE } else { R::ZERO }).collect::<Vec<R>>();
        let column = |k: usize| {
            let group = self.group_velocities(env, &unit(k))?;
            Ok([self.model_velocities(env, &group)?, group])
        };
        (0..self.m).map(column).collect()
    }

    /// The one-forms of reactions, with names: of conditions on displacements where the model has any, otherwise of the
    /// constraints (Chetaev). Entries belong to the velocities of the system, then to velocities that only
    /// parametrise constraints.
    pub(super) fn one_forms<R: Real>(&self, at: &Place<R>) -> Result<Vec<(String, Vec<R>)>, Missing> {
        let columns = self.columns(&at.env)?;
        let along = |form: &[R]| -> Vec<R> {
            let dot = |[y, _]: &[Vec<R>; 2]| form.iter().zip(y).fold(R::ZERO, |sum, (w, y)| sum + *w * *y);
            columns.iter().map(dot).collect()
        };
        if !self.model.virtual_constraints.is_empty() {
            let all = self.displacements.eval(&at.env)?.roots;
            let names = self.model.virtual_constraints.iter().map(|v| v.name.clone());
            return Ok(names.zip(all.chunks(self.m).map(along)).collect());
        }
        let highest = self.highest(&at.env)?;
        let quasi: Vec<SymbolId> = self.model.quasi_velocities.iter().map(|v| v.symbol).collect();
        // Derivatives of all residuals along one velocity after the other.
        let fixed = at.env.map(Dual::constant);
        let mut slopes: Vec<Vec<R>> = Vec::new();
        for [of_model, _] in &columns {
            let mut env = fixed.clone();
            for ((symbol, y), d) in self.velocities.iter().zip(&at.of_model).zip(of_model) {
                env.set(*symbol, Dual::new(*y, *d));
            }
            slopes.push(self.residuals(&env)?.into_iter().map(|r| r.derivative).collect());
        }
        for symbol in &quasi {
            let mut env = fixed.clone();
            let value = at.env.get(*symbol).ok_or(*symbol)?;
            env.set(*symbol, Dual::variable(value));
            slopes.push(self.residuals(&env)?.into_iter().map(|r| r.derivative).collect());
        }
        let form = |(k, constraint): (usize, &hamel_lang::spec::Constraint)| {
            let form = match &highest[k] {
                Some(row) => along(row).into_iter().chain(quasi.iter().map(|_| R::ZERO)).collect(),
                None => slopes.iter().map(|slope| slope[k]).collect(),
            };
            (constraint.name.clone(), form)
        };
        Ok(self.model.constraints.iter().enumerate().map(form).collect())
    }

    /// Whether the constraints that modes leave there restrict different things: two that say the same, or contradict
    /// each other, have no multipliers.
    pub(super) fn modes_agree<R: Real>(&self, at: &Place<R>) -> Result<bool, Missing> {
        let there = |form: &[R]| form.iter().any(|e| e.magnitude() > 0.0);
        let forms = self.one_forms(at)?.into_iter().map(|(_, form)| form).filter(|form| there(form));
        let rows: Vec<Vec<R>> = forms.map(|form| form.into_iter().chain([R::ZERO]).collect()).collect();
        let n_rows = rows.len();
        Ok(Reduced::new(rows, self.n_displacements()).rank() == n_rows)
    }

    /// `phi(y) - phi(y/2)` and `f(y) y - f(y/2) y/2` for each condition `f delta = 0` that is the power of a constraint
    /// `phi = f y + b`, by the text of the constraint; `b` depends on no velocity.
    pub(super) fn powers<R: Real>(&self, at: &Place<R>) -> Result<Vec<(&str, [R; 2])>, Missing> {
        let conditions = &self.model.virtual_constraints;
        if conditions.iter().all(|condition| condition.power_of.is_none()) {
            return Ok(Vec::new());
        }
        let half = R::ONE / (R::ONE + R::ONE);
        let mut slower = at.env.clone();
        for (symbol, y) in self.velocities.iter().zip(&at.of_model) {
            slower.set(*symbol, *y * half);
        }
        let mut values = Vec::new();
        for env in [&at.env, &slower] {
            let forms = self.displacements.eval(env)?.roots;
            let y: Vec<R> =
                self.velocities.iter().map(|s| env.get(*s).ok_or(*s)).collect::<Result<_, _>>()?;
            let along = |form: &[R]| form.iter().zip(&y).fold(R::ZERO, |sum, (f, y)| sum + *f * *y);
            let powers: Vec<R> = forms.chunks(self.m).map(along).collect();
            values.push((self.residuals(env)?, powers));
        }
        let mut found = Vec::new();
        for (v, condition) in conditions.iter().enumerate() {
            let own = |c: &Constraint| condition.power_of.as_ref() == Some(&c.name);
            let Some(k) = self.model.constraints.iter().position(own) else { continue };
            let residual = values[0].0[k] - values[1].0[k];
            let power = values[0].1[v] - values[1].1[v];
            found.push((self.model.constraints[k].text.as_str(), [residual, power]));
        }
        Ok(found)
    }

    /// Number of entries of [`Definition::one_forms`].
    pub(super) fn n_displacements(&self) -> usize {
        match self.model.virtual_constraints.is_empty() {
            true => self.m + self.model.quasi_velocities.len(),
            false => self.m,
        }
    }

    /// `F . w` for a displacement in the frame of the group.
    pub(super) fn work<R: Real>(&self, at: &Place<R>, w: &[R]) -> Result<R, Missing> {
        let of_model = self.model_velocities(&at.env, w)?;
        let forces = self.forces(at)?;
        Ok(forces.iter().zip(&of_model).fold(R::ZERO, |sum, (f, w)| sum + *f * *w))
    }
}

fn displace<R: Real>(env: &mut Env<Dual<R>>, dx: &Displacement<R>) {
    for (symbol, d) in dx {
        if let Some(x) = env.get(*symbol) {
            env.set(*symbol, Dual::new(x.value, *d));
        }
    }
}
