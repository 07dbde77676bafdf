"""ROS bags, of both generations and all storages, without a ROS installation."""
