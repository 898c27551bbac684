// The plots: figures from Python, filled with the chosen runs and dressed for light or dark.

const figures = read("figures");
const faint = 0.28;

function dressed(figure) {
  const { layout } = figure;
  const ink = colour("--ink"), line = colour("--line"), clear = "rgba(0,0,0,0)";
  Object.assign(layout, { paper_bgcolor: clear, plot_bgcolor: clear });
  layout.font = { family: colour("--sans"), size: 12, color: colour("--quiet") };
  for (const [name, axis] of Object.entries(layout)) {
    if (/^[xy]axis/.test(name)) Object.assign(axis, { gridcolor: line, zerolinecolor: line });
  }
  for (const shape of layout.shapes ?? []) shape.line.color = ink;
  for (const trace of figure.data) if (trace.meta?.ink) trace.line.color = colour("--quiet");
  return figure;
}

function plot(id, figure) {
  const { data: traces, layout } = dressed(structuredClone(figure));
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
  return Plotly.react(id, traces, layout, config);
}

const translucent = (hex, alpha) =>
  `rgba(${[1, 3, 5].map((k) => Number.parseInt(hex.slice(k, k + 2), 16)).join(",")},${alpha})`;

// What a template trace shows of a run.
function filled(template, run, states, look) {
  const { kind, state } = template.meta, name = states[state];
  const channel = { truth: name, estimate: `estimate_${name}`, reference: `reference_${name}`, error: `error_${name}` }[kind];
  const y = run[channel ?? kind];
  if (!y) return null;
  const trace = { ...structuredClone(template), x: run.time, y };
  if (kind === "estimate") trace.line.color = colour("--ink");
  else if (kind === "reference") trace.line.color = colour("--quiet");
  else trace.line = { ...trace.line, color: translucent(look.colour, look.faint ? faint : 1) };
  if (look.faint) trace.line.width = 1;
  if (trace.fill) trace.fillcolor = translucent(look.colour, 0.18);
  if (kind === "truth") {
    trace.name = data.arms[look.arm];
    trace.legendgroup = look.arm;
    trace.showlegend = state === 0 && look.named;
  } else trace.showlegend = Boolean(trace.showlegend) && look.chosen;
  return trace;
}

// Other observers and other runs behind, faint ones first; the chosen run in front.
function curves(group, index, display) {
  const positions = display.states.value === "positions";
  const states = positions ? STATES.slice(0, 2) : STATES.slice(2);
  const alike = (other) => ["table", "title", "controller", "uncertainty", "case"].every((key) => other[key] === group[key]);
  const groups = display.arms.checked ? data.groups.filter(alike) : [group];
  const shown = [];
  for (const other of groups) {
    const look = { arm: other.arm, colour: data.colours[other.arm] };
    for (let r = 0; display.runs.checked && r < other.runs; r++) {
      if (r !== index) shown.push({ run: load(other, r), look: { ...look, faint: true }, kinds: ["truth", "error"] });
    }
  }
  for (const other of groups) {
    const chosen = other === group;
    const look = { arm: other.arm, colour: data.colours[other.arm], chosen, named: true };
    const kinds = chosen ? null : ["truth", "error", "force_low", "force_high", "force"];
    shown.push({ run: load(other, index), look, kinds, last: chosen });
  }
  shown.sort((a, b) => Boolean(a.look.faint) < Boolean(b.look.faint) ? 1 : -1).sort((a, b) => Boolean(a.last) - Boolean(b.last));
  const figure = structuredClone(figures.curves);
  figure.data = shown.flatMap(({ run, look, kinds }) =>
    figures.curves.data
      .filter(({ meta }) => !kinds || kinds.includes(meta.kind))
      .map((template) => filled(template, run, states, look))
      .filter((trace) => trace !== null),
  );
  figure.layout.meta[positions ? "positions" : "velocities"].forEach((title, row) => {
    figure.layout.annotations[row].text = title;
  });
  return plot("curves", figure);
}
