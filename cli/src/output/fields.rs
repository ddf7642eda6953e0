//! Functions on surfaces that a model shows, over the time of a simulation.
//!
//! Does not know: how pictures are drawn, how a simulation was done.

use std::collections::BTreeMap;

use hamel_codegen::spec::{FluidSurface, MatrixFluid, ViewShape};

use super::plot::Surface;
use super::plot::field::Field;
use hamel_run::info::Info;
use hamel_run::model::units::split_unit;
use hamel_run::model::{Model, roles};
use hamel_run::simulation::{SimulateRequest, SimulateResponse};

/// The fields of a model at all samples, and the names of those that need more than the scene's state.
pub fn fields(
    model: &Model,
    info: &Info,
    request: &SimulateRequest,
    response: &SimulateResponse,
) -> (Vec<Field>, Vec<String>) {
    let names = info.param_names().into_iter().map(str::to_owned);
    let given: BTreeMap<String, f64> = names.zip(request.params.iter().copied()).collect();
    let params = roles::all_params(model, &info.scene, &given);
    let time = model.graph.name(model.time);
    let (mut fields, mut missing) = (Vec::new(), Vec::new());
    for view in &model.views.list {
        let ViewShape::Field { waves, .. } = &view.shape else { continue };
        let frames: Option<Vec<(f64, Vec<f64>)>> = response
            .samples
            .iter()
            .map(|sample| {
                let value = |name: &str| match info.state.iter().position(|s| s == name) {
                    Some(k) => Some(sample.state[k]),
                    None if name == time => Some(sample.t),
                    None => params.get(name).copied(),
                };
                Some((sample.t, model.views.numbers_at(view, value)?))
            })
            .collect();
        let surface = Surface::Torus { waves: waves.clone() };
        match frames {
            Some(frames) => fields.push(titled(&view.doc, &view.name, surface, frames)),
            None => missing.push(view.name.clone()),
        }
    }
    (fields, missing)
}

/// Vorticity and carried fields of a fluid that is moved as products of matrices, at the times for which all
/// coefficients are there.
pub fn of_matrices(fluid: &MatrixFluid, frames: &[(f64, Vec<Vec<f64>>)]) -> Vec<Field> {
    let surface = || match fluid.surface {
        FluidSurface::Torus => {
            let waves = fluid.surface.waves(fluid.n).into_iter();
            Surface::Torus { waves: waves.filter(|w| !w.is_second).map(|w| w.wave).collect() }
        }
        FluidSurface::Sphere => Surface::Sphere { n: fluid.n },
    };
    let carried = fluid.carried.iter().map(|field| (field.doc.as_str(), field.name.as_str()));
    let all = std::iter::once((fluid.vorticity.as_str(), "Vorticity")).chain(carried).enumerate();
    let of_field = |k: usize| frames.iter().map(|(t, fields)| (*t, fields[k].clone())).collect();
    all.map(|(k, (doc, name))| titled(doc, name, surface(), of_field(k))).collect()
}

/// A field with the title that its documentation has, otherwise with its name.
fn titled(doc: &str, name: &str, surface: Surface, frames: Vec<(f64, Vec<f64>)>) -> Field {
    let (doc, unit) = split_unit(doc, 0);
    let title = if doc.is_empty() { name.to_owned() } else { doc };
    let title = if unit.is_empty() { title } else { format!("{title} [{unit}]") };
    Field { title, unit, surface, frames }
}
