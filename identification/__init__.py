"""From a robot to its model: excitation, measurement, estimation, consistency."""
