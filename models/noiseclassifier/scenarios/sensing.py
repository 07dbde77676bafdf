"""The sensors of a simulated robot, and their slices in the vector of all sensors."""

from collections.abc import Sequence
from typing import Any

import mujoco

from noiseclassifier.scenarios.shapes import Effector, Sole

BASE_SENSORS = {
    "base.place": "FRAMEPOS",
    "base.turn": "FRAMEQUAT",
    "base.velocity": "FRAMELINVEL",
    "base.spin": "FRAMEANGVEL",
    "centre.place": "SUBTREECOM",
    "centre.velocity": "SUBTREELINVEL",
}
"""Sensors of the floating base and of the centre of mass, in the world's axes: positions
in [m], the quaternion (w, x, y, z), velocities in [m/s], the angular velocity in [rad/s]."""


def add_sensors(spec: Any, effectors: Sequence[Effector], root: str | None) -> None:
    """Add the sensors that `sensors_of` describes, the contact forces of the effectors first."""
    for effector in effectors:
        _add(spec, f"{effector.frame}.touch", "TOUCH", "SITE", effector.frame)
    for effector in effectors:
        if isinstance(effector, Sole):
            _add(spec, f"{effector.frame}.force", "FORCE", "SITE", effector.frame)
            _add(spec, f"{effector.frame}.torque", "TORQUE", "SITE", effector.frame)
    if root is None:
        return
    for effector in effectors:
        _add(spec, f"{effector.frame}.place", "FRAMEPOS", "SITE", effector.frame)
    for name, kind in BASE_SENSORS.items():
        _add(spec, name, kind, "BODY" if "centre" in name else "XBODY", root)


def sensors_of(model: Any) -> dict[str, slice]:
    """Slices of the sensors of a model from `noiseclassifier.scenarios.mujoco_model.build`.

    Returns:
        Slice of each sensor in the vector of all, by name: ``<frame>.touch`` of each effector, its
        contact force in [N]; ``<frame>.force`` and ``<frame>.torque`` of each sole, the load of the
        sole in [N] and [N m], in the sole's axes, with MuJoCo's sign: negate them for the force of
        the ground on the foot. Floating robots have
        ``<frame>.place`` of each effector in [m], and those of ``BASE_SENSORS``.
    """
    return {
        model.sensor(number).name: slice(
            int(model.sensor_adr[number]), int(model.sensor_adr[number] + model.sensor_dim[number])
        )
        for number in range(model.nsensor)
    }


def _add(spec: Any, name: str, kind: str, sort: str, place: str) -> None:
    spec.add_sensor(
        name=name,
        type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"),
        objtype=getattr(mujoco.mjtObj, f"mjOBJ_{sort}"),
        objname=place,
    )
