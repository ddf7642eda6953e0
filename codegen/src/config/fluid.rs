//! Files of fluids that are moved as products of matrices.
//!
//! Does not know: models with equations, what the module of a fluid contains.

use super::Config;
use super::bundle::{Bundle, emission};
use super::problems::{Problem, Problems};
use crate::certify;
use hamel_expr::{Rational, rational_to_f64};
use hamel_lang::spec::{FluidField, FluidSurface, FluidTerm, FluidTrace, FluidWave, MatrixFluid};
use hamel_program::emit::{
    self, CarriedText, FluidModeText, FluidTermText, FluidText, SurfaceText, TraceText,
};
use num_traits::{One, Zero};

impl Config {
    /// Adds the modules of fluids that are moved as products of matrices; their size does not depend on that of the
    /// matrices. They are no scenes, so that no index has them. Each is held to the text of its model before.
    ///
    /// ```
    /// let text = "model flow { algebra g = zeitlin_sphere(256); momentum w in g as *; action right;
    ///     hamiltonian = -1/2*dot(w, laplacian(g)^-1*w); initial c_5_4 = 0.3; }";
    /// let fluid = hamel_codegen::spec::matrix_fluid("flow.hamel", text).unwrap().unwrap();
    /// let mut bundle = hamel_codegen::config::Bundle::default();
    /// hamel_codegen::Config::new().add_fluids(&[fluid], &mut bundle).unwrap();
    /// assert!(bundle.files["flow.rs"].contains("pub const N: usize = 256;"));
    /// ```
    ///
    /// # Errors
    /// [`Problem::SameModule`], [`Problem::Emission`].
    pub fn add_fluids(&self, fluids: &[MatrixFluid], bundle: &mut Bundle) -> Result<(), Problems> {
        for fluid in fluids {
            let file = format!("{}.rs", fluid.name);
            if bundle.files.contains_key(&file) {
                let scenes = ["a model", "a fluid of matrices"].map(|what| format!("{what}, {}", fluid.name));
                return Err(Problem::SameModule { module: fluid.name.clone(), scenes }.into());
            }
            let text = certify::fluid(fluid).and_then(|()| emit::emit_fluid(&self.text_of(fluid)));
            let text = text.map_err(|source| emission(&fluid.name, source))?;
            bundle.files.insert(file, text);
        }
        Ok(())
    }

    fn text_of(&self, fluid: &MatrixFluid) -> FluidText {
        let value = |wave: FluidWave, value: &Rational| FluidTermText {
            wave: wave.wave,
            is_second: wave.is_second,
            value: rational_to_f64(value),
        };
        let terms = |list: &[FluidTerm]| list.iter().map(|term| value(term.wave, &term.value)).collect();
        let number = |field: FluidField| match field {
            FluidField::Vorticity => None,
            FluidField::Carried(k) => Some(k),
        };
        let carried = fluid.carried.iter().map(|field| CarriedText {
            name: field.name.clone(),
            current: field.is_active().then(|| field.current.iter().map(rational_to_f64).collect()),
            constant: terms(&field.constant),
        });
        let is_ideal = fluid.scale.is_one() && fluid.shift.is_zero();
        let command = match &self.writing.command {
            Some(command) => format!("{command} {}", fluid.name),
            None => format!("do not edit, change the model {}", fluid.name),
        };
        FluidText {
            model: fluid.name.clone(),
            command,
            runtime: self.writing.runtime.clone().unwrap_or_default(),
            doc: fluid.doc.clone(),
            sources: fluid.sources.clone(),
            surface: match fluid.surface {
                FluidSurface::Torus => SurfaceText::Torus,
                FluidSurface::Sphere => SurfaceText::Sphere,
            },
            n: fluid.n,
            vorticity: fluid.vorticity.clone(),
            params: fluid.params.iter().map(|p| (p.name.clone(), rational_to_f64(&p.value))).collect(),
            stream: (!is_ideal).then(|| [&fluid.scale, &fluid.shift].map(rational_to_f64)),
            background: terms(&fluid.background),
            carried: carried.collect(),
            friction: fluid.friction.iter().map(rational_to_f64).collect(),
            force: terms(&fluid.force),
            modes: (fluid.modes.iter())
                .map(|m| FluidModeText {
                    name: m.name.clone(),
                    field: number(m.field),
                    term: value(m.wave, &m.initial),
                })
                .collect(),
            casimirs: (fluid.casimirs.iter())
                .map(|c| {
                    let (field, is_cross) = match c.trace {
                        FluidTrace::Power(field, _) => (number(field), false),
                        FluidTrace::Cross(k, _) => (Some(k), true),
                    };
                    let (factor, power) = (rational_to_f64(&c.factor), c.trace.power());
                    (c.name.clone(), TraceText { factor, power, field, is_cross })
                })
                .collect(),
        }
    }
}
