"""Models whose angles were rounded have the base parameters of the robot."""

import re

import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from identification.consistency.model_edits import urdf_text
from identification.model.base import base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject, round_rotation


def rotation(*degrees):
    return RollPitchYaw(np.deg2rad(degrees)).ToRotationMatrix().matrix()


@pytest.mark.parametrize("degrees", [(90, 0, 0), (0, 90, 0), (-90, 90, 45), (30, -15, 180)])
def test_nearly_round_angles_become_round(degrees):
    written = np.round(np.deg2rad(degrees), 4)
    rounded = round_rotation(RollPitchYaw(written).ToRotationMatrix().matrix())
    np.testing.assert_allclose(rounded, rotation(*degrees), atol=1e-15)


def test_other_angles_stay():
    R = rotation(12.0, 33.0, 90.02)
    np.testing.assert_array_equal(round_rotation(R), R)
    mixed = round_rotation(rotation(12.0, 89.999, -30.001))
    np.testing.assert_allclose(mixed, rotation(12.0, 90.0, -30.0), atol=1e-12)


@pytest.mark.parametrize("digits", [4, 7])
@pytest.mark.parametrize("rounded_again", [True, False])
def test_a_urdf_with_rounded_angles(comau, tmp_path, monkeypatch, digits, rounded_again):
    """Also without putting angles right, as of a robot whose angles are not multiples of 15 deg."""
    if not rounded_again:
        monkeypatch.setattr("identification.model.subject.TOLERANCE", -1.0)
    text = urdf_text(comau, true_parameters(comau))

    def shorten(found):
        angles = [str(round(float(angle), digits)) for angle in found[1].split()]
        return f'rpy="{" ".join(angles)}"'

    file = tmp_path / "arm.urdf"
    file.write_text(re.sub('rpy="([^"]*)"', shorten, text))
    subject = load_subject(file)
    assert bool(subject.note) == rounded_again
    if rounded_again:
        assert "joint_2, joint_4" in subject.note and "15 deg" in subject.note
    found, exact = (base_parameters(Regressor(robot, coupling=False)) for robot in (subject, comau))
    assert found.rank == 52
    assert found.short_names == exact.short_names
    np.testing.assert_allclose(found.projection, exact.projection, rtol=1e-6, atol=1e-5)
    if rounded_again:
        assert found.names == exact.names


def test_shipped_models_are_as_they_are(subject_of):
    for name in ("comau_racer_1_4", "franka_emika_panda"):
        assert subject_of(name).note == ""
