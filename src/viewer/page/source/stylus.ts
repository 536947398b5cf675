// What the hand does: hovers over the surface where the pointer is, goes in while pressing, follows the way that was
// drawn no faster than tissue is worked, withdraws. Gives poses of the hand; the server ties the tool to it.
import { Matrix4, Quaternion as Turn, Vector3 } from 'three';
import type { ClientText, Mode, Quaternion, SessionStart, Vec3 } from './protocol';
import type { Hit } from './surface';

/** A ray of the picture, direction of unit length. */
export interface Ray {
  origin: Vec3;
  direction: Vec3;
}

/** The surface under a ray, now or as it was when the press began. */
export interface Target {
  cast(ray: Ray): Hit | null;
  freeze(): void;
  thaw(): void;
}

interface Place {
  point: Vector3;
  normal: Vector3;
}

type Stage = 'hovering' | 'pressing' | 'withdrawing';

const clearance: Record<Mode, number> = { probe: 0.004, blade: 0.006, grasper: 0.004 }; // m above the surface
const workSpeed: Record<Mode, number> = { probe: 0.12, blade: 0.05, grasper: 0.12 }; // m/s along the surface
const hoverSpeed = 0.45; // m/s
const plungeSpeed = 0.03; // m/s
const withdrawSpeed = 0.12; // m/s
const gripDepth = 0.001; // m, at which the jaws close
const settling = 2e-5; // m, by which the hand goes on until they have: every motion is solved for

export class Stylus {
  mode: Mode = 'probe';
  /** To which depth a press goes, m; negative with the grasper: it pulls out. */
  readonly depths: Record<Mode, number> = { probe: 0.006, blade: 0.008, grasper: -0.006 };
  /** Holds the tool: only then are poses sent. */
  holding = false;
  private stage: Stage = 'hovering';
  private place: Place | null = null; // of the hand on the surface
  private aim: Place | null = null; // where the pointer is on the surface
  private way: Place[] = []; // drawn while pressing, not yet gone
  private depth = -0.004; // m below the surface, at present
  private height = new Vector3(); // hand in hovering
  private heading = new Vector3(1, 0, 0); // of the blade
  private gripped = false;
  private gripAt = 0; // number of the pose that the jaws were closed at
  private solved = 0; // newest pose that the body has been solved for
  private wantsPress = false;
  private wantsPark = false;
  private park = new Vector3();
  private centre = new Vector3();
  private radius = 0.1;
  private sent = { position: new Vector3(Infinity, 0, 0), turn: new Turn(0, 0, 0, 0) };
  private number = 0;

  constructor(
    private readonly target: Target,
    private readonly send: (message: ClientText) => void,
    private readonly onPose: (n: number) => void,
    private readonly onPress: (pressing: boolean) => void,
    private readonly hand: 1 | 2 = 1,
  ) {}

  /** The place of the surface that it works at or hovers over, m; null: none. */
  get over(): Vec3 | null {
    const place = this.stage === 'hovering' ? this.aim : this.place;
    return place ? (place.point.toArray() as Vec3) : null;
  }

  get pressing(): boolean {
    return this.wantsPress;
  }

  /** The body has been solved for pose `n`. */
  answered(n: number): void {
    this.solved = n;
  }

  /** The hand's newest pose number. */
  get newest(): number {
    return this.number;
  }

  setSession(session: SessionStart, mode = session.mode): void {
    const low = new Vector3(...session.bounds.lower);
    const high = new Vector3(...session.bounds.upper);
    this.centre.copy(low).add(high).multiplyScalar(0.5);
    this.radius = 0.5 * low.distanceTo(high) + 0.02;
    this.setMode(mode);
    this.withdrawAtOnce();
    const park = session.park[mode];
    this.park.copy(park ? new Vector3(...park) : new Vector3(0, 0, this.radius).add(this.centre));
    this.height.copy(this.park);
    this.place = this.aim = null;
  }

  /** Lays down what it holds: from its parking place it begins anew. */
  leave(): void {
    this.withdrawAtOnce();
    this.height.copy(this.park);
    this.place = this.aim = null;
    this.sent.position.set(Infinity, 0, 0);
  }

  setMode(mode: Mode): void {
    if (mode === this.mode) return;
    this.mode = mode;
    this.withdrawAtOnce();
  }

  /** The pointer is on this ray; nothing changes where it misses the organ. */
  point(ray: Ray): boolean {
    if (this.gripped && this.place) {
      this.dragGrip(ray);
      return true;
    }
    const hit = this.target.cast(ray);
    if (!hit) return false;
    const place: Place = { point: new Vector3(...hit.point), normal: new Vector3(...hit.normal) };
    if (this.stage === 'pressing') {
      const last = this.way[this.way.length - 1] ?? this.place;
      if (!last) return true;
      const step = last.point.distanceTo(place.point);
      // A jump to another part of the organ behind an edge is no stroke.
      if (step > 0.0005 && step < 0.3 * this.radius) this.way.push(place);
    } else {
      this.aim = place;
    }
    return true;
  }

  press(): void {
    if (this.wantsPress || !this.aim) return;
    this.wantsPress = true;
    this.target.freeze();
    this.onPress(true);
  }

  release(): void {
    if (!this.wantsPress) return;
    this.wantsPress = false;
    this.way = [];
    if (this.stage === 'pressing') this.stage = 'withdrawing';
    else this.target.thaw();
    if (this.gripped) this.send({ type: 'grip', closed: false });
    this.gripped = false;
    this.onPress(false);
  }

  /** To the place away from the organ, once out of the tissue. */
  putAway(): void {
    this.release();
    this.wantsPark = true;
  }

  /** Changes the depth pressed to, by metres. */
  deepen(by: number): void {
    this.setDepth(this.depths[this.mode] + by);
  }

  setDepth(depth: number): void {
    const least = this.mode === 'grasper' ? -0.02 : 0;
    this.depths[this.mode] = Math.min(Math.max(depth, least), 0.04);
  }

  /** Turns the blade about the surface's normal, radians. */
  turnBlade(angle: number): void {
    const normal = this.place?.normal ?? this.aim?.normal ?? new Vector3(0, 0, 1);
    this.heading.applyAxisAngle(normal, angle);
  }

  /** Goes on by `seconds` and sends the pose when it has changed. */
  advance(seconds: number): void {
    if (!this.holding) return;
    let hand: Vector3;
    if (this.stage === 'hovering') {
      if (this.wantsPark) {
        this.wantsPark = false;
        this.aim = null;
        this.height.copy(this.park);
        this.send(this.hand === 1 ? { type: 'park' } : { type: 'park', hand: 2 });
      }
      if (!this.aim) return;
      hand = this.hover(seconds, this.aim);
    } else {
      hand = this.work(seconds);
    }
    this.emit(hand);
  }

  private hover(seconds: number, aim: Place): Vector3 {
    const above = aim.point.clone().addScaledVector(aim.normal, clearance[this.mode]);
    const gap = this.height.distanceTo(above);
    const step = hoverSpeed * seconds;
    if (gap < 0.5 * this.radius) {
      // Near: straight there, from above.
      const from = above.clone().addScaledVector(aim.normal, gap > 0.004 ? 0.35 * gap : 0);
      moveTo(this.height, from, step);
    } else {
      // Far: out to a sphere about the organ, along it, and down.
      const out = this.height.clone().sub(this.centre);
      const goal = above.clone().sub(this.centre);
      const angle = out.angleTo(goal);
      if (angle < 0.25) moveTo(this.height, above, step);
      else if (out.length() < 0.95 * this.radius) {
        moveTo(this.height, out.clone().setLength(this.radius).add(this.centre), step);
      } else {
        const axis = out.clone().cross(goal);
        if (axis.lengthSq() < 1e-12) axis.set(0, 0, 1).cross(out);
        out.applyAxisAngle(axis.normalize(), Math.min(angle, step / out.length()));
        this.height.copy(out.add(this.centre));
      }
    }
    this.place = { point: aim.point.clone(), normal: aim.normal.clone() };
    if (this.wantsPress && this.height.distanceTo(above) < 0.0015) {
      this.stage = 'pressing';
      this.depth = -clearance[this.mode];
      this.way = [];
    }
    return this.height;
  }

  private work(seconds: number): Vector3 {
    const place = this.place;
    if (!place) {
      this.stage = 'hovering';
      return this.height;
    }
    const withdrawing = this.stage === 'withdrawing';
    let goal = withdrawing ? -clearance[this.mode] : this.depths[this.mode];
    // The jaws take hold in a solve: pulled away before that they would hold nothing.
    if (this.mode === 'grasper' && !withdrawing && !this.gripped) goal = gripDepth;
    else if (this.gripped && this.solved < this.gripAt) goal = gripDepth + settling;
    const pace = (withdrawing ? withdrawSpeed : plungeSpeed) * seconds;
    this.depth += Math.min(Math.max(goal - this.depth, -pace), pace);
    if (this.mode === 'grasper' && !withdrawing && !this.gripped && this.depth >= gripDepth) {
      this.gripped = true;
      this.gripAt = this.number + 1;
      this.send({ type: 'grip', closed: true });
    }
    if (!withdrawing) this.follow(place, workSpeed[this.mode] * seconds);
    const hand = place.point.clone().addScaledVector(place.normal, -this.depth);
    if (withdrawing && this.depth <= -clearance[this.mode]) {
      this.stage = 'hovering';
      this.height.copy(hand);
      this.target.thaw();
    }
    return hand;
  }

  /** Along the way that was drawn, by at most `left` metres. */
  private follow(place: Place, left: number): void {
    for (let next = this.way[0]; next && left > 0; next = this.way[0]) {
      const gap = place.point.distanceTo(next.point);
      const part = gap > 0 ? Math.min(1, left / gap) : 1;
      const before = place.point.clone();
      place.point.lerp(next.point, part);
      place.normal.lerp(next.normal, 0.2 * part).normalize();
      this.steer(place.point.clone().sub(before), place.normal);
      left -= part * gap;
      if (part < 1) return;
      this.way.shift();
    }
  }

  /** The blade turns into its way over about a centimetre; drawn backwards it keeps its heading. */
  private steer(travel: Vector3, normal: Vector3): void {
    travel.addScaledVector(normal, -travel.dot(normal));
    const length = travel.length();
    if (length < 1e-6) return;
    const heading = this.tangent(normal);
    let angle = heading.angleTo(travel);
    if (angle > 1.9) return;
    if (heading.cross(travel).dot(normal) < 0) angle = -angle;
    this.heading.applyAxisAngle(normal, angle * (1 - Math.exp(-length / 0.01)));
  }

  private tangent(normal: Vector3): Vector3 {
    const heading = this.heading.clone().addScaledVector(normal, -this.heading.dot(normal));
    if (heading.lengthSq() < 1e-6) heading.set(0, 1, 0).cross(normal);
    return heading.normalize();
  }

  /** The grip follows the pointer in the plane of the surface where it was closed, by at most 3 cm. */
  private dragGrip(ray: Ray): void {
    const place = this.place;
    if (!place) return;
    const origin = new Vector3(...ray.origin);
    const direction = new Vector3(...ray.direction);
    const across = direction.dot(place.normal);
    if (Math.abs(across) < 0.05) return;
    const start = this.aim?.point ?? place.point;
    const at = origin.addScaledVector(direction, start.clone().sub(origin).dot(place.normal) / across);
    const offset = at.sub(start);
    if (offset.length() > 0.03) offset.setLength(0.03);
    this.way = [{ point: start.clone().add(offset), normal: place.normal.clone() }];
  }

  private emit(hand: Vector3): void {
    const normal = this.place?.normal ?? new Vector3(0, 0, 1);
    const turn = new Turn();
    if (this.mode === 'blade') {
      const x = this.tangent(normal);
      turn.setFromRotationMatrix(new Matrix4().makeBasis(x, normal.clone().cross(x), normal));
    } else {
      turn.setFromUnitVectors(new Vector3(0, 0, 1), normal);
    }
    if (hand.distanceTo(this.sent.position) < 2e-6 && turn.angleTo(this.sent.turn) < 1e-3) return;
    this.sent.position.copy(hand);
    this.sent.turn.copy(turn);
    const orientation: Quaternion = [turn.x, turn.y, turn.z, turn.w];
    this.number += 1;
    this.onPose(this.number);
    this.send({ type: 'pose', n: this.number, ...(this.hand === 2 && { hand: 2 }), position: [hand.x, hand.y, hand.z], orientation });
  }

  private withdrawAtOnce(): void {
    if (this.gripped) this.send({ type: 'grip', closed: false });
    const pressed = this.wantsPress;
    if (this.stage !== 'hovering' && this.place) {
      this.height.copy(this.place.point).addScaledVector(this.place.normal, clearance[this.mode]);
    }
    this.stage = 'hovering';
    this.wantsPress = this.gripped = false;
    this.way = [];
    this.depth = -clearance[this.mode];
    this.target.thaw();
    if (pressed) this.onPress(false);
  }
}

/** Moves `point` towards `goal` by at most `step`. */
function moveTo(point: Vector3, goal: Vector3, step: number): void {
  const gap = point.distanceTo(goal);
  if (gap <= step) point.copy(goal);
  else point.lerp(goal, step / gap);
}
