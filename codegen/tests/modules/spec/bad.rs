//! What is wrong, and what is said about it: `line:column message [help]`, one line per problem.
//!
//! Whole classes of problems, with rendered reports, are in `codegen/tests/bad`; here are the variants. Write the
//! messages anew with `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main modules::spec`.

use expect_test::{Expect, expect};

use hamel_codegen::spec::parse;

fn report(text: &str) -> String {
    let Err(problems) = parse("bad.hamel", text) else { return "no problem".to_owned() };
    let mut lines = Vec::new();
    for problem in problems.iter() {
        let place = match (problem.span, problems.origin()) {
            (Some(span), Some(origin)) => {
                let (line, column) = origin.line_column(span.start);
                format!("{line}:{column} ")
            }
            _ => String::new(),
        };
        let help = problem.help.as_ref().map_or(String::new(), |help| format!(" [{help}]"));
        lines.push(format!("{place}{}{help}", problem.message));
    }
    lines.join("\n")
}

#[track_caller]
pub(super) fn check(text: &str, expected: Expect) {
    expected.assert_eq(&report(text));
}

#[test]
fn syntax() {
    check(r#"modell m { }"#, expect![[r#"1:1 expected `model name { .. }`, found `modell`"#]]);
    check(r#"model m"#, expect![[r#"1:8 expected `{`, found the end of the file"#]]);
    check(
        r#"model m { } model n { }"#,
        expect![[r#"
            1:7 model `m` has no velocity [declare `velocity Omega in so(3);` or a `coordinate`]
            1:7 model `m` has no lagrangian [add `lagrangian = ..;`, or `hamiltonian = ..;` in momenta]
            1:13 `model` after the end of the model [a file holds one model: `model name { .. }`]"#]],
    );
    check(
        r#"model m { param = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:17 expected the name of a parameter, found `=` [written as `param m = 1 where m > 0;` or `param chi: vector(3) = [0, 0, 1];`]"
        ],
    );
    check(
        r#"model m { let a = b']; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"
            1:20 `'` is not part of the language [primes are not part of names: write `Omega_bar` or another name]
            1:21 `]` does not close the bracket that is open here [every bracket is closed by its own kind]"#]],
    );
    check(
        r#"model m { let a = Omega'; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"
            1:19 unknown name `Omega_` [did you mean `Omega`?]
            1:24 `'` is not part of the language [primes are not part of names: write `Omega_bar` or another name]"#]],
    );
    check(
        r#"model m { source Kirchhoff; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[
            r#"1:18 expected a text in quotes, found `Kirchhoff` [written as `source "Author, year";`]"#
        ]],
    );
    check(
        r#"model m { param a: vector(201) = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:27 dimension `201` is not between 1 and 200 [written as `param m = 1 where m > 0;` or `param chi: vector(3) = [0, 0, 1];`]"
        ],
    );
    check(
        r#"model m { param a = 1 where a; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:30 expected `>`, `>=`, `<`, `<=` or `!=`, found `;` [written as `param m = 1 where m > 0;` or `param chi: vector(3) = [0, 0, 1];`]"
        ],
    );
    check(
        r#"model m { param a = 1e401; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:21 exponent of the number is not between -400 and 400 [choose units in which the value is moderate]"
        ],
    );
    check(
        r#"model m { scene s { freeze a = 1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:21 expected `fix`, `input`, `want`, `drop`, `circle`, `carry`, `routh`, `formulation`, `discrete`, `retraction` or `for`, found `freeze` [written as `scene name { fix m = 1; want energy; drop x; }`]"
        ],
    );
    check(
        r#"model m { coordinate x in circle; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:27 expected a domain: `(low, high)`, `angle` or `real`, found `circle` [written as `coordinate theta in angle;` or `coordinate x: vector(2) in (0, 1);`]"
        ],
    );
    check(
        r#"model m { let µ = 1; let b = 3 · 4; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"
            1:15 `µ` cannot be used as a name [names are ASCII letters, digits and underscores and begin with a letter]
            1:32 `·` is not part of the language [write `*`, `dot(a, b)` or `cross(a, b)`]"#]],
    );
}

#[test]
fn names() {
    check(
        r#"model m { param if = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:17 `if` cannot be used as a name [the language has no conditions, so nothing can begin like one]"
        ],
    );
    check(
        r#"model m { param a = 1; param a = 2; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect!["1:30 `a` is declared twice [rename one of them]"],
    );
    check(
        r#"model m {
let b = 1;
param b = 2;
velocity Omega in so(3); lagrangian = dot(Omega, Omega);
}"#,
        expect!["3:7 `b` is declared twice [rename one of them]"],
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = dot(Omega, Omega) + Omega4; }"#,
        expect![[
            r#"1:69 unknown name `Omega4` [`Omega` is vector(3): its components are `Omega1` to `Omega3`]"#
        ]],
    );
    check(
        r#"model m { param k = 1; velocity Omega in so(3); lagrangian = k(Omega1); }"#,
        expect![[r#"1:62 `k` is not a function [write a product as `k * (..)`]"#]],
    );
    check(
        r#"model m { let a = a + 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:15 definition in a circle: a -> a [define one of them without the others]"#]],
    );
}

#[test]
fn shapes() {
    check(
        r#"model m { let a = [[1, 2], [3, 4]]*Omega; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[
            r#"1:19 cannot multiply matrix(2, 2) and vector(3) [the matrix needs 3 columns instead of 2; `transpose` may help]"#
        ]],
    );
    check(
        r#"model m { let a = Omega^2; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:19 cannot raise vector(3) to a number [powers are for numbers: write `dot(v, v)`, or `[v1^2, v2^2]` component by component]"
        ],
    );
    check(
        r#"model m { let a = [1, [2]]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:23 entries of different shapes: a number and vector(1) [a vector holds numbers, a matrix rows of one length]"
        ],
    );
    check(
        r#"model m { let a = [[1, 2], [3]]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:28 entries of different shapes: vector(2) and vector(1) [a vector holds numbers, a matrix rows of one length]"
        ],
    );
    check(
        r#"model m { let a = dot(Omega); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect!["1:19 `dot` takes 2 arguments, found 1 [write `dot(a, b)` with two vectors]"],
    );
    check(
        r#"model m { let a = diag(1, 2); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:19 `diag` takes 1 argument, found 2 [write `diag([a, b, c])`]"#]],
    );
    check(
        r#"model m { let a = 1/(2 - 2); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![
            "1:21 division by zero [the divisor vanishes identically, whatever the names in it stand for]"
        ],
    );
    check(
        r#"model m { let a = 2^5000; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect!["1:21 exponent 5000 is too large, the limit is 1000 [powers are computed exactly]"],
    );
    check(
        r#"model m { let a = det([[1, 2, 3]]); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:19 `det` takes a square matrix, found matrix(1, 3)"#]],
    );
    check(
        r#"model m { let a = Omega*hat(Omega); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:19 cannot multiply vector(3) and matrix(3, 3) [write `transpose(v) * A` or `A * v`]"#]],
    );
    check(
        r#"model m { casimir c = Omega; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[
            r#"1:23 casimir `c` must be a number, found vector(3) [use `dot(a, b)` for the pairing of vectors]"#
        ]],
    );
}

#[test]
fn params() {
    check(
        r#"model m { param a = [1, 2]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[
            r#"1:21 parameter `a` is a number, its default is a list [declare it as a vector: `param a: vector(2) = ..`]"#
        ]],
    );
    check(
        r#"model m { param a: vector(3) = [1, 2]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:32 `a` has 3 components, its default 2 [the components are `a1`, `a2`, `a3`]"#]],
    );
    check(
        r#"model m { param I: diagonal(2) = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:34 `I` has 2 components, its default 1 [the components are `I1`, `I2`]"#]],
    );
    check(
        r#"model m { param a = sqrt(2); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect!["1:21 the value is not a rational number [write it in decimals: `1.4142135623730951`]"],
    );
    check(
        r#"model m { param a = -1 where a > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:30 the default violates `a > 0` [here a = -1]"#]],
    );
    check(
        r#"model m { param a = 1; param b = 2; require a > b; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:45 the defaults violate `a > b` [here a = 1, b = 2]"#]],
    );
    check(
        r#"model m { param a: vector(2) = [1, 2] where a > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:45 condition `a > 0` compares vector(2) [conditions compare numbers]"#]],
    );
    check(
        r#"model m { param a = 1 where 0 < a < 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:33 the default violates `a < 1` [here a = 1]"#]],
    );
    check(
        r#"model m { param a = 0 where 1/a > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[
            r#"1:29 condition `1/a > 0` has no value at the defaults [it divides by zero or leaves the domain of a function]"#
        ]],
    );
    check(
        r#"model m { param a = -1 where sqrt(a) > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[
            r#"1:30 condition `sqrt(a) > 0` has no value at the defaults [it divides by zero or leaves the domain of a function]"#
        ]],
    );
}

#[test]
fn algebras() {
    check(
        r#"model m { velocity x in so; lagrangian = 1; }"#,
        expect![[r#"1:25 `so` needs arguments [for example `so(3)`]"#]],
    );
    check(
        r#"model m { velocity x in so(40); lagrangian = 1; }"#,
        expect![[r#"1:25 so(40) is too large [the largest is so(10)]"#]],
    );
    check(
        r#"model m { velocity a, b in so(3); lagrangian = 1; }"#,
        expect![
            "1:20 2 names for the velocity in so(3) [give one name for so(3) (dimension 3), or 3 names, one per basis element]"
        ],
    );
    check(
        r#"model m { algebra g { basis a, b, c; [a, b] = c; [a, c] = a; } velocity x in g; lagrangian = 1; }"#,
        expect![
            "1:38 bracket [a, b] fails Jacobi with c: residual -c [[[a, b], c] + [[b, c], a] + [[c, a], b] has to vanish]"
        ],
    );
    check(
        r#"model m { algebra g { basis a, b; [a, b] = a; [b, a] = b; } velocity x in g; lagrangian = 1; }"#,
        expect![[r#"1:47 bracket [b, a] is not antisymmetric [give each pair once and leave [e, e] out]"#]],
    );
    check(
        r#"model m { algebra g { basis a, b; [a, q] = a; [a, b] = a^2; } velocity x in g; lagrangian = 1; }"#,
        expect![[r#"1:39 `q` is not a basis element [legal here: `a`, `b`]
1:56 expected a combination of basis elements with constant coefficients [for example `2*e1 - sqrt(3)*e3`, or `0`; constants are made of numbers, pi, roots, and sines of multiples of pi]"#]],
    );
    check(
        r#"model m { algebra g { [a, b] = a; } velocity x in g; lagrangian = 1; }"#,
        expect![
            "1:23 expected `basis e1, e2, ..;`, found `[` [written as `algebra g = so(3);` or `algebra g { basis a, b; [a, b] = a; }`]"
        ],
    );
    check(
        r#"model m { representation r of so(3) on R^2 { e1 = [[0, 1], [0, 0]]; e2 = [[0, 0], [1, 0]]; e3 = [[1, 0], [0, 0]]; } velocity x in semidirect(so(3), r); lagrangian = 1; }"#,
        expect![
            "1:46 matrices of e1 and e2 do not represent [e1, e2]: residual 1 in row 2, column 2 [rho([e1, e2]) has to be rho(e1) rho(e2) - rho(e2) rho(e1)]"
        ],
    );
    check(
        r#"model m { representation r of so(3) on R^2 { e1 = [[0, 1], [0, 0]]; e4 = 1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:69 `e4` is not a basis element of so(3) [legal here: `e1`, `e2`, `e3`]"#]],
    );
    check(
        r#"model m { representation r of R on R { e1 = [[1]]; } velocity x in semidirect(so(3), r); lagrangian = 1; }"#,
        expect![[r#"1:86 `r` represents R^1, not so(3) [declare a representation of this algebra]"#]],
    );
}

#[test]
fn mechanics() {
    check(
        r#"model m { }"#,
        expect![[r#"
            1:7 model `m` has no velocity [declare `velocity Omega in so(3);` or a `coordinate`]
            1:7 model `m` has no lagrangian [add `lagrangian = ..;`, or `hamiltonian = ..;` in momenta]"#]],
    );
    check(
        r#"model m { velocity Omega in so(3); }"#,
        expect![
            "1:7 model `m` has no lagrangian [add `lagrangian = ..;`, or `hamiltonian = ..;` in momenta]"
        ],
    );
    check(
        r#"model m { lagrangian = 1; }"#,
        expect![[r#"1:7 model `m` has no velocity [declare `velocity Omega in so(3);` or a `coordinate`]"#]],
    );
    check(
        r#"model m { advected G in R^3 by dot(Omega, G); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[
            r#"1:32 action on `G` must be vector(3), found a number [it is the rate of change of the parameter, up to the sign]"#
        ]],
    );
    check(
        r#"model m { constraint Omega = [Omega1, 0, 0]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:22 component 1 of constraint `Omega = [Omega1, 0, 0]` always holds [remove it]"#]],
    );
    check(
        r#"model m { independent Omg; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:23 `Omg` is not a velocity [legal here: `Omega`, `Omega1`, `Omega2`, `Omega3`]"#]],
    );
    check(
        r#"model m { coordinate q in (1, 0); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect!["1:22 interval from 1 to 0 is empty [write the lower end first: `(0, pi/2)`]"],
    );
    check(
        r#"model m { coordinate q: symmetric(2) in real; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[
            r#"1:22 coordinate `q` must be a number or a vector [write `coordinate x: vector(3) in real;`]"#
        ]],
    );
}

#[test]
fn stages() {
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(O); }"#,
        expect![[
            r#"1:68 stage b is not an ideal of a: [V1, O2] = V3 leaves it [add the missing directions]"#
        ]],
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(V1); }"#,
        expect![[
            r#"1:68 stage b is not an ideal of a: [O2, V1] = -V3 leaves it [add the missing directions]"#
        ]],
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(O, V); }"#,
        expect![[
            r#"1:68 stage b splits nothing off [it has to be smaller than the stage above and not zero]"#
        ]],
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage b = ideal(V); }"#,
        expect![[
            r#"1:59 the first stage `b` is the whole algebra and has no ideal [declare it as `stage name;` before the ideals]"#
        ]],
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b; }"#,
        expect![[
            r#"1:74 stage `b` has no ideal [only the first stage is the whole algebra; write `stage name = ideal(V);`]"#
        ]],
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(V1^2); }"#,
        expect![[
            r#"1:68 ideal of stage `b` is not spanned by combinations of velocities in parameters [use `O1`, `O2`, `O3`, `V1`, `V2`, `V3`]"#
        ]],
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage a = ideal(V); }"#,
        expect![[r#"1:68 stage `a` is declared twice [rename one of them]"#]],
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(W); }"#,
        expect![[
            r#"1:84 unknown name `W` [legal here: `O`, `O1`, `O2`, `O3`, `V`, `V1`, `V2`, `V3`, `pi`, `t`]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); stage a; stage b = ideal(v1); inner_product = identity(3); }"#,
        expect![[
            r#"1:100 inner product must be matrix(2, 2), found matrix(3, 3) [one row and column per basis element of the algebra]"#
        ]],
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); stage a; stage b = ideal(v1); inner_product = v1*identity(2); }"#,
        expect![[
            r#"1:100 inner product contains `v1`, which is no parameter, shape coordinate or time [the group leaves an inner product on its algebra as it is]"#
        ]],
    );
}

#[test]
fn scenes() {
    check(
        r#"model m { param a = 1; scene s { fix a = 1, a = 2; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:45 scene `s` fixes `a` twice [keep one of them]"#]],
    );
    check(
        r#"model m { param a: vector(2) = [1, 2]; scene s { fix a = 1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:54 `a` has 2 components, found 1 [the components are `a1`, `a2`]"#]],
    );
    check(
        r#"model m { param a = 1 where a > 0; scene s { fix a = -1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        expect![[r#"1:50 scene `s` violates `a > 0` [fix the parameters to valid values]"#]],
    );
}

#[test]
fn what_stages_carry_and_depend_on() {
    let se3 = "velocity O, V in se(3); lagrangian = dot(O, O);";
    check(
        &format!("model m {{ {se3} carry stages; }}"),
        expect![
            "1:65 there are no stages to carry [declare them: `stage rotation; stage translation = ideal(V);`]"
        ],
    );
    check(
        &format!("model m {{ {se3} param a_1 = 1; stage a; stage b = ideal(V); carry stages; }}"),
        expect![
            "1:109 what is carried along a stage is called `a`, and `a_1` is taken [give the stage another name]"
        ],
    );
    check(
        &format!("model m {{ {se3} param k = 1; stage a; stage b = ideal(V1 + k*V2); }}"),
        expect![
            "1:81 stage b is not an ideal of a: [O1, V1 + k*V2] = k*V3 leaves it [add the missing directions]"
        ],
    );
    check(
        &format!(
            "model m {{ {se3} coordinate x in real; stage a; stage b = ideal(V) {{ connection O = [x_dot, 0, 0]; }} }}"
        ),
        expect![
            "1:122 the connection of stage `b` is not known to lie in its ideal [give it the components of the ideal alone]"
        ],
    );
    check(
        &format!("model m {{ {se3} coordinate x in real; stage a; stage b = ideal(x*V1, V2, V3); }}"),
        expect![
            "1:90 ideal of stage `b` is not spanned by combinations of velocities in parameters [use `O1`, `O2`, `O3`, `V1`, `V2`, `V3`]"
        ],
    );
    check(
        &format!("model m {{ {se3} stage a; stage b = ideal(V) {{ connection V = [1, 0, 0]; }} }}"),
        expect!["1:100 connection on `V` without a base has no use [declare the base with `coordinate`]"],
    );
}

/// What is not seen has no place in a text: XML and Rust, into which docs and titles go, refuse it.
#[test]
fn hidden_characters() {
    let model = |before: &str, inside: &str| {
        format!("{before}model m {{ {inside} coordinate x in real; lagrangian = 1/2*x_dot^2; }}")
    };
    check(
        &model(
            "/// A title \u{202e}elttil\n/// bell \u{7}, null \0\n",
            "/// \u{2066}doc\u{2069}\n param p = 1;",
        ),
        expect![[r#"
            1:13 the character U+202E is not part of the language [remove this character: it is not seen, and changes how the line reads]
            2:10 the character U+0007 is not part of the language [remove this control character]
            2:18 the character U+0000 is not part of the language [remove this control character]
            3:15 the character U+2066 is not part of the language [remove this character: it is not seen, and changes how the line reads]
            3:19 the character U+2069 is not part of the language [remove this character: it is not seen, and changes how the line reads]"#]],
    );
    check(
        &model("// one line\r// as another\n", "source \"by \\u{202e}nobody\"; topic \"a\\u{7}b\";"),
        expect![[r#"
            1:12 the character U+000D is not part of the language [end lines with a line feed, or with a carriage return and a line feed]
            2:18 the character U+202E is not part of the language [remove this character: it is not seen, and changes how the line reads]
            2:45 the character U+0007 is not part of the language [remove this control character]"#]],
    );
    // Comments and names as well, and not more of them than anybody reads.
    let many = "\u{200f}".repeat(100);
    assert_eq!(report(&model("", &format!("/* {many} */"))).lines().count(), 20);
    assert!(report(&model("", "param a\u{1b}b = 1;")).contains("U+001B"));
    assert_eq!(report(&model("/// Äpfel, Ω → 中\r\n\t", "").replace("; ", ";\r\n")), "no problem");
}
