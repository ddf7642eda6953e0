//! What a joint declares: coordinates, inputs, forces.
//!
//! Deliberately does not know: links, their frames.

use std::fmt::Write as _;

use crate::names::Names;
use crate::number::Number;
use crate::options::Limits;
use crate::robot::{Joint, JointKind, Motor, Robot};

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
    pub(crate) springs: Vec<String>,
    pub(crate) forces: String,
    pub(crate) has_friction: bool,
    pub(crate) has_limits: bool,
    /// Names of the motors, in their order.
    pub(crate) motors: Vec<String>,
}

/// Everything that is named after a coordinate.
const OF_COORDINATE: &[&str] =
    &["*", "*_dot", "tau_*", "damping_*", "friction_*", "stiffness_*", "rest_*", "armature_*", "ref_*"];
const OF_PLANE: &[&str] =
    &["*_x", "*_y", "*_angle", "*_x_dot", "*_y_dot", "*_angle_dot", "tau_*_x", "tau_*_y", "tau_*_angle"];
const OF_BALL: &[&str] = &[
    "*",
    "*11",
    "*12",
    "*13",
    "*21",
    "*22",
    "*23",
    "*31",
    "*32",
    "*33",
    "*_rate",
    "*_rate1",
    "*_rate2",
    "*_rate3",
    "tau_*",
    "tau_*1",
    "tau_*2",
    "tau_*3",
    "damping_*",
    "armature_*",
];
/// Everything that is named after a motor.
const OF_MOTOR: &[&str] =
    &["ctrl_*", "gear_*", "gain_*", "kp_*", "kv_*", "bias_*", "bias_length_*", "bias_rate_*"];

/// Names around that of a joint.
pub(crate) fn around(joint: &Joint) -> &'static [&'static str] {
    match joint.kind {
        JointKind::Fixed | JointKind::Floating => &[],
        JointKind::Planar(_) => OF_PLANE,
        JointKind::Ball => OF_BALL,
        JointKind::Revolute(_) | JointKind::Prismatic(_) => OF_COORDINATE,
    }
}

/// A coordinate of the model.
struct Coordinate<'a> {
    name: String,
    /// The joint of the file, for texts.
    of: &'a str,
    is_angle: bool,
}

impl Coordinate<'_> {
    fn unit(&self) -> &'static str {
        if self.is_angle { "rad" } else { "m" }
    }

    fn force_unit(&self) -> &'static str {
        if self.is_angle { "N m" } else { "N" }
    }
}

/// Declares a parameter with its condition, of a number of any sign.
fn parameter(out: &mut String, name: &str, doc: &str, value: &Number) {
    let sign = if value.value >= 0.0 { format!(" where {name} >= 0") } else { String::new() };
    _ = writeln!(out, "/// {doc}\nparam {name} = {}{sign};", value.text);
}

/// An expression minus a number.
fn minus(text: &str, number: &str) -> String {
    match number.strip_prefix('-') {
        _ if number == "0" => text.to_owned(),
        Some(number) => format!("{text} + {number}"),
        None => format!("{text} - {number}"),
    }
}

impl Motion {
    /// Takes the names of the motors.
    pub(crate) fn new(robot: &Robot, names: &mut Names) -> Motion {
        let motors = robot.motors.iter().map(|motor| names.take(&motor.name, OF_MOTOR)).collect();
        Motion { motors, ..Motion::default() }
    }

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
        let from_reference = match joint.reference.is_zero() {
            true => name.clone(),
            false => format!("({})", minus(&name, &joint.reference.in_radians())),
        };
        match &joint.kind {
            JointKind::Fixed | JointKind::Floating => Coordinates::default(),
            JointKind::Revolute(axis) => {
                let rate = self.one(out, &coordinate("", true), (robot, k), names, limits);
                Coordinates {
                    rotation: Some(axis.rotation(&from_reference)),
                    spin: Some(format!("{}*{rate}", axis.vector)),
                    ..Coordinates::default()
                }
            }
            JointKind::Prismatic(axis) => {
                let rate = self.one(out, &coordinate("", false), (robot, k), names, limits);
                Coordinates {
                    shift: Some(format!("{}*{from_reference}", axis.vector)),
                    slide: Some(format!("{}*{rate}", axis.vector)),
                    ..Coordinates::default()
                }
            }
            JointKind::Ball => {
                self.ball(out, robot, k, &name);
                Coordinates {
                    rotation: Some(name.clone()),
                    spin: Some(format!("{name}_rate")),
                    ..Coordinates::default()
                }
            }
            JointKind::Planar(axis) => {
                let (x, y, angle) =
                    (coordinate("_x", false), coordinate("_y", false), coordinate("_angle", true));
                for one in [&x, &y, &angle] {
                    self.one(out, one, (robot, k), names, limits);
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

    /// Forces of a joint with all motions, on the angular velocity and the velocity of a link.
    pub(crate) fn free(
        &mut self,
        out: &mut String,
        joint: &Joint,
        link: &str,
        (spin, velocity): (&str, &str),
    ) {
        if !joint.damping.is_zero() {
            let doc = format!("Damping, in N m s/rad and N s/m, of {}.", joint.name);
            parameter(out, &format!("drag_{link}"), &doc, &joint.damping);
            for rate in [spin, velocity] {
                _ = writeln!(self.forces, "force {rate} = -drag_{link}*{rate};");
            }
        }
        if !joint.armature.is_zero() {
            let doc = format!("Inertia and mass of the drive, in kg m^2 and kg, of {}.", joint.name);
            parameter(out, &format!("added_{link}"), &doc, &joint.armature);
            let squares = format!("(dot({spin}, {spin}) + dot({velocity}, {velocity}))");
            self.kinetic.push(format!("added_{link}/2*{squares}"));
        }
    }

    /// A joint with all rotations.
    fn ball(&mut self, out: &mut String, robot: &Robot, k: usize, name: &str) {
        let joint = &robot.joints[k];
        let of = &joint.name;
        _ = writeln!(
            out,
            "/// Rotation of {of}, and its angular velocity in the frame behind it, in rad/s.\n\
             configuration {name} in SO(3) velocity {name}_rate;"
        );
        let mut force = Vec::new();
        if robot.drives_all {
            _ = writeln!(out, "/// Torque on {of}, in N m.\ninput tau_{name}: vector(3) = [0, 0, 0];");
            force.push(format!("tau_{name}"));
        }
        if !joint.damping.is_zero() {
            let doc = format!("Damping, in N m s/rad, of {of}.");
            parameter(out, &format!("damping_{name}"), &doc, &joint.damping);
            force.push(format!("-damping_{name}*{name}_rate"));
        }
        self.armature(out, joint, name, "kg m^2", &format!("dot({name}_rate, {name}_rate)"));
        if !force.is_empty() {
            let sum = force.join(" + ").replace(" + -", " - ");
            _ = writeln!(self.forces, "force {name}_rate = {sum};");
        }
    }

    fn armature(&mut self, out: &mut String, joint: &Joint, name: &str, unit: &str, square: &str) {
        if !joint.armature.is_zero() {
            let doc = format!("Inertia of the drive, in {unit}, of {}.", joint.name);
            parameter(out, &format!("armature_{name}"), &doc, &joint.armature);
            self.kinetic.push(format!("armature_{name}/2*{square}"));
        }
    }

    /// A coordinate with its inputs and forces; its rate as an expression.
    fn one(
        &mut self,
        out: &mut String,
        coordinate: &Coordinate<'_>,
        (robot, k): (&Robot, usize),
        names: &[String],
        limits: Limits,
    ) -> String {
        let joint = &robot.joints[k];
        let Coordinate { name, of, is_angle } = coordinate;
        let (unit, force_unit) = (coordinate.unit(), coordinate.force_unit());
        let kind = if *is_angle { "Torque" } else { "Force" };
        let mut force = Vec::new();
        let rate = match &joint.mimic {
            Some(_) => {
                let value = followed(robot, k, names);
                _ = writeln!(out, "/// {of}, in {unit}.\nlet {name} = {value};");
                format!("rate({name})")
            }
            None => {
                self.domain(out, coordinate, joint, limits);
                if robot.drives_all && robot.motors.iter().all(|motor| motor.joint != k) {
                    _ = writeln!(out, "/// {kind} on {of}, in {force_unit}.\ninput tau_{name} = 0;");
                    force.push(format!("tau_{name}"));
                }
                format!("{name}_dot")
            }
        };
        let motors = robot.motors.iter().enumerate().filter(|(_, motor)| motor.joint == k);
        for (n, motor) in motors {
            force.push(motor_force(out, &self.motors[n], motor, (name, &rate)));
        }
        if !joint.damping.is_zero() {
            let doc = format!("Damping, in {force_unit} s/{unit}, of {of}.");
            parameter(out, &format!("damping_{name}"), &doc, &joint.damping);
            force.push(format!("-damping_{name}*{rate}"));
        }
        if !joint.friction.is_zero() {
            let doc = format!("Dry friction, in {force_unit}, of {of}.");
            parameter(out, &format!("friction_{name}"), &doc, &joint.friction);
            force.push(format!("-friction_{name}*tanh({rate}/friction_speed)"));
            self.has_friction = true;
        }
        if let Some(spring) = &joint.spring {
            let doc = format!("Stiffness, in {force_unit}/{unit}, of {of}.");
            parameter(out, &format!("stiffness_{name}"), &doc, &spring.stiffness);
            let from_rest = minus(name, &spring.rest.in_radians());
            let square = match spring.rest.is_zero() {
                true => format!("{name}^2"),
                false => format!("({from_rest})^2"),
            };
            self.springs.push(format!("stiffness_{name}/2*{square}"));
        }
        let inertia = if *is_angle { "kg m^2" } else { "kg" };
        self.armature(out, joint, name, inertia, &format!("{rate}^2"));
        if let (Some([lower, upper]), Limits::Spring) = (&joint.limits, limits) {
            let lower = lower.in_radians();
            for (beyond, sign) in
                [(format!("{name} - {}", upper.factor()), "-"), (format!("{lower} - {name}"), "")]
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

    /// The coordinate, its interval and its start.
    fn domain(&self, out: &mut String, coordinate: &Coordinate<'_>, joint: &Joint, limits: Limits) {
        let Coordinate { name, of, is_angle } = coordinate;
        let start = &joint.reference;
        let mut initial = (!start.is_zero()).then(|| start.in_radians());
        let domain = match (&joint.limits, limits) {
            (Some([lower, upper]), Limits::Interval) => {
                if lower.value >= start.value || upper.value <= start.value {
                    initial = Some(format!("({} + {})/2", lower.in_radians(), upper.factor()));
                }
                format!("({}, {})", lower.in_radians(), upper.in_radians())
            }
            _ if *is_angle => "angle".to_owned(),
            _ => "real".to_owned(),
        };
        if let Some(initial) = initial {
            _ = writeln!(out, "initial {name} = {initial};");
        }
        _ = writeln!(out, "/// {of}, in {}.\ncoordinate {name} in {domain};", coordinate.unit());
    }
}

/// The value of a coordinate that follows another one.
fn followed(robot: &Robot, k: usize, names: &[String]) -> String {
    let joint = &robot.joints[k];
    let Some(mimic) = &joint.mimic else { return "0".to_owned() };
    let leader = &robot.joints[mimic.joint];
    let is_fixed = matches!(leader.kind, JointKind::Fixed);
    let by = match is_fixed || leader.reference.is_zero() {
        true => names[mimic.joint].clone(),
        false => format!("({})", minus(&names[mimic.joint], &leader.reference.in_radians())),
    };
    let mut terms = Vec::new();
    for (power, factor) in mimic.coefficients.iter().enumerate().rev() {
        // A fixed joint is at zero.
        if factor.is_zero() || (power > 0 && is_fixed) {
            continue;
        }
        terms.push(match power {
            0 => factor.in_radians(),
            1 => format!("{}*{by}", factor.in_radians()),
            _ => format!("{}*{by}^{power}", factor.in_radians()),
        });
    }
    if !joint.reference.is_zero() {
        terms.push(joint.reference.in_radians());
    }
    match terms.is_empty() {
        true => "0".to_owned(),
        false => terms.join(" + ").replace(" + -", " - "),
    }
}

/// Declares a motor; its force along the coordinate of a joint.
fn motor_force(out: &mut String, name: &str, motor: &Motor, (q, rate): (&str, &str)) -> String {
    let [constant, by_length, by_rate] = &motor.bias;
    _ = writeln!(out, "/// Control of the motor {}.\ninput ctrl_{name} = 0;", motor.name);
    let mut number = |prefix: &str, doc: &str, value: &Number| {
        let own = format!("{prefix}_{name}");
        _ = writeln!(out, "/// {doc} of the motor {}.\nparam {own} = {};", motor.name, value.text);
        own
    };
    let is_one = |n: &Number| n.equals(&Number::one());
    let gear = (!is_one(&motor.gear)).then(|| number("gear", "Ratio of the gears", &motor.gear));
    let geared = |text: &str| gear.as_ref().map_or(text.to_owned(), |gear| format!("{gear}*{text}"));
    let (length, speed) = (geared(q), geared(rate));
    let is_servo = !by_length.is_zero() && by_length.equals(&motor.gain.negative());
    let is_damper = by_length.is_zero() && !by_rate.is_zero() && by_rate.equals(&motor.gain.negative());
    let mut terms = Vec::new();
    match (is_servo, is_damper) {
        (true, _) => {
            let kp = number("kp", "Stiffness", &motor.gain);
            terms.push(format!("{kp}*(ctrl_{name} - {length})"));
            if !by_rate.is_zero() {
                let kv = number("kv", "Damping", &by_rate.negative());
                terms.push(format!("-{kv}*{speed}"));
            }
        }
        (_, true) => {
            let kv = number("kv", "Damping", &motor.gain);
            terms.push(format!("{kv}*(ctrl_{name} - {speed})"));
        }
        _ => {
            terms.push(match is_one(&motor.gain) {
                true => format!("ctrl_{name}"),
                false => format!("{}*ctrl_{name}", number("gain", "Force by the control", &motor.gain)),
            });
            if !by_length.is_zero() {
                terms.push(format!("{}*{length}", number("bias_length", "Force by the length", by_length)));
            }
            if !by_rate.is_zero() {
                terms.push(format!("{}*{speed}", number("bias_rate", "Force by the rate", by_rate)));
            }
        }
    }
    if !constant.is_zero() {
        terms.push(number("bias", "Constant force", constant));
    }
    let sum = terms.join(" + ").replace(" + -", " - ");
    match (&gear, &terms[..]) {
        (None, _) => sum,
        (Some(gear), [_]) => format!("{gear}*{sum}"),
        (Some(gear), _) => format!("{gear}*({sum})"),
    }
}
