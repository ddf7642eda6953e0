//! Where a motion of the reduced model starts, as text: the start of the model, by the map to the reduced model where
//! it is known, or else by the section.
//!
//! Does not know: how the map is found, whether both motions are one ([`super::check`]).

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use hamel_expr::{ExprId, Rational, SymbolId};
use hamel_lang::spec::group_motion::group_rates;
use hamel_lang::spec::{self, Domain, Side};
use num_traits::{One, Zero};

use super::angles::TurnedField;
use super::group::SymmetryGroup;
use super::names::decimal;
use super::section::Section;
use super::setting::{Generator, Images, Setting};
use super::write::{Image, Written, named};

/// Why the start of the model is not the one of the text.
const ELSEWHERE: &str = "the model starts elsewhere than at the identity of the group";
const OFF_CONSTRAINTS: &str = "the velocities that the model gives do not keep its constraints";
const WITHOUT_VALUE: &str = "a function of the map has no value at the start of the model";

impl Setting<'_> {
    /// The reduced model with the values that it starts at; whether these are the start of the model, or a line that
    /// says why they are not. A model without values has no start of its own.
    pub(super) fn started(
        &mut self,
        (group, section): (&SymmetryGroup, &Section),
        written: &Written,
        map: Option<&[Image]>,
    ) -> (String, Option<Result<(), String>>) {
        let reconstructed: BTreeSet<String> = spec::parse("reduced", &written.text)
            .map(|model| model.reconstruction.into_iter().flat_map(|r| r.names).collect())
            .unwrap_or_default();
        if self.model.initial.is_empty() {
            return (spec::with_items(&written.text, &self.initial_at_section(group, written)), None);
        }
        let why = match self.initial((group, section), written, map, &reconstructed) {
            Ok(items) => {
                let text = spec::with_items(&written.text, &items);
                match self.starts_alike(&named(map), &text) {
                    Ok(()) => return (text, Some(Ok(()))),
                    Err(differs) => differs,
                }
            }
            Err(why) => why.to_owned(),
        };
        let line = format!("Initial values are left out: {why}.");
        let items = format!("    // {line}\n{}", self.initial_at_section(group, written));
        (spec::with_items(&written.text, &items), Some(Err(line)))
    }

    /// Items `initial` of the start of the model, or why they are not written.
    ///
    /// `reconstructed`: names of the coordinates that the text reconstructs.
    fn initial(
        &mut self,
        (group, section): (&SymmetryGroup, &Section),
        written: &Written,
        map: Option<&[Image]>,
        reconstructed: &BTreeSet<String>,
    ) -> Result<String, &'static str> {
        let start = self.start_of_model()?;
        let mut out = String::new();
        match map {
            Some(map) => self.initial_by_map(&mut out, section, (written, map), &start)?,
            None if self.starts_at(group, section, written) => {
                out.push_str(&self.initial_at_section(&SymmetryGroup::none(Side::Left), written));
                self.initial_by_section(&mut out, (group, section), &start);
            }
            None => return Err(ELSEWHERE),
        }
        // Coordinates that leave are known where they are reconstructed, and there alone.
        for (name, symbol) in self.named_coordinates() {
            let value = start[&symbol];
            let is_base = self.model.base.iter().any(|c| c.symbol == symbol);
            let default = if is_base { self.graph.zero() } else { self.neutral(symbol) };
            if reconstructed.contains(&name) && value != default {
                let _ = writeln!(out, "    initial {name} = {};", self.spelled(value));
            }
        }
        Ok(out)
    }

    /// Items of a motion that starts at the section: what advects, and the angles of a body.
    fn initial_at_section(&self, group: &SymmetryGroup, written: &Written) -> String {
        let mut out = String::new();
        if let Some(marked) = &self.marked {
            let start = [0, 1, 2].map(|l| if l == marked.axis { "1" } else { "0" });
            let _ = writeln!(out, "    initial {} = [{}];", marked.name, start.join(", "));
        }
        if let Some((_, module, symbols)) = &written.module {
            for (symbol, start) in symbols.iter().zip(&module.start) {
                let _ = writeln!(out, "    initial {} = {};", self.graph.name(*symbol), decimal(start));
            }
        }
        if let Some(angles) = group.angles.as_ref().filter(|angles| !angles.body.is_empty()) {
            for (i, value) in angles.coordinates.iter().zip(&angles.values) {
                if *value != self.graph.zero() {
                    let name = &self.model.base[*i].name;
                    let _ = writeln!(out, "    initial {name} = {};", self.spelled(*value));
                }
            }
        }
        out
    }

    /// Coordinates of the model.
    pub(super) fn named_coordinates(&self) -> Vec<(String, SymbolId)> {
        let base = self.model.base.iter().map(|c| (c.name.clone(), c.symbol));
        let groups =
            self.model.configurations.iter().flat_map(|c| c.names.iter().cloned().zip(c.symbols.clone()));
        base.chain(groups).collect()
    }

    /// The value of a coordinate that nobody gives: zero, the identity, or the middle of an interval without zero.
    fn neutral(&mut self, symbol: SymbolId) -> ExprId {
        for configuration in &self.model.configurations {
            let n = configuration.group.n();
            let Some(e) = configuration.symbols.iter().position(|s| *s == symbol) else { continue };
            return if e < n * n && e / n == e % n { self.graph.one() } else { self.graph.zero() };
        }
        let domain = self.model.base.iter().find(|c| c.symbol == symbol).map(|c| c.domain);
        let Some(Domain::Interval(low, high)) = domain else { return self.graph.zero() };
        let is_negative = |e: ExprId| self.graph.eval_f64(e, &BTreeMap::new()).map(|x| x < 0.0);
        if is_negative(low) == Some(true) && is_negative(high) == Some(false) {
            return self.graph.zero();
        }
        let half = Rational::new(1.into(), 2.into());
        self.graph.linear_combination(&[(low, half.clone()), (high, half)])
    }

    /// Coordinates and velocities at the start of the model; velocities that it does not give follow from its
    /// constraints, or are zero.
    fn start_of_model(&mut self) -> Result<Images, &'static str> {
        let model = self.model;
        let given: BTreeMap<&str, ExprId> = model.initial.iter().map(|(n, e)| (n.as_str(), *e)).collect();
        let mut start = Images::new();
        for (name, symbol) in self.named_coordinates() {
            let value = given.get(name.as_str()).copied().unwrap_or_else(|| self.neutral(symbol));
            start.insert(symbol, value);
        }
        start.insert(model.time, self.graph.zero());
        let mut unknown: BTreeSet<SymbolId> = BTreeSet::new();
        for (name, symbol) in model.all_velocities() {
            match given.get(name) {
                Some(value) => _ = start.insert(symbol, *value),
                None => _ = unknown.insert(symbol),
            }
        }
        let mut rows = self.model.constraints.iter().map(|c| c.residual).collect::<Vec<_>>();
        while let Some((k, symbol)) = self.solvable(&mut rows, &start, &unknown)? {
            let (zero, row) = (self.graph.zero(), rows.remove(k));
            let slope = self.graph.diff(row, symbol);
            let rest = self.graph.subs(row, &Images::from([(symbol, zero)])).map_err(|_| OFF_CONSTRAINTS)?;
            let value = self.graph.div(rest, slope).map_err(|_| OFF_CONSTRAINTS)?;
            start.insert(symbol, self.graph.neg(value));
            unknown.remove(&symbol);
        }
        start.extend(unknown.into_iter().map(|symbol| (symbol, self.graph.zero())));
        for row in rows {
            let left = self.graph.subs(row, &start).map_err(|_| OFF_CONSTRAINTS)?;
            if !self.graph.is_zero(left) {
                return Err(OFF_CONSTRAINTS);
            }
        }
        Ok(start)
    }

    /// A constraint with one velocity that is not known, and this velocity.
    fn solvable(
        &mut self,
        rows: &mut [ExprId],
        start: &Images,
        unknown: &BTreeSet<SymbolId>,
    ) -> Result<Option<(usize, SymbolId)>, &'static str> {
        for (k, row) in rows.iter_mut().enumerate() {
            *row = self.graph.subs(*row, start).map_err(|_| OFF_CONSTRAINTS)?;
            let own: Vec<SymbolId> =
                self.graph.free_symbols(*row).into_iter().filter(|s| unknown.contains(s)).collect();
            if let [only] = own.as_slice() {
                let slope = self.graph.diff(*row, *only);
                if !self.graph.is_zero(slope) {
                    return Ok(Some((k, *only)));
                }
            }
        }
        Ok(None)
    }

    /// All variables of the reduced model as the map has them at the start.
    fn initial_by_map(
        &mut self,
        out: &mut String,
        section: &Section,
        (written, map): (&Written, &[Image]),
        start: &Images,
    ) -> Result<(), &'static str> {
        let model = self.model;
        let velocities = model.all_velocities().into_iter().map(|(name, symbol)| (name.to_owned(), symbol));
        let own: BTreeMap<String, SymbolId> =
            self.named_coordinates().into_iter().chain(velocities).collect();
        let mut names = section.reduced.clone();
        names.extend(section.shape.iter().map(|i| model.base[*i].name.clone()));
        names.extend(section.kept.iter().flat_map(|(k, _)| model.configurations[*k].names.clone()));
        let marked = self.marked.iter().flat_map(|marked| marked.advected);
        let module = written.module.iter().flat_map(|(_, _, symbols)| symbols.iter().copied());
        names.extend(marked.chain(module).map(|s| self.graph.name(s).to_owned()));
        for name in names {
            let image = map.iter().find(|image| image.name == name).map(|image| image.value);
            let same = own.get(&name).map(|symbol| self.graph.sym(*symbol));
            let value = image.or(same).ok_or(WITHOUT_VALUE)?;
            let value = self.graph.subs(value, start).map_err(|_| WITHOUT_VALUE)?;
            let _ = writeln!(out, "    initial {name} = {};", self.spelled(value));
        }
        Ok(())
    }

    /// The rate of a function of coordinates.
    pub(super) fn rate_of(&mut self, f: ExprId) -> ExprId {
        let model = self.model;
        let mut rates = Images::new();
        for (i, coordinate) in model.base.iter().enumerate() {
            rates.insert(coordinate.symbol, self.graph.sym(self.velocities[i]));
        }
        for configuration in &model.configurations {
            let entries: Vec<ExprId> = configuration.symbols.iter().map(|s| self.graph.sym(*s)).collect();
            let xi: Vec<ExprId> = (configuration.velocities.iter())
                .map(|b| self.graph.sym(model.velocities[*b].symbol))
                .collect();
            let moved = group_rates(&mut self.graph, &configuration.group, &entries, &xi, Side::Left);
            rates.extend(configuration.symbols.iter().copied().zip(moved));
        }
        self.graph.derivative_along(f, &rates)
    }

    /// Whether the model starts at the section, but for coordinates of a line that nothing of the reduced model depends
    /// on.
    fn starts_at(&mut self, group: &SymmetryGroup, section: &Section, written: &Written) -> bool {
        let model = self.model;
        let given: BTreeMap<&str, ExprId> = model.initial.iter().map(|(n, e)| (n.as_str(), *e)).collect();
        let zero = self.graph.zero();
        self.named_coordinates().into_iter().all(|(name, symbol)| {
            let (Some(wanted), Some(start)) = (section.at.get(&symbol), given.get(name.as_str())) else {
                return true;
            };
            let is_free = group.fields.iter().enumerate().all(|(a, f)| {
                let pivot = self.generators[f.pivot];
                let is_own = matches!(pivot, Generator::Translation(i) if model.base[i].symbol == symbol);
                let is_alone = f.coefficients.iter().filter(|q| !q.is_zero()).count() == 1;
                let moves_nothing = written.module.as_ref().is_none_or(|(_, module, _)| {
                    [&module.matrices, &module.twist].iter().all(|m| m[a].iter().flatten().all(Zero::is_zero))
                });
                let image = f.images.get(&symbol).copied().unwrap_or(zero);
                self.graph.as_rational(image).is_some() && (!is_own || is_alone && moves_nothing)
            });
            wanted == start || is_free && model.base.iter().any(|c| c.symbol == symbol)
        })
    }

    /// Velocities and coordinates of the reduced model for a start at the section.
    fn initial_by_section(
        &mut self,
        out: &mut String,
        (group, section): (&SymmetryGroup, &Section),
        start: &Images,
    ) {
        let model = self.model;
        let mut xi = Vec::new();
        for (field, name) in group.fields.iter().zip(&section.names) {
            let k = match self.generators[field.pivot] {
                Generator::Left(k, a) | Generator::Right(k, a) => {
                    model.base.len() + model.configurations[k].velocities[a]
                }
                Generator::Translation(i)
                | Generator::Linear(i, _)
                | Generator::Turned(TurnedField { along: i, .. }) => i,
            };
            let speed = start[&self.velocities[k]];
            xi.push(speed);
            let _ = writeln!(out, "    initial {name} = {};", self.spelled(speed));
        }
        let mut rest: Vec<(usize, String)> =
            section.shape.iter().map(|i| (*i, model.base[*i].velocity_name.clone())).collect();
        for (k, names) in &section.kept {
            let places = model.configurations[*k].velocities.iter().map(|b| model.base.len() + b);
            rest.extend(places.zip(names.iter().cloned()));
        }
        for (k, name) in rest {
            let mut terms = vec![(start[&self.velocities[k]], Rational::one())];
            for (xi, tangent) in xi.iter().zip(&section.tangents) {
                let tangent = self.graph.subs(tangent[k], start).unwrap_or(tangent[k]);
                terms.push((self.graph.mul(*xi, tangent), -Rational::one()));
            }
            let value = self.graph.linear_combination(&terms);
            let _ = writeln!(out, "    initial {name} = {};", self.spelled(value));
        }
        let shape = section.shape.iter().map(|i| (model.base[*i].name.clone(), model.base[*i].symbol));
        let kept = section.kept.iter().flat_map(|(k, _)| {
            let configuration = &model.configurations[*k];
            configuration.names.iter().cloned().zip(configuration.symbols.iter().copied())
        });
        for (name, symbol) in shape.chain(kept) {
            let _ = writeln!(out, "    initial {name} = {};", self.spelled(start[&symbol]));
        }
    }
}
