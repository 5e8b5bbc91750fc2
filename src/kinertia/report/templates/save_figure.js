"use strict";
// Saves a figure by its buttons: as picture (SVG, PNG), or its numbers (CSV: a row per point).
(() => {
  const PNG_SCALE = 3; // about 300 dpi in print
  const KINDS = { f4: Float32Array, u1: Uint8Array };

  // numbers of a trace: a list, a binary array (figure.py), or evenly spaced
  function numbers(values, first, step, count) {
    if (Array.isArray(values)) return values;
    if (values && values.bdata) {
      const bytes = Uint8Array.from(atob(values.bdata), (letter) => letter.charCodeAt(0));
      return Array.from(new KINDS[values.dtype](bytes.buffer));
    }
    return Array.from({ length: count }, (_, k) => (first ?? 0) + k * (step ?? 1));
  }

  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const plain = (text) => new DOMParser().parseFromString(text ?? "", "text/html").body.textContent;

  function worded(value, axis) {
    if (typeof value !== "number") return quoted(String(value ?? ""));
    if (!Number.isFinite(value)) return "";
    const at = axis && axis.ticktext ? axis.tickvals.indexOf(value) : -1;
    return at < 0 ? String(value) : quoted(plain(axis.ticktext[at]));
  }

  // half the length of the error bar of every point
  const bars = (trace) => trace.error_x?.array ?? trace.error_y?.array;

  function table(spec) {
    // tiles of a map stand on a base; their numbers are their texts
    const more = [["plus_minus", spec.data.some(bars)], ["value", spec.data.some((trace) => trace.base)]];
    const rows = [["panel", "curve", "x", "y", ...more.filter(([, any]) => any).map(([name]) => name)].join(",")];
    for (const trace of spec.data) {
      const suffix = (trace.xaxis ?? "x").slice(1);
      const titles = spec.layout.annotations ?? [];
      const panel = quoted(plain(titles[suffix ? Number(suffix) - 1 : 0]?.text));
      const axes = ["x", "y"].map((name) => spec.layout[`${name}axis${suffix}`]);
      const y = numbers(trace.y, trace.y0, trace.dy, 0);
      const lengths = numbers(trace.x, trace.x0, trace.dx, y.length);
      const x = trace.base ? lengths.map((length, k) => trace.base[k] + length / 2) : lengths;
      const half = bars(trace) && numbers(bars(trace));
      const name = quoted(plain(trace.name));
      y.forEach((value, k) => {
        const gap = typeof value === "number" && !Number.isFinite(value);
        if (trace.fill === "toself" && gap) return; // between two outlines
        const cells = [panel, name, worded(x[k], axes[0]), worded(value, axes[1])];
        if (more[0][1]) cells.push(half ? worded(half[k]) : "");
        if (more[1][1]) cells.push(trace.base ? worded(trace.text[k]) : "");
        rows.push(cells.join(","));
      });
    }
    return rows.join("\n") + "\n";
  }

  function download(name, text) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  document.addEventListener("click", async (event) => {
    const button = event.target.closest(".save button");
    if (!button) return;
    const id = button.closest(".save").dataset.of;
    const element = document.getElementById(id);
    const form = button.dataset.form;
    if (form === "csv" && canUnpack) {
      download(`${id}.csv`, table(await figureOf(id)));
    } else if (element.dataset.drawn) {
      const { width, height } = element.getBoundingClientRect();
      Plotly.downloadImage(element, { format: form, width, height, scale: form === "png" ? PNG_SCALE : 1, filename: id });
    }
  });
})();
