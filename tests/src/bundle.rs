//! Random systems on `R^2 x G` as model text, written with and without a connection.

use hamel_expr::Rational;
use hamel_lang::algebra::{LieAlgebra, Representation};
use num_traits::Zero;

use crate::draws::Draws;
use crate::linear::{Rows, Vector, add_scaled, dot, int, times};
use crate::problem::algebra_text;

/// `c + b1 x1 + b2 x2 + d x1 x2`.
#[derive(Clone, Debug)]
pub struct Polynomial([Rational; 4]);

impl Polynomial {
    /// A random one, that depends on both coordinates.
    pub fn random(draws: &mut Draws) -> Polynomial {
        Polynomial([draws.rational(), draws.non_zero(), draws.non_zero(), draws.rational()])
    }

    /// As text.
    pub fn text(&self) -> String {
        let [c, b1, b2, d] = &self.0;
        format!("({c} + {b1}*x1 + {b2}*x2 + {d}*x1*x2)")
    }

    /// Its value.
    pub fn at(&self, x: &[Rational]) -> Rational {
        let [c, b1, b2, d] = &self.0;
        c + b1 * &x[0] + b2 * &x[1] + d * &x[0] * &x[1]
    }

    /// Its derivatives.
    pub fn slopes(&self, x: &[Rational]) -> [Rational; 2] {
        let [_, b1, b2, d] = &self.0;
        [b1 + d * &x[1], b2 + d * &x[0]]
    }
}

/// A linear constraint `xi_last + sum_k coefficient_k z_k = offset` on `z = (xdot, xi without its last component)`.
#[derive(Clone, Debug)]
pub struct Tie {
    /// Coefficients of `x1_dot, x2_dot, xi_1, ..`.
    pub coefficients: Vec<Polynomial>,
    /// Right side.
    pub offset: Rational,
}

/// `L = 1/2 z.(G0 + x1^2 G1 + x2^2 G2) z + b.z x1 - V(x) - s.a (1 + x1)` with `z = (xdot, xi)`, perhaps a constraint
/// and parameters `a` under the coadjoint action.
#[derive(Clone, Debug)]
pub struct Bundle {
    /// The algebra of the group.
    pub algebra: LieAlgebra,
    /// Whether the action is from the right.
    pub right: bool,
    /// `A(x)`, `[dim G][2]`.
    pub connection: Vec<[Polynomial; 2]>,
    metrics: [Rows; 3],
    drift: Vector,
    potential: Polynomial,
    /// The constraint.
    pub tie: Option<Tie>,
    /// Whether the multipliers of the constraint are asked for.
    pub multipliers: bool,
    /// Matrices of the action on `a`, and the slope of the potential in `a`.
    pub advected: Option<(Vec<Rows>, Vector)>,
}

/// Coordinates, base velocities, group velocity, advected parameters.
#[derive(Clone, Debug)]
pub struct BundleState {
    /// `x`.
    pub x: Vector,
    /// `xdot`.
    pub x_dot: Vector,
    /// `xi`.
    pub xi: Vector,
    /// `a`.
    pub a: Vector,
}

fn list(v: &[Rational]) -> String {
    let entries: Vec<String> = v.iter().map(Rational::to_string).collect();
    format!("[{}]", entries.join(", "))
}

fn table(rows: &[Vector]) -> String {
    let rows: Vec<String> = rows.iter().map(|r| list(r)).collect();
    format!("[{}]", rows.join(", "))
}

impl Bundle {
    /// A random unconstrained system.
    pub fn random(algebra: &LieAlgebra, right: bool, draws: &mut Draws) -> Bundle {
        let n = algebra.dim();
        let connection = (0..n).map(|_| [Polynomial::random(draws), Polynomial::random(draws)]).collect();
        Bundle {
            algebra: algebra.clone(),
            right,
            connection,
            metrics: [0; 3].map(|_| draws.positive_definite(n + 2)),
            drift: draws.vector(n + 2),
            potential: Polynomial::random(draws),
            tie: None,
            multipliers: false,
            advected: None,
        }
    }

    /// Makes the metric the same everywhere on the base.
    pub fn flatten(&mut self) {
        let [_, g1, g2] = &mut self.metrics;
        for entry in g1.iter_mut().chain(g2).flatten() {
            *entry = Rational::from_integer(0.into());
        }
    }

    /// Adds a constraint.
    pub fn constrain(&mut self, multipliers: bool, draws: &mut Draws) {
        let n = self.algebra.dim();
        let coefficients = (0..n + 1).map(|_| Polynomial::random(draws)).collect();
        self.tie = Some(Tie { coefficients, offset: draws.rational() });
        self.multipliers = multipliers;
    }

    /// Adds parameters under the coadjoint action.
    pub fn advect(&mut self, draws: &mut Draws) {
        let representation = Representation::coadjoint(&self.algebra);
        let k = representation.dim();
        let rows = |b| (0..k).map(|i| representation.matrix(b).row(i).to_vec()).collect::<Rows>();
        let generators = (0..self.algebra.dim()).map(rows).collect();
        self.advected = Some((generators, draws.generic_vector(k)));
    }

    /// The model: with the velocities `xi` of the group itself, or with `v = xi + A(x) xdot` and its connection.
    pub fn text(&self, with_connection: bool) -> String {
        let n = self.algebra.dim();
        let mut text = String::from("model bundle {\n");
        text.push_str(&algebra_text("h", &self.algebra));
        text.push_str("coordinate x: vector(2) in real;\n");
        let velocity = if with_connection { "v" } else { "xi" };
        text.push_str(&format!("velocity {velocity} in h;\n"));
        text.push_str(if self.right { "action right;\n" } else { "action left;\n" });
        if with_connection {
            let terms =
                self.connection.iter().map(|[a1, a2]| format!("{}*x1_dot + {}*x2_dot", a1.text(), a2.text()));
            let terms: Vec<String> = terms.collect();
            text.push_str(&format!("connection v = [{}];\n", terms.join(", ")));
            for (k, term) in terms.iter().enumerate() {
                text.push_str(&format!("let w{0} = v{0} - ({term});\n", k + 1));
            }
        } else {
            (1..=n).for_each(|k| text.push_str(&format!("let w{k} = xi{k};\n")));
        }
        let w: Vec<String> = (1..=n).map(|k| format!("w{k}")).collect();
        text.push_str(&format!("let z = [x1_dot, x2_dot, {}];\n", w.join(", ")));
        let mut potential = self.potential.text();
        if let Some((generators, slope)) = &self.advected {
            let k = slope.len();
            // The action of an element of the algebra: written in the velocity of the model, whatever it is called.
            let components: Vec<String> = (0..k)
                .map(|i| {
                    let terms = generators.iter().enumerate();
                    let terms = terms.map(|(b, m)| format!("{velocity}{}*dot({}, a)", b + 1, list(&m[i])));
                    terms.collect::<Vec<_>>().join(" + ")
                })
                .collect();
            text.push_str(&format!("advected a in R^{k} by [{}];\n", components.join(", ")));
            potential.push_str(&format!(" + (1 + x1)*dot({}, a)", list(slope)));
        }
        let [g0, g1, g2] = &self.metrics;
        text.push_str(&format!(
            "lagrangian = 1/2*dot(z, {}*z) + x1^2/2*dot(z, {}*z) + x2^2/2*dot(z, {}*z) + x1*dot({}, z) - ({potential});\n",
            table(g0),
            table(g1),
            table(g2),
            list(&self.drift),
        ));
        if let Some(tie) = &self.tie {
            let others =
                ["x1_dot".to_owned(), "x2_dot".to_owned()].into_iter().chain(w[..n - 1].iter().cloned());
            let terms = tie.coefficients.iter().zip(others).map(|(c, z)| format!("{}*{z}", c.text()));
            let terms: Vec<String> = terms.collect();
            text.push_str(&format!("constraint w{n} + {} = {};\n", terms.join(" + "), tie.offset));
            if self.multipliers {
                text.push_str("multipliers;\n");
            } else {
                let kept: Vec<String> = (1..n).map(|k| format!("{velocity}{k}")).collect();
                text.push_str(&format!("independent x_dot, {};\n", kept.join(", ")));
            }
        }
        text + "}\n"
    }

    /// A random state, on the constraint if there is one.
    pub fn state(&self, draws: &mut Draws) -> BundleState {
        let n = self.algebra.dim();
        let (x, x_dot) = (draws.generic_vector(2), draws.generic_vector(2));
        let mut xi = draws.generic_vector(n);
        if let Some(tie) = &self.tie {
            let others: Vector = x_dot.iter().chain(&xi[..n - 1]).cloned().collect();
            let coefficients: Vector = tie.coefficients.iter().map(|c| c.at(&x)).collect();
            xi[n - 1] = &tie.offset - dot(&coefficients, &others);
        }
        let k = self.advected.as_ref().map_or(0, |(_, slope)| slope.len());
        BundleState { x, x_dot, xi, a: draws.generic_vector(k) }
    }

    /// `A_i(x)` as vectors of the algebra.
    fn columns(&self, x: &[Rational]) -> [Vector; 2] {
        [0, 1].map(|i| self.connection.iter().map(|row| row[i].at(x)).collect())
    }

    /// `A(x) xdot`.
    pub fn lift(&self, x: &[Rational], x_dot: &[Rational]) -> Vector {
        let [a1, a2] = self.columns(x);
        let zero = vec![Rational::zero(); a1.len()];
        add_scaled(&add_scaled(&zero, &x_dot[0], &a1), &x_dot[1], &a2)
    }

    /// `d/dt (A(x) xdot) = (xdot . dA) xdot + A xddot`.
    pub fn lift_rate(&self, state: &BundleState, x_ddot: &[Rational]) -> Vector {
        let straight = self.lift(&state.x, x_ddot);
        let turning = self.connection.iter().map(|row| {
            let rates = [0, 1].map(|i| dot(&row[i].slopes(&state.x), &state.x_dot));
            dot(&rates, &state.x_dot)
        });
        straight.iter().zip(turning).map(|(s, t)| s + t).collect()
    }

    /// `B = d_1 A_2 - d_2 A_1 - [A_1, A_2]`, brackets with the sign of the action; with the other sign if `wrong`.
    pub fn curvature(&self, x: &[Rational], wrong: bool) -> Vector {
        let [a1, a2] = self.columns(x);
        let sign = int(if self.right == wrong { -1 } else { 1 });
        let exterior: Vector = self
            .connection
            .iter()
            .map(|[first, second]| &second.slopes(x)[0] - &first.slopes(x)[1])
            .collect();
        add_scaled(&exterior, &sign, &self.algebra.bracket_of(&a1, &a2))
    }

    /// `adot = -xi . a` for a left action, `xi . a` for a right one.
    pub fn advected_rate(&self, state: &BundleState) -> Vector {
        let Some((generators, slope)) = &self.advected else { return Vec::new() };
        let mut rate = vec![Rational::zero(); slope.len()];
        for (y, m) in state.xi.iter().zip(generators) {
            let sign = int(if self.right { 1 } else { -1 });
            rate = add_scaled(&rate, &(sign * y), &times(m, &state.a));
        }
        rate
    }
}
