// Ways of the eye: to the whole mesh, to an edge, to the selection, to a side; at once where motion is unwanted.

import { calm } from "./theme.js";
import { View } from "./view.js";
import { add, scale } from "./vectors.js";

const TIME = 320; // ms

export class Flights {
  constructor({ scene, store }) {
    Object.assign(this, { scene, store });
  }

  to(state) {
    const { view } = this.scene, from = view.state, to = { ...from, ...state }, start = performance.now();
    const turn = (this.turn = {});
    if (calm()) return this.arrive(to);
    const step = () => {
      if (this.turn !== turn) return; // another one has begun
      const t = Math.min(1, (performance.now() - start) / TIME);
      view.setState(View.between(from, to, t * t * (3 - 2 * t)));
      this.scene.invalidate();
      if (t < 1) this.scene.afterDraw.push(step);
    };
    step();
  }

  arrive(state) {
    this.scene.view.setState(state);
    this.scene.invalidate();
  }

  stop() { this.turn = null; }

  // The state in which everything is seen, from where the eye looks now.
  whole(turned = {}) {
    const { view, mesh } = this.scene, before = view.state;
    view.bounds = mesh.bounds();
    view.setState({ ...turned, target: view.bounds.centre });
    const fit = view.fit(mesh.positions);
    view.setState(before);
    return { ...turned, ...fit };
  }

  toAll() { if (this.scene.mesh) this.to(this.whole()); }

  toPlace(place, reach) {
    const { view } = this.scene;
    const distance = reach ? Math.min(view.distance, view.distanceFor(reach)) : view.distance;
    this.to({ target: place, distance });
  }

  toVertices(vertices) {
    const { mesh } = this.scene;
    if (!vertices.length) return;
    const middle = scale(vertices.map((v) => mesh.point(v)).reduce(add), 1 / vertices.length);
    this.toPlace(middle, 7 * mesh.meanEdge());
  }

  toSelection() { this.toVertices([...this.store.selection]); }

  from(around, up) {
    if (this.scene.mesh) this.to(this.whole({ around: (around * Math.PI) / 180, up: (up * Math.PI) / 180 }));
  }

  parallel() {
    const { view } = this.scene;
    view.orthographic = !view.orthographic;
    view.apply();
    this.store.put({ orthographic: view.orthographic });
    this.scene.invalidate();
  }
}
