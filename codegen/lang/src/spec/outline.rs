//! What a text declares and where it mentions it, also while it is no model: for editors.
//!
//! Declarations are those of the syntax tree, with what can be understood of a text whose brackets do not close.
//! Mentions are found among the tokens, so that items which do not parse have theirs as well.
//!
//! Deliberately does not know: values, shapes, what an item means for a motion.

use std::collections::BTreeMap;

use super::ast::{BodyPart, File, Item, ItemKind, MovedBy, Name, Shape};
use super::diagnostic::Span;
use super::parser;
use super::tokens::{Kind, Token, tokens};
use super::vocabulary::{self, WordKind};

/// What a [`Declaration`] declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each is what its title says")]
pub enum DeclarationKind {
    Model,
    Size,
    Index,
    Parameter,
    Input,
    Definition,
    Algebra,
    BasisElement,
    Representation,
    Velocity,
    QuasiVelocity,
    Momentum,
    Stage,
    Coordinate,
    Advected,
    State,
    Constraint,
    Casimir,
    Output,
    Section,
    Actuator,
    Lyapunov,
    Event,
    Mode,
    Body,
    Frame,
    Reconstructed,
    View,
    Scene,
}

impl DeclarationKind {
    /// What it is, for people.
    pub fn title(self) -> &'static str {
        match self {
            DeclarationKind::Model => "model",
            DeclarationKind::Size => "size",
            DeclarationKind::Index => "index",
            DeclarationKind::Parameter => "parameter",
            DeclarationKind::Input => "input",
            DeclarationKind::Definition => "definition",
            DeclarationKind::Algebra => "algebra",
            DeclarationKind::BasisElement => "basis element",
            DeclarationKind::Representation => "representation",
            DeclarationKind::Velocity => "velocity",
            DeclarationKind::QuasiVelocity => "quasi-velocity",
            DeclarationKind::Momentum => "momentum",
            DeclarationKind::Stage => "stage",
            DeclarationKind::Coordinate => "coordinate",
            DeclarationKind::Advected => "advected parameter",
            DeclarationKind::State => "state of first order",
            DeclarationKind::Constraint => "constraint",
            DeclarationKind::Casimir => "casimir",
            DeclarationKind::Output => "output",
            DeclarationKind::Section => "section",
            DeclarationKind::Actuator => "actuator",
            DeclarationKind::Lyapunov => "Lyapunov function",
            DeclarationKind::Event => "event",
            DeclarationKind::Mode => "mode",
            DeclarationKind::Body => "body",
            DeclarationKind::Frame => "frame",
            DeclarationKind::Reconstructed => "coordinate of the group",
            DeclarationKind::View => "view",
            DeclarationKind::Scene => "scene",
        }
    }

    /// Whether it is a state variable or follows from the state: what has an equation of motion.
    pub fn is_of_state(self) -> bool {
        use DeclarationKind::{Advected, Coordinate, Mode, Momentum, QuasiVelocity, State, Velocity};
        matches!(self, Velocity | QuasiVelocity | Momentum | Coordinate | Advected | State | Mode)
    }

    /// Whether expressions of the model may mention it.
    pub fn is_value(self) -> bool {
        use DeclarationKind::{Actuator, Definition, Index, Input, Lyapunov, Parameter, Size};
        self.is_of_state()
            || matches!(self, Parameter | Input | Definition | Size | Index | Actuator | Lyapunov)
    }

    /// Names of algebras are a space of names of their own, as are those of what a scene may want; these are others.
    fn space(self) -> Space {
        match self {
            DeclarationKind::Algebra | DeclarationKind::Representation => Space::Algebras,
            DeclarationKind::Casimir | DeclarationKind::Output | DeclarationKind::Section => Space::Outputs,
            DeclarationKind::BasisElement => Space::Elements,
            DeclarationKind::Model
            | DeclarationKind::Scene
            | DeclarationKind::View
            | DeclarationKind::Frame
            | DeclarationKind::Stage
            | DeclarationKind::Constraint
            | DeclarationKind::Event => Space::Unmentioned,
            _ => Space::Values,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Space {
    Values,
    Algebras,
    Outputs,
    Elements,
    Unmentioned,
}

/// A name that a text declares.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Declaration {
    /// What it is.
    pub kind: DeclarationKind,
    /// The name.
    pub name: String,
    /// Where the name stands.
    pub span: Span,
    /// The item that declares it, without documentation.
    pub item: Span,
    /// The item with its documentation.
    pub extent: Span,
    /// Its documentation.
    pub doc: String,
    /// Whether components have names of their own, `I1` or `C12`.
    has_components: bool,
    /// Where the name is known, for those that are not known everywhere.
    scope: Option<Span>,
}

/// A word of a text that stands for a [`Declaration`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mention {
    /// The word: `Omega1`, `x_dot`, `dh_dPi`.
    pub word: Span,
    /// The declared name within it: `Omega`, `x`, `Pi`.
    pub name: Span,
    /// Which of [`Outline::declarations`].
    pub declaration: usize,
}

/// What a text declares and mentions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outline {
    /// Names, in the order of the text; the model is the first where the text has one.
    pub declarations: Vec<Declaration>,
    /// Every word that stands for one of them, also where it is declared, in the order of the text.
    pub mentions: Vec<Mention>,
    /// Words of the language where they are used as such, in the order of the text.
    pub words: Vec<(Span, WordKind)>,
}

impl Outline {
    /// What there is in a text, whatever is wrong with it.
    ///
    /// ```
    /// use hamel_lang::spec::{DeclarationKind, Outline};
    ///
    /// let text = "model m { param a = 1; coordinate x in real; lagrangian = a*(x_dot^2 - x; }";
    /// let outline = Outline::new(text);
    /// let names: Vec<&str> = outline.declarations.iter().map(|d| d.name.as_str()).collect();
    /// assert_eq!(names, ["m", "a", "x"]);
    /// assert_eq!(outline.declarations[2].kind, DeclarationKind::Coordinate);
    /// let of_x = outline.mentions.iter().filter(|m| m.declaration == 2);
    /// assert_eq!(of_x.map(|m| &text[m.word.start..m.word.end]).collect::<Vec<_>>(), ["x", "x_dot", "x"]);
    /// ```
    pub fn new(text: &str) -> Outline {
        let mut outline = Outline::default();
        let text = text.strip_prefix('\u{feff}').map_or_else(|| text.to_owned(), |rest| format!("   {rest}"));
        if let Some(file) = parser::parse_leniently(&text).file {
            outline.declare(&file);
        }
        outline.declarations.sort_by_key(|d| (d.span.start, d.span.end));
        outline.mention(&text);
        outline
    }

    /// The word at a place, or the one that ends there, and what it stands for.
    pub fn mention_at(&self, offset: usize) -> Option<(&Mention, &Declaration)> {
        let touches = |m: &&Mention| (m.word.start..=m.word.end).contains(&offset);
        let inside = |m: &&Mention| (m.word.start..m.word.end).contains(&offset);
        let mention = self.mentions.iter().find(inside).or_else(|| self.mentions.iter().find(touches))?;
        Some((mention, self.declarations.get(mention.declaration)?))
    }

    /// The word of the language at a place, or the one that ends there.
    pub fn word_at(&self, offset: usize) -> Option<(Span, WordKind)> {
        self.words.iter().copied().find(|(span, _)| (span.start..=span.end).contains(&offset))
    }

    fn declare(&mut self, file: &File) {
        let end = file.items.last().map_or(file.name.span.end, |item| item.extent.end);
        let extent = Span::new(file.name.span.start, end);
        self.declarations.push(Declaration {
            kind: DeclarationKind::Model,
            name: file.name.text.clone(),
            span: file.name.span,
            item: extent,
            extent,
            doc: file.doc.join("\n"),
            has_components: false,
            scope: None,
        });
        for item in &file.items {
            let of = declared(item);
            for Declared { kind, name, doc, has_components, scope } in of {
                let doc = doc.unwrap_or(&item.doc).join("\n");
                self.declarations.push(Declaration {
                    kind,
                    name: name.text.clone(),
                    span: name.span,
                    item: item.span,
                    extent: item.extent,
                    doc,
                    has_components: has_components || file.families.contains(&name.text),
                    scope,
                });
            }
        }
        for (name, scope) in &file.indices {
            self.declarations.push(Declaration {
                kind: DeclarationKind::Index,
                name: name.text.clone(),
                span: name.span,
                item: *scope,
                extent: *scope,
                doc: String::new(),
                has_components: false,
                scope: Some(*scope),
            });
        }
    }

    fn mention(&mut self, text: &str) {
        let spans: BTreeMap<usize, usize> =
            self.declarations.iter().enumerate().map(|(k, d)| (d.span.start, k)).collect();
        let mut by_name: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (k, d) in self.declarations.iter().enumerate() {
            by_name.entry(&d.name).or_default().push(k);
        }
        let tokens = tokens(text);
        let tokens: Vec<&Token<'_>> = tokens.iter().filter(|token| !token.is_comment()).collect();
        let (mut mentions, mut words) = (Vec::new(), Vec::new());
        // Words since the last `;` or brace, with those that opened the braces around.
        let (mut statement, mut blocks): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
        for (k, token) in tokens.iter().enumerate() {
            if token.kind == Kind::Mark {
                match token.text {
                    "{" => blocks.push(statement.first().copied().unwrap_or_default()),
                    "}" => _ = blocks.pop(),
                    _ => {}
                }
                if matches!(token.text, "{" | "}" | ";") {
                    statement.clear();
                } else {
                    statement.push(token.text);
                }
                continue;
            }
            let first = statement.first().copied().unwrap_or_default();
            let is_first = statement.is_empty();
            statement.push(token.text);
            let span = Span::new(token.start, token.start + token.text.len());
            if !token.text.starts_with(|c: char| c.is_ascii_alphabetic()) {
                continue;
            }
            if let Some(declaration) = spans.get(&token.start) {
                mentions.push(Mention { word: span, name: span, declaration: *declaration });
                continue;
            }
            let previous = k.checked_sub(1).map(|k| tokens[k]);
            let next = tokens.get(k + 1).copied();
            let block = blocks.last().copied().unwrap_or_default();
            let is_algebra = names_algebra(&statement);
            let place = Place { previous, next, is_first, is_algebra, first, block };
            if let Some(kind) = place.keyword(token.text) {
                words.push((span, kind));
                continue;
            }
            let spaces = place.spaces();
            let found = spaces.iter().find_map(|space| {
                resolve(
                    token.text,
                    |name| {
                        by_name.get(name).into_iter().flatten().copied().find(|k| {
                            let d = &self.declarations[*k];
                            let is_known = d.scope.is_none_or(|s| (s.start..s.end).contains(&token.start));
                            d.kind.space() == *space && is_known
                        })
                    },
                    |k| &self.declarations[k],
                )
            });
            if let Some((declaration, range)) = found {
                let name = Span::new(token.start + range.start, token.start + range.end);
                mentions.push(Mention { word: span, name, declaration });
            } else if let Some(kind) = vocabulary::kind_of(token.text, next.is_some_and(|t| t.is("("))) {
                words.push((span, kind));
            }
        }
        self.mentions = mentions;
        self.words = words;
    }
}

/// Where a word stands among other tokens.
struct Place<'t> {
    previous: Option<&'t Token<'t>>,
    next: Option<&'t Token<'t>>,
    /// Whether it begins an item or a statement of a block.
    is_first: bool,
    /// Whether nothing but an algebra, a group or a space can stand there.
    is_algebra: bool,
    /// The word that does.
    first: &'t str,
    /// The word that begins the item of the block around.
    block: &'t str,
}

impl Place<'_> {
    /// What kind of word of the language it is, where it can be nothing else.
    fn keyword(&self, word: &str) -> Option<WordKind> {
        let next_is = |mark: &str| self.next.is_some_and(|t| t.is(mark));
        // A basis element or a quasi-velocity may begin a statement.
        let is_equation = matches!(word, "lagrangian" | "hamiltonian" | "inner_product");
        if self.is_first && (is_equation || !next_is("=")) {
            return vocabulary::kind_of(word, false).filter(|kind| *kind != WordKind::Function);
        }
        if self.first == "almost" && matches!(word, "algebra" | "algebroid") {
            return Some(WordKind::Item);
        }
        // Two operands never follow each other.
        let after_operand = self.previous.is_some_and(Token::ends_operand);
        let is_connective = after_operand && vocabulary::is_connective(word);
        // `want energy`: names follow the first word.
        let follows_first = self.previous.is_some_and(|t| t.text == self.first) && self.first != "event";
        (is_connective && !follows_first).then_some(WordKind::Part)
    }

    /// The spaces of names that it may be from, the nearest first.
    fn spaces(&self) -> &'static [Space] {
        let previous = self.previous.map_or("", |t| t.text);
        if matches!(self.block, "algebra" | "almost" | "representation" | "algebroid") {
            return &[Space::Elements, Space::Values];
        }
        match (self.block, self.first) {
            _ if self.is_algebra => &[Space::Algebras],
            ("scene", "want") => &[Space::Outputs],
            (_, "algebra" | "representation") => &[Space::Algebras],
            _ if matches!(previous, "in" | "of") => &[Space::Algebras, Space::Values],
            (_, "velocity" | "advected" | "reconstruct") => &[Space::Values, Space::Algebras],
            _ => &[Space::Values, Space::Algebras, Space::Outputs],
        }
    }
}

/// Whether the last word of a statement stands in the algebra of `velocity w in algebra;` and the like.
fn names_algebra(statement: &[&str]) -> bool {
    let items = ["velocity", "momentum", "advected", "configuration", "reconstruct", "section"];
    let is_item = statement.first().is_some_and(|first| items.contains(first));
    let behind = statement.iter().rposition(|word| *word == "in").map(|at| &statement[at + 1..]);
    let ends = ["as", "by", "from", "velocity", "relative", "="];
    is_item && behind.is_some_and(|words| !words.is_empty() && !words.iter().any(|word| ends.contains(word)))
}

/// What follows the name of a body in what it declares.
const BODY_ENDINGS: [&str; 5] = [
    BodyPart::Velocity.ending(),
    BodyPart::Spin.ending(),
    BodyPart::AngularMomentum.ending(),
    BodyPart::Momentum.ending(),
    BodyPart::Energy.ending(),
];

/// The declaration that a word stands for, and the declared name within the word.
fn resolve<'d>(
    word: &str,
    find: impl Fn(&str) -> Option<usize>,
    declaration: impl Fn(usize) -> &'d Declaration,
) -> Option<(usize, std::ops::Range<usize>)> {
    if let Some(k) = find(word) {
        return Some((k, 0..word.len()));
    }
    let component = |name: &str| {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
        let is_shorter = !stem.is_empty() && stem.len() < name.len() && !name.ends_with('_');
        find(stem).filter(|k| is_shorter && declaration(*k).has_components).map(|k| (k, stem.len()))
    };
    if let Some((k, end)) = component(word) {
        return Some((k, 0..end));
    }
    // A quaternion.
    if let Some(stem) = word.strip_suffix(['w', 'x', 'y', 'z'])
        && let Some(k) = find(stem).filter(|k| declaration(*k).kind == DeclarationKind::Reconstructed)
    {
        return Some((k, 0..stem.len()));
    }
    if let Some(coordinate) = word.strip_suffix("_dot") {
        let found = find(coordinate).map(|k| (k, coordinate.len())).or_else(|| component(coordinate));
        return found
            .filter(|(k, _)| {
                matches!(declaration(*k).kind, DeclarationKind::Coordinate | DeclarationKind::State)
            })
            .map(|(k, end)| (k, 0..end));
    }
    let of_body = BODY_ENDINGS.iter().find_map(|ending| {
        // An index of a loop stands behind the ending.
        let body = word.trim_end_matches(|c: char| c.is_ascii_digit()).strip_suffix(ending)?;
        find(body).filter(|k| declaration(*k).kind == DeclarationKind::Body).map(|k| (k, 0..body.len()))
    });
    if of_body.is_some() {
        return of_body;
    }
    // `dV_du` stands for its function.
    let function = word.strip_prefix('d').and_then(|rest| rest.rfind("_d").map(|end| &rest[..end]));
    if let Some(function) = function
        && let Some(k) = find(function).filter(|k| declaration(*k).kind == DeclarationKind::Lyapunov)
    {
        return Some((k, 1..1 + function.len()));
    }
    let momentum = word.strip_prefix("dh_d")?;
    let at = word.len() - momentum.len();
    let found = find(momentum).map(|k| (k, momentum.len())).or_else(|| component(momentum));
    found.filter(|(k, _)| declaration(*k).kind == DeclarationKind::Momentum).map(|(k, end)| (k, at..at + end))
}

/// A name that an item declares.
struct Declared<'a> {
    kind: DeclarationKind,
    name: &'a Name,
    /// Its own documentation, where the item's is not.
    doc: Option<&'a Vec<String>>,
    has_components: bool,
    scope: Option<Span>,
}

fn declared(item: &Item) -> Vec<Declared<'_>> {
    let one = |kind, name, has_components| Declared { kind, name, doc: None, has_components, scope: None };
    let is_array = |shape: &Shape| !matches!(shape, Shape::Scalar);
    match &item.kind {
        ItemKind::Param { name, shape, .. } => vec![one(DeclarationKind::Parameter, name, is_array(shape))],
        ItemKind::Input { name, shape, .. } => vec![one(DeclarationKind::Input, name, is_array(shape))],
        ItemKind::Noise { name, .. } => vec![one(DeclarationKind::Input, name, false)],
        ItemKind::Let { name, .. } => vec![one(DeclarationKind::Definition, name, true)],
        ItemKind::AlgebraName { name, .. } => vec![one(DeclarationKind::Algebra, name, false)],
        ItemKind::AlgebraBrackets { name, basis, .. } => {
            std::iter::once(one(DeclarationKind::Algebra, name, false))
                .chain(scoped(basis, item.span))
                .collect()
        }
        ItemKind::Representation { name, .. } => vec![one(DeclarationKind::Representation, name, false)],
        ItemKind::QuasiVelocity(names) => {
            names.iter().map(|name| one(DeclarationKind::QuasiVelocity, name, false)).collect()
        }
        ItemKind::Frame(velocities) => {
            let own = velocities.iter();
            own.map(|v| Declared {
                doc: (!v.doc.is_empty()).then_some(&v.doc),
                ..one(DeclarationKind::QuasiVelocity, &v.name, false)
            })
            .collect()
        }
        ItemKind::Algebroid(block) => {
            let velocities = block.velocities.iter().map(|name| one(DeclarationKind::Velocity, name, false));
            velocities.chain(scoped(&block.basis, item.span)).collect()
        }
        ItemKind::Velocity { names, .. } => {
            names.iter().map(|name| one(DeclarationKind::Velocity, name, true)).collect()
        }
        ItemKind::Momentum { name, .. } => vec![one(DeclarationKind::Momentum, name, true)],
        ItemKind::MomentumIn { names, .. } => {
            names.iter().map(|name| one(DeclarationKind::Momentum, name, true)).collect()
        }
        ItemKind::Stage { name, .. } => vec![one(DeclarationKind::Stage, name, false)],
        ItemKind::Coordinate { names, shape, .. } => {
            names.iter().map(|name| one(DeclarationKind::Coordinate, name, is_array(shape))).collect()
        }
        ItemKind::Advected { name, .. } => vec![one(DeclarationKind::Advected, name, true)],
        ItemKind::Configuration { names, by, .. } => {
            let own = match by {
                MovedBy::Own(list) => list.as_slice(),
                MovedBy::Declared(_) => &[],
            };
            let of_velocities = own.iter().map(|name| one(DeclarationKind::Velocity, name, true));
            names.iter().map(|name| one(DeclarationKind::Advected, name, true)).chain(of_velocities).collect()
        }
        ItemKind::State { name, shape, .. } => vec![one(DeclarationKind::State, name, is_array(shape))],
        ItemKind::Constraint { name, .. } | ItemKind::Virtual { name, .. } => {
            name.iter().map(|name| one(DeclarationKind::Constraint, name, false)).collect()
        }
        ItemKind::Casimir { name, .. } => vec![one(DeclarationKind::Casimir, name, false)],
        ItemKind::Actuate { name, .. } => vec![one(DeclarationKind::Actuator, name, false)],
        ItemKind::Lyapunov { name, .. } => vec![one(DeclarationKind::Lyapunov, name, false)],
        ItemKind::Output { name, .. } => vec![one(DeclarationKind::Output, name, true)],
        ItemKind::Section { name, .. } => vec![one(DeclarationKind::Section, name, false)],
        ItemKind::Body(body) => vec![one(DeclarationKind::Body, &body.name, true)],
        ItemKind::Event(event) => vec![one(DeclarationKind::Event, &event.name, false)],
        ItemKind::Mode(name) => vec![one(DeclarationKind::Mode, name, false)],
        ItemKind::Reconstruct { names, .. } => {
            names.iter().map(|name| one(DeclarationKind::Reconstructed, name, true)).collect()
        }
        ItemKind::View { name, .. } => vec![one(DeclarationKind::View, name, false)],
        ItemKind::NamedFrame { name, .. } => vec![one(DeclarationKind::Frame, name, false)],
        ItemKind::Scene { name, .. } => vec![one(DeclarationKind::Scene, name, false)],
        ItemKind::Size { name, .. } => vec![one(DeclarationKind::Size, name, false)],
        ItemKind::Source(_)
        | ItemKind::Topic(_)
        | ItemKind::Reduces(_)
        | ItemKind::Use(_)
        | ItemKind::Part { .. }
        | ItemKind::Require(_)
        | ItemKind::Drive { .. }
        | ItemKind::Acceleration { .. }
        | ItemKind::Field { .. }
        | ItemKind::Connection { .. }
        | ItemKind::DerivedConnection(_)
        | ItemKind::Carry(_)
        | ItemKind::Want(_)
        | ItemKind::Action(_)
        | ItemKind::InnerProduct(_)
        | ItemKind::LagrangianInnerProduct
        | ItemKind::Lagrangian(_)
        | ItemKind::Hamiltonian(_)
        | ItemKind::Independent(_)
        | ItemKind::Multipliers
        | ItemKind::VirtualThermo
        | ItemKind::Force { .. }
        | ItemKind::AppliedForce { .. }
        | ItemKind::Initial { .. } => Vec::new(),
    }
}

/// Elements of a basis, which are known in their item alone.
fn scoped(basis: &[Name], scope: Span) -> impl Iterator<Item = Declared<'_>> {
    basis.iter().map(move |name| Declared {
        kind: DeclarationKind::BasisElement,
        name,
        doc: None,
        has_components: false,
        scope: Some(scope),
    })
}
