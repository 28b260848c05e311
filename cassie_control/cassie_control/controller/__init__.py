"""Walking and standing: outputs, gait library, leg-angle adjustment, drive set-points."""
