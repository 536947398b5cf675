"""A material from a law that is a Python function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ._core import InputError, Material

_TOLERANCE = 1e-8  # of the largest stress

# Three stretches, three shears, and strains that mix them: what is not linear or not isotropic shows in these.
_TURN = np.linalg.qr(np.array([[0.4, -0.7, 0.2], [0.9, 0.1, -0.5], [0.3, 0.8, 0.6]]))[0]


def _probes() -> list[npt.NDArray[np.float64]]:
    probes = []
    for i in range(3):
        for j in range(i, 3):
            strain = np.zeros((3, 3))
            strain[i, j] = strain[j, i] = 1e-3
            probes += [strain, -strain, 0.1 * strain, _TURN @ strain @ _TURN.T]
    return probes + [sum(probes[::4])]


def material_of_law(
    law: Callable[[npt.NDArray[np.float64]], npt.ArrayLike], density: float = 1060.0
) -> Material:
    """The material that a law describes.

    law: stress (3, 3), Pa, of a small strain (3, 3), symmetric. It is called 25 times here, with strains of 1e-3, and never again.
    The solvers know isotropic linear elasticity: sigma = lambda tr(eps) 1 + 2 mu eps is fitted to what the law says.

    Raises InputError where the law differs from the fit by more than 1e-8 of its largest stress, with the strain at which it differs
    most; where a stress has another shape or is not finite; and where E or nu are out of the range of Material.
    """
    strains = _probes()
    stresses = []
    for strain in strains:
        said = law(strain.copy())
        try:
            stress = np.asarray(said, dtype=float)
        except (TypeError, ValueError) as error:
            raise InputError(f"the law gives {said!r}, which is no array of numbers") from error
        if stress.shape != (3, 3):
            raise InputError(f"the law gives an array of shape {stress.shape}; a stress has (3, 3)")
        if not np.isfinite(stress).all():
            raise InputError(f"the law gives a stress that is not finite at the strain {strain.tolist()}")
        stresses.append(stress)
    traces = np.concatenate([np.trace(strain) * np.eye(3).ravel() for strain in strains])
    twice = np.concatenate([2 * strain.ravel() for strain in strains])
    told = np.concatenate([stress.ravel() for stress in stresses])
    (lame, shear), *_ = np.linalg.lstsq(np.stack([traces, twice], axis=1), told, rcond=None)
    differences = [
        np.abs(stress - lame * np.trace(strain) * np.eye(3) - 2 * shear * strain).max()
        for strain, stress in zip(strains, stresses)
    ]
    worst, largest = int(np.argmax(differences)), np.abs(told).max()
    if differences[worst] > _TOLERANCE * largest:
        raise InputError(
            f"the law is not linear and isotropic: at the strain {strains[worst].tolist()} its stress is "
            f"{differences[worst]:.3g} Pa from lambda = {lame:.6g} Pa, mu = {shear:.6g} Pa; at most "
            f"{_TOLERANCE * largest:.3g} Pa may be missing"
        )
    if not (shear > _TOLERANCE * abs(lame) and lame + shear > 0):
        raise InputError(f"the law has lambda = {lame:.6g} Pa, mu = {shear:.6g} Pa; allowed: mu and lambda + mu above 0")
    return Material(shear * (3 * lame + 2 * shear) / (lame + shear), lame / (2 * (lame + shear)), density)
