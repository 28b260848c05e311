"""What every node shares: the fast lane, parameters, and starting and stopping cleanly."""
