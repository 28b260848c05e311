"""Cassie walks on an imported library, which has no torques and no certificate."""

from __future__ import annotations

import pytest
from frost_file import content
from scipy.io import savemat

from cassie_bags.run.cores import make_loop, tick_count
from cassie_bags.run.experiment import parse_experiment
from cassie_bags.run.seed import resolve
from cassie_bags.run.simulate import Store, run
from cassie_bags.signals.metrics import measure
from cassie_bags.signals.track import make_track
from cassie_gaits.ros import optimize_gaits
from cassie_msgs.experiment.expectation import Phase

TEXT = """
start: standing
seed: 2
duration: 16.0
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.95}
  - {t: 2.0, mode: walk, height: 0.98}
  - {t: 5.0, vx: 0.5}
controller: {allow_uncertified: true}
"""


def test_it_walks_at_half_a_metre_per_second(tmp_path):
    mat, out = tmp_path / "library.mat", tmp_path / "imported.json"
    savemat(mat, content(sign=-1.0))
    assert optimize_gaits.main(["--import", str(mat), "--out", str(out)]) == 0
    experiment = resolve(parse_experiment(f"{TEXT}gait_library: {out}\n", "import"))
    store = Store()
    recording = store.recording(run(make_loop(experiment, store), range(tick_count(experiment))))
    found = measure(recording, make_track(recording), [Phase("walk", 10.0, 16.0)])
    assert not found.fell
    assert found.phases[0].values["vx"] == pytest.approx(0.5, abs=0.05)
