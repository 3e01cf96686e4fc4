"""Blocks, stepped by hand, alone and wired, against recurrences written out."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.network import Network, Wiring
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError


class Lag(Block):
    """``y = x``, ``x+ = x + s (u - x) + b``, from the first input on."""

    def __init__(self, share=0.25):
        self.share = share
        self.inputs = {"value": Port(2, "m"), "bias": Port(2, optional=True)}
        self.outputs = {"lagged": Port(2, "m"), "rate": Port(2)}
        self.states = {"value": 2}

    def initial(self, u, t):
        return {"value": u.value}

    def output(self, x, u, t):
        return {"lagged": x.value, "rate": self.share * (u.value - x.value)}

    def update(self, x, u, y, t):
        return {"value": x.value + y.rate + (0.0 if u.bias is None else u.bias)}


class Clock(Block):
    """``y = 10 t + u``, with a count of its evaluations."""

    def __init__(self):
        self.inputs, self.outputs, self.states = {"u": Port(1)}, {"y": Port(1)}, {"asked": 1}

    def output(self, x, u, t):
        return {"y": 10.0 * t + u.u}

    def update(self, x, u, y, t):
        return {"asked": x.asked + 1.0}


class Part(Block):
    """``y = u_i``."""

    def __init__(self, size, index):
        self.inputs, self.outputs, self.states = {"u": Port(size)}, {"y": Port(1)}, {}
        self.index = index

    def output(self, x, u, t):
        return {"y": u.u[self.index]}


class Square(Block):
    """``y = x``, ``x+ = z + 1`` with ``z = u^2``, which output finds and does not put out."""

    inputs, outputs, states, inner = {"u": Port(1)}, {"y": Port(1)}, {"x": 1}, {"z": 1}

    def output(self, x, u, t):
        return {"y": x.x, "z": u.u**2}

    def update(self, x, u, y, t):
        return {"x": y.z + 1.0}


def test_a_block_calculates_on_numbers():
    out = Lag().output(Values(value=ca.DM([1.0, 2.0])), Values(value=ca.DM([3.0, 6.0])), 0)
    np.testing.assert_array_equal(out["rate"].full().ravel(), [0.5, 1.0])


def test_steps_follow_the_recurrence():
    stepper, x = Stepper(Lag(), ("bias",)), np.array([1.0, -1.0])
    for k in range(5):
        u, b = np.array([1.0 + k, -1.0]), np.array([0.0, 0.5])
        out = stepper.step(value=u, bias=b)
        np.testing.assert_array_equal(out["lagged"], x)
        np.testing.assert_array_equal(out["rate"], 0.25 * (u - x))
        x = x + 0.25 * (u - x) + b
    np.testing.assert_array_equal(stepper.states["value"], x)


def test_what_is_not_connected_is_no_input():
    network = Network.of(Lag(), ("bias",))
    assert list(network.inputs) == ["value"]
    assert [node.results for node in network.nodes] == [("lagged",), ("rate",)]


def test_outputs_need_what_their_expressions_have():
    program = Program(Network.of(Lag()))
    needs = {name: program.stages[program.output(name)[0]].needs for name in ("lagged", "rate")}
    assert needs["lagged"] == frozenset()
    assert [source.name for source in needs["rate"]] == ["value"]
    # before the start the state is what the inputs say
    assert [s.name for s in program.stages[program.output("lagged")[0]].needs_at_start] == ["value"]


def wired():
    """Return a lag whose rate is lagged again, fed back into the first one's bias."""
    wiring = Wiring(
        {"one": Network.of(Lag(0.5)), "two": Network.of(Lag(0.25), ("bias",))},
        {
            ("one", "value"): "u",
            ("one", "bias"): ("two", "lagged"),
            ("two", "value"): ("one", "rate"),
        },
        {"slow": ("two", "lagged"), "rate": ("two", "rate")},
    )
    return wiring.network()


def test_a_loop_of_blocks_is_one_block():
    stepper, one, two = Stepper(wired()), np.array([1.0, 2.0]), np.zeros(2)
    for k in range(6):
        u = np.array([1.0 + k, 2.0 - k * k])
        rate = 0.5 * (u - one)
        out = stepper.step(u=u)
        np.testing.assert_array_equal(out["slow"], two)
        np.testing.assert_array_equal(out["rate"], 0.25 * (rate - two))
        one, two = one + rate + two, two + 0.25 * (rate - two)
    np.testing.assert_array_equal(stepper.states["one.value"], one)


def test_starts_follow_the_wires():
    """The second starts from the rate that the first has at its own start, which is none."""
    stepper = Stepper(wired())
    stepper.start(u=[3.0, 4.0])
    np.testing.assert_array_equal(stepper.states["one.value"], [3.0, 4.0])
    np.testing.assert_array_equal(stepper.states["two.value"], [0.0, 0.0])


def test_time_is_counted_in_ticks():
    stepper = Stepper(Clock())
    assert [stepper.step(u=1.0)["y"][0] for _ in range(3)] == [1.0, 11.0, 21.0]
    assert stepper.states["asked"][0] == 3.0


def test_a_later_start_knows_its_tick():
    class Late(Clock):
        def initial(self, u, t):
            return {"asked": t}

    stepper = Stepper(Late())
    for _ in range(3):
        stepper.step(u=0.0)
    stepper.start()
    assert stepper.states["asked"][0] == 3.0


def test_ports_of_a_whole_have_the_units_of_their_parts():
    network = wired()
    assert network.units == {"slow": "m", "rate": ""}
    assert network.inputs["u"].unit == "m"


def test_stages_share_what_they_evaluate():
    """Each block's function is called once in all stages and the update together."""
    program = Program(wired())
    calls = [
        function.instruction_MX(k).which_function().name()
        for function in [*(stage.function for stage in program.stages), program.update]
        for k in range(function.n_instructions())
        if function.instruction_id(k) == ca.OP_CALL
    ]
    assert sorted(calls) == 2 * ["Lag_output_0"] + 2 * ["Lag_output_1"] + 2 * ["Lag_update_0"]


def test_inner_values_reach_the_update_and_no_output():
    stepper = Stepper(Square())
    outs = [stepper.step(u=float(u)) for u in range(4)]
    assert [set(out) for out in outs] == 4 * [{"y"}]
    assert [out["y"][0] for out in outs] == [0.0, 1.0, 2.0, 5.0]
    # an inner value is no part of the outputs' feedthrough
    program = Program(Network.of(Square()))
    assert not program.stages[program.output("y")[0]].needs
    assert not program.update_inputs


def test_algebraic_loops_are_named():
    wiring = Wiring(
        {"one": Network.of(Part(1, 0)), "two": Network.of(Part(1, 0))},
        {("one", "u"): ("two", "y"), ("two", "u"): ("one", "y")},
        {"y": ("one", "y")},
    )
    with pytest.raises(InputError, match=r"algebraic loop .*one.y -> two.y"):
        Program(wiring.network())


def test_blocks_that_break_their_word_are_refused():
    class Wrong(Lag):
        def output(self, x, u, t):
            return {"lagged": x.value, "speed": x.value}

    class Short(Lag):
        def output(self, x, u, t):
            return {"lagged": x.value[0], "rate": x.value}

    class Silent(Lag):
        def output(self, x, u, t):
            return {"lagged": x.value}

    for block, message in ((Wrong(), "'speed'"), (Short(), "lagged is"), (Silent(), "rate not")):
        with pytest.raises(ValueError, match=message):
            Network.of(block)


def test_wrong_inputs_are_refused():
    stepper = Stepper(Lag())
    with pytest.raises(InputError, match="input value: 3 numbers; must be 2"):
        stepper.step(value=[1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="must be value"):
        stepper.step(velocity=[1.0, 2.0])


def test_unfed_inputs_are_named():
    with pytest.raises(ValueError, match=r"one.bias: nothing is connected"):
        Wiring({"one": Network.of(Lag())}, {("one", "value"): "u"}).network()


def test_what_is_remembered_is_evaluated_with_the_stage_that_needs_as_much():
    """One function instead of two; a lag's bias is needed by its update alone."""
    assert Program(Network.of(Lag())).update_stage is None
    program = Program(Network.of(Square()))
    k = program.update_stage
    assert k is not None
    joined, stage = program.with_update(k).function, program.stages[k].function
    numbers = {"x": ca.DM(0.5), "t": ca.DM(3.0), "u": ca.DM(1.7)}

    def value(function):
        return function(*(numbers[name] for name in function.name_in())).full().ravel()

    numbers[f"stage_{k}"] = ca.DM(value(stage))
    later = value(program.update)
    np.testing.assert_array_equal(later, [1.7**2 + 1.0])
    np.testing.assert_array_equal(value(joined), [*value(stage), *later])


def test_a_network_without_what_some_outputs_do_not_need():
    """Two lags side by side, and a clock that only one of them is fed by."""
    wiring = Wiring(
        {"lag": Network.of(Lag(0.5), ["bias"]), "other": Network.of(Lag(0.25), ["bias"])},
        {("lag", "value"): "value", ("other", "value"): ("lag", "rate")},
        {"far": ("other", "lagged"), "near": ("lag", "lagged")},
    )
    whole = wiring.network()
    near = whole.subnetwork(["near"])
    assert set(near.states) == {"lag.value"} and list(near.outputs) == ["near"]
    far = whole.subnetwork(["far", "near"])
    assert set(far.states) == {"lag.value", "other.value"} and list(far.outputs) == ["far", "near"]
    steppers = [Stepper(network) for network in (whole, near, far)]
    for k in range(4):
        rows = [stepper.step(value=np.array([1.0 + k, -2.0])) for stepper in steppers]
        for row in rows[1:]:
            for name, value in row.items():
                np.testing.assert_array_equal(value, rows[0][name])
