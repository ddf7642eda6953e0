//! Named frames: their places and attitudes by values, and the rates of these.
//!
//! Deliberately does not know: how frames on each other are placed in space.

use super::values::Elaboration;
use crate::spec::ast::{Expr, Item, ItemKind};
use crate::spec::builder::{FrameMotion, NamedFrameDraft};
use crate::spec::value::Value;
use hamel_expr::ExprId;

impl Elaboration<'_> {
    /// Everything of the model is known where a frame is evaluated. One with a problem breaks those on it.
    pub(super) fn named_frame(&mut self, item: &Item) {
        let ItemKind::NamedFrame { name, on, at, attitude } = &item.kind else { return };
        match self.motion_of_frame(at.as_ref(), attitude.as_ref()) {
            Some((motion, _)) => {
                let draft = NamedFrameDraft {
                    what: "frame",
                    name: name.text.clone(),
                    on: on.as_ref().map(|on| (on.text.clone(), Some(on.span))),
                    motion,
                    doc: item.doc.join(" "),
                    span: Some(name.span),
                };
                self.builder.named_frame(draft);
            }
            None => _ = self.builder.broken.insert("frame of a body"),
        }
    }

    /// How a frame moves, and the rate of its place where the velocity in its own axes is that rate turned.
    pub(super) fn motion_of_frame(
        &mut self,
        at: Option<&Expr>,
        attitude: Option<&Expr>,
    ) -> Option<(FrameMotion, Option<[ExprId; 3]>)> {
        let place_value = match at {
            Some(expr) => Some(self.located(expr)?),
            None => None,
        };
        let attitude_value = match attitude {
            Some(expr) => Some(self.located(expr)?),
            None => None,
        };
        let n_problems = self.builder.problems.len();
        let zero = self.builder.graph.zero();
        let place = match &place_value {
            Some(value) => self.builder.place(value, "`at`", "at [x, y, 0]"),
            None => [zero; 3],
        };
        let rotation = self.builder.rotation(attitude_value.as_ref());
        if self.builder.problems.len() > n_problems {
            return None;
        }
        let of_group = [&place_value, &attitude_value].map(|part| part.as_ref().map(|(value, _)| value));
        if let Some(symbols) = self.builder.pose_of_group(of_group[0], of_group[1]) {
            return Some((FrameMotion::OfGroup { place, rotation, symbols }, None));
        }
        let spin = match attitude {
            None => [zero; 3],
            Some(expr) => match self.spin(expr)?.0 {
                Value::Scalar(w) => [zero, zero, w],
                w => three(&w, zero),
            },
        };
        let mut turned = None;
        let velocity = match at {
            None => [zero; 3],
            Some(expr) => {
                let own = attitude.and_then(|attitude| self.velocity_in_frame(expr, attitude));
                match own {
                    Some((velocity, _)) => three(&velocity, zero),
                    None => {
                        let rate = three(&self.velocity(expr)?.0, zero);
                        turned = Some(rate);
                        let g = &mut self.builder.graph;
                        std::array::from_fn(|j| {
                            g.dot(&[rotation[0][j], rotation[1][j], rotation[2][j]], &rate)
                        })
                    }
                }
            }
        };
        Some((FrameMotion::Given { place, rotation, velocity, spin }, turned))
    }
}

/// A vector of the plane, or of space.
fn three(value: &Value, zero: ExprId) -> [ExprId; 3] {
    let entries = value.entries();
    std::array::from_fn(|k| entries.get(k).copied().unwrap_or(zero))
}
