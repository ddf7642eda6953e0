//! Elementary functions of the runtime that compiled code calls.
//!
//! Deliberately does not know: Cranelift.

use hamel_expr::Func;
use hamel_runtime::math;

/// A function of the runtime on one number, or two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Call {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Exp,
    Ln,
    Sinh,
    Cosh,
    Tanh,
    Abs,
    Atan2,
    /// Takes the number of the function before its argument.
    Stumpff,
    /// So does this one.
    Turn,
}

macro_rules! foreign {
    ($($name:ident)*) => {$(
        extern "C" fn $name(x: f64) -> f64 {
            math::$name(x)
        }
    )*};
}

extern "C" fn stumpff(k: f64, z: f64) -> f64 {
    // Whole numbers up to 255 are exact.
    hamel_runtime::Real::stumpff(z, k as u32)
}

extern "C" fn turn(k: f64, w: f64) -> f64 {
    hamel_runtime::Real::turn(w, k as u32)
}

foreign! { sin cos tan asin acos atan exp ln sinh cosh tanh abs }

extern "C" fn atan2(y: f64, x: f64) -> f64 {
    math::atan2(y, x)
}

impl Call {
    pub(crate) const ALL: [Call; 15] = [
        Call::Sin,
        Call::Cos,
        Call::Tan,
        Call::Asin,
        Call::Acos,
        Call::Atan,
        Call::Exp,
        Call::Ln,
        Call::Sinh,
        Call::Cosh,
        Call::Tanh,
        Call::Abs,
        Call::Atan2,
        Call::Stumpff,
        Call::Turn,
    ];

    /// The function of a program's operation.
    pub(crate) fn of(function: Func) -> Call {
        match function {
            Func::Sin => Call::Sin,
            Func::Cos => Call::Cos,
            Func::Tan => Call::Tan,
            Func::Asin => Call::Asin,
            Func::Acos => Call::Acos,
            Func::Atan => Call::Atan,
            Func::Exp => Call::Exp,
            Func::Ln => Call::Ln,
            Func::Sinh => Call::Sinh,
            Func::Cosh => Call::Cosh,
            Func::Tanh => Call::Tanh,
            Func::Abs => Call::Abs,
            Func::Stumpff(_) => Call::Stumpff,
            Func::Turn(_) => Call::Turn,
        }
    }

    /// Number of arguments.
    pub(crate) fn n_arguments(self) -> usize {
        if matches!(self, Call::Atan2 | Call::Stumpff | Call::Turn) { 2 } else { 1 }
    }

    /// The name by which code finds it.
    pub(crate) fn symbol(self) -> String {
        format!("hamel_{self:?}")
    }

    /// Where it is.
    pub(crate) fn address(self) -> *const u8 {
        let unary: extern "C" fn(f64) -> f64 = match self {
            Call::Atan2 => return atan2 as *const u8,
            Call::Stumpff => return stumpff as *const u8,
            Call::Turn => return turn as *const u8,
            Call::Sin => sin,
            Call::Cos => cos,
            Call::Tan => tan,
            Call::Asin => asin,
            Call::Acos => acos,
            Call::Atan => atan,
            Call::Exp => exp,
            Call::Ln => ln,
            Call::Sinh => sinh,
            Call::Cosh => cosh,
            Call::Tanh => tanh,
            Call::Abs => abs,
        };
        unary as *const u8
    }
}
