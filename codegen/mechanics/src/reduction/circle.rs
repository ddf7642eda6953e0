//! Angles as points `(c, s)` of the circle: one more state variable each, no sine and cosine on the right side.
//!
//! The circle is to an angle `theta` what an advected parameter in R^2 is to a rotation: the anchor turns the point,
//! `c' = -s theta'`, `s' = c theta'`, and what was `d/dtheta` of a function is the anchor applied to it. Nothing else
//! of the system changes: the frame, its brackets and the derivation stay as they are.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};
use std::slice::from_ref;

use num_traits::{Signed, ToPrimitive};

use hamel_expr::{DivisionByZero, ExprId, Func, Graph, Node, Rational, SymbolId};
use hamel_lang::algebra::Algebroid;
use hamel_lang::spec::{
    self, Coordinate, Diagnostics, Domain, Model, NamedVector, OutputPart, Span, circle_names,
};

use super::domain::{DomainCondition, spell_end};
use super::part::Part;
use super::system::{Circle, ReducedSystem, StateKind};

/// A higher multiple of an angle is not written in its sine and cosine.
const MAX_MULTIPLE: u64 = 64;

/// Carries `angles`, base coordinates of the model, as points of the circle.
///
/// `cos(k theta + b)` and `sin(k theta + b)` become polynomials in `c` and `s` by the addition theorems. The relation
/// `c^2 + s^2 = 1` holds along every motion that begins on the circle, as both sides are constant on any motion;
/// results make use of it, as those in angles use `sin^2 + cos^2 = 1`, so they are those of the angle on the circle and
/// differ from them by the order of the distance to it elsewhere.
///
/// # Errors
/// Every place at which an angle occurs other than in the sine and cosine of whole multiples.
///
/// # Source
/// Action algebroid of the circle group on R^2: Cortes, de Leon, Marrero, Martinez 2009, section 2; Cendra, Marsden,
/// Ratiu 2001 for advected parameters.
pub fn with_circles(
    model: &Model,
    system: ReducedSystem,
    angles: &[String],
) -> Result<ReducedSystem, Diagnostics> {
    if angles.is_empty() {
        return Ok(system);
    }
    let is_cyclic = |c: &&Coordinate| system.momenta.iter().any(|m| m.cyclic == Some(c.symbol));
    let mut cyclic = model.base.iter().filter(is_cyclic).map(|c| &c.name);
    if let Some(name) = cyclic.find(|name| angles.contains(name)) {
        let message = format!("`{name}` is cyclic and no part of the state, so that no circle carries it");
        let span = model.places.declared.get(name).copied();
        return Err(model.diagnostics(vec![spec::diagnose(model, span, message, "leave it off the circle")]));
    }
    let mut system = system;
    let chosen = model.base.iter().filter(|c| angles.contains(&c.name));
    let turned: Vec<Turned> = chosen.map(|c| Turned::new(&mut system.graph, c)).collect();
    let mut problems: Vec<spec::Diagnostic> = Vec::new();
    let mut graph = std::mem::take(&mut system.graph);
    // Outputs may use the angle as a number, where it is a function of the point.
    let values: BTreeMap<SymbolId, ExprId> =
        turned.iter().filter_map(|t| Some((t.angle, t.value?))).collect();
    for (_, e) in system.outputs.iter_mut().flat_map(|o| &mut o.components) {
        let rewritten = on_circles(&mut graph, &turned, *e);
        if let Ok(value) = rewritten.and_then(|e| graph.subs(e, &values)) {
            *e = value;
        }
    }
    let names = Places::of(&system);
    let (_, expressions) = system.expressions_mut();
    // Algebroid and domains are made anew below.
    let is_rewritten = |(part, _): &(Part, &mut ExprId)| !matches!(part, Part::Algebroid | Part::Domain(_));
    for (part, place) in expressions.into_iter().filter(is_rewritten) {
        let rewritten = on_circles(&mut graph, &turned, *place).ok();
        let left = rewritten.map_or(turned.first(), |e| still_in(&graph, &turned, e));
        match (left, rewritten) {
            (None, Some(e)) => *place = e,
            (Some(angle), _) => {
                let name = &angle.circle.angle;
                let (what, span) = place_of(model, &names, part);
                let message = format!("{what} contains `{name}` other than in its sine and cosine");
                let help = format!(
                    "a point of the circle knows sin(k*{name}) and cos(k*{name}) for whole k; leave `{name}` an angle"
                );
                if !problems.iter().any(|p| p.message == message) {
                    problems.push(spec::diagnose(model, span, message, help));
                }
            }
            (None, None) => {}
        }
    }
    if let Err(exhausted) = graph.within_budget() {
        return Err(model.diagnostics(vec![model.diagnose(&exhausted.into())]));
    }
    let signs = std::mem::take(&mut system.signs);
    for (e, sign) in signs {
        // What is known about the angle as a number is of no use any more.
        let rewritten = on_circles(&mut graph, &turned, e).ok();
        let rewritten = rewritten.filter(|e| still_in(&graph, &turned, *e).is_none());
        system.signs.extend(rewritten.map(|e| (e, sign)));
    }
    let on_line: Vec<SymbolId> = turned.iter().map(|t| t.angle).collect();
    system.domains.retain(|condition| {
        graph.free_symbols(condition.positive).iter().all(|symbol| !on_line.contains(symbol))
    });
    system.domains.extend(turned.iter().flat_map(|t| domain_of(&mut graph, t)));
    system.graph = graph;
    if !problems.is_empty() {
        return Err(model.diagnostics(problems));
    }
    match anchored(&mut system, &turned) {
        Some(algebroid) => system.algebroid = algebroid,
        None => {
            let name = &turned[0].circle.angle;
            let message = format!("the connection contains `{name}` other than in its sine and cosine");
            let problem = spec::diagnose(model, model.places.connection, message, "leave it an angle");
            return Err(model.diagnostics(vec![problem]));
        }
    }
    system.outputs.extend(turned.iter().filter_map(|t| {
        let components = vec![(t.circle.angle.clone(), t.value?)];
        let (name, doc) = (t.circle.angle.clone(), t.doc.clone());
        Some(NamedVector { name, components, doc, part: OutputPart::Own })
    }));
    for position in &mut system.positions {
        let components = |symbol: &SymbolId| match turned.iter().find(|t| t.angle == *symbol) {
            Some(Turned { circle, .. }) => vec![circle.cosine, circle.sine],
            None => vec![*symbol],
        };
        position.determines = position.determines.iter().flat_map(components).collect();
    }
    system.circles = turned.into_iter().map(|t| t.circle).collect();
    Ok(system)
}

/// An angle and what replaces it.
struct Turned {
    angle: SymbolId,
    circle: Circle,
    /// `c`, `s`.
    point: [ExprId; 2],
    domain: Domain,
    /// The angle as a function of the point, where its domain has a continuous one.
    value: Option<ExprId>,
    doc: String,
}

impl Turned {
    fn new(g: &mut Graph, coordinate: &Coordinate) -> Turned {
        let theta = g.sym(coordinate.symbol);
        let names = circle_names(&coordinate.name);
        // Defined by the angle, so that zero tests see the circle through them.
        let [cosine, sine] = [(Func::Cos, &names[0]), (Func::Sin, &names[1])].map(|(f, name)| {
            let value = g.func(f, theta);
            g.define(name, value)
        });
        let point = [g.sym(cosine), g.sym(sine)];
        let value = angle_of(g, point, coordinate.domain);
        let circle = Circle { angle: coordinate.name.clone(), cosine, sine };
        let (angle, domain, doc) = (coordinate.symbol, coordinate.domain, coordinate.doc.clone());
        Turned { angle, circle, point, domain, value, doc }
    }
}

/// `theta = m + 2 atan(sin(theta - m) / (1 + cos(theta - m)))` for the quarter turn `m` next to the middle of the
/// domain, when that is no longer than half a turn: well away from `theta - m = pi`, where the quotient has no value.
fn angle_of(g: &mut Graph, [c, s]: [ExprId; 2], domain: Domain) -> Option<ExprId> {
    let Domain::Interval(low, high) = domain else { return None };
    let none = BTreeMap::new();
    let (low, high) = (g.eval_f64(low, &none)?, g.eval_f64(high, &none)?);
    if high - low > PI * (1.0 + f64::EPSILON) {
        return None;
    }
    let quarters = ((low + high) / 2.0 / FRAC_PI_2).round().to_i64()?;
    let (minus_c, minus_s) = (g.neg(c), g.neg(s));
    let (cosine, sine) = match quarters.rem_euclid(4) {
        0 => (c, s),
        1 => (s, minus_c),
        2 => (minus_c, minus_s),
        _ => (minus_s, c),
    };
    let one = g.one();
    let below = g.add(one, cosine);
    let tangent = g.div(sine, below).ok()?;
    let half = g.func(Func::Atan, tangent);
    let pi = g.pi();
    let middle = (pi, Rational::new(quarters.into(), 2.into()));
    Some(g.linear_combination(&[middle, (half, Rational::from_integer(2.into()))]))
}

/// The domain as conditions on the point, for known ends less than a turn apart: `sin(theta - low) > 0` and
/// `sin(high - theta) > 0` up to half a turn, `cos(theta - m) > cos(w)` with the middle `m` and half the length `w`
/// beyond.
fn domain_of(g: &mut Graph, turned: &Turned) -> Vec<DomainCondition> {
    let Domain::Interval(low, high) = turned.domain else { return Vec::new() };
    let (none, theta) = (BTreeMap::new(), g.sym(turned.angle));
    let length = g.sub(high, low);
    let Some(turn) = g.eval_f64(length, &none).filter(|length| *length < 2.0 * PI) else { return Vec::new() };
    let name = &turned.circle.angle;
    let [from, to] = [low, high].map(|end| spell_end(g, end));
    let both = format!("{from} < {name} < {to}");
    let above = g.sub(theta, low);
    let conditions = if (turn - PI).abs() <= PI * f64::EPSILON {
        vec![(both, g.func(Func::Sin, above))]
    } else if turn < PI {
        let below = g.sub(high, theta);
        let [above, below] = [above, below].map(|angle| g.func(Func::Sin, angle));
        vec![(format!("{name} > {from}"), above), (format!("{name} < {to}"), below)]
    } else {
        let half = Rational::new(1.into(), 2.into());
        let width = g.scale(length, &half);
        let apart = g.sub(above, width);
        let [inside, end] = [apart, width].map(|angle| g.func(Func::Cos, angle));
        vec![(both, g.sub(inside, end))]
    };
    let mut on_point = |(text, e)| {
        let positive = on_circles(g, from_ref(turned), e).ok()?;
        Some(DomainCondition { text, positive })
    };
    conditions.into_iter().filter_map(&mut on_point).collect()
}

/// `e` with sines and cosines of the angles as polynomials in the points.
fn on_circles(g: &mut Graph, turned: &[Turned], e: ExprId) -> Result<ExprId, DivisionByZero> {
    g.rebuild(e, |g, f, a| match f {
        Func::Sin | Func::Cos => {
            let [cosine, sine] = turn(g, turned, a);
            if f == Func::Cos { cosine } else { sine }
        }
        _ => g.func(f, a),
    })
}

/// Cosine and sine of `sum_i k_i theta_i + b` with whole `k_i`: the product of the points' powers with that of `b`.
fn turn(g: &mut Graph, turned: &[Turned], a: ExprId) -> [ExprId; 2] {
    let terms: Vec<(ExprId, Rational)> = match g.node(a).clone() {
        Node::Sum { constant, terms } => terms.iter().cloned().chain([(g.one(), constant)]).collect(),
        _ => {
            let (q, rest) = g.split_coefficient(a);
            vec![(rest, q)]
        }
    };
    let mut point = None;
    let mut rest = Vec::new();
    for (term, q) in terms {
        let own = turned.iter().find(|t| *g.node(term) == Node::Symbol(t.angle));
        let times = q.is_integer().then(|| q.abs().to_integer().to_u64()).flatten();
        match (own, times.filter(|n| *n <= MAX_MULTIPLE)) {
            (Some(t), Some(n)) => {
                let base = if q.is_negative() { [t.point[0], g.neg(t.point[1])] } else { t.point };
                for _ in 0..n {
                    point = Some(point.map_or(base, |z| times_point(g, z, base)));
                }
            }
            _ => rest.push((term, q)),
        }
    }
    let Some(point) = point else { return [g.func(Func::Cos, a), g.func(Func::Sin, a)] };
    let rest = g.linear_combination(&rest);
    let other = [g.func(Func::Cos, rest), g.func(Func::Sin, rest)];
    times_point(g, point, other)
}

/// `(c, s)(c', s') = (c c' - s s', s c' + c s')`.
fn times_point(g: &mut Graph, [c, s]: [ExprId; 2], [other_c, other_s]: [ExprId; 2]) -> [ExprId; 2] {
    let products = [(c, other_c), (s, other_s), (s, other_c), (c, other_s)].map(|(a, b)| g.mul(a, b));
    [g.sub(products[0], products[1]), g.add(products[2], products[3])]
}

/// The angle that an expression still contains as a number.
fn still_in<'a>(g: &Graph, turned: &'a [Turned], e: ExprId) -> Option<&'a Turned> {
    let free = g.free_symbols(e);
    turned.iter().find(|t| free.contains(&t.angle))
}

/// The algebroid over the base in which each angle has made way for its point, `rho(c) = -s rho(theta)`,
/// `rho(s) = c rho(theta)`, and the state with it.
fn anchored(system: &mut ReducedSystem, turned: &[Turned]) -> Option<Algebroid> {
    let g = &mut system.graph;
    let old = &system.algebroid;
    let mut base: Vec<SymbolId> = Vec::new();
    // Where each coordinate of the old base begins in the new one.
    let mut starts = Vec::new();
    for x in old.base() {
        starts.push(base.len());
        match turned.iter().find(|t| t.angle == *x) {
            Some(t) => base.extend([t.circle.cosine, t.circle.sine]),
            None => base.push(*x),
        }
    }
    let convert = |g: &mut Graph, e: ExprId| {
        let e = on_circles(g, turned, e).ok()?;
        still_in(g, turned, e).is_none().then_some(e)
    };
    let mut algebroid = Algebroid::new(g, system.time, base, old.frame().to_vec());
    algebroid.set_almost(old.is_almost());
    for alpha in 0..old.rank() {
        for (i, x) in old.base().iter().enumerate() {
            let rho = convert(g, old.anchor(i, alpha))?;
            match turned.iter().find(|t| t.angle == *x) {
                Some(t) => {
                    let along = g.mul(t.point[1], rho);
                    let along = g.neg(along);
                    algebroid.set_anchor(starts[i], alpha, along);
                    algebroid.set_anchor(starts[i] + 1, alpha, g.mul(t.point[0], rho));
                }
                None => algebroid.set_anchor(starts[i], alpha, rho),
            }
        }
        for beta in alpha + 1..old.rank() {
            let mut bracket = Vec::new();
            for (gamma, e) in old.bracket(g, alpha, beta) {
                bracket.push((gamma, convert(g, e)?));
            }
            if !bracket.is_empty() {
                algebroid.set_bracket(alpha, beta, bracket);
            }
        }
        let drift = old.drift(alpha).iter().map(|(gamma, e)| Some((*gamma, convert(g, *e)?)));
        let drift: Vec<(usize, ExprId)> = drift.collect::<Option<_>>()?;
        if !drift.is_empty() {
            algebroid.set_drift(alpha, drift);
        }
    }
    let mut noise_rates = Vec::new();
    for (x, rate) in &system.noise_rates {
        match turned.iter().find(|t| t.angle == *x) {
            Some(t) => {
                let along = g.mul(t.point[1], *rate);
                noise_rates.push((t.circle.cosine, g.neg(along)));
                noise_rates.push((t.circle.sine, g.mul(t.point[0], *rate)));
            }
            None => noise_rates.push((*x, *rate)),
        }
    }
    system.noise_rates = noise_rates;
    let mut state = Vec::new();
    for (kind, doc) in &system.state {
        match *kind {
            StateKind::Base(i) => match turned.iter().find(|t| t.angle == old.base()[i]) {
                Some(t) => state.extend(["cosine", "sine"].iter().enumerate().map(|(k, f)| {
                    (StateKind::Base(starts[i] + k), format!("{f} of `{}` [-]", t.circle.angle))
                })),
                None => state.push((StateKind::Base(starts[i]), doc.clone())),
            },
            StateKind::Unknown(_) | StateKind::Momentum { .. } => state.push((*kind, doc.clone())),
        }
    }
    system.state = state;
    Some(algebroid)
}

/// What to call a part of a system, and where the model says it.
fn place_of(model: &Model, system: &Places, part: Part) -> (String, Option<Span>) {
    let output_span = |name: &str| model.places.outputs.get(name).copied();
    let first = model.constraints.first().and_then(|c| c.span);
    match part {
        Part::Lagrangian => ("the lagrangian".into(), model.places.lagrangian),
        Part::Hamiltonian => ("the hamiltonian".into(), model.places.lagrangian),
        Part::Connection => ("the connection".into(), model.places.connection),
        Part::Acceleration(k) => {
            let name = &system.unknowns[k];
            (format!("the acceleration of `{name}`"), model.places.given.get(name).copied())
        }
        Part::Force(k) => (format!("the force on `{}`", system.frame[k]), None),
        Part::Constraint(k) => {
            let text = &system.constraints[k];
            let own = model.constraints.iter().find(|c| c.text == *text);
            (format!("constraint `{text}`"), own.and_then(|c| c.span))
        }
        Part::Position => ("an equation between coordinates".into(), first),
        Part::SolvedConstraint => ("the constraints".into(), first),
        Part::Degeneracy => ("the equations without accelerations".into(), model.places.lagrangian),
        Part::VirtualDisplacement => {
            let condition = model.virtual_constraints.first().and_then(|v| v.span);
            ("the virtual displacements".into(), condition.or(first))
        }
        Part::Casimir(k) => {
            let name = &system.casimirs[k];
            (format!("casimir `{name}`"), output_span(name))
        }
        Part::Output(k) => {
            let name = &system.outputs[k];
            (format!("output `{name}`"), output_span(name))
        }
        Part::Feedback => ("the rate of the Lyapunov function".into(), first),
        Part::Section(k) => {
            let name = &system.sections[k];
            (format!("section `{name}`"), output_span(name))
        }
        Part::Rate(k) => {
            let name = &system.rates[k];
            let item = model.reconstruction.iter().find(|r| r.names.contains(name));
            (format!("the rate of `{name}`"), item.and_then(|r| r.span))
        }
        Part::Condition => ("a condition on parameters".into(), None),
        Part::Algebroid => ("the algebroid".into(), None),
        Part::CarriedRate => ("the rate of an acceleration along a constraint".into(), first),
        Part::OwnRate => {
            ("the rate of a state".into(), model.first_order.iter().find_map(|state| state.of_rate))
        }
        Part::NoiseRate => ("the rate of a coordinate by noise".into(), None),
        Part::MomentumInSpace => ("the momentum in space".into(), None),
        Part::GroupEquation => ("what a matrix group keeps".into(), None),
        Part::Momentum => ("a momentum".into(), None),
        Part::Stages => ("the stage forms".into(), None),
        Part::Frame => ("the change of frame".into(), None),
        Part::Domain(_) => ("the domain of a coordinate".into(), None),
    }
}

/// Names of what the parts of a system belong to.
struct Places {
    frame: Vec<String>,
    unknowns: Vec<String>,
    constraints: Vec<String>,
    casimirs: Vec<String>,
    outputs: Vec<String>,
    sections: Vec<String>,
    rates: Vec<String>,
}

impl Places {
    fn of(system: &ReducedSystem) -> Places {
        Places {
            frame: system.algebroid.frame().to_vec(),
            unknowns: system.unknowns.iter().map(|u| u.name.clone()).collect(),
            constraints: system.constraint.texts().map(str::to_owned).collect(),
            casimirs: system.casimirs.iter().map(|c| c.name.clone()).collect(),
            outputs: system.outputs.iter().map(|o| o.name.clone()).collect(),
            sections: system.sections.iter().map(|s| s.name.clone()).collect(),
            rates: system.reconstruction.iter().map(|c| c.name.clone()).collect(),
        }
    }
}
