"use strict";
// Draws the views over time on a canvas: faces are sorted from back to front, nothing else is needed.
(() => {
  const motion = JSON.parse(document.getElementById("motion-data").textContent);
  const canvas = document.getElementById("view");
  const pen = canvas.getContext("2d");
  const slider = document.getElementById("time");
  const clock = document.getElementById("clock");
  const button = document.getElementById("play");
  const follow = document.getElementById("follow");
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const last = motion.n - 1;
  const COLOURS = [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [86, 180, 233], [150, 105, 0]];
  const SIZES = { box: 3, disk: 2, ball: 1, segment: 0, point: 0, path: 0 };

  const entry = (column, k) => (typeof column === "number" ? column : column[k]);
  const number = (view, index, frame) => entry(view.columns[index], frame);
  const triple = (view, index, frame) => [0, 1, 2].map((i) => number(view, index + i, frame));
  const shapeAt = (view, frame) => {
    const n = SIZES[view.shape];
    const sizes = Array.from({ length: n }, (_, i) => number(view, i, frame));
    const points = [triple(view, n, frame)];
    if (view.shape === "segment") points.push(triple(view, n + 3, frame));
    const rows = n > 0 ? [0, 1, 2].map((i) => triple(view, n + 3 + 3 * i, frame)) : null;
    const place = (p) => points[0].map((x, i) => x + rows[i][0] * p[0] + rows[i][1] * p[1] + rows[i][2] * p[2]);
    return { sizes, points, place };
  };
  const radius = (shape, sizes) =>
    shape === "box" ? Math.hypot(...sizes) / 2 : shape === "disk" ? Math.hypot(sizes[0], sizes[1] / 2) : sizes[0] || 0;

  // Bounds over the whole motion, and whether anything is below the plane z = 0.
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  let bottom = Infinity, largest = 0;
  const include = (p, r) => p.forEach((x, i) => {
    low[i] = Math.min(low[i], x - r);
    high[i] = Math.max(high[i], x + r);
  });
  const corners = ([a, b, c]) =>
    [-1, 1].flatMap((x) => [-1, 1].flatMap((y) => [-1, 1].map((z) => [(x * a) / 2, (y * b) / 2, (z * c) / 2])));
  const rim = ([r, h]) =>
    Array.from({ length: 48 }, (_, k) => [r * Math.cos((k * Math.PI) / 12), r * Math.sin((k * Math.PI) / 12), k < 24 ? h / 2 : -h / 2]);
  for (let frame = 0; frame <= last; frame += 4) {
    for (const view of motion.views) {
      const { sizes, points, place } = shapeAt(view, frame);
      const r = radius(view.shape, sizes);
      largest = Math.max(largest, r);
      points.forEach((p) => include(p, r));
      const depth = view.shape === "ball" ? points[0][2] - r
        : view.shape === "box" ? Math.min(...corners(sizes).map((p) => place(p)[2]))
        : view.shape === "disk" ? Math.min(...rim(sizes).map((p) => place(p)[2]))
        : Math.min(...points.map((p) => p[2]));
      bottom = Math.min(bottom, depth);
    }
  }
  const extent = Math.max(high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-9);
  const hasGround = bottom > -0.02 * extent;
  const middle = low.map((x, i) => (x + high[i]) / 2);
  const leader = motion.views.find((v) => SIZES[v.shape] > 0) || motion.views[0];
  follow.checked = largest > 0 && extent > 9 * largest;

  let yaw = -0.9, pitch = 0.42, zoom = 1, frame = 0, playing = false, before = 0, ink, back;
  const colours = () => {
    const style = getComputedStyle(document.documentElement);
    ink = style.getPropertyValue("--ink").trim();
    back = style.getPropertyValue("--panel").trim();
  };

  const sight = () => {
    const centre = follow.checked ? shapeAt(leader, frame).points[0] : middle;
    const span = follow.checked && largest > 0 ? Math.min(extent, 5 * largest) : extent;
    const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    const scale = (0.78 * Math.min(canvas.width, canvas.height) * zoom) / span;
    const distance = 3.2 * span;
    return (p) => {
      const [x, y, z] = p.map((q, i) => q - centre[i]);
      const across = cy * x - sy * y, along = sy * x + cy * y;
      const up = cp * z + sp * along, depth = cp * along - sp * z;
      const grow = distance / Math.max(distance + depth, 0.05 * distance);
      return [canvas.width / 2 + scale * grow * across, canvas.height / 2 - scale * grow * up, depth];
    };
  };

  const shade = ([r, g, b], light) => {
    const f = (x) => Math.round(light < 1 ? x * light : x + (255 - x) * (light - 1));
    return `rgb(${f(r)},${f(g)},${f(b)})`;
  };
  const lightOf = (a, b, c) => {
    const u = b.map((x, i) => x - a[i]), v = c.map((x, i) => x - a[i]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const size = Math.hypot(...n) || 1;
    return 0.52 + 0.52 * Math.abs((0.3 * n[0] - 0.4 * n[1] + 0.87 * n[2]) / size);
  };

  const solidFaces = (view, colour, show) => {
    const { sizes, points, place } = shapeAt(view, frame);
    const ahead = [Math.cos(pitch) * Math.sin(yaw), Math.cos(pitch) * Math.cos(yaw), -Math.sin(pitch)];
    const isThin = view.shape === "disk" && sizes[1] === 0;
    // Faces of a convex body that look away from the viewer are hidden by the others.
    const add = (face, tone) => {
      const [a, b, c] = [face[0], face[1], face[Math.min(2, face.length - 1)]];
      const u = b.map((x, i) => x - a[i]), v = c.map((x, i) => x - b[i]);
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const size = Math.hypot(...n);
      const outward = n.reduce((sum, x, i) => sum + x * (b[i] - points[0][i]), 0) < 0 ? -1 : 1;
      const away = outward * n.reduce((sum, x, i) => sum + x * ahead[i], 0);
      if (isThin || size === 0 || away < 0.3 * size) show(face, tone);
    };
    const pale = colour.map((x) => x + 0.62 * (255 - x));
    if (view.shape === "box") {
      const c = corners(sizes).map(place);
      const quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
      quads.forEach((q, k) => add(q.map((i) => c[i]), k === 1 ? pale : colour));
    } else if (view.shape === "disk") {
      const [r, h] = sizes, n = 48;
      const at = (k, z) => place([r * Math.cos((2 * Math.PI * k) / n), r * Math.sin((2 * Math.PI * k) / n), z]);
      for (const z of h > 0 ? [-h / 2, h / 2] : [0]) {
        for (let s = 0; s < 8; s++) {
          const arc = Array.from({ length: n / 8 + 1 }, (_, i) => at((s * n) / 8 + i, z));
          add([place([0, 0, z]), ...arc], s % 2 ? pale : colour);
        }
      }
      for (let k = 0; h > 0 && k < n; k++) add([at(k, -h / 2), at(k + 1, -h / 2), at(k + 1, h / 2), at(k, h / 2)], colour);
    } else {
      const r = sizes[0], n = 24, m = 12;
      const at = (i, j) => {
        const [a, b] = [(2 * Math.PI * i) / n, (Math.PI * j) / m];
        return place([r * Math.sin(b) * Math.cos(a), r * Math.sin(b) * Math.sin(a), r * Math.cos(b)]);
      };
      for (let i = 0; i < n; i++) {
        for (let j = 0; j < m; j++) {
          const isPale = (Math.floor(i / 6) + Math.floor(j / 6)) % 2;
          add([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], isPale ? pale : colour);
        }
      }
    }
  };

  const line = (points, style, width) => {
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.stroke();
  };

  const ground = (project) => {
    const raw = extent / 10, decade = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((m) => m * decade).find((s) => s >= raw);
    const [x0, x1, y0, y1] = [low[0], high[0], low[1], high[1]].map((x, k) => step * (k % 2 ? Math.ceil(x / step) : Math.floor(x / step)));
    pen.globalAlpha = 0.22;
    for (let x = x0; x <= x1 + step / 2; x += step) line([project([x, y0, 0]), project([x, y1, 0])], ink, 1);
    for (let y = y0; y <= y1 + step / 2; y += step) line([project([x0, y, 0]), project([x1, y, 0])], ink, 1);
    pen.globalAlpha = 1;
  };

  const draw = () => {
    const project = sight();
    pen.fillStyle = back;
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.lineJoin = pen.lineCap = "round";
    const isAbove = pitch >= 0;
    if (hasGround && isAbove) ground(project);
    const items = [];
    motion.views.forEach((view, index) => {
      const colour = COLOURS[index % COLOURS.length];
      const css = shade(colour, dark.matches ? 1.25 : 1);
      if (SIZES[view.shape] > 0) {
        const isBall = view.shape === "ball", isBox = view.shape === "box";
        solidFaces(view, colour, (points, tone) => {
          const flat = points.map(project);
          items.push({
            depth: flat.reduce((sum, p) => sum + p[2], 0) / flat.length,
            paint: () => {
              const fill = shade(tone, lightOf(points[0], points[1], points[2]));
              pen.beginPath();
              flat.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
              pen.closePath();
              pen.fillStyle = fill;
              pen.fill();
              pen.strokeStyle = isBox ? "rgba(0,0,0,0.55)" : fill;
              pen.lineWidth = isBall ? 0.8 : 1;
              pen.stroke();
            },
          });
        });
      } else if (view.shape === "path") {
        const places = Array.from({ length: motion.n }, (_, k) => project(shapeAt(view, k).points[0]));
        const depth = hasGround ? Infinity : places[frame][2];
        items.push({
          depth,
          paint: () => {
            pen.globalAlpha = 0.28;
            line(places, css, 1.2);
            pen.globalAlpha = 1;
            line(places.slice(0, frame + 1), css, 2.2);
          },
        });
      } else {
        const flat = shapeAt(view, frame).points.map(project);
        const depth = flat.reduce((sum, p) => sum + p[2], 0) / flat.length;
        items.push({
          depth: depth - 1e-3 * extent,
          paint: () => {
            if (flat.length > 1) return line(flat, css, 4);
            pen.beginPath();
            pen.arc(flat[0][0], flat[0][1], 6, 0, 2 * Math.PI);
            pen.fillStyle = css;
            pen.fill();
          },
        });
      }
    });
    items.sort((a, b) => b.depth - a.depth).forEach((item) => item.paint());
    if (hasGround && !isAbove) ground(project);
    axes();
    clock.textContent = `${((motion.t * frame) / last).toFixed(2)} s`;
    slider.value = frame / last;
  };

  // The directions of the axes of space in the corner.
  const axes = () => {
    const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    const [x0, y0, size] = [62, canvas.height - 62, 38];
    pen.font = "15px sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    [[cy, sp * sy], [-sy, sp * cy], [0, cp]].forEach(([x, y], k) => {
      line([[x0, y0], [x0 + size * x, y0 - size * y]], ink, 1.5);
      pen.fillStyle = ink;
      pen.fillText("xyz"[k], x0 + 1.32 * size * x, y0 - 1.32 * size * y);
    });
  };

  const tick = (now) => {
    if (!playing) return;
    const elapsed = (now - before) / 1000;
    const step = Math.floor((elapsed * last) / Math.abs(motion.t));
    if (step > 0) {
      before = now;
      frame = frame + step > last ? 0 : frame + step;
      draw();
    }
    requestAnimationFrame(tick);
  };
  const play = () => {
    playing = !playing;
    button.textContent = playing ? "Pause" : "Play";
    before = performance.now();
    if (playing) requestAnimationFrame(tick);
  };
  const turn = (dx, dy) => {
    yaw += dx;
    pitch = Math.min(1.5, Math.max(-1.5, pitch + dy));
    draw();
  };
  let held = null;
  button.addEventListener("click", play);
  slider.addEventListener("input", () => { frame = Math.round(slider.value * last); draw(); });
  follow.addEventListener("change", draw);
  canvas.addEventListener("pointerdown", (e) => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener("pointerup", () => { held = null; });
  canvas.addEventListener("pointermove", (e) => {
    if (!held) return;
    turn((e.clientX - held[0]) * -0.008, (e.clientY - held[1]) * 0.008);
    held = [e.clientX, e.clientY];
  });
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    zoom = Math.min(12, Math.max(0.2, zoom * Math.exp(-0.0015 * e.deltaY)));
    draw();
  }, { passive: false });
  canvas.addEventListener("keydown", (e) => {
    const moves = { ArrowLeft: [0.08, 0], ArrowRight: [-0.08, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] };
    if (e.key === " ") play();
    else if (moves[e.key]) turn(...moves[e.key]);
    else return;
    e.preventDefault();
  });
  dark.addEventListener("change", () => { colours(); draw(); });
  colours();
  draw();
})();
