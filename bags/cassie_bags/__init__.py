"""Recording, recovery, replay and experiments with Cassie."""
