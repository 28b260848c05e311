"""An independent check of a gait library: the 20-DoF model, integrated under the gait's torques.

It shares no code with `cassie_gaits.optimize`, and reads only the file.

    walker     the robot with rigid springs on one foot: motion, ground force, impact
    states     states of the robot from a gait's coefficients
    rollout    integration of a step
    table      requirements on a gait, and its margins
    certify    all requirements for a gait
    seal       hashes that tie a certificate to gait, model and checker
"""
