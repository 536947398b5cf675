// Where the blade would cut if it went straight on: the line in which its plane meets the surface ahead of it, in the
// colour of a surgical marker. Geometry alone; the tissue will move before the blade comes there.
import { BufferAttribute, BufferGeometry, Color, DoubleSide, Mesh, MeshBasicMaterial, Quaternion as Turn, Vector3 } from 'three';
import type { Quaternion, Vec3 } from './protocol';

const marker = new Color('#4a3fc0');
const far = 0.06; // m ahead of the blade
const dash = 0.005; // m from dash to dash, three fifths of it drawn

/** Pieces of the line, m: places and normals of both ends and their ways ahead of the tip. */
export interface Piece {
  from: Vec3;
  to: Vec3;
  normal: Vec3;
}

/** The line on the triangles that turn to the blade's back, cut into dashes. `orientation`: x is the blade's way, z away from the tissue. */
export function planned(tip: Vec3, orientation: Quaternion, positions: Float32Array, triangles: Uint32Array): Piece[] {
  const turn = new Turn(...orientation);
  const [ahead, across, out] = [new Vector3(1, 0, 0), new Vector3(0, 1, 0), new Vector3(0, 0, 1)].map((axis) => axis.applyQuaternion(turn));
  const vertex = (v: number): Vector3 => new Vector3(positions[3 * v]! - tip[0], positions[3 * v + 1]! - tip[1], positions[3 * v + 2]! - tip[2]);
  const pieces: Piece[] = [];
  const side = (v: number): number =>
    (positions[3 * v]! - tip[0]) * across!.x + (positions[3 * v + 1]! - tip[1]) * across!.y + (positions[3 * v + 2]! - tip[2]) * across!.z;
  for (let i = 0; i < triangles.length; i += 3) {
    const heights = [side(triangles[i]!), side(triangles[i + 1]!), side(triangles[i + 2]!)];
    if (heights.every((h) => h > 0) || heights.every((h) => h <= 0)) continue;
    const corners = [0, 1, 2].map((k) => vertex(triangles[i + k]!));
    const normal = corners[1]!.clone().sub(corners[0]!).cross(corners[2]!.clone().sub(corners[0]!)).normalize();
    if (normal.dot(out!) < 0.1) continue;
    const ends: Vector3[] = [];
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [heights[k]!, heights[(k + 1) % 3]!];
      if (a > 0 !== b > 0) ends.push(corners[k]!.clone().lerp(corners[(k + 1) % 3]!, a / (a - b)));
    }
    let [from, to] = ends as [Vector3, Vector3];
    if (from.dot(ahead!) > to.dot(ahead!)) [from, to] = [to, from];
    const [begin, end] = [from.dot(ahead!), to.dot(ahead!)];
    if (end <= begin || Math.abs(from.dot(out!)) > far) continue;
    for (let k = Math.floor(Math.max(begin, 0) / dash); k * dash < Math.min(end, far); ++k) {
      const [low, high] = [Math.max(begin, 0, k * dash), Math.min(end, far, (k + 0.6) * dash)];
      if (high <= low) continue;
      const place = (s: number): Vec3 => {
        const at = from.clone().lerp(to, (s - begin) / (end - begin));
        return [at.x + tip[0], at.y + tip[1], at.z + tip[2]];
      };
      pieces.push({ from: place(low), to: place(high), normal: normal.toArray() as Vec3 });
    }
  }
  return pieces;
}

export class Plan {
  readonly mesh = new Mesh(
    new BufferGeometry(),
    new MeshBasicMaterial({ color: marker, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2 }),
  );
  private width = 0.001; // m

  constructor() {
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
  }

  /** `size` of the organ in m. */
  setSize(size: number): void {
    this.width = 0.005 * size;
    this.hide();
  }

  hide(): void {
    this.mesh.visible = false;
  }

  show(pieces: readonly Piece[]): void {
    this.mesh.visible = pieces.length > 0;
    const corners: number[] = [];
    const index: number[] = [];
    for (const { from, to, normal } of pieces) {
      const n = new Vector3(...normal);
      const [a, b] = [new Vector3(...from), new Vector3(...to)];
      const side = n.clone().cross(b.clone().sub(a)).setLength(0.5 * this.width);
      const first = corners.length / 3;
      for (const end of [a, b]) {
        end.addScaledVector(n, 0.15 * this.width);
        corners.push(...end.clone().add(side).toArray(), ...end.clone().sub(side).toArray());
      }
      index.push(first, first + 1, first + 2, first + 1, first + 3, first + 2);
    }
    this.mesh.geometry.dispose();
    this.mesh.geometry = new BufferGeometry();
    this.mesh.geometry.setAttribute('position', new BufferAttribute(Float32Array.from(corners), 3));
    this.mesh.geometry.setIndex(index);
  }
}
