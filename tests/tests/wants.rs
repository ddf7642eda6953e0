//! Whatever a scene computes by itself can be wanted by name, for every shipped model.

use std::collections::BTreeSet;

use hamel_codegen::scene;
use hamel_codegen::spec::{self, Want};
use hamel_tests::derived::scene_of_text;
use hamel_tests::{at_length, models};

/// The default scene has every group of outputs; a scene that wants each by its name has the same, and every name is
/// one of [`Want`] or the model's own. A model whose groups others have had is built a second time at length alone.
#[test]
fn every_output_of_the_default_scene_can_be_wanted_by_its_name() {
    let mut seen = BTreeSet::new();
    for name in models::names() {
        let all = models::derived(&name, scene::DEFAULT).outputs();
        let wants: Vec<&str> = all.iter().map(|group| group.name.as_str()).collect();
        assert!(!wants.is_empty(), "{name} has no outputs");
        let text =
            models::text_with(&name, &format!("scene wanted_by_name {{ want rhs, {}; }}", wants.join(", ")));
        let model = spec::parse(&name, &text).unwrap_or_else(|e| panic!("{e}"));
        let own = |group: &str| {
            let casimirs = model.casimirs.iter().map(|c| &c.name);
            model.outputs.iter().map(|o| &o.name).chain(casimirs).any(|own| own == group)
        };
        assert!(
            wants.iter().all(|group| Want::from_name(group).is_some() || own(group)),
            "{name}: {wants:?}"
        );
        if at_length() || wants.iter().any(|group| !seen.contains(*group)) {
            assert_eq!(scene_of_text(&name, &text, "wanted_by_name").outputs(), all, "{name}");
        }
        seen.extend(wants.into_iter().map(str::to_owned));
    }
    // The sweep has met what was once refused.
    for want in [Want::Constraint, Want::NonholonomicMomentum, Want::MomentumEquation] {
        assert!(seen.contains(want.name()), "{want:?}");
    }
}
