//! What a scene can say about its formulation.

use expect_test::expect;

use super::bad::check;
use hamel_codegen::spec::{FormulationSearch, parse};

fn scene(items: &str) -> String {
    format!("model m {{ velocity w in R; lagrangian = w^2; scene s {{ {items} }} }}")
}

#[test]
fn which_formulations_are_searched() {
    let asked = |items: &str| parse("test.hamel", &scene(items)).unwrap().scenes[0].formulation;
    assert_eq!(asked("want energy;"), None);
    assert_eq!(asked("formulation auto;"), Some(FormulationSearch::KeepingState));
    assert_eq!(asked("formulation auto(state); want energy;"), Some(FormulationSearch::AnyState));
}

#[test]
fn what_cannot_be_asked_for() {
    check(&scene("formulation fast;"), expect![[r#"1:68 unknown formulation `fast` [legal here: `auto`]"#]]);
    check(
        &scene("formulation atuo;"),
        expect![[r#"1:68 unknown formulation `atuo` [did you mean `auto`?]"#]],
    );
    check(
        &scene("formulation auto(momenta);"),
        expect![[
            r#"1:73 a formulation cannot be searched with another `momenta` [`auto(state)` may change what the state is, `auto` may not]"#
        ]],
    );
    check(
        &scene("formulation auto; formulation auto(state);"),
        expect![[r#"1:86 scene `s` says `formulation` twice [keep one of them]"#]],
    );
    check(
        &scene("formulation;"),
        expect![[
            r#"1:67 expected `auto` or `auto(state)`, found `;` [written as `scene name { fix m = 1; want energy; drop x; }`]"#
        ]],
    );
    check(
        &scene("formulation auto(state, 2);"),
        expect![[
            r#"1:78 expected `)`, found `,` [written as `scene name { fix m = 1; want energy; drop x; }`]"#
        ]],
    );
}
