"""CSV tables and summary.json of a run folder: SI, units in the column names, nine digits."""

import json
import math
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.files.atomic import replacing, write_text
from fdnet.report.units import millidarcy
from fdnet.spheres.snapshot import Array

if TYPE_CHECKING:
    import pandas as pd

    from fdnet.network.analysis import Analysis
    from fdnet.network.flow.depth import Layers
    from fdnet.network.network import Network

__all__ = [
    "between_grains",
    "section_rows",
    "write_laws",
    "write_layers",
    "write_pores",
    "write_profile",
    "write_sections",
    "write_summary",
    "write_throats",
]

FLOAT_FORMAT = "%.9g"


def section_rows(analysis: "Analysis") -> list[dict[str, Any]]:
    """The sections as `sections.csv` and `summary.json` name their values."""
    return [
        {
            "section": s.section,
            "x_lo_m": s.x_lo,
            "x_hi_m": s.x_hi,
            "porosity_initial": s.porosity_initial,
            "porosity_damaged": s.porosity_damaged,
            "k_initial_m2": s.k_initial,
            "k_damaged_m2": s.k_damaged,
            "k_reduction": s.k_reduction,
            "k_initial_inplace_m2": s.k_initial_inplace,
            "k_damaged_inplace_m2": s.k_damaged_inplace,
            "fines_count": s.fines_count,
            "fines_fraction": s.fines_fraction,
        }
        for s in analysis.sections
    ]


def write_sections(path: str | Path, analysis: "Analysis") -> Path:
    """One row for each section, edges at full precision; k_reduction is empty where k is 0.

    The permeabilities of the slab cut out stand in mD as well.
    """
    rows = [
        row
        | {edge: repr(float(row[edge])) for edge in ("x_lo_m", "x_hi_m")}
        | {f"k_{name}_mD": millidarcy(row[f"k_{name}_m2"]) for name in ("initial", "damaged")}
        for row in section_rows(analysis)
    ]
    return _write(path, _frame(rows))


def write_laws(path: str | Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """One row for each pair of laws: their names, permeabilities (m2) and porosities.

    Where the three directions were asked for, also `k_x_m2`, `k_x_damaged_m2` and so on.
    """
    names = (
        "law",
        "damage_law",
        "k_initial_m2",
        "k_damaged_m2",
        "k_reduction",
        "porosity_initial",
        "porosity_damaged",
        *(f"k_{axis}_m2" for axis in "xyz"),
        *(f"k_{axis}_damaged_m2" for axis in "xyz"),
    )
    kept = [name for name in names if name in rows[0]]
    return _write(path, _frame({name: [row[name] for row in rows] for name in kept}))


def write_profile(path: str | Path, analysis: "Analysis") -> Path:
    """One row for each bin of depth.

    porosity_reduction is the difference initial - damaged (Shi 2011, Figure 16).
    """
    profile = analysis.profile
    edges = [repr(float(x)) for x in profile.edges]
    return _write(
        path,
        _frame(
            {
                "x_lo_m": edges[:-1],
                "x_hi_m": edges[1:],
                "porosity_initial": profile.porosity_initial,
                "porosity_damaged": profile.porosity_damaged,
                "porosity_reduction": np.subtract(
                    profile.porosity_initial, profile.porosity_damaged
                ),
                "fines_fraction": profile.fines_fraction,
            }
        ),
    )


def write_layers(path: str | Path, layers: "Layers") -> Path:
    """One row for each layer, in place, from the network of all spheres.

    The pressure drops are over that of the specimen; empty where nothing flows.
    """
    edges = [repr(float(x)) for x in layers.edges]
    columns = {
        "x_lo_m": edges[:-1],
        "x_hi_m": edges[1:],
        "k_initial_m2": layers.k_initial,
        "k_damaged_m2": layers.k_damaged,
        "pressure_drop_initial": layers.drop_initial,
        "pressure_drop_damaged": layers.drop_damaged,
        "fines_count": layers.fines_count,
    }
    return _write(path, _frame(columns))


def write_pores(path: str | Path, analysis: "Analysis") -> Path:
    """One row for each pore, numbered from 0 as in `throat_conns_*`.

    `pore_share` is the part inside the specimen, `porosity` the void that grains and fines leave
    over the volume of the tetrahedron. Pressures are over the pressure drop (1 at the inlet plane,
    0 at the outlet plane), empty where a pore is cut off. `initial` is without fines, at the final
    positions of the grains where they moved.
    """
    network, occupancy = analysis.network, analysis.occupancy
    count = len(network.pore_radius)
    columns: dict[str, Any] = {"pore": np.arange(count)}
    columns |= _split("pore_coords", network.pore_position, "_m")
    columns |= _split("grain", network.pore_grains)
    columns |= {
        "pore_radius_m": network.pore_radius,
        "pore_volume_m3": network.pore_volume,
        "pore_wall_surface_m2": network.pore_wall_surface,
        "pore_share": network.pore_share,
        "fines_volume_m3": np.zeros(count) if occupancy is None else occupancy.pore_solid_volume,
        "fines_surface_m2": np.zeros(count) if occupancy is None else occupancy.pore_solid_surface,
        "porosity": pore_porosity(analysis),
        "pressure_initial": analysis.flow_initial.pore_pressure,
        "pressure_damaged": analysis.flow_damaged.pore_pressure,
    }
    return _write(path, _frame(columns))


def write_throats(path: str | Path, analysis: "Analysis") -> Path:
    """One row for each throat between two pores.

    `throat_conns_*` are rows of pores.csv (negative: beyond a face), `throat_shift_*` the number
    of periods to the second pore. Conductances are times viscosity (m3) and of the whole throat.
    Fluxes are times viscosity over the pressure drop (m3), of the part inside the specimen
    (`throat_share`), positive from `throat_conns_0` to `throat_conns_1`. `initial` is without
    fines, at the final positions of the grains where they moved.
    """
    network, occupancy = analysis.network, analysis.occupancy
    count = len(network.throat_radius)
    columns: dict[str, Any] = {"throat": np.arange(count)}
    columns |= _split("throat_conns", network.throat_pores)
    columns |= _split("throat_shift", np.asarray(network.throat_shift, int))
    columns |= _split("grain", network.throat_grains)
    columns |= {
        "throat_radius_m": network.throat_radius,
        "throat_radius_effective_m": network.throat_radius_effective,
        "throat_area_m2": network.throat_area,
        "throat_length_m": network.throat_length,
        "throat_share": network.throat_share,
        "fines_count": np.zeros(count, int) if occupancy is None else occupancy.throat_fines,
        "fines_volume_m3": np.zeros(count) if occupancy is None else occupancy.throat_solid_volume,
        "fines_radius_mean_m": np.zeros(count)
        if occupancy is None
        else occupancy.throat_fine_radius,
        "porosity": np.ones(count) if occupancy is None else occupancy.throat_porosity,
        "blocked": blocked_throats(analysis).astype(int),
        "law_used": analysis.law_used,
        "conductance_initial_m3": analysis.conductance_initial,
        "conductance_damaged_m3": analysis.conductance_damaged,
        "flux_initial_m3": analysis.flow_initial.throat_flux,
        "flux_damaged_m3": analysis.flow_damaged.throat_flux,
    }
    return _write(path, _frame(columns))


def write_history(path: str | Path, rows: Sequence[Mapping[str, float]]) -> Path:
    """history.csv: one row a checkpoint, with times in s and numbers of fines."""
    return _write(path, _frame(rows))


def write_rows(path: str | Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Rows of equal keys; edges of slabs at full precision, empty where a value is None."""
    edges = ("x_lo_m", "x_hi_m")
    exact = [
        {**row, **{edge: repr(float(row[edge])) for edge in edges if edge in row}} for row in rows
    ]
    return _write(path, _frame(exact))


def plain_json(mapping: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """`mapping` as plain values and as JSON text.

    JSON has no NaN or infinity: each becomes null and a line in `warnings` names it. Raises
    TypeError for values that are no numbers, texts, lists or mappings.
    """
    refused: list[str] = []
    plain = _plain(mapping, "", refused)
    if refused:
        plain["warnings"] = [*plain.get("warnings", []), *refused]
    return plain, json.dumps(plain, indent=2, allow_nan=False, ensure_ascii=False)


def write_summary(path: str | Path, summary: Mapping[str, Any]) -> dict[str, Any]:
    """Write summary.json and return what was written; see `plain_json`."""
    plain, text = plain_json(summary)
    write_text(path, text + "\n")
    return plain


def blocked_throats(analysis: "Analysis") -> Array:
    """(T,) bool; all False without fines."""
    if analysis.occupancy is None:
        return np.zeros(len(analysis.network.throat_radius), dtype=bool)
    return np.asarray(analysis.occupancy.blocked, dtype=bool)


def between_grains(network: "Network", corners: Array) -> Array:
    """Whether all `corners` (N, n), images of a throat or pore, are grains inside the box; (N,).

    The others lie at a side wall or an end face and run out to mirror images of the grains.
    """
    place, box = np.asarray(network.image_position), np.asarray(network.box)
    inside = (place >= box[:, 0]) & (place <= box[:, 1]) | np.asarray(network.periodic)
    return inside.all(axis=1)[np.asarray(corners)].all(axis=1)


def pore_porosity(analysis: "Analysis") -> Array:
    """(P,) void that grains and fines leave over the tetrahedron's volume; 0 where it is flat."""
    if analysis.occupancy is not None:
        return analysis.occupancy.pore_porosity
    void, whole = analysis.network.pore_volume, analysis.network.pore_tetra_volume
    return np.divide(void, whole, out=np.zeros(len(void)), where=whole > 0)


def _split(name: str, values: Array, unit: str = "") -> dict[str, Array]:
    """The columns of an (N, k) array as `name_0`, `name_1` ..., each with its unit."""
    return {f"{name}_{i}{unit}": column for i, column in enumerate(np.asarray(values).T)}


def _frame(columns: Any) -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame(columns)


def _write(path: str | Path, frame: "pd.DataFrame") -> Path:
    with replacing(path) as part:
        frame.to_csv(part, index=False, float_format=FLOAT_FORMAT, lineterminator="\n")
    return Path(path)


def _plain(value: Any, where: str, refused: list[str]) -> Any:
    """`value` as JSON knows it; NaN and infinities become None and are named in `refused`."""
    if isinstance(value, Mapping):
        return {
            str(key): _plain(item, f"{where}.{key}".lstrip("."), refused)
            for key, item in value.items()
        }
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim):
        return [_plain(item, f"{where}[{i}]", refused) for i, item in enumerate(value)]
    if isinstance(value, np.generic | np.ndarray):
        value = value.item()
    if isinstance(value, Enum | Path):
        return value.name.lower() if isinstance(value, Enum) else str(value)
    if isinstance(value, float) and not math.isfinite(value):
        refused.append(f"summary {where}: {value} is not a number JSON can hold; written as null")
        return None
    return value
