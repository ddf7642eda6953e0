//! A scene in the notation of Cendra and Diaz, Lagrange-d'Alembert-Poincare equations by several stages: forms,
//! variations, constraints, vertical and horizontal equations, covariant derivatives, with the numbers of their
//! equations.
//!
//! General formulas stand as they are right: (20), (21) and (26) of the paper keep one summand of (19) alone.
//! Deliberately does not know: how any of it was computed.

use super::{Page, SectionKind};
use crate::scene::{BuiltScene, in_velocities};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SPELLED, Style};
use hamel_lang::spec::{Model, Side};
use hamel_mechanics::mechanics::{
    Equations, VariationKind, VariationPart, Variations, VerticalEquation, VerticalEquations, unused_stem,
};
use hamel_mechanics::reduction::{KinematicConstraint, Stages};

/// A general formula, in Unicode and in LaTeX.
struct General {
    left: [&'static str; 2],
    right: [&'static str; 2],
}

const BRACKET: General = General {
    left: ["[η, η̄]^(i,i+1)", "[\\eta, \\bar{\\eta}]^{(i,i+1)}"],
    right: [
        "[η^(i,i+1), η̄^(i,i+1)] - Σ_{j<i} a_(j,j+1)(η^(j,j+1), η̄^(j,j+1)) + Σ_{j<i} b_(j,j+1)(η^(j,j+1), Σ_{k>j} η̄^(k,k+1)) \
         - Σ_{j<i} b_(j,j+1)(η̄^(j,j+1), Σ_{k>j} η^(k,k+1))",
        "[\\eta^{(i,i+1)}, \\bar{\\eta}^{(i,i+1)}] - \\sum_{j<i} a^{(i,i+1)}_{(j,j+1)}(\\eta^{(j,j+1)}, \\bar{\\eta}^{(j,j+1)}) \
         + \\sum_{j<i} b^{(i,i+1)}_{(j,j+1)}(\\eta^{(j,j+1)}, \\textstyle\\sum_{k>j} \\bar{\\eta}^{(k,k+1)}) \
         - \\sum_{j<i} b^{(i,i+1)}_{(j,j+1)}(\\bar{\\eta}^{(j,j+1)}, \\textstyle\\sum_{k>j} \\eta^{(k,k+1)})",
    ],
};

const VERTICAL: General = General {
    left: ["β̇^(i,i+1)", "\\dot{\\beta}^{(i,i+1)}"],
    right: [
        "ad*(η^(i,i+1)) β^(i,i+1) + Σ_{j<i} ⟨β, b_(j,j+1)(η^(j,j+1), ·)⟩ - ⟨β, a_(i,i+1)(η^(i,i+1), ·)⟩ \
         - ⟨β, b_(i,i+1)(·, Σ_{l>i} η^(l,l+1))⟩",
        "\\operatorname{ad}^*_{\\eta^{(i,i+1)}} \\beta^{(i,i+1)} + \\sum_{j<i} \\langle \\beta, b_{(j,j+1)}(\\eta^{(j,j+1)}, \\cdot)\\rangle \
         - \\langle \\beta, a_{(i,i+1)}(\\eta^{(i,i+1)}, \\cdot)\\rangle \
         - \\langle \\beta, b_{(i,i+1)}(\\cdot, \\textstyle\\sum_{l>i} \\eta^{(l,l+1)})\\rangle",
    ],
};

const COVARIANT: [General; 2] = [
    General {
        left: ["Dζ/Dt", "\\frac{D\\zeta}{Dt}"],
        right: ["ζ̇ - [A(ẋ), ζ]", "\\dot{\\zeta} - [A(\\dot{x}), \\zeta]"],
    },
    General {
        left: ["Dβ/Dt", "\\frac{D\\beta}{Dt}"],
        right: ["β̇ + ad*(A(ẋ)) β", "\\dot{\\beta} + \\operatorname{ad}^*_{A(\\dot{x})} \\beta"],
    },
];

const VARIATION: General = General {
    left: ["δv", "\\delta v"],
    right: [
        "Dζ/Dt + [v, ζ] + B(δx, ẋ) + [A(δx), v]",
        "\\frac{D\\zeta}{Dt} + [v, \\zeta] + B(\\delta x, \\dot{x}) + [A(\\delta x), v]",
    ],
};

const VERTICAL_COVARIANT: General = General {
    left: ["Dβ/Dt", "\\frac{D\\beta}{Dt}"],
    right: ["ad*(v) β", "\\operatorname{ad}^*_{v} \\beta"],
};

const HORIZONTAL: [General; 2] = [
    General {
        left: [
            "d/dt ∂l/∂ẋ^i - ∂^C l/∂x^i",
            "\\frac{d}{dt} \\frac{\\partial l}{\\partial \\dot{x}^i} - \\frac{\\partial^C l}{\\partial x^i}",
        ],
        right: ["⟨β, B(∂_i, ẋ)⟩", "\\langle \\beta, B(\\partial_i, \\dot{x})\\rangle"],
    },
    General {
        left: ["∂^C l/∂x^i", "\\frac{\\partial^C l}{\\partial x^i}"],
        right: [
            "∂l/∂x^i + ⟨β, [A_i, v]⟩",
            "\\frac{\\partial l}{\\partial x^i} + \\langle \\beta, [A_i, v]\\rangle",
        ],
    },
];

/// The equations of a scene in the notation of Cendra and Diaz, in the styles of [`explain`](super::explain): in
/// velocities of the model, whatever the state of the scene carries.
///
/// # Errors
/// [`Error::Unsupported`] for a scene without stages, with a Hamiltonian or with momenta that are parameters, and where
/// a block is not seen to be that of the motion.
pub fn by_paper(model: &Model, scene: &BuiltScene, style: Style) -> Result<String, Error> {
    let whole = scene.whole()?;
    let scene = &*whole;
    let in_velocities = in_velocities(model, scene)?;
    let equations = in_velocities.as_ref().unwrap_or(&scene.equations);
    let Some(stages) = &equations.system.stages else {
        let possible = "`stage whole;` for the group as one stage, and a model with an algebra";
        return Err(refused("equations by stages of a model without stages", possible));
    };
    let mut vertical = VerticalEquations::new(equations).ok_or_else(unproved)?;
    let head = super::Section { kind: SectionKind::Head, text: String::new() };
    let mut page = Page { style, head, rest: Vec::new() };
    page.call_pairings(&mut vertical, stages, equations);
    let mut variations = Variations::new(equations, &vertical).ok_or_else(unproved)?;
    for (delta, x) in variations.shape.iter().zip(equations.system.algebroid.base()) {
        let label = page.varied(&page.name(equations.system.graph.name(*x)));
        variations.graph.rename(*delta, Page::spelled(&label));
    }
    page.header(model, scene);
    page.paper_forms(model, stages, equations);
    page.paper_variations((stages, equations), &vertical, &variations);
    page.paper_constraint(stages, equations, &vertical);
    page.paper_derivatives(equations, &variations);
    page.paper_vertical(stages, equations, &vertical);
    page.paper_horizontal(equations, &vertical);
    Ok(super::written(std::iter::once(page.head).chain(page.rest).collect(), style))
}

fn refused(what: &str, possible: &str) -> Error {
    Error::Unsupported { what: what.into(), possible: possible.into() }
}

fn unproved() -> Error {
    let possible = "the explanation without `--by paper`";
    refused("a form by stages that is not seen to be that of the motion", possible)
}

impl Page {
    fn general(&mut self, formulas: &[General]) {
        let k = usize::from(self.latex());
        let rows: Vec<(String, String)> =
            formulas.iter().map(|f| (f.left[k].to_owned(), f.right[k].to_owned())).collect();
        self.formulas(&rows);
    }

    fn side(&mut self, equations: &Equations) {
        if equations.system.side == Side::Right {
            self.line("The action is from the right: every bracket of the algebra changes its sign in what follows.");
        }
    }

    /// (2)-(14).
    fn paper_forms(&mut self, model: &Model, stages: &Stages, equations: &Equations) {
        self.begin(SectionKind::PaperForms);
        let g = &equations.system.graph;
        let chain: Vec<String> = stages.levels.iter().map(|l| self.prose(&l.name)).collect();
        let (sign, groups, level) = match self.latex() {
            true => (" $\\supset$ ", "N_0 \\supset N_1 \\supset \\ldots", "n_i/n_{i+1}"),
            false => (" ⊃ ", "N_0 ⊃ N_1 ⊃ ..", "n_i/n_(i+1)"),
        };
        let [groups, level] = [groups, level].map(|text| self.inline(text));
        self.line(&format!("Chain of subgroups {groups}: {}.", chain.join(sign)));
        self.line(&format!(
            "An element of the algebra is the sum of its parts in the levels {level}, by horizontal lifts (13):"
        ));
        self.levels_of_velocity(stages, equations);
        let stem = unused_stem(equations, "f");
        let basis: Vec<String> = model.algebra.basis().to_vec();
        let mut spelled = g.clone();
        let rows = (0..basis.len()).map(|k| {
            let value = stages.spell_element(&mut spelled, k, &basis, self.style);
            (self.name(&format!("{stem}{}", k + 1)), value)
        });
        let rows: Vec<(String, String)> = rows.collect();
        self.formulas(&rows);
        self.line("The bracket by stages (14), and its forms:");
        self.general(&[BRACKET]);
        for (j, level) in stages.levels.iter().enumerate() {
            let name = self.prose(&level.name);
            self.line(&format!("Level ({j},{}), {name}:", j + 1));
            self.forms_of_level((j, level), &stem, g);
        }
        self.line(
            "The bracket rebuilt from these forms was compared, exactly, with the bracket of the algebra.",
        );
        self.side(equations);
    }

    /// (17) and (24).
    fn paper_variations(
        &mut self,
        (stages, equations): (&Stages, &Equations),
        vertical: &VerticalEquations,
        variations: &Variations,
    ) {
        self.begin(SectionKind::PaperVariations);
        let g = &variations.graph;
        let stem = unused_stem(equations, "f");
        let has_shape = !vertical.along_shape.coefficients.is_empty();
        let zeta = self.name("zeta");
        let variable = self.name(if has_shape { "v" } else { "eta" });
        let [shown, variable_shown] = [&zeta, &variable].map(|of| self.inline(of));
        self.line(&format!(
            "The variation of {variable_shown} along a variation {shown} in the algebra that vanishes at the ends, level by level:"
        ));
        if has_shape {
            self.general(&[VARIATION]);
        }
        let is_right = equations.system.side == Side::Right;
        let stem_of_variable = if has_shape { "v" } else { "eta" };
        let mut rows = Vec::new();
        for j in 0..stages.levels.len() {
            let mut terms = vec![self.of_level("dot_zeta", j)];
            for part in variations.parts.iter().filter(|part| part.level == j) {
                let label = self.variation(part, stages.levels.len());
                let is_negative = part.kind.is_negative() ^ (is_right && part.kind.is_of_levels());
                terms.push(if is_negative { self.minus(&label) } else { label });
            }
            let left = self.of_level(stem_of_variable, j);
            rows.push((self.varied(&left), self.sum(&terms)));
        }
        self.formulas(&rows);
        let mut rows = Vec::new();
        for part in &variations.parts {
            let terms = part.value.iter().map(|(k, e)| {
                let element = self.name(&format!("{stem}{}", k + 1));
                self.term(g, *e, &element)
            });
            let terms: Vec<String> = terms.collect();
            let label = self.variation(part, stages.levels.len());
            let label = if part.kind.is_of_levels() && part.kind != VariationKind::Bracket {
                self.in_level(&label, part.level)
            } else {
                label
            };
            rows.push((label, self.sum(&terms)));
        }
        if !rows.is_empty() {
            self.line("with the parts");
            self.formulas(&rows);
        }
        self.line(
            "Their sum was compared, exactly, with the variation that the bracket of the algebroid gives.",
        );
    }

    fn minus(&self, label: &str) -> String {
        if self.html() { format!("<mo>−</mo>{label}") } else { format!("-{label}") }
    }

    fn varied(&self, of: &str) -> String {
        match self.style {
            Style::Latex => format!("\\delta {of}"),
            Style::MathMl => format!("<mi>δ</mi>{of}"),
            _ => format!("δ{of}"),
        }
    }

    /// The component in a level.
    fn in_level(&self, label: &str, level: usize) -> String {
        let next = level + 1;
        match self.style {
            Style::Latex => format!("{label}^{{({level},{next})}}"),
            Style::MathMl => format!("<msup>{label}<mtext>({level},{next})</mtext></msup>"),
            _ => format!("{label}^({level},{next})"),
        }
    }

    fn variation(&self, part: &VariationPart, n_levels: usize) -> String {
        let of = |stem: &str, level: usize| self.of_level(stem, level);
        match part.kind {
            VariationKind::Bracket => self.bracket(&of("eta", part.level), &of("zeta", part.level)),
            VariationKind::Curvature(j) => {
                self.applied(&self.form_of_level("a", j), &[&of("eta", j), &of("zeta", j)])
            }
            VariationKind::Vertical(j) => {
                let below = self.behind_level("zeta", j, n_levels);
                self.applied(&self.form_of_level("b", j), &[&of("eta", j), &below])
            }
            VariationKind::Exchanged(j) => {
                let below = self.behind_level("eta", j, n_levels);
                self.applied(&self.form_of_level("b", j), &[&of("zeta", j), &below])
            }
            VariationKind::ShapeCurvature => {
                let form =
                    self.applied(&self.name("B"), &[&self.varied(&self.name("x")), &self.name("dot_x")]);
                self.in_level(&form, part.level)
            }
            VariationKind::ShapeBracket => {
                let along = self.applied(&self.name("A"), &[&self.varied(&self.name("x"))]);
                self.in_level(&self.bracket(&along, &self.name("v")), part.level)
            }
        }
    }

    /// (22)-(32).
    fn paper_constraint(&mut self, stages: &Stages, equations: &Equations, vertical: &VerticalEquations) {
        let is_constrained = match &equations.system.constraint {
            KinematicConstraint::Solved(solved) => !solved.reactions.names.is_empty(),
            KinematicConstraint::Multipliers { .. } => true,
        };
        if !is_constrained {
            return;
        }
        self.begin(SectionKind::PaperConstraint);
        let mut texts: Vec<&str> = equations.system.constraint.texts().collect();
        // A constraint on vectors has a row for each component.
        texts.dedup();
        for text in texts {
            let text = self.prose(text);
            self.line(&text);
        }
        if vertical.has_multipliers {
            self.line("Multipliers keep it: every equation stands alone, with its reactions.");
            return;
        }
        if vertical.rows.is_empty() {
            self.line("No displacement along the group is allowed: S is zero.");
        } else {
            let is_in_a_level = |row: &VerticalEquation| {
                let zero = vertical.graph.zero();
                let of = |(k, e): (usize, &ExprId)| (*e != zero).then(|| stages.level_of(k));
                let levels: Vec<usize> = row.displacement.iter().enumerate().filter_map(of).collect();
                levels.windows(2).all(|pair| pair[0] == pair[1])
            };
            self.line(match vertical.rows.iter().all(is_in_a_level) {
                true => "Allowed displacements along the group, S = S_(0,1) + S_(1,2) + .. by levels:",
                false => "Allowed displacements along the group, S, which is not the sum of its parts in the levels (27)-(32):",
            });
            let rows: Vec<(String, String)> = vertical
                .rows
                .iter()
                .enumerate()
                .map(|(k, row)| {
                    let value = self.displacement(equations, &vertical.graph, (&[], &row.displacement));
                    (self.name(&format!("s{}", k + 1)), value)
                })
                .collect();
            self.formulas(&rows);
        }
        if !vertical.horizontal.is_empty() {
            self.line("and with a part along the shape");
            let rows: Vec<(String, String)> = vertical
                .horizontal
                .iter()
                .enumerate()
                .map(|(k, row)| {
                    let along = (&row.shape[..], &row.equation.displacement[..]);
                    let value = self.displacement(equations, &vertical.graph, along);
                    (self.name(&format!("d{}", k + 1)), value)
                })
                .collect();
            self.formulas(&rows);
        }
    }

    /// A displacement by horizontal lifts and elements of the adapted basis.
    fn displacement(
        &self,
        equations: &Equations,
        g: &Graph,
        (shape, vertical): (&[ExprId], &[ExprId]),
    ) -> String {
        let stem = unused_stem(equations, "f");
        let base = equations.system.algebroid.base();
        let lifts = shape.iter().zip(base).map(|(e, x)| (*e, self.name(&format!("D_{}", g.name(*x)))));
        let elements = vertical.iter().enumerate();
        let elements = elements.map(|(k, e)| (*e, self.name(&format!("{stem}{}", k + 1))));
        let terms = lifts.chain(elements).filter(|(e, _)| *e != g.zero());
        let terms: Vec<String> = terms.map(|(e, element)| self.term(g, e, &element)).collect();
        self.sum(&terms)
    }

    /// (33), (34) and appendix A.
    fn paper_derivatives(&mut self, equations: &Equations, variations: &Variations) {
        if variations.covariant.is_empty() {
            return;
        }
        self.begin(SectionKind::PaperDerivatives);
        self.line("On the adjoint bundle and its dual (33), (34):");
        self.general(&COVARIANT);
        self.line("along the elements of the levels");
        let g = &variations.graph;
        let stem = unused_stem(equations, "f");
        let beta = unused_stem(equations, "beta");
        let (mut rows, mut moved) = (Vec::new(), Vec::new());
        for (k, (turned, along)) in variations.covariant.iter().enumerate() {
            let element = self.name(&format!("{stem}{}", k + 1));
            let name = self.name(&format!("{beta}{}", k + 1));
            let left = match self.style {
                Style::Latex => format!("\\frac{{D{name}}}{{Dt}} - \\dot{{{name}}}"),
                _ => format!("D{name}/Dt - {}", self.name(&format!("dot_{beta}{}", k + 1))),
            };
            rows.push((left, g.display(*turned, self.style)));
            let of = self.coadjoint(&self.name("v"), &self.name("beta"));
            moved.push((self.paired(&of, &element), g.display(*along, self.style)));
        }
        self.formulas(&rows);
        self.line("The vertical Lagrange-Poincare equation (36), (38) in one piece, without what acts from outside:");
        self.general(&[VERTICAL_COVARIANT]);
        self.formulas(&moved);
        self.line("Its right side less D/Dt - d/dt was compared, exactly, with the vertical equations by stages that follow.");
        self.line("Horizontal and vertical derivatives of the reduced Lagrangian l (appendix A): the vertical ones are the");
        self.line("momenta, the horizontal one along a coordinate stands with the horizontal equations.");
    }

    /// (18)-(21), (25), (32), (35)-(38), (40), (43).
    fn paper_vertical(&mut self, stages: &Stages, equations: &Equations, vertical: &VerticalEquations) {
        self.begin(SectionKind::PaperVertical);
        self.line("On every level, with what acts from outside and (20), (21), (26) corrected, eta being the group velocity:");
        self.general(&[VERTICAL]);
        self.line("Velocities and momenta along the levels, and what acts from outside:");
        self.momenta_by_stages(vertical, stages, true);
        self.vertical_rows(vertical);
        self.line("Each of them was compared, exactly, with the equations of motion.");
        self.side(equations);
    }

    /// (39), (41)-(43).
    fn paper_horizontal(&mut self, equations: &Equations, vertical: &VerticalEquations) {
        if vertical.horizontal.is_empty() {
            return;
        }
        self.begin(SectionKind::PaperHorizontal);
        if equations.system.connection.is_some() {
            self.general(&HORIZONTAL);
        }
        self.horizontal_rows(vertical, equations);
        self.line("Each of them was compared, exactly, with the equations of motion.");
    }

    /// A name that is spelled already.
    pub(super) fn spelled(label: &str) -> String {
        format!("{SPELLED}{label}")
    }
}
