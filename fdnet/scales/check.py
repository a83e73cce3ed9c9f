"""What is doubtful in a case, and what its run takes: what `fdnet check` says."""

import math
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fdnet.case.case import WIDEST_THROAT, Case, InvasionCase
from fdnet.errors import PAGE, catalogue, explained
from fdnet.scales.clock import TAKEN_SOLIDS, spoken_time
from fdnet.scales.cost import Cost, cost_of, peak_memory
from fdnet.scales.drag import BRIDGING
from fdnet.scales.flow import USUAL_WELL, Losses, radial
from fdnet.scales.pack import POROSITY_TOLERANCE, grain_count
from fdnet.scales.scales import InvasionScales, Scales, scales_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that is odd."""

    key: str  # of the case that it is about; empty where it is about no single one
    what: str  # what is odd; a `Doubt` where it is one of the warnings of the scales
    follows: str  # what follows for the answer
    do: str  # what to do
    read: str  # the page that says more
    refused: bool = False  # whether `fdnet run` refuses the case for it

    @property
    def sentence(self) -> str:
        """As a warning of a summary."""
        if not self.key:
            return explained(self.what)
        return (
            f"{self.key}: {self.what}; what follows: {self.follows}; what to do: {self.do} "
            f"(see {self.read})"
        )


# ------------------------------------------------------------------------------------------------
# By how much a specimen shows another permeability than the bulk, because it is narrow.
#
# The values are those of the study `specimen-size` (docs/evidence/error_against_time.md): cubes of
# equal grains at a porosity of 0.40, the mean of 5 or 10 packs, against cubes of 16 grains with
# periodic sides.


WIDTHS = (3.0, 4.0, 5.0, 6.0, 8.0, 11.0, 16.0)  # Width over grain diameter
PERIODIC = (-0.366, -0.119, -0.066, -0.053, -0.039, -0.022)
"""Permeability over that of the bulk, less 1, with periodic sides; the widest is the bulk."""
WALLS = (-0.356, -0.267, -0.193, -0.197, -0.152, -0.117, -0.074)
"""The same with walls at the sides."""


def width_error(width: float, *, periodic: bool) -> float:
    """Expected permeability over that of the bulk, less 1, of a specimen.

    `width` is its narrower side over the mean diameter of the grains; between those studied it is
    interpolated over the logarithm, beyond them the error falls as one over the width.
    """
    errors = PERIODIC if periodic else WALLS
    widths = WIDTHS[: len(errors)]
    if width > widths[-1]:
        return errors[-1] * widths[-1] / width
    return float(np.interp(np.log(width), np.log(widths), errors))


# ---- What is odd about the sizes and the supply of a case.
MOST_WIDTH_ERROR = 0.10
"""Error of the permeability by the width of the specimen, from which it is named."""
LEAST_LENGTH = 3.0  # Length over the mean grain, below which it is named
MOST_GRAIN = 3.0  # One grain's porosity over the tolerance of a pack, from which it is named
ABSURD = 10.0
"""Velocity over that at a usual well, from which it is named; the square of it where the case
gives the velocity or a plug."""
FINE_SHARE, MOST_FINE_COST = 0.1, 3.0
"""Share of the finest solids, and the time with them over that without, from which it is named."""
MOST_COARSE = 0.25  # Share of the fines wider than every throat, from which it is named
WHOLE_GRAIN = 1 - 1e-6


def findings(case: Case, scales: Scales) -> Iterator[Finding]:
    """All that is odd about the sizes of a case; its warnings are said by `scales`."""
    mean, periodic, side = case.grains.sauter_diameter_m, case.periodic[1], min(case.size_m[1:])
    error = width_error(side / mean, periodic=periodic)
    if abs(error) >= MOST_WIDTH_ERROR:
        wide = (
            n for n in range(2, 200) if abs(width_error(n, periodic=periodic)) < MOST_WIDTH_ERROR
        )
        sides = "" if periodic else "box.sides = 'periodic', or "
        yield Finding(
            key="box.size_mm",
            what=f"the specimen is {side / mean:.2g} mean grains wide ({1e3 * side:.3g} mm)",
            follows=f"its intact permeability is about {100 * abs(error):.0f} % "
            f"{'below' if error < 0 else 'above'} that of the bulk sand (packs of equal grains); "
            "the ratio of damaged to intact suffers less",
            do=f"take {sides}a width of {1e3 * next(wide) * mean:.2g} mm for less than "
            f"{100 * MOST_WIDTH_ERROR:.0f} %, or use the ratio only",
            read="docs/evidence/error_against_time.md",
        )
    length = case.size_m[0] / mean
    if isinstance(case, InvasionCase) and length < LEAST_LENGTH * WHOLE_GRAIN:
        yield Finding(
            key="box.size_mm",
            what=f"the specimen is {length:.2g} mean grains long ({1e3 * case.size_m[0]:.3g} mm)",
            follows="the damage may reach its end, and then there is no depth and no skin",
            do=f"take a length of {8e3 * mean:.2g} mm, 8 grains, or more",
            read="docs/how-to/your_sand_and_your_mud.md",
        )
    grain = case.grains.mean_volume_m3 / math.prod(case.size_m)
    if case.grains.count is None and grain > (most := MOST_GRAIN * POROSITY_TOLERANCE):
        yield Finding(
            key="grains.porosity",
            what=f"one grain is {grain:.2g} of the porosity, and a pack must meet it within "
            f"{POROSITY_TOLERANCE:g}",
            follows="no pack may meet it, and then the run stops before the invasion",
            do=f"take a box of {grain / most:.2g} times the volume, or give grains.count = "
            f"{grain_count(case)} in place of the porosity",
            read="docs/how-to/seeds_and_cost.md",
        )
    diameter, count = 2 * case.grains.mean_radius_m, case.analysis.sections
    assert isinstance(count, int)
    thickness = case.size_m[0] / count
    if thickness < WHOLE_GRAIN * diameter:
        most = int(case.size_m[0] / diameter)
        yield Finding(
            key="analysis.sections",
            what=f"sections of {1e3 * thickness:.3g} mm are thinner than a grain "
            f"({1e3 * diameter:.3g} mm)",
            follows="the permeability of each is that of a few throats",
            do=f"take {most} sections or fewer" if most else "take a longer box",
            read="docs/how-to/check_the_face.md",
        )
    if isinstance(case, InvasionCase) and isinstance(scales, InvasionScales):
        yield from _of_the_invasion(case, scales)


def _of_the_invasion(case: InvasionCase, scales: InvasionScales) -> Iterator[Finding]:
    (radius, outer), fines = USUAL_WELL, case.fines
    losses = Losses(viscous=case.fluid.viscosity_Pa_s / scales.permeability)
    usual = losses.velocity(case.fluid.overbalance_Pa, radial(radius, outer)) / scales.porosity
    ratio = scales.interstitial_velocity / usual
    given = case.fluid.velocity_m_s is not None or case.fluid.darcy_length_m is not None
    odd = ABSURD**2 if given else ABSURD  # without all three a warning of the scales says it
    if (given or case.well is not None) and not 1 / odd <= ratio <= odd:
        yield Finding(
            key="well",
            what=f"the fluid moves at {scales.interstitial_velocity:.3g} m/s in the pores, "
            f"{ratio:.2g} times as fast as {usual:.2g} m/s at the face of a well of "
            f"{1e3 * radius:.0f} mm with this overbalance",
            follows="drag and depth are not those around a well",
            do="give the table [well] with radius and drainage_radius, unless the case is a plug "
            "in a laboratory",
            read="docs/how-to/choose_the_velocity.md",
        )
    # the slab runs out, or the time, before as much has come as plugged the shipped cases
    solids = scales.slab_length * case.solids_fraction / case.grains.curve.size_at(0.5)
    feeding = scales.slab_length / scales.upstream_velocity
    come = solids * min(1.0, scales.cap_time / feeding)
    if scales.throat_ratio >= BRIDGING and come < TAKEN_SOLIDS:
        more, by_time = TAKEN_SOLIDS / solids, scales.cap_time < feeding
        key = "fines.count" if fines.count is not None else "fines.slab_mm"
        key = "fines" if fines.endless else key  # so many of them that the mud is cut off
        supply = (
            f"supply {1e3 * more * scales.slab_length:.2g} mm of mud ({more:.2g} times as much)"
        )
        yield Finding(
            key="run.cap_ms" if by_time else key,
            what=f"the fines that come would fill {come:.2g} of a median grain's depth; the "
            f"shipped cases were plugged by 0.1 to {TAKEN_SOLIDS:g}",
            follows="the mud, or the time, may run out before the face plugs; then more mud would "
            "do more damage",
            do="give the run more time (run.cap_ms or run.duration_ms)" if by_time else supply,
            read="docs/start/first_answer.md",
        )
    # solids that pass no throat between the largest grains
    widest, curve = 2 * WIDEST_THROAT * case.grains.radius_range_m[1], fines.curve
    share = 1 - float(curve.share_finer(np.array(widest))) if curve.low < widest else 1.0
    if curve.high > widest and share >= MOST_COARSE:
        yield Finding(
            key="fines.sizes" if fines.measured else "fines.radius_mm",
            what=f"{100 * share:.0f} % of the fines are wider than every throat between "
            f"touching grains (at most {1e3 * widest:.3g} mm)",
            follows="they enter only where grains stand apart; most build a cake",
            do="check the units of both sizes; if they are right, a shorter box is enough",
            read="docs/how-to/your_sand_and_your_mud.md",
        )
    # the finest tenth of the solids makes most of the time
    if not fines.measured or curve.low == curve.high or case.by_classes:
        return
    cut = float(f"{1e6 * curve.size_at(FINE_SHARE):.2g}")
    data = case.data()
    data["fines"]["cut_um"] = cut
    without = type(case).model_validate(data)
    seconds = cost_of(case, scales).invade_seconds
    less = cost_of(without, scales_of(without)).invade_seconds
    if seconds >= 60 and seconds >= MOST_FINE_COST * less:
        yield Finding(
            key="fines.cut_um",
            what=f"the finest {100 * FINE_SHARE:.0f} % of the solids (below {cut:.2g} um) take "
            f"most of the time, {spoken_time(seconds)} instead of {spoken_time(less)}",
            follows="the run is long for what these sizes add",
            do=f"set fines.cut_um = {cut:.2g} unless they matter",
            read="docs/how-to/your_sand_and_your_mud.md",
        )


# ---- A case looked at: all that is odd, and what the run takes.
@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """What is odd about a case, and what it takes."""

    name: str  # of the case
    findings: tuple[Finding, ...]  # what is odd; what `fdnet run` refuses comes first
    cost: Cost  # of the run
    memory: float  # bytes at most, of one process

    def data(self) -> dict[str, Any]:
        """As plain values."""
        return {
            "case": self.name,
            "findings": [asdict(one) for one in self.findings],
            "seconds": self.cost.seconds,
            "seconds_pack": self.cost.pack_seconds,
            "seconds_invade": self.cost.invade_seconds,
            "seconds_analyse": self.cost.analyse_seconds,
            "time": spoken_time(self.cost.seconds),
            "memory_bytes": self.memory,
        }

    def lines(self) -> list[str]:
        """As text."""
        rows = []
        for one in self.findings:
            key = f"{one.key}: " if one.key and not one.what.startswith(one.key) else ""
            rows.append(f"warning: {key}{one.what}")
            more = (("what follows", one.follows), ("what to do", one.do), ("read", one.read))
            rows += [f"    {name}: {text}" for name, text in more if text]
        cost, count = self.cost, len(self.findings)
        parts = f"pack {spoken_time(cost.pack_seconds)}"
        if cost.invade_seconds:
            parts += f", invasion {spoken_time(cost.invade_seconds)}"
        if cost.update_seconds:
            parts += f" ({spoken_time(cost.update_seconds)} of them for the flow)"
        parts += f", analysis and report {spoken_time(cost.analyse_seconds)}"
        rows += [
            f"time: {spoken_time(cost.seconds)} on one idle core, within a factor of 2 ({parts})",
            f"memory: {self.memory / 1e9:.2g} GB",
        ]
        head = f"{count} thing{'s' * (count > 1)} to look at" if count else "fine"
        wrapped = textwrap.TextWrapper(
            96, subsequent_indent=" " * 8, break_on_hyphens=False, break_long_words=False
        )
        return [f"{self.name}: {head}", *(line for row in rows for line in wrapped.wrap(row))]


def checked(case: Case, scales: Scales, refusals: Iterable[str] = ()) -> Checked:
    """All that is odd about a case; `refusals` are why `fdnet run` would not take it."""
    follows = "fdnet run refuses the case"
    refused = [
        Finding(key=one.split(":")[0], what=one, follows=follows, do="", read="", refused=True)
        for one in refusals
    ]
    return Checked(
        name=case.name,
        findings=(*refused, *every_finding(case, scales)),
        cost=cost_of(case, scales),
        memory=peak_memory(case, scales),
    )


def every_finding(case: Case, scales: Scales) -> list[Finding]:
    """All that is odd about a case: what `fdnet check` says, and the summary of its run."""
    of_scales = [
        Finding(key="", what=one, follows=entry.follows, do=entry.do, read=f"{PAGE}#{one.kind}")
        for one in scales.warnings
        for entry in [catalogue()[one.kind]]
    ]
    return [*findings(case, scales), *of_scales]
