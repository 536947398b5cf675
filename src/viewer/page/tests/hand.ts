// What a test does with the page, and what it sees there.
import type { Page as Tab } from 'playwright-core';
import { patience, until } from './browser';

export interface Seen {
  force: number; // N, of the frame
  readout: number; // N, as written on the page
  depth: number; // m
  solve: number;
  mode: string;
  tickTime: number;
  handForce: number[];
  cutArea: number; // m2
  opening: number; // m, as the server says
  lips: number; // m apart in the streamed geometry
  role: string;
  modes: string[];
  messages: string;
}

export function look(tab: Tab): Promise<Seen> {
  return tab.evaluate(() => {
    const page = globalThis.spherecut!;
    const frame = page.frame!;
    const text = (id: string): string => document.getElementById(id)!.textContent ?? '';
    const [, number, milli] = /^([\d.]+) (m?)N$/.exec(text('force')) ?? [];
    return {
      force: Math.hypot(...frame.force),
      readout: Number(number) * (milli ? 1e-3 : 1),
      depth: frame.depth,
      solve: frame.solve,
      mode: frame.mode,
      tickTime: frame.tickTime,
      handForce: [...frame.handForce],
      cutArea: frame.cutArea,
      opening: frame.opening,
      lips: page.view.body.lipsApart(),
      role: text('role'),
      modes: page.session!.modes,
      messages: text('messages'),
    };
  });
}

/** The blade in the second hand; null: it holds nothing. */
export function lookSecond(tab: Tab): Promise<{ force: number; depth: number; tip: number[] } | null> {
  return tab.evaluate(() => {
    const second = globalThis.spherecut!.frame!.second;
    return second && { force: Math.hypot(...second.force), depth: second.depth, tip: [...second.tip] };
  });
}

export const ready = (tab: Tab): Promise<void> =>
  until(tab, 'a frame, and the tool in the hand', () => Boolean(globalThis.spherecut?.frame && globalThis.spherecut.holding));

/** Pixel of the window where the surface is drawn that lies below (x, y), m. */
export async function above(tab: Tab, x: number, y: number): Promise<{ x: number; y: number }> {
  const place = await tab.evaluate(
    ([px, py]) => {
      const view = globalThis.spherecut!.view;
      const hit = view.body.cast([px!, py!, 1], [0, 0, -1]);
      if (!hit) return null;
      const box = view.canvas.getBoundingClientRect();
      const pixel = view.pixel(hit.point);
      return { x: box.left + pixel.x, y: box.top + pixel.y };
    },
    [x, y],
  );
  if (!place) throw new Error(`no organ below ${x}, ${y}`);
  return place;
}

/** Moves the pointer there and waits for the tool to hover. */
export async function hover(tab: Tab, x: number, y: number): Promise<void> {
  const place = await above(tab, x, y);
  await tab.mouse.move(place.x - 2, place.y);
  await tab.mouse.move(place.x, place.y);
  await until(tab, 'the tool hovers', () => Math.abs(globalThis.spherecut!.frame!.depth) < 0.009);
}

export async function chooseMode(tab: Tab, key: string, mode: string): Promise<void> {
  await tab.keyboard.press(key);
  await tab.waitForFunction((wanted) => globalThis.spherecut!.frame!.mode === wanted, mode, { timeout: 1000 * patience });
}

/** Draws the tool along a way over the surface while it is pressed, each leg in about `seconds`. */
export async function stroke(tab: Tab, way: readonly (readonly [number, number])[], seconds: number): Promise<void> {
  const steps = Math.max(2, Math.round(seconds / 0.06));
  const places = [];
  for (const [x, y] of way) places.push(await above(tab, x, y));
  await tab.mouse.down();
  await until(tab, 'the tool goes in', () => globalThis.spherecut!.frame!.depth > 0.004);
  for (let leg = 1; leg < places.length; ++leg) {
    const from = places[leg - 1]!;
    const to = places[leg]!;
    for (let i = 1; i <= steps; ++i) {
      await tab.mouse.move(from.x + ((to.x - from.x) * i) / steps, from.y + ((to.y - from.y) * i) / steps);
      await tab.waitForTimeout(60);
    }
  }
}
