//! The Dirac structure of a system, against its motion.

use std::collections::BTreeMap;

use hamel_codegen::spec;
use hamel_mechanics::mechanics::{DiracStructure, derive, rates};
use hamel_mechanics::reduction::{Formulation, KinematicConstraint, reduce};

/// With the differential of `E = p.y - L` less the force for a covector, the structure gives the momenta the rates
/// that they have along the motion, up to the annihilator: on every virtual displacement.
fn assert_gives_the_motion(text: &str) {
    let model = spec::parse("m", text).unwrap();
    let system = reduce(&model, &Formulation::of(&model)).unwrap();
    let equations = derive(&system).unwrap();
    let found = DiracStructure::new(&equations.system);
    let mut g = found.graph.clone();
    let system = &equations.system;
    let momenta: Vec<_> = system.velocities.iter().map(|s| g.diff(system.lagrangian, *s)).collect();
    let slopes: Vec<_> = system.algebroid.base().iter().map(|x| g.diff(system.lagrangian, *x)).collect();
    let mut values = BTreeMap::new();
    values.extend(found.eta.iter().copied().zip(system.velocities.iter().map(|s| g.sym(*s))));
    values.extend(found.momenta.iter().copied().zip(momenta.iter().copied()));
    values.extend(found.alpha.iter().copied().zip(slopes.iter().map(|e| g.neg(*e))));
    values.extend(found.beta.iter().copied().zip(system.forces.iter().map(|e| g.neg(*e))));
    values.extend(found.lambda.iter().map(|l| (*l, g.zero())));
    let velocities: BTreeMap<_, _> =
        system.velocities.iter().copied().zip(equations.velocities.iter().copied()).collect();
    let by_state: Vec<_> = momenta.iter().map(|p| g.subs(*p, &velocities).unwrap()).collect();
    let rates = rates(&mut g, &equations, &equations.state, &by_state);
    let residuals: Vec<_> = (found.momentum_rates.iter().zip(rates))
        .map(|(e, rate)| {
            let given = g.subs(*e, &values).and_then(|e| g.subs(e, &velocities)).unwrap();
            g.sub(rate, given)
        })
        .collect();
    let KinematicConstraint::Solved(solved) = &system.constraint else { panic!("solved") };
    for b in 0..solved.unknowns.len() {
        let terms: Vec<_> = (solved.virtual_displacements.iter().zip(&residuals))
            .map(|(row, e)| {
                let w = g.subs(row[b], &velocities).unwrap();
                g.mul(w, *e)
            })
            .collect();
        let sum = g.sum(&terms);
        assert!(g.is_zero(sum), "{text}");
    }
    for (form, e) in solved.reactions.one_forms.iter().zip(&found.annihilator) {
        assert_eq!(form.iter().all(|c| *c == g.zero()), *e == g.zero(), "{text}");
    }
}

#[test]
fn it_gives_the_motion_of_every_kind_of_system() {
    for text in [
        // Advected parameter, left and right.
        "model m { param I: diagonal(3) = [1, 2, 3]; velocity w in so(3); advected a in R^3 by cross(w, a);
            lagrangian = dot(w, I*w)/2 - a1 - a2^2; }",
        "model m { param I: diagonal(3) = [1, 2, 3]; velocity w in so(3); action right;
            lagrangian = dot(w, I*w)/2; }",
        // Constraint on se(2), with a force.
        "model m { param J = 2; velocity w, v in se(2); lagrangian = (J*w^2 + v1^2 + v2^2 + w*v2)/2;
            force w = -w; constraint v2 = 0; }",
        // A base, and a moving constraint.
        "model m { coordinate x, y, z in real; lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2 - x*z;
            constraint z_dot = y*x_dot + cos(t); }",
    ] {
        assert_gives_the_motion(text);
    }
}
