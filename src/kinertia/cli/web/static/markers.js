"use strict";
// The markers in space, to turn; a click chooses one, in the figure or in the table.
(() => {
  const canvas = document.querySelector("[data-markers]");
  if (!canvas) return;
  const markers = JSON.parse(document.getElementById("scene").textContent);
  const rows = new Map([...document.querySelectorAll("tr[data-label]")].map((row) => [row.dataset.label, row]));
  const labels = document.querySelector("[data-labels]");
  const NEAR_PX = 14;
  let yaw = -0.5;
  let pitch = 0.1;
  let chosen = null;
  let held = null;
  let moved = 0;

  const hasPlace = (label) => !rows.has(label) || rows.get(label).querySelector("select").value !== "";
  const reach = Math.max(...markers.filter((m) => m.at).map((m) => Math.hypot(...m.at)), 1);

  // seen from the side at yaw 0; the nearer a marker, the later it is drawn
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

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.font = "12px system-ui, sans-serif";
    for (const one of placed()) {
      const own = one.label === chosen;
      const colour = own ? "#0072b2" : hasPlace(one.label) ? "#1a1a1a" : "#d55e00";
      pen.fillStyle = colour;
      pen.beginPath();
      pen.arc(one.x, one.y, own ? 7 : hasPlace(one.label) ? 3.5 : 5, 0, 2 * Math.PI);
      pen.fill();
      if (labels.checked || own || !hasPlace(one.label)) {
        pen.lineWidth = 3;
        pen.strokeStyle = "#ffffff";
        pen.strokeText(one.label, one.x + 8, one.y + 4);
        pen.fillText(one.label, one.x + 8, one.y + 4);
      }
    }
    canvas.dataset.chosen = chosen ?? "";
  }

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
    if (!held) return;
    const by = [event.clientX - held[0], event.clientY - held[1]];
    moved += Math.hypot(...by);
    turn(by[0] * 0.008, by[1] * 0.005);
    held = [event.clientX, event.clientY];
  });
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
