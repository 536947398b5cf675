// The pixels that a surface covers, from its triangles alone: what a picture of it is held against.
import type { Picture, Rect } from './composited';

export type Mask = Uint8Array<ArrayBuffer>;

export interface Shadow {
  organ: Mask; // well inside of what the surface covers, in the open
  about: Mask; // everywhere it covers and a little beyond
  open: Mask; // the view without what lies over it
}

const margin = 2; // px of the screen: edges are neither the one nor the other

/** `project` goes to pixels of the screen; `view` and `covers` are in such pixels. */
export function castShadow(
  { width, height, ratio }: Picture,
  positions: readonly number[],
  triangles: readonly number[],
  project: (x: number, y: number, z: number) => [number, number],
  { view, covers }: { view: Rect; covers: readonly Rect[] },
): Shadow {
  const covered: Mask = new Uint8Array(width * height);
  const places: [number, number][] = [];
  for (let v = 0; v < positions.length; v += 3) places.push(project(positions[v]!, positions[v + 1]!, positions[v + 2]!));
  for (let t = 0; t < triangles.length; t += 3) {
    fill(covered, width, height, places[triangles[t]!]!, places[triangles[t + 1]!]!, places[triangles[t + 2]!]!);
  }
  const open: Mask = new Uint8Array(width * height);
  for (let y = view.top; y < view.bottom; ++y) open.fill(1, y * width + view.left, y * width + view.right);
  const edge = Math.ceil(ratio);
  for (const cover of covers) {
    for (let y = Math.max(cover.top - edge, 0); y < Math.min(cover.bottom + edge, height); ++y) {
      open.fill(0, y * width + Math.max(cover.left - edge, 0), y * width + Math.min(cover.right + edge, width));
    }
  }
  const reach = Math.ceil(margin * ratio);
  const inverse = covered.map((value) => 1 - value);
  const shrunk = grown(inverse, width, height, reach);
  return { organ: open.map((value, i) => (value && !shrunk[i] ? 1 : 0)), about: grown(covered, width, height, 2 * reach), open };
}

/** Sets the pixels whose middles lie in a triangle. */
function fill(mask: Mask, width: number, height: number, a: [number, number], b: [number, number], c: [number, number]): void {
  const from = Math.max(Math.ceil(Math.min(a[1], b[1], c[1]) - 0.5), 0);
  const to = Math.min(Math.floor(Math.max(a[1], b[1], c[1]) - 0.5), height - 1);
  for (let y = from; y <= to; ++y) {
    let [left, right] = [Infinity, -Infinity];
    for (const [p, q] of [[a, b], [b, c], [c, a]] as const) {
      if (p[1] === q[1]) continue;
      const t = (y + 0.5 - p[1]) / (q[1] - p[1]);
      if (t < 0 || t > 1) continue;
      const x = p[0] + t * (q[0] - p[0]);
      left = Math.min(left, x);
      right = Math.max(right, x);
    }
    const first = Math.max(Math.ceil(left - 0.5), 0);
    const last = Math.min(Math.floor(right - 0.5), width - 1);
    if (last >= first) mask.fill(1, y * width + first, y * width + last + 1);
  }
}

/** What is set, and everything within `reach` px of it across and up. */
function grown(mask: Mask, width: number, height: number, reach: number): Mask {
  const wide: Mask = new Uint8Array(mask.length);
  const tall: Mask = new Uint8Array(mask.length);
  const spread = (from: Mask, to: Mask, lines: number, count: number, step: number, line: number): void => {
    for (let l = 0; l < lines; ++l) {
      let last = -Infinity;
      for (let i = 0; i < count; ++i) {
        if (from[l * line + i * step]) last = i;
        if (i - last <= reach) to[l * line + i * step] = 1;
      }
      last = Infinity;
      for (let i = count - 1; i >= 0; --i) {
        if (from[l * line + i * step]) last = i;
        if (last - i <= reach) to[l * line + i * step] = 1;
      }
    }
  };
  spread(mask, wide, height, width, 1, width);
  spread(wide, tall, width, height, width, 1);
  return tall;
}
