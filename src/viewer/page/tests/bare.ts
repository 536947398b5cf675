// A browser driven by its DevTools protocol alone. Playwright has every page believe that it is seen; here a tab behind
// another one is hidden.
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Readable, Writable } from 'node:stream';
import type { Page as Tab } from 'playwright-core';
import { chromiumPath } from './browser';

interface Answer {
  id?: number;
  result?: Record<string, unknown>;
  error?: { message: string };
}

export interface Bare {
  tab: Tab; // `evaluate` and `screenshot`, as PNG, no more
  send(method: string, params?: object): Promise<Record<string, unknown>>; // to the tab
  toFront(): Promise<void>;
  behindAnother(): Promise<void>;
  close(): Promise<void>;
}

export async function openBare(address: string, args: string[]): Promise<Bare> {
  const folder = mkdtempSync(join(tmpdir(), 'spherecut-browser-'));
  const all = ['--headless', '--no-sandbox', ...args, '--remote-debugging-pipe', `--user-data-dir=${folder}`, '--window-size=1100,800'];
  const child = spawn(chromiumPath, [...all, 'about:blank'], { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'] });
  const [to, from] = [child.stdio[3] as Writable, child.stdio[4] as Readable];
  const waiting = new Map<number, (answer: Answer) => void>();
  let said = '';
  from.on('data', (data: Buffer) => {
    said += data.toString();
    for (let end = said.indexOf('\0'); end >= 0; end = said.indexOf('\0')) {
      const answer = JSON.parse(said.slice(0, end)) as Answer;
      said = said.slice(end + 1);
      if (answer.id !== undefined) waiting.get(answer.id)?.(answer);
    }
  });
  let number = 0;
  const ask = (method: string, params: object, sessionId?: string): Promise<Record<string, unknown>> =>
    new Promise((done, failed) => {
      number += 1;
      waiting.set(number, ({ result, error }) => (error ? failed(new Error(`${method}: ${error.message}`)) : done(result ?? {})));
      to.write(`${JSON.stringify({ id: number, method, params, sessionId })}\0`);
    });
  const { targetId } = await ask('Target.createTarget', { url: address });
  const { sessionId } = await ask('Target.attachToTarget', { targetId, flatten: true });
  const send = (method: string, params: object = {}): Promise<Record<string, unknown>> => ask(method, params, sessionId as string);
  const evaluate = async (act: unknown, value?: unknown): Promise<unknown> => {
    const expression = `(${String(act)})(${JSON.stringify(value) ?? ''})`;
    const { result, exceptionDetails } = await send('Runtime.evaluate', { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(JSON.stringify(exceptionDetails));
    return (result as { value?: unknown }).value;
  };
  const screenshot = async (): Promise<Buffer> => Buffer.from((await send('Page.captureScreenshot'))['data'] as string, 'base64');
  return {
    tab: { evaluate, screenshot } as unknown as Tab,
    send,
    toFront: async () => void (await ask('Target.activateTarget', { targetId })),
    behindAnother: async () => {
      const other = await ask('Target.createTarget', { url: 'about:blank' });
      await ask('Target.activateTarget', { targetId: other['targetId'] });
    },
    close: async () => {
      const ended = new Promise<void>((done) => child.once('exit', () => done()));
      child.kill('SIGKILL');
      await ended;
      // A browser that is still writing keeps its folder: that is no fault of the page.
      try {
        rmSync(folder, { recursive: true, force: true, maxRetries: 5, retryDelay: 200 });
      } catch {
        console.warn(`${folder} stays`);
      }
    },
  };
}
