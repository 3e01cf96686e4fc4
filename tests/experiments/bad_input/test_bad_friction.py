"""What a scenario may say about friction and observers: one line for what it may not."""

import pytest


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ("friction.source=guess", "source = guess; allowed: none, model, observer"),
        ("friction.observer=luenberger", "observer = luenberger; allowed: disturbance, kalman"),
        ("friction.velocity=filtered", "velocity = filtered; allowed: measured, reference"),
        ("friction={source: observer, velocity: reference}", "velocity = reference; allowed: m"),
        ("friction.rate=0", "rate = 0"),
        ("friction.smoothing=-1", "smoothing = -1"),
        ("friction.kalman.intervals=end", "intervals = end; allowed: mean, begin"),
        ("friction.kalman.measurement_noise=[0.0]", "measurement_noise = [0.0]"),
        ("friction.kalman.momentum_noise=[]", "momentum_noise = []"),
        ("friction.kalman.coulomb_noise=[-1.0]", "coulomb_noise = [-1.0]"),
        ("friction.kalman.start=-1", "start = -1"),
        ("friction.source=model", "friction.source = model: no nominal friction"),
        ("friction={source: model, nominal: {f_c: [1.0]}}", "nominal.f_c = [1.0]; allowed: "),
        (
            "friction.nominal={f_c: [1.0], drift: {factor: 2.0}}",
            "nominal friction does not drift",
        ),
        ("external_torque.source=observed", "bandwidth = 0.0; allowed: a positive number with"),
    ],
)
def test_of_the_controller(mine, refused, change, part):
    refused(mine(), part, changes=(f"controller.{change}",))


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (
            "friction={f_c: [1.0, 1.0, 1.0], drift: {factor: 0.0}}",
            "factor = 0.0; allowed: a pos",
        ),
        ("friction={f_c: [1.0, 1.0, 1.0], drift: {begin: 3.0}}", "begin = 3.0 s, end = 1.0 s"),
        ("compliance.source=guess", "source = guess; allowed: sensor, observed"),
        ("compliance.observed.rate=0", "rate = 0"),
        ("compliance.observed.damping=-1", "damping = -1"),
    ],
)
def test_of_the_rest(mine, refused, change, part):
    refused(mine(), part, changes=(change,))
