// Uploads, the drawing with its sliders, copy buttons, news of the server. htmx does the rest.
"use strict";

(function () {
  const plain = (x, digits) => { const text = x.toFixed(digits); return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−"); };
  const say = (text, kind = "no") => one("#message").replaceChildren(Object.assign(document.createElement("p"), { textContent: text, className: kind }));
  // --- files that are dropped or chosen ---
  async function send(drop, file) {
    if (!file) return;
    say(`${file.name}: sending …`, "busy");
    try {
      const answer = await fetch(`${drop.dataset.upload}&name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
      if (answer.ok) return location.reload();
      const text = await answer.text();
      say(new DOMParser().parseFromString(text, "text/html").body.textContent.trim() || `refused, ${answer.status}`);
    } catch {
      say(`${file.name}: was not taken: larger than the studio takes, or the server has ended`);
    }
  }
  for (const drop of all("[data-upload]")) {
    one("input", drop).addEventListener("change", (event) => send(drop, event.target.files[0]));
    for (const [name, over] of [["dragover", true], ["dragleave", false], ["drop", false]])
      drop.addEventListener(name, (event) => {
        event.preventDefault();
        drop.classList.toggle("over", over);
        if (name === "drop") send(drop, event.dataTransfer.files[0]);
      });
  }
  // --- the drawing: kinematics.js and drawing.js of the page of a robot ---
  const arm = { robot: null, drawing: null, q: {} };
  const slides = (j) => arm.robot.frames[j - 1].sigma === 1;
  const told = (j, x) => (slides(j) ? `${plain(x, 3)} m` : `${plain((x * 180) / Math.PI, 1)}°`);

  function read() {
    const text = one("#figure")?.dataset.figure, view = one("#arm");
    if (!view || !text) return;
    const robot = JSON.parse(text), before = arm.drawing, q = arm.q;
    arm.robot = robot;
    const start = Object.fromEntries(robot.joints.map((joint) => [joint.j, joint.j in q ? q[joint.j] : joint.start]));
    arm.q = closeLoops(robot, { ...robot.tied, ...start }) || { ...robot.tied, ...start };
    arm.drawing = new Drawing(robot, poses(robot, positions(robot, arm.q)));
    if (before) Object.assign(arm.drawing, { yaw: before.yaw, pitch: before.pitch });
    view.replaceChildren(arm.drawing.root);
    sliders(one(view.dataset.sliders || "#none"));
    redraw();
  }

  function sliders(place) {
    if (!place) return;
    const focused = document.activeElement?.id;
    place.replaceChildren(...arm.robot.joints.map(({ j, low, high }) => {
      const row = Object.assign(document.createElement("div"), { className: "joint" });
      const label = Object.assign(document.createElement("label"), { textContent: `q${j}`, htmlFor: `s-${j}` });
      const input = Object.assign(document.createElement("input"), { type: "range", id: `s-${j}`, min: low, max: high, step: "any", value: arm.q[j] });
      const at = Object.assign(document.createElement("output"), { id: `at-${j}` });
      at.htmlFor = `s-${j}`;
      input.addEventListener("input", () => {
        const result = moved(arm.robot, arm.q, j, Number(input.value), slides(j) ? arm.drawing.size / 50 : 0.05);
        arm.q = result.q;
        redraw();
      });
      row.append(label, input, at);
      return row;
    }));
    document.getElementById(focused)?.focus();
  }

  function redraw() {
    const q = positions(arm.robot, arm.q);
    arm.drawing.draw(poses(arm.robot, q));
    for (const { j } of arm.robot.joints) {
      const input = document.getElementById(`s-${j}`);
      if (!input) continue;
      input.value = q[j];
      input.setAttribute("aria-valuetext", told(j, q[j]));
      document.getElementById(`at-${j}`).textContent = told(j, q[j]);
    }
  }

  function key(name) {
    const turns = { ArrowLeft: [0.12, 0], ArrowRight: [-0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] };
    if (!arm.drawing) return false;
    if (turns[name]) arm.drawing.turn(...turns[name]);
    else if (["+", "=", "-"].includes(name)) { arm.drawing.near = true; arm.drawing.scale *= name === "-" ? 1 / 1.15 : 1.15; }
    else if (name === "0") { arm.drawing.near = false; arm.drawing.startAgain(); arm.q = {}; read(); }
    else return false;
    redraw();
    return true;
  }
  for (const button of all("[data-key]")) button.addEventListener("click", () => key(button.dataset.key));
  const view = one("#arm");
  if (view) {
    let grip = null;
    view.addEventListener("keydown", (event) => { if (!event.ctrlKey && !event.altKey && !event.metaKey && key(event.key)) event.preventDefault(); });
    view.addEventListener("pointerdown", (event) => { grip = [event.clientX, event.clientY]; view.setPointerCapture(event.pointerId); });
    view.addEventListener("pointermove", (event) => {
      if (!grip || !arm.drawing) return;
      arm.drawing.turn(-(event.clientX - grip[0]) * 0.01, event.pointerType === "touch" ? 0 : (event.clientY - grip[1]) * 0.01);
      grip = [event.clientX, event.clientY];
      redraw();
    });
    for (const end of ["pointerup", "pointercancel"]) view.addEventListener(end, () => { grip = null; });
  }
  // --- replay: one cursor for the drawing and all plots ---
  async function replay(place) {
    const answer = await fetch(place.dataset.series), data = answer.ok ? await answer.json() : { error: await answer.text() };
    if (data.error) return place.replaceChildren(Object.assign(document.createElement("p"), { className: "no", textContent: data.error }));
    const cursor = one("#cursor"), joint = one("#joint"), play = one("#play");
    Object.assign(cursor, { min: data.t[0], max: data.t.at(-1), value: data.t[0] });
    joint.replaceChildren(...data.joints.map((name) => new Option(name)));
    let plots = null, timer = null;
    const at = (t) => {
      const k = nearest(data.t, t);
      cursor.value = data.t[k];
      one("#now").textContent = `${plain(data.t[k], 2)} s`;
      plots.at(data.t[k]);
      if (!arm.robot) return;
      arm.robot.joints.forEach((own, i) => { arm.q[own.j] = data.q[i]?.[k] ?? 0; });
      arm.q = closeLoops(arm.robot, arm.q) || arm.q;
      redraw();
    };
    const show = () => {
      const i = joint.selectedIndex, pair = { measured: data.measured[i], predicted: data.predicted[i] };
      const error = data.measured[i].map((x, k) => (x === null ? null : x - data.predicted[i][k])), unit = slides(arm.robot.joints[i].j) ? ["N", "m"] : ["N m", "rad"];
      plots = new Plots(place, data.t, [
        { title: `torque of joint ${data.joints[i]}, ${unit[0]}`, lines: pair },
        { title: `residual, measured − predicted, ${unit[0]}`, lines: { residual: error } },
        { title: `position of joint ${data.joints[i]}, ${unit[1]}`, lines: { q: data.q[i] } },
        { title: `torque, ${unit[0]}, over position, ${unit[1]}`, lines: pair, over: data.q[i] },
      ], at);
      at(Number(cursor.value));
    };
    joint.addEventListener("change", show);
    cursor.addEventListener("input", () => at(Number(cursor.value)));
    play.addEventListener("click", () => {
      if (timer) { clearInterval(timer); timer = null; play.textContent = "Play"; return; }
      play.textContent = "Stop";
      timer = setInterval(() => {
        const t = Number(cursor.value) + 0.05;
        at(t > data.t.at(-1) ? data.t[0] : t);
      }, 50);
    });
    show();
  }
  // --- the table: every cell to the server, one edit at a time; what is typed meanwhile stays ---
  let pending = null, busy = false, resting = null;

  function cells() {
    const form = one("#cells"), found = { frames: {}, constants: {}, gravity: [], loops: [] }, names = {};
    for (const input of all("[data-cell]", form)) {
      const [part, k, column] = input.dataset.cell.split("."), value = input.value.trim();
      if (part === "gravity") found.gravity.push(value);
      else if (part === "constants") (names[k] ??= {})[column] = value;
      else if (part === "loops") (found.loops[k] ??= JSON.parse(input.closest("[data-rest]").dataset.rest))[column] = value;
      else {
        const row = (found.frames[k] ??= {});
        if (value || !["mu", "gamma", "b"].includes(column)) row[column] = value;
      }
    }
    for (const { name, value } of Object.values(names)) if (name) found.constants[name] = value;
    return found;
  }

  /** The cells after a frame or a loop more or less; frames stay numbered from 1. */
  function changed(table, act, j) {
    const rows = Object.values(table.frames);
    const gone = (text) => text.replace(/\bq(\d+)\b/g, (all, i) => `q${i - (i > j)}`);
    if (act === "add") rows.push({ ant: String(j), sigma: "0", alpha: "0", d: "0", theta: `q${rows.length + 1}`, r: "0" });
    if (act === "loop") table.loops.push({ cut: String(rows.length), twin: "" });
    if (act === "unloop") table.loops.splice(j, 1);
    if (act === "remove") {
      const [{ ant }] = rows.splice(j - 1, 1);
      for (const row of [...rows, ...table.loops]) {
        for (const [key, text] of Object.entries(row)) if (typeof text === "string") row[key] = gone(text);
        for (const key of ["ant", "cut", "twin"]) if (row[key] > 0) row[key] = Number(row[key]) === j ? ant : String(row[key] - (row[key] > j));
      }
    }
    return { ...table, frames: Object.fromEntries(rows.map((row, k) => [k + 1, row])) };
  }

  async function edit(table, resized) {
    pending = { digest: one("#cells").dataset.digest, cells: JSON.stringify(table), ...(resized ? { resized: "1" } : {}) };
    if (busy) return;
    busy = true;
    while (pending) {
      const values = { ...pending, digest: one("#cells").dataset.digest };
      pending = null;
      await htmx.ajax("POST", "do/edit", { target: "#table", swap: "outerHTML", values });
    }
    busy = false;
  }
  document.addEventListener("input", (event) => {
    if (!event.target.closest("#cells")) return;
    clearTimeout(resting);
    resting = setTimeout(() => edit(cells(), false), 250);
  });
  document.addEventListener("submit", (event) => {
    if (event.target.id !== "cells") return;
    event.preventDefault();
    edit(cells(), false);
  });
  document.addEventListener("click", (event) => {
    const [act, j] = event.target.closest("[data-act]")?.dataset.act.split(" ") || [];
    if (act) edit(changed(cells(), act, Number(j)), act === "add" || act === "remove");
  });

  let typed = null;
  document.addEventListener("htmx:beforeSwap", () => {
    const node = document.activeElement;
    typed = node?.id && node.matches("#cells input") ? { id: node.id, value: node.value } : null;
  });
  document.addEventListener("htmx:afterSwap", () => { // at once: a key pressed before it settles is of the new field
    const node = typed && document.getElementById(typed.id);
    if (node && node.value !== typed.value) {
      node.value = typed.value;
      node.dispatchEvent(new Event("input", { bubbles: true }));
    }
    typed = null;
  });
  document.addEventListener("htmx:afterSettle", (event) => {
    if (event.target.id === "table" || one("#table")?.contains(event.target)) read();
  });
  document.addEventListener("htmx:sendError", () => say("The server has ended; what was saved is in the work folder. Start symgen studio again."));
  document.addEventListener("htmx:beforeRequest", () => one("#message").replaceChildren());

  document.addEventListener("click", async (event) => {
    const button = event.target.closest("[data-copy]");
    if (!button) return;
    const source = one(button.dataset.copy);
    try { await navigator.clipboard.writeText(source.textContent); } catch { getSelection().selectAllChildren(source); document.execCommand("copy"); }
    const before = button.textContent;
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = before; }, 1200);
  });
  document.addEventListener("click", (event) => {
    const button = event.target.closest("[data-download]");
    if (!button) return;
    const href = URL.createObjectURL(new Blob([one(button.dataset.download).textContent]));
    Object.assign(document.createElement("a"), { href, download: button.dataset.name }).click();
    setTimeout(() => URL.revokeObjectURL(href), 1000);
  });
  // --- news of the server ---
  let shownRobot = one("#figure")?.dataset.digest || "", version = null, timer = null;
  const news = new EventSource("events");
  news.addEventListener("message", (event) => {
    const state = JSON.parse(event.data);
    if (version !== null && state.version !== version) htmx.trigger(document.body, "changed");
    version = state.version;
    clearTimeout(timer);
    timer = setTimeout(() => {
      const own = one("#figure")?.dataset.digest;
      if (own && one("#table") && state.robot !== own) one("#other").hidden = false;
      if (own && state.robot === own) one("#other").hidden = true;
    }, 1500);
  });
  document.addEventListener("htmx:afterSettle", () => {
    const robot = one("#figure")?.dataset.digest || "";
    if (robot !== shownRobot && one("#figure").dataset.figure) { shownRobot = robot; htmx.trigger(document.body, "robot"); }
  });
  // the one that the parts of this page are of
  read();
  all("[data-series]").forEach(replay);
})();
