// The model file as forms: each entry of nodes, links and effects a row of fields, equal to what stands in the text.

import { drawn } from "/network.js";
import { h } from "/sections.js";

const UNITS = { capacity: "J/K", resistance: "K/W" };  // of nodes and links; the catalogue says those of effects
const NEW = { capacity: { value: 200, unit: "J/K", bounds: [10, 4000] }, resistance: { value: 5, unit: "K/W", bounds: [0.2, 200] } };
const WORD = 22;  // letters of a field

const unit = said => said && said !== "1" ? h("small", null, said.replaceAll("*", "·")) : null;

// A field for each value: numbers, words, lists of both; what a table has besides its value stands behind it.
function fields(page, keys, value, units) {
  const { busy } = page.state, id = `entry ${keys.join(" ")}`, name = keys.at(-1), order = changed => page.order({ what: "entry", keys, value: changed });
  if (value !== null && typeof value === "object" && !Array.isArray(value)) return h("span", { className: "row field" }, "value" in value ? null : h("small", null, name),
    Object.entries(value).map(([key, inner]) => key === "unit" ? unit(inner) : fields(page, [...keys, key], inner, units)),
    "value" in value && !("unit" in value) ? unit(units[name]) : null);
  const label = name === "value" ? keys.at(-2) : name, listed = Array.isArray(value), number = typeof value === "number";
  const taken = event => {
    const said = event.target.value.trim(), parts = said.split(",").map(each => each.trim());
    if (typeof value === "boolean") return order(event.target.checked);
    if (number) return Number.isFinite(event.target.valueAsNumber) && order(event.target.valueAsNumber);
    order(listed ? parts.map(each => typeof value[0] === "number" ? Number(each) : each) : said);
  };
  const field = h("input", { id, disabled: busy, onchange: taken, ...typeof value === "boolean" ? { type: "checkbox", checked: value }
    : number ? { type: "number", step: "any", value } : { value: listed ? value.join(", ") : value, size: Math.min(WORD, String(value).length + 2) } });
  return h("label", { className: "field" }, h("small", null, label), " ", field, number ? unit(units[name]) : null);
}

function rows(page, table) {
  const { desk, busy } = page.state, entries = Object.entries(desk.tables[table] ?? {}).filter(([, entry]) => entry !== null && typeof entry === "object");  // all else is a mistake that is being made
  return entries.map(([key, entry]) => {
    const known = desk.effects[entry.kind], units = table === "effects" ? known?.units ?? {} : UNITS;
    const keys = [table, table === "nodes" ? key : Number(key)], title = table === "nodes" ? key : table === "links" ? entry.between && [entry.between].flat().join(" – ") : known?.title ?? entry.kind;
    return h("li", { className: "row entry" }, h("b", { className: "names" }, String(title ?? key)),
      Object.entries(entry).filter(([name]) => !(table === "effects" && name === "kind")).map(([name, value]) => fields(page, [...keys, name], value, units)),
      h("button", { id: `without ${keys.join(" ")}`, ariaLabel: `Remove ${title ?? key}`, disabled: busy, onclick: () => page.order({ what: "entry", keys, value: null }) }, "✕"));
  });
}

export function forms(page) {
  const { desk, busy } = page.state;
  if (!desk?.text) return [];
  const word = (id, label) => h("input", { id, ariaLabel: label, placeholder: label, size: 12, list: "of the model" }), said = id => document.getElementById(id).value.trim();
  const another = (table, label, parts, made) => h("form", { className: "row", onsubmit: event => { event.preventDefault(); const [key, value] = made(); if (key !== "") page.order({ what: "entry", keys: [table, key], value }); } },
    parts, h("button", { disabled: busy }, label));
  const count = table => desk.tables[table]?.length ?? 0;
  const kind = h("select", { id: "new effect", ariaLabel: "effect" }, Object.entries(desk.effects).map(([key, { title }]) => h("option", { value: key }, title)));
  return [h("details", { id: "forms", open: true }, h("summary", null, "Nodes, links and effects, as forms"),
    h("div", { className: "two wider" },
      h("div", { className: "scroll" }, h("datalist", { id: "of the model" }, desk.places.map(value => h("option", { value }))),
        h("h3", null, "Nodes"), h("ul", { className: "plain" }, rows(page, "nodes")),
        another("nodes", "Add the node", [word("new node", "name")], () => [said("new node"), { capacity: NEW.capacity }]),
        h("h3", null, "Links"), h("ul", { className: "plain" }, rows(page, "links")),
        another("links", "Add the link", [word("new from", "from"), word("new to", "to")], () => [count("links"), { between: [said("new from"), said("new to")], resistance: NEW.resistance }]),
        h("h3", null, "Effects"), h("ul", { className: "plain" }, rows(page, "effects")),
        another("effects", "Add the effect", [kind, word("new at", "at")], () => [count("effects"), { kind: kind.value, at: said("new at") || "*" }])),
      h("div", { className: "drawing" }, desk.drawing ? drawn(desk.drawing) : h("p", { className: "soft" }, "The network is drawn once the model can be read."))))];
}
