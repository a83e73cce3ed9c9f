"""The same spheres written down in another way give the same permeability, by the command line.

The bounds, and the reasons for them, stand in docs/reference/promises.md.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from builders import naming

from fdnet.cli import main
from fdnet.spheres.snapshot import Array, Kind
from tests.network.packs import random_pack, with_fines

NIGHTLY = pytest.mark.nightly
ROUNDING = 1e-11
"""Largest relative difference of two descriptions, without fines and by the damage laws that do
not tessellate them."""

RAYS = {"xyz": 5e-10, "yz": 4e-7, "": 2.5e-7}
"""That of all spheres, three times what is measured: a prism that a face cuts is split either way,
and the spheres around a throat are sought about the centroid of its triangle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """Spheres as a file describes them: centres, radii, kinds, bounds (3, 2), and the words."""

    place: Array
    radius: Array
    kind: Array
    box: Array
    periodic: str
    axis: str = "x"
    unit: str = "m"


def permuted(pack: Pack) -> Pack:
    order = np.random.default_rng(4).permutation(len(pack.place))
    return replace(pack, place=pack.place[order], radius=pack.radius[order], kind=pack.kind[order])


def shifted(pack: Pack) -> Pack:
    """By a third of each period."""
    around = [name in pack.periodic for name in "xyz"]
    length = np.ptp(pack.box, axis=1)
    place = pack.box[:, 0] + (pack.place - pack.box[:, 0] + length / 3) % length
    return replace(pack, place=np.where(around, place, pack.place))


def mirrored(axis: int):
    def change(pack: Pack) -> Pack:
        place = pack.place.copy()
        place[:, axis] = pack.box[axis].sum() - place[:, axis]
        return replace(pack, place=place)

    return change


def turned(pack: Pack) -> Pack:
    """The file's axes are named in another order, the flow is along what was x."""
    order = [2, 0, 1]
    around = "".join("xyz"[new] for new in range(3) if "xyz"[order[new]] in pack.periodic)
    place, box = pack.place[:, order], pack.box[order]
    return replace(pack, place=place, box=box, periodic=around, axis="y")


def doubled(pack: Pack) -> Pack:
    """Two periods along y."""
    step, box = np.array([0.0, np.ptp(pack.box[1]), 0.0]), pack.box.copy()
    box[1, 1] += step[1]
    place = np.vstack([pack.place, pack.place + step])
    radius, kind = np.tile(pack.radius, 2), np.tile(pack.kind, 2)
    return replace(pack, place=place, radius=radius, kind=kind, box=box)


def in_millimetres(pack: Pack) -> Pack:
    place, radius, box = 1e3 * pack.place, 1e3 * pack.radius, 1e3 * pack.box
    return replace(pack, place=place, radius=radius, box=box, unit="mm")


CHANGES = {
    "permuted": permuted,
    "shifted": shifted,
    "mirrored in x": mirrored(0),
    "mirrored in y": mirrored(1),
    "turned": turned,
    "doubled": doubled,
    "in millimetres": in_millimetres,
}


def permeability(pack: Pack, folder: Path, capsys, *options: str) -> tuple[float, float]:
    """k without and with fines, m2."""
    path = folder / "spheres.csv"
    names = np.where(pack.kind == Kind.GRAIN, "grain", "fine")
    rows = zip(pack.place.tolist(), pack.radius.tolist(), names, strict=True)
    lines = [f"{x!r},{y!r},{z!r},{radius!r},{name}" for (x, y, z), radius, name in rows]
    path.write_text("\n".join(["x,y,z,radius,kind", *lines]) + "\n")
    box = ",".join(repr(float(bound)) for bound in pack.box.ravel())
    words = ["--units", pack.unit, "--periodic", pack.periodic, "--axis", pack.axis, "--json"]
    code = main(["permeability", str(path), f"--box={box}", *words, *options])
    printed = capsys.readouterr()
    assert code == 0, printed.err
    result = json.loads(printed.out)
    return result["k_initial_m2"], result["k_damaged_m2"]


def spheres(spread: float, periodic: str) -> Pack:
    both = with_fines(random_pack(40, 0.55, spread=spread), 120, 0.12)
    place, radius, kind, box = both.position, both.radius, both.kind, both.box
    return Pack(place=place, radius=radius, kind=kind, box=box, periodic=periodic)


@pytest.mark.parametrize("periodic", [pytest.param("xyz", marks=NIGHTLY), "yz", ""])
def test_another_description_of_the_same_pack_gives_its_permeability(tmp_path, capsys, periodic):
    """Radii of a wide range in all ways; equal ones, where prisms are cospherical, in two."""
    few = [(0.0, ("permuted", "mirrored in x"))] if periodic == "yz" else []
    for spread, names in [(0.3, tuple(CHANGES)), *few]:
        pack = spheres(spread, periodic)
        for damage_law, rounding in (("thesis", ROUNDING), ("auto", RAYS[periodic])):
            law = ("--damage-law", damage_law)
            intact, damaged = permeability(pack, tmp_path, capsys, *law)
            assert damaged < intact
            for name in names:
                if name == "doubled" and "y" not in periodic:
                    continue  # two walled packs side by side are another pack
                with naming(name, spread, damage_law):
                    other = permeability(CHANGES[name](pack), tmp_path, capsys, *law)
                    assert other[0] == pytest.approx(intact, rel=ROUNDING)
                    assert other[1] == pytest.approx(damaged, rel=rounding)


def test_without_tables_the_mirror_image_agrees_to_rounding(tmp_path, capsys):
    """The law of the thesis has closed forms only."""
    pack, law = spheres(0.3, "yz"), ("--law", "thesis")
    whole, _ = permeability(pack, tmp_path, capsys, *law)
    for axis in (0, 1):
        image, _ = permeability(mirrored(axis)(pack), tmp_path, capsys, *law)
        assert image == pytest.approx(whole, rel=1e-12)
