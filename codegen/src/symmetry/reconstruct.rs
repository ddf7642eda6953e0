//! Coordinates of the group from its velocity, as text.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use hamel_expr::{ExprId, Rational};
use num_traits::{One, Zero};

use super::angles::AngleGroup;
use super::group::SymmetryGroup;
use super::names::vectors_of;
use super::section::Section;
use super::setting::{Generator, Setting};
use super::write::document;

impl Setting<'_> {
    /// The coordinates of the group from its velocity, where the model can name the group.
    pub(super) fn write_reconstruction(
        &mut self,
        out: &mut String,
        group: &SymmetryGroup,
        section: &Section,
    ) {
        let model = self.model;
        for (k, configuration) in model.configurations.iter().enumerate() {
            let own: Vec<usize> = (0..group.fields.len())
                .filter(|a| self.configuration_of(&group.fields[*a]).is_some_and(|(of, _)| of == k))
                .collect();
            if own.is_empty() {
                continue;
            }
            let list = [vec![configuration.name.clone()], vectors_of(configuration)].concat().join(", ");
            let from: Vec<&str> = own.iter().map(|a| section.names[*a].as_str()).collect();
            document(out, &model.advected[configuration.advected].doc);
            let _ =
                writeln!(out, "    reconstruct {list} in {} from {};", configuration.group, from.join(", "));
        }
        let mut done: BTreeSet<usize> = BTreeSet::new();
        if let Some(angles) = &group.angles {
            done.extend(&angles.coordinates);
            self.write_angles(out, (group, angles), section);
        }
        // Angles come before what they turn.
        let mut order: Vec<usize> = (0..model.base.len()).filter(|i| !section.shape.contains(i)).collect();
        order.sort_by_key(|i| !self.is_angle(*i));
        for i in order {
            if !done.insert(i) {
                continue;
            }
            let turning: Vec<usize> = (0..group.fields.len())
                .filter(|a| {
                    let c = &group.fields[*a].coefficients;
                    self.generators
                        .iter()
                        .zip(c)
                        .any(|(g, q)| matches!(g, Generator::Linear(_, j) if *j == i) && !q.is_zero())
                })
                .collect();
            let along = |s: &mut Setting<'_>, i: usize| -> String {
                let Some(at) = s.position(Generator::Translation(i)) else { return "0".into() };
                let terms: Vec<(ExprId, Rational)> = (group.fields.iter().zip(&section.symbols))
                    .map(|(f, symbol)| (s.graph.sym(*symbol), f.coefficients[at].clone()))
                    .collect();
                let sum = s.graph.linear_combination(&terms);
                s.spelled(sum)
            };
            let name = |i: usize| model.base[i].name.clone();
            let of_space = match turning.first().map(|a| self.generators[group.fields[*a].pivot]) {
                Some(Generator::Left(k, _)) if i + 2 < model.base.len() => {
                    Some(&model.configurations[k].name)
                }
                _ => None,
            };
            let angle = match turning.as_slice() {
                [a] if i + 1 < model.base.len()
                    && self.is_quarter_turn(&group.fields[*a].coefficients, i) =>
                {
                    match self.generators[group.fields[*a].pivot] {
                        Generator::Translation(angle) => Some(name(angle)),
                        _ => None,
                    }
                }
                _ => None,
            };
            if turning.is_empty() {
                let rate = along(self, i);
                document(out, &model.base[i].doc);
                let _ = writeln!(out, "    reconstruct {} by {rate};", name(i));
            } else if let Some(theta) = angle {
                done.insert(i + 1);
                let (x, y) = (along(self, i), along(self, i + 1));
                let turn = format!("[[cos({theta}), -sin({theta})], [sin({theta}), cos({theta})]]");
                let _ = writeln!(out, "    reconstruct {}, {} by {turn}*[{x}, {y}];", name(i), name(i + 1));
            } else if let Some(matrix) = of_space {
                done.extend([i + 1, i + 2]);
                let rates = [0, 1, 2].map(|d| along(self, i + d)).join(", ");
                let names = [0, 1, 2].map(|d| name(i + d)).join(", ");
                let _ = writeln!(out, "    reconstruct {names} by {matrix}*[{rates}];");
            } else {
                let _ = writeln!(out, "    // Not reconstructed: `{}`.", name(i));
            }
        }
    }

    /// `qdot = sum_c xi^c W_c(q)`.
    fn write_angles(
        &mut self,
        out: &mut String,
        (group, angles): (&SymmetryGroup, &AngleGroup),
        section: &Section,
    ) {
        let model = self.model;
        let names: Vec<&str> = angles.coordinates.iter().map(|i| model.base[*i].name.as_str()).collect();
        if angles.body.is_empty() {
            let _ = writeln!(out, "    // Not reconstructed: `{}`.", names.join("`, `"));
            return;
        }
        let mut rates = Vec::new();
        for d in 0..names.len() {
            let mut terms = Vec::new();
            for (field, w) in angles.fields.iter().zip(&angles.body) {
                let Some(at) = group.fields.iter().position(|f| f.pivot == field.pivot) else { continue };
                let xi = self.graph.sym(section.symbols[at]);
                terms.push(self.graph.mul(xi, w[d]));
            }
            let sum = self.graph.sum(&terms);
            rates.push(self.spelled(sum));
        }
        for i in &angles.coordinates {
            document(out, &model.base[*i].doc);
        }
        let _ = writeln!(out, "    reconstruct {} by [{}];", names.join(", "), rates.join(", "));
    }

    /// Whether a field turns `q_i`, `q_i+1` counter-clockwise and moves no other coordinate linearly along them.
    fn is_quarter_turn(&self, coefficients: &[Rational], i: usize) -> bool {
        let of = |from: usize, to: usize| {
            self.position(Generator::Linear(from, to))
                .map_or_else(Rational::zero, |at| coefficients[at].clone())
        };
        of(i, i + 1).is_one() && (-of(i + 1, i)).is_one() && of(i, i).is_zero() && of(i + 1, i + 1).is_zero()
    }
}
