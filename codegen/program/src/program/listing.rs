//! Programs as text that is read back: for people, and for files of tests.
//!
//! ```text
//! params m k
//! time t
//! state x x_dot
//! section results
//! prepare
//!   %0 ratio = div p1 p0
//!   slot ratio = %0
//!   condition "m > 0" : p0 > 0
//! function rhs
//!   %0 @0 = mul y0 s0
//!   %1 @0 = neg %0
//!   x = y1
//!   x_dot = %1
//! ```
//!
//! Parts of `prepare` and of functions are indented. Operands are `%i` (earlier values of the list), `p` (parameters),
//! `s` (slots), `t`, `u` (inputs), `y` (components of the state), `a` (the function's own vector), `c` (results of
//! contractions), and constants: rationals and `pi`. `@i` is the section of an instruction; a word before `=` is the
//! name of its value. Fused products are `mul_add`, `mul_sub` (`a*b - c`), `neg_mul_add` (`c - a*b`) and `neg_mul_sub`.
//!
//! Tables of products are summed up in a comment: a program that has some is written, and not read. Does not know: what
//! a program is for.

use std::fmt;

use num_traits::Zero as _;

use hamel_expr::{Func, Rational, Relation};

use super::ir::{Condition, Constant, Function, Instruction, Op, Operand, Prepare, Program, Signs, Slot};
use super::report::Report;
use super::role::Role;

impl fmt::Display for Program {
    /// The text that [`Program::read`] reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = |words: &[String]| words.iter().map(|w| format!(" {w}")).collect::<String>();
        writeln!(f, "params{}", words(&self.params))?;
        writeln!(f, "time {}", self.time)?;
        for (name, value) in &self.inputs {
            writeln!(f, "input {name} = {}", Shown(value))?;
        }
        writeln!(f, "state{}", words(&self.state))?;
        for title in &self.sections {
            writeln!(f, "section {title}")?;
        }
        for (k, table) in self.tables.iter().enumerate() {
            let (sums, products) = (table.ends.len(), table.n_products());
            writeln!(
                f,
                "# table {k}: {sums} sums of {products} products, {} numbers",
                table.numbers().len()
            )?;
        }
        writeln!(f, "prepare")?;
        for (k, instruction) in self.prepare.instructions.iter().enumerate() {
            let name = instruction.name.as_ref().map(|name| format!(" {name}")).unwrap_or_default();
            writeln!(f, "  %{k}{name} = {}", self.operation_text(&instruction.op))?;
        }
        for slot in &self.prepare.slots {
            let name = slot.name.as_ref().map(|name| format!(" {name}")).unwrap_or_default();
            writeln!(f, "  slot{name} = %{}", slot.value)?;
        }
        for condition in &self.prepare.conditions {
            let Condition { text, meaning, greater, less, relation } = condition;
            let [greater, less] = [greater, less].map(|o| self.operand_text(*o));
            let meaning = if meaning.is_empty() { String::new() } else { format!(" {meaning:?}") };
            writeln!(f, "  condition {text:?}{meaning} : {greater} {} {less}", symbol(*relation))?;
        }
        for function in &self.functions {
            self.function_text(f, function)?;
        }
        Ok(())
    }
}

/// A constant as it is read back.
struct Shown<'a>(&'a Constant);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Constant::Rational(q) => write!(f, "{q}"),
            Constant::Pi => f.write_str("pi"),
        }
    }
}

fn symbol(relation: Relation) -> &'static str {
    match relation {
        Relation::Greater => ">",
        Relation::GreaterEqual => ">=",
        Relation::NotEqual => "!=",
    }
}

impl Program {
    fn function_text(&self, f: &mut fmt::Formatter<'_>, function: &Function) -> fmt::Result {
        let argument: String = function.argument.iter().map(|name| format!(" {name}")).collect();
        writeln!(f, "function {}{argument}", kind(&function.role))?;
        for (k, instruction) in function.instructions.iter().enumerate() {
            let name = instruction.name.as_ref().map(|name| format!(" {name}")).unwrap_or_default();
            writeln!(f, "  %{k} @{}{name} = {}", instruction.section, self.operation_text(&instruction.op))?;
        }
        for (k, scalar) in function.scalars.iter().enumerate() {
            writeln!(f, "  # scalar {k}: {}", self.operand_text(*scalar))?;
        }
        for (k, contraction) in function.contractions.iter().enumerate() {
            let (n, products) = (contraction.n_results, contraction.n_products);
            writeln!(f, "  # contraction {k}: {n} results of {products} products")?;
        }
        for (name, value) in &function.results {
            writeln!(f, "  {name} = {}", self.operand_text(*value))?;
        }
        Ok(())
    }

    fn operand_text(&self, operand: Operand) -> String {
        match operand {
            Operand::Value(k) => format!("%{k}"),
            Operand::Constant(k) => {
                self.constants.get(k as usize).map_or("?".into(), |c| Shown(c).to_string())
            }
            Operand::Param(k) => format!("p{k}"),
            Operand::Slot(k) => format!("s{k}"),
            Operand::Time => "t".into(),
            Operand::Input(k) => format!("u{k}"),
            Operand::State(k) => format!("y{k}"),
            Operand::Argument(k) => format!("a{k}"),
            Operand::Contracted(k) => format!("c{k}"),
        }
    }

    fn operation_text(&self, op: &Op) -> String {
        let word = match op {
            Op::Add(..) => "add".to_owned(),
            Op::Sub(..) => "sub".to_owned(),
            Op::Mul(..) => "mul".to_owned(),
            Op::Div(..) => "div".to_owned(),
            Op::Neg(..) => "neg".to_owned(),
            Op::Recip(..) => "recip".to_owned(),
            Op::Sqrt(..) => "sqrt".to_owned(),
            Op::Power(..) => "pow".to_owned(),
            Op::Atan2(..) => "atan2".to_owned(),
            Op::SumError(..) => "sum_error".to_owned(),
            Op::ProductError(..) => "product_error".to_owned(),
            Op::CircleError(..) => "circle_error".to_owned(),
            Op::Function(func @ (Func::Stumpff(k) | Func::Turn(k)), _) => format!("{}{k}", func.name()),
            Op::Function(func, _) => func.name().to_owned(),
            Op::MulAdd(signs, ..) => fused(*signs).to_owned(),
        };
        op.operands().fold(word, |text, operand| format!("{text} {}", self.operand_text(operand)))
    }

    /// The program of a text, as [`Program`] is displayed.
    ///
    /// Rules of programs are not checked: [`verify_rules`](super::verify_rules) does.
    ///
    /// # Errors
    /// The number of the first line that is not understood, and why.
    pub fn read(text: &str) -> Result<Program, String> {
        let mut reader = Reader::default();
        for (k, line) in text.lines().enumerate() {
            let (is_part, line) = (line.starts_with(' '), line.trim());
            if !line.is_empty() && !line.starts_with('#') {
                let read = if is_part { reader.part(line) } else { reader.head(line) };
                read.map_err(|reason| format!("line {}: {reason}", k + 1))?;
            }
        }
        Ok(reader.program)
    }
}

fn fused(signs: Signs) -> &'static str {
    match (signs.product, signs.addend) {
        (false, false) => "mul_add",
        (false, true) => "mul_sub",
        (true, false) => "neg_mul_add",
        (true, true) => "neg_mul_sub",
    }
}

/// A role as it is read back: its kind, and the name that some have.
fn kind(role: &Role) -> String {
    match role {
        Role::Output(name) => format!("output:{name}"),
        Role::Product(name) => format!("product:{name}"),
        Role::OfVariables(name) => format!("of_variables:{name}"),
        Role::Flow(name) => format!("flow:{name}"),
        role => role.name().to_owned(),
    }
}

fn role(kind: &str) -> Option<Role> {
    if let Some((kind, name)) = kind.split_once(':') {
        let name = name.to_owned();
        return match kind {
            "output" => Some(Role::Output(name)),
            "product" => Some(Role::Product(name)),
            "of_variables" => Some(Role::OfVariables(name)),
            "flow" => Some(Role::Flow(name)),
            _ => None,
        };
    }
    let named = [
        Role::Rate,
        Role::Energy,
        Role::Pivots,
        Role::Signature,
        Role::Domain,
        Role::Points,
        Role::SeriesStart,
        Role::SeriesStep,
    ];
    named.into_iter().find(|role| role.name() == kind)
}

/// Reads a program line by line.
struct Reader {
    program: Program,
    is_in_prepare: bool,
}

impl Default for Reader {
    fn default() -> Reader {
        let program = Program {
            params: Vec::new(),
            time: String::new(),
            inputs: Vec::new(),
            state: Vec::new(),
            constants: Vec::new(),
            tables: Vec::new(),
            sections: Vec::new(),
            prepare: Prepare::default(),
            functions: Vec::new(),
            report: Report::default(),
        };
        Reader { program, is_in_prepare: false }
    }
}

impl Reader {
    fn head(&mut self, line: &str) -> Result<(), String> {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        let words = || rest.split_whitespace().map(str::to_owned).collect::<Vec<String>>();
        match word {
            "params" => self.program.params = words(),
            "time" => rest.clone_into(&mut self.program.time),
            "input" => {
                let (name, number) = rest.split_once(" = ").ok_or("an input has a value")?;
                let value = constant(number).ok_or_else(|| format!("{number:?} is no number"))?;
                self.program.inputs.push((name.to_owned(), value));
            }
            "state" => self.program.state = words(),
            "section" => self.program.sections.push(rest.to_owned()),
            "prepare" => self.is_in_prepare = true,
            "function" => {
                self.is_in_prepare = false;
                let mut words = words().into_iter();
                let kind = words.next().ok_or("a function has a role")?;
                let role = role(&kind).ok_or_else(|| format!("{kind:?} is no role"))?;
                let function = Function { role, argument: words.collect(), ..Function::default() };
                self.program.functions.push(function);
            }
            _ => return Err(format!("{word:?} begins no line")),
        }
        Ok(())
    }

    /// A line of the prepare part or of a function.
    fn part(&mut self, line: &str) -> Result<(), String> {
        if self.is_in_prepare
            && let Some(rest) = line.strip_prefix("condition ")
        {
            return self.condition(rest);
        }
        let (left, right) = line.rsplit_once(" = ").ok_or("there is no =")?;
        if let Some(left) = left.strip_prefix('%') {
            return self.instruction(left, right);
        }
        let value = self.operand(right)?;
        if !self.is_in_prepare {
            let function = self.program.functions.last_mut().ok_or("a result is part of a function")?;
            function.results.push((left.to_owned(), value));
            return Ok(());
        }
        let name =
            left.strip_prefix("slot").ok_or("the prepare part has values, slots and conditions")?.trim();
        let Operand::Value(value) = value else { return Err("a slot holds a value".into()) };
        self.program.prepare.slots.push(Slot { value, name: named(name) });
        Ok(())
    }

    /// `k @section name = operation`; the prepare part has no sections.
    fn instruction(&mut self, left: &str, right: &str) -> Result<(), String> {
        let op = self.operation(right)?;
        let (number, rest) = left.split_once(' ').unwrap_or((left, ""));
        let (section, name) = match rest.strip_prefix('@') {
            Some(rest) => {
                let (section, name) = rest.split_once(' ').unwrap_or((rest, ""));
                (section.parse().map_err(|_| format!("{section:?} is no section"))?, name)
            }
            None => (0, rest),
        };
        let list = match self.program.functions.last_mut() {
            Some(function) => &mut function.instructions,
            None => &mut self.program.prepare.instructions,
        };
        if number.parse() != Ok(list.len()) {
            return Err(format!("%{number} is not the next value, %{}", list.len()));
        }
        list.push(Instruction { op, section, name: named(name) });
        Ok(())
    }

    /// `"text" "meaning" : greater > less`.
    fn condition(&mut self, rest: &str) -> Result<(), String> {
        let (texts, sides) = rest.rsplit_once(" : ").ok_or("a condition ends with `: a > b`")?;
        let mut texts = texts.split('"').skip(1).step_by(2).map(str::to_owned);
        let sides: Vec<&str> = sides.split_whitespace().collect();
        let [greater, relation, less] = sides[..] else {
            return Err("a condition compares two sides".into());
        };
        let relation = [Relation::Greater, Relation::GreaterEqual, Relation::NotEqual]
            .into_iter()
            .find(|r| symbol(*r) == relation)
            .ok_or_else(|| format!("{relation:?} compares nothing"))?;
        let [greater, less] = [self.operand(greater)?, self.operand(less)?];
        let text = texts.next().ok_or("a condition has a text")?;
        let condition =
            Condition { text, meaning: texts.next().unwrap_or_default(), greater, less, relation };
        self.program.prepare.conditions.push(condition);
        Ok(())
    }

    fn operand(&mut self, text: &str) -> Result<Operand, String> {
        if text == "t" {
            return Ok(Operand::Time);
        }
        if let Some(value) = constant(text) {
            let known = self.program.constants.iter().position(|c| *c == value);
            let k = known.unwrap_or_else(|| {
                self.program.constants.push(value);
                self.program.constants.len() - 1
            });
            return Ok(Operand::Constant(k as u32));
        }
        let made = |first: char| -> Option<fn(u32) -> Operand> {
            Some(match first {
                '%' => Operand::Value,
                'p' => Operand::Param,
                's' => Operand::Slot,
                'u' => Operand::Input,
                'y' => Operand::State,
                'a' => Operand::Argument,
                'c' => Operand::Contracted,
                _ => return None,
            })
        };
        let first = text.chars().next().and_then(made);
        let number = text.get(1..).and_then(|number| number.parse().ok());
        match (first, number) {
            (Some(operand), Some(number)) => Ok(operand(number)),
            _ => Err(format!("{text:?} is no operand")),
        }
    }

    fn operation(&mut self, text: &str) -> Result<Op, String> {
        let mut words = text.split_whitespace();
        let word = words.next().ok_or("there is no operation")?;
        let operands = words.map(|word| self.operand(word)).collect::<Result<Vec<Operand>, String>>()?;
        let signs = |product, addend| Signs { product, addend };
        let of_family = |name: &str, function: fn(u8) -> Func| {
            word.strip_prefix(name).and_then(|k| k.parse().ok()).map(function)
        };
        let func = of_family("stumpff", Func::Stumpff)
            .or_else(|| of_family("turn", Func::Turn))
            .or_else(|| Func::from_name(word));
        Ok(match (word, &operands[..]) {
            ("add", &[a, b]) => Op::Add(a, b),
            ("sub", &[a, b]) => Op::Sub(a, b),
            ("mul", &[a, b]) => Op::Mul(a, b),
            ("div", &[a, b]) => Op::Div(a, b),
            ("pow", &[a, b]) => Op::Power(a, b),
            ("atan2", &[a, b]) => Op::Atan2(a, b),
            ("sum_error", &[a, b]) => Op::SumError(a, b),
            ("product_error", &[a, b]) => Op::ProductError(a, b),
            ("circle_error", &[a, b]) => Op::CircleError(a, b),
            ("neg", &[a]) => Op::Neg(a),
            ("recip", &[a]) => Op::Recip(a),
            ("sqrt", &[a]) => Op::Sqrt(a),
            ("mul_add", &[a, b, c]) => Op::MulAdd(signs(false, false), a, b, c),
            ("mul_sub", &[a, b, c]) => Op::MulAdd(signs(false, true), a, b, c),
            ("neg_mul_add", &[a, b, c]) => Op::MulAdd(signs(true, false), a, b, c),
            ("neg_mul_sub", &[a, b, c]) => Op::MulAdd(signs(true, true), a, b, c),
            (_, &[a]) if func.is_some() => Op::Function(func.unwrap_or(Func::Sin), a),
            _ => return Err(format!("{word:?} is no operation on {} operands", operands.len())),
        })
    }
}

/// A name, if there is one.
fn named(name: &str) -> Option<String> {
    (!name.is_empty()).then(|| name.to_owned())
}

fn constant(text: &str) -> Option<Constant> {
    if text == "pi" {
        return Some(Constant::Pi);
    }
    // Division by zero has no value.
    if text.split_once('/').is_some_and(|(_, d)| d.parse::<num_bigint::BigInt>().is_ok_and(|d| d.is_zero())) {
        return None;
    }
    text.parse::<Rational>().ok().map(Constant::Rational)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPRING: &str = "\
params m k
time t
input f = 1/2
state x x_dot
section momenta p = dL/dy
section results
prepare
  %0 ratio = div p1 p0
  slot ratio = %0
  condition \"m > 0\" \"mass = m\" : p0 > 0
function rhs
  %0 @0 = mul_sub y0 s0 u0
  %1 @1 angle = neg_mul_add %0 pi 3/4
  %2 @1 = stumpff2 %1
  %3 @1 = sin %2
  x = y1
  x_dot = %3
function output:place
  slot = y0
";

    #[test]
    fn a_program_is_read_as_it_is_written() {
        let program = Program::read(SPRING).unwrap();
        assert_eq!(program.to_string(), SPRING);
        assert_eq!(Program::read(&program.to_string()), Ok(program.clone()));
        super::super::verify_rules(&program).unwrap();
        let parts = (program.constants.len(), program.functions.len(), program.prepare.slots.len());
        assert_eq!(parts, (3, 2, 1));
    }

    #[test]
    fn a_line_that_is_not_understood_is_named() {
        let told = |from: &str, to: &str| Program::read(&SPRING.replacen(from, to, 1)).unwrap_err();
        assert_eq!(told("= sin %2", "= sine %2"), "line 15: \"sine\" is no operation on 1 operands");
        assert_eq!(told("%3 @1", "%4 @1"), "line 15: %4 is not the next value, %3");
        assert_eq!(told("3/4", "3/0"), "line 13: \"3/0\" is no operand");
        assert_eq!(told("function rhs", "function rsh"), "line 11: \"rsh\" is no role");
        assert_eq!(told("time t", "tme t"), "line 2: \"tme\" begins no line");
    }
}
