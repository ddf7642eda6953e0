//! Items of a model, each by its first word.
//!
//! Deliberately does not know: whether names exist, where a file goes on after an error.

use proc_macro2::Delimiter;

use super::cursor::Parser;
use super::lexer::{Parsed, too_deep};
use crate::spec::ast::*;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::limits::{MAX_DEPTH, MAX_MATRIX};
use crate::spec::model::ConnectionKind;
use crate::spec::names;

impl<'a> Parser<'a> {
    /// One item without its final `;`; true when it ends with a block and has none.
    pub(super) fn item(&mut self) -> Parsed<(ItemKind, bool)> {
        let keyword = self.ident("an item such as `param`, `velocity` or `lagrangian`")?;
        let kind = match keyword.text.as_str() {
            "source" => match self.string()? {
                Some(text) => ItemKind::Source(text),
                None => return self.expected("a text in quotes"),
            },
            "topic" => match self.string()? {
                Some(text) => ItemKind::Topic(text),
                None => return self.expected("a text in quotes"),
            },
            "size" => self.size_item()?,
            "param" => self.param()?,
            "input" => self.input()?,
            "noise" => {
                let name = self.declared("the name of a noise")?;
                let value = self.punct(":").map(|_| self.expr()).transpose()?;
                ItemKind::Noise { name, value }
            }
            "drive" => {
                let name = self.named("the name of an input")?;
                self.equals()?;
                ItemKind::Drive { name, value: self.expr()? }
            }
            "require" => ItemKind::Require(self.comparisons()?),
            "let" => {
                let name = self.declared("a name")?;
                self.equals()?;
                ItemKind::Let { name, value: self.expr()? }
            }
            "algebra" => return self.algebra(false),
            "almost" if self.word("algebroid").is_some() => {
                return self.algebroid(keyword.span, true).map(|kind| (kind, true));
            }
            "almost" => {
                self.require_word("algebra")?;
                return self.algebra(true);
            }
            "algebroid" => return self.algebroid(keyword.span, false).map(|kind| (kind, true)),
            "frame" if self.cursor.ident().is_some() => self.named_frame()?,
            "frame" => return self.frame().map(|kind| (kind, true)),
            "acceleration" => {
                let (name, value) = self.given("the velocity whose rate is given")?;
                ItemKind::Acceleration { name, value }
            }
            "field" => {
                let (name, value) = self.given("the velocity that is given")?;
                ItemKind::Field { name, value }
            }
            "representation" => return self.representation().map(|kind| (kind, true)),
            "velocity" => {
                let names = self.comma_separated(|p| p.declared("the name of a velocity"))?;
                self.require_word("in")?;
                let (algebra, copies) = self.algebra_or_copies()?;
                let names = self.for_copies(names, copies);
                ItemKind::Velocity { labels: self.labels(names.len())?, names, algebra }
            }
            "momentum" => {
                let names = self.comma_separated(|p| p.declared("the name of the momentum"))?;
                match names.as_slice() {
                    [name] if self.word("of").is_some() => {
                        let velocity = self.named("the name of a velocity")?;
                        ItemKind::Momentum { name: name.clone(), velocity }
                    }
                    _ if self.word("in").is_some() => {
                        let (algebra, copies) = self.algebra_or_copies()?;
                        let names = self.for_copies(names, copies);
                        ItemKind::MomentumIn { labels: self.labels(names.len())?, names, algebra }
                    }
                    [_] => return self.expected("`of` and a velocity, or `in` and an algebra"),
                    _ => {
                        let Some(of) = self.word("of") else { return self.expected("`in` and an algebra") };
                        let problem = Diagnostic::new(Some(of), "an item names one momentum of a velocity");
                        return Err(Box::new(problem.with_help("write one for each: `momentum P of w;`")));
                    }
                }
            }
            "want" => ItemKind::Want(self.comma_separated(|p| p.named("`digits`"))?),
            "carry" => ItemKind::Carry(self.carried()?),
            "routh" => ItemKind::Carry(self.routhian()?),
            "quasi_velocity" => {
                ItemKind::QuasiVelocity(self.comma_separated(|p| p.declared("the name of a quasi-velocity"))?)
            }
            "connection" => {
                let name = self.named("the velocity whose connection is given")?;
                if ConnectionKind::from_name(&name.text).is_some() {
                    ItemKind::DerivedConnection(name)
                } else {
                    self.equals()?;
                    ItemKind::Connection { name, value: self.expr()? }
                }
            }
            "action" => ItemKind::Action(self.ident("`left` or `right`")?),
            "stage" => return self.stage(),
            "inner_product" => {
                self.equals()?;
                match self.word("lagrangian") {
                    Some(_) => ItemKind::LagrangianInnerProduct,
                    None => ItemKind::InnerProduct(self.expr()?),
                }
            }
            "coordinate" => self.coordinate()?,
            "state" => self.first_order_state()?,
            "advected" => self.advected()?,
            "configuration" => self.configuration()?,
            "lagrangian" => {
                self.equals()?;
                ItemKind::Lagrangian(self.expr()?)
            }
            "hamiltonian" => {
                self.equals()?;
                ItemKind::Hamiltonian(self.expr()?)
            }
            "constraint" => {
                let (name, gives) = self.name_of_equation()?;
                let (left, right) = self.equation("a constraint", "dot(Omega, Gamma) = 0")?;
                ItemKind::Constraint { name, gives, left, right }
            }
            "virtual" => self.displacements()?,
            "independent" => {
                ItemKind::Independent(self.comma_separated(|p| p.named("the name of a velocity"))?)
            }
            "multipliers" => ItemKind::Multipliers,
            "body" => return self.body().map(|kind| (kind, true)),
            "moment" => self.moment()?,
            "force" if self.is_applied() => self.applied_force()?,
            "force" => {
                let name = self.named("the velocity the force is paired with")?;
                self.equals()?;
                ItemKind::Force { name, value: self.expr()? }
            }
            "actuate" => self.actuator()?,
            "lyapunov" => self.lyapunov()?,
            "casimir" | "output" => {
                let name = self.labelled("a name")?;
                self.equals()?;
                let value = self.expr()?;
                if keyword.text == "casimir" {
                    ItemKind::Casimir { name, value }
                } else {
                    ItemKind::Output { name, value }
                }
            }
            "section" => {
                let name = self.labelled("a name")?;
                let algebra = self.word("in").map(|_| self.algebra_expr()).transpose()?;
                self.equals()?;
                ItemKind::Section { name, algebra, value: self.expr()? }
            }
            "reduces" => return self.reduces().map(|kind| (kind, true)),
            "use" => return self.part_used(),
            "event" => return self.event(),
            "reconstruct" => self.reconstruct()?,
            "initial" => {
                let name = self.named("the name of a state variable")?;
                self.equals()?;
                ItemKind::Initial { name, value: self.expr()? }
            }
            "view" => self.view()?,
            "scene" => return self.scene().map(|kind| (kind, true)),
            "model" => {
                let problem = Diagnostic::new(Some(keyword.span), "`model` inside a model");
                return Err(Box::new(problem.with_help("put each model in a file of its own")));
            }
            other => {
                let problem = Diagnostic::new(Some(keyword.span), format!("`{other}` begins no item"));
                return Err(Box::new(problem.with_help(names::item_meant_by(other))));
            }
        };
        Ok((kind, false))
    }

    /// `: vector(3)` and its like, or nothing.
    fn shape(&mut self) -> Parsed<Shape> {
        if self.punct(":").is_none() {
            return Ok(Shape::Scalar);
        }
        let kind = self.ident("`vector(n)`, `diagonal(n)`, `symmetric(n)` or `matrix(n, m)`")?;
        if kind.text == "scalar" {
            return Ok(Shape::Scalar);
        }
        let known = ["scalar", "vector", "diagonal", "symmetric", "matrix"];
        if !known.contains(&kind.text.as_str()) {
            let problem = Diagnostic::new(Some(kind.span), format!("unknown shape `{}`", kind.text));
            return Err(Box::new(problem.with_help(names::suggest(&kind.text, known))));
        }
        let (mut inside, span) = self.require_group(Delimiter::Parenthesis, "`(` with the dimension")?;
        let sizes = inside.comma_list(|p| p.size())?;
        match (kind.text.as_str(), sizes.as_slice()) {
            ("vector", [n]) => Ok(Shape::Vector(*n)),
            ("diagonal", [n]) => Ok(Shape::Diagonal(*n)),
            ("symmetric", [n]) => Ok(Shape::Symmetric(*n)),
            ("matrix", [n, m]) => Ok(Shape::Matrix(*n, *m)),
            (name, _) => {
                let (count, example) =
                    if name == "matrix" { ("two dimensions", "(3, 3)") } else { ("one dimension", "(3)") };
                let problem =
                    Diagnostic::new(Some(span), format!("`{name}` has {count}, found {}", sizes.len()));
                Err(Box::new(problem.with_help(format!("write `{name}{example}`"))))
            }
        }
    }

    fn param(&mut self) -> Parsed<ItemKind> {
        let name = self.declared("the name of a parameter")?;
        let shape = self.shape()?;
        let default = if self.peek_punct('=') {
            self.equals()?;
            Some(self.expr()?)
        } else {
            None
        };
        let conditions = if self.word("where").is_some() { self.comparisons()? } else { Vec::new() };
        Ok(ItemKind::Param { name, shape, default, conditions })
    }

    fn input(&mut self) -> Parsed<ItemKind> {
        let name = self.declared("the name of an input")?;
        let shape = self.shape()?;
        let default = if self.peek_punct('=') {
            self.equals()?;
            Some(self.expr()?)
        } else {
            None
        };
        Ok(ItemKind::Input { name, shape, default })
    }

    pub(super) fn comparisons(&mut self) -> Parsed<Vec<Comparison>> {
        self.comma_separated(|p| {
            let first = p.expr()?;
            let mut rest = Vec::new();
            loop {
                let start = p.here();
                let compare = if p.punct(">=").is_some() {
                    Compare::GreaterEqual
                } else if p.punct("<=").is_some() {
                    Compare::LessEqual
                } else if p.punct("!=").is_some() {
                    Compare::NotEqual
                } else if p.punct(">").is_some() {
                    Compare::Greater
                } else if p.punct("<").is_some() {
                    Compare::Less
                } else if rest.is_empty() {
                    if p.punct("==").is_some() || p.punct("=").is_some() {
                        let problem = Diagnostic::new(Some(start), "an equation is not a condition");
                        return Err(Box::new(
                            problem.with_help("conditions use `>`, `>=`, `<`, `<=` or `!=`"),
                        ));
                    }
                    return p.expected("`>`, `>=`, `<`, `<=` or `!=`");
                } else {
                    return Ok(Comparison { first, rest });
                };
                rest.push((compare, p.expr()?));
            }
        })
    }

    fn algebra(&mut self, is_almost: bool) -> Parsed<(ItemKind, bool)> {
        let name = self.ident("the name of the algebra")?;
        if self.peek_punct('=') && !is_almost {
            self.equals()?;
            return Ok((ItemKind::AlgebraName { name, value: self.algebra_expr()? }, false));
        }
        let after = if is_almost { "`{` with the brackets" } else { "`=` or `{`" };
        let (mut body, _) = self.require_group(Delimiter::Brace, after)?;
        if body.word("basis").is_none() {
            return body.expected("`basis e1, e2, ..;`");
        }
        let basis = body.comma_separated(|p| p.ident("the name of a basis element"))?;
        body.require_punct(";")?;
        let mut rules = Vec::new();
        while !body.at_end() {
            rules.push(body.bracket_rule()?);
        }
        Ok((ItemKind::AlgebraBrackets { name, is_almost, basis, rules }, true))
    }

    /// `[a, b] = c;`
    pub(super) fn bracket_rule(&mut self) -> Parsed<BracketRule> {
        let (mut pair, bracket) =
            self.require_group(Delimiter::Bracket, "a bracket such as `[a, b] = c;`")?;
        let left = pair.ident("the name of a basis element")?;
        pair.require_punct(",")?;
        let right = pair.ident("the name of a basis element")?;
        pair.finish("`]`")?;
        self.equals()?;
        let value = self.expr()?;
        self.require_punct(";")?;
        let span = bracket.to(value.span);
        Ok(BracketRule { left, right, value, span })
    }

    fn representation(&mut self) -> Parsed<ItemKind> {
        let name = self.ident("the name of the representation")?;
        self.require_word("of")?;
        let algebra = self.algebra_expr()?;
        self.require_word("on")?;
        let dim = match self.space()? {
            Some(dim) => dim,
            None => Size { value: 1, span: Span::new(self.last, self.last) },
        };
        let (mut body, _) = self.require_group(Delimiter::Brace, "`{`")?;
        let mut matrices = Vec::new();
        while !body.at_end() {
            let element = body.ident("the name of a basis element")?;
            body.equals()?;
            matrices.push((element, body.expr()?));
            body.require_punct(";")?;
        }
        Ok(ItemKind::Representation { name, algebra, dim, matrices })
    }

    /// `R^n`, or `R` for a single number.
    fn space(&mut self) -> Parsed<Option<Size>> {
        if self.word("R").is_none() {
            return self.expected("`R^n`");
        }
        if self.punct("^").is_none() {
            return Ok(None);
        }
        self.size_of_power().map(Some)
    }

    pub(super) fn algebra_expr(&mut self) -> Parsed<AlgebraExpr> {
        if self.depth >= MAX_DEPTH {
            return Err(too_deep(self.here()));
        }
        self.depth += 1;
        let result = self.algebra_or_copies();
        self.depth -= 1;
        result.map(|(algebra, _)| algebra)
    }

    /// An algebra, and how many copies it is: `A^n` is the product of `n` algebras `A`. (`R^n` is one algebra.)
    fn algebra_or_copies(&mut self) -> Parsed<(AlgebraExpr, Option<usize>)> {
        let one = self.algebra_expr_inner()?;
        if self.punct("^").is_none() {
            return Ok((one, None));
        }
        let copies = self.size_of_power()?.value;
        let span = Span::new(one.span.start, self.last);
        let product = Name { text: "product".to_owned(), span };
        Ok((AlgebraExpr { node: AlgebraNode::Call(product, vec![one; copies]), span }, Some(copies)))
    }

    fn algebra_expr_inner(&mut self) -> Parsed<AlgebraExpr> {
        let start = self.here();
        if self.cursor.literal().is_some() || self.is_number_next() {
            let size = self.size()?;
            return Ok(AlgebraExpr { node: AlgebraNode::Number(size.value), span: size.span });
        }
        let name = self.ident("an algebra such as `so(3)`")?;
        let node = if name.text == "R" && self.punct("^").is_some() {
            AlgebraNode::Power(self.size_of_power()?.value)
        } else if let Some((mut inside, _)) = self.group(Delimiter::Parenthesis) {
            // A size of matrices is no dimension of a vector.
            let is_of_matrices = ["zeitlin", "zeitlin_sphere"].contains(&name.text.as_str());
            let argument = |p: &mut Parser<'a>| match is_of_matrices
                && (p.cursor.literal().is_some() || p.is_number_next())
            {
                true => {
                    let size = p.size_up_to(MAX_MATRIX)?;
                    Ok(AlgebraExpr { node: AlgebraNode::Number(size.value), span: size.span })
                }
                false => p.algebra_expr(),
            };
            AlgebraNode::Call(name, inside.comma_list(argument)?)
        } else {
            AlgebraNode::Name(name.text)
        };
        Ok(AlgebraExpr { node, span: Span::new(start.start, self.last) })
    }

    /// A stage, and whether it ends with a block of connections.
    fn stage(&mut self) -> Parsed<(ItemKind, bool)> {
        let name = self.labelled("the name of the stage")?;
        let ideal = if self.peek_punct('=') { Some(self.ideal()?) } else { None };
        let Some((mut body, _)) = self.group(Delimiter::Brace) else {
            return Ok((ItemKind::Stage { name, ideal, connections: Vec::new() }, false));
        };
        let mut connections = Vec::new();
        while !body.at_end() {
            body.require_word("connection")?;
            let velocity = body.named("the velocity whose connection is given")?;
            body.equals()?;
            connections.push((velocity, body.expr()?));
            body.require_punct(";")?;
        }
        Ok((ItemKind::Stage { name, ideal, connections }, true))
    }

    fn ideal(&mut self) -> Parsed<Vec<Expr>> {
        self.equals()?;
        self.require_word("ideal")?;
        let (mut inside, _) =
            self.require_group(Delimiter::Parenthesis, "`(` with the velocities of the ideal")?;
        let ideal = inside.comma_list(|p| p.expr())?;
        if ideal.is_empty() {
            return inside.expected("the velocities that span the ideal");
        }
        Ok(ideal)
    }

    fn coordinate(&mut self) -> Parsed<ItemKind> {
        let names = self.comma_separated(|p| p.declared_coordinate("the name of a coordinate"))?;
        let shape = self.shape()?;
        let domain = self.domain()?;
        if self.word("by").is_none() {
            return Ok(ItemKind::Coordinate { names, shape, domain, by: None });
        }
        let left = self.expr()?;
        if !self.peek_punct('=') {
            let problem = self.unexpected("`=`");
            let help = "what determines a coordinate is an equation such as `sin(a) = 2*sin(b)`";
            return Err(Box::new(problem.with_help(help)));
        }
        self.equals()?;
        let right = self.expr()?;
        Ok(ItemKind::Coordinate { names, shape, domain, by: Some((left, right)) })
    }

    /// `in (low, high)`, `in angle` or `in real`.
    fn domain(&mut self) -> Parsed<DomainExpr> {
        self.require_word("in")?;
        if let Some((mut inside, _)) = self.group(Delimiter::Parenthesis) {
            let low = inside.expr()?;
            inside.require_punct(",")?;
            let high = inside.expr()?;
            inside.finish("`)`")?;
            return Ok(DomainExpr::Interval(low, high));
        }
        let domain = match self.peek_ident().as_deref() {
            Some("angle") => DomainExpr::Angle,
            Some("real") => DomainExpr::Real,
            _ => return self.expected("a domain: `(low, high)`, `angle` or `real`"),
        };
        self.ident("")?;
        Ok(domain)
    }

    /// `i: vector(2) in real by i_dot = rate`.
    fn first_order_state(&mut self) -> Parsed<ItemKind> {
        let name = self.declared_coordinate("the name of the state")?;
        let shape = self.shape()?;
        let domain = self.domain()?;
        let expected = format!("{}_dot", name.text);
        let help = format!("a state of first order is given by its rate: `by {expected} = ..`");
        if self.word("by").is_none() {
            return Err(Box::new(self.unexpected("`by` and the rate").with_help(help)));
        }
        let rate = self.named("the rate")?;
        if rate.text != expected {
            let message = format!("`{}` is not the rate of `{}`", rate.text, name.text);
            return Err(Box::new(Diagnostic::new(Some(rate.span), message).with_help(help)));
        }
        if !self.peek_punct('=') {
            return Err(Box::new(self.unexpected("`=`").with_help(help)));
        }
        self.equals()?;
        Ok(ItemKind::State { name, shape, domain, rate: (rate, self.expr()?) })
    }

    fn advected(&mut self) -> Parsed<ItemKind> {
        let name = self.declared("the name of the advected parameter")?;
        self.require_word("in")?;
        if self.peek_ident().is_none() {
            return self.expected("`R^n`, an algebra or `dual(..)` of one");
        }
        let space = self.algebra_expr()?;
        let labels = self.labels(1)?;
        if self.word("by").is_none() {
            let problem = self.unexpected("`by` and the infinitesimal action");
            return Err(Box::new(problem.with_help("for example `by cross(Omega, Gamma)`")));
        }
        Ok(ItemKind::Advected { name, space, labels, action: self.expr()? })
    }

    /// `as w_*`: what precedes the names of basis elements in those of components, one for each of `n` vectors; or
    /// nothing.
    fn labels(&mut self, n: usize) -> Parsed<Vec<Name>> {
        if self.word("as").is_none() {
            return Ok(Vec::new());
        }
        let start = self.here();
        let labels = self.comma_separated(|p| {
            let start = p.here();
            let prefix = match p.peek_ident() {
                Some(_) => p.ident("")?,
                None => Name { text: String::new(), span: start },
            };
            p.require_punct("*")?;
            Ok(prefix)
        })?;
        if labels.len() != n {
            let span = Span::new(start.start, self.last);
            let plural = if n == 1 { "vector has" } else { "vectors have" };
            let message = format!("{n} {plural} {} prefixes for components", labels.len());
            return Err(Box::new(Diagnostic::new(Some(span), message).with_help("write `as a_*, b_*`")));
        }
        Ok(labels)
    }

    /// `left = right`.
    pub(super) fn equation(&mut self, what: &str, example: &str) -> Parsed<(Expr, Expr)> {
        let left = self.expr()?;
        if !self.peek_punct('=') {
            let problem = self.unexpected("`=`");
            return Err(Box::new(problem.with_help(format!("{what} is an equation such as `{example}`"))));
        }
        self.equals()?;
        Ok((left, self.expr()?))
    }

    /// `name:`, `name for v, w:` or `for v, w:` before an equation, and the velocities.
    pub(super) fn name_of_equation(&mut self) -> Parsed<(Option<Name>, Vec<Name>)> {
        let named = self.cursor.ident().is_some_and(|(word, rest)| {
            if word == "for" {
                return false;
            }
            let rest = rest.group(Delimiter::Bracket).map_or(rest, |(.., behind)| behind);
            let is_for = rest.ident().is_some_and(|(word, _)| word == "for");
            is_for || rest.punct().is_some_and(|(p, _)| p.as_char() == ':')
        });
        let name = if named { Some(self.labelled("a name")?) } else { None };
        let gives = match self.word("for") {
            Some(_) => self.comma_separated(|p| p.named("the name of a velocity"))?,
            None => Vec::new(),
        };
        if name.is_some() || !gives.is_empty() {
            self.require_punct(":")?;
        }
        Ok((name, gives))
    }

    fn reconstruct(&mut self) -> Parsed<ItemKind> {
        let names = self.comma_separated(|p| p.declared("the name of a reconstructed coordinate"))?;
        if self.word("by").is_some() {
            return Ok(ItemKind::Reconstruct { names, way: ReconstructWay::Rate(self.expr()?) });
        }
        if self.word("in").is_none() {
            return self.expected("`in` and a group, or `by` and the rate");
        }
        let group = self.algebra_expr()?;
        let from = match self.word("from") {
            Some(_) => self.comma_separated(|p| p.named("the name of a velocity"))?,
            None => Vec::new(),
        };
        Ok(ItemKind::Reconstruct { names, way: ReconstructWay::Group { group, from } })
    }

    fn view(&mut self) -> Parsed<ItemKind> {
        let name = self.labelled("the name of the view")?;
        self.equals()?;
        let shape = self.ident("a shape such as `ball`")?;
        let (mut inside, _) = self.require_group(Delimiter::Parenthesis, "`(` with the sizes or places")?;
        let arguments = inside.comma_list(|p| p.expr())?;
        let mut placement: [(&str, Option<Expr>); 3] = [("around", None), ("at", None), ("attitude", None)];
        loop {
            let span = self.here();
            let Some((word, place)) = placement.iter_mut().find(|(word, _)| self.word(word).is_some()) else {
                break;
            };
            if place.is_some() {
                let problem = Diagnostic::new(Some(span), format!("`{word}` is written twice"));
                return Err(Box::new(problem.with_help("keep one of them")));
            }
            *place = Some(self.expr()?);
        }
        if !self.at_end() && !self.peek_punct(';') {
            return self.expected("`around`, `at`, `attitude` or `;`");
        }
        let [around, at, attitude] = placement.map(|(_, expr)| expr);
        Ok(ItemKind::View { name, shape, arguments, around, at, attitude })
    }

    fn scene(&mut self) -> Parsed<ItemKind> {
        let name = self.labelled("the name of the scene")?;
        let (mut body, _) = self.require_group(Delimiter::Brace, "`{`")?;
        let (mut fixed, mut wants) = (Vec::new(), Vec::new());
        let (mut drops, mut circles, mut carries) = (Vec::new(), Vec::new(), Vec::new());
        let (mut formulation, mut inputs) = (Vec::new(), Vec::new());
        let (mut discrete, mut retraction) = (Vec::new(), Vec::new());
        body.entries(&mut |body| {
            if body.word("fix").is_some() {
                fixed.extend(body.comma_separated(|p| {
                    let name = p.named("the name of a parameter")?;
                    p.equals()?;
                    Ok((name, p.expr()?))
                })?);
            } else if body.word("input").is_some() {
                inputs.extend(body.comma_separated(|p| p.named("the name of an input"))?);
            } else if body.word("want").is_some() {
                wants.extend(body.comma_separated(|p| p.named("the name of an output"))?);
            } else if body.word("drop").is_some() {
                drops.extend(body.comma_separated(|p| p.named("the name of a coordinate"))?);
            } else if body.word("circle").is_some() {
                circles.extend(body.comma_separated(|p| p.named("the name of an angle"))?);
            } else if body.word("carry").is_some() {
                carries.extend(body.carried()?);
            } else if body.word("routh").is_some() {
                carries.extend(body.routhian()?);
            } else if body.word("formulation").is_some() {
                let word = body.ident("`auto` or `auto(state)`")?;
                let inside = body.group(Delimiter::Parenthesis);
                let what = inside.map(|(mut inside, _)| {
                    let what = inside.ident("`state`")?;
                    inside.finish("`)`").map(|()| what)
                });
                formulation.push((word, what.transpose()?));
            } else if body.word("discrete").is_some() {
                discrete.push(body.named("`midpoint`")?);
            } else if body.word("retraction").is_some() {
                retraction.push(body.named("`cayley` or `exp`")?);
            } else {
                return body.expected(
                    "`fix`, `input`, `want`, `drop`, `circle`, `carry`, `routh`, `formulation`, `discrete`, \
                     `retraction` or `for`",
                );
            }
            body.require_punct(";").map(drop)
        })?;
        Ok(ItemKind::Scene {
            name,
            fixed,
            inputs,
            wants,
            drops,
            circles,
            carries,
            formulation,
            discrete,
            retraction,
        })
    }

    fn carried(&mut self) -> Parsed<Vec<Carry>> {
        self.comma_separated(|p| Ok(Carry::Named(p.named("the name of a momentum or a velocity")?)))
    }

    /// `phi = p`, `phi = p up to f` or `Omega -> Pi`, several with commas.
    fn routhian(&mut self) -> Parsed<Vec<Carry>> {
        self.comma_separated(|p| {
            let what = p.named("the name of a cyclic coordinate or of a velocity")?;
            if p.punct("->").is_some() {
                let momentum = p.declared("the name of its momentum")?;
                return Ok(Carry::Momenta { velocity: what, momentum });
            }
            if !p.peek_punct('=') {
                return p.expected("`= p` with a parameter, or `-> Pi` with the name of its momentum");
            }
            p.equals()?;
            let parameter = p.named("the parameter that its momentum is")?;
            let up_to = match p.word("up") {
                Some(_) => Some({
                    p.require_word("to")?;
                    p.expr()?
                }),
                None => None,
            };
            Ok(Carry::Level { cyclic: what, parameter, up_to })
        })
    }
}
