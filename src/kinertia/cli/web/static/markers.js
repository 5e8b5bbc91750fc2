"use strict";
// The markers in space, to turn; a click chooses one, in the figure or in the table. Labels do not cover one another.
(() => {
  const canvas = document.querySelector("[data-markers]");
  if (!canvas) return;
  const markers = JSON.parse(document.getElementById("scene").textContent);
  const rows = new Map([...document.querySelectorAll("tr[data-label]")].map((row) => [row.dataset.label, row]));
  const labels = document.querySelector("[data-labels]");
  const NEAR_PX = 14;
  let yaw = widest();
  let pitch = 0.1;
  let chosen = null;
  let pointed = null;
  let held = null;
  let moved = 0;

  const hasPlace = (label) => !rows.has(label) || rows.get(label).querySelector("select").value !== "";
  const reach = Math.max(...markers.filter((m) => m.at).map((m) => Math.hypot(...m.at)), 1);

  // from where the body looks widest: people stand and walk along any axis of a laboratory
  function widest() {
    const places = markers.filter((m) => m.at).map((m) => m.at);
    const wide = (turned) => places.reduce((sum, [x, , z]) => sum + (x * Math.cos(turned) + z * Math.sin(turned)) ** 2, 0);
    const turns = Array.from({ length: 32 }, (_, k) => -0.1 * k);
    return turns.reduce((best, turned) => (wide(turned) > wide(best) ? turned : best), turns[0]);
  }

  // seen from the right at yaw 0, from the front a quarter turn before; the nearer a marker, the later it is drawn
  function projected([x, y, z]) {
    const scale = (0.47 * Math.min(canvas.clientWidth, canvas.clientHeight)) / reach;
    const right = x * Math.cos(yaw) + z * Math.sin(yaw);
    const near = z * Math.cos(yaw) - x * Math.sin(yaw);
    const up = y * Math.cos(pitch) - near * Math.sin(pitch);
    return { x: canvas.clientWidth / 2 + right * scale, y: canvas.clientHeight / 2 - up * scale, near };
  }

  function placed() {
    return markers.filter((m) => m.at).map((m) => ({ ...projected(m.at), label: m.label })).sort((a, b) => a.near - b.near);
  }

  function colourOf(label) {
    return label === chosen ? "#0072b2" : hasPlace(label) ? "#1a1a1a" : "#d55e00";
  }

  function radiusOf(label) {
    return label === chosen ? 7 : hasPlace(label) ? 3.5 : 5;
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.font = "12px system-ui, sans-serif";
    const seen = placed();
    for (const one of seen) {
      pen.fillStyle = colourOf(one.label);
      pen.beginPath();
      pen.arc(one.x, one.y, radiusOf(one.label), 0, 2 * Math.PI);
      pen.fill();
    }
    for (const { label, x, y } of labelsWithRoom(pen, seen)) {
      pen.fillStyle = colourOf(label);
      pen.lineWidth = 3;
      pen.strokeStyle = "#ffffff";
      pen.strokeText(label, x, y);
      pen.fillText(label, x, y);
    }
    canvas.dataset.chosen = chosen ?? "";
  }

  // where labels stand: those asked for, then those without a place, then the nearest, each where it covers nothing;
  // those asked for and those without a place have one in any case
  function labelsWithRoom(pen, seen) {
    const rank = ({ label }) => (label === chosen || label === pointed ? 0 : hasPlace(label) ? 2 : 1);
    const taken = seen.map((one) => ({ of: one.label, left: one.x - 3, right: one.x + 3, top: one.y - 3, bottom: one.y + 3 }));
    const shown = [];
    for (const one of seen.toReversed().sort((a, b) => rank(a) - rank(b))) {
      if (rank(one) === 2 && !labels.checked) continue;
      const all = placesAround(one, pen.measureText(one.label).width);
      const free = all.find((place) => taken.every((other) => other.of === one.label || !cover(place, other)));
      if (!free && rank(one) === 2) continue;
      const place = free || all[0];
      taken.push(place);
      shown.push({ label: one.label, x: place.left, y: place.bottom - 2 });
    }
    return shown;
  }

  // right of the marker, left of it, above and below
  function placesAround({ label, x, y }, wide) {
    const off = radiusOf(label) + 4;
    const starts = [[off, 6], [-off - wide, 6], [-wide / 2, -off], [-wide / 2, off + 10], [off, -2], [-off - wide, -2]];
    return starts.map(([dx, dy]) => ({ of: null, left: x + dx, right: x + dx + wide, top: y + dy - 12, bottom: y + dy }));
  }

  const cover = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;

  function turn(dyaw, dpitch) {
    yaw += dyaw;
    pitch = Math.min(1.5, Math.max(-1.5, pitch + dpitch));
    draw();
  }

  function choose(label, focus) {
    chosen = label;
    for (const [name, row] of rows) row.classList.toggle("chosen", name === label);
    const row = rows.get(label);
    if (row && focus) {
      row.scrollIntoView({ block: "nearest" });
      row.querySelector("select").focus({ preventScroll: true });
    }
    draw();
  }

  function point(label) {
    if (label === pointed) return;
    pointed = label;
    draw();
  }

  function nearest(event) {
    const box = canvas.getBoundingClientRect();
    const distance = (one) => Math.hypot(one.x - (event.clientX - box.left), one.y - (event.clientY - box.top));
    const found = placed().sort((a, b) => distance(a) - distance(b))[0];
    return found && distance(found) < NEAR_PX ? found.label : null;
  }

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held = [event.clientX, event.clientY];
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return point(nearest(event));
    const by = [event.clientX - held[0], event.clientY - held[1]];
    moved += Math.hypot(...by);
    turn(by[0] * 0.008, by[1] * 0.005);
    held = [event.clientX, event.clientY];
    return undefined;
  });
  canvas.addEventListener("pointerleave", () => point(null));
  canvas.addEventListener("pointerup", (event) => {
    held = null;
    const label = moved < 4 ? nearest(event) : null;
    if (label) choose(label, true);
  });
  canvas.addEventListener("pointercancel", () => (held = null));
  canvas.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (!turns[event.key]) return;
    turn(...turns[event.key]);
    event.preventDefault();
  });
  document.querySelectorAll("[data-turn]").forEach((button) =>
    button.addEventListener("click", () => turn(Number(button.dataset.turn), 0)));
  labels.addEventListener("change", draw);
  for (const [label, row] of rows) {
    row.querySelector("button").addEventListener("click", () => choose(label, true));
    row.querySelectorAll("select").forEach((select) => {
      select.addEventListener("focus", () => choose(label, false));
      select.addEventListener("change", draw);
    });
  }
  new ResizeObserver(draw).observe(canvas);
})();
