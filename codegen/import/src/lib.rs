//! Descriptions of robots as models: a text that anybody can read, and that the one parser of models reads.
//!
//! [`import`] reads the Unified Robot Description Format (URDF), and the formats of MuJoCo (MJCF) and Gazebo (SDF).
//! Links and joints keep their names, and numbers their digits. What a file has beside its mechanics is listed, in
//! [`Imported::notes`] and at the head of the text.
//!
//! ```
//! let text = r#"<robot name="pendulum">
//!   <link name="wall"/>
//!   <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1.2"/></inertial></link>
//!   <joint name="hinge" type="continuous">
//!     <parent link="wall"/><child link="rod"/><axis xyz="0 1 0"/>
//!   </joint>
//! </robot>"#;
//! let imported = hamel_import::import("pendulum.urdf", text, &hamel_import::Options::default())?;
//! assert!(imported.text.contains("coordinate hinge in angle;"));
//! # Ok::<(), hamel_lang::spec::Diagnostics>(())
//! ```
//!
//! Deliberately does not know: equations of motion.

mod axis;
mod floats;
mod joints;
mod loops;
mod mjcf;
mod names;
mod number;
mod options;
mod parameters;
mod places;
mod problems;
mod robot;
mod rotation;
mod sdf;
mod solid;
mod tree;
mod urdf;
mod vertical;
mod write;
mod xml;

pub use options::{Limits, Options};

use std::io;
use std::path::Path;

use hamel_lang::spec::{Diagnostic, Diagnostics, Span};

use crate::mjcf::{Source, splice};

/// A model made from a file.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Imported {
    /// The name of the model.
    pub name: String,
    /// The text of the model.
    pub text: String,
    /// Contents of the file that the model lacks, or has otherwise.
    pub notes: Diagnostics,
}

/// Writes the model of a robot. `file` is the name of the file, for messages; it includes no others.
///
/// # Errors
/// Every problem of the file, with its place: XML that does not parse, a format that is not known, links that are no
/// tree, joints that move nothing.
pub fn import(file: &str, text: &str, options: &Options) -> Result<Imported, Diagnostics> {
    import_with(file, text, options, &|_| Err(io::Error::from(io::ErrorKind::NotFound)))
}

/// The text of a file that another one includes, whose names are relative to the folder of that. For [`import_with`].
pub fn beside(path: &Path) -> impl Fn(&str) -> io::Result<String> + use<> {
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    move |name| std::fs::read_to_string(folder.join(name))
}

/// As [`import`], with the texts of the files that the file includes.
///
/// # Errors
/// As [`import`]; a file that cannot be read, or is included twice.
pub fn import_with(
    file: &str,
    text: &str,
    options: &Options,
    files: &dyn Fn(&str) -> io::Result<String>,
) -> Result<Imported, Diagnostics> {
    let single = Source::of(file, text);
    let is_mujoco = parsed(&single)?.root_element().tag_name().name() == "mujoco";
    let source = if is_mujoco { splice(file, text, files)? } else { single };
    let document = parsed(&source)?;
    let reader = xml::Reader::new();
    let robot = robot(&reader, &document, &source, file);
    let robot = robot?;
    let mut problems = reader.finish(&document);
    let Some(mut robot) = robot.filter(|_| problems.errors.is_empty()) else {
        return Err(source.diagnostics(problems.errors));
    };
    lock(&mut robot, options, &mut problems);
    // Names go into comments, which a line ends.
    for name in
        robot.links.iter_mut().map(|l| &mut l.name).chain(robot.joints.iter_mut().map(|j| &mut j.name))
    {
        *name = shown(name);
    }
    for name in
        robot.motors.iter_mut().map(|m| &mut m.name).chain(robot.loops.iter_mut().map(|l| &mut l.name))
    {
        *name = shown(name);
    }
    for inertia in robot.links.iter_mut().flat_map(|link| &mut link.inertias) {
        inertia.name = shown(&inertia.name);
    }
    tree::order(&mut robot, &mut problems);
    if !problems.errors.is_empty() {
        return Err(source.diagnostics(problems.errors));
    }
    if !options.floating && robot.joints.iter().all(|joint| matches!(joint.kind, robot::JointKind::Fixed)) {
        let span = &robot.links[robot.root].span;
        let help = match robot.has_ground {
            true => "give a body a joint",
            false => "let it move freely: `--floating`",
        };
        problems.error(span, "nothing moves: all joints are fixed, and the root is at rest", help);
        return Err(source.diagnostics(problems.errors));
    }
    if options.limits == Limits::Interval {
        for joint in robot.joints.iter().filter(|joint| joint.mimic.is_some() && joint.limits.is_some()) {
            let message =
                format!("the limits of joint `{}`, which follows another one, are not taken", joint.name);
            problems.note_with_help(&joint.span, message, "`--limits spring` has springs behind them");
        }
    }
    written(&source, file, &robot, options, problems)
}

/// The model of a robot. Where the language refuses its loops, as their equations follow from each other for the
/// lengths and angles of the file alone, these stay numbers if that helps.
fn written(
    source: &Source,
    file: &str,
    robot: &robot::Robot,
    options: &Options,
    mut problems: problems::Problems,
) -> Result<Imported, Diagnostics> {
    let before = problems.notes.len();
    let items = write::items(robot, options, &[], &mut problems);
    if !problems.errors.is_empty() {
        return Err(source.diagnostics(problems.errors));
    }
    let name = names::Names::new(&[]).take(&robot.name, &["*"]);
    let finished = |items: &str, notes: Vec<Diagnostic>| -> Result<Imported, Diagnostics> {
        let notes = source.diagnostics(notes);
        let text = write_model(&name, &robot.name, file, items, &notes);
        let text = hamel_lang::spec::format(&format!("{name}.hamel"), &text)?;
        Ok(Imported { name: name.clone(), text, notes })
    };
    let is_model = |imported: &Imported| hamel_lang::spec::parse(&imported.name, &imported.text).is_ok();
    let around: Vec<usize> = robot.loops.iter().flat_map(|k| robot.around(k)).flatten().collect();
    let mut again = problems::Problems::default();
    again.notes.extend(problems.notes[..before].iter().cloned());
    let imported = finished(&items, problems.take_notes())?;
    if around.is_empty() || is_model(&imported) {
        return Ok(imported);
    }
    let items = write::items(robot, options, &around, &mut again);
    for closed in &robot.loops {
        let message = format!("lengths and angles of the loop `{}` stay numbers", closed.name);
        again.note_with_help(&closed.span, message, "with others its equations would contradict each other");
    }
    let numbers = finished(&items, again.take_notes())?;
    Ok(if is_model(&numbers) { numbers } else { imported })
}

fn parsed(source: &Source) -> Result<roxmltree::Document<'_>, Diagnostics> {
    roxmltree::Document::parse(&source.text).map_err(|e| {
        let place = offset(&source.text, e.pos().row, e.pos().col);
        let message = format!("the file is no XML: {e}");
        refused(source, place..place, message, "correct it, or export it anew")
    })
}

fn refused(source: &Source, place: std::ops::Range<usize>, message: String, help: &str) -> Diagnostics {
    let span = Some(Span::new(place.start, place.end));
    source.diagnostics(vec![Diagnostic::new(span, message).with_help(help)])
}

/// The robot by the format of its root.
fn robot<'a>(
    reader: &xml::Reader<'a>,
    document: &'a roxmltree::Document<'a>,
    source: &Source,
    file: &str,
) -> Result<Option<robot::Robot>, Diagnostics> {
    let root = document.root_element();
    let is_macro = |node: &roxmltree::Node<'_, '_>| {
        node.tag_name().namespace().is_some_and(|n| n.contains("xacro"))
            || node.tag_name().name().starts_with("xacro:")
    };
    if let Some(node) = document.descendants().find(is_macro) {
        let help = format!("expand them: `xacro {file} > robot.urdf`");
        return Err(refused(source, xml::head(node), "the file has macros of xacro".to_owned(), &help));
    }
    let stem = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let stem = stem.split('.').next().unwrap_or(stem);
    match root.tag_name().name() {
        "robot" => Ok(urdf::read(reader, root, stem)),
        "mujoco" => Ok(mjcf::read(reader, root, stem)),
        "sdf" => Ok(sdf::read(reader, root, stem)),
        other => {
            let message = format!("`{other}` is not the root of a description that is known");
            let help = "the root of URDF is `robot`, that of MJCF `mujoco`, that of SDF `sdf`";
            Err(refused(source, xml::head(root), message, help))
        }
    }
}

/// The byte at a row and a column, both from one.
fn offset(text: &str, row: u32, column: u32) -> usize {
    let before: usize = text.split_inclusive('\n').take(row.saturating_sub(1) as usize).map(str::len).sum();
    let line = text.get(before..).unwrap_or_default();
    before + line.chars().take(column.saturating_sub(1) as usize).map(char::len_utf8).sum::<usize>()
}

fn lock(robot: &mut robot::Robot, options: &Options, problems: &mut problems::Problems) {
    for name in &options.locked {
        let Some(joint) = robot.joints.iter_mut().find(|joint| joint.name == *name) else {
            let list: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
            let help = format!("joints are {}", list.join(", "));
            problems.error(&(0..0), format!("there is no joint `{name}` to lock"), &help);
            continue;
        };
        joint.kind = robot::JointKind::Fixed;
        joint.mimic = None;
        let at = match joint.reference.is_zero() {
            true => "zero".to_owned(),
            false => joint.reference.in_radians(),
        };
        problems.note(&joint.span, format!("joint `{name}` is locked at {at}"));
    }
    let joints = &robot.joints;
    robot.motors.retain(|motor| {
        let joint = &joints[motor.joint];
        let is_fixed = matches!(joint.kind, robot::JointKind::Fixed);
        if is_fixed {
            let message = format!(
                "the motor `{}` acts on `{}`, which is fixed: it is left out",
                motor.name, joint.name
            );
            problems.note(&joint.span, message);
        }
        !is_fixed
    });
}

/// A text without characters that end a comment, or hide it.
fn shown(text: &str) -> String {
    text.replace(|c: char| c.is_control(), " ")
}

fn write_model(name: &str, robot: &str, file: &str, items: &str, notes: &Diagnostics) -> String {
    let file = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let mut head = String::new();
    for note in notes.iter() {
        head.push_str(&format!("// {}\n", shown(&note.message)));
    }
    if !head.is_empty() {
        head = format!("// Other than in the file:\n{head}\n");
    }
    format!(
        "/// {}\n\
         ///\n\
         /// From {}, in SI units. For each link, all in its frame: `w_` is its angular velocity, `v_` the velocity of\n\
         /// its origin, `up_` the vertical, `h_` the height of the origin, `E_` the rotation from the frame before,\n\
         /// `m_`, `c_`, `I_` mass, mass centre and moments of inertia about it, `u_` the velocity of the mass centre, `T_`\n\
         /// and `U_` kinetic energy and potential energy by g; `r_` and `Q_` are place and rotation of a link in the frame\n\
         /// that carries it, `p_` and `R_` in that of the link at rest or of the one that moves freely.\n\
         model {name} {{\n\
         {head}{items}}}\n",
        shown(robot),
        shown(file),
    )
}
