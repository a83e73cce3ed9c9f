"""The time step and held drag below, at and above each bound, and the cost of a run."""

import math

import pytest
from builders import naming, tiny

from fdnet.case.case import Case
from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.scales.clock import relaxation_time
from fdnet.scales.cost import cost_of, over_limit
from fdnet.scales.scales import InvasionScales, scales_of

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
        with naming(scheme):
            for factor in (0.9999, 1.0):
                case = tiny(f"run.time_step_s={0.3 * factor * bound()!r}", f"drag.scheme={scheme}")
                assert scales_of(case).time_step == 0.3 * factor * bound()
            with pytest.raises(CaseError, match="contact bound"):
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
        with naming(keys, largest):
            largest = math.floor(1e3 * largest) / 1e3
            scales_of(tiny(*keys, f"run.time_step_factor={largest}"))
            if largest < 0.3:
                with pytest.raises(
                    CaseError, match=f"the largest that is stable.*at most {largest:g}"
                ):
                    scales_of(tiny(*keys, f"run.time_step_factor={largest + 0.005}"))


def test_explicit_drag_warns_above_a_tenth_of_tau_and_is_refused_above_tau():
    for scheme in ["held", "viscous"]:
        with naming(scheme):
            short = tau(1e3)
            for part in (0.0999, 0.1):
                assert "drag is held" not in warnings_of(explicit(part * short, scheme))
            for part in (0.1001, 0.9999, 1.0):
                assert "drag is held" in warnings_of(explicit(part * short, scheme))
            with pytest.raises(
                CaseError, match=r"above the drag relaxation time .* drag\.scheme = 'implicit'"
            ):
                scales_of(explicit(1.0001 * short, scheme))


def refreshed(count: int, step: float) -> Case:
    return tiny(f"run.time_step_s={step!r}", f"drag.refresh_steps={count}")


def test_a_given_refresh_warns_above_a_tenth_of_tau_and_is_refused_above_tau():
    step = tau() / 1000
    for count in (99, 100):
        assert "drag is held" not in warnings_of(refreshed(count, step))
    for count in (101, 999, 1000):
        assert "drag is held for" in warnings_of(refreshed(count, step))
        assert scales_of(refreshed(count, step)).hold_steps == count
    with pytest.raises(CaseError, match="expected at most 1000"):
        scales_of(refreshed(1001, step))


def test_a_derived_step_keeps_both_bounds_without_a_warning():
    for factor in [0.01, 0.1, 0.2]:
        with naming(factor):

            def derived(*assignments: str, factor: float = factor) -> InvasionScales:
                keys = (f"run.time_step_factor={factor}", "run.checkpoint_ms=0.1")
                return scales_of(tiny(*keys, *assignments))

            for scheme in ("held", "viscous"):
                assert derived(f"drag.scheme={scheme}").time_step == pytest.approx(
                    factor * bound()
                )
                slow = derived(
                    f"drag.scheme={scheme}", "drag.multiplier=1e4", "fluid.velocity_m_s=5e-4"
                )
                assert slow.time_step == pytest.approx(min(0.1 * tau(1e4), factor * bound()))
                assert slow.hold_steps == 1
                assert not any("drag is held" in warning for warning in slow.warnings)
            stiff = derived(
                "drag.scheme=implicit", "drag.multiplier=1e4", "fluid.velocity_m_s=5e-4"
            )
            assert stiff.time_step == pytest.approx(factor * bound())


def test_a_refresh_beyond_the_chunk_is_refused():
    with pytest.raises(CaseError, match=r"between checkpoints; expected at most \d+"):
        scales_of(
            tiny("drag.refresh_steps=100000", "fluid.viscosity_cP=1e-6", "fluid.velocity_m_s=1.0")
        )


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


def test_a_long_run_is_refused_before_anything_is_written_and_render_still_shows_it(
    tmp_path, capsys
):
    path, out = tmp_path / "case.toml", tmp_path / "run"
    keys = ("run.stiffness_N_m=nominal", "fines.count=3000", "run.max_hours=0.5")
    path.write_text(tiny(*keys).toml())
    assert main(["run", str(path), "--out", str(out), "--timeout", "5"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "run.max_hours: 0.5 h, but this case is expected to take" in line
    assert not out.exists()
    assert main(["render", str(path), "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "invasion run time" in shown
    assert "warning: run.max_hours: 0.5 h" in shown
    assert (out / "invade" / "in.invade").exists()
