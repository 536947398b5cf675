// The soft shadow of the tool on the organ, drawn over it as a part of the tool: an organ that stands still is not drawn
// again for a shadow that moves. The tool is taken for a few rods with round ends.
import { Box3, BufferAttribute, BufferGeometry, DynamicDrawUsage, FrontSide, Mesh, ShaderMaterial, Vector3, Vector4 } from 'three';

/** A rod with round ends; places in m. */
export interface Rod {
  from: Vector3;
  to: Vector3;
  radius: number; // m
}

export const mostRods = 3;
const softness = 0.14; // width of the half-shadow for each metre between tool and tissue
const reach = 0.05; // m, between a rod and what it shades at most
const darkness = 0.62;

const vertexShader = `
  varying vec3 at;
  varying vec3 facing;
  void main() {
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    at = position;
    facing = normal;
  }`;

// The ray from the tissue to the lamp passes a rod at a distance; how much of the lamp that leaves is the shadow.
const fragmentShader = `
  uniform vec3 lamp;
  uniform vec3 starts[RODS];
  uniform vec4 ways[RODS];
  varying vec3 at;
  varying vec3 facing;
  float hidden(vec3 a, vec4 way) {
    vec3 b = way.xyz;
    vec3 o = at - a;
    float ob = dot(o, b);
    float lb = dot(lamp, b);
    float bb = dot(b, b);
    float ol = dot(o, lamp);
    float far = max((lb * ob - ol * bb) / max(bb - lb * lb, 1e-9), 0.0);
    float part = clamp((ob + far * lb) / bb, 0.0, 1.0);
    far = max(dot(a + part * b - at, lamp), 0.0);
    float gap = length(at + far * lamp - a - part * b) - way.w;
    float width = 0.0012 + SOFTNESS * far;
    return (1.0 - smoothstep(-0.5 * width, width, gap)) * (1.0 - smoothstep(0.5 * REACH, REACH, far));
  }
  void main() {
    float shadow = 0.0;
    for (int i = 0; i < RODS; ++i) if (ways[i].w > 0.0) shadow = max(shadow, hidden(starts[i], ways[i]));
    shadow *= DARKNESS * smoothstep(-0.1, 0.25, dot(facing, lamp));
    gl_FragColor = vec4(0.012, 0.0, 0.002, shadow);
    #include <colorspace_fragment>
  }`;

export class ToolShadow {
  readonly mesh = new Mesh(
    new BufferGeometry(),
    new ShaderMaterial({
      uniforms: {
        lamp: { value: new Vector3(0, 0, 1) },
        starts: { value: Array.from({ length: mostRods }, () => new Vector3()) },
        ways: { value: Array.from({ length: mostRods }, () => new Vector4()) },
      },
      defines: { RODS: mostRods, SOFTNESS: softness.toFixed(3), REACH: reach.toFixed(3), DARKNESS: darkness.toFixed(3) },
      vertexShader,
      fragmentShader,
      side: FrontSide,
      transparent: true,
      depthWrite: false,
    }),
  );

  private copies = new Int32Array(0); // of the organ's vertices among those that are shaded

  constructor() {
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.mesh.renderOrder = 1;
  }

  /** Falls on the triangles that it can reach; `lamp` is a unit vector towards the lamp. */
  fall(rods: readonly Rod[], lamp: Vector3, positions: Float32Array, normals: Float32Array, triangles: Uint32Array): void {
    const picked = shadedTriangles(rods, lamp, positions, triangles);
    this.mesh.visible = picked.length > 0;
    if (!this.mesh.visible) return;
    const { geometry } = this.mesh;
    const { places, facing, index } = this.room(picked.length, positions.length / 3);
    const bounds = (geometry.boundingBox ??= new Box3()).makeEmpty();
    const point = new Vector3();
    this.copies.fill(-1);
    let count = 0;
    picked.forEach((vertex, i) => {
      if (this.copies[vertex]! < 0) {
        this.copies[vertex] = count;
        bounds.expandByPoint(point.fromArray(positions, 3 * vertex));
        places.setXYZ(count, point.x, point.y, point.z);
        facing.setXYZ(count, normals[3 * vertex]!, normals[3 * vertex + 1]!, normals[3 * vertex + 2]!);
        count += 1;
      }
      index.setX(i, this.copies[vertex]!);
    });
    geometry.setDrawRange(0, picked.length);
    for (const [attribute, size] of [[places, 3 * count], [facing, 3 * count], [index, picked.length]] as const) {
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, size);
      attribute.needsUpdate = true;
    }
    const { uniforms } = this.mesh.material;
    (uniforms['lamp']!.value as Vector3).copy(lamp);
    const starts = uniforms['starts']!.value as Vector3[];
    const ways = uniforms['ways']!.value as Vector4[];
    for (let i = 0; i < mostRods; ++i) {
      const rod = rods[i];
      ways[i]!.set(0, 0, 1, 0);
      if (!rod) continue;
      starts[i]!.copy(rod.from);
      ways[i]!.set(rod.to.x - rod.from.x, rod.to.y - rod.from.y, rod.to.z - rod.from.z, rod.radius);
    }
  }

  /** Buffers for so many corners of triangles: they are kept, for new ones cost more than what is in them. */
  private room(corners: number, vertices: number): { places: BufferAttribute; facing: BufferAttribute; index: BufferAttribute } {
    const { geometry } = this.mesh;
    if (this.copies.length !== vertices) this.copies = new Int32Array(vertices);
    if ((geometry.index?.count ?? 0) < corners) {
      geometry.dispose();
      const most = 2 ** Math.ceil(Math.log2(corners));
      const room = <T extends Float32Array | Uint16Array | Uint32Array>(array: T, size: number): BufferAttribute =>
        new BufferAttribute(array, size).setUsage(DynamicDrawUsage);
      for (const name of ['position', 'normal']) geometry.setAttribute(name, room(new Float32Array(3 * most), 3));
      geometry.setIndex(room(new Uint32Array(most), 1));
    }
    return {
      places: geometry.getAttribute('position') as BufferAttribute,
      facing: geometry.getAttribute('normal') as BufferAttribute,
      index: geometry.index!,
    };
  }

  hide(): void {
    this.mesh.visible = false;
  }
}

/** Vertices, three a triangle, of the triangles that turn to the lamp and that a rod's shadow can reach. */
export function shadedTriangles(rods: readonly Rod[], lamp: Vector3, positions: Float32Array, triangles: Uint32Array): number[] {
  const count = positions.length / 3;
  const near = new Uint8Array(count);
  const { x: lx, y: ly, z: lz } = lamp;
  for (const { from, to, radius } of rods) {
    // Seen along the light a rod is a line of the plane across it.
    const [bx, by, bz] = [to.x - from.x, to.y - from.y, to.z - from.z];
    const bl = bx * lx + by * ly + bz * lz;
    const [px, py, pz] = [bx - bl * lx, by - bl * ly, bz - bl * lz];
    const pp = Math.max(px * px + py * py + pz * pz, 1e-12);
    const { x: fx, y: fy, z: fz } = from;
    for (let v = 0; v < count; ++v) {
      const ox = positions[3 * v]! - fx;
      const oy = positions[3 * v + 1]! - fy;
      const oz = positions[3 * v + 2]! - fz;
      const part = Math.min(Math.max((ox * px + oy * py + oz * pz) / pp, 0), 1);
      const gx = part * bx - ox;
      const gy = part * by - oy;
      const gz = part * bz - oz;
      const far = gx * lx + gy * ly + gz * lz;
      if (far < -2 * radius - 0.004 || far > reach) continue;
      const most = radius + 0.003 + softness * Math.max(far, 0);
      if (gx * gx + gy * gy + gz * gz - far * far < most * most) near[v] = 1;
    }
  }
  const picked: number[] = [];
  for (let i = 0; i < triangles.length; i += 3) {
    const [a, b, c] = [triangles[i]!, triangles[i + 1]!, triangles[i + 2]!];
    if (near[a] || near[b] || near[c]) picked.push(a, b, c);
  }
  return picked;
}
