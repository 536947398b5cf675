// What the organ lies on: a drape, dark where it fades into the room and under the organ, whose soft shadow it takes. It lies
// in a canvas below the picture and is drawn when the camera or the organ has changed, not in every picture.
import { PerspectiveCamera, Vector3 } from 'three';
import type { Vec3 } from './protocol';

const dark = '#0c1216';
const cloth = [28, 70, 75]; // sRGB
const far = 1.5; // of the organ's size, to where the light reaches

export class Drape {
  readonly canvas = document.createElement('canvas');
  private lower: Vec3 = [0, 0, 0];
  private upper: Vec3 = [0, 0, 0];
  private shown = ''; // camera and size that it was drawn for

  /** `changed` is called when what was drawn is gone. */
  constructor(picture: HTMLCanvasElement, changed: () => void) {
    this.canvas.className = 'still';
    this.canvas.setAttribute('aria-hidden', 'true');
    picture.before(this.canvas);
    // A process of the browser that dies can take this canvas with it, before or after the one of the picture.
    for (const event of ['contextlost', 'contextrestored']) {
      this.canvas.addEventListener(event, () => {
        this.shown = '';
        changed();
      });
    }
  }

  /** Below an organ with these bounds. */
  lay(lower: Vec3, upper: Vec3): void {
    [this.lower, this.upper, this.shown] = [lower, upper, ''];
  }

  /** As `camera` sees it, in `width` x `height` pixels. */
  draw(camera: PerspectiveCamera, width: number, height: number): void {
    const wanted = `${width} ${height} ${camera.matrixWorld.elements.join()}`;
    if (wanted === this.shown) return;
    this.canvas.width = width;
    this.canvas.height = height;
    // In memory, where no process that dies takes it away.
    const context = this.canvas.getContext('2d', { alpha: false, willReadFrequently: true });
    if (!context || context.isContextLost()) return;
    this.shown = wanted;
    context.fillStyle = dark;
    context.fillRect(0, 0, width, height);
    const { lower, upper } = this;
    const middle = new Vector3(0.5 * (lower[0] + upper[0]), 0.5 * (lower[1] + upper[1]), lower[2]);
    if (camera.position.z <= lower[2]) return; // from below there is none
    const pixel = (x: number, y: number): [number, number] => {
      const at = new Vector3(middle.x + x, middle.y + y, middle.z).project(camera);
      return [0.5 * (at.x + 1) * width, 0.5 * (1 - at.y) * height];
    };
    const size = Math.hypot(...upper.map((high, d) => high - lower[d]!));
    /** Fills what an ellipse about the middle looks like: seen from afar an ellipse is one again. */
    const fill = (across: number, along: number, colours: readonly (readonly [number, string])[]): void => {
      const [x0, y0] = pixel(0, 0);
      const [[x1, y1], [x2, y2]] = [pixel(0.02 * across, 0), pixel(0, 0.02 * along)];
      context.setTransform((x1 - x0) * 50, (y1 - y0) * 50, (x2 - x0) * 50, (y2 - y0) * 50, x0, y0);
      const gradient = context.createRadialGradient(0, 0, 0, 0, 0, 1);
      for (const [part, colour] of colours) gradient.addColorStop(part, colour);
      context.fillStyle = gradient;
      context.fillRect(-1, -1, 2, 2);
      context.setTransform(1, 0, 0, 1, 0, 0);
    };
    const light = (part: number): string => `rgb(${cloth.join(' ')} / ${part})`;
    fill(far * size, far * size, [[0, light(1)], [0.35, light(0.8)], [0.7, light(0.25)], [1, light(0)]]);
    const shadow = (part: number): string => `rgb(4 8 10 / ${part})`;
    const [across, along] = [0.5 * (upper[0] - lower[0]), 0.5 * (upper[1] - lower[1])];
    fill(1.6 * across, 1.6 * along, [[0, shadow(0.9)], [0.5, shadow(0.85)], [0.68, shadow(0.45)], [0.84, shadow(0.14)], [1, shadow(0)]]);
  }
}
