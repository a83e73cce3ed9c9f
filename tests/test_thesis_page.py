"""docs/thesis.md agrees with its tables, and those agree with the kept states."""

import csv
from collections import Counter

import numpy as np
import pytest

from fdnet.errors import CaseError
from validation.thesis.collection import RESULTS
from validation.thesis.compare.trends import compare_trends
from validation.thesis.numbers.examine import THESIS_PAIR, examine
from validation.thesis.numbers.results import read_results, result_rows
from validation.thesis.numbers.values import thesis_of
from validation.thesis.outputs import CAPTIONS, DEPOSITION, TETRAHEDRA
from validation.thesis.page.document import document
from validation.thesis.runs.carry_out import state_path
from validation.thesis.runs.plan import (
    CHEAP,
    SCAN_SEEDS,
    SEEDS,
    SPECIMENS,
    VARIANTS,
    Planned,
    planned,
)
from validation.thesis.runs.state import read_state


@pytest.fixture(scope="module")
def rows(root):
    return read_results(root / "docs/thesis" / RESULTS)


@pytest.fixture(scope="module")
def prose(root):
    """The source of the page, without its line breaks."""
    return " ".join((root / "docs/thesis.md.in").read_text(encoding="utf-8").split())


def values(rows, run, field, law="thesis"):
    """A field of a run over its seeds; `field` may be a function of the row."""
    pick = field if callable(field) else lambda row: getattr(row, field)
    return np.array([pick(row) for row in rows if row.id == run and row.law == law])


def first_loss(row):
    return 100 * row.k_reductions[0]


def whole_loss(row):
    return 100 * (row.porosity_initial - row.porosity_damaged)


def csv_rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_page_is_written_from_the_committed_tables(root):
    assert (root / "docs/thesis.md").read_text(encoding="utf-8") == document(root / "docs")


def test_a_part_that_does_not_exist_is_refused(root, tmp_path):
    (tmp_path / "thesis").symlink_to(root / "docs/thesis")
    (tmp_path / "thesis.md.in").write_text("# Page\n\n$overview\n\n$nothing\n")
    with pytest.raises(CaseError, match="nothing"):
        document(tmp_path)


def test_the_overview_holds_the_results(root, rows):
    """Each number of the overview against the mean over the seeds in results.csv."""
    lines = (root / "docs/thesis.md").read_text(encoding="utf-8").splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("| specimen |"))
    table = [line.strip("| ").split(" | ") for line in lines[start : start + 10]]
    header, _, *body = table
    assert lines[start + 10] == ""
    assert len(body) == len(SPECIMENS)
    for run, cells in zip(SPECIMENS, body, strict=True):
        line = dict(zip(header, cells, strict=True))
        thesis = thesis_of(run)
        assert line["specimen"] == run.removeprefix("specimen")
        expected = {
            "invaded fines": values(rows, run, "invaded_count"),
            "depth of 95 %, mm": values(rows, run, "invasion_depth_p95_mm"),
            "porosity lost, first mm, points": 100 * values(rows, run, "porosity_loss_first_mm"),
            "whole specimen, points": values(rows, run, whole_loss),
            "by the thesis's laws, %": values(rows, run, first_loss),
            "by fdnet's laws, %": values(rows, run, first_loss, "lubrication"),
        }
        for name, seeds in expected.items():
            shown = float(line[name].split(" ± ")[0])
            assert shown == pytest.approx(seeds.mean(), rel=6e-3), name
            assert ("±" in line[name]) == (len(seeds) >= 3)
        lost = 100 * (thesis.porosity - thesis.damaged_porosity[0])
        assert float(line["thesis, whole, points"]) == pytest.approx(lost)
        given = f"{100 * thesis.reductions[0]:.0f}" if thesis.reductions else "–"
        assert line["k lost, first mm, thesis, %"] == given
        assert line["ended by"] == ", ".join(set(values(rows, run, "stop_reason")))


def test_the_first_screen_holds_the_results(rows, prose):
    by_thesis, by_fdnet = (
        [values(rows, run, first_loss, law).mean() for run in SPECIMENS]
        for law in ("thesis", "lubrication")
    )
    given = [100 * thesis_of(run).reductions[0] for run in SPECIMENS if thesis_of(run).reductions]
    assert (
        f"falls by {min(by_thesis):.0f} to {max(by_thesis):.0f} %; the thesis reports "
        f"{min(given):.0f} to {max(given):.0f} %"
    ) in prose
    assert f"loses {min(by_fdnet):.0f} to {max(by_fdnet):.0f} % of its permeability" in prose
    ratios = np.array(by_fdnet) / np.array(by_thesis)
    assert (round(min(ratios)), round(max(ratios))) == (2, 3)
    assert "two to three times" in prose
    deepest = values(rows, "specimen1", "invasion_depth_mm").max()
    assert f"stop within {deepest:.1f} mm of the face" in prose
    share = (
        values(rows, "specimen1", "invaded_count").mean() / thesis_of("specimen1").invaded_count
    )
    assert share == pytest.approx(0.5, abs=0.06)
    losses = {run: values(rows, run, whole_loss).mean() for run in SPECIMENS}
    others = [loss for run, loss in losses.items() if run != "specimen6"]
    assert f"{min(others):.1f} to {max(others):.1f} points" in prose
    assert f"{losses['specimen6']:.1f} points" in prose
    thesis = [thesis_of(run) for run in SPECIMENS[1:]]
    lost = [100 * (one.porosity - one.damaged_porosity[0]) for one in thesis]
    assert f"{min(lost):.0f} to {max(lost):.0f} points for all but specimen 1" in prose


def test_the_followed_flow_holds_its_table(root, prose):
    rows = [row for row in csv_rows(root / "docs/thesis/followed.csv") if "5" in row["specimen"]]
    by_flow = {
        flow: [row for row in rows if row["flow"] == flow] for flow in ("followed", "uniform")
    }

    def ends(flow, name):
        values = [100 * float(row[name]) for row in by_flow[flow]]
        return f"{min(values):.0f} to {max(values):.0f}"

    for name in ("k_lost_1", "k_lost_2", "k_lost"):
        assert f"{ends('followed', name)} %" in prose
        assert f"instead of {ends('uniform', name)} %" in prose
    depth = [
        np.mean([float(row["mean_depth_mm"]) for row in by_flow[flow]])
        for flow in ("followed", "uniform")
    ]
    assert 2 < depth[0] / depth[1] < 3


def test_how_far_to_trust_it_holds_the_results(rows, prose):
    single = [run for run in SPECIMENS if len(values(rows, run, "seed")) == 1]
    assert single == ["specimen3", "specimen6", "specimen7", "specimen8"]
    capped = [run for run in SPECIMENS if "cap" in values(rows, run, "stop_reason")]
    assert capped == ["specimen3", "specimen6", "specimen8"]
    assert "The runs of specimens 3, 6 and 8 ended at" in prose
    overlaps = [100 * values(rows, run, "max_overlap").max() for run in single]
    assert f"overlaps of {min(overlaps):.0f} to {max(overlaps):.0f} % of a diameter" in prose
    done = {(row.id, row.seed) for row in rows}
    plan = {(item.id, item.seed) for item in planned(quick=False)}
    assert f"{len(plan - done)} of the {len(plan)} planned runs were not made" in prose


def test_agreement_and_difference_hold_the_results(root, rows, prose):
    counts = values(rows, "specimen1", "invaded_count")
    assert f"takes in {min(counts)} to {max(counts)} fines" in prose
    counts = values(rows, "specimen5", "count_first_mm")
    assert f"It is {min(counts):,} to {max(counts):,}; the thesis says" in prose
    assert f"holds {min(counts):,} to {max(counts):,} fines" in prose
    losses = [values(rows, f"specimen{number}", first_loss) for number in (1, 5, 8, 3, 6)]
    words = "Specimen 1 loses {:.0f} to {:.0f} % by seed"
    # 17.5 % is rounded up
    assert words.format(min(losses[0]) + 0.01, max(losses[0])) in prose
    assert f"specimen 5 loses {min(losses[1]):.0f} to {max(losses[1]):.0f} %" in prose
    for number, loss in zip((8, 3, 6), losses[2:], strict=True):
        assert f"specimen {number} loses {loss[0]:.0f} %" in prose
    near = [values(rows, run, "fraction_deep_near_wall")[0] for run in ("specimen3", "specimen6")]
    assert f"{near[0]:.0%} in specimen 3".replace("%", " %") in prose
    assert f"{near[1]:.0%} in specimen 6".replace("%", " %") in prose
    ends = Counter(values(rows, "quick-specimen3", "stop_reason"))
    assert (ends["plugged"], ends.total()) == (4, 5)
    assert set(values(rows, "quick-specimen6", "stop_reason")) == {"cap"}
    walls = {
        (row["low"], row["high"]): float(row["nearer_wall"]) + float(row["beyond_wall"])
        for row in csv_rows(root / "docs/thesis" / DEPOSITION)
        if (row["id"], row["seed"]) == ("specimen5", "1") and row["nearer_wall"]
    }
    shares = [f"{100 * walls[bounds]:.0f} %" for bounds in (("0.4", "0.6"), ("0.6", "1"))]
    assert f"{' and '.join(shares)} of them lie nearer the wall than the axis" in prose
    ratios = [float(row["ratio"]) for row in csv_rows(root / "docs/thesis" / TETRAHEDRA)]
    assert f"up to {max(ratios):.0f} times with the finest" in prose


def test_scans_hold_the_results(rows, prose):
    free = "specimen5 fines.friction=0"
    inside, passed = (values(rows, free, name)[0] for name in ("invaded_count", "passed_count"))
    assert passed / (inside + passed) == pytest.approx(0.5, abs=0.02)
    assert "Half of the frictionless fines pass through specimen 5" in prose
    lost = 100 * values(rows, "specimen5", "porosity_loss_first_mm")
    assert f"loses {min(lost):.0f} to {max(lost):.0f} points of porosity" in prose
    own = values(rows, "specimen1", "invaded_count")[:SCAN_SEEDS].mean()
    for setting in ("grains.motion=mobile", "grains.count=1369", "run.stiffness_N_m=100.0"):
        assert values(rows, f"specimen1 {setting}", "invaded_count").mean() / own < 4 / 3
    trends = [one for one in compare_trends(rows) if one.scale == "full scale"]
    even = Counter(one.verdict for one in trends if one.trend == 4)
    assert even["holds"] == 0
    for trend in (1, 5):
        verdicts = Counter(one.verdict for one in trends if one.trend == trend)
        assert verdicts["holds"] > verdicts.total() / 2


def test_every_specimen_and_variant_has_rows_of_all_its_seeds(rows):
    there = {(row.id, row.seed, row.law) for row in rows}
    for name in (*SPECIMENS, *VARIANTS):
        for seed in range(1, (SEEDS if name in CHEAP else 1) + 1):
            assert {(name, seed, "thesis"), (name, seed, "lubrication")} <= there
    assert {row.id for row in rows} <= {item.id for item in planned(quick=False)}


def test_every_figure_is_there_and_small(root):
    lines = (root / "docs/thesis" / CAPTIONS).read_text(encoding="utf-8").splitlines()[1:]
    names = [line.split(",")[0] for line in lines]
    assert len(names) == len(set(names)) > 40
    there = {path.name for path in (root / "docs/thesis").glob("*.png")}
    assert there <= set(names)
    assert all((root / "docs/thesis" / name).stat().st_size < 200_000 for name in there)


@pytest.mark.parametrize("name", ["specimen1", "specimen5"])
def test_a_kept_state_gives_its_rows_again(root, rows, name):
    """Losses by fdnet's laws are by an earlier `auto`, as the page says."""
    item = Planned(case=name, group="specimen")
    state = read_state(state_path(root / "docs/thesis/states", item))
    assert state.case == item.load()
    kept = [row for row in rows if (row.id, row.seed) == (name, 1)]
    for row, known in zip(result_rows(examine(item.id, state)), kept, strict=True):
        assert (row.law, row.invaded_count, row.stop_reason) == (
            known.law,
            known.invaded_count,
            known.stop_reason,
        )
        if (row.law, row.damage_law) == THESIS_PAIR:
            assert row.k_reductions == pytest.approx(known.k_reductions, rel=1e-6, abs=1e-9)
        assert row.porosity_damaged == pytest.approx(known.porosity_damaged, rel=1e-6)
