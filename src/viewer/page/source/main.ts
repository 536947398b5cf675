import { Page } from './page';

declare global {
  /** What scripts and tests may look at: the last frame, the surface, the latency. */
  var spherecut: Page | undefined;
}

try {
  globalThis.spherecut = new Page();
} catch (error) {
  const text = error instanceof Error ? error.message : String(error);
  document.getElementById('messages')?.append(text);
  throw error;
}
