// What the server says in words, for a while over the picture: the newest information, the last warnings and errors.

export type Level = 'info' | 'warning' | 'error';

const most = 4;

export class Messages {
  constructor(private readonly list: HTMLElement) {}

  say(level: Level, text: string): void {
    for (const shown of this.list.children) {
      const same = shown.textContent === text;
      const news = level === 'info' && shown instanceof HTMLElement && shown.dataset['level'] === 'info';
      if (same || news) shown.remove();
    }
    const line = document.createElement('p');
    line.dataset['level'] = level;
    line.textContent = text;
    this.list.append(line);
    while (this.list.childElementCount > most) this.list.firstElementChild?.remove();
    setTimeout(() => line.remove(), level === 'info' ? 6000 : 20000);
  }
}
