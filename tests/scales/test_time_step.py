"""The time step and held drag below, at and above each bound, and the cost of a run."""

import math

import pytest
from builders import answer, naming, tiny

from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.scales.clock import relaxation_time
from fdnet.scales.cost import cost_of, over_limit
from fdnet.scales.scales import scales_of

FINE = 4 / 3 * math.pi * (0.05e-3) ** 3 * 2146

FAST = "drag.multiplier=1e3"

SLOW = "fluid.velocity_m_s=0.005"
"""So slow a fluid that drag a thousand times Stokes's does not press fines shut."""


def bound() -> float:
    """sqrt(m/k) of a fine against a grain or wall, of 1e4 N/m x 37.77 / 47.15."""
    return math.sqrt(FINE / (1e4 * (94.3 * 63 / (94.3 + 63)) / 47.15))


def tau(multiplier: float = 1.0) -> float:
    return relaxation_time(0.05e-3, 2146, 0.05, multiplier)


def warnings_of(case: Case) -> str:
    return " | ".join(scales_of(case).warnings)


def explicit(step: float, scheme: str) -> Case:
    held = ["drag.refresh_steps=1"] if scheme == "held" else []
    return tiny(f"run.time_step_s={step!r}", f"drag.scheme={scheme}", FAST, SLOW, *held)


def test_the_contact_bound_holds_for_every_scheme():
    for scheme in ["held", "implicit", "viscous"]:
        case = tiny(f"run.time_step_s={0.3 * bound()!r}", f"drag.scheme={scheme}")
        assert scales_of(case).time_step == 0.3 * bound(), scheme
        with naming(scheme), pytest.raises(CaseError, match="contact bound"):
            scales_of(tiny(f"run.time_step_s={0.3001 * bound()!r}", f"drag.scheme={scheme}"))


def test_a_long_step_is_accepted_as_far_as_the_contacts_leave_it_stable():
    for keys, largest in [
        (["fines.damping_ratio=0.4"], 0.3),
        (["fines.damping_ratio=0.5"], math.sqrt(1.0) - math.sqrt(0.5)),
        (["fines.damping_ratio=0.7"], math.sqrt(1.48) - 0.7 * math.sqrt(2)),
        (["fines.damping_ratio=0.9"], 0.2),
        (["grains.damping_ratio=0.9"], math.sqrt(1.105) - 0.55 * math.sqrt(2)),
        (["contact.rolling_friction=0.1"], 0.2),
        (["contact.model=hertz"], 0.2),
    ]:
        with naming(keys):
            largest = math.floor(1e3 * largest) / 1e3
            scales_of(tiny(*keys, f"run.time_step_factor={largest}"))
            said = f"the largest that is stable.*at most {largest:g}"
            if largest < 0.3:
                with pytest.raises(CaseError, match=said):
                    scales_of(tiny(*keys, f"run.time_step_factor={largest + 0.005}"))


def test_explicit_drag_warns_above_a_tenth_of_tau_and_is_refused_above_tau():
    short, said = tau(1e3), r"above the drag relaxation time .* drag\.scheme = 'implicit'"
    for scheme in ("held", "viscous"):
        for part, warned in ((0.1, False), (0.1001, True), (1.0, True)):
            text = warnings_of(explicit(part * short, scheme))
            assert ("drag is held" in text) == warned, (scheme, part)
        with naming(scheme), pytest.raises(CaseError, match=said):
            scales_of(explicit(1.0001 * short, scheme))


def test_a_given_refresh_warns_above_a_tenth_of_tau_and_is_refused_above_tau():
    step = f"run.time_step_s={tau() / 1000!r}"
    for count, warned in ((100, False), (101, True), (1000, True)):
        case = tiny(step, f"drag.refresh_steps={count}")
        assert ("drag is held for" in warnings_of(case)) == warned, count
        assert scales_of(case).hold_steps == count
    with pytest.raises(CaseError, match="expected at most 1000"):
        scales_of(tiny(step, "drag.refresh_steps=1001"))


def test_a_derived_step_keeps_both_bounds_without_a_warning():
    slow = ("drag.multiplier=1e4", "fluid.velocity_m_s=5e-4")
    for factor in (0.01, 0.1, 0.2):
        keys = (f"run.time_step_factor={factor}", "run.checkpoint_ms=0.1")
        for scheme in ("held", "viscous"):
            usual = scales_of(tiny(*keys, f"drag.scheme={scheme}"))
            assert usual.time_step == pytest.approx(factor * bound()), (factor, scheme)
            short = scales_of(tiny(*keys, f"drag.scheme={scheme}", *slow))
            assert short.time_step == pytest.approx(min(0.1 * tau(1e4), factor * bound()))
            assert short.hold_steps == 1
            assert not any("drag is held" in warning for warning in short.warnings)
        stiff = scales_of(tiny(*keys, "drag.scheme=implicit", *slow))
        assert stiff.time_step == pytest.approx(factor * bound()), factor


def test_a_refresh_beyond_the_chunk_is_refused():
    thin = ("fluid.viscosity_cP=1e-6", "fluid.velocity_m_s=1.0")
    with pytest.raises(CaseError, match=r"between checkpoints; expected at most \d+"):
        scales_of(tiny("drag.refresh_steps=100000", *thin))


# ---- The expected cost, and the refusal of a run longer than `run.max_hours`.
def hours(case: Case) -> float:
    cost = cost_of(case, scales_of(case))
    return (cost.pack_seconds + cost.invade_seconds) / 3600


def test_the_limit_is_the_expected_hours():
    for factor, refused in ((0.999, True), (1.001, False)):
        limited = tiny(f"run.max_hours={factor * hours(tiny())}")
        assert bool(over_limit(limited, scales_of(limited))) == refused
    case = tiny("run.stiffness_N_m=nominal", "run.max_hours=0.01")
    scales = scales_of(case)
    assert over_limit(case, scales, pack=True, invade=False) == ""
    assert over_limit(case, scales, pack=False, invade=False) == ""
    assert "run.max_hours: 0.01 h" in over_limit(case, scales, pack=False, invade=True)


def test_a_long_run_is_refused_before_anything_is_written_and_render_shows_it(tmp_path, capsys):
    path, out = tmp_path / "case.toml", tmp_path / "run"
    keys = ("run.stiffness_N_m=nominal", "fines.count=3000", "run.max_hours=0.5")
    path.write_text(tiny(*keys).toml())
    code, _, error = answer(capsys, "run", path, "--out", out, "--timeout", "5")
    assert (code, error.count("\n"), out.exists()) == (2, 1, False)
    assert "run.max_hours: 0.5 h, but this case is expected to take" in error
    code, shown, _ = answer(capsys, "render", path, "--out", out)
    assert code == 0
    assert "invasion run time" in shown
    assert "warning: run.max_hours: 0.5 h" in shown
