// Uploads, the drawing with its sliders, copy buttons, news of the server. htmx does the rest.
"use strict";
const one = (selector, of = document) => of.querySelector(selector), all = (selector, of = document) => [...of.querySelectorAll(selector)];
(function () {
  const plain = (x, digits) => { const text = x.toFixed(digits); return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−"); };
  const say = (text, kind = "no") => one("#message").replaceChildren(node("p", { textContent: text, className: kind }));
  // --- files that are dropped or chosen ---
  async function send(drop, file) {
    if (!file || (drop.dataset.ask && !confirm(drop.dataset.ask))) return;
    say(`${file.name}: sending …`, "busy");
    try {
      const answer = await fetch(`${drop.dataset.upload}&name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
      if (answer.ok && drop.dataset.named !== undefined) { // what is typed below stays
        one("#values").dataset.validation = await answer.text();
        one("b", drop).textContent = file.name;
        return one("#message").replaceChildren();
      }
      if (answer.ok) return location.reload();
      say(new DOMParser().parseFromString(await answer.text(), "text/html").body.textContent.trim() || `refused, ${answer.status}`);
    } catch {
      say(`${file.name}: was not taken: larger than the studio takes, or the server has ended`);
    }
  }
  for (const drop of all("[data-upload]")) {
    one("input", drop).addEventListener("change", ({ target }) => { send(drop, target.files[0]); target.value = ""; }); // the same file may be chosen again
    for (const [name, over] of [["dragover", true], ["dragleave", false], ["drop", false]])
      drop.addEventListener(name, (event) => {
        event.preventDefault();
        drop.classList.toggle("over", over);
        if (name !== "drop") return;
        const entry = event.dataTransfer.items?.[0]?.webkitGetAsEntry?.();
        if (entry?.isDirectory) say(`${entry.name} is a folder; name it on the command line: symgen studio ROBOT ${entry.name}`);
        else send(drop, event.dataTransfer.files[0]);
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
    const boxes = one("#show-boxes");
    arm.drawing.options.boxes = !boxes || boxes.checked;
    if (boxes) boxes.parentElement.hidden = !robot.boxes.length;
    view.replaceChildren(arm.drawing.root);
    sliders(one(view.dataset.sliders || "#none"));
    redraw();
  }

  function sliders(place) {
    if (!place) return;
    const focused = document.activeElement?.id;
    place.replaceChildren(...arm.robot.joints.map(({ j, low, high, label }) => {
      const input = node("input", { type: "range", id: `s-${j}`, min: low, max: high, step: "any", value: arm.q[j] });
      input.addEventListener("input", () => {
        const result = moved(arm.robot, arm.q, j, Number(input.value), slides(j) ? arm.drawing.size / 50 : 0.05);
        arm.q = result.q;
        redraw();
      });
      return node("div", { className: "joint" }, node("label", { textContent: `q${j} ${label}`, htmlFor: `s-${j}` }), input, node("output", { id: `at-${j}`, htmlFor: `s-${j}` }));
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
  one("#show-boxes")?.addEventListener("change", ({ target }) => { arm.drawing.options.boxes = target.checked; redraw(); });
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
  // --- replay: one cursor for the drawing and the figures of all joints ---
  function replay(place) {
    const [cursor, part, play] = ["#cursor", "#part", "#play"].map((id) => one(id));
    let data = null, group = null, timer = null;
    const at = (t) => {
      group.at(t);
      const { k } = group.charts[0];
      cursor.value = t;
      one("#now").textContent = `${plain(data.t[k] - group.origin, 2)} s`;
      if (!arm.robot) return;
      arm.robot.joints.forEach((own, i) => { arm.q[own.j] = data.q[i]?.[k] ?? 0; });
      arm.q = closeLoops(arm.robot, arm.q) || arm.q;
      redraw();
    };
    const charts = (joint, i) => {
      const { t, q, measured, predicted } = data, [torque, unit] = slides(arm.robot.joints[i].j) ? ["N", "m"] : ["N m", "rad"];
      const panels = torques(measured[i], predicted[i], torque), position = { title: "position", unit };
      const moving = { ...position, lines: [{ name: "position", kind: "c0", values: q[i] }] };
      return [{ label: `Joint ${joint}`, t, panels: [...panels, moving] }, { label: `Joint ${joint}, over its position`, t, over: { ...position, values: q[i] }, panels }];
    };
    const load = async () => { // the record that is chosen, "" for the first
      const answer = await fetch(`${place.dataset.series}&record=${encodeURIComponent(part.value)}`), text = await answer.text(), value = answer.ok ? JSON.parse(text) : { error: text };
      if (value.error) return say(value.error);
      const rows = (key) => value[key].map((row) => floats(row));
      data = { ...value, t: floats(value.t, Float64Array), q: rows("q"), measured: rows("measured"), predicted: rows("predicted") };
      const chosen = Math.max(part.selectedIndex, 0), box = node("div", { className: "figures" });
      part.replaceChildren(...data.records.map((name, k) => new Option(name, name, k === chosen, k === chosen)));
      Object.assign(cursor, { min: data.t[0], max: data.t.at(-1), value: data.t[0] });
      place.replaceChildren(box);
      group = new Group(box, data.joints.flatMap(charts), { moved: at });
      at(data.t[0]);
    };
    part.addEventListener("change", load);
    cursor.addEventListener("input", () => data && at(Number(cursor.value)));
    play.addEventListener("click", () => {
      if (timer || !data) { clearInterval(timer); timer = null; play.textContent = "Play"; return; }
      play.textContent = "Stop";
      let last = performance.now();
      timer = setInterval(() => {
        const now = performance.now(), t = Number(cursor.value) + (now - last) / 1000, [start, end] = group.span;
        last = now;
        at(t < start || t > end ? start : t);
      }, 50);
    });
    load();
  }
  // --- the table: every cell to the server, one edit at a time; what is typed meanwhile stays ---
  let waiting = [], busy = false, moving = false, resting = null, sent = {};

  function cells() {
    const form = one("#cells"), found = { frames: {}, constants: {}, gravity: [], loops: [] }, names = {};
    for (const input of all("[data-cell]", form)) {
      const [part, k, column] = input.dataset.cell.split("."), value = input.value.trim();
      if (k === undefined) found[part] = value; // name and title
      else if (part === "gravity") found.gravity.push(value);
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
    if (act === "add") rows.push({ ant: String(j || rows.length), sigma: "0", alpha: "0", d: "0", theta: `q${rows.length + 1}`, r: "0" });
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

  /** Send the cells as they are when the edits before are done; `act` adds row j (0: on the last) or removes it, of frames or loops; or it is undo, redo, or text, the whole file. */
  async function edit(act = "", j = 0, text = "") {
    if (resting && ["undo", "redo", "text"].includes(act)) waiting.push(["", 0, ""]); // what was typed before
    clearTimeout(resting);
    resting = null;
    if (act || !waiting.length) waiting.push([act, j, text]);
    if (act !== "undo") one("#undo").disabled = false;
    if (busy) return;
    busy = true;
    while (waiting.length) {
      const [act, j, text] = waiting.shift(), { digest } = one("#figure").dataset;
      const back = { undo: {}, redo: { redo: "1" } }[act], table = () => (act ? changed(cells(), act, j) : cells());
      const resized = act && !act.endsWith("loop") ? { resized: "1" } : {};
      const values = back || (act === "text" ? { text } : { cells: JSON.stringify(table()), ...resized });
      sent = act === "remove" ? {} : Object.fromEntries(all("#cells [data-cell]").map((input) => [input.id, input.value]));
      await htmx.ajax("POST", back ? "do/undo" : "do/edit", { target: "#table", swap: "outerHTML", values: { digest, ...values } }).catch(() => {}); // told by htmx:sendError
    }
    busy = moving = false;
  }
  document.addEventListener("input", (event) => {
    if (!event.target.closest("#cells")) return;
    clearTimeout(resting);
    resting = setTimeout(() => edit(), 250);
  });
  document.addEventListener("submit", (event) => {
    const { id } = event.target;
    if (id !== "cells" && id !== "whole") return;
    event.preventDefault();
    if (id === "cells") edit();
    else edit("text", 0, one("#robot-text").value);
  });
  document.addEventListener("click", (event) => {
    const [act, j = 0] = event.target.closest("[data-act]")?.dataset.act.split(" ") || [];
    if (!act || (moving && j)) return; // the rows that were clicked on move when one goes or another robot comes
    moving ||= !["add", "loop"].includes(act);
    edit(act, Number(j));
  });
  // --- forms that derive: a sign of work in the place of what an earlier choice gave ---
  const resultOf = (form) => one(form.getAttribute("hx-target"));
  document.addEventListener("change", ({ target }) => {
    const form = target.closest("form[hx-get]");
    if (form) resultOf(form).replaceChildren();
  });
  document.addEventListener("htmx:beforeRequest", ({ target }) => {
    if (target.matches("form[hx-get]")) resultOf(target).replaceChildren(node("p", { className: "note", textContent: "deriving …" }));
  });
  document.addEventListener("htmx:responseError", ({ target }) => {
    if (target.matches("form[hx-get]")) resultOf(target).replaceChildren();
  });

  const open = new Set(); // what was unfolded stays so when its part of the page comes anew
  document.addEventListener("toggle", ({ target }) => target.id && target.isConnected && open[target.open ? "add" : "delete"](target.id), true);
  document.addEventListener("htmx:afterSwap", () => { for (const id of open) if (document.getElementById(id)) document.getElementById(id).open = true; });

  let typed = [];
  document.addEventListener("htmx:beforeSwap", ({ detail }) => {
    if (detail.isError) detail.swapOverride = "innerHTML"; // the box of messages stays, however the request would swap
    typed = all("#cells [data-cell]").filter(({ id, value }) => id in sent && value !== sent[id]);
  });
  document.addEventListener("htmx:afterSwap", () => { // at once: a key pressed before it settles is of the new field
    for (const { id, value, selectionStart } of typed) {
      const field = document.getElementById(id);
      if (!field || field.value === value) continue;
      field.value = value;
      if (field === document.activeElement) field.setSelectionRange?.(selectionStart, selectionStart);
      field.dispatchEvent(new Event("input", { bubbles: true }));
    }
  });
  document.addEventListener("htmx:afterSettle", (event) => {
    if (event.target.id === "table" || one("#table")?.contains(event.target)) read();
  });
  const ended = () => say("The server has ended; what was saved is in the work folder. Start symgen studio again.", "no ended");
  document.addEventListener("htmx:sendError", ended);
  document.addEventListener("htmx:beforeRequest", ({ target }) => target.matches("[hx-trigger]") || one("#message").replaceChildren()); // parts that load by themselves clear nothing

  document.addEventListener("click", async (event) => {
    const button = event.target.closest("[data-copy], [data-download]");
    if (!button) return;
    const name = button.dataset.copy || button.dataset.download, source = name === "next" ? button.parentElement.nextElementSibling : one(name), before = button.textContent;
    if (button.dataset.download) {
      const href = URL.createObjectURL(new Blob([source.textContent]));
      node("a", { href, download: button.dataset.name }).click();
      return setTimeout(() => URL.revokeObjectURL(href), 1000);
    }
    try { await navigator.clipboard.writeText(source.textContent); } catch { getSelection().selectAllChildren(source); document.execCommand("copy"); }
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = before; }, 1200);
  });
  // --- what a symbol means, where it is pointed at ---
  const about = node("div", { id: "about", hidden: true, role: "status" });
  document.body.append(about);
  const symbol = (mark) => (mark.localName === "msubsup" ? mark.children[0].textContent + mark.children[1].textContent : mark.textContent).replace(/\s/g, "");
  document.addEventListener("pointerover", ({ target }) => {
    let text = target.closest?.("[data-means]")?.dataset.means, place = target;
    const known = Object.assign({}, ...all("[data-meanings]").map(({ dataset }) => JSON.parse(dataset.meanings)));
    for (let mark = target; !text && mark?.closest?.("math"); mark = mark.parentElement) [text, place] = [known[symbol(mark)], mark];
    about.hidden = !text;
    if (!text) return;
    const { left, bottom } = place.getBoundingClientRect();
    about.textContent = text;
    about.style.left = `${Math.max(0, Math.min(left, innerWidth - about.offsetWidth - 8))}px`;
    about.style.top = `${Math.min(bottom + 6, innerHeight - about.offsetHeight - 4)}px`;
  });
  document.addEventListener("scroll", () => { about.hidden = true; }, true);
  // --- keys and blocks in the table of frames ---
  const beside = (cell, down, right) => {
    const row = cell.closest("tr"), cells = (of) => (of ? all("input", of) : []), at = cells(row).indexOf(cell);
    let to = row;
    for (let k = Math.abs(down); k && to; ) { to = down > 0 ? to.nextElementSibling : to.previousElementSibling; if (cells(to).length) k--; }
    return cells(to)[at + right];
  };
  document.addEventListener("keydown", (event) => {
    const cell = event.target, steps = { ArrowUp: [-1, 0], ArrowDown: [1, 0], Enter: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
    if (!steps || event.ctrlKey || event.altKey || event.metaKey || event.shiftKey || !cell.matches(".cells input")) return;
    const { selectionStart: from, selectionEnd: to, value } = cell, whole = from === 0 && to === value.length;
    if (steps[1] && !whole && (from !== to || from !== (steps[1] < 0 ? 0 : value.length))) return; // within the text
    const next = beside(cell, ...steps);
    event.preventDefault();
    if (next) { next.focus(); next.select(); }
    else if (event.key === "Enter") edit();
  });
  document.addEventListener("paste", (event) => {
    const cell = event.target, text = event.clipboardData.getData("text").replace(/\r/g, "").replace(/\n$/, "");
    if (!cell.matches?.(".cells input") || !/[\t\n]/.test(text)) return;
    event.preventDefault();
    let left = 0;
    text.split("\n").forEach((line, down) => line.split("\t").forEach((word, right) => {
      const place = down ? beside(cell, down, right) : beside(cell, 0, right);
      if (place) place.value = word.trim();
      else left++;
    }));
    edit();
    if (left) say(`${left} cells of the block are outside the table; add frames first, and paste again.`);
  });
  // --- news of the server ---
  let shownRobot = one("#figure")?.dataset.digest || "", version = Number(one("#values").dataset.version), timer = null;
  const news = new EventSource("events");
  news.addEventListener("error", ended);
  news.addEventListener("open", () => one("#message .ended")?.remove()); // it was the network
  news.addEventListener("message", (event) => {
    const state = JSON.parse(event.data);
    if (state.version !== version) htmx.trigger(document.body, "changed");
    version = state.version;
    clearTimeout(timer);
    timer = setTimeout(() => {
      const own = one("#figure")?.dataset.digest;
      if (own && one("#table")) one("#other").hidden = state.robot === own;
    }, 1500);
  });
  document.addEventListener("htmx:afterSettle", () => {
    const { figure, digest } = one("#figure")?.dataset || {}, robot = figure ? digest : "";
    if (robot !== shownRobot) {
      shownRobot = robot;
      for (const place of all("#model, #module")) place.replaceChildren(); // of the robot before
      if (robot) htmx.trigger(document.body, "robot");
    }
  });
  read();
  all("[data-series]").forEach(replay);
})();
