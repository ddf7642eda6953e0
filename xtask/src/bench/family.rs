//! Systems of growing dimension as texts of models, and what was measured of one.
//!
//! Does not know: how anything is derived, measured or shown.

use std::fmt::Write as _;
use std::time::Duration;

/// A family of systems of growing dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    /// so(n), a diagonal metric: the free rigid body in n dimensions.
    Rotations,
    /// su(n), a diagonal metric.
    Unitary,
    /// Strictly upper triangular matrices, a diagonal metric.
    Nilpotent,
    /// The same by stages, along the lower central series.
    Chain,
    /// so(n), a metric with all entries different from zero.
    Coupled,
}

impl Family {
    /// All of them.
    pub(crate) const ALL: [Family; 5] =
        [Family::Rotations, Family::Unitary, Family::Nilpotent, Family::Chain, Family::Coupled];

    /// Its name in tables.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Family::Rotations => "so(n)",
            Family::Unitary => "su(n)",
            Family::Nilpotent => "nilpotent",
            Family::Chain => "nilpotent by stages",
            Family::Coupled => "so(n), dense metric",
        }
    }

    /// Sizes of the matrices, from small to large; a parameter of a model has at most 200 components, which bounds the
    /// last family.
    pub(super) fn sizes(self, short: bool) -> &'static [usize] {
        let sizes: &[usize] = match self {
            Family::Rotations => &[5, 6, 8, 10, 12, 13],
            Family::Unitary => &[3, 4, 6, 7, 8],
            Family::Nilpotent | Family::Chain => &[5, 6, 8, 10, 12, 13],
            Family::Coupled => &[4, 5, 6],
        };
        if short { &sizes[..2] } else { sizes }
    }

    /// The dimension of the algebra for matrices of that size.
    pub(super) fn dim(self, n: usize) -> usize {
        match self {
            Family::Unitary => n * n - 1,
            _ => n * (n - 1) / 2,
        }
    }

    /// The system as the text of a model.
    pub(crate) fn text(self, n: usize) -> String {
        let dim = self.dim(n);
        let algebra = match self {
            Family::Rotations | Family::Coupled => rotations(n),
            Family::Unitary => format!("algebra g = su({n});\n"),
            Family::Nilpotent | Family::Chain => triangular(n),
        };
        let metric = match self {
            Family::Coupled => {
                // Diagonally dominant: the sum of 1/(i + j)^2 over a row is less than 1.
                let entry = |i: usize, j: usize| {
                    if i == j { format!("{}/4", 8 + i) } else { format!("1/{}", (i + j + 2).pow(2)) }
                };
                let upper = (0..dim).flat_map(|i| (i..dim).map(move |j| entry(i, j)));
                format!("symmetric({dim}) = [{}]", upper.collect::<Vec<_>>().join(", "))
            }
            _ => {
                let moments = (0..dim).map(|i| format!("{}/4", 4 + i)).collect::<Vec<_>>().join(", ");
                let positive = (1..=dim).map(|i| format!("I{i} > 0")).collect::<Vec<_>>().join(", ");
                format!("diagonal({dim}) = [{moments}] where {positive}")
            }
        };
        let mut stages = String::new();
        if self == Family::Chain {
            stages.push_str("stage s0;\n");
            // The first n - 1 elements lie on the first diagonal, n - 2 on the next one, and so on.
            let mut first = 1;
            for k in 1..n - 1 {
                first += n - k;
                let ideal = (first..=dim).map(|i| format!("xi{i}")).collect::<Vec<_>>().join(", ");
                let _ = writeln!(stages, "stage s{k} = ideal({ideal});");
            }
        }
        format!(
            "model scaling {{\n{algebra}param I: {metric};\nvelocity xi in g;\n{stages}lagrangian = 1/2*dot(xi, I*xi);\n}}\n"
        )
    }
}

/// An algebra by the commutators of `E_ij - E_ji`, `i < j`.
fn rotations(n: usize) -> String {
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect();
    by_brackets(&pairs, |(i, j), (k, l)| {
        let unit = |a: usize, b: usize, sign: i8| if a < b { ((a, b), sign) } else { ((b, a), -sign) };
        let terms = [(j == k, i, l, 1), (i == l, j, k, 1), (j == l, i, k, -1), (i == k, j, l, -1)];
        terms.into_iter().find(|(there, a, b, _)| *there && a != b).map(|(_, a, b, sign)| unit(a, b, sign))
    })
}

/// An algebra by the commutators of `E_ij`, `i < j`, diagonal by diagonal.
fn triangular(n: usize) -> String {
    let pairs: Vec<(usize, usize)> = (1..n).flat_map(|d| (0..n - d).map(move |i| (i, i + d))).collect();
    by_brackets(&pairs, |(i, j), (k, l)| match () {
        () if j == k => Some(((i, l), 1)),
        () if l == i => Some(((k, j), -1)),
        () => None,
    })
}

/// An algebra with a basis element for each pair, in which brackets of these are basis elements up to a sign.
fn by_brackets(
    pairs: &[(usize, usize)],
    bracket: impl Fn((usize, usize), (usize, usize)) -> Option<((usize, usize), i8)>,
) -> String {
    let place = |pair| pairs.iter().position(|p| *p == pair).map(|k| k + 1);
    let basis: Vec<String> = (1..=pairs.len()).map(|k| format!("e{k}")).collect();
    let mut text = format!("algebra g {{\nbasis {};\n", basis.join(", "));
    for (a, x) in pairs.iter().enumerate() {
        for (b, y) in pairs.iter().enumerate().skip(a + 1) {
            if let Some((pair, sign)) = bracket(*x, *y)
                && let Some(c) = place(pair)
            {
                let minus = if sign < 0 { "-" } else { "" };
                let _ = writeln!(text, "[e{}, e{}] = {minus}e{c};", a + 1, b + 1);
            }
        }
    }
    text + "}\n"
}

/// What was measured of one system.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    /// The family.
    pub(crate) family: Family,
    /// Dimension of the algebra, which is that of the state.
    pub(crate) dim: usize,
    /// Operations of one call of the right-hand side.
    pub(crate) operations: usize,
    /// Operations of all functions and of the part that runs once.
    pub(crate) all_operations: usize,
    /// Time from the text of the model to the text of the module.
    pub(crate) generation: Duration,
    /// Lines of the module.
    pub(crate) lines: usize,
    /// Time that rustc takes for the whole program, optimised.
    pub(crate) rustc: Duration,
    /// Nanoseconds of one call of the right-hand side in the fastest round.
    pub(crate) ns: f64,
}

impl Row {
    /// The faster time of each kind from two measurements of one system.
    pub(super) fn or_faster(self, other: &Row) -> Row {
        Row {
            generation: self.generation.min(other.generation),
            rustc: self.rustc.min(other.rustc),
            ns: self.ns.min(other.ns),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Family;
    use hamel_codegen::spec;

    #[test]
    fn every_family_is_a_model_of_its_dimension() {
        for family in Family::ALL {
            for n in &family.sizes(false)[..2] {
                let text = family.text(*n);
                let model = spec::parse("scaling.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
                let params: usize = model.params.len();
                let metric = |dim: usize| if family == Family::Coupled { dim * (dim + 1) / 2 } else { dim };
                assert_eq!(params, metric(family.dim(*n)), "{} {n}", family.name());
            }
        }
    }
}
