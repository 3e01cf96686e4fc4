"""Numbers of the command line that nobody means."""

import pytest

from experiments.cli import main


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("run pfc_delta --duration 1e300", "--duration 1e300: allowed: a positive number of"),
        ("run pfc_delta --duration inf", "--duration inf: allowed: a positive number of seconds"),
        ("export pfc_delta --duration 1e300", "at most 600 s"),
        ("margins pfc_delta --tool 1e300", "--tool 1e+300: allowed: 0 to 10000 kg"),
        ("sweep pfc_delta --vary duration=1,2 --seed -1", "--seed"),
    ],
)
def test_what_is_refused(words, said, capfd, tmp_path):
    assert main([*words.split(), "--out", str(tmp_path / "out")]) == 2
    error = capfd.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
