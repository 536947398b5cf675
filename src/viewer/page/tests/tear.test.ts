// The grasper in the hand, by mouse and by keyboard, on a flap that tears: node tear.test.mjs BUILD_FOLDER SOURCE_FOLDER
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test, { after, before } from 'node:test';
import type { Browser } from 'playwright-core';
import { launch, type Opened, openPage, patience, until } from './browser';
import { organIsSeen, see } from './composited';
import { hover, look, ready } from './hand';
import { coarserFlap, serve, type Served, withValues } from './server';

const [build = '.', source = '.'] = process.argv.slice(2);
const flap = { x: -0.062, y: 0.003 }; // m, where it is held
let served: Served;
let browser: Browser;
let opened: Opened;

before(async () => {
  // With fewer triangles too.
  served = await serve(build, join(source, 'scenarios/liver_flap.toml'), (text) => withValues(coarserFlap(text), { triangles: 5000 }));
  browser = await launch();
  opened = await openPage(browser, served.address);
});

after(async () => {
  await browser?.close();
  await served?.stop();
});

test('The grasper is what this scenario offers, beside no probe and no blade', async () => {
  const { tab } = opened;
  await ready(tab);
  const seen = await look(tab);
  assert.deepEqual(seen.modes, ['grasper']);
  assert.equal(seen.mode, 'grasper');
  assert.ok(seen.cutArea > 1e-3, `the precut has ${seen.cutArea} m2`);
  assert.equal(seen.force, 0);
  organIsSeen(await see(tab), 'as the page opens');
});

test('By mouse: it takes hold, pulls, and the tissue pulls back', async () => {
  const { tab } = opened;
  await hover(tab, flap.x, flap.y);
  await tab.mouse.down();
  await until(tab, 'it pulls', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.01);
  await until(tab, 'the flap comes off its bed', () => globalThis.spherecut!.view.body.lipsApart() > 1e-3);
  const pulled = await see(tab);
  organIsSeen(pulled, 'pulled');
  assert.ok(pulled.arrow > 20, `${pulled.arrow} px of an arrow`);
});

test('Pulled further it tears: the cut grows and its sides part', async () => {
  const { tab } = opened;
  const before = await look(tab);
  await tab.keyboard.down(',');
  await until(tab, 'the hand is far up', () => (document.getElementById('press-depth') as HTMLInputElement).valueAsNumber <= -15);
  await tab.keyboard.up(',');
  // A solve that had begun before may tear first; the sides part with the one that knows the hand.
  await tab.waitForFunction(
    ({ cutArea, lips }) => globalThis.spherecut!.frame!.cutArea > 1.02 * cutArea && globalThis.spherecut!.view.body.lipsApart() > lips + 5e-4,
    before,
    { timeout: 1000 * patience },
  );
  const torn = await look(tab);
  assert.ok(torn.cutArea > 1.02 * before.cutArea, `${before.cutArea} m2 became ${torn.cutArea}`);
  assert.ok(torn.lips > before.lips + 5e-4, `${before.lips} m became ${torn.lips}`);
  await until(tab, 'the page says what the tear is at', () => (globalThis.spherecut!.tear?.area ?? 0) > 0);
  assert.match((await tab.textContent('#tear-state')) ?? '', /^(Tearing,|The tear) .*cm²/);
  const open = await see(tab);
  organIsSeen(open, 'torn');
  assert.ok(open.lip > 20, `${open.lip} px of lips`);
});

test('Let go, it is without force, and what is torn stays torn', async () => {
  const { tab } = opened;
  const before = await look(tab);
  await tab.mouse.up();
  await until(tab, 'it has let go', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
  const after = await look(tab);
  assert.ok(after.cutArea >= before.cutArea);
  // At rest it grows no more, and the page says why.
  await until(tab, 'the tear has come to rest', () => ['arrested', 'refused', 'severed'].includes(globalThis.spherecut!.tear?.state ?? ''));
  assert.match((await tab.textContent('#tear-state')) ?? '', /^The tear (is arrested at|has stopped at|has parted) .*[a-z]/);
});

test('By keyboard: a reset, then the grasper takes hold and pulls', async () => {
  const { tab } = opened;
  const epoch = await tab.evaluate(() => globalThis.spherecut!.session!.epoch);
  await hover(tab, flap.x, flap.y); // the arrows go on from there
  await tab.keyboard.press('r');
  await tab.waitForFunction((old) => globalThis.spherecut!.session!.epoch > old, epoch, { timeout: 1000 * patience });
  await until(tab, 'a frame', () => globalThis.spherecut!.frame?.epoch === globalThis.spherecut!.session!.epoch);
  await until(tab, 'the tear of the session before is forgotten', () => !globalThis.spherecut!.tear?.area);
  await tab.focus('#scene');
  await tab.keyboard.down('ArrowLeft');
  await tab.waitForTimeout(120);
  await tab.keyboard.up('ArrowLeft');
  await tab.keyboard.press('Space');
  await until(tab, 'it pulls', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.01);
  await tab.keyboard.press('Space');
  await until(tab, 'it has let go', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
  assert.deepEqual(opened.complaints, []);
});
