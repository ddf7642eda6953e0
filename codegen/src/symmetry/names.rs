//! Names and numbers as the model language writes them.

use hamel_expr::Rational;
use hamel_lang::algebra::LieAlgebra;
use hamel_lang::spec::{Configuration, Layout};
use num_traits::{Signed, Zero};

use super::group::SymmetryGroup;

/// One name for each block, where the components of all blocks are numbered from one; the names otherwise.
pub(super) fn shortened(names: &[String], blocks: &[usize]) -> Vec<String> {
    let mut rest = names;
    let mut shorter = Vec::new();
    for size in blocks {
        let (own, after) = rest.split_at(*size);
        rest = after;
        let stem = own[0].strip_suffix('1').filter(|stem| Layout::Vector(*size).names(stem) == own);
        match (stem, size) {
            (_, 1) => shorter.push(own[0].clone()),
            (Some(stem), _) => shorter.push(stem.to_owned()),
            (None, _) => return names.to_vec(),
        }
    }
    shorter
}

/// Names of the vectors of a configuration.
pub(super) fn vectors_of(configuration: &Configuration) -> Vec<String> {
    let n_entries = configuration.group.n_blocks() * configuration.group.n() * configuration.group.n();
    let mut start = n_entries;
    let mut list = Vec::new();
    for (_, dim) in configuration.group.spaces() {
        let first = &configuration.names[start];
        list.push(if dim == 1 { first.clone() } else { first.trim_end_matches('1').to_owned() });
        start += dim;
    }
    list
}

/// A rational number as the language reads it: in decimals where these end soon.
pub(super) fn decimal(q: &Rational) -> String {
    let ten = Rational::from_integer(10.into());
    let mut scaled = q.abs();
    for digits in 0..=17usize {
        if scaled.is_integer() {
            let text = scaled.to_integer().to_string();
            let padded = format!("{text:0>width$}", width = digits + 1);
            let (whole, part) = padded.split_at(padded.len() - digits);
            let sign = if q.is_negative() { "-" } else { "" };
            return if digits == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{part}") };
        }
        scaled *= &ten;
    }
    format!("{}/{}", q.numer(), q.denom())
}

/// The algebra by its name, with the sizes of its blocks, where its constants are the group's.
pub(super) fn known_algebra(group: &SymmetryGroup) -> Option<(String, Vec<usize>)> {
    let n = group.fields.len();
    let own = |a: usize, b: usize| -> Vec<Rational> {
        let found = group.brackets.iter().find(|(x, y, _)| (*x, *y) == (a, b));
        found.map_or_else(
            || vec![Rational::zero(); n],
            |(_, _, c)| c.iter().map(|q| group.constant(q)).collect(),
        )
    };
    let mut candidates: Vec<LieAlgebra> = Vec::new();
    let bases = [LieAlgebra::so(3), LieAlgebra::se(2), LieAlgebra::se(3), LieAlgebra::su(2)];
    let bases: Vec<LieAlgebra> = bases.into_iter().filter_map(Result::ok).collect();
    candidates.push(LieAlgebra::abelian(n));
    for base in bases {
        for copies in 1..=n / base.dim() {
            let rest = n - copies * base.dim();
            let mut factors = vec![base.clone(); copies];
            if rest > 0 {
                factors.push(LieAlgebra::abelian(rest));
            }
            candidates.push(if factors.len() == 1 { base.clone() } else { LieAlgebra::product(&factors) });
        }
    }
    let fits = |algebra: &&LieAlgebra| {
        algebra.dim() == n
            && (0..n).all(|a| {
                (a + 1..n).all(|b| {
                    let mut constants = vec![Rational::zero(); n];
                    for (c, q) in algebra.bracket(a, b) {
                        constants[c] = q;
                    }
                    constants == own(a, b)
                })
            })
    };
    let found = candidates.iter().find(fits)?;
    let name = if n > 0 && found.name() == format!("R^{n}") && n == 1 {
        "R".to_owned()
    } else {
        found.name().to_owned()
    };
    Some((name, found.blocks().iter().map(|b| b.dim).collect()))
}
