"""The pages of the studies of mechanics: means and ranges over the seeds."""

from collections.abc import Iterable, Sequence

import numpy as np

from validation.engine.bands import half_width
from validation.engine.markdown import figure, markdown_table
from validation.engine.study import DONE, Row, Value, shown

_TESTED = {
    "slope": ("slope of axial over side stress at a strain of 0.2 %", 1.0),
    "ratio_half": ("axial over side stress, mean at 0.5 to 1.2 %", 1.0),
    "ratio_end": ("axial over side stress, mean at 1.5 to 2 %", 1.0),
    "dilation": ("volume gained at 2 %, %", 100.0),
}


def mechanics_page(rows: Sequence[Row], series: Sequence[str]) -> str:
    """The page of the study of mechanics.

    `series` names moduli with walls and periodic, load steps bare and bonded, and the unbonded
    test in LIGGGHTS and quasi-static.
    """
    walls, periodic, bare, bonded, liggghts, static = series
    parts = [
        "# Mechanics of packs",
        "The quasi-static test and LIGGGHTS agree where the difference lies in its band. Both "
        "start from the same pressed pack of 2.4 mm and 20 kPa, seed by seed.",
        _tested(rows, liggghts, static),
        "Young's modulus of cubes of sand, Pa, with grains glued to walls on all sides or on two "
        "(mean and range over the seeds); contacts of 1e4 and 3.6e3 N/m.",
        _by_value(rows, (walls, periodic), "young", "edge, mm"),
        "Largest deviatoric stress of a triaxial test to a strain of 1.2 %, over that of the most "
        "load steps of the same seed, and seconds of one core.",
        _steps(rows, (bare, bonded)),
    ]
    return "\n\n".join(parts) + "\n"


def _of(rows: Iterable[Row], series: str, quantity: str) -> list[Row]:
    return [
        row for row in rows if (row.series, row.quantity, row.status) == (series, quantity, DONE)
    ]


def _values(rows: Iterable[Row]) -> list[Value]:
    return list(dict.fromkeys(row.value for row in rows))


def spread(values: Sequence[float], factor: float = 1.0) -> str:
    """Mean and range of some values times `factor`."""
    scaled = factor * np.array(values)
    if len(scaled) == 1:
        return figure(scaled[0])
    return f"{figure(scaled.mean())} ({figure(scaled.min())} to {figure(scaled.max())})"


def _tested(rows: Sequence[Row], liggghts: str, static: str) -> str:
    lines = []
    for quantity, (words, factor) in _TESTED.items():
        one = {row.seed: row.observed for row in _of(rows, liggghts, quantity)}
        other = {row.seed: row.observed for row in _of(rows, static, quantity)}
        both = sorted(set(one) & set(other))
        if not both:
            continue
        apart = factor * np.array([other[seed] - one[seed] for seed in both])
        lines.append(
            [
                words,
                spread([one[seed] for seed in both], factor),
                spread([other[seed] for seed in both], factor),
                f"{figure(apart.mean())} ± {figure(half_width(apart.tolist()))}",
                str(len(both)),
            ]
        )
    header = ["quantity", "LIGGGHTS", "quasi-static", "difference (95 %)", "seeds"]
    return markdown_table(header, lines)


def _by_value(rows: Sequence[Row], series: Sequence[str], quantity: str, knob: str) -> str:
    values = _values(_of(rows, series[0], quantity))
    lines = [
        [
            shown(value),
            *(
                spread([row.observed for row in _of(rows, name, quantity) if row.value == value])
                for name in series
            ),
        ]
        for value in values
    ]
    return markdown_table([knob, *series], lines)


def _steps(rows: Sequence[Row], series: Sequence[str]) -> str:
    lines = []
    for name in series:
        some = _of(rows, name, "peak")
        for value in _values(some):
            group = [row for row in some if row.value == value]
            lines.append(
                [
                    name,
                    shown(value),
                    spread([1 + row.error for row in group]),
                    spread([row.core_s for row in group]),
                ]
            )
    return markdown_table(["test", "load steps", "peak over that of the most", "seconds"], lines)


def compaction_page(
    rows: Sequence[Row], sands: Sequence[str], cements: Sequence[str], trend: float
) -> str:
    """The page; `trend` is the exponent of a measured law k = k0 exp(-trend p), 1/MPa."""
    parts = [
        "# Sand under stress",
        "Porosity and permeability of packs of 2.4 mm, porosity 0.36, under an isotropic "
        "effective stress, over those without stress (mean and range over the seeds). The last "
        f"column is the law that Nazarova and others (2019) measured, exp(-{trend:g} p/MPa).",
        _stressed(rows, sands, trend),
        "The largest displacement of a grain in a bonded pack of porosity 0.40, whose grains "
        "hardly touch, by the fall of pressure over the thesis's specimen, 3.5 MPa over 8 mm, in "
        "cubes of 2.4 mm between two plates. It grows with the square of the length.",
        markdown_table(
            ["bonds", "displacement, µm"],
            [
                [name, spread([row.observed for row in _of(rows, name, "moved")], 1e6)]
                for name in cements
            ],
        ),
    ]
    return "\n\n".join(parts) + "\n"


def _stressed(rows: Sequence[Row], sands: Sequence[str], trend: float) -> str:
    lines = []
    for name in sands:
        for value in _values(_of(rows, name, "k")):
            if value == 0.0:
                continue
            changes = [
                [1 + row.error for row in _of(rows, name, quantity) if row.value == value]
                for quantity in ("porosity", "k")
            ]
            law = figure(float(np.exp(-trend * float(value))))
            lines.append([name, shown(value), *map(spread, changes), law])
    header = ["sand", "stress, MPa", "porosity", "permeability", "measured law"]
    return markdown_table(header, lines)
