"""A chain with symbolic parameters against the same chain with numbers."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.robot.robot_model import MAY_BE_PARAMETRIC, gravity_function
from pfsc_drake.robot.serial.chain import ParametricChain, chain_parameters
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from tests.robot.serial.test_newton_euler import CHAINS, random_chain_plant


@pytest.fixture(params=CHAINS, name="chain")
def fixture_chain(request):
    chain, _ = chain_from_plant(*random_chain_plant(*CHAINS[request.param]))
    # every second joint is elastic
    links = [
        replace(link, stiffness=1e4 + i) if i % 2 else link for i, link in enumerate(chain.links)
    ]
    return replace(chain, links=tuple(links))


def dynamics(chain):
    """Return what the laws need of it as a function, which may have free symbols."""
    derivatives = [ca.SX.sym(f"q{k}", chain.dimension) for k in range(4)]
    torques = chain.inverse_dynamics(joint_jets(derivatives))
    results = [
        chain.mass_matrix(derivatives[0]),
        *(ca.vertcat(*[tau.derivative(k) for tau in torques]) for k in range(2)),
        ca.SX(chain.D_M),
        chain.springs,
    ]
    return ca.Function("dynamics", derivatives, [ca.densify(r) for r in results], MAY_BE_PARAMETRIC)


def test_with_the_values_of_a_chain_it_is_that_chain(chain):
    symbolic = dynamics(ParametricChain.of(chain))
    free, values = symbolic.free_sx(), chain_parameters(chain)
    of_values = ca.Function(
        "of_values", [*symbolic.sx_in(), ca.vertcat(*free)], symbolic.call(symbolic.sx_in())
    )
    q = np.random.default_rng(5).normal(size=(4, chain.dimension))
    found = of_values.call([*q, [values[symbol.name()] for symbol in free]])
    for one, other in zip(found, dynamics(chain).call(list(q)), strict=True):
        np.testing.assert_allclose(one.full(), other.full(), rtol=1e-11, atol=1e-10)


def test_which_joints_are_elastic_is_no_parameter(chain):
    symbolic = ParametricChain.of(chain)
    np.testing.assert_array_equal(symbolic.elastic_joints, chain.elastic_joints)
    assert symbolic.numeric is chain
    np.testing.assert_array_equal(symbolic.gather("effort_limit"), chain.gather("effort_limit"))
    with pytest.raises(TypeError, match="stiffness: a symbolic parameter"):
        symbolic.gather("stiffness")
    with pytest.raises(RuntimeError, match="free"):
        gravity_function(symbolic)
