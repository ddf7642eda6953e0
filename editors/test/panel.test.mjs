// What the panels of the extension show, by the program itself: at HAMEL, or in target/release or target/debug.
//
// Needs neither VS Code nor a browser: the extension runs with a stand-in for both.

import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { mkdtemp, rm, writeFile } from "node:fs/promises";
import { createRequire } from "node:module";
import Module from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";

const ROOT = fileURLToPath(new URL("../..", import.meta.url));
const BUILT = ["release", "debug"].map((kind) => join(ROOT, "target", kind, "hamel"));
const HAMEL = process.env.HAMEL ?? BUILT.find(existsSync) ?? "hamel";
const require = createRequire(import.meta.url);

const MODEL = `/// Pendulum
model pendulum {
    param k = 2 where k > 0;
    coordinate theta in angle;
    lagrangian = theta_dot^2/2 + k*cos(theta);
    initial theta = 1;
    initial theta_dot = 0;
    scene heavy { fix k = 5; }
}
`;

let folder, file;
const [commands, panels, told] = [new Map(), [], []];
const document = { isUntitled: false, isDirty: false, save: async () => true };

// What the extension asks of VS Code.
const vscode = {
  ProgressLocation: { Window: 10 },
  ViewColumn: { Beside: -2 },
  Uri: { parse: (address) => ({ fsPath: fileURLToPath(address), toString: () => address }) },
  commands: { registerCommand: (name, run) => (commands.set(name, run), { dispose() {} }) },
  window: {
    activeTextEditor: undefined,
    showErrorMessage: (text) => void told.push(text),
    withProgress: (_, run) => run(),
    createWebviewPanel: (kind, title, column, options) => {
      const panel = { kind, title, options, webview: { html: "" }, onDidDispose() {}, reveal() {} };
      panels.push(panel);
      return panel;
    },
  },
  workspace: {
    getConfiguration: () => ({ get: () => HAMEL }),
    openTextDocument: async () => document,
  },
};
let options;
class LanguageClient {
  constructor(id, name, server, asked) {
    options = { server, asked };
  }
  async start() {}
  stop() {}
}

before(async () => {
  folder = await mkdtemp(join(tmpdir(), "hamel-panel-"));
  file = join(folder, "pendulum.hamel");
  await writeFile(file, MODEL);
  const load = Module._load;
  Module._load = (name, ...rest) => {
    if (name === "vscode") return vscode;
    if (name === "vscode-languageclient/node") return { LanguageClient };
    return load(name, ...rest);
  };
  await require("../vscode/extension.js").activate({ subscriptions: [] });
});

after(() => rm(folder, { recursive: true, force: true }));

const show = async (command, scene = "default") => {
  await commands.get("hamel.show")(command, pathToFileURL(file).href, scene);
  return panels.at(-1);
};

test("the server is told that there is a panel", () => {
  assert.deepEqual(options.server.args, ["lsp"]);
  assert.equal(options.asked.initializationOptions.panel, true);
});

test("a motion, its equations and a report are shown beside the model", async () => {
  const motion = await show("simulate");
  assert.match(motion.webview.html, /<svg/);
  assert.equal(motion.title, "pendulum: motion");
  const equations = await show("explain", "heavy");
  assert.match(equations.webview.html, /<pre>[^]*theta|θ/);
  assert.equal(equations.title, "pendulum, heavy: equations");
  const report = await show("report");
  assert.match(report.webview.html, /<!DOCTYPE html>/i);
  assert.equal(report.options.enableScripts, true);
  assert.equal(motion.options.enableScripts, false);
});

test("a second time the same panel is used", async () => {
  const n = panels.length;
  await show("simulate");
  assert.equal(panels.length, n);
});

test("errors of a model are shown as the program tells them", async () => {
  await writeFile(file, MODEL.replace("cos(theta)", "cos(thta)"));
  const panel = await show("explain");
  assert.match(panel.webview.html, /did you mean `theta`/);
  assert.match(panel.webview.html, /--&gt;/);
  await writeFile(file, MODEL);
});

test("a text that no file has is not shown", async () => {
  Object.assign(document, { isDirty: true, save: async () => false });
  await show("report");
  assert.match(told.at(-1), /save pendulum.hamel first/);
  Object.assign(document, { isDirty: false });
});
