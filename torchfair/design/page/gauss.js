// The Gauss image in a corner: the normals of the faces on the unit sphere, an arc across each edge, seen along the
// same line of sight as the mesh, so that normals that face the eye lie in front.

import { GLSL3, Mesh as Drawn, OrthographicCamera, RawShaderMaterial, Scene as Group, SphereGeometry }
  from "./vendor/three/three.module.min.js";
import { LineColour, Lines } from "./lines.js";
import { dot, scale } from "./vectors.js";

const BALL = {
  vertexShader: `
precision highp float;
in vec3 position;
uniform mat4 projectionMatrix, viewMatrix;
out vec3 normal;
void main() { normal = position; gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0); }`,
  fragmentShader: `
precision highp float;
in vec3 normal;
uniform vec3 forward, ballColour, ballRim;
out vec4 colour;
void main() { colour = vec4(mix(ballRim, ballColour, smoothstep(0.0, 0.55, -dot(normalize(normal), forward))), 1.0); }`,
};
const MANY = 8000; // edges from which arcs are drawn straight: they are short

export class Gauss {
  constructor(uniforms, lineUniforms) {
    this.visible = true;
    this.size = 168;      // of its square in pixels
    this.corner = [0, 0]; // from the left and bottom, in pixels
    this.uniforms = {
      forward: uniforms.forward, ballColour: { value: null }, ballRim: { value: null } };
    this.ink = { value: null };
    this.shared = { ...lineUniforms, table: uniforms.faceTable, ink: this.ink };
    this.ball = new Drawn(new SphereGeometry(1, 48, 32), new RawShaderMaterial({
      ...BALL, glslVersion: GLSL3, uniforms: this.uniforms, depthTest: false }));
    this.ball.frustumCulled = false;
    this.group = new Group();
    this.camera = new OrthographicCamera(-1.06, 1.06, 1.06, -1.06, 0.1, 10);
    this.group.add(this.ball);
  }

  setMesh(mesh) {
    this.mesh = mesh;
    if (this.lines) this.group.remove(this.lines.object);
    this.lines = new Lines(this.shared, { width: 0.9, steps: mesh.numEdges > MANY ? 1 : 5, sphere: true });
    this.lines.object.material.depthTest = false;
    this.lines.object.renderOrder = 1;
    this.lines.uniforms.opacity.value = mesh.numEdges > MANY ? 0.35 : 0.6;
    this.lines.setEnds(Int32Array.from(mesh.edgeFaces));
    this.group.add(this.lines.object);
    this.light(null);
  }

  // Lights up the pyramid of a vertex: the arcs between the faces of its star.
  light(vertex) {
    if (!this.lines || this.lit === vertex) return;
    this.lit = vertex;
    const marks = new Uint8Array(this.mesh.numEdges);
    if (vertex !== null) {
      for (const e of this.mesh.starEdges(vertex)) marks[e] = 255;
    }
    this.lines.setBytes("mark", marks);
    this.lines.uniforms.paint.value = vertex === null ? LineColour.INK : LineColour.MARKED;
  }

  // The face whose normal lies nearest to a place in the corner, in pixels from its left and top; null if none is near.
  faceAt(x, y, view) {
    const k = 2.12 / this.size, across = (x - this.size / 2) * k, up = (this.size / 2 - y) * k;
    let best = null, least = 0.06 ** 2;
    for (let f = 0; f < this.mesh.numFaces; f++) {
      const n = this.mesh.normals.subarray(3 * f, 3 * f + 3);
      if (dot(n, view.forward) > 0) continue;
      const d = (dot(n, view.right) - across) ** 2 + (dot(n, view.upward) - up) ** 2;
      if (d < least) { least = d; best = f; }
    }
    return best;
  }

  draw(renderer, view) {
    if (!this.visible || !this.lines) return;
    const { size, corner: [x, y], camera } = this;
    camera.up.set(0, 0, 1);
    camera.position.set(...scale(view.backward, 3));
    camera.lookAt(0, 0, 0);
    this.shared.size.value.set(size, size);
    renderer.setViewport(x, y, size, size);
    renderer.render(this.group, camera);
  }
}
