// How far the wound in the picture is behind the blade, and how wide its mouth is. Everything is seen in pictures that
// are done: the geometry that was drawn, the tool in it and the pose of the hand that the tool answers to.
import type { Page as Tab } from 'playwright-core';
import { Tag } from '../source/protocol';

/** A stroke as the pictures show it; times in s, lengths in m, forces in N. */
export interface Stroke {
  passed: number; // places of the surface that the edge has gone through, a third of a millimetre apart or more
  reached: number; // by the wound
  lags: number[]; // of these, from the hand's pose to the picture with the wound there
  forces: number[]; // on the blade, one a frame
}

declare global {
  var woundWatch: { places: { at: number[]; way: number[]; sent: number }[]; next: number; lags: number[]; forces: number[] } | undefined;
}

/** From here on every picture is looked at. */
export async function watchWound(tab: Tab): Promise<void> {
  await tab.evaluate((tag) => {
    const page = globalThis.spherecut!;
    const watch = (globalThis.woundWatch = { places: [], next: 0, lags: [], forces: [] } as NonNullable<typeof globalThis.woundWatch>);
    const sent = new Map<number, number>(); // pose number: ms
    let mouth: number[] = []; // vertices of the wound on the organ's own surface
    let known = -1; // topology of these
    const { latency, view } = page;
    const [posed, drawn, note] = [latency.posed.bind(latency), latency.drawn.bind(latency), view.trace.note.bind(view.trace)];
    latency.posed = (n, now) => {
      sent.set(n, now);
      posed(n, now);
    };
    view.trace.note = (hit, pose, solved) => {
      const last = watch.places.at(-1);
      const from = last?.at ?? hit?.point;
      const way = hit && from ? hit.point.map((x, d) => x - from[d]!) : [0, 0, 0];
      const start = sent.get(pose);
      if (hit && start !== undefined && (!last || Math.hypot(...way) > 0.0003)) watch.places.push({ at: hit.point, way, sent: start });
      note(hit, pose, solved);
    };
    latency.drawn = (n, now) => {
      drawn(n, now);
      const topology = view.body.topology;
      if (!topology || !page.frame) return;
      watch.forces.push(Math.hypot(...page.frame.force));
      if (topology.topology !== known) {
        known = topology.topology;
        const seen = new Set<number>();
        for (let t = 0; t < topology.triangleCount; ++t) {
          if (topology.parts[t] !== 0) continue; // a wall
          for (let k = 0; k < 3; ++k) {
            const v = topology.triangles[3 * t + k]!;
            if (topology.tags[v] === tag.lip || topology.tags[v] === tag.front) seen.add(v);
          }
        }
        mouth = [...seen];
      }
      const x = view.body.snapshot()?.positions;
      if (!x || mouth.length === 0) return;
      // The wound has come to a place when it goes on past it, in the way's direction, not far to the side.
      const reaches = ({ at, way }: { at: number[]; way: number[] }): boolean => {
        const length = Math.hypot(...way);
        return mouth.some((v) => {
          const gap = at.map((place, d) => x[3 * v + d]! - place);
          return Math.hypot(...gap) < 0.008 && (length === 0 || gap.reduce((sum, g, d) => sum + g * way[d]!, 0) >= 0);
        });
      };
      for (let i = watch.places.length - 1; i >= watch.next; --i) {
        if (!reaches(watch.places[i]!)) continue;
        for (; watch.next <= i; ++watch.next) watch.lags.push((now - watch.places[watch.next]!.sent) / 1000);
        break;
      }
    };
  }, Tag);
}

/** What has been seen since. */
export function seenOfWound(tab: Tab): Promise<Stroke> {
  return tab.evaluate(() => {
    const { places, lags, forces } = globalThis.woundWatch!;
    return { passed: places.length, reached: lags.length, lags: [...lags], forces: [...forces] };
  });
}

/** The widest place between the wound's lips on the surface, m, and as pixels of the picture. */
export function mouthOfWound(tab: Tab): Promise<{ width: number; pixels: number }> {
  return tab.evaluate((tag) => {
    const { view } = globalThis.spherecut!;
    const topology = view.body.topology!;
    const x = view.body.snapshot()!.positions;
    const place = (v: number): [number, number, number] => [x[3 * v]!, x[3 * v + 1]!, x[3 * v + 2]!];
    const best = { width: 0, pixels: 0 };
    for (let i = 0; i + 1 < topology.partners.length; i += 2) {
      const pair = [topology.partners[i]!, topology.partners[i + 1]!];
      if (pair.some((v) => topology.tags[v] !== tag.lip)) continue;
      const [a, b] = [place(pair[0]!), place(pair[1]!)];
      best.width = Math.max(best.width, Math.hypot(...a.map((p, d) => p - b[d]!)));
      const [p, q] = [view.pixel(a), view.pixel(b)];
      best.pixels = Math.max(best.pixels, Math.hypot(p.x - q.x, p.y - q.y));
    }
    return best;
  }, Tag);
}
