//! Scenes are held to the models that they were made from: deliberate faults of every step are found, and what was
//! wrong once is refused or right.

use hamel_codegen::quotient::read_totals;
use hamel_codegen::scene::{self, Made, build_tampered};
use hamel_codegen::spec::{self, Model, Origin};
use hamel_expr::{ExprId, Graph, Rational};
use hamel_mechanics::mechanics::Equations;
use hamel_mechanics::reduction::{AccelerationRow, AccelerationSource, KinematicConstraint, ReducedSystem};
use hamel_program::program::{Op, Operand, Program, Role};

/// A heavy top with friction and a drive: bracket, advected parameter, force, explicit time, attitude.
const TOP: &str = "model top {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    param k = 0.2;
    velocity Omega in so(3);
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = 1/2*dot(Omega, I*Omega) - Gamma1 - 2*Gamma3 + Omega2*cos(t);
    force Omega = -k*Omega;
    output turning = Omega1*Gamma2 + k;
    reconstruct q in SO(3);
    scene all {
        want rhs, energy, energy_rate, momentum, outputs, reconstruction, jacobian, jvp, vjp, time_derivative,
            sensitivity, sensitivity_jvp, sensitivity_vjp;
    }
    scene brief { want rhs, energy; }
}";
/// The same without friction and drive, and the functions that only a conservative motion has.
const FREE: &str = "model free {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    velocity Omega in so(3);
    momentum Pi of Omega;
    carry Pi;
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = 1/2*dot(Omega, I*Omega) - Gamma1 - 2*Gamma3;
    casimir C1 = dot(Gamma, Gamma);
    scene all { want rhs, energy, casimirs, invariants, bracket, velocities, splitting; }
    scene plain { want rhs, velocities; }
}";
/// A charge in a field that changes: connection, curvature, drift, shape forces.
const CHARGE: &str = "model charge {
    param m = 1.3 where m > 0;
    coordinate x: vector(2) in real;
    velocity v in so(3);
    connection v = [x2*x_dot[1], sin(t)*x1*x_dot[2], x1^2*x_dot[2] + t*x_dot[1]];
    lagrangian = m/2*dot(x_dot, x_dot) + v1^2 + 2*v2^2 + 3*v3^2 - x1^2*x2;
    force x_dot = [x2, -x_dot[1]];
    scene all { want rhs, energy, energy_rate, connection; }
}";
/// Three links on wheels that follow their joints: constraints give what no field does.
const LINKS: &str = "model links {
    param l = 0.6 where l > 0;
    input bend = 0.3;
    coordinate a, b in angle;
    velocity w, v in se(2);
    let rear = transpose(rot(a))*[v1, v2 - l*w];
    let front = transpose(rot(b))*[v1, v2 + l*w];
    constraint middle: v2 = 0;
    constraint rear: rear[2] - l*(w + a_dot) = 0;
    constraint front: front[2] + l*(w + b_dot) = 0;
    field a_dot = bend*cos(t);
    field b_dot = -sin(t) - a;
    reconstruct theta, x, y in SE(2);
    scene all { input bend; want rhs, reconstruction, connection; }
    scene plain { want rhs, reconstruction; }
}";
/// A body with two joints that a blade guides: horizontal vectors on the constraint, orthogonal to vertical ones.
const BLADE: &str = "model blade {
    param m = 1.4 where m > 0;
    coordinate a, b in angle;
    velocity w, v in se(2);
    lagrangian = m*dot(v, v)/2 + w^2 + (w + a_dot)^2/2 + (w + b_dot)^2/3 + m*v2*cos(a)*(w + a_dot);
    constraint edge: v2 = 0.3*cos(b)*w + b_dot/5;
    connection nonholonomic;
    scene all { want rhs, energy, connection; }
}";
/// Parts that turn a body, with the action from the right: the locked inertia depends on the shape.
const PARTS: &str = "model parts {
    param k = 0.4;
    coordinate x: vector(2) in real;
    velocity v in so(3);
    action right;
    connection mechanical;
    lagrangian = dot(x_dot, x_dot) + v1^2 + 2*v2^2 + (3 + x2^2)*v3^2 + k*x1*x_dot[2]*v1 + x2*x_dot[1]*v3 - x1*x_dot[1]*v2;
    scene all { want rhs, energy, connection; }
}";
/// A ball on a table that turns: affine constraints, right action, multipliers, momentum equation.
const BALL: &str = "model ball {
    param r = 0.3 where r > 0;
    param k2 = 0.036 where k2 > 0;
    param w = 1.4;
    coordinate x, y in real;
    velocity omega_x, omega_y, omega_z in so(3);
    action right;
    lagrangian = (x_dot^2 + y_dot^2)/2 + k2/2*(omega_x^2 + omega_y^2 + omega_z^2);
    constraint first: x_dot - r*omega_y = -w*y;
    constraint second: y_dot + r*omega_x = w*x;
    independent x_dot, y_dot, omega_z;
    section across = [0, x, 0, 0, 1];
    scene all { want rhs, energy, multipliers, nonholonomic_momentum, momentum_equation, section_rates, implicit; }
    scene plain { want rhs, energy; }
}";
/// A closed loop: equations between positions, circles.
const LOOP: &str = "model crank {
    param r = 0.4 where r > 0;
    param l = 1.1 where l > r;
    coordinate theta, phi in angle;
    coordinate x in real;
    lagrangian = theta_dot^2/2 + phi_dot^2/3 + x_dot^2/2 - x;
    constraint across: r*sin(theta) = l*sin(phi);
    constraint along: x = r*cos(theta) + l*cos(phi);
    multipliers;
    initial theta = 0.6;
    initial phi = 0.2067;
    initial x = 1.4066;
    scene all { want rhs, energy, constraint, positions, multipliers; }
    scene points { circle theta; want rhs, energy; }
}";
/// Stages whose levels the state carries.
const STAGES: &str = "model body {
    param M: diagonal(3) = [2.3, 1.9, 2.7] where M1 > 0, M2 > 0, M3 > 0;
    velocity Omega, V in se(3);
    lagrangian = 1/2*(Omega1^2 + 2*Omega2^2 + 3*Omega3^2) + 1/2*dot(V, M*V) + 3/10*Omega1*V2;
    stage rotation;
    stage translation = ideal(V);
    inner_product = lagrangian;
    carry stages;
    scene all { want rhs, energy, velocities, momentum; }
}";

/// A body that is thrown, and the model of its attitude and momentum that it is reduced to.
const THROWN: &str = "model thrown {
    param I: diagonal(3) = [1.3, 1.7, 0.6];
    param m = 2; param g = 9; param l = 0.25;
    configuration R in SO(3) velocity Omega;
    lagrangian = 1/2*dot(Omega, I*Omega) - m*g*l*R31 - m*R33;
}";

const REDUCED: &str = "model reduced {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    param k = 2; param m = 1;
    velocity Omega in so(3);
    momentum Pi of Omega;
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = 1/2*dot(Omega, I*Omega) - k*Gamma1 - m*Gamma3;
    reduces \"thrown.hamel\" { k = m*g*l; Gamma = transpose(R)*[0, 0, 1]; }
    scene all { want rhs, energy, quotient; }
    scene carried { carry Pi; want rhs, energy, quotient; }
}";

fn model(text: &str) -> Model {
    let model = spec::parse("fault.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let read = |_: &str, file: &str| Ok(Origin { file: file.to_owned(), text: THROWN.to_owned() });
    read_totals(model, &mut { read }).unwrap_or_else(|e| panic!("{e}"))
}

fn map_of(name: &str) -> Role {
    Role::OfVariables(name.to_owned())
}

/// Changes the sign of a result of a function.
fn flip(p: &mut Program, role: &Role, i: usize) {
    let k = idx(p, role);
    let function = &mut p.functions[k];
    let section = function.instructions.last().map_or(p.sections.len() as u32 - 1, |last| last.section);
    let op = Op::Neg(function.results[i].1);
    function.instructions.push(hamel_program::program::Instruction { op, section, name: None });
    function.results[i].1 = Operand::Value(function.instructions.len() as u32 - 1);
}

fn negate(g: &mut Graph, e: &mut ExprId) {
    *e = g.neg(*e);
}

/// The bracket of sections `a` and `b`, changed.
fn with_bracket(
    s: &mut ReducedSystem,
    (a, b): (usize, usize),
    change: fn(&mut Graph, &mut Vec<(usize, ExprId)>),
) {
    let mut value = s.algebroid.bracket(&mut s.graph, a, b);
    assert!(!value.is_empty(), "a bracket that does not vanish");
    change(&mut s.graph, &mut value);
    s.algebroid.set_bracket(a, b, value);
}

fn solved(s: &mut ReducedSystem) -> (&mut Graph, &mut hamel_mechanics::reduction::SolvedConstraint) {
    match &mut s.constraint {
        KinematicConstraint::Solved(solved) => (&mut s.graph, solved),
        KinematicConstraint::Multipliers { .. } => panic!("a solved constraint"),
    }
}

fn output<'e>(e: &'e mut Equations, name: &str) -> (&'e mut Graph, &'e mut Vec<(String, ExprId)>) {
    let Equations { system, outputs, .. } = e;
    let output = outputs.iter_mut().find(|o| o.name == name).unwrap_or_else(|| panic!("an output {name}"));
    (&mut system.graph, &mut output.components)
}

fn idx(p: &Program, role: &Role) -> usize {
    p.function_idx(role).unwrap_or_else(|| panic!("a function {role}"))
}

/// Exchanges the values of two results of a function.
fn swap(p: &mut Program, role: &Role, (i, j): (usize, usize)) {
    let k = idx(p, role);
    let results = &mut p.functions[k].results;
    assert_ne!(results[i].1, results[j].1, "results that differ");
    let kept = results[i].1;
    results[i].1 = results[j].1;
    results[j].1 = kept;
}

/// Puts zero in the place of a result.
fn drop_result(p: &mut Program, role: &Role, i: usize) {
    let k = idx(p, role);
    p.constants.push(hamel_program::program::Constant::Rational(Rational::from_integer(0.into())));
    p.functions[k].results[i].1 = Operand::Constant(p.constants.len() as u32 - 1);
}

/// Changes the first operation of a function for which that does something.
fn change_operation(p: &mut Program, role: &Role, change: fn(Op) -> Option<Op>) {
    let k = idx(p, role);
    let found = p.functions[k].instructions.iter_mut().find_map(|i| Some((change(i.op)?, i)));
    let (op, instruction) = found.expect("an operation to change");
    instruction.op = op;
}

/// The graph, and rows and reactions of a constraint that multipliers keep.
fn kept(s: &mut ReducedSystem) -> (&mut Graph, &mut Vec<AccelerationRow>, &mut Vec<Vec<ExprId>>) {
    let KinematicConstraint::Multipliers { rows, reactions } = &mut s.constraint else {
        panic!("multipliers keep it")
    };
    (&mut s.graph, rows, reactions)
}

fn product(name: &str) -> Role {
    Role::Product(name.to_owned())
}

fn values(name: &str) -> Role {
    Role::Output(name.to_owned())
}

struct Fault {
    name: &'static str,
    model: &'static str,
    scene: &'static str,
    fault: fn(Made<'_>),
}

macro_rules! faults {
    ($($name:literal in $model:ident $scene:literal: $made:ident($it:ident) => $body:expr;)*) => {
        [$(Fault {
            name: $name,
            model: $model,
            scene: $scene,
            fault: |made| {
                if let Made::$made($it) = made {
                    $body;
                }
            },
        }),*]
    };
}

/// A disk that falls on its edge, which grips and gives a part of the velocity back: constraints of modes, a condition
/// on a multiplier, an impact.
const MODES: &str = "model falls {
    param m = 2 where m > 0; param l = 0.8 where l > 0; param e = 0.4;
    coordinate x, z in real; coordinate theta in angle;
    lagrangian = m*(x_dot^2 + z_dot^2)/2 + m*l^2*theta_dot^2/24 - 9.81*m*z;
    mode ground {
        constraint n: z - l/2*cos(theta) = 0;
        event lift when lambda_n < 0 { leave ground; leave grip; }
    }
    mode grip { constraint h: x - l/2*sin(theta) = 0; force x_dot = -x_dot; }
    event touch = z - l/2*cos(theta) falling { impact ground with e; enter grip; }
    event caught = z - l falling { enter ground; }
    initial theta = 0.4; initial z = 1;
    scene all { want rhs, energy, energy_rate, events, multipliers, constraint, momentum, jacobian, jvp, vjp; }
}";

/// A pendulum with a wheel: an actuator whose force gives a function its rate, with damping.
const WHEEL: &str = "model wheel {
    param I: vector(2) = [1, 0.2] where I1 > 0, I2 > 0;
    param mgl = 3 where mgl > 0;
    param a: vector(3) = [20, 2, 0.25];
    param k = 0.5 where k > 0;
    coordinate theta, phi in angle;
    lagrangian = I1*theta_dot^2/2 + I2*(theta_dot + phi_dot)^2/2 - mgl*cos(theta);
    actuate u along phi_dot;
    let d = I2*a2 - (I1 + I2)*a3;
    let T = a1*theta_dot^2/2 + a2*theta_dot*phi_dot + a3*phi_dot^2/2;
    lyapunov V = T + mgl*(a1*a3 - a2^2)/d*(1 - cos(theta)) rate -k*dV_du^2;
    output power = u*phi_dot;
    output half = dV_du/2;
    scene all {
        want rhs, energy, energy_rate, momentum, multipliers, outputs, jacobian, jvp, vjp, time_derivative, sensitivity,
            output_jacobian;
    }
}";

/// The remainder of the row that an actuator keeps.
fn rest(row: &mut AccelerationRow) -> &mut ExprId {
    let AccelerationSource::Servo(rest) = &mut row.source else { panic!("a row on accelerations") };
    rest
}

/// Deliberate faults: in the system, in its equations, in the program.
fn faults() -> Vec<Fault> {
    Vec::from(faults! {
        "the sign of a bracket" in TOP "all": System(s) =>
            with_bracket(s, (0, 1), |g, value| negate(g, &mut value[0].1));
        "a bracket that is dropped" in TOP "all": System(s) => with_bracket(s, (1, 2), |_, value| value.clear());
        "a bracket with another structure constant" in TOP "all": System(s) =>
            with_bracket(s, (0, 2), |g, value| value[0].1 = g.scale(value[0].1, &Rational::new(3.into(), 2.into())));
        "a right action for a left one" in TOP "all": System(s) => for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            with_bracket(s, (a, b), |g, value| negate(g, &mut value[0].1));
        };
        "the sign of the anchor of an advected parameter" in TOP "all": System(s) => {
            let value = s.algebroid.anchor(0, 1);
            let value = s.graph.neg(value);
            s.algebroid.set_anchor(0, 1, value);
        };
        "an entry of the anchor that is dropped" in TOP "all": System(s) => {
            let zero = s.graph.zero();
            s.algebroid.set_anchor(2, 0, zero);
        };
        "the sign of a force" in TOP "all": System(s) => negate(&mut s.graph, &mut s.forces[1]);
        "a force that is dropped" in CHARGE "all": System(s) => s.forces[0] = s.graph.zero();
        "a coefficient of the Lagrangian" in TOP "all": System(s) => {
            let third = Rational::new(1.into(), 3.into());
            let y = s.graph.sym(s.velocities[0]);
            let square = s.graph.mul(y, y);
            let more = s.graph.scale(square, &third);
            s.lagrangian = s.graph.add(s.lagrangian, more);
        };
        "a missing dA/dt" in CHARGE "all": System(s) => {
            assert!(!s.algebroid.drift(1).is_empty());
            s.algebroid.set_drift(1, Vec::new());
        };
        "a missing curvature" in CHARGE "all": System(s) => with_bracket(s, (0, 1), |_, value| value.clear());
        "the sign of [A_i, e_b]" in CHARGE "all": System(s) =>
            with_bracket(s, (0, 3), |g, value| value.iter_mut().for_each(|(_, e)| negate(g, e)));
        "the sign of an entry of Psi" in BALL "plain": System(s) => {
            let (g, solved) = solved(s);
            let zero = g.zero();
            let row = &mut solved.psi[solved.dependent[0]];
            row.iter_mut().filter(|e| **e != zero).for_each(|e| negate(g, e));
        };
        "a missing psi0" in BALL "plain": System(s) => {
            let (g, solved) = solved(s);
            solved.psi0.iter_mut().for_each(|e| *e = g.zero());
        };
        "displacements along other velocities" in BALL "all": System(s) => {
            let (g, solved) = solved(s);
            let rows = &mut solved.virtual_displacements;
            let dependent = solved.dependent[0];
            rows[dependent] = rows[dependent].iter().map(|e| g.scale(*e, &Rational::new(1.into(), 2.into()))).collect();
        };
        "another equation between positions" in LOOP "all": System(s) => {
            let e = &mut s.positions[0].residual;
            *e = s.graph.scale(*e, &Rational::from_integer(2.into()));
        };
        "the rate of an attitude" in TOP "all": System(s) => negate(&mut s.graph, &mut s.reconstruction[2].rate);
        "another frame of stages" in STAGES "all": System(s) => {
            let frame = s.frame.as_mut().expect("a frame");
            let zero = s.graph.zero();
            let last = frame.matrix.len() - 1;
            let entry = &mut frame.matrix[last][0];
            let one = s.graph.one();
            *entry = if *entry == zero { one } else { zero };
        };
        "rates that are exchanged" in TOP "all": Equations(e) => {
            let kept = e.state[0].derivative;
            e.state[0].derivative = e.state[1].derivative;
            e.state[1].derivative = kept;
        };
        "a rate with another sign" in CHARGE "all": Equations(e) => negate(&mut e.system.graph, &mut e.state[3].derivative);
        "the sign of the energy" in TOP "all": Equations(e) => negate(&mut e.system.graph, &mut e.energy);
        "a rate of energy without the explicit time" in CHARGE "all": Equations(e) => {
            let half = Rational::new(1.into(), 2.into());
            e.energy_rate = e.system.graph.scale(e.energy_rate, &half);
        };
        "momenta that are exchanged" in TOP "all": Equations(e) => {
            let (_, components) = output(e, "momentum");
            let kept = components[0].1;
            components[0].1 = components[1].1;
            components[1].1 = kept;
        };
        "the sign of a multiplier" in BALL "all": Equations(e) => {
            let (g, components) = output(e, "multipliers");
            negate(g, &mut components[0].1);
        };
        "multipliers of a loop, exchanged" in LOOP "all": Equations(e) => {
            let (_, components) = output(e, "multipliers");
            let kept = components[0].1;
            components[0].1 = components[1].1;
            components[1].1 = kept;
        };
        "an output with another sign" in TOP "all": Equations(e) => {
            let (g, components) = output(e, "turning");
            negate(g, &mut components[0].1);
        };
        "a term of the momentum equation" in BALL "all": Equations(e) => {
            let (g, components) = output(e, "momentum_equation");
            let one = g.one();
            components[0].1 = g.add(components[0].1, one);
        };
        "the rate of a momentum along a section" in BALL "all": Equations(e) => {
            let (g, components) = output(e, "section_rates");
            negate(g, &mut components[0].1);
        };
        "velocities by momenta, with another sign" in FREE "plain": Equations(e) => {
            let (g, components) = output(e, "velocities");
            negate(g, &mut components[2].1);
        };
        "momenta by velocities, exchanged" in FREE "all": Equations(e) => {
            let momenta = &mut e.legendre.momenta;
            let kept = momenta[0].1;
            momenta[0].1 = momenta[1].1;
            momenta[1].1 = kept;
        };
        "a casimir that is not one" in FREE "all": Equations(e) => {
            let symbol = e.system.graph.sym(e.state[0].symbol);
            let (g, components) = output(e, "casimirs");
            components[0].1 = g.add(components[0].1, symbol);
        };
        "an addition that subtracts" in TOP "all": Program(p) => change_operation(p, &Role::Rate, |op| match op {
            Op::Sub(a, b) => Some(Op::Add(a, b)),
            Op::MulAdd(signs, a, b, c) => {
                Some(Op::MulAdd(hamel_program::program::Signs { addend: !signs.addend, ..signs }, a, b, c))
            }
            _ => None,
        });
        "a factor that is missing" in CHARGE "all": Program(p) => change_operation(p, &Role::Rate, |op| match op {
            Op::Mul(a, _) => Some(Op::Mul(a, a)),
            _ => None,
        });
        "a stale number of the prepare part" in TOP "all": Program(p) => {
            let n = p.prepare.slots.len();
            assert!(n > 1);
            let first = p.prepare.slots[0].value;
            p.prepare.slots[n - 1].value = first;
        };
        "entries of the Jacobian, exchanged" in TOP "all": Program(p) => swap(p, &values("jacobian"), (0, 1));
        "an entry of the sensitivities that is dropped" in TOP "all": Program(p) =>
            drop_result(p, &values("sensitivity"), 0);
        "a row of J v" in TOP "all": Program(p) => swap(p, &product("jvp"), (0, 2));
        "a row of J^T w" in TOP "all": Program(p) => drop_result(p, &product("vjp"), 1);
        "a row of the product with parameters" in TOP "all": Program(p) => drop_result(p, &product("sensitivity_jvp"), 0);
        "a row of the transposed product with parameters" in TOP "all": Program(p) =>
            drop_result(p, &product("sensitivity_vjp"), 0);
        "no derivative by time" in TOP "all": Program(p) => {
            let role = values("time_derivative");
            for i in 0..p.functions[idx(p, &role)].results.len() {
                drop_result(p, &role, i);
            }
        };
        "entries of the bracket, exchanged" in FREE "all": Program(p) => swap(p, &values("bracket"), (0, 1));
        "a gradient of an invariant" in FREE "all": Program(p) => swap(p, &values("invariant_gradients"), (0, 1));
        "an invariant that is not one" in FREE "all": Program(p) => {
            let role = values("invariants");
            let k = idx(p, &role);
            p.functions[k].results[0].1 = Operand::State(0);
        };
        "a flow that does not move" in FREE "all": Program(p) => {
            let role = Role::Flow("flow1".to_owned());
            for i in 0..p.functions[idx(p, &role)].results.len() {
                drop_result(p, &role, i);
            }
        };
        "a gradient of an equation between positions" in LOOP "all": Program(p) =>
            swap(p, &values("position_gradients"), (0, 1));
        "a gradient of a constraint" in LOOP "all": Program(p) => swap(p, &values("constraint_gradients"), (0, 1));
        "a residual of the constraint" in LOOP "all": Program(p) => swap(p, &values("constraint"), (0, 1));
        "a point of the circle" in LOOP "points": Equations(e) => {
            let k = e.state.iter().position(|s| s.name == "theta_s").expect("a point of the circle");
            negate(&mut e.system.graph, &mut e.state[k].derivative);
        };
        "an energy that is said to stay" in TOP "brief": Equations(e) => e.facts.energy_is_conserved = true;
        "a component that is said to be constant" in TOP "all": Equations(e) =>
            e.facts.constants.push("Omega1".to_owned());
        "the sign of a constraint of a mode" in MODES "all": System(s) => {
            let (_, rows, _) = kept(s);
            rows[0].one_form[2] = rows[0].one_form[1];
        };
        "a constraint that another mode lets go" in MODES "all": System(s) => {
            let (_, rows, _) = kept(s);
            (rows[0].mode, rows[1].mode) = (rows[1].mode, rows[0].mode);
        };
        "multipliers of modes, exchanged in a condition" in MODES "all": Equations(e) => {
            let (_, components) = output(e, "events");
            let kept = components[0].1;
            components[0].1 = components[1].1;
            components[1].1 = kept;
        };
        "the multiplier of a mode that is off" in MODES "all": Equations(e) => {
            let grip = e.state.iter().find(|s| s.name == "grip").expect("a mode").symbol;
            let (g, components) = output(e, "multipliers");
            let (one, s) = (g.one(), g.sym(grip));
            let off = g.sub(one, s);
            components[1].1 = g.add(components[1].1, off);
        };
        "an impact that leaves a velocity" in MODES "all": Equations(e) => {
            let velocity = e.state.iter().find(|s| s.name == "theta_dot").expect("a velocity").symbol;
            let (g, components) = output(e, "after_caught");
            let place = components.iter().position(|(name, _)| name == "after_caught_theta_dot").expect("it");
            components[place].1 = g.sym(velocity);
        };
        "an impact that gives back nothing" in MODES "all": Equations(e) => {
            let (_, caught) = output(e, "after_caught");
            let caught = caught.clone();
            let (_, components) = output(e, "after_touch");
            for (name, value) in components {
                let own = name.replace("touch", "caught");
                *value = caught.iter().find(|(name, _)| *name == own).map_or(*value, |(_, e)| *e);
            }
        };
        "an impact that enters another mode" in MODES "all": Equations(e) => {
            let (g, components) = output(e, "after_caught");
            components[0].1 = g.zero();
        };
        "the sign of a coefficient of a connection" in LINKS "all": Program(p) => flip(p, &values("connection"), 0);
        "coefficients of a connection, exchanged" in LINKS "all": Program(p) =>
            swap(p, &values("connection"), (0, 2));
        "a curvature that is dropped" in LINKS "all": Program(p) => drop_result(p, &values("connection"), 7);
        "the sign of a curvature" in LINKS "all": Program(p) => flip(p, &values("connection"), 8);
        "a bracket of lifts without that of the algebra" in LINKS "all": System(s) =>
            with_bracket(s, (0, 1), |g, value| negate(g, &mut value[0].1));
        "the field of a shape for that of another" in LINKS "plain": System(s) => {
            let (_, solved) = solved(s);
            solved.response = None;
            solved.psi0.swap(0, 1);
        };
        "a group that slides" in LINKS "plain": System(s) => {
            let (g, solved) = solved(s);
            let zero = g.zero();
            solved.response = None;
            solved.psi0[4] = g.add(solved.psi0[2], zero);
        };
        "the sign of a nonholonomic connection" in BLADE "all": Program(p) => flip(p, &values("connection"), 0);
        "a coefficient of a nonholonomic connection" in BLADE "all": Program(p) =>
            drop_result(p, &values("connection"), 5);
        "the curvature of a nonholonomic connection" in BLADE "all": Program(p) => flip(p, &values("connection"), 6);
        "the sign of a mechanical connection" in PARTS "all": Program(p) => flip(p, &values("connection"), 1);
        "the curvature of a mechanical connection" in PARTS "all": Program(p) =>
            swap(p, &values("connection"), (6, 8));
        "the sign of a connection as written" in CHARGE "all": Program(p) => flip(p, &values("connection"), 0);
        "a row of the implicit form" in BALL "all": Program(p) =>
            drop_result(p, &Role::OfVariables("implicit_rhs".to_owned()), 1);
        "an entry of the Jacobian of the implicit form" in BALL "all": Program(p) =>
            drop_result(p, &Role::OfVariables("implicit_jacobian".to_owned()), 0);
        "the sign of an advected parameter of a map" in REDUCED "all": Program(p) =>
            flip(p, &map_of("quotient"), 5);
        "the sign of a velocity of a map" in REDUCED "all": Program(p) => flip(p, &map_of("quotient"), 0);
        "the sign of a momentum of a map" in REDUCED "carried": Program(p) => flip(p, &map_of("quotient"), 1);
        "damping that a rate has and a force has not" in WHEEL "all": System(s) => {
            let response = s.feedback.as_ref().expect("an actuator").response;
            let (g, rows, _) = kept(s);
            let none = std::collections::BTreeMap::from([(response, g.zero())]);
            *rest(&mut rows[0]) = g.subs(*rest(&mut rows[0]), &none).expect("a value");
        };
        "damping for twice the damping" in WHEEL "all": System(s) => {
            let response = s.feedback.as_ref().expect("an actuator").response;
            let (g, rows, _) = kept(s);
            let own = g.sym(response);
            let twice = g.scale(own, &Rational::from_integer(2.into()));
            let twice = std::collections::BTreeMap::from([(response, twice)]);
            *rest(&mut rows[0]) = g.subs(*rest(&mut rows[0]), &twice).expect("a value");
        };
        "an actuator along twice its velocity" in WHEEL "all": System(s) => {
            let (g, _, reactions) = kept(s);
            reactions[0][1] = g.scale(reactions[0][1], &Rational::from_integer(2.into()));
        };
        "damping that drives" in WHEEL "all": System(s) => {
            let response = s.feedback.as_ref().expect("an actuator").response;
            let (g, rows, _) = kept(s);
            let rest = rest(&mut rows[0]);
            let none = std::collections::BTreeMap::from([(response, g.zero())]);
            let free = g.subs(*rest, &none).expect("a value");
            let twice = g.scale(free, &Rational::from_integer(2.into()));
            *rest = g.sub(twice, *rest);
        };
        "a force with an offset" in WHEEL "all": System(s) => {
            let response = s.feedback.as_ref().expect("an actuator").response;
            let (g, rows, _) = kept(s);
            let own = g.sym(response);
            *rest(&mut rows[0]) = g.add(*rest(&mut rows[0]), own);
        };
        "twice a function at the rate of one" in WHEEL "all": System(s) => {
            let (g, rows, _) = kept(s);
            for e in rows[0].one_form.iter_mut() {
                *e = g.scale(*e, &Rational::from_integer(2.into()));
            }
            *rest(&mut rows[0]) = g.scale(*rest(&mut rows[0]), &Rational::from_integer(2.into()));
        };
        "the sign of an entry of the Jacobian of a force" in WHEEL "all": Program(p) =>
            flip(p, &values("output_jacobian"), 4);
        "the sign of a Lyapunov function" in WHEEL "all": Program(p) => flip(p, &values("V"), 0);
        "the sign of a force that is an output" in WHEEL "all": Program(p) => flip(p, &values("u"), 0);
        "the power of a force that is an output" in WHEEL "all": Program(p) => flip(p, &values("power"), 0);
        "components of a map, exchanged" in REDUCED "all": Program(p) => swap(p, &map_of("quotient"), (3, 4));
        "the sign of a parameter of a map" in REDUCED "all": Program(p) =>
            flip(p, &map_of("quotient_parameters"), 3);
        "parameters of a map, exchanged" in REDUCED "all": Program(p) =>
            swap(p, &map_of("quotient_parameters"), (0, 1));
    })
}

#[test]
fn every_deliberate_fault_is_found() {
    let mut missed = Vec::new();
    let faults = faults();
    for Fault { name, model: text, scene, fault } in &faults {
        match build_tampered(&model(text), scene, fault) {
            Ok(built) => missed.push(format!("{name}: {}", built.certificate().sentence())),
            Err(problem) => {
                let text = problem.to_string();
                println!("{name}: {}", text.lines().next().unwrap_or_default());
                if !text.contains("disagrees with its definition") {
                    missed.push(format!("{name}: {text}"));
                }
            }
        }
    }
    println!("{} of {} faults found", faults.len() - missed.len(), faults.len());
    assert!(missed.is_empty(), "not found:\n{}", missed.join("\n"));
}

#[test]
fn scenes_without_a_fault_are_held_to_their_definitions() {
    for (text, scene) in [
        (TOP, "all"),
        (FREE, "all"),
        (CHARGE, "all"),
        (LINKS, "all"),
        (LINKS, "plain"),
        (BLADE, "all"),
        (PARTS, "all"),
        (BALL, "all"),
        (LOOP, "all"),
        (LOOP, "points"),
        (STAGES, "all"),
        (MODES, "all"),
        (REDUCED, "all"),
        (REDUCED, "carried"),
        (WHEEL, "all"),
    ] {
        let built = build_tampered(&model(text), scene, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
        let certificate = built.certificate();
        // Each state of modes has a point.
        assert_eq!(certificate.n_points, if text == MODES { 4 } else { 3 }, "{}", certificate.sentence());
        assert!(certificate.open.is_empty(), "{:?}", certificate.open);
        let functions = built.program().functions.iter().map(|f| &f.role);
        let has_identity =
            |role: &&Role| !matches!(role, Role::Pivots | Role::Signature | Role::Domain | Role::Flow(_));
        for role in functions.filter(has_identity) {
            let name = role.name();
            let name = name.strip_suffix("_rhs").unwrap_or(name);
            assert!(certificate.held.contains_key(name), "{name} is not among {:?}", certificate.held.keys());
        }
    }
}

#[test]
fn the_same_text_is_held_at_the_same_points_everywhere() {
    let built = || build_tampered(&model(CHARGE), "all", &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(built().certificate(), built().certificate());
}

#[test]
fn modules_have_a_test_of_their_own_where_it_is_asked_for() {
    let built = build_tampered(&model(TOP), "all", &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let plain = built.emit().unwrap();
    assert!(!plain.contains("rates_are_those_of_the_generator"));
    assert!(plain.contains("Held to its definition at 3 points: "), "{}", &plain[..2000]);
    let writing = scene::Writing { self_test: true, ..scene::Writing::default() };
    let tested = built.emit_as(&writing).unwrap();
    assert!(tested.contains("rates_are_those_of_the_generator"));
    assert!(tested.contains("let cases: [([f64; 4], f64, [f64; 10], [f64; 10]); 3]"));
}

/// A4: flows are composed in a time of their own, in which a Hamiltonian that depends on time stands still.
#[test]
fn a_hamiltonian_that_depends_on_time_is_not_split() {
    let text = "model driven {
        coordinate x in real;
        momentum p of x_dot;
        carry p;
        lagrangian = x_dot^2/2 - x^2/2 + x*cos(t);
        scene split { want rhs, splitting; }
    }";
    let refused = scene::build(&model(text), "split").expect_err("no splitting").to_string();
    assert!(refused.contains("depends on time"), "{refused}");
}
