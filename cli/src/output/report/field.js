"use strict";
// Draws functions on the torus over time, each as a sum of its waves: f = 2 sum (re cos m.x - im sin m.x).
(() => {
  const data = JSON.parse(document.getElementById("field-data").textContent);
  const slider = document.getElementById("field-time");
  const clock = document.getElementById("field-clock");
  const button = document.getElementById("field-play");
  const last = data.n - 1;
  // Cells along a side; more of them show nothing of so few waves.
  const N = 120;
  const WHITE = [255, 255, 255];
  const LOW = [WHITE, [0, 114, 178], [0, 36, 74]], HIGH = [WHITE, [213, 94, 0], [94, 26, 0]];
  // The colours of figures: the middle one stands at six tenths.
  const BEND = 0.6;
  const channel = (part, c) => {
    const [white, middle, end] = part < 0 ? LOW : HIGH, size = Math.abs(part);
    const [from, to, rest] = size < BEND ? [white, middle, size / BEND] : [middle, end, (size - BEND) / (1 - BEND)];
    return from[c] + (to[c] - from[c]) * rest;
  };
  const angles = Array.from({ length: N }, (_, k) => (2 * Math.PI * (k + 0.5)) / N);

  const valuesAt = (field, frame) => {
    const values = new Float64Array(N * N);
    field.waves.forEach(([a, b], k) => {
      const [re, im] = [field.frames[frame][2 * k], field.frames[frame][2 * k + 1]];
      // cos(m.x) and sin(m.x) of the two coordinates apart, so that no cell needs a function.
      const [ca, sa] = [angles.map((x) => Math.cos(a * x)), angles.map((x) => Math.sin(a * x))];
      angles.forEach((y, j) => {
        const [cb, sb] = [Math.cos(b * y), Math.sin(b * y)];
        const [p, q] = [2 * (re * cb - im * sb), -2 * (re * sb + im * cb)];
        for (let i = 0; i < N; i++) values[j * N + i] += p * ca[i] + q * sa[i];
      });
    });
    return values;
  };
  const largest = (values) => values.reduce((max, x) => Math.max(max, Math.abs(x)), 0);
  // One scale over the whole time.
  const fields = data.fields.map((field, k) => {
    let limit = 0;
    for (let frame = 0; frame <= last; frame += Math.max(1, Math.floor(last / 12))) limit = Math.max(limit, largest(valuesAt(field, frame)));
    document.getElementById(`scale${k}`).textContent = `from \u2212${limit.toPrecision(3)} (blue) to ${limit.toPrecision(3)} (orange)`;
    const canvas = document.getElementById(`field${k}`);
    const small = document.createElement("canvas");
    small.width = small.height = N;
    return { field, canvas, small, limit: limit || 1 };
  });

  let frame = 0, playing = false, before = 0;
  const draw = () => {
    for (const { field, canvas, small, limit } of fields) {
      const values = valuesAt(field, frame), pen = small.getContext("2d"), image = pen.createImageData(N, N);
      for (let j = 0; j < N; j++) {
        for (let i = 0; i < N; i++) {
          const part = Math.max(-1, Math.min(1, values[j * N + i] / limit));
          const at = 4 * ((N - 1 - j) * N + i);
          for (let c = 0; c < 3; c++) image.data[at + c] = channel(part, c);
          image.data[at + 3] = 255;
        }
      }
      pen.putImageData(image, 0, 0);
      canvas.getContext("2d").drawImage(small, 0, 0, canvas.width, canvas.height);
    }
    clock.textContent = `${((data.t * frame) / last).toFixed(2)} s`;
    slider.value = frame / last;
  };
  const tick = (now) => {
    if (!playing) return;
    // The whole motion takes ten seconds.
    const step = Math.floor(((now - before) / 1e4) * last);
    if (step > 0) {
      before = now;
      frame = frame + step > last ? 0 : frame + step;
      draw();
    }
    requestAnimationFrame(tick);
  };
  button.addEventListener("click", () => {
    playing = !playing;
    button.textContent = playing ? "Pause" : "Play";
    before = performance.now();
    if (playing) requestAnimationFrame(tick);
  });
  slider.addEventListener("input", () => { frame = Math.round(slider.value * last); draw(); });
  draw();
})();
