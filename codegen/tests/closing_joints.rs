//! Joints of Gazebo that close loops: the same mechanism cut at one joint and at another one moves alike.
//!
//! Deliberately does not know: how an equation of a joint is written.

use std::collections::BTreeMap;

use hamel_codegen::import::{Options, import};
use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;

/// Without forces, as the format understands them: a joint that has them keeps its coordinate.
const DYNAMICS: &str = "<dynamics><damping>0</damping></dynamics>";

fn link(name: &str, pose: &str) -> String {
    format!(
        "<link name=\"{name}\"><pose>{pose}</pose><inertial><pose>0.1 0.05 -0.12 0.1 0.2 0.3</pose><mass>1.3</mass>\
         <inertia><ixx>0.03</ixx><iyy>0.025</iyy><izz>0.02</izz><ixy>0.001</ixy></inertia></inertial></link>"
    )
}

/// A joint at a place in its child; `axes` by their directions, with dynamics where it keeps its coordinates.
fn joint(
    name: &str,
    kind: &str,
    (parent, child): (&str, &str),
    pose: &str,
    axes: &[&str],
    keeps: bool,
) -> String {
    let dynamics = if keeps { DYNAMICS } else { "" };
    let axes = axes.iter().enumerate().map(|(k, xyz)| {
        let tag = if k == 0 { "axis" } else { "axis2" };
        format!("<{tag}><xyz>{xyz}</xyz>{dynamics}</{tag}>")
    });
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><pose>{pose}</pose><parent>{parent}</parent><child>{child}</child>{}\
         </joint>",
        axes.collect::<String>()
    )
}

/// An arm on a hinge, a rod on it by a ball joint, and a third body that a joint of the world and one of the rod hold.
fn mechanism(world: (&str, &[&str]), rod: (&str, &[&str]), closes: &str) -> String {
    let links = [("arm", "0 0 1 0 0 0"), ("rod", "0.4 0 1.1 0.1 0 0"), ("third", "0.7 0.3 1 0 0.2 0.4")];
    let links: String = links.iter().map(|(name, pose)| link(name, pose)).collect();
    let joints = [
        joint("swing", "revolute", ("world", "arm"), "0 0 0 0 0 0", &["0 1 0"], true),
        joint("socket", "ball", ("arm", "rod"), "0 0 0 0 0 0", &[], false),
        joint("ground", world.0, ("world", "third"), "0.1 0.2 0 0.2 0 0", world.1, closes != "ground"),
        joint("tip", rod.0, ("rod", "third"), "-0.1 -0.1 0.1 0 0.3 0", rod.1, closes != "tip"),
    ];
    format!("<sdf version=\"1.9\"><model name=\"m\">{links}{}</model></sdf>", joints.concat())
}

/// The angle of the arm and its rate after three tenths of a second from rest.
fn fallen(text: &str, closes: &str, n_steps: usize) -> [f64; 2] {
    let imported = import("m.sdf", text, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
    let told = format!("joint `{closes}` closes a loop");
    assert!(imported.notes.iter().any(|note| note.message.starts_with(&told)), "{}", imported.notes);
    let body = imported.text.trim_end().strip_suffix('}').expect("a model");
    let text = format!("{body} scene bare {{ want rhs; }} }}\n");
    let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let built = scene::build(&model, "bare").unwrap_or_else(|e| panic!("{e}\n{text}"));
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let prepared = built.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let names = built.state_names();
    let start = scene::initial_values(&model, &BTreeMap::new());
    let mut y: Vec<f64> = names.iter().map(|name| start.get(name).copied().unwrap_or(0.0)).collect();
    let rates = |y: &[f64]| {
        let mut dy = vec![0.0; y.len()];
        prepared.rhs(0.0, y, &mut dy);
        dy
    };
    let moved =
        |y: &[f64], k: &[f64], h: f64| -> Vec<f64> { y.iter().zip(k).map(|(y, k)| y + h * k).collect() };
    let step = 0.3 / n_steps as f64;
    for _ in 0..n_steps {
        let k1 = rates(&y);
        let k2 = rates(&moved(&y, &k1, step / 2.0));
        let k3 = rates(&moved(&y, &k2, step / 2.0));
        let k4 = rates(&moved(&y, &k3, step));
        let sum = (0..y.len()).map(|i| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0);
        y = moved(&y, &sum.collect::<Vec<f64>>(), step);
    }
    ["swing", "swing_dot"]
        .map(|name| y[names.iter().position(|own| own == name).unwrap_or_else(|| panic!("{names:?}"))])
}

fn alike(world: (&str, &[&str]), rod: (&str, &[&str]), n_steps: usize) {
    let [found, expected] =
        ["tip", "ground"].map(|closes| fallen(&mechanism(world, rod, closes), closes, n_steps));
    assert!(expected[0].abs() > 0.02, "{expected:?}");
    for (a, b) in found.iter().zip(expected) {
        // The slide is next to a position where it is singular: steps four times as long leave 1e-7 there.
        assert!((a - b).abs() < 1e-8, "{world:?} {rod:?}: {found:?}, {expected:?}");
    }
}

#[test]
fn a_universal_joint_may_close_a_loop() {
    alike(("revolute", &["0 1 1"]), ("universal", &["1 0 0", "0 0 1"]), 300);
    alike(("revolute", &["0 1 1"]), ("revolute2", &["1 0 1", "0 1 0.2"]), 300);
}

/// Another axis of the joint that closes the loop moves the mechanism otherwise.
#[test]
fn a_closing_joint_has_its_axes() {
    let moved =
        |rod: (&str, &[&str]), world: (&str, &[&str])| fallen(&mechanism(world, rod, "tip"), "tip", 100)[0];
    let hinge: (&str, &[&str]) = ("revolute", &["0 1 1"]);
    let apart =
        moved(("universal", &["1 0 0", "0 0 1"]), hinge) - moved(("universal", &["1 0 0", "0 1 1"]), hinge);
    assert!(apart.abs() > 1e-4, "{apart}");
    let cross: (&str, &[&str]) = ("universal", &["0 1 1", "1 0 0"]);
    let apart = moved(("prismatic", &["0 0 1"]), cross) - moved(("prismatic", &["0 0.1 1"]), cross);
    assert!(apart.abs() > 1e-4, "{apart}");
}

#[test]
fn a_slide_may_close_a_loop() {
    alike(("universal", &["0 1 1", "1 0 0"]), ("prismatic", &["0 0 1"]), 1200);
    alike(("universal", &["0 1 1", "1 0 0"]), ("prismatic", &["1 2 0.5"]), 1200);
}
