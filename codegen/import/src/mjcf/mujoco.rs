//! The element `mujoco`, from its settings to its equations.
//!
//! Deliberately does not know: the model language.

use super::actuators::motors;
use super::bodies::Bodies;
use super::equalities::equalities;
use super::settings::Settings;
use crate::robot::Robot;
use crate::xml::{Element, Reader, head, place};

/// Reads the element `mujoco`. Nothing after a problem.
pub(crate) fn read<'a>(reader: &Reader<'a>, root: Element<'a>, file_stem: &str) -> Option<Robot> {
    let name = reader.attribute(root, "model").map(str::to_owned).unwrap_or_else(|| {
        reader.note(&head(root), "the model has no name, and that of the file");
        file_stem.to_owned()
    });
    let settings = Settings::read(reader, root);
    let mut bodies = Bodies::read(&settings, root);
    if bodies.links.len() < 2 && reader.is_fine() {
        reader.error(&head(root), "the model has no bodies", "a model has `body` in its `worldbody`");
    }
    if bodies.links.len() < 2 {
        return None;
    }
    let loops = equalities(&settings, root, &mut bodies);
    let motors = motors(&settings, root, &bodies.joints, &bodies.joint_by_name);
    for element in reader.children(root, "tendon").into_iter().flat_map(|section| reader.all(section)) {
        reader.take(element);
        let name = reader.attribute(element, "name").unwrap_or("without a name");
        let help = "write its springs as terms of the Lagrangian, its dampers as forces";
        reader.note_with_help(&place(element, "name"), format!("the tendon `{name}` is not taken"), help);
        reader.skip(element);
    }
    let mut robot = bodies.finish(name);
    robot.motors = motors;
    robot.loops = loops;
    Some(robot)
}
