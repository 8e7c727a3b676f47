// Everything a button or a key does. `needs` names the command that the engine has to allow; `key` is what is pressed,
// `icon` the path drawn on the button. The list of keys in the page is made from this.

import { LOOKS } from "./looks.js";

const needsSelection = ({ store }) => store.selection.size > 0;
const chosen = ({ store }) => [...store.selection];
const turn = (dx, dy) => ({ scene }) => { scene.view.orbit(dx, dy); scene.invalidate(); };
const zoom = (factor) => ({ scene }) => { scene.view.zoom(factor); scene.invalidate(); };
const toggle = (name) => ({ store }) => store.put({ [name]: !store[name] });
const look = ({ name, words }, i) => [`look-${name}`, {
  group: "Look", words, key: String(i + 1), run: ({ store }) => store.put({ look: name }) }];

export const ACTIONS = {
  undo: { group: "Edit", words: "Undo", key: "Ctrl+Z", needs: "undo", enabled: ({ store }) => store.state.undo > 0, icon: "M9 5 4 10l5 5M4 10h10a6 6 0 0 1 0 12h-3", run: ({ send }) => send("undo") },
  redo: { group: "Edit", words: "Redo", key: "Ctrl+Shift+Z", also: "Ctrl+Y", needs: "redo", enabled: ({ store }) => store.state.redo > 0, icon: "m15 5 5 5-5 5m5-5H10a6 6 0 0 0 0 12h3", run: ({ send }) => send("redo") },
  open: { group: "Files", words: "Open", key: "Ctrl+O", needs: "list", icon: "M3 19V5h6l2 3h10v11zM3 11h18", run: ({ files }) => files.dialog() },
  save: { group: "Files", words: "Save the session", key: "Ctrl+S", needs: "save", icon: "M12 4v11m-5-5 5 5 5-5M4 20h16", run: ({ files }) => files.saveSession() },
  screenshot: { group: "Files", words: "Picture at twice the size", key: "Shift+S", icon: "M4 8h4l2-3h4l2 3h4v11H4zm8 2a3.5 3.5 0 1 0 0 7 3.5 3.5 0 0 0 0-7", run: ({ files }) => files.screenshot() },
  commandLine: { group: "Files", words: "Copy the command line", label: "Copy the command line that repeats this", needs: "command_line", run: ({ files }) => files.commandLine() },

  pull: { group: "Tools", words: "Pull vertices", key: "V", icon: "m6 3 13 8-6 2-3 6z", run: ({ store }) => store.put({ tool: "pull" }) },
  box: { group: "Tools", words: "Select with a box", key: "B", icon: "M4 8V4h4m8 0h4v4m0 8v4h-4m-8 0H4v-4", run: ({ store }) => store.put({ tool: "box" }) },
  loop: { group: "Tools", words: "Select with a loop", key: "L", icon: "M12 5c5 0 9 2 9 6s-4 6-9 6-9-2-9-6 4-6 9-6m-4 11c-1 2 0 4-2 5", run: ({ store }) => store.put({ tool: "loop" }) },
  boundary: { group: "Tools", words: "Select the boundary", label: "Select boundary", key: "Shift+B", needs: "camera", run: ({ selection }) => selection.boundary() },
  deselect: { group: "Tools", words: "Select nothing", label: "Select none", key: "Esc", enabled: needsSelection, run: ({ selection }) => selection.clear() },

  hold: { group: "Handles", words: "Fix the selected vertices", key: "F", needs: "hold", enabled: needsSelection, icon: "M7 11V8a5 5 0 0 1 10 0v3M5 11h14v9H5z", run: (app) => app.send("hold", { vertices: chosen(app) }) },
  free: { group: "Handles", words: "Free the selected vertices", key: "G", needs: "free", enabled: needsSelection, icon: "M7 11V8a5 5 0 0 1 9-3M5 11h14v9H5z", run: (app) => app.send("free", { vertices: chosen(app) }) },
  freeAll: { group: "Handles", words: "Free all", needs: "free", enabled: ({ store }) => store.handles.size + store.held.size > 0, run: ({ store, send }) => send("free", { vertices: [...store.handles.keys(), ...store.held] }) },
  cancel: { group: "Handles", words: "While pulling: put back", key: "Esc", run: null },
  lock: { group: "Handles", words: "While pulling: along x, y or z", key: "X Y Z", run: null },
  plane: { group: "Handles", words: "While pulling: across x, y or z", key: "Shift+X Y Z", run: null },

  settle: { group: "Solve", words: "Settle", key: "Enter", needs: "settle", run: ({ send }) => send("settle") },
  pause: { group: "Solve", words: "Pause", key: "P", needs: "pause", pressed: ({ store }) => Boolean(store.state.paused), run: ({ send, store }) => send("pause", { on: !store.state.paused }) },
  solve: { group: "Solve", words: "Solve to the end", label: "Solve", key: "Shift+Enter", needs: "solve", run: ({ send }) => send("solve") },
  stop: { group: "Solve", words: "Stop", key: "Ctrl+.", needs: "stop", run: ({ send }) => send("stop") },
  subdivide: { group: "Mesh", words: "Subdivide", needs: "subdivide", run: ({ send }) => send("subdivide") },
  findPrincipal: { group: "Mesh", words: "Find principal edges", needs: "label", run: ({ send, store }) => { send("label", { edges: [], principal: true }); store.put({ look: "principal" }); } },
  strips: { group: "Mesh", words: "Unroll strips", needs: "strips", run: ({ send }) => send("strips") },
  saveStrips: { group: "Mesh", words: "Save as SVG", needs: "save", run: ({ files }) => files.save({ format: "strips", to: "download" }) },

  before: { group: "Look", words: "Show the mesh before, while held", key: "Space", hold: true, icon: "M12 3v18M10 6H4v12h6m4-12h6v12h-6", run: ({ store }, on) => store.put({ before: on }) },
  ...Object.fromEntries(LOOKS.map(look)),
  lines: { group: "Look", words: "Edges of the mesh", key: "E", run: toggle("lines") },
  sphere: { group: "Look", words: "Gauss image", key: "U", run: toggle("sphere") },
  scheme: { group: "Look", words: "Dark or light", key: "D", icon: "M12 3a9 9 0 1 0 0 18zm0 0a9 9 0 0 1 0 18", run: ({ store }) => store.put({ scheme: store.scheme === "dark" ? "light" : "dark" }) },
  panel: { group: "Look", words: "Show or hide the panel", key: "Tab", icon: "M4 5h16v14H4zm10 0v14", pressed: ({ store }) => store.panel, run: toggle("panel") },

  all: { group: "View", words: "See everything", key: "Home", also: "0", icon: "M4 9V4h5m6 0h5v5m0 6v5h-5m-6 0H4v-5m8-6a3 3 0 1 0 0 6 3 3 0 0 0 0-6", run: ({ flights }) => flights.toAll() },
  closer: { group: "View", words: "Fly to the selection", key: ".", run: ({ flights }) => flights.toSelection() },
  parallel: { group: "View", words: "Parallel or perspective", key: "O", icon: "m12 3 8 4.5v9L12 21l-8-4.5v-9zm0 9 8-4.5M12 12v9m0-9L4 7.5", pressed: ({ scene }) => scene.view.orthographic, run: ({ flights }) => flights.parallel() },
  top: { group: "View", words: "From above", key: "T", run: ({ flights }) => flights.from(-90, 89.9) },
  front: { group: "View", words: "From the front", key: "Shift+F", run: ({ flights }) => flights.from(-90, 0) },
  side: { group: "View", words: "From the side", key: "Shift+R", run: ({ flights }) => flights.from(0, 0) },
  left: { group: "View", words: "Turn left", key: "ArrowLeft", quiet: true, run: turn(40, 0) },
  right: { group: "View", words: "Turn right", key: "ArrowRight", quiet: true, run: turn(-40, 0) },
  up: { group: "View", words: "Turn up", key: "ArrowUp", quiet: true, run: turn(0, 40) },
  down: { group: "View", words: "Turn down", key: "ArrowDown", quiet: true, run: turn(0, -40) },
  zoomIn: { group: "View", words: "Closer", key: "+", also: "=", run: zoom(0.85) },
  zoomOut: { group: "View", words: "Farther", key: "-", run: zoom(1 / 0.85) },
  keys: { group: "View", words: "Keys and gestures", key: "?", icon: "M9 9a3 3 0 1 1 4 3c-1 .6-1 1-1 2m0 3v.5", run: ({ keys }) => keys.dialog() },
};

export const GESTURES = [
  ["Drag a vertex", "pull it in the plane of the picture"],
  ["Drag an arrow", "pull along an axis"],
  ["Click a vertex", "select it; with Shift one more"],
  ["Right click, long press", "menu of a vertex"],
  ["Click an edge", "principal or not, in the look Principal edges"],
  ["Drag elsewhere", "turn"],
  ["Right drag, Shift drag, two fingers", "move the picture"],
  ["Wheel, pinch", "closer, farther"],
  ["Double click, double tap", "turn around that place"],
];

// Whether an action can be done now.
export function possible(action, app) {
  const allowed = !action.needs || (app.store.state.allowed ?? []).includes(action.needs);
  return allowed && (action.enabled?.(app) ?? true);
}
