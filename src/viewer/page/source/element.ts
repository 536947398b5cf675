/** The element of the document with this id, of this class. */
export function element<T extends HTMLElement>(id: string, kind: new () => T): T {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new Error(`the document has no ${kind.name} '${id}'`);
  return found;
}

/** Says `text` there, unless it does already: words that are set anew are laid out and drawn anew. */
export function write(target: HTMLElement, text: string): void {
  if (target.textContent !== text) target.textContent = text;
}
