// Scales and sets of colours. The scales go from light to dark in even steps of lightness, as textures for the shaders
// and as colours for legends.

import { DataTexture, LinearFilter, NearestFilter, RGBAFormat } from "./vendor/three/three.module.min.js";

// Fixed colours of a scale, in equal steps (0..255).
const STOPS = {
  fire: [[250, 240, 220], [253, 205, 140], [247, 150, 85], [222, 88, 62], [171, 38, 70], [104, 14, 74], [42, 8, 52]],
  sea: [[236, 245, 243], [184, 224, 214], [122, 196, 194], [66, 158, 180], [38, 114, 160], [34, 70, 126], [22, 30, 74]],
};

// As in torchfair's pictures of star classes.
export const STAR_COLOURS = {
  convex: [140, 184, 235], "good saddle": [92, 191, 140], "bad saddle": [250, 191, 77], neither: [212, 71, 51],
  boundary: [214, 217, 224], isolated: [150, 150, 150],
};
export const CROSSING_COLOUR = [140, 26, 115];

export function scaleColour(name, t) {
  const stops = STOPS[name], at = Math.max(0, Math.min(1, t)) * (stops.length - 1);
  const k = Math.min(stops.length - 2, Math.floor(at)), share = at - k;
  return stops[k].map((value, i) => Math.round(value + share * (stops[k + 1][i] - value)));
}

function texture(colours, filter) {
  const data = new Uint8Array(colours.flatMap((colour) => [...colour, 255]));
  const made = new DataTexture(data, colours.length, 1, RGBAFormat);
  made.minFilter = made.magFilter = filter;
  made.generateMipmaps = false;
  made.needsUpdate = true;
  return made;
}

let made = null;

export function palettes() {
  const scale = (name) => texture(Array.from({ length: 256 }, (_, i) => scaleColour(name, i / 255)), LinearFilter);
  made ??= { fire: scale("fire"), sea: scale("sea"), stars: texture(Object.values(STAR_COLOURS), NearestFilter) };
  return made;
}

export const css = ([r, g, b]) => `rgb(${r} ${g} ${b})`;
