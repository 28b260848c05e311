"""The typed model of an experiment file: every key, for all who read such files."""
