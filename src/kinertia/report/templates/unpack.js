"use strict";
// Texts of the page that are in gzip and base64 (packing.py); plotly.js is one of them.
const canUnpack = typeof DecompressionStream !== "undefined";

async function unpackedText(element) {
  const packed = atob(element.textContent);
  const bytes = new Uint8Array(packed.length);
  for (let k = 0; k < packed.length; k += 1) bytes[k] = packed.charCodeAt(k);
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}

// traces and layout of a figure by the id of its element
async function figureOf(id) {
  return JSON.parse(await unpackedText(document.querySelector(`script[data-for="${id}"]`)));
}

async function loadPlotly() {
  const script = document.createElement("script");
  script.textContent = await unpackedText(document.getElementById("plotly-packed"));
  document.head.append(script);
}

if (!canUnpack) {
  const note = document.createElement("p");
  note.className = "caution";
  note.setAttribute("role", "alert");
  note.textContent = "This browser is too old to draw the figures. Open the page in Chrome or Edge 80, Firefox 113, Safari 16.4 or later. All tables are complete.";
  document.querySelector("main").prepend(note);
}
