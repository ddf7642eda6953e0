//! What a description of a robot says once in many places, or in one of two ways: imported models against another
//! description of the same robot, or against rates written out by hand.

use std::collections::BTreeMap;

use hamel_codegen::import::{Imported, Limits, Options, import};
use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;
use hamel_program::program::Role;

type Values = BTreeMap<String, f64>;

fn read(file: &str, text: &str, options: &Options) -> Imported {
    import(file, text, options).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn free_of_limits() -> Options {
    let mut options = Options::default();
    options.limits = Limits::None;
    options
}

/// The rates of an imported model at a state by names; what it does not name has values by its place.
fn rates_at(file: &str, text: &str, options: &Options, at: &[(&str, f64)]) -> Values {
    let text = read(file, text, options).text;
    let body = text.trim_end().strip_suffix('}').expect("a model");
    let text = format!("{body}    scene bare {{ want rhs; }}\n}}\n");
    let model = spec::parse("robot.hamel", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert!(model.warnings.is_empty(), "{}\n{text}", model.warnings.render(false));
    let built = scene::build(&model, "bare").unwrap_or_else(|e| panic!("{e}\n{text}"));
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let prepared = built.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let value = |(k, own): (usize, &String)| {
        let said = at.iter().find(|(name, _)| name == own);
        said.map_or_else(|| 0.3 + 0.17 * k as f64, |(_, value)| *value)
    };
    let y: Vec<f64> = built.state_names().iter().enumerate().map(value).collect();
    let mut dy = vec![0.0; y.len()];
    prepared.rhs(0.0, &y, &mut dy);
    built.state_names().iter().cloned().zip(dy).collect()
}

/// Texts of one format for the same robot have the same rates, and a robot that differs has others.
fn are_the_same(file: &str, text: &str, same: &str, other: &str) {
    let [own, same, other] = [text, same, other].map(|text| rates_at(file, text, &free_of_limits(), &[]));
    assert_eq!(own.keys().collect::<Vec<_>>(), same.keys().collect::<Vec<_>>(), "{text}");
    let scale = own.values().fold(0.0f64, |max, rate| max.max(rate.abs()));
    let differs = |other: &Values| {
        own.iter().map(|(name, rate)| (rate - other.get(name).unwrap_or(&f64::MAX)).abs()).fold(0.0, f64::max)
            / scale
    };
    // Both are rounded, at mass matrices of condition 1e3 at most.
    assert!(differs(&same) < 1e-12, "{:e}\n{text}", differs(&same));
    assert!(differs(&other) > 1e-4, "{:e}\n{text}", differs(&other));
}

/// An arm of MuJoCo of two joints with everything that flags switch off.
fn arm(head: &str, upper: &str, lower: &str, tail: &str) -> String {
    format!(
        "<mujoco model=\"arm\">{head}<worldbody><body name=\"upper\" pos=\"0 0 1\"><joint name=\"a\" axis=\"0 1 0\" {upper}/>\
         <geom type=\"box\" size=\"0.1 0.2 0.3\" pos=\"0.1 0.2 0.05\"/><body name=\"lower\" pos=\"0.3 0 0.2\">\
         <joint name=\"b\" axis=\"1 0 0\" pos=\"0 0.1 0\" {lower}/>\
         <geom type=\"capsule\" size=\"0.05 0.2\" pos=\"0 0.1 0.2\"/></body></body></worldbody>{tail}</mujoco>"
    )
}

#[test]
fn flags_switch_off_what_they_name() {
    let option = |flag: &str| format!("<option><flag {flag}=\"disable\"/></option>");
    for (flag, upper) in [
        ("spring", "stiffness=\"20\" springref=\"20\""),
        ("damper", "damping=\"3\""),
        ("frictionloss", "frictionloss=\"2\""),
        ("constraint", "frictionloss=\"2\""),
    ] {
        are_the_same(
            "arm.xml",
            &arm(&option(flag), upper, "", ""),
            &arm("", "", "", ""),
            &arm(&option("gravity"), upper, "", ""),
        );
    }
    // A flag holds whatever stands behind it.
    are_the_same(
        "arm.xml",
        &arm(&format!("{}<option gravity=\"0 0 -3\"/>", option("gravity")), "", "", ""),
        &arm("<option gravity=\"0 0 0\"/>", "", "", ""),
        &arm("<option gravity=\"0 0 -3\"/>", "", "", ""),
    );
    let bound = "<equality><joint name=\"belt\" joint1=\"b\" joint2=\"a\"/></equality>";
    for head in
        [option("equality"), option("constraint"), "<default><equality active=\"false\"/></default>".into()]
    {
        are_the_same(
            "arm.xml",
            &arm(&head, "", "", bound),
            &arm("", "", "", ""),
            &arm("", "damping=\"1\"", "", ""),
        );
        let notes = read("arm.xml", &arm(&head, "", "", bound), &Options::default()).notes;
        assert!(
            notes.iter().any(|note| note.message.contains("the equation `belt`, a joint, is")),
            "{notes}"
        );
    }
    let limited = |flag: &str| {
        let text = arm(&option(flag), "range=\"-10 10\"", "", "");
        read("arm.xml", &text, &Options::default()).text.contains("coordinate a in angle;")
    };
    assert!(limited("limit") && limited("constraint") && !limited("gravity"));
    // Motors that are switched off are told.
    let motors =
        "<actuator><motor name=\"m\" joint=\"a\" group=\"2\"/><motor name=\"n\" joint=\"b\"/></actuator>";
    for (head, left) in [(option("actuation"), 0), ("<option actuatorgroupdisable=\"1 2\"/>".into(), 1)] {
        let found = read("arm.xml", &arm(&head, "", "", motors), &Options::default());
        assert_eq!(found.text.matches("input ctrl_").count(), left, "{}", found.text);
        assert!(found.notes.iter().any(|note| note.message.starts_with("the motor `m` is not taken")));
    }
}

/// A class has what the class around it has said before: own elements first, and nothing of later elements `default`.
///
/// # Source
/// `dof_damping` and `dof_armature` of MuJoCo 4.0.0 for these files.
#[test]
fn a_class_begins_with_what_the_class_around_it_has_said() {
    let inner = "<default class=\"c\"><joint armature=\"0.5\"/></default>";
    are_the_same(
        "arm.xml",
        &arm(&format!("<default>{inner}<joint damping=\"2\"/></default>"), "class=\"c\"", "", ""),
        &arm("", "damping=\"2\" armature=\"0.5\"", "damping=\"2\"", ""),
        &arm("", "armature=\"0.5\"", "damping=\"2\"", ""),
    );
    are_the_same(
        "arm.xml",
        &arm(
            &format!("<default>{inner}</default><default><joint damping=\"2\"/></default>"),
            "class=\"c\"",
            "",
            "",
        ),
        &arm("", "armature=\"0.5\"", "damping=\"2\"", ""),
        &arm("", "damping=\"2\" armature=\"0.5\"", "damping=\"2\"", ""),
    );
}

/// The product of quaternions `w, x, y, z`.
fn product(p: [f64; 4], q: [f64; 4]) -> [f64; 4] {
    [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    ]
}

/// The quaternion of a turn by degrees about an axis of coordinates.
fn about(axis: usize, degrees: f64) -> [f64; 4] {
    let half = degrees.to_radians() / 2.0;
    let mut q = [half.cos(), 0.0, 0.0, 0.0];
    q[axis] = half.sin();
    q
}

fn digits(values: &[f64]) -> String {
    values.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(" ")
}

#[test]
fn angles_about_axes_that_turn_and_axes_at_rest_may_be_mixed() {
    for (sequence, axes) in [("xYz", [1, 2, 3]), ("ZyX", [3, 2, 1]), ("xyZ", [1, 2, 3]), ("XYZ", [1, 2, 3])] {
        let mut whole = [1.0, 0.0, 0.0, 0.0];
        for ((axis, letter), angle) in axes.into_iter().zip(sequence.chars()).zip([10.0, 20.0, 30.0]) {
            let turn = about(axis, angle);
            whole = if letter.is_uppercase() { product(turn, whole) } else { product(whole, turn) };
        }
        let turned = |head: &str, attribute: &str| {
            arm(head, "", "", "").replace("pos=\"0 0 1\"", &format!("pos=\"0 0 1\" {attribute}"))
        };
        are_the_same(
            "arm.xml",
            &turned(&format!("<compiler eulerseq=\"{sequence}\"/>"), "euler=\"10 20 30\""),
            &turned("", &format!("quat=\"{}\"", digits(&whole))),
            &turned("", "euler=\"20 10 30\""),
        );
    }
}

/// `zaxis` nearly against the third axis: the angle `pi - s` with `sin s` of 1e-5, about the axis across.
#[test]
fn a_direction_nearly_against_the_third_axis_keeps_its_digits() {
    let lean: f64 = 1e-5;
    let turned = |attribute: &str| {
        arm("<option gravity=\"1 2 -9\"/>", "", "", "")
            .replace("pos=\"0 0 1\"", &format!("pos=\"0 0 1\" {attribute}"))
    };
    let angle = 180.0 - lean.atan().to_degrees();
    let length = 5f64.sqrt();
    let half = angle.to_radians() / 2.0;
    // cross([0, 0, 1], [1, 2, z]) is along [-2, 1, 0].
    let q = [half.cos(), -2.0 / length * half.sin(), 1.0 / length * half.sin(), 0.0];
    are_the_same(
        "arm.xml",
        &turned(&format!("zaxis=\"{} -1\"", digits(&[lean / length, 2.0 * lean / length]))),
        &turned(&format!("quat=\"{}\"", digits(&q))),
        &turned("zaxis=\"0 0 -1\""),
    );
}

#[test]
fn bodies_and_joints_without_names_leave_the_names_of_others() {
    let geom = "<geom size=\"0.1\" pos=\"0.1 0.2 0.3\"/>";
    let text = format!(
        "<mujoco><worldbody><body><joint axis=\"0 1 0\"/>{geom}<body name=\"body1\"><joint/>\
         <joint name=\"body1_joint\" axis=\"1 0 0\"/>{geom}</body></body></worldbody></mujoco>"
    );
    let found = read("arm.xml", &text, &Options::default()).text;
    for name in ["body2_joint", "body1_joint", "body1_joint2"] {
        assert!(found.contains(&format!("coordinate {name} in angle;")), "{found}");
    }
}

/// `total_mass` is that of all bodies, and of one at rest, too: of 3 kg the ball of radius 0.1 beside one of 0.2 m has
/// a ninth. Its rates have no mass in them, but those by a motor.
#[test]
fn masses_at_rest_are_of_the_total_mass() {
    let text = "<mujoco><compiler settotalmass=\"3\"/><worldbody><body name=\"rest\"><geom size=\"0.2\"/></body>\
         <body name=\"cart\"><joint name=\"x\" type=\"slide\" axis=\"1 0 0\" stiffness=\"2\"/><geom size=\"0.1\"/></body>\
         </worldbody></mujoco>";
    let found = rates_at("cart.xml", text, &Options::default(), &[("x", 0.5), ("x_dot", 0.0)])["x_dot"];
    assert!((found - (-2.0 * 0.5 / (3.0 / 9.0))).abs() < 1e-12, "{found}");
}

/// A pendulum of 2 kg at 0.4 m with moments 0.1 kg m^2 about the hinge's axis, from the third axis by an angle.
fn pendulum(weight: f64) -> f64 {
    let (m, l, i) = (2.0, 0.4, 0.1);
    weight * m * 9.81 * l * 0.7f64.sin() / (i + m * l * l)
}

/// Weights that are held up pull by the rest; flags of both passive forces switch that off.
#[test]
fn a_part_of_the_weight_may_be_held_up() {
    let text = |head: &str, attribute: &str| {
        format!(
            "<mujoco>{head}<worldbody><body name=\"rod\" {attribute}><joint name=\"q\" axis=\"0 1 0\"/>\
             <inertial pos=\"0 0 0.4\" mass=\"2\" diaginertia=\"0.1 0.1 0.1\"/></body></worldbody></mujoco>"
        )
    };
    let rate = |head: &str, attribute: &str| {
        rates_at("rod.xml", &text(head, attribute), &Options::default(), &[("q", 0.7), ("q_dot", 0.2)])["q_dot"]
    };
    let one = "<option><flag spring=\"disable\"/></option>";
    let both = "<option><flag spring=\"disable\" damper=\"disable\"/></option>";
    for (head, attribute, weight) in [
        ("", "", 1.0),
        ("", "gravcomp=\"0.6\"", 0.4),
        ("", "gravcomp=\"1\"", 0.0),
        ("", "gravcomp=\"1.5\"", -0.5),
        (one, "gravcomp=\"1\"", 0.0),
        (both, "gravcomp=\"1\"", 1.0),
    ] {
        let found = rate(head, attribute);
        assert!((found - pendulum(weight)).abs() < 1e-12, "{attribute}: {found}, {}", pendulum(weight));
    }
    // Bodies that are joined have each its own part: of two equal ones at one place half of the weight.
    let joined = text("", "gravcomp=\"1\"").replace(
        "</body></worldbody>",
        "<body name=\"tip\" pos=\"0 0 0.1\"><inertial pos=\"0 0 0.3\" mass=\"2\" diaginertia=\"0.1 0.1 0.1\"/></body>\
         </body></worldbody>",
    );
    let found = rates_at("rod.xml", &joined, &Options::default(), &[("q", 0.7), ("q_dot", 0.2)])["q_dot"];
    assert!((found - pendulum(0.5)).abs() < 1e-12, "{found}");
    let refused = import("rod.xml", &text("", "gravcomp=\"-1\""), &Options::default()).expect_err("negative");
    assert!(refused.to_string().contains("`gravcomp` is negative"), "{refused}");
}

const BALL: &str = "<inertial><origin xyz=\"0.1 0.2 0.3\"/><mass value=\"2\"/><inertia ixx=\"0.1\" iyy=\"0.2\" izz=\"0.25\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";

/// The components of a variable at the start, by the endings of their names.
fn starts<const N: usize>(
    file: &str,
    text: &str,
    options: &Options,
    name: &str,
    endings: [&str; N],
) -> [f64; N] {
    let text = read(file, text, options).text;
    let model = spec::parse("robot.hamel", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let values = scene::initial_values(&model, &BTreeMap::new());
    endings.map(|ending| {
        values.get(&format!("{name}{ending}")).copied().unwrap_or_else(|| panic!("{name}{ending}"))
    })
}

const AXES: [&str; 3] = ["1", "2", "3"];
const QUATERNION: [&str; 4] = ["w", "x", "y", "z"];

/// A vector turned by a quaternion of length one.
fn turned(q: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let back = [q[0], -q[1], -q[2], -q[3]];
    let [_, x, y, z] = product(product(q, [0.0, x, y, z]), back);
    [x, y, z]
}

fn are_near<const N: usize>(found: [f64; N], expected: [f64; N]) {
    let largest = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // Some products of rounded sines.
    assert!(largest < 1e-14, "{found:?}, {expected:?}");
}

/// A body behind a floating joint is there, falls, and starts where the frames before it have it.
#[test]
fn a_body_that_floats_from_a_link_fixed_to_the_root_starts_where_that_is() {
    let text = format!(
        "<robot name=\"r\"><link name=\"a\"/><link name=\"stand\"/><link name=\"ball\">{BALL}</link>\
         <joint name=\"f\" type=\"fixed\"><parent link=\"a\"/><child link=\"stand\"/>\
         <origin xyz=\"1 2 3\" rpy=\"0.3 -0.4 0.5\"/></joint>\
         <joint name=\"free\" type=\"floating\"><parent link=\"stand\"/><child link=\"ball\"/>\
         <origin xyz=\"0.1 0.2 0.3\" rpy=\"0.2 0.7 -0.1\"/></joint></robot>"
    );
    let of = |rpy: [f64; 3]| {
        let [roll, pitch, yaw] = rpy.map(f64::to_degrees);
        product(about(3, yaw), product(about(2, pitch), about(1, roll)))
    };
    let (stand, own) = (of([0.3, -0.4, 0.5]), of([0.2, 0.7, -0.1]));
    let (moved, q) = (turned(stand, [0.1, 0.2, 0.3]), product(stand, own));
    let options = Options::default();
    are_near(starts("r.urdf", &text, &options, "attitude", QUATERNION), q);
    are_near(
        starts("r.urdf", &text, &options, "position", AXES),
        [1.0 + moved[0], 2.0 + moved[1], 3.0 + moved[2]],
    );
    are_near(starts("r.urdf", &text, &options, "height", [""]), [3.0 + moved[2]]);
    let back = [q[0], -q[1], -q[2], -q[3]];
    are_near(starts("r.urdf", &text, &options, "up", AXES), turned(back, [0.0, 0.0, 1.0]));
    let still = [("Omega1", 0.0), ("Omega2", 0.0), ("Omega3", 0.0), ("up1", 0.0), ("up2", 0.6), ("up3", 0.8)];
    let rates = rates_at("r.urdf", &text, &options, &still);
    are_near([rates["V1"], rates["V2"] / 0.6, rates["V3"] / 0.8], [0.0, -9.81, -9.81]);
}

/// Frames around a body that moves freely, and each word for its rotation.
#[test]
fn a_free_body_of_mujoco_starts_in_its_frames() {
    let text = |frame: &str, body: &str| {
        format!(
            "<mujoco><worldbody><frame pos=\"1 2 3\" {frame}><body name=\"ball\" pos=\"0.1 0.2 0.3\" {body}><freejoint/>\
             <geom size=\"0.1\"/></body></frame></worldbody></mujoco>"
        )
    };
    let frame = product(product(about(1, 10.0), about(2, 20.0)), about(3, 30.0));
    let s = 0.5f64.sqrt();
    for (body, own) in [
        ("", [1.0, 0.0, 0.0, 0.0]),
        ("axisangle=\"0 2 0 40\"", about(2, 40.0)),
        ("quat=\"1 0 1 1\"", [1.0, 0.0, 1.0, 1.0].map(|x: f64| x / 3f64.sqrt())),
        // A quarter turn about the first axis, and half a turn more about each axis: every largest entry.
        ("xyaxes=\"1 0 0 0 0 1\"", [s, s, 0.0, 0.0]),
        ("xyaxes=\"0 1 0 0 0 1\"", [0.5, 0.5, 0.5, 0.5]),
        ("xyaxes=\"3 0.1 0 0 -1 0.1\"", axes([3.0, 0.1, 0.0], [0.0, -1.0, 0.1])),
        ("xyaxes=\"-3 0.1 0 0 1 0.1\"", axes([-3.0, 0.1, 0.0], [0.0, 1.0, 0.1])),
        ("xyaxes=\"-3 0.1 0 0 -1 0.1\"", axes([-3.0, 0.1, 0.0], [0.0, -1.0, 0.1])),
        ("zaxis=\"0 1 0\"", about(1, -90.0)),
        ("zaxis=\"0 3 4\"", about(1, -(3f64 / 4.0).atan().to_degrees())),
        ("zaxis=\"0.3 0 -0.4\"", about(2, 180.0 - (3f64 / 4.0).atan().to_degrees())),
    ] {
        let text = text("euler=\"10 20 30\"", body);
        let found = starts("r.xml", &text, &Options::default(), "attitude", QUATERNION);
        let expected = product(frame, own);
        // Both signs are one rotation.
        let sign = found.iter().zip(&expected).map(|(a, b)| a * b).sum::<f64>().signum();
        are_near(found.map(|x| sign * x), expected);
        let [x, y, z] = turned(frame, [0.1, 0.2, 0.3]);
        are_near(starts("r.xml", &text, &Options::default(), "position", AXES), [1.0 + x, 2.0 + y, 3.0 + z]);
    }
}

/// The quaternion of the axes along `x` and near `y`, by the rotation of the first axis and one about it.
fn axes(x: [f64; 3], y: [f64; 3]) -> [f64; 4] {
    let length = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [a, b, c] = x.map(|x| x / length);
    // Half the way from the first axis to x; no case here has x against it and nothing across.
    let to = [1.0 + a, 0.0, -c, b];
    let length = to.iter().map(|x| x * x).sum::<f64>().sqrt();
    let to = to.map(|x| x / length);
    let [_, s, t] = turned([to[0], -to[1], -to[2], -to[3]], y);
    product(to, about(1, t.atan2(s).to_degrees()))
}

/// A follower that moves no mass has followers and forces all the same.
#[test]
fn a_follower_without_mass_has_its_own_followers_and_forces() {
    let joint = |name: &str, child: &str, items: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"a\"/><child link=\"{child}\"/>\
             <axis xyz=\"1 2 0\"/>{items}</joint>"
        )
    };
    let robot = |joints: &str| {
        let link = |name: &str, items: &str| format!("<link name=\"{name}\">{items}</link>");
        let links: String =
            [("a", ""), ("b", BALL), ("c", ""), ("d", BALL)].map(|(n, i)| link(n, i)).concat();
        format!("<robot name=\"r\">{links}{joints}</robot>")
    };
    let all = |middle: &str, last: &str| {
        robot(&format!("{}{}{}", joint("j", "b", ""), joint("k", "c", middle), joint("l", "d", last)))
    };
    let double = "<mimic joint=\"j\" multiplier=\"2\" offset=\"0.1\"/>";
    are_the_same(
        "r.urdf",
        &all(double, "<mimic joint=\"k\" multiplier=\"0.5\" offset=\"0.3\"/>"),
        &all("<mimic joint=\"j\"/>", "<mimic joint=\"j\" multiplier=\"1\" offset=\"0.35\"/>"),
        &all(double, "<mimic joint=\"j\" multiplier=\"2\" offset=\"0.3\"/>"),
    );
    // Damping of twice the rate is four times that of the rate.
    are_the_same(
        "r.urdf",
        &all(&format!("{double}<dynamics damping=\"0.5\"/>"), ""),
        &robot(&format!(
            "{}{}{}",
            joint("j", "b", "<dynamics damping=\"2\"/>"),
            joint("k", "c", double),
            joint("l", "d", "")
        )),
        &all(double, ""),
    );
}

/// A model of Gazebo of a rod on a link, with two revolute joints.
fn gazebo(head: &str, base: &str, joint: &str) -> String {
    let link = |name: &str, items: &str| {
        format!(
            "<link name=\"{name}\">{items}<inertial><pose>0.1 0.2 0.05 0.1 0.2 0.3</pose><mass>1.2</mass><inertia>\
             <ixx>0.3</ixx><iyy>0.25</iyy><izz>0.2</izz><ixy>0.01</ixy></inertia></inertial></link>"
        )
    };
    let rod = format!("<pose relative_to=\"base\">0.3 0.4 0.2 -0.3 0.5 0.1</pose>{joint}");
    format!(
        "<sdf version=\"1.9\"><model name=\"m\"{head}{}{}<joint name=\"q\" type=\"revolute\"><parent>base</parent>\
         <child>rod</child><axis><xyz>1 2 3</xyz></axis></joint></model></sdf>",
        link("base", base),
        link("rod", &rod)
    )
}

/// Gravity pulls along the axis of the world, however the link at rest is turned in it.
#[test]
fn a_link_at_rest_is_turned_as_the_file_has_it() {
    let held = "<joint name=\"w\" type=\"fixed\"><parent>world</parent><child>base</child></joint>";
    let pose = "<pose>0 0 1 0.4 -0.5 0.6</pose>";
    let upright = gazebo(">", "", "");
    are_the_same("m.sdf", &gazebo(">", pose, ""), &gazebo(&format!(">{held}"), pose, ""), &upright);
    // So does the pose of the model.
    let model = format!(">{pose}");
    are_the_same("m.sdf", &gazebo(&model, "", ""), &gazebo(&format!(">{held}"), pose, ""), &upright);
    are_the_same("m.sdf", &gazebo(&format!(">{held}{pose}"), "", ""), &gazebo(">", pose, ""), &upright);
    // A link that floats starts there.
    let mut options = Options::default();
    options.floating = true;
    let q = product(
        about(3, 0.6f64.to_degrees()),
        product(about(2, -0.5f64.to_degrees()), about(1, 0.4f64.to_degrees())),
    );
    are_near(starts("m.sdf", &gazebo(">", pose, ""), &options, "attitude", QUATERNION), q);
    are_near(starts("m.sdf", &gazebo(">", pose, ""), &options, "height", [""]), [1.0]);
}

#[test]
fn switches_of_gazebo_have_two_words_each() {
    let posed = |attribute: &str| gazebo(">", &format!("<pose{attribute}>0 0 1 40 -20 60</pose>"), "");
    are_the_same("m.sdf", &posed(" degrees=\"1\""), &posed(" degrees=\"true\""), &posed(" degrees=\"0\""));
    let refused = import("m.sdf", &posed(" degrees=\"yes\""), &Options::default()).expect_err("a word");
    assert!(refused.to_string().contains("`degrees` is \"yes\""), "{refused}");
    // Gravity of a link: the rod alone moves.
    let light = gazebo(">", "", "<gravity>false</gravity>");
    are_the_same(
        "m.sdf",
        &light,
        &gazebo(">", "", "")
            .replace("<model", "<world name=\"w\"><gravity>0 0 0</gravity><model")
            .replace("</model>", "</model></world>"),
        &gazebo(">", "", "<gravity>1</gravity>"),
    );
}

/// A world without `gravity` has that of the format, which is told.
#[test]
fn a_world_has_the_gravity_of_the_format() {
    let world = |gravity: &str| {
        gazebo(">", "", "")
            .replace("<model", &format!("<world name=\"w\">{gravity}<model"))
            .replace("</model>", "</model></world>")
    };
    are_the_same(
        "m.sdf",
        &world(""),
        &world("<gravity>0 0 -9.8</gravity>"),
        &world("<gravity>0 0 -9.81</gravity>"),
    );
    let notes = read("m.sdf", &world(""), &Options::default()).notes;
    assert!(notes.iter().any(|note| note.message.contains("9.8 m/s^2")), "{notes}");
}

/// Frames that are attached to nothing belong to the canonical link: the first one, or the one that the model names.
#[test]
fn frames_of_the_model_are_attached_to_its_canonical_link() {
    let by =
        |head: &str, parent: &str| gazebo(head, "", "").replace("<parent>base", &format!("<parent>{parent}"));
    let frame = ">\n<frame name=\"f\"><pose>0.1 0.2 0.3 0 0 0</pose></frame>";
    let plain = gazebo(">", "", "");
    let other = plain.replace("1 2 3", "2 1 3");
    are_the_same("m.sdf", &by(frame, "f"), &plain, &other);
    are_the_same("m.sdf", &by(">", "__model__"), &plain, &other);
    let reversed =
        |text: &str| text.replace("<parent>base", "<parent>f").replace("name=\"base\"", "name=\"first\"");
    let named = format!(" canonical_link=\"first\"{frame}");
    are_the_same(
        "m.sdf",
        &reversed(&gazebo(&named, "", "")).replace("=\"base\"", "=\"first\""),
        &plain,
        &other,
    );
}

/// A screw on a vertical axis of mass m and moment I falls by the angle: `(I + m p^2) q'' = -m g p`, p in m/rad.
#[test]
fn a_screw_goes_along_its_axis_by_its_angle() {
    let screw = |pitch: &str, axis: &str| {
        format!(
            "<sdf version=\"1.11\"><model name=\"m\"><link name=\"nut\"><inertial><mass>2</mass><inertia><izz>0.01</izz>\
             </inertia></inertial></link><joint name=\"q\" type=\"screw\"><parent>world</parent><child>nut</child>{pitch}\
             <axis><xyz>{axis}</xyz></axis></joint></model></sdf>"
        )
    };
    let turn = 2.0 * std::f64::consts::PI;
    for (pitch, axis, p) in [
        ("<screw_thread_pitch>0.3</screw_thread_pitch>", "0 0 1", 0.3 / turn),
        ("<screw_thread_pitch>0.3</screw_thread_pitch>", "0 0 -1", -0.3 / turn),
        ("<screw_thread_pitch>-0.3</screw_thread_pitch><thread_pitch>5</thread_pitch>", "0 0 1", -0.3 / turn),
        ("<thread_pitch>4</thread_pitch>", "0 0 1", -1.0 / 4.0),
        ("<thread_pitch>-4</thread_pitch>", "0 0 1", 1.0 / 4.0),
    ] {
        let found = rates_at("m.sdf", &screw(pitch, axis), &Options::default(), &[])["q_dot"];
        let expected = -2.0 * 9.81 * p / (0.01 + 2.0 * p * p);
        assert!((found - expected).abs() < 1e-12 * expected.abs(), "{pitch}: {found}, {expected}");
    }
    let refused =
        import("m.sdf", &screw("", "0 0 1"), &Options::default()).expect_err("no pitch").to_string();
    assert!(
        refused.contains("the screw has no pitch") && refused.contains("screw_thread_pitch"),
        "{refused}"
    );
}

/// Limits without an end are none, and a joint follows another one from a reference.
#[test]
fn limits_and_followers_of_gazebo() {
    let limit = |low: &str| {
        let limit = format!("1 2 3</xyz><limit><lower>{low}</lower><upper>inf</upper></limit>");
        read("m.sdf", &gazebo(">", "", "").replace("1 2 3</xyz>", &limit), &Options::default())
    };
    assert!(limit("-inf").text.contains("coordinate q in angle;") && limit("-inf").notes.iter().count() < 2);
    assert!(limit("-1").notes.iter().any(|note| note.message.contains("no interval")));
    let follower = |offset: &str, reference: &str| {
        let second = format!(
            "<link name=\"tip\"/><joint name=\"p\" type=\"revolute\"><parent>rod</parent><child>tip</child>\
             <pose>0.1 0 0.2 0 0 0</pose><axis><xyz>0 1 0</xyz><mimic joint=\"q\"><multiplier>2</multiplier>\
             <offset>{offset}</offset><reference>{reference}</reference></mimic></axis></joint></model>"
        );
        gazebo(">", "", "").replace("</model>", &second)
    };
    are_the_same("m.sdf", &follower("0.1", "0.3"), &follower("-0.5", "0"), &follower("0.1", "0"));
}

/// A named frame is that of the body in the file, which is not that of the joint: the lower joint is at
/// `[0, 0.1, 0]` of its body.
#[test]
fn a_named_frame_has_its_origin_where_the_file_has_it() {
    let mut options = free_of_limits();
    options.frames = vec!["upper".to_owned(), "lower".to_owned()];
    let text = read("arm.xml", &arm("", "", "", ""), &options).text;
    let body = text.trim_end().strip_suffix('}').expect("a model");
    let text = format!("{body}    scene posed {{ want frames; }}\n}}\n");
    let model = spec::parse("robot.hamel", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let built = scene::build(&model, "posed").unwrap_or_else(|e| panic!("{e}\n{text}"));
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let program = built.program();
    let prepared = program.prepare(&params).expect("default parameters");
    let (a, b) = (0.4f64, 0.7f64);
    let y: Vec<f64> = built
        .state_names()
        .iter()
        .map(|name| match name.as_str() {
            "a" => a,
            "b" => b,
            _ => 0.0,
        })
        .collect();
    let k = program.function_idx(&Role::Output("frame_poses".into())).expect("wanted");
    let mut out = vec![0.0; program.functions[k].results.len()];
    program.run(k, &params, &prepared, 0.0, &y, &mut out);
    let turn = about(2, a.to_degrees());
    let [x, y, z] = turned(about(1, b.to_degrees()), [0.0, -0.1, 0.0]);
    let [x, y, z] = turned(turn, [0.3 + x, 0.1 + y, 0.2 + z]);
    for (name, place) in [("upper", [0.0, 0.0, 1.0]), ("lower", [x, y, 1.0 + z])] {
        let frame = built.frame_names().iter().position(|own| own == name).expect("a frame");
        let found: [f64; 3] = std::array::from_fn(|k| out[12 * frame + k]);
        are_near(found, place);
    }
}

/// Each word for a rotation is one that the language sees to be a rotation, for frames and bodies.
#[test]
fn frames_and_bodies_may_be_turned_by_every_word() {
    let mut options = free_of_limits();
    options.frames = vec!["lower".to_owned()];
    options.bodies = true;
    for word in
        ["zaxis=\"0.2 0.3 -0.1\"", "zaxis=\"0.2 0 0.1\"", "xyaxes=\"1 2 3 4 5 7\"", "quat=\"1 2 3 4\""]
    {
        let text = arm("", "", "", "").replace("pos=\"0 0 1\"", &format!("pos=\"0 0 1\" {word}"));
        let text = read("arm.xml", &text, &options).text;
        assert!(spec::parse("robot.hamel", &text).is_ok(), "{text}");
    }
}
