"""A cut invasion that is continued gives the numbers of an uncut one, wherever it was cut."""

import json
import os
import shutil
import signal
import time
from importlib import metadata
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from builders import followed, tiny
from cut_and_continue import cell_case, differences
from robustness.runs import contents

from fdnet.dem import checkpoint
from fdnet.dem.checkpoint import UPDATES, Checkpoints, file_digest, read_updates, rows_digest
from fdnet.dem.invasion import steps_between
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.dem.supply import batches_of
from fdnet.errors import CaseError, LiggghtsError
from fdnet.scales.scales import scales_of

pytestmark = pytest.mark.liggghts
HERTZ = "contact.model=hertz"
QUICK = {
    ("walls", "fixed", "batches", "held"): (),
    ("periodic", "fixed", "batches", "held"): (),
    ("periodic", "mobile", "batches", "viscous"): (),
    ("walls", "fixed", "slab", "implicit"): (),
    ("periodic", "fixed", "slab", "viscous"): (HERTZ,),
    ("walls", "mobile", "batches", "held"): (
        *(HERTZ, "box.wall_friction=0.3", "contact.restitution=liquid"),
        *("contact.rolling_friction=0.2", "contact.cohesion_J_m3=1e6"),
    ),
}
"""Cells of every run of the suite, with further keys; in the first three a continued one once gave
other numbers."""


@pytest.mark.parametrize("cell", QUICK, ids="-".join)
def test_a_continued_invasion_is_the_uncut_one(go, tmp_path, cell):
    assert differences(go, cell_case(*cell, *QUICK[cell]), tmp_path) == []
    assert not list(tmp_path.glob("*/post/*contacts*")), "the scratch file stays"


ENDLESS = "fines={radius_mm=0.05, concentration=0.1}"


def test_a_continued_invasion_by_mud_without_an_end_is_the_uncut_one(go, tmp_path):
    """It stops by its cap and would take in more mud."""
    case = cell_case("periodic", "fixed", "batches", "implicit", ENDLESS)
    assert len(batches_of(case, scales_of(case)).counts) > 10
    assert differences(go, case, tmp_path) == []


@pytest.mark.nightly
@pytest.mark.parametrize("scheme", ["held", "implicit", "viscous"])
def test_a_continued_invasion_is_the_uncut_one_everywhere(go, tmp_path, scheme):
    """All sides, motions and supplies, on one rank at each place and on two."""
    parts = ("walls", "periodic"), ("fixed", "mobile"), ("slab", "batches"), (1, 2)
    for *cell, ranks in product(*parts):
        case, folder = cell_case(*cell, scheme), tmp_path / "-".join([*cell, str(ranks)])
        left = differences(go, case, folder, ranks=ranks, everywhere=ranks == 1)
        assert left == [], (cell, ranks)


SLOWER = ("fines.supply=batches", "fines.count=600", "run.checkpoint_ms=0.02", "run.cap_ms=0.3")
CASE = tiny("run.cap_ms=0.3")


@pytest.fixture(scope="module")
def done(go, tmp_path_factory):
    """A small invasion, finished: folder and result."""
    folder = tmp_path_factory.mktemp("done")
    return folder, go(CASE, folder)


@pytest.fixture
def cut(done, tmp_path):
    """A copy of the folder of that invasion, and the result."""
    return shutil.copytree(done[0], tmp_path / "cut"), done[1]


def points(folder, case=CASE) -> Checkpoints:
    return Checkpoints(folder=folder, digest=case.digest("invade"))


def same(one, other) -> bool:
    places = one.state.position, other.state.position
    return one.history == other.history and np.array_equal(*places)


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
def test_a_checkpoint_that_is_not_as_recorded_is_passed_over(done, tmp_path, kind):
    last, before = done[1].history[-1], done[1].history[-2]
    for spoil in (zeros, noise, one_bit, other_step, Path.unlink):
        folder = shutil.copytree(done[0], tmp_path / spoil.__name__)
        assert points(folder).last() == last
        spoil(folder / "post" / f"invade_{last.step}.{kind}")
        assert points(folder).last() == before, spoil.__name__


def test_a_restart_cut_by_a_full_disk_is_set_aside(go, cut):
    folder, whole = cut
    rows = (folder / "history.csv").read_text().splitlines(keepends=True)
    (folder / "history.csv").write_text("".join(rows[:-1]))
    kept = whole.history[-2]
    restart = folder / "post" / f"invade_{kept.step}.restart"
    restart.write_bytes(restart.read_bytes()[: int(0.9 * restart.stat().st_size)])
    record = points(folder).record(kept.step)._replace(restart=file_digest(restart))
    points(folder).store(kept.step, record)
    assert points(folder).last() == kept
    assert same(go(CASE, folder), whole)


def test_notes_between_the_checkpoints_are_passed_over_and_kept(go, cut):
    folder, whole = cut
    for name in ("invade_notes.txt", "invade_x.dump", "invade_1.dump.bak", "invade_.record"):
        (folder / "post" / name).write_text("mine")
    again = go(CASE, folder)
    assert same(again, whole)
    assert again.warnings == whole.warnings
    assert (folder / "post" / "invade_notes.txt").read_text() == "mine"


def test_a_changed_history_is_refused(go, done, tmp_path):
    changes = {"gone": [], "garbled": ["?,?\n"], "changed": ["1,2,3,4,5,6,7,8\n"]}
    for row, (what, lines) in product((1, 2), changes.items()):
        folder = shutil.copytree(done[0], tmp_path / f"{what}{row}")
        rows = (folder / "history.csv").read_text().splitlines(keepends=True)
        rows[row : row + 1] = lines
        (folder / "history.csv").write_text("".join(rows))
        with pytest.raises(LiggghtsError, match=r"history\.csv: .*put the file back"):
            go(CASE, folder)


def test_a_lost_watch_of_the_overlap_starts_the_invasion_over(go, cut):
    folder, whole = cut
    (folder / "overlap.csv").unlink()
    assert points(folder).last() is None
    assert go(CASE, folder).overlap == whole.overlap


def test_another_number_of_ranks_is_refused(go, done):
    assert points(done[0], tiny("run.cap_ms=0.3", "seed=2")).last() is None
    with pytest.raises(CaseError, match=r"begun with --np 1, and --np 2 .* continue with --np 1"):
        go(CASE, done[0], ranks=2)


def test_what_another_version_of_fdnet_began_is_refused(go, cut):
    """Its forces may be others, and a run of two ways of making them is neither's result."""
    folder, mine = cut[0], metadata.version("fdnet")
    for its, said in (({"fdnet": "0.0.9"}, "fdnet 0.0.9"), ({}, "fdnet of an earlier version")):
        for path in (folder / "post").glob("*.record"):
            data = json.loads(path.read_text())
            assert data.pop("fdnet") in (mine, "0.0.9")
            path.write_text(json.dumps(data | its))
        before = contents(folder)
        with pytest.raises(CaseError, match=f"begun with {said}, and fdnet {mine} .*--force"):
            go(CASE, folder)
        assert contents(folder) == before


# ---- Invasions whose forces fdnet computes while LIGGGHTS waits.


def small(*more):
    """15 grains, fines in batches, 5 checkpoints with five updates each."""
    return followed(
        "drag.update_travel=0.2",
        "fines.supply=batches",
        "fines.count=400",
        "run.cap_ms=0.25",
        "run.checkpoint_ms=0.05",
        *more,
    )


@pytest.fixture(scope="module")
def coupled(go, tmp_path_factory):
    """A coupled invasion, finished: folder and result."""
    folder = tmp_path_factory.mktemp("coupled")
    return folder, go(small(), folder)


@pytest.mark.parametrize("keys", [(), SLOWER, (ENDLESS, *SLOWER[2:])])
def test_a_continued_invasion_in_the_network_s_field_is_the_uncut_one(go, tmp_path, keys):
    """With a slab, and with batches that come as the mud slows down, some or without an end."""
    assert differences(go, followed(*keys), tmp_path) == []


RISING = followed(*SLOWER, "run.stiffness_N_m=auto", way="fluid.darcy_length_mm=8.0")


@pytest.fixture(scope="module")
def rising(go, tmp_path_factory):
    """An invasion whose springs grow with the load, finished: folder and result."""
    folder = tmp_path_factory.mktemp("rising")
    return folder, go(RISING, folder)


def test_springs_grow_with_the_load_and_go_on_bit_for_bit(go, rising, tmp_path):
    folder, whole = rising
    steps = np.diff([0, *(row.step for row in whole.history)])
    assert steps[-1] > steps[0], "no spring was stiffened"
    assert 0.01 < whole.overlap.fraction < 0.04, "3 % are aimed at"
    times = [row["time_s"] for row in whole.updates]
    scales = scales_of(RISING)
    chunk, usual = scales.checkpoint_steps * scales.time_step, scales.contacts["grain-grain"]
    deck = (folder / "in.invade.resume").read_text()
    step = float(deck.split("\ntimestep ")[1].split()[0])
    spring = float(deck.split(" kn peratomtypepair 3 ")[1].split()[0])
    assert step < scales.time_step
    bound = usual.normal_stiffness * scales.time_step**2
    assert spring * step**2 == pytest.approx(bound, rel=1e-9)
    more = steps[-1] / steps[0]
    assert scales.time_step / whole.last.time_step == pytest.approx(more)
    assert whole.last.stiffness / scales.stiffness == pytest.approx(more**2)
    begin = [time / chunk for time in times if round(time / chunk, 9) % 1 == 0]
    assert begin == pytest.approx(range(len(steps)))
    assert differences(go, RISING, tmp_path) == []


@pytest.mark.parametrize("spoil", [noise, Path.unlink])
def test_springs_do_not_follow_from_a_dump_that_is_spoilt(go, rising, tmp_path, spoil):
    """Without watched overlaps the springs of a chunk follow from the dumps that are compared."""
    folder, history = shutil.copytree(rising[0], tmp_path / "cut"), rising[1].history
    kept = points(folder, RISING)
    (folder / "overlap.csv").unlink()
    for suffix in ("dump", "restart", "record"):
        kept.path(history[-1].step, suffix).unlink()
    for row in history[:-1]:
        kept.store(row.step, kept.record(row.step)._replace(overlap=rows_digest([])))
    steps = np.diff([0, *(row.step for row in history[:-1])]).tolist()
    spoil(kept.path(history[checkpoint.reference_chunks(steps, 1)[-1]].step, "dump"))
    with pytest.raises(LiggghtsError, match="the springs of the next chunk follow from it"):
        go(RISING, folder)


@pytest.mark.nightly
def test_a_continued_coupled_invasion_is_the_uncut_one_everywhere(go, tmp_path):
    for ranks in (1, 2):
        assert differences(go, small(), tmp_path / f"{ranks}", ranks=ranks) == [], ranks


def test_every_chunk_begins_with_an_update_and_holds_the_travel(coupled):
    folder, result = coupled
    case = small()
    scales = scales_of(case)
    chunk, rows = scales.checkpoint_steps, list(result.updates)
    ends = [row["step"] for row in rows[1:]] + [len(result.history) * chunk]
    for row, end in zip(rows, ends, strict=True):
        pace = row["velocity_m_s"] / scales.porosity
        steps = steps_between(case, scales, pace)
        assert 0.9 * 0.2e-4 < steps * scales.time_step * pace <= 0.2e-4
        assert end == min(row["step"] + steps, (row["step"] // chunk + 1) * chunk)
    assert read_updates(folder) == list(result.updates)


def test_a_changed_record_of_updates_makes_the_checkpoint_unusable(coupled, tmp_path):
    folder, whole = shutil.copytree(coupled[0], tmp_path / "cut"), coupled[1]
    assert points(folder, small()).last() == whole.history[-1]
    lines = (folder / UPDATES).read_text().splitlines()
    row = lines[-2].split(",")
    row[lines[0].split(",").index("factor_mean")] = "1.0"
    lines[-2] = ",".join(row)
    (folder / UPDATES).write_text("\n".join(lines) + "\n")
    assert points(folder, small()).last() == whole.history[-2]


def test_liggghts_is_killed_and_the_run_goes_on_bit_for_bit(go, coupled, tmp_path):
    def kill(line: str) -> None:
        if line.startswith("FDNET checkpoint 3 "):
            children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
            for child in children:
                if b"liggghts" in Path(f"/proc/{child}/cmdline").read_bytes():
                    os.kill(int(child), signal.SIGKILL)

    with pytest.raises(LiggghtsError, match=r"in\.invade: LIGGGHTS failed \(ended by signal 9"):
        go(small(), tmp_path, follow=kill)
    again = go(small(), tmp_path)
    assert same(again, coupled[1])
    assert again.updates == coupled[1].updates


def test_what_goes_wrong_while_liggghts_waits_is_reported(binary, tmp_path):
    for command, limit, message in (
        ("nonsense 1", None, "ERROR: Unknown command: nonsense"),
        ("shell sleep 30", 1.0, "did not end within its time limit"),
    ):
        launch = Launch(binary=binary, deadline=limit and time.monotonic() + limit)
        with pytest.raises(LiggghtsError, match=message):
            run_deck(tmp_path, "in.none", launch, lambda feed, one=command: feed(one))
