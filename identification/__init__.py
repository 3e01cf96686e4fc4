"""From a robot to its model: excitation, measurement, estimation (Sec. 2.4.6, 2.5)."""
