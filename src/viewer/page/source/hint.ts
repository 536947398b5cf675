// Three lines for who sees the page for the first time. They go with the first press, with Escape or by their button, and
// do not come again in this browser.
import { element } from './element';
import { remember, remembered } from './remembered';

export class Hint {
  private readonly card = element('hint', HTMLElement);

  constructor() {
    element('hint-close', HTMLButtonElement).addEventListener('click', () => this.close());
    document.addEventListener('keydown', (event) => {
      if (event.key === 'Escape') this.close();
    });
    this.card.hidden = remembered('hint') !== null;
  }

  close(): void {
    if (this.card.hidden) return;
    this.card.hidden = true;
    remember('hint', 'seen');
  }
}
