// What is under the pointer: the faces are drawn by number into a picture that is read where it is asked for. It is
// drawn again only after the view or the mesh changed.

import { Color, NearestFilter, Scene as Group, WebGLRenderTarget } from "./vendor/three/three.module.min.js";

const REACH = 13; // pixels from the pointer to a vertex

export class Picker {
  constructor(scene) {
    this.scene = scene;
    this.target = new WebGLRenderTarget(1, 1, { minFilter: NearestFilter, magFilter: NearestFilter });
    this.group = new Group();
    this.drawn = "";
  }

  get stamp() {
    const { view, meshVersion, mesh } = this.scene;
    return `${view.moved} ${meshVersion} ${view.width}x${view.height} ${mesh?.numFaces}`;
  }

  // Draws the faces by number, if that picture is old.
  refresh() {
    if (this.drawn === this.stamp) return;
    const { renderer, facets, view, group, background } = this.scene;
    this.target.setSize(Math.ceil(view.width), Math.ceil(view.height));
    renderer.setRenderTarget(this.target);
    renderer.setClearColor(new Color(0), 0);
    renderer.clear();
    this.group.add(facets.object);
    facets.object.material = facets.numbers;
    renderer.render(this.group, view.camera);
    facets.object.material = facets.material;
    group.add(facets.object);
    renderer.setRenderTarget(null);
    renderer.setClearColor(background, 1);
    this.drawn = this.stamp;
  }

  // Numbers of the faces in a window of the picture, -1 for none, row by row from below; and where it lies.
  window(x, y, reach) {
    this.refresh();
    const { width, height } = this.target;
    const left = Math.max(0, Math.floor(x) - reach), right = Math.min(width, Math.floor(x) + reach + 1);
    const low = Math.max(0, height - 1 - Math.floor(y) - reach), high = Math.min(height, height - Math.floor(y) + reach);
    return { left, low, columns: Math.max(0, right - left), rows: Math.max(0, high - low) };
  }

  read({ left, low, columns, rows }) {
    const bytes = new Uint8Array(4 * columns * rows), gl = this.scene.renderer.getContext();
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null); // a look of `later` may still be on its way
    if (bytes.length) this.scene.renderer.readRenderTargetPixels(this.target, left, low, columns, rows, bytes);
    return numbers(bytes);
  }

  // Like `at`, without waiting for the GPU.
  async later(x, y) {
    if (!this.scene.mesh) return NOTHING;
    const window = this.window(x, y, REACH), { left, low, columns, rows } = window;
    if (!columns || !rows) return NOTHING;
    const bytes = new Uint8Array(4 * columns * rows), stamp = this.drawn;
    await this.scene.renderer.readRenderTargetPixelsAsync(this.target, left, low, columns, rows, bytes);
    return stamp === this.stamp ? this.nearest(x, y, numbers(bytes), window) : NOTHING;
  }

  // The face under a place in the picture and the vertex near it: { face, vertex }, null for none.
  at(x, y, reach = REACH) {
    if (!this.scene.mesh) return NOTHING;
    const window = this.window(x, y, reach);
    return this.nearest(x, y, this.read(window), window, reach);
  }

  nearest(x, y, faces, { left, low, columns }, reach = REACH) {
    const { mesh, view } = this.scene, height = this.target.height;
    const centre = (height - 1 - Math.floor(y) - low) * columns + Math.floor(x) - left;
    let vertex = null, least = reach;
    for (const face of new Set(faces)) {
      if (face < 0 || face >= mesh.numFaces) continue;
      for (const v of mesh.faceCorners(face)) {
        const [px, py] = view.project(mesh.point(v)), distance = Math.hypot(px - x, py - y);
        if (distance < least) { least = distance; vertex = v; }
      }
    }
    const face = faces[centre] ?? -1;
    return { face: face < 0 ? null : face, vertex };
  }

  // Numbers of the vertices for which inside(x, y) holds; only those that are seen, unless `through`.
  inside(inside, through = false) {
    const { mesh, view } = this.scene;
    if (!mesh) return [];
    this.refresh();
    const { width, height } = this.target, chosen = [];
    const faces = through ? null : this.read({ left: 0, low: 0, columns: width, rows: height });
    for (let v = 0; v < mesh.numVertices; v++) {
      const [x, y] = view.project(mesh.point(v));
      if (inside(x, y) && (through || this.seen(v, x, y, faces))) chosen.push(v);
    }
    return chosen;
  }

  // Whether one of its faces shows within a pixel of a vertex.
  seen(v, x, y, faces) {
    const { width, height } = this.target, star = this.scene.mesh.starFaces(v);
    for (let dy = -1; dy <= 1; dy++) {
      for (let dx = -1; dx <= 1; dx++) {
        const column = Math.floor(x) + dx, row = height - 1 - Math.floor(y) + dy;
        if (column < 0 || row < 0 || column >= width || row >= height) continue;
        if (star.includes(faces[row * width + column])) return true;
      }
    }
    return false;
  }
}

const NOTHING = { face: null, vertex: null };

function numbers(bytes) {
  const faces = new Int32Array(bytes.length / 4);
  for (let i = 0; i < faces.length; i++) faces[i] = bytes[4 * i] + (bytes[4 * i + 1] << 8) + (bytes[4 * i + 2] << 16) - 1;
  return faces;
}
