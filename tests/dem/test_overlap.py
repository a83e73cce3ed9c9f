"""The overlap of fines in an invasion: it is measured right, changes no motion, warns or stops."""

import math
from contextlib import nullcontext

import numpy as np
import pytest
from builders import resting_spheres, tiny

from fdnet.dem import checkpoint, invade_deck, invasion
from fdnet.dem.checkpoint import (
    Deepest,
    cut_watch,
    deepest_of,
    read_watch,
    watch_variables,
    write_watch_parts,
)
from fdnet.dem.deck import contact_variables, number, render_text, specimen_box, write_data
from fdnet.dem.invade_deck import render_invade, write_invade_inputs
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.dem.packing import make_pack
from fdnet.errors import LiggghtsError
from fdnet.scales.scales import scales_of
from fdnet.spheres.geometry import touching_pairs
from fdnet.spheres.snapshot import Kind

LIMIT = 0.03
FAST = ("run.cap_ms=0.3", f"run.max_overlap={LIMIT}")


@pytest.fixture(scope="module")
def grains(binary, tmp_path_factory):
    case = tiny()
    return make_pack(case, tmp_path_factory.mktemp("pack"), Launch(binary=binary)).grains


def deck_of(*assignments: str):
    case = tiny(*assignments)
    return render_invade(case, scales_of(case), grain_of(case))


def grain_of(case):
    return resting_spheres([[2e-4, 8e-4, 8e-4]], 2.5e-4, specimen_box(case), kind=Kind.GRAIN)


def test_the_deck_watches_where_it_can_and_says_where_it_cannot():
    assert "fix overlap all print 50 " in deck_of().text
    for assignment, why in (
        ("grains.motion=mobile", "pairs of grains"),
        ("fines.radius_mm=[0.04,0.05]", "unequal"),
    ):
        deck = deck_of(assignment)
        refuses_the_watch(deck, why)
    case = tiny()
    deck = render_invade(case, scales_of(case), grain_of(case), packed=False)
    refuses_the_watch(deck, "once they are packed")


def refuses_the_watch(deck, why):
    assert "compute" not in deck.text
    assert any(
        item.what == "overlap between checkpoints" and why in item.why for item in deck.left_out
    )


def test_the_watch_never_writes_more_than_some_hundred_rows_a_chunk():
    for case in (tiny(), tiny("run.stiffness_N_m=nominal")):
        scales = scales_of(case)
        watch = watch_variables(case, scales, grain_of(case))
        assert scales.checkpoint_steps / watch["every"] < 210


def test_what_was_seen_is_read_line_by_line(tmp_path):
    assert list(read_watch(tmp_path)) == []
    (tmp_path / "overlap.csv").write_text(
        "# step,overlap\n50,-1e+24\n100,0.02\n# step,overlap\n150,0.01\n1,x\n200,0."
    )
    seen = list(read_watch(tmp_path))
    assert [(row.step, row.fraction) for row in seen] == [
        (50, 0.0),
        (100, 0.02),
        (150, 0.01),
        (1, 0.0),
    ]
    assert deepest_of(seen) == Deepest(step=100, fraction=0.02)
    assert deepest_of([]) == Deepest(step=0, fraction=0.0)
    cut_watch(tmp_path, 100)
    assert [row.step for row in read_watch(tmp_path)] == [50, 100, 1]


@pytest.mark.liggghts
def test_in_turn_every_grain_is_watched_with_the_fines_and_none_that_it_touches(
    binary, grains, tmp_path
):
    """LIGGGHTS writes which spheres are watched in two rounds of chunks."""
    case = tiny("run.cap_ms=0.2")
    groups = watch_variables(case, scales_of(case), grains)["turns"]
    deck = write_invade_inputs(case, scales_of(case), grains, tmp_path).text
    text = deck[: deck.index("region specimen")] + "run 0\n"
    for chunk in range(1, 2 * groups + 1):
        text += f"variable chunk equal {chunk}\n" + render_text("watched.in.j2", {})
        text += f"write_dump watched custom {chunk}.dump id type\n"
    (tmp_path / "in.turns").write_text(text + 'print "DECK_DONE"\n')
    run_deck(tmp_path, "in.turns", Launch(binary=binary))
    pairs, _ = touching_pairs(grains, case.periodic)
    assert len(pairs) > len(grains)
    rounds: list[list[int]] = [[], []]
    for chunk in range(1, 2 * groups + 1):
        table = np.loadtxt(tmp_path / f"{chunk}.dump", skiprows=9, dtype=int)
        seen = table[table[:, 1] == 1, 0]
        assert np.sum(table[:, 1] == 2) == case.fines.count
        assert not np.any(np.isin(grains.id[pairs], seen).all(axis=1))
        rounds[(chunk - 1) // groups] += seen.tolist()
    for watched in rounds:
        assert sorted(watched) == sorted(grains.id.tolist())


@pytest.mark.liggghts
def test_the_deck_sees_the_overlap_of_an_impact(binary, tmp_path):
    """v sqrt(m/k) of an undamped spring, over the fine's diameter; before and after it nothing.

    The grain that is hit overlaps another one by a third, which is no overlap of a fine.
    """
    case = tiny("fines.damping_ratio=0.0", "grains.damping_ratio=0.0", "fines.friction=0.0")
    scales, radius, speed = scales_of(case), 0.05e-3, 2.0
    places = [[2e-3, 8e-4, 8e-4], [2e-3 + 3.3e-4, 8e-4, 8e-4]]
    pair = resting_spheres(places, 2.5e-4, specimen_box(case), kind=Kind.GRAIN)
    fine = resting_spheres(
        [[2e-3 - 3.05e-4, 8e-4, 8e-4]], radius, specimen_box(case), kind=Kind.FINE, first=3
    )
    write_data(
        tmp_path / "hit.data",
        pair.joined(fine),
        bounds=specimen_box(case),
        density=np.array([2650.0, 2650.0, 2146.0]),
        types=3,
    )
    header = {
        "stage": "test",
        "case_name": "hit",
        "digest": "-",
        "left_out": [],
        "boundary": "f f f",
        "processors": "",
    }
    text = (
        render_text("_header.in.j2", header)
        + "read_data hit.data\nneighbor 5e-5 bin\nneigh_modify delay 0\n"
    )
    contacts = contact_variables(case, scales, "invade", friction=False)
    text += render_text(
        "_contacts.in.j2", {"contacts": contacts, "time_step": number(scales.time_step / 5)}
    )
    text += "group grains type 1\ngroup fines type 2\n"
    text += "fix still grains freeze\nfix integ fines nve/sphere\n"
    text += f"velocity fines set {speed} 0 0 units box\n"
    write_watch_parts(case, pair, tmp_path)
    text += render_text(
        "_overlap.in.j2", {"overlap": watch_variables(case, scales, pair) | {"every": 2}}
    )
    text += "variable chunk equal 1\n" + render_text("watched.in.j2", {})
    (tmp_path / "in.hit").write_text(text + 'run 2000\nprint "DECK_DONE"\n')
    run_deck(tmp_path, "in.hit", Launch(binary=binary))
    seen = list(read_watch(tmp_path))
    mass = 4 / 3 * math.pi * radius**3 * 2146
    expected = (
        speed * math.sqrt(mass / scales.contacts["grain-fine"].normal_stiffness) / (2 * radius)
    )
    assert deepest_of(seen).fraction == pytest.approx(expected, rel=2e-3)
    assert seen[0].fraction == seen[-1].fraction == 0.0


@pytest.mark.liggghts
def test_watching_does_not_move_a_single_bit(binary, grains, tmp_path, monkeypatch):
    case = tiny("run.cap_ms=0.2")
    watched = invade(case, scales_of(case), grains, tmp_path / "watched", Launch(binary=binary))
    monkeypatch.setattr(invade_deck, "watch_variables", lambda *_: None)
    alone = invade(case, scales_of(case), grains, tmp_path / "alone", Launch(binary=binary))
    assert not (tmp_path / "alone" / "overlap.csv").exists()
    assert np.array_equal(watched.damaged.position, alone.damaged.position)
    assert watched.overlap == deepest_of(read_watch(tmp_path / "watched"))
    assert watched.max_overlap > alone.max_overlap > 0


@pytest.mark.liggghts
@pytest.mark.parametrize("motion", ["fixed", "mobile"])
def test_a_run_past_the_limit_stops_when_asked_and_goes_on_when_told(
    binary, grains, tmp_path, motion
):
    stopping = tiny(*FAST, f"grains.motion={motion}", "run.on_overlap=stop")
    warning = tiny(*FAST, f"grains.motion={motion}")
    scales = scales_of(stopping)
    for _ in range(2):
        with pytest.raises(
            LiggghtsError, match=r"a fine overlapped by .* at step \d+ .*stopped at checkpoint"
        ):
            invade(stopping, scales, grains, tmp_path / "run", Launch(binary=binary))
    whole = invade(warning, scales, grains, tmp_path / "whole", Launch(binary=binary))
    again = invade(warning, scales, grains, tmp_path / "run", Launch(binary=binary))
    assert again.history == whole.history
    assert np.array_equal(again.damaged.position, whole.damaged.position)
    assert again.overlap == whole.overlap
    assert list(read_watch(tmp_path / "run")) == list(read_watch(tmp_path / "whole"))
    assert again.max_overlap > LIMIT


@pytest.mark.liggghts
def test_a_run_within_the_limit_is_not_stopped(binary, grains, tmp_path):
    case = tiny("run.cap_ms=0.2", "fluid.velocity_m_s=1.0", "run.on_overlap=stop")
    assert (
        0
        < invade(case, scales_of(case), grains, tmp_path, Launch(binary=binary)).max_overlap
        < 0.03
    )


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("policy", "raised"), [("stop", "history.csv: no row for the checkpoint"), ("warn", None)]
)
def test_a_checkpoint_without_its_row_is_named_where_it_is_looked_at(
    binary, grains, tmp_path, monkeypatch, policy, raised
):
    case = tiny(
        "run.cap_ms=0.2",
        "run.checkpoint_ms=0.1",
        "fluid.velocity_m_s=1.0",
        f"run.on_overlap={policy}",
    )
    real = checkpoint.read_rows

    def without_the_first(folder, kind=checkpoint.Checkpoint):
        return tuple(row for row in real(folder, kind) if row.chunk != 1)

    for reader in (checkpoint, invasion):
        monkeypatch.setattr(reader, "read_rows", without_the_first)
    with pytest.raises(LiggghtsError, match=raised) if raised else nullcontext():
        invade(case, scales_of(case), grains, tmp_path, Launch(binary=binary))
