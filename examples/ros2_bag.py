"""Classify a ROS 2 bag: `python examples/ros2_bag.py BAG panda`."""

import sys

import inspector

bag, robot = sys.argv[1], sys.argv[2]
log = inspector.read_log(bag, robot=robot)  # joint states, and a controller's desired motion
print(log.run, *log.remarks, sep="\n")
analysis = inspector.analyse(log.run)
print(analysis.headline)
for finding in analysis.findings:
    print(f"{finding.label} from {finding.start:.2f} s to {finding.stop:.2f} s")
log.run.save("bag.npz", overwrite=True)  # `inspector view bag.npz`
