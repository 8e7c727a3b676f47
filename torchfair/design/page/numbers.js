// The numbers beside the picture, the plot of E and the worst edges.

import { byId, make, number } from "./format.js";
import { drawPlot } from "./plot.js";

const ROWS = [
  ["E", "E", "normal variation, Σ l l*"],
  ["C", "C", "total absolute curvature"],
  ["E_over_C", "E / C", "how far the mesh is from as smooth as its surface"],
  ["planarity", "worst panel", "distance of the diagonals of a panel over its mean edge"],
  ["deviation", "deviation", "largest distance from the surface at the start"],
  ["deviation_back", "and back", "largest distance from that surface to the mesh"],
  ["smallest_angle", "smallest angle", "in degrees"],
  ["handle_distance", "handles off by", "largest distance of a handle from where it is pulled"],
];

export function buildNumbers() {
  byId("numbers").append(...ROWS.map(([name, words, title]) =>
    make("div", { title, data: { number: name } }, make("dt", {}, words), make("dd", {}, "–"))));
}

export function showNumbers({ store }) {
  const { numbers } = store;
  for (const [name] of ROWS) {
    const row = byId("numbers").querySelector(`[data-number="${name}"]`), value = numbers[name];
    row.lastElementChild.textContent = number(value) + (name === "smallest_angle" && value != null ? "°" : "");
    row.dataset.missing = value == null;
  }
  byId("words").textContent = store.state.busy || numbers.status || "";
  byId("promises").replaceChildren(...(numbers.promises ?? []).filter(({ holds }) => !holds).map(({ words }) =>
    make("span", { className: "broken" }, words)));
}

const PAUSE = 0.6; // seconds that a rest takes in the plot, however long it was

// The plot: one more point, or a new one where the mesh is new. Its clock stands still while nothing moves.
export function extendPlot(store) {
  const { E, time, reset } = store.numbers;
  if (reset) store.plot = [];
  if (!Number.isFinite(E) || !Number.isFinite(time)) return;
  const step = Math.max(0, Math.min(PAUSE, time - (store.plotTime ?? time)));
  store.plot.push([(store.plot.at(-1)?.[0] ?? 0) + step, E]);
  store.plotTime = time;
  if (store.plot.length > 4000) store.plot = store.plot.filter((_, i) => i % 2 === 0);
  drawPlot(byId("plot"), store.plot);
}

export function showWorst({ store, flights, scene, selection }) {
  const worst = store.numbers.worst ?? [];
  byId("worst").replaceChildren(...worst.map(({ vertices, value, angle }) => {
    const button = make("button", { type: "button", title: "Fly there" },
      make("span", {}, vertices.join(" – ")), make("span", {}, `${number(angle)}°`), make("output", {}, number(value)));
    button.addEventListener("click", () => {
      selection.set(vertices.filter((v) => v < scene.mesh.numVertices));
      flights.toVertices(vertices);
    });
    return make("li", {}, button);
  }));
}
