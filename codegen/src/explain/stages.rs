//! Everything that each stage of the pipeline made of a scene, as text: for whoever looks for the place of a mistake.
//!
//! Does not know: how any of it was computed.

use std::fmt::{Debug, Write as _};

use hamel_expr::{ExprId, Graph, Style};
use hamel_lang::spec::Model;

use crate::scene::BuiltScene;

/// The expressions of the model, of the system on its algebroid, the definitions of the equations, and the program.
///
/// Expressions that are zero are left out. Names of roles and parts are those of
/// [`ExpressionRole`](hamel_lang::spec::ExpressionRole) and [`Part`](hamel_mechanics::reduction::Part).
pub fn stages(model: &Model, scene: &BuiltScene) -> String {
    let whole = scene.whole();
    let scene = whole.as_deref().unwrap_or(scene);
    let mut text = String::new();
    title(&mut text, "model");
    let roles = model.expressions();
    expressions(&mut text, &model.graph, roles.into_iter());
    title(&mut text, "reduction: the system on its Lie algebroid");
    let equations = &scene.equations;
    let mut system = equations.system.clone();
    let parts: Vec<_> = system.expressions_mut().1.into_iter().map(|(part, e)| (part, *e)).collect();
    let algebroid = &system.algebroid;
    let names = |symbols: &mut dyn Iterator<Item = String>| symbols.collect::<Vec<_>>().join(", ");
    let base = names(&mut algebroid.base().iter().map(|x| system.graph.name(*x).to_owned()));
    let _ = writeln!(text, "  base: {base}");
    let velocities = names(&mut system.velocities.iter().map(|y| system.graph.name(*y).to_owned()));
    let _ = writeln!(text, "  velocities: {velocities}");
    expressions(&mut text, &system.graph, parts.into_iter());
    title(&mut text, "equations: definitions in order");
    let graph = &equations.system.graph;
    for section in &equations.sections {
        let _ = writeln!(text, "  {}", section.title);
        for definition in &section.definitions {
            let (name, value) = (graph.name(definition.symbol), graph.display(definition.expr, Style::Plain));
            let _ = writeln!(text, "    {name} = {value}");
        }
    }
    for component in &scene.state {
        let _ = writeln!(
            text,
            "  d/dt {} = {}",
            component.name,
            graph.display(component.derivative, Style::Plain)
        );
    }
    let _ = writeln!(text, "  energy = {}", graph.display(equations.energy, Style::Plain));
    title(&mut text, "program");
    for line in scene.program.to_string().lines() {
        let _ = writeln!(text, "  {line}");
    }
    text
}

fn title(text: &mut String, title: &str) {
    let _ = writeln!(text, "{}== {title}", if text.is_empty() { "" } else { "\n" });
}

/// A line for each expression that is not zero.
fn expressions(text: &mut String, graph: &Graph, of: impl Iterator<Item = (impl Debug, ExprId)>) {
    for (role, e) in of.filter(|(_, e)| *e != graph.zero()) {
        let _ = writeln!(text, "  {role:?}: {}", graph.display(e, Style::Plain));
    }
}
