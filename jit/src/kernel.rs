//! The operations of the runtime's sine and cosine, recorded once from the runtime's own source, to be compiled.
//!
//! Deliberately does not know: Cranelift, where the angle comes from, angles beyond the kernel's bound.

use std::cell::RefCell;
use std::ops::{Add, Mul, Neg, Sub};
use std::sync::OnceLock;

use hamel_runtime::math::kernel::{Angle, reduced};

/// A position among the steps of a recording.
pub(crate) type At = usize;

/// One operation of the kernel on the results of earlier ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Step {
    /// The angle.
    Angle,
    /// A constant.
    Constant(f64),
    /// `a + b`.
    Add(At, At),
    /// `a - b`.
    Sub(At, At),
    /// `a * b`.
    Mul(At, At),
    /// `-a`.
    Neg(At),
    /// `a * b + c`, rounded as the runtime rounds it.
    MulAdd(At, At, At),
    /// The sine of an angle that is quarter turns further, of their number's bits, the sine and the cosine.
    TurnedSine(At, At, At),
    /// The cosine.
    TurnedCosine(At, At, At),
}

/// The kernel as a list of operations.
#[derive(Clone, Debug)]
pub(crate) struct Kernel {
    /// In order.
    pub(crate) steps: Vec<Step>,
    /// Where the sine is.
    pub(crate) sine: At,
    /// Where the cosine is.
    pub(crate) cosine: At,
}

thread_local! {
    static STEPS: RefCell<Vec<Step>> = const { RefCell::new(Vec::new()) };
}

/// A number that writes down what is done with it.
#[derive(Clone, Copy)]
struct Recorded(At);

fn record(step: Step) -> Recorded {
    STEPS.with_borrow_mut(|steps| {
        steps.push(step);
        Recorded(steps.len() - 1)
    })
}

impl Add for Recorded {
    type Output = Recorded;
    fn add(self, other: Recorded) -> Recorded {
        record(Step::Add(self.0, other.0))
    }
}

impl Sub for Recorded {
    type Output = Recorded;
    fn sub(self, other: Recorded) -> Recorded {
        record(Step::Sub(self.0, other.0))
    }
}

impl Mul for Recorded {
    type Output = Recorded;
    fn mul(self, other: Recorded) -> Recorded {
        record(Step::Mul(self.0, other.0))
    }
}

impl Neg for Recorded {
    type Output = Recorded;
    fn neg(self) -> Recorded {
        record(Step::Neg(self.0))
    }
}

impl Angle for Recorded {
    fn splat(x: f64) -> Recorded {
        record(Step::Constant(x))
    }
    fn mul_add(self, factor: Recorded, addend: Recorded) -> Recorded {
        record(Step::MulAdd(self.0, factor.0, addend.0))
    }
    fn quarter_turns(self, sine: Recorded, cosine: Recorded) -> (Recorded, Recorded) {
        let sine_turned = record(Step::TurnedSine(self.0, sine.0, cosine.0));
        (sine_turned, record(Step::TurnedCosine(self.0, sine.0, cosine.0)))
    }
}

/// The kernel.
pub(crate) fn kernel() -> &'static Kernel {
    static KERNEL: OnceLock<Kernel> = OnceLock::new();
    KERNEL.get_or_init(|| {
        STEPS.with_borrow_mut(Vec::clear);
        let (sine, cosine) = reduced(record(Step::Angle));
        Kernel { steps: STEPS.take(), sine: sine.0, cosine: cosine.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::{Step, kernel};
    use hamel_runtime::math;

    #[test]
    fn the_recording_has_the_bits_of_the_runtime() {
        let recording = kernel();
        for angle in [0.0, -0.0, 0.3, -1.0, 2.0, 3.0, 4.5, -77.7, 3e5, f64::MIN_POSITIVE] {
            let mut values: Vec<f64> = Vec::new();
            for step in &recording.steps {
                let value = match *step {
                    Step::Angle => angle,
                    Step::Constant(x) => x,
                    Step::Add(a, b) => values[a] + values[b],
                    Step::Sub(a, b) => values[a] - values[b],
                    Step::Mul(a, b) => values[a] * values[b],
                    Step::Neg(a) => -values[a],
                    Step::MulAdd(a, b, c) => math::mul_add(values[a], values[b], values[c]),
                    Step::TurnedSine(n, s, c) => {
                        math::kernel::Angle::quarter_turns(values[n], values[s], values[c]).0
                    }
                    Step::TurnedCosine(n, s, c) => {
                        math::kernel::Angle::quarter_turns(values[n], values[s], values[c]).1
                    }
                };
                values.push(value);
            }
            let (sine, cosine) = math::sin_cos(angle);
            let found = (values[recording.sine].to_bits(), values[recording.cosine].to_bits());
            assert_eq!(found, (sine.to_bits(), cosine.to_bits()), "{angle}");
        }
    }
}
