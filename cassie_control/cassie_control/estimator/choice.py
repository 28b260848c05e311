"""The estimator that a configuration asks for."""

from __future__ import annotations

from cassie_control.estimator.base import LegEstimator
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.faults import MonitoredEstimator
from cassie_control.estimator.invariant import InvariantEstimator
from cassie_control.estimator.kinematic import KinematicEstimator


def make_monitored(config: EstimatorConfig, period: float) -> MonitoredEstimator:
    """The configured estimator, behind the monitor of the sensors."""
    return MonitoredEstimator(make_estimator(config, period), period)


def make_estimator(config: EstimatorConfig, period: float) -> LegEstimator:
    """The estimator named by `config.estimator`.

    Args:
        config: Parameters.
        period: Time between samples. In s.
    """
    if config.estimator == "invariant":
        return InvariantEstimator(config, period)
    return KinematicEstimator(config, period)
