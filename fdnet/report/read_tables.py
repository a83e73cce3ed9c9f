"""Tables and JSON of a run folder, read back strictly."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import from_json

from fdnet.errors import CaseError
from fdnet.spheres.dump import exact_numbers

if TYPE_CHECKING:
    import pandas as pd

_EDGES = ("x_lo_m", "x_hi_m", "porosity_initial", "porosity_damaged")
COLUMNS: Mapping[str, tuple[str, ...]] = {
    "sections": (
        "section",
        *_EDGES,
        "k_initial_m2",
        "k_damaged_m2",
        "k_reduction",
        "k_initial_inplace_m2",
        "k_damaged_inplace_m2",
        "fines_count",
        "fines_fraction",
    ),
    "profile": (*_EDGES, "porosity_reduction", "fines_fraction"),
    "layers": (
        "x_lo_m",
        "x_hi_m",
        "k_initial_m2",
        "k_damaged_m2",
        "pressure_drop_initial",
        "pressure_drop_damaged",
        "fines_count",
    ),
    "pores": (
        "pore",
        "pore_coords_0_m",
        "pore_coords_1_m",
        "pore_coords_2_m",
        "pore_radius_m",
        "pore_volume_m3",
        "pressure_initial",
        "pressure_damaged",
    ),
    "throats": (
        "throat",
        "throat_conns_0",
        "throat_conns_1",
        "throat_radius_m",
        "throat_length_m",
        "blocked",
        "law_used",
        "conductance_initial_m3",
        "conductance_damaged_m3",
        "flux_initial_m3",
        "flux_damaged_m3",
    ),
}
"""Columns that a table of a run must have; further ones are read too."""
HISTORY_COLUMNS = ("chunk", "step", "upstream", "invaded", "passed")
TEXT_COLUMNS = ("law_used",)
_AGAIN = "write it anew with fdnet run CASE.toml --out {folder} --stages analyse,report --force"


class Checked(BaseModel):
    """What a JSON file must hold: its keys with their types; further keys are not looked at."""

    model_config = ConfigDict(strict=True, extra="allow", allow_inf_nan=False)


Share = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=0)]
AboveZero = Annotated[float, Field(ge=0.0)]
Lost = Annotated[float, Field(le=1.0)] | None


class Section(Checked):
    """One section of a summary."""

    x_lo_m: float
    x_hi_m: float
    porosity_initial: Share
    porosity_damaged: Share
    k_initial_m2: AboveZero
    k_damaged_m2: AboveZero
    k_reduction: Lost
    fines_count: Count


class Summary(Checked):
    """The numbers of a summary.json that every run has."""

    case: str
    seed: Count
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
    supplied_count: Count
    invaded_count: Count
    passed_count: Count
    upstream_count: Count
    invasion_depth_m: AboveZero
    invasion_depth_p95_m: AboveZero
    cake_thickness_m: AboveZero
    stop_reason: str | None
    sections: list[Section]
    pores: Count
    throats: Count
    throats_blocked: Count
    answer: str | None = None
    certainty: list[str] = []
    warnings: list[str]


def read_json(path: Path, model: type[Checked], *, noun: str, advice: str) -> dict[str, Any]:
    """The JSON object in the file at `path`, as it is written, checked by `model`.

    Raises CaseError where the file is missing, is not UTF-8 or JSON, holds NaN, or is not what
    the model says; the message names the key. `noun` is what the file should be, and `advice`
    what to do where it is not.
    """
    if not path.is_file():
        what = "is no ordinary file" if path.exists() else "is missing"
        raise CaseError(f"{path}: {what}; {advice}")
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


def _problem(error: ValidationError) -> str:
    """The first thing that is wrong, with the key that holds it."""
    first = error.errors(include_url=False)[0]
    key, given = ".".join(map(str, first["loc"])) or "the whole", first["input"]
    if first["type"] == "missing":
        return f"the key {key} is missing"
    shown = f" and not {given!r:.60}" if isinstance(given, str | float | None) else ""
    return f"{key}: {first['msg'][0].lower()}{first['msg'][1:]}{shown}"


def read_table(
    path: Path,
    columns: Sequence[str],
    *,
    rows: int | None = None,
    texts: Sequence[str] | None = TEXT_COLUMNS,
) -> "pd.DataFrame":
    """The CSV table at `path`, SI units as its column names say.

    `texts` are columns that may hold texts; None allows them in any. Raises CaseError when it is
    missing or malformed, lacks one of `columns`, holds text where a number is expected, or has
    another number of rows than `rows`.
    """
    import pandas as pd

    if not path.is_file():
        raise _refusal(path, "is no ordinary file" if path.exists() else "is missing")
    try:
        table = pd.read_csv(path, **exact_numbers())
    except (OSError, ValueError) as error:
        raise _refusal(path, f"cannot be read as a table ({str(error).strip()})") from error
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise _refusal(path, f"has no column {', '.join(missing)}")
    for name in table.columns:
        if (
            texts is not None
            and name not in texts
            and not pd.api.types.is_numeric_dtype(table[name])
        ):
            raise _refusal(path, f"column {name} holds a value that is no number")
    if rows is not None and len(table) != rows:
        raise _refusal(path, f"has {len(table)} rows, expected {rows} by summary.json")
    return table


def empty_table(columns: Sequence[str]) -> "pd.DataFrame":
    """A table of no rows."""
    import pandas as pd

    return pd.DataFrame({name: pd.Series(dtype=float) for name in columns})


def read_summary(path: Path) -> dict[str, Any]:
    """The mapping of summary.json. Raises CaseError when it is missing or cannot be read."""
    return read_json(path, Summary, noun="summary of an fdnet run", advice=_again(path))


def _again(path: Path) -> str:
    return _AGAIN.format(folder=shlex.quote(str(path.parent)))


def _refusal(path: Path, what: str) -> CaseError:
    return CaseError(f"{path}: {what}; {_again(path)}")
