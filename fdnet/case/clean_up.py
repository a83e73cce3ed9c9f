"""The table [clean_up] of a case file: the flow is turned back after the invasion."""

from collections.abc import Iterator

from pydantic import Field

from fdnet.case.control import Run
from fdnet.case.fluid import Fluid
from fdnet.case.rule import Rule
from fdnet.case.values import Part, Positive, scaled


class CleanUp(Part):
    """Production after the invasion: the flow is turned back, from the formation to the well.

    Friction, rolling resistance and cohesion are those of the invasion.
    """

    drawdown_MPa: Positive = Field(
        description="Pressure of the formation above that of the well. It is lost on the same way "
        "as the overbalance was, and makes the fluid's velocity by the same law."
    )
    duration_ms: Positive | None = Field(
        None,
        description="Length of the clean-up. It replaces the stop rule and excludes `cap_ms`.",
    )
    quiet_ms: Positive | None = Field(
        None,
        description="The clean-up ends when no fine has come out for this time. When absent: the "
        "time in which the fluid passes the specimen once.",
    )
    cap_ms: Positive | None = Field(
        None,
        description="The clean-up ends at this time at the latest. When absent: twenty times the "
        "time in which the fluid passes the specimen.",
    )

    @property
    def drawdown_Pa(self) -> float:
        """Pressure of the formation above that of the well, Pa."""
        return self.drawdown_MPa * 1e6

    def fluid_of(self, fluid: Fluid) -> Fluid:
        """The fluid with the drawdown for its overbalance."""
        return fluid.model_copy(update={"overbalance_MPa": self.drawdown_MPa})

    def run_of(self, run: Run) -> Run:
        """The control of the invasion with the length of the clean-up."""
        own = dict.fromkeys(("cap_ms", "plug_time_ms", "checkpoint_ms"))
        return run.model_copy(update=own | {"duration_ms": self.duration_ms})

    @property
    def duration_s(self) -> float | None:
        """Length of the clean-up, s; None: until the stop rule holds."""
        return scaled(self.duration_ms, 1e-3)

    @property
    def quiet_s(self) -> float | None:
        """Time without a fine that comes out which ends the clean-up, s, if given."""
        return scaled(self.quiet_ms, 1e-3)

    @property
    def cap_s(self) -> float | None:
        """Time at which the clean-up ends at the latest, s, if given."""
        return scaled(self.cap_ms, 1e-3)


def _known_way(clean_up: CleanUp, fluid: Fluid) -> Iterator[str]:
    if fluid.velocity_m_s is not None:
        yield (
            f"clean_up.drawdown_MPa: {clean_up.drawdown_MPa:g} with fluid.velocity_m_s "
            f"{fluid.velocity_m_s:g}: nothing says on which way the drawdown is lost; give "
            "fluid.overbalance_MPa with the table [well] or with fluid.darcy_length_mm instead of "
            "the velocity"
        )


def _one_end(clean_up: CleanUp) -> Iterator[str]:
    if clean_up.duration_ms is None:
        return
    for name in ("cap_ms", "quiet_ms"):
        if (value := getattr(clean_up, name)) is not None:
            yield (
                f"clean_up.{name}: {value:g} together with clean_up.duration_ms "
                f"{clean_up.duration_ms:g}: give one of the two"
            )


CLEAN_UP_RULES = (
    Rule(("clean_up.drawdown_MPa", "fluid.velocity_m_s"), _known_way),
    Rule(("clean_up.duration_ms", "clean_up.cap_ms", "clean_up.quiet_ms"), _one_end),
)
