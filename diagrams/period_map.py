"""The derivative of the map of one sampling period of a whole diagram.

Blocks are differentiated exactly, by their expressions. The other systems, above all the plant, are
differentiated by central differences with the outputs of the blocks held. Both derivatives are
joined along the wires, so that no part of the controller is modelled twice.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, InputPort

from diagrams.one_period_map import OnePeriodMap
from pfsc_drake.blocks.slope import NetworkSlope, SlopeAt
from pfsc_drake.systems.block_system import BlockSystem, is_tick, last_tick

# relative to a variable, or absolute if that is larger
_DIFFERENCE = 1e-6
# the same for outputs: a plant answers almost linearly, and by little within an interval
_DIFFERENCE_OF_OUTPUTS = 1e-2
# part of a central difference by which the two one-sided ones may differ; more is a switch
_BEND = 0.05
# relative to a variable or 1; smaller changes are rounding
_ROUNDING = 1e-11


@dataclass(frozen=True)
class RestSlope:
    """Derivative of the systems that are no blocks, from one tick to the next.

    Attributes:
        of_inputs: Derivative of the blocks' inputs at the next tick with respect to the variables
            of these systems and to the outputs of the blocks.
        of_own: Derivative of the variables of these systems, likewise.
        inputs: Inputs of each system of blocks at that tick, by name.
    """

    of_inputs: tuple[np.ndarray, np.ndarray]
    of_own: tuple[np.ndarray, np.ndarray]
    inputs: Sequence[Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class SectionDerivative:
    """Derivative of the map of one period.

    Attributes:
        A: ``dx_{k+1} / dx_k`` of the chosen variables, shape (n, n).
        rest: Contribution of the systems that are no blocks, one for each interval between ticks.
        wires: Outputs of the blocks at the last tick, by ``block.output``.
    """

    A: np.ndarray
    rest: Sequence[RestSlope]
    wires: dict[str, np.ndarray]


class PeriodDerivative:
    """Differentiation of a diagram's map of one period.

    Args:
        one_period: The map.
        diagram: Its diagram. Its blocks are those at its top level, fused or not, which sample at
            the period or at whole fractions of it. Outputs that feed a continuous system must be
            constant between ticks.
        configure: Configures the integrator of a simulator.
        smooth: Variables that are differentiable whatever differences say, as those of a plant.

    Attributes:
        rest: Indices of the variables that belong to no block.
        states: Indices of each state of a block, by ``block.state``.
    """

    def __init__(
        self,
        one_period: OnePeriodMap,
        diagram: Diagram,
        configure: Callable[[Simulator], None],
        smooth: np.ndarray | None = None,
    ) -> None:
        self._map = one_period
        self._blocks = [s for s in diagram.GetSystems() if isinstance(s, BlockSystem)]
        self._slopes = [NetworkSlope(system.network) for system in self._blocks]
        self._parametric: list[NetworkSlope] = []
        self._memory = [one_period.rows(system) for system in self._blocks]
        self._states = [
            {name: rows[part] for name, part in system.states.items()}
            for system, rows in zip(self._blocks, self._memory, strict=True)
        ]
        self.rest = np.setdiff1d(np.arange(one_period.size), np.concatenate([[], *self._memory]))
        self._is_sampled = len(self.rest) > one_period.num_continuous
        self._smooth = np.isin(self.rest, [] if smooth is None else smooth)
        step = min([one_period.period, *(system.period for system in self._blocks)])
        self._intervals = round(one_period.period / step)
        self._free = OnePeriodMap(diagram, step, configure)
        # here outputs of blocks are held
        self._held = OnePeriodMap(diagram, step, configure)
        self.states: dict[str, np.ndarray] = {}
        for system, rows in zip(self._blocks, self._states, strict=True):
            self.states |= {system.full_name(name): where for name, where in rows.items()}
        self._find_wires(diagram)
        # then the rest moves by the states alone, whatever the blocks compute at the tick
        self._driven_by_states = (
            self._intervals == 1
            and not self._direct
            and all(name in self._blocks[k].network.state_outputs for k, name in self._driving)
        )

    @property
    def can_be_parametrized(self) -> bool:
        """Whether outputs computed at a tick act on the other systems only after the next."""
        return self._driven_by_states

    def parametrize(self, diagram: Diagram) -> None:
        """Set blocks that depend on parameters, for :meth:`at`.

        Args:
            diagram: The same diagram, with parameters in its blocks.
        """
        found = (diagram.GetSubsystemByName(system.get_name()) for system in self._blocks)
        self._parametric = [NetworkSlope(system.network) for system in found]

    def at(
        self,
        section: Context,
        chosen: np.ndarray | None = None,
        rest: Sequence[RestSlope] = (),
        parameters: Mapping[str, float] | None = None,
    ) -> SectionDerivative:
        """Return the derivative at a section.

        Args:
            section: Context right after a tick; unchanged.
            chosen: Indices of the variables, shape (n,); by default all, with zero rows for states
                that no output depends on. The column of a variable without a slope, such as a flag
                or a limit that is just reached, is zero.
            rest: Contribution of the other systems, if it is known from a diagram that differs in
                its blocks only.
            parameters: Values for the parameters of :meth:`parametrize`, instead of the blocks'
                own. They are not enough where they change the inputs of the other systems.
        """
        A: np.ndarray | None = None
        start, slopes = section, []
        for interval in range(self._intervals):
            tick = self._free.next_tick(start)
            if rest and self._driven_by_states:  # the other systems arrive at the same state
                points = self._points(start, rest[interval].inputs, tick, parameters)
                slopes.append(rest[interval])
            else:
                self._free.approach(start)
                sampled = self._free.as_sampled()
                inputs = self._inputs_at(sampled)
                points = self._points(sampled, inputs, tick, parameters)
                slopes.append(
                    rest[interval] if rest else self._slope_of_rest(start, sampled, inputs)
                )
            rows = chosen if self._intervals == 1 else None
            step = self._joined(points, slopes[-1], tick, rows)
            A = step if A is None else step @ A
            if interval + 1 < self._intervals:
                self._free.pass_tick()
                start = self._free.context.Clone()
        assert A is not None  # there is an interval
        wires = self._wires(points)
        return SectionDerivative(A if chosen is None else A[np.ix_(chosen, chosen)], slopes, wires)

    def wires(self, section: Context) -> dict[str, np.ndarray]:
        """Return the outputs of blocks at the next tick, by ``block.output``.

        Args:
            section: Context right after a tick; unchanged.
        """
        self._map.approach(section)
        sampled = self._map.as_sampled()
        return self._wires(self._points(sampled, self._inputs_at(sampled), sampled.get_time()))

    def _wires(self, points: Sequence[SlopeAt]) -> dict[str, np.ndarray]:
        found: dict[str, np.ndarray] = {}
        for system, point in zip(self._blocks, points, strict=True):
            found |= {system.full_name(name): point.wire(name) for name in system.network.wires}
        return found

    def _find_wires(self, diagram: Diagram) -> None:
        """Number the inputs of the blocks, and the outputs that are connected."""
        self._inputs: dict[tuple[int, str], np.ndarray] = {}
        self._outputs: dict[tuple[int, str], np.ndarray] = {}
        self._num_inputs = self._num_outputs = 0
        # from blocks to the rest, from the rest to blocks, from blocks to blocks
        self._fed: list[tuple[np.ndarray, InputPort]] = []
        self._driving: set[tuple[int, str]] = set()
        self._ports: list[InputPort] = []
        self._direct: list[tuple[np.ndarray, np.ndarray]] = []
        numbers = {system: k for k, system in enumerate(self._blocks)}
        connections = diagram.connection_map()
        rank = {system: k for k, system in enumerate(diagram.GetSystems())}
        # the map's own order is that of addresses, and not the same in two equal diagrams
        for target, i in sorted(connections, key=lambda key: (rank[key[0]], int(key[1]))):
            source, o = connections[target, i]
            port, output = target.get_input_port(i), source.get_output_port(o)
            if target not in numbers and not target.num_output_ports():
                continue  # a log
            if source in numbers:
                key = numbers[source], output.get_name()
                if key not in self._outputs:
                    self._outputs[key] = self._num_outputs + np.arange(port.size())
                    self._num_outputs += port.size()
                if target not in numbers:
                    self._fed.append((self._outputs[key], port))
                    self._driving.add(key)
            if target in numbers:
                into = self._num_inputs + np.arange(port.size())
                self._inputs[numbers[target], port.get_name()] = into
                self._num_inputs += port.size()
                self._ports.append(port)
                if source in numbers:
                    self._direct.append((into, self._outputs[key]))

    def _inputs_at(self, root: Context) -> list[dict[str, np.ndarray]]:
        """Return the inputs of all blocks."""
        return [
            {
                name: system.GetInputPort(name).Eval(system.GetMyContextFromRoot(root))
                for name in system.network.inputs
            }
            for system in self._blocks
        ]

    def _points(
        self,
        root: Context,
        inputs: Sequence[Mapping[str, np.ndarray]],
        time: float,
        parameters: Mapping[str, float] | None = None,
    ) -> list[SlopeAt]:
        """Return the derivatives of all blocks at a tick that is not executed yet."""
        points = []
        slopes = self._slopes if parameters is None else self._parametric
        for system, slope, u in zip(self._blocks, slopes, inputs, strict=True):
            own = system.GetMyContextFromRoot(root)
            x = {name: system.state(own, name) for name in system.states}
            points.append(slope.at(x, u, last_tick(time, system.period), parameters))
        return points

    def _slope_of_rest(
        self, start: Context, sampled: Context, inputs: Sequence[Mapping[str, np.ndarray]]
    ) -> RestSlope:
        put_out = np.zeros(self._num_outputs)
        for (k, name), part in self._outputs.items():
            own = self._blocks[k].GetMyContextFromRoot(sampled)
            put_out[part] = self._blocks[k].GetOutputPort(name).Eval(own)
        x, n, m = self._map.variables(start), len(self.rest), self._num_inputs
        z = np.concatenate([x[self.rest], put_out])
        middle = self._moved(start, x, z)
        slope = np.zeros((len(middle), len(z)))
        # values that are not known yet (NaN) stay so
        finite = np.isfinite(middle)
        for column in np.flatnonzero(np.isfinite(z)):
            share = _DIFFERENCE if column < n else _DIFFERENCE_OF_OUTPUTS
            delta = share * max(1.0, abs(z[column]))
            shift = np.zeros(len(z))
            shift[column] = delta
            forward, backward = (
                self._moved(start, x, z + side)[finite] - middle[finite] for side in (shift, -shift)
            )
            scale = np.max(np.maximum(np.abs(forward), np.abs(backward)), initial=0.0)
            bend = np.abs(forward + backward)
            # written so that NaN is a switch
            is_smooth = bend <= _BEND * scale + _ROUNDING * np.maximum(1.0, np.abs(middle[finite]))
            if np.all(is_smooth) or column >= n or self._smooth[column]:
                slope[finite, column] = (forward - backward) / (2.0 * delta)
        return RestSlope((slope[:m, :n], slope[:m, n:]), (slope[m:, :n], slope[m:, n:]), inputs)

    def _moved(self, start: Context, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the blocks' inputs and the rest's variables, one interval later."""
        root, x = self._held.context, x.copy()
        x[self.rest] = z[: len(self.rest)]
        for part, port in self._fed:
            own = port.get_system().GetMyMutableContextFromRoot(root)
            port.FixValue(own, z[len(self.rest) + part])
        self._held.approach(start, x)
        sampled = self._held.as_sampled()
        inputs = [
            port.Eval(port.get_system().GetMyContextFromRoot(sampled)) for port in self._ports
        ]
        arrived = self._held.pass_tick() if self._is_sampled else self._held.variables(root)
        return np.concatenate([*inputs, arrived[self.rest]])

    def _joined(
        self, points: Sequence[SlopeAt], rest: RestSlope, time: float, chosen: np.ndarray | None
    ) -> np.ndarray:
        """Return the derivative over one interval, shape (size, size)."""
        size = self._map.size
        # states and outputs of blocks by states and inputs
        D = np.zeros((size + self._num_outputs, size + self._num_inputs))
        for k, (system, point) in enumerate(zip(self._blocks, points, strict=True)):
            states = self._states[k]
            ports = [name for block, name in self._outputs if block == k]
            wires = [system.network.outputs[name] for name in ports]
            names = list(states)
            if chosen is not None:
                names = [name for name in states if np.isin(states[name], chosen).any()]
            elif self._intervals == 1:
                names = point.reaching(wires)
            if not is_tick(time, system.period):  # its state is unchanged
                D[self._memory[k], self._memory[k]], names = 1.0, []
            rows = [states[name] for name in names]
            rows += [size + self._outputs[k, name] for name in ports]
            for source, piece in point.derivatives(names, wires).items():
                columns = (
                    states[source.name]
                    if source.kind == "state"
                    else size + self._inputs[k, source.name]
                )
                D[np.ix_(np.concatenate(rows), columns)] = piece
        A, next_u, y_x, y_u = D[:size, :size], D[:size, size:], D[size:, :size], D[size:, size:]
        own, u_y = self.rest, rest.of_inputs[1].copy()
        u_x = np.zeros((self._num_inputs, size))
        u_x[:, own] = rest.of_inputs[0]
        for into, put_out in self._direct:
            u_x[into], u_y[into] = 0.0, 0.0
            u_y[into, put_out] = 1.0
        # blocks and the rest have no algebraic loop, so that the matrix is regular
        u_x[:] = np.linalg.solve(np.eye(len(u_x)) - u_y @ y_u, u_x + u_y @ y_x)
        A = A + next_u @ u_x
        A[np.ix_(own, own)] += rest.of_own[0]
        A[own] += rest.of_own[1] @ (y_x + y_u @ u_x)
        return A
