"""A path on a surface through the command line: feed, height and side step are coordinates."""

import numpy as np
import pytest

from pfsc_drake.geometry import angle_between

NAME = "pfc_on_surface_6r"
CONVERGED = 0.4
GAINS = "controller.gains.rigid={eta: {poles: [-50, -50]}, xi: {poles: [-50, -50]}, "
RIGID = [
    "robot.model=comau_racer_1_4",
    "controller.law=rigid",
    GAINS + "phi: {poles: [-50, -50]}}",
]


@pytest.fixture(name="on_surface", scope="module")
def fixture_on_surface(tmp_path_factory, run_scenario):
    """Return a function that runs the shipped scenario, shortened, once."""
    made = {}

    def get(*changes, duration="1.0"):
        if (changes, duration) not in made:
            out = tmp_path_factory.mktemp("on_surface") / "out"
            arguments = [part for change in changes for part in ("--set", change)]
            made[changes, duration] = run_scenario(out, NAME, "--duration", duration, *arguments)
        return made[changes, duration]

    return get


def height_and_normal(y_t):
    """Height above the dish z = 0.95 + 0.5 ((x - 0.85)^2 + y^2), and the normal at the foot."""
    x, y, z = (y_t - [0.85, 0.0, 0.95]).T
    a, b = x, y
    for _ in range(20):
        # the foot is where (x - a, y - b, z - h) is parallel to the normal (-a, -b, 1)
        rise = z - 0.5 * (a**2 + b**2)
        a, b = x / (1.0 - rise), y / (1.0 - rise)
    normal = np.stack([-a, -b, np.ones_like(a)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    away = np.stack([x - a, y - b, z - 0.5 * (a**2 + b**2)], axis=1)
    return np.sum(away * normal, axis=1), normal, (a, b)


def test_the_path_is_followed_on_the_dish(on_surface):
    run = on_surface()
    assert run.status == 0
    assert run["xi"].shape == (len(run.t), 2)
    np.testing.assert_allclose(run["xi"][0], [0.010, -0.005], atol=1e-9)
    late = run.after(CONVERGED)
    assert np.abs(run["xi"][late]).max() < 1e-6
    assert run["eta_dot"][-1] == pytest.approx(0.3, abs=1e-3)
    height, normal, (a, _) = height_and_normal(run["y_t"][late])
    assert np.abs(height).max() < 1e-6
    # the tool turns with first tangent and normal: both are constant in its frame
    first = np.stack([np.ones_like(a), 0.0 * a, a], axis=1)
    R_e = run["R_e"].reshape(-1, 3, 3)[late]
    for direction in (normal, first / np.linalg.norm(first, axis=1, keepdims=True)):
        seen = np.einsum("nij,ni->nj", R_e, direction)
        np.testing.assert_allclose(seen, np.broadcast_to(seen[-1], seen.shape), atol=1e-5)
    assert angle_between(normal[0], normal[-1]) > 0.1
    targets = [m for m in run.metrics.values() if m.get("target")]
    assert len(targets) == 3
    assert all(metric["value"] < float(metric["target"].split()[1]) for metric in targets)


@pytest.mark.slow
def test_height_and_side_step_are_apart(on_surface):
    """A tool above the curve converges along the normal and leaves it alone sideways."""
    run = on_surface("start.offset=[0.02, 0.0]", "start.rotation_deg=[0, 0, 0]", duration="0.3")
    assert run["xi"][0, 0] == pytest.approx(0.02, abs=1e-9)
    assert np.abs(run["xi"][:, 1]).max() < 1e-6
    assert np.abs(run["xi"][-1, 0]) < 1e-4
    height, _, _ = height_and_normal(run["y_t"])
    np.testing.assert_allclose(height[:50], run["xi"][:50, 0], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("orientation", "angles"),
    [("{kind: given, angles_deg: [180, -60, 0]}", 3), ("{kind: normal, task: tool_axis, "
     "angles_deg: [180, -60, 0]}", 2), ("{kind: none}", 0)],
)  # fmt: skip
def test_orientations(on_surface, orientation, angles):
    posture = [] if angles == 3 else ["controller.posture={stiffness: 64, damping: 16, inertia: 1}"]
    changes = [*RIGID, f"surface.orientation={orientation}", *posture]
    run = on_surface(*changes, duration="0.6")
    assert run.status == 0
    late = run.after(0.5)
    assert np.abs(run["xi"][late]).max() < 1e-5
    assert ("phi" in run.log) == bool(angles)
    if angles:
        assert run["phi"].shape == (len(run.t), angles)
        assert np.abs(run["phi"][late]).max() < 1e-5


@pytest.mark.slow
def test_a_point_that_moves_with_time(on_surface):
    run = on_surface(*RIGID, "controller.manifold=trajectory", "start.transition=0", duration="0.6")
    assert run.status == 0
    assert np.linalg.norm(run["tracking_error"][run.after(0.5)], axis=1).max() < 1e-5


@pytest.mark.slow
def test_points_of_a_file(tmp_path, mine, run_scenario):
    x = np.linspace(-0.1, 0.1, 12)
    points = np.stack([0.85 + x, 2.0 * x, 0.95 + 0.5 * (5.0 * x**2) + 2e-4], axis=1)
    lines = [",".join(map(repr, row)) for row in points.tolist()]
    (tmp_path / "points.csv").write_text("\n".join(["x,y,z", *lines]) + "\n", encoding="utf-8")
    change = "path.shape=!OnSurface {file: points.csv}"
    more = ("--set", "reference.points=[0.05, 0.2]", "--duration", "0.02")
    run = run_scenario(tmp_path / "out", mine(NAME), "--set", change, *more)
    assert run.status == 0
    assert run.metrics["path_length"]["value"] == pytest.approx(0.4500, rel=0.01)
    copy = tmp_path / "out" / "scenario.yaml"
    assert str(tmp_path / "points.csv") in copy.read_text(encoding="utf-8")
