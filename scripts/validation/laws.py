"""Conductance and damage laws against Stokes truth, and resolved flow on coarse grids."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.network import Network
from fdnet.network.stokes import extrapolate, solve_stokes
from validation.accuracy import FINEST, by_all_spheres, by_law, by_pair, law_of, network_of
from validation.study import Point, least_time
from validation.truth import Case, cases

TRUTH = "truth"


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """k (m2), and with fines k/k0, of the pack `seed`: by a law, on a grid, or the known one."""
    case = known_case(str(point.seed))
    if point.value == TRUTH:
        known = {"k": case.k} if case.ratio is None else {"k": case.k, "k/k0": case.ratio}
        return known | {f"{name} ±": value * case.error for name, value in known.items()}
    if point.knob == "cells":
        fine = solve_stokes(case.pack, cells=round(point.value))
        coarser = point.settings.get("coarser")
        k = fine.k
        if coarser:
            k = extrapolate(solve_stokes(case.pack, cells=round(coarser * point.value)), fine).k
        return {"k": k, "steps": float(fine.iterations)}
    return _by_law(case.name, str(point.value))


@cache
def known_case(name: str) -> Case:
    """The pack of that name with its permeability."""
    return next(cases([name]))


def _by_law(pack: str, law: str) -> dict[str, float]:
    case, (network, built) = known_case(pack), _network(pack)
    if case.ratio is None:
        k, seconds = least_time(lambda: by_law(network, law))
        return {"k": k, "core_s": built + seconds}
    if law == FINEST:
        (k, _), seconds = least_time(lambda: by_all_spheres(case.pack))
    else:
        occupancy, occupied = _occupancy(pack)
        k, seconds = least_time(lambda: by_pair(network, occupancy, law))
        seconds += built + occupied
    return {"k": k, "k/k0": k / by_law(network, law_of(law)), "core_s": seconds}


@cache
def _network(pack: str) -> tuple[Network, float]:
    return least_time(lambda: network_of(known_case(pack).pack))


@cache
def _occupancy(pack: str) -> tuple[Occupancy, float]:
    return least_time(lambda: measure_occupancy(_network(pack)[0], known_case(pack).pack.fines()))
