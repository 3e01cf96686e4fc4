"""The study of path following beside its peers, shrunk."""

import json

import pytest

from experiments.studies.peers.contestants import CONTESTANTS
from experiments.studies.peers.study import write_peers


@pytest.mark.slow
def test_a_push_before_anything_moves(tmp_path):
    """0.3 s of it: who is stiffer gives way less."""
    push = ("forces=[{begin: 0, end: 0.6, ramp: 0.1, frame: manifold, force: [0, 20, 0]}]",)
    lines = []
    report = write_peers(tmp_path, lines.append, {"pushed": push}, duration=0.3)
    assert report.problem is None
    assert len(lines) == len(CONTESTANTS)
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    moved = [metrics[f"{name}, pushed: largest deviation"]["value"] for name in CONTESTANTS]
    following, observed, yields, tracking, _, soft, stiff, slow, integral, fast = moved
    assert observed < following < stiff < soft
    assert yields < 1.1 * observed  # nothing yields before its sensor is tared
    assert abs(tracking - following) < 1e-3 * following  # at rest they are the same law
    assert integral < slow == fast
    assert (tmp_path / "figures" / "peers.png").stat().st_size > 10_000
    assert "impedance, 600 N/m" in (tmp_path / "report.html").read_text(encoding="utf-8")
