"""Records the bags in bags/recordings anew: after a change that is meant to change trajectories.

A test replays them to the last bit. They hold the beginning of three runs, without ground truth.
"""

from pathlib import Path

from cassie_bags.bag.recording import LANE_TOPICS
from cassie_bags.run.bag_observer import bag_observer
from cassie_bags.run.cores import make_loop, tick_count
from cassie_bags.run.experiment import load_experiment, packaged_folder
from cassie_bags.run.seed import resolve
from cassie_msgs.layout import ControllerStatus

RUNS = {
    "walk": (
        "demo",
        "start=standing",
        "gantry=[]",
        "duration=4.0",
        "operator=[{t: 0.0, power: true, mode: stand}, {t: 0.4, mode: walk, vx: 0.6}]",
    ),
    "push": (
        "standing_pushes",
        "start=standing",
        "gantry=[]",
        "duration=3.0",
        "pushes=[{t: 1.5, duration: 0.1, force: [0.0, 180.0, 0.0]}]",
    ),
    "ride": ("segway_push", "duration=7.0"),
}
"""Experiment file and changes to it, by name of the bag; each of robot 1."""

TOPICS = LANE_TOPICS.keys() - {ControllerStatus.TOPIC}


def main() -> None:
    """Record them."""
    source = packaged_folder() / "experiments"
    folder = Path(__file__).resolve().parent.parent / "bags" / "recordings"
    folder.mkdir(exist_ok=True)
    for name, (file, *changes) in RUNS.items():
        changes += ["expect={}"]
        experiment = resolve(load_experiment(source / f"{file}.yaml", changes, seed=1))
        path = folder / f"{name}.mcap"
        path.unlink(missing_ok=True)
        with bag_observer(path, experiment, TOPICS) as observer:
            loop = make_loop(experiment, observer)
            for _ in range(tick_count(experiment)):
                loop.tick()
        print(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
