// Rates of the page beside the live liver of 20,000 triangles, drawn by the processor: node measure.mjs BUILD_FOLDER SOURCE_FOLDER
import { join } from 'node:path';
import { launch, openPage, until } from './browser';
import { above, hover, look, ready } from './hand';
import { serve } from './server';

const [build = '.', source = '.'] = process.argv.slice(2);
const served = await serve(build, join(source, 'scenarios/liver_live.toml'));
const browser = await launch();
try {
  const { tab } = await openPage(browser, served.address, { width: 1280, height: 720 });
  await ready(tab);
  await hover(tab, -0.03, -0.01);
  const middle = await above(tab, -0.03, -0.01);
  await tab.mouse.down();
  await until(tab, 'the force is felt', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.03);
  const before = { time: Date.now(), seen: await look(tab), ...(await counters()) };
  while (Date.now() - before.time < 12_000) {
    const angle = (Date.now() - before.time) / 700;
    await tab.mouse.move(middle.x + 25 * Math.sin(angle), middle.y + 12 * Math.sin(1.7 * angle));
    await tab.waitForTimeout(25);
  }
  const seconds = (Date.now() - before.time) / 1000;
  const end = { seen: await look(tab), ...(await counters()) };
  const per = (a: number, b: number): string => ((b - a) / seconds).toFixed(1);
  console.log(`frames ${per(before.frames, end.frames)} a second, solves ${per(before.seen.solve, end.seen.solve)} a second`);
  console.log(
    await tab.evaluate(() => {
      const { latency, view } = globalThis.spherecut!;
      const ms = (q: number): string => (1000 * (latency.quantile(q) ?? NaN)).toFixed(0);
      return `hand to picture, ms: median ${ms(0.5)}, p95 ${ms(0.95)} of ${latency.count}; a picture takes ${(1000 * view.pictureSeconds).toFixed(0)} ms at ${view.canvas.width} x ${view.canvas.height} pixels`;
    }),
  );

  async function counters(): Promise<{ frames: number }> {
    return tab.evaluate(() => ({ frames: globalThis.spherecut!.frame!.number }));
  }
} finally {
  await browser.close();
  await served.stop();
}
process.exit(0);
