"""The report: figures for every kind of specimen, and a page that says what the summary says."""

import base64
import copy
import json
import re
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from builders import naming
from matplotlib.figure import Figure
from matplotlib.image import imread
from report_demo import demo_analysis, demo_damaged, demo_grains, snapshot_of

from fdnet.errors import CaseError
from fdnet.report import figures
from fdnet.report import vtk as view
from fdnet.report.figures import PlacedSizes, cut_circles, fill_size_curves
from fdnet.report.html import ReportParts, quantity, write_report
from fdnet.report.text import facts, html_lines, summary_lines
from fdnet.report.vtk import view_of
from fdnet.run.answer import BridgingSizes, rules_of
from fdnet.sizes import LogNormal, cut_curve
from fdnet.spheres.snapshot import Kind

SIZES = BridgingSizes(
    fines={"D50": 40e-6, "D85": 60e-6, "D90": 100e-6},
    throat_median=100e-6,
    throat_largest=90e-6,
    grain_d15=270e-6,
    concentration=0.05,
)


PNG = b"\x89PNG\r\n\x1a\n" + b"anything"


SECTION = {
    "section": 1,
    "x_lo_m": 0.0,
    "x_hi_m": 1e-3,
    "porosity_initial": 0.3,
    "porosity_damaged": 0.25,
    "k_initial_m2": 7.65e-11,
    "k_damaged_m2": 5.0e-11,
    "k_reduction": 0.34641,
    "k_initial_inplace_m2": 7e-11,
    "k_damaged_inplace_m2": 4e-11,
    "fines_count": 704,
    "fines_fraction": 0.7,
}


SUMMARY = {
    "case": "specimen <1>",
    "seed": 4,
    "law": "thesis",
    "damage_law": "thesis-code",
    "porosity_initial": 0.3,
    "porosity_damaged": 0.29,
    "k_initial_m2": 7.65e-11,
    "k_damaged_m2": 5.1e-11,
    "k_reduction": 1 / 3,
    "supplied_count": 3000,
    "invaded_count": 704,
    "passed_count": 6,
    "upstream_count": 2290,
    "invasion_depth_m": 4e-3,
    "invasion_depth_p95_m": 2.5e-3,
    "cake_thickness_m": 3e-4,
    "stop_reason": "plugged",
    "words": {
        "end": "the face plugged: no fine crossed it",
        "cake": "CAKE WORDS",
        "in_place": "IN PLACE.",
    },
    "sections": [
        SECTION,
        SECTION | {"section": 2, "k_initial_m2": 0.0, "k_damaged_m2": 0.0, "k_reduction": None},
    ],
    "throats": 10,
    "throats_blocked": 2,
    "solver": {"method": "direct", "residual": 1e-15, "mass_balance": None},
    "seconds": {"pack": 1.5, "analyse": {"solve": 0.25}},
    "left_out": ["gravity: a & b"],
    "warnings": ["<script>alert(1)</script>"],
}


class Reader(HTMLParser):
    """Collects texts and tags; complains of tags that do not match."""

    def __init__(self):
        super().__init__()
        self.open, self.text, self.tags = [], [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in ("meta", "img", "br", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.text.append(data)


def page_of(folder, summary, **parts):
    reader = Reader()
    reader.feed(
        write_report(folder / "report.html", summary, parts=ReportParts(**parts)).read_text(
            encoding="utf-8"
        )
    )
    assert reader.open == []
    return reader, re.sub("[ \\n]+", " ", " ".join(reader.text))


def test_it_says_what_the_summary_says(tmp_path):
    _, text = page_of(
        tmp_path, SUMMARY, commands=["fdnet run a.toml"], versions={"LIGGGHTS": "3.8.0"}
    )
    for said in (
        "specimen <1>",
        "7.650·10⁻¹¹",
        "permeability 77,510 → 51,680 mD (7.65e-11 → 5.1e-11 m²), 33.3 % lost",
        "porosity 0.3000 → 0.2900",
        "fines 704 invaded 6 passed, 2290 upstream of 3000 supplied",
        "depth 95 % above 2.5 mm deepest 4 mm",
        "cake 0.3 mm CAKE WORDS",
        "end the face plugged no fine crossed it",
        "of them blocked: one fine covers the whole section 2",
        "34.6",
        "gravity: a & b",
        "solve",
        "0.25",
        "LIGGGHTS",
        "3.8.0",
        "fdnet run a.toml",
        "<script>alert(1)</script>",
    ):
        assert said in text, said


def test_nothing_is_taken_for_markup_or_fetched_from_outside(tmp_path):
    figure = tmp_path / "x.png"
    figure.write_bytes(PNG)
    evil = '<b onclick="x">&'
    reader, text = page_of(
        tmp_path,
        SUMMARY | {"left_out": [evil], "solver": {evil: evil}},
        case_text=evil,
        figures=[(figure, evil)],
        commands=[evil],
        versions={evil: evil},
        scales=[
            {
                "name": evil,
                "symbol": evil,
                "value": 1.0,
                "unit": evil,
                "formula": evil,
                "source": evil,
            }
        ],
    )
    assert text.count(evil) >= 10
    assert {tag for tag, _ in reader.tags}.isdisjoint({"script", "link", "iframe", "object"})
    assert not any("onclick" in attributes for _, attributes in reader.tags)
    sources = [attributes["src"] for tag, attributes in reader.tags if tag == "img"]
    assert sources == ["data:image/png;base64," + base64.b64encode(PNG).decode()]


def test_the_page_answers_first_and_checks_the_run_before_the_rest(tmp_path):
    """Answer, case in words, k and porosity by depth, health, and only then the scales."""
    leading = tmp_path / "depth.png"
    leading.write_bytes(PNG)
    said = SUMMARY | {
        "answer": "THE ANSWER.",
        "certainty": ["ONE SEED."],
        "skin": 0.056,
        "skin_flow_lost": 0.008,
        "skin_well_radius_m": 0.108,
        "run_shows": "bridges",
        "rules": rules_of(SIZES, "bridges"),
    }
    _, text = page_of(
        tmp_path,
        said,
        case_words=["THE CASE."],
        figures=[(leading, "BY DEPTH.")],
        scales=[
            {"name": "SCALE", "symbol": "", "value": 1.0, "unit": "", "formula": "", "source": ""}
        ],
    )
    order = ("THE ANSWER.", "ONE SEED.", "skin 0.056", "THE CASE.", "BY DEPTH.", "50,660")
    order += ("Health of the run", "agrees", "Abrams 1977", "SCALE")
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    assert "costs 0.8 % of the flow of a well of 108 mm radius" in text


def test_the_view_holds_every_sphere_to_the_sixteenth_bit(tmp_path, monkeypatch):
    spheres = demo_damaged()
    model = view_of(spheres)
    table = np.frombuffer(base64.b64decode(model["data"]), "<u2").reshape(-1, 4) / 65535
    low, high = np.array(model["low"]), np.array(model["high"])
    both = [spheres.grains(), spheres.fines()]
    position = np.concatenate([one.position for one in both]) * 1e3
    assert model["grains"] == len(both[0])
    assert np.abs(low + table[:, :3] * (high - low) - position).max() < 1e-4
    radius = np.concatenate([one.radius for one in both]) * 1e3
    assert table[:, 3] * model["radius"] == pytest.approx(radius, rel=1e-3)
    reader, text = page_of(tmp_path, SUMMARY, view=model)
    scripts = [attributes for tag, attributes in reader.tags if tag == "script"]
    assert len(scripts) == 2
    assert not any("src" in attributes for attributes in scripts)
    monkeypatch.setattr(view, "MOST_IN_VIEW", len(demo_damaged()) - 1)
    assert view_of(demo_damaged()) is None, "too many are left to the picture"
    assert json.loads(text[text.index('{"grains"') : text.index("}", text.index('{"grains"')) + 1])


def test_scales_are_rows_of_objects_or_mappings(tmp_path):
    row = {
        "name": "Darcy velocity",
        "symbol": "q",
        "value": 0.67,
        "unit": "m/s",
        "formula": "k dP/(mu L)",
        "source": "Darcy 1856",
    }
    _, text = page_of(
        tmp_path,
        SUMMARY,
        scales=[row, SimpleNamespace(**row | {"name": "other", "value": 2.5e-8})],
    )
    assert "Darcy velocity q 0.67 m/s k dP/(mu L) Darcy 1856" in text
    assert "other q 2.500·10⁻⁸ m/s" in text


def test_a_summary_of_an_intact_pack_or_nothing_at_all_still_makes_a_page(tmp_path):
    intact = SUMMARY | {
        "stop_reason": None,
        "supplied_count": 0,
        "invaded_count": 0,
        "k_damaged_m2": 7.65e-11,
        "warnings": [],
    }
    _, text = page_of(tmp_path, intact)
    assert "permeability 77,510 mD" in text
    assert "damaged by fines" not in text
    assert "No warnings" in text
    _, text = page_of(tmp_path, {})
    assert "fdnet run" in text
    first = next(facts(SUMMARY | {"stop_reason": None}))
    assert "77,510 -> 51,680 mD" in first.text


def test_text_page_and_notebook_say_the_same_numbers_and_words(tmp_path):
    """Section 2 lost -0.04 %, which no reader shall see as -0.0."""
    last = SECTION | {"section": 2, "k_damaged_m2": 7.65306e-11, "k_reduction": -0.0004}
    said = SUMMARY | {
        "answer": "THE ANSWER.",
        "certainty": ["ONE SEED."],
        "skin": 0.056,
        "skin_flow_lost": 0.008,
        "skin_well_radius_m": 0.108,
        "run_shows": "bridges",
        "rules": rules_of(SIZES, "bridges"),
        "seconds": {"liggghts": 1.0},
        "sections": [SECTION, last],
    }
    _, page = page_of(tmp_path, said)
    text, book = "\n".join(summary_lines(said)), "".join(html_lines(tmp_path, said))
    words = re.sub(r"\s+", " ", text)
    for part in ("THE ANSWER.", "ONE SEED.", "77,510", "33.3 % lost", "2.5 mm", "CAKE WORDS"):
        assert part in words, part
        assert part in page, part
        assert part in book, part
    for part in (
        "IN PLACE.",
        "no fine crossed it",
        "0.8 % of the flow of a well of 108 mm",
        "34.6",
    ):
        assert part in words, part
        assert part in page, part
    assert "The run holds the fines: the face plugged." in page
    assert "the run holds the fines: the face plugged)" in words
    assert not re.search(r"-0\.0\b", page + words + book)


def test_a_missing_figure_is_named(tmp_path):
    with pytest.raises(CaseError, match=r"none\.png"):
        write_report(
            tmp_path / "r.html", SUMMARY, parts=ReportParts(figures=[(tmp_path / "none.png", "")])
        )
    assert not (tmp_path / "r.html").exists()


def test_numbers_as_a_reader_wants_them():
    for value, text in [
        (None, "–"),
        (float("nan"), "–"),
        (float("inf"), "∞"),
        (0, "0"),
        (0.0, "0"),
        (1234567, "1\u2009234\u2009567"),
        (0.123456, "0.1235"),
        (7.65e-11, "7.650·10⁻¹¹"),
        (-2.5e7, "-2.500·10⁷"),
        (12345.6, "12\u2009346"),
        (True, "True"),
        ("direct", "direct"),
    ]:
        with naming(value, text):
            assert quantity(value) == text


HISTORY = [
    {
        "physical_time_s": 1e-4 * i,
        "invaded_count": i,
        "passed_count": 0,
        "upstream_count": 50 - i,
    }
    for i in range(50)
]


DAMAGE = {"porosity_reduction", "invaded_fraction", "permeability_ratio"}


def coloured_share(path):
    picture = imread(path)[..., :3]
    return float((picture.min(axis=2) < 0.95).mean())


def curves() -> PlacedSizes:
    curve = cut_curve(LogNormal(40e-6, 0.5), cut=(0.02, 0.95))
    return PlacedSizes(
        name="fines",
        law="log-normal",
        asked={0.5: 40e-6},
        curve=curve,
        placed=curve.strata(500),
        invaded=curve.strata(20),
    )


def test_all_figures_of_a_damaged_specimen(tmp_path):
    """With a section of no flow, fines of one size, and the whole page around them."""
    dead = [copy.copy(s) for s in demo_analysis().sections]
    dead[0].k_initial = dead[0].k_initial_inplace = 0.0
    analysis = SimpleNamespace(**(vars(demo_analysis()) | {"sections": tuple(dead)}))
    paths = figures.draw_all(
        tmp_path / "figures", analysis, demo_damaged(), HISTORY, sizes=[curves()]
    )
    assert {path.stem for path in paths} == set(figures.CAPTIONS) - {"spheres_3d"}
    assert sorted(paths) == sorted((tmp_path / "figures").iterdir())
    assert all(imread(path).shape[1] >= 900 and coloured_share(path) > 0.02 for path in paths)
    captioned = [(path, figures.CAPTIONS[path.stem]) for path in paths]
    page = write_report(tmp_path / "report.html", SUMMARY, parts=ReportParts(figures=captioned))
    assert page.read_text(encoding="utf-8").count("data:image/png") == len(paths)


def test_a_pack_without_fines_inside_gets_no_figures_of_damage(tmp_path):
    none = {"occupancy": None, "invaded_count": 0, "layers": None}
    intact = SimpleNamespace(**(vars(demo_analysis()) | none))
    stems = {path.stem for path in figures.draw_all(tmp_path, intact, demo_grains())}
    assert stems == {"side_view", "depth", "network", "size_distributions"}
    fines = snapshot_of([[-1e-4, 1e-3, 1e-3]], 5e-5, Kind.FINE, first_id=900)
    nothing = {"k_initial": 0.0, "invaded_count": 0}
    analysis = SimpleNamespace(**(vars(demo_analysis()) | nothing))
    paths = figures.draw_all(tmp_path / "cake", analysis, demo_grains().joined(fines))
    assert {path.stem for path in paths} >= DAMAGE


def test_cut_circles_are_pythagoras():
    position = np.array([[1.0, 0.0, 2.0], [3.0, 3.0, 4.0], [5.0, 5.0, 6.0], [7.0, -5.1, 8.0]])
    index, centre, radius = cut_circles(snapshot_of(position, 5.0, Kind.GRAIN), 0.0)
    assert index.tolist() == [0, 1]  # touching (d = r) is no cut
    assert centre.tolist() == [[1, 2], [3, 4]]
    assert radius == pytest.approx([5.0, 4.0])  # the 3-4-5 triangle


def test_the_curves_of_sizes_are_drawn_over_the_diameter_in_microns():
    """The steps of the placed spheres end at the shares that the cuts leave."""
    figure = Figure()
    fill_size_curves(figure, sizes=[curves()])
    asked, given, placed, invaded = figure.axes[0].get_lines()
    assert given.get_xydata()[0] == pytest.approx([40.0, 50.0])
    assert asked.get_ydata()[[0, -1]] == pytest.approx([2.0, 95.0])
    assert placed.get_ydata()[-1] == pytest.approx(95.0)
    assert np.interp(40.0, placed.get_xdata(), placed.get_ydata()) == pytest.approx(50.0, abs=0.5)
    assert len(invaded.get_xdata()) == 20
