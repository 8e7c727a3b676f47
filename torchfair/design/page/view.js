// Where the designer looks from: a turntable around a target, seen in perspective or in parallel.

import { Matrix4, OrthographicCamera, PerspectiveCamera, Vector3 } from "./vendor/three/three.module.min.js";
import { add, cross, dot, length, mix, scale, subtract, unit } from "./vectors.js";

const STEEPEST = (89.9 * Math.PI) / 180;

export class View {
  constructor() {
    this.target = [0, 0, 0];
    this.distance = 10;
    this.around = (-60 * Math.PI) / 180;
    this.up = (34 * Math.PI) / 180;
    this.fov = 28;
    this.orthographic = false;
    this.width = this.height = 1;
    this.bounds = { centre: [0, 0, 0], radius: 1 };
    this.perspective = new PerspectiveCamera();
    this.parallel = new OrthographicCamera();
    this.moved = 0; // rises with every change, so that others see that what they know is old
  }

  get camera() { return this.orthographic ? this.parallel : this.perspective; }

  get backward() { // from the target to the eye
    const level = Math.cos(this.up);
    return [level * Math.cos(this.around), level * Math.sin(this.around), Math.sin(this.up)];
  }

  get forward() { return scale(this.backward, -1); }
  get eye() { return add(this.target, scale(this.backward, this.distance)); }
  get right() { return unit(cross(this.forward, [0, 0, 1])); }
  get upward() { return cross(this.right, this.forward); }
  get halfHeight() { return this.distance * Math.tan((this.fov * Math.PI) / 360); } // at the target
  get unitsPerPixel() { return (2 * this.halfHeight) / this.height; }

  resize(width, height) {
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    this.apply();
  }

  apply() {
    const eye = this.eye, half = this.halfHeight, aspect = this.width / this.height;
    const depth = dot(subtract(this.bounds.centre, eye), this.forward), reach = 1.05 * this.bounds.radius;
    const far = Math.max(depth + reach, 1e-6) * 1.5 + reach;
    const { perspective: p, parallel: o } = this;
    p.fov = this.fov;
    p.aspect = aspect;
    p.near = Math.max(depth - reach, 2e-3 * this.distance, 1e-4 * far);
    p.far = far;
    o.top = half; o.bottom = -half; o.right = half * aspect; o.left = -o.right;
    o.near = depth - 2 * reach;
    o.far = far;
    for (const camera of [p, o]) {
      camera.up.set(0, 0, 1);
      camera.position.set(...eye);
      camera.lookAt(...this.target);
      camera.updateProjectionMatrix();
      camera.updateMatrixWorld();
    }
    this.toClip = new Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
    this.moved++;
  }

  // Pixel coordinates and depth (0..1 between near and far) of a point; behind the eye: depth over 1.
  project(point) {
    const e = this.toClip.elements, [x, y, z] = point;
    const w = e[3] * x + e[7] * y + e[11] * z + e[15];
    const across = (e[0] * x + e[4] * y + e[8] * z + e[12]) / w, down = (e[1] * x + e[5] * y + e[9] * z + e[13]) / w;
    const depth = (e[2] * x + e[6] * y + e[10] * z + e[14]) / w;
    return [((across + 1) / 2) * this.width, ((1 - down) / 2) * this.height, w > 0 ? (depth + 1) / 2 : 2];
  }

  ray(x, y) {
    const across = (2 * x) / this.width - 1, up = 1 - (2 * y) / this.height;
    const far = new Vector3(across, up, 0.5).unproject(this.camera).toArray();
    if (!this.orthographic) return { origin: this.eye, direction: unit(subtract(far, this.eye)) };
    return { origin: far, direction: this.forward };
  }

  orbit(dx, dy) { // in pixels
    this.around -= dx * 0.006;
    this.up = Math.max(-STEEPEST, Math.min(STEEPEST, this.up + dy * 0.006));
    this.apply();
  }

  pan(dx, dy) {
    const k = this.unitsPerPixel;
    this.target = add(this.target, add(scale(this.right, -dx * k), scale(this.upward, dy * k)));
    this.apply();
  }

  // Scales the picture around a place in it.
  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const least = 1e-3 * this.bounds.radius, most = 60 * this.bounds.radius;
    const distance = Math.max(least, Math.min(most, this.distance * factor));
    const k = this.unitsPerPixel * (1 - distance / this.distance);
    const across = scale(this.right, (x - this.width / 2) * k), up = scale(this.upward, (this.height / 2 - y) * k);
    this.target = add(this.target, add(across, up));
    this.distance = distance;
    this.apply();
  }

  // The distance from which a ball of this radius fills the smaller side of the picture.
  distanceFor(radius) {
    const half = Math.tan((this.fov * Math.PI) / 360) * Math.min(1, this.width / this.height);
    return radius / Math.sin(Math.atan(half));
  }

  // Target and distance from which all points are seen with some margin along the present line of sight.
  fit(positions, margin = 0.07) {
    const { right, upward, forward, target } = this, slope = Math.tan((this.fov * Math.PI) / 360) * (1 - 2 * margin);
    const along = (axis, i) => axis[0] * (positions[i] - target[0]) + axis[1] * (positions[i + 1] - target[1])
      + axis[2] * (positions[i + 2] - target[2]);
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (let i = 0; i < positions.length; i += 3) {
      [right, upward].forEach((axis, k) => {
        const value = along(axis, i);
        low[k] = Math.min(low[k], value);
        high[k] = Math.max(high[k], value);
      });
    }
    const [x, y] = [0, 1].map((k) => (low[k] + high[k]) / 2), tall = slope, wide = (slope * this.width) / this.height;
    let distance = 1e-6 * this.bounds.radius;
    for (let i = 0; i < positions.length; i += 3) {
      const reach = Math.max(Math.abs(along(right, i) - x) / wide, Math.abs(along(upward, i) - y) / tall);
      distance = Math.max(distance, this.orthographic ? reach : reach - along(forward, i));
    }
    return { target: add(target, add(scale(right, x), scale(upward, y))), distance };
  }

  get state() {
    return { target: this.target, distance: this.distance, around: this.around, up: this.up };
  }

  setState(state) {
    Object.assign(this, state);
    this.apply();
  }

  // The turn from one state to another, the short way round.
  static between(a, b, t) {
    const turn = ((((b.around - a.around) % (2 * Math.PI)) + 3 * Math.PI) % (2 * Math.PI)) - Math.PI;
    return {
      target: mix(a.target, b.target, t),
      distance: a.distance * (b.distance / a.distance) ** t,
      around: a.around + turn * t,
      up: a.up + (b.up - a.up) * t,
    };
  }

  // For the session file, in the unit and place of the input.
  toJSON(origin) {
    const { fov, orthographic } = this;
    return { position: add(this.eye, origin), target: add(this.target, origin), up: [0, 0, 1], fov, orthographic };
  }

  fromJSON({ position, target, fov, orthographic }, origin) {
    const back = subtract(position, target), distance = length(back) || 1;
    this.fov = Math.min(120, Math.max(1, fov));
    this.orthographic = Boolean(orthographic);
    this.setState({
      target: subtract(target, origin),
      distance,
      around: Math.atan2(back[1], back[0]),
      up: Math.max(-STEEPEST, Math.min(STEEPEST, Math.asin(back[2] / distance))),
    });
  }
}
