"""The watch over local workers: those that die before they can work are replaced, within limits."""

from types import SimpleNamespace

import pytest
from distributed.core import Status

from servo.study.cluster import local as local_cluster
from servo.study.cluster import tasks as cluster
from servo.study.run import ClusterLost


class Cluster:
    """Two workers, and what they were scaled to."""

    def __init__(self, *statuses):
        self.workers = {n: SimpleNamespace(status=status) for n, status in enumerate(statuses)}
        self.scaled = []

    def scale(self, count):
        self.scaled.append(count)


def test_a_scheduler_is_waited_for_as_long_as_the_readme_says():
    assert cluster.PATIENCE == 20.0


def test_whole_workers_are_left_alone():
    cluster = Cluster(Status.running, Status.running)
    local_cluster._Replacement(cluster, 2)(2)
    assert (sorted(cluster.workers), cluster.scaled) == ([0, 1], [])


@pytest.mark.parametrize("status", [Status.closed, Status.failed])
def test_a_dead_worker_is_replaced(status):
    cluster = Cluster(Status.running, status)
    local_cluster._Replacement(cluster, 2)(1)
    assert (sorted(cluster.workers), cluster.scaled) == ([0], [2])


def test_workers_that_die_again_and_again_are_not_replaced_for_ever():
    cluster = Cluster(Status.closed, Status.closed)
    nurse = local_cluster._Replacement(cluster, 2, replaced=2 * local_cluster.MOST_REPLACED)
    with pytest.raises(
        ClusterLost, match="the worker processes end before they can work; there may be"
    ):
        nurse(0)
    nurse(1)  # one is at work
    assert cluster.scaled == []


def test_workers_that_never_come_are_not_waited_for_for_ever():
    nurse = local_cluster._Replacement(Cluster(), 2, without=local_cluster.LONGEST_START - 0.5)
    nurse(0)
    with pytest.raises(ClusterLost):
        nurse(0)


def test_a_whole_crew_begins_the_count_anew():
    nurse = local_cluster._Replacement(Cluster(Status.running, Status.running), 2, replaced=3)
    nurse(2)
    assert nurse.replaced == 0
