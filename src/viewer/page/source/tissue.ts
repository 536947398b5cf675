// How tissue looks: an organ's moist surface and the walls of a wound, under one lamp. Two shadings: the fine one adds the
// grain in every pixel and the highlights that it breaks; the plain one has what vertices know, for slow pictures.
import { Color, FrontSide, ShaderMaterial, type Texture, Vector3 } from 'three';
import { blotches, grainField, grainTexture } from './grain';

const samples = 32; // of the grain a side

/** What all tissue of a picture has in common; directions in the room's frame. */
export class Lighting {
  readonly lamp = { value: new Vector3(0, 0, 1) }; // unit, towards the lamp
  readonly fine = { value: 1 }; // 1: the grain in every pixel; 0: not
  readonly outline = { value: 0 }; // 1: outlines are smoothed, which takes a surface without edges
  readonly grain: { value: Texture };
  private readonly field = grainField(samples);

  constructor() {
    this.grain = { value: grainTexture(this.field, samples) };
  }

  /** Light and dark of vertices that are at `rest` without a load. */
  blotches(rest: Float32Array): Float32Array {
    return blotches(this.field, samples, rest);
  }
}

// Organs stand in the room without a transformation: normals and places are the room's.
const vertexShader = `
  attribute vec3 rest;
  attribute float rim;
  attribute float tone;
  varying vec3 at;
  varying vec3 facing;
  varying vec3 towards;
  varying float edge;
  varying float blotch;
  #ifdef USE_COLOR
  varying vec3 tint;
  #endif
  void main() {
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    towards = cameraPosition - position;
    facing = normal;
    at = rest * GRAIN;
    edge = rim;
    blotch = tone;
    #ifdef USE_COLOR
    tint = color;
    #endif
  }`;

// Powers are multiplied out: where the processor draws, pow() costs more.
const fragmentShader = `
  precision highp sampler3D;
  uniform sampler3D grain;
  uniform vec3 lamp;
  uniform float fine;
  uniform float outline;
  uniform float opacity;
  uniform vec3 dark;
  uniform vec3 light;
  uniform vec3 deep;
  varying vec3 at;
  varying vec3 facing;
  varying vec3 towards;
  varying float edge;
  varying float blotch;
  #ifdef USE_COLOR
  varying vec3 tint;
  #endif
  void main() {
    vec3 v = normalize(towards);
    vec3 h = normalize(lamp + v);
    #ifdef USE_COLOR
    vec3 n = normalize(facing);
    float lit = 0.42 + 0.62 * max(dot(n, lamp), 0.0);
    gl_FragColor = vec4(tint * lit + 0.05 * pow(max(dot(n, h), 0.0), 24.0), opacity);
    #include <colorspace_fragment>
    #else
    float tone = blotch;
    vec3 n = facing;
    if (fine > 0.5) {
      vec4 g = textureLod(grain, at, 0.0) - 0.498;
      tone += 0.9 * g.a;
      n -= BUMP * g.xyz;
    }
    n = normalize(n);
    vec3 own = mix(dark, light, clamp(tone, 0.0, 1.0));
    #ifdef WALL
    // Light comes in through the mouth alone.
    float open = 1.0 / (1.0 + edge * edge * 40000.0);
    own = mix(deep, own, open);
    #else
    own = mix(own, deep, 0.5 * edge * edge);
    const float open = 1.0;
    #endif
    // Light goes on a little under the surface, red longer than the rest.
    vec3 colour = own * (clamp(dot(n, lamp) * vec3(1.2, 1.4, 1.4) + vec3(0.42, 0.20, 0.18), 0.0, 2.0) + (0.16 + 0.10 * n.z));
    float away = 1.0 - max(dot(n, v), 0.0);
    float away2 = away * away;
    float s = max(dot(n, h), 0.0);
    s *= s; s *= s; s *= s; s *= s; // 16
    float sheen = s;
    s *= s; s *= s; // 64
    float wet = s * s * s * s; // 256
    // What is reflected of the lamp, and at the rim of the room: bright above.
    colour += open * (0.055 * sheen + 0.09 * s + GLOSS * wet + away2 * away2 * RIM * (0.3 + max(n.z, 0.0)) * vec3(0.9, 0.95, 1.0));
    gl_FragColor = vec4(sqrt(colour), opacity); // nearly sRGB, at a third of its cost
    #endif
    #ifndef WALL
    // At the outline the last pixel lets the drape through: a smooth edge for the price of a derivative.
    if (outline > 0.5 && opacity == 1.0) {
      float turned = dot(normalize(facing), v);
      gl_FragColor *= clamp(turned / max(1.5 * fwidth(turned), 1e-4), 0.0, 1.0);
    }
    #endif
  }`;

export interface Colours {
  dark: Color;
  light: Color;
  deep: Color; // of a surface: beside the lips of a wound; of a wall: far below them
}

/** Material of an organ's surface, or of the walls of a wound. */
export function tissueMaterial(lighting: Lighting, colours: Colours, wall: boolean): ShaderMaterial {
  return new ShaderMaterial({
    uniforms: {
      lamp: lighting.lamp,
      fine: lighting.fine,
      outline: lighting.outline,
      grain: lighting.grain,
      opacity: { value: 1 },
      dark: { value: colours.dark },
      light: { value: colours.light },
      deep: { value: colours.deep },
    },
    defines: { GRAIN: '48.0', BUMP: wall ? '1.4' : '0.5', GLOSS: wall ? '0.8' : '0.65', RIM: wall ? '0.02' : '0.13', ...(wall ? { WALL: 1 } : {}) },
    vertexShader,
    fragmentShader,
    side: FrontSide,
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
}
