//! What a figure in space shows of a model.

use super::draft::ModelBuilder;
use crate::algebra::{Functions, LieAlgebra};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::names;
use crate::spec::value::Value;
use crate::spec::view::{View, ViewShape};
use hamel_expr::{ExprId, Graph, Number};

/// Where a shape of a [`View`] is; all parts may be left out.
#[derive(Clone, Debug, Default)]
pub struct Placement {
    /// Centre of the shape in its frame, in place of the frame's origin.
    pub around: Option<(Value, Option<Span>)>,
    /// Origin of the frame in space: `vector(3)`, or `vector(2)` in the plane `z = 0`.
    pub at: Option<(Value, Option<Span>)>,
    /// Frame to space: an angle about the third axis, a quaternion `w, x, y, z`, or a rotation matrix.
    pub attitude: Option<(Value, Option<Span>)>,
}

/// The shape that belongs to an algebra.
pub(in crate::spec) const FIELD: &str = "field";

/// Shapes by name, with the form of their arguments.
const SHAPES: [(&str, &str); 7] = [
    ("box", "box(length, width, height)"),
    ("disk", "disk(radius)` or `disk(radius, thickness)"),
    ("ball", "ball(radius)"),
    ("segment", "segment(from, to)"),
    ("point", "point(place)"),
    ("path", "path(place)"),
    (FIELD, "field(algebra, coefficients)"),
];

impl ModelBuilder {
    /// A shape that a figure in space shows: `box`, `disk`, `ball`, `segment`, `point` or `path` with its arguments.
    ///
    /// ```
    /// use hamel_lang::spec::{Group, LieAlgebra, ModelBuilder, Placement, Value};
    ///
    /// let mut b = ModelBuilder::new("sphere");
    /// let omega = b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]).remove(0);
    /// let energy = omega.dot(b.graph(), &omega).unwrap();
    /// b.lagrangian(&energy).reconstruct_group(&["q"], Group::Rotation, &["Omega"], "");
    /// let radius = Value::number(b.graph(), hamel_lang::spec::Rational::from_integer(2.into()));
    /// b.view("ball", "ball", &[radius.clone()], Placement::default(), "");
    /// assert_eq!(b.clone().build().unwrap().views.list.len(), 1);
    /// b.view("cube", "box", &[radius], Placement::default(), "");
    /// assert!(b.build().unwrap_err().to_string().contains("`box` takes 3 arguments, found 1"));
    /// ```
    pub fn view(
        &mut self,
        name: &str,
        shape: &str,
        arguments: &[Value],
        placement: Placement,
        doc: &str,
    ) -> &mut Self {
        let here = self.here;
        let arguments: Vec<_> = arguments.iter().map(|a| (a.clone(), here)).collect();
        self.located_view(name, (shape, here), &arguments, placement, doc)
    }

    pub(in crate::spec) fn located_view(
        &mut self,
        name: &str,
        (shape, shape_span): (&str, Option<Span>),
        arguments: &[(Value, Option<Span>)],
        placement: Placement,
        doc: &str,
    ) -> &mut Self {
        self.check_view_name(name);
        let Some((_, form)) = SHAPES.iter().find(|(known, _)| *known == shape) else {
            let help = names::suggest(shape, SHAPES.iter().map(|(name, _)| *name));
            self.problem(shape_span, format!("unknown shape `{shape}`"), help);
            return self;
        };
        if shape == FIELD {
            let help = "call `field_view`, which takes the algebra";
            self.problem(shape_span, "a field is a function that an algebra has waves for".to_owned(), help);
            return self;
        }
        let (counts, n_points) = match shape {
            "box" => (3..=3, 0),
            "disk" => (1..=2, 0),
            "ball" => (1..=1, 0),
            "segment" => (2..=2, 2),
            _ => (1..=1, 1),
        };
        if !counts.contains(&arguments.len()) {
            let (low, high) = (*counts.start(), *counts.end());
            let count = if low == high { low.to_string() } else { format!("{low} or {high}") };
            let plural = if count == "1" { "" } else { "s" };
            let message = format!("`{shape}` takes {count} argument{plural}, found {}", arguments.len());
            self.problem(shape_span, message, format!("write `{form}`"));
            return self;
        }
        let before = self.problems.len();
        let zero = self.graph.zero();
        let (mut sizes, mut points) = (Vec::new(), Vec::new());
        for argument in arguments {
            if n_points > 0 {
                points.push(self.place(argument, &format!("an argument of `{shape}`"), form));
                continue;
            }
            match &argument.0 {
                Value::Scalar(e) => sizes.push(*e),
                other => {
                    let message =
                        format!("an argument of `{shape}` must be a number, found {}", other.shape());
                    self.problem(argument.1, message, format!("write `{form}`"));
                }
            }
        }
        if let Some(around) = &placement.around {
            if n_points > 0 {
                let help = format!("write the place as an argument, as in `{form}`");
                self.problem(around.1, format!("`{shape}` has no centre to be `around`"), help);
            }
            points.push(self.place(around, "`around`", "around [0, 0, 1]"));
        } else if n_points == 0 {
            points.push([zero; 3]);
        }
        let origin = match &placement.at {
            Some(at) => self.place(at, "`at`", "at [x, y, 0]"),
            None => [zero; 3],
        };
        let rotation = self.rotation(placement.attitude.as_ref());
        if self.problems.len() > before {
            return self;
        }
        let g = &mut self.graph;
        let points = points.iter().map(|p| moved(g, &rotation, p, &origin)).collect();
        let shape = match (shape, sizes.as_slice()) {
            ("box", [a, b, c]) => ViewShape::Box { edges: [*a, *b, *c] },
            ("disk", [radius, rest @ ..]) => {
                ViewShape::Disk { radius: *radius, thickness: rest.first().copied().unwrap_or(zero) }
            }
            ("ball", [radius, ..]) => ViewShape::Ball { radius: *radius },
            ("segment", _) => ViewShape::Segment,
            ("point", _) => ViewShape::Point,
            _ => ViewShape::Path,
        };
        self.push_view(name, shape, points, Some(rotation), doc);
        self
    }

    fn check_view_name(&mut self, name: &str) {
        let here = self.here;
        if let Some(reason) = names::refusal(name) {
            self.problem(here, format!("`{name}` cannot be used as a name"), reason);
        }
        if let Some(first) = self.views.iter().find(|v| v.name == name) {
            let problem = Diagnostic::new(here, format!("view `{name}` is declared twice"))
                .with_place(first.span, "first here")
                .with_help("rename one of them");
            self.problems.push(problem);
        }
    }

    /// A picture of a function on the torus, `f(x) = 2 sum (re_m cos(m.x) - im_m sin(m.x))` over the waves of the basis
    /// of an algebra such as `zeitlin(N)` and `torus(K)`.
    ///
    /// # Shapes
    /// `coefficients`: a vector of the algebra's dimension, `re_m` and `im_m` for each wave in the order of its basis.
    ///
    /// # Errors
    /// A problem of the model where the algebra has no basis of waves, or the vector another shape.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder, ViewShape};
    ///
    /// let mut b = ModelBuilder::new("flow");
    /// let torus = LieAlgebra::torus(1).unwrap();
    /// let omega = b.velocities(torus.clone(), &["omega"]).remove(0);
    /// let energy = omega.dot(b.graph(), &omega).unwrap();
    /// b.lagrangian(&energy).field_view("picture", &torus, &omega, "");
    /// let view = b.build().unwrap().views.list.remove(0);
    /// assert!(matches!(view.shape, ViewShape::Field { waves, .. } if waves.len() == 4));
    /// ```
    pub fn field_view(
        &mut self,
        name: &str,
        algebra: &LieAlgebra<Number>,
        coefficients: &Value,
        doc: &str,
    ) -> &mut Self {
        let here = self.here;
        self.check_view_name(name);
        let Some(Functions::Torus(modes)) = algebra.functions() else {
            let message = format!("{} has no basis of waves", algebra.name());
            self.problem(here, message, "zeitlin(N) and torus(K) have one");
            return self;
        };
        match coefficients {
            Value::Vector(entries) if entries.len() == algebra.dim() => {
                let shape = ViewShape::Field { waves: modes.waves().to_vec(), coefficients: entries.clone() };
                self.push_view(name, shape, Vec::new(), None, doc);
            }
            other => {
                let (n, found) = (algebra.dim(), other.shape());
                let message = format!("the coefficients of a field must be vector({n}), found {found}");
                self.problem(here, message, "write real and imaginary part for each wave");
            }
        }
        self
    }

    fn push_view(
        &mut self,
        name: &str,
        shape: ViewShape,
        points: Vec<[ExprId; 3]>,
        rotation: Option<[[ExprId; 3]; 3]>,
        doc: &str,
    ) {
        let rotation = rotation.unwrap_or_else(|| self.rotation(None));
        let (name, doc, span) = (name.to_owned(), doc.to_owned(), self.here);
        self.views.push(View { name, shape, points, rotation, doc, span });
    }

    /// A place in space; zero when a problem was reported.
    pub(in crate::spec) fn place(
        &mut self,
        (value, span): &(Value, Option<Span>),
        what: &str,
        form: &str,
    ) -> [ExprId; 3] {
        let zero = self.graph.zero();
        match value {
            Value::Vector(v) if v.len() == 3 => [v[0], v[1], v[2]],
            Value::Vector(v) if v.len() == 2 => [v[0], v[1], zero],
            other => {
                let message =
                    format!("{what} must be a place, vector(3) or vector(2), found {}", other.shape());
                self.problem(*span, message, format!("write `{form}`"));
                [zero; 3]
            }
        }
    }

    /// The rotation matrix of an attitude; the identity when there is none or a problem was reported.
    pub(in crate::spec) fn rotation(&mut self, attitude: Option<&(Value, Option<Span>)>) -> [[ExprId; 3]; 3] {
        let g = &mut self.graph;
        let (zero, one) = (g.zero(), g.one());
        let identity = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
        match attitude {
            None => identity,
            Some((Value::Scalar(angle), _)) => {
                let (c, s) = (g.func(hamel_expr::Func::Cos, *angle), g.func(hamel_expr::Func::Sin, *angle));
                let minus_s = g.neg(s);
                [[c, minus_s, zero], [s, c, zero], [zero, zero, one]]
            }
            Some((Value::Vector(q), _)) if q.len() == 4 => quaternion_matrix(g, [q[0], q[1], q[2], q[3]]),
            Some((Value::Matrix { rows: 3, columns: 3, entries: e }, _)) => {
                [[e[0], e[1], e[2]], [e[3], e[4], e[5]], [e[6], e[7], e[8]]]
            }
            Some((other, span)) => {
                let message = format!("`attitude` cannot be {}", other.shape());
                let help = "give an angle about the third axis, a quaternion `[w, x, y, z]`, or a matrix whose columns \
                            are the axes of the frame";
                self.problem(*span, message, help);
                identity
            }
        }
    }
}

/// `R p + x`.
fn moved(g: &mut Graph, rotation: &[[ExprId; 3]; 3], p: &[ExprId; 3], x: &[ExprId; 3]) -> [ExprId; 3] {
    let mut row = |i: usize| {
        let mut terms: Vec<ExprId> = (0..3).map(|j| g.mul(rotation[i][j], p[j])).collect();
        terms.push(x[i]);
        g.sum(&terms)
    };
    [row(0), row(1), row(2)]
}

/// `R = 1 + 2 (w hat(v) + hat(v)^2)` of a unit quaternion `(w, v)`.
fn quaternion_matrix(g: &mut Graph, [w, x, y, z]: [ExprId; 4]) -> [[ExprId; 3]; 3] {
    let two = g.int(2);
    let mut pair = |a: ExprId, b: ExprId| g.product(&[two, a, b]);
    let [wx, wy, wz] = [pair(w, x), pair(w, y), pair(w, z)];
    let [xx, yy, zz] = [pair(x, x), pair(y, y), pair(z, z)];
    let [xy, yz, zx] = [pair(x, y), pair(y, z), pair(z, x)];
    let one = g.one();
    let mut diagonal = |a: ExprId, b: ExprId| {
        let sum = g.add(a, b);
        g.sub(one, sum)
    };
    let [d1, d2, d3] = [diagonal(yy, zz), diagonal(zz, xx), diagonal(xx, yy)];
    [
        [d1, g.sub(xy, wz), g.add(zx, wy)],
        [g.add(xy, wz), d2, g.sub(yz, wx)],
        [g.sub(zx, wy), g.add(yz, wx), d3],
    ]
}
