//! Chains as text: with bodies by places and attitudes in space, or with velocities in moving frames.
//!
//! Deliberately does not know: how chains are drawn, how they move.

use std::fmt::Write as _;

use super::drawn::{Axis, Base, Body, Chain, Joint, Length, Restriction, V3};
use super::redundant::placed;

/// How a chain is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Written {
    /// With `body`, places and attitudes in space.
    Bodies,
    /// With angular velocities and velocities of the origins in moving frames.
    Frames,
}

fn vector(components: &[Length; 3]) -> String {
    let [x, y, z] = components.each_ref().map(|c| c.text.as_str());
    format!("[{x}, {y}, {z}]")
}

fn inertia([xx, xy, xz, yy, yz, zz]: &[Length; 6]) -> String {
    let [xx, xy, xz, yy, yz, zz] = [xx, xy, xz, yy, yz, zz].map(|q| q.text.as_str());
    format!("[[{xx}, {xy}, {xz}], [{xy}, {yy}, {yz}], [{xz}, {yz}, {zz}]]")
}

/// The attitude of a body in the frame of the body before; none where it is that one.
fn attitude(k: usize, body: &Body) -> Option<String> {
    let mut factors: Vec<String> =
        body.twist.iter().map(|turn| format!("rot({}, {})", turn.axis.text, turn.text)).collect();
    if let Joint::Revolute(axis) = &body.joint {
        factors.push(format!("rot({}, q{k})", axis.text));
    }
    (!factors.is_empty()).then(|| factors.join("*"))
}

/// A vector of an axis, also where the axis has a name that stands in rotations alone.
fn direction(axis: &Axis) -> String {
    match axis.text {
        "e1" => "[1, 0, 0]".into(),
        "e2" => "[0, 1, 0]".into(),
        "e3" => "[0, 0, 1]".into(),
        text => text.into(),
    }
}

/// The text of a model of a chain; equations between positions hold at `angles`.
///
/// A floating base has its velocities in its own frame, so that everything is written in moving frames.
pub(crate) fn text(chain: &Chain, written: Written, angles: &[f64]) -> String {
    let mut text = String::from("model chain {\n");
    for param in &chain.params {
        let _ = writeln!(text, "    param {} = {};", param.text, param.value);
    }
    let names: Vec<String> = (1..=chain.bodies.len()).map(|k| format!("q{k}")).collect();
    let (turning, sliding): (Vec<_>, Vec<_>) =
        names.iter().zip(&chain.bodies).partition(|(_, body)| matches!(body.joint, Joint::Revolute(_)));
    for (list, domain) in [(turning, "angle"), (sliding, "real")] {
        if !list.is_empty() {
            let names: Vec<&str> = list.iter().map(|(name, _)| name.as_str()).collect();
            let _ = writeln!(text, "    coordinate {} in {domain};", names.join(", "));
        }
    }
    let energies = match written {
        Written::Bodies => bodies(chain, &mut text),
        Written::Frames => frames(chain, &mut text),
    };
    let _ = writeln!(text, "    lagrangian = {};", energies.join("\n        + "));
    for (k, restriction) in chain.restrictions.iter().enumerate() {
        let (n, body) = (k + 1, restriction.body() + 1);
        let point = vector(restriction.point());
        let _ = match restriction {
            Restriction::Wheel { axis, .. } => {
                let velocity = match written {
                    Written::Bodies => format!("transpose(R{body})*rate(o{body} + R{body}*{point})"),
                    Written::Frames => format!("U[{body}] + cross(W[{body}], {point})"),
                };
                let _ = writeln!(text, "    let s{n} = {velocity};");
                writeln!(text, "    constraint wheel{n}: dot({}, s{n}) = 0;", direction(axis))
            }
            Restriction::Loop { component, .. } => {
                let _ = writeln!(text, "    let s{n} = {};", place_of(chain, written, body, &point));
                let value = placed(chain, angles, restriction.body(), restriction.point())[*component];
                writeln!(text, "    constraint loop{n}: s{n}[{}] = {value};", component + 1)
            }
        };
    }
    text + "    scene bare { want rhs, energy; }\n    scene derivatives { want rhs, jacobian, vjp; }\n}\n"
}

fn place_of(chain: &Chain, written: Written, body: usize, point: &str) -> String {
    match written {
        Written::Bodies => format!("o{body} + R{body}*{point}"),
        Written::Frames => {
            // In frames nobody has places: those of the joints are put together from the base.
            let mut factors = point.to_owned();
            let mut next = Some(body - 1);
            while let Some(k) = next {
                let own = &chain.bodies[k];
                if let Joint::Prismatic(axis) = &own.joint {
                    factors = format!("({}*q{} + {factors})", direction(axis), k + 1);
                }
                if let Some(attitude) = attitude(k + 1, own) {
                    factors = format!("{attitude}*{factors}");
                }
                factors = format!("({} + {factors})", vector(&own.offset));
                next = own.parent;
            }
            factors
        }
    }
}

fn bodies(chain: &Chain, text: &mut String) -> Vec<String> {
    let mut energies = Vec::new();
    for (body, k) in chain.bodies.iter().zip(1..) {
        let own = attitude(k, body);
        let before = body.parent.map(|p| p + 1);
        let is_turned = own.is_some() || before.is_some();
        let turned = match (before, &own) {
            (Some(p), Some(own)) => format!("R{p}*{own}"),
            (Some(p), None) => format!("R{p}"),
            (None, Some(own)) => own.clone(),
            (None, None) => "diag([1, 1, 1])".into(),
        };
        let offset = vector(&body.offset);
        let joint = before.map_or(offset.clone(), |p| format!("o{p} + R{p}*{offset}"));
        let _ = writeln!(text, "    let R{k} = {turned};");
        let slid = match &body.joint {
            Joint::Prismatic(axis) => format!(" + R{k}*({}*q{k})", direction(axis)),
            Joint::Revolute(_) => String::new(),
        };
        let _ = writeln!(
            text,
            "    let o{k} = {joint}{slid};\n    let p{k} = o{k} + R{k}*{};",
            vector(&body.centre)
        );
        let turning = match is_turned {
            true => format!(" inertia {}; attitude R{k};", inertia(&body.inertia)),
            false => String::new(),
        };
        let _ = writeln!(text, "    body b{k} {{ mass {}; place p{k};{turning} }}", body.mass.text);
        energies.push(format!("b{k}_energy"));
        if chain.gravity.value != 0.0 {
            energies.push(format!("(-{}*{}*p{k}[3])", body.mass.text, chain.gravity.text));
        }
    }
    energies
}

fn frames(chain: &Chain, text: &mut String) -> Vec<String> {
    let mut energies = Vec::new();
    match &chain.base {
        Base::Fixed => text.push_str("    let W[0] = [0, 0, 0]; let U[0] = [0, 0, 0];\n"),
        Base::Floating { mass, centre, moments } => {
            text.push_str(
                "    velocity omega, v in se(3);\n    action left;\n    let W[0] = omega; let U[0] = v;\n",
            );
            let _ = writeln!(text, "    let C[0] = U[0] + cross(W[0], {});", vector(centre));
            energies.push(format!(
                "{}/2*dot(C[0], C[0]) + dot(W[0], diag({})*W[0])/2",
                mass.text,
                vector(moments)
            ));
        }
    }
    text.push_str("    let G[0] = [0, 0, 1]; let h[0] = 0;\n");
    for (body, k) in chain.bodies.iter().zip(1..) {
        let p = body.parent.map_or(0, |p| p + 1);
        let offset = vector(&body.offset);
        let into = match attitude(k, body) {
            Some(attitude) => {
                let _ = writeln!(text, "    let E{k} = transpose({attitude});");
                format!("E{k}*")
            }
            None => String::new(),
        };
        let (spin, slide, height) = match &body.joint {
            Joint::Revolute(axis) => {
                (format!(" + {}*q{k}_dot", direction(axis)), String::new(), String::new())
            }
            Joint::Prismatic(axis) => {
                let axis = direction(axis);
                (
                    String::new(),
                    format!(" + cross(W[{k}], {axis}*q{k}) + {axis}*q{k}_dot"),
                    format!(" + dot(G[{k}], {axis}*q{k})"),
                )
            }
        };
        let _ = writeln!(text, "    let W[{k}] = {into}W[{p}]{spin};");
        let _ = writeln!(text, "    let U[{k}] = {into}(U[{p}] + cross(W[{p}], {offset})){slide};");
        let _ = writeln!(text, "    let G[{k}] = {into}G[{p}];");
        let _ = writeln!(text, "    let h[{k}] = h[{p}] + dot(G[{p}], {offset}){height};");
        let centre = vector(&body.centre);
        let _ = writeln!(text, "    let C[{k}] = U[{k}] + cross(W[{k}], {centre});");
        energies.push(format!(
            "{}/2*dot(C[{k}], C[{k}]) + dot(W[{k}], {}*W[{k}])/2",
            body.mass.text,
            inertia(&body.inertia)
        ));
        if chain.gravity.value != 0.0 {
            let (mass, g) = (&body.mass.text, &chain.gravity.text);
            energies.push(format!("(-{mass}*{g}*(h[{k}] + dot(G[{k}], {centre})))"));
        }
    }
    energies
}

impl Restriction {
    pub(crate) fn body(&self) -> usize {
        match self {
            Restriction::Wheel { body, .. } | Restriction::Loop { body, .. } => *body,
        }
    }

    pub(crate) fn point(&self) -> &[Length; 3] {
        match self {
            Restriction::Wheel { point, .. } | Restriction::Loop { point, .. } => point,
        }
    }
}

/// Values of lengths.
pub(crate) fn values(lengths: &[Length; 3]) -> V3 {
    lengths.each_ref().map(|length| length.value)
}
