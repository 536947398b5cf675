"""The environment: spaces, seeds, copies, workers; with Gymnasium's own names where that is not installed."""

import functools
import pickle

import numpy as np
import pytest
import spherecut as sc
from spherecut import env as environment
from spherecut.env import CuttingEnv, ParallelEnvs

DOWN, ALONG = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])


def drive(env, count=60, seed=3):
    observation, _ = env.reset(seed=seed)
    seen = [observation]
    for k in range(count):
        observation, *_ = env.step(DOWN if k < 40 else ALONG)
        seen.append(observation)
    return seen


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


def test_an_episode_cuts_and_is_observed():
    env = CuttingEnv()
    seen = drive(env, 110)
    assert all(env.observation_space.contains(one) for one in seen)
    assert seen[0]["cut_area"] == 0 and np.all(seen[0]["release"] == 0)
    last = seen[-1]
    assert last["cut_area"][0] == env.session.incision.area > 1e-5
    assert last["opening"] > 0 and last["release"].max() > 0 and last["pieces"] == 1
    assert np.linalg.norm(last["blade_force"]) > 0 and np.dot(last["blade_force"], ALONG) < 0
    assert np.allclose(last["blade_position"], [0.0013, -0.015 + 70 * 0.0002, 0.022 - 40 * 0.0002])
    g = [s.release for s in env.session.front_states()]
    assert last["release"][0] == g[0] and last["release"][-1] == g[-1]
    areas = np.array([one["cut_area"][0] for one in seen])
    assert np.all(np.diff(areas) >= 0)


def test_seeds_give_bits():
    first, second = drive(CuttingEnv()), drive(CuttingEnv())
    assert all(same(a, b) for a, b in zip(first, second))
    assert not all(same(a, b) for a, b in zip(first, drive(CuttingEnv(), seed=4)))
    env = CuttingEnv()
    env.reset(seed=11)
    samples = [env.action_space.sample() for _ in range(3)]
    env.reset(seed=11)
    assert np.array_equal(samples, [env.action_space.sample() for _ in range(3)])
    assert all(env.action_space.contains(one) for one in samples)
    positions = env.session.nodes.positions.copy()
    env.reset()
    assert env.session.scenario.random_seed == 12 and not np.array_equal(env.session.nodes.positions[-1], positions[-1])


def test_copies_go_on_where_the_original_is():
    env = CuttingEnv(places=3)
    drive(env, 50)
    copy = pickle.loads(pickle.dumps(env))
    for _ in range(15):
        ours, theirs = env.step(ALONG), copy.step(ALONG)
        assert same(ours[0], theirs[0]) and ours[1:] == theirs[1:]


def test_a_tool_and_rewards(small):
    scenario = sc.Scenario.read(small)
    told = []

    def reward(before, action, after, info):
        told.append((before["tool_force"][2], after["tool_force"][2]))
        return after["tool_force"][2] - before["tool_force"][2]

    env = CuttingEnv(scenario, holds=["tool"], reward=reward, most_steps=12, speed=0.03, places=0)
    observation, _ = env.reset(seed=1)
    total = 0.0
    for k in range(12):
        observation, gained, ended, truncated, _ = env.step([0, 0, -1])
        total += gained
        assert truncated == (k == 11) and not ended
    assert total == pytest.approx(observation["tool_force"][2]) and total > 0.02
    assert told[0][0] == 0 and told[1][0] == told[0][1] and "release" not in observation


def test_what_cannot_be_is_told():
    with pytest.raises(sc.InputError, match="holds: 'tool'; allowed: blade in this scenario"):
        CuttingEnv(holds=["tool"])
    with pytest.raises(sc.InputError, match="speed: -1; allowed: above 0"):
        CuttingEnv(speed=-1)
    env = CuttingEnv()
    with pytest.raises(sc.InputError, match="before reset"):
        env.step(DOWN)
    env.reset()
    with pytest.raises(sc.InputError, match="3 numbers from -1 to 1"):
        env.step([0, 0, -2])
    with pytest.raises(sc.InputError, match=r"options: \['x'\]"):
        env.reset(options={"x": 1})


def test_workers_give_what_one_process_gives():
    alone = [drive(CuttingEnv(most_steps=30), 20, seed=7 + k) for k in range(2)]
    with ParallelEnvs([functools.partial(CuttingEnv, most_steps=30)] * 2) as envs:
        observations, infos = envs.reset(seed=7)
        assert len(infos) == 2
        for k in range(30):
            if k <= 20:
                for e in range(2):
                    assert same({name: values[e] for name, values in observations.items()}, alone[e][k])
            observations, rewards, ended, truncated, infos = envs.step([DOWN, DOWN])
        assert truncated.tolist() == [True, True] and rewards.shape == (2,) and not ended.any()
        assert infos[0]["last_observation"]["time"] == pytest.approx(0.3) and observations["time"][0] == 0
        with pytest.raises(sc.InputError, match="3 numbers"):
            envs.step([[9, 9, 9], [0, 0, 0]])


def test_gymnasium_where_it_is():
    gymnasium = pytest.importorskip("gymnasium")
    assert issubclass(CuttingEnv, gymnasium.Env)
    from gymnasium.utils.env_checker import check_env

    check_env(CuttingEnv(), skip_render_check=True)


def test_own_spaces_are_like_gymnasiums():
    box = environment.Box(-1.0, np.array([1.0, np.inf]), (2,))
    box.seed(1)
    samples = np.array([box.sample() for _ in range(200)])
    assert np.all(np.isfinite(samples)) and np.all(np.abs(samples[:, 0]) <= 1) and samples[:, 0].std() > 0.4
    assert box.contains([0, 5]) and not box.contains([0, -2]) and not box.contains([0])
    both = environment.Dict({"a": box, "b": environment.Box(0, 1, (1,))})
    assert both.contains({"a": [0, 0], "b": [1]}) and not both.contains({"a": [0, 0]})
