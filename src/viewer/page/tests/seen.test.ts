// What a person sees of the page, however the browser draws: node seen.test.mjs BUILD_FOLDER SOURCE_FOLDER
// Every picture is the one that the browser has composited, ten frames after the last change.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import test, { after, before } from 'node:test';
import type { Browser, Page as Tab } from 'playwright-core';
import { PNG } from 'pngjs';
import { openBare } from './bare';
import { block, press, withdraw } from './block';
import { launch, type Opened, openPage, patience, until } from './browser';
import { box, count, frames, organIsSeen, see } from './composited';
import { above, ready } from './hand';
import { serve, type Served } from './server';

const [build = '.', source = '.'] = process.argv.slice(2);
let served: Served;

before(async () => {
  served = await serve(build, join(source, 'scenarios/liver_live.toml'), () => block('whole'));
});

after(async () => {
  await served?.stop();
});

const browsers: [string, string[]][] = [
  ['as Chromium draws by itself without graphics hardware', ['--enable-unsafe-swiftshader']],
  ['with --disable-gpu', ['--disable-gpu', '--enable-unsafe-swiftshader']],
  ['with --use-angle=swiftshader', ['--use-angle=swiftshader', '--enable-unsafe-swiftshader']],
];

/** The tool goes over the organ to `places` of them and is looked at on its way and there. */
async function hovers(tab: Tab, when: string, places: number): Promise<void> {
  for (let i = 0; i < places; ++i) {
    const [x, y] = [0.018 * Math.cos(2.4 * i), 0.018 * Math.sin(2.4 * i)];
    const at = await above(tab, x, y);
    await tab.mouse.move(at.x - 2, at.y);
    await tab.mouse.move(at.x, at.y);
    organIsSeen(await see(tab), `${when}, on the way to place ${i}`);
    await tab.waitForFunction(
      ([wx, wy]) => Math.hypot(globalThis.spherecut!.frame!.tip[0] - wx!, globalThis.spherecut!.frame!.tip[1] - wy!) < 1e-3, [x, y], { timeout: 1000 * patience },
    );
    // What is tried is what is kept, with the tool on its way in it: from the second picture after it was kept on.
    // A tool that has come to rest brings no further pictures.
    for (const end = Date.now() + 1000 * patience; !(await tab.evaluate(() => globalThis.spherecut!.view.kept)); await frames(tab, 2)) {
      assert.ok(Date.now() < end, `${when}: no picture is kept at place ${i}`);
      await tab.mouse.move(at.x + ((Date.now() >> 4) & 3), at.y);
    }
    await tab.mouse.move(at.x + 5, at.y);
    organIsSeen(await see(tab), `${when}, going on from place ${i}`);
    await tab.mouse.move(at.x, at.y);
    const seen = await see(tab);
    organIsSeen(seen, `${when}, at place ${i}`);
    assert.ok(seen.steel > 0.5 * seen.toolPixels && seen.toolPixels > 100, `${when}, place ${i}: ${seen.steel} px of a tool that has ${seen.toolPixels}`);
    assert.ok(seen.arrow < 20, `${when}, place ${i}: ${seen.arrow} px of an arrow without a force`);
  }
}

/** A press is in the picture with its arrow, the spring to the hand and the chart, and goes away again. */
async function presses(tab: Tab, when: string): Promise<void> {
  await press(tab);
  const seen = await see(tab);
  organIsSeen(seen, `${when}, pressed`);
  const { ratio } = seen.picture;
  assert.ok(seen.arrowLength > 20 * ratio, `${when}: an arrow of ${seen.arrowLength} px`);
  assert.ok(seen.arrow > seen.arrowLength * ratio, `${when}: ${seen.arrow} px of an arrow that is ${seen.arrowLength} px long`);
  assert.ok(seen.hand > 4, `${when}: ${seen.hand} px of the spring`);
  assert.ok(seen.steel > 0.15 * seen.toolPixels, `${when}: ${seen.steel} px of a tool that has ${seen.toolPixels}`);
  assert.ok(seen.chart > 20 * ratio, `${when}: ${seen.chart} px in the chart`);
  await withdraw(tab);
  const after = await see(tab);
  organIsSeen(after, `${when}, withdrawn`);
  assert.ok(after.arrow < 20, `${when}: ${after.arrow} px of an arrow stay`);
}

async function inBrowser(args: string[], ratio: number, act: (opened: Opened, browser: Browser) => Promise<void>): Promise<void> {
  const browser = await launch(args);
  try {
    const opened = await openPage(browser, served.address, { width: 1100, height: 700, ratio });
    await ready(opened.tab);
    await act(opened, browser);
    assert.deepEqual(opened.complaints, []);
  } finally {
    await browser.close();
  }
}

for (const [name, args] of browsers) {
  for (const ratio of [1, 1.5, 2]) {
    test(`Organ, tool, arrow and chart are seen ${name}, at ${ratio} pixels per pixel`, async () => {
      await inBrowser(args, ratio, async ({ tab }) => {
        organIsSeen(await see(tab), 'as the page opens');
        await hovers(tab, 'at first', 2);
        await presses(tab, 'then');
      });
    });
  }
}

test('They are seen after the window was resized', async () => {
  await inBrowser(browsers[0]![1], 1, async ({ tab }) => {
    for (const [width, height] of [[700, 900], [1300, 620]] as const) {
      await hovers(tab, 'before', 1);
      await tab.setViewportSize({ width, height });
      organIsSeen(await see(tab), `at ${width} x ${height}`);
      await hovers(tab, `at ${width} x ${height}`, 2);
    }
    await presses(tab, 'resized');
  });
});

test('They are seen after the context was lost and given back', async () => {
  await inBrowser(browsers[0]![1], 1, async ({ tab }) => {
    await hovers(tab, 'before', 1);
    await tab.evaluate(() => {
      const lose = globalThis.spherecut!.view.canvas.getContext('webgl2')!.getExtension('WEBGL_lose_context')!;
      lose.loseContext();
      setTimeout(() => lose.restoreContext(), 400);
    });
    await until(tab, 'the page says that the picture is back', () => /is back/.test(document.getElementById('messages')!.textContent!));
    organIsSeen(await see(tab), 'given back');
    await hovers(tab, 'given back', 2);
    await presses(tab, 'given back');
  });
});

test('They are seen again when the process that draws has died', async () => {
  await inBrowser(browsers[0]![1], 1, async ({ tab }, browser) => {
    await hovers(tab, 'before', 1);
    await (await browser.newBrowserCDPSession()).send('Browser.crashGpuProcess').catch(() => null);
    await until(tab, 'the page says that the picture is back', () => /is back/.test(document.getElementById('messages')!.textContent!));
    organIsSeen(await see(tab), 'given back by another process');
    await hovers(tab, 'given back by another process', 2);
    const [saved] = await Promise.all([tab.waitForEvent('download'), tab.keyboard.press('Enter')]);
    const { width, height, data } = PNG.sync.read(readFileSync(await saved.path()));
    const tissue = count({ width, height, ratio: 1, data }, 'tissue');
    assert.ok(tissue > 0.02 * width * height, `${tissue} px of the organ in a saved picture of ${width} x ${height}`);
  });
});

test('They are seen again in a tab that has been hidden behind another', async () => {
  const bare = await openBare(served.address, browsers[0]![1]);
  const { tab } = bare;
  const holds = async (what: string, condition: () => boolean): Promise<void> => {
    for (const end = Date.now() + 1000 * patience; !(await tab.evaluate(condition)); await new Promise((passed) => setTimeout(passed, 50))) {
      assert.ok(Date.now() < end, `not within ${patience} s: ${what}`);
    }
  };
  const hover = async (across: number, up: number): Promise<void> => {
    const { left, right, top, bottom } = await box(tab, 'scene');
    await bare.send('Input.dispatchMouseEvent', { type: 'mouseMoved', x: left + across * (right - left), y: top + up * (bottom - top) });
    await holds('a picture is kept', () => globalThis.spherecut!.view.kept);
  };
  try {
    await bare.toFront();
    await holds('the tool in the hand', () => Boolean(globalThis.spherecut?.frame && globalThis.spherecut.holding));
    await hover(0.5, 0.4);
    organIsSeen(await see(tab), 'before');
    await bare.behindAnother();
    await holds('it is hidden', () => document.hidden);
    await new Promise((passed) => setTimeout(passed, 1500));
    await bare.toFront();
    await holds('it is shown', () => !document.hidden);
    organIsSeen(await see(tab), 'shown again');
    for (const across of [0.45, 0.55]) {
      await hover(across, 0.45);
      const seen = await see(tab);
      organIsSeen(seen, 'shown again, with a tool that moves');
      assert.ok(seen.steel > 1000, `${seen.steel} px of the tool`);
    }
  } finally {
    await bare.close();
  }
});

test('A picture for a tool that moves is the one that is drawn as a whole', async () => {
  await inBrowser(browsers[0]![1], 1, async ({ tab }) => {
    // Both with a pixel for every one of the page, however slow the machine is: the browser smooths coarser ones, in each canvas for itself.
    await tab.evaluate(() => {
      const view = globalThis.spherecut!.view as unknown as { resize(): void };
      Object.assign(view, { adapt: () => undefined, sharpness: 1 });
      view.resize();
    });
    await press(tab); // the tip is hidden by the rim of its dent
    // From here on the tool alone moves, however long the body takes to come to rest.
    await tab.evaluate(() => {
      const page = globalThis.spherecut as unknown as { take(frame: object, moves: boolean): void };
      const take = page.take.bind(page);
      page.take = (frame, moves) => take({ ...frame, vertices: null }, moves);
    });
    await until(tab, 'a picture is kept', () => globalThis.spherecut!.view.kept);
    await tab.evaluate(() => Object.assign(globalThis.spherecut!, { take: () => undefined })); // both of one moment
    const quick = await see(tab);
    await tab.evaluate(() => {
      Object.assign(globalThis.spherecut!.view, { still: null });
      globalThis.spherecut!.view.change();
    });
    const whole = await see(tab);
    organIsSeen(quick, 'kept');
    let worst = 0;
    for (let i = 0; i < whole.open.length; ++i) {
      if (!whole.open[i]) continue;
      for (let k = 0; k < 3; ++k) worst = Math.max(worst, Math.abs(quick.picture.data[4 * i + k]! - whole.picture.data[4 * i + k]!));
    }
    assert.ok(worst <= 3, `${worst} of 255`);
  });
});

test('A second viewer sees what the first one does, also when it comes later', async () => {
  await inBrowser(browsers[0]![1], 1, async ({ tab }, browser) => {
    await press(tab);
    const second = await openPage(browser, served.address, { width: 800, height: 640 });
    await until(second.tab, 'it sees the force', () => Math.hypot(...(globalThis.spherecut?.frame?.force ?? [0])) > 0.03);
    for (const [who, viewer] of [['the second', second.tab], ['the first', tab]] as const) {
      const seen = await see(viewer);
      organIsSeen(seen, who);
      assert.ok(seen.arrow > seen.arrowLength, `${who} sees ${seen.arrow} px of an arrow that is ${seen.arrowLength} px long`);
    }
    await withdraw(tab);
    const at = await above(tab, 0.015, -0.012);
    await tab.mouse.move(at.x, at.y);
    await second.tab.waitForFunction(() => Math.hypot(...globalThis.spherecut!.frame!.force) === 0, undefined, { timeout: 1000 * patience });
    for (const viewer of [second.tab, tab]) organIsSeen(await see(viewer), 'with a tool that has gone on');
    assert.deepEqual(second.complaints, []);
  });
});

test('Nothing happened to the server', () => {
  assert.equal(served.process.exitCode, null, served.said());
});
