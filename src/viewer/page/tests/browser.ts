// Debian's Chromium, headless, drawing with the processor; the page opened in it, its complaints collected.
import { existsSync } from 'node:fs';
import { type Browser, type BrowserContext, chromium, type Page as Tab } from 'playwright-core';

export const chromiumPath = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find((path) => existsSync(path)) ?? '';

export async function launch(args = ['--enable-unsafe-swiftshader']): Promise<Browser> {
  return chromium.launch({
    executablePath: chromiumPath,
    // Without graphics hardware Chromium puts the page together itself and leaves WebGL to SwiftShader. Asked for ANGLE on
    // SwiftShader by name it also puts the page together that way, which costs three times as much.
    args: ['--no-sandbox', ...args],
  });
}

export interface Opened {
  tab: Tab;
  context: BrowserContext;
  complaints: string[]; // console errors, uncaught exceptions, requests to elsewhere
}

export interface Size {
  width: number; // px of the page
  height: number;
  touch?: boolean;
  ratio?: number; // px of the screen per px of the page
  first?: boolean; // visit of this browser: panels folded, with the hint
  still?: boolean; // who sees it wants nothing to move by itself
}

/** Opens the page as somebody does who has been there before and has left its panels open, or for the first time. */
export async function openPage(
  browser: Browser,
  address: string,
  size: Size = { width: 1280, height: 800 },
  prepare?: (tab: Tab) => Promise<void>,
): Promise<Opened> {
  const context = await browser.newContext({
    viewport: { width: size.width, height: size.height },
    acceptDownloads: true,
    hasTouch: size.touch ?? false,
    deviceScaleFactor: size.ratio ?? 1,
    reducedMotion: size.still ? 'reduce' : 'no-preference',
  });
  if (!size.first) {
    const shown = size.width > 760 ? 'yes' : 'no';
    await context.addInitScript((panels) => Object.entries({ hint: 'seen', panels }).forEach(([key, value]) => localStorage.setItem(`spherecut.${key}`, value)), shown);
  }
  context.setDefaultTimeout(1000 * patience);
  const tab = await context.newPage();
  const complaints: string[] = [];
  tab.on('console', (message) => {
    if (message.type() === 'error') complaints.push(message.text());
  });
  tab.on('pageerror', (error) => complaints.push(String(error)));
  tab.on('request', (request) => {
    const url = new URL(request.url());
    if (!['data:', 'blob:'].includes(url.protocol) && url.origin !== new URL(address).origin) complaints.push(`asks ${url}`);
  });
  await prepare?.(tab);
  await tab.goto(address);
  return { tab, context, complaints };
}

/** How long anything may take at most: a machine that is slow or busy fails no test. */
export const patience = Number(process.env['SPHERECUT_PATIENCE'] ?? 600); // s

/** Waits until `condition` holds in the page; says `what` when it does not in time. */
export async function until(tab: Tab, what: string, condition: () => boolean, seconds = patience): Promise<void> {
  try {
    await tab.waitForFunction(condition, undefined, { timeout: 1000 * seconds, polling: 50 });
  } catch (error) {
    const seen = await tab
      .evaluate(() => {
        const { frame, session, tear } = globalThis.spherecut!;
        const { epoch, solve, mode, depth, state, force, tip, hand, solveSeconds } = frame!;
        const messages = document.getElementById('messages')!.innerText;
        return JSON.stringify({ epoch, session: session?.epoch, solve, mode, depth, state, force, tip, hand, solveSeconds, tear, messages });
      })
      .catch(() => 'nothing');
    throw new Error(`not within ${seconds} s: ${what} (${String(error).split('\n')[0]}); the page has ${seen}`);
  }
}
