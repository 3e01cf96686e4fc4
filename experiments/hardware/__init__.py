"""Robots and controllers in two processes: a simulated robot, and what drives one."""
