"""Exact derivatives of blocks against closed forms and against differences of the whole step."""

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port
from pfsc_drake.blocks.cases import where
from pfsc_drake.blocks.network import Network, Source, Wiring
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.blocks.slope import NetworkSlope


class Pendulum(Block):
    """``y = sin(x) u``, ``x+ = x + y cos(x)``, a constant state, and an unused one."""

    inputs, outputs, states = {"u": Port(1)}, {"y": Port(1)}, {"x": 1, "kept": 1, "unheard": 1}

    def output(self, x, u, t):
        return {"y": ca.sin(x.x) * u.u + x.kept}

    def update(self, x, u, y, t):
        return {"x": x.x + y.y * ca.cos(x.x), "unheard": y.y + x.unheard}


class Cornered(Block):
    """A length, and a quotient where it is not taken."""

    inputs, outputs, states = {"u": Port(2)}, {"y": Port(2)}, {"late": 1}

    def output(self, x, u, t):
        quotient = where(u.u[0] > 1.0, x.late / u.u[0], 3.0 * u.u[1])
        return {"y": ca.vertcat(ca.norm_2(u.u), quotient)}


def pendulums():
    wiring = Wiring({"one": Network.of(Pendulum()), "two": Network.of(Pendulum())})
    wiring.connections = {("one", "u"): "u", ("two", "u"): ("one", "y")}
    wiring.outputs = {"y": ("two", "y")}
    return wiring.network()


X = {"one.x": 0.3, "one.kept": 0.2, "one.unheard": 9.0}
X |= {"two.x": -0.8, "two.kept": 0.1, "two.unheard": 7.0}
X = {name: np.array([value]) for name, value in X.items()}
U = {"u": np.array([1.7])}


def test_the_derivative_is_that_of_the_whole_step():
    network = pendulums()
    at = NetworkSlope(network).at(X, U, 0)
    states = list(network.states)
    found = at.derivatives(states, ["two.y"])
    step = Program(network).step()

    def whole(z):
        return np.concatenate([r.full().ravel() for r in step(z[:6], 0, z[6:])])

    z = np.concatenate([*X.values(), U["u"]])
    np.testing.assert_allclose(at.wire("two.y"), whole(z)[6:], rtol=1e-15)
    sources = [Source("state", name) for name in states] + [Source("input", "u")]
    for k, source in enumerate(sources):
        shift = 1e-5 * np.eye(7)[k]
        expected = (whole(z + shift) - whole(z - shift)) / 2e-5
        np.testing.assert_allclose(
            found.get(source, np.zeros((7, 1)))[:, 0], expected, rtol=1e-9, atol=1e-9
        )


def test_what_an_output_depends_on_sooner_or_later():
    at = NetworkSlope(pendulums()).at(X, U, 0)
    states_found = {"one.x", "one.kept", "two.x", "two.kept"}
    assert set(at.reaching(["two.y"])) == states_found
    assert set(at.reaching(["one.y"])) == {"one.x", "one.kept"}


def test_where_calculus_has_no_answer():
    """A length at zero has no slope either way; a case that does not hold takes no part."""
    slope = NetworkSlope(Network.of(Cornered()))
    found = slope.at({"late": np.array([2.0])}, {"u": np.zeros(2)}, 0).derivatives([], ["y"])
    np.testing.assert_allclose(found[Source("input", "u")], [[0, 0], [0, 3]], atol=1e-9)
    assert not found.get(Source("state", "late"), np.zeros(1)).any()
