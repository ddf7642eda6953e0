//! Derivatives of the right-hand side: against exact differentiation, against dual numbers, against differences, and
//! against each other.
//!
//! Rounding: a value and its counterpart by dual numbers are computed with different operations, each run on
//! [`Tracked`] numbers; they may differ by 16 units in the last place of the larger of their largest terms.

use hamel_codegen::scene::{self, Derivative};
use hamel_codegen::spec;
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_measure::random::Random;
use hamel_program::lower::Inputs;
use hamel_program::program::{Point, Program, Role};
use hamel_runtime::{
    Differentiable, Dop853, DoubleDouble, Dual, Integrator, Options, Real, Scene, StateVector, System,
};
use hamel_tests::derived::{Derived, scene_of_text};
use hamel_tests::models::{self, build, names};
use hamel_tests::reference;
use hamel_tests::tracked::{Tracked, unit_in_the_last_place};

/// Units in the last place of the largest term; measured over all models and points: 5.
const BOUND: f64 = 16.0;

/// The same of models whose rates are long sums: the factors of a full matrix of six velocities, in parameters alone,
/// are multiplied into every term, of which some cancel: twice the measured distance.
const LONG_SUMS: [(&str, f64); 2] = [("body_in_fluid", 34.0), ("body_in_fluid_by_translations", 58.0)];

fn vector(random: &mut Random, n: usize) -> Vec<f64> {
    (0..n).map(|_| random.number()).collect()
}

/// The scene with all derivatives of a model.
fn derivatives_of(name: &str) -> &'static Derived {
    models::derived(name, scene::DERIVATIVES)
}

/// Parameters, time and state.
struct At {
    params: Vec<f64>,
    t: f64,
    state: Vec<f64>,
}

/// All reference points of a model, and random points near its default parameters.
fn points(built: &Derived, n_random: usize) -> Vec<At> {
    let model = &built.model;
    let names = built.state_names();
    let param_names: Vec<String> = built.params().iter().map(|p| p.name.clone()).collect();
    let mut points = Vec::new();
    if reference::models().contains(model) {
        for point in reference::read(model).points {
            points.push(At {
                params: reference::in_order(&point.params, &param_names),
                t: 0.0,
                state: reference::in_order(&point.state, names),
            });
        }
    }
    let mut random = Random(20_261_121);
    for _ in 0..n_random {
        let mut near = built.defaults();
        near.iter_mut().for_each(|p| *p *= 1.0 + 0.05 * random.number());
        // Inside (0, 1): every coordinate is in its domain there.
        let state = names.iter().map(|_| 0.5 + 0.45 * random.number()).collect();
        points.push(At { params: near, t: random.number(), state });
    }
    points
}

fn run<R: Real>(program: &Program, role: &Role, params: &[R], t: R, state: &[R], argument: &[R]) -> Vec<R> {
    let prepared = program.prepare(params).unwrap_or_else(|e| panic!("{e}"));
    let k = program.function_idx(role).unwrap_or_else(|| panic!("no function {role}"));
    let mut out = vec![R::ZERO; program.functions[k].results.len()];
    program.run_at(k, params, &prepared, Point { t, state, argument }, &mut out);
    out
}

fn lifted(values: &[f64]) -> Vec<Tracked> {
    values.iter().map(|x| Tracked::input(*x)).collect()
}

/// `df/dx` along a direction of parameters, time and state, by dual numbers.
fn slopes(program: &Program, at: &At, direction: (&[f64], f64, &[f64])) -> Vec<Tracked> {
    let dual = |value: f64, slope: f64| Dual::new(Tracked::input(value), Tracked::input(slope));
    let list = |values: &[f64], slopes: &[f64]| -> Vec<Dual<Tracked>> {
        values.iter().zip(slopes).map(|(x, v)| dual(*x, *v)).collect()
    };
    let (params, state) = (list(&at.params, direction.0), list(&at.state, direction.2));
    let rates = run(program, &Role::Rate, &params, dual(at.t, direction.1), &state, &[]);
    rates.into_iter().map(|d| d.derivative).collect()
}

fn unit(n: usize, k: usize) -> Vec<f64> {
    (0..n).map(|j| if j == k { 1.0 } else { 0.0 }).collect()
}

fn agree(what: &str, found: Tracked, expected: Tracked) -> f64 {
    let scale = found.term.max(expected.term);
    let off = (found.value - expected.value).abs() / unit_in_the_last_place(scale);
    let own = LONG_SUMS.iter().find(|(name, _)| what.starts_with(&format!("{name}:")));
    let bound = own.map_or(BOUND, |(_, bound)| *bound);
    assert!(off <= bound, "{what} is {off} units off: {found:?} instead of {expected:?}");
    off
}

/// Every derivative at a point against dual numbers; the largest distance in units.
fn check_against_duals(built: &Derived, at: &At, random: &mut Random) -> f64 {
    let program = &built.program;
    let label = &built.model;
    let (n, n_params) = (at.state.len(), at.params.len());
    let (still, fixed) = (vec![0.0; n], vec![0.0; n_params]);
    let (params, t, state) = (lifted(&at.params), Tracked::input(at.t), lifted(&at.state));
    let call = |role: &Role, argument: &[f64]| run(program, role, &params, t, &state, &lifted(argument));
    let mut worst: f64 = 0.0;
    for matrix in built.matrices() {
        let name = matrix.name.as_str();
        let entries = call(&Role::Output(name.to_owned()), &[]);
        for j in 0..matrix.shape.1 {
            let column = match Derivative::from_name(name) {
                Some(Derivative::Sensitivity) => slopes(program, at, (&unit(n_params, j), 0.0, &still)),
                _ => slopes(program, at, (&fixed, 0.0, &unit(n, j))),
            };
            for (i, expected) in column.into_iter().enumerate() {
                let place = matrix.pattern.iter().position(|p| *p == (i, j));
                let found = place.map_or(Tracked::ZERO, |k| entries[k]);
                worst = worst.max(agree(&format!("{label}: {name}[{i}][{j}]"), found, expected));
            }
        }
    }
    let mut compare = |name: &str, found: Vec<Tracked>, expected: Vec<Tracked>| {
        assert_eq!(found.len(), n, "{label}: {name}");
        for (i, (found, expected)) in found.into_iter().zip(expected).enumerate() {
            worst = worst.max(agree(&format!("{label}: {name}[{i}]"), found, expected));
        }
    };
    compare(
        "time_derivative",
        call(&Derivative::TimeDerivative.role(), &[]),
        slopes(program, at, (&fixed, 1.0, &still)),
    );
    let v = vector(random, n);
    compare("jvp", call(&Derivative::Jvp.role(), &v), slopes(program, at, (&fixed, 0.0, &v)));
    let v = vector(random, n_params);
    compare(
        "sensitivity_jvp",
        call(&Derivative::SensitivityJvp.role(), &v),
        slopes(program, at, (&v, 0.0, &still)),
    );
    // Column by column, since w^T J e_j = (J^T w)_j.
    let w = vector(random, n);
    let weighted = |column: Vec<Tracked>| {
        let terms = column.into_iter().zip(&w).map(|(d, w)| d * Tracked::input(*w));
        terms.fold(Tracked::ZERO, |sum, term| sum + term)
    };
    let expected = (0..n).map(|j| weighted(slopes(program, at, (&fixed, 0.0, &unit(n, j))))).collect();
    compare("vjp", call(&Derivative::Vjp.role(), &w), expected);
    let expected: Vec<Tracked> =
        (0..n_params).map(|j| weighted(slopes(program, at, (&unit(n_params, j), 0.0, &still)))).collect();
    let found = call(&Derivative::SensitivityVjp.role(), &w);
    assert_eq!(found.len(), n_params, "{label}");
    for (j, (found, expected)) in found.into_iter().zip(expected).enumerate() {
        worst = worst.max(agree(&format!("{label}: sensitivity_vjp[{j}]"), found, expected));
    }
    worst
}

#[test]
fn every_derivative_of_every_model_agrees_with_dual_numbers() {
    for name in names() {
        let built = derivatives_of(&name);
        let mut random = Random(7);
        let points = points(built, 8);
        let worst = points.iter().map(|at| check_against_duals(built, at, &mut random)).fold(0.0, f64::max);
        println!("{name}: {} points, worst {worst:.1} units in the last place", points.len());
    }
}

/// The program's functions as expressions in fresh symbols.
struct Exact {
    g: Graph,
    inputs: Inputs,
    functions: Vec<(Role, Vec<ExprId>)>,
}

impl Exact {
    fn new(built: &Derived) -> Exact {
        let program = &built.program;
        let mut g = Graph::new();
        let mut symbols = |names: &[String]| -> Vec<SymbolId> { names.iter().map(|n| g.symbol(n)).collect() };
        let (params, state) = (symbols(&program.params), symbols(&program.state));
        let time = symbols(std::slice::from_ref(&program.time))[0];
        let with_argument = program.functions.iter().filter(|f| !f.argument.is_empty());
        let arguments = with_argument.map(|f| (f.role.clone(), symbols(&f.argument))).collect();
        let (signs, divisors) = Default::default();
        let inputs = Inputs {
            params,
            time,
            state,
            signs,
            circles: vec![],
            held: vec![],
            arguments,
            divisors,
            sampling: None,
        };
        let results = program.to_expressions(&mut g, inputs.symbols()).unwrap_or_else(|e| panic!("{e}"));
        let roles = program.functions.iter().map(|f| f.role.clone());
        Exact { functions: roles.zip(results).collect(), g, inputs }
    }

    fn results(&self, role: &Role) -> Vec<ExprId> {
        let found = self.functions.iter().find(|(of, _)| of == role);
        found.unwrap_or_else(|| panic!("no function {role}")).1.clone()
    }

    /// `sum_k factor_k symbol_k`.
    fn combination(&mut self, factors: &[ExprId], symbols: &[SymbolId]) -> ExprId {
        let mut terms = Vec::new();
        for (e, s) in factors.iter().zip(symbols) {
            let s = self.g.sym(*s);
            terms.push(self.g.mul(*e, s));
        }
        self.g.sum(&terms)
    }
}

#[test]
fn derivatives_and_patterns_are_exact_where_the_whole_expression_can_be_differentiated() {
    // The right-hand side with every definition put in, differentiated as one expression and compared in exact
    // arithmetic: nothing of the linearisation is used on that side.
    for name in names() {
        let built = derivatives_of(&name);
        let mut exact = Exact::new(built);
        let rates = exact.results(&Role::Rate);
        let inputs = exact.inputs.clone();
        let mut columns = |by: &[SymbolId]| -> Vec<Vec<ExprId>> {
            by.iter().map(|x| exact.g.diff_all(&rates, *x)).collect()
        };
        let by_state = columns(&inputs.state);
        let by_params = columns(&inputs.params);
        let by_time = columns(&[inputs.time]).remove(0);
        let equal = |exact: &mut Exact, what: &str, found: ExprId, expected: ExprId| {
            assert!(exact.g.is_equal(found, expected), "{name}: {what}");
        };
        for matrix in built.matrices() {
            let expected = match Derivative::from_name(&matrix.name) {
                Some(Derivative::Sensitivity) => &by_params,
                _ => &by_state,
            };
            let entries = exact.results(&Role::Output(matrix.name.to_owned()));
            for (i, j) in (0..rates.len()).flat_map(|i| (0..matrix.shape.1).map(move |j| (i, j))) {
                let what = format!("{}[{i}][{j}]", matrix.name);
                match matrix.pattern.iter().position(|p| *p == (i, j)) {
                    Some(k) => {
                        equal(&mut exact, &what, entries[k], expected[j][i]);
                        assert!(!exact.g.is_zero(entries[k]), "{name}: {what} vanishes identically");
                    }
                    None => assert!(exact.g.is_zero(expected[j][i]), "{name}: {what} does not vanish"),
                }
            }
        }
        for (i, found) in exact.results(&Derivative::TimeDerivative.role()).into_iter().enumerate() {
            equal(&mut exact, "time_derivative", found, by_time[i]);
        }
        for (product, columns) in [(Derivative::Jvp, &by_state), (Derivative::SensitivityJvp, &by_params)] {
            let Some(v) = inputs.arguments.get(&product.role()) else { continue };
            for (i, found) in exact.results(&product.role()).into_iter().enumerate() {
                let row: Vec<ExprId> = columns.iter().map(|column| column[i]).collect();
                let expected = exact.combination(&row, v);
                equal(&mut exact, product.name(), found, expected);
            }
        }
        for (product, columns) in [(Derivative::Vjp, &by_state), (Derivative::SensitivityVjp, &by_params)] {
            let w = &inputs.arguments[&product.role()];
            for (j, found) in exact.results(&product.role()).into_iter().enumerate() {
                let expected = exact.combination(&columns[j], w);
                equal(&mut exact, product.name(), found, expected);
            }
        }
    }
}

#[test]
fn the_jacobian_agrees_with_differences_of_double_doubles() {
    // Two central differences, extrapolated: with h = 2^-40 the truncation is h^4 f'''''/120 = 1e-50 f''''' (with h^2
    // alone a disk that lies nearly flat, whose 1 - Gamma_3^2 is 1e-6, is off by 1e-12) and the rounding 1e-32/h =
    // 1e-20 f: what is left is the rounding of the entries themselves, as against dual numbers.
    let h = 2.0_f64.powi(-40);
    for name in names() {
        let built = derivatives_of(&name);
        let matrix = built.matrices().iter().find(|m| m.name == Derivative::Jacobian.name()).unwrap();
        for at in points(built, 4) {
            let wide = |values: &[f64]| values.iter().map(|x| DoubleDouble::from(*x)).collect::<Vec<_>>();
            let (params, t) = (wide(&at.params), DoubleDouble::from(at.t));
            let entries = run(
                &built.program,
                &Derivative::Jacobian.role(),
                &lifted(&at.params),
                Tracked::input(at.t),
                &lifted(&at.state),
                &[],
            );
            let still = run(&built.program, &Role::Rate, &params, t, &wide(&at.state), &[]);
            for j in 0..at.state.len() {
                let rates = |h: f64| {
                    let mut moved = wide(&at.state);
                    moved[j] += DoubleDouble::from(h);
                    run(&built.program, &Role::Rate, &params, t, &moved, &[])
                };
                let slopes = |h: f64| {
                    let (above, below) = (rates(h), rates(-h));
                    above.into_iter().zip(below).map(move |(a, b)| (a - b) / DoubleDouble::from(2.0 * h))
                };
                for (i, (fine, coarse)) in slopes(0.5 * h).zip(slopes(h)).enumerate() {
                    let expected = (fine + (fine - coarse) / DoubleDouble::from(3.0)).hi();
                    let rate = still[i].hi().abs();
                    let place = matrix.pattern.iter().position(|p| *p == (i, j));
                    let found = place.map_or(Tracked::ZERO, |k| entries[k]);
                    // Differences of rates say nothing about digits below: terms that cancel within a rate, as in an
                    // entry that vanishes, leave 1e-32/h of their size (1.6e-17 was met in euler_disk_advected).
                    let floor = Tracked { value: expected, term: found.term.max(0.1 * (1.0 + rate)) };
                    agree(&format!("{name}: J[{i}][{j}]"), found, floor);
                }
            }
        }
    }
}

#[test]
fn products_agree_with_each_other() {
    // w.(J v) = (J^T w).v, each side a sum of at most n^2 products.
    for name in names() {
        let built = derivatives_of(&name);
        let mut random = Random(11);
        let n = built.state_names().len();
        for at in points(built, 4) {
            let interpreter = built.prepare(&at.params).unwrap_or_else(|e| panic!("{e}"));
            let (v, w) = (vector(&mut random, n), vector(&mut random, n));
            let tangent = interpreter.product(Derivative::Jvp, at.t, &at.state, &v).unwrap();
            let adjoint = interpreter.product(Derivative::Vjp, at.t, &at.state, &w).unwrap();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let rows = interpreter.matrix(Derivative::Jacobian, at.t, &at.state).unwrap();
            let size = rows.iter().flatten().fold(1.0_f64, |m, x| m.max(x.abs())) * (n * n) as f64;
            // Dual numbers differentiate the right-hand side of any scene.
            let mut by_duals = vec![vec![0.0; n]; n];
            let mut slices: Vec<&mut [f64]> = by_duals.iter_mut().map(Vec::as_mut_slice).collect();
            interpreter.rhs_jacobian(at.t, &at.state, &mut slices);
            for (own, dual) in rows.iter().flatten().zip(by_duals.iter().flatten()) {
                assert!((own - dual).abs() <= 1e-13 * size, "{name}: {own} and {dual}");
            }
            let (left, right) = (dot(&w, &tangent), dot(&adjoint, &v));
            assert!((left - right).abs() <= 1e-14 * size, "{name}: {left} and {right}");
        }
    }
}

fn operations(program: &Program, role: &Role) -> usize {
    let k = program.function_idx(role).unwrap_or_else(|| panic!("no function {role}"));
    program.functions[k].counts().total()
}

#[test]
fn products_cost_a_small_multiple_of_the_right_hand_side() {
    // Griewank and Walther 2008 bound both by 4 to 5 evaluations of the same program; the rates alone are simplified
    // across definitions that their derivatives share, so that up to 5.3 was measured (euler_disk_advected).
    for name in names() {
        let built = derivatives_of(&name);
        let (rhs, n) = (operations(&built.program, &Role::Rate), built.state_names().len());
        // A right-hand side of a few operations has products of a few operations per component.
        let bound = |factor: usize| factor * rhs + 2 * n;
        let (jvp, vjp, jacobian) = [Derivative::Jvp, Derivative::Vjp, Derivative::Jacobian]
            .map(|d| operations(&built.program, &d.role()))
            .into();
        // A loop over a table has nothing that its sums share: 6.7 was measured (zeitlin_euler_7).
        let of = |d: Derivative| {
            let function = built.program.function(&d.role()).unwrap_or_else(|| panic!("{name}: no function"));
            bound(if function.contractions.is_empty() { 6 } else { 7 })
        };
        assert!(jvp <= of(Derivative::Jvp), "{name}: jvp has {jvp} operations, rhs {rhs}");
        assert!(vjp <= of(Derivative::Vjp), "{name}: vjp has {vjp} operations, rhs {rhs}");
        // Differences would cost n + 1 right-hand sides; measured at most 6.1 (chaplygin_gyro, n = 10).
        assert!(jacobian <= bound(7), "{name}: jacobian has {jacobian} operations, rhs {rhs}");
    }
    // What does not depend on the state is not computed with it.
    let top = derivatives_of("heavy_top");
    assert!(operations(&top.program, &Derivative::Jacobian.role()) <= 14);
    assert_eq!(operations(&derivatives_of("rolling_disk").program, &Derivative::Jacobian.role()), 0);
}

#[test]
fn time_fixed_parameters_and_every_function_are_differentiated() {
    let text = "model forced {
        param k = 1.5 where k > 0;
        param c = 0.25;
        coordinate q in real;
        velocity v in R;
        lagrangian = (1 + q^2)*q_dot^2/2 + exp(c*q)*v^2/2 + k*cos(q)*sin(2*t) + ln(2 + q)*atan(q*t);
        force v = -tanh(v)*sqrt(1 + q_dot^2) + atan2(v - q, c + k)*atan2(k*t, q - v)/7 + asin(q/9);
        scene stiff { fix k = 2; want jacobian, sensitivity, time_derivative; }
    }";
    let model = spec::parse("forced.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene_of_text("forced.hamel", text, scene::DERIVATIVES);
    let mut random = Random(3);
    for at in points(built, 8) {
        check_against_duals(built, &at, &mut random);
        let prepared = built.prepare(&at.params).unwrap();
        let start = built.outputs().iter().take_while(|o| o.name != "time_derivative");
        let start: usize = start.map(|o| o.components.len()).sum();
        assert_ne!(prepared.outputs(at.t, &at.state)[start + 1..start + 3], [0.0, 0.0]);
    }
    // Fixed parameters have no column.
    let stiff = scene::build(&model, "stiff").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(stiff.params().len(), 1);
    let interpreter = stiff.prepare(&[0.25]).unwrap();
    let y = [0.3, -0.4, 0.6];
    let stiff_rows = interpreter.matrix(Derivative::Sensitivity, 0.7, &y).unwrap();
    let whole_rows = built.prepare(&[2.0, 0.25]).unwrap().matrix(Derivative::Sensitivity, 0.7, &y).unwrap();
    assert_eq!((stiff_rows[0].len(), whole_rows[0].len()), (1, 2));
    let column = |rows: &[Vec<f64>], j: usize| rows.iter().map(|row| row[j]).collect::<Vec<_>>();
    models::close("df/dc", &column(&stiff_rows, 0), &column(&whole_rows, 1), 1e-14);
    // A scene that wants no products has none.
    assert!(stiff.products().is_empty() && stiff.program().function_idx(&Derivative::Jvp.role()).is_none());
    assert!(interpreter.product(Derivative::Jvp, 0.0, &y, &y).is_none());
}

#[test]
fn a_scene_without_derivatives_does_not_pay_for_them() {
    for name in ["heavy_top", "veselova"] {
        let plain = build(name, scene::DEFAULT);
        assert!(plain.matrices().is_empty() && plain.products().is_empty());
        assert!(Derivative::ALL.iter().all(|d| plain.program().function_idx(&d.role()).is_none()));
        assert!(plain.program().functions.iter().all(|f| f.argument.is_empty()));
        assert_eq!(
            operations(plain.program(), &Role::Rate),
            operations(&derivatives_of(name).program, &Role::Rate)
        );
    }
}

/// A compiled scene with a Jacobian against the interpreter and against dual numbers run through compiled code.
fn compare_compiled<S, D, const N: usize>(
    model: &str,
    compiled_products: impl Fn(&S, f64, &[f64; N], &[f64; N]) -> Vec<(Derivative, Vec<f64>)>,
) where
    S: Scene<f64> + Differentiable<f64, State = [f64; N]>,
    D: Scene<Dual<f64>, State = [Dual<f64>; N]>,
{
    let built = derivatives_of(model);
    let mut random = Random(5);
    for at in points(built, 20) {
        let compiled = S::prepare(&at.params).unwrap_or_else(|e| panic!("{e}"));
        let interpreter = built.prepare(&at.params).unwrap_or_else(|e| panic!("{e}"));
        let y: [f64; N] = at.state.as_slice().try_into().unwrap();
        let mut rows = vec![[f64::NAN; N]; N];
        compiled.jacobian(at.t, &y, &mut rows);
        let expected = interpreter.matrix(Derivative::Jacobian, at.t, &y).unwrap();
        for (row, expected) in rows.iter().zip(&expected) {
            assert_eq!(row.map(f64::to_bits).as_slice(), bits(expected), "{model}");
        }
        let v: [f64; N] = vector(&mut random, N).try_into().unwrap();
        for (derivative, found) in compiled_products(&compiled, at.t, &y, &v) {
            let expected = interpreter.product(derivative, at.t, &y, &v).unwrap();
            assert_eq!(bits(&found), bits(&expected), "{model}: {}", derivative.name());
        }
        // The compiled right-hand side on dual numbers.
        let params: Vec<Dual<f64>> = at.params.iter().map(|p| Dual::constant(*p)).collect();
        let system = D::prepare(&params).unwrap_or_else(|e| panic!("{e}"));
        let size = rows.as_flattened().iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        for j in 0..N {
            let mut moved = y.map(Dual::constant);
            moved[j].derivative = 1.0;
            let mut rates = moved.zeros_like();
            system.rhs(Dual::constant(at.t), &moved, &mut rates);
            for (i, rate) in rates.iter().enumerate() {
                // Both sum products of numbers of that size; a few hundred units in the last place.
                let error = (rate.derivative - rows[i][j]).abs();
                assert!(error <= 1e-13 * size, "{model}: J[{i}][{j}] is off by {error:e}");
            }
        }
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn compiled_derivatives_equal_the_interpreter_bit_for_bit() {
    use hamel_models::generated::{chaplygin_sleigh, chaplygin_sleigh_derivatives as sleigh};
    use hamel_models::generated::{heavy_top, heavy_top_derivatives as top};
    use hamel_models::generated::{veselova, veselova_derivatives as body};
    macro_rules! compare {
        ($derivatives:ident, $plain:ident, $n:literal) => {
            compare_compiled::<$derivatives::Prepared, $plain::Prepared<Dual<f64>>, $n>(
                stringify!($plain),
                |s, t, y, v| {
                    vec![
                        (Derivative::Jvp, s.jvp(t, y, v).to_vec()),
                        (Derivative::Vjp, s.vjp(t, y, v).to_vec()),
                    ]
                },
            );
        };
    }
    compare!(sleigh, chaplygin_sleigh, 2);
    compare!(top, heavy_top, 6);
    compare!(body, veselova, 6);
    // A direction of the parameters, and the dense matrix beside its entries.
    let built = derivatives_of("heavy_top");
    let at = &points(built, 1)[0];
    let v: Vec<f64> = vector(&mut Random(9), at.params.len());
    let compiled = <top::Prepared as Scene<f64>>::prepare(&at.params).unwrap();
    let (interpreter, y) = (built.prepare(&at.params).unwrap(), at.state.as_slice().try_into().unwrap());
    let product = compiled.sensitivity_jvp(at.t, &y, v.as_slice().try_into().unwrap());
    let expected = interpreter.product(Derivative::SensitivityJvp, at.t, &y, &v).unwrap();
    assert_eq!(bits(&product), bits(&expected));
    let w: [f64; 6] = vector(&mut Random(10), 6).try_into().unwrap();
    let product = compiled.sensitivity_vjp(at.t, &y, &w);
    let expected = interpreter.product(Derivative::SensitivityVjp, at.t, &y, &w).unwrap();
    assert_eq!(bits(&product), bits(&expected));
    let dense = compiled.sensitivity(at.t, &y);
    let entries = compiled.sensitivity_nonzeros(at.t, &y);
    for ((i, j), entry) in top::SENSITIVITY_PATTERN.into_iter().zip(entries) {
        assert_eq!(dense[i][j].to_bits(), entry.to_bits());
    }
    let n_zeros = dense.as_flattened().iter().filter(|x| **x == 0.0).count();
    assert!(n_zeros >= dense.as_flattened().len() - top::SENSITIVITY_PATTERN.len());
}

/// The gradient of a component at the end by the initial state and all parameters of a generated scene, in reverse mode
/// and by dual numbers along the same steps.
#[test]
fn reverse_mode_has_the_gradient_of_dual_numbers() {
    use hamel_models::generated::heavy_top_derivatives::Prepared;
    use hamel_runtime::{Checkpoint, DiscreteAdjoint, Vern9};
    const N: usize = 6;
    const N_PARAMS: usize = 9;
    let params: Vec<f64> = <Prepared as Scene<f64>>::INFO.params.iter().map(|p| p.default).collect();
    let start = [0.4, -0.3, 2.0, 0.0, 0.6, 0.8];
    let times: [f64; 26] = std::array::from_fn(|k| 0.04 * k as f64);
    let top = <Prepared as Scene<f64>>::prepare(&params).unwrap();
    let mut checkpoints = vec![Checkpoint::new(&start); 4];
    let last = times.len() - 1;
    let covector = |k: usize, _: &[f64; N], c: &mut [f64; N]| c[4] += if k == last { 1.0 } else { 0.0 };
    let (mut by_start, mut by_params) = ([0.0; N], [0.0; N_PARAMS]);
    let gradient = (&mut by_start, &mut by_params[..]);
    DiscreteAdjoint::new(&top, Vern9, &times).gradient(&start, &mut checkpoints, covector, gradient).unwrap();
    let found: Vec<f64> = by_start.into_iter().chain(by_params).collect();
    let dual = |along: usize| -> f64 {
        let seed = |x: f64, at: usize| Dual::new(x, f64::from(u8::from(at == along)));
        let values: Vec<Dual> = params.iter().enumerate().map(|(k, p)| seed(*p, N + k)).collect();
        let top = <Prepared<Dual> as Scene<Dual>>::prepare(&values).unwrap();
        let start = std::array::from_fn(|k| seed(start[k], k));
        let options = Options::fixed(Dual::constant(0.04));
        let mut solver = Integrator::new(&top, Vern9, Dual::constant(0.0), start, options).unwrap();
        solver.integrate_to(Dual::constant(times[last])).unwrap();
        solver.state()[4].derivative
    };
    let size = found.iter().fold(0.0, |max: f64, x| max.max(x.abs()));
    for (along, found) in found.iter().enumerate() {
        // Rounding of four hundred stages of some fifty operations.
        assert!((found - dual(along)).abs() <= 1e-12 * size, "{along}: {found} and {}", dual(along));
    }
}

mod variational {
    use super::*;
    use hamel_models::generated::heavy_top_derivatives::Prepared;

    const N: usize = 6;
    const N_PARAMS: usize = 9;

    /// `y' = f(t, y; p)` with `s' = J s + (df/dp) q`, the derivative of the motion along a direction of initial state
    /// and parameters.
    struct Variational {
        top: Prepared,
        direction: [f64; N_PARAMS],
    }

    impl System<f64> for Variational {
        type State = [f64; 2 * N];

        fn rhs(&self, t: f64, z: &[f64; 2 * N], dz: &mut [f64; 2 * N]) {
            let (y, s) = (first(z), z[N..].try_into().expect("six of twelve"));
            let mut dy = [0.0; N];
            self.top.rhs(t, &y, &mut dy);
            dz[..N].copy_from_slice(&dy);
            let (moved, forced) = (self.top.jvp(t, &y, &s), self.top.sensitivity_jvp(t, &y, &self.direction));
            for (slot, (a, b)) in dz[N..].iter_mut().zip(moved.into_iter().zip(forced)) {
                *slot = a + b;
            }
        }
    }

    fn first(z: &[f64; 2 * N]) -> [f64; N] {
        z[..N].try_into().expect("six of twelve")
    }

    fn motion<S: System<f64>>(system: &S, initial: S::State) -> S::State {
        let options = Options::adaptive(1e-13, 1e-13);
        let mut integrator = Integrator::new(system, Dop853, 0.0, initial, options).unwrap();
        integrator.integrate_to(1.0).unwrap();
        integrator.state().clone()
    }

    /// `df/dh` at zero by central differences at steps `h, h/2, h/4, h/8`, extrapolated to `h = 0` (Richardson).
    fn extrapolated(mut f: impl FnMut(f64) -> Vec<f64>) -> Vec<f64> {
        let mut previous: Vec<Vec<f64>> = Vec::new();
        for level in 0..4 {
            let h = 0.02 / f64::from(1 << level);
            let (above, below) = (f(h), f(-h));
            let mut row: Vec<Vec<f64>> =
                vec![above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * h)).collect()];
            for (k, coarse) in previous.iter().enumerate() {
                let weight = f64::from(4_u32.pow(k as u32 + 1));
                let fine = &row[k];
                let better = fine.iter().zip(coarse).map(|(a, b)| a + (a - b) / (weight - 1.0)).collect();
                row.push(better);
            }
            previous = row;
        }
        previous.pop().unwrap_or_default()
    }

    #[test]
    fn variational_equations_give_the_derivative_of_the_motion() {
        let params = <Prepared as Scene<f64>>::INFO.params.iter().map(|p| p.default).collect::<Vec<f64>>();
        let mut random = Random(13);
        let direction: [f64; N_PARAMS] = vector(&mut random, N_PARAMS).try_into().unwrap();
        let v = vector(&mut random, N);
        let y = [0.4, -0.3, 2.0, 0.0, 0.6, 0.8];
        let prepared = |h: f64| -> Prepared {
            let values: Vec<f64> = params.iter().zip(direction).map(|(p, q)| p + h * q).collect();
            Scene::prepare(&values).unwrap()
        };
        let mut z = [0.0; 2 * N];
        z[..N].copy_from_slice(&y);
        z[N..].copy_from_slice(&v);
        let found = motion(&Variational { top: prepared(0.0), direction }, z);
        // The same by dual numbers, without derivatives in the scene.
        let duals: Vec<Dual> = params.iter().zip(direction).map(|(p, q)| Dual::new(*p, q)).collect();
        let systems: [hamel_models::generated::heavy_top::Prepared<Dual>; 1] =
            [Scene::prepare(&duals).unwrap()];
        let variational = hamel_runtime::Variational::<_, _, [f64; 2 * N]>::new(&systems, [Dual::ZERO; N]);
        models::close("derivative by dual numbers", &motion(&variational, z), &found, 1e-11);
        let expected = extrapolated(|h| {
            let mut moved = y;
            moved.iter_mut().zip(&v).for_each(|(y, v)| *y += h * v);
            motion(&prepared(h), moved).to_vec()
        });
        assert!(expected.iter().all(|d| d.abs() > 1e-3));
        // The extrapolation is of order 8; the integration's tolerance over the smallest step is a few 1e-10.
        models::close("derivative of the motion", &found[N..], &expected, 1e-8);
    }
}
