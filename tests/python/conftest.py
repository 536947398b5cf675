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


def block_nodes(spacing=0.006, size=(0.04, 0.03, 0.02), seed=1):
    half = np.array([size[0] / 2, size[1] / 2, 0.0])
    domain = sc.Domain.box(-half, half + [0, 0, size[2]], spacing)
    return domain, sc.sprinkle(domain, sc.Spacing(spacing), random_seed=seed).nodes
