"""The scripts that users copy: each runs as it stands."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_examples_run_and_say_something(script, tmp_path):
    ended = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.strip()


def test_examples_import_nothing_of_the_project_around_the_library():
    for script in EXAMPLES:
        text = script.read_text(encoding="utf-8")
        for room in ("diagrams", "experiments", "identification", "reporting", "tests"):
            assert f"from {room}" not in text
            assert f"import {room}" not in text
