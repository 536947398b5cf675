// Pictures that tests and docs/images keep: what the browser has composited, as small JPEG.
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page as Tab } from 'playwright-core';
import { capture, organIsThere, see } from './composited';

const most = 150_000; // bytes

/** What the browser has composited as a JPEG of at most `bytes`, messages taken away. `covered`: a dialog lies over the organ. */
export async function shot(tab: Tab, covered = false, bytes = most): Promise<Buffer> {
  await tab.evaluate(() => document.getElementById('messages')!.replaceChildren());
  if (!covered) organIsThere(await see(tab), 'photographed');
  let picture: Buffer = Buffer.alloc(0);
  for (const quality of [84, 74, 62, 50]) {
    picture = await capture(tab, 'jpeg', quality);
    if (picture.length < bytes) break;
  }
  return picture;
}

/** Keeps a picture as viewer_NAME.jpg; nothing without a folder. */
export async function photograph(tab: Tab, folder: string, name: string, covered = false): Promise<void> {
  if (folder) keep(folder, name, await shot(tab, covered));
}

export function keep(folder: string, name: string, picture: Buffer): void {
  writeFileSync(join(folder, `viewer_${name}.jpg`), picture);
  console.log(`viewer_${name}.jpg: ${picture.length} bytes`);
}

/** Two pictures of windows beside each other, each half as wide as 1280 pixels. */
export async function sideBySide(browser: Browser, pictures: readonly Buffer[], folder: string, name: string): Promise<void> {
  const tab = await browser.newPage({ viewport: { width: 1288, height: 400 } });
  const images = pictures.map((picture) => `<img height=400 src="data:image/jpeg;base64,${picture.toString('base64')}">`);
  await tab.setContent(`<body style="margin:0;display:flex;gap:8px;background:#fff">${images.join('')}</body>`);
  await tab.waitForFunction(() => [...document.images].every((image) => image.complete));
  keep(folder, name, await tab.screenshot({ type: 'jpeg', quality: 80 }));
  await tab.close();
}
