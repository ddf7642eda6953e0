//! What bodies declare: velocities, momenta and kinetic energy; and what they look like.
//!
//! Deliberately does not know: how expressions are evaluated, in which order.

use super::values::Elaboration;
use crate::spec::ast::{BodyItem, BodyPart, Expr};
use crate::spec::builder::{BodyDraft, NamedFrameDraft, Placement};
use crate::spec::diagnostic::Span;
use crate::spec::eval::Weighed;
use crate::spec::shape::Shape;
use crate::spec::value::Value;
use hamel_expr::{ExprId, Func, Graph, Rational};

impl Elaboration<'_> {
    /// A part of a body: `p'`, the angular velocity `w` with `hat(w) = R^T R'`, `m p'`, `I w`, and the kinetic energy
    /// `m/2 p'.p' + 1/2 w.I w`, with `p'` in the frame of the body where its place is written in frames that turn.
    /// Nothing after a problem.
    pub(super) fn part(&mut self, body: &BodyItem, part: BodyPart) -> Option<Weighed> {
        let (translation, rotation) =
            (body.mass.as_ref().zip(body.place.as_ref()), body.inertia.as_ref().zip(body.attitude.as_ref()));
        match part {
            BodyPart::Velocity => self.velocity(translation?.1),
            BodyPart::Spin => self.spin(rotation?.1),
            BodyPart::Momentum => self.momentum(translation?),
            BodyPart::AngularMomentum => self.angular_momentum(rotation?),
            BodyPart::Energy => {
                let mut terms = Vec::new();
                if let Some((mass, place)) = translation {
                    let in_frame = rotation.and_then(|(_, attitude)| self.velocity_in_frame(place, attitude));
                    terms.push(match in_frame {
                        Some(v) => self.in_own_frame(mass, v)?,
                        None => {
                            let (v, p) = (self.velocity(place)?, self.momentum((mass, place))?);
                            self.half(v, p, place.span)?
                        }
                    });
                }
                if let Some((inertia, attitude)) = rotation {
                    let (w, l) = (self.spin(attitude)?, self.angular_momentum((inertia, attitude))?);
                    terms.push(self.half(w, l, attitude.span)?);
                }
                let bits = terms.iter().map(|(_, bits)| *bits).max()?;
                let entries: Vec<_> = terms.iter().flat_map(|(value, _)| value.entries().to_vec()).collect();
                Some((Value::Scalar(self.builder.graph.sum(&entries)), bits + 8))
            }
        }
    }

    /// A body among all of them: one on a frame, or any where a scene wants their mass centre or momentum. Problems of
    /// another have been told by the names that it declares.
    pub(super) fn weighed_body(&mut self, body: &BodyItem) {
        if body.on.is_none() && !(self.builder.wants_centroid() && self.builder.problems.is_empty()) {
            return;
        }
        match self.body_draft(body) {
            Some(draft) => self.builder.bodies.push(draft),
            None => _ = self.builder.broken.insert("frame of a body"),
        }
    }

    fn body_draft(&mut self, body: &BodyItem) -> Option<BodyDraft> {
        let (motion, rate) = self.motion_of_frame(body.place.as_ref(), body.attitude.as_ref())?;
        let zero = self.builder.graph.zero();
        let mass = match &body.mass {
            Some(mass) => self.mass(mass)?.0,
            None => zero,
        };
        let inertia = match &body.inertia {
            Some(inertia) => self.inertia(inertia)?,
            None => [[zero; 3]; 3],
        };
        let frame = NamedFrameDraft {
            what: "body",
            name: body.name.text.clone(),
            on: body.on.as_ref().map(|on| (on.text.clone(), Some(on.span))),
            motion,
            doc: String::new(),
            span: Some(body.name.span),
        };
        Some(BodyDraft { frame, rate, mass, inertia })
    }

    /// An inertia in space; that of a body in the plane is about the third axis.
    fn inertia(&mut self, inertia: &Expr) -> Option<[[ExprId; 3]; 3]> {
        let zero = self.builder.graph.zero();
        match self.weighed(inertia)?.0 {
            Value::Scalar(i) => Some([[zero; 3], [zero; 3], [zero, zero, i]]),
            Value::Matrix { rows: 3, columns: 3, entries: e } => {
                Some([[e[0], e[1], e[2]], [e[3], e[4], e[5]], [e[6], e[7], e[8]]])
            }
            other => {
                let message = format!(
                    "the inertia has to be matrix(3, 3), or a number in the plane, found {}",
                    other.shape()
                );
                self.problem(inertia.span, message, "write `diag([I1, I2, I3])`");
                None
            }
        }
    }

    /// The view of a body: the cuboid of even density with its mass and inertia where the axes of its frame are
    /// principal, `a_k = sqrt(6 (I1 + I2 + I3 - 2 I_k)/m)`, the disk `r = sqrt(2 I/m)` in the plane, and otherwise the
    /// point of its place. A body without a place has no size, and is not drawn; nor is one whose place is a number.
    pub(super) fn picture(&mut self, body: &BodyItem, doc: &str) {
        let Some((mass, place)) = body.mass.as_ref().zip(body.place.as_ref()) else { return };
        let (Some(Value::Scalar(mass)), Some(at)) = (self.eval(mass), self.located(place)) else { return };
        if !matches!(at.0, Value::Vector(_)) {
            return;
        }
        let rotation = body.inertia.as_ref().zip(body.attitude.as_ref());
        let rotation = rotation.and_then(|(i, attitude)| Some((self.eval(i)?, self.located(attitude)?)));
        let g = &mut self.builder.graph;
        let length = |g: &mut Graph, sum: ExprId, factor: i64| {
            let (factor, inverse) = (g.int(factor), g.powi(mass, -1));
            let square = g.product(&[factor, sum, inverse]);
            // Of a flat body it is zero, or rounding.
            let square = g.func(Func::Abs, square);
            g.sqrt(square)
        };
        let solid = rotation.and_then(|(inertia, attitude)| match (&inertia, &attitude.0) {
            (Value::Scalar(i), Value::Scalar(_)) => {
                let radius = length(g, *i, 2);
                let tenth = g.rational(Rational::new(1.into(), 10.into()));
                Some(("disk", vec![radius, g.mul(tenth, radius)], attitude))
            }
            (
                Value::Matrix { rows: 3, columns: 3, entries: i },
                Value::Matrix { rows: 3, columns: 3, .. },
            ) if inertia.is_diagonal(g) => {
                let principal = [i[0], i[4], i[8]];
                let edges = (0..3).map(|k| {
                    let own = g.neg(principal[k]);
                    let sum = g.sum(&[principal[(k + 1) % 3], principal[(k + 2) % 3], own]);
                    length(g, sum, 6)
                });
                Some(("box", edges.collect(), attitude))
            }
            _ => None,
        });
        let name = body.name.text.as_str();
        let builder = self.builder.at(Some(body.name.span));
        match solid {
            Some((shape, sizes, attitude)) => {
                let sizes: Vec<_> = sizes.into_iter().map(|size| (Value::Scalar(size), None)).collect();
                let placement = Placement { at: Some(at), attitude: Some(attitude), ..Placement::default() };
                builder.located_view(name, (shape, None), &sizes, placement, doc);
            }
            None => _ = builder.located_view(name, ("point", None), &[at], Placement::default(), doc),
        }
    }

    pub(super) fn velocity(&mut self, place: &Expr) -> Option<Weighed> {
        let (value, bits) = self.weighed(place)?;
        let rates = self.builder.rates();
        let mut evaluator = self.evaluator(&[], None);
        evaluator.rates = Some(&rates);
        Some((evaluator.rate_of_value(&value, place.span)?, bits + 16))
    }

    /// The velocity of a place in the frame of a body, where it follows from velocities in the frames before.
    pub(super) fn velocity_in_frame(&mut self, place: &Expr, attitude: &Expr) -> Option<Weighed> {
        let n_problems = self.builder.problems.len();
        let values = [self.velocity(place), self.weighed(place), self.weighed(attitude)];
        let [Some((velocity, bits)), Some((place, _)), Some((attitude, turned))] = values else {
            // Whoever takes the velocity in space finds them again.
            self.builder.problems.truncate(n_problems);
            return None;
        };
        let rates = self.builder.rates();
        let mut evaluator = self.evaluator(&[], None);
        evaluator.rates = Some(&rates);
        Some((evaluator.velocity_in_frame(&place, &velocity, &attitude)?, bits + turned))
    }

    /// `m/2 v.v`.
    fn in_own_frame(&mut self, mass: &Expr, (v, bits): Weighed) -> Option<Weighed> {
        let (m, mass_bits) = self.mass(mass)?;
        let g = &mut self.builder.graph;
        let square = v.dot(g, &v).ok()?.scalar("dot").ok()?;
        let half = g.rational(Rational::new(1.into(), 2.into()));
        Some((Value::Scalar(g.product(&[half, m, square])), 2 * bits + mass_bits + 8))
    }

    pub(super) fn spin(&mut self, attitude: &Expr) -> Option<Weighed> {
        let (value, bits) = self.weighed(attitude)?;
        let rates = self.builder.rates();
        let mut evaluator = self.evaluator(&[], None);
        evaluator.rates = Some(&rates);
        Some((evaluator.spin_of_value(&value, attitude.span)?, 2 * bits + 16))
    }

    fn weighed(&mut self, expr: &Expr) -> Option<Weighed> {
        let rates = self.builder.rates();
        let mut evaluator = self.evaluator(&[], None);
        evaluator.rates = Some(&rates);
        evaluator.eval(expr)
    }

    fn mass(&mut self, mass: &Expr) -> Option<(ExprId, u64)> {
        let (m, bits) = self.weighed(mass)?;
        let Value::Scalar(m) = m else {
            let message = format!("a mass is a number, found {}", m.shape());
            self.problem(mass.span, message, "one number for a body");
            return None;
        };
        Some((m, bits))
    }

    fn momentum(&mut self, (mass, place): (&Expr, &Expr)) -> Option<Weighed> {
        let (v, bits) = self.velocity(place)?;
        let (m, mass_bits) = self.mass(mass)?;
        Some((v.scale(&mut self.builder.graph, m), bits + mass_bits))
    }

    fn angular_momentum(&mut self, (inertia, attitude): (&Expr, &Expr)) -> Option<Weighed> {
        let (w, bits) = self.spin(attitude)?;
        let (i, inertia_bits) = self.weighed(inertia)?;
        let fits = match (w.shape(), i.shape()) {
            (Shape::Scalar, Shape::Scalar) => true,
            (Shape::Vector(n), Shape::Matrix(rows, columns)) => n == rows && n == columns,
            _ => false,
        };
        if !fits {
            let (wanted, help) = match w.shape() {
                Shape::Scalar => ("a number", "in the plane a body has one moment of inertia"),
                _ => ("matrix(3, 3)", "write `diag([I1, I2, I3])`, or declare a parameter `diagonal(3)`"),
            };
            self.problem(inertia.span, format!("the inertia has to be {wanted}, found {}", i.shape()), help);
            return None;
        }
        Some((i.mul(&mut self.builder.graph, &w).ok()?, bits + inertia_bits + 8))
    }

    /// Half the product of a velocity and its momentum.
    fn half(&mut self, (v, v_bits): Weighed, (p, p_bits): Weighed, span: Span) -> Option<Weighed> {
        let g = &mut self.builder.graph;
        let product = match (&v, &p) {
            (Value::Scalar(a), Value::Scalar(b)) => g.mul(*a, *b),
            (Value::Vector(_), Value::Vector(_)) => v.dot(g, &p).ok()?.scalar("dot").ok()?,
            _ => {
                let help = "write a vector for a place, such as `[x, y]`";
                self.problem(span, format!("a place is a number or a vector, found {}", v.shape()), help);
                return None;
            }
        };
        let half = g.rational(Rational::new(1.into(), 2.into()));
        Some((Value::Scalar(g.mul(half, product)), v_bits + p_bits + 8))
    }
}
