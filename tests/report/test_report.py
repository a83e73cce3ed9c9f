"""The report: figures for every kind of specimen, and a page that says what the summary says."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from builders import resting_spheres
from matplotlib.image import imread

from fdnet.errors import CaseError
from fdnet.report import figures
from fdnet.report.figures import cut_circles
from fdnet.report.html import ReportParts, write_report
from fdnet.report.tables import in_millidarcy
from fdnet.report.text import facts, summary_lines
from fdnet.spheres.snapshot import Kind

pytestmark = pytest.mark.liggghts
PNG = b"\x89PNG\r\n\x1a\n" + b"anything"


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


def test_nothing_is_taken_for_markup_or_fetched_from_outside(finished, tmp_path):
    figure = tmp_path / "x.png"
    figure.write_bytes(PNG)
    evil = '<b onclick="x">&'
    names = ("name", "symbol", "unit", "formula", "source")
    reader, text = page_of(
        tmp_path,
        finished.summary | {"left_out": [evil], "solver": {evil: evil}, "warnings": [evil]},
        case_text=evil,
        figures=[(figure, evil)],
        commands=[evil],
        versions={evil: evil},
        scales=[dict.fromkeys(names, evil) | {"value": 1.0}],
    )
    assert text.count(evil) >= 11
    assert {tag for tag, _ in reader.tags}.isdisjoint({"script", "link", "iframe", "object"})
    assert not any("onclick" in attributes for _, attributes in reader.tags)
    sources = [attributes["src"] for tag, attributes in reader.tags if tag == "img"]
    assert sources == ["data:image/png;base64," + base64.b64encode(PNG).decode()]


def test_a_summary_of_an_intact_pack_or_nothing_at_all_still_makes_a_page(finished, tmp_path):
    summary = finished.summary
    millidarcy = [in_millidarcy(summary[f"k_{state}_m2"]) for state in ("initial", "damaged")]
    intact = {"stop_reason": None, "supplied_count": 0, "invaded_count": 0, "warnings": []}
    intact["k_damaged_m2"] = summary["k_initial_m2"]
    _, text = page_of(tmp_path, summary | intact)
    assert f"permeability {millidarcy[0]} mD" in text
    assert "damaged by fines" not in text
    assert "No warnings" in text
    _, text = page_of(tmp_path, {})
    assert "fdnet run" in text
    first = next(facts(summary | {"stop_reason": None}))
    assert " -> ".join(millidarcy) + " mD" in first.text


def test_text_and_page_say_the_same_numbers_and_words(finished, tmp_path):
    """The last section lost -0.04 %, which no reader shall see as -0.0."""
    summary = finished.summary
    last = summary["sections"][-1] | {"k_reduction": -0.0004}
    well = {"skin": 0.056, "skin_flow_lost": 0.008, "skin_well_radius_m": 0.108}
    said = summary | well | {"sections": [*summary["sections"][:-1], last]}
    _, page = page_of(tmp_path, said)
    text = "\n".join(summary_lines(said))
    words = re.sub(r"\s+", " ", text)
    numbers = (
        summary["answer"],
        summary["certainty"][0],
        in_millidarcy(summary["k_initial_m2"]),
        f"{100 * summary['k_reduction']:.1f} % lost",
        summary["words"]["cake"],
    )
    for part in numbers:
        assert part in words, part
        assert part in page, part
    first = f"{100 * summary['sections'][0]['k_reduction']:.1f}"
    for part in ("0.8 % of the flow of a well of 108 mm", first):
        assert part in words, part
        assert part in page, part
    assert not re.search(r"-0\.0\b", page + words)


def test_a_missing_figure_is_named(finished, tmp_path):
    missing = ReportParts(figures=[(tmp_path / "none.png", "")])
    with pytest.raises(CaseError, match=r"none\.png"):
        write_report(tmp_path / "r.html", finished.summary, parts=missing)
    assert not (tmp_path / "r.html").exists()


DAMAGE = {"porosity_reduction", "invaded_fraction", "permeability_ratio"}


def test_the_page_of_a_run_has_all_its_figures_and_each_is_drawn(finished):
    paths = list((finished.path / "figures").glob("*.png"))
    assert {path.stem for path in paths} >= DAMAGE | {"side_view", "depth", "invasion_history"}
    for path in paths:
        picture = imread(path)[..., :3]
        assert picture.shape[1] >= 900
        assert (picture.min(axis=2) < 0.95).mean() > 0.02, path
    page = (finished.path / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png") == len(paths)


def test_a_pack_without_fines_inside_gets_no_figures_of_damage(finished, analysed, tmp_path):
    grains = finished.spheres("initial")
    intact = replace(analysed, occupancy=None, invaded_count=0, layers=None)
    stems = {path.stem for path in figures.draw_all(tmp_path, intact, grains)}
    assert stems == {"side_view", "depth", "network", "size_distributions"}
    fines = resting_spheres([[-1e-4, 1e-3, 1e-3]], 5e-5, grains.box, kind=Kind.FINE, first=900)
    nothing = replace(analysed, k_initial=0.0, invaded_count=0)
    paths = figures.draw_all(tmp_path / "cake", nothing, grains.joined(fines))
    assert {path.stem for path in paths} >= DAMAGE


def test_cut_circles_are_pythagoras():
    position = [[1.0, 0.0, 2.0], [3.0, 3.0, 4.0], [5.0, 5.0, 6.0], [7.0, -5.1, 8.0]]
    spheres = resting_spheres(position, 5.0, np.array([[0.0, 9.0]] * 3), kind=Kind.GRAIN)
    index, centre, radius = cut_circles(spheres, 0.0)
    assert index.tolist() == [0, 1]  # touching (d = r) is no cut
    assert centre.tolist() == [[1, 2], [3, 4]]
    assert radius == pytest.approx([5.0, 4.0])  # the 3-4-5 triangle
