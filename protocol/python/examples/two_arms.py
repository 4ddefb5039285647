"""Lists the robots, reads a state, moves both arms together, stops: run `armada up` first."""

import armada

with armada.connect() as cell:
    print(cell.robots())
    left, right = cell.robot("left_arm"), cell.robot("right_arm")
    print(left.state().joint_position_rad)
    goals = {arm.name: arm.state().joint_position_rad + 0.2 for arm in (left, right)}
    motion = cell.move(goals, speed=0.3)
    print("arrived:", motion.status().status)
    print("stopped:", cell.stop("end of the example").verdict)
    cell.reset()
