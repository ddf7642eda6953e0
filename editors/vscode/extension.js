// Starts `hamel lsp` for model files and stops it. Everything else is the server's.
const { window, workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

async function activate() {
  const command = workspace.getConfiguration("hamel").get("path") || "hamel";
  const server = { command, args: ["lsp"] };
  client = new LanguageClient("hamel", "hamel", server, { documentSelector: [{ language: "hamel" }] });
  try {
    await client.start();
  } catch (error) {
    client = undefined;
    const cure = "install it (cargo install --path cli, in a clone of hamel), or set hamel.path";
    window.showErrorMessage(`${command} lsp could not be started (${error.message ?? error}): ${cure}`);
  }
}

function deactivate() {
  return client ? client.stop() : undefined;
}

module.exports = { activate, deactivate };
