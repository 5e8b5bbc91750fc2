"use strict";
// Shows one of several panels, and filters the rows of a table. Panels that are away keep their width, and so their figures.
(() => {
  document.querySelectorAll(".switch").forEach((root) => {
    const panels = [...root.children].filter((child) => child.classList.contains("panel"));
    root.querySelector("fieldset").addEventListener("change", (event) =>
      panels.forEach((panel, k) => panel.classList.toggle("away", k !== Number(event.target.value))),
    );
  });
  document.querySelectorAll(".filters input").forEach((box) => {
    const table = box.closest(".filters").nextElementSibling;
    const apply = () => table.classList.toggle(box.dataset.filter, box.checked);
    box.addEventListener("change", apply);
    apply(); // browsers remember what was checked
  });
})();
