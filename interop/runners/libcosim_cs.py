"""libcosim, Co-Simulation: one slave, its inputs overridden by a manipulator."""

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from interop.runners.flight import FMU, OUTPUTS, parameters, steps, write


def main() -> None:
    """Fly the manoeuvre."""
    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_step_size(100_000_000)  # ns
    slave = CosimLocalSlave(fmu_path=FMU, instance_name="rov")  # to be kept as long as the execution
    rov = execution.add_local_slave(slave)
    reference = {variable.name.decode(): variable.reference for variable in execution.slave_variables(rov)}
    for name, value in parameters().items():
        if not execution.real_initial_value(rov, reference[name], value):
            raise RuntimeError(f"{name} was refused")
    fly(execution, rov)


def fly(execution: CosimExecution, rov: int) -> None:
    """Step a system with a ROV in it, and write what the ROV does."""
    reference = {variable.name.decode(): variable.reference for variable in execution.slave_variables(rov)}
    commands, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(commands)
    execution.add_observer(observer)

    def outputs(time: float) -> dict[str, float]:
        values = observer.last_real_values(rov, [reference[name] for name in OUTPUTS])
        return {"time": time, **dict(zip(OUTPUTS, values, strict=True))}

    result = [outputs(0.0)]
    for step in steps():
        commands.slave_real_values(rov, [reference[name] for name in step.inputs], list(step.inputs.values()))
        if not execution.step():
            raise RuntimeError(f"the step to {step.end} s failed")
        result.append(outputs(step.end))
    write(result)


if __name__ == "__main__":
    main()
