"""Surface following through the command line: what a user of a run relies on."""

import base64
import operator
import re

import numpy as np
import pytest

from tests.experiments import scanned_panel

SHORT = {
    "sfc_viscoelastic_3r": ("1.5", 0.6),
    "sfc_elastic_6r": ("1.2", 0.4),
    "sfc_delta_cylinder": ("1.5", 0.5),
    "sfc_comau_paraboloid": ("1.5", 0.9),
    "sfc_scan": ("1.4", 0.4),
}
# z = 0.5 (x^2 + y^2) instead of a spline, of which tests know the closed form
DISH = (
    "surface.shape=!Paraboloid {origin: [0.85, 0, 0.95], first: [-0.25, 0.25], "
    "second: [-0.4, 0.4], coefficient: 0.5}"
)
COORDINATES = {"sfc_viscoelastic_3r": 0, "sfc_delta_cylinder": 0}


@pytest.fixture(name="surface_run", scope="module")
def fixture_surface_run(tmp_path_factory, run_scenario):
    """Return a function that runs a shipped scenario, shortened, once."""
    made = {}

    def get(name, *changes, complete=False):
        if (name, changes) not in made:
            out = tmp_path_factory.mktemp("surface") / "out"
            overrides = [part for change in changes for part in ("--set", change)]
            arguments = ("--duration", SHORT[name][0], *overrides)
            made[name, changes] = run_scenario(out, name, *arguments, complete=complete)
        return made[name, changes]

    return get


@pytest.mark.slow
@pytest.mark.parametrize("name", SHORT)
def test_signals_and_targets(surface_run, name):
    run = surface_run(name, complete=name == "sfc_scan")
    assert run.status == 0
    samples = len(run.t)
    shapes = {"eta": 2, "eta_dot": 2, "theta": 2, "xi": 1, "xi_dot": 1, "eta_p": 2, "xi_p": 1}
    for signal, dimension in shapes.items():
        assert run[signal].shape == (samples, dimension), signal
        assert np.isfinite(run[signal]).all(), signal
    angles = COORDINATES.get(name, 3)
    assert ("phi" in run.log) == bool(angles)
    if angles:
        assert run["phi"].shape == (samples, angles)
    missed = {
        key: metric["value"]
        for key, metric in run.metrics.items()
        if metric.get("target") and not _met(metric)
    }
    assert not missed
    assert run.metrics["surface_area"]["value"] > 0.0


def _met(metric):
    sign, number = metric["target"].split()
    compare = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}[sign]
    return compare(metric["value"], float(number))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "bound"),
    [("sfc_viscoelastic_3r", 5e-6), ("sfc_elastic_6r", 2e-6), ("sfc_scan", 2e-6)],
)
def test_exact_laws_follow_to_micrometres(surface_run, name, bound):
    run = surface_run(name)
    late = run.after(SHORT[name][1])
    assert np.abs(run["xi"][late]).max() < bound
    assert np.abs(run["eta"] - run["eta_p"])[late].max() < 20.0 * bound


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sfc_viscoelastic_3r", "sfc_elastic_6r", "sfc_delta_cylinder"])
def test_the_coordinates_are_those_of_the_tool(surface_run, name):
    """The distance of y_t from the closed form of the surface is |xi|."""
    run = surface_run(name, *([DISH] if name == "sfc_elastic_6r" else []))
    x, _, z = run["y_t"].T
    xi = run["xi"][:, 0]
    if name == "sfc_delta_cylinder":
        # inward: positive on the side of the axis
        np.testing.assert_allclose(xi, 0.09 - np.hypot(x, z - 0.505), rtol=0, atol=1e-9)
        return
    origin, c = (([0.7, 0, 1.11], 1.667), ([0.85, 0, 0.95], 0.5))[name == "sfc_elastic_6r"]
    a, b = run["theta"].T
    normal = np.stack([-2.0 * c * a, -2.0 * c * b, np.ones_like(a)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    foot = np.stack([a, b, c * (a**2 + b**2)], axis=1) + origin
    np.testing.assert_allclose(foot + xi[:, None] * normal, run["y_t"], rtol=0, atol=1e-9)


@pytest.mark.slow
def test_the_normal_is_kept(surface_run):
    """The tool leads by 60 deg: its frame is that of tangents and normal, turned by a constant."""
    run = surface_run("sfc_elastic_6r", DISH)
    late = run.after(0.4)
    a, b = run["theta"][late].T
    first = np.stack([np.ones_like(a), 0.0 * a, a], axis=1)  # of z = 0.5 (a^2 + b^2)
    normal = np.stack([-a, -b, np.ones_like(a)], axis=1)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    frame = np.stack([first, np.cross(normal, first), normal], axis=2)
    turned = np.swapaxes(frame, 1, 2) @ run["R_e"].reshape(-1, 3, 3)[late]
    assert np.abs(a).max() > 0.1
    np.testing.assert_allclose(turned, np.broadcast_to(turned[-1], turned.shape), atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [True, False])
def test_the_delta_robot_with_and_without_friction(surface_run, friction):
    run = surface_run("sfc_delta_cylinder", *([] if friction else ["drive_friction=false"]))
    late = run.after(0.5)
    largest = np.abs(run["xi"][late]).max()
    assert largest < (1e-3 if friction else 0.05e-3)
    assert ("tau_f" in run.log) == friction
    assert run["eta"][late].max() > 0.15


@pytest.mark.slow
def test_a_hand_leads_the_tool_over_the_paraboloid(surface_run):
    run = surface_run("sfc_comau_paraboloid")
    assert run["manifold_force"].shape == (len(run.t), 6)
    assert list(run.marks["manifold_force"]["labels"])[:3] == ["tau_par_1", "tau_par_2", "tau_perp"]
    assert run["eta"][-1, 0] > 1e-3  # towards theta_1 = 0.07
    np.testing.assert_allclose(run["xi"], run["xi_p"], atol=1e-3)


@pytest.mark.slow
def test_the_scanned_panel_is_followed_within_the_scans_noise(surface_run):
    run = surface_run("sfc_scan", complete=True)
    late = run.after(SHORT["sfc_scan"][1])
    from_truth = scanned_panel.distance(run["y_t"][late])
    assert np.abs(from_truth).max() < scanned_panel.NOISE
    assert np.sqrt(np.mean(from_truth**2)) < 0.5 * scanned_panel.NOISE
    rms, largest = (run.metrics[f"surface_fit_{key}"]["value"] for key in ("rms", "max"))
    assert rms == pytest.approx(scanned_panel.NOISE, rel=0.1)
    assert rms < largest < 5.0 * scanned_panel.NOISE


@pytest.mark.slow
def test_what_a_run_on_a_surface_leaves(surface_run):
    run = surface_run("sfc_scan", complete=True)
    names = {path.stem for path in (run.folder / "figures").iterdir()}
    assert {"path", "surface_fit", "progress", "transversal", "orientation"} <= names
    page = (run.folder / "report.html").read_text(encoding="utf-8")
    assert "surface_fit_rms" in page
    assert "Points and the surface fitted to them" in page
    recording = (run.folder / "recording.html").read_text(encoding="utf-8")
    drawn = b"".join(map(base64.b64decode, re.findall(r"base64,([A-Za-z0-9+/=]{40,})", recording)))
    assert b"surface_following/skin" in drawn
    assert "fitting a surface to 2000 points" in run.stdout
    resolved = (run.folder / "scenario.yaml").read_text(encoding="utf-8")
    assert "/surfaces/scanned_panel.csv" in resolved
