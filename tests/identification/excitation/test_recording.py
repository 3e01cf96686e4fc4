"""Excitations in Meshcat."""

import numpy as np
import pytest

from identification.excitation.fourier import FourierTrajectory
from identification.excitation.recording import record_excitation
from identification.excitation.run_in import rest_to_rest
from pfsc_drake.errors import InputError


def test_page_of_an_arm_in_its_cell(comau, comau_cell, printed, tmp_path):
    file = tmp_path / "excitation.html"
    page = record_excitation(comau, printed, file, comau_cell, frame_rate=2.0)
    assert file.read_text() == page
    assert page.startswith("<!DOCTYPE html>")
    assert page.count("/visualizer/") + page.count("visualizer") > 0


def test_page_of_a_run_of_a_delta(delta):
    motion = FourierTrajectory(np.full(3, 0.2), np.full((3, 1), 0.05), np.zeros((3, 1)), 2.0, (1,))
    run = rest_to_rest(motion, np.full(3, 3.0), np.full(3, 30.0), periods=1)
    assert record_excitation(delta, run, frame_rate=2.0).startswith("<!DOCTYPE html>")


def test_refuses(comau, arm, printed, tmp_path):
    with pytest.raises(InputError, match="of 6 joints; comau_racer_1_4_3r has 3"):
        record_excitation(arm, printed)
    with pytest.raises(InputError, match="frame_rate = 0"):
        record_excitation(comau, printed, frame_rate=0)
    with pytest.raises(InputError, match="cannot be written"):
        record_excitation(comau, printed, tmp_path / "no" / "x.html", frame_rate=0.5)
