r"""Exact solutions of the tumour model, to test solvers with and to think with.

Numbers in brackets are the equations of Zanca, Ahmed, Won, Browning, Flegg & Ruiz-Baier, "Multiphase models for moving boundary
problems in biology"; m is the dimension of the body (1 slab, 2 disk, 3 sphere); everything is dimensionless. The fraction and the oxygen
at which births and deaths balance are closed forms as well: `tumour.equations.homeostatic_fraction` and `critical_oxygen`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ive, jn_zeros, jv

from multiphase.errors import ParameterError, SolverError
from tumour import equations as eq
from tumour.checks import check
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.solver import TumourSolver

Array = NDArray[np.float64]

ACCURACY = 1e-12
"""Relative tolerance of the integrations in time; their results are good to about 1e-10."""


def oxygen(r: ArrayLike, R: float, alpha: float, m: int, *, Q: float, C_out: float = 1.0) -> Array:
    """Oxygen in a body whose cell fraction is uniform, with an uptake that does not saturate (Q1_hat = 0).

    The bounded solution of ``r^(1-m) (r^(m-1) C')' = x^2 C``, ``x = sqrt(Q alpha)``, that is C_out at R: C is proportional to cosh(x r),
    to the Bessel function I_0(x r), or to sinh(x r)/(x r). It holds as well in a body that has grown uniformly, with r and R as they are
    then. Exponentials are taken out, so no body is too large for it.

    Parameters
    ----------
    r : array_like
        Distance from the centre, 0 to R.
    R : float
        Radius of the body.
    alpha : float
        Cell fraction.
    m : int
    Q, C_out : float
        Uptake rate; oxygen at R.

    Returns
    -------
    ndarray
        C, in the shape of r.
    """
    x = np.sqrt(Q * alpha)
    at, surface = x * np.asarray(r, dtype=float), np.array(x * R)
    profile = _SCALED_PROFILES[m]
    return np.asarray(C_out * np.exp(at - surface) * profile(at) / profile(surface), dtype=float)


def _sphere_scaled(y: Array) -> Array:
    """exp(-y) sinh(y)/y."""
    safe = np.where(y > 0.0, y, 1.0)
    return np.where(y > 0.0, -np.expm1(-2.0 * safe) / (2.0 * safe), 1.0)


_SCALED_PROFILES: dict[int, Callable[[Array], Array]] = {
    1: lambda y: 0.5 * (1.0 + np.exp(-2.0 * y)),
    2: lambda y: np.asarray(ive(0, y), dtype=float),
    3: _sphere_scaled,
}


def uniform_growth(t: ArrayLike, parameters: TumourParameters, m: int, alpha_0: float = 0.8) -> tuple[Array, Array]:
    r"""Uniform growth of an elastic body in which nothing hinders the fluid and oxygen is the same everywhere.

    With kappa = 0 the fluid pressure is p_out, here 0; with Q = 0 the oxygen is C_out. A body that is uniform at first stays so: it swells
    by one stretch l in all its m directions, ``J = l^m``. The traction on the surface is 0 and so is that stress everywhere, and cells
    are neither carried in nor out:

        P_r(l) l/J = alpha Sigma(alpha),      (alpha J)' = J q(alpha, C_out).

    While alpha < alpha_star = alpha_min there is no contact, the body is at rest (J = 1) and alpha grows or falls by itself. From then on
    the first equation gives alpha for each l, and the second l' = l q/(m alpha + l dalpha/dl): l is unknown of choice, because for m = 3
    and lambda = 0 alpha has a maximum at J = 3 sqrt(3), beyond which it falls while the body goes on to swell.

    Parameters
    ----------
    t : array_like
        Times, 0 or more, in any order.
    parameters : TumourParameters
        With kappa, Q, p_out and sigma_width 0 and alpha_min = alpha_star.
    m : int
    alpha_0 : float
        Cell fraction of the body at rest. Above alpha_star the body swells at once, at t = 0, until stress and contact balance.

    Returns
    -------
    J, alpha : ndarray
        Volume ratio and cell fraction, in the shape of t, to about 1e-10.

    Raises
    ------
    ParameterError
        Where the parameters are none for which this is a solution.
    """
    _require(parameters, kappa=0.0, Q=0.0, p_out=0.0, sigma_width=0.0, alpha_min=parameters.alpha_star)
    _admit(parameters, m, alpha_0, "lagrangian")
    body = _ElasticBody(parameters, m)
    at, positions = _increasing(t)
    J, alpha = np.ones_like(at), np.full_like(at, alpha_0)
    pressed = body.contact and (alpha_0 > body.star or (alpha_0 == body.star and body.growth(alpha_0) > 0.0))
    state, now, done = (body.swollen(alpha_0) if pressed else alpha_0), 0.0, 0
    while done < len(at):
        rate, bound = (body.stretch_rate, 1.0) if pressed else (body.growth, body.star)
        stays = state == bound or not body.contact  # one that begins at its bound leaves it for good
        values, now = _integrate(_Rate(rate), [state], now, at[done:], None if stays else _Crossing(bound, pressed))
        part = slice(done, done + len(values))
        if pressed:
            J[part], alpha[part] = values[:, 0] ** m, [body.fraction(l) for l in values[:, 0]]
        else:
            alpha[part] = values[:, 0]
        pressed, state = not pressed, body.star if pressed else 1.0  # where the other regime begins, if there is more to do
        done += len(values)
    return J[positions], alpha[positions]


class _Rate:
    """The right-hand side of one autonomous equation, as an integrator of systems wants it."""

    def __init__(self, rate: Callable[[float], float]) -> None:
        self.rate = rate

    def __call__(self, t: float, y: Array) -> list[float]:
        return [self.rate(float(y[0]))]


class _Crossing:
    """Event at which an integration ends: the unknown reaches `bound`, from above or from below."""

    terminal = True

    def __init__(self, bound: float, from_above: bool) -> None:
        self.bound, self.direction = bound, -1.0 if from_above else 1.0

    def __call__(self, t: float, y: Array) -> float:
        return float(y[0]) - self.bound


class _ElasticBody:
    """A uniform elastic body without traction: what a stretch says about the cell fraction."""

    def __init__(self, parameters: TumourParameters, m: int) -> None:
        self.parameters, self.m = parameters, m
        self.star = parameters.alpha_star
        self.contact = parameters.gamma > 0.0

    def growth(self, alpha: float) -> float:
        """Net growth q at the oxygen outside."""
        return float(eq.net_growth(alpha, self.parameters.C_out, *self.parameters.kinetics))

    def tension(self, l: float) -> tuple[float, float]:
        """Elastic Cauchy stress P_r l/J of the stretch l, and its derivative."""
        m, moduli = self.m, self.parameters.moduli
        hoop = l if m > 1 else 1.0
        stress = eq.elastic_stress(l, hoop, m, *moduli)[0]
        slopes = eq.elastic_stress_slopes(l, hoop, m, *moduli)
        slope = slopes[0] + (slopes[1] if m > 1 else 0.0)
        area = l ** (1 - m)  # l/J
        return stress * area, (slope + (1 - m) * stress / l) * area

    def fraction(self, l: float) -> float:
        """Cell fraction whose contact pressure balances the tension H: with w = 1 - alpha a quadratic in w, solved without cancellation,
        ``gamma (1 - w)(1 - alpha_star - w) = H w^2``."""
        gamma, star = self.parameters.gamma, self.star
        tension = max(self.tension(l)[0], 0.0)
        root = np.sqrt((gamma * star) ** 2 + 4.0 * gamma * tension * (1.0 - star))
        return float(1.0 - 2.0 * gamma * (1.0 - star) / (gamma * (2.0 - star) + root))

    def stretch_rate(self, l: float) -> float:
        """l' = l q/(m alpha + l dalpha/dl)."""
        alpha = self.fraction(l)
        fraction_slope = self.tension(l)[1] / eq.contact_pressure_slope(alpha, *self.parameters.contact)
        return float(l * self.growth(alpha) / (self.m * alpha + l * fraction_slope))

    def swollen(self, alpha_0: float) -> float:
        """Stretch at which a body of alpha_0 at rest balances at once, with the cells it has."""

        def excess(l: float) -> float:
            return self.fraction(l) * l**self.m - alpha_0

        high = 2.0
        while excess(high) < 0.0:
            high *= 2.0
        return 1.0 if excess(1.0) >= 0.0 else float(brentq(excess, 1.0, high, xtol=1e-15, rtol=1e-15))


def uniform_growth_eulerian(
    t: ArrayLike, parameters: TumourParameters, m: int, alpha_0: float = 0.8, radius: float = 1.0
) -> tuple[Array, Array]:
    """Uniform growth of a viscous body in which nothing hinders the fluid and oxygen is the same everywhere.

    As `uniform_growth`, for the Eulerian formulation: the velocity is ``e r`` with one rate e, and no traction on the surface means
    ``alpha Sigma + p_out = alpha (2 mu + m lambda) e`` (2.4), so

        alpha' = q(alpha, C_out) - m alpha e,      R' = e R.

    Parameters
    ----------
    t : array_like
        Times, 0 or more, in any order.
    parameters : TumourParameters
        With kappa and Q 0, and alpha_min = alpha_star unless sigma_width > 0.
    m : int
    alpha_0, radius : float
        Cell fraction and radius at t = 0.

    Returns
    -------
    alpha, R : ndarray
        Cell fraction and radius, in the shape of t, to about 1e-10.

    Raises
    ------
    ParameterError
        Where the parameters are none for which this is a solution.
    SolverError
        Where the solution ends before the last of `t`: p_out > 0 may dilute the cells to nothing.
    """
    _require(parameters, kappa=0.0, Q=0.0)
    if parameters.sigma_width == 0.0:
        _require(parameters, alpha_min=parameters.alpha_star)
    _admit(parameters, m, alpha_0, "eulerian")

    def rates(_: float, y: Array) -> list[float]:
        alpha = float(y[0])
        e = eq.free_expansion_rate(alpha, eq.contact_stress(alpha, *parameters.contact), parameters.p_out, m, *parameters.moduli)
        return [eq.net_growth(alpha, parameters.C_out, *parameters.kinetics) - m * alpha * e, e]

    at, positions = _increasing(t)
    values = _integrate(rates, [alpha_0, np.log(radius)], 0.0, at)[0]
    return values[positions, 0], np.exp(values[positions, 1])


class LinearSwelling:
    r"""Slow swelling of an elastic body against its fluid, to first order in the source: Biot's consolidation, reversed.

    A body with alpha = alpha_star = alpha_min at rest and the little oxygen C_out = eps, in which no cells die and none take up oxygen
    (s1 = s2 = s3 = Q = 0), gains cells at the uniform rate ``s = eps alpha_star (1 - alpha_star)``. They push outwards, and fluid is
    sucked in from the surface to fill the space. With ``G = gamma alpha_star/(1-alpha_star)^2``, ``H = 2 mu + lambda + G alpha_star``,
    ``K = lambda + G alpha_star + 2 mu/m`` and ``c = M(alpha_star) H``, the displacement d(R, t) obeys

        d_t = c (R^(1-m) (R^(m-1) d)')',      d(0, t) = 0,      d(R, 0) = 0,
        H d' + (H - 2 mu)(m-1) d/R_0 = G s t      at R_0, where traction and fluid pressure are 0,

    and is, with ``A = G/K``, ``eta = 2 mu (m-1)/H``, ``Psi`` = cos x, J_0(x) or sin(x)/x, the positive roots x_n of
    ``x Psi + eta Psi' = 0`` and ``k_n = x_n/R_0``,

        d/s = A R t/m + A/(2 m c) (R^3/(m+2) - R_0^2 R/m) + B R/m + sum_n c_n Psi'(k_n R) exp(-c k_n^2 t),
        B = -2 mu (m-1) A R_0^2/(m^2 (m+2) c K),      c_n = 2 G/(c H k_n^4 R_0 Psi'(x_n) (1 + (eta^2 - m eta)/x_n^2)).

    What is left out is of second order in eps, over times in which eps t is small.

    Parameters
    ----------
    parameters : TumourParameters
        With kappa > 0; s1, s2, s3, Q, p_out and sigma_width 0; alpha_min = alpha_star, greater than 0.
    m : int
    radius : float
        R_0.
    terms : int
        Terms of the series. They fall as 1/n^3 or faster at t = 0, and like exp(-c (pi n/R_0)^2 t) later.

    Attributes
    ----------
    source : float
        s, by which every method's result is already multiplied.
    roots : ndarray (terms,)
        x_n.
    diffusivity : float
        c.
    """

    def __init__(self, parameters: TumourParameters, m: int, radius: float = 1.0, terms: int = 200) -> None:
        _require(parameters, s1=0.0, s2=0.0, s3=0.0, Q=0.0, p_out=0.0, sigma_width=0.0, alpha_min=parameters.alpha_star)
        if parameters.kappa == 0.0:
            raise ParameterError(
                "parameters.kappa", "0 lets the fluid flow freely, and nothing slows the swelling; it must be above 0 here."
            )
        _admit(parameters, m, parameters.alpha_star, "lagrangian", radius)
        star, (mu, lam) = parameters.alpha_star, parameters.moduli
        self.m, self.radius, self.alpha_star, self._mu = m, radius, star, mu
        self.source = float(eq.net_growth(star, parameters.C_out, *parameters.kinetics))
        self._G = eq.contact_pressure_slope(star, *parameters.contact)
        self._H = 2.0 * mu + lam + self._G * star
        K = lam + self._G * star + 2.0 * mu / m
        self.diffusivity = c = float(eq.mobility(star, *parameters.flow)) * self._H
        eta = 2.0 * mu * (m - 1) / self._H
        self._A = self._G / K
        self._B = -2.0 * mu * (m - 1) * self._A * radius**2 / (m**2 * (m + 2) * c * K)
        self.roots = _roots(m, eta, terms)
        self._k = self.roots / radius
        weight = 1.0 + (eta**2 - m * eta) / self.roots**2
        self._c = 2.0 * self._G / (c * self._H * self._k**4 * radius * _psi_slope(m, self.roots) * weight)

    def displacement(self, R: ArrayLike, t: ArrayLike) -> Array:
        """d at the radius R of the body at rest and the time t, broadcast together."""
        at, time = self._broadcast(R, t)
        m, c, R_0 = self.m, self.diffusivity, self.radius
        steady = self._A * at * time / m + self._A / (2.0 * m * c) * (at**3 / (m + 2) - R_0**2 * at / m) + self._B * at / m
        return self.source * (steady + self._sum(self._c, _psi_slope, at, time))

    def dilation(self, R: ArrayLike, t: ArrayLike) -> Array:
        """e = J - 1, the divergence of d."""
        at, time = self._broadcast(R, t)
        steady = self._A * time + self._A * (at**2 - self.radius**2) / (2.0 * self.m * self.diffusivity) + self._B
        return self.source * (steady - self._sum(self._c * self._k, _psi, at, time))

    def pressure(self, R: ArrayLike, t: ArrayLike) -> Array:
        """Fluid pressure p: negative inside, where fluid is sucked to. It tends to ``s A (R^2 - R_0^2)/(2 m M)``."""
        surface = self.displacement(self.radius, t) / self.radius
        gain = self._G * self.source * np.asarray(t, dtype=float)
        return self._H * self.dilation(R, t) - gain - 2.0 * self._mu * (self.m - 1) * surface

    def fraction_change(self, R: ArrayLike, t: ArrayLike) -> Array:
        """a = alpha - alpha_star: cells gained less the space gained, ``s t - alpha_star e``."""
        return self.source * np.asarray(t, dtype=float) - self.alpha_star * self.dilation(R, t)

    def _broadcast(self, R: ArrayLike, t: ArrayLike) -> tuple[Array, Array]:
        at, time = np.broadcast_arrays(np.asarray(R, dtype=float), np.asarray(t, dtype=float))
        return at, time

    def _sum(self, weights: Array, shape: Callable[[int, Array], Array], at: Array, time: Array) -> Array:
        """Sum of the decaying terms, in the shape of `at`."""
        decay = np.exp(-self.diffusivity * self._k**2 * time[..., np.newaxis])
        total: Array = np.sum(weights * shape(self.m, self._k * at[..., np.newaxis]) * decay, axis=-1)
        return total


def _psi(m: int, x: Array) -> Array:
    """cos x, J_0(x) or sin(x)/x."""
    values = np.cos(x) if m == 1 else jv(0, x) if m == 2 else np.sinc(x / np.pi)
    return np.asarray(values, dtype=float)


def _psi_slope(m: int, x: Array) -> Array:
    """Derivative of `_psi`; for m = 3 by its series near 0, where the closed form cancels."""
    if m < 3:
        return -np.sin(x) if m == 1 else np.asarray(-jv(1, x), dtype=float)
    safe = np.where(x > 0.1, x, 1.0)
    squares = x * x
    series = -x / 3.0 * (1.0 - squares / 10.0 * (1.0 - squares / 28.0 * (1.0 - squares / 54.0 * (1.0 - squares / 88.0))))
    return np.where(x > 0.1, (safe * np.cos(safe) - np.sin(safe)) / (safe * safe), series)


def _roots(m: int, eta: float, count: int) -> Array:
    """The first positive roots of ``x Psi + eta Psi' = 0``, one between any two neighbouring zeros of Psi, for 0 <= eta < m.

    At a zero of Psi the function is eta Psi', whose sign alternates, and near 0 it is ``(1 - eta/m) x > 0``: so there is a root in every
    gap. There is only one: past a zero of Psi, Psi and Psi' share their sign until Psi' changes its own, and from there on to the next zero
    ``-x Psi/Psi'`` falls from infinity to 0, through eta once.
    """
    zeros = jn_zeros(0, count) if m == 2 else np.pi * (np.arange(count) + (0.5 if m == 1 else 1.0))
    if eta == 0.0:
        return np.asarray(zeros, dtype=float)

    def function(x: float) -> float:
        at = np.array(x)
        return float(_psi(m, at) + eta * _psi_slope(m, at) / x)

    edges = [1e-6 * zeros[0], *zeros]
    return np.array([brentq(function, low, high, xtol=1e-15, rtol=1e-14) for low, high in pairwise(edges)])


def _require(parameters: TumourParameters, **wanted: float) -> None:
    """Refuse parameters for which a solution does not hold."""
    for name, value in wanted.items():
        given = getattr(parameters, name)
        if given != value:
            why = " (alpha_star)" if name == "alpha_min" else ""
            raise ParameterError(f"parameters.{name}", f"{given:g} is not allowed in this exact solution; it must be {value:g}{why} here.")


def _admit(parameters: TumourParameters, m: int, alpha_0: float, formulation: str, radius: float = 1.0) -> None:
    """Refuse what every run refuses, and a dimension that is none."""
    if m not in (1, 2, 3):
        raise ParameterError("m", f"{m} is not allowed; the dimension of the body must be 1 (slab), 2 (disk) or 3 (sphere).")
    geometry = TumourGeometry(kind=("slab", "disk", "sphere")[m - 1], radius=radius, formulation=formulation)
    check(parameters, TumourInitial(alpha=alpha_0), geometry, TumourSolver())


def _increasing(t: ArrayLike) -> tuple[Array, Any]:
    """The times without repetition in increasing order, and where each of `t` stands among them."""
    given = np.asarray(t, dtype=float)
    if np.any(~(given >= 0.0)) or np.any(np.isinf(given)):
        raise ParameterError("t", "times must be finite, and 0 or more.")
    at, positions = np.unique(given, return_inverse=True)
    return at, positions.reshape(given.shape)


def _integrate(
    rates: Callable[[float, Array], list[float]], start: list[float], begin: float, at: Array, leave: _Crossing | None = None
) -> tuple[Array, float]:
    """Values (times, unknowns) at those of the increasing times `at` that come before the event `leave`, and when that is.

    Each stretch from one time to the next is integrated for itself: what lies between an integrator's steps is less accurate.
    """
    values, now, y = [], begin, np.array(start)
    for until in at:
        if until > now:
            solution = solve_ivp(rates, (now, until), y, method="DOP853", rtol=ACCURACY, atol=1e-14, events=leave)
            if not solution.success:
                at_time = float(solution.t[-1])
                raise SolverError(f"the solution ends at t = {at_time:.6g}, where it changes without bound.", time=at_time)
            now, y = float(solution.t[-1]), solution.y[:, -1]
            if solution.status == 1:
                break
        values.append(y)
    return np.array(values).reshape(len(values), len(start)), now
