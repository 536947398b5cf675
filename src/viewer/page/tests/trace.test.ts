import assert from 'node:assert/strict';
import test from 'node:test';
import type { Vec3 } from '../source/protocol';
import type { Hit } from '../source/surface';
import { crossing, Trace } from '../source/trace';

/** The plane z = 0, seen from above. */
function plane(origin: Vec3, direction: Vec3): Hit | null {
  if (direction[2] >= 0 || origin[2] <= 0) return null;
  const distance = -origin[2] / direction[2];
  return { point: [origin[0] + distance * direction[0], origin[1] + distance * direction[1], 0], normal: [0, 0, 1], distance };
}

const edge: Vec3[] = [[0, 0, 0], [0.01, 0, 0.01], [0.01, 0, 0.03]];

test('The edge crosses the surface between its tip and its end, in the frame of the blade', () => {
  const none = crossing(edge, [0, 0, 0.001], [0, 0, 0, 1], plane);
  assert.equal(none, null); // above
  assert.equal(crossing(edge, [0, 0, -0.04], [0, 0, 0, 1], plane), null); // wholly below
  const low = crossing(edge, [0.1, 0.2, -0.005], [0, 0, 0, 1], plane)!;
  assert.ok(Math.hypot(low.point[0] - 0.105, low.point[1] - 0.2, low.point[2]) < 1e-12);
  // A quarter turn about z: the edge leans to +y.
  const turned = crossing(edge, [0.1, 0.2, -0.02], [0, 0, Math.SQRT1_2, Math.SQRT1_2], plane)!;
  assert.ok(Math.hypot(turned.point[0] - 0.1, turned.point[1] - 0.21, turned.point[2]) < 1e-12);
});

const at = (x: number): Hit => ({ point: [x, 0, 0], normal: [0, 0, 1], distance: 1 });

test('The band is as long as the way that the body has not been solved for, and no longer', () => {
  const trace = new Trace();
  trace.clear(0.2);
  for (let pose = 1; pose <= 11; ++pose) trace.note(at(0.001 * pose), pose, 0);
  assert.ok(Math.abs(trace.length - 0.01) < 1e-12);
  assert.ok(trace.mesh.visible);
  trace.note(at(0.012), 12, 6); // solved up to x = 0.006: the wound ends there, and the band begins
  assert.ok(Math.abs(trace.length - 0.006) < 1e-12, `${trace.length}`);
  trace.note(at(0.012), 13, 13); // at rest
  assert.equal(trace.length, 0);
  assert.ok(!trace.mesh.visible);
});

test('Nothing is drawn across the air between two strokes', () => {
  const trace = new Trace();
  trace.note(at(0), 1, 0);
  trace.note(at(0.002), 2, 0);
  trace.note(null, 3, 0);
  trace.note(at(0.012), 4, 0);
  trace.note(at(0.013), 5, 0);
  trace.note(at(0.063), 6, 0); // a jump
  trace.note(at(0.064), 7, 0);
  assert.ok(Math.abs(trace.length - 0.004) < 1e-12, `${trace.length}`);
  trace.clear();
  assert.equal(trace.length, 0);
});
