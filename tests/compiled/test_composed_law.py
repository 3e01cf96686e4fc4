"""A law on a robot, composed of its functions, against the interpreter."""

import casadi as ca
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.control.law.law_functions import completion_function, law_function
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE, ActuationOptions, linearize
from pfsc_drake.control.law.stabilization import Stabilization, gains_from_poles
from pfsc_drake.control.linear_algebra import solve
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from tests.compiled.interpreter import SPECIAL, assert_same_bits, both


def tick():
    """Two ticks of the elastic law, with a table for the gains of the drives' friction."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_elastic_3r")))
    plant.Finalize()
    robot, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    r, n = RELATIVE_DEGREE["elastic"], robot.dimension
    linearization = linearize(
        robot, "elastic", PathManifold(r, oriented=False), ActuationOptions(1e-3)
    )
    m = linearization.num_outputs
    gains = [gains_from_poles([-50.0] * r)] * m
    stabilization = Stabilization(gains, r, ["eta", "xi_1", "xi_2"])
    law = law_function(robot, linearization, stabilization, None)
    completion = completion_function(linearization, np.full(n, 100.0))
    A, rhs = ca.SX.sym("A", m, n), ca.SX.sym("rhs", m)
    inverse = ca.Function("inverse", [A, rhs], [ca.densify(x) for x in solve(A, rhs)])
    given = {name: ca.MX.sym(name, law.sparsity_in(name)) for name in law.name_in()}
    table = ca.DM(np.linspace(0.0, 2.0, 120))
    held, results = ca.MX.sym("held", n), []
    for state in (given["state"], 0.999 * given["state"]):
        wanted = law(**given | {"state": state})
        x, rcond = inverse(wanted["A"], wanted["rhs"])
        place = ca.low(table, ca.norm_2(state[n : 2 * n]))
        done = completion(
            solution=x,
            friction=ca.sin(ca.MX(table)[place] * state[n : 2 * n]),
            last_held=results[-1][:n] if results else held,
            lead=ca.if_else(place > 60.0, 0.5, 0.0),
            rcond=rcond,
            state=state,
            tau_ext=given["tau_ext"],
            **{name: wanted[name] for name in ("gain", "drift", "offset", "Y", "v")},
        )
        safe = ca.if_else(
            done["check"] < 1e6, done["result"], ca.MX.zeros(done["result"].shape), True
        )
        results.append(safe)
    return ca.Function("tick", [*given.values(), held], results)


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
