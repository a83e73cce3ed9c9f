"""One check of some keys of a case against each other."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Rule:
    """A check of some keys against each other.

    Attributes:
        keys: dotted keys that the check reads.
        check: yields what is wrong; it is given the tables of `keys`, each once, in order.
    """

    keys: tuple[str, ...]
    check: Callable[..., Iterator[str]]

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables that the check is given."""
        return tuple(dict.fromkeys(key.split(".")[0] for key in self.keys))
