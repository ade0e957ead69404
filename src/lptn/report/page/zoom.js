// What all charts over time have in common: round times, the window that a drag or a key chooses, the range of values.

export const GRID = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 28800, 86400];  // s between ticks
export const FONT = "12px system-ui, sans-serif";

// Lines of an axis, and how its words are written.
export const axisLook = (ink, shade, rule) => ({ stroke: ink, grid: { stroke: shade, width: 1 }, ticks: { stroke: rule, width: 1, size: 4 }, font: FONT, labelFont: FONT });

// The window that was dragged, which stays marked no longer; none where the mouse hardly moved.
export function dragged(chart) {
  const { left, width } = chart.select;
  if (width < 4) return null;
  const window = [chart.posToVal(left, "x"), chart.posToVal(left + width, "x")];
  chart.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  return window;
}

// The window that a key leads to, `null` for all of it; `undefined` for a key that has no meaning here.
export function keyed(event, [low, high], [start, stop]) {
  const width = high - low, moved = { "+": [0.25, -0.25], "=": [0.25, -0.25], "-": [-0.5, 0.5], ArrowLeft: [-0.25, -0.25], ArrowRight: [0.25, 0.25] }[event.key];
  if (event.ctrlKey || event.metaKey || event.altKey || !moved && !["0", "Escape"].includes(event.key)) return undefined;
  event.preventDefault();
  if (!moved) return null;
  const shift = moved[0] === moved[1] ? Math.min(Math.max(moved[0] * width, start - low), stop - high) : null;
  const window = shift == null ? [Math.max(low + moved[0] * width, start), Math.min(high + moved[1] * width, stop)] : [low + shift, high + shift];
  return window[0] <= start && window[1] >= stop ? null : window;
}

// The range of values that is drawn: with a margin, and with what has to be in it, such as zero and the band around it.
export function limits(low, high, ...within) {
  if (low == null) return [0, 1];
  const values = [low, high, ...within.filter(value => value != null)], least = Math.min(...values), most = Math.max(...values), margin = 0.06 * (most - least) || 0.5;
  return [least - margin, most + margin];
}
