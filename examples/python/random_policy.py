"""A policy of random moves in the cutting environment: what it cuts, what it feels, how fast it goes.

python3 random_policy.py [--out FOLDER] [--steps N] [--workers N]
"""

import argparse
import functools
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from spherecut.env import CuttingEnv, ParallelEnvs


def reward(before, action, after, info):
    """Area cut, in mm2, less a price for the force on the blade."""
    return 1e6 * float(after["cut_area"][0] - before["cut_area"][0]) - 0.1 * float(np.linalg.norm(after["blade_force"]))


def policy(random, count):
    """Down and along, with noise."""
    return np.clip([0.0, 0.6, -0.5] + 0.4 * random.standard_normal((count, 3)), -1, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("."))
    parser.add_argument("--steps", type=int, default=150)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()

    env = CuttingEnv(reward=reward)
    observation, _ = env.reset(seed=1)
    random = np.random.default_rng(1)
    seen, gained, start = [observation], 0.0, time.perf_counter()
    for _ in range(arguments.steps):
        observation, one, ended, truncated, info = env.step(policy(random, 1)[0])
        gained += one
        seen.append(observation)
        if ended or truncated:
            print(info)
            break
    rate = (len(seen) - 1) / (time.perf_counter() - start)
    print(f"{len(env.session.nodes)} nodes, {rate:.0f} steps a second, reward {gained:.2f}, "
          f"cut {1e6 * observation['cut_area'][0]:.1f} mm2")

    with ParallelEnvs([functools.partial(CuttingEnv, reward=reward)] * arguments.workers) as envs:
        envs.reset(seed=2)
        total, start = np.zeros(arguments.workers), time.perf_counter()
        for _ in range(arguments.steps):
            _, rewards, *_ = envs.step(policy(random, arguments.workers))
            total += rewards
        rate = arguments.steps * arguments.workers / (time.perf_counter() - start)
    print(f"{arguments.workers} workers: {rate:.0f} steps a second together, rewards {np.round(total, 2)}")

    times = np.array([one["time"][0] for one in seen])
    figure, rows = plt.subplots(3, 1, figsize=(7, 7), sharex=True)
    rows[0].plot(times, [1e6 * one["cut_area"][0] for one in seen])
    rows[0].set(ylabel="cut [mm$^2$]", title="Random moves of a scalpel in a stretched block")
    rows[1].plot(times, [np.linalg.norm(one["blade_force"]) for one in seen])
    rows[1].set(ylabel="force on the blade [N]")
    rows[2].plot(times, [one["release"] for one in seen])
    rows[2].set(ylabel="G along the front [J/m$^2$]", xlabel="time [s]")
    figure.tight_layout()
    figure.savefig(arguments.out / "random_policy.png", dpi=100)


if __name__ == "__main__":  # the workers import this file
    main()
