//! The articulated-body algorithm for the arm in space as straight-line Rust.
//!
//! Does not know: what is done with the text.

use std::fmt::Write as _;

use super::linkages::articulated::{self, Input, Number, Operation, Origin};
use super::linkages::families::{IIWA, Link};

/// A module with a function `kernels` for arms of these numbers of bodies.
pub(super) fn module(sizes: &[usize]) -> String {
    let mut text = String::from(
        "use hamel_runtime::math::{mul_add, sin_cos};\n\nuse super::kernel;\nuse crate::kernel::Kernel;\n\n",
    );
    let mut kernels = String::new();
    for n in sizes {
        text += &function(&IIWA[..*n]);
        let _ = write!(kernels, "kernel(\"spatial_arm_{n}\", |_| (), rhs_{n}), ");
    }
    text + &format!("pub fn kernels() -> Vec<Kernel> {{\n    vec![{kernels}]\n}}\n")
}

/// The right-hand side, by all angles, the first of which nothing depends on, and their rates.
fn function(links: &[Link]) -> String {
    let n = links.len();
    // Operations do not depend on where they are noted, unless something vanishes there.
    let angles: Vec<f64> = (1..=n).map(|k| 0.3 + 0.1 * k as f64).collect();
    let (accelerations, operations) = articulated::accelerations(links, &angles, &angles);
    let dim = 2 * n;
    let mut text =
        format!("#[inline(never)]\nfn rhs_{n}(_: &(), _: f64, y: &[f64; {dim}], dy: &mut [f64; {dim}]) {{\n");
    for k in 1..n {
        let _ = writeln!(text, "    let (s{k}, c{k}) = sin_cos(y[{k}]);");
    }
    for k in 0..n {
        let _ = writeln!(text, "    let w{k} = y[{}];", n + k);
    }
    let mut n_uses = vec![0; operations.len()];
    let read = operations.iter().flat_map(|o| &o.operands).chain(&accelerations);
    for number in read {
        if let Origin::Operation(k) = number.origin {
            n_uses[k] += 1;
        }
    }
    for (k, operation) in operations.iter().enumerate() {
        let is_product = |number: &Number| match number.origin {
            Origin::Operation(k) if operations[k].op == '*' && n_uses[k] == 1 => Some(operations[k]),
            _ => None,
        };
        let [a, b] = operation.operands;
        let value = match (operation.op, is_product(&a), is_product(&b)) {
            ('+', Some(product), _) => fused(product, a.is_negated, b),
            ('+', None, Some(product)) => fused(product, b.is_negated, a),
            (op, ..) => format!("{} {op} {}", written(a), written(b)),
        };
        // A product that is fused is read by nobody.
        let _ = writeln!(text, "    let t{k} = {value};");
    }
    for k in 0..n {
        let _ = writeln!(text, "    dy[{k}] = w{k};");
    }
    for (k, acceleration) in accelerations.iter().enumerate() {
        let _ = writeln!(text, "    dy[{}] = {};", n + k, written(*acceleration));
    }
    text + "}\n\n"
}

fn fused(product: Operation, is_negated: bool, addend: Number) -> String {
    let [a, b] = product.operands;
    let a = Number { value: -a.value, is_negated: !a.is_negated, ..a };
    let first = if is_negated { a } else { product.operands[0] };
    format!("mul_add({}, {}, {})", written(first), written(b), written(addend))
}

fn written(number: Number) -> String {
    let name = match number.origin {
        Origin::Constant => return format!("({:?})", number.value),
        Origin::Input(Input::Sine, k) => format!("s{k}"),
        Origin::Input(Input::Cosine, k) => format!("c{k}"),
        Origin::Input(Input::Rate, k) => format!("w{k}"),
        Origin::Operation(k) => format!("t{k}"),
    };
    if number.is_negated { format!("(-{name})") } else { name }
}
