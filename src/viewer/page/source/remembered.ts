// What this browser remembers of the page from visit to visit; nothing where it may not.

const prefix = 'spherecut.';

export function remembered(what: string): string | null {
  try {
    return localStorage.getItem(prefix + what);
  } catch {
    return null; // the browser keeps nothing
  }
}

export function remember(what: string, value: string): void {
  try {
    localStorage.setItem(prefix + what, value);
  } catch {
    // The next visit begins as the first.
  }
}
