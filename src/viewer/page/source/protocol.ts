// Messages between `spherecut serve` and this page: docs/viewer_protocol.md, version 2. Lengths m, forces N, torques
// N m, stresses Pa, times s. Binary messages are little-endian; decoding makes views into the message wherever it can.

export const protocolVersion = 2;

export type Mode = 'probe' | 'blade' | 'grasper';
export const modes: readonly Mode[] = ['probe', 'blade', 'grasper'];
export type Vec3 = [number, number, number];
export type Quaternion = [number, number, number, number];
export type Colour = 'none' | 'displacement' | 'von_mises';

// --- JSON -------------------------------------------------------------------------------------------------------------

export interface Recording {
  name: string;
  bytes: number;
  url: string;
}

export interface Welcome {
  type: 'welcome';
  version: number;
  id: number;
  server: string;
  scenarios: { name: string; title: string }[];
  scenarios_left_out: number;
  recordings: Recording[];
  recordings_left_out: number;
  limits: {
    message_bytes: number;
    messages_per_second: number;
    bytes_per_second: number;
    credit: number;
    viewers: number;
    speed: number;
  };
}

export type ToolShape =
  | { shape: 'sphere'; radius: number }
  | { shape: 'punch'; radius: number; length: number }
  | { shape: 'laparoscope'; radius: number; shaft_radius: number; shaft_length: number; port: Vec3 };

export interface Settings {
  young_modulus: number;
  poisson_ratio: number;
  toughness: number;
  method: string;
  sight: string;
  fine_spacing: number;
  coarse_spacing: number;
}

export interface SessionStart {
  type: 'session';
  epoch: number;
  scenario: string;
  title: string;
  bounds: { lower: Vec3; upper: Vec3 };
  triangles: number;
  nodes: number;
  modes: Mode[];
  mode: Mode;
  tool: ToolShape | null;
  blade: { edge: Vec3[] } | null;
  two_hands: boolean; // there is a tool and a blade, one for each hand
  park: Partial<Record<Mode, Vec3>>;
  spring: number;
  settings: Settings;
}

/** What the tears of the session are at. */
export interface Tear {
  type: 'tear';
  state: 'none' | 'intact' | 'growing' | 'unstable' | 'arrested' | 'refused' | 'severed';
  text: string; // why it does not grow
  area: number; // m2 torn
}

export type ServerText =
  | Welcome
  | SessionStart
  | { type: 'holder'; id: number | null }
  | { type: 'mode'; mode: Mode }
  | { type: 'second'; on: boolean } // the second hand has the blade
  | { type: 'building'; what: string }
  | { type: 'error'; code: string; text: string; about?: string }
  | { type: 'log'; level: string; text: string }
  | Tear
  | { type: 'recording'; on: boolean; name: string; seconds: number; bytes: number; url: string }
  | { type: 'replay'; name: string | null; on: boolean };

export interface SliceRequest {
  point: Vec3;
  normal: Vec3;
  size: number;
  count: number;
}

export interface Overlays {
  colour?: Colour;
  nodes?: boolean;
  pick?: number | Vec3 | null;
  slice?: SliceRequest | null;
  stages?: boolean;
}

export type ClientText =
  | { type: 'hello'; version: number }
  | { type: 'credit'; frames: number }
  | { type: 'take' }
  | { type: 'release' }
  | { type: 'mode'; mode: Mode }
  | { type: 'pose'; n: number; hand?: 1 | 2; position: Vec3; orientation?: Quaternion }
  | { type: 'park'; hand?: 1 | 2 }
  | { type: 'second'; on: boolean }
  | { type: 'grip'; closed: boolean }
  | { type: 'reset' }
  | { type: 'scenario'; name: string }
  | ({ type: 'set' } & Partial<Settings>)
  | ({ type: 'overlays' } & Overlays)
  | { type: 'record'; on: boolean }
  | { type: 'replay'; name: string | null };

const textTypes = ['welcome', 'session', 'holder', 'mode', 'second', 'building', 'error', 'log', 'tear', 'recording', 'replay'];

/** A text message; null: of a type this page does not know. Throws ProtocolError when it is not a JSON object with a type. */
export function decodeText(text: string): ServerText | null {
  let value: unknown;
  try {
    value = JSON.parse(text);
  } catch {
    throw new ProtocolError('a text message is not JSON');
  }
  if (typeof value !== 'object' || value === null || typeof (value as { type?: unknown }).type !== 'string') {
    throw new ProtocolError('a text message has no type');
  }
  return textTypes.includes((value as { type: string }).type) ? (value as ServerText) : null;
}

// --- binary -----------------------------------------------------------------------------------------------------------

/** A message that does not keep to the protocol, in words. */
export class ProtocolError extends Error {}

export const Tag = { surface: 0, lip: 1, wall: 2, front: 3 } as const;
export const Part = { organ: 0, wallPlus: 1, wallMinus: 2 } as const;

/** Bits of Frame.state. */
export const State = {
  contact: 1,
  recording: 2,
  replay: 4,
  held: 8,
  cutting: 16,
  failed: 32,
  building: 64,
  limited: 128,
  realtime: 256,
} as const;

interface Header {
  number: number;
  epoch: number;
}

export interface Topology extends Header {
  kind: 'topology';
  topology: number;
  vertexCount: number;
  triangleCount: number;
  pieceCount: number;
  rest: Float32Array; // 3 a vertex, m
  triangles: Uint32Array; // 3 a triangle
  tags: Uint8Array; // Tag of each vertex
  parts: Uint8Array; // Part of each triangle
  pieces: Uint16Array; // of each triangle
  partners: Uint32Array; // pairs of vertices that were one before the cut: + side, - side
}

export interface Scalars {
  quantity: 'displacement' | 'von_mises';
  low: number;
  high: number;
  values: Float32Array; // of each vertex
}

export interface Nodes {
  count: number;
  spheres: Float32Array; // 4 a node: position and radius of the support, m
  kinds: Uint8Array; // 0 interior, 1 surface, 2 edge, 3 lip
}

export interface Support {
  node: number;
  position: Float32Array;
  radius: number;
  seen: Uint32Array;
  hidden: Uint32Array;
}

export interface Slice {
  count: number;
  origin: Float32Array;
  first: Float32Array;
  second: Float32Array;
  organ: Float32Array; // count * count, row by row along `second`, m
  cut: Float32Array;
}

/** The blade in the second hand. */
export interface SecondHand {
  poseInTick: number;
  poseInSolve: number;
  hand: Vec3;
  tip: Vec3;
  orientation: Quaternion;
  force: Vec3; // of the tissue on the blade
  handForce: Vec3;
  torque: Vec3; // likewise, about the origin of the blade's frame
  handTorque: Vec3;
  depth: number; // m below the surface at rest; negative: clearance
  work: number; // J, of that hand
}

export interface Frame extends Header {
  kind: 'frame';
  time: number;
  tickTime: number;
  topology: number;
  solve: number;
  vertexCount: number;
  state: number;
  mode: Mode;
  poseInTick: number;
  poseInSolve: number;
  pieceCount: number;
  hand: Vec3;
  tip: Vec3;
  orientation: Quaternion;
  axis: Vec3;
  force: Vec3; // of the tissue on the tool
  handForce: Vec3;
  torque: Vec3; // of the tissue on the tool, about its reference point
  handTorque: Vec3;
  contact: Vec3;
  normal: Vec3;
  depth: number; // m below the surface at rest; negative: clearance
  contactRadius: number;
  active: number;
  nodeCount: number;
  level: number;
  hapticRate: number;
  solveRate: number;
  pictureRate: number;
  tickSeconds: number;
  ticks: number;
  misses: number;
  worstWake: number;
  solveSeconds: number;
  cutArea: number;
  frontLength: number;
  opening: number;
  openingVolume: number;
  work: number;
  largestDisplacement: number;
  leftOut: number;
  vertices: Float32Array | null;
  scalars: Scalars | null;
  nodes: Nodes | null;
  support: Support | null;
  slice: Slice | null;
  volumes: Float32Array | null;
  stages: Float32Array | null;
  second: SecondHand | null; // null: the second hand holds nothing
}

/** What the eight numbers of Frame.stages are the time of. */
export const stageNames = [
  'contact and lips',
  'nodes',
  'assembly',
  'condensation',
  'cut',
  'level sets',
  'evaluation',
  'pictures',
] as const;

const headerBytes = 16;
const topologyBytes = 32;
const frameBytes = 272;

/** Decodes one binary message; null: of a type this page does not know. Throws ProtocolError. */
export function decodeBinary(data: ArrayBuffer): Topology | Frame | null {
  if (data.byteLength < headerBytes) {
    throw new ProtocolError(`a message of ${data.byteLength} bytes is shorter than its header`);
  }
  const view = new DataView(data);
  const type = view.getUint8(0);
  const version = view.getUint8(1);
  if (version !== protocolVersion) {
    throw new ProtocolError(`a message of protocol version ${version}; this page knows ${protocolVersion}`);
  }
  const length = view.getUint32(4, true);
  if (length !== data.byteLength) {
    throw new ProtocolError(`a message of ${data.byteLength} bytes says that it has ${length}`);
  }
  if (type === 1) return decodeTopology(data, view, sections(data, view, topologyBytes));
  if (type === 2) return decodeFrame(data, view, sections(data, view, frameBytes));
  return null;
}

interface Section {
  offset: number; // of its data
  bytes: number;
}

/** Where the data of each section lie, by kind. The fixed block has at least `fixed` bytes. */
function sections(data: ArrayBuffer, view: DataView, fixed: number): Map<number, Section> {
  let at = view.getUint16(2, true);
  if (at < fixed || at % 4 !== 0 || at > data.byteLength) {
    throw new ProtocolError(`the first section is at byte ${at} of ${data.byteLength}, after a block of ${fixed}`);
  }
  const found = new Map<number, Section>();
  while (at < data.byteLength) {
    if (at + 8 > data.byteLength) throw new ProtocolError(`a section at byte ${at} ends before its length`);
    const kind = view.getUint32(at, true);
    const bytes = view.getUint32(at + 4, true);
    const offset = at + 8;
    const end = offset + bytes;
    if (end > data.byteLength) {
      throw new ProtocolError(`section ${kind} at byte ${at} has ${bytes} bytes, past the end of the message`);
    }
    if (found.has(kind)) throw new ProtocolError(`section ${kind} comes twice`);
    found.set(kind, { offset, bytes });
    at = end + ((4 - (bytes % 4)) % 4);
  }
  return found;
}

function expectBytes(kind: number, section: Section, bytes: number): void {
  if (section.bytes !== bytes) throw new ProtocolError(`section ${kind} has ${section.bytes} bytes instead of ${bytes}`);
}

function floats(data: ArrayBuffer, kind: number, section: Section, count: number): Float32Array {
  expectBytes(kind, section, 4 * count);
  return new Float32Array(data, section.offset, count);
}

function required(found: Map<number, Section>, kind: number): Section {
  const section = found.get(kind);
  if (!section) throw new ProtocolError(`section ${kind} is missing`);
  return section;
}

function expectBelow(indices: Uint32Array, limit: number, what: string): void {
  let largest = 0;
  for (const index of indices) if (index > largest) largest = index;
  if (indices.length > 0 && largest >= limit) throw new ProtocolError(`${what} ${largest} of ${limit}`);
}

function decodeTopology(data: ArrayBuffer, view: DataView, found: Map<number, Section>): Topology {
  const vertexCount = view.getUint32(20, true);
  const triangleCount = view.getUint32(24, true);
  const triangles = required(found, 2);
  expectBytes(2, triangles, 12 * triangleCount);
  const tags = required(found, 3);
  expectBytes(3, tags, vertexCount);
  const parts = required(found, 4);
  expectBytes(4, parts, triangleCount);
  const pieces = required(found, 5);
  expectBytes(5, pieces, 2 * triangleCount);
  const partners = required(found, 6);
  if (partners.bytes % 8 !== 0) throw new ProtocolError(`section 6 has ${partners.bytes} bytes, not whole pairs`);
  const topology: Topology = {
    kind: 'topology',
    number: view.getUint32(8, true),
    epoch: view.getUint32(12, true),
    topology: view.getUint32(16, true),
    vertexCount,
    triangleCount,
    pieceCount: view.getUint32(28, true),
    rest: floats(data, 1, required(found, 1), 3 * vertexCount),
    triangles: new Uint32Array(data, triangles.offset, 3 * triangleCount),
    tags: new Uint8Array(data, tags.offset, vertexCount),
    parts: new Uint8Array(data, parts.offset, triangleCount),
    pieces: new Uint16Array(data, pieces.offset, triangleCount),
    partners: new Uint32Array(data, partners.offset, partners.bytes / 4),
  };
  expectBelow(topology.triangles, vertexCount, 'a triangle has vertex');
  expectBelow(topology.partners, vertexCount, 'a pair has vertex');
  return topology;
}

function decodeFrame(data: ArrayBuffer, view: DataView, found: Map<number, Section>): Frame {
  const u32 = (at: number): number => view.getUint32(at, true);
  const f32 = (at: number): number => view.getFloat32(at, true);
  const vec = (at: number): Vec3 => [f32(at), f32(at + 4), f32(at + 8)];
  const vertexCount = u32(40);
  const mode = modes[u32(48)];
  if (mode === undefined) throw new ProtocolError(`mode ${u32(48)} is none of 0, 1, 2`);
  const vertices = found.get(16);
  const volumes = found.get(21);
  const stages = found.get(22);
  const pieceCount = u32(60);
  return {
    kind: 'frame',
    number: u32(8),
    epoch: u32(12),
    time: view.getFloat64(16, true),
    tickTime: view.getFloat64(24, true),
    topology: u32(32),
    solve: u32(36),
    vertexCount,
    state: u32(44),
    mode,
    poseInTick: u32(52),
    poseInSolve: u32(56),
    pieceCount,
    hand: vec(64),
    tip: vec(76),
    orientation: [f32(88), f32(92), f32(96), f32(100)],
    axis: vec(104),
    force: vec(116),
    handForce: vec(128),
    torque: vec(248),
    handTorque: vec(260),
    contact: vec(140),
    normal: vec(152),
    depth: f32(164),
    contactRadius: f32(168),
    active: u32(172),
    nodeCount: u32(176),
    level: u32(180),
    hapticRate: f32(184),
    solveRate: f32(188),
    pictureRate: f32(192),
    tickSeconds: f32(196),
    ticks: u32(200),
    misses: u32(204),
    worstWake: f32(208),
    solveSeconds: f32(212),
    cutArea: f32(216),
    frontLength: f32(220),
    opening: f32(224),
    openingVolume: f32(228),
    work: f32(232),
    largestDisplacement: f32(236),
    leftOut: u32(240),
    vertices: vertices ? floats(data, 16, vertices, 3 * vertexCount) : null,
    scalars: decodeScalars(data, view, found.get(17), vertexCount),
    nodes: decodeNodes(data, view, found.get(18)),
    support: decodeSupport(data, view, found.get(19)),
    slice: decodeSlice(data, view, found.get(20)),
    volumes: volumes ? floats(data, 21, volumes, pieceCount) : null,
    stages: stages ? floats(data, 22, stages, stageNames.length) : null,
    second: decodeSecond(view, found.get(23)),
  };
}

function decodeSecond(view: DataView, section: Section | undefined): SecondHand | null {
  if (!section) return null;
  expectBytes(23, section, 104);
  const at = section.offset;
  const f32 = (offset: number): number => view.getFloat32(at + offset, true);
  const vec = (offset: number): Vec3 => [f32(offset), f32(offset + 4), f32(offset + 8)];
  return {
    poseInTick: view.getUint32(at, true),
    poseInSolve: view.getUint32(at + 4, true),
    hand: vec(8),
    tip: vec(20),
    orientation: [f32(32), f32(36), f32(40), f32(44)],
    force: vec(48),
    handForce: vec(60),
    torque: vec(72),
    handTorque: vec(84),
    depth: f32(96),
    work: f32(100),
  };
}

function expectAtLeast(kind: number, section: Section, bytes: number): void {
  if (section.bytes < bytes) throw new ProtocolError(`section ${kind} has ${section.bytes} bytes, fewer than ${bytes}`);
}

function decodeScalars(data: ArrayBuffer, view: DataView, section: Section | undefined, vertexCount: number): Scalars | null {
  if (!section) return null;
  expectBytes(17, section, 12 + 4 * vertexCount);
  const quantity = view.getUint32(section.offset, true);
  if (quantity !== 1 && quantity !== 2) throw new ProtocolError(`quantity ${quantity} is neither 1 nor 2`);
  return {
    quantity: quantity === 1 ? 'displacement' : 'von_mises',
    low: view.getFloat32(section.offset + 4, true),
    high: view.getFloat32(section.offset + 8, true),
    values: new Float32Array(data, section.offset + 12, vertexCount),
  };
}

function decodeNodes(data: ArrayBuffer, view: DataView, section: Section | undefined): Nodes | null {
  if (!section) return null;
  expectAtLeast(18, section, 4);
  const count = view.getUint32(section.offset, true);
  expectBytes(18, section, 4 + 17 * count);
  return {
    count,
    spheres: new Float32Array(data, section.offset + 4, 4 * count),
    kinds: new Uint8Array(data, section.offset + 4 + 16 * count, count),
  };
}

function decodeSupport(data: ArrayBuffer, view: DataView, section: Section | undefined): Support | null {
  if (!section) return null;
  expectAtLeast(19, section, 28);
  const at = section.offset;
  const seen = view.getUint32(at + 4, true);
  const hidden = view.getUint32(at + 8, true);
  expectBytes(19, section, 28 + 4 * (seen + hidden));
  return {
    node: view.getUint32(at, true),
    position: new Float32Array(data, at + 12, 3),
    radius: view.getFloat32(at + 24, true),
    seen: new Uint32Array(data, at + 28, seen),
    hidden: new Uint32Array(data, at + 28 + 4 * seen, hidden),
  };
}

function decodeSlice(data: ArrayBuffer, view: DataView, section: Section | undefined): Slice | null {
  if (!section) return null;
  expectAtLeast(20, section, 40);
  const at = section.offset;
  const count = view.getUint32(at, true);
  expectBytes(20, section, 40 + 8 * count * count);
  return {
    count,
    origin: new Float32Array(data, at + 4, 3),
    first: new Float32Array(data, at + 16, 3),
    second: new Float32Array(data, at + 28, 3),
    organ: new Float32Array(data, at + 40, count * count),
    cut: new Float32Array(data, at + 40 + 4 * count * count, count * count),
  };
}
