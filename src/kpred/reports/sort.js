"use strict";
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0], first = [...body.rows];
  for (const head of table.tHead.rows[0].cells) {
    if (!head.textContent) continue;
    head.tabIndex = 0;
    head.title = "Sort by " + head.textContent + "; a third click restores the order";
    const sort = () => {
      const before = head.getAttribute("aria-sort");
      const way = before === "ascending" ? "descending" : before === "descending" ? null : "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      if (way === null) { body.append(...first); return; }
      head.setAttribute("aria-sort", way);
      const key = row => row.cells[head.cellIndex].dataset.key ?? "";
      const numeric = first.every(row => key(row) === "" || !isNaN(key(row)));
      const sign = way === "ascending" ? 1 : -1;
      body.append(...first.slice().sort((a, b) => {
        const x = key(a), y = key(b);
        if (x === "" || y === "") return (x === "") - (y === "");
        return sign * (numeric ? x - y : x.localeCompare(y, undefined, {numeric: true}));
      }));
    };
    head.addEventListener("click", sort);
    head.addEventListener("keydown", event => { if (event.key === "Enter") sort(); });
  }
}
const search = document.getElementById("search");
if (search) search.addEventListener("input", () => {
  const words = search.value.toLowerCase().split(/\s+/);
  for (const row of document.querySelectorAll("table.sortable tbody tr, .sheet figure"))
    row.hidden = !words.every(word => row.textContent.toLowerCase().includes(word));
});
