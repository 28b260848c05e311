"""An experiment file: what is run, on which robot, and which result is expected.

The simulator, the scripted operator and the experiments of cassie_bags read it here. `Experiment`
is the list of keys; the README of cassie_bags explains them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

from cassie_msgs.experiment.expectation import Expectation
from cassie_msgs.experiment.scenario import Draw, Scenario
from cassie_msgs.experiment.script import OperatorStep, RiderScript, require_order
from cassie_msgs.strict_yaml import YamlError, read_yaml
from cassie_msgs.structured import as_section, field_value, structure, structure_fields, unstructure
from cassie_msgs.tunables import ParameterError, as_mapping, flatten, tunable

NODES = ("simulator", "estimator", "controller", "supervisor")
"""Keys of the sections with parameters of nodes."""


@dataclass(frozen=True, kw_only=True)
class Experiment(Scenario):
    """All keys of an experiment file; a field is a key.

    Parameters of nodes have dotted names. The code that builds a node checks them against the
    parameters of that node.
    """

    name: str = tunable("experiment", description="Name of the experiment")
    about: str = tunable("", description="What the experiment is, in a sentence")
    seed: int = tunable(
        0, "", 0, 2**63 - 1, "Seed of robot and times; 0: the nominal robot at the written times"
    )
    drawn: bool = tunable(False, description="Robot and times are final: nothing is drawn any more")
    duration: float = tunable(
        0.0, "s", 0.0, 86400.0, "Robot time of the run; 0: until the run ends by itself"
    )
    operator: tuple[OperatorStep, ...] = ()
    rider: RiderScript | None = None
    gait_library: str | None = tunable(None, description="Path of the gait library")
    simulator: Mapping[str, Any] = field(default_factory=dict)
    estimator: Mapping[str, Any] = field(default_factory=dict)
    controller: Mapping[str, Any] = field(default_factory=dict)
    supervisor: Mapping[str, Any] = field(default_factory=dict)
    expect: Expectation = field(default_factory=Expectation)

    def __post_init__(self) -> None:
        """Order events, give parameters dotted names, refuse operator steps out of order."""
        super().__post_init__()
        require_order([step.t for step in self.operator], "operator")
        for node in NODES:
            try:
                object.__setattr__(self, node, flatten(getattr(self, node)))
            except ParameterError as error:
                raise ParameterError(f"{node}: {error}") from None

    @classmethod
    def from_content(cls, mapping: Mapping[str, Any], where: str) -> Experiment:
        """An experiment, from its keys.

        Values that are missing under `draw` are drawn from the seed, unless `drawn` is set.

        Raises:
            ParameterError: naming the key, its value and the permitted values.
        """
        given = {"seed": 0, "drawn": False} | dict(mapping)
        seed, drawn = (field_value(cls, key, given[key], where) for key in ("seed", "drawn"))
        if seed and not drawn:
            given["draw"] = as_mapping(Draw.from_seed(seed)) | dict(
                as_section(given.get("draw"), "draw")
            )
        return structure_fields(cls, given, where)

    @property
    def scenario(self) -> Scenario:
        """The part of the experiment that the simulator uses."""
        return Scenario(**{entry.name: getattr(self, entry.name) for entry in fields(Scenario)})

    @property
    def parameters(self) -> dict[str, Mapping[str, Any]]:
        """Parameters of each node in `NODES`, by dotted name."""
        return {node: getattr(self, node) for node in NODES}


def read_experiment(path: Path, needs: Collection[str] = ()) -> Experiment:
    """The experiment in a file. A file that is a list stands for the section `operator`.

    Args:
        path: YAML file.
        needs: Keys that the file must contain.

    Raises:
        ParameterError: if the file cannot be read, is no strict YAML, has an unknown key, lacks a
            key or has a wrong value; the message names file, path of the key, value and range.
    """
    try:
        content = read_yaml(path)
        if isinstance(content, list):
            content = {"operator": content}
        experiment = structure(Experiment, content)
    except YamlError as error:
        raise ParameterError(str(error)) from None
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
    for key in needs:
        if key not in as_section(content, ""):
            raise ParameterError(f"{path}: {key} must be given")
    return experiment


def to_yaml(experiment: Experiment) -> str:
    """The text of a file for this experiment. Numbers are written exactly."""
    content = unstructure(experiment)
    content = {key: content[key] for key in _FIRST} | content
    text: str = yaml.dump(content, Dumper=_Dumper, sort_keys=False, width=100)
    return text


_FIRST = ("name", "about", "seed", "drawn", "duration")  # first keys of a file that is written


class _Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data: object) -> bool:
        """Write an object that occurs twice in full each time: aliases are not read."""
        return True
