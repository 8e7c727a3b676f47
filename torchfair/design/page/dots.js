// Round dots on vertices: handles, held and selected vertices, those whose normal pyramid crosses itself.

import { BufferAttribute, BufferGeometry, GLSL3, Points, RawShaderMaterial } from "./vendor/three/three.module.min.js";

const VERTEX = `
precision highp float;
in vec3 place;
in vec4 tint;
in float dotSize;
uniform mat4 projectionMatrix, viewMatrix;
uniform float pixelRatio;
out vec4 fill;
out float radius;
void main() {
  fill = tint;
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
  gl_Position.z -= 6e-4 * gl_Position.w;
  gl_PointSize = dotSize * pixelRatio;
  radius = 0.5 * gl_PointSize;
}`;

const FRAGMENT = `
precision highp float;
in vec4 fill;
in float radius;
uniform vec3 rim;
uniform float pixelRatio, hidden;
out vec4 colour;
void main() {
  float inside = radius - length((gl_PointCoord - 0.5) * 2.0 * radius);
  if (inside < 0.0) discard;
  float ring = smoothstep(1.7 * pixelRatio, 0.9 * pixelRatio, inside);
  colour = vec4(mix(fill.rgb, rim, ring), fill.a * smoothstep(0.0, 1.0, inside) * hidden);
}`;

const ROOM = 256; // dots to begin with; grows

export class Dots {
  constructor(uniforms, through = 0) {
    const shared = { glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, transparent: true, depthWrite: false };
    const material = (more) => new RawShaderMaterial({ ...shared, ...more });
    this.object = new Points(new BufferGeometry(), material({ uniforms: { ...uniforms, hidden: { value: 1 } } }));
    this.behind = new Points(this.object.geometry, material({
      uniforms: { ...uniforms, hidden: { value: through } }, depthTest: false }));
    this.behind.visible = through > 0;
    for (const points of [this.object, this.behind]) points.frustumCulled = false;
    this.behind.renderOrder = 2;
    this.object.renderOrder = 3;
    this.room = 0;
  }

  // list: [{ place: [3], colour: [3], size }]
  set(list) {
    if (list.length > this.room || this.room === 0) this.grow(Math.max(ROOM, 2 * list.length));
    const { place, tint, dotSize } = this.arrays;
    list.forEach((dot, i) => {
      place.set(dot.place, 3 * i);
      tint.set([...dot.colour, dot.opacity ?? 1], 4 * i);
      dotSize[i] = dot.size;
    });
    const geometry = this.object.geometry;
    for (const name of ["place", "tint", "dotSize"]) geometry.getAttribute(name).needsUpdate = true;
    geometry.setDrawRange(0, list.length);
  }

  grow(room) {
    this.room = room;
    this.arrays = { place: new Float32Array(3 * room), tint: new Float32Array(4 * room), dotSize: new Float32Array(room) };
    const geometry = new BufferGeometry();
    geometry.setAttribute("place", new BufferAttribute(this.arrays.place, 3));
    geometry.setAttribute("position", geometry.getAttribute("place"));
    geometry.setAttribute("tint", new BufferAttribute(this.arrays.tint, 4));
    geometry.setAttribute("dotSize", new BufferAttribute(this.arrays.dotSize, 1));
    this.object.geometry.dispose();
    this.object.geometry = this.behind.geometry = geometry;
  }
}
