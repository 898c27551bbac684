// What the page does: choose a run, play it, filter the tables.

const form = $("#choice"), display = $("#display"), slider = $("#slider"), button = $("#play");
const KEYS = ["table", "controller", "uncertainty", "case", "arm"];
const stage = new Cart($("#stage"));
const player = { time: 0, end: 0, playing: false };
let chosen, index, run, ready = false;

const number = (value, digits = 3) =>
  value === undefined ? "" : value.toFixed(digits).replace(/^-(?!0\.?0*$)/, "−").replace("-", "");
const vector = (values) => `[${values.join(", ")}]`.replaceAll("-", "−");
const names = {
  table: (group) => `${group.table}: ${group.title}`,
  controller: (group) => group.name,
  uncertainty: (group) => group.uncertainty,
  case: (group) => `${group.case ? `case ${group.case}: ` : ""}${vector(group.start)}`,
  arm: (group) => data.arms[group.arm],
};
// What tells two groups apart in a select.
const values = { ...Object.fromEntries(KEYS.map((key) => [key, (group) => group[key]])), table: names.table };

function options(select, pairs, wanted) {
  select.replaceChildren(...pairs.map(([value, text]) => new Option(text, value, false, value === wanted)));
  if (!pairs.some(([value]) => value === wanted)) select.selectedIndex = 0;
  select.disabled = pairs.length < 2;
}

// Each select offers what the ones before it leave; the same choice is kept where it can be. A law has another name in
// another table: SMC goes on as SMC-TRACKING, not as the first that is there.
function choose(wanted) {
  let left = data.groups;
  for (const key of KEYS) {
    const pairs = new Map(left.map((group) => [values[key](group), names[key](group)]));
    const alike = key === "controller" && !pairs.has(wanted[key]) && left.find((group) => group.law === chosen?.law);
    options(form[key], [...pairs], alike ? alike[key] : wanted[key]);
    left = left.filter((group) => values[key](group) === form[key].value);
  }
  [chosen] = left;
  const runs = Array.from({ length: chosen.runs }, (_, r) => [String(r + 1), `${r + 1}${chosen.failed[r] ? " (failed)" : ""}`]);
  options(form.run, runs, wanted.run);
  index = Number(form.run.value) - 1;
  show();
}

function show() {
  run = load(chosen, index);
  stage.show(run, chosen.plants[index], palette(chosen.arm));
  document.documentElement.style.setProperty("--arm", palette(chosen.arm));
  $(".stage").classList.toggle("no-reference", chosen.reference === null);
  player.end = run.time.at(-1);
  slider.max = player.end;
  const [M, m, l, g] = chosen.plants[index];
  const measured = ["mse_h", "mse_theta"].map((name) => chosen[name][index]);
  $("#about").textContent =
    `Plant: cart ${M} kg, bob ${m} kg, rod ${l} m, g = ${String(g).replace("-", "−")} m/s²` +
    `${g < 0 ? ": θ = 0 hangs" : ": θ = 0 stands"}. ` +
    (chosen.failed[index]
      ? `The run failed at ${chosen.duration[index].toFixed(2)} s and ends there.`
      : `MSE of h ${measured[0]} m², of θ ${measured[1]} rad².`);
  $("#stage").setAttribute("aria-label", `Cart pendulum, ${KEYS.map((key) => names[key](chosen)).join(", ")}, run ${index + 1}`);
  if (ready) curves(chosen, index, display).then(cursor);
  seek(Math.min(player.time, player.end));
}

function seek(time) {
  player.time = Math.min(Math.max(time, 0), player.end);
  stage.draw(player.time);
  slider.value = player.time;
  slider.setAttribute("aria-valuetext", `${player.time.toFixed(2)} seconds`);
  $("#time").value = `${player.time.toFixed(2)} s`;
  const rows = document.querySelectorAll(".readout tbody tr");
  ["", "estimate_", "reference_"].forEach((prefix, row) => {
    STATES.forEach((name, column) => {
      rows[row].cells[column + 1].textContent = number(run[prefix + name] && at(run, prefix + name, player.time));
    });
  });
  rows[0].cells[5].textContent = number(at(run, "force", player.time), 1);
  cursor();
}

// A line behind the curves: moving a shape of Plotly's takes too long for every frame.
function cursor() {
  if (!ready) return;
  const { margin, xaxis } = $("#curves").layout, [from, to] = xaxis.range;
  const share = (player.time - from) / (to - from), width = $("#curves").clientWidth - margin.l - margin.r;
  $("#cursor").hidden = !(share >= 0 && share <= 1);
  $("#cursor").style.transform = `translateX(${margin.l + share * width}px)`;
}

function play(on) {
  player.playing = on;
  if (on && player.time >= player.end) player.time = 0;
  button.textContent = on ? "❚❚" : "▶";
  button.setAttribute("aria-label", on ? "Pause" : "Play");
  let before;
  const frame = (now) => {
    if (!player.playing) return;
    const passed = before === undefined ? 0 : Math.min((now - before) / 1000, 0.1);
    before = now;
    seek(player.time + passed * Number($("#speed").value));
    if (player.time >= player.end) play(false);
    else requestAnimationFrame(frame);
  };
  if (on) requestAnimationFrame(frame);
  else seek(player.time);
}

function effect() {
  const wanted = $("#effects-of")?.selectedIndex ?? 0;
  document.querySelectorAll(".effect").forEach((one, index) => {
    one.hidden = index !== wanted;
  });
}

function compare() {
  if (figures.scatter) plot("scatter", tinted(figures.scatter));
  else $("#compared-scatter").hidden = true;
  plot("bars", tinted(figures.bars[$("#bars-of").value]));
}

form.addEventListener("change", () => choose(Object.fromEntries([...KEYS, "run"].map((key) => [key, form[key].value]))));
display.addEventListener("change", () => curves(chosen, index, display).then(cursor));
button.addEventListener("click", () => play(!player.playing));
slider.addEventListener("input", () => seek(Number(slider.value)));
document.addEventListener("keydown", (event) => {
  const own = event.target.closest("a, button, select, input:not([type=range])"); // there the key has its own use
  const step = event.target.id === "stage" ? { ArrowLeft: -0.05, ArrowRight: 0.05 }[event.key] : undefined;
  if (event.key === " " && !own) play(!player.playing);
  else if (step) seek(player.time + step * (event.shiftKey ? 20 : 1));
  else return;
  event.preventDefault();
});
$("#filter").addEventListener("input", (event) => filter(event.currentTarget));
$("#filter").addEventListener("reset", (event) => {
  const form = event.currentTarget;
  setTimeout(() => filter(form)); // once it is reset
  form.elements[0].focus();
});
$("#effects-of")?.addEventListener("change", effect);
for (const form of document.forms) form.addEventListener("submit", (event) => event.preventDefault());
$("#bars-of").addEventListener("change", compare);
for (const watch of document.querySelectorAll(".watch")) {
  watch.addEventListener("click", () => {
    const group = data.groups[watch.dataset.group];
    player.time = 0;
    choose(Object.fromEntries(KEYS.map((key) => [key, values[key](group)])));
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    $("#watch").scrollIntoView({ behavior: still ? "auto" : "smooth" });
    if (!still) play(true);
    $("#stage").focus({ preventScroll: true });
  });
}

filter($("#filter"));
effect();
try {
  await unpack();
  const table = data.groups.filter((group) => group.table === data.groups[0].table && group.controller === data.groups[0].controller);
  const first = table.findLast((group) => group.arm === "with") ?? table.at(-1);
  choose(Object.fromEntries(KEYS.map((key) => [key, values[key](first)])));
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflate("plotly"));
  document.head.append(script);
  ready = true;
  await curves(chosen, index, display);
  $("#curves").on("plotly_click", ({ points }) => seek(points[0].x));
  $("#curves").on("plotly_relayout", cursor);
  cursor();
  compare();
  new ResizeObserver(() => seek(player.time)).observe($("#stage"));
  dark.addEventListener("change", () => {
    show();
    compare();
  });
  document.documentElement.dataset.ready = "";
} catch (error) {
  $("#notice").textContent = `The runs cannot be shown (${error.message}). This page needs a browser of 2023 or later.`;
  $("#notice").hidden = false;
  throw error;
}
