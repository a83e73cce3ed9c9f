"""The page report.html of a run, and the sections that later commands add to it."""

import base64
import html
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from fdnet.errors import CaseError
from fdnet.files import write_text
from fdnet.report.tables import AGREES, SHOWS, JsonObject, in_millidarcy, percent, read_json
from fdnet.report.text import facts


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


# ---- The section of the report on the mechanics of the pack; a report without it has none.
MECHANICS = "mechanics"


class Line(NamedTuple):
    """A number of a table of two columns: its name, the unit, and the factor to it."""

    name: str
    unit: str = ""
    factor: float = 1.0


class _Test(JsonObject):
    """The numbers of a triaxial test."""

    confining_Pa: Annotated[float, Line("confining stress", "MPa", 1e-6)]
    young_modulus_Pa: Annotated[float | None, Line("initial slope", "GPa", 1e-9)]
    peak_Pa: Annotated[float | None, Line("largest deviatoric stress", "MPa", 1e-6)]
    peak_strain: Annotated[float | None, Line("axial strain there", "%", 100.0)]
    volume_strain_at_end: Annotated[
        float | None, Line("volume strain at the end (compression above 0)", "%", 100.0)
    ]
    broken_in_tension: Annotated[int, Line("bonds broken in tension")]
    broken_in_shear: Annotated[int, Line("bonds broken in shear")]


class Mechanics(JsonObject):
    """What mechanics.json holds."""

    young_modulus_Pa: Annotated[float | None, Line("Young's modulus", "GPa", 1e-9)]
    poisson_ratio: Annotated[float | None, Line("Poisson's ratio")]
    bulk_modulus_Pa: Annotated[float | None, Line("bulk modulus", "GPa", 1e-9)]
    shear_modulus_Pa: Annotated[float | None, Line("shear modulus", "GPa", 1e-9)]
    young_modulus_x_Pa: Annotated[float | None, Line("Young's modulus along x", "GPa", 1e-9)]
    young_modulus_y_Pa: Annotated[float | None, Line("Young's modulus along y", "GPa", 1e-9)]
    young_modulus_z_Pa: Annotated[float | None, Line("Young's modulus along z", "GPa", 1e-9)]
    anisotropy: Annotated[float | None, Line("anisotropy (0 is isotropic)")]
    p_wave_m_s: Annotated[float | None, Line("P wave", "m/s")]
    s_wave_m_s: Annotated[float | None, Line("S wave", "m/s")]
    coordination: Annotated[float | None, Line("contacts and bonds of a grain")]
    rattlers: Annotated[int, Line("grains that carry nothing")]
    bonds: Annotated[int, Line("bonds")]
    warnings: list[str]
    triaxial: _Test | None = None


def mechanics_html(folder: Path) -> str:
    """The section as HTML from the files in the folder `mechanics`; "" where nothing ran."""
    path = folder / "mechanics.json"
    if not path.exists():
        return ""
    advice = "measure it anew with fdnet mechanics, or remove the folder"
    numbers = read_json(path, Mechanics, noun="result of fdnet mechanics", advice=advice)
    figure, tested = folder / "stress_strain.png", numbers.get("triaxial")
    return page_text(
        "report/mechanics.html.j2",
        elastic=_values(numbers, Mechanics),
        warnings=numbers.get("warnings") or [],
        triaxial=_values(tested, _Test) if tested else [],
        figure=shown_figure(figure, figure.stem) if tested and figure.is_file() else None,
    )


def put_mechanics(report: Path, folder: Path) -> bool:
    """Put the section into a report that is written; whether it has the place for it."""
    return put_section(report, MECHANICS, mechanics_html(folder))


def _values(numbers: dict[str, Any], model: type[JsonObject]) -> list[tuple[str, str]]:
    """Name and text of the numbers that have a `Line` in the model."""
    return [
        (one.name, quantity(multiplied(numbers[key], one.factor), one.unit))
        for key, known in model.model_fields.items()
        for one in known.metadata
        if isinstance(one, Line)
    ]


# ---- The section of the report on a core and a well; a report without it has none.
FORMATION = "formation"


class _ScaledUp(JsonObject):
    """What core.json and well.json say in words."""

    words: list[str]
    warnings: list[str]


def formation_html(folder: Path) -> str:
    """The section as HTML from the files in the folder `formation`; "" where nothing was asked."""
    found, notes, advice = [], list[str](), "call fdnet core or fdnet well again"
    for name, noun in (("well", "A well"), ("core", "A core")):
        if (path := folder / f"{name}.json").is_file():
            one = read_json(path, _ScaledUp, noun=f"result of fdnet {name}", advice=advice)
            found.append((noun, one["words"]))
            notes += one["warnings"]
    if not found:
        return ""
    figure, caption = folder / "handed_up.svg", "the fit over the profile that it comes from"
    return page_text(
        "report/formation.html.j2",
        found=found,
        notes=list(dict.fromkeys(notes)),
        figure=shown_figure(figure, caption) if figure.is_file() else None,
    )


# ---- The section of the report on resolved Stokes flow; a report without it has none.
STOKES = "stokes"


def stokes_html(rows: Sequence[Mapping[str, Any]]) -> str:
    """The section as HTML, one row for each section that was resolved."""
    return page_text("report/stokes.html.j2", rows=rows)


# ---- report.html: one self-contained page of a run, its pictures inside.
DASH = "–"
LEADING, STILL = "depth.svg", "spheres_3d.png"
"""The figure that stands at the top, and the picture of the specimen."""
SECTION_COLUMNS = (  # key, heading, unit, factor to that unit
    ("section", "section", "", None),
    ("x_lo_m", "from", "mm", 1e3),
    ("x_hi_m", "to", "mm", 1e3),
    ("porosity_initial", "porosity intact", "–", 1),
    ("porosity_damaged", "porosity damaged", "–", 1),
    ("k_initial_m2", "k intact", "mD", 1),
    ("k_damaged_m2", "k damaged", "mD", 1),
    ("k_reduction", "k lost", "%", 1e2),
    ("k_initial_inplace_m2", "k intact, in place", "mD", 1),
    ("k_damaged_inplace_m2", "k damaged, in place", "mD", 1),
    ("fines_count", "fines", "", None),
    ("fines_fraction", "share of fines", "%", 1e2),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReportParts:
    """What the page shows next to the summary; everything may be left empty.

    Figures with their captions, the case in sentences and as TOML, rows of the scales, the
    version of each program, the command lines as they were typed, further tables
    (`fdnet.report.figures.PageTable`), and sections as HTML.
    """

    figures: Sequence[tuple[Path, str]] = ()
    case_words: Sequence[str] = ()
    case_text: str = ""
    scales: Sequence[Any] = ()
    versions: Mapping[str, Any] = field(default_factory=dict)
    commands: Sequence[str] = ()
    tables: Sequence[Any] = ()
    stokes: str = ""
    mechanics: str = ""


def write_report(path: str | Path, summary: Mapping[str, Any], *, parts: ReportParts) -> Path:
    """Write the page, whole or not at all. Raises CaseError for a figure that cannot be read.

    `summary` is the mapping of summary.json; keys that it lacks show as a dash, and without
    `supplied_count` there are no headline numbers.
    """
    figures = [shown_figure(Path(file), caption) for file, caption in parts.figures]
    text = page_text(
        "report/report.html.j2",
        summary=summary,
        parts=parts,
        columns=SECTION_COLUMNS,
        figures=[one for one in figures if one["name"] not in (STILL, LEADING)],
        leading=[one for one in figures if one["name"] == LEADING],
        still=[one for one in figures if one["name"] == STILL],
        headline=list(facts(summary)) if "supplied_count" in summary else [],
    )
    return write_text(path, text)


def page_text(template: str, **shown: Any) -> str:
    """A page from its template, a path within fdnet; the style is that of page.html.j2."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    how: Any = {"autoescape": True, "trim_blocks": True, "lstrip_blocks": True}
    page = Environment(loader=PackageLoader("fdnet", ""), undefined=StrictUndefined, **how)
    for one in (quantity, in_millidarcy, percent, multiplied, words):
        page.filters[one.__name__] = one
    page.filters["fixed"] = lambda value: DASH if value is None else f"{value:.4f}"
    page.globals.update(shows=SHOWS, agrees=AGREES)
    return page.get_template(template).render(**shown)


def shown_figure(path: Path, caption: str) -> dict[str, str]:
    """A figure as the macro `show` takes it; the picture of the specimen is made a JPEG, a
    quarter of its PNG. Raises CaseError where it cannot be read."""
    try:
        kind, data = "svg+xml" if path.suffix == ".svg" else "png", path.read_bytes()
    except OSError as error:
        raise CaseError(
            f"{path}: figure for the report cannot be read ({error.strerror}); draw it again "
            "with --stages report"
        ) from error
    if path.name == STILL:
        from PIL import Image

        small, kind = io.BytesIO(), "jpeg"
        Image.open(path).convert("RGB").save(small, "JPEG", quality=85)
        data = small.getvalue()
    data_uri = f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
    return {"data": data_uri, "caption": caption, "name": path.name}


def quantity(value: Any, unit: str = "") -> str:
    """A number for a reader: 4 digits, powers of ten written out, `unit` behind it.

    A whole number has all its digits; None and NaN become a dash.
    """
    if value is None or value != value:
        return DASH
    if isinstance(value, str | bool):
        return f"{value} {unit}".strip()
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    whole = isinstance(value, int) or 1e4 <= abs(value) < 1e6
    small = 0 < abs(value) < 1e-3
    text = f"{value:,.0f}" if whole else f"{value:.3e}" if small else f"{value:,.4g}"
    return f"{_POWER.sub(_power, text)} {unit}".strip()


_POWER = re.compile(r"(?<=\d)e([+-]\d+)")


def _power(found: re.Match[str]) -> str:
    return "·10" + str(int(found[1])).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


_TYPESET = (
    (r" \(see docs/reference/warnings\.md#[\w-]+\)", ""),
    (r"; (what follows|what to do): ", r"<br><b>\1:</b> "),
    (r"`([^`]+)`", r"<code>\1</code>"),
    (r"-&gt;", "→"),
    (r" m2\b", " m²"),
    (r"(\d) (?=%|[mµ]?m\b|mD\b|MPa\b|cP\b)", r"\1&nbsp;"),
)
"""Pattern and replacement of what the page shows otherwise than a terminal."""


def words(text: str) -> str:
    """A sentence as HTML."""
    text = _POWER.sub(_power, html.escape(text))
    for pattern, new in _TYPESET:
        text = re.sub(pattern, new, text)
    return text


def multiplied(value: Any, factor: float | None) -> Any:
    """`value` times `factor`; None stays None."""
    return value if value is None or factor is None else value * factor
