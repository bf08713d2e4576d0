"""CasADi, Model Exchange: DaeBuilder makes functions of the FMU, CVODES integrates them from jump to jump."""

from zipfile import ZipFile

import casadi as ca

from interop.runners.flight import FMU, OUTPUTS, parameters, steps, write


def main() -> None:
    """Fly the manoeuvre."""
    ZipFile(FMU).extractall("unzipped")
    rov = ca.DaeBuilder("rov", "unzipped", {})
    for name, value in parameters().items():
        rov.set(name, value)
    model = rov.create("model", ["x", "u"], ["ode", "y"])
    x, u = ca.MX.sym("x", rov.nx()), ca.MX.sym("u", rov.nu())
    dae = {"x": x, "u": u, "ode": model(x, u)[0]}
    advance = ca.integrator("advance", "cvodes", dae, 0.0, 0.1, {"reltol": 1e-9, "abstol": 1e-10})
    state, held = ca.DM.zeros(rov.nx()), ca.DM.zeros(rov.nu())

    def outputs(time: float) -> dict[str, float]:
        values = dict(zip(rov.y(), model(state, held)[1].full().ravel().tolist(), strict=True))
        return {"time": time, **{name: values[name] for name in OUTPUTS}}

    result = [outputs(0.0)]
    for step in steps():
        held = ca.DM([step.inputs[name] for name in rov.u()])
        state = advance(x0=state, u=held)["xf"]
        result.append(outputs(step.end))
    write(result)


if __name__ == "__main__":
    main()
