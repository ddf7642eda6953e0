//! The examples and the messages of `docs/model-language.md` are true, and the models of the book.

use hamel_codegen::files::compose_file;
use hamel_codegen::spec::{Want, Wanted, matrix_fluid, parse};

const DOC: &str = include_str!("../../../../docs/model-language.md");
/// Pages with models, and how many they have at least.
const PAGES: [(&str, &str, usize); 12] = [
    ("model-language.md", DOC, 17),
    ("tour.md", include_str!("../../../../docs/book/tour.md"), 7),
    ("stages.md", include_str!("../../../../docs/book/stages.md"), 1),
    ("higher-order.md", include_str!("../../../../docs/book/higher-order.md"), 1),
    ("closed-loops.md", include_str!("../../../../docs/book/closed-loops.md"), 2),
    ("modes.md", include_str!("../../../../docs/book/modes.md"), 2),
    ("fluids.md", include_str!("../../../../docs/book/fluids.md"), 5),
    ("controls.md", include_str!("../../../../docs/book/controls.md"), 1),
    ("parts.md", include_str!("../../../../docs/book/parts.md"), 2),
    ("lyapunov.md", include_str!("../../../../docs/book/lyapunov.md"), 4),
    ("noise.md", include_str!("../../../../docs/book/noise.md"), 1),
    ("scenes.md", include_str!("../../../../docs/book/scenes.md"), 1),
];

/// Items as a model; a velocity and a Lagrangian are added where they are not what the example is about.
fn wrap(items: &str) -> String {
    if items.contains("model ") {
        return items.to_owned();
    }
    let mut text = format!("model example {{ {items}\n");
    let has = |word: &str| items.split([' ', '\n', ';']).any(|w| w == word);
    let is_given = has("acceleration") || has("field");
    if !has("velocity") && !has("coordinate") && !has("momentum") {
        text.push_str("velocity rate in R;\n");
    }
    if !has("lagrangian") && !has("hamiltonian") && !is_given {
        // Any quadratic form of what there is.
        let velocities = if has("coordinate") && !has("velocity") {
            "q_dot"
        } else {
            let list =
                items.split("velocity ").nth(1).unwrap_or("rate in").split(" in").next().unwrap_or("rate");
            list.split(',').next().unwrap_or("rate").trim()
        };
        text.push_str(&format!("lagrangian = transpose([{velocities}, {velocities}])[1, 1]^2;\n"));
    }
    text.push('}');
    text
}

#[test]
fn examples_parse() {
    for (page, text, least) in PAGES {
        let mut n = 0;
        for block in text.split("```hamel\n").skip(1) {
            let items = block.split("```").next().unwrap();
            // The added Lagrangian is a number or, for vectors, its first entry.
            let text = wrap(items);
            let fluid = matrix_fluid(page, &text).unwrap_or_else(|problems| panic!("{text}\n{problems}"));
            if fluid.is_none() {
                // Files that examples name are beside the pages of the book.
                let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/book/page.md");
                let text = compose_file(folder, folder.as_ref(), text.clone());
                let text = text.unwrap_or_else(|problems| panic!("{problems}"));
                parse(page, &text).unwrap_or_else(|problems| panic!("{text}\n{problems}"));
            }
            n += 1;
        }
        assert!(n >= least, "only {n} examples found in {page}");
    }
}

#[test]
fn messages_are_the_documented_ones() {
    let mut n = 0;
    for line in DOC.lines() {
        let Some((items, message)) = line.strip_prefix("| `").and_then(|rest| rest.split_once("` | ")) else {
            continue;
        };
        if !items.ends_with([';', '}']) {
            continue;
        }
        let message = message.trim_end_matches(" |");
        let problems = parse("model-language.md", &wrap(items)).expect_err(items);
        let found: Vec<&str> = problems.iter().map(|p| p.message.as_str()).collect();
        assert_eq!(found, [message], "{items}");
        n += 1;
    }
    assert!(n > 40, "only {n} messages found");
}

/// What is documented, what is accepted and what outputs are refused as names is one list.
#[test]
fn every_want_is_documented_and_accepted() {
    let section =
        DOC.split("### scene").nth(1).and_then(|rest| rest.split("## Error messages").next()).unwrap();
    for want in Want::ALL.map(Want::name) {
        assert!(section.contains(&format!("`{want}`")), "{want} is not documented");
        let items = "coordinate x in real; velocity w in so(2); connection w = x*x_dot; reconstruct theta in SO(2); lagrangian = w^2 + x_dot^2; reduces \"t.hamel\" {}";
        let model = |more: &str| format!("model m {{ {items} {more} }}");
        let scene = model(&format!("scene s {{ want {want}; }}"));
        if want == Want::Matrices.name() {
            // Of ideal fluids alone, which are no models with equations.
            assert!(matrix_fluid("m.hamel", &scene).unwrap_err().to_string().contains("fluids alone"));
            let output = model(&format!("output {want} = w;"));
            assert!(parse("m.hamel", &output).unwrap_err().to_string().contains("cannot be used as a name"));
            continue;
        }
        let wants = parse("m.hamel", &scene).unwrap_or_else(|e| panic!("{e}")).scenes[0].wants.clone();
        assert_eq!(wants.iter().map(Wanted::name).collect::<Vec<_>>(), [want]);
        let output = model(&format!("output {want} = w;"));
        let problems = parse("m.hamel", &output).expect_err(want);
        assert!(problems.to_string().contains("cannot be used as a name"), "{problems}");
    }
}
