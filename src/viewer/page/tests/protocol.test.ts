import assert from 'node:assert/strict';
import test from 'node:test';
import { decodeBinary, decodeText, ProtocolError } from '../source/protocol';
import { f32, frameBlock, message, pack, type SectionBytes, u16, u32, u8 } from './bytes';

// A tetrahedron whose last face is a wall.
const tetrahedron: SectionBytes[] = [
  { kind: 1, data: pack(f32(0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)) },
  { kind: 2, data: pack(u32(0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)) },
  { kind: 3, data: pack(u8(0, 1, 1, 3)) },
  { kind: 4, data: pack(u8(0, 0, 0, 2)) },
  { kind: 5, data: pack(u16(0, 0, 1, 1)) },
  { kind: 6, data: pack(u32(1, 2)) },
];
const tetrahedronBlock = pack(u32(7, 4, 4, 2));

function replaced(kind: number, data: Uint8Array): SectionBytes[] {
  return tetrahedron.map((section) => (section.kind === kind ? { kind, data } : section));
}

function refuses(data: ArrayBuffer, words: RegExp): void {
  assert.throws(() => decodeBinary(data), (error: unknown) => error instanceof ProtocolError && words.test(error.message));
}

test('A topology is read as it was written', () => {
  const topology = decodeBinary(message(1, tetrahedronBlock, tetrahedron, { number: 5, epoch: 3 }));
  assert.ok(topology?.kind === 'topology');
  assert.equal(topology.number, 5);
  assert.equal(topology.epoch, 3);
  assert.equal(topology.topology, 7);
  assert.equal(topology.pieceCount, 2);
  assert.deepEqual([...topology.rest], [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]);
  assert.deepEqual([...topology.triangles], [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
  assert.deepEqual([...topology.tags], [0, 1, 1, 3]);
  assert.deepEqual([...topology.parts], [0, 0, 0, 2]);
  assert.deepEqual([...topology.pieces], [0, 0, 1, 1]);
  assert.deepEqual([...topology.partners], [1, 2]);
});

test('The numbers of a frame are read from their offsets', () => {
  const block = frameBlock({
    time: 1.25,
    tickTime: 1.5,
    topology: 7,
    solve: 42,
    vertices: 4,
    state: 1 + 16,
    mode: 1,
    pose: [31, 29],
    pieces: 2,
    hand: [0.1, 0.2, 0.3],
    tip: [0.4, 0.5, 0.6],
    force: [1, -2, 3],
    rest: [
      ...f32(4, 5, 6, 7, 8, 9, 10, 11, 12, 0.013, 0.014), // force on the hand, contact, normal, depth, radius
      ...u32(15, 16, 1),
      ...f32(997, 98, 29, 2e-5),
      ...u32(1000, 3),
      ...f32(4e-4, 0.01, 5e-4, 0.06, 2e-3, 3e-7, 0.5, 6e-3),
      ...u32(8, 0),
    ],
  });
  const frame = decodeBinary(message(2, block, []));
  assert.ok(frame?.kind === 'frame');
  const near = (got: number, expected: number): void =>
    assert.ok(Math.abs(got - expected) <= 1e-6 * Math.abs(expected), `${got} is not ${expected}`);
  assert.equal(frame.time, 1.25);
  assert.equal(frame.tickTime, 1.5);
  assert.deepEqual([frame.topology, frame.solve, frame.vertexCount, frame.state], [7, 42, 4, 17]);
  assert.equal(frame.mode, 'blade');
  assert.deepEqual([frame.poseInTick, frame.poseInSolve, frame.pieceCount], [31, 29, 2]);
  near(frame.hand[2], 0.3);
  near(frame.tip[0], 0.4);
  assert.deepEqual(frame.orientation, [0, 0, 0, 1]);
  assert.deepEqual(frame.axis, [0, 0, 1]);
  assert.deepEqual(frame.force, [1, -2, 3]);
  assert.deepEqual(frame.handForce, [4, 5, 6]);
  assert.deepEqual(frame.contact, [7, 8, 9]);
  assert.deepEqual(frame.normal, [10, 11, 12]);
  near(frame.depth, 0.013);
  near(frame.contactRadius, 0.014);
  assert.deepEqual([frame.active, frame.nodeCount, frame.level], [15, 16, 1]);
  near(frame.hapticRate, 997);
  near(frame.solveRate, 98);
  near(frame.pictureRate, 29);
  near(frame.tickSeconds, 2e-5);
  assert.deepEqual([frame.ticks, frame.misses, frame.leftOut], [1000, 3, 8]);
  near(frame.worstWake, 4e-4);
  near(frame.solveSeconds, 0.01);
  near(frame.cutArea, 5e-4);
  near(frame.frontLength, 0.06);
  near(frame.opening, 2e-3);
  near(frame.openingVolume, 3e-7);
  near(frame.work, 0.5);
  near(frame.largestDisplacement, 6e-3);
  assert.equal(frame.vertices, null);
  assert.equal(frame.volumes, null);
});

test('The sections of a frame are read, in any order, unknown ones skipped', () => {
  const sections: SectionBytes[] = [
    { kind: 22, data: pack(f32(1, 2, 3, 4, 5, 6, 7, 8)) },
    { kind: 99, data: pack(u8(1, 2, 3)) },
    { kind: 16, data: pack(f32(1, 2, 3, 4, 5, 6)) },
    { kind: 17, data: pack([...u32(2), ...f32(10, 20, 11, 19)]) },
    { kind: 18, data: pack([...u32(1), ...f32(1, 2, 3, 0.5), ...u8(3)]) },
    { kind: 19, data: pack([...u32(4, 2, 1), ...f32(1, 2, 3, 0.25), ...u32(5, 6, 7)]) },
    { kind: 20, data: pack([...u32(2), ...f32(0, 0, 0, 1, 0, 0, 0, 1, 0), ...f32(1, 2, 3, 4), ...f32(5, 6, 7, 8)]) },
    { kind: 21, data: pack(f32(0.001, 0.002)) },
  ];
  const frame = decodeBinary(message(2, frameBlock({ vertices: 2, pieces: 2 }), sections));
  assert.ok(frame?.kind === 'frame');
  assert.deepEqual([...(frame.vertices ?? [])], [1, 2, 3, 4, 5, 6]);
  assert.equal(frame.scalars?.quantity, 'von_mises');
  assert.deepEqual([frame.scalars?.low, frame.scalars?.high], [10, 20]);
  assert.deepEqual([...(frame.scalars?.values ?? [])], [11, 19]);
  assert.deepEqual([...(frame.nodes?.spheres ?? [])], [1, 2, 3, 0.5]);
  assert.deepEqual([...(frame.nodes?.kinds ?? [])], [3]);
  assert.equal(frame.support?.node, 4);
  assert.deepEqual([...(frame.support?.seen ?? [])], [5, 6]);
  assert.deepEqual([...(frame.support?.hidden ?? [])], [7]);
  assert.deepEqual([...(frame.slice?.organ ?? [])], [1, 2, 3, 4]);
  assert.deepEqual([...(frame.slice?.cut ?? [])], [5, 6, 7, 8]);
  assert.equal(frame.volumes?.length, 2);
  assert.deepEqual([...(frame.stages ?? [])], [1, 2, 3, 4, 5, 6, 7, 8]);
});

test('Force and torque are read where the page of the protocol has them', () => {
  const frame = decodeBinary(message(2, frameBlock({ force: [1, 2, 3], torque: [4, 5, 6, 7, 8, 9] }), []));
  assert.ok(frame?.kind === 'frame');
  assert.deepEqual(frame.force, [1, 2, 3]);
  assert.deepEqual(frame.torque, [4, 5, 6]);
  assert.deepEqual(frame.handTorque, [7, 8, 9]);
});

test('A fixed block that has grown is read all the same', () => {
  const grown = new Uint8Array(272 - 16 + 12);
  grown.set(frameBlock({ solve: 9, vertices: 1 }));
  const frame = decodeBinary(message(2, grown, [{ kind: 16, data: pack(f32(1, 2, 3)) }]));
  assert.ok(frame?.kind === 'frame');
  assert.equal(frame.solve, 9);
  assert.deepEqual([...(frame.vertices ?? [])], [1, 2, 3]);
});

test('Messages that do not keep to the protocol are refused in words', () => {
  refuses(new ArrayBuffer(15), /shorter than its header/);
  refuses(message(2, frameBlock({}), [], { version: 1 }), /version 1/);
  refuses(message(2, frameBlock({}), [], { version: 3 }), /version 3/);
  refuses(message(2, frameBlock({}).slice(0, 248 - 16), []), /first section/);
  refuses(message(1, tetrahedronBlock, tetrahedron).slice(0, -4), /says that it has/);
  refuses(message(2, new Uint8Array(64), []), /first section/);
  refuses(message(2, frameBlock({ mode: 3 }), []), /mode 3/);
  refuses(message(1, tetrahedronBlock, tetrahedron.slice(0, 5)), /section 6 is missing/);
  refuses(message(1, tetrahedronBlock, [...tetrahedron, ...tetrahedron.slice(0, 1)]), /section 1 comes twice/);
  refuses(message(1, tetrahedronBlock, replaced(1, pack(f32(1, 2, 3)))), /section 1 has 12 bytes instead of 48/);
  refuses(message(1, tetrahedronBlock, replaced(2, pack(u32(0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 4)))), /vertex 4 of 4/);
  refuses(message(1, tetrahedronBlock, replaced(6, pack(u32(1)))), /whole pairs/);
  refuses(message(2, frameBlock({ vertices: 2 }), [{ kind: 16, data: pack(f32(1, 2, 3)) }]), /section 16 has 12 bytes instead of 24/);
  refuses(message(2, frameBlock({}), [{ kind: 18, data: pack(u32(1)) }]), /section 18/);
  refuses(message(2, frameBlock({}), [{ kind: 19, data: pack(u32(1, 1, 1)) }]), /section 19/);
  refuses(message(2, frameBlock({}), [{ kind: 20, data: pack(u32(9)) }]), /section 20/);
  const past = new Uint8Array(message(2, frameBlock({}), [{ kind: 50, data: pack(u32(1)) }]));
  past.set(pack(u32(5)), 272 + 4);
  refuses(past.buffer, /past the end/);
  assert.equal(decodeBinary(message(3, new Uint8Array(0), [])), null);
});

test('Text is JSON with a type; types that are not known are passed over', () => {
  assert.deepEqual(decodeText('{"type":"holder","id":3}'), { type: 'holder', id: 3 });
  assert.equal(decodeText('{"type":"weather"}'), null);
  for (const text of ['', '[', '3', 'null', '{"id":3}']) assert.throws(() => decodeText(text), ProtocolError);
});
