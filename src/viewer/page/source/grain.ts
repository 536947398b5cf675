// The grain of tissue as a texture of space: lobules and blotches that do not depend on the triangles. Made here, so that
// nothing has to be shipped; a cut goes through it as through the organ.
import { Data3DTexture, LinearFilter, RepeatWrapping, RGBAFormat, UnsignedByteType } from 'three';

/** Numbers in [0, 1) from a seed: the organ looks the same every time (mulberry32). */
function numbers(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** Adds smooth noise that repeats after `count` samples, `cells` of them across, times `weight`. */
function addNoise(field: Float32Array, count: number, cells: number, weight: number, next: () => number): void {
  const lattice = Float32Array.from({ length: cells ** 3 }, () => 2 * next() - 1);
  const low = new Int32Array(count);
  const high = new Int32Array(count);
  const part = new Float32Array(count);
  for (let i = 0; i < count; ++i) {
    const at = (i * cells) / count;
    low[i] = Math.floor(at);
    high[i] = (low[i]! + 1) % cells;
    const f = at - low[i]!;
    part[i] = f * f * (3 - 2 * f);
  }
  const at = (x: number, y: number, z: number): number => lattice[(z * cells + y) * cells + x]!;
  const mix = (a: number, b: number, f: number): number => a + f * (b - a);
  for (let z = 0, i = 0; z < count; ++z) {
    for (let y = 0; y < count; ++y) {
      for (let x = 0; x < count; ++x, ++i) {
        const plane = (k: number): number =>
          mix(
            mix(at(low[x]!, low[y]!, k), at(high[x]!, low[y]!, k), part[x]!),
            mix(at(low[x]!, high[y]!, k), at(high[x]!, high[y]!, k), part[x]!),
            part[y]!,
          );
        field[i]! += weight * mix(plane(low[z]!), plane(high[z]!), part[z]!);
      }
    }
  }
}

/** A height of mean 0 over a cube of `count` samples a side, which repeats. */
export function grainField(count: number): Float32Array {
  const field = new Float32Array(count ** 3);
  const next = numbers(7);
  for (const [cells, weight] of [[count / 8, 0.5], [count / 4, 0.35], [count / 2, 0.15]] as const) addNoise(field, count, cells, weight, next);
  const mean = field.reduce((sum, height) => sum + height, 0) / field.length;
  return field.map((height) => height - mean);
}

/** Light and dark of the grain at `places` (x, y, z of each, m), coarser than vertices are apart; about 0.5. */
export function blotches(field: Float32Array, count: number, places: Float32Array): Float32Array {
  const most = count - 1;
  const tone = new Float32Array(places.length / 3).fill(0.5);
  for (const [scale, weight] of [[5, 0.45], [17, 0.25]] as const) {
    for (let v = 0; v < tone.length; ++v) {
      const x = places[3 * v]! * scale * count;
      const y = places[3 * v + 1]! * scale * count;
      const z = places[3 * v + 2]! * scale * count;
      const [i, j, k] = [Math.floor(x), Math.floor(y), Math.floor(z)];
      const [fx, fy, fz] = [x - i, y - j, z - k];
      let sum = 0;
      for (let corner = 0; corner < 8; ++corner) {
        const [a, b, c] = [corner & 1, (corner >> 1) & 1, corner >> 2];
        const part = (a ? fx : 1 - fx) * (b ? fy : 1 - fy) * (c ? fz : 1 - fz);
        sum += part * field[((((k + c) & most) * count + ((j + b) & most)) * count) + ((i + a) & most)]!;
      }
      tone[v]! += weight * sum;
    }
  }
  return tone;
}

/** Red, green and blue: slope of a height along x, y, z; alpha: the height; each 0.5 at zero. */
export function grainTexture(field: Float32Array, count: number): Data3DTexture {
  const bytes = new Uint8Array(4 * field.length);
  const at = (x: number, y: number, z: number): number => field[((z & (count - 1)) * count + (y & (count - 1))) * count + (x & (count - 1))]!;
  const byte = (value: number): number => Math.min(Math.max(Math.round(127.5 + 127.5 * value), 0), 255);
  for (let z = 0, i = 0; z < count; ++z) {
    for (let y = 0; y < count; ++y) {
      for (let x = 0; x < count; ++x, i += 4) {
        bytes[i] = byte(at(x + 1, y, z) - at(x - 1, y, z));
        bytes[i + 1] = byte(at(x, y + 1, z) - at(x, y - 1, z));
        bytes[i + 2] = byte(at(x, y, z + 1) - at(x, y, z - 1));
        bytes[i + 3] = byte(at(x, y, z));
      }
    }
  }
  const texture = new Data3DTexture(bytes, count, count, count);
  texture.format = RGBAFormat;
  texture.type = UnsignedByteType;
  texture.wrapS = texture.wrapT = texture.wrapR = RepeatWrapping;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
