// The camera: turns about a point, z up.
import { PerspectiveCamera, Vector3 } from 'three';
import type { Vec3 } from './protocol';

export class Orbit {
  readonly camera = new PerspectiveCamera(32, 1, 0.01, 10);
  private readonly target = new Vector3();
  private azimuth = 0; // rad about z, 0: from -y
  private elevation = 0.6; // rad above the xy plane
  private distance = 1; // m
  private start = { target: new Vector3(), distance: 1 };

  constructor() {
    this.camera.up.set(0, 0, 1);
  }

  /** Looks at a box from the front and above. */
  frameBox(lower: Vec3, upper: Vec3): void {
    const low = new Vector3(...lower);
    const high = new Vector3(...upper);
    this.start.target.copy(low).add(high).multiplyScalar(0.5);
    this.start.distance = low.distanceTo(high) * 1.4;
    this.home();
  }

  home(): void {
    this.target.copy(this.start.target);
    this.azimuth = -0.35;
    this.elevation = 0.95;
    const narrow = Math.min(1, this.camera.aspect / 1.1);
    this.distance = this.start.distance / narrow;
    this.place();
    this.pan(0, 0.045); // the chart lies over the foot of the picture
  }

  /** By angles in radians. */
  turn(right: number, up: number): void {
    this.azimuth -= right;
    this.elevation = Math.min(Math.max(this.elevation + up, -1.55), 1.55);
    this.place();
  }

  /** By fractions of the height of the view. */
  pan(right: number, up: number): void {
    const height = 2 * this.distance * Math.tan((this.camera.fov * Math.PI) / 360);
    const across = new Vector3().setFromMatrixColumn(this.camera.matrix, 0);
    const upward = new Vector3().setFromMatrixColumn(this.camera.matrix, 1);
    this.target.addScaledVector(across, -right * height).addScaledVector(upward, -up * height);
    this.place();
  }

  /** Above 1: nearer. */
  zoom(factor: number): void {
    const whole = this.start.distance;
    this.distance = Math.min(Math.max(this.distance / factor, 0.05 * whole), 6 * whole);
    this.place();
  }

  resize(width: number, height: number): void {
    const before = this.camera.aspect;
    this.camera.aspect = width / Math.max(height, 1);
    const narrow = (aspect: number): number => Math.min(1, aspect / 1.1);
    this.distance *= narrow(before) / narrow(this.camera.aspect);
    this.place();
  }

  private place(): void {
    const flat = Math.cos(this.elevation);
    this.camera.position.set(
      this.target.x + this.distance * flat * Math.sin(this.azimuth),
      this.target.y - this.distance * flat * Math.cos(this.azimuth),
      this.target.z + this.distance * Math.sin(this.elevation),
    );
    this.camera.near = this.distance / 50;
    this.camera.far = this.distance * 8;
    this.camera.lookAt(this.target);
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }
}
