// Every key, what it does and what the help says of it.
import type { Binding, Section } from './keys';
import type { Orbit } from './orbit';
import type { Page } from './page';
import type { Panels } from './panels';
import type { Hands } from './hands';

/** What mouse, pen and touch do, for the help. */
export const gestures: readonly (readonly [string, string])[] = [
  ['Move over the organ', 'the tool hovers there'],
  ['Left button, finger or pen on the organ', 'presses, cuts or grips; drag along the surface'],
  ['Wheel while pressing, pen pressure, slider', 'depth'],
  ['Drag beside the organ, right button, two fingers', 'turns the view'],
  ['A second finger on the organ, with two hands', 'leads the other hand'],
  ['Middle button, Shift and right button', 'moves the view'],
  ['Wheel, pinch', 'zoom'],
];

export function bindings(page: Page, hands: Hands, orbit: Orbit, panels: Panels): Section[] {
  return [
    { title: 'Tool', bindings: toolKeys(page, hands) },
    { title: 'View', bindings: viewKeys(page, orbit) },
    { title: 'Show', bindings: showKeys(page, panels) },
    { title: 'Session', bindings: sessionKeys(page) },
  ];
}

function toolKeys(page: Page, hands: Hands): Binding[] {
  const speed = 110; // px/s
  return [
    { keys: ['ArrowLeft'], shown: '←', does: 'tool to the left', hold: (s) => page.movePointer(-speed * s, 0) },
    { keys: ['ArrowRight'], shown: '→', does: 'tool to the right', hold: (s) => page.movePointer(speed * s, 0) },
    { keys: ['ArrowUp'], shown: '↑', does: 'tool up', hold: (s) => page.movePointer(0, -speed * s) },
    { keys: ['ArrowDown'], shown: '↓', does: 'tool down', hold: (s) => page.movePointer(0, speed * s) },
    { keys: [' '], shown: 'Space', does: 'press, cut or grip; again: withdraw', press: () => page.togglePress() },
    { keys: ['PageDown', '.'], shown: 'PageDown .', does: 'deeper', hold: (s) => page.deepen(0.006 * s, hands.keys) },
    { keys: ['PageUp', ','], shown: 'PageUp ,', does: 'less deep', hold: (s) => page.deepen(-0.006 * s, hands.keys) },
    { keys: ['q'], shown: 'Q', does: 'turn the blade to the left', hold: (s) => hands.blade.turnBlade(1.2 * s) },
    { keys: ['e'], shown: 'E', does: 'turn the blade to the right', hold: (s) => hands.blade.turnBlade(-1.2 * s) },
    { keys: ['1'], shown: '1', does: 'probe', press: () => page.chooseMode('probe') },
    { keys: ['2'], shown: '2', does: 'blade', press: () => page.chooseMode('blade') },
    { keys: ['3'], shown: '3', does: 'grasper', press: () => page.chooseMode('grasper') },
    { keys: ['5'], shown: '5', does: 'two hands: the blade goes into the other one, or is laid away', press: () => page.toggleTwoHands() },
    { keys: ['6'], shown: '6', does: 'two hands: mouse and keys change hands', press: () => page.swapHands() },
    { keys: ['k'], shown: 'K', does: 'put the tool away', press: () => page.park() },
    { keys: ['t'], shown: 'T', does: 'take the tool, or let go of it', press: () => page.toggleTool() },
    { keys: ['Escape'], shown: 'Esc', does: 'withdraw', press: () => hands.release() },
  ];
}

function viewKeys(page: Page, orbit: Orbit): Binding[] {
  return [
    { keys: ['Shift+ArrowLeft', 'a'], shown: 'Shift+← A', does: 'turn the view left', hold: (s) => orbit.turn(-1.2 * s, 0) },
    { keys: ['Shift+ArrowRight', 'd'], shown: 'Shift+→ D', does: 'turn the view right', hold: (s) => orbit.turn(1.2 * s, 0) },
    { keys: ['Shift+ArrowUp', 'w'], shown: 'Shift+↑ W', does: 'look from higher', hold: (s) => orbit.turn(0, 1.2 * s) },
    { keys: ['Shift+ArrowDown', 's'], shown: 'Shift+↓ S', does: 'look from lower', hold: (s) => orbit.turn(0, -1.2 * s) },
    { keys: ['j'], shown: 'J', does: 'move the view left', hold: (s) => orbit.pan(0.5 * s, 0) },
    { keys: ['l'], shown: 'L', does: 'move the view right', hold: (s) => orbit.pan(-0.5 * s, 0) },
    { keys: ['i'], shown: 'I', does: 'move the view up', hold: (s) => orbit.pan(0, -0.5 * s) },
    { keys: ['m'], shown: 'M', does: 'move the view down', hold: (s) => orbit.pan(0, 0.5 * s) },
    { keys: ['+', '='], shown: '+', does: 'nearer', hold: (s) => orbit.zoom(Math.exp(1.2 * s)) },
    { keys: ['-'], shown: '-', does: 'farther', hold: (s) => orbit.zoom(Math.exp(-1.2 * s)) },
    { keys: ['h'], shown: 'H', does: 'camera as at the start', press: () => page.home() },
  ];
}

function showKeys(page: Page, panels: Panels): Binding[] {
  const { nodes, spheres, supports, wire, plan, spring, colours, slice, sliceAxis } = panels;
  const flip = (input: HTMLInputElement) => (): void => input.click();
  const next = (list: HTMLSelectElement) => (): void => {
    list.selectedIndex = (list.selectedIndex + 1) % list.length;
    list.dispatchEvent(new Event('change'));
  };
  const slide = (by: number): void => {
    panels.slicePlace.valueAsNumber += by;
    panels.slicePlace.dispatchEvent(new Event('input'));
  };
  return [
    { keys: ['n'], shown: 'N', does: 'nodes', press: flip(nodes) },
    { keys: ['b'], shown: 'B', does: 'spheres of the nodes', press: flip(spheres) },
    { keys: ['p'], shown: 'P', does: 'supports of the node nearest to the tip', press: () => page.pickAtTip() },
    { keys: ['o'], shown: 'O', does: 'supports off or on', press: flip(supports) },
    { keys: ['c'], shown: 'C', does: 'next colours', press: next(colours) },
    { keys: ['x'], shown: 'X', does: 'next level-set slice', press: next(slice) },
    { keys: ['z'], shown: 'Z', does: 'slice across the next axis', press: next(sliceAxis) },
    { keys: ['['], shown: '[', does: 'slice back', press: () => slide(-0.04) },
    { keys: [']'], shown: ']', does: 'slice forth', press: () => slide(0.04) },
    { keys: ['4'], shown: '4', does: 'way ahead of the blade', press: flip(plan) },
    { keys: ['g'], shown: 'G', does: 'triangles', press: flip(wire) },
    { keys: ['u'], shown: 'U', does: 'spring between hand and tip', press: flip(spring) },
  ];
}

function sessionKeys(page: Page): Binding[] {
  return [
    { keys: ['r'], shown: 'R', does: 'reset: whole organ', press: () => page.reset() },
    { keys: ['v'], shown: 'V', does: 'start or stop a recording', press: () => page.record() },
    { keys: ['y'], shown: 'Y', does: 'replay the chosen recording, or end it', press: () => page.replay() },
    { keys: ['f'], shown: 'F', does: 'download the chosen recording', press: () => page.download() },
    { keys: ['Enter'], shown: 'Enter', does: 'save a picture', press: () => page.screenshot() },
    { keys: ['0'], shown: '0', does: 'show or hide the panels', press: () => page.togglePanels() },
    { keys: ['?'], shown: '?', does: 'this help', press: () => page.help() },
  ];
}
