//! What may stand at a place of a text, by the tokens in front of it: for completion.
//!
//! Deliberately does not know: which names there are.

use super::tokens::{Kind, tokens};

/// What may stand at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Context {
    /// Outside of a model.
    File,
    /// An item of the model.
    Item,
    /// A statement of a scene.
    SceneStatement,
    /// A mode.
    Mode,
    /// A statement of an event.
    EventStatement,
    /// A statement of another block.
    BlockStatement,
    /// What a scene wants.
    Want,
    /// What all scenes of a model want.
    WantOfAll,
    /// A parameter of which a scene says the value.
    FixedParameter,
    /// An input.
    Input,
    /// A coordinate or an advected parameter that a scene leaves out.
    Dropped,
    /// An angle.
    Angle,
    /// A velocity.
    Velocity,
    /// A velocity, or the kind of a derived connection.
    Connection,
    /// A velocity or a momentum.
    Carried,
    /// A state variable or a coordinate of the group.
    StateVariable,
    /// An algebra or a space.
    Algebra,
    /// A group.
    Group,
    /// A representation of an algebra, or a value.
    Action,
    /// The domain of a coordinate.
    Domain,
    /// The shape of a parameter.
    Shape,
    /// The side of the action.
    Side,
    /// A shape in a figure.
    Solid,
    /// `auto`.
    Formulation,
    /// `midpoint`.
    Quadrature,
    /// A retraction of a group.
    Retraction,
    /// A value.
    Expression,
    /// A name that nobody knows yet, a number, a text or a comment.
    Anything,
}

impl Context {
    /// What may stand at a byte of a text, in the place of the word that ends there or goes through it.
    ///
    /// ```
    /// use hamel_lang::spec::Context;
    ///
    /// let at = |text: &str| Context::at(text, text.len());
    /// assert_eq!(at("model m { "), Context::Item);
    /// assert_eq!(at("model m { velocity Omega in s"), Context::Algebra);
    /// assert_eq!(at("model m { lagrangian = dot(Omega, "), Context::Expression);
    /// assert_eq!(at("model m { scene s { want rhs, en"), Context::Want);
    /// ```
    pub fn at(text: &str, offset: usize) -> Context {
        let mut offset = offset.min(text.len());
        while !text.is_char_boundary(offset) {
            offset -= 1;
        }
        let all = tokens(&text[..offset]);
        if let Some(last) = all.last() {
            let is_at_end = last.start + last.text.len() == offset;
            let is_open_comment = match last.kind {
                Kind::LineComment => !text[last.start..offset].contains('\n'),
                Kind::BlockComment => !last.text.ends_with("*/"),
                Kind::Word => is_at_end && last.text.starts_with(|c: char| c == '"' || c.is_ascii_digit()),
                Kind::Mark => false,
            };
            if is_open_comment {
                return Context::Anything;
            }
        }
        let mut blocks: Vec<&str> = Vec::new();
        let mut statement: Vec<&str> = Vec::new();
        for token in all.iter().filter(|token| !token.is_comment()) {
            match token.text {
                "{" => {
                    blocks.push(statement.first().copied().unwrap_or_default());
                    statement.clear();
                }
                "}" => {
                    blocks.pop();
                    statement.clear();
                }
                ";" => statement.clear(),
                text if token.kind == Kind::Word && token.start + text.len() == offset => {}
                text => statement.push(text),
            }
        }
        // A loop has items, as the model around it.
        blocks.retain(|block| !matches!(*block, "for" | "mode" | "part"));
        match blocks.as_slice() {
            [] => Context::File,
            [_] => of_item(&statement),
            [_, .., block] => of_block(block, &statement),
        }
    }
}

fn of_block(block: &str, statement: &[&str]) -> Context {
    let last = statement.last().copied().unwrap_or_default();
    let is_after_equals = statement.contains(&"=");
    match (block, statement.first().copied()) {
        ("scene", None) => Context::SceneStatement,
        ("scene", Some("want")) => Context::Want,
        ("scene", Some("fix")) if matches!(last, "fix" | ",") => Context::FixedParameter,
        ("scene", Some("input")) => Context::Input,
        ("scene", Some("drop")) => Context::Dropped,
        ("scene", Some("circle")) => Context::Angle,
        ("scene", Some("routh")) if last == "up" => Context::Anything,
        ("scene", Some("routh")) if statement.contains(&"to") && last != "," => Context::Expression,
        ("scene", Some("carry" | "routh")) => Context::Carried,
        ("scene", Some("formulation")) => Context::Formulation,
        ("scene", Some("discrete")) => Context::Quadrature,
        ("scene", Some("retraction")) => Context::Retraction,
        ("event", None) => Context::EventStatement,
        ("event", Some("then")) if !is_after_equals => Context::StateVariable,
        ("event", Some("enter" | "leave" | "impact")) if last != "with" => Context::Mode,
        ("reduces", None) => Context::StateVariable,
        // Names before `=` belong to another model.
        ("use", _) if !is_after_equals => Context::Anything,
        (_, None) => Context::BlockStatement,
        ("stage", Some("connection")) if !is_after_equals => Context::Velocity,
        // Names behind `=` belong to another model.
        ("reduces", _) if is_after_equals => Context::Anything,
        _ => Context::Expression,
    }
}

fn of_item(statement: &[&str]) -> Context {
    let Some((first, rest)) = statement.split_first() else { return Context::Item };
    let last = rest.last().copied().unwrap_or_default();
    let has = |word: &str| rest.contains(&word);
    match *first {
        "param" | "input" if last == ":" => Context::Shape,
        "size" | "for" if !(has("=") || has("in")) => Context::Anything,
        "input" if has("=") => Context::Expression,
        "noise" if !has(":") => Context::Anything,
        "drive" if !has("=") => Context::Input,
        "param" if has("=") || has("where") => Context::Expression,
        "coordinate" | "state" if has("by") => Context::Expression,
        "coordinate" | "state" if last == ":" => Context::Shape,
        "coordinate" | "state" if last == "in" => Context::Domain,
        "coordinate" | "state" if has("in") && has("(") => Context::Expression,
        "velocity" if has("in") => Context::Algebra,
        "momentum" if has("of") => Context::Velocity,
        "momentum" if has("in") => Context::Algebra,
        "representation" if last == "of" || has("on") => Context::Algebra,
        "advected" if has("by") => Context::Action,
        "advected" if has("in") => Context::Algebra,
        "configuration" if has("relative") => Context::Velocity,
        "configuration" if has("velocity") => Context::Anything,
        "configuration" if has("from") => Context::Velocity,
        "configuration" if has("in") => Context::Group,
        "reconstruct" if has("by") => Context::Expression,
        "reconstruct" if has("from") => Context::Velocity,
        "reconstruct" if has("in") => Context::Group,
        "algebra" if has("=") => Context::Algebra,
        "section" if has("=") => Context::Expression,
        "section" if has("in") => Context::Algebra,
        "action" => Context::Side,
        "connection" if !has("=") => Context::Connection,
        "force" | "acceleration" | "field" if !has("=") => Context::Velocity,
        "initial" if !has("=") => Context::StateVariable,
        "independent" => Context::Velocity,
        "constraint" if has("for") && !has(":") => Context::Velocity,
        "routh" if last == "up" => Context::Anything,
        "routh" if has("to") && last != "," => Context::Expression,
        "carry" | "routh" => Context::Carried,
        "want" => Context::WantOfAll,
        "view" if last == "=" => Context::Solid,
        "frame" if !(has("at") || has("attitude")) => Context::Anything,
        "param" | "input" | "coordinate" | "velocity" | "momentum" | "representation" | "advected"
        | "configuration" | "state" | "reconstruct" | "algebra" | "almost" | "quasi_velocity" | "scene"
        | "source" | "topic" | "multipliers" | "reduces" | "use" => Context::Anything,
        "actuate" if !has("along") => Context::Anything,
        "let" | "casimir" | "output" | "lyapunov" | "event" | "view" | "stage" | "section" if !has("=") => {
            Context::Anything
        }
        _ => Context::Expression,
    }
}
