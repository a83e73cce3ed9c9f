"""What several tests of the network share."""

import pytest

from fdnet.network.resolved import intact


@pytest.fixture(scope="module")
def by_the_network_alone():
    """No section is small enough for resolved flow, which has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(intact, "MOST_CELLS", 0)
        yield
