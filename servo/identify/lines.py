"""Estimates from a robot's log as lines of a scenario's TOML file, and as a figure."""

from collections.abc import Mapping, Sequence
from math import floor

import numpy as np

from servo.identify.doubts import MILLI, interval_text
from servo.identify.fit import Identified
from servo.identify.log import Log, Series
from tracking.drawing.figures import Drawing, literal, panels
from tracking.statistics.comparisons import Interval

BEFORE = 0.3
"""Drawn time before the largest change of a channel's command [s]."""
SHOWN = 3.0
"""Drawn time of each channel [s]."""
UNTRUSTED = "not to be trusted"
"""Words with which the comment of a doubt about the settings begins."""


def lines(found: Identified, joints: Sequence[str], tick: float, doubts: Sequence[str]) -> str:
    """Return TOML with the settings that make a simulated robot move as the real one, and with
    their 95 % intervals and the doubts as comments.

    Args:
        found: The estimates from the robot's log.
        joints: Names of the simulated robot's joints, in order.
        tick: Interval of the simulated drives, which take commands over at its multiples [s].
        doubts: Sentences about the reasons why the settings may be wrong.
    """
    late = found.delay.value + found.transport
    steps = floor(late / tick + 0.5)
    latency = max(0.0, (steps - 0.5) * tick)
    arrival = f" and {found.transport * MILLI:.2f} ms until a picture arrives"
    delay = (
        f"latency_ms = {latency * MILLI:.2f}  # a delay of {interval_text(found.delay, MILLI)} ms "
        f"before the drive{arrival if found.transport > 0 else ''} was found; simulated drives "
        f"take commands over every {tick * MILLI:.4g} ms, so these after "
        f"{steps * tick * MILLI:.4g} ms"
    )
    jitter = "# jitter_ms: not known; it needs arrived_s with varied times of the clock of time_s"
    if found.jitter is not None:
        waits = interval_text(found.jitter, MILLI)
        jitter = f"jitter_ms = {found.jitter.value * MILLI:.2f}  # {waits}"
    lag = (
        f"lag_ms = {found.lag.value * MILLI:.2f}  # {interval_text(found.lag, MILLI)} ms before "
        f"the drive's own servo, which adds {float(np.mean(found.servos)) * MILLI:.3g} ms"
    )
    play = _each("backlash", found.play, joints) or [
        "# backlash: not known; it needs command_JOINT_m_s (or _rad_s) of a joint that reverses, "
        "and its positions behind the gear, joint_JOINT_m"
    ]
    if found.is_behind and any(each.low > 0 for each in found.play.values()):
        play.append("# this play is behind the lag; a simulated one is before it")
    noise = _each("encoder_noise", found.noise, joints) or [
        "# encoder_noise: not known; it needs encoder_JOINT_m of a joint that stands for a while"
    ]
    if found.step:
        noise.append(_step(found.step, joints))
    gains = ", ".join(f"{name} {interval_text(gain)}" for name, gain in found.gain.items())
    whole = found.whole
    head = [
        *(f"# {UNTRUSTED}: {doubt}" for doubt in doubts),
        f"# the whole robot as one delay, {interval_text(whole.delay, MILLI)} ms, and one lag, "
        f"{interval_text(whole.lag, MILLI)} ms; together {interval_text(whole.sum, MILLI)} ms",
        f"# gain from command to motion: {gains}; simulated drives have 1, less friction",
    ]
    run = ["[run]", delay, jitter]
    return "\n".join([*head, "", *run, "", "[robot]", lag, *play, *noise, ""])


def picture(log: Log, found: Identified) -> Drawing:
    """Return a drawing of commanded, measured and modelled rates [m/s, rad/s] of each channel (a
    joint, or a component of the camera's twist), for 3 s around the largest change of its command.

    Args:
        log: A robot's log.
        found: The estimates from it.
    """
    figure, axes = panels(9.0, 2.4 * len(log.channels), len(log.channels))
    for channel, modelled, ax in zip(log.channels, found.modelled, axes, strict=True):
        command = channel.command
        jump = command.times[1:][np.argmax(np.abs(np.diff(command.values)))]
        ax.step(command.times, command.values, where="post", color="grey", label="asked")
        ax.plot(*_rates(channel.moved), ".", label="measured")
        ax.plot(*_rates(modelled), label="modelled")
        ax.set_xlim(jump - BEFORE, jump - BEFORE + SHOWN)
        ax.set_ylabel(literal(f"{channel.name} [{channel.unit}/s]"))
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False)
    axes[-1].set_xlabel("time [s]")
    return figure


def _rates(positions: Series) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle times and the mean rates (n - 1,) between consecutive positions."""
    intervals = np.diff(positions.times)
    return positions.times[1:] - intervals / 2, np.diff(positions.values) / intervals


def _each(key: str, found: Mapping[str, Interval], joints: Sequence[str]) -> list[str]:
    """Return the TOML line `key = [...]` with a value for each joint; an empty list if no joint has
    an estimate.
    """
    if not found:
        return []
    values = {name: f"{each.value:.3g}" for name, each in found.items() if each.low > 0}
    each = ", ".join(f"{name} {interval_text(interval)}" for name, interval in found.items())
    zeros = {
        "not distinguished from 0": [name for name in found if name not in values],
        "not measured": [name for name in joints if name not in found],
    }
    each += "".join(f"; {why}, so 0: {', '.join(of)}" for why, of in zeros.items() if of)
    return [f"{key} = {_listed(values, joints)}  # {each}"]


def _step(found: Mapping[str, float], joints: Sequence[str]) -> str:
    """Return the TOML line `encoder_step = [...]` with the steps of the joints' encoders [m,
    rad].
    """
    names = ", ".join(found)
    steps = {name: f"{step:.6g}" for name, step in found.items()}
    return (
        f"encoder_step = {_listed(steps, joints)}  # all readings of {names} are multiples of it, "
        "so a noise below its half is not seen"
    )


def _listed(values: Mapping[str, str], joints: Sequence[str]) -> str:
    """Return a TOML list with a number for each joint of the simulated robot; joints without a
    value have 0.
    """
    return f"[{', '.join(values.get(name, '0.0') for name in joints)}]"
