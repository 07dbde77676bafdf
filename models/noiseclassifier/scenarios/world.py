"""MuJoCo models made from Pinocchio models, and inverse kinematics of whole robots."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from scipy.linalg import solve_banded

from noiseclassifier.scenarios.faults import Imperfections
from noiseclassifier.scenarios.motions import STEP, TICK, Box, Effector, Sole
from noiseclassifier.scenarios.robots import Simulated
from noisemodel import Robot
from noisemodel.robot import Joint, table_of
from noisemodel.types import Array

GRAVITY = 9.81  # in [m/s²]


def reduced_model(robot: Simulated) -> Any:
    """Pinocchio model of a robot, with all joints but its drives locked."""
    model = Robot.load(robot.name).model
    posture = pin.neutral(model)
    for joint, position in robot.held.items():
        posture[model.joints[model.getJointId(joint)].idx_q] = position
    fixed = [
        model.getJointId(joint)
        for joint in model.names[1:]
        if joint not in robot.drives.joints and model.joints[model.getJointId(joint)].nv == 1
    ]
    # Pinocchio refuses two frames of one name, as in anymal_c, and a joint and a body of one name.
    try:
        reduced = pin.buildReducedModel(model, fixed, posture)
    except ValueError:
        if fixed:
            raise
        reduced = model
    return reduced if robot.length_scale == 1.0 else _scaled(reduced, robot.length_scale)


def configuration(model: Any, joints: Array) -> Array:
    """Pinocchio's configuration of a robot with a fixed base."""
    if model.nq == model.nv:
        return joints
    return np.asarray(pin.integrate(model, pin.neutral(model), joints))


def _scaled(model: Any, scale: float) -> Any:
    """A copy of a model with all lengths scaled, its masses unchanged."""

    def moved(placement: Any) -> Any:
        return pin.SE3(placement.rotation, scale * placement.translation)

    scaled = model.copy()
    for index in range(1, model.njoints):
        scaled.jointPlacements[index] = moved(model.jointPlacements[index])
        given = model.inertias[index]
        scaled.inertias[index] = pin.Inertia(
            given.mass, scale * given.lever, scale**2 * given.inertia
        )
    for index in range(model.nframes):
        scaled.frames[index].placement = moved(model.frames[index].placement)
    return scaled


TYPES = {
    "revolute": mujoco.mjtJoint.mjJNT_HINGE,
    "continuous": mujoco.mjtJoint.mjJNT_HINGE,
    "prismatic": mujoco.mjtJoint.mjJNT_SLIDE,
}
ROBOT, WORLD = 1, 2  # contact groups: the robot collides with the world, never with itself
GRIP = 0.8  # coefficient of friction


def build(
    model: Any,
    *,
    armature: Array,
    damping: Array,
    friction: Array,
    contact: float = 0.005,
    effectors: Sequence[Effector] = (),
    boxes: Sequence[Box] = (),
) -> Any:
    """MuJoCo model with one torque actuator per joint, and sensors."""
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10  # firm friction: tools do not creep
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # divergence must show
    spec.compiler.degree = False
    joints = table_of(model)
    bodies = _add_bodies(spec, model, joints, armature, damping, friction)
    surface = {"friction": [GRIP, 0.01, 0.001], "solref": [contact, 1.0]}
    for effector in effectors:
        _add_effector(bodies, model, effector, surface)
    _add_sensors(spec, effectors, joints[0].name if joints[0].kind == "floating" else None)
    for number, box in enumerate(boxes):
        spec.worldbody.add_geom(
            name=_box(number),
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=box.centre,
            size=box.half,
            quat=[np.cos(box.yaw / 2), 0, 0, np.sin(box.yaw / 2)],
            contype=WORLD,
            conaffinity=ROBOT,
            **surface,
        )
    return spec.compile()


def _add_bodies(
    spec: Any, model: Any, joints: Sequence[Joint], armature: Array, damping: Array, friction: Array
) -> list[Any]:
    """Add all bodies with their joints and drives; the world comes first."""
    bodies = [spec.worldbody]
    driven = 0
    for index, joint in enumerate(joints, start=1):
        placement, inertia = model.jointPlacements[index], model.inertias[index]
        tensor = inertia.inertia
        body = bodies[joint.parent].add_body(
            name=joint.name,
            pos=placement.translation,
            quat=_quaternion(placement.rotation),
            mass=inertia.mass,
            ipos=inertia.lever,
            fullinertia=[tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
            explicitinertial=True,
        )
        bodies.append(body)
        if joint.kind == "floating":
            body.add_freejoint(name=joint.name)
            continue
        body.add_joint(
            name=joint.name,
            type=TYPES[joint.kind],
            axis=(np.eye(3) if joint.turn is None else joint.turn)[joint.axis],
            armature=armature[driven],
            damping=[damping[driven], 0, 0],
            frictionloss=friction[driven],
        )
        spec.add_actuator(
            name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        ).set_to_motor()
        driven += 1
    return bodies


def _add_effector(
    bodies: Sequence[Any], model: Any, effector: Effector, surface: dict[str, Any]
) -> None:
    """Add the geom of an effector, and a site that encloses all of its contacts."""
    frame = model.frames[model.getFrameId(effector.frame)]
    geoms, middle = mujoco.mjtGeom, np.zeros(3)
    around, enclosing, further = geoms.mjGEOM_SPHERE, [], {}
    if isinstance(effector, Sole):
        half = effector.thickness / 2
        geom, size = geoms.mjGEOM_BOX, [*effector.patch, half]
        middle = np.add(effector.point, (0, 0, half))
        around = geoms.mjGEOM_BOX
        enclosing = [*(1.2 * extent for extent in effector.patch), effector.thickness]
    elif effector.length:  # MuJoCo leaves the round ends out of a capsule's length
        half = effector.length / 2
        geom, size = geoms.mjGEOM_CAPSULE, [effector.radius, half - effector.radius, 0.0]
        middle, enclosing = np.array([0, 0, half]), [2.5 * effector.radius] * 3
    else:
        geom, size = geoms.mjGEOM_SPHERE, [effector.radius, 0.0, 0.0]
        enclosing = [1.5 * effector.radius] * 3
        further = {"condim": 4}  # a foot of rubber does not spin on the spot
    pose, body = frame.placement, bodies[frame.parentJoint]
    turn = _quaternion(pose.rotation)
    body.add_geom(
        name=effector.frame,
        type=geom,
        size=size,
        pos=pose.act(middle),
        quat=turn,
        contype=ROBOT,
        conaffinity=WORLD,
        **surface,
        **further,
    )
    body.add_site(
        name=effector.frame,
        type=around,
        pos=pose.act(np.array(effector.point)),
        quat=turn,
        size=enclosing,
    )


def _quaternion(rotation: Array) -> list[float]:
    """Quaternion of a rotation matrix in MuJoCo's order: w, x, y, z."""
    q = pin.Quaternion(rotation)
    return [q.w, q.x, q.y, q.z]


def _box(number: int) -> str:
    return f"box{number}"


def set_collision(model: Any, geom: int, *, present: bool) -> None:
    """Enable or disable the collisions of a geom."""
    model.geom_contype[geom], model.geom_conaffinity[geom] = (WORLD, ROBOT) if present else (0, 0)


def box_changes(model: Any, boxes: Sequence[Box]) -> dict[int, list[tuple[int, bool]]]:
    """Disable the boxes that are not present at first; the changes of all boxes."""
    changes: dict[int, list[tuple[int, bool]]] = {}
    for number, box in enumerate(boxes):
        geom = model.geom(_box(number)).id
        if box.since > 0:
            set_collision(model, geom, present=False)
            changes.setdefault(round(box.since / TICK), []).append((geom, True))
        if box.until < np.inf:
            changes.setdefault(round(box.until / TICK), []).append((geom, False))
    return changes


# Sensors of the floating base and of the centre of mass, in the world's axes: positions in [m], the
# quaternion (w, x, y, z), velocities in [m/s], the angular velocity in [rad/s].
BASE_SENSORS = {
    "base.place": "FRAMEPOS",
    "base.turn": "FRAMEQUAT",
    "base.velocity": "FRAMELINVEL",
    "base.spin": "FRAMEANGVEL",
    "centre.place": "SUBTREECOM",
    "centre.velocity": "SUBTREELINVEL",
}


def _add_sensors(spec: Any, effectors: Sequence[Effector], root: str | None) -> None:
    """Add the sensors that `sensors_of` describes, the contact forces of the effectors first."""

    def add(name: str, kind: str, sort: str, place: str) -> None:
        spec.add_sensor(
            name=name,
            type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"),
            objtype=getattr(mujoco.mjtObj, f"mjOBJ_{sort}"),
            objname=place,
        )

    frames = [effector.frame for effector in effectors]
    soles = [effector.frame for effector in effectors if isinstance(effector, Sole)]
    for frame in frames:
        add(f"{frame}.touch", "TOUCH", "SITE", frame)
    for frame in soles:
        add(f"{frame}.force", "FORCE", "SITE", frame)
        add(f"{frame}.torque", "TORQUE", "SITE", frame)
    if root is None:
        return
    for frame in frames:
        add(f"{frame}.place", "FRAMEPOS", "SITE", frame)
    for name, kind in BASE_SENSORS.items():
        add(name, kind, "BODY" if "centre" in name else "XBODY", root)


def sensors_of(model: Any) -> dict[str, slice]:
    """Slice of each sensor of a model in the vector of all, by name.

    ``<frame>.touch`` is the contact force of an effector, in [N]; ``<frame>.force`` and
    ``<frame>.torque`` are the load of a sole, in [N] and [N m], in the sole's axes: negate them for
    the force of the ground on the foot. Floating robots have ``<frame>.place`` of each effector, in
    [m], and `BASE_SENSORS`.
    """
    starts, widths = model.sensor_adr.tolist(), model.sensor_dim.tolist()
    return {
        model.sensor(number).name: slice(start, start + width)
        for number, (start, width) in enumerate(zip(starts, widths, strict=True))
    }


class WholeBody:
    """Inverse kinematics from a configuration on, with one Newton step per call."""

    def __init__(
        self, model: Any, effectors: Sequence[Effector], start: Array, *, upper: int = 0
    ) -> None:
        self._model = model.copy()
        self._frames = []
        for effector in effectors:  # their points, as frames
            parent = model.getFrameId(effector.frame)
            frame, name = model.frames[parent], f"{effector.frame}.point"
            pose = frame.placement * pin.SE3(np.eye(3), np.array(effector.point))
            point = pin.Frame(name, frame.parentJoint, parent, pose, pin.FrameType.OP_FRAME)
            self._frames.append(self._model.addFrame(point))
        self._data = self._model.createData()
        widths = [6 if isinstance(effector, Sole) else 3 for effector in effectors]
        ends = np.cumsum(widths).tolist()
        self._rows = [slice(end - width, end) for width, end in zip(widths, ends, strict=True)]
        self._heights = [rows.start + 2 for rows in self._rows]
        equations = ends[-1] + 6 + upper  # as many as the model has unknowns
        self._centre, self._base = slice(ends[-1], ends[-1] + 3), slice(ends[-1] + 3, ends[-1] + 6)
        self._upper = slice(ends[-1] + 6, equations)
        self._jacobian = np.zeros((equations, equations))
        self._jacobian[self._upper, equations - upper :] = np.eye(upper)
        self._error = np.zeros(equations)
        self.configuration = np.array(start, dtype=np.float64)
        self.inverse = np.zeros((equations, equations))

    def follow(
        self,
        places: Array,
        turns: Sequence[Array],
        centre: Array,
        base: Array,
        *,
        upper: Array | None = None,
        steps: int = 1,
    ) -> Array:
        """Configuration after Newton steps; one is enough for targets that moved by millimetres."""
        model, data = self._model, self._data
        jacobian, error = self._jacobian, self._error
        for _ in range(steps):
            pin.computeJointJacobians(model, data, self.configuration)
            for index, (frame, rows) in enumerate(zip(self._frames, self._rows, strict=True)):
                pose = pin.updateFramePlacement(model, data, frame)
                columns = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
                width = rows.stop - rows.start
                jacobian[rows] = columns[:width]
                error[rows.start : rows.start + 3] = places[index] - pose.translation
                if width == 6:
                    error[rows.start + 3 : rows.stop] = _turn(pose.rotation, turns[index])
            jacobian[self._centre] = pin.jacobianCenterOfMass(model, data, False)
            error[self._centre] = centre - data.com[0]
            rotation = data.oMi[1].rotation
            jacobian[self._base, 3:6] = rotation
            error[self._base] = _turn(rotation, base)
            if upper is not None:
                error[self._upper] = upper - self.configuration[model.nq - len(upper) :]
            self.inverse = np.linalg.inv(jacobian)
            self.configuration = pin.integrate(model, self.configuration, self.inverse @ error)
        return self.configuration

    def hold(self, bearing: Array) -> Array:
        """Torques that hold the robot still under ground forces, in the order of the equations."""
        gravity = pin.computeGeneralizedGravity(self._model, self._data, self.configuration)
        legs = self._jacobian[: self._centre.start, 6:]
        return np.asarray(gravity[6:] - bearing @ legs)

    @property
    def lift(self) -> Array:
        """Movement of the joints per height of each effector, shape (effectors, joints)."""
        return self.inverse[6:, self._heights].T

    @property
    def planes(self) -> Array:
        """Rates of the effectors' x and y per velocity, shape (2 effectors, nv)."""
        rows = [row for height in self._heights for row in (height - 2, height - 1)]
        return self._jacobian[rows]

    @property
    def heights(self) -> Array:
        """Rates of the effectors' heights per velocity, shape (effectors, nv)."""
        return self._jacobian[self._heights]


def _turn(rotation: Array, wanted: Array) -> Array:
    """Rotation vector from one rotation to another, in the world's axes, shape (3,), in [rad]."""
    return np.asarray(rotation @ pin.log3(rotation.T @ wanted))


def pinocchio_base(pose: Array, velocity: Array) -> tuple[Array, Array]:
    """Pose (position, quaternion) and velocity of a base as Pinocchio has them, from MuJoCo's."""
    place, w, xyz = pose[:, :3], pose[:, 3:4], pose[:, 4:]
    linear = velocity[:, :3]
    # v' = R^T v, R of the quaternion: v + 2 w (v x u) + 2 (v x u) x u, u its vector part.
    turned = 2 * np.cross(linear, xyz)
    linear = linear + w * turned + np.cross(turned, xyz)
    return np.hstack((place, xyz, w)), np.hstack((linear, velocity[:, 3:]))


def real_model(model: Any, frame: str, point: Array, imperfections: Imperfections) -> Any:
    """A robot's model with its real masses, unknown to its controller."""
    real = model.copy()
    for index, scale in enumerate(imperfections.mass, start=1):
        given = model.inertias[index]
        real.inertias[index] = pin.Inertia(given.mass * scale, given.lever, given.inertia * scale)
    holder = model.frames[model.getFrameId(frame)]
    real.appendBodyToJoint(
        holder.parentJoint,
        pin.Inertia.FromSphere(imperfections.payload, 0.02),
        holder.placement * pin.SE3(np.eye(3), point),
    )
    return real


def real_world(
    robot: Simulated,
    boxes: Sequence[Box],
    imperfections: Imperfections,
    *,
    frame: str,
    point: Array,
    contact: float = 0.005,
) -> Any:
    """MuJoCo model of a real robot, with its load at a point of a frame, and of its world."""
    drives = robot.drives
    return build(
        real_model(reduced_model(robot), frame, point, imperfections),
        armature=np.array(drives.armature),
        damping=np.array(drives.viscous) * imperfections.viscous,
        friction=np.array(drives.friction) * imperfections.friction,
        contact=contact,
        effectors=robot.effectors,
        boxes=boxes,
    )


def centre_of_mass(zmp: Array, rate: float) -> Array:
    """Motion of the centre of mass for a zero-moment point that is at rest at both ends, in [m].

    The bounded solution of c - c''/rate² = zmp (Kajita et al., ICRA 2003), as a banded system.
    """
    stiff = 1 / (rate * TICK) ** 2
    bands = np.zeros((3, len(zmp)))
    bands[0, 2:] = bands[2, :-2] = -stiff
    bands[1] = 1 + 2 * stiff
    bands[1, [0, -1]] = 1
    return np.asarray(solve_banded((1, 1), bands, zmp), dtype=np.float64)
