// Figures come to life, tables are sorted and filtered, what is folded opens for print.

(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  for (const box of document.querySelectorAll(".figures")) if (box.querySelector("figure[data-series]")) new Group(box, data);

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
      const button = htmlNode("button", { type: "button", title: "Sort by this column" });
      button.append(...head.childNodes);
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

  for (const table of document.querySelectorAll("table[data-only]")) {
    const bar = htmlNode("div", { className: "tools" });
    const button = htmlNode("button", { type: "button", textContent: table.dataset.only }, bar);
    button.setAttribute("aria-pressed", "false");
    button.addEventListener("click", () => {
      const only = button.getAttribute("aria-pressed") === "false";
      button.setAttribute("aria-pressed", String(only));
      for (const row of table.tBodies[0].rows) row.hidden = only && row.dataset.kind !== table.dataset.kind;
    });
    table.parentElement.before(bar);
  }

  window.addEventListener("beforeprint", () => { for (const fold of document.querySelectorAll("details")) fold.open = true; });
})();
