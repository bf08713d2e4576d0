"""Decide whether the data justify an extension of the plain model: AICc and leave-one-out."""

from dataclasses import dataclass
from math import inf, log

MARGIN = 2.0
"""The difference in AICc that justifies more coefficients; less is no evidence (Burnham, Anderson)."""


@dataclass(frozen=True)
class Choice:
    """An optional extension of a curve or an axis, and whether the data justify it."""

    what: str
    kept: bool
    gain: float
    """AICc without the extension less AICc with it; positive values favour it. Infinite for too few data."""
    errors: tuple[float, float]
    """Leave-one-thrust-out errors without and with the extension; NaN where too few data remain."""

    @property
    def words(self) -> str:
        """A sentence about the choice, without the full stop."""
        verdict = "earns its place" if self.kept else "does not earn its place and is left out"
        without, with_it = self.errors
        return (
            f"{self.what} {verdict}: AICc {'less' if self.gain >= 0.0 else 'more'} by {abs(self.gain):.3g} with it, "
            f"leave-one-thrust-out error {with_it:.3g} with it and {without:.3g} without"
        )


def aicc(rss: float, count: int, free: int, least: float) -> float:
    """Return Akaike's information criterion for few data, of a least-squares fit with `free` coefficients.

    `least` is the smallest meaningful RMS of the residuals, given by the last digit of the data. The result is infinite
    if there are too few data.
    """
    k, variance = free + 1, max(rss / count, least**2)
    return count * log(variance) + 2.0 * k + 2.0 * k * (k + 1) / (count - k - 1) if count > k + 1 else inf
