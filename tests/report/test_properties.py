"""The page shows each force and each thrust of a vehicle with its formula."""

import pytest

from rov_fmu.equation.forces import forces_of
from rov_fmu.equation.terms import equation_of
from rov_fmu.report.page.equations import equations_of
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import EVERYTHING, SIX, VEHICLES

ROVS = {
    **VEHICLES,
    "six axes": SIX,
    **{name: load_vehicle(path) for name, path in SHIPPED.items()},
    "everything": load_vehicle(EVERYTHING),
}


@pytest.mark.parametrize("kind", ROVS)
def test_each_force_and_each_thrust_has_a_row(kind: str) -> None:
    layout = ROVS[kind].layout
    rows, equation = [*equations_of(layout)], equation_of(layout)
    forces = [*forces_of(layout, equation.names)]
    assert [what for _, what, _ in rows][: len(forces)] == [force.effect.words for force in forces]
    assert {*equation.thrust} <= {name for name, _, _ in rows}
    assert all(formula and "Operation" not in formula for *_, formula in rows)


def test_the_equation_of_the_paper() -> None:
    rows = {(name, what): formula for name, what, formula in equations_of(ROVS["videoray"].layout)}
    assert rows["surge", "the thrust"] == "alpha_u (F_l + F_r)"
    assert rows["surge", "quadratic drag"] == "−a_d_u |u| u"
    assert rows["x'", "pose"] == "constant_x + u cos_psi"
