// The corner of the picture in which the Gauss image is: what the pointer means there.

export class Corner {
  constructor({ scene, flights }) {
    Object.assign(this, { scene, flights });
  }

  place(x, y) {
    const { gauss, view } = this.scene, [left, low] = gauss.corner;
    return [x - left, y - (view.height - low - gauss.size)];
  }

  contains(x, y) {
    const { gauss, mesh } = this.scene, [dx, dy] = this.place(x, y), r = gauss.size / 2;
    return Boolean(mesh) && gauss.visible && Math.hypot(dx - r, dy - r) < r;
  }

  faceAt(x, y) { return this.scene.gauss.faceAt(...this.place(x, y), this.scene.view); }

  click(x, y) {
    const face = this.faceAt(x, y);
    if (face !== null) this.flights.toPlace(this.scene.mesh.faceCentre(face), 8 * this.scene.mesh.meanEdge());
  }
}
