//! `lsp`: a conversation with the program over its standard input and output, and what editors are given beside it.

use crate::common::program;

use std::collections::BTreeSet;
use std::io::{BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::time::{Duration, Instant};

use hamel_codegen::spec::{WordKind, vocabulary};
use lsp_server::{Message, Notification, Request, Response};
use serde_json::{Value, json};

/// An editor with one file.
struct Editor {
    program: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    n_requests: i32,
    /// What the server has said without being asked.
    said: Vec<Notification>,
}

const URI: &str = "file:///models/rod.hamel";

impl Editor {
    fn start() -> Editor {
        Editor::start_with(json!({ "capabilities": {} }))
    }

    fn start_with(options: Value) -> Editor {
        let mut command = program::command(&["lsp"]);
        let mut program = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let input = program.stdin.take();
        let output = BufReader::new(program.stdout.take().unwrap());
        let mut editor = Editor { program, input, output, n_requests: 0, said: Vec::new() };
        let has_panel = options["initializationOptions"]["panel"] == true;
        let answer = editor.ask("initialize", options);
        assert_eq!(answer["serverInfo"]["name"], "hamel");
        // Whose editor shows nothing for a command is offered none.
        assert_eq!(answer["capabilities"].get("codeLensProvider").is_some(), has_panel, "{answer}");
        assert_eq!(answer["capabilities"]["hoverProvider"], true);
        editor.tell("initialized", json!({}));
        editor
    }

    fn send(&mut self, message: Message) {
        let input = self.input.as_mut().unwrap();
        message.write(input).unwrap();
        input.flush().unwrap();
    }

    fn tell(&mut self, method: &str, params: Value) {
        self.send(Notification::new(method.to_owned(), params).into());
    }

    fn receive(&mut self) -> Message {
        Message::read(&mut self.output).unwrap().expect("the server has more to say")
    }

    fn response(&mut self, method: &str, params: Value) -> Response {
        self.n_requests += 1;
        let id = self.n_requests.into();
        self.send(Request::new(id, method.to_owned(), params).into());
        loop {
            match self.receive() {
                Message::Response(response) => return response,
                Message::Notification(notification) => self.said.push(notification),
                Message::Request(request) => panic!("{request:?}"),
            }
        }
    }

    fn ask(&mut self, method: &str, params: Value) -> Value {
        let response = self.response(method, params);
        serde_json::to_value(response).unwrap()["result"].clone()
    }

    /// The problems of a version of the file.
    fn problems(&mut self, version: i32) -> Value {
        loop {
            let found = self.said.iter().position(|n| n.params["version"] == version);
            if let Some(at) = found {
                return self.said.remove(at).params["diagnostics"].clone();
            }
            match self.receive() {
                Message::Notification(notification) => self.said.push(notification),
                other => panic!("{other:?}"),
            }
        }
    }

    fn open(&mut self, text: &str) -> Value {
        let document = json!({ "uri": URI, "languageId": "hamel", "version": 1, "text": text });
        self.tell("textDocument/didOpen", json!({ "textDocument": document }));
        self.problems(1)
    }

    fn at(text: &str, word: &str) -> Value {
        let before = &text[..text.find(word).unwrap()];
        let line = before.matches('\n').count();
        let column = before.rsplit('\n').next().unwrap().encode_utf16().count();
        json!({ "textDocument": { "uri": URI }, "position": { "line": line, "character": column } })
    }
}

impl Drop for Editor {
    fn drop(&mut self) {
        // Only where a test has failed before the end of the conversation.
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

const ROD: &str = "/// Rod
model rod {
    /// Ω and 🌀 count in UTF-16.
    param l = 2 where l > 0; /* 🌀 */ param stiffness = 3;
    /// Angle [rad].
    coordinate phi in angle;
    lagrangian = l*phi_dot^2/2 - stiffness*cos(phi);
    output height = l*cos(phi);
}
";

#[test]
fn an_editor_talks_with_the_program() {
    let mut editor = Editor::start();
    // A name is misspelt behind characters of two units and of several bytes.
    let wrong = ROD.replace("param stiffness = 3;", "param stiffness = 3; output q = 2*stifness;");
    let problems = editor.open(&wrong);
    let problem = &problems[0];
    let message = problem["message"].as_str().unwrap();
    assert!(message.starts_with("unknown name `stifness`\n"), "{message}");
    assert!(message.contains("did you mean `stiffness`?"), "{message}");
    let place = Editor::at(&wrong, "stifness");
    assert_eq!(problem["range"]["start"], place["position"]);
    assert_eq!((&problem["severity"], &problem["source"]), (&1.into(), &"hamel".into()));

    // The help is a repair by one key.
    let actions = editor.ask(
        "textDocument/codeAction",
        json!({ "textDocument": { "uri": URI }, "range": problem["range"], "context": { "diagnostics": [] } }),
    );
    assert_eq!(actions[0]["title"], "Replace `stifness` by `stiffness`");
    let edit = &actions[0]["edit"]["changes"][URI][0];
    assert_eq!((&edit["newText"], &edit["range"]), (&"stiffness".into(), &problem["range"]));

    // Applied, as an editor tells it: a part of the text is replaced.
    editor.tell(
        "textDocument/didChange",
        json!({
            "textDocument": { "uri": URI, "version": 2 },
            "contentChanges": [{ "range": edit["range"], "text": edit["newText"] }],
        }),
    );
    assert_eq!(editor.problems(2), json!([]));
    let text = wrong.replace("stifness", "stiffness");

    let hover = editor.ask("textDocument/hover", Editor::at(&text, "phi_dot"));
    let shown = hover["contents"]["value"].as_str().unwrap();
    assert!(shown.contains("rate of the coordinate `phi_dot` [rad/s]"), "{shown}");
    assert_eq!(hover["range"]["start"], Editor::at(&text, "phi_dot")["position"]);
    let hover = editor.ask("textDocument/hover", Editor::at(&text, "lagrangian"));
    assert!(hover["contents"]["value"].as_str().unwrap().contains("The reduced Lagrangian"), "{hover}");
    assert_eq!(editor.ask("textDocument/hover", Editor::at(&text, "= 3")), Value::Null);

    let proposals = editor.ask("textDocument/completion", Editor::at(&text, "stiffness*"));
    let labels: BTreeSet<&str> =
        proposals.as_array().unwrap().iter().map(|item| item["label"].as_str().unwrap()).collect();
    assert!(["phi", "phi_dot", "l", "stiffness", "cos"].iter().all(|label| labels.contains(label)));
    assert!(!labels.contains("height"), "{labels:?}");

    let definition = editor.ask("textDocument/definition", Editor::at(&text, "phi_dot"));
    assert_eq!(definition["range"]["start"], Editor::at(&text, "phi in")["position"]);
    let mut place = Editor::at(&text, "phi in");
    place["context"] = json!({ "includeDeclaration": true });
    assert_eq!(editor.ask("textDocument/references", place).as_array().unwrap().len(), 4);
    let mut place = Editor::at(&text, "l*phi_dot");
    place["newName"] = json!("length");
    let edits = editor.ask("textDocument/rename", place.clone());
    assert_eq!(edits["changes"][URI].as_array().unwrap().len(), 4);
    place["newName"] = json!("phi");
    let refused = editor.response("textDocument/rename", place);
    assert!(
        serde_json::to_value(refused).unwrap()["error"]["message"]
            .as_str()
            .unwrap()
            .contains("declared twice")
    );
    let symbols = editor.ask("textDocument/documentSymbol", json!({ "textDocument": { "uri": URI } }));
    let names: Vec<&str> =
        symbols[0]["children"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(
        (&symbols[0]["name"], names.as_slice()),
        (&"rod".into(), ["l", "stiffness", "q", "phi", "height"].as_slice())
    );
    let tokens = editor.ask("textDocument/semanticTokens/full", json!({ "textDocument": { "uri": URI } }));
    assert_eq!(tokens["data"].as_array().unwrap().len() % 5, 0);

    let options =
        json!({ "textDocument": { "uri": URI }, "options": { "tabSize": 8, "insertSpaces": false } });
    assert_eq!(editor.ask("textDocument/formatting", options.clone()), json!([]), "in form");
    let untidy = text.replace("    lagrangian = ", "lagrangian   =");
    editor.tell(
        "textDocument/didChange",
        json!({ "textDocument": { "uri": URI, "version": 3 }, "contentChanges": [{ "text": untidy }] }),
    );
    let edits = editor.ask("textDocument/formatting", options.clone());
    assert_eq!(edits[0]["newText"], text);
    editor.tell(
        "textDocument/didChange",
        json!({ "textDocument": { "uri": URI, "version": 4 }, "contentChanges": [{ "text": "model rod { param (" }] }),
    );
    assert_eq!(editor.ask("textDocument/formatting", options), Value::Null, "no model");
    let problems = editor.problems(4);
    assert!(problems[0]["message"].as_str().unwrap().contains("is not closed"), "{problems}");
    let proposals = editor.ask(
        "textDocument/completion",
        json!({ "textDocument": { "uri": URI }, "position": { "line": 0, "character": 12 } }),
    );
    assert!(proposals.as_array().unwrap().iter().any(|item| item["label"] == "param"));

    // What nobody knows is answered, what is no message of this kind as well.
    let unknown = editor.response("textDocument/foo", json!({}));
    assert_eq!(serde_json::to_value(unknown).unwrap()["error"]["code"], -32601);
    assert_eq!(editor.ask("textDocument/hover", json!({ "nonsense": 1 })), Value::Null);

    assert_eq!(editor.ask("shutdown", Value::Null), Value::Null);
    editor.tell("exit", Value::Null);
    assert!(editor.program.wait().unwrap().success());
}

/// The equation may come later than the rest of an answer; it comes in the end.
#[test]
fn a_velocity_is_shown_with_its_equation() {
    let mut editor = Editor::start();
    assert_eq!(editor.open(ROD), json!([]));
    for _ in 0..1000 {
        let hover = editor.ask("textDocument/hover", Editor::at(ROD, "phi_dot"));
        if hover["contents"]["value"].as_str().unwrap().contains("d/dt φ̇ = ") {
            return;
        }
    }
    panic!("the equation never came");
}

/// The text answers at once, also the second time, and the equation comes once it is there.
#[test]
fn a_place_answers_from_its_text_while_equations_are_derived() {
    let mut editor = Editor::start();
    let text = repository("models/shelf/rattleback.hamel");
    editor.open(&text);
    let mut shown = Vec::new();
    let clock = Instant::now();
    while clock.elapsed() < Duration::from_secs(120) {
        let asked = Instant::now();
        let hover = editor.ask("textDocument/hover", Editor::at(&text, "Omega, X in se(3)"));
        let told = hover["contents"]["value"].as_str().unwrap().to_owned();
        assert!(told.contains("Angular velocity") && told.contains("se(3), dimension 6"), "{told}");
        shown.push((asked.elapsed(), told.contains("being derived"), told.contains("d/dt")));
        if shown.last().is_some_and(|(_, _, has_equation)| *has_equation) {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let (_, is_deriving, has_equation) = *shown.last().unwrap();
    assert!(has_equation && !is_deriving, "{shown:?}");
    for (k, (took, is_deriving, has_equation)) in shown.iter().enumerate() {
        assert!(*is_deriving != *has_equation, "{shown:?}");
        // One answer waits a little; the others do not. A loaded machine is slow.
        assert!(*took < Duration::from_millis(1200), "{k}: {shown:?}");
    }
}

#[test]
fn functions_are_shown_while_their_arguments_are_written() {
    let mut editor = Editor::start();
    let text = "model m {\n    velocity Omega in so(3);\n    lagrangian = dot(Omega, cross([1, 2, 3], ";
    editor.open(text);
    let mut ask = |line: u32, character: u32| {
        editor.ask(
            "textDocument/signatureHelp",
            json!({ "textDocument": { "uri": URI }, "position": { "line": line, "character": character } }),
        )
    };
    let help = ask(2, 45);
    assert_eq!(help["signatures"][0]["label"], "cross(a, b)", "{help}");
    assert_eq!(help["signatures"][0]["documentation"]["value"], "product in R^3");
    assert_eq!(help["activeParameter"], 1);
    assert_eq!(ask(2, 38)["activeParameter"], 0, "within a vector");
    assert_eq!(ask(2, 22)["signatures"][0]["parameters"][0]["label"], "a");
    // An item is no call, nor is a name that is no function.
    assert_eq!(ask(1, 20), Value::Null);
    assert_eq!(ask(1, 26), Value::Null);
}

#[test]
fn bodies_and_comments_are_folded() {
    let mut editor = Editor::start();
    let text = "/// A rod\n/// of two lines\nmodel rod {\n    scene s {\n        want rhs;\n    }\n}\n";
    editor.open(text);
    let folds = editor.ask("textDocument/foldingRange", json!({ "textDocument": { "uri": URI } }));
    let of: Vec<(&Value, &Value, &Value)> = folds
        .as_array()
        .unwrap()
        .iter()
        .map(|fold| (&fold["startLine"], &fold["endLine"], &fold["kind"]))
        .collect();
    let expected = [(0, 1, json!("comment")), (2, 5, Value::Null), (3, 4, Value::Null)];
    let expected: Vec<(Value, Value, Value)> =
        expected.into_iter().map(|(from, to, kind)| (json!(from), json!(to), kind)).collect();
    assert_eq!(of, expected.iter().map(|(a, b, c)| (a, b, c)).collect::<Vec<_>>(), "{folds}");
}

/// The commands of an editor with a panel: three at the model, and at each scene.
#[test]
fn models_and_scenes_have_commands_for_a_panel() {
    let mut editor =
        Editor::start_with(json!({ "capabilities": {}, "initializationOptions": { "panel": true } }));
    let text = ROD.replace("lagrangian", "scene stiff { fix stiffness = 9; }\n    lagrangian");
    editor.open(&text);
    let lenses = editor.ask("textDocument/codeLens", json!({ "textDocument": { "uri": URI } }));
    let lenses = lenses.as_array().unwrap();
    let titles: Vec<&str> = lenses.iter().map(|l| l["command"]["title"].as_str().unwrap()).collect();
    assert_eq!(titles, ["simulate", "explain", "report", "simulate", "explain", "report"]);
    let last = lenses.iter().find(|lens| lens["command"]["arguments"][2] == "stiff").unwrap();
    assert_eq!(last["command"]["command"], "hamel.show");
    assert_eq!(last["command"]["arguments"], json!(["simulate", URI, "stiff"]));
    assert_eq!(last["range"]["start"], Editor::at(&text, "stiff {")["position"]);
    assert_eq!(lenses[0]["range"]["start"], Editor::at(&text, "rod {")["position"]);
    // The extension has the command.
    assert!(repository("editors/vscode/extension.js").contains("registerCommand(\"hamel.show\", show)"));
}

#[test]
fn an_editor_that_vanishes_is_told() {
    let mut editor = Editor::start();
    editor.input = None;
    assert_eq!(editor.program.wait().unwrap().code(), Some(1));
}

fn repository(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The grammar for colours has the words of the language, each in the group of its kind, and no others.
#[test]
fn grammar_has_every_keyword() {
    let grammar: Value =
        serde_json::from_str(&repository("editors/vscode/syntaxes/hamel.tmLanguage.json")).unwrap();
    let groups = [
        ("items", WordKind::Item),
        ("parts", WordKind::Part),
        ("functions", WordKind::Function),
        ("constants", WordKind::Constant),
        ("settings", WordKind::Setting),
    ];
    for (group, kind) in groups {
        let pattern = grammar["repository"][group]["match"].as_str().unwrap();
        let words = pattern.split_once("(?:").and_then(|(_, rest)| rest.split_once(')')).unwrap().0;
        let words: BTreeSet<&str> = words.split('|').collect();
        let known: BTreeSet<&str> =
            vocabulary().into_iter().filter(|word| word.kind == kind).map(|word| word.word).collect();
        assert_eq!(words, known, "{group}");
    }
}

#[test]
fn the_extension_starts_the_server() {
    let package: Value = serde_json::from_str(&repository("editors/vscode/package.json")).unwrap();
    assert_eq!(package["contributes"]["languages"][0]["extensions"][0], ".hamel");
    for file in [
        &package["main"],
        &package["contributes"]["grammars"][0]["path"],
        &package["contributes"]["languages"][0]["configuration"],
    ] {
        assert!(!repository(&format!("editors/vscode/{}", file.as_str().unwrap())).is_empty());
    }
    assert!(repository("editors/vscode/extension.js").contains("args: [\"lsp\"]"));
    let _: Value = serde_json::from_str(&repository("editors/vscode/language-configuration.json")).unwrap();
}

/// A length that no memory holds, and texts that are no messages, end the conversation with a reason.
#[test]
fn a_message_of_absurd_length_is_refused_and_not_made_room_for() {
    for (input, reason) in [
        ("Content-Length: 99999999999999\r\n\r\n{}", "a message has 99999999999999 bytes"),
        ("Content-Length: 2\r\n\r\n{}", "a message is malformed"),
        ("GET / HTTP/1.1\r\n\r\n", "is no line of a header"),
    ] {
        let out = program::output(&mut program::command(&["lsp"]), input);
        let told = String::from_utf8(out.stderr).unwrap();
        assert_eq!(out.status.code(), Some(1), "{told}");
        assert!(told.contains(reason), "{told}");
    }
}

/// Kilobytes that a process has in memory.
#[cfg(target_os = "linux")]
fn resident(id: u32) -> usize {
    let text = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

/// A file of 50 kB that is changed hundreds of times: its texts are not kept.
#[test]
#[cfg(target_os = "linux")]
fn a_long_session_does_not_grow() {
    let comments = "// a comment of a line that somebody has written about the model\n".repeat(800);
    let text = |k: usize| {
        format!(
            "{comments}model rod {{ param k = {k}; coordinate x in real; lagrangian = x_dot^2/2 - k*x^2; }}"
        )
    };
    let mut editor = Editor::start();
    editor.open(&text(1));
    let change = |editor: &mut Editor, version: i32| {
        let document = json!({ "uri": URI, "version": version });
        let changes = json!([{ "text": text(version as usize) }]);
        editor.tell("textDocument/didChange", json!({ "textDocument": document, "contentChanges": changes }));
        editor.problems(version);
    };
    (2..40).for_each(|version| change(&mut editor, version));
    let before = resident(editor.program.id());
    (40..340).for_each(|version| change(&mut editor, version));
    let grown = resident(editor.program.id()).saturating_sub(before);
    // Each text that is kept once is 50 kB: 15 MB.
    assert!(grown < 8_000, "{grown} kB more than {before} kB");
}
