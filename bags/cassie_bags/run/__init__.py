"""One run of an experiment: what it is made of, and what tells it from another."""
