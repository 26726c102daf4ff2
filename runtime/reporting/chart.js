// Two lines over time and their difference below, as SVG: drag, wheel or keys choose the span of time, buttons show or hide a line.

"use strict";

// the name space of SVG, which is written as an address: whoever looks for addresses in a report finds none
const SVG = Object.assign(document.createElement("template"), { innerHTML: "<svg></svg>" }).content.firstChild.namespaceURI;

function svgNode(tag, attributes, parent, text) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  if (parent) parent.append(node);
  return node;
}

function htmlNode(tag, properties, parent) {
  const node = Object.assign(document.createElement(tag), properties);
  if (parent) parent.append(node);
  return node;
}

/** Numbers of little-endian float32 in base64. */
function floats(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 4 }, (_, k) => view.getFloat32(4 * k, true));
}

class Chart {
  constructor(figure, data, group) {
    this.group = group;
    this.t = floats(data.t).map((x) => x + data.start);
    this.first = floats(data.first);
    this.second = floats(data.second);
    this.error = this.first.map((x, k) => x - this.second[k]);
    this.labels = { first: data.labels[0], second: data.labels[1], error: "error" };
    this.unit = data.unit;
    figure.classList.add("live");
    this.plot = htmlNode("div", { className: "plot", tabIndex: 0, role: "application" });
    this.plot.setAttribute("aria-label", `${figure.dataset.label}. Arrow keys move in time, plus and minus zoom, 0 shows all.`);
    this.readout = htmlNode("div", { className: "readout" });
    figure.prepend(this.plot, this.readout);
    this.listen();
    new ResizeObserver(() => this.draw()).observe(this.plot);
  }

  get shown() { return ["first", "second", "error"].filter((name) => !this.group.hidden.has(name)); }

  /** Smallest and largest of the lines in the span, with a margin. */
  extent(names) {
    const [a, b] = this.group.span;
    let low = Infinity, high = -Infinity;
    for (const name of names)
      for (let k = 0; k < this.t.length; k++) {
        const y = this[name][k];
        if (this.t[k] >= a && this.t[k] <= b && y === y) {
          if (y < low) low = y;
          if (y > high) high = y;
        }
      }
    if (low > high) return [-1, 1];
    const margin = 0.06 * (high - low) || 1;
    return [low - margin, high + margin];
  }

  draw() {
    const width = this.plot.clientWidth;
    if (!width) return;
    const upper = { top: 10, height: 170 }, lower = { top: 204, height: 84 };
    const names = this.shown, [a, b] = this.group.span;
    this.left = 52;
    this.width = Math.max(40, width - this.left - 10);
    const root = svgNode("svg", { viewBox: `0 0 ${width} 330`, height: 330, "aria-hidden": "true" });
    svgNode("rect", { x: this.left, y: 0, width: this.width, height: 300 }, svgNode("clipPath", { id: `clip${this.group.charts.indexOf(this)}` }, root));
    for (const [value, label] of ticks(a, b, Math.max(2, this.width / 60))) {
      const x = this.x(value);
      for (const panel of [upper, lower]) svgNode("line", { class: "grid", x1: x, x2: x, y1: panel.top, y2: panel.top + panel.height }, root);
      svgNode("text", { x, y: 304, "text-anchor": "middle" }, root, label);
    }
    svgNode("text", { x: this.left + this.width / 2, y: 322, "text-anchor": "middle" }, root, "time, s");
    this.panel(root, upper, names.filter((name) => name !== "error"), `torque, ${this.unit}`);
    this.panel(root, lower, names.filter((name) => name === "error"), `error, ${this.unit}`);
    this.plot.replaceChildren(root);
  }

  panel(root, { top, height }, names, title) {
    const [low, high] = this.extent(names), y = (value) => top + height * (high - value) / (high - low);
    for (const [value, label] of ticks(low, high, height / 34)) {
      svgNode("line", { class: Math.abs(value) < 1e-12 ? "zero" : "grid", x1: this.left, x2: this.left + this.width, y1: y(value), y2: y(value) }, root);
      svgNode("text", { x: this.left - 6, y: y(value) + 4, "text-anchor": "end" }, root, label);
    }
    svgNode("text", { x: 13, y: top + height / 2, "text-anchor": "middle", transform: `rotate(-90 13 ${top + height / 2})` }, root, title);
    const clip = `url(#clip${this.group.charts.indexOf(this)})`;
    for (const name of names) svgNode("path", { class: `line ${name}`, d: this.path(this[name], y), "clip-path": clip }, root);
  }

  /** The part of a line in the span with one point on either side of it. */
  path(values, y) {
    const [a, b] = this.group.span, t = this.t, parts = [];
    let pen = "M";
    for (let k = 0; k < t.length; k++) {
      if (t[k] !== t[k] || (t[k] < a && !(t[k + 1] >= a)) || (t[k] > b && !(t[k - 1] <= b))) {
        pen = "M";
        continue;
      }
      parts.push(`${pen}${this.x(t[k]).toFixed(1)} ${y(values[k]).toFixed(1)}`);
      pen = "L";
    }
    return parts.join("");
  }

  x(time) {
    const [a, b] = this.group.span;
    return this.left + this.width * (time - a) / (b - a);
  }

  /** Time under a pointer, s. */
  time(event) {
    const [a, b] = this.group.span, x = event.clientX - this.plot.getBoundingClientRect().left - this.plot.clientLeft;
    return a + (b - a) * Math.max(0, Math.min(1, (x - this.left) / this.width));
  }

  listen() {
    let start = null;
    this.plot.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      start = this.time(event);
      this.plot.focus({ preventScroll: true });
      this.plot.setPointerCapture(event.pointerId);
    });
    this.plot.addEventListener("pointermove", (event) => {
      const now = this.time(event);
      this.tell(now);
      if (start !== null) this.overlay("rect", { class: "chosen", x: Math.min(this.x(start), this.x(now)), width: Math.abs(this.x(now) - this.x(start)), y: 10, height: 278 });
    });
    this.plot.addEventListener("pointerup", (event) => {
      const end = this.time(event), from = start;
      start = null;
      this.overlay();
      if (from !== null && Math.abs(this.x(end) - this.x(from)) > 8) this.group.show(Math.min(from, end), Math.max(from, end));
    });
    for (const end of ["pointercancel", "pointerleave"]) this.plot.addEventListener(end, () => {
      if (end === "pointercancel") start = null;
      this.overlay();
      this.readout.textContent = "";
    });
    this.plot.addEventListener("dblclick", () => this.group.whole());
    this.plot.addEventListener("wheel", (event) => {
      if (document.activeElement !== this.plot && !event.ctrlKey) return;
      event.preventDefault();
      this.group.zoom(event.deltaY < 0 ? 0.8 : 1.25, this.time(event));
    }, { passive: false });
    this.plot.addEventListener("keydown", (event) => {
      if (!event.ctrlKey && !event.altKey && !event.metaKey && this.group.key(event.key)) event.preventDefault();
    });
  }

  /** Values at the instant nearest to `time`, and a line there. */
  tell(time) {
    let best = 0;
    for (let k = 1; k < this.t.length; k++) if (Math.abs(this.t[k] - time) < Math.abs(this.t[best] - time) || this.t[best] !== this.t[best]) best = k;
    const values = this.shown.map((name) => `${this.labels[name]} ${minus(this[name][best].toPrecision(4))}`);
    this.readout.textContent = `${this.t[best].toFixed(3)} s: ${values.join(", ")} ${this.unit}`;
    this.overlay("line", { class: "cursor", x1: this.x(this.t[best]), x2: this.x(this.t[best]), y1: 10, y2: 288 });
  }

  overlay(tag, attributes) {
    const root = this.plot.firstChild;
    for (const node of root.querySelectorAll(".chosen, .cursor")) node.remove();
    if (tag) svgNode(tag, attributes, root);
  }
}

/** The figures of one section: they show the same span of time and the same lines. */
class Group {
  constructor(box, data) {
    this.hidden = new Set();
    this.charts = [];
    const figures = [...box.querySelectorAll("figure[data-series]")];
    this.tools(box, data[figures[0].dataset.series]);
    for (const figure of figures) this.charts.push(new Chart(figure, data[figure.dataset.series], this));
    let low = Infinity, high = -Infinity;
    for (const chart of this.charts) for (const t of chart.t) if (t === t) [low, high] = [Math.min(low, t), Math.max(high, t)];
    this.all = low < high ? [low, high] : [low - 0.5, low + 0.5];
    this.whole();
  }

  tools(box, data) {
    const bar = htmlNode("div", { className: "tools", role: "toolbar" });
    bar.setAttribute("aria-label", "Span of time and lines of the figures");
    for (const [key, label, name] of [["+", "+", "Zoom in"], ["-", "−", "Zoom out"], ["ArrowLeft", "◀", "Earlier"], ["ArrowRight", "▶", "Later"], ["0", "all", "Show the whole time"]]) {
      const button = htmlNode("button", { type: "button", textContent: label, title: name }, bar);
      button.setAttribute("aria-label", name);
      button.addEventListener("click", () => this.key(key));
    }
    for (const [name, label] of [["first", data.labels[0]], ["second", data.labels[1]], ["error", "error"]]) {
      const button = htmlNode("button", { type: "button" }, bar);
      button.setAttribute("aria-pressed", "true");
      svgNode("line", { class: `line ${name}`, x1: 0, x2: 30, y1: 5, y2: 5 }, svgNode("svg", { viewBox: "0 0 30 10", "aria-hidden": "true" }, button));
      button.append(label);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(name)) this.hidden.add(name);
        button.setAttribute("aria-pressed", String(!this.hidden.has(name)));
        this.draw();
      });
    }
    htmlNode("span", { className: "hint", textContent: "Drag over a figure: zoom. Click, then wheel or + − ← → 0. All figures move together." }, bar);
    box.before(bar);
  }

  draw() {
    cancelAnimationFrame(this.asked);
    this.asked = requestAnimationFrame(() => this.charts.forEach((chart) => chart.draw()));
  }

  show(a, b) {
    const [low, high] = this.all, length = Math.min(Math.max(b - a, 1e-4 * (high - low)), high - low);
    const start = Math.max(low, Math.min(high - length, a));
    this.span = [start, start + length];
    this.draw();
  }

  whole() { this.show(...this.all); }

  zoom(factor, about) {
    const [a, b] = this.span, centre = about ?? (a + b) / 2;
    this.show(centre - factor * (centre - a), centre + factor * (b - centre));
  }

  key(name) {
    const [a, b] = this.span, step = (b - a) / 5;
    if (name === "+" || name === "=") this.zoom(0.7);
    else if (name === "-") this.zoom(1 / 0.7);
    else if (name === "ArrowLeft") this.show(a - step, b - step);
    else if (name === "ArrowRight") this.show(a + step, b + step);
    else if (name === "0" || name === "Home") this.whole();
    else return false;
    return true;
  }
}
