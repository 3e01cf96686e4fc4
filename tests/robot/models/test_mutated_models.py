"""Models with something changed in them: each is a robot in the end, or one line."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.reading import read_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

_WORD = re.compile(r"[-\w.:/]+")
_OTHERS = [
    *("", "0", "-1", "1", "1e-300", "1e300", "1e999", "nan", "inf", "-inf", "abc", "1,5", "0x1"),
    *("world", "base_link", "base", "upper", "arm", "fixed", "floating", "prismatic", "ball"),
    *("link", "joint", "inertial", "mass", "limit", "axis", "include", "uri", "mimic", "<", ">"),
]


def chain_or_line(file, tool):
    """Return the chain of a model, or None if it is refused as it should be."""
    plant = MultibodyPlant(0.0)
    try:
        warnings = read_model(plant, file)
        frame = plant.GetFrameByName(tool) if plant.HasFrameNamed(tool) else plant.world_frame()
        chain, _ = chain_from_plant(plant, frame)
    except InputError as error:
        assert "\n" not in str(error)
        assert len(str(error)) < 2000
        return None
    assert all("\n" not in warning for warning in warnings)
    return chain


@pytest.mark.slow(but="urdf-tcp")
@pytest.mark.fuzz
@pytest.mark.parametrize(("kind", "tool"), [("urdf", "tcp"), ("sdf", "arm")])
def test_one_word_changed(examples, tmp_path, urdf_text, sdf_text, kind, tool):
    text = urdf_text if kind == "urdf" else sdf_text
    words = list(_WORD.finditer(text))
    file = tmp_path / f"arm.{kind}"

    @examples(60)
    @given(st.sampled_from(words), st.sampled_from(_OTHERS))
    def check(word, other):
        changed = text[: word.start()] + other + text[word.end() :]
        file.write_text(changed, encoding="utf-8")
        chain = chain_or_line(file, tool)
        if chain is not None:
            numbers = [chain.gather(key) for key in ("mass", "p_LC", "I_C", "p_PF", "axis")]
            assert all(np.isfinite(values).all() for values in numbers)
            assert np.all(chain.gather("mass") >= 0.0)
            lower, upper = chain.gather("position_limits").T
            assert np.all(lower < upper)

    check()
