// Starts `hamel lsp` for model files and stops it. Everything else is the server's.
const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

function activate() {
  const command = workspace.getConfiguration("hamel").get("path") || "hamel";
  const server = { command, args: ["lsp"] };
  client = new LanguageClient("hamel", "hamel", server, { documentSelector: [{ language: "hamel" }] });
  return client.start();
}

function deactivate() {
  return client ? client.stop() : undefined;
}

module.exports = { activate, deactivate };
