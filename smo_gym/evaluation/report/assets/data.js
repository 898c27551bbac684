// The runs: unpacked once, decoded one at a time.

const $ = (selector, from = document) => from.querySelector(selector);
const read = (id) => JSON.parse($(`#${id}`).textContent);
const data = read("data");
const dark = matchMedia("(prefers-color-scheme: dark)");
const palette = (arm) => data.colours[arm][dark.matches ? 1 : 0];
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

async function inflate(id) {
  const bytes = Uint8Array.from(atob($(`#${id}`).textContent), (character) => character.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

const channels = data.channels.length;
let limits, low, high;
for (const group of data.groups) group.starts = [];

async function unpack() {
  const buffer = await inflate("packed");
  let blocks = 0, values = 0;
  for (const group of data.groups) {
    const count = group.runs + (group.reference === null ? 0 : 1);
    for (let i = 0; i < count; i++) group.starts.push(values + i * channels * group.samples);
    blocks += count;
    values += count * channels * group.samples;
  }
  limits = new Float32Array(buffer, 0, 2 * channels * blocks);
  low = new Uint8Array(buffer, limits.byteLength, values);
  high = new Int8Array(buffer, limits.byteLength + values, values);
}

// The channels of a group's block as arrays; the block after its last run is its reference.
function decode(group, block) {
  const found = {};
  data.channels.forEach((name, channel) => {
    const place = 2 * ((group.first + block) * channels + channel);
    const least = limits[place], step = (limits[place + 1] - least) / data.levels[channel];
    const values = new Float64Array(group.samples);
    let at = group.starts[block] + channel * group.samples, whole = 0;
    for (let k = 0; k < group.samples; k++, at++) {
      whole += 256 * high[at] + low[at];
      values[k] = least + whole * step;
    }
    found[name] = values;
  });
  return found;
}

const STATES = data.channels.slice(0, 4);

// A run until its end: time, channels, estimates and reference.
function load(group, index) {
  const run = decode(group, index);
  const end = Math.min(Math.floor(group.duration[index] / group.period + 1e-6) + 1, group.samples);
  for (const name of STATES) {
    run[`estimate_${name}`] = run[name].map((value, k) => value - run[`error_${name}`][k]);
  }
  if (group.reference !== null) {
    const reference = decode(group, group.runs);
    for (const name of STATES) run[`reference_${name}`] = reference[name];
  }
  for (const name of Object.keys(run)) run[name] = run[name].subarray(0, end);
  run.time = Float64Array.from({ length: end }, (_, k) => k * group.period);
  return run;
}

// A channel at a time between two instants.
function at(run, name, time) {
  const last = run.time.length - 1;
  if (last === 0) return run[name][0];
  const place = Math.min(time / run.time[1], last), k = Math.min(Math.floor(place), last - 1);
  return run[name][k] + (place - k) * (run[name][k + 1] - run[name][k]);
}
