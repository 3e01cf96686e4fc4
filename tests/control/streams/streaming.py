"""Stream of waypoints and a tool that follows its reference exactly, for tests."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.blocks.block import Block, Port
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.paced_reference import PacedReference
from pfsc_drake.control.streams.growing_path import GrowingPath
from pfsc_drake.control.streams.intake import WaypointIntake
from pfsc_drake.control.streams.messages import WaypointLayout, WaypointSender
from pfsc_drake.control.streams.projector import StreamedProjector
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import fuse

PERIOD = 1e-3
_WIRES = """
t.tool_pose.p i.path.p p.manifold_point.i p.manifold_point.t r.motion.i r.reference.t
r.stop.i i.goal.r i.stretches.r i.stretch_speeds.r
"""
_OUTPUTS = "i.path i.goal i.stream p.manifold_point r.reference r.overrun"


class IdealTool(Block):
    """Tool point that follows the reference along the path, a tick later."""

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
    """Outputs at each tick."""

    points: np.ndarray
    eta: np.ndarray
    goal: np.ndarray
    stream: np.ndarray
    overrun: np.ndarray
    pieces: np.ndarray
    layout: object
    path: GrowingPath
    paths: list

    @property
    def sigma(self):
        return self.points[:, self.layout.position][:, :3]


class Stream:
    """Intake, projector, reference and an ideal tool as one stepper."""

    def __init__(self, parameters, start, order=4, m=3, length=32, direction=(1.0, 0.0, 0.0)):
        start = np.asarray(start, float)
        self.path = GrowingPath(order, len(start), parameters.columns)
        self.layout = WaypointLayout(len(start), length)
        intake = WaypointIntake(
            self.path, parameters, self.layout, order, PERIOD, at_rest=start, direction=direction
        )
        projector = StreamedProjector(self.path)
        reference = PacedReference(parameters.limits, order, m, PERIOD, stretches=self.path.spans)
        tool = IdealTool(start, order, m, projector.layout.size)
        position = projector.layout.position.start
        tool.position, tool.slope = slice(position, position + 3), slice(position + 3, position + 6)
        builder = DiagramBuilder()
        systems = {
            name: builder.AddNamedSystem(name, BlockSystem(block, PERIOD))
            for name, block in {"i": intake, "p": projector, "r": reference, "t": tool}.items()
        }
        for wire in _WIRES.split():
            source, port, target = wire.split(".")
            builder.Connect(systems[source].GetOutputPort(port), systems[target].GetInputPort(port))
        builder.ExportInput(systems["i"].GetInputPort("waypoints"), "waypoints")
        for output in _OUTPUTS.split():
            source, port = output.split(".")
            builder.ExportOutput(systems[source].GetOutputPort(port), port)
        self.projector_layout, self.m, self.order = projector.layout, m, order
        self.stepper = Stepper(fuse(builder.Build()).network)

    def run(self, message, ticks, keep=50):
        """Return the outputs; ``message(tick, stream) -> message``."""
        self.stepper.restart()
        rows = {name: [] for name in ("manifold_point", "reference", "goal", "stream", "overrun")}
        pieces, paths, stream = [], [], np.zeros(4)
        for k in range(ticks):
            outputs = self.stepper.step(waypoints=message(k, stream))
            stream = outputs["stream"]
            for name, row in rows.items():
                row.append(outputs[name])
            pieces.append(outputs["path"][1])
            if k % keep == 0:
                paths.append(outputs["path"])
        signals = {name: np.array(row) for name, row in rows.items()}
        return Run(
            signals["manifold_point"],
            signals["reference"].reshape(ticks, self.order + 1, self.m)[:, :, 0],
            signals["goal"][:, 0],
            signals["stream"],
            signals["overrun"][:, 0],
            np.array(pieces),
            self.projector_layout,
            self.path,
            paths,
        )


_STREAMS = {}


def make_stream(parameters, start, **options):
    """Return a stream; built once for the same content."""
    key = repr((parameters, np.asarray(start).tolist(), options))
    if key not in _STREAMS:
        _STREAMS[key] = Stream(parameters, start, **options)
    return _STREAMS[key]


def sent_at(layout, waypoints, times, new=(), end=True, heard=False):
    """Return the messages by tick of waypoints, valid or not, that arrive at times [s]."""
    sender, state = WaypointSender(layout), {"next": 0}

    def message(k, stream):
        while state["next"] < len(times) and times[state["next"]] <= PERIOD * k:
            row = [*waypoints[state["next"]], float(state["next"] in new)]
            sender._rows.append(row)  # also rows that a sender rejects
            state["next"] += 1
        if end and state["next"] == len(times):
            sender.end()
        sender.taken = int(stream[1]) if heard else None
        return sender.message

    return message
