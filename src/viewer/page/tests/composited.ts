// What the browser has put together, as a person sees it, and what the camera should show there. Nothing here asks the page to
// draw: the picture is taken by the browser ten frames after whatever was changed last.
import assert from 'node:assert/strict';
import type { Page as Tab } from 'playwright-core';
import { PNG } from 'pngjs';
import type { Topology, Vec3 } from '../source/protocol';
import { castRay, lipEdges } from '../source/surface';
import { castShadow, type Mask } from './shadow';

export interface Picture {
  width: number; // px of the screen
  height: number;
  ratio: number; // px of the screen per px of the page
  data: Buffer; // RGBA
}

/** Lets the browser show `frames` frames. */
export async function frames(tab: Tab, count = 10): Promise<void> {
  await tab.evaluate(async (left) => {
    for (; left > 0; --left) await new Promise((next) => requestAnimationFrame(next));
  }, count);
}

/** The window as it is composited, ten frames later, as PNG or as JPEG. */
export async function capture(tab: Tab, format: 'png' | 'jpeg' = 'png', quality = 80, wait = 10): Promise<Buffer> {
  await frames(tab, wait);
  return tab.screenshot(format === 'png' ? { type: format } : { type: format, quality });
}

export async function composited(tab: Tab, wait = 10): Promise<Picture> {
  const { width, height, data } = PNG.sync.read(await capture(tab, 'png', 80, wait));
  const across = await tab.evaluate(() => window.innerWidth);
  return { width, height, ratio: width / across, data };
}

type Test = (r: number, g: number, b: number) => boolean;
/** What a pixel of the view can be of, by its colour. */
export const kinds = {
  backdrop: (r, g, b) => r < 46 && g >= r + 2 && b >= g - 2 && b < 92, // the drape
  tissue: (r, g, b) => r > g + 22 && r > b + 18 && g < b + 60 && r > 45, // of the organ, and the walls of a wound
  wall: (r, g, b) => r > 20 && g < 0.3 * r && b < 0.35 * r, // of a wound alone
  lip: (r, g, b) => r > 185 && g > 0.62 * r && g - b > 16 && b > 90,
  steel: (r, g, b) => b >= r && r > 50 && b - r < 45 && g >= r - 4 && b < 253,
  arrow: (r, g, b) => r > 232 && g > 70 && g < 236 && b < 136 && g - b > 40, // and the curve of the chart
  hand: (r, g, b) => Math.abs(r - 98) < 30 && Math.abs(g - 182) < 30 && Math.abs(b - 203) < 30,
  plan: (r, g, b) => b > 120 && b > r + 50 && b > g + 50,
} satisfies Record<string, Test>;
export type Kind = keyof typeof kinds;

/** Pixels of the picture that are of a kind, within `mask` (all), or in a rectangle of the page in px. */
export function count(picture: Picture, kind: Kind, where: Mask | Rect | null = null): number {
  const { width, height, data } = picture;
  const within = where instanceof Uint8Array ? where : null;
  const rect = where && !within ? pixelsOf(picture, where as Rect) : { left: 0, top: 0, right: width, bottom: height };
  const test: Test = kinds[kind];
  let found = 0;
  for (let y = rect.top; y < rect.bottom; ++y) {
    for (let i = y * width + rect.left; i < y * width + rect.right; ++i) {
      if (within && !within[i]) continue;
      if (test(data[4 * i]!, data[4 * i + 1]!, data[4 * i + 2]!)) found += 1;
    }
  }
  return found;
}

export interface Rect {
  left: number; // px of the page
  top: number;
  right: number;
  bottom: number;
}

function pixelsOf({ width, height, ratio }: Picture, { left, top, right, bottom }: Rect): Rect {
  const clamp = (at: number, most: number): number => Math.min(Math.max(Math.round(at * ratio), 0), most);
  return { left: clamp(left, width), right: clamp(right, width), top: clamp(top, height), bottom: clamp(bottom, height) };
}

/** How many colours there are in a rectangle of the page. */
export function shadesIn(picture: Picture, where: Rect): number {
  const { left, top, right, bottom } = pixelsOf(picture, where);
  const shades = new Set<number>();
  for (let y = top; y < bottom; ++y) for (let x = left; x < right; ++x) shades.add(picture.data.readUInt32BE(4 * (y * picture.width + x)));
  return shades.size;
}

export const box = (tab: Tab, id: string): Promise<Rect> =>
  tab.evaluate((name) => {
    const { left, top, right, bottom } = document.getElementById(name)!.getBoundingClientRect();
    return { left, top, right, bottom };
  }, id);

interface Scene {
  view: Rect; // of the canvas in the page
  covers: Rect[]; // what lies over it
  positions: number[]; // of the surface, m
  triangles: number[];
  walls: number[]; // triangles of the surface with the walls of its wound
  parts: number[]; // of those
  tags: number[]; // of the vertices
  eye: number[]; // m
  camera: number[]; // column by column: from metres to the cube of what is seen
  tip: number[];
  arrowEnd: number[];
  toolRadius: number; // m
  mode: string;
  force: number;
}

/** What the page has been told by the server and the camera it looks with. */
function scene(tab: Tab): Promise<Scene> {
  return tab.evaluate(() => {
    const { view, frame, session } = globalThis.spherecut!;
    const rect = (element: Element): Rect => {
      const { left, top, right, bottom } = element.getBoundingClientRect();
      return { left, top, right, bottom };
    };
    const over = [...document.querySelectorAll('#view > :not(canvas, .still)')].filter((part) => part.getClientRects().length > 0);
    const { positions, triangles } = view.body.snapshot()!;
    const topology = view.body.topology!;
    const cut = topology.partners.length > 0;
    const [walls, parts, tags] = cut ? [[...topology.triangles], [...topology.parts], [...topology.tags]] : [[], [], []];
    const eye = view.orbit.camera.position.toArray();
    const camera = view.orbit.camera.projectionMatrix.clone().multiply(view.orbit.camera.matrixWorldInverse).toArray();
    const tip = [...frame!.tip];
    const force = Math.hypot(...frame!.force);
    const arrowEnd = tip.map((x, d) => x + frame!.force[d]! / view.tool.scale);
    const toolRadius = session!.tool?.radius ?? 0;
    return {
      view: rect(view.canvas), covers: over.map(rect), positions: [...positions], triangles: [...triangles], walls, parts, tags, eye, camera, tip,
      arrowEnd, toolRadius, mode: frame!.mode, force,
    };
  });
}

export interface Seen {
  picture: Picture;
  open: Mask; // what nothing lies over
  expected: number; // px that the organ covers, without what lies over the view
  missing: number; // of them the ones that show the backdrop
  tissue: number; // of them the ones of the organ's colours
  strays: number; // px of the organ's colours where there is no organ
  beside: number; // px where there is no organ and nothing lies over the view
  drape: number; // of them the ones of the drape
  steel: number; // px of the tool
  arrow: number; // px of the arrow about the line from the tip to its end
  arrowLength: number; // px that this line has
  wall: number; // px of the wound's colours
  lip: number; // px of the colour of its lips
  lipLength: number; // px that the lips have that the camera sees, and that nothing lies over
  lipSeen: number; // of them the ones that have a pixel of that colour beside them
  hand: number; // px of the hand and its spring
  chart: number; // px of the curve above its zero
  toolPixels: number; // px that the front half of a ball of the tool's radius has; 0: the tip is not in the picture
}

/** Points on the lips that the camera sees, m, a px of the screen apart. */
function lipsInSight(told: Scene, project: (x: number, y: number, z: number) => [number, number]): Vec3[] {
  if (told.walls.length === 0) return [];
  const { eye, tags, parts, walls } = told;
  const positions = Float32Array.from(told.positions);
  const triangles = Uint32Array.from(walls);
  const edges = lipEdges({ vertexCount: tags.length, triangleCount: parts.length, tags, parts, triangles } as unknown as Topology);
  const points: Vec3[] = [];
  for (let i = 0; i < edges.length; i += 2) {
    const [a, b] = [edges[i]!, edges[i + 1]!].map((v) => [...positions.subarray(3 * v, 3 * v + 3)] as Vec3) as [Vec3, Vec3];
    const way = a.map((x, d) => 0.5 * (x + b[d]!) - eye[d]!);
    const far = Math.hypot(...way);
    const hit = castRay(positions, triangles, positions, eye as Vec3, way.map((x) => x / far) as Vec3);
    if (hit && hit.distance < far - 5e-4) continue; // behind something else
    const [from, to] = [project(...a), project(...b)];
    const steps = Math.max(1, Math.round(Math.hypot(to[0] - from[0], to[1] - from[1])));
    for (let k = 0; k < steps; ++k) points.push(a.map((x, d) => x + ((k + 0.5) / steps) * (b[d]! - x)) as Vec3);
  }
  return points;
}

/** How many of `places`, px, are in the open, and how many of those have a pixel of a kind within 2 px of the page. */
function countBeside(picture: Picture, kind: Kind, open: Mask, places: readonly [number, number][]): [number, number] {
  const { width, height, data } = picture;
  const reach = Math.ceil(2 * picture.ratio);
  let [all, found] = [0, 0];
  for (const [x, y] of places.map(([u, v]) => [Math.floor(u), Math.floor(v)] as const)) {
    if (x < 0 || x >= width || y < 0 || y >= height || !open[y * width + x]) continue;
    all += 1;
    let has = false;
    for (let v = Math.max(y - reach, 0); !has && v <= Math.min(y + reach, height - 1); ++v) {
      for (let u = Math.max(x - reach, 0); !has && u <= Math.min(x + reach, width - 1); ++u) {
        const i = 4 * (v * width + u);
        has = kinds[kind](data[i]!, data[i + 1]!, data[i + 2]!);
      }
    }
    if (has) found += 1;
  }
  return [all, found];
}

const isSame = (one: ArrayLike<number>, other: ArrayLike<number>): boolean => one.length === other.length && Array.from(one).every((value, i) => value === other[i]);

/** Takes a picture and counts what is seen in it against what the camera should see. */
export async function see(tab: Tab, wait = 10): Promise<Seen> {
  // On a busy machine a frame may come, or a message go, between the picture and what the page tells of it: then both are
  // taken again.
  let told = await scene(tab);
  let picture = await composited(tab, wait);
  for (let attempt = 0; attempt < 6; ++attempt) {
    const before = told;
    told = await scene(tab);
    const lying = (scene: typeof told): number[] => scene.covers.flatMap(({ left, top, right, bottom }) => [left, top, right, bottom]);
    if (isSame(before.camera, told.camera) && isSame(before.positions, told.positions) && isSame(lying(before), lying(told))) break;
    picture = await composited(tab, wait);
  }
  const chart = await box(tab, 'chart');
  const { ratio, width } = picture;
  const project = (x: number, y: number, z: number): [number, number] => {
    const m = told.camera;
    const w = m[3]! * x + m[7]! * y + m[11]! * z + m[15]!;
    const [u, v] = [(m[0]! * x + m[4]! * y + m[8]! * z + m[12]!) / w, (m[1]! * x + m[5]! * y + m[9]! * z + m[13]!) / w];
    const { left, top, right, bottom } = told.view;
    return [ratio * (left + 0.5 * (u + 1) * (right - left)), ratio * (top + 0.5 * (1 - v) * (bottom - top))];
  };
  const { organ, about, open } = castShadow(picture, told.positions, told.triangles, project, {
    view: pixelsOf(picture, told.view),
    covers: told.covers.map((cover) => pixelsOf(picture, cover)),
  });
  const [tip, end] = [project(...(told.tip as [number, number, number])), project(...(told.arrowEnd as [number, number, number]))];
  const side = project(told.tip[0]! + told.toolRadius, told.tip[1]!, told.tip[2]!);
  const radius = Math.hypot(side[0] - tip[0], side[1] - tip[1]);
  const inside = tip[0] >= 0 && tip[0] < width && tip[1] >= 0 && tip[1] < picture.height;
  const near = new Uint8Array(open.length);
  const length = Math.hypot(end[0] - tip[0], end[1] - tip[1]);
  for (let i = 0; i < near.length; ++i) {
    if (!open[i]) continue;
    const [x, y] = [(i % width) - tip[0], Math.floor(i / width) - tip[1]];
    const along = length > 0 ? (x * (end[0] - tip[0]) + y * (end[1] - tip[1])) / length : 0;
    const t = Math.min(Math.max(along, 0), length);
    const gap = length > 0 ? Math.hypot(x - (t * (end[0] - tip[0])) / length, y - (t * (end[1] - tip[1])) / length) : Math.hypot(x, y);
    near[i] = gap < 14 * ratio ? 1 : 0;
  }
  const lips = lipsInSight(told, project).map((x) => project(...x));
  const [lipLength, lipSeen] = countBeside(picture, 'lip', open, lips);
  const beside = open.map((value, i) => (value && !about[i] ? 1 : 0));
  return {
    picture,
    open,
    expected: organ.reduce((sum, value) => sum + value, 0),
    missing: count(picture, 'backdrop', organ),
    tissue: count(picture, 'tissue', organ),
    strays: count(picture, 'tissue', beside),
    beside: beside.reduce((sum: number, value) => sum + value, 0),
    drape: count(picture, 'backdrop', beside),
    steel: count(picture, 'steel', open),
    arrow: count(picture, 'arrow', near),
    arrowLength: told.force > 0 ? length : 0,
    wall: count(picture, 'wall', organ),
    lip: count(picture, 'lip', organ),
    lipLength,
    lipSeen,
    hand: count(picture, 'hand', open),
    chart: count(picture, 'arrow', { ...chart, bottom: chart.bottom - 24 }),
    toolPixels: inside ? 0.5 * Math.PI * radius * radius : 0,
  };
}

/** The organ is where the camera sees it, in whatever colours and however much shines through it. */
export function organIsThere({ expected, missing, picture }: Seen, when: string): void {
  assert.ok(expected > 3000 * picture.ratio ** 2, `${when}: the organ should cover more than ${expected} px`);
  assert.ok(missing < 0.1 * expected, `${when}: ${missing} of ${expected} px of the organ show what is behind it`);
}

/** The organ is where the camera sees it, whole, in its own colours, and nowhere else. */
export function organIsSeen(seen: Seen, when: string): void {
  const { expected, missing, tissue, strays, beside, drape, steel } = seen;
  const all = JSON.stringify({ ...seen, picture: undefined, open: undefined });
  assert.ok(expected > 3000 * seen.picture.ratio ** 2, `${when}: the organ should cover more than ${expected} px`);
  assert.ok(missing < 0.015 * expected, `${when}: ${missing} of ${expected} px of the organ show what is behind it: ${all}`);
  assert.ok(tissue > 0.6 * expected, `${when}: ${tissue} of ${expected} px have the colours of the organ: ${all}`);
  assert.ok(strays < 0.01 * expected, `${when}: ${strays} px of an organ where none is: ${all}`);
  assert.ok(drape + steel > 0.8 * beside, `${when}: ${drape} of ${beside} px beside the organ show the drape: ${all}`);
}

/** The lips of the wound are where the camera sees them; what the tool hides of them is within the share that may be missing. */
export function woundIsSeen(seen: Seen, least: number, when: string): void {
  const { lipLength, lipSeen, wall, picture } = seen;
  assert.ok(lipLength > least * picture.ratio, `${when}: the lips should be ${lipLength} px long`);
  assert.ok(lipSeen > 0.8 * lipLength, `${when}: ${lipSeen} of ${lipLength} px of the lips are in the picture, ${wall} px of the wound's walls`);
}
