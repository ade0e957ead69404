// The tour over an example: one step at a time, each over as soon as what it asks for is done.

import { h, kelvin } from "/sections.js";

const SKIPPABLE = 3;  // looking at plots may be left out
const FALLEN = 0.5;  // of the error as given: nobody misses that on the bars

const STEPS = [
  { at: ".tiles [aria-pressed='true']", words: "Each tile is a joint in a run, orange where the model is too hot, blue where it is too cold. Click the strongest one.", done: page => page.clicked },
  { at: ".stack", words: "Its plots: what was measured, what the model says, and the error between them. Drag to zoom in.", done: (page, plots) => Object.keys(plots.windows).length },
  { at: "[id='whole']", words: "Hover to read values. Back to the whole run with this button, or with the key 0.", done: (page, plots) => !Object.keys(plots.windows).length },
  { at: "#diagnose", words: "Now find the missing effects: those of all parts, and those of one part alone.", done: page => page.state.answers },
  { at: ".answers li", words: "First the findings, which set one place apart, then what all parts have in common. Put the mouse on an answer, or press Try: plots and dashed bar show the model with this answer alone.", done: page => page.attempt },
  { at: ".answers button.first", words: "Add it: the model that you tried is kept, and the error falls.", done: page => page.state.steps.length > 1 },
  { at: "#improve", words: "The error fell. Undo it, and press “Find and add automatically”: all answers are added, one after the other, and the errors fall.", done: page => page.state.head.now <= FALLEN * page.state.head.given },
];

export const open = (page, name, label) => h("button", { id: `example ${name}`, onclick: () => { page.clicked = false; page.step = 0; page.order({ what: "example", name }); } }, label);

export function tour(page, plots) {
  const { examples, example, head, busy } = page.state;
  if (!examples || !Object.keys(examples).length) return [];
  if (!example) return [];
  const it = examples[example], other = Object.keys(examples).find(name => name !== example);
  if (!head) return [h("p", null, h("b", null, it.title), `. ${it.about}`)];
  const ahead = STEPS.findLastIndex((step, k) => k >= SKIPPABLE && step.done(page, plots));
  page.step = Math.max(page.step, ahead + 1);
  while (page.step < STEPS.length && STEPS[page.step].done(page, plots)) page.step++;
  const step = STEPS[page.step];
  for (const old of document.querySelectorAll(".here")) old.classList.remove("here");
  if (step && !busy) document.querySelector(step.at)?.classList.add("here");
  if (step) return [h("p", null, h("b", null, `${page.step + 1} of ${STEPS.length}  `), page.step ? "" : `${it.about} `, step.words)];
  return [h("p", null, h("b", null, "Done. "), `${kelvin(head.given)} has become ${kelvin(head.now)}. ${it.solved} `,
    "Model file, report and FMU stand at the foot of the page, with the commands that do the same."),
    h("div", { className: "row" }, open(page, other, examples[other].title), h("button", { onclick: () => page.order({ what: "leave" }) }, "Begin with files of your own"))];
}
