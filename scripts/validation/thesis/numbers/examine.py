"""The state of one run, analysed under both pairs of laws.

Tables, statistics and figures are made from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from fdnet.names import AUTO, DEFAULT_LAW
from fdnet.network.permeability import Analysis, compare
from validation.thesis.runs.state import State

THESIS_PAIR, DEFAULT_PAIR = ("thesis", "thesis"), (DEFAULT_LAW, AUTO)
"""Pairs (law, damage law).

The thesis's own pair has the threshold 0.40 of its text; fdnet's default takes its most
accurate law that the size of the specimen allows.
"""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Examined:
    """One run and its analyses.

    Attributes:
        id: name of the run, such as "specimen5" or "specimen5 fines.friction=0".
        seed: seed of the run.
        state: the spheres at the end of the run.
        analyses: porosity, permeability and fines by pair of laws.
    """

    id: str
    seed: int
    state: State
    analyses: Mapping[tuple[str, str], Analysis]

    @property
    def thesis(self) -> Analysis:
        """The analysis by the thesis's laws."""
        return self.analyses[THESIS_PAIR]

    @property
    def default(self) -> Analysis:
        """The analysis by fdnet's default laws."""
        return self.analyses[DEFAULT_PAIR]


def examine(name: str, state: State) -> Examined:
    """Analyse the state under both pairs of laws, with the sections and bins of its case.

    Raises NetworkError on degenerate geometry, FlowError on a solve that fails its checks.
    """
    options = state.case.analysis
    pairs = (THESIS_PAIR, DEFAULT_PAIR)
    analyses = compare(
        state.grains, state.damaged, periodic=state.case.periodic, options=options, laws=pairs
    )
    return Examined(
        id=name,
        seed=state.case.seed,
        state=state,
        analyses=dict(zip(pairs, analyses, strict=True)),
    )
