// Three arrows at the middle of the selection, of the same size on the screen at any distance.

import { BufferAttribute, BufferGeometry, GLSL3, Group, LineSegments, Mesh as Drawn, ConeGeometry, RawShaderMaterial }
  from "./vendor/three/three.module.min.js";
import { add, scale } from "./vectors.js";

const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const COLOURS = [[0.85, 0.27, 0.27], [0.3, 0.62, 0.25], [0.22, 0.45, 0.9]];
const SIZE = 74, START = 14, NEAR = 9; // pixels

const VERTEX = `
precision highp float;
in vec3 position;
uniform mat4 projectionMatrix, modelViewMatrix;
void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`;
const FRAGMENT = `
precision highp float;
uniform vec3 tint;
uniform float opacity;
out vec4 colour;
void main() { colour = vec4(tint, opacity); }`;

const paint = (tint, opacity = 1) => new RawShaderMaterial({
  glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, depthTest: false, depthWrite: false,
  transparent: true, uniforms: { tint: { value: tint }, opacity: { value: opacity } } });

export class Gizmo {
  constructor({ scene, store, handles }) {
    Object.assign(this, { scene, store, handles });
    this.group = new Group();
    this.arrows = AXES.map((axis, i) => arrow(axis, COLOURS[i]));
    this.guide = new LineSegments(segment([0, 0, -1], [0, 0, 1]), paint([0.5, 0.5, 0.5], 0.8));
    for (const object of [...this.arrows, this.guide]) this.group.add(object);
    this.group.traverse((object) => { object.frustumCulled = false; object.renderOrder = 5; });
    scene.group.add(this.group);
    scene.beforeDraw.push(() => this.place());
  }

  // Pixels of the picture in units of length at the gizmo.
  unit(at) {
    const { view } = this.scene;
    if (view.orthographic) return view.unitsPerPixel;
    const depth = Math.max(1e-9, view.forward.reduce((sum, f, i) => sum + f * (at[i] - view.eye[i]), 0));
    return (view.unitsPerPixel * depth) / view.distance;
  }

  place() {
    const { pull } = this.handles, middle = this.store.tool === "pull" ? this.handles.middle() : null;
    this.group.visible = Boolean(middle) && !this.store.before;
    if (!this.group.visible) return;
    const k = this.unit(middle);
    this.group.position.set(...middle);
    this.arrows.forEach((object, axis) => {
      object.scale.setScalar(k);
      object.visible = !pull || (pull.axis !== null && (pull.axis === axis) !== pull.across);
    });
    this.guide.visible = Boolean(pull && pull.axis !== null && !pull.across);
    if (!this.guide.visible) return;
    this.guide.scale.setScalar(4000 * k);
    this.guide.rotation.set(pull.axis === 1 ? Math.PI / 2 : 0, pull.axis === 0 ? Math.PI / 2 : 0, 0);
    this.guide.material.uniforms.tint.value = COLOURS[pull.axis];
  }

  // The axis whose arrow is under a place of the picture; null for none.
  at(x, y) {
    const middle = this.handles.middle();
    if (!middle || this.store.tool !== "pull") return null;
    const k = this.unit(middle), { view } = this.scene;
    let best = null, least = NEAR;
    AXES.forEach((axis, i) => {
      const a = view.project(add(middle, scale(axis, START * k))), b = view.project(add(middle, scale(axis, SIZE * k)));
      const d = distance([x, y], a, b);
      if (d < least) { least = d; best = i; }
    });
    return best;
  }
}

function segment(a, b) {
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array([...a, ...b]), 3));
}

function arrow(axis, colour) {
  const group = new Group(), material = paint(colour);
  const shaft = new Drawn(rod(START, SIZE - 14, 1.2), material);
  const cone = new Drawn(new ConeGeometry(5, 16, 16), material);
  cone.position.set(0, SIZE - 8, 0);
  group.add(shaft, cone);
  if (axis[0]) group.rotation.z = -Math.PI / 2;
  if (axis[2]) group.rotation.x = Math.PI / 2;
  return group;
}

// A thin square rod along y.
function rod(from, to, r) {
  const corners = [[-r, -r], [r, -r], [r, r], [-r, r]], places = [];
  corners.forEach(([ax, az], i) => {
    const [bx, bz] = corners[(i + 1) % 4];
    places.push(ax, from, az, bx, from, bz, bx, to, bz, ax, from, az, bx, to, bz, ax, to, az);
  });
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
}

function distance([x, y], [ax, ay], [bx, by]) {
  const dx = bx - ax, dy = by - ay, t = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1);
  const s = Math.max(0, Math.min(1, t));
  return Math.hypot(ax + s * dx - x, ay + s * dy - y);
}
