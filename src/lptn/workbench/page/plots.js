// Time plots: drag to zoom, hover to read. Lines come from the server for the window that is shown, thinned to its width.

import uPlot from "/uplot/uPlot.esm.js";
import { axisLook, dragged, GRID, keyed, limits } from "/zoom.js";
import { csv, png, save, svg } from "/export.js";
import { color, onLook } from "/look.js";
import { h, kelvin, name as broken, ofOneRun, placed, triable } from "/sections.js";
import { dropped, signalsOf, unitOf } from "/signals.js";

const LONG = 600;  // s: minutes from here on
const POINTS = 2;  // of a line to each pixel across: the smallest and the largest reading there
const STRIDE = 0.01;  // of the width, by which a key moves the cursor
const MOST_INPUTS = 4, MOST_COMPANIONS = 8;
const NEAR = "200px";  // above and below the screen: plots that come into sight are drawn by then
const WHEEL = 0.002;  // e-fold of the range to a pixel that the wheel turns
const MOST_ROWS = 20_000;  // of a CSV file: longer windows keep their extremes
const DAY = 86_400;  // s
const sync = uPlot.sync("time");

export class Plots {
  constructor(section, page) {
    this.section = section, this.page = page, this.windows = {}, this.views = new Map(), this.clock = false;
    this.bar = h("div", { className: "row" });
    this.list = h("div");
    this.own = document.getElementById("own plots");
    section.append(this.bar, this.told = h("div", { id: "told", ariaLive: "polite" }), this.list);
    window.addEventListener("resize", () => this.load());
    onLook(() => this.load());
    this.sight = new IntersectionObserver(seen => {
      for (const { target, isIntersecting } of seen) target.view.seen = isIntersecting;
      this.load();
    }, { rootMargin: `${NEAR} 0px` });
  }

  // Views that are picked; of which models, runs and answers their lines are.
  draw() {
    const { state, picked, attempt } = this.page;
    this.tried = triable(state).find(each => each.key === attempt);
    this.drawBar();
    const { segment } = picked[0], known = new Set(signalsOf(state, segment));
    const wanted = [...picked.map(each => ({ ...each, id: `${each.segment} ${each.node}` })),
      ...state.written.plots.map((signals, number) => ({ segment, number, signals: signals.filter(each => known.has(each)), id: `plot ${number} ${segment}` }))];
    for (const [id, view] of this.views) if (!wanted.some(each => each.id === id)) { view.remove(); this.views.delete(id); }
    this.what = JSON.stringify([state.now, state.given, state.head.now, state.stretches, state.advice.length, picked.length > 1, this.tried?.tried, this.clock, state.written, state.against]);
    wanted.forEach((each, k) => {
      if (!this.views.has(each.id)) this.views.set(each.id, new View(this, each));
      const view = this.views.get(each.id), [list, place] = each.signals ? [this.own, each.number] : [this.list, k];
      if (each.signals) view.choose(each.signals);
      if (list.children[place] !== view.element) list.insertBefore(view.element, list.children[place] ?? null);
    });
    this.load();
  }

  // Draws what is in sight and shows something else than is wanted: one question for each run. What is out of sight
  // waits until it is scrolled to: the cost of a zoom goes with the screen, not with the nodes that were picked.
  load() {
    const runs = new Map(), paper = color("--paper");
    for (const view of this.views.values()) {
      const look = [paper, view.stack.clientWidth], wanted = JSON.stringify([this.what, this.windows[view.segment] ?? null, look]);
      if (!view.seen || !look[1] || view.wanted === wanted || view.signals?.length === 0) continue;
      Object.assign(view, { wanted, look });
      runs.set(view.segment, [...runs.get(view.segment) ?? [], view]);
    }
    for (const [segment, views] of runs) this.ask(segment, views);
  }

  async ask(segment, views) {
    const wanted = views.map(view => view.wanted), points = Math.ceil(POINTS * devicePixelRatio * Math.max(...views.map(view => view.stack.clientWidth)));
    const lines = await this.lines(segment, views, points);
    if (lines) views.forEach((view, k) => view.wanted === wanted[k] && view.show(lines[view.node]));  // else another window is wanted meanwhile
  }

  async lines(segment, views, points) {
    const asked = new URLSearchParams({ segment, points, attempt: this.tried?.tried ?? "" }), zoomed = this.windows[segment];
    if (zoomed) { asked.set("start", zoomed[0]); asked.set("stop", zoomed[1]); }
    for (const { node } of views) if (node) asked.append("node", node);
    for (const signal of new Set(views.flatMap(view => view.signals ?? []))) asked.append("signal", signal);
    const answer = await fetch(`/lines?${asked}`).catch(() => null);
    return answer?.ok ? unpacked(await answer.arrayBuffer()) : null;
  }

  // Whether the values of a plot are zoomed.
  get stretched() { return [...this.views.values()].some(view => Object.keys(view.values).length); }

  clear() {
    for (const view of this.views.values()) view.remove();
    this.views.clear();
    this.bar.replaceChildren();
    this.told.replaceChildren();
    this.windows = {};
    this.shown = "";
  }

  drawBar() {
    const { state, picked } = this.page, at = picked[0], { limits } = state.written, key = JSON.stringify([at, state.segments, state.nodes, !!state.busy, this.windows, this.clock, limits, this.stretched]);
    if (this.shown === key) return;
    this.shown = key;
    const segment = state.segments.find(each => each.key === at.segment), window = this.windows[segment.key];
    const choose = (id, label, options, value, onchange) => h("select", { id, ariaLabel: label, onchange: event => onchange(event.target.value) },
      options.map(([key, text]) => h("option", { value: key, selected: key === value }, text)));
    const cut = (what, label) => h("button", {
      id: what, disabled: !window || !!state.busy,
      onclick: () => { this.page.order({ what, run: segment.run, start: window[0], stop: window[1] }); this.zoom(segment.key, null); },
    }, label);
    const focused = this.bar.contains(document.activeElement) ? document.activeElement.id : "";
    this.bar.replaceChildren(...[h("h2", { style: "margin: 0 10px 0 0" }, "Over time"),
      choose("node", "node", state.nodes.map(node => [node, node]), at.node, node => this.page.pick(at.segment, node)),
      choose("run", "run", state.segments.map(each => [each.key, `${each.run} (${each.job})`]), at.segment, key => this.page.pick(key, at.node)),
      h("button", { id: "whole", disabled: !window && !this.stretched, onclick: () => this.zoom(segment.key, null) }, "Whole run"),
      h("button", { id: "special", disabled: !window, onclick: () => this.special(at, window) }, "What is special here?"),
      segment.job === "fitted" && cut("fit_on", "Fit on this"), segment.job === "fitted" && cut("hold_out", "Hold this out"), cut("leave_out", "Leave this out"),
      segment.clock && h("button", { id: "clock", ariaPressed: this.clock, title: "The time of day in UTC, or the time since the run’s start", onclick: () => { this.clock = !this.clock; this.page.tell(); } }, "Time of day"),
      h("label", null, h("small", null, "Limit "), h("input", { id: "limit", type: "number", step: "any", size: 5, ariaLabel: `limit of ${at.node} in °C`, value: limits[at.node] ?? "",
        onchange: event => { const { [at.node]: _, ...rest } = limits, value = event.target.valueAsNumber; this.page.order({ what: "note", limits: Number.isFinite(value) ? { ...rest, [at.node]: value } : rest }); } }), h("small", null, " °C")),
      h("button", { id: "mark", title: "A note at the moment that mouse or keys showed last", onclick: () => this.mark(at) }, "Note"),
      h("small", null, window ? span(window, segment.origin) : "Drag to zoom, or Ctrl and the wheel; Shift and the wheel for the values; keys: + − ← →, with Shift the cursor.")].filter(Boolean));
    if (focused) document.getElementById(focused)?.focus();
  }

  // The inputs that go with the error in the stretch as they do nowhere else in the run.
  async special({ segment, node }, window) {
    const answer = await fetch(`/special?${new URLSearchParams({ segment, node, start: window[0], stop: window[1] })}`);
    const found = await answer.json(), beyond = answer.ok ? found.companions.filter(each => each.score > found.chance) : [];
    const number = value => Number(value.toPrecision(3)).toString().replace("-", "−");
    const row = each => h("tr", { className: each.score > found.chance ? "" : "soft" }, h("td", null, each.words), h("td", { className: "n" }, each.score.toFixed(1)), h("td", { className: "n" }, number(each.inside)), h("td", { className: "n" }, number(each.outside)));
    this.told.replaceChildren(...!answer.ok ? [h("p", null, found.error)] : [
      h("p", null, beyond.length ? "" : found.companions.length ? "No input correlates with the error here more than by chance. " : "No input of this run changes. ",
        `${node}, ${span(window, this.page.state.segments.find(each => each.key === segment).origin)}. The score says how much more an input correlates with the error here than in other intervals of this length; by chance the best input reaches ${found.chance.toFixed(1)} in one of twenty.`),
      found.companions.length ? h("table", { id: "companions" }, h("thead", null, h("tr", null, ["correlates with the error", "score", "mean here", "elsewhere"].map((each, k) => h("th", { className: k ? "n" : "" }, each)))),
        h("tbody", null, found.companions.slice(0, MOST_COMPANIONS).map(row))) : "",
      h("button", { id: "close special", onclick: () => this.told.replaceChildren() }, "Close")]);
  }

  // The cursor of all plots of a run at a moment.
  point(segment, time) {
    for (const view of this.views.values()) if (view.segment === segment) for (const chart of view.charts.slice(0, 1))
      chart.setCursor({ left: chart.valToPos(time, "x"), top: 10 }, true, true);
  }

  mark({ segment }) {
    const { page } = this, run = page.state.segments.find(each => each.key === segment), time = page.moment?.segment === segment ? page.moment.time : (this.windows[segment] ?? [run.start])[0];
    const said = h("input", { id: "mark text", size: 40, maxLength: 200 });
    this.told.replaceChildren(h("form", { className: "row", onsubmit: event => {
      event.preventDefault();
      if (said.value.trim()) page.order({ what: "note", marks: [...page.state.written.marks, { run: run.run, time, text: said.value.trim() }] });
      this.told.replaceChildren();
    } }, h("label", null, `${run.run}, ${Number((time - run.origin).toPrecision(5))} s: `, said), h("button", { className: "first" }, "Save"), h("button", { type: "button", onclick: () => this.told.replaceChildren() }, "Cancel")));
    said.focus();
  }

  zoom(segment, window) {
    if (window) this.windows[segment] = window;
    else {
      delete this.windows[segment];
      for (const view of this.views.values()) if (view.segment === segment && Object.keys(view.values).length) Object.assign(view, { values: {}, wanted: "" });
    }
    this.told.replaceChildren();
    this.drawBar();
    this.page.tell();
  }
}

const span = (window, origin) => `${window.map(each => Number((each - origin).toPrecision(5))).join(" to ")} s`;

// Lines by node: a line of JSON says which they are, and how long; then come their values, 8 bytes each.
function unpacked(bytes) {
  const end = new Uint8Array(bytes).indexOf(10), head = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 0, end)));
  let at = end + 1;
  const line = length => {
    const values = new Float64Array(bytes, at, length);
    at += 8 * length;
    return values.some(Number.isNaN) ? Array.from(values, value => Number.isNaN(value) ? null : value) : values;
  };
  return Object.fromEntries(Object.entries(head).map(([node, [names, length]]) => [node, Object.fromEntries(names.map(name => [name, line(length)]))]));
}

class View {
  // Of a node; or, where there is no node, of signals that a person chose.
  constructor(plots, { segment, node = "", number, signals }) {
    Object.assign(this, { plots, segment, node, number, signals, charts: [], values: {}, turned: null });
    const name = node || `plot ${number + 1}`;
    this.stack = h("div", { className: "stack", tabIndex: 0, role: "group", ariaLabel: `${name} over time; + and − zoom, arrows move, 0 shows the whole run, arrows with Shift move the cursor`, onkeydown: event => this.key(event) });
    const file = (ending, make) => h("button", { ariaLabel: `${name} as ${ending.toUpperCase()}`, onclick: async () => save(await make(), `${name} ${this.run.run}.${ending}`) }, ending.toUpperCase());
    const all = async () => csv((await plots.lines(segment, [this], MOST_ROWS))[node], this.run);
    this.element = h("div", { className: "view" }, h("div", { className: "row" }, this.title = h("h3"), h("span", { className: "grow" }), h("span", { className: "files" }, file("png", () => png(this)), file("svg", () => svg(this)), file("csv", all))), this.stack, this.still = h("small"));
    this.element.view = this;
    if (signals) dropped(this.element, plots.page, number);
    plots.sight.observe(this.element);
  }

  remove() { this.plots.sight.unobserve(this.element); this.charts.forEach(each => each.destroy()); this.element.remove(); }

  get run() { return this.plots.page.state.segments.find(each => each.key === this.segment); }
  get limit() { return this.plots.page.state.written.limits[this.node]; }
  get window() { return this.plots.windows[this.segment] ?? [this.run.start, this.run.stop]; }

  choose(signals) {
    const { page } = this.plots, own = page.state.written.plots, without = each => own.with(this.number, own[this.number].filter(other => other !== each));
    const chosen = JSON.stringify([own, signals, this.run]);
    if (this.chosen === chosen) return;  // a button that is made anew under the mouse is not clicked
    Object.assign(this, { signals, chosen });
    const chip = each => [h("button", { className: "chip", ariaLabel: `Remove ${each}`, onclick: () => page.order({ what: "note", plots: without(each) }) }, broken(each)), " "];
    this.title.replaceChildren(...own[this.number].flatMap(chip), h("small", null, `in ${this.run.run} (${this.run.job})`));
    if (!signals.length) { this.charts.forEach(each => each.destroy()); Object.assign(this, { charts: [], made: "", wanted: "" }); }
    this.still.textContent = signals.length ? "" : "Click a signal, or drag it here.";
  }

  // Charts are made anew where there are other lines than before, or another look.
  show(lines) {
    const { plots } = this, { picked } = plots.page, [min, max] = this.window, tried = !this.signals && this.name(lines);
    const made = JSON.stringify([this.signals ?? Object.keys(lines).sort(), picked.length > 1, this.look, plots.clock]);
    if (made !== this.made) {
      this.made = made;
      this.build(this.signals ? this.ofSignals() : this.ofNode(lines, tried), lines);
    } else for (const chart of this.charts) chart.batch(() => {
      chart.names.forEach((name, k) => name.endsWith("attempt") && chart.series[k].show !== tried && chart.setSeries(k, { show: tried }));
      chart.setData(chart.names.map(name => lines[name]), false);
      chart.setScale("x", { min, max });
    });
  }

  // The title of a node's plots; whether they show an answer that is tried.
  name(lines) {
    const { run, plots } = this, { state } = plots.page;
    const tile = state.tiles[this.segment]?.now[state.nodes.indexOf(this.node)];
    this.title.textContent = `${this.node} in ${run.run} (${run.job})${tile ? `: RMSE ${kelvin(tile.rmse)}` : ""}`;
    const tried = "attempt" in lines && plots.tried;
    if (tried) this.title.append(h("small", null, ` – dotted: with ${placed(tried)}`));
    if (triable(state).length && !tried) lines.attempt = lines["error attempt"] = Array(lines.time.length).fill(null);
    return !!tried;
  }

  build(panels, lines) {
    this.charts.forEach(each => each.destroy());
    this.charts = panels.map((panel, k) => this.chart(panel, lines, k === panels.length - 1));
  }

  // Signals of one unit share a chart, each with the colour of its place among all.
  ofSignals() {
    const units = [...new Set(this.signals.map(unitOf))], colours = 8;
    const series = this.signals.map((name, k) => ({ name, label: name, stroke: color(`--colour${k % colours}`), width: 1.4, unit: unitOf(name) }));
    return units.map(unit => ({ unit, label: unit, height: units.length > 1 ? 130 : 190, series: series.filter(each => each.unit === unit) }));
  }

  ofNode(lines, tried) {
    const one = this.plots.page.picked.length === 1, { state } = this.plots.page;
    const line = (name, label, stroke, more) => ({ name, label, stroke, width: 1.5, show: tried || name !== "attempt", ...more });
    const models = ["given", "now", "against", "attempt"].filter(each => each in lines).map(each => line(each,
      { given: "as given", now: state.given === state.now ? "model as given" : "now", against: "the study beside", attempt: "with the answer tried" }[each],
      color(each === "now" && state.given === state.now ? "--given" : `--${each}`), { dash: each === "given" ? [7, 4] : each === "attempt" ? [2, 3] : each === "against" ? [9, 3, 2, 3] : undefined, width: each === "now" ? 2 : 1.6 }));
    // Both edges of a band are one entry of the legend; they set no range: lines are what is looked at.
    const edges = name => [line(`${name} low`, "95 % band", color("--soft"), { width: 0.5, auto: false, edge: true }), line(`${name} high`, "", color("--soft"), { width: 0.5, auto: false, class: "edge" })];
    const errors = models.map(each => ({ ...each, name: `error ${each.name}` }));
    const panels = [
      { unit: "°C", label: "temperature [°C]", height: 250, limited: true, series: ["now low" in lines ? edges("now") : [], line("measured", "measured", color("--ink"), { width: 1.1 }), models].flat() },
      { unit: "K", label: "error [K]", height: 150, series: errors, floor: state.head.floor },
    ];
    if ("heat" in lines && one) panels.push({
      unit: "W", label: "heat [W]", height: 130, zero: true,
      series: [...edges("heat"), line("heat", "heat that the model lacks", color("--attempt"))],
    });
    const derived = name => !unitOf(name);  // such as torque_abs: what was measured comes first
    const all = Object.keys(lines).filter(name => name.includes(".")).sort((a, b) => derived(a) - derived(b)), inputs = all.filter(name => lines[name].some(value => value !== lines[name][0]));
    const still = all.filter(name => !inputs.includes(name)).map(name => `${name} ${Number(lines[name][0]?.toPrecision(3))} ${unitOf(name)}`);
    this.still.textContent = one && still.length ? `Constant in this run: ${still.join(", ")}.` : "";
    if (one) for (const name of inputs.slice(0, MOST_INPUTS)) {
      const unit = unitOf(name);
      panels.push({ unit, label: unit, height: 82, series: [line(name, name, color("--soft"), { width: 1 })] });
    }
    return panels;
  }

  chart({ unit, label, height, series, floor, zero, limited }, lines, last) {
    const { run, plots } = this, clock = plots.clock && run.clock, origin = clock ? 0 : run.origin, minutes = run.stop - run.start > LONG;
    const since = value => minutes ? Number(((value - origin) / 60).toFixed(2)) : Number((value - origin).toFixed(2));
    const ofDay = value => new Date(1000 * value).toISOString().slice(run.stop - run.start > DAY ? 5 : 11, minutes ? 16 : 19).replace("T", " ");
    const axis = axisLook(color("--soft"), color("--shade"), color("--line")), within = [limited ? this.limit : null, ...floor != null || zero ? [-2 * (floor ?? 0), 2 * (floor ?? 0)] : []];
    const number = value => value == null ? "–" : `${Number(value.toPrecision(4))} ${unit}`;
    const options = {
      width: this.look[1] || 1200, height: height + (last ? 30 : 0),
      padding: [8, 8, last ? null : 0, 0],
      cursor: {
        sync: { key: sync.key, setSeries: false }, drag: { x: true, y: false, setScale: false }, points: { size: 6 },
        bind: { dblclick: () => () => this.plots.zoom(this.segment, null) },
      },
      legend: { live: true },
      scales: { x: { time: false, auto: false, min: this.window[0], max: this.window[1] }, y: { range: (_, low, high) => this.values[label] ?? limits(low, high, ...within) } },
      axes: [
        { ...axis, show: last, incrs: GRID, size: 42, label: clock ? "time of day [UTC]" : minutes ? "time [min]" : "time [s]", labelSize: 16,
          splits: (_, axis, low, high, step) => { const from = origin + step * Math.ceil((low - origin) / step); return Array.from({ length: Math.floor((high - from) / step) + 1 }, (_, k) => from + k * step); },
          values: (_, splits) => splits.map(clock ? ofDay : since) },
        { ...axis, label, labelSize: 18, size: 46, space: 26 },
      ],
      series: [{ label: "time", value: (_, value) => value == null ? "–" : `${minutes ? `${((value - run.origin) / 60).toFixed(2)} min` : `${(value - run.origin).toFixed(1)} s`}${run.clock ? `, ${new Date(1000 * value).toISOString().slice(0, 19).replace("T", " ")} UTC` : ""}` },
        ...series.map(({ name, edge, ...rest }) => ({ ...rest, points: { show: false }, value: (chart, value, k, at) => edge && value != null ? `${number(value)} to ${number(chart.data[k + 1][at])}` : number(value) }))],
      bands: series[0].edge ? [{ series: [2, 1], fill: color("--shade") }] : undefined,
      hooks: { drawClear: [chart => this.shade(chart, floor, zero, limited ? this.limit : null)], setSelect: [chart => this.selected(chart)],
        setCursor: [chart => chart.cursor.event && chart.cursor.left >= 0 && this.plots.page.at(this.segment, chart.posToVal(chart.cursor.left, "x"))] },
    };
    const names = ["time", ...series.map(each => each.name)];
    const chart = new uPlot(options, names.map(name => lines[name]), this.stack);
    Object.assign(chart, { names, limited });
    chart.root.addEventListener("wheel", event => this.wheel(event, chart, label), { passive: false });
    return chart;
  }

  // Time that was fitted or only sets the start, stretches in which a channel is odd, the band of the sensors' noise.
  shade(chart, floor, zero, limit) {
    const { ctx, bbox } = chart, { from, start, to, stop } = this.run;
    const x = value => Math.min(Math.max(chart.valToPos(value, "x", true), bbox.left), bbox.left + bbox.width);
    const fill = (low, high, style) => { if (high > low) { ctx.fillStyle = style; ctx.fillRect(x(low), bbox.top, x(high) - x(low), bbox.height); } };
    ctx.save();
    fill(start, from, color("--shade"));
    fill(to, stop, color("--shade"));
    for (const issue of this.plots.page.state.issues)
      if (issue.stretch && this.run.run.startsWith(issue.run) && (issue.place === this.node || !this.plots.page.state.nodes.includes(issue.place)))
        fill(issue.stretch[0], issue.stretch[1], color("--mark"));
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.fillStyle = color("--attempt");
    for (const { run, time, text } of this.plots.page.state.written.marks) if (ofOneRun(run, this.run.run) && time >= chart.scales.x.min && time <= chart.scales.x.max) {
      ctx.fillRect(x(time), bbox.top, devicePixelRatio, bbox.height);
      if (floor == null && !zero) ctx.fillText(text, x(time) + 4 * devicePixelRatio, bbox.top + 12 * devicePixelRatio);
    }
    const y = value => chart.valToPos(value, "y", true);
    if (limit != null) { ctx.fillStyle = color("--limit"); ctx.fillRect(bbox.left, y(limit), bbox.width, 2); }
    if (floor != null || zero) {
      if (floor) { ctx.fillStyle = color("--mark"); ctx.fillRect(bbox.left, y(2 * floor), bbox.width, Math.max(y(-2 * floor) - y(2 * floor), 1)); }
      ctx.fillStyle = color("--soft");
      ctx.fillRect(bbox.left, y(0), bbox.width, 1);
    }
    ctx.restore();
  }

  selected(chart) {
    const window = dragged(chart);
    if (window) this.plots.zoom(this.segment, window);
  }

  // The wheel zooms the time with Ctrl and the values with Shift; alone it moves the page, as everywhere.
  wheel(event, chart, label) {
    if (!event.ctrlKey && !event.metaKey && !event.shiftKey) return;
    event.preventDefault();
    const factor = Math.exp(WHEEL * (event.deltaY || event.deltaX)), box = chart.over.getBoundingClientRect();
    const about = (at, low, high) => [at - (at - low) * factor, at + (high - at) * factor];
    if (event.shiftKey) {
      const { min, max } = chart.scales.y;
      this.values[label] = about(chart.posToVal(event.clientY - box.top, "y"), min, max);
      chart.setScale("x", { min: chart.scales.x.min, max: chart.scales.x.max });
      return this.plots.drawBar();
    }
    const { start, stop } = this.run, [low, high] = about(chart.posToVal(event.clientX - box.left, "x"), ...this.turned ?? this.window);
    if (!this.turned) requestAnimationFrame(() => {  // a wheel turns faster than plots are drawn
      const [from, to] = this.turned;
      this.turned = null;
      this.plots.zoom(this.segment, from <= start && to >= stop ? null : [from, to]);
    });
    this.turned = [Math.max(low, start), Math.min(high, stop)];
  }

  // The cursor by the keyboard: values are read where it stands.
  point(event) {
    const [chart] = this.charts, width = chart.over.clientWidth, { left } = chart.cursor, way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!way) return;
    event.preventDefault();
    const to = Math.min(Math.max((left < 0 ? width / 2 : left) + way * width * STRIDE, 0), width - 1);
    chart.setCursor({ left: to, top: 10 }, true, true);
    this.plots.page.at(this.segment, chart.posToVal(to, "x"));
  }

  key(event) {
    if (event.shiftKey && event.key.startsWith("Arrow") && !event.ctrlKey && !event.metaKey && !event.altKey) return this.point(event);
    const window = keyed(event, this.window, [this.run.start, this.run.stop]);
    if (window !== undefined) this.plots.zoom(this.segment, window);
  }
}

// A small chart of lines over anything but time, with a band about zero.
export function chartOf(parent, { title, x, xLabel, lines, band }) {
  const element = h("div", null, h("small", null, title)), axis = axisLook(color("--soft"), color("--shade"), color("--line"));
  parent.append(element);
  new uPlot({
    width: element.clientWidth || 380, height: 200, padding: [8, 8, 0, 0], legend: { show: false }, cursor: { drag: { x: false, y: false } },
    scales: { x: { time: false }, y: { range: (_, low, high) => limits(low, high, ...band ? [-band, band] : []) } },
    axes: [{ ...axis, label: xLabel, labelSize: 16, size: 34 }, { ...axis, size: 46 }],
    series: [{}, ...lines.map(({ label, dash }) => ({ label, dash, stroke: color(dash ? "--soft" : "--now"), width: 1.5, points: { show: false } }))],
    hooks: { drawClear: [chart => {
      if (!band) return;
      const { ctx, bbox } = chart, y = value => chart.valToPos(value, "y", true);
      ctx.fillStyle = color("--mark");
      ctx.fillRect(bbox.left, y(band), bbox.width, y(-band) - y(band));
    }] },
  }, [x, ...lines.map(each => each.values)], element);
}
