// Rates and latencies of the live liver of 20,000 triangles, drawn by the processor: node measure.mjs BUILD_FOLDER SOURCE_FOLDER
// A press that slides and a cut, first through the page alone, then with a second client that only reads the feed. Ends with
// status 1 when the feed has fewer than 20 frames a second, or the hand is later than 250 ms (95 %) in the picture.
// node measure.mjs BUILD_FOLDER SOURCE_FOLDER stroke [KEY=VALUE ...]: a wavy stroke of the blade as a user draws it, in five
// seconds and, in a session begun anew, at 30 mm/s; as a table. Keys of the scenario take other values (fine_spacing=0.004).
// node measure.mjs BUILD_FOLDER SOURCE_FOLDER picture: what a picture of the live liver takes, drawn as a whole and for a tool
// that moves alone, with each shading, in a window of 1280 x 800.
import { readdirSync, readFileSync } from 'node:fs';
import { loadavg } from 'node:os';
import { join } from 'node:path';
import type { Page as Tab } from 'playwright-core';
import { launch, openPage, until } from './browser';
import { Feed } from './feed';
import { above, chooseMode, hover, look, ready } from './hand';
import { stageNames } from '../source/protocol';
import { serve, withValues } from './server';
import { mouthOfWound, seenOfWound, watchWound } from './wound';

const [build = '.', source = '.', kind = 'rates', ...values] = process.argv.slice(2);

const leastFrames = 20; // a second
const mostLatency = 0.25; // s
const misses: string[] = [];

const ms = (seconds: number | null): string => (seconds === null ? '-' : `${(1000 * seconds).toFixed(0)} ms`);

/** What the page counts since its start; wall clock of the session's stages, s. */
function counters(tab: Tab): Promise<{ frame: number; vertices: number; pictures: number; stages: number[] }> {
  return tab.evaluate(() => {
    const { frame, seenVertices, pictures, stages } = globalThis.spherecut!;
    return { frame: frame!.number, vertices: seenVertices, pictures, stages: [...(stages ?? [])] };
  });
}

/** Does `act` and says what came meanwhile. */
async function measured(tab: Tab, feed: Feed | null, what: string, act: () => Promise<void>): Promise<void> {
  await tab.evaluate(() => [globalThis.spherecut!.latency, globalThis.spherecut!.toolLatency].forEach((latency) => latency.clear()));
  const [before, seen, start] = [await counters(tab), await look(tab), performance.now()];
  feed?.take();
  await act();
  const seconds = (performance.now() - start) / 1000;
  const [after, end, read] = [await counters(tab), await look(tab), feed?.take()];
  const rate = (count: number): string => (count / seconds).toFixed(1);
  console.log(
    `${what}: page ${rate(after.frame - before.frame)} frames a second, ${rate(after.vertices - before.vertices)} with new vertices, ` +
      `${rate(after.pictures - before.pictures)} pictures; ${rate(end.solve - seen.solve)} solves a second, cut ${(1e4 * (end.cutArea - seen.cutArea)).toFixed(2)} cm2`,
  );
  const stages = stageNames.map((name, i) => `${name} ${ms((after.stages[i] ?? 0) - (before.stages[i] ?? 0))}`);
  const { nodes, level } = await tab.evaluate(() => ({ nodes: globalThis.spherecut!.frame!.nodeCount, level: globalThis.spherecut!.frame!.level }));
  console.log(`  in ${seconds.toFixed(1)} s: ${stages.join(', ')}; ${nodes} nodes, coarsening ${level}`);
  const [body, tool, picture] = await tab.evaluate(() => {
    const { latency, toolLatency, view } = globalThis.spherecut!;
    const of = (list: typeof latency): (number | null)[] => [list.quantile(0.5), list.quantile(0.95), list.count];
    return [of(latency), of(toolLatency), [view.pictureSeconds, view.canvas.width, view.canvas.height]] as const;
  });
  console.log(
    `  from hand to picture, median and 95 %: tool and force ${ms(tool[0]!)}, ${ms(tool[1]!)} (${tool[2]} poses); ` +
      `body solved at it ${ms(body[0]!)}, ${ms(body[1]!)} (${body[2]}); a picture takes ${ms(picture[0]!)} at ${picture[1]} x ${picture[2]}`,
  );
  if ((tool[1] ?? Infinity) > mostLatency) misses.push(`${what}: hand to picture ${ms(tool[1] ?? null)} (95 %), asked for ${ms(mostLatency)}`);
  if (read && read.frames < leastFrames) misses.push(`${what}: the feed has ${read.frames.toFixed(1)} frames a second, asked for ${leastFrames}`);
  if (read) {
    console.log(
      `  client that only reads: ${read.frames.toFixed(1)} frames a second, ${read.vertices.toFixed(1)} with new vertices, ` +
        `${read.megabytes.toFixed(2)} MB/s, longest wait ${ms(read.longest)}`,
    );
  }
}

/** Moves the pressed pointer about for `seconds`; `way` in pixels at a time in s. */
async function drag(tab: Tab, from: { x: number; y: number }, seconds: number, way: (time: number) => [number, number]): Promise<void> {
  const start = performance.now();
  for (let time = 0; time < seconds; time = (performance.now() - start) / 1000) {
    const [dx, dy] = way(time);
    await tab.mouse.move(from.x + dx, from.y + dy);
    await tab.waitForTimeout(25);
  }
}

async function rates(): Promise<void> {
  for (const reads of [false, true]) {
    const served = await serve(build, join(source, 'scenarios/liver_live.toml'));
    const browser = await launch();
    const feed = reads ? new Feed(served.address) : null;
    try {
      const { tab } = await openPage(browser, served.address, { width: 1280, height: 720 });
      await ready(tab);
      await hover(tab, -0.03, -0.01);
      const middle = await above(tab, -0.03, -0.01);
      await tab.mouse.down();
      await until(tab, 'the force is felt', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.03);
      const name = reads ? ', with a client that only reads' : '';
      await measured(tab, feed, `sliding under pressure${name}`, () =>
        drag(tab, middle, 12, (time) => [25 * Math.sin(time / 0.7), 12 * Math.sin(1.7 * (time / 0.7))]),
      );
      await tab.mouse.up();
      await chooseMode(tab, '2', 'blade');
      await hover(tab, -0.06, 0.004);
      const [start, end] = [await above(tab, -0.06, 0.004), await above(tab, 0.01, 0)];
      await tab.mouse.move(start.x, start.y);
      await tab.mouse.down();
      await until(tab, 'the blade goes in', () => globalThis.spherecut!.frame!.depth > 0.004);
      await measured(tab, feed, `cutting${name}`, () =>
        drag(tab, start, 12, (time) => [((end.x - start.x) * time) / 12, ((end.y - start.y) * time) / 12]),
      );
      await tab.mouse.up();
    } finally {
      feed?.close();
      await browser.close();
      await served.stop();
    }
  }
}

/** Processor time of this process's descendants but for the server's, s: that of the browser. */
function browserTime(server: number): number {
  const parents = new Map<number, number>();
  for (const name of readdirSync('/proc')) {
    if (!/^\d+$/.test(name)) continue;
    try {
      parents.set(Number(name), Number(readFileSync(`/proc/${name}/stat`, 'latin1').replace(/^.*\) /, '').split(' ')[1]));
    } catch {
      // It has ended.
    }
  }
  const ours = (pid: number): boolean => pid !== server && (pid === process.pid || (parents.has(pid) && ours(parents.get(pid)!)));
  return [...parents.keys()].filter((pid) => pid !== process.pid && ours(pid)).reduce((sum, pid) => sum + processorTime(pid), 0);
}

/** Processor time of a process with all its threads, s. */
function processorTime(pid: number): number {
  const fields = readFileSync(`/proc/${pid}/stat`, 'latin1').replace(/^.*\) /, '').split(' ');
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

const sorted = (list: number[]): number[] => [...list].sort((a, b) => a - b);
const quantile = (list: number[], q: number): number | null => sorted(list)[Math.min(list.length - 1, Math.floor(q * list.length))] ?? null;
const newton = (force: number | null): string => (force === null ? '-' : `${force.toFixed(3)} N`);

/** A wavy stroke of 55 mm over the liver, first in five seconds, then at 30 mm/s in a new session. */
async function strokes(): Promise<void> {
  const change = (text: string): string => withValues(text, Object.fromEntries(values.map((value) => value.split('=', 2) as [string, string])));
  const begun = performance.now();
  const served = await serve(build, join(source, 'scenarios/liver_live.toml'), change);
  const browser = await launch();
  const rows: string[][] = [];
  try {
    const { tab } = await openPage(browser, served.address, { width: 1280, height: 720 });
    await ready(tab);
    console.log(`from the start of the server to the first picture ${((performance.now() - begun) / 1000).toFixed(1)} s; load ${loadavg()[0]!.toFixed(1)}`);
    await watchWound(tab);
    const points = 40;
    const ways = Array.from({ length: points + 1 }, (_, i) => [-0.055 + (0.05 * i) / points, 0.002 + 0.003 * Math.sin((3 * Math.PI * i) / points)] as const);
    const length = ways.slice(1).reduce((sum, [x, y], i) => sum + Math.hypot(x - ways[i]![0], y - ways[i]![1]), 0);
    for (const seconds of [5, length / 0.03]) {
      await chooseMode(tab, '2', 'blade');
      await hover(tab, ...ways[0]!);
      const places: { x: number; y: number }[] = [];
      for (const [x, y] of ways) places.push(await above(tab, x, y));
      await tab.mouse.move(places[0]!.x, places[0]!.y);
      await tab.mouse.down();
      await until(tab, 'the blade goes in', () => globalThis.spherecut!.frame!.depth > 0.004);
      await tab.evaluate(() => Object.assign(globalThis.woundWatch!, { places: [], next: 0, lags: [], forces: [] }));
      await tab.evaluate(() => [globalThis.spherecut!.latency, globalThis.spherecut!.toolLatency].forEach((latency) => latency.clear()));
      const [before, seen, spent, start] = [await counters(tab), await look(tab), processorTime(served.process.pid!), performance.now()];
      for (let time = 0; time < seconds; time = (performance.now() - start) / 1000) {
        const at = (points * time) / seconds;
        const leg = Math.min(Math.floor(at), points - 1);
        const [a, b] = [places[leg]!, places[leg + 1]!];
        await tab.mouse.move(a.x + (b.x - a.x) * (at - leg), a.y + (b.y - a.y) * (at - leg));
        await tab.waitForTimeout(16);
      }
      const took = (performance.now() - start) / 1000;
      const [after, end] = [await counters(tab), await look(tab)];
      const worked = processorTime(served.process.pid!) - spent;
      const forces = (await seenOfWound(tab)).forces;
      const tool = await tab.evaluate(() => [0.5, 0.95].map((q) => globalThis.spherecut!.toolLatency.quantile(q)));
      const { nodes, level } = await tab.evaluate(() => ({ nodes: globalThis.spherecut!.frame!.nodeCount, level: globalThis.spherecut!.frame!.level }));
      await tab.waitForTimeout(1500); // what is still to come
      const wound = await seenOfWound(tab);
      await tab.mouse.up();
      await tab.waitForTimeout(2000);
      const [mouth, last] = [await mouthOfWound(tab), await look(tab)];
      const stages = stageNames.map((name, i) => `${name} ${ms((after.stages[i] ?? 0) - (before.stages[i] ?? 0))}`);
      console.log(`${(1000 * length).toFixed(0)} mm in ${took.toFixed(1)} s: ${stages.join(', ')}; load ${loadavg()[0]!.toFixed(1)}`);
      console.log(`  ${last.messages.replaceAll('\n', ' | ')}`);
      rows.push([
        `${((1000 * length) / took).toFixed(0)} mm/s`,
        `${nodes}, ${level}`,
        ((end.solve - seen.solve) / took).toFixed(1),
        ((after.pictures - before.pictures) / took).toFixed(1),
        `${ms(tool[0]!)}, ${ms(tool[1]!)}`,
        `${ms(quantile(wound.lags, 0.5))}, ${ms(quantile(wound.lags, 0.95))} (${wound.reached} of ${wound.passed})`,
        `${newton(quantile(forces, 0.5))}, ${newton(quantile(forces, 1))}`,
        `${(1e4 * last.cutArea).toFixed(2)} cm2`,
        `${(1000 * mouth.width).toFixed(1)} mm, ${mouth.pixels.toFixed(0)} px`,
        `${(worked / took).toFixed(2)}`,
      ]);
      if (rows.length === 2) break;
      const reset = performance.now();
      const epoch = await tab.evaluate(() => globalThis.spherecut!.session!.epoch);
      await tab.click('#reset');
      await tab.waitForFunction((old) => globalThis.spherecut!.session!.epoch !== old && globalThis.spherecut!.frame?.epoch !== old, epoch);
      console.log(`  a reset takes ${((performance.now() - reset) / 1000).toFixed(1)} s`);
      await ready(tab);
    }
  } finally {
    await browser.close();
    await served.stop();
  }
  const head = ['blade', 'nodes, level', 'solves/s', 'pictures/s', 'tool 50, 95 %', 'wound 50, 95 %', 'force 50, 100 %', 'cut', 'mouth', 'cores of the server'];
  console.log(`| ${head.join(' | ')} |\n|${head.map(() => '---').join('|')}|`);
  for (const row of rows) console.log(`| ${row.join(' | ')} |`);
}

/** Draws `count` pictures, each waited for to its last pixel, as a whole or for a tool that moves alone; ms of each. */
function pictureTimes(tab: Tab, alone: boolean, count: number): Promise<number[]> {
  return tab.evaluate(
    ([tool, most]) => {
      const { view } = globalThis.spherecut!;
      const gl = view.canvas.getContext('webgl2')!;
      const pixel = new Uint8Array(4);
      return Array.from({ length: Number(most) }, () => {
        const start = performance.now();
        if (tool) {
          view.moved();
          view.drawNow();
        } else view.drawWhole();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        return performance.now() - start;
      });
    },
    [alone, count],
  );
}

async function pictures(): Promise<void> {
  const served = await serve(build, join(source, 'scenarios/liver_live.toml'));
  const browser = await launch();
  try {
    const { tab } = await openPage(browser, served.address, { width: 1280, height: 800 });
    await ready(tab);
    await hover(tab, -0.03, -0.012);
    await tab.waitForTimeout(1500);
    // Nothing else draws, and every pixel of the page has one of the picture.
    await tab.evaluate(() => {
      const page = globalThis.spherecut as unknown as { show(): void };
      page.show = () => undefined;
      const view = globalThis.spherecut!.view as unknown as { adapt(): void; sharpness: number; resize(): void };
      view.adapt = () => undefined;
      view.sharpness = 1;
      view.resize();
    });
    const size = await tab.evaluate(() => `${globalThis.spherecut!.view.canvas.width} x ${globalThis.spherecut!.view.canvas.height}`);
    const count = 100;
    for (const [what, shading, alone] of [['as a whole, with grain', 'fine', false], ['as a whole, plain', 'plain', false], ['tool alone', 'fine', true]] as const) {
      await tab.selectOption('#shading', shading);
      await pictureTimes(tab, alone, 8);
      const before = browserTime(served.process.pid!);
      const times = await pictureTimes(tab, alone, count);
      const spent = (1000 * (browserTime(served.process.pid!) - before)) / count;
      console.log(
        `a picture of ${size}, ${what}: ${quantile(times, 0.5)!.toFixed(1)} ms (5 % ${quantile(times, 0.05)!.toFixed(1)}), ` +
          `${spent.toFixed(1)} ms of processor time; load ${loadavg()[0]!.toFixed(1)}`,
      );
    }
  } finally {
    await browser.close();
    await served.stop();
  }
}

await { stroke: strokes, picture: pictures, rates }[kind]!();
for (const miss of misses) console.error(`MISSED: ${miss}`);
process.exit(misses.length > 0 ? 1 : 0);
