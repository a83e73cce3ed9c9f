"""The numbers in the prose on slabs of the accuracy page."""

from collections.abc import Sequence

import numpy as np

from fdnet.network.resolved.known import FEW_THROATS
from fdnet.studies.accuracy.goals import (
    Row,
    percent,
    rms,
    summary,
    summed_up,
    truth_errors,
    values,
    worst,
    worst_case,
)
from fdnet.studies.accuracy.measurement import ARCHIE, LOCAL, SIDE_KOZENY
from fdnet.studies.accuracy.slabs import ALONE, CARRYING, CHOSEN, FINEST, SOLVED
from fdnet.studies.truth.slabs import YES

COMPARED = {
    "default": CHOSEN,
    "finest": FINEST,
    "local": LOCAL,
    "archie": ARCHIE,
    "two_scale": SIDE_KOZENY,
}
"""The laws that the page compares on slabs, by their names in its prose."""
FINE_RATIOS = (8, 10)
"""Grains over fines in the names of the slabs with fine fines."""


def slab_numbers(rows: Sequence[Row]) -> dict[str, str]:
    """Every number of the prose on slabs by its name in docs/accuracy.md.in."""
    aside = [row for row in rows if row["known_before"] != YES]
    known = [row for row in rows if row["known_before"] == YES]
    parts = {"aside": aside, "known": known}
    fine = _with_fine_fines(rows)
    coarse = [row for row in rows if row not in fine]
    known_k0 = [row[f"{SIDE_KOZENY}: k0"] for row in known]
    return {
        "slabs": str(len(rows)),
        **{f"slabs_{part}": str(len(some)) for part, some in parts.items()},
        **{
            f"slabs_{part}_{key}": summary(some, name)
            for part, some in parts.items()
            for key, name in COMPARED.items()
        },
        "slabs_default_rms": percent(rms(values(aside, CHOSEN))),
        "slabs_aside_k_default": percent(rms([row[f"{CHOSEN}: k"] for row in aside])),
        "slabs_default_k0": percent(rms([row[f"{CHOSEN}: k0"] for row in rows])),
        "slabs_aside_k": percent(rms([row[f"{FINEST}: k"] for row in aside])),
        "slabs_aside_k_worst": f"{worst([row[f'{FINEST}: k'] for row in aside]):.3f}",
        "slabs_aside_k0": percent(rms([row[f"{SIDE_KOZENY}: k0"] for row in aside])),
        "slabs_default_worst": f"{worst(values(aside, CHOSEN)):.3f}",
        "slabs_default_case": worst_case(aside, CHOSEN).split(",")[0],
        "slabs_two_scale_rms": percent(rms(values(aside, SIDE_KOZENY))),
        "slabs_archie_rms": percent(rms(values(aside, ARCHIE))),
        "slabs_thesis_most": f"{max(values(rows, 'thesis + thesis')):.0f}",
        **_apart(rows),
        **_alone(rows, aside),
        "slabs_coarse": str(len(coarse)),
        "slabs_coarse_k": summed_up(row[f"{FINEST}: k"] for row in coarse),
        "slabs_fine": str(len(fine)),
        "slabs_fine_k": summed_up(row[f"{FINEST}: k"] for row in fine),
        "slabs_known_k0_mean": percent(float(np.mean(np.log(known_k0)))),
        "slabs_intact": summed_up(row[f"{SIDE_KOZENY}: k0"] for row in rows),
        "slabs_least": f"{min(row['k_over_k0'] for row in rows):.3f}",
        "slabs_most": f"{max(row['k_over_k0'] for row in rows):.2f}",
        "slabs_errors": truth_errors(rows),
    }


def _alone(rows: Sequence[Row], aside: list[Row]) -> dict[str, str]:
    """k by the network of all spheres alone, and where resolved flow takes its place."""
    parts = {
        "many": [row for row in rows if row[CARRYING] >= FEW_THROATS],
        "few": [row for row in rows if row[CARRYING] < FEW_THROATS],
        "solved": [row for row in rows if row[SOLVED]],
    }
    numbers = {"slabs_aside_alone": summary(aside, ALONE)}
    for part, some in parts.items():
        numbers |= {
            f"slabs_{part}": str(len(some)),
            f"slabs_{part}_alone": summary(some, ALONE),
            f"slabs_{part}_k": summary(some, f"{CHOSEN}: k"),
        }
    return numbers | {
        "slabs_aside_solved": str(sum(int(row[SOLVED]) for row in aside)),
        "few_throats": str(FEW_THROATS),
    }


def _apart(rows: Sequence[Row]) -> dict[str, str]:
    """rms of both laws of the network of the grains, by how far apart they are on a slab."""
    apart = [abs(np.log(row[SIDE_KOZENY] / row[ARCHIE])) for row in rows]
    numbers: dict[str, str] = {}
    for name, low, high in (("near", 0.0, 0.1), ("apart", 0.1, 0.25), ("far", 0.25, np.inf)):
        some = [row for row, one in zip(rows, apart, strict=True) if low <= one < high]
        numbers |= {
            f"slabs_{name}": str(len(some)),
            f"slabs_{name}_two_scale": percent(rms(values(some, SIDE_KOZENY)), 0),
            f"slabs_{name}_archie": percent(rms(values(some, ARCHIE)), 0),
        }
    return numbers


def _with_fine_fines(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if any(f"_r{size}" in row["case"] for size in FINE_RATIOS)]
