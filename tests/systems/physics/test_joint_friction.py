"""Friction in front of a slide in Drake, against closed forms."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput, MatrixGain

from pfsc_drake.physics.friction import BristleFriction, FrictionDrift, bristles_for_step
from pfsc_drake.systems.physics.joint_friction import JointFriction

STEP = 1e-3
MASS = 1.5
F_C, F_V = 5.0, 12.0


class Force(LeafSystem):
    """A force that depends on time and on the slide's state ``[x, v]``."""

    def __init__(self, law):
        super().__init__()
        state = self.DeclareVectorInputPort("state", 2)

        def calc(context, output):
            output[0] = law(context.get_time(), *state.Eval(context))

        self.DeclareVectorOutputPort("force", 1, calc)


class Slide:
    """A mass with friction under a force; ``time_step`` 0 is a continuous plant."""

    def __init__(
        self,
        law,
        coulomb=F_C,
        viscous=0.0,
        mass=MASS,
        gravity=0.0,
        time_step=0.0,
        step=STEP,
        frequency=1.0,
        integrator="runge_kutta3",
    ):
        builder = DiagramBuilder()
        self.plant = builder.AddSystem(MultibodyPlant(time_step))
        if time_step:
            self.plant.SetUseSampledOutputPorts(False)
        inertia = SpatialInertia(mass, np.zeros(3), UnitInertia.SolidSphere(0.1))
        body = self.plant.AddRigidBody("block", inertia)
        frame = self.plant.world_frame()
        slide = PrismaticJoint("slide", frame, body.body_frame(), [1.0, 0.0, 0.0])
        self.plant.AddJointActuator("drive", self.plant.AddJoint(slide))
        self.plant.mutable_gravity_field().set_gravity_vector([gravity, 0.0, 0.0])
        self.plant.Finalize()
        self.law = bristles_for_step(
            [coulomb], [viscous], [mass], max(step, time_step), frequency=frequency
        )
        self.friction = builder.AddSystem(JointFriction(self.law))
        force = builder.AddSystem(Force(law))
        velocity = builder.AddSystem(MatrixGain(np.array([[0.0, 1.0]])))
        state = self.plant.get_state_output_port()
        builder.Connect(state, force.get_input_port())
        builder.Connect(state, velocity.get_input_port())
        builder.Connect(velocity.get_output_port(), self.friction.GetInputPort("velocity"))
        builder.Connect(force.get_output_port(), self.plant.get_actuation_input_port())
        resistance = self.friction.GetOutputPort("resistance")
        builder.Connect(resistance, self.plant.get_applied_generalized_force_input_port())
        logs = [state, self.friction.GetOutputPort("friction_torque")]
        self.logs = [LogVectorOutput(port, builder, step) for port in logs]
        self.simulator = Simulator(builder.Build())
        self.root = self.simulator.get_mutable_context()
        if not time_step:
            solver = ResetIntegratorFromFlags(self.simulator, integrator, step)
            solver.set_fixed_step_mode(True)

    def run(self, duration, x=0.0, v=0.0):
        """Return times, positions, velocities and friction forces."""
        plant_context = self.plant.GetMyMutableContextFromRoot(self.root)
        self.plant.SetPositionsAndVelocities(plant_context, [x, v])
        self.simulator.AdvanceTo(duration)
        state, force = (log.FindLog(self.root) for log in self.logs)
        return state.sample_times(), *state.data(), force.data()[0]


@pytest.mark.parametrize("integrator", ["runge_kutta3", "runge_kutta5"])
def test_block_on_an_incline_sticks_below_the_friction_angle(integrator):
    """Gravity along the incline just below f_c: it bends the bristles and rests."""
    slope = 0.95 * F_C / MASS
    slide = Slide(lambda t, x, v: 0.0, gravity=slope, integrator=integrator)
    t, x, v, force = slide.run(1.0)
    delta = slide.law.presliding[0]
    assert delta < 5e-6
    settled = t > 0.1
    assert np.max(np.abs(v[settled])) < 1e-12
    assert np.isclose(force[-1], MASS * slope, rtol=0, atol=1e-9)
    # sudden gravity shoots over: slips by a few presliding displacements at most
    assert x[-1] < 4.0 * delta


def test_block_on_an_incline_slips_above_it():
    """``x = (g sin(a) - f_c / m) t^2 / 2``, from the first instant on."""
    slope = 1.2 * F_C / MASS
    t, x, _v, force = Slide(lambda t, x, v: 0.0, gravity=slope).run(1.0)
    expected = (slope - F_C / MASS) * t**2 / 2.0
    assert np.max(np.abs(x - expected)) < 6e-3 * expected[-1]
    assert np.isclose(force[-1], F_C, rtol=0, atol=1e-12)


def test_block_slides_to_a_stop_and_stays():
    """Uphill throw: stops after ``v0^2 / 2(g + f_c/m)``, then holds."""
    slope, v0 = 0.5 * F_C / MASS, 1.0
    t, x, v, _ = Slide(lambda t, x, v: 0.0, gravity=-slope).run(1.0, v=v0)
    deceleration = slope + F_C / MASS
    assert np.isclose(np.max(x), v0**2 / (2.0 * deceleration), rtol=0.01, atol=0)
    assert np.max(np.abs(v[t > v0 / deceleration + 0.05])) < 1e-9


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99])
def test_no_creep_below_coulomb_friction(share):
    """Loads that rise within 0.1 s and stay for a second."""
    t, x, v, _ = Slide(lambda t, x, v: share * F_C * min(t / 0.1, 1.0)).run(1.0)
    assert np.max(np.abs(v[t > 0.15])) < 1e-9
    assert np.max(np.abs(x)) < 4e-6
    assert np.max(np.abs(v)) < 1e-4


def test_no_drift_under_an_oscillating_load():
    """Load between 0 and 0.95 f_c, ten cycles; the bristles give, the tips do not."""
    slide = Slide(lambda t, x, v: 0.475 * F_C * (1.0 - np.cos(20.0 * np.pi * t)))
    t, x, _v, _ = slide.run(1.0)
    unloaded = np.isclose(t % 0.1, 0.0, atol=1e-9) | np.isclose(t % 0.1, 0.1, atol=1e-9)
    assert np.count_nonzero(unloaded) == 11
    spread = x[unloaded][1:] - x[unloaded][1]
    assert np.max(np.abs(spread)) < 1e-11


def test_break_away_at_coulomb_friction():
    """A load ramp of 1 N/s slips when it reaches f_c at 0.1 s; then ``x = (t - 0.1)^3 / (6 m)``."""
    slide = Slide(lambda t, x, v: 4.9 + t)
    slide.friction.set_load(slide.friction.GetMyMutableContextFromRoot(slide.root), [4.9])
    t, x, v, force = slide.run(0.2)
    delta = slide.law.presliding[0]
    gone = np.argmax(x > delta)
    assert np.isclose(t[gone], 0.1 + np.cbrt(6.0 * MASS * delta), rtol=0, atol=2e-3)
    assert np.max(np.abs(v[t < 0.099])) < 1e-4
    assert np.max(np.abs(force)) <= F_C


def test_steady_sliding():
    """A constant force ends at ``v = (F - f_c) / f_v``, where friction is (2.34)."""
    force = 11.0
    _t, _x, v, friction = Slide(lambda t, x, v: force, viscous=F_V).run(3.0)
    assert np.isclose(v[-1], (force - F_C) / F_V, rtol=0, atol=1e-9)
    assert np.isclose(friction[-1], F_C + F_V * v[-1], rtol=0, atol=1e-12)
    _t, _x, v, friction = Slide(lambda t, x, v: -force, viscous=F_V).run(3.0)
    assert np.isclose(friction[-1], -F_C + F_V * v[-1], rtol=0, atol=1e-12)


def test_spring_decays_by_a_constant_amount_per_half_cycle():
    """Turning points ``x0 - 2 n f_c / k`` at ``n pi / omega``; stuck in the dead zone."""
    k, x0 = 2000.0, 0.0188
    t, x, v, _ = Slide(lambda t, x, v: -k * x).run(1.0, x=x0)
    omega, loss = np.sqrt(k / MASS), 2.0 * F_C / k
    for n in range(1, 4):
        at = np.argmin(np.abs(t - n * np.pi / omega))
        expected = (-1) ** n * (x0 - n * loss)
        assert np.isclose(x[at], expected, rtol=0, atol=2e-5)
    # |x| = 3.8 mm, 1.2 mm on the other side: within f_c / k = 2.5 mm
    assert np.isclose(x[-1], x0 - 4.0 * loss, rtol=0, atol=2e-5)
    assert np.max(np.abs(v[t > 4.0 * np.pi / omega + 0.05])) < 1e-9


def test_mass_pulled_by_a_spring():
    """Pulled at V the mass moves with ``v = V (1 - cos(omega (t - t0)))``."""
    k, V = 400.0, 0.05
    t, _x, v, _ = Slide(lambda t, x, v: k * (V * t - x)).run(2.0)
    omega, start = np.sqrt(k / MASS), F_C / (k * V)
    assert np.max(np.abs(v[t < start - 0.01])) < 1e-4
    moving = (t > start + 0.01) & (t < start + 2.0 * np.pi / omega - 0.01)
    expected = V * (1.0 - np.cos(omega * (t - start)))
    assert np.max(np.abs(v - expected)[moving]) < 1e-3 * V * 5.0
    # every cycle touches standstill; the period is the free mass's
    tops = [i for i in range(1, len(v) - 1) if v[i - 1] < v[i] >= v[i + 1] and v[i] > 1.9 * V]
    assert np.allclose(np.diff(t[tops]), 2.0 * np.pi / omega, rtol=0.01, atol=0)


def test_sign_reversal():
    """A sinusoidal force far above f_c: friction changes sign with the velocity, immediately."""
    t, _x, v, force = Slide(lambda t, x, v: 40.0 * np.cos(2.0 * np.pi * t)).run(3.0)
    crossings = np.flatnonzero(np.diff(np.sign(v)) != 0)
    crossings = crossings[t[crossings] > 0.05]
    assert len(crossings) == 6
    for i in crossings:
        assert np.isclose(force[i - 3], F_C * np.sign(v[i - 3]), rtol=0, atol=1e-12)
        assert np.isclose(force[i + 4], F_C * np.sign(v[i + 4]), rtol=0, atol=1e-12)


def test_energy_is_dissipated():
    """Work of the force = kinetic + stored + dissipated energy; dissipation never negative."""

    def push(t, x, v):
        return 8.0 * np.sin(9.0 * t) + 3.0 * np.sin(31.0 * t)

    slide = Slide(push, viscous=F_V)
    t, x, v, force = slide.run(2.0)
    work = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x))
    external = np.array([push(a, 0.0, 0.0) for a in t])
    supplied = np.sum(0.5 * (external[1:] + external[:-1]) * np.diff(x))
    kinetic = MASS * v[-1] ** 2 / 2.0
    assert np.isclose(supplied, work + kinetic, rtol=2e-3, atol=0)
    stored = slide.law.energy(np.ones(1))[0]
    assert np.min(np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(x))) > -stored


@pytest.mark.slow(
    but=[
        "runge_kutta3-0.06-3.75",
        "runge_kutta3-25.0-101.7",
        "runge_kutta3-1.0-8.0",
        "runge_kutta5-0.17-2.7",
        "runge_kutta5-5.0-101.7",
    ]
)
@pytest.mark.parametrize(
    ("inertia", "coulomb"), [(0.06, 3.75), (0.17, 2.7), (5.0, 101.7), (25.0, 101.7), (1.0, 8.0)]
)
@pytest.mark.parametrize("integrator", ["runge_kutta3", "runge_kutta5"])
def test_stick_for_reflected_inertias(inertia, coulomb, integrator):
    """Every drive of the robot holds 0.9 f_c at 1 ms, and slides off at 1.1 f_c."""
    for share in (0.9, 1.1):
        slide = Slide(
            lambda t, x, v, share=share: share * coulomb * min(t / 0.05, 1.0),
            coulomb=coulomb,
            mass=inertia,
            integrator=integrator,
        )
        t, x, v, _ = slide.run(0.5)
        if share < 1.0:
            assert np.max(np.abs(v[t > 0.2])) < 1e-9
            assert np.max(np.abs(x)) < 1.1 * slide.law.presliding[0]
        else:
            assert np.isclose(v[-1] - v[-101], 0.1 * coulomb / inertia * 0.1, rtol=1e-6)


@pytest.mark.parametrize("inertia", [0.06, 1.5, 5.0])
def test_discrete_plant(inertia):
    """A plant stepped at 1 ms reads friction at its ticks and sticks and slides just so."""
    for share in (0.95, 1.5):
        slide = Slide(
            lambda t, x, v, share=share: share * F_C * min(t / 0.05, 1.0),
            mass=inertia,
            time_step=STEP,
            frequency=0.5,
        )
        t, x, v, force = slide.run(0.5)
        if share < 1.0:
            assert np.max(np.abs(v[t > 0.2])) < 1e-9
            assert np.max(np.abs(x)) < 1.1 * slide.law.presliding[0]
        else:
            assert np.isclose(v[-1] - v[-101], 0.5 * F_C / inertia * 0.1, rtol=1e-6)
            assert np.isclose(force[-1], F_C, rtol=0, atol=1e-12)


def test_ports():
    law = BristleFriction([2.0, 0.0], [1.0, 3.0], [1e-5, 1e-5], [2e-3, 2e-3])
    system = JointFriction(law)
    context = system.CreateDefaultContext()
    assert context.num_continuous_states() == 2
    system.GetInputPort("velocity").FixValue(context, [0.5, -1.0])
    torque = system.GetOutputPort("friction_torque").Eval(context)
    assert np.allclose(torque, [2.5, -3.0], rtol=0, atol=1e-15)
    assert np.array_equal(system.GetOutputPort("resistance").Eval(context), -torque)


def test_it_is_the_law():
    """Torque and rate of the system are those of the formulas, also for NaN."""
    rng = np.random.default_rng(5)
    law = BristleFriction(
        *rng.uniform([[1.0], [0.0], [1e-6], [1e-3]], [[9.0], [5.0], [1e-4], [3e-3]], (4, 6))
    )
    system = JointFriction(law)
    context = system.CreateDefaultContext()
    for scale in (0.0, 1e-4, 1e-2, 1.0, np.nan):
        s, v = rng.uniform(-1.0, 1.0, (2, 6)) * [[1.0], [scale]]
        context.SetContinuousState(s)
        system.GetInputPort("velocity").FixValue(context, v)
        torque = system.GetOutputPort("friction_torque").Eval(context)
        assert np.array_equal(torque, law.torque(s, v), equal_nan=True)
        rate = system.EvalTimeDerivatives(context).CopyToVector()
        assert np.array_equal(rate, law.rate(s, v), equal_nan=True)


def test_velocity_as_rows_of_what_is_read():
    """As rows that another system takes, to the last bit."""
    rng = np.random.default_rng(6)
    law = BristleFriction([2.0, 0.7], [1.0, 3.0], [1e-5, 1e-4], [2e-3, 3e-3])
    rows, whole = np.eye(5)[[3, 1]], rng.uniform(-0.1, 0.1, 5)
    found = []
    for system, value in (
        (JointFriction(law, rows=rows), whole),
        (JointFriction(law), whole[[3, 1]]),
    ):
        context = system.CreateDefaultContext()
        context.SetContinuousState([0.3, -0.2])
        system.GetInputPort("velocity").FixValue(context, value)
        outputs = [system.GetOutputPort(k).Eval(context) for k in ("friction_torque", "resistance")]
        found.append([*outputs, system.EvalTimeDerivatives(context).CopyToVector()])
    assert np.array_equal(*found)
    assert np.array_equal(found[0][0], law.torque(np.array([0.3, -0.2]), whole[[3, 1]]))


def test_without_velocity_its_zero_has_no_sign():
    system = JointFriction(BristleFriction([2.0], [1.0], [1e-5], [2e-3]))
    context = system.CreateDefaultContext()
    system.GetInputPort("velocity").FixValue(context, [0.0])
    (torque,) = system.GetOutputPort("friction_torque").Eval(context)
    assert torque == 0.0
    assert not np.signbit(torque)


def test_drift():
    law = BristleFriction([2.0, 0.0], [1.0, 3.0], [1e-5, 1e-5], [2e-3, 2e-3])
    system = JointFriction(law, FrictionDrift(1.5, 2.0, 4.0))
    context = system.CreateDefaultContext()
    system.GetInputPort("velocity").FixValue(context, [0.5, -1.0])
    for time, factor in ((0.0, 1.0), (3.0, 1.25), (9.0, 1.5)):
        context.SetTime(time)
        torque = system.GetOutputPort("friction_torque").Eval(context)
        assert np.allclose(torque, factor * np.array([2.5, -3.0]), rtol=0, atol=1e-15)
        assert np.array_equal(system.GetOutputPort("resistance").Eval(context), -torque)
