// What the engine says, and what that changes in the page.

import { byId } from "./format.js";
import { applyEdgeBytes, applyLabels } from "./looks.js";
import { Mesh } from "./mesh.js";
import { extendPlot } from "./numbers.js";
import { showStrips } from "./strips.js";

export class Receiver {
  constructor(app) {
    this.app = app;
    this.coming = null; // a topology whose first frame has not come yet
  }

  receive(message) {
    this[`on_${message.type}`]?.(message);
  }

  on_welcome(message) {
    const { store, files, watch } = this.app;
    store.put({ welcome: message });
    files.showFormats(message.save);
    watch(true);
  }

  on_state(message) {
    this.app.store.put({ state: message });
  }

  on_settings(message) { this.app.store.put({ settings: message }); }

  on_topology(message) { this.coming = message; }

  on_frame(frame) {
    const { app, coming } = this, { scene, store } = app;
    if (coming && frame.topology === coming.topology) this.begin(coming, frame);
    else if (!store.topology || frame.topology !== store.topology.topology) return this.acknowledge(frame);
    else {
      scene.mesh.positions.set(frame.positions);
      scene.updateMesh();
    }
    applyEdgeBytes(app, frame);
    store.put({ frame: { number: frame.frame, rest: frame.rest, count: frame.count } });
    return this.acknowledge(frame);
  }

  acknowledge({ frame }) {
    this.app.scene.afterDraw.push(() => this.app.send("ack", { frame }));
    this.app.scene.invalidate();
  }

  // A mesh with its first frame.
  begin(topology, { positions }) {
    const { scene, store, selection, flights } = this.app, { arrays } = topology, old = store.topology;
    this.coming = null;
    const same = old && old.vertices === topology.vertices && old.faces === topology.faces && old.title === topology.title;
    if (this.app.handles.pull) this.app.handles.finish();
    const mesh = new Mesh({
      starts: arrays.offsets, corners: arrays.corners, edges: arrays.edges, edgeFaces: arrays.edge_faces,
      positions: positions.slice() });
    scene.setMesh(mesh, arrays.start ?? positions.slice());
    applyLabels(this.app, arrays.labels);
    const names = topology.has_names ? arrays.vertex_names : null;
    store.put({ topology, boundary: arrays.boundary, labels: arrays.labels, names, views: {}, hover: null, hoverFace: null });
    if (!same) selection.clear();
    if (!old || old.title !== topology.title) flights.arrive(flights.whole());
  }

  on_handles({ handles, held }) {
    const { store } = this.app;
    if (this.app.handles.pull) return;
    const { origin } = store.topology ?? this.coming ?? { origin: [0, 0, 0] };
    const places = handles.map(({ vertex, target }) => [vertex, target.map((t, i) => t - origin[i])]);
    store.put({ handles: new Map(places), held: new Set(held) });
  }

  on_numbers(message) {
    const { store } = this.app;
    store.put({ numbers: message });
    extendPlot(store);
  }

  on_view(message) {
    const { store } = this.app;
    if (message.topology === store.topology?.topology) store.put({ views: { ...store.views, [message.view]: message } });
  }

  on_camera({ camera }) {
    const { scene, store } = this.app;
    scene.view.fromJSON(camera, (store.topology ?? this.coming).origin);
    store.put({ orthographic: scene.view.orthographic });
    scene.invalidate();
  }

  on_files(message) { this.app.files.showList(message); }
  on_download(message) { this.app.files.received(message); }
  on_saved({ sentence }) { this.app.notices.show("info", sentence); }
  on_command_line(message) { this.app.files.showCommand(message); }
  on_strips(message) { showStrips(message); }
  on_notice({ kind, sentence }) { this.app.notices.show(kind, sentence); }
  on_error({ sentence }) { this.app.notices.show("error", sentence); }

  on_question({ question, sentence, choices }) {
    byId("opening").close();
    this.app.question({ sentence, choices }, (choice) => this.app.send("answer", { question, choice }));
  }
}
