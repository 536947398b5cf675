// How steel looks: the room in a mirror, as a small picture by the direction that the surface turns to the eye.
import { Color, DataTexture, DoubleSide, LinearFilter, ShaderMaterial, SRGBColorSpace } from 'three';

const size = 64; // px

/** A lamp above on the left, a bright window on the left and a dark wall on the right, the drape below. */
function mirrored(): DataTexture {
  const bytes = new Uint8Array(4 * size * size);
  const soft = (x: number, from: number, to: number): number => {
    const t = Math.min(Math.max((x - from) / (to - from), 0), 1);
    return t * t * (3 - 2 * t);
  };
  for (let row = 0, i = 0; row < size; ++row) {
    for (let column = 0; column < size; ++column, i += 4) {
      const [x, y] = [(2 * (column + 0.5)) / size - 1, (2 * (row + 0.5)) / size - 1];
      const z = Math.sqrt(Math.max(1 - x * x - y * y, 0));
      const lamp = soft(-0.5 * x + 0.45 * y + 0.74 * z, 0.8, 0.985);
      const window = soft(-x, 0.08, 0.42) * (1 - soft(-x, 0.5, 0.85));
      const wall = soft(x, 0, 0.45) * (1 - soft(x, 0.6, 0.95));
      const light = 0.5 + 0.14 * y + 0.26 * window - 0.19 * wall + 0.4 * lamp - 0.12 * soft(-x, 0.8, 1);
      const grey = 255 * Math.min(light, 0.955);
      bytes.set([0.96 * grey, 0.985 * grey, Math.min(grey + 6, 249), 255].map(Math.round), i);
    }
  }
  const texture = new DataTexture(bytes, size, size); // what the screen is told
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

const vertexShader = `
  varying vec3 facing;
  void main() {
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    facing = normalMatrix * normal;
  }`;
const fragmentShader = `
  uniform sampler2D room;
  uniform vec3 colour;
  varying vec3 facing;
  void main() {
    vec2 turned = normalize(facing).xy;
    gl_FragColor = vec4(texture2D(room, 0.5 + (gl_FrontFacing ? 0.49 : -0.49) * turned).rgb * colour, 1.0);
  }`;

let room: DataTexture | null = null;

/** Steel, or another metal of this colour. */
export function metal(colour = new Color('#ffffff')): ShaderMaterial {
  room ??= mirrored();
  const { r, g, b } = colour.getRGB(new Color(), SRGBColorSpace);
  return new ShaderMaterial({
    uniforms: { room: { value: room }, colour: { value: new Color().setRGB(r, g, b) } },
    vertexShader,
    fragmentShader,
    side: DoubleSide,
    polygonOffset: true, // the line of a blade's edge lies before it
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
}
