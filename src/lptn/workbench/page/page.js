// The page: asks for the study's state, draws what changed, gives orders. What is drawn stands in sections.js and plots.js.

import { h } from "/sections.js";
import * as sections from "/sections.js";
import { Plots } from "/plots.js";
import { Network } from "/network.js";
import { signals } from "/signals.js";
import { Residuals } from "/residuals.js";
import { tour } from "/tour.js";
import * as begin from "/begin.js";
import { forms } from "/forms.js";

const BUSY = 400, IDLE = 1500, HIDDEN = 6000;  // ms between two questions
const place = id => document.getElementById(id);

export const page = {
  state: {}, picked: [], attempt: "", pinned: "", shown: "now", by: "run", filter: "", part: "", edited: "", failed: "", clicked: false, step: 0, other: {},
  async order(order) { page.failed = (await post("/order", order)).error ?? ""; await ask(); },
  // A file comes when the state that the order made, or a later one, has nothing more to do.
  making: null,
  async fetchMade(what, name) {
    const { error, version } = await post("/order", { what });
    Object.assign(page, { failed: error ?? "", making: error ? null : { name, version } });
    await ask();
  },
  async stop() { page.making = null; page.failed = (await post("/stop", {})).error ?? ""; await ask(); },
  pick(segment, node, beside = false) {
    page.clicked = true;
    const there = page.picked.findIndex(each => each.segment === segment && each.node === node);
    if (beside) there < 0 ? page.picked.push({ segment, node }) : page.picked.splice(there, 1);
    else page.picked = [{ segment, node }];
    if (!page.picked.length) page.picked = [{ segment, node }];
    draw();
  },
  attemptTo(answer) { page.attempt = answer; draw(); },
  show(which) { page.shown = which; draw(); },
  edit(name) { page.edited = page.edited === name ? "" : name; draw(); },
  partOf(part) { page.part = part; draw(); },
  group(by) { page.by = by; draw(); },
  tell: () => draw(),
  sending: null, log: "",
  look(log) { page.log = log; draw(); },
  say(failed) { page.failed = failed; draw(); },
  ask: () => ask(),
  cursor: (segment, time) => plots.point(segment, time),
  at(segment, time) { page.moment = { segment, time }; network.at(segment, time); },
};
const plots = new Plots(place("plots"), page), residuals = new Residuals(place("residuals"), page), network = new Network(place("network"), page);

async function post(path, content) {
  try {
    const answer = await fetch(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(content) });
    const said = await answer.json().catch(() => ({}));
    return answer.ok ? said : { error: said.error ?? `${answer.status}` };
  } catch { return { error: "The server does not answer." }; }
}

let version = -1, timer = 0, asking = false;
async function ask() {
  if (asking) return;
  asking = true;
  clearTimeout(timer);
  let wait = document.hidden ? HIDDEN : page.state.busy ? BUSY : IDLE;
  try {
    const answer = await fetch(`/state?since=${version}`);
    if (answer.status === 200) {
      take(await answer.json());
      wait = page.state.busy ? BUSY : IDLE;
    } else if (answer.status !== 204) gone(await answer.text());
    else if (page.away) { page.away = ""; draw(); }
  } catch { gone("The server has ended. `lptn open` with the same files continues from here."); }
  asking = false;
  timer = setTimeout(ask, wait);
}
document.addEventListener("visibilitychange", () => document.hidden || ask());

function gone(why) { page.away = why; version = -1; draw(); }

function take(state) {
  page.away = "";
  version = state.version;
  page.state = state;
  if (page.shown === "against" && !state.against) page.shown = "now";
  const known = new Set(state.segments?.map(each => each.key));
  page.picked = page.picked.filter(each => known.has(each.segment) && state.nodes.includes(each.node));
  if (!page.picked.length && state.tiles) page.picked = [sections.worst(state)];
  const tried = sections.triable(state).map(each => each.key);
  if (page.making && !state.busy && version >= page.making.version) {
    const { name } = page.making;
    page.making = null;
    page.made = state.failed ? "" : name;
    if (page.made) h("a", { href: `/result/${name}`, download: name }).click();
  }
  if (tried.includes(page.pinned)) page.attempt = page.pinned;  // a fit that was ordered to be tried is there
  else if (!tried.includes(page.attempt)) page.attempt = "";
  draw();
}

// A section is made anew where what it shows has changed; what had the keyboard's focus, or stood open, has it again.
const before = {};
function redraw(id, shown, make) {
  const now = JSON.stringify(shown);
  if (before[id] === now) return;
  before[id] = now;
  const section = place(id), focused = section.contains(document.activeElement) ? document.activeElement.id : "";
  const open = [...section.querySelectorAll("details[open]")].map(each => each.id);
  const scrolled = section.querySelector(".tiles")?.scrollTop;
  section.replaceChildren(...make().flat(3).filter(Boolean));
  for (const each of open) if (each && place(each)) place(each).open = true;
  if (scrolled) section.querySelector(".tiles").scrollTop = scrolled;
  if (focused) place(focused)?.focus();
}

// Of many nodes the tile that is opened, the worst at first, may lie below the others' edge.
let revealedFor = "";
function revealed() {
  const chosen = document.querySelector('.tiles [aria-pressed="true"]'), now = JSON.stringify(page.picked);
  if (!chosen || revealedFor === now) return;
  revealedFor = now;
  const tiles = chosen.closest(".tiles"), box = tiles.getBoundingClientRect(), at = chosen.getBoundingClientRect();
  if (at.top < box.top || at.bottom > box.bottom) tiles.scrollTop += at.top - box.top - tiles.clientHeight / 2;
}

export function draw() {
  const { state, attempt, picked, shown, failed, away } = page, busy = !!state.busy;
  document.title = state.name ? `${state.name} – lptn` : "lptn";
  place("name").textContent = state.name ?? "lptn";
  redraw("work", [state.busy, state.failed, failed, away], () => sections.work(page));
  redraw("home", [state.begins, state.desk, state.name, state.example, page.sending, state.fitted], () => begin.home(page));
  redraw("start", [state.begins, state.recent, state.desk, state.name, state.example, busy, page.sending], () => begin.start(page));
  place("desk").hidden = !state.desk;
  redraw("logs", [state.desk, busy, page.sending], () => begin.logs(page));
  redraw("columns", [state.desk, page.log, busy], () => begin.columns(page));
  redraw("entries", [state.desk?.tables, state.desk?.drawing, state.desk?.places, busy], () => forms(page));
  redraw("model", [state.desk, busy], () => begin.model(page));
  redraw("head", [state.head, state.desk, state.against], () => sections.head(state));
  redraw("written", [state.written, state.others, state.against, state.desk, !!state.tiles, busy], () => sections.notes(page));
  redraw("steps", [state.steps, state.undone, state.branches, state.head, attempt, busy, state.busy?.found, state.answers], () => sections.steps(page));
  redraw("where", [state.tiles, picked, shown, page.by, state.against], () => sections.where(page));
  revealed();
  place("own").hidden = !state.tiles;
  redraw("signals", [state.written, picked[0]?.segment, state.segments, state.nodes, !!state.tiles, page.filter], () => signals(page));
  redraw("missing", [state.answers, state.advice, attempt, busy, state.fitted, state.now], () => sections.missing(page));
  redraw("data", [state.segments, state.issues, state.stretches, state.notes, busy, state.parameters, page.part, page.edited], () => sections.data(page));
  redraw("out", [state.commands, state.python, busy, state.folder, state.fitted, page.made], () => sections.out(page));
  if (state.tiles) plots.draw();
  else plots.clear();
  residuals.draw();
  network.draw();
  redraw("tour", [state.examples, state.example, state.head, busy, attempt, !!state.answers, page.clicked, plots.windows, page.step], () => tour(page, plots));
}

begin.takeDropped(page);
const held = ["header", "#tour"].map(each => document.querySelector(each));  // above what scrolls
const above = new ResizeObserver(() => document.documentElement.style.setProperty("--top", `${held.reduce((sum, each) => sum + each.offsetHeight, 2)}px`));
held.forEach(each => above.observe(each));
document.addEventListener("keydown", event => {
  const { steps, undone, busy } = page.state, redo = event.shiftKey || event.key === "y";
  if (!(event.ctrlKey || event.metaKey) || !["z", "Z", "y"].includes(event.key) || busy || event.target.closest("input, textarea, select")) return;
  if (redo ? !undone?.length : !(steps?.length > 1)) return;
  event.preventDefault();
  page.order({ what: redo ? "redo" : "undo" });
});
place("filter").addEventListener("input", event => { page.filter = event.target.value.trim(); draw(); });
setInterval(() => page.state.busy && redraw("work", [page.state.busy, Date.now() / 1000 | 0], () => sections.work(page)), 1000);
ask();
export { h };
