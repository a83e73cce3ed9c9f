"""One thing that is odd about a case."""

from dataclasses import dataclass

from fdnet.scales.check.catalogue import explained


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that is odd.

    Attributes:
        key: of the case that it is about; empty where it is about no single one.
        what: what is odd.
        follows: what follows for the answer.
        do: what to do.
        read: the page that says more.
        refused: whether `fdnet run` refuses the case for it.
    """

    key: str
    what: str
    follows: str
    do: str
    read: str
    refused: bool = False

    @property
    def sentence(self) -> str:
        """As a warning of a summary."""
        if not self.key:
            return explained(self.what)
        return (
            f"{self.key}: {self.what}; what follows: {self.follows}; what to do: {self.do} "
            f"(see {self.read})"
        )
