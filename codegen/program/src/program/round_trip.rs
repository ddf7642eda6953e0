//! Turns a program back into expressions, to compare the program with what was lowered.
//!
//! Does not know: who compares, or what with.

use std::collections::BTreeMap;

use super::ir::{Constant, Function, Instruction, Op, Operand, Program};
use super::role::Role;
use super::table::{Factors, Products};
use hamel_expr::error::Error;
use hamel_expr::{DivisionByZero, ExprId, Graph, Node, Rational, SymbolId};

/// The symbols that the inputs of a program stand for.
#[derive(Clone, Copy, Debug)]
pub struct Symbols<'a> {
    /// Parameters in the order of the program.
    pub params: &'a [SymbolId],
    /// Time.
    pub time: SymbolId,
    /// Inputs, and what they are held at.
    pub inputs: &'a [(SymbolId, Rational)],
    /// Components of the state in the order of the program.
    pub state: &'a [SymbolId],
    /// Components of the vector that a function takes besides time and state, by the function's role.
    pub arguments: &'a BTreeMap<Role, Vec<SymbolId>>,
}

/// Where instructions stand, and what they read.
struct Place<'a> {
    name: &'a str,
    symbols: Symbols<'a>,
    argument: &'a [SymbolId],
    slots: &'a [ExprId],
    /// Whether sums and products are named.
    is_named: bool,
}

impl Program {
    /// Results of every function as expressions in the inputs, in the order of functions and results.
    ///
    /// # Errors
    /// [`Error::DivisionByZero`] when a denominator vanishes identically.
    pub fn to_expressions(&self, graph: &mut Graph, symbols: Symbols<'_>) -> Result<Vec<Vec<ExprId>>, Error> {
        self.evaluate_all(graph, symbols, false).map(|(functions, _)| functions)
    }

    /// Results of every function, and after them both sides of the conditions, with a name for every sum and product on
    /// the way: the number of terms of an expression stays that of its operation.
    ///
    /// # Errors
    /// [`Error::DivisionByZero`] when a denominator vanishes identically.
    pub fn to_named_expressions(
        &self,
        graph: &mut Graph,
        symbols: Symbols<'_>,
    ) -> Result<Vec<ExprId>, Error> {
        let (functions, sides) = self.evaluate_all(graph, symbols, true)?;
        Ok(functions.into_iter().flatten().chain(sides).collect())
    }

    /// Results function by function, and the sides of the conditions.
    fn evaluate_all(
        &self,
        graph: &mut Graph,
        symbols: Symbols<'_>,
        is_named: bool,
    ) -> Result<(Vec<Vec<ExprId>>, Vec<ExprId>), Error> {
        let prepare = Place { name: "prepare", symbols, argument: &[], slots: &[], is_named };
        let values = self.evaluate(graph, &prepare, &self.prepare.instructions)?;
        let slots: Vec<ExprId> = self.prepare.slots.iter().map(|slot| values[slot.value as usize]).collect();
        let sides = self.prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
        let sides = sides.map(|o| self.operand(graph, &prepare, &values, o)).collect();
        let mut all = Vec::with_capacity(self.functions.len());
        for function in &self.functions {
            let argument = symbols.arguments.get(&function.role).map_or(&[][..], Vec::as_slice);
            let place = Place { name: function.role.name(), symbols, argument, slots: &slots, is_named };
            let values = self.evaluate(graph, &place, &function.instructions)?;
            let contracted = self.contract(graph, &place, &values, function);
            let results = function.results.iter().map(|(_, o)| match o {
                Operand::Contracted(i) => contracted[*i as usize],
                other => self.operand(graph, &place, &values, *other),
            });
            all.push(results.collect());
        }
        Ok((all, sides))
    }

    fn operand(&self, graph: &mut Graph, place: &Place<'_>, values: &[ExprId], operand: Operand) -> ExprId {
        let Place { symbols, argument, slots, .. } = place;
        match operand {
            Operand::Value(i) => values[i as usize],
            Operand::Constant(i) => match &self.constants[i as usize] {
                Constant::Rational(q) => graph.rational(q.clone()),
                Constant::Pi => graph.pi(),
            },
            Operand::Param(i) => graph.sym(symbols.params[i as usize]),
            Operand::Slot(i) => slots[i as usize],
            Operand::Time => graph.sym(symbols.time),
            Operand::Input(i) => graph.sym(symbols.inputs[i as usize].0),
            Operand::State(i) => graph.sym(symbols.state[i as usize]),
            Operand::Argument(i) => graph.sym(argument[i as usize]),
            // Results alone are, and the verifier sees to it.
            Operand::Contracted(_) => graph.zero(),
        }
    }

    /// Results of all contractions of a function.
    fn contract(
        &self,
        graph: &mut Graph,
        place: &Place<'_>,
        values: &[ExprId],
        function: &Function,
    ) -> Vec<ExprId> {
        let scalars: Vec<ExprId> =
            function.scalars.iter().map(|o| self.operand(graph, place, values, *o)).collect();
        let mut contracted: Vec<ExprId> = Vec::new();
        for contraction in &function.contractions {
            let mut terms = vec![Vec::new(); contraction.n_results];
            for Products { table, left, right } in &contraction.terms {
                let table = &self.tables[*table as usize];
                let factor = |graph: &mut Graph, factors: &Factors, i: usize| match factors {
                    Factors::State => graph.sym(place.symbols.state[i]),
                    Factors::Argument => graph.sym(place.argument[i]),
                    Factors::Scalars => scalars[i],
                    Factors::Contraction(k) => contracted[function.start_of_contraction(*k as usize) + i],
                };
                let products: Vec<_> = table.all().collect();
                for (terms, range) in terms.iter_mut().zip(table.ranges()) {
                    for product in &products[range] {
                        let left = factor(graph, left, product.left);
                        let right = factor(graph, right, product.right);
                        let value = graph.mul(left, right);
                        terms.push(graph.weighted(value, &table.numbers()[product.number]));
                    }
                }
            }
            for terms in &terms {
                let sum = graph.linear_combination(terms);
                contracted.push(if place.is_named { named(graph, sum) } else { sum });
            }
        }
        contracted
    }

    fn evaluate(
        &self,
        graph: &mut Graph,
        place: &Place<'_>,
        instructions: &[Instruction],
    ) -> Result<Vec<ExprId>, Error> {
        let mut values: Vec<ExprId> = Vec::with_capacity(instructions.len());
        for instruction in instructions {
            let operands: Vec<ExprId> =
                instruction.op.operands().map(|o| self.operand(graph, place, &values, o)).collect();
            let a = operands[0];
            let b = *operands.get(1).unwrap_or(&a);
            let value = match instruction.op {
                Op::Add(..) => Ok(graph.add(a, b)),
                Op::Sub(..) => Ok(graph.sub(a, b)),
                Op::Mul(..) => Ok(graph.mul(a, b)),
                Op::Div(..) => graph.div(a, b),
                Op::Neg(_) => Ok(graph.neg(a)),
                Op::Recip(_) => {
                    let one = graph.one();
                    graph.div(one, a)
                }
                Op::Sqrt(_) => Ok(graph.sqrt(a)),
                Op::Power(..) => match graph.as_rational(b).cloned() {
                    Some(q) => graph.pow(a, &q),
                    None => Err(DivisionByZero),
                },
                Op::Function(f, _) => Ok(graph.func(f, a)),
                Op::Atan2(..) => Ok(graph.atan2(a, b)),
                Op::SumError(..) | Op::ProductError(..) | Op::CircleError(..) => Ok(graph.zero()),
                Op::MulAdd(signs, ..) => {
                    let (product, addend) = (graph.mul(a, b), operands[2]);
                    let product = if signs.product { graph.neg(product) } else { product };
                    Ok(if signs.addend { graph.sub(product, addend) } else { graph.add(product, addend) })
                }
            };
            let value =
                value.map_err(|DivisionByZero| Error::DivisionByZero { place: place.name.to_owned() })?;
            values.push(if place.is_named { named(graph, value) } else { value });
        }
        Ok(values)
    }
}

/// A name for a sum or product, which hides what it is made of.
fn named(graph: &mut Graph, e: ExprId) -> ExprId {
    match graph.node(e) {
        Node::Sum { .. } | Node::Product { .. } => {
            let symbol = graph.define("", e);
            graph.sym(symbol)
        }
        _ => e,
    }
}
