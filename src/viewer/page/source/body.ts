// The organ in the picture: its surface, the walls of the wound, lips and front, following the frames.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DynamicDrawUsage,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  type ShaderMaterial,
} from 'three';
import { linearTable, sequential } from './colours';
import { Part, type Scalars, type Topology, type Vec3 } from './protocol';
import { belowLips, castRay, frontEdges, frontFaces, type Hit, isSmooth, lipDistance, lipEdges, onLips, trianglesOf, vertexNormals } from './surface';
import { Lighting, tissueMaterial } from './tissue';

const surfaceColours = { dark: new Color('#4a1714'), light: new Color('#80302a'), deep: new Color('#5c0d0f') };
const wallColours = { dark: new Color('#6b1013'), light: new Color('#9c2023'), deep: new Color('#240305') };
const lipColour = new Color('#d8a684');
const frontColour = new Color('#d9a441');
const tableSize = 256;
const table = linearTable(sequential, tableSize);

/** One of the two shaded parts: shares positions with the other, has normals of its own. */
interface Skin {
  mesh: Mesh<BufferGeometry, ShaderMaterial>;
  triangles: Uint32Array;
  drawn: BufferAttribute; // those of them that are drawn, in front of the geometry's index
  normals: BufferAttribute;
}

/** A copy of the surface that rays can be cast at while the shown one moves. */
export interface Snapshot {
  positions: Float32Array;
  triangles: Uint32Array;
  normals: Float32Array;
}

export class Body {
  readonly group = new Group();
  readonly lighting = new Lighting();
  topology: Topology | null = null;
  // They outlive a surface: with the last material of its kind the program that draws it goes, and making it anew takes long.
  private readonly organMaterial = tissueMaterial(this.lighting, surfaceColours, false);
  private readonly wallMaterial = tissueMaterial(this.lighting, wallColours, true);
  private readonly lipMaterial = new LineBasicMaterial({ color: lipColour });
  private readonly frontMaterial = new LineBasicMaterial({ color: frontColour });
  private positions: BufferAttribute | null = null;
  private colours: BufferAttribute | null = null;
  private organ: Skin | null = null;
  private wall: Skin | null = null;
  transparent = false; // as it is drawn
  coloured = false; // by values
  smooth = false; // the surface has no edges: normals between its corners tell where its outline is
  private epoch = -1; // of the surface
  private wireframe = false;

  /** Another surface; it is at rest until the first vertices come. */
  setTopology(topology: Topology): void {
    this.clear();
    this.topology = topology;
    const positions = new BufferAttribute(topology.rest.slice(), 3);
    positions.setUsage(DynamicDrawUsage);
    const colours = new BufferAttribute(new Float32Array(3 * topology.vertexCount), 3);
    colours.setUsage(DynamicDrawUsage);
    this.positions = positions;
    this.colours = colours;
    const rest = new BufferAttribute(topology.rest, 3);
    const tone = new BufferAttribute(this.lighting.blotches(topology.rest), 1);
    const skin = (triangles: Uint32Array, rim: Float32Array, material: ShaderMaterial): Skin => {
      const geometry = new BufferGeometry();
      const normals = new BufferAttribute(new Float32Array(3 * topology.vertexCount), 3);
      normals.setUsage(DynamicDrawUsage);
      geometry.setAttribute('position', positions);
      geometry.setAttribute('normal', normals);
      geometry.setAttribute('color', colours);
      geometry.setAttribute('rest', rest);
      geometry.setAttribute('tone', tone);
      geometry.setAttribute('rim', new BufferAttribute(rim, 1));
      const drawn = new BufferAttribute(triangles.slice(), 1);
      drawn.setUsage(DynamicDrawUsage);
      geometry.setIndex(drawn);
      const mesh = new Mesh(geometry, material);
      mesh.frustumCulled = false;
      this.group.add(mesh);
      return { mesh, triangles, drawn, normals };
    };
    const walls = trianglesOf(topology, (part) => part !== Part.organ);
    this.organ = skin(trianglesOf(topology, (part) => part === Part.organ), onLips(topology), this.organMaterial);
    this.wall = skin(walls, belowLips(topology, walls), this.wallMaterial);
    const lines = (edges: Uint32Array, material: LineBasicMaterial): void => {
      const geometry = new BufferGeometry();
      geometry.setAttribute('position', positions);
      geometry.setIndex(new BufferAttribute(edges, 1));
      const segments = new LineSegments(geometry, material);
      segments.frustumCulled = false;
      segments.visible = edges.length > 0;
      this.group.add(segments);
    };
    lines(lipEdges(topology), this.lipMaterial);
    lines(frontEdges(topology), this.frontMaterial);
    this.setLook(this.transparent, this.wireframe);
    this.moved();
    if (topology.epoch === this.epoch) return;
    this.epoch = topology.epoch;
    this.smooth = isSmooth(topology.rest, this.organ.triangles, this.organ.normals.array as Float32Array);
  }

  /** False: they are where they were. A tool that hovers is solved for too. */
  setVertices(vertices: Float32Array): boolean {
    const positions = this.positions?.array;
    if (!positions || positions.length !== vertices.length || vertices.every((x, i) => x === positions[i])) return false;
    positions.set(vertices);
    this.moved();
    return true;
  }

  /** Colours by value between `low` and `high`; null: the tissue's own. */
  setScalars(scalars: Scalars | null, low: number, high: number): void {
    if (!this.colours || !this.organ || !this.wall) return;
    const coloured = (this.coloured = scalars !== null && scalars.values.length === this.colours.count);
    if (scalars && coloured) {
      const span = high > low ? (tableSize - 1) / (high - low) : 0;
      const target = this.colours.array as Float32Array;
      for (let i = 0; i < scalars.values.length; ++i) {
        const value = scalars.values[i] ?? 0;
        const entry = 3 * Math.min(Math.max(Math.round((value - low) * span), 0), tableSize - 1);
        target[3 * i] = table[entry] ?? 0;
        target[3 * i + 1] = table[entry + 1] ?? 0;
        target[3 * i + 2] = table[entry + 2] ?? 0;
      }
      this.colours.needsUpdate = true;
    }
    for (const { mesh } of [this.organ, this.wall]) {
      if (mesh.material.vertexColors !== coloured) mesh.material.needsUpdate = true;
      mesh.material.vertexColors = coloured;
    }
  }

  /** `transparent`: what lies inside shows through. */
  setLook(transparent: boolean, wireframe: boolean): void {
    this.transparent = transparent;
    this.wireframe = wireframe;
    for (const skin of [this.organ, this.wall]) {
      if (!skin) continue;
      const material = skin.mesh.material;
      material.transparent = transparent;
      material.uniforms['opacity']!.value = transparent ? 0.45 : 1;
      material.depthWrite = !transparent;
      material.wireframe = wireframe;
      material.needsUpdate = true;
    }
  }

  /**
   * Leaves out of the next picture what turns its back to `eye`. Where the processor draws, triangles cost what a picture
   * costs, seen or not, and pixels hardly anything.
   */
  leaveOutBacks(eye: Vec3): void {
    for (const skin of [this.organ, this.wall]) {
      if (!skin || !this.positions || skin.triangles.length === 0) continue;
      const drawn = skin.drawn.array as Uint32Array;
      let count = skin.triangles.length;
      if (this.transparent || this.wireframe) drawn.set(skin.triangles);
      else count = frontFaces(this.positions.array as Float32Array, skin.triangles, eye, drawn);
      skin.mesh.geometry.setDrawRange(0, count);
      skin.drawn.needsUpdate = true;
    }
  }

  /** The organ's own surface, as it is now; not to be kept. */
  surface(): Snapshot | null {
    if (!this.positions || !this.organ) return null;
    return {
      positions: this.positions.array as Float32Array,
      triangles: this.organ.triangles,
      normals: this.organ.normals.array as Float32Array,
    };
  }

  /** What rays can be cast at, as it is now. */
  snapshot(): Snapshot | null {
    if (!this.positions || !this.organ) return null;
    return {
      positions: (this.positions.array as Float32Array).slice(),
      triangles: this.organ.triangles,
      normals: (this.organ.normals.array as Float32Array).slice(),
    };
  }

  /** Nearest point of the organ's own surface on a ray. */
  cast(origin: Vec3, direction: Vec3): Hit | null {
    if (!this.positions || !this.organ) return null;
    return castRay(
      this.positions.array as Float32Array,
      this.organ.triangles,
      this.organ.normals.array as Float32Array,
      origin,
      direction,
    );
  }

  /** Largest distance between the two sides of the cut, m. */
  lipsApart(): number {
    return this.topology && this.positions ? lipDistance(this.topology, this.positions.array as Float32Array) : 0;
  }

  private moved(): void {
    if (!this.positions || !this.organ || !this.wall) return;
    this.positions.needsUpdate = true;
    for (const skin of [this.organ, this.wall]) {
      if (skin.triangles.length === 0) continue;
      vertexNormals(this.positions.array as Float32Array, skin.triangles, skin.normals.array as Float32Array);
      skin.normals.needsUpdate = true;
    }
  }

  private clear(): void {
    for (const child of [...this.group.children]) {
      this.group.remove(child);
      if (child instanceof Mesh || child instanceof LineSegments) (child.geometry as BufferGeometry).dispose();
    }
  }
}
