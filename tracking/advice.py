"""Advice on the choice of a tracker, from the first picture.

The tracker learns the first picture and then follows the target through copies of it. If target and
surroundings have the same colours, its estimate settles beside the target; if the target has no hue
or texture that the tracker uses, it reports that it does not see the target. On the shipped targets
the distance at which it settles is close to its error in a run (tracking/RESULTS.md).
"""

from math import hypot, inf, sqrt

import numpy as np

from sim.kinds import PartConfig, kind_of
from sim.types import Frame, Image
from tracking.search.newton import changes
from tracking.settings import ParticleSettings
from tracking.trackers import KINDS
from tracking.types import Region, State, Status, Tracker, Trait, traits_of

REPEATS = 12
"""Number of copies of the picture: mean shift needs about six to settle."""
LEAST_SHARE = 0.05
LEAST_PX = 3.0
"""A tracker is a poor choice if its estimate settles farther from the target than this [px] and
than `LEAST_SHARE` of the target's size."""
BETTER = "pf_ssd"
"""Tracker that is tried where another one is a poor choice."""
LEAST_CONTRAST = 0.15
"""Least change of the colour distance when the template is shifted (`changes`) that separates a
target from its surroundings: that of the painted sequence `camouflage` is 0.09, those of all other
shipped targets are at least 0.23."""
NO_CONTRAST = (
    "target and surroundings have the same colours: choose texture_pf, which also uses texture"
)
NO_ANGLE = "the target looks the same when it is turned: its angle is not followed"


def advice(config: PartConfig[Tracker], image: Image, region: Region, state: State) -> str:
    """Return a warning if a tracker is a poor choice for a target or cannot follow its angle.

    Args:
        config: Settings of the tracker.
        image: The first picture, RGB (H, W, 3).
        region: Size of the target in that picture [px].
        state: State of the target in that picture.

    Returns:
        One sentence, or "" for no warning. Trackers that use neither colours nor texture are not
        tried and get no warning; nor do those that use texture, on a target with the colours of its
        surroundings.
    """
    kind = kind_of(config)
    traits = traits_of(config) or frozenset()
    if not traits & {Trait.COLOUR, Trait.TEXTURE}:
        return ""
    poor = f"{kind} is a poor choice for this target: "
    if changes(image, region, state)[0] < LEAST_CONTRAST:
        return "" if Trait.TEXTURE in traits else poor + NO_CONTRAST
    off, follows = _settled(config, image, region, state)
    if off <= max(LEAST_PX, LEAST_SHARE * sqrt(region.area(state))):
        filters_turn = isinstance(config, ParticleSettings) and config.turn_noise > 0
        turns = filters_turn or Trait.ANGLE in traits
        return NO_ANGLE if turns and not follows else ""
    how = "does not recognise it" if off == inf else f"settles {off:.1f} px beside it"
    other, _ = _settled(KINDS.config(BETTER), image, region, state)
    instead = f"; {BETTER}: {other:.1f} px" if other < off / 2 else ""
    return f"{poor}shown the first picture again, it {how}{instead}"


def _settled(
    config: PartConfig[Tracker], image: Image, region: Region, state: State
) -> tuple[float, bool]:
    """Return where a new tracker settles on copies of the first picture.

    Returns:
        Distance of the mean of its last six estimates from the target [px], inf if its last status
        is not LOCKED; and True if it follows the target's angle.
    """
    tracker = config.build(np.random.default_rng(0))
    tracker.start(Frame(image, 0.0, 0), region, state)
    found = [tracker.update(Frame(image, i / 30, i)) for i in range(1, REPEATS + 1)]
    if found[-1].status is not Status.LOCKED:
        return inf, found[-1].follows[0]
    x, y = np.mean([(e.state.x, e.state.y) for e in found[REPEATS // 2 :]], axis=0)
    return hypot(x - state.x, y - state.y), found[-1].follows[0]
