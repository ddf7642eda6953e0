//! Bodies in space: the place and the velocity of their mass centre, and their momentum about it.
//!
//! With masses `m_b`, mass centres `p_b` with velocities `v_b`, rotations `R_b`, angular velocities `w_b` and inertias
//! `I_b` in the bodies' own axes: `c = sum m_b p_b/m`, `c' = sum m_b v_b/m`, linear momentum `l = sum m_b v_b`, and
//! about the mass centre `k = sum R_b I_b w_b + (p_b - c) x m_b v_b`.
//!
//! Deliberately does not know: syntax, derivatives by velocities, which scene wants what.
//!
//! # Source
//! Orin, Goswami, Lee 2013, Centroidal dynamics of a humanoid robot, sections 2 and 3.

use super::draft::{BodyDraft, ModelBuilder};
use super::named_frames::{Placed, Vector};
use crate::spec::event::OutputPart;
use crate::spec::model::*;
use crate::spec::want::Want;
use hamel_expr::{ExprId, Graph};

/// A body in space.
struct Weighed {
    mass: ExprId,
    place: Vector,
    velocity: Vector,
    rotation: [Vector; 3],
    inertia: [Vector; 3],
    /// `R I w`.
    turning: Vector,
}

impl ModelBuilder {
    /// Whether a scene wants something that is made of all bodies.
    pub(in crate::spec) fn wants_centroid(&self) -> bool {
        let mut wants = self.scenes.iter().flat_map(|scene| &scene.wants);
        wants.any(|(name, _)| Want::from_name(name).is_some_and(Want::is_of_bodies))
    }

    /// Places all bodies; what they are together becomes outputs where a scene wants it.
    pub(super) fn check_bodies(&mut self, frames: &[Placed], reconstruction: &[Reconstruction]) {
        let mut bodies = Vec::new();
        for draft in std::mem::take(&mut self.bodies) {
            bodies.extend(self.weighed(&draft, frames, reconstruction));
        }
        if !self.wants_centroid() || bodies.iter().all(|body| body.mass == self.graph.zero()) {
            return;
        }
        let g = &mut self.graph;
        let (mass, place, velocity) = mass_centre(g, &bodies);
        let linear = velocity.map(|v| g.mul(mass, v));
        let angular = angular_momentum(g, &bodies, &place);
        let of_bodies = bodies.iter().flat_map(|body| {
            let entries = body.rotation.iter().chain(&body.inertia).flatten();
            body.place.iter().chain([&body.mass]).chain(entries).copied()
        });
        let of_bodies = of_bodies.enumerate().map(|(k, e)| (format!("body_number{}", k + 1), e)).collect();
        let named = |stems: [&str; 2], values: [Vector; 2]| {
            let pairs = stems.into_iter().zip(values);
            pairs
                .flat_map(|(stem, v)| (0..3).map(move |k| (format!("{stem}{}", k + 1), v[k])))
                .collect::<Vec<_>>()
        };
        let centre = named(["center_of_mass_p", "center_of_mass_v"], [place, velocity]);
        let momentum =
            named(["centroidal_momentum_angular", "centroidal_momentum_linear"], [angular, linear]);
        let doc = "mass centre of all bodies in space: its place, then its velocity";
        self.totals_of_bodies(Want::CenterOfMass.name(), centre, doc, OutputPart::CenterOfMass);
        let doc = "momentum of all bodies in the axes of space: the angular momentum about their mass centre, then the \
                   linear momentum";
        self.totals_of_bodies(Want::CentroidalMomentum.name(), momentum, doc, OutputPart::CentroidalMomentum);
        self.totals_of_bodies("bodies", of_bodies, "bodies in space", OutputPart::Bodies);
    }

    fn totals_of_bodies(
        &mut self,
        name: &str,
        components: Vec<(String, ExprId)>,
        doc: &str,
        part: OutputPart,
    ) {
        if part != OutputPart::Bodies {
            let names = components.iter().map(|(name, _)| name.as_str());
            self.check_component_names(None, &format!("`{name}`"), names);
        }
        let (name, doc) = (name.to_owned(), doc.to_owned());
        self.outputs.push(NamedVector { name, components, doc, part });
    }

    fn weighed(
        &mut self,
        draft: &BodyDraft,
        frames: &[Placed],
        reconstruction: &[Reconstruction],
    ) -> Option<Weighed> {
        let Placed { place, rotation, spin, velocity, .. } =
            self.placed_frame(&draft.frame, frames, reconstruction)?;
        let g = &mut self.graph;
        let velocity = match draft.rate {
            Some(rate) if draft.frame.on.is_none() => rate,
            _ => times(g, &rotation, &velocity),
        };
        let own = times(g, &draft.inertia, &spin);
        let turning = times(g, &rotation, &own);
        Some(Weighed { mass: draft.mass, place, velocity, rotation, inertia: draft.inertia, turning })
    }
}

fn times(g: &mut Graph, matrix: &[Vector; 3], v: &Vector) -> Vector {
    std::array::from_fn(|i| g.dot(&matrix[i], v))
}

/// The mass of all bodies, the place of their mass centre, and its velocity.
fn mass_centre(g: &mut Graph, bodies: &[Weighed]) -> (ExprId, Vector, Vector) {
    let masses: Vec<ExprId> = bodies.iter().map(|body| body.mass).collect();
    let mass = g.sum(&masses);
    let inverse = g.powi(mass, -1);
    let mut mean = |of: fn(&Weighed) -> &Vector| -> Vector {
        std::array::from_fn(|k| {
            let values: Vec<ExprId> = bodies.iter().map(|body| of(body)[k]).collect();
            let sum = g.dot(&masses, &values);
            g.mul(sum, inverse)
        })
    };
    (mass, mean(|body| &body.place), mean(|body| &body.velocity))
}

/// The angular momentum about a place, which is the mass centre: no velocity has to be subtracted.
fn angular_momentum(g: &mut Graph, bodies: &[Weighed], centre: &Vector) -> Vector {
    let mut terms: [Vec<ExprId>; 3] = Default::default();
    for body in bodies {
        let arm: Vector = std::array::from_fn(|k| g.sub(body.place[k], centre[k]));
        let momentum = body.velocity.map(|v| g.mul(body.mass, v));
        for (k, terms) in terms.iter_mut().enumerate() {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let (plus, minus) = (g.mul(arm[i], momentum[j]), g.mul(arm[j], momentum[i]));
            terms.extend([body.turning[k], plus, g.neg(minus)]);
        }
    }
    terms.map(|terms| g.sum(&terms))
}
