// The page in Debian's Chromium against `spherecut serve`: node browser.test.mjs BUILD_FOLDER SOURCE_FOLDER [FOLDER_FOR_PICTURES]
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import test, { after, before } from 'node:test';
import type { Browser } from 'playwright-core';
import { launch, type Opened, openPage, patience, until } from './browser';
import { organIsSeen, see, woundIsSeen } from './composited';
import { chooseMode, hover, look, ready, type Seen, stroke } from './hand';
import { photograph, shot, sideBySide } from './photograph';
import { recordedForces, serve, type Served, withValues } from './server';

const [build = '.', source = '.', out = ''] = process.argv.slice(2);
let served: Served;
let browser: Browser;
let first: Opened;
let pressed: Seen;
let wounded: Buffer; // picture of the cut

before(async () => {
  // The liver of the demo with fewer triangles and nodes: the same page and server, sooner through a cut.
  served = await serve(build, join(source, 'scenarios/liver_live.toml'), (text) => withValues(text, { triangles: 5000, fine_spacing: 0.009 }));
  browser = await launch();
  first = await openPage(browser, served.address);
});

after(async () => {
  await browser?.close();
  await served?.stop();
});

test('The page loads without a complaint and takes the tool', async () => {
  await ready(first.tab);
  assert.deepEqual(first.complaints, []);
  const seen = await look(first.tab);
  assert.equal(seen.role, 'you hold the tool');
  assert.equal(seen.force, 0);
  organIsSeen(await see(first.tab), 'as the page opens');
  await first.tab.keyboard.press('0'); // as it opens for who has not been there
  await photograph(first.tab, out, 'load');
  await first.tab.keyboard.press('0');
  assert.equal(await first.tab.title(), `spherecut ${/\d+\.\d+\.\d+/.exec(await first.tab.title())?.[0]}`);
});

test('A press is felt, and the readout is the force of the frame', async () => {
  const { tab } = first;
  await tab.click('#record');
  await until(tab, 'it records', () => document.getElementById('record')!.getAttribute('aria-pressed') === 'true');
  await hover(tab, -0.02, -0.01);
  await tab.mouse.down();
  await until(tab, 'the force is felt', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.03);
  await tab.waitForTimeout(1000);
  pressed = await look(tab);
  assert.ok(pressed.depth > 0.003, `depth ${pressed.depth}`);
  assert.ok(Math.abs(pressed.readout - pressed.force) < 6e-4, `reads ${pressed.readout}, frame ${pressed.force}`);
  const picture = await see(tab);
  organIsSeen(picture, 'pressed');
  assert.ok(picture.arrow > picture.arrowLength && picture.arrowLength > 20, `${picture.arrow} px of an arrow of ${picture.arrowLength} px`);
  assert.ok(picture.chart > 20, `${picture.chart} px of a curve`);
  await tab.mouse.up();
  await until(tab, 'it has withdrawn', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
});

test('The readout is the force in the recording of the server at that tick', async () => {
  const { tab } = first;
  await tab.click('#record');
  await until(tab, 'it has recorded', () => !(document.getElementById('download') as HTMLButtonElement).disabled);
  const [download] = await Promise.all([tab.waitForEvent('download'), tab.click('#download')]);
  const ticks = recordedForces(readFileSync(await download.path()));
  const away = ({ time }: { time: number }): number => Math.abs(time - pressed.tickTime);
  const tick = ticks.reduce((best, next) => (away(next) < away(best) ? next : best));
  assert.ok(away(tick) < 1e-6, `no tick at ${pressed.tickTime}`);
  tick.force.forEach((newtons, d) => assert.ok(Math.abs(newtons - pressed.handForce[d]!) < 1e-6, `${tick.force} and ${pressed.handForce}`));
  assert.ok(Math.abs(Math.hypot(...tick.force) - pressed.readout) < 6e-4, 'the force on the page is not that of the recording');
});

test('A recording is replayed, and the force comes back', async () => {
  const { tab } = first;
  await tab.click('#replay');
  await until(tab, 'the press is felt again', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.03);
  assert.equal(await tab.textContent('#link'), 'replay of session-1.recording');
  await photograph(tab, out, 'replay');
  await tab.click('#replay');
  await until(tab, 'the replay has ended', () => document.getElementById('replay')!.getAttribute('aria-pressed') === 'false');
  await until(tab, 'it is live', () => document.getElementById('link')!.textContent === 'live');
  await until(tab, 'the tool is free', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
});

test('A cut across the liver opens: the lips part in the geometry and in the picture', async () => {
  const { tab } = first;
  await chooseMode(tab, '2', 'blade');
  await hover(tab, -0.055, 0.004);
  // Before a solve has opened it, the way of the edge through the surface is in the picture with the blade.
  const ahead = tab.waitForFunction(() => globalThis.spherecut!.view.trace.length > 0.003, undefined, { polling: 20 });
  await stroke(tab, [[-0.055, 0.004], [0.01, 0.0]], 1.5);
  await ahead;
  organIsSeen(await see(tab), 'while the cut is solved');
  await until(tab, 'the cut opens', () => globalThis.spherecut!.view.body.lipsApart() > 2e-4);
  await until(tab, 'the wound has caught up with the blade', () => globalThis.spherecut!.view.trace.length === 0);
  await tab.mouse.up();
  await tab.keyboard.press('k');
  await until(tab, 'the blade is away', () => globalThis.spherecut!.frame!.depth < -0.02);
  const open = await see(tab);
  organIsSeen(open, 'cut');
  woundIsSeen(open, 60, 'cut');
  const seen = await look(tab);
  assert.ok(seen.cutArea > 1e-4, `area ${seen.cutArea}`);
  assert.match((await tab.textContent('#cut-state')) ?? '', /^Cut .* cm²/);
  if (out) wounded = await shot(tab);
});

test('Nodes, supports and level sets show what the method sees', async () => {
  const { tab } = first;
  await tab.keyboard.press('n');
  await tab.keyboard.press('p');
  await until(tab, 'the supports of a node', () => /sees \d+ nodes/.test(document.getElementById('support-state')!.textContent!));
  await tab.selectOption('#slice', 'cut');
  await tab.selectOption('#colours', 'von_mises');
  await until(tab, 'the scale bar', () => !document.getElementById('scale')!.hidden);
  await tab.selectOption('#slice', 'none');
  await until(tab, 'stresses', () => /stress/.test(document.getElementById('scale-name')!.textContent!));
  await tab.selectOption('#colours', 'none');
  for (const key of ['n', 'o']) await tab.keyboard.press(key);
});

test('A second viewer watches and cannot drive until the tool is let go', async () => {
  const second = await openPage(browser, served.address, { width: 800, height: 600 });
  await until(second.tab, 'it sees frames', () => globalThis.spherecut?.frame != null);
  await until(second.tab, 'it sees the wound', () => globalThis.spherecut!.view.body.lipsApart() > 2e-4);
  assert.match((await look(second.tab)).role, /^watching/);
  const watched = await see(second.tab);
  organIsSeen(watched, 'for the second viewer');
  woundIsSeen(watched, 40, 'for the second viewer');
  assert.ok(await second.tab.isDisabled('#take'));
  if (out) await sideBySide(browser, [await shot(first.tab), await shot(second.tab)], out, 'two');
  assert.ok(await second.tab.isDisabled('#reset'));
  await first.tab.click('#take');
  await until(first.tab, 'it has let go', () => !globalThis.spherecut!.holding);
  await second.tab.click('#take');
  await until(second.tab, 'it holds the tool', () => globalThis.spherecut!.holding);
  await second.context.close();
  await until(first.tab, 'the tool is free again', () => globalThis.spherecut!.holder === null);
  await first.tab.keyboard.press('t');
  await until(first.tab, 'it is back', () => globalThis.spherecut!.holding);
  assert.deepEqual(second.complaints, []);
});

test('Reset makes the organ whole', async () => {
  const { tab } = first;
  const epoch = await tab.evaluate(() => globalThis.spherecut!.session!.epoch);
  await tab.keyboard.press('r');
  await tab.waitForFunction((old) => globalThis.spherecut!.session!.epoch > old, epoch, { timeout: 1000 * patience });
  await until(tab, 'it is whole', () => globalThis.spherecut!.frame!.cutArea === 0 && globalThis.spherecut!.view.body.lipsApart() === 0);
  const whole = await see(tab);
  organIsSeen(whole, 'made whole');
  assert.ok(whole.lipLength === 0 && whole.lip < 10, `${whole.lip} px of lips stay`);
  if (out) await sideBySide(browser, [wounded, await shot(tab)], out, 'reset');
});

test('Errors of the server appear in words', async () => {
  const { tab } = first;
  await tab.evaluate(() => document.querySelectorAll('details').forEach((panel) => (panel.open = true)));
  await tab.fill('#fine', '60'); // coarser than far away
  await tab.click('#method-form button');
  await until(tab, 'an error', () => /spacing/.test(document.querySelector('#messages [data-level=error]:last-child')?.textContent ?? ''));
});

test('Everything goes by keyboard', async () => {
  const { tab } = first;
  await tab.focus('#scene');
  await chooseMode(tab, '1', 'probe');
  await tab.keyboard.down('ArrowLeft');
  await tab.waitForTimeout(300);
  await tab.keyboard.up('ArrowLeft');
  await tab.keyboard.press('Space');
  await until(tab, 'the press is felt', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.02);
  const before = await look(tab);
  await tab.keyboard.down('.');
  await until(tab, 'the key is felt', () => (document.getElementById('press-depth') as HTMLInputElement).valueAsNumber > 8);
  await tab.keyboard.up('.');
  await tab.waitForFunction((depth) => globalThis.spherecut!.frame!.depth > depth + 0.001, before.depth, { timeout: 1000 * patience });
  await tab.keyboard.press('Escape');
  await until(tab, 'it withdraws', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
  await tab.keyboard.press('?');
  await until(tab, 'the help', () => (document.getElementById('help') as HTMLDialogElement).open);
  assert.match((await tab.textContent('#help-body')) ?? '', /turn the blade/);
  await photograph(tab, out, 'keyboard', true);
  await tab.keyboard.press('Escape');
  // Every control has a name, and Tab reaches them.
  const nameless = await tab.evaluate(() =>
    [...document.querySelectorAll('button, input, select, canvas:not([aria-hidden])')]
      .filter((control) => {
        const labels = (control as HTMLInputElement).labels;
        return !(control.textContent?.trim() || control.getAttribute('aria-label') || (labels && labels.length > 0));
      })
      .map((control) => control.id),
  );
  assert.deepEqual(nameless, []);
  await tab.focus('#reset');
  await tab.keyboard.press('Tab');
  assert.equal(await tab.evaluate(() => document.activeElement?.id), 'home');
});

test('It works in a window of a telephone', async () => {
  await first.tab.click('#take');
  await until(first.tab, 'it has let go', () => !globalThis.spherecut!.holding);
  const { tab, complaints, context } = await openPage(browser, served.address, { width: 390, height: 844, touch: true });
  await ready(tab);
  organIsSeen(await see(tab), 'on a telephone');
  const wide = await tab.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
  assert.ok(wide <= 0, `${wide} pixels too wide`);
  assert.ok(!(await tab.isVisible('#panels')));
  await tab.tap('#view', { position: { x: 190, y: 300 } });
  await tab.tap('#press-hold');
  await until(tab, 'a press is felt', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.02);
  await tab.tap('#press-hold');
  await tab.tap('#panels-toggle');
  assert.ok(await tab.isVisible('#scenario'));
  assert.ok((await tab.evaluate(() => document.getElementById('view')!.clientHeight)) > 300, 'no room for the picture');
  assert.deepEqual(complaints, []);
  await context.close();
});

test('Nothing was complained of to the end', () => {
  assert.deepEqual(first.complaints, []);
  assert.equal(served.process.exitCode, null, served.said());
});
