"""Rules of thumb of the field for the sizes of a bridging solid, set against what the run shows.

They compare sizes only; none of them knows the flow or the time. A throat here is the circle that
touches the three grains around it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

ABRAMS_SIZE, ABRAMS_SHARE = 1 / 3, 0.05
FILTER_SAFE, FILTER_FAILS = 5.0, 9.0
SQRT_SHARE = (0.5 / 0.9) ** 2
"""D50 over D90 where the share finer grows with the square root of the size."""
SQRT_REACH = 1.5
"""Factor within which D50 counts as on the line of the square root."""
THROUGH = 0.5
"""Share of the fines that entered and came out again above which the sand lets them through."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Diameters in m; shares are by volume.

    Attributes:
        fines: D50, D85 and D90 of the fines by name.
        throat_median: median of the open throats, by number.
        throat_largest: throat that 99 % of the open ones are narrower than.
        grain_d15: D15 of the grains.
        concentration: share of solids in the mud.
    """

    fines: Mapping[str, float]
    throat_median: float
    throat_largest: float
    grain_d15: float
    concentration: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """What a rule says.

    Attributes:
        rule: its name.
        source: where it was published.
        quantity: what is compared, in words.
        value: of the case, dimensionless.
        limit: of the rule, in words.
        says: "bridges", "passes" or "between".
        agrees: whether the run shows the same; None where rule or run is undecided.
    """

    rule: str
    source: str
    quantity: str
    value: float
    limit: str
    says: str
    agrees: bool | None


def run_shows(summary: Mapping[str, Any]) -> str:
    """What the sand did with the fines: "bridges", "passes" or "undecided".

    It passes where more than half of the fines that entered left through the outlet, or more than
    5 % of those inside lie in the last tenth of the specimen. It bridges where the face was
    plugged otherwise. A run that ended in another way is undecided.
    """
    entered = summary["invaded_count"] + summary["passed_count"]
    length = summary["sections"][-1]["x_hi_m"]
    through = summary["passed_count"] > THROUGH * entered
    deep = summary["invasion_depth_p95_m"] > 0.9 * length
    if entered and (through or deep):
        return "passes"
    return "bridges" if summary["stop_reason"] == "plugged" else "undecided"


def rules_of(sizes: Sizes, shows: str) -> list[dict[str, Any]]:
    """Every rule as a mapping, with whether it agrees with the run (`run_shows`)."""
    return [asdict(rule) for rule in _rules(sizes, shows)]


def _rules(sizes: Sizes, shows: str) -> Iterator[Rule]:
    fines = sizes.fines
    ratio = fines["D50"] / sizes.throat_median
    abrams = ratio >= ABRAMS_SIZE and sizes.concentration >= ABRAMS_SHARE
    yield _rule(
        "median size and concentration",
        "Abrams 1977, J. Pet. Technol. 29(5), 586-592",
        f"D50 of the fines over the median throat, at {100 * sizes.concentration:.3g} % of "
        "solids by volume",
        ratio,
        "bridges from 1/3 on, at 5 % of solids or more",
        "bridges" if abrams else "passes",
        shows,
    )
    largest = fines["D90"] / sizes.throat_largest
    yield _rule(
        "largest throat",
        "Hands and others 1998, Oil & Gas J. 96(28), 65-68",
        "D90 of the fines over the largest throat (99 % are narrower)",
        largest,
        "bridges from 1 on",
        "bridges" if largest >= 1 else "passes",
        shows,
    )
    line = fines["D50"] / (SQRT_SHARE * sizes.throat_largest)
    on_line = line >= 1 / SQRT_REACH and largest >= 1
    yield _rule(
        "ideal packing (square root of the size)",
        "Dick and others 2000, SPE 58793",
        "D50 of the fines over that of the ideal line, 0.309 of the largest throat",
        line,
        f"bridges from 1/{SQRT_REACH:g} on, where D90 fills the largest throat too",
        "bridges" if on_line else "passes",
        shows,
    )
    kept = sizes.grain_d15 / fines["D85"]
    says = "bridges" if kept <= FILTER_SAFE else "passes" if kept > FILTER_FAILS else "between"
    yield _rule(
        "filter ratio",
        "Sherard, Dunnigan and Talbot 1984, J. Geotech. Eng. 110(6), 684-700",
        "D15 of the grains over D85 of the fines",
        kept,
        "holds the fines up to 5, lets them pass above 9",
        says,
        shows,
    )


def _rule(
    name: str, source: str, quantity: str, value: float, limit: str, says: str, shows: str
) -> Rule:
    decided = {says, shows} <= {"bridges", "passes"}
    agrees = says == shows if decided else None
    return Rule(
        rule=name,
        source=source,
        quantity=quantity,
        value=value,
        limit=limit,
        says=says,
        agrees=agrees,
    )
