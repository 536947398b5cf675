"""An environment in the manner of Gymnasium: a blade, a tool or both, moved by an agent through tissue.

Gymnasium is not needed: where it is not installed, the spaces are those of this file, with the same methods.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from ._core import BladePose, InputError, NumericalError, Scenario, Session, Step, StepResult

__all__ = ["Box", "CuttingEnv", "Dict", "ParallelEnvs", "default_scenario"]

Array = npt.NDArray[np.float64]
Observation = dict[str, Array]

_DEFAULT = """
title = "A stretched block and a scalpel"

[organ]
shape = "block"
size = [0.06, 0.04, 0.02] # m

[material]
young_modulus = 10000.0 # Pa
poisson_ratio = 0.3
toughness = 2.0 # J/m2: the blade feels a force
pretension = [0.05, 0.0, 0.0] # 5 % across the cut: it gapes

[[fixed]]
name = "base"
region = "half_space"
point = [0.0, 0.0, 0.0005]
normal = [0.0, 0.0, 1.0]

[nodes]
count = 300
fine_spacing = 0.004
coarse_spacing = 0.008

[blade]
edge = [[0.0, 0.0, 0.0], [0.0, 0.003, 0.006], [0.0, 0.006, 0.02]] # m, tip first
edge_radius = 0.0001

[[blade.path]]
time = 0.0
position = [0.0013, -0.015, 0.022]

[[blade.path]]
time = 1.0
position = [0.0013, -0.014, 0.012]

[[blade.path]]
time = 3.0
position = [0.0013, 0.010, 0.012]
"""


def default_scenario() -> Scenario:
    """A stretched block of 300 nodes and a scalpel that the tissue resists."""
    return Scenario.from_text(_DEFAULT, "cutting_env.toml")


class Box:
    """A box of numbers, as gymnasium.spaces.Box has it."""

    def __init__(self, low: Any, high: Any, shape: Sequence[int], dtype: Any = np.float64) -> None:
        self.shape, self.dtype = tuple(shape), np.dtype(dtype)
        self.low: npt.NDArray[Any] = np.broadcast_to(np.asarray(low, self.dtype), self.shape).copy()
        self.high: npt.NDArray[Any] = np.broadcast_to(np.asarray(high, self.dtype), self.shape).copy()
        self._random = np.random.default_rng()

    def seed(self, seed: Optional[int] = None) -> None:
        self._random = np.random.default_rng(seed)

    def sample(self) -> npt.NDArray[Any]:
        """Evenly between the bounds; normal deviates where there are none."""
        bounded = np.isfinite(self.low) & np.isfinite(self.high)
        low, high = np.where(bounded, self.low, 0), np.where(bounded, self.high, 1)
        even = self._random.uniform(low, high)
        return np.where(bounded, even, self._random.standard_normal(self.shape)).astype(self.dtype)

    def contains(self, x: Any) -> bool:
        values = np.asarray(x)
        return values.shape == self.shape and bool(np.all(values >= self.low) and np.all(values <= self.high))

    def __repr__(self) -> str:
        return f"Box({self.low.min()}, {self.high.max()}, {self.shape}, {self.dtype})"


class Dict:
    """Named spaces, as gymnasium.spaces.Dict has it."""

    def __init__(self, spaces: dict[str, Box]) -> None:
        self.spaces = dict(spaces)

    def seed(self, seed: Optional[int] = None) -> None:
        for k, space in enumerate(self.spaces.values()):
            space.seed(None if seed is None else seed + k)

    def sample(self) -> dict[str, npt.NDArray[Any]]:
        return {name: space.sample() for name, space in self.spaces.items()}

    def contains(self, x: Any) -> bool:
        return isinstance(x, dict) and x.keys() == self.spaces.keys() and all(
            space.contains(x[name]) for name, space in self.spaces.items()
        )

    def __getitem__(self, name: str) -> Box:
        return self.spaces[name]


try:
    import gymnasium
    from gymnasium.spaces import Box as _Box
    from gymnasium.spaces import Dict as _Dict

    _Base: Any = gymnasium.Env
except ImportError:
    _Base, _Box, _Dict = object, Box, Dict


Reward = Callable[[Observation, Array, Observation, dict[str, Any]], float]


class CuttingEnv(_Base):  # type: ignore[misc]
    """Tissue that an agent presses and cuts.

    Actions: an array of numbers from -1 to 1, three for each thing that is moved (``holds``): its velocity along x, y, z
    in parts of ``speed``. Observations, all float64 arrays:

    ===============  =====  ==================================================================
    time             (1,)   s
    tool_force       (3,)   N, of the organ on the tool; zero without a tool
    blade_force      (3,)   N, of the tissue on the blade; zero without a toughness
    tool_torque      (3,)   N m, of that force about the tool's reference point
    blade_torque     (3,)   N m, of that force about the origin of the blade's frame
    tool_position    (3,)   m, of its reference point
    blade_position   (3,)   m, origin of the blade's frame
    cut_area         (1,)   m2
    front_length     (1,)   m
    pieces           (1,)
    opening          (1,)   m, largest distance between the faces of the cut
    release          (k,)   G, J/m2, at k places evenly along the front; 0 where it has none
    ===============  =====  ==================================================================

    The reward is yours: ``reward(observation, action, next_observation, info)``; without it it is 0. An episode is
    truncated after ``most_steps``, and ends where the session cannot go on: ``info["error"]`` then has its words.

    The seed of ``reset`` seeds the nodes and the spaces: the same seed and actions give the same bits. A pickled
    environment is its arguments, seed and actions; it goes through them again when it is first used.
    """

    metadata: dict[str, Any] = {"render_modes": []}
    render_mode = None

    def __init__(
        self,
        scenario: Union[Scenario, str, None] = None,
        *,
        holds: Sequence[str] = ("blade",),
        speed: float = 0.02,
        time_step: float = 0.01,
        most_steps: int = 500,
        places: int = 8,
        reward: Optional[Reward] = None,
        margin: float = 0.01,
        beside: bool = True,
    ) -> None:
        """scenario: a Scenario or its file; None: default_scenario(). holds: of "blade" and "tool". speed: m/s. time_step:
        s. places: of ``release``; 0 leaves the front out. margin: m, how far outside the organ's bounds things may go.
        beside: bodies that follow the cut are made on a thread in the background; what comes out depends on the steps
        alone."""
        if scenario is None:
            scenario = default_scenario()
        self.scenario = scenario if isinstance(scenario, Scenario) else Scenario.read(scenario)
        self._options: dict[str, Any] = dict(
            holds=tuple(holds), speed=speed, time_step=time_step, most_steps=most_steps, places=places, reward=reward,
            margin=margin, beside=beside,
        )
        there = {"tool": self.scenario.tool is not None, "blade": self.scenario.blade_edge is not None}
        for name in holds:
            if not there.get(name, False):
                raise InputError(f"holds: '{name}'; allowed: {', '.join(n for n in there if there[n])} in this scenario")
        if len(holds) == 0:
            raise InputError("holds: nothing; allowed: blade, tool, or both")
        for what, value in {"speed": speed, "time_step": time_step}.items():
            if not 0 < value < np.inf:
                raise InputError(f"{what}: {value:g}; allowed: above 0")
        if most_steps < 1 or places < 0:
            raise InputError(f"most_steps: {most_steps}, places: {places}; allowed: from 1, from 0")
        self.action_space = _Box(-1.0, 1.0, shape=(3 * len(holds),), dtype=np.float64)
        free = {f"{thing}_{what}": 3 for what in ("force", "torque", "position") for thing in ("tool", "blade")}
        positive = {name: 1 for name in ("time", "cut_area", "front_length", "pieces", "opening")}
        if places > 0:
            positive["release"] = places
        self.observation_space = _Dict(
            {name: _Box(-np.inf, np.inf, shape=(n,), dtype=np.float64) for name, n in free.items()}
            | {name: _Box(0, np.inf, shape=(n,), dtype=np.float64) for name, n in positive.items()}
        )
        self.session: Optional[Session] = None
        self._seed: Optional[int] = None
        self._actions: list[Array] = []

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[dict[str, Any]] = None
    ) -> tuple[Observation, dict[str, Any]]:
        """A body as it is before the first cut, on nodes of this seed; None: the next number after the last seed, at
        first the scenario's own. options: none are known."""
        if options:
            raise InputError(f"options: {sorted(options)}; allowed: none")
        if seed is None:
            seed = self.scenario.random_seed if self._seed is None else self._seed + 1
        self._seed = seed
        self._actions = []
        self.action_space.seed(seed)
        self.observation_space.seed(seed)
        self.session = Session(self.scenario.with_random_seed(seed), None, "device")
        self.session.set_force_only(True)
        self.session.set_going_on(True)
        if self._options["beside"]:
            self.session.set_following_aside(True)
        steps = self.session.steps
        self._tool = next((s.tool for s in steps if s.tool is not None), None)
        blade = next((s.blade for s in steps if s.blade is not None), None)
        self._at = {
            "tool": np.zeros(3) if self._tool is None else self._tool.point,
            "blade": np.zeros(3) if blade is None else blade.position,
        }
        self._turn = None if blade is None else blade.orientation
        self._time, self._count = 0.0, 0
        self.session.prepare(self._sample())
        self._observation = self._observe(self.session.step(self._sample()))
        return self._observation, {}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Observation, reward, whether the session has ended, whether the episode has, and info."""
        self._revive()
        assert self.session is not None
        move = np.asarray(action, dtype=np.float64)
        if not self.action_space.contains(move):
            raise InputError(f"action: {move.tolist()}; allowed: {self.action_space.shape[0]} numbers from -1 to 1")
        self._actions.append(move.copy())
        o = self._options
        low, high = self.session.domain.bounds
        for k, name in enumerate(o["holds"]):
            target = self._at[name] + o["speed"] * o["time_step"] * move[3 * k : 3 * k + 3]
            self._at[name] = np.clip(target, low - o["margin"], high + o["margin"])
        self._count += 1
        self._time = self._count * o["time_step"]
        before, info, ended = self._observation, dict[str, Any](), False
        try:
            result = self.session.step(self._sample())
        except (InputError, NumericalError) as error:
            info["error"], ended = str(error), True
            after = before | {"time": np.array([self._time])}
        else:
            after = self._observe(result)
            if result.cut is not None and result.cut["refused"]:
                info["refused"] = result.cut["reason"]
        self._observation = after
        reward = 0.0 if o["reward"] is None else float(o["reward"](before, move, after, info))
        return after, reward, ended, self._count >= o["most_steps"], info

    def render(self) -> None:
        """Nothing: session.surface() has what there is to see."""

    def close(self) -> None:
        self.session = None

    def _sample(self) -> Step:
        shape = self.scenario.tool
        tool = None if shape is None or self._tool is None else shape.pose_at(self._at["tool"], self._tool.axis)
        blade = None if self._turn is None else BladePose(self._time, self._at["blade"], self._turn)
        return Step(self._time, tool, blade)

    def _observe(self, result: StepResult) -> Observation:
        cut = result.cut or {}
        seen = {
            "time": np.array([result.time]),
            "tool_force": result.force,
            "blade_force": result.blade_force,
            "tool_torque": result.torque,
            "blade_torque": result.blade_torque,
            "tool_position": np.array(self._at["tool"]),
            "blade_position": np.array(self._at["blade"]),
            "cut_area": np.array([cut.get("area_m2", 0.0)]),
            "front_length": np.array([cut.get("front_m", 0.0)]),
            "pieces": np.array([float(cut.get("pieces", 1))]),
            "opening": np.array([cut.get("opening_m", 0.0)]),
        }
        if self._options["places"] > 0:
            seen["release"] = self._along_front()
        return seen

    def _along_front(self) -> Array:
        """G at places evenly along the front of the cut that the body follows."""
        assert self.session is not None
        places = int(self._options["places"])
        try:
            states = self.session.front_states()
        except NumericalError:  # a front too short for the nodes
            return np.zeros(places)
        if not states:
            return np.zeros(places)
        values = np.array([s.release for s in states])
        release: Array = np.interp(np.linspace(0, len(values) - 1, places), np.arange(len(values)), values)
        return release

    def _revive(self) -> None:
        """A copy goes through the actions of the original."""
        if self.session is not None:
            return
        if self._seed is None:
            raise InputError("step: before reset; allowed: after it")
        actions = self._actions
        self.reset(seed=self._seed)
        for action in actions:
            self.step(action)

    def __getstate__(self) -> dict[str, Any]:
        return {"scenario": self.scenario, "options": self._options, "seed": self._seed, "actions": self._actions}

    def __setstate__(self, state: dict[str, Any]) -> None:
        options = dict(state["options"])
        self.__init__(state["scenario"], **options)  # type: ignore[misc]
        self._seed, self._actions = state["seed"], state["actions"]


def _work(pipe: Any, make: Callable[[], CuttingEnv]) -> None:
    """The life of a worker: an environment that is reset when its episode ends."""
    env = make()
    try:
        while True:
            what, given = pipe.recv()
            try:
                if what == "close":
                    break
                if what == "reset":
                    answer: Any = env.reset(seed=given)
                else:
                    observation, reward, ended, truncated, info = env.step(given)
                    if ended or truncated:
                        info["last_observation"] = observation
                        observation, _ = env.reset()
                    answer = (observation, reward, ended, truncated, info)
                pipe.send(("ok", answer))
            except Exception as error:
                pipe.send(("error", error))
    except (EOFError, KeyboardInterrupt):
        pass


class ParallelEnvs:
    """Many environments at once, each in a worker process. One whose episode ends is reset by itself: the observation is
    then the first of the next episode, and ``infos[i]["last_observation"]`` the last of the one before."""

    def __init__(self, makers: Sequence[Callable[[], CuttingEnv]]) -> None:
        """makers: functions that make an environment; they are pickled (functools.partial(CuttingEnv, ...) is)."""
        if not makers:
            raise InputError("makers: none; allowed: at least one")
        context = multiprocessing.get_context("spawn")  # a fork would take over threads and locks of the libraries
        self._pipes, self._workers = [], []
        for make in makers:
            ours, theirs = context.Pipe()
            worker = context.Process(target=_work, args=(theirs, make), daemon=True)
            worker.start()
            theirs.close()
            self._pipes.append(ours)
            self._workers.append(worker)

    def __len__(self) -> int:
        return len(self._pipes)

    def _ask(self, what: str, given: Sequence[Any]) -> list[Any]:
        for pipe, one in zip(self._pipes, given):
            pipe.send((what, one))
        answers = [pipe.recv() for pipe in self._pipes]
        for status, answer in answers:
            if status == "error":
                raise answer
        return [answer for _, answer in answers]

    def reset(self, *, seed: Optional[int] = None) -> tuple[Observation, list[dict[str, Any]]]:
        """Environment i gets seed + i. Observations are stacked, (environments, ...)."""
        answers = self._ask("reset", [None if seed is None else seed + i for i in range(len(self))])
        return _stacked([observation for observation, _ in answers]), [info for _, info in answers]

    def step(self, actions: Any) -> tuple[Observation, Array, npt.NDArray[Any], npt.NDArray[Any], list[dict[str, Any]]]:
        """actions: (environments, ...). Returns stacked observations, rewards, ended, truncated, and the infos."""
        if len(actions) != len(self):
            raise InputError(f"actions: {len(actions)} of them; allowed: {len(self)}")
        answers = self._ask("step", list(actions))
        observations, rewards, ended, truncated, infos = zip(*answers)
        return _stacked(observations), np.array(rewards), np.array(ended), np.array(truncated), list(infos)

    def close(self) -> None:
        for pipe, worker in zip(self._pipes, self._workers):
            if worker.is_alive():
                try:
                    pipe.send(("close", None))
                except (BrokenPipeError, OSError):
                    pass
        for worker in self._workers:
            worker.join()

    def __enter__(self) -> "ParallelEnvs":
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()


def _stacked(observations: Sequence[Observation]) -> Observation:
    return {name: np.stack([one[name] for one in observations]) for name in observations[0]}
