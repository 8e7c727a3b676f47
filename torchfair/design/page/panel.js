// The panel: choices and sliders made from what the engine lists, and the settings of the look.

import { byId, make, number } from "./format.js";
import { LOOKS } from "./looks.js";
import { SURROUNDINGS, stripeDirection } from "./mirror.js";

const STEPS = 1000; // of a slider of a weight

export class Panel {
  constructor(app) {
    this.app = app;
    const { store } = app;
    byId("looks").append(...LOOKS.map((look, i) => this.lookButton(look, i)));
    this.bindMirror();
    for (const name of ["lines", "sphere", "through"]) {
      byId(name).addEventListener("change", (event) => store.put({ [name]: event.target.checked }));
    }
    store.on("lines sphere", () => { for (const name of ["lines", "sphere"]) byId(name).checked = store[name]; });
    store.on("look", () => this.showLook());
    store.on("settings", () => this.showSettings());
    store.on("state", () => this.showModes());
    store.on("selection handles held hover topology", () => this.showSelection());
    byId("place").addEventListener("submit", (event) => this.placed(event));
    byId("remesh").addEventListener("submit", (event) => this.remesh(event));
    this.showLook();
  }

  lookButton({ name, words }, i) {
    const button = make("button", { type: "button", title: `${words} (${i + 1})`, role: "radio", data: { look: name } }, words);
    button.addEventListener("click", () => this.app.store.put({ look: name }));
    return button;
  }

  showLook() {
    const { look } = this.app.store;
    for (const button of byId("looks").children) button.setAttribute("aria-checked", String(button.dataset.look === look));
    byId("mirror").hidden = look !== "mirror";
  }

  bindMirror() {
    const { scene, files } = this.app, u = scene.uniforms;
    const apply = () => {
      const value = (id) => Number(byId(id).value), kind = byId("surroundings").value;
      u.surroundings.value = kind === "image" && !u.panorama.value ? 2 : SURROUNDINGS.indexOf(kind);
      u.stripeDirection.value.set(...stripeDirection(value("around"), value("tilt")));
      u.frequency.value = value("frequency");
      u.sharpness.value = value("sharpness");
      scene.eyeChoice = byId("eye").value;
      byId("stripes").dataset.kind = kind;
      for (const id of ["around", "tilt", "frequency", "sharpness"]) {
        byId(id).nextElementSibling.value = byId(id).value + (id === "around" || id === "tilt" ? "°" : "");
      }
      scene.invalidate();
    };
    for (const control of byId("mirror").querySelectorAll("select, input[type=range]")) control.addEventListener("input", apply);
    byId("surroundings").addEventListener("change", (event) => { if (event.target.value === "image") byId("panorama").click(); });
    byId("panorama").addEventListener("change", async ({ target }) => {
      if (target.files[0] && await files.panorama(target.files[0])) apply();
      target.value = "";
    });
    this.applyMirror = apply;
    apply();
  }

  showModes() {
    const { state } = this.app.store, can = (state.allowed ?? []).includes("mode");
    byId("modes").replaceChildren(...(state.modes ?? []).map(({ mode, words, refused }) => {
      const button = make("button", {
        type: "button", role: "radio", title: refused || words, disabled: Boolean(refused) || !can }, mode);
      button.setAttribute("aria-checked", String(mode === state.mode));
      button.addEventListener("click", () => this.app.send("mode", { mode }));
      return button;
    }));
  }

  showSettings() {
    const { weights, choices } = this.app.store.settings;
    if (byId("weights").contains(document.activeElement)) return this.updateWeights(weights);
    byId("choices").replaceChildren(...choices.map((choice) => this.choiceRow(choice)));
    byId("weights").replaceChildren(...weights.map((weight) => this.weightRow(weight)));
    return null;
  }

  choiceRow({ name, words, value, values }) {
    const options = values.map((option) => make("option", {
      value: option.value, selected: option.value === value }, option.words));
    const select = make("select", { data: { choice: name } }, ...options);
    select.addEventListener("change", () => this.app.send("choose", { choices: { [name]: select.value } }));
    return make("label", { className: "row", title: words }, make("span", {}, words), select);
  }

  weightRow(weight) {
    const { name, words, value } = weight, output = make("output", {}, number(value));
    const slider = make("input", { type: "range", min: 0, max: STEPS, step: 1, title: `${words}: double click for the default` });
    slider.value = toSlider(weight, value);
    slider.dataset.weight = name;
    const send = (release) => {
      const chosen = fromSlider(weight, Number(slider.value));
      output.value = number(chosen);
      this.app.weigh({ [name]: chosen }, release);
    };
    slider.addEventListener("input", () => send(false));
    slider.addEventListener("change", () => send(true));
    slider.addEventListener("dblclick", () => { slider.value = toSlider(weight, weight.default); send(true); });
    return make("label", { className: "row", title: words }, make("span", {}, words), slider, output);
  }

  updateWeights(weights) {
    for (const weight of weights) {
      const slider = byId("weights").querySelector(`[data-weight="${CSS.escape(weight.name)}"]`);
      if (!slider || slider === document.activeElement) continue;
      slider.value = toSlider(weight, weight.value);
      slider.nextElementSibling.value = number(weight.value);
    }
  }

  showSelection() {
    const { store, handles } = this.app, { selection, topology } = store, middle = topology ? handles.middle() : null;
    byId("selection").textContent = sentence(store);
    const form = byId("place");
    form.hidden = !middle;
    if (!middle || form.contains(document.activeElement)) return;
    ["x", "y", "z"].forEach((axis, i) => { form[axis].value = String(+(middle[i] + topology.origin[i]).toPrecision(7)); });
    form.title = selection.size > 1 ? "Middle of the selected vertices" : "Place of the selected vertex";
  }

  placed(event) {
    event.preventDefault();
    const form = event.target, place = ["x", "y", "z"].map((axis) => Number(form[axis].value.replace(",", ".").trim() || NaN));
    if (!place.every(Number.isFinite)) return this.app.notices.show("warning", "A coordinate is not a number: type it as 12.5.");
    document.activeElement.blur();
    return this.app.handles.moveTo(place);
  }

  remesh(event) {
    event.preventDefault();
    this.app.send("mesh", { kind: event.submitter?.value ?? "quads", count: Number(event.target.count.value) });
  }
}

function sentence({ selection, handles, held }) {
  const kept = [handles.size && `${handles.size} pulled`, held.size && `${held.size} fixed`].filter(Boolean).join(", ");
  const rest = kept ? ` In all: ${kept}.` : "";
  if (selection.size === 0) return `Nothing is selected.${rest}`;
  const [first] = selection;
  if (selection.size > 1) return `${selection.size} vertices are selected.${rest}`;
  const what = handles.has(first) ? ", pulled" : held.has(first) ? ", fixed" : "";
  return `Vertex ${first}${what}.${rest}`;
}

// Sliders are logarithmic; 0 at their left end where the least is 0, then four decades up to the most.
function toSlider({ least, most }, value) {
  const low = least > 0 ? least : most * 1e-4;
  if (value <= 0) return 0;
  return Math.round(STEPS * Math.max(0, Math.min(1, Math.log(value / low) / Math.log(most / low))));
}

function fromSlider({ least, most }, place) {
  const low = least > 0 ? least : most * 1e-4;
  if (place === 0 && !(least > 0)) return 0;
  return Number((low * (most / low) ** (place / STEPS)).toPrecision(3));
}

