"""Tables and JSON of a run, written and read, and numbers as a reader wants them."""

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import from_json

from fdnet.case.tables import M2_PER_MD
from fdnet.errors import CaseError, Doubt
from fdnet.files import replacing, write_text
from fdnet.network.flow.flow import INLET, OUTLET, open_links
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array

if TYPE_CHECKING:
    import pandas as pd

    from fdnet.network.flow.sections import Layers
    from fdnet.network.permeability import Analysis

MILLIDARCY = M2_PER_MD
"""One millidarcy in m2: a darcy is 1 cP cm/s under 1 atm/cm (API RP 27, 1952)."""


def in_millidarcy(permeability: Any) -> str:
    """Permeability in m2 as mD with four digits and without a unit; a dash for None or NaN."""
    if permeability is None or permeability != permeability:
        return "–"
    value = float(f"{permeability / MILLIDARCY:.4g}")
    return f"{value:,.10g}" if value == 0 or abs(value) >= 1e-3 else f"{value:.3e}"


def percent(share: float | None) -> str:
    """A share in percent with one digit and without a sign of percent; a dash for None."""
    return "–" if share is None else f"{100 * share:z.1f}"


def two_digits(share: float) -> str:
    """A share in percent with two digits and the sign of percent."""
    digits = ".2g" if share < 0.99 else ".1f" if share < 1.0 else ".0f"  # 99.7 % is not all
    return f"{100 * share:{digits}} %"


def millimetres(length: float | None) -> str:
    """A length in m as mm with three digits and the unit; a dash for None."""
    return "–" if length is None else f"{1e3 * length:.3g} mm"


SHOWS = {
    "bridges": "holds the fines: the face plugged",
    "passes": "lets the fines pass",
    "undecided": "ended before one could see whether the sand holds the fines",
}
"""What the sand did with the fines, by `run_shows` of the summary: "The run ..."."""
AGREES = {True: "agrees", False: "disagrees", None: "not decided"}
"""Whether a rule of thumb and the run say the same."""


# ---- CSV tables and summary.json of a run folder: SI, units in the column names, nine digits.
def section_rows(analysis: "Analysis") -> list[dict[str, Any]]:
    """The sections as `sections.csv` and `summary.json` name their values."""
    return [section.row() for section in analysis.sections]


def write_rows(path: str | Path, rows: Any) -> Path:
    """A table of rows of equal keys, or of columns by their name; empty where a value is None.

    Edges of slabs and layers stand at full precision, other numbers with nine digits.
    """
    import pandas as pd

    frame = pd.DataFrame(rows)
    for edge in ("x_lo_m", "x_hi_m"):
        if edge in frame:
            frame[edge] = [repr(float(x)) for x in frame[edge]]
    with replacing(path) as part:
        frame.to_csv(part, index=False, float_format="%.9g", lineterminator="\n")
    return Path(path)


def write_sections(path: str | Path, analysis: "Analysis") -> Path:
    """One row for each section, of slabs cut out also in mD; k_reduction is empty where k is 0."""
    rows = section_rows(analysis)
    for row in rows:
        for name in ("k_initial", "k_damaged"):
            row[f"{name}_mD"] = row[f"{name}_m2"] / MILLIDARCY
    return write_rows(path, rows)


def write_profile(path: str | Path, analysis: "Analysis") -> Path:
    """One row for each bin of depth; porosity_reduction is of Shi 2011, Figure 16."""
    profile = analysis.profile
    before, after = profile.porosity_initial, profile.porosity_damaged
    columns = {
        "x_lo_m": profile.edges[:-1],
        "x_hi_m": profile.edges[1:],
        "porosity_initial": before,
        "porosity_damaged": after,
        "porosity_reduction": np.subtract(before, after),
        "fines_fraction": profile.fines_fraction,
    }
    return write_rows(path, columns)


LAYER_COLUMNS = (
    *("x_lo_m", "x_hi_m", "k_initial_m2", "k_damaged_m2"),
    *("pressure_drop_initial", "pressure_drop_damaged", "fines_count"),
)


def write_layers(path: str | Path, layers: "Layers") -> Path:
    """One row for each layer, in place; drops are over that of the specimen, or empty."""
    edges, k = layers.edges, (layers.k_initial, layers.k_damaged)
    columns = (edges[:-1], edges[1:], *k, layers.drop_initial, layers.drop_damaged)
    return write_rows(path, dict(zip(LAYER_COLUMNS, (*columns, layers.fines_count), strict=True)))


def write_pores(path: str | Path, analysis: "Analysis") -> Path:
    """One row for each pore, numbered from 0 as in `throat_conns_*`.

    `pore_share` is the part inside the specimen, `porosity` the void that grains and fines leave
    over the volume of the tetrahedron. Pressures are over the pressure drop (1 at the inlet plane,
    0 at the outlet plane), empty where a pore is cut off. `initial` is without fines, at the final
    positions of the grains where they moved.
    """
    network, fines = analysis.network, analysis.occupancy
    none = np.zeros(len(network.pore_radius))
    columns: dict[str, Any] = {
        "pore": np.arange(len(none)),
        **_split("pore_coords", network.pore_position, "_m"),
        **_split("grain", network.pore_grains),
        "pore_radius_m": network.pore_radius,
        "pore_volume_m3": network.pore_volume,
        "pore_wall_surface_m2": network.pore_wall_surface,
        "pore_share": network.pore_share,
        "fines_volume_m3": none if fines is None else fines.pore_solid_volume,
        "fines_surface_m2": none if fines is None else fines.pore_solid_surface,
        "porosity": pore_porosity(analysis),
        "pressure_initial": analysis.flow_initial.pore_pressure,
        "pressure_damaged": analysis.flow_damaged.pore_pressure,
    }
    return write_rows(path, columns)


def write_throats(path: str | Path, analysis: "Analysis") -> Path:
    """One row for each throat between two pores.

    `throat_conns_*` are rows of pores.csv (negative: beyond a face), `throat_shift_*` the number
    of periods to the second pore. Conductances are times viscosity (m3) and of the whole throat.
    Fluxes are times viscosity over the pressure drop (m3), of the part inside the specimen
    (`throat_share`), positive from `throat_conns_0` to `throat_conns_1`. `initial` is without
    fines, at the final positions of the grains where they moved.
    """
    network, fines = analysis.network, analysis.occupancy
    none = np.zeros(len(network.throat_radius))
    columns: dict[str, Any] = {
        "throat": np.arange(len(none)),
        **_split("throat_conns", network.throat_pores),
        **_split("throat_shift", np.asarray(network.throat_shift, int)),
        **_split("grain", network.throat_grains),
        "throat_radius_m": network.throat_radius,
        "throat_radius_effective_m": network.throat_radius_effective,
        "throat_area_m2": network.throat_area,
        "throat_length_m": network.throat_length,
        "throat_share": network.throat_share,
        "fines_count": none.astype(int) if fines is None else fines.throat_fines,
        "fines_volume_m3": none if fines is None else fines.throat_solid_volume,
        "fines_radius_mean_m": none if fines is None else fines.throat_fine_radius,
        "porosity": none + 1.0 if fines is None else fines.throat_porosity,
        "blocked": blocked_throats(analysis).astype(int),
        "law_used": analysis.law_used,
        "conductance_initial_m3": analysis.conductance_initial,
        "conductance_damaged_m3": analysis.conductance_damaged,
        "flux_initial_m3": analysis.flow_initial.throat_flux,
        "flux_damaged_m3": analysis.flow_damaged.throat_flux,
    }
    return write_rows(path, columns)


def plain_json(mapping: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """`mapping` as plain values and as JSON text.

    JSON has no NaN or infinity: each becomes null and a line in `warnings` names it.
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


def between_grains(network: Network, corners: Array) -> Array:
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


def _plain(value: Any, where: str, refused: list[str]) -> Any:
    """`value` as JSON knows it; NaN and infinities become None and are named in `refused`."""
    if isinstance(value, Mapping):
        start = f"{where}." if where else ""
        return {str(key): _plain(one, f"{start}{key}", refused) for key, one in value.items()}
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim):
        return [_plain(item, f"{where}[{i}]", refused) for i, item in enumerate(value)]
    if isinstance(value, np.generic | np.ndarray):
        value = value.item()
    if isinstance(value, Enum | Path):
        return value.name.lower() if isinstance(value, Enum) else str(value)
    if isinstance(value, float) and not math.isfinite(value):
        words = f"summary {where}: {value} is not a number JSON can hold; written as null"
        refused.append(Doubt("not-a-number", words))
        return None
    return value


# ---- Tables and JSON of a run folder, read back strictly.
class JsonObject(BaseModel):
    """What a JSON file must hold: its keys with their types; further keys are not looked at."""

    model_config = ConfigDict(strict=True, extra="allow", allow_inf_nan=False)


Share = Annotated[float, Field(ge=0.0, le=1.0)]
Number = Annotated[int, Field(ge=0)]
AboveZero = Annotated[float, Field(ge=0.0)]
Positive = Annotated[float, Field(gt=0.0)]
Lost = Annotated[float, Field(le=1.0)] | None


class SummarySection(JsonObject):
    """One section of a summary."""

    x_lo_m: float
    x_hi_m: float
    porosity_initial: Share
    porosity_damaged: Share
    k_initial_m2: AboveZero
    k_damaged_m2: AboveZero
    k_reduction: Lost
    fines_count: Number


class Summary(JsonObject):
    """The numbers of a summary.json that every run has."""

    case: str
    seed: Number
    law: str
    damage_law: str
    porosity_initial: Share
    porosity_damaged: Share
    k_initial_m2: AboveZero
    k_damaged_m2: AboveZero
    k_reduction: Lost
    damage_law_used: str | None = None
    damage_law_other: str | None = None
    k_damaged_other_m2: AboveZero | None = None
    supplied_count: Number
    invaded_count: Number
    passed_count: Number
    upstream_count: Number
    invasion_depth_m: AboveZero
    invasion_depth_p95_m: AboveZero
    cake_thickness_m: AboveZero
    stop_reason: str | None
    sections: list[SummarySection]
    pores: Number
    throats: Number
    throats_blocked: Number
    answer: str | None = None
    certainty: list[str] = []
    warnings: list[str]


def read_json(path: Path, model: type[JsonObject], *, noun: str, advice: str) -> dict[str, Any]:
    """The JSON object in the file at `path`, as it is written, checked by `model`.

    Raises CaseError where the file is missing, is not UTF-8 or JSON, holds NaN, or is not what
    the model says; the message names the key. `noun` is what the file should be, and `advice`
    what to do where it is not.
    """
    _refuse_missing(path, advice)
    try:
        data = from_json(path.read_bytes(), allow_inf_nan=False)
        model.model_validate(data)
    except OSError as error:
        raise CaseError(f"{path}: cannot be read ({error.strerror}); {advice}") from error
    except ValidationError as error:
        raise CaseError(
            f"{path}: cannot be understood, it is no {noun} ({_problem(error)}); {advice}"
        ) from error
    except ValueError as error:
        raise CaseError(f"{path}: cannot be read as JSON ({error}); {advice}") from error
    return data


def _refuse_missing(path: Path, advice: str) -> None:
    if not path.is_file():
        what = "is no ordinary file" if path.exists() else "is missing"
        raise CaseError(f"{path}: {what}; {advice}")


def _problem(error: ValidationError) -> str:
    """The first thing that is wrong, with the key that holds it."""
    first = error.errors(include_url=False)[0]
    key, given = ".".join(map(str, first["loc"])) or "the whole", first["input"]
    if first["type"] == "missing":
        return f"the key {key} is missing"
    shown = f" and not {given!r:.60}" if isinstance(given, str | float | None) else ""
    return f"{key}: {first['msg'][0].lower()}{first['msg'][1:]}{shown}"


def read_table(path: Path, columns: Sequence[str] = ()) -> "pd.DataFrame":
    """The CSV table at `path`, SI units as its column names say.

    Raises CaseError when it is missing or malformed, or lacks one of `columns`.
    """
    import pandas as pd

    _refuse_missing(path, _again(path))
    # every digit is read; from pandas 3 on that is the default
    exact: Any = {"float_precision": "round_trip"} if pd.__version__.startswith("2.") else {}
    try:
        table = pd.read_csv(path, **exact)
    except (OSError, ValueError) as error:
        why = f"cannot be read as a table ({str(error).strip()})"
        raise CaseError(f"{path}: {why}; {_again(path)}") from error
    if missing := [name for name in columns if name not in table.columns]:
        raise CaseError(f"{path}: has no column {', '.join(missing)}; {_again(path)}")
    return table


def empty_table(columns: Sequence[str]) -> "pd.DataFrame":
    """A table of no rows."""
    import pandas as pd

    return pd.DataFrame(columns=list(columns), dtype=float)


def read_summary(path: Path) -> dict[str, Any]:
    """The mapping of summary.json. Raises CaseError when it is missing or cannot be read."""
    return read_json(path, Summary, noun="summary of an fdnet run", advice=_again(path))


def _again(path: Path) -> str:
    folder = shlex.quote(str(path.parent))
    return f"write it anew with fdnet run CASE.toml --out {folder} --stages analyse,report --force"


# ---- The network with its conductances for OpenPNM (optional: pip install "fdnet[openpnm]").
def to_openpnm(network: Network, conductance: Array, *, viscosity: float) -> Any:
    """The part of the network that carries flow along x, as an OpenPNM network in SI units.

    fdnet holds the pressure on the two faces of the box. A throat that a face cuts therefore ends
    in a pore of its own on that face, with the conductance of the part inside. Pores of one
    `pore_group` have one pressure and are one pore. What no flow reaches is left out.

    Args:
        network: the pore network; its box is not periodic along x.
        conductance: (T,) conductance of each throat, m3 (flux times viscosity over pressure drop).
        viscosity: dynamic viscosity of the fluid, Pa s.

    Returns:
        An `openpnm.network.Network` with `pore.coords` (m), `pore.diameter` (m), `pore.volume`
        (m3), labels `pore.inlet`, `pore.outlet` and `throat.periodic`, `throat.diameter` (m),
        `throat.length` (m), `throat.hydraulic_conductance` (m3/(Pa s)), and the row numbers
        `pore.fdnet_pore` (-1 on a face) and `throat.fdnet_throat` of pores.csv and throats.csv.

    Raises:
        CaseError: OpenPNM is not installed, the network is periodic along x, or no path is open.
    """
    arrays = openpnm_arrays(network, conductance, viscosity=viscosity)
    try:
        import openpnm
    except ImportError as error:
        raise CaseError(
            'OpenPNM is not installed; install it with pip install "fdnet[openpnm]", or use '
            "pores.csv and throats.csv of the run"
        ) from error
    places, pairs = arrays.pop("pore.coords"), arrays.pop("throat.conns")
    made = openpnm.network.Network(coords=places, conns=pairs)
    for name, values in arrays.items():
        made[name] = values
    return made


def openpnm_arrays(network: Network, conductance: Array, *, viscosity: float) -> dict[str, Array]:
    """The arrays of `to_openpnm` by their OpenPNM names."""
    if network.periodic[0]:
        what = "where fdnet prescribes a pressure drop per period"
        advice = "build it with walls along x (periodic='yz')"
        raise CaseError(f"OpenPNM: the network is periodic along x, {what}; {advice}")
    if not viscosity > 0:
        raise CaseError(f"viscosity: {viscosity} Pa s, expected a number above 0")
    links = open_links(network, conductance)
    if not len(links.throat):
        raise CaseError("OpenPNM: no open path leads from the inlet to the outlet face")
    # the groups that occur are the first pores, then each end on a face, by link and place in it
    groups, faces = np.unique(links.ends[links.ends >= 0]), np.argwhere(links.ends < 0)
    conns = np.searchsorted(groups, links.ends)
    conns[*faces.T] = len(groups) + np.arange(len(faces))
    pore = np.unique(network.pore_group, return_index=True)[1][groups]
    inside, none, plane = np.zeros(len(pore), bool), np.zeros(len(faces)), links.ends[*faces.T]
    volume = np.bincount(
        network.pore_group, weights=np.maximum(network.pore_volume, 0.0) * network.pore_share
    )
    # where the throats cross the face at which they end
    link, end = faces.T
    ends, rows = network.throat_ends[links.throat[link]], np.arange(len(faces))
    here, there = ends[rows, end], ends[rows, 1 - end]
    run = here[:, 0] - there[:, 0]
    x = np.where(plane == INLET, network.box[0, 0], network.box[0, 1]) - there[:, 0]
    share = np.divide(x, run, out=np.ones(len(rows)), where=run != 0)
    crossing = there + share[:, None] * (here - there)
    return {
        "pore.coords": np.concatenate([network.pore_position[pore], crossing]),
        "throat.conns": np.sort(conns, axis=1),
        "pore.diameter": np.append(2.0 * network.pore_radius[pore], none),
        "pore.volume": np.append(volume[groups], none),
        "pore.inlet": np.append(inside, plane == INLET),
        "pore.outlet": np.append(inside, plane == OUTLET),
        "pore.fdnet_pore": np.append(pore, np.full(len(faces), -1)),
        "throat.diameter": 2.0 * network.throat_radius[links.throat],
        "throat.length": network.throat_length[links.throat],
        "throat.hydraulic_conductance": links.conductance / viscosity,
        "throat.fdnet_throat": links.throat,
        "throat.periodic": np.any(network.throat_shift[links.throat], axis=1),
    }
