"use strict";
// Prints the whole report, or the letter: of it what is of class "brief", two pages that say whose and from where they are.
(() => {
  document.querySelectorAll("[data-print]").forEach((button) =>
    button.addEventListener("click", () => {
      document.body.classList.toggle("summary", button.dataset.print === "summary");
      window.print();
    }),
  );
  const letter = document.body.classList.contains("letter");
  window.addEventListener("afterprint", () => document.body.classList.toggle("summary", letter));
  document.querySelectorAll("[data-says]").forEach((field) =>
    field.addEventListener("input", () =>
      document.querySelectorAll(`.said-${field.dataset.says}`).forEach((place) => {
        const text = field.value.trim();
        place.textContent = text && `${field.dataset.says}: ${text}`;
      }),
    ),
  );
})();
