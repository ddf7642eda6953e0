//! The map of a scene from the system that its model is the quotient of: it has the images of the item `reduces`, and
//! takes the motion of that system to the scene's, `D phi(x) f_total(x) = f(phi(x))` at the parameters that it gives.
//!
//! Does not know: algebroids, how the map was proved, made or lowered.

use hamel_runtime::{Dual, Real};

use hamel_expr::SymbolId;
use hamel_expr::error::Error;
use hamel_lang::spec::Model;
use hamel_program::program::{Constant, Role};

use super::claim::{Certificate, Claim};
use super::motion::constants;
use super::point::{Point, Setting, compare};
use super::random::Random;
use super::runner::At;
use super::sheet::Sheet;
use super::tape::{Env, PI, rational};
use super::wide::Wide;
use super::{MAX_DRAWS, seed, settle};

/// Names of the functions of the state and of the parameters; the first is that of the images of the total system.
const STATE: &str = "quotient";
const PARAMS: &str = "quotient_parameters";

/// Holds the map to the images of the total system and to the rates of both, at random states of that one.
///
/// # Errors
/// [`Error::Disagrees`] for the first component that is not what it is said to be.
pub(crate) fn certify_quotient(
    claim: &Claim<'_>,
    total: &Claim<'_>,
    mut certificate: Certificate,
) -> Result<Certificate, Error> {
    let mut map = Map { own: Setting::new(claim), total: Setting::new(total) };
    map.total.on_groups = true;
    let mut random = Random::new(seed(claim) ^ seed(total));
    let mut n_held = 0;
    for turn in 0..claim.n_points.max(map.total.modes.len()) {
        for attempt in 0..MAX_DRAWS {
            let Some(point) = map.total.draw(&mut random, attempt, turn) else { continue };
            let Some(sheet) = map.compared(&point) else { continue };
            let scale = point.scale(&map.total);
            if sheet.rows.iter().all(|row| row.is_sharp(scale)) {
                settle(claim, (&sheet, scale), &mut certificate)?;
                n_held += 1;
                break;
            }
        }
    }
    if n_held == 0 {
        let reason = "at no state of the total system both rates have enough digits".to_owned();
        certificate.open.insert(STATE.to_owned(), reason);
    }
    Ok(certificate)
}

/// Both systems.
struct Map<'a> {
    own: Setting<'a>,
    total: Setting<'a>,
}

/// Names and values of the results of a function.
type Named<'a, R> = Vec<(&'a str, R)>;

impl Map<'_> {
    /// The residuals at a point of the total system whose image is inside of the scene's domain.
    fn compared(&self, point: &Point) -> Option<Sheet> {
        let state = point.state(&self.total);
        let rates = self.total.rates(&point.at(&state));
        let mut variables: Vec<Dual<Wide>> =
            state.iter().zip(&rates).map(|(x, d)| Dual::new(*x, *d)).collect();
        variables.extend(constants(&point.params));
        let of_params = self.called(PARAMS, Dual::variable(point.t), &variables);
        let of_state = self.called(STATE, Dual::variable(point.t), &variables);
        let params: Vec<Wide> = of_params.iter().map(|(_, x)| x.value).collect();
        let slots = self.own.runner.slots(&params);
        let holds = |(relation, a, b)| compare(relation, a, b);
        if !self.own.runner.conditions(&params).into_iter().all(holds) {
            return None;
        }
        let image: Vec<Wide> = of_state.iter().map(|(_, x)| x.value).collect();
        let inputs = self.inputs();
        let at = At { params: &params, slots: &slots, inputs: &inputs, t: point.t, state: &image };
        let program = self.own.claim.program;
        if let Some(domain) = program.function_idx(&Role::Domain) {
            let inside = self.own.runner.call(domain, &at, &[]);
            inside.iter().all(|x| x.to_f64() > 0.0).then_some(())?;
        }
        let mut sheet = Sheet::default();
        self.images(point, &state, (&of_params, &of_state), &at, &mut sheet);
        if of_state.len() != program.state.len() || of_params.len() != program.params.len() {
            sheet.vanishes(STATE, "the number of components", Wide::ONE, 1.0);
        }
        // Parameters stay, momenta of the total system among them.
        for (param, moving) in &of_params {
            let size = moving.value.size().max(point.scale(&self.total));
            sheet.vanishes(PARAMS, format!("the rate of {param}"), moving.derivative, size);
        }
        for ((component, moving), rate) in of_state.iter().zip(self.own.rates(&at)) {
            sheet.equal(STATE, format!("the rate of {component}"), moving.derivative, rate);
        }
        Some(sheet)
    }

    /// A function of the map; it reads no parameter of the scene.
    fn called(&self, name: &str, t: Dual<Wide>, variables: &[Dual<Wide>]) -> Named<'_, Dual<Wide>> {
        let program = self.own.claim.program;
        let Some(k) = program.function_idx(&Role::OfVariables(name.to_owned())) else {
            return Vec::new();
        };
        let zeros = |n: usize| vec![Dual::constant(Wide::ZERO); n];
        let (params, state) = (zeros(program.params.len()), zeros(program.state.len()));
        let (slots, inputs) = (self.own.runner.slots(&params), zeros(program.inputs.len()));
        let at = At { params: &params, slots: &slots, inputs: &inputs, t, state: &state };
        let values = self.own.runner.call(k, &at, variables);
        program.functions[k].results.iter().map(|(name, _)| name.as_str()).zip(values).collect()
    }

    /// Inputs at what they are held at.
    fn inputs(&self) -> Vec<Wide> {
        let value = |constant: &Constant| match constant {
            Constant::Rational(q) => rational(q),
            Constant::Pi => Wide::from_parts(PI[0], PI[1]),
        };
        self.own.claim.program.inputs.iter().map(|(_, held)| value(held)).collect()
    }

    /// Components are the images of the total system, which its own certificate holds to the functions as written;
    /// what stands for velocities is that of the images of velocities.
    fn images(
        &self,
        point: &Point,
        state: &[Wide],
        (of_params, of_state): (&Named<'_, Dual<Wide>>, &Named<'_, Dual<Wide>>),
        at: &At<'_, Wide>,
        sheet: &mut Sheet,
    ) {
        let program = self.total.claim.program;
        let Some(k) = program.function_idx(&Role::Output(STATE.to_owned())) else { return };
        let values = self.total.runner.call(k, &point.at(state), &[]);
        let names = program.functions[k].results.iter().map(|(name, _)| name.as_str());
        let defined: Named<'_, Wide> = names.zip(values).collect();
        let image = |name: &str| defined.iter().find(|(own, _)| *own == name).map(|(_, x)| *x);
        for (function, found) in [(PARAMS, of_params), (STATE, of_state)] {
            for (name, x) in found {
                if let Some(defined) = image(name) {
                    sheet.equal(function, (*name).to_owned(), x.value, defined);
                }
            }
        }
        self.velocities(at, &image, sheet);
    }

    /// All velocities of the scene at the image, also beside its state.
    fn velocities(&self, at: &At<'_, Wide>, image: &dyn Fn(&str) -> Option<Wide>, sheet: &mut Sheet) {
        let (model, system) = (self.own.claim.model, &self.own.claim.equations.system);
        let mut env = Env::new();
        env.set(model.time, at.t);
        let fixed = system.formulation.fixed.iter();
        let fixed = fixed.filter_map(|(name, q)| Some((symbol_of(model, name)?, rational(q))));
        let params = system.params.iter().map(|p| p.symbol).zip(at.params.iter().copied());
        let inputs = system.inputs.iter().map(|input| input.symbol).zip(at.inputs.iter().copied());
        let state = self.own.state.iter().copied().zip(at.state.iter().copied());
        for (symbol, value) in fixed.chain(params).chain(inputs).chain(state) {
            env.set(symbol, value);
        }
        for (name, symbol) in model.all_velocities() {
            let Some(defined) = image(name) else { continue };
            // Of coordinates that the scene leaves out nothing is known.
            if let Ok(found) = self.own.velocities_of(&env, std::iter::once(symbol)) {
                sheet.equal(STATE, format!("the velocity {name}"), found[0], defined);
            }
        }
    }
}

fn symbol_of(model: &Model, name: &str) -> Option<SymbolId> {
    let params = model.params.iter().chain(&model.inputs);
    params.into_iter().find(|p| p.name == name).map(|p| p.symbol)
}
