use super::*;
use std::collections::BTreeMap;

fn q(n: i64, d: i64) -> Rational {
    Rational::new(n.into(), d.into())
}

struct Fixture {
    g: Graph,
    x: ExprId,
    y: ExprId,
    z: ExprId,
    sx: SymbolId,
}

fn fixture() -> Fixture {
    let mut g = Graph::new();
    let [sx, sy, sz] = ["x", "y", "z"].map(|n| g.symbol(n));
    let (x, y, z) = (g.sym(sx), g.sym(sy), g.sym(sz));
    Fixture { g, x, y, z, sx }
}

#[test]
fn sums_and_products_are_canonical() {
    let Fixture { mut g, x, y, .. } = fixture();
    let (a, b) = (g.add(x, y), g.add(y, x));
    assert_eq!(a, b);
    let (ab, ba) = (g.mul(x, y), g.mul(y, x));
    assert_eq!(ab, ba);
    let zero = g.sub(a, b);
    assert_eq!(zero, g.zero());
    let (x2, one) = (g.powi(x, 2), g.one());
    let inverse = g.powi(x, -2);
    assert_eq!(g.mul(x2, inverse), one);
    let doubled = g.add(x, x);
    let two = g.int(2);
    assert_eq!(doubled, g.mul(two, x));
}

#[test]
fn content_and_sign_leave_powers_of_sums() {
    let Fixture { mut g, x, y, .. } = fixture();
    let d = g.sub(x, y);
    let e = g.sub(y, x);
    let (d2, e2) = (g.powi(d, 2), g.powi(e, 2));
    assert_eq!(d2, e2);
    let scaled = g.scale(d, &q(2, 3));
    let power = g.powi(scaled, -1);
    let plain = g.powi(d, -1);
    assert_eq!(power, g.scale(plain, &q(3, 2)));
}

#[test]
fn square_roots_combine() {
    let Fixture { mut g, x, y, .. } = fixture();
    let s = g.add(x, y);
    let r = g.sqrt(s);
    assert_eq!(g.mul(r, r), s);
    let four = g.int(4);
    assert_eq!(g.sqrt(four), g.int(2));
    let eight = g.int(8);
    let root = g.sqrt(eight);
    assert_eq!(g.mul(root, root), eight);
    let xy = g.mul(x, y);
    let root = g.sqrt(xy);
    assert_eq!(g.mul(root, root), xy);
}

#[test]
fn derivative_of_a_quotient() {
    let Fixture { mut g, x, y, sx, .. } = fixture();
    let e = g.div(y, x).unwrap();
    let d = g.diff(e, sx);
    let x2 = g.powi(x, -2);
    let expected = g.mul(y, x2);
    assert_eq!(d, g.neg(expected));
    assert!(!g.is_zero(d));
}

#[test]
fn trigonometric_identities_vanish() {
    let Fixture { mut g, x, y, .. } = fixture();
    let sum = g.add(x, y);
    let [s, sx, cx, sy, cy] =
        [(Func::Sin, sum), (Func::Sin, x), (Func::Cos, x), (Func::Sin, y), (Func::Cos, y)]
            .map(|(f, a)| g.func(f, a));
    let (a, b) = (g.mul(sx, cy), g.mul(cx, sy));
    let expanded = g.add(a, b);
    assert!(g.is_equal(s, expanded));
    assert!(!g.is_equal(s, a));
}

#[test]
fn roots_of_squares_are_not_cancelled_but_rational_functions_are() {
    let Fixture { mut g, x, y, z, .. } = fixture();
    // 1/x - 1/y = (y - x)/(x y)
    let (xi, yi) = (g.powi(x, -1), g.powi(y, -1));
    let left = g.sub(xi, yi);
    let d = g.sub(y, x);
    let right = g.product(&[d, xi, yi]);
    assert!(g.is_equal(left, right));
    // Lagrange's identity with z as an extra unknown
    let n = g.sum(&[x, y, z]);
    let n2 = g.powi(n, 2);
    let product = g.mul(n, n);
    assert_eq!(n2, product);
    let expanded = g.expand(n2);
    assert_ne!(expanded, n2);
    assert!(g.is_equal(expanded, n2));
}

#[test]
fn division_by_a_hidden_zero_is_refused() {
    let Fixture { mut g, x, .. } = fixture();
    let (s, c) = (g.func(Func::Sin, x), g.func(Func::Cos, x));
    let (s2, c2) = (g.powi(s, 2), g.powi(c, 2));
    let minus_one = g.int(-1);
    let hidden = g.sum(&[s2, c2, minus_one]);
    assert_eq!(g.div(x, hidden), Err(DivisionByZero));
    let zero = g.zero();
    assert_eq!(g.div(x, zero), Err(DivisionByZero));
}

#[test]
fn affine_parts_are_found_or_refused() {
    let Fixture { mut g, x, y, z, sx } = fixture();
    let xy = g.mul(x, y);
    let e = g.add(xy, z);
    assert_eq!(g.affine_parts(e, &[sx]), Some((vec![y], z)));
    let x2 = g.powi(x, 2);
    assert_eq!(g.affine_parts(x2, &[sx]), None);
}

#[test]
fn a_deep_graph_does_not_overflow_the_stack() {
    let Fixture { mut g, x, y, z, sx } = fixture();
    let mut e = x;
    for _ in 0..100_000 {
        let s = g.func(Func::Sin, e);
        e = g.add(s, y);
    }
    let replaced = g.subs(e, &BTreeMap::from([(sx, z)])).unwrap();
    assert_ne!(replaced, e);
    assert_eq!(g.free_symbols(replaced).len(), 2);
    assert!(!g.is_zero(replaced));
    let unrelated = g.symbol("w");
    assert_eq!(g.diff(e, unrelated), g.zero());
}

#[test]
fn decimals_round_as_the_parser_of_doubles_does() {
    let mut state = 12345u64;
    for _ in 0..2000 {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let exponent = (state >> 20) as i64 % 330 - 320;
        let text = format!("{}.{}e{}", state % 10, state >> 12, exponent);
        let expected: f64 = text.parse().unwrap();
        let got = rational_to_f64(&parse_decimal(&text).unwrap());
        assert_eq!(got.to_bits(), expected.to_bits(), "{text}");
    }
    assert_eq!(rational_to_f64(&<Rational as Scalar>::one()), 1.0);
    assert_eq!(rational_to_f64(&q(-1, 3)), -1.0 / 3.0);
    assert_eq!(parse_decimal("1.2.3"), None);
    assert_eq!(parse_decimal("."), None);
}

#[test]
fn the_angle_of_a_point_is_differentiated_and_folds_on_the_axes() {
    let Fixture { mut g, x, y, sx, .. } = fixture();
    // atan2(y, x)' = atan(y/x)' wherever both exist, also along a curve.
    let (u, v) = (g.func(Func::Exp, x), g.mul(x, y));
    let (angle, quotient) = (g.atan2(u, v), g.div(u, v).unwrap());
    let by_quotient = g.func(Func::Atan, quotient);
    let (a, b) = (g.diff(angle, sx), g.diff(by_quotient, sx));
    assert!(a != g.zero() && g.is_equal(a, b));
    for (operand, partial) in g.partials(angle, angle) {
        let expected = g.atan2_derivatives(u, v).expect("not both are zero")[usize::from(operand == v)];
        assert_eq!(partial, expected);
    }
    let (zero, one, pi) = (g.zero(), g.one(), g.pi());
    let (minus, half) = (g.int(-3), g.scale(pi, &q(1, 2)));
    assert_eq!(g.atan2(zero, one), zero);
    assert_eq!(g.atan2(zero, minus), pi);
    assert_eq!(g.atan2(one, zero), half);
    assert_eq!(g.atan2(minus, zero), g.neg(half));
    let values = BTreeMap::from([(sx, -2.0)]);
    let of_x = g.atan2(one, x);
    assert_eq!(g.eval_f64(of_x, &values), Some(1.0_f64.atan2(-2.0)));
    assert_eq!(g.display(of_x, Style::Unicode), "atan2(1, x)");
    assert_eq!(g.display(of_x, Style::Latex), "\\operatorname{atan2}\\left(1,\\, x\\right)");
    let mathml = g.display(of_x, Style::MathMl);
    assert!(mathml.contains("<mi>atan2</mi>") && mathml.contains("<mo>,</mo>"), "{mathml}");
    // The sign of y, away from the cut.
    let facts = BTreeMap::from([(y, Sign::Positive)]);
    let (above, minus_y) = (g.atan2(y, x), g.neg(y));
    assert_eq!(sign_of(&g, above, &facts), Sign::Positive);
    let below = g.atan2(minus_y, x);
    assert_eq!(sign_of(&g, below, &facts), Sign::Negative);
    let anywhere = g.atan2(x, y);
    assert_eq!(sign_of(&g, anywhere, &facts), Sign::Unknown);
}

#[test]
fn text_reads_like_a_paper() {
    let mut g = Graph::new();
    let (i, o) = (g.symbol("I1"), g.symbol("Omega1"));
    let (i, o) = (g.sym(i), g.sym(o));
    let o2 = g.powi(o, 2);
    let half = g.rational(q(1, 2));
    let e = g.product(&[half, i, o2]);
    assert_eq!(g.display(e, Style::Unicode), "½ I₁ Ω₁²");
    assert_eq!(g.display(e, Style::Plain), "1/2*I1*Omega1^2");
    assert_eq!(g.display(e, Style::Latex), "\\tfrac{1}{2}\\, I_{1}\\, \\Omega_{1}^{2}");
    let td = g.symbol("theta_dot");
    let td = g.sym(td);
    let sum = g.sub(o, td);
    let quotient = g.div(e, sum).unwrap();
    assert_eq!(g.display(quotient, Style::Unicode), "I₁ Ω₁²/(2 (Ω₁ - θ̇))");
    let inverse = g.powi(o, -2);
    let three = g.int(3);
    let tripled = g.mul(three, inverse);
    let fractions = g.add(tripled, td);
    assert_eq!(g.display(fractions, Style::Unicode), "θ\u{307} + 3/Ω₁²");
    let names = ["p_Omega1", "dot_Gamma2", "A_Omega1_Omega2"].map(|n| print::identifier(n, Style::Unicode));
    assert_eq!(names, ["p_Ω₁", "Γ\u{307}₂", "A_Ω₁,Ω₂"]);
    let dots = ["theta_dot", "p_psi_dot", "dot_psi_dot"].map(|n| print::identifier(n, Style::Unicode));
    assert_eq!(dots, ["θ\u{307}", "p_ψ\u{307}", "ψ\u{308}"]);
    assert_eq!(print::identifier("p_Omega1", Style::Latex), "p_{\\Omega_{1}}");
}

#[test]
fn what_was_found_constant_in_a_trial_that_was_given_up_is_asked_again() {
    let Fixture { mut g, x, sx, .. } = fixture();
    let a = g.symbol("a");
    let a = g.sym(a);
    let writer = SectionWriter::new(&g, [sx].into(), &[]);
    let before = g.clone();
    let constant = g.powi(a, 5);
    assert!(!writer.varies(&g, constant));
    // The same number stands for another expression now.
    let mut g = before;
    let varying = g.powi(x, 5);
    assert_eq!(varying, constant);
    assert!(writer.varies(&g, varying));
}

#[test]
fn partial_derivatives_that_are_kept_are_the_ones_that_are_made_anew() {
    let mut g = Graph::new();
    let symbols = ["x", "y"].map(|name| g.symbol(name));
    let [x, y] = symbols.map(|s| g.sym(s));
    let mut partials = Partials::default();
    let mut sum = g.mul(x, y);
    for k in 1..6 {
        let angle = g.func(Func::Sin, sum);
        let scaled = g.scale(y, &Rational::from_integer(k.into()));
        let product = g.mul(angle, scaled);
        sum = g.add(product, x);
        for s in symbols {
            let anew = g.diff(sum, s);
            assert_eq!(partials.diff(&mut g, sum, s), anew);
        }
    }
    // Nothing known is visited again.
    let spent = g.spent().work;
    for s in symbols {
        partials.diff(&mut g, sum, s);
    }
    assert_eq!(g.spent().work, spent);
}

#[test]
fn powers_of_absolute_values_have_slopes_at_zero() {
    let Fixture { mut g, x, y, sx, .. } = fixture();
    let two_x = g.scale(x, &Rational::from_integer(2.into()));
    let difference = g.sub(two_x, y);
    for (argument, inner) in [(x, 1), (two_x, 2), (difference, 2)] {
        let magnitude = g.func(Func::Abs, argument);
        let square = g.powi(magnitude, 2);
        assert_eq!(square, g.powi(argument, 2));
        let cube = g.powi(magnitude, 3);
        // (|a|^3)' = 3 |a| a a'.
        let product = g.mul(magnitude, argument);
        let expected = g.scale(product, &Rational::from_integer((3 * inner).into()));
        assert_eq!(g.diff(cube, sx), expected);
        // A sign stays one.
        let sign = g.div(magnitude, argument).unwrap();
        assert_eq!(g.mul(sign, sign), g.one());
        assert_eq!(g.mul(sign, argument), magnitude);
    }
}
