//! Velocities of places in frames that turn.
//!
//! A place of linked bodies is a sum of vectors that are constant in frames that turn, `p = o + R c`. Its velocity in
//! such a frame follows from that of the place before it,
//!
//! ```text
//! R^T p' = B^T (A^T o') + w x c + c'    for R = A B, hat(w) = R^T R'
//! ```
//!
//! in a number of operations that does not grow with the chain, while the components of `p'` in space contain the
//! rates of all entries of `R`.
//!
//! Deliberately does not know: syntax, items, masses, which velocities a model has.
//!
//! # Source
//! Featherstone 2008, Rigid Body Dynamics Algorithms, section 3.5.

use std::collections::{BTreeMap, BTreeSet};

use super::rates::{Rates, Spins, rate_of};
use hamel_expr::{ExprId, Graph};

/// What expressions of a model say about motions, by the entries of values.
#[derive(Debug, Default)]
pub(super) struct Motions {
    /// Angular velocities of rotation matrices.
    pub(super) spins: Spins,
    /// Rotation matrices, also those whose angular velocity is not known.
    pub(super) rotations: BTreeSet<Vec<ExprId>>,
    /// Rotations of space with the two that they are products of, left and right.
    factors: BTreeMap<Vec<ExprId>, Option<[Vec<ExprId>; 2]>>,
    pub(super) places: BTreeMap<Vec<ExprId>, Place>,
    /// Velocities that were asked for.
    velocities: BTreeMap<Vec<ExprId>, Velocity>,
}

/// How a vector is written.
#[derive(Clone, Debug)]
pub(super) enum Place {
    /// `R c`: the entries of `R`, and `c`.
    Turned(Vec<ExprId>, Vec<ExprId>),
    /// Other components.
    Whole,
    /// Vectors, with whether each is subtracted.
    Sum(Vec<(bool, Vec<ExprId>)>),
}

/// A velocity in a frame.
#[derive(Clone, Debug)]
struct Velocity {
    /// The attitude of the frame, or nothing for the frame of space.
    frame: Option<Vec<ExprId>>,
    components: Vec<ExprId>,
}

/// `R^T v` for a rotation of space.
fn turned_back(g: &mut Graph, rotation: &[ExprId], v: &[ExprId]) -> Vec<ExprId> {
    (0..3)
        .map(|i| {
            let column: Vec<ExprId> = (0..3).map(|j| rotation[3 * j + i]).collect();
            g.dot(&column, v)
        })
        .collect()
}

impl Motions {
    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        *self = Motions::default();
    }

    /// Whether a matrix is known to be a rotation.
    pub(super) fn is_rotation(&self, entries: &[ExprId]) -> bool {
        self.rotations.contains(entries) || self.spins.contains_key(entries)
    }

    /// Notes how a vector is written. Everything that it is written by is known before, and known ones stay, so
    /// that no vector is written by itself.
    pub(super) fn note(&mut self, vector: &[ExprId], place: Place) {
        if let Place::Sum(list) = &place {
            for (_, operand) in list {
                self.places.entry(operand.clone()).or_insert(Place::Whole);
            }
        }
        self.places.entry(vector.to_vec()).or_insert(place);
    }

    /// Notes the factors of a rotation, by the same rule.
    pub(super) fn note_factors(&mut self, rotation: &[ExprId], [left, right]: [&[ExprId]; 2]) {
        self.factors.entry(left.to_vec()).or_insert(None);
        self.factors.entry(rotation.to_vec()).or_insert_with(|| Some([left.to_vec(), right.to_vec()]));
    }

    /// The components of the velocity of a place in a frame, by the velocities of the places before it. Nothing where
    /// the place is not written that way, or where they are not seen to be `R^T p'` of the velocity `p'` in space.
    ///
    /// # Shapes
    /// place, velocity: \[3\], frame: \[9\] by rows -> \[3\].
    pub(super) fn in_frame(
        &mut self,
        g: &mut Graph,
        rates: &Rates,
        (place, velocity): (&[ExprId], &[ExprId]),
        frame: &[ExprId],
    ) -> Option<Vec<ExprId>> {
        self.places.get(place)?;
        let found = self.velocity(g, rates, place)?;
        // A place that is written in space alone has its velocity there.
        found.frame.as_ref()?;
        let components = self.carried(g, &found, frame)?;
        let in_space = turned_back(g, frame, velocity);
        let is_proved = components.iter().zip(in_space).all(|(own, e)| g.fingerprints_agree(*own, e));
        is_proved.then_some(components)
    }

    /// The velocity of a place in the last frame that it is written in.
    fn velocity(&mut self, g: &mut Graph, rates: &Rates, place: &[ExprId]) -> Option<Velocity> {
        if let Some(known) = self.velocities.get(place) {
            return Some(known.clone());
        }
        let rate = |g: &mut Graph, e: &ExprId| rate_of(g, *e, rates).ok();
        let found = match self.places.get(place).cloned() {
            None | Some(Place::Whole) => {
                let components = place.iter().map(|e| rate(g, e)).collect::<Option<_>>()?;
                Velocity { frame: None, components }
            }
            Some(Place::Turned(rotation, c)) => {
                let w = self.spins.get(&rotation)?.clone();
                let mut components = Vec::with_capacity(3);
                for k in 0..3 {
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    let (plus, minus) = (g.mul(w[i], c[j]), g.mul(w[j], c[i]));
                    let across = g.sub(plus, minus);
                    let own = rate(g, &c[k])?;
                    components.push(g.add(across, own));
                }
                Velocity { frame: Some(rotation), components }
            }
            Some(Place::Sum(list)) => {
                let mut sum: Option<Velocity> = None;
                for (negative, operand) in list {
                    let mut own = self.velocity(g, rates, &operand)?;
                    if negative {
                        own.components.iter_mut().for_each(|e| *e = g.neg(*e));
                    }
                    sum = Some(match sum {
                        None => own,
                        Some(sum) => self.together(g, sum, own)?,
                    });
                }
                sum?
            }
        };
        self.velocities.insert(place.to_vec(), found.clone());
        Some(found)
    }

    /// The sum of two velocities in the frame of that which is turned further.
    fn together(&self, g: &mut Graph, a: Velocity, b: Velocity) -> Option<Velocity> {
        let rests = |v: &Velocity| v.components.iter().all(|e| *e == g.zero());
        let (a, b) = match (rests(&a), rests(&b)) {
            (_, true) => return Some(a),
            (true, _) => return Some(b),
            _ => (a, b),
        };
        let add = |g: &mut Graph, frame: Option<Vec<ExprId>>, a: &[ExprId], b: &[ExprId]| Velocity {
            frame,
            components: a.iter().zip(b).map(|(a, b)| g.add(*a, *b)).collect(),
        };
        if a.frame == b.frame {
            return Some(add(g, a.frame, &a.components, &b.components));
        }
        for (from, to) in [(&a, &b), (&b, &a)] {
            if let Some(frame) = &to.frame
                && let Some(carried) = self.carried(g, from, frame)
            {
                return Some(add(g, to.frame.clone(), &carried, &to.components));
            }
        }
        None
    }

    /// The components of a velocity in a frame that is turned further, factor by factor.
    fn carried(&self, g: &mut Graph, velocity: &Velocity, frame: &[ExprId]) -> Option<Vec<ExprId>> {
        let mut turns = Vec::new();
        let mut at = frame;
        while velocity.frame.as_deref() != Some(at) {
            match self.factors.get(at) {
                Some(Some([left, right])) => {
                    turns.push(right.as_slice());
                    at = left;
                }
                _ if velocity.frame.is_none() => {
                    turns.push(at);
                    break;
                }
                _ => return None,
            }
        }
        let turned = |v: Vec<ExprId>, turn: &&[ExprId]| turned_back(g, turn, &v);
        Some(turns.iter().rev().fold(velocity.components.clone(), turned))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hamel_expr::{Func, SymbolId};

    /// Two links, the second on the first: attitudes about the third and the first axis, places `R_1 c`, `R_1 c + R_2
    /// c`, and their velocities in space.
    struct Chain {
        motions: Motions,
        rates: Rates,
        attitudes: [Vec<ExprId>; 2],
        places: [Vec<ExprId>; 2],
    }

    fn times(g: &mut Graph, a: &[ExprId], b: &[ExprId]) -> Vec<ExprId> {
        let n = b.len() / 3;
        let entry = |g: &mut Graph, i: usize, j: usize| {
            let column: Vec<ExprId> = (0..3).map(|k| b[n * k + j]).collect();
            g.dot(&a[3 * i..3 * i + 3], &column)
        };
        (0..3).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| entry(g, i, j)).collect()
    }

    fn chain(g: &mut Graph) -> Chain {
        let symbols: Vec<SymbolId> = ["q1", "q2", "w1", "w2", "c"].map(|name| g.symbol(name)).to_vec();
        let [q1, q2, w1, w2, c]: [ExprId; 5] = [0, 1, 2, 3, 4].map(|k| g.sym(symbols[k]));
        let (zero, one) = (g.zero(), g.one());
        let rates = Rates::from([(symbols[0], w1), (symbols[1], w2), (symbols[4], zero)]);
        let parts = |g: &mut Graph, q: ExprId| {
            let (cosine, sine) = (g.func(Func::Cos, q), g.func(Func::Sin, q));
            (cosine, sine, g.neg(sine))
        };
        let (cosine, sine, minus) = parts(g, q1);
        let first = vec![cosine, minus, zero, sine, cosine, zero, zero, zero, one];
        let (cosine, sine, minus) = parts(g, q2);
        let turn = vec![one, zero, zero, zero, cosine, minus, zero, sine, cosine];
        let second = times(g, &first, &turn);
        let mut motions = Motions::default();
        let about_third = vec![zero, zero, w1];
        let mut about_both = turned_back(g, &turn, &about_third);
        about_both[0] = g.add(about_both[0], w2);
        motions.spins = Spins::from([(first.clone(), about_third), (second.clone(), about_both)]);
        motions.note_factors(&second, [&first, &turn]);
        let offset = vec![c, c, c];
        let (a, b) = (times(g, &first, &offset), times(g, &second, &offset));
        let sum: Vec<ExprId> = a.iter().zip(&b).map(|(a, b)| g.add(*a, *b)).collect();
        motions.note(&a, Place::Turned(first.clone(), offset.clone()));
        motions.note(&b, Place::Turned(second.clone(), offset));
        motions.note(&sum, Place::Sum(vec![(false, a.clone()), (false, b.clone())]));
        // A vector that is itself and nothing, or another one less the rest, is known already.
        motions.note(&sum, Place::Sum(vec![(false, sum.clone()), (false, vec![zero; 3])]));
        motions.note(&a, Place::Sum(vec![(false, sum.clone()), (true, b)]));
        motions.note_factors(&first, [&second, &turn]);
        Chain { motions, rates, attitudes: [first, second], places: [a, sum] }
    }

    fn asked(g: &mut Graph, chain: &mut Chain) -> Option<Vec<ExprId>> {
        let place = &chain.places[1];
        let rates = &chain.rates;
        let velocity: Vec<ExprId> =
            place.iter().map(|e| rate_of(g, *e, rates).expect("the rates of all symbols")).collect();
        chain.motions.in_frame(g, rates, (place, &velocity), &chain.attitudes[1])
    }

    #[test]
    fn a_velocity_follows_from_that_of_the_place_before() {
        let mut g = Graph::new();
        let mut chain = chain(&mut g);
        let found = asked(&mut g, &mut chain).expect("a velocity in the frame of the second link");
        // In the frame that the first link has, the velocity of its end is `w_1 x c`, of two components.
        let first = chain.motions.velocity(&mut g, &chain.rates, &chain.places[0]).expect("a velocity");
        assert_eq!(first.frame.as_ref(), Some(&chain.attitudes[0]));
        assert_eq!(first.components.iter().filter(|e| **e != g.zero()).count(), 2);
        assert!(found.iter().all(|e| g.reachable(&[*e]).len() < 30));
    }

    #[test]
    fn a_wrong_angular_velocity_offset_or_factor_is_found() {
        for fault in 0..3 {
            let mut g = Graph::new();
            let mut chain = chain(&mut g);
            let Chain { motions, attitudes, places, .. } = &mut chain;
            match fault {
                0 => motions.spins.get_mut(&attitudes[1]).expect("noted").swap(0, 2),
                1 => match motions.places.get_mut(&places[0]).expect("noted") {
                    Place::Turned(_, offset) => offset[0] = g.zero(),
                    Place::Sum(_) | Place::Whole => unreachable!("the first place is turned"),
                },
                _ => motions.factors.get_mut(&attitudes[1]).expect("noted").as_mut().expect("a product")[1]
                    .swap(4, 5),
            }
            assert_eq!(asked(&mut g, &mut chain), None, "fault {fault}");
        }
    }
}
