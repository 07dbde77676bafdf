"""Noise of each episode of a LeRobot data set: `python examples/lerobot_dataset.py FOLDER`."""

import sys

import inspector
import noisemodel as nm

for log in inspector.read_logs(sys.argv[1]):
    run = log.run  # position is observation.state, position_desired is action
    noise = nm.simplified(run.velocity, run.velocity_desired)
    print(f"{log.name}: {run.duration:.1f} s at {run.rate:g} Hz, {noise.mean():.3f} rad/s")
    run.save(f"{log.name}.npz", overwrite=True)
