// Checks of the functions of the page that need no browser; run by test_vendored.py.

import assert from "node:assert/strict";
import { decode, decodeContainer, encodeContainer } from "./protocol.js";
import { number } from "./format.js";
import { Mesh } from "./mesh.js";
import { stripeDirection } from "./mirror.js";
import { within } from "./selection.js";
import { Store } from "./store.js";
import { rayLine, rayPlane } from "./vectors.js";
import { View } from "./view.js";

let count = 0;
const check = (act) => { act(); count++; };
const near = (a, b, room = 1e-6) => a.forEach((x, i) => assert.ok(Math.abs(x - b[i]) <= room, `${a} is not ${b}`));

check(() => { // bytes there and back, whatever their number
  for (const size of [0, 1, 7, 8, 9]) {
    const bytes = Uint8Array.from({ length: size }, (_, i) => i + 1);
    const message = decodeContainer(encodeContainer({ type: "upload", name: "ä.obj" }, "bytes", bytes));
    assert.equal(message.name, "ä.obj");
    assert.deepEqual([...message.arrays.bytes], [...bytes]);
  }
});

check(() => { // a frame of two vertices and one edge, built by hand
  const buffer = new ArrayBuffer(24 + 24 + 1), view = new DataView(buffer);
  view.setUint8(0, 1);
  view.setUint8(1, 6);
  view.setUint16(2, 513, true);
  view.setUint32(4, 9, true);
  view.setUint32(8, 3, true);
  view.setUint32(12, 2, true);
  view.setUint32(16, 1, true);
  view.setFloat32(20, 0.5, true);
  view.setFloat32(24 + 20, -2.5, true);
  view.setUint8(48, 200);
  const frame = decode(buffer);
  assert.deepEqual([frame.dragging, frame.rest, frame.jump, frame.count, frame.frame, frame.topology, frame.scale],
    [false, true, true, 513, 9, 3, 0.5]);
  assert.equal(frame.positions[5], -2.5);
  assert.equal(frame.edgeBytes[0], 200);
  assert.throws(() => decode(buffer.slice(0, 40)), /cut short/);
});

check(() => { // a quad whose cut must avoid its reflex corner, and a triangle beside it
  const positions = new Float32Array([0, 0, 0, 4, 0, 0, 1, 1, 0, 0, 4, 0, 5, 5, 0]);
  const mesh = new Mesh({
    starts: [0, 4, 7], corners: new Uint32Array([0, 1, 2, 3, 1, 4, 2]), positions,
    edges: new Uint32Array([0, 1, 1, 2, 2, 3, 3, 0, 1, 4, 4, 2]),
    edgeFaces: new Int32Array([0, -1, 0, 1, 0, -1, 0, -1, 1, -1, 1, -1]) });
  near([...mesh.normals], [0, 0, 1, 0, 0, 1]);
  const cut = [...mesh.triangles.vertices.slice(0, 6)];
  assert.ok(cut.filter((v) => v === 0).length === 2 && cut.filter((v) => v === 2).length === 2);
  assert.deepEqual([...mesh.starFaces(2)].sort(), [0, 1]);
  assert.deepEqual([...mesh.starEdges(2)].sort(), [1, 2, 5]);
  near(mesh.faceCentre(0), [1.25, 1.25, 0]);
});

check(() => { // a ray meets planes and lines where it should
  const ray = { origin: [1, 2, 10], direction: [0, 0, -1] };
  near(rayPlane(ray, [0, 0, 3], [0, 0, 1]), [1, 2, 3]);
  assert.equal(rayPlane(ray, [0, 0, 3], [1, 0, 0]), null);
  near(rayLine(ray, [0, 0, 5], [1, 0, 0]), [1, 0, 5]);
  assert.equal(rayLine(ray, [0, 0, 5], [0, 0, 1]), null);
});

check(() => { // the ray through where a point is seen goes through that point, in both kinds of view
  const view = new View();
  view.bounds = { centre: [0, 0, 0], radius: 3 };
  view.resize(800, 500);
  for (const orthographic of [false, true]) {
    view.orthographic = orthographic;
    view.apply();
    const point = [0.7, -1.1, 0.4], [x, y] = view.project(point);
    near(rayPlane(view.ray(x, y), point, view.forward), point, 1e-4);
    const back = view.toJSON([5, 6, 7]), other = new View();
    other.bounds = view.bounds;
    other.resize(800, 500);
    other.fromJSON(back, [5, 6, 7]);
    near(other.project(point), view.project(point), 1e-3);
    const before = view.project(point);
    view.zoom(0.5, x, y); // what is under the pointer and as far as the target stays there
    const after = view.project(point);
    assert.ok(Math.hypot(after[0] - before[0], after[1] - before[1]) < (orthographic ? 1e-3 : 150));
    view.zoom(2, x, y);
  }
  near(view.project(view.target).slice(0, 2), [400, 250], 1e-3);
});

check(() => { // what fits is inside the picture and fills it
  const view = new View(), points = new Float32Array([0, 0, 0, 10, 0, 0, 0, 3, 0, 2, 2, 4]);
  view.bounds = { centre: [3, 1, 1], radius: 6 };
  view.resize(700, 400);
  view.setState({ target: view.bounds.centre });
  view.setState(view.fit(points));
  const seen = [0, 3, 6, 9].map((i) => view.project([...points.slice(i, i + 3)]));
  assert.ok(seen.every(([x, y]) => x > 0 && x < 700 && y > 0 && y < 400));
  const wide = Math.max(...seen.map(([x]) => x)) - Math.min(...seen.map(([x]) => x));
  const tall = Math.max(...seen.map(([, y]) => y)) - Math.min(...seen.map(([, y]) => y));
  assert.ok(wide > 0.6 * 700 || tall > 0.6 * 400);
});

check(() => { // inside and outside of a polygon that is not convex
  const polygon = [[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]];
  assert.deepEqual([[1, 1], [2, 3], [3.5, 2], [5, 1]].map(([x, y]) => within(polygon, x, y)), [true, false, true, false]);
});

check(() => { // numbers as people read them
  assert.deepEqual([0, 12.3456, -0.5, 123456.7, 1e-5, null, NaN].map(number),
    ["0.0000", "12.35", "−0.5000", "123457", "1.00e−5", "–", "–"]);
  near(stripeDirection(90, 0), [0, 1, 0]);
  near(stripeDirection(0, 90), [0, 0, 1]);
});

await new Promise((done) => { // listeners hear of changes once
  const store = new Store({ a: 1, b: 2, c: 3 });
  let calls = 0;
  store.on("a b", () => { calls++; });
  store.on("c", () => assert.fail("c has not changed"));
  store.put({ a: 5 });
  store.put({ b: 6 });
  queueMicrotask(() => queueMicrotask(() => { assert.equal(calls, 1); count++; done(); }));
});

console.log(`${count} checks`);
