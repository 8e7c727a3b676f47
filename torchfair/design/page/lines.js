// Straight lines of even width: the edges of the mesh and their arcs in the Gauss image. Each line is an instance of
// one strip, set out in the picture by the vertex shader.

import { BufferAttribute, BufferGeometry, DoubleSide, DynamicDrawUsage, GLSL3, InstancedBufferAttribute, InstancedBufferGeometry,
  IntType, Mesh as Drawn, RawShaderMaterial } from "./vendor/three/three.module.min.js";
import { READ } from "./tables.js";

export const LineColour = { INK: 0, SCALE: 1, MARKED: 2 };

const VERTEX = `
precision highp float; precision highp int; precision highp sampler2D;
in vec2 along;               // share of the way, side
in ivec2 ends;
in float amount, mark;       // 0..1 of the legend; marked or not
uniform mat4 projectionMatrix, viewMatrix;
uniform sampler2D table, palette;
uniform vec2 size;           // of the picture in pixels
uniform float width, lift, steps, least, span;  // amount = least + span * byte
uniform bool sphere;         // arcs of great circles
uniform int paint;
uniform vec3 ink, markColour;
uniform float opacity;
out vec4 tint;
out vec3 away;
${READ}
vec3 at(vec3 a, vec3 b, float t) {
  if (!sphere) return mix(a, b, t);
  float angle = atan(length(cross(a, b)), dot(a, b));
  return angle < 1e-3 || angle > 3.14 ? mix(a, b, t) : (sin((1.0 - t) * angle) * a + sin(t * angle) * b) / sin(angle);
}
vec4 clip(vec3 p) { return projectionMatrix * viewMatrix * vec4(p, 1.0); }
void main() {
  vec3 a = read(table, max(ends.x, 0)).xyz, b = read(table, max(ends.y, 0)).xyz;
  float w = width, value = clamp(least + span * amount, 0.0, 1.0);
  tint = vec4(ink, opacity);
  if (paint == ${LineColour.SCALE}) {
    tint = vec4(texture(palette, vec2(value, 0.5)).rgb, mix(0.25, 1.0, smoothstep(0.0, 0.15, value)));
    w *= 0.6 + 1.2 * value;
  }
  if (paint == ${LineColour.MARKED}) {
    tint = mark > 0.5 ? vec4(markColour, 1.0) : vec4(ink, 0.5 * opacity);
    w *= mark > 0.5 ? 1.8 : 0.8;
  }
  vec3 p = at(a, b, along.x);
  vec4 here = clip(p), back = clip(at(a, b, along.x - 1.0 / steps)), on = clip(at(a, b, along.x + 1.0 / steps));
  if (along.x == 0.0) back = here;
  if (along.x == 1.0) on = here;
  vec2 way = (on.xy / max(on.w, 1e-6) - back.xy / max(back.w, 1e-6)) * size;
  vec2 across = length(way) > 1e-6 ? normalize(vec2(-way.y, way.x)) : vec2(0.0);
  away = p;
  gl_Position = here;
  gl_Position.xy += along.y * across * w / size * here.w;
  gl_Position.z -= lift * here.w;
  if (ends.x < 0 || ends.y < 0 || (paint == ${LineColour.SCALE} && amount < 0.0)) gl_Position = vec4(0, 0, 2, 1);
}`;

const FRAGMENT = `
precision highp float;
in vec4 tint;
in vec3 away;
uniform bool sphere;
uniform vec3 forward;
out vec4 colour;
void main() {
  colour = tint;
  if (sphere && dot(away, forward) > 0.0) colour.a *= 0.12;
}`;

export class Lines {
  // uniforms: shared { table, palette, size, ink ... } as { value }; own settings follow
  constructor(shared, { width = 1, steps = 1, sphere = false } = {}) {
    this.steps = steps;
    this.uniforms = {
      ...shared, width: { value: width }, lift: { value: sphere ? 0 : 2e-4 }, steps: { value: steps },
      sphere: { value: sphere }, paint: { value: LineColour.INK }, opacity: { value: 1 }, least: { value: 0 },
      span: { value: 1 },
    };
    const material = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms: this.uniforms, transparent: true,
      depthWrite: false, side: DoubleSide,
    });
    this.object = new Drawn(new BufferGeometry(), material);
    this.object.frustumCulled = false;
  }

  // ends: Int32Array of pairs of rows of the table; -1 hides a line.
  setEnds(ends) {
    const geometry = new InstancedBufferGeometry(), strip = [], index = [];
    for (let k = 0; k <= this.steps; k++) strip.push(k / this.steps, -1, k / this.steps, 1);
    for (let k = 0; k < this.steps; k++) index.push(2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 2, 2 * k + 1, 2 * k + 3);
    geometry.setIndex(index);
    geometry.setAttribute("along", new BufferAttribute(new Float32Array(strip), 2));
    geometry.setAttribute("ends", Object.assign(new InstancedBufferAttribute(ends, 2), { gpuType: IntType }));
    const count = ends.length / 2;
    const bytes = () => new InstancedBufferAttribute(new Uint8Array(count), 1, true).setUsage(DynamicDrawUsage);
    geometry.setAttribute("amount", bytes());
    geometry.setAttribute("mark", bytes());
    geometry.instanceCount = count;
    this.object.geometry.dispose();
    this.object.geometry = geometry;
  }

  // name: amount or mark; a byte per line
  setBytes(name, bytes) {
    const attribute = this.object.geometry.getAttribute(name);
    attribute.array.set(bytes);
    attribute.needsUpdate = true;
  }
}
