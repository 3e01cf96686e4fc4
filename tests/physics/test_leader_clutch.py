"""A clutch between a handle and what it leads: scales, and what stays while it is open."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.leader_clutch import Clutch, ClutchParameters, TurningClutch

T = 1e-3
START = [0.9, 0.1, 1.0]
TURNED = Rotation.from_rotvec([2.0, 0.5, -0.3])


def test_a_clutch_scales_and_lets_loose():
    """While open the follower's place stays, and the handle may go back; then it goes on."""
    clutch = Stepper(Clutch(2.0, START, [ClutchParameters(0.010, 0.020)], T))
    handle = np.concatenate([np.linspace(0, 0.011, 12), np.linspace(0.01, 0.002, 9)])
    handle = np.append(handle, 0.002 + 0.001 * np.arange(1, 10))
    rows = [clutch.step(handle=[x, 0.0, 0.0]) for x in handle]
    displacement = np.array([row["position"] for row in rows]) - START
    np.testing.assert_allclose(displacement[:11, 0], 2.0 * handle[:11], atol=1e-12)
    np.testing.assert_allclose(displacement[11:21, 0], 2.0 * handle[10], atol=1e-12)
    further = handle[21:] - handle[20]
    np.testing.assert_allclose(displacement[21:, 0], 2.0 * (handle[10] + further), atol=1e-12)
    grip = np.array([row["grip"][0] for row in rows])
    assert (grip[:10] == 1.0).all()
    assert (grip[10:20] == 0.0).all()
    assert 0.0 < grip[22] < grip[29] < 1.0


def test_a_hand_at_an_open_clutch_goes_back_to_the_middle():
    """The observed position deviates from the target by the displacement of the handle."""
    clutch = Stepper(Clutch(1.0, START, [ClutchParameters(0.0, 1.0)], T))
    for _ in range(300):
        row = clutch.step(handle=[0.03, 0.0, -0.01])
    np.testing.assert_allclose(row["pose"][:3] - row["position"], [0.03, 0.0, -0.01], atol=1e-12)
    np.testing.assert_array_equal(row["pose"][3:], np.eye(3).ravel())


def test_a_person_opens_it_too():
    clutch = Stepper(Clutch(1.0, START, [], T), ("opened",))
    clutch.step(handle=[0.0, 0, 0], opened=[1.0])
    row = clutch.step(handle=[0.01, 0, 0], opened=[1.0])
    np.testing.assert_allclose(row["position"], START)
    assert row["grip"][0] == 0.0


def test_a_clutch_closes_after_it_opened():
    with pytest.raises(InputError, match="ascending"):
        ClutchParameters(2.0, 1.0)


def turns(clutch, vectors):
    """Rotations of the follower and what a hand sees, by turns of the handle."""
    rows = [clutch.step(handle=Rotation.from_rotvec(v).as_matrix().ravel()) for v in vectors]
    return [
        [Rotation.from_matrix(row[name].reshape(3, 3)) for row in rows]
        for name in ("orientation", "seen")
    ]


def test_turns_are_scaled_and_let_loose():
    """About one axis: angles are scaled; while open nothing turns, and then it goes on."""
    clutch = Stepper(TurningClutch(0.5, TURNED.as_matrix(), [ClutchParameters(0.01, 0.02)], T))
    axis = np.array([0.6, 0.0, 0.8])
    angle = np.concatenate([np.linspace(0, 0.11, 12), np.linspace(0.1, 0.02, 9), [0.12, 0.32]])
    follower, _ = turns(clutch, angle[:, None] * axis)
    turned = [(R * TURNED.inv()).as_rotvec() @ axis for R in follower]
    np.testing.assert_allclose(turned[:11], 0.5 * angle[:11], atol=1e-12)
    np.testing.assert_allclose(turned[11:21], 0.5 * angle[10], atol=1e-12)
    np.testing.assert_allclose(turned[21:], 0.5 * (angle[10] + np.array([0.1, 0.3])), atol=1e-12)


def test_with_a_scale_of_one_the_follower_turns_as_the_handle():
    """Whatever the way: R_x = R_p R_x0."""
    random = np.random.default_rng(3)
    rotations = np.cumsum(random.normal(0.0, 0.2, (40, 3)), axis=0) * 0.3
    rotations -= rotations[0]
    follower, target = turns(Stepper(TurningClutch(1.0, TURNED.as_matrix(), [], T)), rotations)
    for R, S, vector in zip(follower, target, rotations, strict=True):
        expected = (Rotation.from_rotvec(vector) * TURNED).as_matrix()
        np.testing.assert_allclose(R.as_matrix(), expected, atol=1e-12)
        np.testing.assert_allclose(S.as_matrix(), expected, atol=1e-12)


def test_a_hand_at_an_open_clutch_turns_back():
    clutch = Stepper(TurningClutch(1.0, TURNED.as_matrix(), [ClutchParameters(0.0, 1.0)], T))
    follower, target = turns(clutch, [[0.2, -0.1, 0.0]] * 300)
    np.testing.assert_allclose(
        (target[-1] * follower[-1].inv()).as_rotvec(), [0.2, -0.1, 0.0], atol=1e-9
    )
    np.testing.assert_allclose(follower[-1].as_matrix(), TURNED.as_matrix(), atol=1e-12)


def test_the_pose_that_a_hand_goes_by_has_the_orientation():
    clutch = Stepper(Clutch(1.0, START, [], T), ("orientation",))
    row = clutch.step(handle=np.zeros(3), orientation=TURNED.as_matrix().ravel())
    np.testing.assert_array_equal(row["pose"][3:], TURNED.as_matrix().ravel())
