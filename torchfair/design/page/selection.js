// Which vertices are chosen, and the box or loop that chooses more.

import { byId } from "./format.js";

export class Selection {
  constructor(app) {
    this.app = app;
    this.shape = byId("region").firstElementChild;
  }

  set(vertices) { this.app.store.put({ selection: new Set(vertices) }); }
  clear() { this.set([]); }

  toggle(vertex, more) {
    const { selection } = this.app.store;
    if (!more) return this.set(selection.has(vertex) && selection.size === 1 ? [] : [vertex]);
    const next = new Set(selection);
    if (!next.delete(vertex)) next.add(vertex);
    this.set(next);
  }

  boundary() {
    const flags = this.app.store.boundary ?? [];
    this.set([...flags.keys()].filter((v) => flags[v]));
  }

  begin(x, y) { this.points = [[x, y]]; }

  extend(x, y) {
    if (this.app.store.tool === "loop") this.points.push([x, y]);
    else {
      const [[left, top]] = this.points;
      this.points = [[left, top], [x, top], [x, y], [left, y]];
    }
    this.draw(this.points);
  }

  // keep: adds to what is chosen
  end(keep) {
    const { picker, store } = this.app, region = this.points;
    this.points = null;
    this.draw([]);
    if (region.length < 3) return keep ? null : this.clear();
    const found = picker.inside((x, y) => within(region, x, y), store.through);
    this.set(keep ? [...store.selection, ...found] : found);
  }

  draw(points) { this.shape.setAttribute("points", points.map((p) => p.join(",")).join(" ")); }
}

// Whether a place lies in a polygon: a ray to the right crosses its sides an odd number of times.
export function within(polygon, x, y) {
  let odd = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [ax, ay] = polygon[i], [bx, by] = polygon[j];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) odd = !odd;
  }
  return odd;
}
