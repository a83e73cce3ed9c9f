"""How much of a fine lies in a throat's cylinder: two planes or quadrature, and k with each."""

import math
from collections.abc import Callable, Sequence
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import quad

from fdnet.network.fines.occupancy import (
    GAUSS_POINTS,
    Pairs,
    exact_volume,
    measure_occupancy,
    two_plane_volume,
)
from fdnet.network.laws.damage import TEXT_THRESHOLD, thesis_damage
from fdnet.network.laws.named import LAWS
from fdnet.spheres.snapshot import Array
from fdnet.studies.accuracy import network_of, permeability
from fdnet.studies.engine.study import Measured, Panel, Point, Row, Study, row_of
from fdnet.studies.engine.timing import least_time
from fdnet.studies.truth.packs import read_pack, truth_folder

TWO_PLANE = "two-plane"
RATIOS = (0.05, 0.2, 0.5, 1.0, 1.5, 2.0)
POINTS = (2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 16.0, 24.0, 32.0)
QUICK_RATIOS, QUICK_POINTS = (0.2, 1.0), (4.0, 8.0, 10.0, 16.0)
PACK_POINTS = (2.0, 4.0, 6.0, 10.0, 32.0)
PACKS = {
    "fines 1/5, 5 points": "packC_r5_d5",
    "1/10, 8 points": "packC_r10_d8",
    "1/5, 20 points": "packH_r5_d20",
}
PLACES = 200
TIMED = 100_000
FAR = 50.0
SHORTEST, LONGEST = 0.2, 4.0
REFERENCE = 1e-12
"""Absolute tolerance of the reference, over the tube radius cubed."""
SHOWN = (TWO_PLANE, *(f"a/r = {ratio:g}" for ratio in (0.05, 0.2, 0.5, 2.0)))
OCCUPANCY = ("throat porosity", "throats below 0.40", "k/k0, thesis", "blocked")


def points(quick: bool) -> list[Point]:
    """Every rule for every size ratio, then in the end result on deposits."""
    ratios, orders = (QUICK_RATIOS, QUICK_POINTS) if quick else (RATIOS, POINTS)
    caps = [Point(series=TWO_PLANE, knob="a/r", value=ratio) for ratio in ratios]
    gauss = [
        Point(series=f"a/r = {ratio:g}", knob="points", value=n)
        for ratio in ratios
        for n in orders
    ]
    names = list(PACKS)[: 1 if quick else None]
    in_packs = [
        Point(series=name, knob="points", value=rule)
        for name in names
        for rule in (TWO_PLANE, *PACK_POINTS)
    ]
    return [*caps, *gauss, *in_packs]


def measure(point: Point, work: Path) -> dict[str, float]:
    """Errors of a rule over places of the sphere, or what it makes of a deposit."""
    return _in_a_pack(point) if point.series in PACKS else _in_a_tube(point)


def _in_a_tube(point: Point) -> dict[str, float]:
    capped = point.series == TWO_PLANE
    ratio = float(point.value if capped else point.series.removeprefix("a/r = "))
    volume = two_plane_volume if capped else partial(exact_volume, points=int(point.value))
    ball = 4.0 / 3.0 * math.pi * ratio**3
    errors: dict[str, float] = {}
    for where, pairs, exact in zip(
        ("inside", "ends"), sample(ratio), _references(ratio), strict=True
    ):
        off = (volume(pairs) - exact) / ball
        errors |= {
            f"largest, {where}": float(np.abs(off).max()),
            f"rms, {where}": float(np.sqrt(np.mean(off**2))),
        }
        errors[f"bias of the sum, {where}"] = float(off.sum() / (exact.sum() / ball))
    return errors | {"core_s": _seconds(volume, ratio)}


def sample(ratio: float, count: int = PLACES) -> tuple[Pairs, Pairs]:
    """Spheres of `ratio` tube radii with centres uniform where they touch the tube.

    The first ones are far from the ends of the tube, the second ones at the ends of tubes 0.2 to 4
    radii long, some of which are shorter than the sphere.
    """
    rng = np.random.default_rng(17)
    offset = (1.0 + ratio) * np.sqrt((np.arange(count) + rng.random(count)) / count)
    length = rng.permutation(np.linspace(SHORTEST, LONGEST, count))
    near_end = ratio * rng.uniform(-1, 1, count)
    near_end[::2] += length[::2]
    ones = np.ones(count)
    inside = Pairs(
        sphere=ratio * ones, offset=offset, depth=FAR * ones, tube=ones, length=2 * FAR * ones
    )
    return inside, Pairs(
        sphere=ratio * ones, offset=offset, depth=near_end, tube=ones, length=length
    )


@cache
def _references(ratio: float) -> tuple[Array, Array]:
    inside, ends = sample(ratio)
    return reference_volume(inside), reference_volume(ends)


def reference_volume(pairs: Pairs) -> Array:
    """Volume (K,) common to sphere and cylinder, by adaptive quadrature.

    The quadrature goes between the planes where the sections change from one closed form to
    another.
    """
    rows = zip(pairs.sphere, pairs.offset, pairs.depth, pairs.tube, pairs.length, strict=True)
    return np.array([_reference(*map(float, row)) for row in rows])


def _reference(sphere: float, offset: float, depth: float, tube: float, length: float) -> float:
    low, high = max(-sphere, -depth), min(sphere, length - depth)
    touching = [
        math.sqrt(max(sphere**2 - reach**2, 0.0)) for reach in (tube - offset, tube + offset)
    ]
    kinks = {sign * place for place in touching for sign in (-1.0, 1.0)}
    edges = [low, *sorted(z for z in kinks if low < z < high), high]
    section = partial(_section, sphere, offset, tube)
    return math.fsum(
        quad(section, *piece, epsabs=REFERENCE, epsrel=REFERENCE)[0] for piece in pairwise(edges)
    )


def _section(sphere: float, offset: float, tube: float, place: float) -> float:
    """Area common to the tube and the sphere's disc at `place`: two circular segments.

    Weisstein, Circle-Circle Intersection, eq. 14.
    """
    disc = math.sqrt(max(sphere**2 - place**2, 0.0))
    if offset >= disc + tube:
        return 0.0
    if offset <= abs(tube - disc):
        return math.pi * min(tube, disc) ** 2
    to_chord = (offset**2 + tube**2 - disc**2) / (2.0 * offset)
    return _segment(tube, to_chord) + _segment(disc, offset - to_chord)


def _segment(radius: float, height: float) -> float:
    """Area that a chord at `height` from the centre cuts off a circle."""
    share = min(max(height / radius, -1.0), 1.0)
    return radius**2 * math.acos(share) - height * math.sqrt(max(radius**2 - height**2, 0.0))


def _seconds(volume: Callable[[Pairs], Array], ratio: float) -> float:
    """Core seconds for 1e5 pairs with centres uniform around tubes, the least of three."""
    pairs = sample(ratio, TIMED)[1]
    return least_time(lambda: volume(pairs))[1]


def _in_a_pack(point: Point) -> dict[str, float]:
    """Mean throat porosity where there are fines, throats that clog, and k/k0 of the thesis."""
    pack = read_pack(truth_folder() / f"{PACKS[point.series]}.csv")[0]
    volume = (
        two_plane_volume
        if point.value == TWO_PLANE
        else partial(exact_volume, points=int(point.value))
    )
    network = network_of(pack)
    occupancy, seconds = least_time(
        lambda: measure_occupancy(network, pack.fines(), overlap=volume)
    )
    clean = LAWS["thesis"](network)
    damaged = thesis_damage(network, occupancy, clean).conductance
    inside = occupancy.throat_fines > 0
    values = (
        float(np.mean(occupancy.throat_porosity[inside])),
        float(np.sum(occupancy.throat_porosity[inside] < TEXT_THRESHOLD)),
        permeability(network, damaged) / permeability(network, clean),
        float(occupancy.blocked.sum()),
    )
    return dict(zip(OCCUPANCY, values, strict=True)) | {"core_s": seconds}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Errors as share of the sphere's volume; in packs over the value of the exact volumes."""
    rows = []
    for run in measured:
        if run.point.series not in PACKS:
            rows += [
                row_of(run, name, error=value, uncertainty=0.0)
                for name, value in run.observed.items()
            ]
    for series in PACKS:
        runs = [run for run in measured if run.point.series == series]
        for name in OCCUPANCY if runs else ():
            exact = next(run.observed[name] for run in runs if run.point.value == PACK_POINTS[-1])
            rows += [
                _against(run, name, exact) for run in runs if run.point.value != PACK_POINTS[-1]
            ]
    return rows


def _against(run: Measured, name: str, exact: float) -> Row:
    return row_of(
        run, name, error=(run.observed[name] - exact) / (abs(exact) or 1.0), uncertainty=0.0
    )


STUDY = Study(
    name="throat-occupancy",
    title="Volume of a fine in a throat's cylinder",
    knob_label="Gauss points",
    points=points,
    measure=measure,
    judge=judge,
    panels=(
        Panel(
            quantity="largest, inside",
            title="largest error far from the tube's ends (two-plane: labels a/r)",
            label="share of the sphere",
            series=SHOWN,
        ),
        Panel(
            quantity="largest, ends",
            title="largest error at the tube's ends (two-plane: labels a/r)",
            label="share of the sphere",
            series=SHOWN,
        ),
        Panel(
            quantity="bias of the sum, inside",
            title="bias of the sum over uniform places (two-plane: labels a/r)",
            label="relative error",
            series=SHOWN,
        ),
        Panel(
            quantity="k/k0, thesis",
            title="k/k0 of the thesis's laws, deposits",
            label="relative to exact volumes",
        ),
    ),
    defaults=dict.fromkeys(
        [*(f"a/r = {ratio:g}" for ratio in RATIOS), *PACKS], float(GAUSS_POINTS)
    ),
    isolated=False,
)
