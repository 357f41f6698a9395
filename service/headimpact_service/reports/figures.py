"""The figures of a refit as SVG: those of the paper, for the cohort at hand.

Text is drawn as text of the reader's own fonts, and ids are counted, so the same refit gives the same bytes.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.style import context as style
from matplotlib.ticker import NullLocator
from scipy.special import expit

from headimpact.calibration.cohort import component_names, parts_of
from headimpact.calibration.criterion_refit import CriterionRefit
from headimpact.calibration.refit import Refit
from headimpact.criteria import BY_KEY
from headimpact.risk import RiskCurve, RiskModel
from headimpact.risk_map import RiskMap, draw_risk_map
from headimpact.scoring import NORMAL_975

STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "headimpact",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e6ea",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "axes.formatter.min_exponent": 3,
}
EVENT, OTHER, LINE, MUTED = "#b3261e", "#5f7c8a", "#0b5394", "#9aa5ad"
SHOWN = 4
"""How many criteria a figure of curves shows beside the reference, the best first."""
RISK_COLOURS = ("#5f7c8a", "#38761d", "#b45f06", "#b3261e", "#3b0a45")
"""Of lines of equal risk, the lowest first: all of them dark enough to be read on white."""
AXIS_COLOURS = ("#0b5394", "#b45f06", "#38761d")


def criterion_name(name: str) -> str:
    """What a criterion is called, or several that are fitted together."""
    return " + ".join(BY_KEY[key].name for key in parts_of(name))


def deviance_bars(found: Refit) -> str | None:
    """Deviance of every criterion beside the null's, the lowest first."""
    fitted = sorted(
        (one for one in found.criteria.values() if one.ml), key=lambda one: -(one.ml.deviance if one.ml else 0)
    )
    if not fitted:
        return None

    def draw(axes: Sequence[Axes]) -> None:
        (ax,) = axes
        values = [one.ml.deviance for one in fitted if one.ml]
        colours = [LINE if one.name == "bam" else OTHER for one in fitted]
        ax.barh([criterion_name(one.name) for one in fitted], values, color=colours, height=0.65)
        null = max(one.ml.null_deviance for one in fitted if one.ml)
        ax.axvline(null, color=EVENT, linewidth=1, linestyle="--")
        ax.annotate("null model", (null, 1.01), xycoords=("data", "axes fraction"), ha="center", color=EVENT)
        for place, value in enumerate(values):
            ax.text(value, place, f" {value:.1f}", va="center", fontsize=8)
        ax.set_xlabel("Deviance of the maximum-likelihood fit (lower is better)")
        ax.set_xlim(0, null * 1.1)
        ax.grid(visible=False, axis="y")

    return _svg(draw, 1, (7.2, 0.8 + 0.32 * len(fitted)))


def _best(found: Refit) -> list[CriterionRefit]:
    ranked = sorted(found.criteria.values(), key=lambda one: (one.name != "bam", -one.auc.value))
    return ranked[: SHOWN + 1]


def discrimination_curves(found: Refit) -> str:
    """ROC and precision-recall curves of the reference and the best others."""

    def draw(axes: Sequence[Axes]) -> None:
        roc, pr = axes
        for place, one in enumerate(_best(found)):
            colour, label = f"C{place}", criterion_name(one.name)
            x, y = (np.append(0.0, part) for part in (one.curve.false_alarm_rate, one.curve.sensitivity))
            roc.plot(x, y, color=colour, linewidth=1.6, label=f"{label}: {one.auc.value:.3f}")
            area = one.curve.average_precision()
            pr.step(
                one.curve.sensitivity,
                one.curve.precision(),
                where="pre",
                color=colour,
                linewidth=1.4,
                label=f"{label}: {area:.3f}",
            )
        roc.plot([0, 1], [0, 1], color=MUTED, linewidth=0.8, linestyle="--")
        pr.axhline(found.cohort.events / found.cohort.n, color=MUTED, linewidth=0.8, linestyle="--")
        roc.set(xlabel="1 - specificity", ylabel="Sensitivity", title="ROC, with AUC", aspect="equal")
        pr.set(
            xlabel="Recall (sensitivity)",
            ylabel="Precision in the sample",
            ylim=(0, 1.02),
            title="Precision-recall, with average precision",
        )
        for ax in axes:  # below: curves of few events go through every corner
            ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), fontsize=7.5)

    return _svg(draw, 2, (9.2, 5.2))


def logistic_curve(one: CriterionRefit, found: Refit) -> str:
    """The fitted probability over the linear predictor, with the impacts and what was observed in tenths of them."""

    def draw(axes: Sequence[Axes]) -> None:
        (ax,) = axes
        eta, y = one.score, one.sample.y
        grid = np.linspace(eta.min(), eta.max(), 300)
        ax.plot(grid, expit(grid), color=LINE, linewidth=1.8, label="in the sample")
        if found.options.tau is not None:
            label = f"as served, at an incidence of {found.options.tau:.3g}"
            line = np.polynomial.Polynomial.fit(eta, one.served, 1)  # exact where there is one component
            if np.allclose(line(eta), one.served, rtol=0.0, atol=1e-6):
                ax.plot(grid, expit(line(grid)), color=LINE, linewidth=1.2, linestyle=":", label=label)
            else:
                ax.plot(eta, expit(one.served), ".", color=LINE, markersize=2.5, label=label)
        generator = np.random.default_rng(0)
        ax.scatter(
            eta,
            y + generator.uniform(-0.02, 0.02, y.size),
            s=9,
            linewidths=0,
            alpha=0.55,
            c=np.where(y == 1.0, EVENT, OTHER),
        )
        parts = np.array_split(np.argsort(eta), min(10, y.size))
        ax.plot(
            [eta[part].mean() for part in parts],
            [y[part].mean() for part in parts],
            "o",
            color="black",
            markersize=4,
            fillstyle="none",
            label="observed, by tenths",
        )
        label = "Linear predictor of the maximum-likelihood fit" if one.ml else "Linear predictor of Firth's fit"
        ax.set(xlabel=label, ylabel="Probability of concussion", ylim=(-0.05, 1.05))
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), fontsize=7.5)

    return _svg(draw, 1, (5.2, 4.0))


def calibration_curve(one: CriterionRefit) -> str | None:
    """Observed against predicted on log-log axes, weighted to the incidence where that was declared."""
    p = expit(one.served)
    weights = np.ones(p.size) if one.weights is None else one.weights
    points = _calibration_points(one.sample.y, p, weights)
    if not points:
        return None

    def draw(axes: Sequence[Axes]) -> None:
        (ax,) = axes
        x, y, low, high = (np.array(part) for part in zip(*points, strict=True))
        ends = [min(x.min(), low[low > 0].min(initial=y.min())) / 2, min(1.0, max(x.max(), high.max()) * 2)]
        ax.plot(ends, ends, color=MUTED, linewidth=0.8, linestyle="--", label="perfect agreement")
        ax.errorbar(
            x,
            y,
            yerr=[y - np.maximum(low, ends[0]), high - y],
            fmt="o",
            color=EVENT,
            markersize=4,
            linewidth=1,
            label="groups with equal events, 95 %",
        )
        found_line = one.calibration
        if found_line.intercept is not None and found_line.slope is not None:
            grid = np.geomspace(max(p.min(), ends[0]), min(p.max(), 1.0 - 1e-9), 100)
            ax.plot(
                grid,
                expit(found_line.intercept + found_line.slope * np.log(grid / (1 - grid))),
                color=LINE,
                linewidth=1.4,
                label=f"logistic recalibration, slope {found_line.slope:.2f}",
            )
        ax.set(
            xscale="log",
            yscale="log",
            xlim=ends,
            ylim=ends,
            xlabel="Predicted probability",
            ylabel="Observed share",
            aspect="equal",
        )
        ax.legend(loc="upper left", fontsize=7.5)

    return _svg(draw, 1, (4.6, 4.4))


def _calibration_points(y: np.ndarray, p: np.ndarray, weights: np.ndarray) -> list[tuple[float, float, float, float]]:
    """Mean prediction, weighted share of events and its interval in groups that hold equally many events."""
    order = np.argsort(p)
    events = np.cumsum(y[order])
    groups = int(np.clip(events[-1] // 5, 1, 6))
    group = np.minimum(np.ceil(events / events[-1] * groups).astype(int), groups)
    points = []
    for number in range(1, groups + 1):
        members = order[np.maximum(group, 1) == number]
        w, outcome = weights[members], y[members]
        if outcome.sum() == 0:
            continue
        share = float((w * outcome).sum() / w.sum())
        half = NORMAL_975 / np.sqrt(outcome.sum())  # of the logarithm of a count
        interval = share * np.exp(-half), min(share * np.exp(half), 1.0)
        points.append((float((w * p[members]).sum() / w.sum()), share, *interval))
    return points


def half_risk_planes(found: Refit) -> str | None:
    """Where the plane of 50 % in the sample cuts each axis of BAM: the cuts by pairs of axes, with the impacts."""
    one = found.criteria.get("bam")
    if one is None or one.ml is None:
        return None
    in_sample = one.ml.coefficients

    def draw(axes: Sequence[Axes]) -> None:
        for ax, (i, j) in zip(axes, ((0, 1), (1, 2), (0, 2)), strict=True):
            x, y = one.sample.x[:, i], one.sample.x[:, j]
            for value, colour, size in ((0.0, OTHER, 6), (1.0, EVENT, 16)):
                chosen = one.sample.y == value
                ax.scatter(x[chosen], y[chosen], s=size, color=colour, alpha=0.6, linewidths=0)
            limits = np.array([x.max(), y.max()]) * 1.15
            _half_line(ax, in_sample[0], in_sample[1 + i], in_sample[1 + j], limits, LINE)
            ax.set(
                xlim=(0, limits[0]), ylim=(0, limits[1]), xlabel=f"BAM {'xyz'[i]} [rad]", ylabel=f"BAM {'xyz'[j]} [rad]"
            )

    return _svg(draw, 3, (9.6, 3.2))


def _half_line(ax: Axes, intercept: float, b_i: float, b_j: float, limits: np.ndarray, colour: str) -> None:
    """The line of 50 %, the third component being 0."""
    grid = np.linspace(0, limits[0], 50)
    if b_j != 0:
        ax.plot(grid, -(intercept + b_i * grid) / b_j, color=colour, linewidth=1.6)


def risk_map_svg(drawn: RiskMap) -> str:
    """Lines of equal probability over the duration and amplitude of half-sine pulses, a panel for each criterion."""
    names = list(drawn.probabilities)

    def draw(axes: Sequence[Axes]) -> None:
        for ax, name in zip(axes, names, strict=True):
            p = drawn.probabilities[name]
            x, y = np.array(drawn.durations_s) * 1000, np.array(drawn.amplitudes_rad_s2)
            ax.set(
                xscale="log",
                yscale="log",
                xlabel="Duration [ms]",
                title=criterion_name(name),
                xlim=(x[0], x[-1]),
                ylim=(y[0], y[-1]),
            )
            levels = [drawn.incidence, *(level for level in (0.01, 0.1, 0.5, 0.9) if level > drawn.incidence)]
            present = [level for level in levels if p.min() < level < p.max()]
            if not present:
                ax.text(0.5, 0.5, "no line of equal risk\nin this range", ha="center", transform=ax.transAxes)
                continue
            colours = [RISK_COLOURS[levels.index(level)] for level in present]
            lines = ax.contour(x, y, p, levels=present, colors=colours, linewidths=1.4)
            ax.clabel(lines, fmt={level: f"{level:.2g}" for level in present}, fontsize=7)
        axes[0].set_ylabel("Amplitude about each axis [rad/s²]")

    return _svg(draw, len(names), (2.9 * len(names) + 0.6, 3.3))


def risk_map_of(model: RiskModel) -> str | None:
    """The risk map of a model; None where it has no curve of a criterion of rotation alone."""
    drawn = draw_risk_map(model)
    return risk_map_svg(drawn) if drawn.probabilities else None


def coefficient_comparison(name: str, model: RiskModel, active: RiskModel) -> str | None:
    """Coefficients of a criterion under two models, with the fitted one's 95 % intervals."""
    new, old = model.curves.get(name), active.curves.get(name)
    if new is None or old is None:
        return None

    def draw(axes: Sequence[Axes]) -> None:
        (ax,) = axes
        labels = component_names(name)
        places = np.arange(len(labels), dtype=float)
        ax.axhline(0, color=MUTED, linewidth=0.8)
        for offset, curve, version, colour in ((-0.12, old, active.version, OTHER), (0.12, new, model.version, LINE)):
            half = _half_widths(curve)
            ax.errorbar(places + offset, [-b for b in curve.b], yerr=half, fmt="o", color=colour, label=version)
        ax.set(xticks=places, ylabel=f"Log odds per unit of {criterion_name(name)}")
        ax.set_xticklabels(labels)
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=7.5)

    return _svg(draw, 1, (4.6, 3.0))


def _half_widths(curve: RiskCurve) -> list[float] | None:
    if curve.covariance is None:
        return None
    return [NORMAL_975 * float(np.sqrt(curve.covariance[i][i])) for i in range(1, len(curve.b) + 1)]


def _svg(draw: Callable[[Sequence[Axes]], None], panels: int, size: tuple[float, float]) -> str:
    with style(STYLE):
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasSVG(figure)
        axes = [figure.add_subplot(1, panels, 1 + i) for i in range(panels)]
        draw(axes)
        for ax in axes:
            for side in (ax.xaxis, ax.yaxis):
                side.set_minor_locator(NullLocator())
        held = io.StringIO()
        figure.savefig(held, format="svg", metadata={"Date": None, "Creator": None})
    text = held.getvalue()
    return text[text.index("<svg") :]
