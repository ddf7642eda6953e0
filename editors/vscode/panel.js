// What a panel shows of a model: the arguments of the program, and the page that its answer makes. Knows nothing of VS
// Code, so that a test can run it.
const FORMS = {
  simulate: { ending: "svg", title: "motion" },
  explain: { ending: "txt", title: "equations" },
  report: { ending: "html", title: "report" },
};

/** The call of the program: `hamel simulate FILE --scene S -o OUT` and the like; `explain` answers by itself. */
function words(command, file, scene, out) {
  if (!FORMS[command]) throw new Error(`${command} is none of ${Object.keys(FORMS).join(", ")}`);
  const asked = [command, file, "--scene", scene];
  return command === "explain" ? asked : [...asked, "-o", out];
}

/** The file that the program writes, in a folder. */
function target(command) {
  return `${command}.${FORMS[command].ending}`;
}

const escaped = (text) => text.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

/** The page of an answer: a report is one, a figure stands on a white ground, a text as it is. */
function page(command, answer) {
  if (command === "report") return answer;
  const body =
    command === "simulate" ? `<div style="background: white">${answer}</div>` : `<pre>${escaped(answer)}</pre>`;
  return `<!DOCTYPE html><html><head><meta charset="utf-8"></head><body>${body}</body></html>`;
}

/** The page of a message of the program, which tells what to change. */
function refusal(message) {
  return page("explain", message);
}

/** The title of the panel. */
function title(command, model, scene) {
  const of = scene === "default" ? model : `${model}, ${scene}`;
  return `${of}: ${FORMS[command].title}`;
}

module.exports = { words, target, page, refusal, title };
