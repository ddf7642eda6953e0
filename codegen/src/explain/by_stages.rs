//! Reduction by stages: the adapted basis, the forms of the levels, and vertical and horizontal equations whose parts
//! have names.
//!
//! Deliberately does not know: how any of it was computed.

use super::{Page, SectionKind};
use hamel_expr::{Budget, Definition, Graph};
use hamel_lang::spec::Model;
use hamel_mechanics::mechanics::{
    Equations, Pairing, PairingKind, VerticalEquation, VerticalEquations, unused_stem,
};
use hamel_mechanics::reduction::{StageLevel, Stages, Tensor};

impl Page {
    pub(super) fn stages(&mut self, model: &Model, stages: &Stages, equations: &Equations) {
        self.begin(SectionKind::Stages);
        let mut g = equations.system.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let chain: Vec<String> = stages.levels.iter().map(|l| self.prose(&l.name)).collect();
        self.line(&format!(
            "Chain of ideals: {}.",
            chain.join(if self.latex() { " $\\supset$ " } else { " ⊃ " })
        ));
        let basis: Vec<String> = model.algebra.basis().to_vec();
        let stem = unused_stem(equations, "f");
        let symbol = |k: usize| format!("{stem}{}", k + 1);
        let standard = stages.basis.iter().enumerate().all(|(k, row)| {
            row.iter().enumerate().all(|(a, e)| *e == if a == k { g.one() } else { g.zero() })
        });
        if standard {
            self.line(&format!("The adapted basis is the given one: {stem}_k = e_k."));
        } else {
            let rows: Vec<(String, String)> = (0..basis.len())
                .map(|k| (self.name(&symbol(k)), stages.spell_element(&mut g, k, &basis, self.style)))
                .collect();
            self.line("Adapted basis (horizontal lifts, orthogonal to the stage below):");
            self.formulas(&rows);
        }
        self.frame_of_stages(equations);
        for (j, level) in stages.levels.iter().enumerate() {
            let members: Vec<String> = level.range.clone().map(|k| self.name(&symbol(k))).collect();
            let members = self.inline(&self.list(&members));
            let name = self.prose(&level.name);
            self.line(&format!("\nLevel {j}, {name}: spanned by {members}"));
            self.forms_of_level((j, level), &stem, &g);
        }
        self.line(
            "\nThe bracket rebuilt from these forms was checked, exactly, to be the bracket of the algebra.",
        );
        self.stage_equations(stages, equations);
    }

    /// What the frame that is adapted to the stages is used for.
    fn frame_of_stages(&mut self, equations: &Equations) {
        let system = &equations.system;
        if system.frame.is_none() {
            return;
        }
        if system.changes.is_empty() {
            self.line("The equations are derived in this basis; the state has the velocities of the model.");
            return;
        }
        let momenta = system.momenta.iter().filter(|m| {
            let symbol = system.unknowns[m.unknown].symbol;
            system.changes.iter().any(|c| c.symbol == symbol)
        });
        let momenta: Vec<String> = momenta.map(|m| self.name(&m.name)).collect();
        self.line(&match momenta.is_empty() {
            true => "The state has the velocities along the levels, by those of the model:".to_owned(),
            false => format!(
                "The state has the momenta {}. The velocities along the levels, by those of the model:",
                self.inline(&self.list(&momenta))
            ),
        });
        let g = &system.graph;
        let rows = system.changes.iter().map(|c| (self.name(&c.name), g.display(c.value, self.style)));
        let rows: Vec<(String, String)> = rows.collect();
        self.formulas(&rows);
    }

    /// The forms of a level.
    pub(super) fn forms_of_level(&mut self, (j, level): (usize, &StageLevel), stem: &str, g: &Graph) {
        self.form("quotient bracket", ["", stem], j, &level.quotient_bracket, g);
        self.form("curvature form", ["a", stem], j, &level.curvature, g);
        self.form("vertical connection form", ["b", stem], j, &level.vertical_connection, g);
    }

    /// The vertical equations by stages in terms of momenta and velocities along the adapted basis.
    fn stage_equations(&mut self, stages: &Stages, equations: &Equations) {
        if !equations.system.momenta.is_empty() {
            self.line("Where the state has momenta, their rates are the vertical equations by stages.");
            return;
        }
        let Some(mut vertical) = VerticalEquations::new(equations) else {
            self.line("That its vertical equations are those of the motion could not be proved: they are not shown.");
            return;
        };
        self.call_pairings(&mut vertical, stages, equations);
        if vertical.rows.is_empty() {
            self.line("The constraint allows no displacement along the group: no equation is vertical.");
        }
        self.line(match &equations.system.connection {
            None => "In the adapted basis, velocity, momentum p = dL/dv, and what acts from outside:",
            Some(_) => {
                "In the adapted basis, group velocity, momentum p = dL/dv, and what acts from outside:"
            }
        });
        self.levels_of_velocity(stages, equations);
        self.momenta_by_stages(&vertical, stages, false);
        self.vertical_rows(&vertical);
        self.horizontal_rows(&vertical, equations);
        self.line(match equations.system.frame {
            None => "These were compared, exactly, with the equations of motion, which are derived without stages.",
            Some(_) => "These were compared, exactly, with the equations of motion, which are derived in this basis.",
        });
    }

    /// Gives the parts of the equations the names by which they are read.
    pub(super) fn call_pairings(
        &self,
        vertical: &mut VerticalEquations,
        stages: &Stages,
        equations: &Equations,
    ) {
        let base: Vec<String> = (equations.system.algebroid.base().iter())
            .map(|x| equations.system.graph.name(*x).to_owned())
            .collect();
        let stem = unused_stem(equations, "f");
        for Pairing { kind, definition } in &vertical.pairings {
            let label = self.pairing(*kind, stages, &stem, &base);
            vertical.graph.rename(definition.symbol, Page::spelled(&label));
        }
        let named = vertical.along_shape.connection.iter().chain(&vertical.along_shape.curvature);
        for name in named.cloned().collect::<Vec<_>>() {
            self.call_component(&mut vertical.graph, &name);
        }
    }

    /// `eta^(i,i+1) = eta_k f_k + ..` of every level.
    pub(super) fn levels_of_velocity(&mut self, stages: &Stages, equations: &Equations) {
        let [stem, eta] = ["f", "eta"].map(|stem| unused_stem(equations, stem));
        let mut rows = Vec::new();
        for (j, level) in stages.levels.iter().enumerate() {
            let terms = level.range.clone().map(|k| {
                let parts = [&eta, &stem].map(|stem| self.name(&format!("{stem}{}", k + 1)));
                match self.html() {
                    true => self.style.product(&parts),
                    false => parts.join(" "),
                }
            });
            let terms: Vec<String> = terms.collect();
            rows.push((self.of_level("eta", j), self.sum(&terms)));
        }
        self.formulas(&rows);
    }

    /// Velocities, momenta, what acts from outside, and the connection where the basis is not that of the algebra.
    pub(super) fn momenta_by_stages(
        &mut self,
        vertical: &VerticalEquations,
        stages: &Stages,
        is_alone: bool,
    ) {
        let g = &vertical.graph;
        let unit = |k: usize, a: usize| if a == k { g.one() } else { g.zero() };
        let mut rows = stages.basis.iter().enumerate();
        let is_standard = rows.all(|(k, row)| row.iter().enumerate().all(|(a, e)| *e == unit(k, a)));
        // Along the basis of the algebra they are told with the connection.
        if is_alone || !is_standard {
            let named = vertical.along_shape.connection.iter().chain(&vertical.along_shape.curvature);
            self.definitions(g, &named.map(|name| name.definition).collect::<Vec<_>>());
        }
        let all = vertical.velocities.iter().chain(&vertical.momenta).chain(&vertical.applied);
        self.definitions(g, &all.copied().collect::<Vec<_>>());
    }

    /// The named parts of some equations.
    fn parts(&mut self, vertical: &VerticalEquations, is_vertical: bool) {
        let of = |kind: PairingKind| {
            matches!(kind, PairingKind::Level { .. } | PairingKind::Turning { .. }) == is_vertical
        };
        let parts = vertical.pairings.iter().filter(|p| of(p.kind)).map(|p| p.definition);
        let parts: Vec<Definition> = parts.collect();
        if !parts.is_empty() {
            self.line("with the parts");
            self.definitions(&vertical.graph, &parts);
        }
    }

    fn sides(&mut self, g: &Graph, rows: Vec<&VerticalEquation>) {
        let shown = rows.into_iter().map(|row| [row.left, row.right].map(|e| g.display(e, self.style)));
        let shown: Vec<(String, String)> = shown.map(|[left, right]| (left, right)).collect();
        self.formulas(&shown);
    }

    pub(super) fn vertical_rows(&mut self, vertical: &VerticalEquations) {
        let VerticalEquations { rows, momenta, .. } = vertical;
        if rows.is_empty() {
            return;
        }
        self.line(match (rows.len() < momenta.len(), vertical.has_multipliers) {
            (true, _) => {
                "Vertical equations by stages, summed over the levels along each displacement that the constraint \
                 allows:"
            }
            (false, true) => {
                "Vertical equations by stages, with the reactions of the constraint (every level's momentum may \
                 enter):"
            }
            (false, false) => "Vertical equations by stages (every level's momentum may enter):",
        });
        self.sides(&vertical.graph, rows.iter().collect());
        self.parts(vertical, true);
    }

    pub(super) fn horizontal_rows(&mut self, vertical: &VerticalEquations, equations: &Equations) {
        if vertical.horizontal.is_empty() {
            return;
        }
        self.line("Along the shape, momentum and what acts from outside:");
        let all = vertical.shape_momenta.iter().chain(&vertical.shape_applied);
        self.definitions(&vertical.graph, &all.copied().collect::<Vec<_>>());
        self.line(match equations.system.connection {
            None => "Horizontal equations:",
            Some(_) => "Horizontal equations, with the curvature of the connection:",
        });
        self.sides(&vertical.graph, vertical.horizontal.iter().map(|row| &row.equation).collect());
        self.parts(vertical, false);
    }

    fn form(&mut self, title: &str, [letter, stem]: [&str; 2], level: usize, tensor: &Tensor, g: &Graph) {
        if tensor.is_empty() {
            self.line(&format!("  {title}: zero"));
            return;
        }
        self.line(&format!("  {title}:"));
        let mut rows: Vec<(String, String)> = Vec::new();
        let mut last = None;
        for (a, b, c, value) in tensor {
            let antisymmetric = letter != "b";
            if antisymmetric && a > b {
                continue;
            }
            let [fa, fb, fc] = [a, b, c].map(|k| self.name(&format!("{stem}{}", k + 1)));
            let term = self.term(g, *value, &fc);
            if last == Some((a, b)) {
                if let Some((_, right)) = rows.last_mut() {
                    self.style.append_term(right, &term);
                }
                continue;
            }
            last = Some((a, b));
            let left = if letter.is_empty() {
                self.bracket(&fa, &fb)
            } else {
                self.applied(&self.form_of_level(letter, level), &[&fa, &fb])
            };
            rows.push((left, term));
        }
        self.formulas(&rows);
    }
}
