"""The section of the report on the mechanics of the pack; a report without it has none."""

import base64
import html
from pathlib import Path
from typing import Any

from fdnet.report.later_sections import put_section
from fdnet.report.read_tables import Checked, read_json

NAME = "mechanics"
_ROWS = (
    ("young_modulus_Pa", "Young's modulus", 1e-9, "GPa"),
    ("poisson_ratio", "Poisson's ratio", 1.0, ""),
    ("bulk_modulus_Pa", "bulk modulus", 1e-9, "GPa"),
    ("shear_modulus_Pa", "shear modulus", 1e-9, "GPa"),
    ("young_modulus_x_Pa", "Young's modulus along x", 1e-9, "GPa"),
    ("young_modulus_y_Pa", "Young's modulus along y", 1e-9, "GPa"),
    ("young_modulus_z_Pa", "Young's modulus along z", 1e-9, "GPa"),
    ("anisotropy", "anisotropy (0 is isotropic)", 1.0, ""),
    ("p_wave_m_s", "P wave", 1.0, "m/s"),
    ("s_wave_m_s", "S wave", 1.0, "m/s"),
    ("coordination", "contacts and bonds of a grain", 1.0, ""),
    ("rattlers", "grains that carry nothing", 1.0, ""),
    ("bonds", "bonds", 1.0, ""),
)
_TRIAXIAL_ROWS = (
    ("confining_Pa", "confining stress", 1e-6, "MPa"),
    ("young_modulus_Pa", "initial slope", 1e-9, "GPa"),
    ("peak_Pa", "largest deviatoric stress", 1e-6, "MPa"),
    ("peak_strain", "axial strain there", 100.0, "%"),
    ("volume_strain_at_end", "volume strain at the end (compression above 0)", 100.0, "%"),
    ("broken_in_tension", "bonds broken in tension", 1.0, ""),
    ("broken_in_shear", "bonds broken in shear", 1.0, ""),
)


class _Test(Checked):
    """The numbers of a triaxial test."""

    confining_Pa: float
    young_modulus_Pa: float | None
    peak_Pa: float | None
    peak_strain: float | None
    volume_strain_at_end: float | None
    broken_in_tension: int
    broken_in_shear: int


class Mechanics(Checked):
    """What mechanics.json holds."""

    young_modulus_Pa: float | None
    poisson_ratio: float | None
    bulk_modulus_Pa: float | None
    shear_modulus_Pa: float | None
    young_modulus_x_Pa: float | None
    young_modulus_y_Pa: float | None
    young_modulus_z_Pa: float | None
    anisotropy: float | None
    p_wave_m_s: float | None
    s_wave_m_s: float | None
    coordination: float | None
    rattlers: int
    bonds: int
    warnings: list[str]
    triaxial: _Test | None = None


def section_html(folder: Path) -> str:
    """The section as HTML from the files in the folder `mechanics`; "" where nothing ran.

    Raises CaseError where the numbers cannot be understood.
    """
    path = folder / "mechanics.json"
    if not path.exists():
        return ""
    advice = "measure it anew with fdnet mechanics, or remove the folder"
    numbers = read_json(path, Mechanics, noun="result of fdnet mechanics", advice=advice)
    parts = ["<h2>Mechanics of the pack</h2>", _table(numbers, _ROWS)]
    if numbers.get("warnings"):
        items = "".join(f"<li>{html.escape(text)}</li>" for text in numbers["warnings"])
        parts.append(f'<div class="warnings"><ul>{items}</ul></div>')
    if numbers.get("triaxial"):
        parts += ["<h3>Triaxial test</h3>", _table(numbers["triaxial"], _TRIAXIAL_ROWS)]
    figure = folder / "stress_strain.png"
    if numbers.get("triaxial") and figure.is_file():
        data = base64.b64encode(figure.read_bytes()).decode("ascii")
        parts.append(
            f'<figure class="wide"><img src="data:image/png;base64,{data}" alt="{figure.stem}">'
            f"<figcaption><em>({figure.name})</em></figcaption></figure>"
        )
    return "\n".join(parts)


def put_mechanics(report: Path, folder: Path) -> bool:
    """Put the section into a report that is written; whether it has the place for it."""
    return put_section(report, NAME, section_html(folder))


def _table(numbers: dict[str, Any], rows: tuple[tuple[str, str, float, str], ...]) -> str:
    cells = [
        f'<tr><th>{html.escape(name)}</th><td class="number">{_shown(numbers[key], factor)} '
        f"{unit}</td></tr>"
        for key, name, factor, unit in rows
        if key in numbers
    ]
    return '<table class="pairs">\n' + "\n".join(cells) + "\n</table>"


def _shown(value: float | None, factor: float) -> str:
    return "–" if value is None else f"{value * factor:.4g}"
