"""What the tests of the Python package share. CTest sets where the build and the sources are."""

import os
from pathlib import Path

import numpy as np
import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import spherecut as sc  # noqa: E402

SOURCE = Path(os.environ["SPHERECUT_SOURCE"])
BUILD = Path(os.environ["SPHERECUT_BUILD"])
COMMAND = Path(os.environ["SPHERECUT_COMMAND"])


@pytest.fixture
def source():
    return SOURCE


@pytest.fixture
def command():
    return COMMAND


SMALL = """
title = "A ball on a small block"

[organ]
shape = "block"
size = [0.04, 0.04, 0.02]

[material]
young_modulus = 10000.0
poisson_ratio = 0.3

[[fixed]]
name = "base"
region = "box"
lower = [-0.06, -0.06, -0.001]
upper = [0.06, 0.06, 0.001]

[nodes]
fine_spacing = 0.003
coarse_spacing = 0.008

[tool]
shape = "sphere_tip"
radius = 0.006
step = 0.2

[tool.approach]
target = [0.0, 0.0, 0.02]
direction = [0.0, 0.0, -1.0]
depth = 0.002
clearance = 0.0005
duration = 1.0

[output]
figures = false
"""


@pytest.fixture
def small(tmp_path):
    """A scenario of some hundred nodes."""
    file = tmp_path / "small.toml"
    file.write_text(SMALL)
    return file


def block_nodes(spacing=0.006, size=(0.04, 0.03, 0.02), seed=1):
    half = np.array([size[0] / 2, size[1] / 2, 0.0])
    domain = sc.Domain.box(-half, half + [0, 0, size[2]], spacing)
    return domain, sc.sprinkle(domain, sc.Spacing(spacing), random_seed=seed).nodes
