// Tables that a click on a column's head sorts: up, then down.

const words = new Intl.Collator("en", { numeric: true });

function compare(a, b) {
  const [x, y] = [parseFloat(a), parseFloat(b)];
  if (isNaN(x) && isNaN(y)) return words.compare(a, b);
  return x - y;
}

function sort(table, column) {
  const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
  const text = (row) => row.cells[column].textContent;
  const down = heads[column].getAttribute("aria-sort") === "ascending";
  for (const head of heads) head.removeAttribute("aria-sort");
  heads[column].setAttribute("aria-sort", down ? "descending" : "ascending");
  const rows = [...body.rows], numbers = rows.some((row) => !isNaN(parseFloat(text(row))));
  const none = (row) => numbers && isNaN(parseFloat(text(row))); // stands last, either way
  rows.sort((a, b) => none(a) - none(b) || (down ? -1 : 1) * compare(text(a), text(b)));
  body.append(...rows);
}

for (const table of document.querySelectorAll("table.sortable")) {
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    button.addEventListener("click", () => sort(table, column));
    head.append(button);
  });
}
