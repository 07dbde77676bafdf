"""ROS 1 and ROS 2 bags of all storages, read without a ROS installation."""
