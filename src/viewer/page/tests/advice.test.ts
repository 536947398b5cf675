// Words of the server as the page says them: node --test advice.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';
import { advice, adviceOnLog, saying, withPrefixes } from '../source/advice';
import { forceColour, forceInWords } from '../source/colours';

test('Small lengths, forces and times get a prefix, others stay', () => {
  assert.equal(withPrefixes('the tool is 0.0062 m deep at t = 4.258 s'), 'the tool is 6.2 mm deep at t = 4.258 s');
  assert.equal(withPrefixes('5e-05 m between nodes of 0.02 m2 and 0.03 m/s'), '50 µm between nodes of 0.02 m2 and 0.03 m/s');
  assert.equal(withPrefixes('a tip of 0.0075 m; 0.5 m'), 'a tip of 7.5 mm; 0.5 m');
});

test('Every error has a sentence and what to do', () => {
  assert.equal(saying('another viewer holds the tool', advice('taken', 'take')), 'Another viewer holds the tool. You watch until they let go; ask them to press "Let go" (T).');
  assert.match(saying('spacing is 2 m.', advice('refused', 'set')), /^Spacing is 2 m\. The organ stays as it was/);
  assert.equal(saying('something', advice('unknown', undefined)), 'Something');
  assert.match(adviceOnLog('0.006 m between nodes are too coarse for a tip'), /Method/);
  for (const about of ['set', 'scenario', 'replay', 'record', 'mode', 'pose', 'grip', 'session']) assert.notEqual(advice('refused', about), '');
});

test('Forces are told in mN below 1 N, and their colour goes from yellow to red', () => {
  assert.deepEqual([0, 0.0123, 0.2578, 0.9996, 1.5].map(forceInWords), ['0.0 mN', '12.3 mN', '258 mN', '1.000 N', '1.500 N']);
  const green = (newtons: number): number => Number(forceColour(newtons).split(',')[1]);
  for (const [less, more] of [[0.03, 0.1], [0.1, 0.5], [0.5, 2]] as const) assert.ok(green(less) > green(more));
});
