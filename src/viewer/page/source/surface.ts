// The streamed surface as plain arrays: normals, edges to draw, rays against it. No drawing here.
import { Part, Tag, type Topology, type Vec3 } from './protocol';

const mostPairs = 1_000_000; // of a vertex of a wall and one of a lip, that are compared for one surface

export interface Hit {
  point: Vec3; // m
  normal: Vec3; // unit, outward, smooth over the surface
  distance: number; // m along the ray
}

/** Three indices of each triangle whose part `wanted` accepts. */
export function trianglesOf(topology: Topology, wanted: (part: number) => boolean): Uint32Array {
  const picked: number[] = [];
  for (let t = 0; t < topology.triangleCount; ++t) {
    if (!wanted(topology.parts[t] ?? 0)) continue;
    picked.push(topology.triangles[3 * t] ?? 0, topology.triangles[3 * t + 1] ?? 0, topology.triangles[3 * t + 2] ?? 0);
  }
  return Uint32Array.from(picked);
}

/** Unit normals of the vertices of `triangles`, weighted by area; zero where no triangle is. */
export function vertexNormals(positions: Float32Array, triangles: Uint32Array, normals: Float32Array): void {
  normals.fill(0);
  const p = positions as ArrayLike<number> as number[];
  const n = normals as ArrayLike<number> as number[];
  const index = triangles as ArrayLike<number> as number[];
  for (let i = 0; i < triangles.length; i += 3) {
    const a = 3 * index[i]!;
    const b = 3 * index[i + 1]!;
    const c = 3 * index[i + 2]!;
    const ux = p[b]! - p[a]!;
    const uy = p[b + 1]! - p[a + 1]!;
    const uz = p[b + 2]! - p[a + 2]!;
    const vx = p[c]! - p[a]!;
    const vy = p[c + 1]! - p[a + 1]!;
    const vz = p[c + 2]! - p[a + 2]!;
    const x = uy * vz - uz * vy;
    const y = uz * vx - ux * vz;
    const z = ux * vy - uy * vx;
    for (const k of [a, b, c]) {
      n[k]! += x;
      n[k + 1]! += y;
      n[k + 2]! += z;
    }
  }
  for (let k = 0; k < normals.length; k += 3) {
    const length = Math.hypot(n[k]!, n[k + 1]!, n[k + 2]!);
    if (length > 0) {
      n[k]! /= length;
      n[k + 1]! /= length;
      n[k + 2]! /= length;
    }
  }
}

/** Whether a surface is smooth: its triangles turn as the normals of their corners do, but for one corner in fifty. */
export function isSmooth(positions: Float32Array, triangles: Uint32Array, normals: Float32Array): boolean {
  let sharp = 0;
  const corner = (i: number, d: number): number => positions[3 * triangles[i]! + d]!;
  for (let i = 0; i < triangles.length; i += 3) {
    const [ux, uy, uz, vx, vy, vz] = [1, 2].flatMap((k) => [0, 1, 2].map((d) => corner(i + k, d) - corner(i, d))) as [number, number, number, number, number, number];
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const length = Math.hypot(x, y, z);
    for (let k = 0; k < 3; ++k) {
      const at = 3 * triangles[i + k]!;
      if (x * normals[at]! + y * normals[at + 1]! + z * normals[at + 2]! < 0.8 * length) sharp += 1;
    }
  }
  return 50 * sharp <= triangles.length;
}

/** Writes the triangles that turn their front to `eye` into `front`; how many indices that is. */
export function frontFaces(positions: Float32Array, triangles: Uint32Array, eye: Vec3, front: Uint32Array): number {
  const p = positions as ArrayLike<number> as number[];
  const index = triangles as ArrayLike<number> as number[];
  const [ex, ey, ez] = eye;
  let count = 0;
  for (let i = 0; i < triangles.length; i += 3) {
    const a = 3 * index[i]!;
    const b = 3 * index[i + 1]!;
    const c = 3 * index[i + 2]!;
    const x = p[a]!;
    const y = p[a + 1]!;
    const z = p[a + 2]!;
    const ux = p[b]! - x;
    const uy = p[b + 1]! - y;
    const uz = p[b + 2]! - z;
    const vx = p[c]! - x;
    const vy = p[c + 1]! - y;
    const vz = p[c + 2]! - z;
    if ((uy * vz - uz * vy) * (ex - x) + (uz * vx - ux * vz) * (ey - y) + (ux * vy - uy * vx) * (ez - z) <= 0) continue;
    front[count] = index[i]!;
    front[count + 1] = index[i + 1]!;
    front[count + 2] = index[i + 2]!;
    count += 3;
  }
  return count;
}

/** Edges between the organ's own surface and a wall: the lips, as pairs of vertices. */
export function lipEdges(topology: Topology): Uint32Array {
  const key = (a: number, b: number): number => Math.min(a, b) * topology.vertexCount + Math.max(a, b);
  const rim = new Set<number>();
  eachEdge(topology, (a, b, part) => {
    if (part !== Part.organ && onRim(topology, a) && onRim(topology, b)) rim.add(key(a, b));
  });
  const edges: number[] = [];
  eachEdge(topology, (a, b, part) => {
    if (part === Part.organ && rim.has(key(a, b))) edges.push(a, b);
  });
  return Uint32Array.from(edges);
}

/** Edges where the cut ends inside the organ. */
export function frontEdges(topology: Topology): Uint32Array {
  const edges: number[] = [];
  eachEdge(topology, (a, b, part) => {
    if (part === Part.wallPlus && topology.tags[a] === Tag.front && topology.tags[b] === Tag.front) edges.push(a, b);
  });
  return Uint32Array.from(edges);
}

/** 1 at vertices of lips, 0 elsewhere. */
export function onLips(topology: Topology): Float32Array {
  return Float32Array.from({ length: topology.vertexCount }, (_, v) => (topology.tags[v] === Tag.lip ? 1 : 0));
}

/** How far the vertices of `walls` are from the nearest vertex of a lip at rest, m; of others 0, and without lips everywhere. */
export function belowLips(topology: Topology, walls: Uint32Array): Float32Array {
  const { rest, tags, vertexCount } = topology;
  const below = new Float32Array(vertexCount);
  const vertices = [...new Set(walls)];
  let lips = vertices.filter((v) => tags[v] === Tag.lip);
  if (lips.length === 0) return below;
  // Of a long wound every second or third lip will do.
  const step = Math.ceil((lips.length * vertices.length) / mostPairs);
  if (step > 1) lips = lips.filter((_, i) => i % step === 0);
  const places = Float32Array.from(lips.flatMap((v) => [rest[3 * v]!, rest[3 * v + 1]!, rest[3 * v + 2]!]));
  for (const v of vertices) {
    if (tags[v] === Tag.lip) continue;
    const [x, y, z] = [rest[3 * v]!, rest[3 * v + 1]!, rest[3 * v + 2]!];
    let least = Infinity;
    for (let k = 0; k < places.length; k += 3) {
      const square = (places[k]! - x) ** 2 + (places[k + 1]! - y) ** 2 + (places[k + 2]! - z) ** 2;
      if (square < least) least = square;
    }
    below[v] = Math.sqrt(least);
  }
  return below;
}

function onRim(topology: Topology, vertex: number): boolean {
  return topology.tags[vertex] === Tag.lip || topology.tags[vertex] === Tag.front;
}

function eachEdge(topology: Topology, visit: (a: number, b: number, part: number) => void): void {
  for (let t = 0; t < topology.triangleCount; ++t) {
    const part = topology.parts[t] ?? 0;
    for (let side = 0; side < 3; ++side) {
      visit(topology.triangles[3 * t + side] ?? 0, topology.triangles[3 * t + ((side + 1) % 3)] ?? 0, part);
    }
  }
}

/** Nearest front face that a ray meets; null: none. `direction` is a unit vector. */
export function castRay(
  positions: Float32Array,
  triangles: Uint32Array,
  normals: Float32Array,
  origin: Vec3,
  direction: Vec3,
): Hit | null {
  const p = positions as ArrayLike<number> as number[];
  const index = triangles as ArrayLike<number> as number[];
  const [ox, oy, oz] = origin;
  const [dx, dy, dz] = direction;
  let nearest = Infinity;
  let best = -1;
  let bestU = 0;
  let bestV = 0;
  for (let i = 0; i < triangles.length; i += 3) {
    const a = 3 * index[i]!;
    const b = 3 * index[i + 1]!;
    const c = 3 * index[i + 2]!;
    const ux = p[b]! - p[a]!;
    const uy = p[b + 1]! - p[a + 1]!;
    const uz = p[b + 2]! - p[a + 2]!;
    const vx = p[c]! - p[a]!;
    const vy = p[c + 1]! - p[a + 1]!;
    const vz = p[c + 2]! - p[a + 2]!;
    // Moller and Trumbore: d x v, and so on.
    const px = dy * vz - dz * vy;
    const py = dz * vx - dx * vz;
    const pz = dx * vy - dy * vx;
    const det = ux * px + uy * py + uz * pz;
    if (det <= 1e-18) continue; // seen from behind or edge-on
    const sx = ox - p[a]!;
    const sy = oy - p[a + 1]!;
    const sz = oz - p[a + 2]!;
    const u = sx * px + sy * py + sz * pz;
    if (u < 0 || u > det) continue;
    const qx = sy * uz - sz * uy;
    const qy = sz * ux - sx * uz;
    const qz = sx * uy - sy * ux;
    const v = dx * qx + dy * qy + dz * qz;
    if (v < 0 || u + v > det) continue;
    const t = (vx * qx + vy * qy + vz * qz) / det;
    if (t > 0 && t < nearest) {
      nearest = t;
      best = i;
      bestU = u / det;
      bestV = v / det;
    }
  }
  if (best < 0) return null;
  const weights = [1 - bestU - bestV, bestU, bestV];
  const normal: Vec3 = [0, 0, 0];
  for (let k = 0; k < 3; ++k) {
    const at = 3 * index[best + k]!;
    for (let d = 0; d < 3; ++d) normal[d]! += weights[k]! * normals[at + d]!;
  }
  const length = Math.hypot(...normal) || 1;
  return {
    point: [ox + nearest * dx, oy + nearest * dy, oz + nearest * dz],
    normal: [normal[0] / length, normal[1] / length, normal[2] / length],
    distance: nearest,
  };
}

/** Largest distance between the two sides of the cut, m, over the pairs of vertices that were one; 0 without a cut. */
export function lipDistance(topology: Topology, positions: Float32Array): number {
  let largest = 0;
  for (let i = 0; i + 1 < topology.partners.length; i += 2) {
    const a = 3 * (topology.partners[i] ?? 0);
    const b = 3 * (topology.partners[i + 1] ?? 0);
    const apart = Math.hypot(
      (positions[a] ?? 0) - (positions[b] ?? 0),
      (positions[a + 1] ?? 0) - (positions[b + 1] ?? 0),
      (positions[a + 2] ?? 0) - (positions[b + 2] ?? 0),
    );
    if (apart > largest) largest = apart;
  }
  return largest;
}
