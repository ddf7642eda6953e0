//! When a pivot cannot be told from the rounding errors of its terms.
//!
//! Deliberately does not know: where pivots come from, what is said when one vanishes.

use std::collections::BTreeMap;

use num_traits::{One, Signed};

use crate::expr::{ExprId, Func, Graph, Node, Rational, Section, Sign, SymbolId, sign_of};

/// For every expression, with the values of the definitions besides the definitions, a scale `s` such that its value `p` is nothing but rounding error where `s + p = s`.
///
/// With `n` terms `t_i` that is `s = n sum_i |t_i|`: the error of a sum is at most `n u sum_i |t_i|`, and `s + p = s` in
/// arithmetic of unit roundoff `u` for `|p| <= u s`, so that no constant of a number format enters. Sums that other
/// sums are made of are taken apart. Where no terms can cancel it is zero, and `0 + p = 0` says that `p` is zero.
///
/// # Source
/// Higham 2002, Accuracy and stability of numerical algorithms, section 4.2
pub(super) fn rounding_scales(
    graph: &mut Graph,
    expressions: &[ExprId],
    sections: &[Section],
    inlined: &BTreeMap<SymbolId, ExprId>,
    signs: &BTreeMap<ExprId, Sign>,
) -> Vec<ExprId> {
    let definitions: BTreeMap<SymbolId, ExprId> =
        sections.iter().flat_map(|s| &s.definitions).map(|d| (d.symbol, d.expr)).collect();
    let scales = expressions.iter().map(|e| {
        let terms = terms(graph, *e, &definitions);
        let mut signs_met = [false; 2];
        let mut sizes = Vec::with_capacity(terms.len());
        for (term, q) in &terms {
            // Signs show when definitions are put in: `gamma1 Z1` is a square when `Z1 = gamma1/I1`.
            let value = graph.subs(*term, inlined).unwrap_or(*term);
            let size = match sign_of(graph, value, signs) {
                Sign::Positive | Sign::NonNegative => {
                    signs_met[usize::from(q.is_negative())] = true;
                    *term
                }
                Sign::Negative | Sign::NonPositive => {
                    signs_met[usize::from(q.is_positive())] = true;
                    graph.neg(*term)
                }
                Sign::NonZero | Sign::Unknown => {
                    signs_met = [true; 2];
                    graph.func(Func::Abs, *term)
                }
            };
            sizes.push((size, q.abs() * Rational::from_integer(terms.len().into())));
        }
        if terms.len() > 1 && signs_met == [true; 2] {
            graph.linear_combination(&sizes)
        } else {
            graph.zero()
        }
    });
    scales.collect()
}

/// The terms that an expression is a sum of, with their coefficients, seen through the names of sums.
fn terms(graph: &Graph, e: ExprId, definitions: &BTreeMap<SymbolId, ExprId>) -> Vec<(ExprId, Rational)> {
    let mut terms = Vec::new();
    let mut pending = vec![(e, Rational::one())];
    while let Some((e, q)) = pending.pop() {
        match graph.node(e) {
            Node::Sum { constant, terms: inner } => {
                pending.extend(inner.iter().map(|(t, c)| (*t, &q * c)));
                pending.push((graph.one(), q * constant));
            }
            Node::Symbol(s) => match definitions.get(s).map(|d| (d, graph.node(*d))) {
                Some((d, Node::Sum { .. } | Node::Symbol(_))) => pending.push((*d, q)),
                _ => terms.push((e, q)),
            },
            _ => terms.push((e, q)),
        }
    }
    terms.retain(|(_, q)| *q != Rational::default());
    terms
}

#[cfg(test)]
mod tests {
    use crate::scene::{self, BuiltScene};
    use crate::spec;

    fn built(text: &str) -> BuiltScene {
        let model = spec::parse("m", text).expect("a valid model");
        scene::build(&model, scene::DEFAULT).expect("a scene")
    }

    #[test]
    fn a_pivot_that_is_rounding_error_alone_is_refused() {
        // The second pivot is y - x^2.
        let scene = built(
            "model m {
                coordinate x, y in real;
                coordinate a, b in real;
                lagrangian = 1/2*(x_dot^2 + y_dot^2 + a_dot^2) + x*a_dot*b_dot + y/2*b_dot^2;
            }",
        );
        let interpreter = scene.prepare(&[]).expect("no parameters");
        let at = |x: f64, y: f64| {
            let state = scene.state_names().iter().map(|name| match name.as_str() {
                "x" => x,
                "y" => y,
                _ => 0.5,
            });
            interpreter.check(0.0, &state.collect::<Vec<_>>())
        };
        // 0.1^2 is not exact: the difference is about 1e-18.
        assert_ne!(f64::mul_add(0.1, 0.1, -0.1 * 0.1), 0.0);
        assert!(at(0.1, 0.1 * 0.1).is_err());
        // What can be told from rounding errors is a value.
        assert_eq!(at(0.1, 0.1 * 0.1 * (1.0 + 8.0 * f64::EPSILON)), Ok(()));
        assert!(at(0.0, 0.0).is_err());
    }

    #[test]
    fn pivots_that_are_sums_of_positive_terms_are_not_asked_for() {
        // The second pivot is c - c^2 d^2/(I + c d^2) = c I/(I + c d^2).
        let scene = built(
            "model m {
                param I = 1 where I > 0;
                param c = 2 where c > 0;
                param d = 3;
                coordinate a, b in real;
                lagrangian = 1/2*((I + c*d^2)*a_dot^2 + c*b_dot^2) + c*d*a_dot*b_dot;
            }",
        );
        let conditions: Vec<&str> =
            scene.program.prepare.conditions.iter().map(|c| c.text.as_str()).collect();
        assert_eq!(conditions, ["I > 0", "c > 0"]);
        // Eliminated as it stands, nothing would be left of c.
        let interpreter = scene.prepare(&[1.0, 1.0, 1e9]).expect("allowed parameters");
        assert_eq!(interpreter.check(0.0, &[0.0; 4]), Ok(()));
    }
}
