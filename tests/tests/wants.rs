//! Whatever a scene computes by itself can be wanted by name, for every shipped model.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, Want};
use hamel_tests::models;

fn groups(scene: &BuiltScene) -> Vec<(String, Vec<String>)> {
    let components =
        |o: &hamel_mechanics::mechanics::Output| o.components.iter().map(|(n, _)| n.clone()).collect();
    scene.outputs().iter().map(|o| (o.name.clone(), components(o))).collect()
}

/// The default scene has every group of outputs; a scene that wants each by its name has the same, and every name is
/// one of [`Want`] or the model's own.
#[test]
fn every_output_of_the_default_scene_can_be_wanted_by_its_name() {
    let mut seen = Vec::new();
    for name in models::names() {
        let all = groups(&models::build(&name, scene::DEFAULT));
        let wants: Vec<&str> = all.iter().map(|(group, _)| group.as_str()).collect();
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
        let wanted = scene::build(&model, "wanted_by_name").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(groups(&wanted), all, "{name}");
        seen.extend(wants.into_iter().map(str::to_owned));
    }
    // The sweep has met what was once refused.
    for want in [Want::Constraint, Want::NonholonomicMomentum, Want::MomentumEquation] {
        assert!(seen.iter().any(|group| group == want.name()), "{want:?}");
    }
}
