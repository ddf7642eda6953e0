//! Imported robots against rates by Pinocchio and MuJoCo, which share nothing with hamel (`robots/reference.py`,
//! `robots/reference_mujoco.py`, `robots/reference_loops.py`), and messages about files that are wrong.

use std::io;

use hamel_codegen::import::{Imported, Limits, Options, import, import_with};
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;
use hamel_program::program::Role;

const ARM: &str = include_str!("robots/arm.urdf");
const FLYER: &str = include_str!("robots/flyer.urdf");
const CART: &str = include_str!("robots/cart.urdf");
const ARM_SDF: &str = include_str!("robots/arm.sdf");
const REFERENCE: &str = include_str!("robots/reference.txt");
const REFERENCE_FRAMES: &str = include_str!("robots/reference_frames.txt");
const CRANE: &str = include_str!("robots/crane.xml");
const CRANE_DEFAULTS: &str = include_str!("robots/crane_defaults.xml");
const FLOCK: &str = include_str!("robots/flock.xml");
const ROVER: &str = include_str!("robots/rover.xml");
const LINKAGE: &str = include_str!("robots/linkage.xml");
const HOPPER: &str = include_str!("robots/hopper.xml");
const WRIST: &str = include_str!("robots/wrist.xml");
const GATE: &str = include_str!("robots/gate.sdf");
const REFERENCE_LOOPS: &str = include_str!("robots/reference_loops.txt");
const STICK: &str = include_str!("robots/stick.xml");
const REFERENCE_MUJOCO: &str = include_str!("robots/reference_mujoco.txt");

fn files(name: &str) -> io::Result<String> {
    match name {
        "crane_defaults.xml" => Ok(CRANE_DEFAULTS.to_owned()),
        "itself.xml" => Ok("<mujoco><option/><include file=\"itself.xml\"/></mujoco>".to_owned()),
        "wrong.xml" => Ok("<mujoco>\n<option gravity=\"0 0\"/></mujoco>".to_owned()),
        _ => Err(io::Error::from(io::ErrorKind::NotFound)),
    }
}

fn imported(text: &str, options: &Options) -> Imported {
    import_with("robot.xml", text, options, &files).unwrap_or_else(|e| panic!("{e}"))
}

/// The rates of an imported robot, with values of its controls.
fn built(text: &str, options: &Options, reference: &str, robot: &str) -> BuiltScene {
    let mut text = imported(text, options).text;
    let first = reference.lines().find(|line| line.starts_with(robot)).expect("a robot of the reference");
    for (name, value) in values(first.split(" | ").nth(1).expect("a state")) {
        if name.starts_with("ctrl_") {
            let held = format!("input {name} = 0;");
            assert_eq!(text.matches(&held).count(), 1, "{name}");
            text = text.replace(&held, &format!("input {name} = {value:?};"));
        }
    }
    let body = text.trim_end().strip_suffix('}').expect("a model");
    let text = format!("{body}    scene bare {{ want rhs; }}\n}}\n");
    let model = spec::parse("robot.hamel", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert!(model.warnings.is_empty(), "{}", model.warnings.render(false));
    scene::build(&model, "bare").unwrap_or_else(|e| panic!("{e}"))
}

fn values(text: &str) -> Vec<(&str, f64)> {
    text.split_whitespace()
        .map(|pair| {
            let (name, value) = pair.split_once('=').expect("a name and its value");
            (name, value.parse().expect("a number"))
        })
        .collect()
}

/// The largest difference of a rate from that of the reference, by the largest rate of its state; of all states.
fn difference(text: &str, options: &Options, reference: &str, robot: &str) -> f64 {
    let built = built(text, options, reference, robot);
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let prepared = built.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let mut largest = 0.0f64;
    let mut n_states = 0;
    for line in reference.lines() {
        let [name, state, expected] = line.split(" | ").collect::<Vec<_>>()[..] else { panic!("{line}") };
        if name != robot {
            continue;
        }
        let (mut state, expected) = (values(state), values(expected));
        state.retain(|(name, _)| !name.starts_with("ctrl_"));
        let of =
            |own: &String| state.iter().find(|(name, _)| name == own).unwrap_or_else(|| panic!("no {own}")).1;
        let y: Vec<f64> = built.state_names().iter().map(of).collect();
        assert_eq!(y.len(), state.len(), "{robot}");
        let mut dy = vec![0.0; y.len()];
        prepared.rhs(0.0, &y, &mut dy);
        let scale = expected.iter().map(|(_, rate)| rate.abs()).fold(0.0, f64::max);
        for (name, rate) in expected {
            let at =
                built.state_names().iter().position(|own| own == name).unwrap_or_else(|| panic!("no {name}"));
            largest = largest.max((dy[at] - rate).abs() / scale);
        }
        n_states += 1;
    }
    assert_eq!(n_states, 4, "{robot}");
    largest
}

fn floating() -> Options {
    let mut options = Options::default();
    options.floating = true;
    options
}

/// Loops by points, sites and frames, in planes and in space, on the ground and on a body that moves freely.
#[test]
fn rates_of_loops_are_those_of_mujocos_matrices() {
    let oblique = GATE.replace("\"__model__\">0 1 0<", "\"__model__\">0 1 0.5<");
    let turned = |text: &str| text.replace("0.8 0.1 0.6 0 0 0<", "0.8 0.1 0.6 0.3 0 -0.4<");
    assert!(oblique != GATE && turned(GATE) != GATE);
    for (robot, text) in [
        ("linkage", LINKAGE),
        ("hopper", HOPPER),
        ("wrist", WRIST),
        ("gate", GATE),
        ("gate", &turned(GATE)),
        ("latch", &oblique),
        ("latch", &turned(&oblique)),
    ] {
        let found = difference(text, &without_limits(), REFERENCE_LOOPS, robot);
        // States of the reference keep the equations to 1e-13, its differences have eleven digits.
        assert!(found < 1e-9, "{robot}: {found:e}");
    }
}

/// Both are rounded, at mass matrices of condition 1e4 at most.
const TOLERANCE: f64 = 1e-12;

#[test]
fn rates_are_those_of_pinocchio() {
    for (robot, text, options) in
        [("arm", ARM, Options::default()), ("flyer", FLYER, floating()), ("cart", CART, Options::default())]
    {
        let found = difference(text, &options, REFERENCE, robot);
        assert!(found < TOLERANCE, "{robot}: {found:e}");
    }
}

/// Poses, twists and drifts of links, numbers of each frame: of a tool without a mass, behind joints that follow
/// others, and on a body that moves freely.
#[test]
fn frames_are_those_of_pinocchio() {
    for (robot, text, mut options, links, wants) in [
        ("arm", ARM, Options::default(), vec!["bracket", "finger", "thumb"], "frames"),
        ("flyer", FLYER, floating(), vec!["rod"], "frames, reconstruction"),
    ] {
        options.frames = links.iter().map(|link| (*link).to_owned()).collect();
        let text = imported(text, &options).text;
        let body = text.trim_end().strip_suffix('}').expect("a model");
        let text = format!("{body}    scene bare {{ want rhs, {wants}; }}\n}}\n");
        let model = spec::parse("robot.hamel", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let built = scene::build(&model, "bare").unwrap_or_else(|e| panic!("{e}"));
        assert!(built.certificate().open.is_empty(), "{:?}", built.certificate());
        let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
        let program = built.program();
        let prepared = program.prepare(&params).expect("default parameters");
        let mut n = 0;
        for line in REFERENCE_FRAMES.lines().filter(|line| line.starts_with(robot)) {
            let [_, state, link, expected] = line.split(" | ").collect::<Vec<_>>()[..] else {
                panic!("{line}")
            };
            let state = values(state);
            let of = |own: &String| {
                state.iter().find(|(name, _)| name == own).unwrap_or_else(|| panic!("no {own}")).1
            };
            let y: Vec<f64> = built.state_names().iter().map(of).collect();
            let frame = built.frame_names().iter().position(|name| name == link).expect("a frame");
            let mut found = Vec::new();
            for (group, width) in [("frame_poses", 12), ("frame_twists", 6), ("frame_drifts", 6)] {
                let k = program.function_idx(&Role::Output(group.into())).expect("wanted");
                let mut out = vec![0.0; program.functions[k].results.len()];
                program.run(k, &params, &prepared, 0.0, &y, &mut out);
                found.extend_from_slice(&out[width * frame..width * (frame + 1)]);
            }
            let expected: Vec<f64> = expected.split(' ').map(|x| x.parse().expect("a number")).collect();
            let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
            assert_eq!(found.len(), expected.len());
            for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
                assert!(
                    (found - expected).abs() < TOLERANCE * size,
                    "{link}: number {k}: {found}, {expected}"
                );
            }
            n += 1;
        }
        assert_eq!(n, 4 * links.len());
    }
}

#[test]
fn frames_of_links_that_are_not_there_are_refused() {
    let mut options = Options::default();
    options.frames = vec!["fingre".into()];
    let problems = import("arm.urdf", ARM, &options).expect_err("refused").to_string();
    assert!(problems.contains("there is no link `fingre` to have a frame"), "{problems}");
    assert!(problems.contains("upper arm"), "{problems}");
}

/// The arm in SDF, by other frames, has the rates of the arm in URDF.
#[test]
fn rates_of_sdf_are_those_of_pinocchio() {
    let found = difference(ARM_SDF, &Options::default(), REFERENCE, "arm");
    assert!(found < TOLERANCE, "{found:e}");
    let right = "<pose relative_to=\"elbow\">0.01 0.02 0.03 0 0 0</pose>";
    assert_eq!(ARM_SDF.matches(right).count(), 1);
    let wrong = ARM_SDF.replace(right, "<pose relative_to=\"elbow\">0.01 0.02 0.04 0 0 0</pose>");
    let found = difference(&wrong, &Options::default(), REFERENCE, "arm");
    assert!(found > 1e6 * TOLERANCE, "{found:e}");
}

/// Frames of joints and of axes, wherever they are written, move the arm alike.
#[test]
fn frames_of_joints_and_axes_in_sdf_are_those_of_the_arm() {
    let shoulder = "<pose>0 0 0 0 0 1.5707963267948966</pose>";
    let axis = "<xyz>0.7 0 -0.4</xyz>";
    // The frame of the joint by that of the base, then by an angle that is no quarter turn.
    let by_base =
        "<pose relative_to=\"base\" rotation_format=\"quat_xyzw\">0.1 -0.2 0.3 0.5 -0.5 0.5 0.5</pose>";
    let turned = "<pose>0 0 0 0 0 0.3</pose>";
    // Rot(e3, -0.3) [0, 0.7, -0.4]
    let by_turned = "<xyz>0.20686414466293772 0.66873554238792423 -0.4</xyz>";
    let parent = "<parent>motor</parent>";
    let cases: [&[(&str, &str)]; 7] = [
        &[(shoulder, by_base)],
        &[(axis, "<xyz expressed_in=\"upper arm\">0 0.7 -0.4</xyz>")],
        &[(axis, "<xyz expressed_in=\"__model__\">0 0.4 0.7</xyz>")],
        &[(axis, "<xyz>0 0.4 0.7</xyz><use_parent_model_frame>1</use_parent_model_frame>")],
        &[(shoulder, by_base), (axis, "<xyz expressed_in=\"base\">0 0.4 0.7</xyz>")],
        &[(shoulder, turned), (axis, by_turned)],
        // A frame in the place of the link that it is attached to.
        &[(parent, "<parent>tilted bracket</parent>")],
    ];
    for changes in cases {
        let mut text = ARM_SDF.to_owned();
        for (right, other) in changes {
            assert_eq!(text.matches(right).count(), 1, "{right}");
            text = text.replace(right, other);
        }
        let found = difference(&text, &Options::default(), REFERENCE, "arm");
        assert!(found < TOLERANCE, "{changes:?}: {found:e}");
    }
    // Axes were in the frame of the model up to version 1.4.
    let of_version = |version: &str, expressed: &str| {
        let text = format!(
            "<sdf version=\"{version}\"><model name=\"m\"><link name=\"a\"><pose>0 0 1 0.4 0 0</pose></link>\
             <joint name=\"q\" type=\"revolute\"><parent>world</parent><child>a</child>\
             <axis><xyz{expressed}>0 1 0</xyz></axis></joint></model></sdf>"
        );
        import("robot.sdf", &text, &Options::default()).unwrap_or_else(|e| panic!("{e}")).text
    };
    assert_eq!(of_version("1.4", ""), of_version("1.9", " expressed_in=\"__model__\""));
    assert_eq!(of_version("1.5", ""), of_version("1.9", ""));
    assert_ne!(of_version("1.4", ""), of_version("1.5", ""));
}

/// A model in SDF of a link that a joint holds in the world.
fn sdf(joint: &str, link: &str) -> String {
    format!(
        "<sdf version=\"1.9\"><model name=\"m\"><link name=\"a\"/>{link}<joint name=\"q\" {joint}</joint></model></sdf>"
    )
}

#[test]
fn wrong_sdf_models_are_refused_with_the_reason_and_the_fix() {
    let ends = "<parent>world</parent><child>a</child>";
    let axis = "<axis><xyz>0 1 0</xyz></axis>";
    let hinge = format!("type=\"revolute\">{ends}{axis}");
    let other = |kind: &str, items: &str| sdf(&format!("type=\"{kind}\">{ends}{items}"), "");
    let cases = [
        ("<sdf/>".to_owned(), "the file has 0 models", "one model"),
        ("<sdf><model name=\"m\"/></sdf>".to_owned(), "the model has no links", "`link`"),
        (sdf(&hinge, "<model name=\"n\"/>"), "another one within, by `model` `n`", "into this model"),
        (
            sdf(&hinge, "<include><uri>n</uri></include>"),
            "another one within, by `include`",
            "into this model",
        ),
        (
            sdf(&hinge, "<pose relative_to=\"f\">0 0 0 1 0 0</pose>"),
            "the pose of the model in the world is relative to `f`",
            "without `relative_to`",
        ),
        (
            sdf(&hinge, "").replace("name=\"m\"", "name=\"m\" placement_frame=\"f\""),
            "that of its frame `f`",
            "without `placement_frame`",
        ),
        (sdf(&hinge, "<static>1</static>"), "nothing moves: the model `m` is static", "remove"),
        (
            format!("<sdf><world name=\"w\"><joint name=\"j\"/>{}</world></sdf>", &sdf(&hinge, "")[19..])
                .replace("</sdf></world>", "</world>"),
            "a joint stands in the world",
            "into the model",
        ),
        (
            sdf(&hinge, "<link name=\"b\"><pose relative_to=\"c\">0 0 0 0 0 0</pose></link>"),
            "there is no frame `c`",
            "name a link",
        ),
        (other("gearbox", axis), "joint `q` has the type `gearbox`", "universal"),
        (other("revolute", ""), "joint `q` has no `axis`", "xyz"),
        (other("revolute", "<axis><xyz>0 0 0</xyz></axis>"), "the axis of joint `q` is zero", "direction"),
        (
            other("revolute", "<axis><xyz expressed_in=\"b\">0 1 0</xyz></axis>"),
            "the axis of joint `q` is by `b`, which is no frame",
            "name a link",
        ),
        (
            other("revolute", &format!("{axis}<pose>0 0</pose>")),
            "`pose` is \"0 0\", not 6 numbers",
            "decimal",
        ),
        (
            other("revolute", &format!("{axis}<pose relative_to=\"b\">0 0 0 0 0 0</pose>")),
            "there is no frame `b`",
            "name a link",
        ),
        (
            other("revolute", &format!("{axis}<pose relative_to=\"q\">0 0 0 0 0 0</pose>")),
            "relative to itself",
            "to the model",
        ),
        (
            sdf("type=\"fixed\"><parent>b</parent><child>a</child>", ""),
            "`b`, which is no link",
            "name a link",
        ),
        (sdf("type=\"fixed\"><child>a</child>", ""), "joint `q` has no `parent`", "<parent>"),
        (
            sdf(
                "type=\"screw\"><parent>world</parent><child>a</child><screw_thread_pitch>1</screw_thread_pitch>\
                 <axis><xyz>1 0 0</xyz></axis></joint><joint name=\"p\" type=\"screw\"><parent>world</parent>\
                 <child>a</child><screw_thread_pitch>1</screw_thread_pitch><axis><xyz>0 0 1</xyz></axis>",
                "",
            ),
            "joint `p` closes a loop, and has no equation for that",
            "a joint that is no screw",
        ),
        (
            other("revolute", "<axis><xyz>0 1 0</xyz><mimic joint=\"p\"/></axis>"),
            "there is no joint `p`",
            "name a joint",
        ),
    ];
    for (text, message, help) in cases {
        let refused = import("robot.sdf", &text, &Options::default()).expect_err(message);
        let shown = refused.render(false);
        assert!(shown.contains(message) && shown.contains(help), "{message}, {help}:\n{shown}");
        assert!(refused.iter().all(|problem| problem.span.is_some()), "{shown}");
    }
    // A universal joint has two angles, a ball joint a rotation; a link without inertia has that of the format.
    let universal = format!("type=\"universal\">{ends}{axis}<axis2><xyz>1 0 0</xyz></axis2>");
    let text = import("robot.sdf", &sdf(&universal, ""), &Options::default()).unwrap().text;
    assert!(text.contains("coordinate q_1 in angle;") && text.contains("coordinate q_2 in angle;"), "{text}");
    assert!(text.contains("param mass_a = 1 where mass_a > 0;"), "{text}");
    let ball = import("robot.sdf", &other("ball", ""), &Options::default()).unwrap().text;
    assert!(
        ball.contains("configuration q in SO(3) velocity q_rate;") && ball.contains("input tau_q: vector(3)")
    );
}

fn without_limits() -> Options {
    let mut options = Options::default();
    options.limits = Limits::None;
    options
}

#[test]
fn rates_are_those_of_mujoco() {
    for (robot, text) in [("crane", CRANE), ("flock", FLOCK), ("rover", ROVER), ("stick", STICK)] {
        let found = difference(text, &without_limits(), REFERENCE_MUJOCO, robot);
        assert!(found < TOLERANCE, "{robot}: {found:e}");
    }
}

#[test]
fn planted_faults_of_mujoco_models_are_found() {
    let faults = [
        (
            "the point that a joint holds",
            r#"pos="0.1 0 0"/>
      <geom type="box""#,
            r#"pos="0.11 0 0"/>
      <geom type="box""#,
        ),
        ("the sum of the masses", r#"settotalmass="7.5""#, r#"settotalmass="7.51""#),
        ("the mass of a geom", r#"mass="2""#, r#"mass="2.1""#),
        ("the radius of a geom", r#"size="0.1 0.05""#, r#"size="0.11 0.05""#),
        ("the angle of a body", r#"axisangle="0 1 0 -60""#, r#"axisangle="0 1 0 -61""#),
        ("the class of a joint", r#" class="rail""#, r#" type="slide""#),
        ("the gears of a motor", r#"gear="2""#, r#"gear="2.1""#),
    ];
    for (what, right, wrong) in faults {
        assert_eq!(ROVER.matches(right).count(), 1, "{what}");
        let found = difference(&ROVER.replace(right, wrong), &without_limits(), REFERENCE_MUJOCO, "rover");
        assert!(found > 1e6 * TOLERANCE, "{what}: {found:e}");
    }
}

#[test]
fn a_mujoco_model_keeps_names_and_digits_and_tells_the_rest() {
    let imported = imported(CRANE, &Options::default());
    for line in [
        "initial tilt = 15*pi/180;",
        "let E_mast = transpose(rot(e1, (tilt - 15*pi/180)));",
        "let drum = 0.3*(tilt - 15*pi/180)^4 + 0.4*(tilt - 15*pi/180)^2 - 1.5*(tilt - 15*pi/180) + 0.2;",
        "param qw_boom = 0.5;",
        "param density_tube = 400 where density_tube > 0;",
        "let half_tube = norm([0.3, -0.2, 0.6])/2;",
        "let g = norm([-0.4, 0.3, 9.7]);",
        "param kp_tilt_servo = 30;",
        "// the equation `joint` is not active, and not taken",
        "// `timestep` of `option` is not taken",
        "// `geom` of `worldbody` is not taken",
        "// `geom` of `body` is not taken",
    ] {
        assert!(imported.text.lines().any(|own| own.trim() == line), "{line}\n{}", imported.text);
    }
    let flock = import("flock.xml", FLOCK, &Options::default()).unwrap().text;
    for line in ["initial attitude_kite = unit([0.6, 0, 0.8, 0]);", "initial position_kite = [0.5, 0, 1];"] {
        assert!(flock.lines().any(|own| own.trim() == line), "{line}\n{flock}");
    }
    let rover = import_with("rover.xml", ROVER, &Options::default(), &files).unwrap().text;
    assert!(rover.contains("coordinate reach in real;"), "{rover}");
}

/// A free body and a ball joint share one group: each is reconstructed from its own velocities.
#[test]
fn a_free_body_has_a_ball_joint() {
    let body = "<body name=\"c\"><joint type=\"ball\"/><geom size=\"0.1\" pos=\"0 0 1\"/></body>";
    let imported = imported(&mujoco("", &format!("<freejoint/>{body}")), &Options::default());
    let model = spec::parse("b.hamel", &imported.text).unwrap_or_else(|e| panic!("{e}\n{}", imported.text));
    assert!(model.warnings.is_empty(), "{}", model.warnings.render(false));
    assert!(imported.text.contains("reconstruct attitude, position in SE(3) from Omega, V;"));
}

/// A transmission is a motor behind gears; the joint has no input beside.
#[test]
fn transmissions_are_motors_behind_gears() {
    let transmission = |kind: &str, joint: &str, ratio: &str| {
        let end = format!(
            "<transmission name=\"t\"><type>transmission_interface/{kind}</type><joint name=\"{joint}\"/>\
             <actuator name=\"drive\"><mechanicalReduction>{ratio}</mechanicalReduction></actuator>\
             </transmission></robot>"
        );
        import("arm.urdf", &ARM.replace("</robot>", &end), &Options::default())
    };
    let text = transmission("SimpleTransmission", "elbow", "-50").unwrap().text;
    for line in [
        "param gear_drive = -50;",
        "force elbow_dot = gear_drive*ctrl_drive - damping_elbow*elbow_dot;",
        "input tau_shoulder = 0;",
    ] {
        assert!(text.lines().any(|own| own.trim() == line), "{line}\n{text}");
    }
    assert!(!text.contains("tau_elbow"), "{text}");
    assert!(spec::parse("arm.hamel", &text).unwrap().warnings.is_empty());
    let told = transmission("DifferentialTransmission", "elbow", "2").unwrap();
    let message = "the transmission `t` is not taken: it is no SimpleTransmission";
    assert!(told.notes.iter().any(|note| note.message == message), "{:?}", told.notes);
    assert!(told.text.contains("input tau_elbow = 0;"));
    for (joint, ratio, message) in [
        ("toe", "2", "there is no joint `toe`"),
        ("elbow", "0", "the reduction is \"0\", not a number other than zero"),
    ] {
        let refused = transmission("SimpleTransmission", joint, ratio).unwrap_err().to_string();
        assert!(refused.contains(message), "{refused}");
    }
}

/// `joint` in a body of a model.
fn mujoco(head: &str, body: &str) -> String {
    format!(
        "<mujoco>{head}<worldbody><body name=\"b\">{body}<geom name=\"s\" size=\"0.1\"/></body></worldbody></mujoco>"
    )
}

#[test]
fn wrong_mujoco_models_are_refused_with_the_reason_and_the_fix() {
    let hinge = "<joint name=\"q\"/>";
    let cases = [
        ("<mujoco/>".to_owned(), "the model has no bodies", "`worldbody`"),
        (mujoco("", ""), "nothing moves", "a joint"),
        (mujoco("", "<joint type=\"helix\"/>"), "joint `b_joint` has the type `helix`", "hinge"),
        (mujoco("", "<joint class=\"c\"/>"), "there is no class `c`", "default"),
        (mujoco("", "<joint axis=\"0 0 0\"/>"), "the axis of joint `b_joint` is zero", "direction"),
        (mujoco("", "<joint limited=\"true\"/>"), "joint `b_joint` is limited, and has no interval", "range"),
        (mujoco("", &format!("{hinge}{hinge}")), "joint `q` is declared twice", "of its own"),
        (mujoco("", "<freejoint/><joint/>"), "joint `b_joint` is free, and not the one joint", "worldbody"),
        (
            mujoco("", "<joint/><geom type=\"mesh\" mesh=\"m\"/>"),
            "the geom `b_geom1` has the mass of a mesh",
            "inertial",
        ),
        (
            mujoco("", "<joint/><geom type=\"box\" size=\"1 2\"/>"),
            "the box `b_geom1` has no 3 sizes",
            "`size`",
        ),
        (mujoco("", "<joint/><composite/>"), "`composite` makes elements", "mj_saveLastXML"),
        (mujoco("", "<joint springdamper=\"1 1\"/>"), "those of an oscillator", "damping"),
        (mujoco("<compiler coordinate=\"global\"/>", hinge), "coordinates are global", "2.3.3"),
        (mujoco("<compiler eulerseq=\"xy\"/>", hinge), "`eulerseq` is \"xy\"", "xyz"),
        (mujoco("<compiler angle=\"turns\"/>", hinge), "`angle` is \"turns\"", "degree or radian"),
        (
            mujoco("<option><flag passive=\"disable\"/></option>", hinge),
            "the flag `passive`",
            "`spring` and `damper`",
        ),
        (
            mujoco("<include file=\"none.xml\"/>", hinge),
            "`none.xml`, which is included, cannot be read",
            "relative",
        ),
        (mujoco("<include file=\"itself.xml\"/>", hinge), "`itself.xml` is included twice", "once"),
        (mujoco("<include file=\"wrong.xml\"/>", hinge), "wrong.xml:2: `gravity` is \"0 0\"", "decimal"),
        (mujoco("<actuator><motor joint=\"p\"/></actuator>", hinge), "there is no joint `p`", "name a joint"),
        (
            mujoco("<equality><joint joint1=\"p\"/></equality>", hinge),
            "there is no joint `p`",
            "name a joint",
        ),
        (
            mujoco("<equality><connect body1=\"b\"/></equality>", hinge),
            "`connect` has no `anchor`",
            "in the frame of the first body",
        ),
        (
            mujoco("<equality><weld body1=\"b\" body2=\"c\"/></equality>", hinge),
            "there is no body `c`",
            "name a body",
        ),
        (
            mujoco("<equality><connect site1=\"s\" site2=\"d\"/></equality>", hinge),
            "there is no site `s`",
            "name a site",
        ),
        (
            mujoco(
                "<worldbody><site name=\"d\"/></worldbody><equality><connect site1=\"s\" site2=\"d\"/></equality>",
                "<joint name=\"q\"/><site name=\"s\" pos=\"1 0 0.5\"/>",
            ),
            "the ends of the equation `s_d` are 0.5 m apart along axis 3",
            "move one of the two sites",
        ),
        (mujoco("", "<joint/><frame><joint/></frame>"), "`joint` stands in a `frame`", "into the body"),
        (
            mujoco("", "<joint/><body euler=\"1 2 3\" quat=\"1 0 0 0\"/>"),
            "a rotation is said by",
            "leave one",
        ),
        (mujoco("", "<joint/><body quat=\"0 0 0 0\"/>"), "`quat` has no direction", "direction"),
    ];
    for (text, message, help) in cases {
        let refused = import_with("robot.xml", &text, &Options::default(), &files).expect_err(message);
        let shown = refused.render(false);
        assert!(shown.contains(message) && shown.contains(help), "{message}, {help}:\n{shown}");
        assert!(refused.iter().all(|problem| problem.span.is_some()), "{shown}");
    }
    let refused = import("robot.xml", FLOCK, &floating()).expect_err("floating").to_string();
    assert!(refused.contains("the root is the ground"), "{refused}");
}

/// A class of one kind of motor says nothing to motors of another kind; gears and `general` are of all.
///
/// # Source
/// `actuator_gainprm` and `actuator_biasprm` of MuJoCo 4.0.0 for these files.
#[test]
fn classes_of_motors_are_by_their_kind() {
    let servo = "<position kp=\"7\" kv=\"2\" gear=\"3\"/>";
    let cases = [
        (servo, "<velocity joint=\"q\"/>", "kv_q*(ctrl_q - gear_q*q_dot)", "kv_q = 1;"),
        (servo, "<velocity joint=\"q\" kv=\"5\"/>", "kv_q*(ctrl_q - gear_q*q_dot)", "kv_q = 5;"),
        (servo, "<position joint=\"q\" kp=\"5\"/>", "- kv_q*gear_q*q_dot)", "kv_q = 2;"),
        (servo, "<general joint=\"q\"/>", "- kv_q*gear_q*q_dot)", "kp_q = 7;"),
        (servo, "<motor joint=\"q\"/>", "force q_dot = gear_q*ctrl_q;", "gear_q = 3;"),
        ("<velocity kv=\"3\"/>", "<position joint=\"q\" kp=\"5\"/>", "kp_q*(ctrl_q - q);", "kp_q = 5;"),
        ("<general gainprm=\"4\"/>", "<velocity joint=\"q\"/>", "kv_q*(ctrl_q - q_dot);", "kv_q = 4;"),
        (
            "<general gainprm=\"4\"/><default class=\"a\"><position kp=\"7\"/></default>",
            "<velocity joint=\"q\" class=\"a\"/>",
            "kv_q*(ctrl_q - q_dot);",
            "kv_q = 4;",
        ),
        // Where the last element is of another kind, the nearest class around that ends with its own kind counts.
        ("<velocity kv=\"3\"/><motor/>", "<velocity joint=\"q\"/>", "kv_q*(ctrl_q - q_dot);", "kv_q = 1;"),
        ("<velocity kv=\"3\"/><position/>", "<velocity joint=\"q\"/>", "kv_q*(ctrl_q - q_dot);", "kv_q = 1;"),
        (
            "<position kp=\"5\" kv=\"2\"/><default class=\"a\"><velocity kv=\"7\"/></default>",
            "<position joint=\"q\" class=\"a\"/>",
            "kp_q*(ctrl_q - q) - kv_q*q_dot;",
            "kv_q = 2;",
        ),
        (
            "<motor/><general gainprm=\"7\"/><position kp=\"5\"/>",
            "<velocity joint=\"q\"/>",
            "kv_q*(ctrl_q - q_dot);",
            "kv_q = 1;",
        ),
    ];
    // The damping of a servo above zero is a part of the critical one.
    let ratio =
        "<default><general biasprm=\"0 0 0.5\"/></default><actuator><position joint=\"q\"/></actuator>";
    let told = imported(&mujoco(ratio, "<joint name=\"q\"/>"), &Options::default());
    assert!(
        told.notes.iter().any(|note| note.message.ends_with("its damping is by a ratio")),
        "{}",
        told.text
    );
    for (class, motor, force, value) in cases {
        let head = format!("<default>{class}</default><actuator>{motor}</actuator>");
        let text = imported(&mujoco(&head, "<joint name=\"q\"/>"), &Options::default()).text;
        assert!(text.contains(force) && text.contains(value), "{class} {motor}:\n{text}");
    }
}

/// What a model of MuJoCo has and hamel has not is told with the fix, by name.
#[test]
fn forces_and_equations_that_are_not_taken_are_told_by_name() {
    let text = mujoco(
        "<tendon><fixed name=\"cord\"><joint joint=\"q\" coef=\"1\"/></fixed></tendon>\
         <equality><tendon name=\"pull\" tendon1=\"cord\"/></equality>\
         <actuator><muscle name=\"flexor\" joint=\"q\"/><motor name=\"puller\" tendon=\"cord\"/></actuator>",
        "<joint name=\"q\"/>",
    );
    let notes = imported(&text, &Options::default()).notes;
    for told in [
        "the tendon `cord` is not taken",
        "the equation `pull`, a tendon, is not taken; it joins cord",
        "the muscle `flexor` is not taken: it is a `muscle`",
        "the motor `puller` is not taken: it acts on no joint",
    ] {
        let found = notes.iter().find(|note| note.message == told);
        assert!(found.is_some_and(|note| note.help.is_some() && note.span.is_some()), "{told}: {notes:?}");
    }
}

/// Whatever a file says in one place is seen in the rates.
#[test]
fn planted_faults_are_found() {
    let faults = [
        ("a mass behind two fixed joints", r#"<mass value="0.4"/>"#, r#"<mass value="0.401"/>"#),
        ("the angle of a fixed joint", r#"rpy="0 0.7 0""#, r#"rpy="0 0.71 0""#),
        ("the offset of a follower", r#"offset="0.25""#, r#"offset="0.26""#),
    ];
    for (what, right, wrong) in faults {
        assert_eq!(ARM.matches(right).count(), 1, "{what}");
        let found = difference(&ARM.replace(right, wrong), &Options::default(), REFERENCE, "arm");
        assert!(found > 1e6 * TOLERANCE, "{what}: {found:e}");
    }
}

#[test]
fn a_model_keeps_names_and_digits_and_tells_the_rest() {
    let imported = import("robots/arm.urdf", ARM, &Options::default()).unwrap();
    assert_eq!(imported.name, "arm");
    let text = &imported.text;
    for line in [
        "coordinate shoulder in (-2, 2.5);",
        "param mass_forearm = 1.5e0 where mass_forearm > 0;",
        "param cz_forearm = -0.05;",
        "let thumb = -5*slide + 0.25;",
        "initial slide = (0.01 + 0.08)/2;",
        "let E_upper_arm = transpose(rot(e1, pi/2)*rot(unit([0, 0.7, -0.4]), shoulder));",
        "// `effort` of `limit` is not taken, 3 times",
    ] {
        assert!(text.lines().any(|own| own.trim() == line), "{line}\n{text}");
    }
    assert_eq!(spec::format("arm.hamel", text).unwrap(), *text);
    let notes: Vec<String> = imported.notes.lines().collect();
    assert_eq!(notes.len(), 3, "{notes:?}");
    assert!(
        notes[0].contains("the limits of joint `thumb`, which follows another one, are not taken"),
        "{notes:?}"
    );
    assert!(notes[0].starts_with("robots/arm.urdf:"), "{notes:?}");
}

#[test]
fn limits_are_intervals_springs_or_nothing() {
    let with = |limits| {
        let mut options = Options::default();
        options.limits = limits;
        import("arm.urdf", ARM, &options).unwrap().text
    };
    let spring = with(Limits::Spring);
    assert!(spring.contains("coordinate shoulder in angle;") && spring.contains("param limit_stiffness"));
    assert!(spec::parse("arm.hamel", &spring).unwrap().warnings.is_empty());
    let none = with(Limits::None);
    assert!(none.contains("coordinate slide in real;") && !none.contains("limit_stiffness"));
}

#[test]
fn a_locked_joint_has_no_coordinate() {
    let mut options = Options::default();
    options.locked = vec!["thumb".to_owned()];
    let imported = import("arm.urdf", ARM, &options).unwrap();
    assert!(!imported.text.contains("let thumb ="));
    assert!(imported.notes.iter().any(|note| note.message == "joint `thumb` is locked at zero"));
    options.locked = vec!["toe".to_owned()];
    let refused = import("arm.urdf", ARM, &options).unwrap_err().to_string();
    assert!(refused.contains("there is no joint `toe` to lock"), "{refused}");
}

/// A link with mass on a link without, by the joint that `joint` says.
fn two(joint: &str) -> String {
    format!(
        "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" \
         iyy=\"1\" izz=\"1\"/></inertial></link>{joint}</robot>"
    )
}

/// `<joint ..>` from `a` to `b`.
fn joint(attributes: &str, items: &str) -> String {
    two(&format!("<joint {attributes}><parent link=\"a\"/><child link=\"b\"/>{items}</joint>"))
}

#[test]
fn wrong_files_are_refused_with_the_reason_and_the_fix() {
    let hinge = "name=\"q\" type=\"continuous\"";
    let massless = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><joint name=\"q\" type=\"continuous\">\
         <parent link=\"a\"/><child link=\"b\"/></joint></robot>";
    let cases = [
        ("<robot".to_owned(), "the file is no XML", "correct it"),
        ("<model/>".to_owned(), "`model` is not the root", "MJCF"),
        (
            "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:include filename=\"a\"/></robot>"
                .to_owned(),
            "the file has macros of xacro",
            "xacro robot.urdf > ",
        ),
        ("<robot name=\"r\"/>".to_owned(), "the robot has no links", "`link`"),
        (massless.to_owned(), "joint `q` moves links without mass and inertia", "--lock q"),
        (joint(hinge, "<axis xyz=\"0 0\"/>"), "`xyz` is \"0 0\", not 3 numbers", "decimal"),
        (joint(hinge, "<axis xyz=\"0 0 nan\"/>"), "`xyz` is \"0 0 nan\", not 3 numbers", "decimal"),
        (joint(hinge, "<axis xyz=\"0 0 0\"/>"), "the axis of joint `q` is zero", "direction"),
        (joint("name=\"q\" type=\"ball\"", ""), "joint `q` has the type `ball`", "revolute"),
        (
            joint("name=\"q\" type=\"ball\"", "").replace(
                "</robot>",
                "<transmission><type>SimpleTransmission</type><joint name=\"q\"/><actuator name=\"m\"/></transmission></robot>",
            ),
            "joint `q` has the type `ball`",
            "revolute",
        ),
        (joint("name=\"q\" type=\"planar\"", "<axis xyz=\"0 1 1\"/>"), "the plane of joint `q`", "`0 0 1`"),
        (joint("name=\"q\" type=\"fixed\"", ""), "nothing moves", "--floating"),
        (joint("name=\"q\"", ""), "`joint` has no `type`", "type=\"..\""),
        (joint(hinge, "<mimic joint=\"p\"/>"), "there is no joint `p`", "name a joint"),
        (joint(hinge, "<mimic joint=\"q\"/>"), "joint `q` follows joints in a circle", "follows none"),
        (two(""), "links `a` and `b` are joined to no parent", "fixed joint"),
        (
            two("<joint name=\"q\" type=\"continuous\"><parent link=\"a\"/><child link=\"c\"/></joint>"),
            "there is no link `c`",
            "name a link",
        ),
        (
            two("<joint name=\"q\" type=\"continuous\"><parent link=\"b\"/><child link=\"b\"/></joint>"),
            "joint `q` is in a circle of links",
            "join all links",
        ),
        (
            joint(hinge, "").replace(
                "</robot>",
                "<joint name=\"p\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint></robot>",
            ),
            "link `b` is the child of two joints",
            "cut it",
        ),
        (joint(hinge, "").replace("\"b\"><in", "\"a\"><in"), "link `a` is declared twice", "of its own"),
        (joint(hinge, "").replace("mass value=\"1\"", "mass value=\"-1\""), "the mass is negative", "kg"),
    ];
    for (text, message, help) in cases {
        let refused = import("robot.urdf", &text, &Options::default()).expect_err(message);
        let shown = refused.render(false);
        assert!(shown.contains(message) && shown.contains(help), "{message}, {help}:\n{shown}");
        assert!(refused.iter().all(|problem| problem.span.is_some()), "{shown}");
    }
}

/// What XML allows as a name reaches neither the language nor the end of a comment.
#[test]
fn names_and_comments_stay_in_their_place() {
    let text = joint("name=\"q&#10;} model\" type=\"continuous\"", "").replace("\"r\"", "\"pi&#10;*/ 1\"");
    let imported = import("ro\nbot.urdf", &text, &Options::default()).unwrap();
    assert_eq!(imported.name, "pi____1");
    let model = spec::parse("r.hamel", &imported.text).unwrap_or_else(|e| panic!("{e}\n{}", imported.text));
    assert!(model.warnings.is_empty());
}

/// Programs that turn frames write what their sines leave of zero. It is told, and smaller than any direction that
/// somebody means.
#[test]
fn what_rounding_left_of_zero_is_zero() {
    let exact = import("arm.urdf", ARM, &Options::default()).unwrap();
    let noisy = ARM.replacen("<axis xyz=\"0 0 -1\"/>", "<axis xyz=\"6.12323e-17 0 -1\"/>", 1);
    let noisy = noisy.replacen("rpy=\"0 0 0.5\"", "rpy=\"-1.2e-16 0 0.5\"", 1);
    assert_ne!(noisy, ARM);
    let found = import("arm.urdf", &noisy, &Options::default()).unwrap();
    let items = |text: &str| -> Vec<String> {
        text.lines().filter(|line| !line.trim().starts_with("//")).map(str::to_owned).collect()
    };
    assert_eq!(items(&found.text), items(&exact.text));
    let notes: Vec<String> = found.notes.lines().collect();
    let has = |text: &str| notes.iter().any(|note| note.contains(text));
    assert!(has("the axis [6.12323e-17, 0, -1] of joint") && has("is taken as [0, 0, -1]"), "{notes:?}");
    assert!(has("the angle -1.2e-16 is taken as 0"), "{notes:?}");
    // A small lean is one.
    let leaning = noisy.replace("6.12323e-17", "1e-9");
    let found = import("arm.urdf", &leaning, &Options::default()).unwrap();
    assert!(found.text.contains("unit([1e-9, 0, -1])"), "{}", found.text);
}
