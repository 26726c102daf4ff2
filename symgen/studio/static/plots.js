// Lines over time, or over position, as SVG with one cursor for all panels. The name space is that of drawing.js.
"use strict";
const one = (selector, of = document) => of.querySelector(selector), all = (selector, of = document) => [...of.querySelectorAll(selector)];
const node = (tag, properties, ...inside) => { const made = Object.assign(document.createElement(tag), properties); made.append(...inside); return made; };
const [PLOT_WIDTH, PLOT_HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [640, 150, 54, 8, 22, 20];

/** Number of the instant next to t; the instants rise. */
function nearest(t, at) {
  let low = 0, high = t.length - 1;
  while (high - low > 1) {
    const k = (low + high) >> 1;
    if (t[k] <= at) low = k; else high = k;
  }
  return Math.abs(t[high] - at) < Math.abs(t[low] - at) ? high : low;
}

function extent(rows) {
  const values = rows.flat().filter((x) => x !== null && Number.isFinite(x));
  const low = Math.min(...values), high = Math.max(...values), margin = 0.05 * (high - low) || 1;
  return values.length ? [low - margin, high + margin] : [-1, 1];
}

class Plots {
  constructor(place, t, panels, moved) {
    Object.assign(this, { t, panels, cursors: [] });
    place.replaceChildren(...panels.filter((panel) => Object.keys(panel.lines).length).map((panel) => this.panel(panel)));
    this.moved = moved || ((at) => this.at(at));
    if (t.length) this.at(t[0]);
  }

  panel({ title, lines, over }) {
    const names = Object.keys(lines), rows = Object.values(lines), axis = over || this.t;
    const [x0, x1] = over ? extent([over]) : [this.t[0], this.t.at(-1)], [y0, y1] = extent(rows);
    const x = (v) => LEFT + ((v - x0) / (x1 - x0 || 1)) * (PLOT_WIDTH - LEFT - RIGHT);
    const y = (v) => PLOT_HEIGHT - BOTTOM - ((v - y0) / (y1 - y0)) * (PLOT_HEIGHT - TOP - BOTTOM);
    const root = svg("svg", { viewBox: `0 0 ${PLOT_WIDTH} ${PLOT_HEIGHT}`, role: "img", "aria-label": `${title}: ${names.join(", ")}` });
    root.append(svg("text", { x: LEFT, y: 13, class: "title" }, title));
    let right = PLOT_WIDTH - RIGHT;
    for (const [i, name] of [...names.entries()].slice(0, 8).reverse()) {
      if (right > 260) root.append(svg("text", { x: right, y: 13, class: `legend c${i}`, "text-anchor": "end" }, name.slice(0, 24)));
      right -= 7.4 * Math.min(name.length, 24) + 12;
    }
    for (const [v, label] of ticks(y0, y1, 4)) {
      root.append(svg("line", { x1: LEFT, x2: PLOT_WIDTH - RIGHT, y1: y(v), y2: y(v), class: "tick" }));
      root.append(svg("text", { x: LEFT - 5, y: y(v) + 4, "text-anchor": "end" }, label));
    }
    for (const [v, label] of x1 > x0 ? ticks(x0, x1, 8) : [[x0, String(x0)]]) {
      root.append(svg("line", { x1: x(v), x2: x(v), y1: TOP, y2: PLOT_HEIGHT - BOTTOM, class: "tick" }));
      root.append(svg("text", { x: x(v), y: PLOT_HEIGHT - 5, "text-anchor": "middle" }, label));
    }
    rows.forEach((row, i) => {
      let path = "", pen = "M";
      row.forEach((v, k) => {
        if (v === null || axis[k] === null) { pen = "M"; return; }
        path += `${pen}${x(axis[k]).toFixed(1)},${y(v).toFixed(1)}`;
        pen = "L";
      });
      root.append(svg("path", { d: path, class: `line c${i % 8}` }));
    });
    const mark = over ? svg("circle", { r: 4, class: "cursor" }) : svg("line", { y1: TOP, y2: PLOT_HEIGHT - BOTTOM, class: "cursor" });
    root.append(mark);
    this.cursors.push((k) => {
      if (over && rows[0][k] !== null) { mark.setAttribute("cx", x(over[k])); mark.setAttribute("cy", y(rows[0][k])); }
      if (over) return;
      for (const name of ["x1", "x2"]) mark.setAttribute(name, x(this.t[k]));
    });
    if (!over) root.addEventListener("pointermove", (event) => {
      const box = root.getBoundingClientRect(), share = ((event.clientX - box.left) / box.width) * PLOT_WIDTH;
      this.moved(x0 + ((share - LEFT) / (PLOT_WIDTH - LEFT - RIGHT)) * (x1 - x0));
    });
    return root;
  }

  at(t) {
    const k = nearest(this.t, t);
    for (const cursor of this.cursors) cursor(k);
  }
}
