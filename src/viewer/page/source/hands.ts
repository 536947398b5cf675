// The hands of a viewer. One hand: mouse and keys lead the same tool. Two hands: the second has the blade while the first
// keeps the tool; the mouse leads the one and the keys the other.
import type { Snapshot } from './body';
import type { ClientText, Frame, SessionStart } from './protocol';
import { type Ray, Stylus } from './stylus';
import type { Hit } from './surface';

const keysRest = 400; // ms, after which keys begin anew where their tool is

export interface HandsHost {
  /** The surface under a ray; of the body as it was when a press began, where that is given. */
  cast(ray: Ray, frozen: Snapshot | null): Hit | null;
  snapshot(): Snapshot | null;
  send(message: ClientText): void;
  /** The first hand's pose `n` has gone out. */
  posed(n: number): void;
  /** A hand presses, or has left off; `keys`: the one that the keys lead. */
  pressed(pressing: boolean, keys: boolean): void;
}

export class Hands {
  readonly first: Stylus;
  readonly second: Stylus;
  private isTwo = false;
  private swapped = false; // the mouse leads the first hand, the keys the second
  private keysAt = { x: 0, y: 0 }; // px, of the hand that the keys lead beside the mouse,
  private keysMoved = -Infinity; // ms, when they last did

  constructor(private readonly host: HandsHost) {
    this.first = this.make(1);
    this.second = this.make(2);
  }

  private make(hand: 1 | 2): Stylus {
    let frozen: Snapshot | null = null;
    const { host } = this;
    return new Stylus(
      { cast: (ray) => host.cast(ray, frozen), freeze: () => (frozen = host.snapshot()), thaw: () => (frozen = null) },
      (message) => host.send(message),
      (n) => hand === 1 && host.posed(n),
      (pressing) => host.pressed(pressing, (hand === 1 ? this.first : this.second) === this.keys),
      hand,
    );
  }

  get two(): boolean {
    return this.isTwo;
  }

  /** What the mouse, a pen or a finger leads. */
  get mouse(): Stylus {
    return this.isTwo && !this.swapped ? this.second : this.first;
  }

  /** What the keys lead. */
  get keys(): Stylus {
    return this.isTwo && this.swapped ? this.second : this.first;
  }

  /** The one that the mouse does not lead; null: there is one hand. */
  get other(): Stylus | null {
    return this.isTwo ? this.keys : null;
  }

  /** The one that has the blade, or would have it. */
  get blade(): Stylus {
    return this.isTwo ? this.second : this.first;
  }

  set holding(on: boolean) {
    this.first.holding = on;
    this.second.holding = on && this.isTwo;
  }

  setSession(session: SessionStart): void {
    this.setTwo(false, false);
    this.first.setSession(session);
    if (session.two_hands) this.second.setSession(session, 'blade');
  }

  /** The second hand has the blade from now on, or nothing. */
  setTwo(on: boolean, holding: boolean): void {
    this.second.leave();
    this.isTwo = on;
    this.swapped = false;
    this.keysMoved = -Infinity;
    this.second.holding = on && holding;
  }

  /** Mouse and keys change hands. */
  swap(): void {
    if (!this.isTwo) return;
    this.swapped = !this.swapped;
    this.keysMoved = -Infinity;
  }

  /** With two hands, where the keys lead theirs, px, to be changed: on from the last time, after a rest from its `place`. */
  keysFrom(place: () => { x: number; y: number }, now: number): { x: number; y: number } {
    if (now - this.keysMoved > keysRest) this.keysAt = place();
    this.keysMoved = now;
    return this.keysAt;
  }

  answered(frame: Frame): void {
    this.first.answered(frame.poseInSolve);
    if (frame.second) this.second.answered(frame.second.poseInSolve);
  }

  advance(seconds: number): void {
    this.first.advance(seconds);
    this.second.advance(seconds);
  }

  release(): void {
    this.first.release();
    this.second.release();
  }
}
