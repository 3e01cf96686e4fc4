"""One number where there may be a list of equal ones: the same run, to the last bit."""

import numpy as np
import pytest

COMMON = [
    ("start.posture_deg=20", "start.posture_deg=[20, 20, 20]"),
    ("start.offset=0", "start.offset=[0, 0]"),
    ("friction.f_c=0.5", "friction.f_c=[0.5, 0.5, 0.5]"),
    ("friction.f_v=0.2", "friction.f_v=[0.2, 0.2, 0.2]"),
    ("robot.joint_damping=0.3", "robot.joint_damping=[0.3, 0.3, 0.3]"),
    ("encoders.link_increments=1e5", "encoders.link_increments=[1e5, 1e5, 1e5]"),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "pole", "order"), [("elastic", -50, 4), ("singular_perturbation", -30, 2)]
)
def test_one_number_is_as_good_as_equal_ones(three_axes, law, pole, order):
    gains = f"controller.gains.{law}"
    keys = [f"{gains}.{kind}.poles" for kind in ("eta", "xi")]
    equal = [(f"{key}={pole}", f"{key}={[pole] * order}") for key in keys]
    damping = "controller.boundary_layer_damping"
    pairs = [*COMMON, *equal, (f"{damping}=0.04", f"{damping}=[0.04, 0.04, 0.04]")]
    chosen = [f"controller.law={law}", f"{gains}={{}}"]
    one = three_axes(*chosen, *(a for a, _ in pairs), duration="0.02")
    several = three_axes(*chosen, *(b for _, b in pairs), duration="0.02")
    assert one.status == several.status == 0
    for name in one.log:
        np.testing.assert_array_equal(one[name], several[name])


def test_a_run_warns_of_a_former_key_and_writes_the_present_one(three_axes):
    gains = "controller.gains.elastic.eta={poles: auto, bandwidth: 20, bears: 0.03}"
    run = three_axes(gains, duration="0.02")
    assert run.status == 0
    assert "controller.gains.elastic.eta.bears is now called 'tolerated_error'" in run.stdout
    assert "tolerated_error: 0.03" in (run.folder / "scenario.yaml").read_text(encoding="utf-8")
