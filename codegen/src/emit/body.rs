//! Straight-line code as text: which values are variables, which stand where they are used, and in which block.

use proc_macro2::TokenStream;
use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::names::Scope;
use crate::error::Error;
use crate::program::{Constant, Instruction, Literal, Op, Operand, Program, completes_pair};

/// A value stands where it is used while its text is no longer than this.
const MAX_INLINE_CHARS: usize = 160;
/// And while its parentheses are nested no deeper than this.
const MAX_INLINE_DEPTH: usize = 12;
/// Bindings in one block; rustc 1.95 crashes on a few thousand in a row.
const MAX_BINDINGS: usize = 400;

/// An expression as text, with how tightly its outermost operator binds and the depth of its parentheses.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub(super) text: String,
    binding: Binding,
    depth: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Sum,
    Product,
    Sign,
    Atom,
}

impl Text {
    pub(super) fn atom(text: String) -> Text {
        Text { text, binding: Binding::Atom, depth: 0 }
    }

    /// In parentheses unless it binds at least as tightly as asked.
    fn at_least(self, binding: Binding) -> Text {
        if self.binding >= binding {
            return self;
        }
        Text { text: format!("({})", self.text), binding: Binding::Atom, depth: self.depth + 1 }
    }
}

/// The spelling of a constant: as a scalar in code, or as a plain number in a comment.
pub(super) fn constant(constant: &Constant, in_code: bool) -> Text {
    let text = match (constant.literal(), in_code) {
        (Literal::Zero, true) => "R::ZERO".to_owned(),
        (Literal::One, true) => "R::ONE".to_owned(),
        (Literal::Number(x), true) => format!("R::from_f64({x:?})"),
        (Literal::Ratio(p, q), true) => format!("R::ratio({p:?}, {q:?})"),
        (Literal::Pi, true) => "R::from_f64(::core::f64::consts::PI)".to_owned(),
        (Literal::Zero, false) => "0".to_owned(),
        (Literal::One, false) => "1".to_owned(),
        (Literal::Number(x), false) => format!("{x}"),
        (Literal::Ratio(p, q), false) => format!("({p}/{q})"),
        (Literal::Pi, false) => "pi".to_owned(),
    };
    Text::atom(text)
}

/// The operation as text: in code, or as a formula in a comment.
pub(super) fn operation(op: &Op, in_code: bool, operand: impl Fn(Operand) -> Text) -> Text {
    let binary = |a: Operand, sign: &str, b: Operand, left: Binding, right: Binding| {
        let (a, b) = (operand(a).at_least(left), operand(b).at_least(right));
        Text { text: format!("{} {sign} {}", a.text, b.text), binding: left, depth: a.depth.max(b.depth) }
    };
    let call = |a: Operand, method: &str| {
        if !in_code {
            let a = operand(a);
            return Text {
                text: format!("{method}({})", a.text),
                binding: Binding::Atom,
                depth: a.depth + 1,
            };
        }
        let a = operand(a).at_least(Binding::Atom);
        Text { text: format!("{}.{method}()", a.text), binding: Binding::Atom, depth: a.depth }
    };
    match *op {
        Op::Add(a, b) => binary(a, "+", b, Binding::Sum, Binding::Product),
        Op::Sub(a, b) => binary(a, "-", b, Binding::Sum, Binding::Product),
        Op::Mul(a, b) => binary(a, "*", b, Binding::Product, Binding::Sign),
        Op::Div(a, b) => binary(a, "/", b, Binding::Product, Binding::Sign),
        Op::Neg(a) => signed(true, operand(a)),
        Op::Recip(a) if in_code => call(a, "recip"),
        Op::Recip(a) => {
            let a = operand(a).at_least(Binding::Sign);
            Text { text: format!("1 / {}", a.text), binding: Binding::Product, depth: a.depth }
        }
        Op::Sqrt(a) => call(a, "sqrt"),
        Op::Power(a, q) => {
            let a = operand(a).at_least(Binding::Atom);
            let q = operand(q).text;
            let text =
                if in_code { format!("({q} * {}.ln()).exp()", a.text) } else { format!("{}^{q}", a.text) };
            Text { text, binding: Binding::Atom, depth: a.depth + 1 }
        }
        Op::Function(f, a) => call(a, f.name()),
        Op::Atan2(y, x) if in_code => {
            let (y, x) = (operand(y).at_least(Binding::Atom), operand(x));
            let text = format!("{}.atan2({})", y.text, x.text);
            Text { text, binding: Binding::Atom, depth: y.depth.max(x.depth + 1) }
        }
        Op::Atan2(y, x) => {
            let (y, x) = (operand(y), operand(x));
            let text = format!("atan2({}, {})", y.text, x.text);
            Text { text, binding: Binding::Atom, depth: y.depth.max(x.depth) + 1 }
        }
        Op::MulAdd(signs, a, b, c) if in_code => {
            // The order of factors is free: a name reads better before the dot than a formula, a field or a number.
            let (a, b) = if is_name(&operand(b)) && !is_name(&operand(a)) { (b, a) } else { (a, b) };
            let receiver = signed(signs.product, operand(a)).at_least(Binding::Atom);
            let (factor, addend) = (operand(b), signed(signs.addend, operand(c)));
            let text = format!("{}.mul_add({}, {})", receiver.text, factor.text, addend.text);
            let depth = receiver.depth.max(factor.depth + 1).max(addend.depth + 1);
            Text { text, binding: Binding::Atom, depth }
        }
        Op::MulAdd(signs, a, b, c) => {
            let product = |text: Text| text.at_least(Binding::Sign).text;
            let (minus, sign) = (if signs.product { "-" } else { "" }, if signs.addend { "-" } else { "+" });
            let (a, b, c) = (operand(a), operand(b), operand(c).at_least(Binding::Product));
            let depth = a.depth.max(b.depth).max(c.depth) + 1;
            let text = format!("{minus}{} * {} {sign} {}", product(a), product(b), c.text);
            Text { text, binding: Binding::Sum, depth }
        }
    }
}

/// Whether a text is a bare name.
fn is_name(text: &Text) -> bool {
    text.text.chars().all(|c| c.is_alphanumeric() || c == '_')
}

fn signed(negative: bool, text: Text) -> Text {
    if !negative {
        return text;
    }
    let text = text.at_least(Binding::Atom);
    Text { text: format!("-{}", text.text), binding: Binding::Sign, depth: text.depth }
}

/// A list of instructions, being written.
pub(super) struct Body<'a> {
    instructions: &'a [Instruction],
    /// Text of each value, and the variables in it.
    texts: Vec<(Text, Vec<u32>)>,
    /// The variable of each value that is one.
    variables: Vec<Option<String>>,
}

impl<'a> Body<'a> {
    /// Decides what is a variable. `inputs` spells parameters, slots, time and state.
    pub(super) fn new(
        program: &Program,
        instructions: &'a [Instruction],
        results: &[Operand],
        scope: &mut Scope,
        prefix: &str,
        inputs: impl Fn(Operand) -> String,
    ) -> Body<'a> {
        let mut n_uses = vec![0usize; instructions.len()];
        let mut is_result = vec![false; instructions.len()];
        for operand in instructions.iter().flat_map(|i| i.op.operands()) {
            if let Operand::Value(v) = operand {
                n_uses[v as usize] += 1;
            }
        }
        for operand in results {
            if let Operand::Value(v) = operand {
                n_uses[*v as usize] += 1;
                is_result[*v as usize] = true;
            }
        }
        // Names of definitions come before those of temporaries, so that these give way.
        let mut variables: Vec<Option<String>> =
            instructions.iter().map(|i| i.name.as_deref().map(|name| scope.add(name))).collect();
        let mut texts: Vec<(Text, Vec<u32>)> = Vec::with_capacity(instructions.len());
        for (k, instruction) in instructions.iter().enumerate() {
            let text = operation(&instruction.op, true, |operand| match operand {
                Operand::Value(v) => match &variables[v as usize] {
                    Some(name) => Text::atom(name.clone()),
                    None => texts[v as usize].0.clone(),
                },
                Operand::Constant(i) => constant(&program.constants[i as usize], true),
                input => Text::atom(inputs(input)),
            });
            let mut mentioned = BTreeSet::new();
            for operand in instruction.op.operands() {
                if let Operand::Value(v) = operand {
                    if variables[v as usize].is_some() {
                        mentioned.insert(v);
                    } else {
                        mentioned.extend(texts[v as usize].1.iter().copied());
                    }
                }
            }
            let is_short = text.text.len() <= MAX_INLINE_CHARS && text.depth <= MAX_INLINE_DEPTH;
            let inlined = n_uses[k] == 1 && (is_short || is_result[k]) && !is_paired(instructions, k);
            if !inlined && variables[k].is_none() {
                variables[k] = Some(scope.temporary(prefix));
            }
            texts.push((text, mentioned.into_iter().collect()));
        }
        Body { instructions, texts, variables }
    }

    /// What stands for a value.
    pub(super) fn value(&self, v: u32) -> String {
        match &self.variables[v as usize] {
            Some(name) => name.clone(),
            None => self.texts[v as usize].0.text.clone(),
        }
    }

    /// Variables that the text of an operand mentions.
    fn mentioned(&self, operand: Operand) -> Vec<u32> {
        match operand {
            Operand::Value(v) if self.variables[v as usize].is_some() => vec![v],
            Operand::Value(v) => self.texts[v as usize].1.clone(),
            _ => Vec::new(),
        }
    }

    /// Statements that bind the variables of the instructions, a block for each section whose title is given.
    ///
    /// # Errors
    /// [`Error::Emission`] never in practice: the text is made of identifiers and operators.
    pub(super) fn statements(
        &self,
        segments: &[(std::ops::Range<usize>, Option<&str>)],
        results: &[Operand],
    ) -> Result<TokenStream, Error> {
        let blocks = self.blocks(segments);
        // The block that reads a variable last, or the results, tells whether the variable leaves its own block.
        let mut block_of = vec![usize::MAX; self.instructions.len()];
        for (b, (bindings, _)) in blocks.iter().enumerate() {
            bindings.iter().for_each(|v| block_of[*v as usize] = b);
        }
        let mut leaves = vec![false; self.instructions.len()];
        let mut stays = vec![false; self.instructions.len()];
        for (b, (bindings, _)) in blocks.iter().enumerate() {
            for read in bindings.iter().flat_map(|v| &self.texts[*v as usize].1) {
                let inside = block_of[*read as usize] == b;
                let mark = if inside { &mut stays } else { &mut leaves };
                mark[*read as usize] = true;
            }
        }
        for read in results.iter().flat_map(|o| self.mentioned(*o)) {
            leaves[read as usize] = true;
        }

        let mut text = String::new();
        for (bindings, title) in &blocks {
            let variable = |v: &u32| self.value(*v);
            let formula = |v: &u32| self.texts[*v as usize].0.text.as_str();
            if title.is_none() && bindings.len() <= MAX_BINDINGS {
                bindings.iter().for_each(|v| self.bind(*v, &mut text));
                continue;
            }
            if let Some(title) = title.filter(|title| !title.is_empty()) {
                let _ = writeln!(text, "#[doc = {:?}]", format!(" {title}"));
            }
            let exported: Vec<u32> = bindings.iter().copied().filter(|v| leaves[*v as usize]).collect();
            let mut inner = String::new();
            let is_bound = |v: &u32| stays[*v as usize] || self.is_paired(*v);
            bindings.iter().filter(|v| is_bound(v)).for_each(|v| self.bind(*v, &mut inner));
            let last = |v: &u32| if is_bound(v) { variable(v) } else { formula(v).to_owned() };
            let (pattern, last) = match exported.as_slice() {
                [single] => (variable(single), last(single)),
                several => {
                    let names: Vec<String> = several.iter().map(variable).collect();
                    let values: Vec<String> = several.iter().map(last).collect();
                    (format!("[{}]", names.join(", ")), format!("[{}]", values.join(", ")))
                }
            };
            let value = if inner.is_empty() { last } else { format!("{{ {inner}{last} }}") };
            let _ = writeln!(text, "let {pattern} = {value};");
        }
        parse(&text)
    }

    /// The statement that binds a variable; a sine binds its cosine as well.
    fn bind(&self, v: u32, text: &mut String) {
        let k = v as usize;
        let _ = if completes_pair(self.instructions, k) {
            Ok(())
        } else if self.is_paired(v) {
            let angle = self.texts[k].0.text.strip_suffix(".sin()").unwrap_or_default();
            writeln!(text, "let ({}, {}) = {angle}.sin_cos();", self.value(v), self.value(v + 1))
        } else {
            writeln!(text, "let {} = {};", self.value(v), self.texts[k].0.text)
        };
    }

    /// Whether a value is the sine or the cosine of a pair.
    fn is_paired(&self, v: u32) -> bool {
        is_paired(self.instructions, v as usize)
    }

    /// Variables in the order of evaluation, in blocks of a bounded size that do not cross segments.
    fn blocks<'t>(
        &self,
        segments: &[(std::ops::Range<usize>, Option<&'t str>)],
    ) -> Vec<(Vec<u32>, Option<&'t str>)> {
        let mut blocks = Vec::new();
        for (range, title) in segments {
            let bindings: Vec<u32> =
                range.clone().filter(|v| self.variables[*v].is_some()).map(|v| v as u32).collect();
            let title = if bindings.len() > MAX_BINDINGS { Some(title.unwrap_or("")) } else { *title };
            let mut rest = bindings.as_slice();
            let mut title = Some(title);
            while !rest.is_empty() {
                // A pair stays together.
                let cut = rest.len().min(MAX_BINDINGS);
                let splits = rest.get(cut).is_some_and(|v| completes_pair(self.instructions, *v as usize));
                let (block, after) = rest.split_at(if splits { cut - 1 } else { cut });
                blocks.push((block.to_vec(), title.take().unwrap_or(Some(""))));
                rest = after;
            }
        }
        blocks
    }
}

/// Whether an instruction is the sine or the cosine of a pair.
fn is_paired(instructions: &[Instruction], k: usize) -> bool {
    completes_pair(instructions, k) || (k + 1 < instructions.len() && completes_pair(instructions, k + 1))
}

/// Text to tokens.
pub(super) fn parse(text: &str) -> Result<TokenStream, Error> {
    text.parse().map_err(|e: proc_macro2::LexError| Error::Emission {
        model: String::new(),
        reason: format!("{e} in {text}"),
    })
}

/// Runs of instructions of one section, with the titles of all sections but the last.
pub(super) fn segments<'p>(
    program: &'p Program,
    instructions: &[Instruction],
) -> Vec<(std::ops::Range<usize>, Option<&'p str>)> {
    let mut segments: Vec<(std::ops::Range<usize>, Option<&str>)> = Vec::new();
    let mut start = 0;
    while let Some(first) = instructions.get(start) {
        let length = instructions[start..].iter().take_while(|i| i.section == first.section).count();
        let section = first.section as usize;
        let title = (section + 1 < program.sections.len()).then(|| program.sections[section].trim());
        let title = title.map(|title| if title.is_empty() { "definitions" } else { title });
        segments.push((start..start + length, title));
        start += length;
    }
    segments
}
