// Pictures that tests and docs/images keep: JPEG with smooth edges, small.
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page as Tab } from 'playwright-core';

const most = 150_000; // bytes

/** The window as a JPEG of at most `bytes`, its messages taken away. */
export async function shot(tab: Tab, bytes = most): Promise<Buffer> {
  await tab.evaluate(() => {
    document.getElementById('messages')!.replaceChildren();
    globalThis.spherecut!.view.sharpen(2);
  });
  let picture: Buffer = Buffer.alloc(0);
  for (const quality of [84, 74, 62, 50]) {
    picture = await tab.screenshot({ type: 'jpeg', quality });
    if (picture.length < bytes) break;
  }
  await tab.evaluate(() => globalThis.spherecut!.view.sharpen(1));
  return picture;
}

/** Keeps a picture as viewer_NAME.jpg; nothing without a folder. */
export async function photograph(tab: Tab, folder: string, name: string): Promise<void> {
  if (folder) keep(folder, name, await shot(tab));
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
