"""When a stage ends, from what is known before it and from what its screen says."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

QUIET_SHARE, LEAST_LEFT, GROWTH = 0.3, 0.05, 0.4
"""Part of the plug time without crossings from which the stop rule is expected to hold; least
part of it that is left; and steps that are expected beyond the forecast, over those done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Forecast:
    """What is known of a stage before it, in steps.

    Attributes:
        expected: at which it is expected to end.
        plug: without a crossing of the face, after which it ends; 0 without such a rule.
        cap: at which it ends at the latest; None without such a step.
        allowed: crossings a step that the rule lets pass.
    """

    expected: int
    plug: int = 0
    cap: int | None = None
    allowed: float = 0.0

    def end(self, seen: Sequence[tuple[int, int]]) -> int:
        """The step at which it ends, never one that is past.

        It is the expected one, until the run has passed it. Once the face is quiet, the stop rule
        ends the run; while it is not, the rule holds no earlier than a plug time from now.

        Args:
            seen: step and number of fines that have crossed the face, of each checkpoint.
        """
        step = seen[-1][0]
        quiet = self._quiet(seen)
        if self.plug and quiet >= QUIET_SHARE * self.plug:
            end = step + max(self.plug - quiet, LEAST_LEFT * self.plug)
        else:
            end = max(self.expected, step + max(self.plug, GROWTH * step))
            end = self.expected if not self.plug and step < self.expected else end
        most = math.inf if self.cap is None else self.cap
        return max(step, round(min(most, end)))

    def _quiet(self, seen: Sequence[tuple[int, int]]) -> int:
        """Steps back from now in which no more have crossed than the rule lets pass."""
        step, crossed = seen[-1]
        quiet = 0
        for before, then in reversed(seen[:-1]):
            if crossed - then > self.allowed * (step - before):
                break
            quiet = step - before
        return quiet
