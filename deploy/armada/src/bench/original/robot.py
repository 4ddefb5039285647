"""The original AbstractRobot of Robot Raconteur, measured for `armada bench original`.

robot.py versions              what is installed
robot.py serve ARMS PERIOD_S   that many simulated seven-axis arms with a loop each, over TCP
robot.py client PORT           a client of the first of them

Says first what it has, then answers one JSON question a line with one JSON object a line:
{"error": TEXT} where it cannot. Ends when its standard input ends. Times are of CLOCK_MONOTONIC.
"""

import importlib.metadata
import json
import os
import sys
import time

PACKAGES = ["robotraconteur", "robotraconteurcompanion", "robotraconteur-abstract-robot"]
JOINTS = 7
HOME = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
ROBOT = "com.robotraconteur.robotics.robot"
TRAJECTORY = "com.robotraconteur.robotics.trajectory"


def now_ns():
    """The clock that this program reads too."""
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def node():
    """The node of this process, which knows the standard types."""
    import RobotRaconteur as RR
    import RobotRaconteurCompanion as companion

    raconteur = RR.RobotRaconteurNode.s
    raconteur.SetLogLevelFromString("ERROR")
    companion.RegisterStdRobDefServiceTypes(raconteur)
    transport = RR.TcpTransport()
    raconteur.RegisterTransport(transport)
    return raconteur, transport


def description(index):
    """RobotInfo of an arm, as the companion's loader takes it."""

    def named(name, number):
        return {"name": name, "uuid": f"00000000-0000-4000-8000-{number:012x}"}

    limits = {"lower": -6.3, "upper": 6.3, "home": 0.0, "velocity": 2.0, "acceleration": 10.0}
    joints = [
        {
            "joint_identifier": named(f"joint_{joint + 1}", joint + 1),
            "joint_type": "revolute",
            "joint_limits": {**limits, "jerk": 0.0, "effort": 0.0},
            "default_units": "radian",
            "default_effort_units": "newton_meter",
            "passive": False,
        }
        for joint in range(JOINTS)
    ]
    axes = [{"x": 0.0, "y": joint % 2, "z": 1 - joint % 2} for joint in range(JOINTS)]
    chain = {
        "kin_chain_identifier": named("arm", 100),
        "H": axes,
        "P": [{"x": 0.0, "y": 0.0, "z": 0.2}] * (JOINTS + 1),
        "link_identifiers": [named(f"link_{link}", 200 + link) for link in range(JOINTS + 1)],
        "joint_numbers": list(range(JOINTS)),
        "flange_identifier": named("flange", 300),
    }
    return {
        "device_info": {
            "device": named(f"arm_{index}", 1000 + index),
            "manufacturer": named("simulation", 400),
            "model": named("seven_axis_arm", 401),
        },
        "robot_type": "serial",
        "joint_info": joints,
        "chains": [chain],
        "robot_capabilities": ["jog_command", "trajectory_command", "software_enable"],
    }


def simulated(raconteur):
    """A class of arms that are where they were told to be a tick before."""
    import numpy as np
    from robotraconteur_abstract_robot import AbstractRobot
    from RobotRaconteurCompanion.Util.InfoFileLoader import InfoFileLoader

    class SimulatedArm(AbstractRobot):
        def __init__(self, index, period):
            loader = InfoFileLoader(raconteur)
            info, self.locks = loader.LoadInfoFileFromDict(
                description(index), f"{ROBOT}.RobotInfo", "device"
            )
            super().__init__(info, JOINTS)
            self._update_period = period
            self.pose = np.zeros((1,), dtype=self._pose_dtype)
            self.twist = np.zeros((1,), dtype=self._spatial_velocity_dtype)
            self.wakes = []
            self.to_home()

        def to_home(self):
            """Forgets all motion, for the next measurement of the first."""
            self.position = np.array(HOME)
            self.home, self.moved = self.position, None

        def _run_timestep(self, now):
            self.wakes.append(now_ns())
            with self._lock:
                self._joint_position = self.position
                self._joint_velocity = np.zeros((JOINTS,))
                self._joint_effort = np.zeros((JOINTS,))
                self._endpoint_pose, self._endpoint_vel = self.pose, self.twist
                self._last_robot_state = self._last_joint_state = self._last_endpoint_state = now
                self._ready = self._enabled = True
            super()._run_timestep(now)

        def _send_robot_command(self, now, joint_pos_cmd, joint_vel_cmd):
            if joint_pos_cmd is None:
                return
            if self.moved is None and np.max(np.abs(joint_pos_cmd - self.home)) > 1e-9:
                self.moved = now_ns()
            self.position = self._position_command = joint_pos_cmd

        def _stopwatch_ellapsed_s(self):
            # Asked for the first time by the loop, whose deadlines are whole periods from then.
            self.phase = now_ns()
            self._stopwatch_ellapsed_s = super()._stopwatch_ellapsed_s
            return self._stopwatch_ellapsed_s()

        def take_wakes(self, since):
            """Wake-ups from the state of a number on: each tick makes one."""
            return {"phase_ns": self.phase, "first": since, "ns": self.wakes[since - 1 :]}

        def _send_disable(self, handler):
            handler(None)

        def _send_enable(self, handler):
            handler(None)

        def _send_reset_errors(self, handler):
            handler(None)

    return SimulatedArm


class Server:
    """Arms with a service each."""

    def __init__(self, arms, period):
        raconteur, transport = node()
        transport.StartServer(0, True)
        make = simulated(raconteur)
        self.arms = [make(index, period) for index in range(arms)]
        for index, arm in enumerate(self.arms):
            raconteur.RegisterService(f"arm_{index}", f"{ROBOT}.Robot", arm)
            arm._start_robot()
        self.ready = {"port": transport.GetListenPort(), **versions()}

    def wakes(self, ask):
        """Wake-ups of each loop over a time from now, and the processor time used."""
        since = [len(arm.wakes) + 1 for arm in self.arms]
        begin = time.process_time(), now_ns()
        time.sleep(ask["seconds"])
        used = (time.process_time() - begin[0]) / ((now_ns() - begin[1]) / 1e9)
        taken = [arm.take_wakes(first) for arm, first in zip(self.arms, since, strict=True)]
        return {"loops": taken, "cpu_share": used}

    def to_home(self, _):
        """The first arm back to where it started."""
        self.arms[0].to_home()
        return {}

    def moved(self, _):
        """When the first arm was told to be elsewhere; null if it was not."""
        return {"ns": self.arms[0].moved}


class Client:
    """A client of one arm."""

    def __init__(self, port):
        self.raconteur, _ = node()
        url = f"rr+tcp://127.0.0.1:{port}?service=arm_0"
        self.robot = self.raconteur.ConnectService(url)
        constants = self.raconteur.GetConstants(ROBOT, self.robot)
        self.modes = constants["RobotCommandMode"]
        self.arrivals, self.listening = [], False
        self.wire = self.robot.robot_state.Connect()
        self.wire.WireValueChanged += self.note
        self.motion = None
        self.ready = versions()

    def note(self, _wire, state, _stamp):
        """A state has come."""
        if self.listening:
            self.arrivals.append([int(state.seqno), now_ns()])

    def listen(self, ask):
        """States over a time from now: the number of each and when it came."""
        self.arrivals, self.listening = [], True
        time.sleep(ask["seconds"])
        self.listening = False
        return {"arrivals": self.arrivals}

    def state_every(self, ask):
        """The state of every so many ticks from now on."""
        self.robot.isoch_downsample = ask["ticks"] - 1
        return {}

    def round_trips(self, ask):
        """Times of requests that read one value, one after the other."""
        times = []
        for _ in range(ask["rounds"]):
            begin = now_ns()
            _ = self.robot.command_mode
            times.append((now_ns() - begin) / 1e3)
        return {"us": times}

    def follow_mode(self):
        """Into the mode that takes trajectories, also after the arm has lost its mode."""
        if self.robot.command_mode != self.modes["trajectory"]:
            self.robot.command_mode = self.modes["halt"]
            self.robot.command_mode = self.modes["trajectory"]

    def close(self, motion):
        """Ends a motion."""
        try:
            motion.Close()
        except Exception:
            # A loop that was late has given up its mode, and with it the motion; ending it then
            # fails with an error of the original's own (t_index is not set).
            self.follow_mode()

    def trajectory(self, ask):
        """Times and positions as the original takes them."""
        import numpy as np

        def structure(name):
            return self.raconteur.GetStructureType(f"{TRAJECTORY}.{name}", self.robot)

        waypoint = structure("JointTrajectoryWaypoint")
        trajectory = structure("JointTrajectory")()
        trajectory.joint_names = [f"joint_{joint + 1}" for joint in range(JOINTS)]
        trajectory.waypoints = []
        empty = np.zeros((0,))
        for seconds, position in zip(ask["times_s"], ask["positions"], strict=True):
            point = waypoint()
            point.joint_position = np.array(position)
            point.joint_velocity = point.position_tolerance = point.velocity_tolerance = empty
            point.time_from_start = seconds
            trajectory.waypoints.append(point)
        return trajectory

    def accept(self, ask):
        """Times from the request for a trajectory to the answer; nothing moves."""
        trajectory, times = self.trajectory(ask), []
        for _ in range(ask["rounds"]):
            self.follow_mode()
            begin = now_ns()
            motion = self.robot.execute_trajectory(trajectory)
            times.append((now_ns() - begin) / 1e6)
            self.close(motion)
        return {"ms": times}

    def begin(self, ask):
        """Begins a motion; when the request was sent."""
        trajectory = self.trajectory(ask)
        self.follow_mode()
        sent = now_ns()
        self.motion = self.robot.execute_trajectory(trajectory)
        # The motion begins with the first question for its progress, whose answer may take 5 s.
        self.motion.AsyncNext(None, lambda _status, _error: None)
        return {"sent_ns": sent}

    def end(self, _):
        """Ends the motion that was begun."""
        self.close(self.motion)
        self.motion = None
        return {}


def versions():
    """What is installed; null for what is not."""
    found = {}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = None
    return {"python": ".".join(map(str, sys.version_info[:3])), "packages": found}


class Nothing:
    """Tells only what is installed."""

    ready = versions()


def main(role, *arguments):
    """Sets up, says so, and answers until the questions end."""

    def say(answer):
        print(json.dumps(answer), flush=True)

    try:
        if role == "serve":
            actor = Server(int(arguments[0]), float(arguments[1]))
        elif role == "client":
            actor = Client(int(arguments[0]))
        else:
            actor = Nothing()
        say(actor.ready)
    except Exception as error:
        say({"error": f"{type(error).__name__}: {error}"})
        os._exit(1)
    for line in sys.stdin:
        try:
            ask = json.loads(line)
            say(getattr(actor, ask["ask"])(ask))
        except Exception as error:
            say({"error": f"{type(error).__name__}: {error}"})
    # The threads of the node are not waited for.
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
