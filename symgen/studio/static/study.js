// The study: answers, remedies, estimators, values side by side.
"use strict";
(function () {
  const page = one("#values")?.dataset || {}, joints = Number(page.joints) || 99;
  const holder = () => (one("#study[data-values], #findings[data-values]") || one("#values")).dataset;
  const study = () => JSON.parse(holder().values), written = (values) => ({ values: JSON.stringify(values), digest: holder().digest });
  const number = (text) => (text.trim() !== "" && Number.isFinite(Number(text)) ? Number(text) : text.trim());
  const listed = (x) => (x === null || x === undefined ? "" : Array.isArray(x) ? x.join(", ") : String(x));
  // --- the questions ---
  const LISTS = ["columns.q", "columns.tau"];
  let guess = {}, shown = null; // what the names of the columns tell

  /** A value of a field; a choice that it does not have is one of its choices then. */
  function choose(field, value) {
    if (field.options && ![...field.options].some((option) => option.value === value)) field.append(new Option(value));
    field.value = value;
  }

  function fill() {
    const form = one("#questions");
    if (!form) return;
    const record = study().record?.[0] || {};
    for (const field of form.elements) {
      if (!field.name) continue;
      const [key, inner] = field.name.split("."), of = (part) => (inner ? part[key]?.[inner] : part[key]);
      choose(field, listed(of(record) ?? of(guess)));
    }
    if (!one("[name='units.t']", form).value) one("[name='units.t']", form).value = "s";
    ask();
  }

  const ask = () => { // what this record needs, and what is filled in
    const text = (name) => one(`#questions [name='${name}']`).value;
    const needed = { rate: !text("columns.t"), torque_constant: /^(m?A|V)$/.test(text("units.tau")), counts_per_revolution: text("units.q") === "counts" };
    for (const [name, open] of Object.entries(needed)) {
      const field = one(`#questions [name='${name}']`);
      for (const part of [one(`label[for='${field.id}']`), field.parentElement]) part.hidden = !open && !field.value;
    }
    for (const name of [...LISTS, "units.q", "units.tau", "side"]) {
      const field = one(`#questions [name='${name}']`);
      one(`label[for='${field.id}'] .ask`).hidden = Boolean(field.value);
    }
  };
  document.addEventListener("change", (event) => {
    if (event.target.closest("#questions")) { ask(); drawn(); }
    else if (event.target.closest("#jobs")) compare();
  });

  function answered(form) {
    const values = study(), record = { files: [page.record], ...values.record?.[0] };
    for (const field of form.elements) {
      if (!field.name) continue;
      const [key, inner] = field.name.split("."), text = field.value.trim();
      const value = field.name === "decimal" ? text || undefined : LISTS.includes(field.name) ? text.split(",").map((part) => part.trim()).filter(Boolean)
        : field.name === "columns.t" ? text || null : text.includes(",") ? text.split(",").map(number) : text === "" ? undefined : number(text);
      if (inner) record[key] = { ...record[key], [inner]: value };
      else record[key] = value;
      if (inner && value === undefined) delete record[key][inner];
      if (inner && !Object.keys(record[key]).length) delete record[key];
    }
    const validation = page.validation ? { validate: { ...values.validate, record: [{ ...record, files: [page.validation] }] } } : {};
    return { symgen: 1, ...values, record: [record, ...(values.record || []).slice(1)], ...validation };
  }
  document.addEventListener("submit", (event) => {
    if (event.target.id === "questions") {
      event.preventDefault();
      const open = all("strong.ask:not([hidden])", event.target);
      if (open.length) return document.getElementById(open[0].parentElement.htmlFor).focus();
      htmx.ajax("POST", "do/study", { target: "#study", swap: "outerHTML", values: written(answered(event.target)) });
    }
    if (event.target.id !== "solve" && event.target.id !== "resolution") return;
    event.preventDefault();
    (event.target.id === "solve" ? solve : round)(new FormData(event.target, event.submitter));
  });

  /** A setting that is refused is told beside its field; in a text, below it, with its line. */
  document.addEventListener("wrong", ({ target, detail: { keys, text, line } }) => {
    const typed = target.closest?.("form")?.querySelector("textarea");
    const paths = keys.map((_, k) => keys.slice(0, keys.length - k).join("."));
    const field = typed || paths.map((path) => one(`[data-setting="${path}"]`) || one(`#questions [name="${path.replace(/^record\./, "")}"]`)).find(Boolean);
    if (!field) return;
    untold(field);
    const at = typed && line ? `line ${line}: ${keys.join(".")}: ` : "";
    field.after(node("span", { className: "wrong", id: `wrong-${field.name}`, role: "alert", textContent: at + text }));
    field.setAttribute("aria-invalid", "true");
    one("#message").replaceChildren();
    field.focus();
    if (!typed || !line) return;
    const start = field.value.split("\n").slice(0, line - 1).join("\n").length + (line > 1);
    field.setSelectionRange(start, field.value.indexOf("\n", start) < 0 ? field.value.length : field.value.indexOf("\n", start));
  });
  const untold = (field) => {
    field.removeAttribute("aria-invalid");
    document.getElementById(`wrong-${field.name}`)?.remove();
  };
  document.addEventListener("input", ({ target }) => target.matches("[aria-invalid][data-setting], #questions [aria-invalid], #study [aria-invalid]") && untold(target));

  // --- the file as the form says that it is read ---
  let turn = 0;

  async function previewed(query) {
    const own = ++turn, answer = await fetch(`view/preview?${new URLSearchParams(query)}`), value = answer.ok ? await answer.json() : { error: await answer.text() };
    if (own !== turn) return { late: true }; // another question has been asked since
    if (value.error) one("#preview").replaceChildren(node("p", { className: "no", textContent: value.error }));
    return value;
  }

  async function preview() {
    if (!one("#preview:not([data-recorded])")) return;
    const value = await previewed(study().record?.[0]?.decimal ? { decimal: study().record[0].decimal } : {});
    if (value.late) return;
    guess = value.known || {};
    fill();
    if (!value.error) drawn(value.names);
  }

  /** First rows and plots by the fields of the form; `names` where it says none. */
  async function drawn(names = []) {
    const place = one("#preview"), text = (name) => one(`#questions [name='${name}']`).value.trim();
    const [t, q, tau] = ["t", "q", "tau"].map((key) => text(`columns.${key}`).split(",").map((name) => name.trim()).filter(Boolean));
    const asked = [...t, ...q, ...tau], columns = (asked.length ? asked : names.slice(0, 12)).join(",");
    const value = await previewed({ columns, t: t[0] || "", unit: text("units.t"), decimal: text("decimal"), tau: tau.join(",") });
    if (value.error || value.late) return;
    one("#currents").hidden = !value.currents;
    const cells = (kind, row) => node("tr", {}, ...row.map((x) => node(kind, { textContent: x })));
    const first = node("div", { className: "scroll", tabIndex: 0 }, node("table", {}, node("caption", { textContent: "First rows" }), cells("th", Object.keys(value.lines)), ...value.first.map((row) => cells("td", row))));
    first.setAttribute("role", "region");
    first.setAttribute("aria-label", "First rows");
    const figures = node("div", { className: "figures" });
    const others = value.others.q ? [node("p", { className: "doubtful", textContent: `The names show positions of ${value.others.q} joints and torques of ${value.others.tau}; the robot has ${joints}. Name the columns of its joints below, or take the robot of this log.` })] : [];
    place.replaceChildren(...others, node("p", { textContent: value.stamps || `${value.rows} samples` }), node("p", { className: "note", textContent: `Columns: ${value.names.join(", ")}` }), first, figures);
    const instants = floats(value.t, Float64Array);
    const chart = (title, list, unit = "") => ({ label: `${title}, as in the file`, t: instants, panels: [{ title, unit: unit.replace("*", " "), lines: list.filter((name) => value.lines[name]).map((name, i) => ({ name, kind: `c${i % 8}`, values: floats(value.lines[name]) })) }] });
    const charts = (q.length + tau.length ? [chart("q", q, text("units.q")), chart("tau", tau, text("units.tau"))] : [chart("columns", Object.keys(value.lines))]).filter(({ panels: [{ lines }] }) => lines.length);
    if (charts.length) new Group(figures, charts, { unit: t.length ? "s" : "" });
  }
  /** The record of a study without a file of its own, such as a dataset. */
  async function recorded() {
    const place = one("#preview[data-recorded]");
    if (!place) return;
    const answer = await fetch("view/recorded"), value = answer.ok ? await answer.json() : { error: await answer.text() };
    if (value.error) return place.replaceChildren(node("p", { className: "no", textContent: value.error }));
    const figures = node("div", { className: "figures" }), t = floats(value.t, Float64Array);
    place.replaceChildren(node("p", { textContent: `${value.records.join("; ")}: ${value.rows} samples` }), figures);
    new Group(figures, Object.entries(value.lines).map(([title, lines]) => ({ label: `${title}, as the study reads it`, t, panels: [{ title, unit: value.units[title], lines: Object.entries(lines).map(([name, text], i) => ({ name, kind: `c${i % 8}`, values: floats(text) })) }] })));
  }
  // --- remedies as one change of the study: {"record.units.q": "deg"}; what is of record.scale multiplies ---
  const multiplies = (key) => key.startsWith("record.scale.");
  const records = (values) => [values.record, values.validate?.record ?? []].flat();
  /** The name of an array in the file, where a change would multiply a number. */
  const named = (key) => multiplies(key) && records(study()).flatMap((part) => part.scale?.[key.split(".")[2]] ?? []).find((x) => typeof x === "string");

  function changed(values, change) {
    const made = structuredClone(values);
    for (const [path, value] of Object.entries(change)) {
      const [section, ...keys] = path.split("."), last = keys.pop();
      for (const part of section === "record" ? records(made) : [(made[section] ??= {})]) {
        const place = keys.reduce((at, name) => (at[name] ??= {}), part), before = [place[last] ?? 1].flat();
        place[last] = multiplies(path) ? value.map((factor, k) => factor * (before.length > 1 ? before[k] : before[0])) : value;
      }
    }
    return made;
  }

  function remedies() {
    for (const place of all("[data-change]")) {
      const change = JSON.parse(place.dataset.change), steps = Object.entries(change);
      if (!steps.length || one("button, .wrong", place)) continue;
      const [key, factors] = steps.find(([path]) => named(path)) || [];
      if (key) {
        place.append(node("span", { className: "wrong", textContent: `${key} is the name ${named(key)}, which this page cannot multiply by ${listed(factors)}: on Record, write the product as numbers.` }));
        continue;
      }
      const text = steps.map(([key, value]) => (multiplies(key) ? `multiply ${key} by ${listed(value)}` : `set ${key}: ${listed(value) || "null"}`)).join(", ");
      const button = node("button", { type: "button", textContent: text[0].toUpperCase() + text.slice(1) });
      button.addEventListener("click", async () => {
        await htmx.ajax("POST", "do/study", { target: "#values", swap: "none", values: written(changed(study(), change)) });
        htmx.ajax("POST", "do/check", { target: "#findings", swap: "outerHTML" });
      });
      place.append(button);
    }
  }
  // --- estimators and settings, each a run ---
  const chosen = (data, ...names) => Object.fromEntries(names.filter((name) => data.get(name)).map((name) => [name, "1"]));
  const run = (values, more) => htmx.ajax("POST", "do/solve", { target: "#jobs", swap: "outerHTML", values: { values: JSON.stringify(values), ...more } });

  function round(data) {
    const kind = data.get("kind"), delta = data.get("delta").split(",").map((text) => text.trim()).filter(Boolean), values = study();
    values.cestac = { ...values.cestac, ...(delta.length ? { delta } : {}), ...(data.get("runs") ? { runs: number(data.get("runs")) } : {}) };
    return run(values, { kind, ...chosen(data, "anyway"), ...(kind === "advise" ? { delta: delta.join(",") } : {}) });
  }

  async function solve(data) {
    const cutoffs = data.get("cutoff").split(",").map((text) => text.trim());
    for (const method of data.getAll("method"))
      for (const cutoff of cutoffs) {
        const values = study();
        values.estimate = { ...values.estimate, method };
        if (cutoff) values.signals = { ...values.signals, lowpass: { ...values.signals?.lowpass, cutoff: number(cutoff) } };
        await run(values, { name: cutoff ? `${method}-${cutoff}` : method, ...chosen(data, "physical", "friction", "anyway") });
      }
  }
  // --- values side by side ---
  const minus = (text) => (Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−"));
  /** A value and its deviation, which has two digits and ends at the same place. */
  function measured(x, sigma) {
    if (!(sigma > 0)) return minus(String(Number(x.toPrecision(5))));
    const places = Math.min(Math.max(1 - Math.floor(Math.log10(Number(sigma.toPrecision(2)))), 0), 12);
    return `${minus(x.toFixed(places))} ± ${sigma.toFixed(places)}`;
  }

  async function compare() {
    const place = one("#compared");
    if (!place) return;
    const only = place.dataset.run, names = only ? [only] : all("#jobs [name='side']:checked").map((box) => box.value).slice(-6), key = names.join(" ");
    if (key === shown) return;
    shown = key;
    const fits = await Promise.all(names.map(async (name) => (await fetch(`runs/${name}/estimate.json`)).json()));
    if (!fits.length) return place.replaceChildren(node("p", { className: "note", textContent: "Nothing to compare yet." }));
    const used = fits.map((fit) => (only && fit.sets?.find(({ name }) => name === fit.model_columns)) || fit); // of a run alone, as in its report
    const columns = used.map((fit) => Object.fromEntries(fit.names.map((name, k) => [name, [fit.X[k], (fit.sigma_corrected || fit.sigma)[k]]])));
    const units = Object.assign({}, ...fits.map((fit) => fit.units));
    const cell = (name, column) => {
      const own = column[name], first = columns[0][name];
      if (!own) return node("td", { textContent: "–" });
      const far = first && column !== columns[0] ? (own[0] - first[0]) / Math.hypot(own[1] || 0, first[1] || 0) : null;
      const text = measured(own[0], own[1] || 0), known = far !== null && Number.isFinite(far);
      return node("td", { className: known && Math.abs(far) > 3 ? "far" : "", textContent: known ? `${text} (${far > 0.05 ? "+" : ""}${minus(far.toFixed(1))})` : text });
    };
    const show = ({ columns: of = {}, note: more = "", error = more }) => { // of: the columns of the robot file
      const head = node("tr", {}, ...["parameter", "unit", ...names, ...Object.keys(of)].map((text) => node("th", { scope: "col", textContent: text })));
      const rows = Object.keys(units).map((name) => node("tr", {}, node("th", { scope: "row", textContent: name }), node("td", { textContent: units[name].replace("**2", "²").replaceAll("*", " ") }), ...columns.map((column) => cell(name, column)), ...Object.values(of).map((texts) => node("td", { textContent: minus(texts[name]) }))));
      const table = node("div", { className: "scroll tall", tabIndex: 0 }, node("table", {}, node("thead", {}, head), node("tbody", {}, ...rows)));
      table.setAttribute("role", "region");
      table.setAttribute("aria-label", "Values of the runs");
      const note = names.length > 1 ? `± σ, the standard deviation. In brackets, the difference from ${names[0]} in deviations, (X − X₁)/√(σ² + σ₁²); above 3 it is marked.` : `± σ, the standard deviation; –: removed, as if zero. ${error}`;
      place.replaceChildren(node("p", { className: "note", textContent: note }), table);
    };
    show({});
    if (!only) return;
    const answer = await fetch(`view/changes?run=${only}`);
    show(answer.ok ? await answer.json() : {});
  }

  document.addEventListener("htmx:afterSettle", (event) => {
    if (event.target.id === "study" && one("#questions")) { fill(); drawn(); }
    remedies();
    compare();
  });
  for (const show of [preview, recorded, remedies, compare]) show();
})();
