// The page of `lptn watch --to page`: the table of nodes, the last hours' lines, and what was said.

import uPlot from "/uplot/uPlot.esm.js";
import { h } from "/sections.js";
import { color, onLook } from "/look.js";

const PAUSE = 1000, COLOURS = 8, KEPT = 7200, NEAR = 10;  // ms between two questions; colours; rows; K below a limit
const SINCE_1970 = 3e8;  // s; a clock that says more counts from there
const place = id => document.getElementById(id);
let count = 0, rows = [], names = [], chosen = "", chart = null, newest = null;

async function ask() {
  try {
    const answer = await fetch(`/live?since=${count}`);
    if (!answer.ok) throw new Error(await answer.text());
    take(await answer.json());
  } catch (error) { fill(place("work"), h("span", { className: "failed", role: "alert" }, error instanceof TypeError ? "The watch has ended." : error.message)); }
  setTimeout(ask, newest && count < newest.count ? 0 : PAUSE);
}

function take(state) {
  if (!state.nodes) return;
  const known = Object.keys(state.nodes).join() === names.join();
  if (!known || state.first !== count) rows = state.first === count && known ? rows : [];
  names = Object.keys(state.nodes), newest = state;
  rows = [...rows, ...state.rows].slice(-KEPT);
  count = state.first + state.rows.length;
  const counts = Object.entries(state.counts).filter(([, number]) => number).map(([word, number]) => `${number.toLocaleString("en")} ${word}`);
  fill(place("work"), h("span", null, `${clock(state.time)}  ${counts.join(", ")}${state.missing.length ? `; silent: ${state.missing.join(", ")}` : ""}`));
  fill(place("table"), table(state));
  fill(place("said"), h("h2", null, "What happened"), h("ul", { className: "plain" }, state.said.toReversed().map(([time, words]) => h("li", null, h("small", null, `${clock(time)} `), words))));
  draw(!known);
}

// What is new beside what stands there: a button keeps its focus and its press, a screen reader says what is new alone.
function fill(old, ...made) {
  const there = [...old.childNodes];
  made.forEach((each, k) => {
    if (!there[k]) old.append(each);
    else if (there[k].nodeName !== each.nodeName || there[k].nodeType === Node.TEXT_NODE) { if (!there[k].isEqualNode(each)) there[k].replaceWith(each); }
    else {
      for (const { name } of [...there[k].attributes]) if (!each.hasAttribute(name)) there[k].removeAttribute(name);
      for (const { name, value } of each.attributes) if (there[k].getAttribute(name) !== value) there[k].setAttribute(name, value);
      fill(there[k], ...each.childNodes);
    }
  });
  there.slice(made.length).forEach(each => each.remove());
}

const number = (value, figures = 1) => value == null ? "–" : value.toFixed(figures).replace("-", "−");
const clock = seconds => seconds > SINCE_1970 ? new Date(1000 * seconds).toLocaleTimeString() : `${Math.round(seconds)} s`;
const span = seconds => seconds == null ? "never" : seconds < 90 ? `${Math.round(seconds)} s` : seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;

function table(state) {
  const alarms = Object.fromEntries(state.alarms.map(alarm => [alarm.channel.replace(/^temperature\./, ""), [alarm.kind, alarm.detail].filter(Boolean).join(" ")]));
  const heads = ["node", "now [°C]", "± [K]", "limit [°C]", "limit in", "torque", "sensor"];
  const row = ([name, one]) => h("tr", { className: one.limit != null && one.high > one.limit - NEAR ? "doubt" : "" },
    h("td", null, h("button", { ariaPressed: String(name === chosen), onclick: () => { chosen = chosen === name ? "" : name; take({ ...newest, first: count, rows: [] }); draw(true); } }, name)),
    h("td", { className: "n" }, number(one.temperature)), h("td", { className: "soft" }, one.high == null ? "" : `± ${number((one.high - one.low) / 2)}`),
    h("td", { className: "n" }, number(one.limit, 0)),
    h("td", { className: "n" }, one.limit == null || state.seconds_since_assessment == null ? "–" : one.latest == null && one.time_to_limit == null && one.earliest == null ? "never" : `${span(one.time_to_limit)} (${span(one.earliest)} to ${span(one.latest)})`),
    h("td", { className: "n" }, one.torque_scale == null ? "–" : `${Math.round(100 * one.torque_scale)} %`),
    h("td", null, alarms[name] ?? one.trust));
  const others = Object.entries(alarms).filter(([name]) => !(name in state.nodes)).map(([name, words]) => h("p", { className: "doubt" }, `${name}: ${words}`));
  return h("div", null, h("table", { className: "parameters" }, h("thead", null, h("tr", null, heads.map(head => h("th", null, head)))), h("tbody", null, Object.entries(state.nodes).map(row))), others);
}

function draw(anew) {
  const shown = chosen ? [names.indexOf(chosen)] : names.map((_, k) => k), element = place("lines");
  const limit = chosen ? newest.nodes[chosen].limit : null;
  const lines = [rows.map(row => row[0]), ...shown.map(k => rows.map(row => row[1][k]))];
  if (chosen) lines.push(rows.map(row => row[2][shown[0]]), rows.map(() => limit));
  if (!anew && chart) return chart.setData(lines);
  chart?.destroy();
  const axis = { stroke: color("--soft"), grid: { stroke: color("--shade"), width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif" };
  const line = (label, stroke, more = {}) => ({ label, stroke: color(stroke), width: 1.5, points: { show: false }, spanGaps: false, value: (_, x) => number(x), ...more });
  chart = new uPlot({
    width: element.clientWidth || 800, height: 420, scales: { x: { time: rows.at(-1)?.[0] > SINCE_1970 } },
    axes: [axis, { ...axis, size: 46, label: "°C", labelSize: 16 }],
    series: [{}, ...shown.map((k, place) => line(names[k], `--colour${place % COLOURS}`)),
      ...chosen ? [line("reading", "--points", { width: 0, points: { show: true, size: 3 } }), line("limit", "--limit", { dash: [6, 4] })] : []],
  }, lines, element);
}
onLook(() => newest && draw(true));
addEventListener("resize", () => chart?.setSize({ width: place("lines").clientWidth, height: 420 }));
ask();
