// Where the blade's edge has gone through the surface since the body that is shown was solved: a dark band on the surface,
// ahead of the wound. Geometry of the tool alone; lips and opening come with the solve.
import { BufferAttribute, BufferGeometry, Color, DoubleSide, Mesh, MeshBasicMaterial, Quaternion as Turn, Vector3 } from 'three';
import type { Quaternion, Vec3 } from './protocol';
import type { Hit } from './surface';

interface Place {
  point: Vector3;
  normal: Vector3;
  pose: number; // number of the hand's pose that the tool was at
  begins: boolean; // nothing leads here from the place before
}

const most = 400; // places
const jump = 0.02; // m, between two places of one stroke at most

/** Where the edge goes into the surface, from its end to its tip; null: it does not. `edge` is in the blade's frame. */
export function crossing(
  edge: readonly Vec3[],
  tip: Vec3,
  orientation: Quaternion,
  cast: (origin: Vec3, direction: Vec3) => Hit | null,
): Hit | null {
  const turn = new Turn(...orientation);
  const places = edge.map((point) => new Vector3(...point).applyQuaternion(turn).add(new Vector3(...tip)));
  for (let i = places.length - 1; i > 0; --i) {
    const from = places[i]!;
    const way = places[i - 1]!.clone().sub(from);
    const length = way.length();
    if (length === 0) continue;
    const hit = cast(from.toArray() as Vec3, way.divideScalar(length).toArray() as Vec3);
    if (hit && hit.distance <= length) return hit;
  }
  return null;
}

export class Trace {
  readonly mesh = new Mesh(
    new BufferGeometry(),
    new MeshBasicMaterial({ color: new Color('#4a0b10'), side: DoubleSide, polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -1 }),
  );
  private places: Place[] = [];
  private away = true; // the edge is not in the surface
  private width = 0.001; // m

  constructor() {
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
  }

  /** Forgets everything; `size` of the organ in m. */
  clear(size?: number): void {
    if (size !== undefined) this.width = 0.007 * size;
    this.places = [];
    this.away = true;
    this.build();
  }

  /** Where the edge is in the surface with pose `pose`; null: nowhere. The body that is shown was solved for pose `solved`. */
  note(hit: Hit | null, pose: number, solved: number): void {
    const before = this.places[this.places.length - 1];
    if (hit) {
      const point = new Vector3(...hit.point);
      const gap = before ? before.point.distanceTo(point) : Infinity;
      if (this.away || gap > 0.0003) {
        this.places.push({ point, normal: new Vector3(...hit.normal), pose, begins: this.away || gap > jump });
      } else if (before) before.pose = pose;
    }
    this.away = hit === null;
    // The wound begins where the last solve has been.
    let keep = this.places.findIndex((place) => place.pose > solved);
    keep = keep < 0 ? Math.max(this.places.length - 1, 0) : Math.max(keep - 1, 0);
    this.places.splice(0, Math.max(keep, this.places.length - most));
    this.build();
  }

  /** Length of the band, m. */
  get length(): number {
    let sum = 0;
    for (let i = 1; i < this.places.length; ++i) {
      const [a, b] = [this.places[i - 1]!, this.places[i]!];
      if (!b.begins) sum += a.point.distanceTo(b.point);
    }
    return sum;
  }

  private build(): void {
    const corners: number[] = [];
    const index: number[] = [];
    for (let i = 1; i < this.places.length; ++i) {
      const [a, b] = [this.places[i - 1]!, this.places[i]!];
      if (b.begins) continue;
      const along = b.point.clone().sub(a.point);
      const first = corners.length / 3;
      for (const { point, normal } of [a, b]) {
        const side = normal.clone().cross(along).setLength(0.5 * this.width);
        const raised = point.clone().addScaledVector(normal, 0.2 * this.width);
        corners.push(...raised.clone().add(side).toArray(), ...raised.sub(side).toArray());
      }
      index.push(first, first + 1, first + 2, first + 1, first + 3, first + 2);
    }
    this.mesh.visible = index.length > 0;
    this.mesh.geometry.dispose();
    this.mesh.geometry = new BufferGeometry();
    this.mesh.geometry.setAttribute('position', new BufferAttribute(Float32Array.from(corners), 3));
    this.mesh.geometry.setIndex(index);
  }
}
