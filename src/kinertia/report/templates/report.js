"use strict";
// Draws every figure of the page, one after the other so that reading is not held up, and again for another width.
(() => {
  const WHOLE_PX = 960; // on paper, of a figure that has its width; report.css scales it to the sheet
  const config = { displayModeBar: false }; // its icons would lie on the legends
  let printing = false;
  const columns = (px) => (px < 560 ? 1 : px < 860 ? 2 : 3);

  // relayout's flat form: {"xaxis2.domain": [0, 1], "annotations[0].text": "a", height: 300, ...}
  function arrangement(layout, width) {
    const ways = layout.meta && layout.meta.arrangements;
    return { width, ...(ways ? ways[printing && width === WHOLE_PX ? "print" : columns(width)] : {}) };
  }

  function applied(layout, flat) {
    const whole = structuredClone(layout);
    for (const [path, value] of Object.entries(flat)) {
      const keys = path.split(/[.[\]]+/);
      const last = keys.pop();
      keys.reduce((inner, key) => (inner[key] ??= {}), whole)[last] = value;
    }
    return whole;
  }

  const plots = [...document.querySelectorAll(".plot")].map((element) => ({ element, width: 0, spec: null, drawn: false }));

  function draw(plot, width) {
    if (!plot.spec) return; // not unpacked yet
    if (!plot.drawn) {
      plot.drawn = true;
      const flat = arrangement(plot.spec.layout, width);
      if (matchMedia("(pointer: coarse)").matches) flat.dragmode = false; // a finger scrolls the page
      plot.width = width;
      plot.element.style.minHeight = "";
      Plotly.newPlot(plot.element, plot.spec.data, applied(plot.spec.layout, flat), config);
      plot.element.dataset.drawn = "yes";
    } else if (width !== plot.width) {
      plot.width = width;
      Plotly.relayout(plot.element, arrangement(plot.spec.layout, width));
    }
  }

  const closed = (plot) => plot.element.closest("details:not([open])");
  const room = (plot) => Math.floor(plot.element.getBoundingClientRect().width);
  const onPaper = (plot) => Number(getComputedStyle(plot.element).getPropertyValue("--paper-px"));
  const soon = window.requestIdleCallback || ((work) => setTimeout(work, 1));
  let next = 0;
  function drawNext() {
    if (next >= plots.length) return;
    if (!printing && !closed(plots[next])) draw(plots[next], room(plots[next])); // the others when they are opened
    next += 1;
    soon(drawNext, { timeout: 200 });
  }
  async function start() {
    await loadPlotly();
    const specs = await Promise.all(plots.map((plot) => figureOf(plot.element.id)));
    plots.forEach((plot, k) => (plot.spec = specs[k]));
    drawNext();
  }
  if (canUnpack) start();

  document.querySelectorAll("details").forEach((part) =>
    part.addEventListener("toggle", () => {
      if (part.open && !printing) plots.filter((plot) => part.contains(plot.element)).forEach((plot) => draw(plot, room(plot)));
    }),
  );

  let waiting = 0;
  window.addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => printing || plots.filter((plot) => plot.drawn && !closed(plot)).forEach((plot) => draw(plot, room(plot))), 150);
  });
  window.addEventListener("beforeprint", () => {
    printing = true;
    document.querySelectorAll("details").forEach((part) => (part.open = true));
    plots.forEach((plot) => draw(plot, onPaper(plot)));
  });
  window.addEventListener("afterprint", () => {
    printing = false;
    plots.forEach((plot) => draw(plot, room(plot)));
  });
})();
