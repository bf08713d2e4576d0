"""The attitude of a vehicle with roll or pitch.

The state of the vehicle is a quaternion (eta, epsilon_1, epsilon_2, epsilon_3), scalar first. The table of terms
contains the rotation matrix R from the body frame to the earth frame instead: R' = R S(omega) is a sum of products.
"""

from collections.abc import Mapping, Sequence
from math import atan2, isfinite, nan, tau

from .formula import joined

QUATERNION = ("eta", "epsilon_1", "epsilon_2", "epsilon_3")
"""The quaternion from the body frame to the earth frame."""
_RATES = {1: "p", 2: "q", 3: "r"}


def entry(row: int, column: int) -> str:
    """Return the name of an entry of the rotation matrix."""
    return f"R_{row}{column}"


def rotation_terms(row: int, velocities: frozenset[str]) -> dict[str, list[tuple[str, tuple[str, str]]]]:
    """Return the terms of R' = R S(omega) for the entries of a row: signs and factors."""
    found = {}
    for column in (1, 2, 3):
        following, last = column % 3 + 1, (column + 1) % 3 + 1
        terms = [("1", (_RATES[last], entry(row, following))), ("-1", (_RATES[following], entry(row, last)))]
        found[entry(row, column)] = [term for term in terms if term[1][0] in velocities]
    return found


def unwrapped(angle: float, near: float) -> float:
    """Return the angle that differs from an angle by whole turns and is the nearest to another one."""
    turns = (near - angle) / tau
    return angle + tau * round(turns) if isfinite(turns) else nan


BESIDE_NOSE = (1.0, 1e-6, 0.618e-6)
"""A direction in the body frame just beside the nose, for which turns are counted, as in fmu_src/c/heading.c.

The heading of the nose jumps by half a turn where the nose passes the vertical, and rounding would choose the side.
"""


def beside_nose(values: Mapping[str, float], rows: Sequence[int] = (1, 2)) -> list[float]:
    """Return components of the direction beside the nose, by default north and east, for a rotation matrix."""
    a, b, c = BESIDE_NOSE
    return [a * values[f"R_{row}1"] + (b * values[f"R_{row}2"] + c * values[f"R_{row}3"]) for row in rows]


def turned_heading(values: Mapping[str, float], near: float) -> float:
    """Return the heading of the direction beside the nose that differs from another heading by at most half a turn."""
    north, east = beside_nose(values)
    return unwrapped(atan2(east, north), near)


def unwrapped_heading(psi: float, values: Mapping[str, float], near: float) -> float:
    """Return the heading psi of the nose, without its turns, in the turn that follows from a heading before."""
    return unwrapped(psi, turned_heading(values, near))


def rotation_formulas() -> dict[str, str]:
    """Return formulas from the quaternion, which need not have length 1, to the entries of the rotation matrix."""
    e, a, b, c = QUATERNION
    n = "square_length"
    return {
        n: " + ".join(f"{name} * {name}" for name in QUATERNION),
        "R_11": f"({e} * {e} + {a} * {a} - {b} * {b} - {c} * {c}) / {n}",
        "R_12": f"2 * ({a} * {b} - {c} * {e}) / {n}",
        "R_13": f"2 * ({a} * {c} + {b} * {e}) / {n}",
        "R_21": f"2 * ({a} * {b} + {c} * {e}) / {n}",
        "R_22": f"({e} * {e} - {a} * {a} + {b} * {b} - {c} * {c}) / {n}",
        "R_23": f"2 * ({b} * {c} - {a} * {e}) / {n}",
        "R_31": f"2 * ({a} * {c} - {b} * {e}) / {n}",
        "R_32": f"2 * ({b} * {c} + {a} * {e}) / {n}",
        "R_33": f"({e} * {e} - {a} * {a} - {b} * {b} + {c} * {c}) / {n}",
    }


INITIAL = {"phi_0": "Roll angle φ", "theta_0": "Pitch angle θ", "psi_0": "Heading ψ"}
"""The Euler angles at the start, from which the quaternion follows."""


def start_formulas() -> dict[str, str]:
    """Return formulas from the Euler angles at the start to the quaternion."""
    half: dict[str, str] = {}
    # cp and sp are the cosine and the sine of half of phi_0; t is for theta_0 and s for psi_0
    for letter, angle in zip("pts", INITIAL, strict=True):
        half |= {f"c{letter}": f"cos(0.5 * {angle})", f"s{letter}": f"sin(0.5 * {angle})"}
    return half | {
        "eta": "cp * ct * cs + sp * st * ss",
        "epsilon_1": "sp * ct * cs - cp * st * ss",
        "epsilon_2": "cp * st * cs + sp * ct * ss",
        "epsilon_3": "cp * ct * ss - sp * st * cs",
    }


def start_angle_formulas() -> dict[str, str]:
    """Return formulas from the Euler angles at the start to the rotation matrix and to theta.

    The formulas by way of the quaternion give the same numbers, but their names do not tell which angle matters.
    """
    (cp, ct, cs), (sp, st, ss) = ([f"{function}({angle})" for angle in INITIAL] for function in ("cos", "sin"))
    return {
        "R_11": f"{cs} * {ct}",
        "R_12": f"{cs} * {st} * {sp} - {ss} * {cp}",
        "R_13": f"{cs} * {st} * {cp} + {ss} * {sp}",
        "R_21": f"{ss} * {ct}",
        "R_22": f"{ss} * {st} * {sp} + {cs} * {cp}",
        "R_23": f"{ss} * {st} * {cp} - {cs} * {sp}",
        "R_31": f"-{st}",
        "R_32": f"{ct} * {sp}",
        "R_33": f"{ct} * {cp}",
        "theta": f"atan2({st}, abs({ct}))",
    }


def quaternion_rates(velocities: frozenset[str]) -> dict[str, str]:
    """Return formulas for the time derivatives of the quaternion."""
    e, a, b, c = QUATERNION
    products = {
        e: (("-", a, "p"), ("-", b, "q"), ("-", c, "r")),
        a: (("", e, "p"), ("", b, "r"), ("-", c, "q")),
        b: (("", e, "q"), ("", c, "p"), ("-", a, "r")),
        c: (("", e, "r"), ("", a, "q"), ("-", b, "p")),
    }
    found = {}
    for name, terms in products.items():
        parts = [f"{sign}{factor} * {rate}" for sign, factor, rate in terms if rate in velocities]
        found[name] = f"0.5 * ({joined(parts)})" if parts else "0"
    return found


def quaternion_formulas() -> dict[str, str]:
    """Return formulas from the rotation matrix to the quaternion. Of its two signs, the one nearer to the old is taken.

    The matrix 4 q q^T has the rows below. The quaternion is the row with the largest entry on the diagonal, divided by
    its length (Shepperd, Quaternion from rotation matrix, Journal of Guidance and Control, 1978).
    """
    diagonal = (
        "1 + R_11 + R_22 + R_33",
        "1 + R_11 - R_22 - R_33",
        "1 - R_11 + R_22 - R_33",
        "1 - R_11 - R_22 + R_33",
    )
    found = {f"square_{n}": formula for n, formula in enumerate(diagonal)}
    others = {
        (0, 1): "R_32 - R_23",
        (0, 2): "R_13 - R_31",
        (0, 3): "R_21 - R_12",
        (1, 2): "R_12 + R_21",
        (1, 3): "R_13 + R_31",
        (2, 3): "R_23 + R_32",
    }
    found["larger_01"] = "square_0 if square_0 >= square_1 else square_1"
    found["larger_23"] = "square_2 if square_2 >= square_3 else square_3"
    for n in range(4):
        row = [f"square_{n}" if k == n else f"({others[min(k, n), max(k, n)]})" for k in range(4)]
        found[f"first_{n}"] = f"{row[0]} if square_0 >= square_1 else {row[1]}"
        found[f"second_{n}"] = f"{row[2]} if square_2 >= square_3 else {row[3]}"
        found[f"row_{n}"] = f"first_{n} if larger_01 >= larger_23 else second_{n}"
    agreement = " + ".join(f"row_{n} * {name}" for n, name in enumerate(QUATERNION))
    found["length"] = "sqrt(" + " + ".join(f"row_{n} * row_{n}" for n in range(4)) + ")"
    found["divisor"] = f"-length if {agreement} < 0 else length"
    return found | {f"next_{name}": f"row_{n} / divisor" for n, name in enumerate(QUATERNION)}


def angle_formulas() -> dict[str, str]:
    """Return formulas for the Euler angles phi, theta and psi (zyx). psi lies between -pi and pi."""
    return {
        "phi": "atan2(R_32, R_33)",
        "theta": "atan2(-R_31, sqrt(R_32 * R_32 + R_33 * R_33))",
        "psi": "atan2(R_21, R_11)",
    }
