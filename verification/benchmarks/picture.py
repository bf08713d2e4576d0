"""The picture of docs/accuracy.md: cost over error of a held command, on logarithmic axes."""

from functools import partial

from matplotlib.figure import Figure

from rov_fmu.report.plots.svg import LIGHT, svg_file

from .jobs import SOLVERS, TARGET
from .page import digits, duration
from .plain_c import ADAMS, BDF, EULER, RK4
from .steps import Steps

NAME = "cost_error.svg"
_SIZE = (7.2, 4.7)  # inches
_CURVES = {
    EULER: ("forward Euler", "grey"),
    RK4: ("RK4", "blue"),
    ADAMS: (SOLVERS[ADAMS], "violet"),
    BDF: (SOLVERS[BDF], "teal"),
}


def cost_error_picture(steps: Steps) -> str:
    """Draw the cost of a held command over its error while turning, as SVG."""
    return svg_file(partial(_draw, steps), _SIZE, salt=NAME) + "\n"


def _draw(steps: Steps, figure: Figure) -> None:
    measured, ours = steps.measured, steps.ours
    ax = figure.subplots()
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="error after a command of 1 s (m/s, rad/s, m, rad)",
        ylabel="processor time of a command of 1 s",
    )
    ax.set_ylim(3e-7, 2e-2)
    ax.set_yticks([1e-6, 1e-5, 1e-4, 1e-3, 1e-2], ["1 µs", "10 µs", "100 µs", "1 ms", "10 ms"])
    ax.set_xlim(3e-17, 3.0)
    ax.set_xticks([1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1.0])
    ax.minorticks_off()
    ax.set_title("Velocities and pose, turning", loc="left")
    cost, top = measured.cost(ours), 0.0
    for method, (name, role) in _CURVES.items():
        jobs, color = steps.sweeps[method], LIGHT[role]
        errors, costs = [measured.error(job) for job in jobs], [measured.cost(job) for job in jobs]
        times = ""
        if min(errors) < TARGET:
            reached, ratio = measured.compared(jobs, ours)
            times = f": {digits(ratio, 2)} times ours"
            top = max(top, reached)
            ax.plot(TARGET, reached, "o", color="white", markeredgecolor=color, markersize=6.0, zorder=6)
        ax.plot(errors, costs, ".-", color=color, linewidth=1.6, markersize=4.0, label=name + times)
    ax.plot(
        measured.error(ours),
        cost,
        "o",
        color=LIGHT["orange"],
        markersize=8.0,
        zorder=5,
        label=f"this FMU: {duration(cost)}",
    )
    ax.plot([measured.error(ours), TARGET, TARGET], [cost, cost, top], ":", color=LIGHT["muted"], linewidth=1.0)
    ax.legend(
        loc="upper left",
        title="cost at an error of $10^{-9}$",
        title_fontsize=8.5,
        alignment="left",
        frameon=True,
        facecolor="white",
        edgecolor="none",
        framealpha=1.0,
    )
