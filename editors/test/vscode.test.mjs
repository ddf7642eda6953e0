// The extension in VS Code, which a headless Chromium shows: colours, problems, hover, completion, definition, format.
//
// Needs ./server, which fetches VS Code to target/vscode (or to the folder VSCODE); the program, at HAMEL or in
// target/release; Chromium, at CHROMIUM or under a usual name. Pictures go to the folder SHOTS, if that is given.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync } from "node:fs";
import { mkdir, mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const ROOT = fileURLToPath(new URL("../..", import.meta.url));
const VSCODE = process.env.VSCODE ?? join(ROOT, "target/vscode");
const HAMEL = process.env.HAMEL ?? join(ROOT, "target/release/hamel");
const USUAL = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
const BROWSER = process.env.CHROMIUM ?? USUAL.find(existsSync);
// A loaded machine.
const PATIENCE = Number(process.env.PATIENCE ?? 120_000);

const TOP = await readFile(join(ROOT, "models/specs/heavy_top.hamel"), "utf8");
// Not in form, and with a name that nobody declares.
const WRONG = "model wrong {\n  param m=1;\n  coordinate x in real;\n  lagrangian = k*x_dot^2;\n}\n";

let server;
let browser;
let page;
let folder;
let address;

const shot = (name) => process.env.SHOTS && page.screenshot({ path: join(process.env.SHOTS, `${name}.png`) });

before(async () => {
  folder = await mkdtemp(join(tmpdir(), "hamel-vscode-"));
  await writeFile(join(folder, "top.hamel"), TOP);
  await writeFile(join(folder, "wrong.hamel"), WRONG);
  await settings(folder, HAMEL);
  const words = [
    join(VSCODE, "package/lib/vscode/out/server-main.js"), "--host", "127.0.0.1", "--port", "0",
    "--without-connection-token", "--accept-server-license-terms", "--server-data-dir", join(VSCODE, "data"),
    "--telemetry-level", "off",
  ];
  server = spawn(process.execPath, words);
  address = await new Promise((resolve, reject) => {
    let said = "";
    const listen = (bytes) => {
      said += bytes;
      const found = said.match(/Web UI available at (\S+)/);
      if (found) resolve(found[1]);
    };
    server.stdout.on("data", listen);
    server.stderr.on("data", listen);
    server.on("exit", (code) => reject(new Error(`the server ended with ${code}: ${said}`)));
  });
  browser = await chromium.launch({ executablePath: BROWSER, args: ["--no-sandbox"] });
  page = await show(folder);
}, { timeout: 2 * PATIENCE });

after(async () => {
  await browser?.close();
  server?.kill();
  await rm(folder, { recursive: true, force: true });
});

/** Says where the program is. */
async function settings(folder, program) {
  await mkdir(join(folder, ".vscode"));
  await writeFile(join(folder, ".vscode/settings.json"), JSON.stringify({ "hamel.path": program }));
}

/** Opens a folder in a page of its own. */
async function show(folder) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  page.setDefaultTimeout(PATIENCE);
  await page.goto(`${address}/?folder=${folder}`);
  await page.getByRole("button", { name: /Yes, I trust/ }).click();
  return page;
}

/** Opens a file of the folder, from the list at the side: search needs ripgrep, which npm does not have. */
async function open(name) {
  await page.locator(`.explorer-folders-view .monaco-list-row[aria-label^="${name}"]`).dblclick();
  await page.locator(`.tab.active[aria-label^="${name}"]`).waitFor();
}

/** The first place in the text where a word stands. */
const word = (text) => page.locator(".view-line span span", { hasText: new RegExp(`^\\s*${text}\\s*$`) }).first();

const colour = (found) => found.evaluate((element) => getComputedStyle(element).color);

test("words have colours by what they are", async () => {
  await open("top.hamel");
  const [comment, keyword, number] = await Promise.all([
    colour(page.locator(".view-line span span", { hasText: /^\/\/\// }).first()),
    colour(word("lagrangian")),
    colour(word("9.81")),
  ]);
  assert.equal(new Set([comment, keyword, number]).size, 3, `${comment}; ${keyword}; ${number}`);
  await shot("colours");
});

test("the server gives words the colours of what they stand for", async () => {
  // For the grammar a name is text like a semicolon.
  await page.waitForFunction(() => {
    const spans = [...document.querySelectorAll(".view-line span span")];
    const [name, text] = ["chi", ";"].map((word) => spans.find((span) => span.textContent.trim() === word));
    return name && text && getComputedStyle(name).color !== getComputedStyle(text).color;
  });
  assert.equal(await page.locator(".squiggly-error").count(), 0);
});

test("a velocity tells its algebra and its equation", async () => {
  await word("Omega").hover();
  const hover = page.locator(".monaco-hover-content", { hasText: "so(3)" });
  await hover.waitFor();
  const told = await hover.textContent();
  assert.match(told, /velocity/);
  assert.match(told, /\[e₁, e₂\] = e₃/);
  assert.match(told, /Ω₁/);
  await shot("hover");
  await page.keyboard.press("Escape");
});

test("a name leads to its declaration", async () => {
  await page.locator(".view-line span span", { hasText: /chi/ }).last().click();
  await page.keyboard.press("F12");
  await page.waitForFunction(() => {
    const line = document.querySelector(".current-line");
    const declared = [...document.querySelectorAll(".view-line")].find((l) => l.textContent.match(/param\schi/));
    return line && declared && Math.abs(line.getBoundingClientRect().top - declared.getBoundingClientRect().top) < 2;
  });
});

test("an unknown name is underlined, and says what it is", async () => {
  await open("wrong.hamel");
  await page.locator(".squiggly-error").first().waitFor();
  await word("k").hover();
  const hover = page.locator(".monaco-hover-content", { hasText: "unknown name" });
  await hover.waitFor();
  await shot("problem");
  await page.keyboard.press("Escape");
});

test("a repaired text has no problem, and is brought into form", async () => {
  await word("k").dblclick();
  await page.keyboard.type("m");
  await page.locator(".squiggly-error").first().waitFor({ state: "detached" });
  await page.keyboard.press("Control+Shift+i");
  await page.locator(".view-line", { hasText: /^\s{4}param\sm\s=\s1;/ }).waitFor();
  await shot("format");
});

test("completion knows what the place takes", async () => {
  await page.locator(".view-line", { hasText: /lagrangian/ }).click();
  await page.keyboard.press("End");
  await page.keyboard.press("Enter");
  await page.keyboard.type("adv");
  await page.keyboard.press("Control+Space");
  await page.locator(".suggest-widget .monaco-list-row", { hasText: "advected" }).first().waitFor();
  await shot("completion");
});

test("a program that is not there is told, with what to do", async () => {
  const other = join(folder, "other");
  await mkdir(other);
  await writeFile(join(other, "top.hamel"), TOP);
  await settings(other, "/nowhere/hamel");
  await page.close();
  page = await show(other);
  await open("top.hamel");
  const told = page.locator(".notification-toast", { hasText: "could not be started" });
  await told.waitFor();
  assert.match(await told.textContent(), /ENOENT.*hamel\.path/);
  await shot("missing");
});
