"""A run whose arm is pushed at a link: log, metrics, figures and recording, and wrong input."""

import numpy as np
import pytest

PUSHES = (
    "forces=[{begin: 0.05, end: 0.15, force: [0, 60, 0], ramp: 0.02, link: link_3, point: [0, 0, "
    "0.1]}]",
    "pushes=[{link: link_4, way: [0, 0.1, 0], begin: 0.02, duration: 0.05, grip_ramp: 0.05}]",
)


def changes(*pairs):
    return [argument for pair in pairs for argument in ("--set", pair)]


@pytest.mark.slow
def test_everything_that_a_run_tells(tmp_path, run_scenario):
    done = run_scenario(
        tmp_path / "out",
        "pfc_comau_6r",
        "--duration",
        "0.2",
        *changes(*PUSHES, "controller.external_torque.source=known"),
        complete=True,
    )
    assert done.status == 0
    assert done["push_force"].shape == done["push_point"].shape == (len(done.t), 6)
    assert done.marks["push_force"]["labels"].tolist()[:2] == ["link_3 x", "link_3 y"]
    assert np.array_equal(done["elbow"], done["push_point"][:, :3])
    assert np.abs(done["tau_ext"][:, :3]).max() > 10.0
    # what is beyond link 4 does not feel it
    assert np.abs(done["tau_ext"][:, 4:]).max() < 1e-9
    assert done.metrics["largest_push"]["value"] == pytest.approx(60.0)
    assert 1e-4 < done.metrics["elbow_travel"]["value"] < 0.1
    assert (done.folder / "figures" / "pushes.png").exists()
    page = (done.folder / "recording.html").read_text(encoding="utf-8")
    assert "</html>" in page


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ("forces=[{link: elbow}]", ("forces[0].link = 'elbow'", "allowed: link_1, link_2")),
        ("pushes=[{way: [0, 1, 0]}]", ("pushes[0].link = ''", "allowed: link_1")),
        ("pushes=[{link: link_2, way: [0, 1]}]", ("pushes[0]", "way", "3")),
        ("pushes=[{link: link_2, wy: [0, 1, 0]}]", ("wy", "did you mean 'way'")),
        ("forces=[{point: [0, 1, 0]}]", ("forces[0]", "point", "without a link")),
    ],
)
def test_wrong_pushes(refused, change, parts):
    refused("pfc_comau_6r", *parts, changes=[change])
