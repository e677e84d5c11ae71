"""A node of ROS 2, which makes DDS readers and writers of topics."""

import os

from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from servo.mistake import Mistake
from servo.ros2.messages import Message

VARIABLES = {"ROS_DOMAIN_ID": "0", "CYCLONEDDS_URI": ""}
"""Environment variables of the domain and the network, with their defaults."""
PATIENCE = 10.0
"""Longest wait for a required message [s]."""
BLOCKS = duration(milliseconds=5)
"""Longest wait of a writer for a slow reader."""


class Node:
    """A node of ROS 2: a DDS participant in the domain that the environment variable ROS_DOMAIN_ID
    gives (0 if it is not set), which makes readers and writers of topics.
    """

    def __init__(self) -> None:
        """Join the DDS domain.

        Raises:
            Mistake: An environment variable has an invalid value.
        """
        domain, network = (os.environ.get(name, default) for name, default in VARIABLES.items())
        try:
            self._participant = DomainParticipant(int(domain))
        except (ValueError, OverflowError, DDSException):
            raise Mistake(
                f"ROS 2: CycloneDDS cannot start with ROS_DOMAIN_ID='{domain}' (0 to 232) and "
                f"CYCLONEDDS_URI='{network}': correct or unset them"
            ) from None

    def writer(self, topic: str, kind: Message) -> DataWriter[Message]:
        """Return a writer of a topic, by name, for messages of the DDS type `kind`. It is reliable,
        so that reliable and best-effort readers can read it; it keeps the newest message only, and
        waits up to 5 ms for a slow reader.
        """
        qos = Qos(Policy.Reliability.Reliable(BLOCKS), Policy.History.KeepLast(1))
        return DataWriter(self._participant, self._topic(topic, kind), qos)

    def reader(self, topic: str, kind: Message, depth: int = 1) -> DataReader[Message]:
        """Return a reader of a topic, by name, for messages of the DDS type `kind`. It is
        best-effort, so that it can read reliable and best-effort writers, and keeps the newest
        `depth` messages.
        """
        qos = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(depth))
        return DataReader(self._participant, self._topic(topic, kind), qos)

    def _topic(self, topic: str, kind: Message) -> Topic[Message]:
        return Topic(self._participant, f"rt/{topic.strip('/')}", kind)


def first(reader: DataReader[Message], topic: str) -> Message:
    """Wait for the next message of a reader, remove it from the reader and return it; `topic` is
    the topic's name for the error message.

    Raises:
        Mistake: No message has come within 10 s.
    """
    for message in reader.take_iter(timeout=duration(seconds=PATIENCE)):
        return message
    raise Mistake(
        f"{topic}: no message has come within {PATIENCE:g} s: start the program that "
        "publishes on this topic"
    )
