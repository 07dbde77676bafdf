"""Arms in Drake's multibody dynamics under Drake's controllers."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.elsewhere.faults import Control
from benchmarks.elsewhere.recorded import Recorded
from noisemodel.robot import locate


@dataclass(frozen=True)
class DrakeArm:
    """An arm of example-robot-data; Drake's own models are a download."""

    robot: str
    joints: tuple[str, ...]
    controller: str
    force: tuple[float, ...]  # greatest torque of each joint, in [N m]
    home: tuple[float, ...]  # posture around which it moves, in [rad]
    links: tuple[int, ...]


@dataclass(frozen=True)
class Loop:
    """Settings of the controller, the drives and the load."""

    frequency: float  # frequency of the closed loop, in [rad/s]
    damping: float
    inertia: float  # reflected inertia of the rotors, in [kg m²]
    friction: float  # viscous friction of the joints, in [N m s]
    payload: float  # mass added to the last link, unknown to the controller, in [kg]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Loop":
        """Draw all settings."""
        return cls(
            frequency=rng.uniform(8.0, 25.0),
            damping=rng.uniform(0.6, 1.1),
            inertia=rng.uniform(0.05, 0.4),
            friction=rng.uniform(0.1, 2.0),
            payload=float(rng.choice((0.0, rng.uniform(0.2, 2.0)))),
        )


def plant_of(arm: DrakeArm, loop: Loop, rate: float, payload: float) -> Any:
    """The dynamics of an arm, without meshes and contacts."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    urdf = locate(arm.robot).read_text()
    for part in ("visual", "collision", "transmission", "gazebo"):
        urdf = re.sub(rf"<{part}[ >].*?</{part}>", "", urdf, flags=re.DOTALL)
    plant = MultibodyPlant(1 / rate)
    Parser(plant).AddModelsFromString(urdf, "urdf")
    if '<link name="world"' not in urdf:
        root = re.search(r"<link name=\"([^\"]+)\"", urdf)
        assert root
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root.group(1)))
    for name, force in zip(arm.joints, arm.force, strict=True):
        joint = plant.GetJointByName(name)
        joint.set_default_damping(loop.friction)
        actuator = plant.AddJointActuator(f"{name}_motor", joint, effort_limit=force)
        actuator.set_default_rotor_inertia(loop.inertia)
        actuator.set_default_gear_ratio(1.0)
    if payload:
        from pydrake.multibody.tree import SpatialInertia

        last = plant.GetJointByName(arm.joints[-1]).child_body()
        load = plant.AddRigidBody("payload", last.model_instance(),
                                  SpatialInertia.SolidSphereWithMass(payload, 0.05))  # fmt: skip
        plant.WeldFrames(last.body_frame(), load.body_frame())
    plant.Finalize()
    return plant


def simulate(arm: DrakeArm, loop: Loop, control: Control, rate: float) -> Recorded:
    """The motion of an arm under a control."""
    from pydrake.multibody.tree import JacobianWrtVariable
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.controllers import InverseDynamicsController, JointStiffnessController

    plant, nominal = (plant_of(arm, loop, rate, payload) for payload in (loop.payload, 0.0))
    count = len(arm.joints)
    assert plant.num_positions() == count
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    state = np.concatenate((control.position[0], np.zeros(count)))
    plant.SetPositionsAndVelocities(context, state)
    reflected = np.diag(plant.CalcMassMatrix(context))
    stiffness = np.full(count, loop.frequency**2)
    damping = np.full(count, 2 * loop.damping * loop.frequency)
    if arm.controller == "InverseDynamicsController":
        controller: Any = InverseDynamicsController(
            nominal, stiffness, np.zeros(count), damping, has_reference_acceleration=False
        )
    else:
        controller = JointStiffnessController(nominal, stiffness * reflected, damping * reflected)
    inner = controller.CreateDefaultContext()
    estimated = controller.GetInputPort("estimated_state")
    desired = controller.GetInputPort("desired_state")
    output = controller.get_output_port(0)
    push_port = plant.get_applied_generalized_force_input_port()
    drive_port = plant.get_actuation_input_port()
    bodies = [plant.GetJointByName(name).child_body() for name in arm.joints]
    position, velocity, effort = (np.zeros((len(control.position), count)) for _ in range(3))
    force = np.array(arm.force)
    push_port.FixValue(context, np.zeros(count))
    pushed = False
    for tick in range(len(control.position)):
        position[tick], velocity[tick] = plant.GetPositions(context), plant.GetVelocities(context)
        seen = max(0, tick - 1 - int(control.delay[tick]))
        measured = position[seen] + control.offset[tick]
        estimated.FixValue(inner, np.concatenate((measured, velocity[seen])))
        now = max(0, tick - int(control.late[tick]))
        desired.FixValue(inner, np.concatenate((control.position[now], control.velocity[now])))
        torque = output.Eval(inner)
        if (control.gain[tick] > 1).any():
            older = max(0, tick - round(0.004 * rate))
            error = control.position[now] - position[older]
            slip = control.velocity[now] - velocity[older]
            extra = (control.gain[tick] - 1) * reflected * (stiffness * error + damping * slip)
            torque = torque + np.clip(extra, -0.4 * force, 0.4 * force)
        effort[tick] = np.clip(torque, -force, force)
        drive_port.FixValue(context, effort[tick])
        acting = [push for push in control.pushes if push.start <= tick < push.stop]
        if acting or pushed:
            torques = np.zeros(count)
            for push in acting:
                body = bodies[push.link]
                jacobian = plant.CalcJacobianTranslationalVelocity(
                    context, JacobianWrtVariable.kV, body.body_frame(),
                    body.default_com(), plant.world_frame(), plant.world_frame()
                )  # fmt: skip
                torques += jacobian.T @ push.at(tick)
            push_port.FixValue(context, torques)
            pushed = bool(acting)
        simulator.AdvanceTo((tick + 1) / rate)
    return Recorded(position, velocity, effort).checked(rate)
