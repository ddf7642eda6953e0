//! Picks from all values those that results need: hoists, orders by section, drops the dead.
//!
//! Does not know: expressions, how values were found.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::number::{Numbered, Pool};
use crate::lower::Inputs;
use crate::lower::classes::Class;
use crate::lower::pivots::Conditions;
use crate::lower::roll::{Origin, Rolled};
use crate::program::{
    Condition, Constant, Function, Instruction, Operand, Prepare, Program, Report, Slot, Table,
};
use hamel_expr::error::Error;
use hamel_expr::{Graph, SymbolId};

/// Title of the section of values that no definition needs.
const RESULTS: &str = "results";

pub(super) fn assemble(
    graph: &Graph,
    inputs: &Inputs,
    conditions: &Conditions,
    pool: &Pool,
    functions: &[Numbered],
    sides: &[Operand],
) -> Result<Program, Error> {
    let mut slot_names: HashMap<u32, &str> = HashMap::new();
    for (_, name, operand) in functions.iter().flat_map(|f| &f.definitions) {
        if let Operand::Value(v) = operand {
            slot_names.entry(*v).or_insert(name);
        }
    }
    let mut slots = Slots { pool, order: Vec::new(), index: HashMap::new() };
    let mut constants = Constants { pool, kept: Vec::new(), index: HashMap::new() };
    let n_sections = u32::try_from(conditions.sections.len())
        .map_err(|_| Error::Program { reason: "there are more than 2^32 sections".to_owned() })?;
    let mut assembled = Vec::with_capacity(functions.len());
    let mut tables: Vec<Table> = Vec::new();
    for function in functions {
        let straight = assemble_function(pool, function, n_sections, &mut slots, &mut constants);
        assembled.push(match &function.rolled {
            Some(rolled) => with_contractions(straight, rolled, &mut tables),
            None => straight,
        });
    }

    let mut prepare = Prepare::default();
    let mut list = List { pool, order: Vec::new(), index: HashMap::new() };
    let everything = |_| true;
    for side in sides {
        list.require(*side, everything);
    }
    for slot in &slots.order {
        list.require(Operand::Value(*slot), everything);
    }
    for v in &list.order {
        let op = pool.ops[*v as usize].map(|o| constants.keep(list.local(o)));
        prepare.instructions.push(Instruction {
            op,
            section: 0,
            name: slot_names.get(v).map(|s| (*s).to_owned()),
        });
    }
    for slot in &slots.order {
        let name = slot_names.get(slot).map(|s| (*s).to_owned());
        prepare.slots.push(Slot { value: list.index[slot], name });
    }
    for (condition, sides) in conditions.conditions.iter().zip(sides.chunks_exact(2)) {
        prepare.conditions.push(Condition {
            text: condition.text.clone(),
            meaning: condition.meaning.clone(),
            greater: constants.keep(list.local(sides[0])),
            less: constants.keep(list.local(sides[1])),
            relation: condition.relation,
        });
    }

    let names = |symbols: &[SymbolId]| symbols.iter().map(|s| graph.name(*s).to_owned()).collect();
    let titles = conditions.sections.iter().map(|s| s.title.clone());
    Ok(Program {
        params: names(&inputs.params),
        time: graph.name(inputs.time).to_owned(),
        inputs: inputs
            .held
            .iter()
            .map(|(s, q)| (graph.name(*s).to_owned(), Constant::Rational(q.clone())))
            .collect(),
        state: names(&inputs.state),
        constants: constants.kept,
        tables,
        sections: titles.chain([RESULTS.to_owned()]).collect(),
        prepare,
        functions: assembled,
        report: Report::default(),
    })
}

fn assemble_function(
    pool: &Pool,
    function: &Numbered,
    n_sections: u32,
    slots: &mut Slots<'_>,
    constants: &mut Constants<'_>,
) -> Function {
    let changes = |v: u32| pool.class(Operand::Value(v)) > Class::Param;
    // What the results need; a definition can be mentioned and yet not be used once values are numbered.
    let mut live = List { pool, order: Vec::new(), index: HashMap::new() };
    for (_, operand) in &function.results {
        live.require(*operand, changes);
    }
    let live: HashSet<u32> = live.order.into_iter().collect();

    let mut list = List { pool, order: Vec::new(), index: HashMap::new() };
    let mut names: BTreeMap<u32, &str> = BTreeMap::new();
    let mut ends: Vec<(usize, u32)> = Vec::new();
    for (section, name, operand) in &function.definitions {
        if let Operand::Value(v) = operand
            && live.contains(v)
        {
            names.entry(*v).or_insert(name);
            list.require(*operand, changes);
            ends.push((list.order.len(), *section));
        }
    }
    for (_, operand) in &function.results {
        list.require(*operand, changes);
    }
    ends.push((list.order.len(), n_sections));

    let mut instructions = Vec::with_capacity(list.order.len());
    let mut ends = ends.into_iter().peekable();
    for (k, v) in list.order.iter().enumerate() {
        while ends.peek().is_some_and(|(end, _)| *end <= k) {
            ends.next();
        }
        let section = ends.peek().map_or(n_sections, |(_, section)| *section);
        let op = pool.ops[*v as usize].map(|o| constants.keep(slots.hoisted(list.local(o), o)));
        instructions.push(Instruction { op, section, name: names.get(v).map(|s| (*s).to_owned()) });
    }
    let results = function
        .results
        .iter()
        .map(|(name, o)| (name.clone(), constants.keep(slots.hoisted(list.local(*o), *o))))
        .collect();
    let (role, argument) = (function.role.clone(), function.argument.clone());
    Function { role, argument, instructions, results, ..Function::default() }
}

/// The function whose straight-line code has what these contractions take; equal tables are kept once.
fn with_contractions(mut straight: Function, rolled: &Rolled, tables: &mut Vec<Table>) -> Function {
    let own: Vec<u32> = (rolled.tables.iter())
        .map(|table| {
            let known = tables.iter().position(|known| known == table).unwrap_or_else(|| {
                tables.push(table.clone());
                tables.len() - 1
            });
            u32::try_from(known).expect("fewer than 2^32 tables fit in memory")
        })
        .collect();
    let mut contractions = rolled.contractions.clone();
    for products in contractions.iter_mut().flat_map(|c| &mut c.terms) {
        products.table = own[products.table as usize];
    }
    let scalars = straight.results.split_off(rolled.n_straight).into_iter().map(|(_, o)| o).collect();
    let results = rolled.asked.results.iter().zip(&rolled.origins).map(|((name, _), origin)| {
        let operand = match origin {
            Origin::Straight(k) => straight.results[*k].1,
            Origin::Sum(i) => Operand::Contracted(*i),
        };
        (name.clone(), operand)
    });
    let results = results.collect();
    Function { results, scalars, contractions, ..straight }
}

/// Values in an order of evaluation.
struct List<'a> {
    pool: &'a Pool,
    order: Vec<u32>,
    index: HashMap<u32, u32>,
}

impl List<'_> {
    /// Appends what `root` needs among the values that `includes` admits, operands first and left to right.
    fn require(&mut self, root: Operand, includes: impl Fn(u32) -> bool) {
        let mut pending = vec![(root, false)];
        while let Some((operand, operands_done)) = pending.pop() {
            let Operand::Value(v) = operand else { continue };
            if self.index.contains_key(&v) || !includes(v) {
                continue;
            }
            if operands_done {
                self.index
                    .insert(v, u32::try_from(self.order.len()).expect("no more values than the pool has"));
                self.order.push(v);
            } else {
                pending.push((operand, true));
                let operands: Vec<Operand> = self.pool.ops[v as usize].operands().collect();
                pending.extend(operands.into_iter().rev().map(|o| (o, false)));
            }
        }
    }

    fn local(&self, operand: Operand) -> Operand {
        match operand {
            Operand::Value(v) => self.index.get(&v).map_or(operand, |i| Operand::Value(*i)),
            other => other,
        }
    }
}

/// Parameter-only values that functions read, in the order of first use.
struct Slots<'a> {
    pool: &'a Pool,
    order: Vec<u32>,
    index: HashMap<u32, u32>,
}

impl Slots<'_> {
    /// The slot of `original` when it is a parameter-only value, otherwise `local`.
    fn hoisted(&mut self, local: Operand, original: Operand) -> Operand {
        match original {
            Operand::Value(v) if self.pool.class(original) <= Class::Param => {
                let n = u32::try_from(self.order.len()).expect("no more values than the pool has");
                let order = &mut self.order;
                Operand::Slot(*self.index.entry(v).or_insert_with(|| {
                    order.push(v);
                    n
                }))
            }
            _ => local,
        }
    }
}

/// Constants that the program uses, in the order of first use.
struct Constants<'a> {
    pool: &'a Pool,
    kept: Vec<Constant>,
    index: HashMap<u32, u32>,
}

impl Constants<'_> {
    fn keep(&mut self, operand: Operand) -> Operand {
        let Operand::Constant(i) = operand else { return operand };
        let n = u32::try_from(self.kept.len()).expect("no more constants than the pool has");
        let (kept, pool) = (&mut self.kept, self.pool);
        Operand::Constant(*self.index.entry(i).or_insert_with(|| {
            kept.push(pool.constants[i as usize].clone());
            n
        }))
    }
}
