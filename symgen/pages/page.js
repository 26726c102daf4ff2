// Sliders, keys and pointers of the page, and what it says of a parameter.

(function () {
  const robot = JSON.parse(document.getElementById("robot").textContent);
  const by = (id) => document.getElementById(id);
  const start = () => closeLoops(robot, { ...robot.tied, ...Object.fromEntries(robot.joints.map((joint) => [joint.j, joint.start])) });
  const degrees = (angle) => `${plain((angle * 180) / Math.PI, 1)}°`;
  const slides = (j) => robot.frames[j - 1].sigma === 1;
  const told = (j, value) => (slides(j) ? `${plain(value, 3)} m` : degrees(value));

  let independent = start();
  if (!independent) {
    by("status").textContent = "The loops do not close at the start configuration of the file.";
    independent = { ...robot.tied, ...Object.fromEntries(robot.joints.map((joint) => [joint.j, joint.start])) };
  }
  const drawing = new Drawing(robot, poses(robot, positions(robot, independent)));
  by("view").append(drawing.root);

  function redraw() {
    const q = positions(robot, independent), pose = poses(robot, q);
    drawing.draw(pose);
    for (const joint of robot.joints) {
      by(`q${joint.j}`).value = q[joint.j];
      by(`q${joint.j}`).setAttribute("aria-valuetext", slides(joint.j) ? `${q[joint.j].toFixed(3)} metres` : `${((q[joint.j] * 180) / Math.PI).toFixed(1)} degrees`);
    }
    for (const [j, value] of Object.entries(q)) by(`at${j}`).textContent = told(j, value);
    for (const row of by("poses").rows) {
      const T = pose[row.dataset.link];
      T.p.forEach((value, k) => number(row.cells[k + 1], value));
      row.cells[4].textContent = `(${T.z.map((value) => plain(value, 3)).join(", ")})`;
    }
  }

  function plain(value, digits) {
    const text = value.toFixed(digits);
    return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−");
  }

  function number(cell, value) {
    cell.dataset.value = value;
    cell.textContent = plain(value, 4);
  }

  function report(open) {
    const last = robot.frames.length;
    const p = poses(robot, positions(robot, independent))[last].p.map((value) => plain(value, 3));
    by("status").textContent = (open ? "The loop does not close beyond here. " : "") + `Origin of frame ${last}: (${p.join(", ")}) m`;
  }

  for (const joint of robot.joints) {
    const slider = by(`q${joint.j}`);
    const step = joint.slides ? drawing.size / 50 : 0.05;
    const go = (target) => {
      const result = moved(robot, independent, joint.j, Math.max(joint.low, Math.min(joint.high, target)), step);
      independent = result.q;
      redraw();
      report(result.open);
    };
    slider.addEventListener("input", () => go(Number(slider.value)));
    slider.addEventListener("keydown", (event) => {
      const unit = joint.slides ? (joint.high - joint.low) / 100 : Math.PI / 180;
      const count = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
      if (count === undefined) return;
      event.preventDefault();
      go(independent[joint.j] + count * unit);
    });
  }

  function key(name) {
    const turns = { ArrowLeft: [0.12, 0], ArrowRight: [-0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] };
    if (turns[name]) drawing.turn(...turns[name]);
    else if (name === "+" || name === "=") zoom(1.15);
    else if (name === "-") zoom(1 / 1.15);
    else if (name === "0") {
      drawing.near = false;
      drawing.startAgain();
      independent = start() || independent;
    } else return false;
    redraw();
    return true;
  }

  function zoom(factor) {
    drawing.near = true;
    drawing.scale *= factor;
  }

  by("view").addEventListener("keydown", (event) => {
    if (!event.ctrlKey && !event.altKey && !event.metaKey && key(event.key)) event.preventDefault();
  });
  for (const button of document.querySelectorAll("[data-key]")) button.addEventListener("click", () => key(button.dataset.key));
  let grip = null; // where the pointer was; touch turns sideways only, so that a page can still be scrolled with a finger on the drawing
  by("view").addEventListener("pointerdown", (event) => {
    grip = [event.clientX, event.clientY];
    by("view").setPointerCapture(event.pointerId);
  });
  by("view").addEventListener("pointermove", (event) => {
    if (!grip) return;
    drawing.turn(-(event.clientX - grip[0]) * 0.01, event.pointerType === "touch" ? 0 : (event.clientY - grip[1]) * 0.01);
    grip = [event.clientX, event.clientY];
    redraw();
  });
  for (const end of ["pointerup", "pointercancel"]) by("view").addEventListener(end, () => { grip = null; });
  for (const [id, option] of [["show-y", "y"], ["show-names", "names"]])
    by(id).addEventListener("change", (event) => {
      drawing.options[option] = event.target.checked;
      redraw();
    });

  // --- parameters ---

  function mark(name) {
    for (const node of document.querySelectorAll(".marked")) node.classList.remove("marked");
    const parameter = name !== null && Object.hasOwn(robot.parameters, name) ? robot.parameters[name] : null;
    drawing.marked = parameter ? parameter.link : null;
    by("detail").classList.toggle("told", parameter !== null);
    if (parameter) {
      const names = new Set([name, ...parameter.base]);
      for (const node of document.querySelectorAll("[data-p]")) if (node.dataset.p === name || (node.matches("li") && names.has(node.dataset.p))) node.classList.add("marked");
      for (const row of document.querySelectorAll(`tr[data-link="${parameter.link}"]`)) row.classList.add("marked");
      say(name, parameter);
    }
    redraw();
  }

  function say(name, parameter) {
    const torques = parameter.joints.map((j) => `Γ${j}`).join(", ");
    const lines = [`${name}, ${parameter.place}: ${parameter.text}, ${parameter.unit}`];
    if (parameter.rule) lines.push(parameter.rule);
    if (parameter.why) lines.push(`no effect: ${parameter.why}`);
    else lines.push(`enters ${torques}` + (parameter.base[0] === name ? "" : ` through ${parameter.base.join(", ")}`));
    by("detail").replaceChildren(...lines.map((text) => Object.assign(document.createElement("p"), { textContent: text })));
  }

  const pointed = (event) => event.target.closest("[data-p]");
  document.addEventListener("pointerover", (event) => { if (pointed(event)) mark(pointed(event).dataset.p); });
  document.addEventListener("focusin", (event) => { if (pointed(event)) mark(pointed(event).dataset.p); });
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") mark(null); });
  document.addEventListener("pointerdown", (event) => { if (!pointed(event) && !by("detail").contains(event.target)) mark(null); });

  for (const list of document.querySelectorAll(".roving")) {
    const buttons = [...list.querySelectorAll("button")];
    list.addEventListener("keydown", (event) => {
      const at = buttons.indexOf(document.activeElement), last = buttons.length - 1;
      const next = { ArrowDown: at + 1, ArrowRight: at + 1, ArrowUp: at - 1, ArrowLeft: at - 1, Home: 0, End: last }[event.key];
      if (next === undefined || at < 0) return;
      event.preventDefault();
      buttons[at].tabIndex = -1;
      const button = buttons[Math.max(0, Math.min(last, next))];
      button.tabIndex = 0;
      button.focus();
    });
  }

  redraw();
})();
