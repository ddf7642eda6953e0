//! Discrete equations of motion by the action that they are the variation of.
//!
//! A step is drawn: its middle, and a state at both ends. The group element of the step is a matrix,
//! `f = tau(h xi)`, by the retraction itself; advected parameters at the end follow from the logarithm of `f` by the
//! exponential series of their own action. The action of the step, `h L` at the middle, is then varied along the
//! displacements of both ends, `f -> f (1 + eps eta)` or `(1 - eps eta) f`, with the retraction inverted on matrices of
//! dual numbers: that is what rows of momenta are held to. No derivative of a retraction is used, and no constant of
//! its series. `exp` is held to `f^-1 df = sum (-ad)^k/(k+1)!`, the derivative of its definition, where no matrices are
//! known.
//!
//! Does not know: how discrete equations are made or solved.
//!
//! # Source
//! Bou-Rabee and Marsden 2009, section 3; Cortes and Martinez 2001, section 3.

use hamel_runtime::{Dual, Real};

use hamel_lang::spec::{Retraction, Side};
use hamel_mechanics::mechanics::GroupMap;
use hamel_program::program::Role;

use super::claim::DiscreteClaim;
use super::definition::{Displacement, Missing, Place};
use super::linear::Reduced;
use super::motion::Motion;
use super::point::{Point, Setting};
use super::random::Random;
use super::runner::At;
use super::sheet::Sheet;
use super::tape::{Env, rational};
use super::wide::Wide;

const RESIDUAL: &str = "discrete_residual";
const JACOBIAN: &str = "discrete_jacobian";
const START: &str = "discrete_start";
/// Terms of a series are next to nothing below that.
const SMALL: f64 = 1e-33;
/// Terms of a series, and turns of an iteration, that are more than enough for small steps.
const MAX_TERMS: usize = 80;
/// Relative error of a fixed point.
const SOLVED: f64 = 1e-29;

/// A square matrix.
type Square<R> = Vec<Vec<R>>;

fn zeros<R: Real>(n: usize) -> Square<R> {
    vec![vec![R::ZERO; n]; n]
}

fn identity<R: Real>(n: usize) -> Square<R> {
    let mut one = zeros(n);
    (0..n).for_each(|k| one[k][k] = R::ONE);
    one
}

fn times<R: Real>(a: &Square<R>, b: &Square<R>) -> Square<R> {
    let n = a.len();
    let entry = |i: usize, j: usize| (0..n).fold(R::ZERO, |sum, k| sum + a[i][k] * b[k][j]);
    (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
}

/// `a + q b`.
fn sum<R: Real>(a: &Square<R>, q: R, b: &Square<R>) -> Square<R> {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| *a + q * *b).collect()).collect()
}

/// `a^-1 b`, by columns.
fn divided<R: Real>(a: &Square<R>, b: &Square<R>) -> Square<R> {
    let n = a.len();
    let mut x = zeros(n);
    for j in 0..n {
        let rows = (0..n).map(|i| a[i].iter().copied().chain([b[i][j]]).collect()).collect();
        let column = Reduced::new(rows, n).solution(&vec![R::ZERO; n]);
        column.into_iter().enumerate().for_each(|(i, value)| x[i][j] = value);
    }
    x
}

fn size(a: &Square<Wide>) -> f64 {
    a.iter().flatten().map(|x| x.size()).fold(0.0, f64::max)
}

/// The algebra of a model: its elements by matrices where these are known, and its bracket.
struct Algebra<'a> {
    setting: &'a Setting<'a>,
    retraction: Retraction,
    side: Side,
    matrices: Vec<Square<Wide>>,
    n: usize,
}

impl<'a> Algebra<'a> {
    fn new(setting: &'a Setting<'a>, map: &GroupMap) -> Algebra<'a> {
        let matrix = |m: &hamel_lang::algebra::Matrix| -> Square<Wide> {
            (0..m.n_rows()).map(|i| m.row(i).iter().map(rational).collect()).collect()
        };
        let definition = &setting.definition;
        Algebra {
            setting,
            retraction: map.retraction,
            side: definition.model.action,
            matrices: map.matrices.iter().map(matrix).collect(),
            n: definition.m - definition.n_shape,
        }
    }

    /// `[xi, eta]` of the algebra, whatever the side of the action.
    fn bracket(&self, env: &Env<Wide>, xi: &[Wide], eta: &[Wide]) -> Result<Vec<Wide>, Missing> {
        let definition = &self.setting.definition;
        let lifted = |v: &[Wide]| [vec![Wide::ZERO; definition.n_shape], v.to_vec()].concat();
        let value = definition.bracket(env, &lifted(xi), &lifted(eta))?;
        let sign = if self.side == Side::Left { Wide::ONE } else { -Wide::ONE };
        Ok(value[definition.n_shape..].iter().map(|x| sign * *x).collect())
    }

    /// Holds the matrices to the bracket: they are a representation, up to one sign, which is made the right one.
    fn represent(&mut self, env: &Env<Wide>, sheet: &mut Sheet) -> Result<(), Missing> {
        let unit = |a: usize| {
            (0..self.n).map(|k| if k == a { Wide::ONE } else { Wide::ZERO }).collect::<Vec<Wide>>()
        };
        for sign in [Wide::ONE, -Wide::ONE] {
            let mut rows = Vec::new();
            for a in 0..self.n {
                for b in a + 1..self.n {
                    let by_bracket = self.element(&self.bracket(env, &unit(a), &unit(b))?);
                    let (x, y) = (&self.matrices[a], &self.matrices[b]);
                    let commutator = sum(&times(x, y), -Wide::ONE, &times(y, x));
                    rows.extend(sum(&commutator, -sign, &by_bracket).into_iter().flatten());
                }
            }
            let holds = rows.iter().all(|x| x.size() == 0.0);
            if holds || sign.to_f64() < 0.0 {
                let worst = rows.into_iter().max_by(|a, b| a.size().total_cmp(&b.size()));
                sheet.zero(RESIDUAL, "matrices of the algebra", &worst.into_iter().collect::<Vec<_>>());
                self.matrices.iter_mut().flatten().flatten().for_each(|x| *x *= sign);
                return Ok(());
            }
        }
        Ok(())
    }

    /// The matrix of an element.
    fn element<R: Real + From<Wide>>(&self, xi: &[R]) -> Square<R> {
        let n = self.matrices.first().map_or(0, Vec::len);
        let mut matrix = zeros(n);
        for (q, own) in xi.iter().zip(&self.matrices) {
            for (row, own) in matrix.iter_mut().zip(own) {
                row.iter_mut().zip(own).for_each(|(x, e)| *x += *q * R::from(*e));
            }
        }
        matrix
    }

    /// The element of a matrix, and the entry that is farthest from it.
    fn components<R: Real + From<Wide>>(&self, matrix: &Square<R>) -> (Vec<R>, R) {
        let n = matrix.len();
        let mut rows: Vec<Vec<R>> = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let own = self.matrices.iter().map(|m| R::from(m[i][j]));
                rows.push(own.chain([matrix[i][j]]).collect());
            }
        }
        let xi = Reduced::new(rows, self.n).solution(&vec![R::ZERO; self.n]);
        let rest = sum(matrix, -R::ONE, &self.element(&xi));
        let farthest = rest
            .into_iter()
            .flatten()
            .fold(R::ZERO, |worst, x| if x.magnitude() > worst.magnitude() { x } else { worst });
        (xi, farthest)
    }

    /// The change of `h xi` along a displacement `eta` of the end of a step, or of its start.
    fn varied(
        &self,
        env: &Env<Wide>,
        zeta: &[Wide],
        eta: &[Wide],
        is_end: bool,
        sheet: &mut Sheet,
    ) -> Result<Vec<Wide>, Missing> {
        match self.retraction {
            Retraction::Cayley => {
                let x = self.element(zeta);
                let n = x.len();
                let half = Wide::exact(0.5);
                let f = divided(&sum(&identity(n), -half, &x), &sum(&identity(n), half, &x));
                let along = self.element(eta);
                let change = match (self.side, is_end) {
                    (Side::Left, true) => times(&f, &along),
                    (Side::Left, false) => times(&along, &f),
                    (Side::Right, true) => times(&along, &f),
                    (Side::Right, false) => times(&f, &along),
                };
                let sign = if is_end { Wide::ONE } else { -Wide::ONE };
                let moved: Square<Dual<Wide>> = f
                    .iter()
                    .zip(&change)
                    .map(|(f, d)| f.iter().zip(d).map(|(f, d)| Dual::new(*f, sign * *d)).collect())
                    .collect();
                // tau^-1(f) = 2 (f + 1)^-1 (f - 1)
                let one = identity::<Dual<Wide>>(n);
                let two = Dual::constant(Wide::exact(2.0));
                let quotient = divided(&sum(&moved, Dual::ONE, &one), &sum(&moved, -Dual::<Wide>::ONE, &one));
                let inverse = sum(&zeros(n), two, &quotient);
                let slope: Square<Wide> =
                    inverse.iter().map(|row| row.iter().map(|x| x.derivative).collect()).collect();
                let (change, farthest) = self.components(&slope);
                sheet.vanishes(RESIDUAL, "a step that stays in the group", farthest, size(&slope));
                Ok(change)
            }
            Retraction::Exp => {
                // e^{ad}, and sum ad^k/(k+1)!, by columns.
                let columns: Vec<[Vec<Wide>; 2]> =
                    (0..self.n).map(|k| self.series(env, zeta, k)).collect::<Result<_, _>>()?;
                let dot = |column: usize, i: usize, eta: &[Wide]| {
                    (0..self.n).fold(Wide::ZERO, |sum, k| sum + columns[k][column][i] * eta[k])
                };
                let right: Vec<Wide> = (0..self.n)
                    .map(|i| match (self.side, is_end) {
                        (Side::Left, true) => dot(0, i, eta),
                        (Side::Left, false) => -eta[i],
                        (Side::Right, true) => eta[i],
                        (Side::Right, false) => -dot(0, i, eta),
                    })
                    .collect();
                let rows = (0..self.n)
                    .map(|i| (0..self.n).map(|k| columns[k][1][i]).chain([right[i]]).collect::<Vec<Wide>>());
                Ok(Reduced::new(rows.collect(), self.n).solution(&vec![Wide::ZERO; self.n]))
            }
        }
    }

    /// `sum ad^k e/k!` and `sum ad^k e/(k+1)!` of a unit element.
    fn series(&self, env: &Env<Wide>, zeta: &[Wide], unit: usize) -> Result<[Vec<Wide>; 2], Missing> {
        let mut power: Vec<Wide> =
            (0..self.n).map(|k| if k == unit { Wide::ONE } else { Wide::ZERO }).collect();
        let mut sums = [power.clone(), power.clone()];
        for k in 1..MAX_TERMS {
            let turned = self.bracket(env, zeta, &power)?;
            power = turned.into_iter().map(|x| x / Wide::exact(k as f64)).collect();
            for (sum, divisor) in sums.iter_mut().zip([1.0, k as f64 + 1.0]) {
                sum.iter_mut().zip(&power).for_each(|(sum, x)| *sum += *x / Wide::exact(divisor));
            }
            if power.iter().all(|x| x.size() < SMALL) {
                break;
            }
        }
        Ok(sums)
    }

    /// The logarithm of the group element of a step, `2 atanh(h xi/2)` of the Cayley map.
    fn logarithm(&self, zeta: &[Wide], sheet: &mut Sheet) -> Vec<Wide> {
        if self.retraction == Retraction::Exp {
            return zeta.to_vec();
        }
        let x = self.element(zeta);
        let quarter = Wide::exact(0.25);
        let square = times(&x, &x);
        let (mut power, mut total) = (x.clone(), x);
        for k in 1..MAX_TERMS {
            power = sum(&zeros(power.len()), quarter, &times(&power, &square));
            total = sum(&total, Wide::ONE / Wide::exact(2.0 * k as f64 + 1.0), &power);
            if size(&power) < SMALL {
                break;
            }
        }
        let (log, farthest) = self.components(&total);
        sheet.vanishes(RESIDUAL, "a logarithm in the algebra", farthest, size(&total));
        log
    }

    /// Advected parameters at the end of a step, by those at its start, `exp` of their action along the logarithm.
    fn carried(&self, env: &Env<Wide>, log: &[Wide]) -> Result<Displacement<Wide>, Missing> {
        let definition = &self.setting.definition;
        let w = [vec![Wide::ZERO; definition.n_shape], log.to_vec()].concat();
        let rates = |env: &Env<Wide>| -> Result<Displacement<Wide>, Missing> {
            let all = definition.anchored(env, &w)?;
            Ok(all.into_iter().skip(definition.model.base.len()).collect())
        };
        let with = |values: &Displacement<Wide>| {
            let mut other = env.clone();
            values.iter().for_each(|(symbol, x)| other.set(*symbol, *x));
            other
        };
        let mut term = rates(env)?;
        let nothing: Displacement<Wide> = term.iter().map(|(symbol, _)| (*symbol, Wide::ZERO)).collect();
        let affine = rates(&with(&nothing))?;
        let mut total: Displacement<Wide> = Vec::new();
        for (symbol, _) in &term {
            total.push((*symbol, env.get(*symbol).ok_or(*symbol)?));
        }
        for k in 1..MAX_TERMS {
            total.iter_mut().zip(&term).for_each(|((_, sum), (_, x))| *sum += *x);
            if term.iter().all(|(_, x)| x.size() < SMALL) {
                break;
            }
            let next = rates(&with(&term))?;
            let scale = Wide::exact(k as f64 + 1.0);
            term = next.iter().zip(&affine).map(|((s, x), (_, a))| (*s, (*x - *a) / scale)).collect();
        }
        Ok(total)
    }
}

/// A step with all numbers.
struct Drawn {
    h: Wide,
    start: Place<Wide>,
    middle: Place<Wide>,
    end: Place<Wide>,
    /// `h xi`.
    zeta: Vec<Wide>,
}

impl<'a> Setting<'a> {
    /// Holds the discrete equations of a scene to their principle.
    ///
    /// # Errors
    /// A symbol that has no value at the point.
    pub(super) fn check_discrete(
        &self,
        point: &Point,
        claim: &DiscreteClaim<'_>,
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Result<(), Missing> {
        let mut algebra = Algebra::new(self, claim.map);
        if !algebra.matrices.is_empty() {
            algebra.represent(&point.env, sheet)?;
        }
        let drawn = self.draw_step(point, &algebra, sheet, random)?;
        let (variables, t) = self.variables(&drawn, claim)?;
        let rows = self.rows(&drawn, &algebra, sheet)?;
        let at = At { t, ..point.at(&[]) };
        let found = self.called(RESIDUAL, &at, &variables);
        if found.len() != rows.len() {
            sheet.vanishes(RESIDUAL, "the number of rows", Wide::ONE, 1.0);
        }
        for (k, (found, row)) in found.into_iter().zip(rows).enumerate() {
            let terms: Vec<Wide> = row.into_iter().map(|x| -x).chain([found]).collect();
            sheet.zero(RESIDUAL, format!("row {}", k + 1), &terms);
        }
        self.check_entries(&at, (&variables, claim), sheet);
        self.check_start(&at, (&drawn, &variables, claim), sheet)
    }

    /// The results of a function of discrete equations; it reads no state.
    fn called<R: Real>(&self, name: &str, at: &At<'_, R>, variables: &[R]) -> Vec<R> {
        let program = self.claim.program;
        let Some(k) = program.function_idx(&Role::OfVariables(name.to_owned())) else { return Vec::new() };
        let state = vec![R::ZERO; program.state.len()];
        self.runner.call(
            k,
            &At { state: &state, t: at.t, params: at.params, slots: at.slots, inputs: at.inputs },
            variables,
        )
    }

    /// A step whose middle is at the point, but for advected parameters, which are there at its start.
    fn draw_step(
        &self,
        point: &Point,
        algebra: &Algebra<'_>,
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Result<Drawn, Missing> {
        let definition = &self.definition;
        let (model, n_shape) = (definition.model, definition.n_shape);
        let speed = 1.0 + self.place(&point.env)?.group.iter().map(|x| x.size()).fold(0.0, f64::max);
        let h = Wide::exact(random.between(0.03, 0.09) / speed);
        let half = Wide::exact(0.5);
        let advected: Vec<_> =
            model.advected.iter().flat_map(|a| a.components.iter().map(|(_, symbol)| *symbol)).collect();
        let (mut env, mut zeta, mut ends) = (point.env.clone(), Vec::new(), Vec::new());
        // Velocities in the middle depend on parameters that the step advects.
        for turn in 0..MAX_TERMS {
            let middle = self.place(&env)?;
            let next: Vec<Wide> = middle.group[n_shape..].iter().map(|x| h * *x).collect();
            let change = next.iter().zip(&zeta).map(|(a, b): (&Wide, &Wide)| (*a - *b).size());
            let is_done = turn > 0 && change.fold(0.0, f64::max) < SMALL;
            zeta = next;
            if is_done {
                break;
            }
            let log = algebra.logarithm(&zeta, &mut Sheet::default());
            ends = algebra.carried(&point.env, &log)?;
            for (symbol, value) in &mut ends {
                *value = Wide::of(*value).uncertain(SOLVED * value.size());
                let start = point.env.get(*symbol).ok_or(*symbol)?;
                env.set(*symbol, half * (start + *value));
            }
        }
        algebra.logarithm(&zeta, sheet);
        let middle = self.place(&env)?;
        let mut nodes = Vec::new();
        for sign in [-1.0, 1.0] {
            let passed = Wide::exact(0.5 * sign) * h;
            let mut node = point.env.clone();
            node.set(model.time, point.t + passed);
            for (coordinate, v) in model.base.iter().zip(&middle.group) {
                let x = env.get(coordinate.symbol).ok_or(coordinate.symbol)?;
                node.set(coordinate.symbol, x + passed * *v);
            }
            if sign > 0.0 {
                ends.iter().for_each(|(symbol, x)| node.set(*symbol, *x));
            }
            for unknown in &self.claim.equations.system.unknowns {
                node.set(unknown.symbol, Wide::exact(random.signed()));
            }
            nodes.push(self.place(&node)?);
        }
        debug_assert_eq!(advected.len(), ends.len(), "all of them move");
        let (Some(end), Some(start)) = (nodes.pop(), nodes.pop()) else { return Err(model.time) };
        Ok(Drawn { h, start, middle, end, zeta })
    }

    /// The variables `(h, y, z)` of the step, and its time.
    fn variables(&self, drawn: &Drawn, claim: &DiscreteClaim<'_>) -> Result<(Vec<Wide>, Wide), Missing> {
        let of = |env: &Env<Wide>| -> Result<Vec<Wide>, Missing> {
            self.state.iter().map(|s| env.get(*s).ok_or(*s)).collect()
        };
        let [start, end] = [of(&drawn.start.env)?, of(&drawn.end.env)?];
        let middle = self.in_middle(&drawn.middle)?;
        let mut middle = middle.into_iter();
        let mut unknowns = Vec::with_capacity(claim.n_unknowns);
        for k in 0..claim.n_unknowns {
            let of_end = claim.state.iter().position(|place| *place == k).map(|component| end[component]);
            unknowns.push(of_end.or_else(|| middle.next()).unwrap_or(Wide::ZERO));
        }
        let time = self.definition.model.time;
        let t = drawn.start.env.get(time).ok_or(time)?;
        Ok(([vec![drawn.h], start, unknowns].concat(), t))
    }

    /// Velocities in the middle of a step, in the order of the unknowns.
    fn in_middle(&self, place: &Place<Wide>) -> Result<Vec<Wide>, Missing> {
        let system = &self.claim.equations.system;
        let quasi = system.unknowns.iter().filter(|u| u.frame_idx.is_none()).map(|u| u.symbol);
        let mut all = place.of_system.clone();
        for symbol in quasi {
            all.push(place.env.get(symbol).ok_or(symbol)?);
        }
        Ok(all)
    }

    /// The rows, as sums: zero of coordinates and constraints of this step, momenta of states less the momenta of the
    /// step at its start, and the other way round at its end.
    fn rows(
        &self,
        drawn: &Drawn,
        algebra: &Algebra<'_>,
        sheet: &mut Sheet,
    ) -> Result<Vec<Vec<Wide>>, Missing> {
        let system = &self.claim.equations.system;
        let definition = &self.definition;
        let n_displacements = system.unknowns.len();
        let n_quasi = system.unknowns.iter().filter(|u| u.frame_idx.is_none()).count();
        let n_zero = system.algebroid.n_base() + definition.m + n_quasi - n_displacements;
        let mut rows = vec![Vec::new(); n_zero];
        let half = Wide::exact(0.5) * drawn.h;
        let forces = definition.forces(&drawn.middle)?;
        for (node, is_end) in [(&drawn.start, false), (&drawn.end, true)] {
            for b in 0..n_displacements {
                let along = Motion::displacement_of(self, node, b)?;
                let along = &along[..definition.m];
                let w = definition.group_velocities(&node.env, along)?;
                let own = definition.lagrangian(node, &w, &Vec::new())?.derivative;
                let action = self.variation((drawn, node), algebra, &w, is_end, sheet)?;
                let work = forces.iter().zip(along).map(|(f, w)| half * *f * *w);
                let sign = if is_end { -Wide::ONE } else { Wide::ONE };
                rows.push([sign * own, action].into_iter().chain(work).collect());
            }
        }
        Ok(rows)
    }

    /// The change of the action of a step along a displacement of one of its ends, in the frame of the group there.
    fn variation(
        &self,
        (drawn, node): (&Drawn, &Place<Wide>),
        algebra: &Algebra<'_>,
        w: &[Wide],
        is_end: bool,
        sheet: &mut Sheet,
    ) -> Result<Wide, Missing> {
        let definition = &self.definition;
        let (h, half) = (drawn.h, Wide::exact(0.5));
        let (dx, eta) = w.split_at(definition.n_shape);
        let sign = if is_end { Wide::ONE } else { -Wide::ONE };
        let turned = match algebra.n {
            0 => Vec::new(),
            _ => algebra.varied(&node.env, &drawn.zeta, eta, is_end, sheet)?,
        };
        let dy: Vec<Wide> =
            dx.iter().map(|d| sign * *d / h).chain(turned.into_iter().map(|d| d / h)).collect();
        let moved = definition.anchored(&node.env, w)?;
        let moved = moved.into_iter().map(|(symbol, d)| (symbol, half * d)).collect();
        Ok(h * definition.lagrangian(&drawn.middle, &dy, &moved)?.derivative)
    }

    /// Derivatives of the rows, by dual numbers.
    fn check_entries(
        &self,
        at: &At<'_, Wide>,
        (variables, claim): (&[Wide], &DiscreteClaim<'_>),
        sheet: &mut Sheet,
    ) {
        let dual = |list: &[Wide]| -> Vec<Dual<Wide>> { list.iter().map(|x| Dual::constant(*x)).collect() };
        let (params, slots, inputs) = (dual(at.params), dual(at.slots), dual(at.inputs));
        let at_dual =
            At { params: &params, slots: &slots, inputs: &inputs, t: Dual::constant(at.t), state: &[] };
        let n = claim.n_unknowns;
        let mut found = vec![vec![Wide::ZERO; n]; n];
        for ((i, j), e) in claim.pattern.iter().zip(self.called(JACOBIAN, at, variables)) {
            found[*i][*j] = e;
        }
        let first = variables.len() - n;
        for j in 0..n {
            let mut seeded = dual(variables);
            seeded[first + j] = Dual::variable(variables[first + j]);
            let rows = self.called(RESIDUAL, &at_dual, &seeded);
            for (i, row) in rows.into_iter().enumerate() {
                let what = format!("row {}, column {}", i + 1, j + 1);
                sheet.equal(JACOBIAN, what, found[i][j], row.derivative);
            }
        }
    }

    /// First values are the velocities and coordinates at the start.
    fn check_start(
        &self,
        at: &At<'_, Wide>,
        (drawn, variables, claim): (&Drawn, &[Wide], &DiscreteClaim<'_>),
        sheet: &mut Sheet,
    ) -> Result<(), Missing> {
        let mut velocities = self.in_middle(&drawn.start)?.into_iter();
        for (k, found) in self.called(START, at, variables).into_iter().enumerate() {
            let of_state = claim.state.iter().position(|place| *place == k).map(|c| variables[1 + c]);
            let defined = of_state.or_else(|| velocities.next()).unwrap_or(Wide::ZERO);
            sheet.equal(START, format!("unknown {}", k + 1), found, defined);
        }
        Ok(())
    }
}
