import assert from 'node:assert/strict';
import test from 'node:test';
import { Part, Tag, type Topology } from '../source/protocol';
import { castRay, frontEdges, frontFaces, isSmooth, lipDistance, lipEdges, trianglesOf, vertexNormals } from '../source/surface';

/** A square of two triangles at z = 0, and a wall of one triangle below the edge from 1 to 2. */
const square: Topology = {
  kind: 'topology',
  number: 1,
  epoch: 1,
  topology: 1,
  vertexCount: 5,
  triangleCount: 3,
  pieceCount: 1,
  rest: Float32Array.from([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 1, 0.5, -1]),
  triangles: Uint32Array.from([0, 1, 2, 0, 2, 3, 2, 1, 4]),
  tags: Uint8Array.from([Tag.surface, Tag.lip, Tag.lip, Tag.surface, Tag.front]),
  parts: Uint8Array.from([Part.organ, Part.organ, Part.wallPlus]),
  pieces: new Uint16Array(3),
  partners: Uint32Array.from([1, 2]),
};

test('Normals are of unit length and point to where the triangles face', () => {
  const normals = new Float32Array(15);
  vertexNormals(square.rest, trianglesOf(square, (part) => part === Part.organ), normals);
  for (let v = 0; v < 4; ++v) assert.deepEqual([...normals.subarray(3 * v, 3 * v + 3)], [0, 0, 1]);
  assert.deepEqual([...normals.subarray(12)], [0, 0, 0]);
});

test('Faces are in front for an eye on their outer side alone', () => {
  const front = new Uint32Array(9);
  assert.equal(frontFaces(square.rest, square.triangles, [0.5, 0.5, 2], front), 6);
  assert.deepEqual([...front.subarray(0, 6)], [0, 1, 2, 0, 2, 3]);
  assert.equal(frontFaces(square.rest, square.triangles, [3, 0.5, -2], front), 3);
  assert.deepEqual([...front.subarray(0, 3)], [2, 1, 4]);
});

test('A ray meets the nearest face that looks at it', () => {
  const organ = trianglesOf(square, (part) => part === Part.organ);
  const normals = new Float32Array(15);
  vertexNormals(square.rest, organ, normals);
  const hit = castRay(square.rest, organ, normals, [0.25, 0.5, 2], [0, 0, -1]);
  assert.ok(hit);
  assert.deepEqual(hit.point, [0.25, 0.5, 0]);
  assert.deepEqual(hit.normal, [0, 0, 1]);
  assert.equal(hit.distance, 2);
  assert.equal(castRay(square.rest, organ, normals, [0.25, 0.5, -2], [0, 0, 1]), null); // from behind
  assert.equal(castRay(square.rest, organ, normals, [1.5, 0.5, 2], [0, 0, -1]), null); // beside it
  assert.equal(castRay(square.rest, organ, normals, [0.25, 0.5, -1], [0, 0, -1]), null); // behind its start
});

test('Lips lie between surface and wall, the opening between the pairs', () => {
  assert.deepEqual([...lipEdges(square)], [1, 2]);
  assert.equal(frontEdges(square).length, 0);
  assert.equal(lipDistance(square, square.rest), 1);
});

test('A ball is smooth, a tetrahedron is not', () => {
  const [rings, spokes] = [24, 48];
  const places: number[] = [];
  const index: number[] = [];
  for (let i = 0; i <= rings; ++i) {
    for (let j = 0; j < spokes; ++j) {
      const [u, v] = [0.1 + ((Math.PI - 0.2) * i) / rings, (2 * Math.PI * j) / spokes];
      places.push(Math.sin(u) * Math.cos(v), Math.sin(u) * Math.sin(v), Math.cos(u));
      const [a, b] = [i * spokes + j, i * spokes + ((j + 1) % spokes)];
      if (i < rings) index.push(a, a + spokes, b, b, a + spokes, b + spokes);
    }
  }
  const smooth = (x: readonly number[], t: readonly number[]): boolean => {
    const [positions, triangles] = [Float32Array.from(x), Uint32Array.from(t)];
    const normals = new Float32Array(positions.length);
    vertexNormals(positions, triangles, normals);
    return isSmooth(positions, triangles, normals);
  };
  assert.ok(smooth(places, index));
  assert.ok(!smooth([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1], [0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]));
});
