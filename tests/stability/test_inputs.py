"""NaN, infinities and broken files at the doors: one clear error, nothing written."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from fdnet.cli import main
from fdnet.errors import CaseError
from tests.network.packs import random_pack, snapshot

UNIT = ("--units", "mm", "--box", "0,4,0,4,0,4")


def permeability(capsys, path: Path, *options: str) -> tuple[int, str, str]:
    try:
        code = main(["permeability", str(path), *options])
    except SystemExit as stop:
        code = int(stop.code or 0)
    printed = capsys.readouterr()
    return code, printed.out, printed.err


def table(path: Path, **swap: str) -> None:
    """A simple cubic lattice of 64 touching spheres; `swap` replaces cells of the third sphere."""
    names = ("x", "y", "z", "radius", "kind")
    rows = [
        [*map(str, place), "0.5", "grain"]
        for place in np.indices((4, 4, 4)).reshape(3, -1).T + 0.5
    ]
    for name, text in swap.items():
        rows[2][names.index(name)] = text
    path.write_text("\n".join([",".join(names), *map(",".join, rows)]) + "\n")


def test_radii_beyond_reason_are_refused(tmp_path, capsys):
    """Their cubes are no doubles: overflow where it was not refused."""
    for radius in ("1e308", "1e-200", "1e100"):
        table(tmp_path / "s.csv", radius=radius)
        code, out, err = permeability(capsys, tmp_path / "s.csv", *UNIT)
        assert (code, out) == (4, "")
        assert "check the units" in err


def test_a_stray_sphere_is_left_out_unless_a_period_would_have_to_bring_it_back(tmp_path, capsys):
    """1e25 periods away no digit of its place is left; next to a wall it is counted as outside."""
    for place, periodic, code in (("1e308", "", 4), ("1e25", "x", 4), ("1e25", "", 0)):
        table(tmp_path / "s.csv", x=place)
        options = [*UNIT, "--periodic", periodic, "--json"]
        ended, out, err = permeability(capsys, tmp_path / "s.csv", *options)
        assert ended == code, err
        if code == 0:
            warnings = json.loads(out)["warnings"]
            assert any("1 grains lie outside the box" in one for one in warnings)


@pytest.mark.parametrize("name", ["position", "radius", "box"])
def test_a_snapshot_holds_no_number_that_is_none(name):
    pack = random_pack(40)
    for value in (math.nan, math.inf, -math.inf):
        names = ("position", "radius", "box")
        fields = {one: getattr(pack, one).copy() for one in names}
        fields[name].flat[1] = value
        with pytest.raises(CaseError, match=f"{name} holds values that are not finite"):
            snapshot(**fields)


def test_a_pack_whose_paths_are_all_closed_is_an_answer_at_the_command_line(tmp_path, capsys):
    """A radius of 0.72 spacings closes every triangle of a cubic lattice (0.707): k = 0."""
    place = np.indices((4, 4, 4)).reshape(3, -1).T + 0.5
    rows = "".join(f"{x},{y},{z},0.72\n" for x, y, z in place)
    (tmp_path / "s.csv").write_text("x,y,z,radius\n" + rows)
    options = [*UNIT, "--periodic", "xyz", "--json"]
    code, out, _ = permeability(capsys, tmp_path / "s.csv", *options)
    result = json.loads(out)
    assert code == 0
    assert result["k_initial_m2"] == result["k_damaged_m2"] == 0
    assert result["k_reduction"] is None
    assert any("k_initial = 0: no open path" in one for one in result["warnings"])
