"""The typed model of an experiment file: every key, for all readers of such files."""
