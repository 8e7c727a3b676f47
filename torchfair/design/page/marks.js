// Dots for what is special: handles, held, selected and hovered vertices, crossing pyramids.

import { lookOf } from "./looks.js";

export function applyMarks({ scene, store, handles }) {
  const { mesh, marked } = scene;
  if (!mesh || !marked) return;
  const dots = [], dot = (place, colour, size, opacity) => dots.push({ place, colour, size, opacity });
  const crossings = lookOf(store).name === "stars" && store.views.stars?.arrays.crossings;
  scene.marks.set(crossings ? crossingDots(mesh, crossings, marked.crossing) : []);
  if (!store.before) {
    for (const v of store.held) dot(mesh.point(v), marked.held, 9);
    for (const [v, target] of store.handles) dot(handles.pull?.starts.has(v) ? target : mesh.point(v), marked.accent, 11);
    const size = store.selection.size > 20 ? 9 : 14;
    for (const v of store.selection) dot(handles.place(v), store.held.has(v) ? marked.held : marked.accent, size);
    const { hover } = store;
    if (hover !== null && !store.pulling && hover < mesh.numVertices) dot(mesh.point(hover), marked.hover, 13);
    if (store.hoverFace !== null) for (const v of mesh.faceCorners(store.hoverFace)) dot(mesh.point(v), marked.hover, 7);
  }
  scene.dots.set(dots);
  scene.gauss.light(store.before ? null : store.hover ?? (store.selection.size === 1 ? [...store.selection][0] : null));
  scene.invalidate();
}

function crossingDots(mesh, crossings, colour) {
  const found = [];
  crossings.forEach((count, v) => { if (count && v < mesh.numVertices) found.push({ place: mesh.point(v), colour, size: 7 }); });
  return found;
}
