//! Names of parameters in the place of lengths, angles, masses and moments of inertia.
//!
//! Deliberately does not know: XML, joints' coordinates, energies.

use std::fmt::Write as _;

use crate::names::Names;
use crate::number::{Form, Number, zeros};
use crate::robot::{Inertia, JointKind, Mass, Moments, Pose, Robot};
use crate::rotation::{Rotation, Turn};
use crate::solid::Solid;

/// Everything that is named after a body with mass.
pub(crate) const OF_PART: &[&str] = &[
    "mass_*",
    "lift_*",
    "density_*",
    "radius_*",
    "half_*",
    "ax_*",
    "ay_*",
    "az_*",
    "cx_*",
    "cy_*",
    "cz_*",
    "Ixx_*",
    "Iyy_*",
    "Izz_*",
    "Ixy_*",
    "Ixz_*",
    "Iyz_*",
    "Iroll_*",
    "Ipitch_*",
    "Iyaw_*",
    "Iangle_*",
    "Iqw_*",
    "Iqx_*",
    "Iqy_*",
    "Iqz_*",
];
/// Names of parameters of joints, by the link behind.
pub(crate) const OF_PLACE: &[&str] = &[
    "dx_*", "dy_*", "dz_*", "ox_*", "oy_*", "oz_*", "roll_*", "pitch_*", "yaw_*", "angle_*", "qw_*", "qx_*",
    "qy_*", "qz_*",
];

/// A body with mass that belongs to a link, by names of its parameters.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Nothing for zero.
    pub(crate) mass: Option<String>,
    /// The mass that gravity pulls; nothing for zero.
    pub(crate) weight: Option<String>,
    /// The mass centre and the frame of the moments.
    pub(crate) pose: Pose,
    /// The matrix of moments of inertia in its frame; nothing for zero.
    pub(crate) matrix: Option<String>,
    /// The items that declare its mass alone.
    pub(crate) of_mass: String,
    /// The items that declare all of it.
    pub(crate) items: String,
}

/// All parameters of a robot.
pub(crate) struct Parameters {
    /// By link.
    pub(crate) parts: Vec<Vec<Part>>,
    /// Items that declare the frame of a joint, by joint.
    pub(crate) of_joint: Vec<String>,
    /// Items that declare the ends of a loop, by loop.
    pub(crate) of_loop: Vec<String>,
    /// Items in front of all others.
    pub(crate) head: String,
}

/// Declares a number as a parameter, and has its name in its place. Zeros and expressions stay.
fn declare(items: &mut String, number: &mut Number, name: String, doc: &str, is_positive: bool) {
    if number.is_zero() || number.form == Form::Expression {
        return;
    }
    let condition = match is_positive && number.value > 0.0 {
        true => format!(" where {name} > 0"),
        false => String::new(),
    };
    _ = writeln!(items, "/// {doc}\nparam {name} = {}{condition};", number.text);
    number.text = name;
}

/// Names for the numbers of a rotation: each prefix once, so that a second angle about an axis stays a number.
fn declare_turn(items: &mut String, turn: &mut Turn, of: &str, link: &str, prefix: &str) {
    let mut taken: Vec<&str> = Vec::new();
    for factor in &mut turn.factors {
        match factor {
            Rotation::About(axis, angle) => {
                let of_axis = match axis.as_str() {
                    "e1" => "roll",
                    "e2" => "pitch",
                    "e3" => "yaw",
                    _ => "angle",
                };
                let unit = if angle.form == Form::Degrees { "degrees" } else { "rad" };
                if !taken.contains(&of_axis) {
                    let doc = format!("{of}, in {unit}.");
                    declare(items, angle, format!("{prefix}{of_axis}_{link}"), &doc, false);
                    taken.push(of_axis);
                }
            }
            Rotation::Quaternion(entries) => {
                if taken.contains(&"q") {
                    continue;
                }
                taken.push("q");
                for (number, entry) in entries.iter_mut().zip(["qw", "qx", "qy", "qz"]) {
                    let doc = format!("{of}: quaternion.");
                    declare(items, number, format!("{prefix}{entry}_{link}"), &doc, false);
                }
            }
            Rotation::Axes(..) => {}
        }
    }
}

/// Puts names of parameters in the place of numbers; joints in `stay`, and loops beside these, keep theirs. `links` and
/// `loops` are their names.
pub(crate) fn parameters(
    robot: &mut Robot,
    links: &[String],
    loops: &[String],
    stay: &[usize],
    names: &mut Names,
) -> Parameters {
    let mut parts: Vec<Vec<Part>> = Vec::new();
    for link in &robot.links {
        let of_link = link.inertias.iter().map(|inertia| {
            let name = names.take(&inertia.name, OF_PART);
            part(inertia, &name)
        });
        parts.push(of_link.collect());
    }
    let mut head = String::new();
    if let Some(total) = &robot.total_mass {
        let masses: Vec<String> = parts.iter().flatten().filter_map(|part| part.mass.clone()).collect();
        _ = writeln!(head, "/// Sum of the masses, in kg.\nparam total_mass = {};", total.text);
        _ = writeln!(head, "let mass_scale = total_mass/({});", masses.join(" + "));
        for part in parts.iter_mut().flatten() {
            for factor in [&mut part.mass, &mut part.weight, &mut part.matrix].into_iter().flatten() {
                *factor = format!("mass_scale*{factor}");
            }
        }
    }
    let mut of_joint = Vec::new();
    for (k, joint) in robot.joints.iter_mut().enumerate() {
        let link = &links[joint.child];
        let mut items = String::new();
        // Starts of free motions are initial values, which parameters do not name.
        if matches!(joint.kind, JointKind::Floating) || stay.contains(&k) {
            of_joint.push(items);
            continue;
        }
        let doc = format!("Place of the joint {}, in m.", joint.name);
        for (number, prefix) in joint.pose.place.iter_mut().zip(["dx", "dy", "dz"]) {
            declare(&mut items, number, format!("{prefix}_{link}"), &doc, false);
        }
        let doc = format!("Place of the joint {} in the turned frame, in m.", joint.name);
        for (number, prefix) in joint.pose.anchor.iter_mut().zip(["ox", "oy", "oz"]) {
            declare(&mut items, number, format!("{prefix}_{link}"), &doc, false);
        }
        let doc = format!("Angle of the joint {}", joint.name);
        declare_turn(&mut items, &mut joint.pose.turn, &doc, link, "");
        of_joint.push(items);
    }
    let mut of_loop = Vec::new();
    for (held, name) in robot.loops.iter_mut().zip(loops) {
        let mut items = String::new();
        let ends = [(held.first.0, Some(&mut held.first.1)), (held.second.link, held.second.pose.as_mut())];
        for ((link, pose), prefix) in ends.into_iter().zip(["d", "o"]) {
            let doc = format!("Place of {} on {}, in m.", held.name, robot.links[link].name);
            let Some(pose) = pose.filter(|_| stay.is_empty()) else { continue };
            // In a turned frame the place is said behind the rotation.
            let is_turned = pose.place.iter().all(Number::is_zero);
            let place = if is_turned { &mut pose.anchor } else { &mut pose.place };
            for (number, axis) in place.iter_mut().zip(["x", "y", "z"]) {
                declare(&mut items, number, format!("{prefix}{axis}_{name}"), &doc, false);
            }
        }
        of_loop.push(items);
    }
    Parameters { parts, of_joint, of_loop, head }
}

fn part(inertia: &Inertia, name: &str) -> Part {
    let Inertia { name: of, mass, pose, moments, lift } = inertia;
    let mut pose = pose.clone();
    let (mut items, mut of_mass) = (String::new(), String::new());
    let sizes = match moments {
        Moments::Solid(solid) => sizes(&mut items, solid, of, name),
        Moments::Given(_) => Vec::new(),
    };
    let mass = match (mass, moments) {
        (Mass::Given(mass), _) if mass.is_zero() => None,
        (Mass::Density(density), Moments::Solid(solid)) => {
            let doc = format!("Density of {of}, in kg/m^3.");
            of_mass.clone_from(&items);
            items.clear();
            declare(&mut of_mass, &mut density.clone(), format!("density_{name}"), &doc, true);
            _ = writeln!(of_mass, "let mass_{name} = density_{name}*{};", solid.shape.volume(&sizes));
            Some(format!("mass_{name}"))
        }
        (Mass::Given(mass) | Mass::Density(mass), _) => {
            let mut mass = mass.clone();
            declare(&mut of_mass, &mut mass, format!("mass_{name}"), &format!("Mass of {of}, in kg."), true);
            Some(mass.text)
        }
    };
    items.push_str(&of_mass);
    if mass.is_none() {
        (pose.place, pose.anchor) = (zeros(), zeros());
    }
    let mut lift = lift.clone();
    let weight = match &mass {
        Some(_) if lift.equals(&Number::one()) => None,
        Some(mass) if !lift.is_zero() => {
            let doc = format!("Part of the weight of {of} that is held up.");
            declare(&mut items, &mut lift, format!("lift_{name}"), &doc, false);
            Some(format!("(1 - {})*{mass}", lift.text))
        }
        _ => mass.clone(),
    };
    let doc = format!("Mass centre of {of}, in m.");
    for (number, prefix) in pose.place.iter_mut().zip(["cx", "cy", "cz"]) {
        declare(&mut items, number, format!("{prefix}_{name}"), &doc, false);
    }
    let angle = format!("Angle of the frame of the moments of inertia of {of}");
    let matrix = match (moments, &mass) {
        (Moments::Given(moments), _) if moments.iter().all(Number::is_zero) => None,
        (Moments::Given(moments), _) => {
            declare_turn(&mut items, &mut pose.turn, &angle, name, "I");
            let doc = format!("Moments and products of inertia of {of}, in kg m^2.");
            let mut moments = moments.clone();
            let prefixes = ["Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"];
            for (n, (number, prefix)) in moments.iter_mut().zip(prefixes).enumerate() {
                declare(&mut items, number, format!("{prefix}_{name}"), &doc, n < 3);
            }
            Some(matrix(&moments))
        }
        (Moments::Solid(_), None) => None,
        (Moments::Solid(solid), Some(mass)) => {
            let principal = solid.shape.moments(mass, &sizes);
            let prefixes: &[&str] = match principal.len() {
                2 => &["Ixx", "Izz"],
                _ => &["Ixx", "Iyy", "Izz"],
            };
            let names: Vec<String> =
                prefixes.iter().zip(&principal).map(|(prefix, _)| format!("{prefix}_{name}")).collect();
            for (own, value) in names.iter().zip(&principal) {
                _ = writeln!(items, "let {own} = {value};");
            }
            if names.len() > 1 && solid.along.is_none() {
                declare_turn(&mut items, &mut pose.turn, &angle, name, "I");
            }
            if names.len() == 1 {
                pose.turn = Turn::none();
            }
            Some(solid.matrix(&names))
        }
    };
    Part { mass, weight, pose, matrix, of_mass, items }
}

/// Declares the sizes of a solid; their names.
fn sizes(items: &mut String, solid: &Solid, of: &str, name: &str) -> Vec<String> {
    let mut all = Vec::new();
    for (size, (prefix, what)) in solid.sizes.iter().zip(solid.shape.sizes()) {
        let own = format!("{prefix}_{name}");
        let mut size = size.clone();
        match size.form {
            Form::Expression => _ = writeln!(items, "let {own} = {};", size.text),
            _ => declare(items, &mut size, own.clone(), &format!("{what} of {of}, in m."), true),
        }
        all.push(own);
    }
    all
}

/// A symmetric matrix by `xx, yy, zz, xy, xz, yz`.
fn matrix(moments: &[Number; 6]) -> String {
    let [xx, yy, zz, xy, xz, yz] = moments;
    match [xy, xz, yz].iter().all(|n| n.is_zero()) {
        true => format!("diag([{}, {}, {}])", xx.text, yy.text, zz.text),
        false => format!(
            "[[{}, {}, {}], [{}, {}, {}], [{}, {}, {}]]",
            xx.text, xy.text, xz.text, xy.text, yy.text, yz.text, xz.text, yz.text, zz.text
        ),
    }
}
