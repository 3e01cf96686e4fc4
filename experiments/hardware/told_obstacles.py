"""Obstacles that somebody else sees, and tells by messages."""

import numpy as np
from pydrake.systems.framework import Context

from diagrams.station import Station
from diagrams.surroundings.obstacles import TOLD
from pfsc_drake.drivers.remote_values import Request


class ToldObstacles:
    """What a controller that drives a robot is told of obstacles, and for how long that counts.

    As long as nothing has been told, and where the last that was told is older than the watch
    reckons with, it is no number: the motion waits.

    Args:
        station: The station.
    """

    def __init__(self, station: Station) -> None:
        self._source, self._latency, self._until = None, 0.0, -np.inf
        crossing = station.crossing
        if crossing is not None:
            self._source = station.diagram.GetSubsystemByName(TOLD)
            self._latency = crossing.watch.latency
            self._nothing = np.full(6 * len(crossing.moving), np.nan)
            self._values = self._nothing

    def hear(self, request: Request, time: float) -> None:
        """Take over what a message tells of them, if it does.

        Args:
            request: The message.
            time: When it is heard, as the robot counts it [s].
        """
        if self._source is None or not request.obstacles:
            return
        fits = len(request.obstacles) == len(self._nothing)
        self._values = np.array(request.obstacles) if fits else self._nothing
        self._until = time + self._latency - request.age

    def tell(self, root: Context, time: float) -> None:
        """Tell the controller of them.

        Args:
            root: Context of the diagram.
            time: Now, as the robot counts it [s].
        """
        if self._source is None:
            return
        context = self._source.GetMyMutableContextFromRoot(root)
        told = self._values if time <= self._until else self._nothing
        self._source.get_mutable_source_value(context).SetFromVector(told)
