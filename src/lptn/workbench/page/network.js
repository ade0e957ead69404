// The network at the moment under the mouse: boxes coloured by temperature, lines as wide as the heat that flows.

import { follow } from "/look.js";
import { h } from "/sections.js";

const FRAMES = 300, FRAME = 60;  // pictures of a run that is played, and ms for which each is seen at least
const LEAST_SCALE = 0.6;  // of the drawing's own size: smaller, its words can't be read, and it is moved sideways

let styled = null;

// The page's policy forbids styles in what is written, not those that a script sets.
export function drawn(drawing) {
  const [whole, style] = drawing.match(/<style>(.*?)<\/style>/s), box = h("div");
  box.innerHTML = drawing.replace(whole, "").replaceAll(' style="', ' data-style="');
  for (const each of box.querySelectorAll("[data-style]")) each.style.cssText = each.dataset.style;
  if (!styled) {
    styled = new CSSStyleSheet();
    styled.replaceSync(style);
    document.adoptedStyleSheets.push(styled);
    follow(styled);
  }
  const svg = box.querySelector("svg");
  svg.style.minWidth = `${LEAST_SCALE * svg.viewBox.baseVal.width}px`;
  return svg;
}

export class Network {
  constructor(section, page) {
    Object.assign(this, { page, key: "", moment: null, asking: false, words: h("small"), drawing: h("div", { id: "drawing" }), playing: false });
    this.play = h("button", { id: "play", onclick: () => { this.playing = !this.playing; this.step(); } }, "Play");
    this.slider = h("input", { id: "moment", type: "range", step: "any", ariaLabel: "moment of the run", oninput: () => { this.playing = false; this.go(this.slider.valueAsNumber); } });
    this.details = h("details", { id: "network details", open: true, ontoggle: () => this.draw() }, h("summary", null, "The network"), h("div", { className: "row" }, this.play, this.slider, this.words), this.drawing);
    section.append(this.details);
    const part = event => event.target.closest("[data-parameter]");
    this.drawing.addEventListener("click", event => part(event) && this.show(part(event)));
    this.drawing.addEventListener("keydown", event => ["Enter", " "].includes(event.key) && part(event) && (event.preventDefault(), this.show(part(event))));
  }

  at(segment, time) {
    this.moment = { segment, time: Number(time.toPrecision(12)) };
    this.draw();
  }

  get run() { return this.page.state.segments?.find(each => each.key === this.page.picked[0]?.segment); }

  go(time) {
    this.page.cursor(this.run.key, time);
    this.at(this.run.key, time);
  }

  // The run from the moment that is shown to its end, then from its beginning.
  step() {
    clearTimeout(this.next);  // of a pause that ended before its picture
    this.playing &&= !!this.run && this.details.open;
    this.play.textContent = this.playing ? "Pause" : "Play";
    if (!this.playing) return;
    const { start, stop } = this.run, now = this.slider.valueAsNumber, next = now + (stop - start) / FRAMES;
    if (!this.asking) this.go(now >= stop ? start : Math.min(next, stop));
    this.next = setTimeout(() => this.step(), FRAME);
  }

  // One question at a time: a mouse is faster than answers, and only where it rests is of interest.
  async draw() {
    const { state, picked } = this.page;
    this.details.hidden = !state.tiles;
    if (!this.details.open || !state.tiles || this.asking) return;
    const asked = this.moment?.segment === picked[0].segment ? this.moment : { segment: picked[0].segment };
    const key = JSON.stringify([asked, state.now, state.head.now, state.parameters]);
    if (this.key === key) return;
    [this.key, this.asking] = [key, true];
    try {
      const answer = await fetch(`/network?${new URLSearchParams(asked)}`), found = await answer.json();
      if (answer.ok) this.fill(found, asked);
      else this.words.textContent = found.error;
    } finally { this.asking = false; }
    this.draw();
  }

  fill({ drawing, time }, { segment }) {
    const run = this.page.state.segments.find(each => each.key === segment), focused = this.drawing.contains(document.activeElement) ? document.activeElement.dataset.parameter : "";
    Object.assign(this.slider, { min: run.start, max: run.stop, value: time });
    this.words.textContent = `${run.run} at ${Number((time - run.origin).toFixed(1))} s, as the model predicts it: play it, or move the mouse over a plot. Boxes are coloured by temperature, lines are as wide as the heat that flows. A click on a part shows its parameters.`;
    const svg = drawn(drawing);
    this.drawing.replaceChildren(svg);
    svg.setAttribute("role", "group");  // its parts are buttons
    for (const each of this.drawing.querySelectorAll("[data-parameter]")) {
      if (each.dataset.parameter === "[]") continue;
      each.setAttribute("tabindex", 0);
      each.setAttribute("role", "button");
      if (each.dataset.parameter === focused) each.focus();
    }
  }

  // The parameters of a part, in their table; where it has one alone, ready to be changed.
  show(part) {
    const names = JSON.parse(part.dataset.parameter), known = this.page.state.parameters.filter(each => names.includes(each.name));
    if (!known.length) return;
    document.getElementById("parameters").open = true;
    this.page.edited = known.length === 1 ? known[0].name : "";
    this.page.partOf(known[0].part);
    document.getElementById(`edit ${known[0].name}`)?.scrollIntoView({ block: "center" });
  }
}
