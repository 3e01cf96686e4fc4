"""A law on a robot, composed of its functions, against the interpreter."""

import casadi as ca
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.blocks.linear_algebra import solve
from pfsc_drake.control.law.laws import RELATIVE_DEGREE, ActuationOptions
from pfsc_drake.control.law.linearization import linearize
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from tests.compiled.interpreter import SPECIAL, assert_same_bits, both


def tick():
    """Two ticks of an elastic law, with a table and two switches."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_elastic_3r")))
    plant.Finalize()
    robot, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    r, n = RELATIVE_DEGREE["elastic"], robot.dimension
    linearization = linearize(
        robot, "elastic", PathManifold(r, oriented=False), ActuationOptions(1e-3)
    )
    m, law = linearization.num_outputs, linearization.function
    A, rhs = ca.SX.sym("A", m, n), ca.SX.sym("rhs", m)
    inverse = ca.Function("inverse", [A, rhs], [ca.densify(x) for x in solve(A, rhs)])
    symbols = [ca.MX.sym(law.name_in(i), law.sparsity_in(i)) for i in range(law.n_in())]
    state, *others = symbols
    v, before, results = ca.MX.sym("v", m), ca.MX.sym("before", n), []
    last = before
    table = ca.DM(np.linspace(0.0, 2.0, 120))
    for _ in range(2):
        _, A, b, gain, drift, offset, _ = law(state, *others)
        x, rcond = inverse(A, v - b)
        speed = state[n : 2 * n]
        found_index = ca.low(table, ca.norm_2(speed))
        base_value = gain @ x + drift
        lead = ca.if_else(found_index > 60.0, 0.5, 0.0)
        command = (
            base_value
            + lead * (base_value - last)
            + offset
            + ca.sin(ca.MX(table)[found_index] * speed)
        )
        drive = ca.fmin(ca.fmax(command, -100.0), 100.0)
        results.append(ca.if_else(rcond > 1e-12, drive, ca.MX.zeros(n), True))
        state, last = 0.999 * state, results[-1]
    return ca.Function("tick", [*symbols, v, before], results)


def test_law():
    function, rng = tick(), np.random.default_rng(0)
    for k in range(30):
        values = [rng.normal(size=function.nnz_in(i)) for i in range(function.n_in())]
        if k % 3:
            values = [
                np.where(rng.uniform(size=v.size) < 0.02, rng.choice(SPECIAL), v) for v in values
            ]
        actual, expected = both(function, *values)
        assert_same_bits(actual, expected)
        assert k % 3 or np.isfinite(expected).all()
