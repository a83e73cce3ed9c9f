"""docs/thesis.md says what its tables say, and those what the kept states say."""

import sys

import pytest

from fdnet.studies.thesis.collection import RESULTS
from fdnet.studies.thesis.numbers.examine import examine
from fdnet.studies.thesis.numbers.results import read_results, result_rows
from fdnet.studies.thesis.outputs import CAPTIONS
from fdnet.studies.thesis.runs.carry_out import state_path
from fdnet.studies.thesis.runs.plan import CHEAP, SEEDS, SPECIMENS, VARIANTS, Planned, planned
from fdnet.studies.thesis.runs.state import read_state


@pytest.fixture(scope="module")
def thesis(root):
    sys.path.insert(0, str(root / "scripts"))
    import thesis

    return thesis


@pytest.fixture(scope="module")
def rows(root):
    return read_results(root / "docs/thesis" / RESULTS)


def test_the_page_is_written_from_the_committed_tables(root, thesis):
    assert (root / "docs/thesis.md").read_text(encoding="utf-8") == thesis.document(root / "docs")


def test_the_page_shows_the_overview_of_the_eight_specimens(root, thesis, rows):
    assert thesis.overview(rows) in (root / "docs/thesis.md").read_text(encoding="utf-8")
    assert thesis.overview(rows).count("\n") == 9


def test_every_specimen_and_variant_has_rows_of_all_its_seeds(rows):
    found = {(row.id, row.seed, row.law) for row in rows}
    for name in (*SPECIMENS, *VARIANTS):
        for seed in range(1, (SEEDS if name in CHEAP else 1) + 1):
            assert {(name, seed, "thesis"), (name, seed, "lubrication")} <= found
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
    item = Planned(case=name, group="specimen")
    state = read_state(state_path(root / "docs/thesis/states", item))
    assert state.case == item.load()
    kept = [row for row in rows if (row.id, row.seed) == (name, 1)]
    for row, told in zip(result_rows(examine(item.id, state)), kept, strict=True):
        assert (row.law, row.invaded_count, row.stop_reason) == (
            told.law,
            told.invaded_count,
            told.stop_reason,
        )
        assert row.k_reductions == pytest.approx(told.k_reductions, rel=1e-6, abs=1e-9)
        assert row.porosity_damaged == pytest.approx(told.porosity_damaged, rel=1e-6)
