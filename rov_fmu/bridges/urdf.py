"""Write the hydrodynamics of a vehicle as URDF, in the tags that controllers and simulators of ROS 2 read.

The element <hydrodynamics> has the tags of Robotic-Decision-Making-Lab/hydrodynamics (3c4db4e), the library by which
auv_controllers parse a robot description: Fossen's frame (forward, starboard, down) and signs, so that Xdu is -m_a and
Xu is -b_d. The element <gazebo> has those of the Hydrodynamics plugin of gz-sim, which bluerov2_gz uses, in Gazebo's
frame (forward, left, up). A matrix of six axes has only its diagonal in the first.
"""

from collections.abc import Iterator

from rov_fmu.bridges import sdf
from rov_fmu.equation.catalogue import AXES, BODY, BY_VELOCITY, REVERSE
from rov_fmu.equation.forces import DEAD_TIME, LAG, ROTOR_LAG, left_out
from rov_fmu.vehicle.vehicle import Vehicle


def urdf_model(vehicle: Vehicle) -> sdf.GazeboModel:
    """Return the robot description of a vehicle. Raises InputError about a vehicle without a mass or with β = 0."""
    sdf.check_possible(vehicle)
    link = sdf.link_of(vehicle)
    added = sdf.added_mass(vehicle, link.matrix)
    axes, own = vehicle.layout.by_velocity, vehicle.coefficients
    weight = vehicle["m_rov"] * sdf.gravity(vehicle)
    largest = max((own[name] for name in BODY if name != "m_rov" and name in own), default=float(link.inertia[0, 0]))
    moments = {
        f"i{2 * 'xyz'[axis.place]}": own.get(axis.inertia, largest) for axis in AXES.values() if axis.is_rotation
    }

    def drag(v: str, key: str) -> float:
        """Return the drag of an axis with Fossen's sign: the mean of both directions, 0 of an axis that is absent."""
        return -0.5 * sum(sdf.both_ways(vehicle, axes[v], key)) if v in axes else 0.0

    notes = tuple(_notes(vehicle))
    text = sdf.rendered_model(
        "model.urdf.j2",
        vehicle,
        notes,
        link=link,
        weight=weight,
        buoyancy=weight - sdf.net_weight(vehicle),
        moments=moments,
        letters={v: axis.letter for v, axis in BY_VELOCITY.items()},
        axes=axes,
        added=added,
        drag=drag,
        plugin=sdf.hydrodynamics(vehicle, link) | dict(sdf.in_plugin(added)),
    )
    return sdf.GazeboModel(text, notes, ())


_IN_URDF = (*sdf.BESIDE_THRUST, DEAD_TIME, LAG, ROTOR_LAG)
"""The effects that the reader of the file has, and those that are left to the controller of the thrusters."""


def _notes(vehicle: Vehicle) -> Iterator[str]:
    """Yield what <hydrodynamics> does otherwise than the vehicle file."""
    layout = vehicle.layout
    yield "the tags have no thrusters: their curves, places, lags and alpha are left to the controller"
    yield from (f"left out: {words}" for words in left_out(layout, _IN_URDF))
    if any(vehicle[part.axis.coefficient("beta")] != 1.0 for part in layout.axes):
        yield "beta: the added mass is that of the effective inertia, (m + m_a) / beta less the mass"
    if missing := layout.lacking:
        yield f"the vehicle file has no {', '.join(missing)}: no added mass and no drag there"
    if any(key.endswith(REVERSE) for part in layout.axes for key in part.keys):
        yield "drag has the mean of both directions"
    if layout.cross or any(vehicle.coefficients.get(f"{axis}_G") for axis in "xyz"):
        yield "left out: terms between two axes"
