// The picture: renderer, lights and what stands in it. Draws when something has changed.
import {
  Group,
  Mesh,
  MeshBasicMaterial,
  type PerspectiveCamera,
  RingGeometry,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from 'three';
import { Body } from './body';
import { Orbit } from './orbit';
import { Plan, planned } from './plan';
import { Overlays } from './overlays';
import type { Frame, SessionStart, Vec3 } from './protocol';
import { Drape } from './room';
import { clearAlpha, Still, windowOf } from './still';
import type { Ray } from './stylus';
import type { Hit } from './surface';
import { ForceScale, type PosedTool, ToolModel } from './tool_model';
import { ToolShadow } from './tool_shadow';
import { crossing, Trace } from './trace';

/** Of tissue: chosen by what pictures take, or one of the two. */
export type Shading = 'auto' | 'fine' | 'plain';

// Where the processor draws: s that a picture drawn as a whole may take. Above the one tissue is shaded plainly, below the other
// with its grain, which takes half as much again at most.
const slowest = 0.07;
const quickest = 0.03;
const leastInterval = 30; // ms between two pictures, where the processor draws

export class View {
  readonly orbit = new Orbit();
  readonly body = new Body();
  private readonly forces = new ForceScale(); // of both arrows
  readonly tool = new ToolModel(this.forces);
  readonly second = new ToolModel(this.forces); // the blade in the second hand
  readonly overlays = new Overlays();
  readonly trace = new Trace();
  readonly plan = new Plan();
  readonly shadow = new ToolShadow();
  readonly secondShadow = new ToolShadow(); // of the blade in the second hand
  readonly drape: Drape; // below the picture, which is drawn over it
  showPlan = false; // where the blade would go
  private size = 0.2; // m, of the organ
  readonly software: boolean; // drawn by the processor
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly standing = new Group(); // while the tool moves
  private readonly moving = new Group();
  private frame: Frame | null = null; // whose tool is shown
  private since = 0; // ms, the last picture was ordered
  private same = 0; // pictures in which the tool alone has changed
  kept = false; // the last picture without the tool
  private readonly mark: Mesh;
  private readonly still: Still | null; // the picture without the tool, where the processor draws
  private readonly gl: WebGL2RenderingContext;
  private stale: 'no' | 'tool' | 'all' = 'all'; // what has to be drawn again
  private sharpness = 1; // drawn pixels per pixel of the page, where the processor draws
  private fineEnough = true; // the grain, for what pictures take
  private wanted: Shading = 'auto';
  private drawSeconds = 0; // of a picture, smoothed
  private wholeSeconds = 0; // of a picture in which more than the tool was drawn, smoothed
  private givenBack: (() => void) | null = null; // the canvas has been given back, no picture is done yet
  private ordered: { done: WebGLSync; since: number; whole: boolean } | null = null; // the picture that the processor is at

  /** Throws Error in words when the browser has no WebGL 2. */
  constructor(readonly canvas: HTMLCanvasElement) {
    this.software = drawsInSoftware();
    // The drape, and what is kept of a picture, lie below the canvas and are seen through it.
    this.drape = new Drape(canvas);
    this.renderer = new WebGLRenderer({ canvas, alpha: true, antialias: !this.software, powerPreference: 'high-performance' });
    this.gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.still = this.software ? new Still(this.renderer, canvas, () => this.change()) : null;
    this.mark = new Mesh(
      new RingGeometry(0.72, 1, 32),
      new MeshBasicMaterial({ color: '#62b6cb', transparent: true, opacity: 0.8, depthTest: false }),
    );
    this.mark.visible = false;
    this.mark.renderOrder = 4;
    this.scene.add(this.standing, this.moving);
    this.standing.add(this.body.group, this.overlays.group);
    this.moving.add(this.trace.mesh, this.plan.mesh, this.shadow.mesh, this.secondShadow.mesh, this.tool.group, this.second.group, this.mark);
    new ResizeObserver(() => this.resize()).observe(canvas);
    // What a browser does with the canvas of a window that is not seen is its own affair.
    document.addEventListener('visibilitychange', () => this.change());
    this.resize();
  }

  /**
   * Calls `told` with true when the browser takes the canvas's contents away, with false when there is a whole picture again
   * after the browser has given the canvas back.
   */
  watchContext(told: (lost: boolean) => void): void {
    this.canvas.addEventListener('webglcontextlost', () => {
      this.ordered = null;
      this.kept = false;
      this.givenBack = null;
      told(true);
    });
    this.canvas.addEventListener('webglcontextrestored', () => {
      this.still?.lose();
      this.change();
      this.givenBack = () => told(false);
    });
  }

  /** `same`: the organ is the one of before, and the camera stays. */
  setSession(session: SessionStart, same: boolean): void {
    const { lower, upper } = session.bounds;
    const size = Math.hypot(upper[0] - lower[0], upper[1] - lower[1], upper[2] - lower[2]);
    if (!same) this.orbit.frameBox(lower, upper);
    this.size = size;
    this.mark.scale.setScalar(0.018 * size);
    this.forces.clear();
    this.tool.setSession(session);
    this.second.setSession(session);
    this.trace.clear(size);
    this.plan.setSize(size);
    this.drape.lay(lower, upper);
    this.change();
  }

  /** The tool of a frame, and, with the blade's `edge` in its frame, its way since the solve that is shown. */
  follow(frame: Frame, edge: readonly Vec3[]): void {
    this.frame = frame;
    this.showTools(frame);
    const blade = bladeOf(frame);
    if (!blade) return;
    const cast = (origin: Vec3, direction: Vec3): Hit | null => this.body.cast(origin, direction);
    this.trace.note(crossing(edge, blade.tip, blade.orientation, cast), blade.poseInTick, blade.poseInSolve);
  }

  /** What both hands hold, and the forces on it. */
  showTools(frame: Frame): void {
    const { second } = frame;
    this.forces.note(Math.max(Math.hypot(...frame.force), second ? Math.hypot(...second.force) : 0), this.size);
    this.tool.update(frame);
    if (!second) return this.second.hide();
    const posed: PosedTool = { mode: 'blade', axis: [0, 0, 1], ...second };
    this.second.update(posed);
  }

  /** Where the blade would go; of another tool nothing. */
  private plot(): void {
    const blade = this.frame && bladeOf(this.frame);
    const surface = this.body.surface();
    if (!this.showPlan || !blade || !surface) return this.plan.hide();
    this.plan.show(planned(blade.tip, blade.orientation, surface.positions, surface.triangles));
  }

  /** The shadow of the tool, as the lamp stands. */
  private darken(): void {
    const surface = this.body.surface();
    // Colours that stand for values are not darkened.
    if (!surface || this.body.transparent || this.body.coloured) {
      this.shadow.hide();
      return this.secondShadow.hide();
    }
    const { positions, normals, triangles } = surface;
    const lamp = this.body.lighting.lamp.value;
    this.shadow.fall(this.tool.rods(), lamp, positions, normals, triangles);
    this.secondShadow.fall(this.second.rods(), lamp, positions, normals, triangles);
  }

  /** Where the stylus is on the surface; null: nowhere. */
  setMark(hit: Hit | null): void {
    if (hit || this.mark.visible) this.moved();
    this.mark.visible = hit !== null;
    if (!hit) return;
    this.mark.position.set(...hit.point);
    this.mark.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), new Vector3(...hit.normal));
  }

  /** The picture has to be drawn again. */
  change(): void {
    this.stale = 'all';
  }

  /** Nothing but tool, force and the blade's way has. */
  moved(): void {
    if (this.stale === 'no') this.stale = 'tool';
  }

  /** Orders a picture if anything has changed and the last one is done; true when it has. */
  draw(): boolean {
    if (this.stale === 'no' || this.busy()) return false;
    const since = performance.now();
    this.since = since;
    this.drawNow();
    if (!this.software) {
      this.tellDone();
      return true;
    }
    const { gl } = this;
    const done = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    if (done) this.ordered = { done, since, whole: this.same < 2 };
    return true;
  }

  /** Whether the processor is still at the last picture. The hand and the messages go on meanwhile. */
  busy(): boolean {
    if (!this.ordered) return false;
    const { gl } = this;
    const { done, since, whole } = this.ordered;
    if (gl.clientWaitSync(done, 0, 0) === gl.TIMEOUT_EXPIRED) return true;
    gl.deleteSync(done);
    this.ordered = null;
    const seconds = (performance.now() - since) / 1000;
    this.drawSeconds += 0.2 * (seconds - this.drawSeconds);
    if (whole) this.wholeSeconds += 0.2 * (seconds - this.wholeSeconds);
    this.tellDone();
    this.adapt();
    return false;
  }

  /** A picture is done: the first one after the canvas was given back is told. */
  private tellDone(): void {
    this.givenBack?.();
    this.givenBack = null;
  }

  /** Where the processor draws it has more to do than pictures: the solver is on the same machine. */
  get resting(): boolean {
    return this.software && performance.now() - this.since < leastInterval;
  }

  /** The shading that is asked for. */
  set shading(wanted: Shading) {
    if (wanted === this.wanted) return;
    this.wanted = wanted;
    this.shade();
  }

  /** Whether the grain is in every pixel. */
  get fine(): boolean {
    return this.body.lighting.fine.value > 0;
  }

  /** Wall clock of a picture, s; 0 where graphics hardware draws and does not tell. */
  get pictureSeconds(): number {
    return this.drawSeconds;
  }

  drawNow(): void {
    const { camera } = this.orbit;
    this.light(camera);
    this.plot();
    this.darken();
    // Keeping costs as much as drawing: it pays from the second picture of the same organ on.
    this.same = this.stale === 'all' ? 0 : this.same + 1;
    this.kept = this.kept && this.same > 0;
    this.stale = 'no';
    // What shines through the organ cannot be drawn after it.
    if (!this.still || this.still.fails || this.body.transparent || this.same < 2) return this.drawAll(camera);
    if (!this.kept || !this.still.kept) {
      this.showing(true, false);
      // Of a picture that is drawn once for many the outline may cost what it does.
      this.body.lighting.outline.value = Number(this.body.smooth);
      this.drawAll(camera);
      this.body.lighting.outline.value = 0;
      this.kept = this.still.keep();
      this.showing(true, true);
      if (!this.kept) return this.drawAll(camera);
    }
    this.drawTool(this.still, camera);
  }

  /** Draws the tool over what is kept. */
  private drawTool(still: Still, camera: PerspectiveCamera): void {
    this.showing(false, true);
    this.moving.updateMatrixWorld();
    still.show(windowOf(this.moving, camera, this.gl.drawingBufferWidth, this.gl.drawingBufferHeight));
    this.renderer.autoClear = false;
    this.renderer.render(this.scene, camera);
    this.renderer.autoClear = true;
    this.showing(true, true);
  }

  /** Draws everything into the canvas itself, for who reads it at once. */
  drawWhole(): void {
    this.change();
    this.drawNow();
  }

  /** The lamp is over the left shoulder: shading tells the shape from every side. */
  private light(camera: PerspectiveCamera): void {
    const right = new Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
    const above = new Vector3().setFromMatrixColumn(camera.matrixWorld, 1);
    this.body.lighting.lamp.value.copy(camera.position).addScaledVector(right, -0.35).addScaledVector(above, 0.45).normalize();
  }

  private drawAll(camera: PerspectiveCamera): void {
    this.still?.hide();
    this.drape.show(camera);
    this.renderer.setClearColor(0x000000, clearAlpha);
    if (this.software) this.body.leaveOutBacks(camera.position.toArray() as Vec3);
    this.renderer.render(this.scene, camera);
  }

  private showing(still: boolean, moving: boolean): void {
    this.standing.visible = still;
    this.moving.visible = moving;
  }

  ray(x: number, y: number): Ray {
    const { clientWidth, clientHeight } = this.canvas;
    const camera = this.orbit.camera;
    const far = new Vector3((2 * x) / clientWidth - 1, 1 - (2 * y) / clientHeight, 0.5).unproject(camera);
    const direction = far.sub(camera.position).normalize();
    return { origin: camera.position.toArray() as Vec3, direction: direction.toArray() as Vec3 };
  }

  /** Pixel of the picture where a point in metres is drawn. */
  pixel(point: Vec3): { x: number; y: number } {
    const at = new Vector3(...point).project(this.orbit.camera);
    return { x: 0.5 * (at.x + 1) * this.canvas.clientWidth, y: 0.5 * (1 - at.y) * this.canvas.clientHeight };
  }

  /** The plain shading, then coarser pixels where the processor cannot keep up, the fine ones where it can. */
  private adapt(): void {
    const fine = this.wholeSeconds > slowest ? false : this.wholeSeconds < quickest ? true : this.fineEnough;
    if (fine !== this.fineEnough) {
      this.fineEnough = fine;
      this.wholeSeconds = this.drawSeconds = 0.5 * (slowest + quickest);
      this.shade();
      return;
    }
    let wanted = this.sharpness;
    if (this.drawSeconds > slowest) wanted = Math.max(0.5, wanted - 0.25);
    else if (this.drawSeconds < 0.02) wanted = Math.min(1, wanted + 0.25);
    if (wanted === this.sharpness) return;
    this.drawSeconds = 0.045;
    this.sharpness = wanted;
    this.resize();
  }

  private shade(): void {
    this.body.lighting.fine.value = Number(this.wanted === 'auto' ? this.fineEnough : this.wanted === 'fine');
    this.change();
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setPixelRatio(this.software ? this.sharpness : Math.min(globalThis.devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    const size = this.renderer.getDrawingBufferSize(new Vector2());
    this.overlays.setViewport(size.x, size.y);
    this.orbit.resize(clientWidth, clientHeight);
    this.change();
    this.drawNow();
  }
}

/** The blade of a frame, in whichever hand; null: neither has it. */
function bladeOf(frame: Frame): Pick<Frame, 'tip' | 'orientation' | 'poseInTick' | 'poseInSolve'> | null {
  return frame.second ?? (frame.mode === 'blade' ? frame : null);
}

/** Whether WebGL is computed by the processor, where smoothing edges costs more than the picture. */
function drawsInSoftware(): boolean {
  const context = document.createElement('canvas').getContext('webgl2');
  if (!context) throw new Error('This browser has no WebGL 2, which the picture needs.');
  const details = context.getExtension('WEBGL_debug_renderer_info');
  const name = details ? String(context.getParameter(details.UNMASKED_RENDERER_WEBGL)) : '';
  context.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}
