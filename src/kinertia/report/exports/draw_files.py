"""Writes posterior draws of a `Fit` as OpenSim's files: models, motions and external loads."""

from pathlib import Path

from kinertia.estimation.result.drawn_fit import chosen_draws, drawn_fit
from kinertia.estimation.result.fit import Fit
from kinertia.io.text.sto import write_table
from kinertia.report.exports.files import coordinates_table, write_model
from kinertia.report.exports.opensim_files import write_ground_reactions


def write_draws(fit: Fit, folder: Path, count: int, seed: int = 0) -> None:
    """Write `count` posterior draws, each into a sub-folder: `draw_001`, `draw_002` ...

    Each holds `model.osim`, `kinematics.mot`, `ground_reactions.mot` and `external_loads.xml`; with several trials the
    last three are in a folder per trial, and all share the model. The SD of another program's results over the draws is
    the posterior SD of its result.

    Args:
        fit: a fit by the simultaneous method.
        folder: folder to write to.
        count: number of draws; a result keeps 200, fewer for long trials.
        seed: selects draws and their order.

    Raises:
        KinertiaError: fewer draws are kept.
    """
    for place, number in enumerate(chosen_draws(fit, count, seed), start=1):
        drawn, into = drawn_fit(fit, number), folder / f"draw_{place:03d}"
        into.mkdir()
        write_model(drawn, into)
        for trial in drawn.trials:
            own = into if len(drawn.trials) == 1 else into / trial.name
            own.mkdir(exist_ok=True)
            remark = f"Posterior draw {number + 1} of {fit.subject.name}"
            write_table(own / "kinematics.mot", coordinates_table(drawn, trial), "kinematics", remark)
            write_ground_reactions(own, trial.reactions, trial.kinematics.window_s, drawn.skeleton.feet, remark)
