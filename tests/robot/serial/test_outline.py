"""Capsules along an arm, against Drake's places of its frames."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.outline import arm_outline, outline_points


def _arm(name):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(name)))
    plant.Finalize()
    return plant, chain_from_plant(plant, plant.GetFrameByName("tool_point"))[0]


@pytest.mark.parametrize(("name", "count"), [("comau_racer_1_4", 5), ("franka_emika_panda", 4)])
def test_it_leads_from_the_second_joint_to_the_tool(name, count):
    plant, chain = _arm(name)
    outline = arm_outline(chain, 0.1)
    assert len(outline.points) == count
    rng, context = np.random.default_rng(1), plant.CreateDefaultContext()
    for _ in range(3):
        q = rng.uniform(-1.0, 1.0, chain.dimension)
        plant.SetPositions(context, q)
        points = outline_points(chain, outline)(q).full().reshape(-1, 3)
        for (link, _), point in zip(outline.points[:-1], points[:-1], strict=True):
            frame = plant.GetJointByName(f"joint_{link + 1}").frame_on_child()
            expected = frame.CalcPoseInWorld(context).translation()
            np.testing.assert_allclose(point, expected, atol=1e-9)
        tool = plant.GetFrameByName("tool_point").CalcPoseInWorld(context).translation()
        np.testing.assert_allclose(points[-1], tool, atol=1e-9)
        # no joint is farther from the arm's line than what counts as one point
        between = np.linalg.norm(np.diff(points[:-1], axis=0), axis=1)
        assert between.min() > 0.1


def test_an_arm_of_one_joint_has_none():
    _, chain = _arm("comau_racer_1_4")
    one = SerialChain(chain.links[:1], np.eye(3), np.zeros(3))
    with pytest.raises(InputError, match="1 joint"):
        arm_outline(one, 0.1)
    with pytest.raises(InputError, match="radius"):
        arm_outline(chain, 0.0)
