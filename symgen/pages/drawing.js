// The drawing: an orthographic view of the skeleton as SVG, painted from back to front. View coordinates: right, down, toward the eye.

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 620, HEIGHT = 420, MARGIN = 46;

function svg(tag, attributes, text) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

class Drawing {
  constructor(robot, pose) {
    this.robot = robot;
    this.root = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, "aria-hidden": "true" });
    this.options = { y: false, names: true, boxes: false };
    this.marked = null;
    const g = norm(robot.gravity);
    this.up = g > 0 ? robot.gravity.map((x) => -x / g) : [0, 0, 1]; // up in the picture is against gravity
    const side = Math.abs(this.up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
    this.east = along(side, this.up, -dot(side, this.up));
    this.east = this.east.map((x) => x / norm(this.east));
    this.north = cross(this.up, this.east);
    const points = pose.flatMap((T) => T.corners || [T.p]);
    const low = [0, 1, 2].map((k) => Math.min(...points.map((p) => p[k])));
    const high = [0, 1, 2].map((k) => Math.max(...points.map((p) => p[k])));
    this.centre = sum(low, high, 0.5, 0.5);
    this.size = norm(along(high, low, -1)) || 1;
    this.rank = crowding(pose, this.size);
    this.flat = pose.every((T) => Math.abs(Math.abs(dot(T.z, pose[1].z)) - 1) < 1e-9) ? pose[1].z : null;
    this.startAgain();
  }

  startAgain() {
    // a planar mechanism is seen from its axes, a little aslant
    const sideways = this.flat && Math.abs(dot(this.flat, this.up)) < 0.5;
    this.yaw = sideways ? Math.atan2(dot(this.flat, this.east), -dot(this.flat, this.north)) + 0.35 : -0.65;
    this.pitch = sideways ? 0.25 : 0.42;
    this.scale = (Math.min(WIDTH, HEIGHT) - 2 * MARGIN) / (1.15 * this.size);
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, this.pitch + pitch));
  }

  /** A point of frame 0 in the picture. */
  project(p) {
    const v = along(p, this.centre, -1);
    const [e, n, u] = [dot(v, this.east), dot(v, this.north), dot(v, this.up)];
    const [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const [right, away] = [c * e + s * n, -s * e + c * n];
    const [cp, sp] = [Math.cos(this.pitch), Math.sin(this.pitch)];
    return [WIDTH / 2 + this.scale * right, HEIGHT / 2 - this.scale * (cp * u + sp * away), sp * u - cp * away];
  }

  draw(pose) {
    this.fit(pose);
    this.items = [];
    const L = this.size * 0.15;
    this.arrows = [];
    this.frameAxes(0, BASE);
    for (const f of this.robot.frames) {
      const T = pose[f.j];
      this.way(f, T);
      if (f.sigma !== 2) this.joint(f, T, L);
      this.frameAxes(f.j, T);
    }
    for (const arrow of this.arrows) this.arrow(arrow, L);
    if (this.options.boxes) for (const box of this.robot.boxes) this.box(box, pose[box.link]);
    this.items.sort((a, b) => a.depth - b.depth);
    this.root.replaceChildren(...this.ground(), ...this.items.map((item) => item.node), ...this.gravityArrow());
  }

  /** Zoom out where a joint, or the box of a body, would leave the picture. */
  fit(pose) {
    const bodies = this.options.boxes ? this.robot.boxes.flatMap((box) => corners(box, pose[box.link])) : [];
    for (const p of [...pose.map((T) => T.p), ...bodies]) {
      const [x, y] = this.project(p);
      const over = Math.max(Math.abs(x - WIDTH / 2) / (WIDTH / 2 - MARGIN), Math.abs(y - HEIGHT / 2) / (HEIGHT / 2 - MARGIN));
      if (over > 1 && !this.near) this.scale /= over;
    }
  }

  add(depth, node) {
    this.items.push({ depth, node });
  }

  named(kind, link) {
    return { class: kind + (link === this.marked ? " marked" : ""), "data-link": link };
  }

  line(a, b, attributes, lift = 0) {
    const [p, q] = [this.project(a), this.project(b)];
    const node = svg("line", { x1: p[0].toFixed(2), y1: p[1].toFixed(2), x2: q[0].toFixed(2), y2: q[1].toFixed(2), ...attributes });
    this.add((p[2] + q[2]) / 2 + lift, node);
    return [p, q];
  }

  /** Link i from O_i to O_j along b, d and r; the rod of a prismatic joint belongs to link j. */
  way(f, T) {
    const [start, atB, atD, end] = T.corners;
    for (const [a, b, last] of [[start, atB, false], [atB, atD, false], [atD, end, true]]) {
      const slides = last && f.sigma === 1;
      if (norm(along(a, b, -1)) > 1e-9 * this.size) this.line(a, b, this.named(slides ? "link slide" : "link", slides ? f.j : f.ant));
    }
  }

  /** A cylinder along z for a revolute joint, a box for a prismatic one; the axis through it. */
  joint(f, T, L) {
    const crowd = 1 - 0.16 * Math.min(this.rank[f.j], 3);
    const [radius, half] = f.sigma === 0 ? [0.2 * L * crowd, 0.36 * L * crowd] : [0.24 * L, 0.4 * L];
    const sides = f.sigma === 0 ? 28 : 4;
    const rim = (z) => Array.from({ length: sides }, (_, k) => {
      const a = (2 * Math.PI * (k + 0.5)) / sides;
      return this.project(along(along(along(T.p, T.z, z), T.x, radius * Math.cos(a)), T.y, radius * Math.sin(a)));
    });
    const [bottom, top] = [rim(-half), rim(half)];
    const path = (points) => points.map((p) => `${p[0].toFixed(2)},${p[1].toFixed(2)}`).join(" ");
    const depth = this.project(T.p)[2];
    this.add(depth, svg("polygon", { points: path(hull([...bottom, ...top])), ...this.named("body", f.j) }));
    const front = top[0][2] > bottom[0][2] ? top : bottom;
    this.add(depth + 1e-6, svg("polygon", { points: path(front), ...this.named("cap", f.j) }));
    const reach = L * 1.6;
    this.line(along(T.p, T.z, -reach), along(T.p, T.z, reach), { class: "axis" }, -0.01 * L);
  }

  /** The homogeneous box with mass and inertia of a link: the faces that look at the eye. */
  box({ link, centre, axes, sides }, T) {
    const [p, halves] = placed({ centre, axes, sides }, T);
    for (const k of [0, 1, 2]) {
      const [u, v] = [halves[(k + 1) % 3], halves[(k + 2) % 3]], toward = this.project(sum(p, halves[k], 1, 1))[2] < this.project(sum(p, halves[k], 1, -1))[2] ? -1 : 1;
      const middle = sum(p, halves[k], 1, toward), corner = (a, b) => this.project(along(along(middle, u, a), v, b));
      const points = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)].map((c) => `${c[0].toFixed(2)},${c[1].toFixed(2)}`).join(" ");
      this.add(this.project(middle)[2], svg("polygon", { points, ...this.named("mass", link) }));
    }
  }

  /** Axes x and z (y on demand). One arrow for axes that coincide, x4 x5 x6; a longer one where an axis of another letter lies below. */
  frameAxes(j, T) {
    for (const k of this.options.y ? ["x", "y", "z"] : ["x", "z"]) {
      const there = this.arrows.filter((a) => norm(along(a.p, T.p, -1)) < 1e-6 * this.size && norm(along(a.v, T[k], -1)) < 1e-6);
      const same = there.find((a) => a.k === k);
      if (same) same.numbers.push(j);
      else this.arrows.push({ k, p: T.p, v: T[k], numbers: [j], above: there.length });
    }
  }

  arrow({ k, p, v, numbers, above }, L) {
    const [from, to] = this.line(p, along(p, v, L * (1 + 0.6 * above)), { class: `arrow ${k}` }, 0.02 * L);
    this.head(from, to, k);
    if (this.options.names) this.name(k, numbers.join(","), from, to);
  }

  head(p, q, kind) {
    const [dx, dy] = [q[0] - p[0], q[1] - p[1]], length = Math.hypot(dx, dy);
    if (length < 4) return;
    const [ux, uy] = [(dx / length) * 9, (dy / length) * 9];
    const points = [[q[0], q[1]], [q[0] - ux - uy * 0.4, q[1] - uy + ux * 0.4], [q[0] - ux + uy * 0.4, q[1] - uy - ux * 0.4]];
    this.add(q[2] + 0.02 * this.size, svg("polygon", { points: points.map((c) => c.map((v) => v.toFixed(2)).join(",")).join(" "), class: `tip ${kind}` }));
  }

  name(k, numbers, p, q) {
    const length = Math.hypot(q[0] - p[0], q[1] - p[1]) || 1;
    const at = [q[0] + ((q[0] - p[0]) / length) * (11 + 3 * numbers.length), q[1] + ((q[1] - p[1]) / length) * 12 + 5];
    const text = svg("text", { x: at[0].toFixed(2), y: at[1].toFixed(2), class: k, "text-anchor": "middle" });
    text.append(svg("tspan", {}, k), svg("tspan", { dy: 4, "font-size": 11 }, numbers));
    this.add(1e9, text);
  }

  ground() {
    const lines = [], step = this.size / 8, half = 4;
    const at = (e, n) => this.project(along(along([0, 0, 0], this.east, e * step), this.north, n * step));
    for (let k = -half; k <= half; k++)
      for (const [a, b] of [[at(k, -half), at(k, half)], [at(-half, k), at(half, k)]])
        lines.push(svg("line", { x1: a[0].toFixed(1), y1: a[1].toFixed(1), x2: b[0].toFixed(1), y2: b[1].toFixed(1), class: "grid" }));
    return lines;
  }

  gravityArrow() {
    if (!norm(this.robot.gravity)) return [];
    const down = Math.cos(this.pitch) * 34;
    return [
      svg("line", { x1: 24, y1: HEIGHT - 56, x2: 24, y2: (HEIGHT - 56 + down).toFixed(1), class: "arrow g" }),
      svg("text", { x: 34, y: HEIGHT - 38, class: "g" }, "gravity ↓"),
    ];
  }
}

/** Centre of a box in frame 0, and half of each of its sides as a vector there. */
function placed({ centre, axes, sides }, T) {
  const turned = (v) => along(along(along([0, 0, 0], T.x, v[0]), T.y, v[1]), T.z, v[2]);
  return [sum(T.p, turned(centre), 1, 1), axes.map((axis, k) => turned(axis).map((x) => (x * sides[k]) / 2))];
}

function corners(box, T) {
  const [p, halves] = placed(box, T), signs = [-1, 1];
  return signs.flatMap((a) => signs.flatMap((b) => signs.map((c) => along(along(along(p, halves[0], a), halves[1], b), halves[2], c))));
}

/** How many earlier frames share the origin of each frame. */
function crowding(pose, size) {
  return pose.map((T, j) => pose.slice(0, j).filter((U) => norm(along(T.p, U.p, -1)) < 1e-6 * size).length);
}

/** Convex hull of points in the picture. */
function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (list) => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1) {
        const [a, b] = chain.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}
