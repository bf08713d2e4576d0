"""The attitude of a vehicle with roll or pitch.

The state of the vehicle is a quaternion (eta, epsilon_1, epsilon_2, epsilon_3), scalar first. The table of terms
contains the rotation matrix R from the body frame to the earth frame instead: R' = R S(omega) is a sum of products.
"""

from itertools import product

from .expression import Expression, Name, call, directed, total, where

Formulas = dict[str, Expression]
QUATERNION = ("eta", "epsilon_1", "epsilon_2", "epsilon_3")
"""The quaternion from the body frame to the earth frame."""
TURN = ("cos_psi", "sin_psi")
"""The heading in the table of terms, where the vehicle neither rolls nor pitches."""
_RATES = {1: "p", 2: "q", 3: "r"}


def entry(row: int, column: int) -> str:
    """Return the name of an entry of the rotation matrix."""
    return f"R_{row}{column}"


ROTATION = tuple(entry(row, column) for row, column in product((1, 2, 3), repeat=2))
"""The entries of the rotation matrix."""


def rotation_terms(velocities: frozenset[str]) -> dict[str, list[tuple[float, tuple[str, str]]]]:
    """Return the terms of R' = R S(omega) for each entry of R: signs and factors."""
    by_entry = {}
    for row, column in product((1, 2, 3), repeat=2):
        following, last = column % 3 + 1, (column + 1) % 3 + 1
        terms = [(1.0, (_RATES[last], entry(row, following))), (-1.0, (_RATES[following], entry(row, last)))]
        by_entry[entry(row, column)] = [term for term in terms if term[1][0] in velocities]
    return by_entry


def rotation_formulas() -> Formulas:
    """Return formulas from the quaternion, which need not have length 1, to the entries of the rotation matrix."""
    e, a, b, c = map(Name, QUATERNION)
    n = Name("square_length")
    return {
        n.identifier: e * e + a * a + b * b + c * c,
        "R_11": (e * e + a * a - b * b - c * c) / n,
        "R_12": 2.0 * (a * b - c * e) / n,
        "R_13": 2.0 * (a * c + b * e) / n,
        "R_21": 2.0 * (a * b + c * e) / n,
        "R_22": (e * e - a * a + b * b - c * c) / n,
        "R_23": 2.0 * (b * c - a * e) / n,
        "R_31": 2.0 * (a * c - b * e) / n,
        "R_32": 2.0 * (b * c + a * e) / n,
        "R_33": (e * e - a * a - b * b + c * c) / n,
    }


INITIAL = {"phi_0": "Roll angle φ", "theta_0": "Pitch angle θ", "psi_0": "Heading ψ"}
"""The Euler angles at the start, from which the quaternion follows."""


def start_formulas() -> Formulas:
    """Return formulas from the Euler angles at the start to the quaternion."""
    half: Formulas = {}
    # cp and sp are the cosine and the sine of half of phi_0; t is for theta_0 and s for psi_0
    for letter, angle in zip("pts", map(Name, INITIAL), strict=True):
        half |= {f"c{letter}": call("cos", 0.5 * angle), f"s{letter}": call("sin", 0.5 * angle)}
    cp, sp, ct, st, cs, ss = map(Name, half)
    return half | {
        "eta": cp * ct * cs + sp * st * ss,
        "epsilon_1": sp * ct * cs - cp * st * ss,
        "epsilon_2": cp * st * cs + sp * ct * ss,
        "epsilon_3": cp * ct * ss - sp * st * cs,
    }


def start_angle_formulas() -> Formulas:
    """Return formulas from the Euler angles at the start to the rotation matrix and to theta.

    Used only to find dependencies: written in the Euler angles, R_31 shows that it does not depend on psi_0. Through
    the quaternion it would seem to depend on all three.
    """
    (cp, ct, cs), (sp, st, ss) = ([call(function, Name(angle)) for angle in INITIAL] for function in ("cos", "sin"))
    return {
        "R_11": cs * ct,
        "R_12": cs * st * sp - ss * cp,
        "R_13": cs * st * cp + ss * sp,
        "R_21": ss * ct,
        "R_22": ss * st * sp + cs * cp,
        "R_23": ss * st * cp - cs * sp,
        "R_31": -st,
        "R_32": ct * sp,
        "R_33": ct * cp,
        "theta": call("atan2", st, abs(ct)),
    }


def quaternion_rates(velocities: frozenset[str]) -> Formulas:
    """Return formulas for the time derivatives of the quaternion."""
    e, a, b, c = QUATERNION
    products = {
        e: ((-1, a, "p"), (-1, b, "q"), (-1, c, "r")),
        a: ((1, e, "p"), (1, b, "r"), (-1, c, "q")),
        b: ((1, e, "q"), (1, c, "p"), (-1, a, "r")),
        c: ((1, e, "r"), (1, a, "q"), (-1, b, "p")),
    }
    rates = {}
    for name, terms in products.items():
        parts = [sign * (Name(factor) * Name(rate)) for sign, factor, rate in terms if rate in velocities]
        rates[name] = 0.5 * total(parts)
    return rates


def quaternion_formulas() -> Formulas:
    """Return formulas from the rotation matrix to the quaternion. Of its two signs, the one nearer to the old is taken.

    The matrix 4 q q^T has the rows below. The quaternion is the row with the largest entry on the diagonal, divided by
    its length (Shepperd, Quaternion from rotation matrix, Journal of Guidance and Control, 1978).
    """
    R = {(i, j): Name(entry(i, j)) for i in (1, 2, 3) for j in (1, 2, 3)}
    formulas: Formulas = {
        "square_0": 1.0 + R[1, 1] + R[2, 2] + R[3, 3],
        "square_1": 1.0 + R[1, 1] - R[2, 2] - R[3, 3],
        "square_2": 1.0 - R[1, 1] + R[2, 2] - R[3, 3],
        "square_3": 1.0 - R[1, 1] - R[2, 2] + R[3, 3],
    }
    square = [*map(Name, formulas)]
    others = {
        (0, 1): R[3, 2] - R[2, 3],
        (0, 2): R[1, 3] - R[3, 1],
        (0, 3): R[2, 1] - R[1, 2],
        (1, 2): R[1, 2] + R[2, 1],
        (1, 3): R[1, 3] + R[3, 1],
        (2, 3): R[2, 3] + R[3, 2],
    }
    is_early, is_late = square[0] >= square[1], square[2] >= square[3]
    formulas["larger_01"] = where(is_early, square[0], square[1])
    formulas["larger_23"] = where(is_late, square[2], square[3])
    for n in range(4):
        row = [square[n] if k == n else others[min(k, n), max(k, n)] for k in range(4)]
        formulas[f"first_{n}"] = where(is_early, row[0], row[1])
        formulas[f"second_{n}"] = where(is_late, row[2], row[3])
        formulas[f"row_{n}"] = where(Name("larger_01") >= Name("larger_23"), Name(f"first_{n}"), Name(f"second_{n}"))
    rows, length = [Name(f"row_{n}") for n in range(4)], Name("length")
    agreement = total(row * Name(name) for row, name in zip(rows, QUATERNION, strict=True))
    formulas["length"] = call("sqrt", total(row * row for row in rows))
    formulas["divisor"] = directed(agreement, length, -length)
    return formulas | {f"next_{name}": row / Name("divisor") for row, name in zip(rows, QUATERNION, strict=True)}


def angle_formulas() -> Formulas:
    """Return formulas for the Euler angles phi, theta and psi (zyx). psi lies between -pi and pi."""
    R_11, R_21, R_31, R_32, R_33 = map(Name, ("R_11", "R_21", "R_31", "R_32", "R_33"))
    return {
        "phi": call("atan2", R_32, R_33),
        "theta": call("atan2", -R_31, call("sqrt", R_32 * R_32 + R_33 * R_33)),
        "psi": call("atan2", R_21, R_11),
    }
