// Mouse, pen and fingers on the picture: what a press, a drag, a pinch or the wheel means there.

const STILL = 4;       // pixels that a press may move and still be a click
const LONG = 500;      // ms until a still finger opens the menu
const FINGER = 26;     // reach of a finger, in pixels

export class Pointer {
  constructor(app) {
    this.app = app;
    this.canvas = app.scene.canvas;
    this.down = new Map(); // pressed pointers: where they are
    this.act = null;       // what the drag does: { move, end, cancel }
    const on = (name, act, options) => this.canvas.addEventListener(name, (event) => act.call(this, event), options);
    on("pointerdown", this.press);
    on("pointermove", this.moved);
    on("pointerup", this.lift);
    on("pointercancel", this.cancelled);
    on("lostpointercapture", this.cancelled);
    on("pointerleave", () => this.hover(null));
    on("dblclick", this.doubled);
    on("contextmenu", (event) => event.preventDefault());
    on("wheel", this.wheel, { passive: false });
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  press(event) {
    const [x, y] = this.at(event), touch = event.pointerType === "touch";
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.app.flights.stop();
    this.app.menu.close();
    this.down.set(event.pointerId, [x, y]);
    if (this.down.size === 2) return this.pinch();
    if (this.down.size > 2) return;
    this.start = { x, y, event, moved: false };
    const found = this.app.picker.at(x, y, touch ? FINGER : undefined);
    this.start.found = found;
    this.act = this.chooseAct(event, x, y, found);
    if (touch && found.vertex !== null) this.long = setTimeout(() => this.longPress(x, y, found.vertex), LONG);
  }

  chooseAct(event, x, y, found) {
    const { app } = this, { tool } = app.store;
    if (event.button === 1 || event.button === 2) return this.panning();
    if (app.corner.contains(x, y)) return this.orbiting();
    if (tool !== "pull") return this.choosing(event);
    const axis = app.gizmo.at(x, y);
    if (axis !== null && app.can("move")) {
      return this.pulling([...app.store.selection], app.handles.middle(), axis, event.shiftKey);
    }
    if (found.vertex !== null && app.can("move") && !event.shiftKey) {
      const chosen = app.store.selection.has(found.vertex) ? [...app.store.selection] : [found.vertex];
      return this.pulling(chosen, app.handles.place(found.vertex), null, false);
    }
    return event.shiftKey ? this.panning() : this.orbiting();
  }

  orbiting() {
    const { view } = this.app.scene;
    return { move: (x, y, dx, dy) => view.orbit(dx, dy), end: () => {} };
  }

  panning() {
    const { view } = this.app.scene;
    return { move: (x, y, dx, dy) => view.pan(dx, dy), end: () => {} };
  }

  choosing(event) {
    const { selection } = this.app;
    selection.begin(this.start.x, this.start.y);
    const end = () => selection.end(event.shiftKey);
    return { move: (x, y) => selection.extend(x, y), end, cancel: () => selection.draw([]), click: false };
  }

  pulling(vertices, grip, axis, across) {
    const { handles, selection, store } = this.app, { x, y } = this.start;
    let begun = false;
    const begin = () => {
      begun = true;
      if (!vertices.every((v) => store.selection.has(v))) selection.set(vertices);
      handles.begin(vertices, grip, x, y, axis, across);
    };
    const move = (px, py) => {
      if (!begun) begin();
      if (handles.pull) handles.move(px, py); // Esc may have ended it
    };
    return { move, end: () => handles.end(), cancel: () => handles.cancel() };
  }

  pinch() {
    clearTimeout(this.long);
    this.act?.cancel?.();
    this.start.moved = true;
    const { view } = this.app.scene, middle = () => {
      const [a, b] = [...this.down.values()];
      return { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, apart: Math.hypot(a[0] - b[0], a[1] - b[1]) || 1 };
    };
    let last = middle();
    const move = () => {
      if (this.down.size < 2) return;
      const now = middle();
      view.pan(now.x - last.x, now.y - last.y);
      view.zoom(last.apart / now.apart, now.x, now.y);
      last = now;
    };
    this.act = { move, end: () => {} };
  }

  moved(event) {
    const [x, y] = this.at(event), last = this.down.get(event.pointerId);
    if (!last) return this.hover(x, y);
    this.down.set(event.pointerId, [x, y]);
    if (!this.start.moved && Math.hypot(x - this.start.x, y - this.start.y) < STILL) return;
    clearTimeout(this.long);
    this.start.moved = true;
    this.act?.move(x, y, x - last[0], y - last[1]);
    this.app.scene.invalidate();
  }

  lift(event) {
    clearTimeout(this.long);
    if (!this.down.has(event.pointerId)) return;
    this.moved(event); // the last move may not have been told
    this.down.delete(event.pointerId);
    const { act, start } = this;
    if (this.down.size > 0) return;
    this.act = null;
    if (start.moved) act?.end();
    else this.click(event, start.found, act);
    if (event.pointerType !== "touch") this.hover(...this.at(event));
  }

  cancelled(event) {
    if (!this.down.delete(event.pointerId)) return;
    clearTimeout(this.long);
    this.act?.cancel?.();
    this.act = null;
  }

  click(event, { face, vertex }, act) {
    const { selection, store, edgeTool, corner, menu } = this.app, [x, y] = this.at(event);
    if (corner.contains(x, y)) return corner.click(x, y);
    if (event.button === 2) return vertex === null ? null : menu.open(x, y, vertex);
    if (act?.click === false) return selection.clear();
    if (store.look === "principal" && edgeTool.click(x, y, face)) return null;
    if (vertex !== null) return selection.toggle(vertex, event.shiftKey);
    return face === null && !event.shiftKey ? selection.clear() : null;
  }

  longPress(x, y, vertex) {
    this.act?.cancel?.();
    this.act = null;
    this.start.moved = true;
    this.app.menu.open(x, y, vertex);
  }

  doubled(event) {
    const [x, y] = this.at(event), { face } = this.app.picker.at(x, y);
    if (face !== null) this.app.flights.toPlace(this.app.scene.mesh.faceCentre(face));
  }

  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 18 : event.deltaMode === 2 ? 400 : 1;
    this.app.flights.stop();
    this.app.scene.view.zoom(Math.exp(Math.max(-200, Math.min(200, event.deltaY * lines)) * 0.0016), ...this.at(event));
    this.app.scene.invalidate();
  }

  // Marks what is under a pointer that is not pressed: at most one look at a time, the newest place next.
  async hover(x, y) {
    const { store, picker, corner } = this.app;
    this.wanted = x === null ? null : [x, y];
    if (this.looking) return;
    this.looking = true;
    let shown;
    do {
      shown = this.wanted;
      const inCorner = shown && corner.contains(...shown);
      const found = shown && !inCorner && !store.before ? await picker.later(...shown) : { vertex: null };
      const axis = shown && !inCorner ? this.app.gizmo.at(...shown) : null;
      store.put({ hover: axis === null ? found.vertex : null, hoverAt: shown, hoverFace: inCorner ? corner.faceAt(...shown) : null });
      this.canvas.dataset.over = axis !== null ? "axis" : found.vertex !== null ? "vertex" : "";
    } while (this.wanted !== shown);
    this.looking = false;
  }
}
