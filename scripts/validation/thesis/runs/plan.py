"""The runs that make the study of the thesis."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import QUICK, case_path, read_case
from fdnet.scales.scales import invasion_scales

SPECIMENS = tuple(f"specimen{number}" for number in range(1, 9))
VARIANTS = ("specimen1-7to8", "specimen1-1410", "specimen5-5to6", "table3")
CHEAP = frozenset(
    {"specimen1", "specimen2", "specimen4", "specimen5", "specimen1-7to8", "specimen1-1410"}
)
"""Cases that are run with SEEDS seeds.

The others take up to an hour each and are run with one; their trends come from the quick forms.
"""
SEEDS, QUICK_SEEDS, SCAN_SEEDS = 3, 5, 3
FRICTIONS = (0.0, 0.1)
"""Frictions of the fines that are tried; the cases have 0.55."""
MULTIPLIERS = (0.3, 3.0, 10.0)
"""Drag multipliers that are tried; the cases have 1.

Springs are stiffened with them, so that stronger drag does not press spheres together.
"""
SUPPLIES = (0.25, 0.5, 2.0)
"""Numbers of fines supplied that are tried, relative to that of the case."""
REASONS = (
    "grains.motion=mobile",
    "run.stiffness_N_m=100.0",
    "grains.count=1369",
    "drag.multiplier=30",
    "box.sides=periodic",
)
"""Settings that might let more fines into specimen 1.

They are mobile grains, soft contacts, a porosity counted as the plain sum of the spheres (1,369
grains leave 0.30), strong drag, and no walls.
"""
BASE_VALUES = {"friction": 0.55, "drag": 1.0, "supply": 1.0}
"""The value of each scanned quantity in the cases themselves, by group."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """One run: a shipped case with a seed and with changed settings.

    Attributes:
        case: name of the case, with "quick-" before it for its quick form.
        group: "specimen", "variant", "quick", "reason", or the quantity that is scanned:
            "friction", "drag" or "supply".
        seed: seed of the run.
        settings: changed settings as "key=value", which stand in the run's name.
        consequences: settings that follow from the others and do not stand in the name.
        value: value of the scanned quantity; nan without one.
    """

    case: str
    group: str
    seed: int = 1
    settings: tuple[str, ...] = ()
    consequences: tuple[str, ...] = ()
    value: float = float("nan")

    @property
    def id(self) -> str:
        """Name of the run, the same for all seeds."""
        return " ".join([self.case, *self.settings])

    @property
    def slug(self) -> str:
        """Name of the files of the run."""
        return (
            "".join(c if c.isalnum() or c in ".=-" else "_" for c in self.id) + f"-seed{self.seed}"
        )

    def load(self) -> InvasionCase:
        """Read its case. Raises CaseError when the case file is missing or wrong."""
        settings = [f"seed={self.seed}", *self.settings, *self.consequences]
        return with_fines(read_case(case_path(self.case), assignments=settings))


def planned(*, quick: bool) -> list[Planned]:
    """All runs of the study, or with `quick` one run of each quick form."""
    forms = [QUICK + name for name in (*SPECIMENS, *VARIANTS)]
    if quick:
        return [Planned(case=name, group="quick") for name in forms]
    runs = [
        Planned(case=name, group="specimen" if name in SPECIMENS else "variant", seed=seed)
        for name in (*SPECIMENS, *VARIANTS)
        for seed in range(1, (SEEDS if name in CHEAP else 1) + 1)
    ]
    runs += [
        Planned(case=name, group="quick", seed=seed)
        for name in forms
        for seed in range(1, QUICK_SEEDS + 1)
    ]
    return [*runs, *_scans()]


def _scans() -> Iterator[Planned]:
    yield from _scan("friction", "fines.friction", ("specimen1", "specimen5"), FRICTIONS)
    for setting in REASONS:
        for seed in range(1, SCAN_SEEDS + 1):
            yield Planned(case="specimen1", group="reason", seed=seed, settings=(setting,))
    for name in ("specimen1", "specimen5", "specimen7"):
        for item in _scan("drag", "drag.multiplier", [QUICK + name], MULTIPLIERS):
            stiffness = read_case(case_path(item.case)).run.stiffness_N_m
            assert isinstance(stiffness, float)
            yield replace(
                item, consequences=(f"run.stiffness_N_m={stiffness * max(1.0, item.value)!r}",)
            )
    for name in (QUICK + "specimen5", QUICK + "specimen6"):
        case = with_fines(read_case(case_path(name)))
        count = invasion_scales(case).supplied_count
        for factor in SUPPLIES:
            setting = f"fines.count={round(factor * count)}"
            for seed in range(1, SCAN_SEEDS + 1):
                consequences = _longer(case, factor)
                yield Planned(
                    case=name,
                    group="supply",
                    seed=seed,
                    settings=(setting,),
                    consequences=consequences,
                    value=factor,
                )


def _longer(case: InvasionCase, factor: float) -> tuple[str, ...]:
    """The cap on the simulated time, moved by the longer arrival of a longer slab."""
    if case.run.cap_s is None:
        return ()
    scales = invasion_scales(case)
    arrival = scales.slab_length / scales.upstream_velocity
    return (f"run.cap_ms={1e3 * (case.run.cap_s + (factor - 1) * arrival):.4g}",)


def _scan(
    group: str, key: str, cases: Sequence[str], values: Sequence[float]
) -> Iterator[Planned]:
    for case in cases:
        for value in values:
            for seed in range(1, SCAN_SEEDS + 1):
                yield Planned(
                    case=case, group=group, seed=seed, settings=(f"{key}={value:g}",), value=value
                )
