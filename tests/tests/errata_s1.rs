//! Misprints of Grillo and Zuccalli (S1). They do not change the motion of its ball, which is isotropic, but that of
//! any other right-invariant system with the same constraint.

use hamel_tests::errata::{Ours, Point, cross, diagonal, generic, minus, plus, scaled, verdict};
use hamel_tests::linear::{Vector, dot, fraction, identity, int};

#[test]
fn b17_b18_sign_of_the_coadjoint_term_of_a_right_action() {
    let text = "model m { coordinate a: vector(2) in real; velocity xi in so(3); action right;
        lagrangian = 3/5*dot(a_dot, a_dot) + 1/2*dot(xi, [[2, 1/2, 0], [1/2, 3, 1/3], [0, 1/3, 5]]*xi);
        constraint a1_dot = 3/10*xi2; constraint a2_dot = -3/10*xi1; independent xi; }";
    let (a, xi) = (generic(1, 2), generic(2, 3));
    let mut ours = Ours::at(text, &Point::new().with_vector("a", "", &a).with_vector("xi", "", &xi));
    let momentum = |xi: &[_]| {
        let mut p = diagonal(&[int(2), int(3), int(5)], xi);
        p[0] += &xi[1] / int(2);
        p[1] += &xi[0] / int(2) + &xi[2] / int(3);
        p[2] += &xi[1] / int(3);
        p
    };
    let xi_rate = ours.rates("xi", "", 3);
    let (p, p_rate) = (momentum(&xi), momentum(&xi_rate));
    // a' = r xi x E3 for velocities, accelerations and displacements.
    let roll = |eta: &[_]| scaled(&fraction(3, 10), &cross(eta, &identity(3)[2]));
    let push = scaled(&fraction(6, 5), &roll(&xi_rate));
    let along = |force: &[_]| -> Vector {
        identity(3).iter().map(|eta| dot(force, eta) - dot(&push, &roll(eta))).collect()
    };
    let turning = cross(&p, &xi);
    let (printed, right) = (
        along(&plus(&scaled(&int(-1), &p_rate), &turning)),
        along(&minus(&scaled(&int(-1), &p_rate), &turning)),
    );
    verdict("B17", &printed, &right);
    // The displacements that leave the point of contact, with xi = xi3 E3 + E3 x a'/r.
    let spin = plus(
        &scaled(&xi[2], &identity(3)[2]),
        &scaled(&fraction(10, 3), &cross(&identity(3)[2], &roll(&xi))),
    );
    assert_eq!(spin, xi);
    verdict("B18", &printed[2..], &right[2..]);
}
