"""The part of pybullet_utils that the published simulator uses."""
