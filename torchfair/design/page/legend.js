// What the colours mean, with numbers.

import { byId, make, number } from "./format.js";
import { lookOf } from "./looks.js";
import { CROSSING_COLOUR, STAR_COLOURS, css, scaleColour } from "./palettes.js";

export function showLegend({ store }) {
  const look = lookOf(store), box = byId("legend"), content = legendOf(look, store);
  box.hidden = !content;
  if (content) box.replaceChildren(...content);
}

function legendOf(look, store) {
  if (look.name === "edges") return scale("l|α| of edges", "length times angle", look.scale, 0, store.edgeLimit);
  if (look.name === "principal") return [key("--principal", "principal edges"), note("click an edge to change it")];
  if (!look.watch) return null;
  const measured = store.views[look.watch];
  if (!measured) return [note(store.topology ? "is being measured …" : "")];
  const { words, unit, least, most, names } = measured.legend;
  return names ? classes(words, names, measured.arrays) : scale(words, unit, look.scale, least, most);
}

function scale(words, unit, name, least, most) {
  const bar = make("div", { className: "scale" }, ...Array.from({ length: 32 }, (_, i) => swatch(scaleColour(name, i / 31))));
  const ends = [least, (least + most) / 2, most].map((value) => make("span", {}, number(value)));
  return [make("b", {}, words), unit ? note(unit) : "", bar, make("div", { className: "ends" }, ...ends)];
}

function classes(words, names, { values, crossings }) {
  const counts = names.map((_, i) => values.reduce((sum, value) => sum + (value === i), 0));
  const rows = names.map((name, i) => [STAR_COLOURS[name], name, counts[i]]);
  if (crossings) rows.push([CROSSING_COLOUR, "pyramid crosses itself", crossings.reduce((sum, c) => sum + (c > 0), 0)]);
  return [make("b", {}, words), ...rows.filter(([, , count]) => count > 0).map(([colour, name, count]) =>
    make("div", { className: "class" }, swatch(colour), make("span", {}, name), make("output", {}, String(count))))];
}

function swatch(colour) {
  const element = make("i");
  element.style.background = css(colour);
  return element;
}

function key(variable, words) {
  const element = make("i");
  element.style.background = `var(${variable})`;
  return make("div", { className: "class" }, element, make("span", {}, words));
}

const note = (words) => make("small", {}, words);
