// Light, dark, or as the system has it: the style sheets' own rules for a dark system are switched, and none stands twice.

const QUERY = "(prefers-color-scheme: dark)", LOOKS = { system: `screen and ${QUERY}`, light: "not all", dark: "screen" };
const YEAR = 31_536_000;  // s
const rules = [], colors = new Map(), told = [];
let look = document.cookie.match(/lptn-look=(light|dark)/)?.[1] ?? "system";  // a cookie is of all ports of this machine, on which a workbench may be

export const color = name => colors.get(name) ?? colors.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim()).get(name);
export const onLook = callback => told.push(callback);

export function follow(sheet) {
  rules.push(...[...sheet.cssRules].filter(rule => rule.media?.mediaText.includes("prefers-color-scheme")));
  show();
}

function show() {
  for (const rule of rules) rule.media.mediaText = LOOKS[look];
  document.documentElement.style.colorScheme = look === "system" ? "light dark" : look;
  colors.clear();
  const button = document.getElementById("look");
  button.title = button.ariaLabel = `Colours: ${look === "system" ? "as the system has them" : look}`;
  for (const callback of told) callback();
}

document.getElementById("look").addEventListener("click", () => {
  const names = Object.keys(LOOKS);
  look = names[(names.indexOf(look) + 1) % names.length];
  document.cookie = `lptn-look=${look}; path=/; max-age=${YEAR}; samesite=strict`;
  show();
});
matchMedia(QUERY).addEventListener("change", show);
for (const sheet of document.styleSheets) follow(sheet);
