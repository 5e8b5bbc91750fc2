"use strict";
// Plays a skeleton on a canvas: lines, dots and arrows, seen by a camera that goes along with the pelvis.
(() => {
  const HIDDEN = -32768;
  const COLOURS = { measured: "#000000", modelled: "#009E73", com: "rgba(230,159,0,0.7)", arrows: "#009E73", floor: "#D8D8D8" };
  const STEP_MM = 500;
  const FLOOR_MM = 3000;

  function unpacked(base64) {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Int16Array.from({ length: bytes.length / 2 }, (_, k) => view.getInt16(2 * k, true));
  }

  class View {
    constructor(root) {
      this.root = root;
      this.scene = JSON.parse(root.querySelector("script").textContent);
      this.data = Object.fromEntries(Object.entries(this.scene.data).map(([name, text]) => [name, unpacked(text)]));
      this.canvas = root.querySelector("canvas");
      this.slider = root.querySelector("input[type=range]");
      this.playButton = root.querySelector("[data-do=play]");
      this.output = root.querySelector("output");
      this.speed = root.querySelector("select");
      this.frame = 0;
      this.clock = this.scene.time[0];
      this.playing = false;
      this.yaw = -0.45;
      this.pitch = 0.16;
      this.top = this.height();
      this.slider.max = this.scene.time.length - 1;
      this.listen();
      new ResizeObserver(() => this.resize()).observe(this.canvas);
      this.resize();
    }

    // height of what is to be seen, mm: the highest point of the first frame
    height() {
      let top = 0;
      for (const name of ["points", "measured"]) {
        for (let k = 0; k < this.scene.count[name]; k++) top = Math.max(top, this.data[name][3 * k + 1]);
      }
      return top;
    }

    listen() {
      this.playButton.addEventListener("click", () => this.toggle());
      this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
      this.root.querySelector("[data-do=left]").addEventListener("click", () => this.turn(-0.2, 0));
      this.root.querySelector("[data-do=right]").addEventListener("click", () => this.turn(0.2, 0));
      this.root.querySelectorAll("[data-show]").forEach((box) => box.addEventListener("change", () => this.draw()));
      this.canvas.addEventListener("keydown", (event) => {
        const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
        if (turns[event.key]) this.turn(...turns[event.key]);
        else if (event.key === " ") this.toggle();
        else return;
        event.preventDefault();
      });
      this.canvas.addEventListener("pointerdown", (event) => {
        this.canvas.setPointerCapture(event.pointerId);
        this.held = [event.clientX, event.clientY];
      });
      this.canvas.addEventListener("pointermove", (event) => {
        if (!this.held) return;
        this.turn((event.clientX - this.held[0]) * 0.008, (event.clientY - this.held[1]) * 0.005);
        this.held = [event.clientX, event.clientY];
      });
      for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => (this.held = null));
    }

    resize() {
      const ratio = window.devicePixelRatio || 1;
      this.width = this.canvas.clientWidth;
      this.tall = this.canvas.clientHeight;
      this.canvas.width = Math.round(this.width * ratio);
      this.canvas.height = Math.round(this.tall * ratio);
      this.pen = this.canvas.getContext("2d");
      this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      this.draw();
    }

    toggle() {
      this.playing = !this.playing;
      this.playButton.textContent = this.playing ? "Pause" : "Play";
      this.before = null;
      if (this.playing) requestAnimationFrame((now) => this.tick(now));
    }

    tick(now) {
      if (!this.playing) return;
      const { time } = this.scene;
      if (this.before !== null) this.clock += ((now - this.before) / 1000) * Number(this.speed.value);
      this.before = now;
      const last = time[time.length - 1];
      if (this.clock > last) this.clock = time[0];
      const share = (this.clock - time[0]) / (last - time[0] || 1);
      this.show(Math.round(share * (time.length - 1)));
      requestAnimationFrame((then) => this.tick(then));
    }

    go(frame) {
      this.clock = this.scene.time[frame];
      this.show(frame);
    }

    show(frame) {
      if (frame === this.frame) return;
      this.frame = frame;
      this.slider.value = frame;
      this.draw();
    }

    turn(yaw, pitch) {
      this.yaw += yaw;
      this.pitch = Math.min(1.5, Math.max(-0.3, this.pitch + pitch));
      this.draw();
    }

    // where point k of a part of the scene is on the canvas; null where it is not seen
    place(name, k) {
      const at = 3 * (this.frame * this.scene.count[name] + k);
      const part = this.data[name];
      return part[at] === HIDDEN ? null : this.projected(part[at], part[at + 1], part[at + 2]);
    }

    // seen from the person's right at yaw 0; `centre` is in the middle of the canvas
    projected(x, y, z) {
      const dx = x - this.centre[0];
      const dz = z - this.centre[1];
      const right = dx * Math.cos(this.yaw) + dz * Math.sin(this.yaw);
      const near = dz * Math.cos(this.yaw) - dx * Math.sin(this.yaw);
      const up = (y - 0.5 * this.top) * Math.cos(this.pitch) - near * Math.sin(this.pitch);
      return [this.width / 2 + right * this.scale, this.tall / 2 - up * this.scale];
    }

    draw() {
      if (!this.pen || !this.width) return;
      const root = 3 * this.frame * this.scene.count.points;
      this.centre = [this.data.points[root], this.data.points[root + 2]];
      this.scale = Math.min(this.tall / (1.25 * this.top), this.width / (0.8 * this.top));
      this.pen.clearRect(0, 0, this.width, this.tall);
      this.pen.lineCap = "round";
      this.floor();
      const shown = (name) => this.root.querySelector(`[data-show=${name}]`).checked;
      if (shown("arrows")) this.arrows();
      this.scene.bones.forEach(([from, to], k) =>
        this.line(this.place("points", from), this.place("points", to), this.scene.colours[k], 4));
      if (shown("com")) this.dots("com", (k) => this.scene.radius_mm[k] * this.scale, COLOURS.com, true);
      if (shown("modelled")) this.dots("modelled", () => 4, COLOURS.modelled, false);
      if (shown("measured")) this.dots("measured", () => 2.2, COLOURS.measured, true);
      const time = this.scene.time[this.frame];
      this.output.textContent = `${time.toFixed(3)} s`;
      this.slider.setAttribute("aria-valuetext", `${time.toFixed(3)} s`);
      this.canvas.dataset.frame = this.frame;
    }

    line(from, to, colour, width) {
      if (!from || !to) return;
      this.pen.strokeStyle = colour;
      this.pen.lineWidth = width;
      this.pen.beginPath();
      this.pen.moveTo(...from);
      this.pen.lineTo(...to);
      this.pen.stroke();
    }

    dots(name, radius, colour, filled) {
      this.pen.fillStyle = this.pen.strokeStyle = colour;
      this.pen.lineWidth = 1.5;
      for (let k = 0; k < this.scene.count[name]; k++) {
        const at = this.place(name, k);
        if (!at) continue;
        this.pen.beginPath();
        this.pen.arc(...at, radius(k), 0, 2 * Math.PI);
        if (filled) this.pen.fill();
        else this.pen.stroke();
      }
    }

    arrows() {
      for (let k = 0; k < this.scene.count.arrows; k += 2) {
        const [from, to] = [this.place("arrows", k), this.place("arrows", k + 1)];
        this.line(from, to, COLOURS.arrows, 3);
        if (!from || !to) continue;
        const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
        for (const side of [2.7, -2.7]) {
          this.line(to, [to[0] + 9 * Math.cos(angle + side), to[1] + 9 * Math.sin(angle + side)], COLOURS.arrows, 3);
        }
      }
    }

    // lines every half metre that stay where they are while the person walks
    floor() {
      const first = (middle) => Math.ceil((middle - FLOOR_MM) / STEP_MM) * STEP_MM;
      const [cx, cz] = this.centre;
      for (let x = first(cx); x <= cx + FLOOR_MM; x += STEP_MM) {
        this.line(this.projected(x, 0, cz - FLOOR_MM), this.projected(x, 0, cz + FLOOR_MM), COLOURS.floor, 1);
      }
      for (let z = first(cz); z <= cz + FLOOR_MM; z += STEP_MM) {
        this.line(this.projected(cx - FLOOR_MM, 0, z), this.projected(cx + FLOOR_MM, 0, z), COLOURS.floor, 1);
      }
    }
  }

  document.querySelectorAll(".view").forEach((root) => new View(root));
})();
