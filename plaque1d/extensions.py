r"""The door for users who extend the plaque: further FiPy terms, and further species.

A script passes a function to ``simulate(..., solver="fipy", extra_terms=function)``. It is called once with an
`Extension` and returns a mapping from the name of an equation to what is added to its right-hand side,

    "n":       (L n)_t + ( n (u_n - xi V) )_xi            = k_m L l c  + added
    "l":       (L l)_t + ( l (V - xi V) - l_xi / L )_xi   = -k_l L l c + added
    "w":       the slip equation of `plaque1d.discretisation`, divided by h L (on the faces)
    a species: (L s)_t + ( s (V - xi V) - D s_xi / L )_xi = added

as FiPy terms with `var=` set, FiPy variables, or sums of both. Per unit xi: a source per volume is multiplied by L.
Terms may reach the neighbouring cells, as FiPy's convection and diffusion terms do, and no further.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from multiphase.errors import ParameterError
from multiphase.geometry import MovingGrid, relative_velocity
from multiphase.parameters import nearest
from plaque1d.discretisation import upwinded

if TYPE_CHECKING:
    from plaque1d.fipy_terms import Layout

Array = NDArray[np.float64]
ExtraTerms = Callable[["Extension"], Mapping[str, Any]]
Profile = Callable[[Array], Array]

RESERVED = ("n", "c", "l", "u_n", "u_m", "p_n", "L", "L_rate", "l_wall", "n_wall", "n_total", "c_total", "l_total", "t", "x", "w", "V")


@dataclass(frozen=True)
class Species:
    """A further diffusing species, carried with the mixture as modLDL is. All dimensionless.

    Attributes
    ----------
    variable : fipy.CellVariable
    initial : callable of x, or float
    diffusivity : float
        In units of the diffusivity of modLDL.
    influx : callable of t, or float
        Through the endothelium.
    scale : float
        Typical size, which the error control falls back on while there is little of it.
    """

    variable: Any
    initial: Profile | float
    diffusivity: float
    influx: Callable[[float], float] | float
    scale: float | None
    velocity: Any
    conductance: Any
    source: Any
    terms: Any


class Extension:
    """What `extra_terms` sees: FiPy's module, the mesh, and the plaque's variables at the current iterate.

    Attributes
    ----------
    fipy : module
    mesh, face_mesh : fipy Grid1D over xi
    n, l : fipy.CellVariable
    L, V, t : fipy.Variable
        Width, growth rate and time. `L` is a uniform CellVariable, for use in coefficients.
    implicit : bool
        Whether the added terms depend on the unknowns (explicit sources alone do not); then `tangent` is their derivative.
    """

    def __init__(self, fipy: Any, mesh: Any, n: Any, l: Any, L: Any, grid: MovingGrid) -> None:
        self.fipy, self.mesh, self.n, self.l, self.L, self.grid = fipy, mesh, n, l, L, grid
        self.V = fipy.Variable(value=0.0, name="V")
        self.t = fipy.Variable(value=0.0, name="t")
        self.species: dict[str, Species] = {}
        self._sources: list[tuple[Any, Callable[[Array, float, float], Array], Array]] = []
        self._equations: dict[str, Any] = {}
        self._residuals: dict[str, Array] = {}
        self.tangent: csc_matrix | None = None
        self.implicit = False

    # -- for the user -----------------------------------------------------------------------------------------------

    def add_species(
        self,
        name: str,
        *,
        initial: Profile | float = 0.0,
        diffusivity: float = 1.0,
        influx: Callable[[float], float] | float = 0.0,
        scale: float | None = None,
    ) -> Any:
        """A further species, stored in the result under `name`. Returns its fipy.CellVariable.

        `initial` is a number or a function of x, `influx` the flux through the endothelium, a number or a function of t.
        No flux passes the outer wall. `scale` is its typical size, which the error control falls back on while there is little of
        it; by default the larger of its initial size and of influx L / diffusivity at first, or 1 where both are 0.
        """
        if name in RESERVED or name in self.species or not name.isidentifier():
            raise ParameterError("extra_terms", f"a species cannot be called {name!r}: the name is taken or is not a plain word.")
        if not (np.isfinite(diffusivity) and diffusivity > 0.0):
            raise ParameterError("extra_terms", f"the diffusivity of {name!r} is {diffusivity}; it must be above 0.")
        fp, mesh = self.fipy, self.mesh
        variable = fp.CellVariable(mesh=mesh, name=name, hasOld=True, value=0.0)
        velocity = fp.FaceVariable(mesh=mesh, rank=1, value=0.0)
        conductance = fp.FaceVariable(mesh=mesh, value=0.0)
        source = fp.CellVariable(mesh=mesh, value=0.0)
        terms = (
            fp.TransientTerm(coeff=self.L, var=variable)
            + fp.CentralDifferenceConvectionTerm(coeff=velocity, var=variable)
            - fp.DiffusionTerm(coeff=conductance, var=variable)
            - source
        )
        self.species[name] = Species(variable, initial, diffusivity, influx, scale, velocity, conductance, source, terms)
        return variable

    def source(self, function: Callable[[Array, float, float], Array], *, on_faces: bool = False) -> Any:
        """A variable that follows ``function(xi, t, L)`` in time, for explicit sources; on the faces for "w"."""
        mesh = self.face_mesh if on_faces else self.mesh
        xi = self.grid.faces[1:-1] if on_faces else self.grid.centres
        variable = self.fipy.CellVariable(mesh=mesh, value=0.0)
        self._sources.append((variable, function, xi))
        return variable

    @property
    def face_mesh(self) -> Any:
        """The mesh of the slip equation; its cells are the interior faces."""
        h = self.grid.spacing
        return self.fipy.Grid1D(nx=self.grid.cells - 1, dx=h) + np.array([[0.5 * h]])

    # -- for the scheme ---------------------------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        return bool(self._equations)

    def attach(self, extra_terms: ExtraTerms | None) -> None:
        """Call the user's function and set up what it returns."""
        if extra_terms is None:
            return
        returned = extra_terms(self)
        if not isinstance(returned, Mapping):
            raise ParameterError("extra_terms", f"the function must return a mapping from equations to terms, but returned {returned!r}.")
        added = dict(returned)
        known = ["n", "l", "w", *self.species]
        for name in added:
            if name not in known:
                raise ParameterError("extra_terms", f"there is no equation {name!r}{nearest(name, known)} Equations: {', '.join(known)}.")
        explicit = [variable for variable, _, _ in self._sources]
        self.implicit = bool(self.species) or not all(any(term is source for source in explicit) for term in added.values())
        self._equations = {name: -term for name, term in added.items() if name not in self.species}
        for name, species in self.species.items():
            self._equations[name] = species.terms - added[name] if name in added else species.terms
        for name, term in added.items():
            self._try(name, term)

    def _try(self, name: str, term: Any) -> None:
        """Refuse what is no FiPy term, or cannot be assembled on the mesh of its equation."""
        from fipy.terms.term import Term

        if not isinstance(term, Term | self.fipy.Variable):
            raise ParameterError("extra_terms", f"what is added to {name!r} must be a FiPy term or variable, but is {term!r}.")
        size = self.grid.cells - 1 if name == "w" else self.grid.cells
        try:
            value = np.asarray(term.value if isinstance(term, self.fipy.Variable) else (-term).justResidualVector(dt=1.0))
        except Exception as error:  # FiPy raises many kinds
            raise ParameterError("extra_terms", f"what is added to {name!r} cannot be assembled: {error} (is var= given?)") from error
        if value.shape != (size,):
            raise ParameterError("extra_terms", f"what is added to {name!r} has shape {value.shape}; this equation has ({size},).")

    def initial(self, L: float) -> Array:
        """The initial products L s of all species, one after the other."""
        x = self.grid.centres * L
        products = np.empty((len(self.species), len(x)))
        for i, species in enumerate(self.species.values()):
            products[i] = L * np.asarray(species.initial(x) if callable(species.initial) else species.initial, dtype=float)
        return products.ravel()

    def scales(self, L: float) -> Array:
        """Typical size of each species, at an initial width L."""
        x = self.grid.centres * L
        sizes = []
        for s in self.species.values():
            start = float(np.max(np.abs(s.initial(x) if callable(s.initial) else s.initial)))
            entering = abs(s.influx(0.0) if callable(s.influx) else s.influx) * L / s.diffusivity
            sizes.append(s.scale if s.scale is not None else max(start, entering) or 1.0)
        return np.array(sizes)

    def load(self, t: float, L: float, V: float, x: Array, past: Array, layout: Layout) -> None:
        """Put an iterate, and the weighted past of the species' values, into the variables."""
        self.t.setValue(t)
        self.V.setValue(V)
        for variable, function, xi in self._sources:
            variable.setValue(np.broadcast_to(np.asarray(function(xi, t, L), dtype=float), xi.shape))
        h = self.grid.spacing
        for i, species in enumerate(self.species.values()):
            value = x[layout.extra(i)]
            species.variable.setValue(past[i * layout.cells : (i + 1) * layout.cells])
            species.variable.updateOld()
            species.variable.setValue(value)
            velocity = np.zeros(self.grid.cells + 1)
            conductance = np.zeros(self.grid.cells + 1)
            velocity[1:-1] = relative_velocity(V, self.grid.faces[1:-1], V)
            conductance[1:-1] = upwinded(species.diffusivity / (h * L), velocity[1:-1])
            inner = np.zeros(self.grid.cells)
            inner[0] = (species.influx(t) if callable(species.influx) else species.influx) / h
            species.velocity.setValue(velocity[None, :])
            species.conductance.setValue(conductance * h)
            species.source.setValue(inner)

    def _evaluate(self, dt: float) -> dict[str, Array]:
        h = self.grid.spacing
        values = {}
        for name, equation in self._equations.items():
            if isinstance(equation, self.fipy.Variable):
                values[name] = h * np.asarray(equation.value, dtype=float)
            else:
                values[name] = np.asarray(equation.justResidualVector(dt=dt), dtype=float)
        return values

    def _places(self, layout: Layout) -> dict[str, slice]:
        places = {"n": layout.n, "l": layout.l, "w": layout.w}
        return places | {name: layout.extra(i) for i, name in enumerate(self.species)}

    def add_residuals(self, out: Array, dt: float, layout: Layout) -> None:
        """Add the residuals of the added terms and species to `out`."""
        if not self.active:
            return
        places = self._places(layout)
        for i in range(layout.species):
            out[layout.extra(i)] = 0.0
        self._residuals = self._evaluate(dt)
        for name, value in self._residuals.items():
            out[places[name]] += value

    def differentiate(self, load: Callable[[Array], Any], dt: float, x: Array, layout: Layout) -> None:
        """Set `tangent`, the derivative of the added terms, by differences over three colours of cells."""
        places = self._places(layout)
        base = self._stacked(self._residuals, places, layout)
        rows = np.arange(layout.unknowns)
        entries: list[tuple[NDArray[np.int64], NDArray[np.int64], Array]] = []

        def probe(where: NDArray[np.int64], step: float) -> Array:
            y = x.copy()
            y[where] += step
            load(y)
            return (self._stacked(self._evaluate(dt), places, layout) - base) / step

        for name, place in places.items():
            if name == "w":
                continue
            step = 1e-7 * max(1e-3, float(np.max(np.abs(x[place]))))
            for colour in range(3):
                index = np.arange(colour, layout.cells, 3)
                difference = probe(place.start + index, step)
                for target in places.values():
                    row = rows[target]
                    nearest_probed = colour + 3 * np.round((row - target.start - colour) / 3.0).astype(int)
                    entries.append((row, place.start + np.clip(nearest_probed, colour, index[-1]), difference[row]))
        for scalar in (layout.W, layout.V):
            difference = probe(np.array([scalar]), 1e-7 * max(1e-3, abs(float(x[scalar]))))
            entries.append((rows, np.full_like(rows, scalar), difference))
        load(x)
        r, c, v = (np.concatenate(part) for part in zip(*entries, strict=True))
        self.tangent = csc_matrix((v, (r, c)), shape=(layout.unknowns, layout.unknowns))

    def _stacked(self, residuals: Mapping[str, Array], places: Mapping[str, slice], layout: Layout) -> Array:
        out = np.zeros(layout.unknowns)
        for name, value in residuals.items():
            out[places[name]] = value
        return out

    def totals(self, change: Array, layout: Layout) -> tuple[float, float]:
        """Integrals of what is added to n and to l in this step, linearised as the step was."""
        if not self.active:
            return 0.0, 0.0
        total = self._stacked(self._residuals, self._places(layout), layout)
        if self.tangent is not None:
            total += self.tangent @ change
        return -float(np.sum(total[layout.n])), -float(np.sum(total[layout.l]))
