"""The report, and the sections that later commands add to it.

Sections that a command adds to a report after the run, in places that its page keeps.
"""

import base64
import html
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.errors import CaseError
from fdnet.files import write_text
from fdnet.report.tables import (
    AGREES,
    SHOWS,
    Checked,
    in_millidarcy,
    millimetres,
    percent,
    read_json,
    two_digits,
)

if TYPE_CHECKING:
    from jinja2 import Environment


def put_section(report: Path, name: str, section: str) -> bool:
    """Put a section into the place `name` of a page; a page without the place stays as it is.

    Returns whether the page has the place. Raises CaseError where the page is no text in UTF-8.
    """
    begin, end = f"<!-- {name} begins -->", f"<!-- {name} ends -->"
    try:
        text = report.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(
            f"{report}: cannot be read as a page ({error}), and the section on {name} is not in "
            "it; write it anew with --stages report --force (the numbers are kept)"
        ) from error
    before, has_begin, rest = text.partition(begin)
    _, has_end, after = rest.partition(end)
    if has_begin and has_end:
        write_text(report, f"{before}{begin}\n{section}\n{end}{after}")
    return bool(has_begin and has_end)


# ------------------------------------------------------------------------------------------------
# The section of the report on the mechanics of the pack; a report without it has none.


MECHANICS = "mechanics"
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


def mechanics_html(folder: Path) -> str:
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
    return put_section(report, MECHANICS, mechanics_html(folder))


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


# ------------------------------------------------------------------------------------------------
# The section of the report on resolved Stokes flow; a report without it has none.


STOKES = "stokes"
_HEAD = (
    "depth (mm)",
    "before, flow (mD)",
    "before, network (mD)",
    "after, flow (mD)",
    "after, network (mD)",
    "lost, flow",
    "lost, network",
    "cells of the flow (&micro;m)",
)
_NOTE = (
    "Resolved flow solves the Stokes equations between all spheres on two grids and needs no law "
    "of throats. The error behind &plusmn; is its own. The columns &ldquo;network&rdquo; hold "
    "what the run has. Where the two differ by more than that error, the difference is the error "
    "of the network. Cells are those of the finer grid, before and after. The damage law of the "
    "network is {}."
)


def stokes_html(rows: Sequence[Mapping[str, Any]]) -> str:
    """The section as HTML, one row for each section that was resolved."""
    head = "".join(f'<th class="number">{name}</th>' for name in _HEAD)
    body = "\n".join(f"<tr>{_cells(row)}</tr>" for row in rows)
    return (
        "<h2>Sections by resolved Stokes flow</h2>\n"
        f'<div class="scroll"><table>\n<tr>{head}</tr>\n{body}\n</table></div>\n'
        f'<p class="note">{_NOTE.format(rows[0]["network_damage_law"])}</p>'
    )


def _cells(row: Mapping[str, Any]) -> str:
    texts = [
        f"{1e3 * row['x_lo_m']:g} to {1e3 * row['x_hi_m']:g}",
        f"{in_millidarcy(row['k_initial_m2'])} &plusmn; {row['k_initial_error']:.1%}",
        in_millidarcy(row["network_k_initial_m2"]),
        f"{in_millidarcy(row['k_damaged_m2'])} &plusmn; {row['k_damaged_error']:.1%}",
        in_millidarcy(row["network_k_damaged_m2"]),
        _share(row["k_reduction"]),
        _share(row["network_k_reduction"]),
        f"{1e6 * row['cell_initial_m']:.3g}, {1e6 * row['cell_damaged_m']:.3g}",
    ]
    return "".join(f'<td class="number">{text}</td>' for text in texts)


def _share(value: float | None) -> str:
    return "&ndash;" if value is None else f"{value:.1%}"


# ------------------------------------------------------------------------------------------------
# report.html: one self-contained page of a run, its pictures inside.


DASH = "–"
LEADING, STILL = "depth.png", "spheres_3d.png"
"""The figure that stands at the top, and the one in place of the 3-D view."""
SECTION_COLUMNS = (  # key, heading, unit, factor to that unit
    ("section", "section", "", None),
    ("x_lo_m", "from", "mm", 1e3),
    ("x_hi_m", "to", "mm", 1e3),
    ("porosity_initial", "porosity intact", "–", 1),
    ("porosity_damaged", "porosity damaged", "–", 1),
    ("k_initial_m2", "k intact", "mD", 1),
    ("k_damaged_m2", "k damaged", "mD", 1),
    ("k_reduction", "k lost", "%", 1e2),
    ("k_initial_m2", "k intact", "m²", 1),
    ("k_damaged_m2", "k damaged", "m²", 1),
    ("k_initial_inplace_m2", "k intact, in place", "mD", 1),
    ("k_damaged_inplace_m2", "k damaged, in place", "mD", 1),
    ("fines_count", "fines", "", None),
    ("fines_fraction", "share of fines", "%", 1e2),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReportParts:
    """What the page shows next to the summary; everything may be left empty.

    Attributes:
        figures: path and caption of each figure.
        case_words: the case in sentences.
        view: spheres of the 3-D view (`fdnet.report.vtk.view_of`); None: a picture alone.
        case_text: the resolved case as TOML.
        scales: rows with name, symbol, value, unit, formula and source (objects or mappings).
        versions: version of each program.
        commands: the command lines as they were typed.
        tables: further tables (`fdnet.report.figures.PageTable`), in order.
        stokes: the section on resolved Stokes flow, as HTML.
        mechanics: the section on the mechanics of the pack, as HTML.
    """

    figures: Sequence[tuple[Path, str]] = ()
    case_words: Sequence[str] = ()
    view: Mapping[str, Any] | None = None
    case_text: str = ""
    scales: Sequence[Any] = ()
    versions: Mapping[str, Any] = field(default_factory=dict)
    commands: Sequence[str] = ()
    tables: Sequence[Any] = ()
    stokes: str = ""
    mechanics: str = ""


def write_report(path: str | Path, summary: Mapping[str, Any], *, parts: ReportParts) -> Path:
    """Write the page, whole or not at all.

    `summary` is the mapping of summary.json; keys that it lacks show as a dash.

    Raises CaseError for a figure that cannot be read.
    """
    template = _environment().from_string(_template_text())
    figures = [
        {"data": _data_uri(Path(file)), "caption": caption, "name": Path(file).name}
        for file, caption in parts.figures
    ]
    still = next((one for one in figures if one["name"] == STILL), None)
    first = [one for one in figures if one["name"] == LEADING]
    text = template.render(
        summary=summary,
        parts=parts,
        figures=[one for one in figures if one is not still and one not in first],
        leading=first,
        still=still,
        **_view_parts(parts.view),
        headline=headline(summary),
        columns=SECTION_COLUMNS,
    )
    return write_text(path, text)


def _view_parts(view: Mapping[str, Any] | None) -> dict[str, Any]:
    """Data and script of the 3-D view; what the page writes without escaping is made here."""
    if view is None:
        return {}
    from markupsafe import Markup

    script = resources.files("fdnet.report").joinpath("view.js").read_text(encoding="utf-8")
    return {"view_json": Markup(json.dumps(dict(view))), "view_script": Markup(script)}


def headline(summary: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """The numbers on top: label, value, remark."""
    lost, invaded, supplied = (
        summary.get(key) for key in ("k_reduction", "invaded_count", "supplied_count")
    )
    whole = [
        (
            "permeability intact",
            f"{in_millidarcy(summary.get('k_initial_m2'))} mD",
            quantity(summary.get("k_initial_m2"), "m²"),
        ),
        ("porosity intact", fixed(summary.get("porosity_initial")), "overlap counted once"),
    ]
    if summary.get("stop_reason") is None and not invaded:
        return whole
    reason, words = summary.get("stop_reason"), summary.get("words") or {}
    loss = DASH if lost is None else f"{percent(lost)} % lost"
    passed, upstream = (
        quantity(summary.get("passed_count")),
        quantity(summary.get("upstream_count")),
    )
    return [
        (
            "95 % of the fines above",
            millimetres(summary.get("invasion_depth_p95_m")),
            f"deepest {millimetres(summary.get('invasion_depth_m'))}",
        ),
        whole[0],
        (
            "permeability damaged",
            f"{in_millidarcy(summary.get('k_damaged_m2'))} mD",
            f"{quantity(summary.get('k_damaged_m2'), 'm²')}, {loss}{_other(summary)}",
        ),
        *_skin(summary),
        whole[1],
        ("porosity damaged", fixed(summary.get("porosity_damaged")), "overlap counted once"),
        (
            "fines invaded",
            quantity(invaded),
            f"of {quantity(supplied)} supplied; {passed} passed, {upstream} upstream",
        ),
        (
            "cake thickness",
            millimetres(summary.get("cake_thickness_m")),
            words.get("cake", ""),
        ),
        ("end of the run", quantity(reason), words.get("end", "")),
    ]


def _skin(summary: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Skin and the flow that it costs, where the case has a well."""
    if "skin" not in summary:
        return []
    radius = millimetres(summary.get("skin_well_radius_m"))
    value = "infinite" if summary["skin"] is None else f"{summary['skin']:.2g}"
    cost = f"{two_digits(summary['skin_flow_lost'])} of the flow"
    return [("skin", value, f"costs {cost} of a well of {radius} radius")]


def _other(summary: Mapping[str, Any]) -> str:
    """The damaged permeability by the other law, as a measure of the error."""
    other = summary.get("k_damaged_other_m2")
    if other is None:
        return ""
    return f"; by {summary.get('damage_law_other')}: {in_millidarcy(other)} mD"


def quantity(value: Any, unit: str = "") -> str:
    """A number for a reader: 4 digits, powers of ten written out, `unit` behind it.

    None and NaN become a dash.
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return DASH
    if isinstance(value, bool | str):
        return str(value)
    return f"{_digits(value)} {unit}".strip()


def fixed(value: Any) -> str:
    """A porosity: four decimals."""
    return DASH if value is None else f"{value:.4f}"


def scaled(value: Any, factor: float | None) -> Any:
    """`value` times `factor`; None stays None."""
    return value if value is None or factor is None else value * factor


def _digits(value: float) -> str:
    if isinstance(value, int) or (float(value).is_integer() and abs(value) < 1e6):
        return f"{int(value):,}".replace(",", "\u2009")
    if 1e-3 <= abs(value) < 1e6:
        return f"{value:.4g}" if abs(value) < 1e4 else f"{value:,.0f}".replace(",", "\u2009")
    if not math.isfinite(value):
        return "∞" if value > 0 else "−∞"
    mantissa, power = f"{value:.3e}".split("e")
    return f"{mantissa}·10{str(int(power)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def _environment() -> "Environment":
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(quantity=quantity, fixed=fixed, scaled=scaled)
    environment.filters.update(millidarcy=in_millidarcy, percent=percent)
    environment.globals.update(shows=SHOWS, agrees=AGREES)
    return environment


def _template_text() -> str:
    return resources.files("fdnet.report").joinpath("report.html.j2").read_text(encoding="utf-8")


def _data_uri(path: Path) -> str:
    try:
        return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
    except OSError as error:
        raise CaseError(
            f"{path}: figure for the report cannot be read ({error.strerror}); draw it again "
            "with --stages report"
        ) from error
