"""The closed loop (arm, controller, encoders) of a study of encoder resolution (CESTAC).

The loop serves methods that simulate it (iv, didim), and encoders inside the loop:

    place: record
            the positions of the record are rounded; the loop is simulated without steps, as the
            method does with any record
    place: loop
            every run is a record simulated anew; the encoder in the loop has steps of Delta, and a
            random phase phi for each encoder:

        arm, controller and record use
                y = R^-1 (phi + Delta floor((R (q - offset) - phi)/Delta + 1/2)) + offset

Rounding recorded positions does not show how a controller responds to encoder steps. For didim it
shows almost nothing, because didim uses only the first position. With place: loop every run has a
seed of its own for phase, torque noise and disturbance, the same for every Delta and method. The
runs are compared with runs of the same seeds whose encoder is that of the study (an exact encoder,
if the study gives none), so that %e shows the effect of the steps alone. With place: loop, the
option `reference` of estimate.options applies to every method.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from runtime.core.cestac.rounding import stream
from runtime.core.cestac.runs import Level
from runtime.core.model import GeneratedModel
from runtime.core.problem import Problem
from runtime.core.rows.observation import LoopRows, Observation
from runtime.core.rows.prepared import Prepared
from runtime.core.study import EstimateSettings
from runtime.ground.errors import SettingsError
from runtime.ground.settings import to_mapping
from runtime.loop.closed_loop import ClosedLoop, closed_loop
from runtime.loop.control_law import parameters_of
from runtime.loop.reference import Reference, reference_of

if TYPE_CHECKING:
    from runtime.loop.simulation import Simulator

Array = np.ndarray

ALIKE = ("reference",)  # estimate.options that are the loop's, whatever the method


@dataclass(frozen=True)
class Loop:
    """The closed loop (arm, controller, encoders) that a study of encoder resolution simulates.

    Attributes
    ----------
    problem : Problem
        Problem with the median of settings.cestac in its signals. With place: loop, the records of
        the problem serve only as source of the reference.
    simulator : Simulator
        Simulator whose control law has the encoder of the settings, not the steps of the study.
    """

    problem: Problem
    simulator: Simulator

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the data for pickle: the identification problem, from which a copy is made.

        A copy makes its own simulator.
        """
        return _loop, (self.problem,)

    @property
    def in_loop(self) -> bool:
        """Whether the encoder of the study is inside the simulated loop (place: loop)."""
        return bool(self.study.cestac.place == "loop")

    @property
    def model(self) -> GeneratedModel:
        """Generated model of the robot."""
        return self.problem.model

    @property
    def study(self) -> Any:
        """Settings of the study of encoder resolution."""
        return self.problem.settings

    @property
    def options(self) -> Mapping[str, Any]:
        """The option `reference` of the closed loop, if the study sets it."""
        return {
            key: self.study.estimate.options[key]
            for key in ALIKE
            if key in self.study.estimate.options
        }

    @cached_property
    def reference(self) -> Reference:
        """Reference motion that the controller follows in records simulated for the study."""
        return reference_of(self.simulator.controller, self.model, records=self.problem.records)

    @cached_property
    def truth(self) -> Array:
        """Base parameters of the simulated arm, shape (b,)."""
        return parameters_of(self.model, self.simulator.controller)

    @cached_property
    def closed(self) -> ClosedLoop:
        """Closed loop of the measured records, or of a simulated record if `place` is "loop".

        The simulated record is made with the encoder of the study.
        """
        if self.in_loop:
            return self._of(self.simulator, self.simulator.controller.seed, 0.0)
        return closed_loop(self.problem, self.problem.prepared, self.simulator, **self.options)

    @property
    def records(self) -> tuple[Prepared, ...]:
        """Records of the loop with their filtered states and the rows of W to use."""
        return tuple(part.prepared for part in self.closed.parts)

    @property
    def estimate(self) -> EstimateSettings:
        """Settings of the estimate, without loop options if its method simulates no closed loop.

        The loop option is `reference`.
        """
        settings: EstimateSettings = self.study.estimate
        if self.problem.method.observe is not None:
            return settings
        options = {key: value for key, value in settings.options.items() if key not in ALIKE}
        return replace(settings, options=options)

    @property
    def described(self) -> Mapping[str, Any]:
        """Settings of the controller, as a mapping for JSON."""
        return {"controller": to_mapping(self.simulator.controller)}

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the user of a study, such as an assumption on the reference motion."""
        notes = [self.closed.assumption] if self.closed.assumption else []
        if self.in_loop:
            notes.append(
                "The encoder rounds inside the simulated loop, whose parameters are the values of the robot file; every run is a record of its own, compared with the mean of as many records of the same seeds whose encoder is that of the study."
            )
        elif rounding := self.problem.method.rounding:
            notes.append(rounding.format(method=self.study.estimate.method))
        return tuple(notes)

    def measured(self) -> Observation:
        """Build the system Y = W X + rho of the records, before encoder steps are applied."""
        return self.closed.measured()

    def perturbed(self, observation: Observation, positions: Sequence[Array]) -> Observation:
        """Attach the closed loop with perturbed positions to a system Y = W X + rho made with them.

        positions : shape (N, n) per record.
        """
        parts = [
            replace(part, prepared=replace(part.prepared, record=part.record.moved(np.asarray(q))))
            for part, q in zip(self.closed.parts, positions, strict=True)
        ]
        return replace(
            observation,
            closed_loop=LoopRows(
                replace(self.closed, parts=tuple(parts)), np.arange(len(observation.Y))
            ),
        )

    def rows(self, level: Level, draw: tuple[int, ...]) -> Observation:
        """Simulate a record with the encoder step of a study level; build its Y = W X + rho."""
        return self.simulated(level, draw).measured()

    def simulated(self, level: Level, draw: tuple[int, ...]) -> ClosedLoop:
        """Return the control loop that simulates a record with the encoder step of a study level.

        If the step level.delta is 0, the encoder is that of the study. draw : numbers of the run;
        the last number sets its seed.
        """
        random = stream(self.study.cestac.seed, draw[-1])
        law, n = self.simulator.law, len(self.model.JOINTS)
        phase = level.delta * random.random(n)
        simulator: Any = copy(self.simulator)
        if level.delta:
            simulator.law = replace(
                law,
                encoder_step=np.full(n, level.delta),
                offset=law.offset + np.linalg.solve(law.R, phase),
            )
        return self._of(simulator, int(random.integers(2**31)), level.delta)

    def _of(self, simulator: Any, seed: int, delta: float) -> ClosedLoop:
        """Simulate a record with `simulator`, and make the closed loop of this record.

        The simulated controller sees the encoder of the settings. The identification reads the
        positions with the encoder step of the study, or exact positions if there is no step.
        """
        record = simulator.run(
            self.truth, self.reference, seed=seed, name=f"SIMULATED {self.model.NAME}"
        ).record()
        step = delta or self.simulator.controller.encoder.step or 0.0
        reader = self.problem.reader.at_step(step, self.study.cestac.side)
        problem = self.problem.changed(records=(record,), unseen=(), reader=reader)
        return closed_loop(problem, problem.prepared, self.simulator, **self.options)


def _loop(problem: Problem) -> Loop:
    """Make the closed loop of a study; the settings section `controller` gives its simulator."""
    from runtime.loop.simulation import Simulator

    settings: Any = problem.settings
    return Loop(problem, Simulator(problem.model, settings.controller))


def loop_of(problem: Problem, simulator: Simulator | None = None) -> Loop | None:
    """Make the closed loop of a study of encoder resolution; None if the study simulates none.

    simulator : default: the simulator of the section `controller`; raise SettingsError if this
      section is missing.
    """
    study: Any = problem.settings
    in_loop = study.cestac.place == "loop"
    if not in_loop and problem.method.observe is None:
        return None
    if study.controller is None:
        asked = "place: loop" if in_loop else study.estimate.method
        raise SettingsError(
            f"{asked} simulates the closed loop, but this study does not describe it; add a section "
            "`controller` with law, rate and reference, "
            "or use ols, wls or irls on recorded positions",
            path=("cestac", "place") if in_loop else ("estimate", "method"),
        )
    quiet = replace(study, signals=replace(study.signals, median=study.cestac.median))
    if in_loop:  # the encoder on the side of the study, of any step: only then is it in the law
        encoder = replace(study.controller.encoder, side=study.cestac.side)
        quiet = replace(quiet, controller=replace(study.controller, encoder=encoder))
    quiet_problem = problem.changed(settings=quiet)
    if simulator is not None and simulator.controller == quiet.controller:
        return Loop(quiet_problem, simulator)
    return _loop(quiet_problem)
