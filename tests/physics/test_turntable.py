"""Encoders of a turntable: increments, and messages that come late."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.physics.turntable import TurntableDrive


@pytest.mark.parametrize("ticks", [0, 1, 3])
def test_angles_come_late_and_the_truth_does_not(ticks):
    drive = Stepper(TurntableDrive(2, 0.0, ticks))
    sent = [np.array([0.1 * k, -0.2 * k, 1.0, 2.0]) for k in range(6)]
    measured = [drive.step(followed=row) for row in sent]
    for k, row in enumerate(measured):
        assert np.array_equal(row["motion"], sent[k])
        assert np.array_equal(row["measured"], sent[max(k - ticks, 0)][:2])


def test_angles_are_whole_increments():
    drive = Stepper(TurntableDrive(1, 360.0, 0))
    degrees = np.rad2deg(drive.step(followed=np.deg2rad([12.6, 5.0]))["measured"])
    assert degrees == pytest.approx([13.0], abs=1e-12)
    degrees = np.rad2deg(drive.step(followed=np.deg2rad([-12.4, 5.0]))["measured"])
    assert degrees == pytest.approx([-12.0], abs=1e-12)
