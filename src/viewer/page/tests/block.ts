// A block that is solved quickly, and a press on it.
import type { Page as Tab } from 'playwright-core';
import { until } from './browser';
import { hover, look } from './hand';

/** A block of 60 x 60 x 30 mm held at two sides; about 150 nodes. `more` precuts. */
export const block = (title: string, more = ''): string => `title = "${title}"
[organ]
shape = "block"
size = [0.06, 0.06, 0.03]
edge = 0.006
[material]
young_modulus = 1e4
poisson_ratio = 0.3
[[fixed]]
name = "left"
region = "half_space"
point = [-0.029, 0, 0]
normal = [1, 0, 0]
[[fixed]]
name = "right"
region = "half_space"
point = [0.029, 0, 0]
normal = [-1, 0, 0]
[nodes]
fine_spacing = 0.007
coarse_spacing = 0.014
fine_radius = 0.008
${more}
[tool]
shape = "sphere_tip"
radius = 0.01
step = 0.25
[tool.approach]
target = [0, 0, 0.03]
direction = [0, 0, -1]
depth = 0.002
clearance = 0.005
[blade]
edge = [[0, 0, 0], [0, 0, 0.03]]
edge_radius = 1e-4
[[blade.path]]
time = 0
position = [0, -0.05, 0.02]
[[blade.path]]
time = 1
position = [0, -0.04, 0.02]
[haptics]
budget = 5.0
[haptics.hand]
mass = 0.1
stiffness = 300.0
damping = 8.0
[output]
figures = false
`;

/** Presses at the middle and waits for the tool to come to rest in the body's newest solve. */
export async function press(tab: Tab): Promise<{ force: number; depth: number }> {
  await hover(tab, 0.001, 0.001);
  await tab.mouse.down();
  await until(tab, 'the force is felt', () => Math.hypot(...globalThis.spherecut!.frame!.force) > 0.03);
  await until(tab, 'it is at rest', () => {
    const { frame } = globalThis.spherecut!;
    const memory = globalThis as unknown as { pose?: number; tip?: number[]; same?: number };
    const still = memory.pose === frame!.poseInTick && Math.hypot(...frame!.tip.map((x, d) => x - (memory.tip?.[d] ?? 0))) < 2e-5;
    memory.same = still && frame!.poseInSolve === frame!.poseInTick && frame!.depth > 0.003 ? (memory.same ?? 0) + 1 : 0;
    if (!still) [memory.pose, memory.tip] = [frame!.poseInTick, [...frame!.tip]];
    return memory.same >= 10; // times on end, 50 ms apart
  });
  const { force, depth } = await look(tab);
  return { force, depth };
}

export async function withdraw(tab: Tab): Promise<void> {
  await tab.mouse.up();
  await until(tab, 'it has withdrawn', () => Math.hypot(...globalThis.spherecut!.frame!.force) === 0);
}
