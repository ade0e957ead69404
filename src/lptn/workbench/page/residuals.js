// Residuals of the node and run that are shown, for those who ask: their memory, their distribution, correlated parameters.

import { color, onLook } from "/look.js";
import { chartOf } from "/plots.js";
import { digits, h, name } from "/sections.js";

const RADIUS = 2.448, POINTS = 60, HALF = 2.7;  // standard deviations: of 95 % of two parameters together, and of the picture's half width

export class Residuals {
  constructor(section, page) {
    Object.assign(this, { page, key: "", charts: h("div", { className: "two" }), words: h("p"), pairs: h("div") });
    this.details = h("details", { id: "residual details", ontoggle: () => this.draw() }, h("summary", null, "Residuals, and correlated parameters"), this.words, this.charts, this.pairs);
    section.append(this.details);
    onLook(() => this.page.state.tiles && this.draw());
    window.addEventListener("resize", () => this.page.state.tiles && this.draw());
  }

  async draw() {
    const { state, picked } = this.page, at = picked[0];
    this.details.hidden = !state.tiles;
    if (!this.details.open || !state.tiles) return;
    const key = JSON.stringify([at, state.now, state.head.now, state.correlations, color("--paper"), this.details.clientWidth]);
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
    this.pairs.replaceChildren(h("p", null, h("small", null, state.correlations.length ? "The most correlated parameters, each pair with the ellipse that holds both with 95 %: a narrow one says that the data determine only one combination of the two." : "There are fewer than two fitted parameters.")),
      h("div", { className: "pairs" }, state.correlations.map(each => pair(each, state.parameters))));
  }
}

// Two parameters: the ellipse of their estimates, in standard errors about their values, and what it says in numbers.
function pair({ one, other, correlation }, parameters) {
  const both = [one, other].map(name => parameters.find(each => each.name === name)), square = Math.sqrt(Math.max(1 - correlation ** 2, 0));
  const at = Array.from({ length: POINTS }, (_, k) => 2 * Math.PI * k / POINTS).map(angle => [RADIUS * Math.cos(angle), -RADIUS * (correlation * Math.cos(angle) + square * Math.sin(angle))]);
  const picture = h("div");
  picture.innerHTML = `<svg viewBox="${-HALF} ${-HALF} ${2 * HALF} ${2 * HALF}" role="img"><path class="cross" d="M${-HALF} 0H${HALF}M0 ${-HALF}V${HALF}"/><polygon points="${at.map(point => point.map(value => value.toFixed(3))).join(" ")}"/></svg>`;
  picture.firstChild.setAttribute("aria-label", `95 % ellipse of ${one} and ${other}`);
  const said = (way, each) => h("div", null, `${way} `, name(each.name), h("br"), `${digits(each.value)} ± ${digits(1.96 * each.error, 2)} ${each.unit.replaceAll("*", "·")}`);
  return h("figure", null, both.every(each => each.error != null) ? picture : h("p", { className: "soft" }, "Not determined."), h("figcaption", null, said("→", both[0]), said("↑", both[1]), h("div", null, `correlation ${digits(correlation, 2)}`)));
}
