// The picture: draws when something changed and never else; knows the mesh, the view and what they are painted with.

import { Color, ColorManagement, LinearSRGBColorSpace, Matrix3, Scene as Group, Vector2, Vector3, WebGLRenderer }
  from "./vendor/three/three.module.min.js";
import { Dots } from "./dots.js";
import { Facets, Paint } from "./facets.js";
import { Gauss } from "./gauss.js";
import { LineColour, Lines } from "./lines.js";
import { palettes } from "./palettes.js";
import { MeshTables } from "./tables.js";
import { View } from "./view.js";

ColorManagement.enabled = false; // colours are those of the screen, as in the style sheet

const named = (values) => Object.fromEntries(Object.entries(values).map(([name, value]) => [name, { value }]));

export class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: false, preserveDrawingBuffer: false });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.autoClear = false;
    this.renderer.info.autoReset = false;
    this.view = new View();
    this.frames = 0;          // drawn so far
    this.scriptTime = 0;      // ms of script in the last frame
    this.afterDraw = [];      // called once each after the next frame
    this.beforeDraw = [];     // called in every frame
    this.uniforms = named({
      vertexTable: null, faceTable: null, table: null, palette: palettes().fire, range: new Vector2(0, 1),
      paint: Paint.CLAY, eye: new Vector3(), forward: new Vector3(), central: true, size: new Vector2(1, 1),
      pixelRatio: 1, clay: new Color(), inside: new Color(), flatColour: new Color(), ink: new Color(),
      markColour: new Color(), rim: new Color(),
      surroundings: 0, stripeDirection: new Vector3(0, 0, 1), frequency: 4, sharpness: 6, panorama: null,
      dark: new Color(), light: new Color(), room: new Matrix3(), mirrorEye: new Vector3(),
      mirrorForward: new Vector3(), mirrorCentral: true,
    });
    this.background = new Color();
    this.facets = new Facets(this.uniforms);
    const { vertexTable, palette, size, ink, markColour, forward } = this.uniforms;
    const lineUniforms = { palette, size, ink, markColour, forward };
    this.edges = new Lines({ ...lineUniforms, table: vertexTable }, { width: 1.2 });
    const dotUniforms = { rim: this.uniforms.rim, pixelRatio: this.uniforms.pixelRatio };
    this.marks = new Dots(dotUniforms);
    this.dots = new Dots(dotUniforms, 0.35);
    this.group = new Group();
    this.group.add(this.facets.object, this.edges.object, this.marks.object, this.dots.object, this.dots.behind);
    this.gauss = new Gauss(this.uniforms, lineUniforms);
    this.mesh = null;
    this.tables = this.beforeTables = null;
    this.meshVersion = 0; // rises when vertices move
    this.eyeChoice = "room";  // room, eye or frozen: what the mirrored surroundings do when the eye moves
  }

  get paint() { return this.uniforms.paint.value; }

  setMesh(mesh, startPositions) {
    this.tables?.dispose();
    this.beforeTables?.dispose();
    this.mesh = mesh;
    this.startPositions = startPositions;
    this.beforeTables = null;
    this.tables = new MeshTables(mesh);
    this.facets.setMesh(mesh);
    this.edges.setEnds(Int32Array.from(mesh.edges));
    this.gauss.setMesh(mesh);
    this.view.bounds = mesh.bounds();
    this.view.apply();
    this.useTables(this.tables);
  }

  useTables(tables) {
    this.uniforms.vertexTable.value = tables.vertices.texture;
    this.uniforms.faceTable.value = tables.faces.texture;
    this.invalidate();
  }

  // After mesh.positions changed.
  updateMesh() {
    this.mesh.updateNormals();
    this.tables.update(this.mesh);
    this.meshVersion++;
    this.invalidate();
  }

  showBefore(on) {
    if (!this.mesh || !this.startPositions) return;
    if (on && !this.beforeTables) {
      const before = Object.assign(Object.create(Object.getPrototypeOf(this.mesh)), this.mesh, {
        positions: this.startPositions, normals: new Float32Array(this.mesh.normals.length) });
      before.updateNormals();
      this.beforeTables = new MeshTables(before);
    }
    this.useTables(on ? this.beforeTables : this.tables);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.renderer.setSize(width, height, false);
    this.view.resize(width, height);
    this.invalidate();
  }

  invalidate() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.frame());
  }

  frame() {
    this.waiting = false;
    const start = performance.now();
    for (const act of this.beforeDraw) act();
    this.draw();
    this.frames++;
    this.scriptTime = performance.now() - start;
    for (const act of this.afterDraw.splice(0)) act();
  }

  draw() {
    const { renderer, view } = this;
    this.setEye();
    renderer.setClearColor(this.background, 1);
    renderer.setViewport(0, 0, view.width, view.height);
    renderer.clear();
    if (!this.mesh) return;
    renderer.render(this.group, view.camera);
    this.gauss.draw(renderer, view);
  }

  setEye() {
    const { view, uniforms: u } = this;
    u.eye.value.set(...view.eye);
    u.forward.value.set(...view.forward);
    u.central.value = !view.orthographic;
    u.size.value.set(view.width, view.height);
    u.pixelRatio.value = this.renderer.getPixelRatio();
    if (this.eyeChoice === "frozen") return;
    u.mirrorEye.value.copy(u.eye.value);
    u.mirrorForward.value.copy(u.forward.value);
    u.mirrorCentral.value = u.central.value;
    if (this.eyeChoice === "eye") u.room.value.setFromMatrix4(eyeAxes(view));
    else u.room.value.identity();
  }
}

// From the world into a room that turns with the eye: right, into the picture and up become x, y and z.
function eyeAxes(view) {
  const [r, f, u] = [view.right, view.forward, view.upward];
  const matrix = view.camera.matrixWorld.clone();
  matrix.set(r[0], r[1], r[2], 0, f[0], f[1], f[2], 0, u[0], u[1], u[2], 0, 0, 0, 0, 1);
  return matrix;
}

export { LineColour, Paint };
