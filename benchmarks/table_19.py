"""Table 19 of the paper, by the number of vertices."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Printed:
    """A row of table 19: thousands of variables, iterations, C, seconds."""

    figure: str
    variables: int
    iterations: int
    curvature: float
    seconds: float


TABLE = {
    555: Printed("13c", 17, 7, 45.5, 3.8),
    1056: Printed("13a", 33, 14, 124.4, 16.1),
    2118: Printed("21", 66, 17, 143.8, 39.2),
    2166: Printed("15r", 68, 17, 171.6, 45.3),
    2606: Printed("10", 82, 11, 179.3, 32.8),
    2784: Printed("1", 87, 18, 94.3, 58.3),
    4224: Printed("13b", 133, 11, 180.2, 57.4),
    6084: Printed("15l", 193, 8, 36.9, 69.4),
}
