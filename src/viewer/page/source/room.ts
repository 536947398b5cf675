// What the organ lies on: a drape, dark where it fades into the room and under the organ, whose soft shadow it takes. It lies
// below the picture and is laid anew when the camera or the organ has changed, not in every picture. The page has it as elements
// with a background and not as a canvas: a canvas can stay black for good once the browser's process that draws has died.
import { PerspectiveCamera, Vector3 } from 'three';
import type { Vec3 } from './protocol';

const dark = '#0c1216';
const cloth = [28, 70, 75]; // sRGB
const patchSize = 256; // px of an element with the colours of an ellipse, as style.css has it
const far = 1.5; // of the organ's size, to where the light reaches

type Pixels = (x: number, y: number) => [number, number];

/** An ellipse on the drape: from pixels of the unit disc to those of the picture, [a, b, c, d, e, f] as in CSS, and its colours. */
interface Patch {
  transform: [number, number, number, number, number, number];
  colours: readonly (readonly [part: number, colour: string])[]; // from its middle to its rim
}

export class Drape {
  private readonly cloth = document.createElement('div');
  private lower: Vec3 = [0, 0, 0];
  private upper: Vec3 = [0, 0, 0];
  private shown = ''; // camera and size that it was laid for

  constructor(private readonly picture: HTMLCanvasElement) {
    this.cloth.className = 'still drape';
    this.cloth.setAttribute('aria-hidden', 'true');
    this.cloth.style.background = dark;
    picture.before(this.cloth);
  }

  /** Below an organ with these bounds. */
  lay(lower: Vec3, upper: Vec3): void {
    [this.lower, this.upper, this.shown] = [lower, upper, ''];
  }

  /** As `camera` sees it, below the picture. */
  show(camera: PerspectiveCamera): void {
    const { clientWidth: width, clientHeight: height } = this.picture;
    const wanted = `${width} ${height} ${camera.matrixWorld.elements.join()}`;
    if (wanted === this.shown) return;
    this.shown = wanted;
    this.cloth.replaceChildren(...this.patches(camera, width, height).map(({ transform: [a, b, c, d, e, f], colours }) => {
      const patch = document.createElement('div');
      const stops = colours.map(([part, colour]) => `${colour} ${100 * part}%`);
      patch.style.background = `radial-gradient(closest-side, ${stops.join(', ')})`;
      // The unit disc is as wide as the element.
      const half = 0.5 * patchSize;
      patch.style.transform = `matrix(${[a / half, b / half, c / half, d / half, e - half, f - half].join(', ')})`;
      return patch;
    }));
  }

  /** Paints it as `camera` sees it, in `width` x `height` pixels. */
  paint(context: CanvasRenderingContext2D, camera: PerspectiveCamera, width: number, height: number): void {
    context.fillStyle = dark;
    context.fillRect(0, 0, width, height);
    for (const { transform, colours } of this.patches(camera, width, height)) {
      context.save();
      context.transform(...transform);
      const gradient = context.createRadialGradient(0, 0, 0, 0, 0, 1);
      for (const [part, colour] of colours) gradient.addColorStop(part, colour);
      context.fillStyle = gradient;
      context.fillRect(-1, -1, 2, 2);
      context.restore();
    }
  }

  private patches(camera: PerspectiveCamera, width: number, height: number): Patch[] {
    const { lower, upper } = this;
    if (camera.position.z <= lower[2]) return []; // from below there is none
    const middle = new Vector3(0.5 * (lower[0] + upper[0]), 0.5 * (lower[1] + upper[1]), lower[2]);
    const pixel: Pixels = (x, y) => {
      const at = new Vector3(middle.x + x, middle.y + y, middle.z).project(camera);
      return [0.5 * (at.x + 1) * width, 0.5 * (1 - at.y) * height];
    };
    const size = Math.hypot(...upper.map((high, d) => high - lower[d]!));
    /** What an ellipse about the middle looks like: seen from afar an ellipse is one again. */
    const patch = (across: number, along: number, colours: Patch['colours']): Patch => {
      const [x0, y0] = pixel(0, 0);
      const [[x1, y1], [x2, y2]] = [pixel(0.02 * across, 0), pixel(0, 0.02 * along)];
      return { transform: [(x1 - x0) * 50, (y1 - y0) * 50, (x2 - x0) * 50, (y2 - y0) * 50, x0, y0], colours };
    };
    const light = (part: number): string => `rgb(${cloth.join(' ')} / ${part})`;
    const shadow = (part: number): string => `rgb(4 8 10 / ${part})`;
    const [across, along] = [0.5 * (upper[0] - lower[0]), 0.5 * (upper[1] - lower[1])];
    return [
      patch(far * size, far * size, [[0, light(1)], [0.35, light(0.8)], [0.7, light(0.25)], [1, light(0)]]),
      patch(1.6 * across, 1.6 * along, [[0, shadow(0.9)], [0.5, shadow(0.85)], [0.68, shadow(0.45)], [0.84, shadow(0.14)], [1, shadow(0)]]),
    ];
  }
}
