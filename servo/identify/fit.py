"""Estimates of a robot's delay, lag, gains, play, noise and jitter, most with intervals, from its
log.

The model is the simulator's: the integral of the commands, delayed, passes the play of the gear,
the drive's lag, and the drive's own servo, whose time constant is known. The gear of a real robot
is behind motor and servo, so that order is fitted too, and the better one is taken. The linear
parameters (each channel's drift, gain and friction) are solved for in each step (variable
projection, Golub and Pereyra 1973), the others by least squares. Intervals are the linear limit of
a bootstrap over blocks of the log, since residuals of blocks are independent and consecutive
residuals are not.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import csr_array
from scipy.stats import beta, chi2
from scipy.stats import t as student

from servo.identify.drive import GRID, after_lag, after_play, summed
from servo.identify.log import Log, LogChannel, Series
from sim.types import Array
from tracking.statistics.comparisons import Interval

BLOCK = 2.0
"""Length of a block [s]: the time after which the drift absorbs an error of the position."""
LONGEST = 0.5
"""Longest delay of the search [s]."""
SLOWEST = 0.5
"""Longest lag of the search [s]."""
TRADE = 8e-3
"""Shift between delay and lag of two further starts [s], since they nearly replace each other."""
SETTLED = 5.0
"""Time until a robot stands after its delay, in lags."""
STANDS = 0.1
"""Further time until the drives' own servo stands as well [s]."""
LEVEL = 0.95
"""Confidence level of the intervals."""
DRIFT = 2.0
"""Interval of the knots of a channel's drift [s]; positions integrate unmodelled effects."""
MOST_KNOTS = 40
"""Largest number of knots of a drift; longer logs have longer pieces."""
NEARLY = 1e-6
"""Relative change of the squared error, or of the parameters, at which a fit ends; far below the
widths of the intervals."""
KEPT = 4
"""Number of cached motions of a channel; a derivative by one play leaves the other channels."""
STILL = 0.02
"""Share of a channel's largest rate below which friction holds it."""
FEWEST = 3
"""Least number of readings of a standstill for an estimate of noise."""
ROUNDING = 1e-9
"""Largest difference of readings due to rounding, over their range."""
OFF_STEP = 0.05
"""Largest distance of readings from multiples of an encoder's step, in steps."""
REPEATED = 0.1
"""Least share of repeated readings of an encoder with a step; with fewer, noise is larger than the
step of the digits."""


@dataclass(frozen=True, slots=True)
class Whole:
    """Delay and lag from a command to the robot's motion, including the drives' own servo; their
    sum; and this sum for each channel (a joint, or a component of the camera's twist) fitted alone,
    by its name. All are in s, with 95 % intervals.
    """

    delay: Interval
    """Time from a command's stamp to the first motion [s]."""
    lag: Interval
    """Time constant of the motion after the delay [s]."""
    sum: Interval
    """Sum of both [s], by which the motion follows its command in a long ramp."""
    apart: dict[str, Interval]
    """Sum of delay and lag of each channel fitted alone [s]."""


@dataclass(frozen=True, slots=True)
class Identified:
    """The estimates of `identify` from a robot's log: delay, lag, gains, play (backlash), noise,
    encoder steps and jitter, most with 95 % intervals, and the positions that the model with these
    estimates gives. Those of single channels (a joint, or a component of the camera's twist) are by
    name.
    """

    delay: Interval
    """Time from a command's stamp until the drives take it over [s]."""
    lag: Interval
    """Time constant of the drives before their own servo [s]."""
    whole: Whole
    """Delay and lag as a user measures them, drives included."""
    gain: dict[str, Interval]
    """Ratio of motion to commanded motion of each channel."""
    play: dict[str, Interval]
    """Play of each joint that was measured behind its gear and reversed [m, rad]."""
    noise: dict[str, Interval]
    """Standard deviation of each encoder's readings at standstill, without its step [m, rad]."""
    step: dict[str, float]
    """Step of the encoders whose readings are its multiples [m, rad]."""
    jitter: Interval | None
    """Longest less shortest time from a picture's stamp to its arrival [s]; None if unknown."""
    transport: float
    """Shortest time from a picture's stamp to its arrival [s]; 0 if unknown."""
    modelled: list[Series]
    """Modelled positions of each channel."""
    servos: Sequence[float]
    """Time constant of the drive's own servo in each channel, not part of delay and lag [s]."""
    is_behind: bool
    """True where play behind the lag explains the log better than play before it."""


def identify(log: Log, servos: Sequence[float] | Array) -> Identified:
    """Estimate delay, lag, gains, play (backlash), noise and jitter of the robot that recorded a
    log.

    Args:
        log: The log.
        servos: Time constant of the simulated drive's own servo for each channel of the log (a
            joint, or a component of the camera's twist), in order [s]; it is not part of the
            estimated lag.
    """
    channels = log.channels
    model_of = partial(_Model, channels, resolution=GRID + log.uncertain)
    fitted = _solved(model_of(servos, is_behind=False))
    if fitted.model.has_play.any():
        behind = _solved(model_of(servos, is_behind=True), fitted.values)
        fitted = min(fitted, behind, key=lambda fit: fit.model.misfit(fit.values))
    model = fitted.model
    none = np.zeros(len(servos))
    start = fitted.values + np.mean(servos) * (np.arange(len(fitted.values)) == 1)
    whole = _solved(model_of(none, is_behind=model.is_behind), start)
    apart = _apart(fitted, channels, servos)
    apart_whole = _apart(whole, channels, none)
    # The simulated lag begins a step late, half of which the model has in its positions.
    delays = [each.interval(0, 1, more=GRID / 2) for each in apart_whole]
    pairs = zip(channels, apart, model.has_play, strict=True)
    steps = {c.name: step for c in channels if (step := _step(c.encoder.values))}
    noises = {
        c.name: noise
        for c, each in zip(channels, apart, strict=True)
        if (noise := _noise(c, *each.values[:2])) is not None
    }
    return Identified(
        fitted.interval(0, others=apart),
        fitted.interval(1, others=apart),
        Whole(
            whole.interval(0, more=GRID / 2, others=apart_whole),
            whole.interval(1, others=apart_whole),
            whole.interval(0, 1, more=GRID / 2, others=apart_whole),
            {c.name: each for c, each in zip(channels, delays, strict=True)},
        ),
        dict(zip((c.name for c in channels), fitted.gains(), strict=True)),
        {c.name: each.play() for c, each, has in pairs if has},
        {name: _beyond(noise, steps.get(name, 0.0)) for name, noise in noises.items()},
        steps,
        jitter_of(log.transport),
        float(np.min(log.transport, initial=np.inf)) if len(log.transport) else 0.0,
        model.positions(fitted.values),
        list(servos),
        model.is_behind,
    )


class _Model:
    """The motion of all channels (joints, or components of the twist) as a function of delay, lag
    and the play of each channel.
    """

    def __init__(
        self,
        channels: Sequence[LogChannel],
        servos: Sequence[float] | Array,
        *,
        is_behind: bool,
        resolution: float,
    ) -> None:
        self._channels = channels
        self._servos = servos
        self.is_behind = is_behind
        """True where the play is behind the lags."""
        self.resolution = resolution
        """Time that is added to the half width of an interval [s]; to that of a play, the travel in
        this time is added."""
        self.spans = np.array([np.ptp(c.moved.values) for c in channels])
        self.has_play = np.array(
            [
                c.shows_play and bool(c.command.values.min() < 0 < c.command.values.max())
                for c in channels
            ]
        )
        self.free = np.flatnonzero([True, True, *self.has_play])
        """Indices of the parameters that the log determines."""
        begin = min(c.moved.times[0] for c in channels)
        self.rates = [np.std(c.command.values) for c in channels]
        self._blocks_of = [(c.moved.times - begin) // BLOCK for c in channels]
        self._blocks = np.concatenate(self._blocks_of)
        self._factor = _student(len(np.unique(self._blocks)))
        self._scales = [np.std(c.moved.values) for c in channels]
        self._moved: list[Array] = []
        self._bases_of: list[Callable[[float, float, float], Array]] = []
        for channel, servo in zip(channels, servos, strict=True):
            drift = _drift(channel.moved.times)
            self._moved.append(_less(drift, channel.moved.values))
            basis = partial(_basis, channel, float(servo), drift, is_behind)
            self._bases_of.append(lru_cache(KEPT)(basis))

    def residuals(self, parameters: Array) -> Array:
        """Return measured less modelled positions of all channels (n,), each divided by the scale
        of its channel.
        """
        pairs = zip(self._errors(parameters), self._scales, strict=True)
        return np.concatenate([error / scale for error, scale in pairs])

    def weigh(self, parameters: Array) -> None:
        """Set the scale of each channel to the standard deviation of its own error; a channel that
        hardly moves is mostly friction.
        """
        self._scales = [np.std(error) + 1e-9 for error in self._errors(parameters)]

    def misfit(self, parameters: Array) -> float:
        """Return the negative log-likelihood with an error variance for each channel."""
        errors = self._errors(parameters)
        return float(sum(len(error) * np.log(np.std(error) + 1e-9) for error in errors))

    def positions(self, parameters: Array) -> list[Series]:
        """Return the modelled positions of each channel at the stamps of its measured ones."""
        return [
            Series(c.moved.times, c.moved.values - error)
            for c, error in zip(self._channels, self._errors(parameters), strict=True)
        ]

    def gains(self, parameters: Array) -> list[Interval]:
        """Return the ratio of motion to modelled motion of each channel, friction included.

        The intervals are those for known parameters.
        """
        found: list[Interval] = []
        bases = self._bases(parameters)
        for moved, (asked, _), blocks in zip(self._moved, bases, self._blocks_of, strict=True):
            gain = float(asked @ moved / (asked @ asked))
            scores = _of_blocks(asked * (moved - gain * asked), blocks)
            half = _student(len(scores)) * float(np.linalg.norm(scores) / (asked @ asked))
            found.append(Interval(gain, gain - half, gain + half))
        return found

    def slopes(self, parameters: Array) -> list[float]:
        """Return the ratio (unitless) of motion to modelled motion of each channel, in the order of
        the channels; friction is fitted separately.
        """
        pairs = zip(self._moved, self._bases(parameters), strict=True)
        return [float(_weights(basis, moved)[0]) for moved, basis in pairs]

    def covariance(self, jacobian: Array, residuals: Array) -> Array:
        """Return the covariance of the parameters, times the squared Student factor.

        It is the sandwich estimator of Huber (1967) and White (1980), with blocks as units.
        """
        bread = np.linalg.pinv(jacobian.T @ jacobian)
        scores = _of_blocks(jacobian * residuals[:, None], self._blocks)
        return self._factor**2 * bread @ scores.T @ scores @ bread

    def _errors(self, parameters: Array) -> list[Array]:
        """Return measured less modelled positions (n,) of each channel [m, rad]."""
        pairs = zip(self._moved, self._bases(parameters), strict=True)
        return [moved - _weights(basis, moved) @ basis for moved, basis in pairs]

    def _bases(self, parameters: Array) -> list[Array]:
        """Return the commanded motion and the motion lost to friction (2, n) of each channel,
        without the parts that a drift explains.
        """
        delay, lag, *plays = parameters.tolist()
        pairs = zip(self._bases_of, plays, strict=True)
        return [basis(delay, lag, play) for basis, play in pairs]


@dataclass(frozen=True, slots=True)
class _Fitted:
    """Fitted parameters of a model (delay, lag, and the play of each channel) with their
    uncertainty.
    """

    model: _Model
    values: Array
    """Delay [s], lag [s], and the play of each channel [its command's unit times s]."""
    squares: Array
    """Squares and products of the half widths of their intervals."""

    def interval(
        self, *which: int, more: float = 0.0, others: Sequence["_Fitted"] = ()
    ) -> Interval:
        """Return the estimate and 95 % interval of a parameter, or of the sum of several: delay and
        lag in s, a play in the unit of its channel's command times s.

        Args:
            which: Indices of the parameters.
            more: Time to add [s].
            others: Fits of parts of the log; the interval contains those of the fits that
                disagree.
        """
        value = float(self.values[list(which)].sum()) + more
        rate = float(np.array([1.0, 1.0, *self.model.rates])[which[0]])
        half = float(np.sqrt(self.squares[np.ix_(which, which)].sum()))
        half += self.model.resolution * rate
        found = [each.interval(*which, more=more) for each in others]
        other = [each for each in found if not each.low <= value <= each.high]
        low = min([value - half, *(each.low for each in other)])
        high = max([value + half, *(each.high for each in other)])
        return Interval(value, max(0.0, low), high)

    def play(self) -> Interval:
        """Return the play of the first channel in units of its positions, not of its command."""
        slope = abs(self.model.slopes(self.values)[0])
        asked = self.interval(2)
        return Interval(slope * asked.value, slope * asked.low, slope * asked.high)

    def gains(self) -> list[Interval]:
        """Return the gain of each channel, motion over modelled motion, with an interval that
        includes the uncertainty of delay, lag and play.
        """
        found = self.model.gains(self.values)
        halves = np.array([each.high - each.value for each in found])
        for place in self.model.free.tolist():
            other = self.values.copy()
            other[place] = self.interval(place).high
            changed = self.model.gains(other)
            pairs = zip(changed, found, strict=True)
            halves = np.hypot(halves, [there.value - here.value for there, here in pairs])
        pairs = zip(found, halves.tolist(), strict=True)
        return [Interval(each.value, each.value - half, each.value + half) for each, half in pairs]


def _apart(
    fitted: _Fitted, channels: Sequence[LogChannel], servos: Sequence[float] | Array
) -> list[_Fitted]:
    """Fit the model to each channel alone, with the place of the play that fits the whole log."""
    if len(channels) == 1:
        return [fitted]
    return [
        _solved(
            _Model(
                [channel],
                [servo],
                is_behind=fitted.model.is_behind,
                resolution=fitted.model.resolution,
            ),
            fitted.values[[0, 1, 2 + k]],
        )
        for k, (channel, servo) in enumerate(zip(channels, servos, strict=True))
    ]


def _solved(model: _Model, start: Array | None = None) -> _Fitted:
    """Fit a model by least squares, by default from the best of several starts."""
    if start is None:
        starts = [
            np.array([delay, lag, *(fraction * model.spans * model.has_play)])
            for delay in np.linspace(0.0, LONGEST / 2, 11)
            for lag in (0.01, 0.06)
            for fraction in (0.0, 0.05)
        ]
        start = min(starts, key=lambda p: float(np.sum(model.residuals(p) ** 2)))
    most = np.array([LONGEST, SLOWEST, *model.spans / 2])
    solve = partial(
        least_squares,
        model.residuals,
        bounds=(0.0, most + 1e-12),
        x_scale=most / 10,
        diff_step=1e-3,
        ftol=NEARLY,
        xtol=NEARLY,
    )
    first = solve(np.clip(start, 0.0, most)).x
    model.weigh(first)
    trade = np.array([TRADE, -TRADE, *np.zeros(len(model.spans))])
    tries = [np.clip(first + shift, 0.0, most) for shift in (-trade, 0.0, trade)]
    found = min(map(solve, tries), key=lambda result: float(result.cost))
    free = model.free
    squares = np.zeros((len(most), len(most)))
    squares[np.ix_(free, free)] = model.covariance(found.jac[:, free], found.fun)
    return _Fitted(model, found.x, squares)


def _student(blocks: int) -> float:
    """Return the factor from a standard deviation to the half width of a 95 % interval, by number
    of blocks of the log.
    """
    return float(student.ppf((1 + LEVEL) / 2, max(1, blocks - 1)))


def _of_blocks(scores: Array, blocks: Array) -> Array:
    """Return the sums of the scores (n, ...) over each block of the log, given the block of each
    score (n,).
    """
    return np.array([scores[blocks == block].sum(axis=0) for block in np.unique(blocks)])


def _weights(basis: Array, moved: Array) -> Array:
    """Return the least-squares weights (2,) of a basis (2, n) for a motion (n,)."""
    return np.linalg.pinv(basis @ basis.T, hermitian=True) @ (basis @ moved)


def _basis(
    channel: LogChannel,
    servo: float,
    drift: tuple[csr_array, Array],
    is_behind: bool,
    delay: float,
    lag: float,
    play: float,
) -> Array:
    """Return the commanded motion and the friction (2, n) without the part that a drift explains.

    Their weighted sum is the channel's motion.
    """
    moved = channel.moved
    grid = _grid(moved.times)
    asked = summed(channel.command, grid[-1])
    # The simulated lag begins a step of the physics late, and positions are half a step ahead.
    motion = np.interp(grid - delay - GRID / 2, asked.times, asked.values)
    if not is_behind:
        motion = after_play(motion, play)
    motion = after_lag(after_lag(motion, lag), servo)
    if is_behind:
        motion = after_play(motion, play)
    rate = np.diff(motion, prepend=motion[0])
    slides = np.sign(rate) * (np.abs(rate) > STILL * np.abs(rate).max())
    friction = after_lag(GRID * np.cumsum(slides), servo)
    both = [np.interp(moved.times, grid, each) for each in (motion, friction)]
    return np.stack([_less(drift, each) for each in both])


def _grid(times: Array) -> Array:
    """Return the times of the modelled motion [s], `GRID` s apart, around the given times."""
    return np.arange(times[0] - GRID, times[-1] + GRID, GRID)


def _drift(times: Array) -> tuple[csr_array, Array]:
    """Return hat functions (n, k), whose weighted sum is piecewise linear, and the inverse of their
    products (k, k).
    """
    grid = _grid(times)
    knots = np.linspace(grid[0], grid[-1], 1 + min(MOST_KNOTS, 1 + int(np.ptp(grid) / DRIFT)))
    hats = csr_array(np.stack([np.interp(times, knots, hat) for hat in np.eye(len(knots))], axis=1))
    # A gap of the log may leave a hat without readings.
    return hats, np.linalg.pinv((hats.T @ hats).toarray(), rcond=1e-12, hermitian=True)


def _less(drift: tuple[csr_array, Array], values: Array) -> Array:
    """Return values (n,) less their least-squares fit by a drift, which is given as `_drift`
    returns it.
    """
    hats, inverse = drift
    return values - hats @ (inverse @ (hats.T @ values))


def _noise(channel: LogChannel, delay: float, lag: float) -> Interval | None:
    """Return the standard deviation of an encoder at standstill [m, rad], with its chi-squared
    interval; None if there are no readings, or too few at standstill.

    Each standstill has a level, and the end of the motion before it, which decays with the lag.
    """
    command = channel.command
    read = channel.encoder
    if not len(read.values):
        return None
    squares = 0.0
    freedom = 0
    settled = delay + SETTLED * lag + STANDS
    changed = np.flatnonzero(np.diff(command.values, prepend=np.nan) != 0)
    for first, after in zip(changed, [*changed[1:], None], strict=True):
        if command.values[first] != 0:
            continue
        begin = command.times[first] + settled
        until = np.inf if after is None else command.times[after]
        still = (read.times > begin) & (read.times < until)
        if still.sum() >= FEWEST:
            values = read.values[still]
            end = np.exp(-(read.times[still] - begin) / max(lag, GRID))
            basis = np.stack([np.ones_like(end), end], axis=1)
            solution, _, rank, _ = np.linalg.lstsq(basis, values)
            squares += float(np.sum((values - basis @ solution) ** 2))
            freedom += len(values) - int(rank)
    if freedom < FEWEST:
        return None
    low, high = chi2.ppf([(1 + LEVEL) / 2, (1 - LEVEL) / 2], freedom)
    value, least, most = np.sqrt(squares / np.array([freedom, low, high]))
    return Interval(float(value), float(least), float(most))


def _step(readings: Array) -> float:
    """Return the step of an encoder, of which all differences of its readings (n,) are multiples; 0
    if there is no step.
    """
    if np.sum(np.diff(readings) == 0) <= REPEATED * len(readings):
        return 0.0
    span = np.ptp(readings)
    differences = np.diff(np.unique(readings))
    differences = differences[differences > ROUNDING * span]
    if len(differences) < FEWEST:
        return 0.0
    step = float(span / np.rint(span / differences.min()))
    multiples = (readings - readings.min()) / step
    return step if np.abs(multiples - np.rint(multiples)).max() < OFF_STEP else 0.0


def _beyond(noise: Interval, step: float) -> Interval:
    """Return the noise of an encoder before its readings are rounded to a step, since rounding adds
    step^2 / 12 to the square of the noise. A noise below half a step is not seen: it is returned as
    0, with an interval from 0 to half a step.
    """
    if noise.value < step / 2:
        return Interval(0.0, 0.0, step / 2)
    squares = np.array([noise.value, noise.low, noise.high]) ** 2 - step**2 / 12
    return Interval(*np.sqrt(np.maximum(squares, 0.0)).tolist())


def jitter_of(transport: Array) -> Interval | None:
    """Return the width of the range from which waits (n,) [s] are drawn uniformly, with its 95 %
    interval: range over width is distributed as Beta(n - 1, 2). None for fewer than three waits, or
    if all are equal.
    """
    n = len(transport)
    if n < FEWEST or np.ptp(transport) == 0:
        return None
    width = float(np.ptp(transport))
    low, high = beta.ppf([(1 + LEVEL) / 2, (1 - LEVEL) / 2], n - 1, 2)
    return Interval(width * (n + 1) / (n - 1), width / float(low), width / float(high))
