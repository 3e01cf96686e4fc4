"""The derivative of the map of one sampling period of a whole diagram.

That of blocks is taken from their expressions, exactly. What is no block, above all the plant, is
differentiated by central differences, while what the blocks put out is held. Both are joined where
they are wired. So nothing of the controller is modelled a second time.
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
# the same of what is put out: a plant answers almost linearly, and by little within an interval
_DIFFERENCE_OF_OUTPUTS = 1e-2
# part of a central difference by which the two one-sided ones may differ; more is a switch
_BEND = 0.05
# relative to a variable or 1; smaller changes are rounding
_ROUNDING = 1e-11


@dataclass(frozen=True)
class RestSlope:
    """Derivative of what is no block, from right after a tick to right after the next.

    Attributes:
        of_inputs: Slope of what the plant gives the blocks at that tick, by its variables and by
            what the blocks put out.
        of_own: The same of its variables.
        given: What it gives each system of blocks at that tick, by input.
    """

    of_inputs: tuple[np.ndarray, np.ndarray]
    of_own: tuple[np.ndarray, np.ndarray]
    given: Sequence[Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class SectionDerivative:
    """Derivative of the map of one period.

    Attributes:
        A: ``dx_{k+1} / dx_k``, shape (n, n), the variables being those that were asked for.
        rest: What is not the blocks' in it, one for each interval between ticks of blocks.
        wires: What the blocks put out at the last tick, by ``block.output``.
    """

    A: np.ndarray
    rest: Sequence[RestSlope]
    wires: dict[str, np.ndarray]


class PeriodDerivative:
    """What differentiates a diagram's map of one period.

    Args:
        one_period: The map.
        diagram: Its diagram. Blocks of it are those at its top, fused or not, which sample at the
            period or at whole fractions of it. What they put out between their ticks must not
            depend on what moves there, where something continuous is fed with it.
        configure: Tells a simulator how to integrate.
        smooth: Variables that have a slope whatever differences say, as those of a plant.

    Attributes:
        rest: Where the variables stand that are no block's.
        states: Where each state of a block stands, by ``block.state``.
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
        # where what blocks put out is held
        self._held = OnePeriodMap(diagram, step, configure)
        self.states: dict[str, np.ndarray] = {}
        for system, rows in zip(self._blocks, self._states, strict=True):
            self.states |= {system.full_name(name): where for name, where in rows.items()}
        self._find_wires(diagram)
        # with the same variables and the same rest, whatever blocks do at their ticks, the rest
        # arrives at the same
        self._is_led_by_states = (
            self._intervals == 1
            and not self._direct
            and all(name in self._blocks[k].network.shown for k, name in self._leading)
        )

    @property
    def can_be_parametrized(self) -> bool:
        """Whether what blocks do at a tick moves nothing else before the next."""
        return self._is_led_by_states

    def parametrize(self, diagram: Diagram) -> None:
        """Take blocks that depend on parameters, for :meth:`at`.

        Args:
            diagram: The same but that its blocks have parameters.
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
            chosen: Indices of the variables to look at, shape (n,); all if omitted, where rows
                of what blocks remember and never tell are left zero. A column without a slope, that
            of a flag or a limit that is just reached, is zero.
            rest: What is not the blocks', if it is known: of a diagram whose blocks alone differ.
            parameters: Values for the parameters of :meth:`parametrize`, instead of the blocks'
                own. Where other parameters change what the rest is led by, they are not enough.
        """
        A: np.ndarray | None = None
        start, made = section, []
        for interval in range(self._intervals):
            tick = self._free.next_tick(start)
            if rest and self._is_led_by_states:  # what is no block arrives where it did
                points = self._points(start, rest[interval].given, tick, parameters)
                made.append(rest[interval])
            else:
                self._free.approach(start)
                sampled = self._free.as_sampled()
                given = self._given_at(sampled)
                points = self._points(sampled, given, tick, parameters)
                made.append(rest[interval] if rest else self._slope_of_rest(start, sampled, given))
            wanted = chosen if self._intervals == 1 else None
            step = self._joined(points, made[-1], tick, wanted)
            A = step if A is None else step @ A
            if interval + 1 < self._intervals:
                self._free.pass_tick()
                start = self._free.context.Clone()
        assert A is not None  # there is an interval
        wires = self._wires(points)
        return SectionDerivative(A if chosen is None else A[np.ix_(chosen, chosen)], made, wires)

    def wires(self, section: Context) -> dict[str, np.ndarray]:
        """Return what blocks put out at the next tick, by ``block.output``.

        Args:
            section: Context right after a tick; unchanged.
        """
        self._map.approach(section)
        sampled = self._map.as_sampled()
        return self._wires(self._points(sampled, self._given_at(sampled), sampled.get_time()))

    def _wires(self, points: Sequence[SlopeAt]) -> dict[str, np.ndarray]:
        found: dict[str, np.ndarray] = {}
        for system, point in zip(self._blocks, points, strict=True):
            found |= {system.full_name(name): point.wire(name) for name in system.network.wires}
        return found

    def _find_wires(self, diagram: Diagram) -> None:
        """Number what blocks are fed with, and what they put out that others are fed with."""
        self._inputs: dict[tuple[int, str], np.ndarray] = {}
        self._outputs: dict[tuple[int, str], np.ndarray] = {}
        self._num_inputs = self._num_outputs = 0
        # from blocks to the rest, from the rest to blocks, from blocks to blocks
        self._fed: list[tuple[np.ndarray, InputPort]] = []
        self._leading: set[tuple[int, str]] = set()
        self._given: list[InputPort] = []
        self._direct: list[tuple[np.ndarray, np.ndarray]] = []
        numbers = {system: k for k, system in enumerate(self._blocks)}
        connections = diagram.connection_map()
        place = {system: k for k, system in enumerate(diagram.GetSystems())}
        # the map's own order is that of addresses, and not the same in two equal diagrams
        for target, i in sorted(connections, key=lambda key: (place[key[0]], int(key[1]))):
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
                    self._leading.add(key)
            if target in numbers:
                into = self._num_inputs + np.arange(port.size())
                self._inputs[numbers[target], port.get_name()] = into
                self._num_inputs += port.size()
                self._given.append(port)
                if source in numbers:
                    self._direct.append((into, self._outputs[key]))

    def _given_at(self, root: Context) -> list[dict[str, np.ndarray]]:
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
        given: Sequence[Mapping[str, np.ndarray]],
        time: float,
        parameters: Mapping[str, float] | None = None,
    ) -> list[SlopeAt]:
        """Return the derivatives of all blocks at a tick that is not made yet."""
        points = []
        slopes = self._slopes if parameters is None else self._parametric
        for system, slope, u in zip(self._blocks, slopes, given, strict=True):
            own = system.GetMyContextFromRoot(root)
            x = {name: system.state(own, name) for name in system.states}
            points.append(slope.at(x, u, last_tick(time, system.period), parameters))
        return points

    def _slope_of_rest(
        self, start: Context, sampled: Context, given: Sequence[Mapping[str, np.ndarray]]
    ) -> RestSlope:
        put_out = np.zeros(self._num_outputs)
        for (k, name), part in self._outputs.items():
            own = self._blocks[k].GetMyContextFromRoot(sampled)
            put_out[part] = self._blocks[k].GetOutputPort(name).Eval(own)
        x, n, m = self._map.variables(start), len(self.rest), self._num_inputs
        z = np.concatenate([x[self.rest], put_out])
        middle = self._moved(start, x, z)
        slope = np.zeros((len(middle), len(z)))
        # what is not known yet stays so
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
        return RestSlope((slope[:m, :n], slope[:m, n:]), (slope[m:, :n], slope[m:, n:]), given)

    def _moved(self, start: Context, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return what blocks are fed with and the rest's variables, one interval later."""
        root, x = self._held.context, x.copy()
        x[self.rest] = z[: len(self.rest)]
        for part, port in self._fed:
            own = port.get_system().GetMyMutableContextFromRoot(root)
            port.FixValue(own, z[len(self.rest) + part])
        self._held.approach(start, x)
        sampled = self._held.as_sampled()
        given = [port.Eval(port.get_system().GetMyContextFromRoot(sampled)) for port in self._given]
        arrived = self._held.pass_tick() if self._is_sampled else self._held.variables(root)
        return np.concatenate([*given, arrived[self.rest]])

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
            if not is_tick(time, system.period):  # remembers what it did
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
        # what goes from blocks through the rest and back within the tick comes to an end
        u_x[:] = np.linalg.solve(np.eye(len(u_x)) - u_y @ y_u, u_x + u_y @ y_x)
        A = A + next_u @ u_x
        A[np.ix_(own, own)] += rest.of_own[0]
        A[own] += rest.of_own[1] @ (y_x + y_u @ u_x)
        return A
