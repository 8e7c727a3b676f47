// Arithmetic of points and directions, [x, y, z].

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => scale(a, 1 / (length(a) || 1));
export const mix = (a, b, t) => [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])];

// Where a ray meets the plane through a point; null where it is parallel or the plane lies behind.
export function rayPlane({ origin, direction }, point, normal) {
  const slope = dot(direction, normal);
  const t = dot(subtract(point, origin), normal) / slope;
  return Math.abs(slope) > 1e-9 && Number.isFinite(t) ? add(origin, scale(direction, t)) : null;
}

// The point of a line (through a point along a unit axis) closest to a ray; null where they are nearly parallel.
export function rayLine({ origin, direction }, point, axis) {
  const between = subtract(origin, point), cosine = dot(direction, axis);
  const sine2 = 1 - cosine * cosine;
  if (sine2 < 1e-4) return null;
  return add(point, scale(axis, (dot(between, axis) - cosine * dot(between, direction)) / sine2));
}
