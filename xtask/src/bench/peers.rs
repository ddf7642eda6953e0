//! Numbers of other code generators, measured once and elsewhere.
//!
//! All eight systems were given to each peer, derived by hand in the best frame and from a Lagrangian, and every result was
//! checked against the reference data of this repository. Each number is the best of all of them, for one call with
//! independent inputs: heyoka 7.13.2, SymForce 0.12.0, CasADi 3.8.2, wrenfold 0.5.3, sympy 1.14.0, symplex 0.57.0, parameters
//! at run time, with gcc 12.2, clang 22.1.8 (`-O3 -march=native`) and rustc 1.95 on an Intel Xeon (Emerald Rapids);
//! instructions by callgrind on x86-64-v3 builds, the mathematical library and about 10 of the harness included.
//!
//! Deliberately does not know: hamel's own numbers.

/// One sentence that says where the numbers come from.
pub const CITATION: &str = "best of heyoka 7.13.2, SymForce 0.12.0, CasADi 3.8.2, wrenfold 0.5.3, sympy 1.14.0 and symplex \
0.57.0, each fed by hand with the equations in their best form, parameters at run time; gcc 12.2, clang 22.1.8, rustc 1.95 \
on an Intel Xeon (Emerald Rapids)";

/// Nanoseconds of the peers' copy kernel.
pub const COPY: f64 = 3.1;

/// The best peer for a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peer {
    /// Name of the model.
    pub model: &'static str,
    /// Fewest executed instructions of a call.
    pub instructions: f64,
    /// Nanoseconds of the fastest call, that of the copy kernel included.
    pub ns: f64,
    /// Nanoseconds of a lane in the fastest call with 8 lanes.
    pub ns_of_8_lanes: f64,
}

const fn peer(model: &'static str, instructions: f64, ns: f64, ns_of_8_lanes: f64) -> Peer {
    Peer { model, instructions, ns, ns_of_8_lanes }
}

/// The best peers.
pub const PEERS: [Peer; 8] = [
    peer("heavy_top", 60.0, 4.0, 0.7),
    peer("kirchhoff_body", 222.0, 17.5, 3.7),
    peer("euler_disk", 248.0, 16.3, 3.9),
    peer("euler_disk_advected", 123.0, 12.2, 3.2),
    peer("chaplygin_ball", 116.0, 10.3, 2.6),
    peer("snakeboard", 174.0, 10.1, 2.5),
    peer("mobile_robot", 49.0, 3.9, 0.6),
    peer("two_arm_satellite", 536.0, 38.0, 9.8),
];
