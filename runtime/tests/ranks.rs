//! Constraints that become dependent on the way: where a motion may go on in more than one way it ends, whoever makes
//! the steps.

use hamel_runtime::{
    Dop853, Error, Failure, Gauss6, IndependentRows, Integrator, Method, Options, Real, Rk4, System, Vern9,
    keeps_rank,
};

/// A point that moves on a straight line through `x, y, z`, with velocities behind, and rows of constraints on these.
#[derive(Clone, Copy)]
struct Point<const K: usize> {
    rows: Rows<K>,
    moving: &'static [usize],
    /// Whether the rank is looked at.
    is_watched: bool,
}

type Rows<const K: usize> = fn([f64; 3]) -> [[f64; 3]; K];

impl<const K: usize> Point<K> {
    fn new(moving: &'static [usize], rows: Rows<K>) -> Self {
        Point { rows, moving, is_watched: true }
    }

    /// From a place with a velocity to the time six: when the rank is lost.
    fn lost<M: Method<f64, Self>>(
        &self,
        method: M,
        options: Options<f64>,
        [x, v]: [[f64; 3]; 2],
    ) -> Option<f64> {
        let start = [x[0], x[1], x[2], v[0], v[1], v[2]];
        let mut solver = Integrator::new(self, method, 0.0, start, options).unwrap();
        match solver.integrate_to(6.0) {
            Ok(()) => None,
            Err(Error::Failure(Failure::RankLost { t })) => Some(t),
            Err(other) => panic!("{other}"),
        }
    }

    fn lost_by_all(&self, start: [[f64; 3]; 2]) -> Vec<Option<f64>> {
        let adaptive = Options::adaptive(1e-9, 1e-9);
        let fixed = [0.01, 0.3, 4.3].map(|h| self.lost(Rk4, Options::fixed(h), start));
        let [short, middle, long] = fixed;
        vec![
            self.lost(Dop853, adaptive, start),
            self.lost(Vern9, adaptive, start),
            self.lost(Gauss6::fixed_point(), Options::fixed(0.3), start),
            short,
            middle,
            long,
        ]
    }
}

impl<const K: usize> System<f64> for Point<K> {
    type State = [f64; 6];

    fn rhs(&self, _t: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        *dy = [y[3], y[4], y[5], 0.0, 0.0, 0.0];
    }

    fn keeps_rank(&self, from: (f64, &[f64; 6]), to: (f64, &[f64; 6])) -> bool {
        !self.is_watched || keeps_rank(self, from, to)
    }
}

impl<const K: usize> IndependentRows<f64> for Point<K> {
    type Row = [f64; 3];

    type Rows = [[f64; 3]; K];

    fn moving(&self) -> &[usize] {
        self.moving
    }

    fn rows(&self, _t: f64, y: &[f64; 6]) -> [[f64; 3]; K] {
        (self.rows)([y[0], y[1], y[2]])
    }
}

/// `y' = x z'` and `y' = -x z'` are one where `x` is zero, at the time two.
#[test]
fn rows_that_fold_together_end_the_motion() {
    let mut opposed = Point::new(&[0], |[x, ..]| [[0.0, 1.0, -x], [0.0, 1.0, x]]);
    let start = [[1.0, 0.0, 0.0], [-0.5, 0.0, 0.0]];
    for lost in opposed.lost_by_all(start) {
        let t = lost.expect("a lost rank");
        assert!((1.99..=4.3).contains(&t), "{t}");
    }
    assert!((opposed.lost(Rk4, Options::fixed(0.01), start).unwrap() - 2.0).abs() < 0.011);
    opposed.is_watched = false;
    assert_eq!(opposed.lost_by_all(start), [None; 6]);
}

/// Equations `x y = 0` and `x z = 0`, on `x' = -1/2`: both rows vanish at once, and what they span is the same on both
/// sides.
#[test]
fn two_directions_that_are_lost_at_once_are_found() {
    let both = Point::new(&[0, 1, 2], |[x, y, z]| [[y, x, 0.0], [z, 0.0, x]]);
    for lost in both.lost_by_all([[1.0, 0.0, 0.0], [-0.5, 0.0, 0.0]]) {
        assert!(lost.is_some_and(|t| (1.99..=4.3).contains(&t)), "{lost:?}");
    }
}

/// The gradient of `x y` vanishes where both lines cross.
#[test]
fn a_crossing_of_two_branches_is_found() {
    let cross = Point::new(&[0, 1], |[x, y, _]| [[y, x, 0.0]]);
    for lost in cross.lost_by_all([[1.0, 0.0, 0.0], [-0.5, 0.0, 0.0]]) {
        assert!(lost.is_some_and(|t| (1.99..=4.3).contains(&t)), "{lost:?}");
    }
}

/// `x y' = x sin(z) z'` turns round with its factor, which loses nothing.
#[test]
fn a_factor_of_a_row_loses_nothing() {
    let factor = Point::new(&[0, 2], |[x, _, z]| [[0.0, x, -x * z.sin()]]);
    assert_eq!(factor.lost_by_all([[1.0, 0.0, 0.0], [-0.5, 0.0, 0.1]]), [None; 6]);
}

/// A skate that turns eight times round, by less than half a turn in a step of 0.3, and six times in one of 4.3.
#[test]
fn a_row_that_turns_all_the_way_round_keeps_its_rank() {
    let skate = Point::new(&[2], |[_, _, z]| [[z.sin(), -z.cos(), 0.0]]);
    assert_eq!(skate.lost_by_all([[0.0; 3], [0.0, 0.0, 9.0]]), [None; 6]);
}

/// A row of zeros has no direction, and the others keep theirs.
#[test]
fn rows_that_are_off_are_left_out() {
    let off = Point::new(&[2], |[_, _, z]| [[0.0; 3], [z.cos(), z.sin(), 0.0]]);
    assert_eq!(off.lost_by_all([[0.0; 3], [0.0, 0.0, 1.0]]), [None; 6]);
}

#[test]
fn the_error_says_why() {
    let told = Failure::RankLost { t: 2.5 }.to_string();
    assert_eq!(
        told,
        "constraints depend on each other before t = 2.5: the motion may go on in more than one way there"
    );
}

/// Lanes lose their rank at times of their own: the first one ends them all.
#[cfg(feature = "lanes")]
#[test]
fn one_lane_ends_all() {
    use hamel_runtime::F64x4;

    struct Opposed;

    impl System<F64x4> for Opposed {
        type State = [F64x4; 3];

        fn rhs(&self, _t: F64x4, y: &[F64x4; 3], dy: &mut [F64x4; 3]) {
            *dy = [y[1], F64x4::ZERO, F64x4::ZERO];
        }

        fn keeps_rank(&self, from: (F64x4, &[F64x4; 3]), to: (F64x4, &[F64x4; 3])) -> bool {
            keeps_rank(self, from, to)
        }
    }

    impl IndependentRows<F64x4> for Opposed {
        type Row = [F64x4; 2];

        type Rows = [[F64x4; 2]; 2];

        fn moving(&self) -> &[usize] {
            &[0]
        }

        fn rows(&self, _t: F64x4, y: &[F64x4; 3]) -> [[F64x4; 2]; 2] {
            [[F64x4::ONE, -y[0]], [F64x4::ONE, y[0]]]
        }
    }

    let run = |speeds: [f64; 4]| {
        let start = [F64x4::new([1.0, 2.0, 3.0, 4.0]), F64x4::new(speeds), F64x4::ZERO];
        let options = Options::fixed(F64x4::from_f64(0.1));
        let mut solver = Integrator::new(&Opposed, Rk4, F64x4::ZERO, start, options).unwrap();
        solver.integrate_to(F64x4::from_f64(6.0))
    };
    assert_eq!(run([1.0, -0.1, 2.0, 0.0]), Ok(()));
    let lost = run([1.0, -0.1, -1.5, 0.0]);
    assert!(
        matches!(lost, Err(Error::Failure(Failure::RankLost { t })) if (2.0..2.11).contains(&t)),
        "{lost:?}"
    );
}
