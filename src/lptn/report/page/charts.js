// Charts of a page that is one file: chosen, zoomed, hovered. The data stand in the page; uPlot and zoom.js are above.

const MISSING = 65535;
const DASHES = { given: [7, 4], limit: [4, 3] };
const color = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const clock = (began, seconds) => began == null ? "" : `, ${new Date(1000 * (began + seconds)).toISOString().slice(0, 19).replace("T", " ")} UTC`;
const clear = value => value == null ? "–" : `${Number(value.toPrecision(4))}`.replace("-", "−");

function unpacked([low, high, steps]) {
  if (typeof steps === "number") return Array(steps).fill(null);
  const bytes = Uint8Array.from(atob(steps), each => each.charCodeAt(0));
  return Array.from(new Uint16Array(bytes.buffer), each => each === MISSING ? null : low + (high - low) * each / (MISSING - 1));
}

function h(tag, more, ...inside) {
  const made = Object.assign(document.createElement(tag), more);
  made.append(...inside);
  return made;
}

class Charts {
  constructor(place, content) {
    Object.assign(this, { place, content, charts: [], windows: new Map(), picked: [content.views[0]] });
    this.sync = uPlot.sync(place.id);
    this.selects = content.choices.map(({ label, options }, number) => h("select", { ariaLabel: label, onchange: event => this.choose(number, event.target.value) },
      ...options.map(option => h("option", { value: option }, option))));
    this.whole = h("button", { type: "button", onclick: () => this.zoom(null) }, "Whole range");
    this.said = h("small");
    this.bar = h("div", { className: "bar" }, ...this.selects.flatMap((each, number) => [h("label", {}, content.choices[number].label, " ", each)]), this.whole, this.said);
    this.list = h("div");
    place.append(this.bar, this.list);
    for (const button of document.querySelectorAll(`[data-charts="${place.id}"]`)) button.addEventListener("click", event => {
      this.pick(JSON.parse(button.dataset.pick), event.shiftKey);
      if (!event.shiftKey) place.scrollIntoView({ block: "nearest" });
    });
    this.draw();
  }

  find(keys) { return this.content.views.find(view => view.keys.every((key, number) => key === keys[number])); }

  choose(number, value) {
    const keys = [...this.picked[0].keys];
    keys[number] = value;
    this.pick(this.find(keys) ? keys : this.content.views.find(view => view.keys[number] === value).keys);
  }

  pick(keys, beside = false) {
    const view = this.find(keys);
    if (!view) return;
    const there = this.picked.indexOf(view);
    if (!beside) this.picked = [view];
    else if (there < 0) this.picked.push(view);
    else if (this.picked.length > 1) this.picked.splice(there, 1);
    this.draw();
  }

  window(view) { return this.windows.get(view.across) ?? null; }
  ends(view) { const values = this.content.values[view.across]; return [values[0], values[values.length - 1]]; }

  zoom(window, across = null) {
    for (const view of across ? [{ across }] : this.picked) if (window) this.windows.set(view.across, window); else this.windows.delete(view.across);
    for (const chart of this.charts) {
      const shown = this.windows.get(chart.view.across) ?? this.ends(chart.view);
      chart.setScale("x", { min: shown[0], max: shown[1] });
    }
    this.say();
  }

  say() {
    const window = this.window(this.picked[0]);
    this.whole.disabled = !window;
    this.said.textContent = window ? `${clear(window[0])} to ${clear(window[1])}` : "Drag to zoom, hover to read; + − ← → 0 with the keyboard.";
  }

  draw() {
    for (const chart of this.charts) chart.destroy();
    this.charts = [];
    this.list.replaceChildren();
    this.selects.forEach((select, number) => { select.value = this.picked[0].keys[number]; });
    for (const button of document.querySelectorAll(`[data-charts="${this.place.id}"]`))
      button.setAttribute("aria-pressed", this.picked.includes(this.find(JSON.parse(button.dataset.pick))));
    for (const view of this.picked) {
      const stack = h("div", { className: "stack", tabIndex: 0, ariaLabel: `${view.title}; + and − zoom, arrows move, 0 shows all`, onkeydown: event => this.key(event, view) });
      stack.setAttribute("role", "group");
      this.list.append(h("h3", {}, view.title), stack);
      const lines = Object.fromEntries(Object.entries(view.lines).map(([name, values]) => [name, unpacked(values)]));
      const panels = this.content.panels.filter(panel => panel.lines.some(line => line.name in lines));
      panels.forEach((panel, number) => this.charts.push(this.chart(view, panel, lines, stack, number === panels.length - 1)));
    }
    this.say();
  }

  chart(view, panel, lines, stack, last) {
    const shown = panel.lines.filter(line => line.name in lines), noise = noiseOf(panel, view) ?? 0, zero = panel.zero ? [-noise, noise] : [];
    const axis = axisLook(color("--soft"), color("--shade"), color("--rule")), across = this.content.across, time = across.startsWith("time");
    const window = this.window(view) ?? this.ends(view), seconds = across.endsWith("[s]") ? "s" : across.endsWith("[min]") ? "min" : across.match(/\[(.*)\]/)?.[1] ?? "";
    const options = {
      width: stack.clientWidth || 1000, height: panel.height + (last ? 32 : 0), padding: [8, 18, last ? null : 0, 0],
      cursor: { sync: { key: this.sync.key, setSeries: false }, drag: { x: true, y: false, setScale: false }, points: { size: 6 }, bind: { dblclick: () => () => this.zoom(null, view.across) } },
      scales: { x: { time: false, auto: false, min: window[0], max: window[1], distr: this.content.log ? 3 : 1, range: (_, low, high) => [low, high] }, y: panel.log ? { distr: 3 } : { range: (_, low, high) => limits(low, high, ...zero) } },
      axes: [
        { ...axis, show: last, ...(time ? { incrs: GRID } : {}), size: 42, label: across, labelSize: 16 },
        { ...axis, label: panel.label, labelSize: 18, size: 54, space: 26 },
      ],
      series: [{ label: across.replace(/ \[.*/, ""), value: (_, value) => value == null ? "–" : `${clear(value)} ${seconds}${clock(view.began, seconds === "min" ? 60 * value : value)}` },
        ...shown.map(line => ({
          label: line.label, width: { measured: 1.1, soft: 0.6, best: 2 }[line.look] ?? 1.6, dash: DASHES[line.look], spanGaps: this.content.log || line.dots || !time,
          stroke: color(line.look ? `--${line.look}` : `--colour${line.colour % 8}`), ...(line.look === "points" ? { width: 0 } : {}),
          points: line.look === "points" ? { show: true, size: 8, fill: color("--ink"), stroke: color("--ink") } : { show: line.dots, size: 5 },
          ...(line.steps ? { paths: uPlot.paths.stepped({ align: 1 }) } : {}),
          value: (_, value) => value == null ? "–" : `${clear(value)} ${panel.unit}`,
        }))],
      bands: panel.band ? [{ series: panel.band.map(name => 1 + shown.findIndex(line => line.name === name)).reverse(), fill: color("--shade") }] : undefined,
      hooks: { drawClear: [chart => this.shade(chart, view, panel)], setSelect: [chart => this.selected(chart, view)] },
    };
    const chart = new uPlot(options, [this.content.values[view.across], ...shown.map(line => lines[line.name])], stack);
    chart.view = view;
    return chart;
  }

  // Stretches that only set the start, and the band of the sensors' noise.
  shade(chart, view, panel) {
    const { ctx, bbox } = chart, right = bbox.left + bbox.width, bottom = bbox.top + bbox.height;
    const x = value => Math.min(Math.max(chart.valToPos(value, "x", true), bbox.left), right);
    const y = value => Math.min(Math.max(chart.valToPos(value, "y", true), bbox.top), bottom);
    ctx.save();
    ctx.fillStyle = color("--shade");
    for (const [start, stop] of view.shaded) ctx.fillRect(x(start), bbox.top, x(stop) - x(start), bbox.height);
    const band = panel.zero && noiseOf(panel, view);
    if (band) {
      ctx.fillStyle = color("--noise");
      ctx.fillRect(bbox.left, y(band), bbox.width, Math.max(y(-band) - y(band), 1));
    }
    if (panel.zero) {
      ctx.fillStyle = color("--soft");
      ctx.fillRect(bbox.left, y(0), bbox.width, 1);
    }
    ctx.restore();
  }

  selected(chart, view) {
    const window = dragged(chart);
    if (window) this.zoom(window, view.across);
  }

  key(event, view) {
    const window = keyed(event, this.window(view) ?? this.ends(view), this.ends(view));
    if (window !== undefined) this.zoom(window, view.across);
  }
}

// The sensors' noise is one of temperatures, and no band around another quantity.
function noiseOf(panel, view) { return panel.unit === "K" ? view.floor : null; }

document.documentElement.classList.add("live");
const made = [...document.querySelectorAll(".charts")].map(place => new Charts(place, JSON.parse(document.getElementById(`${place.id}-data`).textContent)));
const again = () => made.forEach(each => each.draw());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
let wide = innerWidth;
addEventListener("resize", () => { if (innerWidth !== wide) { wide = innerWidth; again(); } });
