"""Repeats the study's Table 1: which BSPs can be recovered from gait, with and without noise and pelvis correction.

Each draw takes a start (every one of the 49 parameters changed by uniform +/-50 %) and, for the noisy conditions, the
study's marker noise; noisy markers go through inverse kinematics and GCV smoothing with the true skeleton. The
two-level estimator never sees the truth. `Setup` holds these steps, each of which can be replaced
(`kinertia.studies.table1_variants`).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from kinertia.estimation.identifiability import ParameterVector
from kinertia.estimation.prepared import Progress
from kinertia.estimation.two_level import Window, correct_pelvis, estimate_two_level
from kinertia.io.subject.person_recordings import read_inputs
from kinertia.io.subject.tables import SubjectFile
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, residual
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.smoothing import SmoothedSpline, smooth
from kinertia.motion.workload import one_blas_thread
from kinertia.studies.parallel import in_parallel
from kinertia.synthetic.laboratory import study_noise
from kinertia.synthetic.walk import Manner, SyntheticTrial, consistent_trial, walk, walking_subject, without_products
from kinertia.trial.data import Markers
from kinertia.trial.sampled_data import rms
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare

CONDITIONS = {
    "no_correction_no_noise": "no correction, no noise",
    "no_correction_noise": "no correction, noise",
    "correction_no_noise": "correction, no noise",
    "correction_noise": "correction, noise",
}
"""Key and heading of the four conditions, in the order of the published table."""
START_SHARE = 0.5
MARGIN_S = 0.1
"""Time at either end that is not used, since splines are poor there."""
_STRIDE_S = 1.24


@dataclass(frozen=True)
class Errors:
    """One column of Table 1: errors of the estimated parameters, and the remaining root residual.

    RMS and largest magnitude over all parameters of a class (21 moments, 7 masses, 21 CoM coordinates), and over all
    frames and components of the pelvis force and torque.
    """

    inertia_rms_kgm2: float
    inertia_max_kgm2: float
    mass_rms_kg: float
    mass_max_kg: float
    com_rms_m: float
    com_max_m: float
    force_rms_N: float
    force_max_N: float
    torque_rms_Nm: float
    torque_max_Nm: float


PUBLISHED = {
    "no_correction_no_noise": Errors(
        2.67e-5, 5.65e-5, 2.75e-8, 5.30e-8, 9.44e-10, 4.00e-9, 9.01e-10, 2.72e-9, 6.98e-10, 1.68e-9
    ),
    "no_correction_noise": Errors(0.933, 4.09, 2.11, 5.77, 0.197, 0.461, 18.3, 50.1, 13.0, 35.2),
    "correction_no_noise": Errors(
        2.73e-5, 5.90e-5, 3.95e-8, 7.66e-8, 1.31e-9, 5.51e-9, 5.73e-9, 2.20e-8, 2.42e-9, 1.05e-8
    ),
    "correction_noise": Errors(0.382, 1.84, 1.71, 3.07, 0.180, 0.559, 0.229, 0.961, 0.600, 1.53),
}
"""Table 1 as published."""


@dataclass(frozen=True)
class Draw:
    """One draw of start and noise.

    Attributes:
        number: of the draw; with the seed it determines everything.
        errors: per condition.
        parameter_errors: per condition (k, 49), parameters minus truth (kg, m, kg m2) from the start, first, to the
            estimate, last.
        costs: per condition (k,), the cost at the same iterates.
        converged: per condition.
    """

    number: int
    errors: Mapping[str, Errors]
    parameter_errors: Mapping[str, np.ndarray]
    costs: Mapping[str, np.ndarray]
    converged: Mapping[str, bool]

    @property
    def start_errors(self) -> np.ndarray:
        """Start minus truth (49,)."""
        start: np.ndarray = next(iter(self.parameter_errors.values()))[0]
        return start


@dataclass(frozen=True)
class Table1:
    """All draws of a study.

    Attributes:
        parameters: names of the 49 parameters.
        truth: their true values.
        draws: in the order of their numbers.
        seed: of the study.
        trial: source of the motion.
    """

    parameters: tuple[str, ...]
    truth: np.ndarray
    draws: tuple[Draw, ...]
    seed: int
    trial: str

    def mean(self, condition: str) -> Errors:
        """Return the mean of the errors over the draws that have this condition."""
        return Errors(*np.mean(self._values(condition), axis=0).tolist())

    def spread(self, condition: str) -> Errors:
        """Return the standard deviation of the errors over the draws (zero for one draw)."""
        return Errors(*np.std(self._values(condition), axis=0, ddof=min(1, len(self.draws) - 1)).tolist())

    def _values(self, condition: str) -> np.ndarray:
        errors_of_draws = [draw.errors[condition] for draw in self.draws if condition in draw.errors]
        return np.array([list(asdict(errors).values()) for errors in errors_of_draws])


def two_level(
    skeleton: Skeleton, start: BodySegmentParameters, window: Window, correct: bool
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Run `estimate_two_level`: return parameters (2, 49) and cost (2,) at start and end, and whether it converged."""
    result, vector = estimate_two_level(skeleton, start, [window], correct=correct), ParameterVector(start, True)
    return np.array([vector.values(start), vector.values(result.bsp)]), np.array(result.cost), result.converged


def random_start(vector: ParameterVector, rng: np.random.Generator) -> np.ndarray:
    """Return the vector's reference with every parameter changed by uniform +/-50 %."""
    truth = vector.values(vector.reference)
    return truth * (1.0 + rng.uniform(-START_SHARE, START_SHARE, len(truth)))


def noise_per_coordinate(trial: SyntheticTrial, rng: np.random.Generator) -> Markers:
    """Return the markers with the study's noise."""
    return study_noise(trial.markers, rng)


def coordinates(trial: SyntheticTrial, markers: Markers) -> SmoothedSpline:
    """Compute coordinates from markers: inverse kinematics with the true skeleton, then GCV."""
    ik = solve_ik(trial.skeleton, markers)
    return smooth(ik.time, ik.q, "gcv")


@dataclass(frozen=True)
class Setup:
    """Steps of a draw.

    Attributes:
        start: parameters (49) that the estimate starts from; the vector's reference is the truth.
        noise: noisy markers of a trial.
        spline: smooth coordinates of noisy markers.
        margin_s: frames this near the ends of the trial are smoothed but not used.
        estimate: as `two_level`, possibly with further iterates between start and end.
    """

    start: Callable[[ParameterVector, np.random.Generator], np.ndarray] = random_start
    noise: Callable[[SyntheticTrial, np.random.Generator], Markers] = noise_per_coordinate
    spline: Callable[[SyntheticTrial, Markers], SmoothedSpline] = coordinates
    margin_s: float = MARGIN_S
    estimate: Callable[..., tuple[np.ndarray, np.ndarray, bool]] = two_level


TODAY = Setup()


def symmetric_truth(bsp: BodySegmentParameters) -> BodySegmentParameters:
    """Make left mirror right exactly, so that 49 parameters can describe the body."""
    vector = ParameterVector(bsp, symmetric=True)
    return vector.bsp(vector.values(bsp))


def study_trial(pace: float = 1.0, on_axes: bool = False) -> SyntheticTrial:
    """Return one stride of the package's walk, with margins; left mirrors right exactly.

    Args:
        pace: factor on the speed.
        on_axes: move all CoMs onto the long axes of the segments.
    """
    subject = walking_subject()
    truth = symmetric_truth(subject.bsp)
    if on_axes:
        truth = replace(truth, com_m=truth.com_m * [0.0, 1.0, 0.0])
    return walk(replace(subject, bsp=truth), _STRIDE_S / pace + 2 * MARGIN_S, manner=Manner(pace))


@one_blas_thread
def measured_trial(wanted: SubjectFile, progress: Progress = lambda stage, share: None) -> tuple[SyntheticTrial, str]:
    """Make the study's trial from a measured one, and return it with its label.

    The first trial of the subject file goes through reading, calibration, inverse kinematics and smoothing; of its
    measured window, the middle `_STRIDE_S` (or all, if it is shorter) is made consistent with the literature BSPs; the
    margins are inside it, because errors of the pelvis grow with the square of the time.

    Raises:
        KinertiaError: the trial cannot be used, or no pelvis motion near the measured one balances its ground
            reactions.
    """
    static, inputs, marker_set = read_inputs(wanted, progress)
    person = Person(wanted.subject, inputs[:1], static, marker_set=marker_set)
    ready = prepare(person, wanted.settings, progress)
    measured = ready.kinematics[0]
    worn = [m for m in ready.skeleton.markers if m.label in measured.ik.labels]
    inside = np.abs(measured.time - measured.time.mean()) <= _STRIDE_S / 2 + 1e-9
    frames = slice(int(np.argmax(inside)), int(len(inside) - np.argmax(inside[::-1])))
    trial = consistent_trial(
        ready.skeleton.with_markers(worn),
        symmetric_truth(without_products(ready.literature)),
        measured.time[frames],
        measured.motion.cut(frames),
        measured.foot_loads[frames],
    )
    first, last = trial.time[[0, -1]]
    return trial, f"{measured.trial.name}, {first:.2f} to {last:.2f} s"


def run_table1(
    trial: SyntheticTrial,
    repeats: int = 10,
    seed: int = 1,
    name: str = "synthetic walk",
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Table1:
    """Run all four conditions for a number of independent draws, in parallel processes.

    A draw depends on the seed and its own number only: not on how many there are, nor on the number of processes.

    Args:
        trial: exactly consistent; its BSPs are the truth.
        repeats: number of draws.
        seed: of the study.
        name: of the trial, for the tables.
        workers: processes; as many as there are cores if None.
        progress: called with the share that is done.
    """
    vector = ParameterVector(trial.bsp, symmetric=True)
    draws = in_parallel(partial(run_draw, trial, seed), range(repeats), workers, progress)
    return Table1(vector.names, vector.values(trial.bsp), tuple(draws), seed, name)


def run_draw(
    trial: SyntheticTrial,
    seed: int,
    number: int,
    setup: Setup = TODAY,
    conditions: Iterable[str] = CONDITIONS,
) -> Draw:
    """Run one draw: these conditions from the same start, the noisy ones with the same noise."""
    rng = np.random.default_rng([seed, number])
    vector = ParameterVector(trial.bsp, symmetric=True)
    truth, start = vector.values(trial.bsp), vector.bsp(setup.start(vector, rng))
    margin = round(setup.margin_s / (trial.time[1] - trial.time[0]))
    inner = slice(margin, len(trial.time) - margin)
    time, wrench = trial.time[inner], trial.window.wrench[inner]
    spline = setup.spline(trial, setup.noise(trial, rng))
    windows = {
        "no_noise": Window(time, trial.motion.cut(inner), wrench),
        "noise": Window(time, Motion(*(spline(time, order) for order in range(3))), wrench),
    }
    errors, wrong, costs, converged = {}, {}, {}, {}
    for condition in conditions:
        correct = condition.startswith("correction")
        window = windows["no_noise" if condition.endswith("no_noise") else "noise"]
        path, costs[condition], converged[condition] = setup.estimate(trial.skeleton, start, window, correct)
        bsp = vector.bsp(path[-1])
        motion = correct_pelvis(trial.skeleton, bsp, window) if correct else window.motion
        wrong[condition] = path - truth
        errors[condition] = errors_by_class(path[-1] - truth, residual(trial.skeleton, bsp, motion, wrench))
    return Draw(number, errors, wrong, costs, converged)


def errors_by_class(parameters: np.ndarray, residual: np.ndarray) -> Errors:
    """Compute errors of the parameters (49) by class, and of a residual (n, 6)."""
    by_segment = parameters.reshape(-1, 7)
    groups = (by_segment[:, 4:], by_segment[:, :1], by_segment[:, 1:4], residual[:, :3], residual[:, 3:])
    values = [value for group in groups for value in (rms(group), np.abs(group).max())]
    return Errors(*map(float, values))


def table1_json(table: Table1) -> dict[str, object]:
    """Return the study as stored in `table1.json`: per condition the mean over draws, and every draw."""
    return {
        "trial": table.trial,
        "seed": table.seed,
        "repeats": len(table.draws),
        "conditions": {condition: asdict(table.mean(condition)) for condition in CONDITIONS},
        "spread": {condition: asdict(table.spread(condition)) for condition in CONDITIONS},
        "published": {condition: asdict(PUBLISHED[condition]) for condition in CONDITIONS},
        "parameters": list(table.parameters),
        "truth": table.truth.tolist(),
        "draws": [
            {
                "number": draw.number,
                "start_errors": draw.start_errors.tolist(),
                "conditions": {
                    condition: {
                        **asdict(draw.errors[condition]),
                        "converged": draw.converged[condition],
                        "parameter_errors": draw.parameter_errors[condition][-1].tolist(),
                    }
                    for condition in CONDITIONS
                },
            }
            for draw in table.draws
        ],
    }
