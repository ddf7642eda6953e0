//! Tests of the generator.

#[path = "modules/main.rs"]
mod modules;

#[path = "linkages/families.rs"]
mod families;

mod bad;
mod bicycle;
mod bodies;
mod c;
mod centroid;
mod certify;
mod chains;
mod circles;
mod closed_loops;
mod closing_joints;
mod digits;
mod dirac;
mod discrete;
mod edges;
mod events;
mod explain;
mod first_order;
mod fluids;
mod frames;
mod free_loops;
mod fuzz;
mod groups;
mod imports;
mod inputs;
mod kinematic;
mod limits;
mod linkages;
mod logarithm;
mod loops;
mod lyapunov;
mod malformed;
mod massless;
mod modes;
mod named_frames;
mod named_momenta;
mod noise;
mod parts;
mod quasi_invariance;
mod quotients;
mod random_models;
mod ranks;
mod redundant;
mod reserved;
mod robots;
mod sizes;
mod splitting;
mod starts;
mod stumpff;
mod taylor;
mod thermo;
mod turns;
