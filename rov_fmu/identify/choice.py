"""What a model may have beside its plain form, and whether the data ask for it: AICc, leave-one-out."""

from dataclasses import dataclass
from math import inf, log

MARGIN = 2.0
"""By which a form must be better in AICc than one with fewer coefficients: less is no evidence (Burnham, Anderson)."""


@dataclass(frozen=True)
class Choice:
    """Something that a curve or an axis may have, and whether it earned its place."""

    what: str
    kept: bool
    gain: float
    """AICc without it less AICc with it: above 0 speaks for it; infinite where the data are too few for one."""
    errors: tuple[float, float]
    """Leave-one-thrust-out, without it and with it; NaN where too few are left."""

    @property
    def words(self) -> str:
        """In a sentence, without the full stop."""
        verdict = "earns its place" if self.kept else "does not earn its place and is left out"
        without, with_it = self.errors
        return (
            f"{self.what} {verdict}: AICc {'less' if self.gain >= 0.0 else 'more'} by {abs(self.gain):.3g} with it, "
            f"leave-one-thrust-out error {with_it:.3g} with it and {without:.3g} without"
        )


def aicc(rss: float, count: int, free: int, least: float) -> float:
    """Akaike's information criterion for few data, of least squares with so many free coefficients.

    `least` is an RMS that residuals cannot go below, the last digit of what is measured. Infinite for too few data.
    """
    k, variance = free + 1, max(rss / count, least**2)
    return count * log(variance) + 2.0 * k + 2.0 * k * (k + 1) / (count - k - 1) if count > k + 1 else inf
