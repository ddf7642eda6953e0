//! The connection of a scene, its curvature and the brackets of its horizontal lifts, by names that are told once.
//!
//! Deliberately does not know: how any of it was computed.

use super::{Page, SectionKind};
use hamel_expr::{Budget, Definition, Graph, Style};
use hamel_lang::algebra::Algebroid;
use hamel_lang::spec::Model;
use hamel_mechanics::mechanics::{ConnectionName, Equations, LiftBracket, NamedConnection, unused_stem};

impl Page {
    /// The brackets of the horizontal lifts `D_i`: they carry the connection and its curvature `B = dA - [A, A]`.
    pub(super) fn connection(&mut self, model: &Model, equations: &Equations) {
        // Brackets of other sections are those of the frame or the algebroid.
        let is_own = model.algebroid.is_some() || model.frame.is_some();
        if !is_own && let Some(named) = NamedConnection::new(&equations.system) {
            self.named_connection(model, equations, named);
            return;
        }
        let n = model.n_shape();
        let mut g = equations.system.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let velocities = match equations.system.connection {
            Some(_) => equations.system.group_velocity(&mut g, n),
            None => Vec::new(),
        };
        let brackets = if is_own { Vec::new() } else { brackets(&mut g, &equations.system.algebroid, n) };
        if velocities.is_empty() && brackets.is_empty() {
            return;
        }
        self.begin(SectionKind::Connection);
        if !velocities.is_empty() {
            self.group_velocity(model, equations, (&g, &velocities));
        }
        if !is_own {
            self.lifts(model, equations, (&g, &brackets));
        }
    }

    fn named_connection(&mut self, model: &Model, equations: &Equations, mut named: NamedConnection) {
        let names: Vec<ConnectionName> = named.coefficients.iter().chain(&named.curvature).cloned().collect();
        for name in &names {
            self.call_component(&mut named.graph, name);
        }
        let named = &named;
        let g = &named.graph;
        self.begin(SectionKind::Connection);
        self.group_velocity(model, equations, (g, &named.group_velocity));
        let has_lift = equations.system.lift.is_some();
        if has_lift {
            self.line(match named.conditions.is_empty() {
                true => "The mechanical connection A = K^-1 L_vx by the locked inertia K = L_vv, its cofactors C and its determinant:",
                false => "The mechanical connection solves K A = L_vx with the locked inertia K = L_vv:",
            });
        } else if !named.coefficients.is_empty() {
            self.line("with the coefficients of the connection");
        }
        self.definitions(g, &named.inertia);
        let of = |names: &[ConnectionName]| names.iter().map(|name| name.definition).collect::<Vec<_>>();
        self.definitions(g, &of(&named.coefficients));
        let shown = |page: &Page, e| g.display(e, page.style);
        let rows: Vec<(String, String)> =
            named.conditions.iter().map(|(l, r)| (shown(self, *l), shown(self, *r))).collect();
        self.formulas(&rows);
        if !named.rates.is_empty() {
            self.line("Derivatives of K, and R = K (dA - [.,.]) of the curvature, in which no quotient is differentiated:");
            self.definitions(g, &named.rates);
        }
        if !named.curvature.is_empty() {
            self.line("The curvature B = dA - [A, A]:");
            self.definitions(g, &of(&named.curvature));
        }
        self.lifts(model, equations, (g, &named.brackets));
    }

    /// Names with their values.
    pub(super) fn definitions(&mut self, g: &Graph, definitions: &[Definition]) {
        let shown = definitions.iter().map(|d| (self.name(g.name(d.symbol)), g.display(d.expr, self.style)));
        let shown: Vec<(String, String)> = shown.collect();
        self.formulas(&shown);
    }

    fn group_velocity(
        &mut self,
        model: &Model,
        equations: &Equations,
        (g, velocities): (&Graph, &[hamel_expr::ExprId]),
    ) {
        let [velocity, xi] = [self.velocity(equations), self.xi()].map(|of| self.inline(&of));
        self.line(&format!("The velocities of the model are {velocity}; the group velocity {xi} is"));
        let own = model.algebra.basis().iter();
        let names = own.map(|b| self.name(&format!("xi_{b}")));
        let shown = names.zip(velocities).map(|(name, e)| (name, g.display(*e, self.style)));
        let shown: Vec<(String, String)> = shown.collect();
        self.formulas(&shown);
    }

    fn lift(&self, model: &Model, i: usize) -> String {
        match (self.style, self.name(&model.base[i].name)) {
            (Style::MathMl, name) => format!("<msub><mi>D</mi>{name}</msub>"),
            (Style::Latex, name) => format!("D_{{{name}}}"),
            (_, name) => format!("D_{name}"),
        }
    }

    fn lifts(&mut self, model: &Model, equations: &Equations, (g, brackets): (&Graph, &[LiftBracket])) {
        let n = model.n_shape();
        let is_adapted = equations.system.frame.is_some() && equations.system.lift.is_none();
        let basis: Vec<String> = match is_adapted {
            true => {
                let stem = unused_stem(equations, "f");
                (1..=model.algebra.dim()).map(|k| self.name(&format!("{stem}{k}"))).collect()
            }
            false => model.algebra.basis().iter().map(|b| self.name(b)).collect(),
        };
        let mut rows = Vec::new();
        for LiftBracket { coordinate, other, value } in brackets {
            let right: Vec<String> = value.iter().map(|(c, e)| self.term(g, *e, &basis[*c])).collect();
            let right = self.sum(&right);
            let other = if *other < n { self.lift(model, *other) } else { basis[*other - n].clone() };
            rows.push((self.bracket(&self.lift(model, *coordinate), &other), right));
        }
        let is_curved = brackets.iter().any(|bracket| bracket.other < n);
        self.line(if rows.is_empty() {
            "The connection is flat, and the horizontal lifts commute with everything."
        } else if is_curved {
            "Brackets of the horizontal lifts: [D_i, D_j] is minus the curvature, [D_i, e_b] is minus [A_i, e_b]."
        } else {
            "Brackets of the horizontal lifts: the connection is flat, [D_i, e_b] is minus [A_i, e_b]."
        });
        self.formulas(&rows);
        let mut g = equations.system.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let algebroid = equations.system.with_lifts(&mut g);
        if !algebroid.has_drift() {
            return;
        }
        self.line("The connection depends on time: the frame drifts, and [d/dt, D_i] is minus dA_i/dt.");
        let time = match self.html() {
            true => "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>",
            false => "d/dt",
        };
        let mut rows = Vec::new();
        for i in (0..n).filter(|i| !algebroid.drift(*i).is_empty()) {
            let drift = algebroid.drift(i).iter();
            let right: Vec<String> = drift.map(|(c, e)| self.term(&g, *e, &basis[c - n])).collect();
            let right = self.sum(&right);
            rows.push((self.bracket(time, &self.lift(model, i)), right));
        }
        self.formulas(&rows);
    }
}

/// The brackets of the lifts as the algebroid has them.
fn brackets(g: &mut Graph, algebroid: &Algebroid, n: usize) -> Vec<LiftBracket> {
    let mut found = Vec::new();
    for coordinate in 0..n {
        for other in coordinate + 1..algebroid.rank() {
            let value = algebroid.bracket(g, coordinate, other);
            if !value.is_empty() {
                let value = value.into_iter().map(|(c, e)| (c - n, e)).collect();
                found.push(LiftBracket { coordinate, other, value });
            }
        }
    }
    found
}
