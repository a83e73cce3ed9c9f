"""A mean and its 95 % band."""

from dataclasses import dataclass

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A mean and its 95 % band.

    Attributes:
        mean: the mean.
        low: lower end of the band; nan where the spread is not known.
        high: upper end of the band; nan where the spread is not known.
        cut: bounds of the quantity at which the band was cut.
    """

    mean: float
    low: float
    high: float
    cut: tuple[float, ...] = ()

    @property
    def half_width(self) -> float:
        """Half of the band."""
        return (self.high - self.low) / 2

    def within(self, least: float, most: float) -> "Band":
        """The band without values that the quantity cannot take: below `least`, above `most`.

        It covers the true mean as often as the whole band does, because the mean cannot lie in
        what is cut off.
        """
        beyond = ((least, self.low < least), (most, self.high > most))
        return Band(
            mean=self.mean,
            low=least if self.low < least else self.low,
            high=most if self.high > most else self.high,
            cut=tuple(bound for bound, is_beyond in beyond if is_beyond),
        )

    def less(self, value: float) -> "Band":
        """The band of the mean less a known value."""
        return Band(mean=self.mean - value, low=self.low - value, high=self.high - value)
