// Long mode: random pressing, cutting and tearing through the page, watching both processes.
// node soak.mjs BUILD_FOLDER SOURCE_FOLDER SECONDS [SEED] prints one line every ten seconds and what was seen at the end;
// exit status 1 when something died, was not a number, grew, or was never done.
import { readFileSync } from 'node:fs';
import { loadavg } from 'node:os';
import { join } from 'node:path';
import type { Page as Tab } from 'playwright-core';
import { launch, openPage, until } from './browser';
import { above, look, ready } from './hand';
import { coarserFlap, serve } from './server';

const [build = '.', source = '.', length = '600', seed = '1'] = process.argv.slice(2);

/** Marsaglia's xorshift, 0 to 1. */
let state = Number(seed) || 1;
function random(): number {
  state ^= state << 13;
  state ^= state >>> 17;
  state ^= state << 5;
  return (state >>> 0) / 4294967296;
}
const between = (low: number, high: number): number => low + (high - low) * random();

/** Resident memory, MB. */
function memory(process: number): number {
  return Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${process}/status`, 'utf8'))?.[1] ?? 0) / 1024;
}

const mean = (values: number[]): number => values.reduce((sum, value) => sum + value, 0) / Math.max(values.length, 1);

// The flap of tearing, with a blade beside the grasper, by the linear law, which alone tears beside one, and time for a rebuild
// as the live liver has.
const flap =
  coarserFlap(readFileSync(join(source, 'scenarios/liver_flap.toml'), 'utf8')).replace('law = "neo_hookean"\n', '') +
  `
[blade]
edge = [[0.0, 0.0, 0.0], [0.010, 0.0, 0.007], [0.022, 0.0, 0.024]]
[[blade.path]]
time = 0.0
position = [-0.010, 0.003, 0.085]
[[blade.path]]
time = 1.0
position = [-0.004, 0.003, 0.045]
[haptics]
budget = 3.0
`;

const done = { press: 0, cut: 0, tear: 0, reset: 0, scenario: 0 };
const grown = { cuts: 0, cutArea: 0, tears: 0, tornArea: 0 };
const states = new Map<string, number>(); // of tears, as often as they were seen after an action
const faults: string[] = [];

/** Presses, cuts or pulls at a random place; false: there is no organ below it. */
async function act(tab: Tab, mode: string): Promise<boolean> {
  const pulls = mode === 'grasper';
  const place = await (pulls ? above(tab, between(-0.068, -0.056), between(-0.006, 0.012)) : above(tab, between(-0.06, 0.01), between(-0.02, 0.02))).catch(() => null);
  if (!place) return false;
  await tab.mouse.move(place.x, place.y);
  await tab.waitForTimeout(700);
  await tab.mouse.down();
  if (pulls) {
    await tab.keyboard.down(',');
    await tab.waitForTimeout(between(3000, 6000));
    await tab.keyboard.up(',');
    await tab.waitForTimeout(between(1000, 4000));
  } else {
    const [dx, dy] = [between(-60, 60), between(-35, 35)];
    for (let i = 1; i <= 25; ++i) {
      await tab.mouse.move(place.x + (dx * i) / 25, place.y + (dy * i) / 25);
      if (random() < 0.2) await tab.mouse.wheel(0, between(-100, 100));
      await tab.waitForTimeout(60);
    }
    // The body follows a cut more slowly than the hand.
    if (mode === 'blade') await tab.waitForTimeout(2000);
  }
  await tab.mouse.up();
  await tab.waitForTimeout(300);
  if (pulls) await tab.keyboard.down('.');
  if (pulls) await tab.waitForTimeout(2500);
  if (pulls) await tab.keyboard.up('.');
  return true;
}

async function anew(tab: Tab, ask: () => Promise<unknown>): Promise<void> {
  const epoch = await tab.evaluate(() => globalThis.spherecut!.session!.epoch);
  await ask();
  await tab.waitForFunction((old) => globalThis.spherecut!.session!.epoch > old, epoch, { timeout: 120_000 });
  await until(tab, 'a frame of the new session', () => globalThis.spherecut!.frame?.epoch === globalThis.spherecut!.session!.epoch, 60);
}

const tornOf = (tab: Tab): Promise<{ area: number; state: string; epoch: number }> =>
  tab.evaluate(() => {
    const { tear, session } = globalThis.spherecut!;
    return { area: tear?.area ?? 0, state: tear?.state ?? 'none', epoch: session!.epoch };
  });

const served = await serve(build, join(source, 'scenarios/liver_live.toml'), undefined, { 'flap.toml': flap });
const browser = await launch();
try {
  const { tab, complaints } = await openPage(browser, served.address);
  await ready(tab);
  const start = Date.now();
  const server: number[] = [];
  const pages: number[] = []; // MB of the page's heap
  const bodies: number[] = [];
  const tools: number[] = [];
  let reported = start;
  let actions = 0;
  while (Date.now() - start < 1000 * Number(length)) {
    actions += 1;
    if (actions % 5 === 0) {
      const other = (await tab.evaluate(() => globalThis.spherecut!.session!.scenario)) === 'flap.toml' ? 'scenario.toml' : 'flap.toml';
      await anew(tab, () => tab.selectOption('#scenario', other));
      done.scenario += 1;
    } else if (random() < 0.1) {
      await anew(tab, () => tab.keyboard.press('r'));
      done.reset += 1;
    }
    const before = { seen: await look(tab), torn: await tornOf(tab) };
    const { modes } = before.seen;
    const mode = modes[Math.floor(random() * modes.length)] ?? 'probe';
    await tab.keyboard.press(String(1 + ['probe', 'blade', 'grasper'].indexOf(mode)));
    await tab.waitForTimeout(200);
    if (await act(tab, mode)) done[mode === 'probe' ? 'press' : mode === 'blade' ? 'cut' : 'tear'] += 1;
    if (random() < 0.2) await tab.keyboard.press(['n', 'c', 'x', 'b'][Math.floor(random() * 4)] ?? 'n');
    const after = { seen: await look(tab), torn: await tornOf(tab) };
    if (after.torn.area > before.torn.area) {
      grown.tears += 1;
      grown.tornArea += after.torn.area - before.torn.area;
    }
    const cut = after.seen.cutArea - before.seen.cutArea - (after.torn.area - before.torn.area);
    if (cut > 1e-7) {
      grown.cuts += 1;
      grown.cutArea += cut;
    }
    if (after.torn.state !== 'none') states.set(after.torn.state, (states.get(after.torn.state) ?? 0) + 1);
    const sane = await tab.evaluate(() => {
      const frame = globalThis.spherecut!.frame!;
      const positions = globalThis.spherecut!.view.body.snapshot()!.positions;
      return [...frame.force, ...frame.tip, frame.depth].every(Number.isFinite) && positions.every(Number.isFinite);
    });
    if (!sane) faults.push(`not a number after ${actions} actions`);
    if (served.process.exitCode !== null) faults.push(`the server ended: ${served.said()}`);
    if (faults.length > 0) break;
    if (Date.now() - reported > 10_000) {
      reported = Date.now();
      const [body, tool, heap] = await tab.evaluate(() => {
        const { latency, toolLatency } = globalThis.spherecut!;
        const { memory } = performance as unknown as { memory?: { usedJSHeapSize: number } };
        return [latency.quantile(0.95), toolLatency.quantile(0.95), (memory?.usedJSHeapSize ?? 0) / 1048576];
      });
      server.push(memory(served.process.pid ?? 0));
      pages.push(heap ?? 0);
      if (body !== null && body !== undefined) bodies.push(body);
      if (tool !== null && tool !== undefined) tools.push(tool);
      const ms = (list: number[]): string => (1000 * (list[list.length - 1] ?? NaN)).toFixed(0);
      console.log(
        `${((reported - start) / 1000).toFixed(0)} s, ${actions} actions, server ${server[server.length - 1]?.toFixed(0)} MB, page ${heap?.toFixed(0)} MB, ` +
          `load ${loadavg()[0]?.toFixed(0)}, hand to picture 95 % ${ms(tools)} ms, of the body ${ms(bodies)} ms, ${grown.cuts} cuts ${(grown.cutArea * 1e4).toFixed(2)} cm2, ` +
          `${grown.tears} tears ${(grown.tornArea * 1e4).toFixed(2)} cm2`,
      );
    }
  }
  faults.push(...complaints);
  const thirds = (list: number[]): [number, number] | null => {
    const third = Math.floor(list.length / 3);
    return third >= 2 ? [mean(list.slice(third, 2 * third)), mean(list.slice(-third))] : null;
  };
  const grows = (what: string, list: number[], most: (early: number) => number): void => {
    const parts = thirds(list);
    if (!parts) return;
    console.log(`${what}: ${parts[0].toFixed(2)} in the second third, ${parts[1].toFixed(2)} in the last`);
    if (parts[1] > most(parts[0])) faults.push(`${what} grows from ${parts[0].toFixed(2)} to ${parts[1].toFixed(2)}`);
  };
  grows('memory of the server, MB', server, (early) => 1.2 * early + 20);
  grows('heap of the page, MB', pages, (early) => 1.5 * early + 20);
  grows('hand to picture 95 %, s', tools, (early) => 2 * early + 0.25);
  if (Number(length) >= 300 && (grown.cuts === 0 || grown.tears === 0)) faults.push('nothing was cut, or nothing tore');
  console.log(
    `${actions} actions: ${JSON.stringify(done)}; cut ${grown.cuts} times, ${(grown.cutArea * 1e4).toFixed(2)} cm2; torn ${grown.tears} times, ` +
      `${(grown.tornArea * 1e4).toFixed(2)} cm2; tears after actions: ${JSON.stringify(Object.fromEntries(states))}; ${faults.length} faults`,
  );
} finally {
  await browser.close();
  await served.stop();
}
for (const fault of faults) console.error(fault);
process.exit(faults.length > 0 ? 1 : 0);
