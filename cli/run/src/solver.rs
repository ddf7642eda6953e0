//! The integration method that a name stands for: [`method_of`].
//!
//! Does not know: what is integrated with a method, requests.

use std::sync::LazyLock;

use hamel_codegen::spec::Want;
use hamel_program::program::SeriesRoom;
use hamel_runtime::{
    Discrete2, Discrete4, Discrete6, Dop853, Dopri5, F64x4, F64x8, Gauss4, Gauss6, Gauss8, Gauss16,
    Gauss16With, Gbs14, Method, Midpoint, OnCircles, Rk4, Splitting2, Splitting4, Splitting6, Taylor, Tsit5,
    Vern9,
};

use super::any_method::{AnyMethod, MAX_INVARIANTS, OfBoth, OfLanes, OfScenes};
use super::auto::{self, Purpose};
use super::dynamics::{Dynamics, PreparedLanes};
use super::extrapolated::Extrapolated;
use super::info::Info;
use super::machine::{Registers, WideSums};
use super::method::{MethodName, Steps};
use super::wide::Wide;
use crate::error::Error;

/// An explicit method on lanes, in wide registers where the processor has some.
macro_rules! on_lanes {
    ($method:ident) => {{
        static WIDE: LazyLock<Option<Wide>> = LazyLock::new(|| {
            let tableau = <$method as Method<F64x4, PreparedLanes<'static>>>::TABLEAU;
            Wide::up_to(Registers::Avx512, tableau)
        });
        let (four, eight): (OfLanes<'a>, OfLanes<'a, F64x8>) = (&$method, &$method);
        WIDE.as_ref().map_or((four, eight), |wide| (wide, wide))
    }};
}

/// The method of a name, for a scene with parameters at a state; equations between coordinates are kept by a projection
/// after every step, whatever the method.
///
/// # Errors
/// [`Error::Options`] when the scene lacks what the method needs, or `auto` has no tolerance to go by.
pub(crate) fn method_of<'a>(
    method: MethodName,
    steps: Steps,
    purpose: Purpose,
    dynamics: &dyn Dynamics,
    y: &[f64],
) -> Result<AnyMethod<'a>, Error> {
    let own = own_method(method, steps, purpose, dynamics, y);
    match dynamics.positions() {
        // Projection onto invariants keeps these equations, too.
        Some(found) if method.asks_for() != Some(Want::Invariants) => {
            if found.n_functions > MAX_INVARIANTS {
                let (n, Info { scene, model, .. }) = (found.n_functions, dynamics.info());
                let reason = format!(
                    "scene {scene} of {model} has {n} equations between coordinates, but at most {MAX_INVARIANTS} \
                     can be kept"
                );
                return Err(Error::Options { reason });
            }
            own.map(AnyMethod::onto_positions)
        }
        _ => own,
    }
}

/// The same without a thought for equations between coordinates.
fn own_method<'a>(
    method: MethodName,
    steps: Steps,
    purpose: Purpose,
    dynamics: &dyn Dynamics,
    y: &[f64],
) -> Result<AnyMethod<'a>, Error> {
    Ok(match method {
        MethodName::Tsit5 => AnyMethod::single(&Tsit5).with_lanes(on_lanes!(Tsit5)),
        MethodName::Dop853 => {
            carried(&Dop853, const { &OnCircles::new(Dop853) }, dynamics).with_lanes(on_lanes!(Dop853))
        }
        MethodName::Vern9 => {
            carried(&Vern9, const { &OnCircles::new(Vern9) }, dynamics).with_lanes(on_lanes!(Vern9))
        }
        MethodName::Gbs14 => {
            static WIDE: LazyLock<Option<Extrapolated>> =
                LazyLock::new(|| Extrapolated::up_to(Registers::Avx512));
            let (four, eight): (OfLanes<'a>, OfLanes<'a, F64x8>) = (&Gbs14, &Gbs14);
            let on_lanes: OfBoth<'a> = WIDE.as_ref().map_or((four, eight), |wide| (wide, wide));
            carried(&Gbs14, const { &OnCircles::new(Gbs14) }, dynamics).with_lanes(on_lanes)
        }
        MethodName::Dopri5 => AnyMethod::single(&Dopri5).with_lanes(on_lanes!(Dopri5)),
        MethodName::Rk4 => AnyMethod::single(&Rk4).with_lanes(on_lanes!(Rk4)),
        MethodName::Midpoint => AnyMethod::single(const { &Midpoint::fixed_point() }),
        MethodName::Gauss4 => AnyMethod::single(const { &Gauss4::fixed_point() }),
        MethodName::Gauss6 => AnyMethod::single(const { &Gauss6::fixed_point() }),
        MethodName::Gauss8 => AnyMethod::single(const { &Gauss8::fixed_point() }),
        MethodName::Gauss16 => AnyMethod::single(gauss16()),
        MethodName::MidpointNewton => AnyMethod::single(const { &Midpoint::newton() }),
        MethodName::Gauss4Newton => AnyMethod::single(const { &Gauss4::newton() }),
        MethodName::Gauss6Newton => AnyMethod::single(const { &Gauss6::newton() }),
        MethodName::Gauss8Newton => AnyMethod::single(const { &Gauss8::newton() }),
        MethodName::Taylor => {
            has_series(dynamics, y)?;
            AnyMethod::single(const { &Taylor::new() })
        }
        MethodName::Auto => {
            let Steps::Adaptive { rtol, .. } = steps else {
                let reason = "method auto chooses by tolerances: give these instead of a step".to_owned();
                return Err(Error::Options { reason });
            };
            let chosen = auto::choose(rtol, dynamics.rhs_cost(), purpose);
            return own_method(chosen, steps, purpose, dynamics, y);
        }
        MethodName::Isospectral => {
            let info = dynamics.info();
            let reason = format!(
                "method isospectral moves fluids that are products of matrices, and scene {} of {} has equations: choose \
                 another method, or write `want matrices` in a fluid's scene",
                info.scene, info.model
            );
            return Err(Error::Options { reason });
        }
        MethodName::Splitting2 => split(const { &Splitting2::new() }, method, dynamics)?,
        MethodName::Splitting4 => split(const { &Splitting4::new() }, method, dynamics)?,
        MethodName::Splitting6 => split(const { &Splitting6::new() }, method, dynamics)?,
        MethodName::Discrete => discrete(const { &Discrete2::new() }, method, dynamics)?,
        MethodName::Discrete4 => discrete(const { &Discrete4::new() }, method, dynamics)?,
        MethodName::Discrete6 => discrete(const { &Discrete6::new() }, method, dynamics)?,
        MethodName::Projected => projected(&Vern9, method, dynamics)?,
        MethodName::Gauss16Projected => projected(gauss16(), method, dynamics)?,
    })
}

/// Collocation, its loops in wide registers where the processor has some.
fn gauss16<'a>() -> OfScenes<'a> {
    static WIDE: LazyLock<Option<Gauss16With<WideSums>>> =
        LazyLock::new(|| WideSums::up_to(Registers::Avx512).map(Gauss16With));
    match &*WIDE {
        Some(wide) => wide,
        None => &Gauss16,
    }
}

/// An explicit method of high order, on circles where the scene has angles as points of circles: lanes with a
/// trajectory each have them as numbers.
fn carried<'a>(method: OfScenes<'a>, on_circles: OfScenes<'a>, dynamics: &dyn Dynamics) -> AnyMethod<'a> {
    AnyMethod::single(if dynamics.n_circles() == 0 { method } else { on_circles })
}

/// A method around which steps are projected onto the invariants of a scene; `name` is that of both.
///
/// # Errors
/// [`Error::Options`] when the scene has no invariants, or too many.
fn projected<'a>(
    method: OfScenes<'a>,
    name: MethodName,
    dynamics: &dyn Dynamics,
) -> Result<AnyMethod<'a>, Error> {
    let n_invariants = dynamics.n_invariants();
    let projected = AnyMethod::single(method).onto_invariants(n_invariants);
    projected.ok_or_else(|| not_projected(name, dynamics.info(), n_invariants))
}

/// A composition of the exact flows of a scene; `name` is its name.
///
/// # Errors
/// [`Error::Options`] when the scene has none.
fn split<'a>(
    method: OfScenes<'a>,
    name: MethodName,
    dynamics: &dyn Dynamics,
) -> Result<AnyMethod<'a>, Error> {
    if let Err(reason) = dynamics.flows() {
        let (name, Info { scene, model, .. }) = (name.name(), dynamics.info());
        return Err(Error::Options { reason: format!("method {name}: scene {scene} of {model} {reason}") });
    }
    Ok(AnyMethod::single(method))
}

/// Steps by the discrete equations of a scene; `name` is that of the method.
///
/// # Errors
/// [`Error::Options`] when the scene has none.
fn discrete<'a>(
    method: OfScenes<'a>,
    name: MethodName,
    dynamics: &dyn Dynamics,
) -> Result<AnyMethod<'a>, Error> {
    if dynamics.discrete().is_none() {
        let (name, Info { scene, model, .. }) = (name.name(), dynamics.info());
        let reason = format!(
            "method {name}: scene {scene} of {model} has no discrete equations; a scene has them by `discrete midpoint;`"
        );
        return Err(Error::Options { reason });
    }
    Ok(AnyMethod::single(method))
}

/// Whether a scene has the series that the method `taylor` needs.
///
/// # Errors
/// [`Error::Options`] when it has not.
fn has_series(dynamics: &dyn Dynamics, y: &[f64]) -> Result<(), Error> {
    if dynamics.series((0.0, 0.0), y, &mut SeriesRoom::default(), &mut []).is_some() {
        return Ok(());
    }
    let info = dynamics.info();
    let reason = format!(
        "method taylor: scene {} of {} has no Taylor series: choose another method",
        info.scene, info.model
    );
    Err(Error::Options { reason })
}

fn not_projected(method: MethodName, info: &Info, n_invariants: usize) -> Error {
    let reason = match n_invariants {
        0 => {
            "has no invariant besides components of its state: choose another method, or claim one that you \
                    know with `casimir name = ..;`"
                .to_owned()
        }
        n => {
            format!("has {n} invariants, but at most {MAX_INVARIANTS} can be kept: choose another method")
        }
    };
    let (method, Info { scene, model, .. }) = (method.name(), info);
    Error::Options { reason: format!("method {method}: scene {scene} of {model} {reason}") }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use hamel_runtime::{Integrator, Method, Options, Stats, Taylor};

    use super::{Gauss16, Gauss16With, Registers, WideSums};
    use crate::cache::Cache;
    use crate::dynamics::{Factory as _, PreparedScene, VecState};
    use crate::interpreted::{self, Built};
    use crate::model::Checked;
    use crate::session::Session;

    const CART: &str = "
        model cart {
            param l = 2 where l > 0;
            coordinate theta in angle;
            coordinate x in real;
            coordinate z in real;
            lagrangian = (x_dot^2 + z_dot^2 + l^2*theta_dot^2/2 + x_dot*theta_dot*cos(theta))/2 + l*cos(theta)
                - x^2/2 + x*sin(3*t)/4 - z^4/4 + z*x;
        }
    ";

    fn cart() -> Built {
        let model = Session::of_shipped(&[]).parse("cart", CART).unwrap_or_else(|e| panic!("{e}"));
        let model = Arc::new(Checked::new(model, Cache::none()));
        interpreted::build(&model, "default").unwrap_or_else(|e| panic!("{e}"))
    }

    /// Some states of a motion, within steps as well, and the work.
    fn motion<'a, M>(scene: &PreparedScene<'a>, method: M, options: Options<f64>) -> (Vec<Vec<u64>>, Stats)
    where
        M: Method<f64, PreparedScene<'a>>,
    {
        let start = VecState(vec![0.3, -0.2, 0.5, 0.1, 0.4, -0.7]);
        let mut solver = Integrator::new(scene, method, 0.0, start, options).unwrap();
        let mut states = Vec::new();
        let times = [0.33, 0.91, 2.0];
        solver
            .sample(2.0, times, |_, y: &VecState| states.push(y.0.iter().map(|x| x.to_bits()).collect()))
            .unwrap();
        (states, solver.stats())
    }

    #[test]
    fn collocation_has_the_bits_of_the_runtime_in_all_registers() {
        for built in [cart(), cart().in_memory()] {
            let scene = built.prepare(&[1.5]).unwrap();
            let options = Options::fixed(0.1);
            let own = motion(&scene, Gauss16, options);
            for wide in [Registers::Avx, Registers::Avx512].into_iter().filter_map(WideSums::up_to) {
                assert_eq!(motion(&scene, Gauss16With(wide), options), own);
            }
        }
    }

    #[test]
    fn series_in_memory_have_the_bits_of_those_interpreted() {
        let [interpreted, in_memory] = [cart(), cart().in_memory()].map(|built| {
            motion(&built.prepare(&[1.5]).unwrap(), Taylor::new(), Options::adaptive(1e-12, 1e-12))
        });
        assert_eq!(interpreted, in_memory);
    }
}
