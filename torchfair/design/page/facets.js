// The faces of the mesh: one flat normal per polygon, coloured by what is looked at, or by their numbers for picking.

import { BufferAttribute, BufferGeometry, DoubleSide, GLSL3, IntType, Mesh as Drawn, RawShaderMaterial }
  from "./vendor/three/three.module.min.js";
import { MIRROR } from "./mirror.js";
import { READ } from "./tables.js";

export const Paint = { CLAY: 0, MIRROR: 1, VERTEX_VALUES: 2, FACE_VALUES: 3, VERTEX_CLASSES: 4, FLAT: 5 };

const VERTEX = `
precision highp float; precision highp int; precision highp sampler2D;
in ivec3 triangle;
in int face;
uniform mat4 projectionMatrix, viewMatrix;
uniform sampler2D vertexTable, faceTable;
out vec3 place;
out vec3 weights;
flat out vec3 values;  // of the three corners
flat out vec4 facet;   // unit normal, value
flat out int number;
${READ}
void main() {
  int corner = gl_VertexID % 3;
  facet = read(faceTable, face);
  place = read(vertexTable, triangle[corner]).xyz;
  weights = vec3(corner == 0, corner == 1, corner == 2);
  values = vec3(read(vertexTable, triangle.x).w, read(vertexTable, triangle.y).w, read(vertexTable, triangle.z).w);
  number = face;
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}`;

const FRAGMENT = `
precision highp float; precision highp int; precision highp sampler2D;
in vec3 place, weights;
flat in vec3 values;
flat in vec4 facet;
uniform int paint;
uniform vec3 eye, forward, clay, inside, flatColour;
uniform bool central;
uniform sampler2D palette;
uniform vec2 range;              // values at the ends of the palette
out vec4 colour;
${MIRROR}
float shade(vec3 normal) {
  vec3 sight = central ? normalize(place - eye) : forward;
  float facing = abs(dot(sight, normal));
  float sky = 0.5 + 0.5 * normal.z * (dot(sight, normal) > 0.0 ? -1.0 : 1.0);
  return 0.42 + 0.42 * facing + 0.18 * sky;
}
vec3 scaled(float v) { return texture(palette, vec2(clamp((v - range.x) / (range.y - range.x), 0.0, 1.0), 0.5)).rgb; }
vec3 classColour() {  // of the nearest corner
  float nearest = max(weights.x, max(weights.y, weights.z));
  float value = weights.x == nearest ? values.x : weights.y == nearest ? values.y : values.z;
  return texelFetch(palette, ivec2(int(value + 0.5), 0), 0).rgb;
}
void main() {
  vec3 normal = facet.xyz;
  if (paint == ${Paint.MIRROR}) { colour = vec4(mirrored(place, normal), 1.0); return; }
  if (paint == ${Paint.FLAT}) { colour = vec4(flatColour, 1.0); return; }
  vec3 base = gl_FrontFacing ? clay : inside;
  if (paint == ${Paint.VERTEX_VALUES}) base = scaled(dot(weights, values));
  if (paint == ${Paint.VERTEX_CLASSES}) base = classColour();
  if (paint == ${Paint.FACE_VALUES}) base = scaled(facet.w);
  float light = shade(normal);
  colour = vec4(base * (paint == ${Paint.CLAY} ? light : mix(1.0, light, 0.45)), 1.0);
}`;

const NUMBERS = `
precision highp float; precision highp int;
flat in int number;
out vec4 colour;
void main() {
  int n = number + 1;  // 0 is nothing
  colour = vec4(n & 255, (n >> 8) & 255, (n >> 16) & 255, 255) / 255.0;
}`;

export class Facets {
  constructor(uniforms) {
    this.uniforms = uniforms;
    const shared = { glslVersion: GLSL3, vertexShader: VERTEX, uniforms, side: DoubleSide };
    const behindLines = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    this.material = new RawShaderMaterial({ ...shared, ...behindLines, fragmentShader: FRAGMENT });
    this.numbers = new RawShaderMaterial({ ...shared, fragmentShader: NUMBERS });
    this.object = new Drawn(new BufferGeometry(), this.material);
    this.object.frustumCulled = false;
  }

  setMesh(mesh) {
    const geometry = new BufferGeometry();
    const { vertices, faces } = mesh.triangles;
    const triangles = new Int32Array(3 * vertices.length);
    for (let i = 0; i < vertices.length; i++) {
      const first = i - (i % 3);
      for (let k = 0; k < 3; k++) triangles[3 * i + k] = vertices[first + k];
    }
    const integers = (array, size) => Object.assign(new BufferAttribute(array, size), { gpuType: IntType });
    geometry.setAttribute("triangle", integers(triangles, 3));
    geometry.setAttribute("face", integers(faces, 1));
    geometry.setDrawRange(0, mesh.triangles.vertices.length);
    this.object.geometry.dispose();
    this.object.geometry = geometry;
  }
}
