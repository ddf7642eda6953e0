//! Invariants that scenes find by themselves: which ones, their gradients, and projection onto them.

use hamel_codegen::{scene, spec};
use hamel_models::generated::{chaplygin_ball_invariants, heavy_top_invariants};
use hamel_runtime::{Dual, Integrator, Invariants, Method, Options, Projected, Scene, StateVector, Vern9};
use hamel_tests::models::text_with;
use hamel_tests::random::Random;

/// Names of the invariants of a scene, or the problem.
fn found(text: &str, scene: &str) -> Result<Vec<String>, String> {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, scene).map_err(|e| e.to_string())?;
    Ok(built.invariant_names().expect("the scene wants them"))
}

fn of_model(name: &str, items: &str) -> Vec<String> {
    let text = text_with(name, &format!("scene kept {{ want invariants; {items} }}"));
    found(&text, "kept").unwrap_or_else(|e| panic!("{e}"))
}

/// A model of one or two coordinates with a scene that wants its invariants.
fn of_items(items: &str) -> Result<Vec<String>, String> {
    found(&format!("model small {{ {items} scene kept {{ want invariants; }} }}"), "kept")
}

#[test]
fn a_conserved_energy_is_found_and_no_other() {
    let spring = "coordinate q in real; param k = 2; lagrangian = q_dot^2/2 - k*q^2/2;";
    assert_eq!(of_items(spring).unwrap(), ["energy"]);
    for moved in [" force q_dot = -k*q_dot;", " constraint q_dot = 1;"] {
        let problem = of_items(&format!("{spring}{moved}")).unwrap_err();
        assert!(problem.contains("scene kept has no invariant besides components of its state"), "{problem}");
    }
    let driven = "coordinate q in real; lagrangian = q_dot^2/2 + q*sin(t);";
    assert!(of_items(driven).is_err());
    // A force that does no work.
    let turned = "coordinate x in real; coordinate y in real; lagrangian = (x_dot^2 + y_dot^2)/2 - x^2;
        force x_dot = y*y_dot; force y_dot = -y*x_dot;";
    assert_eq!(of_items(turned).unwrap(), ["energy"]);
}

#[test]
fn momenta_of_ignorable_coordinates_are_found() {
    let orbit = "coordinate r in (0, 100); coordinate phi in angle;
        lagrangian = (r_dot^2 + r^2*phi_dot^2)/2 + 1/r;";
    assert_eq!(of_items(orbit).unwrap(), ["energy", "p_phi_dot"]);
    // A momentum that is a component of the state is constant as it is.
    let free = "coordinate x in real; coordinate y in real; lagrangian = (x_dot^2 + y_dot^2)/2 - y;";
    assert_eq!(of_items(free).unwrap(), ["energy"]);
}

#[test]
fn norms_and_products_of_what_the_group_turns_are_found() {
    assert_eq!(of_model("heavy_top", ""), ["C1", "C2", "energy"]);
    assert_eq!(of_model("chaplygin_ball", ""), ["C1", "energy"]);
    let top = "param I: diagonal(3) = [2, 1.5, 0.8]; velocity Omega in so(3);
        advected Gamma in R^3 by cross(Omega, Gamma); advected Delta in R^3 by cross(Omega, Delta);
        lagrangian = dot(Omega, I*Omega)/2 - Gamma1 - Delta2;
        reconstruct q in SO(3) from Omega;";
    let expected = ["Gamma_dot_Gamma", "Gamma_dot_Delta", "Delta_dot_Delta", "energy"];
    assert_eq!(of_items(top).unwrap(), expected);
    let moved =
        found(&format!("model top {{ {top} scene kept {{ want invariants, reconstruction; }} }}"), "kept");
    let expected = ["Gamma_dot_Gamma", "Gamma_dot_Delta", "Delta_dot_Delta", "q_dot_q", "energy"];
    assert_eq!(moved.unwrap(), expected);
}

#[test]
fn momenta_in_space_are_found_where_the_group_is_a_symmetry() {
    let wants = |items: &str, wants: &str| {
        found(&format!("model free {{ {items} scene kept {{ want {wants}; }} }}"), "kept").unwrap()
    };
    let body =
        "param I: diagonal(3) = [2, 1.5, 0.8]; velocity Omega in so(3); lagrangian = dot(Omega, I*Omega)/2;";
    for side in ["left", "right"] {
        let items = format!("{body} action {side}; reconstruct q in SO(3) from Omega;");
        // The third momentum is a function of the others; none without the attitude.
        let expected = ["q_dot_q", "energy", "p_Omega_dot_p_Omega", "space_p_Omega1", "space_p_Omega2"];
        assert_eq!(wants(&items, "invariants, reconstruction"), expected, "{side}");
        assert_eq!(wants(&items, "invariants"), ["energy", "p_Omega_dot_p_Omega"], "{side}");
    }
    let plate = "param m: diagonal(2) = [2, 3]; velocity omega, v in se(2);
        lagrangian = omega^2/2 + dot(v, m*v)/2; reconstruct theta, x, y in SE(2);";
    for side in ["left", "right"] {
        let items = format!("{plate} action {side};");
        let expected = ["energy", "space_p_omega", "space_p_v1", "space_p_v2"];
        assert_eq!(wants(&items, "invariants, reconstruction"), expected, "{side}");
    }
    // The weight leaves none of them alone but the one along it, which a Casimir has already.
    let top = of_model("heavy_top", "want reconstruction;");
    assert_eq!(top, ["C1", "C2", "q_dot_q", "energy"]);
    let kirchhoff = of_model("kirchhoff_body", "want reconstruction;");
    assert_eq!(kirchhoff, ["C1", "C2", "q_dot_q", "energy", "space_p_V1", "space_p_V2"]);
}

#[test]
fn a_point_of_the_circle_stays_on_it() {
    assert_eq!(of_model("euler_disk", "circle theta; drop phi;"), ["theta_circle", "energy"]);
}

#[test]
fn with_multipliers_the_constraint_is_kept() {
    // The energy is conserved only where the constraint holds.
    let kept = of_model("veselova", "");
    assert!(kept.iter().any(|name| name.starts_with("residual_")), "{kept:?}");
    assert!(!kept.contains(&"energy".to_owned()), "{kept:?}");
}

/// Gradients against dual numbers, at random states; returns the largest relative error.
fn gradient_error<const N: usize, const K: usize, S, D>() -> f64
where
    S: Scene<f64> + Invariants<f64, K, State = [f64; N]>,
    D: Scene<Dual> + Invariants<Dual, K, State = [Dual; N]>,
{
    let defaults: Vec<f64> = S::INFO.params.iter().map(|p| p.default).collect();
    let duals: Vec<Dual> = defaults.iter().map(|x| Dual::constant(*x)).collect();
    let (scene, dual) = (S::prepare(&defaults).unwrap(), D::prepare(&duals).unwrap());
    let mut random = Random(20_261_121);
    let mut worst = 0.0_f64;
    for _ in 0..100 {
        let y: [f64; N] = std::array::from_fn(|_| random.number());
        let mut gradients = [[0.0; N]; K];
        scene.gradients(0.0, &y, &mut gradients);
        for j in 0..N {
            let moved: [Dual; N] = std::array::from_fn(|i| Dual::new(y[i], f64::from(u8::from(i == j))));
            for (gradient, value) in gradients.iter().zip(dual.values(Dual::constant(0.0), &moved)) {
                worst = worst.max((gradient[j] - value.derivative).abs() / (1.0 + gradient[j].abs()));
            }
        }
        assert!(gradients.iter().flatten().any(|x| *x != 0.0));
    }
    worst
}

#[test]
fn gradients_are_the_derivatives_of_the_values() {
    use chaplygin_ball_invariants::Prepared as Ball;
    use heavy_top_invariants::Prepared as Top;
    // Sums of some ten products, in another order.
    let errors = [gradient_error::<6, 3, Top, Top<Dual>>(), gradient_error::<6, 2, Ball, Ball<Dual>>()];
    assert!(errors.iter().all(|e| *e < 1e-14), "{errors:?}");
}

/// The largest change of an invariant, relative to one plus its size, over some steps.
fn drift<const K: usize, S: Invariants<f64, K>>(
    system: &S,
    method: impl Method<f64, S>,
    start: S::State,
    n_steps: u32,
) -> f64 {
    let levels = system.values(0.0, &start);
    let mut solver = Integrator::new(system, method, 0.0, start, Options::fixed(0.05)).unwrap();
    let mut worst = 0.0_f64;
    for _ in 0..n_steps {
        let _ = solver.step_towards(1e9).unwrap();
        for (value, level) in system.values(solver.t(), solver.state()).iter().zip(levels) {
            worst = worst.max((value - level).abs() / (1.0 + level.abs()));
        }
    }
    assert!(solver.state().as_slice().iter().all(|x| x.is_finite()));
    worst
}

#[test]
fn projection_keeps_the_invariants_to_round_off() {
    use chaplygin_ball_invariants::Prepared as Ball;
    use heavy_top_invariants::Prepared as Top;
    let top: Top = Scene::prepare(&heavy_top_invariants::Params::default().to_array()).unwrap();
    let ball: Ball = Scene::prepare(&chaplygin_ball_invariants::Params::default().to_array()).unwrap();
    let (top_start, ball_start) = ([0.4, -0.3, 2.0, 0.0, 0.6, 0.8], [0.5, -1.0, 1.5, 0.0, 0.6, -0.8]);
    let n_steps = 20_000;
    let free = [drift(&top, Vern9, top_start, n_steps), drift(&ball, Vern9, ball_start, n_steps)];
    let kept = [
        drift::<3, _>(&top, Projected::<_, 3>::new(Vern9), top_start, n_steps),
        drift::<2, _>(&ball, Projected::<_, 2>::new(Vern9), ball_start, n_steps),
    ];
    println!("{n_steps} steps: {free:?}, projected {kept:?}");
    // A few units in the last place of the largest term of a value; without projection the steps' own errors add up.
    assert!(kept.iter().all(|e| *e < 2e-15), "{kept:?}");
    assert!(free.iter().zip(&kept).all(|(free, kept)| free > &(5.0 * kept)), "{free:?}, {kept:?}");
}
