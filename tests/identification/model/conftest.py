"""Robots under test, each loaded once."""

import pytest

from identification.model.subject import load_subject

ARMS = ["comau_racer_1_4", "franka_emika_panda"]


@pytest.fixture(scope="session")
def subject_of():
    """Return a function that gives the bare robot of a name."""
    loaded = {}

    def load(name):
        if name not in loaded:
            loaded[name] = load_subject(name)
        return loaded[name]

    return load


@pytest.fixture(scope="session")
def comau(subject_of):
    return subject_of("comau_racer_1_4")


@pytest.fixture(scope="session")
def delta(subject_of):
    return subject_of("festo_expt_45")
