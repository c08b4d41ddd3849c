r"""Exact solutions for growth with one direction of fibres in the plane: what cells that push more along them make of a body.

Cells push rho times as hard along the fibres as across them, ``sigma = -alpha Sigma (I + (rho-1) a (x) a)``, and the fibres themselves
resist by ``k_f``. Here everything is uniform at rest: the fibres' direction, their ratio rho and stiffness k_f, and the
tissue's stiffness and permeability. Lengths along and across are measured in the directions of the fibres at rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from multiphase.errors import ParameterError, SolverError
from tumour import equations as eq
from tumour.exact_tissue import UniformTissue, uniform_stress
from tumour.parameters import TumourParameters

Array = NDArray[np.float64]

ACCURACY = 1e-12
"""Relative tolerance of the integration in time; its results are good to about 1e-10."""


class FibreGrowth:
    r"""Slow growth of a free disk with fibres of one direction, to first order in the source.

    A body with alpha = alpha_star = alpha_min at rest and the little oxygen C_out = eps, in which no cells die and none take up oxygen
    (s1 = s2 = s3 = Q = 0), gains cells at the uniform rate ``s = eps alpha_star (1 - alpha_star)``. With e the dilation, eps(d) the
    strain, G = gamma alpha_star/(1-alpha_star)^2 and the change of the fraction ``a = s t - alpha_star e``, the stress is

        sigma = 2 mu eps(d) + lambda e I - (p + G a) I + (4 k_f eps_along - (rho-1) G a) a_0 (x) a_0,

    without divergence, and without traction on the circle. With kappa = 0 there is no p, and both strains are uniform and grow with t:

        (2 mu + 4 k_f) eps_along + lambda e = rho G a,      2 mu eps_across + lambda e = G a,

    for k_f = 0 ``e = (1+rho) G a/(2 (mu+lambda))`` and ``eps_along - eps_across = (rho-1) G a/(2 mu)``. With kappa > 0 fluid has to
    flow in, ``e_t = M Div(K grad p)`` with p = 0 on the circle. What is there at first decays; what stays is

        d = t g(X) + c(X),      p = A (r^2 - R_0^2)/(2 M tr K)

    with the same strain rates g, A their sum, and a cubic ``c = (x (b_0 + b_1 x^2 + b_2 y^2), y (c_0 + c_1 y^2 + c_2 x^2))``, x along the
    fibres, whose six numbers follow from equilibrium inside (two) and on the circle (four).

    What is left out is of second order in eps, over times in which eps t is small.

    Parameters
    ----------
    parameters : TumourParameters
        Uniform in space; s1, s2, s3, Q, p_out and sigma_width 0; alpha_min = alpha_star, greater than 0.
    radius : float
        R_0.

    Attributes
    ----------
    source : float
        s, by which every method's result is already multiplied.
    rates : (float, float)
        Strain along and across the fibres per unit of time, over s.
    """

    def __init__(self, parameters: TumourParameters, radius: float = 1.0) -> None:
        _require(parameters, s1=0.0, s2=0.0, s3=0.0, Q=0.0, p_out=0.0, sigma_width=0.0, alpha_min=parameters.alpha_star)
        star = parameters.alpha_star
        self.tissue, self.radius, self.alpha_star = UniformTissue(parameters), radius, star
        self.source = float(eq.net_growth(star, parameters.C_out, *parameters.kinetics))
        self._G = float(eq.contact_pressure_slope(star, *parameters.contact))
        self.rates = self._rates()
        self._pressure = 0.0
        if parameters.kappa > 0.0:
            M = float(eq.mobility(star, *parameters.flow))
            self._pressure = sum(self.rates) / (2.0 * M * float(np.trace(self.tissue.permeability)))
        self._cubic = self._late()

    def _stiffness(self) -> tuple[float, float, float, float]:
        """What stands in the stresses along and across the fibres: before their own strain, and before the dilation."""
        of, gain = self.tissue, self._G * self.alpha_star
        return 2.0 * of.mu + 4.0 * of.k_f, 2.0 * of.mu, of.lam + of.rho * gain, of.lam + gain

    def _rates(self) -> tuple[float, float]:
        own_x, own_y, all_x, all_y = self._stiffness()
        along, across = np.linalg.solve([[own_x + all_x, all_x], [all_y, own_y + all_y]], [self.tissue.rho * self._G, self._G])
        return float(along), float(across)

    def _late(self) -> Array:
        """b_0, b_1, b_2, c_0, c_1, c_2: the stresses are ``s_0 + s_1 x^2 + s_2 y^2``, ``r_0 + r_1 x^2 + r_2 y^2`` and T x y."""
        own_x, own_y, all_x, all_y = self._stiffness()
        squared = self.radius**2
        b_0, b_1, b_2, c_0, c_1, c_2 = np.eye(6)
        e = b_0 + c_0, 3.0 * b_1 + c_2, b_2 + 3.0 * c_1
        s = [own_x * own + all_x * dilation for own, dilation in zip((b_0, 3.0 * b_1, b_2), e, strict=True)]
        r = [own_y * own + all_y * dilation for own, dilation in zip((c_0, c_2, 3.0 * c_1), e, strict=True)]
        T = 2.0 * self.tissue.mu * (b_2 + c_2)
        inside, edge = (2.0 * s[1] + T, 2.0 * r[2] + T), (s[0] + squared * s[1], s[1] - s[2] - T, r[0] + squared * r[2], r[2] - r[1] - T)
        # p adds -k, k of r^2 - R_0^2, to s_1, s_2, r_1 and r_2, and k R_0^2 to s_0 and r_0: it is 0 on the circle
        return np.linalg.solve([*inside, *edge], self._pressure * np.array([2.0, 2.0, 0.0, 0.0, 0.0, 0.0]))

    def displacement(self, x: ArrayLike, y: ArrayLike, t: ArrayLike) -> Array:
        """d_x and d_y, (2, ...), at the place (x, y) of the disk at rest about the origin and the time t, broadcast together."""
        along, across, time = self._broadcast(x, y, t)
        b_0, b_1, b_2, c_0, c_1, c_2 = self._cubic
        d_along = along * (self.rates[0] * time + b_0 + b_1 * along**2 + b_2 * across**2)
        d_across = across * (self.rates[1] * time + c_0 + c_1 * across**2 + c_2 * along**2)
        c, s = self.tissue.direction
        return self.source * np.stack([c * d_along - s * d_across, s * d_along + c * d_across])

    def dilation(self, x: ArrayLike, y: ArrayLike, t: ArrayLike) -> Array:
        """e = J - 1, the divergence of d."""
        along, across, time = self._broadcast(x, y, t)
        b_0, b_1, b_2, c_0, c_1, c_2 = self._cubic
        late = b_0 + c_0 + (3.0 * b_1 + c_2) * along**2 + (b_2 + 3.0 * c_1) * across**2
        return np.asarray(self.source * (sum(self.rates) * time + late))

    def pressure(self, x: ArrayLike, y: ArrayLike, t: ArrayLike) -> Array:
        """Fluid pressure p, the same at all late times: negative inside, where fluid is sucked to."""
        along, across, _ = self._broadcast(x, y, t)
        return np.asarray(self.source * self._pressure * (along**2 + across**2 - self.radius**2))

    def fraction_change(self, x: ArrayLike, y: ArrayLike, t: ArrayLike) -> Array:
        """a = alpha - alpha_star: cells gained less the space gained, ``s t - alpha_star e``."""
        return self.source * np.asarray(t, dtype=float) - self.alpha_star * self.dilation(x, y, t)

    def _broadcast(self, x: ArrayLike, y: ArrayLike, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Places along and across the fibres, and times."""
        at_x, at_y, time = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float), np.asarray(t, dtype=float))
        c, s = self.tissue.direction
        return c * at_x + s * at_y, c * at_y - s * at_x, time


def uniform_fibre_growth(t: ArrayLike, parameters: TumourParameters, alpha_0: float = 0.8) -> tuple[Array, Array, Array]:
    r"""Uniform growth of a plane body with fibres of one direction, in which nothing hinders the fluid and oxygen is the same everywhere.

    With kappa = 0 and p_out = 0 there is no fluid pressure, with Q = 0 the oxygen is C_out, and a body that is uniform at first stays so:
    it is stretched by l_1 along the fibres and by l_2 across them. Both stresses of `tumour.exact_tissue.uniform_stress` are 0, and
    ``(l_1 l_2 alpha)' = l_1 l_2 q(alpha, C_out)``. The amount ``n = alpha l_1 l_2`` of cells is integrated; the stretches follow from it by
    Newton's method.

    Parameters
    ----------
    t : array_like
        Times, 0 or more, in any order.
    parameters : TumourParameters
        Uniform in space; kappa, Q, p_out and sigma_width 0, alpha_min = alpha_star.
    alpha_0 : float
        Cell fraction of the body at rest, alpha_star or more, so that cells are in contact from the first.

    Returns
    -------
    along, across, alpha : ndarray
        Stretches and cell fraction, in the shape of t, to about 1e-10.

    Raises
    ------
    ParameterError
        Where the parameters are none for which this is a solution.
    SolverError
        Where no equilibrium is found, or cells lose contact.
    """
    _require(parameters, kappa=0.0, Q=0.0, p_out=0.0, sigma_width=0.0, alpha_min=parameters.alpha_star)
    tissue = UniformTissue(parameters)
    if not parameters.alpha_star <= alpha_0 < 1.0:
        low = parameters.alpha_star
        raise ParameterError("alpha_0", f"{alpha_0:g} is not allowed; it must be at least alpha_star = {low:g} here, and below 1.")
    given = np.asarray(t, dtype=float)
    if np.any(~(given >= 0.0)) or np.any(np.isinf(given)):
        raise ParameterError("t", "times must be finite, and 0 or more.")
    guess = np.zeros(2)

    def balance(n: float) -> tuple[float, float, float]:
        guess[:] = _equilibrium(n, tissue, parameters, guess)
        along, across = np.exp(guess)
        return float(along), float(across), float(n / (along * across))

    def rate(_: float, y: Array) -> list[float]:
        alpha = balance(float(y[0]))[2]
        return [float(y[0]) / alpha * float(eq.net_growth(alpha, parameters.C_out, *parameters.kinetics))]

    at, positions = np.unique(given, return_inverse=True)
    found, now, n = [], 0.0, np.array([alpha_0])
    for until in at:
        if until > now:
            solution = solve_ivp(rate, (now, until), n, method="DOP853", rtol=ACCURACY, atol=1e-14)
            if not solution.success:
                raise SolverError(f"the solution ends at t = {solution.t[-1]:.6g}.", time=float(solution.t[-1]))
            now, n = float(until), solution.y[:, -1]
        found.append(balance(float(n[0])))
    along, across, alpha = np.array(found).T[:, positions.reshape(given.shape)]
    if alpha.size and alpha.min() < parameters.alpha_star:
        raise SolverError("cells lose contact, which this exact solution does not follow.", time=float(given.max()))
    return along, across, alpha


def _equilibrium(n: float, tissue: UniformTissue, parameters: TumourParameters, guess: Array) -> Array:
    """Logarithms of the stretches at which the amount n of cells is in equilibrium, by Newton's method with differences for a tangent.

    Cells below alpha_star attract here, so that the equations have no kink; what ends there is refused in the end.
    """
    gamma, star, _, _ = parameters.contact

    def stresses(logarithms: Array) -> Array:
        along, across = np.exp(logarithms)
        contact = float(eq.contact_pressure(n / (along * across), gamma, star, 0.0, 0.0))
        return np.array(uniform_stress(tissue, float(along), float(across), contact))

    at: Array = guess + max(0.0, 0.5 * np.log(n / 0.999) - 0.5 * float(np.sum(guess)))  # not packed beyond 0.999
    values, last = stresses(at), np.inf
    for _ in range(100):
        slopes = np.column_stack([(stresses(at + step) - stresses(at - step)) / 2e-6 for step in 1e-6 * np.eye(2)])
        change = -np.linalg.solve(slopes, values)
        size = float(np.abs(change).max())
        if size < 1e-10 and size >= 0.1 * last:  # rounding
            return at
        while n * np.exp(-np.sum(at + change)) >= 1.0 or (size > 1e-6 and np.abs(stresses(at + change)).max() >= np.abs(values).max()):
            change, size = 0.5 * change, 0.5 * size
            if size < 1e-10:
                raise SolverError("no equilibrium of the stretches was found.", time=0.0)
        at, last = at + change, size
        values = stresses(at)
    raise SolverError("no equilibrium of the stretches was found.", time=0.0)


def _require(parameters: TumourParameters, **wanted: float) -> None:
    """Refuse parameters for which a solution does not hold."""
    for name, value in wanted.items():
        given = getattr(parameters, name)
        if given != value:
            raise ParameterError(f"parameters.{name}", f"{given:g} is not allowed in this exact solution; it must be {value:g} here.")
