// What the mesh is painted with: facets, edges, legend, and what the engine has to measure for it.

import { Paint } from "./facets.js";
import { LineColour } from "./lines.js";
import { palettes } from "./palettes.js";

export const LOOKS = [
  { name: "clay", words: "Shaded", paint: Paint.CLAY },
  { name: "mirror", words: "Mirror", paint: Paint.MIRROR },
  { name: "edges", words: "Edges by l|α|", paint: Paint.CLAY, lines: LineColour.SCALE, scale: "fire" },
  { name: "stars", words: "Stars", paint: Paint.VERTEX_CLASSES, watch: "stars" },
  { name: "principal", words: "Principal edges", paint: Paint.CLAY, lines: LineColour.MARKED },
  { name: "deviation", words: "Deviation", paint: Paint.VERTEX_VALUES, watch: "deviation", scale: "sea" },
  { name: "planarity", words: "Planarity", paint: Paint.FACE_VALUES, watch: "planarity", scale: "sea" },
  { name: "wire", words: "Wire", paint: Paint.FLAT },
];

export const lookOf = (store) => LOOKS.find(({ name }) => name === store.look);

// Paints the scene by the look in the store, with the newest values that the engine measured for it.
export function applyLook({ scene, store }) {
  const look = lookOf(store), measured = look.watch && store.views[look.watch];
  const { uniforms: u, edges, mesh, tables } = scene;
  const missing = look.watch && !measured;
  u.paint.value = missing ? Paint.CLAY : look.paint;
  edges.uniforms.paint.value = look.lines ?? LineColour.INK;
  edges.uniforms.width.value = look.lines === LineColour.SCALE ? 2.2 : look.paint === Paint.FLAT ? 1.4 : 1.1;
  edges.uniforms.opacity.value = look.paint === Paint.FLAT ? 0.95 : look.paint === Paint.MIRROR ? 0.22 : 0.5;
  if (scene.inks) u.ink.value.copy(look.paint === Paint.FLAT ? scene.inks.wire : scene.inks.edge);
  edges.object.visible = store.lines || Boolean(look.lines) || look.paint === Paint.FLAT;
  u.palette.value = look.name === "stars" ? palettes().stars : palettes()[look.scale ?? "fire"];
  scene.gauss.visible = store.sphere;
  if (mesh && measured) {
    const { values } = measured.arrays, { least, most } = measured.legend;
    const table = look.paint === Paint.FACE_VALUES ? tables.faces : tables.vertices;
    if (values.length === table.count) table.setValues(values);
    u.range.value.set(least ?? 0, Math.max(most ?? 1, (least ?? 0) + 1e-12));
  }
  scene.invalidate();
}

// The bytes of l|a| in a frame, on a scale that keeps still while a mesh is pulled: it is set anew where it rests.
export function applyEdgeBytes({ scene, store }, { edgeBytes, scale, rest, jump }) {
  const { edges, mesh } = scene;
  if (rest || jump || !store.edgeLimit) store.put({ edgeLimit: usual(edgeBytes) * scale });
  edges.uniforms.span.value = store.edgeLimit > 0 ? scale / store.edgeLimit : 1;
  if (edgeBytes.length === mesh.numEdges) edges.setBytes("amount", edgeBytes);
}

// The share of a byte's range that 98 % of the edges stay below, or the largest where that is not much more.
function usual(bytes) {
  const counts = new Uint32Array(256);
  for (const b of bytes) counts[b]++;
  let seen = 0, b = 255, largest = 255;
  while (largest > 0 && !counts[largest]) largest--;
  for (; b > 0 && seen + counts[b] <= 0.02 * bytes.length; b--) seen += counts[b];
  return (largest > 1.5 * b && b > 0 ? b : largest || 255) / 255;
}

// Which edges are marked as principal (bit 0 of a label).
export function applyLabels({ scene }, labels) {
  scene.edges.setBytes("mark", labels.map((label) => (label & 1 ? 255 : 0)));
}
