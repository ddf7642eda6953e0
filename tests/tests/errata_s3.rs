//! Misprints of Crampin and Mestdag (S3) that matter for the motion: signs of `C` in the invariant frame, and the
//! momentum.

use hamel_expr::Rational;
use hamel_tests::errata::{Ours, Point, cross, diagonal, generic, minus, plus, spec_text, verdict};
use hamel_tests::linear::{Rows, Vector, dot, identity, int, inverse, product, times, transposed};

/// A system on `R^2 x SO(3)` with a connection that is not flat, at one point.
struct Bundle {
    ours: Ours,
    /// `gamma_i` for each base coordinate.
    gamma: [Vector; 2],
    xdot: Vector,
    v: Vector,
}

impl Bundle {
    fn new() -> Bundle {
        let text = "model m { coordinate x: vector(2) in real; velocity v in so(3);
            connection v = [x2*x1_dot, x1*x2_dot, x1_dot - x2*x2_dot];
            lagrangian = 1/2*(1 + x1^2)*dot(x_dot, x_dot) + 1/2*dot(v, diag([2, 3, 5])*v) + x1_dot*v2/3 - x1*x2; }";
        let [x, xdot] = [1, 2].map(|seed| generic(seed, 2));
        let v = generic(3, 3);
        let point = Point::new().with_vector("x", "", &x).with_vector("x", "_dot", &xdot);
        let ours = Ours::at(text, &point.with_vector("v", "", &v));
        let gamma = [vec![x[1].clone(), int(0), int(1)], vec![int(0), x[0].clone(), -x[1].clone()]];
        Bundle { ours, gamma, xdot, v }
    }

    /// `Upsilon^b_ia v^i`, with `Upsilon^b_ia = gamma_i^c C^b_ac`, that is `[e_a, gamma_i xdot^i]`.
    fn upsilon(&self, a: usize) -> Vector {
        let moved: Vector =
            (0..3).map(|c| dot(&[self.gamma[0][c].clone(), self.gamma[1][c].clone()], &self.xdot)).collect();
        cross(&identity(3)[a], &moved)
    }

    /// `C^b_ac v^c`.
    fn turning(&self, a: usize) -> Vector {
        cross(&identity(3)[a], &self.v)
    }
}

#[test]
fn s3_complete_lift_of_the_invariant_frame() {
    // E_a^C(v^b) = -<theta^b, [e_a, y]> for the brackets of the generator's frame (D_1, D_2, e_1, e_2, e_3); the same
    // components are those of pi_* E_a^C.
    let mut bundle = Bundle::new();
    let y: Vector = bundle.xdot.iter().chain(&bundle.v).cloned().collect();
    let (mut printed, mut right) = (Vector::new(), Vector::new());
    for a in 0..3 {
        let mut lifted = vec![int(0); 3];
        for (beta, q) in y.iter().enumerate() {
            let bracket = bundle.ours.frame_bracket(2 + a, beta);
            for (component, c) in lifted.iter_mut().zip(&bracket[2..]) {
                *component -= c * q;
            }
        }
        printed.extend(minus(&lifted, &plus(&bundle.upsilon(a), &bundle.turning(a))));
        right.extend(minus(&lifted, &minus(&bundle.upsilon(a), &bundle.turning(a))));
    }
    verdict("S3 3.1, E_a^C(v^b) and pi_* E_a^C", &printed, &right);
}

#[test]
fn s3_second_lagrange_poincare_equation() {
    let mut bundle = Bundle::new();
    let weights = [2, 3, 5].map(int);
    let mut p = diagonal(&weights, &bundle.v);
    p[1] += &bundle.xdot[0] / int(3);
    let mut rate = diagonal(&weights, &bundle.ours.rates("v", "", 3));
    rate[1] += bundle.ours.rate("x1_dot") / int(3);
    let with = |sign: i64| -> Vector {
        (0..3)
            .map(|a| &rate[a] - dot(&bundle.upsilon(a), &p) - int(sign) * dot(&bundle.turning(a), &p))
            .collect()
    };
    verdict("S3 4.1, vertical equation", &with(1), &with(-1));
}

#[test]
fn s3_second_lagrange_poincare_equation_of_a_rigid_body() {
    // Pidot = Pi x Omega, not Omega x Pi.
    let w = generic(4, 3);
    let mut ours = Ours::at(&spec_text("free_rigid_body"), &Point::new().with_vector("Omega", "", &w));
    let inertia = ours.params("I", 3);
    let (pi, rate) = (diagonal(&inertia, &w), diagonal(&inertia, &ours.rates("Omega", "", 3)));
    verdict("S3 4.1, rigid body", &minus(&rate, &cross(&w, &pi)), &minus(&rate, &cross(&pi, &w)));
}

fn hat(u: &[Rational]) -> Rows {
    let columns: Rows = identity(3).iter().map(|e| cross(u, e)).collect();
    transposed(&columns)
}

/// The vector of a skew matrix.
fn vee(m: &[Vector]) -> Vector {
    vec![m[2][1].clone(), m[0][2].clone(), m[1][0].clone()]
}

fn matrix_sum(a: &[Vector], b: &[Vector]) -> Rows {
    a.iter().zip(b).map(|(x, y)| plus(x, y)).collect()
}

#[test]
fn s3_momentum_is_a_vertical_lift() {
    // A rational rotation, by Cayley, and the body velocity of the free rigid body.
    let turn = hat(&generic(5, 3));
    let minus_turn: Rows = transposed(&turn);
    let g =
        product(&inverse(&matrix_sum(&identity(3), &minus_turn)).unwrap(), &matrix_sum(&identity(3), &turn));
    let g_inverse = transposed(&g);
    assert_eq!(product(&g_inverse, &g), identity(3));
    let w = generic(6, 3);
    let mut ours = Ours::at(&spec_text("free_rigid_body"), &Point::new().with_vector("Omega", "", &w));
    let inertia = ours.params("I", 3);
    let (pi, pi_rate) = (diagonal(&inertia, &w), diagonal(&inertia, &ours.rates("Omega", "", 3)));
    let gdot = product(&g, &hat(&w));
    // Spatial momentum, and its rate along the motion.
    let expected = times(&g, &pi);
    assert!(times(&g, &plus(&cross(&w, &pi), &pi_rate)).iter().all(|q| *q == int(0)), "it is conserved");
    let (mut complete, mut vertical) = (Vector::new(), Vector::new());
    for e in identity(3) {
        let moved = hat(&e);
        // Complete lift of e~_a: delta g = e g, delta gdot = e gdot; vertical lift: delta g = 0, delta gdot = e g.
        let variation = |dg: &Rows, dgdot: &Rows| {
            let turned = product(&g_inverse, &product(dg, &product(&g_inverse, &gdot)));
            let pushed = product(&g_inverse, dgdot);
            dot(&pi, &minus(&vee(&pushed), &vee(&turned)))
        };
        let zero = vec![vec![int(0); 3]; 3];
        complete.push(variation(&product(&moved, &g), &product(&moved, &gdot)));
        vertical.push(variation(&zero, &product(&moved, &g)));
    }
    verdict("S3 4.2, momentum", &minus(&expected, &complete), &minus(&expected, &vertical));
}
