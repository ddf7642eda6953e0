//! Named frames on bodies: their poses in space, and their twists in their own axes.
//!
//! Deliberately does not know: syntax, which scene wants a frame, derivatives by velocities.
//!
//! # Source
//! Murray, Li, Sastry 1994, A Mathematical Introduction to Robotic Manipulation, chapter 2: body velocity and its
//! change of frames.

use super::draft::{FrameMotion, ModelBuilder, NamedFrameDraft, ReconstructionDraft, Way};
use crate::spec::diagnostic::Span;
use crate::spec::event::OutputPart;
use crate::spec::group::Group;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::value::Value;
use crate::spec::want::Want;
use hamel_expr::{ExprId, Node, SymbolId};

pub(super) type Vector = [ExprId; 3];
type Rotation = [Vector; 3];

/// A frame in space.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    name: String,
    pub(super) place: Vector,
    pub(super) rotation: Rotation,
    pub(super) spin: Vector,
    pub(super) velocity: Vector,
}

impl ModelBuilder {
    /// The coordinates of the group that a pose consists of, where it is a planar or spatial rotation without a place,
    /// or a displacement with its own place.
    pub(in crate::spec) fn pose_of_group(
        &self,
        place: Option<&Value>,
        attitude: Option<&Value>,
    ) -> Option<Vec<SymbolId>> {
        let given: Vec<ExprId> = [attitude?, place.unwrap_or(&Value::Vector(Vec::new()))]
            .into_iter()
            .flat_map(|value| value.entries().to_vec())
            .collect();
        let is_it = |draft: &&ReconstructionDraft| {
            let is_rigid = matches!(
                draft.way,
                Way::Group(Group::PlanarRotation | Group::Rotation | Group::PlanarMotion | Group::Motion, _)
            );
            is_rigid
                && draft.symbols.len() == given.len()
                && draft.symbols.iter().zip(&given).all(|(s, e)| *self.graph.node(*e) == Node::Symbol(*s))
        };
        self.reconstructions.iter().find(is_it).map(|draft| draft.symbols.clone())
    }

    /// Notes a frame; [`ModelBuilder::check_frames`] places it.
    pub(in crate::spec) fn named_frame(&mut self, draft: NamedFrameDraft) {
        if let Some(reason) = names::refusal(&draft.name) {
            self.problem(draft.span, format!("`{}` cannot be used as a name", draft.name), reason);
        }
        self.named_frames.push(draft);
    }

    /// Places all frames in space; their poses and twists become outputs.
    pub(super) fn check_frames(&mut self, reconstruction: &[Reconstruction]) -> Vec<Placed> {
        let mut placed: Vec<Placed> = Vec::new();
        let (mut poses, mut twists) = (Vec::new(), Vec::new());
        let mut docs = Vec::new();
        for draft in std::mem::take(&mut self.named_frames) {
            let Some(frame) = self.placed_frame(&draft, &placed, reconstruction) else { continue };
            if placed.iter().any(|other| other.name == frame.name) {
                let message = format!("frame `{}` is declared twice", frame.name);
                self.problem(draft.span, message, "rename one of them");
                continue;
            }
            let named = |stem: &str, entries: &[ExprId]| -> Vec<(String, ExprId)> {
                let name = |k: usize| format!("{}_{stem}{}", frame.name, k + 1);
                entries.iter().enumerate().map(|(k, e)| (name(k), *e)).collect()
            };
            let mut own = named("p", &frame.place);
            for (i, row) in frame.rotation.iter().enumerate() {
                own.extend(named(&format!("R{}", i + 1), row));
            }
            let own_twist = [named("w", &frame.spin), named("v", &frame.velocity)].concat();
            let names = own.iter().chain(&own_twist).map(|(name, _)| name.as_str());
            self.check_component_names(draft.span, &format!("frame `{}`", draft.name), names);
            poses.extend(own);
            twists.extend(own_twist);
            docs.push(if draft.doc.is_empty() {
                frame.name.clone()
            } else {
                format!("{}, {}", frame.name, draft.doc)
            });
            placed.push(frame);
        }
        if placed.is_empty() {
            return placed;
        }
        let of = docs.join("; ");
        let output = |want: Want, components, doc: String, part| NamedVector {
            name: want.name().to_owned(),
            components,
            doc,
            part,
        };
        let doc = format!(
            "poses of frames in space: place `p`, and by rows the rotation `R` from the frame's axes to those of space; \
             {of}"
        );
        self.outputs.push(output(Want::FramePoses, poses, doc, OutputPart::Poses));
        let doc = format!(
            "twists of frames in their own axes: angular velocity `w`, `hat(w) = R^T R'`, and velocity `v = R^T p'`; {of}"
        );
        self.outputs.push(output(Want::FrameTwists, twists, doc, OutputPart::Twists));
        placed
    }

    /// Components of outputs are found by name: none may be anything else.
    pub(super) fn check_component_names<'n>(
        &mut self,
        span: Option<Span>,
        whose: &str,
        components: impl Iterator<Item = &'n str>,
    ) {
        for component in components {
            let declared = self.names.get(component).map(|declared| declared.what.words());
            let mut others = self.outputs.iter().flat_map(|output| &output.components);
            let is_output = others.any(|(name, _)| name == component);
            let Some(what) = declared.or(is_output.then_some("an output")) else { continue };
            let message = format!("{whose} has a component `{component}`, which is {what}");
            self.problem(span, message, "rename one of them");
            return;
        }
    }

    /// A frame, or that of a body, in space.
    pub(super) fn placed_frame(
        &mut self,
        draft: &NamedFrameDraft,
        placed: &[Placed],
        reconstruction: &[Reconstruction],
    ) -> Option<Placed> {
        let (what, name) = (draft.what, draft.name.clone());
        let parent = match &draft.on {
            None => None,
            Some((on, span)) => match placed.iter().find(|frame| frame.name == *on) {
                Some(parent) => Some(parent.clone()),
                None => {
                    let help = names::suggest(on, placed.iter().map(|frame| frame.name.as_str()));
                    let help =
                        if help.is_empty() { "declare that frame before this one".into() } else { help };
                    self.problem(
                        *span,
                        format!("{what} `{name}` is on `{on}`, which is no frame before it"),
                        help,
                    );
                    return None;
                }
            },
        };
        let (place, rotation, velocity, spin) = match &draft.motion {
            FrameMotion::Given { place, rotation, velocity, spin } => (*place, *rotation, *velocity, *spin),
            FrameMotion::OfGroup { place, rotation, symbols } => {
                if parent.is_some() {
                    let help = "leave out `on`: the coordinates of the group place a frame in space";
                    self.problem(
                        draft.span,
                        format!("{what} `{name}` is that of the group, on another frame"),
                        help,
                    );
                    return None;
                }
                // A wrong group has been told.
                let own = reconstruction.iter().find(|item| item.symbols == *symbols)?;
                if self.action.is_some_and(|(side, _)| side == Side::Right) {
                    let help = "frames follow a group that acts on the left";
                    self.problem(
                        draft.span,
                        format!("{what} `{name}` is that of a group that acts on the right"),
                        help,
                    );
                    return None;
                }
                let zero = self.graph.zero();
                let (velocity, spin) = match &own.kind {
                    ReconstructionKind::Pose { omega, v } => (*v, *omega),
                    ReconstructionKind::Quaternion { omega } => ([zero; 3], *omega),
                    ReconstructionKind::PlanarPose { omega, v } => ([v[0], v[1], zero], [zero, zero, *omega]),
                    ReconstructionKind::Angle { omega } => ([zero; 3], [zero, zero, *omega]),
                    _ => return None,
                };
                (*place, *rotation, velocity, spin)
            }
        };
        let Some(parent) = parent else { return Some(Placed { name, place, rotation, spin, velocity }) };
        let g = &mut self.graph;
        let mut in_space = [[g.zero(); 3]; 3];
        for (row, own) in in_space.iter_mut().zip(&parent.rotation) {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry = g.dot(own, &[rotation[0][j], rotation[1][j], rotation[2][j]]);
            }
        }
        let mut at = [g.zero(); 3];
        for (k, e) in at.iter_mut().enumerate() {
            let turned = g.dot(&parent.rotation[k], &place);
            *e = g.add(parent.place[k], turned);
        }
        let mut carried = [g.zero(); 3];
        for (k, e) in carried.iter_mut().enumerate() {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let (plus, minus) = (g.mul(parent.spin[i], place[j]), g.mul(parent.spin[j], place[i]));
            let across = g.sub(plus, minus);
            *e = g.add(parent.velocity[k], across);
        }
        let mut together = |before: &Vector, own: &Vector| -> Vector {
            std::array::from_fn(|j| {
                let turned = g.dot(&[rotation[0][j], rotation[1][j], rotation[2][j]], before);
                g.add(turned, own[j])
            })
        };
        let (spin, velocity) = (together(&parent.spin, &spin), together(&carried, &velocity));
        Some(Placed { name, place: at, rotation: in_space, spin, velocity })
    }
}
