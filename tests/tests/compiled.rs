//! Compiled scenes, by rustc and in memory, against the interpreter, bit for bit, and generation against itself.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_jit::Compiled;
use hamel_program::program::{Point, Role, Run};
use hamel_runtime::{Dual, F64x4, Failure, Real, Scene, StateVector};
use hamel_tests::derived::keep;
use hamel_tests::models::{build, build_from_shelf, model, names, names_on_shelf, text};
use hamel_tests::random::Random;

fn same_bits(what: &str, compiled: &[f64], interpreted: &[f64]) {
    for (k, (a, b)) in compiled.iter().zip(interpreted).enumerate() {
        assert!(a.is_finite(), "{what}, component {k} is {a}");
        assert_eq!(a.to_bits(), b.to_bits(), "{what}, component {k}: compiled {a}, interpreted {b}");
    }
}

/// Random parameters near the defaults and random states: right-hand side, energy and outputs, to the last bit.
fn compare<S: Scene<f64>>(built: &BuiltScene, zeros: S::State) -> usize {
    let info = S::INFO;
    let label = format!("{} {}", info.model, info.scene);
    assert_eq!(info.state, built.state_names(), "{label}: state");
    let mut random = Random(20_261_121);
    let mut compared = 0;
    for round in 0..40 {
        let spread = if round == 0 { 0.0 } else { 0.05 };
        let params: Vec<f64> =
            info.params.iter().map(|p| p.default * (1.0 + spread * random.number())).collect();
        let mut interpreter = built.prepare(&params).unwrap_or_else(|e| panic!("{label}: {e}"));
        let mut compiled = S::prepare(&params).unwrap_or_else(|e| panic!("{label}: {e}"));
        let inputs: Vec<f64> = S::INPUTS_OF.iter().map(|_| random.number()).collect();
        interpreter.set_inputs(&inputs);
        compiled.hold_inputs_of(&inputs);
        let mut y = zeros.clone();
        // Inside (0, 1): every coordinate is in its domain there.
        y.as_mut_slice().iter_mut().for_each(|x| *x = 0.5 + 0.45 * random.number());
        let t = random.number();
        let mut dy = zeros.clone();
        compiled.rhs(t, &y, &mut dy);
        let mut expected = vec![0.0; info.state.len()];
        interpreter.rhs(t, y.as_slice(), &mut expected);
        same_bits(&label, dy.as_slice(), &expected);
        compared += expected.len();
        let energy = compiled.energy_of(t, &y);
        assert_eq!(
            energy.map(f64::to_bits),
            interpreter.energy(t, y.as_slice()).map(f64::to_bits),
            "{label}"
        );
        let mut outputs = vec![0.0; info.n_outputs()];
        compiled.outputs_of(t, &y, &mut outputs);
        same_bits(&label, &outputs, &interpreter.outputs(t, y.as_slice()));
        compared += outputs.len();
        assert!(compiled.check(t, &y).is_ok() && interpreter.check(t, y.as_slice()).is_ok(), "{label}");
        let mut pivots = Vec::new();
        compiled.pivots(t, &y, &mut |p| pivots.push((p.name, p.value.to_bits(), p.scale.to_bits())));
        let interpreted = interpreter.pivots(t, y.as_slice());
        let bits = interpreted.iter().map(|(name, p, s)| (*name, p.to_bits(), s.to_bits()));
        assert_eq!(pivots, bits.collect::<Vec<_>>(), "{label}");
        let signatures = [compiled.signature(t, &y), interpreter.signature(t, y.as_slice())];
        assert_eq!(signatures[0].to_bits(), signatures[1].to_bits(), "{label}");
        // Also outside of every interval.
        y.as_mut_slice().iter_mut().for_each(|x| *x = 4.0 * random.number());
        let outside = |result: Result<(), Failure>| match result {
            Ok(()) => None,
            Err(Failure::OutsideDomain { condition, .. }) => Some(condition.to_owned()),
            Err(other) => panic!("{label}: {other}"),
        };
        assert_eq!(outside(compiled.domain(t, &y)), interpreter.domain(t, y.as_slice()).err(), "{label}");
    }
    compared
}

/// Right-hand side and energy over dual numbers, along a random direction of parameters, time and state: values and
/// derivatives to the last bit. Products of a derivative are rounded in the order of the factors, which the values do
/// not show.
fn compare_on_duals<S: Scene<Dual>>(built: &BuiltScene, zeros: S::State) -> usize {
    let (label, program) = (built.name(), built.program());
    let mut random = Random(20_261_124);
    let mut compared = 0;
    for _ in 0..8 {
        let mut dual = |value: f64| Dual::new(value, random.number());
        let params: Vec<Dual> = S::INFO.params.iter().map(|p| dual(p.default)).collect();
        let prepared = program.prepare(&params).unwrap_or_else(|e| panic!("{label}: {e}"));
        let compiled = S::prepare(&params).unwrap_or_else(|e| panic!("{label}: {e}"));
        let t = dual(0.3);
        let mut y = zeros.clone();
        y.as_mut_slice()
            .iter_mut()
            .for_each(|x| *x = Dual::new(0.5 + 0.45 * random.number(), random.number()));
        let mut dy = zeros.clone();
        compiled.rhs(t, &y, &mut dy);
        let mut found = dy.as_slice().to_vec();
        let mut expected = vec![Dual::ZERO; found.len()];
        let point = Point { t, state: y.as_slice(), argument: &[] };
        let rate = program.function_idx(&Role::Rate).unwrap_or_else(|| panic!("{label}: no right-hand side"));
        program.run_at(rate, &params, &prepared, point, &mut expected);
        if let (Some(energy), Some(k)) = (compiled.energy_of(t, &y), program.function_idx(&Role::Energy)) {
            let mut out = [Dual::ZERO];
            program.run_at(k, &params, &prepared, point, &mut out);
            found.push(energy);
            expected.extend(out);
        }
        for (k, (a, b)) in found.iter().zip(&expected).enumerate() {
            for (a, b) in [(a.value, b.value), (a.derivative, b.derivative)] {
                assert!(
                    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(),
                    "{label}, component {k} over dual numbers: compiled {a}, interpreted {b}"
                );
                compared += usize::from(a.is_finite());
            }
        }
    }
    compared
}

/// Every function of a shipped scene is compared with its definition; that a time is Hamiltonian is proved
/// symbolically.
fn is_held_to_its_definition(built: &BuiltScene) {
    let certificate = built.certificate();
    let label = format!("{} {}: {}", built.equations().system.name, built.name(), certificate.sentence());
    assert_eq!(certificate.n_points, 3, "{label}");
    assert!(certificate.open.keys().all(|name| name == "hamiltonian_time"), "{label} {:?}", certificate.open);
}

/// Every function of a scene compiled in memory, on numbers and on lanes, to the last bit. Points are everywhere, so
/// that there are NaN among the values, and angles beyond the kernel of sine and cosine.
fn compare_in_memory(built: &BuiltScene) -> usize {
    is_held_to_its_definition(built);
    let (label, program) = (built.name(), built.program());
    let compiled = Compiled::new(program).unwrap_or_else(|e| panic!("{label}: {e}"));
    compiled.compile(true).unwrap_or_else(|e| panic!("{label}: {e}"));
    let params: Vec<f64> = built.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let prepared = program.prepare(&params).unwrap_or_else(|e| panic!("{label}: {e}"));
    let mut random = Random(20_261_123);
    let mut compared = 0;
    for (k, function) in program.functions.iter().enumerate() {
        for round in 0..12 {
            let mut scale = || if round % 4 == 3 { 4e6 * random.number() } else { 4.0 * random.number() };
            let mut numbers =
                |n: usize| -> Vec<[f64; 4]> { (0..n).map(|_| [(); 4].map(|()| scale())).collect() };
            let (t, state, argument) =
                (numbers(1)[0], numbers(program.state.len()), numbers(function.argument.len()));
            let mut expected = vec![[0.0; 4]; function.results.len()];
            for lane in 0..4 {
                let of = |vector: &[[f64; 4]]| vector.iter().map(|x| x[lane]).collect::<Vec<f64>>();
                let (state, argument) = (of(&state), of(&argument));
                let point = Point { t: t[lane], state: &state, argument: &argument };
                let mut out = [vec![0.0; expected.len()], vec![0.0; expected.len()]];
                program.run_at(k, &params, &prepared, point, &mut out[0]);
                Run::run_at(&compiled, k, &params, &prepared, point, &mut out[1]);
                for (at, expected) in expected.iter_mut().enumerate() {
                    let (a, b) = (out[0][at], out[1][at]);
                    assert!(
                        a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(),
                        "{label} {function:?}: {a} {b}"
                    );
                    expected[lane] = a;
                }
            }
            let splat = |values: &[f64]| values.iter().copied().map(F64x4::splat).collect::<Vec<F64x4>>();
            let wide = |vector: &[[f64; 4]]| vector.iter().copied().map(F64x4::new).collect::<Vec<F64x4>>();
            let (state, argument) = (wide(&state), wide(&argument));
            let point = Point { t: F64x4::new(t), state: &state, argument: &argument };
            let mut out = splat(&vec![0.0; expected.len()]);
            compiled.run_at(k, &splat(&params), &splat(&prepared), point, &mut out);
            for (a, b) in expected.iter().flatten().zip(out.iter().flat_map(|x| x.to_array())) {
                assert!(
                    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(),
                    "{label} {function:?}: {a} {b}"
                );
                compared += usize::from(a.is_finite());
            }
        }
    }
    compared
}

macro_rules! compare_all {
    ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => {
        /// Models and scenes that are compiled.
        const COMPILED: &[(&str, &str)] = &[$(($model, $scene)),*];

        /// How many numbers were compared for each of them.
        fn compare_every_scene() -> Vec<usize> {
            vec![$({
                let built = build($model, $scene);
                keep($model, &text($model), &built);
                use hamel_models::generated::$module::Prepared;
                let counts = [
                    compare_in_memory(&built),
                    compare::<Prepared>(&built, [0.0; $n]),
                    compare_on_duals::<Prepared<Dual>>(&built, [Dual::ZERO; $n]),
                ];
                assert!(counts.iter().all(|count| *count > 0), "{} {}: {counts:?}", $model, $scene);
                counts.iter().sum()
            }),*]
        }
    };
}

hamel_models::for_each_scene!(compare_all);

/// What runs a model that has no generated module: rates and energy, and nothing that takes minutes to derive.
#[test]
fn the_shelf_in_memory_has_the_bits_of_the_interpreter() {
    for name in names_on_shelf() {
        let compared = compare_in_memory(&build_from_shelf(&name));
        assert!(compared > 0, "{name}");
        println!("{name}: {compared} numbers");
    }
}

#[test]
fn every_compiled_scene_equals_the_interpreter_bit_for_bit() {
    let compared = compare_every_scene();
    println!("{} scenes, {} numbers", compared.len(), compared.iter().sum::<usize>());
}

#[test]
fn every_spec_has_all_its_scenes_compiled() {
    let specs = names();
    for name in &specs {
        for scene in scene::names(&model(name)) {
            assert!(COMPILED.contains(&(name.as_str(), scene.as_str())), "{name} {scene} is not compiled");
        }
    }
    assert!(specs.len() >= 9, "the nine systems of the first version are there");
}

#[test]
fn generating_twice_gives_the_same_bytes() {
    for name in ["heavy_top", "euler_disk_advected", "extended_pose"] {
        let texts: Vec<String> =
            (0..2).map(|_| build(name, scene::DEFAULT).emit().unwrap_or_else(|e| panic!("{e}"))).collect();
        assert!(texts[0].contains("pub fn rhs"));
        assert_eq!(texts[0], texts[1], "{name}");
    }
}

#[test]
fn invalid_parameters_are_refused_by_name() {
    use hamel_models::generated::heavy_top::{Params, Prepared};
    let negative = Prepared::new(&Params { m: -1.0, ..Params::default() }).unwrap_err();
    assert_eq!(negative.condition, "m > 0");
    let infinite = Prepared::new(&Params { g: f64::NAN, ..Params::default() }).unwrap_err();
    assert_eq!(infinite.condition, "g is finite");
}

#[test]
fn a_vanishing_pivot_is_named() {
    use hamel_models::generated::veselova::{Params, Prepared};
    let system: Prepared = Prepared::new(&Params::default()).unwrap();
    let failure = system.check(1.5, &[1.0, 2.0, 3.0, 0.0, 0.0, 0.0]).unwrap_err();
    assert!(failure.to_string().contains("dot(Omega, gamma) = 0"), "{failure}");
}

#[test]
fn a_generated_file_works_under_include() {
    use hamel_tests::included;
    let y = [0.4, -0.3, 2.0, 0.0, 0.6, 0.8];
    let (mut one, mut other) = ([0.0; 6], [0.0; 6]);
    included::Prepared::new(&included::Params::default()).unwrap().rhs(0.0, &y, &mut one);
    let module: hamel_models::generated::heavy_top::Prepared =
        hamel_models::generated::heavy_top::Prepared::new(&Default::default()).unwrap();
    module.rhs(0.0, &y, &mut other);
    assert!(one.iter().all(|d| *d != 0.0));
    assert_eq!(one, other);
    assert_eq!(included::INFO.state, hamel_models::generated::heavy_top::INFO.state);
}
