//! The rates of a scene beside the equations of motion of its model.
//!
//! For every virtual displacement `w`, in the frame `(xdot, xi)`:
//! `d/dt <p, w> + <p, [w, y]> - dL(rho w) - <F, w> = 0`, with `p = dL/dy` and the derivative by time along the rates.
//!
//! Does not know: how rates were derived, other functions of the scene.
//!
//! # Source
//! Hamel 1904; Cortes, de Leon, Marrero, Martinez 2009, section 3.

use std::collections::BTreeMap;

use hamel_runtime::{Dual, Real};

use hamel_expr::SymbolId;
use hamel_lang::spec::{ConnectionKind, ConstraintKind, Given, ReconstructionKind, Side};
use hamel_mechanics::reduction::KinematicConstraint;

use super::definition::{Displacement, Missing, Place};
use super::group;
use super::linear::Reduced;
use super::point::{Point, Setting};
use super::random::Random;
use super::sheet::Sheet;
use super::tape::Tape;
use super::wide::Wide;

/// Name of the function that this file is about.
pub(super) const RATES: &str = "rhs";

/// A state and its motion.
pub(super) struct Motion {
    pub(super) state: Vec<Wide>,
    /// Rates by the program, by the time of the model.
    pub(super) rates: Vec<Wide>,
    pub(super) at: Place<Wide>,
    /// The same with derivatives by time.
    pub(super) moving: Place<Dual<Wide>>,
}

pub(super) fn minus<R: Real>(dx: &Displacement<R>) -> Displacement<R> {
    dx.iter().map(|(symbol, d)| (*symbol, -*d)).collect()
}

fn dot<R: Real>(a: &[R], b: &[R]) -> R {
    a.iter().zip(b).fold(R::ZERO, |sum, (a, b)| sum + *a * *b)
}

pub(super) fn constants(v: &[Wide]) -> Vec<Dual<Wide>> {
    v.iter().map(|x| Dual::constant(*x)).collect()
}

impl Motion {
    pub(super) fn new(setting: &Setting<'_>, point: &Point) -> Result<Motion, Missing> {
        let rates = setting.rates(&point.at(&point.state(setting)));
        Motion::with_rates(setting, point, rates)
    }

    /// The motion that a state would have at other rates.
    pub(super) fn with_rates(
        setting: &Setting<'_>,
        point: &Point,
        rates: Vec<Wide>,
    ) -> Result<Motion, Missing> {
        let state = point.state(setting);
        let definition = &setting.definition;
        let mut at = setting.place(&point.env)?;
        let base = definition.anchored(&at.env, &Motion::total(setting, &at)?)?;
        let mut along: Vec<(SymbolId, Wide)> =
            setting.state.iter().copied().zip(rates.iter().copied()).collect();
        along.push((definition.model.time, Wide::ONE));
        // What the scene leaves out moves as the model says.
        let carried = |symbol: &SymbolId| {
            let on_circle = setting.circles.iter().find(|[.., angle]| angle == symbol);
            setting.state.contains(on_circle.map_or(symbol, |[cosine, ..]| cosine))
        };
        along.extend(base.into_iter().filter(|(symbol, _)| !carried(symbol)));
        let of_first_order = definition.first_order(&at.env)?;
        along.extend(of_first_order.into_iter().filter(|(symbol, _)| !carried(symbol)));
        let moving = setting.place(&setting.seeded(&point.env, &along))?;
        for (symbol, y) in definition.model.accelerations.iter().zip(&moving.of_model) {
            at.env.set(*symbol, y.derivative);
        }
        Ok(Motion { state, rates, at, moving })
    }

    /// The rate of a component of the state.
    fn rate_of(&self, setting: &Setting<'_>, symbol: SymbolId) -> Option<Wide> {
        setting.state.iter().position(|s| *s == symbol).map(|k| self.rates[k])
    }

    /// All identities of the rates.
    pub(super) fn check(
        &self,
        setting: &Setting<'_>,
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Result<(), Missing> {
        self.kinematics(setting, sheet)?;
        self.state_is_what_it_is_named(setting, sheet)?;
        self.constraints(setting, sheet)?;
        match &setting.definition.model.given {
            Some(given) => self.given(setting, given, sheet)?,
            None => self.balance(setting, sheet, random)?,
        }
        self.connection(setting, sheet, random)?;
        self.entropies(setting, sheet);
        self.reconstruction(setting, sheet)
    }

    /// Sums of entropies that are said never to decrease have no negative rate.
    fn entropies(&self, setting: &Setting<'_>, sheet: &mut Sheet) {
        let graph = &setting.claim.equations.system.graph;
        for production in &setting.claim.equations.facts.entropies {
            let own = |name: &String| setting.state.iter().position(|s| graph.name(*s) == name);
            let rates: Option<Vec<Wide>> =
                production.names.iter().map(|name| Some(self.rates[own(name)?])).collect();
            let Some(rates) = rates.filter(|_| production.is_produced) else { continue };
            let rate = rates.iter().fold(Wide::ZERO, |sum, rate| sum + *rate);
            let negative = if rate.to_f64() < 0.0 { rate } else { Wide::ZERO };
            let terms = rates.iter().map(|rate| rate.size()).sum();
            let what = format!("the production of entropy {}", production.names.join(" + "));
            sheet.vanishes(RATES, what, negative, terms);
        }
    }

    /// `xdot = rho y`, also of advected parameters.
    fn kinematics(&self, setting: &Setting<'_>, sheet: &mut Sheet) -> Result<(), Missing> {
        let definition = &setting.definition;
        let model = definition.model;
        let moved = definition.anchored(&self.at.env, &Motion::total(setting, &self.at)?)?;
        for (symbol, rate) in moved.into_iter().chain(definition.first_order(&self.at.env)?) {
            let name = model.graph.name(symbol);
            if let Some(found) = self.rate_of(setting, symbol) {
                sheet.equal(RATES, format!("the rate of {name}"), found, rate);
            }
            let Some([cosine, sine, _]) = setting.circles.iter().find(|[.., angle]| *angle == symbol) else {
                continue;
            };
            let (Some(dc), Some(ds)) = (self.rate_of(setting, *cosine), self.rate_of(setting, *sine)) else {
                continue;
            };
            let [c, s] = [*cosine, *sine].map(|x| self.at.env.get(x).unwrap_or_default());
            sheet.zero(RATES, format!("the rate of {name}"), &[c * ds, -(s * dc), -rate]);
            sheet.zero(RATES, format!("the circle of {name}"), &[c * dc, s * ds]);
        }
        Ok(())
    }

    /// Velocities and momenta of the state are those of the model.
    fn state_is_what_it_is_named(&self, setting: &Setting<'_>, sheet: &mut Sheet) -> Result<(), Missing> {
        let definition = &setting.definition;
        let system = &setting.claim.equations.system;
        for (symbol, y) in setting.velocity_symbols.iter().zip(&self.at.of_system) {
            if let Some(k) = setting.state.iter().position(|s| s == symbol) {
                let name = &setting.claim.program.state[k];
                sheet.equal(RATES, format!("the velocity {name}"), *y, self.state[k]);
            }
        }
        if let (true, false) = (definition.has_hamiltonian(), definition.m == 0) {
            for (k, slope) in definition.hamiltonian_velocities(&self.at)?.into_iter().enumerate() {
                sheet.equal(
                    RATES,
                    format!("velocity {} by the Hamiltonian", k + 1),
                    self.at.of_model[k],
                    slope,
                );
            }
            return Ok(());
        }
        for momentum in &system.momenta {
            let displacement = Motion::displacement_of(setting, &self.at, momentum.unknown)?;
            let along = definition.group_velocities(&self.at.env, &displacement[..definition.m])?;
            let value = definition.lagrangian(&self.at, &along, &Vec::new())?.derivative;
            let what = format!("the momentum {}", momentum.name);
            let up_to = definition.model.quasi_invariances.iter().find(|q| {
                // The system's own function may have gone into its Lagrangian: that of the model counts.
                momentum.symbol.is_none() && q.parameter == momentum.name
            });
            let Some(up_to) = up_to else {
                let claimed = Tape::new(&system.graph, &[momentum.value]).eval(&self.at.env)?.roots[0];
                sheet.equal(RATES, what, claimed, value);
                continue;
            };
            let model = definition.model;
            let f = Tape::new(&model.graph, &[up_to.function]).eval(&self.at.env)?.roots[0];
            let parameter = model.params.iter().find(|p| p.name == momentum.name).map(|p| p.symbol);
            match parameter {
                Some(p) => {
                    let constant = self.at.env.get(p).ok_or(p)?;
                    sheet.zero(RATES, what, &[value, -f, -constant]);
                }
                // A momentum that no parameter of the model is: nothing holds it.
                None => sheet.zero(RATES, what, &[Wide::ONE]),
            }
        }
        Ok(())
    }

    /// The virtual displacement along an unknown, with no part along others; where multipliers keep the constraints,
    /// the velocity alone.
    pub(super) fn displacement_of<R: Real>(
        setting: &Setting<'_>,
        at: &Place<R>,
        unknown: usize,
    ) -> Result<Vec<R>, Missing> {
        let definition = &setting.definition;
        let system = &setting.claim.equations.system;
        let n = definition.n_displacements();
        let place = |k: usize| {
            let unknown = &system.unknowns[k];
            let quasi = || definition.model.quasi_velocities.iter().position(|v| v.symbol == unknown.symbol);
            unknown.frame_idx.or_else(|| Some(definition.m + quasi()?))
        };
        // The state keeps velocities of the model where the frame of stages is internal.
        let kept = |k: usize| {
            let original = system.frame.as_ref().map(|frame| &frame.original)?;
            original.iter().position(|u| u.symbol == system.unknowns[k].symbol)
        };
        let mut before_stages: Vec<Vec<R>> = Vec::new();
        for k in 0..definition.m {
            let unit: Vec<R> = (0..definition.m).map(|j| if j == k { R::ONE } else { R::ZERO }).collect();
            before_stages.push(definition.before_stages(&at.env, &unit)?);
        }
        let unit = |k: usize, right: R| {
            let mut row = vec![R::ZERO; n + 1];
            match kept(k) {
                Some(i) => row.iter_mut().zip(&before_stages).for_each(|(entry, column)| *entry = column[i]),
                None => {
                    if let Some(entry) = place(k).and_then(|at| row.get_mut(at)) {
                        *entry = R::ONE;
                    }
                }
            }
            row[n] = right;
            row
        };
        let mut rows = Vec::new();
        match &system.constraint {
            KinematicConstraint::Multipliers { .. } => {
                let mut single = vec![R::ZERO; n];
                if let Some(entry) = place(unknown).and_then(|at| single.get_mut(at)) {
                    *entry = R::ONE;
                }
                return Ok(single);
            }
            KinematicConstraint::Solved(_) => {
                for (_, mut form) in definition.one_forms(at)? {
                    form.push(R::ZERO);
                    rows.push(form);
                }
                rows.extend(
                    (0..system.unknowns.len()).map(|k| unit(k, if k == unknown { R::ONE } else { R::ZERO })),
                );
            }
        }
        Ok(Reduced::new(rows, n).solution(&vec![R::ZERO; n]))
    }

    /// Constraints hold, and stay so.
    fn constraints(&self, setting: &Setting<'_>, sheet: &mut Sheet) -> Result<(), Missing> {
        let definition = &setting.definition;
        let model = definition.model;
        let residuals = definition.residuals(&self.moving.env);
        let at_rest = definition.residuals(&self.at.env)?;
        let forms: BTreeMap<String, f64> = match model.virtual_constraints.is_empty() {
            true => {
                let size =
                    |form: &[Wide]| form.iter().zip(&self.at.of_system).map(|(w, y)| (*w * *y).size()).sum();
                definition.one_forms(&self.at)?.into_iter().map(|(name, form)| (name, size(&form))).collect()
            }
            false => BTreeMap::new(),
        };
        for (text, [residual, power]) in definition.powers(&self.at)? {
            sheet.equal(RATES, format!("the power of the constraint `{text}`"), power, residual);
        }
        let highest = definition.highest(&self.at.env)?;
        let accelerations: Vec<Wide> = self.moving.of_model.iter().map(|y| y.derivative).collect();
        for (k, constraint) in model.constraints.iter().enumerate() {
            let what = |s: &str| format!("{s} `{}`", constraint.text);
            match (&constraint.kind, &highest[k]) {
                (ConstraintKind::SecondOrder { .. }, Some(row)) => {
                    sheet.zero(RATES, what("the constraint"), &[dot(row, &accelerations), at_rest[k]]);
                }
                (ConstraintKind::ThirdOrder { jerk, carried }, Some(row)) => {
                    let Some(rate) = self.rate_of(setting, carried.symbol) else { continue };
                    let own = self.at.env.get(carried.symbol).unwrap_or_default();
                    let roots: Vec<_> = jerk.iter().copied().chain([carried.offset]).collect();
                    let moving = Tape::new(&model.graph, &roots).eval(&self.moving.env)?.roots;
                    let (turning, offset) = moving.split_at(jerk.len());
                    let along = dot(row, &accelerations);
                    sheet.zero(RATES, what("the acceleration along"), &[own, -along, -offset[0].value]);
                    let lag = turning
                        .iter()
                        .zip(&accelerations)
                        .fold(Wide::ZERO, |s, (w, a)| s + w.derivative * *a);
                    sheet.zero(
                        RATES,
                        what("the constraint"),
                        &[rate, -lag, -offset[0].derivative, at_rest[k]],
                    );
                }
                _ => {
                    let residual = residuals.as_ref().map_err(|missing| *missing)?[k];
                    let terms = forms.get(&constraint.name).copied().unwrap_or(1.0).max(self.scale());
                    sheet.vanishes(RATES, what("the constraint"), residual.value, terms);
                    sheet.vanishes(
                        RATES,
                        what("the derivative of the constraint"),
                        residual.derivative,
                        terms,
                    );
                }
            }
        }
        Ok(())
    }

    /// Size of the velocities and accelerations.
    fn scale(&self) -> f64 {
        let sizes = self.moving.of_model.iter().flat_map(|y| [y.value.size(), y.derivative.size()]);
        sizes.fold(0.0, f64::max)
    }

    /// Velocities or accelerations that the model gives.
    fn given(&self, setting: &Setting<'_>, given: &[Given], sheet: &mut Sheet) -> Result<(), Missing> {
        let model = setting.definition.model;
        for ((given, y), (name, _)) in given.iter().zip(&self.moving.of_model).zip(model.all_velocities()) {
            let (found, e) = match given {
                Given::Velocity(e) => (y.value, *e),
                Given::Acceleration(e) => (y.derivative, *e),
                // The constraints hold, which is compared.
                Given::Constrained => continue,
            };
            let defined = Tape::new(&model.graph, &[e]).eval(&self.at.env)?.roots[0];
            sheet.equal(RATES, format!("what the model gives of {name}"), found, defined);
        }
        Ok(())
    }

    /// `d/dt <p, w> + <p, [w, y]> - dL(rho w) - <F, w>`, term by term.
    pub(super) fn unbalanced(&self, setting: &Setting<'_>, w: &[Wide]) -> Result<[Wide; 4], Missing> {
        let definition = &setting.definition;
        let z = definition.bracket(&self.at.env, w, &self.at.group)?;
        let dx = definition.anchored(&self.at.env, w)?;
        let work = definition.work(&self.at, w)? - Motion::power_of_noise(setting, &self.at, w)?;
        if !definition.has_hamiltonian() {
            let inertia =
                definition.lagrangian(&self.moving, &constants(w), &Vec::new())?.derivative.derivative;
            let turning = definition.lagrangian(&self.at, &z, &Vec::new())?.derivative;
            let still = vec![Wide::ZERO; w.len()];
            let drive = definition.lagrangian(&self.at, &still, &minus(&dx))?.derivative;
            return Ok([inertia, turning, drive, -work]);
        }
        let of_model = definition.model_velocities(&self.moving.env, &constants(w))?;
        let inertia = definition.momentum_along(&self.moving, &of_model)?.derivative;
        let along = definition.model_velocities(&self.at.env, &z)?;
        let turning = definition.momentum_along(&self.at, &along)?;
        // At fixed momenta in the frame of the group, those of the model change with its frame.
        let shifted = {
            let mut env = self.at.env.map(Dual::constant);
            for (symbol, d) in &dx {
                if let Some(x) = self.at.env.get(*symbol) {
                    env.set(*symbol, Dual::new(x, *d));
                }
            }
            let y = definition.model_velocities(&env, &constants(&self.at.group))?;
            let change: Vec<Wide> = y.iter().map(|y| y.derivative).collect();
            definition.momentum_along(&self.at, &change)?
        };
        let drive = definition.hamiltonian(&self.at, &dx)?.derivative - shifted;
        Ok([inertia, turning, drive, -work])
    }

    /// The equations of motion along a random virtual displacement, which sees every row.
    fn balance(&self, setting: &Setting<'_>, sheet: &mut Sheet, random: &mut Random) -> Result<(), Missing> {
        let definition = &setting.definition;
        let n = definition.n_displacements();
        if definition.m == 0 {
            return Ok(());
        }
        let rows = definition.one_forms(&self.at)?.into_iter().map(|(_, mut form)| {
            form.push(Wide::ZERO);
            form
        });
        let reduced = Reduced::new(rows.collect(), n);
        if reduced.rank() == n {
            return Ok(());
        }
        let w = reduced.solution(&random.vector(n));
        let w = definition.group_velocities(&self.at.env, &w[..definition.m])?;
        let terms = self.unbalanced(setting, &w)?;
        sheet.zero(RATES, "the equation of motion", &terms);
        Ok(())
    }

    /// Horizontal velocities `(xdot, -A xdot)` of a mechanical connection are orthogonal to vertical ones in the
    /// kinetic energy.
    fn connection(
        &self,
        setting: &Setting<'_>,
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Result<(), Missing> {
        let definition = &setting.definition;
        let (n, m) = (definition.n_shape, definition.m);
        let chosen = setting.claim.equations.system.formulation.connection;
        if chosen != Some(ConnectionKind::Mechanical) || n == 0 || n == m {
            return Ok(());
        }
        let mut along_shape = random.vector(n);
        along_shape.resize(m, Wide::ZERO);
        // The vertical velocities of the model vanish along it, whatever frame the equations are written in.
        let horizontal = definition.group_velocities_before_stages(&self.at.env, &along_shape)?;
        let mut vertical = vec![Wide::ZERO; n];
        vertical.extend(random.vector(m - n));
        let group: Vec<Dual<Wide>> =
            self.at.group.iter().zip(&horizontal).map(|(y, h)| Dual::new(*y, *h)).collect();
        let env = self.at.env.map(Dual::constant);
        let of_model = definition.model_velocities(&env, &group)?;
        let shifted = Place { env, of_system: constants(&self.at.of_system), group, of_model };
        let along = |w: &[Wide]| definition.lagrangian(&shifted, &constants(w), &Vec::new());
        let paired = along(&vertical)?.derivative.derivative;
        let size = along(&horizontal)?.derivative.derivative.size();
        sheet.vanishes(RATES, "the mechanical connection", paired, size);
        Ok(())
    }

    /// `g' = g xi` or `g' = xi g` for coordinates of the group that the state carries.
    fn reconstruction(&self, setting: &Setting<'_>, sheet: &mut Sheet) -> Result<(), Missing> {
        let model = setting.definition.model;
        let side = model.action;
        let env = match Motion::transport(setting, &self.at)? {
            Some(_) => {
                let total = Motion::total(setting, &self.at)?;
                setting.definition.moved_by(&self.at.env, &total)?
            }
            None => self.at.env.clone(),
        };
        for item in &model.reconstruction {
            let rates: Option<Vec<Wide>> = item.symbols.iter().map(|s| self.rate_of(setting, *s)).collect();
            let Some(rates) = rates else { continue };
            let values: Vec<Wide> =
                item.symbols.iter().map(|s| self.at.env.get(*s).unwrap_or_default()).collect();
            let moving: Vec<Dual<Wide>> = values.iter().zip(&rates).map(|(x, d)| Dual::new(*x, *d)).collect();
            let number = |list: &[hamel_expr::ExprId]| -> Result<Vec<Wide>, Missing> {
                Ok(Tape::new(&model.graph, list).eval(&env)?.roots)
            };
            let mut each = |found: &[Wide], defined: &[Wide]| {
                for ((name, found), defined) in item.names.iter().zip(found).zip(defined) {
                    sheet.equal(RATES, format!("the rate of {name}"), *found, *defined);
                }
            };
            match &item.kind {
                ReconstructionKind::Angle { omega } => each(&rates, &number(&[*omega])?),
                ReconstructionKind::Translation { v } => each(&rates, &number(v)?),
                ReconstructionKind::Rate { rate } => each(&rates, &number(rate)?),
                ReconstructionKind::PlanarPose { omega, v } => {
                    let [omega, v1, v2] = [*omega, v[0], v[1]];
                    let xi = number(&[omega, v1, v2])?;
                    let (s, c) = values[0].sin_cos();
                    let defined = match side {
                        Side::Left => [xi[0], c * xi[1] - s * xi[2], s * xi[1] + c * xi[2]],
                        Side::Right => [xi[0], xi[1] - xi[0] * values[2], xi[2] + xi[0] * values[1]],
                    };
                    each(&rates, &defined);
                }
                ReconstructionKind::Matrix { group, elements: _, xi } => {
                    each(&rates, &group::matrix_rates(group, &values, &number(xi)?, side));
                }
                ReconstructionKind::Quaternion { omega } => {
                    self.attitude(sheet, &item.names[0], &moving[..4], &number(omega)?, side);
                }
                ReconstructionKind::Pose { omega, v } => {
                    let (omega, v) = (number(omega)?, number(v)?);
                    self.attitude(sheet, &item.names[0], &moving[..4], &omega, side);
                    let matrix = group::rotation(&values[..4]);
                    let r = &values[4..];
                    let defined = match side {
                        Side::Left => group::rotated(&matrix, &v),
                        Side::Right => vec![
                            v[0] + omega[1] * r[2] - omega[2] * r[1],
                            v[1] + omega[2] * r[0] - omega[0] * r[2],
                            v[2] + omega[0] * r[1] - omega[1] * r[0],
                        ],
                    };
                    for k in 0..3 {
                        sheet.equal(
                            RATES,
                            format!("the rate of {}", item.names[4 + k]),
                            rates[4 + k],
                            defined[k],
                        );
                    }
                }
            }
        }
        Ok(())
    }

    /// The rotation matrix of a quaternion turns with the angular velocity, and the quaternion keeps its length.
    fn attitude(&self, sheet: &mut Sheet, name: &str, q: &[Dual<Wide>], omega: &[Wide], side: Side) {
        let values: Vec<Wide> = q.iter().map(|x| x.value).collect();
        let turned = group::turned(&group::rotation(&values), omega, side);
        for (found, defined) in group::rotation(q).iter().flatten().zip(turned.iter().flatten()) {
            sheet.equal(RATES, format!("the attitude {name}"), found.derivative, *defined);
        }
        let terms: Vec<Wide> = q.iter().map(|x| x.value * x.derivative).collect();
        sheet.zero(RATES, format!("the length of {name}"), &terms);
    }
}
