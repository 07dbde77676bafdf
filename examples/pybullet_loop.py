"""Record a PyBullet simulation: `python examples/pybullet_loop.py && inspector view panda.npz`."""

import numpy as np
import pybullet
import pybullet_data

import noisemodel as nm

pybullet.connect(pybullet.DIRECT)
pybullet.setAdditionalSearchPath(pybullet_data.getDataPath())
panda = pybullet.loadURDF("franka_panda/panda.urdf", useFixedBase=True)
joints = list(range(7))
names = [pybullet.getJointInfo(panda, joint)[1].decode() for joint in joints]
home = np.array([0, -0.8, 0, -2.4, 0, 1.6, 0.8])
for joint in joints:
    pybullet.resetJointState(panda, joint, home[joint])
with nm.Recorder("panda", 240, joint_names=names, path="panda.npz") as recorder:
    for step in range(5 * 240):
        target = home + 0.3 * np.sin(2 * step / 240)
        mode = pybullet.POSITION_CONTROL
        pybullet.setJointMotorControlArray(panda, joints, mode, targetPositions=target)
        pybullet.stepSimulation()
        position, velocity, _, effort = zip(*pybullet.getJointStates(panda, joints), strict=True)
        recorder.push(position=position, velocity=velocity, position_desired=target, effort=effort)
