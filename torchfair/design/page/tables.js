// Numbers of vertices and faces as textures that all shaders read: a frame of a drag sends nothing else to the GPU,
// and corners, edges and dots never change while the mesh keeps its connectivity.

import { DataTexture, FloatType, NearestFilter, RGBAFormat } from "./vendor/three/three.module.min.js";

export const ROW = 1024; // texels in a row; READ below says the same in GLSL

export const READ = `
vec4 read(sampler2D table, int i) { return texelFetch(table, ivec2(i & 1023, i >> 10), 0); }
`;

export class Table {
  constructor(count) {
    const rows = Math.max(1, Math.ceil(count / ROW));
    this.data = new Float32Array(4 * ROW * rows);
    this.texture = new DataTexture(this.data, ROW, rows, RGBAFormat, FloatType);
    this.texture.minFilter = this.texture.magFilter = NearestFilter;
    this.texture.generateMipmaps = false;
    this.texture.needsUpdate = true;
    this.count = count;
  }

  setVectors(vectors) {
    const { data, count } = this;
    for (let i = 0, from = 0, to = 0; i < count; i++, from += 3, to += 4) {
      data[to] = vectors[from]; data[to + 1] = vectors[from + 1]; data[to + 2] = vectors[from + 2];
    }
    this.texture.needsUpdate = true;
  }

  // The fourth number of each row; all zero for null.
  setValues(values) {
    for (let i = 0; i < this.count; i++) this.data[4 * i + 3] = values ? values[i] : 0;
    this.texture.needsUpdate = true;
  }

  dispose() { this.texture.dispose(); }
}

// The tables of one mesh.
export class MeshTables {
  constructor(mesh) {
    this.vertices = new Table(mesh.numVertices);
    this.faces = new Table(mesh.numFaces);
    this.update(mesh);
  }

  update(mesh) {
    this.vertices.setVectors(mesh.positions);
    this.faces.setVectors(mesh.normals);
  }

  dispose() {
    this.vertices.dispose();
    this.faces.dispose();
  }
}
