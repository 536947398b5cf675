// Colour maps: a number between 0 and 1 to sRGB bytes.

export type ColourMap = (t: number) => [number, number, number];

/** Piecewise linear between evenly spaced colours. */
function through(stops: readonly (readonly [number, number, number])[]): ColourMap {
  return (t) => {
    const x = Math.min(Math.max(Number.isFinite(t) ? t : 0, 0), 1) * (stops.length - 1);
    const i = Math.min(Math.floor(x), stops.length - 2);
    const a = stops[i] ?? [0, 0, 0];
    const b = stops[i + 1] ?? a;
    const f = x - i;
    return [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2])];
  };
}

/** Of magnitudes: even in lightness, from dark violet to yellow. */
export const sequential = through([
  [48, 18, 92],
  [59, 82, 139],
  [33, 145, 140],
  [94, 201, 98],
  [253, 231, 37],
]);

/** Of signed distances: blue below zero, orange above, grey at zero. */
export const diverging = through([
  [36, 84, 148],
  [96, 152, 196],
  [214, 218, 220],
  [226, 150, 92],
  [164, 72, 38],
]);

const forceStops = through([
  [255, 226, 122],
  [255, 193, 61],
  [255, 141, 38],
  [255, 84, 32],
]);

/** Colour of a force in newtons: pale yellow up to 30 mN, orange at 300 mN, red from 3 N on. */
export function forceColour(newtons: number): string {
  const [r, g, b] = forceStops(Math.log10(Math.max(newtons, 1e-6) / 0.03) / 2).map(Math.round) as [number, number, number];
  return `rgb(${r}, ${g}, ${b})`;
}

/** sRGB byte to the linear light that the renderer computes with, 0 to 1. */
export function linear(byte: number): number {
  const c = byte / 255;
  return c <= 0.04045 ? c / 12.92 : Math.pow((c + 0.055) / 1.055, 2.4);
}

/** A map as a table of `count` linear RGB triples. */
export function linearTable(map: ColourMap, count: number): Float32Array {
  const table = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const [r, g, b] = map(i / (count - 1));
    table.set([linear(r), linear(g), linear(b)], 3 * i);
  }
  return table;
}

/** Draws a map as a horizontal bar over a whole canvas. */
export function drawBar(canvas: HTMLCanvasElement, map: ColourMap): void {
  const context = canvas.getContext('2d');
  if (!context) return;
  for (let x = 0; x < canvas.width; ++x) {
    const [r, g, b] = map(x / (canvas.width - 1));
    context.fillStyle = `rgb(${r} ${g} ${b})`;
    context.fillRect(x, 0, 1, canvas.height);
  }
}

/** A force as the readout has it: in mN below 1 N, to a tenth of one below 100 mN. */
export function forceInWords(newtons: number): string {
  const milli = 1000 * newtons;
  if (milli >= 999.5) return `${newtons.toFixed(3)} N`;
  return `${milli.toFixed(milli < 99.95 ? 1 : 0)} mN`;
}

/** Three significant digits and an SI prefix: (0.00123, 'm') is '1.23 mm'. */
export function withUnit(value: number, unit: string): string {
  const prefixes: [number, string][] = [
    [1e9, 'G'],
    [1e6, 'M'],
    [1e3, 'k'],
    [1, ''],
    [1e-3, 'm'],
    [1e-6, 'µ'],
    [1e-9, 'n'],
  ];
  const size = Math.abs(value);
  if (!(size >= 1e-12)) return `0 ${unit}`;
  const [scale, prefix] = prefixes.find(([least]) => size >= 0.9995 * least) ?? [1e-9, 'n'];
  return `${(value / scale).toPrecision(3)} ${prefix}${unit}`;
}
