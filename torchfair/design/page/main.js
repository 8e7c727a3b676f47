// Puts the page together: what comes from the engine goes into the store and the scene, what people do goes to it.

import { Corner } from "./corner.js";
import { Files } from "./files.js";
import { Flights } from "./flights.js";
import { byId, make, many } from "./format.js";
import { Gizmo } from "./gizmo.js";
import { Handles } from "./handles.js";
import { Keys } from "./keys.js";
import { showLegend } from "./legend.js";
import { applyLook, lookOf } from "./looks.js";
import { applyMarks } from "./marks.js";
import { EdgeTool, Menu } from "./menu.js";
import { Notices, stateBanner } from "./notices.js";
import { buildNumbers, showNumbers, showWorst } from "./numbers.js";
import { Panel } from "./panel.js";
import { Picker } from "./pick.js";
import { Pointer } from "./pointer.js";
import { Receiver } from "./receive.js";
import { Scene } from "./scene.js";
import { Selection } from "./selection.js";
import { Connection } from "./socket.js";
import { Store } from "./store.js";
import { applyScheme, keepScheme, wantedScheme } from "./theme.js";

const STARTING = {
  state: { state: "", allowed: [], modes: [] }, connection: { kind: "lost", sentence: "Connecting …" }, welcome: {},
  settings: { weights: [], choices: [] }, topology: null, names: null, labels: [], boundary: null, frame: null, views: {},
  handles: new Map(), held: new Set(), selection: new Set(), hover: null, hoverAt: null, hoverFace: null, numbers: {},
  plot: [], edgeLimit: 0, look: "mirror", lines: true, sphere: true, through: false, before: false, tool: "pull",
  pulling: false, orthographic: false, panel: innerWidth > 720, scheme: wantedScheme(),
};

class App {
  constructor(scene) {
    this.store = new Store(STARTING);
    this.scene = scene;
    this.notices = new Notices();
    this.send = (type, fields) => this.connection?.send(type, fields);
    this.can = (command) => (this.store.state.allowed ?? []).includes(command);
    this.watch = this.watch.bind(this);
    for (const [name, Part] of Object.entries({
      picker: Picker, flights: Flights, selection: Selection, handles: Handles, gizmo: Gizmo, menu: Menu,
      edgeTool: EdgeTool, files: Files, panel: Panel, corner: Corner, pointer: Pointer, keys: Keys, receiver: Receiver,
    })) this[name] = new Part(name === "picker" ? scene : this);
    buildNumbers();
    this.listen();
  }

  connect() {
    const status = (kind, sentence) => {
      this.store.put({ connection: { kind, sentence } });
      if (kind === "refused") this.notices.failure("Not connected", sentence);
    };
    this.connection = new Connection((message) => this.receiver.receive(message), status);
  }

  listen() {
    const { store, scene } = this;
    store.on("look lines sphere topology views", () => applyLook(this));
    store.on("look edgeLimit views topology scheme", () => showLegend(this));
    store.on("look", () => this.watch());
    store.on("scheme", () => { keepScheme(store.scheme); applyScheme(this); applyLook(this); });
    store.on("handles held selection hover hoverFace frame topology look views before pulling scheme", () => applyMarks(this));
    store.on("before", () => scene.showBefore(store.before));
    store.on("numbers state", () => { showNumbers(this); showWorst(this); });
    store.on("state connection selection handles held orthographic panel tool", () => this.keys.refresh());
    store.on("state connection topology", () => this.showState());
    store.on("hover hoverAt pulling", () => this.showTag());
    store.on("tool", () => this.showTool());
    store.on("before lines sphere panel", () => this.showToggles());
    addEventListener("resize", () => this.resize());
    scene.beforeDraw.push(() => this.cameraMoved());
    this.resizer = new ResizeObserver(() => this.resize());
    this.resizer.observe(scene.canvas);
  }

  resize() {
    const { gauss } = this.scene, box = byId("gauss").getBoundingClientRect(), stage = this.scene.canvas.getBoundingClientRect();
    gauss.size = box.width;
    gauss.corner = [box.left - stage.left, stage.bottom - box.bottom];
    this.scene.resize();
  }

  // Asks the engine to measure what the look shows.
  watch(again = false) {
    const wanted = lookOf(this.store).watch ?? "";
    if (!again && wanted === this.watched) return;
    this.watched = wanted;
    this.send("watch", { views: wanted ? [wanted] : [] });
  }

  // Weights of sliders: the newest once per picture.
  weigh(weights, release) {
    const waiting = this.weights;
    this.weights = { weights: { ...waiting?.weights, ...weights }, release: release || Boolean(waiting?.release) };
    if (waiting) return;
    requestAnimationFrame(() => { this.send("weigh", this.weights); this.weights = null; });
  }

  question({ sentence, choices }, answer) {
    const dialog = byId("asking"), box = dialog.querySelector(".buttons");
    dialog.querySelector("p").textContent = sentence;
    box.replaceChildren(...choices.map(({ value, words }) => make("button", { value, type: "submit" }, words)));
    dialog.returnValue = choices.at(-1).value;
    dialog.onclose = () => answer(dialog.returnValue);
    dialog.showModal();
  }

  cameraMoved() {
    const { view } = this.scene;
    if (this.cameraSeen === view.moved || this.cameraTimer || !this.store.topology) return;
    this.cameraTimer = setTimeout(() => { this.cameraTimer = null; this.sendCamera(); }, 1000);
  }

  sendCamera() {
    const { scene, store } = this;
    if (!store.topology || this.cameraSeen === scene.view.moved) return;
    this.cameraSeen = scene.view.moved;
    this.send("camera", { camera: scene.view.toJSON(store.topology.origin) });
  }

  showState() {
    const { store } = this, { state, topology, connection } = store;
    byId("title").textContent = topology?.title || state.title || "torchfair";
    document.title = `${topology?.title || "torchfair"} – design`;
    byId("state").textContent = connection.kind === "open" ? state.state.toLowerCase() : "not connected";
    byId("state").dataset.state = connection.kind === "open" ? state.state : "LOST";
    byId("size").textContent = topology ? `${many(topology.vertices, "vertex", "vertices")} · ${many(topology.faces, "face")}` : "";
    this.notices.banner(stateBanner(store));
    if (state.state === "EMPTY" && connection.kind === "open" && !byId("opening").open && !this.offered) {
      this.offered = true;
      this.files.dialog();
    }
  }

  showTag() {
    const { hover, hoverAt, pulling, names } = this.store, tag = byId("tag");
    tag.hidden = hover === null || !hoverAt || Boolean(pulling);
    if (tag.hidden) return;
    const name = names && names[hover] !== hover && names[hover] >= 0 ? ` (${names[hover]} in the file)` : "";
    tag.textContent = `vertex ${hover}${name}`;
    tag.style.transform = `translate(${Math.round(hoverAt[0] + 14)}px, ${Math.round(hoverAt[1] + 10)}px)`;
  }

  showTool() {
    for (const tool of ["pull", "box", "loop"]) {
      document.querySelector(`[data-action=${tool}]`).setAttribute("aria-pressed", String(this.store.tool === tool));
    }
    this.scene.canvas.dataset.tool = this.store.tool;
    this.scene.invalidate();
  }

  showToggles() {
    const { store } = this;
    document.querySelector("[data-action=before]").setAttribute("aria-pressed", String(store.before));
    document.body.classList.toggle("before", store.before);
    document.body.classList.toggle("wide", !store.panel);
    document.body.classList.toggle("flat", !store.sphere);
  }
}

function start() {
  const notices = new Notices(), canvas = byId("canvas");
  if (!document.createElement("canvas").getContext("webgl2")) {
    return notices.failure("No WebGL 2", "This browser cannot draw the mesh: WebGL 2 is missing or switched off. Allow hardware acceleration in its settings, update it, or use a current Firefox, Chrome or Safari.");
  }
  let scene;
  try {
    scene = new Scene(canvas);
  } catch (error) {
    return notices.failure("The picture cannot be drawn", `The graphics driver refused: ${error.message}. Reload the page, or use another browser.`);
  }
  const app = new App(scene);
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    app.notices.banner("The graphics card gave the picture up. It is drawn again as soon as the browser gets it back …");
  });
  canvas.addEventListener("webglcontextrestored", () => { app.picker.drawn = ""; app.showState(); scene.invalidate(); });
  applyScheme(app);
  app.store.put({ look: app.store.look, tool: "pull", panel: app.store.panel });
  app.resize();
  app.connect();
  window.design = app; // for the console and the tests
  return app;
}

start();
