"""Engineering constants of a stiffness tensor (6, 6), in the order xx, yy, zz, yz, xz, xy."""

from dataclasses import dataclass

import numpy as np

from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Moduli:
    """Elastic constants of an isotropic material, Pa.

    Attributes:
        young: 9 K G / (3 K + G).
        poisson: (3 K - 2 G) / (6 K + 2 G).
        bulk: K.
        shear: G.
    """

    young: float
    poisson: float
    bulk: float
    shear: float


def voigt_average(tensor: Array) -> Moduli:
    """The isotropic material with the mean stiffness over all directions (Voigt; Hill 1952)."""
    normal, sideways = np.trace(tensor[:3, :3]), tensor[0, 1] + tensor[0, 2] + tensor[1, 2]
    bulk = float(normal + 2 * sideways) / 9
    shear = float(normal - sideways + 3 * np.trace(tensor[3:, 3:])) / 15
    return moduli(bulk, shear)


def reuss_average(tensor: Array) -> Moduli | None:
    """The one with the mean compliance over all directions; None where something yields freely."""
    if np.linalg.cond(tensor) > 1e12:
        return None
    soft = np.linalg.inv(tensor)
    normal, sideways = np.trace(soft[:3, :3]), soft[0, 1] + soft[0, 2] + soft[1, 2]
    bulk = 1 / float(normal + 2 * sideways)
    shear = 15 / float(4 * normal - 4 * sideways + 3 * np.trace(soft[3:, 3:]))
    return moduli(bulk, shear)


def moduli(bulk: float, shear: float) -> Moduli:
    """From the bulk and the shear modulus, Pa."""
    return Moduli(
        young=9 * bulk * shear / (3 * bulk + shear),
        poisson=(3 * bulk - 2 * shear) / (6 * bulk + 2 * shear),
        bulk=bulk,
        shear=shear,
    )


def anisotropy_of(tensor: Array) -> float | None:
    """5 G_V / G_R + K_V / K_R - 6: 0 when isotropic (Ranganathan and Ostoja-Starzewski 2008).

    None where the tensor has no inverse.
    """
    stiff, soft = voigt_average(tensor), reuss_average(tensor)
    if soft is None:
        return None
    return 5 * stiff.shear / soft.shear + stiff.bulk / soft.bulk - 6


def young_along(tensor: Array) -> tuple[float, ...] | None:
    """Young's modulus, Pa, of a test along x, y and z with free sides: 1 / S_ii; None as above."""
    if np.linalg.cond(tensor) > 1e12:
        return None
    return tuple(float(1 / value) for value in np.diag(np.linalg.inv(tensor))[:3])


def wave_speeds(averaged: Moduli, density: float) -> tuple[float, float]:
    """P wave sqrt((K + 4 G / 3) / rho) and S wave sqrt(G / rho), m/s, at `density` kg/m3."""
    p_wave = np.sqrt((averaged.bulk + 4 / 3 * averaged.shear) / density)
    return float(p_wave), float(np.sqrt(averaged.shear / density))
