// The tool at its tip, the hand that pulls it, the spring between them and the force as an arrow.
import {
  BufferAttribute,
  BufferGeometry,
  CapsuleGeometry,
  Color,
  ConeGeometry,
  CylinderGeometry,
  Group,
  Line,
  LineBasicMaterial,
  Material,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  Quaternion,
  SphereGeometry,
  Vector3,
} from 'three';
import { forceColour } from './colours';
import type { Frame, Mode, SessionStart, Vec3 } from './protocol';
import { metal } from './steel';
import type { Rod } from './tool_shadow';

const handColour = new Color('#62b6cb');
const up = new Vector3(0, 0, 1);
const along = new Vector3(0, 1, 0); // axis of three's cylinders
const springPoints = 97;

/** A tool of a frame, in one hand or the other. */
export type PosedTool = Pick<Frame, 'mode' | 'hand' | 'tip' | 'orientation' | 'axis' | 'force'>;

/** Of all arrows of a picture: its steps are 1, 2 and 5, so that the largest recent force has about a quarter of the organ. */
export class ForceScale {
  newtonsPerMetre = 10;
  private peak = 0; // N, largest force of the last seconds

  /** Once a frame, with the largest of its forces, N, and the size of the organ, m. */
  note(newtons: number, size: number): void {
    this.peak = Math.max(newtons, this.peak * 0.999, 0.02);
    const wanted = this.peak / (0.28 * size);
    if (wanted <= this.newtonsPerMetre && wanted >= 0.3 * this.newtonsPerMetre) return;
    const decade = Math.pow(10, Math.floor(Math.log10(wanted)));
    this.newtonsPerMetre = ([1, 2, 5, 10].find((step) => step * decade >= wanted) ?? 10) * decade;
  }

  clear(): void {
    this.peak = 0;
  }
}

export class ToolModel {
  readonly group = new Group();
  showSpring = true;
  private tools: Partial<Record<Mode, Group>> = {};
  private shapes: Partial<Record<Mode, Rod[]>> = {}; // of their shadows, in the tools' frames
  private readonly ghost: Mesh;
  private readonly spring: Line;
  private readonly arrow = new Group();
  private readonly shaft: Mesh;
  private readonly head: Mesh;
  private size = 0.2; // m, of the organ

  constructor(private readonly forces: ForceScale) {
    const overlay = (colour: Color, opacity: number): MeshBasicMaterial =>
      new MeshBasicMaterial({ color: colour, transparent: true, opacity, depthTest: false });
    this.ghost = new Mesh(new SphereGeometry(1, 16, 12), overlay(handColour, 0.45));
    this.ghost.renderOrder = 5;
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(3 * springPoints), 3));
    this.spring = new Line(geometry, new LineBasicMaterial({ color: handColour, depthTest: false, transparent: true }));
    this.spring.frustumCulled = false;
    this.spring.renderOrder = 6;
    this.shaft = new Mesh(new CylinderGeometry(1, 1, 1, 14), overlay(new Color(), 0.95));
    this.head = new Mesh(new ConeGeometry(1, 1, 18), overlay(new Color(), 0.95));
    this.shaft.renderOrder = this.head.renderOrder = 7;
    this.arrow.add(this.shaft, this.head);
    this.group.add(this.ghost, this.spring, this.arrow);
    this.group.visible = false;
  }

  /** How many newtons one metre of the arrow stands for. */
  get scale(): number {
    return this.forces.newtonsPerMetre;
  }

  setSession(session: SessionStart): void {
    for (const tool of Object.values(this.tools)) {
      this.group.remove(tool);
      tool.traverse((object) => dispose(object));
    }
    this.tools = {};
    const { lower, upper } = session.bounds;
    this.size = Math.hypot(upper[0] - lower[0], upper[1] - lower[1], upper[2] - lower[2]);
    this.tools.probe = probe(session, this.size);
    this.tools.grasper = grasper(session, this.size);
    if (session.blade) this.tools.blade = blade(session.blade.edge, this.size);
    this.shapes = toolRods(session, this.size);
    for (const tool of Object.values(this.tools)) this.group.add(tool);
    this.group.visible = false;
  }

  hide(): void {
    this.group.visible = false;
  }

  update(frame: PosedTool): void {
    this.group.visible = true;
    const tip = new Vector3(...frame.tip);
    const hand = new Vector3(...frame.hand);
    for (const [mode, tool] of Object.entries(this.tools) as [Mode, Group][]) {
      tool.visible = mode === frame.mode;
      if (!tool.visible) continue;
      tool.position.copy(tip);
      if (mode === 'blade') tool.quaternion.set(...frame.orientation);
      else tool.quaternion.setFromUnitVectors(up, new Vector3(...frame.axis).normalize());
    }
    const apart = hand.distanceTo(tip);
    const shown = this.showSpring && apart > 2e-4;
    this.ghost.visible = this.spring.visible = shown;
    if (shown) {
      this.ghost.position.copy(hand);
      this.ghost.scale.setScalar(0.006 * this.size);
      this.coil(tip, hand);
    }
    this.point(tip, new Vector3(...frame.force));
  }

  /** What throws the tool's shadow, where the tool is. */
  rods(): Rod[] {
    for (const [mode, tool] of Object.entries(this.tools) as [Mode, Group][]) {
      if (!tool.visible || !this.group.visible) continue;
      const place = (point: Vector3): Vector3 => point.clone().applyQuaternion(tool.quaternion).add(tool.position);
      return (this.shapes[mode] ?? []).map(({ from, to, radius }) => ({ from: place(from), to: place(to), radius }));
    }
    return [];
  }

  /** The arrow: linear in the force. */
  private point(tip: Vector3, force: Vector3): void {
    const newtons = force.length();
    const length = newtons / this.forces.newtonsPerMetre;
    this.arrow.visible = length > 0.004 * this.size;
    if (!this.arrow.visible) return;
    for (const { material } of [this.shaft, this.head]) (material as MeshBasicMaterial).color.set(forceColour(newtons));
    const headLength = Math.min(0.4 * length, 0.04 * this.size);
    const radius = 0.006 * this.size;
    this.arrow.position.copy(tip);
    this.arrow.quaternion.setFromUnitVectors(along, force.clone().divideScalar(newtons));
    this.shaft.scale.set(radius, length - headLength, radius);
    this.shaft.position.set(0, 0.5 * (length - headLength), 0);
    this.head.scale.set(2.4 * radius, headLength, 2.4 * radius);
    this.head.position.set(0, length - 0.5 * headLength, 0);
  }

  private coil(from: Vector3, to: Vector3): void {
    const direction = to.clone().sub(from);
    const length = direction.length();
    direction.divideScalar(length);
    const side = new Vector3(1, 0, 0).cross(direction);
    if (side.lengthSq() < 0.01) side.set(0, 1, 0).cross(direction);
    side.normalize();
    const other = direction.clone().cross(side);
    const radius = Math.min(0.012 * this.size, 0.6 * length);
    const place = this.spring.geometry.getAttribute('position') as BufferAttribute;
    for (let i = 0; i < springPoints; ++i) {
      const t = i / (springPoints - 1);
      const coil = Math.min(1, 8 * t, 8 * (1 - t)) * radius;
      const angle = 2 * Math.PI * 7 * t;
      const c = coil * Math.cos(angle);
      const s = coil * Math.sin(angle);
      place.setXYZ(
        i,
        from.x + t * length * direction.x + c * side.x + s * other.x,
        from.y + t * length * direction.y + c * side.y + s * other.y,
        from.z + t * length * direction.z + c * side.z + s * other.z,
      );
    }
    place.needsUpdate = true;
  }
}

/** A solid of revolution along +z from `from`, m. */
function rod(radius: number, from: number, length: number, material: Material): Mesh {
  const mesh = new Mesh(new CylinderGeometry(radius, radius, length, 24), material);
  mesh.quaternion.setFromUnitVectors(along, up);
  mesh.position.set(0, 0, from + 0.5 * length);
  return mesh;
}

function ball(radius: number, material: Material): Mesh {
  const mesh = new Mesh(new SphereGeometry(radius, 24, 16), material);
  mesh.position.set(0, 0, radius);
  return mesh;
}

/** The tool of the session; its reference point is the origin, its axis +z. */
function probe(session: SessionStart, size: number): Group {
  const group = new Group();
  const tool = session.tool;
  const material = metal();
  if (!tool) return group;
  if (tool.shape === 'punch') {
    group.add(rod(tool.radius, 0, tool.length, material));
  } else if (tool.shape === 'sphere') {
    group.add(ball(tool.radius, material), rod(0.45 * tool.radius, tool.radius, 0.5 * size, material));
  } else {
    group.add(ball(tool.radius, material), rod(tool.shaft_radius, tool.radius, tool.shaft_length, material));
  }
  return group;
}

/** Two jaws on a shaft that meet at the origin. */
function grasper(session: SessionStart, size: number): Group {
  const group = new Group();
  const radius = session.tool?.radius ?? 0.02 * size;
  const material = metal();
  for (const side of [-1, 1]) {
    const jaw = new Mesh(new CapsuleGeometry(0.22 * radius, 2.4 * radius, 4, 10), material);
    jaw.position.set(side * 0.45 * radius, 0, 1.4 * radius);
    jaw.quaternion
      .setFromUnitVectors(along, up)
      .premultiply(new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), side * 0.3));
    group.add(jaw);
  }
  group.add(rod(0.6 * radius, 2.7 * radius, 0.5 * size, material));
  return group;
}

/** A flat blade behind its edge, in the blade's frame: the back lies away from the edge's first side, towards +z. */
function blade(edge: readonly Vec3[], size: number): Group {
  const group = new Group();
  const first = edge[0];
  const last = edge[edge.length - 1];
  if (!first || !last) return group;
  let length = 0;
  for (let i = 1; i < edge.length; ++i) length += distance(edge[i - 1]!, edge[i]!);
  // The back: for a scalpel, whose edge rises away from its tip, straight up from the edge to the height of its end.
  const height = Math.max(...edge.map((point) => point[2]));
  const low = Math.min(...edge.map((point) => point[2]));
  const rises = height - low > 0.25 * length;
  const lift = rises ? 0 : 0.5 * length;
  const corners: number[] = [];
  const across = sideways(edge);
  for (const side of [-1, 1]) {
    for (const point of edge) {
      const back: Vec3 = rises ? [first[0], first[1], Math.max(point[2], first[2])] : [point[0], point[1], point[2] + lift];
      const thick = 0.004 * size;
      corners.push(...point);
      corners.push(back[0] + side * thick * across[0], back[1] + side * thick * across[1], back[2] + side * thick * across[2]);
    }
  }
  const index: number[] = [];
  const strip = 2 * edge.length;
  for (let side = 0; side < 2; ++side) {
    for (let i = 0; i + 1 < edge.length; ++i) {
      const at = side * strip + 2 * i;
      index.push(at, at + 1, at + 2, at + 1, at + 3, at + 2);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(Float32Array.from(corners), 3));
  geometry.setIndex(index);
  geometry.computeVertexNormals();
  group.add(new Mesh(geometry, metal(new Color().setRGB(2, 2, 2)))); // polished
  const cutting = new BufferGeometry();
  cutting.setAttribute('position', new BufferAttribute(Float32Array.from(edge.flat()), 3));
  group.add(new Line(cutting, new LineBasicMaterial({ color: '#ffffff' })));
  const top = rises ? height : Math.max(first[2], last[2]) + lift;
  const handle = rod(0.014 * size, top, 0.45 * size, metal(new Color('#a9b4bd')));
  const foot = rises ? first : mid(first, last);
  handle.position.x = foot[0];
  handle.position.y = foot[1];
  group.add(handle);
  return group;
}

/** The tools as rods with round ends; the reference point is the origin, the axis +z, a blade's way +x. */
function toolRods(session: SessionStart, size: number): Partial<Record<Mode, Rod[]>> {
  const along = (from: number, to: number, radius: number, x = 0, y = 0): Rod => ({ from: new Vector3(x, y, from), to: new Vector3(x, y, to), radius });
  const { tool, blade: knife } = session;
  const radius = tool?.radius ?? 0.02 * size;
  const shapes: Partial<Record<Mode, Rod[]>> = { grasper: [along(0, 3 * radius, 0.6 * radius), along(2.7 * radius, 0.5 * size, 0.6 * radius)] };
  if (tool?.shape === 'punch') shapes.probe = [along(tool.radius, tool.length, tool.radius)];
  else if (tool?.shape === 'sphere') shapes.probe = [along(radius, radius + 1e-4, radius), along(radius, 0.5 * size, 0.45 * radius)];
  else if (tool) shapes.probe = [along(radius, radius + 1e-4, radius), along(radius, tool.shaft_length, tool.shaft_radius)];
  const [first, last] = [knife?.edge[0], knife?.edge[knife.edge.length - 1]];
  if (first && last) {
    const thick = 0.004 * size;
    const rises = Math.abs(last[2] - first[2]) > 0.25 * distance(first, last);
    const [top, foot] = rises ? [Math.max(first[2], last[2]), first] : [Math.max(first[2], last[2]) + 0.5 * distance(first, last), mid(first, last)];
    shapes.blade = [
      { from: new Vector3(...first), to: new Vector3(...last), radius: thick },
      along(first[2], top, 2 * thick, foot[0], foot[1]),
      along(top, top + 0.45 * size, 0.014 * size, foot[0], foot[1]),
    ];
  }
  return shapes;
}

function distance(a: Vec3, b: Vec3): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

function mid(a: Vec3, b: Vec3): Vec3 {
  return [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])];
}

/** Unit vector across the flat of the blade. */
function sideways(edge: readonly Vec3[]): Vec3 {
  const first = new Vector3(...(edge[0] ?? [0, 0, 0]));
  const last = new Vector3(...(edge[edge.length - 1] ?? [1, 0, 0]));
  const across = last.sub(first).cross(up);
  if (across.lengthSq() === 0) across.set(0, 1, 0);
  across.normalize();
  return [across.x, across.y, across.z];
}

function dispose(object: Object3D): void {
  if (object instanceof Mesh || object instanceof Line) {
    (object.geometry as BufferGeometry).dispose();
    (object.material as Material).dispose();
  }
}
