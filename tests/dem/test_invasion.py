"""Invasions by the real binary: every fine is counted, a cut run goes on as if never cut."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import tiny

from fdnet.dem import checkpoint, supply
from fdnet.dem.checkpoint import (
    Checkpoint,
    Checkpoints,
    file_digest,
    plug_allowance,
    read_history,
)
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import make_pack
from fdnet.dem.supply import (
    CLEARANCE,
    SURE_CROWDING,
    crowding,
    place_batches,
    refuse_crowded_supply,
)
from fdnet.errors import CaseError, LiggghtsError
from fdnet.run import pipeline
from fdnet.scales.scales import scales_of
from fdnet.spheres.geometry import touching_pairs
from fdnet.spheres.snapshot import Kind

pytestmark = pytest.mark.liggghts
HISTORY_HEADER = ",".join(Checkpoint._fields)


def points(folder, case) -> Checkpoints:
    """The checkpoints of an invasion."""
    return Checkpoints(folder=folder, digest=case.digest("invade"))


def the_slab(case, scales, grains):
    """All fines of a slab that is there at the start."""
    assert case.fines.supply == "slab"
    return next(place_batches(case, scales, grains))


@pytest.fixture(scope="module")
def packed(binary, tmp_path_factory):
    """Grains of the tiny case, with walls and with periodic sides."""
    grains = {}
    for sides in ("walls", "periodic"):
        case = tiny(f"box.sides={sides}")
        grains[sides] = make_pack(
            case, tmp_path_factory.mktemp(sides), Launch(binary=binary)
        ).grains
    return grains


@pytest.mark.parametrize(
    "assignments",
    [[], ["fines.radius_mm=[0.02,0.06]"], ["box.sides=periodic", "fines.concentration=0.3"]],
)
def test_fines_start_clear_of_everything(packed, assignments):
    case = tiny(*assignments)
    scales = scales_of(case)
    grains = packed[case.box.sides]
    fines = the_slab(case, scales, grains)
    assert len(fines) == scales.supplied_count
    pairs, _ = touching_pairs(grains.joined(fines), case.periodic, gap=0.5 * (CLEARANCE - 1))
    assert not np.any(grains.joined(fines).kind[pairs] == Kind.FINE)
    low = fines.position[:, 0].min()
    assert np.min(grains.position[:, 0] - grains.radius) > fines.position[:, 0].max()
    assert fines.position[:, 0].max() - low <= scales.slab_length
    assert np.all(fines.velocity[:, 0] == scales.upstream_velocity)


def test_a_slab_that_cannot_hold_the_fines_is_an_error(packed):
    case = tiny("fines={radius_mm=0.05, count=300, concentration=0.3, supply='slab'}")
    crowded = case.model_copy(
        update={"fines": case.fines.model_copy(update={"concentration": 0.6})}
    )
    with pytest.raises(CaseError, match=r"fines\.concentration: 0\.6 leaves"):
        the_slab(crowded, scales_of(crowded), packed["walls"])


@pytest.mark.parametrize("radius_mm", ["0.05", "[0.015,0.05]", "0.2"])
@pytest.mark.parametrize("sides", ["walls", "periodic"])
@pytest.mark.parametrize("length", [1, 20])
def test_every_fine_finds_a_place_up_to_the_sure_crowding(monkeypatch, radius_mm, sides, length):
    """Slabs of 1 and 20 diameters, just above the limit; below it nothing is drawn beforehand."""
    high = float(radius_mm.strip("[]").rsplit(",", 1)[-1])
    case = tiny(
        f"box.sides={sides}", f"fines={{radius_mm={radius_mm}, slab_mm={2 * high * length}}}"
    )
    fines = case.fines.model_copy(update={"concentration": 1.0})
    fines = fines.model_copy(
        update={
            "concentration": SURE_CROWDING / crowding(case.model_copy(update={"fines": fines}))
        }
    )
    for seed in range(5):
        full = fines.model_copy(update={"concentration": 1.001 * fines.concentration})
        full = case.model_copy(update={"fines": full, "seed": seed})
        assert crowding(full) > SURE_CROWDING
        refuse_crowded_supply(full, scales_of(full))
    monkeypatch.setattr(supply, "_draw", None)
    sure = case.model_copy(
        update={"fines": fines.model_copy(update={"concentration": 0.999 * fines.concentration})}
    )
    refuse_crowded_supply(sure, scales_of(sure))


def test_crowding_of_equal_fines_far_from_walls_is_their_concentration():
    assert crowding(tiny("box.sides=periodic")) == pytest.approx(tiny().fines.concentration)
    assert crowding(tiny()) == pytest.approx(tiny().fines.concentration * (1.6 / 1.5) ** 2)


def test_crowding_of_unequal_fines_by_quadrature():
    radius = np.linspace(0.02, 0.06, 100_001)
    shut = np.mean((0.06 + radius) ** 3) / (8 * np.mean(radius**3))
    case = tiny("box.sides=periodic", "fines.radius_mm=[0.02,0.06]")
    assert crowding(case) == pytest.approx(case.fines.concentration * shut, rel=1e-4)


def test_a_begun_invasion_is_not_tried_out_again(tmp_path, monkeypatch):
    """Its fines are placed already: a folder with a checkpoint is not refused for its supply."""
    monkeypatch.setattr(pipeline, "refuse_crowded_supply", refuse_all)
    (tmp_path / "run" / "invade").mkdir(parents=True)
    history = tmp_path / "run" / "invade" / "history.csv"
    options = pipeline.RunOptions(out=tmp_path / "run", show_progress=False)
    for text, message in (
        (HISTORY_HEADER + "\n", "crowded"),
        (HISTORY_HEADER + "\n1,2,3,4,5,6,7,8\n", "holds no fdnet run"),
    ):
        history.write_text(text)
        with pytest.raises(CaseError, match=message):
            pipeline.run_stages(tiny(), options)
    with pytest.raises(CaseError, match="crowded"):
        pipeline.run_stages(tiny(), replace(options, force=True))


def refuse_all(*_):
    raise CaseError("crowded")


@pytest.mark.parametrize(
    "assignments",
    [
        [],
        ["box.sides=periodic"],
        ["grains.motion=mobile"],
        ["drag.refresh_steps=1"],
        ["drag.upstream=darcy"],
        ["drag.scheme=viscous", "drag.upstream=darcy"],
        ["drag.scheme=implicit", "fines.radius_mm=[0.02,0.05]"],
        ["fines.radius_mm=[0.02,0.05]", "fines.friction=0.0", "run={duration_ms=0.25}"],
    ],
)
def test_supplied_is_invaded_passed_and_upstream_at_every_checkpoint(
    binary, packed, tmp_path, assignments
):
    case = tiny("run.cap_ms=0.6", *assignments)
    scales = scales_of(case)
    result = invade(case, scales, packed[case.box.sides], tmp_path, Launch(binary=binary))
    for row in result.history:
        assert row.upstream + row.invaded + row.passed == scales.supplied_count
    x = result.damaged.fines().position[:, 0]
    assert np.count_nonzero((x >= 0) & (x < case.size_m[0])) == result.history[-1].invaded
    assert result.max_overlap < 0.1
    assert result.stop_reason in {"plugged", "duration", "supply_exhausted", "cap"}
    assert (result.stop_reason == "duration") == (case.run.duration_ms is not None)


def test_fines_of_one_micrometre_invade(binary, packed, tmp_path):
    """A size ratio of 1/250 and steps of 0.1 ns: all are counted, and move with the fluid."""
    case = tiny("fines={radius_mm=0.001, count=20}", "run={duration_ms=0.02}")
    scales = scales_of(case)
    result = invade(case, scales, packed["walls"], tmp_path, Launch(binary=binary))
    fines = result.damaged.fines()
    assert len(fines) == 20
    assert fines.velocity[:, 0].max() == pytest.approx(scales.interstitial_velocity, rel=1e-6)
    assert result.max_overlap < 0.03


@pytest.mark.parametrize(
    "assignment",
    [
        "run.skin_mm=0.01",
        "run.skin_mm=0.25",
        "run.neighbour_bin_mm=0.05",
        "run.neighbour_bin_mm=1.6",
    ],
)
def test_the_neighbour_search_changes_time_not_motion(binary, packed, tmp_path, assignment):
    """It changes the order of sums: before chaos grows, positions agree to 1e-6 of a fine."""
    ends = []
    for name, extra in (("own", [assignment]), ("default", [])):
        case = tiny("run.duration_ms=0.04", *extra)
        result = invade(
            case, scales_of(case), packed["walls"], tmp_path / name, Launch(binary=binary)
        )
        assert result.max_overlap > 0.01
        ends.append(result.damaged.position)
    assert np.allclose(ends[0], ends[1], rtol=0, atol=1e-10)


def test_fixed_grains_do_not_move_and_mobile_ones_do(binary, packed, tmp_path):
    grains = packed["walls"]
    for motion in ("fixed", "mobile"):
        case = tiny(f"grains.motion={motion}", "run.duration_ms=0.2")
        result = invade(case, scales_of(case), grains, tmp_path / motion, Launch(binary=binary))
        moved = np.max(np.abs(result.damaged.grains().position - grains.position))
        assert (moved > 0) == (motion == "mobile")
        assert moved < 0.2 * 0.25e-3


def test_passed_fines_are_removed_and_counted(binary, packed, tmp_path):
    case = tiny("fines.radius_mm=0.02", "fines.friction=0.0", "fines.count=200", "run.cap_ms=3.0")
    result = invade(case, scales_of(case), packed["walls"], tmp_path, Launch(binary=binary))
    assert result.history[-1].passed > 0
    assert len(result.damaged.fines()) == 200 - result.history[-1].passed
    assert result.stop_reason == "supply_exhausted"
    assert any("empty slab" in warning for warning in result.warnings)


def test_every_stop_reason_is_told(binary, packed, tmp_path):
    cases = {"cap": tiny("run.cap_ms=0.05"), "plugged": tiny("fines={radius_mm=0.12, count=60}")}
    for reason, case in cases.items():
        result = invade(
            case, scales_of(case), packed["walls"], tmp_path / reason, Launch(binary=binary)
        )
        assert result.stop_reason == reason


def test_broken_checkpoints_are_passed_over(binary, packed, tmp_path):
    case = tiny("run.cap_ms=0.3")
    scales, grains = scales_of(case), packed["walls"]
    whole = invade(case, scales, grains, tmp_path, Launch(binary=binary))
    last, before = whole.history[-1], whole.history[-2]
    dump = tmp_path / "post" / f"invade_{last.step}.dump"
    whole_dump = dump.read_bytes()
    dump.write_bytes(whole_dump[:-40])
    assert points(tmp_path, case).last() == before
    text = whole_dump.replace(b"ITEM: NUMBER OF ATOMS\n300\n", b"ITEM: NUMBER OF ATOMS\n299\n")
    assert text != whole_dump
    dump.write_bytes(text[: text.rstrip(b"\n").rindex(b"\n") + 1])
    assert points(tmp_path, case).last() == before
    (tmp_path / "post" / f"invade_{before.step}.restart").write_bytes(b"")
    assert points(tmp_path, case).last() is None
    again = invade(case, scales, grains, tmp_path, Launch(binary=binary))
    assert np.array_equal(again.damaged.position, whole.damaged.position)


def test_a_restart_cut_by_a_full_disk_is_set_aside(binary, packed, tmp_path):
    case = tiny("run.cap_ms=0.3")
    scales, grains = scales_of(case), packed["walls"]
    whole = invade(case, scales, grains, tmp_path, Launch(binary=binary))
    rows = (tmp_path / "history.csv").read_text().splitlines(keepends=True)
    (tmp_path / "history.csv").write_text("".join(rows[:-1]))
    kept = whole.history[-2]
    restart = tmp_path / "post" / f"invade_{kept.step}.restart"
    restart.write_bytes(restart.read_bytes()[: int(0.9 * restart.stat().st_size)])
    cut = points(tmp_path, case).record(kept.step)._replace(restart=file_digest(restart))
    points(tmp_path, case).store(kept.step, cut)
    assert points(tmp_path, case).last() == kept
    again = invade(case, scales, grains, tmp_path, Launch(binary=binary))
    assert again.history == whole.history
    assert np.array_equal(again.damaged.position, whole.damaged.position)


def test_fines_that_vanish_are_an_error(packed, tmp_path):
    case = tiny()
    (tmp_path / "post").mkdir()
    row = checkpoint.Checkpoint(
        chunk=1,
        step=10,
        upstream=200,
        invaded=90,
        passed=5,
        removed_upstream=0,
        most_crossed=95,
        quiet=0,
    )
    damaged = packed["walls"].joined(the_slab(case, scales_of(case), packed["walls"]))
    with pytest.raises(LiggghtsError, match="fines inside"):
        checkpoint.check_counts(tmp_path, row, damaged, 300)
    row = checkpoint.Checkpoint(
        chunk=1,
        step=10,
        upstream=300,
        invaded=0,
        passed=0,
        removed_upstream=0,
        most_crossed=0,
        quiet=0,
    )
    with pytest.raises(LiggghtsError, match="is not the 301 supplied"):
        checkpoint.check_counts(tmp_path, row, damaged, 301)


def test_history_with_a_half_written_line(tmp_path: Path):
    (tmp_path / "history.csv").write_text("chunk,step\n1,10,5,5,0,0,5,0\n2,20,4,")
    assert [row.chunk for row in read_history(tmp_path)] == [1]
    with pytest.raises(LiggghtsError, match="no checkpoint recorded"):
        read_history(tmp_path / "none")


def test_a_trickle_may_count_as_plugged(binary, packed, tmp_path):
    """With `plug_rate` the end comes at the first plug time with no more crossings than that."""
    case = tiny(
        "fines.count=900",
        "run.checkpoint_ms=0.01",
        "run.plug_time_ms=0.05",
        "run.plug_rate=0.5",
        "run.cap_ms=2",
    )
    scales, grains = scales_of(case), packed["walls"]
    result = invade(case, scales, grains, tmp_path, Launch(binary=binary))
    allowed = plug_allowance(case, scales)
    crossed = [row.invaded + row.passed for row in result.history]
    assert result.stop_reason == "plugged"
    assert 0 < crossed[-1] - crossed[-6] <= allowed
    assert all(
        crossed[n] - result.history[n - 5].most_crossed > allowed
        for n in range(5, len(crossed) - 1)
        if result.history[n].quiet == 0
    )
