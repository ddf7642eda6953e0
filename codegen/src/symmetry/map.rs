//! The map from the model to the reduced one: each variable of the reduced model as a function of the model.
//!
//! A motion of the model is `q = g w` with `w` in the cross-section. A coordinate or a velocity of the reduced model is
//! the function `f` of `q` and its velocity that the group leaves alone, `X_a f = 0`, and that is this variable at the
//! section. What advects is `a = c P(g)` with `X_a P = D_a P` and `P` one at the section. All of them are looked for
//! among products of coordinates that leave, times coordinates that stay or velocities of coordinates that leave.
//!
//! Source: Cendra, Marsden and Ratiu 2001, section 2.3, for body velocities of a trivial bundle.
//!
//! Does not know: how the map is proved to be one ([`crate::quotient`]).

use hamel_expr::{ExprId, Func, Rational, SymbolId, trace};
use hamel_lang::spec::{self, Diagnostics};
use hamel_mechanics::mechanics::NotQuotient;
use num_traits::{One, Zero};

use super::group::SymmetryGroup;
use super::modules::Module;
use super::section::Section;
use super::setting::Setting;
use super::write::{Image, Written};
use super::{ReductionMap, disagrees, item};
use crate::quotient::{Unrelated, related};

/// Products of more coordinates that leave are not tried: entries of a rotation in three angles have three.
const MAX_DEGREE: usize = 3;

/// More unknown numbers at once are not looked for.
const MAX_UNKNOWNS: usize = 1500;

/// Products of coordinates that leave, by their degree.
struct Products(Vec<Vec<ExprId>>);

impl Setting<'_> {
    /// The map with its proof; without it where the map is not found, or not seen to be one.
    ///
    /// # Errors
    /// A map that is proved to be none.
    pub(super) fn proved_map(
        &mut self,
        (group, section): (&SymmetryGroup, &Section),
        written: &Written,
    ) -> Result<Option<(ReductionMap, Vec<Image>)>, Diagnostics> {
        let Some(origin) = &self.model.origin else { return Ok(None) };
        trace::at("search for the map to the reduced model");
        let Some(images) = self.map(group, section, written) else { return Ok(None) };
        let texts: Vec<(String, String)> = images.iter().map(|i| (i.name.clone(), i.text.clone())).collect();
        let text = spec::with_items(&written.text, &item(&origin.file, &texts));
        // A function that the language does not read is none that could be written.
        let Ok(reduced) = spec::parse("reduced", &text) else { return Ok(None) };
        match related(&reduced, &reduced.totals[0], origin) {
            Ok((_, proved)) => Ok(Some((ReductionMap { images: texts, proved }, images))),
            Err(Unrelated::Texts(_)) => Ok(None),
            Err(Unrelated::Conditions(list)) => {
                let is_wrong = |c: &&NotQuotient| {
                    matches!(c, NotQuotient::Violated { is_proved: true, .. } | NotQuotient::NoImage { .. })
                };
                match list.iter().find(is_wrong) {
                    Some(condition) => Err(disagrees(self.model, &format!("{condition:?}"))),
                    None => Ok(None),
                }
            }
        }
    }

    /// The map, where it is found.
    fn map(&mut self, group: &SymmetryGroup, section: &Section, written: &Written) -> Option<Vec<Image>> {
        let model = self.model;
        let products = self.products(group, section);
        let one = self.graph.one();
        let mut images = Vec::new();
        let leaving: Vec<ExprId> =
            self.velocities_of_leaving(section).into_iter().map(|y| self.graph.sym(y)).collect();
        for (name, symbol) in section.names.iter().zip(&section.symbols) {
            let f = self.invariant((group, section), *symbol, (&products, &leaving))?;
            self.push(&mut images, name, f);
        }
        let shape: Vec<SymbolId> = section.shape.iter().map(|i| model.base[*i].symbol).collect();
        let of_shape: Vec<ExprId> =
            [one].into_iter().chain(shape.iter().map(|s| self.graph.sym(*s))).collect();
        for i in &section.shape {
            let coordinate = &model.base[*i];
            let f = self.invariant((group, section), coordinate.symbol, (&products, &of_shape))?;
            if self.push(&mut images, &coordinate.name, f) {
                let text = format!("rate({})", self.spelled(f));
                let value = self.rate_of(f);
                images.push(Image { name: coordinate.velocity_name.clone(), value, text });
            }
        }
        for (k, _) in &section.kept {
            let configuration = &model.configurations[*k];
            let entries: Vec<ExprId> = configuration.symbols.iter().map(|s| self.graph.sym(*s)).collect();
            for (name, symbol) in configuration.names.iter().zip(&configuration.symbols) {
                let f = self.invariant((group, section), *symbol, (&products, &entries))?;
                self.push(&mut images, name, f);
            }
            for b in &configuration.velocities {
                let velocity = &model.velocities[*b];
                let y = self.graph.sym(velocity.symbol);
                let f = self.invariant((group, section), velocity.symbol, (&products, &[y]))?;
                self.push(&mut images, &velocity.name, f);
            }
        }
        if let Some(marked) = &self.marked {
            let row = &model.configurations[marked.configuration].symbols[3 * marked.axis..][..3];
            for (advected, entry) in marked.advected.into_iter().zip(row) {
                let [name, text] = [advected, *entry].map(|s| self.graph.name(s).to_owned());
                images.push(Image { name, value: self.graph.sym(*entry), text });
            }
        }
        if let Some((_, module, advected)) = &written.module {
            let functions = self.advected_by(module, (group, section), &products)?;
            for (symbol, f) in advected.iter().zip(functions) {
                let name = self.graph.name(*symbol).to_owned();
                self.push(&mut images, &name, f);
            }
        }
        Some(images)
    }

    /// Adds an image, unless it is the variable of the same name.
    fn push(&self, images: &mut Vec<Image>, name: &str, f: ExprId) -> bool {
        let text = self.spelled(f);
        let is_another = text != name;
        if is_another {
            images.push(Image { name: name.to_owned(), value: f, text });
        }
        is_another
    }

    /// Velocities of the model that the section gives to the group.
    fn velocities_of_leaving(&self, section: &Section) -> Vec<SymbolId> {
        let model = self.model;
        let kept = |k: usize| section.kept.iter().any(|(of, _)| *of == k);
        let of_base =
            (0..model.base.len()).filter(|i| !section.shape.contains(i)).map(|i| self.velocities[i]);
        let of_groups = (0..model.configurations.len()).filter(|k| !kept(*k)).flat_map(|k| {
            model.configurations[k].velocities.iter().map(|b| self.velocities[model.base.len() + b])
        });
        of_base.chain(of_groups).collect()
    }

    /// Products of entries of configurations, lengths, sines and cosines of angles: of coordinates that leave.
    fn products(&mut self, group: &SymmetryGroup, section: &Section) -> Products {
        let model = self.model;
        let mut factors: Vec<ExprId> = Vec::new();
        for (k, configuration) in model.configurations.iter().enumerate() {
            if section.kept.iter().all(|(of, _)| *of != k) {
                factors.extend(configuration.symbols.iter().map(|s| self.graph.sym(*s)));
            }
        }
        for i in (0..model.base.len()).filter(|i| !section.shape.contains(i)) {
            let q = self.graph.sym(model.base[i].symbol);
            factors.push(q);
            if self.is_angle(i) || group.value_of(i).is_some() {
                factors.extend([Func::Cos, Func::Sin].map(|f| self.graph.func(f, q)));
            }
        }
        // Each product with the place of its last factor, so that none is made twice.
        let mut last: Vec<(usize, ExprId)> = vec![(0, self.graph.one())];
        let mut all = vec![vec![self.graph.one()]];
        for _ in 0..MAX_DEGREE {
            let mut next = Vec::new();
            for (from, product) in last {
                for (at, factor) in factors.iter().enumerate().skip(from) {
                    next.push((at, self.graph.mul(product, *factor)));
                }
            }
            all.push(next.iter().map(|(_, e)| *e).collect());
            last = next;
            if last.len() > MAX_UNKNOWNS {
                break;
            }
        }
        Products(all)
    }

    /// The function that the group leaves alone, with this value at the section: a sum of products times `tails`.
    fn invariant(
        &mut self,
        (group, section): (&SymmetryGroup, &Section),
        value: SymbolId,
        (products, tails): (&Products, &[ExprId]),
    ) -> Option<ExprId> {
        let zero = self.graph.zero();
        let mut target = vec![zero; group.fields.len()];
        target.push(self.graph.sym(value));
        let mut terms: Vec<ExprId> = Vec::new();
        let mut rows: Vec<Vec<ExprId>> = Vec::new();
        for of_degree in &products.0 {
            if terms.len() + of_degree.len() * tails.len() > MAX_UNKNOWNS {
                return None;
            }
            for product in of_degree {
                for tail in tails {
                    let term = self.graph.mul(*product, *tail);
                    let mut row: Vec<ExprId> = (group.fields.iter())
                        .map(|field| self.graph.derivative_along(term, &field.images))
                        .collect();
                    row.push(self.at_section(section, term));
                    terms.push(term);
                    rows.push(row);
                }
            }
            if let Some(numbers) = self.combination_of_rows(&rows, &target) {
                let sum: Vec<(ExprId, Rational)> = terms.into_iter().zip(numbers).collect();
                return Some(self.graph.linear_combination(&sum));
            }
        }
        None
    }

    /// `c P` with `X_a P = D_a P` and `P` one at the section, column by column.
    fn advected_by(
        &mut self,
        module: &Module,
        (group, section): (&SymmetryGroup, &Section),
        products: &Products,
    ) -> Option<Vec<ExprId>> {
        let (n, n_fields) = (module.basis.len(), group.fields.len());
        let zero = self.graph.zero();
        let mut columns: Vec<Option<ExprId>> = vec![None; n];
        let mut terms: Vec<(usize, ExprId)> = Vec::new();
        let mut rows: Vec<Vec<ExprId>> = Vec::new();
        for of_degree in &products.0 {
            if terms.len() + of_degree.len() * n > MAX_UNKNOWNS {
                return None;
            }
            for product in of_degree {
                let slopes: Vec<ExprId> = (group.fields.iter())
                    .map(|field| self.graph.derivative_along(*product, &field.images))
                    .collect();
                let start = self.at_section(section, *product);
                for k in 0..n {
                    // `P_kj = product`: what it adds to `X_a P_ij - sum_k D_a,ik P_kj`.
                    let mut row = vec![zero; n_fields * n + n];
                    for a in 0..n_fields {
                        for i in 0..n {
                            let q = -module.matrices[a][i][k].clone();
                            let own = if i == k { slopes[a] } else { zero };
                            let sum = [(own, Rational::one()), (*product, q)];
                            row[a * n + i] = self.graph.linear_combination(&sum);
                        }
                    }
                    row[n_fields * n + k] = start;
                    terms.push((k, *product));
                    rows.push(row);
                }
            }
            for (j, column) in columns.iter_mut().enumerate().filter(|(_, column)| column.is_none()) {
                let mut target = vec![zero; n_fields * n + n];
                target[n_fields * n + j] = self.graph.one();
                let Some(numbers) = self.combination_of_rows(&rows, &target) else { break };
                // `a_j = sum_k c_k P_kj`.
                let sum: Vec<(ExprId, Rational)> = (terms.iter().zip(numbers))
                    .map(|((k, product), q)| (*product, q * &module.start[*k]))
                    .filter(|(_, q)| !q.is_zero())
                    .collect();
                *column = Some(self.graph.linear_combination(&sum));
            }
            if columns.iter().all(Option::is_some) {
                break;
            }
        }
        columns.into_iter().collect()
    }
}
