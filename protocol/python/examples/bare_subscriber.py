"""Prints states with nothing but `eclipse-zenoh` and `json`: run `armada up` first."""

import json

import zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')

with zenoh.open(config) as session, session.declare_subscriber("robots/*/state") as states:
    for sample in states:
        robot = str(sample.key_expr).split("/")[1]
        print(robot, json.loads(sample.payload.to_string())["joint_position_rad"])
