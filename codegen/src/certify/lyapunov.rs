//! The rate of a function that an actuator gives it, along the rates of a program; the force by the equation of motion
//! along its displacement.
//!
//! Does not know: how forces were solved for.

use hamel_expr::SymbolId;
use hamel_mechanics::mechanics::Decrease;
use hamel_runtime::{Dual, Real};

use super::definition::Missing;
use super::motion::{Motion, RATES, minus};
use super::point::Setting;
use super::sheet::Sheet;
use super::tape::{Env, Tape};
use super::wide::Wide;

/// `dV/dt - mu`, with the derivative of `V` as written by a dual number in time.
///
/// # Source
/// Grillo, Marsden, Nair 2011, Lyapunov constraints and global asymptotic stabilization, section 3.
pub(super) fn check(motion: &Motion, setting: &Setting<'_>, sheet: &mut Sheet) -> Result<(), Missing> {
    let model = setting.definition.model;
    let Some(own) = &model.lyapunov else { return Ok(()) };
    let value = Tape::new(&model.graph, &[own.value]).eval(&motion.moving.env)?.roots[0];
    let rate = Tape::new(&model.graph, &[own.rate]).eval(&motion.at.env)?.roots[0];
    sheet.equal(RATES, format!("the rate of the function {}", own.name), value.derivative, rate);
    if setting.claim.equations.facts.decrease == Some(Decrease::Proved) {
        let growth = if rate.to_f64() > 0.0 { rate } else { Wide::ZERO };
        sheet.vanishes(RATES, format!("the growth of the function {}", own.name), growth, rate.size());
    }
    Ok(())
}

/// The force of the actuator, `(d/dt <p, w> + <p, [w, y]> - dL(rho w) - <F, w>)/f(w)` along a displacement `w` that is
/// constant in time, over any scalar: for derivatives of outputs.
///
/// `env` and `rates`: of the scene's state, with what else a point has.
pub(super) fn force<R: Real>(setting: &Setting<'_>, env: &Env<R>, rates: &[R]) -> Result<R, Missing> {
    let definition = &setting.definition;
    let at = setting.place(env)?;
    let forms = definition.one_forms(&at)?;
    let Some((_, form)) = forms.first() else { return Ok(R::ZERO) };
    // A displacement on which the actuator does work.
    let power = form.iter().fold(R::ZERO, |sum, f| sum + *f * *f);
    let w = definition.group_velocities(&at.env, form)?;
    let mut along: Vec<(SymbolId, R)> = setting.state.iter().copied().zip(rates.iter().copied()).collect();
    along.push((definition.model.time, R::ONE));
    for (symbol, rate) in
        definition.anchored(&at.env, &at.group)?.into_iter().chain(definition.first_order(&at.env)?)
    {
        let on_circle = setting.circles.iter().find(|[.., angle]| *angle == symbol);
        if !setting.state.contains(on_circle.map_or(&symbol, |[cosine, ..]| cosine)) {
            along.push((symbol, rate));
        }
    }
    let moving = setting.place(&setting.seeded(env, &along))?;
    let constant: Vec<Dual<R>> = w.iter().map(|w| Dual::constant(*w)).collect();
    let inertia = definition.lagrangian(&moving, &constant, &Vec::new())?.derivative.derivative;
    let z = definition.bracket(&at.env, &w, &at.group)?;
    let turning = definition.lagrangian(&at, &z, &Vec::new())?.derivative;
    let still = vec![R::ZERO; w.len()];
    let drive = definition.lagrangian(&at, &still, &minus(&definition.anchored(&at.env, &w)?))?.derivative;
    let work = definition.work(&at, &w)?;
    Ok((inertia + turning + drive - work) / power)
}
