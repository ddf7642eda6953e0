//! Derivatives of a program along a direction as C: the program runs on dual numbers that write down what is done with
//! them.
//!
//! The rules are those of `hamel_runtime::Dual`. Deliberately does not know: which functions there are and why.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use hamel_runtime::{Dual, Real};

use super::kernel;
use crate::emit::literal::number;
use crate::program::{Point, Program, Role};
use hamel_expr::error::Error;

/// A number of the code that is being written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Recorded {
    /// Known while it is written.
    Constant(f64),
    /// An element of an array that the function takes.
    Input(&'static str, u32),
    /// A variable of the function.
    Variable(u32),
}

impl Default for Recorded {
    fn default() -> Recorded {
        Recorded::Constant(0.0)
    }
}

/// Where the text of a function grows.
#[derive(Default)]
struct Tape {
    text: String,
    n_variables: u32,
}

thread_local! {
    static TAPE: RefCell<Tape> = RefCell::new(Tape::default());
}

impl Recorded {
    fn text(self) -> String {
        match self {
            Recorded::Constant(x) => number(x),
            Recorded::Input("t", _) => "t".to_owned(),
            Recorded::Input("dt", _) => "dt".to_owned(),
            Recorded::Input(array, k) => format!("{array}[{k}]"),
            Recorded::Variable(k) => format!("v{k}"),
        }
    }

    fn is(self, x: f64) -> bool {
        self == Recorded::Constant(x)
    }

    /// A call of a function of one number.
    fn call(self, name: &str) -> Recorded {
        record(&format!("{name}({})", self.text()))
    }
}

/// Binds the next variable.
fn record(value: &str) -> Recorded {
    TAPE.with_borrow_mut(|tape| {
        let k = tape.n_variables;
        let _ = writeln!(tape.text, "    const double v{k} = {value};");
        tape.n_variables += 1;
        Recorded::Variable(k)
    })
}

impl Add for Recorded {
    type Output = Recorded;
    fn add(self, other: Recorded) -> Recorded {
        match (self, other) {
            (Recorded::Constant(a), Recorded::Constant(b)) => Recorded::Constant(a + b),
            (zero, other) if zero.is(0.0) => other,
            (this, zero) if zero.is(0.0) => this,
            (a, b) => record(&format!("{} + {}", a.text(), b.text())),
        }
    }
}

impl Sub for Recorded {
    type Output = Recorded;
    fn sub(self, other: Recorded) -> Recorded {
        match (self, other) {
            (Recorded::Constant(a), Recorded::Constant(b)) => Recorded::Constant(a - b),
            (zero, other) if zero.is(0.0) => -other,
            (this, zero) if zero.is(0.0) => this,
            (a, b) => record(&format!("{} - {}", a.text(), b.text())),
        }
    }
}

impl Mul for Recorded {
    type Output = Recorded;
    fn mul(self, other: Recorded) -> Recorded {
        match (self, other) {
            (Recorded::Constant(a), Recorded::Constant(b)) => Recorded::Constant(a * b),
            // What does not depend on a direction has no derivative along it, whatever it is multiplied by.
            (zero, _) | (_, zero) if zero.is(0.0) => Recorded::Constant(0.0),
            (one, other) | (other, one) if one.is(1.0) => other,
            (a, b) => record(&format!("{} * {}", a.text(), b.text())),
        }
    }
}

impl Div for Recorded {
    type Output = Recorded;
    fn div(self, other: Recorded) -> Recorded {
        match (self, other) {
            (Recorded::Constant(a), Recorded::Constant(b)) => Recorded::Constant(a / b),
            (zero, _) if zero.is(0.0) => Recorded::Constant(0.0),
            (this, one) if one.is(1.0) => this,
            (a, b) => record(&format!("{} / {}", a.text(), b.text())),
        }
    }
}

impl Neg for Recorded {
    type Output = Recorded;
    fn neg(self) -> Recorded {
        match self {
            Recorded::Constant(x) => Recorded::Constant(-x),
            other => record(&format!("-{}", other.text())),
        }
    }
}

impl AddAssign for Recorded {
    fn add_assign(&mut self, other: Recorded) {
        *self = *self + other;
    }
}

impl SubAssign for Recorded {
    fn sub_assign(&mut self, other: Recorded) {
        *self = *self - other;
    }
}

impl MulAssign for Recorded {
    fn mul_assign(&mut self, other: Recorded) {
        *self = *self * other;
    }
}

impl DivAssign for Recorded {
    fn div_assign(&mut self, other: Recorded) {
        *self = *self / other;
    }
}

/// Functions of one number by their names in C; what is asked of a number is answered as if it were moderate, so that
/// conditions on parameters, which other code checks, hold.
macro_rules! functions {
    ($($method:ident = $name:expr;)*) => {
        impl Real for Recorded {
            const ZERO: Recorded = Recorded::Constant(0.0);
            const ONE: Recorded = Recorded::Constant(1.0);

            fn from_f64(x: f64) -> Recorded {
                Recorded::Constant(x)
            }
            fn mul_add(self, factor: Recorded, addend: Recorded) -> Recorded {
                let is_trivial = |x: Recorded| matches!(x, Recorded::Constant(_));
                if is_trivial(self) || is_trivial(factor) || addend.is(0.0) {
                    return self * factor + addend;
                }
                record(&format!("{}({}, {}, {})", kernel::MUL_ADD, self.text(), factor.text(), addend.text()))
            }
            fn sum_error(self, other: Recorded) -> Recorded {
                if self.is(0.0) || other.is(0.0) {
                    return Recorded::Constant(0.0);
                }
                record(&format!("{}({}, {})", kernel::SUM_ERROR, self.text(), other.text()))
            }
            fn product_error(self, other: Recorded) -> Recorded {
                if [self, other].iter().any(|x| x.is(0.0) || x.is(1.0)) {
                    return Recorded::Constant(0.0);
                }
                record(&format!("{}({}, {})", kernel::PRODUCT_ERROR, self.text(), other.text()))
            }
            fn circle_error(self, cosine: Recorded) -> Recorded {
                record(&format!("{}({}, {})", kernel::CIRCLE_ERROR, self.text(), cosine.text()))
            }
            fn atan2(self, x: Recorded) -> Recorded {
                record(&format!("atan2({}, {})", self.text(), x.text()))
            }
            $(
                fn $method(self) -> Recorded {
                    self.call($name)
                }
            )*
            fn stumpff(self, k: u32) -> Recorded {
                record(&format!("{}({k}, {})", kernel::STUMPFF, self.text()))
            }
            fn turn(self, k: u32) -> Recorded {
                record(&format!("{}({k}, {})", kernel::TURN, self.text()))
            }
            fn all_gt(self, _: Recorded) -> bool {
                true
            }
            fn all_ge(self, _: Recorded) -> bool {
                true
            }
            fn all_ne(self, _: Recorded) -> bool {
                true
            }
            fn all_finite(self) -> bool {
                true
            }
            fn magnitude(self) -> f64 {
                1.0
            }
        }
    };
}

functions! {
    sqrt = "sqrt";
    sin = kernel::SIN;
    cos = kernel::COS;
    tan = "tan";
    asin = "asin";
    acos = "acos";
    atan = "atan";
    exp = "exp";
    ln = "log";
    sinh = "sinh";
    cosh = "cosh";
    tanh = "tanh";
    abs = "fabs";
}

/// The statements of a function of `params` (with inputs behind them), `dparams`, `t`, `dt`, `y` and `dy` that writes
/// the derivatives of the results of functions, one array after the other.
///
/// # Errors
/// [`Error::Program`] where a condition on parameters has no variables.
pub(super) fn tangents(program: &Program, wanted: &[(&str, Vec<(Role, usize)>)]) -> Result<String, Error> {
    TAPE.with_borrow_mut(|tape| *tape = Tape::default());
    let dual = |value: &'static str, derivative: &'static str, n: usize| -> Vec<Dual<Recorded>> {
        let input = |array, k| Recorded::Input(array, k as u32);
        (0..n).map(|k| Dual::new(input(value, k), input(derivative, k))).collect()
    };
    let params = dual("params", "dparams", program.params.len());
    let mut prepared =
        program.prepare(&params).map_err(|violated| Error::Program { reason: violated.to_string() })?;
    // Inputs stand behind the slots there, and behind the parameters in the arrays.
    let inputs = dual("params", "dparams", program.params.len() + program.inputs.len());
    prepared.truncate(program.prepare.slots.len());
    prepared.extend_from_slice(&inputs[program.params.len()..]);
    let state = dual("y", "dy", program.state.len());
    let t = dual("t", "dt", 1)[0];
    let mut results = String::new();
    for (array, functions) in wanted {
        let mut at = 0;
        for (role, n) in functions {
            let k = program.function_idx(role).ok_or_else(|| Error::UnknownName {
                name: role.name().to_owned(),
                kind: "function of the program",
                known: program.functions.iter().map(|f| f.role.name().to_owned()).collect(),
            })?;
            let mut out = vec![Dual::<Recorded>::default(); *n];
            program.run_at(k, &params, &prepared, Point { t, state: &state, argument: &[] }, &mut out);
            for value in out {
                let _ = writeln!(results, "    {array}[{at}] = {};", value.derivative.text());
                at += 1;
            }
        }
    }
    let statements = TAPE.with_borrow_mut(|tape| std::mem::take(&mut tape.text));
    Ok(statements + &results)
}
