// The force over the last seconds, scrolling.

export class ForceChart {
  private readonly times: number[] = [];
  private readonly forces: number[] = [];

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly seconds = 10,
  ) {}

  /** `now` in seconds on the page's clock, `force` in N. */
  add(now: number, force: number): void {
    this.times.push(now);
    this.forces.push(force);
    while (this.times.length > 2 && now - (this.times[1] ?? now) > this.seconds) {
      this.times.shift();
      this.forces.shift();
    }
  }

  clear(): void {
    this.times.length = this.forces.length = 0;
  }

  draw(now: number): void {
    const ratio = Math.min(globalThis.devicePixelRatio, 2);
    const width = Math.round(this.canvas.clientWidth * ratio);
    const height = Math.round(this.canvas.clientHeight * ratio);
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
    const context = this.canvas.getContext('2d');
    if (!context || width === 0) return;
    context.clearRect(0, 0, width, height);
    const left = 58 * ratio;
    const right = width - 8 * ratio;
    const bottom = height - 16 * ratio;
    const top = 10 * ratio;
    const peak = niceAbove(Math.max(0.05, ...this.forces));
    const x = (time: number): number => right - ((now - time) / this.seconds) * (right - left);
    const y = (force: number): number => bottom - (force / peak) * (bottom - top);
    context.font = `${11 * ratio}px system-ui, 'DejaVu Sans', sans-serif`;
    context.fillStyle = '#93a3ae';
    context.strokeStyle = '#2a353e';
    context.lineWidth = ratio;
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    for (const part of [0, 0.5, 1]) {
      context.beginPath();
      context.moveTo(left, y(part * peak));
      context.lineTo(right, y(part * peak));
      context.stroke();
      context.fillText(part * peak > 0 ? `${Number((1000 * part * peak).toPrecision(3))} mN` : '0', left - 6 * ratio, y(part * peak));
    }
    context.textAlign = 'left';
    context.fillText(`-${this.seconds} s`, left, height - 7 * ratio);
    context.textAlign = 'right';
    context.fillText('now', right, height - 7 * ratio);
    if (this.times.length < 2) return;
    context.beginPath();
    this.times.forEach((time, i) => context.lineTo(Math.max(x(time), left), y(this.forces[i] ?? 0)));
    context.strokeStyle = '#f2c14e';
    context.lineWidth = 1.6 * ratio;
    context.stroke();
    context.lineTo(x(this.times[this.times.length - 1] ?? now), bottom);
    context.lineTo(Math.max(x(this.times[0] ?? now), left), bottom);
    context.fillStyle = 'rgb(242 193 78 / 14%)';
    context.fill();
  }
}

/** The next of 1, 2, 5 times a power of ten. */
function niceAbove(value: number): number {
  const decade = Math.pow(10, Math.floor(Math.log10(value)));
  return ([1, 2, 5, 10].find((step) => step * decade >= value) ?? 10) * decade;
}
