// Runs the program `hamel`, compiled for WASI, once for each message, in a folder that exists in memory only.
//
// Does not know: the page, what a command does.

import { File, OpenFile, PreopenDirectory, WASI } from "./wasi/index.js";

const compiled = fetch("hamel.wasm").then(async (response) => {
  if (!response.ok) {
    throw new Error(`hamel.wasm: ${response.status} ${response.statusText}`);
  }
  return WebAssembly.compile(await response.arrayBuffer());
});

compiled.then(
  () => postMessage({ ready: true }),
  (error) => postMessage({ ready: false, stderr: String(error) }),
);

// What reading a link says of a file that is none; the shim says that it reads no links, which ends looking for a file.
const NO_LINK = 28;

const decoded = (file) => new TextDecoder().decode(file.data);

onmessage = async ({ data: { id, words, files } }) => {
  const start = performance.now();
  const entries = Object.entries(files).map(([name, text]) => [name, new File(new TextEncoder().encode(text))]);
  const folder = new PreopenDirectory("/", new Map(entries));
  folder.path_readlink = () => ({ ret: NO_LINK, data: null });
  const [input, output, errors] = [0, 1, 2].map(() => new OpenFile(new File([])));
  const wasi = new WASI(["hamel", ...words], ["NO_COLOR=1"], [input, output, errors, folder]);
  let code;
  let trap = "";
  try {
    const instance = await WebAssembly.instantiate(await compiled, { wasi_snapshot_preview1: wasi.wasiImport });
    code = wasi.start(instance);
  } catch (error) {
    code = 101;
    trap = `\nthe program ended: ${error}`;
  }
  const written = {};
  for (const [name, entry] of folder.dir.contents) {
    if (entry instanceof File && !(name in files)) {
      written[name] = decoded(entry);
    }
  }
  const stderr = decoded(errors.file) + trap;
  postMessage({ id, code, stdout: decoded(output.file), stderr, files: written, ms: performance.now() - start });
};
