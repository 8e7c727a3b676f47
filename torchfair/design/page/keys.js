// Keys and buttons: both do what actions.js lists; `?` shows the list.

import { ACTIONS, GESTURES, possible } from "./actions.js";
import { byId, make } from "./format.js";

const LETTERS = { x: 0, y: 1, z: 2 };

export class Keys {
  constructor(app) {
    this.app = app;
    this.map = new Map();
    for (const [name, action] of Object.entries(ACTIONS)) {
      for (const key of [action.key, action.also]) if (key && action.run) this.map.set(key, name);
    }
    addEventListener("keydown", (event) => this.pressed(event));
    addEventListener("keyup", (event) => { if (event.key === " ") this.run("before", false); });
    addEventListener("blur", () => this.app.store.put({ before: false }));
    this.fillButtons();
  }

  pressed(event) {
    const typing = event.target.closest("input:not([type=range]):not([type=checkbox]), select, textarea, dialog[open]");
    if (event.key === "Escape") return this.escape();
    if (typing) return;
    const { handles } = this.app, axis = LETTERS[event.key.toLowerCase()];
    if (handles.pull && axis !== undefined) return handles.lock(axis, event.shiftKey);
    const name = this.map.get(keyOf(event));
    const onControl = event.target.closest("button, summary, input, a") && ["Enter", " ", "Tab"].includes(event.key);
    const walks = event.target.matches("input[type=range]") && event.key.startsWith("Arrow");
    if (!name || onControl || walks || (event.key === "Tab" && event.target !== this.app.scene.canvas)) return;
    event.preventDefault();
    if (!event.repeat || ACTIONS[name].quiet) this.run(name, true);
  }

  escape() {
    if (this.app.handles.pull) this.app.handles.cancel();
    else if (!document.querySelector("dialog[open]")) {
      this.app.menu.close();
      this.app.selection.clear();
    }
  }

  run(name, on = true) {
    const action = ACTIONS[name];
    if (action.hold) return action.run(this.app, on);
    return possible(action, this.app) ? action.run(this.app) : null;
  }

  fillButtons() {
    for (const button of document.querySelectorAll("[data-action]")) {
      const name = button.dataset.action, action = ACTIONS[name];
      button.title = action.key ? `${action.words} (${action.key})` : action.words;
      button.type = "button";
      if (action.icon && !button.closest("#panel")) button.append(icon(action.icon));
      else button.append(action.label ?? action.words);
      button.setAttribute("aria-label", action.words);
      if (!action.hold) button.addEventListener("click", () => this.run(name));
      else for (const [type, on] of [["pointerdown", true], ["pointerup", false], ["pointerleave", false]]) {
        button.addEventListener(type, () => this.run(name, on));
      }
    }
  }

  // Greys out what cannot be done now and shows what is on.
  refresh() {
    for (const button of document.querySelectorAll("[data-action]")) {
      const action = ACTIONS[button.dataset.action];
      button.disabled = !possible(action, this.app);
      if (action.pressed) button.setAttribute("aria-pressed", String(Boolean(action.pressed(this.app))));
    }
    for (const button of document.querySelectorAll("[data-needs]")) {
      button.disabled = !(this.app.store.state.allowed ?? []).includes(button.dataset.needs);
    }
  }

  dialog() {
    const groups = Map.groupBy?.(Object.values(ACTIONS), ({ group }) => group) ?? grouped(Object.values(ACTIONS));
    const rows = (actions) => actions.filter(({ key }) => key).map(({ key, also, words }) =>
      row(also ? `${key} or ${also}` : key, words));
    const tables = [...groups].map(([group, actions]) => table(group, rows(actions))).filter(Boolean);
    byId("keys").replaceChildren(table("Mouse and fingers", GESTURES.map(([gesture, words]) => row(gesture, words))), ...tables);
    byId("help").showModal();
  }
}

// How a press is written in actions.js: Ctrl+Shift+Z, ?, ArrowLeft, Space.
export function keyOf(event) {
  const key = event.key === " " ? "Space" : event.key.length === 1 ? event.key.toUpperCase() : event.key;
  const sign = event.key.length === 1 && !/[a-z0-9 ]/i.test(event.key);
  const shift = event.shiftKey && !sign ? "Shift+" : "";
  return `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${shift}${key}`;
}

function grouped(actions) {
  const groups = new Map();
  for (const action of actions) groups.set(action.group, [...(groups.get(action.group) ?? []), action]);
  return groups;
}

const row = (key, words) => make("tr", {}, make("th", { scope: "row" }, make("kbd", {}, key)), make("td", {}, words));

function table(title, rows) {
  return rows.length ? make("table", {}, make("caption", {}, title), make("tbody", {}, ...rows)) : null;
}

export function icon(path) {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg"), line = document.createElementNS(space, "path");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("aria-hidden", "true");
  line.setAttribute("d", path);
  svg.append(line);
  return svg;
}
