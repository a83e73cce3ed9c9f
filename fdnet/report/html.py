"""report.html: one self-contained page of a run, its pictures inside."""

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.errors import CaseError
from fdnet.files.atomic import write_text
from fdnet.report.resolved_words import resolved_words
from fdnet.report.units import in_millidarcy

if TYPE_CHECKING:
    from jinja2 import Environment

DASH = "–"
LEADING, STILL = "depth.png", "spheres_3d.png"
"""The figure that stands at the top, and the one in place of the 3-D view."""
STOP_WORDS = {
    "plugged": "plugged: no fine crossed the face for the set time",
    "duration": "the set duration was over",
    "supply_exhausted": "the supply of fines ran out before the specimen plugged",
    "cap": "the cap on the run was reached before the specimen plugged",
}
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
        view: spheres of the 3-D view (`fdnet.report.view.view_of`); None: a picture alone.
        case_text: the resolved case as TOML.
        scales: rows with name, symbol, value, unit, formula and source (objects or mappings).
        versions: version of each program.
        commands: the command lines as they were typed.
        tables: further tables (`fdnet.report.added.PageTable`), in order.
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
        resolved=resolved_words(summary.get("sections") or ()),
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
    reason = summary.get("stop_reason")
    loss = DASH if lost is None else f"{100 * lost:z.1f} % lost"
    passed, upstream = (
        quantity(summary.get("passed_count")),
        quantity(summary.get("upstream_count")),
    )
    return [
        (
            "95 % of the fines above",
            _millimetres(summary, "invasion_depth_p95_m"),
            f"deepest {_millimetres(summary, 'invasion_depth_m')}",
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
            _millimetres(summary, "cake_thickness_m"),
            _cake(summary.get("cake")),
        ),
        ("end of the run", quantity(reason), STOP_WORDS.get(str(reason), "")),
    ]


def _skin(summary: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Skin and the flow that it costs, where the case has a well."""
    if "skin" not in summary:
        return []
    radius = scaled(summary.get("skin_well_radius_m"), 1e3)
    value = "infinite" if summary["skin"] is None else f"{summary['skin']:.2g}"
    cost = f"{100 * summary['skin_flow_lost']:.2g} % of the flow"
    return [("skin", value, f"costs {cost} of a well of {quantity(radius, 'mm')} radius")]


def _cake(cake: Mapping[str, Any] | None) -> str:
    if cake is None:
        return "deposit upstream of the face"
    k = in_millidarcy(cake["k_carman_kozeny_m2"])
    return f"{k} mD by Carman and Kozeny, resistance {quantity(cake['resistance_1_m'], '1/m')}"


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


def _millimetres(summary: Mapping[str, Any], key: str) -> str:
    return quantity(scaled(summary.get(key), 1e3), "mm")


def _environment() -> "Environment":
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(quantity=quantity, fixed=fixed, scaled=scaled)
    environment.filters["millidarcy"] = in_millidarcy
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
