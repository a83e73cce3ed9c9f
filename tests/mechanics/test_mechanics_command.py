"""`fdnet mechanics` on a small pack of the real binary, and what it refuses."""

import json
import re
import shutil

import pytest

from fdnet.case.file import case_from, recorded_case
from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.mechanics.of_case import pack_material
from fdnet.report.html import mechanics_html, put_mechanics
from fdnet.spheres.snapshot import resting

pytestmark = pytest.mark.liggghts
CASE = """
name = "sand"
seed = 3
[box]
size_mm = [2.4, 2.4, 2.4]
[grains]
radius_mm = 0.25
porosity = {porosity}
normal_stiffness_N_m = 9.43e7
shear_stiffness_N_m = 3.4e7
"""


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    """A run folder with a dense pack and its mechanics."""
    folder = tmp_path_factory.mktemp("mechanics")
    (folder / "sand.toml").write_text(CASE.format(porosity=0.36))
    out = folder / "run"
    assert main(["mechanics", str(folder / "sand.toml"), "--out", str(out), "--quiet"]) == 0
    return out


def printed(capsys, *arguments):
    assert main(["mechanics", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def with_keys(*assignments):
    return [part for one in assignments for part in ("--set", one)]


def test_numbers_of_the_contract(packed, capsys):
    numbers = printed(capsys, packed)
    kept = json.loads((packed / "mechanics" / "mechanics.json").read_text())
    assert kept["young_modulus_Pa"] == numbers["young_modulus_Pa"]
    bulk, shear = numbers["bulk_modulus_Pa"], numbers["shear_modulus_Pa"]
    young = 9 * bulk * shear / (3 * bulk + shear)
    assert numbers["young_modulus_Pa"] == pytest.approx(young, rel=1e-9)
    density = 2650 * (1 - 0.36)
    assert numbers["s_wave_m_s"] == pytest.approx((shear / density) ** 0.5, rel=0.01)
    assert numbers["p_wave_m_s"] > numbers["s_wave_m_s"] > 0
    assert 4 < numbers["coordination"] < 9
    assert any("no table [bonds]" in text for text in numbers["warnings"])
    # stiffness and bonds may be set anew on a pack
    keys = "grains.normal_stiffness_N_m=1.886e8", "grains.shear_stiffness_N_m=6.8e7"
    double = printed(capsys, packed, *with_keys(*keys))
    assert double["young_modulus_Pa"] == pytest.approx(2 * numbers["young_modulus_Pa"], rel=1e-6)
    keys = "bonds.radius_ratio=0.5", "bonds.normal_stiffness_GPa_m=2e5"
    bonded = printed(capsys, packed, *with_keys(*keys))
    assert bonded["young_modulus_Pa"] > numbers["young_modulus_Pa"]
    assert bonded["bonds"] > 100


def test_hertz_contacts_stiffen_with_the_third_root_of_pressure(packed):
    data = recorded_case(packed / "case.toml").data()
    del data["grains"]["normal_stiffness_N_m"], data["grains"]["shear_stiffness_N_m"]
    case = case_from(data | {"contact": {"model": "hertz"}})
    pair = resting([[1e-3, 1e-3, 1e-3], [1.5e-3, 1e-3, 1e-3]], 2.5e-4, [[0, 2.4e-3]] * 3)
    soft, stiff = (pack_material(case, pair, pressure) for pressure in (1e6, 8e6))
    assert stiff.normal / soft.normal == pytest.approx(2.0, rel=1e-9)
    with pytest.raises(CaseError, match="--confining-MPa"):
        pack_material(case, pair)


def test_a_triaxial_test_leaves_its_curve(packed, capsys):
    asked = ("--confining-MPa", 5, "--strain", 2e-4, "--steps", 2)
    numbers = printed(capsys, packed, "--triaxial", *asked)
    lines = (packed / "mechanics" / "stress_strain.csv").read_text().splitlines()
    assert len(lines) == 5
    assert lines[0].startswith("axial_strain,volume_strain,axial_Pa,side_Pa,broken_in_tension")
    assert (packed / "mechanics" / "stress_strain.png").stat().st_size > 5000
    ratio = numbers["triaxial"]["young_modulus_Pa"] / numbers["young_modulus_x_Pa"]
    assert 0.5 < ratio < 1.1
    assert numbers["triaxial"]["peak_Pa"] > 0


def test_bad_keys_and_tests_are_refused(packed, capsys, tmp_path):
    stress = "expected a stress above 0"
    for arguments, words in [
        (with_keys("bonds.tensile_strength_MPa=5"), "bonds.radius_ratio: missing"),
        (with_keys("bonds.radius_ratio=1.5"), "less than or equal to 1"),
        (with_keys("grains.radius_mm=0.2"), "belongs to another case"),
        *((["--confining-MPa", value], stress) for value in ("-1", "0", "nan")),
        (["--triaxial"], "give --confining-MPa"),
        (["--triaxial", "--confining-MPa", "1", "--strain", "0.9"], "--strain: 0.9"),
        (["--triaxial", "--confining-MPa", "1e6"], "expected at most 5 %"),
    ]:
        assert main(["mechanics", str(packed), *arguments]) == 2, arguments
        assert words in capsys.readouterr().err
    assert main(["mechanics", str(tmp_path)]) == 2
    assert "holds no fdnet run" in capsys.readouterr().err
    (tmp_path / "loose.toml").write_text(CASE.format(porosity=0.5))
    out = str(tmp_path / "run")
    assert main(["mechanics", str(tmp_path / "loose.toml"), "--out", out, "--quiet"]) == 4
    assert "carries no load along x" in capsys.readouterr().err


def test_the_report_gets_its_section_unless_the_numbers_are_spoilt(packed, tmp_path):
    page = tmp_path / "report.html"
    old = "<!-- mechanics begins -->\nformer\n<!-- mechanics ends -->"
    page.write_text(f"<p>one</p>\n{old}\n<p>two</p>")
    put_mechanics(page, packed / "mechanics")
    parts = re.fullmatch("(?s)<p>one</p>(.*)<p>two</p>", page.read_text())
    assert "Young&#39;s modulus" in parts[1]
    assert "former" not in parts[1]
    spoilt = shutil.copytree(packed / "mechanics", tmp_path / "mechanics")
    path = spoilt / "mechanics.json"
    whole = json.loads(path.read_text())
    for content in (whole | {"young_modulus_Pa": "stiff"}, whole | {"triaxial": [1]}, [1]):
        path.write_text(json.dumps(content))
        with pytest.raises(CaseError, match=r"mechanics\.json: .*measure it anew"):
            mechanics_html(spoilt)
