"""Writing, reading and repair of bags, and bags as arrays; no experiment and no physics here."""
