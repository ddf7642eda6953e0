//! The variables in which a state of a scene may be given: the scene's own, velocities in the place of momenta or of
//! variables along the levels of stages, and momenta in the place of velocities, where the model names them.
//!
//! The interpreter converts, whoever evaluates the scene, so that a state has the same bits everywhere.
//!
//! Does not know: requests, how a state is chosen.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use hamel_codegen::scene::{self, Executable};
use hamel_codegen::spec::circle_names;
use hamel_program::program::{Role, ViolatedCondition};
use hamel_runtime::{Dual, Real};
use serde::{Deserialize, Serialize};

use super::dynamics::BadParams;
use super::evaluate::refused;
use super::info::Info;
use crate::error::Error;
use crate::model::Checked;

/// A component of the state that has several names.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Slot {
    /// Its place in the state.
    at: usize,
    velocity: String,
    momentum: Option<String>,
    /// What the scene has there by a name that the model does not have: along a level of stages, or chosen by a search.
    level: Option<String>,
}

/// What a slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Held {
    Velocity,
    Momentum,
    Level,
}

impl Slot {
    /// The name of what it holds: its velocity where it has no other.
    fn name(&self, held: Held) -> &String {
        let other = match held {
            Held::Velocity => None,
            Held::Momentum => self.momentum.as_ref(),
            Held::Level => self.level.as_ref(),
        };
        other.unwrap_or(&self.velocity)
    }

    /// All its names.
    fn names(&self) -> impl Iterator<Item = &String> {
        [Some(&self.velocity), self.momentum.as_ref(), self.level.as_ref()].into_iter().flatten()
    }
}

/// Values that differ by more are two, in parts of their size: a start meets constraints to some 1e-12, and levels
/// follow from velocities by a few more roundings.
const DIFFERENT: f64 = 1e-9;

/// What each slot holds, in the order of the slots.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Form(Vec<Held>);

/// The forms that the states of a scene may be given in.
#[derive(Debug)]
pub struct Forms {
    model: Option<Arc<Checked>>,
    info: Info,
    slots: Vec<Slot>,
    own: Form,
    /// Angles that the scene carries as points of the circle.
    angles: Vec<String>,
    /// Scenes that carry what a form holds, once they have been asked for.
    carrying: Mutex<BTreeMap<Form, Arc<Carrying>>>,
}

/// A scene that carries momenta or velocities along levels, as far as conversions need it.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Carrying {
    executable: Executable,
    state: Vec<String>,
    /// The arguments of its Legendre transform.
    velocities: Vec<String>,
    /// The results of its Legendre transform.
    carried: Vec<String>,
    /// What its outputs are: velocities by what it carries.
    outputs: Vec<String>,
}

impl Carrying {
    /// Whether the program keeps its rules and has what the names say.
    fn is_sound(&self) -> bool {
        let program = &self.executable.program;
        let n_of = |is_one: fn(&Role) -> bool| {
            let functions = program.functions.iter().filter(move |f| is_one(&f.role));
            functions.map(|f| (f.argument.len(), f.results.len()))
        };
        let n_outputs: usize = n_of(|role| matches!(role, Role::Output(_))).map(|(_, n)| n).sum();
        let mut transforms = n_of(|role| matches!(role, Role::Product(_)));
        self.executable.verify().is_ok()
            && program.state == self.state
            && n_outputs == self.outputs.len()
            && transforms.all(|n| n == (self.velocities.len(), self.carried.len()))
    }
}

impl Forms {
    /// The scene's own variables alone.
    pub fn own(info: &Info) -> Forms {
        Forms {
            model: None,
            info: info.clone(),
            slots: Vec::new(),
            own: Form(Vec::new()),
            angles: Vec::new(),
            carrying: Mutex::default(),
        }
    }

    /// The scene's own variables, and what else the model calls them. A Hamiltonian has no momenta by velocities.
    ///
    /// # Errors
    /// What keeps a scene that carries velocities along levels from being derived.
    pub fn of(model: &Arc<Checked>, info: &Info) -> Result<Forms, Error> {
        let mut forms = Forms { model: Some(Arc::clone(model)), ..Forms::own(info) };
        let place = |name: &str| info.state.iter().position(|own| own == name);
        let is_turned = |angle: &String| {
            place(angle).is_none() && circle_names(angle).iter().all(|name| place(name).is_some())
        };
        let angles = model.base.iter().map(|c| c.name.clone()).filter(is_turned).collect();
        let mut found: Vec<(Slot, Held)> = Vec::new();
        let named =
            |name: &String| model.momenta.iter().flat_map(|m| &m.components).any(|(own, ..)| own == name);
        if !info.momenta.iter().all(named) {
            let scene = forms.built(&[], true)?;
            for (level, velocity) in scene.carried.iter().zip(&scene.velocities) {
                let Some(at) = place(level).filter(|_| !named(level)) else { continue };
                let (velocity, level) = (velocity.clone(), Some(level.clone()));
                found.push((Slot { at, velocity, momentum: None, level }, Held::Level));
            }
        }
        let quasi = model.quasi_velocities.iter().map(|v| v.name.as_str());
        let velocities: Vec<&str> =
            model.all_velocities().into_iter().map(|(name, _)| name).chain(quasi).collect();
        let momenta = model.momenta.iter().filter(|_| model.hamiltonian.is_none());
        for (momentum, _, k) in momenta.flat_map(|m| &m.components) {
            let velocity = velocities[*k];
            if let Some((slot, _)) = found.iter_mut().find(|(slot, _)| slot.velocity == velocity) {
                slot.momentum = Some(momentum.clone());
                continue;
            }
            let (at, held) = match (place(momentum), place(velocity)) {
                (Some(at), _) => (at, Held::Momentum),
                (None, Some(at)) => (at, Held::Velocity),
                (None, None) => continue,
            };
            let (velocity, momentum) = (velocity.to_owned(), Some(momentum.clone()));
            found.push((Slot { at, velocity, momentum, level: None }, held));
        }
        found.sort_by_key(|(slot, _)| slot.at);
        let (slots, own): (Vec<Slot>, Vec<Held>) = found.into_iter().unzip();
        (forms.slots, forms.own, forms.angles) = (slots, Form(own), angles);
        Ok(forms)
    }

    /// The form of the scene's own state.
    pub fn own_form(&self) -> Form {
        self.own.clone()
    }

    /// All velocities.
    pub fn velocities(&self) -> Form {
        Form(vec![Held::Velocity; self.slots.len()])
    }

    /// Momenta wherever there are some.
    fn momenta(&self) -> Form {
        self.form(|slot| slot.momentum.is_some().then_some(Held::Momentum))
    }

    /// What each slot is said to hold, and the velocities of all others.
    fn form(&self, held: impl Fn(&Slot) -> Option<Held>) -> Form {
        Form(self.slots.iter().map(|slot| held(slot).unwrap_or(Held::Velocity)).collect())
    }

    /// The momenta that are named, and the velocities of all others; where one along a level is named, these.
    pub fn with_momenta_of(&self, names: &BTreeMap<String, f64>) -> Form {
        let is_named = |name: &Option<String>| name.as_ref().is_some_and(|name| names.contains_key(name));
        let has_levels = self.slots.iter().any(|slot| is_named(&slot.level));
        self.form(|slot| match has_levels && slot.level.is_some() {
            true => Some(Held::Level),
            false => is_named(&slot.momentum).then_some(Held::Momentum),
        })
    }

    /// Every name that some form has: the scene's own first.
    pub fn known(&self) -> Vec<&str> {
        let others = self.slots.iter().zip(&self.own.0).flat_map(|(slot, own)| {
            let own = slot.name(*own);
            slot.names().filter(move |name| *name != own)
        });
        self.info.state.iter().chain(others).chain(&self.angles).map(String::as_str).collect()
    }

    /// Given values with angles as the points of the circle that the scene carries.
    ///
    /// # Errors
    /// An angle that is given together with its point.
    pub fn with_points(&self, given: &BTreeMap<String, f64>) -> Result<BTreeMap<String, f64>, String> {
        let mut values = given.clone();
        for angle in &self.angles {
            let Some(value) = values.remove(angle) else { continue };
            let names = circle_names(angle);
            if let Some(other) = names.iter().find(|name| values.contains_key(*name)) {
                return Err(format!("gives the angle {angle} and {other}: give one of them"));
            }
            values.extend(names.into_iter().zip([value.cos(), value.sin()]));
        }
        Ok(values)
    }

    /// Names of the components of a state in a form.
    pub fn names(&self, form: &Form) -> Vec<String> {
        let mut names = self.info.state.clone();
        for (slot, held) in self.slots.iter().zip(&form.0) {
            names[slot.at].clone_from(slot.name(*held));
        }
        names
    }

    /// The form of a state given by these names: the first of `preferred`, the scene's own, velocities, momenta that
    /// has all of them. Names that no form has are of no account.
    ///
    /// # Errors
    /// Why there is none.
    pub fn form_among<'n>(
        &self,
        preferred: &[Form],
        names: impl IntoIterator<Item = &'n str>,
    ) -> Result<Form, String> {
        let names: BTreeSet<&str> = names.into_iter().collect();
        let suits = |form: &&Form| {
            let mut slots = self.slots.iter().zip(&form.0);
            slots.all(|(slot, held)| {
                let own = slot.name(*held);
                slot.names().all(|name| name == own || !names.contains(name.as_str()))
            })
        };
        let all = [self.own.clone(), self.velocities(), self.momenta()];
        if let Some(form) = preferred.iter().chain(&all).find(suits) {
            return Ok(form.clone());
        }
        let given = |name: fn(&Slot) -> Option<&String>, what: &str| {
            let given = self.slots.iter().filter_map(name).filter(|name| names.contains(name.as_str()));
            let given: Vec<&str> = given.map(String::as_str).collect();
            (!given.is_empty()).then(|| format!("{what} ({})", given.join(", ")))
        };
        let kinds = [
            given(|slot| Some(&slot.velocity), "velocities"),
            given(|slot| slot.momentum.as_ref(), "momenta"),
            given(|slot| slot.level.as_ref(), "what the scene carries"),
        ];
        let kinds: Vec<String> = kinds.into_iter().flatten().collect();
        Err(format!(
            "mixes {}: give all of them by velocities, all by momenta, or what the scene carries",
            kinds.join(" with ")
        ))
    }

    /// The form of a state that is given by these names.
    ///
    /// # Errors
    /// As `form_among`.
    pub fn form_of<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Result<Form, String> {
        self.form_among(&[], names)
    }

    /// The scene's own state of one whose components are all given in a form.
    ///
    /// # Errors
    /// As [`Forms::convert`] and [`Forms::hold`].
    pub fn own_of(&self, params: &[f64], t: f64, y: &[f64], form: &Form) -> Result<Vec<f64>, Error> {
        let own = self.convert(params, t, y, [form, &self.own])?;
        let is_kept = |k: &usize| self.slots.iter().all(|slot| slot.at != *k);
        let given = (0..own.len()).filter(is_kept).map(|k| (self.info.state[k].as_str(), y[k]));
        self.hold(given, &own)?;
        Ok(own)
    }

    /// Holds a state of the scene's own to components that were given by its names: others may determine them, where
    /// levels of stages have more velocities than the constraints leave.
    ///
    /// # Errors
    /// [`Error::State`] with a component that others give another value.
    pub fn hold<'n>(
        &self,
        given: impl IntoIterator<Item = (&'n str, f64)>,
        own: &[f64],
    ) -> Result<(), Error> {
        for (name, value) in given {
            let Some(found) = self.info.state.iter().position(|n| n == name).map(|k| own[k]) else {
                continue;
            };
            if (found - value).abs() > DIFFERENT * value.abs().max(1.0) {
                let reason = format!(
                    "{name} is {value:?}, and the other components make it {found:?}: leave it out, or give the state by \
                     all of {}",
                    self.info.state.join(", ")
                );
                return Err(Error::State { path: "initial".into(), reason });
            }
        }
        Ok(())
    }

    /// A state in another form.
    ///
    /// # Errors
    /// Parameters that are not allowed, momenta that no velocities have or that cannot be carried.
    pub fn convert(
        &self,
        params: &[f64],
        t: f64,
        y: &[f64],
        [from, to]: [&Form; 2],
    ) -> Result<Vec<f64>, Error> {
        if from == to {
            return Ok(y.to_vec());
        }
        let converted = self.converted((params, params), t, y, [from, to])?;
        match converted.iter().position(|x| !x.is_finite()) {
            Some(at) => {
                let reason =
                    format!("has no finite {}, which follows from the other names", self.names(to)[at]);
                Err(Error::State { path: "the state".into(), reason })
            }
            None => Ok(converted),
        }
    }

    /// The derivative of [`convert`](Self::convert) along a direction of the parameters and one of the state, which
    /// dual numbers have.
    ///
    /// # Errors
    /// As [`Forms::convert`].
    pub fn slope(&self, along: &[Dual], y: &[Dual], [from, to]: [&Form; 2]) -> Result<Vec<Dual>, Error> {
        if from == to {
            return Ok(y.to_vec());
        }
        let params: Vec<f64> = along.iter().map(|x| x.value).collect();
        self.converted((along, &params), Dual::constant(0.0), y, [from, to])
    }

    /// A state in another form, over any scalar; the parameters also by their values.
    fn converted<R: Real>(
        &self,
        (params, values_of_params): (&[R], &[f64]),
        t: R,
        y: &[R],
        [from, to]: [&Form; 2],
    ) -> Result<Vec<R>, Error> {
        let mut values: BTreeMap<String, R> = self.names(from).into_iter().zip(y.iter().copied()).collect();
        let bad = |bad: ViolatedCondition| {
            let bad = BadParams { condition: bad.condition, meaning: bad.meaning };
            refused(&self.info, values_of_params, bad)
        };
        if from.is_carried() {
            let scene = self.scene_with(from)?;
            let interpreter = scene.executable.prepare_over(params).map_err(bad)?;
            let found = interpreter.outputs(t, &in_order(&scene.state, &values));
            values.extend(scene.outputs.iter().cloned().zip(found));
        }
        if to.is_carried() {
            let scene = self.scene_with(to)?;
            let interpreter = scene.executable.prepare_over(params).map_err(bad)?;
            let velocities = in_order(&scene.velocities, &values);
            let Some(found) = interpreter.legendre(t, &in_order(&scene.state, &values), &velocities) else {
                return Err(Error::unusable("the state", "has momenta that do not follow from velocities"));
            };
            values.extend(scene.carried.iter().cloned().zip(found));
        }
        Ok(in_order(&self.names(to), &values))
    }

    /// The value of one variable of some form at a state of the scene; none where there is no such variable.
    ///
    /// # Errors
    /// As [`Forms::convert`].
    pub fn value(&self, params: &[f64], y: &[f64], name: &str) -> Result<Option<f64>, Error> {
        if let Some(at) = self.info.state.iter().position(|own| own == name) {
            return Ok(Some(y[at]));
        }
        let Ok(form) = self.form_of([name]) else { return Ok(None) };
        let Some(at) = self.names(&form).iter().position(|own| own == name) else { return Ok(None) };
        Ok(Some(self.convert(params, 0.0, y, [&self.own, &form])?[at]))
    }

    /// The scene with what a form holds as state, and its velocities as outputs.
    fn scene_with(&self, form: &Form) -> Result<Arc<Carrying>, Error> {
        let mut known = self.carrying.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(scene) = known.get(form) {
            return Ok(Arc::clone(scene));
        }
        let slots = self.slots.iter().zip(&form.0).filter(|(_, held)| **held == Held::Momentum);
        let momenta: Vec<String> = slots.map(|(slot, held)| slot.name(*held).clone()).collect();
        let scene = Arc::new(self.built(&momenta, form.0.contains(&Held::Level))?);
        known.insert(form.clone(), Arc::clone(&scene));
        Ok(scene)
    }

    /// The scene with these momenta as state, and velocities along levels.
    fn built(&self, momenta: &[String], levels: bool) -> Result<Carrying, Error> {
        // Without a model there are no slots.
        let Some(model) = &self.model else { return Err(Error::unusable("initial", "has no other form")) };
        let carried = if levels { "carrying levels" } else { "carrying" };
        let what = format!("{carried} {}", momenta.join(" "));
        model.cached(&what, &self.info.scene, Carrying::is_sound, || {
            let built = scene::build_carrying(model, &self.info.scene, momenta, levels)?;
            let legendre = built.legendre();
            let outputs = built.outputs().iter().flat_map(|o| &o.components);
            Ok(Carrying {
                executable: built.executable(),
                state: built.state_names(),
                velocities: legendre.velocities.iter().map(|(name, _)| name.clone()).collect(),
                carried: legendre.momenta.iter().map(|(name, _)| name.clone()).collect(),
                outputs: outputs.map(|(name, _)| name.clone()).collect(),
            })
        })
    }
}

impl Form {
    /// Whether it holds anything but velocities of the model.
    fn is_carried(&self) -> bool {
        self.0.iter().any(|held| *held != Held::Velocity)
    }
}

/// Values by name; zero for what is about to be found in a state.
fn in_order<R: Real>(names: &[String], values: &BTreeMap<String, R>) -> Vec<R> {
    names.iter().map(|name| values.get(name).copied().unwrap_or(R::ZERO)).collect()
}
