// How the page looks to somebody who opens it: node look.test.mjs BUILD_FOLDER SOURCE_FOLDER
// Colours are those that the browser has composited, at places that the camera and the geometry tell.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test, { after, before } from 'node:test';
import type { Browser, Page as Tab } from 'playwright-core';
import { block, press, withdraw } from './block';
import { launch, type Opened, openPage, until } from './browser';
import { box, composited, count, frames, organIsSeen, type Picture, see } from './composited';
import { chooseMode, hover, ready } from './hand';
import { serve, type Served } from './server';

const [build = '.', source = '.'] = process.argv.slice(2);
let served: Served;
let browser: Browser;
let opened: Opened;

// A slit of 30 mm across the pull of a block, 10 mm deep.
const slit = '[[precut]]\nshape = "rectangle"\ncentre = [0, 0, 0.03]\nnormal = [0, 1, 0]\nup = [0, 0, 1]\nwidth = 0.03\nheight = 0.02\n';
const pulled = (text: string): string => text.replace('poisson_ratio = 0.3', 'poisson_ratio = 0.3\npretension = [0.0, 0.25, 0.0]')
  .replace('region = "half_space"\npoint = [-0.029, 0, 0]\nnormal = [1, 0, 0]', 'region = "half_space"\npoint = [0, -0.029, 0]\nnormal = [0, 1, 0]')
  .replace('region = "half_space"\npoint = [0.029, 0, 0]\nnormal = [-1, 0, 0]', 'region = "half_space"\npoint = [0, 0.029, 0]\nnormal = [0, -1, 0]');

before(async () => {
  const others = { 'slit.toml': pulled(block('slit', slit)) };
  served = await serve(build, join(source, 'scenarios/liver_live.toml'), () => block('whole'), others);
  browser = await launch();
  opened = await openPage(browser, served.address, { width: 1100, height: 760, first: true });
});

after(async () => {
  await browser?.close();
  await served?.stop();
});

/** Red, green, blue of a place of the page in px, of its 3 x 3 pixels. */
function colourAt(picture: Picture, { x, y }: { x: number; y: number }): [number, number, number] {
  const sum: [number, number, number] = [0, 0, 0];
  for (const dy of [-1, 0, 1]) {
    for (const dx of [-1, 0, 1]) {
      const i = 4 * ((Math.floor(y * picture.ratio) + dy) * picture.width + Math.floor(x * picture.ratio) + dx);
      for (let k = 0; k < 3; ++k) sum[k]! += picture.data[i + k]! / 9;
    }
  }
  return sum;
}

const light = ([r, g, b]: readonly number[]): number => 0.21 * r! + 0.72 * g! + 0.07 * b!;
const mean = (values: readonly number[]): number => values.reduce((sum, value) => sum + value, 0) / values.length;

/** Places of the page where the surface is drawn above a raster on the block's top, px; `reach` in m. */
function raster(tab: Tab, reach: number, step: number): Promise<{ x: number; y: number }[]> {
  return tab.evaluate(
    ([far, apart]) => {
      const { view } = globalThis.spherecut!;
      const { left, top } = view.canvas.getBoundingClientRect();
      const places: { x: number; y: number }[] = [];
      for (let x = -far!; x <= far!; x += apart!) {
        for (let y = -far!; y <= far!; y += apart!) {
          const hit = view.body.cast([x, y, 1], [0, 0, -1]);
          if (!hit) continue;
          const pixel = view.pixel(hit.point);
          places.push({ x: left + pixel.x, y: top + pixel.y });
        }
      }
      return places;
    },
    [reach, step],
  );
}

/** Chooses the shading in its list, which may be folded away. */
const drawn = (tab: Tab, shading: 'fine' | 'plain'): Promise<void> =>
  tab.evaluate((wanted) => {
    Object.assign(globalThis.spherecut!.view, { adapt: () => undefined });
    const list = document.getElementById('shading') as HTMLSelectElement;
    list.value = wanted;
    list.dispatchEvent(new Event('change'));
  }, shading);

test('The first visit has panels folded and a hint of three lines, which a click takes away for good', async () => {
  const { tab, context } = opened;
  await ready(tab);
  assert.ok(await tab.isVisible('#hint'));
  assert.equal(await tab.locator('#hint p').count(), 3);
  assert.ok(!(await tab.isVisible('#panels')));
  const lines = await tab.locator('#hint p').evaluateAll((all) => all.map((line) => line.getClientRects()[0]!.height / parseFloat(getComputedStyle(line).lineHeight)));
  assert.ok(lines.every((height) => height < 1.5), `lines that are ${lines} lines high`);
  await tab.click('#hint-close');
  assert.ok(!(await tab.isVisible('#hint')));
  await tab.keyboard.press('0');
  assert.ok(await tab.isVisible('#panels'));
  const again = await context.newPage();
  await again.goto(served.address);
  await until(again, 'it has begun', () => Boolean(globalThis.spherecut?.session));
  assert.ok(!(await again.isVisible('#hint')), 'the hint comes again');
  assert.ok(await again.isVisible('#panels'), 'the panels are folded again');
  await again.close();
  await tab.keyboard.press('0');
  organIsSeen(await see(tab), 'with the panels folded');
});

test('The first press takes the hint away too; on a telephone it fits, and with reduced motion nothing moves by itself', async () => {
  const { tab, context } = await openPage(browser, served.address, { width: 390, height: 760, touch: true, first: true, still: true });
  await until(tab, 'it has begun', () => Boolean(globalThis.spherecut?.frame));
  const [hint, view] = [await box(tab, 'hint'), await box(tab, 'view')];
  assert.ok(hint.left >= view.left && hint.right <= view.right && hint.top > view.top && hint.bottom <= view.bottom, JSON.stringify(hint));
  assert.equal(await tab.evaluate(() => document.getAnimations().length), 0);
  assert.ok(await tab.evaluate(() => matchMedia('(prefers-reduced-motion: reduce)').matches));
  await opened.tab.click('#take');
  await until(tab, 'the tool is free', () => globalThis.spherecut!.holder === null);
  await tab.tap('#take');
  await until(tab, 'the tool is in the hand', () => globalThis.spherecut!.holding);
  const at = await tab.evaluate(() => {
    const { view } = globalThis.spherecut!;
    const hit = view.body.cast([0, 0, 1], [0, 0, -1])!;
    return view.pixel(hit.point);
  });
  await tab.tap('#scene', { position: at });
  assert.ok(!(await tab.isVisible('#hint')));
  await tab.tap('#take');
  await context.close();
  await opened.tab.click('#take');
  await until(opened.tab, 'the tool is back', () => globalThis.spherecut!.holding);
});

test('Tissue has grain and a wet highlight; the plain shading has less grain', async () => {
  const { tab } = opened;
  await tab.keyboard.press('k');
  await until(tab, 'the tool is away', () => globalThis.spherecut!.frame!.depth < -0.015);
  const grain: number[] = [];
  for (const shading of ['fine', 'plain'] as const) {
    await drawn(tab, shading);
    const picture = await composited(tab);
    const places = await raster(tab, 0.014, 0.001);
    const lights = places.map((place) => light(colourAt(picture, place)));
    // Neighbours differ by the grain; the median leaves out where the light falls off.
    const steps = lights.slice(1).map((value, i) => Math.abs(value - lights[i]!));
    grain.push(steps.sort((a, b) => a - b)[steps.length >> 1]!);
  }
  await drawn(tab, 'fine');
  assert.ok(grain[0]! > 0.8, `neighbours differ by ${grain[0]} of 255`);
  assert.ok(grain[0]! > 3 * grain[1]!, `${grain[0]} with the grain, ${grain[1]} without`);
  // The block's top is flat: turned to the lamp it shines.
  const shine = await tab.evaluate(() => {
    const { view } = globalThis.spherecut!;
    let best = 0;
    for (let elevation = 0; elevation < 40; ++elevation) {
      view.orbit.turn(0, 0.02);
      view.drawWhole();
      const gl = view.canvas.getContext('webgl2')!;
      const bytes = new Uint8Array(4 * view.canvas.width * view.canvas.height);
      gl.readPixels(0, 0, view.canvas.width, view.canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      let bright = 0;
      for (let i = 0; i < bytes.length; i += 4) if (bytes[i]! > 235 && bytes[i + 1]! > 190 && bytes[i + 2]! > 180) bright += 1;
      best = Math.max(best, bright);
    }
    globalThis.spherecut!.home();
    return best;
  });
  assert.ok(shine > 60, `${shine} px of a highlight`);
});

test('The tool throws a shadow on the tissue, where the lamp says, and nowhere else', async () => {
  const { tab } = opened;
  await drawn(tab, 'plain'); // without grain a shadow is what differs
  const bare = await composited(tab);
  await hover(tab, 0.0, 0.0);
  await frames(tab, 20);
  const under = await composited(tab);
  // Where the line from the lamp through the middle of the tip's ball meets the surface.
  const at = await tab.evaluate(() => {
    const { view, frame, session } = globalThis.spherecut!;
    const lamp = view.body.lighting.lamp.value;
    const radius = session!.tool!.radius;
    const ball = frame!.tip.map((x, d) => x + radius * frame!.axis[d]!);
    const hit = view.body.cast(ball as [number, number, number], [-lamp.x, -lamp.y, -lamp.z])!;
    const { left, top } = view.canvas.getBoundingClientRect();
    const beside = [0.75, 1.0].map((part) => {
      const across = [-lamp.x, -lamp.y].map((x) => (x / Math.hypot(lamp.x, lamp.y)) * radius * part);
      return view.pixel([hit.point[0] + across[0]!, hit.point[1] + across[1]!, hit.point[2]]);
    });
    return { places: beside.map(({ x, y }) => ({ x: left + x, y: top + y })), visible: view.shadow.mesh.visible };
  });
  assert.ok(at.visible);
  const darker = at.places.map((place) => light(colourAt(under, place)) / light(colourAt(bare, place)));
  assert.ok(Math.min(...darker) < 0.75, `where the shadow is the picture keeps ${darker} of its light`);
  // Away from it nothing has changed.
  const far = (await raster(tab, 0.028, 0.004)).filter(({ x }) => at.places.every((place) => place.x - x > 320)); // towards the lamp, beside the tool
  const same = far.filter((place) => Math.abs(light(colourAt(under, place)) - light(colourAt(bare, place))) < 3).length;
  assert.ok(far.length > 10 && same > 0.95 * far.length, `${same} of ${far.length} places away from the tool are as before`);
  await drawn(tab, 'fine');
});

test('Nothing of a kept picture shows beside one that is drawn as a whole', async () => {
  const { tab } = opened;
  await hover(tab, 0.01, 0.01);
  for (let i = 0; !(await tab.evaluate(() => globalThis.spherecut!.view.kept)); ++i) {
    await hover(tab, 0.01 + 0.001 * (i % 3), 0.01);
    await frames(tab, 2);
  }
  await tab.focus('#scene');
  await tab.keyboard.press('d', { delay: 500 });
  organIsSeen(await see(tab), 'turned');
  await tab.keyboard.press('n'); // what lies inside shows through
  await until(tab, 'nodes', () => globalThis.spherecut!.nodes !== null);
  await tab.keyboard.press('+', { delay: 300 });
  await frames(tab, 10);
  const hidden = await tab.evaluate(() => [...document.querySelectorAll('.still')].map((part) => getComputedStyle(part).visibility));
  assert.deepEqual(hidden, ['visible', 'hidden'], 'drape and kept picture');
  await tab.keyboard.press('n');
  await tab.keyboard.press('h');
  organIsSeen(await see(tab), 'at home');
});

test('The arrow and the readout have the colour of the force', async () => {
  const { tab } = opened;
  const green = async (): Promise<number> => {
    const colour = await tab.evaluate(() => getComputedStyle(document.getElementById('force')!).color);
    return Number(/rgb\(\d+, (\d+)/.exec(colour)![1]);
  };
  await press(tab);
  const gently = { force: await tab.evaluate(() => Math.hypot(...globalThis.spherecut!.frame!.force)), green: await green() };
  const arrow = await see(tab);
  assert.ok(arrow.arrow > arrow.arrowLength, `${arrow.arrow} px of an arrow of ${arrow.arrowLength}`);
  for (let i = 0; i < 4; ++i) await tab.mouse.wheel(0, -300);
  await tab.waitForFunction((before) => Math.hypot(...globalThis.spherecut!.frame!.force) > 1.4 * before, gently.force);
  await frames(tab, 20);
  assert.ok((await green()) < gently.green - 8, `green ${gently.green} at ${gently.force} N became ${await green()}`);
  for (let i = 0; i < 4; ++i) await tab.mouse.wheel(0, 300);
  await withdraw(tab);
});

test('The way ahead of the blade is drawn when it is asked for', async () => {
  const { tab } = opened;
  await chooseMode(tab, '2', 'blade');
  await hover(tab, -0.02, 0.0);
  const view = await box(tab, 'scene');
  assert.ok(count(await composited(tab), 'plan', view) < 10);
  await tab.keyboard.press('4');
  const shown = await composited(tab);
  assert.ok(count(shown, 'plan', view) > 60, `${count(shown, 'plan', view)} px of the way`);
  await tab.keyboard.press('4');
  assert.ok(count(await composited(tab), 'plan', view) < 10);
  await chooseMode(tab, '1', 'probe');
});

test('Errors say what to do', async () => {
  const { tab } = opened;
  await tab.keyboard.press('0');
  await tab.evaluate(() => document.querySelectorAll('details').forEach((panel) => (panel.open = true)));
  await tab.fill('#fine', '500');
  await tab.click('#method-form button');
  await until(tab, 'an error', () => document.querySelector('#messages [data-level=error]') !== null);
  const text = (await tab.textContent('#messages [data-level=error]'))!;
  assert.match(text, /^[A-Z]/);
  assert.match(text, /\. The organ stays as it was: correct the value in Material or Method and apply it again\.$/);
  assert.ok(await tab.isVisible('#panels'));
});

test('Walls of a wound are darker and redder than the surface beside them, and it gapes', async () => {
  const { tab } = opened;
  const epoch = await tab.evaluate(() => globalThis.spherecut!.session!.epoch);
  await tab.selectOption('#scenario', 'slit.toml');
  await tab.waitForFunction((old) => globalThis.spherecut!.session!.epoch > old, epoch);
  await tab.keyboard.press('k');
  await until(tab, 'the slit gapes', () => globalThis.spherecut!.view.body.lipsApart() > 2e-3);
  await tab.evaluate(() => {
    globalThis.spherecut!.view.orbit.turn(0.35, 0.2);
    globalThis.spherecut!.view.orbit.zoom(1.6);
    globalThis.spherecut!.view.change();
  });
  const picture = await composited(tab, 20);
  const { walls, surface } = await tab.evaluate(async () => {
    const { view } = globalThis.spherecut!;
    const topology = view.body.topology!;
    const { positions } = view.body.surface()!;
    const eye = view.orbit.camera.position.toArray();
    const { left, top } = view.canvas.getBoundingClientRect();
    type Vec = [number, number, number];
    const corner = (t: number, k: number): Vec => {
      const v = topology.triangles[3 * t + k]!;
      return [positions[3 * v]!, positions[3 * v + 1]!, positions[3 * v + 2]!];
    };
    const sub = (a: Vec, b: Vec): Vec => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    const cross = (a: Vec, b: Vec): Vec => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const far = (way: Vec, t: number): number => {
      const [a, u, v] = [corner(t, 0), sub(corner(t, 1), corner(t, 0)), sub(corner(t, 2), corner(t, 0))];
      const p = cross(way, v);
      const det = dot(u, p);
      if (det <= 1e-18) return Infinity;
      const s = sub(eye, a);
      const x = dot(s, p) / det;
      const q = cross(s, u);
      const y = dot(way, q) / det;
      return x >= 0 && y >= 0 && x + y <= 1 ? dot(v, q) / det : Infinity;
    };
    const seen: { walls: { x: number; y: number }[]; surface: { x: number; y: number }[] } = { walls: [], surface: [] };
    for (let t = 0; t < topology.triangleCount; ++t) {
      const middle = [0, 1, 2].map((d) => (corner(t, 0)[d]! + corner(t, 1)[d]! + corner(t, 2)[d]!) / 3) as Vec;
      const wall = topology.parts[t] !== 0;
      if (!wall && (middle[2] < 0.029 || Math.abs(middle[0]) > 0.012 || Math.abs(middle[1]) > 0.015)) continue;
      const length = Math.hypot(...sub(middle, eye));
      const way = sub(middle, eye).map((x) => x / length) as Vec;
      let first = Infinity;
      for (let other = 0; other < topology.triangleCount; ++other) first = Math.min(first, far(way, other));
      if (first < length - 2e-4) continue;
      const pixel = view.pixel(middle);
      (wall ? seen.walls : seen.surface).push({ x: left + pixel.x, y: top + pixel.y });
    }
    return seen;
  });
  assert.ok(walls.length >= 5 && surface.length >= 20, `${walls.length} triangles of walls and ${surface.length} of the surface are in sight`);
  const [inside, beside] = [walls, surface].map((places) => places.map((place) => colourAt(picture, place)));
  const [dark, bright] = [mean(inside!.map(light)), mean(beside!.map(light))];
  assert.ok(dark < 0.6 * bright, `walls have ${dark}, the surface ${bright} of 255`);
  const redness = (colours: readonly (readonly number[])[]): number => mean(colours.map(([r, g]) => r! / Math.max(g!, 1)));
  assert.ok(redness(inside!) > 1.2 * redness(beside!), `walls ${redness(inside!)}, surface ${redness(beside!)}`);
});

test('Shading is chosen by what a picture takes: plain where it is slow, with coarser pixels where that does not do, fine again', async () => {
  const { tab, context } = await openPage(browser, served.address, { width: 900, height: 700 });
  await until(tab, 'it has begun', () => Boolean(globalThis.spherecut?.frame));
  const chosen = await tab.evaluate(() => {
    const view = globalThis.spherecut!.view as unknown as { adapt(): void; wholeSeconds: number; drawSeconds: number; fine: boolean; sharpness: number };
    const list: [boolean, number][] = [];
    // Whole pictures take so long, pictures on the average of these and of those of a tool alone.
    for (const [whole, all] of [[0.01, 0.01], [0.01, 0.01], [0.01, 0.01], [0.2, 0.05], [0.2, 0.05], [0.2, 0.2], [0.2, 0.2], [0.2, 0.2], [0.2, 0.01], [0.05, 0.01], [0.02, 0.01]] as const) {
      [view.wholeSeconds, view.drawSeconds] = [whole, all];
      view.adapt();
      list.push([view.fine, view.sharpness]);
    }
    return list.slice(2);
  });
  assert.deepEqual(chosen, [[true, 1], [false, 1], [false, 1], [false, 0.75], [false, 0.5], [false, 0.5], [false, 0.75], [false, 1], [true, 1]]);
  await context.close();
});

test('Nothing was complained of to the end', () => {
  assert.deepEqual(opened.complaints, []);
  assert.equal(served.process.exitCode, null, served.said());
});
