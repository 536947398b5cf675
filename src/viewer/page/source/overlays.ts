// What the method sees: nodes, their spheres, what a node sees across the cut, and slices through the level sets.
import {
  AdditiveBlending,
  BufferAttribute,
  BufferGeometry,
  Color,
  DataTexture,
  DoubleSide,
  Group,
  LineBasicMaterial,
  LineSegments,
  LinearFilter,
  Mesh,
  MeshBasicMaterial,
  NormalBlending,
  Points,
  RGBAFormat,
  ShaderMaterial,
  SphereGeometry,
  SRGBColorSpace,
  UnsignedByteType,
  Vector2,
} from 'three';
import { diverging, sequential } from './colours';
import type { Nodes, Slice, Support, Vec3 } from './protocol';
import type { Ray } from './stylus';

const kindColours = ['#7f93a3', '#62b6cb', '#b79be0', '#ffb454'].map((hex) => new Color(hex));
const seenColour = new Color('#79d18d');
const hiddenColour = new Color('#f0705e');

/** Discs or rings that face the camera, of a given radius in metres around each point. */
function discMaterial(ring: boolean): ShaderMaterial {
  return new ShaderMaterial({
    uniforms: { viewport: { value: new Vector2(1, 1) } },
    vertexShader: `
      attribute float radius; attribute vec3 tint;
      uniform vec2 viewport; varying vec3 colour; varying float pixels;
      void main() {
        vec4 eye = modelViewMatrix * vec4(position, 1.0);
        gl_Position = projectionMatrix * eye;
        pixels = radius * projectionMatrix[1][1] * viewport.y / gl_Position.w;
        gl_PointSize = max(pixels, 3.0);
        colour = tint;
      }`,
    fragmentShader: `
      varying vec3 colour; varying float pixels;
      void main() {
        vec2 at = 2.0 * gl_PointCoord - 1.0;
        float r = length(at);
        if (r > 1.0) discard;
        ${ring ? 'if (r < 1.0 - 3.0 / max(pixels, 6.0)) discard; gl_FragColor = vec4(colour, 0.25);' : 'gl_FragColor = vec4(colour * (1.0 - 0.45 * r * r), 1.0);'}
        #include <colorspace_fragment>
      }`,
    transparent: true,
    depthWrite: !ring,
    blending: ring ? AdditiveBlending : NormalBlending,
  });
}

/** Which of the two level sets a slice shows. */
export type SliceShows = 'organ' | 'cut';

/** The node under a ray that is nearest to the eye; -1: none is. */
export function nodeAlong(nodes: Nodes, ray: Ray): number {
  let best = -1;
  let least = Infinity;
  for (let i = 0; i < nodes.count; ++i) {
    const offset = [0, 1, 2].map((d) => (nodes.spheres[4 * i + d] ?? 0) - (ray.origin[d] ?? 0)) as Vec3;
    const along = offset.reduce((sum, value, d) => sum + value * (ray.direction[d] ?? 0), 0);
    const away = Math.sqrt(Math.max(offset.reduce((sum, value) => sum + value * value, 0) - along * along, 0));
    // Beside the ray counts more than behind other nodes.
    const cost = away + 0.1 * along;
    if (away < 0.02 * along && cost < least) {
      least = cost;
      best = i;
    }
  }
  return best;
}

export class Overlays {
  readonly group = new Group();
  private readonly discs = new Points(new BufferGeometry(), discMaterial(false));
  private readonly rings = new Points(new BufferGeometry(), discMaterial(true));
  private readonly links = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true }));
  private readonly bubble = new Mesh(
    new SphereGeometry(1, 32, 20),
    new MeshBasicMaterial({ color: '#62b6cb', transparent: true, opacity: 0.16, depthWrite: false }),
  );
  private readonly plane = new Mesh(new BufferGeometry(), new MeshBasicMaterial({ side: DoubleSide, transparent: true, opacity: 0.92 }));

  constructor() {
    for (const object of [this.plane, this.discs, this.rings, this.links, this.bubble]) {
      object.frustumCulled = false;
      object.visible = false;
      this.group.add(object);
    }
    this.discs.renderOrder = 1; // over the organ, which is transparent then
    this.rings.renderOrder = 2;
    this.bubble.renderOrder = 3;
  }

  setViewport(width: number, height: number): void {
    for (const points of [this.discs, this.rings]) {
      (points.material.uniforms['viewport']?.value as Vector2).set(width, height);
    }
  }

  /** Nodes, and lines from a picked one to what it sees and what the cut hides from it. */
  setNodes(nodes: Nodes | null, support: Support | null, showNodes: boolean, showSpheres: boolean): void {
    this.discs.visible = showNodes && nodes !== null;
    this.rings.visible = showSpheres && nodes !== null;
    this.links.visible = this.bubble.visible = support !== null && nodes !== null;
    if (!nodes || !(showNodes || showSpheres || support)) return;
    const place = new Float32Array(3 * nodes.count);
    const tint = new Float32Array(3 * nodes.count);
    const radii = new Float32Array(nodes.count);
    const seen = new Set(support?.seen ?? []);
    const hidden = new Set(support?.hidden ?? []);
    for (let i = 0; i < nodes.count; ++i) {
      place.set(nodes.spheres.subarray(4 * i, 4 * i + 3), 3 * i);
      radii[i] = nodes.spheres[4 * i + 3] ?? 0;
      const own = kindColours[nodes.kinds[i] ?? 0] ?? seenColour;
      const colour = hidden.has(i) ? hiddenColour : seen.has(i) ? seenColour : own;
      tint.set([colour.r, colour.g, colour.b], 3 * i);
    }
    const dot = radii.map((radius) => 0.05 * radius);
    const fill = (points: Points<BufferGeometry>, radius: Float32Array): void => {
      points.geometry.dispose();
      points.geometry = new BufferGeometry();
      points.geometry.setAttribute('position', new BufferAttribute(place, 3));
      points.geometry.setAttribute('tint', new BufferAttribute(tint, 3));
      points.geometry.setAttribute('radius', new BufferAttribute(radius, 1));
    };
    fill(this.discs, dot);
    fill(this.rings, radii);
    if (support) this.link(nodes, support);
  }

  private link(nodes: Nodes, support: Support): void {
    const [x = 0, y = 0, z = 0] = support.position;
    this.bubble.position.set(x, y, z);
    this.bubble.scale.setScalar(support.radius);
    const ends: number[] = [];
    const tint: number[] = [];
    for (const [list, colour] of [[support.seen, seenColour], [support.hidden, hiddenColour]] as const) {
      for (const node of list) {
        if (node >= nodes.count) continue;
        ends.push(x, y, z, nodes.spheres[4 * node] ?? 0, nodes.spheres[4 * node + 1] ?? 0, nodes.spheres[4 * node + 2] ?? 0);
        tint.push(colour.r, colour.g, colour.b, colour.r, colour.g, colour.b);
      }
    }
    this.links.geometry.dispose();
    this.links.geometry = new BufferGeometry();
    this.links.geometry.setAttribute('position', new BufferAttribute(Float32Array.from(ends), 3));
    this.links.geometry.setAttribute('color', new BufferAttribute(Float32Array.from(tint), 3));
  }

  /** A slice as a picture with lines of equal distance; returns the ends of its colours, m; null: no slice. */
  setSlice(slice: Slice | null, shows: SliceShows): [number, number] | null {
    this.plane.visible = slice !== null;
    if (!slice) return null;
    const { count } = slice;
    const values = shows === 'organ' ? slice.organ : slice.cut;
    const width = Math.hypot(slice.first[0] ?? 0, slice.first[1] ?? 0, slice.first[2] ?? 0);
    const reach = 0.3 * width;
    const step = niceStep(reach / 6);
    const line = width / count;
    const pixels = new Uint8Array(4 * count * count);
    for (let i = 0; i < count * count; ++i) {
      const value = values[i] ?? 0;
      const [r, g, b] = shows === 'organ' ? diverging(0.5 + (0.5 * value) / reach) : sequential(1 - value / reach);
      const nearest = step * Math.round(value / step);
      const onZero = Math.abs(value) < 0.6 * line;
      const dim = Math.abs(value - nearest) < 0.55 * line ? 0.72 : 1;
      pixels.set(onZero ? [255, 255, 255, 255] : [dim * r, dim * g, dim * b, 255], 4 * i);
    }
    const texture = new DataTexture(pixels, count, count, RGBAFormat, UnsignedByteType);
    texture.colorSpace = SRGBColorSpace;
    texture.magFilter = texture.minFilter = LinearFilter;
    texture.needsUpdate = true;
    this.plane.material.map?.dispose();
    const first = this.plane.material.map === null;
    this.plane.material.map = texture;
    if (first) this.plane.material.needsUpdate = true;
    const corner = (u: number, v: number): number[] =>
      [0, 1, 2].map((d) => (slice.origin[d] ?? 0) + u * (slice.first[d] ?? 0) + v * (slice.second[d] ?? 0));
    const geometry = new BufferGeometry();
    geometry.setAttribute(
      'position',
      new BufferAttribute(Float32Array.from([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].flat()), 3),
    );
    geometry.setAttribute('uv', new BufferAttribute(Float32Array.from([0, 0, 1, 0, 1, 1, 0, 1]), 2));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.plane.geometry.dispose();
    this.plane.geometry = geometry;
    return shows === 'organ' ? [-reach, reach] : [0, reach];
  }
}

/** 1, 2 or 5 times a power of ten, at least `least`. */
function niceStep(least: number): number {
  const decade = Math.pow(10, Math.floor(Math.log10(least)));
  return ([1, 2, 5, 10].find((step) => step * decade >= least) ?? 10) * decade;
}
