"""The report: figures for every kind of specimen, and a page that says what the summary says."""

import base64
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest
from builders import resting_spheres

from fdnet.errors import CaseError
from fdnet.report import figures
from fdnet.report.figures import cut_circles
from fdnet.report.html import ReportParts, quantity, words, write_report
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


def read(path):
    reader = Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    assert reader.open == []
    return reader


def page_of(folder, summary, **parts):
    reader = read(write_report(folder / "report.html", summary, parts=ReportParts(**parts)))
    return reader, re.sub("[ \\n\xa0]+", " ", " ".join(reader.text))


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
    with pytest.raises(CaseError, match=r"none\.png"):
        page_of(tmp_path, finished.summary, figures=[(tmp_path / "none.png", "")])


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
    for part in (
        *(summary["answer"], summary["certainty"][0], summary["words"]["cake"]),
        in_millidarcy(summary["k_initial_m2"]),
        f"{100 * summary['k_reduction']:.1f} % lost",
        f"{100 * summary['sections'][0]['k_reduction']:.1f}",
        "0.8 % of the flow of a well of 108 mm",
    ):
        assert part in words, part
        assert part in page, part
    assert not re.search(r"-0\.0\b", page + words)


def test_the_page_of_a_run_has_all_its_figures_and_each_is_drawn(finished, analysed, tmp_path):
    """Each is a drawing with its text as text, and the same bytes each time."""
    paths = list((finished.path / "figures").glob("*.svg"))
    assert {path.stem for path in paths} >= {"invaded_fraction", "side_view", "depth", "network"}
    for path in paths:
        tags = Counter(one.tag.rpartition("}")[2] for one in ElementTree.parse(path).iter())
        assert tags["text"] >= 6, path
        assert tags["path"] >= 6, path
    page = (finished.path / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/svg+xml") == len(paths)
    pictures = page.count("data:image/") - len(paths)
    assert pictures == (finished.path / "figures" / "spheres_3d.png").exists()
    one, other = (figures.draw_all(tmp_path / name, analysed) for name in ("one", "other"))
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in other]


def test_only_the_four_parts_stand_open_and_every_link_has_its_place(finished):
    """The answer, the case, depth, and health; all else is folded, each below one line."""
    reader = read(finished.path / "report.html")
    places = {attributes.get("id") for _, attributes in reader.tags}
    links = [attributes["href"] for tag, attributes in reader.tags if tag == "a"]
    assert links == ["#case", "#depth", "#health", "#more"]
    assert {link[1:] for link in links} <= places
    tags = [tag for tag, _ in reader.tags]
    assert (tags.count("h2"), tags.count("h1")) == (4, 1)
    assert tags.count("details") == tags.count("summary") >= 6
    assert not any("open" in attributes for _, attributes in reader.tags)


def test_numbers_and_sentences_of_the_page_are_typeset_once():
    for value, text in (
        (192_812, "192,812"), (1.9e-10, "1.900·10⁻¹⁰"), (0.0474, "0.0474"), (12345.6, "12,346"),
        (3.2e7, "3.2·10⁷"), (None, "–"), (float("nan"), "–"), (float("-inf"), "−∞"), (0.0, "0"),
    ):  # fmt: skip
        assert quantity(value) == text
    warning = "1 < 2.5 m2; what to do: `fdnet run` (see docs/reference/warnings.md#odd-one)"
    said = "1 &lt; 2.5 m²<br><b>what to do:</b> <code>fdnet run</code>"
    assert words(warning).replace("&nbsp;", " ") == said
    assert words("1.9e-10 -> 8.2e-11 m2, 5 %") == "1.9·10⁻¹⁰ → 8.2·10⁻¹¹ m², 5&nbsp;%"


def test_a_pack_without_fines_inside_gets_no_figures_of_damage(finished, analysed, tmp_path):
    grains = finished.spheres("initial")
    intact = replace(analysed, occupancy=None, invaded_count=0, layers=None)
    stems = {path.stem for path in figures.draw_all(tmp_path, intact, grains)}
    assert stems == {"side_view", "depth", "network", "size_distributions"}
    fines = resting_spheres([[-1e-4, 1e-3, 1e-3]], 5e-5, grains.box, kind=Kind.FINE, first=900)
    nothing = replace(analysed, k_initial=0.0, invaded_count=0)
    paths = figures.draw_all(tmp_path / "cake", nothing, grains.joined(fines))
    assert "invaded_fraction" in {path.stem for path in paths}


def test_cut_circles_are_pythagoras():
    position = [[1.0, 0.0, 2.0], [3.0, 3.0, 4.0], [5.0, 5.0, 6.0], [7.0, -5.1, 8.0]]
    spheres = resting_spheres(position, 5.0, np.array([[0.0, 9.0]] * 3), kind=Kind.GRAIN)
    index, centre, radius = cut_circles(spheres, 0.0)
    assert index.tolist() == [0, 1]  # touching (d = r) is no cut
    assert centre.tolist() == [[1, 2], [3, 4]]
    assert radius == pytest.approx([5.0, 4.0])  # the 3-4-5 triangle
