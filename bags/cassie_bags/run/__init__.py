"""One run of an experiment: its parts, evaluation, replay and fingerprint."""
