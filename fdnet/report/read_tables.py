"""Tables and summary of a run folder, read back strictly."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

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


def read_table(path: Path, columns: Sequence[str], *, rows: int | None = None) -> "pd.DataFrame":
    """The CSV table at `path`, SI units as its column names say.

    Raises CaseError when it is missing or malformed, lacks one of `columns`, holds text where a
    number is expected, or has another number of rows than `rows`.
    """
    import pandas as pd

    try:
        table = pd.read_csv(path, **exact_numbers())
    except FileNotFoundError as error:
        raise _refusal(path, "is missing") from error
    except (OSError, ValueError) as error:
        raise _refusal(path, f"cannot be read as a table ({str(error).strip()})") from error
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise _refusal(path, f"has no column {', '.join(missing)}")
    for name in table.columns:
        if name not in TEXT_COLUMNS and not pd.api.types.is_numeric_dtype(table[name]):
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
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise _refusal(path, "is missing") from error
    except (OSError, ValueError, RecursionError) as error:
        raise _refusal(path, f"cannot be read as JSON ({error})") from error
    if not isinstance(summary, dict) or "k_initial_m2" not in summary:
        raise _refusal(path, "is no summary of an fdnet run")
    return summary


def _refusal(path: Path, what: str) -> CaseError:
    return CaseError(f"{path}: {what}; {_AGAIN.format(folder=path.parent)}")
