//! Ways towards places where the equations of a model are singular or nearly so.
//!
//! Deliberately does not know: how errors are measured.

use std::f64::consts::FRAC_PI_2;

/// State and parameters by name, to be moved next to a singular place.
#[derive(Debug)]
pub struct Place<'a> {
    /// Names of the state.
    pub names: &'a [&'a str],
    /// State.
    pub y: &'a mut [f64],
    /// Names of the parameters.
    pub param_names: &'a [&'a str],
    /// Parameters.
    pub params: &'a mut [f64],
}

impl Place<'_> {
    fn set(&mut self, name: &str, value: f64) {
        if let Some(at) = self.names.iter().position(|n| *n == name) {
            self.y[at] = value;
        } else {
            let at = self.param_names.iter().position(|n| *n == name);
            self.params[at.unwrap_or_else(|| panic!("{name} is neither state nor parameter"))] = value;
        }
    }

    fn get(&self, name: &str) -> f64 {
        let of = |names: &[&str], values: &[f64]| names.iter().position(|n| *n == name).map(|k| values[k]);
        of(self.names, self.y)
            .or_else(|| of(self.param_names, self.params))
            .unwrap_or_else(|| panic!("{name} is neither state nor parameter"))
    }

    /// A vector of unit length at the angle `distance` from the third axis, in the direction of its first two
    /// components.
    fn near_third_axis(&mut self, names: [&str; 3], distance: f64) {
        let [x, y, _] = names.map(|name| self.get(name));
        let length = x.hypot(y);
        let (sin, cos) = distance.sin_cos();
        for (name, value) in names.into_iter().zip([sin * x / length, sin * y / length, cos]) {
            self.set(name, value);
        }
    }
}

/// A family of places at a distance from a singular one.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    /// Model and scene.
    pub scene: (&'static str, &'static str),
    /// What goes to its limit.
    pub what: &'static str,
    /// Moves an ordinary place to the distance.
    pub place: fn(&mut Place<'_>, f64),
}

/// Distances of the sweeps.
pub const DISTANCES: [f64; 12] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12];

/// All of them.
pub const SWEEPS: [Sweep; 22] = [
    Sweep {
        scene: ("euler_disk", "default"),
        what: "theta = d: upright axis, disk flat",
        place: |p, d| p.set("theta", d),
    },
    Sweep {
        scene: ("euler_disk", "default"),
        what: "theta = pi/2 - d: disk upright",
        place: |p, d| p.set("theta", FRAC_PI_2 - d),
    },
    Sweep { scene: ("euler_disk", "minimal"), what: "theta = d", place: |p, d| p.set("theta", d) },
    Sweep {
        scene: ("euler_disk", "default"),
        what: "theta = d, and the velocities of a disk that comes to rest: phi_dot = 1/sqrt(d), psi_dot = -cos(theta) phi_dot",
        place: |p, d| {
            p.set("theta", d);
            let phi_dot = d.sqrt().recip();
            p.set("phi_dot", phi_dot);
            p.set("psi_dot", -d.cos() * phi_dot);
        },
    },
    Sweep { scene: ("euler_disk", "default"), what: "I1 = d", place: |p, d| p.set("I1", d) },
    Sweep { scene: ("euler_disk", "default"), what: "I3 = d", place: |p, d| p.set("I3", d) },
    Sweep { scene: ("euler_disk", "default"), what: "e = d: thin disk", place: |p, d| p.set("e", d) },
    Sweep {
        scene: ("euler_disk_advected", "default"),
        what: "Gamma at the angle d from the axis: disk flat",
        place: |p, d| p.near_third_axis(["Gamma1", "Gamma2", "Gamma3"], d),
    },
    Sweep {
        scene: ("euler_disk_advected", "default"),
        what: "Gamma at the angle pi/2 - d from the axis: disk upright",
        place: |p, d| p.near_third_axis(["Gamma1", "Gamma2", "Gamma3"], FRAC_PI_2 - d),
    },
    Sweep {
        scene: ("chaplygin_ball", "default"),
        what: "l = r (1 - d), chi = -Gamma: mass centre next to the contact point",
        place: |p, d| {
            p.set("l", p.get("r") * (1.0 - d));
            for k in 1..=3 {
                p.set(&format!("chi{k}"), -p.get(&format!("Gamma{k}")));
            }
        },
    },
    Sweep {
        scene: ("chaplygin_ball", "default"),
        what: "I1, I2, I3 = d",
        place: |p, d| ["I1", "I2", "I3"].iter().for_each(|name| p.set(name, d)),
    },
    Sweep {
        scene: ("chaplygin_gyro", "default"),
        what: "beta = d: point mass on the axis of its coordinates",
        place: |p, d| p.set("beta", d),
    },
    Sweep {
        scene: ("appell_machine", "default"),
        what: "x_dot, y_dot = d: weight falls, wheel hardly rolls",
        place: |p, d| ["x_dot", "y_dot"].iter().for_each(|name| p.set(name, d)),
    },
    Sweep {
        scene: ("wong_particle", "default"),
        what: "x2, x3, rho = d: particle on an axis of the frame",
        place: |p, d| {
            ["x2", "x3"].iter().for_each(|name| p.set(name, d));
            p.set("rho", d);
        },
    },
    Sweep {
        scene: ("snakeboard", "default"),
        what: "phi = pi/2 - d",
        place: |p, d| p.set("phi", FRAC_PI_2 - d),
    },
    Sweep {
        scene: ("snakeboard", "minimal"),
        what: "phi = -pi/2 + d",
        place: |p, d| p.set("phi", d - FRAC_PI_2),
    },
    Sweep { scene: ("snakeboard", "default"), what: "phi = d", place: |p, d| p.set("phi", d) },
    Sweep {
        scene: ("veselova", "default"),
        what: "gamma at the angle d from the third axis",
        place: |p, d| p.near_third_axis(["gamma1", "gamma2", "gamma3"], d),
    },
    Sweep {
        scene: ("veselova", "default"),
        what: "I1 = d, gamma at the angle d from the third axis",
        place: |p, d| {
            p.near_third_axis(["gamma1", "gamma2", "gamma3"], d);
            p.set("I1", d);
        },
    },
    Sweep {
        scene: ("suslov", "default"),
        what: "I12 = sqrt(I11 I22) (1 - d), I13 = I23 = d/10: nearly singular inertia",
        place: |p, d| {
            p.set("I12", (p.get("I11") * p.get("I22")).sqrt() * (1.0 - d));
            p.set("I13", d / 10.0);
            p.set("I23", d / 10.0);
        },
    },
    Sweep {
        scene: ("free_rigid_body", "default"),
        what: "I1 = I2 (1 + d): nearly symmetric",
        place: |p, d| p.set("I1", p.get("I2") * (1.0 + d)),
    },
    Sweep {
        scene: ("kirchhoff_body", "default"),
        what: "velocities times d",
        place: |p, d| p.y.iter_mut().for_each(|x| *x *= d),
    },
];
