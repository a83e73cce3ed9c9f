"""Fines of measured sizes: which radius and density each has, and in which batch it comes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.case.particles import Fines
from fdnet.sizes.deal import dealt
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Drawn:
    """Some fines.

    Attributes:
        radius: (N,) m.
        density: (N,) kg/m3.
    """

    radius: Array
    density: Array


def drawn_fines(case: InvasionCase, counts: Sequence[int]) -> list[Drawn]:
    """Fines of measured sizes for batches of `counts`, each with the curve of the whole mud.

    All fines are drawn at once, as strata of the curve of each material, and then dealt out.
    """
    whole = _whole(case.fines, sum(counts))
    rng = np.random.default_rng([case.seed, 13])
    return [
        Drawn(radius=whole.radius[index], density=whole.density[index])
        for index in dealt(counts, rng)
    ]


def densities(case: InvasionCase, counts: Sequence[int]) -> Array:
    """(N,) density of every fine, kg/m3, in the order of their ids."""
    if not case.fines.measured:
        return np.full(sum(counts), case.fines.density_kg_m3)
    return np.concatenate([batch.density for batch in drawn_fines(case, counts)])


def _whole(fines: Fines, count: int) -> Drawn:
    """`count` fines sorted by material and size."""
    parts = list(zip(fines.components, _numbers(fines, count), strict=True))
    return Drawn(
        radius=np.concatenate([0.5 * one.curve.strata(number) for one, number in parts]),
        density=np.concatenate([np.full(number, one.density) for one, number in parts]),
    )


def _numbers(fines: Fines, count: int) -> list[int]:
    """How many of `count` fines are of each material, by the largest remainder."""
    solids = [(one, one.curve.mean(3)) for one in fines.components]
    rates = [one.share * one.curve.kept / cube for one, cube in solids]
    exact = [count * rate / sum(rates) for rate in rates]
    numbers = [int(one) for one in exact]
    missing = count - sum(numbers)
    for index in sorted(range(len(exact)), key=lambda i: numbers[i] - exact[i])[:missing]:
        numbers[index] += 1
    return numbers
