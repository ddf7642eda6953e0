//! The frame of a chain of stages: the motion is that of the model's own frame, exactly, for random algebras, chains,
//! inner products, sides, connections, constraints and advected parameters; and frames that turn with the shape.

use std::collections::{BTreeMap, BTreeSet};

use hamel_codegen::scene;
use hamel_codegen::spec::{self, InnerProduct, Model, Want};
use hamel_expr::{ExprId, Graph, SymbolId, inlined, rational_to_f64};
use hamel_mechanics::mechanics::{Equations, OutputKind, VerticalEquations, derive};
use hamel_mechanics::reduction::{Formulation, KinematicConstraint, StageUse, reduce};
use hamel_program::program::Role;
use hamel_tests::algebras::{FAMILIES, Transported};
use hamel_tests::bundle::Bundle;
use hamel_tests::draws::{Draws, for_all, one};
use hamel_tests::linear::Rows;
use hamel_tests::problem::Problem;
use hamel_tests::stages::{chain_text, with_items};

const NUMBERS: usize = 3000;

fn parsed(text: &str) -> Model {
    spec::parse("m", text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn derived(model: &Model, stages: StageUse) -> Equations {
    let formulation = Formulation { stages, ..Formulation::of(model) };
    let system = reduce(model, &formulation).unwrap_or_else(|e| panic!("{e}"));
    derive(&system).unwrap_or_else(|e| panic!("{e}"))
}

/// The rates of a system without the names of definitions.
struct Motion<'a> {
    equations: &'a Equations,
    values: BTreeMap<SymbolId, ExprId>,
    g: Graph,
}

impl<'a> Motion<'a> {
    fn new(equations: &'a Equations) -> Motion<'a> {
        let mut g = equations.system.graph.clone();
        let values = inlined(&mut g, equations.sections.iter().flat_map(|s| &s.definitions));
        Motion { equations, values, g }
    }

    fn inlined(&mut self, e: ExprId) -> ExprId {
        self.g.subs(e, &self.values).expect("definitions divide by nothing that vanishes")
    }

    fn rates(&mut self) -> Vec<(String, ExprId)> {
        let state = self.equations.state.iter();
        state.map(|s| (s.name.clone(), s.derivative)).map(|(n, e)| (n, self.inlined(e))).collect()
    }

    /// The derivative along the motion of a function of time and state.
    fn rate_of(&mut self, e: ExprId) -> ExprId {
        let mut terms = vec![self.g.diff(e, self.equations.system.time)];
        for s in &self.equations.state {
            let rate = self.inlined(s.derivative);
            let slope = self.g.diff(e, s.symbol);
            terms.push(self.g.mul(slope, rate));
        }
        self.g.sum(&terms)
    }
}

/// In an internal frame the state is the same, and so is every rate, the energy and the momenta.
fn assert_internal(plain: &Equations, internal: &Equations, what: &str) {
    let (mut one, mut other) = (Motion::new(plain), Motion::new(internal));
    let (expected, found) = (one.rates(), other.rates());
    let energies = (one.inlined(plain.energy), other.inlined(internal.energy));
    let mut pairs = vec![("energy".to_owned(), energies.0, energies.1)];
    for ((name, e), (same, f)) in expected.into_iter().zip(found) {
        assert_eq!(name, same, "{what}");
        pairs.push((name, e, f));
    }
    for output in &plain.outputs {
        let same = internal.outputs.iter().find(|o| o.kind == output.kind && o.name == output.name);
        let same = same.unwrap_or_else(|| panic!("no output {}\n{what}", output.name));
        for ((name, e), (own, f)) in output.components.iter().zip(&same.components) {
            assert_eq!(name, own, "{what}");
            pairs.push((name.clone(), one.inlined(*e), other.inlined(*f)));
        }
    }
    for (name, e, f) in pairs {
        let imported = one.g.import(&other.g, &[f]).expect("it has a value")[0];
        assert!(one.g.is_equal(e, imported), "{name} differs\n{what}");
    }
}

/// A carried state moves as the model's own variables do: `d/dt y(eta) = ydot(y(eta))`.
fn assert_carried(plain: &Equations, carried: &Equations, what: &str) {
    let mut own = Motion::new(plain);
    let mut levels = Motion::new(carried);
    let velocities = carried.outputs.iter().find(|o| o.kind == OutputKind::Group(Want::Velocities));
    let velocities = velocities.unwrap_or_else(|| panic!("no velocities\n{what}"));
    let frame = carried.system.frame.as_ref().expect("a frame");
    let mut values: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
    let n = carried.system.velocities.len() - velocities.components.len();
    for (u, (name, e)) in frame.original[n..].iter().zip(&velocities.components) {
        assert_eq!(u.name, *name);
        let e = levels.inlined(*e);
        values.insert(u.symbol, e);
    }
    // Base velocities that the constraint determines in one frame and not in the other.
    for (u, name) in frame.original[..n].iter().zip(carried.system.algebroid.frame()) {
        let definitions = carried.sections.iter().flat_map(|s| &s.definitions);
        let named = |d: &&hamel_expr::Definition| carried.system.graph.name(d.symbol) == name;
        let is_state = carried.state.iter().any(|s| s.symbol == u.symbol);
        if let Some(d) = definitions.clone().find(named).filter(|_| !is_state) {
            let e = levels.inlined(d.expr);
            values.insert(u.symbol, e);
        }
    }
    for (name, rate) in own.rates() {
        let symbol = plain.state.iter().find(|s| s.name == name).expect("a state variable").symbol;
        let value = match values.get(&symbol) {
            Some(value) => *value,
            None => levels.g.sym(symbol),
        };
        let moved = levels.rate_of(value);
        let imported = levels.g.import(&own.g, &[rate]).expect("it has a value")[0];
        let expected = levels.g.subs(imported, &values).expect("it has a value");
        assert!(levels.g.is_equal(moved, expected), "the rate of {name} differs\n{what}");
    }
    // What says the state in velocities of the model is inverse to what says these in the state.
    for (name, value) in &carried.legendre.momenta {
        let back = levels.g.import(&carried.system.graph, &[*value]).expect("it has a value")[0];
        let back = levels.g.subs(back, &values).expect("it has a value");
        let symbol = carried.state.iter().find(|s| s.name == *name).expect("a state variable").symbol;
        let symbol = levels.g.sym(symbol);
        assert!(levels.g.is_equal(back, symbol), "{name} is not itself\n{what}");
    }
}

fn assert_same_motion(model: &Model, what: &str) {
    let plain = derived(model, StageUse::Unused);
    let internal = derived(model, StageUse::Internal);
    assert_internal(&plain, &internal, what);
    let carried = derived(model, StageUse::Carried(Vec::new()));
    let is_solved = |e: &Equations| matches!(e.system.constraint, KinematicConstraint::Solved(_));
    if is_solved(&plain) == is_solved(&carried) {
        assert_carried(&plain, &carried, what);
    }
    // Momenta along the first level, along all.
    let names = model.stages.as_ref().map(|chain| chain.names.clone()).unwrap_or_default();
    let of_first = carried.system.stages.as_ref().is_some_and(|s| s.levels[0].range.len() > 1);
    for momenta in [&names[..usize::from(of_first)], &names[..]] {
        let momenta: BTreeSet<&String> = momenta.iter().collect();
        let along = derived(model, StageUse::Carried(momenta.into_iter().cloned().collect()));
        if is_solved(&plain) == is_solved(&along) {
            assert_carried(&plain, &along, what);
        }
    }
    for equations in [internal, carried] {
        assert!(VerticalEquations::new(&equations).is_some(), "not the vertical equations\n{what}");
    }
}

#[test]
fn on_an_algebra_the_motion_is_that_of_the_given_basis() {
    for make in FAMILIES {
        let name = make(&mut one(1, 60)).name;
        for_all(name, 1, NUMBERS, |mut draws| {
            let family = make(&mut draws);
            if family.algebra.dim() > 6 {
                return Ok(());
            }
            let (mut problem, transported) = Problem::random(&family, &mut draws);
            for (k, chain) in transported.chains.iter().enumerate() {
                problem.right = k % 2 == 0;
                problem.rows.clear();
                let n = family.algebra.dim();
                problem.constrain(k % 3.min(n), &mut draws);
                problem.multipliers = k % 2 == 1;
                let text = with_items(&problem.text(), &chain_text("y", chain, &transported.metric));
                assert_same_motion(&parsed(&text), &text);
            }
            Ok(())
        });
    }
}

/// Bundles over every small family, with and without connection, constraint and advected parameters.
fn for_all_bundles(test: impl Fn(&str, &Transported, &[Rows], &mut Draws)) {
    for make in FAMILIES {
        let family = make(&mut one(3, NUMBERS));
        if family.algebra.dim() > 3 {
            continue;
        }
        for_all(family.name, 1, NUMBERS, |mut draws| {
            let transported = Transported::new(&family, &mut draws);
            for (k, chain) in transported.chains.iter().enumerate() {
                for kind in 0..3 {
                    let mut bundle = Bundle::random(&transported.algebra, (k + kind) % 2 == 0, &mut draws);
                    if kind == 2 {
                        bundle.constrain(true, &mut draws);
                    }
                    if kind == 1 {
                        bundle.advect(&mut draws);
                    }
                    test(&bundle.text(kind != 0), &transported, chain, &mut draws);
                }
            }
            Ok(())
        });
    }
}

#[test]
fn on_a_bundle_the_motion_is_that_of_the_given_basis() {
    for_all_bundles(|text, transported, chain, _| {
        let velocity = if text.contains("velocity xi") { "xi" } else { "v" };
        let text = with_items(text, &chain_text(velocity, chain, &transported.metric));
        assert_same_motion(&parsed(&text), &text);
    });
}

#[test]
fn in_a_frame_that_turns_with_the_shape_the_motion_is_the_same() {
    for_all_bundles(|text, transported, chain, draws| {
        let velocity = if text.contains("velocity xi") { "xi" } else { "v" };
        let text = with_items(text, &chain_text(velocity, chain, &transported.metric));
        let mut model = parsed(&text);
        let stages = model.stages.as_mut().expect("stages");
        stages.inner_product = Some(InnerProduct::Lagrangian);
        // A connection of every stage, with values in the first ideal.
        let g = &mut model.graph;
        let x: Vec<ExprId> = model.base.iter().map(|c| g.sym(c.symbol)).collect();
        let mut rows = vec![vec![g.zero(); x.len()]; model.velocities.len()];
        for vector in &chain[0] {
            for i in 0..x.len() {
                let (c, b) = (g.rational(draws.non_zero()), g.rational(draws.non_zero()));
                let products = [g.mul(b, x[1 - i]), c];
                let along = g.sum(&products);
                for (row, q) in rows.iter_mut().zip(vector) {
                    let term = g.scale(along, q);
                    row[i] = g.add(row[i], term);
                }
            }
        }
        stages.connection = Some(rows);
        let turns = derived(&model, StageUse::Internal);
        let stages = turns.system.stages.as_ref().expect("stages");
        let shape: Vec<SymbolId> = model.base.iter().map(|c| c.symbol).collect();
        let free = |e: &ExprId| turns.system.graph.free_symbols(*e);
        let has_shape = |e: &ExprId| free(e).iter().any(|s| shape.contains(s));
        assert!(stages.basis.iter().flatten().any(has_shape), "the frame is fixed: {text}");
        assert_same_motion(&model, &text);
    });
}

/// A family of ideals with a parameter: lines of the plane of a product, and of the translations of two bodies.
const WITH_PARAMETERS: &str = "model lines {
    param k = 2;
    param m: symmetric(4) = [2, 0.1, 0.2, 0.3, 3, 0.4, 0.5, 4, 0.6, 5];
    algebra h = product(so(2), heisenberg(1));
    velocity w, q, p, z in h;
    let y = [w, q, p, z];
    lagrangian = dot(y, m*y)/2 + k*q;
    stage whole;
    stage plane = ideal(w + k*z, q - k*p, z*(1 + k^2));
    stage line = ideal(w + (k + 1/k)*z, q*0 + z);
    stage centre = ideal(z);
    inner_product = INNER;
}";

#[test]
fn ideals_and_inner_products_with_parameters_have_the_same_motion() {
    for inner in ["m", "lagrangian", "diag([1, k, 1, k^2])"] {
        let text = WITH_PARAMETERS.replace("INNER", inner);
        let model = parsed(&text);
        assert_same_motion(&model, &text);
        let carried = derived(&model, StageUse::Carried(Vec::new()));
        let names: Vec<&str> = carried.state.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["whole", "plane", "line", "centre"]);
    }
}

#[test]
fn an_inner_product_of_shape_and_time_has_the_same_motion() {
    let metric = "[[2, 0, x/4], [0, 1.5, sin(t)/3], [x/4, sin(t)/3, 1 + x^2]]";
    for inner in ["lagrangian", metric, "[[1, x, 0], [x, 2 + x^2, t], [0, t, 1 + t^2]]"] {
        let text = format!(
            "model shape {{ coordinate x in real; velocity q, p, z in heisenberg(1); let y = [q, p, z];
                lagrangian = x_dot^2/2 + dot(y, {metric}*y)/2 + x*x_dot*q/5; stage plane; stage centre = ideal(z);
                inner_product = {inner}; }}"
        );
        assert_same_motion(&parsed(&text), &text);
    }
}

#[test]
fn momenta_along_elements_that_the_state_has_no_velocity_for_are_refused() {
    let text = |items: &str, momenta: &str| {
        format!(
            "model m {{ velocity q, p, z in heisenberg(1); lagrangian = (q^2 + p^2 + z^2)/2; stage plane;
                stage centre = ideal(z); momentum B of stages; {items} scene s {{ carry stages, {momenta}; }} }}"
        )
    };
    for (items, momenta, message) in [
        ("", "B_plane_7", "a stage with the element `plane_7` does not exist"),
        (
            "constraint z = 0;",
            "B_centre",
            "the momentum along `centre`, which the constraints determine, does not",
        ),
    ] {
        let model = parsed(&text(items, momenta));
        let problems = scene::build(&model, "s").unwrap_err().to_string();
        assert!(problems.contains(message), "{problems}");
    }
    // Of all momenta, the others are carried.
    let built = scene::build(&parsed(&text("constraint z = 0;", "B")), "s").unwrap();
    assert_eq!(built.state_names(), ["B_plane_1", "B_plane_2"]);
}

#[test]
fn a_stage_with_an_ideal_for_some_parameters_alone_is_refused() {
    let text = "model m { param k = 0; velocity O, V in se(3); lagrangian = dot(O, O) + dot(V, V);
        stage a; stage b = ideal(V, k*O1); }";
    let problems = spec::parse("m", text).unwrap_err().to_string();
    assert!(problems.contains("stage b is not an ideal of a"), "{problems}");
}

#[test]
fn a_heisenberg_body_by_stages_takes_two_additions_and_six_multiplications() {
    let text = include_str!("../../docs/book/heisenberg.hamel");
    let model = parsed(text);
    for (scene, expected) in [("default", [7, 12]), ("levels", [2, 6])] {
        let built = scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"));
        let counts = built.program().function(&Role::Rate).expect("a right-hand side").counts();
        assert_eq!([counts.add, counts.mul], expected, "{scene}");
    }
    let levels = scene::build(&model, "levels").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(levels.state_names(), ["plane_1", "plane_2", "centre"]);
}

#[test]
fn what_stands_for_velocities_is_converted_both_ways() {
    let text = include_str!("../../docs/book/heisenberg.hamel");
    let model = parsed(text);
    let built = scene::build(&model, "levels").unwrap_or_else(|e| panic!("{e}"));
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let ready = built.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let velocities = [0.7, -0.4, 1.3];
    let eta = ready.legendre(0.0, &[0.0; 3], &velocities).expect("a conversion");
    // `z + (G13 q + G23 p)/G33` along the centre.
    let metric = [0.4 / 1.2, -0.2 / 1.2];
    let along_centre = velocities[2] + metric[0] * velocities[0] + metric[1] * velocities[1];
    assert!((eta[2] - along_centre).abs() < 1e-15 && eta[..2] == velocities[..2], "{eta:?}");
    let back = ready.outputs(0.0, &eta);
    for (a, b) in back.iter().zip(&velocities) {
        assert!((a - b).abs() < 1e-15, "{back:?}");
    }
}

#[test]
fn the_code_of_the_book_is_what_is_emitted() {
    let model = parsed(include_str!("../../docs/book/heisenberg.hamel"));
    let built = scene::build(&model, "levels").unwrap_or_else(|e| panic!("{e}"));
    let module = built.emit().unwrap_or_else(|e| panic!("{e}"));
    let emitted: Vec<&str> = module.lines().map(str::trim).collect();
    let page = include_str!("../../docs/book/stages.md");
    let block = page.split("```text\npub fn rhs").nth(1).and_then(|rest| rest.split("```").next());
    let block = format!("pub fn rhs{}", block.expect("the right-hand side is on the page"));
    let shown: Vec<&str> = block.trim_end().lines().map(str::trim).collect();
    assert!(emitted.windows(shown.len()).any(|lines| lines == shown), "not emitted:\n{block}");
}

/// Pairs of row and column of the strictly upper triangular matrices that a velocity moves along, and the metric that
/// the model has by default.
struct MatrixBody {
    entries: &'static [(usize, usize)],
    metric: Vec<f64>,
}

impl MatrixBody {
    /// `p' = ad*_v p` of `p = G v`: `p'_a = tr(P^T (V E_a - E_a V))`, with products of matrices.
    fn rates_of_momenta(&self, v: &[f64]) -> Vec<f64> {
        let matrix = |x: &[f64]| {
            let mut m = [[0.0; 4]; 4];
            self.entries.iter().zip(x).for_each(|((i, j), x)| m[*i][*j] = *x);
            m
        };
        let p = self.momenta(v);
        let velocity = matrix(v);
        let n = v.len();
        let unit = |a: usize| -> Vec<f64> { (0..n).map(|b| f64::from(u8::from(a == b))).collect() };
        let along = |a: usize| {
            let element = matrix(&unit(a));
            let bracket = |i: usize, j: usize| -> f64 {
                (0..4).map(|k| velocity[i][k] * element[k][j] - element[i][k] * velocity[k][j]).sum()
            };
            self.entries.iter().zip(&p).map(|((i, j), p)| p * bracket(*i, *j)).sum()
        };
        (0..n).map(along).collect()
    }

    /// `G v`.
    fn momenta(&self, v: &[f64]) -> Vec<f64> {
        let n = v.len();
        let at = |i: usize, j: usize| {
            let (i, j) = (i.min(j), i.max(j));
            self.metric[i * n - i * (i + 1) / 2 + j]
        };
        (0..n).map(|i| (0..n).map(|j| at(i, j) * v[j]).sum()).collect()
    }

    /// The rates of the momenta, from the rates of a state of which the velocities are linear functions.
    fn holds<const N: usize>(
        &self,
        rhs: impl Fn(&[f64; N]) -> [f64; N],
        velocities: impl Fn(&[f64; N]) -> [f64; N],
    ) {
        let mut random = hamel_measure::random::Random(7);
        for _ in 0..100 {
            let y: [f64; N] = std::array::from_fn(|_| random.number());
            let found = self.momenta(&velocities(&rhs(&y)));
            let expected = self.rates_of_momenta(&velocities(&y));
            let size = expected.iter().fold(1.0f64, |size, x| size.max(x.abs()));
            for (a, b) in found.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-13 * size, "{found:?} is not {expected:?} at {y:?}");
            }
        }
    }
}

#[test]
fn bodies_on_groups_of_triangular_matrices_move_as_products_of_matrices_say() {
    use hamel_models::generated::{
        heisenberg_body, heisenberg_body_as_written, triangular_body, triangular_body_as_written,
    };
    let metric = |params: &[hamel_runtime::ParamInfo]| params.iter().map(|p| p.default).collect::<Vec<f64>>();
    // `[e_1, e_2] = e_3` for `E_12`, `E_23`, `E_13`.
    let heisenberg =
        MatrixBody { entries: &[(0, 1), (1, 2), (0, 2)], metric: metric(heisenberg_body::INFO.params) };
    let system = heisenberg_body::Prepared::new(&Default::default()).unwrap();
    let rhs = |y: &[f64; 3]| {
        let mut dy = [0.0; 3];
        system.rhs(0.0, y, &mut dy);
        dy
    };
    heisenberg.holds(rhs, |y| system.velocities(0.0, y));
    let written = heisenberg_body_as_written::Prepared::new(&Default::default()).unwrap();
    let rhs = |y: &[f64; 3]| {
        let mut dy = [0.0; 3];
        written.rhs(0.0, y, &mut dy);
        dy
    };
    heisenberg.holds(rhs, |y| *y);
    let triangular = MatrixBody {
        entries: &[(0, 1), (1, 2), (2, 3), (0, 2), (1, 3), (0, 3)],
        metric: metric(triangular_body::INFO.params),
    };
    let system = triangular_body::Prepared::new(&Default::default()).unwrap();
    let rhs = |y: &[f64; 6]| {
        let mut dy = [0.0; 6];
        system.rhs(0.0, y, &mut dy);
        dy
    };
    triangular.holds(rhs, |y| system.velocities(0.0, y));
    let written = triangular_body_as_written::Prepared::new(&Default::default()).unwrap();
    let rhs = |y: &[f64; 6]| {
        let mut dy = [0.0; 6];
        written.rhs(0.0, y, &mut dy);
        dy
    };
    triangular.holds(rhs, |y| *y);
}
