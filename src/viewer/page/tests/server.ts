// `spherecut serve` for the time of a test.
import { type ChildProcess, spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

export interface Served {
  address: string;
  folder: string; // its own, taken away at the end
  said(): string;
  process: ChildProcess;
  stop(): Promise<void>;
}

/** Serves a scenario on a free port. `change` edits its text; `others` lie beside it, by their names. */
export async function serve(
  build: string,
  scenario: string,
  change: (text: string) => string = (text) => text,
  others: Record<string, string> = {},
): Promise<Served> {
  const folder = mkdtempSync(join(tmpdir(), 'spherecut-page-'));
  for (const [name, text] of Object.entries(others)) writeFileSync(join(folder, name), text);
  const file = join(folder, 'scenario.toml');
  writeFileSync(file, change(readFileSync(scenario, 'utf8')));
  const child = spawn(join(build, 'spherecut'), ['serve', file, '--port', '0', '--out', join(folder, 'out'), '--page', join(build, 'page')], {
    stdio: ['ignore', 'pipe', 'pipe'],
    env: { ...process.env, OPENBLAS_NUM_THREADS: '1' },
  });
  let said = '';
  const hear = (data: Buffer): void => void (said += data.toString());
  child.stdout.on('data', hear);
  child.stderr.on('data', hear);
  const ended = new Promise<void>((resolve) => child.once('exit', () => resolve()));
  const stop = async (): Promise<void> => {
    child.kill('SIGINT');
    const patience = setTimeout(() => child.kill('SIGKILL'), 10_000);
    await ended;
    clearTimeout(patience);
    rmSync(folder, { recursive: true, force: true, maxRetries: 30, retryDelay: 200 });
  };
  const start = Date.now();
  for (;;) {
    const address = /http:\/\/[^\s]+/.exec(said)?.[0];
    if (address) return { address, folder, said: () => said, process: child, stop };
    if (child.exitCode !== null || Date.now() - start > 180_000) {
      await stop();
      throw new Error(`the server did not start: ${said}`);
    }
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** The text of a scenario with other values of some keys; every key has to be there. */
export function withValues(text: string, values: Record<string, string | number>): string {
  for (const [key, value] of Object.entries(values)) {
    const line = new RegExp(`^${key} = .*$`, 'm');
    if (!line.test(text)) throw new Error(`the scenario has no ${key}`);
    text = text.replace(line, `${key} = ${value}`);
  }
  return text;
}

/** The flap of the liver with fewer nodes: the same tear, sooner. */
export const coarserFlap = (text: string): string => withValues(text, { fine_spacing: 0.006, coarse_spacing: 0.026, fine_radius: 0.008 });

/** Force on the hand at every tick of a recording (docs/haptics.md has the layout). */
export function recordedForces(bytes: Buffer): { time: number; force: [number, number, number] }[] {
  const ticks: { time: number; force: [number, number, number] }[] = [];
  if (bytes.subarray(0, 8).toString('latin1') !== 'SPHCREC\n') throw new Error('not a recording');
  const tickBytes = 136;
  for (let at = 16; at + 16 <= bytes.length; ) {
    const kind = bytes.readUInt32LE(at);
    const size = bytes.readUInt32LE(at + 4);
    const data = bytes.subarray(at + 16, at + 16 + size);
    for (let tick = 0; kind === 2 && tick + tickBytes <= size; tick += tickBytes) {
      const number = (offset: number): number => data.readDoubleLE(tick + offset);
      ticks.push({ time: number(8), force: [number(72), number(80), number(88)] });
    }
    at += 16 + size;
  }
  return ticks;
}
