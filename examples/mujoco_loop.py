"""Record a MuJoCo simulation: `python examples/mujoco_loop.py && inspector classify elbow.npz`."""

import mujoco
import numpy as np

import noisemodel as nm

ELBOW = """<mujoco><worldbody><body><joint name="elbow" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/>
</body></worldbody><actuator><position joint="elbow" kp="900" kv="90"/></actuator></mujoco>"""
model = mujoco.MjModel.from_xml_string(ELBOW)
data = mujoco.MjData(model)
recorder = nm.Recorder(None, 1 / model.opt.timestep, joint_names=["elbow"])  # or "panda", 500
while data.time < 5:
    data.ctrl[:] = np.sin(2 * data.time)
    mujoco.mj_step(model, data)
    recorder.push(position=data.qpos, velocity=data.qvel, position_desired=data.ctrl)
recorder.save("elbow.npz", overwrite=True)
