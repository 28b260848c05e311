"""`ros2 run cassie_gaits plot_gaits FILE`: pictures and a table of a gait library.

For the gaits that go straight it draws the nine outputs over phase, stick figures, torques against
their limits, foot clearance, the ground force in the friction cone and the cost of transport over
speed. For a grid it also draws maps of cost, friction and torque over all speeds, and the outputs
over turning rate and lateral speed. Exit status: 0, or 2 for a file that cannot be read.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.gait_library_file import PACKAGED, library_path, load_library
from cassie_gaits.gait_motion import Motion, motion
from cassie_gaits.names import LEG_DRIVES
from cassie_gaits.ros.frame import tool

MOST_STRIPS = 9
"""Largest number of speeds with stick figures; of more speeds, so many are chosen evenly."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="ros2 run cassie_gaits plot_gaits", description=__doc__)
    named = f"library to draw: a file, or one of {', '.join(PACKAGED)}"
    parser.add_argument("file", type=Path, metavar="FILE", help=named)
    parser.add_argument("--out", type=Path, help="folder for the pictures; by default FILE's name")
    return parser


def _run(options: argparse.Namespace) -> int:
    library = load_library(library_path(str(options.file)))
    folder = options.out or options.file.with_name(options.file.name.split(".")[0] + "_pictures")
    folder.mkdir(parents=True, exist_ok=True)
    _draw(library.gaits, folder)
    return 0


def _draw(gaits: Sequence[Gait], folder: Path) -> None:
    from cassie_gaits import gait_pictures as pictures  # matplotlib takes long to load

    straight = [gait for gait in gaits if gait.vy == 0.0 and gait.yaw_rate == 0.0] or list(gaits)
    pictures.draw_outputs(straight, folder / "outputs.png")
    motions = []
    for i, gait in enumerate(straight):
        if sys.stderr.isatty():
            print(f"\r{i + 1} of {len(straight)} gaits", end="", file=sys.stderr, flush=True)
        if gait.torques is not None and gait.passive is not None:
            motions.append(_motion(gait))
    if sys.stderr.isatty():
        print(file=sys.stderr)
    if motions:
        picked = np.unique(np.linspace(0, len(motions) - 1, MOST_STRIPS).round().astype(int))
        pictures.draw_strips([motions[i] for i in picked], folder / "strips.png")
        pictures.draw_torques(motions, folder / "torques.png")
        pictures.draw_clearance(motions, folder / "clearance.png")
        pictures.draw_friction(motions, folder / "friction.png")
        pictures.draw_transport(motions, folder / "cost_of_transport.png")
        print(table(motions))
    else:
        print("the gaits have no torques: only their outputs are drawn")
    if len(straight) < len(gaits):
        from cassie_gaits import grid_pictures

        grid_pictures.draw_grid(gaits, folder / "grid.png")
        grid_pictures.draw_slices(gaits, folder)
    print(f"pictures: {folder}")


def _motion(gait: Gait) -> Motion:
    try:
        return motion(gait)
    except GaitLibraryError as error:
        raise GaitLibraryError(f"the gait of {gait.speeds}: {error}") from None


def table(motions: Sequence[Motion]) -> str:
    """A line for each gait."""
    header = (
        f"{'vx m/s':>7s} {'step s':>6s} {'cost':>8s} {'transport':>9s} {'W':>5s} "
        f"{'feet m':>6s} {'clear m':>7s} {'friction':>8s} {'pelvis m':>8s}  largest torque"
    )
    return "\n".join([header, *map(_line, motions)])


def _line(at: Motion) -> str:
    shares = at.torque_shares
    side, drive = np.unravel_index(int(np.argmax(shares)), shares.shape)
    name = f"{('stance', 'swing')[side]} {LEG_DRIVES[drive].replace('_', ' ')}"
    gait, cost = at.gait, at.gait.cost
    return (
        f"{gait.vx:7.2f} {gait.step_time:6.2f} {'-' if cost is None else f'{cost:.0f}':>8s} "
        f"{at.cost_of_transport:9.3f} {at.work / (2.0 * gait.step_time):5.0f} "
        f"{abs(at.feet[:, 1]).min():6.3f} {at.feet[len(at.feet) // 2, 2]:7.3f} "
        f"{at.friction.max():8.3f} {at.step.q[:, 2].mean():8.3f}  "
        f"{100.0 * shares[side, drive]:.0f} % of {name}"
    )


main = tool("plot_gaits", _parser, _run)

if __name__ == "__main__":
    sys.exit(main())
