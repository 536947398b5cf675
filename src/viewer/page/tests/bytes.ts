// Messages of the protocol byte by byte, from docs/viewer_protocol.md and not from the page's decoder.

export type Cell = ['u8' | 'u16' | 'u32' | 'f32' | 'f64', number];

const sizes = { u8: 1, u16: 2, u32: 4, f32: 4, f64: 8 };

export function pack(cells: readonly Cell[]): Uint8Array {
  const bytes = new Uint8Array(cells.reduce((sum, [type]) => sum + sizes[type], 0));
  const view = new DataView(bytes.buffer);
  let at = 0;
  for (const [type, value] of cells) {
    if (type === 'u8') view.setUint8(at, value);
    else if (type === 'u16') view.setUint16(at, value, true);
    else if (type === 'u32') view.setUint32(at, value, true);
    else if (type === 'f32') view.setFloat32(at, value, true);
    else view.setFloat64(at, value, true);
    at += sizes[type];
  }
  return bytes;
}

export const u8 = (...values: number[]): Cell[] => values.map((value) => ['u8', value]);
export const u16 = (...values: number[]): Cell[] => values.map((value) => ['u16', value]);
export const u32 = (...values: number[]): Cell[] => values.map((value) => ['u32', value]);
export const f32 = (...values: number[]): Cell[] => values.map((value) => ['f32', value]);
export const f64 = (...values: number[]): Cell[] => values.map((value) => ['f64', value]);

export interface SectionBytes {
  kind: number;
  data: Uint8Array;
}

/** A whole message: header, fixed block, padded sections. */
export function message(
  type: number,
  fixed: Uint8Array,
  sections: readonly SectionBytes[],
  header: { version?: number; number?: number; epoch?: number } = {},
): ArrayBuffer {
  const first = 16 + fixed.length;
  const padded = (bytes: number): number => 4 * Math.ceil(bytes / 4);
  const length = first + sections.reduce((sum, { data }) => sum + 8 + padded(data.length), 0);
  const bytes = new Uint8Array(length);
  bytes.set(
    pack([
      ...u8(type, header.version ?? 2),
      ...u16(first),
      ...u32(length, header.number ?? 1, header.epoch ?? 1),
    ]),
  );
  bytes.set(fixed, 16);
  let at = first;
  for (const { kind, data } of sections) {
    bytes.set(pack(u32(kind, data.length)), at);
    bytes.set(data, at + 8);
    at += 8 + padded(data.length);
  }
  return bytes.buffer;
}

/** The fixed block of a frame after the header; what is left out is zero. */
export function frameBlock(values: {
  time?: number;
  tickTime?: number;
  topology?: number;
  solve?: number;
  vertices?: number;
  state?: number;
  mode?: number;
  pose?: [number, number];
  pieces?: number;
  hand?: number[];
  tip?: number[];
  force?: number[];
  rest?: Cell[]; // from byte 128 on
  torque?: number[]; // on the tool, then on the hand
}): Uint8Array {
  const block = new Uint8Array(272 - 16);
  block.set(
    pack([
      ...f64(values.time ?? 0, values.tickTime ?? 0),
      ...u32(values.topology ?? 1, values.solve ?? 1, values.vertices ?? 0, values.state ?? 0, values.mode ?? 0),
      ...u32(...(values.pose ?? [0, 0]), values.pieces ?? 1),
      ...f32(...(values.hand ?? [0, 0, 0]), ...(values.tip ?? [0, 0, 0])),
      ...f32(0, 0, 0, 1, 0, 0, 1),
      ...f32(...(values.force ?? [0, 0, 0])),
    ]),
  );
  if (values.rest) block.set(pack(values.rest), 128 - 16);
  if (values.torque) block.set(pack(f32(...values.torque)), 248 - 16);
  return block;
}
