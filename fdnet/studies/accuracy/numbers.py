"""The numbers in the prose of the accuracy page, each computed from the tables it speaks of."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from fdnet.case.names import MOST_SPHERES, SECTION_ARCHIE
from fdnet.network.laws.named import DEFAULT_DAMAGE_LAW, DEFAULT_LAW
from fdnet.studies.accuracy.choices import CHOICES
from fdnet.studies.accuracy.deposits import BED_SHARE
from fdnet.studies.accuracy.face import face_numbers
from fdnet.studies.accuracy.full_size import full_size_numbers
from fdnet.studies.accuracy.goals import (
    ALL_SPHERES_GOAL,
    DAMAGE_GOAL,
    GOALS,
    Row,
    percent,
    rms,
    span,
    summary,
    summed_up,
    truth_errors,
    values,
    worst,
    worst_case,
)
from fdnet.studies.accuracy.measurement import ARCHIE, PAIRS, RESOLVED, SIDE_KOZENY, mean_of
from fdnet.studies.accuracy.results import Results
from fdnet.studies.accuracy.slab_numbers import slab_numbers
from fdnet.studies.accuracy.tables import KNOWN
from fdnet.studies.engine.csv_rows import read_named
from fdnet.studies.truth.cases import EQUAL, LATTICE, LOOSE, UNEQUAL

FAR = 10.0
"""Widths, in grain diameters, from which the excess of walled packs is proportional to 1/W."""
WIDE_PORES = ("A_200_eps40", "C_80_eps40", "F_80_eps45", "H_40_eps40", "I_80_eps45", "J_80_eps42")
"""Random packs of equal grains of porosity 0.40 and more."""
THESIS = PAIRS[:2]


def page_numbers(results: Results, validation: Path) -> dict[str, str]:
    """Every number of the prose by its name in docs/accuracy.md.in."""
    return {
        "default_law": DEFAULT_LAW,
        "default_damage_law": DEFAULT_DAMAGE_LAW,
        "section_law": SECTION_ARCHIE,
        "most_spheres": f"{MOST_SPHERES:,}",
        **_goals(),
        **_intact(results.intact),
        **_damaged(results.damage),
        **_deposits(results),
        **slab_numbers(results.slabs),
        **_vanishing(results.vanishing),
        **_choices(results),
        **_boundaries(validation),
        **_walls(validation),
        **face_numbers(validation),
        **full_size_numbers(validation),
    }


def _goals() -> dict[str, str]:
    whole = {
        "goal_equal_rms": GOALS[EQUAL][0],
        "goal_equal": GOALS[EQUAL][1],
        "goal_lattice": GOALS[LATTICE][1],
        "goal_unequal": GOALS[UNEQUAL][1],
        "goal_damage_rms": DAMAGE_GOAL[0],
        "goal_damage": DAMAGE_GOAL[1],
        "goal_spheres_rms": ALL_SPHERES_GOAL[0],
        "goal_spheres": ALL_SPHERES_GOAL[1],
    }
    return {name: percent(goal, 0) for name, goal in whole.items() if goal is not None}


def _intact(rows: Sequence[Row]) -> dict[str, str]:
    counted = [row for row in rows if row["group"] != LOOSE]
    packs = [row for row in rows if row["group"] in (EQUAL, UNEQUAL)]
    equal = [row for row in rows if row["group"] == EQUAL]
    lattices = [row for row in rows if row["group"] == LATTICE]
    loose = [row for row in rows if row["group"] == LOOSE]
    return {
        "errors_intact": truth_errors(counted),
        "packs": str(len(packs)),
        "lattices": str(len(lattices)),
        "off_intact": percent(_farthest(counted, DEFAULT_LAW)),
        "worst_intact": worst_case(counted, DEFAULT_LAW),
        "worst_loose": worst_case(loose, DEFAULT_LAW),
        "thesis_intact": span((row["thesis"] for row in packs), 2),
        "thesis_too_low": span((1.0 / row["thesis"] for row in packs), 1),
        "hydraulic_lattices": percent(_farthest(lattices, "hydraulic"), 0),
        "hydraulic_wide": _percents(
            row["hydraulic"] - 1.0 for row in equal if row["case"].split()[0] in WIDE_PORES
        ),
    }


def _damaged(rows: Sequence[Row]) -> dict[str, str]:
    later = [row for row in rows if row["known_before"] in KNOWN["not looked at before"]]
    thesis = [row[name] for row in rows for name in THESIS]
    absolute = [row[f"{name}: k"] for row in rows for name in THESIS]
    ratios = [row["k_over_k0"] for row in rows]
    resolved = [row for row in rows if not np.isnan(row[RESOLVED])]
    return {
        "errors_damage": truth_errors(rows),
        "deposits": str(len(rows)),
        "rms_damage": percent(rms(values(rows, SIDE_KOZENY))),
        "off_damage": percent(_farthest(rows, SIDE_KOZENY), 0),
        "worst_damage": worst_case(rows, SIDE_KOZENY),
        "later_damage": str(len(later)),
        "rms_later_damage": percent(rms(values(later, SIDE_KOZENY))),
        "off_later_damage": percent(_farthest(later, SIDE_KOZENY), 0),
        "resolved_summary": summary(list(rows), RESOLVED),
        "worst_resolved": worst_case(resolved, RESOLVED),
        "combined_summary": summed_up(map(_combined, resolved)),
        "high_resolved": percent(max(values(resolved, RESOLVED)) - 1.0, 0),
        "least_ratio": f"{min(ratios):.4f}",
        "most_ratio": f"{max(ratios):.2f}",
        "thesis_loss": span(thesis, 1),
        "thesis_most": f"{max(thesis):.0f}",
        "thesis_absolute": span(absolute, 2),
        "kozeny_fine": _of(rows, "lubrication + kozeny", ("C_r10_d8", "H_r10_d10")),
        "side_kozeny_fine": _of(rows, SIDE_KOZENY, ("C_r10_d8", "H_r10_d10")),
        "default_dense": _of(rows, SIDE_KOZENY, ("E_r5_d4",)),
        "resolved_dense": _of(rows, RESOLVED, ("E_r5_d4",)),
    }


def _combined(row: Row) -> float:
    """k/k0 by the law `combined`, over the true one."""
    whole, archie = (row["k_over_k0"] * row[name] for name in (RESOLVED, ARCHIE))
    return mean_of(1.0, whole, archie) / float(row["k_over_k0"])


def _deposits(results: Results) -> dict[str, str]:
    fifth = next(row for row in results.beds if row["ratio"] == 5)
    porosity = 1.0 - BED_SHARE
    return {
        "bed_percent": f"{100 * BED_SHARE:.0f}",
        "bed_span": span((row[SIDE_KOZENY] / row["bed"] for row in results.beds), 2),
        "bed_formula": f"{porosity / porosity**1.5:.1f}",
        "fines_a_pore": f"{fifth['fines'] / fifth['pores']:.0f}",
        "large_fine_span": span(
            (row[SIDE_KOZENY] / row[RESOLVED] for row in results.large_fines), 2
        ),
    }


def _vanishing(rows: Sequence[Row]) -> dict[str, str]:
    smallest = min(rows, key=lambda row: row["ratio"])
    return {
        "vanishing_mean": f"{100 * smallest['mean']:+.2f} %",
        "vanishing_most": percent(max(-smallest["least"], smallest["most"])),
    }


def _choices(results: Results) -> dict[str, str]:
    own, sampson, _, by_area = (
        next(row for row in results.choices if row["choice"] == name) for name in CHOICES
    )
    packs = [row["case"] for row in results.intact if row["group"] in (EQUAL, UNEQUAL)]
    pairs = zip(results.polydisperse[::2], results.polydisperse[1::2], strict=True)
    equal = [row for row in results.intact if row["group"] == EQUAL]
    refit = results.refit
    weights = [row["weight_without"] for row in refit]
    return {
        "sampson_off": _most(sampson[case] / own[case] - 1.0 for case in packs),
        "area_fcc": f"{by_area['FCC_touching']:.1f}",
        "delaunay_off": _most(
            other[DEFAULT_LAW] / power[DEFAULT_LAW] - 1.0 for power, other in pairs
        ),
        "series_shipped": summed_up(row["series"] for row in equal),
        "series_weight": f"{refit[0]['weight']:.3f}",
        "series_fitted": summed_up(row["fitted"] for row in refit),
        "series_weights": span(weights),
        "series_held_out": summed_up(row["held_out"] for row in refit),
    }


def _boundaries(validation: Path) -> dict[str, str]:
    tiled = [row for row in read_named(validation / "boundary_tiled.csv") if row["tiles"] == "2"]
    inside = [float(row["k_over_periodic"]) for row in tiled if row["cut"] == "centred inside"]
    reaching = [float(row["k_over_periodic"]) for row in tiled if row["cut"] == "reaching in"]
    slabs = read_named(validation / "boundary_slabs.csv")
    thin = [row for row in slabs if row["thickness_diameters"] == "1"]
    thick = [row for row in slabs if int(row["thickness_diameters"]) >= 4]
    mean = "mean_k_over_periodic"
    return {
        "reaching_off": _most(k - 1.0 for k in reaching),
        "walls_share": _percents(1.0 - 1.0 / k for k in inside),
        "thin_slab": _percents(float(row[mean]) - 1.0 for row in thin),
        "thin_slab_most": f"{max(float(row['most']) for row in thin):.1f}",
        "thick_slab": _most(float(row[mean]) - 1.0 for row in thick),
    }


def _walls(validation: Path) -> dict[str, str]:
    walled = read_named(validation / "boundary_walled.csv")
    truth = read_named(validation / "wall_truth.csv")
    wide = [row for row in walled if float(row["width_diameters"]) > 0.9 * FAR]
    excess = {
        kind: [
            (float(row[f"k_over_inner_{kind}"]) - 1) * float(row["width_diameters"])
            for row in wide
        ]
        for kind in ("slip", "no_slip")
    }
    return {
        "walled_porosity": f"{float(walled[0]['porosity']):.2f}",
        "inner_kozeny": f"{float(walled[-1]['inner_over_carman_kozeny']):.2f}",
        "slip_excess": span(excess["slip"], 1),
        "no_slip_excess": span(excess["no_slip"], 1),
        "no_slip_off": percent(max(abs(float(row["no_slip_over_truth"]) - 1) for row in truth)),
        "slip_off": _percents(float(row["slip_over_truth"]) - 1.0 for row in truth),
    }


def _farthest(rows: Iterable[Row], name: str) -> float:
    return abs(worst(values(rows, name)) - 1.0)


def _of(rows: Iterable[Row], name: str, cases: Sequence[str]) -> str:
    by_case = {row["case"]: row[name] for row in rows}
    return " and ".join(f"{by_case[case]:.3f}" for case in cases)


def _percents(shares: Iterable[float]) -> str:
    percents = sorted(100.0 * share for share in shares)
    return f"{percents[0]:.0f} to {percents[-1]:.0f} %"


def _most(shares: Iterable[float]) -> str:
    return percent(max(map(abs, shares)))
