"""The watch over local workers: those that die before they can work are replaced, within limits."""

from concurrent.futures import ThreadPoolExecutor
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
    local_cluster.replace_dead(cluster, 2)
    assert (sorted(cluster.workers), cluster.scaled) == ([0, 1], [])


def test_a_thread_may_start_workers():
    """Only the main thread may say how Ctrl-C is handled."""

    def start():
        with local_cluster.local(1) as cluster:
            return cluster.name

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(start).result() == "the local cluster"


@pytest.mark.parametrize("status", [Status.closed, Status.failed])
def test_a_dead_worker_is_replaced(status):
    cluster = Cluster(Status.running, status)
    local_cluster.replace_dead(cluster, 2)
    assert (sorted(cluster.workers), cluster.scaled) == ([0], [2])


def test_a_cluster_without_workers_is_lost_after_a_while():
    patience = cluster.Patience(2 * cluster.TICK, "none for a second")
    patience(0)
    patience(1)
    patience(0)
    with pytest.raises(ClusterLost, match="none for a second"):
        patience(0)
