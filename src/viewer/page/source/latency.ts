// How long it takes from a pose of the hand to the picture of the body that answers it.

export class Latency {
  private readonly sent = new Map<number, number>(); // pose number: ms
  private readonly seconds: number[] = [];
  private answered = 0;

  posed(n: number, now: number): void {
    this.sent.set(n, now);
  }

  /** A picture whose solve knew pose `n` has been drawn. */
  drawn(n: number, now: number): void {
    if (n <= this.answered) return;
    this.answered = n;
    const start = this.sent.get(n);
    if (start !== undefined) {
      this.seconds.push((now - start) / 1000);
      if (this.seconds.length > 200) this.seconds.shift();
    }
    for (const older of this.sent.keys()) if (older <= n) this.sent.delete(older);
  }

  clear(): void {
    this.sent.clear();
    this.seconds.length = 0;
    this.answered = 0;
  }

  /** Quantile in s over the last 200 answers; null: too few. */
  quantile(q: number): number | null {
    if (this.seconds.length < 5) return null;
    const sorted = [...this.seconds].sort((a, b) => a - b);
    return sorted[Math.min(sorted.length - 1, Math.floor(q * sorted.length))] ?? null;
  }

  get count(): number {
    return this.seconds.length;
  }
}
