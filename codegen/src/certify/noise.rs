//! What white noise does to a motion: the Hamiltonian vector fields of its functions, by their definition.
//!
//! Along a displacement `w`, in the frame of the group, the momentum `p` changes by `-<p, [w, v]> - dh(rho w)` for each
//! unit of the noise, and base coordinates by `rho v`, with `v = dh/dp`. A named momentum is `<p, e_b>` along a
//! displacement `e_b`, so that `v = dh/dp_b e_b`, and `dh(rho w)` is taken at fixed `p`.
//!
//! Does not know: how equations of motion are made, increments of the noise.
//!
//! # Source
//! Lazaro-Cami and Ortega 2008, Stochastic Hamiltonian dynamical systems.

use std::collections::BTreeSet;

use hamel_runtime::{Dual, Real};

use hamel_expr::SymbolId;
use hamel_mechanics::reduction::KinematicConstraint;

use super::definition::{Missing, Place};
use super::linear::Reduced;
use super::motion::Motion;
use super::point::Setting;
use super::tape::Tape;
use super::wide::Wide;

/// A momentum that the model names.
pub(super) struct NamedMomentum<R> {
    pub(super) symbol: SymbolId,
    /// The displacement that it belongs to, in the frame of the group.
    pub(super) along: Vec<R>,
}

impl Motion {
    /// All momenta that the model names along velocities that no constraint determines.
    pub(super) fn named_momenta<R: Real>(
        setting: &Setting<'_>,
        at: &Place<R>,
    ) -> Result<Vec<NamedMomentum<R>>, Missing> {
        let definition = &setting.definition;
        let system = &setting.claim.equations.system;
        let (model, n_frame) = (definition.model, definition.m);
        let mut found = Vec::new();
        for (_, symbol, velocity) in model.momenta.iter().flat_map(|m| &m.components) {
            let along = match &system.frame {
                // A state along stages has unknowns of its own; the momentum is along a velocity of the model.
                Some(frame) if system.formulation.stages.is_carried() => {
                    let quasi = || model.quasi_velocities.get(velocity - n_frame).map(|v| v.symbol);
                    let own = frame.original.get(*velocity).map(|u| u.symbol).or_else(quasi);
                    let kept = Motion::kept_before_stages(setting);
                    let Some(own) = own.filter(|own| kept.contains(own)) else { continue };
                    Motion::displacement_before_stages(setting, at, own, &kept)?
                }
                _ => {
                    // A connection that is solved for, and an internal frame, keep the names of velocities.
                    let original = system.frame.as_ref().and_then(|frame| frame.original.get(*velocity));
                    let is_it = |u: &hamel_mechanics::reduction::Unknown| match (original, u.frame_idx) {
                        (Some(original), _) => original.symbol == u.symbol,
                        (None, Some(k)) => k == *velocity,
                        (None, None) => {
                            *velocity >= n_frame
                                && model.quasi_velocities[velocity - n_frame].symbol == u.symbol
                        }
                    };
                    let Some(unknown) = system.unknowns.iter().position(is_it) else { continue };
                    Motion::displacement_of(setting, at, unknown)?
                }
            };
            let along = definition.group_velocities(&at.env, &along[..n_frame])?;
            found.push(NamedMomentum { symbol: *symbol, along });
        }
        Ok(found)
    }

    /// The velocities of the model, by their symbols, that its constraints do not determine, where the state has
    /// velocities along stages in their place.
    fn kept_before_stages(setting: &Setting<'_>) -> BTreeSet<SymbolId> {
        let system = &setting.claim.equations.system;
        let Some(frame) = &system.frame else { return BTreeSet::new() };
        let original = frame.original.iter().map(|u| u.symbol);
        let quasi = setting.definition.model.quasi_velocities.iter().map(|v| v.symbol);
        let all: BTreeSet<SymbolId> = original.chain(quasi).collect();
        // The state follows from the velocities that are kept, and from no others.
        let own = system.unknowns.iter().map(|u| u.symbol);
        let values = system.changes.iter().flat_map(|change| system.graph.free_symbols(change.value));
        own.chain(values).filter(|symbol| all.contains(symbol)).collect()
    }

    /// The virtual displacement along a velocity of the model with no part along others that are kept.
    fn displacement_before_stages<R: Real>(
        setting: &Setting<'_>,
        at: &Place<R>,
        velocity: SymbolId,
        kept: &BTreeSet<SymbolId>,
    ) -> Result<Vec<R>, Missing> {
        let definition = &setting.definition;
        let system = &setting.claim.equations.system;
        let (m, n) = (definition.m, definition.n_displacements());
        let one = |is_one: bool| if is_one { R::ONE } else { R::ZERO };
        let mut columns: Vec<Vec<R>> = Vec::new();
        for k in 0..m {
            let unit: Vec<R> = (0..m).map(|j| one(j == k)).collect();
            columns.push(definition.before_stages(&at.env, &unit)?);
        }
        let mut rows = Vec::new();
        if matches!(system.constraint, KinematicConstraint::Solved(_)) {
            for (_, mut form) in definition.one_forms(at)? {
                form.push(R::ZERO);
                rows.push(form);
            }
        }
        for (i, u) in system.frame.iter().flat_map(|frame| &frame.original).enumerate() {
            if kept.contains(&u.symbol) {
                let mut row: Vec<R> = columns.iter().map(|column| column[i]).collect();
                row.resize(n, R::ZERO);
                row.push(one(u.symbol == velocity));
                rows.push(row);
            }
        }
        for (j, v) in definition.model.quasi_velocities.iter().enumerate().take(n - m) {
            if kept.contains(&v.symbol) {
                let mut row: Vec<R> = (0..n).map(|k| one(k == m + j)).collect();
                row.push(one(v.symbol == velocity));
                rows.push(row);
            }
        }
        Ok(Reduced::new(rows, n).solution(&vec![R::ZERO; n]))
    }

    /// `<p, w>` for a displacement in the frame of the group.
    pub(super) fn momentum<R: Real>(setting: &Setting<'_>, at: &Place<R>, w: &[R]) -> Result<R, Missing> {
        let definition = &setting.definition;
        match definition.has_hamiltonian() {
            true => definition.momentum_along(at, &definition.model_velocities(&at.env, w)?),
            false => Ok(definition.lagrangian(at, w, &Vec::new())?.derivative),
        }
    }

    /// `sum_k W_k v_k`, in the frame of the group, where noise is more than forces.
    pub(super) fn transport(setting: &Setting<'_>, at: &Place<Wide>) -> Result<Option<Vec<Wide>>, Missing> {
        let fields = Motion::noise_fields(setting, at)?;
        let sum = |a: Vec<Wide>, b: Vec<Wide>| a.into_iter().zip(b).map(|(a, b)| a + b).collect();
        Ok(fields.into_iter().filter_map(|field| Some(times(field.w, &field.v?))).reduce(sum))
    }

    /// The velocities that move coordinates, with `sum_k W_k v_k`, in the frame of the group.
    pub(super) fn total(setting: &Setting<'_>, at: &Place<Wide>) -> Result<Vec<Wide>, Missing> {
        Ok(match Motion::transport(setting, at)? {
            Some(v) => at.group.iter().zip(v).map(|(y, v)| *y + v).collect(),
            None => at.group.clone(),
        })
    }

    /// `sum_k W_k (<p, [w, v_k]> + dh_k(rho w))`.
    pub(super) fn power_of_noise(
        setting: &Setting<'_>,
        at: &Place<Wide>,
        w: &[Wide],
    ) -> Result<Wide, Missing> {
        let definition = &setting.definition;
        let mut sum = Wide::ZERO;
        for field in Motion::noise_fields(setting, at)? {
            if let Some(v) = &field.v {
                let z = definition.bracket(&at.env, w, v)?;
                sum += field.w * Motion::momentum(setting, at, &z)?;
            }
            let along = definition.anchored(&at.env, w)?;
            let shifted = setting.place(&setting.seeded(&at.env, &along))?;
            let mut env = shifted.env.clone();
            for (momentum, still) in
                Motion::named_momenta(setting, &shifted)?.iter().zip(Motion::named_momenta(setting, at)?)
            {
                let change: Vec<Wide> = momentum.along.iter().map(|e| e.derivative).collect();
                let value = Motion::momentum(setting, at, &still.along)?;
                env.set(momentum.symbol, Dual::new(value, Motion::momentum(setting, at, &change)?));
            }
            sum += field.w * field.h.eval(&env)?.roots[0].derivative;
        }
        Ok(sum)
    }

    /// The noises that the scene takes and that have a Hamiltonian.
    fn noise_fields(setting: &Setting<'_>, at: &Place<Wide>) -> Result<Vec<NoiseField>, Missing> {
        let model = setting.definition.model;
        let taken = &setting.claim.equations.system.inputs;
        let mut fields = Vec::new();
        for noise in
            model.noises.iter().filter(|noise| taken.iter().any(|input| input.symbol == noise.symbol))
        {
            let Some((h, _)) = noise.hamiltonian else { continue };
            let w = at.env.get(noise.symbol).ok_or(noise.symbol)?;
            let h = Tape::new(&model.graph, &[h]);
            let momenta = Motion::named_momenta(setting, at)?;
            let mut env = at.env.map(Dual::constant);
            for momentum in &momenta {
                env.set(momentum.symbol, Dual::constant(Motion::momentum(setting, at, &momentum.along)?));
            }
            let mut v: Option<Vec<Wide>> = None;
            for momentum in &momenta {
                let value = env.get(momentum.symbol).ok_or(momentum.symbol)?;
                env.set(momentum.symbol, Dual::variable(value.value));
                let slope = h.eval(&env)?.roots[0].derivative;
                env.set(momentum.symbol, value);
                if slope.size() > 0.0 {
                    let own = times(slope, &momentum.along);
                    v = Some(match v {
                        Some(sum) => sum.into_iter().zip(own).map(|(a, b)| a + b).collect(),
                        None => own,
                    });
                }
            }
            fields.push(NoiseField { w, h, v });
        }
        Ok(fields)
    }
}

fn times(factor: Wide, w: &[Wide]) -> Vec<Wide> {
    w.iter().map(|w| factor * *w).collect()
}

struct NoiseField {
    /// The noise at the point.
    w: Wide,
    h: Tape,
    /// `v = dh/dp`, where it does not vanish.
    v: Option<Vec<Wide>>,
}
