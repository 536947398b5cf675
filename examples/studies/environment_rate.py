"""Steps a second of the cutting environment under several policies.

python3 examples/studies/environment_rate.py [STEPS]
Each policy moves a scalpel in the default block of 300 nodes, with G at 8 places; wall clock.
"""

import sys
import time

import numpy as np
from spherecut.env import CuttingEnv

POLICIES = {
    "straight down, then along": lambda random, k: np.array([0, 0.5, -1.0]) if k < 60 else np.array([0, 1.0, 0]),
    "mostly along": lambda random, k: np.array([0, 0.6, -0.4]) + random.uniform(-0.4, 0.4, 3),
    "along and down": lambda random, k: np.array([random.uniform(-0.3, 0.3), random.uniform(0, 1), random.uniform(-1, 0)]),
    "any way": lambda random, k: random.uniform(-1, 1, 3),
}

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 300
print("| moves | beside | steps a second | median, ms | slowest, s | cut, mm2 |\n|---|---|---|---|---|---|", flush=True)
for name, policy in POLICIES.items():
    for beside in (True, False):
        env = CuttingEnv(most_steps=steps, beside=beside)
        observation, _ = env.reset(seed=1)
        random, took, ended = np.random.default_rng(3), [], False
        while len(took) < steps and not ended:
            action = np.clip(policy(random, len(took)), -1, 1)
            begin = time.perf_counter()
            observation, _, ended, _, _ = env.step(action)
            took.append(time.perf_counter() - begin)
        print(f"| {name} | {beside} | {len(took) / sum(took):.0f} | {1e3 * np.median(took):.1f} | {max(took):.2f} | "
              f"{1e6 * observation['cut_area'][0]:.0f} |", flush=True)
