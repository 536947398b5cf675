// How long it takes from a pose of the hand to the picture that answers it: to the first that knows this pose or a later
// one. Every pose counts, also one that a later one overtook.

const remembered = 1000;

export class Latency {
  private readonly sent = new Map<number, number>(); // pose number: ms
  private readonly seconds: number[] = [];
  private answered = 0;

  posed(n: number, now: number): void {
    this.sent.set(n, now);
  }

  /** A picture that knows pose `n` has been drawn. */
  drawn(n: number, now: number): void {
    if (n <= this.answered) return;
    this.answered = n;
    for (const [pose, start] of this.sent) {
      if (pose > n) continue;
      this.seconds.push((now - start) / 1000);
      this.sent.delete(pose);
    }
    if (this.seconds.length > remembered) this.seconds.splice(0, this.seconds.length - remembered);
  }

  clear(): void {
    this.sent.clear();
    this.seconds.length = 0;
    this.answered = 0;
  }

  /** Quantile in s over the last answers; null: too few. */
  quantile(q: number): number | null {
    if (this.seconds.length < 5) return null;
    const sorted = [...this.seconds].sort((a, b) => a - b);
    return sorted[Math.min(sorted.length - 1, Math.floor(q * sorted.length))] ?? null;
  }

  get count(): number {
    return this.seconds.length;
  }
}
