//! What a page says about a scene, but for its motion.
//!
//! Does not know: how it is laid out.

use hamel_codegen::explain::{Section, SectionKind};
use hamel_codegen::scene;
use hamel_codegen::spec::{self, FluidField, FluidMode, FluidParam, FluidSurface, MatrixFluid};
use hamel_expr::{Style, rational_to_f64};
use hamel_program::emit::method_text;
use hamel_program::program::Role;

use hamel_run::error::Error;
use hamel_run::model::spelling::math_ml;
use hamel_run::model::units::{shown, split_unit};
use hamel_run::model::{Checked, DEFAULT_SCENE, show_warnings};

/// A parameter or a state variable as a page shows it.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// Name in the code.
    pub name: String,
    /// Name in MathML.
    pub math: String,
    /// Default, of a parameter.
    pub value: Option<f64>,
    /// Unit; may be empty.
    pub unit: String,
    /// What it is, without the unit.
    pub doc: String,
}

/// What a view draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewKind {
    /// A cuboid.
    Box,
    /// A disk.
    Disk,
    /// A ball.
    Ball,
    /// A line between two points.
    Segment,
    /// A point.
    Point,
    /// What a point leaves behind.
    Path,
}

/// A view of a model.
#[derive(Clone, Debug)]
pub struct ViewEntry {
    /// Its name.
    pub name: String,
    /// Its documentation.
    pub doc: String,
    /// What it draws.
    pub kind: ViewKind,
    /// The output of [`build_pictured`](hamel_run::interpreted::build_pictured) that has its numbers.
    pub output: String,
}

/// All that a page says about a scene, but for its motion.
#[derive(Clone, Debug)]
pub struct Page {
    /// Name of the model.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// First line of the documentation.
    pub title: String,
    /// The other lines.
    pub doc: Vec<String>,
    /// Kind of system.
    pub kind: String,
    /// Where it comes from.
    pub sources: Vec<String>,
    /// Free parameters.
    pub params: Vec<Quantity>,
    /// Conditions on them.
    pub conditions: Vec<String>,
    /// State variables.
    pub state: Vec<Quantity>,
    /// Text of the model file.
    pub text: String,
    /// Words of the model language.
    pub keywords: Vec<&'static str>,
    /// The explanation, in HTML.
    pub sections: Vec<Section>,
    /// The generated right-hand side.
    pub rhs: String,
    /// The generated module.
    pub module: String,
    /// Additions, multiplications, fused ones, divisions, roots, signs, calls and cost by function and section.
    pub operations: Vec<(String, Vec<u64>)>,
    /// What the figure in space shows.
    pub views: Vec<ViewEntry>,
}

/// What a page says about a fluid that is moved as products of matrices; `text` is its file.
pub fn of_matrices(fluid: &MatrixFluid, text: String, module: String) -> Page {
    let (surface, basis) = match fluid.surface {
        FluidSurface::Torus => ("torus", "waves"),
        FluidSurface::Sphere => ("sphere", "spherical harmonics"),
    };
    let quantity = |mode: &FluidMode| {
        let (doc, unit) = match mode.field {
            FluidField::Vorticity => split_unit(&fluid.vorticity, 0),
            FluidField::Carried(k) => split_unit(&fluid.carried[k].doc, 0),
        };
        Quantity { name: mode.name.clone(), math: math_ml(&mode.name), value: None, unit, doc }
    };
    let param = |p: &FluidParam| {
        let (doc, unit) = split_unit(&p.doc, 0);
        Quantity {
            name: p.name.clone(),
            math: math_ml(&p.name),
            value: Some(rational_to_f64(&p.value)),
            unit,
            doc,
        }
    };
    let kind = if fluid.is_damped() { "fluid with friction or force" } else { "ideal fluid" };
    let names: Vec<&str> = fluid.carried.iter().map(|field| field.name.as_str()).collect();
    let carried =
        if names.is_empty() { String::new() } else { format!(" that carries {}", names.join(", ")) };
    Page {
        model: fluid.name.clone(),
        scene: DEFAULT_SCENE.to_owned(),
        title: titled(&fluid.doc, &fluid.name),
        doc: fluid.doc.iter().skip(1).cloned().collect(),
        kind: format!(
            "{kind}{carried} on the {surface}, {basis} as matrices of size {}; the state below are the modes that the \
             model names, of {}",
            fluid.n,
            (1 + names.len()) * (fluid.n * fluid.n - 1)
        ),
        sources: fluid.sources.clone(),
        params: fluid.params.iter().map(param).collect(),
        conditions: Vec::new(),
        state: fluid.modes.iter().map(quantity).collect(),
        text,
        keywords: spec::keywords(),
        sections: Vec::new(),
        rhs: String::new(),
        module,
        operations: Vec::new(),
        views: Vec::new(),
    }
}

/// The first line of a documentation, otherwise a name.
fn titled(doc: &[String], name: &str) -> String {
    let title = doc.first().map(|t| t.trim()).filter(|t| !t.is_empty());
    title.unwrap_or(name).to_owned()
}

/// Collects what a page says about a scene.
///
/// # Errors
/// As [`Checked::derive`], and a bug of the emitter.
pub fn contents(model: &Checked, scene_name: &str) -> Result<Page, Error> {
    let scene = &*model.derive(scene_name)?;
    show_warnings(&scene::warnings(model, std::slice::from_ref(scene)));
    let quantity = |name: &str, value: Option<f64>, doc: &str| {
        let (doc, unit) = split_unit(doc, 0);
        let unit = model.units.of(name).map_or(unit, |known| shown(known.text()));
        Quantity { name: name.to_owned(), math: math_ml(name), value, unit, doc }
    };
    // The page has these in its own way.
    let own = [SectionKind::Head, SectionKind::Inputs, SectionKind::Counts];
    let sections = hamel_codegen::explain::sections(model, scene, Style::MathMl)
        .into_iter()
        .filter(|section| !own.contains(&section.kind))
        .collect();
    let module = scene.emit().map_err(|e| model.diagnostics(vec![model.diagnose(&e)]))?;
    let view = |v: &spec::View| {
        let kind = match v.shape {
            spec::ViewShape::Box { .. } => ViewKind::Box,
            spec::ViewShape::Disk { .. } => ViewKind::Disk,
            spec::ViewShape::Ball { .. } => ViewKind::Ball,
            spec::ViewShape::Segment => ViewKind::Segment,
            spec::ViewShape::Point => ViewKind::Point,
            spec::ViewShape::Path => ViewKind::Path,
            // On the torus, not in space.
            spec::ViewShape::Field { .. } => return None,
        };
        Some(ViewEntry {
            name: v.name.clone(),
            doc: v.doc.clone(),
            kind,
            output: scene::view_output(&v.name),
        })
    };
    Ok(Page {
        model: model.name.clone(),
        scene: scene_name.to_owned(),
        title: titled(&model.doc, &model.name),
        doc: model.doc.iter().skip(1).cloned().collect(),
        kind: model.kind().to_string(),
        sources: model.sources.clone(),
        params: scene
            .params()
            .iter()
            .map(|p| quantity(&p.name, Some(rational_to_f64(&p.default)), &p.doc))
            .collect(),
        conditions: scene.equations().system.conditions.iter().map(|c| c.text.clone()).collect(),
        state: scene.state().iter().map(|s| quantity(&s.name, None, &s.doc)).collect(),
        text: model.origin.as_ref().map(|o| o.text.clone()).unwrap_or_default(),
        keywords: spec::keywords(),
        sections,
        rhs: method_text(&module, &Role::Rate).unwrap_or_default(),
        operations: scene
            .operation_counts()
            .into_iter()
            .map(|(name, c)| {
                let numbers = [c.add, c.mul, c.fma, c.div, c.sqrt, c.neg, c.transcendental];
                (name, numbers.into_iter().map(|n| n as u64).chain([c.cost()]).collect())
            })
            .collect(),
        module,
        views: model.views.list.iter().filter_map(view).collect(),
    })
}
