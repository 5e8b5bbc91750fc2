"use strict";
// Prints the whole report, or the letter: of it what is of class "brief", two pages that say whose and from where they are.
(() => {
  const letter = document.body.classList.contains("letter");
  const [verdict, steps, remarks] = ["verdict", "next", "remarks"].map((id) => document.getElementById(id));
  function asLetter(chosen) {
    document.body.classList.toggle("summary", chosen);
    if (chosen) remarks.before(steps);
    else verdict.after(steps);
  }
  document.querySelectorAll("[data-print]").forEach((button) =>
    button.addEventListener("click", () => {
      asLetter(button.dataset.print === "summary");
      window.print();
    }),
  );
  window.addEventListener("afterprint", () => asLetter(letter));
  document.querySelectorAll("[data-says]").forEach((field) =>
    field.addEventListener("input", () =>
      document.querySelectorAll(`.said-${field.dataset.says}`).forEach((place) => {
        const text = field.value.trim();
        place.textContent = text && `${field.dataset.says}: ${text}`;
      }),
    ),
  );
})();
