//! Pages about models: complete, well-formed, self-contained, and alive in a browser where there is one.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A directory of its own for a test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("hamel-report-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn report(arguments: &[&str], output: &Path) -> String {
    let out = Command::new(env!("CARGO_BIN_EXE_hamel"))
        .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
        .arg("report")
        .args(arguments)
        .arg("-o")
        .arg(output)
        .output()
        .unwrap();
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    std::fs::read_to_string(output).unwrap()
}

/// A page takes no step and no seed, so that it has no path of a noise.
#[test]
fn a_scene_with_noise_has_a_page_without_a_motion() {
    let folder = Folder::new("noise");
    let (model, page) = (folder.0.join("m.hamel"), folder.0.join("m.html"));
    let text = "model m { coordinate x in real; noise w; lagrangian = x_dot^2/2 - x^2; force x_dot = w; }";
    std::fs::write(&model, text).unwrap();
    let shown = model.to_str().unwrap();
    report(&[shown, "--scene", "stochastic", "--no-run"], &page);
    let out = Command::new(env!("CARGO_BIN_EXE_hamel"))
        .args(["report", shown, "--scene", "stochastic", "-o"])
        .arg(&page)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&out.stderr);
    assert!(told.contains("--no-run makes one without a motion"), "{told}");
}

/// Every element that is opened is closed, in order; the page is written such that XML's rules hold but for the
/// doctype.
fn assert_well_formed(html: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = html.strip_prefix("<!DOCTYPE html>").expect("a doctype");
    while let Some(start) = rest.find('<') {
        let text = &rest[..start];
        assert!(!text.contains('>'), "a bare > in {text:?}");
        let end = start + rest[start..].find('>').expect("the end of a tag");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "inside {open:?}");
            continue;
        }
        let name = tag.split([' ', '\n', '/']).next().unwrap();
        if tag.ends_with('/') {
            continue;
        }
        if name == "script" || name == "style" {
            let close = format!("</{name}>");
            rest = &rest[rest.find(&close).expect("the end of raw text") + close.len()..];
        } else {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?} are never closed");
}

fn assert_self_contained(html: &str) {
    for attribute in ["src=", "url(", "@import", "<link", "<iframe", "fetch(", "XMLHttpRequest", "import("] {
        assert!(!html.contains(attribute), "{attribute}");
    }
    for (at, _) in html.match_indices("href=\"") {
        let target = html[at + 6..].split('"').next().unwrap();
        let id = target.strip_prefix('#').unwrap_or_else(|| panic!("{target} leaves the page"));
        assert!(html.contains(&format!("id=\"{id}\"")), "{target} leads nowhere");
    }
}

fn headings(html: &str) -> Vec<&str> {
    html.split("<h2>").skip(1).map(|rest| rest.split("</h2>").next().unwrap()).collect()
}

#[test]
fn a_page_has_every_section() {
    let folder = Folder::new("sections");
    let html = report(&["heavy_top", "--t-final", "2"], &folder.0.join("top.html"));
    let sections = [
        "Definition",
        "Lie algebra",
        "Kinematics (anchor)",
        "Equations of motion",
        "Found exactly",
        "Momenta along sections",
        "Operation counts",
        "Motion in space",
        "Motion",
        "Conservation",
        "Work and precision",
        "Generated module",
    ];
    assert_eq!(headings(&html), sections);
    let rhs = "<span class=\"k\">pub</span> <span class=\"k\">fn</span> rhs(";
    for text in
        ["<msub><mi>Ω</mi><mn>1</mn></msub>", rhs, "kg·m²", "advected", "dop853", "rk4", "id=\"view\""]
    {
        assert!(html.contains(text), "{text}");
    }
    assert_eq!(html.matches("<svg").count(), 3);
    let data = html.split("id=\"motion-data\">").nth(1).unwrap().split("</script>").next().unwrap();
    let data: serde_json::Value = serde_json::from_str(data).expect("numbers only");
    assert_eq!(data["views"].as_array().map(Vec::len), Some(3));
    assert!(html.len() < 2_000_000, "{} bytes", html.len());
}

#[test]
fn pages_are_well_formed_and_load_nothing() {
    let folder = Folder::new("forms");
    // Stages and curvature, connections, multipliers, quasi-velocities, constraints solved for.
    for model in [
        "euler_disk",
        "mobile_robot",
        "snakeboard",
        "ball_on_rotating_table",
        "kirchhoff_body",
        "wong_particle",
    ] {
        let html = report(&[model, "--no-run"], &folder.0.join("page.html"));
        assert_well_formed(&html);
        assert_self_contained(&html);
        assert!(!html.contains("<canvas"), "{model} was not to be run");
    }
    let html = report(&["rolling_disk", "--t-final", "1"], &folder.0.join("page.html"));
    assert_well_formed(&html);
    assert_self_contained(&html);
    assert!(html.contains("<canvas"));
    // Nothing says what to draw of this one.
    let html = report(&["wong_particle", "--t-final", "1"], &folder.0.join("page.html"));
    assert!(!html.contains("<canvas") && !html.contains("<script"));
}

/// What a page in a browser says about itself in the end.
const PROBE: &str = r#"<script>
window.faults = [];
window.addEventListener("error", (e) => window.faults.push(e.message));
window.addEventListener("load", () => {
  const canvas = document.getElementById("view");
  const shot = () => new Uint32Array(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.buffer);
  const first = shot();
  const slider = document.getElementById("time");
  slider.value = 0.37;
  slider.dispatchEvent(new Event("input"));
  const second = shot();
  let moved = 0;
  first.forEach((pixel, k) => { moved += pixel !== second[k]; });
  const of = (r, g, b) => first.filter((pixel) => (pixel & 0xffffff) === r + 256 * g + 65536 * b).length;
  const formula = document.querySelector(".formulas mfrac, .formulas msub, .formulas mover").getBoundingClientRect();
  document.body.dataset.probe = JSON.stringify({
    colours: new Set(first).size, moved, height: formula.height, faults: window.faults,
    orange: of(213, 94, 0), green: of(0, 158, 115),
  });
});
</script>"#;

/// The first browser that is there; without one, tests say so and pass.
fn browser() -> Option<&'static str> {
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome"];
    let is_there = |name: &&str| {
        Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
    };
    let found = names.into_iter().find(is_there);
    if found.is_none() {
        eprintln!("skipped: no browser (looked for {})", names.join(", "));
    }
    found
}

/// Opens the report of a model in a browser and returns what [`PROBE`] found.
fn probe(browser: &str, folder: &Folder, model: &str) -> serde_json::Value {
    let file = folder.0.join("page.html");
    let html = report(&[model, "--t-final", "2"], &file);
    std::fs::write(&file, html.replacen("<head>", &format!("<head>{PROBE}"), 1)).unwrap();
    let dump = folder.0.join("dom.html");
    let mut child = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .arg(format!("--user-data-dir={}", folder.0.join("profile").display()))
        .args(["--window-size=1200,900", "--virtual-time-budget=4000", "--dump-dom"])
        .arg(format!("file://{}", file.display()))
        .stdout(std::fs::File::create(&dump).unwrap())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(120) {
            let _ = child.kill();
            panic!("{browser} did not end");
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let dom = std::fs::read_to_string(&dump).unwrap();
    let probe = dom.split("data-probe=\"").nth(1).unwrap_or_else(|| panic!("{model}: the page did not load"));
    serde_json::from_str(&probe.split('"').next().unwrap().replace("&quot;", "\"")).unwrap()
}

#[test]
fn the_figure_in_space_moves_in_a_browser() {
    let Some(browser) = browser() else { return };
    let folder = Folder::new("browser");
    for model in ["heavy_top", "euler_disk"] {
        let probe = probe(browser, &folder, model);
        assert_eq!(probe["faults"].as_array().map(Vec::len), Some(0), "{model}: {probe}");
        assert!(probe["colours"].as_u64() > Some(20), "{model}: the canvas is blank: {probe}");
        assert!(probe["moved"].as_u64() > Some(200), "{model}: nothing moves: {probe}");
        assert!(probe["height"].as_f64() > Some(5.0), "{model}: formulas are not laid out: {probe}");
    }
}

/// One segment is inside a solid, the other, of another colour, above it.
#[test]
fn solids_hide_what_is_inside_or_behind_them() {
    let Some(browser) = browser() else { return };
    let folder = Folder::new("hidden");
    let shapes = ["ball(1) attitude q", "box(2, 2, 2)", "disk(1, 2) attitude q"];
    for shape in shapes {
        let text = format!(
            "model hidden {{ velocity Omega in so(3); lagrangian = dot(Omega, Omega); reconstruct q in SO(3); \
             view solid = {shape}; view inside = segment([-0.4, 0.1, 0], [0.4, 0.1, 0.3]); \
             view above = segment([0, 0, 1.2], [0, 0, 2]); initial Omega = [0.3, 0, 2]; }}"
        );
        let path = folder.0.join("hidden.hamel");
        std::fs::write(&path, text).unwrap();
        let probe = probe(browser, &folder, path.to_str().unwrap());
        assert_eq!(probe["orange"].as_u64(), Some(0), "{shape}: {probe}");
        assert!(probe["green"].as_u64() > Some(50), "{shape}: {probe}");
    }
}
