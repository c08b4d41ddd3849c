r"""Loss of symmetry of the growing elastic disk: how small departures from its round shape grow, and when nothing holds them.

A disk that grows in its rim and dies in its core comes under compression along its edge. Whether it stays round is asked here of the radial
states of `tumour.radial`: the equations (2.22) of Zanca, Ahmed, Won, Browning, Flegg & Ruiz-Baier, linearised about them.

**Departure.** The point at (R, theta) of the body at rest is at ``(r + eps U cos k theta) e_r + eps V sin k theta e_theta``, with
``alpha + eps alpha_1 cos k theta`` and so for p and C. In the frame (e_r, e_theta) at rest and now, grad x has the components
``d x_r/dR, (d x_r/d theta - x_theta)/R; d x_theta/dR, (d x_theta/d theta + x_r)/R``, so with l_r = r', l_t = r/R, J = l_r l_t

    F = diag(l_r, l_t) + eps H,      H_rr = U',  H_tt = (k V + U)/R   (times cos),      H_tr = V',  H_rt = -(k U + V)/R   (times sin),
    delta J = j = l_t H_rr + l_r H_tt.

**Stress.** In the plane the cofactors J F^-T of F are linear in F: [[F_tt, -F_tr], [-F_rt, F_rr]]. With ``T = p + alpha Sigma``,
``g = lambda (J - 1) - T`` and ``P = mu F + (g - mu/J) J F^-T``, and with ``T_1 = p_1 + (alpha Sigma)' alpha_1``,

    p_rr = mu (1 + 1/l_r^2) H_rr + g H_tt + l_t (lambda j - T_1)         p_rt = mu H_rt + (mu/J - g) H_tr
    p_tt = mu (1 + 1/l_t^2) H_tt + g H_rr + l_r (lambda j - T_1)         p_tr = mu H_tr + (mu/J - g) H_rt
    p_rr' + (k/R) p_rt + (p_rr - p_tt)/R = 0,      p_tr' - (k/R) p_tt + (p_rt + p_tr)/R = 0        (2.22a)

**Fluxes.** ``G = J F^-1 F^-T`` is the product of the transposed cofactors and the cofactors over J, so that ``delta G_rr = H_tt/l_r - l_t
H_rr/l_r^2`` and ``delta G_tr = -(H_tr/l_r + H_rt/l_t)`` and

    f_r = M (l_t/l_r) p_1' + M p' (H_tt/l_r - l_t H_rr/l_r^2) + M'(alpha) alpha_1 (l_t/l_r) p'
    f_t = -(k/R) M (l_r/l_t) p_1 - M p' (H_tr/l_r + H_rt/l_t)
    dj/dt = (R f_r)'/R + (k/R) f_t                                                                 (2.22c)
    d(J alpha_1 + alpha j)/dt = q j + J (q_alpha alpha_1 + q_C C_1)                                (2.22b)
    (R g_r)'/R + (k/R) g_t = u j + J (u_alpha alpha_1 + u_C C_1),   u the uptake, g = f with M = 1, M' = 0 and C for p     (2.22d)

**Ends.** At R = R_0 nothing pulls, p_rr = p_tr = 0, and p_1 = C_1 = 0. At R = 0 the fields are regular: U = V = p_1 = C_1 = 0 for
k >= 2. For k = 1 the shift U = -V = 1 solves everything (H = 0) and is taken out by holding the centre; k = 0 is a change of the radial
state, V = 0. A quarter disk, which slides on its straight sides, has even k only.

**Stiffness.** The second variation of the energy, for dead p and alpha_1 the integral of ``H p(H)`` (summed over the components) R dR, over
that of ``H H``. *Drained*: fluid has time to flow, p_1 = 0, and cells have none to grow, alpha J stays, so alpha_1 = -alpha j/J and
``lambda j - T_1 = (lambda + alpha (alpha Sigma)'/J) j``. *Undrained*: fluid has no time either, j = 0. Where the undrained stiffness is 0,
j no longer determines U, V and p_1, and rates have no bound. Neither looks at what growth and flow of the radial state do meanwhile; the
linear evolution does.

Modules: `linear` (coefficients at a point), `state` (radial states), `operators` (the grid), `modes` (evolution), `stiffness`, `watch` (for
runs), `picture`. A sphere would have spherical harmonics in place of cos(k theta); it is not done.
"""

from __future__ import annotations

from tumour.stability.modes import ModeGrowth, modes
from tumour.stability.picture import figure
from tumour.stability.stiffness import CriticalTime, Stiffness, critical_time, stiffness

__all__ = ["CriticalTime", "ModeGrowth", "Stiffness", "critical_time", "figure", "modes", "stiffness"]
