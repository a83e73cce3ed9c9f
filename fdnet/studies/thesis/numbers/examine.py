"""One specimen of the thesis, examined under both pairs of laws: what tables, statistics and figures are made of."""

from collections.abc import Mapping
from dataclasses import dataclass

from fdnet.network.analysis import Analysis
from fdnet.network.laws.named import DEFAULT_DAMAGE_LAW, DEFAULT_LAW
from fdnet.network.permeability import compare
from fdnet.studies.thesis.runs.state import State

THESIS_PAIR, DEFAULT_PAIR = ("thesis", "thesis"), (DEFAULT_LAW, DEFAULT_DAMAGE_LAW)
"""(law, damage law): the thesis's own, with the threshold 0.40 of its text, and fdnet's most accurate."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Examined:
    """`id` names the run ("specimen5", "specimen5 friction=0"); `analyses` by pair of laws."""

    id: str
    seed: int
    state: State
    analyses: Mapping[tuple[str, str], Analysis]

    @property
    def thesis(self) -> Analysis:
        """By the thesis's laws."""
        return self.analyses[THESIS_PAIR]

    @property
    def default(self) -> Analysis:
        """By fdnet's default laws."""
        return self.analyses[DEFAULT_PAIR]


def examine(name: str, state: State) -> Examined:
    """The state's permeability, porosity and fines under both pairs of laws; sections and bins as its case asks.

    Raises NetworkError on degenerate geometry, FlowError on a solve that fails its checks.
    """
    options = state.case.analysis
    pairs = (THESIS_PAIR, DEFAULT_PAIR)
    found = compare(
        state.grains, state.damaged, periodic=state.case.periodic, options=options, laws=pairs
    )
    return Examined(
        id=name, seed=state.case.seed, state=state, analyses=dict(zip(pairs, found, strict=True))
    )
