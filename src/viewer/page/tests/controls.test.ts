// Every control of the page against `spherecut serve`, on a block that solves quickly: node controls.test.mjs BUILD_FOLDER SOURCE_FOLDER
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import test, { after, before } from 'node:test';
import type { Browser, Page as Tab } from 'playwright-core';
import { PNG } from 'pngjs';
import { launch, type Opened, openPage, until } from './browser';
import { above, chooseMode, hover, look, lookSecond, ready } from './hand';
import { block, press, withdraw } from './block';
import { box, composited, count, organIsSeen, see, shadesIn } from './composited';
import { serve, type Served } from './server';

const [build = '.', source = '.'] = process.argv.slice(2);
let served: Served;
let browser: Browser;
let opened: Opened;

const through = '[[precut]]\nshape = "rectangle"\ncentre = [0.003, 0, 0.015]\nnormal = [1, 0, 0]\nup = [0, 0, 1]\nwidth = 0.1\nheight = 0.1\n';

before(async () => {
  const tough = block('two hands').replace('poisson_ratio = 0.3', 'poisson_ratio = 0.3\ntoughness = 5');
  const others = { 'severed.toml': block('severed', through), 'two.toml': tough };
  served = await serve(build, join(source, 'scenarios/liver_live.toml'), () => block('whole'), others);
  browser = await launch();
  opened = await openPage(browser, served.address);
  await ready(opened.tab);
  await opened.tab.evaluate(() => document.querySelectorAll('details').forEach((panel) => (panel.open = true)));
});

after(async () => {
  await browser?.close();
  await served?.stop();
});

const camera = (tab: Tab): Promise<{ eye: number[]; far: number }> =>
  tab.evaluate(() => {
    const { camera } = globalThis.spherecut!.view.orbit;
    return { eye: camera.position.toArray(), far: camera.position.length() };
  });

const moved = (a: readonly number[], b: readonly number[]): number => Math.hypot(...a.map((x, d) => x - (b[d] ?? 0)));

/** Waits for the session that `ask` brings about. */
async function anew(tab: Tab, ask: () => Promise<unknown>): Promise<void> {
  const epoch = await tab.evaluate(() => globalThis.spherecut!.session!.epoch);
  await ask();
  await tab.waitForFunction((old) => globalThis.spherecut!.session!.epoch > old, epoch);
  await until(tab, 'its first frame', () => globalThis.spherecut!.frame?.epoch === globalThis.spherecut!.session!.epoch);
}

test('A press shows an arrow at the tip, the spring to the hand, the readout in newtons and the chart', async () => {
  const { tab } = opened;
  await hover(tab, 0.001, 0.001);
  const before = await see(tab);
  organIsSeen(before, 'before the press');
  assert.ok(before.arrow < 20, `${before.arrow} px of an arrow without a force`);
  await press(tab);
  const pressed = await see(tab);
  organIsSeen(pressed, 'pressed');
  assert.ok(pressed.arrow > pressed.arrowLength && pressed.arrowLength > 20, `${pressed.arrow} px of an arrow of ${pressed.arrowLength} px`);
  assert.match((await tab.textContent('.readout .force')) ?? '', /^Force\s*[\d.]+ m?N$/);
  await until(tab, 'the readout is the force', () => {
    const { frame } = globalThis.spherecut!;
    const [number, unit] = document.getElementById('force')!.textContent!.split(' ');
    return Math.abs(Number(number) * (unit === 'mN' ? 1e-3 : 1) - Math.hypot(...frame!.force)) < 6e-4;
  });
  await until(tab, 'the readout below it is the torque', () => {
    const { frame } = globalThis.spherecut!;
    const [, number, prefix] = /^([\d.]+) ([munµ]?)N m$/.exec(document.getElementById('torque')!.textContent ?? '') ?? [];
    const scale = { '': 1, m: 1e-3, µ: 1e-6, n: 1e-9 }[prefix ?? ''] ?? NaN;
    const torque = Math.hypot(...frame!.torque);
    return Math.abs(Number(number) * scale - torque) <= 0.006 * torque + 1e-12;
  });
  await tab.waitForTimeout(600);
  assert.ok((await see(tab)).chart > before.chart + 20, 'the chart does not rise');
  // The spring is as long as the force divided by its stiffness, and can be switched off.
  const { apart, force } = await tab.evaluate(() => {
    const { frame, session } = globalThis.spherecut!;
    return { apart: Math.hypot(...frame!.hand.map((x, d) => x - frame!.tip[d]!)) * session!.spring, force: Math.hypot(...frame!.force) };
  });
  assert.ok(Math.abs(apart - force) < 0.05 * force, `${apart} N in the spring, ${force} N on the tool`);
  await tab.keyboard.press('u'); // the mouse has to stay where it is
  const without = await see(tab);
  assert.ok(pressed.hand > without.hand + 4, `no spring: ${pressed.hand} px with it, ${without.hand} without`);
  organIsSeen(without, 'without the spring');
  await tab.keyboard.press('u');
  await withdraw(tab);
  const after = await see(tab);
  organIsSeen(after, 'withdrawn');
  assert.ok(after.arrow < 20, `${after.arrow} px of an arrow stay`);
});

test('Wheel and pen pressure set the depth while pressing', async () => {
  const { tab, context } = opened;
  const depth = (): Promise<number> => tab.evaluate(() => (document.getElementById('press-depth') as HTMLInputElement).valueAsNumber);
  const first = await press(tab);
  const from = await depth();
  await tab.mouse.wheel(0, -200);
  await until(tab, 'the wheel is felt', () => globalThis.spherecut!.frame!.depth > 0.005);
  assert.ok((await depth()) > from, 'the slider does not show it');
  assert.ok((await look(tab)).depth > first.depth);
  await tab.mouse.wheel(0, 200);
  await withdraw(tab);
  const pen = await context.newCDPSession(tab);
  const at = await above(tab, 0.001, 0.001);
  const say = (type: 'mousePressed' | 'mouseMoved' | 'mouseReleased', force: number): Promise<unknown> =>
    pen.send('Input.dispatchMouseEvent', { type, x: at.x, y: at.y, button: 'left', buttons: 1, clickCount: 1, pointerType: 'pen', force });
  await say('mousePressed', 0.5);
  await say('mouseMoved', 0.25); // half of the depth
  await until(tab, 'the pen presses lightly', () => globalThis.spherecut!.frame!.depth > 0.0015);
  await tab.waitForTimeout(800);
  assert.ok((await look(tab)).depth < 0.0035, 'not lightly');
  await say('mouseMoved', 0.8);
  await until(tab, 'the pen presses harder', () => globalThis.spherecut!.frame!.depth > 0.0045);
  await say('mouseReleased', 0);
  await until(tab, 'the pen has left', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
  assert.equal(await depth(), from);
});

test('Orbit, pan and zoom by mouse', async () => {
  const { tab } = opened;
  const at = await above(tab, 0.001, 0.001);
  const drag = async (button: 'right' | 'middle'): Promise<void> => {
    await tab.mouse.move(at.x, at.y);
    await tab.mouse.down({ button });
    await tab.mouse.move(at.x + 60, at.y + 20, { steps: 4 });
    await tab.mouse.up({ button });
  };
  const start = await camera(tab);
  await drag('right');
  const turned = await camera(tab);
  assert.ok(moved(turned.eye, start.eye) > 0.02, 'it does not turn');
  await drag('middle');
  const panned = await camera(tab);
  assert.ok(moved(panned.eye, turned.eye) > 0.002, 'it does not move');
  await tab.mouse.wheel(0, -300);
  await tab.waitForFunction((far) => globalThis.spherecut!.view.orbit.camera.position.length() < 0.9 * far, panned.far);
  await tab.click('#home');
  assert.ok(moved((await camera(tab)).eye, start.eye) < 1e-9, 'not home');
});

test('Orbit, pan, zoom and the modes by keyboard', async () => {
  const { tab } = opened;
  await tab.focus('#scene');
  const start = await camera(tab);
  for (const key of ['a', 'd', 'w', 's', 'j', 'l', 'i', 'm', '+', '-', 'Shift+ArrowLeft', 'Shift+ArrowUp']) {
    const before = (await camera(tab)).eye;
    await tab.keyboard.press(key, { delay: 250 });
    assert.ok(moved((await camera(tab)).eye, before) > 1e-3, `${key} does nothing`);
  }
  await tab.keyboard.press('h');
  assert.ok(moved((await camera(tab)).eye, start.eye) < 1e-9, 'not home');
  await chooseMode(tab, '2', 'blade');
  assert.ok(await tab.isChecked('input[value=blade]'));
  await chooseMode(tab, '1', 'probe');
  await tab.keyboard.press('3');
  await until(tab, 'it says that there is none', () => /no grasper/.test(document.getElementById('messages')!.textContent!));
  for (const id of ['show-nodes', 'show-spheres', 'show-wire']) {
    const key = { 'show-nodes': 'n', 'show-spheres': 'b', 'show-wire': 'g' }[id]!;
    await tab.keyboard.press(key);
    assert.ok(await tab.isChecked(`#${id}`), `${key} does not switch ${id} on`);
    await tab.keyboard.press(key);
    assert.ok(!(await tab.isChecked(`#${id}`)), `${key} does not switch ${id} off`);
  }
});

test('Rates are live: haptic loop, misses, solve, frames, and the time of every stage', async () => {
  const { tab } = opened;
  await tab.waitForTimeout(1500); // of the last second
  const rows = await tab.evaluate(() => [...document.querySelectorAll('#rates tr')].map((row) => [...row.children].map((cell) => cell.textContent ?? '')));
  const row = (name: string): string => rows.find(([head]) => head === name)?.[1] ?? assert.fail(`no row ${name} in ${JSON.stringify(rows)}`);
  assert.ok(Number.parseFloat(row('Haptic loop')) > 0);
  assert.match(row('Haptic loop'), /^\d+ Hz/);
  assert.match(row('Deadline misses'), /^\d+ \(\d+\.\d\d %\)$/);
  assert.match(row('Tick'), /^[\d.]+ [mµ]s, wakes within/);
  assert.match(row('Solve'), /^[\d.]+ Hz, [\d.]+ [mµ]?s$/);
  assert.match(row('Frames'), /^[\d.]+ Hz sent, \d+ Hz drawn$/);
  assert.match(row('Hand to picture, p95'), /^tool [\d.]+ m?s, body [\d.]+ m?s$/);
  assert.match(row('Nodes'), /^\d+, \d+ in contact$/);
  const stages = rows.filter(([head]) => head!.startsWith('· '));
  assert.deepEqual(
    stages.map(([head]) => head!.slice(2)),
    ['contact and lips', 'nodes', 'assembly', 'condensation', 'cut', 'level sets', 'evaluation', 'pictures'],
  );
  const whole = stages.reduce((sum, [, share]) => sum + Number(/(\d+) %$/.exec(share!)![1]), 0);
  assert.ok(Math.abs(whole - 100) <= 4, `shares add up to ${whole} %`);
});

test('Displacement and stress are coloured, with a scale bar and units', async () => {
  const { tab } = opened;
  await press(tab);
  for (const [colours, name, unit] of [['displacement', 'displacement', 'm'], ['von_mises', 'von Mises stress', 'Pa']] as const) {
    await tab.selectOption('#colours', colours);
    await tab.waitForFunction((wanted) => document.getElementById('scale-name')!.textContent === wanted && !document.getElementById('scale')!.hidden, name);
    assert.match((await tab.textContent('#scale-high')) ?? '', new RegExp(`^[\\d.]+ [kmµ]?${unit}$`));
    const shades = shadesIn(await composited(tab), await box(tab, 'scale-bar'));
    assert.ok(shades > 40, `${shades} colours in the scale bar`);
    const shown = await tab.evaluate(() => {
      const { frame, view } = globalThis.spherecut!;
      const { positions } = view.body.snapshot()!;
      const rest = view.body.topology!.rest;
      let largest = 0;
      for (let v = 0; v < rest.length; v += 3) largest = Math.max(largest, Math.hypot(positions[v]! - rest[v]!, positions[v + 1]! - rest[v + 1]!, positions[v + 2]! - rest[v + 2]!));
      return { largest, told: frame!.largestDisplacement, high: document.getElementById('scale-high')!.textContent! };
    });
    const [value, prefix] = [Number.parseFloat(shown.high), /[kmµ](?=m$|Pa$)/.exec(shown.high)?.[0] ?? ''];
    const high = value * { k: 1e3, m: 1e-3, µ: 1e-6, '': 1 }[prefix as 'k']!;
    if (colours === 'displacement') assert.ok(Math.abs(high - shown.largest) < 0.01 * shown.largest, `${high} m, ${shown.largest} m in the geometry`);
    else assert.ok(high > 100 && high < 1e5, `${high} Pa`);
  }
  await tab.selectOption('#colours', 'none');
  assert.ok(!(await tab.isVisible('#scale')));
  await withdraw(tab);
});

test('A picture is saved as a PNG', async () => {
  const { tab } = opened;
  for (const ask of [() => tab.click('#screenshot'), () => tab.focus('#scene').then(() => tab.keyboard.press('Enter'))]) {
    const [download] = await Promise.all([tab.waitForEvent('download'), ask()]);
    assert.match(download.suggestedFilename(), /^spherecut-.*\.png$/);
    const bytes = readFileSync(await download.path());
    assert.deepEqual([...bytes.subarray(0, 8)], [137, 80, 78, 71, 13, 10, 26, 10]);
    const tissue = count({ ...PNG.sync.read(bytes), ratio: 1 }, 'tissue');
    assert.ok(tissue > 20_000, `${tissue} px of the organ`);
  }
});

test('Twice the modulus is twice the force at the same depth', async () => {
  const { tab } = opened;
  const soft = await press(tab);
  await withdraw(tab);
  await tab.fill('#young', '20');
  await anew(tab, () => tab.click('#material button'));
  assert.equal(await tab.evaluate(() => globalThis.spherecut!.session!.settings.young_modulus), 20_000);
  const stiff = await press(tab);
  await withdraw(tab);
  // Of a ball the force goes with the depth to the power of 3/2, nearly.
  const ratio = stiff.force / soft.force / (stiff.depth / soft.depth) ** 1.5;
  assert.ok(ratio > 1.8 && ratio < 2.2, `${ratio}: ${JSON.stringify([soft, stiff])}`);
});

test('Poisson ratio, toughness, method, support rule and spacings arrive at the session', async () => {
  const { tab } = opened;
  await tab.fill('#poisson', '0.4');
  await tab.fill('#toughness', '50');
  await tab.selectOption('#method', 'collocation');
  await tab.selectOption('#support-rule', 'visibility');
  await tab.fill('#fine', '6.5');
  await tab.fill('#coarse', '13');
  const before = await tab.evaluate(() => globalThis.spherecut!.session!.nodes);
  await anew(tab, () => tab.click('#method-form button'));
  const { settings, nodes } = await tab.evaluate(() => globalThis.spherecut!.session!);
  assert.deepEqual(settings, {
    young_modulus: 20_000,
    poisson_ratio: 0.4,
    toughness: 50,
    method: 'collocation',
    sight: 'visibility',
    fine_spacing: 0.0065,
    coarse_spacing: 0.013,
  });
  assert.ok(nodes > before, `${before} nodes became ${nodes}`);
  assert.ok((await press(tab)).force > 0.05);
  await withdraw(tab);
});

test('Another scenario is chosen from the list; its pieces are told with their volumes', async () => {
  const { tab } = opened;
  assert.deepEqual(await tab.$$eval('#scenario option', (options) => options.map((option) => option.textContent)), ['whole', 'severed', 'two hands']);
  await until(tab, 'the block is one piece', () => document.querySelectorAll('#pieces tr').length === 1);
  assert.equal(await tab.textContent('#pieces tr:first-child td:nth-child(2)'), '108.0');
  await anew(tab, () => tab.selectOption('#scenario', 'severed.toml'));
  await until(tab, 'there are two pieces', () => document.querySelectorAll('#pieces tr').length === 2);
  const volumes = await tab.$$eval('#pieces td:nth-child(2)', (cells) => cells.map((cell) => Number(cell.textContent)));
  const [small = 0, large = 0] = volumes.sort((a, b) => a - b); // 27 and 33 mm of 60 x 30 mm
  assert.ok(Math.abs(small - 48.6) < 0.1 && Math.abs(large - 59.4) < 0.1, `${volumes} cm3`);
  assert.match((await tab.textContent('#cut-state')) ?? '', /^Cut 18\.0 cm²/); // 60 x 30 mm
});

test('A picked node says how many it sees, and how many the cut hides from it', async () => {
  const { tab } = opened;
  await tab.click('#show-supports');
  await until(tab, 'nodes', () => (globalThis.spherecut!.nodes?.count ?? 0) > 50);
  await tab.evaluate(() => globalThis.spherecut!.home());
  // A node at the cut on the top that can be clicked.
  const at = await tab.evaluate(() => {
    const { nodes, view } = globalThis.spherecut!;
    const { count, spheres, kinds } = nodes!;
    const lips = [...Array(count).keys()].filter((i) => kinds[i] === 3 && spheres[4 * i + 2]! > 0.028);
    const node = lips.sort((a, b) => Math.abs(spheres[4 * a + 1]!) - Math.abs(spheres[4 * b + 1]!))[0]!;
    const box = view.canvas.getBoundingClientRect();
    const pixel = view.pixel([spheres[4 * node]!, spheres[4 * node + 1]!, spheres[4 * node + 2]!]);
    return { x: box.left + pixel.x, y: box.top + pixel.y };
  });
  await tab.mouse.click(at.x, at.y);
  await until(tab, 'what it sees', () => /sees \d+ nodes, [1-9]\d* hidden by the cut/.test(document.getElementById('support-state')!.textContent!));
  // Hidden ones lie on the other side of the cut at x = 3 mm, seen ones on its own.
  const sides = await tab.evaluate(() => {
    const { nodes, support } = globalThis.spherecut!;
    const { node, seen, hidden } = support!;
    const x = (i: number): number => nodes!.spheres[4 * i]!;
    const side = (i: number): number => Math.sign(x(i) - 0.003);
    return [[...seen].every((i) => side(i) === side(node)), [...hidden].every((i) => side(i) === -side(node))];
  });
  assert.deepEqual(sides, [true, true]);
  await tab.click('#show-supports');
});

test('Slices show the level sets of organ and cut, with a scale in metres', async () => {
  const { tab } = opened;
  for (const [slice, name] of [['organ', 'distance to the surface'], ['cut', 'distance to the cut']] as const) {
    await tab.selectOption('#slice', slice);
    await tab.waitForFunction((wanted) => document.getElementById('scale-name')!.textContent === wanted && !document.getElementById('scale')!.hidden, name);
    assert.match((await tab.textContent('#scale-low')) ?? '', /m$/);
  }
  await tab.selectOption('#slice', 'none');
  await until(tab, 'the scale is away', () => document.getElementById('scale')!.hidden);
});

test('A slice that comes when none is wanted any more is not shown', async () => {
  const { tab } = opened;
  const held = await tab.evaluate(async () => {
    const send = WebSocket.prototype.send;
    let kept = 0;
    WebSocket.prototype.send = function (this: WebSocket, data): void { // the server hears of it 1.5 s late
      if (typeof data !== 'string' || !data.includes('"slice":null')) return send.call(this, data);
      kept += 1;
      setTimeout(() => send.call(this, data), 1500);
    };
    const choose = (value: string): void => {
      const input = document.getElementById('slice') as HTMLSelectElement;
      input.value = value;
      input.dispatchEvent(new Event('change', { bubbles: true }));
    };
    choose('organ');
    choose('none');
    await new Promise((done) => setTimeout(done, 2500));
    WebSocket.prototype.send = send;
    return kept;
  });
  assert.ok(held > 0);
  assert.ok(await tab.evaluate(() => document.getElementById('scale')!.hidden));
});

test('Recording, replay and download by keyboard', async () => {
  const { tab } = opened;
  await anew(tab, () => tab.selectOption('#scenario', 'scenario.toml'));
  await tab.focus('#scene');
  await anew(tab, () => tab.keyboard.press('v'));
  await until(tab, 'it records', () => document.getElementById('record')!.getAttribute('aria-pressed') === 'true');
  await press(tab);
  await withdraw(tab);
  await tab.keyboard.press('v');
  await until(tab, 'it has recorded', () => !(document.getElementById('download') as HTMLButtonElement).disabled);
  const [download] = await Promise.all([tab.waitForEvent('download'), tab.keyboard.press('f')]);
  writeFileSync(join(served.folder, 'downloaded'), readFileSync(await download.path()));
  assert.deepEqual(readFileSync(join(served.folder, 'downloaded')), readFileSync(join(served.folder, 'out', download.suggestedFilename())));
  await anew(tab, () => tab.keyboard.press('y'));
  await until(tab, 'the press is felt again', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.03);
  await anew(tab, () => tab.keyboard.press('y'));
});

/** The blade in the second hand is over the organ, and the body has been solved for that. */
const bladeHovers = (tab: Tab): Promise<void> =>
  until(tab, 'the blade hovers', () => {
    const { second } = globalThis.spherecut!.frame!;
    return second !== null && Math.abs(second.depth) < 0.009 && second.poseInSolve === second.poseInTick;
  });

test('Two hands: by keys the probe presses and stays, by the mouse the blade cuts beside it', async () => {
  const { tab } = opened;
  await anew(tab, () => tab.selectOption('#scenario', 'two.toml'));
  await tab.focus('#scene');
  await tab.keyboard.press('h');
  await hover(tab, -0.014, 0.001);
  const alone = await see(tab);
  assert.ok(await tab.isHidden('#second-readout'));
  await tab.keyboard.press('5');
  await until(tab, 'the second hand has the blade', () => globalThis.spherecut!.frame!.second !== null);
  assert.equal(await tab.textContent('#hands'), 'mouse: blade, keys: probe (6: change)');
  await tab.keyboard.press(' ');
  await until(tab, 'the probe presses', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.03);
  const place = await above(tab, 0.013, 0.008);
  await tab.mouse.move(place.x, place.y);
  await bladeHovers(tab);
  const { force: pressing } = await look(tab);
  organIsSeen(await see(tab), 'with two tools');
  assert.ok(await tab.isVisible('#second-readout'));
  const to = await above(tab, 0.013, -0.014);
  await tab.mouse.down();
  await until(tab, 'the blade is in', () => globalThis.spherecut!.frame!.second!.depth > 0.005);
  let felt = 0;
  for (let i = 1; i <= 25; ++i) {
    await tab.mouse.move(place.x + ((to.x - place.x) * i) / 25, place.y + ((to.y - place.y) * i) / 25);
    await tab.waitForTimeout(60);
    felt = Math.max(felt, (await lookSecond(tab))!.force);
  }
  // Three quarters of 22 mm at a depth of 8 mm; the edge takes 40 mN at 5 J/m2.
  await until(tab, 'it has cut its way', () => globalThis.spherecut!.frame!.cutArea > 1.35e-4);
  felt = Math.max(felt, (await lookSecond(tab))!.force);
  assert.ok(felt > 0.03, `the blade feels ${felt} N of 5 J/m2`);
  // It stands there with its handle, of about 45 px by 130.
  const both = await see(tab);
  const handle = await tab.evaluate(() => {
    const { view, frame } = globalThis.spherecut!;
    const { left, top } = view.canvas.getBoundingClientRect();
    const { x, y } = view.pixel(frame!.second!.tip);
    return { left: left + x - 40, right: left + x + 120, top: Math.max(top, top + y - 330), bottom: top + y + 10 };
  });
  const [steel, before] = [both, alone].map(({ picture }) => count(picture, 'steel', handle));
  assert.ok(steel! > before! + 1000, `${steel} px of steel where the blade is, ${before} before it was there`);
  const { force } = await look(tab);
  assert.ok(force > 0.4 * pressing && force < 1.6 * pressing, `the probe stays: ${pressing} N before, ${force} N beside the cut`);
  await tab.mouse.up();
  // Mouse and keys change hands: the mouse leads the probe then, which rests where it was let go.
  await tab.keyboard.press('6');
  assert.equal(await tab.textContent('#hands'), 'mouse: probe, keys: blade (6: change)');
  await tab.keyboard.press('5');
  await until(tab, 'the second hand holds nothing', () => globalThis.spherecut!.frame!.second === null);
  assert.ok(await tab.isHidden('#hands'));
  await tab.keyboard.press(' ');
  await until(tab, 'the probe has withdrawn', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
  await anew(tab, () => tab.selectOption('#scenario', 'scenario.toml'));
});

test('One finger presses, two fingers zoom', async () => {
  await opened.tab.click('#take');
  await until(opened.tab, 'it has let go', () => !globalThis.spherecut!.holding);
  const { tab, context, complaints } = await openPage(browser, served.address, { width: 800, height: 700, touch: true });
  await ready(tab);
  await until(tab, 'the organ', () => globalThis.spherecut!.view.body.snapshot() !== null);
  const at = await above(tab, 0.001, 0.001);
  const touch = await context.newCDPSession(tab);
  const say = (type: 'touchStart' | 'touchMove' | 'touchEnd', points: { x: number; y: number; id: number }[]): Promise<unknown> =>
    touch.send('Input.dispatchTouchEvent', { type, touchPoints: points });
  await say('touchStart', [{ ...at, id: 1 }]);
  await until(tab, 'the finger presses', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.03);
  await say('touchEnd', []);
  await until(tab, 'it has withdrawn', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
  const { far } = await camera(tab);
  const two = (apart: number): { x: number; y: number; id: number }[] => [{ x: at.x - apart, y: at.y, id: 1 }, { x: at.x + apart, y: at.y, id: 2 }];
  await say('touchStart', two(30).slice(0, 1));
  await say('touchStart', two(30));
  for (let apart = 35; apart <= 80; apart += 5) await say('touchMove', two(apart));
  await say('touchEnd', []);
  assert.ok((await camera(tab)).far < 0.8 * far, 'it does not come nearer');
  assert.equal(await tab.evaluate(() => Math.hypot(...globalThis.spherecut!.frame!.force)), 0);
  // With two hands two fingers on the organ lead both: the first the blade, the second the probe.
  await anew(tab, () => tab.selectOption('#scenario', 'two.toml'));
  await tab.click('#home');
  await tab.click('#two-hands');
  await until(tab, 'the second hand has the blade', () => globalThis.spherecut!.frame!.second !== null);
  const [left, right] = [await above(tab, -0.014, 0.001), await above(tab, 0.014, 0.001)];
  await say('touchStart', [{ ...left, id: 1 }]);
  await until(tab, 'the blade is in', () => globalThis.spherecut!.frame!.second!.depth > 0.002);
  await say('touchStart', [{ ...left, id: 1 }, { ...right, id: 2 }]);
  await until(tab, 'the probe presses beside it', () => {
    const { frame } = globalThis.spherecut!;
    return Math.hypot(...frame!.force) > 0.03 && frame!.second!.depth > 0.002 && frame!.tip[0] > 0.005 && frame!.second!.tip[0] < -0.005;
  });
  await say('touchEnd', []);
  await until(tab, 'both have withdrawn', () => {
    const { frame } = globalThis.spherecut!;
    return Math.hypot(...frame!.force) === 0 && frame!.second!.depth < 0;
  });
  assert.deepEqual(complaints, []);
  await context.close();
});

test('Nothing was complained of to the end', () => {
  assert.deepEqual(opened.complaints, []);
  assert.equal(served.process.exitCode, null, served.said());
});
