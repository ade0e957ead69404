// Sections of the page that are text, tables and buttons: each a function from the state to elements.

export function h(tag, properties, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties ?? {})) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && name !== "list") element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.flat(3).filter(child => child != null && child !== false));
  return element;
}

// A name that may be broken behind its signs, and within a word only where nothing else helps.
export const name = text => text.split(/(?<=[_./\\-])/).flatMap((part, k) => k ? [document.createElement("wbr"), part] : [part]);

export const digits = (value, count = 3) => value == null ? "–" : Number(value).toPrecision(count).replace("-", "−");
export const kelvin = value => value == null ? "–" : `${digits(value)} K`;
const unit = each => each.unit.replaceAll("*", "·");
const MOST_COLOUR = 55;  // % of a tile: its number keeps a contrast of 4.5 in light and dark (WCAG 2.2, 1.4.3)
const HEADS_ABREAST = 3;  // names of runs that stand beside each other; those of more stand upright
const OPEN_ISSUES = 5;  // of the logs; a longer list is folded: it would push all below it off the screen
const LARGEST = 1e12;  // what no bound of nature's bounds is declared to reach so far
const signed = value => `${value < 0 ? "−" : "+"}${Math.abs(value) < 9.95 ? Math.abs(value).toPrecision(2) : Math.abs(value).toFixed(0)}`;
const capital = text => text.charAt(0).toUpperCase() + text.slice(1);
const listed = items => items.length < 2 ? items.join("") : `${items.slice(0, -1).join(", ")} and ${items.at(-1)}`;
export const duration = seconds => seconds < 60 ? `${seconds | 0} s` : `${seconds / 60 | 0} min ${seconds % 60 | 0} s`;

// --- what is being done -----------------------------------------------------------------------------------

export function work(page) {
  const { busy, failed } = page.state;
  if (page.away) return [h("span", { className: "failed" }, page.away)];
  if (busy) {
    const said = busy.said.at(-1), seconds = Date.now() / 1000 - busy.since;
    const line = `${capital(busy.words)}${said ? ` – ${said}` : ""}${seconds > 2 ? ` (${duration(seconds)})` : ""}`;
    return [h("i"), h("span", { title: busy.said.join("\n") }, line), busy.what !== "open" || page.state.folder
      ? h("button", { id: "stop", onclick: page.stop }, "Stop") : null];
  }
  const problems = [page.failed, failed].filter(Boolean).join(" · ");
  return problems ? [h("span", { className: "failed" }, problems)] : [];
}

// --- head and steps --------------------------------------------------------------------------------------

export function head(state) {
  const it = state.head;
  if (!it) return [h("p", { className: "lead soft" }, state.version && !state.desk && (state.name || state.example || !state.begins) ? "The logs are read, then the model as given is fitted." : "")];
  const which = it.which.replace(" ", "-");
  const figure = (name, value, label, count) => h("div", { className: name }, h("b", null, `${digits(value, count)} K`), h("small", null, label));
  const added = state.steps.length > 1;
  return [
    h("div", { className: "figures" },
      figure("given", it.given, `${which} error, as given`),
      added && figure("now", it.now, `${which} error now`),
      it.against != null && figure("against", it.against, `${which} error of the study beside`),
      figure("floor", it.floor, "the sensors’ own noise", 2)),
    h("div", { className: "lead" }, ...it.said.map(([label, text]) => h("p", null, h("b", null, `${label}: `), text))),
  ];
}

export function steps(page) {
  const { state } = page, { steps, undone, head, answers, busy } = state;
  if (!steps) return [];
  const held = head.which === "held out", tested = steps.some(step => step.test != null);
  const error = step => held ? step.holdout : step.fit;
  const tried = triable(page.state).find(each => each.key === page.attempt);
  const finding = busy?.found ?? [];
  const rows = [...steps, ...finding.map(step => ({ ...step, attempt: true })), ...(tried ? [{ ...tried, name: `try: ${placed(tried)}`, attempt: true }] : []), ...undone.map(step => ({ ...step, undone: true }))];
  const most = Math.max(...rows.map(error).filter(Number.isFinite)) || 1;
  const bar = (step, number) => {
    const filled = h("i", { className: step.attempt ? "attempt" : number === 0 ? "zero" : "" }), floor = h("u", { title: `the sensors’ noise: ${kelvin(head.floor)}` });
    filled.style.width = `${100 * (error(step) ?? 0) / most}%`;
    floor.style.left = `${100 * head.floor / most}%`;
    return h("td", { className: "bar" }, h("span", null, filled, floor));
  };
  // A row is kept for what may be tried: the page must not move under the mouse that tries it.
  const kept = answers?.answers.length > 0 && !tried && h("tr", null, h("td", { innerHTML: "&nbsp;" }));
  const table = h("table", null,
    h("thead", null, h("tr", null, ["step", "effect", "parameters", "fitted", ...(held ? ["held out"] : []), ...(tested ? ["test"] : []), "RMSE"].map((name, k, all) =>
      h("th", { className: k < 2 ? "" : k < all.length - 1 ? "n" : "bar" }, name)))),
    h("tbody", null, rows.map((step, number) => h("tr", { className: step.undone ? "undone" : "" },
      h("td", { className: "soft" }, step.attempt ? "?" : step.undone ? "" : `${number}`),
      h("td", null, step.name), h("td", { className: "n soft" }, step.parameters ?? ""),
      h("td", { className: "n" }, kelvin(step.fit)),
      held && h("td", { className: "n" }, kelvin(step.holdout)), tested && h("td", { className: "n" }, kelvin(step.test)),
      bar(step, number))), kept));
  return [
    h("h2", null, "Steps"), table,
    h("div", { className: "row", style: "margin-top: 8px" },
      h("button", { id: "undo", disabled: busy || steps.length < 2, onclick: () => page.order({ what: "undo" }) }, "Undo"),
      h("button", { id: "redo", disabled: busy || !undone.length, onclick: () => page.order({ what: "redo" }) }, "Redo"),
      finding.length ? h("small", null, "The steps so far; Stop keeps them. ") : null,
      h("small", null, `Bars: RMSE on ${held ? "held-out" : "fitted"} data; the mark is the sensors’ noise.`)),
    state.branches.length ? h("details", { id: "branches" }, h("summary", null, `${state.branches.length} other ${state.branches.length > 1 ? "branches" : "branch"}`),
      h("ul", { className: "plain" }, state.branches.map((branch, number) => h("li", { className: "row" },
        h("button", { id: `back ${number}`, disabled: busy, onclick: () => page.order({ what: "back", number }) }, "Restore"),
        `${branch.map(step => step.name).join(", then ")}: ${kelvin(error(branch.at(-1)))}`)))) : null,
  ];
}

export const placed = ({ title, place }) => place === "everywhere" ? `${title} ${place}` : `${title} at ${place}`;
export const triable = ({ answers }) => answers ? [...answers.answers, ...answers.weighed].filter(each => each.tried) : [];

// --- where it fails ----------------------------------------------------------------------------------------

const judged = state => state.segments.filter(each => each.job !== "fitted").length
  ? state.segments.filter(each => each.job !== "fitted") : state.segments;

export function worst(state) {
  let found = { segment: state.segments[0].key, node: state.nodes[0] }, most = -1;
  for (const { key } of judged(state)) state.tiles[key].now.forEach((each, k) => {
    if (each && each.rmse > most) { most = each.rmse; found = { segment: key, node: state.nodes[k] }; }
  });
  return found;
}

export function where(page) {
  const { state, picked, shown } = page;
  if (!state.tiles) return [];
  const order = [...judged(state), ...state.segments.filter(each => !judged(state).includes(each))];
  // Colour is for what the sensors' noise does not explain: a tile of noise alone stays pale.
  const beyond = each => Math.sqrt(Math.max((each?.rmse ?? 0) ** 2 - state.head.floor ** 2, 0));
  const most = Math.max(...order.flatMap(({ key }) => state.tiles[key].given.map(beyond)), state.head.floor, 1e-9);
  const tile = (each, id, where, segment, node, pressed) => {
    if (!each) return h("td", { title: "not measured" }, "·");
    const side = each.mean < 0 ? "--cold" : "--hot", share = Math.min(beyond(each) / most, 1) ** 0.75;
    const way = Math.abs(each.mean) < 0.3 * each.rmse ? "to both sides" : each.mean < 0 ? "too cold" : "too hot";
    const button = h("button", {
      id: `tile ${id} ${node}`,
      title: `${node}, ${where}: RMSE ${kelvin(each.rmse)}, mean ${signed(each.mean)} K, largest ${kelvin(each.max)}; ${way}`,
      ariaPressed: pressed,
      onclick: event => page.pick(segment, node, event.shiftKey || event.ctrlKey || event.metaKey),
    }, signed(each.mean < 0 ? -each.rmse : each.rmse));
    button.style.background = `color-mix(in srgb, var(${side}) ${MOST_COLOUR * share}%, transparent)`;
    return h("td", null, button);
  };
  // Nodes that no run measures have no tiles, and would be half the rows of a model of windings and housings.
  const silent = state.nodes.filter((_, k) => order.every(({ key }) => !state.tiles[key].given[k]));
  const rows = columns => state.nodes.map((node, k) => [node, k]).filter(([node]) => !silent.includes(node)).map(([node, k]) => h("tr", null, h("th", { scope: "row" }, node), columns(node, k)));
  const unmeasured = silent.length ? h("p", null, h("small", null, `Measured in no run: ${listed(silent)}.`)) : null;
  const choice = (name, label) => h("button", { id: `show ${name}`, ariaPressed: shown === name, onclick: () => page.show(name) }, label);
  const grouping = (by, label) => h("button", { id: `by ${by}`, ariaPressed: page.by === by, onclick: () => page.group(by) }, label);
  const bar = h("div", { className: "row" }, h("h2", { style: "margin: 0" }, "Where it fails"), grouping("run", "by run"), grouping("condition", "by condition"), (state.given !== state.now || state.against) && [state.given !== state.now && choice("given", "as given"), choice("now", "now"), state.against && page.by === "run" && choice("against", "beside")]);
  const said = "RMSE in K; + the model is too hot (orange), − too cold (blue), darker where further beyond the sensors’ noise. A tile opens its plot; with Shift, below the others.";
  if (page.by === "condition") {
    const columns = state.conditions[shown === "against" ? "now" : shown], groups = [...new Set(columns.map(each => each.group))];
    const which = state.segments.some(each => each.job !== "fitted") ? "held-out data" : "fitted data";
    return [bar, h("p", null, h("small", null, `${said} All ${which}, by operating condition: each node’s readings in five equal parts, from low to high.`)),
      h("div", { className: "tiles narrow" }, h("table", null,
        h("thead", null,
          h("tr", null, h("td"), groups.map(group => h("th", { scope: "colgroup", colSpan: columns.filter(each => each.group === group).length, className: "job" }, group))),
          h("tr", null, h("td"), columns.map(each => h("th", { scope: "col" }, h("span", null, each.name))))),
        h("tbody", null, rows((node, k) =>
          columns.map(each => tile(each.tiles[k], `${each.group} ${each.name}`, `${each.group}: ${each.name}${each.tiles[k]?.limits ? ` (${each.tiles[k].limits})` : ""}`, each.tiles[k]?.segment, node, false)))))), unmeasured];
  }
  return [bar, h("p", null, h("small", null, said)),
    h("div", { className: `tiles${order.length > HEADS_ABREAST ? " narrow" : ""}` }, h("table", null,
      h("thead", null,
        h("tr", null, h("td"), ["held out", "test", "fitted"].map(job => [job, order.filter(each => each.job === job).length]).filter(([, count]) => count)
          .map(([job, count]) => h("th", { scope: "colgroup", colSpan: count, className: "job" }, job))),
        h("tr", null, h("td"), order.map(each => h("th", { scope: "col" }, h("span", null, name(each.run)))))),
      h("tbody", null, rows((node, k) => order.map(each => tile(state.tiles[each.key][shown][k], each.key, `${each.run} (${each.job})`, each.key, node, picked.some(p => p.segment === each.key && p.node === node))))))),
    unmeasured,
  ];
}

// --- what a person writes on a study ---------------------------------------------------------------------------

// A run that is cut leaves pieces, NAME#1.
export const ofOneRun = (one, other) => `${one}#`.startsWith(`${other}#`) || `${other}#`.startsWith(`${one}#`);

export function notes(page) {
  const { written, others, against, busy, desk, tiles, segments } = page.state;
  if (!tiles || desk) return [];
  const since = mark => mark.time - (segments.find(each => ofOneRun(each.run, mark.run))?.origin ?? 0);
  const marks = written.marks.map((mark, k) => h("li", { className: "row" }, `${mark.run}, ${digits(since(mark), 4)} s: ${mark.text}`,
    h("button", { id: `unmark ${k}`, ariaLabel: `Remove the note ${mark.text}`, onclick: () => page.order({ what: "note", marks: written.marks.toSpliced(k, 1) }) }, "✕")));
  const about = each => [each.name, each.tags.join(", "), each.logs.join(", "), `${each.steps} added`].filter(Boolean).join(" · ");
  return [h("div", { className: "row" },
    h("label", { className: "row" }, h("small", null, "Tags"), h("input", { id: "tags", size: 18, value: written.tags.join(", "),
      onchange: event => page.order({ what: "note", tags: event.target.value.split(",").map(tag => tag.trim()).filter(Boolean) }) })),
    h("label", { className: "row grow" }, h("small", null, "Note"), h("input", { id: "note", className: "grow", maxLength: 2000, value: written.text, onchange: event => page.order({ what: "note", text: event.target.value.trim() }) })),
    others.length ? h("label", { className: "row" }, h("small", null, "Beside"), h("select", { id: "against", disabled: busy, onchange: event => page.order({ what: "against", study: event.target.value }) },
      h("option", { value: "" }, "no other study"), others.map(each => h("option", { value: each.study, selected: against === `against ${each.study}` }, about(each))))) : null),
    marks.length ? h("ul", { className: "plain" }, marks) : null];
}

// --- what is missing ----------------------------------------------------------------------------------------

export function missing(page) {
  const { state } = page, { answers, busy } = state;
  if (!state.steps) return state.fitted === false && !busy && state.name
    ? [h("button", { id: "fit", className: "first", onclick: () => page.order({ what: "fit" }) }, "Fit the model as given")] : [];
  const ask = (what, label, first) => h("button", { id: what, className: first ? "first" : "", disabled: busy, onclick: () => page.order({ what }) }, label);
  const title = h("h2", null, "What is missing");
  const other = addAnother(page);
  if (!answers) return [title,
    h("p", null, "Effects that every part may have are fitted at once. Then effects at one place, sensor or run are tested. Each gets a probability."),
    h("div", { className: "row" }, ask("diagnose", "Find what is missing", true), ask("improve", "Find and add automatically")), other];
  const error = step => step.holdout ?? step.fit, now = state.steps.at(-1);
  const change = each => each.tried ? `alone: ${each.holdout != null ? "held out" : "fitted"} ${digits(error(now))} → ${kelvin(error(each))}` : "";
  const best = answers.answers.find(each => each.tried && error(each) < error(now));  // the most probable one that helps
  const tryable = (each, ...more) => h("li", {
    onmouseenter: () => each.tried && !page.pinned && page.attemptTo(each.key),
    onmouseleave: () => page.pinned || page.attemptTo(""),
  },
    h("div", { className: "name" },
      h("span", null, h(each.likely === false ? "span" : "b", null, each.title), placed(each).slice(each.title.length)),
      h("button", {
        id: `try ${each.key}`, disabled: !each.tried && busy, ariaPressed: page.attempt === each.key,
        onclick: () => {
          page.pinned = page.pinned === each.key ? "" : each.key;
          if (each.tried) page.attemptTo(page.pinned);
          else page.order({ what: "try", effect: each.effect, at: each.at });
        },
      }, "Try"),
      h("button", { id: `add ${each.key}`, className: each === best ? "first" : "", disabled: busy, onclick: () => { page.pinned = ""; page.order({ what: "add", effect: each.effect, at: each.at }); } }, "Add")),
    ...more);
  const weighed = each => tryable(each, h("span", { className: "soft" }, change(each)));
  const answer = each => tryable(each,
    h("div", null, [each.size, `${each.probable} probable`].filter(text => text).join(", "), h("span", { className: "soft" }, each.tried && ` · ${change(each)}`)),
    each.same.length ? h("div", { className: "soft" }, `or ${each.same.join(" or ")}: these data cannot distinguish them`) : null,
    h("details", { id: `more ${each.key}` }, h("summary", null, "Equation, signs, experiment"),
      each.equations.map(equation => h("div", { className: "equation" }, equation)),
      each.details && h("p", null, `${capital(each.details)}.`),
      h("p", null, `Without this effect: ${each.looks_like}.`),
      h("p", null, `An experiment that separates it from others: ${each.separate_by}.`)));
  return [title,
    answers.answers.length ? null : h("p", null, "No effect of the catalogue helps; see the verdict above."),
    ...[["finding", "Findings: effects at one place, sensor or run"], ["structure", "Structure: effects that all parts have"]].map(([kind, label]) => {
      const own = answers.answers.filter(each => each.kind === kind);
      return own.length ? [h("h3", null, label), h("ol", { className: "answers" }, own.map(answer))] : null;
    }),
    answers.refused.length ? h("details", { id: "refused" }, h("summary", null, "Fitted as well, and not added"),
      h("ul", { className: "plain" }, answers.refused.map(each => h("li", null, `${placed(each)}: ${each.size ? `${each.size}, ` : ""}${each.probable} probable`)))) : null,
    answers.weighed.length ? h("details", { id: "weighed" }, h("summary", null, "Less probable: not fitted so far"),
      h("p", null, h("small", null, "Try fits one of them, and Add keeps that fit.")),
      h("ol", { className: "answers" }, answers.weighed.map(weighed))) : null,
    answers.answers.length ? h("p", null, h("small", null, "Size ± standard error and probability: with all answers in the model. Error: with this answer alone added and fitted; Add keeps that fit.")) : null,
    state.advice.length ? h("details", { id: "advice", open: true }, h("summary", null, "What to do next"), state.advice.map(text => h("p", null, h("small", null, text)))) : null,
    // After a finished search there is nothing to add, and a second search finds the same.
    answers.answers.length ? h("div", { className: "row" }, ask("improve", "Find and add automatically", !best && !busy),
      answers.answers.length > 1 && state.steps.length === 1 ? h("span", { className: "soft" }, `all of them: ${now.holdout != null ? "held out" : "fitted"} ${digits(error(now))} → about ${digits(answers.together, 2)} K`) : null) : null, other];
}

// What was chosen here stays chosen while the section is made anew, as it is when an answer comes in the meantime.
function addAnother(page) {
  const { effects, nodes, busy } = page.state, { other } = page;
  const kind = h("select", { id: "other effect", ariaLabel: "effect" }, Object.entries(effects).map(([key, title]) => h("option", { value: key }, title)));
  const at = h("input", { id: "other place", ariaLabel: "place", placeholder: `${nodes[0]}, a~b or *`, list: "places", size: 18 });
  for (const [name, field] of Object.entries({ kind, at })) {
    field.value = other[name] ?? field.value;
    field.oninput = () => { other[name] = field.value; };
  }
  return h("details", { id: "other", style: "margin-top: 10px" }, h("summary", null, "Add another effect"),
    h("div", { className: "row", style: "margin-top: 6px" }, kind, "at", at, h("datalist", { id: "places" }, ["*", ...nodes].map(value => h("option", { value }))),
      h("button", { disabled: busy, onclick: () => page.order({ what: "add", effect: kind.value, at: at.value.trim() || "*" }) }, "Add")));
}

// --- data, and what to take away --------------------------------------------------------------------------

export function data(page) {
  const { segments, stretches, contents, issues, notes, parameters, busy } = page.state;
  if (!segments) return [];
  const origin = name => segments.find(each => `${each.run}#`.startsWith(`${name}#`))?.origin ?? 0;  // of a piece of it
  const again = each => h("li", { className: "row" }, `${each.run}, ${digits(each.start - origin(each.run), 4)} to ${digits(each.stop - origin(each.run), 4)} s: ${each.held_out ? "held out" : "left out"}`,
    h("button", { disabled: busy, onclick: () => page.order({ what: "use_again", run: each.run, start: each.start, stop: each.stop }) }, "Use again"));
  return [h("h2", null, "Data and parameters"),
    contents.map(([label, text]) => h("p", null, h("small", null, h("b", null, `${label}: `), text))),
    stretches.length ? h("ul", { className: "plain" }, stretches.map(again)) : null,
    stretches.length > 1 ? h("p", null, h("button", { id: "use_all", disabled: busy, onclick: () => page.order({ what: "use_all" }) }, "Use all data again")) : null,
    issues.length ? h("details", { id: "issues", open: issues.length <= OPEN_ISSUES }, h("summary", null, `${issues.length} ${issues.length > 1 ? "things look" : "thing looks"} wrong in the logs`),
      h("ul", null, issues.map(each => h("li", null, `${each.run}, ${each.key}: ${each.problem}; `, h("span", { className: "soft" }, `${each.remedy}.`)))))
      : h("p", { className: "soft" }, "Nothing looks wrong in the logs."),
    notes.filter(note => !issues.some(each => note.includes(each.key))).map(note => h("p", null, h("small", null, note))),
    parameters && parameterTable(page)];
}

// Parameters of a part of the model, each with its interval and its bounds, or what is known of it; one at a time can be set.
function parameterTable(page) {
  const { parameters, busy } = page.state, parts = [...new Set(parameters.map(each => each.part))];
  const fitted = parameters.filter(each => each.free).length, shown = parameters.filter(each => !page.part || each.part === page.part);
  const short = value => value == null || Math.abs(value) >= LARGEST ? value < 0 ? "−∞" : "∞" : Math.abs(value) >= 1e5 || value && Math.abs(value) < 1e-3 ? value.toExponential(1) : Number(value.toPrecision(4)).toString().replace("-", "−");
  const said = each => each.free ? each.error == null ? "not determined" : `± ${short(Number((1.96 * each.error).toPrecision(2)))}` : "fixed";
  const beforehand = each => each.prior ? `known: ${each.prior.map(short).join(" ± ")}` : `${short(each.bounds[0])} … ${short(each.bounds[1])}`;
  const row = each => h("tr", null, h("td", null, each.name), h("td", { className: "n" }, digits(each.value, 4)), h("td", { className: "n soft" }, said(each)), h("td", { className: "soft" }, unit(each)),
    h("td", { className: "n soft" }, each.free ? beforehand(each) : ""),
    h("td", null, h("button", { id: `edit ${each.name}`, ariaExpanded: page.edited === each.name, onclick: () => page.edit(each.name) }, "Change")));
  const form = each => {
    const field = (id, label, value) => h("label", null, `${label} `, h("input", { id, type: "number", step: "any", required: id === "set value", value: value ?? "", size: 9 }));
    const order = fixed => event => {
      event.preventDefault();
      const number = id => document.getElementById(id).valueAsNumber;
      const set = { what: "set", name: each.name, value: number("set value"), bounds: [number("set least"), number("set most")], fixed };
      page.edit("");
      page.order(set);
    };
    return h("tr", null, h("td", { colSpan: 6 }, h("form", { className: "row", onsubmit: order(!each.free) },
      field("set value", "value", Number(each.value.toPrecision(6))), field("set least", "at least", each.bounds[0]), field("set most", "at most", each.bounds[1]), unit(each),
      h("button", { id: "set", className: "first", disabled: busy }, "Fit again"),
      h("button", { id: "set other", type: "button", disabled: busy, onclick: order(each.free) }, each.free ? "Fix it there, and fit the rest" : "Free it"),
      each.together.length ? h("small", null, `The bounds, and whether it is fixed, also apply to ${listed(each.together)}: they are declared together.`) : null)));
  };
  return h("details", { id: "parameters" }, h("summary", null, `${fitted} fitted parameters, ${parameters.length - fitted} fixed`),
    parts.length > 1 && h("select", { id: "part", ariaLabel: "node or link", onchange: event => page.partOf(event.target.value) },
      h("option", { value: "" }, "all nodes and links"), parts.map(part => h("option", { value: part, selected: part === page.part }, part))),
    h("table", { className: "parameters" }, h("thead", null, h("tr", null, ["parameter", "value", "95 %", "unit", "bounds"].map((name, k) => h("th", { className: k % 3 ? "n" : "" }, name)), h("td"))),
      h("tbody", null, shown.flatMap(each => page.edited === each.name ? [row(each), form(each)] : [row(each)]))));
}

export function out(page) {
  const { commands, python, busy, folder, fitted } = page.state;
  if (!fitted) return [];
  // One click: it is made of the study as it is, and comes as soon as it is there.
  const made = (what, name, verb) => h("button", { id: `make ${what}`, disabled: busy, onclick: () => page.fetchMade(what, name) }, verb);
  return [h("h2", null, "Take away"),
    h("div", { className: "row" }, h("a", { className: "button", id: "get model", href: "/model", download: "better.toml" }, "Model file"),
      made("report", "story.html", "Report to share"), made("fmu", "model.fmu", "FMU")),
    page.made && h("p", { role: "status" }, `${page.made} is in your downloads, and in ${folder}.`),
    h("p", null, h("small", null, "The report is one HTML file, whose figures can be read and zoomed in any browser.")),
    h("details", { id: "commands" }, h("summary", null, "The same as commands"), h("pre", { tabIndex: 0 }, commands.join("\n"))),
    h("details", { id: "python" }, h("summary", null, "The same in Python"), h("pre", { tabIndex: 0 }, python)),
    h("p", null, h("small", null, `This session is saved in ${folder}; the same command continues it.`))];
}
