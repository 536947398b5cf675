// Pictures of the page for README and docs: node pictures.mjs BUILD_FOLDER SOURCE_FOLDER OUTPUT_FOLDER [liver|flap]
import { join } from 'node:path';
import type { Page as Tab } from 'playwright-core';
import { launch, openPage, type Opened, patience, until } from './browser';
import { chooseMode, hover, look, ready, stroke } from './hand';
import { photograph } from './photograph';
import { coarserFlap, serve, withValues } from './server';

const [build = '.', source = '.', out = '.', which = ''] = process.argv.slice(2);
/** Serves a scenario, its text changed, and hands its page to `act`. */
async function withPage(scenario: string, change: (text: string) => string, act: (opened: Opened, phone: () => Promise<Opened>) => Promise<void>): Promise<void> {
  const served = await serve(build, join(source, 'scenarios', scenario), change);
  const browser = await launch();
  try {
    const opened = await openPage(browser, served.address, { width: 1280, height: 800 });
    await ready(opened.tab);
    await act(opened, () => openPage(browser, served.address, { width: 390, height: 760, touch: true }));
  } catch (error) {
    console.error(served.said());
    throw error;
  } finally {
    await browser.close();
    await served.stop();
  }
}

/** Waits until the body has been solved for the whole way of the blade, seen for three seconds on end, and the cut gapes. */
async function caughtUp(tab: Tab): Promise<void> {
  await until(tab, 'the wound has caught up with the blade', () => {
    const { frame, view } = globalThis.spherecut!;
    const memory = globalThis as unknown as { quiet?: number };
    const quiet = view.trace.length === 0 && frame!.poseInSolve === frame!.poseInTick && view.body.lipsApart() > 1e-3;
    memory.quiet = quiet ? (memory.quiet ?? 0) + 1 : 0;
    return memory.quiet >= 60;
  });
}

// Nodes stay as fine as they are however long a cut takes.
async function liver(): Promise<void> {
  await withPage('liver_live.toml', (text) => withValues(text, { budget: 60 }), async ({ tab, context }, openPhone) => {
    const keep = async (name: string): Promise<void> => {
      await tab.waitForTimeout(700);
      await photograph(tab, out, name);
      console.log(name, JSON.stringify(await look(tab)));
    };
    await tab.selectOption('#shading', 'fine');
    const panels = (): Promise<void> => tab.keyboard.press('0');
    await panels();
    await hover(tab, -0.03, -0.012);
    await tab.mouse.down();
    await until(tab, 'the force is felt', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.05);
    await tab.mouse.wheel(0, -800);
    await tab.waitForTimeout(2500);
    await keep('press');
    await panels();
    await tab.selectOption('#colours', 'von_mises');
    await tab.waitForTimeout(1200);
    await keep('stress');
    await tab.selectOption('#colours', 'none');
    await tab.mouse.up();
    await panels();
    await chooseMode(tab, '2', 'blade');
    for (let i = 0; i < 6; ++i) await tab.keyboard.press('.', { delay: 150 });
    await hover(tab, -0.06, 0.004);
    await stroke(tab, [[-0.06, 0.004], [-0.035, 0.004], [-0.01, 0.001], [0.012, -0.002]], 2.5);
    await until(tab, 'there is a cut', () => globalThis.spherecut!.frame!.cutArea > 1e-4);
    await caughtUp(tab);
    await keep('cutting');
    await tab.mouse.up();
    await tab.keyboard.press('k');
    await until(tab, 'the blade is away', () => globalThis.spherecut!.frame!.depth < -0.03);
    await caughtUp(tab);
    await tab.evaluate(() => {
      const orbit = globalThis.spherecut!.view.orbit;
      orbit.turn(0, 0.25);
      orbit.zoom(2.1);
      orbit.pan(0.2, -0.2);
      globalThis.spherecut!.view.change();
    });
    await keep('wound');
    await panels();
    await tab.keyboard.press('n');
    await hover(tab, -0.03, -0.004);
    await tab.keyboard.press('p');
    await until(tab, 'the supports of a node', () => /sees/.test(document.getElementById('support-state')!.textContent!));
    await tab.keyboard.press('k');
    await tab.waitForTimeout(2500);
    await keep('nodes');
    for (const key of ['n', 'o']) await tab.keyboard.press(key);
    await tab.selectOption('#slice', 'cut');
    await tab.selectOption('#slice-axis', '0');
    await tab.evaluate(() => globalThis.spherecut!.home());
    await tab.waitForTimeout(1500);
    await keep('slice');
    await context.close();
    const phone = await openPhone();
    await ready(phone.tab);
    await phone.tab.evaluate(() => {
      const list = document.getElementById('shading') as HTMLSelectElement;
      list.value = 'fine';
      list.dispatchEvent(new Event('change'));
    });
    await phone.tab.getByText('Probe', { exact: true }).tap();
    await phone.tab.waitForTimeout(2000);
    await phone.tab.tap('#view', { position: { x: 170, y: 300 } });
    await phone.tab.tap('#press-hold');
    await phone.tab.waitForTimeout(3500);
    await photograph(phone.tab, out, 'phone');
  });
}

/** The flap held by the grasper, before and after it has torn on. */
async function flap(): Promise<void> {
  await withPage('liver_flap.toml', coarserFlap, async ({ tab }) => {
    await tab.selectOption('#shading', 'fine');
    await tab.keyboard.press('0');
    await hover(tab, -0.062, 0.003);
    await tab.mouse.down();
    await until(tab, 'the flap comes off its bed', () => globalThis.spherecut!.view.body.lipsApart() > 1e-3);
    await tab.keyboard.down(',');
    await until(tab, 'the hand is far up', () => (document.getElementById('press-depth') as HTMLInputElement).valueAsNumber <= -15);
    await tab.keyboard.up(',');
    const before = (await look(tab)).cutArea;
    await tab.waitForFunction((area) => globalThis.spherecut!.frame!.cutArea >= 1.02 * area, Math.min(before, 1.72e-3), { timeout: 1000 * patience });
    await tab.evaluate(() => {
      const orbit = globalThis.spherecut!.view.orbit;
      orbit.turn(0.5, -0.45);
      orbit.zoom(1.7);
      orbit.pan(0.12, -0.1);
      globalThis.spherecut!.view.change();
    });
    await tab.waitForTimeout(6000);
    await photograph(tab, out, 'tear');
    console.log('tear', JSON.stringify(await look(tab)));
  });
}

if (which !== 'flap') await liver();
if (which !== 'liver') await flap();
