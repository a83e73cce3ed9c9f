"""The clean-up: the flow of an invasion turned back, on the real binary."""

import json
import math
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from builders import tiny
from cut_and_continue import StopError

from fdnet.case.file import case_from
from fdnet.dem.checkpoint import Cleaned, csv_row
from fdnet.dem.clean_up import Start, clean_up, cleaned_points, render_clean_up, turned_drag
from fdnet.dem.liggghts import Launch
from fdnet.errors import CaseError
from fdnet.run.dem_stages import invaded, invasion_record, packed_grains
from fdnet.run.folder import open_folder
from fdnet.run.pipeline import RunOptions, run_stages
from fdnet.run.records import Session
from fdnet.scales.scales import back_flow, scales_of

pytestmark = pytest.mark.liggghts

STAGES = ("pack", "invade", "clean_up", "analyse")


def small(*more):
    """25 grains; 300 fines are driven in and some come out again."""
    return tiny(
        *("box.size_mm=[2.0,1.2,1.2]", "box.sides=periodic", "grains.count=25"),
        *("fluid.darcy_length_mm=8.0", "run.time_step_factor=0.2", "run.cap_ms=0.3"),
        "clean_up.drawdown_MPa=1.0",
        *more,
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The run folder of a finished clean-up and its summary."""
    folder = tmp_path_factory.mktemp("run") / "run"
    options = RunOptions(out=folder, show_progress=False, stages=STAGES)
    return folder, run_stages(small(), options)


@pytest.fixture(scope="module")
def start(run):
    """What the clean-up of the run began with."""
    folder, case = run[0], small()
    held = open_folder(folder, case, stages=STAGES, resume=False, force=False)
    options = RunOptions(out=folder)
    session = Session(case=case, scales=scales_of(case), folder=held, options=options)
    grains = packed_grains(folder, case)
    damaged = invaded(session, case, grains, invasion_record(session, case)).damaged
    held.close()
    return Start(grains=grains, invaded=damaged, invasion=folder / "invade", digest="test")


def again(start, flow, folder, binary, **options):
    """A clean-up of the same invasion in another folder."""
    invasion = folder / "invade"
    if not invasion.exists():
        shutil.copytree(start.invasion, invasion)
    begin = replace(start, invasion=invasion)
    return clean_up(flow, begin, folder / "clean_up", Launch(binary=binary, **options))


def test_what_came_out_and_what_stays_is_what_was_there(run):
    folder, summary = run
    tables = (pd.read_csv(folder / f"spheres_{name}.csv") for name in ("damaged", "cleaned"))
    before, after = (one[(one.kind == "fine") & one.x_m.between(0, 2e-3)] for one in tables)
    counts = summary["clean_up"]
    assert set(after.id) <= set(before.id)
    assert counts["inside_before"] == len(before) == summary["invaded_count"]
    assert counts["stayed"] == len(after)
    assert counts["came_out"] == len(before) - len(after) > 0
    rows = pd.read_csv(folder / "clean_up.csv")
    assert rows.fines_before.sum() == len(before)
    assert rows.fines_left_it.sum() == counts["came_out"]
    assert rows.fines_after.sum() == len(after)
    record = json.loads((folder / "clean_up" / "stage.json").read_text())
    assert record["out"] == counts["came_out"]
    damaged = summary["k_damaged_m2"] / summary["k_initial_m2"]
    assert damaged < summary["return_k_over_k0"] <= 1.0


def cut_everywhere(start, folder, binary, scheme, ranks):
    """On its number of ranks, and on no other."""
    keys = (f"drag.scheme={scheme}", "drag.pressure_gradient=true", "clean_up.duration_ms=1.0")
    flow = back_flow(small(*keys))
    whole = again(start, flow, folder / "whole", binary, ranks=ranks)
    for row in whole.history:

        def stop(line, mark=f"FDNET cleaned {row.chunk} "):
            if line.startswith(mark):
                raise StopError

        with pytest.raises(StopError):
            again(start, flow, folder / "cut", binary, ranks=ranks, follow=stop)
    rest = again(start, flow, folder / "cut", binary, ranks=ranks)
    assert len(rest.history) > 3
    assert rest.history == whole.history, (scheme, ranks)
    for column in ("id", "position", "velocity"):
        assert np.array_equal(getattr(rest.state, column), getattr(whole.state, column)), scheme
    name = f"clean_up/post/clean_{whole.history[-1].step}.restart"
    assert (folder / "whole" / name).read_bytes() == (folder / "cut" / name).read_bytes()
    with pytest.raises(CaseError, match=f"begun with --np {ranks}"):
        again(start, flow, folder / "cut", binary, ranks=3 - ranks)


def test_a_clean_up_cut_at_every_checkpoint_goes_on_bit_for_bit(start, tmp_path, binary):
    cut_everywhere(start, tmp_path, binary, "held", 1)


@pytest.mark.nightly
def test_a_clean_up_of_every_scheme_and_on_two_ranks_goes_on_bit_for_bit(start, tmp_path, binary):
    for scheme in ("held", "viscous", "implicit"):
        for ranks in (1, 2):
            cut_everywhere(start, tmp_path / f"{scheme}{ranks}", binary, scheme, ranks)


def test_a_run_cut_in_a_later_stage_gives_the_summary_of_the_uncut_one(run, tmp_path):
    """Cut in the clean-up, and in the analysis after it."""
    folder, first = run
    measured = dict.fromkeys(("seconds", "cpu_seconds", "peak_memory_bytes"))
    for name, gone in (("clean_up", ["clean_up"]), ("analysis", ["summary.json", "sections.csv"])):
        out = shutil.copytree(folder, tmp_path / name)
        for path in (out / one for one in ("manifest.json", *gone)):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        (out / ".unfinished").touch()
        options = RunOptions(out=out, show_progress=False, stages=STAGES, resume=True)
        assert run_stages(small(), options) | measured == first | measured, name


def test_a_record_keeps_restarts_of_later_checkpoints(tmp_path):
    """LIGGGHTS may be some checkpoints ahead of fdnet when one is recorded."""
    (tmp_path / "post").mkdir()
    usual = {"inside": 9, "out": 0, "passed": 0, "quiet": 0}
    rows = [Cleaned(chunk=k, step=100 * k, **usual) for k in range(1, 6)]
    points = cleaned_points(tmp_path, "case")
    lines = [",".join(Cleaned._fields), *map(csv_row, rows)]
    (tmp_path / "history.csv").write_text("\n".join(lines) + "\n")
    for row in rows:
        for suffix in ("dump", "restart"):
            points.path(row.step, suffix).write_text(f"{suffix} {row.step}")
    for row in rows[:3]:
        points.keep(row, ranks=1)
        points.remove_restarts(row.step)
    left = {path.name for path in (tmp_path / "post").glob("*.restart")}
    assert left == {f"clean_{step}.restart" for step in (200, 300, 400, 500)}
    assert points.last() == rows[2]


def test_friction_decides_what_stays(start, tmp_path, binary):
    """The same deposit, once with slippery and once with rough contacts."""
    stayed = []
    for friction in (0.01, 5.0):
        keys = (f"fines.friction={friction}", f"grains.friction={friction}")
        flow = back_flow(small("clean_up.drawdown_MPa=0.5", *keys))
        done = again(start, flow, tmp_path / str(friction), binary)
        stayed.append(done.history[-1].inside)
    assert stayed[0] < stayed[1]


def test_the_drag_is_that_of_the_drawdown_turned_back():
    """Darcy's law: the velocity is as the pressure; Stokes: 6 pi mu r u."""
    case = small("drag.scheme=viscous", "drag.upstream=darcy", "drag.pressure_gradient=true")
    ahead, flow = scales_of(case), back_flow(case)
    share = 1.0 / case.fluid.overbalance_MPa
    drag = turned_drag(flow)
    push = -6 * math.pi * 0.05 * 5e-5 * ahead.interstitial_velocity * share
    assert float(drag["push"]) == pytest.approx(push, rel=1e-12)
    volume = 4 / 3 * math.pi * 5e-5**3
    gradient = -ahead.pressure_gradient * share * volume
    assert float(drag["gradient"]["force"]) == pytest.approx(gradient, rel=1e-12)
    outside = float(drag["push"]) + float(drag["slower"])
    assert outside == pytest.approx(push * ahead.porosity, rel=1e-12)
    text = render_clean_up(flow, "0", "../invade/post/invade_1.restart", None).text
    assert f"addforce {drag['push']} 0.0 0.0" in text


def test_a_case_without_the_table_has_no_such_stage(tmp_path):
    plain = small().data()
    del plain["clean_up"]
    assert "clean_up" not in case_from(plain).stages
    assert case_from(plain).digest("invade") == small().digest("invade")
    with pytest.raises(CaseError, match=r"no table \[clean_up\]"):
        back_flow(case_from(plain))
    options = RunOptions(out=tmp_path / "run", show_progress=False, stages=("pack", "clean_up"))
    with pytest.raises(CaseError, match=r"clean_up: .* no table \[clean_up\]"):
        run_stages(case_from(plain), options)


def test_bad_keys_are_named():
    for keys, said in (
        (("clean_up.drawdown_MPa=-1",), "clean_up.drawdown_MPa: -1"),
        (("fluid.velocity_m_s=0.1",), "nothing says on which way the drawdown is lost"),
        (("clean_up.drawdowns_MPa=1",), "did you mean clean_up.drawdown_MPa"),
        (("clean_up.lift_cake=false",), "the cake is always lifted, remove the key"),
    ):
        with pytest.raises(CaseError) as error:
            small(*keys)
        assert said in str(error.value), keys


def test_a_missing_restart_is_named(start, tmp_path, binary):
    (tmp_path / "invade").mkdir()
    with pytest.raises(CaseError, match=r"invade_\d+\.restart: the clean-up begins with this"):
        again(start, back_flow(small()), tmp_path, binary)
