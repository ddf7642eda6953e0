//! The order of links from the root on, and everything that keeps links from being a tree.
//!
//! Deliberately does not know: XML, the model language.

use crate::problems::Problems;
use crate::robot::{Joint, JointKind, Robot};

/// More links are more than equations can be derived for, and more than calls can go deep.
const MAX_LINKS: usize = 1000;

/// Finds the root, puts each joint behind the joint of its parent, and checks followers. After a problem nothing is
/// done.
pub(crate) fn order(robot: &mut Robot, problems: &mut Problems) {
    let n = robot.links.len();
    if n > MAX_LINKS {
        let message = format!("the robot has {n} links");
        problems.error(&robot.links[MAX_LINKS].span, message, &format!("write {MAX_LINKS} links at most"));
        return;
    }
    let mut joint_of: Vec<Option<usize>> = vec![None; n];
    for (k, joint) in robot.joints.iter().enumerate() {
        if joint_of[joint.child].replace(k).is_some() {
            let message = format!("link `{}` is the child of two joints", robot.links[joint.child].name);
            problems.error(
                &joint.span,
                message,
                "a closed loop has no form in this format: cut it at a joint",
            );
        }
    }
    let roots: Vec<usize> = (0..n).filter(|k| joint_of[*k].is_none()).collect();
    let Some(&root) = roots.first() else {
        let message = "the links are joined in a circle";
        problems.error(&robot.links[0].span, message, "one link has to be the child of no joint");
        return;
    };
    for other in &roots[1..] {
        let message = format!(
            "links `{}` and `{}` are joined to no parent",
            robot.links[root].name, robot.links[*other].name
        );
        problems.error(
            &robot.links[*other].span,
            message,
            "join all links but one to a parent, by a fixed joint if need be",
        );
    }
    let mut ordered = Vec::new();
    let mut open = vec![root];
    while let Some(link) = open.pop() {
        if joint_of[link].is_some() {
            ordered.extend(joint_of[link]);
        }
        let children = robot.joints.iter().rev().filter(|joint| joint.parent == link && joint.child != link);
        open.extend(children.map(|joint| joint.child));
        if ordered.len() > robot.joints.len() {
            break;
        }
    }
    if !problems.errors.is_empty() {
        return;
    }
    if ordered.len() < robot.joints.len() {
        let lost = (0..robot.joints.len()).find(|k| !ordered.contains(k)).unwrap_or(0);
        let message = format!(
            "joint `{}` is in a circle of links that is not joined to the others",
            robot.joints[lost].name
        );
        problems.error(&robot.joints[lost].span, message, "join all links but one to a parent");
        return;
    }
    let mut place = vec![0; ordered.len()];
    for (new, old) in ordered.iter().enumerate() {
        place[*old] = new;
    }
    let mut joints: Vec<_> = ordered.iter().map(|k| robot.joints[*k].clone()).collect();
    for joint in &mut joints {
        if let Some(mimic) = &mut joint.mimic {
            mimic.joint = place[mimic.joint];
        }
    }
    robot.root = root;
    robot.joints = joints;
    for motor in &mut robot.motors {
        motor.joint = place[motor.joint];
    }
    followers(robot, problems);
}

/// A follower without a coordinate follows nothing; followers in a circle, and of joints with several coordinates, are
/// problems.
fn followers(robot: &mut Robot, problems: &mut Problems) {
    let n = robot.joints.len();
    let is_fixed = |joint: &Joint| matches!(joint.kind, JointKind::Fixed);
    let has_one = |joint: &Joint| matches!(joint.kind, JointKind::Revolute(_) | JointKind::Prismatic(_));
    for k in 0..n {
        let joint = &robot.joints[k];
        let Some(mimic) = &joint.mimic else { continue };
        if is_fixed(joint) {
            problems.note(&joint.span, format!("joint `{}` is fixed, and follows no other", joint.name));
            robot.joints[k].mimic = None;
            continue;
        }
        let leader = &robot.joints[mimic.joint];
        if !has_one(joint) || !(has_one(leader) || is_fixed(leader)) {
            let message = format!("joint `{}` cannot follow `{}`", joint.name, leader.name);
            problems.error(&joint.span, message, "both joints need one coordinate, revolute or prismatic");
        }
    }
    for k in 0..n {
        let mut last = k;
        // A chain of followers that has not ended after all joints is a circle.
        for _ in 0..n {
            last = robot.joints[last].mimic.as_ref().map_or(last, |mimic| mimic.joint);
        }
        if robot.joints[last].mimic.is_some() {
            let joint = &robot.joints[k];
            let message = format!("joint `{}` follows joints in a circle", joint.name);
            problems.error(&joint.span, message, "let it follow a joint that follows none");
        }
    }
}
