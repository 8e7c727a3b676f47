// Pulling: vertices follow the pointer in the plane of the picture, along an axis or across one; the engine hears of
// it once per picture, the newest place only.

import { add, dot, rayLine, rayPlane, scale, subtract } from "./vectors.js";

const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

export class Handles {
  constructor(app) {
    this.app = app;
    this.count = 0;
    this.pull = null;
    app.scene.beforeDraw.push(() => this.send());
  }

  // Where a vertex is pulled to, else where it is.
  place(vertex) {
    const { store, scene } = this.app;
    return store.handles.get(vertex) ?? scene.mesh.point(vertex);
  }

  // Middle of the places of the selected vertices; null if there are none.
  middle() {
    const chosen = [...this.app.store.selection];
    return chosen.length ? scale(chosen.map((v) => this.place(v)).reduce(add), 1 / chosen.length) : null;
  }

  // Starts to pull vertices, held at a place of the picture; along or across an axis (0, 1, 2) if one is given.
  begin(vertices, grip, x, y, axis = null, across = false) {
    const starts = new Map(vertices.map((v) => [v, this.place(v)]));
    this.pull = { starts, grip, axis, across, shift: [0, 0, 0], offset: [0, 0, 0], sent: true,
      before: this.app.store.handles };
    const hit = this.hit(x, y);
    if (hit) this.pull.offset = subtract(grip, hit);
    this.pull.last = [x, y];
    this.app.store.put({ pulling: true });
  }

  // The place that the pointer means, within what the pull allows; null where the ray misses it.
  hit(x, y) {
    const { view } = this.app.scene, { grip, axis, across } = this.pull, ray = view.ray(x, y);
    if (axis === null) return rayPlane(ray, grip, view.forward);
    return across ? rayPlane(ray, grip, AXES[axis]) : rayLine(ray, grip, AXES[axis]);
  }

  move(x, y) {
    const hit = this.hit(x, y), { pull } = this;
    pull.last = [x, y];
    if (!hit) return;
    pull.shift = subtract(add(hit, pull.offset), pull.grip);
    if (pull.axis !== null && !pull.across) pull.shift = scale(AXES[pull.axis], dot(pull.shift, AXES[pull.axis]));
    pull.sent = false;
    this.showTargets();
  }

  // Locks the pull to an axis or the plane across it; again: lets it go.
  lock(axis, across) {
    const { pull } = this, same = pull.axis === axis && pull.across === across;
    Object.assign(pull, { axis: same ? null : axis, across: same ? false : across, offset: [0, 0, 0] });
    this.move(...pull.last);
  }

  showTargets() {
    const { store, scene } = this.app, handles = new Map(store.handles);
    for (const [v, start] of this.pull.starts) handles.set(v, add(start, this.pull.shift));
    store.put({ handles });
    scene.invalidate();
  }

  places() {
    const { origin } = this.app.store.topology;
    return [...this.pull.starts].map(([v, start]) => [v, ...add(add(start, this.pull.shift), origin)]);
  }

  send() {
    if (!this.pull || this.pull.sent) return;
    this.pull.sent = this.pull.begun = true;
    this.count = (this.count % 65535) + 1;
    this.app.send("move", { places: this.places(), count: this.count });
  }

  end() {
    if (!this.pull) return;
    this.send();
    if (this.pull.begun) this.app.send("release");
    this.finish();
  }

  // Puts everything back to where it was before the pull.
  cancel() {
    if (!this.pull) return;
    if (this.pull.begun) this.app.send("release", { back: true });
    this.app.store.put({ handles: this.pull.before });
    this.finish();
  }

  finish() {
    this.pull = null;
    this.app.store.put({ pulling: false });
    this.app.scene.invalidate();
  }

  // Typed coordinates, in the unit of the input: the middle of the selection goes there, as one edit.
  moveTo(place) {
    const { store, send } = this.app, { origin } = store.topology;
    const shift = subtract(subtract(place, origin), this.middle());
    const places = [...store.selection].map((v) => [v, ...add(add(this.place(v), shift), origin)]);
    send("move", { places, release: true });
  }
}
