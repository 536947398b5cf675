// Ten seconds of press, cut and tear for README, as the browser composites them: node moving_picture.mjs BUILD_FOLDER SOURCE_FOLDER FILE.webp
// Time is the clock's: nothing is left out within a scene and nothing is sped up. The rates are the page's own, in its bar.
// Messages, which lie over the organ in a window that small, are taken away, and the tissue has its grain however busy the
// machine is.
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page as Tab } from 'playwright-core';
import { launch, openPage, patience, until } from './browser';
import { chooseMode, hover, ready, stroke } from './hand';
import { coarserFlap, serve } from './server';

const [build = '.', source = '.', file = 'press_cut_tear.webp'] = process.argv.slice(2);
const size = { width: 800, height: 500 }; // px
const interval = 0.11; // s between two pictures at least
const most = 3_000_000; // bytes

interface Shot {
  jpeg: string; // base64
  time: number; // s
}

/** Keeps what the browser composites of `tab` while `act` goes on. */
async function filmed(tab: Tab, act: () => Promise<void>): Promise<Shot[]> {
  const shots: Shot[] = [];
  const camera = await tab.context().newCDPSession(tab);
  camera.on('Page.screencastFrame', ({ data, metadata, sessionId }) => {
    const time = metadata.timestamp ?? 0;
    if (time - (shots.at(-1)?.time ?? 0) >= interval) shots.push({ jpeg: data, time });
    void camera.send('Page.screencastFrameAck', { sessionId }).catch(() => null);
  });
  await camera.send('Page.startScreencast', { format: 'jpeg', quality: 95, maxWidth: size.width, maxHeight: size.height, everyNthFrame: 1 });
  await act();
  await camera.send('Page.stopScreencast');
  await camera.detach();
  return shots;
}

/** Serves a scenario and hands its page, opened for the first time but for the hint, to `act`. */
async function scene<T>(browser: Browser, scenario: string, change: (text: string) => string, act: (tab: Tab) => Promise<T>): Promise<T> {
  const served = await serve(build, join(source, 'scenarios', scenario), change);
  try {
    const { tab, context } = await openPage(browser, served.address, { ...size, first: true });
    await ready(tab);
    await tab.click('#hint-close');
    await tab.addStyleTag({ content: '#messages { display: none }' });
    await tab.keyboard.press('0');
    await tab.selectOption('#shading', 'fine');
    await tab.keyboard.press('0');
    const result = await act(tab);
    await context.close();
    return result;
  } finally {
    await served.stop();
  }
}

/** The camera from its place at home: angles in rad, a factor, and fractions of the height of the view. */
const look = (tab: Tab, turn: readonly [number, number], zoom: number, pan: readonly [number, number]): Promise<void> =>
  tab.evaluate(
    ([angles, factor, way]) => {
      const { view } = globalThis.spherecut!;
      view.orbit.turn(...angles);
      view.orbit.zoom(factor);
      view.orbit.pan(...way);
      view.change();
    },
    [turn, zoom, pan] as [[number, number], number, [number, number]],
  );

async function pressAndCut(tab: Tab): Promise<Shot[][]> {
  await look(tab, [0, 0.02], 1.8, [0.12, -0.14]);
  await hover(tab, -0.03, -0.004);
  const press = await filmed(tab, async () => {
    await tab.mouse.down();
    await tab.waitForTimeout(700);
    for (let i = 0; i < 2; ++i) await tab.mouse.wheel(0, -300);
    await tab.waitForTimeout(1000);
    await tab.mouse.up();
    await tab.waitForTimeout(400);
  });
  await chooseMode(tab, '2', 'blade');
  for (let i = 0; i < 5; ++i) await tab.keyboard.press('.', { delay: 150 });
  await hover(tab, -0.055, 0.004);
  const cut = await filmed(tab, async () => {
    await stroke(tab, [[-0.055, 0.004], [-0.03, 0.005], [-0.008, 0.002]], 0.9);
    await tab.waitForTimeout(300);
    await tab.mouse.up();
    await tab.keyboard.press('k');
    await until(tab, 'the wound has caught up', () => globalThis.spherecut!.view.trace.length === 0);
    await tab.waitForTimeout(1000);
  });
  return [press, cut];
}

async function tear(tab: Tab): Promise<Shot[]> {
  await look(tab, [0.5, -0.35], 1.5, [0.14, -0.06]);
  await hover(tab, -0.062, 0.003);
  await tab.mouse.down();
  await until(tab, 'the flap comes off its bed', () => globalThis.spherecut!.view.body.lipsApart() > 1e-3);
  const before = await tab.evaluate(() => globalThis.spherecut!.frame!.cutArea);
  await tab.keyboard.down(',');
  await until(tab, 'the hand is far up', () => (document.getElementById('press-depth') as HTMLInputElement).valueAsNumber <= -12);
  return filmed(tab, async () => {
    await tab.waitForFunction((area) => globalThis.spherecut!.frame!.cutArea > 1.02 * area, before, { timeout: 1000 * patience });
    await tab.waitForTimeout(1200);
    await tab.keyboard.up(',');
  });
}

const little = (value: number, bytes: number): Buffer => {
  const buffer = Buffer.alloc(bytes);
  buffer.writeUIntLE(value, 0, bytes);
  return buffer;
};
const chunk = (name: string, ...parts: Buffer[]): Buffer => {
  const body = Buffer.concat(parts);
  return Buffer.concat([Buffer.from(name, 'latin1'), little(body.length, 4), body, Buffer.alloc(body.length % 2)]);
};

/** The coded picture within a still WebP file. */
function coded(webp: Buffer): Buffer {
  for (let at = 12; at + 8 <= webp.length; ) {
    const length = webp.readUInt32LE(at + 4);
    if (webp.toString('latin1', at, at + 4) === 'VP8 ') return webp.subarray(at + 8, at + 8 + length);
    at += 8 + length + (length % 2);
  }
  throw new Error('the browser wrote no picture in VP8');
}

/** A moving WebP that goes round and round. Pictures are coded by the browser, times are in s. */
async function moving(browser: Browser, shots: readonly Shot[], seconds: readonly number[], quality: number): Promise<Buffer> {
  const tab = await browser.newPage();
  const frames: Buffer[] = [];
  for (const [i, { jpeg }] of shots.entries()) {
    const base64 = await tab.evaluate(
      async ([data, level]) => {
        const image = await createImageBitmap(await (await fetch(`data:image/jpeg;base64,${data}`)).blob());
        const canvas = new OffscreenCanvas(image.width, image.height);
        canvas.getContext('2d')!.drawImage(image, 0, 0);
        const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: 'image/webp', quality: Number(level) })).arrayBuffer());
        return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(''));
      },
      [jpeg, quality],
    );
    const place = [little(0, 3), little(0, 3), little(size.width - 1, 3), little(size.height - 1, 3)];
    frames.push(chunk('ANMF', ...place, little(Math.round(1000 * seconds[i]!), 3), little(2, 1), chunk('VP8 ', coded(Buffer.from(base64, 'base64')))));
  }
  await tab.close();
  const head = chunk('VP8X', little(2, 1), little(0, 3), little(size.width - 1, 3), little(size.height - 1, 3));
  const body = Buffer.concat([Buffer.from('WEBP'), head, chunk('ANIM', little(0, 4), little(0, 2)), ...frames]);
  return Buffer.concat([Buffer.from('RIFF'), little(body.length, 4), body]);
}

const browser = await launch();
try {
  const scenes = await scene(browser, 'liver_live.toml', (text) => text, pressAndCut);
  scenes.push(await scene(browser, 'liver_flap.toml', coarserFlap, tear));
  const shots = scenes.flat();
  // Each picture stays until the next one of its scene; the last of a scene a second.
  const seconds = scenes.flatMap((list) => list.map(({ time }, i) => (i + 1 < list.length ? list[i + 1]!.time - time : 1)));
  for (const quality of [0.7, 0.6, 0.5, 0.4, 0.3]) {
    const webp = await moving(browser, shots, seconds, quality);
    writeFileSync(file, webp);
    console.log(`${file}: ${shots.length} pictures, ${seconds.reduce((sum, s) => sum + s, 0).toFixed(1)} s, quality ${quality}, ${webp.length} bytes`);
    if (webp.length < most) break;
  }
} finally {
  await browser.close();
}
