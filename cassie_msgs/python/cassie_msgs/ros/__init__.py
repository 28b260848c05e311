"""Code that all nodes share: the fast lane, parameters, start and shutdown."""
