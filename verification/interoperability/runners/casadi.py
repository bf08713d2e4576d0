"""CasADi, Model Exchange: DaeBuilder makes functions of the FMU, and CVODES integrates each step."""

from math import tau
from zipfile import ZipFile

import casadi as ca

from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, fly, parameters

ZipFile(FMU).extractall("unzipped")
rov = ca.DaeBuilder("rov", "unzipped", {})
for name, value in parameters().items():
    rov.set(name, value)
model = rov.create("model", ["x", "u"], ["ode", "y"])
x, u = ca.MX.sym("x", rov.nx()), ca.MX.sym("u", rov.nu())
dae = {"x": x, "u": u, "ode": model(x, u)[0]}
integrate = ca.integrator("advance", "cvodes", dae, 0.0, 0.1, {"reltol": 1e-9, "abstol": 1e-10})
now = {"x": ca.DM(rov.start(rov.x())), "u": ca.DM(rov.start(rov.u()))}
heading = [0.0]


def advance(step: Step) -> None:
    now["u"] = ca.DM([step.inputs[name] for name in rov.u()])
    now["x"] = integrate(x0=now["x"], u=now["u"])["xf"]


def outputs() -> list[float]:
    values = dict(zip(rov.y(), model(now["x"], now["u"])[1].full().ravel().tolist(), strict=True))
    # CasADi evaluates the FMU as a function. The heading of a vehicle with an attitude then does not count turns.
    values["psi"] += tau * round((heading[-1] - values["psi"]) / tau)
    heading.append(values["psi"])
    return [values[name] for name in OUTPUTS]


fly(advance, outputs)
