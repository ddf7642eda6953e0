//! What a joint declares: coordinates, inputs, forces.
//!
//! Deliberately does not know: links, their frames.

use std::fmt::Write as _;

use crate::number::Number;
use crate::options::Limits;
use crate::robot::{Joint, JointKind, Robot};

/// How a joint moves the link behind it, in expressions: each is absent where nothing moves.
#[derive(Debug, Default)]
pub(crate) struct Coordinates {
    /// The place of the link's origin in the frame of the joint.
    pub(crate) shift: Option<String>,
    /// The rotation of the link in the frame of the joint.
    pub(crate) rotation: Option<String>,
    /// Angular velocity and velocity by the rates of the joint, in the frame of the link.
    pub(crate) spin: Option<String>,
    pub(crate) slide: Option<String>,
}

/// What the joints of a robot bring into the model beside their coordinates.
#[derive(Debug, Default)]
pub(crate) struct Motion {
    pub(crate) kinetic: Vec<String>,
    pub(crate) forces: String,
    pub(crate) has_friction: bool,
    pub(crate) has_limits: bool,
}

/// Names around that of a joint.
pub(crate) fn around(joint: &Joint) -> &'static [&'static str] {
    match joint.kind {
        JointKind::Fixed | JointKind::Floating => &[],
        JointKind::Planar(_) => &[
            "*_x",
            "*_y",
            "*_angle",
            "*_x_dot",
            "*_y_dot",
            "*_angle_dot",
            "tau_*_x",
            "tau_*_y",
            "tau_*_angle",
        ],
        _ => &["*", "*_dot", "tau_*", "damping_*", "friction_*"],
    }
}

/// A coordinate of the model.
struct Coordinate<'a> {
    name: String,
    /// The joint of the file, for texts.
    of: &'a str,
    is_angle: bool,
}

impl Motion {
    /// Writes the items that declare a joint.
    pub(crate) fn declare(
        &mut self,
        out: &mut String,
        robot: &Robot,
        names: &[String],
        k: usize,
        limits: Limits,
    ) -> Coordinates {
        let joint = &robot.joints[k];
        let (parent, child) = (&robot.links[joint.parent].name, &robot.links[joint.child].name);
        _ = writeln!(out, "\n// {child}, on {parent} by the joint {}.", joint.name);
        let name = names[k].clone();
        let coordinate = |suffix: &str, is_angle| Coordinate {
            name: format!("{name}{suffix}"),
            of: &joint.name,
            is_angle,
        };
        match &joint.kind {
            JointKind::Fixed | JointKind::Floating => Coordinates::default(),
            JointKind::Revolute(axis) => {
                let rate = self.one(out, &coordinate("", true), (robot, joint), names, limits);
                Coordinates {
                    rotation: Some(axis.rotation(&name)),
                    spin: Some(format!("{}*{rate}", axis.vector)),
                    ..Coordinates::default()
                }
            }
            JointKind::Prismatic(axis) => {
                let rate = self.one(out, &coordinate("", false), (robot, joint), names, limits);
                Coordinates {
                    shift: Some(format!("{}*{name}", axis.vector)),
                    slide: Some(format!("{}*{rate}", axis.vector)),
                    ..Coordinates::default()
                }
            }
            JointKind::Planar(axis) => {
                let (x, y, angle) =
                    (coordinate("_x", false), coordinate("_y", false), coordinate("_angle", true));
                for one in [&x, &y, &angle] {
                    self.one(out, one, (robot, joint), names, limits);
                }
                // The axes of the plane follow the axis across it.
                let k = axis.along.map_or(2, |(k, _)| k);
                let plane = |x: &str, y: &str| {
                    let mut entries = ["0".to_owned(), "0".to_owned(), "0".to_owned()];
                    entries[(k + 1) % 3] = x.to_owned();
                    entries[(k + 2) % 3] = y.to_owned();
                    format!("[{}]", entries.join(", "))
                };
                let rotation = axis.rotation(&angle.name);
                let rates = plane(&format!("{}_dot", x.name), &format!("{}_dot", y.name));
                Coordinates {
                    shift: Some(plane(&x.name, &y.name)),
                    spin: Some(format!("{}*{}_dot", axis.vector, angle.name)),
                    slide: Some(format!("transpose({rotation})*{rates}")),
                    rotation: Some(rotation),
                }
            }
        }
    }

    /// A coordinate with its input and forces; its rate as an expression.
    fn one(
        &mut self,
        out: &mut String,
        coordinate: &Coordinate<'_>,
        (robot, joint): (&Robot, &Joint),
        names: &[String],
        limits: Limits,
    ) -> String {
        let Coordinate { name, of, is_angle } = coordinate;
        let (unit, force) = if *is_angle { ("rad", "Torque") } else { ("m", "Force") };
        let force_unit = if *is_angle { "N m" } else { "N" };
        let rate = match &joint.mimic {
            Some(mimic) => {
                let offset = match mimic.offset.text.strip_prefix('-') {
                    Some(offset) => format!(" - {offset}"),
                    None if mimic.offset.is_zero() => String::new(),
                    None => format!(" + {}", mimic.offset.text),
                };
                _ = writeln!(out, "/// {of}, in {unit}.");
                // A fixed joint is at zero.
                let leader = match robot.joints[mimic.joint].kind {
                    JointKind::Fixed => "0",
                    _ => names[mimic.joint].as_str(),
                };
                _ = writeln!(out, "let {name} = {}*{leader}{offset};", mimic.factor.text);
                format!("rate({name})")
            }
            None => {
                let domain = match (&joint.limits, limits) {
                    (Some([lower, upper]), Limits::Interval) => {
                        if lower.value >= 0.0 || upper.value <= 0.0 {
                            _ = writeln!(out, "initial {name} = ({} + {})/2;", lower.text, upper.factor());
                        }
                        format!("({}, {})", lower.text, upper.text)
                    }
                    _ if *is_angle => "angle".to_owned(),
                    _ => "real".to_owned(),
                };
                _ = writeln!(out, "/// {of}, in {unit}.\ncoordinate {name} in {domain};");
                _ = writeln!(out, "/// {force} on {of}, in {force_unit}.\ninput tau_{name} = 0;");
                format!("{name}_dot")
            }
        };
        let mut force = Vec::new();
        if joint.mimic.is_none() {
            force.push(format!("tau_{name}"));
        }
        let mut param = |prefix: &str, text: &str, value: &Number| {
            let sign =
                if value.value >= 0.0 { format!(" where {prefix}_{name} >= 0") } else { String::new() };
            _ = writeln!(out, "/// {text} of {of}.\nparam {prefix}_{name} = {}{sign};", value.text);
        };
        if !joint.damping.is_zero() {
            param("damping", &format!("Damping, in {force_unit} s/{unit},"), &joint.damping);
            force.push(format!("-damping_{name}*{rate}"));
        }
        if !joint.friction.is_zero() {
            param("friction", &format!("Dry friction, in {force_unit},"), &joint.friction);
            force.push(format!("-friction_{name}*tanh({rate}/friction_speed)"));
            self.has_friction = true;
        }
        if let (Some([lower, upper]), Limits::Spring) = (&joint.limits, limits) {
            for (beyond, sign) in
                [(format!("{name} - {}", upper.factor()), "-"), (format!("{} - {name}", lower.text), "")]
            {
                force
                    .push(format!("{sign}limit_stiffness*({beyond} + sqrt(({beyond})^2 + limit_width^2))/2"));
            }
            self.has_limits = true;
        }
        if !force.is_empty() {
            let sum = force.join(" + ").replace(" + -", " - ");
            _ = match joint.mimic {
                Some(_) => writeln!(self.forces, "force along {rate}: {sum};"),
                None => writeln!(self.forces, "force {rate} = {sum};"),
            };
        }
        rate
    }
}
