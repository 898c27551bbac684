// The filter of the tables.

function filter(form) {
  const wanted = Object.fromEntries(new FormData(form));
  const words = wanted.text.toLowerCase();
  const fits = (value, key) => !wanted[key] || value === undefined || value === wanted[key];
  let shown = 0, all = 0;
  for (const body of document.querySelectorAll(".cells tbody")) {
    const { table, controller } = body.dataset;
    const here = fits(table, "table") && fits(controller, "controller");
    let rows = 0;
    for (const row of body.querySelectorAll(".row")) {
      const { arm, state, metric } = row.dataset;
      const text = row.textContent.replace(/\s+/g, " ").toLowerCase();
      row.hidden = !(here && fits(arm, "arm") && fits(state, "state") && fits(metric, "metric") && text.includes(words));
      rows += !row.hidden;
      if (metric) {
        all += 1;
        shown += !row.hidden;
      }
    }
    body.hidden = rows === 0;
  }
  for (const box of document.querySelectorAll(".box:has(.cells)")) {
    box.hidden = !$("tbody:not([hidden])", box);
  }
  $("#none").hidden = shown > 0;
  $("#count").value = `${shown} of ${all} rows`;
}
