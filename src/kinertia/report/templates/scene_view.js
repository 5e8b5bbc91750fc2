"use strict";
// Plays a scene (scene.py) on a canvas: lines, dots, ellipses and arrows, seen by a camera that follows its centre.
(() => {
  const HIDDEN = -32768;
  const COLOURS = { measured: "#000000", modelled: "#009E73", com: "#B35900", arrows: "#009E73", floor: "#E4E4E4", plates: "#6B6B6B", labels: "#333333" };
  const STEP_MM = 500;
  const FLOOR_MM = 5000;
  const LEAST_ZOOM = 0.3;
  const MOST_ZOOM = 12;
  const AROUND = 1.06; // room around the body
  const DIRECTIONS = { front: [Math.PI / 2, 0], right: [0, 0], above: [0, Math.PI / 2], start: [-0.45, 0.16] };

  function unpacked(base64) {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Int16Array.from({ length: bytes.length / 2 }, (_, k) => view.getInt16(2 * k, true));
  }

  class View {
    constructor(root) {
      this.root = root;
      this.scenes = [...root.querySelectorAll("script")];
      this.canvas = root.querySelector("canvas");
      this.slider = root.querySelector("input[type=range]");
      this.playButton = root.querySelector("[data-do=play]");
      this.output = root.querySelector("output");
      this.speed = root.querySelector("select[data-set=speed]");
      this.trial = root.querySelector("select[data-set=trial]");
      this.playing = false;
      this.fingers = new Map();
      [this.yaw, this.pitch] = DIRECTIONS.start;
      this.home();
      this.open(0);
      this.listen();
      new ResizeObserver(() => this.resize()).observe(this.canvas);
      this.resize();
    }

    open(number) {
      this.scene = JSON.parse(this.scenes[number].textContent);
      this.data = Object.fromEntries(Object.entries(this.scene.data).map(([name, text]) => [name, unpacked(text)]));
      this.frame = 0;
      this.clock = this.scene.time[0];
      this.top = this.highest();
      this.aside = this.farthest();
      this.slider.max = this.scene.time.length - 1;
      this.slider.value = 0;
    }

    count(name) {
      return this.scene.count[name] ?? 0;
    }

    // mm, of any frame: the highest point, or what an ellipsoid has above it; one far off the body is none of a body
    highest() {
      const points = this.most(["points", "measured"], (part, at) => part[at + 1], 500);
      return this.most(["com"], (part, at, frame, k) => part[at + 1] + this.half(frame, k, [1]), points, 1.25 * points);
    }

    // mm, of any frame: how far from the vertical through the centre the body reaches
    farthest() {
      const { centre } = this.data;
      const away = (part, at, frame) => Math.hypot(part[at] - centre[3 * frame], part[at + 2] - centre[3 * frame + 2]);
      const points = this.most(["points", "modelled", "measured"], away, 0.25 * this.top, 0.75 * this.top);
      return this.most(["com"], (part, at, frame, k) => away(part, at, frame) + this.half(frame, k, [0, 2]), points, 0.75 * this.top);
    }

    // the largest of what is measured of the points of some parts, from `least` on and not beyond `limit`
    most(names, measured, least, limit = Infinity) {
      let most = least;
      for (const name of names) {
        const [part, count] = [this.data[name] ?? [], this.count(name)];
        for (let at = 0; at < part.length; at += 3) {
          if (part[at] === HIDDEN) continue;
          const number = at / 3;
          const value = measured(part, at, Math.floor(number / count), number % count);
          if (value > most && value <= limit) most = value;
        }
      }
      return most;
    }

    // half of what ellipsoid k measures in a frame along these axes
    half(frame, k, axes) {
      const part = this.data.ellipsoids;
      const first = 9 * (frame * this.count("com") + k);
      if (part[first] === HIDDEN) return 0;
      return Math.hypot(...[0, 3, 6].flatMap((row) => axes.map((axis) => part[first + row + axis])));
    }

    // as near as shows the whole body from this height in every frame
    home() {
      this.from = this.pitch;
      this.zoom = 1;
      this.shift = [0, 0];
    }

    listen() {
      const actions = {
        play: () => this.toggle(),
        left: () => this.turn(-0.2, 0),
        right: () => this.turn(0.2, 0),
        nearer: () => this.magnify(1.25),
        farther: () => this.magnify(0.8),
      };
      for (const button of this.root.querySelectorAll("button[data-do]")) {
        button.addEventListener("click", () => actions[button.dataset.do]());
      }
      for (const button of this.root.querySelectorAll("button[data-from]")) {
        button.addEventListener("click", () => this.face(button.dataset.from));
      }
      this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
      if (this.trial) {
        this.trial.addEventListener("change", () => {
          this.open(this.trial.selectedIndex);
          this.draw();
        });
      }
      this.root.querySelectorAll("[data-show]").forEach((box) => box.addEventListener("change", () => this.draw()));
      this.canvas.addEventListener("keydown", (event) => this.key(event));
      this.canvas.addEventListener("pointerdown", (event) => {
        this.canvas.setPointerCapture(event.pointerId);
        this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
      });
      this.canvas.addEventListener("pointermove", (event) => this.drag(event));
      for (const end of ["pointerup", "pointercancel"]) {
        this.canvas.addEventListener(end, (event) => this.fingers.delete(event.pointerId));
      }
      this.canvas.addEventListener("dblclick", () => this.face("start"));
      // without Ctrl the wheel scrolls the page, unless somebody works in the view
      this.canvas.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && document.activeElement !== this.canvas) return;
        event.preventDefault();
        this.magnify(Math.exp(-0.0015 * event.deltaY));
      }, { passive: false });
    }

    key(event) {
      const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      const last = this.scene.time.length - 1;
      const keys = {
        " ": () => this.toggle(),
        "+": () => this.magnify(1.25),
        "=": () => this.magnify(1.25),
        "-": () => this.magnify(0.8),
        0: () => this.face("start"),
        1: () => this.face("front"),
        2: () => this.face("right"),
        3: () => this.face("above"),
        ",": () => this.go(Math.max(this.frame - 1, 0)),
        ".": () => this.go(Math.min(this.frame + 1, last)),
        Home: () => this.go(0),
        End: () => this.go(last),
      };
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (arrows && event.shiftKey) this.move(-20 * arrows[0], 20 * arrows[1]);
      else if (arrows) this.turn(0.1 * arrows[0], 0.1 * arrows[1]);
      else if (keys[event.key]) keys[event.key]();
      else return;
      event.preventDefault();
    }

    // one finger or the mouse turns (with Shift it moves), two fingers magnify and move
    drag(event) {
      const before = this.fingers.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY];
      const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)?.[1];
      this.fingers.set(event.pointerId, now);
      if (other) {
        const apart = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]) || 1;
        this.move(dx / 2, dy / 2);
        this.magnify(apart(now) / apart(before));
      } else if (event.shiftKey) this.move(dx, dy);
      else this.turn(dx * 0.008, dy * 0.005);
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
      this.pitch = Math.min(Math.PI / 2, Math.max(-0.3, this.pitch + pitch));
      this.draw();
    }

    face(direction) {
      [this.yaw, this.pitch] = DIRECTIONS[direction];
      this.home();
      this.draw();
    }

    magnify(factor) {
      const zoom = Math.min(MOST_ZOOM, Math.max(LEAST_ZOOM, this.zoom * factor));
      this.shift = this.shift.map((px) => (px * zoom) / this.zoom);
      this.zoom = zoom;
      this.draw();
    }

    move(dx, dy) {
      this.shift = [this.shift[0] + dx, this.shift[1] + dy];
      this.draw();
    }

    // components of a vector to the right of the picture and upwards in it
    seen(x, y, z) {
      const near = z * Math.cos(this.yaw) - x * Math.sin(this.yaw);
      return [x * Math.cos(this.yaw) + z * Math.sin(this.yaw), y * Math.cos(this.pitch) - near * Math.sin(this.pitch)];
    }

    // seen from the person's right at yaw 0; the scene's centre is in the middle of the canvas
    projected(x, y, z) {
      const [right, up] = this.seen(x - this.centre[0], y - 0.5 * this.top, z - this.centre[1]);
      return [this.width / 2 + this.shift[0] + right * this.scale, this.tall / 2 + this.shift[1] - up * this.scale];
    }

    // where point k of a part of the scene is on the canvas; null where it is not seen
    place(name, k) {
      const part = this.data[name];
      const at = 3 * ((name === "plates" ? 0 : this.frame * this.count(name)) + k);
      return part[at] === HIDDEN ? null : this.projected(part[at], part[at + 1], part[at + 2]);
    }

    draw() {
      if (!this.pen || !this.width) return;
      const root = 3 * this.frame;
      this.centre = [this.data.centre[root], this.data.centre[root + 2]];
      const deep = this.aside * Math.abs(Math.sin(this.from)); // feet reach as far, the head does not
      const high = Math.max(this.top * Math.cos(this.from) + deep, 2 * deep);
      this.scale = (this.zoom * Math.min(this.tall / high, this.width / (2 * this.aside))) / AROUND;
      this.pen.clearRect(0, 0, this.width, this.tall);
      this.pen.lineCap = "round";
      this.floor();
      const shown = (name) => this.count(name === "labels" ? "measured" : name) && this.root.querySelector(`[data-show=${name}]`)?.checked;
      if (shown("plates")) this.plates();
      if (shown("ellipsoids")) this.ellipsoids();
      if (shown("arrows")) this.arrows();
      this.scene.bones.forEach(([from, to], k) =>
        this.line(this.place("points", from), this.place("points", to), this.scene.colours[k], 4));
      if (shown("modelled")) this.dots("modelled", 4, COLOURS.modelled, false);
      if (shown("measured")) this.dots("measured", 2.2, COLOURS.measured, true);
      if (shown("com")) this.centres();
      if (shown("labels")) this.labels();
      const time = this.scene.time[this.frame];
      this.output.textContent = `${time.toFixed(3)} s`;
      this.slider.setAttribute("aria-valuetext", `${time.toFixed(3)} s`);
      this.canvas.dataset.frame = this.frame;
      this.canvas.dataset.zoom = this.zoom.toFixed(3);
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
      for (let k = 0; k < this.count(name); k++) {
        const at = this.place(name, k);
        if (!at) continue;
        this.pen.beginPath();
        this.pen.arc(...at, radius, 0, 2 * Math.PI);
        if (filled) this.pen.fill();
        else this.pen.stroke();
      }
    }

    centres() {
      for (let k = 0; k < this.count("com"); k++) {
        this.line(this.place("com_before", k), this.place("com", k), COLOURS.com, 1.5);
      }
      this.dots("com_before", 5, COLOURS.com, false);
      this.dots("com", 4.5, COLOURS.com, true);
    }

    labels() {
      this.pen.fillStyle = COLOURS.labels;
      this.pen.font = "11px system-ui, sans-serif";
      this.scene.labels.forEach((label, k) => {
        const at = this.place("measured", k);
        if (at) this.pen.fillText(label, at[0] + 5, at[1] - 4);
      });
    }

    // an ellipsoid seen from far away is an ellipse: its shape is that of the semi-axes as they are seen
    ellipsoids() {
      const part = this.data.ellipsoids;
      for (let k = 0; k < this.count("com"); k++) {
        const at = this.place("com", k);
        const first = 9 * (this.frame * this.count("com") + k);
        if (!at || part[first] === HIDDEN) continue;
        let [xx, xy, yy] = [0, 0, 0];
        for (let axis = first; axis < first + 9; axis += 3) {
          const [right, up] = this.seen(part[axis], part[axis + 1], part[axis + 2]);
          xx += right * right;
          xy -= right * up;
          yy += up * up;
        }
        const middle = (xx + yy) / 2;
        const half = Math.hypot((xx - yy) / 2, xy);
        const [long, short] = [Math.sqrt(middle + half), Math.sqrt(Math.max(middle - half, 0))];
        this.pen.beginPath();
        this.pen.ellipse(...at, long * this.scale, short * this.scale, Math.atan2(2 * xy, xx - yy) / 2, 0, 2 * Math.PI);
        this.pen.fillStyle = this.pen.strokeStyle = this.scene.body_colours[k];
        this.pen.globalAlpha = 0.12;
        this.pen.fill();
        this.pen.globalAlpha = 0.45;
        this.pen.lineWidth = 1;
        this.pen.stroke();
        this.pen.globalAlpha = 1;
      }
    }

    plates() {
      for (let k = 0; k < this.count("plates"); k += 4) {
        const corners = [0, 1, 2, 3].map((c) => this.place("plates", k + c));
        if (corners.some((corner) => !corner)) continue;
        this.pen.beginPath();
        corners.forEach((corner, c) => (c ? this.pen.lineTo(...corner) : this.pen.moveTo(...corner)));
        this.pen.closePath();
        this.pen.fillStyle = "rgba(107,107,107,0.14)";
        this.pen.fill();
        this.pen.strokeStyle = COLOURS.plates;
        this.pen.lineWidth = 1.5;
        this.pen.stroke();
      }
    }

    arrows() {
      for (let k = 0; k < this.count("arrows"); k += 2) {
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
