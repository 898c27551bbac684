// The plots: figures from Python, filled with the chosen runs and dressed for light or dark.

const figures = read("figures");
const [FAINT, OTHER, CHOSEN] = [0, 1, 2];
const FORCE = ["force_low", "force_high", "force"];
// All that there are: Plotly's own set has one that uploads the figure.
const BUTTONS = [["toImage"], ["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]];
const KINDS = [["truth", "error"], ["truth", "error", ...FORCE], ["truth", "estimate", "reference", "sensor", "error", ...FORCE]];

function dressed(figure) {
  const { layout } = figure;
  const ink = colour("--ink"), line = colour("--line"), clear = "rgba(0,0,0,0)";
  Object.assign(layout, { paper_bgcolor: clear, plot_bgcolor: clear });
  layout.font = { family: colour("--sans"), size: 12, color: colour("--quiet") };
  for (const [name, axis] of Object.entries(layout)) {
    if (/^[xy]axis/.test(name)) Object.assign(axis, { gridcolor: line, zerolinecolor: line });
  }
  layout.modebar = { bgcolor: clear, color: colour("--quiet"), activecolor: ink };
  for (const note of layout.annotations ?? []) note.bgcolor = colour("--ground");
  for (const trace of figure.data) if (trace.meta?.ink) trace.line.color = colour("--quiet");
  return figure;
}

// A figure from Python has the arms' colours on light ground.
function tinted(figure) {
  const text = JSON.stringify(figure);
  return JSON.parse(Object.keys(data.colours).reduce((all, arm) => all.replaceAll(data.colours[arm][0], palette(arm)), text));
}

function plot(id, figure) {
  const { data: traces, layout } = dressed(structuredClone(figure));
  return Plotly.react(id, traces, layout, { responsive: true, displaylogo: false, plotlyServerURL: "", modeBarButtons: BUTTONS });
}

const translucent = (hex, alpha) =>
  `rgba(${[1, 3, 5].map((k) => Number.parseInt(hex.slice(k, k + 2), 16)).join(",")},${alpha})`;

// What a template trace shows of a run.
function filled(template, run, states, look) {
  const { kind, state } = template.meta, name = states[state];
  const y = run[state === undefined ? kind : kind === "truth" ? name : `${kind}_${name}`];
  if (!y) return null;
  const trace = { ...structuredClone(template), x: run.time, y };
  if (kind === "estimate") trace.line.color = colour("--ink");
  else if (kind === "reference" || kind === "sensor") trace.line.color = colour("--quiet");
  else trace.line = { ...trace.line, color: translucent(look.colour, look.rank === FAINT ? 0.28 : 1) };
  if (look.rank === FAINT) trace.line.width = 1;
  if (trace.fill) trace.fillcolor = translucent(look.colour, 0.18);
  if (kind === "truth") {
    trace.name = data.arms[look.arm];
    trace.legendgroup = look.arm;
    trace.showlegend &&= look.rank !== FAINT;
  }
  return trace;
}

// Faint other runs behind, other observers before them, the chosen run in front.
function curves(group, index, display) {
  const positions = display.states.value === "positions";
  const states = positions ? STATES.slice(0, 2) : STATES.slice(2);
  const alike = (other) => ["table", "title", "controller", "uncertainty", "case"].every((key) => other[key] === group[key]);
  const groups = display.arms.checked ? data.groups.filter(alike) : [group];
  const shown = [];
  for (const other of groups) {
    for (let r = 0; r < other.runs; r++) {
      const rank = r !== index ? FAINT : other === group ? CHOSEN : OTHER;
      if (rank === FAINT && !display.runs.checked) continue;
      shown.push({ run: load(other, r), look: { arm: other.arm, colour: palette(other.arm), rank } });
    }
  }
  shown.sort((a, b) => a.look.rank - b.look.rank);
  const figure = structuredClone(figures.curves);
  figure.data = shown.flatMap(({ run, look }) =>
    figures.curves.data
      .filter(({ meta }) => KINDS[look.rank].includes(meta.kind))
      .map((template) => filled(template, run, states, look))
      .filter((trace) => trace !== null),
  );
  figure.layout.uirevision = `${group.table} ${positions}`; // keeps what is enlarged from run to run
  figure.layout.meta[positions ? "positions" : "velocities"].forEach((title, row) => {
    figure.layout.annotations[row].text = title;
  });
  key(figure.data.filter((trace) => trace.showlegend));
  return plot("curves", figure);
}

// What the lines are, outside of the plot: there it covers none.
function key(traces) {
  const entries = new Map(traces.map(({ name, line }) => [name, line]));
  const item = ([name, line]) => {
    const entry = document.createElement("li"), swatch = document.createElement("span");
    swatch.className = "swatch";
    swatch.style.borderTop = `2px ${{ dash: "dashed", dot: "dotted" }[line.dash] ?? "solid"} ${line.color}`;
    entry.append(swatch, name);
    return entry;
  };
  $("#curves-key").replaceChildren(...[...entries].map(item));
}
