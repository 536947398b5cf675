// Everything by keyboard. One table gives what keys do and what the help says.

export interface Binding {
  keys: string[]; // KeyboardEvent.key, letters in lower case; 'Shift+' before it where Shift is held
  shown: string; // in the help
  does: string;
  /** Once at every press of the key. */
  press?: () => void;
  /** While the key is down, with the seconds since the last call. */
  hold?: (seconds: number) => void;
}

export interface Section {
  title: string;
  bindings: Binding[];
}

export class Keyboard {
  private readonly table = new Map<string, Binding>();
  private readonly down = new Map<string, Binding>(); // by KeyboardEvent.code

  constructor(readonly sections: readonly Section[]) {
    for (const section of sections) {
      for (const binding of section.bindings) for (const key of binding.keys) this.table.set(key, binding);
    }
    document.addEventListener('keydown', (event) => this.keyDown(event));
    document.addEventListener('keyup', (event) => this.keyUp(event));
    window.addEventListener('blur', () => this.down.clear());
  }

  /** Runs what is held down; true when anything is. */
  advance(seconds: number): boolean {
    for (const binding of this.down.values()) binding.hold?.(seconds);
    return this.down.size > 0;
  }

  /** The help as a table. */
  describe(target: HTMLElement, gestures: readonly (readonly [string, string])[]): void {
    const table = document.createElement('table');
    const head = (title: string): void => {
      const cell = document.createElement('th');
      cell.colSpan = 2;
      cell.textContent = title;
      table.insertRow().append(cell);
    };
    head('Mouse, pen, touch');
    for (const [what, does] of gestures) {
      const row = table.insertRow();
      row.insertCell().textContent = what;
      row.insertCell().textContent = does;
    }
    for (const section of this.sections) {
      head(section.title);
      for (const binding of section.bindings) {
        const row = table.insertRow();
        const cell = row.insertCell();
        binding.shown.split(' ').forEach((key, i) => {
          const mark = document.createElement('kbd');
          mark.textContent = key;
          cell.append(i > 0 ? ' ' : '', mark);
        });
        row.insertCell().textContent = binding.does;
      }
    }
    target.replaceChildren(table);
  }

  private keyDown(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || busyElsewhere(event)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const binding = (event.shiftKey ? this.table.get(`Shift+${key}`) : undefined) ?? this.table.get(key);
    if (!binding) return;
    event.preventDefault();
    if (event.repeat) return;
    binding.press?.();
    if (binding.hold) this.down.set(event.code, binding);
  }

  private keyUp(event: KeyboardEvent): void {
    this.down.delete(event.code);
  }
}

/** A form field, an open dialog, or Space and Enter on a button need the key themselves. */
function busyElsewhere(event: KeyboardEvent): boolean {
  if (document.querySelector('dialog[open]')) return true;
  const target = event.target;
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLInputElement && target.type === 'checkbox') return event.key === ' ';
  if (target instanceof HTMLInputElement || target instanceof HTMLSelectElement) return event.key !== 'Escape';
  return (target instanceof HTMLButtonElement || target.tagName === 'SUMMARY' || target instanceof HTMLAnchorElement) &&
    (event.key === ' ' || event.key === 'Enter');
}
