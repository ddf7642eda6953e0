//! Ideal fluids that are moved as products of matrices: recognised in the syntax tree, so that nothing is elaborated
//! whose size grows with `N`.
//!
//! A model is one where its momenta are in `zeitlin(N)` or `zeitlin_sphere(N)` of an `N` that has no table of structure
//! constants, or where a scene wants `matrices`. Its hamiltonian has to be the energy of the fluid and nothing else.
//!
//! Deliberately does not know: structure constants, equations of motion, how matrices are multiplied.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use num_traits::{One, ToPrimitive, Zero};

use super::ast::{AlgebraExpr, AlgebraNode, Expr, File, Item, ItemKind, Name, Node};
use super::diagnostic::{Diagnostic, Help, Span};
use super::limits::{MAX_DEPTH, MAX_MATRIX};
use super::names;
use super::want::Want;
use crate::algebra::LieAlgebra;
use hamel_expr::{Rational, rational_to_f64};

/// Largest power of a Casimir.
const MAX_POWER: usize = 16;

/// Most binary digits of numerator and denominator of a number, several times those of the longest that can be written:
/// definitions that square each other double them.
const MAX_BITS: u64 = 1 << 13;

/// Where a fluid flows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FluidSurface {
    /// The torus, `zeitlin(N)`.
    Torus,
    /// The sphere, `zeitlin_sphere(N)`.
    Sphere,
}

/// A coefficient of the vorticity that the model gives at time zero; all others begin with zero.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidMode {
    /// Its name, such as `re_1_m2` or `c_2_1`.
    pub name: String,
    /// The wave vector `(m1, m2)` of the half set, or degree and order `(l, m)`.
    pub wave: (i64, i64),
    /// Whether it is the imaginary part, or the coefficient of the sine.
    pub is_second: bool,
    /// Value at time zero.
    pub initial: Rational,
}

/// A Casimir `tr W^k/N`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FluidCasimir {
    /// Name.
    pub name: String,
    /// The power `k`, from 1 to 16.
    pub power: usize,
    /// Documentation.
    pub doc: String,
}

/// An ideal fluid that is moved as products of matrices: `omega' = [psi, omega]`, `-Delta psi = omega`.
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixFluid {
    /// Name of the model.
    pub name: String,
    /// Its documentation.
    pub doc: Vec<String>,
    /// Where it is from.
    pub sources: Vec<String>,
    /// What a list shows it under.
    pub topic: Option<String>,
    /// Where it flows.
    pub surface: FluidSurface,
    /// Size of the matrices.
    pub n: usize,
    /// Documentation of the vorticity.
    pub vorticity: String,
    /// The modes with an initial value, in the order of the text.
    pub modes: Vec<FluidMode>,
    /// The Casimirs of the model.
    pub casimirs: Vec<FluidCasimir>,
}

impl MatrixFluid {
    /// Largest power of a Casimir, zero where there is none.
    pub fn n_casimirs(&self) -> usize {
        self.casimirs.iter().map(|c| c.power).max().unwrap_or(0)
    }
}

/// The momenta of a fluid in an algebra of functions.
#[derive(Clone, Copy)]
struct Momenta<'a> {
    item: &'a Item,
    names: &'a [Name],
    labels: &'a [Name],
    surface: FluidSurface,
    n: usize,
    /// The name of the algebra, where it has one.
    algebra: Option<&'a str>,
}

/// Surface and size of an algebra of functions on a surface.
fn surface_of(expr: &AlgebraExpr) -> Option<(FluidSurface, usize)> {
    let AlgebraNode::Call(family, arguments) = &expr.node else { return None };
    let surface = match family.text.as_str() {
        "zeitlin" => FluidSurface::Torus,
        "zeitlin_sphere" => FluidSurface::Sphere,
        _ => return None,
    };
    match arguments.as_slice() {
        [AlgebraExpr { node: AlgebraNode::Number(n), .. }] => Some((surface, *n)),
        _ => None,
    }
}

fn momenta(file: &File) -> Option<Momenta<'_>> {
    file.items.iter().find_map(|item| {
        let ItemKind::MomentumIn { names, algebra, labels } = &item.kind else { return None };
        let named = match &algebra.node {
            AlgebraNode::Name(name) => file.items.iter().find_map(|other| match &other.kind {
                ItemKind::AlgebraName { name: own, value } if own.text == *name => {
                    Some((value, Some(own.text.as_str())))
                }
                _ => None,
            }),
            _ => Some((algebra, None)),
        };
        let (value, algebra) = named?;
        let (surface, n) = surface_of(value)?;
        Some(Momenta { item, names, labels, surface, n, algebra })
    })
}

/// Where a scene wants matrices.
fn wanted(file: &File) -> Option<Span> {
    file.items.iter().find_map(|item| match &item.kind {
        ItemKind::Scene { wants, .. } => {
            wants.iter().find(|want| want.text == Want::Matrices.name()).map(|want| want.span)
        }
        _ => None,
    })
}

/// Whether matrices of that size exist.
fn exists(surface: FluidSurface, n: usize) -> bool {
    match surface {
        FluidSurface::Torus => (3..=MAX_MATRIX).contains(&n) && !n.is_multiple_of(2),
        FluidSurface::Sphere => (2..=MAX_MATRIX).contains(&n),
    }
}

/// Where it stands that a model is moved as products of matrices; none for one with equations.
pub(super) fn requested(file: &File) -> Option<Span> {
    let has_table = |m: &Momenta<'_>| match m.surface {
        FluidSurface::Torus => LieAlgebra::TORUS_SIZES.contains(&m.n),
        FluidSurface::Sphere => m.n <= LieAlgebra::MAX_SPHERE,
    };
    wanted(file).or_else(|| {
        let momenta = momenta(file)?;
        (exists(momenta.surface, momenta.n) && !has_table(&momenta)).then_some(momenta.item.span)
    })
}

/// Sizes for which matrices exist.
fn sizes(surface: FluidSurface) -> String {
    match surface {
        FluidSurface::Torus => format!("odd numbers from 3 to {}", MAX_MATRIX - 1),
        FluidSurface::Sphere => format!("numbers from 2 to {MAX_MATRIX}"),
    }
}

/// The energy of a fluid as a model has it; an algebra without a name is that of the velocities.
fn energy_text(surface: FluidSurface, algebra: &str, omega: &str) -> String {
    let factor = match surface {
        FluidSurface::Torus => "-",
        FluidSurface::Sphere => "-1/2*",
    };
    format!("{factor}dot({omega}, laplacian({algebra})^-1*{omega})")
}

/// What to write where an algebra has no table of structure constants; `possible` are those with one.
pub(super) fn instead_of_a_table(surface: FluidSurface, possible: &str) -> String {
    format!(
        "tables: {possible}; other sizes, {}, are moved as products of matrices, which ideal fluids alone are: \
         `algebra fluid = ..; momentum omega in fluid as *; action right; hamiltonian = {}; scene default {{ want matrices; }}`",
        sizes(surface),
        energy_text(surface, "fluid", "omega")
    )
}

/// That a model is moved as products of matrices, for those who want its equations.
pub(super) fn refusal(span: Span) -> Diagnostic {
    Diagnostic::new(Some(span), "this fluid is moved as products of matrices and has no equations in components")
        .with_help(
            "`hamel simulate`, `hamel report` and `hamel generate` take it; equations have zeitlin(N) up to 21 and \
             zeitlin_sphere(N) up to 12, without `want matrices`",
        )
}

/// Reads a fluid.
///
/// # Errors
/// Everything in the model that is no part of such a fluid.
pub(super) fn read(file: &File) -> Result<MatrixFluid, Vec<Diagnostic>> {
    let Some(momenta) = momenta(file) else {
        let message = "`matrices` move ideal fluids alone";
        let help = "momenta have to be in zeitlin(N) or zeitlin_sphere(N): `momentum omega in fluid as *;`";
        return Err(vec![Diagnostic::new(wanted(file).or(Some(file.name.span)), message).with_help(help)]);
    };
    let lets = file.items.iter().filter_map(|item| match &item.kind {
        ItemKind::Let { name, value } => Some((name.text.as_str(), value)),
        _ => None,
    });
    let (lets, known) = (lets.collect(), RefCell::default());
    let mut reader = Reader { momenta, lets, known, problems: Vec::new() };
    let fluid = reader.fluid(file);
    if reader.problems.is_empty() { Ok(fluid) } else { Err(reader.problems) }
}

struct Reader<'a> {
    momenta: Momenta<'a>,
    lets: BTreeMap<&'a str, &'a Expr>,
    /// What definitions are; none also while one is being looked at, which is a definition of itself then.
    known: RefCell<BTreeMap<&'a str, Option<Form>>>,
    problems: Vec<Diagnostic>,
}

impl<'a> Reader<'a> {
    fn problem(&mut self, span: Span, message: impl Into<String>, help: impl Into<Help>) {
        self.problems.push(Diagnostic::new(Some(span), message).with_help(help));
    }

    fn fluid(&mut self, file: &'a File) -> MatrixFluid {
        let Momenta { surface, n, item, names, labels, .. } = self.momenta;
        let mut fluid = MatrixFluid {
            name: file.name.text.clone(),
            doc: file.doc.clone(),
            sources: Vec::new(),
            topic: None,
            surface,
            n,
            vorticity: item.doc.join("\n"),
            modes: Vec::new(),
            casimirs: Vec::new(),
        };
        if let Some(reason) = names::refusal(&file.name.text) {
            self.problem(file.name.span, format!("`{}` cannot be used as a name", file.name.text), reason);
        }
        if !exists(surface, n) {
            let help = format!("possible: {}", sizes(surface));
            self.problem(item.span, format!("there are no such matrices of size {n}"), help);
        }
        if names.len() != 1 || labels.len() != 1 {
            let help = "write `momentum omega in fluid as *;`";
            self.problem(item.span, "the vorticity is one vector, named after the basis", help);
        }
        let (mut has_topic, mut acts_right, mut has_energy, mut has_scene) = (false, false, false, false);
        let mut taken = BTreeSet::new();
        names.iter().for_each(|name| self.name(name, &mut taken));
        for item in &file.items {
            match &item.kind {
                ItemKind::Source(text) => fluid.sources.push(text.clone()),
                ItemKind::Topic(text) => {
                    self.once(&mut has_topic, "topic", item.span);
                    fluid.topic = Some(text.clone());
                }
                ItemKind::Let { name, .. } => self.name(name, &mut taken),
                ItemKind::AlgebraName { name, .. } if Some(name.text.as_str()) == self.momenta.algebra => {
                    self.name(name, &mut taken);
                }
                ItemKind::MomentumIn { .. } if std::ptr::eq(item, self.momenta.item) => {}
                ItemKind::Action(side) if side.text == "right" => {
                    self.once(&mut acts_right, "action", item.span);
                }
                ItemKind::Hamiltonian(value) => {
                    self.once(&mut has_energy, "hamiltonian", item.span);
                    self.energy(value);
                }
                ItemKind::Casimir { name, value } => {
                    self.name(name, &mut taken);
                    if let Some(power) = self.casimir(value) {
                        let doc = item.doc.join("\n");
                        fluid.casimirs.push(FluidCasimir { name: name.text.clone(), power, doc });
                    }
                }
                ItemKind::Initial { name, value } => {
                    self.name(name, &mut taken);
                    fluid.modes.extend(self.mode(name, value));
                }
                ItemKind::Scene {
                    name,
                    fixed,
                    inputs,
                    wants,
                    drops,
                    circles,
                    formulation,
                    carries,
                    discrete,
                    retraction,
                } => {
                    let is_plain = fixed.is_empty()
                        && inputs.is_empty()
                        && drops.is_empty()
                        && circles.is_empty()
                        && formulation.is_empty()
                        && carries.is_empty()
                        && discrete.is_empty()
                        && retraction.is_empty();
                    if name.text != "default" || !is_plain {
                        let help = "write `scene default { want matrices, energy, casimirs; }`";
                        self.problem(
                            name.span,
                            "a fluid of matrices has the scene `default`, which only wants",
                            help,
                        );
                    }
                    self.once(&mut has_scene, "scene", name.span);
                    self.wants(wants, &file.items);
                }
                _ => {
                    let help = "keep the algebra, its momentum, `action right;`, the energy as hamiltonian, casimirs by \
                                `trace_power`, `initial` modes and `scene default`; everything else needs equations, \
                                which zeitlin(N) up to 21 and zeitlin_sphere(N) up to 12 have";
                    self.problem(
                        item.span,
                        "this is no part of a fluid that is moved as products of matrices",
                        help,
                    );
                }
            }
        }
        if !acts_right {
            self.problem(self.momenta.item.span, "fluids act from the right", "add `action right;`");
        }
        if !has_energy {
            let help = format!("add `hamiltonian = {};`", self.energy_text());
            self.problem(self.momenta.item.span, "the energy of the fluid is missing", help);
        }
        if fluid.modes.is_empty() {
            let name = match surface {
                FluidSurface::Torus => "re_1_0",
                FluidSurface::Sphere => "c_2_1",
            };
            let help = format!("give modes, which are then shown: `initial {name} = 0.5;`");
            self.problem(self.momenta.item.span, "the fluid is at rest", help);
        }
        fluid
    }

    /// An item of which a fluid has one.
    fn once(&mut self, is_known: &mut bool, what: &str, span: Span) {
        if std::mem::replace(is_known, true) {
            self.problem(span, format!("`{what}` is given twice"), "keep one of them");
        }
    }

    /// A name that nothing else has.
    fn name(&mut self, name: &Name, taken: &mut BTreeSet<String>) {
        if let Some(reason) = names::refusal(&name.text) {
            self.problem(name.span, format!("`{}` cannot be used as a name", name.text), reason);
        }
        if !taken.insert(name.text.clone()) {
            self.problem(name.span, format!("`{}` is given twice", name.text), "keep one of them");
        }
    }

    /// Names that a scene wants: something of the fluid.
    fn wants(&mut self, wants: &[Name], items: &[Item]) {
        let known = [Want::Matrices, Want::Rhs, Want::Energy, Want::Casimirs].map(Want::name);
        for want in wants {
            let is_casimir =
                |item: &Item| matches!(&item.kind, ItemKind::Casimir { name, .. } if name.text == want.text);
            if !known.contains(&want.text.as_str()) && !items.iter().any(is_casimir) {
                let message = format!("a fluid of matrices has no `{}`", want.text);
                self.problem(
                    want.span,
                    message,
                    format!("legal here: {}, and casimirs", names::list(&known)),
                );
            }
        }
    }

    fn energy_text(&self) -> String {
        energy_text(self.momenta.surface, self.momenta.algebra.unwrap_or(""), self.vorticity())
    }

    /// The name of the vorticity.
    fn vorticity(&self) -> &'a str {
        self.momenta.names.first().map_or("omega", |name| name.text.as_str())
    }

    fn energy(&mut self, value: &Expr) {
        let expected = match self.momenta.surface {
            FluidSurface::Torus => -Rational::one(),
            FluidSurface::Sphere => Rational::new((-1).into(), 2.into()),
        };
        if self.form(value, 0) != Some(Form::new(Kind::Energy, expected)) {
            let help = format!("write `hamiltonian = {};`; others need equations", self.energy_text());
            self.problem(value.span, "this is not the energy of the fluid, which matrices move by", help);
        }
    }

    /// The power `k` of `trace_power([g,] omega, k)`.
    fn casimir(&mut self, value: &Expr) -> Option<usize> {
        let power = self.power_of_trace(value);
        if power.is_none() {
            let algebra = self.momenta.algebra.map_or(String::new(), |name| format!("{name}, "));
            let omega = self.vorticity();
            let help =
                format!("write `trace_power({algebra}{omega}, k)` with a number k from 1 to {MAX_POWER}");
            self.problem(value.span, "casimirs of a fluid of matrices are traces of its powers", help);
        }
        power
    }

    fn power_of_trace(&self, value: &Expr) -> Option<usize> {
        let Node::Call(function, arguments) = &value.node else { return None };
        let (vorticity, power) = match (function.text.as_str(), arguments.as_slice()) {
            ("trace_power", [vorticity, power]) => (vorticity, power),
            ("trace_power", [algebra, vorticity, power]) if self.is_algebra(algebra) => (vorticity, power),
            _ => return None,
        };
        let Form { kind: Kind::Number, factor } = self.form(power, 0)? else { return None };
        let power = factor.is_integer().then(|| factor.numer().to_usize())??;
        let is_whole = self.form(vorticity, 0)? == Form::new(Kind::Vorticity, Rational::one());
        (is_whole && (1..=MAX_POWER).contains(&power)).then_some(power)
    }

    fn is_algebra(&self, expr: &Expr) -> bool {
        matches!(&expr.node, Node::Name(name) if Some(name.as_str()) == self.momenta.algebra)
    }

    /// What an expression is; none for what is no part of the energy of a fluid.
    fn form(&self, expr: &Expr, depth: usize) -> Option<Form> {
        // Definitions may be of each other; the depth of the text is bounded by the parser.
        if depth > MAX_DEPTH {
            return None;
        }
        let form = |expr: &Expr| self.form(expr, depth + 1);
        match &expr.node {
            Node::Number(q) => Some(Form::new(Kind::Number, q.clone())),
            Node::Name(name) if self.momenta.names.first().is_some_and(|own| own.text == *name) => {
                Some(Form::new(Kind::Vorticity, Rational::one()))
            }
            Node::Name(name) => self.form_of_let(name, depth + 1),
            Node::Neg(inside) => form(inside).map(|f| f.times(-Rational::one())),
            Node::Sum(list) => {
                let mut sum: Option<Form> = None;
                for (is_negative, summand) in list {
                    let sign = if *is_negative { -Rational::one() } else { Rational::one() };
                    let next = form(summand)?.times(sign);
                    sum = match sum {
                        None => Some(next),
                        Some(sum) if sum.kind == next.kind => {
                            Some(Form::new(sum.kind, sum.factor + next.factor).of_bounded_length()?)
                        }
                        Some(_) => return None,
                    };
                }
                sum
            }
            Node::Product(list) => {
                let mut product = Form::new(Kind::Number, Rational::one());
                for (divides, factor) in list {
                    let next = form(factor)?;
                    product = match (product.kind, next.kind) {
                        (_, Kind::Number) if *divides => {
                            if next.factor.is_zero() {
                                return None;
                            }
                            product.times(next.factor.recip())
                        }
                        _ if *divides => return None,
                        (Kind::Number, _) => next.times(product.factor),
                        (_, Kind::Number) => product.times(next.factor),
                        (Kind::Inverse, Kind::Vorticity) => {
                            Form::new(Kind::Stream, product.factor * next.factor)
                        }
                        _ => return None,
                    };
                    product = product.of_bounded_length()?;
                }
                Some(product)
            }
            Node::Power(base, exponent) => {
                let (base, exponent) = (form(base)?, form(exponent)?);
                let kind = match base.kind {
                    Kind::Laplacian => Kind::Inverse,
                    Kind::Inverse => Kind::Laplacian,
                    Kind::Number => Kind::Number,
                    _ => return None,
                };
                let is_inverse = exponent == Form::new(Kind::Number, -Rational::one());
                (is_inverse && !base.factor.is_zero()).then(|| Form::new(kind, base.factor.recip()))
            }
            Node::Call(function, arguments) => match (function.text.as_str(), arguments.as_slice()) {
                ("laplacian", []) => Some(Form::new(Kind::Laplacian, Rational::one())),
                ("laplacian", [algebra]) if self.is_algebra(algebra) => {
                    Some(Form::new(Kind::Laplacian, Rational::one()))
                }
                ("dot", [a, b]) => {
                    let (a, b) = (form(a)?, form(b)?);
                    let is_energy = matches!(
                        (a.kind, b.kind),
                        (Kind::Vorticity, Kind::Stream) | (Kind::Stream, Kind::Vorticity)
                    );
                    is_energy.then(|| Form::new(Kind::Energy, a.factor * b.factor))
                }
                _ => None,
            },
            Node::Index(..) | Node::List(_) => None,
        }
    }

    /// What a definition is, looked at once however often it is used.
    fn form_of_let(&self, name: &str, depth: usize) -> Option<Form> {
        if let Some(known) = self.known.borrow().get(name) {
            return known.clone();
        }
        let (name, value) = self.lets.get_key_value(name).map(|(name, value)| (*name, *value))?;
        self.known.borrow_mut().insert(name, None);
        let form = self.form(value, depth);
        self.known.borrow_mut().insert(name, form.clone());
        form
    }

    /// The mode of a name with its value at time zero.
    fn mode(&mut self, name: &Name, value: &Expr) -> Option<FluidMode> {
        let prefix = self.momenta.labels.first().map_or("", |label| label.text.as_str());
        let Some((wave, is_second)) = name.text.strip_prefix(prefix).and_then(|label| self.wave(label))
        else {
            let (example, n) = (prefix, self.momenta.n);
            let help = match self.momenta.surface {
                FluidSurface::Torus => {
                    let largest = n / 2;
                    format!(
                        "`{example}re_1_m2` is the real part of the wave (1, -2); waves have m1 > 0, or m1 = 0 and m2 > 0, and \
                         numbers up to {largest}"
                    )
                }
                FluidSurface::Sphere => format!(
                    "`{example}c_2_1` and `{example}s_2_1` have the degree 2 and the order 1; degrees go from 1 to {}",
                    n - 1
                ),
            };
            self.problem(name.span, format!("`{}` is no mode of the vorticity", name.text), help);
            return None;
        };
        let Some(Form { kind: Kind::Number, factor: initial }) = self.form(value, 0) else {
            let help = "write a rational number, in decimals such as `0.785398`";
            self.problem(value.span, "an initial value of a fluid of matrices is a number", help);
            return None;
        };
        if !rational_to_f64(&initial).is_finite() {
            self.problem(value.span, "the initial value does not fit a double", "give one below 1.7e308");
            return None;
        }
        Some(FluidMode { name: name.text.clone(), wave, is_second, initial })
    }

    /// The wave, or degree and order, of a label.
    fn wave(&self, label: &str) -> Option<((i64, i64), bool)> {
        let n = i64::try_from(self.momenta.n).ok()?;
        let mut parts = label.split('_');
        let (part, a, b) = (parts.next()?, parts.next()?, parts.next()?);
        // Numbers as they are written by the algebra, so that each mode has one name.
        let number = |text: &str| {
            let (sign, digits) = text.strip_prefix('m').map_or((1, text), |rest| (-1, rest));
            let number = sign * i64::from(digits.parse::<u32>().ok()?);
            (digits == number.abs().to_string() && (sign > 0 || number != 0)).then_some(number)
        };
        let wave = (number(a)?, number(b)?);
        if parts.next().is_some() {
            return None;
        }
        let (is_second, is_mode) = match (self.momenta.surface, part) {
            (FluidSurface::Torus, "re" | "im") => {
                let is_small = wave.0.max(wave.1.abs()) <= n / 2;
                (part == "im", wave > (0, 0) && wave.0 >= 0 && is_small)
            }
            (FluidSurface::Sphere, "c") => {
                (false, (0..=wave.0).contains(&wave.1) && (1..n).contains(&wave.0))
            }
            (FluidSurface::Sphere, "s") => (true, (1..=wave.0).contains(&wave.1) && (1..n).contains(&wave.0)),
            _ => return None,
        };
        is_mode.then_some((wave, is_second))
    }
}

/// What parts of the energy of a fluid are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Number,
    Laplacian,
    /// The inverse Laplacian.
    Inverse,
    Vorticity,
    /// The inverse Laplacian of the vorticity.
    Stream,
    /// `dot(omega, laplacian^-1*omega)`.
    Energy,
}

/// A multiple of such a part.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Form {
    kind: Kind,
    factor: Rational,
}

impl Form {
    fn new(kind: Kind, factor: Rational) -> Form {
        Form { kind, factor }
    }

    fn times(self, factor: Rational) -> Form {
        Form { factor: self.factor * factor, ..self }
    }

    /// The same, unless its factor has too many digits.
    fn of_bounded_length(self) -> Option<Form> {
        let n_bits = self.factor.numer().bits().max(self.factor.denom().bits());
        (n_bits <= MAX_BITS).then_some(self)
    }
}
