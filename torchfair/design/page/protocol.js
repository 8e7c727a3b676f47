// The words of the socket: containers and frames to and from bytes. Pure functions, no socket.

const KINDS = { u8: Uint8Array, u32: Uint32Array, i32: Int32Array, f32: Float32Array, f64: Float64Array };
const FRAME = 1, CONTAINER = 2;
const up8 = (n) => (n + 7) & ~7;

export const PROTOCOL = 1;
export const Flags = { DRAGGING: 1, REST: 2, JUMP: 4 };

// A message of the server as an object with `type`, whatever it came in.
export function decode(data) {
  if (typeof data === "string") return JSON.parse(data);
  const kind = new DataView(data).getUint8(0);
  if (kind === FRAME) return decodeFrame(data);
  if (kind === CONTAINER) return decodeContainer(data);
  throw new Error(`unknown kind of message: ${kind}`);
}

export function decodeFrame(buffer) {
  const view = new DataView(buffer);
  const vertices = view.getUint32(12, true), edges = view.getUint32(16, true);
  if (buffer.byteLength < 24 + 12 * vertices + edges) throw new Error("a frame was cut short");
  const flags = view.getUint8(1);
  return {
    type: "frame",
    dragging: Boolean(flags & Flags.DRAGGING),
    rest: Boolean(flags & Flags.REST),
    jump: Boolean(flags & Flags.JUMP),
    count: view.getUint16(2, true),
    frame: view.getUint32(4, true),
    topology: view.getUint32(8, true),
    scale: view.getFloat32(20, true),
    positions: new Float32Array(buffer, 24, 3 * vertices),
    edgeBytes: new Uint8Array(buffer, 24 + 12 * vertices, edges),
  };
}

export function decodeContainer(buffer) {
  const size = new DataView(buffer).getUint32(4, true);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, size)));
  const arrays = {};
  let at = 8 + size;
  for (const { name, dtype, length } of message.arrays) {
    arrays[name] = new KINDS[dtype](buffer, at, length);
    at += up8(length * KINDS[dtype].BYTES_PER_ELEMENT);
  }
  return { ...message, arrays };
}

// One array of bytes with its message, for uploads.
export function encodeContainer(message, name, bytes) {
  const described = { ...message, arrays: [{ name, dtype: "u8", length: bytes.length }] };
  const text = new TextEncoder().encode(JSON.stringify(described));
  const start = up8(8 + text.length);
  const buffer = new ArrayBuffer(up8(start + bytes.length));
  const all = new Uint8Array(buffer).fill(32, 8, start);
  new DataView(buffer).setUint8(0, CONTAINER);
  new DataView(buffer).setUint32(4, start - 8, true);
  all.set(text, 8);
  all.set(bytes, start);
  return buffer;
}
