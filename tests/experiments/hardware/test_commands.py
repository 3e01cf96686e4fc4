"""What the commands of robots refuse, with one line each."""

import pytest

from experiments.cli import main


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("robot pfc_panda_7r --lose 2", "--lose = 2.0; allowed: 0 to 1"),
        ("robot pfc_panda_7r --delay -1", "--delay = -1; allowed: 0 to 10000 ticks"),
        ("robot pfc_panda_7r --delay 1000000000", "--delay = 1000000000; allowed: 0 to 10000"),
        ("robot pfc_panda_7r --expire 0", "--expire = 0.0; allowed: 0.001 to 60 s"),
        ("robot pfc_panda_7r --expire 1e300", "--expire = 1e+300; allowed: 0.001 to 60 s"),
        ("robot pfc_panda_7r --damping 1e300", "--damping = 1e+300; allowed: 0 to 10000 1/s"),
        ("robot pfc_panda_7r --low-pass 1e300", "--low-pass = 1e+300; allowed: 0 to 100000 Hz"),
        ("lead teleop_path --duration 1e300", "--duration 1e300: allowed: a positive number of"),
        ("robot pfc_panda_7r --lcm nothing://", "--lcm nothing://: no such bus"),
        ("robot plate_mounting --lcm memq://", "plate = given; allowed: null where"),
        ("robot pfc_delta --lcm memq://", "robot.model = festo_expt_45; allowed: an arm"),
        ("robot vf_wedge --driver iiwa --lcm memq://", "driver iiwa: takes no VELOCITY"),
        ("drive pfc_panda_7r --driver ur5 --lcm memq://", "driver ur5: allowed: panda, iiwa"),
        ("drive pfc_panda_7r --override 3 --lcm memq://", "--override = 3.0; allowed: 0.01 to"),
        (
            "drive pfc_elastic_6r --lcm memq://",
            "controller.state = measured; allowed: from_t",
        ),
    ],
)
def test_what_is_refused(words, said, capfd, tmp_path):
    where = ["--out", str(tmp_path / "out")] if words.startswith("drive") else []
    assert main([*words.split(), *where]) == 2
    error = capfd.readouterr().err
    assert said in error
    assert not (tmp_path / "out").exists()


def test_a_robot_waits_and_says_how_it_went(capfd):
    words = "robot pfc_panda_7r --lcm memq:// --no-meshcat --duration 0.05"
    assert main(words.split()) == 0
    shown = capfd.readouterr().out
    assert "7 joints at [10.08, -9.85, 6.8, -111.09, 2.46, 100.65, 17.31] deg, TORQUE" in shown
    assert "50 ticks" in shown
    assert "0 commands" in shown
