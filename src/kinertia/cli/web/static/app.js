"use strict";
// Dropped files go to the library one by one; progress is asked for once a second. Everything else is forms and links.
(() => {
  const PAUSE_MS = 700;

  // the files below a dropped folder or file, with their paths
  async function filesOf(entry) {
    if (entry.isFile) return [await new Promise((take, fail) => entry.file(take, fail))];
    const reader = entry.createReader();
    const files = [];
    for (;;) {
      const some = await new Promise((take, fail) => reader.readEntries(take, fail));
      if (!some.length) return files;
      for (const one of some) files.push(...(await filesOf(one)));
    }
  }

  // the form of a person: what was entered is kept before something else takes its place
  class Entries {
    constructor(form) {
      this.form = form;
      this.saved = form.hasAttribute("data-unsaved") ? "" : this.served();
      document.querySelectorAll("[data-keeps]").forEach((one) =>
        one.addEventListener(one.tagName === "FORM" ? "submit" : "click", (event) => this.before(event, one)));
    }

    now() {
      return new URLSearchParams(new FormData(this.form)).toString();
    }

    // as the page came: somebody may have typed before this runs
    served() {
      const fields = new URLSearchParams();
      for (const one of this.form.elements) {
        if (!one.name || one.matches(":disabled, button, [type=submit], [type=file]")) continue;
        if (one.matches("[type=checkbox], [type=radio]")) {
          if (one.defaultChecked) fields.append(one.name, one.value);
        } else if (one.tagName === "SELECT") {
          const chosen = [...one.options].find((option) => option.defaultSelected) || one.options[0];
          if (chosen) fields.append(one.name, chosen.value);
        } else fields.append(one.name, one.defaultValue);
      }
      return fields.toString();
    }

    // what is wrong with it; empty if nothing is
    async keep() {
      const now = this.now();
      if (now === this.saved || !now) return "";
      try {
        const answer = await fetch(this.form.dataset.keepAt, { method: "POST", body: new URLSearchParams(now), headers: { accept: "application/json" } });
        if (!answer.ok) return (await answer.json()).problem;
      } catch {
        return ""; // nobody is there to keep it: what comes next says so
      }
      this.saved = now;
      return "";
    }

    async before(event, one) {
      if (this.now() === this.saved || event.ctrlKey || event.metaKey || event.shiftKey) return;
      event.preventDefault();
      // a file that goes is used as nothing
      const use = one.closest("tr")?.querySelector("select");
      if (use) use.value = [...use.options].at(-1).value;
      if (await this.keep()) this.form.requestSubmit(); // and is told what is wrong, with all that was entered
      else if (one.tagName === "FORM") one.submit();
      else location.assign(one.href);
    }
  }

  const form = document.getElementById("entries");
  const entries = form && new Entries(form);

  // what Vicon Nexus keeps beside its C3D files in a session's folder
  const OF_NEXUS = /\.(enf|history|mkr|vsk|vst|vpf|x1d|x2d|xcp|system|avi|vvid)$/i;

  class Drop {
    constructor(root) {
      this.root = root;
      this.status = root.querySelector("[role=status]");
      this.problems = root.querySelector(".problems");
      for (const name of ["dragenter", "dragover"]) root.addEventListener(name, (event) => this.over(event, true));
      for (const name of ["dragleave", "drop"]) root.addEventListener(name, (event) => this.over(event, false));
      root.addEventListener("drop", (event) => this.dropped(event.dataTransfer));
      root.querySelectorAll("[data-files]").forEach((input) =>
        input.addEventListener("change", () => this.take([...input.files], folderOf(input.files))));
    }

    over(event, on) {
      event.preventDefault();
      this.root.classList.toggle("over", on);
    }

    async dropped(data) {
      const entries = [...data.items].map((item) => item.webkitGetAsEntry && item.webkitGetAsEntry()).filter(Boolean);
      if (!entries.length) return this.take([...data.files], "");
      const files = [];
      for (const entry of entries) files.push(...(await filesOf(entry)));
      const folder = entries.length === 1 && entries[0].isDirectory ? entries[0].name : "";
      return this.take(files, folder);
    }

    async take(files, folder) {
      this.problems.textContent = "";
      const chosen = files.filter((file) => !file.name.startsWith(".") && !(folder && OF_NEXUS.test(file.name)));
      if (!chosen.length) return this.problem("No files in it.");
      try {
        const wrong = entries && (await entries.keep());
        if (wrong) return this.problem(wrong);
        const person = this.root.dataset.person || (await this.newPerson(folder || nameIn(chosen)));
        const address = `${this.root.dataset.root}/people/${encodeURIComponent(person)}`;
        const taken = await this.send(chosen, address);
        if (!taken && !this.root.dataset.person) {
          // nobody stays in the library of whom there is nothing
          await this.post(`${address}/delete`);
          this.status.textContent = "No file was taken.";
          return undefined;
        }
        if (taken) this.status.textContent = "Looking at the files";
        await this.post(`${address}/recognise`);
        // what was refused can be read before the page goes on
        if (!this.problems.childElementCount) location.assign(address);
        else this.goOn(address, taken);
      } catch (error) {
        this.problem(error.message === "Failed to fetch" ? "Kinertia does not answer: is it still running?" : error.message);
        this.status.textContent = "";
      }
      return undefined;
    }

    async newPerson(name) {
      const answer = await this.post(`${this.root.dataset.root}/people`, new URLSearchParams({ name }));
      return decodeURIComponent((await answer.json()).address.split("/").pop());
    }

    // how many were taken; the same name from two folders is taken once
    async send(files, address) {
      const names = new Set();
      let taken = 0;
      for (const [k, file] of files.entries()) {
        this.status.textContent = `Copying ${k + 1} of ${files.length}: ${file.name}`;
        const name = file.name.toLowerCase();
        if (names.has(name)) {
          this.problem(`${file.name}: another file of this name is in the folder; it was left out, rename one of them`);
          continue;
        }
        names.add(name);
        const largest = 1e6 * Number(this.root.dataset.largestMb);
        if (file.size > largest) {
          this.problem(`${file.name}: not accepted: larger than ${this.root.dataset.largestMb} MB, the most of one file`);
          continue;
        }
        const answer = await fetch(`${address}/files?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file, headers: { accept: "application/json" } });
        if (answer.ok) taken += 1;
        else this.problem((await answer.json()).problem);
      }
      return taken;
    }

    async post(address, body) {
      const answer = await fetch(address, { method: "POST", body, headers: { accept: "application/json" } });
      if (!answer.ok) throw new Error((await answer.json()).problem);
      return answer;
    }

    problem(sentence) {
      const item = document.createElement("li");
      item.textContent = sentence;
      this.problems.append(item);
    }

    goOn(address, taken) {
      this.status.textContent = `${taken} file${taken === 1 ? "" : "s"} taken. `;
      const link = document.createElement("a");
      link.className = "button";
      link.href = address;
      link.textContent = "Go on";
      this.status.append(link);
      link.focus();
    }
  }

  function folderOf(files) {
    return files.length ? (files[0].webkitRelativePath || "").split("/")[0] : "";
  }

  // a subject file's own name, else the words with which the names of all files begin
  function nameIn(files) {
    const stems = files.map((file) => file.name.replace(/\.[^.]*$/, ""));
    const subjects = stems.filter((stem, k) => /\.toml$/i.test(files[k].name) && stem.toLowerCase() !== "subject");
    if (stems.length === 1 || subjects.length === 1) return subjects[0] || stems[0];
    const words = stems.map((stem) => stem.split(/[ _-]+/));
    const differs = words[0].findIndex((word, k) => words.some((other) => other[k] !== word));
    const common = words[0].slice(0, differs < 0 ? undefined : differs).join(" ");
    return /^(static|cal|calibration|walk|gait|trial|markers?)?$/i.test(common) ? "" : common;
  }

  // a page that answered a form has the address that shows it, so that loading it again sends no form
  const address = document.querySelector("[data-address]")?.dataset.address;
  if (address) history.replaceState(null, "", address + location.hash);

  // without an outcome the section of results says what ended
  if (location.hash === "#outcome" && !document.getElementById("outcome")) document.getElementById("results")?.scrollIntoView();

  // asks how far it is; when it is done the page is asked for again
  class Working {
    constructor(root) {
      this.root = root;
      this.ask();
    }

    async ask() {
      try {
        const answer = await fetch(this.root.dataset.progress, { headers: { accept: "application/json" } });
        if (answer.status === 404) return this.again();
        const job = (await answer.json())[this.root.dataset.kind];
        if (!job) return this.again();
        this.show(job);
      } catch {
        this.root.querySelector("[data-left]").textContent = "Kinertia does not answer: is it still running?";
      }
      return setTimeout(() => this.ask(), PAUSE_MS);
    }

    // to another address, since loading the same one again could repeat a form
    again() {
      location.replace(`${address}?again${this.root.dataset.kind === "comparison" ? "#comparison" : "#outcome"}`);
    }

    show(job) {
      const stage = this.root.querySelector("[data-stage]");
      if (stage.textContent !== job.stage) stage.textContent = job.stage;
      const bar = this.root.querySelector("progress");
      if (job.share > 0) bar.value = job.share;
      else bar.removeAttribute("value");
      this.root.querySelector("[data-left]").textContent = job.left;
    }
  }

  // tells when the first estimate can begin, and goes once it can
  async function prepared(line) {
    try {
      const { left } = await (await fetch(line.dataset.preparing)).json();
      if (left === null) return line.remove();
      if (left) line.querySelector("span").textContent = left;
    } catch {
      return line.remove();
    }
    return setTimeout(() => prepared(line), PAUSE_MS);
  }

  document.querySelectorAll("[data-preparing]").forEach(prepared);
  document.querySelectorAll("[data-drop]").forEach((root) => new Drop(root));
  document.querySelectorAll("[data-progress]").forEach((root) => new Working(root));
  // a file that misses the place for it must not take the page away
  for (const name of ["dragover", "drop"]) window.addEventListener(name, (event) => event.preventDefault());
})();
