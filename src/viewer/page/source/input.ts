// Mouse, pen and touch on the picture. On the organ the left button or one finger presses; beside it they turn the view. With
// two hands a second finger on the organ leads the other one.
import type { Orbit } from './orbit';
import type { Hands } from './hands';
import type { Ray, Stylus } from './stylus';

interface Finger {
  x: number; // px
  y: number;
}

export interface PointerHost {
  /** The ray through a point of the picture in pixels. */
  ray(x: number, y: number): Ray;
  /** A click meant for picking a node has been taken. */
  pick(ray: Ray): boolean;
  /** The pointer has moved to here, px. */
  moved(x: number, y: number): void;
  /** By metres. */
  deepen(by: number): void;
  changed(): void;
}

export function attachPointer(canvas: HTMLCanvasElement, orbit: Orbit, hands: Hands, host: PointerHost): void {
  const fingers = new Map<number, Finger>();
  let gesture: 'none' | 'press' | 'turn' | 'pan' | 'two' = 'none';
  let depthAtStart = 0;
  let stylus: Stylus = hands.mouse; // that a press leads,
  let leader = -1; // and the pointer that leads it
  let beside: { finger: number; stylus: Stylus } | null = null; // the other hand, led by a second finger

  const at = (event: PointerEvent | WheelEvent): Finger => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };

  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('pointerdown', (event) => {
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    const place = at(event);
    fingers.set(event.pointerId, place);
    const free = fingers.size - (beside ? 1 : 0); // fingers that do not lead the other hand
    if (event.pointerType === 'touch' && free === 2) {
      const { other } = hands;
      if (gesture === 'press' && other && !beside && other.point(host.ray(place.x, place.y))) {
        other.press();
        beside = { finger: event.pointerId, stylus: other };
        return;
      }
      stylus.release();
      gesture = 'two';
      return;
    }
    if (free > 1) return;
    stylus = hands.mouse;
    const ray = host.ray(place.x, place.y);
    if (event.button === 1 || (event.button === 2 && event.shiftKey)) gesture = 'pan';
    else if (event.button === 2) gesture = 'turn';
    else if (host.pick(ray)) gesture = 'none';
    else if (stylus.holding && stylus.point(ray)) {
      host.moved(place.x, place.y);
      depthAtStart = stylus.depths[stylus.mode];
      gesture = 'press';
      leader = event.pointerId;
      stylus.press();
    } else gesture = 'turn';
  });
  canvas.addEventListener('pointermove', (event) => {
    const place = at(event);
    const before = fingers.get(event.pointerId);
    if (!before) {
      host.moved(place.x, place.y);
      hands.mouse.point(host.ray(place.x, place.y));
      return;
    }
    if (event.pointerId === beside?.finger) {
      beside.stylus.point(host.ray(place.x, place.y));
      fingers.set(event.pointerId, place);
      return;
    }
    const dx = place.x - before.x;
    const dy = place.y - before.y;
    if (gesture === 'two') {
      pinch(event.pointerId, before, place);
    } else if (gesture === 'press') {
      if (event.pointerId !== leader) return;
      host.moved(place.x, place.y);
      stylus.point(host.ray(place.x, place.y));
      if (event.pointerType === 'pen' && event.pressure > 0) stylus.setDepth(event.pressure * 2 * depthAtStart);
    } else if (gesture === 'turn') {
      orbit.turn(0.008 * dx, 0.008 * dy);
      host.changed();
    } else if (gesture === 'pan') {
      orbit.pan(dx / canvas.clientHeight, -dy / canvas.clientHeight);
      host.changed();
    }
    fingers.set(event.pointerId, place);
  });
  const lift = (event: PointerEvent): void => {
    fingers.delete(event.pointerId);
    if (event.pointerId === beside?.finger) {
      beside.stylus.release();
      beside = null;
      return;
    }
    if (gesture === 'press') {
      if (event.pointerId !== leader) return;
      stylus.release();
      if (event.pointerType === 'pen') stylus.setDepth(depthAtStart);
    }
    if (gesture !== 'two' || fingers.size === 0) gesture = 'none';
  };
  canvas.addEventListener('pointerup', lift);
  canvas.addEventListener('pointercancel', lift);
  canvas.addEventListener(
    'wheel',
    (event) => {
      event.preventDefault();
      const notches = Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY) / 100, 3);
      if (hands.mouse.pressing) host.deepen(-0.0005 * notches);
      else orbit.zoom(Math.exp(-0.15 * notches));
      host.changed();
    },
    { passive: false },
  );

  /** Two fingers turn the view by their middle and zoom by their distance. */
  function pinch(id: number, before: Finger, place: Finger): void {
    const other = [...fingers].find(([key]) => key !== id)?.[1];
    if (!other) return;
    const spread = (a: Finger): number => Math.hypot(a.x - other.x, a.y - other.y);
    orbit.zoom(spread(place) / Math.max(spread(before), 1));
    orbit.turn(0.004 * (place.x - before.x), 0.004 * (place.y - before.y));
    host.changed();
  }
}
