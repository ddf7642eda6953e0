//! Masses of bodies by the shapes of their geoms.
//!
//! Deliberately does not know: joints, links.

use super::settings::{Defaulted, Settings};
use crate::number::{Number, zeros};
use crate::robot::{Inertia, Mass, Moments, Pose};
use crate::rotation::{Axis, Turn};
use crate::solid::{Shape, Solid};

const GIVE: &str = "give the body an `inertial`: MuJoCo computes it, and `mujoco.mj_saveLastXML` writes it";

/// Whether a geom has a mass, by its type and its numbers.
pub(super) fn has_mass<'a>(settings: &Settings<'a, '_>, geom: &Defaulted<'a>) -> bool {
    let reader = settings.reader;
    let kind = geom.attribute(reader, "type").unwrap_or("sphere");
    let [low, high] = settings.inertia_groups;
    let group = geom.number(reader, "group").map_or(0.0, |group| group.value);
    let factor = match geom.number(reader, "mass") {
        Some(mass) => Some(mass),
        None => geom.number(reader, "density"),
    };
    !matches!(kind, "plane" | "hfield")
        && (low..=high).contains(&group)
        && factor.is_none_or(|factor| !factor.is_zero())
}

/// The inertia of a geom, by its mass or its density, in the frame of the body.
pub(super) fn inertia<'a>(settings: &Settings<'a, '_>, geom: &Defaulted<'a>, name: &str) -> Option<Inertia> {
    let reader = settings.reader;
    let kind = geom.attribute(reader, "type").unwrap_or("sphere");
    let shape = match kind {
        "sphere" => Shape::Ball,
        "capsule" => Shape::Capsule,
        "cylinder" => Shape::Cylinder,
        "ellipsoid" => Shape::Ellipsoid,
        "box" => Shape::Cuboid,
        "mesh" | "sdf" => {
            let message = format!("the geom `{name}` has the mass of a mesh, which this file does not say");
            reader.error(&geom.place("type"), message, GIVE);
            return None;
        }
        other => {
            let message = format!("the geom `{name}` has the type `{other}`");
            reader.error(&geom.place("type"), message, "it is sphere, capsule, cylinder, ellipsoid or box");
            return None;
        }
    };
    for (attribute, what) in
        [("mesh", "is fitted to a mesh, which this file does not say"), ("shellinertia", "is a shell")]
    {
        if geom.carrier(attribute).is_some() && geom.attribute(reader, attribute) != Some("false") {
            reader.error(&geom.place(attribute), format!("the geom `{name}` {what}"), GIVE);
            return None;
        }
    }
    let mut sizes = geom.list(reader, "size", 3);
    let mut pose = Pose::identity();
    let mut along = None;
    if let Some([a, b, c, d, e, f]) = geom.numbers::<6>(reader, "fromto") {
        if shape == Shape::Ball {
            let help = "write `pos`, `size` and a rotation";
            reader.error(&geom.place("fromto"), format!("the {kind} `{name}` has two ends"), help);
            return None;
        }
        pose.place = [a.plus(&d).half(), b.plus(&e).half(), c.plus(&f).half()];
        let ends = [d.minus(&a), e.minus(&b), f.minus(&c)];
        let half = half_length(&ends);
        sizes.truncate(1);
        // A box and an ellipsoid are as wide as they are thick.
        if matches!(shape, Shape::Ellipsoid | Shape::Cuboid) {
            sizes.extend(sizes.first().cloned());
        }
        sizes.extend(half);
        match Axis::new(&ends).map(|axis| axis.along) {
            None => {
                let message = format!("both ends of the geom `{name}` are one point");
                reader.error(&geom.place("fromto"), message, "write two points, or make it a sphere");
                return None;
            }
            // Either direction of the axis has the same moments.
            Some(None) if shape.sizes().len() == 2 => along = Some(ends),
            Some(_) => pose.turn = Turn::onto(ends)?,
        }
    } else {
        pose = settings.pose(geom);
    }
    let n = shape.sizes().len();
    sizes.truncate(n);
    if sizes.len() < n || sizes.iter().any(|size| size.value <= 0.0) {
        let message = format!("the {kind} `{name}` has no {n} sizes above zero");
        reader.error(&geom.place("size"), message, "write `size`, in m");
        return None;
    }
    let mass = match (geom.number(reader, "mass"), geom.number(reader, "density")) {
        (Some(mass), _) => Mass::Given(mass),
        (None, Some(density)) => Mass::Density(density),
        (None, None) => Mass::Density(Number { text: "1000".to_owned(), value: 1000.0, ..Number::zero() }),
    };
    let (Mass::Given(factor) | Mass::Density(factor)) = &mass;
    if factor.value < 0.0 {
        let at = geom.carrier("mass").map_or("density", |_| "mass");
        reader.error(&geom.place(at), "the mass is negative", "write a mass in kg");
    }
    let moments = Moments::Solid(Solid { shape, sizes, along });
    Some(Inertia { name: name.to_owned(), mass, pose, moments, lift: Number::zero() })
}

/// Half the length of a vector: exact along a coordinate axis.
fn half_length(ends: &[Number; 3]) -> Option<Number> {
    let along = Axis::new(ends)?.along;
    if let Some((k, is_against)) = along {
        return Some(if is_against { ends[k].negative().half() } else { ends[k].half() });
    }
    let square: f64 = ends.iter().map(|x| x.value * x.value).sum();
    Some(Number::expression(format!("norm({})/2", crate::number::vector(ends)), square.sqrt() / 2.0))
}

/// The inertia that an element `inertial` says.
pub(super) fn inertial<'a>(
    settings: &Settings<'a, '_>,
    of: crate::xml::Element<'a>,
    name: &str,
) -> Option<Inertia> {
    let reader = settings.reader;
    let own = settings.defaulted(of, None);
    reader.required(of, "pos");
    reader.required(of, "mass")?;
    let mass = reader.number(of, "mass")?;
    if mass.value < 0.0 {
        reader.error(&own.place("mass"), "the mass is negative", "write a mass in kg");
    }
    let pose = settings.pose(&own);
    let moments = match (reader.numbers::<6>(of, "fullinertia"), reader.numbers::<3>(of, "diaginertia")) {
        (Some(_), Some(_)) => {
            let help = "leave one of them";
            reader.error(&own.place("diaginertia"), "moments of inertia are given twice", help);
            return None;
        }
        (Some(full), None) => {
            if !pose.turn.is_none() {
                let help = "write the moments in the frame of the body, without a rotation";
                reader.error(&own.place("fullinertia"), "a full matrix of inertia has a rotation", help);
            }
            full
        }
        (None, diagonal) => {
            let [xx, yy, zz] = diagonal.unwrap_or_else(zeros);
            [xx, yy, zz, Number::zero(), Number::zero(), Number::zero()]
        }
    };
    let is_empty = mass.is_zero() && moments.iter().all(Number::is_zero);
    (!is_empty).then_some(Inertia {
        name: name.to_owned(),
        mass: Mass::Given(mass),
        pose,
        moments: Moments::Given(moments),
        lift: Number::zero(),
    })
}
