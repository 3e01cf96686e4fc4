"""Scripted forces as a system: in the world and along a path."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.manifolds.manifold import Projector
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import FourierCurve, Path
from pfsc_drake.physics.scripted_force import ForceProfile, ForcePulse, ScriptedForce
from pfsc_drake.systems.block_system import BlockSystem

PERIOD = 1e-3
MANIFOLD = PathManifold(2, oriented=False)
LAYOUT = MANIFOLD.layout


def scripted(pulses):
    return BlockSystem(ScriptedForce(ForceProfile(pulses), MANIFOLD, PERIOD), PERIOD)


def simulate(path, pulses, tool, duration):
    """Return times, wrenches and path points with the tool on a straight way."""
    builder = DiagramBuilder()
    trajectory = builder.AddSystem(TrajectorySource(tool))
    projector = builder.AddSystem(BlockSystem(Projector(path.evaluator(2)), PERIOD))
    script = builder.AddSystem(scripted(pulses))
    builder.Connect(trajectory.get_output_port(), projector.get_input_port())
    builder.Connect(projector.get_output_port(), script.GetInputPort("manifold_point"))
    logs = [LogVectorOutput(s.get_output_port(), builder, PERIOD) for s in (script, projector)]
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(duration)
    wrench, point = (log.FindLog(simulator.get_context()) for log in logs)
    return wrench.sample_times(), wrench.data().T, point.data().T, path.evaluator(2).layout


def test_in_the_world_it_needs_no_path():
    script = scripted([ForcePulse(0.1, 1.0, [3.0, 0, 0])])
    assert script.num_input_ports() == 0
    context = script.CreateDefaultContext()
    for time, value in ((0.0, 0.0), (0.125, 1.5), (0.5, 3.0), (2.0, 0.0)):
        context.SetTime(time)
        assert script.get_output_port().Eval(context)[0] == pytest.approx(value, abs=1e-12)


def test_against_the_motion_is_along_the_path():
    path = Path(FourierCurve.bent_lemniscate())
    begin, end = path.evaluator(2).evaluate_at(0.05), path.evaluator(2).evaluate_at(0.4)
    pose = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    samples = np.column_stack([pose, pose])
    samples[:3, 0], samples[:3, 1] = begin[LAYOUT.position][:3], end[LAYOUT.position][:3]
    tool = PiecewisePolynomial.FirstOrderHold([0.0, 0.4], samples)
    pulse = ForcePulse(0.0, 1.0, [-100.0, 0, 0], [0, 0, 2.0], frame="manifold")
    times, wrench, point, layout = simulate(path, [pulse], tool, 0.4)
    slope = point[:, layout.position][:, 3:6]
    e_par = slope / np.linalg.norm(slope, axis=1)[:, None]
    full = times > 0.06
    # the directions are those of the last tick
    force, torque = wrench[full, :3], wrench[full, 3:]
    assert np.allclose(force, -100.0 * e_par[np.flatnonzero(full) - 1], rtol=0, atol=1e-9)
    assert np.max(np.abs(np.diff(force, axis=0))) < 1.0
    e_cross = np.cross(e_par, point[:, layout.normal])[np.flatnonzero(full) - 1]
    assert np.allclose(torque, 2.0 * e_cross, rtol=0, atol=1e-9)


def along_y():
    """Return a path point with e_par along y, e_perp along z, e_cross along x."""
    point = np.zeros(LAYOUT.size)
    point[LAYOUT.position][3:6], point[LAYOUT.normal] = [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]
    return point


def test_a_lost_path_point_leaves_the_direction():
    profile = ForceProfile([ForcePulse(-1.0, 1.0, [5.0, 0, 0], frame="manifold")])
    stepper, lost = Stepper(ScriptedForce(profile, MANIFOLD, PERIOD)), np.full(LAYOUT.size, np.nan)
    assert not np.any(stepper.step(manifold_point=lost)["wrench"])
    assert not np.any(stepper.step(manifold_point=along_y())["wrench"])
    for _ in range(10):
        wrench = stepper.step(manifold_point=lost)["wrench"]
        assert wrench == pytest.approx([0, 5.0, 0, 0, 0, 0])


def test_it_does_not_feed_through():
    assert not scripted([ForcePulse(frame="manifold")]).HasAnyDirectFeedthrough()


def test_the_direction_is_there_from_the_start():
    profile = ForceProfile([ForcePulse(-1.0, 1.0, [5.0, 0, 0], frame="manifold")])
    stepper = Stepper(ScriptedForce(profile, MANIFOLD, PERIOD))
    wrench = stepper.step(manifold_point=along_y())["wrench"]
    assert wrench == pytest.approx([0, 5.0, 0, 0, 0, 0])
