"""Cases: what is accepted, and that every problem is named at once."""

import copy
import csv
import datetime
import hashlib
import math
import tomllib
from pathlib import Path

import pytest
from builders import TINY, tiny

from fdnet.case.case import (
    KEYS,
    Case,
    InvasionCase,
    with_fines,
)
from fdnet.case.file import case_from, known_keys, read_case, set_keys
from fdnet.errors import CaseError
from fdnet.scales.scales import InvasionScales, Scales, scales_of
from validation.thesis.published import SPECIMENS
from validation.thesis.runs import VARIANTS, find_state, planned


def problems(data: dict) -> str:
    with pytest.raises(CaseError) as caught:
        case_from(data)
    return str(caught.value)


def changed(**parts: dict) -> dict:
    data = copy.deepcopy(TINY)
    for name, values in parts.items():
        data.setdefault(name, {}).update(values)
    return data


def test_every_problem_is_listed_at_once():
    text = problems(
        {
            "name": "a b",
            "box": {"size_mm": [8, 4]},
            "grains": {"radius_mm": "0.25", "porosity": 1.3, "frction": 2},
            "fines": {"radius_mm": 0.08},
            "drag": {"multiplier": True},
        }
    )
    for part in (
        "name: 'a b'",
        "box.size_mm",
        "grains.radius_mm: '0.25'",
        "grains.porosity: 1.3",
        "grains.frction: unknown key",
        "did you mean grains.friction?",
        "fines.count",
        "drag.multiplier: True",
    ):
        assert part in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("part", "values", "expected"),
    [
        ("fines", {"radius_mm": 0.3}, "not below grains.radius_mm 0.25"),
        ("fines", {"slab_mm": 2.0}, "give exactly one of the two"),
        ("fines", {"concentration": 0.4}, "fines.concentration: 0.4"),
        ("grains", {"radius_mm": [0.3, 0.2]}, "must rise"),
        ("grains", {"count": 0}, "grains.count: 0"),
        ("box", {"size_mm": [3.0, 0.4, 1.6]}, "a grain does not fit"),
        ("box", {"size_mm": [3.0, 0.9, 1.6], "sides": "periodic"}, "its own image"),
        ("box", {"size_mm": [3.0, float("inf"), 1.6]}, "finite number"),
        ("box", {"size_mm": [3.0, 1e16, 1.6]}, "less than or equal to"),
        ("gravity", {"acceleration_m_s2": [1.0, 0.0]}, "gravity.acceleration_m_s2"),
        ("drag", {"crowd": "beetstra", "scheme": "viscous"}, "'viscous' has one damping for all"),
        ("drag", {"update_travel": 0.2}, "drag.update_travel: 0.2 belongs to a drag that is"),
        ("drag", {"scheme": "viscous", "inertia": "schiller-naumann"}, "depend on the slip"),
        ("drag", {"pressure_gradient": 1}, "drag.pressure_gradient: 1"),
        ("run", {"duration_ms": 1.0, "cap_ms": 2.0}, "give one of the two"),
        ("analysis", {"profile_bin_mm": 1e-9}, "more than 10000 bins"),
        ("analysis", {"sections": 10**6}, "less than or equal to"),
        ("fines", {"count": 10**9}, "expected at most 1e+07"),
        ("fines", {"concentration": 1e-8}, "box lengths"),
        ("grains", {"count": 200}, "sum to more than the box; expected at most 117"),
        ("drag", {"field": "network"}, "drag.upstream: 'interstitial', but with drag.field"),
        ("run", {"stop_rate": 0.1}, "run.stop_rate: 0.1 needs a rate that falls"),
        ("drag", {"scheme": "viscous", "refresh_steps": 5}, "belongs to drag.scheme 'held'"),
        ("run", {"time_step_factor": 0.4}, "run.time_step_factor: 0.4"),
        ("run", {"skin_mm": 1e-5}, "run.skin_mm: 1e-05 mm, expected 0.0005"),
        ("run", {"skin_mm": 0.26}, "to 0.25 (a grain's radius)"),
        ("run", {"neighbour_bin_mm": 0.009}, "run.neighbour_bin_mm: 0.009 mm, expected 0.00916"),
        ("run", {"neighbour_bin_mm": 1.7}, "to 1.6 (its shortest side)"),
        ("run", {"max_hours": 0.0}, "run.max_hours: 0.0"),
        ("run", {"max_overlap": 1.0}, "run.max_overlap: 1.0"),
        ("run", {"on_overlap": "stopp"}, "run.on_overlap: 'stopp'"),
        ("run", {"stiffness_N_m": "nominel"}, "run.stiffness_N_m: 'nominel'"),
        ("analysis", {"law": "darcy"}, "analysis.law: 'darcy'"),
        ("analysis", {"damage_law": "kozeny"}, "'kozeny' is no longer there; take 'section-arc"),
        ("drag", {"scheme": "every_step"}, "'every_step' is no longer there; take 'held'"),
        ("fluid", {"viscosity_Pas": 0.05}, "unknown key"),
    ],
)
def test_a_bad_value_is_named_with_its_path(part, values, expected):
    assert expected in problems(changed(**{part: values}))


@pytest.mark.parametrize(
    ("part", "values"), [("fines", {"count": True}), ("grains", {"count": 66.0})]
)
def test_a_bad_key_brings_no_false_problem_with_it(part, values):
    text = problems(changed(**{part: values}))
    assert "1 problem:" in text


def test_problems_between_keys_are_listed_one_by_one_next_to_those_of_keys():
    data = changed(fines={"radius_mm": 0.3}, drag={"field": "network"}, run={"cap_ms": True})
    text = problems(data)
    assert "3 problems: run.cap_ms: True" in text
    assert " | fines.radius_mm: 0.3 is not below grains.radius_mm 0.25" in text
    assert " | drag.upstream: 'interstitial', but with drag.field" in text


def test_a_bad_key_silences_only_the_rules_that_read_it():
    """`grains.radius_mm` cannot be compared with anything, the two ways to supply fines can."""
    text = problems(changed(grains={"radius_mm": -1.0}, fines={"radius_mm": 0.3, "slab_mm": 2.0}))
    assert "grains.radius_mm: -1.0" in text
    assert "not below" not in text
    assert "give exactly one of the two" in text


def test_a_case_without_fines_is_a_type_of_its_own():
    bare = case_from({key: value for key, value in TINY.items() if key != "fines"})
    assert type(bare) is Case
    assert type(tiny()) is InvasionCase
    assert isinstance(tiny(), Case)
    assert bare.stages == ("pack", "analyse", "report")
    assert tiny().stages == ("pack", "invade", "analyse", "report")
    assert set(bare.spheres) == {"grain"}
    assert set(tiny().spheres) == {"grain", "fine"}
    assert type(scales_of(bare)) is Scales
    assert type(scales_of(tiny())) is InvasionScales
    assert bare.digest("pack") != tiny().digest("pack")
    assert bare.same_specimen(bare.toml().encode())
    assert not bare.same_specimen(tiny().toml().encode())
    assert with_fines(tiny()) == tiny()
    with pytest.raises(CaseError, match=r"tiny: has no table \[fines\]"):
        with_fines(bare)


def test_every_table_is_written():
    assert set(KEYS) == set(InvasionCase.model_fields)
    well = "well={radius_mm=108.0, drainage_radius_m=100.0}"
    clean_up, bonds = "clean_up.drawdown_MPa=1.0", "bonds={radius_ratio=0.5}"
    settings = (well, clean_up, bonds, 'fluid.viscosity="10 cP"')
    assert list(tiny(*settings).data()) == list(KEYS)
    assert "given" not in tiny(well).data()
    assert {"fines", "fines.radius_mm"} <= set(known_keys())


def test_a_date_is_refused_like_any_other_value():
    with pytest.raises(CaseError, match="name"):
        case_from(set_keys({**TINY, "name": datetime.date(2020, 1, 1)}, []))


def test_porosity_or_count_is_needed():
    data = copy.deepcopy(TINY)
    del data["grains"]["count"]
    assert "grains.porosity: missing" in problems(data)


def test_toml_comes_back_as_the_same_case():
    case = tiny("grains.radius_mm=[0.2,0.25]", "analysis.law=thesis")
    again = case_from(tomllib.loads(case.toml()))
    assert again == case
    assert again.digest() == case.digest()


def test_the_neighbour_search_belongs_to_the_invasion():
    """It changes the order of sums, so another search is another invasion, but the same pack."""
    for setting in ("run.skin_mm=0.04", "run.neighbour_bin_mm=0.2"):
        assert tiny(setting).digest("pack") == tiny().digest("pack")
        assert tiny(setting).digest("invade") != tiny().digest("invade")


def test_stages_depend_only_on_their_own_keys():
    case = tiny()
    other_law = tiny("analysis.law=thesis")
    other_fines = tiny("fines.count=301")
    assert other_law.digest("invade") == case.digest("invade")
    assert other_law.digest("analyse") != case.digest("analyse")
    assert other_fines.digest("pack") == case.digest("pack")
    assert other_fines.digest("invade") != case.digest("invade")
    assert tiny("seed=2").digest("pack") != case.digest("pack")


def test_analysis_choices_reach_the_analysis():
    """One class holds them, with the names of the keys; the default walls hold the fluid."""
    assert tiny().analysis.walls == "no-slip"
    options = tiny("analysis.walls=slip", "analysis.sections=3", "analysis.law=thesis").analysis
    assert (options.walls, options.sections, options.law) == ("slip", 3, "thesis")
    assert "analysis.walls: 'sticky'" in problems(changed(analysis={"walls": "sticky"}))


def test_set_reads_values_as_toml_and_refuses_nonsense():
    data = set_keys(TINY, ["fines.radius_mm=[0.03, 0.05]", "box.sides=periodic", "seed=7"])
    assert data["fines"]["radius_mm"] == [0.03, 0.05]
    assert data["box"]["sides"] == "periodic"
    assert data["seed"] == 7
    assert "seed" in TINY
    assert TINY["seed"] == 1
    for bad in ("fines.radius_mm", "=3", "name.x=3"):
        with pytest.raises(CaseError, match="--set"):
            set_keys(TINY, [bad])


def test_unreadable_and_malformed_files(tmp_path: Path):
    with pytest.raises(CaseError, match="cannot be read as a case file"):
        read_case(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("name = ")
    with pytest.raises(CaseError, match=r"bad\.toml: not valid TOML"):
        read_case(tmp_path / "bad.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CaseError, match="cannot be read"):
        read_case(tmp_path / "bytes.toml")


def test_fixed_keys_of_the_contract_exist():
    fixed = {
        "name",
        "seed",
        "box.size_mm",
        "box.sides",
        "grains.radius_mm",
        "grains.porosity",
        "grains.density_kg_m3",
        "grains.friction",
        "grains.motion",
        "fines.radius_mm",
        "fines.density_kg_m3",
        "fines.friction",
        "fines.concentration",
        "fluid.viscosity_cP",
        "fluid.density_kg_m3",
        "fluid.overbalance_MPa",
        "drag.field",
        "drag.multiplier",
        "analysis.sections",
        "analysis.law",
        "analysis.damage_law",
    }
    assert fixed <= set(known_keys())


def test_shipped_cases_are_valid_short_and_named_as_their_files(root: Path):
    full, quick = (
        {path.stem: path for path in (root / folder).glob("*.toml")}
        for folder in ("cases", "cases/quick")
    )
    own = {"quick", "antler-sand", "growing-cake", "sand-and-mud", "well"}
    assert set(full) == {*own, *SPECIMENS, *VARIANTS}
    assert set(quick) == {*SPECIMENS, *VARIANTS}
    for name, path in [*full.items(), *((f"quick-{name}", path) for name, path in quick.items())]:
        assert read_case(path).name == name
        assert len(path.read_text().splitlines()) < 60


def test_shipped_cases_keep_their_digests_and_their_text(root: Path):
    """Any other digest would orphan the run folders and stored states that were made from them."""
    with (root / "tests/data/case_digests.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    shipped = {p.relative_to(root / "cases") for p in (root / "cases").rglob("*.toml")}
    shipped -= {path for path in shipped if path.parts[0] == "sweeps"}
    assert shipped == {Path(f"{row['case']}.toml") for row in rows}
    for row in rows:
        case = read_case(root / "cases" / f"{row['case']}.toml")
        text = case.toml()
        assert row == {
            "case": row["case"],
            **{stage: case.digest(stage) for stage in ("pack", "invade", "analyse")},
            "text": hashlib.sha256(text.encode()).hexdigest()[:16],
        }


def test_stored_states_still_belong_to_their_cases(root: Path):
    """`find_state` raises when a state belongs to another case than that of its run."""
    states = root / "docs/thesis/states"
    stored = [item for item in planned() if (states / item.file).exists()]
    assert len(stored) == len(list(states.glob("*-seed*.npz"))) > 20
    assert all(find_state(states, item) is not None for item in stored)


def test_values_in_si_are_those_of_the_keys():
    case = tiny(
        "box.sides=periodic",
        "fines={radius_mm=0.05, slab_mm=0.7}",
        "fluid.darcy_length_mm=3.3",
        "run={cap_ms=0.3, plug_time_ms=0.2, checkpoint_ms=0.1}",
        "run.skin_mm=0.04",
        "run.neighbour_bin_mm=0.2",
    )
    assert case.size_m == case.box.size_m == pytest.approx((3e-3, 1.6e-3, 1.6e-3))
    assert case.periodic == (False, True, True)
    assert case.grains.radius_range_m == pytest.approx((2.5e-4, 2.5e-4))
    assert case.fines.slab_m == pytest.approx(7e-4)
    assert case.fluid.viscosity_Pa_s == pytest.approx(0.05)
    assert case.fluid.stokes_coefficient_Pa_s == pytest.approx(6 * math.pi * 0.05)
    assert case.fluid.darcy_length_m == pytest.approx(3.3e-3)
    assert case.fluid.overbalance_Pa == pytest.approx(3.5e6)
    well = tiny(
        "well={radius_mm=108.0, drainage_radius_m=9.0, formation_permeability_mD=2.0}"
    ).well
    assert well.radius_m == pytest.approx(0.108)
    assert well.formation_permeability_m2 == pytest.approx(1.9738466e-15)
    assert case.analysis.profile_bin_m == pytest.approx(2.5e-4)
    run = case.run
    assert (run.cap_s, run.plug_time_s, run.checkpoint_s) == pytest.approx((3e-4, 2e-4, 1e-4))
    assert (run.skin_m, run.neighbour_bin_m) == pytest.approx((4e-5, 2e-4))
    assert tiny().run.duration_s is tiny().fines.slab_m is tiny().fluid.darcy_length_m is None
    assert tiny("run.duration_ms=2.0").run.duration_s == pytest.approx(2e-3)


def test_a_quick_form_differs_from_its_specimen_only_in_what_it_gives_up(root: Path):
    for path in (root / "cases/quick").glob("*.toml"):
        quick, full = read_case(path).data(), read_case(root / "cases" / path.name).data()
        may = {"name", "box", "run", "fines.count", "grains.count", "analysis.sections"}
        may |= {"grains.porosity"} if "count" in quick["grains"] else set()
        for part in set(quick) | set(full):
            if part in may:
                continue
            for key in (
                set(quick[part]) | set(full[part]) if isinstance(full[part], dict) else {""}
            ):
                pair = [data[part].get(key) if key else data[part] for data in (quick, full)]
                assert f"{part}.{key}" in may or pair[0] == pair[1], f"{path.name}: {part}.{key}"


def test_a_box_for_more_grains_than_memory_is_refused():
    huge = TINY | {
        "box": {"size_mm": [800.0, 800.0, 800.0]},
        "grains": {"radius_mm": 0.25, "porosity": 0.4},
    }
    with pytest.raises(
        CaseError,
        match=r"box\.size_mm: \[800.0, 800.0, 800.0\] holds 4\.69e\+09 grains; expected at",
    ):
        case_from(huge)
