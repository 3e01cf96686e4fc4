"""A stream of way points and a tool that is where its reference is, for tests."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.blocks.block import Block, Port
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.pace import PacedReference
from pfsc_drake.control.streams.intake import WaypointIntake
from pfsc_drake.control.streams.messages import WaypointLayout, WaypointSender
from pfsc_drake.control.streams.projector import StreamedProjector
from pfsc_drake.control.streams.stream_course import Course
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import fuse

PERIOD = 1e-3
_WIRES = """
t.tool_pose.p i.course.p p.manifold_point.i p.manifold_point.t r.motion.i r.reference.t
r.stop.i i.goal.r i.stretches.r i.stretch_speeds.r
"""
_TOLD = "i.course i.goal i.stream p.manifold_point r.reference r.overrun"


class IdealTool(Block):
    """A tool point that moves along the path as the reference says, a tick later."""

    def __init__(self, start, order, m, size):
        self.inputs = {"manifold_point": Port(size), "reference": Port((order + 1) * m)}
        self.outputs, self.states = {"tool_pose": Port(12)}, {"pose": 12}
        self._start = start

    def initial(self, u, t):
        return {"pose": ca.vertcat(ca.DM(self._start[:3]), ca.DM(np.eye(3).ravel()))}

    def output(self, x, u, t):
        return {"tool_pose": x.pose}

    def update(self, x, u, y, t):
        sigma, slope = u.manifold_point[self.position], u.manifold_point[self.slope]
        step = u.reference[0] - u.manifold_point[1]
        return {"pose": ca.vertcat(sigma + step * slope / ca.norm_2(slope), x.pose[3:])}


@dataclass
class Run:
    """What was told at each tick."""

    points: np.ndarray
    eta: np.ndarray
    goal: np.ndarray
    stream: np.ndarray
    overrun: np.ndarray
    pieces: np.ndarray
    layout: object
    course: Course
    courses: list

    @property
    def sigma(self):
        return self.points[:, self.layout.position][:, :3]


class Stream:
    """Intake, projector, pace and an ideal tool as one stepper."""

    def __init__(self, parameters, start, order=4, m=3, length=32, direction=(1.0, 0.0, 0.0)):
        start = np.asarray(start, float)
        self.course = Course(order, len(start), parameters.columns)
        self.layout = WaypointLayout(len(start), length)
        intake = WaypointIntake(
            self.course, parameters, self.layout, order, PERIOD, at_rest=start, direction=direction
        )
        projector = StreamedProjector(self.course)
        pace = PacedReference(parameters.limits, order, m, PERIOD, stretches=self.course.spans)
        tool = IdealTool(start, order, m, projector.layout.size)
        position = projector.layout.position.start
        tool.position, tool.slope = slice(position, position + 3), slice(position + 3, position + 6)
        builder = DiagramBuilder()
        systems = {
            name: builder.AddNamedSystem(name, BlockSystem(block, PERIOD))
            for name, block in {"i": intake, "p": projector, "r": pace, "t": tool}.items()
        }
        for wire in _WIRES.split():
            source, port, target = wire.split(".")
            builder.Connect(systems[source].GetOutputPort(port), systems[target].GetInputPort(port))
        builder.ExportInput(systems["i"].GetInputPort("waypoints"), "waypoints")
        for told in _TOLD.split():
            source, port = told.split(".")
            builder.ExportOutput(systems[source].GetOutputPort(port), port)
        self.projector_layout, self.m, self.order = projector.layout, m, order
        self.stepper = Stepper(fuse(builder.Build()).network)

    def run(self, message, ticks, keep=50):
        """Return what was told; ``message(tick, stream) -> message``."""
        self.stepper.restart()
        rows = {name: [] for name in ("manifold_point", "reference", "goal", "stream", "overrun")}
        pieces, courses, stream = [], [], np.zeros(4)
        for k in range(ticks):
            told = self.stepper.step(waypoints=message(k, stream))
            stream = told["stream"]
            for name, row in rows.items():
                row.append(told[name])
            pieces.append(told["course"][1])
            if k % keep == 0:
                courses.append(told["course"])
        told = {name: np.array(row) for name, row in rows.items()}
        return Run(
            told["manifold_point"],
            told["reference"].reshape(ticks, self.order + 1, self.m)[:, :, 0],
            told["goal"][:, 0],
            told["stream"],
            told["overrun"][:, 0],
            np.array(pieces),
            self.projector_layout,
            self.course,
            courses,
        )


_MADE = {}


def make_stream(parameters, start, **options):
    """Return a stream; made once of the same content."""
    key = repr((parameters, np.asarray(start).tolist(), options))
    if key not in _MADE:
        _MADE[key] = Stream(parameters, start, **options)
    return _MADE[key]


def sent_at(layout, waypoints, times, new=(), end=True, heard=False):
    """Return the message at each tick of way points that come at times [s], good or bad ones."""
    sender, state = WaypointSender(layout), {"next": 0}

    def message(k, stream):
        while state["next"] < len(times) and times[state["next"]] <= PERIOD * k:
            row = [*waypoints[state["next"]], float(state["next"] in new)]
            sender._rows.append(row)  # what no sender would tell, too
            state["next"] += 1
        if end and state["next"] == len(times):
            sender.end()
        sender.taken = int(stream[1]) if heard else None
        return sender.message

    return message
