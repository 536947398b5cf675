// What the server says in words, for a while over the picture.

export type Level = 'info' | 'warning' | 'error';

const most = 4;

export class Messages {
  constructor(private readonly list: HTMLElement) {}

  say(level: Level, text: string): void {
    for (const shown of this.list.children) {
      if (shown.textContent === text) shown.remove();
    }
    const line = document.createElement('p');
    line.dataset['level'] = level;
    line.textContent = text;
    this.list.append(line);
    while (this.list.childElementCount > most) this.list.firstElementChild?.remove();
    setTimeout(() => line.remove(), level === 'info' ? 6000 : 20000);
  }
}
