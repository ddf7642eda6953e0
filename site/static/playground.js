// The page on which a model is typed: its buttons are commands of `hamel`, which runs in a worker.
//
// Does not know: the model language, how the program runs.

const element = (id) => document.getElementById(id);
const [model, text, answer, state, stop] = ["model", "text", "answer", "state", "stop"].map(element);
const buttons = [...document.querySelectorAll("[data-command]")];
const KEPT = "hamel-model";

// Words of the command line, and the file whose contents are the answer; nothing where the answer is what it prints.
const commands = {
  simulate: { words: (t) => ["simulate", "model.hamel", "--t-final", t, "-o", "motion.svg"], file: "motion.svg" },
  report: { words: (t) => ["report", "model.hamel", "--t-final", t, "-o", "report.html"], file: "report.html" },
  explain: { words: () => ["explain", "model.hamel"] },
  generate: { words: () => ["generate", "model.hamel", "--out-dir", "."], file: /\.rs$/ },
  check: { words: () => ["check", "model.hamel", "--derive"] },
};

let worker;
let running;
let next = 0;

function pre(content, wrong) {
  const shown = document.createElement("pre");
  shown.textContent = content;
  shown.classList.toggle("wrong", wrong);
  return shown;
}

function picture(svg) {
  const shown = new Image();
  shown.alt = "Components of the state over time";
  shown.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  return shown;
}

function page(html) {
  const shown = document.createElement("iframe");
  shown.title = "Report";
  // What the page of a report does needs scripts, and nothing of this page.
  shown.sandbox = "allow-scripts";
  shown.srcdoc = html;
  return shown;
}

function shown(name, content) {
  return name.endsWith(".svg") ? picture(content) : name.endsWith(".html") ? page(content) : pre(content, false);
}

function show({ code, stdout, stderr, files, ms }) {
  const { command } = running;
  running = undefined;
  const wanted = commands[command].file;
  const found = wanted && Object.keys(files).filter((name) => (wanted.test ? wanted.test(name) : wanted === name));
  const parts = found?.map((name) => shown(name, files[name])) ?? [];
  if (stdout.trim()) {
    parts.push(pre(stdout, false));
  }
  if (stderr.trim()) {
    parts.push(pre(stderr, code !== 0));
  }
  answer.replaceChildren(...parts);
  answer.dataset.code = code;
  state.textContent = `${command}: ${(ms / 1000).toFixed(2)} s`;
  enable();
}

function enable() {
  for (const button of buttons) {
    button.disabled = running !== undefined;
  }
  stop.disabled = running === undefined;
}

function started() {
  const fresh = new Worker("worker.js", { type: "module" });
  fresh.onmessage = ({ data }) => {
    if (data.ready === true && running === undefined) {
      state.textContent = "ready";
      document.body.dataset.ready = "true";
    } else if (data.ready === false) {
      state.textContent = "the program could not be loaded";
      answer.replaceChildren(pre(data.stderr, true));
    } else if (data.id === running?.id) {
      show(data);
    }
  };
  return fresh;
}

function run(command) {
  delete answer.dataset.code;
  running = { id: next, command };
  next += 1;
  state.textContent = `${command} ..`;
  enable();
  const words = commands[command].words(element("t_final").value);
  worker.postMessage({ id: running.id, words, files: { "model.hamel": text.value } });
}

async function load(name) {
  const response = await fetch(`models/${name}.hamel`);
  if (response.ok) {
    text.value = await response.text();
    model.value = name;
    answer.replaceChildren();
    history.replaceState(null, "", `#${name}`);
  }
}

function fromAddress() {
  const name = decodeURIComponent(location.hash.slice(1));
  return [...model.options].some((option) => option.value === name) ? name : undefined;
}

for (const button of buttons) {
  button.addEventListener("click", () => run(button.dataset.command));
}
stop.addEventListener("click", () => {
  worker.terminate();
  running = undefined;
  worker = started();
  state.textContent = "stopped";
  enable();
});
model.addEventListener("change", () => load(model.value));
window.addEventListener("hashchange", () => fromAddress() && load(fromAddress()));
text.addEventListener("input", () => localStorage.setItem(KEPT, text.value));
text.addEventListener("keydown", (event) => {
  if (event.key === "Enter" && (event.ctrlKey || event.metaKey) && running === undefined) {
    run("simulate");
  }
});

worker = started();
const names = await (await fetch("models/index.json")).json();
model.replaceChildren(...names.map((name) => new Option(name, name)));
const kept = localStorage.getItem(KEPT);
if (fromAddress() || kept === null) {
  await load(fromAddress() ?? "heavy_top");
} else {
  model.value = "";
  text.value = kept;
}
