"""What several tests of the network share."""

from dataclasses import replace

import pytest

from fdnet.network.resolved import measured


@pytest.fixture(scope="module")
def by_the_network_alone():
    """No section is small enough for resolved flow, which has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("WITHOUT_FINES", "WITH_FINES"):
            patch.setattr(measured, name, replace(getattr(measured, name), most_cells=0))
        yield
