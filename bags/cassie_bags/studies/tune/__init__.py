"""Search for controller parameters that walk well on many grounds, robots and pushes."""
