"""One row for each case: its truth, and model over truth of every law."""

from typing import Any
from unittest.mock import patch

import numpy as np

from fdnet.network.laws.named import LAWS
from fdnet.network.network import Network
from fdnet.network.tessellation import delaunay
from fdnet.studies.accuracy.measurement import (
    LOCAL,
    PAIRS,
    RESOLVED,
    by_law,
    measure_loss,
    network_of,
)
from fdnet.studies.truth.cases import UNEQUAL, Case

Row = dict[str, Any]
RULES = (*PAIRS, LOCAL, RESOLVED)
"""What is compared on packs with fines."""


def intact_row(case: Case) -> Row:
    """k, model over truth, of each law on a pack without fines."""
    return head(case) | _ratios(case, network_of(case.pack))


def damaged_row(case: Case) -> Row:
    """k/k0 and k, model over truth, of each of `RULES` on a pack with fines."""
    assert case.ratio is not None
    loss = measure_loss(case.pack, network_of(case.pack))
    row = head(case) | {"k_over_k0": case.ratio}
    for name in RULES:
        row |= {name: loss.ratio(name) / case.ratio, f"{name}: k": loss.damaged[name] / case.k}
    return row


def polydisperse_rows(cases: list[Case]) -> list[Row]:
    """Intact packs of unequal grains in the power tessellation, and in Delaunay's in its place."""
    rows = []
    for case in cases:
        if case.group != UNEQUAL or case.ratio is not None:
            continue
        for tessellation, spread in (("power", delaunay.EQUAL_SPREAD), ("Delaunay", np.inf)):
            with patch.object(delaunay, "EQUAL_SPREAD", spread):
                network = network_of(case.pack)
            row = head(case) | {"tessellation": tessellation, "pores": len(network.pore_volume)}
            row |= _ratios(case, network)
            rows.append(row | {"void_negative": network.counts["void_negative"]})
    return rows


def head(case: Case) -> Row:
    """What is known of a case."""
    return {
        "case": case.name,
        "group": case.group,
        "grains": len(case.pack.grains()),
        "fines": len(case.pack.fines()),
        "k_true_m2": case.k,
        "truth_error": case.error,
        "known_before": case.known_before,
    }


def _ratios(case: Case, network: Network) -> Row:
    return {law: by_law(network, law) / case.k for law in LAWS}
