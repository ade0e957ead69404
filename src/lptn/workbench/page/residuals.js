// Residuals of the node and run that are shown, for those who ask: their memory, their distribution, correlated parameters.

import { color, onLook } from "/look.js";
import { chartOf } from "/plots.js";
import { digits, h } from "/sections.js";

export class Residuals {
  constructor(section, page) {
    Object.assign(this, { page, key: "", charts: h("div", { className: "two" }), words: h("p"), pairs: h("div") });
    this.details = h("details", { id: "residual details", ontoggle: () => this.draw() }, h("summary", null, "Residuals, and correlated parameters"), this.words, this.charts, this.pairs);
    section.append(this.details);
    onLook(() => this.page.state.tiles && this.draw());
  }

  async draw() {
    const { state, picked } = this.page, at = picked[0];
    this.details.hidden = !state.tiles;
    if (!this.details.open || !state.tiles) return;
    const key = JSON.stringify([at, state.now, state.head.now, state.correlations, color("--paper")]);
    if (this.key === key) return;
    this.key = key;
    const answer = await fetch(`/residuals?${new URLSearchParams(at)}`), found = await answer.json();
    if (this.key !== key) return;
    const run = state.segments.find(each => each.key === at.segment);
    this.charts.replaceChildren();
    this.words.textContent = answer.ok ? `${at.node} in ${run.run} (${run.job}), ${found.lag.length ? found.memory == null
      ? "errors correlated over the whole run: an effect is missing, or a drift" : found.memory <= found.lag[1] ? "errors without correlation, like noise" : `residual correlation time ${Number(found.memory.toPrecision(2))} s` : ""}.` : found.error;
    if (answer.ok) {
      chartOf(this.charts, { title: "Autocorrelation; grey: white noise at 19 of 20 lags", x: found.lag, xLabel: "lag [s]", band: found.band, lines: [{ label: "correlation", values: found.correlation }] });
      chartOf(this.charts, { title: "Quantiles of the errors against normal ones", x: found.normal, xLabel: "normal [K]", lines: [{ label: "errors [K]", values: found.quantiles }, { label: "normal", values: found.normal, dash: [5, 4] }] });
    }
    const rows = state.correlations.map(each => h("tr", null, h("td", null, each.one), h("td", null, each.other), h("td", { className: "n" }, digits(each.correlation, 2))));
    this.pairs.replaceChildren(h("p", null, h("small", null, rows.length ? "The most correlated parameters: with a correlation near 1 or −1 the data determine only one combination of the two." : "There are fewer than two fitted parameters.")), h("table", { className: "parameters" }, h("tbody", null, rows)));
  }
}
