"use strict";
// Draws the views over time on a canvas: faces of solids are sorted from back to front, and lines are drawn after them where
// no solid hides them.
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
  follow.checked = largest > 0 && extent > 14 * largest;

  let yaw = -0.9, pitch = 0.42, zoom = 1, frame = 0, playing = false, before = 0, ink, back;
  // Pixels that the whole motion leaves free on all sides in the first view.
  const MARGIN = 46;
  let fit = { scale: 1, x: 0, y: 0 };
  const colours = () => {
    const style = getComputedStyle(document.documentElement);
    ink = style.getPropertyValue("--ink").trim();
    back = style.getPropertyValue("--panel").trim();
  };

  // Towards the scene, and where the viewer is.
  const ahead = () => [Math.cos(pitch) * Math.sin(yaw), Math.cos(pitch) * Math.cos(yaw), -Math.sin(pitch)];
  const focus = () => {
    const centre = follow.checked ? shapeAt(leader, frame).points[0] : middle;
    const span = follow.checked && largest > 0 ? Math.min(extent, 5 * largest) : extent;
    return { centre, span, eye: ahead().map((x, i) => centre[i] - 3.2 * span * x) };
  };
  const sight = () => {
    const { centre, span } = focus();
    const { scale: larger, x: right, y: down } = follow.checked ? { scale: 1, x: 0, y: 0 } : fit;
    const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    const scale = (0.78 * Math.min(canvas.width, canvas.height) * zoom * larger) / span;
    const distance = 3.2 * span;
    return (p) => {
      const [x, y, z] = p.map((q, i) => q - centre[i]);
      const across = cy * x - sy * y, along = sy * x + cy * y;
      const up = cp * z + sp * along, depth = cp * along - sp * z;
      const grow = distance / Math.max(distance + depth, 0.05 * distance);
      const [x0, y0] = [canvas.width / 2 + zoom * right, canvas.height / 2 + zoom * down];
      return [x0 + scale * grow * across, y0 - scale * grow * up, depth];
    };
  };
  // What is seen of a figure does not depend on the view it is turned to later, so that it keeps its size.
  const fitToCanvas = () => {
    const followed = follow.checked;
    follow.checked = false;
    const project = sight();
    const [x, y] = [[Infinity, -Infinity], [Infinity, -Infinity]];
    const see = (p) => [x, y].forEach((range, i) => {
      const q = project(p)[i];
      range[0] = Math.min(range[0], q);
      range[1] = Math.max(range[1], q);
    });
    for (let k = 0; k <= last; k += 4) {
      for (const view of motion.views) {
        const { sizes, points } = shapeAt(view, k);
        const r = radius(view.shape, sizes);
        points.forEach((p) => [-r, r].forEach((d) => [0, 1, 2].forEach((i) => see(p.map((q, j) => q + (i === j ? d : 0))))));
      }
    }
    const room = [canvas.width, canvas.height].map((size, i) => (size - 2 * MARGIN) / Math.max([x, y][i][1] - [x, y][i][0], 1e-9));
    const scale = Math.min(...room, 4);
    const off = (range, size) => -scale * ((range[0] + range[1]) / 2 - size / 2);
    fit = { scale, x: off(x, canvas.width), y: off(y, canvas.height) };
    follow.checked = followed;
  };

  const shade = ([r, g, b], light) => {
    const f = (x) => Math.round(light < 1 ? x * light : x + (255 - x) * (light - 1));
    return `rgb(${f(r)},${f(g)},${f(b)})`;
  };
  // Newell's normal, which corners that coincide do not spoil; its length is twice the area.
  const normal = (face) => {
    const n = [0, 0, 0];
    face.forEach((a, k) => {
      const b = face[(k + 1) % face.length];
      for (let i = 0; i < 3; i++) n[i] += (a[(i + 1) % 3] - b[(i + 1) % 3]) * (a[(i + 2) % 3] + b[(i + 2) % 3]);
    });
    return n;
  };
  const lightOf = (n) => 0.52 + 0.52 * Math.abs((0.3 * n[0] - 0.4 * n[1] + 0.87 * n[2]) / (Math.hypot(...n) || 1));

  // Whether something solid is between a point and the viewer: the ray is turned into the solid's frame, where the solid is
  // an intersection of slabs and a ball or a cylinder, each of which a ray is inside of from one distance to another.
  const hider = () => {
    const { eye } = focus();
    const solids = motion.views.filter((view) => SIZES[view.shape] > 0).map((view) => {
      const { sizes, points } = shapeAt(view, frame);
      const n = SIZES[view.shape];
      const rows = [0, 1, 2].map((i) => triple(view, n + 3 + 3 * i, frame));
      const turn = (p) => [0, 1, 2].map((j) => rows[0][j] * p[0] + rows[1][j] * p[1] + rows[2][j] * p[2]);
      return { shape: view.shape, sizes, centre: points[0], turn };
    });
    const slab = (p, d, half) => (d === 0 ? (Math.abs(p) < half ? [-Infinity, Infinity] : [1, 0])
      : [(-half * Math.sign(d) - p) / d, (half * Math.sign(d) - p) / d]);
    const dot = (u, v) => u.reduce((sum, x, i) => sum + x * v[i], 0);
    const round = (p, d, r) => {
      const a = dot(d, d), b = dot(p, d), c = dot(p, p) - r * r, root = b * b - a * c;
      if (a === 0) return c < 0 ? [-Infinity, Infinity] : [1, 0];
      return root < 0 ? [1, 0] : [(-b - Math.sqrt(root)) / a, (-b + Math.sqrt(root)) / a];
    };
    return (point) => solids.some(({ shape, sizes, centre, turn }) => {
      const p = turn(point.map((x, i) => x - centre[i])), d = turn(eye.map((x, i) => x - point[i]));
      const inside = shape === "ball" ? [round(p, d, sizes[0])]
        : shape === "disk" ? [round(p.slice(0, 2), d.slice(0, 2), sizes[0]), slab(p[2], d[2], sizes[1] / 2)]
        : sizes.map((edge, i) => slab(p[i], d[i], edge / 2));
      const from = Math.max(0, ...inside.map((range) => range[0])), to = Math.min(1, ...inside.map((range) => range[1]));
      // Points on the surface, such as a point of contact, are seen.
      return to - from > 1e-3;
    });
  };

  const solidFaces = (view, colour, show) => {
    const { sizes, points, place } = shapeAt(view, frame);
    const viewed = ahead();
    const isThin = view.shape === "disk" && sizes[1] === 0;
    // Faces of a convex body that look away from the viewer are hidden by the others.
    const add = (face, tone) => {
      const n = normal(face), size = Math.hypot(...n);
      const outward = n.reduce((sum, x, i) => sum + x * (face[0][i] - points[0][i]), 0) < 0 ? -1 : 1;
      const away = outward * n.reduce((sum, x, i) => sum + x * viewed[i], 0);
      if (isThin || away < 0.3 * size) show(face, tone);
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

  // Paths, segments and points where they are seen.
  const drawLines = (project) => {
    const isHidden = hider();
    // The parts of a broken line that are seen; a part is hidden when its middle is.
    const seen = (places, style, width) => {
      let run = [];
      const end = () => { if (run.length > 1) line(run.map(project), style, width); run = []; };
      places.forEach((p, k) => {
        if (k > 0 && isHidden(p.map((x, i) => (x + places[k - 1][i]) / 2))) end();
        run.push(p);
      });
      end();
    };
    motion.views.forEach((view, index) => {
      const css = shade(COLOURS[index % COLOURS.length], dark.matches ? 1.25 : 1);
      if (view.shape === "path") {
        const places = Array.from({ length: motion.n }, (_, k) => shapeAt(view, k).points[0]);
        pen.globalAlpha = 0.28;
        seen(places, css, 1.2);
        pen.globalAlpha = 1;
        seen(places.slice(0, frame + 1), css, 2.2);
      } else if (view.shape === "segment") {
        const [a, b] = shapeAt(view, frame).points;
        seen(Array.from({ length: 65 }, (_, k) => a.map((x, i) => x + (k / 64) * (b[i] - x))), css, 4);
      } else if (view.shape === "point" && !isHidden(shapeAt(view, frame).points[0])) {
        const [x, y] = project(shapeAt(view, frame).points[0]);
        pen.beginPath();
        pen.arc(x, y, 6, 0, 2 * Math.PI);
        pen.fillStyle = css;
        pen.fill();
      }
    });
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
      if (SIZES[view.shape] > 0) {
        const isBall = view.shape === "ball", isBox = view.shape === "box";
        solidFaces(view, colour, (points, tone) => {
          const flat = points.map(project);
          items.push({
            depth: flat.reduce((sum, p) => sum + p[2], 0) / flat.length,
            paint: () => {
              const fill = shade(tone, lightOf(normal(points)));
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
      }
    });
    items.sort((a, b) => b.depth - a.depth).forEach((item) => item.paint());
    drawLines(project);
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
  fitToCanvas();
  draw();
})();
