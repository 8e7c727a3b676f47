// The menu of a vertex (right click, long press), and clicks on edges that mark them as principal.

import { ACTIONS, possible } from "./actions.js";
import { byId, make } from "./format.js";

export class Menu {
  constructor(app) {
    this.app = app;
    this.box = byId("menu");
    this.box.addEventListener("keydown", (event) => { if (event.key === "Escape") this.close(); });
  }

  open(x, y, vertex) {
    const { app, box } = this;
    if (!app.store.selection.has(vertex)) app.selection.set([vertex]);
    const count = app.store.selection.size;
    const title = make("b", {}, count === 1 ? `Vertex ${vertex}` : `${count} vertices`);
    box.replaceChildren(title, ...["hold", "free", "closer", "boundary", "deselect"].map((name) => this.entry(name)));
    box.hidden = false;
    const stage = app.scene.canvas.getBoundingClientRect();
    box.style.left = `${Math.min(x, stage.width - box.offsetWidth - 8)}px`;
    box.style.top = `${Math.min(y, stage.height - box.offsetHeight - 8)}px`;
  }

  entry(name) {
    const action = ACTIONS[name], disabled = !possible(action, this.app);
    const button = make("button", { type: "button", role: "menuitem", disabled }, make("span", {}, action.words), make("kbd", {}, action.key));
    button.addEventListener("click", () => { this.close(); action.run(this.app); });
    return button;
  }

  close() { this.box.hidden = true; }
}

export class EdgeTool {
  constructor(app) { this.app = app; }

  // Whether a click hit an edge: its label is turned around.
  click(x, y, face) {
    const { store, can, send } = this.app, edge = face === null ? null : this.nearest(x, y, face);
    if (edge === null || !can("label")) return false;
    send("label", { edges: [edge], principal: !(store.labels[edge] & 1) });
    return true;
  }

  // The edge of a face within six pixels of a place in the picture, away from its ends; null for none.
  nearest(x, y, face) {
    const { mesh, view } = this.app.scene, corners = mesh.faceCorners(face);
    let best = null, least = 6;
    for (const e of new Set([...corners].flatMap((v) => [...mesh.starEdges(v)]))) {
      const [a, b] = [0, 1].map((end) => view.project(mesh.point(mesh.edges[2 * e + end])));
      const dx = b[0] - a[0], dy = b[1] - a[1], t = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy || 1);
      const d = Math.hypot(a[0] + t * dx - x, a[1] + t * dy - y);
      const inner = mesh.edgeFaces[2 * e] >= 0 && mesh.edgeFaces[2 * e + 1] >= 0;
      if (inner && t > 0.15 && t < 0.85 && d < least) { least = d; best = e; }
    }
    return best;
  }
}
