//! Variations of velocities and covariant derivatives of momenta by stages, in the notation of Cendra and Diaz, each
//! part with a name, and their sums compared with the bracket of the algebroid and with the vertical equations.
//!
//! Deliberately does not know: how stage forms come about, how anything is printed.

use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::spec::Side;

use crate::reduction::{ReducedSystem, Stages};

use super::equations::Equations;
use super::vertical::{VerticalEquations, unit_vectors, unused_stem};

/// The variation of the velocity `v = eta + A xdot` along a variation `delta x`, `zeta` of shape and group, and the
/// covariant derivatives of the momentum.
///
/// # Source
/// Cendra, Diaz, (17), (24), (33), (34) and appendix A.
#[derive(Clone, Debug)]
pub struct Variations {
    /// Owner of the expressions: the graph of the equations and more.
    pub graph: Graph,
    /// `zeta_k`.
    pub zeta: Vec<SymbolId>,
    /// `delta x^i`.
    pub shape: Vec<SymbolId>,
    /// The parts of `delta v` beside `dzeta/dt` that do not vanish.
    pub parts: Vec<VariationPart>,
    /// `D beta/Dt - dbeta/dt` and `<beta, [v, f_k]>`, by elements, where there is a connection.
    pub covariant: Vec<(ExprId, ExprId)>,
}

/// A part of `delta v` in one level.
#[derive(Clone, Debug)]
pub struct VariationPart {
    /// The level that it is in.
    pub level: usize,
    /// What it is.
    pub kind: VariationKind,
    /// Its components along the adapted basis.
    pub value: Vec<(usize, ExprId)>,
}

/// What a part of a variation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VariationKind {
    /// `[eta^i, zeta^i]` in the level.
    Bracket,
    /// `a_j(eta^j, zeta^j)`, of which the variation has minus.
    Curvature(usize),
    /// `b_j(eta^j, sum_{k>j} zeta^k)`.
    Vertical(usize),
    /// `b_j(zeta^j, sum_{k>j} eta^k)`, of which the variation has minus.
    Exchanged(usize),
    /// `B(delta x, xdot)`.
    ShapeCurvature,
    /// `[A(delta x), v]`.
    ShapeBracket,
}

impl VariationKind {
    /// Whether the variation has minus it.
    pub fn is_negative(self) -> bool {
        matches!(self, VariationKind::Curvature(_) | VariationKind::Exchanged(_))
    }

    /// Whether it is made of the forms of the levels, in which every bracket changes sign for a right action.
    pub fn is_of_levels(self) -> bool {
        match self {
            VariationKind::Bracket
            | VariationKind::Curvature(_)
            | VariationKind::Vertical(_)
            | VariationKind::Exchanged(_) => true,
            VariationKind::ShapeCurvature | VariationKind::ShapeBracket => false,
        }
    }
}

struct Writer<'a> {
    system: &'a ReducedSystem,
    stages: &'a Stages,
    n: usize,
    g: Graph,
    /// Velocities of the system.
    y: Vec<ExprId>,
    eta: Vec<ExprId>,
    zeta: Vec<ExprId>,
    delta: Vec<ExprId>,
    parts: Vec<VariationPart>,
}

impl Variations {
    /// The variations of a system with stages in the frame of its model, where their parts are seen to add up.
    pub fn new(equations: &Equations, vertical: &VerticalEquations) -> Option<Variations> {
        let system = &equations.system;
        let stages = system.stages.as_ref().filter(|_| system.frame.is_none())?;
        let mut g = vertical.graph.clone();
        let dim = stages.basis.len();
        let n = system.velocities.len() - dim;
        let stem = unused_stem(equations, "zeta");
        let zeta: Vec<SymbolId> = (1..=dim).map(|k| g.symbol(&format!("{stem}{k}"))).collect();
        let names: Vec<String> =
            system.algebroid.base()[..n].iter().map(|x| format!("delta_{}", g.name(*x))).collect();
        let shape: Vec<SymbolId> = names.iter().map(|name| g.symbol(name)).collect();
        let eta = vertical.velocities.iter().map(|d| g.sym(d.symbol)).collect();
        let [along, delta] =
            [&zeta, &shape].map(|list| -> Vec<ExprId> { list.iter().map(|s| g.sym(*s)).collect() });
        let mut writer = Writer {
            system,
            stages,
            n,
            g,
            y: vertical.frame_velocities.clone(),
            eta,
            zeta: along,
            delta,
            parts: Vec::new(),
        };
        writer.of_levels();
        writer.of_shape(vertical);
        writer.is_whole()?;
        let covariant = writer.covariant(vertical)?;
        let Writer { g: graph, parts, .. } = writer;
        Some(Variations { graph, zeta, shape, parts, covariant })
    }
}

impl Writer<'_> {
    /// Keeps what does not vanish of a vector, level by level.
    fn part(&mut self, kind: VariationKind, value: &[ExprId]) {
        for (level, of_level) in self.stages.levels.iter().enumerate() {
            let mut components = Vec::new();
            for k in of_level.range.clone() {
                let e = self.g.cancel_zero(value[k]);
                if e != self.g.zero() {
                    components.push((k, e));
                }
            }
            if !components.is_empty() {
                self.parts.push(VariationPart { level, kind, value: components });
            }
        }
    }

    /// `[eta, zeta]` by the forms of the levels.
    fn of_levels(&mut self) {
        let zeros = vec![self.g.zero(); self.eta.len()];
        for (j, level) in self.stages.levels.iter().enumerate() {
            let g = &mut self.g;
            let mut contracted = |tensor: &[(usize, usize, usize, ExprId)], x: &[ExprId], y: &[ExprId]| {
                let mut total = zeros.clone();
                for (a, b, c, value) in tensor {
                    let term = g.product(&[*value, x[*a], y[*b]]);
                    total[*c] = g.add(total[*c], term);
                }
                total
            };
            let (eta, zeta) = (&self.eta, &self.zeta);
            let values = [
                (VariationKind::Bracket, contracted(&level.quotient_bracket, eta, zeta)),
                (VariationKind::Curvature(j), contracted(&level.curvature, eta, zeta)),
                (VariationKind::Vertical(j), contracted(&level.vertical_connection, eta, zeta)),
                (VariationKind::Exchanged(j), contracted(&level.vertical_connection, zeta, eta)),
            ];
            for (kind, value) in values {
                self.part(kind, &value);
            }
        }
    }

    /// The group velocity and the connection along the base.
    fn velocity(&mut self, along: &[Vec<ExprId>]) -> Vec<ExprId> {
        let rates = self.y[..self.n].to_vec();
        self.shifted(&self.eta.clone(), along, &rates)
    }

    fn shifted(&mut self, x: &[ExprId], along: &[Vec<ExprId>], rates: &[ExprId]) -> Vec<ExprId> {
        let mut total = x.to_vec();
        for (column, rate) in along.iter().zip(rates) {
            for (total, a) in total.iter_mut().zip(column) {
                let term = self.g.mul(*a, *rate);
                *total = self.g.add(*total, term);
            }
        }
        total
    }

    /// `[x, y]` in the adapted basis, with the sign of the side.
    fn bracket(&mut self, x: &[ExprId], y: &[ExprId]) -> Vec<ExprId> {
        let value = self.stages.rebuilt_bracket(&mut self.g, x, y);
        match self.system.side {
            Side::Left => value,
            Side::Right => value.into_iter().map(|e| self.g.neg(e)).collect(),
        }
    }

    /// `B(delta x, xdot)` and `[A(delta x), v]`.
    fn of_shape(&mut self, vertical: &VerticalEquations) {
        if vertical.along_shape.coefficients.is_empty() {
            return;
        }
        let mut curved = vec![self.g.zero(); self.eta.len()];
        for ((i, j), value) in &vertical.along_shape.curved {
            let [x, y] = [*i, *j].map(|k| self.y[k]);
            let forward = self.g.mul(self.delta[*i], y);
            let backward = self.g.mul(self.delta[*j], x);
            let area = self.g.sub(forward, backward);
            for (total, b) in curved.iter_mut().zip(value) {
                let term = self.g.mul(*b, area);
                *total = self.g.add(*total, term);
            }
        }
        self.part(VariationKind::ShapeCurvature, &curved);
        let coefficients = vertical.along_shape.coefficients.clone();
        let zeros = vec![self.g.zero(); self.eta.len()];
        let along = self.shifted(&zeros, &coefficients, &self.delta.clone());
        let v = self.velocity(&coefficients);
        let bracket = self.bracket(&along, &v);
        self.part(VariationKind::ShapeBracket, &bracket);
    }

    /// Whether the parts are `C^a_bc y^b s^c` of the velocity `y` and the section `s` of the variation.
    fn is_whole(&mut self) -> Option<()> {
        let (n, dim) = (self.n, self.eta.len());
        let (basis, inverse) = (&self.stages.basis, &self.stages.inverse);
        let y = self.y.clone();
        let mut section = self.delta.clone();
        for a in 0..dim {
            let column: Vec<ExprId> = basis.iter().map(|f| f[a]).collect();
            section.push(self.g.dot(&column, &self.zeta));
        }
        let mut expected = vec![self.g.zero(); dim];
        for b in 0..y.len() {
            for c in (0..y.len()).filter(|c| *c != b) {
                for (a, value) in self.system.algebroid.bracket(&mut self.g, b, c) {
                    let term = self.g.product(&[value, y[b], section[c]]);
                    expected[a - n] = self.g.add(expected[a - n], term);
                }
            }
        }
        let mut rest = Vec::with_capacity(dim);
        for k in 0..dim {
            let column: Vec<ExprId> = inverse.iter().map(|row| row[k]).collect();
            rest.push(self.g.dot(&expected, &column));
        }
        let is_right = self.system.side == Side::Right;
        for part in self.parts.clone() {
            let is_negative = part.kind.is_negative() ^ (is_right && part.kind.is_of_levels());
            for (k, e) in part.value {
                rest[k] = if is_negative { self.g.add(rest[k], e) } else { self.g.sub(rest[k], e) };
            }
        }
        rest.iter().all(|e| self.g.is_zero(*e)).then_some(())
    }

    /// `<beta, [A xdot, f_k]>` and `<beta, [v, f_k]>`, whose difference is minus the right side of the vertical
    /// equation without what acts from outside.
    fn covariant(&mut self, vertical: &VerticalEquations) -> Option<Vec<(ExprId, ExprId)>> {
        if vertical.along_shape.coefficients.is_empty() {
            return Some(Vec::new());
        }
        let coefficients = vertical.along_shape.coefficients.clone();
        let beta: Vec<ExprId> = vertical.momenta.iter().map(|d| self.g.sym(d.symbol)).collect();
        let zeros = vec![self.g.zero(); self.eta.len()];
        let rates = self.y[..self.n].to_vec();
        let along = self.shifted(&zeros, &coefficients, &rates);
        let v = self.velocity(&coefficients);
        let right = self.stages.vertical_equations(&mut self.g, &self.eta, &beta);
        let elements = unit_vectors(&self.g, self.eta.len());
        let mut found = Vec::new();
        for (element, right) in elements.iter().zip(right) {
            let right = if self.system.side == Side::Right { self.g.neg(right) } else { right };
            let [turned, moved] = [&along, &v].map(|x| {
                let bracket = self.bracket(x, element);
                self.g.dot(&bracket, &beta)
            });
            let difference = self.g.sub(moved, turned);
            self.g.is_equal(difference, right).then_some(())?;
            found.push((turned, moved));
        }
        Some(found)
    }
}
