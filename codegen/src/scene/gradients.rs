//! Functions of time and state that a scene has with their gradients.
//!
//! Deliberately does not know: which functions these are, how anything is differentiated, lowered or emitted.

use std::collections::BTreeSet;

use super::derivatives::Matrix;
use hamel_expr::differentiate::Linearisation;
use hamel_expr::{ExprId, Graph, Section, SectionWriter, SymbolId, needed_sections};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{Equations, Output, OutputKind, StateEquation};

/// Functions with their gradients, and what has to be lowered for them.
pub(super) struct WithGradients {
    /// Values, and the entries of the gradients that do not vanish identically.
    pub(super) outputs: [Output; 2],
    pub(super) gradients: Matrix,
    /// To come after the sections of the equations.
    pub(super) sections: Vec<Section>,
}

/// What functions and their gradients are called.
pub(super) struct Words {
    pub(super) want: Want,
    /// What the values are.
    pub(super) values: &'static str,
    /// Name of the matrix of the gradients, and what it is.
    pub(super) gradients: &'static str,
    pub(super) doc: &'static str,
}

/// Those of some functions, by name, that `keep` chooses by the rows of their gradients, by the components `by` of the
/// state.
pub(super) fn with_gradients(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    (functions, by): (&[(String, ExprId)], &[usize]),
    words: &Words,
    keep: impl FnOnce(&mut Graph, &[Vec<ExprId>]) -> Vec<usize>,
) -> WithGradients {
    let values: Vec<ExprId> = functions.iter().map(|(_, e)| *e).collect();
    let symbols: Vec<SymbolId> = by.iter().map(|k| state[*k].symbol).collect();
    let sections = needed_sections(g, &equations.sections, &values);
    let linear = Linearisation::new(g, &sections, &values, &symbols);
    let mut writer = SectionWriter::new(g, BTreeSet::new(), &[]);
    let name = |value: &str, input: &str| format!("d_{value}_d_{input}");
    let rows = linear.jacobian(g, &mut writer, name, |section| format!("derivatives of: {section}"));
    let (mut components, mut entries, mut pattern) = (Vec::new(), Vec::new(), Vec::new());
    for (i, k) in keep(g, &rows).into_iter().enumerate() {
        components.push(functions[k].clone());
        for (j, e) in by.iter().zip(&rows[k]).filter(|(_, e)| **e != g.zero()) {
            entries.push((name(&functions[k].0, &state[*j].name), *e));
            pattern.push((i, *j));
        }
    }
    let shape = (components.len(), state.len());
    let doc = format!(
        "entries of the gradients of the {} that do not vanish identically, row by row",
        words.want.name()
    );
    WithGradients {
        outputs: [
            Output::group(words.want, components, words.values),
            Output { kind: OutputKind::Gradients, name: words.gradients.into(), components: entries, doc },
        ],
        gradients: Matrix { name: words.gradients, shape, pattern, is_antisymmetric: false, doc: words.doc },
        sections: writer.finish().0,
    }
}
