//! Straight-line code: which values are variables, which stand where they are used, and in which block.
//!
//! Does not know: how a language writes statements; what a function is for.

use std::collections::BTreeSet;
use std::ops::Range;

use super::dialect::Dialect;
use super::expression::{Notation, Text, operation};
use super::names::Scope;
use crate::program::{Constant, Instruction, Op, Operand, Program, completes_pair, place_of_two};

/// A value stands where it is used while its text is no longer than this.
const MAX_INLINE_CHARS: usize = 160;
/// And while its parentheses are nested no deeper than this.
const MAX_INLINE_DEPTH: usize = 12;
/// Variables in a row: a function with more has blocks, as rustc 1.95 crashes on a few thousand.
const MAX_BINDINGS: usize = 400;

/// A statement of straight-line code.
#[derive(Clone, Debug)]
pub(super) enum Statement {
    /// A variable.
    Bind {
        /// Its name.
        name: String,
        /// Its value.
        value: String,
    },
    /// Sine and cosine of one angle, computed together.
    BindPair {
        /// Name of the sine.
        sine: String,
        /// Name of the cosine.
        cosine: String,
        /// The angle.
        angle: Text,
    },
    /// Sines and cosines of two angles, computed together.
    BindTwoPairs {
        /// Names of the sines.
        sines: [String; 2],
        /// Names of the cosines.
        cosines: [String; 2],
        /// The angles.
        angles: [Text; 2],
    },
    /// What the statements after this one compute.
    Title(String),
    /// Several variables, from a block in which others are bound that nothing reads after the block.
    Block {
        /// Statements of the block.
        inner: Vec<Statement>,
        /// Names of the variables that leave the block.
        names: Vec<String>,
    },
}

/// A list of instructions, being written.
struct Body<'a> {
    instructions: &'a [Instruction],
    /// The text of each value where it is not a variable, and the variables that this text mentions.
    texts: Vec<(Text, Vec<u32>)>,
    /// The variable of each value that is one.
    variables: Vec<Option<String>>,
    /// The angle of each sine that is computed with its cosine.
    angles: Vec<Option<Text>>,
}

/// The code of a list of instructions.
#[derive(Clone, Debug)]
pub(super) struct Code {
    /// What is computed before the results.
    pub(super) statements: Vec<Statement>,
    /// The results, in order.
    pub(super) results: Vec<Text>,
    /// The inputs that instructions or results read.
    pub(super) reads: BTreeSet<Operand>,
}

impl Code {
    /// Writes instructions down. Results may have names, which those that are computed are bound to. `spell` names
    /// parameters, slots, time, state and arguments; temporaries are called `t0`, `t1`, .., unless one of these is.
    pub(super) fn new(
        dialect: &impl Dialect,
        program: &Program,
        instructions: &[Instruction],
        segments: &[Segment<'_>],
        (results, names): (&[Operand], &[String]),
        scope: &mut Scope,
        spell: impl Fn(Operand) -> String,
    ) -> Code {
        let input = |operand: Operand| match operand {
            Operand::Constant(i) => constant(dialect, &program.constants[i as usize]),
            other => Text::atom(spell(other)),
        };
        let body = Body::new(dialect, instructions, (results, names), scope, input);
        let value = |operand: &Operand| match *operand {
            Operand::Value(v) => body.value(v),
            other => input(other),
        };
        let operands = instructions.iter().flat_map(|i| i.op.operands()).chain(results.iter().copied());
        Code {
            statements: body.statements(segments, results),
            results: results.iter().map(value).collect(),
            reads: operands.filter(|o| !matches!(o, Operand::Value(_) | Operand::Constant(_))).collect(),
        }
    }

    /// Whether a component of the state is read.
    pub(super) fn reads_state(&self) -> bool {
        self.reads.iter().any(|o| matches!(o, Operand::State(_)))
    }

    /// Whether a component of the function's own vector is read.
    pub(super) fn reads_argument(&self) -> bool {
        self.reads.iter().any(|o| matches!(o, Operand::Argument(_)))
    }
}

/// The spelling of a constant.
pub(super) fn constant(notation: &impl Notation, constant: &Constant) -> Text {
    Text::atom(notation.constant(constant))
}

impl<'a> Body<'a> {
    /// Decides what is a variable. `input` spells all operands but values.
    fn new(
        dialect: &impl Dialect,
        instructions: &'a [Instruction],
        (results, names): (&[Operand], &[String]),
        scope: &mut Scope,
        input: impl Fn(Operand) -> Text,
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
        for (operand, name) in results.iter().zip(names) {
            if let Operand::Value(v) = operand {
                variables[*v as usize].get_or_insert_with(|| scope.add(name));
            }
        }
        let mut texts: Vec<(Text, Vec<u32>)> = Vec::with_capacity(instructions.len());
        let mut angles: Vec<Option<Text>> = vec![None; instructions.len()];
        for (k, instruction) in instructions.iter().enumerate() {
            let spell = |operand: Operand| match operand {
                Operand::Value(v) => match &variables[v as usize] {
                    Some(name) => Text::atom(name.clone()),
                    None => texts[v as usize].0.clone(),
                },
                other => input(other),
            };
            let text = operation(&instruction.op, dialect, spell);
            if let Op::Function(_, angle) = instruction.op
                && is_paired(instructions, k)
            {
                angles[k] = Some(spell(angle));
            }
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
                variables[k] = Some(scope.temporary("t"));
            }
            texts.push((text, mentioned.into_iter().collect()));
        }
        Body { instructions, texts, variables, angles }
    }

    /// What stands for a value.
    fn value(&self, v: u32) -> Text {
        match &self.variables[v as usize] {
            Some(name) => Text::atom(name.clone()),
            None => self.texts[v as usize].0.clone(),
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

    /// Statements that bind the variables of the instructions, under the titles of their sections; in blocks where they
    /// are many.
    fn statements(&self, segments: &[Segment<'_>], results: &[Operand]) -> Vec<Statement> {
        let blocks = self.blocks(segments);
        let is_short = self.variables.iter().flatten().count() <= MAX_BINDINGS;
        // A variable leaves its block if another block reads it, or the results do.
        let mut block_of = vec![usize::MAX; self.instructions.len()];
        for (b, (bindings, _)) in blocks.iter().enumerate() {
            bindings.iter().for_each(|v| block_of[*v as usize] = b);
        }
        let mut leaves = vec![false; self.instructions.len()];
        for (b, (bindings, _)) in blocks.iter().enumerate() {
            for read in bindings.iter().flat_map(|v| &self.texts[*v as usize].1) {
                leaves[*read as usize] |= block_of[*read as usize] != b;
            }
        }
        for read in results.iter().flat_map(|o| self.mentioned(*o)) {
            leaves[read as usize] = true;
        }

        let mut statements = Vec::new();
        for (bindings, title) in &blocks {
            statements.extend(title.map(|title| Statement::Title(title.to_owned())));
            let inner = bindings.iter().filter_map(|v| self.bind(*v));
            if is_short {
                statements.extend(inner);
                continue;
            }
            let names = bindings.iter().filter(|v| leaves[**v as usize]).map(|v| self.value(*v).text);
            statements.push(Statement::Block { inner: inner.collect(), names: names.collect() });
        }
        statements
    }

    /// The statement that binds a variable; none for a cosine, which the statement of its sine binds, and for the
    /// second of two pairs, which the statement of the first binds.
    fn bind(&self, v: u32) -> Option<Statement> {
        let k = v as usize;
        let name = |v: u32| self.value(v).text;
        if completes_pair(self.instructions, k) {
            return None;
        }
        let Some(angle) = self.angles[k].clone() else {
            return Some(Statement::Bind { name: name(v), value: self.texts[k].0.text.clone() });
        };
        match (place_of_two(self.instructions, k), self.angles.get(k + 2)) {
            (Some(1), _) => None,
            (Some(_), Some(Some(other))) => Some(Statement::BindTwoPairs {
                sines: [name(v), name(v + 2)],
                cosines: [name(v + 1), name(v + 3)],
                angles: [angle, other.clone()],
            }),
            _ => Some(Statement::BindPair { sine: name(v), cosine: name(v + 1), angle }),
        }
    }

    /// How many variables before one are bound by the statement that binds it.
    fn n_bound_before(&self, v: u32) -> usize {
        let k = v as usize;
        let of_pair = usize::from(completes_pair(self.instructions, k));
        match place_of_two(self.instructions, k - of_pair) {
            Some(1) => 2 + of_pair,
            _ => of_pair,
        }
    }

    /// Variables in the order of evaluation, in blocks of a bounded size that do not cross segments.
    fn blocks<'t>(&self, segments: &[Segment<'t>]) -> Vec<(Vec<u32>, Option<&'t str>)> {
        let mut blocks = Vec::new();
        for Segment { range, title } in segments {
            let bindings: Vec<u32> =
                range.clone().filter(|v| self.variables[*v].is_some()).map(|v| v as u32).collect();
            let mut rest = bindings.as_slice();
            let mut title = *title;
            while !rest.is_empty() {
                // What one statement binds stays together.
                let cut = rest.len().min(MAX_BINDINGS);
                let n_before = rest.get(cut).map_or(0, |v| self.n_bound_before(*v));
                let (block, after) = rest.split_at(cut - n_before);
                blocks.push((block.to_vec(), title.take()));
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

/// A run of instructions that belong together.
#[derive(Clone, Debug)]
pub(super) struct Segment<'p> {
    /// Positions of the instructions.
    range: Range<usize>,
    /// What they compute; none for what comes last, the results.
    title: Option<&'p str>,
}

impl<'p> Segment<'p> {
    /// All instructions as one run.
    pub(super) fn all(instructions: &[Instruction]) -> Vec<Segment<'p>> {
        vec![Segment { range: 0..instructions.len(), title: None }]
    }

    /// Runs of instructions of one section, with the titles of all sections but the last.
    pub(super) fn sections(program: &'p Program, instructions: &[Instruction]) -> Vec<Segment<'p>> {
        let mut segments = Vec::new();
        let mut start = 0;
        while let Some(first) = instructions.get(start) {
            let length = instructions[start..].iter().take_while(|i| i.section == first.section).count();
            let section = first.section as usize;
            let title = (section + 1 < program.sections.len()).then(|| program.sections[section].trim());
            let title = title.map(|title| if title.is_empty() { "definitions" } else { title });
            segments.push(Segment { range: start..start + length, title });
            start += length;
        }
        segments
    }
}
