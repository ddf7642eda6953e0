//! What is wrong, and what is said about it: `line:column message [help]`, one line per problem.

use crate::spec::parse;

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
pub(super) fn check(text: &str, expected: &str) {
    let found = report(text);
    assert_eq!(found, expected, "\nin {text}\nfound:\n{found}\n");
}

#[test]
fn syntax() {
    check(r#""#, r#"1:1 the file contains no model [begin with `model name { .. }`]"#);
    check(r#"// nothing"#, r#"1:11 the file contains no model [begin with `model name { .. }`]"#);
    check(r#"modell m { }"#, r#"1:1 expected `model name { .. }`, found `modell`"#);
    check(r#"model { }"#, r#"1:7 expected the name of the model, found `{`"#);
    check(r#"model m"#, r#"1:8 expected `{`, found the end of the file"#);
    check(
        r#"model m { } model n { }"#,
        r#"1:7 model `m` has no velocity [declare `velocity Omega in so(3);` or a `coordinate`]
1:7 model `m` has no lagrangian [add `lagrangian = ..;`]
1:13 `model` after the end of the model [a file holds one model: `model name { .. }`]"#,
    );
    check(
        r#"model m { parm a = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:11 `parm` begins no item [did you mean `param`?]"#,
    );
    check(
        r#"model m { param a = 1 velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:22 expected `;`, found `velocity` [every item ends with `;`]"#,
    );
    check(
        r#"model m {
param a = 1
param b = 2
velocity Omega in so(3); lagrangian = dot(Omega, Omega);
}"#,
        r#"2:12 expected `;`, found `param` [every item ends with `;`]
3:12 expected `;`, found `velocity` [every item ends with `;`]"#,
    );
    check(
        r#"model m { param = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 expected the name of a parameter, found `=`"#,
    );
    check(
        r#"model m { param a = (1 + ; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 `(` is not closed [add the closing bracket]"#,
    );
    check(
        r#"model m { param a = (1 + 2; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 `(` is not closed [add the closing bracket]"#,
    );
    check(
        r#"model m { let a = b']; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `b` cannot begin a token [names are ASCII letters, digits and underscores]
1:20 `'` cannot begin a token [primes are not part of names: write `Omega_bar` or another name]
1:21 `]` does not close the bracket that is open here [every bracket is closed by its own kind]"#,
    );
    check(
        r#"model m { let a = Omega'; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:24 `'` cannot begin a token [primes are not part of names: write `Omega_bar` or another name]"#,
    );
    check(
        r#"model m { let a = 2x; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `x` directly after a number [write products with `*`, and numbers in decimals: `2*x`]"#,
    );
    check(
        r#"model m { let a = 2 ** 3; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 `**` is not an operator [powers are written `x^2`]"#,
    );
    check(
        r#"model m { let a == 3; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 expected `=`, found `==` [write `=`]"#,
    );
    check(
        r#"model m { let a = (1, 2); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 expected `)`, found `,` [vectors are written `[a, b, c]`]"#,
    );
    check(
        r#"model m { let a = []; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 empty vector [write its entries: `[a, b]`]"#,
    );
    check(
        r#"model m { let a = "x"; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 expected an expression, found "x" [texts are only used in `source`]"#,
    );
    check(
        r#"model m { source Kirchhoff; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:18 expected a text in quotes, found `Kirchhoff`"#,
    );
    check(
        r#"model m { #[inline] let a = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:11 attributes are not part of the language [documentation is written as `/// text`]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = dot(Omega, Omega); /// dangling
 }"#,
        r#"1:68 doc comment belongs to no item [write a plain comment with `//`]"#,
    );
    check(
        r#"//! inner
model m { velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:1 inner doc comments are not part of the language [write `///` before the model or the item]"#,
    );
    check(
        r#"model m { param a: tensor(3) = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:20 unknown shape `tensor` [legal here: `scalar`, `vector`, `diagonal`, `symmetric`, `matrix`]"#,
    );
    check(
        r#"model m { param a: matrix(3) = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:26 `matrix` has two dimensions, found 1 [write `matrix(3, 3)`]"#,
    );
    check(
        r#"model m { param a: vector(0) = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:27 dimension `0` is not between 1 and 200"#,
    );
    check(
        r#"model m { param a: vector(201) = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:27 dimension `201` is not between 1 and 200"#,
    );
    check(
        r#"model m { param a = 1 where a; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:30 expected `>`, `>=`, `<`, `<=` or `!=`, found `;`"#,
    );
    check(
        r#"model m { param a = 1 where a = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:31 an equation is not a condition on parameters [conditions use `>`, `>=`, `<`, `<=` or `!=`]"#,
    );
    check(
        r#"model m { param a = 1e401; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 exponent of the number is not between -400 and 400"#,
    );
    check(
        r#"model m { scene s { freeze a = 1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 expected `fix`, `want` or `drop`, found `freeze`"#,
    );
    check(
        r#"model m { constraint Omega3; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:28 expected `=`, found `;` [a constraint is an equation such as `dot(Omega, Gamma) = 0`]"#,
    );
    check(
        r#"model m { advected Gamma in R^3; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:32 expected `by` and the infinitesimal action, found `;` [for example `by cross(Omega, Gamma)`]"#,
    );
    check(
        r#"model m { coordinate x in circle; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:27 expected a domain: `(low, high)`, `angle` or `real`, found `circle`"#,
    );
    check(
        r#"model m { let a = C[1][2]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:23 a second index needs no bracket of its own [write `C[1, 2]`]"#,
    );
    check(
        r#"model m { let µ = 1; let b = 3 · 4; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:15 `µ` cannot be used as a name [names are ASCII letters, digits and underscores and begin with a letter]
1:32 `·` cannot begin a token [write `*`, `dot(a, b)` or `cross(a, b)`]"#,
    );
    check(
        r#"model m { let a = ((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((1)))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:83 expression is nested more than 64 levels deep [name a part of it with `let`]"#,
    );
}

#[test]
fn names() {
    check(
        r#"model fn { velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:7 `fn` cannot be used as a name [it is a Rust keyword, and the generated code keeps the names of the model]"#,
    );
    check(
        r#"model m { param type = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 `type` cannot be used as a name [it is a Rust keyword, and the generated code keeps the names of the model]"#,
    );
    check(
        r#"model m { param t = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 `t` cannot be used as a name [it is the time]"#,
    );
    check(
        r#"model m { param t1 = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 `t1` cannot be used as a name [`t` with a number is a temporary of the generated code]"#,
    );
    check(
        r#"model m { let sin = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:15 `sin` cannot be used as a name [it is a function of the language]"#,
    );
    check(
        r#"model m { param State = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 `State` cannot be used as a name [the generated code has an item of that name]"#,
    );
    check(
        r#"model m { param a = 1; param a = 2; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:30 `a` is declared twice [rename one of them; a vector `v` declares `v1`, `v2`, .. too]"#,
    );
    check(
        r#"model m {
let b = 1;
param b = 2;
velocity Omega in so(3); lagrangian = dot(Omega, Omega);
}"#,
        r#"3:7 `b` is declared twice [rename one of them; a vector `v` declares `v1`, `v2`, .. too]"#,
    );
    check(
        r#"model m { param Omega1 = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:38 `Omega1` is declared twice [rename one of them; a vector `v` declares `v1`, `v2`, .. too]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = dot(Omega, Omgea); }"#,
        r#"1:60 unknown name `Omgea` [did you mean `Omega`?]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = dot(Omega, Omega) + Omega4; }"#,
        r#"1:69 unknown name `Omega4` [`Omega` is vector(3): its components are `Omega1` to `Omega3`]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = dto(Omega, Omega); }"#,
        r#"1:49 unknown function `dto` [did you mean `dot`?]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = norm; }"#,
        r#"1:49 `norm` is a function [write `norm(..)`]"#,
    );
    check(
        r#"model m { param k = 1; velocity Omega in so(3); lagrangian = k(Omega1); }"#,
        r#"1:62 `k` is not a function [write a product as `k * (..)`]"#,
    );
    check(
        r#"model m { let a = b; let b = c; let c = a; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:15 definition in a circle: a -> b -> c -> a [define one of them without the others]"#,
    );
    check(
        r#"model m { let a = a + 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:15 definition in a circle: a -> a [define one of them without the others]"#,
    );
    check(
        r#"model m { output energy = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:18 `energy` cannot be used as a name [the generated code has an item of that name]"#,
    );
    check(
        r#"model m { output h = 1; casimir h = 2; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:33 output `h` is declared twice [rename one of them]"#,
    );
}

#[test]
fn shapes() {
    check(
        r#"model m { let a = [1, 2] + [1, 2, 3]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:28 cannot add vector(2) and vector(3) [both sides must have the same shape]"#,
    );
    check(
        r#"model m { let a = Omega + 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:27 cannot add vector(3) and a number [a number and a vector do not add: index the vector, as in `v[1]`, or use `dot`]"#,
    );
    check(
        r#"model m { let a = Omega*Omega; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 cannot multiply vector(3) and vector(3) [write `dot(a, b)` or `cross(a, b)`]"#,
    );
    check(
        r#"model m { let a = cross([1, 2], [3, 4]); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `cross` of vector(2) and vector(2) [both must be vector(3)]"#,
    );
    check(
        r#"model m { let a = dot(Omega, 1); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `dot` of vector(3) and a number [both must be vectors of one dimension]"#,
    );
    check(
        r#"model m { let a = [[1, 2], [3, 4]]*Omega; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 cannot multiply matrix(2, 2) and vector(3) [the matrix needs 3 columns instead of 2; `transpose` may help]"#,
    );
    check(
        r#"model m { let a = 1/Omega; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 cannot divide a number by vector(3) [only a number can divide: solve by hand or use `dot`]"#,
    );
    check(
        r#"model m { let a = Omega^2; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 cannot raise vector(3) to a number [powers are for numbers: write `dot(v, v)` or `A * A`]"#,
    );
    check(
        r#"model m { let a = sin(Omega); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `sin` takes a number, found vector(3) [apply it to each component, as in `[sin(a), sin(b)]`]"#,
    );
    check(
        r#"model m { let a = [1, [2]]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:23 entries of different shapes: a number and vector(1)"#,
    );
    check(
        r#"model m { let a = [[1, 2], [3]]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:28 entries of different shapes: vector(2) and vector(1)"#,
    );
    check(
        r#"model m { let a = Omega[4]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:25 index 4 is not between 1 and 3"#,
    );
    check(
        r#"model m { let a = Omega[0]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:25 index 0 is not between 1 and 3"#,
    );
    check(
        r#"model m { let a = Omega[1, 2]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 2 indices for vector(3) [write `v[1]`]"#,
    );
    check(
        r#"model m { let a = Omega[1/2]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:25 expected a whole number [indices and dimensions are constants such as `2`]"#,
    );
    check(
        r#"model m { let a = dot(Omega); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `dot` takes 2 arguments, found 1 [both are vectors: `dot(a, b)`]"#,
    );
    check(
        r#"model m { let a = diag(1, 2); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `diag` takes 1 argument, found 2 [write `diag([a, b, c])`]"#,
    );
    check(
        r#"model m { let a = 1/(2 - 2); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 division by zero"#,
    );
    check(
        r#"model m { let a = 2^5000; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 exponent 5000 is too large, the limit is 1000"#,
    );
    check(
        r#"model m { let a = inverse(hat(Omega)); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 unknown function `inverse` [matrices are not inverted: write the solution out]"#,
    );
    check(
        r#"model m { let a = hat([1, 2]); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `hat` takes vector(3), found vector(2)"#,
    );
    check(
        r#"model m { let a = det([[1, 2, 3]]); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `det` takes a square matrix, found matrix(1, 3)"#,
    );
    check(
        r#"model m { let a = Omega*hat(Omega); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 cannot multiply vector(3) and matrix(3, 3) [write `transpose(v) * A` or `A * v`]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = Omega; }"#,
        r#"1:49 the lagrangian must be a number, found vector(3) [use `dot(a, b)` for the pairing of vectors]"#,
    );
    check(
        r#"model m { casimir c = Omega; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:23 casimir `c` must be a number, found vector(3) [use `dot(a, b)` for the pairing of vectors]"#,
    );
}

#[test]
fn params() {
    check(
        r#"model m { param a; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 parameter `a` has no default [write `= 1.0`]"#,
    );
    check(
        r#"model m { param a = [1, 2]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 parameter `a` is a number, its default is a list [declare it as a vector: `param a: vector(2) = ..`]"#,
    );
    check(
        r#"model m { param a: vector(3) = [1, 2]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:32 `a` has 3 components, its default 2 [the components are `a1`, `a2`, `a3`]"#,
    );
    check(
        r#"model m { param I: diagonal(2) = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:34 `I` has 2 components, its default 1 [the components are `I1`, `I2`]"#,
    );
    check(
        r#"model m { param a = 1; param b = a; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:34 `a` is not known here [defaults are numbers]"#,
    );
    check(
        r#"model m { param a = sqrt(2); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:21 the value is not a rational number [write it in decimals, such as `0.785398`]"#,
    );
    check(
        r#"model m { param a = -1 where a > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:30 the default violates `a > 0` [here a = -1]"#,
    );
    check(
        r#"model m { param a = 1; param b = 2; require a > b; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:45 the defaults violate `a > b` [here a = 1, b = 2]"#,
    );
    check(
        r#"model m { param a = 1 where Omega1 > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:29 condition `Omega1 > 0` contains `Omega1`, which is not a parameter [conditions restrict parameters only]"#,
    );
    check(
        r#"model m { param a: vector(2) = [1, 2] where a > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:45 condition `a > 0` compares vector(2) [conditions compare numbers]"#,
    );
    check(
        r#"model m { param a = 1 where 0 < a < 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:33 the default violates `a < 1` [here a = 1]"#,
    );
    check(
        r#"model m { param a = 0 where 1/a > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:29 condition `1/a > 0` has no value at the defaults [it divides by zero or leaves the domain of a function]"#,
    );
    check(
        r#"model m { param a = -1 where sqrt(a) > 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:30 condition `sqrt(a) > 0` has no value at the defaults [it divides by zero or leaves the domain of a function]"#,
    );
}

#[test]
fn algebras() {
    check(
        r#"model m { velocity x in sp(3); lagrangian = 1; }"#,
        r#"1:25 unknown algebra `sp` [legal here: `so`, `se`, `su`, `gl`, `sl`, `heisenberg`, `R`, `product`, `semidirect`]"#,
    );
    check(
        r#"model m { velocity x in so; lagrangian = 1; }"#,
        r#"1:25 `so` needs arguments [for example `so(3)`]"#,
    );
    check(
        r#"model m { velocity x in so(1); lagrangian = 1; }"#,
        r#"1:25 so(1) does not exist [possible: so(n) with n from 2 to 10]"#,
    );
    check(
        r#"model m { velocity x in so(40); lagrangian = 1; }"#,
        r#"1:25 so(40) is too large [the largest is so(10)]"#,
    );
    check(
        r#"model m { velocity a, b in so(3); lagrangian = 1; }"#,
        r#"1:20 2 names for the velocity in so(3) [give one name per slot: so(3) (3); or one per basis element: 3]"#,
    );
    check(
        r#"model m { velocity O in so(3); velocity V in R^3; lagrangian = dot(O, O); }"#,
        r#"1:41 velocities are declared twice [name all slots in one item: `velocity Omega, V in se(3);`]"#,
    );
    check(
        r#"model m { algebra g = h; algebra h = g; velocity x in g; lagrangian = 1; }"#,
        r#"1:19 definition in a circle: g -> h -> g [define one of them without the others]"#,
    );
    check(
        r#"model m { algebra so = so(3); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:19 `so` cannot be used as a name [it is built in]"#,
    );
    check(
        r#"model m { algebra g = so(3); algebra g = so(3); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:38 `g` is declared twice [rename one of them]"#,
    );
    check(
        r#"model m { algebra g { basis a, b, c; [a, b] = c; [a, c] = a; } velocity x in g; lagrangian = 1; }"#,
        r#"1:19 bracket [a, b] fails Jacobi with c: residual -c"#,
    );
    check(
        r#"model m { algebra g { basis a, b; [a, b] = a; [b, a] = b; } velocity x in g; lagrangian = 1; }"#,
        r#"1:47 bracket [b, a] is not antisymmetric [give each pair once and leave [e, e] out]"#,
    );
    check(
        r#"model m { algebra g { basis a, b; [a, q] = a; [a, b] = a^2; } velocity x in g; lagrangian = 1; }"#,
        r#"1:39 `q` is not a basis element [legal here: `a`, `b`]
1:56 expected a rational combination of basis elements [for example `2*e1 - e3`, or `0`]"#,
    );
    check(
        r#"model m { algebra g { [a, b] = a; } velocity x in g; lagrangian = 1; }"#,
        r#"1:23 expected `basis e1, e2, ..;`, found `[`"#,
    );
    check(
        r#"model m { velocity x in semidirect(so(3)); lagrangian = 1; }"#,
        r#"1:25 `semidirect` takes an algebra and its representations [for example `semidirect(so(3), standard)`]"#,
    );
    check(
        r#"model m { velocity x in semidirect(se(3), standard); lagrangian = 1; }"#,
        r#"1:43 `standard` does not exist for se(3) [so(n), gl(n), sl(n) and su(n) have one; give yours with `representation`]"#,
    );
    check(
        r#"model m { velocity x in semidirect(so(3), standrd); lagrangian = 1; }"#,
        r#"1:43 unknown representation `standrd` [did you mean `standard`?]"#,
    );
    check(
        r#"model m { representation r of so(3) on R^2 { e1 = [[0, 1], [0, 0]]; e2 = [[0, 0], [1, 0]]; e3 = [[1, 0], [0, 0]]; } velocity x in semidirect(so(3), r); lagrangian = 1; }"#,
        r#"1:26 matrices of e1 and e2 do not represent [e1, e2]: residual 1 in row 2, column 2"#,
    );
    check(
        r#"model m { representation r of so(3) on R^2 { e1 = [[0, 1], [0, 0]]; e4 = 1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:69 `e4` is not a basis element of so(3) [legal here: `e1`, `e2`, `e3`]"#,
    );
    check(
        r#"model m { representation r of R on R^2 { e1 = [1, 2]; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:47 matrix of `e1` must be matrix(2, 2) [write it by rows: `[[..], ..]`]"#,
    );
    check(
        r#"model m { representation r of R on R { e1 = [[1]]; } velocity x in semidirect(so(3), r); lagrangian = 1; }"#,
        r#"1:86 `r` represents R^1, not so(3) [declare a representation of this algebra]"#,
    );
    check(
        r#"model m { velocity x in product(R^90, R^90, R^90); lagrangian = 1; }"#,
        r#"1:25 algebra of dimension 270, the limit is 200"#,
    );
}

#[test]
fn mechanics() {
    check(
        r#"model m { }"#,
        r#"1:7 model `m` has no velocity [declare `velocity Omega in so(3);` or a `coordinate`]
1:7 model `m` has no lagrangian [add `lagrangian = ..;`]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); }"#,
        r#"1:7 model `m` has no lagrangian [add `lagrangian = ..;`]"#,
    );
    check(
        r#"model m { lagrangian = 1; }"#,
        r#"1:7 model `m` has no velocity [declare `velocity Omega in so(3);` or a `coordinate`]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = dot(Omega, Omega); lagrangian = dot(Omega, Omega); }"#,
        r#"1:81 `lagrangian` is given twice [keep one of them]"#,
    );
    check(
        r#"model m { velocity Omega in so(3); lagrangian = 1; }"#,
        r#"1:49 the lagrangian contains no velocity [the velocities are `Omega1`, `Omega2`, `Omega3`]"#,
    );
    check(
        r#"model m { action up; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:18 unknown side `up` [legal here: `left`, `right`]"#,
    );
    check(
        r#"model m { action left; action right; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:31 `action` is given twice [keep one of them]"#,
    );
    check(
        r#"model m { advected G in R^3 by cross(Omega, G) + [1, 0, 0]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:32 action on `G` is not linear in the velocities of the algebra [the velocities are `Omega1`, `Omega2`, `Omega3`]"#,
    );
    check(
        r#"model m { advected G in R^3 by G*norm(Omega); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:32 action on `G` is not linear in the velocities of the algebra [the velocities are `Omega1`, `Omega2`, `Omega3`]"#,
    );
    check(
        r#"model m { advected G in R^3 by dot(Omega, G); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:32 action on `G` must be vector(3), found a number [it is the rate of change of the parameter, up to the sign]"#,
    );
    check(
        r#"model m { coordinate q in real; advected G in R by q_dot*G; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:52 action on `G` is not linear in the velocities of the algebra [the velocities are `Omega1`, `Omega2`, `Omega3`]"#,
    );
    check(
        r#"model m { param a = 1; constraint a = 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:35 constraint `a = 0` contains no velocity [choose coordinates that satisfy it, or write its time derivative]"#,
    );
    check(
        r#"model m { constraint Omega = [1, 2]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:22 cannot equate vector(3) with vector(2) [both sides must have the same shape]"#,
    );
    check(
        r#"model m { constraint Omega1 = Omega1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:22 constraint `Omega1 = Omega1` always holds [remove it]"#,
    );
    check(
        r#"model m { constraint c: Omega1 = 0; constraint c: Omega2 = 0; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:51 constraint `c` is declared twice [rename one of them]"#,
    );
    check(
        r#"model m { constraint Omega = [Omega1, 0, 0]; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:22 component 1 of constraint `Omega = [Omega1, 0, 0]` always holds [remove it]"#,
    );
    check(
        r#"model m { constraint Omega3 = 0; independent Omega; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:34 3 independent velocities, the constraints leave 2 [velocities: 3, scalar constraints: 1]"#,
    );
    check(
        r#"model m { constraint Omega3 = 0; independent Omega1, Omega1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:54 `Omega1` is named twice [name every velocity once]"#,
    );
    check(
        r#"model m { independent Omg; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:23 `Omg` is not a velocity [legal here: `Omega`, `Omega1`, `Omega2`, `Omega3`]"#,
    );
    check(
        r#"model m { force Omega = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 force on `Omega` must be vector(3), found a number [a force pairs with its velocity component by component]"#,
    );
    check(
        r#"model m { force Omega = -Omega; force Omega1 = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:39 force on `Omega1` is given twice [add them in one item]"#,
    );
    check(
        r#"model m { force Gamma = 1; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:17 `Gamma` is not a velocity [legal here: `Omega`, `Omega1`, `Omega2`, `Omega3`]"#,
    );
    check(
        r#"model m { coordinate q in (1, 0); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:22 interval is empty [write the lower end first: `(0, pi/2)`]"#,
    );
    check(
        r#"model m { coordinate q in (0, Omega1); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:31 `Omega1` is not known here [the ends of an interval contain parameters and numbers only]"#,
    );
    check(
        r#"model m { coordinate q: symmetric(2) in real; velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:22 coordinate `q` must be a number or a vector [write `coordinate x: vector(3) in real;`]"#,
    );
}

#[test]
fn stages() {
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(O); }"#,
        r#"1:68 stage b is not an ideal of a: [V1, O2] = V3 leaves it [add the missing directions]"#,
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(V1); }"#,
        r#"1:68 stage b is not an ideal of a: [O2, V1] = -V3 leaves it [add the missing directions]"#,
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(O, V); }"#,
        r#"1:68 stage b splits nothing off [it has to be smaller than the stage above and not zero]"#,
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage b = ideal(V); }"#,
        r#"1:59 the first stage `b` is the whole algebra and has no ideal [declare it as `stage name;` before the ideals]"#,
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b; }"#,
        r#"1:74 stage `b` has no ideal [only the first stage is the whole algebra; write `stage name = ideal(V);`]"#,
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(V1^2); }"#,
        r#"1:68 ideal of stage `b` is not spanned by rational combinations of velocities [use `O1`, `O2`, `O3`, `V1`, `V2`, `V3`]"#,
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage a = ideal(V); }"#,
        r#"1:68 stage `a` is declared twice [rename one of them]"#,
    );
    check(
        r#"model m { velocity O, V in se(3); lagrangian = dot(O, O); stage a; stage b = ideal(W); }"#,
        r#"1:84 unknown name `W` [legal here: `O`, `O1`, `O2`, `O3`, `V`, `V1`, `V2`, `V3`, `pi`, `t`]"#,
    );
    check(
        r#"model m { inner_product = identity(3); velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:27 `inner_product` without stages has no use [declare stages: `stage rotation; stage translation = ideal(V);`]"#,
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); stage a; stage b = ideal(v1); inner_product = [[1, 2], [3, 4]]; }"#,
        r#"1:100 inner product is not symmetric: entries (1, 2) and (2, 1) differ [a `symmetric(n)` parameter is symmetric by construction]"#,
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); stage a; stage b = ideal(v1); inner_product = identity(3); }"#,
        r#"1:100 inner product must be matrix(2, 2), found matrix(3, 3) [one row and column per basis element of the algebra]"#,
    );
    check(
        r#"model m { velocity v in R^2; lagrangian = dot(v, v); stage a; stage b = ideal(v1); inner_product = v1*identity(2); }"#,
        r#"1:100 inner product contains `v1`, which is not a parameter [it is constant on the algebra]"#,
    );
}

#[test]
fn scenes() {
    check(
        r#"model m { param mass = 1; scene s { fix mas = 0; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:41 scene `s` fixes `mas`, which is not a parameter [did you mean `mass`?]"#,
    );
    check(
        r#"model m { param a = 1; scene s { fix a = 1, a = 2; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:45 scene `s` fixes `a` twice [keep one of them]"#,
    );
    check(
        r#"model m { param a: vector(2) = [1, 2]; scene s { fix a = 1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:54 `a` has 2 components, found 1 [the components are `a1`, `a2`]"#,
    );
    check(
        r#"model m { param a = 1 where a > 0; scene s { fix a = -1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:50 scene `s` violates `a > 0` [fix the parameters to valid values]"#,
    );
    check(
        r#"model m { scene s { want enrgy; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:26 `enrgy` is not an output [did you mean `energy`?]"#,
    );
    check(
        r#"model m { scene s { } scene s { } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:29 scene `s` is declared twice [rename one of them]"#,
    );
    check(
        r#"model m { scene s { want energy, energy; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:34 scene `s` wants `energy` twice [keep one of them]"#,
    );
    check(
        r#"model m { param a = 1; scene s { fix a = Omega1; } velocity Omega in so(3); lagrangian = dot(Omega, Omega); }"#,
        r#"1:42 `Omega1` is not known here [parameters are fixed to numbers]"#,
    );
}
