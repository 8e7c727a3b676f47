// Unrolled strips, drawn in a dialog.

import { byId } from "./format.js";

export function showStrips({ sentence, strips, arrays }) {
  const dialog = byId("unrolled"), svg = dialog.querySelector("svg"), { outlines } = arrays;
  dialog.querySelector("p").textContent = sentence;
  const space = "http://www.w3.org/2000/svg", low = [Infinity, Infinity], high = [-Infinity, -Infinity];
  outlines.forEach((value, i) => { low[i % 2] = Math.min(low[i % 2], value); high[i % 2] = Math.max(high[i % 2], value); });
  svg.setAttribute("viewBox", [low[0], -high[1], high[0] - low[0], high[1] - low[1]].join(" "));
  svg.replaceChildren(...strips.map(({ outline: [first, count] }) => {
    const polygon = document.createElementNS(space, "polygon"), points = [];
    for (let i = first; i < first + count; i++) points.push(`${outlines[2 * i]},${-outlines[2 * i + 1]}`);
    polygon.setAttribute("points", points.join(" "));
    polygon.setAttribute("vector-effect", "non-scaling-stroke");
    return polygon;
  }));
  if (!dialog.open) dialog.showModal();
}
