"""Values with their units, as people write them in a case."""

import copy
import tomllib

import pytest
from builders import TINY, naming

from fdnet.case.file import case_from, known_keys, read_case, recorded_case
from fdnet.case.units import SUFFIXES, UNITS, converted, stem_of
from fdnet.errors import CaseError


def test_units_convert_as_their_definitions_say():
    """NIST SP 811: psi 6894.757 Pa, oil barrel 0.1589873 m3, pound 0.45359237 kg, foot 0.3048 m.

    The darcy is 9.869233e-13 m2.
    """
    for text, suffix, value in [
        ("80 um", "_mm", 0.08),
        ("80µm", "_mm", 0.08),
        ("500 psi", "_MPa", 3.4473786465841),
        ("10 cP", "_cP", 10.0),
        ("0.05 Pa.s", "_cP", 50.0),
        ("25 lb/bbl", "_kg_m3", 71.3252543),
        ("9.5 ppg", "_kg_m3", 1138.3510590),
        ("40 kg/m³", "_kg_m3", 40.0),
        ("300 mD", "_mD", 300.0),
        ("1 um2", "_mD", 1013.25),
        ("8.5 in", "_mm", 215.9),
        ("3 min", "_s", 180.0),
        ("1e3 ft/min", "_m_s", 5.08),
        ("60 N/m", "_N_m", 60.0),
        ("5 %", "_percent", 5.0),
    ]:
        assert converted(text, suffix) == pytest.approx(value, rel=2e-9), text


def test_every_key_with_a_unit_takes_a_text_with_its_unit():
    """A new key's unit must be known here, and no two units share the name of a key's stem."""
    units = {suffix: dimension for suffix, (dimension, _) in SUFFIXES.items()}
    assert set(units.values()) <= set(UNITS)
    for suffix, (dimension, factor) in SUFFIXES.items():
        assert factor in UNITS[dimension].values() or dimension in ("share",), suffix
    keys = set(known_keys())
    stems = [key.rpartition(".")[0] + "." + stem_of(key.rpartition(".")[2]) for key in keys]
    assert len(stems) == len(set(stems))
    numbers = {k for k in keys if k.endswith(("_kg_m3", "_mm", "_MPa", "_cP", "_um", "_percent"))}
    assert all(stem_of(key.rsplit(".", 1)[-1]) != key.rsplit(".", 1)[-1] for key in numbers)


WRITTEN = """
name = "tiny"
[box]
size = ["3 mm", "1600 um", "0.16 cm"]
[grains]
radius = "250 um"
porosity = "40 %"
[fines]
radius = ["40 um", "50 um"]
count = 300
concentration = "5 %"
density = "2.71 g/cc"
[fluid]
viscosity = "10 cP"
overbalance = "300 psi"
[run]
duration = "2 ms"
"""

PLAIN = {
    "name": "tiny",
    "box": {"size_mm": [3.0, 1.6, 1.6]},
    "grains": {"radius_mm": 0.25, "porosity": 0.40},
    "fines": {"radius_mm": [0.04, 0.05], "count": 300}
    | {"concentration": 0.05, "density_kg_m3": 2710.0},
    "fluid": {"viscosity_cP": 10.0, "overbalance_MPa": 300 * 0.006894757293168361},
    "run": {"duration_ms": 2.0},
}


def test_a_case_with_units_is_the_case_in_the_units_of_the_keys():
    written, plain = case_from(tomllib.loads(WRITTEN)), case_from(PLAIN)
    assert written == plain
    assert case_from(tomllib.loads(written.toml())) == written


def test_the_texts_that_runs_of_before_kept_are_passed_over(tmp_path):
    case = case_from(PLAIN)
    text = case.toml().replace("[run]", '[run]\non_overlap = "stop"')
    text += '[given]\n"fluid.viscosity" = "10 cP"\n'
    (tmp_path / "case.toml").write_text(text)
    assert recorded_case(tmp_path / "case.toml") == case
    assert case.same_specimen(text.encode())
    with pytest.raises(CaseError, match="given: unknown key"):
        read_case(tmp_path / "case.toml")


def test_a_set_key_replaces_the_same_key_in_another_unit(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(WRITTEN)
    case = read_case(path, assignments=["fluid.viscosity_cP=20.0", "run.duration=3 ms"])
    assert (case.fluid.viscosity_cP, case.run.duration_ms) == (20.0, 3.0)


def test_ambiguous_units_in_a_case_are_one_problem():
    for part, values, expected in [
        ("fluid", {"viscosity": "10 cP", "viscosity_cP": 10.0}, "viscosity: given next to visc"),
        ("fluid", {"viscosity": 10}, "fluid.viscosity: 10 has no unit"),
        ("fluid", {"viscosity": "10 psi"}, "'psi' is a unit of pressure"),
        ("fluid", {"viscosity_cP": "10 cP"}, "a value with its unit goes to viscosity"),
        ("grains", {"porosity": "0.4"}, "grains.porosity: '0.4'"),
        ("grains", {"porosity": "40 mm %"}, "no unit that is known"),
        ("fines", {"D50_um": 40}, "did you mean fines.sizes"),
        ("box", {"size": ["3 mm", 4, "4 mm"]}, "has no unit; write it with its unit"),
    ]:
        with naming(part, values, expected):
            data = copy.deepcopy(TINY)
            if "size" in values:
                del data[part]["size_mm"]
            data.setdefault(part, {}).update(values)
            with pytest.raises(CaseError, match="1 problem:") as caught:
                case_from(data)
            assert expected in str(caught.value)


def test_solids_by_mass_are_the_concentration_by_volume():
    for solids, density, kg in (("25 lb/bbl", 2710.0, 71.32525436), ("40 kg/m3", 2000.0, 40.0)):
        fines = TINY["fines"] | {"solids": solids, "density_kg_m3": density}
        case = case_from(TINY | {"fines": fines})
        assert case.fines.concentration is None
        assert case.fines.volume_fraction == pytest.approx(kg / density, rel=1e-9), solids
        assert case_from(tomllib.loads(case.toml())) == case
    with pytest.raises(
        CaseError, match=r"fines\.solids_kg_m3: 855.* of the mud's volume, expected at most"
    ):
        case_from(TINY | {"fines": TINY["fines"] | {"solids": "300 lb/bbl"}})
    with pytest.raises(CaseError, match="give exactly one of the two"):
        case_from(TINY | {"fines": TINY["fines"] | {"solids": "3 lb/bbl", "concentration": 0.1}})
