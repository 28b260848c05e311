"""State estimator, gait-library controller and mode supervisor of Cassie."""
