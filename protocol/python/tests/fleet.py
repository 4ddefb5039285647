"""A small gateway and small agents of bare `eclipse-zenoh` and `json`, for tests of the client.

They answer as the contract says, unless a test has them misbehave: whole-cell tests against the
real programs are elsewhere.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any
from uuid import UUID

import zenoh

from armada import codec
from armada.messages import JointLimits, RobotInfo
from armada.session import peer_config

GOLDEN = Path(__file__).resolve().parents[2] / "golden"
DEADLINE_S = 5.0
"""How long tests wait for what must happen."""

LEASE = "0192f0c5-0000-7000-8000-000000000004"
"""The lease that agents grant."""

SUB_LEASE = "0192f0c5-0000-7000-8000-000000000009"
"""The lease that agents grant to whom a holder delegates."""

Json = dict[str, Any]


def golden(stem: str) -> Json:
    """A golden sample."""
    sample: Json = json.loads((GOLDEN / f"{stem}.json").read_text())
    return sample


def robot_info(name: str, joints: list[str], limits: JointLimits) -> RobotInfo:
    """The golden robot with other joints."""
    rows = [
        {
            "name": joint,
            "type": "revolute",
            "limits": json.loads(codec.encode(limits)),
            "reduced": {"velocity": 0.25, "acceleration": 0.5},
        }
        for joint in joints
    ]
    return codec.decode(
        RobotInfo, json.dumps(golden("robot_info") | {"robot": name, "joints": rows}).encode()
    )


class Refused(Exception):  # noqa: N818, it is an answer
    """What a handler raises to refuse."""

    def __init__(self, code: str, message: str, **details: Any) -> None:
        super().__init__(message)
        self.denial = {"code": code, "message": message, "details": details}


class Node:
    """A session with answers to queries."""

    def __init__(self, mode: str, connect: list[str]) -> None:
        settings = peer_config(connect, listen=["tcp/127.0.0.1:0"])
        settings.insert_json5("mode", json.dumps(mode))
        settings.insert_json5("adminspace", '{"enabled": true}')
        self.session = zenoh.open(settings)
        self.endpoint = self._endpoint(mode)
        self.requests: list[tuple[str, Json]] = []
        """Requests as they came: method and envelope."""
        self.handlers: dict[str, Callable[[Json], Json]] = {}
        """Method to handler of its parameters."""
        self.raw: dict[str, Callable[[zenoh.Query], None]] = {}
        """Method to what is done with the query itself, before any handler."""
        self.values: dict[str, Callable[[], Json]] = {}
        """Key to value."""
        self._held: list[zenoh.Query] = []
        self._came = threading.Condition()

    def _endpoint(self, mode: str) -> str:
        for reply in self.session.get(f"@/{self.session.zid()}/{mode}"):
            if reply.ok is not None:
                locators: list[str] = json.loads(reply.ok.payload.to_string())["locators"]
                return locators[0]
        raise AssertionError("zenoh does not tell where it listens")

    def serve_rpc(self, prefix: str) -> None:
        """Answers the methods under a prefix."""
        self.session.declare_queryable(f"{prefix}/**", self._answer_rpc, complete=True)

    def serve_value(self, key: str, value: Callable[[], Json]) -> None:
        """Answers with a value."""
        self.values[key] = value
        self.session.declare_queryable(key, self._answer_value, complete=True)

    def hold(self, query: zenoh.Query) -> None:
        """Never answers."""
        self._held.append(query)

    def _answer_value(self, query: zenoh.Query) -> None:
        with query:
            key = str(query.key_expr)
            try:
                value = self.values[key]()
            except Refused as refused:
                query.reply_err(json.dumps(refused.denial), encoding="application/json")
            else:
                query.reply(key, json.dumps(value), encoding="application/json")

    def _answer_rpc(self, query: zenoh.Query) -> None:
        # A slow request holds up no other, as in real agents.
        threading.Thread(target=self._answer_one, args=(query,), daemon=True).start()

    def _answer_one(self, query: zenoh.Query) -> None:
        key = str(query.key_expr)
        method = key.rpartition("/")[2]
        assert query.payload is not None
        envelope = json.loads(query.payload.to_string())
        with self._came:
            self.requests.append((method, envelope))
            self._came.notify_all()
        if method in self.raw:
            self.raw[method](query)
            return
        with query:
            try:
                answer = self.handlers[method](envelope["params"])
            except Refused as refused:
                query.reply_err(json.dumps(refused.denial), encoding="application/json")
            else:
                query.reply(key, json.dumps(answer), encoding="application/json")

    def publish(self, key: str, message: Json) -> None:
        """Sends a sample."""
        self.session.put(key, json.dumps(message), encoding="application/json")

    def wait_for(self, method: str, times: int) -> bool:
        """Waits until a method was asked for so often."""
        with self._came:
            return self._came.wait_for(lambda: len(self.of_method(method)) >= times, DEADLINE_S)

    def of_method(self, method: str) -> list[Json]:
        """The envelopes of the requests of a method."""
        return [envelope for name, envelope in self.requests if name == method]

    def close(self) -> None:
        """Ends it without a word, as a killed process would."""
        self._held.clear()
        self.session.close()

    def __enter__(self) -> Node:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class Motions:
    """Motions that a node has accepted: published and queryable."""

    def __init__(self, node: Node, key: str, sample: str) -> None:
        self._node = node
        self._key = key
        self._status = {k: v for k, v in golden(sample).items() if k != "reason"}
        self.ends_as: str | None = "complete"
        """How motions end as soon as they are accepted; None if the test ends them."""
        self.accepted = threading.Event()
        self.asked = threading.Event()
        self.last = ""

    def accept(self, motion_id: str) -> Json:
        """Begins a motion, which may end at once."""
        self.last = motion_id
        self._status["seqno"] = 0
        self.set("running")
        self._node.serve_value(f"{self._key}/{motion_id}", self._ask)
        if self.ends_as is not None:
            self.set(self.ends_as)
        self.accepted.set()
        return {"motion_id": motion_id, "duration_s": 2.0, "epoch": 5}

    def _ask(self) -> Json:
        self.asked.set()
        return self._status

    def set(self, status: str, **changes: Any) -> None:
        """Gives the motion a new status and publishes it."""
        self.lose(status, **changes)
        self._node.publish(f"{self._key}/{self.last}", self._status)

    def lose(self, status: str, **changes: Any) -> None:
        """The same, but the sample gets lost."""
        seqno = self._status["seqno"] + 1
        self._status = self._status | {"id": self.last, "seqno": seqno, "status": status} | changes


class Agent(Node):
    """An agent of one robot."""

    def __init__(self, name: str, router: str) -> None:
        super().__init__("peer", [router])
        self.name = name
        self.prefix = f"robots/{name}"
        self.status = golden("robot_status") | {"robot": name, "motion": None, "stop": None}
        self.state = golden("robot_state") | {"motion": None}
        self.stages = ["received", "commanded", "standstill"]
        """What it acknowledges of a stop."""
        self.stops: list[Json] = []
        """Stops as they came, by either way."""
        self.deaf_for = 0
        """How many published stops it misses."""
        self.answers_stop_queries = True
        self.publishes_acks = True
        self.query_stages: list[str] = []
        """What it answers to queries one after the other; the first of `stages` if empty."""
        self.motions = Motions(self, f"{self.prefix}/motions", "motion_status")
        self.taken: dict[str, list[Json]] = {}
        """Samples of streams as they came, by the rest of their key."""
        self._done = threading.Event()
        self._publisher: threading.Thread | None = None
        self._serve()

    def _serve(self) -> None:
        self.serve_value(f"{self.prefix}/info", lambda: golden("robot_info") | {"robot": self.name})
        self.serve_value(f"{self.prefix}/status", lambda: self.status)
        self.serve_value(f"{self.prefix}/clock", lambda: golden("clock_sample"))
        self.handlers = {
            "set_mode": lambda params: self.enter(params["mode"]),
            "halt": lambda _: {"epoch": self.enter("halt")["epoch"]},
            "enable": lambda _: self.enter("halt"),
            "disable": lambda _: self.enter("halt"),
            "reset_errors": lambda _: self.enter("halt"),
            "reset": lambda params: {"cleared": params["stop_ids"], "epoch": 7},
            "jog_freespace": lambda params: self.motions.accept(params["motion_id"]),
            "execute_trajectory": lambda params: self.motions.accept(params["motion_id"]),
            "prepare": lambda params: {
                "motion_id": params["motion_id"],
                "duration_s": 2.0,
                "epoch": 5,
                "ttl_ms": 5000,
            },
            "commit": lambda params: self.motions.accept(params["motion_id"]),
            "cancel": self._cancel,
            "abort": lambda _: {},
            **self._newer_handlers(),
        }
        self.serve_rpc(f"{self.prefix}/rpc")
        self.session.declare_queryable(f"{self.prefix}/stop", self._stop_query, complete=True)
        self.session.declare_subscriber("cell/stop", self._stop_sample)
        self.session.declare_subscriber(f"{self.prefix}/stream/*", self._take_sample)
        self.session.declare_subscriber(f"{self.prefix}/command", self._take_sample)
        self._alive = self.session.liveliness().declare_token(f"{self.prefix}/alive")

    def _newer_handlers(self) -> dict[str, Callable[[Json], Json]]:
        def motion(params: Json) -> Json:
            return self.motions.accept(params["motion_id"])

        def answer(sample: str) -> Callable[[Json], Json]:
            return lambda _: golden(f"answer_{sample}")

        def set_status(status: str) -> Callable[[Json], Json]:
            def change(params: Json) -> Json:
                assert params["motion_id"] == self.motions.last
                self.motions.set(status)
                return {}

            return change

        moves = ("move_joint", "move_pose", "move_linear", "move_home", "home")
        equipment = ("attach_tool", "detach_tool", "attach_payload", "detach_payload")
        values = ("set_signal", "set_param")
        return {
            "acquire_lease": lambda params: (
                golden("answer_lease") | {"lease": LEASE, "ttl_ms": params["ttl_ms"]}
            ),
            "renew_lease": lambda params: (
                golden("answer_lease")
                | {"lease": params["lease"], "ttl_ms": params.get("ttl_ms", 1000)}
            ),
            "take_lease": lambda params: (
                golden("answer_lease") | {"lease": LEASE, "ttl_ms": params["ttl_ms"]}
            ),
            "delegate_lease": lambda params: (
                golden("answer_lease") | {"lease": SUB_LEASE, "ttl_ms": params["ttl_ms"]}
            ),
            "release_lease": answer("lease_released"),
            **dict.fromkeys((*moves, "jog_joint", "jog_cartesian"), motion),
            **dict.fromkeys(equipment, answer("equipment")),
            **dict.fromkeys(values, lambda params: params),
            "pause": set_status("paused"),
            "resume": set_status("running"),
            "set_speed_ratio": lambda params: {"speed_ratio": params["ratio"]},
            "get_signal": answer("signal"),
            "get_param": answer("param"),
            "forward_kinematics": answer("forward_kinematics"),
            "inverse_kinematics": answer("inverse_kinematics"),
            "save_recording": answer("recording"),
        }

    def samples(self, stream: str, count: int) -> list[Json]:
        """Samples of a stream in their order, as soon as there are so many."""
        with self._came:
            taken = self.taken.setdefault(stream, [])
            assert self._came.wait_for(lambda: len(taken) >= count, DEADLINE_S), stream
            return list(taken)

    def _take_sample(self, sample: zenoh.Sample) -> None:
        stream = str(sample.key_expr).removeprefix(f"{self.prefix}/")
        with self._came:
            self.taken.setdefault(stream, []).append(json.loads(sample.payload.to_string()))
            self._came.notify_all()

    def enter(self, mode: str) -> Json:
        """Enters a mode as real agents do: only through halt."""
        if mode != "halt" and self.status["command_mode"] not in ("halt", mode):
            raise Refused("wrong_mode", f"{mode} is entered from halt")
        self.status = self.status | {"command_mode": mode}
        return {"command_mode": mode, "epoch": 5}

    def _cancel(self, params: Json) -> Json:
        assert params["motion_id"] == self.motions.last
        self.motions.set("cancelled")
        return {}

    def publish_states(self, period_s: float = 0.005) -> None:
        """Publishes the state again and again until closed."""

        def publish() -> None:
            while not self._done.wait(period_s):
                self.state = self.state | {"seqno": self.state["seqno"] + 1}
                self.publish(f"{self.prefix}/state", self.state)

        self._publisher = threading.Thread(target=publish, daemon=True)
        self._publisher.start()

    def stop_publishing(self) -> None:
        """Ends that."""
        self._done.set()
        if self._publisher is not None:
            self._publisher.join(DEADLINE_S)

    def _ack(self, request: Json, stage: str) -> Json:
        return golden("stop_ack") | {
            "stop_id": request["stop_id"],
            "robot": self.name,
            "stage": stage,
        }

    def _follows(self, request: Json) -> bool:
        scope = request["scope"]
        return scope == "cell" or self.name in scope["robots"]

    def _stop_query(self, query: zenoh.Query) -> None:
        with query:
            assert query.payload is not None
            request = json.loads(query.payload.to_string())
            if not self.answers_stop_queries or not self._follows(request):
                return
            self.stops.append(request)
            stage = self.query_stages.pop(0) if self.query_stages else self.stages[0]
            ack = json.dumps(self._ack(request, stage))
            query.reply(f"{self.prefix}/stop", ack, encoding="application/json")

    def _stop_sample(self, sample: zenoh.Sample) -> None:
        request = json.loads(sample.payload.to_string())
        if self.deaf_for > 0:
            self.deaf_for -= 1
        elif self._follows(request):
            self.stops.append(request)
            for stage in self.stages if self.publishes_acks else ():
                self.publish(f"{self.prefix}/stop/ack", self._ack(request, stage))

    def close(self) -> None:
        self.stop_publishing()
        super().close()


class Gateway(Node):
    """The router of the cell."""

    def __init__(self) -> None:
        super().__init__("router", [])
        self.agents: list[Agent] = []
        self._changed = threading.Condition()
        self._alive: set[str] = set()
        self.session.liveliness().declare_subscriber("robots/*/alive", self._presence, history=True)
        self.motions = Motions(self, "cell/motions", "cell_motion_status")
        self.serve_value("cell/info", self._info)
        self.serve_value("cell/status", self._status)
        self.handlers = {
            "execute_trajectory": lambda params: self.motions.accept(params["motion_id"]),
            "cancel": self._cancel,
            "pause": self._set("paused"),
            "resume": self._set("running"),
            "set_speed_ratio": lambda params: {"speed_ratio": params["ratio"]},
            "check_clearance": lambda _: golden("answer_clearance"),
            "reset": lambda params: (
                golden("answer_cell_reset")
                | {"reset": [[robot, [str(UUID(int=0))]] for robot in params["resets"]]}
            ),
        }
        self.serve_rpc("cell/rpc")

    def _info(self) -> Json:
        row = golden("cell_info")["robots"][0]
        rows = [row | {"robot": a.name, "endpoint": a.endpoint} for a in self.agents]
        return golden("cell_info") | {"robots": rows}

    def _status(self) -> Json:
        sample = golden("cell_status")
        row = sample["robots"]["left_arm"]
        rows = {a.name: row | {"stop": a.status.get("stop")} for a in self.agents}
        return sample | {"robots": sample["robots"] | rows}

    def _cancel(self, params: Json) -> Json:
        assert params["motion_id"] == self.motions.last
        self.motions.set("cancelled")
        return {}

    def _set(self, status: str) -> Callable[[Json], Json]:
        def change(params: Json) -> Json:
            assert params["motion_id"] == self.motions.last
            self.motions.set(status)
            return {}

        return change

    def add(self, name: str) -> Agent:
        """Starts an agent of this cell."""
        agent = Agent(name, self.endpoint)
        self.agents.append(agent)
        with self._changed:
            # Its token is declared last: whoever sees it sees everything.
            assert self._changed.wait_for(lambda: name in self._alive, DEADLINE_S), name
        return agent

    def _presence(self, sample: zenoh.Sample) -> None:
        robot = str(sample.key_expr).split("/")[1]
        with self._changed:
            if sample.kind == zenoh.SampleKind.PUT:
                self._alive.add(robot)
            else:
                self._alive.discard(robot)
            self._changed.notify_all()

    def close(self) -> None:
        for agent in self.agents:
            agent.close()
        super().close()

    def die(self) -> None:
        """Ends the gateway alone."""
        super().close()
