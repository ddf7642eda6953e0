//! What `list` knows by heart of the models that the program comes with is what it derives.

use std::collections::BTreeMap;
use std::path::Path;

use hamel::commands::list::by_heart::{Known, fingerprint, known};
use serde_json::Value;

use crate::common::program::{command, output};

/// Models whose scenes are derived by every run of the tests; all of them by a long one.
const SAMPLE: [&str; 5] = ["charged_particle", "free_rigid_body", "mobile_robot", "servo_ball", "suslov"];

/// Texts of the models that the program comes with, by name.
fn texts() -> BTreeMap<String, String> {
    let folders = ["specs", "shelf"].map(|name| Path::new(env!("CARGO_MANIFEST_DIR")).join(name));
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let paths =
        files.map(|file| file.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "hamel"));
    let named = paths.map(|path| {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        (name, std::fs::read_to_string(path).unwrap())
    });
    named.collect()
}

/// What `list --json` prints.
fn listed(arguments: &[&str]) -> Vec<Value> {
    let out = output(&mut command(arguments), "");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// The models as they are derived.
fn derived(models: &[&str]) -> Vec<Known> {
    let texts = texts();
    let listed = listed(&[&["list", "--json", "--no-cache"], models].concat());
    assert_eq!(listed.len(), models.len());
    let entry = |(name, listed): (&&str, Value)| {
        assert_eq!(listed["model"], **name);
        let scenes = serde_json::from_value(listed["scenes"].clone()).unwrap();
        Known { model: (*name).to_owned(), text: fingerprint(&texts[*name]), scenes }
    };
    models.iter().zip(listed).map(entry).collect()
}

#[test]
fn every_model_is_known_with_the_text_that_it_has() {
    let texts = texts();
    let expected: Vec<(&str, String)> =
        texts.iter().map(|(name, text)| (name.as_str(), fingerprint(text))).collect();
    let found: Vec<(&str, String)> = known().iter().map(|k| (k.model.as_str(), k.text.clone())).collect();
    let how = "UPDATE_EXPECT=1 cargo test -p hamel --test main -- listed:: --include-ignored";
    assert_eq!(found, expected, "the table is out of date: {how}");
}

#[test]
fn scenes_that_are_known_are_the_derived_ones() {
    let found: Vec<Known> = known().iter().filter(|k| SAMPLE.contains(&k.model.as_str())).cloned().collect();
    assert_eq!(found, derived(&SAMPLE));
}

#[test]
fn another_text_is_derived() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("listed");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("suslov.hamel");
    let text = texts()["suslov"]
        .replace("velocity Omega in so(3)", "velocity Spin in so(3)")
        .replace("Omega", "Spin");
    assert_ne!(text, texts()["suslov"]);
    std::fs::write(&path, text).unwrap();
    let listed = listed(&["list", "--json", path.to_str().unwrap()]);
    let state = listed[0]["scenes"][0]["state"].to_string();
    assert!(state.contains("Spin"), "{state}");
}

#[test]
#[ignore = "derives every scene of every model"]
fn all_scenes_that_are_known_are_the_derived_ones() {
    let texts = texts();
    let names: Vec<&str> = texts.keys().map(String::as_str).collect();
    let found = derived(&names);
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        // A line for each scene.
        let model = |k: &Known| {
            let scenes =
                k.scenes.iter().map(|scene| format!("      {}", serde_json::to_string(scene).unwrap()));
            let scenes: Vec<String> = scenes.collect();
            let scenes = scenes.join(",\n");
            format!(
                "  {{\n    \"model\": \"{}\",\n    \"text\": \"{}\",\n    \"scenes\": [\n{scenes}\n    ]\n  }}",
                k.model, k.text
            )
        };
        let models: Vec<String> = found.iter().map(model).collect();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/commands/list/scenes.json");
        std::fs::write(path, format!("[\n{}\n]\n", models.join(",\n"))).unwrap();
        return;
    }
    assert_eq!(known(), found);
}
