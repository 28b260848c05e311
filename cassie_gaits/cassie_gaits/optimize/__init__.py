"""Trajectory optimization of the gait library: the paper's problem in closed-form coordinates.

    bodies      rigid bodies and joints of the robot with rigid springs, as numbers
    rods        angles of heel spring and foot crank as functions of knee and toe, as symbols
    inverse_dynamics  recursive Newton-Euler from the stance foot, as symbols
    posture     joint angles from outputs and passive coordinates, as symbols
    step_model  quantities of the problem at one instant and at the change of legs
    request     the user's request
    grid        collocation points, and matrices from the unknowns to the coordinates there
    problem     the nonlinear program
    solution    its solution, and the resulting gait

Everything is written for a step on the right leg; a step on the left leg is its mirror image.
"""
