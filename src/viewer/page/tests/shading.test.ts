// What shading is computed from, without drawing: grain, shadow, way ahead of the blade, depth of a wound's walls.
import assert from 'node:assert/strict';
import test from 'node:test';
import { Vector3 } from 'three';
import { blotches, grainField } from '../source/grain';
import { planned } from '../source/plan';
import { Part, Tag, type Topology, type Vec3 } from '../source/protocol';
import { belowLips, onLips, trianglesOf } from '../source/surface';
import { shadedTriangles } from '../source/tool_shadow';

/** A square of 2 x 40 x 40 triangles at z = 0 with sides of 80 mm about the origin, seen from above. */
function plate(): { positions: Float32Array; triangles: Uint32Array } {
  const [side, step] = [41, 0.002];
  const positions: number[] = [];
  const triangles: number[] = [];
  for (let j = 0; j < side; ++j) for (let i = 0; i < side; ++i) positions.push((i - 20) * step, (j - 20) * step, 0);
  for (let j = 0; j + 1 < side; ++j) {
    for (let i = 0; i + 1 < side; ++i) {
      const a = j * side + i;
      triangles.push(a, a + 1, a + side, a + 1, a + side + 1, a + side);
    }
  }
  return { positions: Float32Array.from(positions), triangles: Uint32Array.from(triangles) };
}

test('The grain is the same every time, has no mean and repeats without a seam', () => {
  const count = 16;
  const field = grainField(count);
  assert.deepEqual(field, grainField(count));
  assert.ok(Math.abs(field.reduce((sum, x) => sum + x, 0) / field.length) < 1e-5);
  const at = (x: number): number[] => Array.from({ length: count * count }, (_, i) => field[i * count + x]!);
  const apart = (a: number[], b: number[]): number => Math.sqrt(a.reduce((sum, x, i) => sum + (x - b[i]!) ** 2, 0) / a.length);
  const within = apart(at(7), at(8));
  assert.ok(apart(at(count - 1), at(0)) < 2 * within, 'the first sample does not follow the last one');
  assert.ok(apart(at(0), at(8)) > within);
});

test('Blotches go on from place to place and repeat with the grain', () => {
  const count = 16;
  const field = grainField(count);
  const along = Float32Array.from({ length: 300 }, (_, i) => (i % 3 === 0 ? i * 1e-4 : 0.003));
  const tones = blotches(field, count, along);
  assert.ok(Math.max(...tones) - Math.min(...tones) > 0.02);
  for (let i = 1; i < tones.length; ++i) assert.ok(Math.abs(tones[i]! - tones[i - 1]!) < 0.05);
  // 5 and 17 repeats a metre have 1 m in common.
  const [here, there] = blotches(field, count, Float32Array.from([0.01, 0.02, 0.03, 1.01, 0.02, -0.97]));
  assert.ok(Math.abs(here! - there!) < 1e-3);
});

test('A rod shades what lies away from the lamp behind it, and nothing far from that', () => {
  const { positions, triangles } = plate();
  const lamp = new Vector3(-1, 0, 1).normalize();
  const rod = { from: new Vector3(0, 0, 0.01), to: new Vector3(0, 0, 0.0101), radius: 0.003 };
  const picked = shadedTriangles([rod], lamp, positions, triangles);
  assert.ok(picked.length > 0 && picked.length % 3 === 0 && picked.length < 0.2 * triangles.length);
  const places = picked.map((v) => [positions[3 * v]!, positions[3 * v + 1]!] as const);
  // The middle of the shadow is where the light through the rod comes down: 10 mm along x.
  assert.ok(places.some(([x, y]) => Math.hypot(x - 0.01, y) < 0.0015));
  assert.ok(places.every(([x, y]) => Math.hypot(x - 0.01, y) < 0.016));
  assert.equal(shadedTriangles([{ ...rod, from: new Vector3(0, 0, 0.3), to: new Vector3(0, 0, 0.3001) }], lamp, positions, triangles).length, 0);
});

test('The way ahead of the blade lies in its plane, on the surface, in dashes, up to 60 mm far', () => {
  const { positions, triangles } = plate();
  const turn: [number, number, number, number] = [0, 0, Math.sin(Math.PI / 12), Math.cos(Math.PI / 12)]; // 30 degrees about z
  const tip: Vec3 = [-0.0301, -0.0203, -0.004];
  const pieces = planned(tip, turn, positions, triangles);
  const [ahead, across] = [[Math.cos(Math.PI / 6), Math.sin(Math.PI / 6)], [-Math.sin(Math.PI / 6), Math.cos(Math.PI / 6)]] as const;
  let length = 0;
  for (const { from, to, normal } of pieces) {
    for (const end of [from, to]) {
      const way = [end[0] - tip[0], end[1] - tip[1]] as const;
      assert.ok(Math.abs(way[0] * across[0] + way[1] * across[1]) < 1e-7 && Math.abs(end[2]) < 1e-7);
      const far = way[0] * ahead[0] + way[1] * ahead[1];
      assert.ok(far > -1e-7 && far < 0.06 + 1e-7);
    }
    assert.ok(normal[2] > 0.999);
    length += Math.hypot(to[0] - from[0], to[1] - from[1]);
  }
  assert.ok(Math.abs(length - 0.6 * 0.06) < 1e-4, `dashes of ${length} m`);
  // Seen from below there is no way.
  assert.equal(planned(tip, [1, 0, 0, 0], positions, triangles).length, 0);
});

test('Walls know how far below the lips they are', () => {
  const topology = {
    vertexCount: 5,
    triangleCount: 3,
    rest: Float32Array.from([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 1, 0, -0.5]),
    triangles: Uint32Array.from([0, 1, 2, 0, 2, 3, 2, 1, 4]),
    tags: Uint8Array.from([Tag.surface, Tag.lip, Tag.lip, Tag.surface, Tag.front]),
    parts: Uint8Array.from([Part.organ, Part.organ, Part.wallPlus]),
  } as unknown as Topology;
  assert.deepEqual([...onLips(topology)], [0, 1, 1, 0, 0]);
  assert.deepEqual([...belowLips(topology, trianglesOf(topology, (part) => part !== Part.organ))], [0, 0, 0, 0, 0.5]);
  assert.deepEqual([...belowLips(topology, new Uint32Array(0))], [0, 0, 0, 0, 0]);
});
