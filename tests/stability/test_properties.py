"""Properties of random cases, packs and dumps (hypothesis, fixed examples)."""

import copy
import dataclasses
import math
import tomllib
from typing import Any

import numpy as np
import pytest
import tomli_w
from builders import TINY
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from fdnet.case.file import case_from, set_keys
from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError, FdnetError
from fdnet.network.permeability import analyse
from fdnet.scales.scales import scales_of
from tests.network.packs import random_pack, with_fines

FIXED = settings(
    derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck)
)


@st.composite
def plausible(draw: st.DrawFn) -> dict[str, Any]:
    """Cases most of which are valid: the tiny one with numbers drawn over wide ranges."""
    data = copy.deepcopy(TINY)
    radius = draw(st.floats(0.01, 20.0))
    sides = [radius * draw(st.floats(2.5, 8.0)) for _ in range(3)]
    data["box"] = {"size_mm": sides, "sides": draw(st.sampled_from(["walls", "periodic"]))}
    data["grains"] = {"radius_mm": radius, "porosity": draw(st.floats(0.2, 0.7))}
    data["grains"]["motion"] = draw(st.sampled_from(["fixed", "mobile"]))
    small, count = radius * draw(st.floats(0.02, 0.5)), draw(st.integers(1, 1000))
    data["fines"] = {"radius_mm": small, "count": count}
    viscosity, pressure = 10.0 ** draw(st.floats(-2, 5)), 10.0 ** draw(st.floats(-4, 2))
    data["fluid"] = {"viscosity_cP": viscosity, "overbalance_MPa": pressure}
    data["run"] = {"stiffness_N_m": 10.0 ** draw(st.floats(1, 11))}
    return data


@given(plausible())
@settings(FIXED, max_examples=150)
def test_a_case_comes_back_from_its_toml_and_its_scales_are_finite_or_refused(data):
    """Steps, times and lengths above 0; the step below the contact and relaxation bounds."""
    try:
        case = case_from(data)
    except CaseError as error:
        said = str(error)
        assert "\n" not in said
        assume(False)
    again = case_from(tomllib.loads(case.toml()))
    assert again == case
    assert (again.digest(), again.toml()) == (case.digest(), case.toml())
    try:
        scales = scales_of(case)
    except FdnetError:
        return
    for field in dataclasses.fields(scales):
        value = getattr(scales, field.name)
        assert not isinstance(value, float) or math.isfinite(value), field.name
    limits = [one.step_limit for name, one in scales.contacts.items() if "fine" in name]
    assert 0 < scales.time_step <= 0.2 * min(limits)
    assert scales.slab_length > 0
    assert scales.supplied_count >= 1


@given(st.text(max_size=30))
@settings(FIXED, max_examples=150)
def test_any_assignment_is_taken_or_refused(text):
    try:
        case = case_from(set_keys(TINY, [text]))
    except CaseError as error:
        said = str(error)
        assert said
    else:
        tomli_w.dumps(case.data())


@given(
    seed=st.integers(0, 2**31),
    count=st.integers(20, 40),
    solid=st.floats(0.2, 0.65),
    spread=st.sampled_from([0.0, 0.3, 0.6]),
    fines=st.integers(0, 30),
    around=st.sampled_from([(True, True, True), (False, True, True), (False, False, False)]),
)
@settings(FIXED, max_examples=25)
def test_random_packs_keep_every_promise(seed, count, solid, spread, fines, around):
    """Fines never raise k, fluxes balance, and sections in place recombine in series."""
    grains = random_pack.__wrapped__(count, solid, seed=seed, spread=spread, periodic=True)
    both = with_fines(grains, fines, 0.1, seed=seed % 1000) if fines else None
    options = AnalysisChoices.of_pack(sections=3, walls="slip")
    analysis = analyse(grains, both, periodic=around, options=options)
    assert 0 <= analysis.k_damaged <= analysis.k_initial * (1 + 1e-12) < np.inf
    assert 0 <= analysis.porosity_damaged <= analysis.porosity_initial <= 1
    for state in ("initial", "damaged"):
        flow, whole = getattr(analysis, f"flow_{state}"), getattr(analysis, f"k_{state}")
        assert (whole > 0) == (not flow.reason)
        assert flow.residual <= 1e-6
        assert whole == 0 or flow.mass_balance <= 1e-6
        parts = [getattr(section, f"k_{state}_inplace") for section in analysis.sections]
        series = len(parts) / sum(1 / part for part in parts) if all(parts) else 0.0
        assert series == pytest.approx(whole, rel=1e-6)
