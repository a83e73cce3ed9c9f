"""Drag schemes: the deck by meaning, and the motion on the real binary against closed forms."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from builders import resting_spheres, tiny

from fdnet.case.case import Case
from fdnet.case.file import case_from
from fdnet.dem.deck import contact_variables, drag_variables, number, render_text, write_data
from fdnet.dem.liggghts import Binary, Launch, run_deck
from fdnet.errors import CaseError
from fdnet.scales.clock import relaxation_time
from fdnet.scales.scales import InvasionScales, scales_of
from fdnet.spheres.dump import COLUMNS, Frame, read_dump
from fdnet.spheres.snapshot import Kind

SCHEMES = ("held", "implicit", "viscous")
SPEED, RADIUS = 2.0, 0.05e-3
SLOW = "fluid.velocity_m_s=0.02"
TAU = relaxation_time(RADIUS, 2146, 0.05)


def drag_text(case: Case, scales: InvasionScales, resume: bool = False) -> str:
    return render_text("_drag.in.j2", {"drag": drag_variables(case, scales), "resume": resume})


def drag_case(*assignments: str) -> Case:
    return tiny(f"fluid.velocity_m_s={SPEED}", "fines.friction=0.0", *assignments)


def test_each_scheme_has_its_own_lines_and_no_others():
    own = {
        "held": "store/state",
        "implicit": "couple/cfd/force/implicit CrankNicolson 1.0",
        "viscous": "fix drag fines viscous",
    }
    for scheme in SCHEMES:
        case = drag_case(f"drag.scheme={scheme}")
        text = drag_text(case, scales_of(case))
        for other in SCHEMES:
            if (other, scheme) != ("held", "held"):
                assert (own[other] in text) == (other == scheme), (scheme, other)
        assert (" uf " in text) == (scheme != "viscous")
        assert ("run 0" in text) == (scheme != "viscous")


def test_the_viscous_split_is_stokes_drag_of_one_radius():
    """6 pi mu M r and 6 pi mu M r u; upstream less by 6 pi mu M r (u - q), q Darcy's velocity."""
    case = drag_case("drag.scheme=viscous", "drag.multiplier=3.0", "drag.upstream=darcy")
    scales = scales_of(case)
    text, damping = drag_text(case, scales), 6 * math.pi * 0.05 * 3 * RADIUS
    assert float(re.search(r"drag fines viscous (\S+)", text).group(1)) == pytest.approx(damping)
    assert float(re.search(r"push fines addforce (\S+) 0.0 0.0", text).group(1)) == pytest.approx(
        damping * SPEED
    )
    slower = float(re.search(r"slow fines addforce (\S+) 0.0 0.0 region slow", text).group(1))
    assert slower == pytest.approx(-damping * SPEED * (1 - scales.porosity))
    case = drag_case("drag.scheme=viscous")
    assert "region" not in drag_text(case, scales_of(case))


def test_implicit_drag_gives_every_fine_its_own_coefficient():
    case = drag_case("drag.scheme=implicit", "fines.radius_mm=[0.04, 0.06]")
    for resume in (False, True):
        text = drag_text(case, scales_of(case), resume)
        assert f"variable ksl atom {number(6 * math.pi * 0.05)}*r" in text
        assert "set group fines property/atom Ksl v_ksl" in text
        assert f"set group fines property/atom uf {SPEED} 0.0 0.0" in text


@pytest.mark.parametrize(
    ("assignments", "message"),
    [
        (["drag.scheme=viscous", "fines.radius_mm=[0.04, 0.06]"], "needs fines of one size"),
        (["drag.scheme=implicit", "drag.upstream=darcy"], "keeps one a fine"),
        (
            ["drag.scheme=implicit", "drag.refresh_steps=5"],
            "belongs to drag.scheme 'held', not 'implicit'",
        ),
        (
            ["drag.scheme=viscous", "drag.refresh_steps=5"],
            "belongs to drag.scheme 'held', not 'viscous'",
        ),
        (["drag.scheme=explicit"], "drag.scheme: 'explicit'"),
    ],
)
def test_what_a_scheme_cannot_do_is_refused(assignments, message):
    with pytest.raises(CaseError, match=message):
        tiny(*assignments)
    assert case_from(tiny().data()) == tiny()


def drive(
    case: Case, binary: Binary, folder: Path, *, gap: float, steps: int, every: int
) -> tuple[InvasionScales, list[Frame]]:
    """One fine from rest, `gap` m upstream of a fixed grain, under the deck's forces."""
    folder.mkdir(parents=True)
    scales = scales_of(case)
    box = np.column_stack([np.zeros(3), case.size_m])
    grain = resting_spheres([[2e-3, 8e-4, 8e-4]], 2.5e-4, box, kind=Kind.GRAIN)
    at = 2e-3 - 2.5e-4 - RADIUS - gap
    spheres = grain.joined(
        resting_spheres([[at, 8e-4, 8e-4]], RADIUS, box, kind=Kind.FINE, first=2)
    )
    write_data(
        folder / "one.data",
        spheres,
        bounds=box - [[5e-4, 0], [0, 0], [0, 0]],
        density=np.array([2650.0, 2146.0]),
        types=3,
    )
    header = {
        "stage": "test",
        "case_name": "one",
        "digest": "-",
        "left_out": [],
        "boundary": "f f f",
        "processors": "",
    }
    contacts = contact_variables(case, scales, "invade", friction=False)
    text = (
        render_text("_header.in.j2", header)
        + "read_data one.data\nneighbor 5e-5 bin\nneigh_modify delay 0\n"
    )
    text += "group grains type 1\ngroup fines type 2\n"
    text += render_text(
        "_contacts.in.j2", {"contacts": contacts, "time_step": number(scales.time_step)}
    )
    text += "fix integ fines nve/sphere\n"
    text += drag_text(case, scales) + f"dump d fines custom {every} d.dump {COLUMNS}\n"
    text += 'dump_modify d format "%d %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g"\n'
    text += f'run {steps}\nprint "DECK_DONE"\n'
    (folder / "in.one").write_text(text)
    run_deck(folder, "in.one", Launch(binary=binary))
    return scales, read_dump(folder / "d.dump")


def speeds(frames: list[Frame]) -> np.ndarray:
    return np.array([frame.column("vx")[0] for frame in frames])


def relaxation_error(scheme: str, step: float, binary: Binary, folder: Path) -> float:
    """Largest error of v(t) = u (1 - exp(-t / tau)) over u in 2 tau, tested every 0.2 tau."""
    every = round(0.2 * TAU / step)
    held = ["drag.refresh_steps=1"] if scheme == "held" else []
    case = drag_case(
        f"drag.scheme={scheme}", f"run.time_step_s={step}", "run.stiffness_N_m=500.0", *held
    )
    _, frames = drive(case, binary, folder, gap=1e-3, steps=10 * every, every=every)
    time = step * np.array([frame.step for frame in frames])
    assert len(time) == 11
    return float(np.max(np.abs(speeds(frames) / SPEED - (1 - np.exp(-time / TAU)))))


@pytest.mark.liggghts
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_fine_relaxes_to_the_fluid_as_stokes_has_it(binary, tmp_path, scheme):
    """v = u (1 - exp(-t / tau)); every scheme is of first order in dt, within 0.5 dt / tau."""
    errors = [
        relaxation_error(scheme, TAU * part, binary, tmp_path / str(part))
        for part in (0.01, 0.005)
    ]
    assert errors[0] < 0.5 * 0.01
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.liggghts
def test_the_viscous_split_moves_a_fine_as_drag_at_every_step_does(binary, tmp_path):
    moved = []
    for scheme in ("drag.refresh_steps=1", "drag.scheme=viscous"):
        case = drag_case(scheme, f"run.time_step_s={0.01 * TAU}", "run.stiffness_N_m=500.0")
        moved.append(
            speeds(drive(case, binary, tmp_path / scheme, gap=1e-3, steps=200, every=20)[1])
        )
    assert moved[0] == pytest.approx(moved[1], rel=1e-12)


@pytest.mark.liggghts
@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0, 100.0])
def test_implicit_drag_is_bounded_at_any_step(binary, tmp_path, ratio):
    """Half a step of drag forward, half backward.

    So u - v shrinks by q = (2 - k) / (2 + k) a step, k = dt / tau.

    |q| < 1 for every k. The first half step has no drag yet: u - v_n = u q^n / (1 - k / 2).
    """
    case = drag_case(
        "drag.scheme=implicit",
        f"drag.multiplier={ratio * TAU / 3e-8}",
        "run.time_step_s=3e-8",
        SLOW,
    )
    _, frames = drive(case, binary, tmp_path / "run", gap=1e-4, steps=100, every=10)
    step = np.array([float(frame.step) for frame in frames[1:]])
    expected = 0.02 * (1 - ((2 - ratio) / (2 + ratio)) ** step / (1 - ratio / 2))
    assert speeds(frames)[1:] == pytest.approx(expected, rel=1e-9)


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("scheme", "ratio"),
    [("held", 0.5), ("viscous", 0.5), ("implicit", 0.1), ("implicit", 10)],
)
def test_a_fine_at_rest_is_pressed_by_the_drag_of_the_fluid(binary, tmp_path, scheme, ratio):
    """Overlap 6 pi mu M r u / k, whatever the step."""
    step = 3e-8
    case = drag_case(
        f"drag.scheme={scheme}",
        f"drag.multiplier={ratio * TAU / step}",
        f"run.time_step_s={step}",
        SLOW,
    )
    scales, frames = drive(case, binary, tmp_path / "run", gap=1e-8, steps=40_000, every=40_000)
    overlap = frames[-1].column("x")[0] - (2e-3 - 2.5e-4 - RADIUS)
    force = 6 * math.pi * 0.05 * case.drag.multiplier * RADIUS * 0.02
    assert overlap == pytest.approx(
        force / scales.contacts["grain-fine"].normal_stiffness, rel=1e-4
    )
