"""`make build`, as far as it can be told without building."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

WORKSPACE = Path(__file__).resolve().parents[1] / ".workspace"


def test_a_new_environment_leaves_results_where_they_are(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(WORKSPACE)
    build = import_module("build")
    results = tmp_path / "build" / "sweeps" / "sweeps.json"
    caches = [tmp_path / "build" / name / "cache" for name in ("cassie_msgs", "cassie_bags")]
    for file in (results, *caches, tmp_path / "install" / "made_from"):
        file.parent.mkdir(parents=True)
        file.write_text("old old")
    monkeypatch.setattr(build, "ROOT", tmp_path)
    monkeypatch.setattr(build, "call", lambda *_: (tmp_path / "install").mkdir())
    assert build.bring_up_workspace("new")
    assert results.exists()
    assert not any(cache.exists() for cache in caches)
    assert not build.bring_up_workspace("new")
