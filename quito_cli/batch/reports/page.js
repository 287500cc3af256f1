"use strict";
// Headings sort their table, a field shows the rows that have its text; without it all is there.
for (const table of document.querySelectorAll("table")) {
  const body = table.tBodies[0];
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = head.querySelector("button");
    if (!button) return;
    button.addEventListener("click", () => {
      const falling = head.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", falling ? "descending" : "ascending");
      const number = (row) => parseFloat(row.cells[column].dataset.value);
      const words = (row) => row.cells[column].textContent;
      const compare = (a, b) => {
        const [x, y] = [number(a), number(b)];
        if (!isNaN(x) && !isNaN(y)) return falling ? y - x : x - y;
        if (isNaN(x) !== isNaN(y)) return isNaN(x) ? 1 : -1; // what is not known is last
        const order = words(a).localeCompare(words(b), "en", { numeric: true });
        return falling ? -order : order;
      };
      body.append(...[...body.rows].sort(compare));
    });
  });
}
const field = document.querySelector("input");
field.hidden = false;
field.addEventListener("input", () => {
  const wanted = field.value.toLowerCase();
  for (const part of document.querySelectorAll("#cases tbody tr, .case")) {
    part.hidden = !part.dataset.name.toLowerCase().includes(wanted);
  }
});
// A link to a case opens it.
const open = () => {
  const target = document.getElementById(location.hash.slice(1));
  if (target && "open" in target) {
    target.open = true;
    target.scrollIntoView();
  }
};
window.addEventListener("hashchange", open);
open();
