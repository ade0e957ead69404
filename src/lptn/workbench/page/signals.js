// All signals of a run, by place: a click adds one to the last of a person's own plots, and dragging to any of them.

import { h } from "/sections.js";

const UNITS = { torque: "N·m", current: "A", velocity: "rad/s", power: "W", speed: "m/s", temperature: "°C", predicted: "°C", error: "K" };
const CARRIED = "text/x-signal";

export const unitOf = signal => UNITS[signal.split(".")[0]] ?? "";
const placeOf = signal => signal.slice(signal.indexOf(".") + 1);

// What the log has of a run, and what the model says of its nodes.
export const signalsOf = ({ segments, nodes }, key) => [...segments.find(each => each.key === key).signals, ...nodes.flatMap(node => [`predicted.${node}`, `error.${node}`])];

// What is dropped on an element is added to a plot, or to a new one.
export function dropped(element, page, number) {
  element.addEventListener("dragover", event => event.dataTransfer.types.includes(CARRIED) && event.preventDefault());
  element.addEventListener("drop", event => {
    const signal = event.dataTransfer.getData(CARRIED), { plots } = page.state.written;
    if (!signal) return;
    event.preventDefault();
    page.order({ what: "note", plots: number in plots ? plots.with(number, [...new Set([...plots[number], signal])]) : [...plots, [signal]] });
  });
}

export function signals(page) {
  const { state, picked, filter } = page;
  if (!state.tiles) return [];
  const { plots } = state.written, last = plots.at(-1) ?? [], words = filter.toLowerCase().split(/\s+/);
  const all = signalsOf(state, picked[0].segment), found = all.filter(name => words.every(word => name.toLowerCase().includes(word)));
  const toggle = name => page.order({ what: "note", plots: [...plots.slice(0, -1), last.includes(name) ? last.filter(each => each !== name) : [...last, name]] });
  // No browser but Chromium drags a button.
  const leaf = (name, shown) => h("span", { id: `signal ${name}`, className: "leaf", role: "button", tabIndex: 0, draggable: true, ariaPressed: last.includes(name), title: `${name}${unitOf(name) && ` [${unitOf(name)}]`}`,
    ondragstart: event => event.dataTransfer.setData(CARRIED, name), onclick: () => toggle(name),
    onkeydown: event => ["Enter", " "].includes(event.key) && (event.preventDefault(), toggle(name)) }, shown);
  const places = [...new Set([...state.nodes, ...all.map(placeOf)])];
  const group = place => h("details", { id: `signals of ${place}` }, h("summary", null, place), all.filter(name => placeOf(name) === place).map(name => leaf(name, name.slice(0, name.indexOf(".")))));
  const fresh = h("button", { id: "new plot", disabled: plots.length > 0 && !last.length, onclick: () => page.order({ what: "note", plots: [...plots, []] }) }, "New plot");
  dropped(fresh, page, plots.length);
  return [h("div", { className: "row" }, fresh, plots.length ? h("button", { id: "fewer plots", onclick: () => page.order({ what: "note", plots: plots.slice(0, -1) }) }, "Remove the last") : null),
    h("div", { className: "leaves", tabIndex: 0, role: "group", ariaLabel: "signals" }, filter ? found.length ? found.map(name => leaf(name, name)) : h("small", null, "No signal has these words in its name.") : places.map(group))];
}
