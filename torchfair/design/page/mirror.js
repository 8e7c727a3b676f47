// What facets mirror, in GLSL: the same functions of a direction as torchfair.reflection.Stripes, Checker and
// EquirectangularImage, and a painted studio.

export const SURROUNDINGS = ["stripes", "checker", "studio", "image"];

export const MIRROR = `
uniform int surroundings;        // number in SURROUNDINGS
uniform vec3 stripeDirection;    // unit, across the stripes
uniform float frequency, sharpness;
uniform sampler2D panorama;      // row 0 around +z, the middle column along +x
uniform vec3 dark, light;        // colours of 0 and 1
uniform mat3 room;               // from the world into the surroundings
uniform vec3 mirrorEye, mirrorForward;
uniform bool mirrorCentral;

const float TURN = 6.283185307179586;

float soft(float wave) { return 0.5 + 0.5 * tanh(sharpness * wave); }

float stripes(vec3 r) { return soft(sin(TURN * frequency * dot(stripeDirection, r))); }

float checker(vec3 r) {
  vec3 waves = sin(TURN * frequency * r);
  return soft(2.0 * waves.x * waves.y * waves.z);
}

vec3 imageAt(vec3 r) {
  float across = 0.5 - atan(r.y, r.x) / TURN, down = atan(length(r.xy), r.z) / (0.5 * TURN);
  return textureLod(panorama, vec2(across, down), 0.0).rgb;
}

float lamp(vec3 r, vec3 towards, vec2 size) {
  vec3 side = normalize(cross(vec3(0.0, 0.0, 1.0), towards)), up = cross(towards, side);
  vec2 place = vec2(dot(r, side), dot(r, up)) / max(dot(r, towards), 1e-3);
  vec2 inside = smoothstep(size, size - 0.06, abs(place));
  return dot(r, towards) > 0.0 ? inside.x * inside.y : 0.0;
}

vec3 studio(vec3 r) {
  vec3 sky = mix(vec3(0.62, 0.70, 0.80), vec3(0.20, 0.30, 0.44), smoothstep(0.0, 0.9, r.z));
  vec3 floor = mix(vec3(0.36, 0.35, 0.34), vec3(0.16, 0.16, 0.17), smoothstep(0.0, -0.7, r.z));
  vec3 colour = mix(floor, sky, smoothstep(-0.02, 0.02, r.z));
  float lamps = lamp(r, normalize(vec3(1.0, 0.6, 0.9)), vec2(0.5, 0.22))
    + lamp(r, normalize(vec3(-0.9, 0.8, 0.6)), vec2(0.16, 0.7)) + lamp(r, normalize(vec3(-0.2, -1.0, 0.8)), vec2(0.8, 0.1))
    + lamp(r, normalize(vec3(0.05, 0.03, 1.0)), vec2(0.24, 0.24));
  return mix(colour, vec3(1.0, 0.99, 0.96), min(lamps, 1.0));
}

vec3 mirrored(vec3 place, vec3 normal) {
  vec3 sight = mirrorCentral ? normalize(place - mirrorEye) : mirrorForward;
  vec3 r = room * (sight - 2.0 * dot(sight, normal) * normal);
  if (surroundings == 0) return mix(dark, light, stripes(r));
  if (surroundings == 1) return mix(dark, light, checker(r));
  if (surroundings == 2) return studio(r);
  return imageAt(r);
}
`;

// Unit vector across the stripes from two angles in degrees: around z from x, and up from the horizontal.
export function stripeDirection(around, up) {
  const a = (around * Math.PI) / 180, b = (up * Math.PI) / 180;
  return [Math.cos(b) * Math.cos(a), Math.cos(b) * Math.sin(a), Math.sin(b)];
}
