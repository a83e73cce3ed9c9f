"""A core and a well by the model, from what a specimen hands up, with bands.

Both give numbers in SI by name, with the ends of their 95 % bands as `_low` and `_high`, rows by
place, what was `handed_up`, `warnings`, and the answer in `words`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fdnet.errors import CaseError
from fdnet.files import write_text
from fdnet.formation import model
from fdnet.formation.handed_up import HandedUp, draw_fit, hand_up
from fdnet.report.html import FORMATION, formation_html, put_section
from fdnet.report.tables import plain_json
from fdnet.run.answer import DAMAGED_FROM, flow_lost, hawkins
from fdnet.run.finished import FinishedRun
from fdnet.run.folder import locked
from fdnet.scales.flow import USUAL_WELL, api_permeability
from fdnet.statistics.bands import student_band

CELLS = 120
DEPTHS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)
"""Depths, m, at which a well gives k / k0."""
SHOTS, SHOT_LENGTH, SHOT_RADIUS = 13.0, 0.3, 0.005
"""Perforations: number a metre (4 a foot), length and radius, m."""


def core_flood(
    source: str | Path | FinishedRun,
    *,
    length: float,
    diameter: float = 0.038,
    rate: float | None = None,
    pressure: float | None = None,
    minutes: float = 30.0,
    back_flow: float = 10.0,
    sections: int = 4,
    api_filtrate: float | None = None,
) -> dict[str, Any]:
    """A core of the specimen's sand flooded with its mud; then the flow is turned back.

    Args:
        source: a run, its folder, or the folder of an ensemble.
        length, diameter: m.
        rate, pressure: m3/s, or Pa over the core and its cake; one of them.
        minutes: of the flood.
        back_flow: pore volumes that flow back, where the run had a clean-up.
        sections: equal ones, between pressure taps.
        api_filtrate: m3 in the API's test, which the permeability of the cake follows from.

    Raises:
        CaseError: an argument is not above 0, or the specimen cannot tell.

    Examples:
        >>> import fdnet
        >>> core = fdnet.core_flood("runs/quick", length=0.076, rate=1.7e-8)
        >>> 0 < core["k_over_k0"] < 1
        True
    """
    if (rate is None) == (pressure is None):
        raise CaseError("a core takes a rate or a pressure; give one of --rate and --pressure")
    _above_zero(length=length, diameter=diameter, minutes=minutes, sections=sections)
    _above_zero(rate=rate, pressure=pressure, back_flow=back_flow)
    area, taps = math.pi * diameter**2 / 4, np.linspace(0.0, length, sections + 1)
    drive = model.Flood(60 * minutes, pressure or math.nan, rate)

    def flooded(handed: HandedUp) -> dict[str, Any]:
        medium = handed.medium
        scale = 1 / (_steepest(medium) + 1 / length)
        column = model.Column(edges=model.steep_grid(length, CELLS, scale), area=area)
        made = model.march(column, medium, [drive], taps=taps)
        kept = {"k_over_k0": made.k_over_k0[-1]}
        if medium.released:
            flow = abs(float(made.rate[0]))
            seconds = back_flow * medium.porosity * area * length / flow
            forth, back = drive._replace(seconds=made.time[-1]), model.Flood(seconds, rate=-flow)
            after = model.march(column, medium, [forth, back], taps=taps)
            kept["return_k_over_k0"] = after.k_over_k0[-1]
        drops = np.cumsum(made.parts[-1, ::-1])[::-1]
        table = {"x_lo_m": taps[:-1], "x_hi_m": taps[1:], "pressure_Pa": drops[1:-1], **kept}
        return {
            **{name: float(sections / np.sum(1 / of_each)) for name, of_each in kept.items()},
            **_common(medium, column, made),
            "rate_m3_s": float(made.rate[-1]),
            "pressure_Pa": float(drops[0]),
            "effluent_over_c0": float(made.effluent[-1].sum() / medium.solids),
            "sections": pd.DataFrame(table).to_dict("records"),
        }

    found = _banded(source, flooded, api_filtrate)
    face = found["sections"][0]
    words = [
        f"A core of {1e3 * length:g} mm keeps {with_band(found, 'k_over_k0')} of its k0.",
        f"Its first {1e3 * taps[1]:.3g} mm keep {with_band(face, 'k_over_k0')}.",
    ]
    if (name := "return_k_over_k0") in face:
        words.append(
            f"After a back-flow of {back_flow:g} pore volumes they are {with_band(found, name)} "
            f"and {with_band(face, name)}."
        )
    return found | {"words": words}


def well_invasion(
    source: str | Path | FinishedRun,
    *,
    hours: float = 12.0,
    height: float = 1.0,
    pressure: float | None = None,
    radius: float | None = None,
    api_filtrate: float | None = None,
) -> dict[str, Any]:
    """A well drilled through the specimen's sand with its mud, open hole and perforated.

    The skin of the damage is integrated over the depth (`skin`) and by Hawkins; the lost flow is
    the share of the productivity; the skin of the cake counts while the cake stands.

    Args:
        source: a run, its folder, or the folder of an ensemble.
        hours: that the mud stands.
        height: m, of the well.
        pressure: Pa, overbalance; without it that of the case.
        radius: m, of the well; without it that of the case, or 108 mm.
        api_filtrate: as of `core_flood`.

    Raises:
        CaseError: an argument is not above 0, or the specimen cannot tell.

    Examples:
        >>> import fdnet
        >>> fdnet.well_invasion("runs/quick", hours=12)["skin"] > 0
        True
    """
    _above_zero(hours=hours, height=height, pressure=pressure, radius=radius)

    def drilled(handed: HandedUp) -> dict[str, Any]:
        case, medium = handed.run.case, handed.medium
        given: Any = case
        usual, outer = USUAL_WELL
        if case.well is not None:
            usual, outer = case.well.radius_m, case.well.drainage_radius_m
        well, over = radius or usual, pressure or given.fluid.overbalance_Pa
        if well >= outer:
            raise CaseError(f"radius: {well:g} m, expected below the drainage radius, {outer:g} m")
        if not over:
            raise CaseError("the case has no fluid.overbalance_MPa; give --pressure")
        drive, shots = model.Flood(3600 * hours, over), SHOTS * SHOT_LENGTH
        hole, made, loss = _around(medium, well, height, outer, drive)
        shot, _, of_shot = _around(medium, SHOT_RADIUS, height * shots, outer, drive)
        skins = model.damage_skin(hole, loss), model.damage_skin(shot, of_shot) / shots
        lost = [flow_lost(skin, well=well, drainage=outer) for skin in skins]
        zone = int(np.max(np.flatnonzero(1 / loss <= 1 - DAMAGED_FROM) + 1, initial=0))
        rings, depth = np.diff(hole.reach(hole.edges))[:zone], float(hole.edges[zone])
        ratio = float(rings.sum() / (rings @ loss[:zone])) if zone else 1.0
        found = _common(medium, hole, made)
        pores, filtrate = math.pi * medium.porosity * height, found["filtrate_m3"]
        if medium.cake_permeability:
            thin = model.cake_skin("inward", found["cake_thickness_m"], well)
            found["skin_cake"] = thin * medium.permeability / medium.cake_permeability
        left = np.interp(DEPTHS, (hole.edges[:-1] + hole.edges[1:]) / 2, 1 / loss, right=1.0)
        return {
            **found,
            "invasion_radius_m": math.sqrt(well**2 + filtrate / pores),
            "skin": skins[0],
            "skin_hawkins": hawkins(ratio, well=well, damaged=well + depth),
            "damaged_depth_m": depth,
            "flow_lost": lost[0],
            "perforated": {"skin": skins[1], "flow_lost": lost[1]},
            "k_over_k0": pd.DataFrame({"depth_m": DEPTHS, "k_over_k0": left}).to_dict("records"),
        }

    found = _banded(source, drilled, api_filtrate)
    shot = found["perforated"]
    words = [
        f"The damage is a skin of {with_band(found, 'skin')} and costs an open hole "
        f"{with_band(found, 'flow_lost')} of its productivity.",
        f"It matters where the flow has less room: perforations that met this mud ({SHOTS:g} a "
        f"metre, {1e3 * SHOT_LENGTH:g} mm long, {1e3 * SHOT_RADIUS:g} mm radius) have a skin of "
        f"{with_band(shot, 'skin')} and lose {with_band(shot, 'flow_lost')}.",
        f"In {found['time_s'] / 3600:.3g} h {with_band(found, 'filtrate_m3')} m3 of filtrate "
        f"reach a radius of {with_band(found, 'invasion_radius_m')} m.",
    ]
    return found | {"words": words}


def keep(folder: Path, name: str, found: Mapping[str, Any], given: Mapping[str, Any]) -> None:
    """Keep the numbers and the fit in `formation` below the folder, and in its report."""
    out, report = folder / FORMATION, folder / "report.html"
    with locked(folder):
        out.mkdir(exist_ok=True)
        write_text(out / f"{name}.json", plain_json({"given": given, **found})[1] + "\n")
        draw_fit(hand_up(folder), out / "handed_up.svg")
        if report.is_file():
            put_section(report, FORMATION, formation_html(out))


def _around(
    medium: model.Medium, well: float, height: float, outer: float, drive: model.Flood
) -> tuple[model.Column, model.March, np.ndarray]:
    """The rock around a hole of radius `well` m as deep as fines get, its mud, and k0 / k (J,)."""
    slowest = min((one.rate for one in medium.mud if one.rate > 0), default=1.0)
    edges = model.steep_grid(min(outer - well, 20 / slowest), CELLS, 1 / (_steepest(medium) + 1))
    area = 2 * math.pi * well * height
    column = model.Column(edges=edges, area=area, well=well, outer=outer - well)
    made = model.march(column, medium, [drive])
    return column, made, medium.loss(made.end.deposit.sum(axis=0))


def _steepest(medium: model.Medium) -> float:
    """Rate of filtration at the face when it closes, 1/m."""
    return max(one.rate * (1 + max(one.growth, 0.0) * medium.closing) for one in medium.mud)


_STOPPED = {
    "": "",
    "closed": "the numbers are those of the time when the face had the deposit of the run's end, "
    "for no cake is known; give --api-filtrate",
    "full": "the cake of these fines alone fills the hole: the numbers are those of that time. "
    "A mud that has finer solids too holds back its filtrate; give --api-filtrate",
}


def _common(medium: model.Medium, column: model.Column, made: model.March) -> dict[str, Any]:
    thick = made.end.cake.sum() / ((1 - medium.cake_porosity) * column.area)
    return {
        "time_s": float(made.time[-1]),
        "closed_at_s": made.closed_at,
        "filtrate_m3": float(made.filtrate[-1]),
        "cake_thickness_m": float(thick),
        "stopped": _STOPPED[made.stopped],
    }


def _values(medium: model.Medium) -> dict[str, float | None]:
    """The fitted numbers by name, SI; of several classes each with the name of its class."""
    found = dict[str, float | None]()
    for one in medium.mud:
        end = f"_{one.name}" if len(medium.mud) > 1 else ""
        found |= {f"rate_1_m{end}": one.rate, f"growth{end}": one.growth}
    found |= {"closing_deposit": medium.closing, "damage": medium.damage}
    return found | {"cake_permeability_m2": medium.cake_permeability}


def _banded(
    source: str | Path | FinishedRun,
    by_model: Callable[[HandedUp], dict[str, Any]],
    api_filtrate: float | None,
) -> dict[str, Any]:
    """What the model gives for all that is handed up, with bands: of seeds, or of the fits."""
    _above_zero(api_filtrate=api_filtrate)
    many = [one._replace(medium=_caked(one.medium, api_filtrate)) for one in hand_up(source)]
    seeds = len({one.run.path for one in many})
    found = _merged([by_model(one) | {"handed_up": _values(one.medium)} for one in many], seeds)
    notes = [note for one in many for note in one.notes] + [found.pop("stopped")]
    return found | {"seeds": seeds, "warnings": [note for note in dict.fromkeys(notes) if note]}


def _caked(mud: model.Medium, api_filtrate: float | None) -> model.Medium:
    if api_filtrate is None:
        return mud
    given = {"viscosity": mud.viscosity, "solids": mud.solids, "porosity": mud.cake_porosity}
    return replace(mud, cake_permeability=api_permeability(api_filtrate, **given))


def _merged(trees: Sequence[Any], seeds: int) -> Any:
    """The first of the trees, a number that differs between them with its band.

    The first is that of a single run, and the mean takes its place where there are several.
    """
    first = trees[0]
    if isinstance(first, list):
        return [_merged(row, seeds) for row in zip(*trees, strict=False)]
    if not isinstance(first, Mapping):
        return first
    result: dict[str, Any] = {}
    for key, value in first.items():
        values = [tree[key] for tree in trees if key in tree]
        if not isinstance(value, float) or None in values or np.allclose(values, value, 1e-9, 0):
            result[key] = _merged(values, seeds)
            continue
        low, high = np.percentile(values, (2.5, 97.5)).tolist()
        if seeds > 1:
            band = student_band(values)
            value, low, high = band.mean, band.low, band.high
        result |= {key: value, f"{key}_low": low, f"{key}_high": high}
    return result


def with_band(row: Mapping[str, Any], key: str) -> str:
    """The number of a row with its band; a share in percent."""
    share = key.endswith(("_over_k0", "_lost"))
    values = [row[key], row.get(f"{key}_low"), row.get(f"{key}_high")]
    one, *band = (None if v is None else f"{100 * v:.3g}" if share else f"{v:.3g}" for v in values)
    unit = " %" if share else ""
    return f"{one}{unit}" if None in band else f"{one}{unit} ({band[0]} to {band[1]}{unit})"


def _above_zero(**given: float | None) -> None:
    for name, value in given.items():
        if value is not None and not 0 < value < math.inf:
            raise CaseError(f"{name}: {value:g}, expected a number above 0")
