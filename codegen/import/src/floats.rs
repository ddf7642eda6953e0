//! Free motions: velocities, the vertical and the height of links that no joint holds. Where a loop needs to know where
//! the link is, attitude and place are coordinates; elsewhere they are reconstructed.
//!
//! Deliberately does not know: XML, joints with coordinates, energies.

use std::fmt::Write as _;

use crate::names::Names;
use crate::options::Options;
use crate::places;
use crate::robot::{JointKind, Pose, Robot};
use crate::vertical::Vertical;

/// Names of one free motion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Free {
    pub(crate) spin: String,
    pub(crate) velocity: String,
    pub(crate) up: String,
    pub(crate) height: String,
    attitude: String,
    place: String,
    /// Whether attitude and place are coordinates that equations may contain.
    is_placed: bool,
}

/// All free motions of a robot.
#[derive(Clone, Debug)]
pub(crate) struct Floats {
    /// Places of floating joints among the joints.
    pub(crate) joints: Vec<usize>,
    /// Links that move freely, and their names.
    links: Vec<(usize, Free)>,
    is_declared: bool,
    /// Whether the velocities of these motions are all that the group has.
    are_all: bool,
}

const AROUND: [&str; 35] = [
    "Omega*",
    "Omega*1",
    "Omega*2",
    "Omega*3",
    "V*",
    "V*1",
    "V*2",
    "V*3",
    "up*",
    "up*1",
    "up*2",
    "up*3",
    "vertical*",
    "vertical*1",
    "vertical*2",
    "vertical*3",
    "height*",
    "attitude*",
    "attitude*w",
    "attitude*x",
    "attitude*y",
    "attitude*z",
    "attitude*11",
    "attitude*12",
    "attitude*13",
    "attitude*21",
    "attitude*22",
    "attitude*23",
    "attitude*31",
    "attitude*32",
    "attitude*33",
    "position*",
    "position*1",
    "position*2",
    "position*3",
];

impl Free {
    /// Names with an ending.
    fn new(ending: &str) -> Free {
        let named = |name: &str| format!("{name}{ending}");
        Free {
            spin: named("Omega"),
            velocity: named("V"),
            // `up_` and a name is that of a link.
            up: named(if ending.is_empty() { "up" } else { "vertical" }),
            height: named("height"),
            attitude: named("attitude"),
            place: named("position"),
            is_placed: false,
        }
    }
}

impl Free {
    /// The names of the place and the attitude in space.
    pub(crate) fn pose(&self) -> (&str, &str) {
        (&self.place, &self.attitude)
    }
}

impl Floats {
    /// Finds the links that move freely. The names without an ending are taken in any case: they are said in the book.
    pub(crate) fn reserve(robot: &Robot, options: &Options, names: &mut Names) -> Floats {
        names.reserve(AROUND.iter().map(|pattern| pattern.replace('*', "")));
        let joints: Vec<usize> = (0..robot.joints.len())
            .filter(|k| matches!(robot.joints[*k].kind, JointKind::Floating))
            .collect();
        let mut links: Vec<usize> = joints.iter().map(|k| robot.joints[*k].child).collect();
        if options.floating {
            links.insert(0, robot.root);
        }
        let closed: Vec<usize> = robot.loops.iter().flat_map(|k| robot.around(k)).flatten().collect();
        let free = |link: usize| {
            let is_placed = joints.iter().any(|k| robot.joints[*k].child == link && closed.contains(k));
            (link, Free { is_placed, ..Free::new("") })
        };
        let links: Vec<_> = links.into_iter().map(free).collect();
        let has_balls = robot.joints.iter().any(|joint| matches!(joint.kind, JointKind::Ball));
        let are_all = links.len() < 2 && !has_balls;
        Floats { joints, links, is_declared: false, are_all }
    }

    /// Several free motions have the names of their links.
    pub(crate) fn name(&mut self, links: &[String], names: &mut Names) {
        if self.links.len() < 2 {
            return;
        }
        for (link, free) in &mut self.links {
            let own = AROUND.iter().filter(|pattern| !pattern.starts_with("up"));
            let patterns: Vec<String> = own.map(|pattern| pattern.replace('*', "_*")).collect();
            let patterns: Vec<&str> = patterns.iter().map(String::as_str).collect();
            let ending = format!("_{}", names.take(&links[*link], &patterns));
            *free = Free { is_placed: free.is_placed, ..Free::new(&ending) };
        }
    }

    /// The names of a link that moves freely.
    pub(crate) fn of(&self, link: usize) -> Free {
        let found = self.links.iter().find(|(own, _)| *own == link);
        found.map_or_else(|| Free::new(""), |(_, free)| free.clone())
    }

    /// The items that declare the motion of a link. It starts in the last of some frames, each in the one before it.
    pub(crate) fn items(
        &mut self,
        link: usize,
        file_name: &str,
        vertical: Option<&Vertical>,
        start: &[Pose],
    ) -> String {
        let free = self.of(link);
        let Free { spin, velocity, .. } = &free;
        let mut out = format!("// {file_name}, which moves freely.\n");
        match self.links.len() {
            0 | 1 => {
                _ = writeln!(
                    out,
                    "/// Angular velocity of {file_name} in rad/s and velocity of its origin in m/s, in its frame.\n\
                     velocity {spin}, {velocity} in se(3);"
                );
            }
            _ if !self.is_declared => {
                let pairs: Vec<String> =
                    self.links.iter().map(|(_, free)| format!("{}, {}", free.spin, free.velocity)).collect();
                let factors = vec!["se(3)"; pairs.len()].join(", ");
                _ = writeln!(
                    out,
                    "/// Angular velocities in rad/s and velocities of origins in m/s, each in its own frame.\n\
                     velocity {} in product({factors});",
                    pairs.join(", ")
                );
            }
            _ => {}
        }
        self.is_declared = true;
        out.push_str(&match free.is_placed {
            true => free.coordinates(file_name, vertical, start),
            false => free.reconstructed(file_name, vertical, start, self.are_all),
        });
        out
    }
}

impl Free {
    /// Attitude and place as coordinates, and the vertical by them.
    fn coordinates(&self, file_name: &str, vertical: Option<&Vertical>, start: &[Pose]) -> String {
        let Free { spin, velocity, up, height, attitude, place, is_placed: _ } = self;
        let mut out = format!(
            "/// Attitude and place of {file_name}.\n\
             configuration {attitude}, {place} in SE(3) from {spin}, {velocity};\n"
        );
        if let Some(turn) = places::turn_of(start) {
            _ = writeln!(out, "initial {attitude} = {turn};");
        }
        let at = places::origin_of(start);
        if !at.is_empty() {
            _ = writeln!(out, "initial {place} = {};", places::sum(&at));
        }
        if let Some(vertical) = vertical {
            _ = writeln!(
                out,
                "let {up} = transpose({attitude})*{0};\nlet {height} = dot({0}, {place});",
                vertical.up
            );
        }
        out
    }

    /// The vertical and the height as parameters that the motion moves; attitude and place as coordinates of the group.
    fn reconstructed(
        &self,
        file_name: &str,
        vertical: Option<&Vertical>,
        start: &[Pose],
        is_all: bool,
    ) -> String {
        let Free { spin, velocity, up, height, attitude, place, is_placed: _ } = self;
        let mut out = String::new();
        let (turn, at) = (places::turn_of(start), places::origin_of(start));
        if let Some(vertical) = vertical {
            let initial = match &turn {
                Some(turn) => format!("transpose({turn})*{}", vertical.up),
                None => vertical.up.clone(),
            };
            _ = writeln!(
                out,
                "/// The vertical, upwards, in the frame of {file_name}.\n\
                 advected {up} in R^3 by cross({spin}, {up});\n\
                 /// Height of the origin of {file_name} in m.\n\
                 advected {height} in R by -dot({velocity}, {up});\n\
                 initial {up} = {initial};"
            );
            if !at.is_empty() {
                _ = writeln!(out, "initial {height} = dot({}, {});", vertical.up, places::sum(&at));
            }
        }
        _ = writeln!(
            out,
            "/// Attitude and place of {file_name}.\n\
             reconstruct {attitude}, {place} in SE(3){};",
            if is_all { String::new() } else { format!(" from {spin}, {velocity}") }
        );
        if let Some(quaternion) = places::quaternion(start.iter().flat_map(|pose| &pose.turn.factors)) {
            _ = writeln!(out, "initial {attitude} = {quaternion};");
        }
        if !at.is_empty() {
            _ = writeln!(out, "initial {place} = {};", places::sum(&at));
        }
        out
    }
}
