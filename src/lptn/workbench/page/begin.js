// Where a study begins: files by picker or dropped, what their columns mean, the model file, which runs are fitted.

import { duration, h, name as broken } from "/sections.js";
import { open } from "/tour.js";

const JOBS = { fit: "Fitted", holdout: "Held out", test: "Test", unused: "Not used" };
const EXPLAINED = { fit: "The parameters are found on these.", holdout: "The model is judged on these, which no fit sees.", unused: "" };
const size = bytes => bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
const PACE_KNOWN = 0.02;  // of a file: by then it is steady
const takes = state => state.begins && (state.desk || !state.name && !state.example && !state.segments);

// --- files on their way ---------------------------------------------------------------------------------------

let request = null;

// Files, each with the name under which it comes.
export async function send(page, files, based) {
  if (!takes(page.state)) return page.say("A study is open: leave it for the start page to begin with other files.");
  if (page.sending) return page.say("Files are on their way: wait, or cancel that.");
  const problems = [];
  let answer = {};
  for (const [number, [file, name]] of files.entries()) {
    page.sending = { name, begun: Date.now(), part: 0, left: files.length - number - 1 };
    page.say("");
    answer = await post(page, file, name, based);
    if (answer.error) problems.push(answer.error);
    if (answer.error === CANCELLED) break;
  }
  page.sending = null;
  page.say(problems.join(" · "));
  await page.ask();
  return problems.length ? null : answer;
}

const CANCELLED = "Cancelled: nothing of that file was kept.";

// A request of the old kind says how far a body has come; a `fetch` does not.
function post(page, file, name, based) {
  return new Promise(done => {
    request = new XMLHttpRequest();
    const words = new URLSearchParams({ name, ...(based == null ? {} : { based }) });
    request.open("POST", `/file?${words}`);
    request.upload.onprogress = ({ loaded, total }) => { page.sending = { ...page.sending, part: total ? loaded / total : 1, loaded }; page.tell(); };
    request.onload = () => { let said = {}; try { said = JSON.parse(request.responseText); } catch { /* no JSON of ours */ } done(request.status < 300 ? said : { error: said.error ?? `${request.status}` }); };
    request.onerror = () => done({ error: `${name}: the server does not answer, or refused it.` });
    request.onabort = () => done({ error: CANCELLED });
    if (file.size > page.state.largest) return done({ error: `${name}: ${size(file.size)}; at most ${size(page.state.largest)}` });
    request.send(file);
  });
}

// What is left at the pace so far, once that is known.
const left = ({ part, begun }) => {
  const seconds = (Date.now() - begun) / 1000 * (1 - part) / part;
  return part > PACE_KNOWN && part < 1 ? `, ${duration(seconds)} left` : "";
};

const progress = page => page.sending && h("div", { className: "row sending" },
  h("progress", { value: page.sending.part, max: 1, ariaLabel: "how much has come" }),
  h("span", null, `${page.sending.name}: ${Math.floor(100 * page.sending.part)} %${left(page.sending)}${page.sending.left ? `, ${page.sending.left} more` : ""}`),
  h("button", { id: "cancel", onclick: () => request.abort() }, "Cancel"));

// A bag's folder keeps its name, and its metadata come last, which make it a log; of another folder each file is one.
function named(files) {
  const bags = new Set(files.filter(([, path]) => path.endsWith("/metadata.yaml")).map(([, path]) => path.split("/")[0]));
  return files.filter(([, path]) => path.split("/").length < 3 && !path.split("/").at(-1).startsWith("."))
    .map(([file, path]) => [file, bags.has(path.split("/")[0]) ? path : path.split("/").at(-1)])
    .sort(([, one], [, other]) => one.endsWith("/metadata.yaml") - other.endsWith("/metadata.yaml"));
}

function picker(page, label, first) {
  const input = (id, label, more) => {
    const chosen = h("input", { type: "file", multiple: true, hidden: true, ...more, onchange: () => send(page, named([...chosen.files].map(file => [file, file.webkitRelativePath || file.name]))) });
    return [h("button", { id, className: first && id === "pick" ? "first" : "", disabled: !!page.sending, onclick: () => chosen.click() }, label), chosen];
  };
  return [input("pick", label), input("pick folder", "Choose a folder", { webkitdirectory: true })];
}

const taken = (call, ...given) => new Promise((done, failed) => call(...given, done, failed));

// All that is in a folder, which is told a hundred at a time.
async function listed(folder) {
  const reader = folder.createReader(), found = [];
  for (let more; (more = await taken(reader.readEntries.bind(reader))).length;) found.push(...more);
  return Promise.all(found.filter(each => each.isFile).map(async each => [await taken(each.file.bind(each)), `${folder.name}/${each.name}`]));
}

export function takeDropped(page) {
  const over = shown => document.body.classList.toggle("dropping", shown);
  const files = event => event.dataTransfer?.types.includes("Files");
  window.addEventListener("dragover", event => { if (files(event)) { event.preventDefault(); over(true); } });
  window.addEventListener("dragleave", event => { if (!event.relatedTarget) over(false); });
  window.addEventListener("drop", async event => {
    if (!files(event)) return;
    event.preventDefault();
    over(false);
    const dropped = [...event.dataTransfer.items].map(item => [item.webkitGetAsEntry?.(), item.getAsFile()]);  // they are gone with the event
    send(page, named((await Promise.all(dropped.map(([entry, file]) => entry?.isDirectory ? listed(entry) : [[file, file.name]]))).flat()));
  });
}

// --- the page that a workbench begins with ------------------------------------------------------------------------

export function home(page) {
  const { begins, desk, example, name, fitted } = page.state;
  const away = fitted ? [h("button", { id: "to take away", onclick: () => document.getElementById("out").scrollIntoView() }, "Model, FMU, report")] : [];
  return begins && (desk || example || name) ? [h("button", { id: "leave", disabled: !!page.sending, onclick: () => page.order({ what: "leave" }) }, "Start page"), ...away] : away;
}

export function start(page) {
  const { begins, recent, examples, desk, busy, example, name } = page.state;
  if (!begins || desk || example || name) return [];
  if (busy) return [progress(page)];
  const date = seconds => new Date(1000 * seconds).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
  const study = each => h("li", null,
    h("div", { className: "row" },
      h("b", null, each.name || "Not opened yet"),
      each.tags?.map(tag => h("span", { className: "tag" }, tag)),
      h("small", null, `${date(each.changed)}${each.study ? `, ${each.steps} ${each.steps === 1 ? "effect" : "effects"} added` : ""}`)),
    h("div", { className: "soft names" }, each.logs.join(", ") || "no log"), each.text && h("div", null, each.text),
    h("div", { className: "row" },
      each.study && h("button", { id: `recent ${each.study}`, onclick: () => page.order({ what: "recent", name: each.study }) }, "Continue"),
      each.desk && h("button", { id: `recent ${each.desk}`, onclick: () => page.order({ what: "recent", name: each.desk }) }, each.study ? "Its files and columns" : "Continue")));
  return [
    h("div", { className: "drop" }, h("h2", null, "Drop a robot’s log here"),
      h("p", null, "CSV, Parquet, .xlsx, ROS bags (.bag, .mcap, .db3, or their folder), ULog, MDF4, TDMS, HDF5, MATLAB; a model file or a URDF, too. Nothing leaves this machine."),
      h("div", { className: "row" }, picker(page, "Choose files", true), h("small", null, `${size(page.state.largest)} at most`)), progress(page)),
    h("div", { className: "two" },
      h("div", null, h("h2", null, "Recent studies"), recent.length ? h("ul", { className: "plain recent" }, recent.map(study)) : h("p", { className: "soft" }, "None yet.")),
      h("div", null, h("h2", null, "A tour, five minutes each"), Object.entries(examples).map(([key, each]) => h("div", { className: "example" },
        h("h3", null, each.title), h("p", null, each.about), open(page, key, "Begin"))))),
  ];
}

// --- logs, and what each is for -------------------------------------------------------------------------------------

export function logs(page) {
  const { desk, busy } = page.state;
  if (!desk) return [];
  const order = (log, job) => log.job !== job && page.order({ what: "job", log: log.name, job });
  const entry = (log, asked = air(page, log)) => h("li", { draggable: !busy, className: log.refused ? "log wrong" : "log", ondragstart: event => event.dataTransfer.setData("text/x-log", log.name) },
    h("div", { className: "row" }, h("b", { className: "names" }, broken(log.name)),
      h("select", { id: `job ${log.name}`, ariaLabel: `what ${log.name} is for`, disabled: busy, onchange: event => order(log, event.target.value) },
        Object.entries(JOBS).map(([job, label]) => h("option", { value: job, selected: job === log.job }, label))),
      h("button", { id: `remove ${log.name}`, ariaLabel: `Remove ${log.name}`, title: "Remove it from here", disabled: busy, onclick: () => page.order({ what: "remove", name: log.name }) }, "✕")),
    h("div", { className: "soft" }, [!log.refused && log.said, log.size && size(log.size), log.air?.column && `air: ${log.air.column}`].filter(Boolean).join(", ")),
    log.refused && (log.opened ? h("details", { id: `why ${log.name}` }, h("summary", { className: "problem" }, "It can’t be used yet"), log.refused) : h("div", { className: "problem" }, log.refused)),
    asked);
  const list = job => {
    const own = desk.logs.filter(log => (log.job === "test" ? "holdout" : log.job) === job);
    return h("div", {
      className: "jobs", id: `list ${job}`,
      ondragover: event => { if (event.dataTransfer.types.includes("text/x-log")) event.preventDefault(); },
      ondrop: event => { const log = desk.logs.find(each => each.name === event.dataTransfer.getData("text/x-log")); if (log) { event.preventDefault(); order(log, job); } },
    }, h("h3", null, JOBS[job]), h("small", null, EXPLAINED[job]), h("ul", { className: "plain" }, own.map(log => entry(log))), own.length ? null : h("p", { className: "soft empty" }, "Drag a log here, or choose it at the log."));
  };
  const after = desk.holdout_after == null ? "" : Number(String(desk.holdout_after).replace("+", ""));
  return [h("div", { className: "row" }, h("h2", { style: "margin: 0" }, "Logs"), picker(page, "Add files"), progress(page), h("span", { className: "grow" }),
    h("small", null, desk.ready ? "" : unready(desk)),
    h("button", { id: "open", className: "first", disabled: busy || !desk.ready || !!page.sending || !desk.logs.some(log => log.job === "fit"), onclick: () => page.order({ what: "begin" }) }, "Open the study")),
    h("div", { className: "three" }, ["fit", "holdout", "unused"].map(list)),
    h("label", null, h("small", null, "Or hold out the end of each fitted log, from "),
      h("input", { id: "after", type: "number", min: 1, step: "any", size: 8, value: after, disabled: busy, onchange: event => page.order({ what: "holdout_after", seconds: event.target.value ? event.target.valueAsNumber : null }) }), h("small", null, " s after its start"))];
}

const unready = desk => desk.wrong ? "The model file has to be corrected." : !desk.logs.some(log => log.job !== "unused") ? "No log yet." : "A log can’t be used yet: see below.";

// The air of one run: its column, or how warm it was.
function air(page, log) {
  const { desk, busy } = page.state;
  if (!desk.air || !log.opened) return null;
  const { column, value } = log.air;
  if (column && value == null) return null;
  const degrees = h("input", { id: `air ${log.name}`, type: "number", step: "any", size: 5, ariaLabel: "°C", value: typeof value === "number" ? value : "", disabled: busy,
    onchange: event => Number.isFinite(event.target.valueAsNumber) && page.order({ what: "air", log: log.name, value: event.target.valueAsNumber }) });
  return h("div", { className: value == null ? "row problem" : "row soft" }, value == null ? "No column of the air. It was" : "The air was",
    h("button", { id: `start ${log.name}`, ariaPressed: value === "start", disabled: busy, onclick: () => page.order({ what: "air", log: log.name, value: "start" }) }, "as warm as the robot at the start"), "or", degrees, "°C throughout");
}

// --- what the columns mean ------------------------------------------------------------------------------------------

export function columns(page) {
  const { desk, busy } = page.state;
  if (!desk?.logs.length) return [];
  const log = desk.logs.find(each => each.name === page.log) ?? desk.logs.find(each => each.refused && each.job !== "unused") ?? desk.logs[0];
  const guesses = Math.max(...desk.logs.filter(each => each.job !== "unused").map(each => each.guesses ?? 0), 0);
  return [h("div", { className: "row" }, h("h2", { style: "margin: 0" }, "What the columns mean"),
    guesses ? h("button", { id: "guesses", className: "first", disabled: busy, onclick: () => page.order({ what: "guesses" }) }, `Use all ${guesses} guesses`) : null),
    desk.logs.length > 1 && h("div", { className: "row tabs" }, desk.logs.map(each => h("button", { id: `columns ${each.name}`, className: "names", ariaPressed: each === log, onclick: () => page.look(each.name) }, each.name))),
    log.missing?.length ? h("p", { className: "problem" }, `Not found so far: ${log.missing.join(", ")}. Say below which column it is.`) : null,
    log.missing?.includes("time") ? h("p", { className: "row problem" }, "Or its rows have no times:",
      h("input", { id: "rate", type: "number", min: 0, step: "any", size: 6, ariaLabel: "rows a second", disabled: busy, onchange: event => event.target.valueAsNumber > 0 && page.order({ what: "rate", log: log.name, rate: event.target.valueAsNumber }) }), "rows a second") : null,
    log.columns.length ? h("div", { className: "scroll" }, h("table", { className: "columns" },
      h("thead", null, h("tr", null, ["readings", "column", "is", "of", "unit", "what speaks for it"].map(name => h("th", null, name)))),
      h("tbody", null, log.columns.map(each => row(page, log, each))))) : null,
    log.more ? h("p", null, h("small", null, `and ${log.more} columns more: name them in the model file, under [columns].`)) : null,
    log.notes?.length ? h("details", { id: "notes" }, h("summary", null, "What else was noticed"), log.notes.map(note => h("p", null, h("small", null, note)))) : null];
}

function row(page, log, each) {
  const { desk, busy } = page.state, [quantity, place] = each.key.split(/\.(.*)/s);
  const disabled = busy || each.how === "own", guessed = each.how === "guessed" ? "guessed" : "";
  const order = (key, unit) => page.order({ what: "map", log: log.name, column: each.name, key, unit });
  const to = (name, where) => {
    const own = desk.places.find(one => !log.columns.some(other => other.key === `${name}.${one}`)) ?? desk.places[0];
    order(!name ? "" : name === "time" ? "time" : `${name}.${where || own}`, name === quantity ? each.unit : "");
  };
  const option = (chosen, label) => value => h("option", { value, selected: value === chosen }, label?.(value) ?? value);
  return h("tr", { className: each.key ? "" : "idle" },
    h("td", null, picture(each)),
    h("th", { scope: "row", className: "names" }, broken(each.name)),
    h("td", null, h("select", { className: guessed, id: `is ${log.name} ${each.name}`, ariaLabel: `${each.name} is`, disabled, onchange: event => to(event.target.value, place) },
      ["", ...Object.keys(desk.units)].map(option(quantity, value => value || "–")))),
    h("td", null, quantity && quantity !== "time" ? h("select", { className: guessed, id: `of ${log.name} ${each.name}`, ariaLabel: `${each.name} is of`, disabled, onchange: event => to(quantity, event.target.value) },
      [...new Set([...desk.places, place])].map(option(place))) : null),
    h("td", null, quantity ? h("select", { className: guessed, id: `unit ${log.name} ${each.name}`, ariaLabel: `unit of ${each.name}`, disabled, onchange: event => order(each.key, event.target.value) },
      [...new Set(["", each.unit, ...(desk.units[quantity] ?? []).slice(1)])].map(option(each.unit, value => (value || each.usual || "–").replaceAll("*", "·").replace("deg", "°")))) : each.usual),
    h("td", null, each.key ? each.how === "own" ? "its own name" : each.why ? h("span", { className: each.why.includes("check that") ? "doubt" : "" }, `guess: ${each.why}`) : "as you said" : "",
      each.issues.map(issue => h("div", { className: issue.sure ? "problem" : "doubt" }, `${issue.problem}; ${issue.remedy}. `,
        issue.line && h("button", { disabled: busy, title: issue.line, onclick: () => page.order({ what: "remedy", log: log.name, line: issue.line }) }, "Write that line")))));
}

function picture(each) {
  if (!each.picture) return h("small", { className: "soft" }, "no numbers");
  const { line, least, most } = each.picture, svg = (tag, said) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(said)) element.setAttribute(name, value);
    return element;
  };
  const drawing = svg("svg", { viewBox: "0 -6 120 112", preserveAspectRatio: "none", role: "img", "aria-label": `from ${least} to ${most}` });
  const points = line.map((y, k) => y == null ? null : `${(120 * k / Math.max(line.length - 1, 1)).toFixed(1)},${y}`).filter(Boolean);
  drawing.append(svg("polyline", { points: points.join(" "), fill: "none", stroke: "currentColor", "stroke-width": 1.4, "vector-effect": "non-scaling-stroke" }));
  return h("span", { className: "picture", title: `from ${least} to ${most}` }, drawing, h("small", null, `${least} … ${most}`));
}

// --- the model file -------------------------------------------------------------------------------------------------

const area = h("textarea", { id: "text", spellcheck: false, ariaLabel: "the model file", rows: 28 });
let from = { based: null, text: "" };  // what the area shows was made of this

export function model(page) {
  const { desk, busy } = page.state;
  if (!desk) { from = { based: null, text: "" }; return []; }
  if (area.value === from.text && desk.based !== from.before) {  // nobody is editing it, and what was saved last is there
    if (area.value !== desk.text) area.value = desk.text;
    from = { based: desk.based, text: area.value };
  }
  const save = h("button", { id: "save", disabled: true, onclick: async () => {
    const text = area.value, taken = await send(page, [[new File([text], "model.toml"), "model.toml"]], from.based);
    if (taken) from = { based: taken.based, text, before: from.based };
  } }, "Save");
  const back = h("button", { id: "revert", disabled: true, onclick: () => { from = { based: desk.based, text: desk.text }; area.value = desk.text; area.oninput(); } }, "Discard changes");
  area.oninput = () => { save.disabled = back.disabled = area.value === from.text || busy; };
  area.oninput();
  const make = event => { if (event.target.value) page.order({ what: "model", source: event.target.value }); };
  return [h("div", { className: "row" }, h("h2", { style: "margin: 0" }, "The model file"), h("small", null, desk.about)),
    h("div", { className: "row" }, h("select", { id: "source", ariaLabel: "make the model of", disabled: busy, onchange: make },
      h("option", { value: "" }, "Make it anew of …"),
      h("option", { value: "columns" }, "the columns: one node a joint"),
      desk.urdfs.map(name => h("option", { value: name }, `${name}: links along the chains`)),
      Object.entries(desk.presets).map(([name, about]) => h("option", { value: name }, `${name}: ${about}`))), save, back),
    desk.wrong ? h("p", { className: "problem", id: "wrong" }, desk.wrong) : null,
    area,
    h("p", null, h("small", null, "This is model.toml in the study’s folder, as every command reads it. Drop a .toml or a .urdf to take another."))];
}
