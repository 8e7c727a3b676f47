// A polygon mesh as the page needs it: triangles that cover its faces, edges with their faces, stars, face normals.

export class Mesh {
  // starts: (F + 1) into corners, vertex numbers; edges: (E, 2) ends and (E, 2) faces on the left and right, -1 for
  // none; positions: (V, 3)
  constructor({ starts, corners, edges, edgeFaces, positions }) {
    this.starts = starts;
    this.corners = corners;
    this.edges = edges;
    this.numVertices = positions.length / 3;
    this.numFaces = starts.length - 1;
    this.numEdges = edges.length / 2;
    this.positions = positions;
    this.normals = new Float32Array(3 * this.numFaces);
    this.triangles = triangulate(this);
    this.edgeFaces = edgeFaces;
    this.stars = facesOfVertices(this);
    this.updateNormals();
  }

  // Unit normals of the polygons, along their area vectors; zero for faces without area.
  updateNormals() {
    const { starts, corners, positions: p, normals } = this;
    for (let f = 0; f < this.numFaces; f++) {
      const first = starts[f], end = starts[f + 1], o = 3 * corners[first];
      const ox = p[o], oy = p[o + 1], oz = p[o + 2];
      let x = 0, y = 0, z = 0, b = 3 * corners[first + 1];
      let bx = p[b] - ox, by = p[b + 1] - oy, bz = p[b + 2] - oz;
      for (let k = first + 2; k < end; k++) {
        const c = 3 * corners[k], cx = p[c] - ox, cy = p[c + 1] - oy, cz = p[c + 2] - oz;
        x += by * cz - bz * cy; y += bz * cx - bx * cz; z += bx * cy - by * cx;
        bx = cx; by = cy; bz = cz;
      }
      const length = Math.sqrt(x * x + y * y + z * z) || 1;
      normals[3 * f] = x / length; normals[3 * f + 1] = y / length; normals[3 * f + 2] = z / length;
    }
  }

  point(v) { return [this.positions[3 * v], this.positions[3 * v + 1], this.positions[3 * v + 2]]; }

  faceCorners(f) { return this.corners.subarray(this.starts[f], this.starts[f + 1]); }

  faceCentre(f) {
    const corners = this.faceCorners(f), sum = [0, 0, 0];
    for (const v of corners) for (let i = 0; i < 3; i++) sum[i] += this.positions[3 * v + i] / corners.length;
    return sum;
  }

  starFaces(v) { return this.stars.faces.subarray(this.stars.starts[v], this.stars.starts[v + 1]); }

  // Numbers of the edges at a vertex.
  starEdges(v) {
    this.edgesAt ??= edgesOfVertices(this);
    return this.edgesAt.edges.subarray(this.edgesAt.starts[v], this.edgesAt.starts[v + 1]);
  }

  // Middle and radius of the box around all vertices.
  bounds() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < this.positions.length; i++) {
      const axis = i % 3, value = this.positions[i];
      if (value < low[axis]) low[axis] = value;
      if (value > high[axis]) high[axis] = value;
    }
    const centre = low.map((value, axis) => (value + high[axis]) / 2);
    return { low, high, centre, radius: Math.hypot(...low.map((value, axis) => high[axis] - value)) / 2 || 1 };
  }

  meanEdge() {
    let sum = 0;
    for (let e = 0; e < this.numEdges; e++) {
      const a = 3 * this.edges[2 * e], b = 3 * this.edges[2 * e + 1], p = this.positions;
      sum += Math.hypot(p[a] - p[b], p[a + 1] - p[b + 1], p[a + 2] - p[b + 2]);
    }
    return sum / Math.max(1, this.numEdges);
  }
}

// Fans of triangles over the polygons, each from the corner whose smallest triangle is the largest along the area
// vector: right for every planar quad, and the same cut as in torchfair's own pictures.
function triangulate(mesh) {
  const { starts, corners, numFaces } = mesh;
  const count = corners.length - 2 * numFaces;
  const vertices = new Int32Array(3 * count), faces = new Int32Array(3 * count);
  mesh.updateNormals();
  let at = 0;
  for (let f = 0; f < numFaces; f++) {
    const first = starts[f], size = starts[f + 1] - first;
    const from = size > 3 ? bestCorner(mesh, f, first, size) : 0;
    for (let k = 1; k < size - 1; k++) {
      for (const turn of [0, k, k + 1]) {
        vertices[at] = corners[first + (from + turn) % size];
        faces[at++] = f;
      }
    }
  }
  return { vertices, faces };
}

function bestCorner(mesh, f, first, size) {
  let best = 0, largest = -Infinity;
  for (let from = 0; from < size; from++) {
    let least = Infinity;
    for (let k = 1; k < size - 1; k++) {
      const at = (turn) => mesh.corners[first + (from + turn) % size];
      least = Math.min(least, areaAlong(mesh, f, at(0), at(k), at(k + 1)));
    }
    if (least > largest) { largest = least; best = from; }
  }
  return best;
}

function areaAlong({ positions: p, normals: n }, f, a, b, c) {
  const ux = p[3 * b] - p[3 * a], uy = p[3 * b + 1] - p[3 * a + 1], uz = p[3 * b + 2] - p[3 * a + 2];
  const vx = p[3 * c] - p[3 * a], vy = p[3 * c + 1] - p[3 * a + 1], vz = p[3 * c + 2] - p[3 * a + 2];
  return (uy * vz - uz * vy) * n[3 * f] + (uz * vx - ux * vz) * n[3 * f + 1] + (ux * vy - uy * vx) * n[3 * f + 2];
}

// The faces around each vertex: starts (V + 1) into faces.
function facesOfVertices({ starts, corners, numFaces, numVertices }) {
  const owners = new Int32Array(corners.length);
  for (let f = 0; f < numFaces; f++) owners.fill(f, starts[f], starts[f + 1]);
  const { begin, items } = grouped(corners, owners, numVertices);
  return { starts: begin, faces: items };
}

function edgesOfVertices({ edges, numVertices }) {
  const { begin, items } = grouped(edges, Int32Array.from(edges, (_, i) => i >> 1), numVertices);
  return { starts: begin, edges: items };
}

// Items sorted by the number (below count) of the group that each belongs to; begin (count + 1) says where they start.
function grouped(groups, items, count) {
  const begin = new Int32Array(count + 1);
  for (const g of groups) begin[g + 1]++;
  for (let g = 0; g < count; g++) begin[g + 1] += begin[g];
  const next = begin.slice(), sorted = new Int32Array(items.length);
  for (let i = 0; i < items.length; i++) sorted[next[groups[i]]++] = items[i];
  return { begin, items: sorted };
}
