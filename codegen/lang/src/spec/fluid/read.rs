//! The items of a fluid that is moved as products of matrices.
//!
//! Does not know: what expressions are made of.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use num_traits::{One, Signed, Zero};

use super::super::ast::{Compare, Comparison, Expr, File, Item, ItemKind, Name, Node, Shape};
use super::super::diagnostic::{Diagnostic, Help, Origin, Span};
use super::super::names;
use super::super::want::Want;
use super::form::{Form, Function, MAX_POWER, Names, Polynomial};
use super::found::{Momenta, carried, energy_text, exists, momenta, sizes, wanted};
use super::model::{
    CarriedField, FluidCasimir, FluidField, FluidMode, FluidParam, FluidTerm, FluidTrace, MAX_CARRIED,
    MAX_FRICTION, MatrixFluid,
};
use super::waves::{FluidSurface, FluidWave};
use hamel_expr::{Rational, rational_to_f64};

/// Reads a fluid, with other values of its parameters.
///
/// # Errors
/// Everything in the model that is no part of such a fluid.
pub(super) fn read(
    file: &File,
    origin: &Origin,
    values: &BTreeMap<String, Rational>,
) -> Result<MatrixFluid, Vec<Diagnostic>> {
    let Some(momenta) = momenta(file) else {
        let message = "`matrices` move fluids alone";
        let help = "momenta have to be in zeitlin(N) or zeitlin_sphere(N): `momentum omega in fluid as *;`";
        return Err(vec![Diagnostic::new(wanted(file).or(Some(file.name.span)), message).with_help(help)]);
    };
    let lets = file.items.iter().filter_map(|item| match &item.kind {
        ItemKind::Let { name, value } => Some((name.text.as_str(), value)),
        _ => None,
    });
    let names = Names {
        momenta,
        carried: carried(file, &momenta),
        lets: lets.collect(),
        params: BTreeMap::new(),
        known: RefCell::default(),
    };
    let mut reader = Reader { names, origin, taken: BTreeSet::new(), problems: Vec::new() };
    let fluid = reader.fluid(file, values);
    if reader.problems.is_empty() { Ok(fluid) } else { Err(reader.problems) }
}

struct Reader<'a> {
    names: Names<'a>,
    origin: &'a Origin,
    taken: BTreeSet<String>,
    problems: Vec<Diagnostic>,
}

/// Items of which a fluid has one, as far as they were met.
#[derive(Default)]
struct Met<'a> {
    topic: bool,
    action: bool,
    hamiltonian: bool,
    scene: bool,
    /// A force on the vorticity as a whole.
    force: bool,
    /// Forces on components.
    forced: BTreeSet<FluidWave>,
    /// Traces that are claimed to be conserved.
    casimirs: Vec<(&'a Name, FluidTrace)>,
}

impl<'a> Reader<'a> {
    fn problem(&mut self, span: Span, message: impl Into<String>, help: impl Into<Help>) {
        self.problems.push(Diagnostic::new(Some(span), message).with_help(help));
    }

    fn fluid(&mut self, file: &'a File, values: &BTreeMap<String, Rational>) -> MatrixFluid {
        let Momenta { surface, n, item, names, labels, .. } = self.names.momenta;
        let mut fluid = MatrixFluid {
            name: file.name.text.clone(),
            doc: file.doc.clone(),
            sources: Vec::new(),
            topic: None,
            surface,
            n,
            vorticity: item.doc.join("\n"),
            params: Vec::new(),
            scale: Rational::one(),
            shift: Rational::zero(),
            background: Vec::new(),
            carried: Vec::new(),
            friction: Vec::new(),
            force: Vec::new(),
            modes: Vec::new(),
            casimirs: Vec::new(),
            origin: self.origin.clone(),
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
        names.iter().for_each(|name| self.name(name));
        self.carried(&mut fluid);
        // Parameters first: everything else is made of them.
        for item in &file.items {
            if let ItemKind::Param { name, shape, default, .. } = &item.kind {
                self.own_name(name);
                let doc = item.doc.join("\n");
                fluid.params.extend(self.param(name, doc, shape, default.as_ref(), values));
                // A definition may be made of this parameter.
                self.names.known.borrow_mut().clear();
            }
        }
        let mut met = Met::default();
        file.items.iter().for_each(|item| self.item(item, file, &mut met, &mut fluid));
        self.missing(&met, &fluid);
        fluid
    }

    fn item(&mut self, item: &'a Item, file: &'a File, met: &mut Met<'a>, fluid: &mut MatrixFluid) {
        match &item.kind {
            ItemKind::Source(text) => fluid.sources.push(text.clone()),
            ItemKind::Topic(text) => {
                self.once(&mut met.topic, "topic", item.span);
                fluid.topic = Some(text.clone());
            }
            ItemKind::Param { conditions, .. } | ItemKind::Require(conditions) => self.conditions(conditions),
            ItemKind::Let { name, .. } => self.own_name(name),
            ItemKind::AlgebraName { name, .. } if Some(name.text.as_str()) == self.names.momenta.algebra => {
                self.name(name);
            }
            ItemKind::MomentumIn { .. } if std::ptr::eq(item, self.names.momenta.item) => {}
            ItemKind::Advected { name, .. } => {
                if self.names.carried.iter().all(|field| !std::ptr::eq(field.item, item)) {
                    let help = format!(
                        "fields of a fluid of matrices are functions in its algebra: `advected {0} in {1} as {0}_* by ad;`",
                        name.text,
                        self.names.momenta.algebra.unwrap_or("fluid"),
                    );
                    self.problem(item.span, format!("matrices do not carry `{}`", name.text), help);
                }
            }
            ItemKind::Action(side) if side.text == "right" => {
                self.once(&mut met.action, "action", item.span);
            }
            ItemKind::Hamiltonian(value) => {
                self.once(&mut met.hamiltonian, "hamiltonian", item.span);
                self.energy(value, fluid);
            }
            ItemKind::Force { name, value } => self.force(name, value, met, fluid),
            ItemKind::AppliedForce { is_place: false, on, value } => {
                match &on.node {
                    Node::Name(name) => match self.component_of_velocity(name) {
                        Some(wave) => self.constant_force(wave, value, fluid),
                        None => self.not_forced(on.span),
                    },
                    _ => self.not_forced(on.span),
                };
            }
            ItemKind::Casimir { name, value } | ItemKind::Output { name, value } => {
                self.own_name(name);
                let found = self.casimir(value);
                if matches!(item.kind, ItemKind::Casimir { .. }) {
                    let trace = found.as_ref().map(|(trace, _)| trace.clone());
                    met.casimirs.push((name, trace.unwrap_or(FluidTrace::Power(FluidField::Vorticity, 1))));
                }
                if let Some((trace, factor)) = found {
                    let doc = item.doc.join("\n");
                    fluid.casimirs.push(FluidCasimir { name: name.text.clone(), trace, factor, doc });
                }
            }
            ItemKind::Initial { name, value } => {
                self.name(name);
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
                    let message = "a fluid of matrices has the scene `default`, which only wants";
                    self.problem(name.span, message, help);
                }
                self.once(&mut met.scene, "scene", name.span);
                self.wants(wants, &file.items);
            }
            _ => {
                let help = "keep the algebra, its momentum, `action right;`, functions that are advected by `ad`, the \
                            energy as hamiltonian, forces on the vorticity, parameters, casimirs and outputs by \
                            `trace_power`, `initial` modes and `scene default`; everything else needs equations, which \
                            zeitlin(N) up to 21 and zeitlin_sphere(N) up to 12 have";
                let message = "this is no part of a fluid that is moved as products of matrices";
                self.problem(item.span, message, help);
            }
        }
    }

    /// Tells of items that a fluid has to have, and of claims that do not hold.
    fn missing(&mut self, met: &Met<'_>, fluid: &MatrixFluid) {
        let span = self.names.momenta.item.span;
        if !met.action {
            self.problem(span, "fluids act from the right", "add `action right;`");
        }
        if !met.hamiltonian {
            let help = format!("add `hamiltonian = {};`", self.energy_text());
            self.problem(span, "the energy of the fluid is missing", help);
        }
        for (casimir, trace) in &met.casimirs {
            if let Some(reason) = changed_by(trace, fluid) {
                let message = format!("casimir {} is not conserved: {reason} change it", casimir.text);
                let help = format!("write `output {} = ..;` instead", casimir.text);
                self.problem(casimir.span, message, help);
            }
        }
        if fluid.modes.is_empty() {
            let name = match fluid.surface {
                FluidSurface::Torus => "re_1_0",
                FluidSurface::Sphere => "c_2_1",
            };
            let help = format!("give modes, which are then shown: `initial {name} = 0.5;`");
            self.problem(span, "the fluid is at rest", help);
        }
    }

    /// The fields that the flow carries, without their energy.
    fn carried(&mut self, fluid: &mut MatrixFluid) {
        let fields = self.names.carried.clone();
        let mut prefixes = BTreeSet::from([self.names.prefix()]);
        for (k, field) in fields.iter().enumerate() {
            let name = field.name;
            self.name(name);
            let help = format!("write `advected {0} in .. as {0}_* by ad;`", name.text);
            match field.label {
                None => {
                    let message = format!("components of `{}` are named after the basis", name.text);
                    self.problem(name.span, message, help);
                }
                Some(label) if !prefixes.insert(&label.text) => {
                    let message = format!("components of `{}` have the names of others", name.text);
                    self.problem(label.span, message, help);
                }
                Some(_) => {}
            }
            if k == MAX_CARRIED {
                let message = format!("{} fields are carried", fields.len());
                self.problem(name.span, message, format!("fluids of matrices carry {MAX_CARRIED} at most"));
            }
            let (name, doc) = (name.text.clone(), field.item.doc.join("\n"));
            fluid.carried.push(CarriedField { name, doc, current: Vec::new(), constant: Vec::new() });
        }
    }

    /// An item of which a fluid has one.
    fn once(&mut self, is_known: &mut bool, what: &str, span: Span) {
        if std::mem::replace(is_known, true) {
            self.problem(span, format!("`{what}` is given twice"), "keep one of them");
        }
    }

    /// A name that nothing else has.
    fn name(&mut self, name: &Name) {
        if let Some(reason) = names::refusal(&name.text) {
            self.problem(name.span, format!("`{}` cannot be used as a name", name.text), reason);
        }
        if !self.taken.insert(name.text.clone()) {
            self.problem(name.span, format!("`{}` is given twice", name.text), "keep one of them");
        }
    }

    /// The name of something else than a component of a field.
    fn own_name(&mut self, name: &Name) {
        if let Some((field, _)) = self.names.component(&name.text) {
            let prefix = match field {
                FluidField::Vorticity => self.names.prefix(),
                FluidField::Carried(k) => self.names.carried[k].label.map_or("", |label| label.text.as_str()),
            };
            let help = format!("components are `{prefix}` and names of the basis");
            self.problem(name.span, format!("`{}` is a component of {}", name.text, self.shown(field)), help);
        }
        self.name(name);
    }

    /// A parameter, which is a number.
    fn param(
        &mut self,
        name: &'a Name,
        doc: String,
        shape: &Shape,
        default: Option<&Expr>,
        values: &BTreeMap<String, Rational>,
    ) -> Option<FluidParam> {
        let Shape::Scalar = shape else {
            let help = "write one parameter for each number";
            self.problem(name.span, "parameters of a fluid of matrices are numbers", help);
            return None;
        };
        let Some(default) = default else {
            let help = format!("write `param {} = 1;`", name.text);
            self.problem(name.span, format!("parameter `{}` has no value", name.text), help);
            return None;
        };
        let Some(default) = self.number(default) else {
            let help = "write a rational number, in decimals such as `0.785398`";
            self.problem(default.span, "a parameter of a fluid of matrices is a number", help);
            return None;
        };
        let value = values.get(&name.text).cloned().unwrap_or(default);
        self.names.params.insert(&name.text, value.clone());
        Some(FluidParam { name: name.text.clone(), doc, value })
    }

    /// A number that fits a double.
    fn number(&self, value: &Expr) -> Option<Rational> {
        match self.names.form(value)? {
            Form::Number(q) if rational_to_f64(&q).is_finite() => Some(q),
            _ => None,
        }
    }

    /// Conditions on parameters, which their values have to meet.
    fn conditions(&mut self, conditions: &[Comparison]) {
        for condition in conditions {
            let last = condition.rest.last().map_or(&condition.first, |(_, side)| side);
            let text = &self.origin.text[condition.first.span.start..last.span.end];
            let span = Span { start: condition.first.span.start, end: last.span.end };
            let sides = std::iter::once(&condition.first).chain(condition.rest.iter().map(|(_, side)| side));
            let sides: Option<Vec<Rational>> = sides.map(|side| self.number(side)).collect();
            let Some(sides) = sides else {
                let help = "conditions of a fluid of matrices compare numbers made of parameters";
                self.problem(span, format!("condition `{text}` has no value"), help);
                continue;
            };
            let holds = condition.rest.iter().zip(sides.windows(2)).all(|((compare, _), pair)| {
                let (a, b) = (&pair[0], &pair[1]);
                match compare {
                    Compare::Less => a < b,
                    Compare::LessEqual => a <= b,
                    Compare::Greater => a > b,
                    Compare::GreaterEqual => a >= b,
                    Compare::NotEqual => a != b,
                }
            });
            if !holds {
                let values = sides.iter().map(|q| format!("{}", rational_to_f64(q))).collect::<Vec<_>>();
                let help = format!("its sides are {}", values.join(", "));
                self.problem(span, format!("the parameters violate `{text}`"), help);
            }
        }
    }

    /// Names that a scene wants: something of the fluid.
    fn wants(&mut self, wants: &[Name], items: &[Item]) {
        let known = [Want::Matrices, Want::Rhs, Want::Energy, Want::Casimirs].map(Want::name);
        for want in wants {
            let is_trace = |item: &Item| match &item.kind {
                ItemKind::Casimir { name, .. } | ItemKind::Output { name, .. } => name.text == want.text,
                _ => false,
            };
            if !known.contains(&want.text.as_str()) && !items.iter().any(is_trace) {
                let message = format!("a fluid of matrices has no `{}`", want.text);
                let help = format!("legal here: {}, and casimirs", names::list(&known));
                self.problem(want.span, message, help);
            }
        }
    }

    /// A field as messages name it.
    fn shown(&self, field: FluidField) -> String {
        match field {
            FluidField::Vorticity => "the vorticity".into(),
            FluidField::Carried(k) => format!("`{}`", self.names.carried[k].name.text),
        }
    }

    fn energy_text(&self) -> String {
        let momenta = &self.names.momenta;
        energy_text(momenta.surface, momenta.algebra.unwrap_or(""), self.names.vorticity())
    }

    /// The stream function is the derivative of the hamiltonian: with `q dot(omega, (c + Delta)^-1 omega)` it is
    /// `-2 q (-c - Delta)^-1 omega` by the pairing.
    fn energy(&mut self, value: &Expr, fluid: &mut MatrixFluid) {
        let form = self.names.form(value);
        let Some(Form::Function(Function { energy: Some(energy), of_carried, linear })) = form else {
            let of_carried = match self.names.carried.first() {
                Some(field) => {
                    format!(", `-dot({0}, laplacian(..)*{0})` or another polynomial", field.name.text)
                }
                None => String::new(),
            };
            let help = format!(
                "write `hamiltonian = {};`, with `laplacian(..) - F*identity(..)` for a radius of deformation{of_carried}, and \
                 terms that are numbers times components; others need equations",
                self.energy_text()
            );
            self.problem(value.span, "this is not the energy of the fluid, which matrices move by", help);
            return;
        };
        let pairing = Rational::from_integer(fluid.surface.pairing().into());
        fluid.scale = energy.factor * Rational::from_integer((-2).into()) / &pairing;
        fluid.shift = -energy.constant;
        if fluid.scale.is_zero() {
            let help = "its factor vanishes";
            self.problem(value.span, "the energy of the fluid is zero", help);
        }
        if fluid.shift.is_negative() {
            let help = "write `laplacian(..) - F*identity(..)` with a number F that is not negative";
            self.problem(value.span, "the square of the inverse radius of deformation is negative", help);
        }
        let linear_in = |field: FluidField| {
            let of_field = linear.iter().filter(|((of, _), _)| *of == field);
            terms(of_field.map(|((_, wave), value)| (*wave, value / &pairing)))
        };
        fluid.background = linear_in(FluidField::Vorticity);
        for (k, field) in fluid.carried.iter_mut().enumerate() {
            field.constant = linear_in(FluidField::Carried(k));
            let polynomial = of_carried.get(&k).into_iter().flatten();
            let two = Rational::from_integer(2.into());
            field.current = of_minus(polynomial.map(|q| q * &two / &pairing).collect());
        }
        let of_fields = fluid
            .carried
            .iter()
            .flat_map(|field| field.current.iter().chain(field.constant.iter().map(|term| &term.value)));
        let of_vorticity = fluid.background.iter().map(|term| &term.value);
        let mut numbers = [&fluid.scale, &fluid.shift].into_iter().chain(of_vorticity).chain(of_fields);
        if numbers.any(|q| !rational_to_f64(q).is_finite()) {
            let message = "a coefficient of the energy does not fit a double";
            self.problem(value.span, message, "give numbers below 1.7e308");
        }
    }

    /// The component of the vorticity that a velocity belongs to, `dh_dre_1_0`.
    fn component_of_velocity(&self, name: &str) -> Option<FluidWave> {
        match self.names.component(name.strip_prefix("dh_d")?)? {
            (FluidField::Vorticity, wave) => Some(wave),
            (FluidField::Carried(_), _) => None,
        }
    }

    fn not_forced(&mut self, span: Span) {
        let omega = self.names.vorticity();
        let label = match self.names.momenta.surface {
            FluidSurface::Torus => "re_1_0",
            FluidSurface::Sphere => "c_2_1",
        };
        let help = format!(
            "a friction is `force dh_d{omega} = nu*laplacian(..)*{omega};`, a constant `force along dh_d{}{label}: 0.1;`",
            self.names.prefix()
        );
        self.problem(span, "forces of a fluid of matrices are on the vorticity", help);
    }

    fn force(&mut self, name: &Name, value: &Expr, met: &mut Met<'_>, fluid: &mut MatrixFluid) {
        let twice = |reader: &mut Self| {
            let message = format!("force on `{}` is given twice", name.text);
            reader.problem(name.span, message, "write `force along` for what is added to another one");
        };
        if name.text == format!("dh_d{}", self.names.vorticity()) {
            if std::mem::replace(&mut met.force, true) || !met.forced.is_empty() {
                twice(self);
            }
            let Some(Form::Image(FluidField::Vorticity, polynomial)) = self.names.form(value) else {
                let omega = self.names.vorticity();
                let help = format!(
                    "write `nu*laplacian(..)*{omega}`, a polynomial of the laplacian up to the power {MAX_FRICTION} \
                     on the vorticity"
                );
                self.problem(value.span, "this is no friction of a fluid of matrices", help);
                return;
            };
            // Of minus the force.
            fluid.friction = of_minus(polynomial.into_iter().map(|q| -q).collect());
            return;
        }
        match self.component_of_velocity(&name.text) {
            Some(wave) => {
                if met.force || !met.forced.insert(wave) {
                    twice(self);
                }
                self.constant_force(wave, value, fluid);
            }
            None => self.not_forced(name.span),
        }
    }

    /// A force on a component that is a number.
    fn constant_force(&mut self, wave: FluidWave, value: &Expr, fluid: &mut MatrixFluid) {
        let Some(q) = self.number(value) else {
            let help = "a force that depends on the vorticity is `force dh_domega = ..;` with a polynomial of the laplacian";
            self.problem(value.span, "a force on a component of a fluid of matrices is a number", help);
            return;
        };
        let of_wave = fluid.force.iter().find(|term| term.wave == wave).map(|term| term.value.clone());
        let others = fluid.force.iter().filter(|term| term.wave != wave).map(|t| (t.wave, t.value.clone()));
        fluid.force = terms(others.chain([(wave, q + of_wave.unwrap_or_else(Rational::zero))]));
    }

    /// The trace `trace_power([g,] f, k)` of a field, or `dot(omega, star_power([g,] a, k))`, with its factor.
    fn casimir(&mut self, value: &Expr) -> Option<(FluidTrace, Rational)> {
        match self.names.form(value) {
            Some(Form::Trace(trace, factor)) if rational_to_f64(&factor).is_finite() => {
                return Some((trace, factor));
            }
            _ => {}
        }
        let algebra = self.names.momenta.algebra.map_or(String::new(), |name| format!("{name}, "));
        let omega = self.names.vorticity();
        let mut help =
            format!("write `trace_power({algebra}{omega}, k)` with a number k from 1 to {MAX_POWER}");
        if let Some(field) = self.names.carried.first() {
            let a = &field.name.text;
            help += &format!(
                ", of a field `trace_power({algebra}{a}, k)` or `dot({omega}, star_power({algebra}{a}, k))`"
            );
        }
        let message = "casimirs and outputs of a fluid of matrices are traces of its powers";
        self.problem(value.span, message, help);
        None
    }

    /// The mode of a name with its value at time zero.
    fn mode(&mut self, name: &Name, value: &Expr) -> Option<FluidMode> {
        let Some((field, wave)) = self.names.component(&name.text) else {
            let (example, n) = (self.names.prefix(), self.names.momenta.n);
            let help = match self.names.momenta.surface {
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
            let of_fields = if self.names.carried.is_empty() { "the vorticity" } else { "the fluid" };
            self.problem(name.span, format!("`{}` is no mode of {of_fields}", name.text), help);
            return None;
        };
        let Some(Form::Number(initial)) = self.names.form(value) else {
            let help = "write a rational number, in decimals such as `0.785398`";
            self.problem(value.span, "an initial value of a fluid of matrices is a number", help);
            return None;
        };
        if !rational_to_f64(&initial).is_finite() {
            self.problem(value.span, "the initial value does not fit a double", "give one below 1.7e308");
            return None;
        }
        Some(FluidMode { name: name.text.clone(), field, wave, initial })
    }
}

/// Terms that do not vanish, in the order of the waves.
fn terms(all: impl Iterator<Item = (FluidWave, Rational)>) -> Vec<FluidTerm> {
    let sorted: BTreeMap<_, _> = all.filter(|(_, value)| !value.is_zero()).collect();
    sorted.into_iter().map(|(wave, value)| FluidTerm { wave, value }).collect()
}

/// The polynomial of minus the Laplacian that one of the Laplacian is.
fn of_minus(polynomial: Polynomial) -> Polynomial {
    polynomial.into_iter().enumerate().map(|(k, q)| if k.is_multiple_of(2) { q } else { -q }).collect()
}

/// What changes a trace, if anything does.
fn changed_by(trace: &FluidTrace, fluid: &MatrixFluid) -> Option<&'static str> {
    let acts = |k: usize| fluid.carried[k].is_active();
    let (of_vorticity, by_fields) = match trace {
        FluidTrace::Power(FluidField::Carried(_), _) => (false, false),
        FluidTrace::Power(FluidField::Vorticity, _) => (true, (0..fluid.carried.len()).any(acts)),
        FluidTrace::Cross(field, _) => (true, (0..fluid.carried.len()).any(|k| k != *field && acts(k))),
    };
    match (of_vorticity && fluid.is_damped(), by_fields) {
        (true, _) => Some("friction and forces"),
        (_, true) => Some("carried fields"),
        _ => None,
    }
}
