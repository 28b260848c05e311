"""Trajectory optimization of the gait library: the paper's problem in closed-form coordinates.

    bodies      rigid bodies and joints of the robot with rigid springs, as numbers
    rods        angles of heel spring and foot crank as functions of knee and toe, as symbols
    inverse_dynamics  recursive Newton-Euler from the stance foot, as symbols
    posture     joint angles from outputs and passive coordinates, as symbols
    step_model  what the problem asks at one instant and at the change of legs
    request     what the user asks for
    grid        where the constraints are placed and how the unknowns lead there
    problem     the nonlinear program
    solution    solving it, and the gait that comes out

Everything is written for a step on the right leg; a step on the left leg is its mirror image.
"""
