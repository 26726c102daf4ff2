// Figures of lines over time as SVG, panels one below the other: drag, wheel or keys choose the span of time, buttons show or hide a line, one cursor marks an instant in all figures.

"use strict";

// the name space of SVG, which is written as an address: whoever looks for addresses in a report finds none
const SPACE = Object.assign(document.createElement("template"), { innerHTML: "<svg></svg>" }).content.firstChild.namespaceURI;
const [GAP, BELOW] = [24, 42], NARROW = matchMedia("(max-width: 40rem)"); // there titles are above their panels

function svgNode(tag, attributes, ...inside) {
  const made = document.createElementNS(SPACE, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...inside);
  return made;
}

function node(tag, properties, ...inside) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...inside);
  return made;
}

const minus = (text) => (Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−"));

/** Round numbers between two, with their labels: steps of 1, 2 or 5 times a power of ten, about `count` of them and at least two. */
function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  if (found.length < 2) return ticks(low, high, 2 * count);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return found.map((value) => [value, minus(value.toFixed(digits))]);
}

/** Numbers of little-endian floats in base64. */
function floats(text, Kind = Float32Array) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  return new Kind(bytes.buffer);
}

/** Panels of one joint: predicted over measured torque, and their difference. */
function torques(measured, predicted, unit, source = "measured") {
  const error = measured.map((x, k) => x - predicted[k]);
  const lines = [{ name: source, kind: "measured", values: measured }, { name: "predicted", kind: "predicted", values: predicted }];
  return [{ title: "torque", unit, lines }, { title: "error", unit, lines: [{ name: "error", kind: "error", values: error }] }];
}

const titled = (title, unit) => (unit ? `${title}, ${unit}` : title);

/** A figure: panels {title, unit, lines {name, kind, values}} over the instants t, or over the quantity `over` {title, unit, values} at these instants. */
class Chart {
  constructor(group, figure, { label, t, over, panels }) {
    Object.assign(this, { group, t, over, panels, across: over ? over.values : t });
    this.plot = node("div", { className: "plot", tabIndex: 0, role: "application", ariaLabel: `${label}. Arrow keys move in time, plus and minus zoom, 0 shows all.` });
    this.readout = node("div", { className: "readout" });
    figure.classList.add("live");
    figure.append(this.plot, ...(over ? [] : [this.readout])); // the values are those of the figure over time
    if (!over) this.follow();
    this.listen();
    new ResizeObserver(() => this.draw()).observe(this.plot);
  }

  /** Smallest and largest of some values at the instants kept, with a margin. */
  extent(rows) {
    let low = Infinity, high = -Infinity;
    for (const values of rows)
      for (const k of this.kept) {
        if (values[k] < low) low = values[k];
        if (values[k] > high) high = values[k];
      }
    if (low > high) return [-1, 1];
    const margin = 0.06 * (high - low) || 1;
    return [low - margin, high + margin];
  }

  draw() {
    const width = this.plot.clientWidth, [a, b] = this.group.span, t = this.t;
    if (!width) return;
    this.kept = [];
    for (let k = 0; k < t.length; k++) if (t[k] === t[k] && (t[k] < a ? t[k + 1] >= a : t[k] <= b || t[k - 1] <= b)) this.kept.push(k); // one more on either side
    [this.left, this.top] = NARROW.matches ? [50, GAP] : [60, 10];
    this.width = Math.max(40, width - this.left - 10);
    this.span = this.over ? this.extent([this.across]) : [a, b];
    this.drawn = [];
    const root = svgNode("g", { transform: `translate(${this.left} 0)` }), from = this.over ? 0 : this.group.origin;
    const places = ticks(this.span[0] - from, this.span[1] - from, Math.max(2, this.width / 60)).map(([value, label]) => [value + from, label]);
    let top = this.top;
    for (const [k, panel] of this.panels.entries()) {
      this.panel(root, panel, top, k ? 84 : 170, places);
      top += (k ? 84 : 170) + GAP;
    }
    this.bottom = top - GAP;
    for (const [value, label] of places) root.append(svgNode("text", { x: this.x(value), y: this.bottom + 16, "text-anchor": "middle" }, label));
    const title = this.over ? titled(this.over.title, this.over.unit) : this.group.unit ? `time, ${this.group.unit}${from ? ` after ${from.toFixed(3)}` : ""}` : "sample";
    this.marks = svgNode("svg", { width: this.width, height: this.bottom });
    root.append(svgNode("text", { x: this.width / 2, y: this.bottom + 34, "text-anchor": "middle" }, title), this.marks);
    const height = this.bottom + BELOW;
    this.plot.replaceChildren(svgNode("svg", { viewBox: `0 0 ${width} ${height}`, height, "aria-hidden": "true" }, root));
    this.mark();
  }

  panel(root, panel, top, height, places) {
    const lines = panel.lines.filter(({ name }) => !this.group.hidden.has(name)), [low, high] = this.extent(lines.map(({ values }) => values));
    const y = (value) => height * (high - value) / (high - low), inside = svgNode("svg", { y: top, width: this.width, height });
    for (const [value] of places) inside.append(svgNode("line", { class: "grid", x1: this.x(value), x2: this.x(value), y2: height }));
    for (const [value, label] of ticks(low, high, height / 34)) {
      inside.append(svgNode("line", { class: Math.abs(value) < 1e-12 ? "zero" : "grid", x2: this.width, y1: y(value), y2: y(value) }));
      root.append(svgNode("text", { x: -6, y: top + y(value) + 4, "text-anchor": "end" }, label));
    }
    for (const { kind, values } of lines) inside.append(svgNode("path", { class: `line ${kind}`, d: this.path(values, y) }));
    const place = NARROW.matches ? { y: top - 8 } : { "text-anchor": "middle", transform: `translate(-48 ${top + height / 2}) rotate(-90)` };
    root.append(inside, svgNode("text", place, titled(panel.title, panel.unit)));
    this.drawn.push({ lines, unit: panel.unit, digits: Math.max(0, Math.min(12, 4 - Math.floor(Math.log10(high - low)))), y: (value) => top + y(value) });
  }

  /** A line through the instants kept; it breaks where an instant or a value is missing. */
  path(values, y) {
    const text = [], joined = (k, last) => last === k - 1, point = (mark, k) => text.push(`${mark}${this.x(this.across[k]).toFixed(1)} ${y(values[k]).toFixed(1)}`);
    const known = this.kept.filter((k) => this.across[k] === this.across[k] && values[k] === values[k]);
    if (this.over) this.strokes(known, (k) => `${this.x(this.across[k]).toFixed(0)} ${y(values[k]).toFixed(0)}`, joined, point);
    else this.columns(known, values, joined, point);
    return text.join("");
  }

  /** Of the instants in one column of pixels: the first, the smallest, the largest and the last, in their order. */
  columns(known, values, joined, point) {
    for (let i = 0; i < known.length;) {
      const first = known[i], pixel = Math.floor(this.x(this.across[first]));
      let [low, high, last] = [first, first, first];
      point(joined(first, known[i - 1]) ? "L" : "M", first);
      for (i++; i < known.length && joined(known[i], last) && Math.floor(this.x(this.across[known[i]])) === pixel; i++) {
        last = known[i];
        if (values[last] < values[low]) low = last;
        if (values[last] > values[high]) high = last;
      }
      for (const k of new Set(low < high ? [low, high, last] : [high, low, last])) if (k !== first) point("L", k);
    }
  }

  /** Strokes from pixel to pixel, each drawn once. */
  strokes(known, cell, joined, point) {
    const drawn = new Set();
    let pen = "", before = "", last = NaN;
    for (const k of known) {
      const now = cell(k), stroke = `${before}:${now}`;
      if (joined(k, last) && now !== before && !drawn.has(stroke)) {
        if (pen !== before) point("M", last);
        point("L", k);
        pen = now;
        drawn.add(stroke);
      }
      [before, last] = [now, k];
    }
  }

  x(value) { return this.width * (value - this.span[0]) / (this.span[1] - this.span[0]); }

  /** Time under a pointer, s. */
  time(event) {
    const [a, b] = this.group.span, x = event.clientX - this.plot.getBoundingClientRect().left - this.plot.clientLeft;
    return a + (b - a) * Math.max(0, Math.min(1, (x - this.left) / this.width));
  }

  /** The pointer moves the cursor, and chooses a span of time by a drag. */
  follow() {
    let start = null;
    this.plot.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      start = this.time(event);
      this.plot.focus({ preventScroll: true });
      this.plot.setPointerCapture(event.pointerId);
    });
    this.plot.addEventListener("pointermove", (event) => {
      const now = this.time(event);
      this.group.moved(now);
      if (start !== null) this.marks.append(svgNode("rect", { class: "chosen", x: Math.min(this.x(start), this.x(now)), width: Math.abs(this.x(now) - this.x(start)), y: this.top, height: this.bottom - this.top }));
    });
    this.plot.addEventListener("pointerup", (event) => {
      const end = this.time(event), from = start;
      start = null;
      this.mark();
      if (from !== null && Math.abs(this.x(end) - this.x(from)) > 8) this.group.show(Math.min(from, end), Math.max(from, end));
    });
    this.plot.addEventListener("pointercancel", () => { start = null; this.mark(); });
  }

  listen() {
    this.plot.addEventListener("dblclick", () => this.group.whole());
    this.plot.addEventListener("wheel", (event) => {
      if (document.activeElement !== this.plot && !event.ctrlKey) return;
      event.preventDefault();
      this.group.zoom(event.deltaY < 0 ? 0.8 : 1.25, this.over ? undefined : this.time(event));
    }, { passive: false });
    this.plot.addEventListener("keydown", (event) => {
      if (!event.ctrlKey && !event.altKey && !event.metaKey && this.group.key(event.key)) event.preventDefault();
    });
  }

  /** Mark the instant next to a time, and write the values there. */
  at(time) {
    this.k = this.group.nearest(this.t, time);
    this.mark();
  }

  mark() {
    if (this.k === undefined || !this.marks) return;
    const k = this.k, x = this.x(this.across[k]), { unit } = this.group, known = (value) => value === value, said = [];
    this.marks.replaceChildren(...(known(x) ? [svgNode("line", { class: "cursor", x1: x, x2: x, y1: this.top, y2: this.bottom })] : []));
    for (const { lines, unit, digits, y } of this.drawn.filter(({ lines }) => lines.length)) {
      for (const { values } of lines) if (known(x + values[k])) this.marks.append(svgNode("circle", { class: "cursor", r: 3, cx: x, cy: y(values[k]) }));
      const numbers = lines.map(({ name, values }) => `${name} ${known(values[k]) ? minus(values[k].toFixed(digits)) : "–"}`);
      said.push(`${numbers.join(", ")} ${unit}`.trim());
    }
    this.readout.textContent = `${unit ? `${(this.t[k] - this.group.origin).toFixed(3)} ${unit}` : `sample ${this.t[k]}`}: ${said.join("; ")}`;
  }
}

/** The figures of one box: they show the same span of time, the same instant and the same lines. A chart without a figure gets one. `moved` is called when the pointer moves the cursor. */
class Group {
  constructor(box, charts, { unit = "s", moved = (time) => this.at(time) } = {}) {
    Object.assign(this, { unit, moved, hidden: new Set() });
    this.tools(box, charts);
    this.charts = charts.map((chart) => new Chart(this, chart.figure ?? box.appendChild(node("figure", {}, node("figcaption", { textContent: chart.label }))), chart));
    let low = Infinity, high = -Infinity;
    for (const { t } of this.charts) for (const x of t) { if (x < low) low = x; if (x > high) high = x; }
    this.all = low < high ? [low, high] : low === high ? [low - 0.5, low + 0.5] : [0, 1];
    this.origin = Math.abs(low) >= 1e5 && low < high ? low : 0; // of stamps that count from 1970
    this.whole();
  }

  tools(box, charts) {
    const bar = node("div", { className: "tools", role: "toolbar", ariaLabel: "Span of time and lines of the figures" });
    for (const [key, label, name] of [["+", "+", "Zoom in"], ["-", "−", "Zoom out"], ["ArrowLeft", "◀", "Earlier"], ["ArrowRight", "▶", "Later"], ["0", "all", "all: show the whole time"]]) {
      const button = node("button", { type: "button", textContent: label, title: name, ariaLabel: name });
      button.addEventListener("click", () => this.key(key));
      bar.append(button);
    }
    const kinds = new Map(charts.flatMap(({ panels }) => panels.flatMap(({ lines }) => lines.map(({ name, kind }) => [name, kind]))));
    for (const [name, kind] of kinds) {
      const sample = svgNode("svg", { viewBox: "0 0 30 10", "aria-hidden": "true" }, svgNode("line", { class: `line ${kind}`, x2: 30, y1: 5, y2: 5 }));
      const button = node("button", { type: "button", ariaPressed: "true" }, sample, name);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(name)) this.hidden.add(name);
        button.ariaPressed = String(!this.hidden.has(name));
        this.draw();
      });
      bar.append(button);
    }
    bar.append(node("span", { className: "hint", textContent: "Drag over a figure: zoom. Click, then wheel or + − ← → 0. All figures move together." }));
    box.before(bar);
  }

  /** The instant of `t` next to a time; charts of one record share `t`. */
  nearest(t, time) {
    if (this.found?.t !== t || this.found.time !== time) {
      let least = Infinity, at = 0;
      for (let k = 0; k < t.length; k++) if (Math.abs(t[k] - time) < least) [least, at] = [Math.abs(t[k] - time), k];
      this.found = { t, time, at };
    }
    return this.found.at;
  }

  at(time) { for (const chart of this.charts) chart.at(time); }

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
