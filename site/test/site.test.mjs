// The site in headless Chromium: every button of the playground, wrong models, and the pages.
//
// Needs a site (cargo xtask site --no-book heavy_top euler_disk) in target/site, or in the folder SITE, and Chromium, at
// CHROMIUM or under a usual name.

import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const SITE = process.env.SITE ?? fileURLToPath(new URL("../../target/site", import.meta.url));
const USUAL = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
const BROWSER = process.env.CHROMIUM ?? USUAL.find(existsSync);
const TYPES = {
  ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json",
  ".wasm": "application/wasm", ".hamel": "text/plain",
};
// Deriving in WebAssembly on a loaded machine.
const PATIENCE = 120_000;

const LOOP = `model crank {
  coordinate theta in angle;
  coordinate phi in angle by sin(theta) + 3*sin(phi) = 0;
  lagrangian = theta_dot^2 + phi_dot^2;
  initial theta = pi/6; initial phi = 0; initial theta_dot = 1;
}`;

let server;
let browser;
let page;
const errors = [];

before(async () => {
  server = createServer(async (request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, "http://localhost").pathname));
    try {
      const content = await readFile(join(SITE, path));
      response.writeHead(200, { "Content-Type": TYPES[extname(path)] ?? "application/octet-stream" }).end(content);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  browser = await chromium.launch({ executablePath: BROWSER, args: ["--no-sandbox"] });
  page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  page.setDefaultTimeout(PATIENCE);
  page.on("pageerror", (error) => errors.push(String(error)));
  await page.goto(address("playground.html#heavy_top"));
  await page.waitForSelector("body[data-ready]", { state: "attached" });
});

after(async () => {
  await browser?.close();
  server?.close();
});

const address = (path) => `http://127.0.0.1:${server.address().port}/${path}`;

async function press(command) {
  await page.click(`[data-command=${command}]`);
  await page.waitForSelector("#answer[data-code]", { state: "attached" });
  return Number(await page.getAttribute("#answer", "data-code"));
}

test("the model of the address is in the editor", async () => {
  assert.match(await page.inputValue("#text"), /model heavy_top/);
});

test("a motion is drawn", async () => {
  assert.equal(await press("simulate"), 0, await page.textContent("#answer"));
  const [width, height] = await page.$eval("#answer img", async (image) => {
    await image.decode();
    return [image.naturalWidth, image.naturalHeight];
  });
  assert.ok(width > 100 && height > 100, `${width} by ${height}`);
});

test("equations, code and checks are text", async () => {
  assert.equal(await press("explain"), 0);
  assert.match(await page.textContent("#answer"), /Omega1/);
  assert.equal(await press("generate"), 0);
  assert.match(await page.textContent("#answer"), /pub fn rhs/);
  assert.equal(await press("check"), 0);
});

test("a report moves in a frame of its own", async () => {
  assert.equal(await press("report"), 0);
  const frame = page.frames().find((frame) => frame !== page.mainFrame());
  await frame.waitForSelector("math");
  assert.ok((await frame.$$("canvas, svg")).length > 0);
});

test("a wrong model gets its error, and a repaired one works again", async () => {
  const text = await page.inputValue("#text");
  await page.fill("#text", text.replace("dot(Omega, I*Omega)", "dot(Omega, J*Omega)"));
  assert.equal(await press("simulate"), 2);
  assert.match(await page.textContent("#answer .wrong"), /J/);
  await page.fill("#text", text);
  assert.equal(await press("check"), 0);
});

test("a command can be stopped", async () => {
  await page.click("[data-command=report]");
  await page.click("#stop");
  assert.equal(await page.textContent("#state"), "stopped");
  assert.equal(await press("check"), 0);
});

test("the front page leads to pages of models and to the playground", async () => {
  const front = await browser.newPage();
  await front.goto(address("index.html"));
  const links = await front.$$eval(".models a", (found) => found.map((link) => link.getAttribute("href")));
  assert.ok(links.includes("pages/heavy_top.html"), links.join(" "));
  for (const link of links) {
    assert.equal((await front.goto(address(link))).status(), 200, link);
  }
  await front.close();
});

test("a closed loop begins where its equations are met", async () => {
  await page.fill("#text", LOOP);
  assert.equal(await press("simulate"), 0, await page.textContent("#answer"));
  // sin(phi) = -sin(pi/6)/3, which the guess 0 is not.
  assert.match(await page.textContent("#answer"), /phi\s+-0\.16744/);
});

test("the book is there, with its pages", { skip: !existsSync(join(SITE, "book")) }, async () => {
  const book = await browser.newPage();
  await book.goto(address("book/index.html"));
  const pages = await book.$$eval("a[href$='.html']", (found) => found.map((link) => new URL(link.href).pathname));
  assert.ok(pages.some((path) => path.endsWith("book/start.html")), pages.join(" "));
  for (const path of new Set(pages)) {
    assert.equal((await book.goto(address(path.slice(1)))).status(), 200, path);
    const images = await book.$$eval("img", (found) => found.map((image) => [image.src, image.naturalWidth]));
    assert.deepEqual(images.filter(([, width]) => width === 0), [], path);
  }
  await book.close();
});

test("no page had an error", () => {
  assert.deepEqual(errors, []);
});
