"use strict";
// Positions of the frames from the frame table, and of the passive joints from the loops. A pose is {x, y, z, p}: axes and origin of a
// frame in frame 0. Lengths in m, angles in rad.

const along = (p, v, s) => [p[0] + s * v[0], p[1] + s * v[1], p[2] + s * v[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const sum = (a, b, s, c) => [s * a[0] + c * b[0], s * a[1] + c * b[1], s * a[2] + c * b[2]];
const norm = (a) => Math.hypot(...a);

const BASE = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1], p: [0, 0, 0] };
const turnZ = (T, a) => ({ ...T, x: sum(T.x, T.y, Math.cos(a), Math.sin(a)), y: sum(T.x, T.y, -Math.sin(a), Math.cos(a)) });
const turnX = (T, a) => ({ ...T, y: sum(T.y, T.z, Math.cos(a), Math.sin(a)), z: sum(T.y, T.z, -Math.sin(a), Math.cos(a)) });
const moveZ = (T, s) => ({ ...T, p: along(T.p, T.z, s) });
const moveX = (T, s) => ({ ...T, p: along(T.p, T.x, s) });

/** iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r); `corners` of the way from O_i to O_j. */
function nextPose(T, f, q) {
  const atB = moveZ(turnZ(T, f.gamma), f.b);
  const atD = moveX(turnX(atB, f.alpha), f.d);
  const pose = moveZ(turnZ(atD, f.theta + (f.sigma === 0 ? q : 0)), f.r + (f.sigma === 1 ? q : 0));
  return { ...pose, corners: [T.p, atB.p, atD.p, pose.p] };
}

/** Poses of all frames by number, 0 the base. q: positions of the moving joints by number. */
function poses(robot, q) {
  const pose = [BASE];
  for (const f of robot.frames) pose[f.j] = nextPose(pose[f.ant], f, q[f.j] || 0);
  return pose;
}

/** Positions of all moving joints: q_j = offset + sum_i of_i q_i for those that follow. */
function positions(robot, independent) {
  const q = { ...independent };
  for (const [j, row] of Object.entries(robot.follows)) {
    q[j] = row.offset;
    for (const [i, n] of Object.entries(row.of)) q[j] += n * independent[i];
  }
  return q;
}

/** What is left open: P_cut - P_twin, and half the sum of x_twin x x_cut, y.., z.., zero where the frames agree. */
function gaps(robot, independent) {
  const pose = poses(robot, positions(robot, independent));
  return robot.loops.flatMap(({ cut, twin }) => {
    const A = pose[cut], B = pose[twin];
    const turn = ["x", "y", "z"].map((k) => cross(B[k], A[k])).reduce((s, v) => along(s, v, 1), [0, 0, 0]);
    return [...along(A.p, B.p, -1), ...turn.map((t) => t / 2)];
  });
}

/** Whether the frames of every loop agree and are not half a turn apart. */
function closed(robot, independent) {
  const pose = poses(robot, positions(robot, independent));
  const aligned = robot.loops.every(({ cut, twin }) => ["x", "y", "z"].every((k) => dot(pose[cut][k], pose[twin][k]) > 0.99));
  return aligned && Math.max(...gaps(robot, independent).map(Math.abs)) < 1e-7;
}

/** Solve A x = b by elimination with pivots; A is changed. */
function solve(A, b) {
  const n = b.length;
  for (let k = 0; k < n; k++) {
    let best = k;
    for (let i = k + 1; i < n; i++) if (Math.abs(A[i][k]) > Math.abs(A[best][k])) best = i;
    [A[k], A[best]] = [A[best], A[k]];
    [b[k], b[best]] = [b[best], b[k]];
    for (let i = k + 1; i < n; i++) {
      const c = A[i][k] / A[k][k];
      for (let m = k; m < n; m++) A[i][m] -= c * A[k][m];
      b[i] -= c * b[k];
    }
  }
  const x = new Array(n).fill(0);
  for (let k = n - 1; k >= 0; k--) x[k] = (b[k] - A[k].reduce((s, a, m) => (m > k ? s + a * x[m] : s), 0)) / A[k][k];
  return x;
}

/** Close the loops by Gauss-Newton in the tied joints, from where they are; null where they do not close. */
function closeLoops(robot, independent) {
  const tied = Object.keys(robot.tied), h = 1e-6;
  let q = { ...independent };
  for (let step = 0; step < 30 && tied.length; step++) {
    const r = gaps(robot, q);
    if (Math.max(...r.map(Math.abs)) < 1e-12) break;
    const J = tied.map((j) => {
      const up = gaps(robot, { ...q, [j]: q[j] + h }), down = gaps(robot, { ...q, [j]: q[j] - h });
      return up.map((value, k) => (value - down[k]) / (2 * h));
    });
    const normal = J.map((a, i) => J.map((b, k) => a.reduce((s, v, m) => s + v * b[m], i === k ? 1e-13 : 0)));
    const change = solve(normal, J.map((a) => -a.reduce((s, v, m) => s + v * r[m], 0)));
    tied.forEach((j, k) => { q = { ...q, [j]: q[j] + change[k] }; });
  }
  return closed(robot, q) ? q : null;
}

/** Move joint j to `target` in small steps, so that a loop stays in its assembly mode; ends where it closes last. */
function moved(robot, independent, j, target, step) {
  const count = robot.loops.length ? Math.max(1, Math.ceil(Math.abs(target - independent[j]) / step)) : 1;
  const from = independent[j];
  let q = independent;
  for (let k = 1; k <= count; k++) {
    const next = closeLoops(robot, { ...q, [j]: from + ((target - from) * k) / count });
    if (!next) return { q, open: true };
    q = next;
  }
  return { q, open: false };
}
