//! The variables in which a state of a scene may be given: the scene's own, or velocities in the place of momenta and
//! momenta in the place of velocities, where the model names both.
//!
//! The interpreter converts, whoever evaluates the scene, so that a state has the same bits everywhere.
//!
//! Does not know: requests, how a state is chosen.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use hamel_codegen::program::ViolatedCondition;
use hamel_codegen::scene::{self, Executable};
use serde::{Deserialize, Serialize};

use super::dynamics::{BadParams, Info};
use super::evaluate::refused;
use crate::error::Error;
use crate::model::Checked;

/// A component of the state that has two names.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Slot {
    /// Its place in the state.
    at: usize,
    velocity: String,
    momentum: String,
}

/// Which slots hold momenta, in the order of the slots; the others hold velocities.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Form(Vec<bool>);

/// The forms that the states of a scene may be given in.
#[derive(Debug)]
pub struct Forms {
    model: Option<Arc<Checked>>,
    info: Info,
    slots: Vec<Slot>,
    own: Form,
    /// Scenes that carry the momenta of a form, once they have been asked for.
    carrying: Mutex<BTreeMap<Form, Arc<Carrying>>>,
}

/// A scene that carries momenta, as far as conversions need it.
#[derive(Debug, Serialize, Deserialize)]
struct Carrying {
    executable: Executable,
    state: Vec<String>,
    /// The arguments of its Legendre transform.
    velocities: Vec<String>,
    /// The results of its Legendre transform.
    momenta: Vec<String>,
    /// What its outputs are: velocities by momenta.
    outputs: Vec<String>,
}

impl Forms {
    /// The scene's own variables alone.
    pub fn own(info: &Info) -> Forms {
        Forms {
            model: None,
            info: info.clone(),
            slots: Vec::new(),
            own: Form(Vec::new()),
            carrying: Mutex::default(),
        }
    }

    /// The scene's own variables, and what else the model calls them. A Hamiltonian has no momenta by velocities.
    pub fn of(model: &Arc<Checked>, info: &Info) -> Forms {
        let quasi = model.quasi_velocities.iter().map(|v| v.name.as_str());
        let velocities: Vec<&str> =
            model.all_velocities().into_iter().map(|(name, _)| name).chain(quasi).collect();
        let place = |name: &str| info.state.iter().position(|own| own == name);
        let momenta = model.momenta.iter().filter(|_| model.hamiltonian.is_none());
        let components = momenta.flat_map(|m| &m.components);
        let mut found: Vec<(Slot, bool)> = components
            .filter_map(|(momentum, _, k)| {
                let velocity = velocities[*k];
                let (at, carried) = match (place(momentum), place(velocity)) {
                    (Some(at), _) => (at, true),
                    (None, Some(at)) => (at, false),
                    (None, None) => return None,
                };
                Some((Slot { at, velocity: velocity.to_owned(), momentum: momentum.clone() }, carried))
            })
            .collect();
        found.sort_by_key(|(slot, _)| slot.at);
        let (slots, own): (Vec<Slot>, Vec<bool>) = found.into_iter().unzip();
        Forms { model: Some(Arc::clone(model)), slots, own: Form(own), ..Forms::own(info) }
    }

    /// The form of the scene's own state.
    pub fn own_form(&self) -> Form {
        self.own.clone()
    }

    /// All velocities.
    pub(crate) fn velocities(&self) -> Form {
        Form(vec![false; self.slots.len()])
    }

    /// The momenta that are named, and the velocities of all others.
    pub(crate) fn with_momenta_of(&self, names: &BTreeMap<String, f64>) -> Form {
        Form(self.slots.iter().map(|slot| names.contains_key(&slot.momentum)).collect())
    }

    /// Every name that some form has: the scene's own first.
    pub fn known(&self) -> Vec<&str> {
        let others = self.slots.iter().zip(&self.own.0);
        let others = others
            .map(|(slot, carried)| if *carried { slot.velocity.as_str() } else { slot.momentum.as_str() });
        self.info.state.iter().map(String::as_str).chain(others).collect()
    }

    /// Names of the components of a state in a form.
    pub fn names(&self, form: &Form) -> Vec<String> {
        let mut names = self.info.state.clone();
        for (slot, is_momentum) in self.slots.iter().zip(&form.0) {
            names[slot.at].clone_from(if *is_momentum { &slot.momentum } else { &slot.velocity });
        }
        names
    }

    /// The form of a state given by these names: the first of `preferred`, the scene's own, velocities, momenta that
    /// has all of them. Names that no form has are of no account.
    ///
    /// # Errors
    /// Why there is none.
    pub(crate) fn form_among<'n>(
        &self,
        preferred: &[Form],
        names: impl IntoIterator<Item = &'n str>,
    ) -> Result<Form, String> {
        let names: BTreeSet<&str> = names.into_iter().collect();
        let suits = |form: &&Form| {
            let mut slots = self.slots.iter().zip(&form.0);
            slots.all(|(slot, is_momentum)| {
                let other = if *is_momentum { &slot.velocity } else { &slot.momentum };
                !names.contains(other.as_str())
            })
        };
        let all = [self.own.clone(), self.velocities(), Form(vec![true; self.slots.len()])];
        if let Some(form) = preferred.iter().chain(&all).find(suits) {
            return Ok(form.clone());
        }
        let given = |name: fn(&Slot) -> &String| {
            let given = self.slots.iter().map(name).filter(|name| names.contains(name.as_str()));
            given.cloned().collect::<Vec<String>>().join(", ")
        };
        Err(format!(
            "mixes velocities ({}) with momenta ({}): give all of them by velocities, all by momenta, or what the scene \
             carries",
            given(|slot| &slot.velocity),
            given(|slot| &slot.momentum)
        ))
    }

    /// The form of a state that is given by these names.
    ///
    /// # Errors
    /// As `form_among`.
    pub fn form_of<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Result<Form, String> {
        self.form_among(&[], names)
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
        let mut values: BTreeMap<String, f64> = self.names(from).into_iter().zip(y.iter().copied()).collect();
        if from.0.contains(&true) {
            let scene = self.scene_with(from)?;
            let interpreter = self.prepared(&scene.executable, params)?;
            let found = interpreter.outputs(t, &in_order(&scene.state, &values));
            values.extend(scene.outputs.iter().cloned().zip(found));
        }
        if to.0.contains(&true) {
            let scene = self.scene_with(to)?;
            let interpreter = self.prepared(&scene.executable, params)?;
            let velocities = in_order(&scene.velocities, &values);
            let Some(found) = interpreter.legendre(t, &in_order(&scene.state, &values), &velocities) else {
                return Err(Error::unusable("the state", "has momenta that do not follow from velocities"));
            };
            values.extend(scene.momenta.iter().cloned().zip(found));
        }
        let names = self.names(to);
        let converted = in_order(&names, &values);
        match converted.iter().position(|x| !x.is_finite()) {
            Some(at) => {
                let reason = format!("has no finite {}, which follows from the other names", names[at]);
                Err(Error::State { path: "the state".into(), reason })
            }
            None => Ok(converted),
        }
    }

    /// The value of one variable of some form at a state of the scene; none where there is no such variable.
    ///
    /// # Errors
    /// As [`Forms::convert`].
    pub(crate) fn value(&self, params: &[f64], y: &[f64], name: &str) -> Result<Option<f64>, Error> {
        if let Some(at) = self.info.state.iter().position(|own| own == name) {
            return Ok(Some(y[at]));
        }
        let Ok(form) = self.form_of([name]) else { return Ok(None) };
        let Some(at) = self.names(&form).iter().position(|own| own == name) else { return Ok(None) };
        Ok(Some(self.convert(params, 0.0, y, [&self.own, &form])?[at]))
    }

    fn prepared<'a>(
        &self,
        executable: &'a Executable,
        params: &[f64],
    ) -> Result<scene::Interpreter<'a>, Error> {
        let bad = |bad: ViolatedCondition| BadParams { condition: bad.condition, meaning: bad.meaning };
        executable.prepare(params).map_err(|e| refused(&self.info, params, bad(e)))
    }

    /// The scene with the momenta of a form as state, and its velocities as outputs.
    fn scene_with(&self, form: &Form) -> Result<Arc<Carrying>, Error> {
        let mut known = self.carrying.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(scene) = known.get(form) {
            return Ok(Arc::clone(scene));
        }
        // Without a model there are no slots.
        let Some(model) = &self.model else { return Err(Error::unusable("initial", "has no other form")) };
        let slots = self.slots.iter().zip(&form.0).filter(|(_, is_momentum)| **is_momentum);
        let momenta: Vec<String> = slots.map(|(slot, _)| slot.momentum.clone()).collect();
        let scene = model.cached(&format!("carrying {}", momenta.join(" ")), &self.info.scene, || {
            let built = scene::build_carrying(model, &self.info.scene, &momenta)?;
            let legendre = built.legendre();
            let outputs = built.outputs().iter().flat_map(|o| &o.components);
            Ok(Carrying {
                executable: built.executable(),
                state: built.state_names(),
                velocities: legendre.velocities.iter().map(|(name, _)| name.clone()).collect(),
                momenta: legendre.momenta.iter().map(|(name, _)| name.clone()).collect(),
                outputs: outputs.map(|(name, _)| name.clone()).collect(),
            })
        })?;
        let scene = Arc::new(scene);
        known.insert(form.clone(), Arc::clone(&scene));
        Ok(scene)
    }
}

/// Values by name; zero for the momenta in a state at which they are about to be found.
fn in_order(names: &[String], values: &BTreeMap<String, f64>) -> Vec<f64> {
    names.iter().map(|name| values.get(name).copied().unwrap_or_default()).collect()
}
