"""How cost grows: `uv run --extra dev python tests/benchmarks/growth.py [FOLDER]`.

Fits time = c n^k against particles, target area, image area and frames, prints the exponents k,
runs 10,000 frames watching the memory, and draws both into FOLDER/growth.png.
"""

import resource
import sys
from pathlib import Path
from time import perf_counter

import numpy as np
import speed
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from servo.loop.episode import Episode
from servo.scenario.load import load

PARTICLES = [50, 100, 200, 400, 800, 1600]
LENGTHS = [20, 30, 40, 60, 90, 120]
WIDTHS = [160, 320, 640]
FRAMES = [100, 200, 400, 800]
MARATHON = 10_000
PAGE = resource.getpagesize()


def by_particles(kind):
    shown = speed.film(60.0)
    return [speed.tracker_ms(kind, shown, particles=n) for n in PARTICLES]


def by_area(kind):
    return [speed.tracker_ms(kind, speed.film(float(n), 640)) for n in LENGTHS]


def by_image():
    times = []
    for width in WIDTHS:
        size = (f"camera.width={width}", f"camera.height={width * 3 // 4}")
        times.append(speed.loop_times(size).step)
    return times


def by_frames():
    times = []
    for frames in FRAMES:
        began = perf_counter()
        with Episode(load("wander", [f"run.duration={frames / 30}"])) as episode:
            for _ in episode:
                pass
        times.append(1e3 * (perf_counter() - began))
    return times


def memory(*, keep):
    """Resident memory [MB] over a long run, every hundredth frame.

    keep: with the light steps that `servobench run` keeps for its report and plots.
    """
    seen, kept = [], []
    with Episode(load("wander", [f"run.duration={MARATHON / 30}"])) as episode:
        for step in episode:
            if keep:
                kept.append(step.light())
            if step.frame.index % 100 == 0:
                pages = int(Path("/proc/self/statm").read_text().split()[1])
                seen.append(pages * PAGE / 1e6)
    return np.array(seen)


def exponent(n, times):
    return float(np.polyfit(np.log(n), np.log(times), 1)[0])


def main(folder):
    pixels = np.array(LENGTHS) ** 2 / 2
    images = np.array(WIDTHS) ** 2 * 3 / 4
    curves = {
        f"{kind}: particles": (PARTICLES, by_particles(kind))
        for kind in ("pf_ssd", "mk_pf", "condensation", "kams")
    }
    curves |= {
        f"{kind}: target [px^2]": (pixels, by_area(kind))
        for kind in ("pf_ssd", "mk_ssd", "mean_shift")
    }
    curves["loop: image [px^2]"] = (images, by_image())
    curves["run: frames"] = (FRAMES, by_frames())
    figure = Figure(figsize=(9, 4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    for name, (n, times) in curves.items():
        k = exponent(n, times)
        sys.stdout.write(f"{name:30s} exponent {k:5.2f}   {np.round(times, 2).tolist()} ms\n")
        left.loglog(n, times, "o-", ms=3, label=f"{name}: {k:.2f}")
    left.set(xlabel="n", ylabel="ms", title="time = c n^k")
    left.legend(frameon=False, fontsize=7)
    for name, keep in (("the loop", False), ("with what a run keeps", True)):
        used = memory(keep=keep)
        grown = used[-1] - used[len(used) // 2]
        sys.stdout.write(
            f"memory, {name}: {used[1]:.0f} MB after 100 frames, {used[-1]:.0f} MB after "
            f"{MARATHON}; second half grows by {grown:.1f} MB\n"
        )
        right.plot(100 * np.arange(len(used)), used, label=name)
    right.legend(frameon=False)
    right.set(xlabel="frame", ylabel="resident memory [MB]", title="one long run")
    right.set_ylim(0, 1.3 * used.max())
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "growth.png", dpi=130)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs"))
