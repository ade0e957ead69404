// What a view of plots shows, as a file: pixels, vector lines, or numbers.

import { color } from "/look.js";

const HEAD = 26, LEGEND = 20, LEFT = 62, FONT = "12px system-ui, sans-serif";  // px: of a title, of a legend's line, of axes
const legend = chart => chart.series.slice(1).filter(each => each.show && each.class !== "edge").map(({ label, _stroke, stroke }) => [label, _stroke ?? stroke()]);

// Where each chart of a view stands under the title and its own legend.
function layout(view) {
  let y = HEAD;
  const charts = view.charts.map(chart => { const at = y + LEGEND; y = at + chart.height; return { chart, at }; });
  return { charts, width: view.charts[0].width, height: y };
}

export async function png(view) {
  const { charts, width, height } = layout(view), ratio = devicePixelRatio, canvas = Object.assign(document.createElement("canvas"), { width: width * ratio, height: height * ratio }), pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.fillStyle = color("--paper");
  pen.fillRect(0, 0, width, height);
  pen.font = FONT;
  const write = (text, x, y, fill) => { pen.fillStyle = fill; pen.fillText(text, x, y); return x + pen.measureText(text).width; };
  write(view.title.textContent, LEFT, HEAD - 10, color("--ink"));
  for (const { chart, at } of charts) {
    let x = LEFT;
    for (const [label, stroke] of legend(chart)) x = write(`— ${label}`, x, at - 6, stroke) + 18;
    pen.drawImage(chart.ctx.canvas, 0, at, width, chart.height);
  }
  return new Promise(done => canvas.toBlob(done, "image/png"));
}

const plain = text => String(text).replace(/[<&>"]/g, sign => `&#${sign.charCodeAt(0)};`);

export function svg(view) {
  const { charts, width, height } = layout(view), parts = [];
  const text = (x, y, said, fill = color("--soft"), more = "") => parts.push(`<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" fill="${fill}" ${more}>${plain(said)}</text>`);
  text(LEFT, HEAD - 10, view.title.textContent, color("--ink"));
  for (const { chart, at } of charts) {
    const { left, top, width: wide, height: high } = Object.fromEntries(Object.entries(chart.bbox).map(([name, value]) => [name, value / devicePixelRatio])), clip = `plot${at}`;
    const x = value => left + chart.valToPos(value, "x"), y = value => at + top + chart.valToPos(value, "y");
    let next = LEFT;
    for (const [label, stroke] of legend(chart)) { text(next, at - 6, `— ${label}`, stroke); next += 8 * label.length + 36; }
    parts.push(`<clipPath id="${clip}"><rect x="${left}" y="${at + top}" width="${wide}" height="${high}"/></clipPath><rect x="${left}" y="${at + top}" width="${wide}" height="${high}" fill="none" stroke="${color("--line") || color("--rule")}"/>`);
    const [across, up] = chart.axes;
    up._splits?.forEach((value, k) => text(left - 6, y(value) + 4, up._values[k] ?? "", color("--soft"), 'text-anchor="end"'));
    text(12, at + top + high / 2, up.label, color("--soft"), `text-anchor="middle" transform="rotate(-90 12 ${at + top + high / 2})"`);
    if (across.show) {
      across._splits?.forEach((value, k) => text(x(value), at + top + high + 16, across._values[k] ?? "", color("--soft"), 'text-anchor="middle"'));
      text(left + wide / 2, at + top + high + 34, across.label, color("--soft"), 'text-anchor="middle"');
    }
    if (chart.limited && view.limit != null) parts.push(`<path d="M${left},${y(view.limit)}h${wide}" clip-path="url(#${clip})" stroke="${color("--limit")}"/>`);
    chart.series.slice(1).forEach((each, k) => {
      if (!each.show) return;
      const pieces = [[]];
      chart.data[k + 1].forEach((value, row) => value == null ? pieces.push([]) : pieces.at(-1).push(`${x(chart.data[0][row]).toFixed(2)},${y(value).toFixed(2)}`));
      const path = pieces.filter(piece => piece.length).map(piece => `M${piece.join("L")}`).join("");
      parts.push(`<path d="${path}" clip-path="url(#${clip})" fill="none" stroke="${each._stroke ?? each.stroke()}" stroke-width="${each.width}" ${each.dash ? `stroke-dasharray="${each.dash}"` : ""}/>`);
    });
  }
  const whole = `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" height="${height}" font-family="system-ui, sans-serif" font-size="12"><rect width="100%" height="100%" fill="${color("--paper")}"/>${parts.join("")}</svg>`;
  return new Blob([whole], { type: "image/svg+xml" });
}

// All lines of a view, a row a time; a comma within a name keeps its place by quotes.
export function csv(lines, { origin, clock }) {
  const names = Object.keys(lines).filter(name => name !== "time"), cell = text => /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  const rows = Array.from(lines.time, (time, k) => [Number((time - origin).toFixed(3)), ...clock ? [new Date(1000 * time).toISOString()] : [], ...names.map(name => lines[name][k] ?? "")].join(","));
  return new Blob([[["time since start [s]", ...clock ? ["UTC"] : [], ...names].map(cell).join(","), ...rows, ""].join("\n")], { type: "text/csv" });
}

export function save(blob, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
