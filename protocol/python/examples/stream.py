"""Streams positions to an arm, which swings a little and comes back: run `armada up` first."""

import numpy as np

import armada

DURATION_S = 6.0

with armada.connect() as cell:
    left = cell.robot("left_arm")
    centre = left.state().joint_position_rad
    with left.lease(), left.stream_position() as stream:
        for t in stream.ticks(rate_hz=100, duration_s=DURATION_S):
            # It begins and ends at rest: the swing grows and fades.
            swing = 0.1 * np.sin(np.pi * t / DURATION_S) ** 2 * np.sin(2.0 * t)
            stream.send(centre + swing)
    left.halt()
    print("swung:", left.status().command_mode)
