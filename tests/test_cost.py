"""The expected cost of a run, and the refusal of one longer than `run.max_hours`."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from builders import tiny

from fdnet.case.case import Case
from fdnet.case.file import case_from
from fdnet.scales.cost import cost_of, over_limit
from fdnet.scales.scales import scales_of


def hours(case: Case) -> float:
    cost = cost_of(case, scales_of(case))
    return (cost.pack_seconds + cost.invade_seconds) / 3600


def test_nominal_stiffness_is_the_materials_own():
    case = tiny("run.stiffness_N_m=nominal")
    scales = scales_of(case)
    assert scales.stiffness_factor == 1.0
    assert scales.contacts["grain-grain"].normal_stiffness == pytest.approx(47.15e9)
    assert case_from(case.data()) == case
    assert scales.time_step == pytest.approx(scales_of(tiny()).time_step * (1e4 / 47.15e9) ** 0.5)


def test_steps_and_so_hours_go_with_the_root_of_the_stiffness():
    soft, stiff = (
        cost_of(case, scales_of(case)) for case in (tiny(), tiny("run.stiffness_N_m=1e10"))
    )
    assert stiff.steps / soft.steps == pytest.approx(1e3, rel=1e-3)
    assert stiff.invade_seconds / soft.invade_seconds == pytest.approx(1e3, rel=1e-3)


def test_a_duration_is_what_it_costs():
    case = tiny("run.duration_ms=2.0")
    scales = scales_of(case)
    assert cost_of(case, scales).steps == pytest.approx(2e-3 / scales.time_step, abs=1)


@pytest.mark.parametrize(("factor", "refused"), [(0.999, True), (1.001, False)])
def test_the_limit_is_the_expected_hours(factor, refused):
    limited = tiny(f"run.max_hours={factor * hours(tiny())}")
    assert bool(over_limit(limited, scales_of(limited))) == refused


def test_only_the_stages_to_run_count():
    case = tiny("run.stiffness_N_m=nominal", "run.max_hours=0.01")
    scales = scales_of(case)
    assert over_limit(case, scales, pack=True, invade=False) == ""
    assert over_limit(case, scales, pack=False, invade=False) == ""
    assert "run.max_hours: 0.01 h" in over_limit(case, scales, pack=False, invade=True)


@pytest.mark.parametrize(
    ("assignments", "message"),
    [
        (
            ["run.stiffness_N_m=nominal"],
            r"set by contacts of 4.72e\+10 N/m\).* lower run.stiffness_N_m",
        ),
        (["run.time_step_s=1e-12"], r"\(as given\).* raise run.time_step_s"),
        (
            ["drag.multiplier=1e5", "fluid.velocity_m_s=1e-5"],
            r"drag relaxation time\).* drag.scheme = 'implicit'",
        ),
        (["fines.count=1", "run.duration_ms=1e-4"], "most of it packing 66 grains"),
    ],
)
def test_the_refusal_names_what_makes_the_run_long(assignments, message):
    case = tiny("run.max_hours=1e-6", "run.checkpoint_ms=0.001", *assignments)
    assert re.search(message, over_limit(case, scales_of(case)))


def test_a_thousandfold_viscosity_is_refused_for_its_hours_and_implicit_drag_is_named():
    """tau is 1/1000: explicit drag needs steps of 2 ns, implicit drag those of the contacts."""
    thick = ("fluid.viscosity_cP=5e4", "fluid.velocity_m_s=0.01", "fines.count=3000")
    case = tiny(*thick)
    said = over_limit(case, scales_of(case))
    assert re.search(r"a tenth of the drag relaxation time.*drag\.scheme = 'implicit'", said)
    assert hours(case) > 10 * hours(tiny(*thick, "drag.scheme=implicit"))


def test_the_limit_is_no_part_of_a_digest():
    for stage in ("pack", "invade", "analyse"):
        for policy in ("run.max_hours=1.0", "run.max_overlap=0.1", "run.on_overlap=stop"):
            assert tiny(policy).digest(stage) == tiny().digest(stage)


def fdnet(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "fdnet.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_long_run_is_refused_before_anything_is_written_and_render_still_shows_it(tmp_path):
    path, out = tmp_path / "case.toml", tmp_path / "run"
    path.write_text(
        tiny("run.stiffness_N_m=nominal", "fines.count=3000", "run.max_hours=0.5").toml()
    )
    refused = fdnet("run", path, "--out", out, "--timeout", "5")
    assert refused.returncode == 2
    assert "run.max_hours: 0.5 h, but this case is expected to take" in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
    assert not out.exists()
    shown = fdnet("render", path, "--out", out)
    assert shown.returncode == 0, shown.stderr
    assert "invasion run time" in shown.stdout
    assert "warning: run.max_hours: 0.5 h" in shown.stdout
    assert (out / "invade" / "in.invade").exists()
