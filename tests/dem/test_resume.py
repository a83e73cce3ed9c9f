"""A cut invasion that is continued gives the numbers of an uncut one."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import tiny
from cut_and_continue import MATRIX, StopError, cell_case, differences

from fdnet.dem.checkpoint import Checkpoints
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import make_pack
from fdnet.errors import CaseError, LiggghtsError
from fdnet.scales.scales import scales_of

pytestmark = pytest.mark.liggghts
QUICK = (
    ("walls", "fixed", "batches", "held"),
    ("periodic", "fixed", "batches", "held"),
    ("periodic", "mobile", "batches", "viscous"),
    ("walls", "fixed", "slab", "implicit"),
    ("walls", "mobile", "slab", "held"),
)
"""Cells of every run of the suite; in the first three a continued one once gave other numbers."""


def last_checkpoint(folder, case):
    return Checkpoints(folder=folder, digest=case.digest("invade")).last()


@pytest.fixture(scope="module")
def packed(binary, tmp_path_factory):
    """Grains of a case, made on first use for each kind of box."""
    made = {}

    def grains(case):
        box = (case.box.sides, case.size_m)
        if box not in made:
            folder = tmp_path_factory.mktemp(case.box.sides)
            made[box] = make_pack(case, folder, Launch(binary=binary)).grains
        return made[box]

    return grains


@pytest.mark.parametrize("cell", QUICK, ids="-".join)
def test_a_continued_invasion_is_the_uncut_one(binary, packed, tmp_path, cell):
    case = cell_case(*cell)
    assert differences(case, packed(case), tmp_path, binary) == []
    assert not list(tmp_path.glob("*/post/*contacts*")), "the scratch file stays"


@pytest.mark.nightly
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("cell", MATRIX, ids="-".join)
def test_a_continued_invasion_is_the_uncut_one_everywhere(binary, packed, tmp_path, cell, ranks):
    case = cell_case(*cell)
    one = {"ranks": ranks, "everywhere": ranks == 1}
    assert differences(case, packed(case), tmp_path, binary, **one) == []


@pytest.fixture(scope="module")
def cut(binary, packed, tmp_path_factory):
    """A small invasion, cut after its last checkpoint: case, grains, folder, and the result."""
    case = tiny("run.cap_ms=0.3")
    grains, folder = packed(case), tmp_path_factory.mktemp("cut")
    whole = invade(case, scales_of(case), grains, folder, Launch(binary=binary))
    return case, grains, folder, whole


def zeros(path: Path) -> None:
    path.write_bytes(bytes(path.stat().st_size))


def noise(path: Path) -> None:
    path.write_bytes(np.random.default_rng(1).bytes(path.stat().st_size))


def one_bit(path: Path) -> None:
    text = bytearray(path.read_bytes())
    text[len(text) // 2] ^= 1
    path.write_bytes(text)


def other_step(path: Path) -> None:
    others = sorted(path.parent.glob(f"*{path.suffix}"), key=lambda other: len(str(other)))
    path.write_bytes(next(other for other in others if other != path).read_bytes())


@pytest.mark.parametrize("kind", ["restart", "dump", "record"])
@pytest.mark.parametrize("spoil", [zeros, noise, one_bit, other_step, Path.unlink])
def test_a_checkpoint_that_is_not_as_recorded_is_passed_over(cut, tmp_path, kind, spoil):
    case, _, folder, whole = cut
    shutil.copytree(folder, tmp_path / "cut")
    last, before = whole.history[-1], whole.history[-2]
    assert last_checkpoint(tmp_path / "cut", case) == last
    spoil(tmp_path / "cut" / "post" / f"invade_{last.step}.{kind}")
    assert last_checkpoint(tmp_path / "cut", case) == before


def test_a_zeroed_restart_is_passed_over_with_a_warning(binary, cut, tmp_path):
    case, grains, folder, whole = cut
    shutil.copytree(folder, tmp_path / "cut")
    zeros(tmp_path / "cut" / "post" / f"invade_{whole.history[-1].step}.restart")
    launch = Launch(binary=binary, timeout=60.0)
    again = invade(case, scales_of(case), grains, tmp_path / "cut", launch)
    assert again.history == whole.history
    assert np.array_equal(again.damaged.position, whole.damaged.position)
    new = set(again.warnings) - set(whole.warnings)
    assert len(new) == 1
    assert f"went on from the checkpoint at step {whole.history[-2].step}" in new.pop()


def test_the_warning_stays_when_the_continuing_session_is_killed_too(binary, cut, tmp_path):
    case, grains, folder, whole = cut
    shutil.copytree(folder, tmp_path / "cut")
    zeros(tmp_path / "cut" / "post" / f"invade_{whole.history[-1].step}.restart")

    def stop(line: str) -> None:
        if line.startswith("FDNET checkpoint"):
            raise StopError

    launch = Launch(binary=binary, timeout=60.0)
    with pytest.raises(StopError):
        invade(case, scales_of(case), grains, tmp_path / "cut", replace(launch, follow=stop))
    again = invade(case, scales_of(case), grains, tmp_path / "cut", launch)
    assert again.history == whole.history
    new = set(again.warnings) - set(whole.warnings)
    assert [warning for warning in new if "went on from the checkpoint" in warning] == list(new)
    assert len(new) == 1


def test_notes_between_the_checkpoints_are_passed_over_and_kept(binary, cut, tmp_path):
    case, grains, folder, whole = cut
    shutil.copytree(folder, tmp_path / "cut")
    post = tmp_path / "cut" / "post"
    for name in ("invade_notes.txt", "invade_x.dump", "invade_1.dump.bak", "invade_.record"):
        (post / name).write_text("mine")
    again = invade(case, scales_of(case), grains, tmp_path / "cut", Launch(binary=binary))
    assert again.history == whole.history
    assert again.warnings == whole.warnings
    assert (post / "invade_notes.txt").read_text() == "mine"


@pytest.mark.parametrize("row", [1, 2])
def test_a_changed_history_is_refused(binary, cut, tmp_path, row):
    case, grains, folder, _ = cut
    for name, lines in {
        "gone": [],
        "garbled": ["?,?\n"],
        "changed": ["1,2,3,4,5,6,7,8\n"],
    }.items():
        shutil.copytree(folder, tmp_path / name)
        rows = (folder / "history.csv").read_text().splitlines(keepends=True)
        rows[row : row + 1] = lines
        (tmp_path / name / "history.csv").write_text("".join(rows))
        with pytest.raises(LiggghtsError, match=r"history\.csv: .*put the file back"):
            invade(case, scales_of(case), grains, tmp_path / name, Launch(binary=binary))


def test_a_lost_watch_of_the_overlap_starts_the_invasion_over(binary, cut, tmp_path):
    case, grains, folder, whole = cut
    shutil.copytree(folder, tmp_path / "cut")
    (tmp_path / "cut" / "overlap.csv").unlink()
    again = invade(case, scales_of(case), grains, tmp_path / "cut", Launch(binary=binary))
    assert again.overlap == whole.overlap
    assert any("it was started over" in warning for warning in again.warnings)


def test_a_checkpoint_of_another_seed_is_not_used(cut):
    _, _, folder, _ = cut
    assert last_checkpoint(folder, tiny("run.cap_ms=0.3", "seed=2")) is None


def test_another_number_of_ranks_is_refused(binary, cut):
    case, grains, folder, _ = cut
    with pytest.raises(CaseError, match=r"begun with --np 1, and --np 2 .* continue with --np 1"):
        invade(case, scales_of(case), grains, folder, Launch(binary=binary, ranks=2))
