// What stands still, kept below the canvas: where the processor draws, the organ is not drawn again for a tool that moves.
// Its colours lie in a canvas of their own that the browser puts under the one that is drawn in. Its depths are kept beside
// them, so that the tool still goes in behind the surface. Nothing has to be put back into a canvas that the browser clears
// between two pictures but the depths where the tool is.
import { Box3, type Camera, Material, Mesh, type Object3D, Vector3, type WebGLRenderer } from 'three';
import { drawnPixels } from './pixels';

/** Alpha of a picture where nothing stands, seen by nobody. */
export const clearAlpha = 1 / 255;

/** A rectangle of the drawn canvas, px from its lower left corner: [left, bottom, right, top]. */
export type Window = readonly [number, number, number, number];

export class Still {
  private readonly under: HTMLCanvasElement;
  private readonly gl: WebGL2RenderingContext;
  private framebuffer: WebGLFramebuffer | null = null;
  private depth: WebGLRenderbuffer | null = null;
  private width = 0; // px
  private height = 0;
  private cannot = false;

  constructor(
    private readonly renderer: WebGLRenderer,
    canvas: HTMLCanvasElement,
    changed: () => void, // what was kept is gone
  ) {
    this.gl = renderer.getContext() as WebGL2RenderingContext;
    this.under = document.createElement('canvas');
    this.under.className = 'still';
    this.under.setAttribute('aria-hidden', 'true');
    canvas.before(this.under);
    // A process of the browser that dies can take this canvas with it, before or after the other one.
    for (const event of ['contextlost', 'contextrestored']) {
      this.under.addEventListener(event, () => {
        this.width = this.height = 0;
        changed();
      });
    }
  }

  /** This browser cannot keep depths: everything is drawn in every picture. */
  get fails(): boolean {
    return this.cannot;
  }

  /** Whether a picture of the canvas's size is kept. */
  get kept(): boolean {
    return this.width === this.gl.drawingBufferWidth && this.height === this.gl.drawingBufferHeight;
  }

  /** Keeps what has just been drawn; false: this browser cannot, or not now. */
  keep(): boolean {
    const { gl } = this;
    // In memory, where no process that dies takes it away.
    const context = this.under.getContext('2d', { willReadFrequently: true });
    if (this.cannot || !context || context.isContextLost() || gl.isContextLost()) return false;
    const first = this.framebuffer === null;
    if (first) while (gl.getError() !== gl.NO_ERROR); // those of others
    if (first || !this.kept) this.resize();
    this.copyDepth(null, this.framebuffer, [0, 0, this.width, this.height]);
    // Depths are copied between buffers of one format alone; of the canvas's it is not told.
    if (first) this.cannot = gl.getError() !== gl.NO_ERROR;
    if (this.cannot) return false;
    const picture = drawnPixels(gl);
    // No pixel of a picture is without any alpha: while a process that draws is started again nothing is read, and nobody says so.
    if (picture.data[3] === 0) return false;
    context.putImageData(picture, 0, 0);
    return true;
  }

  /**
   * Empties the canvas, through which the kept colours are seen then, and puts the depths back in `window`. The clearing comes
   * first: a copy alone does not count as drawing, and the canvas would be cleared after it.
   */
  show(window: Window): void {
    this.seen(true);
    this.renderer.setClearColor(0x000000, 0);
    this.renderer.clear(true, true, false);
    this.copyDepth(this.framebuffer, null, window);
  }

  /** What is kept is not seen: the whole picture is drawn over it. */
  hide(): void {
    this.seen(false);
  }

  private seen(shown: boolean): void {
    const wanted = shown ? 'visible' : 'hidden';
    if (this.under.style.visibility !== wanted) this.under.style.visibility = wanted;
  }

  /** Forgets what was lost with the context. */
  lose(): void {
    this.framebuffer = this.depth = null;
    this.width = this.height = 0;
  }

  private copyDepth(from: WebGLFramebuffer | null, to: WebGLFramebuffer | null, [left, bottom, right, top]: Window): void {
    const { gl } = this;
    if (right <= left || top <= bottom) return;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
    gl.blitFramebuffer(left, bottom, right, top, left, bottom, right, top, gl.DEPTH_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null); // as three knows it
  }

  private resize(): void {
    const { gl } = this;
    this.framebuffer ??= gl.createFramebuffer();
    this.depth ??= gl.createRenderbuffer();
    this.width = this.under.width = gl.drawingBufferWidth;
    this.height = this.under.height = gl.drawingBufferHeight;
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH24_STENCIL8, this.width, this.height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_STENCIL_ATTACHMENT, gl.RENDERBUFFER, this.depth);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }
}

const corner = new Vector3();
const box = new Box3();

/**
 * The part of a canvas of `width` x `height` pixels that what is visible of `object` and hides behind other things can cover.
 * The whole canvas when a part of it is beside or behind the eye. World matrices have to be those of the picture.
 */
export function windowOf(object: Object3D, camera: Camera, width: number, height: number): Window {
  let [left, bottom, right, top] = [Infinity, Infinity, -Infinity, -Infinity];
  let all = false;
  object.traverseVisible((part) => {
    const { geometry, material } = part as Mesh;
    if (!geometry || !(material instanceof Material) || !material.depthTest) return;
    if (!geometry.boundingBox) geometry.computeBoundingBox();
    box.copy(geometry.boundingBox!);
    if (box.isEmpty()) return;
    for (let i = 0; i < 8; ++i) {
      corner.set(i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z);
      corner.applyMatrix4(part.matrixWorld).applyMatrix4(camera.matrixWorldInverse);
      if (corner.z > -1e-6) all = true;
      corner.applyMatrix4(camera.projectionMatrix);
      left = Math.min(left, corner.x);
      right = Math.max(right, corner.x);
      bottom = Math.min(bottom, corner.y);
      top = Math.max(top, corner.y);
    }
  });
  if (all) return [0, 0, width, height];
  const pixel = (at: number, size: number, grow: number): number => Math.min(Math.max(Math.round(0.5 * (at + 1) * size) + grow, 0), size);
  if (left > right) return [0, 0, 0, 0];
  return [pixel(left, width, -2), pixel(bottom, height, -2), pixel(right, width, 2), pixel(top, height, 2)];
}
