// Starts `hamel lsp` for model files and stops it, and shows beside a model what the program makes of it. Everything
// else is the server's.
const { execFile } = require("node:child_process");
const { mkdtemp, readFile, rm } = require("node:fs/promises");
const { tmpdir } = require("node:os");
const { basename, dirname, join } = require("node:path");
const { ProgressLocation, Uri, ViewColumn, commands, window, workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");
const { page, refusal, target, title, words } = require("./panel");

let client;
const panels = new Map();

const program = () => workspace.getConfiguration("hamel").get("path") || "hamel";

async function activate(context) {
  context.subscriptions.push(
    commands.registerCommand("hamel.show", show),
    ...["simulate", "explain", "report"].map((command) =>
      commands.registerCommand(`hamel.${command}`, () => {
        const document = window.activeTextEditor?.document;
        return document?.languageId === "hamel" ? show(command, document.uri.toString(), "default") : undefined;
      }),
    ),
  );
  const command = program();
  const server = { command, args: ["lsp"] };
  client = new LanguageClient("hamel", "hamel", server, {
    documentSelector: [{ language: "hamel" }],
    initializationOptions: { panel: true },
  });
  try {
    await client.start();
  } catch (error) {
    client = undefined;
    const cure = "install it (cargo install --path cli, in a clone of hamel), or set hamel.path";
    window.showErrorMessage(`${command} lsp could not be started (${error.message ?? error}): ${cure}`);
  }
}

/** Shows what a command makes of a scene of a file, in a panel of its own. */
async function show(command, address, scene) {
  const uri = Uri.parse(address);
  const document = await workspace.openTextDocument(uri);
  if (document.isUntitled || (document.isDirty && !(await document.save()))) {
    return window.showErrorMessage(`save ${basename(uri.fsPath)} first: hamel ${command} reads the file`);
  }
  const model = basename(uri.fsPath, ".hamel");
  const name = title(command, model, scene);
  const answer = await window.withProgress({ location: ProgressLocation.Window, title: name }, () =>
    ask(command, uri.fsPath, scene),
  );
  let panel = panels.get(name);
  if (!panel) {
    panel = window.createWebviewPanel("hamel", name, ViewColumn.Beside, { enableScripts: command === "report" });
    panels.set(name, panel);
    panel.onDidDispose(() => panels.delete(name));
  }
  panel.webview.html = answer;
  panel.reveal(undefined, true);
}

/** The page of an answer of the program. */
async function ask(command, file, scene) {
  const folder = await mkdtemp(join(tmpdir(), "hamel-"));
  const out = join(folder, target(command));
  try {
    const told = await new Promise((resolve) => {
      const options = { cwd: dirname(file), maxBuffer: 1 << 28 };
      execFile(program(), words(command, file, scene, out), options, (error, stdout, stderr) =>
        resolve({ error, stdout, stderr }),
      );
    });
    if (told.error) return refusal(told.stderr || String(told.error.message));
    return page(command, command === "explain" ? told.stdout : await readFile(out, "utf8"));
  } finally {
    await rm(folder, { recursive: true, force: true });
  }
}

function deactivate() {
  return client ? client.stop() : undefined;
}

module.exports = { activate, deactivate };
