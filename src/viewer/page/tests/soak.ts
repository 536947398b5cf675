// Long mode: random pressing, cutting and turning through the page, watching both processes.
// node soak.mjs BUILD_FOLDER SOURCE_FOLDER SECONDS [SEED] prints one line every ten seconds and what was seen at the end;
// exit status 1 when something died, was not a number, or grew.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { launch, openPage } from './browser';
import { above, look, ready } from './hand';
import { serve } from './server';

const [build = '.', source = '.', length = '600', seed = '1'] = process.argv.slice(2);

/** Marsaglia's xorshift, 0 to 1. */
let state = Number(seed) || 1;
function random(): number {
  state ^= state << 13;
  state ^= state >>> 17;
  state ^= state << 5;
  return (state >>> 0) / 4294967296;
}

/** Resident memory, MB. */
function memory(process: number): number {
  return Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${process}/status`, 'utf8'))?.[1] ?? 0) / 1024;
}

const faults: string[] = [];
const served = await serve(build, join(source, 'scenarios/liver_live.toml'));
const browser = await launch();
try {
  const { tab, complaints } = await openPage(browser, served.address);
  await ready(tab);
  const modes = (await look(tab)).modes;
  const start = Date.now();
  const server: number[] = [];
  const latencies: number[] = [];
  let reported = start;
  let actions = 0;
  while (Date.now() - start < 1000 * Number(length)) {
    actions += 1;
    const mode = modes[Math.floor(random() * modes.length)] ?? 'probe';
    await tab.keyboard.press(String(1 + ['probe', 'blade', 'grasper'].indexOf(mode)));
    const x = -0.06 + 0.07 * random();
    const y = -0.02 + 0.04 * random();
    const place = await above(tab, x, y).catch(() => null);
    if (place) {
      await tab.mouse.move(place.x, place.y);
      await tab.waitForTimeout(600);
      await tab.mouse.down();
      const [dx, dy] = [60 * (random() - 0.5), 40 * (random() - 0.5)];
      for (let i = 1; i <= 20; ++i) {
        await tab.mouse.move(place.x + (dx * i) / 20, place.y + (dy * i) / 20);
        if (random() < 0.2) await tab.mouse.wheel(0, 200 * (random() - 0.5));
        await tab.waitForTimeout(60);
      }
      await tab.mouse.up();
    }
    if (random() < 0.1) await tab.keyboard.press('r');
    if (random() < 0.2) await tab.keyboard.press(['n', 'c', 'x', 'b'][Math.floor(random() * 4)] ?? 'n');
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
      const p95 = await tab.evaluate(() => globalThis.spherecut!.latency.quantile(0.95));
      server.push(memory(served.process.pid ?? 0));
      if (p95 !== null) latencies.push(p95);
      const seen = await look(tab);
      console.log(
        `${((reported - start) / 1000).toFixed(0)} s, ${actions} actions, server ${server[server.length - 1]?.toFixed(0)} MB, ` +
          `hand to picture p95 ${p95 === null ? '-' : `${(1000 * p95).toFixed(0)} ms`}, cut ${(seen.cutArea * 1e4).toFixed(2)} cm2`,
      );
    }
  }
  faults.push(...complaints);
  const mean = (values: number[]): number => values.reduce((sum, value) => sum + value, 0) / Math.max(values.length, 1);
  const third = Math.floor(server.length / 3);
  if (third >= 2) {
    const [early, late] = [mean(server.slice(third, 2 * third)), mean(server.slice(-third))];
    if (late > 1.2 * early + 20) faults.push(`the server's memory grows: ${early.toFixed(0)} MB, later ${late.toFixed(0)} MB`);
  }
  console.log(`${actions} actions, ${faults.length} faults, hand to picture p95 ${(1000 * mean(latencies)).toFixed(0)} ms on average`);
} finally {
  await browser.close();
  await served.stop();
}
for (const fault of faults) console.error(fault);
process.exit(faults.length > 0 ? 1 : 0);
