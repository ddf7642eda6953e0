use std::collections::BTreeMap;

use num_traits::One;

use hamel_codegen::error::Error;
use hamel_expr::{Definition, ExprId, Func, Graph, Node, Number, Rational, Scalar, Section, Sign, SymbolId};
use hamel_program::lower::*;
use hamel_program::program::{
    Constant, Counts, Factors, FallBack, Limit, Literal, Op, Operand, Point, Program, Relation, Role, Signs,
    Table, completes_pair, place_of_two, verify,
};

fn q(n: i64, d: i64) -> Rational {
    Rational::new(n.into(), d.into())
}

/// Three parameters, time, three components of the state.
struct Fixture {
    g: Graph,
    inputs: Inputs,
    p: [ExprId; 3],
    t: ExprId,
    x: [ExprId; 3],
}

fn fixture() -> Fixture {
    let mut g = Graph::new();
    let params = ["a", "b", "c"].map(|n| g.symbol(n));
    let time = g.symbol("t");
    let state = ["x", "y", "z"].map(|n| g.symbol(n));
    let (p, t, x) = (params.map(|s| g.sym(s)), g.sym(time), state.map(|s| g.sym(s)));
    Fixture {
        g,
        inputs: Inputs {
            params: params.to_vec(),
            time,
            held: Vec::new(),
            state: state.to_vec(),
            signs: BTreeMap::new(),
            arguments: BTreeMap::new(),
            divisors: Default::default(),
            sampling: None,
            circles: vec![],
        },
        p,
        t,
        x,
    }
}

impl Fixture {
    fn lower(&mut self, results: &[ExprId]) -> Program {
        let request = request("f", results);
        lower(&mut self.g, &self.inputs, &[], &[], &[request], &SearchBudget::default()).unwrap()
    }

    /// Runs the first function at fixed numbers.
    fn run(&self, program: &Program) -> Vec<f64> {
        let prepared = program.prepare(&PARAMS).unwrap();
        let mut out = vec![0.0; program.functions[0].results.len()];
        program.run(0, &PARAMS, &prepared, TIME, &STATE, &mut out);
        out
    }

    fn values(&self) -> BTreeMap<SymbolId, f64> {
        let params = self.inputs.params.iter().copied().zip(PARAMS);
        params.chain([(self.inputs.time, TIME)]).chain(self.inputs.state.iter().copied().zip(STATE)).collect()
    }
}

const PARAMS: [f64; 3] = [1.3, 0.7, 2.1];
const TIME: f64 = 0.4;
const STATE: [f64; 3] = [0.9, 1.6, 0.35];

fn request(name: &str, results: &[ExprId]) -> Request {
    Request {
        role: Role::Output(name.to_owned()),
        results: results.iter().enumerate().map(|(k, e)| (format!("r{k}"), *e)).collect(),
    }
}

#[test]
fn parameter_only_differences_are_exposed_and_hoisted() {
    // b y z - c y z = (b - c) y z: two multiplications a call.
    let Fixture { mut g, inputs, p: [_, b, c], x: [_, y, z], .. } = fixture();
    let (first, second) = (g.product(&[b, y, z]), g.product(&[c, y, z]));
    let e = g.sub(first, second);
    let program = lower(&mut g, &inputs, &[], &[], &[request("f", &[e])], &SearchBudget::default()).unwrap();
    assert_eq!(program.functions[0].counts(), Counts { mul: 2, ..Counts::default() });
    assert_eq!(program.prepare.counts(), Counts { add: 1, ..Counts::default() });
    assert_eq!(program.prepare.slots.len(), 1);
}

#[test]
fn signs_travel_outwards() {
    // -x + a - y z: no negation; -(x + y) needs one.
    let mut f = fixture();
    let yz = f.g.mul(f.x[1], f.x[2]);
    let (minus_x, minus_yz) = (f.g.neg(f.x[0]), f.g.neg(yz));
    let e = f.g.sum(&[minus_x, f.p[0], minus_yz]);
    assert_eq!(f.lower(&[e]).functions[0].counts(), Counts { add: 2, mul: 1, fma: 1, ..Counts::default() });
    let minus_y = f.g.neg(f.x[1]);
    let e = f.g.add(minus_x, minus_y);
    assert_eq!(f.lower(&[e]).functions[0].counts(), Counts { add: 1, neg: 1, ..Counts::default() });
}

#[test]
fn equal_coefficients_are_taken_out() {
    // x/2 - y/2 = (x - y)/2
    let mut f = fixture();
    let d = f.g.sub(f.x[0], f.x[1]);
    let e = f.g.scale(d, &q(1, 2));
    assert_eq!(f.lower(&[e]).functions[0].counts(), Counts { add: 1, mul: 1, ..Counts::default() });
}

#[test]
fn one_division_serves_all_quotients_by_the_same_denominator() {
    let mut f = fixture();
    let d = f.g.add(f.x[0], f.p[0]);
    let quotients = f.x.map(|x| f.g.div(x, d).unwrap());
    let counts = f.lower(&quotients).functions[0].counts();
    assert_eq!((counts.div, counts.mul), (1, 3));
    let counts = f.lower(&quotients[..1]).functions[0].counts();
    assert_eq!((counts.div, counts.mul), (1, 0));
    // x/(d e) once, y/d and z/e once each: two reciprocals instead of three divisions.
    let e = f.g.add(f.x[1], f.p[1]);
    let de = f.g.mul(d, e);
    let mixed = [f.g.div(f.x[0], de).unwrap(), f.g.div(f.x[1], d).unwrap(), f.g.div(f.x[2], e).unwrap()];
    assert_eq!(f.lower(&mixed).functions[0].counts().div, 2);
}

#[test]
fn division_by_parameters_is_hoisted() {
    let mut f = fixture();
    let e = f.g.div(f.x[0], f.p[0]).unwrap();
    let program = f.lower(&[e]);
    assert_eq!(program.functions[0].counts(), Counts { mul: 1, ..Counts::default() });
    assert_eq!(program.prepare.counts().div, 1);
}

#[test]
fn powers_are_multiplication_chains_and_roots() {
    let mut f = fixture();
    let x7 = f.g.powi(f.x[0], 7);
    assert_eq!(f.lower(&[x7]).functions[0].counts(), Counts { mul: 4, ..Counts::default() });
    let e = f.g.pow(f.x[0], &q(-3, 2)).unwrap();
    let counts = f.lower(&[e]).functions[0].counts();
    assert_eq!((counts.mul, counts.sqrt, counts.div), (1, 1, 1));
    let e = f.g.pow(f.x[0], &q(4, 3)).unwrap();
    let program = f.lower(&[e]);
    assert!((f.run(&program)[0] - STATE[0].powf(4.0 / 3.0)).abs() < 1e-15);
    let quarter = f.g.pow(f.x[0], &q(3, 4)).unwrap();
    let program = f.lower(&[quarter]);
    assert!((f.run(&program)[0] - STATE[0].powf(0.75)).abs() < 1e-15);
}

#[test]
fn definitions_keep_names_and_unneeded_ones_are_left_out() {
    let mut f = fixture();
    let p_expr = f.g.mul(f.p[0], f.x[0]);
    let p = f.g.define("p", p_expr);
    let unused_expr = f.g.mul(f.p[0], f.x[1]);
    let unused = f.g.define("unused", unused_expr);
    let ratio_expr = f.g.div(f.p[0], f.p[1]).unwrap();
    let ratio = f.g.define("ratio", ratio_expr);
    let sections = [
        Section {
            title: "momenta".into(),
            definitions: vec![
                Definition { symbol: p, expr: p_expr },
                Definition { symbol: unused, expr: unused_expr },
            ],
        },
        Section {
            title: "numbers".into(),
            definitions: vec![Definition { symbol: ratio, expr: ratio_expr }],
        },
    ];
    let (p, ratio) = (f.g.sym(p), f.g.sym(ratio));
    // What a function is applied to stays a value of its own.
    let exponential = f.g.func(Func::Exp, p);
    let e = f.g.mul(exponential, ratio);
    let program =
        lower(&mut f.g, &f.inputs, &sections, &[], &[request("f", &[e])], &SearchBudget::default()).unwrap();
    let names: Vec<_> = program.functions[0].instructions.iter().filter_map(|i| i.name.as_deref()).collect();
    assert_eq!(names, ["p"]);
    assert_eq!(program.sections, ["momenta", "numbers", "results"]);
    assert_eq!(program.prepare.slots[0].name.as_deref(), Some("ratio"));
    assert_eq!(program.functions[0].counts_of_section(0).mul, 1);
    assert_eq!(program.functions[0].counts_of_section(2).mul, 1);
}

#[test]
fn values_are_shared_between_functions_and_constants_folded_into_slots() {
    let mut f = fixture();
    let half = f.g.rational(q(1, 2));
    let energy = f.g.product(&[half, f.p[0], f.x[0], f.x[0]]);
    let power = f.g.product(&[half, f.p[0], f.x[0], f.t]);
    let requests = [request("energy", &[energy]), request("power", &[power])];
    let program = lower(&mut f.g, &f.inputs, &[], &[], &requests, &SearchBudget::default()).unwrap();
    assert_eq!(program.prepare.slots.len(), 1);
    assert_eq!(program.function_idx(&requests[1].role), Some(1));
}

#[test]
fn factoring_never_costs() {
    // x y is shared by three sums; taking x out of the first would compute it apart.
    let mut f = fixture();
    let [x, y, z] = f.x;
    let xy = f.g.mul(x, y);
    let xz = f.g.mul(x, z);
    let yz = f.g.mul(y, z);
    let results = [f.g.add(xy, xz), f.g.add(xy, yz), f.g.add(xz, yz)];
    assert!(f.lower(&results).functions[0].counts().cost() <= 6);
}

#[test]
fn parameter_only_factors_meet_across_definitions_used_once() {
    // p = a x y, q = p/b: one number a/b; with p as a result of the same function it stays apart.
    let mut f = fixture();
    let p_expr = f.g.product(&[f.p[0], f.x[0], f.x[1]]);
    let p = f.g.define("p", p_expr);
    let p_symbol = f.g.sym(p);
    let sections =
        [Section { title: "momentum".into(), definitions: vec![Definition { symbol: p, expr: p_expr }] }];
    let q = f.g.div(p_symbol, f.p[1]).unwrap();
    let once =
        lower(&mut f.g, &f.inputs, &sections, &[], &[request("f", &[q])], &SearchBudget::default()).unwrap();
    assert_eq!(once.functions[0].counts().mul, 2);
    assert_eq!(f.run(&once), [PARAMS[0] / PARAMS[1] * (STATE[0] * STATE[1])]);
    let twice =
        lower(&mut f.g, &f.inputs, &sections, &[], &[request("f", &[q, p_symbol])], &SearchBudget::default())
            .unwrap();
    assert_eq!(twice.functions[0].counts().mul, 3);
    // s = a x + b y, r = s/c: two numbers a/c and b/c.
    let (ax, by) = (f.g.mul(f.p[0], f.x[0]), f.g.mul(f.p[1], f.x[1]));
    let s = f.g.add(ax, by);
    let r = f.g.div(s, f.p[2]).unwrap();
    assert_eq!(f.lower(&[r]).functions[0].counts(), Counts { add: 1, mul: 2, fma: 1, ..Counts::default() });
}

#[test]
fn conditions_are_checked_in_prepare() {
    let mut f = fixture();
    let conditions = [ParamCondition {
        text: "a > b".into(),
        meaning: String::new(),
        greater: f.p[0],
        less: f.p[1],
        relation: Relation::Greater,
        is_rounded: false,
    }];
    let e = f.x[0];
    let program =
        lower(&mut f.g, &f.inputs, &[], &conditions, &[request("f", &[e])], &SearchBudget::default())
            .unwrap();
    assert_eq!(program.prepare(&[2.0, 1.0, 0.0]), Ok(vec![]));
    assert_eq!(program.prepare(&[1.0, 1.0, 0.0]).unwrap_err().condition, "a > b");
    assert_eq!(program.prepare(&[1.0, 0.0, f64::NAN]).unwrap_err().condition, "c is finite");
    let wrong = [ParamCondition { greater: f.x[0], ..conditions[0].clone() }];
    let refused = lower(&mut f.g, &f.inputs, &[], &wrong, &[request("f", &[e])], &SearchBudget::default());
    assert!(matches!(refused, Err(Error::Program { .. })));
}

#[test]
fn malformed_programs_are_refused() {
    let mut f = fixture();
    let e = f.g.mul(f.x[0], f.x[1]);
    let program = f.lower(&[e]);
    assert_eq!(verify(&program), Ok(()));
    let broken = |change: &dyn Fn(&mut Program)| {
        let mut program = program.clone();
        change(&mut program);
        verify(&program).is_err()
    };
    assert!(broken(&|p| p.functions[0].instructions[0].op = Op::Neg(Operand::Value(0))));
    assert!(broken(&|p| p.functions[0].instructions[0].op = Op::Neg(Operand::Param(0))));
    assert!(broken(&|p| p.functions[0].instructions[0].op = Op::Neg(Operand::State(3))));
    assert!(broken(&|p| p.functions[0].results[0].1 = Operand::Time));
    assert!(broken(&|p| p.functions[0].instructions[0].section = 1));
}

#[test]
fn deep_expressions_do_not_overflow_the_stack() {
    let mut f = fixture();
    let mut e = f.x[0];
    for k in 0..20_000 {
        e = if k % 2 == 0 { f.g.func(Func::Sin, e) } else { f.g.add(e, f.x[1]) };
    }
    let program = f.lower(&[e]);
    assert_eq!(program.functions[0].instructions.len(), 20_000);
}

/// The value at fixed numbers and back as an expression.
fn check(f: &mut Fixture, program: &Program, expected: &[ExprId]) {
    let (values, found) = (f.values(), f.run(program));
    let back = program.to_expressions(&mut f.g, f.inputs.symbols()).unwrap().remove(0);
    for ((e, back), found) in expected.iter().zip(back).zip(found) {
        assert!(f.g.is_equal(*e, back));
        let expected = f.g.eval_f64(*e, &values).unwrap();
        assert!(
            (found - expected).abs() <= 4.0 * f64::EPSILON * expected.abs().max(1.0),
            "{found} {expected}"
        );
    }
}

#[test]
fn sums_of_products_are_fused_from_the_term_that_is_no_product() {
    // a x + b y + c z + t: three fused operations; without t one product stays.
    let mut f = fixture();
    let products: Vec<ExprId> = f.p.into_iter().zip(f.x).map(|(p, x)| f.g.mul(p, x)).collect();
    let bare = f.g.sum(&products);
    let e = f.g.add(bare, f.t);
    for (e, fma, mul, add) in [(e, 3, 3, 3), (bare, 2, 3, 2)] {
        let program = f.lower(&[e]);
        assert_eq!(program.functions[0].counts(), Counts { add, mul, fma, ..Counts::default() });
        assert_eq!(program.cost(), 3);
        check(&mut f, &program, &[e]);
    }
}

#[test]
fn a_product_that_two_sums_take_up_is_no_value_and_one_that_is_used_otherwise_stays() {
    let mut f = fixture();
    let [x, y, z] = f.x;
    let xy = f.g.mul(x, y);
    let sums = [f.g.add(xy, z), f.g.sub(f.t, xy)];
    let program = f.lower(&sums);
    assert_eq!(program.functions[0].counts(), Counts { add: 2, mul: 2, fma: 2, ..Counts::default() });
    check(&mut f, &program, &sums);
    let results = [sums[0], sums[1], xy];
    let program = f.lower(&results);
    assert_eq!(program.functions[0].counts(), Counts { add: 2, mul: 1, ..Counts::default() });
    check(&mut f, &program, &results);
}

#[test]
fn late_terms_are_added_last() {
    // sin(x) y + a z + b x: the sine comes last, whatever the order of the terms.
    let mut f = fixture();
    let [x, y, z] = f.x;
    let sine = f.g.func(Func::Sin, x);
    let terms = [f.g.mul(sine, y), f.g.mul(f.p[0], z), f.g.mul(f.p[1], x)];
    let e = f.g.sum(&terms);
    let program = f.lower(&[e]);
    let instructions = &program.functions[0].instructions;
    let sine = instructions.iter().position(|i| matches!(i.op, Op::Function(..))).unwrap() as u32;
    let last = instructions.last().unwrap().op;
    assert!(matches!(last, Op::MulAdd(..)) && last.operands().any(|o| o == Operand::Value(sine)), "{last:?}");
    check(&mut f, &program, &[e]);
}

#[test]
fn signs_cost_nothing_where_a_sum_a_constant_or_a_slot_takes_them() {
    let mut f = fixture();
    let [x, y, z] = f.x;
    let (xy, difference) = (f.g.mul(x, y), f.g.sub(x, y));
    let sum = f.g.add(xy, z);
    let (scaled, slot) = (f.g.scale(xy, &q(1, 3)), f.g.product(&[f.p[0], f.p[1], x]));
    let shifted = f.g.add(x, f.p[0]);
    let quotient = f.g.div(difference, shifted).unwrap();
    for positive in [difference, sum, scaled, slot, shifted, quotient] {
        let e = f.g.neg(positive);
        let program = f.lower(&[e]);
        assert_eq!(program.functions[0].counts().neg, 0, "{:?}", program.functions[0]);
        check(&mut f, &program, &[e]);
    }
    // Everything else that reads the quotient takes the other sign: through a product with a number, too.
    let (squares, scaled) = (f.g.mul(y, y), f.g.mul(z, z));
    let scaled = f.g.mul(f.p[0], scaled);
    let denominator = f.g.add(squares, scaled);
    let quotient = f.g.div(x, denominator).unwrap();
    let e = [f.g.neg(quotient), f.g.product(&[f.p[1], z, quotient]), f.g.product(&[quotient, quotient])];
    let program = f.lower(&e);
    assert_eq!(program.functions[0].counts().neg, 0, "{:?}", program.functions[0]);
    check(&mut f, &program, &e);
    // Both signs are wanted: the product is negated once.
    let e = [xy, f.g.neg(xy)];
    let program = f.lower(&e);
    assert_eq!(program.functions[0].counts(), Counts { mul: 1, neg: 1, ..Counts::default() });
    check(&mut f, &program, &e);
}

#[test]
fn numbers_of_components_stand_side_by_side_and_products_of_them_are_added() {
    // ab y z - aa x, bc z x - bb y, ca x y - cc z: one shape, six prepared numbers.
    let mut f = fixture();
    let ([a, b, c], [x, y, z]) = (f.p, f.x);
    let component = |g: &mut Graph, [p, q, x, y, z]: [ExprId; 5]| {
        let (first, second) = (g.product(&[p, q, y, z]), g.product(&[p, p, x]));
        g.sub(first, second)
    };
    let e = [[a, b, x, y, z], [b, c, y, z, x], [c, a, z, x, y]].map(|operands| component(&mut f.g, operands));
    let program = f.lower(&e);
    let function = &program.functions[0];
    assert_eq!(program.prepare.slots.len(), 6);
    let mut read: Vec<[u32; 2]> = Vec::new();
    for (_, result) in &function.results {
        let Operand::Value(last) = result else { panic!("{function:?}") };
        let Op::MulAdd(signs, p, q, r) = function.instructions[*last as usize].op else {
            panic!("{function:?}")
        };
        assert_eq!(signs, Signs::default());
        let behind = [p, q, r].into_iter().flat_map(|o| match o {
            Operand::Value(v) => function.instructions[v as usize].op.operands().collect(),
            other => vec![other],
        });
        let slots: Vec<u32> =
            behind.filter_map(|o| if let Operand::Slot(i) = o { Some(i) } else { None }).collect();
        read.push(slots.try_into().unwrap());
    }
    read.iter().enumerate().for_each(|(lane, slots)| {
        slots.iter().for_each(|i| assert_eq!(i % 3, lane as u32, "{read:?}"));
    });
    check(&mut f, &program, &e);
}

#[test]
fn factors_that_are_there_first_are_multiplied_first() {
    // a x sin(y) / (1 + cos(y)): a x while the functions are computed, the division last.
    let mut f = fixture();
    let [x, y, _] = f.x;
    let (sine, cosine, one) = (f.g.func(Func::Sin, y), f.g.func(Func::Cos, y), f.g.one());
    let divisor = f.g.add(one, cosine);
    let numerator = f.g.product(&[f.p[0], x, sine]);
    let e = f.g.div(numerator, divisor).unwrap();
    let program = f.lower(&[e]);
    let ops: Vec<Op> = program.functions[0].instructions.iter().map(|i| i.op).collect();
    assert!(matches!(ops.last(), Some(Op::Div(..))), "{ops:?}");
    assert!(ops.iter().any(|op| matches!(op, Op::Mul(Operand::Param(_), Operand::State(_)))), "{ops:?}");
    check(&mut f, &program, &[e]);
}

#[test]
fn a_divisor_is_scaled_where_that_saves_numbers() {
    // x / (a y^2 + b z^2) = (1/b) x / ((a/b) y^2 + z^2) once b is known to be positive.
    let mut f = fixture();
    let ([a, b, _], [x, y, z]) = (f.p, f.x);
    f.inputs.signs.extend([(a, Sign::Positive), (b, Sign::Positive)]);
    let (yy, zz) = (f.g.product(&[a, y, y]), f.g.product(&[b, z, z]));
    let divisor = f.g.add(yy, zz);
    let numerator = f.g.product(&[f.p[2], x]);
    let e = f.g.div(numerator, divisor).unwrap();
    let program = f.lower(&[e]);
    // c/b x, y^2, z^2 and (a/b) y^2 + z^2.
    assert_eq!(program.functions[0].counts(), Counts { add: 1, mul: 4, fma: 1, div: 1, ..Counts::default() });
    check(&mut f, &program, &[e]);
}

/// `(a l^2 y + b z) / (a l^2 + b)` with `l = c x + b`: mass `a`, arm `l`.
fn lever(f: &mut Fixture) -> (ExprId, Vec<Section>) {
    let ([a, b, c], [x, y, z]) = (f.p, f.x);
    let cx = f.g.mul(c, x);
    let arm = f.g.add(cx, b);
    let arm = Definition { symbol: f.g.define("arm", arm), expr: arm };
    let l = f.g.sym(arm.symbol);
    let (ly, bz) = (f.g.product(&[a, l, y, l]), f.g.mul(b, z));
    let ll = f.g.product(&[a, l, l]);
    let torque = f.g.add(ly, bz);
    let inertia = f.g.add(ll, b);
    let inertia = Definition { symbol: f.g.define("inertia", inertia), expr: inertia };
    let denominator = f.g.sym(inertia.symbol);
    let e = f.g.div(torque, denominator).unwrap();
    (e, vec![Section { title: "all".into(), definitions: vec![arm, inertia] }])
}

#[test]
fn units_are_chosen_that_leave_the_fewest_numbers() {
    let mut f = fixture();
    let (e, sections) = lever(&mut f);
    let lowered = |f: &mut Fixture| {
        lower(&mut f.g, &f.inputs, &sections, &[], &[request("f", &[e])], &SearchBudget::default()).unwrap()
    };
    let values = hamel_expr::inlined(&mut f.g, &sections[0].definitions);
    let whole = f.g.subs(e, &values).unwrap();
    let plain = lowered(&mut f);
    check(&mut f, &plain, &[whole]);
    // Masses in units of a and lengths in units of c, once both are known to be positive.
    f.inputs.signs.extend([(f.p[0], Sign::Positive), (f.p[2], Sign::Positive)]);
    let scaled = lowered(&mut f);
    check(&mut f, &scaled, &[whole]);
    let (plain, own) = (plain.functions[0].counts(), scaled.functions[0].counts());
    assert!(own.mul < plain.mul && own.add <= plain.add && own.div == plain.div, "{plain:?} {own:?}");
    // Names say what they are in.
    let names = scaled.functions[0].instructions.iter().filter_map(|i| i.name.as_deref());
    let names: Vec<&str> = names.collect();
    assert!(names.iter().any(|n| n.starts_with("inertia_over_a")), "{names:?}");
}

#[test]
fn a_pivot_in_other_units_is_checked_as_it_is_divided_by() {
    let mut f = fixture();
    let (e, sections) = lever(&mut f);
    f.inputs.signs.extend([(f.p[0], Sign::Positive), (f.p[2], Sign::Positive)]);
    let pivot = f.g.sym(sections[0].definitions[1].symbol);
    let check = Request { role: Role::Pivots, results: vec![("inertia".into(), pivot)] };
    let requests = [Request { role: Role::Rate, ..request("f", &[e]) }, check];
    let program = lower(&mut f.g, &f.inputs, &sections, &[], &requests, &SearchBudget::default()).unwrap();
    let prepared = program.prepare(&PARAMS).unwrap();
    let mut divisors = Vec::new();
    for instruction in &program.functions[0].instructions {
        if let Op::Div(_, d) | Op::Recip(d) = instruction.op {
            divisors.push(d);
        }
    }
    let [Operand::Value(k)] = divisors[..] else { panic!("one value is divided by: {divisors:?}") };
    let mut rhs = program.clone();
    rhs.functions[0].results = vec![("divisor".into(), Operand::Value(k))];
    let (mut divisor, mut checked) = ([0.0], [0.0; 2]);
    rhs.run(0, &PARAMS, &prepared, TIME, &STATE, &mut divisor);
    program.run(1, &PARAMS, &prepared, TIME, &STATE, &mut checked);
    // The rounding of the checked value is that of the sums without fusion.
    assert!((divisor[0] - checked[0]).abs() <= 4.0 * f64::EPSILON * divisor[0], "{divisor:?} {checked:?}");
    let values = hamel_expr::inlined(&mut f.g, &sections[0].definitions);
    let inertia = values[&sections[0].definitions[1].symbol];
    let inertia = f.g.eval_f64(inertia, &f.values()).unwrap();
    assert!((inertia - checked[0]).abs() > 0.01, "{inertia} and {checked:?} are in different units");
}

#[test]
fn sine_and_cosine_of_one_angle_are_one_call() {
    let mut f = fixture();
    let [x, y, _] = f.x;
    let (cosine, sine) = (f.g.func(Func::Cos, x), f.g.func(Func::Sin, x));
    let other = f.g.func(Func::Cos, y);
    let (far, product) = (f.g.mul(cosine, other), f.g.mul(sine, y));
    let e = f.g.add(far, product);
    let results = [e, cosine];
    let mut program = f.lower(&results);
    assert_eq!(program.functions[0].counts().transcendental, 2);
    check(&mut f, &program, &results);
    let function = &mut program.functions[0];
    let half = (0..).find(|k| completes_pair(&function.instructions, *k)).unwrap();
    function.instructions.swap(half - 1, half);
    assert!(verify(&program).is_err());
}

#[test]
fn two_angles_are_one_call_where_both_are_known() {
    let mut f = fixture();
    let [x, y, z] = f.x;
    let both = |g: &mut Graph, x: ExprId| [g.func(Func::Sin, x), g.func(Func::Cos, x)];
    let [sine, cosine] = both(&mut f.g, x);
    let other = both(&mut f.g, y);
    let inner = both(&mut f.g, sine);
    let results = [f.g.mul(sine, z), cosine, other[0], other[1], inner[0], inner[1]];
    let program = f.lower(&results);
    check(&mut f, &program, &results);
    let instructions = &program.functions[0].instructions;
    let places = |angle: fn(Operand) -> bool| {
        let sines = instructions.iter().enumerate().filter_map(move |(k, i)| match i.op {
            Op::Function(Func::Sin, x) if angle(x) => Some(k),
            _ => None,
        });
        sines.map(|k| place_of_two(instructions, k)).collect::<Vec<_>>()
    };
    assert_eq!(places(|angle| matches!(angle, Operand::State(_))), [Some(0), Some(1)]);
    assert_eq!(places(|angle| matches!(angle, Operand::Value(_))), [None]);
}

#[test]
fn numbers_that_the_rates_read_from_memory_have_a_slot_for_every_read() {
    let mut f = fixture();
    let ([a, b, c], [x, y, z]) = (f.p, f.x);
    let (ab, bc) = (f.g.mul(a, b), f.g.mul(b, c));
    let [x, y, z] = [x, y, z].map(|x| f.g.func(Func::Exp, x));
    let results = [f.g.mul(ab, x), f.g.mul(ab, y), f.g.mul(bc, z)];
    let lowered = |f: &mut Fixture, role: Role, results: &[ExprId]| {
        let requests = [Request { role, ..request("f", results) }];
        lower(&mut f.g, &f.inputs, &[], &[], &requests, &SearchBudget::default()).unwrap()
    };
    let rates = lowered(&mut f, Role::Rate, &results);
    check(&mut f, &rates, &results);
    assert_eq!((rates.prepare.instructions.len(), rates.prepare.slots.len()), (2, 3));
    assert_eq!(lowered(&mut f, Role::Energy, &results).prepare.slots.len(), 2);
    // A sum of two numbers reads one of them from a register, which the other operation reads, too.
    let product = f.g.mul(ab, x);
    let results = [f.g.add(product, bc), f.g.mul(bc, z)];
    assert_eq!(lowered(&mut f, Role::Rate, &results).prepare.slots.len(), 2);
}

/// Fixed-seed numbers: xorshift.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 33) as usize % n
    }
}

/// A graph of random expressions without singularities, as definitions in sections and results; even seeds have no
/// roots, of which the zero test can follow two or three in one expression.
pub(crate) fn random_problem(seed: u64) -> (Graph, Inputs, Vec<Section>, Vec<Request>) {
    let Fixture { mut g, inputs, p, t, x } = fixture();
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    let mut pool: Vec<ExprId> = p.into_iter().chain([t]).chain(x).collect();
    let leaves = pool.clone();
    let roots = seed % 2 == 1;
    pool.push(g.pi());
    let one = g.one();
    let mut sections = Vec::new();
    for s in 0..3 {
        let mut definitions = Vec::new();
        for _ in 0..8 {
            let pick = |random: &mut Random| pool[random.below(pool.len())];
            let (a, b, c) = (pick(&mut random), pick(&mut random), pick(&mut random));
            // The zero test knows sines and cosines by the terms of their arguments, which factoring would change.
            let angle = g.add(leaves[random.below(leaves.len())], leaves[random.below(leaves.len())]);
            // 1 + a^2 is positive, sines are bounded: nothing overflows in a few steps.
            let square = g.powi(a, 2);
            let positive = g.add(one, square);
            let e = match random.below(9) {
                0 => g.func(Func::Sin, angle),
                1 => g.func(Func::Cos, angle),
                2 if roots => g.sqrt(positive),
                3 => g.div(b, positive).unwrap(),
                4 => {
                    // The zero test does not relate different powers by thirds or fourths either.
                    let denominator = if roots { [1, 2, 3, 4][random.below(4)] } else { 1 };
                    let exponent = q([-3, -1, 1, 3, -2, 5][random.below(6)], denominator);
                    let bounded = g.pow(positive, &exponent).unwrap();
                    g.mul(bounded, c)
                }
                5 => {
                    let terms: Vec<_> = (0..5)
                        .map(|_| {
                            let product = [pick(&mut random), pick(&mut random)];
                            let product = g.product(&product);
                            (product, q(random.below(5) as i64 - 2, 1 + random.below(3) as i64))
                        })
                        .collect();
                    g.linear_combination(&terms)
                }
                6 => {
                    let (ab, ac) = (g.mul(a, b), g.mul(a, c));
                    g.sub(ab, ac)
                }
                7 => {
                    let bounded = g.func(Func::Sin, angle);
                    let e = g.mul(bounded, c);
                    g.scale(e, &q(-2, 7))
                }
                _ => g.sub(b, a),
            };
            // Large values would make tolerances meaningless: squash now and then. (The zero test does not know that
            // tanh is odd where factoring turns the sign of its argument.)
            let square = g.powi(e, 2);
            let positive = g.add(one, square);
            let bounded = if roots { g.func(Func::Tanh, e) } else { g.func(Func::Ln, positive) };
            if matches!(g.node(bounded), Node::Constant(_)) {
                continue;
            }
            let e = if random.below(3) == 0 { bounded } else { e };
            if random.below(2) == 0 {
                let symbol = g.define(&format!("d{s}"), e);
                definitions.push(Definition { symbol, expr: e });
                pool.push(g.sym(symbol));
            } else {
                pool.push(e);
            }
        }
        sections.push(Section { title: format!("section {s}"), definitions });
    }
    let n = pool.len();
    let requests = vec![
        Request { role: Role::Rate, ..request("rhs", &pool[n - 3..]) },
        Request { role: Role::Energy, ..request("energy", &pool[n - 5..n - 4]) },
    ];
    (g, inputs, sections, requests)
}

#[test]
fn random_programs_agree_with_their_expressions() {
    let (mut n_results, mut n_compared, mut n_exact, mut n_rewritten) = (0, 0, 0, 0);
    for seed in 1..=300 {
        let (mut g, inputs, sections, requests) = random_problem(seed);
        let program = lower(&mut g, &inputs, &sections, &[], &requests, &SearchBudget::default())
            .unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        for (role, search) in &program.report.searches {
            assert_ne!(search.fall_back, Some(FallBack::Differs), "seed {seed}, {role}");
            n_rewritten += usize::from(search.fall_back.is_none());
        }
        // Definitions replaced, in order, by what they stand for.
        let mut replacements: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
        for definition in sections.iter().flat_map(|s| &s.definitions) {
            let value = g.subs(definition.expr, &replacements).unwrap();
            replacements.insert(definition.symbol, value);
        }
        let params = inputs.params.iter().copied().zip(PARAMS);
        let mut values: BTreeMap<SymbolId, f64> = params.chain([(inputs.time, TIME)]).collect();
        values.extend(inputs.state.iter().copied().zip(STATE));
        let back = program.to_expressions(&mut g, inputs.symbols()).unwrap();
        let prepared = program.prepare(&PARAMS).unwrap();
        for (k, request) in requests.iter().enumerate() {
            let mut out = vec![0.0; request.results.len()];
            program.run(k, &PARAMS, &prepared, TIME, &STATE, &mut out);
            for (i, (name, e)) in request.results.iter().enumerate() {
                let expected = g.subs(*e, &replacements).unwrap();
                let reference = g.eval_f64(expected, &values).unwrap();
                n_results += 1;
                // What has overflowed or has grown past 1e6 leaves no digits to compare.
                if reference.is_finite() && reference.abs() <= 1e6 {
                    n_compared += 1;
                    // Both round some hundred times and may cancel; 1e-9 leaves seven digits to a wrong operation.
                    let scale = reference.abs().max(1.0);
                    let difference = (out[i] - reference).abs();
                    assert!(difference <= 1e-9 * scale, "seed {seed}, {name}: {} and {reference}", out[i]);
                }
                if seed % 2 == 0 {
                    n_exact += 1;
                    assert!(g.is_equal(back[k][i], expected), "seed {seed}, {name}");
                }
            }
        }
    }
    // Nearly all of them, and every second one exactly.
    assert_eq!((n_results, n_exact), (1200, 600));
    assert!(n_compared >= 1100, "{n_compared} of {n_results} were compared");
    // Of the others the zero test cannot tell whether the cheaper form is equal: many values are opaque to it.
    assert!(n_rewritten >= 390, "{n_rewritten} of 600 functions are in another form than their definitions");
}

#[test]
fn searches_stop_at_their_limits_and_say_so() {
    let none = SearchBudget {
        divisors: 0,
        steps: 0,
        terms: 0,
        numbers: 0,
        units: 0,
        measurements: 0,
        ..SearchBudget::default()
    };
    let all = SearchBudget::default();
    let limited = [
        (Limit::Divisors, SearchBudget { divisors: 0, ..all }),
        (Limit::Steps, SearchBudget { steps: 0, ..all }),
        (Limit::Terms, SearchBudget { terms: 0, ..all }),
        (Limit::Numbers, SearchBudget { numbers: 0, ..all }),
        (Limit::Units, SearchBudget { units: 0, ..all }),
        (Limit::Measurements, SearchBudget { measurements: 0, ..all }),
    ];
    for (limit, budget) in limited {
        let mut f = fixture();
        let (e, sections) = lever(&mut f);
        f.inputs.signs.extend([(f.p[0], Sign::Positive), (f.p[2], Sign::Positive)]);
        let requests = [Request { role: Role::Rate, ..request("f", &[e]) }];
        let program = lower(&mut f.g, &f.inputs, &sections, &[], &requests, &budget).unwrap();
        let values = hamel_expr::inlined(&mut f.g, &sections[0].definitions);
        let whole = f.g.subs(e, &values).unwrap();
        check(&mut f, &program, &[whole]);
        let (role, search) = &program.report.searches[0];
        assert_eq!((role, search.fall_back), (&Role::Rate, None));
        assert_eq!(search.limits, [limit].into(), "{limit}: {:?}", search.limits);
        let line = format!("  rhs: the search for a cheaper form stopped early, at its limit of {limit}\n");
        assert_eq!(program.report.to_string(), line);
    }
    // Without any search the values are still right, and cost more.
    let mut f = fixture();
    let (e, sections) = lever(&mut f);
    f.inputs.signs.extend([(f.p[0], Sign::Positive), (f.p[2], Sign::Positive)]);
    let requests = [Request { role: Role::Rate, ..request("f", &[e]) }];
    let mut lowered = |budget| lower(&mut f.g, &f.inputs, &sections, &[], &requests, budget).unwrap();
    let (plain, searched) = (lowered(&none), lowered(&all));
    assert!(plain.report.incomplete().next().is_some() && plain.cost() > searched.cost());
    assert_eq!(searched.report.to_string(), "");
    let values = hamel_expr::inlined(&mut f.g, &sections[0].definitions);
    let whole = f.g.subs(e, &values).unwrap();
    check(&mut f, &plain, &[whole]);
}

#[test]
fn lowering_twice_gives_the_same_program() {
    let lowered = |seed| {
        let (mut g, inputs, sections, requests) = random_problem(seed);
        lower(&mut g, &inputs, &sections, &[], &requests, &SearchBudget::default()).unwrap()
    };
    for seed in 1..20 {
        assert_eq!(lowered(seed), lowered(seed));
    }
}

#[test]
fn values_of_constants_are_those_of_the_expressions() {
    assert_eq!(Constant::Rational(q(1, 3)).value::<f64>(), 1.0 / 3.0);
    assert_eq!(Constant::Rational(q(981, 100)).value::<f64>(), 9.81);
    assert_eq!(Constant::Rational(q(7, 1)).literal(), Literal::Number(7.0));
    assert_eq!(Constant::Rational(q(1, 3)).literal(), Literal::Ratio(1.0, 3.0));
    assert_eq!(Constant::Rational(<Rational as One>::one()).literal(), Literal::One);
    let f = fixture();
    assert_eq!(f.values().len(), 7);
}

#[test]
fn a_function_takes_a_vector_of_its_own() {
    // f(x; v) = (x y) v0 + v1 and g(x; w) = (x y) w0 share x y in the pool and keep their vectors apart.
    let Fixture { mut g, mut inputs, x: [x, y, _], .. } = fixture();
    let [v0, v1, w0] = ["v0", "v1", "w0"].map(|n| g.symbol(n));
    inputs.arguments = BTreeMap::from([
        (Role::Output("f".to_owned()), vec![v0, v1]),
        (Role::Output("g".to_owned()), vec![w0]),
    ]);
    let [e0, e1, f0] = [v0, v1, w0].map(|s| g.sym(s));
    let (along_v, along_w) = (g.product(&[x, y, e0]), g.product(&[x, y, f0]));
    let sum = g.add(along_v, e1);
    let requests = [request("f", &[sum]), request("g", &[along_w])];
    let program = lower(&mut g, &inputs, &[], &[], &requests, &SearchBudget::default()).unwrap();
    assert_eq!(program.functions[0].argument, ["v0", "v1"]);
    assert_eq!(program.functions[1].argument, ["w0"]);
    let prepared = program.prepare(&PARAMS).unwrap();
    let mut out = [0.0];
    // Exact products: their order does not matter.
    let state = [0.5, 1.5, 0.0];
    let point = |argument| Point { t: TIME, state: &state, argument };
    program.run_at(0, &PARAMS, &prepared, point(&[2.0, 5.0]), &mut out);
    assert_eq!(out, [6.5]);
    program.run_at(1, &PARAMS, &prepared, point(&[3.0]), &mut out);
    assert_eq!(out, [2.25]);
    assert_eq!(program.to_expressions(&mut g, inputs.symbols()).unwrap(), [[sum], [along_w]]);

    // A component that the vector does not have, and a vector of another function.
    let mut short = program.clone();
    short.functions[0].argument.pop();
    assert!(verify(&short).is_err());
    let foreign = [request("f", &[sum]), request("g", &[along_v])];
    let error = lower(&mut g, &inputs, &[], &[], &foreign, &SearchBudget::default()).unwrap_err();
    assert!(error.to_string().contains("g depends on v0"), "{error}");
}

/// Products from the first one on.
const ROLLED: fn() -> SearchBudget = || SearchBudget { products: 1, ..SearchBudget::default() };

/// `[2 x y - sqrt(2) sin(pi/5)/pi z^2 + 3 a x, y sin(x) + 1, x, (x + 2 y)^2 - 3 (x + 2 y) (y - b z), a + b]`.
fn sums_of_products(f: &mut Fixture) -> Vec<ExprId> {
    let g = &mut f.g;
    let [x, y, z] = f.x;
    let number = Number::sin_pi(1, 5).unwrap().times(&Number::power_of_pi(-1));
    let root = Number::sqrt(&q(2, 1)).unwrap();
    let c = g.number(&number.times(&root));
    let (xy, zz, ax) = (g.mul(x, y), g.mul(z, z), g.mul(f.p[0], x));
    let czz = g.mul(c, zz);
    let first = g.linear_combination(&[(xy, q(2, 1)), (czz, q(-1, 1)), (ax, q(3, 1))]);
    let (sine, one) = (g.func(Func::Sin, x), g.one());
    let sine = g.mul(y, sine);
    let second = g.add(sine, one);
    let left = g.linear_combination(&[(x, q(1, 1)), (y, q(2, 1))]);
    let bz = g.mul(f.p[1], z);
    let right = g.sub(y, bz);
    let (square, product) = (g.mul(left, left), g.mul(left, right));
    let fourth = g.linear_combination(&[(square, q(1, 1)), (product, q(-3, 1))]);
    vec![first, second, x, fourth, g.add(f.p[0], f.p[1])]
}

#[test]
fn sums_of_products_become_loops_over_tables() {
    let mut f = fixture();
    let results = sums_of_products(&mut f);
    let straight = f.lower(&results);
    assert!(straight.functions[0].contractions.is_empty() && straight.tables.is_empty());
    let requests = [request("f", &results)];
    let program = lower(&mut f.g, &f.inputs, &[], &[], &requests, &ROLLED()).unwrap();
    check(&mut f, &program, &results);
    let function = &program.functions[0];
    // Sums that others are made of come first; sine, parameters and one are what the tables take besides the state.
    let shape: Vec<(usize, usize)> =
        function.contractions.iter().map(|c| (c.n_results, c.n_products)).collect();
    assert_eq!(shape, [(4, 9), (1, 2)], "{function:?}");
    assert_eq!(function.scalars.len(), 4, "{function:?}");
    assert_eq!(function.instructions.len(), 1, "{function:?}");
    assert_eq!(function.results[2].1, Operand::State(0));
    let terms: usize = function.contractions.iter().map(|c| c.n_results * c.terms.len()).sum();
    let counts = function.counts();
    assert_eq!((counts.mul, counts.fma, counts.add), (22, 11, 11 + 4 * terms));
    assert!(function.latency() > straight.functions[0].latency() / 2);
    // Fewer products than the budget says stay as they are.
    let many = SearchBudget { products: 12, ..SearchBudget::default() };
    assert_eq!(lower(&mut f.g, &f.inputs, &[], &[], &requests, &many).unwrap(), straight);
    let just = SearchBudget { products: 11, ..SearchBudget::default() };
    assert_eq!(lower(&mut f.g, &f.inputs, &[], &[], &requests, &just).unwrap(), program);
}

#[test]
fn what_has_to_be_computed_straight_is_not_rolled() {
    let mut f = fixture();
    let [x, y, z] = f.x;
    // u = x y + z^2 is needed for its sine; v = x u - y z is not, and w has three factors.
    let (xy, zz) = (f.g.mul(x, y), f.g.mul(z, z));
    let u = f.g.add(xy, zz);
    let u = f.g.define("u", u);
    let u_value = f.g.sym(u);
    let (xu, yz) = (f.g.mul(x, u_value), f.g.mul(y, z));
    let v = f.g.sub(xu, yz);
    let v = f.g.define("v", v);
    let v_value = f.g.sym(v);
    let definitions = vec![
        Definition { symbol: u, expr: f.g.add(xy, zz) },
        Definition { symbol: v, expr: f.g.sub(xu, yz) },
    ];
    let sections = [Section { title: "sums".into(), definitions }];
    let sine = f.g.func(Func::Sin, u_value);
    let (a, xyz) = (f.g.mul(sine, v_value), f.g.mul(xy, z));
    let (a, b) = (f.g.add(a, x), f.g.add(xyz, x));
    let requests = [request("f", &[a, b])];
    let program = lower(&mut f.g, &f.inputs, &sections, &[], &requests, &ROLLED()).unwrap();
    let values = hamel_expr::inlined(&mut f.g, &sections[0].definitions);
    let whole = [a, b].map(|e| f.g.subs(e, &values).unwrap());
    check(&mut f, &program, &whole);
    let function = &program.functions[0];
    let shape: Vec<(usize, usize)> =
        function.contractions.iter().map(|c| (c.n_results, c.n_products)).collect();
    assert_eq!(shape, [(1, 2), (1, 2)], "{function:?}");
    // A result that is computed straight takes nothing from loops, so that both of these have to be.
    let b = f.g.mul(b, v_value);
    let cube = f.g.func(Func::Exp, b);
    let requests = [request("f", &[cube, v_value])];
    let program = lower(&mut f.g, &f.inputs, &sections, &[], &requests, &ROLLED()).unwrap();
    assert!(program.functions[0].contractions.is_empty(), "{:?}", program.functions[0]);
    let whole = [cube, v_value].map(|e| f.g.subs(e, &values).unwrap());
    check(&mut f, &program, &whole);
}

#[test]
fn malformed_contractions_are_refused() {
    let mut f = fixture();
    let results = sums_of_products(&mut f);
    let requests = [request("f", &results)];
    let program = lower(&mut f.g, &f.inputs, &[], &[], &requests, &ROLLED()).unwrap();
    assert_eq!(verify(&program), Ok(()));
    let refused = |change: &dyn Fn(&mut Program)| {
        let mut program = program.clone();
        change(&mut program);
        match verify(&program) {
            Err(Error::Program { reason }) => reason,
            other => panic!("{other:?}"),
        }
    };
    let table = |p: &mut Program, places: Vec<u8>| {
        let (ends, numbers) = (p.tables[0].ends.clone(), p.tables[0].numbers().to_vec());
        p.tables[0] = Table::new(places, ends, numbers);
    };
    let places = program.tables[0].places.clone();
    let with = |k: usize, byte: u8| {
        let mut places = places.clone();
        places[k] = byte;
        places
    };
    for (reason, expected) in [
        (refused(&|p| table(p, with(0, 9))), "factor 9 of"),
        (refused(&|p| table(p, with(2, 9))), "factor 9 of"),
        (refused(&|p| table(p, with(4, 9))), "number 9 of a table does not exist"),
        (refused(&|p| table(p, places[1..].to_vec())), "another number of products"),
        (refused(&|p| p.tables[0].ends[0] = 100), "do not end with"),
        (refused(&|p| p.functions[0].contractions[0].terms[0].table = 7), "another number of products"),
        (refused(&|p| p.functions[0].contractions[0].n_results += 1), "sums of a table for"),
        (refused(&|p| p.functions[0].contractions[0].n_products += 1), "another number of products"),
        (
            refused(&|p| p.functions[0].contractions[1].terms[0].left = Factors::Contraction(1)),
            "of 0 (Contraction(1))",
        ),
        (refused(&|p| p.functions[0].scalars[0] = Operand::Value(7)), "in the scalars of f does not exist"),
        (refused(&|p| p.functions[0].results[0].1 = Operand::Contracted(5)), "does not exist there"),
        (refused(&|p| p.functions[0].results[0].1 = Operand::State(0)), "of the contractions is not used"),
    ] {
        assert!(reason.contains(expected), "{reason}: {expected}");
    }
}

/// Products of sums, scalars that change with the state, and numbers in parameters.
#[test]
fn taylor_coefficients_of_loops_are_those_of_straight_lines() {
    use hamel_runtime::{DoubleDouble, Real};
    let mut f = fixture();
    let results = sums_of_products(&mut f);
    // With the sine among them the scalars change, otherwise not.
    for (rates, scalars_change) in
        [([results[0], results[1], results[3]], true), ([results[0], results[2], results[3]], false)]
    {
        let requests = [request("f", &rates)];
        let rolled = lower(&mut f.g, &f.inputs, &[], &[], &requests, &ROLLED()).unwrap();
        assert!(!rolled.functions[0].contractions.is_empty());
        let straight = f.lower(&rates);
        let series = |program: &Program| {
            let jet = hamel_program::program::Jet::new(program, 0).unwrap();
            let params = PARAMS.map(DoubleDouble::from);
            let prepared = program.prepare(&params).unwrap();
            let mut out = vec![vec![DoubleDouble::ZERO; 3]; 13];
            let mut rows: Vec<&mut [DoubleDouble]> = out.iter_mut().map(Vec::as_mut_slice).collect();
            let (t, state) = (DoubleDouble::from(TIME), STATE.map(DoubleDouble::from));
            jet.series(&params, &prepared, t, &state, &mut rows);
            (jet, out)
        };
        let ((jet, loops), (_, lines)) = (series(&rolled), series(&straight));
        assert_eq!(jet.scalars_change, scalars_change);
        for (order, (a, b)) in loops.iter().flatten().zip(lines.iter().flatten()).enumerate() {
            // The straight lines take numbers in closed form from doubles.
            let off = (*a - *b).magnitude() / (1.0 + b.magnitude());
            assert!(off < 1e-14, "{}, order {}: {a:?} {b:?}", order % 3, order / 3);
        }
    }
}

#[test]
fn a_function_of_a_vector_has_no_taylor_coefficients() {
    let Fixture { mut g, mut inputs, x: [x, y, z], .. } = fixture();
    let v = g.symbol("v");
    inputs.arguments = BTreeMap::from([(Role::Output("f".to_owned()), vec![v])]);
    let v = g.sym(v);
    let along = [x, y, z].map(|x| g.mul(x, v));
    let program =
        lower(&mut g, &inputs, &[], &[], &[request("f", &along)], &SearchBudget::default()).unwrap();
    let refused = hamel_program::program::Jet::new(&program, 0).unwrap_err();
    assert_eq!(refused, Error::ShapeMismatch { what: "vector of f".into(), found: 1, expected: 0 });
}

/// Programs of scenes, whose sections have titles with formulas and whose conditions have words, are read as they are
/// written.
#[test]
fn programs_of_scenes_are_read_back_from_their_text() {
    for name in ["heavy_top", "suslov", "mobile_robot"] {
        let path = format!("{}/../models/specs/{name}.hamel", env!("CARGO_MANIFEST_DIR"));
        let model = hamel_codegen::spec::parse(name, &std::fs::read_to_string(path).unwrap()).unwrap();
        let program = hamel_codegen::scene::build(&model, "default").unwrap().into_program();
        let text = program.to_string();
        let read = Program::read(&text).unwrap_or_else(|e| panic!("{name}: {e}\n{text}"));
        verify(&read).unwrap();
        assert_eq!(read.to_string(), text, "{name}");
        assert_eq!((&read.functions.len(), &read.sections), (&program.functions.len(), &program.sections));
    }
}

/// A second program by the same graph takes the rates that a first one has searched, whatever else it asks for.
#[test]
fn rates_that_are_known_are_not_searched_again() {
    let Fixture { mut g, inputs, p: [a, b, _], x: [x, y, z], .. } = fixture();
    let shared = {
        let (ax, by) = (g.mul(a, x), g.mul(b, y));
        g.add(ax, by)
    };
    let symbol = g.define("shared", shared);
    let named = g.sym(symbol);
    let sections =
        [Section { title: "first".into(), definitions: vec![Definition { symbol, expr: shared }] }];
    let rates = {
        let (square, other) = (g.powi(named, 2), g.mul(named, z));
        [("x".to_owned(), square), ("y".to_owned(), other)].to_vec()
    };
    let rate = Request { role: Role::Rate, results: rates.clone() };
    let budget = SearchBudget::default();
    let known = search_rates(&mut g, &inputs, &sections, &[], rate.clone(), &budget).unwrap();
    // Another scene: one more section before that of the rates, one after it, and one more function.
    let product = g.mul(x, z);
    let further = g.define("further", product);
    let section = |title: &str, definitions| Section { title: title.into(), definitions };
    let own = section("own", vec![Definition { symbol: further, expr: product }]);
    let sections = [section("before", Vec::new()), sections[0].clone(), own];
    let more = g.sym(further);
    let requests = [rate, request("f", &[more, named])];
    let mut anew = g.clone();
    let anew = lower(&mut anew, &inputs, &sections, &[], &requests, &budget).unwrap();
    let before = g.spent();
    let again =
        lower_with(&mut g.clone(), &inputs, &sections, &[], &requests, (&budget, Some(&known))).unwrap();
    assert_eq!(again, anew);
    assert_eq!(g.spent(), before);
    // Other rates are searched.
    let others = Request { role: Role::Rate, results: rates.into_iter().rev().collect() };
    let others = [others];
    let program =
        lower_with(&mut g.clone(), &inputs, &sections, &[], &others, (&budget, Some(&known))).unwrap();
    assert_eq!(program, lower(&mut g, &inputs, &sections, &[], &others, &budget).unwrap());
    assert_ne!(program.functions[0].results, anew.functions[0].results);
}
