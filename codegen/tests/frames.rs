//! The way in which a model of linked bodies is written does not decide about what its rates cost: by `body` items with
//! places in space, or by velocities in the frames of the bodies, with or without a base that floats.

use std::fmt::Write;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;
use hamel_program::program::Role;

/// Axes of the joints, by turns, each with the two that it turns into each other.
const AXES: [(usize, usize, usize); 3] = [(2, 0, 1), (1, 2, 0), (0, 1, 2)];
const LETTERS: [&str; 3] = ["x", "y", "z"];

fn built(text: &str) -> BuiltScene {
    let model = spec::parse("frames.hamel", text).unwrap_or_else(|problems| panic!("{problems}"));
    scene::build(&model, "bare").unwrap_or_else(|problems| panic!("{problems}"))
}

fn n_operations(scene: &BuiltScene) -> usize {
    scene.program().function(&Role::Rate).expect("rates").counts().total()
}

fn rates(scene: &BuiltScene, state: &[f64]) -> Vec<f64> {
    let params: Vec<f64> = scene.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let mut rates = vec![0.0; state.len()];
    scene.prepare(&params).expect("defaults keep the conditions").rhs(0.0, state, &mut rates);
    rates
}

fn head(n: usize) -> String {
    let mut text = "model arm {\nparam g = 9.81;\n".to_owned();
    for k in 1..=n {
        let numbers = [("rx", 0.01), ("ry", 0.02), ("rz", 0.15), ("cx", 0.01), ("cz", 0.07)];
        numbers.iter().for_each(|(name, value)| _ = writeln!(text, "param {name}{k} = {value};"));
        for (name, value) in [("m", 1.1), ("Jx", 0.01), ("Jy", 0.012), ("Jz", 0.004)] {
            _ = writeln!(text, "param {name}{k} = {value} where {name}{k} > 0;");
        }
    }
    (1..=n).for_each(|k| _ = writeln!(text, "coordinate q{k} in angle;"));
    text
}

fn by_bodies(n: usize) -> String {
    let mut text = head(n) + "let o0 = [0, 0, 0]; let R0 = rot(e3, 0);\n";
    let mut lagrangian = Vec::new();
    for k in 1..=n {
        let (axis, before) = (AXES[(k - 1) % 3].0 + 1, k - 1);
        let rest = format!("[rx{k}, ry{k}, rz{k}]");
        _ = match k {
            1 => writeln!(text, "let o1 = {rest}; let R1 = rot(e{axis}, q1);"),
            _ => writeln!(
                text,
                "let o{k} = o{before} + R{before}*{rest}; let R{k} = R{before}*rot(e{axis}, q{k});"
            ),
        };
        _ = writeln!(text, "let p{k} = o{k} + R{k}*[cx{k}, 0, cz{k}];");
        _ = writeln!(
            text,
            "body b{k} {{ mass m{k}; place p{k}; inertia diag([Jx{k}, Jy{k}, Jz{k}]); attitude R{k}; }}"
        );
        lagrangian.push(format!("b{k}_energy - m{k}*g*p{k}[3]"));
    }
    text = text.replace("let o0 = [0, 0, 0]; let R0 = rot(e3, 0);\n", "");
    text + &format!("lagrangian = {};\nscene bare {{ want rhs; }}\n}}\n", lagrangian.join(" + "))
}

/// `s = v + w x r`, turned about the axis of the joint, for velocities and for the vertical.
fn by_velocities(n: usize) -> String {
    let mut text = head(n);
    for (name, value) in [("w", "0"), ("v", "0"), ("u", "0")] {
        LETTERS.iter().for_each(|x| _ = writeln!(text, "let {name}0{x} = {value};"));
    }
    text = text.replace("let u0z = 0;", "let u0z = 1;") + "let h0 = 0;\n";
    let mut lagrangian = Vec::new();
    for k in 1..=n {
        let (axis, from, to) = AXES[(k - 1) % 3];
        let before = k - 1;
        for i in 0..3 {
            let (j, l) = ((i + 1) % 3, (i + 2) % 3);
            let [x, y, z] = [i, j, l].map(|i| LETTERS[i]);
            _ = writeln!(text, "let s{k}{x} = v{before}{x} + w{before}{y}*r{z}{k} - w{before}{z}*r{y}{k};");
        }
        let [a, b, c] = [axis, from, to].map(|i| LETTERS[i]);
        for (name, old) in [("w", format!("w{before}")), ("v", format!("s{k}")), ("u", format!("u{before}"))]
        {
            let along = if name == "w" { format!(" + q{k}_dot") } else { String::new() };
            _ = writeln!(text, "let {name}{k}{a} = {old}{a}{along};");
            _ = writeln!(text, "let {name}{k}{b} = cos(q{k})*{old}{b} + sin(q{k})*{old}{c};");
            _ = writeln!(text, "let {name}{k}{c} = cos(q{k})*{old}{c} - sin(q{k})*{old}{b};");
        }
        _ = writeln!(text, "let h{k} = h{before} + u{before}x*rx{k} + u{before}y*ry{k} + u{before}z*rz{k};");
        _ = writeln!(
            text,
            "let c{k} = [v{k}x + w{k}y*cz{k}, v{k}y + w{k}z*cx{k} - w{k}x*cz{k}, v{k}z - w{k}y*cx{k}];"
        );
        lagrangian.push(format!(
            "m{k}/2*dot(c{k}, c{k}) + (Jx{k}*w{k}x^2 + Jy{k}*w{k}y^2 + Jz{k}*w{k}z^2)/2 - m{k}*g*(h{k} + u{k}x*cx{k} + \
             u{k}z*cz{k})"
        ));
    }
    text + &format!("lagrangian = {};\nscene bare {{ want rhs; }}\n}}\n", lagrangian.join(" + "))
}

#[test]
fn bodies_with_places_in_space_cost_what_velocities_in_their_frames_cost() {
    let n = 4;
    let (bodies, velocities) = (built(&by_bodies(n)), built(&by_velocities(n)));
    let (own, other) = (n_operations(&bodies), n_operations(&velocities));
    assert!(10 * own.abs_diff(other) <= other, "{own} operations by bodies, {other} by velocities");
    let state: Vec<f64> = (0..2 * n).map(|k| 0.3 + 0.4 * (1.7 * k as f64).sin()).collect();
    let (own, other) = (rates(&bodies, &state), rates(&velocities, &state));
    let size = other.iter().fold(1.0_f64, |size, r| size.max(r.abs()));
    for (a, b) in own.iter().zip(&other) {
        // Both round in another order; the condition of the mass matrix is about 1e3.
        assert!((a - b).abs() <= 1e-11 * size, "{own:?}\n{other:?}");
    }
}

/// A base that floats, with two limbs of two joints each.
fn floating() -> String {
    let mut text = head(4).replace("model arm", "model floating")
        + "velocity Omega, V in se(3);\naction left;\nadvected Gamma in R^3 by cross(Omega, Gamma);\n\
           advected height in R by -dot(V, Gamma);\nparam m0 = 3 where m0 > 0;\n";
    let mut lagrangian = vec![
        "m0/2*(V1^2 + V2^2 + V3^2) + (0.08*Omega1^2 + 0.07*Omega2^2 + 0.09*Omega3^2)/2 - m0*g*height"
            .to_owned(),
    ];
    for (i, x) in LETTERS.iter().enumerate() {
        _ = writeln!(text, "let w0{x} = Omega{}; let v0{x} = V{}; let u0{x} = Gamma{};", i + 1, i + 1, i + 1);
    }
    text += "let h0 = height;\n";
    let limbs = by_velocities(4);
    for line in limbs.lines().filter(|line| line.starts_with("let ") && !line.contains(" = 0;")) {
        // The third joint is on the base, as the first one.
        let line = match line.split_once(" = ") {
            Some((name, value)) if name.ends_with(['x', 'y', 'z']) || name == "let h3" => {
                let on_base = ["w2", "v2", "u2", "h2"]
                    .iter()
                    .fold(value.to_owned(), |value, old| value.replace(old, &format!("{}0", &old[..1])));
                let is_third =
                    ["let w3", "let s3", "let v3", "let u3", "let h3"].iter().any(|n| name.starts_with(n));
                if is_third { format!("{name} = {on_base}") } else { line.to_owned() }
            }
            _ => line.to_owned(),
        };
        if line != "let u0z = 1;" {
            text += &(line + "\n");
        }
    }
    let energies = limbs.lines().find_map(|line| line.strip_prefix("lagrangian = ")).expect("a Lagrangian");
    lagrangian.push(energies.trim_end_matches(';').to_owned());
    text + &format!("lagrangian = {};\nscene bare {{ want rhs; }}\n}}\n", lagrangian.join(" + "))
}

#[test]
fn accelerations_of_a_floating_base_come_out_of_one_substitution() {
    let scene = built(&floating());
    let n = n_operations(&scene);
    // 1296 operations; 1660 where each acceleration is taken at its own origin of the vertical.
    assert!(n <= 1300, "{n} operations");
}
