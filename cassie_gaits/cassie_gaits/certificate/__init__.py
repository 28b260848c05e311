"""An independent check of a gait library: the 20-DoF model, integrated under the gait's torques.

Shares no code with `cassie_gaits.optimize`, and reads nothing but the file.

    walker     the robot with rigid springs on one foot: motion, ground force, impact
    states     states of the robot from a gait's coefficients
    rollout    a step, integrated
    table      what is required of a gait, and how far it is inside
    certify    all of it for a gait
    seal       what ties a certificate to gait, model and checker
"""
