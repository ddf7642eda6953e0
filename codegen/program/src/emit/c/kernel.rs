//! What the C of every module calls: the runtime's sine and cosine, its fused product and its sums over tables.
//!
//! The operations of sine and cosine are recorded from the runtime's own source, so that the bits are the same.
//! Deliberately does not know: modules, models, what calls them.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::ops::{Add, Mul, Neg, Sub};

use hamel_runtime::math::kernel::{Angle, BOUND, reduced};

use super::single::Precision;
use crate::emit::literal::number;

/// The functions by name.
pub(super) const MUL_ADD: &str = "hamel_fma";
pub(super) const SUM_ERROR: &str = "hamel_sum_error";
pub(super) const PRODUCT_ERROR: &str = "hamel_product_error";
pub(super) const CIRCLE_ERROR: &str = "hamel_circle_error";
pub(super) const SIN: &str = "hamel_sin";
pub(super) const COS: &str = "hamel_cos";
pub(super) const SIN_COS: &str = "hamel_sin_cos";
pub(super) const STUMPFF: &str = "hamel_stumpff";
pub(super) const TURN: &str = "hamel_turn";
pub(super) const ADD_PRODUCTS: &str = "hamel_add_products";

thread_local! {
    static STATEMENTS: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// A variable that writes down what is done with it.
#[derive(Clone, Copy)]
struct Recorded(usize);

fn name(k: usize) -> String {
    if k == 0 { "x".to_owned() } else { format!("k{k}") }
}

/// Records the value of the next variable.
fn record(value: String) -> Recorded {
    STATEMENTS.with_borrow_mut(|statements| {
        statements.push(value);
        Recorded(statements.len())
    })
}

impl Recorded {
    fn operation(self, sign: &str, other: Recorded) -> Recorded {
        record(format!("{} {sign} {}", name(self.0), name(other.0)))
    }
}

impl Add for Recorded {
    type Output = Recorded;
    fn add(self, other: Recorded) -> Recorded {
        self.operation("+", other)
    }
}

impl Sub for Recorded {
    type Output = Recorded;
    fn sub(self, other: Recorded) -> Recorded {
        self.operation("-", other)
    }
}

impl Mul for Recorded {
    type Output = Recorded;
    fn mul(self, other: Recorded) -> Recorded {
        self.operation("*", other)
    }
}

impl Neg for Recorded {
    type Output = Recorded;
    fn neg(self) -> Recorded {
        record(format!("-{}", name(self.0)))
    }
}

impl Angle for Recorded {
    fn splat(x: f64) -> Recorded {
        record(number(x))
    }
    fn mul_add(self, factor: Recorded, addend: Recorded) -> Recorded {
        record(format!("{MUL_ADD}({}, {}, {})", name(self.0), name(factor.0), name(addend.0)))
    }
    fn quarter_turns(self, sine: Recorded, cosine: Recorded) -> (Recorded, Recorded) {
        let [turns, sine, cosine] = [self, sine, cosine].map(|of| name(of.0));
        let turned = |this: &str, other: &str, sign: usize| {
            record(format!("({turns}_bits & 1 ? {other} : {this}) * signs[({turns}_bits & 3) + {sign}]"))
        };
        record(format!("bits of {turns}"));
        (turned(&sine, &cosine, 0), turned(&cosine, &sine, 1))
    }
}

/// The pair of sine and cosine.
fn sin_cos() -> String {
    STATEMENTS.with_borrow_mut(Vec::clear);
    let (sine, cosine) = reduced(Recorded(0));
    let mut body = String::new();
    for (k, value) in (1..).zip(STATEMENTS.take()) {
        match value.strip_prefix("bits of ") {
            Some(of) => {
                let _ = write!(
                    body,
                    "    uint64_t {of}_bits;\n    memcpy(&{of}_bits, &{of}, sizeof {of}_bits);\n"
                );
            }
            None => {
                let _ = writeln!(body, "    const double {} = {value};", name(k));
            }
        }
    }
    format!(
        "/* Sine and cosine of an angle in radians, up to 0.8 units in the last place: the operations of \
         hamel_runtime::math. */\n\
         static void {SIN_COS}(double x, double *sine, double *cosine) {{\n    \
             static const double signs[5] = {{1.0, 1.0, -1.0, -1.0, 1.0}};\n    \
             if (fabs(x) > {bound}) {{\n        \
                 *sine = sin(x);\n        *cosine = cos(x);\n        return;\n    }}\n\
         {body}    *sine = {};\n    *cosine = {};\n}}\n",
        name(sine.0),
        name(cosine.0),
        bound = number(BOUND),
    )
}

const FUSED: &str = "\
/* x * y + z: one instruction that rounds once where the target has it, else two that round twice, as Rust does. */
static inline double hamel_fma(double x, double y, double z) {
#if defined(__FMA__) || defined(__aarch64__)
    return fma(x, y, z);
#else
    return x * y + z;
#endif
}
";

const ERROR_OF_SUM: &str = "\
/* x + y less its rounded value: the operations of hamel_runtime's Real::sum_error. */
static inline double hamel_sum_error(double x, double y) {
    const double sum = x + y, part = sum - x;
    return (x - (sum - part)) + (y - part);
}
";

const ERROR_OF_PRODUCT: &str = "\
/* x * y less its rounded value: the operations of hamel_runtime's Real::product_error. */
static inline double hamel_product_error(double x, double y) {
    const double product = x * y;
    uint64_t bits[2];
    double a, c, b, d, sum, term;
    memcpy(&bits[0], &x, sizeof x);
    memcpy(&bits[1], &y, sizeof y);
    bits[0] &= ~UINT64_C(0x7ffffff);
    bits[1] &= ~UINT64_C(0x7ffffff);
    memcpy(&a, &bits[0], sizeof a);
    memcpy(&c, &bits[1], sizeof c);
    b = x - a;
    d = y - c;
    /* One operation a statement: a compiler that fuses those of one expression gets other bits. */
    sum = a * c;
    sum = sum - product;
    term = a * d;
    sum = sum + term;
    term = b * c;
    sum = sum + term;
    term = b * d;
    return sum + term;
}
";

/// On `double`, as `single` takes it.
const SINGLE_SINE_AND_COSINE: &str = "\
static inline void hamel_sin_cos(double x, double *sine, double *cosine) {
    *sine = sin(x);
    *cosine = cos(x);
}
";

const ERROR_OF_CIRCLE: &str = "\
/* (1 - sine^2 - cosine^2)/2: the operations of hamel_runtime's Real::circle_error. */
static inline double hamel_circle_error(double sine, double cosine) {
    const double p = sine * sine, q = cosine * cosine;
    const double first = 1.0 - q;
    const double rest = hamel_sum_error(1.0, -q) + hamel_sum_error(first, -p);
    const double errors = hamel_product_error(sine, sine) + hamel_product_error(cosine, cosine);
    const double difference = first - p, more = rest - errors;
    return (difference + more) * 0.5;
}
";

const SINE: &str = "\
static inline double hamel_sin(double x) {
    double sine, cosine;
    hamel_sin_cos(x, &sine, &cosine);
    return sine;
}
";

const COSINE: &str = "\
static inline double hamel_cos(double x) {
    double sine, cosine;
    hamel_sin_cos(x, &sine, &cosine);
    return cosine;
}
";

const STUMPFF_FUNCTION: &str = "\
/* c_k(z) = sum_j (-z)^j/(2 j + k)!: the operations of hamel_runtime's Real::stumpff. */
static double hamel_stumpff(int k, double z) {
    if (!(fabs(z) > (double)((k + 1) * (k + 2)) * 0.5)) {
        const int n = fabs(z) > 1.0 ? 24 + k / 2 : 12;
        double sum = 1.0, factorial = 1.0;
        for (int j = n - 1; j >= 0; j--) {
            const int first = k + 2 * j + 1;
            sum = 1.0 - z * sum / (double)(first * (first + 1));
        }
        for (int m = 2; m <= k; m++) factorial *= (double)m;
        return sum / factorial;
    }
    const int circular = z > 0.0;
    const double x = circular ? sqrt(z) : sqrt(-z);
    int m = k % 2 == 1 ? 1 : 2;
    double c;
    if (k == 0) return circular ? hamel_cos(x) : cosh(x);
    if (m == 1) {
        c = circular ? hamel_sin(x) / x : sinh(x) / x;
    } else {
        const double sine = circular ? hamel_sin(x * 0.5) / x : sinh(x * 0.5) / x;
        c = sine * sine * 2.0;
    }
    double factorial = (double)m;
    for (; m < k; m += 2) {
        if (m > 2) factorial = factorial * (double)(m - 1) * (double)m;
        c = (1.0 / factorial - c) / z;
    }
    return c;
}
";

const TURN_FUNCTION: &str = "\
/* Coefficient k of the power series about w of theta/sin(theta), w = sin(theta/2)^2: the operations of hamel_runtime's
   Real::turn. */
static double hamel_turn(int k, double w) {
    double sum = 1.0;
    if (!(w >= -0.125)) return NAN;
    if (k > 0 && !(w > 0.5)) {
        const int n = fabs(w) > 0.125 ? 56 + 4 * k : 19 + k;
        for (int j = n - 1; j >= 0; j--) {
            const int m = j + k + 1;
            sum = 1.0 + w * sum * (double)(2 * m * m) / (double)((j + 1) * (2 * m + 1));
        }
        for (int m = 1; m <= k; m++) sum = sum * (double)(2 * m) / (double)(2 * m + 1);
        return sum;
    }
    double cosines = 1.0, half = w;
    while (fabs(half) > 0.04) {
        const double cosine = sqrt(1.0 - half);
        cosines = cosines * cosine;
        half = half / (2.0 * (1.0 + cosine));
    }
    for (int j = 11; j >= 0; j--) {
        sum = 1.0 + half * sum * (double)(2 * j + 2) / (double)(2 * j + 3);
    }
    double before = sum / cosines;
    if (k == 0) return before;
    const double divisor = 2.0 * w * (1.0 - w), slope = 2.0 * w - 1.0;
    double own = (1.0 + slope * before) / divisor;
    for (int m = 1; m < k; m++) {
        const double next = ((double)(2 * m) * before + (double)(2 * m + 1) * slope * own) / (divisor * (double)(m + 1));
        before = own;
        own = next;
    }
    return own;
}
";

const PRODUCTS: &str = "\
/* out_k += sum over the products of k of number * left_i * right_j, in four sums a result, as hamel_runtime::Products.
   places: left factor, right factor and number of each product; ends: products up to and with those of a result. */
static void hamel_add_products(const uint16_t (*places)[3], const uint32_t *ends, size_t n_results,
                               const double *numbers, const double *left, const double *right, double *out) {
    size_t at = 0;
    for (size_t k = 0; k < n_results; k++) {
        double sums[4] = {0.0, 0.0, 0.0, 0.0};
        for (size_t n = 0; at < ends[k]; n++, at++) {
            const uint16_t *place = places[at];
            sums[n % 4] = hamel_fma(numbers[place[2]] * left[place[0]], right[place[1]], sums[n % 4]);
        }
        out[k] += (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }
}
";

/// The functions that a text on `double` calls, with what they call, for a module of some precision.
pub(super) fn functions(text: &str, precision: Precision) -> String {
    let calls = |text: &str, name: &str| text.contains(&format!("{name}("));
    let mut functions: Vec<String> = Vec::new();
    let stumpff = calls(text, STUMPFF);
    let (sine, cosine) = (stumpff || calls(text, SIN), stumpff || calls(text, COS));
    let products = calls(text, ADD_PRODUCTS);
    let pair = sine || cosine || calls(text, SIN_COS);
    if pair || products || calls(text, MUL_ADD) {
        functions.push(FUSED.to_owned());
    }
    let circle = calls(text, CIRCLE_ERROR);
    functions.extend((circle || calls(text, SUM_ERROR)).then(|| ERROR_OF_SUM.to_owned()));
    let of_product = match precision {
        Precision::Double => ERROR_OF_PRODUCT.to_owned(),
        Precision::Single => {
            ERROR_OF_PRODUCT.replace("uint64_t", "uint32_t").replace("UINT64_C(0x7ffffff)", "UINT32_C(0xfff)")
        }
    };
    functions.extend((circle || calls(text, PRODUCT_ERROR)).then_some(of_product));
    functions.extend(circle.then(|| ERROR_OF_CIRCLE.to_owned()));
    if pair {
        functions.push(match precision {
            Precision::Double => sin_cos(),
            Precision::Single => SINGLE_SINE_AND_COSINE.to_owned(),
        });
    }
    functions.extend(sine.then(|| SINE.to_owned()));
    functions.extend(cosine.then(|| COSINE.to_owned()));
    functions.extend(stumpff.then(|| STUMPFF_FUNCTION.to_owned()));
    functions.extend(calls(text, TURN).then(|| TURN_FUNCTION.to_owned()));
    functions.extend(products.then(|| PRODUCTS.to_owned()));
    functions.join("\n")
}
