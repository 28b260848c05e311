"""Model of Cassie for control: names, leg geometry, outputs, dynamics, and its gait library."""
