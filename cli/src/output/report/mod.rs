//! One page about a scene: definition, equations, operations, code, a motion, its accuracy, and a figure in space.
//!
//! The page is a single file that loads nothing. Equations are MathML, plots are SVG, and the figure in space is drawn
//! by a small script from numbers that the interpreter computed.
//!
//! Does not know: how anything was derived, integrated or plotted; what a model's name means.

pub mod contents;

use std::fmt::Write as _;

use hamel_codegen::explain::{Section, SectionKind};
use hamel_codegen::spec::Want;

use super::columns::Chosen;
use super::files::{Run, figure};
use super::plot::field::Field;
use super::plot::loglog::{self, Curve, LogLog};
use super::plot::{self, Figure, Panel, Surface};
use contents::{Page, Quantity, ViewKind};
use hamel_run::error::Error;
use hamel_run::info::Info;
use hamel_run::method::{MethodName, Steps};
use hamel_run::model::blocks::Block;
use hamel_run::simulation::{SimulateRequest, SimulateResponse};

const CSS: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("view.js");
const FIELD_SCRIPT: &str = include_str!("field.js");

/// Frames of the figure in space and samples of the plots.
pub const SAMPLES: usize = 601;

/// A motion that the page shows.
#[derive(Debug)]
pub struct Motion {
    /// Names of the scene that was integrated.
    pub info: Info,
    /// Groups of its state variables.
    pub blocks: Vec<Block>,
    /// What was asked.
    pub request: SimulateRequest,
    /// What came out, outputs included.
    pub response: SimulateResponse,
    /// Error against work, by method.
    pub precision: Precision,
    /// Functions on the torus over time, which the page plays.
    pub fields: Vec<Field>,
    /// Functions whose pictures stand below the curves.
    pub pictures: Vec<Field>,
}

/// Errors at the end of a motion against the evaluations of the right-hand side.
#[derive(Clone, Debug, Default)]
pub struct Precision {
    /// Name of the method, evaluations and errors.
    pub methods: Vec<(String, Vec<(f64, f64)>)>,
    /// Errors below it are not shown: the difference of the two most accurate solutions.
    pub floor: f64,
    /// Time at which solutions are compared.
    pub t: f64,
}

/// A run with more steps, as next to a point where the equations end, is given up: a page is made while somebody waits.
pub const MAX_STEPS: u64 = 100_000;

/// Relative tolerances of the comparison; the absolute ones are a hundredth.
const TOLERANCES: [f64; 9] = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12];
/// Tolerances of the solution that others are compared to, and of the one that says how good it is.
const REFERENCE: [f64; 2] = [2e-14, 2e-13];

impl Precision {
    /// Integrates with every method over a range of tolerances; fixed steps for a method without error estimate.
    ///
    /// The error is `max_i |y_i - z_i| / max(1, |z_i|)` at the end, `z` being the solution of the eighth-order method
    /// at the tightest tolerance. Runs that fail, as coarse ones may, leave no point. Taylor series are left out: they
    /// evaluate recurrences of many orders, not the right-hand side. So are Newton's iterations, whose Jacobians it
    /// does not count, and `auto`, which is one of the others.
    pub fn measure(
        t_final: f64,
        mut solve: impl FnMut(MethodName, Steps) -> Result<SimulateResponse, Error>,
    ) -> Precision {
        let adaptive = |rtol: f64| Steps::Adaptive { rtol, atol: rtol / 100.0, max: None };
        let [Ok(reference), Ok(other)] = REFERENCE.map(|rtol| solve(MethodName::Dop853, adaptive(rtol)))
        else {
            return Precision::default();
        };
        let error = |y: &[f64]| {
            let parts = y.iter().zip(&reference.last).map(|(y, z)| (y - z).abs() / z.abs().max(1.0));
            parts.fold(0.0, f64::max)
        };
        let floor = error(&other.last).max(f64::EPSILON);
        let mut methods = Vec::new();
        for method in MethodName::all().filter(|method| method.evaluates_rates_alone()) {
            // Twice as many steps each time; the Gauss methods take few large ones.
            let fixed = |k: u32| Steps::Fixed { step: t_final / f64::from(1 << k) };
            let steps: Vec<Steps> = match method {
                MethodName::Rk4 => (5..13).map(fixed).collect(),
                _ if method.has_fixed_steps() => (4..11).map(fixed).collect(),
                _ => TOLERANCES.map(adaptive).to_vec(),
            };
            let runs = steps.into_iter().filter_map(|steps| solve(method, steps).ok());
            let points: Vec<(f64, f64)> = runs
                .map(|run| (run.rhs_evals as f64, error(&run.last)))
                .filter(|(work, error)| *work > 0.0 && *error >= floor && *error < 10.0)
                .collect();
            if !points.is_empty() {
                methods.push((method.name().to_owned(), points));
            }
        }
        Precision { methods, floor, t: t_final }
    }

    fn figure(&self) -> Option<LogLog> {
        let curve = |(name, points): &(String, Vec<(f64, f64)>)| Curve {
            name: name.clone(),
            broken: false,
            points: points.iter().map(|(work, error)| [*work, *error]).collect(),
        };
        let curves: Vec<Curve> = self.methods.iter().map(curve).collect();
        (!curves.is_empty()).then(|| LogLog {
            title: "Work and precision".into(),
            subtitle: format!("error at t = {:?} against the solution at rtol {:e}", self.t, REFERENCE[0]),
            labels: ["evaluations of the right-hand side".into(), "error".into()],
            curves,
        })
    }
}

/// The text of the page.
///
/// # Errors
/// [`Error::Io`] when a figure cannot be drawn.
pub fn page(page: &Page, motion: Option<&Motion>) -> Result<String, Error> {
    let mut sections: Vec<(String, String)> = vec![("Definition".into(), definition(page))];
    for Section { kind, text } in &page.sections {
        let title = kind.title().to_owned();
        if *kind != SectionKind::Equations {
            sections.push((title, text.clone()));
            continue;
        }
        let code = highlight(&page.rhs, RUST);
        let text = format!(
            "<div class=\"beside\"><div>{text}</div><div><p>The generated Rust of the right-hand side:</p>\n\
             <pre class=\"code\"><code>{code}</code></pre></div></div>\n"
        );
        sections.push((title, text));
    }
    if !page.operations.is_empty() {
        sections.push((SectionKind::Counts.title().into(), operations(page)));
    }
    let mut scripts = String::new();
    if let Some(motion) = motion {
        if !page.views.is_empty() {
            scripts.push_str(&script("motion-data", &motion_data(page, motion), SCRIPT));
            sections.push(("Motion in space".into(), view_panel(page)));
        }
        if !motion.fields.is_empty() {
            scripts.push_str(&script("field-data", &field_data(motion), FIELD_SCRIPT));
            sections.push(("Fields over time".into(), field_panel(&motion.fields)));
        }
        motion_sections(page, motion, &mut sections)?;
    }
    let whole = format!(
        "<details><summary>{} lines</summary>\n<pre class=\"code\"><code>{}</code></pre></details>\n",
        page.module.lines().count(),
        highlight(&page.module, RUST)
    );
    sections.push(("Generated module".into(), whole));

    let title = escape(&page.title);
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{title}</title>\n<style>\n{CSS}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n\
         <p class=\"quiet\"><code>{}</code>, scene <code>{}</code>: {}</p>\n</header>\n\
         <nav aria-label=\"Contents\"><ol>\n",
        escape(&page.model),
        escape(&page.scene),
        escape(&page.kind)
    );
    for (title, _) in &sections {
        let _ = writeln!(html, "<li><a href=\"#{}\">{}</a></li>", anchor(title), escape(title));
    }
    html.push_str("</ol></nav>\n<main>\n");
    for (title, text) in &sections {
        let (id, title) = (anchor(title), escape(title));
        let _ = writeln!(html, "<section id=\"{id}\">\n<h2>{title}</h2>\n{text}</section>");
    }
    html.push_str("</main>\n");
    html.push_str(&scripts);
    html.push_str("</body>\n</html>\n");
    Ok(html)
}

/// The text of a small page with the moving pictures of a motion alone, to be shown within another page; none where the
/// model says nothing to draw.
pub fn moving(page: &Page, motion: &Motion) -> Option<String> {
    let (mut panels, mut scripts) = (String::new(), String::new());
    if !page.views.is_empty() {
        panels.push_str(&view_panel(page));
        scripts.push_str(&script("motion-data", &motion_data(page, motion), SCRIPT));
    }
    if !motion.fields.is_empty() {
        panels.push_str(&field_panel(&motion.fields));
        scripts.push_str(&script("field-data", &field_data(motion), FIELD_SCRIPT));
    }
    let title = escape(&page.title);
    (!panels.is_empty()).then(|| {
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<title>{title}</title>\n\
             <style>\n{CSS}</style>\n</head>\n<body>\n<main>\n{panels}</main>\n{scripts}</body>\n</html>\n"
        )
    })
}

fn anchor(title: &str) -> String {
    title.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

fn definition(page: &Page) -> String {
    let mut text = String::new();
    for paragraph in page.doc.split(|line| line.trim().is_empty()).filter(|lines| !lines.is_empty()) {
        let _ = writeln!(text, "<p>{}</p>", prose(&paragraph.join(" ")));
    }
    if !page.sources.is_empty() {
        text.push_str("<p>Sources:</p>\n<ul>\n");
        for source in &page.sources {
            let _ = writeln!(text, "<li><cite>{}</cite></li>", escape(source));
        }
        text.push_str("</ul>\n");
    }
    let rows = |rows: &[Quantity], with_value: bool| {
        let mut text =
            String::from("<div class=\"wide\"><table class=\"data\">\n<thead><tr><th></th><th>name</th>");
        text.push_str(if with_value { "<th>default</th>" } else { "" });
        text.push_str("<th>unit</th><th>meaning</th></tr></thead>\n<tbody>\n");
        for q in rows {
            let _ = write!(text, "<tr><td><math>{}</math></td><td><code>{}</code></td>", q.math, q.name);
            if with_value {
                let _ = write!(
                    text,
                    "<td class=\"number\">{}</td>",
                    q.value.map_or(String::new(), |x| x.to_string())
                );
            }
            let _ = writeln!(text, "<td>{}</td><td>{}</td></tr>", escape(&q.unit), prose(&q.doc));
        }
        text.push_str("</tbody></table></div>\n");
        text
    };
    if !page.params.is_empty() {
        let _ = write!(text, "<h3>Parameters</h3>\n{}", rows(&page.params, true));
    }
    if !page.conditions.is_empty() {
        let list: Vec<String> =
            page.conditions.iter().map(|c| format!("<code>{}</code>", escape(c))).collect();
        let _ = writeln!(text, "<p>Valid for {}.</p>", list.join(", "));
    }
    let _ = write!(text, "<h3>State</h3>\n{}", rows(&page.state, false));
    let _ = writeln!(
        text,
        "<h3>Model file</h3>\n<pre class=\"code\"><code>{}</code></pre>",
        highlight(page.text.trim_end(), &page.keywords)
    );
    text
}

fn operations(page: &Page) -> String {
    let heads = ["add", "mul", "fused", "div", "sqrt", "neg", "calls", "cost"];
    let mut text = String::from(
        "<p>Additions and multiplications include the fused ones; calls are elementary functions; the cost weighs \
         them as the generator does.</p>\n<div class=\"wide\"><table class=\"data\">\n<thead><tr><th>function, section</th>",
    );
    for head in heads {
        let _ = write!(text, "<th>{head}</th>");
    }
    text.push_str("</tr></thead>\n<tbody>\n");
    for (name, counts) in &page.operations {
        let class = if name.starts_with(' ') { "part" } else { "" };
        let _ = write!(text, "<tr><td class=\"{class}\">{}</td>", escape(name.trim()));
        for n in counts {
            let _ = write!(text, "<td class=\"number\">{n}</td>");
        }
        text.push_str("</tr>\n");
    }
    text.push_str("</tbody></table></div>\n");
    text
}

fn motion_sections(page: &Page, motion: &Motion, sections: &mut Vec<(String, String)>) -> Result<(), Error> {
    let Motion { info, blocks, request, response, pictures, .. } = motion;
    // Fields that are played have a section of their own.
    let run = Run {
        info,
        title: &page.title,
        blocks,
        request,
        response,
        fields: pictures,
        chosen: &Chosen::default(),
    };
    let mut state = figure(&run)?;
    let mut conserved =
        Figure { times: state.times.clone(), x_label: state.x_label.clone(), ..Figure::default() };
    if response.initial_energy.is_some() {
        conserved.panels.extend(state.panels.pop());
    }
    let samples = &response.samples;
    if let Some(range) = info.output_range(Want::Constraint.name()).filter(|r| !r.is_empty()) {
        let largest =
            |outputs: &[f64]| outputs[range.clone()].iter().fold(0.0, |max: f64, x| max.max(x.abs()));
        let lines = vec![(String::new(), samples.iter().map(|s| largest(&s.outputs)).collect())];
        conserved.panels.push(Panel {
            title: "Largest residual of the constraint".into(),
            lines,
            ..Panel::default()
        });
    }
    if let Some(range) = info.output_range(Want::Casimirs.name()).filter(|r| !r.is_empty()) {
        let names =
            info.outputs.iter().find(|o| o.name == Want::Casimirs.name()).map(|o| o.components.clone());
        let line = |(k, name): (usize, String)| {
            let first = samples.first().map_or(0.0, |s| s.outputs[k]);
            let scale = if first.abs() > f64::MIN_POSITIVE { first.abs() } else { 1.0 };
            (name, samples.iter().map(|s| (s.outputs[k] - first) / scale).collect::<Vec<f64>>())
        };
        let lines: Vec<_> = range.zip(names.unwrap_or_default()).map(line).collect();
        for chunk in lines.chunks(plot::MAX_LINES) {
            let title = "Drift of the conserved quantities, relative to their values at the start".to_owned();
            conserved.panels.push(Panel { title, lines: chunk.to_vec(), ..Panel::default() });
        }
    }
    let start: Vec<String> =
        info.state.iter().zip(&request.initial).map(|(name, x)| format!("{name} = {x}")).collect();
    let text = format!(
        "<p>From <code>{}</code>.</p>\n{}",
        escape(&start.join(", ")),
        drawn(&state.title, plot::svg(&state))?
    );
    sections.push(("Motion".into(), text));
    if !conserved.panels.is_empty() {
        conserved.title = "What the motion keeps".into();
        conserved.subtitle =
            "energy at the steps; other quantities at samples between them, which are less exact than the steps".into();
        sections.push(("Conservation".into(), drawn(&conserved.title, plot::svg(&conserved))?));
    }
    if let Some(figure) = motion.precision.figure() {
        let text = format!(
            "<p>Relative tolerances from {:e} to {:e}, absolute ones a hundredth; <code>rk4</code> and the Gauss \
             methods take fixed steps. Errors below {:.1e}, the uncertainty of the reference, are not shown.</p>\n{}",
            TOLERANCES[0],
            TOLERANCES[TOLERANCES.len() - 1],
            motion.precision.floor,
            drawn(&figure.title, loglog::svg(&figure))?
        );
        sections.push(("Work and precision".into(), text));
    }
    Ok(())
}

fn drawn(title: &str, svg: Result<String, plot::DrawError>) -> Result<String, Error> {
    let text = svg.map_err(|e| Error::io("figure", std::io::Error::other(e.to_string())))?;
    // Inside a page an SVG has no declaration of its own.
    let text = text.find("<svg").map_or("", |at| &text[at..]);
    Ok(format!("<figure role=\"img\" aria-label=\"{}\">\n{text}</figure>\n", attribute(title)))
}

fn view_panel(page: &Page) -> String {
    let mut text = String::from(
        "<div class=\"viewer\">\n<canvas id=\"view\" width=\"1152\" height=\"580\" tabindex=\"0\" role=\"img\" \
         aria-label=\"The motion in space; arrow keys turn it\"></canvas>\n<div class=\"controls\">\n\
         <button id=\"play\" type=\"button\">Play</button>\n\
         <label>Time <input id=\"time\" type=\"range\" min=\"0\" max=\"1\" step=\"any\" value=\"0\"/></label>\n\
         <output id=\"clock\">0 s</output>\n\
         <label><input id=\"follow\" type=\"checkbox\"/> follow</label>\n</div>\n</div>\n\
         <p class=\"quiet\">Drag or use the arrow keys to turn, the wheel to zoom; the space bar plays.</p>\n",
    );
    let described: Vec<_> = page.views.iter().filter(|v| !v.doc.is_empty()).collect();
    if !described.is_empty() {
        text.push_str("<ul>\n");
        for view in described {
            let _ = writeln!(text, "<li><code>{}</code>: {}</li>", escape(&view.name), prose(&view.doc));
        }
        text.push_str("</ul>\n");
    }
    text
}

/// Data and the program that shows them.
fn script(id: &str, data: &str, program: &str) -> String {
    format!("<script type=\"application/json\" id=\"{id}\">{data}</script>\n<script>\n{program}</script>\n")
}

fn field_panel(fields: &[Field]) -> String {
    let mut text = String::from("<div class=\"fields\">\n");
    for (k, field) in fields.iter().enumerate() {
        let title = escape(&field.title);
        let _ = writeln!(
            text,
            "<figure><figcaption>{title}</figcaption><canvas class=\"field\" id=\"field{k}\" width=\"360\" \
             height=\"360\" role=\"img\" aria-label=\"{} over time\"></canvas>\
             <figcaption class=\"quiet\" id=\"scale{k}\"></figcaption></figure>",
            attribute(&field.title)
        );
    }
    text.push_str(
        "</div>\n<div class=\"controls\">\n<button id=\"field-play\" type=\"button\">Play</button>\n\
         <label>Time <input id=\"field-time\" type=\"range\" min=\"0\" max=\"1\" step=\"any\" value=\"0\"/></label>\n\
         <output id=\"field-clock\">0 s</output>\n</div>\n\
         <p class=\"quiet\">The torus: both coordinates go from 0 to 2&pi;, the second one upwards.</p>\n",
    );
    text
}

/// Waves and coefficients of all fields over time.
fn field_data(motion: &Motion) -> String {
    let list = |numbers: &mut dyn Iterator<Item = String>| numbers.collect::<Vec<String>>().join(",");
    let mut fields = Vec::new();
    for field in &motion.fields {
        // A page plays functions on the torus alone, which views are.
        let Surface::Torus { waves } = &field.surface else { continue };
        let waves = list(&mut waves.iter().map(|(a, b)| format!("[{a},{b}]")));
        let frames = list(
            &mut field
                .frames
                .iter()
                .map(|(_, c)| format!("[{}]", list(&mut c.iter().map(|x| significant(*x))))),
        );
        fields.push(format!("{{\"waves\":[{waves}],\"frames\":[{frames}]}}"));
    }
    format!(
        "{{\"t\":{},\"n\":{},\"fields\":[\n{}\n]}}",
        motion.request.t_final,
        motion.response.samples.len(),
        fields.join(",\n")
    )
}

/// A number to five digits, whatever its size.
fn significant(x: f64) -> String {
    if x == 0.0 { "0".to_owned() } else { format!("{x:.4e}") }
}

/// The numbers of all views over time, `null` never being among them; a number that stays the same is given once.
fn motion_data(page: &Page, motion: &Motion) -> String {
    let samples = &motion.response.samples;
    let mut views = Vec::new();
    for view in &page.views {
        let Some(range) = motion.info.output_range(&view.output) else { continue };
        let columns: Vec<String> = range
            .map(|k| {
                let column: Vec<String> = samples.iter().map(|s| short(s.outputs[k])).collect();
                match column.first() {
                    Some(first) if column.iter().all(|x| x == first) => first.clone(),
                    _ => format!("[{}]", column.join(",")),
                }
            })
            .collect();
        let kind = match view.kind {
            ViewKind::Box => "box",
            ViewKind::Disk => "disk",
            ViewKind::Ball => "ball",
            ViewKind::Segment => "segment",
            ViewKind::Point => "point",
            ViewKind::Path => "path",
        };
        views.push(format!(
            "{{\"name\":\"{}\",\"shape\":\"{kind}\",\"columns\":[{}]}}",
            view.name,
            columns.join(",")
        ));
    }
    format!(
        "{{\"t\":{},\"n\":{},\"views\":[\n{}\n]}}",
        motion.request.t_final,
        samples.len(),
        views.join(",\n")
    )
}

/// A number to about a hundred-thousandth, which no pixel shows.
fn short(x: f64) -> String {
    let digits = if x == 0.0 { 0.0 } else { x.abs().log10().floor() };
    let text = format!("{:.*}", (5.0 - digits.max(0.0)).clamp(0.0, 5.0) as usize, x);
    match text.contains('.') {
        true => {
            let text = text.trim_end_matches('0').trim_end_matches('.');
            if text == "-0" { "0".to_owned() } else { text.to_owned() }
        }
        false => text,
    }
}

/// Text as content of an element.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Text as the value of an attribute.
fn attribute(text: &str) -> String {
    escape(text).replace('"', "&quot;")
}

/// Documentation, whose code stands in backticks.
fn prose(text: &str) -> String {
    let pieces: Vec<String> = text
        .split('`')
        .enumerate()
        .map(|(k, piece)| match k % 2 {
            1 => format!("<code>{}</code>", escape(piece)),
            _ => escape(piece),
        })
        .collect();
    pieces.concat()
}

const RUST: &[&str] = &[
    "pub", "fn", "let", "impl", "struct", "for", "if", "else", "match", "return", "self", "Self", "const",
    "use", "where", "mut", "type", "mod", "crate",
];

/// Code with its comments, strings, numbers and keywords marked.
fn highlight(code: &str, keywords: &[&str]) -> String {
    let mut html = String::with_capacity(2 * code.len());
    let mut rest = code;
    while let Some(first) = rest.chars().next() {
        let run = |accepts: fn(char) -> bool| rest.find(|c| !accepts(c)).unwrap_or(rest.len());
        let (length, class) = if rest.starts_with("//") {
            (rest.find('\n').unwrap_or(rest.len()), "c")
        } else if rest.starts_with("/*") {
            (rest.find("*/").map_or(rest.len(), |at| at + 2), "c")
        } else if first == '"' {
            (rest[1..].find('"').map_or(rest.len(), |at| at + 2), "s")
        } else if first.is_ascii_digit() {
            (run(|c| c.is_ascii_alphanumeric() || c == '.' || c == '_'), "n")
        } else if first.is_alphabetic() || first == '_' {
            let length = run(|c| c.is_alphanumeric() || c == '_');
            (length, if keywords.contains(&&rest[..length]) { "k" } else { "" })
        } else {
            (first.len_utf8(), "")
        };
        let (token, tail) = rest.split_at(length);
        let token = escape(token);
        html.push_str(&if class.is_empty() {
            token
        } else {
            format!("<span class=\"{class}\">{token}</span>")
        });
        rest = tail;
    }
    html
}

#[cfg(test)]
mod tests {
    use super::{highlight, prose, short};

    #[test]
    fn code_is_escaped_and_marked() {
        let html = highlight("let a = x < 2.5; // \"no\" & let", &["let"]);
        assert_eq!(
            html,
            "<span class=\"k\">let</span> a = x &lt; <span class=\"n\">2.5</span>; \
             <span class=\"c\">// \"no\" &amp; let</span>"
        );
        assert_eq!(highlight("\"é", &[]), "<span class=\"s\">\"é</span>");
        assert_eq!(prose("a `b < c`"), "a <code>b &lt; c</code>");
    }

    #[test]
    fn short_numbers_keep_five_digits() {
        for (x, text) in
            [(0.0, "0"), (-1e-9, "0"), (0.123456, "0.12346"), (-12.5, "-12.5"), (1234567.8, "1234568")]
        {
            assert_eq!(short(x), text);
        }
    }
}
