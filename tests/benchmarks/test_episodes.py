"""What building and closing an episode costs: with the process's GL context, and with a new one."""

from servo.loop.episode import Episode
from servo.scenario.load import load
from sim.camera import gl


def build_and_close():
    with Episode(load("still")):
        pass


def with_a_new_context():
    gl.call(gl.KEPT.__dict__.clear).result()
    build_and_close()


def test_with_the_context_of_the_process(benchmark):
    build_and_close()
    benchmark.pedantic(build_and_close, rounds=20)


def test_with_a_new_context_each_time(benchmark):
    benchmark.pedantic(with_a_new_context, rounds=20)
