// Opening, dropping, saving, pictures: everything that has to do with files.

import { CanvasTexture, LinearFilter, RepeatWrapping } from "./vendor/three/three.module.min.js";
import { byId, bytes, make } from "./format.js";

const PICTURE = /\.(png|jpe?g|webp|avif|gif)$/i;
const WIDEST = 4096; // columns of a panorama

export class Files {
  constructor(app) {
    this.app = app;
    byId("choose").addEventListener("click", () => byId("file").click());
    byId("file").addEventListener("change", ({ target }) => { this.take(target.files[0]); target.value = ""; });
    byId("path").addEventListener("keydown", (event) => {
      if (event.key !== "Enter") return;
      event.preventDefault();
      if (event.target.value.trim()) this.open(event.target.value.trim(), true);
    });
    byId("download").addEventListener("submit", (event) => this.submitted(event));
    this.bindDrop();
  }

  bindDrop() {
    const show = (on) => { byId("drop").hidden = !on; };
    addEventListener("dragover", (event) => { event.preventDefault(); show(event.dataTransfer.types.includes("Files")); });
    addEventListener("dragleave", (event) => { if (!event.relatedTarget) show(false); });
    addEventListener("drop", (event) => {
      event.preventDefault();
      show(false);
      this.take(event.dataTransfer.files[0]);
    });
  }

  async take(file) {
    const { notices, connection, store } = this.app;
    if (!file) return null;
    if (PICTURE.test(file.name)) return this.panorama(file);
    const most = store.welcome.limits?.upload_bytes ?? Infinity;
    if (file.size > most) {
      return notices.show("error", `${file.name} has ${bytes(file.size)}; at most ${bytes(most)} can be opened here. Start the command with the file.`);
    }
    byId("opening").close();
    try {
      connection.upload(file.name, new Uint8Array(await file.arrayBuffer()));
    } catch {
      notices.show("error", `${file.name} could not be read. If it was changed or moved meanwhile, choose it again.`);
    }
    return null;
  }

  // A picture of all directions for the mirrors.
  async panorama(file) {
    const { scene, notices, panel, store } = this.app;
    let image;
    try {
      image = await createImageBitmap(file);
      if (image.width > WIDEST) image = await createImageBitmap(file, { resizeWidth: WIDEST, resizeHeight: WIDEST / 2 });
    } catch {
      notices.show("error", `${file.name} is no picture that the browser can read. PNG, JPEG and WebP are.`);
      return false;
    }
    const texture = new CanvasTexture(image);
    Object.assign(texture, { flipY: false, generateMipmaps: false, minFilter: LinearFilter, magFilter: LinearFilter, wrapS: RepeatWrapping });
    scene.uniforms.panorama.value?.dispose();
    scene.uniforms.panorama.value = texture;
    byId("surroundings").value = "image";
    panel.applyMirror();
    store.put({ look: "mirror" });
    return true;
  }

  dialog() {
    this.app.send("list");
    byId("opening").showModal();
  }

  showList({ folder, files, examples }) {
    const entry = (source, words, note) => {
      const button = make("button", { type: "button", title: source }, make("span", {}, words), make("small", {}, note));
      button.addEventListener("click", () => this.open(source, false));
      return make("li", {}, button);
    };
    byId("examples").replaceChildren(...examples.map(({ name, words, vertices }) => {
      const source = name.startsWith("example:") ? name : `example:${name}`;
      return entry(source, name.replace("example:", "").replaceAll("_", " "), vertices ? `${words} (${vertices} vertices)` : words);
    }));
    byId("folder").textContent = `In ${folder}`;
    const rows = files.map(({ name, bytes: size, kind }) => entry(name, name, kind === "session" ? "session" : bytes(size)));
    byId("files").replaceChildren(...(rows.length ? rows : [make("li", {}, make("small", {}, "no meshes or sessions here"))]));
  }

  open(source, typed) {
    byId("opening").close();
    this.app.send("open", typed ? { source, typed: true } : { source });
  }

  submitted(event) {
    event.preventDefault();
    const form = event.target, to = event.submitter?.value ?? "download", format = form.format.value;
    this.save(to === "download" ? { format, to } : { format, to, name: form.name.value.trim(), typed: form.typed.checked });
  }

  async save(fields) {
    this.app.sendCamera();
    const answer = await this.app.connection.ask("save", fields);
    if (answer.type === "error" && fields.to === "folder" && !fields.overwrite && /exist/i.test(answer.sentence)) {
      this.app.question({ sentence: answer.sentence, choices: [{ value: "yes", words: "Replace it" }, { value: "", words: "Keep it" }] },
        (choice) => { if (choice) this.save({ ...fields, overwrite: true }); });
    }
  }

  saveSession() {
    const session = (this.app.store.welcome.save ?? []).find(({ format }) => format === "session");
    this.save({ format: session?.format ?? "session", to: "download" });
  }

  showFormats(formats) {
    const select = byId("download").format;
    select.replaceChildren(...formats.filter(({ format }) => format !== "strips").map(({ format, words, suffix }) =>
      make("option", { value: format, title: words }, `${words ?? format} (${suffix})`)));
    const rename = () => {
      const { suffix } = formats.find(({ format }) => format === select.value) ?? { suffix: "" };
      const title = (this.app.store.state.title ?? "design").replace(/^example:/, "").replace(/\.[^.]*$/, "");
      byId("download").name.value = `${title || "design"}${suffix}`;
    };
    select.onchange = rename;
    rename();
  }

  give(name, blob) {
    const link = make("a", { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }

  received({ name, media, arrays }) { this.give(name, new Blob([arrays.bytes], { type: media })); }

  async commandLine() { await this.app.connection.ask("command_line"); }

  async showCommand({ text, sentence }) {
    const box = byId("command");
    box.hidden = false;
    box.textContent = text;
    let copied = true;
    try { await navigator.clipboard.writeText(text); } catch { copied = false; }
    const what = copied ? "The command line is copied." : "Copy the command line from the panel: the browser does not let the page do it.";
    this.app.notices.show("info", [what, sentence].filter(Boolean).join(" "));
  }

  // The picture without marks, at twice the size.
  screenshot() {
    const { scene, store } = this.app, { renderer, view } = scene, ratio = renderer.getPixelRatio();
    const shown = { dots: scene.dots.object.visible, gizmo: store.selection };
    scene.dots.object.visible = scene.dots.behind.visible = false;
    store.selection = new Set();
    renderer.setPixelRatio(2 * ratio);
    renderer.setSize(view.width, view.height, false);
    for (const act of scene.beforeDraw) act();
    scene.draw();
    scene.canvas.toBlob((blob) => {
      if (blob) this.give(`${(store.state.title || "design").replace(/\W+/g, "_")}.png`, blob);
      else this.app.notices.show("error", "The picture is too large for this browser. Make the window smaller.");
    }, "image/png");
    store.selection = shown.gizmo;
    scene.dots.object.visible = scene.dots.behind.visible = shown.dots;
    scene.resize();
  }
}
