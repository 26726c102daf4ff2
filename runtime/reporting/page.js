// Figures come to life, tables are sorted, what is folded opens for print.

(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  for (const box of document.querySelectorAll(".figures")) {
    const charts = [...box.querySelectorAll("figure[data-series]")].map((figure) => {
      const { start, t, measured, predicted, unit, source } = data[figure.dataset.series];
      return { figure, label: figure.dataset.label, t: Float64Array.from(floats(t), (x) => x + start), panels: torques(floats(measured), floats(predicted), unit, source) };
    });
    if (charts.length) new Group(box, charts);
  }

  /** What a cell is sorted by: the number it begins with, else its text; empty cells and - come last. */
  function worth(cell) {
    const text = cell.textContent.trim().replace("−", "-"), number = parseFloat(text);
    return text === "" || text === "-" ? null : Number.isNaN(number) ? text : number;
  }

  function compare(a, b, down) {
    if (a === null || b === null) return (a === null) - (b === null);
    const order = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
    return down ? -order : order;
  }

  for (const table of document.querySelectorAll("table.sortable")) {
    const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells], first = [...body.rows];
    heads.forEach((head, column) => {
      const button = node("button", { type: "button", title: "Sort by this column" }, ...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const next = { ascending: "descending", descending: "" }[head.getAttribute("aria-sort") ?? ""] ?? "ascending";
        for (const other of heads) other.removeAttribute("aria-sort");
        if (next) head.setAttribute("aria-sort", next);
        const values = new Map(first.map((row) => [row, worth(row.cells[column])]));
        body.append(...(next ? [...first].sort((a, b) => compare(values.get(a), values.get(b), next === "descending")) : first));
      });
    });
  }

  let opened = [];
  window.addEventListener("beforeprint", () => {
    opened = document.querySelectorAll("details:not([open])");
    for (const fold of opened) fold.open = true;
  });
  window.addEventListener("afterprint", () => { for (const fold of opened) fold.open = false; });
})();
