"""Results that only some runs have: cake, filtrate, bridging, and what the clean-up returns."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from fdnet.network.states import Sides
from fdnet.report.figures import (
    Added,
    PageTable,
    fill_bridging,
    fill_cake,
    fill_clean_up,
    fill_filtrate,
)
from fdnet.report.tables import millimetres
from fdnet.run.bridging import CLOGGED, ratio_rows
from fdnet.run.cake import (
    HALF_HOUR,
    PACKED,
    Filtration,
    cake_rows,
    cake_share,
    cake_summary,
    cake_words,
    fit_filtration,
    measure_cake,
)
from fdnet.run.clean_up import Returned, clean_up_rows, clean_up_summary
from fdnet.run.outputs import Invaded, Results

_CLEAN_UP_COLUMNS = (
    ("section", "section", "", None),
    ("x_lo_m", "from", "mm", 1e3),
    ("x_hi_m", "to", "mm", 1e3),
    ("k_initial_m2", "k intact", "m²", 1),
    ("k_damaged_m2", "k damaged", "m²", 1),
    ("k_returned_m2", "k after the clean-up", "m²", 1),
    ("damaged_k_over_k0", "k/k0 damaged", "%", 1e2),
    ("return_k_over_k0", "k/k0 after the clean-up", "%", 1e2),
    ("fines_before", "fines before", "", None),
    ("fines_left_it", "of these came out", "", None),
    ("fines_after", "fines after", "", None),
)


def added_results(
    results: Results, after: Returned | None, record: dict[str, Any] | None
) -> Iterator[Added]:
    """The added results; `record` is that of the clean-up `after` which the specimen is."""
    one = results.invasion
    if one is not None:
        yield _cake(results, one)
        yield from _filtrate(one)
        if results.analysis.invaded_count:
            yield _bridging(results, one)
    if after is not None and record is not None:
        yield _clean_up(results, after, record)


def _clean_up(results: Results, after: Returned, record: dict[str, Any]) -> Added:
    rows = clean_up_rows(results.analysis, after)
    summary = clean_up_summary(results.analysis, after, record)
    counts = summary["clean_up"]
    whole = counts["damaged_k_over_k0"], summary["return_k_over_k0"]
    said = " and ".join("no path" if share is None else f"{share:.3f}" for share in whole)
    return Added(
        name="clean_up",
        rows=rows,
        summary=summary,
        fill=partial(
            fill_clean_up,
            rows=rows,
            depths=(after.before, after.before[after.stayed]),
            whole=whole,
        ),
        caption="The clean-up: permeability of each section over that of the intact pack, after "
        "the invasion and after the flow was turned back; depth of the fines that were inside "
        "before, and of those of them that stayed.",
        page=PageTable(
            title="Clean-up",
            columns=_CLEAN_UP_COLUMNS,
            rows=rows,
            note=f"The flow was turned back. Of {counts['inside_before']} fines inside, "
            f"{counts['came_out']} came out and {counts['stayed']} stayed. k/k0 of the whole "
            f"specimen before and after: {said}. The damage law is that of the invasion.",
        ),
    )


_CAKE_COLUMNS = (
    ("x_lo_m", "from", "mm", 1e3),
    ("x_hi_m", "to", "mm", 1e3),
    ("fines_count", "fines", "", None),
    ("porosity", "porosity", "–", 1),
    ("sauter_diameter_m", "Sauter diameter", "mm", 1e3),
    ("k_network_m2", "k by the network", "mD", 1),
    ("k_kozeny_m2", "k by Carman and Kozeny", "mD", 1),
)


def _cake(results: Results, one: Invaded) -> Added:
    """The external cake by depth, and its share of the resistance."""
    case, analysis = one.case, results.analysis
    sides = Sides(periodic=case.periodic, walls=case.analysis.walls)
    cake = measure_cake(one.damaged, sides)
    pack = case.size_m[0] / analysis.k_damaged if analysis.k_damaged > 0 else np.inf
    summary = cake_summary(cake, pack, flow=cake_share(one.updates))
    if cake is None:
        return Added(name="cake", summary=summary)
    rows = cake_rows(cake)
    said = [cake_words(summary), *filter(None, [cake.unresolved])]
    return Added(
        name="cake",
        rows=rows,
        summary=summary,
        fill=partial(fill_cake, rows=rows),
        caption="The external cake in slices of a fine's diameter: porosity, and permeability by "
        "the network of its own spheres and, of packed slices, by Carman and Kozeny.",
        page=PageTable(
            title="External cake",
            columns=_CAKE_COLUMNS,
            rows=rows,
            note=f"The cake is {millimetres(cake.thickness)} thick: {'; '.join(said)}. Carman's "
            f"and Kozeny's formula is for packed beds: slices of a porosity above {PACKED:g} are "
            "loose and have a dash.",
        ),
    )


def _filtrate(one: Invaded) -> Iterator[Added]:
    """Filtrate against the root of time, where the flow follows the deposit."""
    if not one.updates or "filtrate_m3" not in one.updates[-1]:
        return
    area = one.case.size_m[1] * one.case.size_m[2]
    time = one.scales.force_factor * np.array([row["time_s"] for row in one.updates])
    volume = np.array([row["filtrate_m3"] for row in one.updates]) / area
    fit = fit_filtration(time, volume, cake_share(one.updates) or 0.0)
    if fit is None:
        return
    usable = not fit.unsupported
    yield Added(
        name="filtrate",
        summary=_filtrate_keys(fit),
        fill=partial(
            fill_filtrate,
            time=time,
            volume=volume,
            fitted=np.array([fit.volume(at) for at in time]) if usable else None,
            said=f"30 minutes by extrapolation: {1e3 * fit.half_hour:.3g} mm"
            if usable
            else "no extrapolation",
        ),
        caption="Filtrate per area of the face against the root of time. A cake that grows at "
        "constant pressure makes t quadratic in V; where the history is that, it is extrapolated "
        f"from {fit.until:.2g} s to 30 minutes."
        + (f" Here it is not: {fit.unsupported}." if not usable else ""),
    )


def _filtrate_keys(fit: Filtration) -> dict[str, Any]:
    usable = not fit.unsupported
    return {
        "spurt_m3_m2": fit.spurt if usable else None,
        "volume_30min_m3_m2": fit.half_hour if usable else None,
        "filtrate_fit": {
            "a_s_m2": fit.a,
            "b_s_m": fit.b,
            "c_s": fit.c,
            "intercept_m3_m2": fit.intercept if usable else None,
            "misfit": fit.misfit,
            "until_s": fit.until,
            "extrapolated_by": HALF_HOUR / fit.until,
            "unsupported": fit.unsupported,
        },
    }


def _bridging(results: Results, one: Invaded) -> Added:
    """Which throats the fines close, by the ratio of diameters."""
    last = one.history[-1]
    rows = ratio_rows(
        results.analysis,
        entered=last.invaded + last.passed,
        fine_diameter=2.0 * float(np.mean(one.damaged.fines().radius)),
        concentration=one.case.fines.placed_fraction,
    )
    return Added(
        name="bridging",
        rows=rows,
        fill=partial(fill_bridging, rows=rows) if rows else None,
        caption="Throats between grains, down to the depth above which 95 % of the fines lie: the "
        "share that is closed, by the ratio of the fines' diameter to that of the throat, with "
        "Wilson's 95 % band. Closed: one fine covers the whole section (blocked), or less than "
        f"{CLOGGED:g} of the conductance is left (clogged).",
    )
