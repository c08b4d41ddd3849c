"""Which waves about a uniform state grow, and where the drag form is ill-posed.

A perturbation ``exp(iqx + st)`` of a uniform (n, l) grows with the eigenvalues s of `equations.dispersion_matrix`. Everything is
dimensionless.

The matrix is that of the state held fixed. Without reactions (k_l l = k_m l = 0) a uniform state stays as it is and the rates hold for
as long as the perturbation is small. With reactions it drifts, by (3.10a) ``n' = k_m l c``, by (3.10b) ``l' = -k_l l c``, and through (3.9)
the intima grows as modLDL enters (3.8h): the rates are then those of the equations at t = 0, to be compared with runs that are short
against ``1 / (k_m l)`` and ``1 / (k_l c)``. Waves on an intima of width L, without influx, are cosines with ``q = j pi / L``.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multiphase.errors import ParameterError
from multiphase.stepping import Snapshot, State, Tracker
from plaque1d import equations as eq
from plaque1d.parameters import PlaqueInitial, PlaqueParameters

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

logger = logging.getLogger("multiphase")

Array = NDArray[np.float64]

GROWTH_TO_WARN = 5.0
"""Exponent of the growth of short waves by the end from which the drag form is warned about."""

POINTS_PER_DECADE = 24
"""Wave numbers among which the largest rate is first looked for."""

REACH = 1e3
"""Factor by which they go beyond the smallest and the largest wave number at which the equations change their character."""

CLOSE = 1e-9
"""Relative difference of growth rates below which the shorter wave counts as the more dangerous."""

ROUNDING = 1e-12
"""Growth rates below this part of the matrix's entries are zero."""

REACH_DRAWN = 30.0
"""The same factor in a figure."""

COLOURS = {"drag": "black", "interfacial": "#b35806"}


@dataclass(frozen=True, slots=True)
class Mode:
    """A wave and its growth rate.

    Attributes
    ----------
    q : float
        Wave number; infinity for the limit of short waves, 0 where nothing grows.
    rate : float
        Its growth rate; infinity without viscosity where the drag form is ill-posed, 0 where nothing grows.
    """

    q: float
    rate: float

    @property
    def wavelength(self) -> float:
        """2 pi / q; 0 in the limit of short waves, infinity where nothing grows."""
        return 2.0 * np.pi / self.q if self.q > 0.0 else np.inf

    @property
    def grows(self) -> bool:
        """Whether any wave grows."""
        return self.rate > 0.0


@dataclass(frozen=True, slots=True)
class Region:
    """Where the drag form is ill-posed in the limit of vanishing viscosity.

    Attributes
    ----------
    n : (n_points,) array
        Necrotic fractions from 0 to 1.
    l : (l_points,) array
        Concentrations of modLDL from 0 to l_max.
    D1 : (l_points, n_points) array
        ``p_out - (1 - 2n) Sigma(l)``, b times the inviscid diffusivity of n.
    rate : (l_points, n_points) array
        Growth rate of short waves at the given viscosities; infinity without, 0 where they do not grow.
    """

    n: Array
    l: Array
    D1: Array
    rate: Array

    @property
    def ill_posed(self) -> NDArray[np.bool_]:
        """Where D1 is negative."""
        return self.D1 < 0.0


def growth_rates(parameters: PlaqueParameters, n: float, l: float, q: ArrayLike) -> NDArray[np.complex128]:
    """Growth rates of waves about a uniform state; with reactions those at t = 0, as the state drifts ((3.8) to (3.10), see above).

    Parameters
    ----------
    parameters : PlaqueParameters
        Its `momentum` chooses the form.
    n, l : float
        The uniform state, 0 <= n <= 1 and l >= 0.
    q : array_like (nq,)
        Wave numbers, 0 or more.

    Returns
    -------
    (nq, 2) complex array
        Eigenvalues of `equations.dispersion_matrix`, that with the larger real part first.

    Raises
    ------
    ParameterError
        For a state or wave number out of range, and for k < 1 at l = 0, where Sigma has no slope.
    """
    waves = np.atleast_1d(np.asarray(q, dtype=float))
    _check_state(parameters, n, l)
    if not np.all((waves >= 0.0) & (waves <= 1e60)):
        raise ParameterError("q", "a wave number must be a number from 0 to 1e60.")
    matrices = np.array([_matrix(parameters, n, l, float(wave)) for wave in waves]).reshape(-1, 2, 2)
    first, last = matrices[:, 0, 0], matrices[:, 1, 1]
    coupling = matrices[:, 0, 1] * matrices[:, 1, 0]
    half = 0.5 * (first - last)
    # (s - first)(s - last) = coupling, solved for s - last without cancellation; at large q the two differ by many digits
    root = np.where(half < 0.0, -1.0, 1.0) * np.sqrt((half * half + coupling).astype(complex))
    gap = half + root
    shift = np.divide(coupling, gap, out=np.zeros_like(gap), where=gap != 0.0)
    rates = np.stack([first + shift, last - shift], axis=1)
    order = np.argsort(-rates.real, axis=1, kind="stable")
    return np.take_along_axis(rates, order, axis=1)


def _matrix(p: PlaqueParameters, n: float, l: float, q: float) -> Array:
    return eq.dispersion_matrix(q, n, l, p.k_l, p.k_m, p.b, p.nu_n, p.nu_m, p.A, p.B, p.k, p.p_out, p.momentum)


def _check_state(parameters: PlaqueParameters, n: float, l: float) -> None:
    if not 0.0 <= n <= 1.0:
        raise ParameterError("n", f"{n:g} must lie from 0 to 1.")
    if not 0.0 <= l < np.inf:
        raise ParameterError("l", f"{l:g} must be a number of 0 or more.")
    if l == 0.0 and parameters.k < 1.0:
        raise ParameterError(
            "parameters.k", f"{parameters.k:g} cannot be used at l = 0: for k < 1 the slope of Sigma = A/(1 + B l^k) is infinite there."
        )


def _diffusivity(parameters: PlaqueParameters, n: Array, l: Array) -> Array:
    """b times the inviscid diffusivity of n in the form chosen."""
    stress = eq.extra_stress(l, parameters.A, parameters.B, parameters.k)
    if parameters.momentum == "interfacial":
        return eq.interfacial_diffusivity(n, stress)
    return eq.drag_diffusivity(n, stress, parameters.p_out)


def _short_wave_rates(parameters: PlaqueParameters, n: ArrayLike, l: ArrayLike) -> Array:
    """Growth rate of short waves at each state; 0 where they do not grow."""
    n, l = np.asarray(n, dtype=float), np.asarray(l, dtype=float)
    diffusivity = _diffusivity(parameters, n, l)
    negative = diffusivity < 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = -diffusivity / eq.mean_viscosity(n, parameters.nu_n, parameters.nu_m) - parameters.k_m * l
    return np.where(negative, np.maximum(rates, 0.0), 0.0)


def short_wave_rate(parameters: PlaqueParameters, n: ArrayLike, l: ArrayLike) -> float:
    """Largest growth rate of short waves among states, the limit of `growth_rates` as q goes to infinity.

    It is ``-D1 / nu - k_m l`` with ``D1`` the drag form's ``p_out - (1 - 2n) Sigma(l)`` and ``nu = nu_m n + nu_n c``; infinity where D1 is
    negative and nu is 0, as the equations are ill-posed there; 0 where short waves do not grow, so always in the interfacial form.
    """
    return float(np.max(_short_wave_rates(parameters, n, l)))


def ill_posed(parameters: PlaqueParameters, n: ArrayLike, l: ArrayLike) -> NDArray[np.bool_]:
    """Where the form chosen has a negative inviscid diffusivity: nowhere in the interfacial form."""
    return np.asarray(_diffusivity(parameters, np.asarray(n, dtype=float), np.asarray(l, dtype=float)) < 0.0)


def least_p_out(parameters: PlaqueParameters, n: ArrayLike, l: ArrayLike) -> Array:
    """The smallest p_out with which the drag form is well-posed at each state, ``(1 - 2n) Sigma(l)``; A covers them all."""
    stress = eq.extra_stress(np.asarray(l, dtype=float), parameters.A, parameters.B, parameters.k)
    return -eq.drag_diffusivity(np.asarray(n, dtype=float), stress, 0.0)


def region(parameters: PlaqueParameters, n_points: int = 201, l_points: int = 201, l_max: float = 1.0) -> Region:
    """The part of the (n, l) plane in which the drag form is ill-posed in the limit of vanishing viscosity.

    Parameters
    ----------
    parameters : PlaqueParameters
        Taken with drag only, whatever its `momentum`.
    n_points, l_points : int
        States along each axis, 2 or more.
    l_max : float
        The largest concentration.
    """
    if min(n_points, l_points) < 2 or not 0.0 < l_max < np.inf:
        raise ParameterError("", "a region needs two points or more along each axis, and an l_max above 0.")
    drag = replace(parameters, momentum="drag")
    n, l = np.linspace(0.0, 1.0, n_points), np.linspace(0.0, l_max, l_points)
    grid_n, grid_l = np.meshgrid(n, l)
    return Region(n, l, _diffusivity(drag, grid_n, grid_l), _short_wave_rates(drag, grid_n, grid_l))


def most_dangerous(parameters: PlaqueParameters, n: float, l: float) -> Mode:
    """The wave that grows fastest; with reactions at t = 0, as the state drifts ((3.8) to (3.10), see above).

    Returns
    -------
    Mode
        With q and rate finite where one wave number is the fastest; with q infinite (wavelength 0) where rates only rise towards their
        limit for short waves, which without viscosity is infinite; with q and rate 0 where nothing grows.
    """
    _check_state(parameters, n, l)
    limit = short_wave_rate(parameters, n, l)
    if limit == np.inf:
        return Mode(np.inf, np.inf)
    q, rate = _fastest(parameters, n, l)
    if limit > 0.0 and rate <= limit * (1.0 + CLOSE):
        return Mode(np.inf, limit)
    matrix = np.abs(_matrix(parameters, n, l, q))
    if rate <= ROUNDING * (matrix[0, 0] + np.sqrt(matrix[0, 1] * matrix[1, 0])):
        return Mode(0.0, 0.0)
    return Mode(q, rate)


def _fastest(parameters: PlaqueParameters, n: float, l: float) -> tuple[float, float]:
    """The wave number of the largest rate and that rate: the best of a logarithmic grid, then Brent's search between its neighbours."""
    from scipy.optimize import minimize_scalar

    def slowness(log_q: float) -> float:
        return -float(growth_rates(parameters, n, l, np.exp(log_q))[0, 0].real)

    q = _wave_numbers(parameters, n, l, REACH)
    rates = growth_rates(parameters, n, l, q)[:, 0].real
    best = int(np.argmax(rates))
    between = np.log(q[[max(best - 1, 0), min(best + 1, len(q) - 1)]])
    found = minimize_scalar(slowness, bounds=tuple(between), method="bounded", options={"xatol": 1e-9})
    return (float(np.exp(found.x)), -float(found.fun)) if -found.fun > rates[best] else (float(q[best]), float(rates[best]))


def _wave_numbers(p: PlaqueParameters, n: float, l: float, reach: float) -> Array:
    """Wave numbers in equal ratios, around those at which two terms of the matrix are alike."""
    c, at, fraction = 1.0 - n, np.array([l]), np.array([n])
    size = abs(float(_diffusivity(p, fraction, at)[0]))
    cross = n * abs(float(eq.extra_stress_slope(at, p.A, p.B, p.k)[0]))
    nu = eq.mean_viscosity(n, p.nu_n, p.nu_m)
    pairs = ((p.b, nu), (p.k_l * c, 1.0), (p.k_m * l, 1.0), (size, nu), (p.b * p.k_m * l, size), (p.b * p.k_m, cross))
    squares = [over / under for over, under in pairs if over > 0.0 and under > 0.0] or [1.0]
    low, high = np.log10(np.clip(np.sqrt([min(squares), max(squares)]), 1e-9, 1e9)) + np.log10(reach) * np.array([-1.0, 1.0])
    return np.logspace(low, high, 1 + int(np.ceil(POINTS_PER_DECADE * (high - low))))


def figure(parameters: PlaqueParameters, n: float, l: float) -> Figure:
    """Draw the growth rates of waves about a state in both momentum forms, and where the drag form is ill-posed.

    Parameters
    ----------
    parameters : PlaqueParameters
        Its `momentum` does not matter here.
    n, l : float
        The uniform state.

    Returns
    -------
    matplotlib.figure.Figure
        Left, the real parts of both growth rates against the wave number, and the most dangerous wave; right, the ill-posed states.
    """
    _check_state(parameters, n, l)
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from multiphase.plotting import STYLE

    with matplotlib.rc_context(STYLE):
        picture = Figure(figsize=(7.0, 3.6), layout="constrained")
        FigureCanvasAgg(picture)
        left, right = picture.subplots(1, 2)
        _draw_rates(left, parameters, n, l)
        _draw_region(right, parameters, n, l)
        handles = [handle for axes in (left, right) for handle in axes.get_legend_handles_labels()[0]]
        picture.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
        picture.suptitle(f"Waves about the uniform state n = {n:.4g}, l = {l:.4g}, with p_out = {parameters.p_out:.4g}")
    return picture


def _draw_rates(axes: Axes, parameters: PlaqueParameters, n: float, l: float) -> None:
    """Both real parts against q, forms by colour.

    The axis spans the larger of each pair, up to where short waves set in, and the smaller where it begins, if that is not far below.
    """
    spans, q = [0.0], _wave_numbers(replace(parameters, momentum="drag"), n, l, REACH_DRAWN)
    for form, colour in COLOURS.items():
        chosen = replace(parameters, momentum=form)
        rates, mode = growth_rates(chosen, n, l, q).real, most_dangerous(chosen, n, l)
        worst = "nothing grows"
        if mode.grows:
            worst = f"wavelength {mode.wavelength:.3g} grows fastest, s = {mode.rate:.3g}"
        if mode.q == np.inf:
            worst = f"the shorter the faster, s → {mode.rate:.3g}".replace("inf", "∞")
        axes.plot(q, rates[:, 0], color=colour, label=f"{form}: {worst}")
        axes.plot(q, rates[:, 1], "--", color=colour, linewidth=0.8)
        spans += rates[q <= q[-1] / np.sqrt(REACH_DRAWN), 0].tolist()
        if mode.grows and np.isfinite(mode.q):
            axes.plot(mode.q, mode.rate, "o", color=colour)
        elif mode.grows and np.isfinite(mode.rate):
            axes.axhline(mode.rate, color=colour, linestyle=":")
            spans.append(mode.rate)
    if -rates[0, 1] < 2.0 * (max(spans) - min(spans)):
        spans.append(rates[0, 1])
    axes.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
    room = 0.08 * (max(spans) - min(spans)) or 1.0
    axes.set(xscale="log", xlim=(q[0], q[-1]), ylim=(min(spans) - room, max(spans) + room))
    axes.set(xlabel="wave number q", ylabel="growth rates Re s (dashed: the smaller)")
    axes.set_title("Growth rates", loc="left")


def _draw_region(axes: Axes, parameters: PlaqueParameters, n: float, l: float) -> None:
    """States with D1 < 0, coloured by the growth rate of short waves; without viscosity, where that is infinite, by its ratio to q^2."""
    from multiphase.plotting import colour_map

    half = parameters.B ** (-1.0 / parameters.k) if parameters.B > 0.0 else 1.0  # Sigma is half of A there
    states = region(parameters, l_max=max(2.0 * l, 4.0 * half))
    growing = states.l[(states.rate > 0.0).any(axis=1)]
    states = region(parameters, l_max=max(2.0 * l, min(4.0 * half, 1.2 * growing[-1])) if growing.size else float(states.l[-1]))
    viscous = parameters.nu_n > 0.0 or parameters.nu_m > 0.0
    rates = states.rate if viscous else -states.D1 / parameters.b
    shown = np.ma.masked_where(~(states.ill_posed & (states.rate > 0.0) & np.isfinite(rates)), rates)
    if states.ill_posed.any():
        axes.contourf(states.n, states.l, states.D1, levels=[-np.inf, 0.0], colors=["0.85"])
        axes.contour(states.n, states.l, states.D1, levels=[0.0], colors="black", linewidths=1.0)
    if shown.count():
        bounded = bool(np.isfinite(rates).all())
        top = float(shown.max() if bounded else np.percentile(shown.compressed(), 95.0))
        mesh = axes.pcolormesh(states.n, states.l, shown, cmap=colour_map().with_extremes(bad="none"), vmin=0.0, vmax=top, rasterized=True)
        bar = axes.figure.colorbar(mesh, ax=axes, pad=0.02, extend="neither" if bounded else "max")
        bar.set_label("growth rate of short waves" + ("" if viscous else " / q²"))
    axes.fill([], [], color="0.85", label="short waves grow without viscosity only")
    axes.plot(n, l, "o", color="white", markeredgecolor="black", clip_on=False, zorder=3, label="the state")
    axes.set(xlabel="necrotic fraction n", ylabel="modified LDL l", xlim=(0.0, 1.0), ylim=(0.0, float(states.l[-1])))
    axes.set_title("Where drag only is ill-posed" if states.ill_posed.any() else "Drag only is well-posed everywhere", loc="left")


def drag_warning(parameters: PlaqueParameters, initial: PlaqueInitial, t_end: float) -> tuple[str, ...]:
    """A sentence when the drag form grows short waves by more than exp(5) until the end, judged from the initial state."""
    if parameters.momentum != "drag":
        return ()
    xi = np.linspace(0.0, 1.0, 201)
    rate = short_wave_rate(parameters, initial.n(x=initial.L * xi, xi=xi), initial.l(x=initial.L * xi, xi=xi))
    if rate * t_end <= GROWTH_TO_WARN:
        return ()
    pace = f"they grow like exp({rate:.3g} t), {rate * t_end:.3g} e-foldings by the end"
    if rate == np.inf:
        pace = "where only a phase without viscosity is present, the shorter they are the faster they grow, without a bound"
    return (f"momentum = drag is ill-posed for short waves here: {pace}, so finer meshes do not converge. {_cure(parameters)}",)


def _cure(parameters: PlaqueParameters) -> str:
    return f"parameters.p_out of {parameters.A:g} (A) or more, or momentum = interfacial, cures it."


class ShortWaves(Tracker):
    """Warns once when short waves of the drag form may have grown by more than exp(5) since the start of the run."""

    def __init__(self, parameters: PlaqueParameters) -> None:
        self._parameters = parameters
        self._growth: float | None = 0.0
        self._last = 0.0

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        if self._growth is None:
            return
        rate = short_wave_rate(self._parameters, snapshot.fields["n"], snapshot.fields["l"])
        self._growth += np.inf if rate == np.inf else rate * (snapshot.t - self._last)
        self._last = snapshot.t
        if self._growth > GROWTH_TO_WARN:
            grown = "grow without a bound" if self._growth == np.inf else f"have grown by some {self._growth:.0f} e-foldings"
            logger.warning(
                "momentum = drag has become ill-posed for short waves by t = %.6g: where n is below 1/2 they %s, so finer meshes do not "
                "converge. %s",
                snapshot.t,
                grown,
                _cure(self._parameters),
            )
            self._growth = None
