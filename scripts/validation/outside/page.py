"""The page of the outside numbers: its answer as a table, the figure, and how it was done."""

from collections.abc import Sequence
from string import Template

from validation.engine.markdown import bullets, markdown_table
from validation.engine.study import Row
from validation.engine.table import missing_lines
from validation.outside.answers import Answer
from validation.outside.clogs import FEWEST
from validation.outside.constriction import HIGH, LONG, LOW, SHORT, cloggings_of, regime
from validation.outside.orifice import PUSH

TITLE = "The invasion against numbers from outside"
_PAGE = Template("""# $title

Each line is a number that does not come from fdnet, and what the real LIGGGHTS binary gives for
it. One command makes all of them, the figure included, and goes on where it was stopped:

```
.venv/bin/python scripts/validation.py outside-numbers
```

$table

The last column is the reduced form, which the tests run in seconds; a test file is run by
`pytest FILE`. Rows: `validation/outside-numbers.csv`, $runs runs, $hours h.

![Passing ratio of a throat, probability of a clog, and fines before a clog](outside-numbers.png)

$constriction## What could be read of the sources

- Marin and others (arXiv 1711.06119): abstract and beginning of the text. Charged particles of
  low friction; clogs below three diameters, an uninterrupted flow above, at 60 % by volume.
- Souzy and Marin (J. Fluid Mech. 2022, arXiv 2205.04354): abstract and beginning of the text. Its
  channel, of 3.03 to 5.26 diameters, flows and stops by turns: arches break again, as none does
  here under a steady push.
- AIChE 2013, 172h, and Lafond's thesis (Colorado School of Mines 2014): the abstracts. They give
  the geometric law, its onset once a heap is there, and ln P proportional to R² − 1, but no slope.
- Percolation of a cohesive fine particle (arXiv 2605.19845): abstract. Fines of 1/7 that do not
  touch each other pass a static bed unless they are cohesive.
- LAMMPS's `examples/granular/in.sync_verlet`: the set-up and the time of 0.145 s.
$not_done""")

_CONSTRICTION = Template("""## How the constriction is built

A wall of held spheres, half as large as the fines, leaves a round hole of R fine diameters. Fines
rain on it and lie as a heap. Stokes drag in a uniform velocity along x pushes every fine with
$push k r, at a Stokes number of $stokes: a body force with viscous damping, not a field that
converges on the hole. The box is periodic along x, so those that escape come back on top of the
heap, which stays crowded. Counting begins when all have come down; a run ends when nothing moves
any more, or when the fluid has passed $most fine diameters since. As many fines as lie in the half
ball over the hole, 0.3 R³, escape even when an arch stands over them already; what follows them is
counted, and runs that clogged before have a column of their own. The line is fitted to holes with
at least $fewest clogs at which most runs were counted: of a narrower hole those that are left are
not a sample of the flow, but of what survives the growth of the heap. The number of fines skipped
and this rule were chosen after the first half of the runs of friction 0.5 had been looked at; the
second half was added afterwards. Beyond R = 3 clogs are too rare to be seen in runs of this
length.

$clogs

""")


def page(answers: Sequence[Answer], rows: Sequence[Row]) -> str:
    """The Markdown of the page.

    Args:
        answers: lines of the first table.
        rows: of the study, for the table of clogs.
    """
    seconds = {row.run: row.wall_s for row in rows}
    table = markdown_table(
        ["what", "expected (source)", "measured", "verdict", "test"],
        [[one.what, one.expected, one.measured, one.word, f"`{one.test}`"] for one in answers],
    )
    missing = missing_lines(rows)
    return _PAGE.substitute(
        title=TITLE,
        table=table,
        runs=len(seconds),
        hours=f"{sum(seconds.values()) / 3600:.2g}",
        constriction=_constriction(rows),
        not_done=f"\nNot done:\n\n{bullets(missing)}\n" if missing else "",
    )


def _constriction(rows: Sequence[Row]) -> str:
    """How the constriction is built and all its holes; nothing without a row of it."""
    if not any(cloggings_of(rows, friction) for friction in (LOW, HIGH)):
        return ""
    return _CONSTRICTION.substitute(
        push=f"{PUSH:g}",
        stokes=regime(),
        most=f"{LONG:g} (at wide holes {SHORT:g})",
        fewest=FEWEST,
        clogs=_clogs(rows),
    )


def _clogs(rows: Sequence[Row]) -> str:
    """The probability of a clog by friction and R."""
    lines = [
        [
            f"{friction:g}",
            f"{ratio:g}",
            f"{one.clogs}",
            f"{one.early}",
            f"{one.escapes:,}",
            f"{one.probability:.2g}",
            f"{one.low:.2g} to {one.high:.2g}",
        ]
        for friction in (LOW, HIGH)
        for ratio, one in cloggings_of(rows, friction).items()
    ]
    heads = ["friction", "R", "clogs", "clogged before", "escaped", "P", "95 % (binomial)"]
    return markdown_table(heads, lines)
